"""What a run leaves beside its history: summary, figures, and the comparison on the terminal."""

from pathlib import Path
from typing import Any

from rich.console import Console

from drumsqueal.files.json_file import write_json
from drumsqueal.files.output_folder import FIGURES, SUMMARY, figure_file
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.questions.run.figures import draw_all
from drumsqueal.questions.run.summary import summarise, summarise_prediction
from drumsqueal.questions.run.tables import print_result
from drumsqueal.scene.quantities import printable
from drumsqueal.simulation import Prepared, Result
from drumsqueal.terminal.style import save_figures


def write_results(folder: Path, prepared: Prepared, result: Result) -> tuple[dict[str, Any], list[str]]:
    """Write summary and figures into the folder, and return the summary and the figures for which there was too little.

    Raises OSError, and KeyboardInterrupt between two files.
    """
    summary = summarise(result)
    write_json(summary, folder / SUMMARY)
    stop_if_interrupted()
    figures = draw_all(result, prepared.model)
    stop_if_interrupted()
    save_figures(figures, folder)
    return summary, [figure_file(name) for name in FIGURES if name not in figures]


def write_prediction(folder: Path, prepared: Prepared, outcome: str) -> None:
    """Write the summary of a run that left no samples: the prediction alone. Raises OSError."""
    write_json(summarise_prediction(prepared, outcome), folder / SUMMARY)


def print_results(folder: Path, result: Result, left_out: list[str], console: Console) -> None:
    """Print the comparison, where the files are, and the figures that are `left_out`."""
    print_result(console, result)
    if left_out:
        console.print(f"Not written, because this record has nothing to show there: {', '.join(left_out)}", style="dim")
    console.print(printable(f"History, summary and figures are in {folder}"), soft_wrap=True)
