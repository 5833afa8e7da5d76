"""A measured record beside a simulated one: on the terminal, as CSV, as plain data, and in a sentence or two."""

from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.comparison.matching import Match
from drumsqueal.history import versions
from drumsqueal.jobs.study import rows_to_csv
from drumsqueal.jobs.tables import print_table
from drumsqueal.scene.quantities import percent, printable
from drumsqueal.studies.measured import LOWEST, MeasuredComparison, MeasuredLine, Spectral

PRINTED = 12  # lines
NOTHING = "-"
LEAST_TOLD = 1e-3  # percent


def print_comparison(console: Console, comparison: MeasuredComparison) -> None:
    """Print every measured line beside the nearest simulated one and the nearest eigenvalue, and the verdict."""
    table = Table(title="Measured lines", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    reference = f"dB re 1 {comparison.unit}" if comparison.unit else "dB re\nlargest"
    for heading in ("measured\nHz", f"level\n{reference}", "simulated\nHz", "apart\n%", "level over\nit, dB"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("predicted\nHz", justify="right", no_wrap=True)
    table.add_column("apart\n%", justify="right", no_wrap=True)
    for line in comparison.lines[:PRINTED]:
        table.add_row(*_cells(comparison, line))
    print_table(console, table)
    if len(comparison.lines) > PRINTED:
        console.print(f"and {len(comparison.lines) - PRINTED} weaker ones, in the table", style="dim")
    reason = f"apart by more than {100 * comparison.within:g} %, or taken by a stronger line"
    console.print(f"In parentheses: the nearest, but no pair ({reason})", style="dim")
    for name, record in (("Measured", comparison.measured), ("Simulated", comparison.simulated)):
        console.print(printable(f"{name}: {_record(comparison, name, record)}"), style="dim")
    for remark in comparison.told:
        console.print(printable(f"Note: {remark}"), style="dim")
    for sentence in unpaired(comparison):
        console.print(printable(sentence))
    console.print(printable(verdict(comparison)), style="bold")


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
    strongest = comparison.lines[0]
    told = [f"The strongest measured line, {strongest.frequency_Hz:.1f} Hz,"]
    if strongest.simulated is None:
        told.append("has nothing simulated to be compared with, for the simulation has no line;")
    elif strongest.simulated.paired:
        place = strongest.simulated.reference
        which = ", the strongest one too" if place == 0 else ""
        told.append(
            f"lies {_apart(strongest.simulated.difference)} the simulated "
            f"{comparison.simulated.frequency_Hz[place]:.1f} Hz{which};"
        )
    else:
        told.append("is not simulated;")
    unstable = [mode for mode in comparison.modes if mode.unstable]
    if unstable:
        mode = min(unstable, key=lambda mode: abs(mode.frequency_Hz - strongest.frequency_Hz))
        difference = strongest.frequency_Hz / mode.frequency_Hz - 1
        told.append(f"{_apart(difference)} the nearest unstable mode, {mode.label} at {mode.frequency_Hz:.1f} Hz.")
    else:
        told.append("no mode is unstable.")
    paired = [line.simulated for line in comparison.lines if line.simulated and line.simulated.paired]
    total = len(comparison.lines)
    if paired:
        most = 100 * max(abs(match.difference) for match in paired)
        told.append(f"Of {total} measured lines {len(paired)} have a simulated one, {_share(most)} apart at most;")
    else:
        told.append(f"Of {total} measured lines none has a simulated one within {100 * comparison.within:g} %;")
    told.append(f"a line anywhere would find one with a chance of {100 * comparison.chance:.0f} %.")
    return " ".join(told)


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
        "amplitudes_of_0_dB": dict(zip(("measured", "simulated"), comparison.references, strict=True)),
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
