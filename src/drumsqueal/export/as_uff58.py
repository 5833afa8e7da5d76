"""Universal file format: dataset 164 (units), then a dataset 58 (function at nodal DOF) for each signal.

Source: the definitions of datasets 58 and 164 by SDRC, as kept by the University of Cincinnati. Needs the extra "nvh".
"""

import unicodedata
from pathlib import Path
from typing import Any

import pyuff

from drumsqueal.export.channels import ACCELERATION, DISPLACEMENT, VELOCITY, Channel, Channels
from drumsqueal.interrupts import stop_if_interrupted

# Codes of the specific data type; general, which tells its units by exponents, is for those that have none.
_GENERAL, _TIME = 1, 17
_TYPES = {DISPLACEMENT: 8, VELOCITY: 11, ACCELERATION: 12, "force": 9, "pressure": 15}
EXACT = 1e-9  # of the interval between samples, that six digits may be off without a word
_TIME_RESPONSE, _EVEN = 1, 1
_ID_LINE, _LABEL, _NAME = 80, 20, 10  # columns
_MODES_A_LINE = 3  # of 24 columns and a separator


def write(channels: Channels, path: Path) -> str:
    """Write the units and every signal in ASCII, in double precision. Raises OSError."""
    file = pyuff.UFF(str(path))
    try:
        file.write_sets(_units(), "overwrite")
        for number, channel in enumerate(channels.channels, start=1):
            stop_if_interrupted()
            file.write_sets(_function(channels, channel, number), "add")
    except Exception as error:  # pyuff hides what the disk says in an exception of its own
        if isinstance(error.__context__, OSError):
            raise error.__context__ from None
        raise
    interval = 1 / channels.sample_rate
    if abs(float(f"{interval:.5e}") / interval - 1) < EXACT:
        return ""
    return f"dataset 58 keeps six digits of the interval, {interval:.5e} s; the exact rate is in ID line 3 of each"


def _units() -> dict[str, Any]:
    """Dataset 164. Dividing by its factors gives SI, so for SI they are 1; temperatures do not occur."""
    description = "SI: metre, newton".ljust(_LABEL)
    return pyuff.prepare_164(
        units_code=1,
        units_description=description,
        temp_mode=1,
        length=1.0,
        force=1.0,
        temp=1.0,
        temp_offset=273.15,
    )


def _function(channels: Channels, channel: Channel, number: int) -> dict[str, Any]:
    """Dataset 58 of one signal; `number` is its version number, which tells functions at one point apart."""
    rate = f"sample rate {channels.sample_rate!r} Hz from {channels.start!r} s; {channels.texts['source']}"
    lines = [channels.prediction[k : k + _MODES_A_LINE] for k in (0, _MODES_A_LINE)]
    modes = ["; ".join(line) for line in lines]
    # Exponents count where the type is general, and for what has no direction; elsewhere the type says all.
    length, force = (0, 0) if channel.direction else channel.length_force
    return pyuff.prepare_58(
        binary=0,
        id1=_fitted(f"{channel.name}: {channel.meaning}", _ID_LINE),
        id2=_fitted(f"{channels.texts['title']}; {channels.texts['outcome']}", _ID_LINE),
        id3=_fitted(rate, _ID_LINE),
        id4=_fitted(modes[0], _ID_LINE),
        id5=_fitted(modes[1], _ID_LINE),
        func_type=_TIME_RESPONSE,
        ver_num=number,
        load_case_id=0,
        rsp_ent_name=channel.short_name.ljust(_NAME),
        rsp_node=channel.point,
        rsp_dir=channel.direction,
        ref_ent_name="NONE".ljust(_NAME),
        ref_node=0,
        ref_dir=0,
        abscissa_spacing=_EVEN,
        z_axis_value=0.0,
        abscissa_spec_data_type=_TIME,
        abscissa_axis_units_lab="s",
        ordinate_spec_data_type=_TYPES.get(channel.quantity, _GENERAL),
        ordinate_len_unit_exp=length,
        ordinate_force_unit_exp=force,
        ordinate_axis_units_lab=_fitted(channel.units, _LABEL),
        orddenom_spec_data_type=0,
        z_axis_spec_data_type=0,
        data=channel.values,
        x=channels.time,
    ) | {"abscissa_axis_lab": "time", "ordinate_axis_lab": _fitted(channel.short_name, _LABEL)}


def _fitted(text: str, columns: int) -> str:
    """Text in ASCII, for columns are counted in bytes, in so many of them; NONE for none, as the format asks."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    return "".join(letter if letter.isprintable() else " " for letter in plain)[:columns].strip() or "NONE"
