"""A measured file, recognised by what is in it and not by its name, and the part of it that is asked for."""

import re
from pathlib import Path

import numpy as np

from drumsqueal.errors import RequestError
from drumsqueal.findings.time_window import time_window
from drumsqueal.ordinary import decoded, open_ordinary
from drumsqueal.questions.compare.measured.csv_table import read_csv
from drumsqueal.questions.compare.measured.record import FEWEST, Asked, Measured, check_count, known_units, parse_unit
from drumsqueal.questions.compare.measured.wav import read_wav

FORMATS = "CSV, UFF58 and WAV are read"
SMALLEST, LARGEST = 1e-100, 1e100  # in any unit: beyond, squares are no numbers any more
_MOST_BYTES = 2**32
_START = 4096  # bytes, by which a format is recognised
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
    with open_ordinary(path, _MOST_BYTES) as file:
        start = file.read(_START)
    if not start.strip():
        raise RequestError(f"{path}: the file is empty")
    if start[:4] in (b"RIFF", b"RIFX", b"RF64") and start[8:12] == b"WAVE":
        return read_wav(asked)
    if re.match(r"[\r\n]*    -1\s", decoded(start)):
        from drumsqueal.questions.compare.measured.uff58 import read_uff58

        return read_uff58(asked)
    kind = next((kind for mark, kind in _OTHERS.items() if start.startswith(mark)), None)
    if kind is None and b"\0" in start and not start.startswith((b"\xff\xfe", b"\xfe\xff")):
        kind = "a binary file of an unknown format"
    if kind is not None:
        raise RequestError(f"{path}: this is {kind}; {FORMATS}")
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
