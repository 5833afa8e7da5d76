"""Quadrature over the whole lining, split along and across at the boundaries of contact and of slip reversal.

Lines θ = const run across the lining. On each the levels are linear in z, so that it has one stretch in contact at
most, and one point about which the direction V/|V| turns. The arc is split wherever the integral across is singular
(`breaks.py`), and cut into panels that are no longer than the way to the next singularity, real or complex, so that one
Gauss rule serves them all: far from a reversal of slip a few long ones, next to it ever shorter ones. Only where a
panel's lines come near the turn of V/|V| are the nodes across graded towards it.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.physics.quadrature.arc import NODES_LONG_ARC, compact_nodes, sort_by_counting
from drumsqueal.physics.quadrature.breaks import distances, find_breaks, runaway_distances
from drumsqueal.physics.quadrature.levels import Level, sine_cosine, swing
from drumsqueal.physics.quadrature.polynomials import compute_once
from drumsqueal.physics.quadrature.surface import Boundaries, Densities, Lining, Nodes, resolved, sum_together

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
    bent = t * (FIRST + t * (SECOND + t * THIRD))
    bent_weight = weight / 2 * (FIRST + t * (2 * SECOND + t * 3 * THIRD))
    growth = once(lambda: jnp.exp(stretch * bent))
    return scale * (growth - 1 / growth) / 2, scale * stretch * (growth + 1 / growth) / 2 * bent_weight


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
