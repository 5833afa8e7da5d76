"""CSV files as programs of all countries write them: any separator, decimal comma, lines of names and units.

The numbers are read by pandas. How the file is laid out is found here: pandas asks for it, or takes it from one line.
"""

import io
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.questions.compare.measured.layout import (
    COMMENTS,
    MISSING,
    TIME_UNITS,
    Column,
    Layout,
    Line,
    fault,
    find_layout,
)
from drumsqueal.questions.compare.measured.record import (
    Measured,
    Unit,
    check_count,
    measured_in,
    parse_unit,
    pick_channel,
)
from drumsqueal.questions.compare.measured.sampling import RATE_CURE, Sampling, UnevenError, even_sampling

_MISSING = [form(word) for word in MISSING for form in (str, str.upper, str.capitalize)]


def read_csv(path: Path, channel: str | None, rate: float | None, unit: Unit | None) -> Measured:
    """Read a column of numbers, sampled as the time column or `rate` (Hz) says.

    The time column is the one of that name or, without one, the first whose numbers increase evenly. What is missing
    is NaN. Raises RequestError for what is no table, for too few rows, for times that are not even, for a file without
    a rate, and for a channel that is not there.
    """
    lines, comments = _lines(path)
    remarks: list[str] = []
    layout = find_layout(path, lines, comments)
    table, numbers = _table(path, lines, layout, remarks)
    check_count(path, len(table))
    place, sampling = _sampling(path, layout.columns, table, numbers, rate, remarks)
    beside = [k for k in range(len(layout.columns)) if k != place]
    others = [k for k in beside if not _is_count(table[:, k])] or beside
    if not others:
        raise RequestError(f"{path}: there is no column beside the time; write one for each signal")
    at = others[pick_channel(path, [layout.columns[k].name for k in others], channel)]
    column = layout.columns[at]
    own = parse_unit(column.unit) if column.unit else None
    if column.unit and own is None and unit is None:
        remarks.append(f"{column.unit!r} is no unit of a known quantity")
    return measured_in(unit, own, column.name, sampling.rate, sampling.start, table[:, at], remarks)


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


def _table(path: Path, lines: list[Line], layout: Layout, remarks: list[str]) -> tuple[NDArray[np.float64], list[int]]:
    """Numbers (rows, columns), and the lines that they stand in."""
    import pandas

    rows, used = lines[layout.first :], len(layout.columns)
    if len(rows) > 2 and fault(rows[-1][1], layout):
        remarks.append(f"the last line, {rows[-1][0]}, is not whole and left away")
        rows = rows[:-1]
    text = re.sub(rf" +(?=[{layout.separator}\n])", "", "\n".join(line for _, line in rows))
    try:
        table = pandas.read_csv(
            io.StringIO(text),
            sep=r"\s+" if layout.separator == " " else layout.separator,
            decimal="," if layout.decimal_comma else ".",
            header=None,
            names=range(layout.width),
            index_col=False,
            dtype=np.float64,
            na_values=_MISSING,
            skipinitialspace=True,
        ).to_numpy()[:, :used]
    except ValueError:  # which does not say where: every line is looked at
        table = np.full((len(rows), used), np.nan)
    for k in np.flatnonzero(np.isnan(table).any(axis=1)):  # pandas fills up lines that are too short
        if wrong := fault(rows[k][1], layout):
            raise RequestError(f"{path}: line {rows[k][0]}: {wrong}; mend or remove the line")
    return table, [line for line, _ in rows]


def _sampling(
    path: Path,
    columns: tuple[Column, ...],
    table: NDArray[np.float64],
    lines: list[int],
    rate: float | None,
    remarks: list[str],
) -> tuple[int | None, Sampling]:
    """The time column, None where there is none, and how it is sampled."""
    named = next((k for k, column in enumerate(columns) if column.is_time), None)
    place = named if named is not None else next((k for k in range(len(columns)) if _may_be_time(table[:, k])), None)
    if rate is not None:
        if place is not None:
            remarks.append(f"the sample rate is that of --rate, not of the column {columns[place].name!r}")
        return place, Sampling(rate, 0.0, 0.0)
    if place is None:
        raise RequestError(f"{path}: neither a time column nor a sample rate is in it; {RATE_CURE}")
    column = columns[place]
    factor = TIME_UNITS.get(column.unit.lower() or "s")
    if factor is None:
        raise RequestError(f"{path}: {column.unit!r} is no unit of time; write s, ms or µs, or {RATE_CURE}")
    if not column.unit:
        remarks.append(f"the column {column.name!r} is taken for the time, in s")
    time = table[:, place] * factor
    missing = np.flatnonzero(~np.isfinite(time))
    if missing.size:
        remarks.append(
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
    try:
        even_sampling(values)
    except UnevenError:
        return False
    return bool(np.isfinite(values).all()) and not _is_count(values)
