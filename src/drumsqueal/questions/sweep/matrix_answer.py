"""A noise matrix into one folder: matrix.nc fills cell by cell; then what is written, drawn and printed."""

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from rich.console import Console

from drumsqueal.errors import COMPLETE, NothingToDoError, RequestError
from drumsqueal.findings.columns import Column, table_of
from drumsqueal.questions.sweep.file import Source, fill_into, outcome_of
from drumsqueal.questions.sweep.matrix_found import (
    CellDisturbance,
    CellFound,
    NoiseMatrix,
    find_matrix,
    in_rows,
    shown_axes,
    shown_levels,
)
from drumsqueal.questions.sweep.matrix_plan import MatrixPlan
from drumsqueal.questions.sweep.points import CellVerdict
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal import style
from drumsqueal.terminal.reply import Answer, Reply
from drumsqueal.terminal.style import frame, new_figure, styled
from drumsqueal.terminal.tables import print_cells, rows_to_csv

# The figure of a noise matrix: a cell for each scene and procedure, coloured by its level, with its frequency.


_COLOURS = "YlOrRd"
_ROW_MM, _LOWEST_MM, _MARGIN_MM = 9.0, 60.0, 34.0
_MOST_ROWS, _MOST_COLUMNS = 60, 16  # more would be too small to read: the table has them all
_SPAN = 12.0  # dB from the softest to the loudest, at least


@styled()
def draw_matrix(found: NoiseMatrix) -> Figure | None:
    """Draw rows by columns; quiet cells are white, a ring marks squeal after a large disturbance only."""
    columns, rows = in_rows(found)
    if len(rows) > _MOST_ROWS or len(columns) > _MOST_COLUMNS:
        return None
    large = "; framed: after a large disturbance only" * bool(found.squeal_after_large_only)
    subject = f"{found.squeal} of {len(found.cells)} squeal{large}"
    figure = new_figure(found.title or "Noise matrix", subject)
    figure.set_figheight(max(_LOWEST_MM, _MARGIN_MM + _ROW_MM * len(rows)) / style.MM_PER_INCH)
    axes = figure.subplots()
    levels = [cell.level_dB for cell in found.cells if math.isfinite(cell.level_dB)]
    loudest = max(levels, default=0.0)
    norm = Normalize(min(*levels, loudest - _SPAN) if levels else -_SPAN, loudest)
    colours = ScalarMappable(norm, _COLOURS)
    for y, (_, cells) in enumerate(rows):
        for x, cell in enumerate(cells):
            _draw_cell(axes, x, y, cell, colours)
    axes.set_xlim(-0.5, len(columns) - 0.5)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xticks(range(len(columns)), columns)
    axes.set_yticks(range(len(rows)), [label or "all" for label, _ in rows])
    across, down = shown_axes(found)
    frame(axes, across.replace("_", " ").replace(".", " "), ", ".join(down).replace("_", " ").replace(".", " ") or None)
    axes.tick_params(length=0)
    bar = figure.colorbar(colours, ax=axes, pad=0.02)
    bar.set_label("rms velocity of the shoe\n(dB re 1 nm/s)")
    bar.ax.tick_params(labelsize=style.SMALL_SIZE)
    return figure


def _draw_cell(axes: Axes, x: int, y: int, cell: CellFound, colours: ScalarMappable) -> None:
    loud = math.isfinite(cell.level_dB)
    face = colours.to_rgba(np.asarray(cell.level_dB)) if loud else "white"
    axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor=face, edgecolor=style.FAINT, linewidth=0.6))
    bottom, top = colours.get_clim()
    # 0.65 of the scale: text is white on what is darker
    dark = loud and bottom is not None and top is not None and cell.level_dB > bottom + 0.65 * (top - bottom)
    ink = "white" if dark else style.DARK
    if loud and cell.disturbance is CellDisturbance.LARGE:
        axes.add_patch(Rectangle((x - 0.46, y - 0.42), 0.92, 0.84, fill=False, edgecolor=ink, linewidth=0.9))
    text = f"{cell.frequency_Hz:.0f} Hz" if loud else "quiet" if cell.verdict is CellVerdict.QUIET else "?"
    axes.text(x, y, text, ha="center", va="center", fontsize=style.SMALL_SIZE, color=ink)


def matrix_into(reply: Reply, plan: MatrixPlan, source: Source, *, resume: bool = False) -> NoiseMatrix:
    """Compute a noise matrix into the folder of a command, or go on with the one that is there.

    Raises RequestError for one that cannot be resumed, and IntegrationError for one that failed or was interrupted:
    the cells computed until then are in the file.
    """
    if resume:
        _check_resumed(reply.folder / "matrix.nc", plan)
    return fill_into(reply, MATRIX_ANSWER, plan, source, lambda data: find_matrix(data, plan), resume=resume)


def _check_resumed(path: Path, plan: MatrixPlan) -> None:
    if not path.exists():
        raise RequestError(f"{path.parent}: there is no noise matrix to resume; leave --resume out")
    if outcome_of(path, plan) == COMPLETE:
        raise NothingToDoError(f"{path.parent}: the noise matrix is complete, there is nothing to resume")


def print_matrix(console: Console, found: NoiseMatrix) -> None:
    """Print the cells that squeal, and how many are quiet."""
    if found.squeal:
        loud = [cell for cell in found.cells if cell.verdict is CellVerdict.SQUEALS]
        columns, rows = table_of(CellFound, loud)
        names = (name.replace(".", "\n").replace("_", " ") for name in shown_levels(found, loud[0]))
        levels = (shown_levels(found, cell).values() for cell in loud)
        rows = ((*labels, *row) for labels, row in zip(levels, rows, strict=True))
        print_cells(console, found.title or "Noise matrix", (*map(Column, names), *columns), rows)
    console.print(found.headline)
    if found.squeal:
        loudest = max(found.cells, key=lambda cell: cell.level_dB if math.isfinite(cell.level_dB) else -math.inf)
        where = ", ".join(f"{name} {label}" for name, label in shown_levels(found, loudest).items())
        size = f"{loudest.velocity_m_per_s:.3g} m/s rms of the shoe at {loudest.frequency_Hz:.4g} Hz"
        console.print(printable(f"Loudest: {size}{where and f', at {where}'}"))
        console.print("Levels: rms velocity of the shoe, over its mass and over time, re 1 nm/s (ISO 1683)")
    unclear = [cell for cell in found.cells if cell.verdict not in (CellVerdict.QUIET, CellVerdict.SQUEALS)]
    for cell in unclear:
        where = ", ".join(f"{name} {label}" for name, label in shown_levels(found, cell).items())
        console.print(printable(f"{cell.verdict}{where and f' ({where})'}: {cell.outcome}"))


def matrix_table(found: NoiseMatrix) -> str:
    """The cells as CSV: one row a cell; empty where there is no number."""
    return rows_to_csv(cell.levels | {key: value for key, value in cell if key != "levels"} for cell in found.cells)


MATRIX_ANSWER = Answer(
    words=print_matrix,
    summary="matrix.json",
    tables={"matrix.csv": matrix_table},
    figures={"matrix": draw_matrix},
    filled="matrix.nc",
)
