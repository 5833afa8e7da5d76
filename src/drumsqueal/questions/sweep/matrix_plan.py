"""A table of scenes as data: scene files, numbers and levels to combine, and the procedures that each goes through."""

import json
import math
from collections import Counter
from collections.abc import Mapping
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from drumsqueal.errors import RequestError, nearest
from drumsqueal.findings.squeals import SPEED
from drumsqueal.scene import Profile, Scene, SceneError, load_scene
from drumsqueal.scene.file import find_scene, read_tables
from drumsqueal.scene.quantities import parse_quantity

MOST_CELLS = 10_000
KEYS = ("title", "scenes", "vary", "levels", "procedures")
STEPS = ("time", "speed", "load")
SCENE, PROCEDURE = "scene", "procedure"
CONSTANT = "constant"
WINDOW = 0.05  # s of a procedure, of which the loudest counts


MatrixAxes = dict[str, Mapping[str, Mapping[str, Any]]]
"""What changes from cell to cell: for each axis the values that a level puts into a scene, by its label and their key.

An axis is a number of the scene, several at once, the scene or the procedure; of these two a level has the number.
"""


class Procedure(NamedTuple):
    """Drum speed and load over time (s), as multiples of a cell's own; constant without times.

    The load is that of every shoe, and of every force that pushes one.
    """

    name: str
    time: tuple[float, ...] = ()
    speed: tuple[float, ...] = ()
    load: tuple[float, ...] = ()

    def over(self, scene: Scene) -> Scene:
        """The scene as it goes through the procedure. Raises SceneError where its speed or load change already."""
        if not self.time:
            return scene
        values: dict[str, Any] = {"simulate.duration": self.time[-1]}
        for key, own in scene.schedules().items():
            factors = self.speed if key == SPEED else self.load
            if isinstance(own, Profile):
                raise SceneError(f"{key} is a profile in the scene, which a procedure replaces; give it one value")
            if factors and own:
                values[key] = {"time": list(self.time), "value": [own * factor for factor in factors]}
        return scene.with_values(values)


class MatrixPlan(NamedTuple):
    """The cells of a noise matrix: every procedure in every combination of levels, the last axis running fastest."""

    title: str
    scenes: tuple[Scene, ...]
    axes: MatrixAxes
    procedures: tuple[Procedure, ...]

    starts = ()

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the axes."""
        return tuple(self.axes)

    @property
    def dimensions(self) -> tuple[str, ...]:
        """Names of the axes."""
        return self.keys

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of levels of each."""
        return tuple(map(len, self.axes.values()))

    @property
    def points(self) -> int:
        """Number of cells."""
        return math.prod(self.shape)

    @property
    def about(self) -> dict[str, str]:
        """What is combined, as text."""
        return {"title": self.title, "scenes": json.dumps([scene.to_toml() for scene in self.scenes])}

    def levels(self, number: int) -> dict[str, str]:
        """The label of the level of a cell on each axis."""
        places = np.unravel_index(number, self.shape)
        return {name: list(axis)[int(place)] for (name, axis), place in zip(self.axes.items(), places, strict=True)}

    def scene_at(self, number: int) -> tuple[Scene, Procedure]:
        """The scene of a cell, as it is at the start of its procedure, and the procedure. Raises SceneError."""
        values = {name: self.axes[name][label] for name, label in self.levels(number).items()}
        scene, procedure = self.scenes[values.pop(SCENE)["number"]], self.procedures[values.pop(PROCEDURE)["number"]]
        # A shoe is taken first: later its own tables would take the place of what others set.
        for level in sorted(values.values(), key=lambda level: "shoe" not in level):
            scene = scene.with_values(level)
        return scene, procedure

    def describe(self) -> dict[str, Any]:
        """What is combined, as plain data."""
        return {"matrix": self.axes, "procedures": [each._asdict() for each in self.procedures]}


def read_matrix(path: Path) -> MatrixPlan:
    """Read the table in a file. Raises SceneError and RequestError for what is none, and for cells that are no scenes.

    Files of scenes are relative to it, or names of shipped ones.
    """
    table = read_tables(path)
    for key in table:
        if key not in KEYS:
            near = nearest(key, KEYS)
            meant = f"did you mean {near[0]}?" if near else f"the keys are {', '.join(KEYS)}"
            raise RequestError(f"{path}: {key}: unknown key; {meant}")
    try:
        scenes = _scenes(table.get("scenes"), path)
        procedures = _procedures(table.get("procedures", {CONSTANT: {}}))
        varied, levelled = _varied(table.get("vary", {})), _levelled(table.get("levels", {}))
        numbered = {SCENE: list(scenes), PROCEDURE: [each.name for each in procedures]}
        counted = {name: {label: {"number": k} for k, label in enumerate(each)} for name, each in numbered.items()}
        _check_apart([*varied.items(), *levelled.items(), *counted.items()])
    except RequestError as error:
        raise RequestError(f"{path}: {error}") from None
    plan = MatrixPlan(str(table.get("title", "")), tuple(scenes.values()), varied | levelled | counted, procedures)
    if plan.points > MOST_CELLS:
        raise RequestError(f"{path}: {plan.points} cells; write at most {MOST_CELLS}")
    for number in range(plan.points):
        try:
            scene, procedure = plan.scene_at(number)
            if scene.forcing is not None or not scene.rubs:
                raise SceneError("a noise matrix takes scenes with friction and without a harmonic force")
            if scene.several and scene.elastic_table("drum")[1] is None:
                names = ", ".join(f'"{name}"' for name in scene.shoe_names)
                reason = "the drum does not bend, so that each shoe is a problem of its own"
                raise SceneError(f"{reason}; take one after the other: write shoe = [{names}] in [vary]")
            procedure.over(scene)
        except SceneError as error:
            where = ", ".join(f"{name} = {label}" for name, label in plan.levels(number).items())
            raise RequestError(f"{path}: the cell {where}: {error}") from None
    return plan


def _scenes(names: Any, path: Path) -> dict[str, Scene]:
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise RequestError('scenes: write a list of scene files, such as scenes = ["damped.toml"]')
    files = {name: path.parent / name for name in names}
    if len(files) < len(names):
        raise RequestError("scenes: one is there twice; leave it out")
    stems = Counter(Path(name).stem for name in names)
    labels = {name: Path(name).stem if max(stems.values()) == 1 else name for name in names}
    found = {name: load_scene(file if file.exists() else find_scene(name)) for name, file in files.items()}
    return {labels[name]: scene for name, scene in found.items()}


def _varied(table: Any) -> MatrixAxes:
    found = {}
    for key, values in _mapping("vary", table).items():
        if not isinstance(values, list) or not values:
            raise RequestError(f'vary: {key}: write a list of values, such as "{key}" = [1, 2, 4]')
        wrong = [value for value in values if not isinstance(value, str | int | float)]
        if wrong:
            raise RequestError(
                f"vary: {key}: {wrong[0]} is no number with its unit; what has several belongs in levels"
            )
        labels = [value if isinstance(value, str) else f"{value:.12g}" for value in values]
        twice = [label for label, count in Counter(labels).items() if count > 1]
        if twice:
            raise RequestError(f"vary: {key}: {twice[0]} is there twice; leave one out")
        found[key] = {label: {key: value} for label, value in zip(labels, values, strict=True)}
    return found


def _levelled(table: Any) -> MatrixAxes:
    found = {}
    for name, levels in _mapping("levels", table).items():
        found[name] = {label: dict(_mapping(f"levels.{name}.{label}", values)) for label, values in levels.items()}
        if not levels or name in (SCENE, PROCEDURE):
            raise RequestError(f'levels.{name}: name it otherwise, or write hot = {{ "friction.static" = 0.4 }}')
    return found


def _check_apart(axes: list[tuple[str, Mapping[str, Mapping[str, Any]]]]) -> None:
    """Refuse axes of one name, and two that set one number: one of them would change nothing."""
    for (name, one), (other_name, other) in combinations(axes, 2):
        if name == other_name:
            raise RequestError(f"{name}: there are two axes of this name; name one otherwise")
        if {name, other_name} & {SCENE, PROCEDURE}:
            continue
        keys = [{key for level in axis.values() for key in level} for axis in (one, other)]
        both = [b for a in keys[0] for b in keys[1] if _clash(a, b)]
        if both:
            raise RequestError(f"{name} and {other_name} both set {min(both)}; leave it out of one of them")


def _clash(a: str, b: str) -> bool:
    """Whether two keys set one number; a shoe is taken before its numbers are set."""
    return a == b or ("shoe" not in (a, b) and (f"{a}.".startswith(f"{b}.") or f"{b}.".startswith(f"{a}.")))


def _procedures(table: Any) -> tuple[Procedure, ...]:
    found = []
    if table == {}:
        raise RequestError("procedures: write at least one, or leave it out for constant speed and load")
    for name, steps in _mapping("procedures", table).items():
        where = f"procedures.{name}"
        unknown = [key for key in _mapping(where, steps) if key not in STEPS]
        if unknown:
            raise RequestError(f"{where}.{unknown[0]}: unknown key; a procedure has {', '.join(STEPS)}")
        if not steps:
            found.append(Procedure(name))
            continue
        try:
            time = tuple(parse_quantity(each, "s") for each in steps.get("time", ()))
            speed, load = (tuple(map(float, steps.get(key, ()))) for key in STEPS[1:])
        except (SceneError, TypeError, ValueError) as error:
            raise RequestError(f"{where}: {error}; write time = ['0 s', '1 s'] and speed = [1.0, 0.0]") from None
        if len(time) < 2 or time[0] != 0 or not (speed or load) or {len(speed), len(load)} - {0, len(time)}:
            reason = "time must begin at 0 s, and speed or load have one multiple of the cell's own for each time"
            raise RequestError(f"{where}: {reason}")
        if not time[-1] >= WINDOW:
            raise RequestError(
                f"{where}: it must last {WINDOW:g} s or longer: squeal is sought in windows of {WINDOW:g} s"
            )
        if speed and not speed[0] > 0:
            raise RequestError(f"{where}: the drum must turn at the start; write 0.05 in place of {speed[0]:g}")
        found.append(Procedure(name, time, speed, load))
    return tuple(found)


def _mapping(where: str, table: Any) -> Mapping[str, Any]:
    if not isinstance(table, Mapping):
        raise RequestError(f"{where}: this must be a table")
    return table
