"""Physical values as they are written, each read to one SI float; and how the fields of a scene are read by them.

Units are converted by pint. What may be written is held narrower than pint has it: for pint 5 Hz is 5 rad/s, "dB" and
"pi" are plain numbers, and arithmetic is carried out.
"""

import json
import math
import re
import sys
import unicodedata
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from numbers import Real
from typing import TYPE_CHECKING, Any, get_args

from pydantic import BaseModel, ConfigDict
from pydantic_core import core_schema

from drumsqueal.coordinates import COORDINATES, in_order, is_coordinate, is_elastic, is_rotation

if TYPE_CHECKING:
    import pint


RPM = math.tau / 60  # rad/s
KeyPath = tuple[str | int, ...]

# What each SI unit measures, and a value that could stand in a scene.
_EXPECTED = {
    "m": ("a length", "100 mm"),
    "m/s": ("a velocity", "1e-3 m/s"),
    "rad": ("an angle", "130 deg"),
    "rad/s": ("an angular speed", "48 rpm"),
    "kg/m^3": ("a density", "7820 kg/m^3"),
    "N": ("a force", "2000 N"),
    "N*m": ("a moment", "1 N*m"),
    "N/m": ("a stiffness", "1e8 N/m"),
    "N*s/m": ("a damping", "100 N s/m"),
    "N/m^3": ("a stiffness per area", "0.35e11 N/m^3"),
    "N/m^4": ("a hardening", "1e15 N/m^4"),
    "s/m": ("an inverse velocity", "1 s/m"),
    "s": ("a time", "40 ms"),
    "Hz": ("a frequency", "50 kHz"),
    "Pa": ("a pressure or an elastic modulus", "210 GPa"),
    "J/K": ("a heat capacity", "300 J/K"),
    "W/K": ("a cooling power per temperature", "2 W/K"),
    "1/K": ("a fraction per temperature", "0.001 1/K"),
    "m*kg^0.5": ("a modal displacement", "1e-6 m*kg^0.5"),
    "m*kg^0.5/s": ("a modal velocity", "1e-3 m*kg^0.5/s"),
    "N/kg^0.5": ("a modal force", "10 N/kg^0.5"),
}
DECIMAL_POINT = "a number takes a decimal point and no comma"
ROUND_OFF, _MANY = 1e-9, 100.0  # a fraction below it is written as zero, one above as a power of ten

# The unit expression is held to names, products (a space is one, as in "N s/m"), "/", one-digit powers and square roots
# (0.5): pint evaluates arithmetic, and a tower of powers (9**9**9) would keep it busy for ever.
_NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
_FACTOR = r"(?:[A-Za-z_µμΩ]+|°|%)(?:(?:\^|\*\*)-?(?:[1-9]|0\.5)|[²³])?"
_WRITTEN = re.compile(
    rf"\s*(?P<number>{_NUMBER})\s*(?P<unit>(?:1\s*/\s*)?{_FACTOR}(?:(?:\s*[*/·]\s*|\s+){_FACTOR})*)?\s*"
)

# Factors as pint has them, of what scenes are mostly written in: for these alone it need not be loaded, which takes a
# quarter of a second.
_USUAL = {
    ("mm", "m"): 1e-3,
    ("deg", "rad"): math.pi / 180,
    ("rpm", "rad/s"): RPM,
    ("kN", "N"): 1e3,
    ("ms", "s"): 1e-3,
    ("kHz", "Hz"): 1e3,
    ("GPa", "Pa"): 1e9,
    ("%", ""): 1e-2,
}
_NOTHING = object()
_ENTRY, _MODE = re.compile(r"\.[0-9]+(?=\.)"), re.compile(r"\.[ES][1-9][0-9]*$")


class SceneError(ValueError):
    """What is wrong with a request, in one line: where, the value, the reason and the cure.

    `reason` is the line without the place; `path` leads to the place and `value` is what was found there.
    """

    def __init__(self, reason: str, path: KeyPath = (), value: Any = _NOTHING):
        """Build the line from the reason, the path (empty: the reason says it all) and the value found there."""
        self.reason, self.path, self.value = reason, path, value
        place = dotted(path)
        if place and value is not _NOTHING:
            place += f" = {show(value)}"
        line = f"{place}: {reason}" if place else reason
        super().__init__(printable(line))

    def under(self, path: KeyPath, value: Any = _NOTHING) -> "SceneError":
        """Return the same error seen from further out: `path` leads to what was read, and `value` is what that was."""
        inner = value if self.value is _NOTHING and not self.path else self.value
        return SceneError(self.reason, path + self.path, inner)


class QuantityError(SceneError):
    """Why a text or a value is not a quantity of its kind: the `fault`, and the `cure`."""

    def __init__(self, fault: str, cure: str):
        """Put fault and cure together."""
        super().__init__(f"{fault}; {cure}")
        self.fault, self.cure = fault, cure


def printable(text: str) -> str:
    """Return the text safe on any terminal: what does not print, such as an escape, becomes a question mark."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def percent(fraction: float, sign: str = "") -> str:
    """A fraction in per cent, of two digits where it is small, with a sign if `sign` is "+": 1 %, +32 %, 0.0013 %."""
    if abs(fraction) < ROUND_OFF:
        return "0 %"
    digits = ".2g" if abs(fraction) < 0.0995 or abs(fraction) > _MANY else ".0f"  # no exponent for hundreds
    return f"{100 * fraction:{sign}{digits}} %"


def dotted(path: KeyPath) -> str:
    """Write a path as users do: drum.speed.value[2], shoe.spring.0.stiffness."""
    *tables, last = path or ("",)
    longest_part = 300  # characters of a path that are shown
    end = f"[{last}]" if isinstance(last, int) else f".{_shortened(last, longest_part)}"
    return ("".join(f".{_shortened(str(part), longest_part)}" for part in tables) + end).removeprefix(".")


def as_first(key: str) -> str:
    """The dotted key of the same number of the first spring, force or elastic mode: shoe.spring.0.damping for .3."""
    return _MODE.sub(".E1", _ENTRY.sub(".0", key))


def show(value: Any) -> str:
    """Write a value as it would stand in a scene file, shortened."""
    try:
        text = json.dumps(value, ensure_ascii=False)
    except (TypeError, ValueError, RecursionError):  # no TOML value, or an integer too long to print
        text = f"<{type(value).__name__}>"
    return _shortened(text, 60)


def _shortened(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most - 10]}...{text[-7:]}"


def parse_quantity(value: Any, unit: str) -> float:
    """Read a number in SI, or a string such as "100 mm", as a float in `unit` ("" for a plain number).

    `unit` is an SI unit: "m", "rad/s", "Hz", "N/m^3". Radians count as a dimension, so an angular speed takes "48 rpm"
    and refuses "5 Hz", and a frequency the other way round. Raises QuantityError, to which the caller adds the place,
    for anything that is not a finite quantity of that kind.
    """
    if isinstance(value, str):
        number = _from_text(value, unit)
    elif isinstance(value, Real) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
    else:
        raise QuantityError("this is not a number", _cure(unit))
    if not math.isfinite(number):
        raise QuantityError("the value must be finite", _cure(unit))
    return number


def _from_text(text: str, unit: str) -> float:
    written = len(text) <= 64 and _WRITTEN.fullmatch(text)  # characters in a value
    if not written and "," in text and _WRITTEN.fullmatch(text.replace(",", ".")):
        meant = text.strip().replace(",", ".")
        plain = re.fullmatch(_NUMBER, meant) is not None
        raise QuantityError(DECIMAL_POINT, f"write {meant if plain else json.dumps(meant, ensure_ascii=False)}")
    if not written:
        raise QuantityError("this is not a number followed by a unit", _cure(unit))
    number = float(written["number"])
    if written["unit"]:
        return _in_unit(number, re.sub(r"\s*·\s*|(?<![*/\s])\s+(?![*/\s])", "*", written["unit"]), unit)
    plain = written["number"].removeprefix("+")
    if unit:
        raise QuantityError("the unit is missing", f'write {plain} as a number in {unit}, or "{plain} {unit}"')
    raise QuantityError("a plain number is wanted", f"write {plain} without the quotes")


def _in_unit(number: float, written: str, unit: str) -> float:
    factor = 1.0 if written == unit in _EXPECTED else _USUAL.get((written, unit))
    if factor is not None:
        return number * factor
    if not unit and written not in ("%", "percent"):  # pint would turn "dB" and "pi" into plain numbers too
        raise QuantityError(f'a plain number is wanted, without the unit "{written}"', _cure(unit))
    registry = _registry()
    try:
        given, wanted = registry.parse_units(written), registry.parse_units(unit)
        # Root units, unlike pint's dimensions, keep the radian: for pint itself 5 Hz is 5 rad/s.
        if str(registry.get_root_units(given)[1]) == str(registry.get_root_units(wanted)[1]):
            return float(registry.Quantity(number, given).to(wanted).magnitude)
    except Exception:  # besides its own errors pint raises AssertionError, KeyError and ValueError for odd names
        raise QuantityError(f'unknown unit "{written}"', _cure(unit)) from None
    mismatch = f"a unit of {_EXPECTED[unit][0].split(' ', 1)[1]}" if unit in _EXPECTED else f"the like of {unit}"
    named = f'"{written}"' + (f" ({given})" if str(given) != written else "")
    raise QuantityError(f"{named} is not {mismatch}", _cure(unit))


def _cure(unit: str) -> str:
    if not unit:
        return "write a plain number such as 0.5"
    if unit not in _EXPECTED:
        return f'write a value such as "1 {unit}" or a number in {unit}'
    kind, example = _EXPECTED[unit]
    return f'write {kind} such as "{example}" or a number in {unit}'


def example(unit: str) -> str:
    """Return a value in `unit` as it could stand in a scene file."""
    return f'"{_EXPECTED[unit][1]}"' if unit in _EXPECTED else "0.5"


@cache
def _registry() -> "pint.UnitRegistry":
    # Importing pint and building its registry takes a quarter of a second: only a scene that writes units pays it.
    if "pint" in sys.modules and sys.modules["pint"] is None:  # hidden by the command line
        del sys.modules["pint"]
    import pint

    registry = pint.UnitRegistry()
    registry.define("@alias turn = rev")
    return registry


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
    """A quantity that says how finely is computed, or "auto": it can be set, and is no physical number of the brake."""

    def read(self, value: Any) -> Any:
        """Read one value to an SI float, or "auto"; raises SceneError."""
        try:
            return value if value == "auto" else super().read(value)
        except QuantityError as error:
            raise QuantityError(error.fault, f'{error.cure}, or "auto"') from None


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
        check_rising(self.time, "time", "the times must increase; write one after {!r} s")


def check_rising(values: Sequence[float], key: str, reason: str) -> None:
    """Raise SceneError, for a reason that names the value before, where one is not above that."""
    for index, (before, after) in enumerate(pairwise(values), 1):
        if not after > before:
            raise SceneError(reason.format(before), (key, index), after)


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
    unit = "m"

    def read(self, values: Any) -> tuple[float, ...]:
        """Read three numbers; raises SceneError."""
        if not isinstance(values, list | tuple) or len(values) != 3:
            raise SceneError(f"this must be a list of three, along x, y and z, such as {self.example}")
        return _numbers(values, Quantity(self.unit))


@dataclass(frozen=True)
class Direction(Point):
    """A unit vector x, y, z in the axes of the shoe, from a vector of any length but zero."""

    example = "[0.0, 1.0, 0.0]"
    unit = ""

    def read(self, values: Any) -> tuple[float, ...]:
        """Read three numbers and divide them by their length; raises SceneError."""
        vector = super().read(values)
        largest = max(map(abs, vector))
        if largest == 0:
            raise SceneError(f"a direction must not be zero; write one such as {self.example}")
        # What was normalised once stays as it is to the last bit, so that a scene survives its file: of a length three
        # quotients and a root leave less than four round-offs.
        if abs(math.hypot(*vector) - 1) <= 4 * sys.float_info.epsilon:
            return vector
        scaled = [each / largest for each in vector]  # the length of very small numbers would be rounded off
        return tuple(each / math.hypot(*scaled) for each in scaled)


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
