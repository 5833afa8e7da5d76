"""The lining sticking to the drum as a whole: what friction can hold, whether it does, and the motion meanwhile.

Where the slip velocity vanishes all over the lining, friction is set-valued: it can be any force of the limit surface
K = {Q : Q·w ≤ h(w) for all w}, h(w) = ∫ μ_s N |V_w| dA, with V_w the slip velocity of a motion w relative to the drum
(Goyal, Ruina & Papadopoulos, Wear 143 (1991) 307). The lining sticks as long as what is needed to move with the drum
lies in it. Everything here but the held motion is asked for a few times a run, and from outside the compiled steps.
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from scipy.optimize import minimize, nnls

from drumsqueal.bodies.rigid_shoe import TZ, Y, Z
from drumsqueal.effects.contact import Contact, Observation
from drumsqueal.effects.friction import Friction
from drumsqueal.effects.friction_law import ConstantLaw
from drumsqueal.effects.operation import Moment
from drumsqueal.effects.schedule import Constant
from drumsqueal.kernel import compiled
from drumsqueal.model import Model

ENOUGH = 16  # directions a coordinate, of a polytope within the limit surface: most of what is held lies in it
SEED = 1  # of those directions
INSIDE = 1e-9  # of the farthest point: how near to the polytope counts as in it
JUST = 1e-6  # of the reserve: so little beyond it, the lining slips the way that is resisted least


def can_stick(model: Model) -> bool:
    """Whether the lining can move as one with the drum: with friction, and Y and Tz to follow it or a drum at rest."""
    friction, speed = model.contact.friction, model.operation.drum_speed
    follows = {Y, TZ} <= set(model.coordinates)
    at_rest = isinstance(speed, Constant) and float(speed.value) == 0
    return friction is not None and (follows or at_rest)


class Held(Model):
    """The same body while its lining sticks: it moves with the drum, by whatever force of friction that takes.

    Coordinates without a slip velocity of their own, such as Z where friction knows the sliding direction only, go on
    freely.
    """

    def act(self, time: ArrayLike, q: Array, v: Array) -> tuple[Array, Array]:
        """Force (n,) that makes the motion the drum's, and the power beyond the stored energy (W)."""
        moment = self.operation.at(time)
        free, power = _without_friction(self, moment, q, v)
        held = _grip(self, moment, free)
        return free + held, power + held @ v

    def observe(self, time: ArrayLike, q: Array, v: Array) -> Observation:
        """Torque, forces and extent of the contact at one instant; nothing slips, nothing is turned into heat."""
        moment = self.operation.at(time)
        held = _grip(self, moment, _without_friction(self, moment, q, v)[0])
        wide = self.widen(held)
        # Of R ∫F_θ dA − c ∫F_θ cos θ dA, the force on Tz, and ∫F_θ cos θ dA, that on Y.
        torque = jnp.asarray(wide[TZ] + self.shoe.centroid * wide[Y] + jnp.zeros(()))
        return _frictionless(self).observe(moment, self.widen(q), self.widen(v))._replace(brake_torque=torque)


def held(model: Model) -> Held:
    """The model while its lining sticks."""
    return Held(**{field.name: getattr(model, field.name) for field in dataclasses.fields(model)})


def slip(model: Model, time: ArrayLike, v: Array) -> Array:
    """A bound on the slip speed (m/s) anywhere on the lining at velocities v (n,), reached up to a small factor."""
    moment = model.operation.at(time)
    levels = model.contact.levels(moment, (0.0,) * 6, model.widen(v))
    half_width = model.shoe.width / 2
    return sum(
        (
            abs(level.constant) + abs(level.cosine) + abs(level.sine)
            + half_width * (abs(level.cosine_slope) + abs(level.sine_slope))
            for level in (levels.slip, levels.axial)
            if level is not None
        ),
        start=jnp.zeros(()),
    )  # fmt: skip


@jax.jit
def drum_motion(model: Model, time: ArrayLike, v: Array) -> Array:
    """Velocity (n,) of a shoe whose lining moves with the drum; coordinates that do not slip keep theirs."""
    return jnp.where(_slips(model), _turn(model) * model.operation.at(time).drum_speed, v)


@jax.jit
def drum_motions(model: Model, times: Array, velocities: Array) -> Array:
    """The same for many times (k,) and velocities (k, n)."""
    return jax.vmap(drum_motion, in_axes=(None, 0, 0))(model, times, velocities)


class Grip(NamedTuple):
    """What friction needs to hold the lining (n,), and what it can: K's farthest points (k, n) in directions (k, n)."""

    needed: Array
    farthest: Array


@compiled
def grip(model: Model, time: ArrayLike, q: Array, v: Array, directions: Array) -> Grip:
    """The force needed at a displacement q (n,), and the farthest points of the limit surface; v tells what is free."""
    moment = model.operation.at(time)
    needed = _grip(model, moment, _without_friction(model, moment, q, v)[0])
    friction = model.contact.friction
    assert friction is not None
    static = Friction(ConstantLaw(friction.law.coefficient(jnp.zeros(()))), friction.direction)
    contact, still = dataclasses.replace(model.contact, friction=static), moment._replace(drum_speed=jnp.zeros(()))

    def force(touching: Contact, direction: Array) -> Array:
        action = touching.act(still, model.widen(q), model.widen(direction))
        return jnp.stack([jnp.asarray(action.force[i] + jnp.zeros(())) for i in model.coordinates])

    pressure = force(_frictionless(model), jnp.zeros_like(q))
    return Grip(needed, jax.lax.map(lambda direction: force(contact, -direction) - pressure, directions))


def _without_friction(model: Model, moment: Moment, q: Array, v: Array) -> tuple[Array, Array]:
    wide_q, wide_v = model.widen(q), model.widen(v)
    actions = [effect.act(moment, wide_q, wide_v) for effect in (_frictionless(model), *model.others)]
    force = [sum(action.force[i] for action in actions) + jnp.zeros(()) for i in model.coordinates]
    return jnp.stack(force), jnp.asarray(sum(action.power for action in actions) + jnp.zeros(()))


def _frictionless(model: Model) -> Contact:
    return dataclasses.replace(model.contact, friction=None)


def _grip(model: Model, moment: Moment, free: Array) -> Array:
    """M d Ω̇ − Q: what friction adds to the other forces Q (n,) so that the shoe turns with the drum."""
    rate = model.operation.drum_speed.at(moment.time)[1]
    following = _turn(model) * model.mass * (0.0 if rate is None else rate)
    return jnp.where(_slips(model), following - free, 0.0)


def _turn(model: Model) -> Array:
    """Velocities d of a shoe that turns with the drum at 1 rad/s."""
    turning = {Y: model.shoe.centroid, TZ: jnp.ones(())}
    return jnp.stack([turning.get(i, jnp.zeros(())) for i in model.coordinates])


def _slips(model: Model) -> np.ndarray:
    """Which coordinates have a slip velocity of their own (n,)."""
    friction = model.contact.friction
    axial = friction is not None and friction.direction.knows_axial
    return np.array([axial or i != Z for i in model.coordinates])


class Hold(NamedTuple):
    """Whether friction holds: `reserve` is what it could hold over what is needed, and how the lining slips if not.

    `direction` (n,) is the relative acceleration it slips with, to a slip speed of 1 m/s; zero where it holds.
    """

    reserve: float
    direction: np.ndarray


def holds_surely(model: Model, time: float, q: ArrayLike, v: ArrayLike) -> bool:
    """Whether what is needed lies among some points of the limit surface: a quick answer, if it is yes."""
    count = len(model.coordinates)
    root = np.sqrt(np.asarray(model.mass))
    directions = np.random.default_rng(SEED).standard_normal((ENOUGH * count, count)) * _slips(model) / root
    needed, farthest = grip(model, time, jnp.asarray(q), jnp.asarray(v), jnp.asarray(directions))
    points = np.asarray(farthest).T / root[:, None]
    size = np.abs(points).max()
    if size == 0:
        return False
    points = np.hstack([points, -points]) / size
    wanted = np.asarray(needed) / root / size
    table = np.vstack([points, np.ones(points.shape[1])])
    table = np.hstack([table, np.eye(len(table))[:, -1:]])  # the shares add up to one or less
    return nnls(table, np.append(wanted, 1.0))[1] < INSIDE


def hold(model: Model, time: float, q: ArrayLike, v: ArrayLike, *, ends: bool = False) -> Hold:
    """Decide whether the lining sticks at a displacement q (n,), moving with the drum.

    The reserve is min h(u) over the motions u with Q·u = 1, Q the force that is needed: at least one where it lies in
    the limit surface. h is convex, and the minimum found to the square of what its gradient is found to. Where sticking
    `ends`, the direction is told also at a reserve of just one.
    """
    moving = _slips(model)
    count = len(moving)
    q, v = jnp.asarray(q), jnp.asarray(v)

    def farthest(direction: np.ndarray) -> np.ndarray:
        return np.asarray(grip(model, time, q, v, jnp.asarray(direction[None])).farthest[0])

    needed = np.asarray(grip(model, time, q, v, jnp.zeros((1, count))).needed)
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
    if reserve >= 1 and not ends:
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
    return minimize(function, start, jac=True, method="BFGS", options={"gtol": 1e-10}).x
