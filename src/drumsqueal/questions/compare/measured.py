"""A measured file, recognised by what is in it and not by its name, and the part of it that is asked for: WAV, UFF58,
and tables of text."""

import csv
import io
import re
import struct
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.files.universal import (
    COMPLEX,
    DATA_TYPES,
    FUNCTION,
    GENERAL,
    ROTATIONS,
    TIME_AXIS,
    TIME_RESPONSE,
    UNITS,
    UNKNOWN,
    read_datasets,
)
from drumsqueal.findings.history import time_window
from drumsqueal.ordinary import decoded, open_ordinary
from drumsqueal.questions.compare.record import (
    FEWEST,
    RATE_CURE,
    Asked,
    Measured,
    Sampling,
    UnevenError,
    Unit,
    check_count,
    even_sampling,
    known_units,
    parse_unit,
)

SMALLEST, LARGEST = 1e-100, 1e100  # in any unit: beyond, squares are no numbers any more
_OTHERS = {
    b"\x89HDF": "an HDF5 or NetCDF file",
    b"CDF": "a NetCDF file",
    b"PK": "a zip archive, as spreadsheets are",
    b"MATLAB": "a MAT file",
    b"\xd0\xcf": "an old spreadsheet",
    b"PAR1": "a Parquet file",
    b"\x93NUMPY": "a NumPy file",
    b"TDSm": "a TDMS file",
}


def read_measured(
    path: Path | str,
    channel: str | None = None,
    *,
    rate: float | None = None,
    unit: str | None = None,
    first: float | None = None,
    last: float | None = None,
) -> Measured:
    """Read one channel of a CSV, UFF58 or WAV file, in SI where its unit is known.

    `channel` is a name or a number from 1 on, and may be left out where there is only one. `rate` (Hz) is that of a
    file which does not say, or says it wrongly. `unit` is what 1 in the file stands for: "mm/s", or "50 mm/s". `first`
    and `last` (s) are the part to take. Raises RequestError for what cannot be read.
    """
    file, own = Path(path), None if unit is None else parse_unit(unit)
    if unit is not None and own is None:
        wrong = f"--unit {unit}: this unit is not known"
        raise RequestError(f'{wrong}; write one such as "mm/s" or, calibrated, "50 mm/s", of {known_units()}')
    try:
        measured = _read(Asked(file, channel, rate, own))
    except (OSError, ValueError) as error:
        if isinstance(error, RequestError):
            raise
        raise RequestError(f"{file}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    return _whole(file, _windowed(file, measured, first, last))


def _read(asked: Asked) -> Measured:
    path = asked.path
    if path.is_dir():
        raise RequestError(f"{path} is a folder; name the measured file in it")
    if not path.exists():
        raise RequestError(f"{path}: there is no such file")
    with open_ordinary(path, 2**32) as file:
        start = file.read(4096)  # by which a format is recognised
    if not start.strip():
        raise RequestError(f"{path}: the file is empty")
    if start[:4] in (b"RIFF", b"RIFX", b"RF64") and start[8:12] == b"WAVE":
        return read_wav(asked)
    if re.match(r"[\r\n]*    -1\s", decoded(start)):
        return read_uff58(asked)
    kind = next((kind for mark, kind in _OTHERS.items() if start.startswith(mark)), None)
    if kind is None and b"\0" in start and not start.startswith((b"\xff\xfe", b"\xfe\xff")):
        kind = "a binary file of an unknown format"
    if kind is not None:
        raise RequestError(f"{path}: this is {kind}; CSV, UFF58 and WAV are read")
    return read_csv(asked)


def _windowed(path: Path, measured: Measured, first: float | None, last: float | None) -> Measured:
    """The part from `first` to `last` (s), both ends in it, with samples enough."""
    rate, start, count = measured.sample_rate, measured.start_s, measured.values.size
    end = start + (count - 1) / rate
    check_count(path, count)
    since, until = time_window(str(path), (start, end), 1 / rate, first, last)
    # A thousandth of an interval: a time that was rounded still names its sample.
    begin = int(np.clip(np.ceil((since - start) * rate - 1e-3), 0, count))
    stop = int(np.clip(np.floor((until - start) * rate + 1e-3) + 1, begin, count))
    if stop - begin < FEWEST:
        fault = f"{path}: {since:.9g} to {until:.9g} s hold {stop - begin} samples, at least {FEWEST} are needed"
        raise RequestError(f"{fault}; take a longer part of {start:.9g} to {end:.9g} s with --from and --until")
    return measured._replace(values=measured.values[begin:stop], start_s=start + begin / rate)


def _whole(path: Path, measured: Measured) -> Measured:
    """The longest stretch in which nothing is missing, with samples enough, not at rest and of a size to be squared."""
    values, remarks, finite = measured.values, measured.remarks, np.isfinite(measured.values)
    stretches = np.ma.clump_unmasked(np.ma.masked_invalid(values))
    part = max(stretches, key=lambda part: part.stop - part.start, default=slice(0, 0))
    count, start = part.stop - part.start, measured.start_s + part.start / measured.sample_rate
    if not finite.all():
        when = measured.start_s + int(np.argmin(finite)) / measured.sample_rate
        missing = f"{np.sum(~finite)} of {values.size} samples are missing, the first at {when:.6g} s"
        if count < FEWEST:
            raise RequestError(f"{path}: {missing}; at least {FEWEST} without a gap are needed")
        remarks += (f"{missing}: the longest stretch without a gap is taken, {count} samples from {start:.6g} s on",)
    largest = float(np.abs(values[part]).max())
    if not largest < LARGEST or 0 < largest <= SMALLEST:
        size = f"{largest:.3g} {measured.unit or 'without a unit'} at the most"
        fault = f"{measured.name!r} is {size}, which is implausible"
        raise RequestError(f"{path}: {fault}; take another channel, or correct the file or --unit")
    if not np.ptp(values[part]) > 0:
        raise RequestError(f"{path}: {measured.name!r} is constant there and has no lines; take another channel")
    return measured._replace(values=values[part], start_s=start, remarks=remarks)


# WAV files; those of a stream, which states no sizes, to the end of the file.


_UNREAD = "this WAV file is damaged, or of a kind that is not read (%s); PCM and floating point are"
_PCM, _FLOAT, _EXTENSIBLE = 1, 3, 0xFFFE  # kinds of samples; the last says further on which of the others


class _Wav(NamedTuple):
    """Where the samples of a WAV file begin, in which order of bytes, and of what kind they are.

    `frame` bytes hold a sample of all channels. `size` is that of all samples (bytes), and `stated` what the file says.
    """

    order: str
    kind: int
    channels: int
    rate: int
    frame: int
    at: int
    size: int
    stated: int

    def channel(self, content: NDArray[np.uint8], k: int) -> NDArray[np.float64]:
        """Samples of channel k, as fractions of full scale."""
        width, count = self.frame // self.channels, self.size // self.frame
        samples = content[self.at : self.at + count * self.frame].reshape(count, self.frame)
        samples = samples[:, k * width : (k + 1) * width]
        if self.kind == _FLOAT:
            return np.ascontiguousarray(samples).view(f"{self.order}f{width}")[:, 0].astype(np.float64)
        if width == 1:
            return (samples[:, 0].astype(np.float64) - 128.0) / 128.0
        whole = np.zeros((count, 8), np.uint8)  # any number of bytes, as the upper ones of eight
        whole[:, slice(8 - width, None) if self.order == "<" else slice(width)] = samples
        return whole.view(f"{self.order}i8")[:, 0] / 2.0**63


def read_wav(asked: Asked) -> Measured:
    """Read a channel of a WAV file, in full scales without a unit. Raises RequestError for one cut short or damaged."""
    path, content = asked.path, np.memmap(asked.path, np.uint8, "r")
    try:
        wav = _wav_of(path, content.data)
    except struct.error as error:
        raise RequestError(f"{path}: {_UNREAD % error}") from None
    names, remarks = [f"channel {k + 1}" for k in range(wav.channels)], []
    if wav.size != wav.stated:
        piped = f"the file states {wav.stated} bytes of samples, as one written into a pipe"
        remarks.append(f"{piped}: it is read to its end, {wav.size} bytes")
    at = asked.pick(names)
    if asked.rate is not None:
        remarks.append(f"the sample rate is that of --rate, not the {wav.rate} Hz of the file")
    elif not wav.rate > 0:
        raise RequestError(f"{path}: the WAV file states a sample rate of {wav.rate} Hz; give --rate")
    values = wav.channel(content, at)
    clipped = int(np.sum(np.abs(values) >= 1 - 1e-4))  # of full scale; 16 bit reach 1 − 3e-5 upwards
    if wav.kind == _PCM and clipped > 1:
        remarks.append(f"{clipped} samples are at full scale: clipping adds harmonics and combinations of the lines")
    return asked.measured(names[at], None, Sampling(float(asked.rate or wav.rate), 0.0), values, remarks)


def _wav_of(path: Path, content: memoryview) -> _Wav:
    """How a WAV file is laid out. Raises RequestError for one that is cut short or damaged, and struct.error."""
    form = bytes(content[:4])
    order, chunks, at = ">" if form == b"RIFX" else "<", {}, 12
    while at + 8 <= len(content) and b"data" not in chunks:
        name, size = struct.unpack_from(f"{order}4sI", content, at)
        chunks[name] = at + 8, size
        at += 8 + size + size % 2  # chunks begin at even places
    if not {b"fmt ", b"data"} <= chunks.keys():
        raise RequestError(f"{path}: this WAV file is damaged, it lacks a chunk fmt or data; export it again")
    kind, channels, rate, _, frame, bits = struct.unpack_from(f"{order}HHIIHH", content, chunks[b"fmt "][0])
    if kind == _EXTENSIBLE:
        (kind,) = struct.unpack_from(f"{order}H", content, chunks[b"fmt "][0] + 24)
    if kind in (_PCM, _FLOAT) and not (channels and bits and frame >= channels):
        said = f"{channels} channels, {bits} bits a sample and {frame} bytes for one sample of all channels"
        raise RequestError(f"{path}: the header of this WAV file states {said}, which is damaged; export it again")
    if kind not in (_PCM, _FLOAT) or frame // channels not in ((4, 8) if kind == _FLOAT else range(1, 9)):
        raise RequestError(f"{path}: {_UNREAD % f'format {kind}, {bits} bits'}")
    (whole,), (at, stated) = struct.unpack_from(f"{order}I", content, 4), chunks[b"data"]
    if form == b"RF64" and b"ds64" in chunks:
        whole, stated = struct.unpack_from("<QQ", content, chunks[b"ds64"][0])
    size, room = stated, len(content) - at
    # 0x7FFFF000 bytes; the least of the sizes, up to FFFFFFFF, that programs state which do not know them
    if stated >= max(room + 1, 0x7FFFF000) or (stated == 0 and whole + 8 != len(content)):
        size = room - room % frame
    if size > room:
        raise RequestError(f"{path}: the WAV file is cut short; copy it again")
    return _Wav(order, kind, channels, rate, frame, at, size, stated)


# UFF58 files, ASCII and binary: time records at nodes, and the units of data set 164.


def read_uff58(asked: Asked) -> Measured:
    """Read a time record of a UFF58 file: the only one, or the one of that name or number among its data sets 58.

    Raises RequestError for spectra and other data sets, for times that are not even, and for a file cut short.
    """
    path, remarks = asked.path, []
    sets = read_datasets(path, (FUNCTION,))
    records = [each for each in sets if each["type"] == FUNCTION]
    if not records:
        found = f", but {', '.join(map(str, sorted({each['type'] for each in sets})))}" if sets else ""
        raise RequestError(f"{path}: there is no data set 58 (a function at a node) in it{found}; export time records")
    names = [_name(record, number) for number, record in enumerate(records, start=1)]
    at = asked.pick(names)
    record = records[at]
    axis = record.get("abscissa_spec_data_type")
    over_time = axis == TIME_AXIS or (axis in (UNKNOWN, GENERAL) and record.get("func_type") == TIME_RESPONSE)
    if record["ord_data_type"] in COMPLEX or not over_time:
        kind = "complex" if record["ord_data_type"] in COMPLEX else "not over time"
        raise RequestError(f"{path}: data set {names[at]!r} is {kind}; export the time record that it was made from")
    values, count = np.asarray(record["data"]), record["num_pts"]
    if values.size < count:
        raise RequestError(f"{path}: {names[at]!r} holds {values.size} of its {count} samples; it is cut short")
    if np.any(values[count:]) and not record["binary"]:  # the last line may be filled up with zeros
        remarks.append(f"it states {count} samples and holds {values.size}: those beyond are left out")
    values = np.asarray(values[:count], dtype=np.float64)  # binary ones may have a line break behind
    if asked.rate is not None:
        remarks.append("the sample rate is that of --rate, not the file's own")
        sampling = Sampling(asked.rate, 0.0)
    else:
        sampling = _sampling(path, record, _seconds(path, record))
    # Where a unit is given, what is to be said of the file's own is that it is another.
    own = _unit(record, [] if asked.unit else remarks)
    if own is None and not remarks and not record["units"] and any(each["type"] == UNITS for each in sets):
        remarks.append("no data set 164 before it states its units: its unit is not known; give it with --unit")
    return asked.measured(names[at], own, sampling, values, remarks)


def _name(record: dict[str, Any], number: int) -> str:
    """What the file calls a data set, or its node and direction."""
    if name := _label(record, "id1"):
        return name
    return f"node {record.get('rsp_node')} direction {record.get('rsp_dir')}" if "rsp_node" in record else f"{number}"


def _label(record: dict[str, Any], key: str) -> str:
    label = str(record.get(key, "")).strip()
    return "" if label.upper() == "NONE" else label


def _seconds(path: Path, record: dict[str, Any]) -> float:
    """Seconds that the unit of the abscissa is, by both of its labels. Raises RequestError where it is not known."""
    label, unit = (_label(record, f"abscissa_axis_{key}") for key in ("lab", "units_lab"))
    word = re.split(r"[\W_]+", label)[-1]
    within = name_and_unit(label)[1] or (word if word.lower() in TIME_UNITS else "")
    if unit and within.lower() not in TIME_UNITS:  # such as "Time (relative)"
        within = ""
    stated = {seconds(path, each) for each in (unit, within) if each}
    if len(stated) > 1:
        raise RequestError(f"{path}: the times are labelled {label!r} and their unit {unit!r}; {RATE_CURE}")
    return stated.pop() if stated else 1.0


def _sampling(path: Path, record: dict[str, Any], unit: float) -> Sampling:
    interval = float(record["abscissa_inc"]) * unit
    if record["abscissa_spacing"] == 1:
        if not (np.isfinite(interval) and interval > 0):
            raise RequestError(f"{path}: the data set states an interval of {interval:g} s; {RATE_CURE}")
        return Sampling(1.0 / interval, float(record["abscissa_min"]) * unit)
    try:
        return even_sampling(np.asarray(record["x"], dtype=np.float64)[: record["num_pts"]] * unit)
    except UnevenError as error:
        raise RequestError(f"{path}: not evenly sampled, {error}") from None


def _unit(record: dict[str, Any], remarks: list[str]) -> Unit | None:
    """The unit by the data type with data set 164, and by the label; None where they disagree or say nothing."""
    label = _label(record, "ordinate_axis_units_lab")
    written, by_type = parse_unit(label), _by_type(record)
    if written is not None and by_type is not None and not written.same_as(by_type):
        remarks.append(
            f"its label states {label}, data set 164 another unit: the unit is not known; give it with --unit"
        )
        return None
    if label and written is None and by_type is None:
        remarks.append(f"the unit {label!r} is not known")
    return by_type or written


def _by_type(record: dict[str, Any]) -> Unit | None:
    known = DATA_TYPES.get(int(record.get("ordinate_spec_data_type", UNKNOWN)))
    if known is None or record["units"] is None:
        return None
    length, force = record["units"]
    if known.about and abs(int(record.get("rsp_dir", 0))) in ROTATIONS:  # angles are in radians in every system
        si, factor = known.about, force * length if known.quantity == "force" else 1.0
    else:
        si = known.unit
        factor = {"force": force, "pressure": force / length**2}.get(known.quantity, length)
    return Unit(si, factor, si if factor == 1 else f"{factor:.6g} {si}")


# CSV files as programs of all countries write them: any separator, decimal comma, lines of names and units. pandas
# reads the numbers; how the file is laid out is found here: pandas asks for it, or takes it from one line.


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
Heading = tuple[str, str]  # what a column is called, and the unit that is written next to it ("" where none is)


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
    place, sampling = _sampling_of_table(asked, layout.columns, table, numbers, remarks)
    signals = [k for k in range(len(layout.columns)) if k != place]
    signals = [k for k in signals if not _is_count(table[:, k])] or signals
    if not signals:
        raise RequestError(f"{asked.path}: there is no column next to the time; write one for each signal")
    at = signals[asked.pick([layout.columns[k][0] for k in signals])]
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


def _sampling_of_table(
    asked: Asked, columns: tuple[Heading, ...], table: NDArray[np.float64], lines: list[int], remarks: list[str]
) -> tuple[int | None, Sampling]:
    """The time column, None where there is none, and how it is sampled."""
    named = (k for k, (name, _) in enumerate(columns) if _is_time(name))
    place = next(named, None)
    if place is None:
        place = next((k for k in range(len(columns)) if _may_be_time(table[:, k])), None)
    if asked.rate is not None:
        if place is not None:
            remarks.append(f"the sample rate is that of --rate, not of the column {columns[place][0]!r}")
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
        columns.append((name or f"column {k + 1}", unit))
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
