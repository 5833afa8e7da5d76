"""What a scene could do without: each of its effects left out, or reduced to a simpler one."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from drumsqueal.physics.composition import coordinates_of, forced_coordinates, kept_coordinates, plane_of
from drumsqueal.physics.elasticity import elastic_frequencies
from drumsqueal.scene import COORDINATES, Profile, Scene, Schedule, quantity_of
from drumsqueal.scene.coordinates import is_elastic, is_of_drum
from drumsqueal.scene.laws.constant import ConstantFriction

NOTHING = "none"  # what becomes of an effect that is left out
ELASTICITY = {"elasticity of the shoe": "shoe", "elasticity of the drum": "drum"}
"""Effects by which a body bends, with the body."""
MODES = {"shoe": "elastic modes", "drum": "drum modes"}


class Reduction(NamedTuple):
    """One effect, what it becomes, and the values of the scene that do it (as `Scene.with_values` takes them).

    `springs` are places of springs at points that are left out.
    """

    effect: str
    becomes: str
    values: Mapping[str, Any]
    springs: tuple[int, ...] = ()

    def __str__(self) -> str:
        """Effect and what becomes of it: "separation → bonded"."""
        return f"{self.effect} → {self.becomes}"


def reductions_of(scene: Scene) -> tuple[Reduction, ...]:
    """Every reduction that changes something in the scene; any number of them can be put together, in this order."""
    return tuple(_reductions(scene))


def reduce(scene: Scene, reductions: Sequence[Reduction]) -> Scene:
    """Return the scene with these reductions, in the order of `reductions_of`."""
    values: dict[str, Any] = {}
    for reduction in reductions:
        values |= {key: _both(values[key], each) if key in values else each for key, each in reduction.values.items()}
    without = {place for reduction in reductions for place in reduction.springs}
    if without:
        left = [each.model_dump() for place, each in enumerate(scene.shoe.spring) if place not in without]
        values["shoe.spring"] = left or None
    return scene.with_values(values)


def _both(one: Any, other: Any) -> Any:
    """What two reductions leave of the coordinates that are started, forced or listed."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return {name: value for name, value in one.items() if name in other}
    if isinstance(one, list) and isinstance(other, list):
        return [name for name in one if name in other]
    return one if other == "auto" else other


def _reductions(scene: Scene) -> Iterator[Reduction]:
    kept, plane = set(kept_coordinates(scene)), set(plane_of(scene))
    if kept - plane and kept & plane:
        yield Reduction("space", "plane", _over(scene, plane_of(scene)))
    for effect, body in ELASTICITY.items():
        if elastic_frequencies(scene, body):
            own = {name for name in coordinates_of(scene) if is_elastic(name) and is_of_drum(name) is (body == "drum")}
            others = [name for name in coordinates_of(scene) if name not in own]
            yield Reduction(effect, "rigid", {scene.elastic_table(body)[0]: None, **_over(scene, others)})
    if scene.contact.separation:
        yield Reduction("separation", "bonded", {"contact.separation": False})
    yield from _friction(scene)
    for table, effect in (("support", "support springs"), ("damping", "damping"), ("temperature", "temperature")):
        if getattr(scene, table) is not None:
            yield Reduction(effect, NOTHING, {table: None})
    for label, places in _points(scene).items():
        yield Reduction(label, NOTHING, {}, springs=places)
    if forced_coordinates(scene):
        yield Reduction("harmonic force", NOTHING, {"forcing": None})
    if scene.steady.state == "self-consistent" and scene.friction is not None and not scene.shoe.force:
        yield Reduction("steady drag", "balanced", {"steady.state": "uniform-pressure"})
    named = {"drum.speed": "speed profile", "contact.normal_load": "load profile"}
    for key, schedule in scene.schedules().items():
        if isinstance(schedule, Profile):
            start, unit = _at_start(schedule), quantity_of(key, scene).unit
            yield Reduction(named.get(key, f"profile of {key}"), f"{start:.4g} {unit}", {key: start})


def _points(scene: Scene) -> dict[str, tuple[int, ...]]:
    """Places of the springs that take hold of the shoe at one point, by what they are called together."""
    points: dict[tuple[float, ...], list[int]] = {}
    for place, spring in enumerate(scene.shoe.spring):
        points.setdefault(tuple(spring.at), []).append(place)
    return {f"spring{'s'[: len(each) > 1]} {', '.join(map(str, each))}": tuple(each) for each in points.values()}


def fewest_modes(scene: Scene, body: str, suffices: Callable[[Reduction], bool]) -> Reduction | None:
    """The fewest modes of an elastic shoe or drum that suffice, by bisection; None where it takes all of them.

    With more modes errors are taken to be smaller. Modes of one frequency, as a drum's pairs, stay together.
    """
    frequencies = sorted(set(elastic_frequencies(scene, body)))
    too_few, enough, found = 0, len(frequencies), None
    while enough - too_few > 1:
        count = (too_few + enough) // 2
        reduction = _modes(scene, body, frequencies, count)
        if suffices(reduction):
            enough, found = count, reduction
        else:
            too_few = count
    return found


def _modes(scene: Scene, body: str, frequencies: Sequence[float], count: int) -> Reduction:
    """Those of the modes that have so many frequencies: those below a round frequency between two."""
    last, following = frequencies[count - 1 : count + 1]
    between = (float(f"{(last + following) / 2:.{digits}g}") for digits in range(1, 16))
    limit = next((each for each in between if last < each < following), following)
    values = {f"{scene.elastic_table(body)[0]}.up_to": limit}
    kept = coordinates_of(scene.with_values({**values, **_over(scene, COORDINATES)}))
    number = sum(each <= last for each in elastic_frequencies(scene, body))
    return Reduction(MODES[body], f"{number} below {limit / 1e3:.6g} kHz", values | _over(scene, kept))


def _friction(scene: Scene) -> Iterator[Reduction]:
    # The law first: it replaces the whole table, into which the direction then goes. Without any friction there is no
    # direction either, so that leaving it out comes last.
    friction = scene.friction
    if friction is not None and not isinstance(friction, ConstantFriction):
        sliding = friction.at(scene.shoe.outer_radius * abs(_at_start(scene.drum.speed)))
        yield Reduction(friction.name, f"μ {sliding:.4g}", {"friction": friction.constant(sliding)})
    if friction is not None and friction.direction == "unit-velocity":
        yield Reduction("unit velocity", "tangential", {"friction.direction": "tangential"})
    if isinstance(friction, ConstantFriction):
        heated = {} if scene.temperature is None else {"temperature": None}  # which nothing else heats
        yield Reduction("friction", NOTHING, {"friction": None, **heated})


def _over(scene: Scene, names: Sequence[str]) -> dict[str, Any]:
    """Values by which no other coordinate is started, forced or listed."""
    values: dict[str, Any] = {}
    for table in ("displacement", "velocity"):
        values[f"start.{table}"] = _among(names, getattr(scene.start, table))
    if scene.forcing is not None:
        amplitude = _among(names, scene.forcing.amplitude)
        values |= {"forcing.amplitude": amplitude} if any(amplitude.values()) else {"forcing": None}
    if scene.simulate.coordinates == coordinates_of(scene):
        values["simulate.coordinates"] = "auto"  # which keeps the eigenvalues of all
    elif scene.simulate.coordinates != "auto":
        values["simulate.coordinates"] = [name for name in scene.simulate.coordinates if name in names]
    return values


def _among(names: Sequence[str], table: Mapping[str, float]) -> dict[str, float]:
    return {name: value for name, value in table.items() if name in names}


def _at_start(schedule: Schedule) -> float:
    return float(np.interp(0.0, schedule.time, schedule.value)) if isinstance(schedule, Profile) else schedule
