"""The shipped scenes, listed or copied."""

from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.scene.quantities import printable
from drumsqueal.terminal.tables import print_table


def print_scenes(console: Console, scenes: Sequence[dict[str, str]]) -> None:
    """Print name, title and what it shows of every scene; into a pipe, a line each and no more."""
    if not console.is_terminal:
        name, title = (max(map(len, texts)) for texts in ([s["name"] for s in scenes], [s["title"] for s in scenes]))
        for scene in scenes:
            console.print(f"{scene['name']:<{name}}  {scene['title']:<{title}}  {scene['shows']}")
        return
    table = Table(title="Shipped scenes", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in ("name", "title", "what it shows"):
        table.add_column(heading)
    for scene in scenes:
        table.add_row(scene["name"], scene["title"], scene["shows"])
    print_table(console, table)
    console.print("`drumsqueal scenes NAME` copies one; every command also takes the name itself.", style="dim")


def print_copy(console: Console, copied: dict[str, str]) -> None:
    """Print what was copied."""
    console.print(printable(f"Copied the scene {copied['name']}"))
