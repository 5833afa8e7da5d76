"""What a study of effects writes and prints."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.console import Console
from rich.text import Text

from drumsqueal.findings.columns import Column, columns_of, values_of
from drumsqueal.findings.compare import QUANTITIES, RelativeChange
from drumsqueal.questions.effects.study import EffectStudy, Variant
from drumsqueal.scene.quantities import ROUND_OFF, percent, printable
from drumsqueal.terminal import style
from drumsqueal.terminal.reply import Answer
from drumsqueal.terminal.style import frame, new_figure, styled
from drumsqueal.terminal.tables import print_cells, rows_to_csv

# What each effect of a scene costs and changes: bars of time next to changes on a log axis.


SMALLEST, _LARGEST = 1e-6, 1e2  # relative changes; what is outside is drawn at the end of the axis, or as lost
_MARKERS = {
    "growth_rate": ("o", "X"),
    "onset_frequency": ("s", "Y"),
    "amplitude": ("D", "Tz"),
    "main_frequency": ("^", "Tx"),
}


@styled()
def draw_effects(study: EffectStudy) -> Figure:
    """Draw a row for each run: computing time on the left, relative changes and the accuracy asked for on the right."""
    figure = new_figure(study.scene.title, "what each effect costs and changes")
    # 22 that a figure of the usual height has room for
    figure.set_figheight(figure.get_figheight() * max(1.0, len(study.variants) / 22))
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=[1, 1.5])
    rows = study.variants
    _draw_times(left, rows)
    _draw_changes(right, study)
    for axes in (left, right):
        style.label_rows(axes, [variant.label for variant in rows])
    for text, variant in zip(left.get_yticklabels(), rows, strict=True):
        text.set_fontweight("bold" if study.needs(variant) else "normal")
    return figure


def _draw_times(axes: Axes, rows: tuple[Variant, ...]) -> None:
    # What was given up, as it takes so long, has no bar next to which the others would vanish.
    known = [0.0 if math.isnan(each.time_per_ms) or each.answer is None else each.time_per_ms for each in rows]
    # 0.55 of a row
    axes.barh(range(len(rows)), known, height=0.55, color=[style.DARK, *[style.SEPARATED] * (len(rows) - 1)])
    for row, variant in enumerate(rows):
        text = "not run" if math.isnan(variant.time_per_ms) else f"{variant.time_per_ms:.3g}"
        text += ", given up" if variant.answer is None and text != "not run" else ""
        axes.annotate(
            text, (known[row], row), xytext=(3, 0), textcoords="offset points", va="center", fontsize=style.SMALL_SIZE
        )
    axes.set_xlim(0, 1.25 * max([*known, 1e-9]))
    frame(axes, "ms per simulated ms", None)


def _draw_changes(axes: Axes, study: EffectStudy) -> None:
    axes.set_xscale("log")
    axes.set_xlim(SMALLEST / 2, _LARGEST * 2)
    axes.axvspan(SMALLEST / 2, study.within, color=style.PALE, linewidth=0, zorder=0)
    axes.axvline(study.within, color=style.DARK, linewidth=0.6)
    for place, (field, (marker, colour)) in enumerate(_MARKERS.items()):
        shift = 0.17 * (place - (len(_MARKERS) - 1) / 2)
        values, at = [], []
        for row, variant in enumerate(study.variants):
            value = None if variant.change is None else getattr(variant.change, field)
            if value is not None:
                values.append(float(np.clip(abs(value), SMALLEST, _LARGEST)))
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
    style.legend_above(axes, right=True, ncols=2, columnspacing=1.0)


def print_study(console: Console, study: EffectStudy) -> None:
    """Print every run with its cost and its changes, and what follows from them."""
    columns = Column("left out or reduced"), *columns_of(Variant).values(), *columns_of(RelativeChange).values()
    rows = []
    for variant in study.variants:
        needed = study.needs(variant)
        name = Text(f"{variant.label} *" if needed else variant.label, style="bold" if needed else "")
        rows.append((name, *values_of(variant), *_changes(variant)))
    print_cells(console, "What each effect costs and changes", columns, rows)
    for line in (f"{_explained(study)} * needed within {percent(study.within)}.", *study.remarks):
        console.print(line, style="dim")
    console.print(study.verdict, style="bold")


def reduced_scene(study: EffectStudy) -> str | None:
    """The scene with what it needs, as a file that states what was left out; None before the study is over."""
    if study.reduced_scene is None:
        return None
    remarks = "".join(f"# {printable(remark)}\n" for remark in (study.verdict, *study.remarks))
    return f"{remarks}{study.reduced_scene.to_toml()}"


def _changes(variant: Variant) -> list[str]:
    if variant.answer is None:
        return ["failed"]
    return [] if variant.change is None else list(map(_change, values_of(variant.change)))


def _change(value: float | None) -> str:
    if value is None:
        return "-"
    if math.isinf(value):
        return "lost"
    # A relative change below 1e-4 has no digits on the terminal.
    return "<0.01" if ROUND_OFF < abs(value) < 1e-4 else percent(value, "+").removesuffix(" %")


def _explained(study: EffectStudy) -> str:
    answer = study.variants[0].answer
    text = "Time and evaluations for a simulated millisecond. Changes from the whole scene: of growth rates and onset "
    text += "frequencies the largest over the modes"
    if answer is not None and answer.carriers:
        text += (
            f"; at the end, of the amplitude (half peak to peak) the largest over {', '.join(answer.carriers)}, and "
        )
        text += "of the frequency of the strongest line, which may be another one"
    return f"{text}."


EFFECTS_ANSWER = Answer(
    words=print_study,
    tables={"effects.csv": lambda study: rows_to_csv(study.runs), "reduced.toml": reduced_scene},
    figures={"effects": draw_effects},
)
