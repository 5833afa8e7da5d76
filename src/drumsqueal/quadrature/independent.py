"""Quadratures that share nothing with the engine's: two to check it against, and the fixed grid that it replaces.

They find the edges another way and take many more nodes, of other rules. Nothing but studies of accuracy uses them.
"""

from collections.abc import Callable, Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.bodies.rigid_shoe import RigidShoe
from drumsqueal.quadrature.arc import sort_network
from drumsqueal.quadrature.levels import Level
from drumsqueal.quadrature.sums import Densities, sum_together
from drumsqueal.quadrature.surface import Edges, Nodes

TANH_SINH, CLENSHAW_CURTIS = "tanh-sinh", "Clenshaw-Curtis"
TANH_SINH_STEP, TANH_SINH_REACH = 0.11, 3.2  # 59 nodes; the outermost weight is 1e-15 of the largest
CLENSHAW_CURTIS_ORDER = 32
PANELS = 6  # across the lining, each with the nodes of Clenshaw and Curtis' rule of half the order


class IndependentSurface(eqx.Module):
    """The lining split at its edges, with the nodes of a rule on each piece; across it, if spatial, on fixed lines."""

    rule: str = eqx.field(static=True)
    spatial: bool = eqx.field(static=True)

    def integrate(
        self, shoe: RigidShoe, edges: Edges, densities: Callable[[Nodes], Densities], *, smooth: bool
    ) -> Densities:
        """Sums of the densities."""
        del smooth
        z, across = _lines(shoe.width) if self.spatial else (jnp.zeros(1), shoe.width * jnp.ones(1))
        levels = [level.on_line(z) for level in (edges.pressure, edges.slip) if level is not None]
        bounds = jnp.stack(sort_network(_bounds(levels, shoe.half_angle, z)))
        middle, half = (bounds[1:] + bounds[:-1]) / 2, (bounds[1:] - bounds[:-1]) / 2
        point, weight = rule_of(self.rule)
        theta = middle[..., None] + half[..., None] * point
        area = half[..., None] * weight * shoe.outer_radius * across[:, None]
        line = jnp.broadcast_to(z[:, None], theta.shape) if self.spatial else None
        return sum_together([densities(Nodes(jnp.cos(theta), jnp.sin(theta), line, area))])


class FixedGrid(eqx.Module):
    """Midpoints of a grid that does not know the edges: what one writes first, and a kink whenever one passes a node.

    In space there are a quarter as many lines across.
    """

    along: int = eqx.field(static=True)
    spatial: bool = eqx.field(static=True)

    def integrate(
        self, shoe: RigidShoe, edges: Edges, densities: Callable[[Nodes], Densities], *, smooth: bool
    ) -> Densities:
        """Sums of the densities."""
        del edges, smooth
        theta = shoe.half_angle * _midpoints(self.along)
        lines = max(1, self.along // 4) if self.spatial else 1
        z = shoe.width / 2 * _midpoints(lines)[:, None]
        cosine, sine = (jnp.broadcast_to(f(theta), (lines, self.along)) for f in (jnp.cos, jnp.sin))
        area = jnp.full((lines, self.along), 1.0) * shoe.area / (lines * self.along)
        line = jnp.broadcast_to(z, (lines, self.along)) if self.spatial else None
        return sum_together([densities(Nodes(cosine, sine, line, area))])


def rule_of(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Points and weights of a rule on [−1, 1]."""
    if name == CLENSHAW_CURTIS:
        return clenshaw_curtis(CLENSHAW_CURTIS_ORDER)
    t = np.arange(-TANH_SINH_REACH, TANH_SINH_REACH + TANH_SINH_STEP / 2, TANH_SINH_STEP)
    inner = np.pi / 2 * np.sinh(t)
    return np.tanh(inner), TANH_SINH_STEP * np.pi / 2 * np.cosh(t) / np.cosh(inner) ** 2


def clenshaw_curtis(order: int) -> tuple[np.ndarray, np.ndarray]:
    """Points cos(kπ/n) and weights of the rule of even order n on [−1, 1] (Trefethen, SIAM Review 50 (2008) 67)."""
    angle = np.pi * np.arange(order + 1) / order
    weight = np.ones(order + 1)
    for k in range(1, order // 2 + 1):
        share = 1.0 if 2 * k == order else 2.0
        weight -= share * np.cos(2 * k * angle) / (4 * k * k - 1)
    weight *= 2.0 / order
    weight[[0, -1]] /= 2
    return np.cos(angle), weight


def _lines(width: Array) -> tuple[Array, Array]:
    point, weight = clenshaw_curtis(CLENSHAW_CURTIS_ORDER // 2)
    half = width / 2 / PANELS
    return (half * (2 * PANELS * _midpoints(PANELS)[:, None] / 2 + point)).ravel(), (half * np.tile(weight, PANELS))


def _midpoints(count: int) -> np.ndarray:
    """Midpoints of `count` equal parts of [−1, 1]."""
    return (2 * np.arange(count) + 1) / count - 1


def _bounds(levels: Sequence[Level], half_angle: Array, z: Array) -> list[Array]:
    """Ends, middle and edges of each line: a + r cos(θ − φ) vanishes at φ ± arccos(−a/r)."""
    bounds = [jnp.full_like(z, 1.0) * half_angle * end for end in (-1.0, 0.0, 1.0)]
    for a, b, c, _, _ in levels:
        amplitude, phase = jnp.hypot(b, c), jnp.arctan2(c, b)
        share = -a / jnp.where(amplitude > 0, amplitude, 1.0)
        there = (amplitude > 0) & (jnp.abs(share) < 1)
        reach = jnp.arccos(jnp.where(there, share, 0.0))
        for root in (phase - reach, phase + reach):
            turned = (root + jnp.pi) % (2 * jnp.pi) - jnp.pi
            bounds.append(jnp.where(there & (jnp.abs(turned) < half_angle), turned, 0.0))
    return bounds
