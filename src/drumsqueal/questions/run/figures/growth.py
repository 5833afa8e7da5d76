"""What a run does over time: amplitudes of the modes, frequency of the leading one, and the contact underneath."""

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import NullFormatter
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from drumsqueal.findings.verdict import rate_text
from drumsqueal.questions.run.figures.view import View
from drumsqueal.solve.linear.modes import Mode
from drumsqueal.terminal import style
from drumsqueal.terminal.style import COLUMNS, finer, label_right_edge

DECADES = 7  # shown at most below the largest amplitude
BEYOND = 1.15  # the record is shown this far past the start of the saturated part
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
        end = min(end, BEYOND * saturation.start_s)
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
    axes.set_ylim(min(max(begins / 10, top * 10.0**-DECADES), top / 100), top * 2)
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
    legend = axes.legend(
        handles=modes,
        title=f"Mode: {compared} (1/s)" + (f"; {others} more move{'s' * (others == 1)} less" if others else ""),
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        borderaxespad=0.2,
        alignment="left",
    )
    axes.add_artist(legend)
    legend.set_clip_on(False)  # or the layout takes it for hidden and leaves it no room
    explained = [
        Line2D([], [], color=style.DARK, linewidth=0.7, linestyle=DASHES, label=predicted),
        Patch(color=style.FAINT, label=f"smallest to largest in {PERIODS} periods"),
        *marks,
    ]
    axes.legend(handles=explained, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)


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
    levels = [
        (drift.onset_Hz, f"eigenvalue{when}", style.DARK, "-"),
        (drift.predicted_by_contact_loss_Hz, "loss of contact", style.TOUCHING, "--"),
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
