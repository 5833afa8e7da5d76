"""The eigenvalues in the complex plane, with the frequency and growth that the transient showed."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from drumsqueal.findings.verdict import rate_text
from drumsqueal.questions.run.figures.view import View
from drumsqueal.solve.linear.modes import Mode, Stability
from drumsqueal.terminal import style
from drumsqueal.terminal.style import label_points

LEAST_WIDTH = 1.0  # of the enlarged panel (1/s)
MOST_NAMED = 12  # modes that have room for their names; of more, those that are least stable
STABLE, UNSTABLE = "#EAF3FA", "#FBEDE4"


@style.styled()
def draw_eigenvalues(view: View) -> Figure | None:
    """Draw the upper half of the complex plane: all eigenvalues, and enlarged those near the imaginary axis."""
    stability = view.result.stability
    values = np.asarray(stability.eigenvalues, dtype=np.complex128)
    # 0.3 modes whose |Re λ| is below this fraction of the largest are shown enlarged
    nearness = 0.3 * np.abs(values.real).max()
    near = [mode for mode in _least_stable(stability.modes) if abs(mode.growth_rate) < nearness]
    enlarged = bool(near) and len(near) < len(values[values.imag >= 0])
    figure = style.new_figure(view.title, "eigenvalues of steady sliding, upper half-plane")
    panels = figure.subplots(1, 1 + enlarged, sharey=True, squeeze=False, width_ratios=(1, 1.4)[: 1 + enlarged])[0]
    measured, changing = _measured(view), view.findings.changing
    draw_plane(panels[0], stability, measured=measured, changing=changing)
    if enlarged:
        # Room for a label to the right of every mode that grows, and to the left of those that decay.
        rates = [0.0, *(mode.growth_rate for mode in near)]
        width = max(LEAST_WIDTH, max(rates) - min(rates))
        left, right = ((1.0 if here else 0.3) * width for here in (min(rates) < 0, max(rates) > 0))
        limits = (min(rates) - left, max(rates) + right)
        draw_plane(panels[1], stability, limits, measured=measured, changing=changing)
        style.frame(panels[1], "Growth rate Re λ (1/s), enlarged", "")
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=5)
    for axes in panels:
        marks = [*measured, *((float(rate), 0.0) for rate in values.real[values.imag == 0])]
        name_modes(axes, stability.modes, marks, briefly=axes is not panels[-1])
    return figure


def name_modes(
    axes: Axes, modes: Sequence[Mode], marks: Sequence[tuple[float, float]] = (), *, briefly: bool = False
) -> None:
    """Write the name of each mode beside it where it is in the frame, clear of the others and of further `marks`.

    Frequency and growth rate come with it unless `briefly`; of many modes, with those that grow. Of very many, only
    the least stable are named, and where there is no room, those that grow.
    """
    low, high = axes.get_xlim()
    crowded = briefly and len(modes) > MOST_NAMED
    named = [mode for mode in modes if mode.unstable] if crowded else _least_stable(modes)
    modes = [mode for mode in named if low <= mode.growth_rate <= high]
    points = []
    for mode in modes:
        rate = rate_text(mode.growth_rate, mode.frequency_Hz)
        # 8 modes that have room for frequency and growth rate; of more, those that grow
        full = len(modes) <= 8 or mode.unstable
        text = f"{mode.label}: {mode.frequency_Hz:.0f} Hz, {rate} 1/s" if full and not briefly else mode.label
        points.append((mode.growth_rate, mode.frequency_Hz / 1e3, text, style.COLOUR[mode.label]))
    label_points(axes, points, list(marks))


def _least_stable(modes: Sequence[Mode]) -> list[Mode]:
    """As many of the modes as have room for their names, by rising frequency."""
    named = sorted(modes, key=lambda mode: -mode.growth_rate)[:MOST_NAMED]
    return [mode for mode in modes if mode in named]


def _measured(view: View) -> list[tuple[float, float]]:
    """Growth rate (1/s) and frequency (kHz) of each mode for which the transient showed both."""
    return [
        (found.measured_growth.rate_1_per_s, found.measured_frequency_Hz / 1e3)
        for found in view.findings.modes
        if found.measured_growth is not None and found.measured_frequency_Hz is not None
    ]


def draw_plane(
    axes: Axes,
    stability: Stability,
    limits: tuple[float, float] | None = None,
    *,
    measured: Sequence[tuple[float, float]] = (),
    changing: bool = False,
) -> None:
    """Draw the eigenvalues with limits of the growth rate (1/s), all of them unless given."""
    values = np.asarray(stability.eigenvalues, dtype=np.complex128)
    if limits is None:
        low, high = values.real.min(), values.real.max()
        margin = 0.12 * max(high - low, LEAST_WIDTH)
        limits = (low - margin, max(high, 0.0) + margin)
    top = 1.12 * max(stability.highest_frequency_Hz, 1.0) / 1e3
    axes.set_xlim(*limits)
    axes.set_ylim(-0.04 * top, top)
    axes.axvspan(min(limits[0], 0), 0, color=STABLE, linewidth=0, zorder=0, label="stable")
    axes.axvspan(0, max(limits[1], 0), color=UNSTABLE, linewidth=0, zorder=0, label="unstable")
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.axvline(0, color=style.DARK, linewidth=0.6, zorder=1)
    dot = {"marker": "o", "markersize": 4, "linestyle": ""}
    for mode in stability.modes:
        gid, colour = f"predicted {mode.label}", style.COLOUR[mode.label]
        axes.plot(mode.growth_rate, mode.frequency_Hz / 1e3, **dot, color=colour, gid=gid)
    predicted = f"mode at t = {stability.time:g} s" if changing else "predicted mode"
    axes.plot([], [], **dot, color=style.DARK, label=predicted)
    real = values.real[values.imag == 0]
    if real.size:
        square = dot | {"marker": "s", "markersize": 3.5}
        axes.plot(real, np.zeros(len(real)), **square, color=style.DARK, label="no oscillation")
    if measured:
        ring = dot | {"markersize": 8, "fillstyle": "none", "markeredgewidth": 0.7}
        label = "mean over the growth phase" if changing else "measured in the transient"
        axes.plot(*np.transpose(measured), **ring, color=style.DARK, label=label)
    style.frame(axes, "Growth rate Re λ (1/s)", "Frequency Im λ/2π (kHz)")
