"""Quadrature over the whole lining, split along and across at the edges of contact and of slip reversal.

Where V_z is small the direction V/|V| turns within a narrow angle about a reversal of V_θ. The branch points of
|V| = √((V_θ + iV_z)(V_θ − iV_z)) are known in closed form, so the nodes are graded towards them (sinh transformation;
Johnston & Elliott, Int. J. Numer. Meth. Engng 62 (2005) 564) and their number stays fixed.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.bodies.rigid_shoe import RigidShoe
from drumsqueal.quadrature.arc import sort_network, spread_evenly
from drumsqueal.quadrature.levels import Level, complex_roots, line_crossings, real_roots, sine_cosine
from drumsqueal.quadrature.smooth import is_smooth, smooth_nodes
from drumsqueal.quadrature.sums import Densities, sum_together
from drumsqueal.quadrature.surface import Edges, Nodes

# Nodes across the lining a piece, after the map z = (3ξ − ξ³)/2 which takes the square roots out of both ends (an
# edge pair is born like √(z − z0)) and keeps polynomials exact.
LINES = 6
# Nodes along each half piece of the arc. Over 9 ms of the hard spatial start of the tests, in which V_z passes through
# zero across slip reversals, 8 nodes lose 1e-3 of the trajectory, 12 lose 3e-6, 16 and 20 less than 3e-8.
NODES = 16
# Bounds of the grading, in lengths of the half piece. A narrower turn is as good as a jump, at the end of a piece.
NARROWEST, WIDEST = 1.0 / np.sinh(12.0), 10.0
SMOOTH = 1e3  # rad; a split without a narrow turn (finite, so that gradients stay so)
SMALLEST = 1e-30  # rad; keeps the length of an empty piece off zero


class AreaSurface(eqx.Module):
    """The lining as an area: what spatial motion needs."""

    lines_per_piece: int = eqx.field(static=True, default=LINES)
    nodes_per_piece: int = eqx.field(static=True, default=NODES)

    @property
    def spatial(self) -> bool:
        """Whether the nodes differ across the lining."""
        return True

    def integrate(
        self, shoe: RigidShoe, edges: Edges, densities: Callable[[Nodes], Densities], *, smooth: bool
    ) -> Densities:
        """Sums over nodes that are split at the edges; where what is `smooth` has none, over a seventieth of them."""

        def split() -> Densities:
            return sum_together([densities(self._nodes(shoe, edges))])

        if not smooth:
            return split()
        return jax.lax.cond(is_smooth(shoe, *edges), lambda: sum_together([densities(smooth_nodes(shoe))]), split)

    def _nodes(self, shoe: RigidShoe, edges: Edges) -> Nodes:
        """Nodes (lines, pieces, 2, nodes per piece) split at the edges; the tangential direction does not know V_z."""
        half_angle, half_width = shoe.half_angle, shoe.width / 2
        pressure = edges.pressure
        turn = None if edges.slip is None else _turn(edges.slip, edges.axial)
        z, z_weight = self._lines(half_angle, half_width, pressure, turn)
        angle, distance = _line_splits(half_angle, z, pressure, turn)
        theta, theta_weight = self._graded(half_angle, angle, distance)
        sine, cosine = sine_cosine(theta)
        weight = shoe.outer_radius * theta_weight * z_weight[:, None, None, None]
        return Nodes(cosine, sine, z[:, None, None, None], weight)

    def _lines(
        self, half_angle: Array, half_width: Array, pressure: Level | None, turn: Level | None
    ) -> tuple[Array, Array]:
        """Lines z (lines,) and their weights (m)."""
        candidates = []
        if pressure is not None:
            there, z = line_crossings(pressure, half_angle)
            candidates.append((there & (z.imag == 0), z.real))
        if turn is not None:
            there, z = line_crossings(turn, half_angle)
            candidates.append((there, z.real))
        bounds = jnp.stack([-half_width, half_width])
        if candidates:
            there, z = (jnp.concatenate(parts) for parts in zip(*candidates, strict=True))
            inside = there & (jnp.abs(z) < half_width)
            z = jnp.where(inside, z, spread_evenly(z.size) * half_width)
            bounds = jnp.stack([-half_width, *sort_network(list(z)), half_width])
        middle, half = (bounds[1:] + bounds[:-1]) / 2, (bounds[1:] - bounds[:-1]) / 2
        point, weight = np.polynomial.legendre.leggauss(self.lines_per_piece)
        mapped, mapped_weight = (3 * point - point**3) / 2, weight * 1.5 * (1 - point**2)
        return (middle[:, None] + half[:, None] * mapped).ravel(), (half[:, None] * mapped_weight).ravel()

    def _graded(self, half_angle: Array, angle: list[Array], distance: list[Array]) -> tuple[Array, Array]:
        """Angles and weights (lines, pieces, 2, nodes): half pieces, each graded towards the split at its outer end."""
        smooth = jnp.full_like(distance[0], SMOOTH) if distance else jnp.full_like(half_angle, SMOOTH)[None]
        ends = jnp.broadcast_to(half_angle, smooth.shape)
        bounds = jnp.stack([-ends, *angle, ends], axis=-1)
        gaps = jnp.stack([smooth, *distance, smooth], axis=-1)
        start = jnp.stack([bounds[:, :-1], bounds[:, 1:]], axis=-1)
        gap = jnp.stack([gaps[:, :-1], gaps[:, 1:]], axis=-1)
        length = (bounds[:, 1:] - bounds[:, :-1])[..., None] / 2 * np.array([1.0, -1.0])
        size = jnp.maximum(jnp.abs(length), SMALLEST)
        scale = jnp.clip(gap / size, NARROWEST, WIDEST)[..., None]
        stretch = jnp.arcsinh(1 / scale)
        point, weight = np.polynomial.legendre.leggauss(self.nodes_per_piece)
        growth = jnp.exp(stretch * (point + 1) / 2)
        shape = scale * (growth - 1 / growth) / 2
        slope = scale * stretch * (growth + 1 / growth) / 4
        return start[..., None] + length[..., None] * shape, jnp.abs(length)[..., None] * slope * weight


def _turn(slip: Level, axial: Level | None) -> Level:
    """V_θ + i V_z as one complex level, whose roots are the branch points of |V|."""
    if axial is None:
        return slip
    return Level(*(along + 1j * across for along, across in zip(slip, axial, strict=True)))


def _line_splits(
    half_angle: Array, z: Array, pressure: Level | None, turn: Level | None
) -> tuple[list[Array], list[Array]]:
    """Sorted split angles on each line, and the angle within which the integrand turns there (SMOOTH: it does not)."""
    angle, distance = [], []
    count = 2 * sum(level is not None for level in (pressure, turn))
    spread = spread_evenly(count)
    if pressure is not None:
        there, root = real_roots(pressure.on_line(z), half_angle)
        for j in range(2):
            angle.append(jnp.where(there[j], root[j], spread[j] * half_angle))
            distance.append(jnp.full_like(z, SMOOTH))
    if turn is not None:
        there, root, imaginary = complex_roots(turn.on_line(z))
        for j in range(2):
            inside = jnp.clip(root[j], -half_angle, half_angle)
            near = jnp.abs(root[j] - inside) + imaginary[j]
            close = there[j] & (near < half_angle / 2)
            angle.append(jnp.where(close, inside, spread[count - 2 + j] * half_angle))
            distance.append(jnp.where(close, near, SMOOTH))
    return _sort_with(angle, distance)


def _sort_with(keys: list[Array], values: list[Array]) -> tuple[list[Array], list[Array]]:
    """Sort the keys elementwise with exchanges and carry the values along."""
    keys, values = list(keys), list(values)
    for last in range(len(keys) - 1, 0, -1):
        for i in range(last):
            swap = keys[i] > keys[i + 1]
            keys[i], keys[i + 1] = jnp.where(swap, keys[i + 1], keys[i]), jnp.where(swap, keys[i], keys[i + 1])
            values[i], values[i + 1] = (
                jnp.where(swap, values[i + 1], values[i]),
                jnp.where(swap, values[i], values[i + 1]),
            )
    return keys, values
