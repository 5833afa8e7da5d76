"""What to change to make a brake quiet: how every growth rate changes with every number of the scene.

The brake is to be quiet at its drum speed and load, and at other values of its numbers in every combination.
"""

import itertools
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import computed_field

from drumsqueal.coordinates import is_static
from drumsqueal.errors import RequestError, SteadyStateError
from drumsqueal.findings.prediction import PredictedMode, predict
from drumsqueal.findings.schema import Finding, Findings, Held
from drumsqueal.findings.squeals import FORCE, LOAD, SPEED, name_of_key
from drumsqueal.physics.elasticity import check_shapes_stay, shaping_numbers
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.sensitivity.disturbing import DisturbedSqueal, nonlinear_decay
from drumsqueal.questions.sensitivity.quieting import Alone, Quietening, Quieting
from drumsqueal.questions.sensitivity.stabilising import numbers_of, variable_numbers
from drumsqueal.scene import Profile, Scene, SceneError
from drumsqueal.scene.shoes import key_alone
from drumsqueal.scene.variation import Variation, Written, may_not_rest, unit_of
from drumsqueal.simulation import Prepared, check_transient, prepare
from drumsqueal.solve.linear.family import StateMatrix, eigenvalue_gradient, state_matrix_of
from drumsqueal.solve.linear.modes import (
    CLEAR,
    UNDAMPED_FRACTION,
    Mode,
    Stability,
    eigensystem,
    matched,
    overlap_of,
    overlaps,
)

MOST_POINTS = 100  # of all ranges together


class Values(Finding):
    """What a number of the scene is, or the values that it takes (SI), and in the unit that is shown."""

    key: str
    values: tuple[float, ...]
    unit: str
    values_in_unit: tuple[float, ...]

    def __str__(self) -> str:
        """The value, or the ends of the range, with the unit."""
        ends = dict.fromkeys((self.values_in_unit[0], self.values_in_unit[-1]))
        return f"{' to '.join(f'{each:.4g}' for each in ends)} {self.unit}".rstrip()


class Operating(Finding):
    """Drum speed and load of the scene, and the `ranges` over which it is to be quiet, too.

    `time_s` is the instant at which a speed or load that changes over time is taken, None where neither changes.
    Where the lining has a temperature, it is that of its surroundings (`cold`).
    """

    own: tuple[Values, ...]
    ranges: tuple[Values, ...] = ()
    time_s: float | None = None
    cold: bool = False

    @property
    def points(self) -> tuple[dict[str, float], ...]:
        """The numbers (SI) that replace those of the scene, the scene itself first."""
        return points_of(
            {each.key: each.values for each in self.ranges}, {each.key: each.values[0] for each in self.own}
        )


def points_of(ranges: Mapping[str, Sequence[float]], own: Mapping[str, float]) -> tuple[dict[str, float], ...]:
    """The scene itself, and each combination of the values of some numbers that is not the scene's `own`."""
    grid = (dict(zip(ranges, each, strict=True)) for each in itertools.product(*ranges.values()))
    return ({}, *(each for each in grid if any(own.get(key) != value for key, value in each.items())))


def operating(scene: Scene, frozen: Scene, time: float, written: Written, at: Sequence[Variation]) -> Operating:
    """What a scene is asked for, which is `frozen` at a time (s)."""
    given = scene.schedules()
    if scene.pushed:
        given = {key: each for key, each in given.items() if key_alone(key) != LOAD or each != 0}
    numbers = frozen.numbers()
    own = [
        Values(
            key=key,
            values=(value,),
            unit=written.unit(key) or unit_of(key, frozen),
            values_in_unit=(written.shown(key, value),),
        )
        for key in dict.fromkeys((*given, *(each.key for each in at)))
        if isinstance(value := numbers.get(key), float)
    ]
    ranges = [
        Values(
            key=each.key,
            values=each.values,
            unit=each.shown_unit,
            values_in_unit=tuple(map(each.listed, each.values)),
        )
        for each in at
    ]
    changes = any(isinstance(each, Profile) for each in scene.schedules().values())
    return Operating(
        own=tuple(own), ranges=tuple(ranges), time_s=time if changes else None, cold=scene.temperature is not None
    )


def check_points(scene: Scene, at: Sequence[Variation], keys: Collection[str] | None) -> None:
    """Raise SceneError or RequestError for ranges that cannot be asked for."""
    for k, each in enumerate(at):
        may_not_rest(each)
        check_shapes_stay(scene, each.key)
        if each.key in [other.key for other in at[:k]]:
            raise RequestError(f"--at {each.key}: named twice; give one range")
        if keys is not None and each.key in keys:
            raise RequestError(f"--at {each.key}: --vary may change it, too; leave one of the two out")
        if each.key.startswith("forcing."):
            raise RequestError(f"--at {each.key}: a harmonic force is left out of the transients; leave it out")
        if key_alone(each.key) == LOAD and min(each.values) <= 0:
            raise RequestError(f"--at {each.key}: a lining without load does not squeal; begin above 0 N")
    number = math.prod(len(each.values) for each in at)
    if number > MOST_POINTS:
        raise RequestError(f"--at: {number} combinations of values, at most {MOST_POINTS} can be tried; take fewer")
    for point in points_of({each.key: each.values for each in at}, {}):
        scene.with_values(point)


def where(found: Operating) -> str:
    """The speed and the load, in words: "a drum speed of 5 rad/s and a load of 2000 N (at t = 0 s)"."""
    named = [f"a {name} of {each}" for each in found.own if (name := _name(each.key))]
    at_time = "" if found.time_s is None else f" (at t = {found.time_s:g} s)"
    cold = ", with a cold lining" if found.cold else ""
    return f"{' and '.join(named)}{at_time}{cold}"


def _name(key: str) -> str | None:
    """What presses a lining or turns the drum, None of other numbers."""
    if FORCE.fullmatch(key):
        return "force"
    return name_of_key(key) if key == SPEED or key_alone(key) == LOAD else None


def where_else(found: Operating) -> str:
    """The ranges, in words, "" where there is none."""
    ranges = " with ".join(f"{each.key} from {each} ({len(each.values)} values)" for each in found.ranges)
    return f" and at {ranges}" if ranges else ""


PERCENT = 0.01
# Of a number, for central differences where shapes are found anew: their number may change, and a growth rate with it
# by up to 0.2 1/s.
MODES_STEP = 1e-2


class LabelledMode(PredictedMode):
    """A mode that oscillates, with a `label` that differs for each mode."""

    label: str


class Sensitivity(Finding):
    """One number of the scene and what it does to each mode: changes where it grows by 1 %, and derivatives.

    `growth_per_percent_by_differences_1_per_s` is the same by central differences, None where the number is zero.
    """

    key: str
    value_SI: float
    growth_per_percent_1_per_s: tuple[float, ...]
    growth_per_percent_by_differences_1_per_s: tuple[float | None, ...]
    frequency_per_percent_Hz: tuple[float, ...]
    growth_per_SI: tuple[float, ...]
    frequency_Hz_per_SI: tuple[float, ...]


class SensitivityStudy(Findings):
    """The oscillating modes of a scene by rising frequency and how they change with its numbers.

    The number that changes most the modes that matter (`relevant`) comes first. `scene` is as it is when the
    eigenvalues are taken: profiles have one value. Where that is, and over which ranges it is to be quiet, too, is
    `operating`.
    `largest_deviation_from_central_differences` is relative to the largest derivative, both per percent. A
    growth rate is known to `round_off_1_per_s`. `divergence_rate_1_per_s` is None where nothing grows without
    oscillation. `quiet` is None where the smallest change that makes the scene stable was not asked for
    (`until_stable`), or nothing squeals. Where it was asked for, `squeal` is what becomes of the brake as it is when it
    is disturbed (None: nothing can squeal, or not looked for), and `alone` has what each number alone would have to be.
    `state_matrix` is the function of the numbers (`numbers_of(scene)`) that was differentiated.
    """

    printed_by = "drumsqueal.questions.sensitivity.answer.print_study"
    operating: Operating
    modes: tuple[LabelledMode, ...]
    numbers: tuple[Sensitivity, ...]
    divergence_rate_1_per_s: float | None
    largest_deviation_from_central_differences: float
    round_off_1_per_s: float
    until_stable: bool = False
    squeal: DisturbedSqueal | None = None
    alone: tuple[Alone, ...] = ()
    quiet: Quieting | None = None
    state_matrix: Any = Held

    @computed_field
    @property
    def not_covered(self) -> tuple[str, ...]:
        """Lists of the scene, such as the points of a measured friction curve, which are not differentiated."""
        return tuple(key for key, value in self.scene.numbers().items() if isinstance(value, tuple))

    @property
    def not_followed(self) -> tuple[str, ...]:
        """Numbers with which modes of shoe or drum change, and not as smoothly as a derivative asks for."""
        return tuple(key for key in _shaping(self.scene) if key not in self.by_free_modes)

    @property
    def by_free_modes(self) -> tuple[str, ...]:
        """Numbers with which modes of shoe or drum change: their rows are central differences."""
        return tuple(row.key for row in self.numbers if row.key in shaping_numbers(self.scene))

    @property
    def effective(self) -> tuple[Sensitivity, ...]:
        """The numbers with which some growth rate changes by more than round-off per +1 %."""
        least = self.round_off_1_per_s
        return tuple(row for row in self.numbers if any(abs(x) > least for x in row.growth_per_percent_1_per_s))

    @property
    def squealing(self) -> set[str | None]:
        """The names of the modes that squeal after a disturbance."""
        return set() if self.squeal is None else {motion.line_of for motion in self.squeal.motions}

    @property
    def relevant(self) -> tuple[int, ...]:
        """Places of the modes that matter: the unstable ones, else those that squeal, else the least stable."""
        every = range(len(self.modes))
        unstable = tuple(k for k in every if self.modes[k].unstable)
        squeal = tuple(k for k in every if self.modes[k].name in self.squealing)
        return unstable or squeal or (max(every, key=lambda k: self.modes[k].growth_rate_1_per_s),)

    def in_order(self) -> "SensitivityStudy":
        """The same with the number first that changes most the modes that matter."""
        most = {row.key: max(abs(row.growth_per_percent_1_per_s[k]) for k in self.relevant) for row in self.numbers}
        return self.model_copy(update={"numbers": tuple(sorted(self.numbers, key=lambda row: -most[row.key]))})

    @property
    def stable(self) -> bool:
        """Whether nothing grows, with or without oscillation, wherever the brake is to be quiet."""
        elsewhere = self.squeal is None or self.squeal.steady_sliding_stable
        return elsewhere and self.divergence_rate_1_per_s is None and not any(mode.unstable for mode in self.modes)

    @property
    def needs_no_change(self) -> bool:
        """Whether nothing grows, and every disturbance that was tried decays."""
        return self.stable and (self.squeal is None or self.squeal.quiet)


def check_request(
    scene: Scene, keys: Sequence[str] | None, *, until_stable: bool, at: Sequence[Variation] = ()
) -> None:
    """Raise SceneError or RequestError for what cannot be studied."""
    prepared = _prepare(scene)
    if until_stable:
        check_transient(prepared)
        _check_load(scene, prepared.stability.time)
        variable_numbers(scene, keys)
        check_points(scene, at, keys)


def _check_load(scene: Scene, time: float) -> None:
    """Raise RequestError for a load that is 0 at the time (s) for which a quiet brake would be looked for."""
    if scene.rubs and not at_one_time(scene, time).pressed:
        loads = [key for key in scene.schedules() if key_alone(key) == LOAD]
        zero = f"{' and '.join(loads)} {'are' if len(loads) > 1 else 'is'} 0 N at t = {time:g} s"
        raise RequestError(
            f"--until stable: {zero}, for which the brake would be made quiet, "
            "and without load nothing squeals; give the load of the braking as one value"
        )


def _prepare(scene: Scene) -> Prepared:
    """The scene with its eigenvalues; raises RequestError where there are no growth rates."""
    prepared = prepare(scene)
    if not prepared.stability.modes:
        raise RequestError("nothing oscillates in this scene, so there are no growth rates to differentiate")
    return prepared


def study_sensitivity(
    scene: Scene,
    *,
    until_stable: bool = False,
    keys: Sequence[str] | None = None,
    at: Sequence[Variation] = (),
    tables: Mapping[str, Any] | None = None,
    progress: Progress = silent,
    keep: Callable[[SensitivityStudy], None] = lambda _: None,
) -> SensitivityStudy:
    """Differentiate every growth rate with respect to every number: `study_sensitivity(scene).numbers`.

    With `until_stable`, also look what squeals when the brake is disturbed, find what each number alone and all of them
    together would have to be for the brake to be quiet, of the numbers with these `keys` (None: the design), and run
    the changed scene. It is to be quiet as it is and `at` each combination of the values of other numbers, which do not
    change. A profile counts as what it is at t = 0, or where the drum first turns and the shoe is pushed. `tables` are
    those of the scene's file, whose units the changed scene keeps (None: SI). `keep` takes what is known after each
    step. Raises SceneError for a scene without steady sliding and RequestError for one in which nothing oscillates, or
    for keys that cannot change.
    """
    if until_stable:
        _check_load(scene, _prepare(scene).stability.time)
        check_points(scene, at, keys)
    study = _differentiate(scene, tables, at, progress)
    if not until_stable:
        return study
    study = study.model_copy(update={"until_stable": True})
    keep(study)
    search = Quietening(
        study.scene,
        keys,
        points=study.operating.points,
        tables=tables,
        state_matrix=study.state_matrix,
        progress=progress,
    )
    study = study.model_copy(update={"squeal": search.squeal()}).in_order()
    if study.needs_no_change:
        return study
    keep(study)
    carried = () if study.squeal is None else study.squeal.squealing
    study = study.model_copy(update={"alone": search.alone(carried)})
    keep(study)
    quiet = search.together(study.alone, carried, quiet=study.squeal is None or study.squeal.quiet)
    study = study.model_copy(update={"quiet": quiet})
    keep(study)
    if not quiet.found:
        return study
    tested = quiet.model_copy(update={"transients": (nonlinear_decay(quiet.scene, progress),)})
    return study.model_copy(update={"quiet": tested})


def _differentiate(
    scene: Scene, tables: Mapping[str, Any] | None, at: Sequence[Variation], progress: Progress
) -> SensitivityStudy:
    progress("derivatives", 0, None)
    stability = _prepare(scene).stability
    frozen = at_one_time(scene, stability.time)
    numbers = numbers_of(frozen)
    evaluate = state_matrix_of(frozen, tuple(numbers))
    values = np.array(list(numbers.values()))
    matrices = evaluate(values)[1]
    derivatives = np.array([eigenvalue_gradient(mode.left, mode.right, matrices) for mode in stability.modes])
    differences = _differences(stability.modes, evaluate, values, progress)
    rows = [_row(*each) for each in zip(numbers, values, derivatives.T, differences.T, strict=True)]
    rows += _by_free_modes(stability, frozen, progress)
    modes = zip(stability.modes, predict(stability).modes, strict=True)
    return SensitivityStudy(
        scene=frozen,
        operating=operating(scene, frozen, stability.time, Written(frozen, tables), at),
        modes=tuple(LabelledMode(label=mode.label, **predicted.model_dump()) for mode, predicted in modes),
        numbers=tuple(rows),
        divergence_rate_1_per_s=stability.divergence,
        largest_deviation_from_central_differences=_deviation(values, derivatives, differences),
        round_off_1_per_s=UNDAMPED_FRACTION * float(np.abs(stability.eigenvalues).max()),
        state_matrix=evaluate,
    ).in_order()


def _by_free_modes(own: Stability, scene: Scene, progress: Progress) -> list[Sensitivity]:
    """Central differences by the numbers with which modes of shoe or drum change: of scenes with shapes of their own.

    Without those where two modes change places.
    """
    rows, numbers, shaping = [], scene.numbers(), _shaping(scene)
    here = np.array([mode.eigenvalue for mode in own.modes])
    for k, key in enumerate(shaping):
        progress("derivatives by the modes of what bends", k, len(shaping))
        value = cast("float", numbers[key])
        changed = (dict.fromkeys(scene.as_one(key), (1 + sign * MODES_STEP) * value) for sign in (1, -1))
        try:
            ends = [prepare(scene.with_values(each)).stability for each in changed] if value else []
        except (SceneError, RequestError, SteadyStateError):  # beyond what a scene takes
            continue
        if not ends:
            continue
        above, below = (_followed_to(end, own) for end in ends)
        # A shape whose frequency passes `up_to` is there at one of the ends alone.
        for one, other in ((above, below), (below, above)):
            one[:] = np.where(np.isfinite(one), one, 2 * here - other)
        derivative = (above - below) / (2 * MODES_STEP * value)
        if not np.isfinite(derivative).all():  # modes change places
            continue
        rows.append(_row(key, value, derivative, derivative))
    return rows


def _followed_to(end: Stability, own: Stability) -> NDArray[np.complex128]:
    """Eigenvalues of another scene that belong to the modes of one, by the coordinates that are the same in both.

    Of shapes these are the modes of a body.
    """
    names = [name for name in own.coordinates if name in end.coordinates and not is_static(name)]
    overlap = overlaps(*(_within(each, names) for each in (own, end)))
    return _followed(overlap, np.array([mode.eigenvalue for mode in end.modes]))


def _within(stability: Stability, names: Sequence[str]) -> list[Mode]:
    """The modes by some of the coordinates, leftᴴ right = 1 within these."""
    size = len(stability.coordinates)
    places = [half * size + stability.coordinates.index(name) for half in (0, 1) for name in names]
    parts = [(mode, mode.right[places], mode.left[places]) for mode in stability.modes]
    return [mode._replace(right=right / np.vdot(left, right), left=left) for mode, right, left in parts]


def _shaping(scene: Scene) -> tuple[str, ...]:
    """Keys of the numbers with which modes of shoe or drum change; of those that are one, the first."""
    return tuple(dict.fromkeys(scene.as_one(key)[0] for key in shaping_numbers(scene)))


def _row(key: str, value: float, derivative: NDArray[np.complex128], difference: NDArray[np.complex128]) -> Sensitivity:
    by_differences = (PERCENT * value * difference.real).tolist()
    return Sensitivity(
        key=key,
        value_SI=value,
        growth_per_percent_1_per_s=(PERCENT * value * derivative.real).tolist(),
        growth_per_percent_by_differences_1_per_s=tuple(x if math.isfinite(x) else None for x in by_differences),
        frequency_per_percent_Hz=(PERCENT * value * derivative.imag / math.tau).tolist(),
        growth_per_SI=derivative.real.tolist(),
        frequency_Hz_per_SI=(derivative.imag / math.tau).tolist(),
    )


def at_one_time(scene: Scene, time: float) -> Scene:
    """The scene with the drum speed, the load and the forces that it has at a time (s), at all times."""
    values = {}
    for key, given in scene.schedules().items():
        if isinstance(given, Profile):
            values[key] = float(np.interp(time, given.time, given.value))
    return scene.with_values(values)


def _differences(
    modes: tuple[Mode, ...], evaluate: StateMatrix, values: NDArray[np.float64], progress: Progress
) -> NDArray[np.complex128]:
    """∂λ/∂p (modes, numbers) by central differences; each mode is followed by its eigenvector."""
    found = np.full((len(modes), values.size), np.nan, dtype=np.complex128)
    for k in np.flatnonzero(values):
        progress("derivatives", float(k), values.size)
        step = np.zeros(values.size)
        step[k] = 1e-3 * values[k]
        systems = (eigensystem(evaluate(values + sign * step)[0]) for sign in (1, -1))
        above, below = (_followed(overlap_of(modes, right, left), found) for found, right, left in systems)
        found[:, k] = (above - below) / (2 * step[k])
    return found


def _followed(overlap: NDArray[np.float64], eigenvalues: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Of these eigenvalues those that belong to the modes, one each; NaN where none is clearly the mode."""
    found = np.full(len(overlap), np.nan, dtype=np.complex128)
    for mode, other in matched(overlap, CLEAR).items():
        found[mode] = eigenvalues[other]
    return found


def _deviation(
    values: NDArray[np.float64], derivatives: NDArray[np.complex128], differences: NDArray[np.complex128]
) -> float:
    """Largest difference between both kinds of derivative, over the largest derivative, both per percent."""
    largest = np.abs(values * derivatives).max(initial=0.0)
    apart = np.abs(values * np.nan_to_num(differences - derivatives)).max(initial=0.0)
    return float(apart / largest) if largest > 0 else 0.0
