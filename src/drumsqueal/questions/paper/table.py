"""The paper's figures as rows of numbers, and its statements as a table: on the terminal, as CSV and as plain data."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich import box
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from drumsqueal.questions.paper.curves import Curve, FrictionCurve
from drumsqueal.questions.paper.statement import Reading, Statement, Verdict
from drumsqueal.questions.paper.transients import Point
from drumsqueal.terminal.tables import print_table, rows_to_csv

HEADS = {Verdict.DEPENDS: "depends"}  # in the table, for whose width the whole verdict is too long


def print_statements(console: Console, statements: Sequence[Statement]) -> None:
    """Print every statement with the numbers that decide it, then why those are not confirmed that are not."""
    table = Table(title="What Seo & Kang (2023) state", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("fig.")
    table.add_column("statement")
    table.add_column("number", justify="right")
    table.add_column("holds if")
    table.add_column("")
    for each in statements:
        told = Text(HEADS.get(each.verdict, each.verdict), "" if each.verdict is Verdict.CONFIRMED else "bold")
        for k, reading in enumerate(each.readings):
            first = (each.figure, each.says) if k == 0 else ("", "   or read otherwise")
            table.add_row(*first, _value(reading), _limit(reading), told if k == 0 else "")
    print_table(console, table)
    for verdict in (Verdict.NOT_CONFIRMED, Verdict.DEPENDS, Verdict.NOT_DECIDED):
        chosen = [each for each in statements if each.verdict is verdict]
        if chosen:
            console.print(f"{verdict.capitalize()}", style="bold")
        for each in chosen:
            console.print(f"Figure {each.figure}: {each.says}", style="dim")
            for reading in each.readings:
                console.print(Padding(_describe(reading), (0, 0, 0, 2), style="dim", expand=False))
    counts = {verdict: sum(each.verdict is verdict for each in statements) for verdict in Verdict}
    listed = [f"{count} {_each(verdict, count)}" for verdict, count in counts.items() if count]
    told = " and ".join(part for part in (", ".join(listed[:-1]), listed[-1]) if part)
    console.print(f"Of {len(statements)} statements {told}.", style="bold")


def _each(verdict: Verdict, count: int) -> str:
    """What so many statements are or do."""
    if verdict is Verdict.DEPENDS:
        return f"{verdict}" if count == 1 else "depend" + verdict.removeprefix("depends")
    return f"{'is' if count == 1 else 'are'} {verdict}"


def _value(reading: Reading) -> str:
    return "-" if reading.value is None else f"{reading.value:.3g}"


def _limit(reading: Reading) -> str:
    return f"{reading.bound} {reading.limit:g} {reading.unit}".rstrip()


def _describe(reading: Reading) -> str:
    """A reading with its number, and whether the statement holds in it."""
    number = "unknown" if reading.value is None else f"{_value(reading)} {reading.unit}".rstrip()
    holds = {True: "holds", False: "does not hold", None: "is not decided"}[reading.holds]
    where = f" ({reading.detail})" if reading.detail else ""
    return f"{holds}: {reading.measure}{where} is {number}, limit {_limit(reading)}"


def statements_to_csv(statements: Sequence[Statement]) -> str:
    """One row a reading, with the verdict on its statement."""
    return rows_to_csv(
        [
            {"figure": each.figure, "statement": each.says, "verdict": str(each.verdict)} | _describe_reading(reading)
            for each in statements
            for reading in each.readings
        ]
    )


def describe_statements(statements: Sequence[Statement]) -> list[dict[str, Any]]:
    """Every statement as plain data: its verdict, and the readings that it rests on."""
    return [
        {
            "figure": each.figure,
            "statement": each.says,
            "verdict": str(each.verdict),
            "readings": [_describe_reading(reading) for reading in each.readings],
        }
        for each in statements
    ]


def _describe_reading(reading: Reading) -> dict[str, Any]:
    """A reading as plain data; the margin is the distance from the limit, negative where the statement fails."""
    value = None if reading.value is None else float(reading.value)
    return reading._asdict() | {"value": value, "holds": reading.holds, "margin": reading.margin}


def curves_to_csv(friction: FrictionCurve, curves: Mapping[str, Curve], points: Mapping[str, Sequence[Point]]) -> str:
    """All figures in one table: the friction curve, eigenvalues mode by mode, and what the transients measured."""
    rows = [*_friction_rows(friction)]
    for figure, curve in curves.items():
        rows += _curve_rows(figure, curve)
        for point in points.get(figure, ()):
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
        yield common | {"note": point.outcome}
        return
    for mode in point.comparison.modes:
        growth = mode.measured_growth
        yield common | {
            "mode": mode.label,
            "frequency_Hz": mode.measured_frequency_Hz,
            "growth_rate_1_per_s": None if growth is None else growth.rate_1_per_s,
            "standard_error_1_per_s": None if growth is None else growth.standard_error,
            "note": mode.note,
        }
    saturation = point.comparison.saturation
    if saturation is None or saturation.main is None:
        why = "reaches no edge" if point.comparison.edge_reached_s is None else "too short to tell what it settles to"
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
