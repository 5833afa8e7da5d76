"""Quadrature over a lining whose motion the plane z = 0 mirrors: on lines along θ, since it hardly varies across.

Levels are known at Gauss nodes of cells along each line. A cell that a boundary crosses or comes near is cut on each
line where that line crosses it, and what is summed on the lines is smooth across. Where it is not, because a boundary
crosses only some of the lines (a patch that lifts off, or has its end within the width), a cell is cut on more lines.
Sums on these bend like (z − b)^{3/2} at the end b of a patch; as levels vary little across, there is not much in it.
"""

from collections.abc import Callable
from functools import cache, partial
from typing import Any, NamedTuple, Self, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from drumsqueal.physics.quadrature.cells import (
    CLEAR_CELL,
    CellDensities,
    CellNodes,
    Cells,
    Near,
    Sampled,
    Spread,
    at_nodes,
)
from drumsqueal.physics.quadrature.cut_cells import Powers, line_nodes, repeated
from drumsqueal.physics.quadrature.polynomials import (
    applied,
    compute_once,
    evaluate,
    gauss_nodes,
    to_legendre,
    to_powers,
    to_sides,
    to_slopes,
)
from drumsqueal.physics.quadrature.surface import Boundaries, Lining, resolved, sum_over_points

LINES = 4  # across half the width at least; levels of modes up to z⁶ are known by them exactly
MOST_LINES = 9
START, NEWTON = 0.85, 12  # power of Gauss's places near to those of lines, and steps from there
# Times as many lines are cut where what is summed on lines is not smooth across. Forces of the paper's shoe of steel in
# a saturated motion then err by 1e-7 of the load in the median of such states, and by 7e-6 in one of ten, with three
# times as many by 6e-8 and 3e-6; a transient takes four fifths of the time and no more steps.
SETS = 2


class LineNodes(NamedTuple):
    """Where nodes lie on some lines of a cell: points (points, stretches × lines), and if there are any."""

    cell: Array
    lines: Array
    point: Array
    some: Array
    shape: tuple[int, int, int]
    known: tuple[tuple[Array, Array], ...]

    def value(self, level: Sampled) -> Array:
        """Of a level at the nodes."""
        found = next((powers for values, powers in self.known if values is level.values), None)
        if found is None:
            found = compute_once(self.some, lambda: _powers_of(level, self.shape, self.cell, self.lines))
        powers = compute_once(self.some, partial(repeated, found, self.point))
        return compute_once(self.some, lambda: evaluate(powers, self.point)).ravel()


class Sums(NamedTuple):
    """Totals of densities, and of those that are spread moments (k, order, cells × lines) about the middle of cells."""

    totals: dict[str, Array]
    moments: Array


class LineCells(Cells):
    """The lining in cells along each of some lines `across` half the width, `order` Gauss nodes along each.

    All is even in z but V_z, which is odd: half the width counts twice.
    """

    across: int = eqx.field(static=True, default=LINES)
    axes = 1

    def __check_init__(self) -> None:
        """Rules of more lines are too badly conditioned to be found."""
        if not 1 <= self.across <= MOST_LINES:
            raise ValueError(f"half the width takes 1 to {MOST_LINES} lines, got {self.across}")

    @property
    def shape(self) -> tuple[int, int, int]:
        """Nodes along each cell of a line, cells along it, lines: what is asked of nodes of a cell has long rows."""
        return self.order, self.along, self.across

    @property
    def count(self) -> int:
        """Number N of nodes."""
        return self.across * self.along * self.order

    def nodes(self, lining: Lining) -> CellNodes:
        """All nodes, (N,) in the order of nodes of a cell, cells, lines."""
        point, weight = (each[:, None, None] for each in gauss_nodes(self.order))
        cell, (place, across) = np.arange(self.along)[:, None], half_rule(self.across)
        parts = self._locate(lining, cell, point, weight, place, across)
        theta, z, area = (jnp.broadcast_to(each, self.shape).ravel() for each in parts)
        return CellNodes(theta, z, area, None)

    def _locate(
        self, lining: Lining, cell: Any, point: Any, weight: Any, place: Any, across: Any
    ) -> tuple[Array, Array, Array]:
        """θ (rad), z (m) and weight (m²) of points of [−1, 1] with weights there, on a line of a cell."""
        half_arc = lining.half_angle / self.along
        theta = -lining.half_angle + half_arc * (2 * cell + 1 + point)
        area = lining.outer_radius * half_arc * lining.width * across
        return theta, lining.width / 2 * place, area * weight

    def forces(
        self,
        lining: Lining,
        boundaries: Boundaries,
        levels: Any,
        densities: Callable[[Any, CellNodes], CellDensities],
    ) -> dict[str, Array]:
        """Totals, with slopes by differentiation: of what moves in the plane there are few coordinates."""
        return self.integrate(lining, boundaries, partial(densities, levels))

    def _add_cut(
        self,
        lining: Lining,
        boundaries: Boundaries,
        densities: Callable[[CellNodes], CellDensities],
        near: Near,
        totals: dict[str, Array],
    ) -> dict[str, Array]:
        """Add the totals of cells near to boundaries, cut on each line, or on more lines where one `ends`.

        So many lines of a cell at a time as levels are known on. Where slip turns along a cell, as it can reverse twice
        there, the parts of lines below the turn and those above come one after the other.
        """
        slipping, pressing, ends = near
        sets = jnp.concatenate([~ends[None], jnp.broadcast_to(ends, (SETS, self.along))])
        pressure, slip, axial = levels = _levels(boundaries)

        def add(sums: Sums, halves: Array, levels: tuple[Sampled | None, ...]) -> Sums:
            which = halves[:, None] & sets
            counted = _counted(which.reshape(-1, self.along))

            def add_some(k: Array, sums: Sums) -> Sums:
                item = jnp.sum(counted <= k)
                half, (lines, cell) = item // sets.size, jnp.divmod(item % sets.size, self.along)
                some = item < counted.size
                powers = compute_once(
                    some, lambda: Powers(*(each and _powers_of(each, self.shape, cell, lines) for each in levels))
                )
                halves = jnp.full(self.across, half)
                point, weight = line_nodes(powers, halves, boundaries.kinks, some, lifted=boundaries.lifted)
                across = (repeated(jnp.asarray(each)[lines], point) for each in sets_of_lines(self.across)[:2])
                theta, z, weight = self._locate(lining, cell, point, weight, *across)
                z = jnp.broadcast_to(z, theta.shape)
                pairs = zip(levels, powers, strict=True)
                known = tuple((level.values, found) for level, found in pairs if level and found is not None)
                place = LineNodes(cell, lines, point, some, self.shape, known)
                nodes = CellNodes(theta.ravel(), z.ravel(), weight.ravel(), place)
                return self._with_cut(sums, densities(nodes), place)

            return jax.lax.fori_loop(0, counted[-1], add_some, sums)

        spread = sorted(name for name, each in totals.items() if each.ndim)
        none = jnp.zeros((len(spread), self.order, self.along * self.across))
        sums = Sums({name: each for name, each in totals.items() if name not in spread}, none)
        alone = (pressing & ~slipping)[None]  # where only contact ends
        parts: list[tuple[Array, tuple[Sampled | None, ...]]]
        parts = [] if pressure is None else [(alone, (pressure, None, None))]
        if slip is not None:
            turning = jax.lax.stop_gradient(self._turns_along(slip))
            halves = slipping & jnp.stack([~turning, turning, turning])
            if boundaries.rarely:
                parts = [(halves.at[:1].max(alone), levels)]
            else:
                parts = [(halves & ~pressing, (None, slip, axial)), (halves & pressing, levels), *parts]
        for each in parts:
            sums = add(sums, *each)
        nodes = applied(to_powers(self.order).T, sums.moments, 1)
        onto = dict(zip(spread, nodes.reshape(len(spread), self.count), strict=True))
        return sums.totals | {name: totals[name] + onto[name] for name in spread}

    def _with_cut(self, sums: Sums, found: CellDensities, place: LineNodes) -> Sums:
        """With those at nodes on some lines of a cell added."""
        parts = compute_once(place.some, lambda: at_nodes(found))
        parts = {name: each.reshape(place.point.shape) for name, each in parts.items()}
        odd = {name: each.odd for name, each in sorted(found.items()) if isinstance(each, Spread)}
        moments, power = {(name, 0): each for name, each in parts.items()}, jnp.ones_like(place.point)
        for p in range(1, self.order if odd else 1):
            power = power * place.point
            moments |= {(name, p): parts[name] * power for name in odd}
        stretches = sum_over_points(moments)
        moments = {key: jnp.sum(each.reshape(-1, self.across), axis=0) for key, each in stretches.items()}
        totals = {name: each + jnp.sum(moments[name, 0]) for name, each in sums.totals.items()}
        if not odd:
            return Sums(totals, sums.moments)
        onto = jnp.stack([_across(self.across, place.lines, odd=each) for each in odd.values()])
        more = compute_once(
            place.some, lambda: jnp.stack([jnp.stack([moments[name, p] for p in range(self.order)]) for name in odd])
        )
        more = jnp.sum(more[..., None] * onto[:, None], axis=2)
        first = jnp.zeros((), place.cell.dtype), jnp.zeros((), place.cell.dtype), place.cell * self.across
        own = jax.lax.dynamic_slice(sums.moments, first, more.shape)
        return Sums(totals, jax.lax.dynamic_update_slice(sums.moments, own + more, first))

    def finer(self, along: float, across: float, more: int) -> Self:
        """With so many times the cells, and as many lines at most as there are rules for."""
        return super().finer(along, min(across, MOST_LINES / self.across), more)

    def with_sides(self, level: Sampled) -> Array:
        """Values of the lines' polynomials at their nodes, on the cells' sides and on the lining's."""
        known = jnp.isfinite(level.values[0])  # computed once, not anew for every sum
        values = compute_once(known, lambda: level.values)
        lines = compute_once(known, lambda: self._with_edges(Sampled(values, level.odd)))
        return compute_once(known, lambda: applied(to_sides(self.order), lines, 0))

    def bound(self, level: Sampled) -> Array:
        """A bound of the size of a level, by the sums of its Legendre coefficients in each cell."""
        across = legendre_across(self.across, odd=level.odd)
        parts = applied(to_legendre(self.order), applied(across, level.values.reshape(self.shape), 2), 0)
        return jnp.max(jnp.sum(jnp.abs(parts), axis=(0, 2)))

    def _with_edges(self, level: Sampled) -> Array:
        """Values on the lines, and in the middle and on the edge of the width, (nodes, cells, lines + 2)."""
        lines = level.values.reshape(self.shape)
        return jnp.concatenate([lines, applied(across_width(self.across, (0.0, 1.0), odd=level.odd), lines, 2)], axis=2)

    def _at_nodes(self, cells: Array) -> Array:
        return jnp.broadcast_to(cells[:, None], self.shape).ravel()

    def _near(self, boundaries: Boundaries) -> Near:
        """A boundary ends where lines, with the middle and the edge of the width, are not crossed equally often."""
        pressure, slip, axial = _levels(boundaries)
        slipping = pressing = lifted = ends = jnp.zeros(self.along, bool)
        if pressure is not None:
            mean, swing = self._bounds(pressure)
            pressing, lifted = jnp.any(jnp.abs(mean) < swing, axis=1), jnp.all(mean < -swing, axis=1)
            ends |= _with_neighbours(self._ends(pressure, pressing), pressing)
        if slip is not None:
            mean, swing = self._bounds(slip)
            if axial is None:
                near = jnp.abs(mean) <= swing
            else:
                lateral = jnp.max(jnp.abs(axial.values.reshape(self.shape)), axis=0)
                near = jnp.abs(mean) <= CLEAR_CELL * jnp.hypot(swing, lateral)
            size = jnp.abs(mean)
            slowest, fastest = (jnp.min(jnp.maximum(size - swing, 0.0), axis=1), jnp.max(size + swing, axis=1))
            steep = jax.vmap(lambda low, high: ~resolved(boundaries.breakpoints, low, high))
            slipping = (jnp.any(near, axis=1) | steep(slowest, fastest)) & ~lifted
            ends |= _with_neighbours(self._ends(slip, slipping), slipping)
            if axial is not None:
                ends |= self._turns_across(slip, axial, slipping)
        return Near(slipping, pressing, ends)

    def _bounds(self, level: Sampled) -> tuple[Array, Array]:
        """Mean of each cell's polynomial on each line, and a bound of what it differs from it, (cells, lines)."""
        mean, *parts = applied(to_legendre(self.order), level.values.reshape(self.order, -1), 0)
        swing = sum(map(jnp.abs, parts), start=jnp.zeros_like(mean))
        return mean.reshape(self.along, -1), swing.reshape(self.along, -1)

    def _turns_along(self, slip: Sampled) -> Array:
        """In which cells (n,) slip may have an extremum along one of the lines, the middle or the edge."""
        slopes = to_legendre(self.order) @ to_slopes(self.order)
        parts = jnp.abs(applied(slopes, self._with_edges(slip), 0))
        return jnp.any(parts[0] <= jnp.sum(parts[1:], axis=0), axis=1)

    def _ends(self, level: Sampled, near: Array) -> Array:
        """In which cells (n,) lines change sign differently often, from the last node before them to the next one."""

        def look() -> Array:
            signs = self._with_edges(level) > 0
            inside = jnp.sum(signs[1:] != signs[:-1], axis=0)
            between = jnp.pad(signs[0, 1:] != signs[-1, :-1], ((1, 1), (0, 0))).astype(int)
            changes = inside + between[1:] + between[:-1]
            return jnp.max(changes, axis=1) != jnp.min(changes, axis=1)

        return compute_once(jnp.any(near), look)

    def _turns_across(self, slip: Sampled, axial: Sampled, near: Array) -> Array:
        """In which cells (n,) slip turns so much across that lines miss it: where it is slowest along, or at an end.

        Elsewhere sums along a line smooth that turn.
        """

        def look() -> Array:
            at_ends = to_sides(self.order)[[0, -1]]
            across = across_width(self.across, (0.0,), odd=False), across_width(self.across, (1.0,), odd=True)
            found = []
            for level, matrix in zip((slip, axial), across, strict=True):
                line = applied(matrix, level.values.reshape(self.shape), 2)[:, :, 0]
                ends = applied(at_ends, line[:, jnp.array([0, -1])], 0)
                found.append(jnp.concatenate([ends[0, :1], line.T.ravel(), ends[1, 1:]]))
            along, lateral = found
            change = along[1:] - along[:-1]
            turns = jnp.concatenate([jnp.ones(1, bool), change[1:] * change[:-1] <= 0, jnp.ones(1, bool)])
            # 2.0 times V_z on the edge: where V_θ is faster, lines resolve how slip turns across
            there = turns & (jnp.abs(along) < 2.0 * jnp.abs(lateral))
            inside = there[1:-1].at[0].max(there[0]).at[-1].max(there[-1])
            found = jnp.pad(jnp.any(inside.reshape(self.along, self.order), axis=1), 1)
            # Beside a cell in which nodes show it, too: it may lie between the last node and the next cell's first.
            return _with_neighbours(found[1:-1] | found[2:] | found[:-2], near)

        return compute_once(jnp.any(near), look)


def lines_for(degrees: int) -> LineCells:
    """Those on which levels of so many degrees in z, the constant with them, are known exactly, as far as there are.

    With two lines too few, forces of wide shoes and of modes beyond some 20 kHz are wrong by 1e-7 to 1e-5 of the load.
    """
    # Of shoes as wide as the paper's: what is beyond z⁶ changes growth rates by 6e-5 1/s up to 30 kHz. In a saturated
    # motion forces err by 3e-8 of the load in the median, and in one state of ten by more than 7e-7, where six lines
    # err by 3.5e-7 (all with SETS = 3); evaluations take two thirds of the time.
    of_narrow = 12
    return LineCells(across=LINES if degrees <= of_narrow else min((degrees + 1) // 2, MOST_LINES))


def lines_of(cells: Cells) -> LineCells:
    """As fine as the cells are: a cell across is worth some lines of half the width."""
    return LineCells(cells.along, min(MOST_LINES, LINES * cells.across), cells.order)


def onto_lines(cells: Cells, lines: LineCells, values: Array) -> Array:
    """What is known at the nodes of cells (..., N) at those of lines with as many cells and nodes along."""
    place, count = half_rule(lines.across)[0], cells.across
    scaled = count * (1 + place) / 2  # from the first cell's low side
    cell = np.minimum(scaled.astype(int), count - 1)
    powers = np.vander(2 * (scaled - cell) - 1, cells.order, increasing=True) @ to_powers(cells.order)
    parts = jnp.moveaxis(values.reshape(*values.shape[:-1], count, cells.along, cells.order, cells.order), -4, 0)
    found = jnp.einsum("lp,l...cpq->...qcl", powers, parts[cell])
    return found.reshape(*values.shape[:-1], lines.count)


@cache
def half_rule(lines: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places in (0, 1) and weights, of sum 1, exact for z^2k and z^(2k+2) log z, k < lines, by Newton's method.

    The logarithm is that of sums over lines on which slip reverses: there V_z, which is odd, is the distance of the
    branch points of V/|V|. Rules of this kind: Ma, Rokhlin & Wandzura, SIAM J. Numer. Anal. 33 (1996) 971.
    """
    point, weight = gauss_nodes(lines)
    place = ((1 + point) / 2) ** START
    weight = START * place / (1 + point) * weight
    degree = 2 * np.arange(lines)[:, None]
    exact = np.concatenate([1 / (degree[:, 0] + 1), -1 / (degree[:, 0] + 3) ** 2])
    for _ in range(NEWTON):
        power, log = place ** (degree + 1), np.log(place)
        values = np.concatenate([power / place, power * place * log])
        slopes = np.concatenate([degree * power / place**2, power * ((degree + 2) * log + 1)])
        step = np.linalg.solve(np.hstack([values, slopes * weight]), values @ weight - exact)
        while np.any(np.abs(2 * (place - step[lines:]) - 1) >= 1):  # a single line starts far off
            step /= 2
        weight, place = weight - step[:lines], place - step[lines:]
    return place, weight


@cache
def across_width(lines: int, places: tuple[float, ...], *, odd: bool) -> NDArray[np.float64]:
    """Values at places in [0, 1] of the even or odd polynomial in z through values on the lines, (places, lines)."""
    at, wanted = half_rule(lines)[0], np.array(places)
    first = 1 if odd else 0
    powers = first + 2 * np.arange(lines)
    return (wanted[:, None] ** powers) @ np.linalg.inv(at[:, None] ** powers)


@cache
def legendre_across(lines: int, *, odd: bool) -> NDArray[np.float64]:
    """Coefficients of the even or odd Legendre polynomials in z from the values on the lines, (lines, lines)."""
    table = np.polynomial.legendre.legvander(half_rule(lines)[0], 2 * lines - 1)
    return np.asarray(np.linalg.inv(table[:, int(odd) :: 2]), dtype=np.float64)


@cache
def sets_of_lines(lines: int) -> tuple[NDArray[np.float64], ...]:
    """Places and weights (sets, lines) across; values there from those of even and odd levels on `lines` (…, lines).

    The first set are the lines themselves, the others are those of Gauss's rule across half the width.
    """
    place, weight = half_rule(lines)
    more, share = gauss_nodes(SETS * lines)
    places = np.concatenate([place[None], (1 + more.reshape(-1, lines)) / 2])
    weights = np.concatenate([weight[None], share.reshape(-1, lines) / 2])
    even, odd = (across_width(lines, tuple(places.ravel()), odd=each) for each in (False, True))
    return places, weights, even.reshape(*places.shape, lines), odd.reshape(*places.shape, lines)


def _with_neighbours(ends: Array, near: Array) -> Array:
    """Those cells that are near to a boundary, and all that are without a gap between.

    Where slip turns in two cells, or a patch lies in them, their sum is what is smooth across.
    """
    run = jnp.cumsum(~near)
    return near & jnp.any((run[:, None] == run) & (ends & near), axis=1)


def _counted(which: Array) -> Array:
    """How many are true up to each one, (rows × columns,)."""
    rows, columns = which.shape
    within = jnp.sum(which[:, None] & np.tri(columns, dtype=bool), axis=2)
    before = jnp.sum(jnp.where(np.tri(rows, k=-1, dtype=bool), within[:, -1], 0), axis=1)
    return (before[:, None] + within).ravel()


def _levels(boundaries: Boundaries) -> tuple[Sampled | None, ...]:
    return cast("tuple[Sampled | None, ...]", boundaries[:3])


def _across(lines: int, which: Array, *, odd: bool) -> Array:
    """What takes values of levels on the lines to those on sets of lines (n,), (n, lines, lines)."""
    return jnp.asarray(sets_of_lines(lines)[3 if odd else 2])[which]


def _powers_of(level: Sampled, shape: tuple[int, int, int], cell: Array, lines: Array) -> Array:
    """Coefficients along θ on a set of lines of a cell, (order, lines)."""
    powers = applied(to_powers(shape[0]), level.values.reshape(shape)[:, cell], 0)
    return jnp.sum(powers[:, None] * _across(shape[2], lines, odd=level.odd), axis=-1)
