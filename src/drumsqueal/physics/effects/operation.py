"""How the brake is driven: the drum's speed and the load, each evaluated once an instant and handed to every effect."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.physics.effects.schedule import Profile, Schedule


class Moment(NamedTuple):
    """One instant: time (s), drum speed Ω (rad/s), preload p0 (Pa) and its rate (Pa/s; None for a constant load).

    `friction_left` is the fraction of friction that acts; None: all of it.
    """

    time: ArrayLike
    drum_speed: Array
    preload: Array
    preload_rate: Array | None
    friction_left: Array | None = None


class Operation(eqx.Module):
    """Drum speed Ω (rad/s) and preload p0 (Pa) over time."""

    drum_speed: Schedule
    preload: Schedule

    def at(self, time: ArrayLike) -> Moment:
        """Both at a time (s)."""
        return Moment(time, self.drum_speed.at(time)[0], *self.preload.at(time))

    @property
    def corners(self) -> Array | None:
        """Times (c,) in ascending order (s) at which the rate of either may jump; None where both are constant."""
        times = [each.time for each in (self.drum_speed, self.preload) if isinstance(each, Profile)]
        return jnp.sort(jnp.concatenate(times)) if times else None
