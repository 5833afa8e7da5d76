"""How wrong is a scene's transient, and what would it cost to be ten times better?

Every method and tolerance, and every way to integrate the contact, runs the whole scene, is timed, and is compared: its
trajectory with an independent reference, what users quote with the tightest run, its energy with conservation.
"""

import math
import os
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, astuple, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from drumsqueal.errors import IntegrationError
from drumsqueal.findings.answers import Change
from drumsqueal.findings.history import COMPLETE
from drumsqueal.findings.outcome import Ending
from drumsqueal.findings.schema import Findings, Held, InMemory
from drumsqueal.physics.composition import moved_coordinates
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.accuracy.contenders import Contender, contenders_of
from drumsqueal.questions.accuracy.features import NONE, feature_errors, features_of
from drumsqueal.questions.accuracy.reference import UNMOVED, Reference, find_reference, sizes_of
from drumsqueal.questions.accuracy.words import describe_limits, describe_verdict
from drumsqueal.scene import Profile, Scene, SceneError
from drumsqueal.scene.tables import LEAST_TOLERANCE
from drumsqueal.simulation import Prepared, check_sample_rate, finish, follow, prepare, steady_at_start
from drumsqueal.solve.transient.integrate import Chunk

TARGET = 1e-4
TIGHTEST, LOOSER = LEAST_TOLERANCE, 10 * LEAST_TOLERANCE  # tolerances of the runs that features are compared with
NUDGE = 1e-9  # relative change of the start of the nearby trajectory
SEPARATED = 100.0  # growth of a relative difference beyond which pointwise errors are of the motion, not of the method
BEYOND = 1.25  # the reference goes on to this multiple of the time of the first contact boundary
FEWEST = 16  # samples of the reference at least
REPEATS, SHORT = 7, 2.0  # a run is timed so often, as long as that takes less than so many seconds; the median counts
PATIENCE = 10.0  # s; once a run takes longer, the dearer ones of its line are not made


@dataclass(frozen=True)
class Errors:
    """Relative errors of one run; None where there is none.

    Of the trajectory over the growth phase, and beyond its first contact boundary; the largest of the features; and of
    the energy balance, over the largest kinetic energy.
    """

    trajectory: float | None
    beyond: float | None
    features: Change
    energy: float

    @property
    def largest_feature(self) -> float | None:
        """The largest error of what users quote."""
        return max((abs(e) for e in astuple(self.features) if e is not None), default=None)


@dataclass(frozen=True)
class Measurement:
    """One contender: outcome, seconds of each repeat and of compilation, evaluations (NaN: not counted).

    `simulated` is how long a motion it ran (s); one that is not complete has a `reason`.
    """

    contender: Contender
    outcome: Ending
    simulated: float = math.nan
    seconds: tuple[float, ...] = ()
    compile_seconds: float = math.nan
    evaluations: float = math.nan
    errors: Errors | None = None
    reason: str = ""

    @property
    def ended(self) -> str:
        """Ending and reason in words."""
        return self.outcome.because(self.reason)

    @property
    def time_per_ms(self) -> float:
        """Median computing time (ms) for a simulated millisecond, compilation apart; NaN where no run was made."""
        return float(np.median(self.seconds)) / self.simulated if self.seconds else math.nan

    @property
    def evaluations_per_ms(self) -> float:
        """Evaluations of the forces for a simulated millisecond; NaN where they were not counted."""
        return self.evaluations / self.simulated / 1e3


def _processor() -> str:
    information = Path("/proc/cpuinfo")
    lines = information.read_text(encoding="utf-8", errors="replace").splitlines() if information.exists() else []
    named = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor())


class AccuracyStudy(Findings):
    """All measurements, the reference, the ends of the growth phase and of the comparison (s), and what was found.

    `runs` has a row for each measurement, `simulate` the settings that meet the target. `separation` is when nearby
    trajectories have come apart (None: not within the record), `scatter` what ten times the tightest tolerance changes
    in the features, `cheapest` the choice of method and tolerance that meets the target in the fewest evaluations, and
    `ten_times_better` the one that meets a tenth of it; None where there is none.
    """

    target: float
    runs: tuple[dict[str, Any], ...]
    verdict: str = ""
    remarks: tuple[str, ...] = ()
    simulate: dict[str, Any] | None = None
    machine: str = Field(default_factory=platform.machine)
    processor: str = Field(default_factory=_processor)
    cores: int | None = Field(default_factory=os.cpu_count)
    reference: InMemory[Reference] = Held
    growth_end: float = Field(default=math.nan, exclude=True)
    separation: float | None = Held
    scatter: Change = Field(default=NONE, exclude=True)
    measurements: InMemory[tuple[Measurement, ...]] = Field(default=(), exclude=True)
    cheapest: InMemory[Measurement | None] = Held
    ten_times_better: InMemory[Measurement | None] = Held


def check_motion(scene: Scene) -> None:
    """Raise SceneError for a scene in which nothing moves, or the lining warms up: no errors can be measured there."""
    profiles = any(isinstance(value, Profile) for value in (scene.drum.speed, scene.contact.normal_load))
    if not moved_coordinates(scene) and not profiles:
        raise SceneError("nothing moves; give a start, such as displacement = { Y = 1e-7 }, or a force", ("start",))
    if scene.temperature is not None:
        raise SceneError(
            "the independent references know no temperature; leave it out (temperature=none)", ("temperature",)
        )


class _Bench:
    """What all contenders are measured against."""

    def __init__(self, scene: Scene, progress: Progress) -> None:
        self.prepared, self.progress = prepare(scene), progress
        check_sample_rate(self.prepared)
        check_motion(scene)
        chunks, best = self._features(TIGHTEST)
        self.best = best
        self.scatter = feature_errors(best, self._features(LOOSER)[1], self.prepared.scene.simulate.duration)
        self.time, states = _states(chunks)
        self.steady = steady_at_start(self.prepared)
        vibration = states - np.concatenate([self.steady, np.zeros_like(self.steady)])
        comparison = finish(self.prepared, chunks, COMPLETE).findings
        boundary, end = comparison.edge_reached_s, float(self.time[-1])
        self.growth_end = end if boundary is None else boundary
        self.separation = self._separation(vibration)
        last = min(BEYOND * self.growth_end, end, math.inf if self.separation is None else self.separation)
        last = max(last, float(self.time[min(FEWEST, len(self.time) - 1)]))
        n, times = len(self.steady), self.time[self.time <= last]
        start = vibration[0, :n], vibration[0, n:]
        self.reference = find_reference(self.prepared.model, self.steady, *start, times, progress)

    def measure(self, contender: Contender, what: str) -> Measurement:
        """Run a contender: first to compile it, then as often as it is short."""
        values = {"simulate.solver": contender.solver, "simulate.tolerance": contender.tolerance}
        simulated = float(self.time[-1] if contender.whole else self.reference.time[-1])
        scene = self.prepared.scene.with_values({**values, "simulate.duration": simulated})
        prepared = self.prepared._replace(scene=scene, model=contender.model)
        seconds, chunks, compiling = [], [], math.nan
        try:
            compiling = self._first_chunk(prepared, what)
            compiling = max(0.0, compiling - self._first_chunk(prepared, what))
            while len(seconds) < (REPEATS if sum(seconds) < SHORT else 1):
                before = time.perf_counter()
                chunks = self._run(prepared, what)
                seconds.append(time.perf_counter() - before)
        except IntegrationError as error:
            return Measurement(contender, Ending.FAILED, simulated, compile_seconds=compiling, reason=str(error))
        evaluations = sum(chunk.evaluations for chunk in chunks)
        errors = self._errors(prepared, chunks, contender.whole)
        return Measurement(contender, Ending.COMPLETE, simulated, tuple(seconds), compiling, evaluations, errors)

    def cheapest(self, measurements: Sequence[Measurement], target: float) -> Measurement | None:
        """The choice of method and tolerance that meets a target in the fewest evaluations.

        Nearly all time goes into them, and unlike time they can be counted.
        """
        floor = self.reference.uncertainty(self.growth_end)
        enough = [each for each in measurements if meets(each, target, floor, self.scatter)]
        return min(enough, key=lambda each: each.evaluations, default=None)

    def _run(self, prepared: Prepared, what: str) -> list[Chunk]:
        chunks: list[Chunk] = []
        follow(prepared, chunks.append, self.progress, what=what)
        return chunks

    def _first_chunk(self, prepared: Prepared, what: str) -> float:
        """Seconds that the first chunk takes."""
        before = time.perf_counter()
        follow(prepared, lambda _: True, self.progress, what=what)
        return time.perf_counter() - before

    def _errors(self, prepared: Prepared, chunks: list[Chunk], whole: bool) -> Errors:
        states = _states(chunks)[1] - np.concatenate([self.steady, np.zeros_like(self.steady)])
        reference, end = self.reference, float(self.reference.time[-1])
        energy = max(np.abs(chunk.energy_balance_error).max() for chunk in chunks)
        kinetic = max(chunk.kinetic_energy.max() for chunk in chunks)
        features = NONE
        if whole:
            found = features_of(finish(prepared, chunks, COMPLETE), self.prepared.linear)
            features = feature_errors(self.best, found, float(self.time[-1]))
        return Errors(
            reference.error(states, self.growth_end),
            reference.error(states, end) if end > self.growth_end else None,
            features,
            float(energy / kinetic) if kinetic > 0 else 0.0,
        )

    def _features(self, tolerance: float) -> tuple[list[Chunk], dict[str, float]]:
        scene = self.prepared.scene.with_values({"simulate.tolerance": tolerance, "simulate.solver": "dopri8"})
        prepared = self.prepared._replace(scene=scene)
        chunks = self._run(prepared, f"run at tolerance {tolerance:g}")
        return chunks, features_of(finish(prepared, chunks, COMPLETE), self.prepared.linear)

    def _separation(self, vibration: np.ndarray) -> float | None:
        """When a trajectory from a start that is off by a relative 1e-9 is off by a hundred times as much."""
        scene, model = self.prepared.scene, self.prepared.model
        start = {
            f"start.{kind}": {name: value * (1 + NUDGE * k) for k, (name, value) in enumerate(table.items(), start=1)}
            for kind, table in (("displacement", scene.start.displacement), ("velocity", scene.start.velocity))
        }
        nudged = scene.with_values({**start, "simulate.tolerance": TIGHTEST, "simulate.solver": "dopri8"})
        nearby = _states(self._run(self.prepared._replace(scene=nudged), "nearby trajectory"))[1]
        apart = np.abs(nearby - np.concatenate([self.steady, np.zeros_like(self.steady)]) - vibration)
        largest = np.maximum(np.maximum.accumulate(np.abs(vibration), axis=0), UNMOVED * sizes_of(vibration, model))
        fraction = (apart / largest).max(axis=1)
        most = max(1, len(scene.start.displacement), len(scene.start.velocity))
        beyond = np.flatnonzero(fraction > SEPARATED * NUDGE * most)
        return float(self.time[beyond[0]]) if beyond.size else None


def study_accuracy(
    scene: Scene,
    target: float = TARGET,
    *,
    progress: Progress = silent,
    keep: Callable[[AccuracyStudy], None] = lambda _: None,
) -> AccuracyStudy:
    """Measure what accuracy costs in time for a scene: `study_accuracy(scene).cheapest` meets the target.

    `keep` takes what is known after each measurement. Raises ValueError for a target outside 0 to 1, SceneError for a
    scene that cannot be run, and IntegrationError when the tightest run fails.
    """
    if not 0 < target < 1:
        raise ValueError(f"the target must be between 0 and 1, got {target}")
    bench = _Bench(scene, progress)
    lines = list(contenders_of(bench.prepared.model))
    measurements: list[Measurement] = []
    for line in lines:
        slowest = 0.0
        for contender in line:
            what = f"{len(measurements) + 1} of {sum(map(len, lines))}: {contender.name}"
            progress(what, 0.0, None)
            if slowest > PATIENCE:
                found = Measurement(contender, Ending.SKIPPED, reason=_TOO_SLOW)
            else:
                found = bench.measure(contender, what)
                slowest = max([slowest, *found.seconds])
            measurements.append(found)
            keep(AccuracyStudy(scene=scene, target=target, runs=tuple(map(_row, measurements))))
    cheapest = bench.cheapest(measurements, target)
    study = AccuracyStudy(
        scene=scene,
        target=target,
        runs=tuple(map(_row, measurements)),
        simulate=None if cheapest is None else _settings(scene, cheapest.contender),
        reference=bench.reference,
        growth_end=bench.growth_end,
        separation=bench.separation,
        scatter=bench.scatter,
        measurements=tuple(measurements),
        cheapest=cheapest,
        ten_times_better=bench.cheapest(measurements, target / 10),
    )
    return study.model_copy(update={"verdict": describe_verdict(study), "remarks": describe_limits(study)})


_TOO_SLOW = f"the run before it took more than {PATIENCE:g} s"


def meets(found: Measurement, target: float, floor: float, scatter: Change) -> bool:
    """Whether a choice of method and tolerance meets the target; features within twice their scatter do."""
    errors = found.errors
    if not found.contender.whole or errors is None or errors.trajectory is None:
        return False
    features = all(
        error is None or error <= max(target, 2 * (least or 0.0)) < math.inf
        for error, least in zip(astuple(errors.features), astuple(scatter), strict=True)
    )
    return features and max(errors.trajectory, floor, errors.energy) <= target


def _settings(scene: Scene, chosen: Contender) -> dict[str, Any]:
    """The table `[simulate]` of a scene with a method and a tolerance."""
    coordinates = scene.simulate.coordinates
    return {
        "duration": scene.simulate.duration,
        "sample_rate": scene.simulate.sample_rate,
        "tolerance": chosen.tolerance,
        "solver": chosen.solver,
        "coordinates": coordinates if isinstance(coordinates, str) else list(coordinates),
    }


def _row(measurement: Measurement) -> dict[str, Any]:
    contender, errors = measurement.contender, measurement.errors
    row: dict[str, Any] = {
        "cause": contender.cause,
        "line": contender.line,
        "setting": contender.setting,
        "solver": contender.solver,
        "tolerance": contender.tolerance,
        "outcome": measurement.ended,
        "simulated_ms": _known(measurement.simulated * 1e3),
        "time_per_simulated_ms": _known(measurement.time_per_ms),
        "seconds": " ".join(f"{each:.6g}" for each in measurement.seconds),
        "first_call_extra_seconds": _known(measurement.compile_seconds),
        "evaluations": _known(measurement.evaluations),
    }
    if errors is not None:
        row |= {"error_trajectory": errors.trajectory, "error_beyond_edges": errors.beyond}
        row |= {f"error_{name}": value for name, value in asdict(errors.features).items()}
        row["error_energy_balance"] = errors.energy
    return row


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def _states(chunks: list[Chunk]) -> tuple[np.ndarray, np.ndarray]:
    states = np.concatenate([np.hstack([chunk.displacement, chunk.velocity]) for chunk in chunks])
    return np.concatenate([chunk.time for chunk in chunks]), states
