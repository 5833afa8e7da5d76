"""`drumsqueal motion SCENE -o DIR`."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.files.output_folder import FILES
from drumsqueal.scene import load_scene
from drumsqueal.terminal.options import JsonFile, Overwrite, Quiet, SceneFile, Settings, output_option, read_duration
from drumsqueal.terminal.reply import Reply


def motion_command(
    scene: SceneFile,
    output: Annotated[Path | None, output_option("SCENE-motion")] = None,
    duration: Annotated[
        str, typer.Option("--duration", metavar="TIME", help="Duration of the record, after the motion has settled.")
    ] = "5 s",
    at_most: Annotated[
        str,
        typer.Option("--at-most", metavar="TIME", help="Limit of the computing time."),
    ] = "600 s",
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Is the motion periodic, quasi-periodic or chaotic?

    Recurrence, fundamental frequencies and Lyapunov exponents must agree; where they do not, the
    command reports how long a record is needed.

    Writes motion.json, motion.csv (spectral lines with their combinations) and figures into DIR.

    Example: drumsqueal motion scenarios/nominal.toml -o out/motion --duration "3 s"
    """
    loaded = load_scene(scene, settings or ())
    length, limit = read_duration(duration, "--duration"), read_duration(at_most, "--at-most")
    folder = output if output is not None else Path("out") / f"{scene.stem}-motion"
    reply = Reply.next_to(folder, FILES["motion"], (scene,), quiet, json_file, overwrite=overwrite)
    from drumsqueal.findings.kinds import Kind
    from drumsqueal.questions.motion.answer import MOTION
    from drumsqueal.questions.motion.study import study_motion
    from drumsqueal.questions.run.bistable import print_bistable
    from drumsqueal.simulation import constant_transient
    from drumsqueal.terminal.reply import answer

    stability = constant_transient(loaded).stability  # what cannot be done is reported before there is a folder
    study = partial(study_motion, loaded, length, at_most=limit)
    found = answer(reply, MOTION, lambda progress, keep: study(progress=progress, keep=keep))
    print_bistable(reply.console, loaded, stability, scene, settings or (), squeals=found.kind is not Kind.STEADY)
