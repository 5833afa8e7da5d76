"""A quantity that is constant or prescribed over time: drum speed, preload."""

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.precision import real


class Constant(eqx.Module):
    """The same value at all times."""

    value: Array = eqx.field(converter=real)

    def at(self, time: ArrayLike) -> Array:
        """Value at a time (s)."""
        del time
        return self.value


class Profile(eqx.Module):
    """Piecewise linear between given points, held before the first and after the last."""

    time: Array = eqx.field(converter=real)
    value: Array = eqx.field(converter=real)

    def at(self, time: ArrayLike) -> Array:
        """Value at a time (s)."""
        return jnp.interp(time, self.time, self.value)

    def rate(self, time: ArrayLike) -> Array:
        """Time derivative (per s), from the right at a corner."""
        slope = jnp.diff(self.value) / jnp.diff(self.time)
        padded = jnp.concatenate([jnp.zeros(1), slope, jnp.zeros(1)])
        return padded[jnp.searchsorted(self.time, time, side="right")]


Schedule = Constant | Profile
