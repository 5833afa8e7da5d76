"""An instant of a brake whose drum speed or load change."""

import numpy as np

from drumsqueal.findings.part import Finding
from drumsqueal.physics.effects.operation import Profile, Schedule
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.passage import value_at

SPEED, LOAD = "drum.speed", "contact.normal_load"


class Instant(Finding):
    """A time (s) with the drum speed and the load at it, and how fast these change."""

    time_s: float
    drum_speed_rad_per_s: float
    normal_load_N: float
    drum_speed_rate_rad_per_s2: float
    normal_load_rate_N_per_s: float


def changing_keys(model: Model) -> dict[str, Profile]:
    """What changes, by its key in a scene."""
    both = {SPEED: model.operation.drum_speed, LOAD: model.operation.preload}
    return {key: each for key, each in both.items() if isinstance(each, Profile) and np.ptp(np.asarray(each.value)) > 0}


def instant_at(model: Model, time: float) -> Instant:
    """The drum speed and the load of a model at a time (s)."""
    speed, load, area = model.operation.drum_speed, model.operation.preload, float(model.body.area)
    return Instant(
        time_s=time,
        drum_speed_rad_per_s=value_at(speed, time),
        normal_load_N=area * value_at(load, time),
        drum_speed_rate_rad_per_s2=_rate_at(speed, time),
        normal_load_rate_N_per_s=area * _rate_at(load, time),
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
