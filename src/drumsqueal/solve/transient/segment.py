"""One chunk of a transient as one compiled call: its state, what its errors are measured against, and its samples."""

from collections.abc import Callable
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
from drumsqueal.solve.transient.state import CHUNK_SAMPLES, Span, State
from drumsqueal.solve.transient.stepping import Attempt, step_through
from drumsqueal.solve.transient.sticking import (
    decide,
    drum_motion,
    following,
    held,
    reserve,
    slip,
    slip_acceleration,
    slip_motion,
)

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
AWAY = 2.0  # times the slip that counts as none: what a lining that cannot stick goes on with
TIMING = 1e-12  # of a chunk: how well the end of sticking is found
FIRST_STEP_FRACTION = 0.01  # first step over the period of the highest frictionless mode, divided by 2π


class Segment(NamedTuple):
    """What one compiled call leaves: rows of samples, the last state, the next step, and what happened.

    A row (CHUNK_SAMPLES + 1, w) has the state, then its observation, kinetic and potential energy where these are asked
    for; NaN where not reached. `time` (s) is that of the last state after the start of the chunk, where the lining
    `sticks` or not; `halted` whether slip all but vanished there, or friction gave way. `changes` (c,) are the times
    (s after the start of the chunk) at which it came to stick or to slip, in turn.
    """

    rows: np.ndarray
    final: State
    time: float
    step: Any  # a number of NumPy, which goes into the next call as it is
    steps: int
    kept: int
    reached: bool
    halted: bool
    sticks: bool
    changes: np.ndarray

    @staticmethod
    def unpacked(model: Model, rows: Array, end: Array, changes: Array) -> "Segment":
        """The segment of what `advance_packed` gives."""
        numbers, remembered = np.asarray(end), len(model.remembered)
        n = _width(model)
        time, step, steps, kept, reached, halted, sticks, changed = numbers[n:]  # of NumPy
        return Segment(
            np.asarray(rows), State.split(numbers[:n], remembered), time, step, int(steps), int(kept), bool(reached),
            bool(halted), bool(sticks), np.asarray(changes)[: int(changed)],
        )  # fmt: skip

    @property
    def states(self) -> State:
        """The state at each sample."""
        memory = self.final.memory
        remembered = 0 if memory is None else memory.size
        return State.split(self.rows[:, : 2 * self.final.vibration.size + remembered + 1], remembered)

    @property
    def looks(self) -> np.ndarray:
        """Observation and energies of all samples, one after the other (9, CHUNK_SAMPLES + 1); (0, ...) without."""
        memory = self.final.memory
        return self.rows[:, 2 * self.final.vibration.size + (0 if memory is None else memory.size) + 1 :].T


def no_rows(model: Model, *, observes: bool = True) -> np.ndarray:
    """Rows of samples that no segment has reached yet."""
    return np.full((CHUNK_SAMPLES + 1, _width(model) + observes * (len(Observation._fields) + 2)), np.nan)


def _width(model: Model) -> int:
    return 2 * len(model.names) + len(model.remembered) + 1


def advance(model: Model, *arguments: Any, **how: Any) -> Segment:
    """One chunk by `advance_packed`: an array of its own for each of its numbers takes as long as a hundred steps."""
    return Segment.unpacked(model, *advance_packed(model, *arguments, **how))


@compiled
def advance_packed(
    model: Model,
    steady: Array,
    state: State,
    span: Span,
    tolerance: ArrayLike,
    step: Array,
    budget: Any,
    rows: Array,
    sticks: Any = np.False_,
    halted: Any = np.False_,
    solver: str = DEFAULT,
    in_kernel: bool = True,
    could_stick: bool = False,
    most_changes: int = 0,
) -> tuple[Array, Array, Array]:
    """One chunk, packed: the rows with those that it adds, all that there is one of, and times of changes.

    `budget` (2,) is how many steps it makes at most from change to change, and how many more each BUDGET_RADIANS of the
    fastest mode; `step` (s) is tried first. Where the lining `could_stick`, it ends early where hardly any of it slips,
    unless it goes on through some changes. It then begins as one that `sticks` or not, `halted` at such an end or not.
    """
    local = local_tolerance(tolerance, solver)
    measure, corners = resolution(model, span, local), model.operation.corners
    slip_tolerance = jnp.asarray(tolerance) if could_stick else None
    stuck = jnp.asarray(sticks) if most_changes else None
    run = partial(one_kernel, advance_scaled) if in_kernel else advance_scaled
    return run(
        model, steady, state, span, local, step, measure, corners, jnp.asarray(budget), rows, slip_tolerance, stuck,
        jnp.asarray(halted), solver, most_changes,
    )  # fmt: skip


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


class _Phase(NamedTuple):
    """What steps ask for while the lining slips, or while it sticks, with states in units of `scale` (2n + m + 1,).

    Errors are measured against the motion that it begins with (`first`, scaled) or has come to. Where the lining could
    stick, `slip_tolerance` times what such a motion slips counts as none; `stuck` is None where it slips in any case.
    """

    model: Model
    steady: Array
    span: Span
    measure: Resolution
    scale: Array
    inverse: Array
    first: Array
    slip_tolerance: Array | None
    stuck: Array | None

    def at(self, time: Array) -> Array:
        """A time (s after the start of the chunk) as one at which to ask for what is prescribed."""
        return self.span.inside(self.span.start + time)

    def split(self, scaled: Array) -> State:
        """The state that is scaled so, or has been without units."""
        return State.split(scaled * self.scale, len(self.model.remembered))

    def either(self, sticking: Callable[[Model], Any], slipping: Callable[[Model], Any]) -> Any:
        """What holds while the lining sticks, or while it slips."""
        if self.stuck is None:
            return slipping(self.model)
        return jax.lax.cond(self.stuck, lambda: sticking(held(self.model)), lambda: slipping(self.model))

    def rates(self, time: Array, now: State) -> tuple[Array, Array, Array | None]:
        """Accelerations (n,), power beyond the stored energy and rate of the memory."""

        def act(model: Model) -> tuple[Array, Array, Array | None]:
            force, power, changed = model.rates(self.at(time), self.steady + now.vibration, now.velocity, now.memory)
            return force / model.mass, power, changed

        return self.either(act, act)

    def slope(self, time: Array, scaled: Array) -> Array:
        """Rate of the scaled state."""
        now = self.split(scaled)
        acceleration, power, changed = self.rates(time, now)
        return State(now.velocity, acceleration, power, changed).flat() * self.inverse

    def stages(self, local: Array) -> Stages:
        """What an implicit method asks for."""
        size = State.split(self.scale, len(self.model.remembered))

        def rates(time: Array, q: Array, x: Array) -> tuple[Array, Array]:
            now = self.split(jnp.concatenate([q, x, jnp.zeros(1)]))
            acceleration, power, changed = self.rates(time, now)
            scaled = [acceleration / size.velocity]
            if changed is not None and size.memory is not None:
                scaled.append(changed / size.memory)
            return jnp.concatenate(scaled), power / size.work

        metric = self.model.mass * size.velocity**2
        if size.memory is not None:
            metric = jnp.concatenate([metric, jnp.zeros_like(size.memory)])
        return Stages(rates, size.velocity / size.vibration, metric, local, self.size_of)

    def amplitudes(self, scaled: Array) -> Array:
        """Amplitudes of the present motion, scaled."""
        return self.measure.amplitudes(self.model, self.split(scaled)).flat() * self.inverse

    def size_of(self, scaled: Array) -> Array:
        """What errors are measured against, less one; a motion that has outgrown the first one by itself."""
        return jnp.maximum(jnp.abs(scaled) + self.first, self.amplitudes(scaled)) - 1

    def kinks(self, time: Array, scaled: Array) -> Array:
        """Numbers of which one changes its sign where the force has a kink."""
        now = self.split(scaled)
        velocity = now.velocity
        if self.stuck is not None:  # the signs of a slip that is zero but for round-off say nothing
            velocity = jnp.where(self.stuck, velocity + following(self.model), velocity)
        return self.model.kinks(self.at(time), self.steady + now.vibration, velocity, now.memory)

    def least_slip(self, scaled: Array) -> Array:
        """Slip speed (m/s) below which nothing counts as slipping."""
        assert self.slip_tolerance is not None
        velocity = self.split(scaled).velocity
        return SLIP_FRACTION * self.slip_tolerance * _slip_of(self.model, self.span, velocity)

    def halts(self, time: Array, scaled: Array) -> Array:
        """Whether hardly anything slips any more."""
        least = self.least_slip(jnp.maximum(self.amplitudes(scaled), self.first))
        ends = slip(self.model, self.at(time), self.split(scaled).velocity) < least
        return ends if self.stuck is None else ends & ~self.stuck

    def passes(self, attempt: Attempt) -> Array:
        """Fraction of a step after which hardly anything slips, or friction ceases to hold; 1 where neither happens."""
        if self.stuck is None:
            return self._rests(attempt)
        return jax.lax.cond(self.stuck, self._gives_way, self._rests, attempt)

    def _rests(self, attempt: Attempt) -> Array:
        size, h = State.split(self.scale, len(self.model.remembered)).velocity, attempt.end - attempt.start

        def motion(time: Array, scaled: Array) -> Array:
            return slip_motion(self.model, self.at(time), self.split(scaled).velocity) / size

        def inside(fraction: Array) -> Array:
            time = attempt.start + fraction * h
            return motion(time, attempt.inside(time))

        middle = self.at((attempt.start + attempt.end) / 2)
        changes = (
            h * slip_acceleration(self.model, middle, self.split(slope).velocity) / size
            for slope in (attempt.slope_before, attempt.slope_after)
        )
        step = Step(motion(attempt.start, attempt.before), motion(attempt.end, attempt.after), *changes)
        least = self.least_slip(jnp.maximum(self.amplitudes(attempt.after), self.first))
        return fraction_to_rest(step, inside, lambda x: _slip_of(self.model, self.span, x * size), least)

    def _gives_way(self, attempt: Attempt) -> Array:
        """By a look each interval of the samples, and then by false position (Illinois)."""
        length, apart = attempt.end - attempt.start, TIMING * self.span.length

        def to_spare(time: Array, near: Array) -> tuple[Array, Array]:
            now, moment = self.split(attempt.inside(time)), self.at(jnp.clip(time, *attempt.piece))
            velocity = drum_motion(self.model, moment, now.velocity)
            found, weakest = reserve(self.model, moment, self.steady + now.vibration, velocity, now.memory, near)
            return jnp.maximum(1 - 1 / found, -1.0), weakest

        def look(now: _Look) -> _Look:
            value, weakest = to_spare(now.time, now.weakest)
            holds, bracketed = ~(value < 0), jnp.isfinite(now.high)
            low, high = jnp.where(holds, now.time, now.low), jnp.where(holds, now.high, now.time)
            at_low = jnp.where(holds, value, jnp.where(bracketed, now.at_low / 2, now.at_low))
            at_high = jnp.where(holds, jnp.where(bracketed, now.at_high / 2, now.at_high), value)
            secant = jnp.clip(low + (high - low) * at_low / (at_low - at_high) + apart / 2, low, high)
            ahead = jnp.minimum(now.time + self.span.interval, attempt.end)
            return _Look(low, at_low, high, at_high, jnp.where(jnp.isfinite(high), secant, ahead), weakest)

        def unfinished(now: _Look) -> Array:
            return jnp.where(jnp.isfinite(now.high), now.high - now.low > apart, now.low < attempt.end)

        one, infinity = jnp.ones(()), jnp.full((), jnp.inf)
        nearest = jax.eval_shape(to_spare, attempt.start, None)[1]
        first = _Look(attempt.start, one, infinity, -one, attempt.start, jnp.zeros(nearest.shape))
        found = jax.lax.while_loop(unfinished, look, first).high
        fraction = jnp.maximum(found - attempt.start, apart) / length
        return jnp.where(jnp.isfinite(found), jnp.minimum(fraction, 1 - np.finfo(np.float64).epsneg), 1.0)

    def changed(self, time: Array, scaled: Array, halted: Array) -> tuple[Array, Array]:
        """The state to go on with, and whether the lining sticks from then on."""
        assert self.stuck is not None
        stuck, now, moment = self.stuck, self.split(scaled), self.at(time)
        together = drum_motion(self.model, moment, now.velocity)

        def change() -> tuple[Array, Array]:
            q = self.steady + now.vibration
            found = decide(self.model, moment, q, now.velocity, now.memory, stuck)
            sticks, least = ~stuck & (found.reserve >= 1), self.least_slip(self.amplitudes(scaled))
            return together + jnp.where(sticks, 0.0, AWAY * least) * found.direction, sticks

        velocity, sticks = jax.lax.cond(halted, change, lambda: (jnp.where(stuck, together, now.velocity), stuck))
        return now._replace(velocity=velocity).flat() * self.inverse, sticks

    def row(self, time: Array, scaled: Array, work: Array, observes: bool) -> Array:
        """What is recorded at a sample, with the work that was done before the chunk."""
        now, t = self.split(scaled), self.at(time)
        if self.stuck is not None:
            now = now._replace(velocity=jnp.where(self.stuck, drum_motion(self.model, t, now.velocity), now.velocity))
        q, flat = self.steady + now.vibration, now._replace(work=now.work + work).flat()
        if not observes:
            return flat

        def observed(model: Model) -> Array:
            return jnp.stack(model.observe(t, q, now.velocity, now.memory))

        energies = jnp.stack(self.model.energy(t, q, now.velocity))
        return jnp.concatenate([flat, self.either(observed, observed), energies])


class _Look(NamedTuple):
    """Times between which friction ceases to hold, what it has to spare at them, the next time, and a motion."""

    low: Array
    at_low: Array
    high: Array
    at_high: Array
    time: Array
    weakest: Array


class _Now(NamedTuple):
    """A chunk between two phases; `stuck` (k,) says whether the lining stuck at a sample."""

    time: Array
    state: Array
    step: Array
    sampled: Array
    samples: Array
    stuck: Array
    sticks: Array | None
    halted: Array
    phases: Array
    changed: Array
    changes: Array
    steps: Array
    kept: Array


def advance_scaled(
    model: Model,
    steady: Array,
    state: State,
    span: Span,
    local: Array,
    step: Array,
    measure: Resolution,
    corners: Array | None,
    budget: Array,
    rows: Array,
    slip_tolerance: Array | None,
    stuck: Array | None,
    halted: Array,
    solver: str,
    most_changes: int,
) -> tuple[Array, Array, Array]:
    """What `advance_packed` gives, as a kernel can hold it: phase by phase, each with errors of its own measure."""
    # Powers of two, so that no state changes by rounding when it is scaled: what rests does not creep.
    scale = jnp.ldexp(1.0, jnp.frexp(measure.amplitudes(model, state).flat())[1] - 1)
    slipping = _Phase(model, steady, span, measure, scale, 1 / scale, scale, slip_tolerance, stuck)
    # Time is counted from the start of the chunk: a step is then known to more digits.
    times, end, places = span.grid, jnp.minimum(span.until, span.length), jnp.arange(CHUNK_SAMPLES + 1)

    def go(now: _Now) -> _Now:
        phase = slipping._replace(first=slipping.amplitudes(now.state), stuck=now.sticks)
        begins = now.time == 0  # and the first sample is what it begins with, after a change
        stepped = step_through(
            make_solver(solver, phase.stages(local)), phase.slope, times, now.state, now.step, tolerance=local,
            norm=_largest, budget=budget[0], pace=budget[1] * _highest(measure.omega) / BUDGET_RADIANS,
            halts=None if slip_tolerance is None else phase.halts,
            passes=None if slip_tolerance is None else phase.passes,
            kinks=phase.kinks if is_explicit(solver) and _has_kinks(phase, now.state) else None,
            size=phase.size_of, origin=span.start, corners=corners, begin=now.time, end=end,
            halted=now.halted & (now.phases == 0),
            sampled=(now.sampled, jnp.where(begins, now.samples.at[0].set(now.state), now.samples)),
        )  # fmt: skip
        last, sticks, there, changes = stepped.last, now.sticks, now.stuck, now.changes
        if sticks is not None:
            there = jnp.where((places >= jnp.where(begins, 0, now.sampled)) & (places < stepped.sampled), sticks, there)
            last, sticks = phase.changed(stepped.time, last, stepped.halted)
            changes = jnp.where(sticks != now.sticks, changes.at[now.changed].set(stepped.time), changes)
        return _Now(
            stepped.time, last, stepped.step, stepped.sampled, stepped.samples, there, sticks, stepped.halted,
            now.phases + 1, now.changed + (0 if sticks is None else sticks != now.sticks), changes,
            now.steps + stepped.steps, now.kept + stepped.kept,
        )  # fmt: skip

    none, start = jnp.zeros((), int), state._replace(work=jnp.zeros(())).flat() / scale
    if slip_tolerance is not None and stuck is None:
        halted = slipping._replace(first=slipping.amplitudes(start)).halts(span.offset, start)
    first = jnp.where(span.offset > 0, jnp.sum(times <= span.offset), 0)
    now = _Now(
        jnp.asarray(span.offset), start, step, jnp.maximum(first, 1), jnp.full((len(times), start.size), jnp.nan),
        jnp.zeros(len(times), bool), stuck, halted, none, none, jnp.zeros(most_changes), none, none,
    )  # fmt: skip
    if stuck is None:
        now = go(now)
    else:
        # A phase that is over before the end, and not halted, has made all its steps.
        now = jax.lax.while_loop(
            lambda now: (now.time < end) & (now.phases < most_changes) & (now.halted | (now.phases == 0)), go, now
        )

    def record(k: Array, rows: Array) -> Array:
        phase = slipping if stuck is None else slipping._replace(stuck=now.stuck[k])
        observes = rows.shape[1] > start.size
        return rows.at[k].set(phase.row(times[k], now.samples[k], state.work, observes))

    rows = jax.lax.fori_loop(first, now.sampled, record, rows)
    final = slipping.split(now.state)
    numbers = (
        now.time, now.step, now.steps, now.kept, now.time >= end, now.halted,
        jnp.zeros(()) if now.sticks is None else now.sticks, now.changed,
    )  # fmt: skip
    ends = jnp.stack([jnp.asarray(each, float) for each in numbers])
    return rows, jnp.concatenate([final._replace(work=final.work + state.work).flat(), ends]), now.changes


def _has_kinks(phase: _Phase, state: Array) -> bool:
    return jax.eval_shape(phase.kinks, jnp.zeros(()), state).size > 0


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
