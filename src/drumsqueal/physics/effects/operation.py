"""How the brake is driven: drum speed, load and pushes, each evaluated once an instant and handed to every effect."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.interpreter import Interpreted
from drumsqueal.precision import real
from drumsqueal.shown import short


class Constant(eqx.Module):
    """The same value at all times."""

    value: Array = eqx.field(converter=real)

    def __repr__(self) -> str:
        """The value."""
        return short(self.value)

    def at(self, time: ArrayLike) -> tuple[Array, None]:
        """Value at a time (s); it has no rate."""
        del time
        return self.value, None

    @property
    def largest(self) -> Array:
        """Its largest size at any time."""
        return jnp.abs(self.value)

    def since(self, time: float) -> "Constant":
        """Itself."""
        del time
        return self


class PiecewiseLinear(eqx.Module):
    """Piecewise linear between two given points or more, held before the first and after the last."""

    time: Array = eqx.field(converter=real)
    value: Array = eqx.field(converter=real)

    def __repr__(self) -> str:
        """How many points."""
        return f"<{self.time.size} points>"

    def at(self, time: ArrayLike) -> tuple[Array, Array]:
        """Value at a time (s) and its time derivative (per s), from the right at a corner; one search for both."""
        return _interpolated(self.time, self.value, real(time))

    @property
    def largest(self) -> Array:
        """Its largest size at any time."""
        return jnp.max(jnp.abs(self.value))

    def since(self, time: float) -> "PiecewiseLinear":
        """The same with its clock set to zero at a time (s)."""
        return PiecewiseLinear(self.time - time, self.value)


@Interpreted
def _interpolated(times: Array, values: Array, time: Array) -> tuple[Array, Array]:
    """Value and rate at a time (s) between given points."""
    points = times.size
    after = jnp.searchsorted(times, time, side="right")
    piece, last = jnp.clip(after - 1, 0, points - 2), jnp.clip(after - 1, 0, points - 1)
    slope = (values[piece + 1] - values[piece]) / (times[piece + 1] - times[piece])
    rate = jnp.where((after > 0) & (after < points), slope, 0.0)
    return values[last] + rate * (time - times[last]), rate


Schedule = Constant | PiecewiseLinear


class OperatingPoint(NamedTuple):
    """One instant: time (s), drum speed Ω (rad/s), preload p0 (Pa) and its rate (Pa/s; None for a constant load).

    `friction_left` is the fraction of friction that acts; None: all of it. `pushes` are the sizes of forces at points
    (N) with their rates (N/s; None for constant ones), and `further` the preloads with their rates of further shoes.
    """

    time: ArrayLike
    drum_speed: Array
    preload: Array
    preload_rate: Array | None
    friction_left: Array | None = None
    pushes: tuple[tuple[Array, Array | None], ...] = ()
    further: tuple[tuple[Array, Array | None], ...] = ()

    @property
    def preloads(self) -> tuple[tuple[Array, Array | None], ...]:
        """The preload with its rate of every shoe."""
        return ((self.preload, self.preload_rate), *self.further)

    def of_shoe(self, number: int) -> "OperatingPoint":
        """As one of several shoes sees it, whose preload it has; with a rate where that of any shoe changes."""
        preload, rate = self.preloads[number]
        if rate is None and any(each is not None for _, each in self.preloads):
            rate = jnp.zeros_like(preload)
        return self._replace(preload=preload, preload_rate=rate, pushes=(), further=())


class Operation(eqx.Module):
    """Drum speed Ω (rad/s), preload p0 (Pa), sizes of forces at points (N) and further shoes' preloads over time.

    `pushed_shoes` says which of several shoes each force is on.
    """

    drum_speed: Schedule
    preload: Schedule
    pushes: tuple[Schedule, ...] = ()
    further: tuple[Schedule, ...] = ()
    pushed_shoes: tuple[int, ...] = eqx.field(static=True, default=())

    @property
    def preloads(self) -> tuple[Schedule, ...]:
        """That of every shoe."""
        return (self.preload, *self.further)

    @property
    def schedules(self) -> tuple[Schedule, ...]:
        """All of them."""
        return (self.drum_speed, *self.preloads, *self.pushes)

    @property
    def constant(self) -> bool:
        """Whether nothing changes with time."""
        return all(isinstance(each, Constant) for each in self.schedules)

    def at(self, time: ArrayLike) -> OperatingPoint:
        """All of them at a time (s)."""
        pushes, further = (tuple(each.at(time) for each in some) for some in (self.pushes, self.further))
        return OperatingPoint(time, self.drum_speed.at(time)[0], *self.preload.at(time), pushes=pushes, further=further)

    def mapped(self, change: Callable[[Schedule], Schedule]) -> "Operation":
        """The same with each schedule changed."""
        return self.replaced(change(each) for each in self.schedules)

    def replaced(self, schedules: Iterable[Schedule]) -> "Operation":
        """The same with others in the place of `schedules`, in their order."""
        speed, preload, *more = schedules
        count = len(self.further)
        return Operation(speed, preload, tuple(more[count:]), tuple(more[:count]), self.pushed_shoes)

    @property
    def corners(self) -> Array | None:
        """Times (c,) in ascending order (s) at which a rate may jump; None where all are constant."""
        times = [each.time for each in self.schedules if isinstance(each, PiecewiseLinear)]
        return jnp.sort(jnp.concatenate(times)) if times else None
