"""Quadrature over the arc at z = 0, split at the edges of contact and of slip reversal (motion in the plane)."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.bodies.rigid_shoe import RigidShoe
from drumsqueal.quadrature.levels import Level, real_roots, sine_cosine

# Gauss nodes a piece; the longest piece is the whole arc. Errors of the contact force, largest of 400 random states
# with edges, over p0 times the area: up to 130° with eight nodes 4e-13 (bonded, with two splits fewer, 3e-11), up
# to 360° with eight 2e-5, with sixteen 7e-14. Multiples of four fill the processor's lanes.
NODES, NODES_LONG_ARC = 8, 16
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
        """Nodes (pieces, nodes per piece) split at the roots of the given levels (None: no edges of that kind)."""
        del axial  # vanishes in the plane
        half_angle = shoe.half_angle
        levels = [level for level in (pressure, slip) if level is not None]
        bounds = jnp.stack([-half_angle, *_splits(levels, half_angle), half_angle])
        middle, half = (bounds[1:] + bounds[:-1]) / 2, (bounds[1:] - bounds[:-1]) / 2
        point, weight = np.polynomial.legendre.leggauss(self.nodes_per_piece)
        sine, cosine = sine_cosine(middle[:, None] + half[:, None] * point)
        return Nodes(cosine, sine, None, half[:, None] * weight * shoe.outer_radius * shoe.width)


def _splits(levels: list[Level], half_angle: Array) -> list[Array]:
    """Sorted split angles, two a level; a root that is not there splits the arc evenly instead."""
    if not levels:
        return []
    # Stacked coefficients keep the roots of all levels in one vectorised expression.
    stacked = Level(*(jnp.stack([jnp.asarray(level[k]) for level in levels]) for k in range(3)))
    there, angle = real_roots(stacked, half_angle)
    spread = spread_evenly(2 * len(levels)).reshape(len(levels), 2).T * half_angle
    angle = jnp.where(there, angle, spread)
    return sort_network([angle[j, i] for i in range(len(levels)) for j in range(2)])


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
