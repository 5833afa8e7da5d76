"""Tones that stand out of noise, by spectra averaged over segments and their floor, and which are harmonics."""

from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from drumsqueal.findings.signals.spectra import (
    Peaks,
    Spectrum,
    amplitude_spectrum,
    finite_record,
    positive,
    spectral_peaks,
)

PADDING = 8
# The median of n values with exponential distribution has a standard error of 1/(ln 2 √n) of itself; so many of these
# are allowed for, since the lowest of all the medians counts, and those at the ends have half the values.
MEDIAN_ERROR, MEDIAN_ERRORS = 1 / np.log(2), 4.0
MOST, FAINTEST = 20, 1e-2  # tones, and the amplitude of the faintest over the strongest


class Tones(NamedTuple):
    """An averaged spectrum, its noise floor and the threshold at every frequency, and the tones, strongest first.

    `segments` is the number of segments averaged over.
    """

    spectrum: Spectrum
    threshold: NDArray[np.float64]
    segments: int
    peaks: Peaks


class Harmonic(NamedTuple):
    """Which multiple of which line (an index) a line is."""

    order: int
    fundamental: int


def find_tones(signal: ArrayLike, sample_rate: float, *, segment: float, lowest: float = 0.0, order: int = 0) -> Tones:
    """Find at most 20 tones within 40 dB of the strongest, not below `lowest` (Hz), that stand out of a signal's noise.

    `signal` has shape (time,), in any unit. The spectrum is the root of the mean squared amplitude spectrum of Hann
    segments of `segment` (s), which overlap by half or less; one that is not shorter than the record is the record,
    and of up to half as many samples again the middle is taken. Its scale is that of `amplitude_spectrum`: A sin(2πft)
    gives A. The noise floor is the median over 120 resolutions. Of noise the squared amplitude has a χ² distribution
    with two degrees of freedom a segment (INDEPENDENT of one where they overlap), and a tone must reach what noise
    exceeds anywhere in this record with a probability of 1e-3. It is then found as `spectral_peaks` does, without side
    lobes.

    With an `order` spectrum, threshold and tones are those of the signal's rate of change of that order, or of its
    integral where it is negative: what has the frequency f is multiplied by (2πf)^order, and by that of `lowest` below.

    Raises ValueError for NaN, and for fewer than 16 samples in the record or in a segment.

    Source: P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra", IEEE Transactions on
    Audio and Electroacoustics 15(2), 1967.
    """
    record, rate = finite_record("signal", signal), positive("sample_rate", sample_rate)
    length = min(record.size, max(1, round(positive("segment", segment) * rate)))
    # No two segments share more than half of their samples: they would count for more than they are worth.
    segments = 1 + int((record.size - length) / (length / 2))
    spare = record.size - length
    starts = np.linspace(0, spare, segments).round().astype(int) if segments > 1 else [spare // 2]
    power, first = 0.0, None
    for start in starts:
        first = amplitude_spectrum(record[start : start + length], rate, zero_padding=PADDING)
        power = power + first.amplitude**2
    assert first is not None
    spectrum = first._replace(amplitude=np.sqrt(power / segments))
    threshold = _noise_threshold(spectrum, segments)
    peaks = _tones(spectrum, threshold, lowest, order)
    # Without a bound an integral would be infinite at zero.
    factor = (2 * np.pi * np.maximum(spectrum.frequency_Hz, max(lowest, spectrum.frequency_Hz[1]))) ** order
    return Tones(spectrum._replace(amplitude=spectrum.amplitude * factor), threshold * factor, segments, peaks)


def find_harmonics(
    frequency_Hz: NDArray[np.float64], amplitude: NDArray[np.float64], resolution_Hz: float
) -> list[Harmonic | None]:
    """The fundamental of every line of frequency f whose n-fold it is, |f − n f₁| ≤ Δf/2 with n ≥ 2; None for others.

    A fundamental is no harmonic itself, at least 20 resolutions Δf high and not 20 dB fainter than the harmonic; of
    several it is the strongest.
    """
    found: list[Harmonic | None] = [None] * frequency_Hz.size
    fundamentals: list[int] = []
    for k in np.argsort(frequency_Hz, kind="stable").tolist():
        f = frequency_Hz[k]
        near = []
        for j in fundamentals:
            order = round(float(f / frequency_Hz[j]))
            # A fundamental has a tenth of a harmonic's amplitude at least: hum of 50 Hz has multiples everywhere.
            if order > 1 and amplitude[j] >= 0.1 * amplitude[k]:
                # A harmonic may lie half a resolution off the multiple; lines that stand out of the noise are known
                # better.
                near += [Harmonic(order, j)] if abs(f - order * frequency_Hz[j]) <= 0.5 * resolution_Hz else []
        if near:
            found[k] = max(near, key=lambda each: amplitude[each.fundamental])
        elif f >= 20.0 * resolution_Hz:  # of a slower one 5 % of all frequencies, 2 × 0.5/20, would be harmonics
            fundamentals.append(k)
    return found


def _noise_threshold(spectrum: Spectrum, segments: int) -> NDArray[np.float64]:
    """The amplitude that noise of the floor found here exceeds anywhere with the probability FALSE_ALARM."""
    step = spectrum.frequency_Hz[1] - spectrum.frequency_Hz[0]
    # A median of every few bins: those between are interpolated by the padding.
    coarse = spectrum.amplitude[::PADDING] ** 2
    floor_width = 120.0  # resolutions about a frequency, over which the floor is the median
    width = max(3, round(floor_width * spectrum.resolution_Hz / (step * PADDING)))
    floor = scipy.ndimage.median_filter(coarse, size=min(width, coarse.size), mode="reflect")
    # Of Hann segments that overlap by half each is worth 1/(1 + 2 ρ²) of an independent one, with ρ = 1/6 the
    # correlation of the windows (Welch 1967).
    independent = segments * (1 / (1 + 2 / 36)) if segments > 1 else 1.0
    # Of χ² the value that is exceeded so rarely, over its median; scipy.stats takes half a second to load.
    # The probability that noise alone shows one tone or more is 1e-3; a bin stands for four chances, since noise may be
    # highest between two.
    rare = scipy.special.chdtri(2 * independent, 1e-3 / (4.0 * coarse.size))
    factor = rare / (2 * scipy.special.gammaincinv(independent, 0.5))
    factor *= 1 + MEDIAN_ERRORS * MEDIAN_ERROR / np.sqrt(floor_width * independent)
    power = factor * np.interp(spectrum.frequency_Hz, spectrum.frequency_Hz[::PADDING], floor)
    return np.sqrt(power)


def _tones(spectrum: Spectrum, threshold: NDArray[np.float64], lowest: float, order: int) -> Peaks:
    """Peaks above the threshold, as many as are reported, of the rate of change of that order."""
    # What is slower than `lowest` is found first, and with it its side lobes, which may lie above.
    found = spectral_peaks(spectrum, count=4 * MOST, floor=FAINTEST**2, threshold=threshold)
    fast = found.frequency_Hz >= lowest
    frequency = found.frequency_Hz[fast]
    amplitude = found.amplitude[fast] * (2 * np.pi * frequency) ** order
    strongest = np.argsort(-amplitude, kind="stable")[:MOST]
    kept = strongest[amplitude[strongest] >= FAINTEST * amplitude.max(initial=0.0)]
    return Peaks(frequency[kept], amplitude[kept])
