"""Which transients of a sweep squeal at their end, from the scene's own start."""

import numpy as np
import xarray
from numpy.typing import NDArray

from drumsqueal.findings.decay import BEYOND
from drumsqueal.questions.sweep.points import TRENDS


def squealing(sweep: xarray.Dataset) -> NDArray[np.bool_]:
    """At which points the motion has settled and lasts: not below the edges while all modes decay.

    What changes by less than a tenth below the edges while all modes decay, decays slowly.
    """
    below = np.maximum(sweep["separation_share"].values, sweep["reversal_share"].values) < BEYOND
    lasts = (sweep["trend"].values == TRENDS.index("settled")) & (sweep["settled"].values == 1)
    return lasts & ~(below & (sweep["squeal"].values == 0))


def undecided(sweep: xarray.Dataset) -> NDArray[np.bool_]:
    """At which points the motion has not settled: it may go on as it is, grow or decay."""
    return sweep["settled"].values == 0
