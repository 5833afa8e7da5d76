"""Codes of the universal file format, for what writes it and what reads it.

Source: the definitions of datasets 58 and 164 by SDRC, as kept by the University of Cincinnati.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

TIME_RESPONSE = 1  # type of the function
TIME_AXIS = 17  # specific data type of the abscissa
UNKNOWN, GENERAL = 0, 1  # specific data types that say nothing of the quantity
ROTATIONS = (4, 5, 6)  # directions about x, y, z; 1 to 3 are along them, negative ones against
SI_SYSTEM, USER_DEFINED = 1, 9  # codes of dataset 164


class DataType(NamedTuple):
    """A specific data type: what is measured, and in which SI unit along an axis and about one ("" where it cannot)."""

    quantity: str
    unit: str
    about: str = ""


DATA_TYPES = {
    8: DataType("displacement", "m", "rad"),
    11: DataType("velocity", "m/s", "rad/s"),
    12: DataType("acceleration", "m/s^2", "rad/s^2"),
    9: DataType("force", "N", "N*m"),  # a reaction
    13: DataType("force", "N", "N*m"),  # an excitation
    15: DataType("pressure", "Pa"),
}
_FOOT, _POUND, _KILOGRAM, _POUNDAL = 0.3048, 4.4482216152605, 9.80665, 0.138254954376
SYSTEMS = {
    SI_SYSTEM: (1.0, 1.0),
    2: (_FOOT, _POUND),
    3: (1.0, _KILOGRAM),
    4: (_FOOT, _POUNDAL),
    5: (1e-3, 1e-3),
    6: (1e-2, 1e-2),
    7: (0.0254, _POUND),
    8: (1e-3, _KILOGRAM),
    10: (1e-3, 1.0),
}
"""Metres, and newtons, that the units of length and force are, by the code of dataset 164."""


def type_of(quantity: str) -> int:
    """The first specific data type of a quantity; general for one that has none, and is known by its units alone."""
    return next((code for code, known in DATA_TYPES.items() if known.quantity == quantity), GENERAL)


def units_of(system: Mapping[str, Any]) -> tuple[float, float] | None:
    """Metres, and newtons, that the units of a dataset 164 are; None where it does not say."""
    code = int(system.get("units_code", 0))
    if code == USER_DEFINED and system["length"] > 0 and system["force"] > 0:
        return 1.0 / system["length"], 1.0 / system["force"]
    return SYSTEMS.get(code)
