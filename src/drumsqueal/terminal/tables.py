"""How the commands print their tables: in a window of any width, no number is cut."""

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from rich.cells import cell_len
from rich.console import Console
from rich.measure import Measurement
from rich.table import Column, Table
from rich.text import Text

from drumsqueal.terminal.streams import NARROWEST


def print_model(console: Console, model: Mapping[str, Sequence[str]]) -> None:
    """Print which effects a model includes and which it leaves out."""
    console.print(f"Includes: {'; '.join(model['includes'])}", style="dim")
    console.print(f"Leaves out: {'; '.join(model['leaves_out']) or 'nothing'}", style="dim")


def print_notes(console: Console, notes: Iterable[str]) -> None:
    """Print what is odd about a scene, each note on a line of its own."""
    for note in notes:
        console.print(f"Note: {note}", style="bold")


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


def _widths(column: Column) -> tuple[int, int]:
    """Of the longest line and the longest word."""
    lines = [line for text in (column.header, *column.cells) for line in str(text).split("\n")]
    return max(map(cell_len, lines)), max(cell_len(word) for line in lines for word in line.split(" "))


def signed(value: float, how: str) -> str:
    """A number by a format such as "+.3f"; without a sign where it is shown as zero."""
    text = f"{value:{how}}"
    return text.lstrip("+-") if float(text) == 0 else text


def rows_to_csv(rows: Sequence[dict[str, Any]]) -> str:
    """CSV with a column for every key of any row, in the order in which they come."""
    text = io.StringIO()
    writer = csv.DictWriter(text, dict.fromkeys(column for row in rows for column in row), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
