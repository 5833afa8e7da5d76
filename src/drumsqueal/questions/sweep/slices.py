"""A grid of any number of dimensions as panels of two: the first along x, the second along y, slices of the others."""

import itertools
from typing import Any, NamedTuple

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drumsqueal.scene.plan import Plan
from drumsqueal.terminal import style
from drumsqueal.terminal.style import frame

SLICES = 3  # of the third and of the fourth number: first, middle and last value
LOWEST_MM = 34.0  # height of a row, title and axis
FINEST = 600  # values along an axis of a map: more are thinned out, for there are not so many dots in print


class Panel(NamedTuple):
    """One panel: where it is drawn, and which part of the grid it shows."""

    axes: Axes
    select: dict[str, Any]


def label_of(sweep: xarray.Dataset, key: str) -> str:
    """A number's name and unit, for an axis."""
    unit = sweep[key].attrs.get("units", "1")
    return in_words(key) if unit == "1" else f"{in_words(key)} ({unit})"


def in_words(key: str) -> str:
    """A dotted key as words."""
    return key.replace(".", " ").replace("_", " ")


def panels(figure: Figure, sweep: xarray.Dataset, plan: Plan, rows: int = 1) -> list[list[Panel]]:
    """The panels of a figure, row by row; each of `rows` quantities takes as many rows as the fourth number has slices.

    With two numbers there is one panel for each quantity. Beyond the fourth number the middle value is shown.
    """
    third, fourth = (_slices(plan, place) for place in (2, 3))
    figure.set_figheight(max(style.HEIGHT_MM, LOWEST_MM * rows * len(fourth)) / style.MM_PER_INCH)
    grid = figure.subplots(rows * len(fourth), len(third), squeeze=False, sharex=True, sharey=True)
    fixed = {key: plan.shape[place] // 2 for place, key in enumerate(plan.keys) if place >= 4}
    found = []
    for row, (_, below) in zip(grid, itertools.product(range(rows), fourth), strict=True):
        found.append([])
        for axes, across in zip(row, third, strict=True):
            select = fixed | dict(zip(plan.keys[2:4], (across, below), strict=False))
            found[-1].append(Panel(axes, select))
    numbers = len(plan.keys)
    if numbers > 2:
        for axes, at in zip(grid[0, :], third, strict=True):
            axes.set_title(_held(sweep, plan.keys[2], at), fontsize=style.SMALL_SIZE)
    if numbers > 3:
        for axes, (_, at) in zip(grid[:, -1], itertools.product(range(rows), fourth), strict=True):
            axes.yaxis.set_label_position("right")
            axes.set_ylabel(_held(sweep, plan.keys[3], at), fontsize=style.SMALL_SIZE, rotation=270, va="bottom")
    for axes in grid[-1]:
        frame(axes, label_of(sweep, plan.keys[0]), None)
    return found


def _held(sweep: xarray.Dataset, key: str, at: int) -> str:
    return f"{in_words(key)} {value_of(sweep, key, at)}"


def fixed_in_words(sweep: xarray.Dataset, plan: Plan) -> str:
    """What the numbers beyond the fourth are held at, for the heading; empty where there are none."""
    held = [_held(sweep, key, plan.shape[4 + k] // 2) for k, key in enumerate(plan.keys[4:])]
    return f"; at {', '.join(held)}" if held else ""


def value_of(sweep: xarray.Dataset, key: str, at: int) -> str:
    """A value of a number with its unit."""
    unit = sweep[key].attrs.get("units", "1")
    return f"{float(sweep[key].values[at]):.4g}" + ("" if unit == "1" else f" {unit}")


def thinned(sweep: xarray.Dataset, plan: Plan, select: dict[str, Any]) -> xarray.Dataset:
    """The part that a panel shows: dimensions second number, first number, and those of the variables."""
    steps = {key: slice(None, None, -(-sweep.sizes[key] // FINEST)) for key in plan.keys[:2]}
    return sweep.isel(select | steps).transpose(*reversed(plan.keys[:2]), ...)


def scene_at(plan: Plan, select: dict[str, Any]) -> list[float | None]:
    """Where the scene itself lies on each axis, in its unit; None where that is outside or off the slice shown."""
    own = plan.scene.numbers()
    found = []
    for each in plan.variations:
        value = own[each.key]
        shown = [each.values[select[each.key]]] if each.key in select else each.values
        if isinstance(value, float) and min(shown) <= value <= max(shown):
            found.append(each.listed(value))
        else:
            found.append(None)
    return found


def hold_to(axes: Axes, x: np.ndarray, y: np.ndarray) -> None:
    """Cut the cells of a map at its first and last values: half a cell beyond them nothing was computed."""
    for values, limit in ((x, axes.set_xlim), (y, axes.set_ylim)):
        if values.min() < values.max():
            limit(values.min(), values.max())


def of_coordinate(part: xarray.Dataset, name: str, index: int) -> np.ndarray:
    """A variable of the least stable mode of a coordinate at each point; NaN where it has none."""
    mine = part["mode_coordinate"].values == index
    growth = np.where(mine, part["growth_rate"].values, -np.inf)
    chosen = np.argmax(growth, axis=-1)[..., None]
    values = np.take_along_axis(part[name].values.astype(float), chosen, axis=-1)[..., 0]
    return np.where(mine.any(axis=-1), values, np.nan)


def _slices(plan: Plan, place: int) -> list[int]:
    """The places of the slices along a number; one where there is no such number."""
    if place >= len(plan.shape):
        return [0]
    return sorted({round(k * (plan.shape[place] - 1) / (SLICES - 1)) for k in range(SLICES)})
