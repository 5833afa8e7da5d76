"""Cells of a lining that a boundary crosses: where they are cut, and the nodes on the pieces.

In the manner of Saye (SIAM J. Sci. Comput. 37 (2015) A993): lines run through the cell in the direction in which the
level changes most. On each, the roots of the levels are found, and there is a Gauss rule between two of them, graded
towards the turn of V/|V|. Across the lines, the cell is cut where a boundary enters or leaves it, where it touches a
line, where it meets the other one, and where V_z vanishes on it.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

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
    split_line,
    to_powers,
    to_slopes,
    with_slope,
)

# Nodes: lines of a piece; on a stretch of a line that is graded towards the turn of V/|V|, and on one that is not.
LINES, POINTS, PLAIN_POINTS = 10, 12, 7
OUTER_SAMPLES = 11  # lines on which a cell is looked at
NEWTON = 5  # steps towards points where two boundaries meet
SHORTEST = 1e-5  # of a cell; cuts closer to each other are one
NARROWEST = 2e-7  # lengths of a stretch; a singularity closer to its end counts as being so far off
NEAR_CORNER = 0.5  # of the swing along a side; where the slip is slower in a corner, nodes crowd towards it
NEAR_ROOT = 0.3  # of the range of a level in a cell
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
    scale = NEAR_ROOT * (jnp.max(values, axis=(1, 2)) - jnp.min(values, axis=(1, 2)))
    near = 1 / (1 + jnp.square(values / jnp.maximum(scale, SMALLEST)[:, None, None])) ** 2
    size_across, size_along = (jnp.abs(jnp.sum(near * each, axis=(1, 2))) for each in (across, along))
    return size_along > size_across


def find_cuts(powers: Powers, slipping: Array, pressing: Array, kinks: Array) -> tuple[Array, Array, Array, Array]:
    """Pieces of one cell: sorted bounds across the lines, how evenly nodes leave them, their number, and if halved.

    Only what comes near it counts.
    """
    samples = lobatto(OUTER_SAMPLES)
    slip, pressure = powers.slip, powers.pressure
    levels = [each for each in (slip, pressure) if each is not None]
    near = jnp.stack([each for level, each in ((slip, slipping), (pressure, pressing)) if level is not None])
    lines = [_on_lines(each, samples) for each in levels]
    sides = [_at_sides(each) for each in levels]
    every = jnp.stack([jnp.concatenate(each, axis=1) for each in zip(sides, lines, strict=True)], axis=1)
    (has_turn, turn), (has_root, root) = split_line(every)  # (levels, 2 + samples) and (2, levels, 2 + samples)
    has_turn, has_root = has_turn & near[:, None], has_root & near[:, None]
    found = [jnp.where(has_root[:, :, :2], root[:, :, :2], 1.0).ravel()]
    pairs, curves = [], []  # levels that vanish together, and curves along which the first does
    for k, level in enumerate(levels):
        value = jnp.where(has_turn[k, 2:], evaluate(lines[k], turn[k, 2:]), jnp.nan)
        pairs.append((level, _along(level)))
        curves.append((turn[k, 2:], value))
    kinds = jnp.ones(2)
    halved = jnp.asarray(False)
    if slip is not None:
        halved = jnp.any(has_turn[0, 2:])
        side = sides[0]
        swing = NEAR_CORNER * jnp.max(jnp.abs(side[1:]), axis=0)
        slow = jnp.abs(evaluate(side, turn[0, :2])) < swing
        found.append(jnp.where(has_turn[0, :2] & slow, turn[0, :2], 1.0))
        ends = evaluate(side[:, None, :], jnp.asarray([[-1.0], [1.0]]))
        kinds = jnp.where(slipping & jnp.any(jnp.abs(ends) < swing, axis=1), 0.0, 1.0)
        for other in (powers.axial, pressure):
            if other is not None:
                across = _on_lines(other, samples)
                for j in range(2):
                    s = root[j, 0, 2:]
                    meets = has_root[j, 0, 2:] & (pressing if other is pressure else True)
                    pairs.append((slip, other))
                    curves.append((s, jnp.where(meets, evaluate(across, s), jnp.nan)))
        if kinks.size:
            axial = None if powers.axial is None else _at_sides(powers.axial)
            speeds = _squared_speed(side, axial, kinks)
            there, crossing = split_line(speeds)[1]
            found.append(jnp.where(there & slipping, crossing, 1.0).ravel())
    pairs = jnp.stack([jnp.stack(each, axis=2) for each in pairs], axis=3)
    s, value = (jnp.stack(each, axis=-1) for each in zip(*curves, strict=True))
    found += _meetings_and_patches(pairs, len(levels), samples, s, value)
    return *_sorted(jnp.concatenate(found), kinds), halved


def _on_lines(level: Array, samples: NDArray[np.float64]) -> Array:
    """Coefficients along s on lines x = const (order, lines)."""
    return at_points(level, samples).T


def _along(level: Array) -> Array:
    """Coefficients of ∂/∂s of a level (order, order)."""
    return jnp.swapaxes(derivative(jnp.swapaxes(level, 0, 1)), 0, 1)


def _at_sides(level: Array) -> Array:
    """Coefficients along x on the two sides s = −1 and 1 (order, 2)."""
    return at_points(level.T, np.array([-1.0, 1.0])).T


def _squared_speed(slip: Array, axial: Array | None, kinks: Array) -> Array:
    """Coefficients (2 order − 1, kinks, ...) of |V|² less the squares of slip speeds, on lines (order, ...)."""
    squared = _square(slip) if axial is None else _square(slip) + _square(axial)
    every = jnp.broadcast_to(squared[:, None], (len(squared), kinks.size, *squared.shape[1:]))
    return every.at[0].add(-jnp.square(kinks).reshape(-1, *[1] * (squared.ndim - 1)))


def _square(powers: Array) -> Array:
    order = len(powers)
    parts = [sum(powers[i] * powers[k - i] for i in range(order) if 0 <= k - i < order) for k in range(2 * order - 1)]
    return jnp.stack([jnp.asarray(each) for each in parts])


def _sorted(cuts: Array, kinds: Array) -> tuple[Array, Array, Array]:
    """Bounds with the cuts that are there first, how evenly nodes leave them, and the number of pieces between them."""
    cuts = sort_by_counting(cuts)
    before = jnp.concatenate([jnp.full(1, -1.0), cuts[:-1]])
    keep = (cuts - before > SHORTEST) & (cuts < 1 - SHORTEST) & (cuts > SHORTEST - 1)
    bounds = sort_by_counting(jnp.concatenate([jnp.full(1, -1.0), jnp.where(keep, cuts, 1.0), jnp.ones(1)]))
    even = jnp.where(bounds <= -1, kinds[0], jnp.where(bounds >= 1, kinds[1], 0.0))
    return bounds, even, 1 + jnp.sum(keep)


def _meetings_and_patches(
    pairs: Array, levels: int, samples: NDArray[np.float64], s: Array, value: Array
) -> list[Array]:
    """First and last x where the second of a pair vanishes on a curve s(x) along which the first does; and patches.

    Pairs have coefficients (order, order, 2, pairs), curves are given at samples (samples, pairs). The first `levels`
    pairs are a level and its ∂/∂s. A patch begins and ends about an extremum of a level, which may lie between two
    samples: along the curve where ∂/∂s vanishes the level is a parabola about it.
    """
    crossed = value[1:] * value[:-1] < 0
    low, high = jnp.asarray(samples[:-1, None]), jnp.asarray(samples[1:, None])
    fraction = value[:-1] / jnp.where(crossed, value[:-1] - value[1:], 1.0)
    guess = low + fraction * (high - low), s[:-1] + fraction * (s[1:] - s[:-1])
    is_first = crossed & (low == jnp.min(jnp.where(crossed, low, 2.0), axis=0))
    is_last = crossed & (low == jnp.max(jnp.where(crossed, low, -2.0), axis=0))

    def pick(each: Array) -> Array:
        some = (jnp.sum(jnp.where(which, each, 0.0), axis=0) for which in (is_first, is_last))
        return jnp.concatenate(list(some))

    size = jnp.where(jnp.isnan(value[:, :levels]), jnp.inf, jnp.abs(value[:, :levels]))
    least = size == jnp.min(size, axis=0)
    extremum = (jnp.max(jnp.where(least, each, -1.0), axis=0) for each in (samples[:, None], s[:, :levels]))
    slopes = jnp.stack([derivative(pairs[:, :, 0, :levels]), pairs[:, :, 1, :levels]], axis=2)
    start = [jnp.concatenate([pick(each), more]) for each, more in zip(guess, extremum, strict=True)]
    both = jnp.concatenate([pairs, pairs, slopes], axis=-1)
    x, y = _meet(both, *start)
    number = 2 * pairs.shape[-1]
    low, high, there = (pick(jnp.broadcast_to(each, crossed.shape)) for each in (low, high, 1.0))
    inside = (x[:number] >= low) & (x[:number] <= high)
    met = jnp.where(there > 0, jnp.where(inside, x[:number], start[0][:number]), 1.0)

    x, y = x[number:], y[number:]
    _, (xx, _), (xs, ss) = _with_slopes(slopes, x, y)
    tilt = xs / jnp.where(ss == 0, jnp.inf, ss)
    bend = xx - xs * tilt
    squared = -2 * evaluate(evaluate(pairs[:, :, 0, :levels], x), y) / jnp.where(bend == 0, jnp.inf, bend)
    inside = (squared > 0) & (jnp.abs(x) < 1) & (jnp.abs(y) < 1)
    width = jnp.sqrt(jnp.where(inside, squared, 1.0)) * np.array([[-1.0], [1.0]])
    end, _ = _meet(pairs[:, :, :, None, :levels], x + width, y - width * tilt)
    end = jnp.where(jnp.abs(end - x - width) < jnp.abs(width) / 2, end, x + width)
    return [met, jnp.where(inside & (jnp.abs(end) < 1), end, 1.0).ravel()]


def _meet(pair: Array, x: Array, s: Array) -> tuple[Array, Array]:
    """Where two levels (order, order, 2, ...) vanish, by Newton's method."""

    def improve(_: int, point: tuple[Array, Array]) -> tuple[Array, Array]:
        (a, b), (a_x, b_x), (a_s, b_s) = _with_slopes(pair, *point)
        determinant = a_s * b_x - a_x * b_s
        determinant = jnp.where(determinant == 0, jnp.inf, determinant)
        return point[0] - (a_s * b - b_s * a) / determinant, point[1] - (a * b_x - b * a_x) / determinant

    return jax.lax.fori_loop(0, NEWTON, improve, (x, s))


def _with_slopes(level: Array, x: Array, s: Array) -> tuple[Array, Array, Array]:
    """Value and derivatives along x and s."""
    line, change = with_slope(level, x)
    value, slope = with_slope(line, s)
    return value, evaluate(change, s), slope


def piece_nodes(powers: Powers, piece: Piece, kinks: Array, some: Array, *, lifted: bool) -> tuple[Array, Array, Array]:
    """Lines of the pieces x (n, lines), points on them (points, n, lines) and weights, whose sum over a cell is 4."""
    x, across = _outer_rule(piece)
    lines = [None if each is None else evaluate(each[..., None], x) for each in powers]
    levels = Powers(*compute_once(some, lambda: lines))
    inner, weight = line_nodes(levels, piece.half[:, None], kinks, some, lifted=lifted)
    return compute_once(some, lambda: (x, inner, weight * across))


def line_nodes(powers: Powers, half: Array, kinks: Array, some: Array, *, lifted: bool) -> tuple[Array, Array]:
    """Points (points, ...) and weights, of sum 2, on lines on which levels have coefficients (order, ...).

    Only `half` of a line, below (1) or above (2) where slip turns, or all of it (0). None where there are not `some`.
    """
    pressure, slip, axial = powers
    both = [each for each in (slip, pressure) if each is not None]
    (_, turn), (has_root, root) = split_line(jax.lax.stop_gradient(jnp.stack(both, axis=1)))
    low, high, centre, cuts = -jnp.ones(both[0].shape[1:]), jnp.ones(both[0].shape[1:]), None, []
    if slip is not None:
        low, high = jnp.where(half == 2, turn[0], low), jnp.where(half == 1, turn[0], high)
        centre = _slowest(slip, axial, has_root[:, 0], root[:, 0], low, high)
        cuts.append(centre)
        if kinks.size:
            speed = _squared_speed(slip, axial, kinks)
            for end in (low, high):
                there, cut = bracketed_root(speed, *(jnp.broadcast_to(each, speed.shape[1:]) for each in (centre, end)))
                cuts += list(jnp.where(there, cut, end))
    if pressure is not None:
        cuts += [jnp.clip(jnp.where(has_root[k, -1], root[k, -1], high), low, high) for k in range(2)]
    bounds = jnp.stack([low, *sort_network(cuts), high])
    start, stop = bounds[:-1], bounds[1:]
    keep = stop > start
    if pressure is not None and not lifted:
        keep &= evaluate(pressure, (start + stop) / 2) > 0
    keep, start, stop, centre = compute_once(some, lambda: (keep, start, stop, centre))
    if slip is None:
        point, weight = (each.reshape(-1, *[1] * start.ndim) for each in gauss_nodes(PLAIN_POINTS))
        near, far, fraction, weight = start, stop, (1 + point) / 2, weight / 2
    else:
        assert centre is not None
        below = stop <= centre
        near, far = jnp.where(below, stop, start), jnp.where(below, start, stop)
        distance = compute_once(some, lambda: _distance(slip, axial, near, far))
        fraction, weight = graded(distance, POINTS, NARROWEST, some)
    inner, weight = compute_once(
        some, lambda: (near + (far - near) * fraction, jnp.where(keep, (stop - start) * weight, 0.0))
    )
    shape = (-1, *inner.shape[2:])
    return inner.reshape(shape), weight.reshape(shape)


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
    """Where on each line between low and high the slip is slowest: its root moves with it."""
    first, last = evaluate(slip, low), evaluate(slip, high)
    inside = has_root & (root >= low) & (root <= high)
    chosen = jnp.where(inside[0], root[0], root[1])
    slope = jax.lax.stop_gradient(evaluate(derivative(slip), chosen))
    moved = chosen - evaluate(slip, chosen) / jnp.where(slope == 0, jnp.inf, slope)
    if axial is not None:
        lateral, change = (evaluate(each, chosen) for each in (axial, derivative(axial)))
        squared = slope * slope + change * change
        moved -= jax.lax.stop_gradient(lateral * change / jnp.where(squared > 0, squared, jnp.inf))
    nearest = jnp.where(jnp.abs(first) < jnp.abs(last), low, high)
    return jnp.where(inside[0] | inside[1], jnp.clip(moved, low, high), nearest)
