"""What a shoe does as a brake in steady sliding: torque, pressure along the lining, leading or trailing, locking."""

import math
from collections.abc import Iterator, Mapping
from enum import StrEnum
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from pydantic import FiniteFloat

from drumsqueal.findings.prediction import Prediction
from drumsqueal.findings.schema import Finding
from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe
from drumsqueal.physics.elasticity import numbers_of_shoes, resolved
from drumsqueal.physics.friction_law import coefficient_at
from drumsqueal.physics.model import Model
from drumsqueal.physics.shoe_building import Composition, along_points
from drumsqueal.scene import Scene
from drumsqueal.scene.quantities import ROUND_OFF
from drumsqueal.solve.linear.equilibrium import Equilibrium
from drumsqueal.solve.linear.modes import Stability, while_sliding
from drumsqueal.solve.linear.steady import observe_steady, raise_friction

LARGEST_COEFFICIENT = 5.0  # of friction, up to which self-locking is looked for; a lining has 0.6 at most


class Sense(StrEnum):
    """Whether friction presses a shoe on the drum."""

    LEADING = "leading"
    TRAILING = "trailing"
    NEITHER = "neither"


class Reaction(Finding):
    """What springs at one point exert on the shoe: the point (m), their places in the scene, and the force (N)."""

    at_m: tuple[float, float, float]
    springs: tuple[int, ...]
    force_N: tuple[float, float, float]


class ShoeAsBrake(Finding):
    """A shoe in steady sliding as a brake, by the drum's speed, the load and the forces at `time_s`.

    `brake_torque_N_m` is positive where it brakes. `applied_force_N` is the sum of the sizes of all forces at points,
    and `brake_factor` the torque over that times the drum's radius, None where a load presses, too. `self_energisation`
    is the normal force over that under the same forces without friction: a leading shoe has more than 1, a trailing one
    less. Self-locking begins at `locking_coefficient`; where that is None, there is none up to `no_locking_up_to`, and
    where that is None, too, the way there is not known. All these are None for a shoe that no force at a point pushes.
    Angles are from the middle of the lining, positive the way the drum passes at positive speed; the drum comes in at
    the leading end of the lining and leaves at the trailing end. The pressure is that of the middle line, its extremes
    are those of the lining.
    """

    time_s: float
    brake_torque_N_m: FiniteFloat
    normal_force_N: FiniteFloat
    mean_pressure_Pa: FiniteFloat
    largest_pressure_Pa: FiniteFloat
    largest_pressure_at_deg: float
    smallest_pressure_Pa: FiniteFloat
    smallest_pressure_at_deg: float
    contact_fraction: float
    leading_end_deg: float
    trailing_end_deg: float
    friction_coefficient: float
    reactions: tuple[Reaction, ...]
    angle_deg: tuple[float, ...]
    pressure_Pa: tuple[float, ...]
    applied_force_N: float | None = None
    brake_factor: float | None = None
    self_energisation: float | None = None
    sense: Sense | None = None
    locking_coefficient: float | None = None
    no_locking_up_to: float | None = None


class Brakes(Finding):
    """Several shoes in steady sliding as one brake, and each of them, by its name.

    Torque and force are the sums, and `brake_factor` is the torque over the force times the drum's radius. Self-locking
    is that of all shoes together, with friction raised on all of them; the coefficients are the largest of any shoe.
    """

    brake_torque_N_m: FiniteFloat
    applied_force_N: float | None = None
    brake_factor: float | None = None
    locking_coefficient: float | None = None
    no_locking_up_to: float | None = None
    friction_coefficient: float
    shoes: dict[str, ShoeAsBrake]


class PredictionOfBrake(Prediction):
    """The eigenvalue problem with the brake in whose steady sliding it is."""

    brake: ShoeAsBrake | Brakes


def describe_brake(scene: Scene, linear: Model, stability: Stability) -> ShoeAsBrake | Brakes | None:
    """Describe the steady sliding of a stability; None where the assembly balances it, so that it is known beforehand.

    `linear` is the model of the eigenvalues.
    """
    if linear.balanced:
        return None
    model, q = while_sliding(linear)[0].frozen(0.0), np.asarray(stability.steady_state)
    speed = abs(float(model.contact.radius * model.operation.at(0.0).drum_speed))
    frictions = [side.contact.friction for _, side in model.sides]
    here = max(0.0 if each is None else float(coefficient_at(each.law, np.asarray(speed))) for each in frictions)
    raised = raise_friction(model, LARGEST_COEFFICIENT / here if here > 0 else 1.0) if model.pushed else None
    sizes = [float(size) for size, _ in model.operation.at(0.0).pushes]
    found, observed = {}, None if scene.several else (stability.pressure_range, stability.contact_fraction)
    for (mine, side), one, name in zip(model.sides, resolved(scene).alone, scene.shoe_names, strict=True):
        own, places = [sizes.pop(0) for _ in one.shoe.force], np.array(mine.places)
        frictionless = None if raised is None else np.asarray(raised.frictionless)[places]
        found[name] = _describe(one, side, q[places], stability.time, own, frictionless, observed)
    total = sum(each.brake_torque_N_m for each in found.values())
    pushed = {} if raised is None else _as_pushed(model, abs(total), found, here, raised)
    if scene.several:
        return Brakes(brake_torque_N_m=total, friction_coefficient=here, shoes=found, **pushed)
    return found[""].model_copy(update=pushed)


def _describe(
    scene: Scene,
    model: Model,
    q: np.ndarray,
    time: float,
    pushes: list[float],
    frictionless: np.ndarray | None,
    known: tuple[tuple[float, float], float] | None,
) -> ShoeAsBrake:
    """One shoe at a displacement (n,), pushed by forces (N); of its contact what is `known` is not found again."""
    moment, contact, shoe = model.operation.at(0.0), model.lining, model.shoe
    speed, radius, friction = float(moment.drum_speed), float(shoe.outer_radius), contact.friction
    half = math.degrees(float(shoe.half_angle))
    # 253 along the lining: every half degree of 126
    angles, lines = np.linspace(-half, half, 253), float(shoe.width) / 2 * np.array([0.0, -1.0, 1.0])
    pressures = _pressures(model, q, np.deg2rad(angles), lines)
    extremes, observed = observe_steady(model, q)
    (low, high), fraction = known or ((float(extremes[0]), float(extremes[1])), float(observed.contact_fraction))
    torque, normal = float(observed.brake_torque), float(observed.normal_force)
    ends = (-half, half) if speed >= 0 else (half, -half)
    found: dict[str, Any] = {}
    if frictionless is not None and pushes:
        found = _energised(model, normal, frictionless)
        found["applied_force_N"] = applied = sum(map(abs, pushes))
        if applied > 0 and float(moment.preload) == 0:  # a load that presses, too, is not in the factor
            found["brake_factor"] = abs(torque) / (applied * radius)
    return ShoeAsBrake(
        time_s=time,
        brake_torque_N_m=math.copysign(1.0, speed) * torque,
        normal_force_N=normal,
        mean_pressure_Pa=normal / float(shoe.area),
        largest_pressure_Pa=high,
        largest_pressure_at_deg=float(angles[pressures.max(axis=0).argmax()]),
        smallest_pressure_Pa=low,
        smallest_pressure_at_deg=float(angles[pressures.min(axis=0).argmin()]),
        contact_fraction=fraction,
        leading_end_deg=ends[0],
        trailing_end_deg=ends[1],
        friction_coefficient=0.0
        if friction is None
        else float(coefficient_at(friction.law, np.asarray(radius * abs(speed)))),
        reactions=_reactions(scene, model, q),
        angle_deg=tuple(angles.tolist()),
        pressure_Pa=tuple(pressures[0].tolist()),
        **found,
    )


@Interpreted
def _pressures(model: Model, q: Array, angles: Array, lines: Array) -> Array:
    """On lines z (m) along the arc (lines, angles), in Pa, in steady sliding at a displacement (n,)."""
    moment, still = model.operation.at(0.0), jnp.zeros_like(q)
    return jax.lax.map(lambda z: model.lining.along_arc(moment, q, still, angles, z)[0], lines)


@Interpreted
def _along_springs(shoe: RigidShoe, numbers: Mapping[str, Array], composition: Composition) -> Array:
    """How 1 of each coordinate stretches each spring, (springs, n)."""
    return along_points(composition, numbers, shoe)[0]


def _energised(model: Model, normal: float, frictionless: np.ndarray) -> dict[str, Any]:
    """Normal force over that without friction, where the shoe is displaced as it is then (n,)."""
    alone = float(observe_steady(model, frictionless)[1].normal_force)
    if not math.isfinite(alone) or not alone > 0:
        return {}
    ratio = normal / alone
    sense = Sense.LEADING if ratio > 1 else Sense.TRAILING
    # By 1e-6 friction must change the normal force.
    return {"self_energisation": ratio, "sense": sense if abs(ratio - 1) > 1e-6 else Sense.NEITHER}


def _as_pushed(
    model: Model, torque: float, shoes: dict[str, ShoeAsBrake], here: float, raised: Equilibrium
) -> dict[str, Any]:
    """Force and brake factor of all shoes that forces at points push, and locking, with friction `raised` on all."""
    applied = sum(each.applied_force_N or 0.0 for each in shoes.values())
    found: dict[str, Any] = {"applied_force_N": applied}
    moment = model.operation.at(0.0)
    if applied > 0 and not any(float(each) for each, _ in ((moment.preload, None), *moment.further)):
        found["brake_factor"] = torque / (applied * float(model.contact.radius))
    if here > 0 and sum(each.normal_force_N for each in shoes.values()) > 0:
        if np.all(np.isfinite(raised.displacement)):
            found["no_locking_up_to"] = LARGEST_COEFFICIENT
        elif bool(raised.runs_off):
            found["locking_coefficient"] = float(raised.fraction) * LARGEST_COEFFICIENT
    return found


def _reactions(scene: Scene, model: Model, q: np.ndarray) -> tuple[Reaction, ...]:
    """The forces of the springs at points on the shoe, those at one point together."""
    found: dict[tuple[float, ...], tuple[list[int], np.ndarray]] = {}
    if not scene.shoe.spring:
        return ()
    numbers = {key: np.asarray(each) for key, each in numbers_of_shoes(scene).items() if key.startswith("shoe.")}
    composition = Composition((), springs=len(scene.shoe.spring), mesh=scene.shoe.solid is not None)
    stretched = np.asarray(_along_springs(model.shoe, numbers, composition)) @ q
    for k, spring in enumerate(scene.shoe.spring):
        places, force = found.setdefault(tuple(spring.at), ([], np.zeros(3)))
        places.append(k)
        force -= spring.stiffness * stretched[k] * np.asarray(spring.direction)
    return tuple(
        Reaction.model_validate({"at_m": at, "springs": tuple(places), "force_N": tuple(force.tolist())})
        for at, (places, force) in found.items()
    )


def shoes_of(brake: ShoeAsBrake | Brakes) -> dict[str, ShoeAsBrake]:
    """Its shoes by their names, "" where there is one."""
    return brake.shoes if isinstance(brake, Brakes) else {"": brake}


def brake_sentences(brake: ShoeAsBrake | Brakes) -> Iterator[str]:
    """What a brake engineer asks of it."""
    of, time = (" of all shoes", 0.0) if isinstance(brake, Brakes) else ("", brake.time_s)
    when = f" at t = {time:g} s" if time > 0 else ""
    torque = f"Brake torque{of} {brake.brake_torque_N_m:.4g} N m in steady sliding{when}"
    factor = "" if brake.brake_factor is None else f", brake factor {brake.brake_factor:.4g}: torque over"
    yield torque + (f"{factor} {brake.applied_force_N:.4g} N times the drum's radius." if factor else ".")
    if isinstance(brake, Brakes):
        yield from _about_locking(brake)
        for name, each in brake.shoes.items():
            yield from (f"{name}: {line}" for line in brake_sentences(each))
        return
    if brake.self_energisation is not None:
        how = {
            Sense.LEADING: ("friction presses it on", "Leading"),
            Sense.TRAILING: ("friction pushes it off", "Trailing"),
            Sense.NEITHER: ("friction leaves it", "Neither leading nor trailing"),
        }
        friction, name = how[brake.sense or Sense.NEITHER]
        normal = f"the normal force of {brake.normal_force_N:.4g} N"
        yield f"{name} shoe: {friction}; {normal} is {brake.self_energisation:.4g} times that without friction."
    yield from _about_locking(brake)
    largest = f"up to {brake.largest_pressure_Pa / 1e3:.4g} kPa at {brake.largest_pressure_at_deg:+.3g} deg"
    smallest = f"down to {brake.smallest_pressure_Pa / 1e3:.3g} kPa at {brake.smallest_pressure_at_deg:+.3g} deg"
    yield f"Pressure {largest}, {smallest}; {100 * brake.contact_fraction:.4g} % of the lining touches."
    leading, trailing = (f"{angle:+.3g} deg" for angle in (brake.leading_end_deg, brake.trailing_end_deg))
    yield f"The drum comes in at {leading} (leading end of the lining) and leaves at {trailing} (trailing end)."
    for each in brake.reactions:
        in_mm = [1e3 * value for value in each.at_m]
        seen = [value if abs(value) > ROUND_OFF * brake.normal_force_N else 0.0 for value in each.force_N]
        at, force = (", ".join(f"{value:.4g}" for value in values) for values in (in_mm, seen))
        which = f"spring{'s'[: len(each.springs) > 1]} {' and '.join(map(str, each.springs))}"
        yield f"Force of {which} at ({at}) mm on the shoe: ({force}) N, {math.hypot(*seen):.4g} N in all."


def _about_locking(brake: ShoeAsBrake | Brakes) -> Iterator[str]:
    if brake.locking_coefficient is not None:
        margin = brake.locking_coefficient / brake.friction_coefficient
        if isinstance(brake, Brakes):  # which may have a coefficient each
            largest = f"the largest coefficient is then {brake.locking_coefficient:.4g}"
            yield f"Self-locking begins at {margin:.3g} times the friction here: {largest}."
            return
        begins = f"Self-locking begins at a coefficient of friction of {brake.locking_coefficient:.4g}"
        yield f"{begins}, {margin:.3g} times the {brake.friction_coefficient:.4g} here."
    elif brake.no_locking_up_to is not None:
        yield f"No self-locking up to a coefficient of friction of {brake.no_locking_up_to:g}."
