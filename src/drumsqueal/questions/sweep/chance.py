"""How likely something is of which samples are known: a fraction, and the interval that holds the probability."""

import math

from drumsqueal.findings.part import Finding, Number

LEVEL = 0.95  # of the intervals


class Chance(Finding):
    """So many of all samples: their fraction, and Wilson's interval of 95 % for the probability.

    (p + z²/2n ± z √(p(1 − p)/n + z²/4n²))/(1 + z²/n), z = 1.96; NaN for what is no sample.
    Wilson, J. Am. Stat. Assoc. 22 (1927) 209.
    """

    count: int
    total: int
    share: Number
    low: Number
    high: Number

    @property
    def percent(self) -> str:
        """The fraction in words."""
        return "none known" if not self.total else f"{100 * self.share:.3g} %"

    @property
    def in_words(self) -> str:
        """The fraction and its interval."""
        return self.percent if math.isnan(self.low) else f"{self.percent} ({self.interval} at 95 %)"

    @property
    def interval(self) -> str:
        """The interval in words."""
        return f"{100 * self.low:.3g} to {100 * self.high:.3g} %"


def chance(count: int, total: int) -> Chance:
    """The probability of what happened so many times; NaN without samples."""
    if total == 0:
        return fraction(count, total)
    from scipy.stats import binomtest

    interval = binomtest(count, total).proportion_ci(LEVEL, "wilson")
    low, high = float(interval.low), float(interval.high)
    return Chance(count=count, total=total, share=count / total, low=low, high=high)


def fraction(count: int, total: int) -> Chance:
    """The fraction of points that are no random samples: without an interval."""
    share = count / total if total else math.nan
    return Chance(count=count, total=total, share=share, low=math.nan, high=math.nan)
