"""The transient: diffrax in equal chunks, each one compiled call, handed out as they come.

A Python loop over chunks keeps memory flat, lets an interrupted run keep its data, and holds host callbacks out of the
compiled program, which would bar it from the persistent compilation cache.
"""

from collections.abc import Generator
from typing import NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.effects.contact import Observation
from drumsqueal.effects.damping import frictionless_modes
from drumsqueal.errors import IntegrationError
from drumsqueal.model import Model
from drumsqueal.precision import real

SOLVER = diffrax.Dopri8()
CHUNK_SAMPLES = 500  # samples a chunk: some 50 ms of computing in the plane, so that Ctrl-C and the bar respond
# Steps a chunk: a run that exceeds it is stuck, and says so. Samples hold two to a period at least, so 500 of them take
# some thousand steps; a tolerance of 1e-13 takes ten times as many, and so do edges.
STEP_BUDGET = 100_000
# Share of the scene's tolerance that one step may err. Errors add up over some thousand steps.
LOCAL_SHARE = 0.1
# A coordinate is resolved at least to this share of what it would do if all vibration energy were in each mode.
COUPLING_SHARE = 1e-3
# A proportional part in the step-size control halves the rejected steps where edges make kinks.
PROPORTIONAL, INTEGRAL = 0.3, 0.4
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
    evaluations: int


class _State(NamedTuple):
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
    def split(flat: Array) -> "_State":
        """From an array (..., 2n + 1)."""
        n = flat.shape[-1] // 2
        return _State(flat[..., :n], flat[..., n : 2 * n], flat[..., 2 * n])


class _Segment(NamedTuple):
    time: Array
    states: _State
    observation: Observation
    kinetic: Array
    potential: Array
    final: _State
    steps: Array
    accepted: Array
    succeeded: Array
    result: diffrax.RESULTS


def integrate(
    model: Model,
    steady: ArrayLike,
    displacement: ArrayLike,
    velocity: ArrayLike,
    *,
    duration: float,
    sample_rate: float,
    tolerance: float,
) -> Generator[Chunk]:
    """Integrate M q̈ = Σ Q from a departure (n,) from steady sliding q* (n,) and yield the samples chunk by chunk.

    Adaptive Dormand-Prince of order 8 (diffrax), its error per step measured against the amplitude that the vibration
    energy gives each coordinate. Samples lie at k / sample_rate from 0 to the duration, both included. Raises
    IntegrationError when a chunk fails; all good samples have been yielded by then.
    """
    samples = round(duration * sample_rate)
    steady = real(steady)
    state = _State(real(displacement), real(velocity), jnp.zeros(()))
    first_energy = sum(float(e) for e in _energy(model, steady, state))
    step = _first_step(model)
    for first in range(0, samples, CHUNK_SAMPLES):
        count = min(CHUNK_SAMPLES, samples - first)
        segment = _advance(
            model, steady, state, real(first), real(first + count), real(1 / sample_rate), real(tolerance), step
        )
        chunk = _to_chunk(segment, first_energy, sample_rate, first, count, np.asarray(steady))
        good = np.isfinite(chunk.displacement).all(axis=1) & np.isfinite(chunk.velocity).all(axis=1)
        kept = count + 1 if good.all() else int(np.argmin(good))
        fresh = slice(0 if first == 0 else 1, kept)  # a chunk begins with the last sample of the one before
        if fresh.stop > fresh.start:
            yield _rows(chunk, fresh)
        if kept <= count or not bool(segment.succeeded):
            raise IntegrationError(_why(segment, chunk, max(kept - 1, 0)))
        state, step = segment.final, real(count / sample_rate) / segment.accepted


@eqx.filter_jit
def _advance(
    model: Model,
    steady: Array,
    state: _State,
    first: Array,
    last: Array,
    interval: Array,
    tolerance: Array,
    step: Array,
) -> _Segment:
    """One chunk from sample number `first` to `last`; samples past the last repeat it, to keep the shapes."""
    local = tolerance * LOCAL_SHARE
    time = jnp.minimum(first + jnp.arange(CHUNK_SAMPLES + 1), last) * interval
    scale = motion_scale(model, state, _quiet(model, time[0], local)).flat()

    def vector_field(t: ArrayLike, scaled: Array, args: None) -> Array:
        del args
        now = _State.split(scaled * scale)
        force, power = model.act(t, steady + now.departure, now.velocity)
        return _State(now.velocity, force / model.mass, power).flat() / scale

    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(vector_field),
        SOLVER,
        time[0],
        time[-1],
        step,
        state._replace(work=jnp.zeros(())).flat() / scale,
        saveat=diffrax.SaveAt(subs=[diffrax.SubSaveAt(ts=time), diffrax.SubSaveAt(t1=True)]),
        stepsize_controller=diffrax.PIDController(
            rtol=local, atol=local, norm=_largest, pcoeff=PROPORTIONAL, icoeff=INTEGRAL
        ),
        adjoint=diffrax.ForwardMode(),
        max_steps=STEP_BUDGET,
        throw=False,
    )
    assert solution.ys is not None  # for the type checker
    states, final = (_State.split(ys * scale) for ys in (solution.ys[0], solution.ys[1][0]))
    states, final = (s._replace(work=s.work + state.work) for s in (states, final))

    def observe(sample: tuple[Array, _State]) -> tuple[Observation, Array, Array]:
        t, now = sample
        q = steady + now.departure
        return model.observe(t, q, now.velocity), *model.energy(t, q, now.velocity)

    observation, kinetic, potential = jax.lax.map(observe, (time, states))
    succeeded = solution.result == diffrax.RESULTS.successful
    return _Segment(
        time,
        states,
        observation,
        kinetic,
        potential,
        final,
        solution.stats["num_steps"],
        solution.stats["num_accepted_steps"],
        succeeded,
        solution.result,
    )


@jax.jit
def _first_step(model: Model) -> Array:
    """A step (s) that resolves the highest frictionless frequency; without any stiffness, one of a microsecond."""
    highest = frictionless_modes(model.mass, model.stiffness)[0][-1]
    return jnp.where(highest > 0, FIRST_STEP_SHARE / jnp.where(highest > 0, highest, 1.0), 1e-6)


def _quiet(model: Model, time: Array, local: Array) -> Array:
    """Amplitude (m) below which motion counts as rest: where round-off of the load's forces exceeds the tolerance."""
    stiffness = model.contact.law.stiffness
    follows = jnp.where(stiffness > 0, model.operation.at(time).preload / jnp.where(stiffness > 0, stiffness, 1.0), 0.0)
    return jnp.maximum(QUIET, ROUND_OFF * follows / local)


def motion_scale(model: Model, state: _State, quiet: ArrayLike = QUIET) -> _State:
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
    return _State(size @ (amplitude / jnp.where(omega > 0, omega, slowest)), size @ amplitude, total**2 / 2)


def _largest(scaled_error: Array) -> Array:
    """Largest error of any coordinate relative to its tolerance.

    The work, the last entry, has no say: it follows from the motion, and beside the drum's power of hundreds of watts
    its round-off would drown a small motion.
    """
    return jnp.max(jnp.abs(scaled_error[:-1]))


@jax.jit
def _energy(model: Model, steady: Array, state: _State) -> tuple[Array, Array]:
    return model.energy(0.0, steady + state.departure, state.velocity)


def _to_chunk(
    segment: _Segment, first_energy: float, sample_rate: float, first: int, count: int, steady: np.ndarray
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
        rejected_steps=int(segment.steps - segment.accepted),
        # The last stage of a step is the first of the next: one more at the start of the chunk.
        evaluations=int(segment.steps) * (SOLVER.tableau.num_stages - 1) + 1,
    )


def _rows(chunk: Chunk, rows: slice) -> Chunk:
    """The chunk's samples in `rows`."""
    return jax.tree.map(lambda x: x[rows] if isinstance(x, np.ndarray) else x, chunk)


def _why(segment: _Segment, chunk: Chunk, last: int) -> str:
    """What stopped the integration after the good sample number `last` of the chunk."""
    time = chunk.time[last]
    if bool(segment.succeeded):
        return f"the motion became infinite or undefined after t = {time:.6g} s"
    if not bool(segment.result == diffrax.RESULTS.max_steps_reached):
        return f"the solver stopped after t = {time:.6g} s: {diffrax.RESULTS[segment.result]}"
    collapsed = f"the step size collapsed: {STEP_BUDGET:,} steps were not enough to get past t = {time:.6g} s"
    heat, load = chunk.observation.friction_power[last], chunk.observation.normal_force[last]
    if 0 < heat < STICKING * load:
        return f"{collapsed}, where the lining all but sticks to the drum as a whole"
    return f"{collapsed}; a larger simulate.tolerance may help"
