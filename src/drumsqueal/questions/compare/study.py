"""A measured record compared with a history: their lines, the eigenvalues' frequencies, and which are the same."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from drumsqueal.errors import RequestError
from drumsqueal.files.saved_history import SavedHistory, read_history
from drumsqueal.findings.saturation import saturated_part
from drumsqueal.findings.schema import Finding, Findings, Held, InMemory
from drumsqueal.findings.signals.decibels import level_dB, level_reference
from drumsqueal.findings.signals.tones import Tones, find_harmonics, find_tones
from drumsqueal.findings.vibration import first_boundary_time
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.compare.matching import WIDEST, Match, fraction_covered, match_lines
from drumsqueal.questions.compare.measured.record import QUANTITIES, Measured, parse_unit
from drumsqueal.questions.compare.words import describe_levels, describe_verdict
from drumsqueal.questions.export.signals import SURFACE, make_channels, names_of
from drumsqueal.simulation import prepare

LONGEST_SEGMENT = 1.0  # s: a line of squeal seldom keeps its frequency for longer than 1 Hz tells
FEWEST_SAMPLES = 64  # of the simulated part
FEWEST_IN_SEGMENT = 16  # of either record, in as much time as the shorter one lasts: a spectrum takes no fewer
LOWEST = 20.0  # Hz: what is slower is no sound, and drifts of a measurement are
FAMILIES = (("m", "m/s", "m/s^2"), ("rad", "rad/s", "rad/s^2"))  # a quantity and its rates


class Spectral(Finding):
    """One of the two records: from when to when (s), its rate (Hz), and its tones; all amplitudes are in one unit."""

    from_s: float
    until_s: float
    sample_rate_Hz: float
    resolution_Hz: float
    segments: int
    tones: InMemory[Tones] = Held

    @property
    def frequency_Hz(self) -> NDArray[np.float64]:
        """Of its lines, strongest first."""
        return self.tones.peaks.frequency_Hz

    @property
    def amplitude(self) -> NDArray[np.float64]:
        """Of its lines, strongest first."""
        return self.tones.peaks.amplitude


class MeasuredRecord(Spectral):
    """The measured record, its channel, and what that measures in which unit, as far as it is known."""

    file: str
    channel: str
    quantity: str | None
    unit: str | None
    short_name: str = Field(default="", exclude=True)


class SimulatedLine(Finding):
    """A simulated line, and whether it is at or above half the measured sample rate."""

    frequency_Hz: float
    amplitude: float
    not_measurable: bool


class SimulatedRecord(Spectral):
    """The compared part of the history: the saturated one, or all of it where no contact boundary is reached."""

    file: str
    signal: str
    saturated: bool
    lines: tuple[SimulatedLine, ...]


class ComparedMode(Finding):
    """A mode, and whether it is at or above half the measured sample rate."""

    label: str
    frequency_Hz: float
    growth_rate_1_per_s: float
    unstable: bool
    not_measurable: bool
    name: str = Field(default="", exclude=True)


@dataclass(frozen=True)
class Overtone:
    """Which multiple of which frequency (Hz) a line is, and whether that one is simulated, for it is not measured."""

    order: int
    fundamental_Hz: float
    simulated: bool


@dataclass(frozen=True)
class MeasuredLine:
    """A measured line: its level (dB), the nearest eigenvalue and the nearest simulated line, level over the latter's.

    `level_difference_dB` is None where the line has no simulated one as its pair. A harmonic of another line is none of
    a mode: its `mode` is None.
    """

    frequency_Hz: float
    amplitude: float
    level_dB: float
    harmonic: Overtone | None
    mode: Match | None
    simulated: Match | None
    level_difference_dB: float | None


class MeasuredComparison(Findings):
    """What was measured compared with what was simulated and predicted.

    `amplitudes_in` is the unit of all amplitudes, None where the two records have none in common; levels then are
    relative to each record's own largest line that both can hold, and otherwise to 1 unit: `rms_of_0_dB`. No pair is
    further apart than `pairs_within`, a fraction of the frequency; `chance_of_a_pair` is the fraction of the
    frequencies, up to the highest line of either record, at which a line would find one. `matched` are the measured
    lines, the strongest first, and `lines` a row for each.
    """

    verdict: str = ""
    measured: MeasuredRecord
    simulated: SimulatedRecord
    amplitudes_in: str | None
    rms_of_0_dB: dict[str, float]
    pairs_within: float
    chance_of_a_pair: float
    lowest_frequency_Hz: float = LOWEST
    lines: tuple[dict[str, Any], ...]
    modes: tuple[ComparedMode, ...]
    notes: tuple[str, ...]
    matched: InMemory[tuple[MeasuredLine, ...]] = Field(default=(), exclude=True)

    @property
    def not_measured(self) -> list[int]:
        """Simulated lines (indices) below half the measured sample rate that no measured one is."""
        paired = {line.simulated.reference for line in self.matched if line.simulated and line.simulated.paired}
        lines = self.simulated.lines
        return [k for k, line in enumerate(lines) if not line.not_measurable and k not in paired]


def compare_measured(
    history: SavedHistory | Path | str,
    measured: Measured,
    signal: str = SURFACE,
    *,
    within: float = WIDEST,
    file: Path | str = "",
    progress: Progress = silent,
) -> MeasuredComparison:
    """Compare a measured record with a signal of a history, and with the eigenvalues of its scene.

    Of the history the saturated part is taken, or all of it where it reaches no contact boundary. Both spectra are
    averaged over segments as long as the shorter record, 1 s at most. A simulated velocity is compared with a measured
    acceleration or displacement by 2πf, line by line. Pairs lie within the fraction `within` of the frequency. `file`
    is the name of the measured one. Raises RequestError for a signal that is not there or does not move, and for a
    history whose friction law is not in it.
    """
    saved = history if isinstance(history, SavedHistory) else read_history(Path(history))
    if saved.given_law:
        why = "its friction law was given in Python and is not in it, so that its eigenvalues are not known"
        raise RequestError(f"{saved.path}: {why}; run the scene with a law that it names")
    name = _one_signal(saved, signal)
    progress("eigenvalues", 0.0, None)
    prepared = prepare(saved.scene)
    progress("spectra", 0.0, None)
    boundary = first_boundary_time(saved.data, prepared.stability, prepared.linear)
    time = saved.data["time"].values
    part = slice(0, time.size) if boundary is None else saturated_part(time, boundary)
    if part.stop - part.start < FEWEST_SAMPLES:
        raise RequestError(f"{saved.path}: {part.stop - part.start} samples of motion are too few; run it for longer")
    (channel,) = make_channels(saved, [name], part)
    values = channel.values
    if not np.ptp(values) > 0:
        raise RequestError(f"{saved.path}: {signal} does not move in this history; take another with --signal")
    if not measured.sample_rate > 2 * LOWEST:
        why = f"its sample rate, {measured.sample_rate:.6g} Hz, holds nothing that is heard, from {LOWEST:g} Hz on"
        raise RequestError(f"the measured {measured.name!r}: {why}; take a faster record, or mend --rate")
    segment = min(measured.duration_s, values.size / saved.sample_rate, LONGEST_SEGMENT)
    for which, rate in ((f"the measured {measured.name!r}", measured.sample_rate), (saved.path, saved.sample_rate)):
        if round(segment * rate) < FEWEST_IN_SEGMENT:
            why = f"{round(segment * rate)} samples in {segment:.4g} s, as long as the shorter record, are too few"
            raise RequestError(f"{which}: {why} at {rate:.6g} Hz; take longer records, or mend --rate")
    found = find_tones(measured.values, measured.sample_rate, segment=segment, lowest=LOWEST)
    progress("spectra", 0.0, None)
    unit, order = common_unit(channel.units, measured.unit)
    tones = find_tones(values, saved.sample_rate, segment=segment, lowest=LOWEST, order=order)
    nyquist = measured.sample_rate / 2
    there = MeasuredRecord(
        **_spectral(measured.start_s, (measured.values.size - 1) / measured.sample_rate, measured.sample_rate, found),
        file=str(file),
        channel=measured.name,
        quantity=measured.quantity or None,
        unit=measured.unit or None,
        short_name=measured.short_name,
    )
    here = SimulatedRecord(
        **_spectral(float(time[part][0]), float(time[part][-1] - time[part][0]), saved.sample_rate, tones),
        file=str(saved.path),
        signal=signal,
        saturated=boundary is not None,
        lines=tuple(
            SimulatedLine(frequency_Hz=f, amplitude=a, not_measurable=bool(f >= nyquist))
            for f, a in zip(tones.peaks.frequency_Hz, tones.peaks.amplitude, strict=True)
        ),
    )
    modes = tuple(
        ComparedMode(
            label=mode.label,
            frequency_Hz=mode.frequency_Hz,
            growth_rate_1_per_s=mode.growth_rate,
            unstable=mode.unstable,
            not_measurable=mode.frequency_Hz >= nyquist,
            name=mode.name,
        )
        for mode in prepared.stability.modes
    )
    largest = _largest(there, here)
    zero = (level_reference(unit).rms,) * 2 if unit else (largest[0] / np.sqrt(2), largest[1] / np.sqrt(2))
    references = (float(zero[0]), float(zero[1]))
    frequencies = [*there.frequency_Hz.tolist(), *here.frequency_Hz.tolist()]
    highest = min(nyquist, max(frequencies, default=LOWEST) * (1 + within))
    matched = _matched(there, here, modes, references, within)
    comparison = MeasuredComparison(
        scene=saved.scene,
        measured=there,
        simulated=here,
        amplitudes_in=unit or None,
        rms_of_0_dB={"measured": references[0], "simulated": references[1]},
        pairs_within=within,
        chance_of_a_pair=fraction_covered(here.frequency_Hz, LOWEST, highest, widest=within),
        lines=(),
        modes=modes,
        notes=(
            describe_levels(measured.unit, channel.units, unit, largest),
            *_notes(saved, measured, boundary, unit, order),
        ),
        matched=matched,
    )
    rows = tuple(line_row(comparison, line) for line in matched)
    return comparison.model_copy(update={"lines": rows, "verdict": describe_verdict(comparison)})


def _spectral(start: float, duration: float, rate: float, tones: Tones) -> dict[str, Any]:
    return {
        "from_s": start,
        "until_s": start + duration,
        "sample_rate_Hz": rate,
        "resolution_Hz": tones.spectrum.resolution_Hz,
        "segments": tones.segments,
        "tones": tones,
    }


def line_row(comparison: MeasuredComparison, line: MeasuredLine | None) -> dict[str, Any]:
    """A measured line, the nearest simulated one and the nearest mode as a row; differences are measured over the other
    less 1. Without a line the row is empty.
    """
    simulated, mode = (None, None) if line is None else (line.simulated, line.mode)
    return {
        "line": "measured",
        "measured_Hz": line and line.frequency_Hz,
        "amplitude": line and line.amplitude,
        "unit": comparison.measured.unit or "",
        "level_dB" if comparison.amplitudes_in else "level_dB_re_largest": line and line.level_dB,
        "rms_of_0_dB": line and comparison.rms_of_0_dB["measured"],
        "harmonic_order": line and line.harmonic and line.harmonic.order,
        "fundamental_Hz": line and line.harmonic and line.harmonic.fundamental_Hz,
        "fundamental_is_simulated": line and line.harmonic and line.harmonic.simulated,
        "nearest_simulated_Hz": simulated and comparison.simulated.lines[simulated.reference].frequency_Hz,
        "over_simulated": simulated and simulated.difference,
        "simulated_is_pair": simulated and simulated.paired,
        "level_over_simulated_dB": line and line.level_difference_dB,
        "nearest_mode": mode and comparison.modes[mode.reference].label,
        "nearest_mode_Hz": mode and comparison.modes[mode.reference].frequency_Hz,
        "over_mode": mode and mode.difference,
        "mode_is_pair": mode and mode.paired,
    }


def _one_signal(saved: SavedHistory, signal: str) -> str:
    """The name of the one signal that is asked for, as `drumsqueal export` names them."""
    names, _ = names_of([signal], saved, option="--signal")
    if len(names) != 1:
        raise RequestError(f"--signal {signal}: there are several such, {', '.join(names)}; take one of them")
    return names[0]


def common_unit(simulated: str, measured: str) -> tuple[str, int]:
    """The measured unit and how often the simulated signal is to be differentiated for it; "" and 0 if it has none.

    A negative number asks for integration.
    """
    own = parse_unit(simulated)
    if own is None or not measured:
        return "", 0
    if own.si == measured:
        return measured, 0
    for family in FAMILIES:
        if own.si in family and measured in family:
            return measured, family.index(measured) - family.index(own.si)
    return "", 0


def _largest(measured: Spectral, simulated: Spectral) -> tuple[float, float]:
    """Amplitude of the largest line of each that both can hold; without one, of the spectrum."""
    highest = min(measured.sample_rate_Hz, simulated.sample_rate_Hz) / 2
    found = []
    for record in (measured, simulated):
        common = record.amplitude[record.frequency_Hz < highest]
        spectrum = record.tones.spectrum
        seen = (spectrum.frequency_Hz >= LOWEST) & (spectrum.frequency_Hz < highest)
        found.append(float(common.max() if common.size else spectrum.amplitude[seen].max(initial=0.0)))
    return found[0] or 1.0, found[1] or 1.0


def _matched(
    measured: Spectral,
    simulated: Spectral,
    modes: tuple[ComparedMode, ...],
    references: tuple[float, float],
    within: float,
) -> tuple[MeasuredLine, ...]:
    # Relative to the largest: a gain that both records share, or do not, is no reason to part their lines.
    largest = _largest(measured, simulated)
    levels = (20 * np.log10(measured.amplitude / largest[0]), 20 * np.log10(simulated.amplitude / largest[1]))
    to_lines = match_lines(measured.frequency_Hz, simulated.frequency_Hz, widest=within, levels=levels)
    overtones = _overtones(measured, simulated, to_lines)
    own = [k for k, overtone in enumerate(overtones) if overtone is None]
    matches = match_lines(measured.frequency_Hz[own], [mode.frequency_Hz for mode in modes], widest=within)
    to_modes = dict(zip(own, matches, strict=True))
    rows = []
    for k, (frequency, amplitude) in enumerate(zip(measured.frequency_Hz, measured.amplitude, strict=True)):
        level, line = float(level_dB(amplitude, references[0])), to_lines[k]
        difference = None
        if line is not None and line.paired:
            difference = level - float(level_dB(simulated.amplitude[line.reference], references[1]))
        rows.append(
            MeasuredLine(float(frequency), float(amplitude), level, overtones[k], to_modes.get(k), line, difference)
        )
    return tuple(rows)


def _overtones(measured: Spectral, simulated: Spectral, to_lines: list[Match | None]) -> list[Overtone | None]:
    """Which measured lines are harmonics: of a measured one or, where that is not measured, by their simulated pair."""
    found, theirs = (
        find_harmonics(record.frequency_Hz, record.amplitude, record.tones.spectrum.resolution_Hz)
        for record in (measured, simulated)
    )
    taken = {match.reference for match in to_lines if match is not None and match.paired}
    overtones: list[Overtone | None] = []
    for harmonic, match in zip(found, to_lines, strict=True):
        pair = theirs[match.reference] if match is not None and match.paired else None
        if harmonic is not None:
            overtones.append(Overtone(harmonic.order, float(measured.frequency_Hz[harmonic.fundamental]), False))
        elif pair is not None and pair.fundamental not in taken:
            overtones.append(Overtone(pair.order, float(simulated.frequency_Hz[pair.fundamental]), True))
        else:
            overtones.append(None)
    return overtones


def _notes(saved: SavedHistory, measured: Measured, boundary: float | None, unit: str, order: int) -> tuple[str, ...]:
    notes = list(measured.remarks)
    if not saved.complete:
        notes.append(f"the run is incomplete ({saved.outcome})")
    if boundary is None:
        notes.append(
            "the simulated motion reaches no contact boundary: its lines are those of linear motion, not of squeal"
        )
    if order:
        quantity = QUANTITIES[unit]
        how = "differentiated" if order > 0 else "integrated"
        notes.append(f"the simulated signal is {how} to {quantity}, line by line")
    return tuple(notes)
