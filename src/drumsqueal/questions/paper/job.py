"""The paper's figures into one folder: their data first, then transients over them, the figures and the statements."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console

from drumsqueal.files.json_file import write_json
from drumsqueal.files.output_folder import PAPER_TABLE, STATEMENTS, STATEMENTS_TABLE, write_whole
from drumsqueal.findings.history import versions
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.questions.paper.curves import Curve, FrictionCurve
from drumsqueal.questions.paper.figure import draw_paper
from drumsqueal.questions.paper.study import PaperStudy, study_paper
from drumsqueal.questions.paper.table import curves_to_csv, describe_statements, print_statements, statements_to_csv
from drumsqueal.scene import Scene
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal.progress import counting_bar
from drumsqueal.terminal.study import told_what_is_kept
from drumsqueal.terminal.style import save_figures


def study_into(folder: Path, scene: Scene, console: Console) -> dict[str, Any]:
    """Recompute the paper's figures, write them with their data into the folder, print and return the statements.

    Raises IntegrationError for a study that failed or was interrupted; the curves made until then are in the table.
    """
    with told_what_is_kept(folder / PAPER_TABLE):
        study = _study(folder, scene, console)
        table = curves_to_csv(study.friction, study.curves, study.points)
        write_whole(folder / PAPER_TABLE, table.encode())
        write_whole(folder / STATEMENTS_TABLE, statements_to_csv(study.statements).encode())
        found = {"scene": scene.model_dump(mode="json"), "statements": describe_statements(study.statements)}
        found |= {"versions": versions()}
        write_json(found, folder / STATEMENTS)
        stop_if_interrupted()
        save_figures(draw_paper(study), folder)
        stop_if_interrupted()
    print_statements(console, study.statements)
    console.print(printable(f"Figures, their data and the statements are in {folder}"), soft_wrap=True)
    return found


def _study(folder: Path, scene: Scene, console: Console) -> PaperStudy:
    with counting_bar(console) as progress:
        task = progress.add_task("eigenvalues", total=None)

        def keep(friction: FrictionCurve, curves: Mapping[str, Curve]) -> None:
            write_whole(folder / PAPER_TABLE, curves_to_csv(friction, curves, {}).encode())

        def show(label: str, number: int, count: int) -> None:
            progress.update(task, description=label, completed=number, total=count)

        return study_paper(scene, on_curves=keep, on_point=show)
