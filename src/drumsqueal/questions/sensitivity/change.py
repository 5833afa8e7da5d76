"""A number of a scene before and after: how far it changes, and what rounding makes of it."""

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import Any

from pydantic import computed_field

from drumsqueal.findings.part import Finding
from drumsqueal.scene import Scene
from drumsqueal.scene.written import Written

ROUNDING = 0.02  # of a change: how much further rounding may take it
DAMPING = "damping.ratio"
ZERO_SCALE = {DAMPING: 0.01}  # of a number that is zero: what it is measured in
LEAST = 0.1  # times its value: how far down a number may go, where physics has no nearer limit
TENTH = math.log(LEAST)


def size_of(key: str, before: float, after: float) -> float:
    """How far a number changes, and which way: ln(after/before), so that twice and half are equally far.

    Below a tenth of the number before it goes on along its tangent, to −3.3 for a number that becomes zero; of a number
    that was zero it is ln(1 + after/`ZERO_SCALE`).
    """
    if before == 0:
        return math.log1p(after / ZERO_SCALE[key])
    ratio = after / before
    return math.log(ratio) if ratio >= LEAST else TENTH - 1 + ratio / LEAST


def changed(key: str, before: float, size: float) -> tuple[float, float]:
    """The number that a change of this size makes of one, and its derivative with respect to the size."""
    if before == 0:
        return ZERO_SCALE[key] * math.expm1(size), ZERO_SCALE[key] * math.exp(size)
    if size < TENTH:
        return before * LEAST * (size - TENTH + 1), before * LEAST
    return before * math.exp(size), before * math.exp(size)


class Change(Finding):
    """One number before and after, in SI, and in the `unit` that it has in the scene file ("": SI)."""

    key: str
    before: float
    after: float
    unit: str = ""
    before_in_unit: float
    after_in_unit: float

    @classmethod
    def of(cls, written: Written, key: str, before: float, after: float) -> "Change":
        """That of a number of a scene as its file writes it."""
        shown = {"before_in_unit": written.shown(key, before), "after_in_unit": written.shown(key, after)}
        return cls(key=key, before=before, after=after, unit=written.unit(key), **shown)

    @computed_field
    @property
    def relative(self) -> float:
        """After over before, less 1; for a number that was zero, in units of its scale."""
        return (self.after - self.before) / (self.before or ZERO_SCALE[self.key])

    @computed_field
    @property
    def logarithm(self) -> float:
        """How far the number changes, ln(after/before), by which changes are ranked (`size_of`)."""
        return size_of(self.key, self.before, self.after)


class Caution(StrEnum):
    """What a changed brake is that the one before was not, though it may be quiet."""

    RISING = "friction then rises with the slip speed: its static coefficient lies below the kinetic one"
    WIDE = "the lining is then wider than the radius of the drum"


BELOW = {Caution.RISING: ("friction.static", "friction.kinetic"), Caution.WIDE: ("shoe.outer_radius", "shoe.width")}
"""Which of a shoe's numbers is then below which."""


def cautions(scene: Scene, changed: Mapping[str, float]) -> tuple[Caution, ...]:
    """What is to be said of a brake with changed numbers (SI)."""
    before, shoes = scene.numbers(), range(len(scene.shoes))
    after = {**before, **changed}

    def arises(caution: Caution, shoe: int) -> bool:
        keys = [scene.key_of(shoe, key) for key in BELOW[caution]]
        return _is_below(after, *keys) and not _is_below(before, *keys)

    return tuple(each for each in Caution if any(arises(each, k) for k in shoes))


def _is_below(numbers: Mapping[str, Any], small: str, large: str) -> bool:
    return small in numbers and large in numbers and numbers[small] < numbers[large]


def rounded(written: Written, key: str, value: float, before: float, limits: tuple[float, float]) -> float:
    """A value (SI) as the scene file is to have it, rounded away from the one before, within its limits."""
    outward = written.outward(key, value, before, ROUNDING)
    shown = float(outward.split()[0]) if isinstance(outward, str) else outward
    low, high = (written.shown(key, limit) for limit in limits)
    if not low <= shown <= high:
        # 1e-6 of a change: how much less far rounding may take it where further is out of bounds
        outward = written.outward(key, value, before, 1e-6, inward=True)
    return written.read(key, outward)
