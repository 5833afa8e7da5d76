"""The number of a scene that a study varies, as its file holds it."""

from typing import Self

from pydantic import Field

from drumsqueal.findings.part import Finding
from drumsqueal.scene.variation import Variation


class Parameter(Finding):
    """The number by its dotted key, its values in SI, the unit in which they were given, and what that is in SI."""

    key: str
    unit: str
    values: tuple[float, ...] = Field(min_length=2)
    given_unit: str = ""
    given_unit_in_SI: float = Field(default=1.0, gt=0)

    @classmethod
    def of(cls, variation: Variation) -> Self:
        """That of a variation."""
        key, unit, values, given, size = variation
        return cls(key=key, unit=unit, values=values, given_unit=given, given_unit_in_SI=size)

    @property
    def variation(self) -> Variation:
        """The same as the command line reads it."""
        return Variation(self.key, self.unit, self.values, self.given_unit, self.given_unit_in_SI)
