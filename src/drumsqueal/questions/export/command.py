"""`drumsqueal export HISTORY --to FORMAT`."""

import math
from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.errors import RequestError
from drumsqueal.files.claims import claim_results
from drumsqueal.files.output_folder import check_ending, history_file
from drumsqueal.questions.export.formats import FORMATS, find_format
from drumsqueal.terminal.options import (
    JsonFile,
    Overwrite,
    Quiet,
    Since,
    Until,
    complete_signals,
    read_file,
    read_rate,
    read_time,
    words,
)
from drumsqueal.terminal.reply import Reply, make_console

SOUND = "wav"
LEAST_RATE, MOST_RATE = 1000.0, 192_000.0  # Hz, that players take
_SIGNALS = (
    "Names with commas between, e.g. velocity,brake_torque,displacement_Y (default: all; for sound surface_velocity, "
    "of several shoes that of the one that moves most)."
)


def export_command(
    history: Annotated[
        Path, typer.Argument(metavar="HISTORY", help="A history, or the folder of a run.", show_default=False)
    ],
    to: Annotated[
        str,
        typer.Option("--to", metavar="FORMAT", help=f"One of {', '.join(FORMATS)}.", autocompletion=words(*FORMATS)),
    ],
    signals: Annotated[
        str | None, typer.Option("--signals", metavar="NAMES", help=_SIGNALS, autocompletion=complete_signals)
    ] = None,
    since: Since = None,
    until: Until = None,
    rate: Annotated[
        str | None,
        typer.Option("--rate", metavar="RATE", help="Resample (default: as recorded; for sound 44.1 kHz)."),
    ] = None,
    slow: Annotated[
        float | None,
        typer.Option("--slow", metavar="TIMES", help="Sound only: how many times slower, and lower."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", parser=read_file, help="File (default: next to HISTORY)."),
    ] = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Write a history for other programs, or as sound.

    The formats are csv, mat, npz, parquet, uff58 (universal file format) and wav.

    Example: drumsqueal export out/nominal --to wav --from "0.2 s" --slow 4
    """
    wanted = find_format(to)
    sound = to == SOUND
    if slow is not None and not sound:
        raise RequestError(f"--slow {slow:g} is for a sound; add --to wav, or leave --slow out")
    if slow is not None and not (math.isfinite(slow) and 0.01 <= slow <= 1000):
        raise RequestError(f"--slow {slow:g}: write how many times slower, from 0.01 to 1000, such as 4")
    asked = None if signals is None else tuple(name.strip() for name in signals.split(","))
    if sound and asked is not None and len(asked) != 1:
        raise RequestError(f"--signals {signals}: a sound is of one signal, such as surface_velocity")
    begin, end, sampled = read_time(since, "--from"), read_time(until, "--until"), read_rate(rate, "--rate")
    if sound and sampled is not None and not (sampled == round(sampled) and LEAST_RATE <= sampled <= MOST_RATE):
        why = f"that of a sound must be a whole number of Hz, from {LEAST_RATE / 1e3:g} to {MOST_RATE / 1e3:g} kHz"
        raise RequestError(f"--rate {sampled:.10g} Hz: {why}")
    source = history_file(history)
    file = output if output is not None else source.with_suffix(wanted.suffix)
    reply = Reply.with_file(file, (source,), quiet, json_file, overwrite=overwrite)
    claim_results(source.parent)
    from drumsqueal.files.saved_history import read_history
    from drumsqueal.findings.signals.sound import CD_RATE
    from drumsqueal.questions.export.export import Part, export_history, print_exported
    from drumsqueal.questions.export.signals import default_signal
    from drumsqueal.terminal.runner import answer_without_folder

    saved = read_history(history)
    check_ending(file, wanted.endings, f"a file of --to {to}")
    if sound:
        asked, sampled = asked or (default_signal(saved),), sampled or float(CD_RATE)
    part = Part(asked, begin, end, rate=sampled, slow=1.0 if slow is None else slow)
    complaints = make_console(stderr=True, quiet=quiet)
    answer_without_folder(
        reply,
        lambda console, done: print_exported(console, complaints, done),
        lambda progress: export_history(saved, file, wanted, part, progress=progress),
    )
