"""`drumsqueal report DIR`."""

from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.files.claims import claim_results
from drumsqueal.files.output_folder import ONSET_FILES, REPORT, RUN_FILES, check_ending
from drumsqueal.terminal.options import JsonFile, Overwrite, Quiet, read_file, read_folder
from drumsqueal.terminal.reply import Reply


def report_command(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR", parser=read_folder, help="Folder with the results of run or onset.", show_default=False
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", parser=read_file, help=f"The page (default: DIR/{REPORT})."),
    ] = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    json_file: JsonFile = None,
) -> None:
    """Make one HTML page of the results of run or onset.

    The page needs no network. It holds the verdict, figures, animated modes, sound, accuracy, scene and versions.

    Example: drumsqueal report out/nominal
    """
    from drumsqueal.questions.report.found import what_is_in

    kind = what_is_in(folder)
    file = folder / REPORT if output is None else output
    check_ending(file, (".html", ".htm"), "a page")
    read = [folder / name for name in (*RUN_FILES, *ONSET_FILES) if name != REPORT]
    reply = Reply.with_file(file, read, quiet, json_file, overwrite=overwrite)
    claim_results(folder)
    from drumsqueal.questions.report.answer import print_page, write_page
    from drumsqueal.terminal.runner import answer_without_folder

    answer_without_folder(reply, print_page, lambda progress: write_page(file, folder, kind, progress))
