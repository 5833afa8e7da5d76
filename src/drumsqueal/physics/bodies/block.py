"""A block on a moving belt."""

from collections.abc import Mapping

import equinox as eqx
import numpy as np
from jax import Array
from numpy.typing import NDArray

from drumsqueal.precision import real


class Block(eqx.Module):
    """Masses (n,) in kg along X, the way the belt goes, and along Y, into the belt, if it can move there."""

    mass: Array = eqx.field(converter=real)

    @property
    def names(self) -> tuple[str, ...]:
        """X, or X and Y."""
        return ("X", "Y")[: self.mass.shape[-1]]

    @property
    def symmetric(self) -> tuple[bool, ...]:
        """Both stay in the plane."""
        return tuple(True for _ in self.names)

    def largest(self, q: Mapping[str, NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """|Y| and |X|."""
        along = np.abs(q["X"])
        return np.abs(q.get("Y", np.zeros_like(along))), along
