"""What a study of the onset has at each value, and the ranges that follow."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.questions.onset.attractors import FAILED, RUNS_AWAY, UNDECIDED, Ending
from drumsqueal.questions.onset.attractors import NEUTRAL as HANGS_ON_START
from drumsqueal.solve.linear.branches import Critical, Point

STABLE, KICKED, SQUEALS = "stable", "bistable", "squeals"  # bistable: stable, but a large disturbance makes it squeal
NEUTRAL, UNKNOWN, NOWHERE = "neutral", "undecided", "no steady sliding"
QUIET = (STABLE, NEUTRAL)  # nothing squeals there


class Kick(NamedTuple):
    """The smallest kick that leads to squeal, of those along the modes: a velocity at the place of steady sliding.

    It lies between the largest that dies away and the smallest that does not, both along `mode` (its label), either
    way, and `velocity` (n,) is halfway (m/s, rad/s). With it the fastest point of the lining's surface moves at `speed`
    (m/s) and the shoe has the kinetic energy `energy` (J); the uncertainties are half of what lies between. Free
    vibration from it would come to `edge_share` times the nearer edge, contact loss or slip reversal, by the linear
    model. `ending` is where the larger of the two leads.
    """

    mode: str
    velocity: NDArray[np.float64]
    speed: float
    speed_uncertainty: float
    energy: float
    energy_uncertainty: float
    edge_share: float
    ending: Ending


class Row(NamedTuple):
    """One value: the linear point, where each start led, and whether it was asked for or lies at a boundary.

    `kick` is the smallest that leads to squeal, None where none was found or looked for.
    """

    point: Point
    endings: tuple[Ending, ...]
    asked: bool
    kick: Kick | None = None

    @property
    def value(self) -> float:
        """The parameter."""
        return self.point.value

    @property
    def kind(self) -> str:
        """What becomes of a start there.

        Stable, neutral (motion neither grows nor decays), bistable, squeals (steady sliding is unstable),
        undecided, or no steady sliding.
        """
        if self.point.reason:
            return NOWHERE
        if self.point.unstable:
            return SQUEALS
        if self.strongest is not None:
            return KICKED
        if any(ending.kind in (UNDECIDED, RUNS_AWAY, FAILED) for ending in self.endings):
            return UNKNOWN
        return NEUTRAL if any(ending.kind == HANGS_ON_START for ending in self.endings) else STABLE

    @property
    def small(self) -> Ending | None:
        """Where the small departure led."""
        return next((ending for ending in self.endings if ending.start == "small"), None)

    @property
    def attractors(self) -> tuple[Ending, ...]:
        """The settled motions that differ, the one with most kinetic energy first."""
        found: list[Ending] = []
        for ending in self.endings:
            if ending.settled and not any(ending.like(other) for other in found):
                found.append(ending)
        return tuple(sorted(found, key=lambda ending: -ending.motion.kinetic_energy))

    @property
    def strongest(self) -> Ending | None:
        """The settled motion with most kinetic energy."""
        return next(iter(self.attractors), None)


class Range(NamedTuple):
    """A range of one kind; each end with its uncertainty, None where it is an end of what was asked for."""

    kind: str
    first: float
    last: float
    first_uncertainty: float | None
    last_uncertainty: float | None


def find_ranges(rows: Sequence[Row], critical: Sequence[Critical], resolved: float) -> tuple[Range, ...]:
    """Join rows of one kind; they part at critical values where stability changes, and halfway between rows elsewhere.

    The uncertainty of an end is that of the critical value, or half the distance of the two rows, but not less than is
    `resolved`: motion that dies out slowly still lasts beyond its end when it is looked at.
    """
    ranges = [Range(rows[0].kind, rows[0].value, rows[0].value, None, None)]
    for a, b in pairwise(rows):
        if a.kind == b.kind:
            ranges[-1] = ranges[-1]._replace(last=b.value)
            continue
        between = [each for each in critical if a.value <= each.value <= b.value]
        changes = (a.kind == SQUEALS) != (b.kind == SQUEALS)
        if changes and between:
            at, uncertainty = (between[-1] if a.kind == SQUEALS else between[0])[:2]
        else:
            at, uncertainty = (a.value + b.value) / 2, max((b.value - a.value) / 2, resolved)
        ranges[-1] = ranges[-1]._replace(last=at, last_uncertainty=uncertainty)
        ranges.append(Range(b.kind, at, b.value, uncertainty, None))
    return tuple(ranges)
