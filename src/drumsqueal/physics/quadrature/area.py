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
from drumsqueal.physics.quadrature.breaks import distances, find_breaks
from drumsqueal.physics.quadrature.levels import Level, sine_cosine
from drumsqueal.physics.quadrature.surface import Boundaries, Densities, Lining, Nodes, resolved, sum_together

# Nodes on each half piece of the arc, and on each of the two stretches of a line next to the turn of V/|V|; and
# sections that the arc is split into in any case. At the worst state found for a rule with two sections the error over
# p0 times the area is 2e-7 with 18 nodes along, 1e-8 with 24, and 2e-9 with three sections. Across, 40 nodes do no
# better.
ALONG, ACROSS, SECTIONS = 24, 12, 3
# A singularity closer to an end than so many lengths of the half piece counts as being so far off. With 1e-5 along
# instead, up to 2e-7 is lost, with 2e-6 5e-8.
NARROWEST_ALONG, NARROWEST_ACROSS = 8e-8, 2e-7
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
    sections: int = eqx.field(static=True, default=SECTIONS)
    narrowest: tuple[float, float] = eqx.field(static=True, default=(NARROWEST_ALONG, NARROWEST_ACROSS))
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
        """Sum over the pieces of the arc, one after the other, for most of those there may be are empty."""
        bounds, distance = self._bounds(lining, boundaries)

        def piece(low: Array, high: Array, gap: Array) -> Densities:
            groups = self._parts(lining, boundaries, low, high, gap)
            sums = [sum_together([densities(nodes) for nodes in group]) for group in groups]
            return jax.tree.map(lambda *parts: sum(parts[1:], start=parts[0]), *sums)

        def add(total: Densities, bound: tuple[Array, Array, Array]) -> tuple[Densities, None]:
            def with_piece() -> Densities:
                return jax.tree.map(jnp.add, total, piece(*bound))

            return jax.lax.cond(bound[1] > bound[0], with_piece, lambda: total), None

        each = bounds[:-1], bounds[1:], jnp.stack([distance[:-1], distance[1:]], axis=1)
        nothing = jax.tree.map(
            lambda x: jnp.zeros(x.shape, x.dtype), jax.eval_shape(lambda: piece(*(part[0] for part in each)))
        )
        return jax.lax.scan(add, nothing, each)[0]

    def _bounds(self, lining: Lining, boundaries: Boundaries) -> tuple[Array, Array]:
        """Sorted bounds of the pieces, the empty ones last, and how far each is from a singularity (rad)."""
        half_angle = lining.half_angle
        found = find_breaks(lining, boundaries)
        even = half_angle * np.linspace(-1, 1, self.sections + 1)
        bounds = sort_by_counting(jnp.concatenate([even, jnp.where(found.split, found.angle, half_angle)]))
        return bounds, distances(found, bounds)

    def _parts(self, lining: Lining, boundaries: Boundaries, low: Array, high: Array, gap: Array) -> list[list[Nodes]]:
        """Nodes of a piece of the arc, whose halves are graded towards its ends, in groups of one shape.

        They are (2, lines, nodes a line); the parts are not joined, for a joint would be a branch at each node.
        """
        half = (high - low) / 2
        fraction, fraction_weight = graded(gap / jax.lax.stop_gradient(half), self.along, self.narrowest[0])
        theta = jnp.stack([low, high])[:, None] + half * np.array([[1.0], [-1.0]]) * fraction
        sine, cosine = sine_cosine(theta)
        line = lining.outer_radius * half * fraction_weight
        groups = self._across(lining.width / 2, boundaries, cosine, sine)

        def nodes(z: Array, weight: Array) -> Nodes:
            return Nodes(cosine[..., None], sine[..., None], z, line[..., None] * weight)

        return [[nodes(*part) for part in group] for group in groups]

    def _across(
        self, half_width: Array, boundaries: Boundaries, cosine: Array, sine: Array
    ) -> list[list[tuple[Array, Array]]]:
        """Nodes z on each line and their weights: what has lifted off, if anything can, and what is pressed."""
        low, high = jnp.full_like(cosine, -half_width), jnp.full_like(cosine, half_width)
        groups = []
        if boundaries.pressure is not None:
            low, high = _pressed(*_across_line(boundaries.pressure, cosine, sine), half_width)
            start = jnp.where(low > -half_width, -half_width, high)
            groups.append([_gauss(start, 2 * half_width - (high - low), LIFTED)])
        if boundaries.slip is None:
            return [*groups, [_gauss(low, high - low, FRICTIONLESS)]]
        slip, slope = _across_line(boundaries.slip, cosine, sine)
        centre, along = _turning(slip, slope, low, high)
        speed = along if boundaries.axial is None else along + jnp.abs(_across_line(boundaries.axial, cosine, sine)[0])
        cuts = [_where_reached(kink, along, speed - along, slope) for kink in boundaries.kinks]
        parts = []
        for end in (low, high):
            whole, side = jnp.abs(end - centre), jnp.sign(end - centre)
            bounds = [jnp.zeros_like(whole), *(jnp.minimum(cut, whole) for cut in cuts), whole]
            for start, length in ((start, stop - start) for start, stop in pairwise(bounds)):
                reach = jnp.maximum(jnp.abs(slope) * length, SMALLEST)
                distance = jax.lax.stop_gradient((speed + jnp.abs(slope) * start) / reach)
                fraction, weight = graded(distance, self.across, self.narrowest[1])
                z = centre[..., None] + side[..., None] * (start[..., None] + length[..., None] * fraction)
                parts.append((z, length[..., None] * weight))
        return [*groups, parts]


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


def _turning(value: Array, slope: Array, low: Array, high: Array) -> tuple[Array, Array]:
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
    """Gauss nodes and weights (..., count) on stretches of given start and length."""
    point, weight = np.polynomial.legendre.leggauss(count)
    return start[..., None] + length[..., None] * (point + 1) / 2, length[..., None] * weight / 2


def graded(distance: Array, count: int, narrowest: float) -> tuple[Array, Array]:
    """Points and weights (..., count) on [0, 1] that crowd towards zero, for singularities at distances (...) from it.

    x = δ sinh(T φ(t)), sinh T = 1/δ, takes a singularity at the distance δ off zero away from the real axis (Johnston &
    Elliott, Int. J. Numer. Meth. Engng 62 (2005) 564; there φ = t). The flatter end of φ spares most of the nodes that
    the steep one of the sinh calls for.
    """
    scale = jnp.clip(distance, narrowest, WIDEST)[..., None]
    stretch = jnp.arcsinh(1 / scale)
    point, weight = np.polynomial.legendre.leggauss(count)
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
        smooth &= pressure.constant >= _swing(pressure, lining.width / 2)
    if slip is not None:
        smooth &= jnp.abs(slip.constant) >= _swing(slip, lining.width / 2)
        turn = slip if axial is None else Level(*(u + 1j * w for u, w in zip(slip, axial, strict=True)))
        swing, mean = _swing(turn, lining.width / 2), jnp.abs(turn.constant)
        fraction = jnp.minimum(LARGEST_SWING, 1 / jnp.cosh(CLEARANCE * lining.half_angle))
        smooth &= (swing <= fraction * mean) & resolved(breakpoints, mean - swing, mean + swing)
    return smooth


def _swing(level: Level, half_width: Array) -> Array:
    """Bound of max(|p|, |m|), p, m = (b + b′z) ∓ i (c + c′z), over the lining."""
    middle = _largest(level.cosine, level.sine)
    return middle + half_width * _largest(level.cosine_slope, level.sine_slope)


def _largest(b: Array | complex, c: Array | complex) -> Array:
    return jnp.maximum(jnp.abs(b - 1j * c), jnp.abs(b + 1j * c))
