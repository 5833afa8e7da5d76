"""What a field of a result is: label, digits, unit and meaning, said once, where the field is.

    class Line(Finding):
        frequency_Hz: Annotated[float, Column("measured", ".2f", "frequency of a measured line")]

From that follow the column of the printed table, the one on the page that `report` makes, and what the JSON schema and
docs/json.md say of the key.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Self, get_args, get_type_hints

from pydantic import BaseModel


@dataclass(frozen=True)
class Column:
    """How a value is shown and what it means.

    The `label` is the heading of its column, on several lines where it is long; a table names words for `{words}` in
    it. `digits` is the format of a number, "~4" that of `to_digits` in four digits, and ">" sets text to the right as
    numbers are; the uncertainty in the field `within` decides how many digits there are instead, where it is known. The
    unit is the one that the name of the field ends in, unless it is given, and `factor` what a value is multiplied by
    for it; it stands in the heading or, `in_cells`, behind every value. `missing` stands where there is no value; one
    that is `optional` is left out of a table in which no row has one.
    """

    label: str = ""
    digits: str = ""
    meaning: str = ""
    unit: str | None = None
    factor: float = 1.0
    missing: str = "-"
    within: str = ""
    in_cells: bool = False
    optional: bool = False

    @property
    def is_number(self) -> bool:
        """Whether its column is set to the right, and never folded."""
        return bool(self.digits)

    def named(self, field: str) -> Self:
        """The same with the unit that the name of a field ends in, where none was given."""
        return self if self.unit is not None else replace(self, unit=unit_in(field))

    def heading(self, **words: str) -> str:
        """The heading of its column, with the unit on a line of its own or where the label has {unit}."""
        label = self.label.format(unit=self.unit, **words)
        return f"{label}\n{self.unit}" if self.unit and not (self.in_cells or "{unit}" in self.label) else label

    @property
    def title(self) -> str:
        """The same in a line, as on a page: Growth rate, 1/s."""
        text = " ".join(self.label.format(unit="").split())
        return ", ".join(filter(None, (f"{text[:1].upper()}{text[1:]}", self.unit)))

    def text(self, value: Any) -> Any:
        """A value as it is shown; what is text already stays as it is."""
        if is_missing(value):
            return self.missing
        if isinstance(value, bool):
            return "yes" if value else "no"
        if not isinstance(value, int | float):
            return value
        shown = value if self.factor == 1 else self.factor * value
        text = to_digits(shown, int(self.digits[1:])) if self.digits.startswith("~") else signed(shown, self.digits)
        return f"{text} {self.unit}" if self.in_cells and self.unit else text

    def text_in(self, row: Any, field: str) -> Any:
        """That of a field of a result."""
        value, within = getattr(row, field), self.within and getattr(row, self.within)
        return to_uncertainty(value, within) if within else self.text(value)

    def __get_pydantic_json_schema__(self, core_schema: Any, handler: Any) -> dict[str, Any]:
        """Put the meaning into the schema of the field."""
        schema = handler(core_schema)
        return schema | ({"description": self.meaning} if self.meaning else {})


def is_missing(value: Any) -> bool:
    """Whether there is no value: None, NaN or no text."""
    return value is None or (isinstance(value, float) and math.isnan(value)) or (isinstance(value, str) and not value)


def signed(value: float, how: str) -> str:
    """A number by a format such as "+.3f"; without a sign where it is shown as zero."""
    text = f"{value:{how}}"
    return text.lstrip("+-") if float(text) == 0 else text


def unit_in(field: str) -> str:
    """The unit that the name of a field ends in: 1/s of growth_rate_1_per_s; "" where it ends in none."""
    found = re.search(r"_(?:(1|m|rad|N)_per_(s2?)|(Hz|dB|J|K|N|Pa|kg|m3?|ms|rad|s))$", field)
    return "" if found is None else found[3] or f"{found[1]}/{found[2]}".replace("s2", "s^2")


@cache
def columns_of(kind: type) -> dict[str, Column]:
    """The columns among the fields and properties of a class, by name, in the order of its table.

    These are the class's own `columns`, of which ... are those that it does not name, or else all of them.
    """
    if issubclass(kind, BaseModel):
        said: dict[str, Sequence[Any]] = {name: each.metadata for name, each in kind.model_fields.items()}
    else:
        said = {name: get_args(each) for name, each in get_type_hints(kind, include_extras=True).items()}
    for name, each in (member for owner in reversed(kind.__mro__) for member in vars(owner).items()):
        if isinstance(each, property):
            said[name] = get_args(each.fget.__annotations__.get("return"))
    found = {n: each.named(n) for n, parts in said.items() for each in parts if isinstance(each, Column)}
    columns = getattr(kind, "columns", (...,))
    others = [name for name in found if name not in columns]
    named = (name for each in columns for name in (others if each is ... else [each]))
    return {name: found[name] for name in named}


def values_of(row: Any) -> list[Any]:
    """What a result has of each of its columns."""
    return [getattr(row, name) for name in columns_of(type(row))]


def shown_columns(kind: type, rows: Sequence[Any]) -> dict[str, Column]:
    """The columns of a table of results of a class: without the optional ones in which no row has a value."""
    empty = {name for name in columns_of(kind) if all(is_missing(getattr(row, name)) for row in rows)}
    return {name: each for name, each in columns_of(kind).items() if not (each.optional and name in empty)}


def table_of(kind: type, rows: Sequence[Any]) -> tuple[list[Column], list[list[Any]]]:
    """The columns of results of a class, and the cells of each row."""
    columns = shown_columns(kind, rows)
    return list(columns.values()), [[each.text_in(row, name) for name, each in columns.items()] for row in rows]


def to_uncertainty(value: float, uncertainty: float) -> str:
    """A value with as many digits as two of its uncertainty need."""
    if not uncertainty or not value:
        return to_digits(value, 6)
    return to_digits(
        value, min(12, max(2, math.floor(math.log10(abs(value))) - math.floor(math.log10(uncertainty)) + 2))
    )


def to_digits(value: float, digits: int) -> str:
    """1.3e8 for 1.30e+08."""
    text = f"{value:#.{digits}g}".rstrip(".")
    mantissa, e, exponent = text.partition("e")
    return f"{mantissa.rstrip('.')}e{int(exponent)}" if e else text
