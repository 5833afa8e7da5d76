"""One chunk of a transient as one compiled call: its samples, and what its steps ask for in slip and in stick."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.physics.effects.damping import frictionless_modes
from drumsqueal.physics.effects.effect import Observation
from drumsqueal.physics.model import Model
from drumsqueal.programs import Program, compiled, kernel_of, one_kernel
from drumsqueal.solve.transient.events import TIMING, Attempt, SlipStep, fraction_to_release, fraction_to_stick
from drumsqueal.solve.transient.runge_kutta import DEFAULT, DIFFRAX, Stages, is_explicit, make_solver
from drumsqueal.solve.transient.state import (
    CHUNK_SAMPLES,
    MotionScale,
    Span,
    State,
    highest,
    local_tolerance,
    resolution,
)
from drumsqueal.solve.transient.stepping import Stepped, step_through
from drumsqueal.solve.transient.sticking import (
    StictionMargin,
    drum_motion,
    fastest_while_stuck,
    rigid_rotation,
    slip,
    slip_acceleration,
    slip_alone,
    slip_motion,
    stiction,
    stiction_margin,
    stuck_model,
)

AWAY = 2.0  # times the slip that counts as none: what a lining that cannot stick goes on with


class Phase(NamedTuple):
    """What steps ask for while the lining slips, or while it sticks, with states in units of `scale` (2n + m + 1,).

    Errors are measured against the motion that it begins with (`first`, scaled) or has come to. Where the lining could
    stick, `slip_tolerance` times what such a motion slips counts as none; `stuck` is None where it slips in any case.
    """

    model: Model
    steady: Array
    span: Span
    measure: MotionScale
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
        return jax.lax.cond(self.stuck, lambda: sticking(stuck_model(self.model)), lambda: slipping(self.model))

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
            velocity = jnp.where(self.stuck, velocity + rigid_rotation(self.model), velocity)
        return self.model.kinks(self.at(time), self.steady + now.vibration, velocity, now.memory)

    def least_slip(self, scaled: Array) -> Array:
        """Slip speed (m/s) below which nothing counts as slipping."""
        assert self.slip_tolerance is not None
        velocity = self.split(scaled).velocity
        # Slip below the tolerance of the vibration's own counts as none: there the lining sticks, or it slips on.
        return self.slip_tolerance * slip_alone(self.model, velocity, self.span.start)

    def halts(self, time: Array, scaled: Array) -> Array:
        """Whether hardly anything slips any more."""
        least = self.least_slip(jnp.maximum(self.amplitudes(scaled), self.first))
        ends = slip(self.model, self.at(time), self.split(scaled).velocity) < least
        return ends if self.stuck is None else ends & ~self.stuck

    def fraction_to_stop(self, attempt: Attempt) -> Array:
        """Fraction of a step after which hardly anything slips, or friction ceases to hold; 1 where neither happens."""
        if self.stuck is None:
            return self._rests(attempt)
        return jax.lax.cond(self.stuck, self._gives_way, self._rests, attempt)

    def _rests(self, attempt: Attempt) -> Array:
        least = self.least_slip(jnp.maximum(self.amplitudes(attempt.after), self.first))
        size = State.split(self.scale, len(self.model.remembered)).velocity
        velocity = lambda scaled: self.split(scaled).velocity  # noqa: E731
        return stick_event(self.model, attempt, self.at, velocity, size, least)

    def _gives_way(self, attempt: Attempt) -> Array:
        def motion(time: Array) -> tuple[Array, Array, Array, Array | None]:
            now, there = self.split(attempt.inside(time)), jax.lax.stop_gradient(time)
            # What is prescribed is looked at from within its piece, but goes on with time all the same.
            moment = jax.lax.stop_gradient(self.at(jnp.clip(there, *attempt.piece))) + (time - there)
            return moment, self.steady + now.vibration, now.velocity, now.memory

        def look(time: Array, near: Array | None) -> StictionMargin:
            return stiction_margin(self.model, motion, time, near)

        return fraction_to_release(attempt, look, fastest_while_stuck(self.model), TIMING * self.span.length)

    def changed(self, time: Array, scaled: Array, halted: Array) -> tuple[Array, Array]:
        """The state to go on with, and whether the lining sticks from then on."""
        assert self.stuck is not None
        stuck, now, moment = self.stuck, self.split(scaled), self.at(time)
        together = drum_motion(self.model, moment, now.velocity)

        def change() -> tuple[Array, Array]:
            q = self.steady + now.vibration
            found = stiction(self.model, moment, q, now.velocity, now.memory, stuck)
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
            return jnp.stack(jax.tree.leaves(model.observe(t, q, now.velocity, now.memory)))

        energies = jnp.stack(self.model.energy(t, q, now.velocity))
        return jnp.concatenate([flat, self.either(observed, observed), energies])


def stick_event(
    model: Model,
    attempt: Attempt,
    at: Callable[[Array], ArrayLike],
    velocity: Callable[[Array], Array],
    size: Array,
    least: Array,
) -> Array:
    """Fraction of a step after which no part of the contact slips faster than `least` (m/s); 1 where that is never so.

    `at` gives the time at which to ask for what is prescribed, and `velocity` that (n,) of a scaled state or slope; in
    units of `size` (n,) coordinates are alike.
    """
    length, middle = attempt.end - attempt.start, (attempt.start + attempt.end) / 2

    def motion(time: Array, scaled: Array) -> Array:
        return slip_motion(model, at(time), velocity(scaled)) / size

    def inside(fraction: Array) -> Array:
        time = attempt.start + fraction * length
        return motion(time, attempt.inside(time))

    changes = (
        length * slip_acceleration(model, at(middle), velocity(slope)) / size
        for slope in (attempt.slope_before, attempt.slope_after)
    )
    step = SlipStep(motion(attempt.start, attempt.before), motion(attempt.end, attempt.after), *changes)
    return fraction_to_stick(step, inside, lambda x: slip_alone(model, x * size, at(attempt.start)), least)


# Steps a chunk, and as many again for every 100 radians of the fastest mode: a run that exceeds it is stuck, and is
# reported as failed. 100 radians take some hundred steps; a tolerance of 1e-13 takes ten times as many, and so do
# crossings of contact boundaries.
STEP_BUDGET = 100_000
BUDGET_RADIANS = 100.0
CORNER_BUDGET = 20  # more steps for each corner of what is prescribed: one ends there, and the next ones begin small
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
        """Observation and energies of all samples, one after the other (w, CHUNK_SAMPLES + 1); (0, ...) without."""
        memory = self.final.memory
        return self.rows[:, 2 * self.final.vibration.size + (0 if memory is None else memory.size) + 1 :].T


def no_rows(model: Model, *, observes: bool = True) -> np.ndarray:
    """Rows of samples that no segment has reached yet."""
    looks = Observation.width(model.contact.shoes) + 2
    return np.full((CHUNK_SAMPLES + 1, _width(model) + observes * looks), np.nan)


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
    in_loop = in_kernel and model.contact.cell_axes == 2 and is_explicit(solver)
    run = one_kernel if in_kernel and not in_loop else _plainly
    now, scale, first = run(
        _stepped, model, steady, state, span, local, step, measure, corners, jnp.asarray(budget), slip_tolerance, stuck,
        jnp.asarray(halted), solver, most_changes, in_loop,
    )  # fmt: skip
    # Apart from the steps: a kernel of twice the size takes four times as long to compile. Of a body that bends rates
    # are one kernel in any case: as a chain of kernels its steps take up to 2.4 times as long.
    record = kernel_of if in_kernel else _plainly
    rows = record(_with_rows, model, steady, state.work, span, measure, scale, stuck, first, now, rows)
    numbers = (
        now.time, now.step, now.steps, now.kept, now.time >= jnp.minimum(span.until, span.length), now.halted,
        jnp.zeros(()) if now.sticks is None else now.sticks, now.changed,
    )  # fmt: skip
    ends = jnp.stack([jnp.asarray(each, float) for each in numbers])
    final = State.split(now.state * scale, len(model.remembered))
    return rows, jnp.concatenate([final._replace(work=final.work + state.work).flat(), ends]), now.changes


def _steps_of(solver: str) -> Callable[..., Stepped]:
    """Our own loop, or diffrax's."""
    if not solver.startswith(DIFFRAX):
        return step_through
    from drumsqueal.solve.transient.through_diffrax import through_diffrax  # as in make_solver

    return through_diffrax


def _plainly(function: Callable[..., Any], *arguments: Any) -> Any:
    return function(*arguments)


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


def _stepped(
    model: Model,
    steady: Array,
    state: State,
    span: Span,
    local: Array,
    step: Array,
    measure: MotionScale,
    corners: Array | None,
    budget: Array,
    slip_tolerance: Array | None,
    stuck: Array | None,
    halted: Array,
    solver: str,
    most_changes: int,
    in_loop: bool,
) -> tuple[_Now, Array, Array]:
    """Where a chunk ends with its samples, phase by phase, each with errors of its own measure; scale, first sample.

    The stages of a step are a kernel each where the loop about them is none.
    """
    # Powers of two, so that no state changes by rounding when it is scaled: what rests does not creep.
    scale = jnp.ldexp(1.0, jnp.frexp(measure.amplitudes(model, state).flat())[1] - 1)
    slipping = Phase(model, steady, span, measure, scale, 1 / scale, scale, slip_tolerance, stuck)
    # Time is counted from the start of the chunk: a step is then known to more digits.
    times, end, places = span.grid, jnp.minimum(span.until, span.length), jnp.arange(CHUNK_SAMPLES + 1)

    def go(now: _Now) -> _Now:
        phase = slipping._replace(first=slipping.amplitudes(now.state), stuck=now.sticks)
        begins = now.time == 0  # and the first sample is what it begins with, after a change
        has_kinks = is_explicit(solver) and jax.eval_shape(phase.kinks, now.time, now.state).size > 0
        stepped = _steps_of(solver)(
            make_solver(solver, phase.stages(local), in_loop), phase.slope, times, now.state, now.step, tolerance=local,
            norm=_largest, budget=budget[0], pace=budget[1] * highest(measure.omega) / BUDGET_RADIANS,
            halts=None if slip_tolerance is None else phase.halts,
            fraction_to_stop=None if slip_tolerance is None else phase.fraction_to_stop,
            kinks=phase.kinks if has_kinks else None,
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
    return now, scale, first


def _with_rows(
    model: Model,
    steady: Array,
    work: Array,
    span: Span,
    measure: MotionScale,
    scale: Array,
    stuck: Array | None,
    first: Array,
    now: _Now,
    rows: Array,
) -> Array:
    """Rows with those of the samples from the `first` on; `work` (J) was done before the chunk."""
    phase, times = Phase(model, steady, span, measure, scale, 1 / scale, scale, None, stuck), span.grid
    observes = rows.shape[1] > scale.size

    def record(k: Array, rows: Array) -> Array:
        there = phase if stuck is None else phase._replace(stuck=now.stuck[k])
        return rows.at[k].set(there.row(times[k], now.samples[k], work, observes))

    return jax.lax.fori_loop(first, now.sampled, record, rows)


@Program
def first_step(model: Model) -> Array:
    """A step (s) that resolves the highest frictionless frequency; without any stiffness, one of a microsecond."""
    highest = jnp.max(jnp.abs(frictionless_modes(model.mass, model.stiffness)[0]))
    return jnp.where(highest > 0, FIRST_STEP_FRACTION / jnp.where(highest > 0, highest, 1.0), 1e-6)


def _largest(scaled_error: Array) -> Array:
    """Largest error of any coordinate relative to its tolerance.

    The work, the last entry, is ignored: it follows from the motion, and next to the drum's power of hundreds of watts
    its round-off would drown a small motion.
    """
    return jnp.max(jnp.abs(scaled_error[:-1]))
