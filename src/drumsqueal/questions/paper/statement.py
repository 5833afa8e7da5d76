"""A statement of a paper as a number and its limit; what Seo & Kang (2023) leave open is a named limit here."""

from collections.abc import Mapping
from dataclasses import replace
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import computed_field
from pydantic.dataclasses import dataclass

from drumsqueal.questions.paper.curves import Curve

SQUEALING, QUIET = ("X", "Y", "Tz"), ("Z", "Tx", "Ty")
STRAIGHT = 0.01  # of the largest value: what is nearer to a straight line is linear
ALIKE = 0.01  # of the frequency axis: what is nearer looks the same
APART = 0.1  # of the higher frequency: modes that are further from each other are not about to meet
NO_PART = 1e-9  # of a mode's kinetic energy
EXPONENT = 0.05  # a power of the speed within this of -1 is "proportional to 1/Ω"
MAJOR = 0.5  # of the mean square motion of the lining
DRASTIC = 0.25  # of the value at the smallest angle
MINOR = 0.5  # of the change that is called drastic
MEASURED = 0.01  # of a growth rate, by which a transient may miss an eigenvalue
GROWN = 1.0  # times the motion at first: more has grown
LIFTED = 0.01  # of the lining: more out of contact in the steady-state response is squeal
NARROW = (0.4, 1.0)  # of the scene's speed: a shorter axis, from 2 to 5 rad/s


class Verdict(StrEnum):
    """What the numbers say of a statement."""

    CONFIRMED = "confirmed"
    NOT_CONFIRMED = "not confirmed"
    DEPENDS = "depends on a reading that the text does not fix"
    NOT_DECIDED = "not decided"


@dataclass(frozen=True)
class Reading:
    """One reading of a statement: a number that decides it, and its limit.

    `value` is to be above or below `limit`, as `bound` (">" or "<") says; None where it could not be computed.
    `detail` says where.
    """

    measure: str
    unit: str
    value: float | None
    bound: str
    limit: float
    detail: str = ""

    @property
    def condition(self) -> str:
        """What the number must fulfil, as in "> 0.5"."""
        return f"{self.bound} {self.limit:g} {self.unit}".rstrip()

    @computed_field
    @property
    def holds(self) -> bool | None:
        """Whether the number is on the right side of its limit."""
        return None if self.margin is None else bool(self.margin > 0)

    @computed_field
    @property
    def margin(self) -> float | None:
        """Distance from the limit, positive on the side on which the statement holds."""
        if self.value is None or not np.isfinite(self.value):
            return None
        return float(self.value - self.limit if self.bound == ">" else self.limit - self.value)


@dataclass(frozen=True)
class Statement:
    """One statement of the paper, in our words, and the readings that the text leaves open."""

    figure: str
    statement: str
    readings: tuple[Reading, ...] = ()

    @computed_field
    @property
    def verdict(self) -> Verdict:
        """Confirmed or not where all readings agree."""
        held = {reading.holds for reading in self.readings}
        if None in held:
            return Verdict.NOT_DECIDED
        if len(held) > 1:
            return Verdict.DEPENDS
        return Verdict.CONFIRMED if held == {True} else Verdict.NOT_CONFIRMED

    def read(
        self, measure: str, value: float | None, bound: str, limit: float, unit: str = "", detail: str = ""
    ) -> "Statement":
        """The statement with one more reading."""
        return replace(self, readings=(*self.readings, Reading(measure, unit, value, bound, limit, detail)))


def falls(curve: Curve, says: str) -> Statement:
    """All three growth rates fall as the number of the figure rises (in size, for the drum's speed)."""
    order = np.argsort(np.abs(curve.values))
    shown = np.abs(curve.shown)[order]
    rates = {name: curve.rate(name)[order] for name in SQUEALING}
    measure = f"largest rise of one of them, from any of {len(shown)} values to a larger one"
    ends = ", ".join(f"{name} {rate[0]:.1f} to {rate[-1]:.1f}" for name, rate in rates.items())
    where = f"from {shown[0]:.3g} to {shown[-1]:.3g} {curve.axis.unit}: {ends}"
    rise = max(map(largest_rise, rates.values()))
    return Statement(curve.axis.figure, says).read(measure, rise, "<", 0.0, "1/s", where)


def listed(numbers: Mapping[str, float], form: str) -> str:
    """Numbers by name, in one format."""
    return ", ".join(f"{name} {number:{form}}" for name, number in numbers.items())


def largest(numbers: Mapping[str, Any]) -> tuple[str, float]:
    """Name and number of the largest."""
    name = max(numbers, key=numbers.__getitem__)
    return name, float(numbers[name])


def largest_rise(y: NDArray[np.float64]) -> float:
    """Largest rise of y from one entry to any later one; negative where it falls throughout."""
    return float(np.max(y[1:] - np.minimum.accumulate(y)[:-1]))


def off_line(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """Largest distance of y from its least-squares straight line over x."""
    return float(np.abs(y - np.polynomial.Polynomial.fit(x, y, 1)(x)).max())
