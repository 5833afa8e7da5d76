"""A page about what a folder holds: read, filled in and written as one file."""

from pathlib import Path

from rich.console import Console

from drumsqueal.files.output_folder import write_whole
from drumsqueal.findings.part import Finding
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.report.matrix_page import matrix_content
from drumsqueal.questions.report.onset_page import onset_content
from drumsqueal.questions.report.page import MEGABYTE, about_scene, render
from drumsqueal.questions.report.run_page import run_content
from drumsqueal.scene.quantities import printable


class Page(Finding):
    """A page: the finding at its head, the warning below it (None: none), the file and its size in bytes."""

    finding: str
    warning: str | None
    page: str
    bytes: int


def write_page(file: Path, folder: Path, kind: str, progress: Progress = silent) -> Page:
    """Write the page of a folder that holds results of the command `kind`, "run", "onset" or "matrix".

    Raises RequestError for files that this version does not take, and OSError.
    """
    progress("reading", 0.0, None)
    if kind == "matrix":
        found, content = matrix_content(folder)
    else:
        found, content = run_content(folder) if kind == "run" else onset_content(folder, progress)
        content |= about_scene(found.scene)
    progress("writing the page", 0.0, None)
    page = render(f"{kind}.html", content | {"found": found}).encode()
    progress("writing the page", 1.0, 1.0)
    write_whole(file, page)
    return Page(finding=content["headline"], warning=content["warning"], page=str(file), bytes=len(page))


def print_page(console: Console, page: Page) -> None:
    """Print the finding, the warning and how large the page is."""
    console.print(printable(page.finding), style="bold")
    if page.warning:
        console.print(printable(page.warning))
    console.print(f"The page has {page.bytes / MEGABYTE:.2f} MB and needs no network")
