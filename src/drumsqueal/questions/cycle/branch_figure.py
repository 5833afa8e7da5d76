"""Cycles along a parameter: amplitude and frequency, stable or not, folds, Hopf points and the bistable range."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from drumsqueal.findings.vibration import unit_of
from drumsqueal.questions.cycle.diagram import CycleBranches, Diagram, Interval
from drumsqueal.questions.cycle.orbit import Cycle, Event
from drumsqueal.questions.onset.figure import DASHES, SHADES, draw_cycles, limit_amplitudes
from drumsqueal.questions.onset.found import Kind
from drumsqueal.terminal import style
from drumsqueal.terminal.placement import tick_in_units
from drumsqueal.terminal.style import frame, new_figure, styled

MICRO = 1e6
MARKERS = dict(zip(Event, "s^vPx", strict=True))
ROOM = 0.08  # of the height, above the largest amplitude


@styled()
def draw_branch(found: CycleBranches) -> Figure:
    """Draw half the peak-to-peak value of the coordinate that becomes unstable first, and the frequency."""
    variation, span = found.parameter.variation, found.parameter
    figure = new_figure(found.title, f"limit cycles along {variation.key}")
    amplitude, frequency = figure.subplots(2, 1, sharex=True, height_ratios=[1.6, 1])
    margin = 0.012 * (span.high - span.low)
    amplitude.set_xlim(span.low - margin, span.high + margin)
    name = main_coordinate(found)
    colour = style.COLOUR[name]
    for axes in (amplitude, frequency):
        _shade(axes, found)
    _draw(amplitude, found, colour, lambda cycle: MICRO * cycle.amplitude[name])
    _draw(frequency, found, colour, lambda cycle: cycle.frequency_Hz)
    sizes = [MICRO * cycle.amplitude[name] for branch in found.branches for cycle in branch.cycles]
    rest = limit_amplitudes(amplitude, sizes, ROOM)
    for spans, line in ((found.steady_sliding_stable, "-"), (found.steady_sliding_unstable, DASHES)):
        for each in spans:
            amplitude.plot(each, [rest, rest], color=style.DARK, linewidth=1.6, linestyle=line, clip_on=False, zorder=3)
    for critical in found.critical_values:
        for axes, value in ((amplitude, rest), (frequency, critical.frequency_Hz)):
            axes.plot(critical.value, value, "D", color=style.DARK, markersize=4, clip_on=False, zorder=5)
    unit = f" ({variation.shown_unit})" if variation.shown_unit else ""
    tick_in_units(frequency.xaxis, variation.size)
    frame(amplitude, None, f"{name}, half peak to peak ({unit_of(name, 'µ')})")
    frame(frequency, f"{variation.key}{unit}", "Frequency (Hz)")
    figure.align_ylabels([amplitude, frequency])
    figure.legend(handles=_legend(found, colour), loc="outside lower center", ncols=4)
    return figure


def main_coordinate(found: CycleBranches) -> str:
    """The coordinate of the first Hopf point or, without one that moves, that with most energy in most cycles."""
    cycles = [cycle for branch in found.branches for cycle in branch.cycles]
    critical = [each.label.split()[0] for each in found.critical_values]
    main = [cycle.main_coordinate for cycle in cycles]
    return next((name for name in critical if name in cycles[0].names), max(main, key=main.count))


def _draw(axes: Axes, diagram: Diagram, colour: str, measure: Callable[[Cycle], float]) -> None:
    draw_cycles(axes, diagram, colour, measure)
    for branch in diagram.branches:
        for special in branch.special:
            assert special.what is not None
            axes.plot(
                special.value,
                measure(special),
                MARKERS[special.what],
                color=style.DARK,
                markersize=4,
                markerfacecolor="white",
                zorder=4,
            )


def _shade(axes: Axes, diagram: Diagram) -> None:
    for kind, spans in _ranges(diagram).items():  # not beyond the range, where nothing is known
        for low, high in spans:
            axes.axvspan(low, high, color=SHADES[kind], linewidth=0, zorder=0)


def _ranges(diagram: Diagram) -> dict[Kind, Sequence[Interval]]:
    return {
        Kind.STABLE: diagram.steady_sliding_stable,
        Kind.BISTABLE: diagram.squeals_only_when_kicked,
        Kind.SQUEALS: diagram.steady_sliding_unstable,
    }


def _same(some: Sequence[Interval], others: Sequence[Interval]) -> bool:
    """Whether intervals are the same, to what Newton's method leaves of the ends of the range."""
    return len(some) == len(others) and bool(np.allclose(some, others, rtol=1e-9))


def _legend(found: CycleBranches, colour: str) -> list[Line2D | Patch]:
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=colour, label="stable cycle"),
        Line2D([], [], color=colour, linestyle=DASHES, label="unstable cycle"),
        Line2D([], [], color=style.DARK, linewidth=1.4, label="steady sliding (dashed: unstable)"),
    ]
    if found.critical_values:
        handles.append(Line2D([], [], marker="D", color=style.DARK, linestyle="", markersize=4, label="Hopf point"))
    kinds = dict.fromkeys(special.what for branch in found.branches for special in branch.special if special.what)
    for kind in kinds:
        look = {"marker": MARKERS[kind], "markerfacecolor": "white", "markersize": 4, "linestyle": ""}
        handles.append(Line2D([], [], color=style.DARK, label=kind, **look))
    present = _ranges(found)
    if _same(present[Kind.STABLE], present[Kind.BISTABLE]):
        del present[Kind.STABLE]
    return handles + [Patch(color=SHADES[kind], label=kind) for kind, spans in present.items() if spans]
