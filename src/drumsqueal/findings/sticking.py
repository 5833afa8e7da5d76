"""When the lining sticks to the drum as a whole, as the samples of a history tell."""

from typing import NamedTuple

import numpy as np
import xarray


class Sticking(NamedTuple):
    """Share of the time in which the lining sticks, and the first and last time (s) of each spell of it.

    A spell begins and ends with samples that stick; one of a single sample has no length. `to_the_end` tells whether
    the last of them lasts to the end of the record.
    """

    share: float
    spells: tuple[tuple[float, float], ...]
    to_the_end: bool


def find_sticking(history: xarray.Dataset) -> Sticking:
    """Read off the signal "sticking"."""
    sticks, time = history["sticking"].values > 0, history["time"].values
    padded = np.concatenate([[False], sticks, [False]])
    first = np.flatnonzero(padded[1:-1] & ~padded[:-2])
    last = np.flatnonzero(padded[1:-1] & ~padded[2:])
    spells = tuple((float(time[a]), float(time[b])) for a, b in zip(first, last, strict=True))
    length = time[-1] - time[0]
    return Sticking(sum(b - a for a, b in spells) / length if length > 0 else 0.0, spells, bool(sticks[-1]))
