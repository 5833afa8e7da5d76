"""What a comparison with a measured record found, in sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drumsqueal.findings.signals.decibels import level_dB, level_reference
from drumsqueal.questions.compare.measured.record import parse_unit
from drumsqueal.scene.quantities import percent

if TYPE_CHECKING:
    from drumsqueal.questions.compare.study import MeasuredComparison, MeasuredLine

PRINTED = 12  # lines
LEAST_SHOWN = 1e-3  # percent


def zero_level(comparison: MeasuredComparison) -> str:
    """What 0 dB is, without the standard; empty where the two records have no unit in common."""
    return level_reference(comparison.amplitudes_in).amount if comparison.amplitudes_in else ""


def describe_levels(measured: str, simulated: str, unit: str, largest: tuple[float, float]) -> str:
    """What 0 dB is."""
    if unit:
        return f"levels are those of rms values, in dB re {level_reference(unit).written}"
    own = parse_unit(simulated)
    each = []
    for name, si, amplitude in (("measured", measured, largest[0]), ("simulated", own.si if own else "", largest[1])):
        reference = level_reference(si)
        level = f"{si} rms, {float(level_dB(amplitude, reference.rms)):.1f} dB re {reference.written}"
        each.append(f"{name} {amplitude / np.sqrt(2):.4g} {level if si else 'rms without a unit'}")
    return f"0 dB is the largest line of each record: {'; '.join(each)}"


def describe_unpaired(comparison: MeasuredComparison) -> list[str]:
    """What has no pair, and what the measured record cannot show."""
    sentences = []
    strays = [line for line in comparison.matched if not (line.simulated and line.simulated.paired)]
    if strays:
        sentences.append(f"Measured, not simulated: {_list([line.frequency_Hz for line in strays])} Hz")
    if comparison.not_measured:
        missed = [comparison.simulated.frequency_Hz[k] for k in comparison.not_measured]
        sentences.append(f"Simulated, not measured: {_list(missed)} Hz")
    named = [f"{mode.label} {mode.frequency_Hz:.0f} Hz" for mode in comparison.modes if mode.not_measurable]
    named += [f"the simulated {line.frequency_Hz:.0f} Hz" for line in comparison.simulated.lines if line.not_measurable]
    if named:
        nyquist = comparison.measured.sample_rate_Hz / 2
        sentences.append(f"Not measurable, at or above {nyquist:.6g} Hz: {', '.join(named)}")
    return sentences


def _list(frequencies: list[float]) -> str:
    some = ", ".join(f"{f:.1f}" for f in frequencies[:PRINTED])
    return some if len(frequencies) <= PRINTED else f"{some} and {len(frequencies) - PRINTED} more"


def describe_verdict(comparison: MeasuredComparison) -> str:
    """Where the strongest measured line lies, and how many lines are the same."""
    if not comparison.matched:
        return "No line of the measured record stands out of its noise."
    text = f"{_strongest(comparison, comparison.matched[0])}; {_from_modes(comparison, comparison.matched[0])}."
    total, harmonics = len(comparison.matched), sum(line.harmonic is not None for line in comparison.matched)
    of = f"Of {total} measured line{'s' if total > 1 else ''}"
    if harmonics:
        of += f", {harmonics} of them {'harmonics' if harmonics > 1 else 'a harmonic'},"
    paired = [line.simulated for line in comparison.matched if line.simulated and line.simulated.paired]
    if paired:
        most = 100 * max(abs(match.difference) for match in paired)
        has = "have" if len(paired) > 1 else "has"
        text += f" {of} {len(paired)} {has} a simulated one, {_percent(most)} apart at most;"
    else:
        text += f" {of} none has a simulated one within {100 * comparison.pairs_within:g} %;"
    return f"{text} by chance a line would have one with a probability of {100 * comparison.chance_of_a_pair:.0f} %."


def _strongest(comparison: MeasuredComparison, line: MeasuredLine) -> str:
    """What the strongest measured line is, and where the simulated one lies."""
    text, harmonic = f"The strongest measured line, {line.frequency_Hz:.1f} Hz,", line.harmonic
    if harmonic is not None and not harmonic.simulated:
        text += f" the {_ordinal(harmonic.order)} harmonic of {harmonic.fundamental_Hz:.1f} Hz,"
    if line.simulated is None:
        return f"{text} cannot be compared: the simulation has no line"
    if not line.simulated.paired:
        return f"{text} is not simulated"
    place = line.simulated.reference
    text += f" lies {_apart(line.simulated.difference)} the simulated {comparison.simulated.frequency_Hz[place]:.1f} Hz"
    if harmonic is not None and harmonic.simulated:
        text += f", the {_ordinal(harmonic.order)} harmonic of {harmonic.fundamental_Hz:.1f} Hz"
    return f"{text}, the strongest one too" if place == 0 else text


def _from_modes(comparison: MeasuredComparison, line: MeasuredLine) -> str:
    """How far the line, or the one that it is a harmonic of, lies from the nearest unstable mode."""
    unstable, harmonic = [mode for mode in comparison.modes if mode.unstable], line.harmonic
    if not unstable:
        return "no mode is unstable"
    if harmonic is not None and harmonic.simulated:
        return "its fundamental is not measured"
    frequency = line.frequency_Hz if harmonic is None else harmonic.fundamental_Hz
    mode = min(unstable, key=lambda mode: abs(mode.frequency_Hz - frequency))
    which = "" if harmonic is None else f"its fundamental, {frequency:.1f} Hz, lies "
    apart = _apart(frequency / mode.frequency_Hz - 1)
    return f"{which}{apart} the nearest unstable mode, {mode.label} at {mode.frequency_Hz:.1f} Hz"


def _ordinal(number: int) -> str:
    ending = "th" if 10 <= number % 100 <= 20 else {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number}{ending}"


def _apart(difference: float) -> str:
    if 100 * abs(difference) < LEAST_SHOWN:
        return "at"
    return f"{_percent(100 * abs(difference))} {'above' if difference > 0 else 'below'}"


def _percent(difference: float) -> str:
    return percent(difference / 100) if difference >= LEAST_SHOWN else "less than 0.001 %"
