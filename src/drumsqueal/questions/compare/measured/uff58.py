"""UFF58 files, ASCII and binary, through pyuff: time records at nodes, and the units of data set 164."""

import contextlib
import io
from pathlib import Path
from typing import Any

import numpy as np

from drumsqueal.errors import RequestError, missing_extra
from drumsqueal.files.universal import (
    DATA_TYPES,
    GENERAL,
    ROTATIONS,
    TIME_AXIS,
    TIME_RESPONSE,
    UNKNOWN,
    units_of,
)
from drumsqueal.questions.compare.measured.record import Asked, Measured, Unit, parse_unit
from drumsqueal.questions.compare.measured.sampling import RATE_CURE, Sampling, UnevenError, even_sampling

COMPLEX = (5, 6)  # types of the numbers
_MARK = b"    -1"  # begins and ends a data set


def read_uff58(asked: Asked) -> Measured:
    """Read a time record of a UFF58 file: the only one, or the one of that name or number among its data sets 58.

    Raises RequestError for spectra and other data sets, for times that are not even, and for a file cut short.
    """
    path, remarks = asked.path, []
    records, system = _data_sets(path)
    names = [_name(record, number) for number, record in enumerate(records, start=1)]
    at = asked.pick(names)
    record = records[at]
    values, axis = np.asarray(record["data"]), record.get("abscissa_spec_data_type")
    over_time = axis == TIME_AXIS or (axis in (UNKNOWN, GENERAL) and record.get("func_type") == TIME_RESPONSE)
    if record["ord_data_type"] in COMPLEX or not over_time:
        kind = "complex" if record["ord_data_type"] in COMPLEX else "not over time"
        raise RequestError(f"{path}: data set {names[at]!r} is {kind}; export the time record that it was made from")
    count = record["num_pts"]
    if values.size < count:
        raise RequestError(f"{path}: {names[at]!r} holds {values.size} of its {count} samples; it is cut short")
    values = np.asarray(values[:count], dtype=np.float64)  # binary ones may have a line break behind
    if asked.rate is not None:
        remarks.append("the sample rate is that of --rate, not the file's own")
        sampling = Sampling(asked.rate, 0.0)
    else:
        sampling = _sampling(path, record)
    # Where a unit is given, what is to be said of the file's own is that it is another.
    own = _unit(record, system, [] if asked.unit else remarks)
    return asked.measured(names[at], own, sampling, values, remarks)


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


def _sampling(path: Path, record: dict[str, Any]) -> Sampling:
    interval = float(record["abscissa_inc"])
    if record["abscissa_spacing"] == 1:
        if not (np.isfinite(interval) and interval > 0):
            raise RequestError(f"{path}: the data set states an interval of {interval:g} s; {RATE_CURE}")
        return Sampling(1.0 / interval, float(record["abscissa_min"]))
    try:
        return even_sampling(np.asarray(record["x"], dtype=np.float64)[: record["num_pts"]])
    except UnevenError as error:
        raise RequestError(f"{path}: not evenly sampled, {error}") from None


def _unit(record: dict[str, Any], system: dict[str, Any] | None, remarks: list[str]) -> Unit | None:
    """The unit by the data type with data set 164, and by the label; None where they disagree or say nothing."""
    label = str(record.get("ordinate_axis_units_lab", "")).strip()
    label = "" if label.upper() == "NONE" else label
    written, by_type = parse_unit(label), _by_type(record, system)
    if written is not None and by_type is not None and not written.same_as(by_type):
        remarks.append(
            f"its label states {label}, data set 164 another unit: the unit is not known; give it with --unit"
        )
        return None
    if label and written is None and by_type is None:
        remarks.append(f"the unit {label!r} is not known")
    return by_type or written


def _by_type(record: dict[str, Any], system: dict[str, Any] | None) -> Unit | None:
    known = DATA_TYPES.get(int(record.get("ordinate_spec_data_type", UNKNOWN)))
    if known is None or system is None:
        return None
    units = units_of(system)
    if units is None:
        return None
    length, force = units
    if known.about and abs(int(record.get("rsp_dir", 0))) in ROTATIONS:  # angles are in radians in every system
        si, factor = known.about, force * length if known.quantity == "force" else 1.0
    else:
        si = known.unit
        factor = {"force": force, "pressure": force / length**2}.get(known.quantity, length)
    return Unit(si, factor, si if factor == 1 else f"{factor:.6g} {si}")
