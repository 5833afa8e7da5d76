"""UFF58 files, ASCII and binary: time records at nodes, and the units of data set 164."""

import re
from pathlib import Path
from typing import Any

import numpy as np

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
from drumsqueal.questions.compare.measured.csv_table import TIME_UNITS, name_and_unit, seconds
from drumsqueal.questions.compare.measured.record import (
    RATE_CURE,
    Asked,
    Measured,
    Sampling,
    UnevenError,
    Unit,
    even_sampling,
    parse_unit,
)


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
