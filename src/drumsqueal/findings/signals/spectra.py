"""Amplitude spectra, their peaks and tones above noise, the spectrogram, the frequency of a line over time; and checks.

The Hann window and local maxima are those of scipy.signal, which takes a quarter of a second to load.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray


def finite_record(name: str, values: ArrayLike, *, dimensions: int = 1, minimum: int = 16) -> NDArray[np.float64]:
    """Return `values` as a finite float array with enough samples and dimensions, or raise ValueError."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != dimensions:
        shape = {1: "one-dimensional (time,)", 2: "two-dimensional (time, k)"}[dimensions]
        raise ValueError(f"{name} must be {shape}, got shape {array.shape}")
    if array.shape[0] < minimum:
        raise ValueError(f"{name} is too short: {array.shape[0]} samples, at least {minimum} are needed")
    bad = ~np.isfinite(array)
    if bad.any():
        first = tuple(np.argwhere(bad)[0].tolist())
        raise ValueError(f"{name} holds {int(bad.sum())} NaN or infinite values, the first at index {first}")
    return array


def positive(name: str, value: float) -> float:
    """Return `value` as a float when it is finite and above zero, or raise ValueError."""
    number = float(value)
    if not (math.isfinite(number) and number > 0.0):
        raise ValueError(f"{name} must be finite and positive, got {value}")
    return number


def below_nyquist(name: str, frequency: float, sample_rate: float) -> float:
    """Return `frequency` when it is positive and below half the sample rate, or raise ValueError."""
    number = positive(name, frequency)
    if number >= 0.5 * sample_rate:
        raise ValueError(
            f"{name} is {number:g} Hz, but sampling at {sample_rate:g} Hz only shows what is below half of it"
        )
    return number


def increasing_times(name: str, time: ArrayLike, samples: int, *, minimum: int) -> NDArray[np.float64]:
    """Return `time` as a strictly increasing float array of `samples` entries, or raise ValueError."""
    array = finite_record(name, time, minimum=minimum)
    if array.size != samples:
        raise ValueError(f"{name} has {array.size} entries for {samples} samples")
    if not np.all(np.diff(array) > 0.0):
        raise ValueError(f"{name} must increase from sample to sample")
    return array


def hann(count: int) -> NDArray[np.float64]:
    """The periodic Hann window ½ + ½ cos x, x from −π on in `count` steps to π, to the last bit that of scipy.

    Of two or more.
    """
    return 0.5 + 0.5 * np.cos(np.linspace(-np.pi, np.pi, count + 1))[:-1]


def local_maxima(values: NDArray[np.float64]) -> NDArray[np.intp]:
    """Places of values that are larger than those before and after; of several equal ones the middle one, rounded down.

    As `scipy.signal.find_peaks`.
    """
    if values.size < 3:
        return np.zeros(0, np.intp)
    changes = np.flatnonzero(values[1:] != values[:-1])
    first, last = np.append(0, changes + 1), np.append(changes, values.size - 1)
    level = values[first]
    inner = np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] > level[2:])) + 1
    return (first[inner] + last[inner]) // 2


# Equivalent noise bandwidth of the Hann window in bins 1/T (Harris 1978, table I).
HANN_BANDWIDTH = 1.5
PADDED = 4  # times a window of a spectrogram is transformed
AT_ONCE = 2**19  # numbers of a spectrogram that are computed together


class Spectrum(NamedTuple):
    """One-sided amplitude spectrum; `resolution_Hz` is what the window resolves, not the grid step."""

    frequency_Hz: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    resolution_Hz: float


class Peak(NamedTuple):
    """One spectral peak, interpolated between the bins."""

    frequency_Hz: float
    amplitude: float


class Peaks(NamedTuple):
    """Spectral peaks, strongest first; both arrays have one entry a peak."""

    frequency_Hz: NDArray[np.float64]
    amplitude: NDArray[np.float64]


class Spectrogram(NamedTuple):
    """Amplitude (frequency, time); `time_s` is the middle of each window, counted from the first sample."""

    time_s: NDArray[np.float64]
    frequency_Hz: NDArray[np.float64]
    amplitude: NDArray[np.float64]


class Ridge(NamedTuple):
    """Frequency and amplitude of a line (k,) at times `time_s` (s after the first sample), the middles of windows."""

    time_s: NDArray[np.float64]
    frequency_Hz: NDArray[np.float64]
    amplitude: NDArray[np.float64]


def amplitude_spectrum(signal: ArrayLike, sample_rate: float, *, zero_padding: int = 8) -> Spectrum:
    """Return the one-sided Hann-windowed amplitude spectrum, in which A sin(2πft + phase) gives a peak of height A.

        amplitude(f) = 2 |Σ w_j (x_j − m) exp(−2πi f j/f_s)| / Σ w_j,   w the periodic Hann window

    m is the window-weighted mean Σ w x / Σ w: it removes a constant exactly, and a sinusoid that does not fit the
    record a whole number of times disturbs it far less than it disturbs the plain mean.

    `signal` has shape (time,), in any unit, which is then the unit of the amplitude; `sample_rate` is in Hz;
    `zero_padding` times the record length (a whole number) is transformed, so that the frequency step is
    f_s/(`zero_padding` n). That refines the grid and not the resolution, which is the window's equivalent noise
    bandwidth 1.5/T. Between two bins the peak of a sinusoid is up to 0.3 % lower at the default padding;
    `spectral_peaks` and `peak_near` interpolate that away.

    Raises ValueError for NaN, for fewer than 16 samples and for a padding below 1.

    Source: F. J. Harris, "On the use of windows for harmonic analysis with the discrete Fourier transform",
    Proceedings of the IEEE 66(1), 1978.
    """
    record = finite_record("signal", signal)
    rate = positive("sample_rate", sample_rate)
    if zero_padding != int(zero_padding) or zero_padding < 1:
        raise ValueError(f"zero_padding must be a whole number of at least 1, got {zero_padding}")
    window = hann(record.size)
    length = int(zero_padding) * record.size
    frequency = np.asarray(np.fft.rfftfreq(length, 1.0 / rate), dtype=np.float64)
    amplitude = _amplitudes(_without_mean(record, window), window, length)
    return Spectrum(frequency, amplitude, HANN_BANDWIDTH * rate / record.size)


def spectral_peaks(
    spectrum: Spectrum, *, count: int, floor: float, threshold: NDArray[np.float64] | None = None
) -> Peaks:
    """Return at most `count` peaks of a spectrum from `amplitude_spectrum`, strongest first, without window side lobes.

    A local maximum, interpolated by a parabola through the logarithm of the amplitude, is reported when it
    - reaches `floor` (0 < floor < 1) times the strongest one and, where one is given, exceeds the `threshold` in its
      bin (frequency,),
    - is at least one resolution away from every stronger peak, and
    - stands above the side lobes that the stronger peaks and their mirror images at negative frequency may have there:
      above `LOBE_MARGIN` times the sum of A_k / (π x (x² − 1)), with x the distance to peak k in bins 1/T. This is the
      envelope of the Hann window's transform sin(πx)/(πx (1 − x²)), which falls by 18 dB an octave.

    The price of the last rule is that a real component hidden under a strong neighbour is not reported: at 3 bins
    anything below 9 % of the neighbour, at 10 bins below 0.2 %, at 100 bins below 2e-6. The margin covers components
    that grow or decay by up to e^5 over the record; beyond that their lobes can be listed as peaks. Components in
    the first and the last bin are not local maxima and are not found.

    Raises ValueError for a `count` below 1 or a `floor` outside (0, 1).

    Source: the window, F. J. Harris, Proceedings of the IEEE 66(1), 1978; the interpolation, M. Gasior and J. L.
    Gonzalez, "Improving FFT frequency measurement resolution by parabolic and Gaussian spectrum interpolation", AIP
    Conference Proceedings 732, 2004.
    """
    if count < 1:
        raise ValueError(f"count must be at least 1, got {count}")
    if not 0.0 < floor < 1.0:
        raise ValueError(f"floor must lie between 0 and 1, got {floor}")
    bins = local_maxima(spectrum.amplitude)
    if threshold is not None:
        bins = bins[spectrum.amplitude[bins] > threshold[bins]]
    candidates = sorted((_interpolated(*spectrum[:2], at) for at in bins), key=lambda peak: -peak.amplitude)
    kept: list[Peak] = []
    for peak in candidates:
        if len(kept) == count or peak.amplitude < floor * candidates[0].amplitude:
            break
        # Side lobes up to this many times the ideal Hann envelope are still taken for side lobes. A growing sinusoid
        # has higher ones than a steady one, by about s (s² + 4π²)/(8π²) for s = growth rate × record length (2.8 at
        # s = 4, 4.1 at s = 5), and the mean that is taken off raises them by another 1.6 near zero frequency.
        if peak.amplitude > 6.5 * _side_lobes(kept, peak.frequency_Hz, spectrum.resolution_Hz):
            kept.append(peak)
    return Peaks(np.array([peak.frequency_Hz for peak in kept]), np.array([peak.amplitude for peak in kept]))


def peak_near(spectrum: Spectrum, frequency: float, *, half_width: float) -> Peak | None:
    """Return the strongest local maximum within `frequency` ± `half_width` (Hz), or None where there is none.

    None means that the amplitude has no maximum of its own in the band: it only rises or falls through it, as on
    the flank of a peak outside. The band is searched as it is, without the side-lobe test of `spectral_peaks`:
    where nothing but lobes is in it, a lobe is returned; its small amplitude shows that.

    Exponential growth does not move the peak. The windowed transform of e^(σt) e^(iωt) is ∫ w e^(σt) e^(i(ω−ω')t)
    dt with a positive weight w e^(σt), so its magnitude is largest where the phase factor is 1: exactly at ω' = ω,
    for any σ.

    Raises ValueError when `frequency` or `half_width` is not positive.
    """
    centre, reach = positive("frequency", frequency), positive("half_width", half_width)
    bins = local_maxima(spectrum.amplitude)
    bins = bins[np.abs(spectrum.frequency_Hz[bins] - centre) <= reach]
    if bins.size == 0:
        return None
    return _interpolated(*spectrum[:2], int(bins[np.argmax(spectrum.amplitude[bins])]))


def spectrogram(
    signal: ArrayLike, sample_rate: float, *, lowest_frequency: float, periods: float = 16.0, overlap: float = 0.875
) -> Iterator[Spectrogram]:
    """Yield amplitude over time and frequency, scaled as in `amplitude_spectrum`, piece by piece in time.

    Hann windows of `periods` periods of `lowest_frequency` (Hz), each overlapping the one before by the fraction
    `overlap`; the resolution is 1.5 `lowest_frequency` / `periods` in frequency. Only windows that lie wholly
    inside the record are returned, so that there is no false fading at its ends. `signal` has shape (time,),
    `sample_rate` is in Hz.

    Raises ValueError for NaN, for a record shorter than one window, for a `lowest_frequency` at or above half the
    sample rate and for an `overlap` outside [0, 1).
    """
    record = finite_record("signal", signal)
    rate = positive("sample_rate", sample_rate)
    length = max(
        16, math.ceil(positive("periods", periods) * rate / below_nyquist("lowest_frequency", lowest_frequency, rate))
    )
    if not 0.0 <= overlap < 1.0:
        raise ValueError(f"overlap must lie in [0, 1), got {overlap}")
    if record.size < length:
        raise ValueError(
            f"signal is too short: {record.size} samples, one window of {periods:g} periods of {lowest_frequency:g} Hz "
            f"takes {length}; ask for fewer periods or record for longer"
        )
    window = hann(length)
    frequency = np.asarray(np.fft.rfftfreq(PADDED * length, 1.0 / rate), dtype=np.float64)
    every = max(1, round(length * (1.0 - overlap)))
    pieces = sliding_window_view(record, length)[::every]
    together = max(1, AT_ONCE // (PADDED * length))
    for first in range(0, len(pieces), together):
        found = _amplitudes(_without_mean(pieces[first : first + together], window), window, PADDED * length)
        middle = every * np.arange(first, first + len(found), dtype=np.float64) + 0.5 * length
        yield Spectrogram(middle / rate, frequency, found.T)


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
    for found in spectrogram(signal, sample_rate, lowest_frequency=0.5 * (low + high), periods=periods):
        band = np.flatnonzero((found.frequency_Hz >= low) & (found.frequency_Hz <= high))
        for time, column in zip(found.time_s, found.amplitude.T, strict=True):
            best = int(band[np.argmax(column[band])]) if band.size else 0
            three = column[max(best - 1, 0) : best + 2]
            if three.size == 3 and three[1] >= max(three) > 0.0:
                rows.append((time, *_interpolated(found.frequency_Hz, column, best)))
    return Ridge(*np.array(rows, dtype=np.float64).reshape(-1, 3).T)


def parabola_vertex(left: float, middle: float, right: float) -> tuple[float, float]:
    """Return position (in steps from the middle) and value of the extremum of a parabola through three points."""
    curvature = left - 2.0 * middle + right
    if curvature == 0.0:
        return 0.0, middle
    offset = 0.5 * (left - right) / curvature
    return offset, middle - 0.25 * (left - right) * offset


def _amplitudes(centred: NDArray[np.float64], window: NDArray[np.float64], length: int) -> NDArray[np.float64]:
    """Amplitudes (..., frequency) of records (..., time) without mean, padded with zeros to a length."""
    amplitude = np.abs(np.fft.rfft(window * centred, length)) * (2.0 / window.sum())
    if length % 2 == 0:
        amplitude[..., -1] *= 0.5  # the Nyquist bin, like the zero bin (here empty), has no mirror image to stand for
    return amplitude


def _without_mean(records: NDArray[np.float64], window: NDArray[np.float64]) -> NDArray[np.float64]:
    """Records (..., time) without their weighted means; zero where nothing but round-off is left."""
    centred = records - (records @ window / window.sum())[..., None]
    largest, left = (np.max(np.abs(values), axis=-1, keepdims=True) for values in (records, centred))
    # What is left of a constant record after its mean is taken off, relative to the constant: round-off, not a signal.
    return np.where(left <= 64 * np.finfo(np.float64).eps * largest, 0.0, centred)


def _interpolated(frequency: NDArray[np.float64], amplitude: NDArray[np.float64], at: int) -> Peak:
    three = np.maximum(amplitude[at - 1 : at + 2], np.finfo(np.float64).tiny)
    offset, height = parabola_vertex(*np.log(three).tolist())
    return Peak(float(frequency[at] + offset * (frequency[1] - frequency[0])), math.exp(height))


def _side_lobes(stronger: list[Peak], frequency: float, resolution: float) -> float:
    """Return how high side lobes of the stronger peaks can be here; infinite within one resolution of a peak."""
    level = 0.0
    for peak in stronger:
        for centre in (peak.frequency_Hz, -peak.frequency_Hz):
            bins = abs(frequency - centre) * HANN_BANDWIDTH / resolution
            level += peak.amplitude / (math.pi * bins * (bins**2 - 1.0)) if bins >= HANN_BANDWIDTH else math.inf
    return level


PADDING = 8
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
    # The median of n values with exponential distribution has a standard error of 1/(ln 2 √n) of itself; so many of
    # these are allowed for, since the lowest of all the medians counts, and those at the ends have half the values.
    median_error, median_errors = 1 / np.log(2), 4.0
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
    factor *= 1 + median_errors * median_error / np.sqrt(floor_width * independent)
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
