"""The smallest change of a brake that makes it quiet: stable, and without squeal after every disturbance tried."""

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from pydantic import Field, computed_field

from drumsqueal.dynamics.attractor import SteadyResponse
from drumsqueal.findings.schema import Finding, SceneInFile
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.sensitivity.disturbing import BrakeVariant, Decay, DisturbedSqueal, Disturber, Trial
from drumsqueal.questions.sensitivity.stabilising import (
    MARGIN,
    SLACK,
    Caution,
    Change,
    Problem,
    cautions,
    numbers_of,
    variable_numbers,
)
from drumsqueal.scene import Scene
from drumsqueal.scene.variation import Written
from drumsqueal.simulation import prepare
from drumsqueal.solve.linear.family import StateMatrix, state_matrix_of

# Brakes that change more and more along a line: from where on they are quiet, by transients from disturbances.
#
# All lines are searched together. On each, positions are tried further and further out until one is quiet; then the gap
# between it and the last that squeals is halved. What squeals at a position goes on, as a disturbance, at the next
# ones. Quiet in between two that squeal is no answer: a brake must also stay quiet a little further out.


PRECISION = 0.04  # of a position: how far the first quiet one and the last that squeals may be apart

FURTHER = (1.1, 1.25)  # times a position: brakes that must be quiet, too, as far as the bounds allow

Numbers = Mapping[str, float]
_Vector = NDArray[np.float64]


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
        self.last, self._carried = tuple[Trial, ...](), carried
        self._ladder, self._further = iter(ladder), -math.inf
        self._go_on()

    def _go_on(self) -> None:
        """Choose what is tried next."""
        self.position: float | None = None
        self.confirms = False
        if self.quiet_at is None:
            while self._further is not None and self._further <= self.squeals_at:
                self._further = next(self._ladder, None)
            self.position = self._further
        elif self.quiet_at - self.squeals_at > PRECISION * self.quiet_at:
            self.position = (self.squeals_at + self.quiet_at) / 2
        elif self._proven:
            self.position, self.confirms = self.quiet_at, True

    @property
    def next_brakes(self) -> list[BrakeVariant]:
        """The brake at that position, with the squeal that may go on in it, and those further out where it is proven.

        None at all where there is no brake at that position.
        """
        assert self.position is not None
        carried = (*self.last, *(each for each in self._carried if not any(each is known for known in self.last)))
        further = [each * self.position for each in FURTHER if each * self.position <= self._farthest]
        first, *others = (self.numbers_at(each) for each in (self.position, *(further if self.confirms else ())))
        if first is None:
            return []
        brakes = [BrakeVariant(first, carried, thorough=self.confirms)]
        return brakes + [BrakeVariant(each, carried, thorough=False) for each in others if each is not None]

    def take(self, judged: Sequence[DisturbedSqueal]) -> None:
        """Note what became of the brakes that were tried."""
        assert self.position is not None
        if not judged or not all(each.quiet for each in judged):
            self.last = next((each.squealing for each in judged if each.squealing), self.last)
            self.squeals_at, self.quiet_at = self.position, None if self.confirms else self.quiet_at
        elif self.confirms:
            self.position = None
            return
        else:
            self.quiet_at = self.position
        self._go_on()


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
        tried = [line.next_brakes for line in going]
        judged = iter(disturber.judge(list(itertools.chain(*tried)), what))
        for line, brakes in zip(going, tried, strict=True):
            line.take(list(itertools.islice(judged, len(brakes))))


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


def _stable_from(problem: Problem, direction: _Vector, ladder: Sequence[float], margin: float) -> float | None:
    """The first size found of a change at which every growth rate is −`margin` or below."""

    def excess(size: float) -> float:
        return problem.largest(size * direction) + margin

    for before, size in itertools.pairwise([0.0, *ladder]):
        if excess(size) <= 0:
            # To 1e-6 of a change
            return float(scipy.optimize.brentq(excess, before, size, rtol=1e-6, xtol=1e-7))
    return None


class Quieting(Finding):
    """The smallest change found: the changed scene, its changes, their norms, and its largest growth rate anywhere.

    The smallest is the one with the least norm of logarithms, √Σ ln²(after/before) (`size_of`).

    `found` states whether every mode decays, and `quiet` whether no disturbance squeals either (None: not looked for).
    Where no change within the bounds does both, the change is the smallest that makes every mode decay or, where none
    does, the one with the least growth. `disturbances` are those of the changed scene, until one squealed;
    `transients` is the one that its scene file starts.
    """

    found: bool
    quiet: bool | None = None
    changes: tuple[Change, ...]
    norm_of_relative_changes: float
    largest_growth_rate_1_per_s: float
    cautions: tuple[Caution, ...] = ()
    disturbances: tuple[Trial, ...] = ()
    transients: tuple[Decay, ...] = ()
    scene: SceneInFile
    scene_file: str = Field(default="", exclude=True)

    @computed_field
    @property
    def norm_of_logarithms(self) -> float:
        """√Σ ln²(after/before), of which the search finds a least one."""
        return math.hypot(*(each.logarithm for each in self.changes))

    @property
    def succeeded(self) -> bool:
        """Whether the changed brake is as quiet as was looked for."""
        return self.found and self.quiet is not False

    @property
    def motions(self) -> tuple[SteadyResponse, ...]:
        """What still squeals."""
        return tuple(each.motion for each in self.disturbances if each.motion is not None)


def quieten(
    scene: Scene,
    keys: Sequence[str] | None = None,
    *,
    margin: float = MARGIN,
    points: Sequence[Mapping[str, float]] = ({},),
    state_matrix: StateMatrix | None = None,
    progress: Progress = silent,
) -> Quieting:
    """Find the smallest norm √Σ ln²(after/before) that makes a brake quiet: `quieten(scene, ["damping.ratio"]).scene`.

    Quiet: every mode decays, and no disturbance that is tried leads to squeal; where nothing can squeal, every real
    part is −`margin` (1/s) or below. `keys` may change (None: the design). Quiet it is to be at each of the operating
    `points`, numbers (SI) by key in place of the scene's. Profiles must have been turned into one value before.
    `state_matrix` is that of the scene's numbers where it is compiled already. Raises RequestError for keys that cannot
    change.
    """
    search = Quietening(scene, keys, margin=margin, points=points, state_matrix=state_matrix, progress=progress)
    squeal = search.squeal()
    if squeal is None or squeal.quiet:
        return search.together((), (), quiet=True)
    return search.together(search.alone(squeal.squealing), squeal.squealing, quiet=False)


class Quietening:
    """The steps of the search: what squeals, what each number alone does, and what all of them together."""

    step, most_steps = 1.6, 16  # from one size of the whole change that is tried to the next

    def __init__(
        self,
        scene: Scene,
        keys: Sequence[str] | None = None,
        *,
        margin: float = MARGIN,
        points: Sequence[Mapping[str, float]] = ({},),
        tables: Mapping[str, Any] | None = None,
        state_matrix: StateMatrix | None = None,
        progress: Progress = silent,
    ) -> None:
        """Take a scene without profiles, what may change, where it is to be quiet, and its file's tables (None: SI)."""
        own = scene
        scene, keys = variable_numbers(scene, keys, {key for point in points for key in point})
        if state_matrix is None or scene is not own:
            state_matrix = state_matrix_of(scene, tuple(numbers_of(scene)))
        self._solved: dict[float, Numbers | None] = {}
        self._margin, self._progress = margin, progress
        self._problem = Problem(Written(scene, tables), keys, state_matrix, progress, tuple(points))
        self._growth = self._problem.largest(np.zeros(len(keys)))
        squeals = scene.rubs and scene.pressed
        self._disturber = Disturber(scene, progress, tuple(points)) if squeals else None

    def squeal(self) -> DisturbedSqueal | None:
        """What becomes of the brake as it is when it is disturbed; None where nothing can squeal."""
        if self._disturber is None:
            return None
        return self._disturber.judge([BrakeVariant({})], "disturbances", until_squeal=False)[0]

    def alone(self, carried: Sequence[Trial]) -> tuple[Alone, ...]:
        """The changes of each number alone, the smallest first; `carried` is the squeal of the brake as it is.

        Of a stable brake a number changes the way in which its least stable mode decays faster. Where nothing can
        squeal no change is looked for that makes the brake quiet.
        """
        problem, size, stable_now = self._problem, len(self._problem.keys), self._growth <= -self._margin
        lines: list[list[LineSearch]] = [[] for _ in problem.keys]  # of each number, down and up
        stable_at: dict[LineSearch, float] = {}  # size of the change from which on the brake is stable
        for k, (number, sign) in enumerate(itertools.product(range(size), (-1, 1))):
            self._progress("each number alone", k, 2 * size)
            direction = sign * np.eye(size)[number]
            # From 10 % to a factor of ten in six steps. What is quiet between two of them alone goes unseen.
            ladder = ladder_to(problem.farthest(direction), 0.1, 2.0, 8)
            if stable_now:
                # A change by 1e-3 shows which way a mode decays faster.
                found = 0.0 if ladder and problem.largest(1e-3 * direction) < self._growth else None
            else:
                found = _stable_from(problem, direction, ladder, self._margin)
            if found is not None:
                further = [x for x in ladder if x > found * (1 + PRECISION)]
                ladder = further if stable_now else [found, *further]
                line = self._along(direction, ladder, found * (1 - PRECISION), carried)
                lines[number].append(line)
                stable_at[line] = found
        if self._disturber is not None:
            others = {line: [each for each in both if each is not line] for both in lines for line in both}

            def given_up(line: LineSearch) -> bool:
                """Whether the other way is quiet already at a smaller change."""
                return any(each.quiet_at is not None and each.quiet_at <= line.squeals_at for each in others[line])

            search(list(others), self._disturber, self._progress, "each number alone", given_up=given_up)
        rows = [self._row(number, both, {} if stable_now else stable_at) for number, both in enumerate(lines)]
        return tuple(sorted(rows, key=lambda row: row.rank))

    def _row(self, number: int, lines: Sequence[LineSearch], stable_at: Mapping[LineSearch, float]) -> Alone:
        written, key, before = self._problem.written, self._problem.keys[number], float(self._problem.before[number])

        def least(sizes: Mapping[LineSearch, float | None]) -> Change | None:
            found = {line: size for line, size in sizes.items() if size is not None}
            line = min(found, key=found.__getitem__, default=None)
            after = None if line is None else line.numbers_at(found[line])
            return None if after is None else Change.of(written, key, before, after[key])

        stable = least({line: stable_at.get(line) for line in lines})
        quiet = least({line: line.quiet_at for line in lines})
        change, (lowest, highest) = quiet or stable, self._problem.limits[key]
        said = cautions(written.scene, {} if change is None else {key: change.after})
        return Alone(key=key, lowest=lowest, highest=highest, stable=stable, quiet=quiet, cautions=said)

    def together(self, alone: Sequence[Alone], carried: Sequence[Trial], *, quiet: bool) -> Quieting:
        """The smallest change of all numbers that was found; `quiet` states whether the brake as it is squeals never.

        It begins on the way to the border of quiet, as flat as that is through the changes of each number alone, or
        with the smallest of these; where no number alone is enough, with the smallest that make every mode decay faster
        and faster. From there `_shrink` goes to smaller ones. What is found is tried from every disturbance, and is
        enlarged until it stands that.
        """
        stable = self._stable_values(self._margin)
        if self._disturber is None or (quiet and self._growth <= -self._margin):
            return self._quieting(stable or {}, None)
        quiets = {each.key: each.quiet for each in alone if each.quiet is not None}
        singles = [{key: change.after} for key, change in quiets.items()]
        found = min(singles, key=self._norm, default=None)
        most = self._norm(found) if found else math.inf
        sizes = {key: change.logarithm for key, change in quiets.items()}
        begin = self._towards(sizes, carried, most) if found else self._by_margin(carried)
        search([begin], self._disturber, self._progress, "all numbers")
        first = found if begin.quiet_at is None else begin.numbers_at(begin.quiet_at)
        if first is not None:
            singles += self._smaller(self._problem.sizes_of(first), sizes, carried, most)
        for numbers in sorted(singles, key=self._norm):
            (judged,) = self._disturber.judge([BrakeVariant(numbers, carried)], "proof")
            if judged.quiet:
                return self._quieting(numbers, judged)
        if stable is None:
            return self._quieting(self._problem.exact(self._problem.smallest_change(self._margin)), None)
        (judged,) = self._disturber.judge([BrakeVariant(stable, carried)], "proof")
        return self._quieting(stable, judged)

    def _smaller(
        self, whole: _Vector, singles: Mapping[str, float], carried: Sequence[Trial], most: float
    ) -> list[Numbers]:
        """Made smaller from a whole change (k,), and up to a size of `most` again until it stands a proof; none: never.

        What squeals in that after all is a disturbance of those that are tried next.
        """
        assert self._disturber is not None
        problem, failed = self._problem, list[Numbers]()
        ways = np.sign([singles.get(key, part) for key, part in zip(problem.keys, whole.tolist(), strict=True)])
        # Three proofs of changes made smaller, each time with what squealed in the last one
        for _ in range(3):
            whole = self._shrink(whole, ways, carried, failed)
            farthest = min(problem.farthest(whole), most / _size(whole))
            # Times a change that some disturbance has shown to squeal
            ladder = [each for each in (1.0, 1.1, 1.25, 1.6, 2.5, 4.0, 6.3) if each < farthest]
            line = self._along(whole, ladder, 1 - PRECISION / 2, carried)
            search([line], self._disturber, self._progress, "proof")
            if line.quiet_at is None:
                return []
            if line.quiet_at == 1:
                break
            failed.append(problem.in_file(whole))
            carried, whole = (*line.last, *carried), line.quiet_at * whole
        return [problem.in_file(whole)]

    def _shrink(self, whole: _Vector, ways: _Vector, carried: Sequence[Trial], failed: Sequence[Numbers]) -> _Vector:
        """The smallest change (k,) found from a `whole` one, by steps to smaller ones that stay quiet.

        `ways` (k,) has ±1 where a number may come in that way, 0 where it may not. From each change those next to it
        are tried that are smaller by at least `PRECISION`, each until it squeals, from the disturbances that are
        likeliest to make it; the smallest that is quiet is the next, but for those that have `failed` a proof. The
        search stops where none of those next to it is quiet, or after twelve rounds: then a smaller one next to it may
        be quiet, too.
        """
        # Of the whole change: what one part gains or loses, the others in proportion, and what then remains of its
        # size. The large steps first, and small ones where no large one is quiet.
        found, steps = whole, [(0.5, 0.85), (0.25, 1 - PRECISION)]
        for done in range(12):
            self._progress("smaller changes", done, 12)
            candidates = sorted(_next_to(found, ways, *steps[0]), key=_size)
            candidates = [each for each in candidates if self._problem.in_file(each) not in failed]
            smaller = self._first_quiet(candidates, carried)
            if smaller is not None:
                found = smaller
                continue
            del steps[0]
            if not steps:
                break
        return found

    def _first_quiet(self, candidates: Sequence[_Vector], carried: Sequence[Trial]) -> _Vector | None:
        assert self._disturber is not None
        for first in range(0, len(candidates), 4):  # tried at once, until one is quiet
            some = candidates[first : first + 4]
            brakes = [BrakeVariant(self._problem.in_file(each), carried, thorough=False) for each in some]
            judged = self._disturber.judge(brakes, "smaller changes")
            quiet = [each for each, one in zip(some, judged, strict=True) if one.quiet]
            if quiet:
                return quiet[0]
        return None

    def _along(
        self,
        direction: _Vector,
        ladder: Iterable[float],
        squeals_at: float,
        carried: Sequence[Trial],
        *,
        proven: bool = True,
    ) -> LineSearch:
        """Brakes along a direction (k,), up to the bounds."""
        problem = self._problem
        return LineSearch(
            lambda size: problem.in_file(size * direction),
            ladder,
            squeals_at,
            carried,
            farthest=problem.farthest(direction),
            proven=proven,
        )

    def _by_margin(self, carried: Sequence[Trial]) -> LineSearch:
        """Brakes whose every mode decays faster and faster, with the least change each."""
        first = max(self._margin, -self._growth)
        stable = self._growth <= -self._margin
        margins = (first * self.step ** np.arange(int(stable), self.most_steps)).tolist()
        ladder = itertools.takewhile(lambda margin: self._stable_values(margin) is not None, margins)
        return LineSearch(self._stable_values, ladder, first * (1 - PRECISION), carried, proven=False)

    def _towards(self, singles: Mapping[str, float], carried: Sequence[Trial], most: float) -> LineSearch:
        """Brakes on the way to the plane through what each number alone would have to be changed by."""
        inverse = np.array([1 / singles[key] if key in singles else 0.0 for key in self._problem.keys])
        direction = _without_small(inverse / (inverse @ inverse))
        farthest = min(self._problem.farthest(direction), most / _size(direction))
        # 0.4 of the change that would do if the border of quiet were flat: where the search along it begins
        ladder = ladder_to(farthest, 0.4, self.step, self.most_steps)
        return self._along(direction, ladder, 0.0, carried, proven=False)

    def _stable_values(self, margin: float) -> Numbers | None:
        """The numbers (SI) that change the least of all that make every mode decay at a rate (1/s), None: none do.

        Without numbers that change by little, and with few digits, if every mode then decays, too.
        """
        if margin not in self._solved:
            problem = self._problem
            whole = problem.smallest_change(margin)
            small = _without_small(whole)
            # The others then change a little more, until every mode decays again.
            stretches = 1 + 0.01 * np.arange(50)
            shortened = (problem.in_file(np.clip(stretch * small, problem.low, problem.high)) for stretch in stretches)
            decaying = (each for each in shortened if problem.decays(problem.sizes_of(each), margin))
            self._solved[margin] = next(decaying, problem.exact(whole)) if problem.decays(whole, margin) else None
        return self._solved[margin]

    def _norm(self, numbers: Numbers) -> float:
        return _size(self._problem.sizes_of(numbers))

    def _quieting(self, numbers: Numbers, judged: DisturbedSqueal | None) -> Quieting:
        """What was found, and the scene with these numbers (SI)."""
        before = self._problem.written
        written = before.with_values({key: before.exact(key, value) for key, value in numbers.items()})
        stability = prepare(written.scene).stability
        rate, least = written.scene.simulate.sample_rate, 2 * stability.highest_frequency_Hz
        if rate < least:  # a stiffer brake may need more; a multiple leaves the duration a whole number of samples
            written = written.with_values({"simulate.sample_rate": math.ceil(least / rate) * rate})
        own = self._problem.numbers
        changes = tuple(Change.of(before, key, own[key], after) for key, after in numbers.items())
        largest = self._problem.largest(self._problem.sizes_of(numbers))
        return Quieting(
            # The transients are judged without a margin, and so are the modes then.
            found=largest <= -self._margin * (1 - 2 * SLACK) if judged is None else judged.steady_sliding_stable,
            quiet=None if judged is None else judged.quiet,
            changes=changes,
            norm_of_relative_changes=math.hypot(*(each.relative for each in changes)),
            largest_growth_rate_1_per_s=largest,
            cautions=cautions(before.scene, numbers),
            disturbances=() if judged is None else judged.disturbances,
            scene=written.scene,
            scene_file=written.to_toml(),
        )


def _without_small(change: NDArray[np.float64]) -> NDArray[np.float64]:
    """Changes (k,) without those that are small beside the largest."""
    # 0.1 of the largest change: a number that would change by less stays as it is and is not listed
    return np.where(np.abs(change) < 0.1 * np.abs(change).max(initial=0.0), 0.0, change)


def _next_to(whole: _Vector, ways: _Vector, turn: float, shorter: float) -> list[_Vector]:
    """Changes that are smaller by at least `PRECISION`."""
    size, units = _size(whole), np.eye(whole.size)
    # One part nought or half of what it was, the others as they are
    found = [whole - less * whole * unit for unit in units for less in (1.0, 0.5)]
    for unit, way in zip(units, ways, strict=True):
        for step in (turn, -turn):
            turned = whole + step * way * size * unit
            turned = np.where(turned * ways < 0, 0.0, turned)  # no part the other way
            if turned.any():
                found.append(shorter * size / _size(turned) * turned)
    unlike: list[_Vector] = []
    for each in found:
        smaller = 0 < _size(each) <= size * (1 - PRECISION / 2)
        if smaller and not any(np.allclose(each, other) for other in unlike):
            unlike.append(each)
    return unlike


def _size(change: _Vector) -> float:
    return float(np.linalg.norm(change))
