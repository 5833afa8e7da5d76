"""What accuracy costs: error against time and evaluations, and each cause of error alone."""

import math
from collections.abc import Callable
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drumsqueal.questions.accuracy.bench import Measurement
from drumsqueal.questions.accuracy.contenders import FIXED, QUADRATURE, SMOOTHED, SMOOTHING, SPLIT, STEPPING
from drumsqueal.questions.accuracy.study import AccuracyStudy
from drumsqueal.terminal import style
from drumsqueal.terminal.style import frame, new_figure, styled

# Marker, and the coordinate whose colour a line has.
STYLE = {
    "tsit5": ("o", "X"),
    "dopri5": ("s", "Tx"),
    "dopri8": ("D", "Y"),
    "sdirk4": ("^", "Tz"),
    SPLIT: ("D", "Y"),
    FIXED: ("o", "X"),
    SMOOTHED: ("s", "Ty"),
}
FURTHER = ("v", "Z"), ("P", "Ty"), ("X", "Z"), ("*", "Ty")  # of solvers that were asked for, in turn
KEPT = 10.0  # factor within which the error is the tolerance
Value = Callable[[Measurement], float | None]


@styled()
def draw_work(study: AccuracyStudy, *, against: Literal["time", "evaluations"]) -> Figure:
    """Draw the three kinds of error of every method and tolerance against what they cost."""
    figure = new_figure(study.scene.title, f"error of methods and tolerances against {against}")
    panels = figure.subplots(1, 3, sharex=True, sharey=True)
    kinds: dict[str, Value] = {
        "trajectory, growth phase": lambda m: None if m.errors is None else m.errors.trajectory,
        "features, the largest": lambda m: None if m.errors is None else m.errors.largest_feature,
        "energy balance": lambda m: None if m.errors is None else m.errors.energy,
    }
    cost: Value = (lambda m: m.time_per_ms) if against == "time" else (lambda m: m.evaluations_per_ms)
    label = "ms per simulated ms" if against == "time" else "evaluations per simulated ms"
    for axes, (title, error) in zip(panels, kinds.items(), strict=True):
        _draw_lines(axes, study, STEPPING, cost, error)
        axes.set_title(title)
        if not any(error(m) for m in study.measurements):
            _explain(axes, "none: the record is too short")
        axes.axhline(study.target, color=style.DARK, linewidth=0.6, linestyle="--")
        frame(axes, label, "relative error" if axes is panels[0] else None)
    _whole_decades(panels[0])
    # At the right end of the features, which the dear implicit method has not.
    _write_above(panels[1], f"target {study.target:.0e}", study.target)
    _draw_floor(panels[0], study.reference.uncertainty(study.growth_end))
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


@styled()
def draw_causes(study: AccuracyStudy) -> Figure:
    """Draw error against tolerance, against the nodes of quadratures with their time, and against smoothing."""
    figure = new_figure(study.scene.title, "causes of error, each alone")
    asked, quadrature, smoothing = figure.subplots(1, 3)
    _draw_lines(asked, study, STEPPING, lambda m: m.contender.tolerance, _trajectory)
    ends = np.array([1e-11, 1e-1])
    band = f"within {KEPT:g} times"
    asked.fill_between(ends, ends / KEPT, ends * KEPT, color=style.PALE, linewidth=0, zorder=0, label=band)
    asked.plot(ends, ends, color=style.DARK, linewidth=0.6)
    asked.invert_xaxis()
    asked.set_title("tolerance and error")
    frame(asked, "tolerance", "relative error of the trajectory")
    _draw_lines(quadrature, study, QUADRATURE, lambda m: m.contender.setting, _farthest, timed=True)
    _whole_decades(quadrature)
    quadrature.set_title(_title("nodes", study, QUADRATURE))
    frame(quadrature, "nodes of a piece, or of the grid", None)
    _draw_lines(smoothing, study, SMOOTHING, lambda m: m.contender.setting, _farthest)
    smoothing.invert_xaxis()
    smoothing.set_title(_title("width", study, SMOOTHING))
    frame(smoothing, "width of the smoothing over RΩ", None)
    for axes in (asked, quadrature, smoothing):
        if not axes.get_legend_handles_labels()[0]:
            _explain(axes, "this scene has no friction")
        elif axes is quadrature:  # where the two lines leave the right free, a little above the bottom
            axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.15))
        else:
            axes.legend(loc="upper right")
    return figure


def _title(what: str, study: AccuracyStudy, cause: str) -> str:
    tolerance = next((f"{m.contender.tolerance:g}" for m in study.measurements if m.contender.cause == cause), "-")
    return f"{what}, at tolerance {tolerance}"


def _trajectory(measurement: Measurement) -> float | None:
    return None if measurement.errors is None else measurement.errors.trajectory


def _farthest(measurement: Measurement) -> float | None:
    """Error of the trajectory to the end of the reference, beyond the first contact boundary."""
    errors = measurement.errors
    return None if errors is None else errors.trajectory if errors.beyond is None else errors.beyond


def _draw_lines(
    axes: Axes, study: AccuracyStudy, cause: str, cost: Value, error: Value, *, timed: bool = False
) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    names = dict.fromkeys(m.contender.line for m in study.measurements if m.contender.cause == cause)
    further = [name for name in names if name not in STYLE]
    for name in names:
        line = [m for m in study.measurements if m.contender.line == name and m.contender.cause == cause]
        points = [(cost(m), error(m), m) for m in line]
        known = [(x, y, m) for x, y, m in points if x and y and math.isfinite(x) and math.isfinite(y)]
        marker, coordinate = STYLE.get(name) or FURTHER[further.index(name) % len(FURTHER)]
        why = "no run was completed" if all(m.errors is None for m in line) else "not counted"
        label = name if known else f"{name} ({why})"
        places = [x for x, _, _ in known], [y for _, y, _ in known]
        axes.plot(*places, marker=marker, markersize=3, color=style.COLOUR[coordinate], label=label)
        if timed and known:
            _label_time(axes, known[-1])


def _label_time(axes: Axes, point: tuple[float, float, Measurement]) -> None:
    """Write the time of the last of a line next to it: on the left where it may be the last of the panel."""
    x, y, measurement = point
    left = measurement.contender.line == FIXED
    axes.annotate(
        f"{measurement.time_per_ms:.3g} ms/ms",
        (x, y),
        (-6, -2) if left else (6, 2),
        textcoords="offset points",
        ha="right" if left else "left",
        va="top" if left else "bottom",
        fontsize=style.SMALL_SIZE,
    )


def _explain(axes: Axes, why: str) -> None:
    """Write why a panel is empty."""
    axes.text(0.5, 0.6, why, transform=axes.transAxes, ha="center", fontsize=style.SMALL_SIZE)


def _whole_decades(axes: Axes) -> None:
    """Let the axis begin and end at powers of ten: they alone have labels then, and there are two of them at least."""
    low, high = axes.dataLim.intervalx
    if math.isfinite(low) and 0 < low <= high:
        axes.set_xlim(10.0 ** math.floor(math.log10(low)), 10.0 ** (math.floor(math.log10(high)) + 1))


def _write_above(axes: Axes, text: str, height: float) -> None:
    """Write a text at the right end of a panel, above a height in data."""
    place = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
    axes.annotate(text, (0.98, height), xytext=(0, 2), **place, ha="right", fontsize=style.SMALL_SIZE)


def _draw_floor(axes: Axes, floor: float) -> None:
    """Grey: below the uncertainty of the reference."""
    if floor > 0:
        low = min(axes.get_ylim()[0], floor / 10)
        axes.axhspan(low, floor, color=style.PALE, linewidth=0, zorder=0)
        _write_above(axes, "uncertainty of the reference", low)
