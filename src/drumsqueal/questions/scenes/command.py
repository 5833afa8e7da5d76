"""`drumsqueal scenes [NAME] [-o FILE]`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from drumsqueal.files.output_folder import write_whole
from drumsqueal.findings.columns import Column
from drumsqueal.scene.quantities import printable
from drumsqueal.scene.shipped import shipped_path, shipped_scenes
from drumsqueal.terminal.options import JsonFile, Overwrite, Quiet, UsageError, complete_name
from drumsqueal.terminal.reply import Reply, answer_without_folder
from drumsqueal.terminal.tables import print_cells


def scenes_command(
    name: Annotated[
        str | None,
        typer.Argument(metavar="[NAME]", help="The scene to copy.", show_default=False, autocompletion=complete_name),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Where to copy it to (default: ./NAME.toml).")
    ] = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """List the shipped scenes, or copy one to start from.

    Example: drumsqueal scenes damped -o out.toml
    """
    if name is None and output is not None:
        raise UsageError(f"-o {output} is where a scene is copied to; name the scene, too")
    source = None if name is None else shipped_path(name)
    target = output or (source and Path(source.name))
    if source is None or target is None:
        reply = Reply(quiet, json_file, overwrite=overwrite)
        shown = [{"name": each.name, "title": each.title, "shows": each.shows} for each in shipped_scenes()]
        answer_without_folder(reply, _print_scenes, lambda _: shown)
    else:
        reply = Reply.with_file(target, (source,), quiet, json_file, overwrite=overwrite)
        write_whole(target, source.read_bytes())
        copied = {"name": source.stem, "file": str(target)}
        words = printable(f"Copied the scene {source.stem}")
        answer_without_folder(reply, lambda console, _: console.print(words), lambda _: copied)


def _print_scenes(console: Console, scenes: Sequence[dict[str, str]]) -> None:
    """Print name, title and what it shows of every scene; into a pipe, a line each and no more."""
    if not console.is_terminal:
        name, title = (max(map(len, texts)) for texts in ([s["name"] for s in scenes], [s["title"] for s in scenes]))
        for scene in scenes:
            console.print(f"{scene['name']:<{name}}  {scene['title']:<{title}}  {scene['shows']}")
        return
    columns = map(Column, ("name", "title", "what it shows"))
    print_cells(console, "Shipped scenes", columns, (tuple(scene.values()) for scene in scenes))
    console.print("`drumsqueal scenes NAME` copies one; every command also takes the name itself.", style="dim")
