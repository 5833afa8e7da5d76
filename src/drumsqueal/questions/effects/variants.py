"""Variants of one scene: each run, timed, and compared with the whole."""

import time
from collections.abc import Callable
from contextlib import closing
from typing import NamedTuple

import numpy as np

from drumsqueal.errors import IntegrationError
from drumsqueal.findings.answers import Answer, Change, answer_of, change_of
from drumsqueal.findings.history import COMPLETE
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.questions.effects.reductions import Reduction, reduce
from drumsqueal.scene import Scene, SceneError
from drumsqueal.scene.tables import LEAST_TOLERANCE
from drumsqueal.simulation import Prepared, check_sample_rate, finish, prepare, transient
from drumsqueal.solve.transient.integrate import Chunk

TIGHTER = 0.1  # share of the tolerance for the noise
# A reduced scene that takes this many times the time of the whole one is stopped: without separation or supports a
# motion may run away. Never before so many seconds.
SLOWEST, PATIENCE = 20.0, 10.0
LONG = 10.0  # s; a run that takes longer is timed once, a shorter one twice, and of each chunk the faster time counts
WHOLE, NOISE = "whole scene", "tolerance / 10"


class Variant(NamedTuple):
    """One run: which reductions it has, what it costs, its answer, and its change from the whole scene's.

    `time_per_ms` is the computing time (ms) and `evaluations_per_ms` the number of evaluations of the forces that a
    simulated millisecond takes, compilation apart. A run that failed has no answer and says why in `outcome`.
    """

    label: str
    reductions: tuple[Reduction, ...]
    scene: Scene
    outcome: str
    time_per_ms: float
    evaluations_per_ms: float
    answer: Answer | None
    change: Change | None


class _Run(NamedTuple):
    variant: Variant
    prepared: Prepared | None
    seconds: list[float]


OnVariant = Callable[[Variant], None]
OnProgress = Callable[[str, float], None]


class Bench:
    """Runs variants of one scene and compares them with the whole, which is run first, and again for the noise.

    `noise` is what a tenth of the tolerance changes: an estimate, from one run. None if that run fails, or if no tenth
    is left. `on_variant` is called with each run as
    it ends, `on_progress` with its label and the time (s) it has reached. Raises SceneError for a scene that cannot be
    run and IntegrationError when it fails; both, once the first run is over, are outcomes of a variant.
    """

    def __init__(self, scene: Scene, on_variant: OnVariant, on_progress: OnProgress) -> None:
        """Run the whole scene twice, at its own tolerance and at a tenth of it."""
        self._scene, self._on_variant, self._on_progress = scene, on_variant, on_progress
        self._runs: list[_Run] = []
        self._limit, self._whole = np.inf, None
        whole = self.run(WHOLE)
        if whole.answer is None:
            raise IntegrationError(f"the whole scene {whole.outcome}")
        self._whole, self._limit = whole.answer, max(SLOWEST * sum(self._runs[0].seconds), PATIENCE)
        tighter = TIGHTER * scene.simulate.tolerance
        self.noise = self.run(NOISE, tolerance=tighter).change if tighter >= LEAST_TOLERANCE else None

    def run(self, label: str, reductions: tuple[Reduction, ...] = (), tolerance: float | None = None) -> Variant:
        """Run the scene with reductions, or at another tolerance."""
        scene = reduce(self._scene, reductions)
        if tolerance is not None:
            scene = scene.with_values({"simulate.tolerance": tolerance})
        self._on_progress(label, 0.0)
        prepared, chunks, seconds = None, [], []
        try:
            prepared = prepare(scene)
            check_sample_rate(prepared)
            chunks, seconds, outcome = self._timed(label, prepared)
        except SceneError as error:  # such as: no steady sliding is left
            if not self._runs:
                raise
            outcome = f"cannot be run: {error}"
        variant = Variant(label, reductions, scene, outcome, *_cost(chunks, seconds), None, None)
        if prepared is not None and outcome == COMPLETE:
            answer = answer_of(finish(prepared, chunks, COMPLETE), prepared.linear)
            change = None if self._whole is None else change_of(self._whole, answer)
            variant = variant._replace(answer=answer, change=change)
        self._runs.append(_Run(variant, prepared, seconds))
        self._on_variant(variant)
        return variant

    def timed_again(self) -> tuple[Variant, ...]:
        """Time all short runs once more, one after the other; of each chunk the faster time counts."""
        variants = []
        for variant, prepared, seconds in self._runs:
            if prepared is not None and variant.answer is not None and sum(seconds) < LONG:
                _, again, outcome = self._timed(f"{variant.label}, timed again", prepared)
                if outcome == COMPLETE:
                    faster = sum(min(pair) for pair in zip(seconds, again, strict=True))
                    variant = variant._replace(time_per_ms=faster / variant.scene.simulate.duration)
            variants.append(variant)
        return tuple(variants)

    def _timed(self, label: str, prepared: Prepared) -> tuple[list[Chunk], list[float], str]:
        """Chunks, the seconds each took, and the outcome; compiled beforehand."""
        chunks, seconds = [], []
        try:
            with closing(transient(prepared)) as stream:
                next(stream, None)
            with closing(transient(prepared)) as stream:
                before = time.perf_counter()
                for chunk in stream:
                    now = time.perf_counter()
                    chunks.append(chunk)
                    seconds.append(now - before)
                    stop_if_interrupted()
                    self._on_progress(label, float(chunk.time[-1]))
                    if sum(seconds) > self._limit:
                        raise IntegrationError(f"it takes more than {SLOWEST:g} times as long as the whole scene")
                    before = time.perf_counter()
        except IntegrationError as error:
            return chunks, seconds, f"failed: {error}"
        return chunks, seconds, COMPLETE


def _cost(chunks: list[Chunk], seconds: list[float]) -> tuple[float, float]:
    """Computing time (ms) and evaluations for a simulated millisecond; NaN where nothing was simulated."""
    simulated = float(chunks[-1].time[-1]) if chunks else 0.0
    if simulated == 0:
        return np.nan, np.nan
    return sum(seconds) / simulated, sum(chunk.evaluations for chunk in chunks) / simulated / 1e3
