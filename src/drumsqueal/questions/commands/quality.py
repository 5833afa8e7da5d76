"""The commands on the quality of a result: `effects`, `accuracy`."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.scene import load_scene, setting_choices
from drumsqueal.terminal.options import (
    JsonFile,
    Overwrite,
    Quiet,
    SceneFile,
    Settings,
    UsageError,
    output_option,
    read_fraction,
    words,
)
from drumsqueal.terminal.reply import Reply, answer


def effects_command(
    context: typer.Context,
    scene: SceneFile,
    output: Annotated[Path | None, output_option("SCENE-effects")] = None,
    within: Annotated[str, typer.Option(metavar="FRACTION", help="Required accuracy, such as 1 %.")] = "1 %",
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
    reply = Reply.with_folder("effects", output, (scene,), quiet, json_file, overwrite=overwrite)
    from drumsqueal.questions.effects.answer import EFFECTS_ANSWER
    from drumsqueal.questions.effects.study import study_effects
    from drumsqueal.simulation import check_transient, prepare

    check_transient(prepare(loaded))  # a scene that cannot be run is reported before there is a folder
    study = partial(study_effects, loaded, accuracy)
    answer(reply, EFFECTS_ANSWER, lambda progress, keep: study(progress=progress, keep=keep))


def accuracy_command(
    scene: SceneFile,
    output: Annotated[Path | None, output_option("SCENE-accuracy")] = None,
    target: Annotated[
        str, typer.Option(metavar="FRACTION", help='Required relative accuracy, such as 1e-4 or "1 %".')
    ] = "1e-4",
    solvers: Annotated[
        list[str] | None,
        typer.Option(
            "--solver",
            metavar="NAME",
            help="Further solver to try, e.g. diffrax.Kvaerno5. Repeatable.",
            autocompletion=words(*setting_choices("simulate.solver")),
        ),
    ] = None,
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """How large is the error, and what does a smaller one cost?

    Compares methods, tolerances and quadratures with an independent reference. Writes accuracy.csv, three figures and
    simulate.toml, the cheapest settings that meet the target, into DIR.

    Example: drumsqueal accuracy scenarios/nominal.toml -o out/accuracy --target 1e-5
    """
    loaded = load_scene(scene, settings or ())
    wanted = read_fraction(target, "--target")
    reply = Reply.with_folder("accuracy", output, (scene,), quiet, json_file, overwrite=overwrite)
    from drumsqueal.questions.accuracy.answer import ACCURACY
    from drumsqueal.questions.accuracy.study import check_motion, check_solvers, study_accuracy
    from drumsqueal.simulation import check_transient, prepare

    check_motion(loaded)  # what cannot be done is reported before there is a folder
    check_transient(prepare(loaded))
    check_solvers(loaded, solvers or ())
    study = partial(study_accuracy, loaded, wanted, solvers=solvers or ())
    answer(reply, ACCURACY, lambda progress, keep: study(progress=progress, keep=keep))
