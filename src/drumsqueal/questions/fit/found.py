"""What a fit to a measured record finds, in numbers and in words."""

import math
from collections.abc import Sequence
from typing import Annotated, Any, ClassVar

from pydantic import computed_field

from drumsqueal.findings.columns import Column, to_digits, to_uncertainty
from drumsqueal.findings.schema import Finding, Findings, Held, InMemory, SceneInFile
from drumsqueal.questions.fit.estimate import FAR, POOR
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


EQUAL = 1e-3  # of 1, within which a factor of a sum is one
CONFIDENCE = "95 % confidence, if every other number of the scene is exact"


def with_uncertainty(number: FittedNumber) -> str:
    """The fitted value and its 95 % interval, with the unit of the scene file."""
    unit = f" {number.unit}" if number.unit else ""
    if number.uncertainty is None:
        return f"{to_digits(number.fitted_value, 3)}{unit}"
    return f"{to_uncertainty(number.fitted_value, number.uncertainty)} ± {to_digits(number.uncertainty, 2)}{unit}"


def describe_fit(fit: Fit) -> str:
    """The result in one or two sentences."""
    if fit.missed:
        return f"The fit has failed: it {why_missed(fit)}."
    how = "eigenvalues" if fit.record_kind is RecordKind.LINEAR else "lines of the scene's squeal"
    used = [line for line in fit.lines if line.used]
    (before, rates_before), (after, rates_after) = (_furthest(used, which) for which in ("before", "after"))
    if rates_before:
        before, after = f"{before} in frequency and {rates_before} in growth rate", f"{after} and {rates_after}"
    was = f"the {how}, up to {before} off before, are now within {after} of the measured lines"
    known = [f"{number.key} = {with_uncertainty(number)}" for number in fit.determined]
    left = [number.key for number in fit.numbers if not number.determined]
    sums = "".join(f" {_sum(each)}." for each in fit.fixed if each.factors is not None)
    if not known:
        sure = f" (±: {CONFIDENCE})" if fit.fixed else ""
        return f"The record determines none of {', '.join(left)} alone{sure}; {was}.{sums}"
    text = f"The record gives {' and '.join([', '.join(known[:-1]), known[-1]] if known[1:] else known)}"
    text += f" ({CONFIDENCE}); {was}."
    return f"{text} Not determined: {', '.join(left)}.{sums}" if left else text


def why_missed(fit: Fit) -> str:
    """Why a fit has failed whose lines are missed, after its name."""
    miss = f"misses the lines by {_misses(fit)} times their uncertainty, up to"
    used = [line for line in fit.lines if line.used]
    frequency, rate = _furthest(used, "after")
    by = f"{frequency} in frequency and {rate} in growth rate" if rate else frequency
    why = "other numbers of the scene differ, too, or the record is of another brake"
    return f"{miss} {by}, so that nothing is determined: {why}"


def _misses(fit: Fit) -> str:
    """By how many times their uncertainty lines miss, where that is too much; else nothing."""
    chi = fit.chi_square_per_freedom
    return f"{math.sqrt(chi):.{0 if chi > FAR**2 else 1}f}" if chi is not None and chi > POOR**2 else ""


def _off(line, which: str) -> float:
    return getattr(line, which) / line.measured_Hz - 1


def _furthest(lines: Sequence[FittedLine], which: str) -> tuple[str, str]:
    """The largest deviations of frequency and, where they are fitted, of growth rate; else nothing."""
    frequency = _percent(max(abs(_off(line, f"{which}_Hz")) for line in lines))
    rates = [
        abs(getattr(line, f"{which}_growth_rate_1_per_s") - line.measured_growth_rate_1_per_s)
        for line in lines
        if line.mode is not None and line.measured_growth_rate_1_per_s is not None
    ]
    return frequency, f"{to_digits(max(rates), 2)} 1/s" if rates else ""


def _percent(fraction: float) -> str:
    return f"{100 * fraction:.2g} %" if fraction >= 1e-5 else "0.001 %"


def describe_notes(fit: Fit) -> tuple[str, ...]:
    """What limits the fit: what tests it, what is open, poor, ambiguous, or not used."""
    notes = []
    if not fit.missed:
        notes += [
            *_tested(fit),
            *map(_open, _combinations(fit)),
            *(_product(each) for each in fit.fixed if each.factors is None),
        ]
        if _misses(fit):
            miss = f"the lines still miss by {_misses(fit)} times their uncertainty: other numbers differ, too,"
            notes.append(f"{miss} or the model lacks something; the uncertainties are widened by that factor")
        notes += _too_wide(fit)
        if fit.ambiguous:
            notes.append(fit.ambiguous)
    # A search for squeal that misses 2e-3 of a frequency is reported.
    short_of = [line for line in fit.lines if line.used and abs(_off(line, "after_Hz")) > 2e-3]
    if fit.record_kind is RecordKind.SATURATED and short_of:
        missed = ", ".join(f"{line.measured_Hz:.1f}" for line in short_of)
        notes.append(f"the search stopped short of {missed} Hz: the squeal jumps to another motion on the way there")
    bound = [number.key for number in fit.numbers if number.at_bound]
    if bound:
        notes.append(f"{', '.join(bound)}: at the end of what is tried, 20 times or a twentieth of the scene's value")
    unused = [f"{line.measured_Hz:.1f}" for line in fit.lines if not line.used]
    if unused:
        like = "near no mode" if fit.record_kind is RecordKind.LINEAR else "like none of the simulated squeal"
        notes.append(f"not used, {like}: {', '.join(unused)} Hz")
    if fit.reading is not None and fit.reading.left_out_Hz:
        left = ", ".join(f"{f:.1f}" for f in fit.reading.left_out_Hz[:6])
        notes.append(f"harmonics, combinations and faint lines, which are of no mode: {left} Hz")
    return tuple(notes)


def _tested(fit: Fit) -> list[str]:
    """That nothing tests a fit of as many numbers as observations."""
    count, varied = fit.observations, len(fit.numbers)
    if fit.chi_square_per_freedom is not None:
        return []
    what = (
        "frequency"
        if count == 1
        else "frequencies and growth rates"
        if fit.record_kind is RecordKind.LINEAR
        else "lines"
    )
    gave = f"{count} {what} for {varied} number{'s' if varied > 1 else ''}: nothing tests the fit"
    if not fit.determined:
        return [gave]
    return [f"{gave}; where another number of the scene is wrong, the error may be many times the ±"]


def _too_wide(fit: Fit) -> list[str]:
    """Numbers whose interval has become too wide."""
    explained = {key for each in _combinations(fit) for key in each} | {n.key for n in fit.numbers if n.at_bound}
    wide = [number.key for number in fit.numbers if not number.determined and number.key not in explained]
    if not wide or fit.chi_square_per_freedom is None:
        return []
    why = "the lines are missed by more than their uncertainty, which widens that of a number too far"
    return [f"{', '.join(wide)}: not determined, for {why}"]


def _combinations(fit: Fit) -> list[dict[str, float]]:
    """The open combinations, each with the numbers that take part in it alone."""
    found = []
    for each in fit.open_combinations:
        largest = max(map(abs, each.values()))
        # 0.1 of a combination's largest exponent, from which a number is named in it
        found.append({key: value / largest for key, value in each.items() if abs(value) > 0.1 * largest})
    return found


def _open(combination: dict[str, float]) -> str:
    keys = list(combination)
    if len(keys) == 1:
        return f"{keys[0]} is not determined: the lines hardly depend on it, and fit with its other values as well"
    return f"{', '.join(keys[:-1])} and {keys[-1]} are not told apart: the lines fit with other values of these as well"


def _product(fixed: Combination) -> str:
    """What is known of numbers with different units, which have no sum."""
    terms = " × ".join(key if power == 1 else f"{key}^{power:.2g}" for key, power in _by_size(fixed.powers))
    return f"{terms} is known to ± {to_digits(100 * fixed.relative_uncertainty, 2)} %, near the fitted values"


def _sum(fixed: Combination) -> str:
    """What is known of numbers that act together, with their unit."""
    assert fixed.factors is not None
    assert fixed.value is not None
    assert fixed.uncertainty is not None
    unit = f" {fixed.unit}" if fixed.unit else ""
    is_sum = all(abs(factor - 1) < EQUAL for factor in fixed.factors.values())
    terms = [
        f"{'-' if factor < 0 else '+'} {key if abs(abs(factor) - 1) < EQUAL else f'{abs(factor):.2g} {key}'}"
        for key, factor in _by_size(fixed.factors)
    ]
    counts = "Only their sum counts: " if is_sum else "Near these values only this counts: "
    value = f"{to_uncertainty(fixed.value, fixed.uncertainty)} ± {to_digits(fixed.uncertainty, 2)}{unit}"
    return f"{counts}{' '.join(terms).removeprefix('+ ')} = {value}"


def _by_size(factors: dict[str, float]) -> list[tuple[str, float]]:
    """The largest first; of equals, which round-off tells apart, the one that was asked for first."""
    groups: list[list[str]] = []
    for key in sorted(factors, key=lambda key: -abs(factors[key])):
        if groups and abs(abs(factors[groups[-1][-1]]) - abs(factors[key])) < EQUAL:
            groups[-1].append(key)
        else:
            groups.append([key])
    asked = list(factors)
    return [(key, factors[key]) for group in groups for key in sorted(group, key=asked.index)]
