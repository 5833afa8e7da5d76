"""How wrong is a scene's transient, and what would it cost to be ten times better?

Every method and tolerance, and every way to integrate the contact, runs the whole scene, is timed, and is compared: its
trajectory with an independent reference, what users quote with the tightest run, its energy with conservation.
"""

import math
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from typing import NamedTuple

import numpy as np

from drumsqueal.errors import IntegrationError
from drumsqueal.findings.history import COMPLETE
from drumsqueal.interrupts import noted_interrupts, stop_if_interrupted
from drumsqueal.physics.composition import moved_coordinates
from drumsqueal.questions.accuracy.contenders import Contender, contenders_of
from drumsqueal.questions.accuracy.features import NONE, Features, feature_errors, features_of
from drumsqueal.questions.accuracy.reference import UNMOVED, Reference, find_reference, sizes_of
from drumsqueal.scene import Profile, Scene, SceneError
from drumsqueal.scene.tables import LEAST_TOLERANCE
from drumsqueal.simulation import Prepared, check_sample_rate, finish, prepare, steady_at_start, transient
from drumsqueal.solve.transient.integrate import Chunk

TARGET = 1e-4
TIGHTEST, LOOSER = LEAST_TOLERANCE, 10 * LEAST_TOLERANCE  # tolerances of the runs that features are compared with
NUDGE = 1e-9  # relative change of the start of the nearby trajectory
SEPARATED = 100.0  # growth of a relative difference beyond which pointwise errors tell of the motion, not of the method
BEYOND = 1.25  # the reference goes on to this multiple of the time of the first edge
FEWEST = 16  # samples of the reference at least
REPEATS, SHORT = 7, 2.0  # a run is timed so often, as long as that takes less than so many seconds; the median counts
PATIENCE = 10.0  # s; once a run takes longer, the dearer ones of its line are not made


class Errors(NamedTuple):
    """Relative errors of one run; None where it cannot be told.

    Of the trajectory over the growth phase, and beyond its first edge; the largest of the features; and of the energy
    balance, over the largest kinetic energy.
    """

    trajectory: float | None
    beyond: float | None
    features: Features
    energy: float

    @property
    def largest_feature(self) -> float | None:
        """The largest error of what users quote."""
        return max((abs(e) for e in self.features if e is not None), default=None)


class Measurement(NamedTuple):
    """One contender: outcome in words, seconds of each repeat and of compilation, evaluations (NaN: not counted).

    `simulated` is how long a motion it ran (s).
    """

    contender: Contender
    outcome: str
    seconds: tuple[float, ...]
    compile_seconds: float
    evaluations: float
    simulated: float
    errors: Errors | None

    @property
    def time_per_ms(self) -> float:
        """Median computing time (ms) for a simulated millisecond, compilation apart; NaN where no run was made."""
        return float(np.median(self.seconds)) / self.simulated if self.seconds else math.nan

    @property
    def evaluations_per_ms(self) -> float:
        """Evaluations of the forces for a simulated millisecond; NaN where they were not counted."""
        return self.evaluations / self.simulated / 1e3


class AccuracyStudy(NamedTuple):
    """All measurements, the reference, the ends of the growth phase and of the comparison (s), and what was found.

    `separation` is when nearby trajectories have come apart (None: not within the record), `scatter` what ten times the
    tightest tolerance changes in the features, `cheapest` the choice of method and tolerance that meets the
    target in the fewest evaluations, and `ten_times_better` the one that meets a tenth of it; None where there is none.
    """

    scene: Scene
    target: float
    reference: Reference
    growth_end: float
    separation: float | None
    scatter: Features
    measurements: tuple[Measurement, ...]
    cheapest: Measurement | None
    ten_times_better: Measurement | None


OnMeasurement = Callable[[Measurement], None]
OnProgress = Callable[[str], None]


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

    def __init__(self, scene: Scene, on_progress: OnProgress) -> None:
        self.prepared = prepare(scene)
        check_sample_rate(self.prepared)
        check_motion(scene)
        on_progress("the tightest runs")
        chunks, best = self._features(TIGHTEST)
        self.best = best
        self.scatter = feature_errors(best, self._features(LOOSER)[1], self.prepared.scene.simulate.duration)
        self.time, states = _states(chunks)
        self.steady = steady_at_start(self.prepared)
        departure = states - np.concatenate([self.steady, np.zeros_like(self.steady)])
        comparison = finish(self.prepared, chunks, COMPLETE).comparison
        edge, end = comparison.edge_reached_s, float(self.time[-1])
        self.growth_end = end if edge is None else edge
        on_progress("a nearby trajectory")
        self.separation = self._separation(departure)
        last = min(BEYOND * self.growth_end, end, math.inf if self.separation is None else self.separation)
        last = max(last, float(self.time[min(FEWEST, len(self.time) - 1)]))
        on_progress("the reference")
        n = len(self.steady)
        self.reference = find_reference(
            self.prepared.model, self.steady, departure[0, :n], departure[0, n:], self.time[self.time <= last]
        )

    def measure(self, contender: Contender) -> Measurement:
        """Run a contender: first to compile it, then as often as it is short."""
        values = {"simulate.solver": contender.solver, "simulate.tolerance": contender.tolerance}
        simulated = float(self.time[-1] if contender.whole else self.reference.time[-1])
        scene = self.prepared.scene.with_values({**values, "simulate.duration": simulated})
        prepared = self.prepared._replace(scene=scene, model=contender.model)
        seconds, chunks, compiling = [], [], math.nan
        try:
            before = time.perf_counter()
            _first_chunk(prepared)
            compiling = time.perf_counter() - before
            before = time.perf_counter()
            _first_chunk(prepared)
            compiling = max(0.0, compiling - (time.perf_counter() - before))
            while len(seconds) < (REPEATS if sum(seconds) < SHORT else 1):
                before = time.perf_counter()
                chunks = _run(prepared)
                seconds.append(time.perf_counter() - before)
        except IntegrationError as error:
            return Measurement(contender, f"failed: {error}", (), compiling, math.nan, simulated, None)
        evaluations = sum(chunk.evaluations for chunk in chunks)
        errors = self._errors(prepared, chunks, contender.whole)
        return Measurement(contender, COMPLETE, tuple(seconds), compiling, evaluations, simulated, errors)

    def cheapest(self, measurements: Sequence[Measurement], target: float) -> Measurement | None:
        """The choice of method and tolerance that meets a target in the fewest evaluations.

        Nearly all time goes into them, and unlike time they can be counted.
        """
        floor = self.reference.uncertainty(self.growth_end)
        enough = [each for each in measurements if meets(each, target, floor, self.scatter)]
        return min(enough, key=lambda each: each.evaluations, default=None)

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
        chunks = _run(prepared)
        return chunks, features_of(finish(prepared, chunks, COMPLETE), self.prepared.linear)

    def _separation(self, departure: np.ndarray) -> float | None:
        """When a trajectory from a start that is off by a share of 1e-9 is off by a hundred times as much."""
        scene, model = self.prepared.scene, self.prepared.model
        start = {
            f"start.{kind}": {name: value * (1 + NUDGE * k) for k, (name, value) in enumerate(table.items(), start=1)}
            for kind, table in (("displacement", scene.start.displacement), ("velocity", scene.start.velocity))
        }
        nudged = scene.with_values({**start, "simulate.tolerance": TIGHTEST, "simulate.solver": "dopri8"})
        nearby = _states(_run(self.prepared._replace(scene=nudged)))[1]
        apart = np.abs(nearby - np.concatenate([self.steady, np.zeros_like(self.steady)]) - departure)
        largest = np.maximum(np.maximum.accumulate(np.abs(departure), axis=0), UNMOVED * sizes_of(departure, model))
        share = (apart / largest).max(axis=1)
        most = max(1, len(scene.start.displacement), len(scene.start.velocity))
        beyond = np.flatnonzero(share > SEPARATED * NUDGE * most)
        return float(self.time[beyond[0]]) if beyond.size else None


def study_accuracy(
    scene: Scene,
    target: float = TARGET,
    *,
    on_measurement: OnMeasurement | None = None,
    on_progress: OnProgress | None = None,
) -> AccuracyStudy:
    """Measure what accuracy costs in time for a scene: `study_accuracy(scene).cheapest` meets the target.

    `on_measurement` is called with each measurement as it comes, `on_progress` with the name of what is under way.
    Raises ValueError for a target outside 0 to 1, SceneError for a scene that cannot be run, IntegrationError when the
    tightest run fails, and KeyboardInterrupt between two chunks.
    """
    if not 0 < target < 1:
        raise ValueError(f"the target must be between 0 and 1, got {target}")
    on_measurement, on_progress = on_measurement or (lambda _: None), on_progress or (lambda _: None)
    measurements: list[Measurement] = []
    with noted_interrupts():
        bench = _Bench(scene, on_progress)
        for line in contenders_of(bench.prepared.model):
            slowest = 0.0
            for contender in line:
                on_progress(contender.name)
                if slowest > PATIENCE:
                    found = Measurement(contender, _TOO_SLOW, (), math.nan, math.nan, math.nan, None)
                else:
                    found = bench.measure(contender)
                    slowest = max([slowest, *found.seconds])
                measurements.append(found)
                on_measurement(found)
    return AccuracyStudy(
        scene,
        target,
        bench.reference,
        bench.growth_end,
        bench.separation,
        bench.scatter,
        tuple(measurements),
        bench.cheapest(measurements, target),
        bench.cheapest(measurements, target / 10),
    )


_TOO_SLOW = f"not made: the run before it took more than {PATIENCE:g} s"


def meets(found: Measurement, target: float, floor: float, scatter: Features) -> bool:
    """Whether a choice of method and tolerance meets the target, features as far as their scatter lets it be told."""
    errors = found.errors
    if not found.contender.whole or errors is None or errors.trajectory is None:
        return False
    features = all(
        error is None or error <= max(target, 2 * (least or 0.0)) < math.inf
        for error, least in zip(errors.features, scatter, strict=True)
    )
    return features and max(errors.trajectory, floor, errors.energy) <= target


def _run(prepared: Prepared) -> list[Chunk]:
    chunks = []
    with closing(transient(prepared)) as stream:
        for chunk in stream:
            chunks.append(chunk)
            stop_if_interrupted()
    return chunks


def _first_chunk(prepared: Prepared) -> None:
    with closing(transient(prepared)) as stream:
        next(stream, None)
    stop_if_interrupted()


def _states(chunks: list[Chunk]) -> tuple[np.ndarray, np.ndarray]:
    states = np.concatenate([np.hstack([chunk.displacement, chunk.velocity]) for chunk in chunks])
    return np.concatenate([chunk.time for chunk in chunks]), states
