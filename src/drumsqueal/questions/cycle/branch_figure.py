"""Cycles along a parameter: amplitude and frequency, stable or not, folds and Hopf points, and the kicked range."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from drumsqueal.findings.departure import unit_of
from drumsqueal.questions.cycle.branches import Diagram
from drumsqueal.questions.cycle.continuation import BRANCHING, CORNER, DOUBLING, FOLD, NEIMARK_SACKER
from drumsqueal.questions.cycle.kicked import Interval, kicked, steady_sliding
from drumsqueal.questions.cycle.orbit import Cycle
from drumsqueal.questions.onset.figure import DASHES, SHADES, draw_cycles, limit_amplitudes
from drumsqueal.questions.onset.rows import KICKED, SQUEALS, STABLE
from drumsqueal.scene.variation import Variation
from drumsqueal.terminal import style
from drumsqueal.terminal.placement import tick_in_units
from drumsqueal.terminal.style import frame, new_figure, styled

MICRO = 1e6
MARKERS = {FOLD: "s", NEIMARK_SACKER: "^", DOUBLING: "v", BRANCHING: "P", CORNER: "x"}
ROOM = 0.08  # of the height, above the largest amplitude


@styled()
def draw_branch(diagram: Diagram, variation: Variation) -> Figure:
    """Draw half the peak-to-peak value of the coordinate that is heard first, and the frequency, over the parameter."""
    figure = new_figure("" if diagram.scene is None else diagram.scene.title, f"cycles along {variation.key}")
    amplitude, frequency = figure.subplots(2, 1, sharex=True, height_ratios=[1.6, 1])
    margin = 0.012 * (diagram.high - diagram.low)
    amplitude.set_xlim(diagram.low - margin, diagram.high + margin)
    name = main_coordinate(diagram)
    colour = style.COLOUR[name]
    for axes in (amplitude, frequency):
        _shade(axes, diagram)
    _draw(amplitude, diagram, colour, lambda cycle: MICRO * cycle.amplitude[name])
    _draw(frequency, diagram, colour, lambda cycle: cycle.frequency_Hz)
    sizes = [MICRO * cycle.amplitude[name] for branch in diagram.branches for cycle in branch.cycles]
    rest = limit_amplitudes(amplitude, sizes, ROOM)
    for stable, line in ((True, "-"), (False, DASHES)):
        for span in steady_sliding(diagram, stable=stable):
            amplitude.plot(span, [rest, rest], color=style.DARK, linewidth=1.6, linestyle=line, clip_on=False, zorder=3)
    for critical in diagram.linear.critical:
        for axes, value in ((amplitude, rest), (frequency, critical.frequency_Hz)):
            axes.plot(critical.value, value, "D", color=style.DARK, markersize=4, clip_on=False, zorder=5)
    unit = f" ({variation.shown_unit})" if variation.shown_unit else ""
    tick_in_units(frequency.xaxis, variation.size)
    frame(amplitude, None, f"{name}, half peak to peak ({unit_of(name, 'µ')})")
    frame(frequency, f"{variation.key}{unit}", "Frequency (Hz)")
    figure.align_ylabels([amplitude, frequency])
    figure.legend(handles=_legend(diagram, colour), loc="outside lower center", ncols=4)
    return figure


def main_coordinate(diagram: Diagram) -> str:
    """The coordinate of the first Hopf point or, without one that moves, that with the most energy on the branches."""
    cycles = [cycle for branch in diagram.branches for cycle in branch.cycles]
    for critical in diagram.linear.critical:
        if critical.label.split()[0] in cycles[0].names:
            return critical.label.split()[0]
    size = np.sum([[cycle.amplitude[name] for name in cycle.names] for cycle in cycles], axis=0)
    return cycles[0].names[int(np.argmax(size * np.sqrt(np.asarray(cycles[0].model.mass))))]


def _draw(axes: Axes, diagram: Diagram, colour: str, measure: Callable[[Cycle], float]) -> None:
    draw_cycles(axes, diagram, colour, measure)
    for branch in diagram.branches:
        for special in branch.special:
            axes.plot(
                special.parameter,
                measure(special.cycle),
                MARKERS[special.kind],
                color=style.DARK,
                markersize=4,
                markerfacecolor="white",
                zorder=4,
            )


def _shade(axes: Axes, diagram: Diagram) -> None:
    spans = [(STABLE, each) for each in steady_sliding(diagram, stable=True)]
    spans += [(SQUEALS, each) for each in steady_sliding(diagram, stable=False)]
    spans += [(KICKED, each) for each in kicked(diagram)]
    for kind, (low, high) in spans:  # not beyond the range, where nothing is known
        axes.axvspan(low, high, color=SHADES[kind], linewidth=0, zorder=0)


def _same(some: list[Interval], others: list[Interval]) -> bool:
    """Whether intervals are the same, to what Newton's method leaves of the ends of the range."""
    return len(some) == len(others) and bool(np.allclose(some, others, rtol=1e-9))


def _legend(diagram: Diagram, colour: str) -> list[Line2D | Patch]:
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=colour, label="stable cycle"),
        Line2D([], [], color=colour, linestyle=DASHES, label="unstable cycle"),
        Line2D([], [], color=style.DARK, linewidth=1.4, label="steady sliding (dashed: unstable)"),
    ]
    if diagram.linear.critical:
        handles.append(Line2D([], [], marker="D", color=style.DARK, linestyle="", markersize=4, label="Hopf point"))
    kinds = dict.fromkeys(special.kind for branch in diagram.branches for special in branch.special)
    for kind in kinds:
        look = {"marker": MARKERS[kind], "markerfacecolor": "white", "markersize": 4, "linestyle": ""}
        handles.append(Line2D([], [], color=style.DARK, label=kind, **look))
    quiet = steady_sliding(diagram, stable=True)
    present = {STABLE: [] if _same(quiet, kicked(diagram)) else quiet, KICKED: kicked(diagram)}
    present[SQUEALS] = steady_sliding(diagram, stable=False)
    return handles + [Patch(color=SHADES[kind], label=kind) for kind, spans in present.items() if spans]
