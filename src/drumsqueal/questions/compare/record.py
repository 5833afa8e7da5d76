"""One measured record, whatever file it came from, and what its unit says of it.

Units are converted by pint, but only those named here are known: pint also knows c as the speed of light, k as
Boltzmann's constant and au as a length, which are names of columns.
"""

import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.scene.quantities import SceneError, parse_quantity, printable

# Whether times are evenly spaced.


# Of a sampling interval, that a sample may lie off its place. What that adds to a line of frequency f is below 2π times
# that times f over the sample rate: −30 dB of a line at half the sample rate, less below.
_JITTER = 0.01
_LOST = 0.4  # intervals; a sample that was lost puts its neighbours half an interval off, or more


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
    digit = _last_digit(times)
    # 0.75 of the last digit: half of it, and what the rounding of all of them shifts the fit by
    if off[worst] > max(_JITTER * interval, min(0.75 * digit, _LOST * interval)):
        if gap := _gap(times):  # at one rate throughout, what follows would come too early
            raise UnevenError(gap, "cut the file there, or resample it evenly")
        back = np.flatnonzero(np.diff(times) <= 0)
        if back.size == 1:
            before, after = times[back[0] : back[0] + 2]
            raise UnevenError(
                f"the time {before:.9g} s is followed by {after:.9g} s", "put each line in its place, once"
            )
        if digit > interval / 2:
            raise UnevenError(f"the times are rounded to {digit:g} s, too coarse for an interval of {interval:.3g} s")
        raise UnevenError(f"at {times[worst]:.9g} s a time lies {off[worst] / interval:.2g} intervals off its place")
    return Sampling(1.0 / interval, float(times[0] - index[0] * interval))


def _gap(times: NDArray[np.float64]) -> str:
    """Where the only gap of a record is, which is evenly sampled before and after it; nothing where there is none."""
    steps = np.diff(times)
    usual, widest = float(np.median(steps)), int(np.argmax(steps))
    others = np.delete(steps, widest)
    # 8 next to a single gap, of which all the others are alike
    if others.size < 8 or steps[widest] < 1.5 * usual or np.abs(others - usual).max() > _LOST * usual:
        return ""
    return f"{steps[widest] - usual:.4g} s are missing between {times[widest]:.9g} and {times[widest + 1]:.9g} s"


def _last_digit(times: NDArray[np.float64]) -> float:
    """The place value of the last digit that the largest of these times were written with; 0 where there are many."""
    # 0.1 of the times, the largest, whose digits are the coarsest
    largest = np.sort(np.abs(times))[-max(2, round(0.1 * times.size)) :]
    for digits in range(12):  # after the point of a time
        scaled = largest * 10.0**digits
        round_off = 4 * np.finfo(np.float64).eps * max(1.0, float(scaled[-1]))
        if np.abs(scaled - np.round(scaled)).max() <= round_off:
            return 10.0**-digits
    return 0.0


# The SI units that a signal may have, and what has them; a family is one quantity and its rates, in order.
QUANTITIES = {
    "m": "displacement",
    "m/s": "velocity",
    "m/s^2": "acceleration",
    "rad": "rotation",
    "rad/s": "angular velocity",
    "rad/s^2": "angular acceleration",
    "Pa": "pressure",
    "N": "force",
    "N*m": "torque",
}
STANDARD_GRAVITY = 9.80665  # m/s²
# Where others would mean a gram, a nanometre, or a turn's 6400th part.
_OWN = {
    "g": ("m/s^2", STANDARD_GRAVITY),
    "g_n": ("m/s^2", STANDARD_GRAVITY),
    "Nm": ("N*m", 1.0),
    "mil": ("m", 2.54e-5),
}
# What other units are made of, in products, quotients and powers; "um" and a Greek letter are as good as "µm".
_PARTS = {
    "length": ("m", "cm", "mm", "µm", "nm", "pm", "in", "ft"),
    "time": ("s", "ms", "min"),
    "angle": ("rad", "mrad", "µrad", "deg", "rev", "rpm"),
    "pressure": ("Pa", "µPa", "mPa", "hPa", "kPa", "MPa", "bar", "mbar", "psi"),
    "force": ("N", "µN", "mN", "kN", "lbf"),
}
_KNOWN = frozenset(part for parts in _PARTS.values() for part in parts) | {
    *("°", "degree", "degrees", "sec", "inch"),
    *(part.replace("µ", "u") for parts in _PARTS.values() for part in parts),
}
FEWEST = 64  # samples
_NAME = 40  # letters
_LISTED = 12  # channels that a message names


class Unit(NamedTuple):
    """A unit by the SI unit of the same quantity, how many of these it is, and as it was written."""

    si: str
    factor: float
    written: str

    def same_as(self, other: "Unit") -> bool:
        """Whether the other is this unit, to the digits that people write."""
        # 0.01 relative, of two factors that are the same unit: standard gravity is 9.81 m/s² to many
        return self.si == other.si and abs(self.factor / other.factor - 1) <= 0.01


class Measured(NamedTuple):
    """A measured record: `values` (time,) at `sample_rate` (Hz), the first of them at `start_s`, in an SI unit.

    `unit` is empty where it is not known. `remarks` are what was assumed, or left out, in reading the file.
    """

    name: str
    unit: str
    sample_rate: float
    start_s: float
    values: NDArray[np.float64]
    remarks: tuple[str, ...]

    @property
    def quantity(self) -> str:
        """What was measured; empty where the unit is not known."""
        return QUANTITIES.get(self.unit, "")

    @property
    def short_name(self) -> str:
        """The name without what explains it behind a colon, and not much longer than a column."""
        name = self.name.split(": ")[0]
        return name if len(name) <= _NAME else f"{name[: _NAME - 1]}…"

    @property
    def duration_s(self) -> float:
        """Length of the record (s)."""
        return self.values.size / self.sample_rate


class Asked(NamedTuple):
    """A measured file, which channel is asked of it, and rate (Hz) and unit if they are not to be the file's own."""

    path: Path
    channel: str | None
    rate: float | None
    unit: Unit | None

    def pick(self, names: list[str]) -> int:
        """Index of the channel asked for by name or number (from 1 on); without one, the only one there is.

        Raises RequestError where there is none like it, or several to choose from.
        """
        listed = ", ".join(f"{k} {name!r}" for k, name in enumerate(names[:_LISTED], start=1))
        listed += f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
        if self.channel is None:
            if len(names) == 1:
                return 0
            raise RequestError(f"{self.path}: there are {len(names)} channels, {listed}; choose one with --channel")
        asked = self.channel.strip()
        same = [k for k, name in enumerate(names) if name == self.channel]
        same = same or [k for k, name in enumerate(names) if name.casefold() == asked.casefold()]
        same = same or [k for k, name in enumerate(names) if name.split(":")[0] == asked]  # name: what it is
        if len(same) == 1:
            return same[0]
        if not same and asked.isascii() and asked.isdigit() and 1 <= int(asked) <= len(names):
            return int(asked) - 1
        several = "are several such channels" if same else "is no such channel"
        what = f"--channel {self.channel}: there {several}"
        raise RequestError(f"{self.path}: {what}; there are {listed}, by name or number")

    def measured(
        self, name: str, own: Unit | None, sampling: Sampling, values: NDArray[np.float64], remarks: list[str]
    ) -> Measured:
        """A record brought to SI from the unit asked for or, without one, its own; None is one that is not known."""
        unit = self.unit or own
        if self.unit is not None and own is not None and not self.unit.same_as(own):
            remarks.append(f"the unit is that of --unit, {self.unit.written}, although the file states {own.written}")
        si, factor = (unit.si, unit.factor) if unit else ("", 1.0)
        with np.errstate(over="ignore"):  # what is too large for a number is as good as missing
            return Measured(printable(name), si, *sampling, values * factor, tuple(remarks))


def check_count(path: Path, count: int) -> None:
    """Raise RequestError for a record of too few samples."""
    if count < FEWEST:
        are = "sample is" if count == 1 else "samples are"
        raise RequestError(f"{path}: {count} {are} too few; at least {FEWEST} are needed")


@cache
def parse_unit(text: str) -> Unit | None:
    """A unit such as "mm/s", "g" (standard gravity) or, of a calibration, "50 mm/s"; None for what is none of them.

    Only units that `known_units` names, of the quantities above, are known.
    """
    number, written = _split(text)
    if written in _OWN:
        si, factor = _OWN[written]
        return Unit(si, number * factor, text.strip()) if number > 0 else None
    if not _KNOWN.issuperset(re.findall(r"[^\W\d_²³]+|°", written.replace("μ", "µ"))):
        return None
    for si in sorted(QUANTITIES, key=lambda si: si != written):  # itself first, which asks for no conversion
        try:
            factor = parse_quantity(f"{number!r} {written}", si)
        except SceneError:
            continue
        return Unit(si, factor, text.strip()) if factor > 0 else None
    return None


def known_units() -> str:
    """What units may be made of, for an error."""
    own, parts = ", ".join(_OWN), "; ".join(f"{kind} {', '.join(units)}" for kind, units in _PARTS.items())
    return f"{own}, or made of {parts}"


def _split(text: str) -> tuple[float, str]:
    """Number (1 without one) and unit, the latter as `parse_quantity` takes it: m/s2 and m s-2 as m/s^2."""
    found = re.fullmatch(r"\s*([0-9.]+(?:[eE][+-]?[0-9]+)?)?\s*(.*?)\s*", text)
    number, written = (found[1], found[2]) if found else (None, text)
    try:
        factor = 1.0 if number is None else float(number)
    except ValueError:
        return 1.0, ""
    written = re.sub(r"(?<=[A-Za-z])(-?[2-9]|-1)$", r"^\1", written)  # m/s2
    written = re.sub(r"(?<=[A-Za-z0-9²])\s*[.\s·]\s*(?=[A-Za-z])", "*", written)  # m s^-2, N.m
    return factor, written
