"""The paper's figures as rows of numbers, and its statements as a table: on the terminal, as CSV and as plain data."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from drumsqueal.jobs.study import rows_to_csv
from drumsqueal.jobs.tables import print_table
from drumsqueal.studies.paper.curves import Curve, FrictionCurve
from drumsqueal.studies.paper.statement import Statement
from drumsqueal.studies.paper.transients import Point

VERDICT = {True: "holds", False: "does not", None: "open"}


def print_statements(console: Console, statements: Sequence[Statement]) -> None:
    """Print every statement with the number that decides it."""
    table = Table(title="What Seo & Kang (2023) state", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("fig.")
    table.add_column("statement")
    table.add_column("number", justify="right")
    table.add_column("holds if")
    table.add_column("")
    for each in statements:
        value = "-" if each.value is None else f"{each.value:.3g}"
        limit = f"{each.bound} {each.limit:g} {each.unit}".rstrip()
        told = Text(VERDICT[each.holds], style="" if each.holds else "bold")
        table.add_row(each.figure, each.says, value, limit, told)
    print_table(console, table)
    for each in statements:
        if not each.holds:
            why = each.measure + (f" ({each.detail})" if each.detail else "")
            number = "not known" if each.value is None else f"{each.value:.3g} {each.unit}".rstrip()
            console.print(f"{each.says}? The {why} is {number}.", style="dim")
    counts = {holds: sum(each.holds is holds for each in statements) for holds in VERDICT}
    undecided = f", {counts[None]} could not be decided" if counts[None] else ""
    console.print(
        f"Of {len(statements)} statements {counts[True]} hold and {counts[False]} do not{undecided}.", style="bold"
    )


def statements_to_csv(statements: Sequence[Statement]) -> str:
    """One row a statement."""
    return rows_to_csv(describe_statements(statements))


def describe_statements(statements: Sequence[Statement]) -> list[dict[str, Any]]:
    """Every statement as plain data; the margin is the distance from the limit, negative where it fails."""
    return [
        {
            "figure": each.figure,
            "statement": each.says,
            "holds": each.holds,
            "measure": each.measure,
            "value": None if each.value is None else float(each.value),
            "bound": each.bound,
            "limit": each.limit,
            "margin": each.margin,
            "unit": each.unit,
            "detail": each.detail,
        }
        for each in statements
    ]


def curves_to_csv(friction: FrictionCurve, curves: Mapping[str, Curve], points: Mapping[str, Sequence[Point]]) -> str:
    """All figures in one table: the friction curve, eigenvalues mode by mode, and what the transients measured."""
    rows = [*_friction_rows(friction)]
    for figure, curve in curves.items():
        rows += _curve_rows(figure, curve)
        for point in points.get(figure, ()):
            rows += _point_rows(figure, point)
    return rows_to_csv(rows)


def _friction_rows(curve: FrictionCurve) -> Iterator[dict[str, Any]]:
    for speed, coefficient, slope in zip(*curve, strict=True):
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
