"""Intervals of a number, each from its low to its high end."""

import math
from collections.abc import Iterable

Interval = tuple[float, float]


def joined(intervals: Iterable[Interval]) -> tuple[Interval, ...]:
    """Those that touch as one, in ascending order."""
    found: list[Interval] = []
    for low, high in sorted(intervals):
        if found and low <= found[-1][1]:
            found[-1] = (found[-1][0], max(high, found[-1][1]))
        else:
            found.append((low, high))
    return tuple(found)


def common(some: Iterable[Interval], others: Iterable[Interval]) -> tuple[Interval, ...]:
    """What each of some has in common with each of the others."""
    others = tuple(others)
    both = ((max(a, c), min(b, d)) for a, b in some for c, d in others)
    return tuple((low, high) for low, high in both if low < high)


def without(some: Iterable[Interval], others: Iterable[Interval]) -> tuple[Interval, ...]:
    """What of some is in none of the others, which are in ascending order and do not touch."""
    ends = [-math.inf, *(end for each in others for end in each), math.inf]
    return common(some, zip(ends[::2], ends[1::2], strict=True))
