"""What the paper's figures and statements are written, drawn and printed as."""

from collections.abc import Iterator
from typing import Any

from rich import box
from rich.console import Console
from rich.padding import Padding
from rich.table import Column, Table
from rich.text import Text

from drumsqueal.files.output_folder import PAPER_TABLE, STATEMENTS, STATEMENTS_TABLE
from drumsqueal.questions.paper.curves import Curve, FrictionCurve
from drumsqueal.questions.paper.figure import PAPER_DRAWINGS
from drumsqueal.questions.paper.statement import Reading, Verdict
from drumsqueal.questions.paper.study import PaperStudy
from drumsqueal.questions.paper.transients import Point
from drumsqueal.terminal.runner import Answer
from drumsqueal.terminal.tables import print_table, rows_to_csv

HEADS = {Verdict.DEPENDS: "depends"}  # in the table, for whose width the whole verdict is too long
COUNTED = {  # one statement, and several
    Verdict.CONFIRMED: ("is confirmed", "are confirmed"),
    Verdict.NOT_CONFIRMED: ("is not confirmed", "are not confirmed"),
    Verdict.DEPENDS: (Verdict.DEPENDS.value, "depend on a reading that the text does not fix"),
    Verdict.NOT_DECIDED: ("is not decided", "are not decided"),
}


def print_study(console: Console, study: PaperStudy) -> None:
    """Print every statement with the numbers that decide it, then why those are not confirmed that are not."""
    columns = "fig.", "statement", Column("number", justify="right"), "holds if", ""
    table = Table(*columns, title="What Seo & Kang (2023) state", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for each in study.statements:
        shown = Text(HEADS.get(each.verdict, each.verdict), "" if each.verdict is Verdict.CONFIRMED else "bold")
        for k, reading in enumerate(each.readings):
            first = (each.figure, each.statement) if k == 0 else ("", "   or read otherwise")
            number = "-" if reading.value is None else f"{reading.value:.3g}"
            table.add_row(*first, number, reading.condition, shown if k == 0 else "")
    print_table(console, table)
    for verdict in (Verdict.NOT_CONFIRMED, Verdict.DEPENDS, Verdict.NOT_DECIDED):
        chosen = [each for each in study.statements if each.verdict is verdict]
        if chosen:
            console.print(f"{verdict.capitalize()}", style="bold")
        for each in chosen:
            console.print(f"Figure {each.figure}: {each.statement}", style="dim")
            for reading in each.readings:
                console.print(Padding(_in_words(reading), (0, 0, 0, 2), style="dim", expand=False))
    counts = {verdict: sum(each.verdict is verdict for each in study.statements) for verdict in Verdict}
    listed = [f"{count} {COUNTED[verdict][count > 1]}" for verdict, count in counts.items() if count]
    summary = " and ".join(part for part in (", ".join(listed[:-1]), listed[-1]) if part)
    console.print(f"Of {len(study.statements)} statements {summary}.", style="bold")


def _in_words(reading: Reading) -> str:
    """A reading with its number, and whether the statement holds in it."""
    number = "unknown" if reading.value is None else f"{reading.value:.3g} {reading.unit}".rstrip()
    holds = {True: "holds", False: "does not hold", None: "is not decided"}[reading.holds]
    where = f" ({reading.detail})" if reading.detail else ""
    return f"{holds}: {reading.measure}{where} is {number}, limit {reading.condition}"


def statements_table(study: PaperStudy) -> str:
    """One row a reading, with the verdict on its statement, as CSV."""
    statements = study.model_dump()["statements"]
    head = ("figure", "statement", "verdict")
    return rows_to_csv([{key: each[key] for key in head} | row for each in statements for row in each["readings"]])


def paper_table(study: PaperStudy) -> str:
    """All figures in one CSV table: the friction curve, eigenvalues mode by mode, and what the transients measured."""
    rows = [] if study.friction is None else [*_friction_rows(study.friction)]
    for figure, curve in study.curves.items():
        rows += _curve_rows(figure, curve)
        for point in study.points[figure]:
            rows += _point_rows(figure, point)
    return rows_to_csv(rows)


def _friction_rows(curve: FrictionCurve) -> Iterator[dict[str, Any]]:
    for speed, coefficient, slope in zip(curve.speed, curve.coefficient, curve.slope, strict=True):
        yield {
            "figure": "4",
            "source": "friction law",
            "varied": "drum.speed",
            "value_SI": float(speed),
            "friction_coefficient": float(coefficient),
            "friction_slope_s_per_m": float(slope),
        }


def _curve_rows(figure: str, curve: Curve) -> Iterator[dict[str, Any]]:
    for name in curve.spectrum.names:
        frequency, rate = curve.frequency_Hz(name), curve.rate(name)
        for k, value in enumerate(curve.values):
            yield {
                "figure": figure,
                "source": "eigenvalue",
                "varied": curve.axis.key,
                "value_SI": float(value),
                "mode": name,
                "frequency_Hz": float(frequency[k]),
                "growth_rate_1_per_s": float(rate[k]),
            }


def _point_rows(figure: str, point: Point) -> Iterator[dict[str, Any]]:
    common = {"figure": figure, "source": "transient", "varied": point.key, "value_SI": point.value}
    if point.comparison is None:
        yield common | {"note": point.why_not}
        return
    for mode in point.modes:
        growth = mode.measured_growth
        yield common | {
            "mode": mode.label,
            "frequency_Hz": mode.measured_frequency_Hz,
            "growth_rate_1_per_s": None if growth is None else growth.rate_1_per_s,
            "standard_error_1_per_s": None if growth is None else growth.standard_error,
            "note": mode.note,
        }
    saturation = point.saturation
    if saturation is None or saturation.main is None:
        linear = point.comparison.edge_reached_s is None
        why = "neither lift-off nor slip reversal" if linear else "too short to identify the steady-state response"
        yield common | {"source": "saturated motion", "note": why}
        return
    yield common | {
        "source": "saturated motion",
        "mode": saturation.nearest_mode,
        "frequency_Hz": saturation.main.frequency_Hz,
        "amplitude_of": saturation.main.coordinate,
        "amplitude_SI": saturation.main.amplitude,
        "note": saturation.regime.kind,
    }


PAPER_ANSWER = Answer(
    words=print_study,
    summary=STATEMENTS,
    tables={PAPER_TABLE: paper_table, STATEMENTS_TABLE: statements_table},
    figures=PAPER_DRAWINGS,
)
