"""The smallest change of a brake that makes it quiet: stable, and without squeal after every disturbance tried."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, computed_field

from drumsqueal.dynamics.attractor import SteadyResponse
from drumsqueal.findings.schema import Finding, SceneInFile
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.sensitivity.alone import (
    PRECISION,
    Alone,
    LineSearch,
    Numbers,
    each_alone,
    ladder_to,
    search,
)
from drumsqueal.questions.sensitivity.disturbing import (
    BrakeVariant,
    Decay,
    DisturbedSqueal,
    Disturber,
    Trial,
)
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

STRETCHES = 1 + 0.01 * np.arange(50)  # of the others, which then change a little more, until every mode decays again
STEP, MOST_STEPS = 1.6, 16  # from one size of the whole change that is tried to the next
OUTWARD = (1.1, 1.25, 1.6, 2.5, 4.0, 6.3)  # times a change that some disturbance has shown to squeal
PROOFS = 3  # of changes made smaller, each time with what squealed in the last one

_Vector = NDArray[np.float64]


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
        return None if self._disturber is None else self._disturber.squeal("disturbances")

    def alone(self, carried: Sequence[Trial]) -> tuple[Alone, ...]:
        """What each number alone does; `carried` is the squeal of the brake as it is."""
        return each_alone(self._problem, self._margin, self._disturber, carried, self._progress)

    def together(self, alone: Sequence[Alone], carried: Sequence[Trial], *, quiet: bool) -> Quieting:
        """The smallest change of all numbers that was found; `quiet` states whether the brake as it is squeals never.

        It begins on the way to the border of quiet, as flat as that is through the changes of each number alone, or
        with the smallest of these; where no number alone is enough, with the smallest that make every mode decay faster
        and faster. From there `shrink` goes to smaller ones. What is found is tried from every disturbance, and is
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
            (judged,) = self._disturber.judge([BrakeVariant(numbers, tuple(carried))], "proof")
            if judged.quiet:
                return self._quieting(numbers, judged)
        if stable is None:
            return self._quieting(self._problem.exact(self._problem.smallest_change(self._margin)), None)
        (judged,) = self._disturber.judge([BrakeVariant(stable, tuple(carried))], "proof")
        return self._quieting(stable, judged)

    def _smaller(
        self, whole: _Vector, singles: Mapping[str, float], carried: Sequence[Trial], most: float
    ) -> list[Numbers]:
        """Made smaller from a whole change (k,), and up to a size of `most` again until it stands a proof; none: never.

        What squeals in that after all is a disturbance of those that are tried next.
        """
        assert self._disturber is not None
        ways = np.sign([singles.get(key, part) for key, part in zip(self._problem.keys, whole.tolist(), strict=True)])
        failed: list[Numbers] = []
        for _ in range(PROOFS):
            in_file = self._problem.in_file
            whole = shrink(whole, ways, in_file, carried, self._disturber, self._progress, but=failed)
            line = self._line(whole, (1.0, *OUTWARD), 1 - PRECISION / 2, carried, most, proven=True)
            search([line], self._disturber, self._progress, "proof")
            if line.quiet_at is None:
                return []
            if line.quiet_at == 1:
                break
            failed.append(in_file(whole))
            carried, whole = (*line.last, *carried), line.quiet_at * whole
        return [self._problem.in_file(whole)]

    def _line(
        self,
        direction: _Vector,
        ladder: Iterable[float],
        squeals_at: float,
        carried: Sequence[Trial],
        most: float,
        *,
        proven: bool,
    ) -> LineSearch:
        """Brakes along a direction (k,), up to a size of `most`, or to the bounds where the ladder ends there."""
        farthest = self._problem.farthest(direction)
        ladder = [each for each in ladder if each < min(farthest, most / _size(direction))]
        return LineSearch(
            partial(self._problem.along, direction), ladder, squeals_at, carried, farthest=farthest, proven=proven
        )

    def _by_margin(self, carried: Sequence[Trial]) -> LineSearch:
        """Brakes whose every mode decays faster and faster, with the least change each."""
        first = max(self._margin, -self._growth)
        stable = self._growth <= -self._margin

        def ladder() -> Iterator[float]:
            for margin in first * STEP ** np.arange(int(stable), MOST_STEPS):
                if self._stable_values(margin) is None:
                    return
                yield float(margin)

        return LineSearch(self._stable_values, ladder(), first * (1 - PRECISION), carried, proven=False)

    def _towards(self, singles: Mapping[str, float], carried: Sequence[Trial], most: float) -> LineSearch:
        """Brakes on the way to the plane through what each number alone would have to be changed by."""
        inverse = np.array([1 / singles[key] if key in singles else 0.0 for key in self._problem.keys])
        direction = _without_small(inverse / (inverse @ inverse))
        farthest = min(self._problem.farthest(direction), most / _size(direction))
        # 0.4 of the change that would do if the border of quiet were flat: where the search along it begins
        ladder = ladder_to(farthest, 0.4, STEP, MOST_STEPS)
        along = partial(self._problem.along, direction)
        return LineSearch(along, ladder, 0.0, carried, farthest=farthest, proven=False)

    def _stable_values(self, margin: float) -> Numbers | None:
        """The numbers (SI) that change the least of all that make every mode decay at a rate (1/s), None: none do.

        Without numbers that change by little, and with few digits, if every mode then decays, too.
        """
        if margin not in self._solved:
            problem = self._problem
            whole = problem.smallest_change(margin)
            small = _without_small(whole)
            shortened = (problem.in_file(np.clip(stretch * small, problem.low, problem.high)) for stretch in STRETCHES)
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


# From a change of a brake that makes it quiet to a smaller one: each part less, or one at the cost of the others.


# Of the whole change: what one part gains or loses, the others in proportion, and what then remains of its size. The
# large steps first, and small ones where no large one is quiet.
STEPS = ((0.5, 0.85), (0.25, 1 - PRECISION))
_AT_ONCE = 4  # that are tried, the smallest first, until one is quiet
MOST_ROUNDS = 12


def shrink(
    whole: _Vector,
    ways: _Vector,
    numbers_at: Callable[[_Vector], Numbers],
    carried: Sequence[Trial],
    disturber: Disturber,
    progress: Progress,
    but: Sequence[Numbers] = (),
) -> _Vector:
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


def _first_quiet(candidates: Sequence[_Vector], brakes: Sequence[BrakeVariant], disturber: Disturber) -> _Vector | None:
    for first in range(0, len(candidates), _AT_ONCE):
        some = brakes[first : first + _AT_ONCE]
        judged = disturber.judge(some, "smaller changes", [False] * len(some))
        for each, one in zip(candidates[first:], judged, strict=False):
            if one.quiet:
                return each
    return None


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
