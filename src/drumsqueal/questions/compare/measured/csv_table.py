"""CSV files as programs of all countries write them: any separator, decimal comma, lines of names and units."""

import csv
from array import array
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.questions.compare.measured.layout import COMMENTS, TIME_UNITS, Column, Layout, Line, find_layout, number
from drumsqueal.questions.compare.measured.record import (
    Measured,
    Unit,
    check_count,
    measured_in,
    parse_unit,
    pick_channel,
)
from drumsqueal.questions.compare.measured.sampling import RATE_CURE, Sampling, UnevenError, even_sampling

_SHOWN = 40  # letters of a cell that an error shows
_BLOCK = 2**14  # rows between two looks at Ctrl-C


def read_csv(path: Path, channel: str | None, rate: float | None, unit: Unit | None) -> Measured:
    """Read a column of numbers, sampled as the time column or `rate` (Hz) says.

    The time column is the one of that name or, without one, the first whose numbers increase evenly. What is missing
    is NaN. Raises RequestError for what is no table, for too few rows, for times that are not even, for a file without
    a rate, and for a channel that is not there.
    """
    lines, comments = _lines(path)
    told: list[str] = []
    try:
        layout = find_layout(path, lines, comments)
        table, numbers = _table(path, lines, layout, told)
    except csv.Error as error:  # of a field without end
        longest = max(lines, key=lambda line: len(line[1]))[0]
        raise RequestError(f"{path}: {error}, the longest line is {longest}; mend or remove what is no table") from None
    check_count(path, len(table))
    place, sampling = _sampling(path, layout.columns, table, numbers, rate, told)
    beside = [k for k in range(len(layout.columns)) if k != place]
    others = [k for k in beside if not _is_count(table[:, k])] or beside
    if not others:
        raise RequestError(f"{path}: there is no column beside the time; write one for each signal")
    at = others[pick_channel(path, [layout.columns[k].name for k in others], channel)]
    column = layout.columns[at]
    own = parse_unit(column.unit) if column.unit else None
    if column.unit and own is None and unit is None:
        told.append(f"{column.unit!r} is no unit of a known quantity")
    return measured_in(unit, own, column.name, sampling.rate, sampling.start, table[:, at], told)


def _lines(path: Path) -> tuple[list[Line], list[Line]]:
    """Lines with numbers or names, and comments."""
    content = path.read_bytes()
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = content.decode("utf-16", errors="replace")
    else:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("cp1252", errors="replace")  # in which instruments write µ, ² and dashes
    lines: list[Line] = []
    comments: list[Line] = []
    for k, line in enumerate(text.splitlines(), start=1):
        if line.strip():
            (comments if line.lstrip().startswith(COMMENTS) else lines).append((k, line))
    return lines, comments


def _table(
    path: Path, lines: list[Line], layout: Layout, told: list[str]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Numbers (rows, columns), and the lines that they stand in."""
    rows = lines[layout.first :]
    used, values = len(layout.columns), array("d")
    texts = [line for _, line in rows]
    if layout.separator == " ":
        cells = (line.split() for line in texts)
    else:
        cells = csv.reader(texts, delimiter=layout.separator, skipinitialspace=True)
    for k, row in enumerate(cells):
        if k % _BLOCK == 0:
            stop_if_interrupted()
        try:
            if len(row) != layout.width:
                raise ValueError
            values.extend([number(cell, decimal_comma=layout.decimal_comma) for cell in row[:used]])
        except ValueError as error:
            if k == len(rows) - 1 and k > 1:
                del values[k * used :]
                told.append(f"the last line, {rows[k][0]}, is not whole and left away")
                break
            raise RequestError(f"{path}: line {rows[k][0]}: {_fault(row, layout, error)}") from None
    table = np.frombuffer(values, dtype=np.float64).reshape(-1, used)
    return table, np.array([line for line, _ in rows[: len(table)]])


def _fault(row: list[str], layout: Layout, error: ValueError) -> str:
    if len(row) != layout.width:
        return f"there are {len(row)} columns, where those above have {layout.width}; mend or remove the line"
    for cell in row:
        try:
            number(cell, decimal_comma=layout.decimal_comma)
        except ValueError:
            mark = ", with a comma as the decimal mark" if layout.decimal_comma else ""
            shown = cell if len(cell) <= _SHOWN else f"{cell[:_SHOWN]}…"
            return f"{shown!r} is no number{mark}; mend or remove the line"
    return str(error)


def _sampling(
    path: Path,
    columns: tuple[Column, ...],
    table: NDArray[np.float64],
    lines: NDArray[np.int64],
    rate: float | None,
    told: list[str],
) -> tuple[int | None, Sampling]:
    """The time column, None where there is none, and how it is sampled."""
    named = next((k for k, column in enumerate(columns) if column.is_time), None)
    place = named if named is not None else next((k for k in range(len(columns)) if _may_be_time(table[:, k])), None)
    if rate is not None:
        if place is not None:
            told.append(f"the sample rate is that of --rate, not of the column {columns[place].name!r}")
        return place, Sampling(rate, 0.0, 0.0)
    if place is None:
        raise RequestError(f"{path}: neither a time column nor a sample rate is in it; {RATE_CURE}")
    column = columns[place]
    factor = TIME_UNITS.get(column.unit.lower() or "s")
    if factor is None:
        raise RequestError(f"{path}: {column.unit!r} is no unit of time; write s, ms or µs, or {RATE_CURE}")
    if not column.unit:
        told.append(f"the column {column.name!r} is taken for the time, in s")
    time = table[:, place] * factor
    missing = np.flatnonzero(~np.isfinite(time))
    if missing.size:
        told.append(
            f"{missing.size} times are missing, the first in line {lines[missing[0]]}: taken as even there, too"
        )
    try:
        sampling = even_sampling(time)
    except UnevenError as error:
        raise RequestError(f"{path}: the times are not evenly spaced, {error}; {error.cure}") from None
    return place, sampling


def _is_count(values: NDArray[np.float64]) -> bool:
    """Whether a column is a mere count of the rows."""
    return values.size > 1 and bool(np.all(np.diff(values) == 1.0))


def _may_be_time(values: NDArray[np.float64]) -> bool:
    """Whether a column increases evenly, and is not a mere count of the rows."""
    if not np.all(np.isfinite(values)) or values.size < 2 or _is_count(values):
        return False
    if not np.diff(values).min() > 0:
        return False
    try:
        even_sampling(values)
    except UnevenError:
        return False
    return True
