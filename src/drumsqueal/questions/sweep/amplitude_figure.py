"""Amplitude and frequency of the steady-state response: maps or curves of a grid, dots of random samples."""

from dataclasses import dataclass

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from drumsqueal.findings.vibration import unit_of
from drumsqueal.questions.sweep.points import squealing, undecided
from drumsqueal.questions.sweep.slices import Panel, fixed_in_words, hold_to, label_of, panels, thinned
from drumsqueal.scene import COORDINATES
from drumsqueal.scene.plan import Plan
from drumsqueal.terminal import style
from drumsqueal.terminal.style import frame, new_figure, styled

COLOURS = "viridis"
_OPEN, _DOTS = "; open: not settled", "; dots: not settled"
_GREY = "; grey: decays, or no transient"


@dataclass(frozen=True)
class Quantity:
    """What is drawn: values at every point, and what they are."""

    label: str
    values: xarray.DataArray
    colour: str


@styled()
def draw_amplitude(sweep: xarray.Dataset, plan: Plan) -> Figure | None:
    """Draw amplitude of the coordinate that moves most and main frequency; None where no transient was computed."""
    shown = _quantities(sweep)
    if not shown:
        return None
    if plan.draws:
        return _draw_samples(sweep, plan, shown)
    return _draw_curves(sweep, plan, shown) if len(plan.keys) == 1 else _draw_maps(sweep, plan, shown)


def _quantities(sweep: xarray.Dataset) -> list[Quantity]:
    main = sweep["main_coordinate"].values
    if not np.any(main >= 0):
        return []
    # Of the coordinate that carries the motion at most points.
    index = int(np.bincount(main[main >= 0].ravel()).argmax())
    name = COORDINATES[index]
    amplitude = 1e6 * sweep["amplitude"].isel(coordinate=index)
    found = [Quantity(f"{name}, half peak to peak ({unit_of(name, 'µ')})", amplitude, style.COLOUR[name])]
    sustained = squealing(sweep) | undecided(sweep)
    if sustained.any():  # what decays has a line, too, but none that is heard
        found.append(Quantity("main frequency (Hz)", sweep["main_frequency"].where(sustained), style.DARK))
    return found


def _draw_maps(sweep: xarray.Dataset, plan: Plan, shown: list[Quantity]) -> Figure:
    marks = _DOTS * bool(_unsettled(sweep).any())
    marks += _GREY * any(np.isnan(each.values.values).any() for each in shown)
    figure = new_figure(plan.scene.title, f"steady-state response{fixed_in_words(sweep, plan)}{marks}")
    rows = panels(figure, sweep, plan, rows=len(shown))
    count = len(rows) // len(shown)
    for k, quantity in enumerate(shown):
        mine = [panel for row in rows[k * count : (k + 1) * count] for panel in row]
        known = quantity.values.values[np.isfinite(quantity.values.values)]
        scale = Normalize(float(known.min()), float(known.max())) if known.size else Normalize()
        for panel in mine:
            _draw_panel(panel, quantity, sweep["settled"], plan, scale)
        for row in rows[k * count : (k + 1) * count]:
            frame(row[0].axes, None, label_of(sweep, plan.keys[1]))
        bar = figure.colorbar(ScalarMappable(scale, COLOURS), ax=[panel.axes for panel in mine], pad=0.02)
        bar.set_label(quantity.label)
        bar.ax.tick_params(labelsize=style.SMALL_SIZE)
    return figure


def _draw_panel(panel: Panel, quantity: Quantity, settled: xarray.DataArray, plan: Plan, scale: Normalize) -> None:
    axes, select = panel
    part = thinned(xarray.Dataset({"shown": quantity.values, "settled": settled}), plan, select)
    x, y = (part[key].values for key in plan.keys[:2])
    axes.set_facecolor(style.FAINT)
    axes.pcolormesh(x, y, part["shown"].values, cmap=COLOURS, norm=scale, shading="nearest", rasterized=True)
    hold_to(axes, x, y)
    row, column = np.nonzero(part["settled"].values == 0)
    look = {"color": style.DARK, "markersize": 3, "markeredgecolor": "white", "markeredgewidth": 0.5}
    if row.size:  # an empty line that is not clipped counts as one at the corner of the figure: the layout collapses
        axes.plot(x[column], y[row], "o", clip_on=False, zorder=3, **look)
    axes.tick_params(which="both", labelsize=style.SMALL_SIZE)


def _draw_curves(sweep: xarray.Dataset, plan: Plan, shown: list[Quantity]) -> Figure:
    figure = new_figure(
        plan.scene.title, f"steady-state response of the transients{_OPEN * bool(_unsettled(sweep).any())}"
    )
    both = _column(figure, shown)
    for axes, quantity in zip(both, shown, strict=True):
        x, y = sweep[plan.keys[0]].values, quantity.values.values
        axes.plot(x, y, color=quantity.colour, linewidth=0.6)
        _draw_markers(axes, x, y, _unsettled(sweep), quantity.colour)
        frame(axes, None, quantity.label)
    frame(both[-1], label_of(sweep, plan.keys[0]), None)
    return figure


def _column(figure: Figure, shown: list[Quantity]) -> list[Axes]:
    return list(figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0])


def _draw_samples(sweep: xarray.Dataset, plan: Plan, shown: list[Quantity]) -> Figure:
    subject = f"steady-state response of {plan.draws} samples{_OPEN * bool(_unsettled(sweep).any())}"
    figure = new_figure(plan.scene.title, subject)
    for axes, quantity in zip(_column(figure, shown), shown, strict=True):
        _draw_dots(axes, sweep, quantity)
    frame(axes, "largest predicted growth rate (1/s)", None)
    return figure


def _draw_dots(axes: Axes, sweep: xarray.Dataset, quantity: Quantity) -> None:
    axes.axvline(0, color=style.DARK, linewidth=0.6)
    growth = sweep["largest_growth_rate"].values
    _draw_markers(axes, growth, quantity.values.values, _unsettled(sweep), quantity.colour)
    frame(axes, None, quantity.label)


def _draw_markers(axes: Axes, x: np.ndarray, y: np.ndarray, unsettled: np.ndarray, colour: str) -> None:
    """A dot for each motion, an open one where it had not settled."""
    for some, face in ((~unsettled, colour), (unsettled, "white")):
        axes.plot(x[some], y[some], "o", color=colour, markerfacecolor=face, markersize=3, markeredgewidth=0.6)


def _unsettled(sweep: xarray.Dataset) -> np.ndarray:
    return sweep["settled"].values == 0
