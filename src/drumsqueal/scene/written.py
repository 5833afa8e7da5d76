"""A scene as its file writes it: new values go in with the units that the old ones had, and with few digits."""

import re
from collections.abc import Mapping
from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal
from typing import Any

import tomli_w

from drumsqueal.scene import Scene, quantity_of, scene_from_dict
from drumsqueal.scene.file import replace_value
from drumsqueal.scene.quantities import parse_quantity
from drumsqueal.scene.variation import unit_written

FEWEST_DIGITS, MOST_DIGITS = 2, 15  # of a value; with 15 every float of this size is itself again
_EXPONENT = re.compile(r"e\+?(-?)0*")

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
        return self._value(key, float(rounded), MOST_DIGITS)

    def exact(self, key: str, value: float) -> Value:
        """A value (SI) as it stands in the file: with the fewest digits that are read as it, 15 at most."""
        texts = [self._value(key, self.shown(key, value), digits) for digits in range(1, MOST_DIGITS + 1)]
        return next((text for text in texts if self.read(key, text) == value), texts[-1])

    def _value(self, key: str, shown: float, digits: int) -> Value:
        unit, text = self.unit(key), _EXPONENT.sub(r"e\1", f"{shown:.{digits}g}")
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
