"""Quadrature over the arc at z = 0, split at the edges of contact and of slip reversal (motion in the plane)."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.bodies.rigid_shoe import RigidShoe
from drumsqueal.quadrature.levels import Level, quarter_tangents

# Gauss nodes a piece where edges of contact and of slip make five; fewer pieces, which are longer, have twice as many.
# The longest is the whole arc. Errors of the contact force, largest of 300 random states with edges, over p0 times
# the area: up to 130° with eight nodes 5e-13, up to 360° with 24 2e-15. Multiples of eight fill the processor's lanes.
NODES, NODES_LONG_ARC = 8, 24
LONG_ARC = 2.27  # rad; 130° and a little


class Nodes(NamedTuple):
    """Quadrature nodes on the lining: cos θ, sin θ, z (m, None on the line z = 0) and weight (m²)."""

    cosine: Array
    sine: Array
    z: Array | None
    weight: Array


class ArcSurface(eqx.Module):
    """The lining as a line of width b: what in-plane motion needs."""

    nodes_per_piece: int = eqx.field(static=True, default=NODES)

    def nodes(self, shoe: RigidShoe, pressure: Level | None, slip: Level | None, axial: Level | None = None) -> Nodes:
        """Nodes (pieces, nodes per piece) split at the roots of the given levels (None: no edges of that kind).

        They are Gauss nodes in u = tan(θ/4): cos θ and sin θ are rational in it, and so are the roots but for square
        roots. Its branch points u = ±i lie as far from the arc as not to be felt.
        """
        del axial  # vanishes in the plane
        end = jnp.tan(shoe.half_angle / 4)
        levels = [level for level in (pressure, slip) if level is not None]
        bounds = jnp.stack([-end, *_splits(levels, end), end])
        middle, half = (bounds[1:] + bounds[:-1]) / 2, (bounds[1:] - bounds[:-1]) / 2
        point, weight = np.polynomial.legendre.leggauss(self.nodes_per_piece * (1 if len(levels) == 2 else 2))
        u = middle[:, None] + half[:, None] * point
        share = 1 / (1 + u * u)
        half_cosine, half_sine = (1 - u * u) * share, 2 * u * share
        sine, cosine = 2 * half_sine * half_cosine, 1 - 2 * half_sine * half_sine
        return Nodes(cosine, sine, None, half[:, None] * weight * share * (4 * shoe.outer_radius * shoe.width))


def _splits(levels: list[Level], end: Array) -> list[Array]:
    """Sorted splits tan(θ/4), two a level; a root that is not on the arc splits it evenly instead."""
    even = spread_evenly(2 * len(levels))
    spread = (even[len(levels) * j + i] for i in range(len(levels)) for j in range(2))
    roots = [root for level in levels for root in quarter_tangents(level)]
    return sort_network([jnp.where(there & (jnp.abs(u) < end), u, next(spread) * end) for there, u in roots])


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
