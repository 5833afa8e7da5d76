"""Work against precision: what a configuration's time is at an error that it was not asked for exactly."""

from collections.abc import Iterable, Sequence
from statistics import median
from typing import NamedTuple

import numpy as np

from .turns import scatter


class Curve(NamedTuple):
    """Errors of a configuration (NaN: failed) and seconds of its rounds (none: not run), from loose tolerances on."""

    name: str
    tolerances: np.ndarray
    errors: np.ndarray
    seconds: list[list[float]]

    @property
    def times(self) -> np.ndarray:
        """The fastest round at each tolerance (s)."""
        return np.array([min(each, default=np.nan) for each in self.seconds])

    @property
    def scatter(self) -> float:
        """Median over fastest round, of the tolerance in the middle."""
        return median(scatter(each) for each in self.seconds if each)

    def time_at(self, error: float) -> float:
        """Time (s) that an error takes, NaN outside what was reached; between tolerances along their line (log-log).

        Beyond the boundaries a smaller tolerance may by chance give a larger error. A tolerance is therefore credited
        with the largest error of all that are as tight or tighter; the times stand as they were measured.
        """
        good = np.isfinite(self.errors) & np.isfinite(self.times)
        times, errors = self.times[good], np.maximum.accumulate(self.errors[good][::-1])[::-1]
        if not len(errors) or not errors[-1] <= error <= errors[0]:
            return np.nan
        return float(np.exp(np.interp(-np.log(error), -np.log(errors), np.log(times))))

    @property
    def best(self) -> float:
        """Smallest error."""
        return float(np.nanmin(self.errors))


def ratios(curves: Sequence[Curve], ours: Curve, errors: Iterable[float]) -> dict[str, list[float]]:
    """Time of each curve over ours at each of the errors."""
    return {each.name: [each.time_at(error) / ours.time_at(error) for error in errors] for each in curves}


def cells(values: Sequence[float]) -> list[str]:
    """Numbers as text."""
    return ["-" if np.isnan(value) else f"{value:.3g}" for value in values]
