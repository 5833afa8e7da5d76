"""`drumsqueal onset SCENE -o DIR --along KEY=FROM..TO`."""

from functools import partial
from pathlib import Path
from typing import Annotated, cast

import typer

from drumsqueal.files.output_folder import FILES
from drumsqueal.scene import load_scene
from drumsqueal.scene.variation import POINTS, SYNTAX, read_variation
from drumsqueal.terminal.options import (
    JsonFile,
    Overwrite,
    Quiet,
    SceneFile,
    Settings,
    complete_range,
    output_option,
    read_fraction,
)
from drumsqueal.terminal.reply import Reply

ALONG = (
    f"The parameter that is varied and its range, in SI units or with units; N values, {POINTS} without xN. "
    'Put a range with spaces in quotes: --along "drum.speed=10 rpm..400 rpm x20".'
)
WITHIN = "Find the ends of the bistable range to this fraction of the range."
SMALLEST = "Also find the smallest disturbance along a mode that starts squeal at each bistable value."
CYCLES = "Also follow the limit cycles, stable and unstable, and draw them into the figure."


def onset_command(
    scene: SceneFile,
    along: Annotated[
        str,
        typer.Option("--along", metavar=SYNTAX, help=ALONG, show_default=False, autocompletion=complete_range),
    ],
    output: Annotated[Path | None, output_option("SCENE-onset")] = None,
    within: Annotated[str, typer.Option("--within", metavar="FRACTION", help=WITHIN)] = "0.1 %",
    smallest_kick: Annotated[bool, typer.Option("--smallest-kick", help=SMALLEST)] = False,
    cycles: Annotated[bool, typer.Option("--cycles", help=CYCLES)] = False,
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Where does it squeal, and where only after a large disturbance?

    Finds the critical values of the eigenvalues, runs transients from small and large disturbances at each value, and
    continues each attractor at the neighbouring values. Writes onset.csv, onset.json and onset.png into DIR.

    Example: drumsqueal onset scenarios/damped.toml -o out/onset --along drum.speed=1..60
    """
    loaded = load_scene(scene, settings or ())
    variation = read_variation(along, loaded)
    fraction = read_fraction(within, "--within")
    folder = output if output is not None else Path("out") / f"{scene.stem}-onset"
    reply = Reply.next_to(folder, FILES["onset"], (scene,), quiet, json_file, overwrite=overwrite)
    from drumsqueal.findings.prediction import resolution_in_words, resolution_of
    from drumsqueal.questions.cycle.study import checked_range
    from drumsqueal.questions.onset.answer import ONSET
    from drumsqueal.questions.onset.found import OnsetStudy
    from drumsqueal.questions.onset.study import compare, predict
    from drumsqueal.terminal.reply import answer
    from drumsqueal.terminal.tables import print_notes

    if cycles:
        checked_range(loaded, variation)
    with reply.progress() as shown:  # what cannot be studied is reported before there is a folder
        predicted = predict(loaded, variation, shown)
        resolution = resolution_of(loaded, progress=shown)
    print_notes(reply.console, resolution_in_words(resolution))
    study = partial(compare, predicted, fraction, smallest_kick=smallest_kick, cycles=cycles)
    answer(reply, ONSET, lambda progress, keep: cast("OnsetStudy", study(progress=progress, keep=keep)))
