"""While drum speed, load or forces change: what they are at an instant, and when it squeals, with which hysteresis."""

import math
import re
from collections.abc import Iterable, Sequence
from enum import StrEnum
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.findings.kinds import Criteria
from drumsqueal.findings.saturation import SpectralLine, describe_motion
from drumsqueal.findings.schema import Finding
from drumsqueal.findings.vibration import Vibration, beyond_boundaries, surface_levels
from drumsqueal.physics.effects.operation import PiecewiseLinear, Schedule
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.modes import Stability
from drumsqueal.solve.linear.passage import Along, Vector, corners_of, value_at

if TYPE_CHECKING:
    import xarray

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
    operation, of_shoes = model.operation, [{LOAD: load} for load in _loads(model)]
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
    drives, loads = drives_of(model), _loads(model)
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


Interval = tuple[float, float]


def joined(intervals: Iterable[Interval]) -> tuple[Interval, ...]:
    """Those that touch as one, in ascending order."""
    found: list[Interval] = []
    for low, high in sorted(intervals):
        if found and low <= found[-1][1]:
            found[-1] = (found[-1][0], max(high, found[-1][1]))
        else:
            found.append((low, high))
    return tuple(found)


def common(some: Iterable[Interval], others: Iterable[Interval]) -> tuple[Interval, ...]:
    """What each of some has in common with each of the others."""
    others = tuple(others)
    both = ((max(a, c), min(b, d)) for a, b in some for c, d in others)
    return tuple((low, high) for low, high in both if low < high)


def without(some: Iterable[Interval], others: Iterable[Interval]) -> tuple[Interval, ...]:
    """What of some is in none of the others, which are in ascending order and do not touch."""
    ends = [-math.inf, *(end for each in others for end in each), math.inf]
    return common(some, zip(ends[::2], ends[1::2], strict=True))


# Periods of the lowest mode: a beat may stay within the contact boundaries so long, and no squeal ends by it.
PAUSE = 50


class SquealEnd(StrEnum):
    """How squeal ends."""

    DIES_OUT = "dies out"
    STICKS = "the lining sticks"
    RECORD = "the record ends"


class Squeal(Finding):
    """One squeal of the record, from the first to the last sample beyond a contact boundary.

    It is sustained until its motion begins to decay as a small one does there, and its end is when that has fallen
    below the contact boundaries. `largest` is where its kinetic energy is largest, `line` the main line of the motion
    there and `amplitude` half the peak-to-peak value of the line's coordinate (m or rad).
    """

    sets_in: Instant
    largest: Instant
    amplitude: float
    line: SpectralLine | None
    sustained_until: Instant
    ends: Instant
    end: SquealEnd


class Hysteresis(Finding):
    """A range of drum speed (rad/s) or of a load or force (N) that squeals on one way, and is quiet on the way back."""

    key: str
    low: float
    high: float
    squeals_while: str


def find_squeals(
    history: "xarray.Dataset", vibration: Vibration, stability: Stability, model: Model, modes: list[Along]
) -> tuple[Squeal, ...]:
    """Find every squeal of a history; `modes` are those that move, along the same way.

    What falls as a small motion from the first on is a disturbance that decays, and no squeal.
    """
    time, rate = vibration.time, vibration.sample_rate
    period = _longest_period(modes, time)
    sticks = history["sticking"].values > 0
    beyond = beyond_boundaries(history, _steady_contact(model, modes, time), model)
    # 8 periods: a shorter visit beyond the contact boundaries, and no more after it, is no squeal
    spans = find_spans(beyond, sticks, max(1, round(PAUSE * period * rate)), max(1, round(8 * period * rate)))
    if not spans:
        return ()
    # 8 periods, over which the kinetic energy is a mean
    middles, energy = _energy(vibration, stability, max(1, round(8 * period * rate)))
    found = []
    for first, last, end in spans:
        inside = np.flatnonzero((middles >= time[first]) & (middles <= time[last]))
        loudest = float(middles[inside[np.argmax(energy[inside])]]) if inside.size else float(time[first])
        sustained = float(time[last])
        if end is SquealEnd.DIES_OUT:
            sustained = sustained_until(middles[inside], energy[inside], modes, sustained)
            if inside.size and sustained == middles[inside[0]]:  # nothing kept it up: a disturbance that decays
                continue
        # 16 periods to either side of the largest motion, in which its line is sought
        k, reach = int(np.searchsorted(time, loudest)), round(16 * period * rate)
        motion = describe_motion(vibration, slice(max(k - reach, 0), k + reach + 1), stability, model)
        instants = instants_at(model, [float(time[first]), loudest, sustained, float(time[last])])
        named = zip(("sets_in", "largest", "sustained_until", "ends"), instants, strict=True)
        main = motion.main
        found.append(
            Squeal(
                **dict(named),
                amplitude=motion.amplitude[main.coordinate] if main else max(motion.amplitude.values()),
                line=main,
                end=end,
            )
        )
    return tuple(found)


def _longest_period(modes: list[Along], time: Vector) -> float:
    """That of the lowest mode that does not die out within a period, at any time; without one of a tenth of a pause."""
    lasting = [m.frequency_Hz for along in modes for m in along.modes if m.growth_rate > -m.frequency_Hz]
    return 1 / min(lasting) if lasting else float(time[-1] - time[0]) / 10 / PAUSE


def _steady_contact(model: Model, modes: list[Along], time: Vector) -> list[Vector]:
    """The fraction of each lining that touches the drum in steady sliding, over time."""
    if not modes or model.balanced:
        return [np.ones(1)] * model.contact.shoes
    along = max(modes, key=lambda each: each.time.size)
    levels = surface_levels(model, along.steady, along.time.tolist())
    return [np.interp(time, along.time, np.mean(level > 0, axis=1)) for level in levels]


def find_spans(
    beyond: NDArray[np.bool_], sticks: NDArray[np.bool_], pause: int, shortest: int
) -> list[tuple[int, int, SquealEnd]]:
    """First and last sample of each squeal, and how it ends, from what is beyond a contact boundary or sticks (time,).

    A pause of so many samples or fewer ends none, and what is over in fewer than `shortest` is none. Sticking is part
    of a stick-slip motion where it is no longer than a pause; where it is longer, and at both ends of the record, it is
    rest.
    """
    rest = np.zeros(sticks.size, dtype=bool)
    for first, stop in runs(sticks):
        rest[first:stop] = stop - first > pause or first == 0 or stop == sticks.size
    found = []
    for first, stop in runs(~rest):
        places = first + np.flatnonzero((beyond | sticks)[first:stop])
        for part in np.split(places, np.flatnonzero(np.diff(places) - 1 > pause) + 1):
            goes_on = part.size and stop - 1 - part[-1] <= pause  # until the lining sticks, or the record ends
            if part.size and (goes_on or part[-1] + 1 - part[0] >= shortest):
                end = (SquealEnd.RECORD if stop == sticks.size else SquealEnd.STICKS) if goes_on else SquealEnd.DIES_OUT
                found.append((int(part[0]), int(part[-1]), end))
    return found


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First sample of each run that is true, and the one after its last."""
    padded = np.concatenate([[False], flags, [False]])
    edges = np.flatnonzero(padded[1:] != padded[:-1]).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def _energy(vibration: Vibration, stability: Stability, window: int) -> tuple[Vector, Vector]:
    """Times (s) of the middles of windows that overlap by half, and the mean kinetic energy (J) in each."""
    pieces = [velocity**2 @ stability.mass / 2 for _, _, velocity in vibration.pieces()]
    summed = np.concatenate([[0.0], np.cumsum(np.concatenate(pieces))])
    starts = np.arange(0, max(1, vibration.time.size - window), max(1, window // 2))
    stops = np.minimum(starts + window, vibration.time.size)
    middles = vibration.time[(starts + stops - 1) // 2]
    return middles, (summed[stops] - summed[starts]) / (stops - starts)


def sustained_until(time: Vector, energy: Vector, modes: list[Along], end: float) -> float:
    """The time (s) from which on the energy (k,) at some times (s) falls as that of a small motion, to the end (s).

    That is at least half as fast as that of the mode that decays slowest then; it is the end where one grows there, and
    the first time where it falls so from the first on.
    """
    from scipy.integrate import cumulative_trapezoid  # which a report does without

    if not time.size or not modes:
        return end
    slowest = np.max([np.interp(time, along.time, along.rate, -np.inf, -np.inf) for along in modes], axis=0)
    decay = Criteria.nearly_linear * np.where(np.isfinite(slowest), np.minimum(slowest, 0.0), 0.0)
    kept = np.log(np.maximum(energy, np.finfo(np.float64).tiny)) / 2 - cumulative_trapezoid(decay, time, initial=0.0)
    first = int(np.flatnonzero(decay == 0)[-1]) if (decay == 0).any() else 0
    # 0.2 e-folds of amplitude gained on half the linear decay, or the motion decays: beats gain 0.02 by chance
    rises = np.flatnonzero(np.maximum.accumulate(kept[::-1])[::-1] - kept > 0.2)
    if rises.size and rises[-1] >= first:
        first = int(rises[-1])
    elif decay[first] < 0:
        return float(time[0])
    last = first + int(np.argmax(kept[first:]))
    return float(time[last]) if last < time.size - 1 else end


def find_hysteresis(squeals: tuple[Squeal, ...], model: Model, until: float) -> tuple[Hysteresis, ...]:
    """The ranges of drum speed, or of load, that squeal while it rises and are quiet while it falls, or the reverse.

    None where both change, or neither. A range is quiet one way only if none of the passages that way squeals there,
    and squeals only while squeal is sustained: what decays there is left over from elsewhere.
    """
    changing = changing_keys(model)
    if len(changing) != 1:
        return ()
    ((key, drive),) = changing.items()
    ways: dict[str, tuple[list[Interval], list[Interval]]] = {"rises": ([], []), "falls": ([], [])}
    corners = corners_of(model, until)
    for first, last in zip(corners[:-1].tolist(), corners[1:].tolist(), strict=True):
        ends = [drive.at(time)[0] for time in (first, last)]
        if ends[0] == ends[1]:
            continue
        passed, squealed = ways["rises" if ends[1] > ends[0] else "falls"]
        passed.append((min(ends), max(ends)))
        for squeal in squeals:
            times = [min(max(each.time_s, first), last) for each in (squeal.sets_in, squeal.sustained_until)]
            if times[0] < times[1]:
                low, high = sorted(drive.at(time)[0] for time in times)
                squealed.append((low, high))
    found = []
    for way, other in (("rises", "falls"), ("falls", "rises")):
        quiet = without(joined(ways[other][0]), joined(ways[other][1]))
        for low, high in common(joined(ways[way][1]), quiet):
            found.append(Hysteresis(key=key, low=low, high=high, squeals_while=way))
    return tuple(found)
