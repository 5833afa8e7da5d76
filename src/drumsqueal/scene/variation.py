"""A number of a scene over a range, as in "drum.speed=1..40x20", and new values as the file of the scene writes them.

These have the units that the old ones had, and few digits.
"""

import math
import re
from collections.abc import Mapping, Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal
from typing import Any, NamedTuple

import tomli_w

from drumsqueal.errors import nearest
from drumsqueal.scene import Scene, SceneError, number_units, quantity_of, scene_from_dict
from drumsqueal.scene.file import is_list, is_optional, no_entry, replace_value
from drumsqueal.scene.quantities import as_first, parse_quantity
from drumsqueal.scene.shoes import is_of_no_shoe

POINTS, MOST_POINTS = 40, 10_000
SYNTAX = "KEY=FROM..TO[xN]"

_PLAIN = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")


class Variation(NamedTuple):
    """A number of a scene by its dotted key, its SI unit, and the values (in SI, evenly spaced, in order) it takes.

    `given` is the unit in which it was written or is usual, "" for SI, and `size` what that is in SI: tables and
    figures show values in it.
    """

    key: str
    unit: str
    values: tuple[float, ...]
    given: str = ""
    size: float = 1.0

    @property
    def shown_unit(self) -> str:
        """The unit of values that are shown."""
        return self.given or self.unit

    @property
    def label(self) -> str:
        """What stands at an axis of its values: the key, with that unit."""
        return f"{self.key} ({self.shown_unit})" if self.shown_unit else self.key

    @property
    def unit_after(self) -> str:
        """That unit as it stands behind a number, after a space."""
        return f" {self.shown_unit}" if self.shown_unit else ""

    def in_unit(self, given: str) -> "Variation":
        """The same values, shown in another unit; the SI unit, "1" and "" stand for SI."""
        if given in ("", "1", self.unit):
            return self._replace(given="", size=1.0)
        return self._replace(given=given, size=parse_quantity(f"1 {given}", self.unit))

    def shown(self, value: float) -> float:
        """A value (SI), or a difference of two, in that unit."""
        return value / self.size

    def with_unit(self, value: float, form: str = ".6g") -> str:
        """A value (SI) in that unit, with the unit."""
        return f"{self.shown(value):{form}}{self.unit_after}"

    def brief(self, value: float) -> str:
        """A value (SI) in that unit, to a hundredth of the range and to three digits at least: 52.1."""
        shown = self.shown(value)
        sizes = (abs(self.shown(self.last - self.first)) / 100, abs(shown) / 100)
        decimals = max((-math.floor(math.log10(size)) for size in sizes if size > 0), default=0)
        return f"{round(shown, decimals):.10g}"

    @property
    def first(self) -> float:
        """Where the range begins."""
        return self.values[0]

    @property
    def column(self) -> str:
        """Heading of its values in a table, with the unit that is shown: "drum.speed_rpm"."""
        unit = self.shown_unit.replace("/", "_per_").replace("^", "").replace("%", "percent").replace(" ", "")
        return f"{self.key}_{unit}" if unit else self.key

    def listed(self, value: float) -> float:
        """A value (SI) in the unit that is shown, as a table or a file holds it: 30 rpm, not 30.000000000000004."""
        return float(f"{self.shown(value):.14g}") if self.given else value

    @property
    def last(self) -> float:
        """Where it ends."""
        return self.values[-1]


def read_variation(
    text: str, scene: Scene, *, option: str = "--along", points: int | None = POINTS, starts: bool = False
) -> Variation:
    """Read "KEY=FROM..TO" or "KEY=FROM..TOxN": N values (`points` without it) from FROM to TO, both included.

    KEY is the dotted path of a number of the scene's brake (`scene.numbers()`) or, where `starts` may be varied, of its
    start, such as start.velocity.Y. FROM and TO are numbers in SI or with a unit, as in a scene; a unit after TO alone
    holds for both. `points` None takes a range only, without N, and gives its two ends. Raises SceneError, headed by
    `option`, for a key that is no number of this scene, for one that is a profile, for values that the scene does not
    take, for a range without length, and for too many values.
    """
    example = 'drum.speed=1..40x20 or drum.speed="10 rpm..400 rpm"' if points else "drum.speed=1..40"
    try:
        key, equals, written = (part.strip() for part in text.partition("="))
        if not equals:
            raise SceneError(f"write {SYNTAX if points else 'KEY=FROM..TO'}, such as {example}")
        unit = unit_of(key, scene)
        if key in scene.starts() and not starts:
            raise SceneError(f"{key} is where the transient starts; `sweep --transient` varies it")
        counted = re.fullmatch(r"(?P<range>.*[^\s.])\s*[x×]\s*(?P<count>[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)", written)
        if counted and points is None:
            raise SceneError(f"a range takes no number of values; leave out x{counted['count']}")
        (first, last), given = _ends(counted["range"] if counted else written, unit, example)
        count = _count(counted["count"], example) if counted else points or 2
        for value in (first, last):
            scene.with_values({key: value})
        inner = (first + k * (last - first) / (count - 1) for k in range(1, count - 1))
        values = (first, *inner, last)
        if len(set(values)) < count:
            raise SceneError(f"the range is too narrow for {count} values that differ")
    except SceneError as error:
        # What with_values says of a value keeps the reason, and loses the scene's place.
        reason = error.reason if not error.path or error.path == ("scene",) else str(error)
        raise SceneError(reason, (f"{option} {text}",)) from None
    # Of ranges without a unit, or in SI, values in Pa are huge.
    return Variation(key, unit, values).in_unit(given or {"Pa": "GPa"}.get(unit, ""))


def may_not_rest(variation: Variation) -> None:
    """Raise SceneError for drum speeds that reach or cross zero, where nothing slides."""
    if variation.key == "drum.speed" and min(variation.values) <= 0 <= max(variation.values):
        message = "the range may not reach or cross a drum at rest, where nothing slides; keep to one side of 0"
        raise SceneError(message, ("drum", "speed"))


def unit_of(key: str, scene: Scene) -> str:
    """The SI unit of a number of a scene's brake or start; raises SceneError for any other key, and for a profile."""
    table = key.partition(".")[0]
    numbers = scene.starts() if table == "start" else scene.numbers()
    profile = key.rpartition(".")[0]
    key = profile if f"{profile}.value" in scene.numbers() else key  # of whose times or values it is one
    if key not in numbers and f"{key}.value" in numbers:
        raise SceneError(f"{key} is a profile over time in this scene; give it one value, as by --set {key}=...")
    if isinstance(numbers.get(key), tuple):
        raise SceneError(f"{key} is a list in this scene, which is not varied; set all of it, as by --set {key}=[...]")
    if key in numbers:
        return quantity_of(key, scene).unit
    _check_table(key, scene)
    if as_first(key) in number_units() and key.endswith(".radius"):
        raise SceneError(f"{key} changes nothing while the shoe is rigid; add a table shoe.elastic")
    if is_of_no_shoe(key, scene.shoe):
        raise SceneError(no_entry("shoe", scene.shoes))
    contact, _, number = key.rpartition(".")
    if number in ("stiffness", "hardening") and f"{contact}.compression" in numbers:
        raise SceneError(f"{key} is not in this scene, whose lining is a measured curve; set that as a whole")
    if key.endswith("contact.hardening"):
        raise SceneError(f"{key} is not in this scene; add it first, as by --set {key}=0")
    plain = [each for each in numbers if not isinstance(numbers[each], tuple)]
    of = "start" if table == "start" else "brake"
    raise SceneError(f"{key or 'nothing'} is no number of this scene's {of}; {likely_key(key, plain)}")


def _check_table(key: str, scene: Scene) -> None:
    """Raise SceneError for a key of a table, or of an entry of a list, that the scene does not have."""
    parts = key.split(".")
    above = (".".join(parts[:k]) for k in range(1, len(parts) + 1))
    missing = next((each for each in above if is_optional(each) or is_list(each)), None)
    if missing is None:
        return
    there: Any = scene
    for part in missing.split("."):
        if isinstance(there, tuple) and part not in map(str, range(len(there))):
            raise SceneError(no_entry("shoe", there))
        if not isinstance(there, tuple) and not hasattr(there, part):
            raise SceneError(f"this scene has one {parts[0]}; write {'.'.join([parts[0], *parts[2:]])}")
        there = there[int(part)] if isinstance(there, tuple) else getattr(there, part)
    if is_list(missing):
        entry = key.removeprefix(missing).split(".")[1:2]
        if entry and entry[0] in map(str, range(len(there))):
            return
        raise SceneError(no_entry(missing, there))
    if there is None:
        raise SceneError(f"this scene has no table {missing}; add it with all its keys to the file first")


def likely_key(key: str, keys: Sequence[str]) -> str:
    """Which of the keys may be meant by one that is none of them, or those nearest to it and what lists all."""
    same_name = [each for each in keys if each.split(".", 1)[1] in (key, key.partition(".")[2])]
    near = same_name or nearest(key, keys)
    if near:
        return f"did you mean {near[0]}?"
    listed = ", ".join(nearest(key, keys, most=3, likeness=0.0))
    return f"the nearest are {listed}" + "; drumsqueal sensitivity SCENE lists all" * (not key.startswith("start"))


def _ends(written: str, unit: str, example: str) -> tuple[tuple[float, float], str]:
    """Both ends in SI, and the unit that both were written in, "" where that is none or the SI one."""
    texts = [part.strip() for part in written.split("..")]
    if len(texts) != 2 or not all(texts) or "..." in written:
        raise SceneError(f"{written or 'nothing'} is no range; write FROM..TO, such as {example}")
    first, last = texts
    if _PLAIN.fullmatch(first) and not _PLAIN.fullmatch(last):  # 10..400 rpm
        first += unit_written(last)
    elif _PLAIN.fullmatch(last) and not _PLAIN.fullmatch(first):
        _value(first, unit)  # a mistake in it comes first
        raise SceneError(f"the unit of {last} is missing; write it after the second value, too")
    ends = _value(first, unit), _value(last, unit)
    if ends[0] == ends[1]:
        raise SceneError("the range begins where it ends; give it two values")
    units = {unit_written(text).strip() for text in (first, last)}
    return ends, units.pop() if len(units) == 1 and units != {unit} else ""


def unit_written(text: str) -> str:
    """What follows the number in a text, if it could be a unit."""
    number = _PLAIN.match(text)
    rest = text[number.end() :] if number else ""
    return rest if re.fullmatch(r"\s*(?:1\s*/|[^\W\d_]|[°%]).*", rest) else ""


def _value(text: str, unit: str) -> float:
    try:
        return parse_quantity(float(text) if _PLAIN.fullmatch(text) else text, unit)
    except SceneError as error:
        raise SceneError(f"{text}: {error.reason}") from None


def _count(written: str, example: str) -> int:
    if not written.isdecimal():
        raise SceneError(f"x{written}: the number of values must be a whole number, such as {example}")
    count = int(written) if len(written) <= 9 else MOST_POINTS + 1  # digits
    if not 2 <= count <= MOST_POINTS:
        raise SceneError(f"x{written} is not from 2 to {MOST_POINTS} values")
    return count


FEWEST_DIGITS, MOST_DIGITS = 2, 15  # of a value; with 15 every float of this size is itself again

Value = float | str


class Written:
    """The tables of a scene before they are turned to SI, and that scene."""

    def __init__(self, scene: Scene, tables: Mapping[str, Any] | None = None) -> None:
        """Take a scene and the `tables` of its file (None: in SI), in which a profile or another value may stand."""
        self.scene, self._tables = scene, dict(scene.model_dump(exclude_none=True) if tables is None else tables)
        if tables is None:
            return
        own = scene_from_dict(tables).numbers()
        for key, value in scene.numbers().items():
            if own.get(key) != value:
                self._tables = replace_value(self._tables, key, value)

    def unit(self, key: str) -> str:
        """The unit that the number with this dotted key has in the file, "" for one in SI without its unit."""
        found: Any = self._tables
        for part in key.split("."):
            if isinstance(found, list | tuple):
                found = dict(zip(map(str, range(len(found))), found, strict=True))
            found = found.get(part) if isinstance(found, Mapping) else None
        return unit_written(found).strip() if isinstance(found, str) else ""

    def shown(self, key: str, value: float) -> float:
        """A value (SI) in the unit of the file."""
        return value / self._size(key)

    def outward(self, key: str, value: float, before: float, within: float, *, inward: bool = False) -> Value:
        """A value (SI) as it would stand in the file, rounded away from the one before (`inward`: towards it).

        It has so few digits that the change from the one before is exact to the fraction `within`.
        """
        size = self._size(key)
        shown, origin = (Decimal(f"{each / size:.{MOST_DIGITS}g}") for each in (value, before))
        way, rounded = ROUND_CEILING if (shown > origin) is not inward else ROUND_FLOOR, shown
        for digits in range(FEWEST_DIGITS, MOST_DIGITS + 1):
            step = Decimal(1).scaleb(shown.adjusted() - digits + 1) if shown else Decimal(1)
            rounded = shown.quantize(step, way)
            if abs(rounded - shown) <= Decimal(within) * abs(shown - origin):
                break
        return self.in_digits(key, float(rounded), MOST_DIGITS)

    def exact(self, key: str, value: float) -> Value:
        """A value (SI) as it stands in the file: with the fewest digits that are read as it, 15 at most."""
        texts = [self.in_digits(key, self.shown(key, value), digits) for digits in range(1, MOST_DIGITS + 1)]
        return next((text for text in texts if self.read(key, text) == value), texts[-1])

    def in_digits(self, key: str, shown: float, digits: int) -> Value:
        """A value in the unit of the file as it stands there, with so many digits at most."""
        unit, text = self.unit(key), re.sub(r"e\+?(-?)0*", r"e\1", f"{shown:.{digits}g}")
        return f"{text} {unit}" if unit else float(text)

    def read(self, key: str, value: Value) -> float:
        """A value of the file in SI; raises SceneError."""
        return quantity_of(key, self.scene).read(value)

    def with_values(self, values: Mapping[str, Value]) -> "Written":
        """The same with values of the file put in by dotted key; raises SceneError."""
        tables = self._tables
        for key, value in values.items():
            tables = replace_value(tables, key, value)
        return Written(scene_from_dict(tables), tables)

    def to_toml(self) -> str:
        """The file."""
        return tomli_w.dumps(self._tables)

    def _size(self, key: str) -> float:
        unit = self.unit(key)
        return parse_quantity(f"1 {unit}", quantity_of(key, self.scene).unit) if unit else 1.0
