"""Frequency content over time of the coordinate that moves most."""

from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure

from drumsqueal.findings.signals import Spectrogram, spectrogram_pieces
from drumsqueal.questions.run.figures.view import View
from drumsqueal.terminal import style
from drumsqueal.terminal.placement import label_right_edge

RANGE_DB = 90.0  # dynamic range shown
PERIODS, FEWEST_PERIODS = 16.0, 3.0  # of the lowest mode in a window
OVERLAP = 0.875  # of neighbouring windows
MOST_COLUMNS = 2000  # or little more; a page has no room for them
WINDOWS = 4  # that must fit side by side into the record
ABOVE = 1.25  # highest frequency shown over that of the highest mode


@style.styled()
def draw_spectrogram(view: View) -> Figure | None:
    """Draw the spectrogram of a velocity in dB of its maximum; None where the record is too short for one."""
    if not view.readable or not view.modes:
        return None
    # A mode that dies out within a few periods does not set the length of the windows.
    lasting = [mode for mode in view.modes if mode.growth_rate > -mode.frequency_Hz]
    lowest = min(mode.frequency_Hz for mode in lasting or view.modes)
    rate = view.vibration.sample_rate
    periods = min(PERIODS, view.time.size / rate * lowest / WINDOWS)
    if periods < FEWEST_PERIODS:
        return None
    name = view.energetic
    signal = view.vibration.column(name, of="velocity")
    highest = min(rate / 2, ABOVE * max(mode.frequency_Hz for mode in view.modes))
    columns = max(1, round(signal.size / rate * lowest / periods / (1 - OVERLAP) / MOST_COLUMNS))
    content = _shown(
        spectrogram_pieces(signal, rate, lowest_frequency=lowest, periods=periods, overlap=OVERLAP), highest, columns
    )
    peak = content.amplitude.max()
    level = 20 * np.log10(np.maximum(content.amplitude / peak, 10 ** (-RANGE_DB / 20 - 1)))
    factor, unit = style.time_unit(view.time[-1])
    figure = style.new_figure(view.title, f"spectrogram of the velocity of {name}")
    axes = figure.subplots()
    image = axes.imshow(
        level,
        origin="lower",
        aspect="auto",
        cmap="magma",
        vmin=-RANGE_DB,
        vmax=0,
        extent=_edges((view.time[0] + content.time_s) * factor) + _edges(content.frequency_Hz / 1e3),
    )
    style.frame(axes, f"Time ({unit}), middle of a window of {periods / lowest * 1e3:.3g} ms", "Frequency (kHz)")
    axes.set_ylim(0, highest / 1e3)
    speed = "rad/s" if name.startswith("T") else "m/s"
    bar = figure.colorbar(image, ax=axes, extend="min", pad=0.02, aspect=30)
    bar.set_label(f"Velocity amplitude (dB relative to {peak:.3g} {speed})")
    bar.ax.tick_params(labelsize=style.SMALL_SIZE)
    labels = []
    for mode in view.modes:
        axes.axhline(
            mode.frequency_Hz / 1e3, color="white", linewidth=0.5, linestyle=(0, (2, 4)), gid=f"predicted {mode.label}"
        )
        labels.append((mode.frequency_Hz / 1e3, f"{mode.label} {mode.frequency_Hz:.0f} Hz", style.COLOUR[mode.name]))
    label_right_edge(axes, labels, reach=6.0)
    return figure


def _shown(pieces: Iterator[Spectrogram], highest: float, together: int) -> Spectrogram:
    """A spectrogram up to a frequency (Hz), with the mean of so many neighbouring columns in place of each of them."""
    parts = []
    for piece in pieces:
        kept, count = piece.frequency_Hz <= highest, piece.time_s.size
        starts = np.arange(0, count, together)
        sizes = np.diff(np.append(starts, count))
        time = np.add.reduceat(piece.time_s, starts) / sizes
        parts.append((time, piece.frequency_Hz[kept], np.add.reduceat(piece.amplitude[kept], starts, axis=1) / sizes))
    times, frequencies, amplitudes = zip(*parts, strict=True)
    return Spectrogram(np.concatenate(times), frequencies[0], np.concatenate(amplitudes, axis=1))


def _edges(centres: np.ndarray) -> tuple[float, float]:
    """Outer edges of evenly spaced pixels."""
    half = (centres[1] - centres[0]) / 2 if centres.size > 1 else 0.5
    return float(centres[0] - half), float(centres[-1] + half)
