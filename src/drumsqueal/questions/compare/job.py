"""A comparison with a measured record into one folder: table, summary and figure."""

from pathlib import Path
from typing import Any

from rich.console import Console

from drumsqueal.files.json_file import write_json
from drumsqueal.files.output_folder import COMPARE, COMPARE_SUMMARY, COMPARE_TABLE, write_whole
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.questions.compare.figure import draw_comparison
from drumsqueal.questions.compare.study import MeasuredComparison
from drumsqueal.questions.compare.table import comparison_data, print_comparison, to_csv
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal.study import told_what_is_kept
from drumsqueal.terminal.style import save_figures


def compare_into(folder: Path, comparison: MeasuredComparison, measured: Path, console: Console) -> dict[str, Any]:
    """Write table, summary and figure into the folder, print and return what was found.

    Raises IntegrationError where it was interrupted or the disk does not take it.
    """
    with told_what_is_kept(folder / COMPARE_TABLE):
        write_whole(folder / COMPARE_TABLE, to_csv(comparison).encode())
        found = comparison_data(comparison, measured)
        write_json(found, folder / COMPARE_SUMMARY)
        stop_if_interrupted()
        save_figures({COMPARE: draw_comparison(comparison)}, folder)
        stop_if_interrupted()
    print_comparison(console, comparison)
    console.print(printable(f"Table, summary and figure are in {folder}"), soft_wrap=True)
    return found
