"""The pictures of the benchmark, in the style of the package's own."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drumsqueal.terminal import style
from drumsqueal.terminal.style import frame, new_figure, styled

from .curves import Curve

TITLE = "Speed of drumsqueal"
DPI = 200
# Colour and marker by what a configuration's name begins with, the longest first.
LOOKS: Mapping[str, tuple[str, str]] = {
    "drumsqueal, bare": ("Y", "s"),
    "drumsqueal": ("Y", "o"),
    "numbalsoda LSODA": ("X", "v"),
    "numbalsoda DOP853": ("Tx", "^"),
    "CVODE": ("Z", "D"),
    "SciPy LSODA, numba": ("Tz", "v"),
    "SciPy DOP853, numba": ("Ty", "^"),
    "diffrax's own loop, Tsit5": ("Tz", "P"),
    "diffrax's own loop, Dopri8": ("Ty", "X"),
}
NUMPY = {"SciPy LSODA, NumPy, 200": "v", "SciPy DOP853, NumPy, 200": "^", "SciPy LSODA, NumPy, 1000": "<"}


def _look(name: str) -> dict:
    for start, (colour, marker) in LOOKS.items():
        if name.startswith(start):
            bare = "bare" in start
            return {"color": style.COLOUR[colour], "marker": marker, "linestyle": "--" if bare else "-"}
    (marker,) = [marker for start, marker in NUMPY.items() if name.startswith(start)]
    return {"color": style.SEPARATED, "marker": marker, "linestyle": "-"}


def _plot(axes: Axes, curve: Curve, heights: np.ndarray) -> None:
    good = np.isfinite(curve.errors) & np.isfinite(heights)
    axes.plot(curve.errors[good], heights[good], markersize=3, label=curve.name, **_look(curve.name))


def _precision_axis(axes: Axes) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.invert_xaxis()  # better to the right
    axes.grid(which="major", color=style.PALE, linewidth=0.5)
    axes.set_axisbelow(True)


def _save(figure: Figure, file: Path) -> None:
    figure.savefig(file, dpi=DPI)


@styled()
def draw_one(curves: Sequence[Curve], uncertainty: float, file: Path) -> None:
    """Time over error of each configuration; the legend stands beside the axes."""
    figure = new_figure(TITLE, "one transient of 0.1 s, time at a precision")
    axes = figure.subplots()
    for curve in curves:
        _plot(axes, curve, 1e3 * curve.times)
    _precision_axis(axes)
    axes.set_xlim(2.0, 0.7 * uncertainty)
    axes.axvspan(uncertainty, 0.7 * uncertainty, color=style.PALE, linewidth=0)
    frame(axes, "error of the trajectory; grey: below the reference's own", "time, ms")
    # From the slowest to the fastest, as the lines stand.
    handles, labels = axes.get_legend_handles_labels()
    order = np.argsort([-np.nanmedian(curve.times) for curve in curves])
    figure.legend([handles[k] for k in order], [labels[k] for k in order], loc="outside right center")
    _save(figure, file)


@styled()
def draw_many(panels: Mapping[str, Sequence[Curve]], count: int, file: Path) -> None:
    """Throughput over the median error and over that of nine in ten."""
    figure = new_figure(TITLE, f"{count} transients of 50 ms in two threads or processes")
    for axes, (label, curves) in zip(figure.subplots(1, len(panels), sharey=True), panels.items(), strict=True):
        for curve in curves:
            _plot(axes, curve, count / curve.times)
        _precision_axis(axes)
        axes.set_yscale("linear")
        axes.set_ylim(0, None)
        frame(axes, f"{label} of the trajectories", None)
    figure.axes[0].set_ylabel("transients per second")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    _save(figure, file)


@styled()
def draw_growth(counts: Mapping[int, float], motions: Mapping[str, float], threads: int, file: Path) -> None:
    """Time per trajectory over their number, and the plane against space."""
    figure = new_figure(TITLE, "time of one trajectory and one simulated millisecond")
    left, right = figure.subplots(1, 2, width_ratios=[1, 1.2])
    left.plot(list(counts), [1e6 * each for each in counts.values()], "o-", color=style.COLOUR["Y"], markersize=3)
    left.set_xscale("log", base=2)
    left.set_xticks(list(counts), [str(count) for count in counts])
    left.minorticks_off()
    left.set_ylim(0, 1.1e6 * max(counts.values()))
    frame(left, f"trajectories, in {threads} threads", "µs, in the plane beyond the edges")
    names, values = list(motions), [1e6 * each for each in motions.values()]
    colours = [style.COLOUR["Y"] if name.startswith("3") else style.COLOUR["X"] for name in names]
    right.scatter(values, range(len(names)), color=colours)  # no bars: on a log axis their lengths mean nothing
    for row, value in enumerate(values):
        right.annotate(
            f"{value:,.0f}", (value, row), (6, 0), textcoords="offset points", va="center", fontsize=style.SMALL_SIZE
        )
    right.set_yticks(range(len(names)), [name.replace(", ", ",\n") for name in names])
    right.set_ylim(len(names) - 0.5, -0.5)
    right.set_xscale("log")
    right.set_xlim(0.5 * min(values), 6 * max(values))
    frame(right, "µs, one thread", None)
    _save(figure, file)


def draw_brake(by_coordinates: Sequence[dict[str, Any]], by_points: Sequence[dict[str, Any]], file: Path) -> None:
    """Time of an evaluation, compile time and peak memory over the number of coordinates, and of points."""
    figure = new_figure("Whole brake", "what it costs by its coordinates, and by the points of its linings")
    rows = figure.subplots(3, 2, sharex="col", sharey="row")
    for column, (key, sizes) in enumerate((("coordinates", by_coordinates), ("points", by_points))):
        place = [one[key] for one in sizes]
        evaluation, compiling, memory = rows[:, column]
        for motion, colour, label in (
            ("beyond", "Y", "beyond the boundaries"),
            ("steady", "X", "next to steady sliding"),
        ):
            times = [1e6 * min(one["evaluation_s"][motion]) for one in sizes]
            evaluation.plot(place, times, "o-", color=style.COLOUR[colour], markersize=3, label=label)
        compiling.plot(place, [one["compiling_s"] for one in sizes], "o-", color=style.DARK, markersize=3)
        memory.plot(place, [one["peak_MiB"] / 1024 for one in sizes], "o-", color=style.DARK, markersize=3)
        other = "points" if key == "coordinates" else "coordinates"
        for axes in rows[:, column]:
            axes.set_xscale("log")
            axes.set_xticks(place, [f"{value:,}" for value in place])
            axes.minorticks_off()
            frame(axes, None, None)
        frame(memory, f"{key}, with {sizes[0][other]:,} {other}", None)
    for axes, label in zip(rows[:, 0], ("evaluation (µs)", "compiling (s)", "peak memory (GiB)"), strict=True):
        frame(axes, None, label)
        axes.set_ylim(0, 1.15 * axes.get_ylim()[1])
    rows[0, 0].set_yscale("log")  # over which what goes with its size is a straight line
    rows[0, 0].set_ylim(100, None)
    rows[0, 0].legend(loc="upper left")
    _save(figure, file)
