"""`drumsqueal sensitivity SCENE -o DIR`."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.errors import IntegrationError
from drumsqueal.files.output_folder import FILES
from drumsqueal.scene import load_with_tables
from drumsqueal.scene.variation import SYNTAX, read_variation
from drumsqueal.terminal.options import (
    JsonFile,
    Overwrite,
    Quiet,
    SceneFile,
    Settings,
    UsageError,
    complete_list,
    complete_range,
    output_option,
    words,
)
from drumsqueal.terminal.reply import Reply

VALUES = 6  # of a range without xN
_UNTIL = "Also find what makes the brake stable, and quiet after disturbances: each number alone, and together."
_AT = (
    "Where else --until stable must make it quiet: a range of speeds, loads or another number, N values, "
    f"{VALUES} without xN. Repeat it for every combination."
)
_VARY = "What --until stable may change (default: the design, not speed, load and radius). Repeatable."


def sensitivity_command(
    scene: SceneFile,
    output: Annotated[Path | None, output_option("SCENE-sensitivity")] = None,
    until: Annotated[
        str | None, typer.Option("--until", metavar="stable", help=_UNTIL, autocompletion=words("stable"))
    ] = None,
    vary: Annotated[
        list[str] | None, typer.Option("--vary", metavar="KEY,KEY...", help=_VARY, autocompletion=complete_list)
    ] = None,
    at: Annotated[
        list[str] | None, typer.Option("--at", metavar=SYNTAX, help=_AT, autocompletion=complete_range)
    ] = None,
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """What should be changed to make the brake quiet?

    Differentiates every growth rate with respect to every parameter of the scene.

    Writes sensitivity.csv, sensitivity.json, sensitivity.png and, with --until stable, quiet.png, and quiet.toml: the
    changed scene, if no disturbance that was tried makes it squeal. It is quiet at the scene's speed and load, and
    where --at asks for it.

    Example: drumsqueal sensitivity scenarios/damped.toml -o out/quiet --until stable
    """
    if until not in (None, "stable"):
        raise UsageError(f"--until {until}: write --until stable, or leave it out")
    if vary and until is None:
        raise UsageError("--vary names what --until stable may change; add --until stable")
    if at and until is None:
        raise UsageError("--at names where --until stable must make it quiet; add --until stable")
    loaded, tables = load_with_tables(scene, settings or ())
    keys = [key.strip() for part in vary for key in part.split(",")] if vary else None
    ranges = [read_variation(text, loaded, option="--at", points=VALUES) for text in at or ()]
    folder = output if output is not None else Path("out") / f"{scene.stem}-sensitivity"
    reply = Reply.next_to(folder, FILES["sensitivity"], (scene,), quiet, json_file, overwrite=overwrite)
    from drumsqueal.questions.sensitivity.answer import sensitivity_answer
    from drumsqueal.questions.sensitivity.study import check_request, study_sensitivity
    from drumsqueal.questions.sensitivity.words import not_found
    from drumsqueal.terminal.reply import answer

    until_stable = until is not None
    check_request(
        loaded, keys, until_stable=until_stable, at=ranges
    )  # what cannot be done is reported before there is a folder
    study = partial(study_sensitivity, loaded, until_stable=until_stable, keys=keys, at=ranges, tables=tables)
    how = sensitivity_answer(until_stable=until_stable)
    found = answer(reply, how, lambda progress, keep: study(progress=progress, keep=keep))
    if found.quiet is not None and not found.quiet.succeeded:
        raise IntegrationError(not_found(found))
