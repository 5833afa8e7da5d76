"""Intervals of a number, each from its low to its high end."""

import math
from collections.abc import Iterable

from drumsqueal.errors import RequestError

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


# The part of a record that `--from` and `--until` ask for, in every command that takes them.


def time_window(
    record: str, covered: tuple[float, float], interval: float, first: float | None, last: float | None
) -> tuple[float, float]:
    """From and until when (s), of a record which covers these times with so many seconds between samples.

    `first` and `last` are what `--from` and `--until` say, None for the ends of the record. Raises RequestError for a
    time that the record does not cover, and where nothing lies between the two.
    """
    begin, end = covered
    # Of a sampling interval, that a time may lie beyond the first and the last sample: a record of 3 s ends an interval
    # before 3 s, and times that are printed are rounded.
    slack = 1.001 * interval
    for option, time in (("--from", first), ("--until", last)):
        if time is not None and not begin - slack <= time <= end + slack:
            raise RequestError(f"{option} {time:.9g} s: {record} has {begin:.9g} to {end:.9g} s; take a time within it")
    since = begin if first is None else min(max(first, begin), end)
    until = end if last is None else min(max(last, begin), end)
    if not since < until:
        start = f"the start at {begin:.9g} s" if first is None else f"--from {first:.9g} s"
        stop = f"the end at {end:.9g} s" if last is None else f"--until {last:.9g} s"
        raise RequestError(f"{start} is not before {stop}; {record} has {begin:.9g} to {end:.9g} s")
    return since, until
