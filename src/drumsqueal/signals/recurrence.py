"""After which lags a record comes back to itself, and how well."""

from typing import NamedTuple

import numpy as np
import scipy.fft
import scipy.signal
from numpy.typing import NDArray

from drumsqueal.signals.spectra import amplitude_spectrum, parabola_vertex

# A motion is periodic when it differs from itself a period later by less than this, relative to its rms.
RECURRENCE = 1e-2
# Interpolation before lags are compared: 7.4 kHz at 50 kHz has 6.8 samples a period, and half a sample is then a
# recurrence error of 0.46. A Kaiser-windowed sinc over 16 samples on either side is flat to 1e-4 up to 0.84 of the
# Nyquist frequency.
FINER = 8
REACH = 16
KAISER = 8.0


class Recurrence(NamedTuple):
    """How well a motion comes back: after `period` (samples), and after many of them."""

    period: float
    error: float
    later_error: float

    @property
    def lasts(self) -> bool:
        """Whether it comes back after many periods, too: a cycle, not a torus that nearly closes."""
        return self.later_error <= RECURRENCE


def find_recurrences(unit: NDArray[np.float64], longest: float) -> tuple[list[Recurrence], float | None]:
    """Return the lags after which signals (time, k) come back, and the smallest error e at any lag searched.

        e(L) = rms |y(t + L) − y(t)| / rms y ≤ 1e-2

    on the record interpolated to 8 times the rate, for lags L from half a period of the strongest spectral peak to
    `longest` (samples), a third of the record at most; the shortest first, and none after the first that lasts. The
    error is None where there is no such lag.
    """
    fine = _interpolated(unit)
    squared = _squared_errors(fine)
    shortest, longest = _shortest_lag(unit), min(int(longest * FINER) + 2, fine.shape[0] // 3)
    if shortest >= longest:
        return [], None
    minima = shortest + 1 + scipy.signal.find_peaks(-squared[shortest + 1 : longest])[0]
    found: list[Recurrence] = []
    for lag in minima:
        offset, lowest = parabola_vertex(*squared[lag - 1 : lag + 2].tolist())
        if lowest > (3.0 * RECURRENCE) ** 2:  # far off already; the exact error takes longer
            continue
        error = _error_at(fine, lag + offset)
        if error <= RECURRENCE:
            found.append(_followed(fine, squared, lag + offset, error))
            if found[-1].lasts:
                break
    smallest = float(np.sqrt(squared[shortest:longest].min()))
    return found, min([smallest, *(item.error for item in found)])


def recurrence_after(unit: NDArray[np.float64], lag: float) -> Recurrence | None:
    """Return how well signals (time, k) come back after a lag (samples) and many times it; None beyond half of them."""
    fine = _interpolated(unit)
    squared = _squared_errors(fine)
    if not 1 < round(lag * FINER) < squared.size - 2:
        return None
    return _followed(fine, squared, lag * FINER, _error_at(fine, lag * FINER))


def _interpolated(unit: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the record at a finer rate, without the ends that the interpolation cannot reach."""
    samples = np.arange(-REACH * FINER, REACH * FINER + 1) / FINER
    kernel = np.sinc(samples) * np.kaiser(samples.size, KAISER) / FINER
    fine = scipy.signal.resample_poly(unit, FINER, 1, axis=0, window=kernel)
    trim = min(REACH, unit.shape[0] // 8) * FINER
    return fine[trim : fine.shape[0] - trim]


def _shortest_lag(unit: NDArray[np.float64]) -> int:
    """Return half a period of the strongest spectral component, in fine samples: no shorter lag can be a period."""
    spectra = [amplitude_spectrum(column, 1.0, zero_padding=1) for column in unit.T]
    power = np.sum([spectrum.amplitude**2 for spectrum in spectra], axis=0)
    return max(1, int(0.5 * FINER / spectra[0].frequency_Hz[1 + np.argmax(power[1:])]))


def _followed(fine: NDArray[np.float64], squared: NDArray[np.float64], lag: float, error: float) -> Recurrence:
    """Double the lag as long as it fits in half the record; the last one fixes the period, its error tells a cycle."""
    turns, reached = 1, lag
    while round(2.0 * reached) + 3 < squared.size:
        turns, middle = 2 * turns, round(2.0 * reached)
        nearest = middle - 2 + int(np.argmin(squared[middle - 2 : middle + 3]))
        offset, _ = parabola_vertex(*squared[nearest - 1 : nearest + 2].tolist())
        reached = nearest + float(np.clip(offset, -1.0, 1.0))
    return Recurrence(reached / turns / FINER, error, _error_at(fine, reached))


def _squared_errors(fine: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return e² for every whole lag up to half the record: e²(L) (n − L) = Σ y(t)² + Σ y(t+L)² − 2 Σ y(t) y(t+L)."""
    samples = fine.shape[0]
    lags = np.arange(samples // 2)
    length = scipy.fft.next_fast_len(samples + lags.size, real=True)
    correlation = np.zeros(lags.size)
    for column in fine.T:
        transform = np.fft.rfft(column, length)
        correlation += np.fft.irfft(np.abs(transform) ** 2, length)[: lags.size]
    energy = np.concatenate([[0.0], np.cumsum(np.sum(fine**2, axis=1))])
    pairs = energy[samples - lags] + (energy[-1] - energy[lags]) - 2.0 * correlation
    return np.maximum(pairs, 0.0) / (samples - lags) / (energy[-1] / samples)


def _error_at(fine: NDArray[np.float64], lag: float) -> float:
    """Return e at a lag between samples, by the cubic through the four samples about it."""
    whole = int(lag)
    p = lag - whole
    weights = (
        -p * (p - 1.0) * (p - 2.0) / 6.0,
        (p + 1.0) * (p - 1.0) * (p - 2.0) / 2.0,
        -(p + 1.0) * p * (p - 2.0) / 2.0,
        (p + 1.0) * p * (p - 1.0) / 6.0,
    )
    pairs = fine.shape[0] - whole - 2
    later = sum(weight * fine[whole + j : whole + j + pairs] for j, weight in zip((-1, 0, 1, 2), weights, strict=True))
    return float(np.sqrt(np.mean((later - fine[:pairs]) ** 2) / np.mean(fine**2)))
