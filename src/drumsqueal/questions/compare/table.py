"""A measured record beside a simulated one: on the terminal, as CSV, as plain data, and in a sentence or two."""

import math
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.findings.history import versions
from drumsqueal.findings.signals import level_reference
from drumsqueal.findings.signals.tones import FAINTEST
from drumsqueal.questions.compare.matching import Match
from drumsqueal.questions.compare.study import LOWEST, MeasuredComparison, MeasuredLine, Spectral
from drumsqueal.scene.quantities import percent, printable
from drumsqueal.terminal.tables import print_table, rows_to_csv

PRINTED = 12  # lines
NOTHING = "-"
LEAST_TOLD = 1e-3  # percent


def print_comparison(console: Console, comparison: MeasuredComparison) -> None:
    """Print every measured line beside the nearest simulated one and the nearest eigenvalue, and the verdict."""
    if comparison.lines:
        _print_table(console, comparison)
    for name, record in (("Measured", comparison.measured), ("Simulated", comparison.simulated)):
        console.print(printable(f"{name}: {_record(comparison, name, record)}"), style="dim")
    for remark in comparison.told:
        console.print(printable(f"Note: {remark}"))
    for sentence in unpaired(comparison):
        console.print(printable(sentence))
    console.print(printable(verdict(comparison)), style="bold")


def _print_table(console: Console, comparison: MeasuredComparison) -> None:
    """Print the lines, and what the headings mean."""
    table = Table(title="Measured lines", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    reference = level_reference(comparison.unit).written.partition(" (")[0] if comparison.unit else "largest"
    to_simulated, to_modes = ("Δf from\nsimulated\n%", "ΔL from\nsimulated\ndB"), "Δf from\nmode\n%"
    headings = (
        "measured\nHz",
        f"level\ndB re\n{reference}",
        "simulated\nHz",
        *to_simulated,
        "mode or\nharmonic, Hz",
        to_modes,
    )
    for heading in headings:
        table.add_column(heading, justify="right", vertical="bottom", no_wrap=True)
    for line in comparison.lines[:PRINTED]:
        table.add_row(*_cells(comparison, line))
    print_table(console, table)
    if len(comparison.lines) > PRINTED:
        console.print(f"and {len(comparison.lines) - PRINTED} weaker ones, in the table", style="dim")
    told = ["Δf, ΔL: frequency and level of the measured line over those of the other"]
    matches = [match for line in comparison.lines[:PRINTED] for match in (line.simulated, line.mode) if match]
    if not all(match.paired for match in matches):
        reason = f"more than {100 * comparison.within:g} % off, or taken by a stronger line"
        told.append(f"in parentheses: the nearest, but no pair ({reason})")
    harmonics = [line.harmonic for line in comparison.lines[:PRINTED] if line.harmonic]
    if harmonics:
        told.append("n × f: a harmonic of the line at f, and so of no mode")
    if any(harmonic.simulated for harmonic in harmonics):
        told.append("(n × f): of a simulated line that is not measured")
    faintest = -20 * math.log10(FAINTEST)
    told.append(
        f"what is {faintest:.0f} dB or more below the strongest of its record is not listed, simulated or measured"
    )
    console.print("; ".join(told), style="dim")


def _record(comparison: MeasuredComparison, name: str, record: Spectral) -> str:
    what = comparison.measured_record.short_name if name == "Measured" else comparison.signal
    segments = "" if record.tones.segments == 1 else f", mean of {record.tones.segments} segments"
    return (
        f"{what}, {record.start_s:.4g} to {record.end_s:.4g} s at {record.sample_rate:.6g} Hz, resolution "
        f"{record.tones.spectrum.resolution_Hz:.3g} Hz{segments}"
    )


def _cells(comparison: MeasuredComparison, line: MeasuredLine) -> list[str]:
    cells = [f"{line.frequency_Hz:.2f}", f"{line.level_dB:.1f}"]
    cells += _beside(line.simulated, [f"{f:.2f}" for f in comparison.simulated.frequency_Hz])
    cells.append(NOTHING if line.level_difference_dB is None else _signed(line.level_difference_dB, "+.1f"))
    if line.harmonic is not None:
        harmonic = f"{line.harmonic.order} × {line.harmonic.fundamental_Hz:.2f}"
        return [*cells, f"({harmonic})" if line.harmonic.simulated else harmonic, NOTHING]
    return cells + _beside(line.mode, [f"{mode.label} {mode.frequency_Hz:.2f}" for mode in comparison.modes])


def _beside(match: Match | None, named: list[str]) -> list[str]:
    if match is None:
        return [NOTHING, NOTHING]
    difference = _signed(100 * match.difference, "+.3f" if match.paired else "+.1f")
    cells = [named[match.reference], difference]
    return cells if match.paired else [f"({cell})" for cell in cells]


def _signed(value: float, how: str) -> str:
    """A number with its sign, none for zero."""
    text = f"{value:{how}}"
    return text[1:] if float(text) == 0 else text


def unpaired(comparison: MeasuredComparison) -> list[str]:
    """What has no pair, and what the measured record cannot show."""
    sentences = []
    strays = [line for line in comparison.lines if not (line.simulated and line.simulated.paired)]
    if strays:
        sentences.append(f"Measured, not simulated: {_list([line.frequency_Hz for line in strays])} Hz")
    if comparison.not_measured:
        missed = [comparison.simulated.frequency_Hz[k] for k in comparison.not_measured]
        sentences.append(f"Simulated, not measured: {_list(missed)} Hz")
    modes, lines = comparison.out_of_reach
    if modes or lines:
        named = [f"{comparison.modes[k].label} {comparison.modes[k].frequency_Hz:.0f} Hz" for k in modes]
        named += [f"the simulated {comparison.simulated.frequency_Hz[k]:.0f} Hz" for k in lines]
        nyquist = comparison.measured.sample_rate / 2
        sentences.append(f"Not measurable, at or above {nyquist:.6g} Hz: {', '.join(named)}")
    return sentences


def _list(frequencies: list[float]) -> str:
    some = ", ".join(f"{f:.1f}" for f in frequencies[:PRINTED])
    return some if len(frequencies) <= PRINTED else f"{some} and {len(frequencies) - PRINTED} more"


def verdict(comparison: MeasuredComparison) -> str:
    """Where the strongest measured line lies, and how many lines are the same."""
    if not comparison.lines:
        return "No line stands out of the noise of the measured record."
    told = f"{_strongest(comparison, comparison.lines[0])}; {_from_modes(comparison, comparison.lines[0])}."
    total, harmonics = len(comparison.lines), sum(line.harmonic is not None for line in comparison.lines)
    of = f"Of {total} measured line{'s' if total > 1 else ''}"
    if harmonics:
        of += f", {harmonics} of them {'harmonics' if harmonics > 1 else 'a harmonic'},"
    paired = [line.simulated for line in comparison.lines if line.simulated and line.simulated.paired]
    if paired:
        most = 100 * max(abs(match.difference) for match in paired)
        has = "have" if len(paired) > 1 else "has"
        told += f" {of} {len(paired)} {has} a simulated one, {_share(most)} apart at most;"
    else:
        told += f" {of} none has a simulated one within {100 * comparison.within:g} %;"
    return f"{told} a line anywhere would find one with a chance of {100 * comparison.chance:.0f} %."


def _strongest(comparison: MeasuredComparison, line: MeasuredLine) -> str:
    """What the strongest measured line is, and where the simulated one lies."""
    told, harmonic = f"The strongest measured line, {line.frequency_Hz:.1f} Hz,", line.harmonic
    if harmonic is not None and not harmonic.simulated:
        told += f" the {_ordinal(harmonic.order)} harmonic of {harmonic.fundamental_Hz:.1f} Hz,"
    if line.simulated is None:
        return f"{told} has nothing simulated to be compared with, for the simulation has no line"
    if not line.simulated.paired:
        return f"{told} is not simulated"
    place = line.simulated.reference
    told += f" lies {_apart(line.simulated.difference)} the simulated {comparison.simulated.frequency_Hz[place]:.1f} Hz"
    if harmonic is not None and harmonic.simulated:
        told += f", the {_ordinal(harmonic.order)} harmonic of {harmonic.fundamental_Hz:.1f} Hz"
    return f"{told}, the strongest one too" if place == 0 else told


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
    share = _share(100 * abs(difference))
    return "at" if share == "less than 0.001 %" else f"{share} {'above' if difference > 0 else 'below'}"


def _share(difference: float) -> str:
    return percent(difference / 100) if difference >= LEAST_TOLD else "less than 0.001 %"


def to_csv(comparison: MeasuredComparison) -> str:
    """One row for every measured line, for every simulated one without a pair, and for every mode without one."""
    level = "level_dB" if comparison.unit else "level_dB_re_largest"
    rows = [_row(comparison, line, level) for line in comparison.lines]
    columns = dict.fromkeys(_row(comparison, None, level))
    taken = {line.simulated.reference for line in comparison.lines if line.simulated and line.simulated.paired}
    modes = {line.mode.reference for line in comparison.lines if line.mode and line.mode.paired}
    lines_beyond, modes_beyond = comparison.out_of_reach[1], comparison.out_of_reach[0]
    for k, frequency in enumerate(comparison.simulated.frequency_Hz):
        if k not in taken:
            told = "not measurable" if k in lines_beyond else "not measured"
            rows.append(columns | {"line": f"simulated, {told}", "nearest_simulated_Hz": float(frequency)})
    for k, mode in enumerate(comparison.modes):
        if k not in modes:
            told = "not measurable" if k in modes_beyond else "not measured"
            rows.append(
                columns
                | {"line": f"predicted, {told}", "nearest_mode": mode.label, "nearest_mode_Hz": mode.frequency_Hz}
            )
    return rows_to_csv(rows)


def _row(comparison: MeasuredComparison, line: MeasuredLine | None, level: str) -> dict[str, Any]:
    simulated, mode = (None, None) if line is None else (line.simulated, line.mode)
    frequencies = comparison.simulated.frequency_Hz
    return {
        "line": "measured",
        "measured_Hz": line and line.frequency_Hz,
        "amplitude": line and line.amplitude,
        "unit": comparison.measured_record.unit,
        level: line and line.level_dB,
        "rms_of_0_dB": line and comparison.references[0],
        "harmonic_order": line and line.harmonic and line.harmonic.order,
        "fundamental_Hz": line and line.harmonic and line.harmonic.fundamental_Hz,
        "fundamental_is_simulated": line and line.harmonic and line.harmonic.simulated,
        "nearest_simulated_Hz": simulated and float(frequencies[simulated.reference]),
        "over_simulated": simulated and simulated.difference,
        "simulated_is_pair": simulated and simulated.paired,
        "level_over_simulated_dB": line and line.level_difference_dB,
        "nearest_mode": mode and comparison.modes[mode.reference].label,
        "nearest_mode_Hz": mode and comparison.modes[mode.reference].frequency_Hz,
        "over_mode": mode and mode.difference,
        "mode_is_pair": mode and mode.paired,
    }


def comparison_data(comparison: MeasuredComparison, measured: Path) -> dict[str, Any]:
    """Everything found as plain data; differences are measured over reference less 1."""
    record, modes = comparison.measured_record, comparison.modes
    level = "level_dB" if comparison.unit else "level_dB_re_largest"
    modes_beyond, lines_beyond = comparison.out_of_reach
    return {
        "title": comparison.scene.title,
        "verdict": verdict(comparison),
        "measured": {
            "file": str(measured),
            "channel": record.name,
            "quantity": record.quantity or None,
            "unit": record.unit or None,
            **_described(comparison.measured),
        },
        "simulated": {
            "file": str(comparison.source),
            "signal": comparison.signal,
            "saturated": comparison.saturated,
            **_described(comparison.simulated),
            "lines": [
                {"frequency_Hz": float(f), "amplitude": float(a), "not_measurable": k in lines_beyond}
                for k, (f, a) in enumerate(zip(*comparison.simulated.tones.peaks, strict=True))
            ],
        },
        "amplitudes_in": comparison.unit or None,
        "rms_of_0_dB": dict(zip(("measured", "simulated"), comparison.references, strict=True)),
        "pairs_within": comparison.within,
        "chance_of_a_pair": comparison.chance,
        "lowest_frequency_Hz": LOWEST,
        "lines": [_row(comparison, line, level) for line in comparison.lines],
        "modes": [
            {
                "label": mode.label,
                "frequency_Hz": mode.frequency_Hz,
                "growth_rate_1_per_s": mode.growth_rate,
                "unstable": mode.unstable,
                "not_measurable": k in modes_beyond,
            }
            for k, mode in enumerate(modes)
        ],
        "notes": list(comparison.told),
        "scene": comparison.scene.model_dump(mode="json"),
        "versions": versions(),
    }


def _described(record: Spectral) -> dict[str, Any]:
    return {
        "from_s": record.start_s,
        "until_s": record.end_s,
        "sample_rate_Hz": record.sample_rate,
        "resolution_Hz": record.tones.spectrum.resolution_Hz,
        "segments": record.tones.segments,
    }
