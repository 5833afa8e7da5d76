"""What a run leaves beside its history: summary, figures, and the comparison on the terminal."""

from pathlib import Path

from rich.console import Console

from drumsqueal.figures import draw_all, save_figures
from drumsqueal.files.output_folder import SUMMARY
from drumsqueal.files.summary import summarise, summarise_prediction, write_json
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.jobs.run_tables import print_result
from drumsqueal.scene.quantities import printable
from drumsqueal.simulation import Prepared, Result


def write_results(folder: Path, prepared: Prepared, result: Result) -> None:
    """Write summary and figures into the folder. Raises OSError, and KeyboardInterrupt between two files."""
    write_json(summarise(result), folder / SUMMARY)
    stop_if_interrupted()
    figures = draw_all(result, prepared.model)
    stop_if_interrupted()
    save_figures(figures, folder)


def write_prediction(folder: Path, prepared: Prepared, outcome: str) -> None:
    """Write the summary of a run that left no samples: the prediction alone. Raises OSError."""
    write_json(summarise_prediction(prepared, outcome), folder / SUMMARY)


def print_results(folder: Path, result: Result, console: Console) -> None:
    """Print the comparison and where the files are."""
    print_result(console, result)
    console.print(printable(f"History, summary and figures are in {folder}"), soft_wrap=True)
