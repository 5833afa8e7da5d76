"""A number of a scene before and after, and what rounding makes of it."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Any

from pydantic import computed_field

from drumsqueal.findings.part import Finding
from drumsqueal.questions.sensitivity.stabilising import ZERO_SCALE, size_of
from drumsqueal.scene import Scene
from drumsqueal.scene.written import Value, Written

ROUNDING = 0.02  # of a change: how much further rounding may take it


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


def rounded(
    written: Written,
    values: Mapping[str, float],
    before: Mapping[str, float],
    limits: Mapping[str, tuple[float, float]],
) -> dict[str, Value]:
    """Values (SI) as the scene file is to have them, each rounded away from the one before, within its limits."""
    return {key: _rounded(written, key, value, before[key], *limits[key]) for key, value in values.items()}


def _rounded(written: Written, key: str, value: float, before: float, low: float, high: float) -> Value:
    outward = written.outward(key, value, before, ROUNDING)
    shown = float(outward.split()[0]) if isinstance(outward, str) else outward
    if written.shown(key, low) <= shown <= written.shown(key, high):
        return outward
    # 1e-6 of a change: how much less far rounding may take it where further is out of bounds
    return written.outward(key, value, before, 1e-6, inward=True)


def in_SI(written: Written, values: Mapping[str, Value]) -> dict[str, float]:
    """Values of the scene file in SI."""
    return {key: written.read(key, value) for key, value in values.items()}
