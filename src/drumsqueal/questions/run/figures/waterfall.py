"""Waterfall of a run-up or coast-down: spectra over the drum speed or the load, one panel for each way.

Where squeal sets in at another speed than that at which it dies out, the two differ.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Patch
from numpy.typing import NDArray

from drumsqueal.findings.instant import drives_of, instants_at, name_of_key, unit_of_key
from drumsqueal.findings.ramp import Ramp
from drumsqueal.findings.ramp_words import way_words
from drumsqueal.findings.squeals import SquealEnd
from drumsqueal.questions.run.figures.campbell import draw_campbell_lines, line_labels, line_legend
from drumsqueal.questions.run.figures.spectra import Content, edges, level_bar, levels, spectrogram_of
from drumsqueal.questions.run.figures.view import View
from drumsqueal.terminal import style
from drumsqueal.terminal.placement import label_right_edge, label_top_edge

COLUMNS = 600  # of the picture of one way
NOWHERE = style.FAINT  # where no window has its middle while it goes that way

Vector = NDArray[np.float64]


@style.styled()
def draw_waterfall(view: View) -> Figure | None:
    """Draw spectra over what changes, a panel for each way; None where the record is too short, or goes no way."""
    ramp, content = view.findings.ramp, spectrogram_of(view)
    if ramp is None or content is None or not ramp.keys:
        return None
    key = ramp.keys[0]
    instants, drive = instants_at(view.model, content.picture.time_s.tolist()), drives_of(view.model)[key]
    values = np.array([each.value(key) for each in instants])
    directions = np.array([way_words(each, (key,)) for each in instants])
    ways = [way for way in ("falling", "rising") if np.count_nonzero(directions == way) > 1]
    if not ways or not np.ptp(values) > 0:
        return None
    figure = style.new_figure(view.title, f"waterfall of the velocity of {content.coordinate}")
    rows = figure.subplots(len(ways), 1, sharex=True, sharey=True, squeeze=False)[:, 0].tolist()
    gaps = False
    for axes, way in zip(rows, ways, strict=True):
        image = _draw_way(axes, content, values, directions == way)
        gaps |= np.ma.is_masked(image.get_array())
        for line in ramp.lines:
            draw_campbell_lines(axes, line, np.array([drive.at(t)[0] for t in line.time_s]))
        style.frame(axes, None, "Frequency (kHz)")
        axes.set_xlim(values.min(), values.max())
        named = axes.text(
            0.985, 0.94, f"{name_of_key(key)} {way}", color="white", ha="right", va="top", transform=axes.transAxes
        )
        named.set_bbox({"facecolor": "black", "alpha": 0.6, "linewidth": 0})
        label_top_edge(axes, _marks(axes, ramp, key, way))
        label_right_edge(axes, line_labels(ramp, content.highest), reach=6.0)
    rows[-1].set_xlabel(
        f"{name_of_key(key).capitalize()} ({unit_of_key(key)}); windows of {content.window * 1e3:.3g} ms"
    )
    line_legend(rows[0], *[Patch(color=NOWHERE, label="no spectrum")] * gaps)
    level_bar(figure, image, rows, content)
    return figure


def _draw_way(axes: Axes, content: Content, values: Vector, chosen: NDArray[np.bool_]) -> AxesImage:
    """Draw the spectra of one way over what changes: of several passages the loudest, where there is none nothing."""
    grid = np.linspace(values.min(), values.max(), COLUMNS)
    picture = np.full((content.picture.frequency_Hz.size, COLUMNS), np.nan)
    for some in np.split(np.arange(values.size), np.flatnonzero(np.diff(chosen)) + 1):
        if not chosen[some[0]] or some.size < 2:
            continue
        order = some[np.argsort(values[some], kind="stable")]
        inside = (grid >= values[order[0]]) & (grid <= values[order[-1]])
        nearest = np.round(np.interp(grid[inside], values[order], np.arange(order.size))).astype(int)
        picture[:, inside] = np.fmax(picture[:, inside], content.picture.amplitude[:, order[nearest]])
    axes.set_facecolor(NOWHERE)
    extent = edges(grid) + edges(content.picture.frequency_Hz / 1e3)
    image = axes.imshow(picture, origin="lower", aspect="auto", extent=extent, **levels())
    axes.set_ylim(0, content.highest / 1e3)
    return image


def _marks(axes: Axes, ramp: Ramp, key: str, way: str) -> list[tuple[float, str, str]]:
    """Mark where squeal sets in and ends on this way, and return what to write there."""
    found = []
    for squeal in ramp.squeals:
        ends = [(squeal.sets_in, "sets in")] if squeal.sets_in.time_s > 0 else []
        ends += (
            [(squeal.ends, "dies out" if squeal.end is SquealEnd.DIES_OUT else "sticks")]
            if squeal.end is not SquealEnd.RECORD
            else []
        )
        for instant, what in ends:
            value = instant.value(key)
            if way_words(instant, (key,)) == way and axes.get_xlim()[0] <= value <= axes.get_xlim()[1]:
                axes.axvline(value, color="white", linewidth=0.8, linestyle="--", gid=f"{what} {way}")
                found.append((value, f"{what} at {value:.3g} {unit_of_key(key)}", style.DARK))
    return found
