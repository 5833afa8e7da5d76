"""A noise matrix into one folder: matrix.nc fills cell by cell; then what is written, drawn and printed."""

import math
from collections.abc import Callable

from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.errors import NothingToDoError, RequestError
from drumsqueal.files.output_folder import MATRIX, MATRIX_DATA, MATRIX_SUMMARY, MATRIX_TABLE
from drumsqueal.findings.history import COMPLETE
from drumsqueal.progress import Progress
from drumsqueal.questions.matrix.figure import draw_matrix
from drumsqueal.questions.matrix.found import CLEAR, CellVerdict, NoiseMatrix, shown_levels
from drumsqueal.questions.matrix.study import find_matrix, matrix_table
from drumsqueal.questions.sweep.file import SweepFile, outcome_of
from drumsqueal.questions.sweep.filling import Source, fill_file
from drumsqueal.questions.sweep.matrix_plan import MatrixPlan
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal.reply import Reply
from drumsqueal.terminal.runner import Answer, answer
from drumsqueal.terminal.tables import print_table


def matrix_into(reply: Reply, plan: MatrixPlan, source: Source, *, resume: bool = False) -> NoiseMatrix:
    """Compute a noise matrix into the folder of a command, or go on with the one that is there.

    Raises RequestError for one that cannot be resumed, and IntegrationError for one that failed or was interrupted:
    the cells computed until then are in the file.
    """
    file = SweepFile(reply.folder / MATRIX_DATA, plan)
    if resume:
        _check_resumed(file, plan)

    def find(progress: Progress, _: Callable[[NoiseMatrix], None]) -> NoiseMatrix:
        if resume:
            file.take_up()
        else:
            file.create(progress)
        return find_matrix(fill_file(file, plan, source, progress), plan)

    return answer(reply, MATRIX_ANSWER, find, record=file, resume=resume)


def _check_resumed(file: SweepFile, plan: MatrixPlan) -> None:
    if not file.path.exists():
        raise RequestError(f"{file.path.parent}: there is no noise matrix to resume; leave --resume out")
    if outcome_of(file.path, plan) == COMPLETE:
        raise NothingToDoError(f"{file.path.parent}: the noise matrix is complete, there is nothing to resume")


def print_matrix(console: Console, found: NoiseMatrix) -> None:
    """Print the cells that squeal, and how many are quiet."""
    if found.squeal:
        print_table(console, _table(found))
    console.print(found.headline)
    if found.squeal:
        loudest = max(found.cells, key=lambda cell: cell.level_dB if math.isfinite(cell.level_dB) else -math.inf)
        where = ", ".join(f"{name} {label}" for name, label in shown_levels(found, loudest).items())
        size = f"{loudest.velocity_m_per_s:.3g} m/s rms of the shoe at {loudest.frequency_Hz:.4g} Hz"
        console.print(printable(f"Loudest: {size}{where and f', at {where}'}"))
        console.print("Levels: rms velocity of the shoe, over its mass and over time, re 1 nm/s (ISO 1683)")
    unclear = [cell for cell in found.cells if cell.verdict not in CLEAR]
    for cell in unclear:
        where = ", ".join(f"{name} {label}" for name, label in shown_levels(found, cell).items())
        console.print(printable(f"{cell.verdict}{where and f' ({where})'}: {cell.outcome}"))


def _table(found: NoiseMatrix) -> Table:
    table = Table(title=found.title or "Noise matrix", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    loud = [cell for cell in found.cells if cell.verdict is CellVerdict.SQUEALS]
    names = list(shown_levels(found, loud[0]))
    procedures = any(math.isfinite(cell.time_s) for cell in loud)
    for name in names:
        table.add_column(name.replace(".", "\n").replace("_", " "))
    for heading in ("Hz", "dB", *("at s", "rad/s") * procedures):
        table.add_column(heading, justify="right")
    table.add_column("after a\ndisturbance")
    for cell in loud:
        at = ["" if math.isnan(each) else f"{each:.3g}" for each in (cell.time_s, cell.speed_rad_per_s)] * procedures
        labels = shown_levels(found, cell).values()
        table.add_row(*labels, f"{cell.frequency_Hz:.4g}", f"{cell.level_dB:.1f}", *at, cell.after or "")
    return table


MATRIX_ANSWER = Answer(
    words=print_matrix,
    summary=MATRIX_SUMMARY,
    tables={MATRIX_TABLE: matrix_table},
    figures={MATRIX: draw_matrix},
    filled=MATRIX_DATA,
)
