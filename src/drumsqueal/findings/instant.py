"""An instant of a brake whose drum speed, load or forces change."""

import re

import numpy as np

from drumsqueal.findings.part import Finding
from drumsqueal.physics.effects.operation import Profile, Schedule
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.passage import value_at

SPEED, LOAD = "drum.speed", "contact.normal_load"
FORCE = re.compile(r"shoe\.force\.(\d+)\.size")


class Instant(Finding):
    """A time (s) with drum speed, load and forces at points at it, and how fast these change."""

    time_s: float
    drum_speed_rad_per_s: float
    normal_load_N: float
    drum_speed_rate_rad_per_s2: float
    normal_load_rate_N_per_s: float
    forces_N: tuple[float, ...] = ()
    force_rates_N_per_s: tuple[float, ...] = ()

    def value(self, key: str) -> float:
        """What a key of the scene stands for, in rad/s or N."""
        if (force := FORCE.fullmatch(key)) is not None:
            return self.forces_N[int(force[1])]
        return {SPEED: self.drum_speed_rad_per_s, LOAD: self.normal_load_N}[key]

    def rate(self, key: str) -> float:
        """How fast it changes, in rad/s² or N/s."""
        if (force := FORCE.fullmatch(key)) is not None:
            return self.force_rates_N_per_s[int(force[1])]
        return {SPEED: self.drum_speed_rate_rad_per_s2, LOAD: self.normal_load_rate_N_per_s}[key]


def unit_of_key(key: str) -> str:
    """The unit of what changes."""
    return "rad/s" if key == SPEED else "N"


def name_of_key(key: str) -> str:
    """What changes, in words; forces are counted from 0, as in the scene's keys."""
    if (force := FORCE.fullmatch(key)) is not None:
        return f"force {force[1]}"
    return {SPEED: "drum speed", LOAD: "load"}[key]


def changing_keys(model: Model) -> dict[str, Profile]:
    """What changes, by its key in a scene."""
    operation = model.operation
    forces = {f"shoe.force.{k}.size": force for k, force in enumerate(operation.pushes)}
    schedules = {SPEED: operation.drum_speed, LOAD: operation.preload, **forces}
    return {
        key: each for key, each in schedules.items() if isinstance(each, Profile) and np.ptp(np.asarray(each.value)) > 0
    }


def instant_at(model: Model, time: float) -> Instant:
    """Drum speed, load and forces of a model at a time (s)."""
    speed, load, area = model.operation.drum_speed, model.operation.preload, float(model.body.area)
    return Instant(
        time_s=time,
        drum_speed_rad_per_s=value_at(speed, time),
        normal_load_N=area * value_at(load, time),
        drum_speed_rate_rad_per_s2=_rate_at(speed, time),
        normal_load_rate_N_per_s=area * _rate_at(load, time),
        forces_N=tuple(value_at(force, time) for force in model.operation.pushes),
        force_rates_N_per_s=tuple(_rate_at(force, time) for force in model.operation.pushes),
    )


def _rate_at(schedule: Schedule, time: float) -> float:
    """How fast a schedule changes at a time (s), from the left at a corner."""
    if not isinstance(schedule, Profile):
        return 0.0
    times, values = np.asarray(schedule.time), np.asarray(schedule.value)
    k = int(np.searchsorted(times, time, side="left"))
    if k == 0 and time == times[0]:
        k = 1
    return float((values[k] - values[k - 1]) / (times[k] - times[k - 1])) if 0 < k < times.size else 0.0
