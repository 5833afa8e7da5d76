"""A study of accuracy into one folder: the table grows on disk run by run, then the figures and the settings."""

from pathlib import Path
from typing import Any

from rich.console import Console

from drumsqueal.files.output_folder import ACCURACY_TABLE, BLOCK, CAUSES, EVALUATIONS, WORK, write_whole
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.questions.accuracy.figure import draw_causes, draw_work
from drumsqueal.questions.accuracy.study import AccuracyStudy, Measurement, study_accuracy
from drumsqueal.questions.accuracy.table import print_study, simulate_block, to_csv, to_data, verdict
from drumsqueal.scene import Scene
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal.study import told_what_is_kept
from drumsqueal.terminal.style import save_figures


def study_into(folder: Path, scene: Scene, target: float, console: Console) -> dict[str, Any]:
    """Study the accuracy of a scene, write table, figures and settings into the folder, print and return what it is.

    Raises IntegrationError for a study that failed or was interrupted; the runs made until then are in the table.
    """
    with told_what_is_kept(folder / ACCURACY_TABLE):
        study = _study(folder, scene, target, console)
        write_whole(folder / BLOCK, f"# {printable(verdict(study))}\n{simulate_block(study)}".encode())
        stop_if_interrupted()
        figures = {
            WORK: draw_work(study, against="time"),
            EVALUATIONS: draw_work(study, against="evaluations"),
            CAUSES: draw_causes(study),
        }
        save_figures(figures, folder)
        stop_if_interrupted()
    print_study(console, study)
    console.print(printable(f"Table, figures and these settings are in {folder}"), soft_wrap=True)
    return to_data(study)


def _study(folder: Path, scene: Scene, target: float, console: Console) -> AccuracyStudy:
    made: list[Measurement] = []
    with console.status("compiling") as status:

        def keep(measurement: Measurement) -> None:
            made.append(measurement)
            write_whole(folder / ACCURACY_TABLE, to_csv(made).encode())

        return study_accuracy(scene, target, on_measurement=keep, on_progress=lambda name: status.update(name))
