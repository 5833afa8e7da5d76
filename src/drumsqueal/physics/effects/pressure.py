"""The pressure between lining and drum: how it rises with compression, and whether contact can be lost.

What the contact's stiffness means stands here: the pressure, its slope, the energy that is stored, lift-off, and how
deep a load presses the lining in. A further normal law is a subclass of `NormalLaw`, and its keys in `ContactTable`.
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.quadrature.surface import Level
from drumsqueal.precision import real
from drumsqueal.scene.laws.table import cubic, slopes
from drumsqueal.shown import short


class NormalLaw(eqx.Module):
    """Pressure p (Pa) over compression u (m), strictly rising, by the level k u (Pa), k the stiffness at u = 0.

    Levels are linear in displacements, so that contact boundaries have closed forms; p has their sign, and begins with
    their slope. Fields that `keys` names are the numbers of `[contact]` that make the law.
    """

    keys: ClassVar[tuple[str, ...]]
    stiffness: eqx.AbstractVar[Array]

    def __repr__(self) -> str:
        """Its numbers in SI."""
        numbers = ((key, getattr(self, key)) for key in self.keys)
        shown = (f"{key}={f'<{each.size} points>' if np.ndim(each) else short(each)}" for key, each in numbers)
        return f"{type(self).__name__}({', '.join(shown)})"

    @abstractmethod
    def rise(self, level: Array) -> Array:
        """p (Pa) at levels from zero on."""

    @abstractmethod
    def level(self, pressure: Any) -> Any:
        """The level (Pa) under a pressure from zero on (Pa)."""

    @property
    def knots(self) -> Any:
        """Levels (K,) in ascending order at which p is not smooth: zero, below which it is a line, and others."""
        return jnp.zeros(1)

    def at(self, level: Array) -> Array:
        """p (Pa) at any level; below zero it goes on with the slope that it has at zero."""
        return jnp.where(level < 0, level, self.rise(jnp.where(level < 0, 0.0, level)))

    def slope(self, level: ArrayLike) -> Array:
        """dp/du (N/m³) at a level."""
        level = jnp.asarray(level)
        return self.stiffness * jax.jvp(self.at, (level,), (jnp.ones_like(level),))[1]

    def tangent(self, pressure: ArrayLike) -> Array:
        """dp/du (N/m³) under a pressure (Pa)."""
        return self.slope(self.level(pressure))

    def stored(self, preload: Array, moved: Array) -> Array:
        """∫ p du (J/m²) from the compression under a preload on (Pa), over a further one e (m).

        p0 e, and the rest by itself: it is of second order, and what stores p0 e elsewhere is taken from it.
        """
        first = self.level(preload)
        ends = jnp.stack(jnp.broadcast_arrays(first, first + self.stiffness * moved))[..., None]
        cuts = jnp.concatenate([jnp.array([-jnp.inf]), self.knots, jnp.array([jnp.inf])])
        start, stop = jnp.clip(ends, cuts[:-1], cuts[1:])[..., None]
        x, weight = np.polynomial.legendre.leggauss(8)  # exact where p is of degree 15 between knots
        half = (stop - start) / 2
        beyond = jnp.sum(half * weight * (self.at(start + half * (1 + x)) - preload), axis=(-2, -1))
        return preload * moved + beyond / self.stiffness

    def stored_by_preload(self, preload: Array, moved: Array) -> Array:
        """The derivative (m) of that by the preload: (N − p0) du0/dp0."""
        return (self.at(self.level(preload) + self.stiffness * moved) - preload) / self.tangent(preload)


class LinearLining(NormalLaw):
    """p = k u; k in N/m³."""

    keys = ("stiffness",)
    stiffness: Array = eqx.field(converter=real)

    def rise(self, level: Array) -> Array:
        """The level."""
        return level

    at = rise  # below zero, too

    @property
    def knots(self) -> Any:
        """None."""
        return np.zeros(0)  # of NumPy: not an operation of the program

    def level(self, pressure: Any) -> Any:
        """The pressure."""
        return pressure

    def tangent(self, pressure: ArrayLike) -> Array:
        """k (N/m³)."""
        del pressure
        return self.stiffness

    def stored(self, preload: Array, moved: Array) -> Array:
        """p0 e + k e²/2 (J/m²)."""
        return moved * (preload + self.stiffness * moved / 2)

    def stored_by_preload(self, preload: Array, moved: Array) -> Array:
        """The compression e (m)."""
        del preload
        return moved


class HardeningLining(NormalLaw):
    """p = k u + h u²; k in N/m³, above zero, and h in N/m⁴."""

    keys = ("stiffness", "hardening")
    stiffness: Array = eqx.field(converter=real)
    hardening: Array = eqx.field(converter=real)

    @property
    def _ratio(self) -> Array:
        """h/k² (1/Pa)."""
        return self.hardening / (self.stiffness * self.stiffness)

    def rise(self, level: Array) -> Array:
        """L + h/k² L²."""
        return level * (1 + self._ratio * level)

    def level(self, pressure: Any) -> Any:
        """The root of that which is not negative; where h is zero it is the pressure to the last digit."""
        return pressure * (2 / (1 + jnp.sqrt(1 + 4 * self._ratio * pressure)))


class MeasuredLining(NormalLaw):
    """p through the points (compression in m, pressure in Pa), which rise from (0, 0): smooth and monotone between.

    Beyond the last point it goes on with the slope there. `slope_at` (N/m³) are the slopes at the points.
    """

    keys = ("compression", "pressure")
    compression: Array
    pressure: Array
    slope_at: Array

    def __init__(self, compression: ArrayLike | Sequence[float], pressure: ArrayLike | Sequence[float]) -> None:
        """Take the points, and find the slopes there."""
        self.compression, self.pressure = real(compression), real(pressure)
        found = slopes(self.compression, self.pressure, jnp)
        secant = jnp.diff(self.pressure) / jnp.diff(self.compression)
        # A parabola through three points may be flat at an end, which would be a contact without stiffness: a tenth.
        ends = jnp.maximum(found[np.array([0, -1])], 0.1 * secant[np.array([0, -1])])
        self.slope_at = jnp.concatenate([ends[:1], found[1:-1], ends[1:]])

    @property
    def stiffness(self) -> Array:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Its slope at zero (N/m³)."""
        return self.slope_at[0]

    @property
    def knots(self) -> Any:
        """The points."""
        return self.stiffness * self.compression

    def rise(self, level: Array) -> Array:
        """The cubic between two points, or the line beyond the last one."""
        depth = level / self.stiffness
        held = jnp.minimum(depth, self.compression[-1])
        left = jnp.sum(held[..., None] >= self.compression[1:-1], axis=-1)
        width = self.compression[left + 1] - self.compression[left]
        inner = self._between(left, width, (held - self.compression[left]) / width)
        return inner + self.slope_at[-1] * (depth - held)

    def level(self, pressure: Any) -> Any:
        """Where the curve has this pressure: between two points by bisection, then by Newton's method."""
        pressure = jnp.asarray(pressure)
        held = jnp.minimum(pressure, self.pressure[-1])
        left = jnp.sum(held[..., None] >= self.pressure[1:-1], axis=-1)
        width = self.compression[left + 1] - self.compression[left]
        curve = lambda fraction: self._between(left, width, fraction)  # noqa: E731
        place, step = jnp.full(held.shape, 0.5), 0.25
        for _ in range(12):  # to 1e-4 of the width, from where Newton's method needs four steps at most
            place, step = jnp.where(curve(place) < held, place + step, place - step), step / 2
        place = jax.lax.stop_gradient(place)
        for _ in range(4):
            value, slope = jax.jvp(curve, (place,), (jnp.ones_like(place),))
            place = place - (value - held) / slope
        found = self.stiffness * (self.compression[left] + width * place + (pressure - held) / self.slope_at[-1])
        # Exactly zero without pressure: a shoe that nothing presses yet touches all over, and round-off would lift it.
        return jnp.where(pressure > 0, found, pressure)

    def _between(self, left: Array, width: Array, fraction: Array) -> Array:
        value, slope = self.pressure, self.slope_at
        return cubic(fraction, width, (value[left], value[left + 1]), (slope[left], slope[left + 1]))


def normal_law(numbers: Mapping[str, Any]) -> NormalLaw:
    """The law that the numbers of a scene with one shoe make, of which those of `[contact]` count."""
    of_contact = {key.removeprefix("contact."): each for key, each in numbers.items() if key.startswith("contact.")}
    given = {key: each for key, each in of_contact.items() if not key.startswith("normal_load")}
    law = next(each for each in NormalLaw.__subclasses__() if set(each.keys) == set(given))
    return law(**given)


class Pressing(eqx.Module):
    """A normal law, or the k_c (N/m³) of the linear one; subclasses say whether contact can be lost."""

    normal: NormalLaw = eqx.field(converter=lambda law: law if isinstance(law, NormalLaw) else LinearLining(law))

    @property
    def stiffness(self) -> Array:
        """Of the level over compression (N/m³): that of the law where nothing presses."""
        return self.normal.stiffness

    def level(self, preload: Any) -> Any:
        """The level (Pa) of the reference, where the pressure is the preload (Pa)."""
        return self.normal.level(preload)

    def depth(self, pressure: ArrayLike) -> Array:
        """How far a pressure (Pa) presses the lining in (m), and 0 where it has no stiffness."""
        stiff = self.stiffness > 0
        return jnp.where(stiff, self.level(pressure) / jnp.where(stiff, self.stiffness, 1.0), 0.0)

    @abstractmethod
    def followed(self, preload: Array, radial: Array) -> Array:
        """Radial displacement that the lining follows (m)."""

    def stored(self, preload: Array, radial: Array) -> Array:
        """Stored energy (J/m²), from the reference on."""
        return self.normal.stored(preload, self.followed(preload, radial))

    def stored_by_preload(self, preload: Array, radial: Array) -> Array:
        """Its derivative by the preload (m)."""
        return self.normal.stored_by_preload(preload, self.followed(preload, radial))


class Bonded(Pressing):
    """N = p(u), also where that is negative."""

    def boundaries(self, level: Level) -> None:
        """No contact boundaries: contact is never lost."""
        del level

    def knots(self, level: Any) -> Level | None:
        """The levels whose roots are where the pressure is not smooth."""
        return _less(level, self.normal.knots)

    def pressure(self, level: Array) -> Array:
        """N (Pa) from the level (Pa)."""
        return self.normal.at(level)

    def touches(self, level: Array) -> Array:
        """Whether the lining is in contact, from the level (Pa): always."""
        return jnp.full_like(level, True, dtype=bool)

    def followed(self, preload: Array, radial: Array) -> Array:
        """u_r (m)."""
        del preload
        return radial


class Unilateral(Pressing):
    """N = max(0, p(u)): the lining can leave the drum."""

    def boundaries(self, level: Level) -> Level:
        """The level whose roots are the contact boundaries."""
        return level

    def knots(self, level: Any) -> Level | None:
        """The levels whose roots are where the pressure is not smooth, but for the contact boundaries."""
        return _less(level, self.normal.knots[1:])

    def pressure(self, level: Array) -> Array:
        """N (Pa) from the level (Pa); where that is just zero, the slope is that of contact."""
        return jnp.where(level < 0, 0.0, self.normal.at(level))

    def touches(self, level: Array) -> Array:
        """Whether the lining is in contact, from the level (Pa); at zero it just touches."""
        return level >= 0

    def followed(self, preload: Array, radial: Array) -> Array:
        """u_r (m), or −u0 where the lining has left the drum."""
        reference = self.level(preload)
        lifted = reference + self.stiffness * radial < 0
        return jnp.where(lifted, -reference / jnp.where(lifted, self.stiffness, 1.0), radial)


PressureLaw = Bonded | Unilateral


def _less(level: Any, knots: Any) -> Level | None:
    """A level less each of some (K,); None without any, and of a lining that bends, whose cells are not cut there."""
    there = knots.size > 0 and isinstance(level, Level)
    return level._replace(constant=level.constant - knots) if there else None


@Interpreted
def level_under(law: PressureLaw, pressure: Array) -> Array:
    """The level (Pa) under pressures (Pa), for what is outside of any program."""
    known = jnp.isfinite(pressure)
    return jnp.where(known, law.level(jnp.where(known, pressure, 0.0)), pressure)


@Interpreted
def tangent_under(law: NormalLaw, pressure: Array) -> Array:
    """dp/du (N/m³) under a pressure (Pa), for what is outside of any program."""
    return law.tangent(pressure)


@Interpreted
def slope_at(law: NormalLaw, level: Array) -> Array:
    """dp/du (N/m³) at levels (Pa), for what is outside of any program."""
    return law.slope(level)


@Interpreted
def depth_under(law: PressureLaw, pressure: Array) -> Array:
    """How far pressures (Pa) press the lining in (m), for what is outside of any program."""
    return law.depth(pressure)
