"""The figure of random samples: growth rates and frequencies, and which numbers they depend on."""

from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drumsqueal.coordinates import largest_of
from drumsqueal.questions.sweep.figure import in_words
from drumsqueal.questions.sweep.points import modes_in
from drumsqueal.questions.sweep.summary import ChanceStudy
from drumsqueal.scene.plan import Plan
from drumsqueal.terminal import style
from drumsqueal.terminal.style import frame, new_figure, styled

BINS = 40
GROWS, DECAYS = style.COLOUR["Y"], style.TOUCHING
BAR = 0.55  # of a row


@styled()
def draw_chance(sweep: xarray.Dataset, plan: Plan, chances: ChanceStudy) -> Figure:
    """Draw growth rates and frequencies of the samples on the left, rank correlations on the right."""
    squeal = chances.squeal
    interval = f"{100 * squeal.low:.1f} to {100 * squeal.high:.1f} %"
    fraction = f"{100 * squeal.share:.1f} % ({interval} at 95 %)"
    figure = new_figure(plan.scene.title, f"probability of squeal by eigenvalues {fraction}, {squeal.total} samples")
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=[1.25, 1])[0]
    upper, lower = left.subplots(2, 1)
    _draw_growth(upper, sweep)
    _draw_frequencies(lower, sweep)
    _draw_correlations(right.subplots(), chances)
    return figure


def _draw_growth(axes: Axes, sweep: xarray.Dataset) -> None:
    growth = sweep["largest_growth_rate"].values
    growth = growth[np.isfinite(growth)]
    if growth.size:
        edges = _edges_through_zero(float(growth.min()), float(growth.max()))
        counts, _ = np.histogram(growth, edges)
        colours = [GROWS if low >= 0 else DECAYS for low in edges[:-1]]
        axes.bar(edges[:-1], counts / growth.size * 100, np.diff(edges), align="edge", color=colours, linewidth=0)
    axes.axvline(0, color=style.DARK, linewidth=0.6)
    frame(axes, "largest growth rate (1/s)", "samples (%)")


def _edges_through_zero(low: float, high: float) -> np.ndarray:
    """Edges of bins of one width, one of them at zero where that lies between: no bar is of both kinds."""
    width = max((high - low) / BINS, 1e-9 * max(abs(low), abs(high), 1e-9))
    if low < 0 < high:
        return width * np.arange(np.floor(low / width), np.ceil(high / width) + 1)
    return low + width * np.arange(BINS + 1)


def _draw_frequencies(axes: Axes, sweep: xarray.Dataset) -> None:
    unstable = sweep["unstable"].values == 1
    frequency, samples = sweep["frequency"].values, sweep.sizes["sample"]
    if unstable.any():
        edges = np.histogram_bin_edges(frequency[unstable], 2 * BINS).tolist()
        found = {name: frequency[unstable & here] for name, here in modes_in(sweep).items()}
        named, others = largest_of({name: each.size for name, each in found.items() if each.size})
        shown = [(found[name], style.COLOUR[name], name) for name in named]
        if others:
            shown += [(np.concatenate([found[name] for name in others]), style.SEPARATED, f"{len(others)} others")]
        found, colours, labels = zip(*shown, strict=True)
        weights = [np.full(mine.size, 100 / samples) for mine in found]
        axes.hist(
            found, edges, weights=weights, color=colours, label=labels, stacked=True
        )  # so that none hides another
        above: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "ncols": 4, "columnspacing": 1.0}
        axes.legend(**(above if others else {"loc": "upper right", "title": "mode"}))
    else:
        axes.text(0.5, 0.5, "no sample squeals", transform=axes.transAxes, ha="center", fontsize=style.SMALL_SIZE)
    frame(axes, "frequency of unstable modes (Hz)", "samples (%)")


def _draw_correlations(axes: Axes, chances: ChanceStudy) -> None:
    known = dict(reversed(chances.known_correlations.items()))
    axes.axvspan(-chances.noise, chances.noise, color=style.PALE, linewidth=0, zorder=0)
    axes.axvline(0, color=style.DARK, linewidth=0.6)
    axes.barh(range(len(known)), list(known.values()), height=BAR, color=style.SEPARATED)
    axes.set_yticks(range(len(known)), [in_words(key).replace(" ", "\n", 1) for key in known])
    axes.set_xlim(-1, 1)
    axes.set_ylim(-0.6, max(len(known), 1) - 0.4)
    frame(axes, "rank correlation with the largest\ngrowth rate; pale band: not significant", None)
    axes.tick_params(axis="y", length=0)
