"""A stretch of motion that slips or sticks throughout, with its tangents, by the variational equations.

The tangents are integrated with the motion, step for step by the same method: they are derivatives of the motion as
it was computed, also where contact boundaries appear and vanish.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from drumsqueal.physics.model import Model
from drumsqueal.programs import Program, compiled, kernel_of
from drumsqueal.solve.transient.events import TIMING, Attempt, fraction_to_release
from drumsqueal.solve.transient.phase import stick_event
from drumsqueal.solve.transient.runge_kutta import DEFAULT, make_solver
from drumsqueal.solve.transient.segment import FIRST_STEP_FRACTION, first_step
from drumsqueal.solve.transient.stepping import Stepped, step_through
from drumsqueal.solve.transient.sticking import StuckModel, fastest_while_stuck, slip, stiction_margin

LONGEST_STEP = 25.0  # times the step that a transient begins with, a hundredth of a radian of the fastest mode


class Stretch(NamedTuple):
    """A stretch that slips or sticks throughout: its end, the rate there if a step was made, and when that is (s)."""

    end: Any
    rate: Any
    tangents: Any  # (2n, 2n + 1), the last one of the parameter
    time: Any
    steps: Any
    reached: Any
    halted: Any


@compiled
def follow_stretch(
    model: Model, size: Array, state: Array, duration: Array, local: Array, change: Model, least: Array | None
) -> Stretch:
    """Follow a motion for a duration (s), or until slip is below the `least` speed (m/s) or friction gives way.

    Where `least` is None the motion cannot stick.
    """
    # A motion near rest asks for no short steps, but its tangents do.
    longest = LONGEST_STEP * first_step(model)
    return kernel_of(_followed, model, size, state, duration, local, longest, change, least)


def _followed(
    model: Model,
    size: Array,
    state: Array,
    duration: Array,
    local: Array,
    longest: Array,
    change: Model,
    least: Array | None,
) -> Stretch:
    unknowns = state.size

    def derivatives(state: Array) -> Array:
        """∂ẏ/∂(y, p), direction by direction as rows (2n + 1, 2n)."""

        def along(unit: Array) -> Array:
            changed = jax.tree.map(lambda x: x * unit[-1], change)
            return jax.jvp(lambda model, y: _rate(model, size, y), (model, state), (changed, unit[:-1]))[1]

        return jax.vmap(along)(jnp.eye(unknowns + 1))

    def along(step: Attempt, carried: tuple[Array, Array]) -> tuple[Array, Array]:
        return _pushed(step, carried[0], derivatives, local, longest), step.slope_after

    begin = jnp.eye(unknowns + 1, unknowns), state
    stops: dict[str, Any] = {}
    if least is not None and isinstance(model, StuckModel):
        stops = until_release(model, size, TIMING * duration)
    elif least is not None:
        stops = until_rest(model, size, least)
    times = jnp.stack([jnp.zeros(()), duration])
    limit = _longest_while_stuck(model, duration) if isinstance(model, StuckModel) else longest
    stepped = stepped_through(model, size, state, times, local, longest=limit, along=along, carried=begin, **stops)
    # Tangents come as rows, one for each direction; a derivative has them as columns.
    tangents, rate = stepped.carried
    last = stepped.last, rate, tangents.T, stepped.time
    return Stretch(*last, stepped.steps, stepped.reached, stepped.halted)


def _longest_while_stuck(model: Model, duration: Array) -> Array:
    """The longest step (s) while the contact sticks: a slow drum carries it along for thousands of periods."""
    fastest = fastest_while_stuck(model)
    return jnp.where(fastest > 0, LONGEST_STEP * FIRST_STEP_FRACTION / jnp.where(fastest > 0, fastest, 1.0), duration)


def until_rest(model: Model, size: Array, least: Array) -> dict[str, Any]:
    """What stops `step_through` where no part of the contact slips faster than `least` (m/s)."""
    speeds = size[size.size // 2 :]

    def velocity(scaled: Array) -> Array:
        return scaled[speeds.size :] * speeds

    return {
        "halts": lambda _, scaled: slip(model, 0.0, velocity(scaled)) < least,
        "passes": lambda attempt: stick_event(model, attempt, lambda _: 0.0, velocity, speeds, least),
    }


def until_release(model: Model, size: Array, timing: Array) -> dict[str, Any]:
    """What stops `step_through` where friction ceases to hold the contact, to a `timing` (s)."""
    n = size.size // 2

    def passes(attempt: Attempt) -> Array:
        def motion(time: Array) -> tuple[float, Array, Array, None]:
            y = attempt.inside(time) * size
            return 0.0, y[:n], y[n:], None

        return fraction_to_release(attempt, partial(stiction_margin, model, motion), fastest_while_stuck(model), timing)

    return {"passes": passes}


def _pushed(
    step: Attempt, tangents: Array, derivatives: Callable[[Array], Array], local: Array, longest: Array
) -> Array:
    """Tangents (2n + 1, 2n), the last one of the parameter, at the end of a step of the same method."""
    h, slopes, n = step.end - step.start, step.dense["k"], step.before.size
    weights = make_solver(DEFAULT).weights
    states = [step.before + sum(a * slope for a, slope in zip(row, slopes, strict=True) if a != 0) for row in weights]
    rows = jax.lax.map(derivatives, jnp.stack(states))

    def growth(i: Any, tangents: Array) -> Array:
        pushed = jnp.sum(tangents[:, :, None] * rows[i, None, :n], axis=1)
        return pushed.at[-1].add(rows[i, n])

    of_rate = jnp.sum(step.slope_before[:, None] * (rows[-1, :n] - rows[0, :n]), axis=0)
    shift = _time_shift(step, growth(-1, tangents) - growth(0, tangents), of_rate, local, longest)
    start = tangents - shift * step.slope_before
    matrix = jnp.asarray(weights)

    def stage(i: Array, grown: Array) -> Array:
        now = start + h * sum(matrix[i, j] * grown[j] for j in range(len(weights)))
        return grown.at[i].set(growth(i, now))

    grown = jax.lax.fori_loop(0, len(weights), stage, jnp.zeros((len(weights), *start.shape)))
    # The last stage is at the end of the step (FSAL).
    end = start + h * sum(a * slope for a, slope in zip(weights[-1], grown, strict=True) if a != 0)
    return end + shift * step.slope_after


def _time_shift(step: Attempt, of_tangents: Array, of_rate: Array, local: Array, longest: Array) -> Array:
    """How far in time (k, 1) each tangent is best displaced along the motion while it goes through a step.

    Where a contact boundary enters the lining the Jacobian J jumps, where a pair of them appears it grows without bound
    (like 1/√t), in one direction of the state space only. A tangent δ less α times the motion's own rate f, which
    solves the variational equation, too, does not feel that if it lies in the surface of the event. That is the α for
    which the change of J over the step moves it least: α = ΔJf·ΔJδ / |ΔJf|².
    """
    # What it costs is α times the error of f, as the motion has it: where that is more than it gains, α is little.
    h, error = step.end - step.start, local / longest
    square = jnp.sum(of_rate * of_rate)
    ridge = square + (error / h) ** 2
    shift = jnp.sum(of_tangents * of_rate, axis=1) / ridge
    # Events make steps short; in a long one the change of J is nothing but smooth.
    return jnp.where(h < 0.1 * longest, shift, 0.0)[:, None]  # of the longest


def stepped_through(model: Model, size: Array, start: Array, times: Array, local: Array, **more: Any) -> Stepped:
    """Integrate a scaled state (2n,) by steps as `step_through` makes them."""
    return step_through(
        make_solver(DEFAULT),
        lambda _, y: _rate(model, size, y),
        times,
        start,
        1e-3 * times[-1],
        tolerance=local,
        norm=lambda error: jnp.max(jnp.abs(error)),
        budget=jnp.asarray(20_000),  # steps; a period takes some hundred
        **more,
    )


def _rate(model: Model, size: Array, scaled: Array) -> Array:
    """ẏ (2n,) of a scaled state y (2n,)."""
    y, n = scaled * size, scaled.size // 2
    return jnp.concatenate([y[n:], model.act(0.0, y[:n], y[n:])[0] / model.mass]) / size


@Program
def rate_at(model: Model, size: Array, state: Array) -> Array:
    """ẏ (2n,) of a scaled state y (2n,)."""
    return _rate(model, size, state)
