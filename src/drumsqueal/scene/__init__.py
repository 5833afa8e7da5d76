"""A scene as data: a TOML file or a mapping, checked and turned to SI. Start with `load_scene`."""

import os
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Union, get_args

import tomli_w
from pydantic import Field, ValidationError, field_serializer, field_validator, model_validator
from pydantic.fields import FieldInfo

from drumsqueal.scene.file import apply_setting, read_tables, replace_value
from drumsqueal.scene.laws import LAWS
from drumsqueal.scene.mistakes import explain
from drumsqueal.scene.quantities import SceneError
from drumsqueal.scene.tables import (
    COORDINATES,
    Contact,
    Damping,
    Drum,
    Forcing,
    Friction,
    PerCoordinate,
    Profile,
    Quantity,
    Schedule,
    Shoe,
    Simulate,
    Start,
    Steady,
    Support,
    Table,
    Temperature,
    Title,
)
from drumsqueal.scene.uncertain import Distribution, describe, reach, read_distributions

__all__ = ["COORDINATES", "Profile", "Scene", "SceneError", "Schedule", "Shoe", "load_scene", "scene_from_dict"]

if TYPE_CHECKING:
    AnyLaw = Friction
else:
    AnyLaw = Annotated[Union[tuple(LAWS.values())], Field(discriminator="law")]  # noqa: UP007 (of what is found)

_PHYSICAL_TABLES = ("shoe", "support", "contact", "friction", "drum", "damping", "temperature", "forcing")


class Scene(Table):
    """One scene, checked, in SI: what brake, what acts on it, how it starts and how long it runs.

    A table that is None (support, friction, damping, temperature, forcing) is an effect the scene does not call for.
    `uncertain` holds distributions of its numbers, which a random sweep samples and all other commands ignore.
    """

    title: Title = ""
    shoe: Shoe
    support: Support | None = None
    contact: Contact
    friction: AnyLaw | None = None
    drum: Drum
    damping: Damping | None = None
    temperature: Temperature | None = None
    forcing: Forcing | None = None
    steady: Steady = Field(default_factory=Steady)
    start: Start = Field(default_factory=Start)
    simulate: Simulate
    uncertain: Mapping[str, Distribution] | None = None

    @field_validator("uncertain", mode="plain")
    @classmethod
    def _read_distributions(cls, table: Any) -> Mapping[str, Distribution] | None:
        return read_distributions(table, uncertain_units())

    @field_serializer("uncertain")
    def _write_distributions(self, table: Mapping[str, Distribution] | None) -> Mapping[str, Any] | None:
        return table and {key: describe(each) for key, each in table.items()}

    @model_validator(mode="after")
    def _starts_what_moves(self) -> "Scene":
        moving = self.simulate.coordinates
        tables = {("start", table): getattr(self.start, table) for table in ("displacement", "velocity")}
        if self.forcing is not None:
            tables["forcing", "amplitude"] = self.forcing.amplitude
        for path, table in tables.items():
            for name, value in table.items():
                if moving != "auto" and name not in moving:
                    done = "started" if path[0] == "start" else "forced"
                    reason = f"{name} is {done} but not among simulate.coordinates; add it there, or remove it here"
                    raise SceneError(reason, (*path, name), value)
        return self

    @model_validator(mode="after")
    def _rubs_where_it_heats(self) -> "Scene":
        if self.temperature is not None and self.friction is None:
            raise SceneError(
                "without friction nothing heats the lining; leave temperature out, or add a table friction",
                ("temperature",),
            )
        return self

    @model_validator(mode="after")
    def _takes_what_is_uncertain(self) -> "Scene":
        certain = None if not self.uncertain else self.model_copy(update={"uncertain": None})
        for key, distribution in (self.uncertain or {}).items():
            assert certain is not None
            if not isinstance((self.numbers() | self.starts()).get(key), float):
                reason = "this scene has no such number, or has a list there; remove it here, or give it one value"
                raise SceneError(reason, ("uncertain", key))
            for value in reach(distribution):
                try:
                    certain.with_values({key: value})
                except SceneError as error:
                    reason = error.reason.removeprefix(f"{key} = {value!r}: ")
                    truncate = f"samples reach {value:.6g}, and {reason}; truncate the distribution with low and high"
                    raise SceneError(truncate, ("uncertain", key)) from None
        return self

    def with_values(self, values: Mapping[str, Any]) -> "Scene":
        """Return the scene with values put in by dotted key: `scene.with_values({"drum.speed": "3 rad/s"})`.

        The values are as in a file: numbers in SI, strings with a unit, whole tables as mappings; None leaves out one
        of the tables support, friction, damping, temperature, forcing and uncertain. Raises SceneError.
        """
        tables = self._tables()
        for key, value in values.items():
            tables = replace_value(tables, key, value)
        return scene_from_dict(tables)

    def numbers(self) -> dict[str, float | tuple[float, ...]]:
        """Return every physical number in SI by dotted key; a profile gives drum.speed.time and drum.speed.value.

        A list, such as the points of a friction curve, is one tuple. Only tables that are there count, and only
        those of the brake: not start, not simulate.
        """
        numbers: dict[str, float | tuple[float, ...]] = {}
        for name in _PHYSICAL_TABLES:
            for key, value in getattr(self, name) or ():
                if isinstance(value, Profile):
                    numbers[f"{name}.{key}.time"] = value.time
                    numbers[f"{name}.{key}.value"] = value.value
                elif isinstance(value, Mapping):
                    numbers |= {f"{name}.{key}.{coordinate}": number for coordinate, number in value.items()}
                elif isinstance(value, float | tuple):
                    numbers[f"{name}.{key}"] = value
        return numbers

    def starts(self) -> dict[str, float]:
        """Return the start of the transient in SI by dotted key, start.displacement.X to start.velocity.Tz."""
        keys = start_units() if self.simulate.coordinates == "auto" else start_units(self.simulate.coordinates)
        return {key: getattr(self.start, key.split(".")[1]).get(key.split(".")[2], 0.0) for key in keys}

    def to_toml(self) -> str:
        """Return the scene as run, in bare SI numbers: a file of this text loads to an equal scene."""
        return tomli_w.dumps(self._tables())

    def _tables(self) -> dict[str, Any]:
        return self.model_dump(exclude_none=True)


def load_scene(path: str | os.PathLike[str], settings: Iterable[str] = ()) -> Scene:
    """Read a scene from a TOML file, with `settings` ("KEY=VALUE", as of `--set`) put in one after the other.

    VALUE is read as a TOML value and, if it is none, as a string; it replaces whatever was at KEY.
    `friction=none` leaves the table friction out; so for the other optional tables (`file.py`). Raises SceneError.
    """
    return load_with_tables(path, settings)[0]


def load_with_tables(path: str | os.PathLike[str], settings: Iterable[str] = ()) -> tuple[Scene, dict[str, Any]]:
    """Read a scene as `load_scene` does, and return its tables, too, as they were written."""
    # Where the tables are no scene, the error names the file, or the first setting that made them so.
    tables, source = read_tables(path), os.fspath(path)
    for setting in settings:
        if _is_scene(tables):
            source = f"--set {setting}"
        tables = apply_setting(tables, setting)
    return scene_from_dict(tables, source), tables


def _is_scene(tables: Mapping[str, Any]) -> bool:
    try:
        scene_from_dict(tables)
    except SceneError:
        return False
    return True


def scene_from_dict(data: Mapping[str, Any], source: str = "scene") -> Scene:
    """Check the nested tables of a scene; `source` names them in the SceneError this raises if they are wrong."""
    if not isinstance(data, Mapping):
        raise SceneError("a scene is a mapping of tables", (source,))
    try:
        return Scene.model_validate(dict(data))
    except ValidationError as error:
        raise explain(error, _MODELS, source) from None


def _tables_in(annotation: Any) -> tuple[type[Table], ...]:
    if isinstance(annotation, type):
        return (annotation,) if issubclass(annotation, Table) else ()
    return tuple(table for part in get_args(annotation) for table in _tables_in(part))


_MODELS = {"": (Scene,)} | {name: _tables_in(field.annotation) for name, field in Scene.model_fields.items()}


def setting_keys() -> tuple[str, ...]:
    """Every dotted key that a scene may have, such as drum.speed, in the order of its tables."""
    return "title", *dict.fromkeys(key for table in _MODELS if table for key, _ in _fields_of(table))


def setting_choices(key: str) -> tuple[str, ...]:
    """The words that a dotted key may have, such as auto for simulate.solver; none for one that takes other values."""
    kinds = [field.annotation for name, field in _fields_of(key.partition(".")[0]) if name == key]
    if bool in kinds:
        return "true", "false"
    return tuple(dict.fromkeys(word for kind in kinds for word in get_args(kind) if isinstance(word, str)))


def number_units() -> dict[str, str]:
    """The SI unit of every single number that a scene may have, by the dotted key."""
    fields = [each for table in _PHYSICAL_TABLES for each in _fields_of(table)]
    return {key: each.unit for key, field in fields for each in field.metadata if isinstance(each, Quantity)}


def uncertain_units() -> dict[str, str]:
    """Those of the numbers that may be uncertain: the brake's, not the force's on it, and the start's."""
    return {key: unit for key, unit in number_units().items() if not key.startswith("forcing.")} | start_units()


def start_units(coordinates: Iterable[str] = COORDINATES) -> dict[str, str]:
    """The SI unit of every number of the start, by the dotted key."""
    return {
        f"{key}.{name}": each.angle_unit if name.startswith("T") else each.length_unit
        for key, field in _fields_of("start")
        for each in field.metadata
        if isinstance(each, PerCoordinate)
        for name in coordinates
    }


def quantity_of(key: str, scene: Scene) -> Quantity:
    """Unit and limits of a single number of this scene, by its dotted key."""
    table, name, *coordinate = key.split(".")
    for each in type(getattr(scene, table)).model_fields[name].metadata:
        if isinstance(each, Quantity):
            return each
        if isinstance(each, PerCoordinate) and coordinate:
            return Quantity(each.angle_unit if coordinate[0].startswith("T") else each.length_unit)
    raise AssertionError(f"{key} is no number with a unit of its own")


def _fields_of(table: str) -> list[tuple[str, FieldInfo]]:
    return [(f"{table}.{key}", each) for model in _MODELS.get(table, ()) for key, each in model.model_fields.items()]
