"""Quadrature over the arc at z = 0, split at the boundaries of contact and of slip reversal (motion in the plane)."""

from collections.abc import Callable, Sequence
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.physics.quadrature.surface import (
    Boundaries,
    Densities,
    Level,
    Lining,
    Nodes,
    quarter_tangents,
    resolved,
    sum_together,
)

# Gauss nodes a piece. The arc is split at its middle and twice for each level that may have boundaries; the longest
# piece is half of it. Errors of the contact force, largest of 300 random states with boundaries, over p0 times the
# area, unilateral and bonded: up to 130° with eight nodes 1.4e-12 both; up to 360° with 24 nodes 4e-15, 8e-15.
# Multiples of eight fill the processor's lanes.
NODES, NODES_LONG_ARC = 8, 24
LONG_ARC = 2.27  # rad; 130° and a little


class ArcSurface(eqx.Module):
    """The lining as a line of width b: what in-plane motion needs.

    What is evaluated a few times only is `compact`: always split wherever it may have to be, all pieces in one
    expression. It takes longer to run and a fraction of the time to compile, the more so with derivatives.
    """

    nodes_per_piece: int = eqx.field(static=True, default=NODES)
    compact: bool = eqx.field(static=True, default=False)

    spatial: bool = eqx.field(static=True, default=False, init=False)

    def integrate(self, lining: Lining, boundaries: Boundaries, densities: Callable[[Nodes], Densities]) -> Densities:
        """Sums over nodes that are split at the boundaries, and at the friction law's slip speeds where it is steep.

        What has none is not split, which makes an evaluation below all boundaries more than twice as fast. Many motions
        at once are better run one after the other (`integrate_many`): under `jax.vmap` each of them takes all ways.
        """
        levels = [level for level in (boundaries.pressure, boundaries.slip) if level is not None]
        # Here, and not within a branch, what does not depend on the state is computed once for all steps.
        end = jnp.tan(lining.half_angle / 4)
        unsplit = _pieces(lining, _boundary_bounds([], end), self.nodes_per_piece)

        def split(kept: Sequence[Level]) -> Densities:
            nodes = _pieces(lining, _boundary_bounds(kept, end), self.nodes_per_piece) if kept else unsplit
            return sum_together(densities(nodes))

        def split_everywhere() -> Densities:
            # On the many pieces that a steep friction law cuts it into, at least 16 nodes.
            return sum_together(densities(compact_nodes(lining, boundaries, max(self.nodes_per_piece, 16))))

        if self.compact:
            return split_everywhere()
        ways = [[level for i, level in enumerate(levels) if way >> i & 1] for way in range(2 ** len(levels))]
        branches: list[Callable[[], Densities]] = [partial(split, kept) for kept in ways]
        ends = jnp.cos(lining.half_angle), jnp.sin(lining.half_angle)
        way = sum(
            (jnp.where(_crosses(level, *ends), 1 << i, 0) for i, level in enumerate(levels)), start=jnp.asarray(0)
        )
        if boundaries.knots is not None:
            bent = boundaries._replace(breakpoints=jnp.zeros(0))
            branches.append(lambda: sum_together(densities(compact_nodes(lining, bent, self.nodes_per_piece))))
            way = jnp.where(jnp.any(_crosses(boundaries.knots, *ends)), len(ways), way)
        if boundaries.slip is not None and boundaries.breakpoints.size:
            branches.append(split_everywhere)
            way = jnp.where(resolved(boundaries.breakpoints, *_slip_speeds(boundaries.slip)), way, len(branches) - 1)
        return jax.lax.switch(way, branches)


def compact_nodes(lining: Lining, boundaries: Boundaries, count: int) -> Nodes:
    """Nodes (pieces, count) of all pieces that there may be, in one expression."""
    return _pieces(lining, _all_bounds(boundaries, jnp.tan(lining.half_angle / 4)), count)


def _pieces(lining: Lining, bounds: Array, count: int) -> Nodes:
    """Nodes (pieces, count) of the pieces of the arc between bounds tan(θ/4).

    They are Gauss nodes in u = tan(θ/4): cos θ and sin θ are rational in it, and so are the roots but for square
    roots. Its branch points u = ±i lie too far from the arc to be felt.
    """
    point, weight = np.polynomial.legendre.leggauss(count)
    low, high = bounds[:-1, None], bounds[1:, None]
    half = (high - low) / 2
    u = (high + low) / 2 + half * point
    fraction = 1 / (1 + u * u)
    half_cosine, half_sine = (1 - u * u) * fraction, 2 * u * fraction
    sine, cosine = 2 * half_sine * half_cosine, 1 - 2 * half_sine * half_sine
    return Nodes(cosine, sine, None, half * weight * fraction * (4 * lining.outer_radius * lining.width))


def _crosses(level: Level, cosine: Array, sine: Array) -> Array:
    """Whether a level vanishes on the arc, by its values at the ends, at cos and sin of half the arc, and extremes."""
    a, b, c = (jnp.asarray(x) for x in (level.constant, level.cosine, level.sine))
    middle, tilt, square = a + b * cosine, c * sine, b * b + c * c
    # Where both ends have one sign, the extreme of the other one must lie between them.
    inner = jnp.where(middle > 0, -b, b) > cosine * jnp.sqrt(square)
    return (middle * middle <= tilt * tilt) | (inner & (square > a * a))


def _boundary_bounds(levels: Sequence[Level], end: Array) -> Array:
    """Sorted bounds tan(θ/4): the ends, the middle and two a level; one that is not on the arc splits it evenly."""
    even = np.delete(np.linspace(-1, 1, 2 * len(levels) + 3)[1:-1], len(levels))
    spread = (even[len(levels) * j + i] for i in range(len(levels)) for j in range(2))
    roots = [root for level in levels for root in quarter_tangents(level)]
    splits = [jnp.where(there & (jnp.abs(u) < end), u, next(spread) * end) for there, u in roots]
    return jnp.stack([-end, *sort_network([*splits, jnp.zeros(())]), end])


def _all_bounds(boundaries: Boundaries, end: Array) -> Array:
    """Sorted bounds tan(θ/4) of as many pieces as there may be; those that are not there are empty, at the end.

    They are quarters of the arc, the boundaries, where the pressure is not smooth, and where the slip speed is largest,
    smallest or one that cuts the friction law: between those, it is resolved.
    """
    kept = (level for level in (boundaries.pressure, boundaries.knots) if level is not None)
    roots = [root for level in kept for root in quarter_tangents(level)]
    if boundaries.slip is not None:
        constant, cosine, sine, *_ = boundaries.slip
        signed = jnp.concatenate([-boundaries.breakpoints, jnp.zeros(1), boundaries.breakpoints])
        roots += quarter_tangents(Level(constant + signed, cosine + 0 * signed, sine + 0 * signed))
        roots += quarter_tangents(Level(jnp.zeros(()), sine, -cosine))
    splits = [jnp.ravel(jnp.where(there & (jnp.abs(u) < end), u, end)) for there, u in roots]
    return sort_by_counting(jnp.concatenate([*splits, end * np.linspace(-1, 1, 5)]))


def _slip_speeds(slip: Level) -> tuple[Array, Array]:
    """Bounds of |V_θ| on the arc."""
    mean, swing = jnp.abs(slip.constant), jnp.abs(slip.cosine) + jnp.abs(slip.sine)
    return jnp.maximum(mean - swing, 0.0), mean + swing


def sort_network(values: list[Array]) -> list[Array]:
    """Sort a short list of arrays elementwise with exchanges only (a sort is a slow call inside a compiled step)."""
    values = list(values)
    for last in range(len(values) - 1, 0, -1):
        for i in range(last):
            low, high = jnp.minimum(values[i], values[i + 1]), jnp.maximum(values[i], values[i + 1])
            values[i], values[i + 1] = low, high
    return values


def sort_by_counting(values: Array) -> Array:
    """Sort along the first axis by counting those below each: for more values than a network is made for."""
    index = np.arange(len(values)).reshape(-1, *[1] * (values.ndim - 1))
    below = (values < values[:, None]) | ((values == values[:, None]) & (index < index[:, None]))
    rank = jnp.sum(below, axis=1)
    return jnp.sum(jnp.where(rank[None] == index[:, None], values[None], 0.0), axis=1)
