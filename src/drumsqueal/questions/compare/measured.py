"""A measured file, recognised by what is in it and not by its name, and the part of it that is asked for: WAV, UFF58,
and tables of text."""

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
from drumsqueal.questions.compare.csv_table import TIME_UNITS, name_and_unit, read_csv, seconds
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
