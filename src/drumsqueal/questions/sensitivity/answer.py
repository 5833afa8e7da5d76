"""What the study of sensitivity writes, draws and prints."""

import math
import textwrap

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console

from drumsqueal.coordinates import largest_of
from drumsqueal.findings.columns import Column
from drumsqueal.questions.sensitivity.operating import Operating, where
from drumsqueal.questions.sensitivity.quieting import Quieting
from drumsqueal.questions.sensitivity.stabilising import Change, size_of
from drumsqueal.questions.sensitivity.study import MODES_STEP, SensitivityStudy
from drumsqueal.questions.sensitivity.words import (
    as_it_is,
    cautions_of,
    modes_that_matter,
    quiet_sentence,
    without_answer,
)
from drumsqueal.scene.quantities import printable
from drumsqueal.scene.variation import unit_of
from drumsqueal.terminal import style
from drumsqueal.terminal.reply import Answer
from drumsqueal.terminal.style import frame, new_figure, styled
from drumsqueal.terminal.tables import print_cells, rows_to_csv

# The figures of the study of sensitivity: what each number does to the growth rates, and what makes it quiet.


_ROW = 0.8  # of the distance between two numbers that their bars take up
_HATCHES = ("", "////", "....")  # of a second and a third mode of one name
# What may be marked on the axis of changes, the first first, and how far apart, of the axis, marks must be.
_FACTORS = (1, 0, 10, 0.1, 3, 0.3, 2, 0.5, 5, 0.2, 1.5, 0.7, 1.2, 0.8, 1.1, 0.9)
_APART = 0.07
STABLE, _TOGETHER = style.FAINT, style.DARK
_QUIET_FILL = style.COLOUR["X"]


@styled()
def _draw_sensitivity(study: SensitivityStudy) -> Figure:
    """Draw the change of the growth rates of the modes that matter, per +1 % of each number."""
    shown = [study.modes[k] for k in study.relevant]
    figure = new_figure(study.title, "growth rates per +1 % of each number")
    axes = figure.subplots()
    places = np.arange(len(study.effective))
    height = _ROW / len(shown)
    for k, mode in enumerate(shown):
        values = [row.growth_per_percent_1_per_s[study.relevant[k]] for row in study.effective]
        shift = (k - (len(shown) - 1) / 2) * height
        earlier = sum(other.name == mode.name for other in shown[:k])
        label = f"{mode.label}: {mode.frequency_Hz:.0f} Hz, {mode.growth_rate_1_per_s:+.3g} 1/s"
        hatch = _HATCHES[min(earlier, len(_HATCHES) - 1)]
        axes.barh(places + shift, values, height=height, color=style.COLOUR[mode.name], hatch=hatch, label=label)
    axes.axvline(0, color=style.DARK, linewidth=0.6)
    style.label_rows(axes, [row.key for row in study.effective])
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
    kinds = [("quiet", _QUIET_FILL)] if study.stable else [("stable", STABLE), ("quiet", _QUIET_FILL)]
    height = _ROW / len(kinds)
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
            color=_TOGETHER,
            markeredgecolor="white",
            label="the smallest change found, all of these together",
        )
    ends = [each.logarithm for row in study.alone for each in (row.stable, row.quiet) if each is not None]
    low, high = min([0.0, *ends]), max([0.0, *ends])
    # 0.55 of the axis of changes on each side, for the values at the ends of the bars
    room = 0.55 * max(high - low, math.log(2))
    axes.set_xlim(low - room, high + room)
    marked: dict[float, str] = {}
    for factor in _FACTORS:
        size = size_of("", 1.0, factor)
        if low - room < size < high + room and all(abs(size - at) > _APART * (high - low + 2 * room) for at in marked):
            marked[size] = f"× {factor:g}"
    axes.set_xticks(list(marked), list(marked.values()))
    axes.axvline(0, color=style.DARK, linewidth=0.6)
    style.label_rows(axes, [row.key for row in study.alone])
    frame(axes, "Change of the number (logarithmic), and the value that it would have", None)
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def _value(change: Change) -> str:
    return f"{change.after_in_unit:.4g} {change.unit}".rstrip()


WIDTH = 110  # letters in a line of the comment that heads a scene file


def print_study(console: Console, study: SensitivityStudy) -> None:
    """Print every number with the change of every growth rate per +1 %, and the smallest change that was found."""
    shown, others = largest_of({mode.label: mode.growth_rate_1_per_s for mode in study.modes})
    places = [k for k, mode in enumerate(study.modes) if mode.label in shown]
    modes = [f"{each.label}\n{each.frequency_Hz:.0f} Hz\n{each.growth_rate_1_per_s:+.4g}" for each in study.modes]
    columns = Column("number"), Column("SI value", ".3g"), *(Column(modes[k], ">") for k in places)
    rows = (
        (row.key, row.value_SI, *(_change(study, row.growth_per_percent_1_per_s[k]) for k in places))
        for row in study.effective
    )
    print_cells(console, "Change of each growth rate per +1 %, in 1/s", columns, rows)
    if others:
        lower = f"{', '.join(others)}: {'their growth rates are' if len(others) > 1 else 'its growth rate is'} lower"
        console.print(f"Without {lower} than those shown; sensitivity.csv has all modes", style="dim")
    names = ", ".join(study.modes[k].label for k in study.relevant)
    console.print(
        f"At {where(study.operating)}. Sorted by the largest change of {modes_that_matter(study)} {names}; "
        "0: below round-off. "
        "Automatic derivatives and central differences of ±0.1 % agree to "
        f"{study.largest_deviation_from_central_differences:.1g} of the largest.",
        style="dim",
    )
    without = [f"{row.key} ({row.value_SI:.3g})" for row in study.numbers if row not in study.effective]
    if without:
        console.print(f"Without effect on any growth rate, per +1 %: {', '.join(without)}", style="dim")
    if study.divergence_rate_1_per_s is not None:
        console.print(
            f"A motion without oscillation also grows: {study.divergence_rate_1_per_s:+.4g} 1/s.", style="dim"
        )
    if study.by_free_modes:
        console.print(
            f"The modes of what bends change with {', '.join(study.by_free_modes)}: these rows are central "
            f"differences of ±{100 * MODES_STEP:g} %, each with shapes of its own. Of two modes whose frequencies "
            "come near each other within that, only the sum is sure.",
            style="dim",
        )
    if study.not_followed:
        listed = " and ".join(study.not_followed)
        console.print(f"Not covered: {listed}: modes change places there, or the scene takes no such value.")
    if study.not_covered:
        lists = ", ".join(study.not_covered)
        console.print(f"Not covered: {lists}, which are lists; the table and the search leave them as they are.")
    if study.until_stable:
        _print_search(console, study)


def _print_search(console: Console, study: SensitivityStudy) -> None:
    """Print what squeals, what each number alone would have to be, and the smallest change of all of them."""
    words = as_it_is(study)
    if words is not None:
        console.print(printable(words), style="bold")
    if any(each.stable is not None or each.quiet is not None for each in study.alone):
        both = ("quiet",) if study.stable else ("stable", "quiet")
        columns = (Column(heading, ">", missing="") for name in both for heading in (f"{name} with", "change"))
        rows = (
            (
                *(row.key, _with_unit(row.change.before_in_unit, row.change, study)),
                *(cell for name in both for cell in _cells(getattr(row, name), study)),
            )
            for row in study.alone
            if row.change is not None
        )
        columns = (Column("number"), Column("now", ">"), *columns)
        print_cells(console, "Each number alone, the least change first", columns, rows)
    for line in (*cautions_of(study.alone), *without_answer(study.alone, study.stable)):
        console.print(line, style="dim")
    if study.quiet is not None:
        _print_quiet(console, study.quiet, study.operating)


def _cells(change: Change | None, study: SensitivityStudy) -> tuple[str, str]:
    if change is None:
        return "none found", ""
    return _with_unit(change.after_in_unit, change, study), _relative(change)


def _with_unit(value: float, change: Change, study: SensitivityStudy) -> str:
    scene = study.scene if change.before else study.scene.with_values({change.key: change.after})
    return f"{value:.6g} {change.unit or unit_of(change.key, scene)}".rstrip()


def _relative(change: Change) -> str:
    return f"{100 * change.relative:+.3g} %" if change.before else "new"


def _print_quiet(console: Console, quiet: Quieting, operating: Operating) -> None:
    title = "The smallest change found that makes the brake quiet" if quiet.quiet else (
        "The smallest change that makes every mode decay" if quiet.found else "The change with the least growth"
    )  # fmt: skip
    columns = (
        *(Column("number"), Column("before", ".6g"), Column("after", ".6g")),
        *(Column("unit", missing=""), Column("change", ">")),
    )
    rows = []
    for each in sorted(quiet.changes, key=lambda each: -abs(each.logarithm)):
        unit = each.unit or unit_of(each.key, quiet.scene)
        rows.append((each.key, each.before_in_unit, each.after_in_unit, unit, _relative(each)))
    if rows:
        print_cells(console, title, columns, rows)
    if quiet.succeeded:
        console.print(printable(quiet_sentence(quiet, operating)), style="bold")


def sensitivity_table(study: SensitivityStudy) -> str:
    """One row a number and mode, as CSV: derivatives in SI and per +1 %, and the same by central differences."""
    rows = []
    for row in study.numbers:
        by_mode = row.model_dump(exclude={"key", "value_SI"})
        for k, mode in enumerate(study.modes):
            of_mode = {
                "number": row.key,
                "value_SI": row.value_SI,
                "mode": mode.label,
                "frequency_Hz": mode.frequency_Hz,
                "growth_rate_1_per_s": mode.growth_rate_1_per_s,
            }
            rows.append(of_mode | {name: values[k] for name, values in by_mode.items()})
    return rows_to_csv(rows)


def quiet_scene(study: SensitivityStudy) -> str | None:
    """The changed scene as a file, headed by what was found; None where it is not quiet."""
    quiet = study.quiet
    if quiet is None or not quiet.succeeded:
        return None
    lines = textwrap.wrap(printable(quiet_sentence(quiet, study.operating)), WIDTH, break_long_words=False)
    return "".join(f"# {line}\n" for line in lines) + quiet.scene_file


def _change(study: SensitivityStudy, value: float) -> str:
    if abs(value) <= study.round_off_1_per_s:
        return "0"
    return f"{value:+.2g}" if abs(value) >= 0.01 else f"{value:+.0e}"  # 1/s; so that six modes fit on a terminal


def sensitivity_answer(*, until_stable: bool) -> Answer[SensitivityStudy]:
    """What is written and printed: the figure of what makes the brake quiet only where that was asked for."""
    return Answer(
        words=print_study,
        summary="sensitivity.json",
        tables={"sensitivity.csv": sensitivity_table, "quiet.toml": quiet_scene},
        figures={"sensitivity": _draw_sensitivity, **({"quiet": draw_quiet} if until_stable else {})},
    )
