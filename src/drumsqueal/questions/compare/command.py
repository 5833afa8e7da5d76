"""`drumsqueal compare HISTORY MEASURED -o DIR`."""

from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.errors import RequestError
from drumsqueal.files.claims import claim_results
from drumsqueal.files.output_folder import FILES, HISTORY, history_file
from drumsqueal.ordinary import open_ordinary
from drumsqueal.terminal.options import (
    SIGNALS,
    JsonFile,
    Overwrite,
    Quiet,
    Since,
    Until,
    output_option,
    read_fraction,
    read_rate,
    read_time,
    words,
)
from drumsqueal.terminal.reply import Reply

HistoryFile = Annotated[
    Path, typer.Argument(metavar="HISTORY", help="The history.nc of a run, or its folder.", show_default=False)
]
MeasuredFile = Annotated[
    Path, typer.Argument(metavar="MEASURED", help="Measured record: CSV, UFF58 or WAV.", show_default=False)
]
SIGNAL = "Simulated signal, such as velocity_Y or brake_torque."
DEFAULT = "Default: surface_velocity, of several shoes that of the one that moves most."
HDF5 = b"\x89HDF"  # how the files begin
UNIT = 'Unit of the values where the file states none, such as "mm/s", g or, calibrated, "50 mm/s".'


def compare_command(
    history: HistoryFile,
    measured: MeasuredFile,
    output: Annotated[Path | None, output_option("HISTORY-compare")] = None,
    signal: Annotated[
        str | None,
        typer.Option(
            "--signal", metavar="NAME", help=f"{SIGNAL} {DEFAULT}", autocompletion=words(*SIGNALS), show_default=False
        ),
    ] = None,
    channel: Annotated[
        str | None,
        typer.Option("--channel", metavar="NAME|N", help="Measured channel, by name or number.", show_default=False),
    ] = None,
    rate: Annotated[
        str | None,
        typer.Option("--rate", metavar="RATE", help='Sample rate of a file without one, such as "51.2 kHz".'),
    ] = None,
    unit: Annotated[str | None, typer.Option("--unit", metavar="UNIT", help=UNIT, show_default=False)] = None,
    since: Since = None,
    until: Until = None,
    within: Annotated[
        str, typer.Option("--within", metavar="FRACTION", help="Largest distance between the two lines of a pair.")
    ] = "5%",
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Which measured lines are simulated, and how far apart are they?

    Compares the lines of a measured record with the simulated ones and with the eigenvalues.

    Writes compare.csv, compare.json and compare.png into DIR. A measured acceleration or displacement is compared with
    a simulated velocity line by line; a record without a unit, such as a microphone's, by frequency and relative level.
    Levels are those of rms values, re ISO 1683. --from and --until take a part of MEASURED.

    Example: drumsqueal compare out/nominal rig.csv --channel vibrometer --unit mm/s
    """
    if is_history(measured) and not is_history(history):
        why = f"{measured} is a history and {history} is not: the history comes first"
        raise RequestError(f"{why}; write drumsqueal compare {measured} {history}")
    read, whole = (history_file(history), measured), history.absolute()
    # Where the history is called as every run calls it, its folder is its name.
    name = whole.parent.name if whole.name == HISTORY else whole.stem
    folder = output if output is not None else Path("out") / f"{name}-compare"
    reply = Reply.next_to(folder, FILES["compare"], read, quiet, json_file, overwrite=overwrite)
    claim_results(read[0].parent)
    widest = read_fraction(within, "--within")
    begin, end, sampled = read_time(since, "--from"), read_time(until, "--until"), read_rate(rate, "--rate")
    from drumsqueal.questions.compare.answer import COMPARED
    from drumsqueal.questions.compare.measured import read_measured
    from drumsqueal.questions.compare.study import compare_measured
    from drumsqueal.terminal.reply import answer

    record = read_measured(measured, channel, rate=sampled, unit=unit, first=begin, last=end)
    with reply.progress() as progress:  # what cannot be done is reported before there is a folder
        found = compare_measured(history, record, signal, within=widest, file=measured, progress=progress)
    answer(reply, COMPARED, lambda *_: found)


def is_history(path: Path) -> bool:
    """Whether there is an HDF5 file, as every history is, or a folder with one."""
    file = history_file(path)
    try:
        with open_ordinary(file, file.stat().st_size) as start:
            return start.read(len(HDF5)) == HDF5
    except (OSError, ValueError):  # reported where the file is read
        return False
