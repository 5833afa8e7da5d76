"""What a fit to a measured record finds."""

from typing import Annotated, Any, ClassVar

from pydantic import computed_field

from drumsqueal.findings.columns import Column
from drumsqueal.findings.schema import Finding, Findings, Held, InMemory, SceneInFile
from drumsqueal.questions.fit.record import RecordKind, RecordReading


class FittedNumber(Finding):
    """A number of the scene before and after, in SI and in the `unit` of the scene file ("": SI).

    `uncertainty` is half the 95 % confidence interval of the fitted one and `standard_uncertainty` its standard error;
    both are None where the record does not determine it, and it then is as near to the scene's own as the lines allow.
    """

    key: Annotated[str, Column("number", meaning="dotted key of the scene")]
    unit: Annotated[str, Column("unit", missing="SI", meaning="unit of the scene file")]
    scene_value: Annotated[float, Column("scene", "~4")]
    fitted_value: Annotated[float, Column("fitted", "~4", within="uncertainty")]
    uncertainty: Annotated[float | None, Column("±", "~2", "half the 95 % confidence interval")]
    standard_uncertainty: float | None
    determined: Annotated[bool, Column("deter-\nmined", ">", "whether the record determines the number")]
    scene_value_SI: float
    fitted_value_SI: float
    uncertainty_SI: float | None
    at_bound: bool = False
    columns: ClassVar = "key", "scene_value", "fitted_value", "uncertainty", "unit", "relative_change", "determined"

    @computed_field
    @property
    def relative_change(self) -> Annotated[float | None, Column("change", "+.2f", unit="%", factor=100)]:
        """Fitted over the scene's value, less 1; None where that is zero."""
        return self.fitted_value_SI / self.scene_value_SI - 1 if self.scene_value_SI else None


class FittedLine(Finding):
    """A measured line with what the scene predicts before and after; uncertainties are half the 95 % intervals.

    `mode` is the mode it is taken for; None of a line of saturated squeal, and where it is `used` for nothing. Growth
    rates are None where the record does not show them.
    """

    measured_Hz: Annotated[float, Column("measured", ".2f")]
    uncertainty_Hz: Annotated[float, Column("±", "~2", "half the 95 % confidence interval", unit="")]
    mode: Annotated[str | None, Column("mode", optional=True)] = None
    before_Hz: Annotated[float | None, Column("scene", ".2f")] = None
    after_Hz: Annotated[float | None, Column("fitted", ".2f")] = None
    measured_growth_rate_1_per_s: Annotated[float | None, Column("growth", "+.2f", optional=True)] = None
    growth_rate_uncertainty_1_per_s: Annotated[float | None, Column("±", "~2", unit="", optional=True)] = None
    before_growth_rate_1_per_s: Annotated[float | None, Column("scene", "+.2f", optional=True)] = None
    after_growth_rate_1_per_s: Annotated[float | None, Column("fitted", "+.2f", optional=True)] = None
    columns: ClassVar = "mode", ...

    @computed_field
    @property
    def used(self) -> bool:
        """Whether the fit takes it."""
        return self.after_Hz is not None


class Combination(Finding):
    """What the record fixes of numbers that it does not tell apart: a product of powers, or a sum.

    The product of the numbers, each to its exponent in `powers`, is known to `relative_uncertainty`, half its 95 %
    interval, near the fitted values. Of numbers with one unit `factors` are those of the sum that stays instead, and
    `value` and `uncertainty` (95 %) are its, in the `unit` of the scene file ("": SI).
    """

    powers: dict[str, float]
    relative_uncertainty: float
    factors: dict[str, float] | None = None
    value: float | None = None
    uncertainty: float | None = None
    unit: str = ""


class Fit(Findings):
    """Numbers of a scene fitted to a measured record; `scene` is the one before, `fitted_scene` the one after.

    The `record_kind` is "linear" for small vibration, whose lines are compared with the eigenvalues, and "saturated"
    for squeal, whose lines are compared with those of transients. `observations` counts frequencies and growth rates.
    `chi_square_per_freedom` is that of the lines, of a freedom of at least 1, and None where there are no more
    observations than numbers and the lines are met; uncertainties are scaled by its root where it exceeds 1.
    `open_combinations` are those of the numbers that the record does not determine: exponents by key, along which the
    product of powers may change, and `fixed` what it determines of these numbers all the same. `ambiguous` says which
    other assignment of lines to modes, or which other squeal, fits as well. Where the lines are `missed` by more than
    ten times their uncertainty nothing is determined, and the fit has failed.
    """

    printed_by = "drumsqueal.questions.fit.answer.print_fit"

    file: str
    channel: str
    record_kind: RecordKind
    reason: str
    from_s: float
    until_s: float
    sample_rate_Hz: float
    numbers: tuple[FittedNumber, ...]
    lines: tuple[FittedLine, ...]
    observations: int
    chi_square_per_freedom: float | None
    freedom: int
    open_combinations: tuple[dict[str, float], ...]
    fixed: tuple[Combination, ...] = ()
    missed: bool = False
    ambiguous: str | None = None
    transients: int = 0
    verdict: str = ""
    notes: tuple[str, ...] = ()
    fitted_scene: SceneInFile
    reading: InMemory[RecordReading] = Held
    written: InMemory[Any] = Held

    @property
    def determined(self) -> tuple[FittedNumber, ...]:
        """The numbers that the record determines."""
        return tuple(number for number in self.numbers if number.determined)
