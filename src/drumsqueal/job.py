"""One run into one folder: the history grows on disk while the bar moves, then summary and figures."""

from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from drumsqueal.errors import IntegrationError
from drumsqueal.figures import draw_all, save_figures
from drumsqueal.history import COMPLETE, HistoryFile
from drumsqueal.integrate import Chunk
from drumsqueal.output_folder import HISTORY, SUMMARY
from drumsqueal.report import print_result
from drumsqueal.simulation import Prepared, collect, finish
from drumsqueal.summary import summarise, write_json


def run_into(folder: Path, prepared: Prepared, console: Console) -> None:
    """Run a prepared scene and write history, summary and figures into the folder.

    Raises IntegrationError for a run that failed or was interrupted, after writing what was computed, and OSError when
    the disk does not take the data.
    """
    with HistoryFile(folder / HISTORY, prepared.scene, prepared.model.names) as file, _progress(console) as progress:
        task = progress.add_task("compiling", total=prepared.scene.simulate.duration, reached="")

        def show(chunk: Chunk) -> None:
            file.append(chunk)
            reached = float(chunk.time[-1])
            progress.update(task, description="integrating", completed=reached, reached=f"{reached:.4f} s")

        chunks, outcome = collect(prepared, show)
        file.close(outcome)
    result = finish(prepared, chunks, outcome)
    write_json(summarise(result), folder / SUMMARY)
    save_figures(draw_all(result, prepared.model), folder)
    print_result(console, result)
    console.print(f"History, summary and figures are in {folder}")
    if outcome != COMPLETE:
        raise IntegrationError(f"{outcome}; what was computed is in {folder}")


def _progress(console: Console) -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("simulated {task.fields[reached]}"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )
