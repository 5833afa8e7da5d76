"""The tables of the commands in windows of any width: every number is there, whole."""

import io
import re
from pathlib import Path

import numpy as np
import pytest
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from drumsqueal import questions
from drumsqueal.scene import load_scene
from drumsqueal.terminal.tables import print_table

SCENARIOS = Path(__file__).parents[2] / "scenarios"
SENTENCE = "from the drum's axis to the middle of the lining, along the direction of the load, in steady sliding"


def printed(table: Table, width: int) -> list[str]:
    file = io.StringIO()
    print_table(Console(file=file, width=width, markup=False, emoji=False, highlight=False), table)
    return file.getvalue().splitlines()


def a_table(numbers: np.ndarray) -> Table:
    table = Table(title="A table", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("mode")
    for k in range(numbers.shape[1]):
        table.add_column(f"quantity {k}\n1/s", justify="right")
    table.add_column("meaning")
    for k, row in enumerate(numbers):
        table.add_row(Text(f"Y{k}", style="bold"), *(f"{value:+.4f}" for value in row), SENTENCE)
    return table


@pytest.mark.parametrize("columns", [1, 3, 7])
def test_a_table_holds_every_number_and_word_in_windows_of_any_width(columns):
    numbers = np.random.default_rng(3).uniform(-1e6, 1e6, (4, columns))
    for width in (20, 30, 40, 60, 80, 120, 300):
        lines = printed(a_table(numbers), width)
        words = " ".join(lines).split()
        for value in numbers.flat:
            assert f"{value:+.4f}" in words
        assert "…" not in "".join(words)
        for word in SENTENCE.split():
            assert words.count(word) >= len(numbers) * SENTENCE.split().count(word)
        assert max(map(len, lines)) <= width


def test_no_word_of_a_table_is_broken_that_has_room_in_the_window():
    key = "support.stiffness_of_the_upper_and_lower_springs"
    table = Table(title="Keys", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in ("number", "meaning"):
        table.add_column(heading)
    table.add_row(key, SENTENCE)
    for width in range(len(key) + len("meaning  "), 180):
        lines = printed(table, width)
        assert key in " ".join(lines).split()
        assert max(map(len, lines)) <= width


def test_a_window_too_narrow_for_the_numbers_gets_a_block_of_lines_for_each_row():
    table = Table("mode", title="Modes")
    table.add_column("growth\n1/s", justify="right")
    table.add_column("frequency\nHz", justify="right")
    table.add_row("Tx", "-847.446", "")
    table.add_row("Y", "+76.157", "1424.32")
    assert printed(table, 24) == [
        "Modes",
        "",
        "mode          Tx",
        "growth 1/s    -847.446",
        "",
        "mode          Y",
        "growth 1/s    +76.157",
        "frequency Hz  1424.32",
        "",
    ]


def test_the_modes_of_a_scene_are_whole_in_a_narrow_window(drumsqueal, monkeypatch):
    scene = str(SCENARIOS / "nominal.toml")
    monkeypatch.setenv("COLUMNS", "200")
    wide = drumsqueal("stability", scene)[1]
    numbers = re.findall(r"[-+]?\d+\.\d+", wide)
    assert len(numbers) > 15
    for width in ("40", "60", "80"):
        monkeypatch.setenv("COLUMNS", width)
        narrow = drumsqueal("stability", scene)[1]
        assert re.findall(r"[-+]?\d+\.\d+", narrow) == numbers
        assert max(map(len, narrow.splitlines())) <= int(width)


def test_no_job_prints_a_table_in_another_way():
    for path in Path(str(questions.__file__)).parent.rglob("*.py"):
        text = path.read_text()
        assert "from rich.table import" not in text or "print_table" in text or path.name == "tables.py"
        assert "console.print(table" not in text or path.name == "tables.py"


def test_the_scenes_are_a_line_each_in_a_pipe(drumsqueal, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    lines = drumsqueal("scenes")[1].splitlines()
    assert [line.split()[0] for line in lines] == sorted(path.stem for path in SCENARIOS.glob("*.toml"))
    for line in lines:
        assert load_scene(SCENARIOS / f"{line.split()[0]}.toml").title in line
