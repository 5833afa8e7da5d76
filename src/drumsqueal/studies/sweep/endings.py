"""Which transients of a sweep squeal at their end, from the scene's own start."""

import numpy as np
import xarray
from numpy.typing import NDArray

from drumsqueal.comparison.decay import BEYOND
from drumsqueal.files.sweep import TRENDS


def squealing(sweep: xarray.Dataset) -> NDArray[np.bool_]:
    """At which points the motion has settled or still grows; below the edges only where a mode grows.

    What changes by less than a tenth below the edges while all modes decay, decays slowly.
    """
    return _is(sweep, "settled", "grows") & ~(_below(sweep) & (sweep["squeal"].values == 0))


def undecided(sweep: xarray.Dataset) -> NDArray[np.bool_]:
    """At which points the motion falls but is beyond the edges still, where it may go on or decay."""
    return _is(sweep, "decays") & ~_below(sweep)


def _is(sweep: xarray.Dataset, *trends: str) -> NDArray[np.bool_]:
    return np.isin(sweep["trend"].values, [TRENDS.index(trend) for trend in trends])


def _below(sweep: xarray.Dataset) -> NDArray[np.bool_]:
    return np.maximum(sweep["separation_share"].values, sweep["reversal_share"].values) < BEYOND
