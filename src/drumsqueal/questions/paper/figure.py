"""Figures 4 to 11 of Seo & Kang (2023), recomputed: eigenvalues as lines, what the transients did as marks on them."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from drumsqueal.files.output_folder import PAPER_FIGURES
from drumsqueal.questions.paper.curves import AXES, CONSTANT_FRICTION, Curve
from drumsqueal.questions.paper.statement import QUIET, SQUEALING
from drumsqueal.questions.paper.study import PaperStudy
from drumsqueal.questions.paper.transients import Point
from drumsqueal.terminal import style
from drumsqueal.terminal.style import frame, new_figure, styled

MEASURED, GROWN_INTO = "D", "x"
LEGEND = 8  # entries in one row
GROWING_EVERY = 10  # points of a line between two rings on what grows
RING: dict[str, Any] = {"marker": "o", "markersize": 5, "fillstyle": "none", "linestyle": "", "markeredgewidth": 0.7}


@styled()
def draw_friction(study: PaperStudy) -> Figure | None:
    """Figure 4: coefficient of friction and its slope over the drum's speed."""
    curve = study.friction
    if curve is None:
        return None
    figure = new_figure(study.title, "Figure 4, the friction law (an input of the transients, not a result)")
    left, right = figure.subplots(1, 2)
    for axes, values, label, shift in (
        (left, curve.coefficient, "Coefficient of friction μ", 6),
        (right, curve.slope, "Slope dμ/ds at the slip speed RΩ (s/m)", -10),
    ):
        own = curve.own_speed, float(np.interp(curve.own_speed, curve.speed, values))
        axes.plot(curve.speed, values, color=style.DARK)
        axes.plot(*own, "o", color=style.COLOUR["Y"], markersize=4)
        axes.annotate(
            f"{curve.own_speed:g} rad/s",
            own,
            xytext=(6, shift),  # clear of the curve
            textcoords="offset points",
            fontsize=style.SMALL_SIZE,
        )
        frame(axes, "Drum speed (rad/s)", label)
        axes.set_xlim(0, None)
    left.set_ylim(0, None)
    right.set_ylim(None, max(0.0, float(curve.slope.max())))
    return figure


@styled()
def draw_stiffness(study: PaperStudy, number: str) -> Figure:
    """Figures 5 and 6: frequencies over the contact stiffness, and growth rate against frequency at 100 %."""
    curve, points = study.curves[number], study.points[number]
    falling = "" if number == "5" else f", constant friction μ = {CONSTANT_FRICTION:g}"
    figure = new_figure(study.title, f"Figure {number}, contact stiffness{falling}")
    left, right = figure.subplots(1, 2, width_ratios=[1.2, 1])
    for name in curve.spectrum.names:
        frequency = curve.frequency_Hz(name) / 1e3
        left.plot(curve.shown, frequency, color=style.COLOUR[name])
        growing = np.flatnonzero(curve.rate(name) > 1e-6)[::GROWING_EVERY]
        left.plot(curve.shown[growing], frequency[growing], **RING, color=style.COLOUR[name])
    _mark_frequencies(left, curve, points)
    frame(left, "Contact stiffness (% of the scene's)", "Frequency (kHz)")
    left.set_ylim(bottom=-0.15)
    _draw_rates_at_the_end(right, study, curve, points[-1])
    _legend(figure, curve.spectrum.names, rings=number == "5", saturated=number == "5")
    return figure


def _draw_rates_at_the_end(axes: Axes, study: PaperStudy, curve: Curve, last: Point) -> None:
    """Growth rate against frequency at 100 %; both figures on the scale of the falling friction."""
    axes.axhline(0, color=style.DARK, linewidth=0.6)
    for name in SQUEALING:
        place = curve.frequency_Hz(name)[-1] / 1e3, curve.rate(name)[-1]
        axes.vlines(place[0], 0, place[1], color=style.COLOUR[name], linewidth=1.2)
        axes.plot(*place, "o", color=style.COLOUR[name], markersize=4)
        axes.annotate(
            f"{name} {place[1]:+.1f}" if abs(place[1]) > 1e-6 else f"{name} 0",
            place,
            xytext=(0, 8),
            textcoords="offset points",
            ha="center",
            fontsize=style.SMALL_SIZE,
            color=style.COLOUR[name],
        )
    for mode in last.modes:
        if mode.measured_growth is not None and mode.measured_frequency_Hz is not None:
            place = mode.measured_frequency_Hz / 1e3, mode.measured_growth.rate_1_per_s
            axes.plot(*place, MEASURED, color=style.COLOUR[mode.name], fillstyle="none", markersize=7)
    decays = ", ".join(f"{name} {curve.rate(name)[-1]:.0f}".replace("-", "−") for name in QUIET)
    axes.text(0.02, 0.02, f"{decays} 1/s: no transient", transform=axes.transAxes, fontsize=style.SMALL_SIZE)
    if not last.comparison or last.comparison.edge_reached_s is None:
        axes.text(0.02, 0.9, "no mode grows, so none saturates", transform=axes.transAxes, fontsize=style.SMALL_SIZE)
    top = max(float(study.curves["5"].rate(name)[-1]) for name in SQUEALING)
    axes.set_ylim(-0.15 * max(top, 1.0), 1.2 * max(top, 1.0))
    high = max(float(curve.frequency_Hz(name)[-1]) for name in SQUEALING) / 1e3
    axes.set_xlim(0, 1.12 * high)
    frame(axes, "Frequency at 100 % (kHz)", "Growth rate Re λ (1/s)")


@styled()
def draw_speed(study: PaperStudy) -> Figure:
    """Figure 7: growth of the modes that squeal, decay of those that do not, and the motion that it grows into."""
    curve, points = study.curves["7"], study.points["7"]
    figure = new_figure(study.title, "Figure 7, drum speed")
    left, middle, right = figure.subplots(1, 3)
    _draw_growth(left, curve, points)
    for name in QUIET:
        middle.plot(np.abs(curve.shown), -curve.rate(name), color=style.COLOUR[name])
    middle.set_xscale("log")
    middle.set_yscale("log")
    middle.set_title("no transient: all modes out of the plane decay", fontsize=style.SMALL_SIZE)
    frame(middle, "Drum speed (rad/s)", "Decay rate −Re λ (1/s)")
    _draw_frequencies(right, curve, points)
    _legend(figure, curve.spectrum.names)
    return figure


@styled()
def draw_design(study: PaperStudy, number: str) -> Figure:
    """Figures 8 to 11: growth of the modes that squeal over one number, and the motion that it grows into."""
    curve, points = study.curves[number], study.points[number]
    figure = new_figure(study.title, f"Figure {number}, {curve.axis.label.lower()}")
    left, right = figure.subplots(1, 2)
    _draw_growth(left, curve, points)
    _draw_frequencies(right, curve, points)
    _legend(figure, SQUEALING)
    return figure


def _draw_growth(axes: Axes, curve: Curve, points: Sequence[Point]) -> None:
    axes.axhline(0, color=style.DARK, linewidth=0.6)
    for name in SQUEALING:
        axes.plot(np.abs(curve.shown), curve.rate(name), color=style.COLOUR[name])
    for point in points:
        for mode in point.modes:
            if mode.measured_growth is not None and mode.name in SQUEALING:
                place = abs(float(curve.axis.shown(point.value, curve.nominal))), mode.measured_growth.rate_1_per_s
                axes.plot(*place, MEASURED, color=style.COLOUR[mode.name], fillstyle="none", markersize=5)
    frame(axes, _label(curve), "Growth rate Re λ (1/s)")


def _draw_frequencies(axes: Axes, curve: Curve, points: Sequence[Point]) -> None:
    for name in SQUEALING:
        axes.plot(np.abs(curve.shown), curve.frequency_Hz(name) / 1e3, color=style.COLOUR[name])
    _mark_frequencies(axes, curve, points)
    axes.set_ylim(bottom=0)
    frame(axes, _label(curve), "Frequency (kHz)")


def _mark_frequencies(axes: Axes, curve: Curve, points: Sequence[Point]) -> None:
    for point in points:
        x = abs(float(curve.axis.shown(point.value, curve.nominal)))
        for mode in point.modes:
            if mode.measured_frequency_Hz is not None:
                y = mode.measured_frequency_Hz / 1e3
                axes.plot(x, y, MEASURED, color=style.COLOUR[mode.name], fillstyle="none", markersize=5)
        if point.saturation is not None and point.saturation.main is not None:
            axes.plot(x, point.saturation.main.frequency_Hz / 1e3, GROWN_INTO, color=style.DARK, markersize=6)


def _label(curve: Curve) -> str:
    unit = f"{curve.axis.unit} of the scene's" if curve.axis.unit == "%" else curve.axis.unit
    return f"{curve.axis.label} ({unit})"


def _legend(figure: Figure, names: Sequence[str], *, rings: bool = False, saturated: bool = True) -> None:
    """Modes by colour, then the marks; in two rows at most."""
    handles = [Line2D([], [], color=style.COLOUR[name], label=name) for name in names]
    if rings:
        handles.append(Line2D([], [], **RING, color=style.DARK, label="grows"))
    blank: dict[str, Any] = {"linestyle": "", "color": style.DARK}
    handles.append(
        Line2D([], [], **blank, marker=MEASURED, fillstyle="none", markersize=5, label="measured in transients")
    )
    if saturated:
        label = "strongest line of the motion that it grows into"
        handles.append(Line2D([], [], **blank, marker=GROWN_INTO, markersize=6, label=label))
    columns = len(handles) if len(handles) <= LEGEND else -(-len(handles) // 2)
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, columnspacing=1.0, handletextpad=0.5)


PAPER_DRAWINGS = {
    PAPER_FIGURES["4"]: draw_friction,
    PAPER_FIGURES["5"]: partial(draw_stiffness, number="5"),
    PAPER_FIGURES["6"]: partial(draw_stiffness, number="6"),
    PAPER_FIGURES["7"]: draw_speed,
    **{PAPER_FIGURES[axis.figure]: partial(draw_design, number=axis.figure) for axis in AXES[3:]},
}
"""What draws each figure of the paper, by the name of its file."""
