"""Quadrature over the whole lining, split along and across at the boundaries of contact and of slip reversal.

Lines θ = const run across the lining. On each the levels are linear in z, so that it has one stretch in contact at
most, and one point about which the direction V/|V| turns. The arc is split wherever the integral across is singular
(`find_breaks`), and cut into panels that are no longer than the way to the next singularity, real or complex, so that
one Gauss rule serves them all: far from a reversal of slip a few long ones, next to it ever shorter ones. Only where a
panel's lines come near the turn of V/|V| are the nodes across graded towards it.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.physics.quadrature.arc import NODES_LONG_ARC, compact_nodes, sort_by_counting
from drumsqueal.physics.quadrature.polynomials import compute_once
from drumsqueal.physics.quadrature.surface import (
    Boundaries,
    Densities,
    Level,
    Lining,
    Nodes,
    complex_roots,
    real_roots,
    resolved,
    sine_cosine,
    sum_together,
    swing,
)

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
    """Where along the arc the integral across the lining is singular, or nearly so, as a function of θ.

    On a line θ = const all levels are linear in z: the pressure A + zB, and the velocity W = V_θ + iV_z = C + zD. So
    there are at most one contact boundary z = −A/B and one branch point z = −C/D of |V| with its conjugate, and the
    integral is singular, at real or complex θ, only where one of them meets something:

    - the contact boundary reaches an edge of the lining: A ± wB = 0 with w = b/2,
    - the branch point does: C ± wD = 0,
    - it meets its conjugate: V_z = 0, where all velocity vanishes,
    - it meets the contact boundary: C B − D A = 0, a quartic in e^{iθ},
    - the line of a slip speed at which the friction law has a kink reaches an edge of the lining, C C* = s² at ±w, a
      quartic, too, or it turns back, V_z = ±s,
    - the line of such a speed meets the contact boundary. That would be of degree eight, and is not looked for: the
      force has a jump in its third derivative there, of which 4e-9 of p0 times the area was found at most,
    - a boundary runs off to infinity: B = 0 or D = 0. No such point lies on the lining, but there may be one close to
      where the boundary leaves it.

    Their number depends on what boundaries there may be, not on the state.
    """
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


# Gauss nodes along a panel, across it where the direction of friction hardly turns, and on each of the two stretches of
# a line next to its turn; and sections that the arc is split into in any case. Largest error over p0 times the area of
# 4000 random states, unilateral and bonded, with decays up to 10⁴ s/m, next to twice the nodes: 4e-13; with 12 nodes at
# turns 4e-11. Where the slip reverses along a line at next to no V_z and the law falls within a small part of the slip
# speeds on it, sixteen nodes are few: 2e-6 with exponential laws, 4e-5 with Stribeck's.
ALONG, ACROSS, TURNING, SECTIONS = 16, 6, 16, 2
# How far a singularity must be: from an end of a panel, in its lengths, so that the rule converges like 2.4^(−2 n);
# and the branch points of |V| from the middle line, in half widths: like 7.9^(−2 n).
CLEAR, CLEAR_ACROSS = 0.35, 4.0
# A singularity closer to an end than so many half arcs, or lengths of a stretch across, counts as being so far off.
NARROWEST, NARROWEST_ACROSS = 1e-8, 2e-7
# Where panels end on the way to a singularity, over the length of that way: the shorter they are, the less of the load
# is on them, and the faster they may shrink.
ENDS = np.exp(-np.arange(9.0) * (1.7 + 0.08 * np.arange(9.0)))
LIFTED, FRICTIONLESS = 2, 3  # Gauss nodes where what is summed is a line and a square in z
SMALLEST = 1e-30  # m/s; keeps what a length of zero is divided by off zero
# Across, at a turn: φ = 2t − 1.4t² + 0.4t³. With sixteen nodes and δ ≥ 1e-6, square roots, logarithms and their
# products with polynomials and sines are integrated to 2e-11, against 4e-5 with φ = t and 3e-9 with φ = (3t − t²)/2.
FIRST, SECOND, THIRD = 2.0, -1.4, 0.4
# Where nothing has a boundary what is integrated is smooth all over the lining, and a fixed product of Gauss rules is
# exact to round-off: so many along the arc and across.
SMOOTH_ALONG, SMOOTH_ACROSS = 16, 8


Stretch = tuple[Array, Array]
"""Nodes z (m) and weights (m) on lines across, (nodes, ..., lines)."""


class Stretches(NamedTuple):
    """Stretches of the arc: start (rad), length with its sign (rad), and how long a panel may be there, over it."""

    start: Array
    length: Array
    reach: Array


class LineVelocity(NamedTuple):
    """Slip velocity (m/s) on lines across: V_θ at z = 0, its slope (1/s), and V_z."""

    slip: Array
    slope: Array
    axial: Array


class AreaSurface(eqx.Module):
    """The lining as an area: what spatial motion needs."""

    along: int = eqx.field(static=True, default=ALONG)
    across: int = eqx.field(static=True, default=ACROSS)
    turning: int = eqx.field(static=True, default=TURNING)
    sections: int = eqx.field(static=True, default=SECTIONS)
    always_split: bool = eqx.field(static=True, default=False)

    spatial: bool = eqx.field(static=True, default=True, init=False)

    def integrate(self, lining: Lining, boundaries: Boundaries, densities: Callable[[Nodes], Densities]) -> Densities:
        """Sums over nodes split at the boundaries; where there are none over far fewer, unless always split."""

        def split() -> Densities:
            return self._over_panels(lining, boundaries, densities)

        if self.always_split:
            return split()
        smooth = smooth_nodes(lining)  # here, and not within the branch, they are computed once for all steps
        return jax.lax.cond(is_smooth(lining, boundaries), lambda: sum_together(densities(smooth)), split)

    def _over_panels(
        self, lining: Lining, boundaries: Boundaries, densities: Callable[[Nodes], Densities]
    ) -> Densities:
        """Sum over the panels of each stretch, one after the other, for most that there may be are not there."""
        stretches = self._stretches(lining, boundaries)
        # A panel reaches to `outer`, is there if the one before left something over, and takes all if it may.
        ends = jnp.asarray(np.append(np.inf, ENDS[:-1])), jnp.asarray(ENDS), jnp.asarray(np.append(ENDS[1:], 0.0))

        def panel(start: Array, stop: Array) -> Densities:
            return self._panel(lining, boundaries, densities, start, stop)

        def add_stretch(total: Array, stretch: Stretches) -> tuple[Array, None]:
            start, length, reach = stretch

            def add_panel(total: Array, end: tuple[Array, Array, Array]) -> tuple[Array, None]:
                before, outer, inner = end

                def added() -> Array:
                    near = jnp.where(outer > reach, inner, 0.0)
                    return total + jnp.stack([*panel(start + near * length, start + outer * length).values()])

                # Written so that a state of NaN has forces of NaN.
                return jax.lax.cond(before <= reach, lambda: total, added), None

            return jax.lax.cond(length != 0, lambda: jax.lax.scan(add_panel, total, ends)[0], lambda: total), None

        names = jax.eval_shape(panel, stretches.start[0], stretches.start[0])
        total = jax.lax.scan(add_stretch, jnp.zeros(len(names)), stretches)[0]
        return dict(zip(names, total, strict=True))

    def _stretches(self, lining: Lining, boundaries: Boundaries) -> Stretches:
        """Each piece of the arc, or both halves of it where a singularity is close to one of its ends."""
        half_angle, half_width = lining.half_angle, lining.width / 2
        found = find_breaks(lining, boundaries)
        even = half_angle * np.linspace(-1, 1, self.sections + 1)
        bounds = sort_by_counting(jnp.concatenate([even, jnp.where(found.split, found.angle, half_angle)]))
        gap = distances(found, bounds)
        levels = [each for each in (boundaries.pressure, boundaries.slip) if each is not None]
        gaps = jnp.minimum(jnp.stack([gap[:-1], gap[1:]]), runaway_distances(levels, half_width, bounds))
        reach = jax.lax.stop_gradient(jnp.maximum(gaps / CLEAR, NARROWEST * half_angle))
        piece = bounds[1:] - bounds[:-1]
        whole = jnp.min(reach, axis=0) >= piece
        length = jnp.stack([jnp.where(whole, piece, piece / 2), jnp.where(whole, 0.0, -piece / 2)])
        relative = reach / jnp.where(length == 0, 1.0, jnp.abs(jax.lax.stop_gradient(length)))
        return Stretches(jnp.concatenate([bounds[:-1], bounds[1:]]), length.ravel(), relative.ravel())

    def _panel(
        self, lining: Lining, boundaries: Boundaries, densities: Callable[[Nodes], Densities], start: Array, stop: Array
    ) -> Densities:
        """Sum over the nodes (across, along) between two angles (rad)."""
        theta, along = _gauss(start, stop - start, self.along)
        sine, cosine = sine_cosine(theta)
        line, half_width = lining.outer_radius * jnp.abs(along), lining.width / 2

        def total(*stretches: Stretch) -> Densities:
            sums = [sum_together(densities(Nodes(cosine, sine, z, line * weight))) for z, weight in stretches]
            return jax.tree.map(lambda *parts: sum(parts[1:], start=parts[0]), *sums)

        low, high = jnp.full_like(cosine, -half_width), jnp.full_like(cosine, half_width)
        lifted = []
        if boundaries.pressure is not None:
            low, high = _pressed(*_across_line(boundaries.pressure, cosine, sine), half_width)
            if boundaries.lifted:
                side = jnp.where(low > -half_width, -half_width, high)
                lifted = [_gauss(side, 2 * half_width - (high - low), LIFTED)]
        if boundaries.slip is None:
            return total(*lifted, _gauss(low, high - low, FRICTIONLESS))
        velocity = _line_velocity(boundaries, cosine, sine)
        return jax.lax.cond(
            _is_straight(velocity, half_width, boundaries.kinks),
            lambda: total(*lifted, _gauss(low, high - low, self.across)),
            lambda: total(*lifted, self._turning(velocity, boundaries.kinks, low, high)),
        )

    def _turning(self, velocity: "LineVelocity", kinks: Array, low: Array, high: Array) -> Stretch:
        """Nodes graded towards where the direction of friction turns, cut where the slip speed is that of a kink.

        (nodes, stretches on each side, sides, lines).
        """
        slip, slope, axial = velocity
        centre, along = _slowest(slip, slope, low, high)
        ends = jnp.stack([low, high]) - centre
        whole, side = jnp.abs(ends), jnp.sign(ends)
        cuts = [jnp.minimum(_where_reached(kink, along, jnp.abs(axial), slope), whole) for kink in kinks]
        bounds = jnp.stack([jnp.zeros_like(whole), *cuts, whole])
        start, length = bounds[:-1], bounds[1:] - bounds[:-1]
        reach = jnp.maximum(jnp.abs(slope) * length, SMALLEST)
        speed = along + jnp.abs(axial)
        distance = jax.lax.stop_gradient((speed + jnp.abs(slope) * start) / reach)
        fraction, weight = graded(distance, self.turning, NARROWEST_ACROSS)
        return centre + side * (start + length * fraction), length * weight


class SteadySurface(eqx.Module):
    """The lining in steady sliding and in motion infinitely near to it, in the plane and in space.

    Slip is far from its reversal, and nothing differs across the lining but infinitely little: only where it has lifted
    off the arc is `cut`, straight across. There the pressure vanishes, so that a boundary that moves changes nothing to
    first order. This takes a tenth of the program that looks for boundaries wherever they may be.
    """

    cut: bool = eqx.field(static=True)
    spatial: bool = eqx.field(static=True, default=True, init=False)

    def integrate(self, lining: Lining, boundaries: Boundaries, densities: Callable[[Nodes], Densities]) -> Densities:
        """Sums of the densities."""
        if not self.cut:
            return sum_together(densities(smooth_nodes(lining)))
        arc = compact_nodes(lining, boundaries._replace(slip=None), NODES_LONG_ARC)
        across, weight = np.polynomial.legendre.leggauss(SMOOTH_ACROSS)
        cosine, sine, along = (jnp.ravel(each)[None] for each in (arc.cosine, arc.sine, arc.weight))
        z = (lining.width / 2 * across)[:, None]
        return sum_together(densities(Nodes(cosine, sine, z, along * (weight[:, None] / 2))))


def _across_line(level: Level, cosine: Array, sine: Array) -> tuple[Array, Array]:
    """Value at z = 0 and slope of the level on the lines θ = const."""
    value = level.constant + level.cosine * cosine + level.sine * sine
    return value, level.cosine_slope * cosine + level.sine_slope * sine + jnp.zeros_like(value)


def _line_velocity(boundaries: Boundaries, cosine: Array, sine: Array) -> LineVelocity:
    assert boundaries.slip is not None
    slip, slope = _across_line(boundaries.slip, cosine, sine)
    still = jnp.zeros_like(slip)
    return LineVelocity(slip, slope, still if boundaries.axial is None else boundaries.axial.over(cosine, sine, None))


def _is_straight(velocity: LineVelocity, half_width: Array, kinks: Array) -> Array:
    """Whether the direction of friction hardly turns across any of the lines, nor meets a kink of its law."""
    slip, slope, axial = velocity
    speed, spread = jnp.sqrt(slip * slip + axial * axial), half_width * jnp.abs(slope)
    straight = jnp.all(speed > CLEAR_ACROSS * spread)
    if kinks.size:
        straight &= ~jnp.any((kinks > jnp.min(speed - spread)) & (kinks < jnp.max(speed + spread)))
    return straight


def _pressed(value: Array, slope: Array, half_width: Array) -> tuple[Array, Array]:
    """Ends of the stretch on which value + slope z is positive; of an empty one, both at one side."""
    crossing = jnp.abs(value) < jnp.abs(slope) * half_width
    boundary = -value / jnp.where(crossing, slope, 1.0)
    low = jnp.where(crossing & (slope > 0), boundary, -half_width)
    high = jnp.where(crossing & (slope < 0), boundary, jnp.where(crossing | (value >= 0), half_width, -half_width))
    return low, high


def _slowest(value: Array, slope: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Where in [low, high] value + slope z is closest to zero, and its size there."""
    first, last = value + slope * low, value + slope * high
    inside = first * last < 0
    root = jnp.clip(-value / jnp.where(inside, slope, 1.0), low, high)
    nearest = jnp.where(jnp.abs(first) < jnp.abs(last), low, high)
    return jnp.where(inside, root, nearest), jnp.where(inside, 0.0, jnp.minimum(jnp.abs(first), jnp.abs(last)))


def _where_reached(kink: Array, along: Array, axial: Array, slope: Array) -> Array:
    """How far from the place of slowest slip |V| reaches a slip speed, |V_θ| growing from `along` with the slope."""
    squared = kink * kink - axial * axial
    beyond = jnp.where(squared > along * along, jnp.sqrt(jnp.where(squared > 0, squared, 1.0)) - along, 0.0)
    return beyond / jnp.maximum(jnp.abs(slope), SMALLEST)


def _gauss(start: Array, length: Array, count: int) -> Stretch:
    """Gauss nodes and weights (count, ...) on stretches of given start and length (...)."""
    point, weight = (each.reshape(-1, *[1] * start.ndim) for each in np.polynomial.legendre.leggauss(count))
    return start + length * (point + 1) / 2, length * weight / 2


def graded(distance: Array, count: int, narrowest: float, some: Array | None = None) -> Stretch:
    """Points and weights (count, ...) on [0, 1] that crowd towards zero, for singularities at distances (...) from it.

    x = δ sinh(T φ(t)), sinh T = 1/δ, takes a singularity at the distance δ off zero away from the real axis (Johnston &
    Elliott, Int. J. Numer. Meth. Engng 62 (2005) 564; there φ = t). The flatter end of φ spares most of the nodes that
    the steep one of the sinh calls for. Where `some` is given the exponentials are computed once, if it is true.
    """
    once = (lambda compute: compute()) if some is None else partial(compute_once, some)
    scale = jnp.clip(distance, narrowest, 10.0)  # lengths: one further off is not felt
    stretch = once(lambda: jnp.arcsinh(1 / scale))
    point, weight = (each.reshape(-1, *[1] * distance.ndim) for each in np.polynomial.legendre.leggauss(count))
    t = (point + 1) / 2
    bent: Any = t * (FIRST + t * (SECOND + t * THIRD))
    bent_weight: Any = weight / 2 * (FIRST + t * (2 * SECOND + t * 3 * THIRD))
    shape = (count, *distance.shape)
    if some is not None:
        # Spread once, and then along one axis: exponentials fill the lanes of a processor.
        spread = once(lambda: [jnp.broadcast_to(each, shape) for each in (scale, stretch, bent, bent_weight)])
        scale, stretch, bent, bent_weight = (each.ravel() for each in spread)
    growth = once(lambda: jnp.exp(stretch * bent))
    fraction, weight = scale * (growth - 1 / growth) / 2, scale * stretch * (growth + 1 / growth) / 2 * bent_weight
    return fraction.reshape(shape), weight.reshape(shape)


def smooth_nodes(lining: Lining) -> Nodes:
    """Nodes (across, along); nothing is split."""
    along, along_weight = np.polynomial.legendre.leggauss(SMOOTH_ALONG)
    across, across_weight = np.polynomial.legendre.leggauss(SMOOTH_ACROSS)
    half_angle, half_width = lining.half_angle, lining.width / 2
    # Once for all steps, where a library's function costs nothing and a polynomial fifty operations.
    cosine, sine = jnp.cos(half_angle * along), jnp.sin(half_angle * along)
    weight = lining.outer_radius * half_angle * half_width * across_weight[:, None] * along_weight
    return Nodes(cosine[None], sine[None], (half_width * across)[:, None], weight)


def is_smooth(lining: Lining, boundaries: Boundaries) -> Array:
    """Whether the lining has no boundary, pressed and slipping one way everywhere, nor a branch point of |V| near it.

    With V_θ + i V_z = a + (p e^{iθ} + m e^{−iθ})/2 there is none with |Im θ| < y as long as max(|p|, |m|) cosh y < |a|.
    Nor may the friction law be steep. The condition is sufficient, not necessary: its bounds are over the whole circle.
    """
    pressure, slip, axial, breakpoints, *_ = boundaries
    smooth = jnp.asarray(True)
    if pressure is not None:
        smooth &= pressure.constant >= swing(pressure, lining.width / 2)
    if slip is not None:
        smooth &= jnp.abs(slip.constant) >= swing(slip, lining.width / 2)
        turn = slip if axial is None else Level(*(u + 1j * w for u, w in zip(slip, axial, strict=True)))
        most, mean = swing(turn, lining.width / 2), jnp.abs(turn.constant)
        # How far off the branch points of |V| must be. Along the arc, at least 1.65 half arcs from the real axis: Gauss
        # rules then converge like 3.6^(−2 n), to 1e-18. Across, the swing of the velocity, at most 0.3 of its mean,
        # leaves them 3.3 half widths away: 6.5^(−2 n), 1e-13.
        fraction = jnp.minimum(0.3, 1 / jnp.cosh(1.65 * lining.half_angle))
        smooth &= (most <= fraction * mean) & resolved(breakpoints, mean - most, mean + most)
    return smooth
