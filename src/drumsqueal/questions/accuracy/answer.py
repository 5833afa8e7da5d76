"""What a study of accuracy writes and prints."""

import math
from collections.abc import Callable
from functools import partial
from itertools import groupby
from typing import Any, Literal

import numpy as np
import tomli_w
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.console import Console

from drumsqueal.findings.columns import Column
from drumsqueal.questions.accuracy.study import (
    FIXED,
    QUADRATURE,
    SMOOTHED,
    SMOOTHING,
    SPLIT,
    STEPPING,
    AccuracyStudy,
    Measurement,
)
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal import style
from drumsqueal.terminal.reply import Answer
from drumsqueal.terminal.style import frame, new_figure, styled
from drumsqueal.terminal.tables import print_cells, rows_to_csv

# What accuracy costs: error against time and evaluations, and each cause of error alone.


# Marker, and the coordinate whose colour a line has.
_STYLE = {
    "tsit5": ("o", "X"),
    "dopri5": ("s", "Tx"),
    "dopri8": ("D", "Y"),
    "sdirk4": ("^", "Tz"),
    SPLIT: ("D", "Y"),
    FIXED: ("o", "X"),
    SMOOTHED: ("s", "Ty"),
}
FURTHER = ("v", "Z"), ("P", "Ty"), ("X", "Z"), ("*", "Ty")  # of solvers that were asked for, in turn
_KEPT = 10.0  # factor within which the error is the tolerance
_Value = Callable[[Measurement], float | None]


@styled()
def _draw_work(study: AccuracyStudy, *, against: Literal["time", "evaluations"]) -> Figure:
    """Draw the three kinds of error of every method and tolerance against what they cost."""
    figure = new_figure(study.scene.title, f"error of methods and tolerances against {against}")
    panels = figure.subplots(1, 3, sharex=True, sharey=True)
    kinds: dict[str, _Value] = {
        "trajectory, growth phase": lambda m: None if m.errors is None else m.errors.trajectory,
        "features, the largest": lambda m: None if m.errors is None else m.errors.largest_feature,
        "energy balance": lambda m: None if m.errors is None else m.errors.energy,
    }
    cost: _Value = (lambda m: m.time_per_ms) if against == "time" else (lambda m: m.evaluations_per_ms)
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
def _draw_causes(study: AccuracyStudy) -> Figure:
    """Draw error against tolerance, against the nodes of quadratures with their time, and against smoothing."""
    figure = new_figure(study.scene.title, "causes of error, each alone")
    asked, quadrature, smoothing = figure.subplots(1, 3)
    _draw_lines(asked, study, STEPPING, lambda m: m.configuration.tolerance, _trajectory)
    ends = np.array([1e-11, 1e-1])
    band = f"within {_KEPT:g} times"
    asked.fill_between(ends, ends / _KEPT, ends * _KEPT, color=style.PALE, linewidth=0, zorder=0, label=band)
    asked.plot(ends, ends, color=style.DARK, linewidth=0.6)
    asked.invert_xaxis()
    asked.set_title("tolerance and error")
    frame(asked, "tolerance", "relative error of the trajectory")
    _draw_lines(quadrature, study, QUADRATURE, lambda m: m.configuration.setting, _farthest, timed=True)
    _whole_decades(quadrature)
    quadrature.set_title(_title("nodes", study, QUADRATURE))
    frame(quadrature, "nodes of a piece, or of the grid", None)
    _draw_lines(smoothing, study, SMOOTHING, lambda m: m.configuration.setting, _farthest)
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
    tolerance = next(
        (f"{m.configuration.tolerance:g}" for m in study.measurements if m.configuration.cause == cause), "-"
    )
    return f"{what}, at tolerance {tolerance}"


def _trajectory(measurement: Measurement) -> float | None:
    return None if measurement.errors is None else measurement.errors.trajectory


def _farthest(measurement: Measurement) -> float | None:
    """Error of the trajectory to the end of the reference, beyond the first contact boundary."""
    errors = measurement.errors
    return None if errors is None else errors.trajectory if errors.beyond is None else errors.beyond


def _draw_lines(
    axes: Axes, study: AccuracyStudy, cause: str, cost: _Value, error: _Value, *, timed: bool = False
) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    names = dict.fromkeys(m.configuration.line for m in study.measurements if m.configuration.cause == cause)
    further = [name for name in names if name not in _STYLE]
    for name in names:
        line = [m for m in study.measurements if m.configuration.line == name and m.configuration.cause == cause]
        points = [(cost(m), error(m), m) for m in line]
        known = [(x, y, m) for x, y, m in points if x and y and math.isfinite(x) and math.isfinite(y)]
        marker, coordinate = _STYLE.get(name) or FURTHER[further.index(name) % len(FURTHER)]
        why = "no run was completed" if all(m.errors is None for m in line) else "not counted"
        label = name if known else f"{name} ({why})"
        places = [x for x, _, _ in known], [y for _, y, _ in known]
        axes.plot(*places, marker=marker, markersize=3, color=style.COLOUR[coordinate], label=label)
        if timed and known:
            _label_time(axes, known[-1])


def _label_time(axes: Axes, point: tuple[float, float, Measurement]) -> None:
    """Write the time of the last of a line next to it: on the left where it may be the last of the panel."""
    x, y, measurement = point
    left = measurement.configuration.line == FIXED
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


COLUMNS = (
    *(Column("run"), Column("time", ">", unit="ms/ms"), Column("eval.\nper ms", ".0f")),
    *(Column(label, ".0e") for label in ("growth\nphase", "beyond\nit", "features", "energy")),
)


def print_study(console: Console, study: AccuracyStudy) -> None:
    """Print every measurement, how good the reference is, and what meets the target."""
    rows = []
    for _, line in groupby(study.measurements, key=lambda each: each.configuration.line):
        # One that was not tried was not compiled.
        rows += [*(_cells(each) for each in line if not math.isnan(each.compile_seconds)), None]
    print_cells(console, "What accuracy costs in time", COLUMNS, rows)
    for remark in study.remarks:
        console.print(remark, style="dim")
    console.print(study.verdict, style="bold")
    console.print(simulate_block(study))


def simulate_block(study: AccuracyStudy) -> str:
    """The `[simulate]` table that meets the target, or a comment that none does."""
    if study.simulate is None:
        return f"# no run meets {study.target:.0e}\n"
    return tomli_w.dumps({"simulate": study.simulate})


def settings_file(study: AccuracyStudy) -> str | None:
    """That table under what was found; None before the study is over."""
    return f"# {printable(study.verdict)}\n{simulate_block(study)}" if study.verdict else None


def to_csv(study: AccuracyStudy) -> str:
    """One row a run, with every repeat's time, the versions and the machine."""
    machine = {"machine": study.machine, "processor": study.processor, "cores": study.cores}
    return rows_to_csv([row | machine | study.versions for row in study.runs])


def _cells(measurement: Measurement) -> tuple[Any, ...]:
    name, errors, time = measurement.configuration.name, measurement.errors, measurement.time_per_ms
    if errors is None:
        return name, "failed"
    # From 99.5 ms on a time is written without an exponent.
    cost = f"{time:.2g}" if time < 99.5 else f"{time:.0f}", measurement.evaluations_per_ms
    return name, *cost, errors.trajectory, errors.beyond, errors.largest_feature, errors.energy


ACCURACY = Answer(
    words=print_study,
    tables={"accuracy.csv": to_csv, "simulate.toml": settings_file},
    figures={
        "accuracy_time": partial(_draw_work, against="time"),
        "accuracy_evaluations": partial(_draw_work, against="evaluations"),
        "accuracy_causes": _draw_causes,
    },
)
