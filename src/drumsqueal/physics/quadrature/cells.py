"""Quadrature over a lining whose levels are known by their values at nodes: no closed forms, as of a body that bends.

The lining is cut into cells, with a product of Gauss rules in each. Within a cell a level is the polynomial through its
nodes; forces are spread onto the nodes by the same polynomials, so that the generalised force is the transpose of the
shape functions at the nodes times the nodal forces, however many coordinates there are. Cells that no boundary comes
near are summed as they are; the others are cut where it runs (`cut_cells.py`).
"""

import dataclasses
import itertools
import operator
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.physics.quadrature.arc import sort_by_counting
from drumsqueal.physics.quadrature.cut_cells import (
    Piece,
    Powers,
    find_cuts,
    piece_nodes,
    powers_of,
    repeated,
    turn_lines,
)
from drumsqueal.physics.quadrature.polynomials import (
    applied,
    compute_once,
    evaluate,
    gauss_nodes,
    to_legendre,
    to_powers,
    to_sides,
)
from drumsqueal.physics.quadrature.surface import (
    Boundaries,
    Lining,
    resolved,
    sine_cosine,
    sum_over_points,
    sum_together,
)

if TYPE_CHECKING:
    from drumsqueal.physics.quadrature.lines import LineNodes

# Where the mean slip velocity of a cell exceeds so many times what it differs from it at most, the direction of
# friction is smooth: its branch points are so many half cells away.
CLEAR_CELL = 2.5


class PlaceInCells(NamedTuple):
    """Where nodes lie within cells: lines of `turned` cells run along θ, of others across.

    Cells (n,), where in [−1, 1] each line is (n, lines), points (points, stretches × n × lines), and if there are any
    (what branches on that is not computed anew wherever it is used). `known` are values of levels whose powers are.
    """

    cell: Array
    turned: Array
    line: Array
    point: Array
    some: Array
    order: int
    known: tuple[tuple[Array, Array], ...]

    def value(self, level: "Sampled") -> Array:
        """Of a level at the nodes."""
        powers = next((powers for values, powers in self.known if values is level.values), None)
        if powers is None:
            powers = powers_of(level.values.reshape(-1, self.order, self.order))
        found = Powers(powers, None, None).of(self.cell, self.turned).pressure
        assert found is not None
        own = compute_once(self.some, lambda: evaluate(found[..., None], self.line)).reshape(self.order, -1)
        lines = compute_once(self.some, lambda: repeated(own, self.point))
        return compute_once(self.some, lambda: evaluate(lines, self.point)).ravel()


class CellNodes(NamedTuple):
    """Quadrature nodes: θ (rad), z (m), weight (m²), and where they lie within the cells (None: at all Gauss nodes).

    All along one axis: exponentials then fill the lanes of a processor.
    """

    theta: Array
    z: Array
    weight: Array
    place: "PlaceInCells | LineNodes | None"

    @property
    def cosine(self) -> Array:
        """Of θ."""
        return sine_cosine(self.theta)[1]

    @property
    def sine(self) -> Array:
        """Of θ."""
        return sine_cosine(self.theta)[0]


class Sampled(eqx.Module):
    """A level by its values (N,) at the Gauss nodes of all cells; `odd` or even in z where half the width serves."""

    values: Array
    odd: bool = eqx.field(static=True, default=False)

    def at(self, nodes: CellNodes) -> Array:
        """The values, or those of the polynomials through them at nodes within cells."""
        return self.values if nodes.place is None else nodes.place.value(self)

    def scaled(self, factor: Array, offset: Array) -> "Sampled":
        """Offset + factor · level."""
        return Sampled(offset + factor * self.values)


class Known(NamedTuple):
    """A level by its values at the nodes at hand."""

    values: Array

    def at(self, nodes: CellNodes) -> Array:
        """The values."""
        del nodes
        return self.values


class Near(NamedTuple):
    """Which cells (n,) a reversal of slip comes near, which the boundary of contact, and in which such a line ends.

    The last tells lines which cells to cut on more of them; cells that are cut both ways do not ask.
    """

    slipping: Array
    pressing: Array
    ends: Array


class Spread(eqx.Module):
    """What is not summed but spread onto the Gauss nodes of all cells, by the polynomials of which levels are made.

    Its total (N,) does the same work as it at whatever has a value at each node. It may be `odd` in z, as levels are.
    """

    density: Array
    odd: bool = eqx.field(static=True, default=False)


CellDensities = dict[str, Array | Spread]


def _totals_of(found: CellDensities, without: Array | None) -> dict[str, Array]:
    """Totals over the Gauss nodes of all cells but some."""
    kept = found if without is None else jax.tree.map(lambda each: jnp.where(without, 0.0, each), found)
    summed = {name: each for name, each in kept.items() if not isinstance(each, Spread)}
    totals = sum_together(summed) if summed else {}
    return {name: each.density if isinstance(each, Spread) else totals[name] for name, each in kept.items()}


def at_nodes(found: CellDensities) -> dict[str, Array]:
    """Densities at the nodes, those that are to be spread among them."""
    return {name: each.density if isinstance(each, Spread) else each for name, each in found.items()}


class Cells(eqx.Module):
    """The lining in cells, `order` Gauss nodes along and across each.

    Cells are cut where slip reverses if it may (`slips`), and where the lining `lifts`: near steady sliding neither is
    asked for. There are totals with `slopes` by levels of these names alone, while boundaries stay where they are:
    where the pressure vanishes at one that moves, forces do not change by that to first order. Those of their slopes
    cannot be had in this way. `block` pieces of cut cells are summed at once.
    """

    along: int = eqx.field(static=True, default=8)
    across: int = eqx.field(static=True, default=2)
    order: int = eqx.field(static=True, default=7)
    slips: bool = eqx.field(static=True, default=True)
    lifts: bool = eqx.field(static=True, default=True)
    slopes: tuple[str, ...] = eqx.field(static=True, default=())
    block: int = eqx.field(static=True, default=1)

    spatial: bool = eqx.field(static=True, default=True, init=False)
    axes = 2  # along which cells are cut

    @property
    def count(self) -> int:
        """Number N of nodes."""
        return self.along * self.across * self.order**2

    def nodes(self, lining: Lining) -> CellNodes:
        """All Gauss nodes, (N,) in the order of cells across, cells along, nodes across, nodes along."""
        point, weight = gauss_nodes(self.order)
        shape = (self.across, self.along, self.order, self.order)
        cell = np.arange(self.across * self.along)
        theta, z, area = self._locate(lining, cell[:, None, None], point[:, None], point[None, :])
        weight = area * (weight[:, None] * weight)
        theta, z, weight = (
            jnp.broadcast_to(each.reshape(*shape), shape).ravel()
            for each in (jnp.broadcast_to(each, (cell.size, self.order, self.order)) for each in (theta, z, weight))
        )
        return CellNodes(theta, z, weight, None)

    def _locate(self, lining: Lining, cell: Any, across: Any, along: Any) -> tuple[Array, Array, Array]:
        """θ (rad) and z (m) of a point of [−1, 1]² of a cell, and area (m²) per unit of it."""
        half_arc = lining.half_angle / self.along
        theta = -lining.half_angle + half_arc * (2 * (cell % self.along) + 1 + along)
        half_width = lining.width / 2 / self.across
        z = -lining.width / 2 + half_width * (2 * (cell // self.along) + 1 + across)
        return theta, z, lining.outer_radius * half_arc * half_width

    def integrate(
        self, lining: Lining, boundaries: Boundaries, densities: Callable[[CellNodes], CellDensities]
    ) -> dict[str, Array]:
        """Totals over the lining of densities times weights; of those that are spread, onto all nodes (N,)."""
        found = densities(self.nodes(lining))
        boundaries = boundaries._replace(
            pressure=boundaries.pressure if self.lifts else None, slip=boundaries.slip if self.slips else None
        )
        if boundaries.pressure is None and boundaries.slip is None:
            return _totals_of(found, None)
        if self.slopes:
            boundaries = boundaries._replace(pressure=jax.lax.stop_gradient(boundaries.pressure))
        near = jax.lax.stop_gradient(self._near(boundaries))
        cut = near.slipping | near.pressing
        some = jnp.any(cut)
        totals = _totals_of(found, compute_once(some, lambda: self._at_nodes(cut)))
        return jax.lax.cond(some, lambda: self._add_cut(lining, boundaries, densities, near, totals), lambda: totals)

    def forces(
        self,
        lining: Lining,
        boundaries: Boundaries,
        levels: Any,
        densities: Callable[[Any, CellNodes], CellDensities],
    ) -> dict[str, Array]:
        """Totals T of what is spread onto all nodes (N,), with their `slopes` by levels; those of sums are not found.

        In each cell T changes by W (order², order²) times what a level changes there, W = Kᵀ H K: K takes values at
        nodes to coefficients of powers, and H has the moments of the slope of the density up to twice the order. So
        that these are found once, and not for each coordinate that a level depends on.
        """
        still = jax.lax.stop_gradient(levels)
        moving = [name for name in self.slopes if getattr(still, name) is not None]
        spread = self._spread(still, moving, densities)
        totals, slopes = spread(self.nodes(lining))
        weights = slopes.reshape(*slopes.shape[:2], -1, self.order**2)[..., None] * np.eye(self.order**2)
        if boundaries.pressure is not None and self.lifts:
            cut = boundaries._replace(pressure=jax.lax.stop_gradient(boundaries.pressure), slip=None, axial=None)
            totals, weights = self._with_cut_forces(lining, cut, spread, totals, weights)
        for k, name in enumerate(moving):
            changed = getattr(levels, name).values - getattr(still, name).values  # 0, with a slope
            each = jnp.einsum("icmn,cn->icm", weights[k], changed.reshape(-1, self.order**2))
            totals = totals + each.reshape(totals.shape)
        found = densities(still, self.nodes(lining))
        spreads = [name for name, each in found.items() if isinstance(each, Spread)]
        return dict.fromkeys(found, jnp.full((), jnp.nan)) | dict(zip(spreads, totals, strict=True))

    def _spread(
        self, still: Any, moving: list[str], densities: Callable[[Any, CellNodes], CellDensities]
    ) -> Callable[[CellNodes], tuple[Array, Array]]:
        """What is spread at nodes (k, ...), and its slopes (levels, k, ...) by the levels that move."""

        def at(nodes: CellNodes) -> tuple[Array, Array]:
            values = [getattr(still, name).at(nodes) for name in moving]

            def forces(*values: Array) -> Array:
                known = still._replace(**{name: Known(each) for name, each in zip(moving, values, strict=True)})
                found = densities(known, nodes).values()
                return jnp.stack([each.density for each in found if isinstance(each, Spread)])

            def slope(k: int) -> tuple[Array, Array]:
                by = lambda value: forces(*values[:k], value, *values[k + 1 :])  # noqa: E731
                return jax.jvp(by, (values[k],), (jnp.ones_like(values[k]),))

            (found, *_), slopes = zip(*map(slope, range(len(moving))), strict=True)
            return found, jnp.stack(slopes)

        return at

    def _with_cut_forces(
        self,
        lining: Lining,
        boundaries: Boundaries,
        spread: Callable[[CellNodes], tuple[Array, Array]],
        totals: Array,
        weights: Array,
    ) -> tuple[Array, Array]:
        """Totals (k, N) and what levels change in each cell (levels, k, cells, order², order²), cut at boundaries."""
        pressing = self._near(boundaries).pressing
        (levels, kinds, cells), order = weights.shape[:3], self.order

        def summed() -> tuple[Array, Array]:
            level = self._by_cell(boundaries.pressure)
            assert level is not None
            powers, turned = Powers(powers_of(level), None, None), pressing & turn_lines(level)
            no_slip = jnp.zeros_like(pressing)
            pieces, count = _find_pieces(powers, no_slip, pressing, turned, boundaries.kinks, self.block)

            def add_block(block: Array, state: tuple[Array, Array]) -> tuple[Array, Array]:
                some = jax.lax.dynamic_slice_in_dim(pieces, self.block * block, self.block)
                there = self.block * block + np.arange(self.block) < count
                nodes = self._piece_nodes(lining, boundaries, powers, Piece(*some.T), there, ())
                assert isinstance(nodes.place, PlaceInCells)
                force, slope = spread(nodes)
                own = _moments(force, nodes.place, order), _moments(slope, nodes.place, 2 * order - 1)
                one, other = (moments.at[nodes.place.cell].add(each) for moments, each in zip(state, own, strict=True))
                return one, other

            start = jnp.zeros((cells, kinds, order, order)), jnp.zeros((cells, levels, kinds, *[2 * order - 1] * 2))
            blocks = (count + self.block - 1) // self.block
            moments, twice = jax.lax.fori_loop(0, blocks, add_block, start)
            onto = np.kron(to_powers(order), to_powers(order)).T
            add = jnp.moveaxis(moments.reshape(cells, kinds, -1) @ onto.T, 0, 1).reshape(totals.shape)
            both = np.add.outer(np.arange(order), np.arange(order))
            hankel = twice[..., both[:, None, :, None], both[None, :, None, :]].reshape(*twice.shape[:3], *onto.shape)
            more = jnp.moveaxis(onto @ hankel @ onto.T, 0, 2)
            kept = jnp.where(self._at_nodes(pressing), 0.0, totals)
            return kept + add, jnp.where(pressing[:, None, None], 0.0, weights) + more

        return jax.lax.cond(jnp.any(pressing), summed, lambda: (totals, weights))

    def finer(self, along: float, across: float, more: int) -> Self:
        """With so many times the cells, and `more` nodes along each side of one."""
        counts = {"along": round(along * self.along), "across": max(1, round(across * self.across))}
        return dataclasses.replace(self, **counts, order=self.order + more)

    def with_sides(self, level: Sampled) -> Array:
        """Values of the cells' polynomials at their nodes and on their sides."""
        matrix = to_sides(self.order)
        return applied(matrix, applied(matrix, level.values.reshape(-1, self.order, self.order), 1), 2)

    def bound(self, level: Sampled) -> Array:
        """A bound of the size of a level, by the sums of its Legendre coefficients in each cell."""
        transform = to_legendre(self.order)
        parts = applied(transform, applied(transform, level.values.reshape(-1, self.order, self.order), 1), 2)
        return jnp.max(jnp.sum(jnp.abs(parts), axis=(1, 2)))

    def _by_cell(self, level: Any) -> Array | None:
        return None if level is None else level.values.reshape(-1, self.order, self.order)

    def _at_nodes(self, cells: Array) -> Array:
        """Which nodes (N,) lie in some cells (n,)."""
        return jnp.repeat(cells, self.order**2)

    def _near(self, boundaries: Boundaries) -> Near:
        """What comes near which cells, by bounds of the levels in each."""
        transform = to_legendre(self.order)

        def bounds(values: Array) -> tuple[Array, Array]:
            """Mean of a polynomial and a bound of what it differs from it."""
            parts = applied(transform, applied(transform, values, 1), 2)
            mean = parts[:, 0, 0]
            return mean, jnp.sum(jnp.abs(parts), axis=(1, 2)) - jnp.abs(mean)

        pressure, slip, axial = (self._by_cell(each) for each in boundaries[:3])
        slipping = pressing = lifted = jnp.zeros(self.along * self.across, bool)
        if pressure is not None:
            mean, swing = bounds(pressure)
            # A level that vanishes all over is pressed: there the slope of the pressure is that of contact.
            pressing, lifted = jnp.abs(mean) < swing, mean < -swing
        if slip is not None:
            mean, swing = bounds(slip)
            if axial is None:
                near = jnp.abs(mean) <= swing
            else:
                lateral, more = bounds(axial)
                mean, swing = jnp.hypot(mean, lateral), jnp.hypot(swing, more)
                near = mean <= CLEAR_CELL * swing
            size = jnp.abs(mean)
            steep = jax.vmap(lambda low, high: ~resolved(boundaries.breakpoints, low, high))
            slipping = (near | steep(jnp.maximum(size - swing, 0.0), size + swing)) & ~lifted
        return Near(slipping, pressing, jnp.zeros_like(pressing))

    def _add_cut(
        self,
        lining: Lining,
        boundaries: Boundaries,
        densities: Callable[[CellNodes], CellDensities],
        near: Near,
        totals: dict[str, Array],
    ) -> dict[str, Array]:
        """Add the totals of cells near to boundaries, in blocks of their pieces."""
        slipping, pressing, _ = near
        pressure, slip, axial = (self._by_cell(each) for each in boundaries[:3])
        turned = jnp.zeros_like(slipping)
        for level, chosen in ((pressure, pressing), (slip, slipping)):
            if level is not None:
                turned = jnp.where(chosen, turn_lines(jax.lax.stop_gradient(level)), turned)
        powers = Powers(*(None if each is None else powers_of(each) for each in (pressure, slip, axial)))
        levels: Any = boundaries[:3]
        known = tuple((level.values, found) for level, found in zip(levels, powers, strict=True) if level)
        parts = [(powers, slipping, pressing)]
        if slip is not None and pressure is not None and not boundaries.rarely:
            # Most cells in which contact ends are far from a reversal of slip: without that they are cut in a third of
            # the time.
            alone = Powers(powers.pressure, None, None), jnp.zeros_like(slipping), pressing & ~slipping
            parts = [(powers, slipping, slipping & pressing), alone]
        spread = [name for name, each in totals.items() if each.ndim]
        sums = {name: each for name, each in totals.items() if name not in spread}
        moments = jnp.zeros((slipping.size, len(spread), self.order, self.order))
        for each, near_slip, near_end in parts:
            pieces, count = _find_pieces(
                jax.lax.stop_gradient(each), near_slip, near_end, turned, boundaries.kinks, self.block
            )

            def add_block(
                block: Array,
                state: tuple[dict[str, Array], Array],
                powers: Powers = each,
                pieces: Array = pieces,
                count: Array = count,
            ) -> tuple[dict[str, Array], Array]:
                some = jax.lax.dynamic_slice_in_dim(pieces, self.block * block, self.block)
                there = self.block * block + np.arange(self.block) < count
                nodes = self._piece_nodes(lining, boundaries, powers, Piece(*some.T), there, known)
                assert isinstance(nodes.place, PlaceInCells)
                return self._with_cut(*state, spread, densities(nodes), nodes.place)

            sums, moments = jax.lax.fori_loop(0, (count + self.block - 1) // self.block, add_block, (sums, moments))
        matrix = to_powers(self.order).T
        onto = jnp.swapaxes(applied(matrix, applied(matrix, moments, 2), 3), 0, 1).reshape(len(spread), self.count)
        return sums | {name: totals[name] + onto[k] for k, name in enumerate(spread)}

    def _piece_nodes(
        self, lining: Lining, boundaries: Boundaries, powers: Powers, piece: Piece, there: Array, known: Any
    ) -> CellNodes:
        """Nodes on the pieces that are there."""
        cell, turned = piece.cell.astype(int), piece.turned > 0
        x, inner, weight = piece_nodes(
            powers.of(cell, turned), piece, boundaries.kinks, there[0], lifted=boundaries.lifted
        )
        cell_of, turned_of, there_of = (repeated(jnp.repeat(each, x.shape[1]), inner) for each in (cell, turned, there))
        line = repeated(x.ravel(), inner)
        along, across = jnp.where(turned_of, inner, line), jnp.where(turned_of, line, inner)
        theta, z, area = self._locate(lining, cell_of, across, along)
        weight = jnp.where(there_of, area * weight, 0.0)
        place = PlaceInCells(cell, turned, x, inner, there[0], self.order, known)
        return CellNodes(theta.ravel(), z.ravel(), weight.ravel(), place)

    def _with_cut(
        self, sums: dict[str, Array], moments: Array, spread: list[str], found: CellDensities, place: PlaceInCells
    ) -> tuple[dict[str, Array], Array]:
        """Sums, and moments (cells, k, order, order) of what is spread, with those at nodes within cells added."""
        powers = [jnp.ones_like(place.point)]
        outer = [jnp.ones_like(place.line)]
        for _ in range(self.order - 1):
            powers.append(powers[-1] * place.point)
            outer.append(outer[-1] * place.line)
        densities = compute_once(place.some, lambda: at_nodes(found))
        densities = {name: each.reshape(place.point.shape) for name, each in densities.items()}
        parts = {(name, 0): each for name, each in densities.items()}
        parts |= {(name, p): densities[name] * power for name in spread for p, power in enumerate(powers) if p}
        inner = sum_over_points(parts)
        sums = {name: each + jnp.sum(inner[name, 0]) for name, each in sums.items()}
        if not spread:
            return sums, moments
        stacked = jnp.stack([inner[name, p] for name in spread for p in range(self.order)])
        count, lines = place.line.shape
        stacked = jnp.sum(stacked.reshape(len(stacked), -1, count, lines), axis=1)  # over stretches
        stacked = stacked.reshape(len(spread), self.order, 1, count, lines)
        more = jnp.moveaxis(jnp.sum(stacked * jnp.stack(outer), axis=-1), -1, 0)  # (n, k, p, q)
        more = jnp.where(place.turned[:, None, None, None], jnp.swapaxes(more, 2, 3), more)
        for k in range(len(more)):  # no scatter, as no products of matrices
            own = jax.lax.dynamic_index_in_dim(moments, place.cell[k], keepdims=False)
            moments = jax.lax.dynamic_update_index_in_dim(moments, own + more[k], place.cell[k], 0)
        return sums, moments


def cells_for(degrees: int) -> Cells:
    """Cells for shapes of so many degrees in z, the constant with them: as few as follow them."""
    # With 16, of the shipped bending drum, one cell across changes growth rates by 4e-7 1/s. With 18, of two bending
    # shoes, by 0.006 1/s, but forces jump where a boundary enters a cell, so that transients take twice the steps; with
    # 29, of a truck's, by 0.7 1/s, and two cells by 0.004 1/s (against eleven by three cells of more nodes).
    followed_by_one = 16
    return Cells(along=6, across=1, order=9) if degrees <= followed_by_one else Cells()


def _moments(density: Array, place: PlaceInCells, order: int) -> Array:
    """Moments (n, ..., order, order) of densities (..., nodes) along θ and z of the pieces' cells."""
    along, across = (
        jnp.stack([*itertools.accumulate([each] * (order - 1), operator.mul, initial=jnp.ones_like(each))])
        for each in (place.point, place.line)
    )
    kinds = density.shape[:-1]
    lines = jnp.sum(density.reshape(*kinds, 1, *place.point.shape) * along, axis=-2)
    lines = jnp.sum(lines.reshape(*kinds, order, -1, *place.line.shape), axis=-3)  # over stretches: (..., p, n, lines)
    found = jnp.moveaxis(jnp.sum(lines[..., None, :, :] * across, axis=-1), -1, 0)  # (n, ..., p, q)
    turned = place.turned.reshape(-1, *[1] * (found.ndim - 1))
    return jnp.where(turned, jnp.swapaxes(found, -1, -2), found)


@partial(jax.jit, static_argnames="at_once")  # traced once for brakes of any number of coordinates
def _find_pieces(
    powers: Powers, slipping: Array, pressing: Array, turned: Array, kinks: Array, at_once: int
) -> tuple[Array, Array]:
    """Pieces (n, fields) of the cells that boundaries come near, and their number."""
    cells, near = slipping.size, slipping | pressing
    ordered = sort_by_counting(jnp.where(near, np.arange(cells), cells)).astype(int)
    ordered = jnp.concatenate([ordered, jnp.full(at_once, cells)])
    one = jax.tree.map(lambda each: each[:, :, 0], powers)
    most = jax.eval_shape(find_cuts, one, slipping[0], pressing[0], kinks)[0].size - 1

    def find_block(block: Array, state: tuple[Array, Array]) -> tuple[Array, Array]:
        pieces, count = state
        cell = jax.lax.dynamic_slice_in_dim(ordered, at_once * block, at_once)
        there, cell = cell < cells, jnp.minimum(cell, cells - 1)
        found = jax.vmap(find_cuts, in_axes=(-1, 0, 0, None))(
            powers.of(cell, turned[cell]), slipping[cell], pressing[cell], kinks
        )
        bounds, even, number, halved = found
        fields = [cell[:, None], turned[cell][:, None], bounds[:, :-1], bounds[:, 1:], even[:, :-1], even[:, 1:]]
        shape = (at_once, most)
        halves = (jnp.where(halved, 1, 0), there), (jnp.full(at_once, 2), there & halved)
        for half, more in halves[: 1 if powers.slip is None else 2]:  # only slip halves lines
            rows = jnp.stack(
                [jnp.broadcast_to(each, shape).astype(float) for each in (*fields, half[:, None])], axis=-1
            )
            for k in range(at_once):
                pieces = jax.lax.dynamic_update_slice(pieces, rows[k], (count, jnp.zeros((), count.dtype)))
                count = count + jnp.where(more[k], number[k], 0)
        return pieces, count

    start = jnp.zeros((2 * (cells + 1) * most, len(Piece._fields))), jnp.zeros((), int)
    return jax.lax.fori_loop(0, (jnp.sum(near) + at_once - 1) // at_once, find_block, start)
