"""The flow map of a model whose drum and load are steady, and its derivatives, by the variational equations.

Its tangents come stretch by stretch, see `tangents.py`. A contact that sticks as a whole moves by other equations from
one instant on, which depends on the motion: there a tangent δ becomes δ + (f⁻ − f⁺) δt, with f the rates on either side
and δt by how much a neighbour gets there later. Source: R. I. Leine & H. Nijmeijer, Dynamics and Bifurcations of
Non-Smooth Mechanical Systems, Springer 2004, chapter 7 (saltation matrices).
"""

from enum import StrEnum
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.physics.model import Model
from drumsqueal.programs import Program, compiled, kernel_of
from drumsqueal.solve.transient.phase import AWAY
from drumsqueal.solve.transient.resolution import local_tolerance, motion_scale
from drumsqueal.solve.transient.runge_kutta import DEFAULT
from drumsqueal.solve.transient.state import State
from drumsqueal.solve.transient.sticking import (
    can_stick,
    drum_motion,
    find_stiction,
    friction_limit,
    slip,
    slip_acceleration,
    slip_alone,
    stuck_model,
)
from drumsqueal.solve.transient.tangents import Stretch, follow_stretch, rate_at, stepped_through, until_rest

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
        if self._least is not None and self._slip(state) < self._least:
            state, tangents, what = self._stopped(state, np.zeros(n), tangents)
            sticks = what is StickTransition.STICKS
            changes.append((0.0, what))
        while len(changes) <= 100:  # between slip and stick: more is a contact that chatters, not a motion
            leg = self._leg(state, self._duration - time, sticks=sticks)
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

    def _leg(self, state: np.ndarray, duration: float, *, sticks: bool) -> Stretch:
        given = self._models[sticks], self._size, state, np.float64(duration), self._local
        return follow_stretch(*given, self._changes[sticks], self._least)

    def _parts(self, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        moved = state * self._size
        return moved[: self._n], moved[self._n :]

    def _slip(self, state: np.ndarray) -> float:
        return float(slip(self._models[False], 0.0, self._parts(state)[1]))

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
