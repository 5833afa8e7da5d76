"""The probability of squeal where numbers are uncertain, and which of them decide."""

import numpy as np
import xarray
from numpy.typing import ArrayLike

from drumsqueal.findings.schema import Finding
from drumsqueal.scene import COORDINATES

LEVEL = 0.95  # of the intervals
_NORMAL = 1.96  # deviations that enclose it
FEWEST = 4  # samples for a correlation


class Chance(Finding):
    """So many of all samples: their fraction, and Wilson's interval of 95 % for the probability.

    (p + z²/2n ± z √(p(1 − p)/n + z²/4n²))/(1 + z²/n), z = 1.96. Wilson, J. Am. Stat. Assoc. 22 (1927) 209.
    """

    count: int
    total: int
    share: float
    low: float
    high: float


class ChanceStudy(Finding):
    """The probability of squeal, that of each mode by its coordinate, and what the growth rate depends on.

    `correlations` has, for each number, Spearman's rank correlation with the largest growth rate: +1 where this only
    rises with it, −1 where it only falls; None where one of the two never changes. Below `noise` in size, 95 % of the
    correlations of numbers that do not matter lie. `left_out` samples have no eigenvalues; the probabilities are of the
    others.
    """

    squeal: Chance
    modes: dict[str, Chance]
    correlations: dict[str, float | None]
    noise: float
    left_out: int


def chance(count: int, total: int) -> Chance:
    """The probability of what happened so many times; raises ValueError without samples."""
    from scipy.stats import binomtest

    interval = binomtest(count, total).proportion_ci(LEVEL, "wilson")
    low, high = float(interval.low), float(interval.high)
    return Chance(count=count, total=total, share=count / total, low=low, high=high)


def study_chance(sweep: xarray.Dataset) -> ChanceStudy | None:
    """Count squeal in the samples of a random sweep; None where none has eigenvalues."""
    known = sweep["squeal"].values >= 0
    total = int(known.sum())
    if total == 0:
        return None
    squeal, growth = sweep["squeal"].values[known], sweep["largest_growth_rate"].values[known]
    unstable, which = (sweep[name].values[known] for name in ("unstable", "mode_coordinate"))
    modes = {}
    for index, name in enumerate(COORDINATES):
        if np.any(which == index):
            modes[name] = chance(int(np.any((unstable == 1) & (which == index), axis=1).sum()), total)
    keys = [str(name) for name, each in sweep.coords.items() if each.dims == ("sample",)]
    correlations = {key: rank_correlation(sweep[key].values[known], growth) for key in keys}
    noise = _NORMAL / np.sqrt(max(total - 1, 1))
    return ChanceStudy(
        squeal=chance(int(squeal.sum()), total),
        modes=modes,
        correlations=correlations,
        noise=float(min(noise, 1.0)),
        left_out=len(known) - total,
    )


def rank_correlation(first: ArrayLike, second: ArrayLike) -> float | None:
    """Spearman's rank correlation of two samples; None where one never changes, or where there are too few."""
    from scipy.stats import spearmanr

    pairs = np.stack([np.asarray(first, float), np.asarray(second, float)])
    pairs = pairs[:, np.isfinite(pairs).all(axis=0)]
    if pairs.shape[1] < FEWEST or np.any(np.ptp(pairs, axis=1) == 0):
        return None
    return float(spearmanr(*pairs).statistic)  # pyright: ignore[reportAttributeAccessIssue]
