"""How large a disturbance must be to lead to a motion where steady sliding is stable: the smallest one that is enough.

A disturbance is a velocity from steady sliding along the shape of a mode, one way or the other. Each is tried in sizes
from below, twice as large each time. For each motion that is found the search then goes on between the largest that
leads elsewhere and the smallest that leads there, as long as a disturbance that takes less energy may lie there.
"""

import math
from collections.abc import Iterator, Sequence
from typing import cast

import numpy as np

from drumsqueal.dynamics.attractor import Disturbance, Response, SteadyResponse
from drumsqueal.dynamics.ensemble import Family, How, KickDirection, Start, directions, find_surely
from drumsqueal.findings.kinds import Criteria
from drumsqueal.progress import Progress, named
from drumsqueal.questions.onset.found import Row
from drumsqueal.solve.linear.branches import Point

SMALLER = 10  # halvings below the sizes tried at first, where it squeals already
PRECISION = 0.02  # of a velocity: how far the two may be apart in the end
_SAME_SIZE = 1e-9  # relative difference of two sizes that are one, but for round-off


def smallest_disturbances(
    family: Family, rows: Sequence[Row], how: How, progress: Progress
) -> Iterator[tuple[Row, ...]]:
    """Find the smallest disturbance that leads to each motion at each row: the rows with it, known better each time.

    What the disturbances lead to joins the starts of a row, and its motions. A motion that none of those tried leads to
    has none.
    """
    searches = [_Search(row, family) for row in rows]
    while True:
        tasks = [(search, *each) for search in searches for each in search.next()]
        if not tasks:
            return
        _run(family, tasks, how, progress)
        yield tuple(search.row for search in searches)


class _Search:
    """Disturbances along the modes of a row, either way, and where those tried led."""

    def __init__(self, row: Row, family: Family) -> None:
        self._row, self._directions = row, directions(row.point, family)
        self._led: list[dict[float, Response]] = [{} for _ in self._directions]
        for response in row.starts:
            for direction, led in zip(self._directions, self._led, strict=True):
                kick = response.kick
                if kick is not None and (kick.mode, kick.forwards) == (direction.mode.label, direction.forwards):
                    led[math.sqrt(kick.energy_J)] = response

    @property
    def point(self) -> Point:
        """The linear point."""
        return self._row.point

    @property
    def motions(self) -> Sequence[SteadyResponse]:
        """Those known there."""
        return self._row.motions

    @property
    def row(self) -> Row:
        """The row with all that is known."""
        found = [self._smallest(motion) for motion in self._row.motions]
        return self._row.model_copy(update={"smallest_kicks": tuple(each for each in found if each is not None)})

    def next(self) -> list[tuple[KickDirection, float]]:
        """What to try next: first the sizes of each direction, then what lies between."""
        tasks = []
        for direction, led in zip(self._directions, self._led, strict=True):
            sizes = set(direction.sizes) if not led or max(led) < (1 - _SAME_SIZE) * direction.sizes[-1] else set()
            tasks += [(direction, size) for size in sorted(sizes) if not _tried(led, size)]
        if tasks:
            return tasks
        for motion in self._row.motions:
            brackets = [_bracket(led, motion) for led in self._led]
            best = min((high for _, high in brackets), default=math.inf)
            for direction, led, (low, high) in zip(self._directions, self._led, brackets, strict=True):
                sizes = _between(low, high) if low < best else []
                fresh = [size for size in sizes if not _tried(led, size) and size >= direction.least / 2**SMALLER]
                tasks += [(direction, size) for size in fresh if (direction, size) not in tasks]
        return tasks

    def add(self, direction: KickDirection, size: float, response: Response) -> None:
        """Note where a disturbance led."""
        self._led[self._directions.index(direction)][size] = response
        self._row = self._row.model_copy(update={"starts": (*self._row.starts, response)})

    def _smallest(self, motion: SteadyResponse) -> Disturbance | None:
        """The smallest that leads to a motion, as far as it is known."""
        brackets = [_bracket(led, motion) for led in self._led]
        if not brackets or min(high for _, high in brackets) == math.inf:
            return None
        k = min(range(len(brackets)), key=lambda k: brackets[k][1])
        low, high = brackets[k]
        lower, upper = (self._directions[k].kick(size) for size in (low, high))
        halfway = dict(self._directions[k].kick((low + high) / 2))
        return Disturbance(
            **halfway,
            speed_uncertainty_m_per_s=(upper.speed_m_per_s - lower.speed_m_per_s) / 2,
            energy_uncertainty_J=(upper.energy_J - lower.energy_J) / 2,
            leads_to=cast("SteadyResponse", self._led[k][high].motion),
        )


def _tried(led: dict[float, Response], size: float) -> bool:
    return any(abs(other / size - 1) < _SAME_SIZE for other in led)


def _bracket(led: dict[float, Response], motion: SteadyResponse) -> tuple[float, float]:
    """The largest size below that leads elsewhere, zero without one, and the smallest that leads to a motion."""
    high = min((size for size, each in led.items() if each.motion and each.motion.same(motion)), default=math.inf)
    elsewhere = (size for size, each in led.items() if size < high and each.leads_to.clear)
    return max(elsewhere, default=0.0), high


def _between(low: float, high: float) -> list[float]:
    """Sizes to try between one that leads elsewhere and one that leads to the motion."""
    if high == math.inf or high <= (1 + PRECISION) * low:
        return []
    if low == 0:
        return (high / 2.0 ** np.arange(1, SMALLER + 1)).tolist()
    return np.geomspace(low, high, 5)[1:-1].tolist()


def _run(family: Family, tasks: Sequence[tuple[_Search, KickDirection, float]], how: How, progress: Progress) -> None:
    """Try sizes, and note where each leads.

    Near the smallest disturbance that leads to a motion the transient dwells on the unstable cycle: what is none of the
    motions known at the value must last longer.
    """
    meant = {}
    starts: list[tuple[Point, Start]] = []
    known: dict[float, Sequence[SteadyResponse]] = {}
    for search, direction, size in tasks:
        start = direction.start(size)
        meant[search.point.value, start.name] = search, direction, size
        starts.append((search.point, start))
        known[search.point.value] = search.motions

    def is_known(response: Response, _: SteadyResponse | None) -> bool:
        search, motion = meant[response.value, response.start][0], response.motion
        return any(motion is not None and motion.same(other) for other in search.motions)

    stages, progress = (Criteria.persistent, Criteria.lasting), named(progress, "smallest disturbance")
    for response, seconds in find_surely(family, starts, how, stages, is_known, known=known, progress=progress):
        search, direction, size = meant[response.value, response.start]
        search.add(direction, size, response.model_copy(update={"simulated_s": seconds}))
