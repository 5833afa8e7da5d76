"""`drumsqueal cycle SCENE -o DIR [--along KEY=FROM..TO]`."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.files.output_folder import FILES
from drumsqueal.scene import load_scene
from drumsqueal.scene.variation import read_variation
from drumsqueal.terminal.options import JsonFile, Overwrite, Quiet, SceneFile, Settings, complete_range, output_option
from drumsqueal.terminal.reply import Reply

ALONG = "Follow the cycles along a parameter of the scene instead, in SI units or with units, as in drum.speed=1..40."


def cycle_command(
    scene: SceneFile,
    output: Annotated[Path | None, output_option("SCENE-cycle")] = None,
    along: Annotated[
        str | None,
        typer.Option("--along", metavar="KEY=FROM..TO", help=ALONG, show_default=False, autocompletion=complete_range),
    ] = None,
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Find limit cycles, stable or unstable, and their folds.

    Period, amplitudes and Floquet multipliers of the periodic motion itself.

    Writes cycle.json, cycle.nc (one period) and cycle.png into DIR; with --along, which follows the cycles along a
    parameter through folds, branch.csv, branch.json and branch.png.

    Example: drumsqueal cycle scenarios/damped.toml -o out/cycle --along drum.speed=1..40
    """
    loaded = load_scene(scene, settings or ())
    variation = None if along is None else read_variation(along, loaded, points=None)
    files = FILES["cycle"] if variation is None else FILES["branch"]
    folder = output if output is not None else Path("out") / f"{scene.stem}-cycle"
    reply = Reply.next_to(folder, files, (scene,), quiet, json_file, overwrite=overwrite)
    from drumsqueal.questions.cycle.answer import BRANCHES, CYCLES
    from drumsqueal.questions.cycle.study import checked, checked_range, find_cycle, follow_cycles, found_some
    from drumsqueal.questions.run.bistable import print_bistable
    from drumsqueal.simulation import constant_transient
    from drumsqueal.terminal.reply import answer

    # What cannot be done is reported before there is a folder.
    stability = constant_transient(checked(loaded)).stability
    if variation is None:
        answer(reply, CYCLES, lambda progress, _: find_cycle(loaded, progress=progress))
        print_bistable(reply.console, loaded, stability, scene, settings or (), squeals=True)
    else:
        checked_range(loaded, variation)
        follow = partial(follow_cycles, loaded, variation)
        answer(reply, BRANCHES, lambda progress, keep: found_some(follow(progress=progress, keep=keep)))
