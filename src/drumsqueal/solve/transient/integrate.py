"""The transient: our steps, or diffrax's own loop, in equal chunks, each one compiled call, handed out as they come.

A Python loop over chunks keeps memory flat, lets an interrupted run keep its data, and holds host callbacks out of the
compiled program, which would bar it from the persistent compilation cache.
Many transients of one composition run each as it is alone, one after the other in each of several threads: JAX leaves
Python to the other threads while a compiled call runs, which is nearly all the time. Side by side in one call
(`jax.vmap`) all would make as many steps as the one that needs most, and take every way of the contact integral at
each of them.
"""

import math
from collections.abc import Generator, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from types import MappingProxyType
from typing import Any, NamedTuple

import jax
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.compilation import cores
from drumsqueal.errors import IntegrationError
from drumsqueal.physics.effects.effect import Observation
from drumsqueal.physics.model import Model
from drumsqueal.precision import real
from drumsqueal.scene.tables import LEAST_TOLERANCE, MOST_TOLERANCE
from drumsqueal.solve.transient.runge_kutta import AUTO, DIFFRAX_STEPS, STAGES, check_solver, is_explicit, is_implicit
from drumsqueal.solve.transient.segment import Segment, first_step
from drumsqueal.solve.transient.state import CHUNK_SAMPLES, Span, State
from drumsqueal.solve.transient.stick_slip import MOST_CHANGES, STICKING_WHOLE, Method, StickSlip


class Checkpoint(NamedTuple):
    """Where a transient can be taken up again, exactly: after how many intervals, and all that goes on from there."""

    intervals: int
    state: State
    step: Array
    first_energy: float
    sticks: bool
    method: Method | None


class Chunk(NamedTuple):
    """Samples of one chunk: time (k,), displacement and velocity (k, n), observations and energies (k,).

    `remembered` is what effects remember (k,), by the names that these give it.
    `implicit` (k,) is 1 in chunks that took the implicit method, and `end` where to go on from; None where it fails.
    """

    time: np.ndarray
    displacement: np.ndarray
    velocity: np.ndarray
    observation: Observation
    kinetic_energy: np.ndarray
    potential_energy: np.ndarray
    energy_balance_error: np.ndarray
    steps: int
    rejected_steps: int
    evaluations: float  # NaN: not counted, for an implicit method and where the lining sticks
    implicit: np.ndarray
    end: Checkpoint | None
    remembered: Mapping[str, np.ndarray] = MappingProxyType({})
    changes: tuple[tuple[float, bool], ...] = ()  # when the lining changed (s), and whether it stuck from then on


def integrate(
    model: Model,
    steady: ArrayLike,
    displacement: ArrayLike,
    velocity: ArrayLike,
    *,
    duration: float,
    sample_rate: float,
    tolerance: float,
    solver: str = AUTO,
    since: Checkpoint | None = None,
) -> Generator[Chunk]:
    """Integrate M q̈ = Σ Q from a displacement (n,) from steady sliding q* (n,) and yield the samples chunk by chunk.

    An adaptive Runge-Kutta method, its error per step measured against the amplitude that the vibration energy gives
    each coordinate. Samples lie at k / sample_rate from 0 to the duration, both included; `since` the end of an earlier
    chunk they are those after that, the same as without a break. Raises IntegrationError when a chunk fails; all good
    samples have been yielded by then.
    """
    steady = real(steady)
    if since is None:
        state = start_state(model, displacement, velocity)
        since = Checkpoint(0, state, first_step(model), np.nan, sticks=False, method=None)
    state, step, first_energy = since.state, since.step, since.first_energy
    run = StickSlip(model, steady, np.float64(tolerance), solver, sticks=since.sticks, method=since.method)
    for first, count, span, time in _chunks_in_time(duration, sample_rate, since.intervals):
        segment = run.through(state, span, step)
        if first == 0:
            first_energy = float(np.sum(segment.looks[-2:, 0]))
        chunk = _to_chunk(segment, time, first_energy, np.asarray(steady), model.remembered, run)
        good = np.isfinite(chunk.displacement).all(axis=1) & np.isfinite(chunk.velocity).all(axis=1)
        good &= np.isfinite(chunk.energy_balance_error)
        kept = count + 1 if good.all() else int(np.argmin(good))
        fresh = slice(0 if first == 0 else 1, kept)  # a chunk begins with the last sample of the one before
        whole = kept > count and bool(segment.reached)
        end = Checkpoint(first + count, segment.final, segment.step, first_energy, run.sticks, run.choice.method)
        if fresh.stop > fresh.start:
            rows = jax.tree.map(lambda x, fresh=fresh: x[fresh] if isinstance(x, np.ndarray) else x, chunk)
            yield rows._replace(end=end if whole else None)
        if not whole:
            raise IntegrationError(_why(segment, chunk, max(kept - 1, 0), of_diffrax=run.choice.of_diffrax))
        state, step = segment.final, segment.step


def _chunks_in_time(duration: float, sample_rate: float, begin: int = 0) -> Iterator[tuple[int, int, Span, np.ndarray]]:
    """Of each chunk from sample `begin` on its first sample, how many come after that, the chunk and its times (s)."""
    samples = round(duration * sample_rate)
    for first in range(begin, samples, CHUNK_SAMPLES):
        count = min(CHUNK_SAMPLES, samples - first)
        # NumPy's numbers go into a compiled call at a tenth of what it takes to make arrays of them.
        span = Span(np.float64(first / sample_rate), np.float64(1 / sample_rate), np.int64(count))
        yield first, count, span, np.arange(first, first + count + 1) / sample_rate


def load_ahead(model: Model, tolerance: float, solver: str) -> None:
    """Load or compile, in another thread, the program that `integrate` begins with; it takes longer than all others."""
    rest = real(np.zeros(model.mass.size))
    span = Span(np.float64(0), np.float64(1), np.int64(1))
    run = StickSlip(model, rest, np.float64(tolerance), solver)
    run.load_ahead(start_state(model, rest, rest), span, np.float64(1))


def start_state(model: Model, displacement: ArrayLike, velocity: ArrayLike) -> State:
    """The state at the start, from a displacement from steady sliding and a velocity (n,)."""
    return State(real(displacement), real(velocity), real(0.0), model.first_memory)


def _to_chunk(
    segment: Segment,
    time: np.ndarray,
    first_energy: float,
    steady: np.ndarray,
    remembered: Sequence[str],
    run: StickSlip,
) -> Chunk:
    """What the segment has up to the last time (k,)."""
    segment = segment._replace(rows=segment.rows[: time.size])
    states, (*observation, kinetic, potential) = segment.states, segment.looks
    return Chunk(
        time=time,
        displacement=np.asarray(states.vibration) + steady,
        velocity=np.asarray(states.velocity),
        observation=Observation.of_rows(observation),
        kinetic_energy=kinetic,
        potential_energy=potential,
        energy_balance_error=kinetic + potential - first_energy - states.work,
        steps=int(segment.steps),
        rejected_steps=int(segment.steps) - int(segment.kept),
        evaluations=count_evaluations(segment, run.solvers),
        implicit=np.full(time.size, float(any(map(is_implicit, run.solvers)))),
        end=None,
        remembered=dict(zip(remembered, () if states.memory is None else states.memory.T, strict=True)),
        changes=tuple(run.changes),
    )


def count_evaluations(segment: Segment, solvers: set[str]) -> float:
    """The last stage of a step is the first of the next: one more at the start of the chunk."""
    stages = {STAGES[solver] if is_explicit(solver) else np.nan for solver in solvers}
    return float(segment.steps) * max(stages, default=np.nan) + 1 if len(stages) < 2 else np.nan


def _why(segment: Segment, chunk: Chunk, last: int, *, of_diffrax: bool = False) -> str:
    """What stopped the integration after the good sample number `last` of the chunk."""
    time = chunk.time[last]
    if segment.reached or not all(np.isfinite(each).all() for each in jax.tree.leaves(segment.final)):
        return f"the motion became infinite or undefined after t = {time:.6g} s"
    if segment.halted and of_diffrax:
        return f"the lining sticks to the drum at t = {chunk.time[0] + segment.time:.9g} s: {STICKING_WHOLE}"
    if segment.halted:
        return (
            f"the lining changes between stick and slip without getting on: {MOST_CHANGES:,} times just after "
            f"t = {chunk.time[0] + segment.time:.9g} s; another simulate.tolerance may help"
        )
    if of_diffrax and segment.steps < DIFFRAX_STEPS * (CHUNK_SAMPLES + 1):
        return (
            f"diffrax's solver found no further step at t = {chunk.time[0] + segment.time:.6g} s; another "
            'simulate.solver, such as "auto", or another simulate.tolerance may help'
        )
    if of_diffrax:
        return (
            f"diffrax made its max_steps, {segment.steps:,} in a chunk of {CHUNK_SAMPLES} samples, and came to "
            f"t = {chunk.time[0] + segment.time:.6g} s; a larger simulate.tolerance, a higher simulate.sample_rate "
            'or another simulate.solver, such as "auto", may help'
        )
    collapsed = f"the step size collapsed: {segment.steps:,} steps were not enough to get past t = {time:.6g} s"
    heat, load = chunk.observation.friction_power[last], chunk.observation.normal_force[last]
    # Friction power over normal force below 1e-3 m/s: then a collapsed step means a sticking lining.
    if 0 < heat < 1e-3 * load:
        return f"{collapsed}, where the lining all but sticks to the drum as a whole"
    return f"{collapsed}; a larger simulate.tolerance may help"


class Batch(NamedTuple):
    """A chunk of m transients: time (k,), displacement from steady sliding, velocity (m, k, n), evaluations (m,).

    Evaluations are NaN where they are not counted. Where `reached` (m,) is False a transient has failed: its samples
    are NaN from there on. `sticks` (m, k) says whether the contact sticks.
    """

    time: np.ndarray
    vibration: np.ndarray
    velocity: np.ndarray
    evaluations: np.ndarray
    reached: np.ndarray
    sticks: np.ndarray


def integrate_many(
    models: Sequence[Model],
    steady: ArrayLike,
    displacement: ArrayLike,
    velocity: ArrayLike,
    *,
    duration: float,
    sample_rate: float,
    tolerance: float,
    solver: str = AUTO,
    threads: int | None = None,
) -> Generator[Batch]:
    """Integrate m models of one composition from displacements (m, n) from their steady states (m, n), chunk by chunk.

    Displacements (m, rad) and velocities (m/s, rad/s) are in the order of `model.names`; a steady state is
    `analyse_stability(model).steady_state`, zero for the steady state "uniform-pressure". Samples lie at
    k / sample_rate (Hz) from 0 to the duration (s), both included; `tolerance` and `solver` are those of a scene. There
    is a thread for each processor unless given. A transient that fails does not stop the others. Raises
    ValueError where there are no models, where they are not of one composition, and for numbers or shapes that make no
    sense.
    """
    _check(models, solver, {"steady": steady, "displacement": displacement, "velocity": velocity}, threads)
    if not (math.isfinite(duration) and math.isfinite(sample_rate) and min(duration, sample_rate) > 0):
        raise ValueError(f"duration and sample_rate must be positive, got {duration} s and {sample_rate} Hz")
    if not LEAST_TOLERANCE <= tolerance <= MOST_TOLERANCE:
        raise ValueError(f"tolerance must be from {LEAST_TOLERANCE:g} to {MOST_TOLERANCE:g}, got {tolerance}")
    starts = (np.asarray(x, dtype=np.float64) for x in (steady, displacement, velocity))
    transients = [_Transient(model, start, tolerance, solver) for model, *start in zip(models, *starts, strict=True)]
    with ThreadPoolExecutor(threads or cores()) as pool:
        for first, count, span, times in _chunks_in_time(duration, sample_rate):
            fresh = slice(0 if first == 0 else 1, count + 1)
            done = zip(*pool.map(lambda each, span=span: each.through(span), transients), strict=True)
            vibration, velocity, evaluations, reached = map(np.array, done)
            sticks = np.array([each.sticks_at(times[fresh]) for each in transients])
            yield Batch(times[fresh], vibration[:, fresh], velocity[:, fresh], evaluations, reached, sticks)


def _check(models: Sequence[Model], solver: str, states: Mapping[str, ArrayLike], threads: int | None) -> None:
    if not models:
        raise ValueError("there are no models to integrate")
    check_solver(solver)
    if len({jax.tree.structure(model) for model in models}) != 1:
        raise ValueError("the models must be of one composition: the same coordinates and effects, with other numbers")
    wanted = (len(models), len(models[0].names))
    for name, value in states.items():
        if np.shape(value) != wanted:
            raise ValueError(f"{name} must be of shape {wanted}, models by coordinates, got {np.shape(value)}")
    if threads is not None and threads < 1:
        raise ValueError(f"there must be a thread at least, got {threads}")


class _Transient:
    """One of them, on its way."""

    def __init__(self, model: Model, start: Sequence[np.ndarray], tolerance: float, solver: str) -> None:
        """Take its steady state, displacement from it and velocity at the start."""
        steady, displacement, velocity = start
        self._state = start_state(model, displacement, velocity)
        self._run = StickSlip(model, steady, np.float64(tolerance), solver, observes=False)
        self._step = first_step(model)
        self._failed = False

    def through(self, span: Span) -> tuple[Any, Any, float, bool]:
        """A chunk: vibration and velocity (CHUNK_SAMPLES + 1, n), evaluations, and whether it reached the end."""
        if self._failed:  # and is not tried again
            nothing = np.full((CHUNK_SAMPLES + 1, len(self._state.vibration)), np.nan)
            return nothing, nothing, 0.0, False
        segment = self._run.through(self._state, span, self._step)
        states, self._state, self._step = segment.states, segment.final, segment.step
        self._failed = not (segment.reached and all(np.isfinite(each).all() for each in jax.tree.leaves(self._state)))
        return states.vibration, states.velocity, count_evaluations(segment, self._run.solvers), not self._failed

    def sticks_at(self, time: np.ndarray) -> np.ndarray:
        """Whether the contact sticks at times (k,) of the last chunk."""
        changes = self._run.changes
        after = [not changes[0][1] if changes else self._run.sticks, *(sticks for _, sticks in changes)]
        return np.array(after)[np.searchsorted([when for when, _ in changes], time, side="right")]
