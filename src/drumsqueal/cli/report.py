"""`drumsqueal report DIR`."""

from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.cli.options import Overwrite, Quiet, make_console, read_file, read_folder
from drumsqueal.files.output_folder import REPORT, check_output_file
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.report.found import what_is_in


def report_command(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR", parser=read_folder, help="Folder that a run or an onset has left.", show_default=False
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", parser=read_file, help=f"The page (default: DIR/{REPORT})."),
    ] = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Make one page of a run or an onset that opens anywhere: verdict, figures, moving modes, sound, accuracy, scene.

    Writes one HTML file that needs no network.

    Example: drumsqueal report out/nominal
    """
    kind = what_is_in(folder)
    file = folder / REPORT if output is None else output
    check_output_file(file, overwrite=overwrite)
    stop_if_interrupted()
    from drumsqueal.jobs.report import report_into

    stop_if_interrupted()
    report_into(file, folder, kind, make_console(quiet=quiet))
