"""Quadrature over the arc at z = 0, split at the edges of contact and of slip reversal (motion in the plane)."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.bodies.rigid_shoe import RigidShoe
from drumsqueal.quadrature.levels import Level, crosses_zero, quarter_tangents
from drumsqueal.quadrature.sums import Densities, sum_together
from drumsqueal.quadrature.surface import Edges, Nodes

# Gauss nodes a piece. The arc is split at its middle and twice for each level that may have edges; the longest piece is
# half of it. Errors of the contact force, largest of 300 random states with edges, over p0 times the area, unilateral
# and bonded: up to 130° with eight nodes 8e-13, 1e-12; up to 360° with 24 nodes 4e-15, 8e-15. Multiples of eight fill
# the processor's lanes.
NODES, NODES_LONG_ARC = 8, 24
LONG_ARC = 2.27  # rad; 130° and a little


class ArcSurface(eqx.Module):
    """The lining as a line of width b: what in-plane motion needs.

    What is evaluated a few times only is `compact`: always split, all pieces in one expression. It takes twice as long
    to run and a fraction of the time to compile, the more so with derivatives.
    """

    nodes_per_piece: int = eqx.field(static=True, default=NODES)
    compact: bool = eqx.field(static=True, default=False)

    @property
    def spatial(self) -> bool:
        """Whether the nodes differ across the lining."""
        return False

    def integrate(
        self, shoe: RigidShoe, edges: Edges, densities: Callable[[Nodes], Densities], *, smooth: bool
    ) -> Densities:
        """Sums over nodes that are split at the edges; what is `smooth` elsewhere needs no splits where it has none.

        That makes an evaluation below all edges more than twice as fast. Many motions at once are better run one after
        the other (`batch.py`): under `jax.vmap` each of them takes all ways.
        """
        levels = [level for level in (edges.pressure, edges.slip) if level is not None]

        def over(kept: Sequence[Level]) -> Densities:
            pieces = self._pieces(shoe, kept)
            if self.compact:
                pieces = [jax.tree.map(lambda *piece: jnp.stack(piece), *pieces)]
            return sum_together([densities(nodes) for nodes in pieces])

        if self.compact or not (smooth and levels):
            return over(levels)
        ways = [[level for i, level in enumerate(levels) if way >> i & 1] for way in range(2 ** len(levels))]
        way = sum(jnp.where(crosses_zero(level), 1 << i, 0) for i, level in enumerate(levels))
        return jax.lax.switch(way, [lambda kept=kept: over(kept) for kept in ways])

    def _pieces(self, shoe: RigidShoe, levels: Sequence[Level]) -> list[Nodes]:
        """Nodes (nodes per piece,) of each piece.

        They are Gauss nodes in u = tan(θ/4): cos θ and sin θ are rational in it, and so are the roots but for square
        roots. Its branch points u = ±i lie too far from the arc to be felt.
        """
        end = jnp.tan(shoe.half_angle / 4)
        bounds = [-end, *_splits(levels, end), end]
        point, weight = np.polynomial.legendre.leggauss(self.nodes_per_piece)
        area = 4 * shoe.outer_radius * shoe.width
        pieces = []
        for low, high in pairwise(bounds):
            half = (high - low) / 2
            u = (high + low) / 2 + half * point
            share = 1 / (1 + u * u)
            half_cosine, half_sine = (1 - u * u) * share, 2 * u * share
            sine, cosine = 2 * half_sine * half_cosine, 1 - 2 * half_sine * half_sine
            pieces.append(Nodes(cosine, sine, None, half * weight * share * area))
        return pieces


def _splits(levels: Sequence[Level], end: Array) -> list[Array]:
    """Sorted splits tan(θ/4): the middle and two a level; a root that is not on the arc splits it evenly instead."""
    even = np.delete(spread_evenly(2 * len(levels) + 1), len(levels))
    spread = (even[len(levels) * j + i] for i in range(len(levels)) for j in range(2))
    roots = [root for level in levels for root in quarter_tangents(level)]
    splits = [jnp.where(there & (jnp.abs(u) < end), u, next(spread) * end) for there, u in roots]
    return sort_network([*splits, jnp.zeros(())])


def spread_evenly(count: int) -> np.ndarray:
    """Return the `count` inner points that cut [−1, 1] into equal pieces."""
    return np.linspace(-1, 1, count + 2)[1:-1]


def sort_network(values: list[Array]) -> list[Array]:
    """Sort a short list of arrays elementwise with exchanges only (a sort is a slow call inside a compiled step)."""
    values = list(values)
    for last in range(len(values) - 1, 0, -1):
        for i in range(last):
            low, high = jnp.minimum(values[i], values[i + 1]), jnp.maximum(values[i], values[i + 1])
            values[i], values[i + 1] = low, high
    return values
