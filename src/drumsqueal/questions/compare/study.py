"""A measured record beside a history: their lines, the eigenvalues' frequencies, and which are the same."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.files.saved_history import SavedHistory, read_history
from drumsqueal.findings.departure import first_edge
from drumsqueal.findings.saturation import saturated_part
from drumsqueal.findings.signals import Tones, find_harmonics, find_tones, level_dB, level_reference
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.questions.compare.matching import WIDEST, Match, match_lines, share_covered
from drumsqueal.questions.compare.measured.record import QUANTITIES, Measured, parse_unit
from drumsqueal.questions.export.signals import SURFACE, make_channels, names_of
from drumsqueal.scene import Scene
from drumsqueal.simulation import prepare
from drumsqueal.solve.linear.modes import Mode

LONGEST_SEGMENT = 1.0  # s: a line of squeal seldom keeps its frequency for longer than 1 Hz tells
FEWEST_SAMPLES = 64  # of the simulated part
FEWEST_IN_SEGMENT = 16  # of either record, in as much time as the shorter one lasts: a spectrum takes no fewer
LOWEST = 20.0  # Hz: what is slower is no sound, and drifts of a measurement are
FAMILIES = (("m", "m/s", "m/s^2"), ("rad", "rad/s", "rad/s^2"))  # a quantity and its rates


class Spectral(NamedTuple):
    """One of the two records: from when to when (s), its rate (Hz), and its tones; all amplitudes are in one unit."""

    start_s: float
    end_s: float
    sample_rate: float
    tones: Tones

    @property
    def frequency_Hz(self) -> NDArray[np.float64]:
        """Of its lines, strongest first."""
        return self.tones.peaks.frequency_Hz

    @property
    def amplitude(self) -> NDArray[np.float64]:
        """Of its lines, strongest first."""
        return self.tones.peaks.amplitude


class Overtone(NamedTuple):
    """Which multiple of which frequency (Hz) a line is, and whether that one is simulated, for it is not measured."""

    order: int
    fundamental_Hz: float
    simulated: bool


class MeasuredLine(NamedTuple):
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


class MeasuredComparison(NamedTuple):
    """What was measured beside what was simulated and predicted.

    `unit` is that of all amplitudes, "" where the two records have none in common; levels then are relative to each
    record's own largest line below `highest_Hz`, half the lower of the two sample rates, and otherwise to 1 `unit`. No
    pair is further apart than `within`, a share of the frequency. `references` are the rms values of 0 dB, measured
    and simulated. `lines` come strongest first.
    """

    scene: Scene
    source: Path
    measured_record: Measured
    signal: str
    unit: str
    references: tuple[float, float]
    saturated: bool
    measured: Spectral
    simulated: Spectral
    modes: tuple[Mode, ...]
    lines: tuple[MeasuredLine, ...]
    within: float
    told: tuple[str, ...]

    @property
    def highest_Hz(self) -> float:
        """What both records can hold (Hz)."""
        return min(self.measured.sample_rate, self.simulated.sample_rate) / 2

    @property
    def chance(self) -> float:
        """Share of the frequencies, up to the highest line of either record, at which a line would find a pair."""
        found = [float(f) for record in (self.measured, self.simulated) for f in record.frequency_Hz]
        highest = min(self.measured.sample_rate / 2, max(found, default=LOWEST) * (1 + self.within))
        return share_covered(self.simulated.frequency_Hz, LOWEST, highest, widest=self.within)

    @property
    def not_measured(self) -> tuple[int, ...]:
        """Simulated lines (indices) below half the measured sample rate that no measured one is."""
        paired = {line.simulated.reference for line in self.lines if line.simulated and line.simulated.paired}
        below = self.simulated.frequency_Hz < self.measured.sample_rate / 2
        return tuple(k for k in range(below.size) if below[k] and k not in paired)

    @property
    def out_of_reach(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Modes and simulated lines (indices) above half the measured sample rate, which it cannot show."""
        nyquist = self.measured.sample_rate / 2
        modes = tuple(k for k, mode in enumerate(self.modes) if mode.frequency_Hz >= nyquist)
        return modes, tuple(int(k) for k in np.flatnonzero(self.simulated.frequency_Hz >= nyquist))


def compare_measured(
    history: SavedHistory | Path | str, measured: Measured, signal: str = SURFACE, *, within: float = WIDEST
) -> MeasuredComparison:
    """Compare a measured record with a signal of a history, and with the eigenvalues of its scene.

    Of the history the saturated part is taken, or all of it where it reaches no edge. Both spectra are averaged over
    segments as long as the shorter record, 1 s at most. A simulated velocity is compared with a measured acceleration
    or displacement by 2πf, line by line. Pairs lie within the share `within` of the frequency. Raises RequestError for
    a signal that is not there or does not move, and for a history whose friction law is not in it.
    """
    saved = history if isinstance(history, SavedHistory) else read_history(Path(history))
    if saved.given_law:
        told = "its friction law was given in Python and is not in it, so that its eigenvalues are not known"
        raise RequestError(f"{saved.path}: {told}; run the scene with a law that it names")
    name = _one_signal(saved, signal)
    prepared = prepare(saved.scene)
    stop_if_interrupted()
    edge = first_edge(saved.data, prepared.stability, prepared.linear)
    time = saved.data["time"].values
    part = slice(0, time.size) if edge is None else saturated_part(time, edge)
    if part.stop - part.start < FEWEST_SAMPLES:
        raise RequestError(f"{saved.path}: {part.stop - part.start} samples of motion are too few; run it for longer")
    (channel,) = make_channels(saved, [name], part)
    values = channel.values
    if not np.ptp(values) > 0:
        raise RequestError(f"{saved.path}: {signal} does not move in this history; take another with --signal")
    if not measured.sample_rate > 2 * LOWEST:
        told = f"its sample rate, {measured.sample_rate:.6g} Hz, holds nothing that is heard, from {LOWEST:g} Hz on"
        raise RequestError(f"the measured {measured.name!r}: {told}; take a faster record, or mend --rate")
    segment = min(measured.duration_s, values.size / saved.sample_rate, LONGEST_SEGMENT)
    for which, rate in ((f"the measured {measured.name!r}", measured.sample_rate), (saved.path, saved.sample_rate)):
        if round(segment * rate) < FEWEST_IN_SEGMENT:
            told = f"{round(segment * rate)} samples in {segment:.4g} s, as long as the shorter record, are too few"
            raise RequestError(f"{which}: {told} at {rate:.6g} Hz; take longer records, or mend --rate")
    found = find_tones(measured.values, measured.sample_rate, segment=segment, lowest=LOWEST)
    stop_if_interrupted()
    unit, order = common_unit(channel.units, measured.unit)
    tones = find_tones(values, saved.sample_rate, segment=segment, lowest=LOWEST, order=order)
    ends = (measured.start_s, measured.start_s + (measured.values.size - 1) / measured.sample_rate)
    records = (
        Spectral(*ends, measured.sample_rate, found),
        Spectral(float(time[part][0]), float(time[part][-1]), saved.sample_rate, tones),
    )
    largest = _largest(*records)
    zero = (level_reference(unit).rms,) * 2 if unit else (largest[0] / np.sqrt(2), largest[1] / np.sqrt(2))
    references = (float(zero[0]), float(zero[1]))
    return MeasuredComparison(
        scene=saved.scene,
        source=saved.path,
        measured_record=measured,
        signal=signal,
        unit=unit,
        references=references,
        saturated=edge is not None,
        measured=records[0],
        simulated=records[1],
        modes=prepared.stability.modes,
        lines=_matched(*records, prepared.stability.modes, references, within),
        within=within,
        told=(_told_levels(measured.unit, channel.units, unit, largest), *_told(saved, measured, edge, unit, order)),
    )


def _one_signal(saved: SavedHistory, signal: str) -> str:
    """The name of the one signal that is asked for, as `drumsqueal export` names them."""
    try:
        names, _ = names_of([signal], saved)
    except RequestError as error:
        raise RequestError(str(error).replace("--signals", "--signal", 1)) from None
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
    highest = min(measured.sample_rate, simulated.sample_rate) / 2
    found = []
    for record in (measured, simulated):
        common = record.amplitude[record.frequency_Hz < highest]
        spectrum = record.tones.spectrum
        seen = (spectrum.frequency_Hz >= LOWEST) & (spectrum.frequency_Hz < highest)
        found.append(float(common.max() if common.size else spectrum.amplitude[seen].max(initial=0.0)))
    return found[0] or 1.0, found[1] or 1.0


def _matched(
    measured: Spectral, simulated: Spectral, modes: tuple[Mode, ...], references: tuple[float, float], within: float
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


def _told_levels(measured: str, simulated: str, unit: str, largest: tuple[float, float]) -> str:
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


def _told(saved: SavedHistory, measured: Measured, edge: float | None, unit: str, order: int) -> tuple[str, ...]:
    told = list(measured.told)
    if not saved.complete:
        told.append(f"the run did not get to its end ({saved.outcome})")
    if edge is None:
        told.append("the simulated motion reaches no edge: its lines are those of linear motion, not of squeal")
    if order:
        quantity = QUANTITIES[unit]
        how = "differentiated" if order > 0 else "integrated"
        told.append(f"the simulated signal is {how} to {quantity}, line by line")
    return tuple(told)
