"""A field of a result says how it is shown and what it means: tables, CSV, pages and the JSON schema follow."""

import io
import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import pytest
from pydantic import computed_field
from rich.console import Console

from drumsqueal.findings.columns import Column, columns_of, table_of, to_digits, to_uncertainty, unit_in, values_of
from drumsqueal.findings.schema import Finding
from drumsqueal.questions.report.answer import cell
from drumsqueal.terminal.tables import print_cells, print_rows, rows_to_csv


class Line(Finding):
    """A line that was measured."""

    frequency_Hz: Annotated[float, Column("measured\n{how}", ".2f", "of the peak")]
    unshown: int = 0
    uncertainty_Hz: Annotated[float | None, Column("±", "~2", unit="")] = None
    growth_rate_1_per_s: Annotated[float | None, Column("growth", "+.1f", optional=True)] = None
    name: Annotated[str, Column("mode")]
    columns: ClassVar = "name", ...

    @computed_field
    @property
    def fraction(self) -> Annotated[float, Column("part", ".1f", unit="%", factor=100, in_cells=True)]:
        """Its fraction of all."""
        return 0.25


def printed(*lines: Line, **words: str) -> list[list[str]]:
    file = io.StringIO()
    print_rows(Console(file=file, width=200), "Lines", Line, lines, **words)
    return [line.split() for line in file.getvalue().splitlines() if line.strip()]


def test_a_table_has_a_column_for_every_field_and_property_that_is_one():
    title, above, middle, units, _, row = printed(Line(frequency_Hz=1000.004, name="Y"), how="so")
    assert (title, above, middle, units) == (["Lines"], ["measured"], ["so"], ["mode", "Hz", "±", "part"])
    assert row == ["Y", "1000.00", "-", "25.0", "%"]


def test_an_optional_column_is_there_where_any_row_has_a_value():
    one, other = Line(frequency_Hz=1, name="Y"), Line(frequency_Hz=2, name="X", growth_rate_1_per_s=-0.04)
    assert not any("growth" in line for line in printed(one, how=""))
    *_, first, second = printed(one, other, how="")
    assert first == ["Y", "1.00", "-", "-", "25.0", "%"]
    assert second == ["X", "2.00", "-", "0.0", "25.0", "%"]  # round-off has no sign
    assert [each.label for each in table_of(Line, [])[0]] == ["mode", "measured\n{how}", "±", "part"]


def test_a_field_that_is_added_is_a_column_of_the_table_the_page_and_the_schema_by_itself():
    class More(Line):
        """The same with one more."""

        energy_J: Annotated[float, Column("energy", ".3g", "kinetic energy of it")]

    more = More(frequency_Hz=1, name="Y", energy_J=0.12345)
    columns, ((*_, energy, _),) = table_of(More, [more])
    assert energy == "0.123"
    assert "energy\nJ" in [each.heading(how="") for each in columns]
    assert columns_of(More)["energy_J"].title == "Energy, J"
    assert 'value="0.12345"' in cell(values_of(more)[-2], columns_of(More)["energy_J"])
    schema = More.model_json_schema(mode="serialization")["properties"]
    assert schema["energy_J"]["description"] == "kinetic energy of it"
    assert schema["fraction"]["description"] == "Its fraction of all."  # of a property what stands below it
    assert "description" not in schema["name"]


def test_a_class_that_is_no_model_has_columns_too():
    @dataclass
    class Cost:
        time_s: Annotated[float, Column("time", ".1f")]
        label: str

    assert values_of(Cost(2.0, "x")) == [2.0]
    assert columns_of(Cost)["time_s"].heading() == "time\ns"


def test_cells_are_shown_by_their_columns_and_short_rows_are_filled_up():
    file, columns = io.StringIO(), (Column("run"), Column("used", ">"), Column("size", ".1e", missing="none"))
    rows = [("one", True, 1.0), None, ("two", False, math.nan), ("three",)]
    print_cells(Console(file=file, width=200), "Runs", columns, rows)
    lines = [line.split() for line in file.getvalue().splitlines()]
    for line in (["one", "yes", "1.0e+00"], ["two", "no", "none"], ["three"]):
        assert lines.count(line) == 1


@pytest.mark.parametrize(
    ("field", "unit"),
    [
        ("growth_rate_1_per_s", "1/s"), ("drum_speed_rate_rad_per_s2", "rad/s^2"), ("velocity_m_per_s", "m/s"),
        ("volume_m3", "m3"), ("measured_Hz", "Hz"), ("scene_value", ""), ("share_of_slip", ""),
    ],
)  # fmt: skip
def test_the_unit_is_the_one_that_the_name_ends_in(field, unit):
    assert unit_in(field) == unit


def test_a_value_has_as_many_digits_as_its_uncertainty_leaves_it():
    assert [to_digits(1.3e8, 3), to_digits(0.5, 2), to_digits(12.0, 2)] == ["1.30e8", "0.50", "12"]
    assert to_uncertainty(1234.5678, 0.5) == "1234.57"

    class Fitted(Finding):
        value: Annotated[float, Column("fitted", "~4", within="uncertainty")]
        uncertainty: float | None

    cells = table_of(Fitted, [Fitted(value=1234.5678, uncertainty=each) for each in (None, 0.5)])[1]
    assert cells == [["1235"], ["1234.57"]]


def test_what_has_no_number_is_an_empty_cell_of_a_csv():
    assert rows_to_csv([{"a": 1, "b": math.nan}, {"b": None, "c": False}]) == "a,b,c\n1,,\n,,False\n"
