"""Where a grid squeals: growth rate as a map with its boundary or, along one number, as curves with the frequencies."""

from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.colors import CenteredNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from drumsqueal.questions.sweep.points import squealing, undecided
from drumsqueal.questions.sweep.slices import (
    fixed_in_words,
    hold_to,
    label_of,
    of_coordinate,
    panels,
    scene_at,
    thinned,
)
from drumsqueal.scene import COORDINATES
from drumsqueal.scene.plan import Plan
from drumsqueal.terminal import style
from drumsqueal.terminal.style import frame, new_figure, styled

COLOURS = "PuOr_r"  # orange grows, purple decays; the colour-blind can distinguish them
GROWTH = "largest growth rate (1/s)"
BOUNDARY, OF_A_MODE = 2.2, 1.0  # line widths
ROOM = 1.3  # of an axis of growth rates, over the largest
LEGEND_COLUMNS = 5


@styled()
def draw_stability(sweep: xarray.Dataset, plan: Plan) -> Figure:
    """Draw the map of a grid of two numbers or more, or the curves of one."""
    return _draw_curves(sweep, plan) if len(plan.keys) == 1 else _draw_map(sweep, plan)


def _draw_map(sweep: xarray.Dataset, plan: Plan) -> Figure:
    figure = new_figure(plan.scene.title, f"stability of steady sliding by eigenvalues{fixed_in_words(sweep, plan)}")
    rows = panels(figure, sweep, plan)
    norm = _norm(sweep["largest_growth_rate"].values)
    seen: dict[str, Any] = {}
    image = None
    for row in rows:
        for axes, select in row:
            image = _draw_panel(axes, sweep, plan, select, norm, seen)
        frame(row[0].axes, None, label_of(sweep, plan.keys[1]))
    assert image is not None
    lowest = np.nanmin(sweep["largest_growth_rate"].values, initial=0.0)
    beyond = "min" if lowest < -norm.halfrange else "neither"
    bar = figure.colorbar(image, ax=[panel.axes for row in rows for panel in row], extend=beyond, pad=0.02)
    bar.set_label(GROWTH)
    bar.ax.tick_params(labelsize=style.SMALL_SIZE)
    if seen:
        figure.legend(handles=list(seen.values()), loc="outside lower center", ncols=LEGEND_COLUMNS, columnspacing=1.5)
    return figure


def _draw_panel(
    axes: Axes, sweep: xarray.Dataset, plan: Plan, select: dict[str, Any], norm: CenteredNorm, seen: dict[str, Any]
) -> Any:
    part = thinned(sweep, plan, select)
    x, y = (part[key].values for key in plan.keys[:2])
    growth = part["largest_growth_rate"].values
    axes.set_facecolor(style.FAINT)
    image = axes.pcolormesh(x, y, growth, cmap=COLOURS, norm=norm, shading="nearest", rasterized=True)
    if not np.isfinite(growth).all():
        seen["none"] = Patch(color=style.FAINT, label="no steady sliding")
    if _changes_sign(growth):
        axes.contour(x, y, growth, [0.0], colors=style.DARK, linewidths=BOUNDARY)
        seen["boundary"] = Line2D([], [], color=style.DARK, linewidth=BOUNDARY, label="boundary of squeal, Re λ = 0")
    for index, name in enumerate(COORDINATES):
        of_mode = of_coordinate(part, "growth_rate", index)
        if _changes_sign(of_mode):
            axes.contour(x, y, of_mode, [0.0], colors=style.COLOUR[name], linewidths=OF_A_MODE)
            seen[name] = Line2D([], [], color=style.COLOUR[name], linewidth=OF_A_MODE, label=f"mode {name} begins")
    across, up, *others = scene_at(plan, select)
    if across is not None and up is not None and None not in others:
        axes.plot(across, up, "+", color=style.DARK, markersize=7, markeredgewidth=1.2, clip_on=False)
        label = "the scene itself"
        seen["own"] = Line2D([], [], color=style.DARK, marker="+", linestyle="none", markersize=7, label=label)
    hold_to(axes, x, y)
    axes.tick_params(which="both", labelsize=style.SMALL_SIZE)
    return image


def _norm(growth: np.ndarray) -> CenteredNorm:
    """White at zero; as far on both sides as growth goes or, where nothing grows, as decay does."""
    known = growth[np.isfinite(growth)]
    half = max(known.max(), 0.0) if known.size else 0.0
    if half == 0 and known.size:
        half = float(np.abs(known).max())
    return CenteredNorm(halfrange=float(half) or 1.0)


def _changes_sign(values: np.ndarray) -> bool:
    known = values[np.isfinite(values)]
    return known.size > 0 and known.min() < 0 < known.max() and min(values.shape) > 1


def _draw_curves(sweep: xarray.Dataset, plan: Plan) -> Figure:
    figure = new_figure(plan.scene.title, "modes of steady sliding by eigenvalues")
    upper, lower = figure.subplots(2, 1, sharex=True)
    x = sweep[plan.keys[0]].values
    upper.axhline(0, color=style.DARK, linewidth=0.6)
    for index, name in enumerate(COORDINATES):
        growth, frequency = (of_coordinate(sweep, each, index) for each in ("growth_rate", "frequency"))
        if np.isnan(growth).all():
            continue
        upper.plot(x, growth, color=style.COLOUR[name], label=name)
        lower.plot(x, frequency, color=style.COLOUR[name], linewidth=0.6)
        lower.plot(x, np.where(growth > 0, frequency, np.nan), color=style.COLOUR[name], linewidth=2.0)
    _limit_growth(upper, sweep)
    if plan.transient:
        heard = sweep["main_frequency"].where(squealing(sweep) | undecided(sweep))
        lower.plot(x, heard.values, ".", color=style.DARK, markersize=3)
    own = scene_at(plan, {})[0]
    for axes in (upper, lower):
        if own is not None:
            axes.axvline(own, color=style.FAINT, linewidth=0.8, zorder=0.5)
    frame(upper, None, "growth rate (1/s)")
    dots = "; dots: main frequency of sustained transients" if plan.transient else ""
    frame(lower, label_of(sweep, plan.keys[0]), "frequency (Hz)")
    lower.set_title(f"thick: unstable{dots}", fontsize=style.SMALL_SIZE, loc="left")
    upper.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(COORDINATES), borderaxespad=0.2)
    return figure


def _limit_growth(axes: Axes, sweep: xarray.Dataset) -> None:
    """Modes that decay fast go out of the picture below: what is near the boundary is wanted."""
    growth = sweep["largest_growth_rate"].values
    known = growth[np.isfinite(growth)]
    if known.size:
        size = max(float(np.abs(known).max()), 1e-9) * ROOM
        axes.set_ylim(-size, size)
