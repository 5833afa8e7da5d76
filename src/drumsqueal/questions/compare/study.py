"""A measured record compared with a history: their lines, the eigenvalues' frequencies, and which are the same."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import AliasChoices, Field, field_serializer

from drumsqueal.errors import RequestError
from drumsqueal.files.history_file import SavedHistory, read_history
from drumsqueal.findings.columns import Column, signed
from drumsqueal.findings.saturation import saturated_part
from drumsqueal.findings.schema import Finding, Findings, Held, InMemory
from drumsqueal.findings.signals.sound import level_dB, level_reference
from drumsqueal.findings.signals.spectra import FAINTEST, Tones, find_harmonics, find_tones
from drumsqueal.findings.vibration import first_boundary_time
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.compare.record import FASTER, QUANTITIES, Measured, parse_unit
from drumsqueal.questions.export.signals import default_signal, make_channels, names_of
from drumsqueal.scene.quantities import percent
from drumsqueal.simulation import prepare

LOWEST = 20.0  # Hz: below it there is no sound, but there are drifts of a measurement
FAMILIES = (("m", "m/s", "m/s^2"), ("rad", "rad/s", "rad/s^2"))  # a quantity and its rates
WIDEST = 0.05  # relative: what lies further apart is not the same line
# Levels that differ by so much part two lines as much as frequencies that differ by WIDEST do: a strong line is rather
# the strong one next to it than a faint one nearer by, unless the levels are those of quite another point.
APART_DB = 40.0


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


class MeasuredLine(Finding):
    """A measured line, the nearest simulated line and the nearest mode, and whether each of them is its pair.

    Differences are measured over simulated or predicted, less 1. Where the two records have no unit in common,
    `level_dB` is relative to the largest line and is called `level_dB_re_largest` in files. A harmonic of a measured
    line, or of a simulated one that is not measured, is compared with no mode.
    """

    line: str = "measured"
    measured_Hz: Annotated[float, Column("measured", ".2f")]
    amplitude: float
    unit: str
    level_dB: Annotated[float, Column("level\ndB re\n{zero}", ".1f", unit="")] = Field(
        validation_alias=AliasChoices("level_dB", "level_dB_re_largest")
    )
    rms_of_0_dB: float
    harmonic_order: int | None = None
    fundamental_Hz: float | None = None
    fundamental_is_simulated: bool | None = None
    nearest_simulated_Hz: float | None = None
    over_simulated: float | None = None
    simulated_is_pair: bool | None = None
    level_over_simulated_dB: Annotated[float | None, Column("ΔL from\nsimulated", "+.1f")] = None
    nearest_mode: str | None = None
    nearest_mode_Hz: float | None = None
    over_mode: float | None = None
    mode_is_pair: bool | None = None
    columns: ClassVar = (
        *("measured_Hz", "level_dB", "simulated", "from_simulated", "level_over_simulated_dB"),
        *("mode_or_harmonic", "from_mode"),
    )

    @property
    def simulated(self) -> Annotated[str, Column("simulated", ">", unit="Hz")]:
        """The nearest simulated line, in parentheses where it is no pair, and so are the other cells."""
        return _in_parentheses(self.nearest_simulated_Hz, ".2f", self.simulated_is_pair)

    @property
    def from_simulated(self) -> Annotated[str, Column("Δf from\nsimulated", ">", unit="%")]:
        """How far the measured line lies from that."""
        return _off(self.over_simulated, self.simulated_is_pair)

    @property
    def mode_or_harmonic(self) -> Annotated[str, Column("mode or\nharmonic, Hz", ">")]:
        """The nearest mode or, of a harmonic, its order and the line that it is one of."""
        if self.harmonic_order:
            harmonic = f"{self.harmonic_order} × {self.fundamental_Hz:.2f}"
            return f"({harmonic})" if self.fundamental_is_simulated else harmonic
        name = f"{self.nearest_mode} " if self.nearest_mode else ""
        return _in_parentheses(self.nearest_mode_Hz, ".2f", self.mode_is_pair, name)

    @property
    def from_mode(self) -> Annotated[str, Column("Δf from\nmode", ">", unit="%")]:
        """How far the measured line lies from that mode."""
        return _off(self.over_mode, self.mode_is_pair)


def _in_parentheses(value: float | None, digits: str, paired: bool | None, name: str = "") -> str:
    text = "" if value is None else f"{name}{signed(value, digits)}"
    return f"({text})" if text and not paired else text


def _off(difference: float | None, paired: bool | None) -> str:
    return _in_parentheses(difference and 100 * difference, "+.3f" if paired else "+.1f", paired)


class MeasuredComparison(Findings):
    """What was measured compared with what was simulated and predicted.

    `amplitudes_in` is the unit of all amplitudes, None where the two records have none in common; levels then are
    relative to each record's own largest line that both can hold, and otherwise to 1 unit: `rms_of_0_dB`. No pair is
    further apart than `pairs_within`, a fraction of the frequency; `chance_of_a_pair` is the fraction of the
    frequencies, up to the highest line of either record, at which a line would find one. `lines` are the measured
    ones, strongest first.
    """

    printed_by = "drumsqueal.questions.compare.answer.print_comparison"
    verdict: str = ""
    measured: MeasuredRecord
    simulated: SimulatedRecord
    amplitudes_in: str | None
    rms_of_0_dB: dict[str, float]
    pairs_within: float
    chance_of_a_pair: float
    lowest_frequency_Hz: float = LOWEST
    lines: tuple[MeasuredLine, ...]
    modes: tuple[ComparedMode, ...]
    notes: tuple[str, ...]

    @property
    def columns(self) -> dict[str, str]:
        """The names of what is known of a measured line, and what they are in files."""
        level = "level_dB" if self.amplitudes_in else "level_dB_re_largest"
        return {name: name for name in MeasuredLine.model_fields} | {"level_dB": level}

    @field_serializer("lines")
    def rows(self, lines: tuple[MeasuredLine, ...]) -> list[dict[str, Any]]:
        """Measured lines as in files."""
        return [{written: getattr(line, name) for name, written in self.columns.items()} for line in lines]

    @property
    def simulated_alone(self) -> list[SimulatedLine]:
        """Simulated lines that are the pair of no measured one."""
        paired = {line.nearest_simulated_Hz for line in self.lines if line.simulated_is_pair}
        return [line for line in self.simulated.lines if line.frequency_Hz not in paired]


# Lines of two records paired one to one; none is forced into a pair.


@dataclass(frozen=True)
class Match:
    """The reference that a line goes with (an index), measured over reference less 1, and whether they are a pair.

    Where they are none it is the reference nearest in frequency.
    """

    reference: int
    difference: float
    paired: bool


def match_lines(
    lines: ArrayLike,
    references: ArrayLike,
    *,
    widest: float = WIDEST,
    levels: tuple[ArrayLike, ArrayLike] | None = None,
) -> list[Match | None]:
    """Pair lines (Hz), the strongest first, with reference frequencies (Hz); None for each where there is no reference.

    Each line in turn takes, among the references that are left within `widest` of their frequency, the one with the
    smallest

        |f/f_r − 1| / WIDEST + |L − L_r| / APART_DB,

    the second term only where `levels` (dB) of lines and references are given.
    """
    found, known = np.asarray(lines, dtype=np.float64), np.asarray(references, dtype=np.float64)
    if not known.size:
        return [None] * found.size
    own, theirs = (np.asarray(level, dtype=np.float64) for level in levels or (found * 0, known * 0))
    free = np.ones(known.size, dtype=bool)
    matches: list[Match | None] = []
    for line, level in zip(found, own, strict=True):
        difference = line / known - 1
        open_to = free & (np.abs(difference) <= widest)
        cost = np.abs(difference) / WIDEST + np.abs(level - theirs) / APART_DB
        best = int(np.argmin(np.where(open_to, cost, np.inf)) if open_to.any() else np.argmin(np.abs(difference)))
        free[best] &= not open_to[best]
        matches.append(Match(best, float(difference[best]), bool(open_to[best])))
    return matches


def fraction_covered(references: ArrayLike, lowest: float, highest: float, *, widest: float = WIDEST) -> float:
    """The fraction of the frequencies from lowest to highest (Hz) that lie within `widest` of a reference.

    It is the probability that a line which has nothing to do with the references finds one all the same.
    """
    covered, reached = 0.0, lowest
    for reference in np.sort(np.asarray(references, dtype=np.float64)):
        begin, end = max(reached, reference * (1 - widest)), min(highest, reference * (1 + widest))
        if end > begin:
            covered, reached = covered + end - begin, end
    return covered / (highest - lowest) if highest > lowest else 0.0


def compare_measured(
    history: SavedHistory | Path | str,
    measured: Measured,
    signal: str | None = None,
    *,
    within: float = WIDEST,
    file: Path | str = "",
    progress: Progress = silent,
) -> MeasuredComparison:
    """Compare a measured record with a signal of a history (see `default_signal`), and with its scene's eigenvalues.

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
    signal = signal or default_signal(saved)
    names, _ = names_of([signal], saved, option="--signal")
    if len(names) != 1:
        raise RequestError(f"--signal {signal}: there are several such, {', '.join(names)}; take one of them")
    progress("eigenvalues", 0.0, None)
    prepared = prepare(saved.scene)
    progress("spectra", 0.0, None)
    boundary = first_boundary_time(saved.data, prepared.stability, prepared.linear)
    simulated = _simulated_record(saved, names[0], boundary)
    segment = _segment(measured, simulated, saved.path)
    unit, order = common_unit(simulated.unit, measured.unit)
    nyquist = measured.sample_rate / 2
    there = MeasuredRecord(
        **_spectral(measured, segment),
        file=str(file),
        channel=measured.name,
        quantity=measured.quantity or None,
        unit=measured.unit or None,
        short_name=measured.short_name,
    )
    progress("spectra", 0.0, None)
    found = _spectral(simulated, segment, order)
    here = SimulatedRecord(
        **found,
        file=str(saved.path),
        signal=signal,
        saturated=boundary is not None,
        lines=tuple(
            SimulatedLine(frequency_Hz=f, amplitude=a, not_measurable=f >= nyquist)
            for f, a in np.transpose(found["tones"].peaks).tolist()
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
    if all(each.not_measurable for each in (*modes, *here.lines)):
        why = f"a sample rate of {measured.sample_rate:.6g} Hz is too low for every mode and every simulated line"
        raise RequestError(f"the measured {measured.name!r}: {why}; {FASTER}")
    largest = _largest(there, here)
    zero = [level_reference(unit).rms] * 2 if unit else [amplitude / float(np.sqrt(2)) for amplitude in largest]
    references: dict[str, float] = dict(zip(("measured", "simulated"), zero, strict=True))
    highest = min(nyquist, max([*there.frequency_Hz, *here.frequency_Hz], default=LOWEST) * (1 + within))
    comparison = MeasuredComparison(
        scene=saved.scene,
        measured=there,
        simulated=here,
        amplitudes_in=unit or None,
        rms_of_0_dB=references,
        pairs_within=within,
        chance_of_a_pair=fraction_covered(here.frequency_Hz, LOWEST, highest, widest=within),
        lines=_compared_lines(there, here, modes, references, within),
        modes=modes,
        notes=(
            describe_levels((measured.unit, simulated.unit), unit, largest),
            *measured.remarks,
            *describe_simulation(saved, unit, order, saturated=boundary is not None),
        ),
    )
    return comparison.model_copy(update={"verdict": describe_verdict(comparison)})


def _simulated_record(saved: SavedHistory, name: str, boundary: float | None) -> Measured:
    """The signal after saturation, or all of it without a contact boundary (s). Raises RequestError."""
    time = saved.data["time"].values
    part = slice(0, time.size) if boundary is None else saturated_part(time, boundary)
    if part.stop - part.start < 64:  # samples
        raise RequestError(f"{saved.path}: {part.stop - part.start} samples of motion are too few; run it for longer")
    (channel,) = make_channels(saved, [name], part)
    if not np.ptp(channel.values) > 0:
        raise RequestError(f"{saved.path}: {name} does not move in this history; take another with --signal")
    unit = parse_unit(channel.units)
    start = float(time[part.start])
    return Measured(name, unit.si if unit else "", saved.sample_rate, start, channel.values, ())


def _segment(measured: Measured, simulated: Measured, path: Path) -> float:
    """How long the segments (s) of both spectra are. Raises RequestError for records without a spectrum in common."""
    if not measured.sample_rate > 2 * LOWEST:
        why = f"its sample rate, {measured.sample_rate:.6g} Hz, is too low for sound, from {LOWEST:g} Hz on"
        raise RequestError(f"the measured {measured.name!r}: {why}; {FASTER}")
    # 1.0 s: a squeal frequency seldom stays within 1 Hz for longer
    segment = min(measured.duration_s, simulated.duration_s, 1.0)
    for which, rate in ((f"the measured {measured.name!r}", measured.sample_rate), (path, simulated.sample_rate)):
        # 16 of either record, in as much time as the shorter one lasts: a spectrum takes no fewer
        if round(segment * rate) < 16:
            why = f"{round(segment * rate)} samples in {segment:.4g} s, as long as the shorter record, are too few"
            raise RequestError(f"{which}: {why} at {rate:.6g} Hz; take longer records, or correct --rate")
    return segment


def _spectral(record: Measured, segment: float, order: int = 0) -> dict[str, Any]:
    """The fields of a record's spectrum; of an order as `find_tones` has it."""
    tones = find_tones(record.values, record.sample_rate, segment=segment, lowest=LOWEST, order=order)
    return {
        "from_s": record.start_s,
        "until_s": record.start_s + (record.values.size - 1) / record.sample_rate,
        "sample_rate_Hz": record.sample_rate,
        "resolution_Hz": tones.spectrum.resolution_Hz,
        "segments": tones.segments,
        "tones": tones,
    }


def common_unit(simulated: str, measured: str) -> tuple[str, int]:
    """The measured unit and how often the simulated signal is to be differentiated for it; "" and 0 if it has none.

    Both are SI units, "" where there is none. A negative number asks for integration.
    """
    for family in (*FAMILIES, (measured,)):
        if measured and measured in family and simulated in family:
            return measured, family.index(measured) - family.index(simulated)
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


def _compared_lines(
    measured: MeasuredRecord,
    simulated: SimulatedRecord,
    modes: tuple[ComparedMode, ...],
    references: dict[str, float],
    within: float,
) -> tuple[MeasuredLine, ...]:
    # Relative to the largest: a gain, be it of one record or of both, is no reason to part their lines.
    largest = _largest(measured, simulated)
    levels = (20 * np.log10(measured.amplitude / largest[0]), 20 * np.log10(simulated.amplitude / largest[1]))
    to_lines = match_lines(measured.frequency_Hz, simulated.frequency_Hz, widest=within, levels=levels)
    harmonics = _harmonics(measured, simulated, to_lines)
    own = [k for k, harmonic in enumerate(harmonics) if not harmonic]
    matches = match_lines(measured.frequency_Hz[own], [mode.frequency_Hz for mode in modes], widest=within)
    to_modes = dict(zip(own, matches, strict=True))
    same = {"unit": measured.unit or "", "rms_of_0_dB": references["measured"]}
    lines = []
    for k, (frequency, amplitude) in enumerate(np.transpose(measured.tones.peaks).tolist()):
        level, known = float(level_dB(amplitude, references["measured"])), harmonics[k]
        if match := to_lines[k]:
            near = simulated.lines[match.reference]
            known |= {"nearest_simulated_Hz": near.frequency_Hz, "over_simulated": match.difference}
            known["simulated_is_pair"] = match.paired
            if match.paired:
                known["level_over_simulated_dB"] = level - float(level_dB(near.amplitude, references["simulated"]))
        if match := to_modes.get(k):
            mode = modes[match.reference]
            known |= {"nearest_mode": mode.label, "nearest_mode_Hz": mode.frequency_Hz}
            known |= {"over_mode": match.difference, "mode_is_pair": match.paired}
        lines.append(MeasuredLine(measured_Hz=frequency, amplitude=amplitude, level_dB=level, **same, **known))
    return tuple(lines)


def _harmonics(measured: Spectral, simulated: Spectral, to_lines: list[Match | None]) -> list[dict[str, Any]]:
    """Which measured lines are harmonics: of a measured one or, where that is not measured, by their simulated pair."""
    found, theirs = (
        find_harmonics(record.frequency_Hz, record.amplitude, record.tones.spectrum.resolution_Hz)
        for record in (measured, simulated)
    )
    taken = {match.reference for match in to_lines if match is not None and match.paired}
    harmonics: list[dict[str, Any]] = []
    for harmonic, match in zip(found, to_lines, strict=True):
        pair = theirs[match.reference] if match and match.paired else None
        record, which = (measured, harmonic) if harmonic else (simulated, pair)
        if which is None or (record is simulated and which.fundamental in taken):
            harmonics.append({})
        else:
            fundamental = float(record.frequency_Hz[which.fundamental])
            known = {"harmonic_order": which.order, "fundamental_Hz": fundamental}
            harmonics.append(known | {"fundamental_is_simulated": record is simulated})
    return harmonics


# In sentences

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
