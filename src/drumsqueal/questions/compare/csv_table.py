"""CSV files as programs of all countries write them: any separator, decimal comma, lines of names and units.

The numbers are read by pandas. How the file is laid out is found here: pandas asks for it, or takes it from one line.
"""

import csv
import io
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.ordinary import decoded
from drumsqueal.questions.compare.record import (
    RATE_CURE,
    Asked,
    Measured,
    Sampling,
    UnevenError,
    check_count,
    even_sampling,
    parse_unit,
)

MISSING = frozenset({"", "nan", "na", "n/a", "#n/a", "null", "none", "-", "--"})
LOOKED_AT = 12  # rows that must agree
LONGEST_HEADER = 500  # lines
_THOUSANDTHS = (
    "s sec second seconds",
    "ms msec millisecond milliseconds",
    "us usec µs µsec μs μsec microsecond microseconds",
    "ns nsec nanosecond nanoseconds",
)
TIME_UNITS = {"min": 60.0} | {unit: 1e3**-k for k, units in enumerate(_THOUSANDTHS) for unit in units.split()}
"""Seconds that a unit of time is, in small letters."""
_SHOWN = 40  # letters of a cell that an error shows
_D_EXPONENT = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d)")  # as Fortran writes 1.0D-3
_OTHER_UNITS = frozenset({"", "-", "1", "v", "mv", "eu", "db", "hz", "°c", "n", "v/v"})
_TIME = re.compile(r"(t|time|zeit|temps|tiempo|tempo|tid|tijd|czas|aika|timestamp|seconds)\b.*", re.IGNORECASE)

Line = tuple[int, str]  # its number in the file, from 1 on, and what it says


class Heading(NamedTuple):
    """What a column is called, and the unit that is written next to it ("" where none is)."""

    name: str
    unit: str


class Layout(NamedTuple):
    """Separator, whether commas are decimal ones, the first line of numbers (an index), and the columns.

    `width` counts an empty last column, too, which is no signal.
    """

    separator: str
    decimal_comma: bool
    first: int
    columns: tuple[Heading, ...]
    width: int

    def fault(self, line: str) -> str:
        """What is wrong with a row of numbers; "" where nothing is."""
        if line.count('"') % 2:
            return "a quotation mark is missing"
        row = _cells_of(line, self.separator)
        if len(row) != self.width:
            return f"there are {len(row)} columns, where those above have {self.width}"
        for cell in row[: len(self.columns)]:
            try:
                _number(cell, decimal_comma=self.decimal_comma)
            except ValueError:
                mark = ", with a comma as the decimal mark" if self.decimal_comma else ""
                return f"{cell if len(cell) <= _SHOWN else f'{cell[:_SHOWN]}…'!r} is not a number{mark}"
        return ""


def read_csv(asked: Asked) -> Measured:
    """Read a column of numbers, sampled as the time column or the rate asked for says.

    The time column is the one of that name or, without one, the first whose numbers increase evenly. What is missing
    is NaN. Raises RequestError for what is no table, for too few rows, for times that are not even, for a file without
    a rate, and for a channel that is not there.
    """
    lines, comments = _lines(asked.path)
    remarks: list[str] = []
    layout = _find_layout(asked.path, lines, comments)
    table, numbers = _table(asked.path, lines, layout, remarks)
    check_count(asked.path, len(table))
    place, sampling = _sampling(asked, layout.columns, table, numbers, remarks)
    signals = [k for k in range(len(layout.columns)) if k != place]
    signals = [k for k in signals if not _is_count(table[:, k])] or signals
    if not signals:
        raise RequestError(f"{asked.path}: there is no column next to the time; write one for each signal")
    at = signals[asked.pick([layout.columns[k].name for k in signals])]
    name, unit = layout.columns[at]
    own = parse_unit(unit)
    if unit and own is None and asked.unit is None:
        remarks.append(f"the unit {unit!r} is not known")
    return asked.measured(name, own, sampling, table[:, at], remarks)


def _lines(path: Path) -> tuple[list[Line], list[Line]]:
    """Lines with numbers or names, and comments."""
    lines: list[Line] = []
    comments: list[Line] = []
    for k, line in enumerate(decoded(path.read_bytes()).splitlines(), start=1):
        if line.strip():
            (comments if line.lstrip().startswith(("#", "%", "!", "//", "'", '"#')) else lines).append((k, line))
    return lines, comments


def _table(path: Path, lines: list[Line], layout: Layout, remarks: list[str]) -> tuple[NDArray[np.float64], list[int]]:
    """Numbers (rows, columns), and the lines that they stand in."""
    import pandas

    rows, used = lines[layout.first :], len(layout.columns)
    if len(rows) > 2 and layout.fault(rows[-1][1]):
        remarks.append(f"the last line, {rows[-1][0]}, is incomplete and left out")
        rows = rows[:-1]
    text = re.sub(rf" +(?=[{layout.separator}\n])", "", "\n".join(line for _, line in rows))
    text = _D_EXPONENT.sub("e", text)
    try:
        table = pandas.read_csv(
            io.StringIO(text),
            sep=r"\s+" if layout.separator == " " else layout.separator,
            decimal="," if layout.decimal_comma else ".",
            header=None,
            names=range(layout.width),
            index_col=False,
            dtype=np.float64,
            na_values=[form(word) for word in MISSING for form in (str, str.upper, str.capitalize)],
            skipinitialspace=True,
        ).to_numpy()[:, :used]
    except ValueError:  # which does not say where: every line is looked at
        table = np.full((len(rows), used), np.nan)
    for k in np.flatnonzero(np.isnan(table).any(axis=1)):  # pandas fills up lines that are too short
        if wrong := layout.fault(rows[k][1]):
            raise RequestError(f"{path}: line {rows[k][0]}: {wrong}; correct or remove the line")
    return table, [line for line, _ in rows]


def _sampling(
    asked: Asked, columns: tuple[Heading, ...], table: NDArray[np.float64], lines: list[int], remarks: list[str]
) -> tuple[int | None, Sampling]:
    """The time column, None where there is none, and how it is sampled."""
    named = (k for k, column in enumerate(columns) if _is_time(column.name))
    place = next(named, None)
    if place is None:
        place = next((k for k in range(len(columns)) if _may_be_time(table[:, k])), None)
    if asked.rate is not None:
        if place is not None:
            remarks.append(f"the sample rate is that of --rate, not of the column {columns[place].name!r}")
        return place, Sampling(asked.rate, 0.0)
    if place is None:
        raise RequestError(f"{asked.path}: neither a time column nor a sample rate is in it; {RATE_CURE}")
    name, unit = columns[place]
    if not unit:
        remarks.append(f"the column {name!r} is taken for the time, in s")
    time = table[:, place] * seconds(asked.path, unit or "s")
    missing = np.flatnonzero(~np.isfinite(time))
    if missing.size:
        first = f"the first in line {lines[missing[0]]}"
        remarks.append(f"{missing.size} times are missing, {first}: sampling is assumed to be even there, too")
    try:
        return place, even_sampling(time)
    except UnevenError as error:
        raise RequestError(f"{asked.path}: the times are not evenly spaced, {error}") from None


def seconds(path: Path, unit: str) -> float:
    """Seconds that a unit of time is. Raises RequestError where it is not known."""
    if unit.lower() not in TIME_UNITS:
        raise RequestError(f"{path}: the unit of time {unit!r} is not known; write s, ms or µs, or {RATE_CURE}")
    return TIME_UNITS[unit.lower()]


def _is_count(values: NDArray[np.float64]) -> bool:
    """Whether a column is a mere count of the rows."""
    return values.size > 1 and bool(np.all(np.diff(values) == 1.0))


def _may_be_time(values: NDArray[np.float64]) -> bool:
    """Whether a column increases evenly, and is not a mere count of the rows."""
    try:
        even_sampling(values)
    except UnevenError:
        return False
    return bool(np.isfinite(values).all()) and not _is_count(values)


def _find_layout(path: object, lines: list[Line], comments: list[Line]) -> Layout:
    """How the lines (without blank ones and comments) are laid out. Raises RequestError where no numbers are found."""
    # A space stands for any run of blanks.
    found = [(mark, *where) for mark in ("\t", ";", ",", " ") if (where := _first_row(lines, mark)) is not None]
    if not found:
        advice = "write one with a column for each signal, and times in seconds, not as dates or clocks"
        raise RequestError(f"{path}: no table of numbers is found in it; {advice}")
    separator, first, width = max(found, key=lambda each: each[2])  # of several the first
    rows = [line for _, line in lines[first:]]
    header = [text for _, text in lines[:first]]
    if not header:  # names behind the mark of a comment, as some programs write them
        before = [text.lstrip("#%!/'\" ") for line, text in comments if line < lines[0][0]]
        header = before[-1:]
    if separator == ",":
        separator, width = _not_decimal(path, header, rows, width)
    used = width - all(len(c := _cells_of(row, separator)) == width and not c[-1] for row in rows[:LOOKED_AT])
    comma = separator != "," and any("," in row for row in rows)
    return Layout(separator, comma, first, _columns(header, separator, width, used), width)


def _number(cell: str, *, decimal_comma: bool) -> float:
    """The number in a cell, NaN where it is missing; raises ValueError for anything else."""
    if (decimal_comma and "." in cell) or "_" in cell:  # which Python would take
        raise ValueError(cell)
    try:
        return float(_D_EXPONENT.sub("e", cell.replace(",", ".", 1) if decimal_comma else cell))
    except ValueError:
        if cell.strip().lower() in MISSING:
            return np.nan
        raise


def _cells_of(line: str, separator: str) -> list[str]:
    """The cells of a line, without quotes and blanks around them."""
    if separator == " ":
        line = " ".join(line.split())
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]
    except csv.Error:
        raise ValueError(f"a cell is longer than 128 kB in the line that begins {line[:_SHOWN]!r}") from None


def _first_row(lines: list[Line], separator: str) -> tuple[int, int] | None:
    """Index of the first line from which on numbers stand in the same number of columns, and that number."""
    widths = [_width(line, separator) for _, line in lines[: LONGEST_HEADER + LOOKED_AT]]
    for first in range(min(len(lines), LONGEST_HEADER)):
        some = widths[first : first + LOOKED_AT]
        if some[0] and len(set(some)) == 1:
            return first, some[0]
    return None


def _width(line: str, separator: str) -> int:
    """Number of columns of a row of numbers; 0 for any other line."""
    cells, known = _cells_of(line, separator), 0
    for cell in cells:
        try:
            known += not np.isnan(_number(cell, decimal_comma=separator != "," and "," in cell))
        except ValueError:
            return 0
    return len(cells) if known else 0


def _not_decimal(path: object, header: list[str], rows: list[str], width: int) -> tuple[str, int]:
    """Separator and width where commas separate, or where they turn out to be those of decimals in a single column."""
    whole = all(re.fullmatch(r"[+-]?\d*", cell) for row in rows[:LOOKED_AT] for cell in _cells_of(row, ","))
    named = len(_cells_of(header[-1], ",")) if header else width
    if not whole or 2 * named != width:
        return ",", width
    if width == 2:
        return ";", 1
    advice = f"the header names {named} columns, the numbers fill {width}: commas stand for two things"
    raise RequestError(f"{path}: {advice}; write decimal points, or separate the columns by semicolons")


def _columns(header: list[str], separator: str, width: int, used: int) -> tuple[Heading, ...]:
    """Names and units of the columns from the last lines before the numbers."""
    above = [_header_cells(line, separator, width) for line in header[-2:]]
    names = units = None
    if above and above[-1] is not None:
        if all(_is_unit(cell) for cell in above[-1]) and any(above[-1]):
            units, names = above[-1], above[0] if len(above) == 2 else None
        else:
            names = above[-1]
    columns = []
    for k in range(used):
        name, unit = name_and_unit(names[k]) if names is not None else ("", "")
        unit = units[k].strip("[]() ") if units is not None else unit
        columns.append(Heading(name or f"column {k + 1}", unit))
    return tuple(columns)


def _header_cells(line: str, separator: str, width: int) -> list[str] | None:
    """The cells of a line of names; None where there are not as many as columns. Blanks may stand in a name."""
    cells = _cells_of(line, separator)
    if separator == " " and len(cells) != width:
        cells = [cell.strip() for cell in re.split(r"\s{2,}|\t", line.strip())]
    if separator == " " and len(cells) != width:
        cells = re.findall(r"[^\s(\[]+(?:\s*[(\[][^)\]]*[)\]])?", line)
    if len(cells) == width - 1:  # the columns end with a separator, the names do not
        cells.append("")
    return cells if len(cells) == width else None


def _is_unit(cell: str) -> bool:
    known = cell.lower() in TIME_UNITS or cell.lower() in _OTHER_UNITS or parse_unit(cell) is not None
    return known or re.fullmatch(r"[\[(].*[\])]", cell) is not None


def name_and_unit(cell: str) -> tuple[str, str]:
    """Name and unit of "velocity (mm/s)", "v [mm/s]", "v in mm/s", "v / (mm/s)", "v/(mm/s)", "v, mm/s", "time_ms"."""
    name = cell.strip()
    if parse_unit(name) is not None:  # the unit is all that is advice
        return name, name
    found = re.fullmatch(r"(.*?)\s*/?\s*[\[(]([^\])]*)[\])]\s*", cell) or re.fullmatch(
        r"(.*\S)\s+(?:in|/)\s+(\S+)", cell
    )
    if found is None:
        found = re.fullmatch(r"([^/,]*[^/,\s])(?:/|,\s*)(\S.*)", name)
        found = found if found and (found[2].lower() in TIME_UNITS or parse_unit(found[2]) is not None) else None
    if found is None:
        found = re.fullmatch(r"(.*[^\W_])[_\s,]+(\S+)", name)
        found = found if found and found[2].lower() in TIME_UNITS and _is_time(found[1]) else None
    return (name, "") if found is None else (found[1].strip(), found[2].strip())


def _is_time(name: str) -> bool:
    """Whether a column is called time, in one of several languages."""
    return _TIME.fullmatch(name.replace("_", " ")) is not None
