"""An instant of a brake whose drum speed, load or forces change."""

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from drumsqueal.findings.schema import Finding
from drumsqueal.physics.effects.operation import Operation, PiecewiseLinear, Schedule
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.passage import value_at

SPEED, LOAD = "drum.speed", "contact.normal_load"
FORCE = re.compile(r"shoe\.(?:(?P<shoe>\d+)\.)?force\.(?P<force>\d+)\.size")


class Instant(Finding):
    """A time (s) with drum speed and load at it, how fast these change, and what else drives the brake.

    The load is that of all shoes. `driven` has the value (rad/s or N) and the rate (per s) of all that drives the
    brake by its key in `drives_of`.
    """

    time_s: float
    drum_speed_rad_per_s: float
    normal_load_N: float
    drum_speed_rate_rad_per_s2: float
    normal_load_rate_N_per_s: float
    driven: dict[str, tuple[float, float]]

    def value(self, key: str) -> float:
        """What a key stands for, in rad/s or N."""
        return self.driven[key][0]

    def rate(self, key: str) -> float:
        """How fast it changes, in rad/s² or N/s."""
        return self.driven[key][1]


class Drive(NamedTuple):
    """What drives a brake: a schedule, and how many rad/s or N one of its units is."""

    schedule: Schedule
    scale: float = 1.0

    def at(self, time: float) -> tuple[float, float]:
        """Value and rate at a time (s), in rad/s or N."""
        return self.scale * value_at(self.schedule, time), self.scale * _rate_at(self.schedule, time)


def unit_of_key(key: str) -> str:
    """The unit of what changes."""
    return "rad/s" if key == SPEED else "N"


def name_of_key(key: str) -> str:
    """What changes, in words; forces and shoes are counted from 0, as in the scene's keys."""
    found = FORCE.fullmatch(key) or re.fullmatch(rf"shoe\.(?P<shoe>\d+)\.{re.escape(LOAD)}", key)
    if found is None:
        return {SPEED: "drum speed", LOAD: "load"}[key]
    parts = found.groupdict()
    what = f"force {parts['force']}" if "force" in parts else "load"
    return what if parts["shoe"] is None else f"{what} of shoe {parts['shoe']}"


def drives_of(model: Model) -> dict[str, Drive]:
    """What drives a brake, by its key in the scene of one shoe, or as each of several may have it of its own.

    What is the same on all shoes at all times, as the forces of one pressure on all pistons, is one drive under the key
    for one shoe. Loads that differ have the keys of the shoes' own tables, also where a shoe goes by the shared one.
    """
    return _drives(model.operation, _loads(model))


def _drives(operation: Operation, loads: list[Drive]) -> dict[str, Drive]:
    of_shoes = [{LOAD: load} for load in loads]
    for shoe, force in zip(operation.pushed_shoes or [0] * len(operation.pushes), operation.pushes, strict=True):
        of_shoes[shoe][f"shoe.force.{len(of_shoes[shoe]) - 1}.size"] = Drive(force)
    found = {SPEED: Drive(operation.drum_speed)}
    for key in dict.fromkeys(key for own in of_shoes for key in own):
        drives = {k: own[key] for k, own in enumerate(of_shoes) if key in own}
        if len(drives) == len(of_shoes) and all(_same(drives[0], each) for each in drives.values()):
            found[key] = drives[0]
        else:
            found |= {f"shoe.{k}.{key.removeprefix('shoe.')}": each for k, each in drives.items()}
    return found


def _loads(model: Model) -> list[Drive]:
    """That of every shoe."""
    sides = zip(model.operation.preloads, model.sides, strict=True)
    return [Drive(load, float(side.body.area)) for load, (_, side) in sides]


def _same(one: Drive, other: Drive) -> bool:
    """Whether two loads or forces (N) are the same at all times."""
    corners = [0.0, *(time for each in (one, other) for time in np.ravel(getattr(each.schedule, "time", ())))]
    return all(math.isclose(one.at(time)[0], other.at(time)[0], rel_tol=1e-9) for time in corners)


def changing_keys(model: Model) -> dict[str, Drive]:
    """What changes, by its key."""
    return {
        key: drive
        for key, drive in drives_of(model).items()
        if isinstance(drive.schedule, PiecewiseLinear) and np.ptp(np.asarray(drive.schedule.value)) > 0
    }


def instant_at(model: Model, time: float) -> Instant:
    """Drum speed, load and forces of a model at a time (s)."""
    return instants_at(model, [time])[0]


def instants_at(model: Model, times: Sequence[float]) -> list[Instant]:
    """The same at several times (s)."""
    loads = _loads(model)
    drives = _drives(model.operation, loads)
    return [_instant(time, drives, loads) for time in times]


def _instant(time: float, drives: dict[str, Drive], loads: list[Drive]) -> Instant:
    driven = {key: each.at(time) for key, each in drives.items()}
    load, rate = (sum(each) for each in zip(*(each.at(time) for each in loads), strict=True))
    return Instant(
        time_s=time,
        drum_speed_rad_per_s=driven[SPEED][0],
        normal_load_N=load,
        drum_speed_rate_rad_per_s2=driven[SPEED][1],
        normal_load_rate_N_per_s=rate,
        driven=driven,
    )


def _rate_at(schedule: Schedule, time: float) -> float:
    """How fast a schedule changes at a time (s), from the left at a corner."""
    if not isinstance(schedule, PiecewiseLinear):
        return 0.0
    times, values = np.asarray(schedule.time), np.asarray(schedule.value)
    k = int(np.searchsorted(times, time, side="left"))
    if k == 0 and time == times[0]:
        k = 1
    return float((values[k] - values[k - 1]) / (times[k] - times[k - 1])) if 0 < k < times.size else 0.0
