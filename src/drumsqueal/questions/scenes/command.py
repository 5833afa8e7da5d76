"""`drumsqueal scenes [NAME] [-o FILE]`."""

from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.files.output_folder import write_whole
from drumsqueal.questions.scenes.answer import print_copy, print_scenes
from drumsqueal.scene.shipped import shipped_path, shipped_scenes
from drumsqueal.terminal.completion import complete_name
from drumsqueal.terminal.options import JsonFile, Overwrite, Quiet, UsageError
from drumsqueal.terminal.reply import Reply
from drumsqueal.terminal.runner import answer_without_folder


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
        answer_without_folder(reply, print_scenes, lambda _: shown)
    else:
        reply = Reply.with_file(target, (source,), quiet, json_file, overwrite=overwrite)
        write_whole(target, source.read_bytes())
        copied = {"name": source.stem, "file": str(target)}
        answer_without_folder(reply, print_copy, lambda _: copied)
