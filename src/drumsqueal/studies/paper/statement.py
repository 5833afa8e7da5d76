"""A statement of a paper as a number and its limit; what Seo & Kang (2023) leave open is a named limit here."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.studies.paper.curves import Curve

SQUEALING, QUIET = ("X", "Y", "Tz"), ("Z", "Tx", "Ty")
STRAIGHT = 0.01  # of the largest value: what is nearer to a straight line is linear
ALIKE = 0.01  # of the frequency axis: what is nearer looks the same
APART = 0.1  # of the higher frequency: modes that are further from each other are not about to meet
NO_PART = 1e-9  # of a mode's kinetic energy
EXPONENT = 0.2  # a power of the speed within this of -1 is "like 1/Ω"
MAJOR = 0.5  # of the mean square motion of the lining
DRASTIC = 0.25  # of the value at the smallest angle
MINOR = 0.5  # of the change that is called drastic
MEASURED = 0.01  # of a growth rate, by which a transient may miss an eigenvalue
GROWN = 1.0  # times the motion at first: more has grown


class Statement(NamedTuple):
    """One statement, in our words: the number that decides it, its limit, and whether it holds.

    `value` is held against `limit` from above or below, as `bound` says; None, and then `holds` too, where it could
    not be computed. `margin` is by how much the statement holds (positive) or fails. `detail` says where.
    """

    figure: str
    says: str
    measure: str
    unit: str
    value: float | None
    bound: str
    limit: float
    detail: str

    @property
    def holds(self) -> bool | None:
        """Whether the number is on the right side of its limit."""
        return None if self.margin is None else bool(self.margin > 0)

    @property
    def margin(self) -> float | None:
        """Distance from the limit, positive on the side on which the statement holds."""
        if self.value is None or not np.isfinite(self.value):
            return None
        return float(self.value - self.limit if self.bound == ">" else self.limit - self.value)


def falls(curve: Curve, says: str) -> Statement:
    """All three growth rates fall as the number of the figure rises (in size, for the drum's speed)."""
    order = np.argsort(np.abs(curve.values))
    steps = {name: np.diff(curve.rate(name)[order]) for name in SQUEALING}
    rising = max(SQUEALING, key=lambda name: steps[name].max())
    shown = np.abs(curve.shown)[order]
    ends = {name: curve.rate(name)[order][[0, -1]] for name in SQUEALING}
    return Statement(
        curve.axis.figure,
        says,
        f"largest rise of one of them, from one of {len(shown)} values to the next",
        "1/s",
        float(steps[rising].max()),
        "<",
        0.0,
        f"from {shown[0]:.3g} to {shown[-1]:.3g} {curve.axis.unit}: "
        + ", ".join(f"{name} {low:.1f} to {high:.1f}" for name, (low, high) in ends.items()),
    )


def off_line(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """Largest departure of y from its least-squares straight line over x."""
    return float(np.abs(y - np.polynomial.Polynomial.fit(x, y, 1)(x)).max())
