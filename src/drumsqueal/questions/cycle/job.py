"""The search for a cycle, and cycles along a parameter, into one folder."""

from pathlib import Path
from typing import Any

from rich.console import Console

from drumsqueal.errors import CycleError
from drumsqueal.files.json_file import write_json
from drumsqueal.files.output_folder import (
    BRANCH,
    BRANCH_SUMMARY,
    BRANCH_TABLE,
    CYCLE,
    CYCLE_HISTORY,
    CYCLE_SUMMARY,
    write_whole,
)
from drumsqueal.findings.history import COMPLETE, to_dataset
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.questions.cycle.branch_figure import draw_branch
from drumsqueal.questions.cycle.branch_table import diagram_data, print_diagram, to_csv
from drumsqueal.questions.cycle.branches import follow_cycle
from drumsqueal.questions.cycle.figure import draw_cycle
from drumsqueal.questions.cycle.orbit import Cycle
from drumsqueal.questions.cycle.search import Search, find_cycle
from drumsqueal.questions.cycle.table import print_search, search_data
from drumsqueal.scene import Scene
from drumsqueal.scene.quantities import printable
from drumsqueal.scene.variation import Variation
from drumsqueal.terminal.progress import telling
from drumsqueal.terminal.study import told_what_is_kept
from drumsqueal.terminal.style import save_figures


def find_into(folder: Path, scene: Scene, console: Console) -> dict[str, Any]:
    """Find a cycle of a scene, write summary, samples and figure into the folder, print and return what was found.

    Raises CycleError where there is none, and IntegrationError for a search that was interrupted.
    """
    with told_what_is_kept(folder / CYCLE_SUMMARY):
        with telling(console) as show:
            search = find_cycle(scene, show)
        found = search_data(search)
        write_json(found, folder / CYCLE_SUMMARY)
        _write_period(folder / CYCLE_HISTORY, search)
        stop_if_interrupted()
        save_figures({CYCLE: draw_cycle(search)}, folder)
        stop_if_interrupted()
    print_search(console, search)
    console.print(printable(f"Summary, one period and figure are in {folder}"), soft_wrap=True)
    return found


def follow_into(folder: Path, scene: Scene, variation: Variation, console: Console) -> dict[str, Any]:
    """Follow the cycles along a parameter, write table, summary and figure, print and return what was found.

    The table grows on disk cycle by cycle. Raises IntegrationError for a study that was interrupted, and CycleError
    where no cycle was found.
    """
    rows: list[tuple[int, Cycle]] = []
    with told_what_is_kept(folder / BRANCH_TABLE):
        with telling(console) as show:

            def keep(branch: int, cycle: Cycle) -> None:
                rows.append((branch, cycle))
                write_whole(folder / BRANCH_TABLE, to_csv(variation, rows).encode())
                at = variation.told(cycle.parameter, ".4g")
                show(f"branch {branch + 1}, {len(rows)} cycles, {variation.key} = {at}")

            show("eigenvalues")
            diagram = follow_cycle(scene, variation.key, variation.first, variation.last, keep)
        if not diagram.branches:
            raise CycleError("; ".join(["no cycle was found in this range", *diagram.notes]))
        write_whole(folder / BRANCH_TABLE, to_csv(variation, None, diagram).encode())
        found = diagram_data(diagram, variation)
        write_json(found, folder / BRANCH_SUMMARY)
        stop_if_interrupted()
        save_figures({BRANCH: draw_branch(diagram, variation)}, folder)
        stop_if_interrupted()
    print_diagram(console, diagram, variation)
    console.print(printable(f"Table, summary and figure are in {folder}"), soft_wrap=True)
    return found


def _write_period(path: Path, search: Search) -> None:
    """One period of samples, with the signals of a history."""
    cycle = search.cycle
    period = to_dataset([cycle.samples], search.scene, cycle.names, COMPLETE)
    period.attrs |= {"period_s": cycle.period_s, "stable": "yes" if cycle.stable else "no"}
    write_whole(path, bytes(period.to_netcdf(engine="h5netcdf")))
