"""Quadratures that share nothing with the engine's: two to check it against, and the fixed grid that it replaces.

They find the boundaries another way and take many more nodes, of other rules. Nothing but studies of accuracy uses
them.
"""

from collections.abc import Callable, Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.physics.quadrature.arc import sort_by_counting
from drumsqueal.physics.quadrature.surface import Boundaries, Densities, Level, Lining, Nodes, sum_together

TANH_SINH, FEJER = "tanh-sinh", "Fejér"
TANH_SINH_STEP, TANH_SINH_REACH = 0.11, 3.2  # 59 nodes; the outermost weight is 1e-15 of the largest
FEJER_NODES = 32


class IndependentSurface(eqx.Module):
    """The lining split at its boundaries, with a rule on each piece; across it, if spatial, on fixed lines.

    The arc is split into equal `panels`, besides: many of them resolve a steep friction law that it knows nothing of.
    """

    rule: str = eqx.field(static=True)
    spatial: bool = eqx.field(static=True)
    panels: int = eqx.field(static=True, default=2)

    def integrate(self, lining: Lining, boundaries: Boundaries, densities: Callable[[Nodes], Densities]) -> Densities:
        """Sums of the densities."""
        z, across = _lines(lining.width) if self.spatial else (jnp.zeros(1), lining.width * jnp.ones(1))
        levels = [level.on_line(z) for level in (boundaries.pressure, boundaries.slip) if level is not None]
        if boundaries.slip is not None and boundaries.kinks.size:
            signed = jnp.concatenate([-boundaries.kinks, boundaries.kinks])[:, None]
            constant, cosine, sine, *_ = boundaries.slip.on_line(z)
            levels.append(Level(constant + signed, cosine, sine))
        even = lining.half_angle * np.linspace(-1, 1, self.panels + 1)[:, None] + 0 * z
        bounds = sort_by_counting(jnp.concatenate([even, *_boundaries(levels, lining.half_angle)]))
        middle, half = (bounds[1:] + bounds[:-1]) / 2, (bounds[1:] - bounds[:-1]) / 2
        point, weight = rule_of(self.rule)
        theta = middle[..., None] + half[..., None] * point
        area = half[..., None] * weight * lining.outer_radius * across[:, None]
        line = jnp.broadcast_to(z[:, None], theta.shape) if self.spatial else None
        return sum_together(densities(Nodes(jnp.cos(theta), jnp.sin(theta), line, area)))


class FixedGrid(eqx.Module):
    """Midpoints of a grid without regard to the boundaries: a kink in the forces whenever one passes a node.

    In space there are a quarter as many lines across.
    """

    along: int = eqx.field(static=True)
    spatial: bool = eqx.field(static=True)

    def integrate(self, lining: Lining, boundaries: Boundaries, densities: Callable[[Nodes], Densities]) -> Densities:
        """Sums of the densities."""
        del boundaries
        theta = lining.half_angle * _midpoints(self.along)
        lines = max(1, self.along // 4) if self.spatial else 1
        z = lining.width / 2 * _midpoints(lines)[:, None]
        cosine, sine = (jnp.broadcast_to(f(theta), (lines, self.along)) for f in (jnp.cos, jnp.sin))
        area = jnp.full((lines, self.along), 1.0) * lining.area / (lines * self.along)
        line = jnp.broadcast_to(z, (lines, self.along)) if self.spatial else None
        return sum_together(densities(Nodes(cosine, sine, line, area)))


def rule_of(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Points and weights of a rule on [−1, 1]."""
    if name == FEJER:
        return fejer(FEJER_NODES)
    t = np.arange(-TANH_SINH_REACH, TANH_SINH_REACH + TANH_SINH_STEP / 2, TANH_SINH_STEP)
    inner = np.pi / 2 * np.sinh(t)
    return np.tanh(inner), TANH_SINH_STEP * np.pi / 2 * np.cosh(t) / np.cosh(inner) ** 2


def fejer(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points cos((k + ½)π/n) and weights of Fejér's first rule (Trefethen, SIAM Review 50 (2008) 67).

    No point is an end of the interval: there slip has no direction, and round-off would give it one.
    """
    angle = np.pi * (np.arange(count) + 0.5) / count
    orders = np.arange(1, count // 2 + 1)
    terms = np.cos(2 * orders * angle[:, None]) / (4 * orders**2 - 1)
    return np.cos(angle), 2 / count * (1 - 2 * terms.sum(axis=1))


def _lines(width: Array) -> tuple[Array, Array]:
    point, weight = fejer(FEJER_NODES // 2)
    panels = 6  # across the lining, each with half as many of Fejér's nodes
    half = width / 2 / panels
    return (half * (2 * panels * _midpoints(panels)[:, None] / 2 + point)).ravel(), (half * np.tile(weight, panels))


def _midpoints(count: int) -> np.ndarray:
    """Midpoints of `count` equal parts of [−1, 1]."""
    return (2 * np.arange(count) + 1) / count - 1


def _boundaries(levels: Sequence[Level], half_angle: Array) -> list[Array]:
    """Boundaries (k, lines) of each level: a + r cos(θ − φ) vanishes at φ ± arccos(−a/r); 0 where there is none."""
    boundaries = []
    for a, b, c, _, _ in levels:
        amplitude, phase = jnp.hypot(b, c), jnp.arctan2(c, b)
        fraction = -a / jnp.where(amplitude > 0, amplitude, 1.0)
        there = (amplitude > 0) & (jnp.abs(fraction) < 1)
        reach = jnp.arccos(jnp.where(there, fraction, 0.0))
        turned = (jnp.stack([phase - reach, phase + reach]) + jnp.pi) % (2 * jnp.pi) - jnp.pi
        turned = jnp.where(there & (jnp.abs(turned) < half_angle), turned, 0.0)
        boundaries.append(turned.reshape(-1, turned.shape[-1]))
    return boundaries
