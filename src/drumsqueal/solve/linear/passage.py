"""Eigenvalues along a drum speed or a load that changes, and the growth that each mode gathers on the way.

While the operation changes slowly compared with a period, the amplitude c of a mode in the motion c r obeys

    ċ = (λ − lᴴ ṙ) c,   so that it grows by ∫ Re λ dt and by the change of its shape, with lᴴ r = 1

Neither depends on λ at one time alone: growth sets in later than λ changes its sign. Source: S. M. Baer, T. Erneux and
J. Rinzel, "The slow passage through a Hopf bifurcation", SIAM Journal on Applied Mathematics 49, 1989.
"""

from collections.abc import Sequence
from functools import partial
from itertools import groupby, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import NoSteadySliding, SteadyStateError
from drumsqueal.physics.effects.operation import PiecewiseLinear, Schedule
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.branches import Branches, Point, follow_modes, point_at
from drumsqueal.solve.linear.modes import Mode

PIECES, FEWEST = 8, 2  # pieces that get as many; of more pieces each gets fewer, and so many at the least
MOST_PIECES = 96  # of a profile with more, as of a measured speed, the corners themselves are not followed

Vector = NDArray[np.float64]


class Along(NamedTuple):
    """A mode over times (k,) in s without a gap: itself, steady sliding (k, n), and its growth since the first.

    `growth` (k,) is the natural logarithm of its amplitude over that at the first time.
    """

    label: str
    time: Vector
    modes: tuple[Mode, ...]
    steady: Vector
    growth: Vector

    @property
    def rate(self) -> Vector:
        """Re λ (k,) in 1/s."""
        return np.array([mode.growth_rate for mode in self.modes])

    def growth_at(self, times: Vector) -> Vector:
        """The growth at any times (s) within its own."""
        from scipy.interpolate import CubicHermiteSpline  # which a report does without

        return CubicHermiteSpline(self.time, self.growth, self.rate)(times)


def follow_operation(model: Model, until: float) -> Branches:
    """The modes over time (s), from 0 on, each instant with the drum speed and the load that it has.

    Where the drum stands still there are none.
    """
    return follow_modes(partial(model_at, model), _instants(model, until))


def point_in_time(model: Model, time: float) -> Point:
    """Steady sliding and its modes at a time (s)."""
    return point_at(partial(model_at, model), time)


def model_at(model: Model, time: float) -> Model:
    """The model from a time (s) on. Raises SteadyStateError where the drum stands still then, and friction with it."""
    if model.contact.friction is not None and value_at(model.operation.drum_speed, time) == 0:
        raise SteadyStateError(NoSteadySliding.AT_REST)
    return model.since(time)


def value_at(schedule: Schedule, time: float) -> float:
    """The value of a schedule at a time (s), by NumPy."""
    return float(values_at(schedule, [time])[0])


def values_at(schedule: Schedule, time: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Its values at times (k,) in s."""
    if isinstance(schedule, PiecewiseLinear):
        return np.interp(np.asarray(time), np.asarray(schedule.time), np.asarray(schedule.value))
    return np.full(len(time), float(schedule.value))


def corners_of(model: Model, until: float) -> Vector:
    """The times (s) between which drum speed and load are linear, from 0 to a time."""
    times = [np.asarray(each.time) for each in model.operation.schedules if isinstance(each, PiecewiseLinear)]
    inner = np.concatenate([[], *times])
    return np.unique([0.0, *inner[(inner > 0) & (inner < until)], until])


def _instants(model: Model, until: float) -> Vector:
    """Evenly between the corners, and close to each standstill of the drum, which lies on one or between two."""
    corners, found = corners_of(model, until), []
    if corners.size > MOST_PIECES:
        corners = np.linspace(0.0, until, MOST_PIECES)
    # 24 between two corners of the profiles: ∫λ dt of the shipped ramp is exact to 3e-4 of 34 e-folds by that
    intervals = max(FEWEST, 24 * PIECES // max(PIECES, corners.size - 1))
    for first, last in pairwise(corners):
        found.append(np.linspace(first, last, intervals + 1))
        before, after = (value_at(model.operation.drum_speed, time) for time in (first, last))
        if before * after <= 0 and before != after:
            rest = first + (last - first) * before / (before - after)
            # 1e-3 of the time between two corners: so near to a standstill the eigenvalues are followed
            near = rest + 1e-3 * (last - first) * np.array([-1.0, 1.0])
            found.append(near[(near > first) & (near < last)])
    return np.unique(np.concatenate(found))


def modes_along(branches: Branches, corners: Vector) -> tuple[Along, ...]:
    """The modes with what they gather on the way; `corners` (s) are where their rates have kinks."""
    points = {point.value: point for point in branches.points}
    found = []
    for branch in branches.branches:
        for known, some in groupby(
            zip(branch.values.tolist(), branch.modes, strict=True), lambda each: each[1] is not None
        ):
            values, modes = zip(*some, strict=True)
            if known and len(values) > 1:
                time, steady = np.array(values), np.array([points[value].steady for value in values])
                found.append(Along(branch.label, time, modes, steady, _growth(time, modes, corners)))
    return tuple(found)


def _growth(time: Vector, modes: tuple[Mode, ...], corners: Vector) -> Vector:
    """∫ Re λ dt by Simpson's rule between the corners, and what changes of the shape add."""
    from scipy.integrate import cumulative_simpson

    rate, total = np.array([mode.growth_rate for mode in modes]), np.zeros(time.size)
    ends = [0, *(int(k) for k in np.flatnonzero(np.isin(time[1:-1], corners)) + 1), time.size - 1]
    for first, last in pairwise(ends):
        piece = slice(first, last + 1)
        total[piece] = total[first] + cumulative_simpson(rate[piece], x=time[piece], initial=0.0)
    # lᴴ ṙ over a step from both of its ends, exact also where the coordinate that scales the shape is another one.
    turned = [
        abs(np.vdot(after.left, before.right) / np.vdot(before.left, after.right)) for before, after in pairwise(modes)
    ]
    total[1:] += np.cumsum(np.log(turned)) / 2
    return total
