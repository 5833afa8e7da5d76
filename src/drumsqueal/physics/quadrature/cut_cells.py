"""Cells of a lining that a boundary crosses: where they are cut, and the nodes on the pieces.

In the manner of Saye (SIAM J. Sci. Comput. 37 (2015) A993): lines run through the cell in the direction in which the
level changes most. On each, the roots of the levels are found, and there is a Gauss rule between two of them, graded
towards the turn of V/|V|. Across the lines, the cell is cut where a boundary enters or leaves it, where it touches a
line, where it meets the other one, and where V_z vanishes on it.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.physics.quadrature.arc import sort_by_counting, sort_network
from drumsqueal.physics.quadrature.area import graded
from drumsqueal.physics.quadrature.polynomials import (
    applied,
    at_points,
    bracketed_root,
    compute_once,
    derivative,
    evaluate,
    gauss_nodes,
    lobatto,
    moving_root,
    split_line,
    square,
    to_powers,
    to_slopes,
    with_slope,
)

# Nodes: lines of a piece; on a stretch of a line that is graded towards the turn of V/|V|, and on one that is not.
LINES, POINTS, PLAIN_POINTS = 10, 12, 7
OUTER_SAMPLES = 11
SAMPLES = lobatto(OUTER_SAMPLES)  # lines on which a cell is looked at
WIDE = 1.5  # where curves are looked for: they may leave the cell through a side s = ±1 between two of these lines
NEAR_SIDE = 0.5  # of the swing along a side; where the slip is slower on it, nodes crowd towards that
SMALLEST = 1e-30


class Powers(NamedTuple):
    """Coefficients of x^q s^p (order, order, ...) of the levels of cells; None where there is no level."""

    pressure: Array | None
    slip: Array | None
    axial: Array | None

    def of(self, cell: Array, turned: Array) -> "Powers":
        """Those of some cells, with s along θ where they are turned, along z otherwise."""

        def pick(level: Array | None) -> Array | None:
            if level is None:
                return None
            some = level[:, :, cell]
            return jnp.where(turned, jnp.swapaxes(some, 0, 1), some)

        return Powers(*(pick(each) for each in self))


class Piece(NamedTuple):
    """Parts of cells, as one array each (n,).

    Where they begin and end across their lines, in [−1, 1]; how evenly nodes leave these ends (1, or 0: they crowd
    there); and which part of their lines they have: all (0), below (1) or above (2) where slip turns.
    """

    cell: Array
    turned: Array
    low: Array
    high: Array
    first: Array
    last: Array
    half: Array


def powers_of(values: Array) -> Array:
    """Coefficients of θ^q z^p (order, order, cells), in a cell's own [−1, 1], from values (cells, across, along)."""
    matrix = to_powers(values.shape[-1])
    return jnp.transpose(applied(matrix, applied(matrix, values, 1), 2))


def turn_lines(values: Array) -> Array:
    """Whether lines should run along θ: where a level (cells, across, along) changes more that way, near its root."""
    slopes = to_slopes(values.shape[-1])
    across, along = applied(slopes, values, 1), applied(slopes, values, 2)
    scale = 0.3 * (jnp.max(values, axis=(1, 2)) - jnp.min(values, axis=(1, 2)))  # of the range of a level in a cell
    near = 1 / (1 + jnp.square(values / jnp.maximum(scale, SMALLEST)[:, None, None])) ** 2
    size_across, size_along = (jnp.abs(jnp.sum(near * each, axis=(1, 2))) for each in (across, along))
    return size_along > size_across


class Look(NamedTuple):
    """What levels do along the two sides s = ±1 of a cell and along sample lines; NaN where they do not.

    Where they vanish on the sides (2, levels, 2). Where they turn closest to zero on lines (levels, samples), within
    the cell, and for the first of them, or else beyond its sides: the curve on which a level vanishes or turns may
    leave the cell between two lines. Likewise where the first vanishes, rising or falling (samples,).
    """

    on_sides: Array
    turn: Array
    turn_beyond: Array
    rises: Array
    falls: Array


@jax.jit
def find_cuts(powers: Powers, slipping: Array, pressing: Array, kinks: Array) -> tuple[Array, Array, Array, Array]:
    """Pieces of one cell: sorted bounds across the lines, how evenly nodes leave them, their number, and if halved.

    Only what comes near it counts.
    """
    both = [(each, near) for each, near in ((powers.slip, slipping), (powers.pressure, pressing)) if each is not None]
    levels, near = (jnp.stack(each, axis=-1) for each in zip(*both, strict=True))
    lines = jnp.moveaxis(
        at_points(levels, SAMPLES), 0, -1
    )  # coefficients along s on x = const (order, levels, samples)
    look = _look(levels, lines, near)
    found = [_there(look.on_sides), _find_patches(levels, lines, look.turn), _find_meetings(powers, look, pressing)]
    even, halved = jnp.ones(2), jnp.asarray(False)
    if powers.slip is not None:
        slow, even = _find_slow(powers.slip, powers.axial, slipping)
        found += [slow, _find_kinks(powers.slip, powers.axial, slipping, kinks)]
        halved = jnp.any(~jnp.isnan(look.turn[0]))
    return *_sorted(jnp.concatenate(found), even), halved


def _look(levels: Array, lines: Array, near: Array) -> Look:
    """Look at levels (order, order, levels), those of them (levels,) that come near; beyond the sides at the first."""
    order, count = len(levels), levels.shape[-1]
    wide = lines[:, 0] * (WIDE ** np.arange(order))[:, None]
    within = jnp.concatenate([_at_sides(levels), lines], axis=-1)
    every = jnp.concatenate([within.reshape(order, -1), wide], axis=-1)
    near = jnp.concatenate([jnp.repeat(near, within.shape[-1]), jnp.repeat(near[:1], OUTER_SAMPLES)])
    (has_turn, turn), (has_root, root) = split_line(every)
    turn, root = jnp.where(has_turn & near, turn, jnp.nan), jnp.where(has_root & near, root, jnp.nan)
    # The root below the turn begins at −1, that above it ends at 1.
    rising = jnp.stack([evaluate(every, jnp.asarray(-1.0)) < 0, evaluate(every, jnp.asarray(1.0)) > 0])
    rises, falls = (_first(*jnp.where(rising == up, root, jnp.nan)) for up in (True, False))

    def on_lines(each: Array) -> tuple[Array, Array]:
        """Within the cell (levels, samples), and of the first level there or beyond (samples,)."""
        inside = each[:-OUTER_SAMPLES].reshape(count, -1)[:, 2:]
        return inside, _first(inside[0], WIDE * each[-OUTER_SAMPLES:])

    turn, beyond = on_lines(turn)
    on_sides = root[:, :-OUTER_SAMPLES].reshape(2, count, -1)[..., :2]
    return Look(on_sides, turn, turn.at[0].set(beyond), on_lines(rises)[1], on_lines(falls)[1])


def _first(one: Array, other: Array) -> Array:
    return jnp.where(jnp.isnan(one), other, one)


def _there(cuts: Array) -> Array:
    """Cuts (n,) with those that are not there at the end."""
    return _first(cuts, jnp.asarray(1.0)).ravel()


def _find_slow(slip: Array, axial: Array | None, near: Array) -> tuple[Array, Array]:
    """Where |V| is least along the sides s = ±1, if slow there, and whether nodes leave the sides x = ±1 evenly.

    They do unless it is slow on these. There it may vanish just outside the cell.
    """
    sides = [_at_sides(each) for each in (slip, axial) if each is not None]
    swing = sum(jnp.square(jnp.max(jnp.abs(each[1:]), axis=0)) for each in sides) * NEAR_SIDE**2
    squared = _squared_speed(sides[0], sides[1] if axial is not None else None, jnp.zeros(1))[:, 0]
    (turns, least), _ = split_line(squared)
    slow = near & turns & (evaluate(squared, least) < swing)
    ends = [at_points(at_points(each, np.array([-1.0, 1.0])).T, SAMPLES) for each in (slip, axial) if each is not None]
    ends = jnp.min(sum(jnp.square(each) for each in ends), axis=0)
    return jnp.where(slow, least, 1.0), jnp.where(near & (ends < jnp.max(swing)), 0.0, 1.0)


def _find_kinks(slip: Array, axial: Array | None, near: Array, kinks: Array) -> Array:
    """Where the slip speed is at a kink of the friction law on the sides s = ±1."""
    if not kinks.size:
        return jnp.zeros(0)
    there, crossing = split_line(_squared_speed(_at_sides(slip), None if axial is None else _at_sides(axial), kinks))[1]
    return jnp.where(there & near, crossing, 1.0).ravel()


def _along(level: Array) -> Array:
    """Coefficients of ∂/∂s of a level (order, order)."""
    return jnp.swapaxes(derivative(jnp.swapaxes(level, 0, 1)), 0, 1)


def _at_sides(levels: Array) -> Array:
    """Coefficients along x on the two sides s = −1 and 1 (order, ..., 2)."""
    return jnp.moveaxis(at_points(jnp.swapaxes(levels, 0, 1), np.array([-1.0, 1.0])), 0, -1)


def _squared_speed(slip: Array, axial: Array | None, kinks: Array) -> Array:
    """Coefficients (2 order − 1, kinks, ...) of |V|² less the squares of slip speeds, on lines (order, ...)."""
    squared = square(slip) if axial is None else square(slip) + square(axial)
    every = jnp.broadcast_to(squared[:, None], (len(squared), kinks.size, *squared.shape[1:]))
    return every.at[0].add(-jnp.square(kinks).reshape(-1, *[1] * (squared.ndim - 1)))


def _sorted(cuts: Array, kinds: Array) -> tuple[Array, Array, Array]:
    """Bounds with the cuts that are there first, how evenly nodes leave them, and the number of pieces between them."""
    cuts = sort_by_counting(cuts)
    before = jnp.concatenate([jnp.full(1, -1.0), cuts[:-1]])
    shortest = 1e-5  # of a cell; cuts closer to each other are one
    keep = (cuts - before > shortest) & (cuts < 1 - shortest) & (cuts > shortest - 1)
    bounds = sort_by_counting(jnp.concatenate([jnp.full(1, -1.0), jnp.where(keep, cuts, 1.0), jnp.ones(1)]))
    even = jnp.where(bounds <= -1, kinds[0], jnp.where(bounds >= 1, kinds[1], 0.0))
    return bounds, even, 1 + jnp.sum(keep)


def _find_meetings(powers: Powers, look: Look, pressing: Array) -> Array:
    """First and last x where a level vanishes and turns along s, or slip vanishes together with V_z or the pressure."""
    pairs, curves = [], []  # levels that vanish together, and a curve s(x) on which the first does, with the other's
    for k, level in enumerate(each for each in (powers.slip, powers.pressure) if each is not None):
        pairs.append((level, _along(level)))
        curves.append((look.turn_beyond[k], level))
    if powers.slip is not None:
        for other in (powers.axial, powers.pressure):
            if other is not None:
                for s in (look.rises, look.falls):
                    pairs.append((powers.slip, other))
                    curves.append((jnp.where(pressing, s, jnp.nan) if other is powers.pressure else s, other))
    pairs = jnp.stack([jnp.stack(each, axis=2) for each in pairs], axis=3)
    s, other = (jnp.stack(each, axis=-1) for each in zip(*curves, strict=True))
    return _meetings(pairs, s, evaluate(jnp.moveaxis(at_points(other, SAMPLES), 0, 1), s))


def _meetings(pairs: Array, s: Array, value: Array) -> Array:
    """First and last x where both of a pair (order, order, 2, pairs) vanish, on a curve s(x) at samples, of a value.

    The value (samples, pairs) vanishes there, too.
    """
    crossed = value[1:] * value[:-1] < 0
    low, high = jnp.asarray(SAMPLES[:-1, None]), jnp.asarray(SAMPLES[1:, None])
    fraction = value[:-1] / jnp.where(crossed, value[:-1] - value[1:], 1.0)
    guess = low + fraction * (high - low), s[:-1] + fraction * (s[1:] - s[:-1])
    is_first = crossed & (low == jnp.min(jnp.where(crossed, low, 2.0), axis=0))
    is_last = crossed & (low == jnp.max(jnp.where(crossed, low, -2.0), axis=0))

    def pick(each: Array) -> Array:
        return jnp.stack([jnp.sum(jnp.where(which, each, 0.0), axis=0) for which in (is_first, is_last)])

    there, low, high = (pick(jnp.broadcast_to(each, crossed.shape)) for each in (1.0, low, high))
    x, y = (pick(each) for each in guess)
    met, _ = _meet(pairs[:, :, :, None], x, y)
    return jnp.where(there > 0, jnp.where((met >= low) & (met <= high), met, x), 1.0).ravel()


def _find_patches(levels: Array, lines: Array, turn: Array) -> Array:
    """Where patches begin and end about an extremum of a level, which may lie between two samples; or that, if nearly.

    Along the curve s(x) (levels, samples) on which ∂/∂s vanishes the level is a parabola about it.
    """
    size = jnp.abs(evaluate(lines, turn))
    least = size == jnp.nanmin(size, axis=1, keepdims=True)
    start = (jnp.max(jnp.where(least, each, -jnp.inf), axis=1) for each in (SAMPLES, turn))
    slopes = jnp.stack([derivative(levels), _along(levels)], axis=2)
    x, y = _meet(slopes, *start)
    _, (xx, _), (xs, ss) = _with_slopes(slopes, x, y)
    tilt = xs / jnp.where(ss == 0, jnp.inf, ss)
    bend = xx - xs * tilt
    squared = -2 * evaluate(evaluate(levels, x), y) / jnp.where(bend == 0, jnp.inf, bend)
    inside = (jnp.abs(x) < 1) & (jnp.abs(y) < 1)
    almost, inside = inside & (jnp.abs(squared) < NEAR_SIDE**2), inside & (squared > 0)
    width = jnp.sqrt(jnp.where(inside, squared, 1.0)) * np.array([[-1.0], [1.0]])
    pairs = jnp.stack([levels, _along(levels)], axis=2)
    end, _ = _meet(pairs[:, :, :, None], x + width, y - width * tilt)
    end = jnp.where(jnp.abs(end - x - width) < jnp.abs(width) / 2, end, x + width)
    return jnp.where(inside & (jnp.abs(end) < 1), end, jnp.where(almost, x, 1.0)).ravel()


def _meet(pair: Array, x: Array, s: Array) -> tuple[Array, Array]:
    """Where two levels (order, order, 2, ...) vanish, by Newton's method."""

    def improve(_: int, point: tuple[Array, Array]) -> tuple[Array, Array]:
        (a, b), (a_x, b_x), (a_s, b_s) = _with_slopes(pair, *point)
        determinant = a_s * b_x - a_x * b_s
        determinant = jnp.where(determinant == 0, jnp.inf, determinant)
        return point[0] - (a_s * b - b_s * a) / determinant, point[1] - (a * b_x - b * a_x) / determinant

    return jax.lax.fori_loop(0, 5, improve, (x, s))  # steps towards points where two boundaries meet


def _with_slopes(level: Array, x: Array, s: Array) -> tuple[Array, Array, Array]:
    """Value and derivatives along x and s."""
    line, change = with_slope(level, x)
    value, slope = with_slope(line, s)
    return value, evaluate(change, s), slope


def piece_nodes(powers: Powers, piece: Piece, kinks: Array, some: Array, *, lifted: bool) -> tuple[Array, Array, Array]:
    """Lines of pieces x (n, lines), points on them (points, stretches × n × lines) and weights of sum 4 over a cell."""
    x, across = _outer_rule(piece)
    lines = [None if each is None else evaluate(each[..., None], x).reshape(len(each), -1) for each in powers]
    levels = Powers(*compute_once(some, lambda: lines))
    inner, weight = line_nodes(levels, jnp.repeat(piece.half, LINES), kinks, some, lifted=lifted)
    return compute_once(some, lambda: (x, inner, weight * repeated(across.ravel(), inner)))


def line_nodes(powers: Powers, half: Array, kinks: Array, some: Array, *, lifted: bool) -> tuple[Array, Array]:
    """Points (points, stretches × n) and weights, of sum 2, on n lines on which levels have coefficients (order, n).

    Only `half` (n,) of a line, below (1) or above (2) where slip turns, or all of it (0). None where there are not
    `some`. Lines and their stretches are one axis: it fills the lanes of a processor, where several short ones do not.
    """
    pressure, slip, axial = powers
    both, count = [each for each in (slip, pressure) if each is not None], half.size
    (_, turn), (has_root, root) = split_line(jax.lax.stop_gradient(jnp.concatenate(both, axis=1)))
    low, high, centre, cuts = -jnp.ones(count), jnp.ones(count), None, []
    if slip is not None:
        low, high = jnp.where(half == 2, turn[:count], low), jnp.where(half == 1, turn[:count], high)
        centre = _slowest(slip, axial, has_root[:, :count], root[:, :count], low, high)
        cuts.append(centre)
        if kinks.size:
            speed = _squared_speed(slip, axial, kinks)
            for end in (low, high):
                there, cut = bracketed_root(speed, *(jnp.broadcast_to(each, speed.shape[1:]) for each in (centre, end)))
                cuts += list(jnp.where(there, cut, end))
    if pressure is not None:
        # The stiffness of what presses changes with its end.
        has_root, root = has_root[:, -count:], root[:, -count:]
        edges = [moving_root(pressure, root[k]) for k in range(2)]
        cuts += [jnp.clip(jnp.where(has_root[k], edges[k], high), low, high) for k in range(2)]
    bounds = jnp.stack([low, *sort_network(cuts), high])
    start, stop = bounds[:-1], bounds[1:]
    keep = stop > start
    if pressure is not None and not lifted:
        keep &= evaluate(pressure, (start + stop) / 2) > 0
    if slip is None and len(bounds) == 4 and not lifted:
        # What presses of three stretches between two roots is one of the first two, or these together, and the last.
        start = jnp.stack([jnp.where(keep[0], start[0], start[1]), start[2]])
        stop = jnp.stack([jnp.where(keep[1], stop[1], stop[0]), stop[2]])
        keep = jnp.stack([keep[0] | keep[1], keep[2]])
    keep, start, stop = compute_once(some, lambda: tuple(each.ravel() for each in (keep, start, stop)))
    if slip is None:
        point, weight = (each[:, None] for each in gauss_nodes(PLAIN_POINTS))
        near, far, fraction, weight = start, stop, (1 + point) / 2, weight / 2
    else:
        assert centre is not None
        own = slip, axial, centre
        slip, axial, centre = compute_once(some, lambda: jax.tree.map(partial(repeated, points=start), own))
        below = stop <= centre
        near, far = jnp.where(below, stop, start), jnp.where(below, start, stop)
        distance = compute_once(some, lambda: _distance(slip, axial, near, far))
        # A singularity closer to the end of a stretch than 2e-7 of its length counts as being so far off.
        fraction, weight = graded(distance, POINTS, 2e-7, some)
    return compute_once(some, lambda: (near + (far - near) * fraction, jnp.where(keep, (stop - start) * weight, 0.0)))


def repeated(lines: Array, points: Array) -> Array:
    """What is known of lines (..., n) for each stretch of them, as points (..., stretches × n) are."""
    return jnp.concatenate([lines] * (points.shape[-1] // lines.shape[-1]), axis=-1)


def _distance(slip: Array, axial: Array | None, near: Array, far: Array) -> Array:
    """How far off the near end of a stretch the direction of friction turns, over its length."""
    speed, change = jnp.abs(evaluate(slip, near)), jnp.abs(evaluate(slip, far) - evaluate(slip, near))
    if axial is not None:
        lateral = evaluate(axial, near)
        speed, change = jnp.hypot(speed, lateral), jnp.hypot(change, evaluate(axial, far) - lateral)
    return jax.lax.stop_gradient(speed / jnp.maximum(change, SMALLEST))


def _outer_rule(piece: Piece) -> tuple[Array, Array]:
    """Lines of pieces and weights (n, lines): Gauss's rule mapped by a cubic with given slopes at the ends."""
    point, weight = gauss_nodes(LINES)
    t = (point + 1) / 2
    first, last = piece.first[:, None], piece.last[:, None]
    square, cube = 3 - 2 * first - last, first + last - 2
    length = (piece.high - piece.low)[:, None]
    x = piece.low[:, None] + length * t * (first + t * (square + t * cube))
    return x, length * (first + t * (2 * square + 3 * t * cube)) * (weight / 2)


def _slowest(slip: Array, axial: Array | None, has_root: Array, root: Array, low: Array, high: Array) -> Array:
    """Where on each line between low and high the slip is slowest: the root of V_θ moves with it."""
    inside = has_root & (root >= low) & (root <= high)
    there, chosen = inside[0] | inside[1], jnp.where(inside[0], root[0], root[1])
    slope = jax.lax.stop_gradient(evaluate(derivative(slip), chosen))
    moved = chosen - evaluate(slip, chosen) / jnp.where(slope == 0, jnp.inf, slope)
    first, last = (jnp.abs(evaluate(slip, end)) for end in (low, high))
    if axial is None:
        return jnp.where(there, jnp.clip(moved, low, high), jnp.where(first < last, low, high))
    first, last = (jnp.hypot(size, evaluate(axial, end)) for size, end in ((first, low), (last, high)))
    start = jax.lax.stop_gradient(jnp.where(there, chosen, jnp.where(first < last, low, high)))
    least = _least_speed(*jax.lax.stop_gradient((slip, axial, start, low, high)))
    return jnp.where(there, jnp.clip(least + (moved - jax.lax.stop_gradient(moved)), low, high), least)


def _least_speed(slip: Array, axial: Array, start: Array, low: Array, high: Array) -> Array:
    """Where between low and high |V| is least near to a start, by Gauss and Newton's method; or the start."""

    def look(s: Array) -> tuple[Array, Array, Array]:
        (value, slope), (lateral, change) = with_slope(slip, s), with_slope(axial, s)
        squared = slope * slope + change * change
        step = (value * slope + lateral * change) / jnp.where(squared > 0, squared, jnp.inf)
        return value * value + lateral * lateral, s, jnp.clip(s - step, low, high)

    def improve(_: int, state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        one, other = state, look(state[2])
        better = other[0] < one[0]
        # Half a step where a whole one is too far.
        value, place, following = zip(other, (one[0], one[1], (one[1] + one[2]) / 2), strict=True)
        return jnp.where(better, *value), jnp.where(better, *place), jnp.where(better, *following)

    return jax.lax.fori_loop(0, 4, improve, look(start))[1]  # towards where |V| is least on a line
