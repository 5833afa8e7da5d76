"""`drumsqueal motion SCENE -o DIR`."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.files.output_folder import MOTION_FILES
from drumsqueal.scene import load_scene
from drumsqueal.terminal.options import JsonFile, Overwrite, Quiet, SceneFile, Settings, output_option, read_duration
from drumsqueal.terminal.reply import Reply


def motion_command(
    scene: SceneFile,
    output: Annotated[Path | None, output_option("SCENE-motion")] = None,
    duration: Annotated[
        str, typer.Option("--duration", metavar="TIME", help="How long to record once it has settled.")
    ] = "5 s",
    at_most: Annotated[
        str,
        typer.Option("--at-most", metavar="TIME", help="Computing time to make do with."),
    ] = "600 s",
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Periodic, quasi-periodic or chaotic? With the evidence.

    Recurrence, fundamental frequencies and Lyapunov exponents must agree; where they do not, it says how long a record
    it takes.

    Writes motion.json, motion.csv (lines and what they are combinations of) and figures into DIR.

    Example: drumsqueal motion scenarios/nominal.toml -o out/motion --duration "3 s"
    """
    loaded = load_scene(scene, settings or ())
    length, limit = read_duration(duration, "--duration"), read_duration(at_most, "--at-most")
    folder = output if output is not None else Path("out") / f"{scene.stem}-motion"
    reply = Reply.beside(folder, MOTION_FILES, (scene,), quiet, json_file, overwrite=overwrite)
    from drumsqueal.questions.motion.answer import MOTION
    from drumsqueal.questions.motion.study import checked, study_motion
    from drumsqueal.simulation import check_sample_rate, prepare
    from drumsqueal.terminal.runner import answer

    check_sample_rate(prepare(checked(loaded)))  # what cannot be done is told before there is a folder
    study = partial(study_motion, loaded, length, at_most=limit)
    answer(reply, MOTION, lambda progress, keep: study(progress=progress, keep=keep))
