"""A page about what a folder holds: read, filled in and written as one file."""

import importlib.metadata
from pathlib import Path
from typing import Any

from rich.console import Console

from drumsqueal.files.output_folder import write_whole
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.questions.report.found import RUN
from drumsqueal.questions.report.onset_page import onset_content
from drumsqueal.questions.report.page import MEGABYTE, render
from drumsqueal.questions.report.run_page import run_content
from drumsqueal.scene.quantities import printable


def report_into(file: Path, folder: Path, kind: str, console: Console) -> dict[str, Any]:
    """Write the page of a folder that holds a run or a study of the onset, print where, and return both as data.

    Raises RequestError for files that this version does not take, and OSError.
    """
    content = run_content(folder) if kind == RUN else onset_content(folder)
    stop_if_interrupted()
    page = render(f"{kind}.html", content | {"maker": importlib.metadata.version("drumsqueal")}).encode()
    stop_if_interrupted()
    write_whole(file, page)
    console.print(printable(content["headline"]), style="bold")
    if content["warning"]:
        console.print(printable(content["warning"]))
    size = f"{len(page) / MEGABYTE:.2f} MB"
    console.print(printable(f"The page is in {file}: {size}, opens without a network"), soft_wrap=True)
    return {"finding": content["headline"], "warning": content["warning"], "page": str(file), "bytes": len(page)}
