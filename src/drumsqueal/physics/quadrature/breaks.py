"""Where along the arc the integral across the lining is singular, or nearly so, as a function of θ.

On a line θ = const all levels are linear in z: the pressure A + zB, and the velocity W = V_θ + iV_z = C + zD. So there
are at most one contact boundary z = −A/B and one branch point z = −C/D of |V| with its conjugate, and the integral is
singular, at real or complex θ, only where one of them meets something:

- the contact boundary reaches an edge of the lining: A ± wB = 0 with w = b/2,
- the branch point does: C ± wD = 0,
- it meets its conjugate: V_z = 0, where all velocity vanishes,
- it meets the contact boundary: C B − D A = 0, a quartic in e^{iθ},
- the line of a slip speed at which the friction law has a kink reaches an edge of the lining, C C* = s² at ±w, a
  quartic, too, or it turns back, V_z = ±s,
- the line of such a speed meets the contact boundary. That would be of degree eight, and is not looked for: the force
  has a jump in its third derivative there, of which 4e-9 of p0 times the area was found at most,
- a boundary runs off to infinity: B = 0 or D = 0. No such point lies on the lining, but there may be one close to where
  the boundary leaves it.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.physics.quadrature.levels import Level, complex_roots, real_roots, sine_cosine, swing
from drumsqueal.physics.quadrature.surface import Boundaries, Lining

CLOSE = 0.5  # half arcs; singularities further off the real axis need no split: Gauss nodes converge like 2.4^(−2 n)
FAR = 1e3  # rad; a split without a singularity (finite, so that gradients stay so)
# Half widths from the middle line within which two boundaries are taken to meet on the lining: complex roots are looked
# at where they are closest to the real axis, which may put them somewhat off it.
REACH = 1.5
# Aberth's iteration triples the right digits of simple roots and halves the error of a double one, where the boundaries
# that meet only touch.
ITERATIONS, ROUND_OFF = 16, 1e-15


class Breaks(NamedTuple):
    """Singularities (k,): Re θ, their distance from the real axis (rad), and whether to split there."""

    angle: Array
    distance: Array
    split: Array


def find_breaks(lining: Lining, boundaries: Boundaries) -> Breaks:
    """All of them. Their number depends on what boundaries there may be, not on the state."""
    pressure, slip, axial, _, kinks, *_ = boundaries
    half_angle, half_width = lining.half_angle, lining.width / 2
    sides = half_width * np.array([-1.0, 1.0])
    found = []
    if pressure is not None:
        there, angle = real_roots(pressure.on_line(sides), half_angle)
        found.append(Breaks(jax.lax.stop_gradient(angle), jnp.full_like(angle, FAR), there))
    if slip is not None:
        turn = slip if axial is None else Level(*(u + 1j * w for u, w in zip(slip, axial, strict=True)))
        # So far off zero, the velocity is nowhere zero as close to the real axis as a singularity counts.
        away = jnp.abs(turn.constant) > jnp.cosh(CLOSE * half_angle) * swing(turn, half_width)

        def near() -> Breaks:
            return _turns(lining, boundaries, turn)

        nothing = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), jax.eval_shape(near))
        nothing = nothing._replace(distance=nothing.distance + FAR)
        found.append(jax.lax.cond(away, lambda: nothing, near))
        if kinks.size:
            found.append(_near(half_angle, *_crossings(turn.on_line(sides), kinks)))
            if axial is not None:
                signed = jnp.concatenate([-kinks, kinks])
                level = Level(axial.constant + signed, axial.cosine + 0 * signed, axial.sine + 0 * signed)
                found.append(_near(half_angle, *jax.lax.stop_gradient(complex_roots(level))))
    return _joined(found)


def _turns(lining: Lining, boundaries: Boundaries, turn: Level) -> Breaks:
    """Those where the direction of the velocity turns."""
    pressure, slip, axial, *_ = boundaries
    assert slip is not None
    half_angle, half_width = lining.half_angle, lining.width / 2
    sides = turn.on_line(half_width * np.array([-1.0, 1.0]))
    if axial is None:
        there, angle, distance = complex_roots(sides)
    else:  # its roots with those on the sides
        stacked = (jnp.append(side, each) for side, each in zip(sides[:3], axial[:3], strict=True))
        roots = complex_roots(Level(*stacked))
        there, angle, distance = (each[:, :2] for each in roots)
        still = jax.lax.stop_gradient([each[:, 2] for each in roots])
    # The integral across jumps only where slip reverses all across at once. Elsewhere it is continuous, so it does not
    # matter to a derivative how a split moves, but that motion may be as fast as √ at zero.
    upright = (jnp.asarray(slip.cosine_slope) == 0) & (jnp.asarray(slip.sine_slope) == 0)
    angle = jnp.where(upright, angle, jax.lax.stop_gradient(angle))
    felt = []  # only where the boundary of a level runs over the lining
    if axial is not None:
        felt.append((_near(half_angle, *still), slip))
    if pressure is not None:
        meetings = jax.lax.cond(_may_meet(pressure, turn, half_width), _meetings, _no_meetings, pressure, turn)
        felt.append((_near(half_angle, *meetings), pressure))
    return _joined([_near(half_angle, there, angle, distance), *_on_lining(felt, half_width)])


def _joined(found: list[Breaks]) -> Breaks:
    if not found:
        return Breaks(jnp.zeros(0), jnp.zeros(0), jnp.zeros(0, bool))
    return Breaks(*(jnp.concatenate([part.ravel() for part in parts]) for parts in zip(*found, strict=True)))


def distances(found: Breaks, angle: Array) -> Array:
    """How far each angle (n,) is from the closest singularity (rad)."""
    apart = jnp.abs(angle[:, None] - found.angle)
    apart = jnp.minimum(apart, jnp.abs(2 * jnp.pi - apart))
    return jax.lax.stop_gradient(jnp.min(apart + found.distance, axis=1, initial=FAR))


def _near(half_angle: Array, there: Array, angle: Array, distance: Array) -> Breaks:
    """Split where a complex singularity is close."""
    split = there & (jnp.abs(angle) < half_angle) & (distance < CLOSE * half_angle)
    return Breaks(angle, jnp.where(there, distance, FAR), split)


def _on_lining(felt: Sequence[tuple[Breaks, Level]], half_width: Array) -> list[Breaks]:
    """Those where the boundary of the level with them runs over the lining; elsewhere they are not felt."""
    if not felt:
        return []
    angle = jnp.concatenate([found.angle for found, _ in felt])
    places = np.cumsum([found.angle.size for found, _ in felt])[:-1]
    sine, cosine = (jnp.split(each, places) for each in sine_cosine(angle))  # once for all: it is a long polynomial
    kept = []
    for (found, level), *place in zip(felt, sine, cosine, strict=True):
        there = _runs_over(level, half_width, *place)
        kept.append(Breaks(found.angle, jnp.where(there, found.distance, FAR), found.split & there))
    return kept


def _runs_over(level: Level, half_width: Array, sine: Array, cosine: Array) -> Array:
    """Whether the boundary of a level crosses the lines at angles on the lining, or not far off it."""
    value, slope = level.over(cosine, sine, None), level.cosine_slope * cosine + level.sine_slope * sine
    return jnp.abs(value) <= REACH * half_width * jnp.abs(slope)


def runaway_distances(levels: Sequence[Level], half_width: Array, bounds: Array) -> Array:
    """How far the ends (2, n) of pieces between bounds (n + 1,) are from where one of the levels has no slope in z.

    In rad. That matters only to pieces on which its boundary runs over the lining.
    """
    if not levels:
        return jnp.full((2, len(bounds) - 1), FAR)
    every = Level(*(jnp.stack([jnp.asarray(each) for each in parts])[:, None] for parts in zip(*levels, strict=True)))
    count = len(bounds)
    sine, cosine = sine_cosine(jnp.concatenate([bounds, (bounds[1:] + bounds[:-1]) / 2]))
    crossed = _runs_over(every, half_width, sine[count:], cosine[count:])
    b, c = every.cosine_slope, every.sine_slope
    largest = jnp.sqrt(b * b + c * c)
    # A sine, next to which it is small.
    away = jnp.abs(b * cosine[:count] + c * sine[:count]) / jnp.where(largest > 0, largest, 1.0)
    return jnp.min(jnp.where(crossed, jnp.stack([away[:, :-1], away[:, 1:]]), FAR), axis=1)


def _meetings(pressure: Level, turn: Level) -> tuple[Array, Array, Array]:
    """Complex roots θ of C B − D A: whether there, Re θ and |Im θ|, each (4,), in rad."""
    A, B = _waves(pressure)
    C, D = _waves(turn)
    return _angles(_scaled_roots(_product(C, B) - _product(D, A)))


def _no_meetings(pressure: Level, turn: Level) -> tuple[Array, Array, Array]:
    del pressure, turn
    return jnp.zeros(4, bool), jnp.zeros(4), jnp.zeros(4)


def _may_meet(pressure: Level, turn: Level, half_width: Array) -> Array:
    """Whether the contact boundary and the branch point may both be on the lining, by bounds over the whole circle."""
    return jnp.all(jnp.stack([jnp.abs(each.constant) < swing(each, REACH * half_width) for each in (pressure, turn)]))


def _scaled_roots(coefficients: Array) -> Array:
    """Roots (4,) of a quartic, all zero where its coefficients (5,) are."""
    size = jnp.max(jnp.abs(coefficients.real) + jnp.abs(coefficients.imag))
    some = size > 0
    return jnp.where(some, quartic_roots(coefficients / jnp.where(some, size, 1.0)), 0.0)


def _angles(zeta: Array) -> tuple[Array, Array, Array]:
    """Complex θ with e^{iθ} = ζ: whether there, Re θ and |Im θ|."""
    modulus = jnp.abs(zeta)
    there = jnp.isfinite(modulus) & (modulus > 0)
    zeta = jnp.where(there, zeta, 1.0)
    return there, jnp.arctan2(zeta.imag, zeta.real), jnp.abs(jnp.log(jnp.abs(zeta)))


def _crossings(turn: Level, kinks: Array) -> tuple[Array, Array, Array]:
    """Complex roots θ of |V| = s on lines, for each slip speed s: whether there, Re θ and |Im θ|, each (4, ...)."""
    a, b, c = (jax.lax.stop_gradient(jnp.asarray(x, dtype=complex)) for x in (turn.constant, turn.cosine, turn.sine))
    wave = jnp.stack([(b + 1j * c) / 2, a, (b - 1j * c) / 2])
    squared = _product(wave, jnp.conj(wave[::-1]))[:, :, None] + jnp.zeros(kinks.size)
    coefficients = squared.at[2].add(-(jax.lax.stop_gradient(kinks) ** 2)).reshape(5, -1)
    return _angles(jax.vmap(_scaled_roots, in_axes=1, out_axes=1)(coefficients))


def _waves(level: Level) -> Array:
    """Coefficients (2, 3) of e^{−iθ}, 1 and e^{iθ} in what does not depend on z, and in what z multiplies."""
    a, b, c, *slopes = (jax.lax.stop_gradient(jnp.asarray(x, dtype=complex)) for x in level)
    cosine, sine = jnp.stack([b, slopes[0]]), 1j * jnp.stack([c, slopes[1]])
    constant = jnp.stack([a, jnp.zeros_like(a)])
    return jnp.stack([(cosine + sine) / 2, constant, (cosine - sine) / 2], axis=1)


def _product(one: Array, other: Array) -> Array:
    """Coefficients (5, ...) of the product of two sums of waves (3, ...)."""
    terms = one[:, None] * other[None]
    none = [(0, 0)] * (terms.ndim - 2)
    return sum(jnp.pad(terms[k], [(k, 2 - k), *none]) for k in range(3))  # pyright: ignore[reportReturnType]


def quartic_roots(coefficients: Array) -> Array:
    """Roots (4,) of k0 + k1 x + k2 x² + k3 x³ + k4 x⁴; those at infinity come out large."""

    def improve(state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        count, root, _ = state
        value, slope = coefficients[4] + 0 * root, 0 * root
        for k in (3, 2, 1, 0):
            slope = slope * root + value
            value = value * root + coefficients[k]
        push = jnp.sum(_reciprocal(root[:, None] - root[None, :]), axis=1)
        change = value * _reciprocal(slope - value * push)
        moves = jnp.any(_squared(change) > ROUND_OFF**2 * _squared(root))
        return count + 1, root - change, moves

    def goes_on(state: tuple[Array, Array, Array]) -> Array:
        return (state[0] < ITERATIONS) & state[2]

    # Near the unit circle, where the roots are that count, and without a symmetry, which the iteration would keep.
    start = np.array([0.9, 1.1, 0.95, 1.05]) * np.exp(1j * (0.4 + np.pi / 2 * np.arange(4)))
    # A loop, because written out sixteen times it is computed in forty times the time, and compiled in seventy.
    return jax.lax.while_loop(goes_on, improve, (jnp.asarray(0), jnp.asarray(start), jnp.asarray(True)))[1]


def _squared(number: Array) -> Array:
    return number.real * number.real + number.imag * number.imag


def _reciprocal(number: Array) -> Array:
    """1/z, and 0 of 0. XLA divides complex numbers with care for their overflow, which takes ten times as long."""
    squared = _squared(number)
    return jnp.conj(number) * jnp.where(squared == 0, 0.0, 1 / jnp.where(squared == 0, 1.0, squared))
