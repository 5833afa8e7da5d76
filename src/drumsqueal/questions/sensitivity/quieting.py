"""The smallest change of a brake that makes it quiet: stable, and without squeal after every disturbance tried."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drumsqueal.findings.part import Finding
from drumsqueal.findings.schema import SceneInFile
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.onset.found import Leads, Motion
from drumsqueal.questions.sensitivity.alone import Alone, each_alone
from drumsqueal.questions.sensitivity.change import Change, in_SI, rounded
from drumsqueal.questions.sensitivity.decay import Decay
from drumsqueal.questions.sensitivity.disturbing import Brake, Disturber, Judged, Trial
from drumsqueal.questions.sensitivity.lines import PRECISION, Line, search
from drumsqueal.questions.sensitivity.stabilising import (
    MARGIN,
    SLACK,
    Problem,
    largest_growth,
    numbers_of,
    variable_numbers,
)
from drumsqueal.scene import Profile, Scene
from drumsqueal.scene.written import Written
from drumsqueal.simulation import prepare
from drumsqueal.solve.linear.family import StateMatrix, state_matrix_of

UNCHANGED = 0.1  # of the largest relative change: a number that would change by less stays as it is and is not listed
STRETCHES = 1 + 0.01 * np.arange(50)  # of the others, which then change a little more, until every mode decays again
STEP, MOST_STEPS = 1.6, 16  # from one size of the whole change that is tried to the next
TINY = 1e-300  # keeps a quotient finite where no number alone makes the brake quiet
NEAREST = 0.25  # of the change that would do if the border of quiet were flat: where the search along it begins


class Squeal(Finding):
    """What becomes of a brake as it is when it is disturbed.

    Its steady-state responses, the one with most kinetic energy first; each names a disturbance that leads to it.
    `quiet` states whether steady sliding is stable and every disturbance decays.
    """

    steady_sliding_stable: bool
    quiet: bool
    motions: tuple[Motion, ...]
    disturbances: tuple[Trial, ...]

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
        return max((each for each in less if each.leads_to is Leads.DECAYS), key=_energy, default=None)


def _way(trial: Trial) -> tuple[str, bool] | None:
    return None if trial.kick is None else (trial.kick.mode, trial.kick.forwards)


def _energy(trial: Trial) -> float:
    return 0.0 if trial.kick is None else trial.kick.energy_J


class Quieting(Finding):
    """The smallest change found: the changed scene, its changes, their norm and its largest growth rate.

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
    disturbances: tuple[Trial, ...] = ()
    transients: tuple[Decay, ...] = ()
    scene: SceneInFile
    scene_file: str = Field(default="", exclude=True)

    @property
    def succeeded(self) -> bool:
        """Whether the changed brake is as quiet as was looked for."""
        return self.found and self.quiet is not False

    @property
    def motions(self) -> tuple[Motion, ...]:
        """What still squeals."""
        return tuple(each.motion for each in self.disturbances if each.motion is not None)


def quieten(
    scene: Scene,
    keys: Sequence[str] | None = None,
    *,
    margin: float = MARGIN,
    state_matrix: StateMatrix | None = None,
    progress: Progress = silent,
) -> Quieting:
    """Find the smallest norm of relative changes that makes a brake quiet: `quieten(scene, ["damping.ratio"]).scene`.

    Quiet: every real part is −`margin` (1/s) or below, and no disturbance that is tried leads to squeal. `keys` may
    change (None: the design). Profiles must have been turned into one value before. `state_matrix` is that of the
    scene's numbers where it is compiled already. Raises RequestError for keys that cannot change.
    """
    search = Quietening(scene, keys, margin=margin, state_matrix=state_matrix, progress=progress)
    squeal = search.squeal()
    if squeal is None or squeal.quiet:
        return search.together((), (), quiet=True)
    return search.together(search.alone(squeal.motions), squeal.motions, quiet=False)


class Quietening:
    """The steps of the search: what squeals, what each number alone does, and what all of them together."""

    def __init__(
        self,
        scene: Scene,
        keys: Sequence[str] | None = None,
        *,
        margin: float = MARGIN,
        tables: Mapping[str, Any] | None = None,
        state_matrix: StateMatrix | None = None,
        progress: Progress = silent,
    ) -> None:
        """Take a scene without profiles, what may change, and the tables of its file (None: in SI)."""
        own = scene
        scene, self._keys = variable_numbers(scene, keys)
        if state_matrix is None or scene is not own:
            state_matrix = state_matrix_of(scene, tuple(numbers_of(scene)))
        self._solved: dict[float, dict[str, float] | None] = {}
        self._evaluate, self._margin, self._progress = state_matrix, margin, progress
        self._written = Written(scene, tables)
        self._problem = self._with_margin(margin)
        self._before = dict(zip(self._keys, self._problem.before.tolist(), strict=True))
        self._growth = self._problem.largest(np.zeros(len(self._keys)))
        load = scene.contact.normal_load
        squeals = scene.friction is not None and (isinstance(load, Profile) or load > 0)
        self._disturber = Disturber(scene, progress) if squeals else None

    def _with_margin(self, margin: float) -> Problem:
        return Problem(self._written.scene, self._keys, margin, self._evaluate, self._progress)

    def squeal(self) -> Squeal | None:
        """What becomes of the brake as it is when it is disturbed; None where nothing can squeal."""
        if self._disturber is None:
            return None
        judged = self._disturber.squeal("disturbances")
        stable = not judged.point.unstable
        return Squeal(
            steady_sliding_stable=stable, quiet=judged.quiet, motions=judged.motions, disturbances=judged.trials
        )

    def alone(self, motions: Sequence[Motion]) -> tuple[Alone, ...]:
        """What each number alone does; `motions` are those of the brake as it is."""
        return each_alone(self._problem, self._written, self._margin, self._disturber, motions, self._progress)

    def together(self, alone: Sequence[Alone], motions: Sequence[Motion], *, quiet: bool) -> Quieting:
        """The smallest change of all numbers that was found; `quiet` states whether the brake as it is squeals never.

        Towards the border of quiet, as flat as it is through the changes of each number alone, and the smallest of
        these; where no number alone is enough, the smallest that make every mode decay faster and faster.
        """
        stable = self._stable_values(self._margin)
        if self._disturber is None or (quiet and self._growth <= -self._margin):
            return self._quieting(stable or {}, None)
        direction = self._direction(alone)
        lines = [self._along(direction, motions) if direction.any() else self._by_margin(motions)]
        search(lines, self._disturber, self._progress, "all numbers")
        at_quiet = [line.numbers_at(line.quiet_at) for line in lines if line.quiet_at is not None]
        found = [each for each in at_quiet if each is not None]
        found += [{each.key: each.quiet.after} for each in alone if each.quiet is not None]
        for numbers in sorted(found, key=self._norm):
            (judged,) = self._disturber.judge([Brake(numbers, tuple(motions))], "proof")
            if judged.quiet:
                return self._quieting(numbers, judged)
        if stable is None:
            return self._quieting(self._least_growth(), None)
        (judged,) = self._disturber.judge([Brake(stable, tuple(motions))], "proof")
        return self._quieting(stable, judged)

    def _by_margin(self, motions: Sequence[Motion]) -> Line:
        """Brakes whose every mode decays faster and faster, with the least change each."""
        first = max(self._margin, -self._growth)
        stable = self._growth <= -self._margin

        def ladder() -> Iterator[float]:
            for margin in first * STEP ** np.arange(int(stable), MOST_STEPS):
                if self._stable_values(margin) is None:
                    return
                yield float(margin)

        return Line(lambda margin: self._stable_values(margin), ladder(), first * (1 - PRECISION), motions)

    def _direction(self, alone: Sequence[Alone]) -> NDArray[np.float64]:
        """The shortest relative change (k,) to the plane through what each number alone would have to be changed by."""
        changes = {each.key: each.quiet.relative for each in alone if each.quiet is not None}
        inverse = np.array([1 / changes[key] if key in changes else 0.0 for key in self._keys])
        return _without_small(inverse / max(float(inverse @ inverse), TINY))

    def _along(self, direction: NDArray[np.float64], motions: Sequence[Motion]) -> Line:
        low, high = self._problem.low, self._problem.high
        sizes = (float(each) for each in NEAREST * STEP ** np.arange(MOST_STEPS))
        within = [each for each in sizes if np.all((low <= each * direction) & (each * direction <= high))]
        return Line(
            lambda size: self._in_file(size * direction), within, 0.0, motions, farthest=max(within, default=0.0)
        )

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
            if problem.decays(self._relative(numbers)):
                return numbers
        return self._exact(whole)

    def _least_growth(self) -> dict[str, float]:
        return self._exact(self._problem.smallest_change())

    def _exact(self, relative: NDArray[np.float64]) -> dict[str, float]:
        """The numbers (SI) that relative changes (k,) lead to, with all digits that the scene file can have."""
        after = dict(zip(self._keys, self._problem.after(relative).tolist(), strict=True))
        return in_SI(self._written, self._as_written(after))

    def _as_written(self, numbers: Mapping[str, float]) -> dict[str, float | str]:
        return {key: self._written.exact(key, value) for key, value in numbers.items()}

    def _in_file(self, relative: NDArray[np.float64]) -> dict[str, float]:
        """The numbers (SI) that relative changes (k,) lead to, as the scene file will have them."""
        after = dict(zip(self._keys, self._problem.after(relative).tolist(), strict=True))
        changed = {key: value for key, value in after.items() if value != self._before[key]}
        return in_SI(self._written, rounded(self._written, changed, self._before, self._problem.limits))

    def _relative(self, numbers: Mapping[str, float]) -> NDArray[np.float64]:
        after = np.array([numbers.get(key, self._before[key]) for key in self._keys])
        return (after - self._problem.before) / self._problem.scale

    def _norm(self, numbers: Mapping[str, float]) -> float:
        return float(np.linalg.norm(self._relative(numbers)))

    def _quieting(self, numbers: Mapping[str, float], judged: Judged | None) -> Quieting:
        """What was found, and the scene with these numbers (SI)."""
        written = self._written.with_values(self._as_written(numbers))
        stability = prepare(written.scene).stability
        rate, least = written.scene.simulate.sample_rate, 2 * stability.highest_frequency_Hz
        if rate < least:  # a stiffer brake may need more; a multiple leaves the duration a whole number of samples
            written = written.with_values({"simulate.sample_rate": math.ceil(least / rate) * rate})
        largest = largest_growth(stability.eigenvalues)
        return Quieting(
            found=largest <= -self._margin * (1 - 2 * SLACK),
            quiet=None if judged is None else judged.quiet,
            changes=tuple(Change.of(self._written, key, self._before[key], after) for key, after in numbers.items()),
            norm_of_relative_changes=self._norm(numbers),
            largest_growth_rate_1_per_s=largest,
            disturbances=() if judged is None else judged.trials,
            scene=written.scene,
            scene_file=written.to_toml(),
        )


def _without_small(relative: NDArray[np.float64]) -> NDArray[np.float64]:
    """Relative changes (k,) without those that are small beside the largest."""
    return np.where(np.abs(relative) < UNCHANGED * np.abs(relative).max(initial=0.0), 0.0, relative)
