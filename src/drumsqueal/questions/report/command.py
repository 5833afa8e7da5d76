"""`drumsqueal report DIR`."""

from pathlib import Path
from typing import Annotated

import typer

from drumsqueal.errors import RequestError
from drumsqueal.files.claims import claim_results
from drumsqueal.files.output_folder import FILES, HISTORY, REPORT, SUMMARY, check_ending, files_of_run
from drumsqueal.terminal.options import JsonFile, Overwrite, Quiet, read_file, read_folder
from drumsqueal.terminal.reply import Reply


def report_command(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR",
            parser=read_folder,
            help="Folder with the results of run, onset or matrix.",
            show_default=False,
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
    """Make one HTML page of the results of run, onset or matrix.

    The page needs no network. It holds the verdict, figures, animated modes, sound, accuracy, scene and versions.

    Example: drumsqueal report out/nominal
    """
    kind = what_is_in(folder)
    file = folder / REPORT if output is None else output
    check_ending(file, (".html", ".htm"), "a page")
    read = [folder / name for name in (*files_of_run(folder), *FILES["onset"], *FILES["matrix"]) if name != REPORT]
    reply = Reply.with_file(file, read, quiet, json_file, overwrite=overwrite)
    claim_results(folder)
    from drumsqueal.questions.report.answer import print_page, write_page
    from drumsqueal.terminal.reply import answer_without_folder

    answer_without_folder(reply, print_page, lambda progress: write_page(file, folder, kind, progress))


def what_is_in(folder: Path) -> str:
    """Whose results a folder holds, "run", "onset" or "matrix". Raises RequestError for none, and for several."""
    kinds = {"run": (SUMMARY, HISTORY), "onset": ("onset.json", "onset.csv"), "matrix": ("matrix.json", "matrix.nc")}
    try:
        if not folder.is_dir():
            there = "a file, not a folder" if folder.exists() else "not there"
            raise RequestError(f"{folder} is {there}; name a folder that drumsqueal run, onset or matrix wrote")
        held = [kind for kind, files in kinds.items() if any((folder / name).is_file() for name in files)]
    except OSError as error:
        raise RequestError(f"{folder}: cannot be read ({error.strerror or error})") from None
    if not held:
        wanted = f"a run ({SUMMARY}, {HISTORY}), a study of the onset (onset.json) or a matrix (matrix.json)"
        raise RequestError(f"{folder} does not hold {wanted}; name a folder that one of them wrote")
    if len(held) > 1:
        raise RequestError(
            f"{folder} holds the results of {' and '.join(held)}; put one of them into a folder of its own"
        )
    return held[0]
