"""What a fit found, in words."""

import math
from collections.abc import Sequence

from drumsqueal.questions.fit.found import Fit, FittedLine, FittedNumber
from drumsqueal.questions.fit.record import Kind

PRESENT = 0.1  # of a combination's largest exponent, from which a number is named in it
SHORT = 2e-3  # of a frequency that a search for squeal misses, from which it is reported
EXTREMES = "20 times or a twentieth of the scene's value"
POOR = 9.0  # χ² per degree of freedom: the lines are off by three times their uncertainty


def with_uncertainty(number: FittedNumber) -> str:
    """The fitted value and its 95 % interval, with the unit of the scene file."""
    unit = f" {number.unit}" if number.unit else ""
    if number.uncertainty is None:
        return f"{short(number.fitted_value, 3)}{unit}"
    return f"{value_to(number.fitted_value, number.uncertainty)} ± {short(number.uncertainty, 2)}{unit}"


def value_to(value: float, uncertainty: float) -> str:
    """A value with as many digits as two of its uncertainty need."""
    if not uncertainty or not value:
        return short(value, 6)
    return short(value, min(12, max(2, math.floor(math.log10(abs(value))) - math.floor(math.log10(uncertainty)) + 2)))


def short(value: float, digits: int) -> str:
    """1.3e8 for 1.30e+08."""
    text = f"{value:#.{digits}g}".rstrip(".")
    mantissa, e, exponent = text.partition("e")
    return f"{mantissa.rstrip('.')}e{int(exponent)}" if e else text


def describe_fit(fit: Fit) -> str:
    """The result in one or two sentences."""
    how = "eigenvalues" if fit.record_kind is Kind.LINEAR else "lines of the scene's squeal"
    used = [line for line in fit.lines if line.used]
    (before, rates_before), (after, rates_after) = (_furthest(used, which) for which in ("before", "after"))
    if rates_before:
        before, after = f"{before} in frequency and {rates_before} in growth rate", f"{after} and {rates_after}"
    was = f"the {how}, up to {before} off before, are now within {after} of the measured lines"
    if _misses(fit):
        was += f", which is still {_misses(fit)} times their uncertainty"
    known = [f"{number.key} = {with_uncertainty(number)}" for number in fit.determined]
    left = [number.key for number in fit.numbers if not number.determined]
    if not known:
        return f"The record determines none of {', '.join(left)}; {was}."
    text = f"The record gives {' and '.join([', '.join(known[:-1]), known[-1]] if known[1:] else known)}"
    text += f" (95 % confidence); {was}."
    return f"{text} Not determined: {', '.join(left)}." if left else text


def _misses(fit: Fit) -> str:
    """By how many times their uncertainty lines miss, where that is too much; else nothing."""
    chi = fit.chi_square_per_freedom
    return f"{math.sqrt(chi):.2g}" if chi is not None and chi > POOR else ""


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
    return frequency, f"{short(max(rates), 2)} 1/s" if rates else ""


def _percent(fraction: float) -> str:
    return f"{100 * fraction:.2g} %" if fraction >= 1e-5 else "0.001 %"


def describe_notes(fit: Fit) -> tuple[str, ...]:
    """What limits the fit: what is open, poor, ambiguous, or not used."""
    notes = [*map(_open, _combinations(fit))]
    count, varied = fit.observations, len(fit.numbers)
    used = sum(line.used for line in fit.lines)
    what = f"{used} line{'s' if used > 1 else ''}"
    rates = " with growth rates" if fit.record_kind is Kind.LINEAR else ""
    if count < varied:
        are = f"are {count} observations" if count > 1 else "is one observation"
        notes.append(f"{what}{rates} {are}, fewer than the {varied} numbers that vary")
    if any(not number.determined for number in fit.numbers):
        notes.append("what is not determined stays as near to the scene's values as the lines allow")
    if _misses(fit):
        miss = f"the lines still miss by {_misses(fit)} times their uncertainty: other numbers differ, too,"
        notes.append(f"{miss} or the model lacks something; the uncertainties are widened by that factor")
    explained = {key for each in _combinations(fit) for key in each} | {n.key for n in fit.numbers if n.at_bound}
    wide = [number.key for number in fit.numbers if not number.determined and number.key not in explained]
    if wide:
        why = "the lines are missed by more than their uncertainty, which widens that of a number too far"
        notes.append(f"{', '.join(wide)}: not determined, for {why}")
    if fit.chi_square_per_freedom is None:
        notes.append("there are no more observations than numbers, so nothing tests the fit")
    short_of = [line for line in fit.lines if line.used and abs(_off(line, "after_Hz")) > SHORT]
    if fit.record_kind is Kind.SATURATED and short_of:
        missed = ", ".join(f"{line.measured_Hz:.1f}" for line in short_of)
        notes.append(f"the search stopped short of {missed} Hz: the squeal jumps to another motion on the way there")
    if fit.ambiguous:
        notes.append(fit.ambiguous)
    bound = [number.key for number in fit.numbers if number.at_bound]
    if bound:
        notes.append(f"{', '.join(bound)}: not determined, at the end of what is tried, {EXTREMES}")
    unused = [f"{line.measured_Hz:.1f}" for line in fit.lines if not line.used]
    if unused:
        like = "near no mode" if fit.record_kind is Kind.LINEAR else "like none of the simulated squeal"
        notes.append(f"not used, {like}: {', '.join(unused)} Hz")
    if fit.reading is not None and fit.reading.left_out_Hz:
        left = ", ".join(f"{f:.1f}" for f in fit.reading.left_out_Hz[:6])
        notes.append(f"harmonics, combinations and faint lines, which are of no mode: {left} Hz")
    return tuple(notes)


def _combinations(fit: Fit) -> list[dict[str, float]]:
    """The open combinations, each with the numbers that take part in it alone."""
    found = []
    for each in fit.open_combinations:
        largest = max(map(abs, each.values()))
        found.append({key: value / largest for key, value in each.items() if abs(value) > PRESENT * largest})
    return found


def _open(combination: dict[str, float]) -> str:
    keys = list(combination)
    if len(keys) == 1:
        return f"{keys[0]} is not determined: the lines hardly depend on it"
    if len(keys) == 2:  # along (a, b) in logarithms p^b q^-a stays
        (p, a), (q, b) = combination.items()
        first, second = (p, b), (q, -a)
        if abs(first[1]) < abs(second[1]):
            first, second = second, first
        power = second[1] / first[1]
        fixed = f"what the lines fix is about {first[0]} × {second[0]}^{power:.2g}"
        return f"{keys[0]} and {keys[1]} are not told apart: {fixed}"
    return f"{', '.join(keys[:-1])} and {keys[-1]} are not told apart: the lines fix one combination fewer than numbers"
