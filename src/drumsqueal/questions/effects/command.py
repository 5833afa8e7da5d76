"""`drumsqueal effects SCENE -o DIR`."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.files.output_folder import FILES
from drumsqueal.scene import load_scene
from drumsqueal.terminal.options import (
    JsonFile,
    Overwrite,
    Quiet,
    SceneFile,
    Settings,
    UsageError,
    output_option,
    read_fraction,
)
from drumsqueal.terminal.reply import Reply


def effects_command(
    context: typer.Context,
    scene: SceneFile,
    output: Annotated[Path | None, output_option("SCENE-effects")] = None,
    within: Annotated[
        str, typer.Option("--within", metavar="FRACTION", help="Required accuracy, such as 1 %.")
    ] = "1 %",
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Which effects does a scene need, and what does each cost?

    Leaves out each effect in turn, and compares growth rates, frequencies, amplitudes and computing time.

    Writes effects.csv, effects.png and reduced.toml, the scene with only the effects that it needs, into DIR.

    Example: drumsqueal effects scenarios/nominal.toml -o out/effects --within 2%
    """
    if context.args == ["%"] and "%" not in within:  # what the shell makes of --within 1 %
        within = f"{within} %"
    elif context.args:
        raise UsageError(f"Got unexpected extra argument ({context.args[0]})")
    loaded = load_scene(scene, settings or ())
    accuracy = read_fraction(within, "--within")
    folder = output if output is not None else Path("out") / f"{scene.stem}-effects"
    reply = Reply.next_to(folder, FILES["effects"], (scene,), quiet, json_file, overwrite=overwrite)
    from drumsqueal.questions.effects.answer import EFFECTS_ANSWER
    from drumsqueal.questions.effects.study import study_effects
    from drumsqueal.simulation import check_transient, prepare
    from drumsqueal.terminal.reply import answer

    check_transient(prepare(loaded))  # a scene that cannot be run is reported before there is a folder
    study = partial(study_effects, loaded, accuracy)
    answer(reply, EFFECTS_ANSWER, lambda progress, keep: study(progress=progress, keep=keep))
