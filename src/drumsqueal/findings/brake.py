"""What a shoe does as a brake in steady sliding: torque, pressure along the lining, leading or trailing, locking."""

import math
from collections.abc import Iterator
from enum import StrEnum
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from pydantic import FiniteFloat

from drumsqueal.findings.part import Finding
from drumsqueal.findings.prediction import Prediction
from drumsqueal.physics.model import Model
from drumsqueal.scene import Scene
from drumsqueal.solve.linear.modes import Stability, while_sliding
from drumsqueal.solve.linear.steady import observe_steady, raise_friction

ANGLES = 253  # along the lining: every half degree of 126
LARGEST_COEFFICIENT = 5.0  # of friction, up to which self-locking is looked for; a lining has 0.6 at most
NEITHER = 1e-6  # by which friction must change the normal force


class Sense(StrEnum):
    """Whether friction presses a shoe on the drum."""

    LEADING = "leading"
    TRAILING = "trailing"
    NEITHER = "neither"


HOW = {
    Sense.LEADING: ("friction presses it on", "Leading"),
    Sense.TRAILING: ("friction pushes it off", "Trailing"),
    Sense.NEITHER: ("friction leaves it", "Neither leading nor trailing"),
}


class Reaction(Finding):
    """What springs at one point exert on the shoe: the point (m), their places in the scene, and the force (N)."""

    at_m: tuple[float, float, float]
    springs: tuple[int, ...]
    force_N: tuple[float, float, float]

    @property
    def size_N(self) -> float:
        """Of the force."""
        return math.hypot(*self.force_N)


class Brake(Finding):
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


class PredictionOfBrake(Prediction):
    """The eigenvalue problem with the brake in whose steady sliding it is."""

    brake: Brake


def describe_brake(scene: Scene, linear: Model, stability: Stability) -> Brake | None:
    """Describe the steady sliding of a stability; None where the assembly balances it, so that it is known beforehand.

    `linear` is the model of the eigenvalues.
    """
    if linear.balanced:
        return None
    model, q = while_sliding(linear)[0].frozen(0.0), np.asarray(stability.steady_state)
    moment, contact, shoe = model.operation.at(0.0), model.lining, model.shoe
    speed, radius, friction = float(moment.drum_speed), float(shoe.outer_radius), contact.friction
    here = 0.0 if friction is None else float(friction.law.coefficient(jnp.asarray(radius * abs(speed))))
    half = math.degrees(float(shoe.half_angle))
    angles, lines = np.linspace(-half, half, ANGLES), float(shoe.width) / 2 * np.array([0.0, -1.0, 1.0])
    still, theta = np.zeros_like(q), np.deg2rad(angles)
    pressures = np.stack([contact.along_arc(moment, q, still, theta, z)[0] for z in lines])
    low, high = stability.pressure_range
    _, observed = observe_steady(model, q)
    torque, normal = float(observed.brake_torque), float(observed.normal_force)
    ends = (-half, half) if speed >= 0 else (half, -half)
    return Brake(
        time_s=stability.time,
        brake_torque_N_m=math.copysign(1.0, speed) * torque,
        normal_force_N=normal,
        mean_pressure_Pa=normal / float(shoe.area),
        largest_pressure_Pa=high,
        largest_pressure_at_deg=float(angles[pressures.max(axis=0).argmax()]),
        smallest_pressure_Pa=low,
        smallest_pressure_at_deg=float(angles[pressures.min(axis=0).argmin()]),
        contact_fraction=stability.contact_fraction,
        leading_end_deg=ends[0],
        trailing_end_deg=ends[1],
        friction_coefficient=here,
        reactions=_reactions(scene, model, q),
        angle_deg=tuple(angles.tolist()),
        pressure_Pa=tuple(pressures[0].tolist()),
        **(_as_pushed(model, torque, normal, here) if model.pushed else {}),
    )


def _as_pushed(model: Model, torque: float, normal: float, here: float) -> dict[str, Any]:
    """Brake factor, sense and locking of a shoe that forces at points push."""
    raised = raise_friction(model, LARGEST_COEFFICIENT / here if here > 0 else 1.0)
    applied = sum(abs(float(size)) for size, _ in model.operation.at(0.0).pushes)
    found: dict[str, Any] = {"applied_force_N": applied}
    if applied > 0 and float(model.operation.at(0.0).preload) == 0:  # a load that presses, too, is not in the factor
        found["brake_factor"] = abs(torque) / (applied * float(model.shoe.outer_radius))
    alone = float(observe_steady(model, raised.frictionless)[1].normal_force)
    if math.isfinite(alone) and alone > 0:
        ratio = normal / alone
        sense = Sense.LEADING if ratio > 1 else Sense.TRAILING
        found |= {"self_energisation": ratio, "sense": sense if abs(ratio - 1) > NEITHER else Sense.NEITHER}
    if here > 0 and normal > 0:
        if np.all(np.isfinite(raised.displacement)):
            found["no_locking_up_to"] = LARGEST_COEFFICIENT
        elif bool(raised.runs_off):
            found["locking_coefficient"] = float(raised.fraction) * LARGEST_COEFFICIENT
    return found


def _reactions(scene: Scene, model: Model, q: np.ndarray) -> tuple[Reaction, ...]:
    """The forces of the springs at points on the shoe, those at one point together."""
    found: dict[tuple[float, ...], tuple[list[int], np.ndarray]] = {}
    shoe = jax.tree.map(np.asarray, model.shoe)  # so that no operation on its own is a program to compile
    for k, spring in enumerate(scene.shoe.spring):
        moved = np.asarray(shoe.shapes_at(np.asarray(spring.at))) @ q
        direction = np.asarray(spring.direction)
        places, force = found.setdefault(tuple(spring.at), ([], np.zeros(3)))
        places.append(k)
        force -= spring.stiffness * (direction @ moved) * direction
    return tuple(
        Reaction.model_validate({"at_m": at, "springs": tuple(places), "force_N": tuple(force.tolist())})
        for at, (places, force) in found.items()
    )


def brake_sentences(brake: Brake) -> Iterator[str]:
    """What a brake engineer asks of it."""
    when = f" at t = {brake.time_s:g} s" if brake.time_s > 0 else ""
    torque = f"Brake torque {brake.brake_torque_N_m:.4g} N m in steady sliding{when}"
    factor = "" if brake.brake_factor is None else f", brake factor {brake.brake_factor:.4g}: torque over"
    yield torque + (f"{factor} {brake.applied_force_N:.4g} N times the drum's radius." if factor else ".")
    if brake.self_energisation is not None:
        friction, name = HOW[brake.sense or Sense.NEITHER]
        normal = f"the normal force of {brake.normal_force_N:.4g} N"
        yield f"{name} shoe: {friction}; {normal} is {brake.self_energisation:.4g} times that without friction."
    if brake.locking_coefficient is not None:
        margin = brake.locking_coefficient / brake.friction_coefficient
        begins = f"Self-locking begins at a coefficient of friction of {brake.locking_coefficient:.4g}"
        yield f"{begins}, {margin:.3g} times the {brake.friction_coefficient:.4g} here."
    elif brake.no_locking_up_to is not None:
        yield f"No self-locking up to a coefficient of friction of {brake.no_locking_up_to:g}."
    largest = f"up to {brake.largest_pressure_Pa / 1e3:.4g} kPa at {brake.largest_pressure_at_deg:+.3g} deg"
    smallest = f"down to {brake.smallest_pressure_Pa / 1e3:.3g} kPa at {brake.smallest_pressure_at_deg:+.3g} deg"
    yield f"Pressure {largest}, {smallest}; {100 * brake.contact_fraction:.4g} % of the lining touches."
    leading, trailing = (f"{angle:+.3g} deg" for angle in (brake.leading_end_deg, brake.trailing_end_deg))
    yield f"The drum comes in at {leading} (leading end of the lining) and leaves at {trailing} (trailing end)."
    for each in brake.reactions:
        in_mm = [1e3 * value for value in each.at_m]
        at, force = (", ".join(f"{value:.4g}" for value in values) for values in (in_mm, each.force_N))
        which = f"spring{'s'[: len(each.springs) > 1]} {' and '.join(map(str, each.springs))}"
        yield f"Force of {which} at ({at}) mm on the shoe: ({force}) N, {each.size_N:.4g} N in all."
