"""`drumsqueal accuracy SCENE -o DIR`."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.files.output_folder import FILES
from drumsqueal.scene import load_scene, setting_choices
from drumsqueal.terminal.options import (
    JsonFile,
    Overwrite,
    Quiet,
    SceneFile,
    Settings,
    output_option,
    read_fraction,
    words,
)
from drumsqueal.terminal.reply import Reply


def accuracy_command(
    scene: SceneFile,
    output: Annotated[Path | None, output_option("SCENE-accuracy")] = None,
    target: Annotated[
        str,
        typer.Option("--target", metavar="FRACTION", help='Required relative accuracy, such as 1e-4 or "1 %".'),
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
    folder = output if output is not None else Path("out") / f"{scene.stem}-accuracy"
    reply = Reply.next_to(folder, FILES["accuracy"], (scene,), quiet, json_file, overwrite=overwrite)
    from drumsqueal.questions.accuracy.answer import ACCURACY
    from drumsqueal.questions.accuracy.bench import check_motion, check_solvers
    from drumsqueal.questions.accuracy.study import study_accuracy
    from drumsqueal.simulation import check_transient, prepare
    from drumsqueal.terminal.reply import answer

    check_motion(loaded)  # what cannot be done is reported before there is a folder
    check_transient(prepare(loaded))
    check_solvers(loaded, solvers or ())
    study = partial(study_accuracy, loaded, wanted, solvers=solvers or ())
    answer(reply, ACCURACY, lambda progress, keep: study(progress=progress, keep=keep))
