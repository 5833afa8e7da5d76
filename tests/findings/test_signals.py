"""Signals against exact synthetic records: known amplitudes, frequencies, growth and regimes."""

import tracemalloc

import numpy as np
import pytest
import scipy.signal
from hypothesis import given, settings
from hypothesis import strategies as st

from drumsqueal.findings.signals.growth import fit_growth, modal_amplitudes, modal_frequency
from drumsqueal.findings.signals.lines import find_lines
from drumsqueal.findings.signals.recurrence import find_recurrences
from drumsqueal.findings.signals.regime import Cause, classify, describe_cause, rest_words
from drumsqueal.findings.signals.spectra import (
    Spectrogram,
    amplitude_spectrum,
    hann,
    local_maxima,
    peak_near,
    spectral_peaks,
    spectrogram,
)

RATE = 50_000.0
FREQUENCIES = (1424.0, 4392.0, 7399.0)
RATES_OF_GROWTH = (76.0, 34.0, 62.0)
GOLDEN = 0.5 * (1.0 + 5.0**0.5)


def whole_spectrogram(*arguments, **named) -> Spectrogram:
    times, frequencies, amplitudes = zip(*spectrogram(*arguments, **named), strict=True)
    return Spectrogram(np.concatenate(times), frequencies[0], np.concatenate(amplitudes, axis=1))


def times(duration: float) -> np.ndarray:
    return np.arange(round(duration * RATE)) / RATE


def three_growing(t: np.ndarray, amplitudes=(1.0, 1.0, 1.0), phases=(0.0, 1.0, 2.0)) -> np.ndarray:
    modes = zip(FREQUENCIES, RATES_OF_GROWTH, amplitudes, phases, strict=True)
    return np.sum([a * np.exp(s * t) * np.cos(2 * np.pi * f * t + p) for f, s, a, p in modes], axis=0)


def regime_of(signals: np.ndarray, lowest: float = 1424.0, scale=None):
    columns = signals if signals.ndim == 2 else signals[:, None]
    sizes = np.ones(columns.shape[1]) if scale is None else scale
    return classify(columns, RATE, scale=sizes, lowest_frequency=lowest)


# --- spectra --------------------------------------------------------------------------------------------------------


# From 12 periods in the record, so that the mirror image, at least 24 bins off, adds at most 1/(π 24³) = 2.3e-5 of the
# amplitude; the same slope at the peak moves it by less than 1e-3 bins. The parabola errs by 2e-5 and 1e-3 bins.
@given(
    cycles=st.floats(12.0, 480.0),
    phase=st.floats(0.0, 2 * np.pi),
    exponent=st.floats(-12.0, 6.0),
    offset=st.floats(-100.0, 100.0),
)
@settings(derandomize=True, max_examples=200)
def test_amplitude_and_frequency_of_a_sinusoid_are_recovered(cycles, phase, exponent, offset):
    t, amplitude = times(0.02), 10.0**exponent
    frequency = cycles / 0.02
    signal = amplitude * (np.sin(2 * np.pi * frequency * t + phase) + offset)
    peaks = spectral_peaks(amplitude_spectrum(signal, RATE), count=5, floor=1e-2)
    assert peaks.frequency_Hz.shape == (1,)
    assert peaks.frequency_Hz[0] == pytest.approx(frequency, abs=2e-3 / 0.02)
    assert peaks.amplitude[0] == pytest.approx(amplitude, rel=1e-4)


def test_the_spectrum_says_what_it_resolves_and_has_no_mean():
    t = times(0.02)
    spectrum = amplitude_spectrum(3.0 + np.sin(2 * np.pi * 2000.0 * t), RATE, zero_padding=4)
    assert spectrum.resolution_Hz == pytest.approx(1.5 / 0.02)  # not the grid step of 1/(4 × 0.02)
    assert spectrum.frequency_Hz[1] == pytest.approx(1.0 / (4 * 0.02))
    assert spectrum.frequency_Hz[-1] == RATE / 2
    assert spectrum.amplitude[0] < 1e-14  # round-off of a mean of 3
    # A whole number of periods on a bin: exact but for the images, which the Hann window puts to zero there.
    assert spectrum.amplitude[160] == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("count", [*range(2, 200), 20_001])
def test_the_window_is_that_of_scipy_to_the_last_bit(count):
    np.testing.assert_array_equal(hann(count), scipy.signal.get_window("hann", count))


@given(st.lists(st.sampled_from([0.0, 1.0, 2.0, np.nan, np.inf]), max_size=30))
def test_local_maxima_are_those_of_scipy(values):
    values = np.array(values)
    np.testing.assert_array_equal(local_maxima(values), scipy.signal.find_peaks(values)[0])


def test_the_nyquist_component_is_not_doubled():
    alternating = np.cos(np.pi * np.arange(64))
    assert amplitude_spectrum(alternating, 1.0, zero_padding=1).amplitude[-1] == pytest.approx(1.0, rel=1e-12)


def test_peaks_are_sorted_and_hold_no_side_lobes():
    t = times(0.03)
    parts = ((1500.0, 0.02), (4000.3, 1.0), (9000.7, 0.003))
    signal = np.sum([a * np.sin(2 * np.pi * f * t + f) for f, a in parts], axis=0)
    spectrum = amplitude_spectrum(signal, RATE)
    lobes = scipy.signal.find_peaks(spectrum.amplitude)[0]
    assert np.sum(spectrum.amplitude[lobes] > 1e-4) > 20  # there are lobes to be fooled by
    peaks = spectral_peaks(spectrum, count=10, floor=1e-4)
    # Side lobes of the strongest, 75 bins off: below 1e-6, or 5e-5 of the weakest.
    np.testing.assert_allclose(peaks.frequency_Hz, [4000.3, 1500.0, 9000.7], atol=0.1)
    np.testing.assert_allclose(peaks.amplitude, [1.0, 0.02, 0.003], rtol=1e-3)
    assert spectral_peaks(spectrum, count=2, floor=1e-4).amplitude.shape == (2,)
    assert spectral_peaks(spectrum, count=10, floor=0.01).amplitude.shape == (2,)


@pytest.mark.thorough(but=["240.0"])
@pytest.mark.parametrize("rate", [-240.0, 0.0, 240.0])
def test_a_fast_growing_sinusoid_is_one_peak(rate):
    t = times(0.02)  # e^4.8 over the record; the margin is made for e^5, the hardest place is next to the mirror image
    for cycles in np.arange(2.5, 30.0, 0.25):
        for phase in (0.0, 1.0, 2.0):
            spectrum = amplitude_spectrum(np.exp(rate * t) * np.sin(2 * np.pi * cycles / 0.02 * t + phase), RATE)
            assert spectral_peaks(spectrum, count=10, floor=1e-6).amplitude.shape == (1,)


@pytest.mark.parametrize("duration", [0.025, 0.04])
@pytest.mark.parametrize("amplitudes", [(1.0, 1.0, 1.0), (0.03, 1.0, 0.1), (1.0, 0.03, 0.03)])
def test_growth_moves_no_peak(duration, amplitudes):
    spectrum = amplitude_spectrum(three_growing(times(duration), amplitudes), RATE)
    for frequency in FREQUENCIES:
        peak = peak_near(spectrum, 1.01 * frequency, half_width=0.03 * frequency)
        assert peak is not None
        # The aim is 1e-3. The effective window is positive, so only the other modes, at least 71 bins off, can move
        # the peak: their lobes of 1e-6 relative to them, 33 times that here.
        assert peak.frequency_Hz == pytest.approx(frequency, rel=1e-5)
    listed = spectral_peaks(spectrum, count=10, floor=1e-3)
    np.testing.assert_allclose(np.sort(listed.frequency_Hz), FREQUENCIES, rtol=1e-5)


def test_a_lone_growing_sinusoid_peaks_at_its_frequency_however_fast_it_grows():
    t = times(0.04)
    for rate in (-300.0, 0.0, 300.0):
        spectrum = amplitude_spectrum(np.exp(rate * t) * np.cos(2 * np.pi * 4392.0 * t), RATE)
        peak = peak_near(spectrum, 4392.0, half_width=200.0)
        assert peak is not None
        # Only the mirror image, 350 bins off, can move it: even growth by e^12 leaves lobes of about 1e-6 there.
        assert peak.frequency_Hz == pytest.approx(4392.0, rel=1e-6)


def test_peak_near_tells_a_flank_from_a_peak():
    spectrum = amplitude_spectrum(np.sin(2 * np.pi * 4000.0 * times(0.02)), RATE)
    assert peak_near(spectrum, 4040.0, half_width=20.0) is None  # the main lobe reaches 4100 Hz: it only falls here
    peak = peak_near(spectrum, 4040.0, half_width=60.0)
    assert peak is not None
    assert peak.frequency_Hz == pytest.approx(4000.0, abs=0.1)


@pytest.mark.parametrize("level", [0.0, np.pi, -1e9 / 7.0])
def test_a_constant_has_no_peaks(level):
    spectrum = amplitude_spectrum(np.full(997, level), RATE)  # of a size and length that leave round-off in the mean
    assert np.all(spectrum.amplitude == 0.0)
    assert spectral_peaks(spectrum, count=3, floor=0.1).frequency_Hz.size == 0
    assert peak_near(spectrum, 1000.0, half_width=500.0) is None


def test_the_spectrogram_shows_when_and_how_large():
    t = times(0.2)
    amplitude = np.where(t < 0.1, 1.0, 0.25)
    picture = whole_spectrogram(5.0 + amplitude * np.sin(2 * np.pi * 1424.0 * t), RATE, lowest_frequency=1424.0)
    assert picture.amplitude.shape == (picture.frequency_Hz.size, picture.time_s.size)
    strongest = picture.frequency_Hz[picture.amplitude.argmax(axis=0)]
    np.testing.assert_allclose(strongest, 1424.0, atol=2 * picture.frequency_Hz[1])
    window = 16 / 1424.0
    assert picture.time_s[0] >= 0.5 * window * 0.99
    assert picture.time_s[-1] <= 0.2 - 0.5 * window * 0.99
    level = picture.amplitude.max(axis=0)
    # Four-fold padding leaves the bins up to 1/8 of 1/T from the peak: 1 % low.
    np.testing.assert_allclose(level[picture.time_s < 0.1 - window / 2], 1.0, rtol=0.015)
    np.testing.assert_allclose(level[picture.time_s > 0.1 + window / 2], 0.25, rtol=0.015)


def test_a_record_of_one_window_gives_a_spectrogram():
    signal = np.sin(2 * np.pi * 1424.0 * times(0.02))[: int(np.ceil(16 * RATE / 1424.0))]
    picture = whole_spectrogram(signal, RATE, lowest_frequency=1424.0)
    assert picture.amplitude.shape[1] == picture.time_s.size >= 1


# --- growth ---------------------------------------------------------------------------------------------------------


def test_an_exact_exponential_is_fitted_exactly():
    t = 0.3 + times(0.02)
    growth = fit_growth(t, 2e-9 * np.exp(-76.0 * (t - 0.3)))
    assert growth.rate_1_per_s == pytest.approx(-76.0, rel=1e-11)
    assert growth.amplitude_at_start == pytest.approx(2e-9, rel=1e-11)
    assert growth.standard_error < 1e-9


@pytest.mark.parametrize(("samples", "correlation"), [(400, 0.0), (400, 0.5), (400, 0.9), (40, 0.5)])
def test_the_standard_error_is_that_of_repeated_experiments(samples, correlation):
    random, t = np.random.default_rng(7), 1e-4 * np.arange(samples)
    scores = []
    for _ in range(2000):
        noise = np.asarray(scipy.signal.lfilter([1.0], [1.0, -correlation], random.normal(size=samples + 200)))[200:]
        growth = fit_growth(t, np.exp(50.0 * t + 0.01 * noise))
        scores.append((growth.rate_1_per_s - 50.0) / growth.standard_error)
    # 68.3 % of the scores should lie within 1; 2000 experiments fix that bound to 2.2 %. Ignoring the correlation would
    # give 1.7 and 4.4, ignoring its bias 1.17 for the 40 samples. (Not the standard deviation: the tails are wide.)
    assert np.quantile(np.abs(scores), 0.683) == pytest.approx(1.0, abs=0.1)


def test_modal_amplitudes_part_the_modes_of_a_damped_system():
    t, random = times(0.02), np.random.default_rng(3)
    matrix = random.normal(size=(4, 4)) * 300.0 + np.kron(np.diag([1.0, 3.0]), [[0.0, 9000.0], [-9000.0, 0.0]])
    values, right = np.linalg.eig(matrix)
    left = np.linalg.inv(right).conj().T  # ψᴴφ = 1
    start = random.normal(size=4)
    states = np.real((np.exp(np.outer(t, values)) * (left.conj().T @ start)) @ right.T)
    amplitudes = modal_amplitudes(left, states)
    assert amplitudes.shape == (t.size, 4)
    expected = np.exp(np.outer(t, values)) * (left.conj().T @ start)
    # Round-off, which the condition of the eigenvectors and e^(λt) multiply by at most a few thousand.
    np.testing.assert_allclose(amplitudes, expected, atol=1e-10 * np.abs(expected).max())
    for k in range(4):
        assert modal_frequency(t, amplitudes[:, k]) == pytest.approx(values[k].imag / (2 * np.pi), rel=1e-7)
        assert fit_growth(t, np.abs(amplitudes[:, k])).rate_1_per_s == pytest.approx(values[k].real, abs=1e-3)


# --- regimes --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("duration", [0.015, 0.1])
@pytest.mark.parametrize("frequency", [1424.0, 4392.0, 7399.0])
def test_a_sinusoid_is_periodic(duration, frequency):
    found = regime_of(np.cos(2 * np.pi * frequency * times(duration) + 0.4))
    assert found.kind == "periodic"
    # Whole-sample lags would leave 0.46 at 7399 Hz; the interpolation leaves 1e-4.
    assert found.recurrence_error is not None
    assert found.recurrence_error < 1e-3
    assert found.base_frequencies_Hz == pytest.approx((frequency,), rel=1e-6)
    assert found.period_s == pytest.approx(1.0 / frequency, rel=1e-6)


def test_subharmonics_set_the_base_frequency_and_units_do_not_matter():
    t = times(0.05)
    w = 2 * np.pi * 1424.3 * t
    first = np.cos(w) + 0.3 * np.cos(2 * w + 1.0) + 0.1 * np.cos(11 * w)
    second = 1e-6 * (np.cos(5 * w + 2.0) + 0.1 * np.cos(0.5 * w)) + 3.0
    both = np.column_stack([first, second])
    found = regime_of(both, 700.0, scale=[1.0, 1e-6])
    assert found.kind == "periodic"
    assert found.base_frequencies_Hz == pytest.approx((712.15,), rel=1e-6)
    alone = regime_of(first)
    assert alone.base_frequencies_Hz == pytest.approx((1424.3,), rel=1e-6)
    third = regime_of(np.cos(2 * np.pi * 7400.0 * t) + 0.2 * np.cos(2 * np.pi * 7400.0 / 3.0 * t + 1.0), 2000.0)
    assert third.base_frequencies_Hz == pytest.approx((7400.0 / 3.0,), rel=1e-6)


def test_a_signal_at_rest_does_not_hide_the_cycle_of_the_others():
    t = times(0.05)
    resting = 1e-18 * np.random.default_rng(1).normal(size=t.size)
    found = regime_of(np.column_stack([np.cos(2 * np.pi * 1424.0 * t), resting]), scale=[1.0, 1e-6])
    assert found.kind == "periodic"


@pytest.mark.parametrize("duration", [0.03, 0.1, 0.5])
@pytest.mark.parametrize(
    "parts", [((1424.0, 1.0), (1424.0 * GOLDEN, 1.0)), ((1424.0, 1.0), (4392.37, 0.7), (7399.1, 0.5))]
)
def test_a_torus_is_quasi_periodic(duration, parts):
    found = regime_of(np.sum([a * np.cos(2 * np.pi * f * times(duration)) for f, a in parts], axis=0))
    assert found.kind == "quasi-periodic"
    assert found.base_frequencies_Hz == pytest.approx([f for f, _ in parts], rel=1e-6)
    # Shares of lines are their own squares: what they have in common under the window is 3e-5 at the most here.
    assert found.explained_fraction == pytest.approx(1.0, abs=1e-4)
    assert found.resolution_Hz == pytest.approx(2.0 / duration)
    assert found.recurrence_error is not None
    assert found.recurrence_error > 0.05


@pytest.mark.parametrize("size", [0.5, 0.05])  # 11 % and 0.1 % of the variance
def test_a_cycle_beside_which_a_line_decays_is_no_torus(size):
    # From one half of 0.25 s to the other it falls by 1 − e^(−0.5) = 39 %, but the rms of both by 5 % at most.
    t = times(0.5)
    found = regime_of(np.cos(2 * np.pi * 1424.0 * t) + size * np.exp(-2 * t) * np.cos(2 * np.pi * 4392.37 * t))
    assert found.kind == "undecided"
    assert found.cause == Cause.LINE_DRIFTS
    assert "its line at 4392 Hz falls by 39 % from the first half" in found.reason
    assert not found.base_frequencies_Hz


@pytest.mark.parametrize(("gap", "hidden"), [(3.0, 1.2), (3.5, -0.8)])
def test_of_lines_that_half_the_record_does_not_resolve_none_is_told_to_fall(gap, hidden):
    # A stationary motion: two lines, some bins apart, and a faint one a bin from one of these.
    t, parts = times(0.25), [(1000.0, 1.0), (1618.034, 0.4), (1618.034 + gap / 0.25, 0.3)]
    parts.append((parts[-1][0] + hidden / 0.25, 0.05))
    found = regime_of(np.sum([a * np.cos(2 * np.pi * f * t + k) for k, (f, a) in enumerate(parts)], axis=0))
    assert (found.kind, found.cause) == ("undecided", Cause.LINES_TOO_CLOSE)
    assert found.record_needed_s == pytest.approx(4 / (gap / 0.25), rel=0.05)  # two bins of half of it are the gap
    assert "falls" not in found.reason
    assert not found.base_frequencies_Hz
    # A line apart that does decay is told to, whatever those do.
    fading = 0.3 * np.exp(-2 * t) * np.cos(2 * np.pi * 2000.0 * t)
    found = regime_of(fading + np.sum([a * np.cos(2 * np.pi * f * t + k) for k, (f, a) in enumerate(parts)], axis=0))
    assert found.cause == Cause.LINE_DRIFTS
    assert found.numbers["line_Hz"] == pytest.approx(2000.0, abs=1.0)


def test_a_torus_that_nearly_closes_is_not_taken_for_a_cycle():
    t = times(0.5)  # 4392.37/1424 is close to 37/12, and after 12 periods the motion is back to within 0.5 %
    found = regime_of(np.cos(2 * np.pi * 1424.0 * t) + 0.05 * np.cos(2 * np.pi * 4392.37 * t))
    assert found.kind == "quasi-periodic"
    assert found.recurrence_error is not None
    assert found.recurrence_error < 1e-2
    assert "after one period, but larger after many" in found.reason


def test_a_cycle_longer_than_was_looked_for_is_told_by_its_lines():
    def cycle(t: np.ndarray) -> np.ndarray:  # repeats after 30 periods of the lowest frequency, and 20 are looked for
        return np.cos(2 * np.pi * 1424.0 * t) + 0.5 * np.cos(2 * np.pi * 1424.0 * 101 / 30 * t)

    found = regime_of(cycle(times(0.3)))
    assert found.kind == "undecided"
    assert "record at least 0.4213 s" in found.reason
    assert found.record_needed_s == pytest.approx(20 * 30 / 1424.0)
    found = regime_of(cycle(times(0.5)))
    assert found.kind == "periodic"
    assert found.period_s == pytest.approx(30 / 1424.0, rel=1e-6)
    assert found.recurrence_error == pytest.approx(0, abs=1e-3)  # not that of the lags that were searched, 0.05
    # A line below a hundredth of the strongest is not looked for, but does not repeat: 2 sin(πfT) 0.009/√1.25.
    weak = 1111.0
    found = regime_of(cycle(times(0.5)) + 0.009 * np.cos(2 * np.pi * weak * times(0.5)))
    assert found.kind == "undecided"
    largest = max(abs(2 * np.sin(np.pi * weak * turns * 30 / 1424.0)) for turns in (1, 2, 4, 8)) * 0.009 / np.sqrt(1.25)
    assert found.recurrence_error == pytest.approx(largest, rel=0.05)


def test_faint_sidebands_that_know_their_distance_badly_do_not_hide_a_cycle():
    # Strong lines at 85, 340 and 576 times 12.6566663 Hz, and sidebands of a few per cent not quite as far from them.
    def moved(apart: float) -> np.ndarray:
        t, slow = times(1.6), 12.6566663
        strong = ((85, 1.0, 0.02), (340, 0.3, 0.05), (576, 0.8, 0.0))
        beats = 2 * np.cos(2 * np.pi * apart * t)
        lines = [size * np.cos(2 * np.pi * k * slow * t + k) * (1 + side * beats) for k, size, side in strong]
        return np.sum(lines, axis=0)

    found = regime_of(moved(12.654))
    assert found.kind == "periodic"
    assert found.period_s == pytest.approx(1 / 12.6566663, rel=1e-7)
    assert found.recurrence_error == pytest.approx(0, abs=1e-3)
    assert regime_of(moved(9.7)).kind == "quasi-periodic"  # far from it, they are a frequency of their own


@pytest.mark.thorough
def test_noise_is_irregular():
    noise = np.random.default_rng(5).normal(size=5000)
    band = scipy.signal.sosfilt(scipy.signal.butter(2, [0.05, 0.3], btype="band", output="sos"), noise)
    for signal in (noise, band):
        found = regime_of(np.asarray(signal))
        assert found.kind == "irregular"
        assert found.base_frequencies_Hz == ()


@pytest.mark.parametrize("rate", [-76.0, -5.0, -1.0, 1.0, 5.0, 76.0])
def test_growth_and_decay_are_still_drifting(rate):
    t = times(0.1)
    found = regime_of(np.exp(rate * t) * np.cos(2 * np.pi * 1424.0 * t))
    assert found.kind == "undecided"
    assert "drifts" in found.reason
    assert found.amplitude_drift is not None
    # The halves are 0.05 s apart: e^(0.05 rate); the mean taken off first is of 1e-3 of the rms.
    assert found.amplitude_drift == pytest.approx(np.expm1(0.05 * rate), rel=0.1)


@pytest.mark.parametrize("slope", [5.0, -5.0])
def test_a_moving_mean_is_still_drifting(slope):
    t = times(0.1)
    found = regime_of(np.cos(2 * np.pi * 1424.0 * t) + slope * t)
    assert found.kind == "undecided"
    assert "mean" in found.reason


@pytest.mark.parametrize(
    ("cause", "numbers", "said"),
    [
        (
            Cause.RESIDUAL_MOTION,
            {"boundary_fraction": 2.34e-5, "mode_growth_rate_1_per_s": -12.345},
            "Nothing moves: the residual motion is 2.3e-05 of what reaches a contact boundary, and every mode decays, "
            "Y slowest at −12.35 1/s.",
        ),
        (
            Cause.DECAYS,
            {"rate_1_per_s": -30.0, "mode_growth_rate_1_per_s": -40.0},
            "The motion decays to rest: below the contact boundaries the rms velocity changes by −30 1/s, and every "
            "mode decays, Y slowest at −40 1/s.",
        ),
        (Cause.BRAKE_CHANGES, {}, "Drum speed or load change, and the motion with them."),
        (
            Cause.RECORD_TOO_SHORT,
            {"duration_s": 0.0125, "lowest_frequency_Hz": 400.0, "periods_needed": 16.0, "record_needed_s": 0.04},
            "The record is too short: 0.0125 s hold 5.0 periods of the lowest frequency of 400 Hz, and 16 are needed; "
            "record at least 0.04 s.",
        ),
        (
            Cause.TOO_FEW_PERIODS,
            {"duration_s": 0.0125, "period_s": 2.5e-3, "periods_needed": 16.0, "record_needed_s": 0.04},
            "The record is too short: the motion seems to repeat every 0.0025 s, but only 5.0 such periods are "
            "recorded, and 16 are needed; record at least 0.04 s.",
        ),
        (
            Cause.NOTHING_MOVES,
            {"amplitude": 3.21e-7, "least": 1e-6, "grows": 1.0},
            "Nothing moves: the largest amplitude is 3.2e-07 of its scale, and 1e-06 would be motion. The residual "
            "motion still grows, so a longer record may show motion.",
        ),
        (
            Cause.DRIFTS,
            {"amplitude_drift": 0.123, "mean_drift": 0.05},
            "The motion still drifts: the rms grows by 12.3 % from the first half of the record to the second; record "
            "for longer.",
        ),
        (
            Cause.DRIFTS,
            {"amplitude_drift": -0.04, "mean_drift": 0.05},
            "The motion still drifts: the mean moves by 5.0 % of the rms from the first half of the record to the "
            "second; record for longer.",
        ),
        (
            Cause.DRIFTS,
            {"amplitude_drift": -0.06, "mean_drift": 0.05},
            "The motion still drifts: the rms falls by 6.0 % from the first half of the record to the second; record "
            "for longer.",
        ),
        (
            Cause.LINE_DRIFTS,
            {"line_Hz": 3325.4, "line_change": 0.123},
            "The motion still drifts: its line at 3325 Hz grows by 12 % from the first half of the record to the "
            "second; record for longer.",
        ),
        (
            Cause.LINES_TOO_CLOSE,
            {
                "line_Hz": 4281.4, "next_Hz": 4270.1, "line_change": -0.45, "resolution_Hz": 8.26, "duration_s": 0.242,
                "record_needed_s": 0.354,
            },
            "The record is too short: half of its 0.24 s resolves lines 17 Hz apart, and its lines at 4281.4 and "
            "4270.1 Hz are 11 Hz apart, so that it does not show whether they last; record at least 0.354 s.",
        ),
        (
            Cause.REPEATS,
            {"period_s": 1.25e-3, "recurrence_error": 0.004},
            "The motion repeats every 0.00125 s (800 Hz) with a recurrence error of 0.4 % of rms.",
        ),
        (
            Cause.MULTIPLES_TOO_SHORT,
            {
                "recurrence_error": 0.004, "nearly": 1.0, "explained": 0.9, "record_needed_s": 0.5,
                "periods_needed": 16.0,
            },
            "The motion is stationary but not periodic: its recurrence error is 0.4 % of rms after one period, but "
            "larger after many. Multiples of 800.0 and 1234.57 Hz hold 90.00 % of its variance; record at least 0.5 s, "
            "16 periods of it.",
        ),
        (
            Cause.COMBINATIONS,
            {
                "recurrence_error": 0.3, "nearly": 0.0, "recurrence_limit": 0.01, "explained": 0.987,
                "resolution_Hz": 8.26, "duration_s": 0.242,
            },
            "The motion is stationary but not periodic: its recurrence error is 30 % of rms at best, and up to 1 % "
            "would be periodic. Combinations of the fundamental frequencies 800.0 and 1234.57 Hz hold 98.70 % of its "
            "variance; frequencies below 8.3 Hz cannot be resolved in 0.24 s.",
        ),
        (
            Cause.NEARS,
            {"frequency_Hz": 950.0, "distance": 0.12, "rate_1_per_s": -4.5, "record_needed_s": 0.75},
            "The motion nears a stable periodic motion of 950 Hz, found by shooting from its last state, but is 12 % "
            "of its size away at the end of the record; disturbances of it change by −4.5 1/s; record at least 0.75 s.",
        ),
        (
            Cause.APPROACHES,
            {"frequency_Hz": 950.0, "distance": 0.003, "rate_1_per_s": -45.0, "residual": 2e-11},
            "The motion approaches a stable periodic motion of 950 Hz, found by shooting from its last state "
            "(periodicity residual 2e-11): 0.3 % of its size away at the end of the record, and disturbances of it "
            "change by −45 1/s.",
        ),
        (
            Cause.MULTIPLES_REPEAT,
            {"explained": 0.99876, "period_s": 1.25e-3, "recurrence_error": 0.004},
            "Multiples of 800.0 and 1234.57 Hz hold 99.88 % of its variance: the motion repeats every 0.00125 s with a "
            "recurrence error of 0.4 % of rms.",
        ),
        (
            Cause.MULTIPLES_DO_NOT_REPEAT,
            {"explained": 0.9, "period_s": 1.25e-3, "recurrence_error": 0.05},
            "Multiples of 800.0 and 1234.57 Hz hold 90.00 % of its variance, but the recurrence error after 0.00125 s "
            "is 5 % of rms.",
        ),
        (
            Cause.NO_COMBINATIONS,
            {
                "lines": 12.0, "in_lines": 0.756, "explained": 0.321, "resolution_Hz": 8.26, "duration_s": 0.242,
                "recurrence_error": 0.3, "nearly": 0.0, "recurrence_limit": 0.01,
            },
            "The motion is stationary but not periodic: its recurrence error is 30 % of rms at best, and up to 1 % "
            "would be periodic. It is irregular: its 12 strongest lines hold 75.60 % of its variance, those that are "
            "combinations of three frequencies 32.10 %; lines closer than 8.3 Hz are one in 0.24 s.",
        ),
    ],
)  # fmt: skip
def test_why_a_motion_is_of_its_kind_is_said_with_its_numbers(cause, numbers, said):
    # 800 Hz is known to a tenth, the other to six digits at most.
    assert describe_cause(cause, numbers, "Y", (800.0, 1234.5678), (0.1, 1e-6)) == said


@pytest.mark.parametrize(
    ("place", "said"),
    [
        (
            {"X": 2e-6, "Y": 3.1e-22, "Tx": 1e-18, "Tz": -0.01, "Psi": -1e-19, "E1": 4e-7, "drum.E1": 1e-7},
            "X = 2e-06 m, Tz = -0.01 rad",
        ),
        ({"X": 2e-6, "Y": -3e-12, "Z": 1e-12}, "X = 2e-06 m, Y = -3e-12 m"),  # 1.5 and 0.5 millionths of the largest
        ({"X": 0.0, "E1": -4e-7, "E2": 1e-20}, "E1 = -4e-07 m kg^0.5"),
    ],
)
def test_where_a_motion_rests_is_said_without_round_off_and_elastic_coordinates(place, said):
    assert rest_words(place) == f"at {said} from steady sliding"


def test_too_short_records_say_so():
    t = times(0.02)
    found = regime_of(np.cos(2 * np.pi * 900.0 * t), 900.0)
    assert found.kind == "undecided"
    assert "18.0 periods of the lowest" in found.reason
    assert found.period_s is None
    # Enough of the lowest frequency of interest, but the motion repeats only after 3 of its periods.
    third = regime_of(np.cos(2 * np.pi * 1500.0 * t) + np.cos(2 * np.pi * 500.0 * t), 1400.0)
    assert third.kind == "undecided"
    assert "repeat every 0.002 s" in third.reason
    slow = regime_of(np.cos(2 * np.pi * 50.0 * t), 1400.0)  # a single period in all, so the halves even agree
    assert slow.kind == "undecided"


def test_what_does_not_move_is_steady():
    t = times(0.05)
    assert regime_of(np.zeros((t.size, 2))).kind == "steady"
    assert regime_of(np.full(t.size, 0.1)).kind == "steady"
    small = 0.9e-6 * np.cos(2 * np.pi * 1424.0 * t)
    assert regime_of(small).kind == "steady"
    assert regime_of(2.0 * small).kind == "periodic"
    growing = regime_of(1e-9 * np.exp(50.0 * t) * np.cos(2 * np.pi * 1424.0 * t))
    assert growing.kind == "steady"
    assert "grows" in growing.reason


# --- refusals -------------------------------------------------------------------------------------------------------

GOOD = np.sin(np.arange(2000.0))
BAD = np.where(np.arange(2000) == 7, np.nan, GOOD)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: amplitude_spectrum(BAD, RATE), r"signal holds 1 NaN .* index \(7,\)"),
        (lambda: amplitude_spectrum(GOOD[:15], RATE), "signal is too short: 15"),
        (lambda: amplitude_spectrum(GOOD.reshape(-1, 2), RATE), "signal must be one-dimensional"),
        (lambda: amplitude_spectrum(GOOD, 0.0), "sample_rate must be"),
        (lambda: amplitude_spectrum(GOOD, RATE, zero_padding=0), "zero_padding"),
        (lambda: spectral_peaks(amplitude_spectrum(GOOD, RATE), count=0, floor=0.1), "count"),
        (lambda: spectral_peaks(amplitude_spectrum(GOOD, RATE), count=1, floor=0.0), "floor"),
        (lambda: peak_near(amplitude_spectrum(GOOD, RATE), 100.0, half_width=0.0), "half_width"),
        (lambda: whole_spectrogram(GOOD, RATE, lowest_frequency=100.0), "signal is too short"),
        (lambda: whole_spectrogram(GOOD, RATE, lowest_frequency=1000.0, overlap=1.0), "overlap"),
        (lambda: fit_growth(np.arange(10.0), np.arange(10.0)), "amplitude must be positive"),
        (lambda: fit_growth(np.arange(5.0), np.ones(5)), "amplitude is too short"),
        (lambda: fit_growth(np.zeros(10), np.ones(10)), "time must increase"),
        (lambda: fit_growth(np.arange(9.0), np.ones(10)), "time has 9 entries for 10"),
        (lambda: modal_amplitudes(np.ones((3, 1)), np.ones((5, 4))), "left_eigenvectors must have shape"),
        (lambda: modal_amplitudes(np.full((4, 1), np.nan), np.ones((5, 4))), "left_eigenvectors holds NaN"),
        (lambda: modal_frequency(np.arange(3.0), [1.0, 0.0, 1.0]), "modal_signal is zero at index 1"),
        (lambda: regime_of(BAD), "signals holds 1 NaN"),
        (lambda: regime_of(GOOD[:15]), "signals is too short"),
        (lambda: regime_of(GOOD, scale=[1.0, 2.0]), "scale must have one entry"),
        (lambda: regime_of(GOOD, scale=[0.0]), "scale must be finite and positive"),
        (lambda: classify(GOOD, RATE, scale=[1.0], lowest_frequency=1e3), "signals must be two-dimensional"),
    ],
)
def test_bad_arguments_are_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_the_smallest_recurrence_error_of_what_does_not_recur_is_that_over_the_pairs_it_has():
    # Noise that was low-passed, at lags of up to a third of the record: the mean is over the pairs that are left then.
    random = np.random.default_rng(5)
    spectrum = np.fft.rfft(random.normal(size=1200))
    spectrum[np.arange(spectrum.size) > 60] = 0
    signal = np.fft.irfft(spectrum, 1200)
    found, smallest = find_recurrences((signal / signal.std())[:, None], 400.0)
    assert found == []
    inner = signal[16:-16]  # what interpolation reaches
    lags = np.arange(12, 389)
    errors = [np.sqrt(np.mean((inner[lag:] - inner[:-lag]) ** 2) / np.mean(inner**2)) for lag in lags]
    assert smallest == pytest.approx(min(errors), rel=1e-2)


# Memory.


@pytest.mark.parametrize(
    ("look", "most"),
    [
        # Two signals at eight times the rate have 128 bytes a sample, and their transforms more: it was 528.
        (lambda signals: find_recurrences(signals, 100.0), 90),
        # Two signals, what is left of them and copies take 64, window, power and bins 24, a transform of twice the
        # length 48; waves of all lines took up to 648 more, 112 of two lines.
        (lambda signals: find_lines(signals, RATE), 160),
    ],
    ids=["recurrences", "lines"],
)
def test_long_records_take_little_memory(look, most):
    def most_bytes(samples: int) -> int:
        t = np.arange(samples) / RATE
        signals = np.stack([np.sin(2e3 * np.pi * t), np.cos(2e3 * np.sqrt(2) * np.pi * t)], axis=1)
        tracemalloc.start()
        look(signals)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak

    short, long = 100_000, 300_000
    assert (most_bytes(long) - most_bytes(short)) / (long - short) < most
