"""The transient: diffrax's methods in equal chunks, each one compiled call, handed out as they come.

A Python loop over chunks keeps memory flat, lets an interrupted run keep its data, and holds host callbacks out of the
compiled program, which would bar it from the persistent compilation cache.
"""

from collections.abc import Generator
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.errors import JaxRuntimeError
from jax.typing import ArrayLike

from drumsqueal.effects.contact import Observation
from drumsqueal.effects.damping import frictionless_modes
from drumsqueal.errors import IntegrationError
from drumsqueal.kernel import compiled, one_kernel
from drumsqueal.model import Model
from drumsqueal.precision import real
from drumsqueal.runge_kutta import DEFAULT, LOCAL_SHARE, STAGES, is_explicit, make_solver
from drumsqueal.stepping import Stepped, step_through

CHUNK_SAMPLES = 500  # samples a chunk: some 50 ms of computing in the plane, so that Ctrl-C and the bar respond
# Steps a chunk: a run that exceeds it is stuck, and says so. Samples hold two to a period at least, so 500 of them take
# some thousand steps; a tolerance of 1e-13 takes ten times as many, and so do edges.
STEP_BUDGET = 100_000
LEAST_LOCAL = 1e-14  # of the motion, that one step may err; less would be round-off
# A coordinate is resolved at least to this share of what it would do if all vibration energy were in each mode.
COUPLING_SHARE = 1e-3
QUIET = 1e-12  # m; motion below a picometre counts as rest, and is resolved as if it were that large
# Round-offs of the load's forces that a step gathers: a motion is not resolved finer than they let it be.
ROUND_OFF = 16 * np.finfo(np.float64).eps
STICKING = 1e-3  # m/s; friction power over normal force below which a collapsed step means a sticking lining
FIRST_STEP_SHARE = 0.01  # first step over the period of the highest frictionless mode, divided by 2π


class Chunk(NamedTuple):
    """Samples of one chunk: time (k,), displacement and velocity (k, n), observations and energies (k,)."""

    time: np.ndarray
    displacement: np.ndarray
    velocity: np.ndarray
    observation: Observation
    kinetic_energy: np.ndarray
    potential_energy: np.ndarray
    energy_balance_error: np.ndarray
    steps: int
    rejected_steps: int
    evaluations: float  # NaN: not counted, for an implicit method


class State(NamedTuple):
    """Displacement from steady sliding (n,), velocity (n,) and energy fed in so far beyond the stored one (J).

    The solver sees it as one flat array, which takes less than half the time of a tree of three.
    """

    departure: Array
    velocity: Array
    work: Array

    def flat(self) -> Array:
        """One array (2n + 1,)."""
        return jnp.concatenate([self.departure, self.velocity, self.work[None]])

    @staticmethod
    def split(flat: Array) -> "State":
        """From an array (..., 2n + 1)."""
        n = flat.shape[-1] // 2
        return State(flat[..., :n], flat[..., n : 2 * n], flat[..., 2 * n])


class Span(NamedTuple):
    """One chunk in time: its start (s), the interval between samples (s), and how many there are after the first."""

    start: ArrayLike
    interval: ArrayLike
    samples: ArrayLike


class Segment(NamedTuple):
    """What one compiled call leaves: samples, their observations and energies, the last state, and the next step."""

    states: State
    observation: Observation
    kinetic: Array
    potential: Array
    final: State
    step: Array
    steps: Array
    kept: Array
    reached: Array


def integrate(
    model: Model,
    steady: ArrayLike,
    displacement: ArrayLike,
    velocity: ArrayLike,
    *,
    duration: float,
    sample_rate: float,
    tolerance: float,
    solver: str = DEFAULT,
) -> Generator[Chunk]:
    """Integrate M q̈ = Σ Q from a departure (n,) from steady sliding q* (n,) and yield the samples chunk by chunk.

    An adaptive Runge-Kutta method, its error per step measured against the amplitude that the vibration energy gives
    each coordinate. Samples lie at k / sample_rate from 0 to the duration, both included. Raises IntegrationError when
    a chunk fails; all good samples have been yielded by then.
    """
    samples = round(duration * sample_rate)
    steady = real(steady)
    state = State(real(displacement), real(velocity), jnp.zeros(()))
    first_energy = sum(float(e) for e in _energy(model, steady, state))
    step, in_kernel = first_step(model), True
    for first in range(0, samples, CHUNK_SAMPLES):
        count = min(CHUNK_SAMPLES, samples - first)
        # NumPy's numbers go into a compiled call at a tenth of what it takes to make arrays of them.
        span = Span(np.float64(first / sample_rate), np.float64(1 / sample_rate), np.int64(count))
        arguments = (model, steady, state, span, np.float64(tolerance), step, solver)
        try:
            segment = advance(*arguments, in_kernel)
        except JaxRuntimeError:
            # A law of the user's own may call what no kernel can: a matrix product, a sort, a solver of equations.
            if not in_kernel:
                raise
            in_kernel = False
            segment = advance(*arguments, in_kernel)
        chunk = _to_chunk(segment, first_energy, sample_rate, first, count, np.asarray(steady), solver)
        good = np.isfinite(chunk.displacement).all(axis=1) & np.isfinite(chunk.velocity).all(axis=1)
        kept = count + 1 if good.all() else int(np.argmin(good))
        fresh = slice(0 if first == 0 else 1, kept)  # a chunk begins with the last sample of the one before
        if fresh.stop > fresh.start:
            yield _rows(chunk, fresh)
        if kept <= count or not bool(segment.reached):
            raise IntegrationError(_why(segment, chunk, max(kept - 1, 0)))
        state, step = segment.final, segment.step


@compiled
def advance(
    model: Model,
    steady: Array,
    state: State,
    span: Span,
    tolerance: ArrayLike,
    step: Array,
    solver: str = DEFAULT,
    in_kernel: bool = True,
) -> Segment:
    """One chunk; samples past the span's last repeat it, to keep the shapes. `step` (s) is the first to be tried."""
    local = local_tolerance(tolerance, solver)
    scale = resolution(model, state, span, local)
    arguments = (model, steady, state, span, local, step, scale, solver, jnp.asarray(STEP_BUDGET))
    # What is implicit solves equations with a library, which a kernel cannot call.
    in_kernel = in_kernel and is_explicit(solver)
    return one_kernel(advance_scaled, *arguments) if in_kernel else advance_scaled(*arguments)


def local_tolerance(tolerance: ArrayLike, solver: str) -> Array:
    """What one step of a method may err, over the amplitude of the motion."""
    return jnp.maximum(tolerance * LOCAL_SHARE[solver], LEAST_LOCAL)


def resolution(model: Model, state: State, span: Span, local: Array) -> Array:
    """Amplitudes (2n + 1,) that errors are measured against in a chunk; needs eigenvalues, so it is no kernel."""
    return motion_scale(model, state, _quiet(model, jnp.asarray(span.start), local)).flat()


def advance_scaled(
    model: Model,
    steady: Array,
    state: State,
    span: Span,
    local: Array,
    step: Array,
    scale: Array,
    solver: str,
    budget: Array,
) -> Segment:
    """One chunk, with errors measured against `scale` (2n + 1,), in `budget` steps at most."""
    inverse = 1 / scale
    # Time is counted from the start of the chunk: a step is then known to more digits.
    time = jnp.minimum(jnp.arange(CHUNK_SAMPLES + 1), span.samples) * jnp.asarray(span.interval)

    def vector_field(t: Array, scaled: Array) -> Array:
        now = State.split(scaled * scale)
        force, power = model.act(span.start + t, steady + now.departure, now.velocity)
        return State(now.velocity, force / model.mass, power).flat() * inverse

    stepped = step_through(
        make_solver(solver, local, _largest),
        vector_field,
        time,
        state._replace(work=jnp.zeros(())).flat() * inverse,
        step,
        tolerance=local,
        norm=_largest,
        budget=budget,
    )
    return _observed(model, steady, state.work, jnp.asarray(span.start) + time, scale, stepped)


def _observed(model: Model, steady: Array, work: Array, time: Array, scale: Array, stepped: Stepped) -> Segment:
    """The samples in their units, the work from the start of the transient on, and what each of them looks like."""
    states, final = (State.split(ys * scale) for ys in (stepped.samples, stepped.last))
    states, final = (s._replace(work=s.work + work) for s in (states, final))

    def observe(sample: tuple[Array, State]) -> tuple[Observation, Array, Array]:
        t, now = sample
        q = steady + now.departure
        return model.observe(t, q, now.velocity), *model.energy(t, q, now.velocity)

    observation, kinetic, potential = jax.lax.map(observe, (time, states))
    return Segment(
        states, observation, kinetic, potential, final, stepped.step, stepped.steps, stepped.kept, stepped.reached
    )


@jax.jit
def first_step(model: Model) -> Array:
    """A step (s) that resolves the highest frictionless frequency; without any stiffness, one of a microsecond."""
    highest = frictionless_modes(model.mass, model.stiffness)[0][-1]
    return jnp.where(highest > 0, FIRST_STEP_SHARE / jnp.where(highest > 0, highest, 1.0), 1e-6)


def _quiet(model: Model, time: Array, local: Array) -> Array:
    """Amplitude (m) below which motion counts as rest: where round-off of the load's forces exceeds the tolerance."""
    stiffness = model.contact.law.stiffness
    follows = jnp.where(stiffness > 0, model.operation.at(time).preload / jnp.where(stiffness > 0, stiffness, 1.0), 0.0)
    return jnp.maximum(QUIET, ROUND_OFF * follows / local)


def motion_scale(model: Model, state: State, quiet: ArrayLike = QUIET) -> State:
    """Amplitudes that the present vibration energy gives to displacement, velocity (n,) and work, at least `quiet` (m).

    In the mass-normalised modes (ω_j, Φ) of the frictionless shoe, s_j = √((ω_j p_j)² + ṗ_j²) is the amplitude of ṗ_j;
    coordinate i has velocity amplitude Σ |Φ_ij| s_j and displacement amplitude Σ |Φ_ij| s_j/ω_j. Unlike the present
    values they do not pass through zero, so an error relative to them is a fair measure at any phase.
    """
    omega, modes = frictionless_modes(model.mass, model.stiffness)
    highest = jnp.max(omega)
    highest = jnp.where(highest > 0, highest, 1.0)
    shaped = model.mass[:, None] * modes
    position, speed = state.departure @ shaped, state.velocity @ shaped
    amplitude = jnp.sqrt((omega * position) ** 2 + speed**2)
    least = quiet * highest * jnp.sqrt(jnp.max(model.mass))
    total = jnp.sqrt(jnp.sum(amplitude**2) + least**2)
    amplitude = jnp.maximum(amplitude, COUPLING_SHARE * total)
    # A mode without stiffness drifts; it is given the slowest of the other frequencies.
    slowest = jnp.min(jnp.where(omega > 0, omega, highest))
    size = jnp.abs(modes)
    return State(size @ (amplitude / jnp.where(omega > 0, omega, slowest)), size @ amplitude, total**2 / 2)


def _largest(scaled_error: Array) -> Array:
    """Largest error of any coordinate relative to its tolerance.

    The work, the last entry, has no say: it follows from the motion, and beside the drum's power of hundreds of watts
    its round-off would drown a small motion.
    """
    return jnp.max(jnp.abs(scaled_error[:-1]))


@jax.jit
def _energy(model: Model, steady: Array, state: State) -> tuple[Array, Array]:
    return model.energy(0.0, steady + state.departure, state.velocity)


def _to_chunk(
    segment: Segment, first_energy: float, sample_rate: float, first: int, count: int, steady: np.ndarray, solver: str
) -> Chunk:
    states = jax.tree.map(lambda x: np.asarray(x)[: count + 1], segment.states)
    observation = jax.tree.map(lambda x: np.asarray(x)[: count + 1], segment.observation)
    kinetic, potential = (np.asarray(x)[: count + 1] for x in (segment.kinetic, segment.potential))
    return Chunk(
        time=np.arange(first, first + count + 1) / sample_rate,
        displacement=states.departure + steady,
        velocity=states.velocity,
        observation=observation,
        kinetic_energy=kinetic,
        potential_energy=potential,
        energy_balance_error=kinetic + potential - first_energy - states.work,
        steps=int(segment.steps),
        rejected_steps=int(segment.steps - segment.kept),
        # The last stage of a step is the first of the next: one more at the start of the chunk.
        evaluations=int(segment.steps) * STAGES[solver] + 1 if is_explicit(solver) else np.nan,
    )


def _rows(chunk: Chunk, rows: slice) -> Chunk:
    """The chunk's samples in `rows`."""
    return jax.tree.map(lambda x: x[rows] if isinstance(x, np.ndarray) else x, chunk)


def _why(segment: Segment, chunk: Chunk, last: int) -> str:
    """What stopped the integration after the good sample number `last` of the chunk."""
    time = chunk.time[last]
    if bool(segment.reached):
        return f"the motion became infinite or undefined after t = {time:.6g} s"
    collapsed = f"the step size collapsed: {STEP_BUDGET:,} steps were not enough to get past t = {time:.6g} s"
    heat, load = chunk.observation.friction_power[last], chunk.observation.normal_force[last]
    if 0 < heat < STICKING * load:
        return f"{collapsed}, where the lining all but sticks to the drum as a whole"
    return f"{collapsed}; a larger simulate.tolerance may help"
