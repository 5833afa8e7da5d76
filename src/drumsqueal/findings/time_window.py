"""The part of a record that `--from` and `--until` ask for, in every command that takes them."""

from drumsqueal.errors import RequestError

# Of a sampling interval, that a time may lie beyond the first and the last sample: a record of 3 s ends an interval
# before 3 s, and times that are printed are rounded.
BEYOND = 1.001


def time_window(
    record: str, covered: tuple[float, float], interval: float, first: float | None, last: float | None
) -> tuple[float, float]:
    """From and until when (s), of a record which covers these times with so many seconds between samples.

    `first` and `last` are what `--from` and `--until` say, None for the ends of the record. Raises RequestError for a
    time that the record does not cover, and where nothing lies between the two.
    """
    begin, end = covered
    slack = BEYOND * interval
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
