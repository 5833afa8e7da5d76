"""Work against precision: what a contender's time is at an error that it was not asked for exactly."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np


class Curve(NamedTuple):
    """Time (s) and error of one contender, a point for each tolerance; NaN where it failed."""

    name: str
    tolerances: np.ndarray
    errors: np.ndarray
    times: np.ndarray

    def time_at(self, error: float) -> float:
        """Time (s) that an error takes, NaN where it is never reached; between two points along their line (log-log).

        Beyond the edges a trajectory follows its round-off and a smaller tolerance is not always better. A tolerance
        is therefore credited with the largest error of all that cost as much or more. Where even the cheapest point is
        better than asked for, its time counts.
        """
        order = np.argsort(self.times)
        times, errors = self.times[order], self.errors[order]
        good = np.isfinite(errors)
        times, errors = times[good], np.maximum.accumulate(errors[good][::-1])[::-1]
        if not len(errors) or errors[-1] > error:
            return np.nan
        above = np.flatnonzero(errors > error)
        if not len(above):
            return float(times[0])
        last = above[-1]
        x, y = np.log(errors[last : last + 2]), np.log(times[last : last + 2])
        return float(np.exp(y[0] + (np.log(error) - x[0]) * (y[1] - y[0]) / (x[1] - x[0])))

    @property
    def best(self) -> float:
        """Smallest error."""
        return float(np.nanmin(self.errors))


def ratios(curves: Sequence[Curve], ours: Curve, errors: Iterable[float]) -> dict[str, list[float]]:
    """Time of each curve over ours at each of the errors."""
    return {each.name: [each.time_at(error) / ours.time_at(error) for error in errors] for each in curves}


def ratio_cells(curve: Curve, found: Sequence[float]) -> list[str]:
    """The ratios as text; an error that is never reached says so once."""
    cells = ["-" if np.isnan(ratio) else f"{ratio:.3g}" for ratio in found]
    return [*cells, f"never below {curve.best:.1e}" if np.isnan(found).any() else ""]
