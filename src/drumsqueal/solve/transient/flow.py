"""The flow map of a model whose drum and load are steady, and its derivatives, by the variational equations.

The tangents are integrated with the motion, step for step by the same method: they are derivatives of the motion as
it was computed, also where contact boundaries appear and vanish.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.physics.kernel import compiled, one_kernel
from drumsqueal.physics.model import Model
from drumsqueal.solve.transient.runge_kutta import DEFAULT, make_solver
from drumsqueal.solve.transient.segment import first_step, local_tolerance, motion_scale
from drumsqueal.solve.transient.state import State
from drumsqueal.solve.transient.stepping import Attempt, Stepped, step_through

TIGHT = 1e-11  # tolerance of neighbours that are subtracted from each other
APART = 1e-6  # of the size of the motion: how far they begin from it
BUDGET = 20_000  # steps; a period takes some hundred
FIRST_STEP = 1e-3  # of the duration
LONGEST_STEP = 25.0  # times the step that a transient begins with, a hundredth of a radian of the fastest mode
SHORT_STEP = 0.1  # of the longest


class Flow(NamedTuple):
    """Where a motion is after a time, with derivatives, all scaled: its end y(T) (2n,) and rate ẏ(T) (2n,) per s.

    `transition` is ∂y(T)/∂y(0) (2n, 2n), `sensitivity` ∂y(T)/∂p (2n,), zero where no parameter was given. `steps` is
    how many were made, `reached` whether the end was.
    """

    end: Any  # arrays of JAX, or of NumPy once they are in its hands
    rate: Any
    transition: Any
    sensitivity: Any
    steps: Any
    reached: Any


def flow(
    model: Model, size: ArrayLike, state: ArrayLike, duration: Any, tolerance: Any, change: Model | None = None
) -> Flow:
    """Follow M q̈ = Σ Q from (q, q̇)/size (2n,) for a duration (s), with q (n,) measured from q = 0.

    The tolerance is that of a scene: of state and tangents in units of `size` (2n,). `change` is the derivative of the
    model with respect to the parameter p. Where the model does not depend on time the derivative with respect to the
    duration is `rate`.
    """
    numbers = (jnp.asarray(np.float64(x)) for x in (duration, local_tolerance(tolerance, DEFAULT)))
    # One program serves both, for it takes half a minute to compile.
    change = jax.tree.map(np.zeros_like, model) if change is None else change
    return _flow(model, jnp.asarray(size), jnp.asarray(state), *numbers, change)


def neighbours(
    model: Model, size: ArrayLike, state: ArrayLike, directions: ArrayLike, duration: Any
) -> tuple[Array, Array]:
    """Where a motion is after a time, y(T) (2n,), and ∂y(T)/∂y(0) times directions (2n, k), by central differences.

    All scaled as in `flow`; NaN where a motion is not followed to the end. Exact to some 1e-5 of the largest derivative
    also where pairs of contact boundaries appear, where tangents may fail.
    """
    local = jnp.asarray(local_tolerance(np.float64(TIGHT), DEFAULT))
    steps = APART * np.asarray(directions).T
    starts = np.asarray(state) + np.concatenate([np.zeros((1, steps.shape[1])), steps, -steps])
    ends = _ends(model, jnp.asarray(size), jnp.asarray(starts), jnp.asarray(np.float64(duration)), local)
    return ends[0], (ends[1 : len(steps) + 1] - ends[len(steps) + 1 :]).T / (2 * APART)


@compiled
def _ends(model: Model, size: Array, starts: Array, duration: Array, local: Array) -> Array:
    return one_kernel(_each_followed, model, size, starts, duration, local)


def _each_followed(model: Model, size: Array, starts: Array, duration: Array, local: Array) -> Array:
    def end(start: Array) -> Array:
        stepped = _stepped(model, size, start, duration, local)
        return jnp.where(stepped.reached, stepped.last, jnp.nan)

    return jax.lax.map(end, starts)


def _stepped(model: Model, size: Array, start: Array, duration: Array, local: Array, **tangents: Any) -> Stepped:
    return step_through(
        make_solver(DEFAULT),
        lambda _, y: _rate(model, size, y),
        jnp.stack([jnp.zeros(()), duration]),
        start,
        FIRST_STEP * duration,
        tolerance=local,
        norm=lambda error: jnp.max(jnp.abs(error)),
        budget=jnp.asarray(BUDGET),
        **tangents,
    )


def _rate(model: Model, size: Array, scaled: Array) -> Array:
    """ẏ (2n,) of a scaled state y (2n,)."""
    y, n = scaled * size, scaled.size // 2
    return jnp.concatenate([y[n:], model.act(0.0, y[:n], y[n:])[0] / model.mass]) / size


@compiled
def state_size(model: Model, vibration: Array, velocity: Array) -> Array:
    """Amplitudes (2n,) of displacement and velocity that the energy of a motion about steady sliding gives them."""
    scale = motion_scale(model, State(vibration, velocity, jnp.zeros(())))
    return jnp.concatenate([scale.vibration, scale.velocity])


@compiled
def _flow(model: Model, size: Array, state: Array, duration: Array, local: Array, change: Model) -> Flow:
    # A motion near rest asks for no short steps, but its tangents do.
    longest = LONGEST_STEP * first_step(model)
    return one_kernel(_followed, model, size, state, duration, local, longest, change)


def _followed(
    model: Model, size: Array, state: Array, duration: Array, local: Array, longest: Array, change: Model
) -> Flow:
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
    stepped = _stepped(model, size, state, duration, local, longest=longest, along=along, carried=begin)
    # Tangents come as rows, one for each direction; a derivative has them as columns.
    tangents, rates = stepped.carried
    return Flow(stepped.last, rates, tangents[:unknowns].T, tangents[-1], stepped.steps, stepped.reached)


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
    return jnp.where(h < SHORT_STEP * longest, shift, 0.0)[:, None]
