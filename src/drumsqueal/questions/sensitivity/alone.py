"""For each number alone: the change of it that makes the brake stable, and the one that makes it quiet."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
import scipy

from drumsqueal.findings.part import Finding
from drumsqueal.progress import Progress
from drumsqueal.questions.sensitivity.change import Caution, Change, cautions, in_SI, rounded
from drumsqueal.questions.sensitivity.disturbing import BrakeVariant, Disturber, Judged, Trial
from drumsqueal.questions.sensitivity.stabilising import Problem
from drumsqueal.scene import Scene
from drumsqueal.scene.written import Written

# Brakes that change more and more along a line: from where on they are quiet, by transients from disturbances.
#
# All lines are searched together. On each, positions are tried further and further out until one is quiet; then the gap
# between it and the last that squeals is halved. What squeals at a position goes on, as a disturbance, at the next
# ones. Quiet in between two that squeal is no answer: a brake must also stay quiet a little further out.


PRECISION = 0.04  # of a position: how far the first quiet one and the last that squeals may be apart

FURTHER = (1.1, 1.25)  # times a position: brakes that must be quiet, too, as far as the bounds allow

Numbers = Mapping[str, float]


class LineSearch:
    """Positions tried along a line, and what is known of them.

    The numbers of a brake are a function of its position, None where there is no brake; `ladder` has the positions to
    try, outwards, until one is quiet. Up to `squeals_at` none is, and `carried` is the squeal of the brake at position
    zero. What is quiet is tried from every disturbance unless it is not to be proven.
    """

    def __init__(
        self,
        numbers_at: Callable[[float], Numbers | None],
        ladder: Iterable[float],
        squeals_at: float,
        carried: Sequence[Trial] = (),
        *,
        farthest: float = math.inf,
        proven: bool = True,
    ) -> None:
        """Begin with nothing tried; `farthest` is the last position within the bounds."""
        self._farthest = farthest
        self.numbers_at, self._ladder = numbers_at, iter(ladder)
        self.squeals_at, self.quiet_at = squeals_at, None
        self._carried, self._last, self._confirmed, self._proven = tuple(carried), (), False, proven
        self._further = self._next_further()

    def _next_further(self) -> float | None:
        return next((each for each in self._ladder if each > self.squeals_at), None)

    @property
    def position(self) -> float | None:
        """What is to be tried next; None where the search is at its end."""
        if self.quiet_at is None:
            return self._further
        if self.quiet_at - self.squeals_at > PRECISION * self.quiet_at:
            return (self.squeals_at + self.quiet_at) / 2
        return None if self._confirmed or not self._proven else self.quiet_at

    @property
    def confirms(self) -> bool:
        """Whether what is tried next has been quiet already and is to be tried from every disturbance."""
        return self.quiet_at is not None and self.position == self.quiet_at

    @property
    def next_brakes(self) -> list[BrakeVariant]:
        """The brake at that position, with the squeal that may go on in it, and those further out where it is quiet.

        None at all where there is no brake at that position, which then counts as one that squeals.
        """
        assert self.position is not None
        carried = (*self._last, *(each for each in self._carried if not any(each is known for known in self._last)))
        further = [each * self.position for each in FURTHER if each * self.position <= self._farthest]
        positions = [self.position, *(further if self.confirms else ())]
        numbers = [self.numbers_at(each) for each in positions]
        if numbers[0] is None:
            return []
        return [BrakeVariant(each, carried) for each in numbers if each is not None]

    def take(self, judged: Sequence[Judged]) -> None:
        """Note what became of the brakes that were tried."""
        position, confirmed = self.position, self.confirms
        assert position is not None
        if judged and all(each.quiet for each in judged):
            self.quiet_at, self._confirmed = position, confirmed
            return
        self.squeals_at, self._confirmed = position, False
        self._last = next((each.squealing for each in judged if each.squealing), self._last)
        if confirmed:
            self.quiet_at = None
        if self.quiet_at is None and self._further is not None and self._further <= position:
            self._further = self._next_further()


def search(
    lines: Sequence[LineSearch],
    disturber: Disturber,
    progress: Progress,
    what: str,
    *,
    given_up: Callable[[LineSearch], bool] = lambda _: False,
) -> None:
    """Find on each line from where on its brakes are quiet, unless it is to be given up."""
    while True:
        going = [line for line in lines if line.position is not None and not given_up(line)]
        progress(what, len(lines) - len(going), len(lines))
        if not going:
            return
        tried = [(line, brake, line.confirms and not k) for line in going for k, brake in enumerate(line.next_brakes)]
        found = disturber.judge([brake for _, brake, _ in tried], what, [thorough for *_, thorough in tried])
        for line in going:
            line.take([judged for (other, *_), judged in zip(tried, found, strict=True) if other is line])


# Size of the change tried first, and of the next over it: from 10 % to a factor of ten in six steps. What is quiet
# between two of them alone goes unseen.
FIRST, STEP, MOST_STEPS = 0.1, 2.0, 8
SMALL = 1e-3  # change that shows which way a mode decays faster
FOUND = 1e-6  # of a change: how well the one that makes the brake stable is found


class Alone(Finding):
    """One number, and its smallest change that makes the brake stable, and quiet; None where none within bounds does.

    Stable: every growth rate is minus the margin or below. Quiet: every mode decays, and no disturbance that was tried
    squeals. `lowest` and `highest` (SI) are the bounds, and `cautions` what else is to be said of the brake with its
    change. A brake that is stable as it is has no change that makes it so.
    """

    key: str
    lowest: float
    highest: float
    stable: Change | None = None
    quiet: Change | None = None
    cautions: tuple[Caution, ...] = ()

    @property
    def change(self) -> Change | None:
        """That to be quiet or, where there is none, to be stable."""
        return self.quiet or self.stable

    @property
    def rank(self) -> tuple[float, float]:
        """How far it has to change to be quiet, and to be stable, by which numbers are sorted."""
        sizes = [np.inf if change is None else abs(change.logarithm) for change in (self.quiet, self.stable)]
        return sizes[0], sizes[1]


class _Way:
    """One number that changes one way, by the size of its change."""

    def __init__(self, problem: Problem, written: Written, number: int, sign: int) -> None:
        self._problem, self._written, self._number, self.sign = problem, written, number, sign
        self.key = problem.keys[number]
        self._before = float(problem.before[number])
        self.farthest = float(problem.high[number] if sign > 0 else -problem.low[number])
        self.ladder = self._ladder()
        self.line: LineSearch | None = None

    def _ladder(self) -> list[float]:
        if self.farthest <= 0:
            return []
        steps = FIRST * STEP ** np.arange(MOST_STEPS)
        return [*steps[steps < self.farthest * (1 - PRECISION)].tolist(), self.farthest]

    def growth(self, position: float) -> float:
        """The largest growth rate (1/s)."""
        return self._problem.largest(self._unit * position)

    @property
    def _unit(self) -> np.ndarray:
        return self.sign * np.eye(len(self._problem.keys))[self._number]

    def stable_from(self, margin: float) -> float | None:
        """The first position found at which every growth rate is −`margin` or below."""
        before = 0.0
        for position in self.ladder:
            if self.growth(position) <= -margin:
                return float(
                    scipy.optimize.brentq(
                        lambda x: self.growth(x) + margin, before, position, rtol=FOUND, xtol=FOUND * FIRST
                    )
                )
            before = position
        return None

    def helps(self) -> float | None:
        """Zero where the least stable mode decays faster already with a small change, else None."""
        return 0.0 if self.ladder and self.growth(SMALL) < self.growth(0.0) else None

    def numbers_at(self, position: float) -> dict[str, float]:
        """The number as the scene file will have it, in SI."""
        return in_SI(self._written, self._rounded(position))

    def _rounded(self, position: float) -> dict[str, float | str]:
        after = float(self._problem.after(self._unit * position)[self._number])
        return rounded(self._written, {self.key: after}, {self.key: self._before}, self._problem.limits)

    def change(self, position: float) -> Change:
        """What it is at a position."""
        return Change.of(self._written, self.key, self._before, self.numbers_at(position)[self.key])


def each_alone(
    problem: Problem,
    written: Written,
    margin: float,
    disturber: Disturber | None,
    carried: Sequence[Trial],
    progress: Progress,
) -> tuple[Alone, ...]:
    """Find the changes of each number alone, the smallest first; `carried` is the squeal of the brake as it is.

    Of a stable brake a number changes the way in which its least stable mode decays faster. Without a disturber no
    change is looked for that makes the brake quiet.
    """
    stable_now = problem.largest(np.zeros(len(problem.keys))) <= -margin
    ways = [_Way(problem, written, k, sign) for k in range(len(problem.keys)) for sign in (-1, 1)]
    stable: dict[_Way, float] = {}
    for k, way in enumerate(ways):
        progress("each number alone", k, len(ways))
        found = way.helps() if stable_now else way.stable_from(margin)
        if found is not None:
            stable[way] = found
            ladder = [x for x in way.ladder if x > found * (1 + PRECISION)]
            first = [] if stable_now else [found]
            way.line = LineSearch(
                way.numbers_at, [*first, *ladder], found * (1 - PRECISION), carried, farthest=way.farthest
            )
    if disturber is not None:
        _search(list(stable), disturber, progress)
    rows = [_row(problem, written.scene, number, stable, stable_now) for number in range(len(problem.keys))]
    return tuple(sorted(rows, key=lambda row: row.rank))


def _search(ways: Sequence[_Way], disturber: Disturber, progress: Progress) -> None:
    lines = {way.line: way for way in ways if way.line is not None}

    def given_up(line: LineSearch) -> bool:
        """Whether the other way is quiet already at a smaller change."""
        others = [other for other, way in lines.items() if way.key == lines[line].key and other is not line]
        return any(other.quiet_at is not None and other.quiet_at <= line.squeals_at for other in others)

    search(list(lines), disturber, progress, "each number alone", given_up=given_up)


def _row(problem: Problem, scene: Scene, number: int, stable: dict[_Way, float], stable_now: bool) -> Alone:
    ways = {way: position for way, position in stable.items() if way.key == problem.keys[number]}
    quiet = {way: way.line.quiet_at for way in ways if way.line is not None and way.line.quiet_at is not None}
    nearest, quietest = (min(each, key=lambda way: each[way], default=None) for each in (ways, quiet))
    limits = problem.limits[problem.keys[number]]
    row = Alone(
        key=problem.keys[number],
        lowest=limits[0],
        highest=limits[1],
        stable=None if stable_now or nearest is None else nearest.change(ways[nearest]),
        quiet=None if quietest is None else quietest.change(quiet[quietest]),
    )
    changed = {} if row.change is None else {row.key: row.change.after}
    return row.model_copy(update={"cautions": cautions(scene, changed)})
