"""How the commands print their tables: in a window of any width, no number is cut."""

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from rich import box
from rich import table as rich_table
from rich.cells import cell_len
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from drumsqueal.findings.columns import Column, is_missing, table_of
from drumsqueal.terminal.streams import NARROWEST


def print_model(console: Console, model: Mapping[str, Sequence[str]]) -> None:
    """Print which effects a model includes and which it leaves out."""
    console.print(f"Includes: {'; '.join(model['includes'])}", style="dim")
    console.print(f"Leaves out: {'; '.join(model['leaves_out']) or 'nothing'}", style="dim")


def print_notes(console: Console, notes: Iterable[str]) -> None:
    """Print what is odd about a scene, each note on a line of its own."""
    for note in notes:
        console.print(f"Note: {note}", style="bold")


def print_rows(console: Console, title: str, kind: type, rows: Sequence[Any], **words: str) -> None:
    """Print a table of results of a class, a row each, by the columns that its fields are."""
    columns, cells = table_of(kind, rows)
    print_cells(console, title, columns, cells, tight=False, **words)


def print_cells(
    console: Console,
    title: str,
    columns: Iterable[Column],
    rows: Iterable[Sequence[Any] | None],
    *,
    tight: bool = False,
    **words: str,
) -> None:
    """Print a table of values with these columns; `words` are those of the headings.

    A row that is None ends a section, one that is too short is filled up.
    """
    columns, padding = list(columns), 0 if tight else (0, 1, 0, 0)
    table = Table(title=title, box=box.SIMPLE_HEAD, padding=padding)
    for each in columns:
        table.add_column(each.heading(**words), justify="right" if each.is_number else "left")
    for row in rows:
        if row is None:
            table.add_section()
        else:
            table.add_row(*(each.text(value) for each, value in zip(columns, row, strict=False)))
    print_table(console, table)


def print_table(console: Console, table: Table) -> None:
    """Print a table or, where the window is too narrow for it, every row as a block of lines.

    What is set to the right is a number, and stays whole; long text to the left folds between words.
    """
    spared = 0
    for column in table.columns:
        lines, words = _widths(column)
        least = lines if column.justify == "right" else min(lines, max(words, NARROWEST))
        column.no_wrap, column.overflow, column.min_width = least == lines, "fold", least
        spared += lines - least
    # 10_000 columns, in which any table has room
    whole = Measurement.get(console, console.options.update_width(10_000), table).maximum
    if whole - spared <= console.width:
        console.print(table)
    else:
        _print_rows(console, table)


def _print_rows(console: Console, table: Table) -> None:
    """A line for each cell that is not empty, after the heading of its column."""
    names = [" ".join(str(column.header).split()) for column in table.columns]
    widest = max(map(cell_len, names))
    console.print(Text(str(table.title), style="table.title"))
    for row in zip(*(column.cells for column in table.columns), strict=True):
        console.print()
        for name, cell in zip(names, row, strict=True):
            text = cell if isinstance(cell, Text) else Text(str(cell))
            if text.plain:
                console.print(Text(name.ljust(widest + 2)) + text)
    console.print()


def _widths(column: rich_table.Column) -> tuple[int, int]:
    """Of the longest line and the longest word."""
    lines = [line for text in (column.header, *column.cells) for line in str(text).split("\n")]
    return max(map(cell_len, lines)), max(cell_len(word) for line in lines for word in line.split(" "))


def rows_to_csv(rows: Iterable[Mapping[str, Any]]) -> str:
    """CSV with a column for every key of any row, in the order in which they come; empty where there is no number."""
    rows = list(rows)
    text = io.StringIO()
    writer = csv.DictWriter(text, dict.fromkeys(column for row in rows for column in row), lineterminator="\n")
    writer.writeheader()
    writer.writerows({key: None if is_missing(value) else value for key, value in row.items()} for row in rows)
    return text.getvalue()
