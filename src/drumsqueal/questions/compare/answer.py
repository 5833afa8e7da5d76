"""What a comparison with a measured record writes and prints."""

from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.files.output_folder import COMPARE, COMPARE_SUMMARY, COMPARE_TABLE
from drumsqueal.questions.compare.figure import draw_comparison
from drumsqueal.questions.compare.study import MeasuredComparison, MeasuredLine
from drumsqueal.questions.compare.words import (
    PRINTED,
    describe_record,
    describe_table,
    describe_unpaired,
    zero_level,
)
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal.runner import Answer
from drumsqueal.terminal.tables import print_table, rows_to_csv

NOTHING = "-"


def print_comparison(console: Console, comparison: MeasuredComparison) -> None:
    """Print every measured line with the nearest simulated one and the nearest eigenvalue, and the verdict."""
    measured, simulated = comparison.measured, comparison.simulated
    if comparison.lines:
        _print_table(console, comparison)
    console.print(printable(f"Measured: {measured.short_name}, {describe_record(measured)}"), style="dim")
    console.print(printable(f"Simulated: {simulated.signal}, {describe_record(simulated)}"), style="dim")
    for sentence in (*(f"Note: {note}" for note in comparison.notes), *describe_unpaired(comparison)):
        console.print(printable(sentence))
    console.print(printable(comparison.verdict), style="bold")


def _print_table(console: Console, comparison: MeasuredComparison) -> None:
    """Print the lines, and what the headings mean."""
    table = Table(title="Measured lines", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    headings = (
        "measured\nHz",
        f"level\ndB re\n{zero_level(comparison) or 'largest'}",
        "simulated\nHz",
        "Δf from\nsimulated\n%",
        "ΔL from\nsimulated\ndB",
        "mode or\nharmonic, Hz",
        "Δf from\nmode\n%",
    )
    for heading in headings:
        table.add_column(heading, justify="right", vertical="bottom", no_wrap=True)
    for line in comparison.lines[:PRINTED]:
        table.add_row(*_cells(line))
    print_table(console, table)
    if len(comparison.lines) > PRINTED:
        console.print(f"and {len(comparison.lines) - PRINTED} weaker ones, in the table", style="dim")
    console.print(describe_table(comparison), style="dim")


def _cells(line: MeasuredLine) -> list[str]:
    simulated = NOTHING if line.nearest_simulated_Hz is None else f"{line.nearest_simulated_Hz:.2f}"
    cells = [f"{line.measured_Hz:.2f}", f"{line.level_dB:.1f}"]
    cells += _nearest(simulated, line.over_simulated, line.simulated_is_pair)
    cells.append(NOTHING if line.level_over_simulated_dB is None else _signed(line.level_over_simulated_dB, "+.1f"))
    if line.harmonic_order:
        harmonic = f"{line.harmonic_order} × {line.fundamental_Hz:.2f}"
        return [*cells, f"({harmonic})" if line.fundamental_is_simulated else harmonic, NOTHING]
    mode = NOTHING if line.nearest_mode is None else f"{line.nearest_mode} {line.nearest_mode_Hz:.2f}"
    return cells + _nearest(mode, line.over_mode, line.mode_is_pair)


def _nearest(name: str, difference: float | None, paired: bool | None) -> list[str]:
    """What lies nearest and how far off, in parentheses where it is no pair."""
    if difference is None:
        return [NOTHING, NOTHING]
    cells = [name, _signed(100 * difference, "+.3f" if paired else "+.1f")]
    return cells if paired else [f"({cell})" for cell in cells]


def _signed(value: float, how: str) -> str:
    """A number with its sign, none for zero."""
    text = f"{value:{how}}"
    return text[1:] if float(text) == 0 else text


def to_csv(comparison: MeasuredComparison) -> str:
    """One row for every measured line, for every simulated one without a pair, and for every mode without one."""
    rows, columns = comparison.rows(comparison.lines), dict.fromkeys(comparison.columns.values())
    for line in comparison.simulated_alone:
        why = "not measurable" if line.not_measurable else "not measured"
        rows.append(columns | {"line": f"simulated, {why}", "nearest_simulated_Hz": line.frequency_Hz})
    paired = {line.nearest_mode for line in comparison.lines if line.mode_is_pair}
    for mode in comparison.modes:
        if mode.label not in paired:
            why = "not measurable" if mode.not_measurable else "not measured"
            named = {"nearest_mode": mode.label, "nearest_mode_Hz": mode.frequency_Hz}
            rows.append(columns | {"line": f"predicted, {why}"} | named)
    return rows_to_csv(rows)


COMPARED = Answer(
    words=print_comparison,
    summary=COMPARE_SUMMARY,
    tables={COMPARE_TABLE: to_csv},
    figures={COMPARE: draw_comparison},
)
