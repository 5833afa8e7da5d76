"""What a comparison with a measured record writes and prints."""

import math

from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.files.output_folder import COMPARE, COMPARE_SUMMARY, COMPARE_TABLE
from drumsqueal.findings.signals.tones import FAINTEST
from drumsqueal.questions.compare.figure import draw_comparison
from drumsqueal.questions.compare.matching import Match
from drumsqueal.questions.compare.study import MeasuredComparison, MeasuredLine, Spectral, line_row
from drumsqueal.questions.compare.words import PRINTED, describe_unpaired, zero_level
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal.runner import Answer
from drumsqueal.terminal.tables import print_table, rows_to_csv

NOTHING = "-"


def print_comparison(console: Console, comparison: MeasuredComparison) -> None:
    """Print every measured line with the nearest simulated one and the nearest eigenvalue, and the verdict."""
    if comparison.matched:
        _print_table(console, comparison)
    console.print(printable(f"Measured: {comparison.measured.short_name}, {_part(comparison.measured)}"), style="dim")
    console.print(printable(f"Simulated: {comparison.simulated.signal}, {_part(comparison.simulated)}"), style="dim")
    for remark in comparison.notes:
        console.print(printable(f"Note: {remark}"))
    for sentence in describe_unpaired(comparison):
        console.print(printable(sentence))
    console.print(printable(comparison.verdict), style="bold")


def _print_table(console: Console, comparison: MeasuredComparison) -> None:
    """Print the lines, and what the headings mean."""
    table = Table(title="Measured lines", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    reference = zero_level(comparison) or "largest"
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
    for line in comparison.matched[:PRINTED]:
        table.add_row(*_cells(comparison, line))
    print_table(console, table)
    if len(comparison.matched) > PRINTED:
        console.print(f"and {len(comparison.matched) - PRINTED} weaker ones, in the table", style="dim")
    notes = ["Δf, ΔL: frequency and level of the measured line over those of the other"]
    matches = [match for line in comparison.matched[:PRINTED] for match in (line.simulated, line.mode) if match]
    if not all(match.paired for match in matches):
        reason = f"more than {100 * comparison.pairs_within:g} % off, or taken by a stronger line"
        notes.append(f"in parentheses: the nearest, but no pair ({reason})")
    harmonics = [line.harmonic for line in comparison.matched[:PRINTED] if line.harmonic]
    if harmonics:
        notes.append("n × f: a harmonic of the line at f, and so of no mode")
    if any(harmonic.simulated for harmonic in harmonics):
        notes.append("(n × f): of a simulated line that is not measured")
    faintest = -20 * math.log10(FAINTEST)
    notes.append(
        f"what is {faintest:.0f} dB or more below the strongest of its record is not listed, simulated or measured"
    )
    console.print("; ".join(notes), style="dim")


def _part(record: Spectral) -> str:
    segments = "" if record.segments == 1 else f", mean of {record.segments} segments"
    return (
        f"{record.from_s:.4g} to {record.until_s:.4g} s at {record.sample_rate_Hz:.6g} Hz, resolution "
        f"{record.resolution_Hz:.3g} Hz{segments}"
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


def to_csv(comparison: MeasuredComparison) -> str:
    """One row for every measured line, for every simulated one without a pair, and for every mode without one."""
    rows = list(comparison.lines)
    columns = dict.fromkeys(line_row(comparison, None))
    taken = {line.simulated.reference for line in comparison.matched if line.simulated and line.simulated.paired}
    modes = {line.mode.reference for line in comparison.matched if line.mode and line.mode.paired}
    for k, line in enumerate(comparison.simulated.lines):
        if k not in taken:
            why = "not measurable" if line.not_measurable else "not measured"
            rows.append(columns | {"line": f"simulated, {why}", "nearest_simulated_Hz": line.frequency_Hz})
    for k, mode in enumerate(comparison.modes):
        if k not in modes:
            why = "not measurable" if mode.not_measurable else "not measured"
            rows.append(
                columns
                | {"line": f"predicted, {why}", "nearest_mode": mode.label, "nearest_mode_Hz": mode.frequency_Hz}
            )
    return rows_to_csv(rows)


COMPARED = Answer(
    words=print_comparison,
    summary=COMPARE_SUMMARY,
    tables={COMPARE_TABLE: to_csv},
    figures={COMPARE: draw_comparison},
)
