"""What a fit to a measured record writes, draws and prints."""

from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.files.output_folder import FIT, FIT_SUMMARY, FITTED_SCENE
from drumsqueal.questions.fit.figure import draw_fit
from drumsqueal.questions.fit.found import Fit, FittedLine, FittedNumber
from drumsqueal.questions.fit.record import RecordKind
from drumsqueal.questions.fit.words import short, value_to
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal.runner import Answer
from drumsqueal.terminal.tables import print_table

NOTHING = "-"


def print_fit(console: Console, fit: Fit) -> None:
    """Print the numbers before and after, the lines before and after, the verdict, and what limits it."""
    _print_numbers(console, fit)
    _print_lines(console, fit)
    part = f"{fit.from_s:.4g} to {fit.until_s:.4g} s at {fit.sample_rate_Hz:.6g} Hz"
    console.print(printable(f"Measured: {fit.channel}, {part}; {fit.reason}"), style="dim")
    console.print("±: half the 95 % confidence interval", style="dim")
    console.print(printable(fit.verdict), style="bold")
    for note in fit.notes:
        console.print(printable(f"Note: {note}"))


def _print_numbers(console: Console, fit: Fit) -> None:
    table = Table(title="Numbers", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in ("number", "scene", "fitted", "±", "unit", "change\n%", "deter-\nmined"):
        table.add_column(heading, justify="left" if heading in ("number", "unit") else "right", vertical="bottom")
    for number in fit.numbers:
        table.add_row(*_number(number))
    print_table(console, table)


def _number(number: FittedNumber) -> list[str]:
    change = NOTHING if number.relative_change is None else f"{100 * number.relative_change:+.2f}"
    if number.uncertainty is None:
        fitted, wide = short(number.fitted_value, 4), NOTHING
    else:
        fitted, wide = value_to(number.fitted_value, number.uncertainty), short(number.uncertainty, 2)
    known = "yes" if number.determined else "no"
    return [number.key, short(number.scene_value, 4), fitted, wide, number.unit or "SI", change, known]


def _print_lines(console: Console, fit: Fit) -> None:
    linear = fit.record_kind is RecordKind.LINEAR
    kind = "Lines and eigenvalues" if linear else "Lines of squeal"
    table = Table(title=kind, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    headings = ["measured\nHz", "±", "scene\nHz", "fitted\nHz"]
    if linear:
        headings = ["mode", *headings, "growth\n1/s", "±", "scene\n1/s", "fitted\n1/s"]
    for heading in headings:
        table.add_column(heading, justify="left" if heading == "mode" else "right", vertical="bottom", no_wrap=True)
    for line in fit.lines:
        table.add_row(*_line(line, linear=linear))
    print_table(console, table)


def _line(line: FittedLine, *, linear: bool) -> list[str]:
    def shown(value: float | None, form: str) -> str:
        return NOTHING if value is None else f"{value:{form}}"

    cells = [f"{line.measured_Hz:.2f}", short(line.uncertainty_Hz, 2)]
    cells += [shown(line.before_Hz, ".2f"), shown(line.after_Hz, ".2f")]
    if not linear:
        return cells
    wide = line.growth_rate_uncertainty_1_per_s
    cells += [shown(line.measured_growth_rate_1_per_s, "+.2f"), NOTHING if wide is None else short(wide, 2)]
    cells += [shown(line.before_growth_rate_1_per_s, "+.2f"), shown(line.after_growth_rate_1_per_s, "+.2f")]
    return [line.mode or NOTHING, *cells]


def fitted_scene(fit: Fit) -> str | None:
    """The scene with the fitted numbers in the units of its file, headed by what was found; None where it failed."""
    if fit.missed:
        return None
    text = fit.written.to_toml() if fit.written is not None else fit.fitted_scene.to_toml()
    return f"# {printable(fit.verdict)}\n{text}"


FIT_ANSWER = Answer(words=print_fit, summary=FIT_SUMMARY, tables={FITTED_SCENE: fitted_scene}, figures={FIT: draw_fit})
