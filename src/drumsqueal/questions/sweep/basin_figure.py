"""The figure of the basins: each start at its place, in the colour of what it leads to."""

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drumsqueal.findings.signals.regime_words import rest_words
from drumsqueal.physics.model import at_lining
from drumsqueal.questions.sweep.basin import Basin, starts_alone
from drumsqueal.questions.sweep.figure import in_words
from drumsqueal.questions.sweep.points import NONE, Starting
from drumsqueal.scene.plan import Plan
from drumsqueal.terminal import style
from drumsqueal.terminal.style import frame, new_figure, styled

COLOURS = [style.COLOUR[name] for name in ("Y", "X", "Tz", "Ty", "Tx", "Z")]  # of the attractors, by their numbers
QUIET, ELSEWHERE = style.FAINT, style.DARK
MOST_SHOWN = len(COLOURS)
FEW, MANY = 100, 3000  # starts, drawn large and small
SIZES = 4.5, 1.5  # of their dots, points


@styled()
def draw_basin(data: xarray.Dataset, plan: Starting, basin: Basin) -> Figure:
    """Draw the first two numbers of the starts, or over one number the amplitude that it leads to."""
    two = len(plan.starts) > 1
    rest = plan.starts[2:]
    also = f"; {', '.join(map(in_words, rest))} drawn, too" * bool(rest)
    if not starts_alone(plan):
        also += "; so does the brake"
    squeals = (
        f"{basin.squeal.in_words} of {plan.points} disturbances squeal" if basin.squeal.total else basin.clear_of_none
    )
    figure = new_figure(plan.about["title"], f"{squeals}{also}")
    axes = figure.subplots()
    factor, unit, shown = at_lining(plan.scene if isinstance(plan, Plan) else plan.model, basin.coordinate)
    x = _values(plan, basin, plan.starts[0])
    y = _values(plan, basin, plan.starts[1]) if two else factor * _amplitude(data, basin)
    size = float(np.interp(plan.points, (FEW, MANY), SIZES))
    for number, colour, label in _kinds(basin):
        mine = np.minimum(basin.attractor, MOST_SHOWN) == number
        if mine.any():
            axes.plot(x[mine], y[mine], "o", color=colour, markersize=size, markeredgewidth=0, label=label)
    frame(
        axes,
        _label(plan, plan.starts[0]),
        _label(plan, plan.starts[1]) if two else f"{shown}, half peak to peak ({unit})",
    )
    _mark_steady_sliding(axes, two=two)
    figure.legend(loc="outside lower center", ncols=2, columnspacing=1.5)
    return figure


def _kinds(basin: Basin) -> list[tuple[int, str, str]]:
    """Number, colour and label of what starts lead to."""
    found = [(0, QUIET, f"steady sliding ({basin.decay.percent})")]
    labels = [f"squeal {each.number}: {each.frequency_Hz:.4g} Hz ({each.chance.percent})" for each in basin.attractors]
    labels += [f"rest {each.number}, {rest_words(each.place)} ({each.chance.percent})" for each in basin.rests]
    if len(labels) > MOST_SHOWN:
        labels[MOST_SHOWN - 1 :] = [
            f"{'squeal' if len(basin.attractors) >= MOST_SHOWN else 'rest'} {MOST_SHOWN} and others"
        ]
    found += [(number, colour, label) for number, (colour, label) in enumerate(zip(COLOURS, labels, strict=False), 1)]
    if not basin.attractors and basin.squeal.count:
        found.append((1, COLOURS[0], f"squeal ({basin.squeal.percent})"))
    return [*found, (NONE, ELSEWHERE, "elsewhere, or not clear")]


def _values(plan: Starting, basin: Basin, key: str) -> np.ndarray:
    return np.array([plan.listed(key, value) for value in basin.starts[:, plan.keys.index(key)].tolist()])


def _label(plan: Starting, key: str) -> str:
    return f"{in_words(key).removeprefix('start ')} from steady sliding ({plan.unit(key)})"


def _amplitude(data: xarray.Dataset, basin: Basin) -> np.ndarray:
    names = [str(name) for name in data["coordinate"].values]
    amplitude = data["amplitude"].values.reshape(-1, len(names))[:, names.index(basin.coordinate)]
    return np.where(basin.attractor == 0, 0.0, amplitude)


def _mark_steady_sliding(axes: Axes, *, two: bool) -> None:
    """A cross where there is no disturbance."""
    if two and axes.get_xlim()[0] < 0 < axes.get_xlim()[1] and axes.get_ylim()[0] < 0 < axes.get_ylim()[1]:
        axes.plot(0, 0, "+", color=style.DARK, markersize=7, markeredgewidth=1.2)
