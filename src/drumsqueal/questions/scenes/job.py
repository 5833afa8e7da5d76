"""The shipped scenes, listed or copied."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.files.output_folder import write_whole
from drumsqueal.scene.quantities import printable
from drumsqueal.scene.shipped import Shipped, shipped_scenes
from drumsqueal.terminal.tables import print_table


def list_scenes(console: Console) -> list[dict[str, str]]:
    """Print and return name, title and what it shows of every shipped scene; into a pipe, a line each and no more."""
    scenes = shipped_scenes()
    if console.is_terminal:
        _print_table(scenes, console)
    else:
        name, title = (max(map(len, texts)) for texts in ([s.name for s in scenes], [s.title for s in scenes]))
        for scene in scenes:
            console.print(f"{scene.name:<{name}}  {scene.title:<{title}}  {scene.shows}")
    return [{"name": scene.name, "title": scene.title, "shows": scene.shows} for scene in scenes]


def _print_table(scenes: Sequence[Shipped], console: Console) -> None:
    table = Table(title="Shipped scenes", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in ("name", "title", "what it shows"):
        table.add_column(heading)
    for scene in scenes:
        table.add_row(scene.name, scene.title, scene.shows)
    print_table(console, table)
    console.print("`drumsqueal scenes NAME` copies one; every command also takes the name itself.", style="dim")


def copy_scene(source: Path, target: Path, console: Console) -> dict[str, Any]:
    """Copy a scene to a file, and print and return where it is. Raises OSError."""
    write_whole(target, source.read_bytes())
    console.print(printable(f"{target} is a copy of the scene {source.stem}"), soft_wrap=True)
    return {"name": source.stem, "file": str(target)}
