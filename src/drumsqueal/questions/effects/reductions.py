"""What a scene could do without: each of its effects left out, or reduced to a simpler one."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from drumsqueal.physics.bodies.rigid_shoe import IN_PLANE
from drumsqueal.physics.composition import forced_coordinates, kept_coordinates
from drumsqueal.scene import COORDINATES, Profile, Scene, Schedule
from drumsqueal.scene.laws.constant import ConstantFriction

NOTHING = "none"  # what becomes of an effect that is left out


class Reduction(NamedTuple):
    """One effect, what it becomes, and the values of the scene that do it (as `Scene.with_values` takes them)."""

    effect: str
    becomes: str
    values: Mapping[str, Any]

    def __str__(self) -> str:
        """Effect and what becomes of it: "separation → bonded"."""
        return f"{self.effect} → {self.becomes}"


def reductions_of(scene: Scene) -> tuple[Reduction, ...]:
    """Every reduction that changes something in the scene; any number of them can be put together, in this order."""
    return tuple(_reductions(scene))


def reduce(scene: Scene, reductions: Iterable[Reduction]) -> Scene:
    """Return the scene with these reductions, in the order of `reductions_of`."""
    values: dict[str, Any] = {}
    for reduction in reductions:
        values |= reduction.values
    return scene.with_values(values)


def _reductions(scene: Scene) -> Iterator[Reduction]:
    kept = set(kept_coordinates(scene))
    if kept - set(IN_PLANE) and kept & set(IN_PLANE):
        yield Reduction("space", "plane", _plane(scene))
    if scene.contact.separation:
        yield Reduction("separation", "bonded", {"contact.separation": False})
    yield from _friction(scene)
    for table, effect in (("support", "support springs"), ("damping", "damping"), ("temperature", "temperature")):
        if getattr(scene, table) is not None:
            yield Reduction(effect, NOTHING, {table: None})
    if forced_coordinates(scene):
        yield Reduction("harmonic force", NOTHING, {"forcing": None})
    if scene.steady.state == "self-consistent" and scene.friction is not None:
        yield Reduction("steady drag", "balanced", {"steady.state": "uniform-pressure"})
    for key, effect, schedule, unit in (
        ("drum.speed", "speed profile", scene.drum.speed, "rad/s"),
        ("contact.normal_load", "load profile", scene.contact.normal_load, "N"),
    ):
        if isinstance(schedule, Profile):
            start = _at_start(schedule)
            yield Reduction(effect, f"{start:.4g} {unit}", {key: start})


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


def _plane(scene: Scene) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for table in ("displacement", "velocity"):
        values[f"start.{table}"] = _in_plane(getattr(scene.start, table))
    if scene.forcing is not None:
        amplitude = _in_plane(scene.forcing.amplitude)
        values |= {"forcing.amplitude": amplitude} if any(amplitude.values()) else {"forcing": None}
    if scene.simulate.coordinates == COORDINATES:
        values["simulate.coordinates"] = "auto"  # which keeps the eigenvalues of all six
    elif scene.simulate.coordinates != "auto":
        values["simulate.coordinates"] = [name for name in scene.simulate.coordinates if name in IN_PLANE]
    return values


def _in_plane(table: Mapping[str, float]) -> dict[str, float]:
    return {name: value for name, value in table.items() if name in IN_PLANE}


def _at_start(schedule: Schedule) -> float:
    return float(np.interp(0.0, schedule.time, schedule.value)) if isinstance(schedule, Profile) else schedule
