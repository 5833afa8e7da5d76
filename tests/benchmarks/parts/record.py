"""What the benchmark keeps: every raw figure, the targets with what was reached, and the machine it ran on."""

import csv
import os
import platform
import re
from collections.abc import Container, Iterable
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple

from rich import box
from rich.console import Console
from rich.table import Table

PACKAGES = ("drumsqueal", "jax", "jaxlib", "diffrax", "numpy", "scipy", "numba", "numbalsoda", "scikit-sundae")

TARGET_HEADINGS = ("part", "target", "reached", "verdict")
# In a page of the docs, around what the benchmark writes of some of its parts.
MARKED = re.compile("(<!-- measured: ([a-z ]+) -->).*?(<!-- end -->)", re.DOTALL)


class Figure(NamedTuple):
    """One number: what of whom, at which setting, in which repeat."""

    part: str
    configuration: str
    setting: str
    quantity: str
    unit: str
    repeat: int
    value: float | str


class Target(NamedTuple):
    """What was to be reached, what was, and whether that is enough (None: nobody can tell, or asked)."""

    part: str
    wanted: str
    reached: str
    met: bool | None
    remark: str = ""

    @property
    def verdict(self) -> str:
        """In words."""
        if self.met is None:
            return self.remark or "not measured"
        return "met" if self.met else f"missed {self.remark}".rstrip()


class Record:
    """Figures and targets, gathered over the parts."""

    def __init__(self, console: Console) -> None:
        """Nothing yet."""
        self.console = console
        self.figures: list[Figure] = []
        self.targets: list[Target] = []
        self.part, self.tables = "", dict[str, list[str]]()  # those of each part that was measured

    def begin(self, part: str) -> None:
        """What is shown from now on is of that part."""
        self.part = part
        self.tables[part] = []

    def keep(
        self,
        part: str,
        configuration: str,
        quantity: str,
        unit: str,
        values: float | Iterable[float],
        setting: str = "",
    ) -> None:
        """Note a number, or one for each repeat."""
        several = [values] if isinstance(values, int | float) else list(values)
        for repeat, value in enumerate(several, start=1):
            self.figures.append(Figure(part, configuration, setting, quantity, unit, repeat, float(value)))

    def aim(self, part: str, wanted: str, reached: str, met: bool | None, remark: str = "") -> None:
        """Note a target, what was reached, and by how much it is missed if it is."""
        self.targets.append(Target(part, wanted, reached, met, remark))

    def say(self, text: str) -> None:
        """Print a line as it is."""
        self.console.print(text, markup=False, highlight=False)

    def show(self, title: str, headings: Iterable[str], rows: Iterable[Iterable[str]]) -> None:
        """Print a table whose first column is text, and keep it for the docs."""
        self._print(title, headings, rows := [list(row) for row in rows], numbers=True)
        self.tables[self.part].append(f"{title}:\n\n{_markdown(headings, rows)}")

    def show_targets(self) -> None:
        """Print the table that says what was reached."""
        self._print("Targets", TARGET_HEADINGS, self._target_rows({each.part for each in self.targets}), numbers=False)

    def _target_rows(self, parts: Container[str]) -> list[list[str]]:
        found = (each for each in self.targets if each.part in parts)
        return [[each.part, each.wanted, each.reached, each.verdict] for each in found]

    def _print(self, title: str, headings: Iterable[str], rows: list[list[str]], *, numbers: bool) -> None:
        table = Table(title=title, box=box.SIMPLE_HEAD)
        for column, heading in enumerate(headings):
            table.add_column(heading, justify="right" if numbers and column else "left")
        for row in rows:
            table.add_row(*row)
        self.console.print(table)

    def write_docs(self, page: Path) -> None:
        """Put machine, targets and tables between the marks of a page, where all parts of these were measured."""
        machine = describe_machine()
        measured = f"Measured on {machine['date']} on {machine['cores']} cores of an {machine['processor']}."

        def fill(marked: re.Match[str]) -> str:
            parts = marked[2].split()
            if not all(part in self.tables for part in parts):
                return marked[0]
            tables = [table for part in parts for table in self.tables[part]]
            return "\n\n".join(
                [marked[1], measured, _markdown(TARGET_HEADINGS, self._target_rows(parts)), *tables, marked[3]]
            )

        page.write_text(MARKED.sub(fill, page.read_text(encoding="utf-8")), encoding="utf-8")

    def write(self, file: Path) -> None:
        """All of it as CSV: the machine first, then the figures, then the targets."""
        machine = [Figure("machine", "", "", name, "", 1, value) for name, value in describe_machine().items()]
        ends = [Figure(t.part, "", t.wanted, "target", "", 1, f"{t.reached}: {t.verdict}") for t in self.targets]
        with file.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow(Figure._fields)
            writer.writerows([*machine, *self.figures, *ends])


def _markdown(headings: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    lines = [list(headings), *map(list, rows)]
    lines.insert(1, ["---"] * len(lines[0]))
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def describe_machine() -> dict[str, str]:
    """Versions, processor and date."""
    found = {"date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"), "python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found | {"processor": _processor(), "cores": str(os.cpu_count())}


def _processor() -> str:
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()
