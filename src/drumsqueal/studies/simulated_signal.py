"""stand-in until export is merged."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from drumsqueal.files.saved_history import SavedHistory

DEFAULT = "surface_velocity"


def simulated_signal(saved: SavedHistory, name: str, part: slice) -> tuple[NDArray[np.float64], str]:
    """Values and unit."""
    kind, _, coordinate = name.partition("_")
    data: Any = saved.data.isel(time=part)
    if name == DEFAULT:
        return data["velocity"].sel(coordinate="X").values, "m/s"
    rotation = coordinate.startswith("T")
    unit = {"displacement": ("m", "rad"), "velocity": ("m/s", "rad/s")}[kind][rotation]
    return data[kind].sel(coordinate=coordinate).values, unit
