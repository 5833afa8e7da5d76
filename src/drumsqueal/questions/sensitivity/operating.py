"""Where a brake is to be quiet: its drum speed and load, and other values of its numbers in every combination."""

import itertools
import math
from collections.abc import Collection, Mapping, Sequence

from drumsqueal.errors import RequestError
from drumsqueal.findings.instant import FORCE, LOAD, SPEED, name_of_key
from drumsqueal.findings.schema import Finding
from drumsqueal.physics.elasticity import check_shapes_stay
from drumsqueal.scene import Profile, Scene
from drumsqueal.scene.shoes import key_alone
from drumsqueal.scene.variation import Variation, Written, may_not_rest, unit_of

MOST_POINTS = 100  # of all ranges together


class Values(Finding):
    """What a number of the scene is, or the values that it takes (SI), and in the unit that is shown."""

    key: str
    values: tuple[float, ...]
    unit: str
    values_in_unit: tuple[float, ...]

    def __str__(self) -> str:
        """The value, or the ends of the range, with the unit."""
        ends = dict.fromkeys((self.values_in_unit[0], self.values_in_unit[-1]))
        return f"{' to '.join(f'{each:.4g}' for each in ends)} {self.unit}".rstrip()


class Operating(Finding):
    """Drum speed and load of the scene, and the `ranges` over which it is to be quiet, too.

    `time_s` is the instant at which a speed or load that changes over time is taken, None where neither changes.
    Where the lining has a temperature, it is that of its surroundings (`cold`).
    """

    own: tuple[Values, ...]
    ranges: tuple[Values, ...] = ()
    time_s: float | None = None
    cold: bool = False

    @property
    def points(self) -> tuple[dict[str, float], ...]:
        """The numbers (SI) that replace those of the scene, the scene itself first."""
        return points_of(
            {each.key: each.values for each in self.ranges}, {each.key: each.values[0] for each in self.own}
        )


def points_of(ranges: Mapping[str, Sequence[float]], own: Mapping[str, float]) -> tuple[dict[str, float], ...]:
    """The scene itself, and each combination of the values of some numbers that is not the scene's `own`."""
    grid = (dict(zip(ranges, each, strict=True)) for each in itertools.product(*ranges.values()))
    return ({}, *(each for each in grid if any(own.get(key) != value for key, value in each.items())))


def operating(scene: Scene, frozen: Scene, time: float, written: Written, at: Sequence[Variation]) -> Operating:
    """What a scene is asked for, which is `frozen` at a time (s)."""
    given = scene.schedules()
    if scene.pushed:
        given = {key: each for key, each in given.items() if key_alone(key) != LOAD or each != 0}
    numbers = frozen.numbers()
    own = [
        Values(
            key=key,
            values=(value,),
            unit=written.unit(key) or unit_of(key, frozen),
            values_in_unit=(written.shown(key, value),),
        )
        for key in dict.fromkeys((*given, *(each.key for each in at)))
        if isinstance(value := numbers.get(key), float)
    ]
    ranges = [
        Values(
            key=each.key,
            values=each.values,
            unit=each.shown_unit,
            values_in_unit=tuple(map(each.listed, each.values)),
        )
        for each in at
    ]
    changes = any(isinstance(each, Profile) for each in scene.schedules().values())
    return Operating(
        own=tuple(own), ranges=tuple(ranges), time_s=time if changes else None, cold=scene.temperature is not None
    )


def check_points(scene: Scene, at: Sequence[Variation], keys: Collection[str] | None) -> None:
    """Raise SceneError or RequestError for ranges that cannot be asked for."""
    for k, each in enumerate(at):
        may_not_rest(each)
        check_shapes_stay(scene, each.key)
        if each.key in [other.key for other in at[:k]]:
            raise RequestError(f"--at {each.key}: named twice; give one range")
        if keys is not None and each.key in keys:
            raise RequestError(f"--at {each.key}: --vary may change it, too; leave one of the two out")
        if each.key.startswith("forcing."):
            raise RequestError(f"--at {each.key}: a harmonic force is left out of the transients; leave it out")
        if key_alone(each.key) == LOAD and min(each.values) <= 0:
            raise RequestError(f"--at {each.key}: a lining without load does not squeal; begin above 0 N")
    number = math.prod(len(each.values) for each in at)
    if number > MOST_POINTS:
        raise RequestError(f"--at: {number} combinations of values, at most {MOST_POINTS} can be tried; take fewer")
    for point in points_of({each.key: each.values for each in at}, {}):
        scene.with_values(point)


def where(found: Operating) -> str:
    """The speed and the load, in words: "a drum speed of 5 rad/s and a load of 2000 N (at t = 0 s)"."""
    named = [f"a {name} of {each}" for each in found.own if (name := _name(each.key))]
    at_time = "" if found.time_s is None else f" (at t = {found.time_s:g} s)"
    cold = ", with a cold lining" if found.cold else ""
    return f"{' and '.join(named)}{at_time}{cold}"


def _name(key: str) -> str | None:
    """What presses a lining or turns the drum, None of other numbers."""
    if FORCE.fullmatch(key):
        return "force"
    return name_of_key(key) if key == SPEED or key_alone(key) == LOAD else None


def where_else(found: Operating) -> str:
    """The ranges, in words, "" where there is none."""
    ranges = " with ".join(f"{each.key} from {each} ({len(each.values)} values)" for each in found.ranges)
    return f" and at {ranges}" if ranges else ""
