"""One chunk of a transient as one compiled call: its state, what its errors are measured against, and its samples."""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.physics.bodies.body import scalars
from drumsqueal.physics.effects.damping import frictionless_modes
from drumsqueal.physics.effects.effect import Observation
from drumsqueal.physics.effects.pressure import yielding
from drumsqueal.physics.kernel import compiled, one_kernel
from drumsqueal.physics.model import Model
from drumsqueal.programs import Program
from drumsqueal.solve.transient.passing import Step, fraction_to_rest
from drumsqueal.solve.transient.runge_kutta import DEFAULT, LOCAL_FRACTION, Stages, is_explicit, make_solver
from drumsqueal.solve.transient.state import Span, State
from drumsqueal.solve.transient.stepping import Attempt, step_through
from drumsqueal.solve.transient.sticking import slip, slip_acceleration, slip_motion

# Steps a chunk, and as many again for every 100 radians of the fastest mode: a run that exceeds it is stuck, and is
# reported as failed. 100 radians take some hundred steps; a tolerance of 1e-13 takes ten times as many, and so do
# crossings of contact boundaries.
STEP_BUDGET = 100_000
BUDGET_RADIANS = 100.0
CORNER_BUDGET = 20  # more steps for each corner of what is prescribed: one ends there, and the next ones begin small
LEAST_LOCAL = 1e-14  # of the motion, that one step may err; less would be round-off
# A coordinate is resolved at least to this fraction of what it would do if all vibration energy were in each mode.
COUPLING_FRACTION = 1e-3
QUIET = 1e-12  # m; motion below a picometre counts as rest, and is resolved as if it were that large
# Round-offs of the load's forces that a step gathers: a motion is not resolved finer than they let it be.
ROUND_OFF = 16 * np.finfo(np.float64).eps
# Slip below this many tolerances of the vibration's own counts as none: there the lining sticks, or it slips on.
SLIP_FRACTION = 1.0
FIRST_STEP_FRACTION = 0.01  # first step over the period of the highest frictionless mode, divided by 2π


class Segment(NamedTuple):
    """What one compiled call leaves: samples, their observations and energies, the last state, and the next step.

    `time` (s) is that of the last state after the start of the chunk, `halted` whether slip all but vanished
    there or, of a lining that sticks, friction gave way. Observations and energies are None where nobody asks for them.
    """

    states: State
    observation: Observation | None
    kinetic: Any  # arrays of JAX, or of NumPy once they are out of its hands
    potential: Any
    final: State
    time: Any
    step: Any
    steps: Any
    kept: Any
    reached: Any
    halted: Any

    def packed(self) -> tuple[Array, Array]:
        """All numbers: a row for each sample, and what there is one of."""
        numbers = (self.time, self.step, self.steps, self.kept, self.reached, self.halted)
        rows = jax.vmap(State.flat)(self.states)
        if self.observation is not None:
            looks = jnp.stack([*self.observation, self.kinetic, self.potential], axis=1)
            rows = jnp.concatenate([rows, looks], axis=1)
        return rows, jnp.concatenate([self.final.flat(), jnp.stack([jnp.asarray(x, float) for x in numbers])])

    @staticmethod
    def unpacked(rows: Any, end: Any, remembered: int) -> "Segment":
        """The segment as NumPy's arrays, from `packed` ones, with so many numbers that effects remember."""
        *final, time, step, steps, kept, reached, halted = end
        states, looks = rows[:, : len(final)], rows[:, len(final) :].T
        observed = (Observation(*looks[:-2]), looks[-2], looks[-1]) if looks.size else (None, None, None)
        return Segment(
            State.split(states, remembered), *observed, State.split(end[: len(final)], remembered), time, step,
            np.int64(steps), np.int64(kept), np.bool_(reached), np.bool_(halted),
        )  # fmt: skip


def advance(model: Model, *arguments: Any, **how: Any) -> Segment:
    """One chunk by `advance_packed`: an array of its own for each of its numbers takes as long as a hundred steps."""
    rows, end = map(np.asarray, advance_packed(model, *arguments, **how))
    return Segment.unpacked(rows, end, len(model.remembered))


@compiled
def advance_packed(
    model: Model,
    steady: Array,
    state: State,
    span: Span,
    tolerance: ArrayLike,
    step: Array,
    solver: str = DEFAULT,
    in_kernel: bool = True,
    sticks: bool = False,
    budget: Any = None,
    observes: bool = True,
) -> tuple[Array, Array]:
    """One chunk, packed; samples past the span's last repeat it, to keep the shapes. `step` (s) is tried first.

    `budget` is as `advance_scaled` takes it, STEP_BUDGET twice unless given. Where the lining `sticks`, in that it
    could, it ends early where hardly any of it slips. It `observes` its samples, or leaves that out.
    """
    local = local_tolerance(tolerance, solver)
    measure, corners = resolution(model, span, local), model.operation.corners
    budget = np.full(2, float(STEP_BUDGET)) if budget is None else budget
    limits = jnp.asarray(budget), jnp.asarray(tolerance) if sticks else None

    def chunk(*arguments: Any) -> tuple[Array, Array]:
        return advance_scaled(*arguments).packed()

    run = partial(one_kernel, chunk) if in_kernel else chunk
    return run(model, steady, state, span, local, step, measure, corners, solver, *limits, observes)


@compiled
def slip_and_least(model: Model, state: State, span: Span, tolerance: ArrayLike) -> Array:
    """Slip speed where the span is entered and the one below which nothing counts as slipping, (2,) in m/s."""
    local = local_tolerance(tolerance, DEFAULT)
    size = resolution(model, span, local).amplitudes(model, state)
    least = SLIP_FRACTION * jnp.asarray(tolerance) * _slip_of(model, span, size.velocity)
    return jnp.stack([slip(model, span.now, jnp.asarray(state.velocity)), least])


def _slip_of(model: Model, span: Span, velocity: Array) -> Array:
    """Slip speed (m/s) that a velocity (n,) makes on a drum at rest."""
    still = model.operation.at(jnp.asarray(span.start))._replace(drum_speed=jnp.zeros(()))
    return model.contact.fastest_slip(still, scalars(velocity))


def local_tolerance(tolerance: ArrayLike, solver: str) -> Array:
    """What one step of a method may err, over the amplitude of the motion."""
    return jnp.maximum(tolerance * LOCAL_FRACTION[solver], LEAST_LOCAL)


class Resolution(NamedTuple):
    """What motion is measured by: frictionless frequencies (n,) in rad/s, mass-normalised modes (n, n), least speed.

    That is the speed of a mass-normalised mode (m/s √kg) that vibrates at the highest frequency as little as rest does.
    """

    omega: Array
    modes: Array
    least: Array

    def amplitudes(self, model: Model, state: State) -> State:
        """Amplitudes that the present vibration energy gives to displacement, velocity (n,) and work.

        In the mass-normalised modes (ω_j, Φ) of the frictionless shoe, s_j = √((ω_j p_j)² + ṗ_j²) is the amplitude of
        ṗ_j; coordinate i has velocity amplitude Σ |Φ_ij| s_j and displacement amplitude Σ |Φ_ij| s_j/ω_j. Unlike the
        present values they do not pass through zero, so an error relative to them is a fair measure at any phase.
        """
        shaped = model.mass[:, None] * self.modes
        position, speed = (jnp.sum(x[:, None] * shaped, axis=0) for x in (state.vibration, state.velocity))
        amplitude = jnp.sqrt((self.omega * position) ** 2 + speed**2)
        total = jnp.sqrt(jnp.sum(amplitude**2) + self.least**2)
        amplitude = jnp.maximum(amplitude, COUPLING_FRACTION * total)
        # A mode without stiffness drifts; it is given the slowest of the other frequencies.
        slowest = jnp.min(jnp.where(self.omega > 0, self.omega, _highest(self.omega)))
        size, period = jnp.abs(self.modes), 1 / jnp.where(self.omega > 0, self.omega, slowest)
        return State(
            jnp.sum(size * amplitude * period, axis=1),
            jnp.sum(size * amplitude, axis=1),
            total**2 / 2,
            model.memory_size(state.memory),
        )


def resolution(model: Model, span: Span, local: Array) -> Resolution:
    """What motion is measured by in a chunk; it takes eigenvalues, which no kernel finds."""
    return _resolution(model, _quiet(model, jnp.asarray(span.start), local))


def _resolution(model: Model, quiet: ArrayLike = QUIET) -> Resolution:
    omega, modes = frictionless_modes(model.mass, model.stiffness)
    return Resolution(omega, modes, jnp.asarray(quiet) * _highest(omega) * jnp.sqrt(jnp.max(model.mass)))


def advance_scaled(
    model: Model,
    steady: Array,
    state: State,
    span: Span,
    local: Array,
    step: Array,
    measure: Resolution,
    corners: Array | None,
    solver: str,
    budget: Array,
    slip_tolerance: Array | None = None,
    observes: bool = True,
) -> Segment:
    """One chunk, with errors measured against the motion that it begins with or has come to.

    `budget` (2,) is how many steps it makes at most, and how many more each BUDGET_RADIANS of the fastest mode.

    It ends early where no part of the lining slips faster than `slip_tolerance` times what such a motion does.
    """
    first = measure.amplitudes(model, state).flat()
    # Powers of two, so that no state changes by rounding when it is scaled: what rests does not creep.
    scale = jnp.ldexp(1.0, jnp.frexp(first)[1] - 1)
    inverse = 1 / scale
    split = partial(State.split, remembered=len(model.remembered))
    # Time is counted from the start of the chunk: a step is then known to more digits.
    time = span.grid

    def vector_field(t: Array, scaled: Array) -> Array:
        now = split(scaled * scale)
        force, power, changed = model.rates(
            span.inside(span.start + t), steady + now.vibration, now.velocity, now.memory
        )
        return State(now.velocity, force / model.mass, power, changed).flat() * inverse

    size = split(scale)

    def rates(t: Array, q: Array, x: Array) -> tuple[Array, Array]:
        velocity = x[: q.size] * size.velocity
        memory = None if size.memory is None else x[q.size :] * size.memory
        force, power, changed = model.rates(span.inside(span.start + t), steady + q * size.vibration, velocity, memory)
        accelerations = force / model.mass / size.velocity
        if changed is None or size.memory is None:
            return accelerations, power / size.work
        return jnp.concatenate([accelerations, changed / size.memory]), power / size.work

    def amplitudes(scaled: Array) -> Array:
        """Amplitudes (2n + 1,) of the present motion, scaled."""
        return measure.amplitudes(model, split(scaled * scale)).flat() * inverse

    def least(scaled: Array) -> Array:
        fastest = jnp.maximum(split(amplitudes(scaled) * scale).velocity, split(first).velocity)
        return SLIP_FRACTION * jnp.asarray(slip_tolerance) * _slip_of(model, span, fastest)

    def size_of(scaled: Array) -> Array:
        # A motion that has outgrown the one at the start is measured by itself, at any phase.
        return jnp.maximum(jnp.abs(scaled) + first * inverse, amplitudes(scaled)) - 1

    metric = model.mass * size.velocity**2
    if size.memory is not None:
        metric = jnp.concatenate([metric, jnp.zeros_like(size.memory)])
    stages = Stages(rates, size.velocity / size.vibration, metric, local, size_of)

    def halts(t: Array, scaled: Array) -> Array:
        return slip(model, span.inside(span.start + t), split(scaled * scale).velocity) < least(scaled)

    def passes(attempt: Attempt) -> Array:
        def motion(t: Array, scaled: Array) -> Array:
            return slip_motion(model, span.inside(span.start + t), split(scaled * scale).velocity) / size.velocity

        def inside(fraction: Array) -> Array:
            t = attempt.start + fraction * (attempt.end - attempt.start)
            return motion(t, attempt.inside(t))

        h, now = attempt.end - attempt.start, span.inside(span.start + (attempt.start + attempt.end) / 2)
        changes = (
            h * slip_acceleration(model, now, split(slope).velocity * size.velocity) / size.velocity
            for slope in (attempt.slope_before, attempt.slope_after)
        )
        step = Step(motion(attempt.start, attempt.before), motion(attempt.end, attempt.after), *changes)
        return fraction_to_rest(step, inside, lambda x: _slip_of(model, span, x * size.velocity), least(attempt.after))

    def kinks(t: Array, scaled: Array) -> Array:
        now = split(scaled * scale)
        return model.kinks(span.inside(span.start + t), steady + now.vibration, now.velocity, now.memory)

    has_kinks = jax.eval_shape(kinks, time[0], inverse).size > 0
    stepped = step_through(
        make_solver(solver, stages),
        vector_field,
        time,
        state._replace(work=jnp.zeros(())).flat() * inverse,
        step,
        tolerance=local,
        norm=_largest,
        budget=budget[0],
        pace=budget[1] * _highest(measure.omega) / BUDGET_RADIANS,
        halts=None if slip_tolerance is None else halts,
        passes=None if slip_tolerance is None else passes,
        kinks=kinks if has_kinks and is_explicit(solver) else None,
        size=size_of,
        origin=span.start,
        corners=corners,
    )
    states, final = (split(ys * scale) for ys in (stepped.samples, stepped.last))
    states, final = (s._replace(work=s.work + state.work) for s in (states, final))  # from the start of the transient
    observed = _observed(model, steady, span.inside(span.start + time), states) if observes else (None, None, None)
    return Segment(
        states, *observed, final, stepped.time, stepped.step, stepped.steps, stepped.kept, stepped.reached,
        stepped.halted,
    )  # fmt: skip


def _observed(model: Model, steady: Array, time: Array, states: State) -> tuple[Observation, Array, Array]:
    """What each sample looks like, its kinetic and its potential energy."""

    def observe(sample: tuple[Array, State]) -> tuple[Observation, Array, Array]:
        t, now = sample
        q = steady + now.vibration
        return model.observe(t, q, now.velocity, now.memory), *model.energy(t, q, now.velocity)

    return jax.lax.map(observe, (time, states))


@Program
def first_step(model: Model) -> Array:
    """A step (s) that resolves the highest frictionless frequency; without any stiffness, one of a microsecond."""
    highest = frictionless_modes(model.mass, model.stiffness)[0][-1]
    return jnp.where(highest > 0, FIRST_STEP_FRACTION / jnp.where(highest > 0, highest, 1.0), 1e-6)


def _quiet(model: Model, time: Array, local: Array) -> Array:
    """Amplitude (m) below which motion counts as rest: where round-off of the load's forces exceeds the tolerance."""
    moment, stiffest = model.operation.at(time), jnp.max(jnp.diag(model.stiffness))
    pressed = yielding(model.contact.law, moment.preload)
    # Where it is not the contact that yields under the load, the springs yield to friction.
    sprung = (pressed == 0) & (stiffest > 0)
    drawn = moment.preload * model.body.area / jnp.where(sprung, stiffest, 1.0)
    return jnp.maximum(QUIET, ROUND_OFF * jnp.where(sprung, drawn, pressed) / local)


def motion_scale(model: Model, state: State) -> State:
    """Amplitudes that the present vibration energy gives to displacement, velocity (n,) and work, at least `QUIET`."""
    return _resolution(model).amplitudes(model, state)


@Program
def least_energy(model: Model) -> Array:
    """Vibration energy (J) below which motion counts as rest: that of a picometre of the highest frictionless mode."""
    return _resolution(model).least ** 2 / 2


def _highest(omega: Array) -> Array:
    highest = jnp.max(omega)
    return jnp.where(highest > 0, highest, 1.0)


def _largest(scaled_error: Array) -> Array:
    """Largest error of any coordinate relative to its tolerance.

    The work, the last entry, is ignored: it follows from the motion, and next to the drum's power of hundreds of watts
    its round-off would drown a small motion.
    """
    return jnp.max(jnp.abs(scaled_error[:-1]))
