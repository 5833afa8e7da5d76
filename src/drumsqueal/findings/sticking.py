"""When the whole lining sticks to the drum, as the samples of a history show."""

import numpy as np
import xarray

from drumsqueal.findings.part import Finding


class Sticking(Finding):
    """Fraction of the time in which the lining sticks, how often it does, and since when (s).

    A spell begins and ends with samples that stick; one of a single sample has no length. `first_s` is when the first
    begins, and `to_the_end_from_s` when one does that lasts to the end of the record; None where there is none.
    """

    share: float
    spells: int
    first_s: float | None
    to_the_end_from_s: float | None


def find_sticking(history: xarray.Dataset) -> Sticking:
    """Read off the signal "sticking"."""
    sticks, time = history["sticking"].values > 0, history["time"].values
    padded = np.concatenate([[False], sticks, [False]])
    first = time[np.flatnonzero(padded[1:-1] & ~padded[:-2])]
    last = time[np.flatnonzero(padded[1:-1] & ~padded[2:])]
    length = float(time[-1] - time[0])
    return Sticking(
        share=float(np.sum(last - first)) / length if length > 0 else 0.0,
        spells=first.size,
        first_s=float(first[0]) if first.size else None,
        to_the_end_from_s=float(first[-1]) if sticks[-1] else None,
    )
