"""`drumsqueal sensitivity SCENE -o DIR`."""

from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.files.output_folder import SENSITIVITY_FILES
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.scene import load_scene
from drumsqueal.terminal.completion import complete_list, words
from drumsqueal.terminal.options import JsonFile, Overwrite, Quiet, SceneFile, Settings, UsageError, output_option
from drumsqueal.terminal.reply import Reply


def sensitivity_command(
    scene: SceneFile,
    output: Annotated[Path | None, output_option("SCENE-sensitivity")] = None,
    until: Annotated[
        str | None,
        typer.Option(
            "--until",
            metavar="stable",
            help="Find the smallest change that makes it stable.",
            autocompletion=words("stable"),
        ),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="KEY,KEY...",
            autocompletion=complete_list,
            help="What --until stable may change (default: the design, not speed, load and radius). Repeatable.",
        ),
    ] = None,
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """What to change to make this brake quiet?

    How every growth rate goes with every number of the scene.

    Writes sensitivity.csv, sensitivity.json, sensitivity.png and, with --until stable, quiet.toml, the changed scene.

    Example: drumsqueal sensitivity scenarios/damped.toml --until stable -o out/quiet
    """
    if until not in (None, "stable"):
        raise UsageError(f"--until {until}: the one word that it takes is stable")
    if vary and until is None:
        raise UsageError("--vary says what --until stable may change; add --until stable")
    loaded = load_scene(scene, settings or ())
    keys = [key.strip() for part in vary for key in part.split(",")] if vary else None
    folder = output if output is not None else Path("out") / f"{scene.stem}-sensitivity"
    reply = Reply.beside(folder, SENSITIVITY_FILES, (scene,), quiet, json_file, overwrite=overwrite)
    stop_if_interrupted()
    from drumsqueal.questions.sensitivity.job import check_request, study_into

    stop_if_interrupted()
    check_request(loaded, keys, until_stable=until is not None)
    reply.clear()
    reply.send(study_into(folder, loaded, keys, reply.console, until_stable=until is not None))
