"""Quadrature over the whole lining, split along and across at the boundaries of contact and of slip reversal.

Lines θ = const run across the lining. On each the levels are linear in z, so that it has one stretch in contact at
most, and one point about which the direction V/|V| turns. The arc is split wherever the integral across is singular
(`breaks.py`). Both ways the nodes are graded towards the singularities, real or complex, and their number is bounded.
"""

from collections.abc import Callable
from itertools import pairwise

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.physics.quadrature.arc import NODES_LONG_ARC, compact_nodes, sort_by_counting
from drumsqueal.physics.quadrature.breaks import distances, find_breaks, runaway_distances
from drumsqueal.physics.quadrature.levels import Level, sine_cosine, swing
from drumsqueal.physics.quadrature.surface import Boundaries, Densities, Lining, Nodes, resolved, sum_together

# Gauss nodes along a panel, across it where the direction of friction hardly turns, and on each of the two stretches of
# a line next to its turn; and sections that the arc is split into in any case.
ALONG, ACROSS, TURNING, SECTIONS = 16, 6, 16, 2
# Panels are as long as, or shorter than, the distance from their end to the next singularity: Gauss rules then converge
# like 4.6^(−2 n). Across, the branch points of |V| are so many half widths from the middle line: like 7.9^(−2 n).
CLEAR, CLEAR_ACROSS = 0.35, 4.0
# A singularity closer to an end than so many half arcs, or lengths of a stretch across, counts as being so far off.
NARROWEST, NARROWEST_ACROSS = 1e-8, 2e-7
# Ends of the panels towards a singularity over the length of the half piece, exp(−0.9 k − 0.05 k²): the shorter they
# are, the less of the load is on them, and the faster they may shrink.
STEPS = np.exp(-np.arange(9.0) * (1.7 + 0.08 * np.arange(9.0)))
LIFTED, FRICTIONLESS = 2, 3  # Gauss nodes where what is summed is a line and a square in z
SMALLEST = 1e-30  # m/s; keeps what a length of zero is divided by off zero
# φ = 2t − 1.4t² + 0.4t³. With sixteen nodes and δ ≥ 1e-6, square roots, logarithms and their products with
# polynomials and sines are integrated to 2e-11, against 4e-5 with φ = t and 3e-9 with φ = (3t − t²)/2.
FIRST, SECOND, THIRD = 2.0, -1.4, 0.4
WIDEST = 10.0  # a singularity further off than so many lengths is not felt
# Where nothing has a boundary what is integrated is smooth all over the lining, and a fixed product of Gauss rules is
# exact to round-off with a tenth of the nodes of a single piece: so many along the arc and across.
SMOOTH_ALONG, SMOOTH_ACROSS = 16, 8
# How far off the branch points of |V| must be. Along the arc, at least this many half arcs from the real axis: Gauss
# rules then converge like 3.6^(−2 n), to 1e-18. Across, the swing of the velocity, at most this fraction of its mean,
# leaves them 3.3 half widths away: 6.5^(−2 n), 1e-13.
CLEARANCE = 1.65
LARGEST_SWING = 0.3


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
            return self._over_pieces(lining, boundaries, densities)

        if self.always_split:
            return split()
        return jax.lax.cond(
            is_smooth(lining, boundaries), lambda: sum_together([densities(smooth_nodes(lining))]), split
        )

    def _over_pieces(
        self, lining: Lining, boundaries: Boundaries, densities: Callable[[Nodes], Densities]
    ) -> Densities:
        """Sum over the stretches of the pieces of the arc, one after the other, for most that there may be are empty."""

        def add_stretch(total: Densities, stretch: tuple[Array, Array, Array]) -> tuple[Densities, None]:
            start, length, reach = stretch

            def add_panel(total: Densities, step: tuple[Array, Array, Array]) -> tuple[Densities, None]:
                before, outer, inner = step

                def with_panel() -> Densities:
                    near = jnp.where(outer > reach, inner, 0.0)
                    return total + jnp.stack([*panel(start + near * length, start + outer * length).values()])

                return jax.lax.cond(before > reach, with_panel, lambda: total), None

            steps = tuple(map(jnp.asarray, (np.append(np.inf, STEPS[:-1]), STEPS, np.append(STEPS[1:], 0.0))))
            return jax.lax.cond(length != 0, lambda: jax.lax.scan(add_panel, total, steps)[0], lambda: total), None

        def panel(near: Array, far: Array) -> Densities:
            return self._panel(lining, boundaries, densities, near, far)

        stretches = self._stretches(lining, boundaries)
        names = jax.eval_shape(lambda: panel(stretches[0][0], stretches[1][0])).keys()
        total = jax.lax.scan(add_stretch, jnp.zeros(len(names)), stretches)[0]
        return dict(zip(names, total))

    def _stretches(self, lining: Lining, boundaries: Boundaries) -> tuple[Array, Array, Array]:
        """Where a stretch of the arc starts (rad), its length with sign, and how far a panel may reach there, over that.

        A piece is one, or two from its ends to its middle where there is a singularity close to one of them.
        """
        half_angle, half_width = lining.half_angle, lining.width / 2
        found = find_breaks(lining, boundaries)
        even = half_angle * np.linspace(-1, 1, self.sections + 1)
        bounds = sort_by_counting(jnp.concatenate([even, jnp.where(found.split, found.angle, half_angle)]))
        low, high = bounds[:-1], bounds[1:]
        gap = distances(found, bounds)
        gaps = [gap[:-1], gap[1:]]
        for level in (boundaries.pressure, boundaries.slip):
            if level is not None:
                gaps = [jnp.minimum(*each) for each in zip(gaps, runaway_distances(level, half_width, bounds), strict=True)]
        reaches = [jnp.maximum(each / CLEAR, NARROWEST * half_angle) for each in gaps]
        piece = high - low
        whole = jnp.minimum(*reaches) >= piece
        length = jnp.concatenate([jnp.where(whole, piece, piece / 2), jnp.where(whole, 0.0, -piece / 2)])
        size = jnp.where(length == 0, 1.0, jnp.abs(length))
        return jnp.concatenate([low, high]), length, jax.lax.stop_gradient(jnp.concatenate(reaches) / size)

    def _panel(
        self,
        lining: Lining,
        boundaries: Boundaries,
        densities: Callable[[Nodes], Densities],
        near: Array,
        far: Array,
    ) -> Densities:
        """Sum over Gauss nodes (lines across, angles) between two angles (rad)."""
        theta, weight = _gauss(near, far - near, self.along)
        sine, cosine = sine_cosine(theta)
        line = lining.outer_radius * jnp.abs(weight)
        half_width = lining.width / 2

        def total(groups: list[list[tuple[Array, Array]]]) -> Densities:
            nodes = [[Nodes(cosine, sine, z, line * weight) for z, weight in group] for group in groups]
            sums = [sum_together([densities(each) for each in group]) for group in nodes]
            return jax.tree.map(lambda *parts: sum(parts[1:], start=parts[0]), *sums)

        low, high = jnp.full_like(cosine, -half_width), jnp.full_like(cosine, half_width)
        lifted = []
        if boundaries.pressure is not None:
            low, high = _pressed(*_across_line(boundaries.pressure, cosine, sine), half_width)
            start = jnp.where(low > -half_width, -half_width, high)
            lifted = [[_gauss(start, 2 * half_width - (high - low), LIFTED)]]
        if boundaries.slip is None:
            return total([*lifted, [_gauss(low, high - low, FRICTIONLESS)]])
        slip, slope = _across_line(boundaries.slip, cosine, sine)
        axial = jnp.zeros_like(slip) if boundaries.axial is None else _across_line(boundaries.axial, cosine, sine)[0]
        speed, spread = jnp.sqrt(slip * slip + axial * axial), half_width * jnp.abs(slope)
        straight = jnp.all(speed > CLEAR_ACROSS * spread)
        if boundaries.kinks.size:
            slowest, fastest = jnp.min(speed - spread), jnp.max(speed + spread)
            straight &= ~jnp.any((boundaries.kinks > slowest) & (boundaries.kinks < fastest))
        return jax.lax.cond(
            straight,
            lambda: total([*lifted, [_gauss(low, high - low, self.across)]]),
            lambda: total([*lifted, self._turning(boundaries, low, high, slip, slope, axial)]),
        )

    def _turning(
        self, boundaries: Boundaries, low: Array, high: Array, slip: Array, slope: Array, axial: Array
    ) -> list[tuple[Array, Array]]:
        """Nodes z on each line and their weights, graded towards where the direction of friction turns."""
        centre, along = _slowest(slip, slope, low, high)
        speed = along + jnp.abs(axial)
        cuts = [_where_reached(kink, along, speed - along, slope) for kink in boundaries.kinks]
        parts = []
        for end in (low, high):
            whole, side = jnp.abs(end - centre), jnp.sign(end - centre)
            bounds = [jnp.zeros_like(whole), *(jnp.minimum(cut, whole) for cut in cuts), whole]
            for start, length in ((start, stop - start) for start, stop in pairwise(bounds)):
                reach = jnp.maximum(jnp.abs(slope) * length, SMALLEST)
                distance = jax.lax.stop_gradient((speed + jnp.abs(slope) * start) / reach)
                fraction, weight = graded(distance, self.turning, NARROWEST_ACROSS)
                parts.append((centre + side * (start + length * fraction), length * weight))
        return parts


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
            return sum_together([densities(smooth_nodes(lining))])
        arc = compact_nodes(lining, boundaries._replace(slip=None), NODES_LONG_ARC)
        across, weight = np.polynomial.legendre.leggauss(SMOOTH_ACROSS)
        cosine, sine, along = (jnp.ravel(each)[None] for each in (arc.cosine, arc.sine, arc.weight))
        z = (lining.width / 2 * across)[:, None]
        return sum_together([densities(Nodes(cosine, sine, z, along * (weight[:, None] / 2)))])


def _across_line(level: Level, cosine: Array, sine: Array) -> tuple[Array, Array]:
    """Value at z = 0 and slope of the level on the lines θ = const."""
    value = level.constant + level.cosine * cosine + level.sine * sine
    return value, level.cosine_slope * cosine + level.sine_slope * sine + jnp.zeros_like(value)


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


def _gauss(start: Array, length: Array, count: int) -> tuple[Array, Array]:
    """Gauss nodes and weights (count, ...) on stretches of given start and length (...)."""
    point, weight = (each.reshape(-1, *[1] * start.ndim) for each in np.polynomial.legendre.leggauss(count))
    return start + length * (point + 1) / 2, length * weight / 2


def graded(distance: Array, count: int, narrowest: float) -> tuple[Array, Array]:
    """Points and weights (count, ...) on [0, 1] that crowd towards zero, for singularities at distances (...) from it.

    x = δ sinh(T φ(t)), sinh T = 1/δ, takes a singularity at the distance δ off zero away from the real axis (Johnston &
    Elliott, Int. J. Numer. Meth. Engng 62 (2005) 564; there φ = t). The flatter end of φ spares most of the nodes that
    the steep one of the sinh calls for.
    """
    scale = jnp.clip(distance, narrowest, WIDEST)
    stretch = jnp.arcsinh(1 / scale)
    point, weight = (each.reshape(-1, *[1] * distance.ndim) for each in np.polynomial.legendre.leggauss(count))
    t = (point + 1) / 2
    bent = t * (FIRST + t * (SECOND + t * THIRD))
    bent_weight = weight / 2 * (FIRST + t * (2 * SECOND + t * 3 * THIRD))
    growth = jnp.exp(stretch * bent)
    return scale * (growth - 1 / growth) / 2, scale * stretch * (growth + 1 / growth) / 2 * bent_weight


def smooth_nodes(lining: Lining) -> Nodes:
    """Nodes (across, along); nothing is split."""
    along, along_weight = np.polynomial.legendre.leggauss(SMOOTH_ALONG)
    across, across_weight = np.polynomial.legendre.leggauss(SMOOTH_ACROSS)
    half_angle, half_width = lining.half_angle, lining.width / 2
    sine, cosine = sine_cosine(half_angle * along)
    weight = lining.outer_radius * half_angle * half_width * across_weight[:, None] * along_weight
    return Nodes(cosine[None], sine[None], (half_width * across)[:, None], weight)


def is_smooth(lining: Lining, boundaries: Boundaries) -> Array:
    """Whether the lining has no boundary, pressed and slipping one way everywhere, nor a branch point of |V| near it.

    With V_θ + i V_z = a + (p e^{iθ} + m e^{−iθ})/2 there is none with |Im θ| < y as long as max(|p|, |m|) cosh y < |a|.
    Nor may the friction law be steep. The condition is sufficient, not necessary: its bounds are over the whole circle.
    """
    pressure, slip, axial, breakpoints, _ = boundaries
    smooth = jnp.asarray(True)
    if pressure is not None:
        smooth &= pressure.constant >= swing(pressure, lining.width / 2)
    if slip is not None:
        smooth &= jnp.abs(slip.constant) >= swing(slip, lining.width / 2)
        turn = slip if axial is None else Level(*(u + 1j * w for u, w in zip(slip, axial, strict=True)))
        most, mean = swing(turn, lining.width / 2), jnp.abs(turn.constant)
        fraction = jnp.minimum(LARGEST_SWING, 1 / jnp.cosh(CLEARANCE * lining.half_angle))
        smooth &= (most <= fraction * mean) & resolved(breakpoints, mean - most, mean + most)
    return smooth
