"""`drumsqueal fit SCENE MEASURED --vary KEY -o DIR`."""

from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.errors import IntegrationError
from drumsqueal.files.claims import claim_results
from drumsqueal.files.output_folder import FILES, history_file
from drumsqueal.questions.compare.command import SIGNAL, is_history
from drumsqueal.scene import load_with_tables
from drumsqueal.terminal.options import (
    SIGNALS,
    JsonFile,
    Overwrite,
    Quiet,
    SceneFile,
    Settings,
    Since,
    Until,
    complete_list,
    output_option,
    read_rate,
    read_time,
    words,
)
from drumsqueal.terminal.reply import Reply

MeasuredFile = Annotated[
    Path,
    typer.Argument(metavar="MEASURED", help="Measured record: CSV, UFF58, WAV or a history.", show_default=False),
]
KINDS = ("linear", "saturated")
_VARY = "Number to fit, such as contact.stiffness. Repeatable."
_KIND = "Take MEASURED as small vibration (linear) or as saturated squeal; seen from the record without it."
_DEFAULT = "Default: surface_velocity, of several shoes that of the first."
_CHANNEL = "Measured channel, by name or number; signal of a history."


def fit_command(
    scene: SceneFile,
    measured: MeasuredFile,
    vary: Annotated[
        list[str] | None, typer.Option("--vary", metavar="KEY,KEY...", help=_VARY, autocompletion=complete_list)
    ] = None,
    output: Annotated[Path | None, output_option("SCENE-fit")] = None,
    kind: Annotated[
        str | None, typer.Option("--as", metavar="KIND", help=_KIND, autocompletion=words(*KINDS), show_default=False)
    ] = None,
    channel: Annotated[
        str | None, typer.Option("--channel", metavar="NAME|N", help=_CHANNEL, show_default=False)
    ] = None,
    rate: Annotated[
        str | None,
        typer.Option("--rate", metavar="RATE", help='Sample rate of a file without one, such as "51.2 kHz".'),
    ] = None,
    signal: Annotated[
        str | None,
        typer.Option(
            "--signal", metavar="NAME", help=f"{SIGNAL} {_DEFAULT}", autocompletion=words(*SIGNALS), show_default=False
        ),
    ] = None,
    since: Since = None,
    until: Until = None,
    settings: Settings = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Which numbers of the scene fit a measured record?

    Fits the numbers that --vary names to the lines of a measured record, with their uncertainty, and states what the
    record cannot determine. Small vibration (a ring-down, a hammer test, growing squeal) is compared with the
    eigenvalues, in frequency and growth rate; saturated squeal with transients.

    Writes fit.json, fit.png and, unless the lines are missed by far more than their uncertainty, fitted.toml, the scene
    with the fitted numbers, into DIR. --from and --until take a part of MEASURED.

    Example: drumsqueal fit scenarios/nominal.toml rig.wav --vary damping.ratio
    """
    keys = [key.strip() for part in vary or () for key in part.split(",") if key.strip()]
    loaded, tables = load_with_tables(scene, settings or ())
    folder = output if output is not None else Path("out") / f"{scene.stem}-fit"
    read = (scene, history_file(measured))
    reply = Reply.next_to(folder, FILES["fit"], read, quiet, json_file, overwrite=overwrite)
    if is_history(measured):
        claim_results(history_file(measured).parent)
    begin, end, sampled = read_time(since, "--from"), read_time(until, "--until"), read_rate(rate, "--rate")
    from drumsqueal.questions.fit.answer import FIT_ANSWER
    from drumsqueal.questions.fit.study import check_request, fit_scene, read_record, surface_signal
    from drumsqueal.questions.fit.words import why_missed
    from drumsqueal.scene.variation import Written
    from drumsqueal.terminal.reply import answer

    signal = signal or surface_signal(loaded)
    check_request(loaded, keys, kind, signal)
    record = read_record(measured, channel, signal, rate=sampled, first=begin, last=end)
    with reply.progress() as progress:  # what cannot be done is reported before there is a folder
        found = fit_scene(
            loaded,
            record,
            keys,
            kind=kind,
            signal=signal,
            file=measured,
            written=Written(loaded, tables),
            progress=progress,
        )
    answer(reply, FIT_ANSWER, lambda *_: found)
    if found.missed:
        raise IntegrationError(f"the fit {why_missed(found)}")
