"""The figures of the study of sensitivity: what each number does to the growth rates, and what makes it quiet."""

import math

import numpy as np
from matplotlib.figure import Figure

from drumsqueal.questions.sensitivity.change import Change
from drumsqueal.questions.sensitivity.stabilising import size_of
from drumsqueal.questions.sensitivity.study import SensitivityStudy
from drumsqueal.questions.sensitivity.words import modes_that_matter
from drumsqueal.terminal import style
from drumsqueal.terminal.style import frame, new_figure, styled

ROW = 0.8  # of the distance between two numbers that their bars take up
HATCHES = ("", "////", "....")  # of a second and a third mode of one name
# What may be marked on the axis of changes, the first first, and how far apart, of the axis, marks must be.
FACTORS = (1, 0, 10, 0.1, 3, 0.3, 2, 0.5, 5, 0.2, 1.5, 0.7, 1.2, 0.8, 1.1, 0.9)
APART = 0.07
ROOM = 0.55  # of the axis of changes on each side, for the values at the ends of the bars
STABLE, TOGETHER = style.FAINT, style.DARK
QUIET = style.COLOUR["X"]


@styled()
def draw_sensitivity(study: SensitivityStudy) -> Figure:
    """Draw the change of the growth rates of the modes that matter, per +1 % of each number."""
    shown = [study.modes[k] for k in study.relevant]
    figure = new_figure(study.title, "growth rates per +1 % of each number")
    axes = figure.subplots()
    places = np.arange(len(study.effective))
    height = ROW / len(shown)
    for k, mode in enumerate(shown):
        values = [row.growth_per_percent_1_per_s[study.relevant[k]] for row in study.effective]
        shift = (k - (len(shown) - 1) / 2) * height
        earlier = sum(other.name == mode.name for other in shown[:k])
        label = f"{mode.label}: {mode.frequency_Hz:.0f} Hz, {mode.growth_rate_1_per_s:+.3g} 1/s"
        hatch = HATCHES[min(earlier, len(HATCHES) - 1)]
        axes.barh(places + shift, values, height=height, color=style.COLOUR[mode.name], hatch=hatch, label=label)
    axes.axvline(0, color=style.DARK, linewidth=0.6)
    axes.set_yticks(places, [row.key for row in study.effective])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(study.effective) - 0.5, -0.5)
    for place in places[1:]:
        axes.axhline(place - 0.5, color=style.FAINT, linewidth=0.4, zorder=0.5)
    frame(axes, f"Change of the growth rate of {modes_that_matter(study)} (1/s), to the right: grows faster", None)
    figure.legend(loc="outside lower center", ncols=min(len(shown), 3))
    return figure


@styled()
def draw_quiet(study: SensitivityStudy) -> Figure | None:
    """Draw how far each number alone has to change for the brake to be stable, and quiet; and all of them together.

    None where that was not looked for.
    """
    if not study.alone:
        return None
    figure = new_figure(study.title, "what makes it quiet")
    axes = figure.subplots()
    kinds = [("quiet", QUIET)] if study.stable else [("stable", STABLE), ("quiet", QUIET)]
    height = ROW / len(kinds)
    for k, (name, colour) in enumerate(kinds):
        for place, row in enumerate(study.alone):
            change: Change | None = getattr(row, name)
            at = place + (k - (len(kinds) - 1) / 2) * height
            size, text = (0.0, f"none found ({name})") if change is None else (change.logarithm, _value(change))
            label = f"{name} with this number alone" if place == 0 else None
            axes.barh(at, size, height=height, color=colour, label=label)
            side = 1 if size >= 0 else -1
            axes.annotate(
                text,
                (size, at),
                xytext=(8 * side, 0),
                textcoords="offset points",
                ha="left" if side > 0 else "right",
                va="center",
                fontsize=style.SMALL_SIZE,
                color=style.DARK,
            )
    if study.quiet is not None and study.quiet.succeeded:
        places = {row.key: place for place, row in enumerate(study.alone)}
        some = [each for each in study.quiet.changes if each.key in places]
        axes.plot(
            [each.logarithm for each in some],
            [places[each.key] for each in some],
            "D",
            color=TOGETHER,
            markeredgecolor="white",
            label="the smallest change found, all of these together",
        )
    ends = [each.logarithm for row in study.alone for each in (row.stable, row.quiet) if each is not None]
    low, high = min([0.0, *ends]), max([0.0, *ends])
    room = ROOM * max(high - low, math.log(2))
    axes.set_xlim(low - room, high + room)
    marked: dict[float, str] = {}
    for factor in FACTORS:
        size = size_of("", 1.0, factor)
        if low - room < size < high + room and all(abs(size - at) > APART * (high - low + 2 * room) for at in marked):
            marked[size] = f"× {factor:g}"
    axes.set_xticks(list(marked), list(marked.values()))
    axes.axvline(0, color=style.DARK, linewidth=0.6)
    axes.set_yticks(range(len(study.alone)), [row.key for row in study.alone])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(study.alone) - 0.5, -0.5)
    for place in range(1, len(study.alone)):
        axes.axhline(place - 0.5, color=style.FAINT, linewidth=0.4, zorder=0.5)
    frame(axes, "Change of the number (logarithmic), and the value that it would have", None)
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def _value(change: Change) -> str:
    return f"{change.after_in_unit:.4g} {change.unit}".rstrip()
