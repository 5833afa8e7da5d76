"""Amplitude of the modes over time beside the predicted growth, and the contact underneath."""

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from drumsqueal.findings.compare import ModeComparison
from drumsqueal.questions.run.figures.fractions import PERIODS, draw_fractions, running
from drumsqueal.questions.run.figures.view import View, rate_text
from drumsqueal.solve.linear.modes import Mode
from drumsqueal.terminal import style

DECADES = 7  # shown at most below the largest amplitude
BEYOND = 1.15  # the record is shown this far past the start of the saturated part
DASHES = (0, (4, 3))


@style.styled()
def draw_growth(view: View) -> Figure | None:
    """Draw the amplitude of each mode with its predicted slope; None where no mode moved or too little was recorded."""
    if not view.readable or not view.modes:
        return None
    figure = style.new_figure(view.title, "growth of the modes")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    settled = view.saturation is not None and view.saturation.vibrates
    end = min(view.time[-1], BEYOND * view.saturation.start_s) if settled and view.saturation else view.time[-1]
    shown = slice(0, int(np.searchsorted(view.time, end, side="right")))
    factor, unit = style.time_unit(view.time[-1])
    _mark_phases(view, upper)
    marks = _mark_phases(view, lower)
    modes = [_draw_mode(view, upper, mode, shown) for mode in view.modes]
    upper.set_yscale("log")
    _set_limits(view, upper, shown)
    style.frame(upper, None, "Amplitude (µm; rotations times R)")
    legend = upper.legend(
        handles=modes,
        title=f"Mode: {_compared(view)} (1/s)",
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        borderaxespad=0.2,
        alignment="left",
    )
    upper.add_artist(legend)
    legend.set_clip_on(False)  # or the layout takes it for hidden and leaves it no room
    upper.legend(handles=_explained(view, marks), loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
    draw_fractions(view, lower, shown)
    more = f"; the record goes on to {view.time[-1] * factor:.4g} {unit}" if shown.stop < view.time.size else ""
    style.frame(lower, f"Time ({unit}){more}", "Lining (%)")
    lower.set_xlim(view.time[0] * factor, end * factor)
    return figure


def _draw_mode(view: View, axes: Axes, mode: Mode, shown: slice) -> Artist:
    """Draw one mode and return its entry in the legend."""
    factor, colour = style.time_unit(view.time[-1])[0], style.COLOUR[mode.name]
    compared = view.compared(mode)
    values = view.vibration.modal(mode, shown) * view.micrometres(mode.name)
    time, low, mean, high = running(view, values, shown)
    axes.fill_between(time * factor, low, high, color=colour, alpha=0.2, linewidth=0)
    (line,) = axes.plot(time * factor, mean, color=colour, linewidth=1.3, label=_entry(mode, compared))
    slope_time, slope = _slope(view, mode, compared)
    axes.plot(
        slope_time * factor, slope, color=style.DARK, linewidth=0.7, linestyle=DASHES, gid=f"predicted {mode.label}"
    )
    return line


def _compared(view: View) -> str:
    """What stands on both sides of the stroke in the legend."""
    if not view.result.findings.changing:
        return "Re λ predicted / measured"
    factor, unit = style.time_unit(view.time[-1])
    end = view.result.findings.growth.linear_until_s * factor
    return f"Re λ at t = {view.result.stability.time:g} s / mean from 0 to {end:.4g} {unit}"


def _entry(mode: Mode, compared: ModeComparison) -> str:
    growth = compared.measured_growth
    measured = "not measured" if growth is None else rate_text(growth.rate_1_per_s, mode)
    return f"{mode.label} {mode.frequency_Hz:.0f} Hz: {rate_text(mode.growth_rate, mode)} / {measured}"


def _slope(view: View, mode: Mode, compared: ModeComparison) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times (s), to twice that of the first contact boundary, and the exponential predicted from the fitted start."""
    boundary, growth = view.result.findings.edge_reached_s, compared.measured_growth
    time = np.array([view.time[0], view.time[-1] if boundary is None else min(2 * boundary, view.time[-1])])
    first = view.amplitude(mode, slice(0, 1))[0]
    start = first if growth is None else growth.amplitude_at_start * view.micrometres(mode.name)
    # Cut off where the number would leave what a double holds, far outside the frame.
    return time, start * np.exp(np.clip(mode.growth_rate * (time - time[0]), -500.0, 500.0))


def _set_limits(view: View, axes: Axes, shown: slice) -> None:
    top = float(max(view.amplitude(mode, shown).max() for mode in view.modes))
    begins = min(view.amplitude(mode, slice(0, 1))[0] for mode in view.modes)
    # A decaying mode leaves the frame below: how it begins decides how far down that goes.
    bottom = max(float(begins) / 10, top * 10.0**-DECADES)
    axes.set_ylim(min(bottom, top / 100), top * 2)
    axes.yaxis.set_minor_formatter(NullFormatter())


def _mark_phases(view: View, axes: Axes) -> list[Artist]:
    """Shade the growth phase and mark the first contact boundary; return what to name in the legend."""
    comparison, (factor, unit) = view.result.findings, style.time_unit(view.time[-1])
    marks: list[Artist] = []
    if 0 < comparison.growth.linear_until_s < view.time[-1]:
        span = axes.axvspan(
            view.time[0] * factor, comparison.growth.linear_until_s * factor, color=style.PALE, zorder=0, linewidth=0
        )
        span.set_label("growth phase")
        marks.append(span)
    if comparison.edge_reached_s is not None:
        boundary = comparison.edge_reached_s * factor
        label = f"contact boundary reached, {boundary:.4g} {unit}"
        marks.append(axes.axvline(boundary, color=style.DARK, linewidth=0.8, linestyle=":", label=label))
    return marks


def _explained(view: View, marks: list[Artist]) -> list[Artist]:
    changing = view.result.findings.changing
    label = f"growth as predicted at t = {view.result.stability.time:g} s" if changing else "predicted growth"
    predicted = Line2D([], [], color=style.DARK, linewidth=0.7, linestyle=DASHES, label=label)
    band = Patch(color=style.FAINT, label=f"smallest to largest in {PERIODS} periods")
    return [predicted, band, *marks]
