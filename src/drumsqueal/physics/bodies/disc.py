"""A uniform disc that lies flat on a plate and can slide and spin."""

from collections.abc import Mapping

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from drumsqueal.precision import real


class Disc(eqx.Module):
    """Radius R (m) and mass m (kg); its coordinates are X, Y (m) and the rotation Tz (rad) about its centre."""

    radius: Array = eqx.field(converter=real)
    weight: Array = eqx.field(converter=real)

    @property
    def names(self) -> tuple[str, ...]:
        """X along the plate's motion, Y across it, and Tz."""
        return "X", "Y", "Tz"

    @property
    def symmetric(self) -> tuple[bool, ...]:
        """All three stay in the plane."""
        return True, True, True

    @property
    def area(self) -> Array:
        """π R² (m²)."""
        return jnp.pi * self.radius**2

    @property
    def mass(self) -> Array:
        """Diagonal of the mass matrix over X, Y and Tz, (m, m, ½ m R²), shape (3,)."""
        return self.weight * jnp.stack([jnp.ones(()), jnp.ones(()), self.radius**2 / 2])

    def largest(self, q: Mapping[str, NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Nothing into the plate; along it, on the rim."""
        along = np.hypot(q["X"], q["Y"]) + float(self.radius) * np.abs(q["Tz"])
        return np.zeros_like(along), along
