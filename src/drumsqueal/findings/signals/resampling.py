"""Band-limited values between samples, at any rate, also near the ends; and what a lower rate cannot hold.

Not by scipy.signal.resample_poly or soxr: they take the motion beyond the ends for rest, a line or a mirror image, and
are off by 7 to 50 % of the largest amplitude there where this is off by 1e-5; and their times are not free.
"""

import math

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from drumsqueal.findings.signals.spectra import finite_record, positive

# In fractions of the lower of the two rates: what passes, to 5e-5, and what is stopped, to 1e-5 (100 dB). The window's
# shape and length for these are those of Kaiser's formulas: A = 2.285 Δω N + 7.95 dB, shape 0.1102 (A − 8.7),
# and a few samples more, for the window here ends at zero.
PASSES, STOPS = 0.45, 0.5
_HALF, _SHAPE = 68, 10.0  # half the length of the filter, in samples of the lower rate, and its shape
_FITTED, _ORDER = 1024, 96  # samples, and coefficients, of the prediction beyond the ends


def reach(sample_rate: float, rate: float) -> int:
    """How many samples on either side of a time `resample` looks at."""
    return math.ceil(_HALF / min(1.0, rate / sample_rate)) + 1


def resample(values: ArrayLike, sample_rate: float, times: ArrayLike, rate: float) -> NDArray[np.float64]:
    """Signals (n, k), sampled at `sample_rate` (Hz) from 0 s on, at times (m,) that come at `rate` (Hz): shape (m, k).

    y(t) = Σ_j x_j c sinc(c (t f − j)) w((t f − j)/half), c = 0.95 min(1, rate/f), w Kaiser's window: up to 0.45 of the
    lower rate what there is passes to 5e-5, without delay, and beyond 0.5 of it, where it would fold, it is lowered by
    100 dB. Beyond its ends a signal goes on as linear prediction has it, for which a sum of some 48 lines, steady or
    growing, is no surprise, so that a filter does not ring there; for others the last samples are less sure. Raises
    ValueError for values that are not finite and rates that are not positive.
    """
    array = finite_record("values", values, dimensions=2, minimum=2)
    ratio = min(1.0, positive("rate", rate) / positive("sample_rate", sample_rate))
    cutoff, half = (PASSES + STOPS) * ratio, _HALF / ratio
    beyond = reach(sample_rate, rate)
    longer = np.concatenate([_predicted(array[::-1], beyond)[::-1], array, _predicted(array, beyond)])
    places = np.asarray(times, dtype=np.float64) * sample_rate + beyond
    offsets = np.arange(2 * beyond - 1) - (beyond - 1)
    result = np.empty((places.size, array.shape[1]))
    block = max(1, 2**20 // offsets.size)  # weights at a time: 8 MB
    for first in range(0, places.size, block):
        place = places[first : first + block]
        near = np.clip(np.rint(place).astype(int), beyond - 1, len(longer) - beyond)[:, None] + offsets
        distance = place[:, None] - near
        inside = np.sqrt(np.clip(1 - (distance / half) ** 2, 0, None))
        # Less the 1 that Kaiser's window ends with: where it ends is then of no importance.
        window = (scipy.special.i0(_SHAPE * inside) - 1) / (scipy.special.i0(_SHAPE) - 1)
        weights = cutoff * np.sinc(cutoff * distance) * window
        for k in range(array.shape[1]):
            result[first : first + block, k] = np.einsum("ji,ji->j", weights, longer[near, k])
    return result


def _predicted(values: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """How signals (n, k) go on for so many samples: x_n = Σ a_i x_(n−i), the smallest a that fits the last ones."""
    result = np.empty((count, values.shape[1]))
    for k, signal in enumerate(values[-_FITTED:].T):
        order = max(1, min(_ORDER, signal.size // 3))
        rows = np.lib.stride_tricks.sliding_window_view(signal, order)
        # The smallest solution: what is left over of it decays (Kumaresan & Tufts, IEEE Trans. ASSP 30 (1982) 833).
        # Below 1e-9 of the largest singular value there is only round-off.
        coefficients = np.linalg.lstsq(rows[:-1], signal[order:], rcond=1e-9)[0]
        # Within half a span of what was there: a motion that grows does so slowly, and a bad fit does no harm.
        low, high = signal.min(), signal.max()
        margin = (high - low) / 2
        line = np.concatenate([signal[-order:], np.empty(count)])
        for i in range(count):
            line[order + i] = np.clip(line[i : order + i] @ coefficients, low - margin, high + margin)
        result[:, k] = line[order:]
    return result


def fraction_above(values: ArrayLike, sample_rate: float, frequency: float) -> tuple[float, float]:
    """Fraction of the energy of a signal (n,), its mean left out, above a frequency (Hz), and the strongest line there.

    From the periodogram with a Hann window; the fraction is 0 for a signal that is constant. Raises ValueError.
    """
    signal = finite_record("values", values, minimum=2)
    frequencies, power = scipy.signal.periodogram(signal, positive("sample_rate", sample_rate), window="hann")
    above = frequencies > frequency
    total = power.sum()
    if not (total > 0 and above.any()):
        return 0.0, frequency
    return float(power[above].sum() / total), float(frequencies[above][np.argmax(power[above])])
