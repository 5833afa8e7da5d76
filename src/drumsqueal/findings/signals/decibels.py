"""Levels in decibels, of rms values over the reference values of ISO 1683."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

STANDARD = "ISO 1683"


class LevelReference(NamedTuple):
    """The rms value of 0 dB in the SI unit, as an amount with its unit, and the standard that it is from, if any."""

    rms: float
    amount: str
    standard: str = ""

    @property
    def written(self) -> str:
        """Amount and standard."""
        return f"{self.amount} ({self.standard})" if self.standard else self.amount


# Source: ISO 1683:2015, Acoustics — Preferred reference values for acoustical and vibratory levels; for sound in air.
_STANDARD = {
    "m": LevelReference(1e-12, "1 pm", STANDARD),
    "m/s": LevelReference(1e-9, "1 nm/s", STANDARD),
    "m/s^2": LevelReference(1e-6, "1 µm/s²", STANDARD),
    "Pa": LevelReference(2e-5, "20 µPa", STANDARD),
    "N": LevelReference(1e-6, "1 µN", STANDARD),
}


def level_reference(unit: str) -> LevelReference:
    """The reference of levels in an SI unit: that of ISO 1683, and 1 of the unit for what it does not name."""
    return _STANDARD.get(unit, LevelReference(1.0, f"1 {unit}"))


def level_dB(amplitude: NDArray[np.float64] | float, rms_of_0_dB: float) -> NDArray[np.float64]:
    """The level L = 20 lg(A / (√2 r)) of sines of amplitude A, r the rms value of 0 dB; −240 dB at the least."""
    return 20 * np.log10(np.maximum(np.asarray(amplitude) / (np.sqrt(2) * rms_of_0_dB), 1e-12))
