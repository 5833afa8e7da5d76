"""What a comparison with a measured record found, in sentences."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from drumsqueal.findings.signals.sound import level_dB, level_reference
from drumsqueal.findings.signals.spectra import FAINTEST
from drumsqueal.questions.compare.record import QUANTITIES
from drumsqueal.scene.quantities import percent

if TYPE_CHECKING:
    from drumsqueal.files.history_file import SavedHistory
    from drumsqueal.questions.compare.study import MeasuredComparison, MeasuredLine, Spectral

PRINTED = 12  # lines
LEAST_SHOWN = 1e-5  # of a frequency


def zero_level(comparison: MeasuredComparison) -> str:
    """What 0 dB is, without the standard; empty where the two records have no unit in common."""
    return level_reference(comparison.amplitudes_in).amount if comparison.amplitudes_in else ""


def describe_record(record: Spectral) -> str:
    """Which part of a record was taken, and its resolution."""
    segments = "" if record.segments == 1 else f", mean of {record.segments} segments"
    part = f"{record.from_s:.4g} to {record.until_s:.4g} s at {record.sample_rate_Hz:.6g} Hz"
    return f"{part}, resolution {record.resolution_Hz:.3g} Hz{segments}"


def describe_levels(units: tuple[str, str], common: str, largest: tuple[float, float]) -> str:
    """What 0 dB is, for units and largest amplitudes of the measured and the simulated record."""
    if common:
        return f"levels are those of rms values, in dB re {level_reference(common).written}"
    each = []
    for name, unit, amplitude in zip(("measured", "simulated"), units, largest, strict=True):
        reference = level_reference(unit)
        level = f"{unit} rms, {float(level_dB(amplitude, reference.rms)):.1f} dB re {reference.written}"
        each.append(f"{name} {amplitude / np.sqrt(2):.4g} {level if unit else 'rms without a unit'}")
    return f"0 dB is the largest line of each record: {'; '.join(each)}"


def describe_simulation(saved: SavedHistory, unit: str, order: int, *, saturated: bool) -> list[str]:
    """What the simulated signal is not, and how it was brought to the measured unit."""
    notes = []
    if not saved.complete:
        notes.append(f"the run is incomplete ({saved.outcome})")
    if not saturated:
        notes.append(
            "the simulated motion reaches no contact boundary: its lines are those of linear motion, not of squeal"
        )
    if order:
        how = "differentiated" if order > 0 else "integrated"
        notes.append(f"the simulated signal is {how} to {QUANTITIES[unit]}, line by line")
    return notes


def describe_table(comparison: MeasuredComparison) -> str:
    """What the headings and signs in the table of measured lines mean."""
    shown = comparison.lines[:PRINTED]
    notes = ["Δf, ΔL: frequency and level of the measured line over those of the other"]
    if any(paired is False for line in shown for paired in (line.simulated_is_pair, line.mode_is_pair)):
        reason = f"more than {100 * comparison.pairs_within:g} % off, or taken by a stronger line"
        notes.append(f"in parentheses: the nearest, but no pair ({reason})")
    if any(line.harmonic_order for line in shown):
        notes.append("n × f: a harmonic of the line at f, and so of no mode")
    if any(line.fundamental_is_simulated for line in shown):
        notes.append("(n × f): of a simulated line that is not measured")
    faintest = f"{-20 * math.log10(FAINTEST):.0f} dB or more below the strongest of its record"
    notes.append(f"what is {faintest} is not listed, simulated or measured")
    return "; ".join(notes)


def describe_unpaired(comparison: MeasuredComparison) -> list[str]:
    """What has no pair, and what the measured record cannot show."""
    strays = [line.measured_Hz for line in comparison.lines if not line.simulated_is_pair]
    missed = [line.frequency_Hz for line in comparison.simulated_alone if not line.not_measurable]
    sentences = [f"Measured, not simulated: {_list(strays)} Hz"] if strays else []
    if missed:
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
    lines = comparison.lines
    if not lines:
        return "No line of the measured record stands out of its noise."
    text = f"{_strongest(comparison, lines[0])}; {_from_modes(comparison, lines[0])}."
    harmonics = sum(line.harmonic_order is not None for line in lines)
    of = f"Of {len(lines)} measured line{'s' if len(lines) > 1 else ''}"
    if harmonics:
        of += f", {harmonics} of them {'harmonics' if harmonics > 1 else 'a harmonic'},"
    apart = [abs(line.over_simulated or 0.0) for line in lines if line.simulated_is_pair]
    if apart:
        has = "have" if len(apart) > 1 else "has"
        text += f" {of} {len(apart)} {has} a simulated one, {_percent(max(apart))} apart at most;"
    else:
        text += f" {of} none has a simulated one within {100 * comparison.pairs_within:g} %;"
    return f"{text} by chance a line would have one with a probability of {100 * comparison.chance_of_a_pair:.0f} %."


def _strongest(comparison: MeasuredComparison, line: MeasuredLine) -> str:
    """What the strongest measured line is, and where the simulated one lies."""
    text = f"The strongest measured line, {line.measured_Hz:.1f} Hz,"
    harmonic = (
        f" the {_ordinal(line.harmonic_order)} harmonic of {line.fundamental_Hz:.1f} Hz" if line.harmonic_order else ""
    )
    if harmonic and not line.fundamental_is_simulated:
        text += f"{harmonic},"
    if line.over_simulated is None:
        return f"{text} cannot be compared: the simulation has no line"
    if not line.simulated_is_pair:
        return f"{text} is not simulated"
    text += f" lies {_apart(line.over_simulated)} the simulated {line.nearest_simulated_Hz:.1f} Hz"
    if harmonic and line.fundamental_is_simulated:
        text += f",{harmonic}"
    strongest = comparison.simulated.lines[0].frequency_Hz
    return f"{text}, the strongest one too" if line.nearest_simulated_Hz == strongest else text


def _from_modes(comparison: MeasuredComparison, line: MeasuredLine) -> str:
    """How far the line, or the one that it is a harmonic of, lies from the nearest unstable mode."""
    unstable = [mode for mode in comparison.modes if mode.unstable]
    if not unstable:
        return "no mode is unstable"
    if line.fundamental_is_simulated:
        return "its fundamental is not measured"
    frequency = line.fundamental_Hz or line.measured_Hz
    mode = min(unstable, key=lambda mode: abs(mode.frequency_Hz - frequency))
    which = f"its fundamental, {frequency:.1f} Hz, lies " if line.fundamental_Hz else ""
    apart = _apart(frequency / mode.frequency_Hz - 1)
    return f"{which}{apart} the nearest unstable mode, {mode.label} at {mode.frequency_Hz:.1f} Hz"


def _ordinal(number: int) -> str:
    ending = "th" if 10 <= number % 100 <= 20 else {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number}{ending}"


def _apart(difference: float) -> str:
    if abs(difference) < LEAST_SHOWN:
        return "at"
    return f"{_percent(abs(difference))} {'above' if difference > 0 else 'below'}"


def _percent(fraction: float) -> str:
    return percent(fraction) if fraction >= LEAST_SHOWN else "less than 0.001 %"
