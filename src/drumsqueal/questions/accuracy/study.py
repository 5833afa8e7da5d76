"""How wrong is a scene's transient, and what would it cost to be ten times better?

Every method and tolerance, and every way to integrate the contact, runs the whole scene, is timed, and is compared: its
trajectory with an independent reference, what users quote with the tightest run, its energy with conservation. The
reference is a trajectory by another solver, from another library, on another quadrature, and by a second.
"""

import dataclasses
import math
import os
import platform
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, astuple, dataclass
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from pydantic import Field
from scipy.integrate import DOP853, LSODA

from drumsqueal.errors import COMPLETE, Ending, IntegrationError
from drumsqueal.findings.compare import RelativeChange, answer_of
from drumsqueal.findings.schema import Findings, Held, InMemory
from drumsqueal.physics.composition import moved_coordinates
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.friction_law import FrictionLaw, breakpoints
from drumsqueal.physics.model import Model
from drumsqueal.physics.quadrature.arc import ArcSurface
from drumsqueal.physics.quadrature.area import AreaSurface
from drumsqueal.physics.quadrature.cells import Cells
from drumsqueal.physics.quadrature.independent import FEJER, TANH_SINH, FixedGrid, IndependentSurface
from drumsqueal.precision import real
from drumsqueal.programs import one_kernel
from drumsqueal.progress import Progress, silent
from drumsqueal.scene import Profile, Scene, SceneError
from drumsqueal.scene.shoes import check_one
from drumsqueal.scene.tables import LEAST_TOLERANCE
from drumsqueal.simulation import Prepared, Result, check_transient, finish, follow, prepare, steady_at_start
from drumsqueal.solve.transient.integrate import Chunk
from drumsqueal.solve.transient.runge_kutta import DEFAULT, SOLVERS, check_solver, is_explicit
from drumsqueal.solve.transient.state import State, motion_scale

# The reference, the run that says how good it is, and another method that confirms it, each with its tolerance.
FIRST, SECOND, THIRD = 1e-13, 1e-12, 1e-12
UNMOVED = 1e-2  # of what the energy would give a coordinate: one that moves less is measured against that
FINER_CELLS = {TANH_SINH: (2, 2), FEJER: (1.5, 1, 2)}  # see `Contact.on_cells`
PATIENCE = 40.0  # s of computing for each of the three; a reference that takes longer ends where it has come to


@dataclasses.dataclass(frozen=True)
class Reference:
    """States (k, 2n), vibration and velocity, at times (k,), and those of the two runs that show how good they are.

    `other` is from ten times the tolerance and another quadrature, `confirming` from another method on top.
    """

    time: np.ndarray
    states: np.ndarray
    other: np.ndarray
    confirming: np.ndarray
    model: Model

    def error(self, states: np.ndarray, until: float) -> float:
        """Largest error of other states (k, 2n) at the same times up to one (s), relative to each state's size so far.

        The states may go on for longer than the reference.
        """
        upto = self.time <= until
        wanted = self.states[upto]
        return trajectory_error(states[: len(self.time)][upto], wanted, sizes_of(wanted, self.model))

    def uncertainty(self, until: float) -> float:
        """Error of `other` up to a time (s)."""
        return self.error(self.other, until)

    def confirmed(self, until: float) -> float:
        """Error of `confirming` up to a time (s)."""
        return self.error(self.confirming, until)


def find_reference(
    model: Model, steady: np.ndarray, start: np.ndarray, times: np.ndarray, progress: Progress = silent
) -> Reference:
    """Integrate displacement from steady sliding and velocity (2n,) with SciPy: DOP853 at 1e-13, 1e-12, LSODA at 1e-12.

    Their right-hand sides take the model's effects and, for the contact, tanh-sinh or Fejér quadrature. The
    reference ends early where one of them runs out of patience.
    """
    scale = _scale_of(model, start)

    def solve(method: Callable[..., Any], tolerance: float, own: Model, wanted: np.ndarray) -> np.ndarray:
        """Scaled states at the times that were reached."""
        # The model is compiled in: to hand it over takes longer than to evaluate it.
        compiled = jax.jit(lambda t, y: one_kernel(_slope, own, jnp.asarray(steady), jnp.asarray(scale), t, y))

        def slope(t: float, y: np.ndarray) -> np.ndarray:
            return np.asarray(compiled(t, y))

        states = [start / scale]
        slope(0.0, states[0])  # compiles
        patience = time.perf_counter() + PATIENCE
        solver = method(slope, 0.0, states[0], wanted[-1], rtol=tolerance, atol=tolerance)
        while solver.status == "running" and time.perf_counter() < patience:
            progress(f"reference, {method.__name__} at {tolerance:g}", solver.t, float(wanted[-1]))
            solver.step()
            if solver.status == "failed":
                break
            upto = int(np.searchsorted(wanted, solver.t, side="right"))
            if upto > len(states):
                states.extend(solver.dense_output()(wanted[len(states) : upto]).T)
        return np.array(states)

    first = solve(DOP853, FIRST, _with(model, TANH_SINH), times)
    other = _with(model, FEJER)
    second = solve(DOP853, SECOND, other, times[: len(first)])
    third = solve(LSODA, THIRD, other, times[: len(second)])
    common = len(third)
    states, other, confirming = (found[:common] * scale for found in (first, second, third))
    return Reference(times[:common], states, other, confirming, model)


def sizes_of(states: np.ndarray, model: Model) -> np.ndarray:
    """What errors of states (k, 2n) are measured against (2n,): the largest value of each, but no round-off.

    A state that only round-off moves is measured against a fraction of what the vibration energy would give it.
    """
    n = len(model.names)
    mass, stiffness = np.asarray(model.mass), np.asarray(model.stiffness)
    energy = states[:, n:] ** 2 @ mass + np.einsum("ti,ij,tj->t", states[:, :n], stiffness, states[:, :n])
    return np.maximum(np.abs(states).max(axis=0), UNMOVED * _scale_of(model, states[np.argmax(energy)]))


def _scale_of(model: Model, state: np.ndarray) -> np.ndarray:
    """What the energy of a state (2n,) would give each part of it."""
    vibration, velocity = jnp.split(jnp.asarray(state), 2)
    return np.asarray(motion_scale(model, State(vibration, velocity, jnp.zeros(()))).flat())[:-1]


def trajectory_error(states: np.ndarray, wanted: np.ndarray, sizes: np.ndarray) -> float:
    """Largest error (k, 2n) of any state over its size (2n,)."""
    return float((np.abs(states - wanted).max(axis=0) / sizes).max())


def _with(model: Model, rule: str) -> Model:
    """The model with another quadrature; where the friction law is steep the arc is split into many panels.

    In space that would take too long: where the two rules then differ, the uncertainty shows it. A lining that bends
    has finer cells in place of either rule.
    """
    if isinstance(model.lining.surface, Cells):
        return dataclasses.replace(model, contact=model.lining.on_cells(*FINER_CELLS[rule]))
    spatial, friction = model.lining.surface.spatial, model.contact.friction
    speeds = np.zeros(0) if friction is None else np.asarray(breakpoints(friction.law))
    # 5.0 m/s; a law whose slope changes over more is as smooth as the rest
    steep = not spatial and bool(np.any(speeds < 5.0))
    # 8 of the arc: 2e-12 of the load where the law falls with 1000 s/m
    surface = IndependentSurface(rule, spatial, panels=8 if steep else 2)
    return dataclasses.replace(model, contact=dataclasses.replace(model.lining, surface=surface))


def _slope(model: Model, steady: Array, scale: Array, t: Array, y: Array) -> Array:
    vibration, velocity = jnp.split(y * scale, 2)
    force, _ = model.act(t, steady + vibration, velocity)
    return jnp.concatenate([velocity, force / model.mass]) / scale


# What a study of accuracy tries: methods and tolerances, quadratures, and friction smoothed about its reversal.


STEPPING, QUADRATURE, SMOOTHING = "time stepping", "contact quadrature", "smoothed friction"
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
NODES = (2, 4, 6, 8, 12, 16)  # along each piece of the arc, or each half of it in space, split at contact boundaries
GRID = (20, 40, 80, 160, 320, 640)  # nodes of a grid that does not know the contact boundaries
WIDTHS = (1e-1, 1e-2, 1e-3, 1e-4)  # of the smoothing, over the speed of the drum's surface
OTHERS = 1e-6  # tolerance of those that are not about time stepping; at less a fixed grid does not get through
SPLIT, FIXED, CELLS, SMOOTHED = "split lining", "fixed grid", "cells", "smoothed"


class SmoothedDirection(eqx.Module):
    """F = −μ(|V|) N V/√(|V|² + ε²): friction without its jump where slip reverses; ε in m/s."""

    width: Array = eqx.field(converter=real)
    knows_axial: bool = eqx.field(static=True)

    def traction(
        self, law: FrictionLaw, pressure: Array, slip: Array, axial: Array | None
    ) -> tuple[Array, Array | None]:
        """Tractions along θ and z (Pa) at slip velocity V_θ, V_z (m/s; None for motion in the plane)."""
        squared = slip * slip if axial is None else slip * slip + axial * axial
        moving = squared > 0
        speed = jnp.where(moving, jnp.sqrt(jnp.where(moving, squared, 1.0)), 0.0)
        fraction = -law.coefficient(speed) * pressure / jnp.sqrt(squared + self.width**2)
        return fraction * slip, None if axial is None else fraction * axial


@dataclass(frozen=True)
class Configuration:
    """One way to run a scene: the cause of error it is about, its line in the figure and its place on it."""

    cause: str
    line: str
    setting: float
    solver: str
    tolerance: float
    model: Model

    @property
    def whole(self) -> bool:
        """Whether it runs the whole record, for its features; others run as far as the reference goes."""
        return self.cause == STEPPING and is_explicit(self.solver)

    @property
    def name(self) -> str:
        """What it is, in a word or two."""
        nodes = " along" if self.line == CELLS else " nodes"
        unit = {STEPPING: "", QUADRATURE: nodes, SMOOTHING: " of RΩ"}[self.cause]
        return f"{self.line}, {self.setting:g}{unit}"


def configurations_of(model: Model, solvers: Sequence[str] = ()) -> Iterator[list[Configuration]]:
    """The lines of the study, with further `solvers`, each from its cheapest configuration to its dearest."""
    for solver in dict.fromkeys((*SOLVERS, *solvers)):
        yield [Configuration(STEPPING, solver, tolerance, solver, tolerance, model) for tolerance in TOLERANCES]
    yield from _quadratures(model)
    friction = model.contact.friction
    if friction is not None:
        surface_speed = float(model.contact.radius * jnp.abs(model.operation.at(0.0).drum_speed))
        smoothed = []
        for width in WIDTHS:
            direction = SmoothedDirection(width * surface_speed, friction.direction.knows_axial)
            contact = dataclasses.replace(model.lining, friction=dataclasses.replace(friction, direction=direction))
            changed = dataclasses.replace(model, contact=contact)
            smoothed.append(Configuration(SMOOTHING, SMOOTHED, width, "dopri8", OTHERS, changed))
        yield smoothed


def _quadratures(model: Model) -> Iterator[list[Configuration]]:
    """Lines of nodes, split at the boundaries and not; of a lining that bends, cells: it has no other rule."""
    cells, spatial = model.lining.surface, model.lining.surface.spatial

    def configuration(line: str, setting: int, contact: Contact) -> Configuration:
        return Configuration(QUADRATURE, line, setting, DEFAULT, OTHERS, dataclasses.replace(model, contact=contact))

    if isinstance(cells, Cells):
        # Cells along a lining that bends, with as many across in proportion.
        yield [configuration(CELLS, n, model.lining.on_cells(n / cells.along, n / cells.along)) for n in (2, 4, 8, 12)]
        return
    split = {n: AreaSurface(n, max(2, n // 2), n) if spatial else ArcSurface(n) for n in NODES}
    for line, surfaces in ((SPLIT, split), (FIXED, {n: FixedGrid(n, spatial) for n in GRID})):
        yield [configuration(line, n, dataclasses.replace(model.lining, surface=each)) for n, each in surfaces.items()]


TIGHTEST, LOOSER = LEAST_TOLERANCE, 10 * LEAST_TOLERANCE  # tolerances of the runs that features are compared with
NUDGE = 1e-9  # relative change of the start of the nearby trajectory
REPEATS, SHORT = 7, 2.0  # a run is timed so often, as long as that takes less than so many seconds; the median counts
NONE = RelativeChange(None, None, None, None)
Features = dict[tuple[str, str], float]
"""Features by the field of a change that they are errors of, and the mode or coordinate."""


@dataclass(frozen=True)
class Errors:
    """Relative errors of one run; None where there is none.

    Of the trajectory over the growth phase, and beyond its first contact boundary; the largest of the features; and of
    the energy balance, over the largest kinetic energy.
    """

    trajectory: float | None
    beyond: float | None
    features: RelativeChange
    energy: float

    @property
    def largest_feature(self) -> float | None:
        """The largest error of what users quote."""
        return max((abs(e) for e in astuple(self.features) if e is not None), default=None)


@dataclass(frozen=True)
class Measurement:
    """One configuration: outcome, seconds of each repeat and of compilation, evaluations (NaN: not counted).

    `simulated` is how long a motion it ran (s); one that is not complete has a `reason`.
    """

    configuration: Configuration
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


def check_motion(scene: Scene) -> None:
    """Raise SceneError for a scene in which nothing moves, or the lining warms up: no errors can be measured there.

    Raises RequestError for several shoes.
    """
    check_one(scene.shoe)
    profiles = any(isinstance(value, Profile) for value in scene.schedules().values())
    if not moved_coordinates(scene) and not profiles:
        raise SceneError("nothing moves; give a start, such as displacement = { Y = 1e-7 }, or a force", ("start",))
    if scene.temperature is not None:
        raise SceneError(
            "the reference solvers do not model the temperature; leave it out (temperature=none)", ("temperature",)
        )


def check_solvers(scene: Scene, solvers: Sequence[str]) -> None:
    """Raise RequestError for a solver that there is not, and SceneError for one that cannot run this scene."""
    for solver in solvers:
        check_solver(solver)
        check_transient(prepare(scene.with_values({"simulate.solver": solver})))


class Benchmark:
    """What all configurations are measured against."""

    def __init__(self, scene: Scene, progress: Progress) -> None:
        """Run the scene at the tightest tolerances and from nearby, and find the reference."""
        self.prepared, self.progress = prepare(scene), progress
        check_transient(self.prepared)
        check_motion(scene)
        self.steady = steady_at_start(self.prepared)
        tight, looser = self._precisely(TIGHTEST), self._precisely(LOOSER)
        chunks = self._run(tight, f"run at tolerance {TIGHTEST:g}")
        result = finish(tight, chunks, COMPLETE)
        self.best = features_of(result, tight.linear)
        found = finish(looser, self._run(looser, f"run at tolerance {LOOSER:g}"), COMPLETE)
        self.scatter = feature_errors(self.best, features_of(found, tight.linear), scene.simulate.duration)
        self.time, vibration = np.concatenate([chunk.time for chunk in chunks]), self._vibration(chunks)
        boundary, end = result.findings.edge_reached_s, float(self.time[-1])
        self.growth_end = end if boundary is None else boundary
        self.separation = self._separation(vibration)
        # The reference goes on to 1.25 times the time of the first contact boundary.
        last = min(1.25 * self.growth_end, end, math.inf if self.separation is None else self.separation)
        # The reference has 16 samples at least.
        last = max(last, float(self.time[min(16, len(self.time) - 1)]))
        times = self.time[self.time <= last]
        self.reference = find_reference(tight.model, self.steady, vibration[0], times, progress)

    def measure(self, configuration: Configuration, what: str) -> Measurement:
        """Run a configuration: first to compile it, then as often as it is short."""
        values = {"simulate.solver": configuration.solver, "simulate.tolerance": configuration.tolerance}
        simulated = float(self.time[-1] if configuration.whole else self.reference.time[-1])
        scene = self.prepared.scene.with_values({**values, "simulate.duration": simulated})
        prepared = self.prepared._replace(scene=scene, model=configuration.model)
        seconds, chunks, compiling = [], [], math.nan
        try:
            compiling = self._first_chunk(prepared, what)
            compiling = max(0.0, compiling - self._first_chunk(prepared, what))
            while len(seconds) < (REPEATS if sum(seconds) < SHORT else 1):
                before = time.perf_counter()
                chunks = self._run(prepared, what)
                seconds.append(time.perf_counter() - before)
        except IntegrationError as error:
            return Measurement(configuration, Ending.FAILED, simulated, compile_seconds=compiling, reason=str(error))
        evaluations = sum(chunk.evaluations for chunk in chunks)
        errors = self._errors(prepared, chunks, configuration.whole)
        return Measurement(configuration, Ending.COMPLETE, simulated, tuple(seconds), compiling, evaluations, errors)

    def _run(self, prepared: Prepared, what: str) -> list[Chunk]:
        chunks: list[Chunk] = []
        follow(prepared, chunks.append, self.progress, what=what)
        return chunks

    def _precisely(self, tolerance: float, start: Mapping[str, Any] | None = None) -> Prepared:
        values = {"simulate.solver": "dopri8", "simulate.tolerance": tolerance}
        return self.prepared._replace(scene=self.prepared.scene.with_values({**values, **(start or {})}))

    def _first_chunk(self, prepared: Prepared, what: str) -> float:
        """Seconds that the first chunk takes."""
        before = time.perf_counter()
        follow(prepared, lambda _: True, self.progress, what=what)
        return time.perf_counter() - before

    def _vibration(self, chunks: list[Chunk]) -> np.ndarray:
        """Displacement from steady sliding, and velocity (k, 2n)."""
        return np.concatenate([np.hstack([chunk.displacement - self.steady, chunk.velocity]) for chunk in chunks])

    def _errors(self, prepared: Prepared, chunks: list[Chunk], whole: bool) -> Errors:
        states, reference, end = self._vibration(chunks), self.reference, float(self.reference.time[-1])
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

    def _separation(self, vibration: np.ndarray) -> float | None:
        """When a trajectory from a start that is off by a relative 1e-9 is off by a hundred times as much."""
        start = self.prepared.scene.start
        nudged = {
            f"start.{kind}": {name: value * (1 + NUDGE * k) for k, (name, value) in enumerate(table.items(), start=1)}
            for kind, table in start
        }
        nearby = self._run(self._precisely(TIGHTEST, nudged), "nearby trajectory")
        apart = np.abs(self._vibration(nearby) - vibration)
        sizes = UNMOVED * sizes_of(vibration, self.prepared.model)
        fraction = (apart / np.maximum(np.maximum.accumulate(np.abs(vibration), axis=0), sizes)).max(axis=1)
        # Where a relative difference has grown a hundredfold, pointwise errors are of the motion, not of the method.
        beyond = np.flatnonzero(fraction > 100.0 * NUDGE * max(1, len(start.displacement), len(start.velocity)))
        return float(self.time[beyond[0]]) if beyond.size else None


def features_of(result: Result, model: Model) -> Features:
    """Measured features by kind and name; `model` is the one over the coordinates of the eigenvalues."""
    found: Features = {}
    for mode in result.findings.modes:
        if mode.measured_growth is not None:
            found["growth_rate", mode.label] = mode.measured_growth.rate_1_per_s
        if mode.measured_frequency_Hz is not None:
            found["onset_frequency", mode.label] = mode.measured_frequency_Hz
    answer = answer_of(result.history, result.findings, result.stability, model)
    found |= {("amplitude", name): answer.amplitude[name] for name in answer.carriers}
    if answer.main is not None:
        found["main_frequency", ""] = answer.main.frequency_Hz
    return found


def feature_errors(best: Features, found: Features, duration: float) -> RelativeChange:
    """Errors of features against the best ones, of a record of that duration (s).

    A growth rate is measured against itself or, where that is more, against one e-fold over the record: the rate of a
    mode that neither grows nor decays has no relative error. None where the best ones lack the quantity, infinite where
    only the others do.
    """
    errors: dict[str, list[float]] = {}
    for (kind, name), value in best.items():
        there = found.get((kind, name))
        # 1e-300 keeps zero off the denominator.
        least = 1 / duration if kind == "growth_rate" else 1e-300
        error = math.inf if there is None else abs(there - value) / max(abs(value), least)
        errors.setdefault(kind, []).append(error)
    return RelativeChange(*(max(errors.get(field, ()), default=None) for field in asdict(NONE)))


LONGEST = 10.0  # s; once a run takes longer, the dearer ones of its line are not made
TOO_SLOW = f"the run before it took more than {LONGEST:g} s"


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

    printed_by = "drumsqueal.questions.accuracy.answer.print_study"
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
    scatter: RelativeChange = Field(default=NONE, exclude=True)
    measurements: InMemory[tuple[Measurement, ...]] = Field(default=(), exclude=True)
    cheapest: InMemory[Measurement | None] = Held
    ten_times_better: InMemory[Measurement | None] = Held


def study_accuracy(
    scene: Scene,
    target: float = 1e-4,
    *,
    solvers: Sequence[str] = (),
    progress: Progress = silent,
    keep: Callable[[AccuracyStudy], None] = lambda _: None,
) -> AccuracyStudy:
    """Measure what accuracy costs in time for a scene: `study_accuracy(scene).cheapest` meets the target.

    `solvers` are further ones to try, such as "diffrax.Kvaerno5", and `keep` takes what is known after each
    measurement. Raises ValueError for a target outside 0 to 1 and a solver that there is not, SceneError for a scene
    that cannot be run, and IntegrationError when the tightest run fails.
    """
    if not 0 < target < 1:
        raise ValueError(f"the target must be between 0 and 1, got {target}")
    check_solvers(scene, solvers)
    bench = Benchmark(scene, progress)
    lines = list(configurations_of(bench.prepared.model, solvers))
    measurements: list[Measurement] = []
    for line in lines:
        slowest = 0.0
        for configuration in line:
            what = f"{len(measurements) + 1} of {sum(map(len, lines))}: {configuration.name}"
            progress(what, 0.0, None)
            if slowest > LONGEST:
                found = Measurement(configuration, Ending.SKIPPED, reason=TOO_SLOW)
            else:
                found = bench.measure(configuration, what)
                slowest = max([slowest, *found.seconds])
            measurements.append(found)
            keep(AccuracyStudy(scene=scene, target=target, runs=tuple(map(_row, measurements))))
    cheapest = _cheapest(bench, measurements, target)
    chosen = cheapest and {"tolerance": cheapest.configuration.tolerance, "solver": cheapest.configuration.solver}
    study = AccuracyStudy(
        scene=scene,
        target=target,
        runs=tuple(map(_row, measurements)),
        simulate=chosen and scene.simulate.model_dump(mode="json") | chosen,
        reference=bench.reference,
        growth_end=bench.growth_end,
        separation=bench.separation,
        scatter=bench.scatter,
        measurements=tuple(measurements),
        cheapest=cheapest,
        ten_times_better=_cheapest(bench, measurements, target / 10),
    )
    return study.model_copy(update={"verdict": describe_verdict(study), "remarks": describe_limits(study)})


def _cheapest(bench: Benchmark, measurements: Sequence[Measurement], target: float) -> Measurement | None:
    """The choice of method and tolerance that meets a target in the fewest evaluations.

    Nearly all time goes into them, and unlike time they can be counted.
    """
    floor = bench.reference.uncertainty(bench.growth_end)
    enough = [each for each in measurements if _meets(each, target, floor, bench.scatter)]
    return min(enough, key=lambda each: each.evaluations, default=None)


def _meets(found: Measurement, target: float, floor: float, scatter: RelativeChange) -> bool:
    """Whether a choice of method and tolerance meets the target; features within twice their scatter do."""
    errors = found.errors
    if not found.configuration.whole or errors is None or errors.trajectory is None:
        return False
    features = all(
        error is None or error <= max(target, 2 * (least or 0.0)) < math.inf
        for error, least in zip(astuple(errors.features), astuple(scatter), strict=True)
    )
    return features and max(errors.trajectory, floor, errors.energy) <= target


def _row(measurement: Measurement) -> dict[str, Any]:
    configuration, errors = measurement.configuration, measurement.errors
    row: dict[str, Any] = {
        "cause": configuration.cause,
        "line": configuration.line,
        "setting": configuration.setting,
        "solver": configuration.solver,
        "tolerance": configuration.tolerance,
        "outcome": measurement.ended,
        "simulated_ms": measurement.simulated * 1e3,
        "time_per_simulated_ms": measurement.time_per_ms,
        "seconds": " ".join(f"{each:.6g}" for each in measurement.seconds),
        "first_call_extra_seconds": measurement.compile_seconds,
        "evaluations": measurement.evaluations,
    }
    if errors is not None:
        row |= {"error_trajectory": errors.trajectory, "error_beyond_edges": errors.beyond}
        row |= {f"error_{name}": value for name, value in asdict(errors.features).items()}
        row["error_energy_balance"] = errors.energy
    return row


def describe_limits(study: AccuracyStudy) -> tuple[str, ...]:
    """What the columns mean, how good the reference is, and what was not measured."""
    reference, end = study.reference, float(study.reference.time[-1])
    reached = min(end, study.growth_end)
    phase = "the growth phase" if end >= study.growth_end else "as far as the reference got in its time"
    beyond = f"; beyond the first contact boundary, until {end * 1e3:.4g} ms" if end > study.growth_end else ""
    found = [
        "Time and evaluations for a simulated millisecond: median, without compilation. Relative errors: of the "
        f"trajectory, the largest of any state over its largest value, until {reached * 1e3:.4g} ms ({phase}{beyond}); "
        "of the features (growth rates, onset frequencies, amplitude and frequency at the end) the largest, compared "
        "with the tightest run; of the energy balance over the kinetic energy. A dash: not counted, or not reached. "
        "Implicit methods, those of diffrax, quadratures and smoothing run only as far as the reference, which is too "
        "short for features.",
        "The reference is SciPy's DOP853 at 1e-13 on tanh-sinh quadrature. DOP853 at 1e-12 on Fejér quadrature "
        f"differs by {reference.uncertainty(reached):.0e} (drawn as the floor), LSODA at 1e-12 by "
        f"{reference.confirmed(reached):.0e}.",
    ]
    if study.separation is None:
        found.append("Nearby trajectories stay together over the whole record.")
    else:
        found.append(
            f"At {study.separation * 1e3:.4g} ms nearby trajectories are a hundred times further apart than at the "
            "start: from there on compare features, not points."
        )
    failed: dict[str, list[str]] = {}
    for each in study.measurements:
        if each.errors is None:
            failed.setdefault(each.ended, []).append(each.configuration.name)
    return (*found, *(f"{'; '.join(names)}: {reason}." for reason, names in failed.items()))


def describe_verdict(study: AccuracyStudy) -> str:
    """The cheapest choice that meets the target, and what ten times better would cost."""
    best = study.cheapest
    floor = study.reference.uncertainty(study.growth_end)
    if best is None:
        limit = f" The reference itself is good to {floor:.0e}." if floor > study.target else ""
        return f"No run meets {study.target:.0e} in trajectory, features and energy together.{limit}"
    judged = "trajectory and energy (so short a record has no features)"
    if best.errors is not None and best.errors.largest_feature is not None:
        judged = "trajectory, features and energy"
        scatter = max(each or 0.0 for each in astuple(study.scatter))
        if 2 * scatter > study.target:
            judged += f" (features within twice their scatter of {scatter:.0e})"
    text = (
        f"Within {study.target:.0e} in {judged}, the cheapest is {best.configuration.solver} at "
        f"tolerance {best.configuration.tolerance:g}: {best.evaluations:.3g} evaluations, "
        f"{1e3 * best.time_per_ms * study.scene.simulate.duration:.3g} ms for {study.scene.simulate.duration:g} s."
    )
    better = study.ten_times_better
    if better is None:
        return f"{text} No run is ten times better."
    if better is best:
        return f"{text} It is even ten times better."
    ratio, chosen = better.evaluations / best.evaluations, better.configuration
    return f"{text} Ten times better takes {ratio:.3g} times as many ({chosen.solver} at {chosen.tolerance:g})."
