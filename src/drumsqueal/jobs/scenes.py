"""The shipped scenes, listed or copied."""

from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.files.output_folder import write_whole
from drumsqueal.scene.quantities import printable
from drumsqueal.scene.shipped import shipped_scenes


def list_scenes(console: Console) -> list[dict[str, str]]:
    """Print and return name, title and what it shows of every shipped scene."""
    table = Table(title="Shipped scenes", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in ("name", "title", "what it shows"):
        table.add_column(heading, no_wrap=heading == "name")
    scenes = shipped_scenes()
    for scene in scenes:
        table.add_row(scene.name, scene.title, scene.shows)
    console.print(table)
    console.print("`drumsqueal scenes NAME` copies one; every command also takes the name itself.", style="dim")
    return [{"name": scene.name, "title": scene.title, "shows": scene.shows} for scene in scenes]


def copy_scene(source: Path, target: Path, console: Console) -> dict[str, Any]:
    """Copy a scene to a file, and print and return where it is. Raises OSError."""
    write_whole(target, source.read_bytes())
    console.print(printable(f"{target} is a copy of the scene {source.stem}"), soft_wrap=True)
    return {"name": source.stem, "file": str(target)}
