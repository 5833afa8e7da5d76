"""From a change of a brake that makes it quiet to a smaller one: each part less, or one at the cost of the others."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from drumsqueal.progress import Progress
from drumsqueal.questions.sensitivity.disturbing import BrakeVariant, Disturber, Trial
from drumsqueal.questions.sensitivity.lines import PRECISION, Numbers

LESS = (0.0, 0.5)  # times one part, the others as they are
# Of the whole change: what one part gains or loses, the others in proportion, and what then remains of its size. The
# large steps first, and small ones where no large one is quiet.
STEPS = ((0.5, 0.85), (0.25, 1 - PRECISION))
AT_ONCE = 4  # that are tried, the smallest first, until one is quiet
MOST_ROUNDS = 12

Vector = NDArray[np.float64]


def shrink(
    whole: Vector,
    ways: Vector,
    numbers_at: Callable[[Vector], Numbers],
    carried: Sequence[Trial],
    disturber: Disturber,
    progress: Progress,
    but: Sequence[Numbers] = (),
) -> Vector:
    """The smallest change (k,) found from a `whole` one, by steps to smaller ones that stay quiet.

    `ways` (k,) has ±1 where a number may come in that way, 0 where it may not. From each change those next to it are
    tried that are smaller by at least `PRECISION`, each until it squeals, from the disturbances that are likeliest to
    make it; the smallest that is quiet is the next, `but` for brakes that are known not to be. The search stops where
    none of those next to it is quiet, or after `MOST_ROUNDS` rounds: then a smaller one next to it may be quiet, too.
    """
    found, steps = whole, iter(STEPS)
    step = next(steps)
    for done in range(MOST_ROUNDS):
        progress("smaller changes", done, MOST_ROUNDS)
        candidates = [each for each in sorted(_next_to(found, ways, *step), key=_size) if numbers_at(each) not in but]
        smaller = _first_quiet(
            candidates, [BrakeVariant(numbers_at(each), tuple(carried)) for each in candidates], disturber
        )
        if smaller is not None:
            found = smaller
            continue
        step = next(steps, None)
        if step is None:
            break
    return found


def _first_quiet(candidates: Sequence[Vector], brakes: Sequence[BrakeVariant], disturber: Disturber) -> Vector | None:
    for first in range(0, len(candidates), AT_ONCE):
        some = brakes[first : first + AT_ONCE]
        judged = disturber.judge(some, "smaller changes", [False] * len(some))
        for each, one in zip(candidates[first:], judged, strict=False):
            if one.quiet:
                return each
    return None


def _next_to(whole: Vector, ways: Vector, turn: float, shorter: float) -> list[Vector]:
    """Changes that are smaller by at least `PRECISION`."""
    size, units = _size(whole), np.eye(whole.size)
    found = [whole - (1 - less) * whole * unit for unit in units for less in LESS]
    for unit, way in zip(units, ways, strict=True):
        for step in (turn, -turn):
            turned = whole + step * way * size * unit
            turned = np.where(turned * ways < 0, 0.0, turned)  # no part the other way
            if turned.any():
                found.append(shorter * size / _size(turned) * turned)
    unlike: list[Vector] = []
    for each in found:
        smaller = 0 < _size(each) <= size * (1 - PRECISION / 2)
        if smaller and not any(np.allclose(each, other) for other in unlike):
            unlike.append(each)
    return unlike


def _size(change: Vector) -> float:
    return float(np.linalg.norm(change))
