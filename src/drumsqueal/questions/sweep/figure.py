"""The figures of a sweep: its stability, and amplitude and frequency of its response.

A map has the first number along x and the second along y; panels are slices of the third and of the fourth.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import CenteredNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from drumsqueal.physics.model import at_lining
from drumsqueal.questions.sweep.points import NONE, modes_in, names_in, squealing, undecided
from drumsqueal.scene.plan import Plan
from drumsqueal.solve.linear.modes import matched
from drumsqueal.terminal import style
from drumsqueal.terminal.style import frame, label_points, label_right_edge, legend_below, new_figure, styled

SLICES = 3  # of the third and of the fourth number: first, middle and last value
GROWTH_COLOURS = "PuOr_r"  # orange grows, purple decays; the colour-blind can distinguish them
RESPONSE_COLOURS = "viridis"
BOUNDARY, OF_A_MODE = 2.2, 1.0  # line widths
ROOM_FOR_NAMES, FEWER_NAMES = 18, 12  # of modes at the right edge; where there are more, fewer are easily read

Panel = tuple[Axes, dict[str, Any]]
"""Where a part of the grid is drawn, and which part: the places of the numbers that are held."""


# --- stability ------------------------------------------------------------------------------------------------------


@styled()
def draw_stability(sweep: xarray.Dataset, plan: Plan) -> Figure:
    """Draw the map of a grid of two numbers or more, or growth rates and frequencies over one."""
    return _draw_modes(sweep, plan) if len(plan.keys) == 1 else _draw_growth_maps(sweep, plan)


def _draw_growth_maps(sweep: xarray.Dataset, plan: Plan) -> Figure:
    figure = new_figure(plan.scene.title, f"stability of steady sliding by eigenvalues{_fixed_in_words(sweep, plan)}")
    panels = _panels(figure, sweep, plan)
    growth = sweep["largest_growth_rate"].values
    # White at zero; as far on both sides as growth goes or, where nothing grows, as decay does.
    known = growth[np.isfinite(growth)]
    norm = CenteredNorm(halfrange=float(known.max(initial=0.0) or np.abs(known).max(initial=0.0) or 1.0))
    seen: dict[str, Any] = {}
    for panel in panels:
        _draw_growth_map(panel, sweep, plan, norm, seen)
    beyond = "min" if known.min(initial=0.0) < -norm.halfrange else "neither"
    _add_colour_bar(figure, panels, ScalarMappable(norm, GROWTH_COLOURS), "largest growth rate (1/s)", extend=beyond)
    if seen:
        legend_below(figure, list(seen.values()), 5)  # columns
    return figure


def _draw_growth_map(panel: Panel, sweep: xarray.Dataset, plan: Plan, norm: CenteredNorm, seen: dict[str, Any]) -> None:
    """Draw one panel, and note what the legend is to explain of it."""
    axes, select = panel
    part = _shown_part(sweep, plan, select)
    growth = part["largest_growth_rate"].values
    x, y = _draw_cells(axes, part, plan, growth, norm=norm, cmap=GROWTH_COLOURS)
    if not np.isfinite(growth).all():
        seen["none"] = Patch(color=style.FAINT, label="no steady sliding")
    if _draw_zero(axes, (x, y, growth), style.DARK, BOUNDARY):
        seen["boundary"] = Line2D([], [], color=style.DARK, linewidth=BOUNDARY, label="boundary of squeal, Re λ = 0")
    for name, here in modes_in(part).items():
        of_mode = np.max(part["growth_rate"].values, axis=-1, initial=-np.inf, where=here)
        of_mode = np.where(here.any(axis=-1), of_mode, np.nan)
        if _draw_zero(axes, (x, y, of_mode), style.COLOUR[name], OF_A_MODE):
            seen[name] = Line2D([], [], color=style.COLOUR[name], linewidth=OF_A_MODE, label=f"mode {name} begins")
    own = [place for place in _places_of_the_scene(plan, select) if place is not None]
    if len(own) == len(plan.keys):
        axes.plot(*own[:2], "+", color=style.DARK, markersize=7, markeredgewidth=1.2, clip_on=False)
        label = "the scene itself"
        seen["own"] = Line2D([], [], color=style.DARK, marker="+", linestyle="none", markersize=7, label=label)


def _draw_zero(axes: Axes, field: tuple[np.ndarray, np.ndarray, np.ndarray], colour: str, width: float) -> bool:
    """Draw where a field is zero, and say whether that is anywhere between two points that have a value."""
    values = field[2]
    known = values[np.isfinite(values)]
    if not (known.size and known.min() < 0 < known.max() and min(values.shape) > 1):
        return False
    drawn = axes.contour(*field, [0.0], colors=colour, linewidths=width)
    return any(np.size(path.vertices) > 0 for path in drawn.get_paths())


def _draw_modes(sweep: xarray.Dataset, plan: Plan) -> Figure:
    figure = new_figure(plan.scene.title, "modes of steady sliding by eigenvalues")
    upper, lower = figure.subplots(2, 1, sharex=True)
    x = sweep[plan.keys[0]].values
    upper.axhline(0, color=style.DARK, linewidth=0.6)
    upper.margins(x=0)
    followed = modes_along(sweep)
    ends = max((end_of(eigenvalues) for _, eigenvalues in followed), default=0)
    growths = sorted((float(np.nanmax(eigenvalues.real)) for _, eigenvalues in followed), reverse=True)
    crowded = len(followed) > ROOM_FOR_NAMES
    least = growths[FEWER_NAMES - 1] if crowded else -np.inf
    last, earlier = [], []  # names at the right edge, and next to the ends of modes
    for label, eigenvalues in followed:
        growth, frequency, colour = eigenvalues.real, eigenvalues.imag / (2 * np.pi), style.COLOUR[label]
        # Markers as wide as the lines: a line through one point is none.
        upper.plot(x, growth, "o-", color=colour, markersize=0.9)
        lower.plot(x, frequency, "o-", color=colour, linewidth=0.6, markersize=0.6)
        unstable = np.where(growth > 0, frequency, np.nan)
        lower.plot(x, unstable, "o-", color=colour, linewidth=2.0, markersize=3.0, clip_on=False)
        place = end_of(eigenvalues)
        if np.nanmax(growth) < least:
            continue
        if place == ends:
            last.append((eigenvalues[ends], label, colour))
        else:
            earlier.append((x[place], frequency[place], label, colour))
    sizes = np.abs(sweep["largest_growth_rate"].values)
    if np.isfinite(sizes).any():  # modes that decay fast go out of the picture below: the boundary is what matters
        largest = 1.3 * max(float(np.nanmax(sizes)), 1e-9)  # of an axis of growth rates, over the largest
        upper.set_ylim(-largest, largest)
    dots = f"; named: the {FEWER_NAMES} least stable modes" * crowded
    if plan.transient:
        lower.plot(x, _sustained_frequency(sweep).values, ".", color=style.DARK, markersize=3)
        dots += "; dots: main frequency of sustained transients"
    (own,) = _places_of_the_scene(plan, {})
    if own is not None:
        dots += "; vertical line: as in the scene"
        for axes in (upper, lower):
            axes.axvline(own, color=style.FAINT, linewidth=0.8, zorder=0.5)
    frame(upper, None, "growth rate (1/s)")
    frame(lower, _label_of(sweep, plan.keys[0]), "frequency (Hz)")
    lower.set_title(f"thick: unstable{dots}", fontsize=style.SMALL_SIZE, loc="left")
    low, high = upper.get_ylim()
    label_right_edge(upper, [(value.real, *look) for value, *look in last if low <= value.real <= high])
    label_right_edge(lower, [(value.imag / (2 * np.pi), *look) for value, *look in last])
    label_points(lower, earlier, [])
    return figure


def _places_of_the_scene(plan: Plan, select: dict[str, Any]) -> list[float | None]:
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


# --- steady-state response ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class DrawnQuantity:
    """What is drawn of the response: values at every point, and what they are."""

    label: str
    values: xarray.DataArray
    colour: str


@styled()
def draw_amplitude(sweep: xarray.Dataset, plan: Plan) -> Figure | None:
    """Draw amplitude of the coordinate that moves most and main frequency; None where no transient was computed."""
    shown = _quantities(sweep, plan)
    if not shown:
        return None
    maps = len(plan.keys) > 1 and not plan.draws
    return _draw_response_maps(sweep, plan, shown) if maps else _draw_responses(sweep, plan, shown)


def _quantities(sweep: xarray.Dataset, plan: Plan) -> list[DrawnQuantity]:
    main = sweep["main_coordinate"].values
    if not np.any(main >= 0):
        return []
    # Of the coordinate that carries the motion at most points.
    index = int(np.bincount(main[main >= 0].ravel()).argmax())
    name = names_in(sweep, "main_coordinate")[index]
    factor, unit, shown = at_lining(plan.scene, name)
    amplitude = factor * sweep["amplitude"].isel(coordinate=index)
    found = [DrawnQuantity(f"{shown}, half peak to peak ({unit})", amplitude, style.COLOUR[name])]
    frequency = _sustained_frequency(sweep)
    if (squealing(sweep) | undecided(sweep)).any():
        found.append(DrawnQuantity("main frequency (Hz)", frequency, style.DARK))
    return found


def _sustained_frequency(sweep: xarray.Dataset) -> xarray.DataArray:
    """The main frequency where motion is sustained, or may be: what decays has one, too, but does not squeal."""
    return sweep["main_frequency"].where(squealing(sweep) | undecided(sweep))


def _draw_response_maps(sweep: xarray.Dataset, plan: Plan, shown: list[DrawnQuantity]) -> Figure:
    marks = "; dots: not settled" * bool(undecided(sweep).any())
    marks += "; grey: decays, or no transient" * any(np.isnan(each.values.values).any() for each in shown)
    figure = new_figure(plan.scene.title, f"steady-state response{_fixed_in_words(sweep, plan)}{marks}")
    panels = _panels(figure, sweep, plan, rows=len(shown))
    count = len(panels) // len(shown)
    for k, quantity in enumerate(shown):
        mine = panels[k * count : (k + 1) * count]
        known = quantity.values.values[np.isfinite(quantity.values.values)]
        scale = Normalize(float(known.min()), float(known.max())) if known.size else Normalize()
        for axes, select in mine:
            part = _shown_part(sweep.assign(shown=quantity.values), plan, select)
            x, y = _draw_cells(axes, part, plan, part["shown"].values, norm=scale, cmap=RESPONSE_COLOURS)
            row, column = np.nonzero(undecided(part))
            look = {"color": style.DARK, "markersize": 3, "markeredgecolor": "white", "markeredgewidth": 0.5}
            if row.size:  # an empty line that is not clipped counts as one at the figure's corner: the layout collapses
                axes.plot(x[column], y[row], "o", clip_on=False, zorder=3, **look)
        _add_colour_bar(figure, mine, ScalarMappable(scale, RESPONSE_COLOURS), quantity.label)
    return figure


def _draw_responses(sweep: xarray.Dataset, plan: Plan, shown: list[DrawnQuantity]) -> Figure:
    """Draw a dot for each motion, an open one where it had not settled: along a number or, of samples, growth rates."""
    unsettled = undecided(sweep)
    if plan.draws:
        subject, x = f"{plan.draws} samples", sweep["largest_growth_rate"].values
        label = "largest predicted growth rate (1/s)"
    else:
        subject, x, label = "the transients", sweep[plan.keys[0]].values, _label_of(sweep, plan.keys[0])
    marks = "; open: not settled" * bool(unsettled.any())
    figure = new_figure(plan.scene.title, f"steady-state response of {subject}{marks}")
    column = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for axes, quantity in zip(column, shown, strict=True):
        y = quantity.values.values
        if plan.draws:
            axes.axvline(0, color=style.DARK, linewidth=0.6)
        else:
            axes.plot(x, y, color=quantity.colour, linewidth=0.6)
        for some, face in ((~unsettled, quantity.colour), (unsettled, "white")):
            look = {"markerfacecolor": face, "markersize": 3, "markeredgewidth": 0.6}
            axes.plot(x[some], y[some], "o", color=quantity.colour, **look)
        frame(axes, None, quantity.label)
    frame(column[-1], label, None)
    return figure


# --- panels ---------------------------------------------------------------------------------------------------------


def _panels(figure: Figure, sweep: xarray.Dataset, plan: Plan, rows: int = 1) -> list[Panel]:
    """The panels of a figure, row by row; each of `rows` quantities takes as many rows as the fourth number has slices.

    With two numbers there is one panel for each quantity. Beyond the fourth number the middle value is shown.
    """
    keys, numbers = plan.keys, len(plan.keys)
    third, fourth = (_slices(plan, place) for place in (2, 3))
    # 34.0 height of a row, title and axis
    figure.set_figheight(max(style.HEIGHT_MM, 34.0 * rows * len(fourth)) / style.MM_PER_INCH)
    grid = figure.subplots(rows * len(fourth), len(third), squeeze=False, sharex=True, sharey=True)
    fixed = {key: count // 2 for key, count in zip(keys[4:], plan.shape[4:], strict=True)}
    found = []
    for row, below in zip(grid, rows * fourth, strict=True):
        for axes, across in zip(row, third, strict=True):
            found.append((axes, fixed | dict(zip(keys[2:4], (across, below), strict=False))))
        frame(row[0], None, _label_of(sweep, keys[1]))
        if numbers > 3:
            row[-1].yaxis.set_label_position("right")
            row[-1].set_ylabel(_held(sweep, keys[3], below), fontsize=style.SMALL_SIZE, rotation=270, va="bottom")
    if numbers > 2:
        for axes, at in zip(grid[0], third, strict=True):
            axes.set_title(_held(sweep, keys[2], at), fontsize=style.SMALL_SIZE)
    for axes in grid[-1]:
        frame(axes, _label_of(sweep, keys[0]), None)
    return found


def _slices(plan: Plan, place: int) -> list[int]:
    """The places of the slices along a number; one where there is no such number."""
    if place >= len(plan.shape):
        return [0]
    return sorted({round(k * (plan.shape[place] - 1) / (SLICES - 1)) for k in range(SLICES)})


def _shown_part(sweep: xarray.Dataset, plan: Plan, select: dict[str, Any]) -> xarray.Dataset:
    """The part that a panel shows: dimensions second number, first number, and those of the variables."""
    # 600 values along an axis: more are thinned out, for there are not so many dots in print
    steps = {key: slice(None, None, -(-sweep.sizes[key] // 600)) for key in plan.keys[:2]}
    return sweep.isel(select | steps).transpose(*reversed(plan.keys[:2]), ...)


def _draw_cells(
    axes: Axes, part: xarray.Dataset, plan: Plan, values: np.ndarray, **colours: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Draw a cell for each value; return the values along both axes."""
    x, y = (part[key].values for key in plan.keys[:2])
    axes.set_facecolor(style.FAINT)
    axes.pcolormesh(x, y, values, shading="nearest", rasterized=True, **colours)
    for along, limit in ((x, axes.set_xlim), (y, axes.set_ylim)):
        if along.min() < along.max():  # half a cell beyond the first and the last value nothing was computed
            limit(along.min(), along.max())
    axes.tick_params(which="both", labelsize=style.SMALL_SIZE)
    return x, y


def _add_colour_bar(figure: Figure, panels: list[Panel], colours: ScalarMappable, label: str, **how: Any) -> None:
    bar = figure.colorbar(colours, ax=[axes for axes, _ in panels], pad=0.02, **how)
    bar.set_label(label)
    bar.ax.tick_params(labelsize=style.SMALL_SIZE)


def _label_of(sweep: xarray.Dataset, key: str) -> str:
    """A number's name and unit, for an axis."""
    unit = sweep[key].attrs["units"]
    return in_words(key) if unit == "1" else f"{in_words(key)} ({unit})"


def _held(sweep: xarray.Dataset, key: str, at: int) -> str:
    """A number with the value at which it is held."""
    unit = sweep[key].attrs["units"]
    return f"{in_words(key)} {float(sweep[key].values[at]):.4g}{'' if unit == '1' else f' {unit}'}"


def _fixed_in_words(sweep: xarray.Dataset, plan: Plan) -> str:
    """What the numbers beyond the fourth are held at, for the heading; empty where there are none."""
    held = [_held(sweep, key, count // 2) for key, count in zip(plan.keys[4:], plan.shape[4:], strict=True)]
    return f"; at {', '.join(held)}" if held else ""


def in_words(key: str) -> str:
    """A dotted key as words."""
    return key.replace(".", " ").replace("_", " ")


# Modes along one number of a sweep: one by their shapes or, where these continue none of the scene, by eigenvalues.


# Distance of two eigenvalues over their size from which they are two modes, and what another name adds to it.
OTHER_MODE, OTHER_NAME = 0.5, 0.1


def modes_along(sweep: xarray.Dataset) -> list[tuple[str, NDArray[np.complex128]]]:
    """The label, as in `modes_in`, and the eigenvalues (points,) of each mode along one number, NaN where it is not.

    They come by rising frequency.
    """
    eigenvalues, found = sweep["growth_rate"].values + 2j * np.pi * sweep["frequency"].values, []
    numbered = sweep.assign(mode_number=(sweep["mode_number"].dims, _numbers(sweep, eigenvalues)))
    for label, places in modes_in(numbered).items():
        points, ranks = np.nonzero(places & np.isfinite(eigenvalues))
        along = np.full(len(eigenvalues), complex(np.nan, np.nan))
        along[points] = eigenvalues[points, ranks]
        if points.size:
            found.append((label, along))
    return sorted(found, key=lambda mode: np.nanmean(mode[1].imag))


def end_of(eigenvalues: NDArray[np.complex128]) -> int:
    """The last point at which a mode is."""
    return int(np.flatnonzero(np.isfinite(eigenvalues))[-1])


def _numbers(sweep: xarray.Dataset, eigenvalues: NDArray[np.complex128]) -> NDArray[np.int64]:
    """Numbers of the modes (points, mode): those of the scene itself, and others for what continues none of these.

    Such modes are joined from point to point to those with the nearest eigenvalues. What is far from all is another
    mode: a shoe that bends may have more of them at one point than at another. Numbers of the scene stand as they are,
    and no two modes of a point have the same one.
    """
    there = np.isfinite(eigenvalues)
    numbers = np.where(there, sweep["mode_number"].values, NONE).astype(np.int64)
    of_scene = numbers.max(initial=NONE)
    for k in range(len(numbers)):
        now, before = np.flatnonzero(there[k]), np.flatnonzero(there[k - 1] & (k > 0))
        distances = _distances(sweep, eigenvalues, numbers, k, before, now)
        for old, new in matched(-np.minimum(distances, OTHER_MODE)).items():
            number, own = int(numbers[k - 1, before[old]]), int(numbers[k, now[new]])
            if distances[old, new] >= OTHER_MODE:
                continue
            if own == NONE and number not in numbers[k]:
                numbers[k, now[new]] = number
            elif own != NONE and number > of_scene and not _meet(numbers, number, own):
                numbers[numbers == number] = own
        others = now[numbers[k, now] == NONE]
        numbers[k, others] = numbers.max() + 1 + np.arange(others.size)
    return numbers


def _meet(numbers: NDArray[np.int64], one: int, other: int) -> bool:
    """Whether both numbers are there at one point."""
    return bool(((numbers == one).any(axis=1) & (numbers == other).any(axis=1)).any())


def _distances(
    sweep: xarray.Dataset,
    eigenvalues: NDArray[np.complex128],
    numbers: NDArray[np.int64],
    k: int,
    before: NDArray[np.int64],
    now: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Of eigenvalues at point k from those expected by the two points before, over their size (before, now).

    Where there is but one point before, names count, too. Modes in the plane and out of it do not know of each other.
    """
    names, planes, shapes = (
        (sweep[name].values[k - 1, before][:, None], sweep[name].values[k, now])
        for name in ("mode_coordinate", "mode_in_plane", "mode_number")
    )
    here, last = eigenvalues[k, now], eigenvalues[k - 1, before]
    same = (numbers[k - 2] == numbers[k - 1, before][:, None]) & (k > 1)
    known = same.any(axis=1)
    expected = np.where(known, 2 * last - eigenvalues[k - 2, same.argmax(axis=1)], last)
    found = np.abs(here - expected[:, None]) / np.maximum(np.abs(last)[:, None], np.abs(here))
    found += np.where((names[0] != names[1]) & ~known[:, None], OTHER_NAME, 0.0)
    found[(planes[0] != planes[1]) & (np.minimum(*planes) >= 0)] = OTHER_MODE
    sure = np.minimum(*shapes) >= 0
    return np.where(sure, np.where(shapes[0] == shapes[1], 0.0, OTHER_MODE), found)
