"""A study of the onset into one folder: the table grows on disk value by value, then the summary and the figure."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from drumsqueal.files.json_file import write_json
from drumsqueal.files.output_folder import ONSET, ONSET_SUMMARY, ONSET_TABLE, write_whole
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.questions.cycle.branches import Diagram, follow_cycle
from drumsqueal.questions.cycle.orbit import Cycle
from drumsqueal.questions.onset.figure import draw_onset
from drumsqueal.questions.onset.rows import Row
from drumsqueal.questions.onset.study import OnsetStudy, Prediction, compare
from drumsqueal.questions.onset.table import predicted_to_data, print_study, to_csv, to_data
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal.progress import counting_bar, telling
from drumsqueal.terminal.study import told_what_is_kept
from drumsqueal.terminal.style import save_figures


def study_into(
    folder: Path, predicted: Prediction, within: float, console: Console, *, smallest_kick: bool = False, cycles: bool
) -> dict[str, Any]:
    """Compare a prediction with transients, write table, summary and figure, print and return what was found.

    With `smallest_kick` it is sought, too; with `cycles` they are followed over the range and drawn into the figure.

    Raises IntegrationError for a study that was interrupted; the values done until then are in the table, what was
    asked and predicted is in the summary.
    """
    with told_what_is_kept(folder / ONSET_TABLE):
        study = _study(folder, predicted, within, console, smallest_kick=smallest_kick)
        found = to_data(study)
        write_json(found, folder / ONSET_SUMMARY)
        stop_if_interrupted()
        diagram = _follow(predicted, console) if cycles else None
        if diagram is not None:
            found = to_data(study, diagram)
            write_json(found, folder / ONSET_SUMMARY)
        save_figures({ONSET: draw_onset(study, diagram)}, folder)
        stop_if_interrupted()
    print_study(console, study, diagram)
    console.print(printable(f"Table, summary and figure are in {folder}"), soft_wrap=True)
    return found


def _study(folder: Path, predicted: Prediction, within: float, console: Console, *, smallest_kick: bool) -> OnsetStudy:
    names = predicted.family.moving

    def keep(rows: Sequence[Row]) -> None:
        if not (folder / ONSET_SUMMARY).exists():  # what is asked, for those who find a table that was cut off
            write_json(predicted_to_data(predicted, within, smallest_kick), folder / ONSET_SUMMARY)
        table = to_csv(rows, predicted.variation, predicted.linear, names)
        write_whole(folder / ONSET_TABLE, table.encode())

    with counting_bar(console) as progress:
        task = progress.add_task("compiling")

        def show(what: str, done: int, total: int) -> None:
            progress.update(task, description=what, completed=done, total=total)

        return compare(predicted, within, keep, show, smallest_kick=smallest_kick)


def _follow(predicted: Prediction, console: Console) -> Diagram:
    variation = predicted.variation
    with telling(console) as tell:

        def show(branch: int, cycle: Cycle) -> None:
            tell(f"cycles, branch {branch + 1}, {variation.key} = {variation.told(cycle.parameter, '.4g')}")

        tell("cycles")
        return follow_cycle(predicted.scene, variation.key, variation.first, variation.last, show)
