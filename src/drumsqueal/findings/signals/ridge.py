"""The frequency of a line over time."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drumsqueal.findings.signals.spectra import parabola_vertex, spectrogram_pieces


class Ridge(NamedTuple):
    """Frequency and amplitude of a line (k,) at times `time_s` (s after the first sample), the middles of windows."""

    time_s: NDArray[np.float64]
    frequency_Hz: NDArray[np.float64]
    amplitude: NDArray[np.float64]


def follow_line(signal: ArrayLike, sample_rate: float, *, low: float, high: float, periods: float = 16.0) -> Ridge:
    """Follow the strongest line of a signal (time,) between two frequencies (Hz) over time.

    In each Hann window of `periods` periods of the middle frequency the spectrum's maximum is taken, interpolated by a
    parabola through its logarithm; windows in which it lies at the edge of the band are left out. A frequency that
    changes within a window comes out as its mean there.

    Raises ValueError as `spectrogram` does, and for a band that is none.
    """
    if not 0.0 < low < high:
        raise ValueError(f"the band must rise from above zero, got {low:g} to {high:g} Hz")
    rows = []
    for found in spectrogram_pieces(signal, sample_rate, lowest_frequency=0.5 * (low + high), periods=periods):
        band = np.flatnonzero((found.frequency_Hz >= low) & (found.frequency_Hz <= high))
        step = found.frequency_Hz[1] - found.frequency_Hz[0]
        for time, column in zip(found.time_s, found.amplitude.T, strict=True):
            best = int(band[np.argmax(column[band])]) if band.size else 0
            three = column[max(best - 1, 0) : best + 2]
            if three.size == 3 and three[1] >= max(three) > 0.0:
                offset, height = parabola_vertex(*np.log(np.maximum(three, np.finfo(np.float64).tiny)).tolist())
                rows.append((float(time), float(found.frequency_Hz[best] + offset * step), float(np.exp(height))))
    return Ridge(*np.array(rows, dtype=np.float64).reshape(-1, 3).T)
