"""Which lines of a spectrum are harmonics of another one."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Of the resolution, that a harmonic may lie off the multiple; lines that stand out of the noise are known better.
OFF = 0.5
# Resolutions that a fundamental has at least: of a slower one 2 OFF/FEWEST of all frequencies, 5 %, would be harmonics.
FEWEST = 20.0
FAINTEST = 0.1  # of a harmonic's amplitude, that a fundamental has at least: hum of 50 Hz has multiples everywhere


class Harmonic(NamedTuple):
    """Which multiple of which line (an index) a line is."""

    order: int
    fundamental: int


def find_harmonics(
    frequency_Hz: NDArray[np.float64], amplitude: NDArray[np.float64], resolution_Hz: float
) -> list[Harmonic | None]:
    """The fundamental of every line of frequency f whose n-fold it is, |f − n f₁| ≤ Δf/2 with n ≥ 2; None for others.

    A fundamental is no harmonic itself, at least 20 resolutions Δf high and not 20 dB fainter than the harmonic; of
    several it is the strongest.
    """
    found: list[Harmonic | None] = [None] * frequency_Hz.size
    fundamentals: list[int] = []
    for k in np.argsort(frequency_Hz, kind="stable").tolist():
        f = frequency_Hz[k]
        near = []
        for j in fundamentals:
            order = round(float(f / frequency_Hz[j]))
            if order > 1 and amplitude[j] >= FAINTEST * amplitude[k]:
                near += [Harmonic(order, j)] if abs(f - order * frequency_Hz[j]) <= OFF * resolution_Hz else []
        if near:
            found[k] = max(near, key=lambda each: amplitude[each.fundamental])
        elif f >= FEWEST * resolution_Hz:
            fundamentals.append(k)
    return found
