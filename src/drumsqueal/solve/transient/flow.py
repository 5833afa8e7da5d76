"""The flow map of a model whose drum and load are steady, and its derivatives, by the variational equations.

Tangents come stretch by stretch, in which the motion slips or sticks throughout, and are integrated with it, step for
step by the same method: they are derivatives of the motion as it was computed, also where contact boundaries appear and
vanish. A contact that sticks as a whole moves by other equations from one instant on, which depends on the motion:
there a tangent δ becomes δ + (f⁻ − f⁺) δt, with f the rates on either side and δt by how much a neighbour gets there
later. Source: R. I. Leine & H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, Springer 2004,
chapter 7 (saltation matrices).
"""

from collections.abc import Callable
from enum import StrEnum
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.physics.model import Model
from drumsqueal.programs import Program, compiled, kernel_of
from drumsqueal.solve.transient.events import TIMING, Attempt, fraction_to_release
from drumsqueal.solve.transient.runge_kutta import DEFAULT, make_solver
from drumsqueal.solve.transient.segment import AWAY, FIRST_STEP_FRACTION, first_step, stick_event
from drumsqueal.solve.transient.state import State, local_tolerance, motion_scale
from drumsqueal.solve.transient.stepping import Stepped, step_through
from drumsqueal.solve.transient.sticking import (
    StuckModel,
    can_stick,
    drum_motion,
    fastest_while_stuck,
    find_stiction,
    friction_limit,
    slip,
    slip_acceleration,
    slip_alone,
    stiction_margin,
    stuck_model,
)

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
        "fraction_to_stop": lambda attempt: stick_event(model, attempt, lambda _: 0.0, velocity, speeds, least),
    }


def until_release(model: Model, size: Array, timing: Array) -> dict[str, Any]:
    """What stops `step_through` where friction ceases to hold the contact, to a `timing` (s)."""
    n = size.size // 2

    def fraction_to_stop(attempt: Attempt) -> Array:
        def motion(time: Array) -> tuple[float, Array, Array, None]:
            y = attempt.inside(time) * size
            return 0.0, y[:n], y[n:], None

        return fraction_to_release(attempt, partial(stiction_margin, model, motion), fastest_while_stuck(model), timing)

    return {"fraction_to_stop": fraction_to_stop}


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
    """Integrate a scaled state (2n,) by steps as `step_through` makes them.

    Over cells stages are kernels, as `kernel_of` makes none there: a chain takes up to three times as long.
    """
    return step_through(
        make_solver(DEFAULT, in_loop=model.contact.cell_axes > 0),
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


TIGHT = 1e-11  # tolerance of neighbours that are subtracted from each other
APART = 1e-6  # of the size of the motion: how far they begin from it


class StickTransition(StrEnum):
    """What happens where hardly anything slips any more, and where friction no longer holds what sticks."""

    STICKS = "sticks"
    SLIPS = "slips"
    REVERSES = "reverses"


class Flow(NamedTuple):
    """Where a motion is after a time, with derivatives, all scaled: its end y(T) (2n,) and rate ẏ(T) (2n,) per s.

    `transition` is ∂y(T)/∂y(0) (2n, 2n), `sensitivity` ∂y(T)/∂p (2n,), zero where no parameter was given. `steps` is
    how many were made, `reached` whether the end was. `changes` are what happened between slip and stick, and when (s);
    where it sticks, `lost` directions of slip are forgotten.
    """

    end: Any  # arrays of JAX, or of NumPy once they are in its hands
    rate: Any
    transition: Any
    sensitivity: Any
    steps: Any
    reached: Any
    changes: tuple[tuple[float, StickTransition], ...] = ()
    lost: int = 0

    @property
    def pattern(self) -> tuple[StickTransition, ...]:
        """What happens, in order: where it is another one, the flow has other derivatives."""
        return tuple(what for _, what in self.changes)


def flow(
    model: Model, size: ArrayLike, state: ArrayLike, duration: Any, tolerance: Any, change: Model | None = None
) -> Flow:
    """Follow M q̈ = Σ Q from (q, q̇)/size (2n,) for a duration (s), with q (n,) measured from q = 0.

    The tolerance is that of a scene: of state and tangents in units of `size` (2n,). `change` is the derivative of the
    model with respect to the parameter p. Where the model does not depend on time the derivative with respect to the
    duration is `rate`.
    """
    # One program serves with and without a parameter, for it takes half a minute to compile.
    by_parameter: Model = jax.tree.map(np.zeros_like, model) if change is None else change
    motion = _Motion(model, by_parameter, np.asarray(size), float(duration), float(tolerance))
    return motion.followed(np.asarray(state))


class _Motion:
    """A motion through its changes between slip and stick."""

    def __init__(self, model: Model, change: Model, size: np.ndarray, duration: float, tolerance: float) -> None:
        self._models, self._changes, self._size = {False: model}, {False: change}, size
        self._duration, self._local = duration, np.asarray(local_tolerance(np.float64(tolerance), DEFAULT))
        self._n = size.size // 2
        self._least = _least_slip(model, size, tolerance)
        if self._least is not None:
            self._models[True], self._changes[True] = stuck_model(model), stuck_model(change)
            # Which coordinates slip (n,), and the derivative of the drum's motion with respect to p (n,).
            self._slipping, self._drum = (np.asarray(part) for part in _slip_and_drum(model, change))

    def followed(self, start: np.ndarray) -> Flow:
        n = 2 * self._n
        state, tangents, time, steps, sticks = start, np.eye(n, n + 1), 0.0, 0, False
        changes: list[tuple[float, StickTransition]] = []
        if self._least is not None and float(slip(self._models[False], 0.0, self._parts(state)[1])) < self._least:
            state, tangents, what = self._stopped(state, np.zeros(n), tangents)
            sticks = what is StickTransition.STICKS
            changes.append((0.0, what))
        while len(changes) <= 100:  # between slip and stick: more is a contact that chatters, not a motion
            given = self._models[sticks], self._size, state, np.float64(self._duration - time), self._local
            leg = follow_stretch(*given, self._changes[sticks], self._least)
            state = np.asarray(leg.end)
            rate = np.asarray(leg.rate) if leg.steps else self._rate(state, sticks=sticks)
            steps, time = steps + int(leg.steps), time + float(leg.time)
            tangents = _then(np.asarray(leg.tangents), tangents)
            if not (bool(leg.halted) and time < self._duration):
                sound = bool(leg.reached)
                break
            if sticks:
                state, tangents = self._released(state, rate, tangents)
                what = StickTransition.SLIPS
            else:
                state, tangents, what = self._stopped(state, rate, tangents)
            sticks = what is StickTransition.STICKS
            changes.append((time, what))
        else:
            sound = False
        stuck = any(what is StickTransition.STICKS for _, what in changes)
        lost = int(self._slipping.sum()) if stuck else 0
        return Flow(state, rate, tangents[:, :-1], tangents[:, -1], steps, sound, tuple(changes), lost)

    def _parts(self, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        moved = state * self._size
        return moved[: self._n], moved[self._n :]

    def _rate(self, state: np.ndarray, *, sticks: bool) -> np.ndarray:
        return np.asarray(rate_at(self._models[sticks], self._size, state))

    def _with_drum(self, state: np.ndarray, slipping: np.ndarray | float = 0.0) -> np.ndarray:
        """The state with the drum's velocity, but for what slips."""
        q, v = self._parts(state)
        velocity = np.asarray(drum_motion(self._models[False], 0.0, v)) + slipping
        return np.concatenate([q, velocity]) / self._size

    def _stopped(
        self, state: np.ndarray, rate: np.ndarray, tangents: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, StickTransition]:
        """What goes on where hardly anything slips: it sticks, or slips on at once."""
        found = find_stiction(self._models[False], 0.0, *self._parts(state))
        stops, direction = bool(found.reserve >= 1), np.asarray(found.direction)
        away = 0.0 if stops else AWAY * float(self._least) * direction
        after = self._with_drum(state, away)
        # Neighbours stop later by what their slip is more, over the rate at which it falls.
        falls = np.where(self._slipping, (rate * self._size)[self._n :], 0.0)
        weighed = np.asarray(self._models[False].mass) * falls
        size = float(weighed @ falls)
        onwards = stops or float(weighed @ direction) > 0
        if size > 0 and onwards:
            slipping = self._size[self._n :, None] * tangents[self._n :]
            slipping[:, -1] -= self._drum
            later = -(weighed @ slipping) / size
            tangents = tangents + np.outer(rate - self._rate(after, sticks=stops), later)
        if stops:
            tangents = tangents.copy()
            tangents[self._n :][self._slipping] = 0.0
            tangents[self._n :, -1] += self._drum / self._size[self._n :]
        return after, tangents, StickTransition.STICKS if stops else StickTransition.REVERSES

    def _released(self, state: np.ndarray, rate: np.ndarray, tangents: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The state and tangents with which it slips, where friction can just hold."""
        q, v = self._parts(state)
        away = np.asarray(find_stiction(self._models[False], 0.0, q, v, ends=True).direction)
        after = self._with_drum(state, AWAY * float(self._least) * away)
        slopes, of_parameter = _excess_derivatives(self._models[False], self._changes[False], self._size, state, -away)
        row = np.asarray(slopes) @ tangents
        row[-1] += float(of_parameter)
        later = -row / float(np.asarray(slopes) @ rate)
        return after, tangents + np.outer(rate - self._rate(after, sticks=False), later)


def _then(later: np.ndarray, earlier: np.ndarray) -> np.ndarray:
    """Tangents (2n, 2n + 1) through one stretch and the next, the last one of the parameter."""
    through = later[:, :-1] @ earlier
    through[:, -1] += later[:, -1]
    return through


@Program
def slip_speeds(model: Model, velocities: Array) -> Array:
    """Slip speeds (k,) in m/s at velocities (k, n)."""
    return jax.vmap(lambda velocity: slip(model, 0.0, velocity))(velocities)


@Program
def _slip_and_drum(model: Model, change: Model) -> tuple[Array, Array]:
    """Which coordinates slip (n,), and the derivative of the drum's motion (n,) with respect to p."""
    rest, ones = jnp.zeros(len(model.names)), jnp.ones(len(model.names))
    slipping = slip_acceleration(model, 0.0, ones) != slip_acceleration(model, 0.0, rest)
    return slipping, jax.jvp(lambda model: drum_motion(model, 0.0, rest), (model,), (change,))[1]


@Program
def _excess_derivatives(
    model: Model, change: Model, size: Array, state: Array, direction: Array
) -> tuple[Array, Array]:
    """Of u·(h′(u) − Q), what friction holds along a direction u over what is needed: by state (2n,) and by p.

    Where it vanishes for the weakest direction, the reserve of `find_stiction` is one, and its derivatives are as these
    (the envelope theorem).
    """
    n = state.size // 2

    def excess(model: Model, scaled: Array) -> Array:
        y = scaled * size
        found = friction_limit(model, 0.0, y[:n], y[n:], direction[None])
        return direction @ (found.farthest[0] - found.needed)

    by_state = jax.jacfwd(lambda y: excess(model, y))(state)
    return by_state, jax.jvp(lambda model: excess(model, state), (model,), (change,))[1]


def neighbours(
    model: Model, size: ArrayLike, state: ArrayLike, directions: ArrayLike, duration: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Where a motion is after a time, y(T) (2n,), and ∂y(T)/∂y(0) times directions (2n, k), by central differences.

    All scaled as in `flow`; NaN where a motion is not followed to the end. Exact to some 1e-5 of the largest derivative
    also where pairs of contact boundaries appear, where tangents may fail.
    """
    steps = APART * np.asarray(directions).T
    starts = np.asarray(state) + np.concatenate([np.zeros((1, steps.shape[1])), steps, -steps])
    local = jnp.asarray(local_tolerance(np.float64(TIGHT), DEFAULT))
    least = _least_slip(model, np.asarray(size), TIGHT)
    given = model, jnp.asarray(size), jnp.asarray(starts), jnp.asarray(np.float64(duration)), local
    ends = np.array(_ends(*given, least))
    for k in np.flatnonzero(~np.isfinite(ends).all(axis=1)):  # those that stop on the way take longer
        found = flow(model, size, starts[k], duration, TIGHT)
        ends[k] = found.end if found.reached else np.nan
    return ends[0], (ends[1 : len(steps) + 1] - ends[len(steps) + 1 :]).T / (2 * APART)


@compiled
def _ends(model: Model, size: Array, starts: Array, duration: Array, local: Array, least: Array | None) -> Array:
    return kernel_of(_each_followed, model, size, starts, duration, local, least)


def _each_followed(
    model: Model, size: Array, starts: Array, duration: Array, local: Array, least: Array | None
) -> Array:
    """Where they are after the duration, NaN where a motion does not get there or all but stops slipping before."""
    rest = {} if least is None else until_rest(model, size, least)
    times = jnp.stack([jnp.zeros(()), duration])

    def end(start: Array) -> Array:
        stepped = stepped_through(model, size, start, times, local, **rest)
        return jnp.where(stepped.reached & ~stepped.halted, stepped.last, jnp.nan)

    return jax.lax.map(end, starts)


def _least_slip(model: Model, size: np.ndarray, tolerance: float) -> Any:
    """Slip speed (m/s) below which nothing slips; None for what cannot stick to a drum that turns."""
    if not can_stick(model, at_rest=False):
        return None
    return np.float64(tolerance) * np.asarray(slip_alone(model, size[size.size // 2 :]))


@compiled
def state_size(model: Model, vibration: Array, velocity: Array) -> Array:
    """Amplitudes (2n,) of displacement and velocity that the energy of a motion about steady sliding gives them."""
    scale = motion_scale(model, State(vibration, velocity, jnp.zeros(())))
    return jnp.concatenate([scale.vibration, scale.velocity])
