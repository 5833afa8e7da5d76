"""A quantity that is constant or prescribed over time."""

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.precision import real


class Constant(eqx.Module):
    """The same value at all times."""

    value: Array = eqx.field(converter=real)

    def at(self, time: ArrayLike) -> tuple[Array, None]:
        """Value at a time (s); it has no rate."""
        del time
        return self.value, None


class Profile(eqx.Module):
    """Piecewise linear between two given points or more, held before the first and after the last."""

    time: Array = eqx.field(converter=real)
    value: Array = eqx.field(converter=real)

    def at(self, time: ArrayLike) -> tuple[Array, Array]:
        """Value at a time (s) and its time derivative (per s), from the right at a corner; one search for both."""
        points = self.time.size
        after = jnp.searchsorted(self.time, time, side="right")
        piece, last = jnp.clip(after - 1, 0, points - 2), jnp.clip(after - 1, 0, points - 1)
        slope = (self.value[piece + 1] - self.value[piece]) / (self.time[piece + 1] - self.time[piece])
        rate = jnp.where((after > 0) & (after < points), slope, 0.0)
        return self.value[last] + rate * (time - self.time[last]), rate


Schedule = Constant | Profile
