"""Whether times are evenly spaced."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Of a sampling interval, that a sample may lie off its place. What that adds to a line of frequency f is below 2π times
# that times f over the sample rate: −30 dB of a line at half the sample rate, less below.
JITTER = 0.01
ROUNDED = 0.75  # of the last digit: half of it, and what the rounding of all of them shifts the fit by
LOST = 0.4  # intervals; a sample that was lost puts its neighbours half an interval off, or more
MOST_DIGITS = 12  # after the point of a time
LAST_FRACTION = 0.1  # of the times, the largest, whose digits are the coarsest


FEWEST_STEPS = 8  # next to a single gap, of which all the others are alike
RATE_CURE = 'give --rate, such as --rate "51.2 kHz"'
FASTER = "take a faster record or, if its times are not in the unit that it states, correct --rate"


class Sampling(NamedTuple):
    """Evenly spaced times: samples per second (Hz), and the first time (s)."""

    rate: float
    start: float


class UnevenError(ValueError):
    """Times are not evenly spaced; the message says where, and what helps."""

    def __init__(self, fault: str, cure: str = f"resample it evenly, or {RATE_CURE}") -> None:
        """Take the fault and its cure."""
        super().__init__(f"{fault}; {cure}")


def even_sampling(time: NDArray[np.float64]) -> Sampling:
    """The even spacing of times (s), by least squares; NaN among them is passed over.

    A time may lie 1 % of an interval off its place or, up to 40 %, as far as rounding its last digit moves it: then the
    times that were written are rounded, not those of the samples. Raises UnevenError.
    """
    known = np.isfinite(time)
    index = np.flatnonzero(known).astype(np.float64)
    if index.size < 2:
        raise UnevenError("there are fewer than two times")
    times = time[known]
    middle = index - index.mean()
    interval = float(middle @ times / (middle @ middle))
    places = times.mean() + interval * middle
    off = np.abs(times - places)
    worst = int(np.argmax(off))
    if not interval > 0:
        raise UnevenError("the times do not increase")
    digit = last_digit(times)
    if off[worst] > max(JITTER * interval, min(ROUNDED * digit, LOST * interval)):
        if digit > interval / 2:
            raise UnevenError(f"the times are rounded to {digit:g} s, too coarse for an interval of {interval:.3g} s")
        if gap := _gap(times):  # at one rate throughout, what follows would come too early
            raise UnevenError(gap, "cut the file there, or resample it evenly")
        raise UnevenError(f"at {times[worst]:.9g} s a time lies {off[worst] / interval:.2g} intervals off its place")
    return Sampling(1.0 / interval, float(times[0] - index[0] * interval))


def _gap(times: NDArray[np.float64]) -> str:
    """Where the only gap of a record is, which is evenly sampled before and after it; nothing where there is none."""
    steps = np.diff(times)
    usual, widest = float(np.median(steps)), int(np.argmax(steps))
    others = np.delete(steps, widest)
    if others.size < FEWEST_STEPS or steps[widest] < 1.5 * usual or np.abs(others - usual).max() > LOST * usual:
        return ""
    return f"{steps[widest] - usual:.4g} s are missing between {times[widest]:.9g} and {times[widest + 1]:.9g} s"


def last_digit(times: NDArray[np.float64]) -> float:
    """The place value of the last digit that the largest of these times were written with; 0 where there are many."""
    largest = np.sort(np.abs(times))[-max(2, round(LAST_FRACTION * times.size)) :]
    for digits in range(MOST_DIGITS):
        scaled = largest * 10.0**digits
        round_off = 4 * np.finfo(np.float64).eps * max(1.0, float(scaled[-1]))
        if np.abs(scaled - np.round(scaled)).max() <= round_off:
            return 10.0**-digits
    return 0.0
