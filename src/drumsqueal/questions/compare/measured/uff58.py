"""UFF58 files, ASCII and binary, through pyuff: time records at nodes, and the units of data set 164."""

import contextlib
import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError, missing_extra
from drumsqueal.files.universal import (
    DATA_TYPES,
    GENERAL,
    ROTATIONS,
    SYSTEMS,
    TIME_AXIS,
    TIME_RESPONSE,
    UNKNOWN,
    USER_DEFINED,
)
from drumsqueal.questions.compare.measured.record import Measured, Unit, measured_in, parse_unit, pick_channel
from drumsqueal.questions.compare.measured.sampling import Sampling, UnevenError, even_sampling

COMPLEX = (5, 6)  # types of the numbers
_MARK = b"    -1"  # begins and ends a data set


def read_uff58(path: Path, channel: str | None, rate: float | None, unit: Unit | None) -> Measured:
    """Read a time record of a UFF58 file: the only one, or the one of that name or number among its data sets 58.

    Raises RequestError for spectra and other data sets, for times that are not even, and for a file cut short.
    """
    records, system = _data_sets(path)
    names = [_name(record, number) for number, record in enumerate(records, start=1)]
    at = pick_channel(path, names, channel)
    record, remarks = records[at], []
    values = np.asarray(record["data"])
    if record["ord_data_type"] in COMPLEX or not _over_time(record):
        kind = "complex" if record["ord_data_type"] in COMPLEX else "not over time"
        raise RequestError(f"{path}: data set {names[at]!r} is {kind}; export the time record that it was made from")
    if values.size < record["num_pts"]:
        raise RequestError(f"{path}: {names[at]!r} holds {values.size} of its {record['num_pts']} samples; it is cut")
    values = np.asarray(values[: record["num_pts"]], dtype=np.float64)  # binary ones may have a line break behind
    sampling = _sampling(path, record, rate, remarks)
    # Where a unit is given, what is to be said of the file's own is that it is another.
    own = _unit(record, system, [] if unit else remarks)
    return measured_in(unit, own, names[at], sampling.rate, sampling.start, values, remarks)


def _data_sets(path: Path) -> tuple[list[dict[str, Any]], dict[str, Any] | None]:
    """Every data set 58 in the order of the file, and the units of the file."""
    try:
        import pyuff
    except ImportError:
        raise missing_extra(f"{path}: to read UFF58", "nvh") from None
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # pyuff prints what it makes of odd ones
            file: Any = pyuff.UFF(str(path))
            kinds = [int(kind) for kind in file.get_set_types()] if file.get_n_sets() else []
            records = [file.read_sets(k) for k, kind in enumerate(kinds) if kind == 58]
            units = [file.read_sets(k) for k, kind in enumerate(kinds) if kind == 164]
    except Exception:  # pyuff raises plain Exception
        raise RequestError(f"{path}: the UFF file is damaged or cut short; export it again") from None
    if not path.read_bytes().rstrip().endswith(_MARK):  # pyuff passes over the last data set then
        raise RequestError(f"{path}: the UFF file is cut short; copy it again")
    if not records:
        found = f", but {', '.join(map(str, sorted(set(kinds))))}" if kinds else ""
        raise RequestError(f"{path}: there is no data set 58 (a function at a node) in it{found}; export time records")
    return records, units[-1] if units else None


def _name(record: dict[str, Any], number: int) -> str:
    """What the file calls a data set, or its node and direction."""
    name = str(record.get("id1", "")).strip()
    if name and name.upper() != "NONE":
        return name
    return f"node {record.get('rsp_node')} direction {record.get('rsp_dir')}" if "rsp_node" in record else f"{number}"


def _over_time(record: dict[str, Any]) -> bool:
    axis = record.get("abscissa_spec_data_type")
    return axis == TIME_AXIS or (axis in (UNKNOWN, GENERAL) and record.get("func_type") == TIME_RESPONSE)


def _sampling(path: Path, record: dict[str, Any], rate: float | None, remarks: list[str]) -> Sampling:
    if rate is not None:
        remarks.append("the sample rate is that of --rate, not the file's own")
        return Sampling(rate, 0.0, 0.0)
    interval = float(record["abscissa_inc"])
    if record["abscissa_spacing"] == 1:
        if not (np.isfinite(interval) and interval > 0):
            raise RequestError(f'{path}: the data set says an interval of {interval:g} s; give --rate "51.2 kHz"')
        return Sampling(1.0 / interval, float(record["abscissa_min"]), 0.0)
    try:
        return even_sampling(_times(record))
    except UnevenError as error:
        raise RequestError(f"{path}: not evenly sampled, {error}; {error.cure}") from None


def _times(record: dict[str, Any]) -> NDArray[np.float64]:
    return np.asarray(record["x"], dtype=np.float64)[: record["num_pts"]]


def _unit(record: dict[str, Any], system: dict[str, Any] | None, remarks: list[str]) -> Unit | None:
    """The unit by the data type with data set 164, and by the label; None where they disagree or say nothing."""
    label = str(record.get("ordinate_axis_units_lab", "")).strip()
    written = parse_unit(label) if label and label.upper() != "NONE" else None
    by_type = _by_type(record, system)
    if written is not None and by_type is not None:
        if not written.same_as(by_type):
            remarks.append(f"its label says {label}, data set 164 another unit: taken as unknown; --unit would say")
            return None
        return by_type
    if written is None and by_type is None and label and label.upper() != "NONE":
        remarks.append(f"{label!r} is no unit of a known quantity")
    return written or by_type


def _by_type(record: dict[str, Any], system: dict[str, Any] | None) -> Unit | None:
    known = DATA_TYPES.get(int(record.get("ordinate_spec_data_type", UNKNOWN)))
    if known is None or system is None:
        return None
    code = int(system.get("units_code", 0))
    if code == USER_DEFINED and system["length"] > 0 and system["force"] > 0:
        length, force = 1.0 / system["length"], 1.0 / system["force"]
    elif code in SYSTEMS:
        length, force = SYSTEMS[code]
    else:
        return None
    if known.about and abs(int(record.get("rsp_dir", 0))) in ROTATIONS:  # angles are in radians in every system
        si, factor = known.about, force * length if known.quantity == "force" else 1.0
    else:
        si = known.unit
        factor = {"force": force, "pressure": force / length**2}.get(known.quantity, length)
    return Unit(si, factor, si if factor == 1 else f"{factor:.6g} {si}")
