"""A scene as data: a TOML file or a mapping, checked and turned to SI. Start with `load_scene`."""

import functools
import os
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from typing import Any, get_args

import tomli_w
from pydantic import Field, ValidationError, field_serializer, field_validator, model_validator
from pydantic.fields import FieldInfo

from drumsqueal.coordinates import COORDINATES, in_order, is_elastic, is_of_drum, shoe_of
from drumsqueal.scene.file import apply_setting, explain, find_scene, is_list, no_entry, read_tables, replace_value
from drumsqueal.scene.quantities import (
    KeyPath,
    PerCoordinate,
    Profile,
    Quantity,
    Reader,
    Resolution,
    SceneError,
    Schedule,
    Table,
    as_first,
)
from drumsqueal.scene.shoes import BY_COORDINATE, OWN, AnyLaw, AnyShoe, NamedShoe, alone, is_of_no_shoe
from drumsqueal.scene.tables import (
    ContactTable,
    DampingTable,
    Drum,
    ForcingTable,
    ShoeTable,
    Simulate,
    StartTable,
    Steady,
    Support,
    TemperatureTable,
    Title,
)
from drumsqueal.scene.uncertain import Distribution, describe, reach, read_distributions

__all__ = ["COORDINATES", "Profile", "Scene", "SceneError", "Schedule", "ShoeTable", "load_scene", "scene_from_dict"]


class Scene(Table):
    """One scene, checked, in SI: what brake, what acts on it, how it starts and how long it runs.

    A table that is None, such as `friction`, is an effect the scene does not call for;
    so are shoe and drum without `elastic` (or, of the drum, `mesh`), and no springs and forces at points (`spring`,
    `force`: tuples of tables). `uncertain` holds distributions of its numbers, which a random sweep samples and all
    other commands ignore. Where there are several shoes, `shoe` is a tuple of them; `shoes` and `alone` serve one and
    several alike.

    ```pycon
    >>> nominal = drumsqueal.load_scene("nominal")
    >>> scene = nominal.with_values({"contact.normal_load": "2.5 kN", "damping.ratio": 0.03})
    >>> scene.contact.normal_load, scene.damping.ratio
    (2500.0, 0.03)
    ```
    """

    title: Title = ""
    """What figures and results are called."""
    shoe: AnyShoe
    """The shoe, or several of them (`[[shoe]]`)."""
    support: Support | None = None
    """The paper's springs, on X and Tz alone."""
    contact: ContactTable
    """Lining on drum."""
    friction: AnyLaw | None = None
    """Of lining and drum."""
    drum: Drum
    """What turns."""
    damping: DampingTable | None = None
    """Structural damping."""
    temperature: TemperatureTable | None = None
    """Of the lining."""
    forcing: ForcingTable | None = None
    """A harmonic force."""
    steady: Steady = Field(default_factory=Steady)
    """Steady sliding."""
    start: StartTable = Field(default_factory=StartTable)
    """How the transient starts."""
    simulate: Simulate
    """How it is computed."""
    uncertain: Mapping[str, Distribution] | None = None
    """Distributions of numbers, for random sweeps."""

    @field_validator("uncertain", mode="plain")
    @classmethod
    def _read_distributions(cls, table: Any) -> Mapping[str, Distribution] | None:
        return read_distributions(table, uncertain_units())

    @field_serializer("uncertain")
    def _write_distributions(self, table: Mapping[str, Distribution] | None) -> Mapping[str, Any] | None:
        return table and {key: describe(each) for key, each in table.items()}

    @property
    def shoes(self) -> tuple[ShoeTable, ...]:
        """Its shoes, of which there may be one."""
        shoe: Any = self.shoe
        return shoe if self.several else (shoe,)

    @property
    def several(self) -> bool:
        """Whether there is more than one shoe, so that coordinates begin with the name of theirs."""
        return not isinstance(self.shoe, ShoeTable)

    @property
    def pushed(self) -> bool:
        """Whether forces at points push a shoe."""
        return any(shoe.force for shoe in self.shoes)

    @property
    def pressed(self) -> bool:
        """Whether a load or forces at points press a lining on the drum at any time."""
        return self.pushed or any(contact.normal_load != 0 for contact in self.of_each("contact"))

    @property
    def planar(self) -> bool:
        """Whether nothing moves a shoe out of the plane in which it is dragged.

        The plate of an elastic drum does, and a mesh or modal results are not asked whether the plane mirrors it.
        """
        return self.elastic_table("drum")[1] is None and all(
            each.in_plane and each.solid is None for each in self.shoes
        )

    @property
    def rubs(self) -> bool:
        """Whether there is friction on a lining."""
        return any(friction is not None for friction in self.of_each("friction"))

    def of_each(self, table: str) -> tuple[Any, ...]:
        """The table contact, friction or damping of each shoe: its own or, where it has none, that of all."""
        own = (getattr(shoe, table, None) for shoe in self.shoes)
        return tuple(getattr(self, table) if each is None else each for each in own)

    @property
    def shoe_names(self) -> tuple[str, ...]:
        """The names of the shoes; "" where there is one."""
        return tuple(each.name if isinstance(each, NamedShoe) else "" for each in self.shoes)

    @property
    def prefixes(self) -> tuple[str, ...]:
        """What the coordinates of each shoe begin with: nothing where there is one."""
        return tuple(f"{name}." if name else "" for name in self.shoe_names)

    @property
    def alone(self) -> tuple["Scene", ...]:
        """The brake with one shoe alone, for each: with its own tables, in its own axes, under its own coordinates."""
        if not self.several:
            return (self,)
        return _each_alone(self.to_toml(), self.shoe_names)

    def key_of(self, shoe: int, key: str) -> str:
        """The dotted key in this scene of a number that one shoe's scene alone has."""
        if not self.several:
            return key
        table, _, within = key.partition(".")
        column, _, coordinate = within.partition(".")
        if column in BY_COORDINATE.get(table, ()) and not is_of_drum(coordinate):
            return f"{table}.{column}.{self.prefixes[shoe]}{coordinate}"
        if table == "shoe":
            return f"shoe.{shoe}.{within}"
        return f"shoe.{shoe}.{key}" if table in OWN and getattr(self.shoes[shoe], table) is not None else key

    @property
    def by_coordinate(self) -> dict[tuple[str, str], Mapping[str, float]]:
        """What has a number for each coordinate, by table and key."""
        there = {name: table for name, table in self if name in BY_COORDINATE and table is not None}
        return {(name, key): getattr(table, key) for name, table in there.items() for key in BY_COORDINATE[name]}

    def as_one(self, key: str) -> tuple[str, ...]:
        """The keys of the numbers that are one with that of a key, in order: all shoes have the drum's radius."""
        radii = tuple(self.key_of(k, "shoe.outer_radius") for k in range(len(self.shoes)))
        return radii if key in radii else (key,)

    @model_validator(mode="after")
    def _is_sound_of_each_shoe(self) -> "Scene":
        for path, name in self._named_coordinates():
            if not is_of_drum(name) and shoe_of(name) not in self.prefixes:
                names = ", ".join(f"{prefix}X" for prefix in self.prefixes)
                reason = f"no shoe has this coordinate; those of the shoes here are {names} and so on"
                raise SceneError(reason, (*path, name))
        listed = self.simulate.coordinates
        for name, prefix in zip(self.shoe_names, self.prefixes, strict=True):
            if self.several and listed != "auto" and not any(each.startswith(prefix) for each in listed):
                reason = f"none of them is of the {name} shoe; list one, such as {prefix}Y, or leave that shoe out"
                raise SceneError(reason, ("simulate", "coordinates"), list(listed))
        if self.several and self.temperature is not None and self.elastic_table("drum")[1] is not None:
            reason = "the temperature is that of one lining, and several shoes rub on this drum; leave it out"
            raise SceneError(reason, ("temperature",))
        for name in self.shoe_names if self.several else ():
            try:
                scene_from_dict(alone({**self._tables(), "uncertain": None}, name), f"{name} shoe")
            except SceneError as error:
                raise SceneError(str(error)) from None
        return self

    def _named_coordinates(self) -> Iterator[tuple[KeyPath, str]]:
        """Every coordinate that a table names, with the way to the table."""
        yield from ((path, name) for path, table in self.by_coordinate.items() for name in table)
        if self.simulate.coordinates != "auto":
            yield from ((("simulate", "coordinates"), name) for name in self.simulate.coordinates)

    @model_validator(mode="after")
    def _starts_what_moves(self) -> "Scene":
        moving = self.simulate.coordinates
        for path, table in self.by_coordinate.items():
            for name, value in table.items():
                if moving != "auto" and name not in moving:
                    done = "started" if path[0] == "start" else "forced"
                    reason = f"{name} is {done} but not among simulate.coordinates; add it there, or remove it here"
                    raise SceneError(reason, (*path, name), value)
        return self

    @model_validator(mode="after")
    def _bends_where_it_is_elastic(self) -> "Scene":
        for path, name in () if self.several else self._named_coordinates():
            body = "drum" if is_of_drum(name) else "shoe"
            key, table = self.elastic_table(body)
            if is_elastic(name) and table is None:
                cure = f"add a table [{key}], or remove it"
                reason = f"the {body} is rigid and has no elastic mode {name}; {cure}"
                raise SceneError(reason, (*path, name) if path[0] != "simulate" else path)
        return self

    @model_validator(mode="after")
    def _rubs_within_its_drum(self) -> "Scene":
        drum = self.drum.elastic
        if self.several:
            return self
        if self.drum.mesh is not None:
            try:
                self.drum.mesh.check_fits(self.shoe.outer_radius, self.shoe.width)
            except SceneError as error:
                raise error.under(("drum", "mesh")) from None
        if drum is None:
            return self
        if drum.hub_radius >= self.shoe.outer_radius:
            limit = f"the ring's inner radius, shoe.outer_radius = {self.shoe.outer_radius!r} m"
            reason = f"the drum is clamped there, and its back plate must reach from there to beyond {limit}"
            raise SceneError(reason, ("drum", "elastic", "hub_radius"), drum.hub_radius)
        least = self.shoe.width + 2 * abs(drum.offset)
        if drum.width < least * (1 - sys.float_info.epsilon):
            lining = f"the lining, {self.shoe.width!r} m wide"
            reason = f"{lining}, would reach beyond the drum's ring; make the ring {least:.6g} m wide"
            raise SceneError(reason, ("drum", "elastic", "width"), drum.width)
        return self

    @model_validator(mode="after")
    def _is_pressed_on(self) -> "Scene":
        for k, (shoe, contact) in enumerate(zip(self.shoes, self.of_each("contact"), strict=True)):
            if shoe.force and self.steady.state == "uniform-pressure":
                reason = (
                    "the assembly then balances every force that does not change, so that [[shoe.force]] would do "
                    'nothing; write state = "self-consistent", or remove the forces'
                )
                raise SceneError(reason, ("steady", "state"), self.steady.state)
            if not shoe.force and "normal_load" not in contact.model_fields_set:
                lining = f"the lining of the {self.shoe_names[k]} shoe" if self.several else "the lining"
                table = "contact" if contact is self.contact else "shoe.contact"
                reason = (
                    f'nothing presses {lining} on the drum; add normal_load = "2000 N" to [{table}], or push the shoe '
                    'by a table [[shoe.force]] and write state = "self-consistent" in [steady]'
                )
                raise SceneError(reason, tuple(self.key_of(k, "contact.normal_load").split(".")))
        return self

    @model_validator(mode="after")
    def _rubs_where_it_heats(self) -> "Scene":
        if self.temperature is not None and not self.rubs:
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
                reason = no_entry("shoe", self.shoes) if is_of_no_shoe(key, self.shoe) else reason
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

        The values are as in a file: numbers in SI, strings with a unit, whole tables as mappings; None leaves out an
        optional table, such as friction or shoe.elastic, or all of a list of tables, such as shoe.spring; the name of
        one of several shoes at shoe takes that one alone. Raises SceneError.
        """
        tables = self._tables()
        for key, value in values.items():
            tables = replace_value(tables, key, value)
        return scene_from_dict(tables)

    def numbers(self) -> dict[str, float | tuple[float, ...]]:
        """Return every physical number in SI by dotted key; a profile gives drum.speed.time and drum.speed.value.

        A list, such as the points of a friction curve or a point in space, is one tuple; springs and forces at points
        are counted from 0: shoe.spring.0.stiffness. Only tables that are there count, and only those of the brake: not
        start, not simulate, not up to which frequency a shoe's elastic modes are kept, not what a file gives, and no
        radii of patches on a rigid shoe, which change nothing.
        """
        shoes = [(f"shoe.{k}" if self.several else "shoe", shoe.with_radii) for k, shoe in enumerate(self.shoes)]
        tables = [*shoes, *((name, getattr(self, name)) for name in _PHYSICAL_TABLES if name != "shoe")]
        found = {key: number for name, table in tables if table is not None for key, number in _numbers_in(name, table)}
        without = {f"{name}.{key}" for name, shoe in shoes for key in shoe.found}
        return {key: number for key, number in found.items() if key not in without}

    def elastic_table(self, body: str) -> tuple[str, Any]:
        """Key and table by which the "shoe" or the "drum" is elastic, with `up_to` in Hz; None of a rigid one."""
        if body == "drum" and self.drum.mesh is not None:
            return "drum.mesh", self.drum.mesh
        return f"{body}.elastic", getattr(self, body).elastic

    def schedules(self) -> dict[str, Schedule]:
        """Return what may change over time, by dotted key: drum speed, normal load, and forces at points."""
        found: dict[str, Schedule] = {"drum.speed": self.drum.speed}
        for k, one in enumerate(self.alone):
            found[self.key_of(k, "contact.normal_load")] = one.contact.normal_load
            for j, force in enumerate(self.shoes[k].force):
                found[self.key_of(k, f"shoe.force.{j}.size")] = force.size
        return found

    def starts(self) -> dict[str, float]:
        """Return the start of the transient in SI by dotted key, start.displacement.X to start.velocity.Tz.

        Elastic modes count where they are listed in simulate.coordinates, or else started.
        """
        coordinates = self.simulate.coordinates
        if coordinates == "auto":
            started = {*self.start.displacement, *self.start.velocity}
            rigid = [f"{prefix}{name}" for prefix in self.prefixes for name in COORDINATES]
            coordinates = in_order((*rigid, *started))
        # The name of a coordinate may have points: start.velocity.leading.Y.
        parts = {key: key.split(".", 2)[1:] for key in start_units(coordinates)}
        return {key: getattr(self.start, table).get(name, 0.0) for key, (table, name) in parts.items()}

    def to_toml(self) -> str:
        """Return the scene as run, in bare SI numbers: a file of this text loads to an equal scene."""
        return tomli_w.dumps(self._tables())

    def _tables(self) -> dict[str, Any]:
        return self.model_dump(exclude_none=True)


_PHYSICAL_TABLES = tuple(
    name for name in Scene.model_fields if name not in ("title", "steady", "start", "simulate", "uncertain")
)


@functools.lru_cache(maxsize=64)  # by the text: a scene has no hash, and what it keeps would count when compared
def _each_alone(text: str, names: tuple[str, ...]) -> tuple[Scene, ...]:
    tables = tomllib.loads(text)
    return tuple(scene_from_dict(alone(tables, name)) for name in names)


def _numbers_in(within: str, table: Table) -> Iterator[tuple[str, float | tuple[float, ...]]]:
    """The physical numbers of a table and of those within it, by dotted key."""
    for name, value in table:
        key = f"{within}.{name}"
        if isinstance(value, Table):
            yield from _numbers_in(key, value)
        elif is_list(key):
            for k, each in enumerate(value):
                yield from _numbers_in(f"{key}.{k}", each)
        elif isinstance(value, Profile):
            yield f"{key}.time", value.time
            yield f"{key}.value", value.value
        elif isinstance(value, Mapping):
            yield from ((f"{key}.{coordinate}", number) for coordinate, number in value.items())
        elif isinstance(value, float | tuple) and not _sets_resolution(type(table).model_fields[name]):
            yield key, value


def _sets_resolution(field: FieldInfo) -> bool:
    return any(isinstance(each, Resolution) for each in field.metadata)


def load_scene(path: str | os.PathLike[str], settings: Iterable[str] = ()) -> Scene:
    """Read a scene from a TOML file, with `settings` ("KEY=VALUE", as of `--set`) put in one after the other.

    Where there is no file of that name, it is that of a shipped scene, such as "nominal". VALUE is read as a TOML value
    and, if it is none, as a string; it replaces whatever was at KEY. `friction=none` leaves the table friction out; so
    for the other optional tables. Raises SceneError.

    ```pycon
    >>> scene = drumsqueal.load_scene("nominal", ["drum.speed=40 rpm"])
    >>> round(scene.drum.speed, 3)  # rad/s
    4.189
    ```
    """
    return load_with_tables(find_scene(os.fspath(path)), settings)[0]


def load_with_tables(path: str | os.PathLike[str], settings: Iterable[str] = ()) -> tuple[Scene, dict[str, Any]]:
    """Read a scene as `load_scene` does, and return its tables, too, as they were written."""
    # Where the tables are no scene, the error names the file, or the first setting that made them so.
    tables, source = read_tables(path), os.fspath(path)
    for setting in settings:
        with suppress(SceneError):
            scene_from_dict(tables)
            source = f"--set {setting}"
        tables = apply_setting(tables, setting)
    return scene_from_dict(tables, source), tables


def scene_from_dict(data: Mapping[str, Any], source: str = "scene") -> Scene:
    """Check the nested tables of a scene; `source` names them in the SceneError this raises if they are wrong.

    ```pycon
    >>> import tomllib
    >>> scene = drumsqueal.load_scene("nominal")
    >>> drumsqueal.scene_from_dict(tomllib.loads(scene.to_toml())) == scene
    True
    ```
    """
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


def _models_within(within: str, models: Iterable[type[Table]]) -> Iterator[tuple[str, tuple[type[Table], ...]]]:
    """The models of the tables that these have, and so on, by dotted key; 0 stands for any entry of a list."""
    for name, field in (each for model in models for each in model.model_fields.items()):
        key = f"{within}.{name}" if within else name
        if inner := _tables_in(field.annotation):
            inner = tuple(each for each in inner if each is not NamedShoe)
            key = f"{key}.0" if is_list(key) else key
            yield key, inner
            yield from _models_within(key, inner)


_MODELS = {"": (Scene,), **dict(_models_within("", (Scene,))), "shoe.0": (NamedShoe,)}
_MODELS |= dict(_models_within("shoe.0", (NamedShoe,)))


def setting_keys() -> tuple[str, ...]:
    """Every dotted key that a scene may have, such as drum.speed, in the order of its tables."""
    keys = dict.fromkeys(key for table in _MODELS if table for key, _ in _fields_of(table))
    return "title", *keys


def setting_choices(key: str) -> tuple[str, ...]:
    """The words that a dotted key may have, such as auto for simulate.solver; none for one that takes other values."""
    key = as_first(key)
    kinds = [field.annotation for name, field in _fields_of(key.rpartition(".")[0]) if name == key]
    if bool in kinds:
        return "true", "false"
    return tuple(dict.fromkeys(word for kind in kinds for word in get_args(kind) if isinstance(word, str)))


def number_units() -> dict[str, str]:
    """The SI unit of every single number that a scene may have, by the dotted key, with 0 for any entry of a list."""
    tables = [table for table in _MODELS if table.partition(".")[0] in _PHYSICAL_TABLES]
    fields = [each for table in tables for each in _fields_of(table) if not _sets_resolution(each[1])]
    return {key: each.unit for key, field in fields for each in field.metadata if isinstance(each, Quantity)}


def uncertain_units() -> dict[str, str]:
    """Those of the numbers that may be uncertain: the brake's, not the harmonic force's on it, and the start's."""
    units = {key: unit for key, unit in number_units().items() if not key.startswith("forcing.")}
    return units | start_units((*COORDINATES, "E1"))


def start_units(coordinates: Iterable[str] = COORDINATES) -> dict[str, str]:
    """The SI unit of every number of the start, by the dotted key."""
    return {
        f"{key}.{name}": each.unit(name)
        for key, field in _fields_of("start")
        for each in field.metadata
        if isinstance(each, PerCoordinate)
        for name in coordinates
    }


def quantity_of(key: str, scene: Scene) -> Quantity:
    """Unit and limits of a single number of this scene, by its dotted key."""
    found: Any = scene
    parts = key.split(".")
    for place, part in enumerate(parts):
        if isinstance(found, PerCoordinate):
            return Quantity(found.unit(".".join(parts[place:])))
        if isinstance(found, tuple):
            found = found[int(part)]
            continue
        reader = next((each for each in type(found).model_fields[part].metadata if isinstance(each, Reader)), None)
        if isinstance(reader, Quantity):
            return reader
        found = reader or getattr(found, part)
    raise AssertionError(f"{key} is no number with a unit of its own")


def _fields_of(table: str) -> list[tuple[str, FieldInfo]]:
    """The fields of a table that are no tables themselves, by dotted key."""
    fields = [each for model in _MODELS.get(table, ()) for each in model.model_fields.items()]
    return [(f"{table}.{key}", each) for key, each in fields if not _tables_in(each.annotation)]
