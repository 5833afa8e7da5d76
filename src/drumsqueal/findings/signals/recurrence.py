"""The lags after which a record recurs, and its recurrence errors."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from drumsqueal.findings.signals.spectra import amplitude_spectrum, local_maxima, parabola_vertex

# A motion is periodic when it differs from itself a period later by less than this, relative to its rms.
RECURRENCE = 1e-2
# Interpolation before lags are compared: 7.4 kHz at 50 kHz has 6.8 samples a period, and half a sample is then a
# recurrence error of 0.46. A Kaiser-windowed sinc over 16 samples on either side is flat to 1e-4 up to 0.84 of the
# Nyquist frequency.
FINER = 8
REACH = 16
PIECE = 2**17  # samples of the interpolated record that are in memory at a time
NEAR = 3  # samples about a lag that was doubled, in which it is looked for


class Recurrence(NamedTuple):
    """How well a motion recurs: after `period` (samples), and after many of them."""

    period: float
    error: float
    later_error: float

    @property
    def lasts(self) -> bool:
        """Whether it recurs after many periods, too: a cycle, not a torus that nearly closes."""
        return self.later_error <= RECURRENCE


def find_recurrences(unit: NDArray[np.float64], longest: float) -> tuple[list[Recurrence], float | None]:
    """Return the lags after which signals (time, k) recur, and the smallest error e at any lag searched.

        e(L) = rms |y(t + L) − y(t)| / rms y ≤ 1e-2

    on the record interpolated to 8 times the rate, for lags L from half a period of the strongest spectral peak to
    `longest` (samples), a third of the record at most; the shortest first, and none after the first that lasts. The
    error is None where there is no such lag.
    """
    fine = _Finer(unit)
    shortest, longest = _shortest_lag(unit), min(int(longest * FINER) + 2, fine.size // 3)
    if shortest >= longest:
        return [], None
    squared = _squared_errors(fine, longest + 1)
    minima = shortest + 1 + local_maxima(-squared[shortest + 1 : longest])
    found: list[Recurrence] = []
    for lag in minima:
        offset, lowest = parabola_vertex(*squared[lag - 1 : lag + 2].tolist())
        if lowest > (3.0 * RECURRENCE) ** 2:  # far off already; the exact error takes longer
            continue
        error = _error_at(fine, lag + offset)
        if error <= RECURRENCE:
            found.append(_followed(fine, lag + offset, error))
            if found[-1].lasts:
                break
    smallest = float(np.sqrt(squared[shortest:longest].min()))
    return found, min([smallest, *(item.error for item in found)])


def recurrence_after(unit: NDArray[np.float64], lag: float) -> Recurrence | None:
    """Return how well signals (time, k) recur after a lag (samples) and many times it; None beyond half of them."""
    fine = _Finer(unit)
    if not 1 < round(lag * FINER) < fine.size // 2 - 2:
        return None
    return _followed(fine, lag * FINER, _error_at(fine, lag * FINER))


class _Finer:
    """A record (time, k) at a finer rate, computed piece by piece, without the ends that interpolation cannot reach."""

    def __init__(self, unit: NDArray[np.float64]) -> None:
        # A column for each of the places between two samples, a row for each sample about it, the earliest first.
        distance = np.arange(FINER) / FINER - np.arange(-REACH, REACH + 1)[:, None]
        inside = np.maximum(1 - (distance / REACH) ** 2, 0.0)
        kaiser = 8.0
        self._kernel = np.sinc(distance) * np.where(inside > 0, np.i0(kaiser * np.sqrt(inside)) / np.i0(kaiser), 0.0)
        self._unit, self._trim = unit, min(REACH, unit.shape[0] // 8) * FINER
        self.size = FINER * unit.shape[0] - 2 * self._trim
        self.power = sum(float(np.sum(self.piece(*ends) ** 2)) for ends in self.ends()) / self.size

    def ends(self, left: int = 0) -> Iterator[tuple[int, int]]:
        """First sample, and the one after the last, of pieces of all but so many samples at the end."""
        for first in range(0, self.size - left, PIECE):
            yield first, min(first + PIECE, self.size - left)

    def piece(self, first: int, stop: int) -> NDArray[np.float64]:
        """The samples from the first up to the one before `stop`, (samples, k)."""
        first, stop = first + self._trim, stop + self._trim
        low, high = max(0, first // FINER - REACH - 1), -(-stop // FINER) + REACH + 1
        around = np.pad(self._unit[low:high], ((REACH, REACH), (0, 0)))
        fine = np.moveaxis(sliding_window_view(around, 2 * REACH + 1, axis=0) @ self._kernel, 1, 2)
        return fine.reshape(-1, around.shape[1])[first - low * FINER : stop - low * FINER]


def _shortest_lag(unit: NDArray[np.float64]) -> int:
    """Return half a period of the strongest spectral component, in fine samples: no shorter lag can be a period."""
    spectra = [amplitude_spectrum(column, 1.0, zero_padding=1) for column in unit.T]
    power = np.sum([spectrum.amplitude**2 for spectrum in spectra], axis=0)
    return max(1, int(0.5 * FINER / spectra[0].frequency_Hz[1 + np.argmax(power[1:])]))


def _followed(fine: _Finer, lag: float, error: float) -> Recurrence:
    """Double the lag up to half the record: the last one fixes the period, and its error identifies a cycle."""
    turns, reached = 1, lag
    while round(2.0 * reached) + 3 < fine.size // 2:
        turns, middle = 2 * turns, round(2.0 * reached)
        squared = _squared_errors_near(fine, middle)
        nearest = 1 + int(np.argmin(squared[1:-1]))
        offset, _ = parabola_vertex(*squared[nearest - 1 : nearest + 2].tolist())
        reached = middle - NEAR + nearest + float(np.clip(offset, -1.0, 1.0))
    return Recurrence(reached / turns / FINER, error, _error_at(fine, reached))


def _squared_errors(fine: _Finer, most: int) -> NDArray[np.float64]:
    """Return e² for whole lags below `most`: e²(L) (n − L) = Σ y(t)² + Σ y(t+L)² − 2 Σ y(t) y(t+L)."""
    correlation = np.zeros(most)
    together = max(PIECE, most)
    for first in range(0, fine.size, together):
        late = fine.piece(first, min(first + together + most, fine.size))
        length = scipy.fft.next_fast_len(together + most, real=True)
        for column in late.T:
            product = np.fft.rfft(column[:together], length).conj() * np.fft.rfft(column, length)
            correlation += np.fft.irfft(product, length)[:most]
    lags = np.arange(most)
    begin = np.concatenate([[0.0], np.cumsum(np.sum(fine.piece(0, most - 1) ** 2, axis=1))])
    end = np.concatenate([[0.0], np.cumsum(np.sum(fine.piece(fine.size - most + 1, fine.size)[::-1] ** 2, axis=1))])
    pairs = 2.0 * fine.power * fine.size - begin - end - 2.0 * correlation
    return np.maximum(pairs, 0.0) / (fine.size - lags) / fine.power


def _squared_errors_near(fine: _Finer, middle: int) -> NDArray[np.float64]:
    """Return e² for the whole lags up to three away from one."""
    lags = range(middle - NEAR, middle + NEAR + 1)
    sums = np.zeros(len(lags))
    for first, stop in fine.ends(left=lags[0]):
        early, late = fine.piece(first, stop), fine.piece(first + lags[0], min(stop + lags[-1], fine.size))
        for k in range(len(lags)):
            later = late[k : k + len(early)]
            sums[k] += np.sum((later - early[: len(later)]) ** 2)
    return sums / (fine.size - np.array(lags)) / fine.power


def _error_at(fine: _Finer, lag: float) -> float:
    """Return e at a lag between samples, by the cubic through the four samples about it."""
    whole = int(lag)
    p = lag - whole
    weights = (
        -p * (p - 1.0) * (p - 2.0) / 6.0,
        (p + 1.0) * (p - 1.0) * (p - 2.0) / 2.0,
        -(p + 1.0) * p * (p - 2.0) / 2.0,
        (p + 1.0) * p * (p - 1.0) / 6.0,
    )
    total = 0.0
    for first, stop in fine.ends(left=whole + 2):
        late, pairs = fine.piece(first + whole - 1, stop + whole + 2), stop - first
        later = sum(weight * late[j : j + pairs] for j, weight in enumerate(weights))
        total += float(np.sum((later - fine.piece(first, stop)) ** 2))
    return float(np.sqrt(total / (fine.size - whole - 2) / fine.power))
