"""What steps of a transient ask for while the lining slips, or while it sticks."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.physics.model import Model
from drumsqueal.solve.transient.events import TIMING, Attempt, SlipStep, fraction_to_release, fraction_to_stick
from drumsqueal.solve.transient.resolution import MotionScale
from drumsqueal.solve.transient.runge_kutta import Stages
from drumsqueal.solve.transient.state import Span, State
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

    def passes(self, attempt: Attempt) -> Array:
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
