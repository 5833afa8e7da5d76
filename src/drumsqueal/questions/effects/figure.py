"""What each effect of a scene costs and changes: bars of time next to changes on a log axis."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drumsqueal.findings.answers import QUANTITIES
from drumsqueal.questions.effects.study import EffectStudy
from drumsqueal.questions.effects.variants import Variant
from drumsqueal.scene.quantities import percent
from drumsqueal.terminal import style
from drumsqueal.terminal.style import frame, new_figure, styled

SMALLEST, LARGEST = 1e-6, 1e2  # relative changes; what is outside is drawn at the end of the axis, or as lost
MARKERS = {
    "growth_rate": ("o", "X"),
    "onset_frequency": ("s", "Y"),
    "amplitude": ("D", "Tz"),
    "main_frequency": ("^", "Tx"),
}
BAR = 0.55  # of a row
MOST_ROWS = 22  # that a figure of the usual height has room for


@styled()
def draw_effects(study: EffectStudy) -> Figure:
    """Draw a row for each run: computing time on the left, relative changes and the accuracy asked for on the right."""
    figure = new_figure(study.scene.title, "what each effect costs and changes")
    figure.set_figheight(figure.get_figheight() * max(1.0, len(study.variants) / MOST_ROWS))
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=[1, 1.5])
    rows = study.variants
    _draw_times(left, rows)
    _draw_changes(right, study)
    left.set_yticks(range(len(rows)), [variant.label for variant in rows])
    for text, variant in zip(left.get_yticklabels(), rows, strict=True):
        text.set_fontweight("bold" if study.needs(variant) else "normal")
    for axes in (left, right):
        axes.tick_params(axis="y", length=0)
        for row in range(1, len(rows)):
            axes.axhline(row - 0.5, color=style.FAINT, linewidth=0.4, zorder=0.5)
    left.set_ylim(len(rows) - 0.5, -0.5)
    return figure


def _draw_times(axes: Axes, rows: tuple[Variant, ...]) -> None:
    times = [variant.time_per_ms for variant in rows]
    known = [0.0 if math.isnan(value) else value for value in times]
    axes.barh(range(len(rows)), known, height=BAR, color=[style.DARK, *[style.SEPARATED] * (len(rows) - 1)])
    for row, variant in enumerate(rows):
        text = "not run" if math.isnan(variant.time_per_ms) else f"{variant.time_per_ms:.3g}"
        axes.annotate(
            text, (known[row], row), xytext=(3, 0), textcoords="offset points", va="center", fontsize=style.SMALL_SIZE
        )
    axes.set_xlim(0, 1.25 * max([*known, 1e-9]))
    frame(axes, "ms per simulated ms", None)


def _draw_changes(axes: Axes, study: EffectStudy) -> None:
    axes.set_xscale("log")
    axes.set_xlim(SMALLEST / 2, LARGEST * 2)
    axes.axvspan(SMALLEST / 2, study.within, color=style.PALE, linewidth=0, zorder=0)
    axes.axvline(study.within, color=style.DARK, linewidth=0.6)
    for place, (field, (marker, colour)) in enumerate(MARKERS.items()):
        shift = 0.17 * (place - (len(MARKERS) - 1) / 2)
        values, at = [], []
        for row, variant in enumerate(study.variants):
            value = None if variant.change is None else getattr(variant.change, field)
            if value is not None:
                values.append(float(np.clip(abs(value), SMALLEST, LARGEST)))
                at.append(row + shift)
        axes.plot(
            values, at, marker, color=style.COLOUR[colour], markersize=3.5, label=QUANTITIES[field], clip_on=False
        )
    for row, variant in enumerate(study.variants):
        if variant.answer is None:
            axes.text(study.within * 1.2, row, "failed", va="center", fontsize=style.SMALL_SIZE)
    ticks = [10.0**power for power in range(-6, 3, 2)]
    axes.set_xticks(ticks, ["≤ 1e−4 %", *(percent(tick) for tick in ticks[1:-1]), "≥ 1e4 %\nor lost"])
    axes.minorticks_off()
    frame(axes, f"relative change; grey: within {percent(study.within)}, bold: needed", None)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2, columnspacing=1.0)
