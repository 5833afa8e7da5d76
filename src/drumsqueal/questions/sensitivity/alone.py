"""For each number alone: the change of it that makes the brake stable, and the one that makes it quiet."""

import itertools
import math
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from functools import partial
from operator import itemgetter
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from drumsqueal.findings.schema import Finding
from drumsqueal.progress import Progress
from drumsqueal.questions.sensitivity.disturbing import BrakeVariant, DisturbedSqueal, Disturber, Trial
from drumsqueal.questions.sensitivity.stabilising import Caution, Change, Problem, cautions

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

    The numbers of a brake are a function of its position, None where there is no brake, which counts as one that
    squeals; `ladder` has the positions to try, outwards, until one is quiet. Up to `squeals_at` none is, and `carried`
    is the squeal of the brake at position zero. What is quiet is tried from every disturbance unless it is not to be
    proven. `position` is to be tried next, None at the end of the search, and `confirms` whether as a proof.
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
        self.numbers_at, self._farthest, self._proven = numbers_at, farthest, proven
        self.squeals_at, self.quiet_at = squeals_at, None
        self.last, self._carried = tuple[Trial, ...](), tuple(carried)
        self._steps = self._search(iter(ladder))
        self.position: float | None
        self.position, self.confirms = next(self._steps, (None, False))

    def _search(self, ladder: Iterator[float]) -> Generator[tuple[float, bool], bool, None]:
        """What to try, and whether as a proof; to be sent whether it is quiet."""
        further = self.squeals_at
        while True:
            while self.quiet_at is None:
                if further <= self.squeals_at:
                    following = next((each for each in ladder if each > self.squeals_at), None)
                    if following is None:
                        return
                    further = following
                if (yield further, False):
                    self.quiet_at = further
                else:
                    self.squeals_at = further
            while self.quiet_at - self.squeals_at > PRECISION * self.quiet_at:
                middle = (self.squeals_at + self.quiet_at) / 2
                if (yield middle, False):
                    self.quiet_at = middle
                else:
                    self.squeals_at = middle
            if not self._proven or (yield self.quiet_at, True):
                return
            self.squeals_at, self.quiet_at = self.quiet_at, None

    @property
    def next_brakes(self) -> list[BrakeVariant]:
        """The brake at that position, with the squeal that may go on in it, and those further out where it is proven.

        None at all where there is no brake at that position.
        """
        assert self.position is not None
        carried = (*self.last, *(each for each in self._carried if not any(each is known for known in self.last)))
        further = [each * self.position for each in FURTHER if each * self.position <= self._farthest]
        numbers = [self.numbers_at(each) for each in (self.position, *(further if self.confirms else ()))]
        if numbers[0] is None:
            return []
        return [BrakeVariant(each, carried) for each in numbers if each is not None]

    def take(self, judged: Sequence[DisturbedSqueal]) -> None:
        """Note what became of the brakes that were tried."""
        quiet = bool(judged) and all(each.quiet for each in judged)
        if not quiet:
            self.last = next((each.squealing for each in judged if each.squealing), self.last)
        try:
            self.position, self.confirms = self._steps.send(quiet)
        except StopIteration:
            self.position, self.confirms = None, False


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
FOUND = 1e-6  # of a change: how well the one that makes the brake stable is found


def ladder_to(farthest: float, first: float, step: float, number: int) -> list[float]:
    """Sizes from a first one on, each by a factor over the last, up to the farthest."""
    steps = first * step ** np.arange(number)
    return [*steps[steps < farthest * (1 - PRECISION)].tolist(), farthest] if farthest > 0 else []


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


class _Way(NamedTuple):
    """One number that changes one way: from which size of its change on the brake is stable, and the search beyond."""

    number: int
    stable_at: float
    line: LineSearch


def each_alone(
    problem: Problem, margin: float, disturber: Disturber | None, carried: Sequence[Trial], progress: Progress
) -> tuple[Alone, ...]:
    """Find the changes of each number alone, the smallest first; `carried` is the squeal of the brake as it is.

    Of a stable brake a number changes the way in which its least stable mode decays faster. Without a disturber no
    change is looked for that makes the brake quiet.
    """
    size = len(problem.keys)
    now = problem.largest(np.zeros(size))
    stable_now = now <= -margin
    ways: list[_Way] = []
    for k, (number, sign) in enumerate(itertools.product(range(size), (-1, 1))):
        progress("each number alone", k, 2 * size)
        direction = sign * np.eye(size)[number]
        farthest = problem.farthest(direction)
        ladder = ladder_to(farthest, FIRST, STEP, MOST_STEPS)
        if stable_now:
            # A change by 1e-3 shows which way a mode decays faster.
            found = 0.0 if ladder and problem.largest(1e-3 * direction) < now else None
        else:
            found = _stable_from(problem, direction, ladder, margin)
        if found is not None:
            further = [x for x in ladder if x > found * (1 + PRECISION)]
            line = LineSearch(
                partial(problem.along, direction),
                further if stable_now else [found, *further],
                found * (1 - PRECISION),
                carried,
                farthest=farthest,
            )
            ways.append(_Way(number, found, line))
    if disturber is not None:
        _search(ways, disturber, progress)
    rows = [_row(problem, k, [way for way in ways if way.number == k], stable_now=stable_now) for k in range(size)]
    return tuple(sorted(rows, key=lambda row: row.rank))


def _stable_from(
    problem: Problem, direction: NDArray[np.float64], ladder: Sequence[float], margin: float
) -> float | None:
    """The first size found of a change at which every growth rate is −`margin` or below."""

    def excess(size: float) -> float:
        return problem.largest(size * direction) + margin

    for before, size in itertools.pairwise([0.0, *ladder]):
        if excess(size) <= 0:
            return float(scipy.optimize.brentq(excess, before, size, rtol=FOUND, xtol=FOUND * FIRST))
    return None


def _search(ways: Sequence[_Way], disturber: Disturber, progress: Progress) -> None:
    numbers = {way.line: way.number for way in ways}

    def given_up(line: LineSearch) -> bool:
        """Whether the other way is quiet already at a smaller change."""
        others = [other for other in numbers if numbers[other] == numbers[line] and other is not line]
        return any(other.quiet_at is not None and other.quiet_at <= line.squeals_at for other in others)

    search(list(numbers), disturber, progress, "each number alone", given_up=given_up)


def _row(problem: Problem, number: int, ways: Sequence[_Way], *, stable_now: bool) -> Alone:
    key, before = problem.keys[number], float(problem.before[number])

    def least(sizes: Iterable[tuple[float | None, LineSearch]]) -> Change | None:
        found = min(((size, line) for size, line in sizes if size is not None), key=itemgetter(0), default=None)
        after = None if found is None else found[1].numbers_at(found[0])
        return None if after is None else Change.of(problem.written, key, before, after[key])

    lowest, highest = problem.limits[key]
    row = Alone(
        key=key,
        lowest=lowest,
        highest=highest,
        stable=None if stable_now else least((way.stable_at, way.line) for way in ways),
        quiet=least((way.line.quiet_at, way.line) for way in ways),
    )
    changed = {} if row.change is None else {key: row.change.after}
    return row.model_copy(update={"cautions": cautions(problem.written.scene, changed)})
