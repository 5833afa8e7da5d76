"""The lining sticking to the drum as a whole: what friction can hold, whether it does, and the motion meanwhile.

Where the slip velocity vanishes all over the lining, friction is set-valued: it can be any force of the limit surface
K = {Q : Q·w ≤ h(w) for all w}, h(w) = ∫ μ_s N |V_w| dA, with V_w the slip velocity of a motion w relative to the drum
(Goyal, Ruina & Papadopoulos, Wear 143 (1991) 307). The lining sticks as long as what is needed to move with the drum
lies in it. That is asked for from outside the compiled steps, at the samples and corners of a lining that sticks.
"""

import dataclasses
import warnings
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.physics.bodies.body import dot, scalars
from drumsqueal.physics.effects.effect import Observation
from drumsqueal.physics.effects.friction import Friction
from drumsqueal.physics.effects.operation import Moment
from drumsqueal.physics.laws.friction_law import ConstantLaw, static_coefficient
from drumsqueal.physics.model import Model
from drumsqueal.programs import Program

ENOUGH = 16  # directions a coordinate, of a polytope within the limit surface: most of what is held lies in it
SEED = 1  # of those directions
INSIDE = 1e-9  # of the farthest point: how near to the polytope counts as in it
JUST = 1e-6  # of the reserve: so little beyond it, the lining slips the way that is resisted least


def can_stick(model: Model, *, at_rest: bool) -> bool:
    """Whether the lining can move as one with the drum: with friction, and coordinates to follow it unless at rest."""
    return model.contact.friction is not None and (model.body.follows or at_rest)


class Held(Model):
    """The same body while its lining sticks: it moves with the drum, by whatever force of friction that takes.

    Coordinates without a slip velocity of their own, such as Z where friction knows the sliding direction only, go on
    freely.
    """

    def rates(
        self, time: ArrayLike, q: Array, v: Array, memory: Array | None = None
    ) -> tuple[Array, Array, Array | None]:
        """Force (n,) that makes the motion the drum's, the power beyond the stored energy (W) and rate of the memory.

        Nothing slips, nothing is turned into heat.
        """
        moment = self.operation.at(time)
        free, power = _without_friction(self, time, q, v)
        held = _grip(self, moment, free)
        return free + held, power + held @ v, self.memory_rate(memory, 0.0)

    def kinks(self, time: ArrayLike, q: Array, v: Array, memory: Array | None = None) -> Array:
        """Those of the pressure: the slip velocity is zero but for round-off, the signs of which say nothing."""
        del memory
        return self.contact.with_friction(None).kinks(self.operation.at(time), scalars(q), scalars(v))

    def observe(self, time: ArrayLike, q: Array, v: Array, memory: Array | None = None) -> Observation:
        """Torque, forces and extent of the contact at one instant; nothing slips, nothing is turned into heat."""
        del memory
        moment = self.operation.at(time)
        observation = self.contact.with_friction(None).observe(moment, scalars(q), scalars(v))
        # Of turning with the drum at 1 rad/s, the work of what holds the lining.
        grip = scalars(_grip(self, moment, _without_friction(self, time, q, v)[0]))
        torque = jnp.asarray(dot(self.body.following, grip) + jnp.zeros(()))
        return observation._replace(sticking=jnp.ones(()), brake_torque=torque)


def held(model: Model) -> Held:
    """The model while its lining sticks."""
    return Held(**{field.name: getattr(model, field.name) for field in dataclasses.fields(model)})


@Program
def slip(model: Model, time: ArrayLike, v: Array) -> Array:
    """A bound on the slip speed (m/s) anywhere on the lining at velocities v (n,), reached up to a small factor."""
    return model.contact.fastest_slip(model.operation.at(time), scalars(v))


def slip_motion(model: Model, time: ArrayLike, v: Array) -> Array:
    """Velocity (n,) relative to the drum's motion; zero in coordinates that do not slip."""
    return jnp.where(_slips(model), v - _following(model) * model.operation.at(time).drum_speed, 0.0)


def slip_acceleration(model: Model, time: ArrayLike, a: Array) -> Array:
    """Acceleration (n,) relative to the drum's motion; zero in coordinates that do not slip."""
    rate = model.operation.drum_speed.at(time)[1]
    return jnp.where(_slips(model), a - _following(model) * (0.0 if rate is None else rate), 0.0)


@Program
def drum_motion(model: Model, time: ArrayLike, v: Array) -> Array:
    """Velocity (n,) of a shoe whose lining moves with the drum; coordinates that do not slip keep theirs."""
    return jnp.where(_slips(model), _following(model) * model.operation.at(time).drum_speed, v)


@Program
def drum_motions(model: Model, times: Array, velocities: Array) -> Array:
    """The same for many times (k,) and velocities (k, n)."""
    return jax.vmap(drum_motion, in_axes=(None, 0, 0))(model, times, velocities)


class Grip(NamedTuple):
    """What friction needs to hold the lining (n,), and what it can: K's farthest points (k, n) in directions (k, n)."""

    needed: Array
    farthest: Array


@Program
def grip(model: Model, time: ArrayLike, q: Array, v: Array, directions: Array, memory: Array | None = None) -> Grip:
    """The force needed at a displacement q (n,), and the farthest points of the limit surface; v: what is free."""
    moment = model.moment(time, memory)
    needed = _grip(model, moment, _without_friction(model, time, q, v)[0])
    friction = model.contact.friction
    assert friction is not None
    static = Friction(ConstantLaw(static_coefficient(friction.law)), friction.direction)
    sliding, smooth = model.contact.with_friction(static), model.contact.with_friction(None)
    still = moment._replace(drum_speed=jnp.zeros(()))

    def farthest(direction: Array) -> Array:
        with_friction = sliding.act(still, scalars(q), scalars(-direction)).force
        without = smooth.act(still, scalars(q), scalars(jnp.zeros_like(q))).force
        difference = (a - b for a, b in zip(with_friction, without, strict=True))
        return jnp.stack([jnp.asarray(each + jnp.zeros(())) for each in difference])

    return Grip(needed, jax.lax.map(farthest, directions))


def _without_friction(model: Model, time: ArrayLike, q: Array, v: Array) -> tuple[Array, Array]:
    smooth = dataclasses.replace(model, contact=model.contact.with_friction(None))
    return Model.rates(smooth, time, q, v)[:2]  # not those of a model held, which asks for this


def _grip(model: Model, moment: Moment, free: Array) -> Array:
    """M d Ω̇ − Q: what friction adds to the other forces Q (n,) so that the shoe turns with the drum."""
    rate = model.operation.drum_speed.at(moment.time)[1]
    turning = _following(model) * model.mass * (0.0 if rate is None else rate)
    return jnp.where(_slips(model), turning - free, 0.0)


def _following(model: Model) -> Array:
    """Velocities d of a shoe that turns with the drum at 1 rad/s."""
    return jnp.stack([jnp.asarray(each) for each in model.body.following])


def _slips(model: Model) -> np.ndarray:
    """Which coordinates have a slip velocity of their own (n,)."""
    friction = model.contact.friction
    return np.array(model.body.slides(axially=friction is not None and friction.direction.knows_axial))


class Hold(NamedTuple):
    """Whether friction holds: `reserve` is what it could hold over what is needed, and how the lining slips if not.

    `direction` (n,) is the relative acceleration it slips with, to a slip speed of 1 m/s; zero where it holds.
    """

    reserve: float
    direction: np.ndarray


def hold_surely(model: Model, times: Array, q: Array, v: Array, memory: Array | None = None) -> np.ndarray:
    """Whether what is needed lies among some points of the limit surface: a quick answer, where it is yes (k,).

    For many times (k,) with displacements and velocities (k, n) and memories (k, m).
    """
    if len(times) > 1 and not model.forced and memory is None and _rests(model, times, q, v):
        return np.repeat(hold_surely(model, times[:1], q[:1], v[:1]), len(times))
    count, root = len(model.names), np.sqrt(np.asarray(model.mass))
    directions = np.random.default_rng(SEED).standard_normal((ENOUGH * count, count)) * _slips(model) / root
    needed, farthest = (np.asarray(x) / root for x in _grips(model, times, q, v, memory, jnp.asarray(directions)))
    answers: list[bool] = []
    for k in range(len(needed)):
        same = k > 0 and np.array_equal(needed[k], needed[k - 1]) and np.array_equal(farthest[k], farthest[k - 1])
        answers.append(answers[-1] if same else _lies_among(needed[k], farthest[k]))
    return np.array(answers)


def _rests(model: Model, times: Array, q: Array, v: Array) -> bool:
    """Whether neither the motion nor what is prescribed changes, as where a drum rests: one sample is then all."""
    speed, rate = jax.vmap(model.operation.drum_speed.at)(times)
    prescribed = (speed, jax.vmap(model.operation.preload.at)(times)[0], *(() if rate is None else (rate,)))
    return all(not np.ptp(np.asarray(x), axis=0).any() for x in (q, v, *prescribed))


@Program
def _grips(model: Model, times: Array, q: Array, v: Array, memory: Array | None, directions: Array) -> Grip:
    return jax.lax.map(lambda now: grip(model, *now[:3], directions, now[3]), (times, q, v, memory))


def _lies_among(wanted: np.ndarray, points: np.ndarray) -> bool:
    """Whether a point (n,) is in the hull of points (k, n) and their opposites."""
    size = np.abs(points).max()
    if size == 0 or not np.isfinite([size, *wanted]).all():
        return False
    table = np.vstack([np.hstack([points.T, -points.T]) / size, np.ones(2 * len(points))])
    table = np.hstack([table, np.eye(len(table))[:, -1:]])  # the fractions add up to one or less
    return scipy.optimize.nnls(table, np.append(wanted / size, 1.0))[1] < INSIDE


def hold(
    model: Model,
    time: ArrayLike,
    q: ArrayLike,
    v: ArrayLike,
    memory: Array | None = None,
    *,
    ends: bool = False,
    slips: bool = True,
) -> Hold:
    """Decide whether the lining sticks at a displacement q (n,), moving with the drum.

    The reserve is min h(u) over the motions u with Q·u = 1, Q the force that is needed: at least one where it lies in
    the limit surface. h is convex, and the minimum found to the square of what its gradient is found to. Where sticking
    `ends`, the direction is given also at a reserve of just one; unless `slips`, it is not asked for and is zero.
    """
    moving = _slips(model)
    count = len(moving)
    # Arrays, for plain numbers would be compiled into the program; NumPy's, which take a tenth of the time of JAX's.
    time, q, v = np.asarray(time), np.asarray(q), np.asarray(v)

    def farthest(direction: np.ndarray) -> np.ndarray:
        return np.asarray(grip(model, time, q, v, direction[None], memory).farthest)[0]

    needed = np.asarray(grip(model, time, q, v, np.zeros((1, count)), memory).needed)
    root = np.sqrt(np.asarray(model.mass))
    size = float(np.linalg.norm((needed / root)[moving]))
    if size == 0:
        return Hold(np.inf, np.zeros(count))
    along = np.where(moving, needed / root, 0.0) / size
    across = _across(along, moving)

    def resistance(y: np.ndarray) -> tuple[float, np.ndarray]:
        direction = (along + across @ y) / root
        force = farthest(direction)
        return float(force @ direction) / size, across.T @ (force / root) / size

    best = _least(resistance, np.zeros(across.shape[1]))
    reserve = resistance(best)[0]
    if not slips or (reserve >= 1 and not ends):
        return Hold(reserve, np.zeros(count))

    # M r = −Q − ∂h(r): the least of ½ rᵀM r + h(r) + Q·r, from the direction that is resisted least.
    def decline(x: np.ndarray) -> tuple[float, np.ndarray]:
        force = farthest(np.where(moving, x, 0.0) / root)
        slope = np.where(moving, x + (force + needed) / root, 0.0)
        return float(x @ x / 2 + x @ ((force + needed) / root)), slope

    weakest = -(along + across @ best)
    start = weakest / (weakest @ weakest) * max(1 - reserve, 0.0) * size
    acceleration = _least(decline, start) / root
    if not acceleration.any() or reserve > 1 - JUST:
        acceleration = weakest / root
    return Hold(reserve, acceleration / float(slip(model, time, drum_motion(model, time, v) + acceleration)))


def _across(along: np.ndarray, moving: np.ndarray) -> np.ndarray:
    """An orthonormal basis (n, k) of what is at right angles to a unit vector among the coordinates that slip."""
    kept = np.eye(len(along))[:, moving]
    basis = np.linalg.svd(kept - np.outer(along, along @ kept))
    return basis[0][:, : kept.shape[1] - 1]


def _least(function: Callable[[np.ndarray], tuple[float, np.ndarray]], start: np.ndarray) -> np.ndarray:
    """Where a convex function, given with its gradient, is least."""
    if start.size == 0:
        return start
    with warnings.catch_warnings():  # at round-off no step leads further down
        warnings.filterwarnings("ignore", "The line search algorithm did not converge")
        return scipy.optimize.minimize(function, start, jac=True, method="BFGS", options={"gtol": 1e-10}).x
