"""Variants of one scene: each run, timed, and compared with the whole."""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np

from drumsqueal.errors import COMPLETE, Ending, IntegrationError
from drumsqueal.findings.answers import RelativeChange, SceneAnswer, change_of
from drumsqueal.findings.columns import Column
from drumsqueal.progress import Progress
from drumsqueal.questions.effects.in_brake import answer_in
from drumsqueal.questions.effects.reductions import Reduction, reduce, shoes_left_out
from drumsqueal.scene import Scene, SceneError
from drumsqueal.scene.tables import LEAST_TOLERANCE
from drumsqueal.simulation import Prepared, check_transient, finish, follow, prepare
from drumsqueal.solve.transient.integrate import Chunk

TIGHTER = 0.1  # fraction of the tolerance for the noise
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
        tighter = TIGHTER * scene.simulate.tolerance
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
