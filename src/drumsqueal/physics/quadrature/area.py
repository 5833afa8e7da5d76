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

from drumsqueal.physics.quadrature.arc import sort_by_counting
from drumsqueal.physics.quadrature.breaks import distances, find_breaks
from drumsqueal.physics.quadrature.grading import graded
from drumsqueal.physics.quadrature.levels import Level, sine_cosine
from drumsqueal.physics.quadrature.smooth import is_smooth, smooth_nodes
from drumsqueal.physics.quadrature.sums import Densities, sum_together
from drumsqueal.physics.quadrature.surface import Boundaries, Lining, Nodes

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


class AreaSurface(eqx.Module):
    """The lining as an area: what spatial motion needs."""

    along: int = eqx.field(static=True, default=ALONG)
    across: int = eqx.field(static=True, default=ACROSS)
    sections: int = eqx.field(static=True, default=SECTIONS)
    narrowest: tuple[float, float] = eqx.field(static=True, default=(NARROWEST_ALONG, NARROWEST_ACROSS))
    always_split: bool = eqx.field(static=True, default=False)

    @property
    def spatial(self) -> bool:
        """Whether the nodes differ across the lining."""
        return True

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
