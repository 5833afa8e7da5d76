"""Which effects does a scene need, and what does each cost? Every one is left out or reduced, run, timed and compared.

Differences below the noise mean nothing: the whole scene is also run at a tenth of its tolerance, and what that moves
is the least that counts.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, astuple, dataclass, replace
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field

from drumsqueal.coordinates import column_unit
from drumsqueal.errors import COMPLETE, Ending, IntegrationError
from drumsqueal.findings.columns import Column
from drumsqueal.findings.compare import QUANTITIES, RelativeChange, SceneAnswer, change_of
from drumsqueal.findings.kinds import Criteria
from drumsqueal.findings.prediction import resolution_in_words, resolution_of
from drumsqueal.findings.schema import Findings, Held, InMemory, SceneInFile
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.effects.reductions import (
    NOTHING,
    Reduction,
    answer_in,
    bodies_of,
    fewest_modes,
    reduce,
    reductions_of,
    shoes_left_out,
    what_counts,
)
from drumsqueal.scene import Profile, Scene, SceneError
from drumsqueal.scene.quantities import ROUND_OFF, percent
from drumsqueal.scene.tables import LEAST_TOLERANCE
from drumsqueal.simulation import Prepared, check_transient, finish, follow, prepare
from drumsqueal.solve.transient.integrate import Chunk

# A reduced scene that takes this many times the time of the whole one is stopped: without separation or supports a
# motion may run away. Never before so many seconds.
SLOWEST, PATIENCE = 20.0, 10.0
# Seconds: a run that takes longer is timed once, a shorter one again, and again while all took less than a second, so
# many times at most. Of each chunk the fastest time counts.
LONG, ENOUGH, OFTEN = 10.0, 1.0, 10
WHOLE, NOISE = "whole scene", "tolerance / 10"


@dataclass(frozen=True)
class Variant:
    """One run: which reductions it has, what it costs, its answer, and its change from the whole scene's.

    `time_per_ms` is the computing time (ms) and `evaluations_per_ms` the number of evaluations of the forces that a
    simulated millisecond takes, compilation apart. A run that is not complete has no answer, and a `reason`.
    """

    label: str
    reductions: tuple[Reduction, ...]
    scene: Scene
    outcome: Ending
    time_per_ms: Annotated[float, Column("time", ".3g", unit="ms/ms")]
    evaluations_per_ms: Annotated[float, Column("eval.\nper ms", ".0f")]
    answer: SceneAnswer | None = None
    change: RelativeChange | None = None
    reason: str = ""

    @property
    def ended(self) -> str:
        """Ending and reason in words."""
        return self.outcome.because(self.reason)


class _Run(NamedTuple):
    variant: Variant
    prepared: Prepared | None
    times: list[list[float]]


class VariantRuns:
    """Runs variants of one scene and compares them with the whole, which is run first, and again for the noise.

    `noise` is what a tenth of the tolerance changes: an estimate, from one run. None if that run fails, or if no tenth
    is left. `report` is called with each run as it ends. Raises SceneError for a scene that cannot be run and
    IntegrationError when it fails; both, once the first run is over, are outcomes of a variant.
    """

    def __init__(self, scene: Scene, report: Callable[[Variant], None], progress: Progress) -> None:
        """Run the whole scene twice, at its own tolerance and at a tenth of it."""
        self._scene, self._report, self._progress = scene, report, progress
        self._runs: list[_Run] = []
        self._limit, self._whole = np.inf, None
        whole = self.run(WHOLE)
        if whole.answer is None:
            raise IntegrationError(f"the whole scene {whole.ended}")
        self._whole, self._limit = whole.answer, max(SLOWEST * sum(self._runs[0].times[0]), PATIENCE)
        # The noise is what a tenth of the tolerance changes.
        tighter = 0.1 * scene.simulate.tolerance
        self.noise = self.run(NOISE, tolerance=tighter).change if tighter >= LEAST_TOLERANCE else None

    def run(self, label: str, reductions: tuple[Reduction, ...] = (), tolerance: float | None = None) -> Variant:
        """Run the scene with reductions, or at another tolerance."""
        scene = reduce(self._scene, reductions)
        if tolerance is not None:
            scene = scene.with_values({"simulate.tolerance": tolerance})
        self._progress(label, 0.0, None)
        outcome, reason, prepared, answer, change = Ending.COMPLETE, "", None, None, None
        chunks: list[Chunk] = []
        seconds: list[float] = []
        try:
            prepared = prepare(scene)
            check_transient(prepared)
            self._time(label, prepared, chunks, seconds)
        except SceneError as error:  # such as: no steady sliding is left
            if not self._runs:
                raise
            outcome, reason = Ending.IMPOSSIBLE, str(error)
        except IntegrationError as error:
            outcome, reason = Ending.FAILED, str(error)
        if prepared is not None and outcome is Ending.COMPLETE:
            run = finish(prepared, chunks, COMPLETE)
            answer = answer_in(self._scene, scene, shoes_left_out(reductions), run, prepared.linear)
            change = None if self._whole is None else change_of(self._whole, answer)
        simulated = (float(chunks[-1].time[-1]) if chunks else 0.0) or np.nan  # s; NaN where nothing was simulated
        evaluations = sum(chunk.evaluations for chunk in chunks)
        cost = sum(seconds) / simulated, evaluations / simulated / 1e3
        variant = Variant(label, reductions, scene, outcome, *cost, answer, change, reason)
        self._runs.append(_Run(variant, prepared, [seconds]))
        self._report(variant)
        return variant

    def timed_again(self) -> tuple[Variant, ...]:
        """Time all short runs again, in turns: of each chunk the fastest time counts."""
        for _ in range(OFTEN):
            for run in self._runs:
                self._time_again(run)
        return tuple(self._fastest(run) for run in self._runs)

    def _time_again(self, run: _Run) -> None:
        variant, prepared, times = run
        first, spent = sum(times[0]), sum(map(sum, times))
        if prepared is None or variant.answer is None or first >= LONG or (len(times) > 1 and spent >= ENOUGH):
            return
        again: list[float] = []
        with suppress(IntegrationError):
            self._time(f"{variant.label}, timed again", prepared, [], again)
            times.append(again)

    def _fastest(self, run: _Run) -> Variant:
        variant, _, times = run
        if len(times) == 1:
            return variant
        fastest = sum(map(min, zip(*times, strict=True)))
        return replace(variant, time_per_ms=fastest / variant.scene.simulate.duration)

    def _time(self, label: str, prepared: Prepared, chunks: list[Chunk], seconds: list[float]) -> None:
        """Add the chunks and the seconds that each took; compiled beforehand. Raises IntegrationError."""
        follow(prepared, lambda _: True, self._progress, what=label)
        before = time.perf_counter()

        def take(chunk: Chunk) -> None:
            chunks.append(chunk)
            seconds.append(time.perf_counter() - before)

        def go_on(what: str, reached: float, duration: float | None) -> None:
            nonlocal before
            self._progress(what, reached, duration)
            if sum(seconds) > self._limit:
                raise IntegrationError(f"it takes more than {SLOWEST:g} times as long as the whole scene")
            before = time.perf_counter()

        follow(prepared, take, go_on, what=label)


TOGETHER = "together"
SCATTER = 0.9  # fraction of the time; what is nearer to one is within what times scatter


class EffectStudy(Findings):
    """All runs, the effects the scene needs `within` a relative accuracy, those it does not need, and what is left.

    `reduced_scene` is None until all runs are made. `noise` is what a tenth of the tolerance changes, an estimate from
    one run, and None where there is none. The first of the variants is the whole scene; `runs` has a row for each.
    """

    printed_by = "drumsqueal.questions.effects.answer.print_study"
    within: float
    runs: tuple[dict[str, Any], ...]
    verdict: str = ""
    remarks: tuple[str, ...] = ()
    reduced_scene: SceneInFile | None = None
    variants: InMemory[tuple[Variant, ...]] = Field(default=(), exclude=True)
    noise: RelativeChange | None = Held
    needed: tuple[Reduction, ...] = Field(default=(), exclude=True)
    spared: tuple[Reduction, ...] = Field(default=(), exclude=True)

    def needs(self, variant: Variant) -> bool:
        """Whether the variant leaves out a single effect, which the scene needs."""
        return len(variant.reductions) == 1 and variant.reductions[0] in self.needed


def study_effects(
    scene: Scene,
    within: float = 0.01,
    *,
    progress: Progress = silent,
    keep: Callable[[EffectStudy], None] = lambda _: None,
) -> EffectStudy:
    """Leave out or reduce each effect of a scene: `study_effects(scene).reduced_scene` has those that it needs.

    Then all that the scene does not need `within` that relative accuracy (0 to 1) is left out together; where that
    goes too far, the effect that counts most comes back until it does not. `keep` takes what is known after each run.
    Raises ValueError for another accuracy, SceneError for a scene that cannot be run, and IntegrationError when the
    whole scene fails.
    """
    if not 0 < within < 1:
        raise ValueError(f"the accuracy must be between 0 and 1, got {within}")
    reductions, ran = reductions_of(scene), list[Variant]()
    runs = 2 + len(reductions)  # and then some of them together

    def report(variant: Variant) -> None:
        ran.append(variant)
        keep(EffectStudy(scene=scene, within=within, runs=tuple(_rows(ran)), variants=tuple(ran)))

    def show(label: str, reached: float = 0.0, duration: float | None = None) -> None:
        progress(f"{len(ran) + 1} of {runs}: {label}" if len(ran) < runs else label, reached, duration)

    bench = VariantRuns(scene, report, show)
    alone = {reduction.effect: bench.run(str(reduction), (reduction,)) for reduction in reductions}
    excess = {effect: excess_of(variant.change, bench.noise, within) for effect, variant in alone.items()}
    spared = _with_a_shoe([reduction for reduction in reductions if excess[reduction.effect] <= 1], scene, excess)

    def suffices(reduction: Reduction) -> bool:
        over = excess_of(bench.run(str(reduction), (reduction,)).change, bench.noise, within)
        if over <= 1:
            excess[reduction.effect] = over
        return over <= 1

    for body in bodies_of(scene):
        bends = excess.get(body.effect, 0.0) > 1 and (body.shoe is None or body.shoe not in shoes_left_out(spared))
        fewer = fewest_modes(body, suffices) if bends else None
        if fewer is not None:
            reductions, spared = (*reductions, fewer), [*spared, fewer]
    label, counted = TOGETHER, what_counts(spared)
    while len(counted) > 1 and excess_of(bench.run(label, counted).change, bench.noise, within) > 1:
        heaviest = max(counted, key=lambda reduction: excess[reduction.effect])
        spared.remove(heaviest)
        label, counted = f"less {heaviest.effect}", what_counts(spared)
    variants = bench.timed_again()
    needed = what_counts([each for each in reductions if each not in spared], shoes_left_out(counted))
    limits = describe_limits(scene, variants[0].answer, bench.noise, within)
    return EffectStudy(
        scene=scene,
        within=within,
        runs=tuple(_rows(variants, needed)),
        verdict=describe_verdict(within, variants, needed, counted),
        remarks=(*describe_runs(variants), *limits, *describe_truncation(scene)),
        reduced_scene=reduce(scene, counted),
        variants=variants,
        noise=bench.noise,
        needed=needed,
        spared=counted,
    )


def _with_a_shoe(spared: list[Reduction], scene: Scene, excess: Mapping[str, float]) -> list[Reduction]:
    """What can be spared together: of shoes that leave each other as they are, the one that counts most stays."""
    shoes = [each for each in spared if each.leaves_shoe]
    if len(shoes) == len(scene.shoes):
        spared.remove(max(shoes, key=lambda each: excess[each.effect]))
    return spared


def excess_of(change: RelativeChange | None, noise: RelativeChange | None, within: float) -> float:
    """The largest change of any quantity over its limit, `within` or the noise where that is more; infinite if failed.

    A quantity that the noise takes away altogether has no limit.
    """
    if change is None:
        return math.inf
    limits = [max(within, abs(least or 0.0)) for least in astuple(noise or RelativeChange(None, None, None, None))]
    pairs = zip(astuple(change), limits, strict=True)
    return max((abs(value or 0.0) / limit for value, limit in pairs if math.isfinite(limit)), default=0.0)


def _rows(variants: Sequence[Variant], needed: Sequence[Reduction] | None = None) -> list[dict[str, Any]]:
    """One row a run: cost, eigenvalues, the motion at the end, and relative changes from the whole scene."""
    rows, whole = [], variants[0].answer
    for variant in variants:
        row: dict[str, Any] = {
            "run": variant.label,
            "left_out": "; ".join(map(str, variant.reductions)),
            "outcome": variant.ended,
            "computing_ms_per_simulated_ms": variant.time_per_ms,
            "evaluations_per_simulated_ms": variant.evaluations_per_ms,
        }
        answer = variant.answer
        if answer is not None and whole is not None:
            for label, mode in answer.modes.items():
                row[f"frequency_{label}_Hz"] = mode.frequency_Hz
                row[f"growth_rate_{label}_1_per_s"] = mode.growth_rate
            gone = {name for each in variant.reductions if each.leaves_shoe for name in each.without}
            for name in whole.amplitude:
                size = None if name in gone else answer.amplitude.get(name, 0.0)
                row[f"end_amplitude_{name}_{column_unit(name)}"] = size
            row["end_frequency_Hz"] = None if answer.main is None else answer.main.frequency_Hz
        if variant.change is not None:
            row |= {f"change_of_{field}": value for field, value in asdict(variant.change).items()}
        if needed is not None and len(variant.reductions) == 1:
            row["needed"] = "yes" if variant.reductions[0] in needed else "no"
        rows.append(row)
    return rows


def describe_verdict(
    within: float, variants: Sequence[Variant], needed: Sequence[Reduction], spared: tuple[Reduction, ...]
) -> str:
    """Which effects the scene needs, which it does not need, and what leaving these out saves."""
    accuracy = f"Within {percent(within)}"
    if not needed and not spared:
        return f"{accuracy}: this scene has no effect that could be left out."
    names = ", ".join(_needed(each.effect, variants[0].scene, spared) for each in needed)
    if not spared:
        return f"{accuracy} this scene needs all of its effects: {names}."
    left_out = ", ".join(
        each.effect if each.becomes == NOTHING else f"{each.effect} ({each.becomes} suffices)" for each in spared
    )
    final = next(variant for variant in reversed(variants) if variant.reductions == spared)
    fraction = final.time_per_ms / variants[0].time_per_ms
    time = "as long" if SCATTER < fraction < 1 / SCATTER else f"about {fraction:.1g} times as long"
    if fraction <= SCATTER:
        time = f"about {percent(float(f'{fraction:.1g}'))} of the time"
    needs = f"needs {names}, but not {left_out}" if names else f"needs none of its effects: not {left_out}"
    return f"{accuracy} this scene {needs}. {_what_changes(final.change)}, and the run takes {time}."


def _needed(effect: str, scene: Scene, spared: tuple[Reduction, ...]) -> str:
    """What an effect is called that the scene needs; of one by which a body bends, too, if all of its modes."""
    body = next((each for each in bodies_of(scene) if each.effect == effect), None)
    if body is None or any(each.effect == body.fewer for each in spared):
        return effect
    return f"{effect} (all {len(body.frequencies)} modes)" if len(body.frequencies) > 1 else effect


def _what_changes(change: RelativeChange | None) -> str:
    """What is compared, by name: what neither run has is not."""
    values = {} if change is None else asdict(change)
    compared = {QUANTITIES[field]: abs(value) for field, value in values.items() if value is not None}
    what = f"Without that, {', '.join(compared) or 'what could be compared'}"
    largest = max((value for value in compared.values() if math.isfinite(value)), default=0.0)
    return f"{what} do not change" if largest < ROUND_OFF else f"{what} change by {percent(largest)} at most"


def describe_limits(
    scene: Scene, whole: SceneAnswer | None, noise: RelativeChange | None, within: float
) -> tuple[str, ...]:
    """What limits the verdict: what could not be compared, noise above the accuracy asked for, profiles."""
    found = []
    if whole is not None and not whole.carriers:
        found.append("The whole scene is at rest at the end: only its eigenvalues are compared.")
    elif whole is not None and whole.main is None:
        found.append("The frequency at the end is not compared: the record is too short, or the motion has no line.")
    if noise is None:
        found.append("The effect of the tolerance is unknown: there is no run at a tenth of it.")
    for field, value in ({} if noise is None else asdict(noise)).items():
        words = QUANTITIES[field]
        if value is not None and math.isinf(value):
            found.append(f"The {words} are not compared: at a tenth of the tolerance they are altogether different.")
        elif value is not None and abs(value) > within:
            found.append(f"A tenth of the tolerance changes the {words} by {percent(abs(value))}: less does not count.")
    if any(isinstance(schedule, Profile) for schedule in scene.schedules().values()):
        found.append("Growth rates and onset frequencies are those at t = 0: drum speed or load change.")
    return tuple(found)


def describe_truncation(scene: Scene) -> tuple[str, ...]:
    """What shapes of shoes and drum beyond those that are kept would change."""
    prepared = prepare(scene)
    resolution = resolution_of(scene, prepared.linear, prepared.stability)
    return tuple(resolution_in_words(resolution))


def describe_runs(variants: Sequence[Variant]) -> tuple[str, ...]:
    """What the changes of a run do not show: why it failed, what else is unstable, that the model does not hold."""
    found, whole = [], variants[0].answer
    for variant in variants:
        answer = variant.answer
        if answer is None or whole is None:
            found.append(f"{variant.label}: {variant.ended}")
            continue
        if set(answer.unstable) != set(whole.unstable):
            before, after = (
                f"squeal in {', '.join(x)}" if x else "no squeal" for x in (whole.unstable, answer.unstable)
            )
            found.append(f"{variant.label}: {after} instead of {before}")
        if answer.rotation > Criteria.small_rotation:
            shoe = "a shoe" if variants[0].scene.several else "the shoe"
            turn = f"{shoe} turns by {answer.rotation:.2g} rad, where the model no longer holds"
            found.append(f"{variant.label}: {turn}")
    return tuple(found)
