"""The figure of a noise matrix: a cell for each scene and procedure, coloured by its level, with its frequency."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from drumsqueal.questions.matrix.found import CellDisturbance, CellFound, CellVerdict, NoiseMatrix, in_rows, shown_axes
from drumsqueal.terminal import style
from drumsqueal.terminal.style import frame, new_figure, styled

COLOURS = "YlOrRd"
ROW_MM, LOWEST_MM, MARGIN_MM = 9.0, 60.0, 34.0
MOST_ROWS, MOST_COLUMNS = 60, 16  # more would be too small to read: the table has them all
DARK_FROM = 0.65  # of the scale: text is white on what is darker
SPAN = 12.0  # dB from the softest to the loudest, at least


@styled()
def draw_matrix(found: NoiseMatrix) -> Figure | None:
    """Draw rows by columns; quiet cells are white, a ring marks squeal after a large disturbance only."""
    columns, rows = in_rows(found)
    if len(rows) > MOST_ROWS or len(columns) > MOST_COLUMNS:
        return None
    large = "; framed: after a large disturbance only" * bool(found.squeal_after_large_only)
    subject = f"{found.squeal} of {len(found.cells)} squeal{large}"
    figure = new_figure(found.title or "Noise matrix", subject)
    figure.set_figheight(max(LOWEST_MM, MARGIN_MM + ROW_MM * len(rows)) / style.MM_PER_INCH)
    axes = figure.subplots()
    levels = [cell.level_dB for cell in found.cells if math.isfinite(cell.level_dB)]
    loudest = max(levels, default=0.0)
    norm = Normalize(min(*levels, loudest - SPAN) if levels else -SPAN, loudest)
    colours = ScalarMappable(norm, COLOURS)
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
    dark = loud and bottom is not None and top is not None and cell.level_dB > bottom + DARK_FROM * (top - bottom)
    ink = "white" if dark else style.DARK
    if loud and cell.disturbance is CellDisturbance.LARGE:
        axes.add_patch(Rectangle((x - 0.46, y - 0.42), 0.92, 0.84, fill=False, edgecolor=ink, linewidth=0.9))
    text = f"{cell.frequency_Hz:.0f} Hz" if loud else "quiet" if cell.verdict is CellVerdict.QUIET else "?"
    axes.text(x, y, text, ha="center", va="center", fontsize=style.SMALL_SIZE, color=ink)
