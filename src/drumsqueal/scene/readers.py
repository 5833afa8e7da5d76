"""How the fields of a scene's tables are read: every value checked, and in SI once it is in."""

import math
import sys
import unicodedata
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, get_args

from pydantic import BaseModel, ConfigDict
from pydantic_core import core_schema

from drumsqueal.coordinates import COORDINATES, in_order, is_coordinate, is_elastic, is_rotation
from drumsqueal.scene.quantities import KeyPath, SceneError, example, parse_quantity

# What every table of a scene is.


class Table(BaseModel):
    """A table of a scene: frozen, and without room for unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", revalidate_instances="always")


_OTHERS = (
    f"{', '.join(COORDINATES)}, E1, E2, ... of an elastic shoe, and drum.E1, drum.E2, ... of an elastic drum; with the "
    "name of the shoe before them where there are several, as in leading.X"
)
_MOST_POINTS = 100_000  # of a profile


class Reader(ABC):
    """What reads a field of a table, as pydantic metadata; `example` is a value of it as a file could have it."""

    example = "..."

    @abstractmethod
    def read(self, value: Any, /) -> Any:
        """Read what was written; raises SceneError."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Let pydantic read the field by `read`, and leave None alone where the field may be that."""
        schema = core_schema.no_info_plain_validator_function(self.read)
        return core_schema.nullable_schema(schema) if type(None) in get_args(source) else schema


@dataclass(frozen=True)
class Quantity(Reader):
    """A number with a unit: reads strings with a unit and holds the value to its limits."""

    unit: str
    above: float | None = None
    least: float | None = None
    most: float | None = None
    usual: str = ""

    @property
    def example(self) -> str:
        """A value in its unit, the `usual` one if given."""
        return self.usual or example(self.unit)

    def read(self, value: Any) -> float:
        """Read one value to an SI float; raises SceneError."""
        number = parse_quantity(value, self.unit)
        unit = f" {self.unit}" if self.unit else ""
        if self.above is not None and not number > self.above:
            raise SceneError(f"the value must be above {self.above:g}{unit}")
        if self.least is not None and number < self.least:
            raise SceneError(f"the value must not be below {self.least:g}{unit}")
        if self.most is not None and number > self.most:
            raise SceneError(f"the value must not be above {self.most:g}{unit}")
        return number


@dataclass(frozen=True)
class Resolution(Quantity):
    """A quantity that says how finely is computed: it can be set, and is no physical number of the brake.

    Where it is `open`, "auto" leaves it to be found.
    """

    open: bool = False

    def read(self, value: Any) -> Any:
        """Read one value to an SI float, or "auto"; raises SceneError."""
        return value if self.open and value == "auto" else super().read(value)


@dataclass(frozen=True)
class Profile:
    """A value prescribed over time: linear between its points, constant before the first and after the last.

    `time` in s, strictly increasing, and `value` in SI have the same length, 2 to 100000 points. Raises SceneError.
    """

    time: tuple[float, ...]
    value: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check the points."""
        object.__setattr__(self, "time", _numbers(self.time, Quantity("s"), ("time",)))
        object.__setattr__(self, "value", _numbers(self.value, Quantity(""), ("value",)))
        if len(self.time) != len(self.value):
            raise SceneError(f"{len(self.time)} times but {len(self.value)} values; write one value for every time")
        if len(self.time) < 2:
            raise SceneError(f"{len(self.time)} points; write 2 to {_MOST_POINTS}, or a plain value if it is constant")
        for index in range(1, len(self.time)):
            before, after = self.time[index - 1], self.time[index]
            if not after > before:
                raise SceneError(f"the times must increase; write one after {before!r} s", ("time", index), after)


Schedule = float | Profile


def _numbers(values: Any, quantity: Quantity, path: KeyPath = ()) -> tuple[float, ...]:
    if not isinstance(values, list | tuple):
        raise SceneError("this must be a list of values, one for every point", path, values)
    if len(values) > _MOST_POINTS:
        # 56 bytes a point: two numbers with all their digits, each in a line
        size = f"{len(values)} points would take about {len(values) * 56 / 1e6:.3g} MB"
        raise SceneError(f"{size} in every file that holds the scene; write at most {_MOST_POINTS}", path)
    numbers = []
    for index, value in enumerate(values):
        try:
            numbers.append(quantity.read(value))
        except SceneError as error:
            raise error.under((*path, index), value) from None
    return tuple(numbers)


@dataclass(frozen=True)
class Quantities(Reader):
    """A list of numbers with a unit, one for every point of a curve."""

    quantity: Quantity
    example: str

    def read(self, values: Any) -> tuple[float, ...]:
        """Read a list to SI floats; raises SceneError."""
        return _numbers(values, self.quantity)


@dataclass(frozen=True)
class Scheduled(Quantity):
    """A quantity that may also be a profile, written as { time = [...], value = [...] }."""

    def read(self, value: Any) -> Any:
        """Read one value to an SI float or to a Profile in SI; raises SceneError."""
        if isinstance(value, Profile):
            value = {"time": value.time, "value": value.value}
        if not isinstance(value, Mapping):
            return super().read(value)
        if set(value) != {"time", "value"}:
            raise SceneError("a profile has the keys time and value, and only these: { time = [...], value = [...] }")
        return Profile(value["time"], _numbers(value["value"], Quantity(self.unit, least=self.least), ("value",)))


@dataclass(frozen=True)
class Point(Reader):
    """A point x, y, z in the axes of the shoe, in m."""

    example = '["40 mm", "95 mm", "0 mm"]'

    def read(self, values: Any) -> tuple[float, ...]:
        """Read three lengths; raises SceneError."""
        return _three(values, Quantity("m"), self.example)


@dataclass(frozen=True)
class Direction(Reader):
    """A unit vector x, y, z in the axes of the shoe, from a vector of any length but zero."""

    example = "[0.0, 1.0, 0.0]"

    def read(self, values: Any) -> tuple[float, ...]:
        """Read three numbers and divide them by their length; raises SceneError."""
        vector = _three(values, Quantity(""), self.example)
        largest = max(map(abs, vector))
        if largest == 0:
            raise SceneError(f"a direction must not be zero; write one such as {self.example}")
        # What was normalised once stays as it is to the last bit, so that a scene survives its file: of a length three
        # quotients and a root leave less than four round-offs.
        if abs(math.hypot(*vector) - 1) <= 4 * sys.float_info.epsilon:
            return vector
        scaled = [each / largest for each in vector]  # the length of very small numbers would be rounded off
        return tuple(each / math.hypot(*scaled) for each in scaled)


def _three(values: Any, quantity: Quantity, example: str) -> tuple[float, ...]:
    if not isinstance(values, list | tuple) or len(values) != 3:
        raise SceneError(f"this must be a list of three, along x, y and z, such as {example}")
    return _numbers(values, quantity)


@dataclass(frozen=True)
class PerCoordinate(Reader):
    """A table of coordinate names, in `length_unit`, for rotations in `angle_unit`, for elastic modes in `modal_unit`.

    Elastic modes are normalised to a generalised mass of 1, so that their coordinates are in m kg^0.5.
    """

    length_unit: str
    angle_unit: str
    modal_unit: str
    usual: str = ""

    @property
    def example(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        """A value of one coordinate."""
        return f"{{ Y = {self.usual or example(self.length_unit)} }}"

    def unit(self, coordinate: str) -> str:
        """The SI unit for a coordinate."""
        if is_elastic(coordinate):
            return self.modal_unit
        return self.angle_unit if is_rotation(coordinate) else self.length_unit

    def read(self, table: Any) -> dict[str, float]:
        """Read a table to SI floats; raises SceneError."""
        if not isinstance(table, Mapping):
            raise SceneError(f"this must be a table of coordinates such as {self.example}")
        numbers = {}
        for name, value in _flat(table):
            if not is_coordinate(name):
                raise SceneError(f"unknown coordinate; the coordinates are {_OTHERS}", (str(name),))
            if name in numbers:
                raise SceneError("this coordinate is given twice, with quotes and without; leave one out", (name,))
            try:
                numbers[name] = parse_quantity(value, self.unit(name))
            except SceneError as error:
                raise error.under((name,), value) from None
        return numbers


def _flat(table: Mapping[Any, Any]) -> Iterator[tuple[Any, Any]]:
    """Names and values, also of leading.X = 1 without quotes, which makes a table in the table."""
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from ((f"{name}.{key}", each) for key, each in value.items())
        else:
            yield name, value


def listed_coordinates(value: Any) -> Any:
    """Check "auto" or a list of coordinates, and bring it into their own order; raises SceneError.

    So that two ways to write one choice are one scene.
    """
    if isinstance(value, str) and value == "auto":
        return value
    if not isinstance(value, list | tuple) or not value:
        raise SceneError('write "auto", or a list of coordinates such as ["X", "Y", "Tz"]')
    for index, name in enumerate(value):
        if not is_coordinate(name):
            raise SceneError(f"unknown coordinate; the coordinates are {_OTHERS}", (index,), name)
        if name in value[:index]:
            raise SceneError("this coordinate is named twice; leave one out", (index,), name)
    return in_order(value)


def without_controls(title: str) -> str:
    """Check that a title has no control characters; raises SceneError.

    No NetCDF attribute takes a null character, and the others act on whatever shows them.
    """
    for place, letter in enumerate(title, start=1):
        if unicodedata.category(letter) == "Cc" and letter not in "\t\n\r":
            raise SceneError(f"letter {place} is the control character U+{ord(letter):04X}; leave it out")
    return title
