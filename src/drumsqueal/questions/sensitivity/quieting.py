"""The smallest change of a brake that makes it quiet: stable, and without squeal after every disturbance tried."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, computed_field

from drumsqueal.dynamics.attractor import SteadyResponse
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.part import Finding
from drumsqueal.findings.schema import SceneInFile
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.sensitivity.alone import FURTHER, PRECISION, Alone, LineSearch, Numbers, each_alone, search
from drumsqueal.questions.sensitivity.change import Caution, Change, cautions, in_SI, rounded
from drumsqueal.questions.sensitivity.decay import Decay
from drumsqueal.questions.sensitivity.disturbing import BrakeVariant, Disturber, Judged, Trial, squealing
from drumsqueal.questions.sensitivity.stabilising import (
    MARGIN,
    SLACK,
    Problem,
    numbers_of,
    variable_numbers,
)
from drumsqueal.scene import Scene
from drumsqueal.scene.written import Written
from drumsqueal.simulation import prepare
from drumsqueal.solve.linear.family import StateMatrix, state_matrix_of

STRETCHES = 1 + 0.01 * np.arange(50)  # of the others, which then change a little more, until every mode decays again
STEP, MOST_STEPS = 1.6, 16  # from one size of the whole change that is tried to the next
TINY = 1e-300  # keeps a quotient finite where no number alone makes the brake quiet
OUTWARD = (1.1, 1.25, 1.6, 2.5, 4.0, 6.3)  # times a change that some disturbance has shown to squeal


class DisturbedSqueal(Finding):
    """What becomes of a brake as it is when it is disturbed.

    Its steady-state responses, the one with most kinetic energy first; each names a disturbance that leads to it.
    `quiet` states whether steady sliding is stable and every disturbance decays.
    """

    steady_sliding_stable: bool
    quiet: bool
    motions: tuple[SteadyResponse, ...]
    disturbances: tuple[Trial, ...]

    @property
    def squealing(self) -> tuple[Trial, ...]:
        """A disturbance for each of the responses at each operating point."""
        return squealing(self.disturbances)

    @property
    def smallest_disturbance(self) -> Trial | None:
        """Of the disturbances along a mode that lead to squeal the one with least energy."""
        return min((each for each in self.disturbances if each.kick and each.motion), key=_energy, default=None)

    @property
    def largest_that_decays(self) -> Trial | None:
        """Of those in the same mode and way with less energy the largest."""
        smallest = self.smallest_disturbance
        if smallest is None:
            return None
        less = [
            each for each in self.disturbances if _way(each) == _way(smallest) and _energy(each) < _energy(smallest)
        ]
        return max((each for each in less if each.leads_to is Kind.DECAYS), key=_energy, default=None)


def _way(trial: Trial) -> tuple[str, bool] | None:
    return None if trial.kick is None else (trial.kick.mode, trial.kick.forwards)


def _energy(trial: Trial) -> float:
    return 0.0 if trial.kick is None else trial.kick.energy_J


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
        held = {key for point in points for key in point}
        scene, self._keys = variable_numbers(scene, keys, held)
        if state_matrix is None or scene is not own:
            state_matrix = state_matrix_of(scene, tuple(numbers_of(scene)))
        self._solved: dict[float, dict[str, float] | None] = {}
        self._evaluate, self._margin, self._progress = state_matrix, margin, progress
        self._written, self._points = Written(scene, tables), tuple(points)
        self._problem = self._with_margin(margin)
        self._before = dict(zip(self._keys, self._problem.before.tolist(), strict=True))
        self._growth = self._problem.largest(np.zeros(len(self._keys)))
        squeals = scene.rubs and scene.pressed
        self._disturber = Disturber(scene, progress, self._points) if squeals else None

    def _with_margin(self, margin: float) -> Problem:
        return Problem(self._written.scene, self._keys, margin, self._evaluate, self._progress, self._points)

    def squeal(self) -> DisturbedSqueal | None:
        """What becomes of the brake as it is when it is disturbed; None where nothing can squeal."""
        if self._disturber is None:
            return None
        judged = self._disturber.squeal("disturbances")
        motions = tuple(each.motion for each in judged.squealing if each.motion is not None)
        return DisturbedSqueal(
            steady_sliding_stable=judged.stable, quiet=judged.quiet, motions=motions, disturbances=judged.trials
        )

    def alone(self, carried: Sequence[Trial]) -> tuple[Alone, ...]:
        """What each number alone does; `carried` is the squeal of the brake as it is."""
        return each_alone(self._problem, self._written, self._margin, self._disturber, carried, self._progress)

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
        singles = [{each.key: each.quiet.after} for each in alone if each.quiet is not None]
        found = min(singles, key=self._norm, default=None)
        direction = self._direction(alone)
        begin = self._along(direction, carried, self._norm(found)) if found else self._by_margin(carried)
        search([begin], self._disturber, self._progress, "all numbers")
        first = found if begin.quiet_at is None else begin.numbers_at(begin.quiet_at)
        if first is not None:
            smaller = self._proven(self._sizes(first), alone, carried, self._norm(found) if found else math.inf)
            singles += [] if smaller is None else [smaller]
        for numbers in sorted(singles, key=self._norm):
            (judged,) = self._disturber.judge([BrakeVariant(numbers, tuple(carried))], "proof")
            if judged.quiet:
                return self._quieting(numbers, judged)
        if stable is None:
            return self._quieting(self._least_growth(), None)
        (judged,) = self._disturber.judge([BrakeVariant(stable, tuple(carried))], "proof")
        return self._quieting(stable, judged)

    def _proven(
        self, whole: NDArray[np.float64], alone: Sequence[Alone], carried: Sequence[Trial], most: float
    ) -> Mapping[str, float] | None:
        """The numbers of the smallest change found from a whole one (k,), up to a size of `most`, that stands a proof.

        What then squeals after all is a disturbance of those that are tried next.
        """
        assert self._disturber is not None
        quiet = {each.key: each.quiet.logarithm for each in alone if each.quiet is not None}
        ways = np.sign(np.array([quiet.get(key, float(part)) for key, part in zip(self._keys, whole, strict=True)]))
        failed: list[Mapping[str, float]] = []
        for _ in range(3):  # proofs of changes made smaller; what is left squealing then is enlarged only
            whole = shrink(whole, ways, self._in_file, carried, self._disturber, self._progress, but=failed)
            further = [each for each in FURTHER if each <= self._farthest(whole)]
            brakes = [BrakeVariant(self._in_file(size * whole), tuple(carried)) for size in (1.0, *further)]
            judged = self._disturber.judge(brakes, "proof", [True, *(False for _ in further)])
            if all(each.quiet for each in judged):
                return brakes[0].numbers
            failed.append(brakes[0].numbers)
            carried = (*squealing([trial for each in judged for trial in each.trials]), *carried)
            size = self._outwards(whole, most, carried, proven=False)
            if size is None:
                return None
            whole = size * whole
        size = self._outwards(whole, most, carried, proven=True)
        return None if size is None else self._in_file(size * whole)

    def _outwards(
        self, whole: NDArray[np.float64], most: float, carried: Sequence[Trial], *, proven: bool
    ) -> float | None:
        """How many times a change (k,) the brake is quiet, up to a size of `most`; None where it is not.

        The change itself squeals, or is yet to be `proven`.
        """
        assert self._disturber is not None
        farthest = self._farthest(whole)
        ladder = [each for each in OUTWARD if each < min(farthest, most / float(np.linalg.norm(whole)))]
        begin = ([1.0, *ladder], 1 - PRECISION) if proven else (ladder, 1.0)
        line = LineSearch(partial(self._times, whole), *begin, carried, farthest=farthest, proven=proven)
        search([line], self._disturber, self._progress, "proof")
        return line.quiet_at

    def _times(self, change: NDArray[np.float64], size: float) -> Mapping[str, float]:
        return self._in_file(size * change)

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

    def _direction(self, alone: Sequence[Alone]) -> NDArray[np.float64]:
        """The smallest change (k,) to the plane through what each number alone would have to be changed by."""
        changes = {each.key: each.quiet.logarithm for each in alone if each.quiet is not None}
        inverse = np.array([1 / changes[key] if key in changes else 0.0 for key in self._keys])
        return _without_small(inverse / max(float(inverse @ inverse), TINY))

    def _along(self, direction: NDArray[np.float64], carried: Sequence[Trial], most: float) -> LineSearch:
        """Brakes along a direction (k,), up to a size of `most`."""
        farthest = min(self._farthest(direction), most / float(np.linalg.norm(direction)))
        # 0.4 of the change that would do if the border of quiet were flat: where the search along it begins
        sizes = 0.4 * STEP ** np.arange(MOST_STEPS)
        ladder = [*sizes[sizes < farthest * (1 - PRECISION)].tolist(), farthest]
        return LineSearch(partial(self._times, direction), ladder, 0.0, carried, farthest=farthest, proven=False)

    def _farthest(self, direction: NDArray[np.float64]) -> float:
        """How many times a change (k,) the bounds allow."""
        moved = direction != 0
        ends = np.where(direction > 0, self._problem.high, self._problem.low)
        return float(np.min(ends[moved] / direction[moved], initial=np.inf))

    def _stable_values(self, margin: float) -> dict[str, float] | None:
        """The numbers (SI) that change the least of all that make every mode decay at a rate (1/s), None: none do."""
        if margin not in self._solved:
            problem = self._with_margin(margin)
            whole = problem.smallest_change()
            self._solved[margin] = self._shortened(problem, whole) if problem.decays(whole) else None
        return self._solved[margin]

    def _shortened(self, problem: Problem, whole: NDArray[np.float64]) -> dict[str, float]:
        """Without numbers that change by little, and with few digits, if every mode then decays, too."""
        for stretch in STRETCHES:
            numbers = self._in_file(np.clip(stretch * _without_small(whole), problem.low, problem.high))
            if problem.decays(self._sizes(numbers)):
                return numbers
        return self._exact(whole)

    def _least_growth(self) -> dict[str, float]:
        return self._exact(self._problem.smallest_change())

    def _exact(self, change: NDArray[np.float64]) -> dict[str, float]:
        """The numbers (SI) that changes (k,) lead to, with all digits that the scene file can have."""
        after = dict(zip(self._keys, self._problem.after(change).tolist(), strict=True))
        return in_SI(self._written, self._as_written(after))

    def _as_written(self, numbers: Mapping[str, float]) -> dict[str, float | str]:
        return {key: self._written.exact(key, value) for key, value in numbers.items()}

    def _in_file(self, change: NDArray[np.float64]) -> dict[str, float]:
        """The numbers (SI) that changes (k,) lead to, as the scene file will have them."""
        after = dict(zip(self._keys, self._problem.after(change).tolist(), strict=True))
        changed = {key: value for key, value in after.items() if value != self._before[key]}
        return in_SI(self._written, rounded(self._written, changed, self._before, self._problem.limits))

    def _sizes(self, numbers: Mapping[str, float]) -> NDArray[np.float64]:
        return self._problem.sizes(np.array([numbers.get(key, self._before[key]) for key in self._keys]))

    def _norm(self, numbers: Mapping[str, float]) -> float:
        return float(np.linalg.norm(self._sizes(numbers)))

    def _quieting(self, numbers: Mapping[str, float], judged: Judged | None) -> Quieting:
        """What was found, and the scene with these numbers (SI)."""
        written = self._written.with_values(self._as_written(numbers))
        stability = prepare(written.scene).stability
        rate, least = written.scene.simulate.sample_rate, 2 * stability.highest_frequency_Hz
        if rate < least:  # a stiffer brake may need more; a multiple leaves the duration a whole number of samples
            written = written.with_values({"simulate.sample_rate": math.ceil(least / rate) * rate})
        changes = tuple(Change.of(self._written, key, self._before[key], after) for key, after in numbers.items())
        largest = self._problem.largest(self._sizes(numbers))
        return Quieting(
            # The transients are judged without a margin, and so are the modes then.
            found=largest <= -self._margin * (1 - 2 * SLACK) if judged is None else judged.stable,
            quiet=None if judged is None else judged.quiet,
            changes=changes,
            norm_of_relative_changes=math.hypot(*(each.relative for each in changes)),
            largest_growth_rate_1_per_s=largest,
            cautions=cautions(self._written.scene, numbers),
            disturbances=() if judged is None else judged.trials,
            scene=written.scene,
            scene_file=written.to_toml(),
        )


def _without_small(change: NDArray[np.float64]) -> NDArray[np.float64]:
    """Changes (k,) without those that are small beside the largest."""
    # 0.1 of the largest change: a number that would change by less stays as it is and is not listed
    return np.where(np.abs(change) < 0.1 * np.abs(change).max(initial=0.0), 0.0, change)


# From a change of a brake that makes it quiet to a smaller one: each part less, or one at the cost of the others.


_LESS = (0.0, 0.5)  # times one part, the others as they are
# Of the whole change: what one part gains or loses, the others in proportion, and what then remains of its size. The
# large steps first, and small ones where no large one is quiet.
STEPS = ((0.5, 0.85), (0.25, 1 - PRECISION))
_AT_ONCE = 4  # that are tried, the smallest first, until one is quiet
MOST_ROUNDS = 12

_Vector = NDArray[np.float64]


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
    found = [whole - (1 - less) * whole * unit for unit in units for less in _LESS]
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
