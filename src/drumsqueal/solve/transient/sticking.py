"""The lining sticking to the drum as a whole: what friction can hold, whether it does, and the motion meanwhile.

Where the slip velocity vanishes all over the lining, friction is set-valued: it can be any force of the limit surface
K = {Q : Q·w ≤ h(w) for all w}, h(w) = ∫ μ_s N |V_w| dA, with V_w the slip velocity of a motion w relative to the drum
(Goyal, Ruina & Papadopoulos, Wear 143 (1991) 307). The lining sticks as long as what is needed to move with the drum
lies in it.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import numpy.typing as npt
from jax import Array
from jax.typing import ArrayLike
from numpy.typing import NDArray

from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.physics.bodies.body import dot, scalars, whole
from drumsqueal.physics.effects.effect import BY_SHOE, AbstractContact, Observation
from drumsqueal.physics.effects.forcing import Forcing
from drumsqueal.physics.effects.friction import Friction
from drumsqueal.physics.effects.operation import OperatingPoint
from drumsqueal.physics.effects.several import Contacts
from drumsqueal.physics.friction_law import ConstantLaw, static_coefficient
from drumsqueal.physics.model import Model
from drumsqueal.programs import Program, compiled


def can_stick(model: Model, *, at_rest: bool) -> bool:
    """Whether the lining can move as one with the drum: with friction, and coordinates to follow it unless at rest."""
    return model.contact.friction is not None and (model.body.follows or at_rest)


class StuckModel(Model):
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
        force = _stiction_force(self, moment, free)
        return free + force, power + force @ v, self.memory_rate(memory, 0.0)

    def observe(self, time: ArrayLike, q: Array, v: Array, memory: Array | None = None) -> Observation:
        """Torque, forces and extent of the contact at one instant; nothing slips, nothing is turned into heat."""
        del memory
        moment = self.operation.at(time)
        observation = self.contact.with_friction(None).observe(moment, scalars(q), scalars(v))
        # Of turning with the drum at 1 rad/s, the work of what holds the lining.
        force = scalars(_stiction_force(self, moment, _without_friction(self, time, q, v)[0]))
        torque = jnp.asarray(dot(self.body.velocity_with_drum, force) + jnp.zeros(()))
        own = list(observation.by_shoe)
        if isinstance(self.contact, Contacts):
            for mine, contact in zip(self.contact.shares, self.contact.each, strict=True):
                own[mine.number * len(BY_SHOE)] = jnp.asarray(dot(contact.body.velocity_with_drum, mine.taken(force)))
        return observation._replace(sticking=jnp.ones(()), brake_torque=torque, by_shoe=tuple(own))


def stuck_model(model: Model) -> StuckModel:
    """The model while its lining sticks."""
    return StuckModel(**{field.name: getattr(model, field.name) for field in dataclasses.fields(model)})


@Program
def slip(model: Model, time: ArrayLike, v: Array) -> Array:
    """A bound on the slip speed (m/s) anywhere on the lining at velocities v (n,), reached up to a small factor."""
    return model.contact.fastest_slip(model.operation.at(time), scalars(v))


@Program
def slip_alone(model: Model, v: Array, time: ArrayLike = 0.0) -> Array:
    """The slip speed (m/s) that velocities v (n,) make on a drum at rest."""
    still = model.operation.at(time)._replace(drum_speed=jnp.zeros(()))
    return model.contact.fastest_slip(still, scalars(jnp.asarray(v)))


def slip_motion(model: Model, time: ArrayLike, v: Array) -> Array:
    """Velocity (n,) relative to the drum's motion; zero in coordinates that do not slip."""
    return jnp.where(_slips(model), v - rigid_rotation(model) * model.operation.at(time).drum_speed, 0.0)


def slip_acceleration(model: Model, time: ArrayLike, a: Array) -> Array:
    """Acceleration (n,) relative to the drum's motion; zero in coordinates that do not slip."""
    rate = model.operation.drum_speed.at(time)[1]
    return jnp.where(_slips(model), a - rigid_rotation(model) * (0.0 if rate is None else rate), 0.0)


@Program
def drum_motion(model: Model, time: ArrayLike, v: Array) -> Array:
    """Velocity (n,) of a shoe whose lining moves with the drum; coordinates that do not slip keep theirs."""
    return jnp.where(_slips(model), rigid_rotation(model) * model.operation.at(time).drum_speed, v)


class FrictionLimit(NamedTuple):
    """What friction needs to hold the lining (n,), and what it can: K's farthest points (k, n) in directions (k, n)."""

    needed: Array
    farthest: Array


@Program
def friction_limit(
    model: Model, time: ArrayLike, q: Array, v: Array, directions: Array, memory: Array | None = None
) -> FrictionLimit:
    """The force needed at a displacement q (n,), and the farthest points of the limit surface; v: what is free."""
    needed, farthest = _limits(model, time, q, v, memory)
    return FrictionLimit(needed, jax.lax.map(farthest, directions))


def _limits(
    model: Model, time: ArrayLike, q: Array, v: Array, memory: Array | None
) -> tuple[Array, Callable[[Array], Array]]:
    """The force needed (n,), and the farthest point (n,) of the limit surface in a direction, as a function of it."""
    moment = model.moment(time, memory)
    needed = _stiction_force(model, moment, _without_friction(model, time, q, v)[0])
    rough, smooth = model.contact.mapped(_holding), model.contact.with_friction(None)
    still, place = moment._replace(drum_speed=jnp.zeros(())), scalars(q)

    def force(contact: AbstractContact, motion: Array) -> Array:
        return whole(contact.act(still, place, scalars(motion)).force)

    without = force(smooth, jnp.zeros_like(q))
    return needed, lambda direction: force(rough, -direction) - without


def _holding(contact: AbstractContact) -> AbstractContact:
    """A contact with the friction that holds it: static, at every slip speed."""
    friction = contact.friction
    if friction is None:
        return contact
    return contact.with_friction(Friction(ConstantLaw(static_coefficient(friction.law)), friction.direction))


def _without_friction(model: Model, time: ArrayLike, q: Array, v: Array) -> tuple[Array, Array]:
    smooth = dataclasses.replace(model, contact=model.contact.with_friction(None))
    return Model.rates(smooth, time, q, v)[:2]  # not those of a model held, which asks for this


def _stiction_force(model: Model, moment: OperatingPoint, free: Array) -> Array:
    """M d Ω̇ − Q: what friction adds to the other forces Q (n,) so that the shoe turns with the drum."""
    rate = model.operation.drum_speed.at(moment.time)[1]
    turning = rigid_rotation(model) * model.mass * (0.0 if rate is None else rate)
    return jnp.where(_slips(model), turning - free, 0.0)


def rigid_rotation(model: Model) -> Array:
    """Velocities d of a shoe that turns with the drum at 1 rad/s."""
    return whole(model.body.velocity_with_drum)


def _slips(model: Model) -> np.ndarray:
    """Which coordinates have a slip velocity of their own (n,)."""
    return np.array(model.contact.slides)


class Stiction(NamedTuple):
    """Whether friction holds: `reserve` is what it could hold over what is needed, and how the lining slips if not.

    `direction` (n,) is the relative acceleration it slips with, to a slip speed of 1 m/s; zero where it holds.
    """

    reserve: Any
    direction: Any


def find_stiction(
    model: Model,
    time: ArrayLike,
    q: ArrayLike,
    v: ArrayLike,
    memory: Array | None = None,
    *,
    ends: Any = False,
) -> Stiction:
    """Decide whether the lining sticks at a displacement q (n,), moving with the drum.

    The reserve is min h(u) over the motions u with Q·u = 1, Q the force that is needed: at least one where it lies in
    the limit surface. Where sticking `ends`, the direction is given also at a reserve of just one.
    """
    # Arrays, for plain numbers would be compiled into the program; NumPy's, which take a tenth of the time of JAX's.
    return _find_stiction(model, *map(np.asarray, (time, q, v)), memory, np.bool_(ends))


@Program
def _find_stiction(model: Model, time: Array, q: Array, v: Array, memory: Array | None, ends: Array) -> Stiction:
    return stiction(model, time, q, v, memory, ends)


class StictionMargin(NamedTuple):
    """What friction has to spare, 1 − 1/reserve from −1 to 1; its rate (1/s); and the motion that is resisted least.

    That is one of the slipping coordinates (k,), by root mass.
    """

    value: Array
    rate: Array
    weakest: Array


def stiction_margin(
    model: Model,
    motion: Callable[[Array], tuple[ArrayLike, Array, Array, Array | None]],
    time: Array,
    near: Array | None = None,
) -> StictionMargin:
    """What friction has to spare at a time of a motion, which gives the model's time, q (n,), v (n,) and memory.

    Its rate is that along the motion that is resisted least: how that one changes counts for nothing (the envelope
    theorem). That motion is sought from a motion `near` on, such as that of a moment ago.
    """

    def acting(time: Array) -> tuple[Array, Callable[[Array], tuple[Array, Array]]]:
        moment, q, v, memory = motion(time)
        return _resistance(model, moment, q, drum_motion(model, moment, v), memory)[:2]

    needed, resistance = acting(time)
    weakest = _weakest(needed, resistance, needed if near is None else near)[1]

    def left(time: Array) -> Array:
        needed, resistance = acting(time)
        pulls, holds = jnp.sum(needed * weakest), resistance(weakest)[0]
        some = holds > 0
        return jnp.where(some, 1 - pulls / jnp.where(some, holds, 1.0), jnp.where(pulls > 0, -1.0, 1.0))

    value, rate = jax.jvp(left, (time,), (jnp.ones_like(time),))
    return StictionMargin(jnp.maximum(value, -1.0), rate, weakest)


def fastest_while_stuck(model: Model) -> Array:
    """A bound (rad/s) on the frequencies of what moves freely while the lining sticks, and acts on it; zero: nothing.

    Source of the bound: Gershgorin's circles of M^−½ K M^−½.
    """
    root = jnp.sqrt(jnp.asarray(model.mass))
    rows = jnp.sum(jnp.abs(jnp.asarray(model.stiffness) / root / root[:, None]) * ~_slips(model), axis=1)
    free = jnp.sqrt(jnp.max(jnp.where(_slips(model), 0.0, rows)))
    acting = [2 * jnp.pi * effect.frequency for effect in model.others if isinstance(effect, Forcing)]
    return jnp.max(jnp.stack([free, *acting]))


def stiction(model: Model, time: ArrayLike, q: Array, v: Array, memory: Array | None, ends: ArrayLike) -> Stiction:
    """What `find_stiction` gives, within a compiled call."""
    needed, resistance, widen = _resistance(model, time, q, v, memory)
    found, weakest = _weakest(needed, resistance, needed)

    # M r = −Q − ∂h(r): the least of ½ rᵀM r + h(r) + Q·r, from the direction that is resisted least.
    def decline(x: Array) -> tuple[Array, Array]:
        value, slope = resistance(x)
        return jnp.sum(x * x) / 2 + value + jnp.sum(needed * x), x + slope + needed

    def accelerated() -> Array:
        start = -weakest * (1 - found) * jnp.sum(needed * weakest) / jnp.sum(weakest * weakest)
        return minimum(decline, start)[0]

    # 1e-6 of the reserve: so little beyond it, the lining slips the way that is resisted least
    beyond = (found < 1 - 1e-6) & (needed.size > 1)  # one coordinate has but one way
    acceleration = jax.lax.cond(beyond, accelerated, lambda: -weakest)
    direction = widen(jnp.where(jnp.any(acceleration != 0), acceleration, -weakest))
    unit = slip(model, time, drum_motion(model, time, v) + direction)
    return Stiction(found, jnp.where((found < 1) | ends, direction / jnp.where(unit > 0, unit, 1.0), 0.0))


def _resistance(
    model: Model, time: ArrayLike, q: Array, v: Array, memory: Array | None
) -> tuple[Array, Callable[[Array], tuple[Array, Array]], Callable[[Array], Array]]:
    """Q (k,), h with its gradient as a function of a motion (k,), and what makes such a motion one of all n.

    All of coordinates that slip, multiplied or divided by the root of their mass.
    """
    slips, root = _slips(model), jnp.sqrt(jnp.asarray(model.mass))
    needed, farthest = _limits(model, time, q, v, memory)

    def narrow(force: Array) -> Array:
        return jnp.stack([force[i] / root[i] for i in np.flatnonzero(slips)])

    def widen(x: Array) -> Array:
        moving = iter(x)
        return jnp.stack([next(moving) / root[i] if each else jnp.zeros(()) for i, each in enumerate(slips)])

    def resistance(x: Array) -> tuple[Array, Array]:
        force = narrow(farthest(widen(x)))
        return jnp.sum(force * x), force

    return narrow(needed), resistance, widen


def _weakest(needed: Array, resistance: Callable[[Array], tuple[Array, Array]], near: Array) -> tuple[Array, Array]:
    """The least of h(u) where Q·u = 1, and u times |Q|; h is convex."""
    size = jnp.sqrt(jnp.sum(needed * needed))
    along = jnp.where(size > 0, needed / jnp.where(size > 0, size, 1.0), jnp.eye(needed.size)[0])
    # What is at right angles to it, by the reflection (Householder) that takes the first axis to it.
    mirror = along + jnp.where(along[0] < 0, -1.0, 1.0) * jnp.eye(needed.size)[0]
    across = jnp.eye(needed.size)[1:] - along[1:, None] * mirror / (1 + jnp.abs(along[0]))

    def motion(y: Array) -> Array:
        return along + jnp.sum(y[:, None] * across, axis=0)

    def resisted(y: Array) -> tuple[Array, Array]:
        value, slope = resistance(motion(y))
        return value, jnp.sum(across * slope, axis=1)

    ahead = jnp.sum(along * near)
    begin = jnp.sum(across * near, axis=1) / jnp.where(ahead > 0, ahead, jnp.inf)
    best, least = minimum(resisted, begin)
    return jnp.where(size > 0, least / jnp.where(size > 0, size, 1.0), jnp.inf), motion(best)


# Where a convex function is least, within a kernel: the method of Broyden, Fletcher, Goldfarb & Shanno.


class _Search(NamedTuple):
    """Where it is, value and slope there, the inverse of the curvature, the way from there, and how far is tried."""

    x: Array
    value: Array
    slope: Array
    inverse: Array
    way: Array
    low: Array
    high: Array
    length: Array
    tries: Array
    count: Array


def minimum(function: Callable[[Array], tuple[Array, Array]], start: Array) -> tuple[Array, Array]:
    """Where a convex function of (k,), given with its gradient (k,), is least, and its value there; it may have kinks.

    The length of a step is found by halving and doubling, as Lewis & Overton, Mathematical Programming 141 (2013) 135.
    """
    most_tries, most_steps = 30, 300  # lengths of a step that are tried, and of all steps
    # of the slope along the way: how far down, and how much less steep, a step has to get
    descent, curvature = 1e-4, 0.5
    if start.size == 0:
        return start, function(start)[0]

    def look(now: _Search) -> _Search:
        x = now.x + now.length * now.way
        value, slope = function(x)
        before, after = jnp.sum(now.slope * now.way), jnp.sum(slope * now.way)
        far = value > now.value + descent * now.length * before + 4 * np.finfo(np.float64).eps * jnp.abs(value)
        near = ~far & (after < curvature * before)
        low, high = jnp.where(near, now.length, now.low), jnp.where(far, now.length, now.high)
        length = jnp.where(jnp.isfinite(high), (low + high) / 2, 2 * low)
        again = now._replace(low=low, high=high, length=length, tries=now.tries + 1, count=now.count + 1)
        inverse = _updated(now.inverse, x - now.x, slope - now.slope)
        way = -jnp.sum(inverse * slope, axis=1)
        there = _Search(x, value, slope, inverse, way, zero, infinity, zero + 1, none, now.count + 1)
        return jax.tree.map(lambda one, other: jnp.where(far | near, one, other), again, there)

    def unfinished(now: _Search) -> Array:
        gain = -jnp.sum(now.slope * now.way)
        tries = (now.tries < most_tries) & (now.count < most_steps)
        # 1e-15 of the least value: what is left to gain
        return (now.count == 0) | (tries & (gain > 1e-15 * jnp.abs(now.value)))

    zero, infinity, none = jnp.zeros(()), jnp.full((), jnp.inf), jnp.zeros((), int)
    nothing = jnp.zeros(start.size)
    first = _Search(start, infinity, nothing, jnp.eye(start.size), nothing, zero, infinity, zero + 1, none, none)
    found = jax.lax.while_loop(unfinished, look, first)
    return found.x, found.value


def _updated(inverse: Array, step: Array, change: Array) -> Array:
    """The inverse (k, k) of a curvature by which the slope changes so over that step; as it was where that is none."""
    bend = jnp.sum(step * change)
    share = step / jnp.where(bend > 0, bend, 1.0)
    moved = jnp.sum(inverse * change, axis=1)
    new = (
        inverse
        - share[:, None] * moved
        - moved[:, None] * share
        + (1 + jnp.sum(change * moved) / bend) * (share[:, None] * step)
    )
    return jnp.where(bend > 0, new, inverse)


_BLOCK = 512  # states at a time, so that one program serves records of every length and Ctrl-C responds


def accelerations(
    model: Model,
    times: npt.ArrayLike,
    displacement: npt.ArrayLike,
    velocity: npt.ArrayLike,
    sticks: npt.ArrayLike,
    memory: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """q̈ = M⁻¹ Σ Q(t, q, q̇) at k times (s), displacements and velocities (k, n) in SI, shape (k, n).

    `memory` (k, m) is what effects remembered, if any does.
    Where the lining `sticks` (k,) to the drum as a whole, friction is what makes the motion the drum's own. Raises
    KeyboardInterrupt between two blocks.
    """
    t, q, v = (np.asarray(x, dtype=np.float64) for x in (times, displacement, velocity))
    stuck = np.asarray(sticks, dtype=bool)
    result = np.empty_like(q)
    for which, acting in ((~stuck, model), (stuck, stuck_model(model) if stuck.any() else model)):
        rows = np.flatnonzero(which)
        for first in range(0, rows.size, _BLOCK):
            stop_if_interrupted()
            block = rows[first : first + _BLOCK]
            filled = np.resize(block, _BLOCK)
            result[block] = np.asarray(
                _accelerations(acting, t[filled], q[filled], v[filled], None if memory is None else memory[filled])
            )[: block.size]
    return result


@compiled
def _accelerations(model: Model, times: Array, displacement: Array, velocity: Array, memory: Array | None) -> Array:
    states = jax.tree.map(jnp.asarray, (times, displacement, velocity, memory))
    return jax.lax.map(lambda state: model.rates(*state)[0] / model.mass, states)
