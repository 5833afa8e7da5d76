"""The modes of a run: their eigenvalues in the complex plane, and their amplitudes and frequency over time."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, NullFormatter
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from drumsqueal.findings.verdict import rate_text
from drumsqueal.questions.run.figures.view import View
from drumsqueal.solve.linear.modes import Mode, Stability
from drumsqueal.terminal import style
from drumsqueal.terminal.style import COLUMNS, finer, label_points, label_right_edge

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


DASHES = (0, (4, 3))
PERIODS = 3  # of the main frequency, over which fast oscillation is averaged
AT_ONCE = 2**17  # samples in the windows that are looked at together
FINER, FEWEST = 8, 6  # points for each sample of a window, and samples that it takes


@style.styled()
def draw_growth(view: View) -> Figure | None:
    """Draw the amplitude of each mode with its predicted slope; None where no mode moved or too little was recorded."""
    if not view.readable or not view.modes:
        return None
    figure = style.new_figure(view.title, "growth of the modes")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    saturation = view.saturation
    end = view.time[-1]
    if saturation is not None and saturation.vibrates:
        # The record is shown to 1.15 times the start of the saturated part.
        end = min(end, 1.15 * saturation.start_s)
    shown = slice(0, int(np.searchsorted(view.time, end, side="right")))
    factor, unit = style.time_unit(view.time[-1])
    _explain(view, upper, *draw_amplitudes(view, upper, shown))
    _mark_phases(view, lower)
    _draw_fractions(view, lower, shown)
    more = f"; the record goes on to {view.time[-1] * factor:.4g} {unit}" if shown.stop < view.time.size else ""
    style.frame(lower, f"Time ({unit}){more}", "Lining (%)")
    lower.set_xlim(view.time[0] * factor, end * factor)
    return figure


def draw_amplitudes(view: View, axes: Axes, shown: slice) -> tuple[list[Artist], list[Artist]]:
    """Draw the amplitude of each mode over the samples that are shown, with its predicted slope.

    Returns what to name in a legend: the modes, and what is marked.
    """
    marks = _mark_phases(view, axes)
    modes = [_draw_mode(view, axes, mode, shown) for mode in view.modes]
    axes.set_yscale("log")
    top = float(max(view.amplitude(mode, shown).max() for mode in view.modes))
    begins = min(float(view.amplitude(mode, slice(0, 1))[0]) for mode in view.modes)
    # A decaying mode leaves the frame below: how it begins decides how far down that goes.
    # At most 7 decades below the largest amplitude are shown.
    axes.set_ylim(min(max(begins / 10, top * 10.0**-7), top / 100), top * 2)
    axes.yaxis.set_minor_formatter(NullFormatter())
    style.frame(axes, None, f"Amplitude ({view.measure})")
    return modes, marks


def _explain(view: View, axes: Axes, modes: list[Artist], marks: list[Artist]) -> None:
    """Put the legends above the frame."""
    factor, unit = style.time_unit(view.time[-1])
    compared, predicted = "Re λ predicted / measured", "predicted growth"
    if view.findings.changing:
        when = f"at t = {view.result.stability.time:g} s"
        until = view.findings.growth.linear_until_s * factor
        compared = f"Re λ {when} / " + (f"mean from 0 to {until:.4g} {unit}" if until > 0 else "measured")
        predicted = f"growth as predicted {when}"
    others = len(view.moving) - len(modes)
    title = f"Mode: {compared} (1/s)" + (f"; {others} more move{'s' * (others == 1)} less" if others else "")
    legend = style.legend_above(axes, handles=modes, title=title, alignment="left")
    axes.add_artist(legend)
    legend.set_clip_on(False)  # or the layout takes it for hidden and leaves it no room
    explained = [
        Line2D([], [], color=style.DARK, linewidth=0.7, linestyle=DASHES, label=predicted),
        Patch(color=style.FAINT, label=f"smallest to largest in {PERIODS} periods"),
        *marks,
    ]
    style.legend_above(axes, right=True, handles=explained)


@style.styled()
def draw_frequency(view: View) -> Figure | None:
    """Draw the frequency with what predicts it; None where no mode was followed from onset to saturation."""
    drift = view.findings.frequency
    if drift is None or drift.ridge is None or drift.ridge.time_s.size < 2:
        return None
    figure = style.new_figure(view.title, f"frequency of {drift.mode}, in the motion of {drift.coordinate}")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    factor, unit = style.time_unit(view.time[-1])
    own = style.COLOUR[drift.coordinate]
    upper.plot((view.time[0] + drift.ridge.time_s) * factor, drift.ridge.frequency_Hz, color=own)
    when = f" at t = {view.result.stability.time:g} s" if view.findings.changing else ""
    alone = "loss of contact" if drift.predicted_by_contact_loss_Hz < drift.onset_Hz else "mean contact stiffness"
    levels = [
        (drift.onset_Hz, f"eigenvalue{when}", style.DARK, "-"),
        (drift.predicted_by_contact_loss_Hz, alone, style.TOUCHING, "--"),
        (drift.saturated_Hz, "saturated line", own, "-"),
    ]
    for frequency, _, colour, dashes in levels:
        upper.axhline(frequency, color=colour, linewidth=0.6, linestyle=dashes)
    values = np.array([*drift.ridge.frequency_Hz, *(level[0] for level in levels)])
    room = 0.06 * float(np.ptp(values)) or 1.0  # of the range of frequencies, above and below
    low, high = values.min() - room, values.max() + room
    upper.set_ylim(low, high)
    crude = drift.predicted_by_root_of_contact_share_Hz
    upper.axhline(crude, color=style.TOUCHING, linewidth=0.6, linestyle=":")
    where = "dotted" if low <= crude <= high else "outside the frame"
    explained = f"{where}: {crude:.0f} Hz, the cruder estimate eigenvalue × √(mean fraction of the lining in contact)"
    upper.set_title(explained, fontsize=style.SMALL_SIZE, loc="left")
    style.frame(upper, None, "Frequency (Hz)")
    label_right_edge(upper, [(value, f"{value:.0f} Hz {name}", colour) for value, name, colour, _ in levels], reach=6.0)
    _draw_fractions(view, lower, slice(0, view.time.size))
    style.frame(lower, f"Time ({unit})", "Lining (%)")
    lower.set_xlim(view.time[0] * factor, view.time[-1] * factor)
    return figure


def _draw_mode(view: View, axes: Axes, mode: Mode, shown: slice) -> Artist:
    """Draw one mode with the exponential that is predicted from its fitted start, and return its legend entry."""
    factor, colour = style.time_unit(view.time[-1])[0], style.COLOUR[mode.label]
    growth = next(found.measured_growth for found in view.findings.modes if found.label == mode.label)
    boundary = view.findings.edge_reached_s
    values = view.vibration.modal(mode, shown) * view.micrometres(mode.name)
    time, low, mean, high = running(view, values, shown)
    axes.fill_between(time * factor, low, high, color=colour, alpha=0.2, linewidth=0)
    measured = "not measured" if growth is None else rate_text(growth.rate_1_per_s, mode.frequency_Hz)
    label = f"{mode.label} {mode.frequency_Hz:.0f} Hz: {rate_text(mode.growth_rate, mode.frequency_Hz)} / {measured}"
    (line,) = axes.plot(time * factor, mean, color=colour, linewidth=1.3, label=label)
    ends = np.array([view.time[0], view.time[-1] if boundary is None else min(2 * boundary, view.time[-1])])
    first = view.amplitude(mode, slice(0, 1))[0]
    start = first if growth is None else growth.amplitude_at_start * view.micrometres(mode.name)
    # Cut off where the number would leave what a double holds, far outside the frame.
    slope = start * np.exp(np.clip(mode.growth_rate * (ends - ends[0]), -500.0, 500.0))
    axes.plot(ends * factor, slope, color=style.DARK, linewidth=0.7, linestyle=DASHES, gid=f"predicted {mode.label}")
    return line


def _mark_phases(view: View, axes: Axes) -> list[Artist]:
    """Shade the growth phase and mark the first contact boundary; return what to name in the legend."""
    (factor, unit), marks = style.time_unit(view.time[-1]), []
    until, boundary = view.findings.growth.linear_until_s, view.findings.edge_reached_s
    if 0 < until < view.time[-1]:
        ends = (view.time[0] * factor, until * factor)
        marks.append(axes.axvspan(*ends, color=style.PALE, zorder=0, linewidth=0, label="growth phase"))
    if boundary is not None:
        label = f"contact boundary reached, {boundary * factor:.4g} {unit}"
        marks.append(axes.axvline(boundary * factor, color=style.DARK, linewidth=0.8, linestyle=":", label=label))
    return marks


def _draw_fractions(view: View, axes: Axes, shown: slice) -> None:
    """Draw the fraction of the lining in contact and that with the slip reversed over time, named at the right."""
    labels, factor = [], style.time_unit(view.time[-1])[0]
    for name, text, colour in (
        ("contact_fraction", "in contact", style.TOUCHING),
        ("slip_reversed_fraction", "slip reversed", style.REVERSED),
        ("sticking", "sticks", style.STUCK),
    ):
        if name == "sticking" and not view.result.history[name].any():
            continue
        time, low, mean, high = running(view, 100 * view.result.history[name].values[shown], shown)
        axes.fill_between(time * factor, low, high, color=colour, alpha=0.25, linewidth=0)
        axes.plot(time * factor, mean, color=colour)
        labels.append((float(mean[-1]), text, colour))
    axes.set_ylim(-4, 104)
    axes.set_yticks([0, 50, 100])
    label_right_edge(axes, labels, reach=6.0)


def running(
    view: View, values: NDArray[np.float64] | NDArray[np.complex128], shown: slice
) -> tuple[NDArray[np.float64], ...]:
    """Times (s) of the middles of overlapping windows, and smallest value, mean and largest value in them.

    `values` are those of the samples `shown`. Of complex ones it is the modulus, between the samples, too: it may dip
    faster than they follow each other. Not percentiles: where something lasts for little more than their fraction of a
    period, as slip reversal does, the few samples that fall on it decide about them, and a periodic motion seems to
    beat.
    """
    frequency = view.main_frequency or view.vibration.sample_rate
    window = min(max(1, round(PERIODS * view.vibration.sample_rate / frequency)), max(1, values.size // 8))
    step = max(1, window // 4, values.size // COLUMNS)
    windows: Any = sliding_window_view(values, window)[::step]
    low, mean, high = (np.empty(len(windows)) for _ in range(3))
    together = max(1, AT_ONCE // window)
    for first in range(0, len(windows), together):
        some = slice(first, first + together)
        size = _modulus(windows[some])
        low[some], mean[some], high[some] = size.min(axis=1), size.mean(axis=1), size.max(axis=1)
    return view.time[shown][window // 2 :: step][: len(windows)], low, mean, high


def _modulus(windows: NDArray[Any]) -> NDArray[np.float64]:
    """Real values as they are; modulus of complex ones (windows, samples), between the samples, too, if enough."""
    count = windows.shape[1]
    if not np.iscomplexobj(windows):
        return windows
    if count < FEWEST:
        return np.abs(windows)
    return np.abs(finer(np.arange(count, dtype=float), windows.T, FINER * count)[1].T)
