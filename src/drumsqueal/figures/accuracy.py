"""What accuracy costs: error against time and evaluations, and each cause of error by itself."""

import math
from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drumsqueal.figures import style
from drumsqueal.figures.style import frame, new_figure, styled
from drumsqueal.studies.accuracy import AccuracyStudy, Measurement
from drumsqueal.studies.contenders import FIXED, QUADRATURE, SMOOTHED, SMOOTHING, SPLIT, STEPPING

COLOUR = {"tsit5": "X", "dopri5": "Tx", "dopri8": "Y", "kvaerno5": "Tz", SPLIT: "Y", FIXED: "X", SMOOTHED: "Ty"}
MARKER = {"tsit5": "o", "dopri5": "s", "dopri8": "D", "kvaerno5": "^", SPLIT: "D", FIXED: "o", SMOOTHED: "s"}
WORD = 10.0  # tolerance keeps its word within this factor
Value = Callable[[Measurement], float | None]


@styled()
def draw_work(study: AccuracyStudy, *, against: Literal["time", "evaluations"]) -> Figure:
    """Draw the three kinds of error of every method and tolerance against what they cost."""
    figure = new_figure(study.scene.title, f"error of methods and tolerances against {against}")
    panels = figure.subplots(1, 3, sharey=True)
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
            _say(axes, "none in so short a record")
        _draw_target(axes, study)
        frame(axes, label, "relative error" if axes is panels[0] else None)
    floor = study.reference.uncertainty(study.growth_end)
    _draw_floor(panels[0], floor)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


@styled()
def draw_causes(study: AccuracyStudy) -> Figure:
    """Draw tolerance asked against error got, the quadratures against their time, and the price of smoothing."""
    figure = new_figure(study.scene.title, "causes of error apart")
    asked, quadrature, smoothing = figure.subplots(1, 3)
    _draw_lines(asked, study, STEPPING, lambda m: m.contender.tolerance, _trajectory)
    ends = np.array([1e-11, 1e-1])
    asked.fill_between(ends, ends / WORD, ends * WORD, color=style.PALE, linewidth=0, zorder=0)
    asked.plot(ends, ends, color=style.DARK, linewidth=0.6)
    asked.invert_xaxis()
    asked.set_title("tolerance, within a factor of ten")
    frame(asked, "tolerance asked for", "relative error of the trajectory")
    _draw_lines(quadrature, study, QUADRATURE, lambda m: m.time_per_ms, _farthest, labelled=True)
    quadrature.set_title(_title("nodes", study, QUADRATURE))
    frame(quadrature, "ms per simulated ms", None)
    _draw_lines(smoothing, study, SMOOTHING, lambda m: m.contender.setting, _farthest)
    smoothing.invert_xaxis()
    smoothing.set_title(_title("width", study, SMOOTHING))
    frame(smoothing, "width of the smoothing over RΩ", None)
    for axes in (asked, quadrature, smoothing):
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="best")
        else:
            _say(axes, "this scene has no friction")
    return figure


def _title(what: str, study: AccuracyStudy, cause: str) -> str:
    tolerance = next((f"{m.contender.tolerance:g}" for m in study.measurements if m.contender.cause == cause), "-")
    return f"{what}, at tolerance {tolerance}"


def _trajectory(measurement: Measurement) -> float | None:
    return None if measurement.errors is None else measurement.errors.trajectory


def _farthest(measurement: Measurement) -> float | None:
    """Error of the trajectory to the end of the reference, with the edges in it."""
    errors = measurement.errors
    return None if errors is None else errors.trajectory if errors.beyond is None else errors.beyond


def _draw_lines(
    axes: Axes, study: AccuracyStudy, cause: str, cost: Value, error: Value, *, labelled: bool = False
) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    names = dict.fromkeys(m.contender.line for m in study.measurements if m.contender.cause == cause)
    for name in names:
        line = [m for m in study.measurements if m.contender.line == name and m.contender.cause == cause]
        points = [(cost(m), error(m), m) for m in line]
        known = [(x, y, m) for x, y, m in points if x and y and math.isfinite(x) and math.isfinite(y)]
        axes.plot(
            [x for x, _, _ in known],
            [y for _, y, _ in known],
            marker=MARKER[name],
            markersize=3,
            color=style.COLOUR[COLOUR[name]],
            label=name if known else f"{name} ({_why(line)})",
        )
        if labelled:
            _label_settings(axes, known)


def _label_settings(axes: Axes, points: Sequence[tuple[float, float, Measurement]]) -> None:
    """Write each setting beside its point: on the left where the line comes from the right."""
    before = 0.0
    for x, y, measurement in points:
        left = x < before
        axes.annotate(
            f"{measurement.contender.setting:g}",
            (x, y),
            (-4, -4) if left else (4, 3),
            textcoords="offset points",
            ha="right" if left else "left",
            va="top" if left else "bottom",
            fontsize=style.SMALL_SIZE,
        )
        before = x


def _why(line: Sequence[Measurement]) -> str:
    if all(m.errors is None for m in line):
        return "no run got through"
    return "not counted"


def _say(axes: Axes, why: str) -> None:
    """Tell why a panel is empty."""
    axes.text(0.5, 0.6, why, transform=axes.transAxes, ha="center", fontsize=style.SMALL_SIZE)


def _draw_target(axes: Axes, study: AccuracyStudy) -> None:
    axes.axhline(study.target, color=style.DARK, linewidth=0.6, linestyle="--")
    axes.annotate(
        f"target {study.target:.0e}",
        (0.98, study.target),
        xycoords=("axes fraction", "data"),
        xytext=(0, 2),
        textcoords="offset points",
        ha="right",
        fontsize=style.SMALL_SIZE,
    )


def _draw_floor(axes: Axes, floor: float) -> None:
    """What lies in the grey is not known: the reference is no better."""
    if floor > 0:
        low = axes.get_ylim()[0]
        axes.axhspan(min(low, floor / 10), floor, color=style.PALE, linewidth=0, zorder=0)
        axes.annotate(
            "uncertainty of the reference",
            (0.02, floor),
            xycoords=("axes fraction", "data"),
            xytext=(0, -2),
            textcoords="offset points",
            va="top",
            fontsize=style.SMALL_SIZE,
        )
