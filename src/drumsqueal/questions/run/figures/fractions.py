"""Fractions of the lining over time, in contact and with the slip reversed: a panel of several figures."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from drumsqueal.questions.run.figures.view import View
from drumsqueal.terminal import style
from drumsqueal.terminal.placement import COLUMNS, finer, label_right_edge

PERIODS = 3  # of the main frequency, over which fast oscillation is averaged
AT_ONCE = 2**17  # samples in the windows that are looked at together
FINER, FEWEST = 8, 6  # points for each sample of a window, and samples that it takes


def draw_fractions(view: View, axes: Axes, shown: slice) -> None:
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
