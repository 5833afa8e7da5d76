"""Parts of the signal analysis, against what can be told by hand."""

import math

import numpy as np
import pytest

from drumsqueal.findings.signals import lines as lines_module
from drumsqueal.findings.signals import spectra
from drumsqueal.findings.signals.growth import (
    find_exponentials,
    fit_growth,
    is_crowded,
    modal_amplitudes,
    modal_frequency,
)
from drumsqueal.findings.signals.lines import (
    Fundamentals,
    Lines,
    _kernel,
    _Lattice,
    _vectors,
    change_of_lines,
    find_fundamentals,
    find_lines,
    multiples_of,
)
from drumsqueal.findings.signals.regime import written_frequencies
from drumsqueal.findings.signals.spectra import Spectrum, amplitude_spectrum, peak_near, spectral_peaks


def lines(frequencies, uncertainty=1e-4, fractions=None) -> Lines:
    """Lines of those frequencies (Hz), strongest first, each with half of what the one before holds."""
    f = np.asarray(frequencies, dtype=np.float64)
    held = 0.5 ** np.arange(1, f.size + 1) if fractions is None else np.asarray(fractions)
    spread = np.broadcast_to(np.asarray(uncertainty, dtype=np.float64), f.shape).copy()
    return Lines(f, spread, np.ones((f.size, 1), dtype=np.complex128), held, 1 - held.sum(), 1.0)  # pyright: ignore[reportArgumentType]


class TestFundamentals:
    def test_one_frequency_and_its_multiples(self):
        found = find_fundamentals(lines([200.0, 100.0, 300.0, 700.0]))
        assert found.frequency_Hz == pytest.approx([100.0])
        assert found.combinations.ravel().tolist() == [2, 1, 3, 7]
        assert found.explained == pytest.approx(1 - 0.5**4)
        # Weighted least squares: 1/√(Σ k²/u²).
        assert found.uncertainty_Hz == pytest.approx([1e-4 / math.sqrt(4 + 1 + 9 + 49)])

    def test_two_frequencies_and_their_sums_and_differences(self):
        a, b = 100.0, 100.0 * math.sqrt(2) * 2
        found = find_fundamentals(lines([b, a, b + 2 * a, 3 * b - a]))
        assert found.frequency_Hz == pytest.approx([a, b])
        assert found.combinations.tolist() == [[0, 1], [1, 0], [2, 1], [-1, 3]]

    def test_what_lies_near_a_stronger_line_is_its_modulation(self):
        found = find_fundamentals(lines([1000.0, 1000 + 7 * math.pi, 1000 - 7 * math.pi, 1000 + 14 * math.pi]))
        assert found.frequency_Hz == pytest.approx([7 * math.pi, 1000])
        assert found.combinations.tolist() == [[0, 1], [1, 1], [-1, 1], [2, 1]]

    def test_frequencies_that_are_locked_are_one(self):
        found = find_fundamentals(lines([200.0, 300.0, 500.0]))
        assert found.frequency_Hz == pytest.approx([100.0])
        assert found.combinations.ravel().tolist() == [2, 3, 5]

    def test_a_line_that_is_a_combination_by_chance_only_is_left(self):
        spread = [1e-4, 1e-4, 60.0]
        found = find_fundamentals(lines([1000.0, 1000 * math.sqrt(5), 4321.0], spread))  # pyright: ignore[reportArgumentType]
        assert not found.combinations[2].any()
        assert found.explained == pytest.approx(0.75)

    def test_a_fourth_is_left(self):
        roots = [1000 * math.sqrt(x) for x in (2, 3, 5, 7)]
        found = find_fundamentals(lines(roots, 1e-6))
        assert found.frequency_Hz == pytest.approx(roots[:3])
        assert not found.combinations[3].any()
        assert found.explained == pytest.approx(1 - 0.5**3)

    def test_no_lines_have_none(self):
        found = find_fundamentals(lines([]))
        assert found.frequency_Hz.size == 0
        assert found.explained == 0

    def test_lines_that_fit_badly_are_less_sure(self):
        f, u = np.array([100.03, 199.94]), 1e-3
        lattice = _Lattice(lines(f, u))
        lattice.combinations = np.array([[1], [2]])
        found = lattice.fitted()
        value = (f[0] + 2 * f[1]) / 5
        scatter = ((value - f[0]) ** 2 + (2 * value - f[1]) ** 2) / u**2
        assert found.frequency_Hz == pytest.approx([value])
        assert found.uncertainty_Hz == pytest.approx([u * math.sqrt(scatter / 5)])

    def test_a_line_counts_by_what_is_known_of_it(self):
        lattice = _Lattice(lines([100.0, 201.0], [0.1, 1.0]))  # pyright: ignore[reportArgumentType]
        lattice.combinations = np.array([[1], [2]])
        weights = 1 / np.array([0.1, 1.0]) ** 2
        wanted = (weights[0] * 100 + weights[1] * 2 * 201) / (weights[0] + 4 * weights[1])
        assert lattice.fitted().frequency_Hz == pytest.approx([wanted])

    def test_multiples_of_a_frequency_that_is_known(self):
        found = multiples_of(lines([200.0, 100.2, 301.5, 400.0], [0.1, 0.2, 0.1, 0.1]), 100.0)  # pyright: ignore[reportArgumentType]
        assert found.combinations.ravel().tolist() == [2, 1, 0, 4]  # 1.5 % off is no multiple, 0.2 % is one
        weights = np.array([1 / 0.01, 1 / 0.04, 1 / 0.01])
        k, f = np.array([2, 1, 4]), np.array([200.0, 100.2, 400.0])
        assert found.frequency_Hz == pytest.approx([np.sum(weights * k * f) / np.sum(weights * k**2)])
        assert found.uncertainty_Hz == pytest.approx([1 / math.sqrt(np.sum(weights * k**2))])
        assert found.explained == pytest.approx(0.5 + 0.25 + 0.0625)

    def test_two_of_three_that_explain_enough(self):
        of = lines([10.0, 30.0, 70.0, 100.0, 40.0], fractions=[0.5, 0.3, 0.02, 0.08, 0.05])
        combinations = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1], [1, 1, 0]])
        all3 = Fundamentals(np.array([10.0, 30.0, 70.0]), np.array([0.1, 0.2, 0.3]), combinations, 0.95)
        two = all3.fewest(of, 0.84)
        assert two.frequency_Hz.tolist() == [10.0, 30.0]
        assert two.uncertainty_Hz.tolist() == [0.1, 0.2]
        assert two.combinations.tolist() == [[1, 0], [0, 1], [0, 0], [0, 0], [1, 1]]
        assert two.explained == pytest.approx(0.85)
        assert all3.fewest(of, 0.86) is all3
        assert two.fewest(of, 0.0) is two

    def test_fundamentals_are_locked_where_that_is_no_chance(self):
        """3 f₁ = 2 f₂ is near by chance with 2 τ n / (order · f₂), n the combinations up to it, τ its uncertainty."""
        grid, _ = _vectors(2, 5)
        count = 1 + grid.tolist().index([3, -2])
        limit = 0.02 * 5 * 300.0 / (2 * count * math.sqrt(13))
        for factor, left in ((0.97, 1), (1.03, 2)):
            of = lines([200.0, 300.0], fractions=[0.6, 0.4])
            lattice = _Lattice(of._replace(uncertainty_Hz=np.full(2, factor * limit)))
            lattice.combinations = np.eye(2, dtype=np.int64)
            lattice._unlock()
            assert lattice.count == left
        found = lattice.fitted()
        assert found.frequency_Hz.tolist() == pytest.approx([200.0, 300.0])
        assert found.explained == pytest.approx(1.0)

    def test_a_kernel_spans_all_that_a_relation_leaves(self):
        for relation in ([3, -2], [2, 3, -5], [6, 10, 15], [4, 0, -6]):
            kernel = _kernel(np.array(relation))
            assert kernel.shape == (len(relation), len(relation) - 1)
            assert not (np.array(relation) @ kernel).any()
            minors = [round(np.linalg.det(np.delete(kernel, k, axis=0))) for k in range(len(relation))]
            assert math.gcd(*minors) == 1

    def test_vectors_are_one_of_each_pair_by_order(self):
        grid, order = _vectors(2, 3)
        assert len(grid) == 2 + 4 + 6
        assert order.tolist() == [1] * 2 + [2] * 4 + [3] * 6
        assert (np.abs(grid).sum(axis=1) == order).all()
        assert not {tuple(each) for each in grid} & {tuple(each) for each in -grid}


class TestExponentials:
    RATE, TIME = 2000.0, np.arange(1000) / 2000.0

    def wave(self, amplitude, rate, frequency, phase=0.3):
        return amplitude * np.exp(rate * self.TIME) * np.cos(2 * np.pi * frequency * self.TIME + phase)

    def test_lines_are_found_by_their_largest_amplitude(self):
        noise = 1e-3 * np.random.default_rng(3).normal(size=self.TIME.size)
        record = 4.0 + self.wave(0.1, 6.0, 120.0) + self.wave(1.0, -9.0, 311.0) + noise
        found = find_exponentials(record, self.RATE)
        assert found.frequency_Hz == pytest.approx([120.0, 311.0], abs=3e-3)
        assert found.rate_1_per_s == pytest.approx([6.0, -9.0], abs=0.02)
        assert found.amplitude == pytest.approx([0.1 * math.exp(6 * self.TIME[-1]), 1.0], rel=3e-3)
        assert np.std(found.rest) == pytest.approx(1e-3, rel=0.1)

    @pytest.mark.parametrize("size", [1e-3, 1e-2])
    def test_errors_are_those_of_repeated_records(self, size):
        rng, off = np.random.default_rng(11), []
        for _ in range(25):
            found = find_exponentials(self.wave(1.0, -4.0, 200.0) + size * rng.normal(size=self.TIME.size), self.RATE)
            off.append([
                (found.frequency_Hz[0] - 200) / found.frequency_error_Hz[0],
                (found.rate_1_per_s[0] + 4) / found.rate_error_1_per_s[0],
            ])  # fmt: skip
        spread = np.sqrt(np.mean(np.square(off), axis=0))
        assert (spread > 0.6).all()
        assert (spread < 1.5).all()

    def test_errors_are_those_of_least_squares_with_the_noise_about_each_line(self):
        """J of c + e^(σt) (a cos ωt + b sin ωt) by all five numbers of each of two lines, by differences."""
        time, rate = np.arange(300) / 1000.0, 1000.0
        record = 2.0 + 0.7 * np.exp(5 * time) * np.cos(2 * np.pi * 60.2 * time + 0.3)
        record += 1.3 * np.exp(-11 * time) * np.cos(2 * np.pi * 171.3 * time + 1)
        record += 0.01 * np.random.default_rng(6).normal(size=300) * (1 + 8 * (np.arange(300) % 2))
        found = find_exponentials(record, rate)
        assert found.frequency_Hz.size == 2
        numbers = np.concatenate(
            [[s, 2 * np.pi * f] for s, f in zip(found.rate_1_per_s, found.frequency_Hz, strict=True)]
        )

        def waves(numbers):
            exponents = numbers[::2] + 1j * numbers[1::2]
            parts = [np.exp(each * time) for each in exponents]
            return np.array([np.ones(300), *(part for wave in parts for part in (wave.real, wave.imag))]).T

        factors = np.linalg.lstsq(waves(numbers), record, rcond=None)[0]
        np.testing.assert_allclose(found.rest, record - waves(numbers) @ factors, atol=1e-9)
        steps = 1e-4 * np.eye(4)
        slopes = np.array([(waves(numbers + h) - waves(numbers - h)) @ factors / 2e-4 for h in steps]).T
        jacobian = np.hstack([waves(numbers), slopes])
        size = np.linalg.norm(jacobian, axis=0)
        inverse = np.linalg.inv((jacobian / size).T @ (jacobian / size)) / np.outer(size, size)
        power = np.abs(np.fft.rfft(found.rest)) ** 2 / 300
        for k, (f, s) in enumerate(zip(found.frequency_Hz, found.rate_1_per_s, strict=True)):
            place = f * 0.3
            # Six bins to either side, and as many more as the line is broad: |σ|/2π Hz.
            width = 6 + abs(s) / (2 * np.pi) * 0.3
            near = power[max(0, int(place - width)) : int(place + width) + 2].mean()
            noise = max(near, np.median(power) / math.log(2))
            own = inverse[5 + 2 * k, 5 + 2 * k], inverse[6 + 2 * k, 6 + 2 * k]
            assert found.rate_error_1_per_s[k] == pytest.approx(math.sqrt(own[0] * noise), rel=1e-4)
            assert found.frequency_error_Hz[k] == pytest.approx(math.sqrt(own[1] * noise) / (2 * np.pi), rel=1e-4)

    def test_noise_has_none(self):
        assert find_exponentials(np.random.default_rng(5).normal(size=600), 1000.0).frequency_Hz.size == 0

    def test_lines_below_the_lowest_are_left(self):
        record = self.wave(2.0, 0.0, 40.0) + self.wave(1.0, -2.0, 300.0)
        record += 1e-3 * np.random.default_rng(3).normal(size=self.TIME.size)
        assert find_exponentials(record, self.RATE, lowest=100.0).frequency_Hz == pytest.approx([300.0], abs=0.05)
        assert find_exponentials(record, self.RATE, most=1).frequency_Hz == pytest.approx([40.0], abs=0.05)

    def test_three_within_a_tenth_are_a_crowd(self):
        assert is_crowded(np.array([109.0, 100.0, 105.0]))
        assert not is_crowded(np.array([112.0, 100.0, 105.0]))
        assert not is_crowded(np.array([100.0, 109.0]))
        assert is_crowded(np.array([100.0, 109.0]), crowd=2)


class TestLines:
    def test_lines_have_frequency_amplitude_and_share(self):
        time = np.arange(4000) / 1000.0
        first = 3.0 * np.cos(2 * np.pi * 50.3 * time + 0.4) + 1.0 * np.cos(2 * np.pi * 121.7 * time)
        second = 2.0 + 5.0 * np.cos(2 * np.pi * 50.3 * time - 0.9)
        found = find_lines(np.column_stack([first, second]), 1000.0)
        assert found.frequency_Hz == pytest.approx([50.3, 121.7], abs=1e-4)
        assert found.amplitude[0] == pytest.approx([3 * np.exp(0.4j), 5 * np.exp(-0.9j)], abs=1e-3)
        assert found.amplitude[1] == pytest.approx([1.0, 0.0], abs=1e-3)
        assert found.fraction == pytest.approx([(0.9 + 1) / 2, 0.1 / 2], abs=2e-3)
        assert found.left == pytest.approx(0.0, abs=1e-3)
        assert (found.uncertainty_Hz < 1e-2).all()

    def test_a_line_is_as_uncertain_as_what_is_left_about_it_pulls(self):
        """By 2 |Σ w r e^(−2πi f t)| of the rest r of unit rms, over the line's size, within some bins of the line."""
        count, rate = 400, 1000.0
        time = np.arange(count) / rate
        noise = 0.05 * np.random.default_rng(7).normal(size=(count, 2))
        record = 3.0 + noise + np.cos(2 * np.pi * 50.3 * time)[:, None] * [2.0, 1.0]
        record[:, 1] += 0.5 * np.sin(2 * np.pi * 203.4 * time)
        found = find_lines(record, rate, floor=0.05)
        assert found.frequency_Hz.size == 2
        size = np.std(record, axis=0)
        rest = record - record.mean(axis=0)
        for f, amplitude in zip(found.frequency_Hz, found.amplitude, strict=True):
            rest = rest - np.real(np.exp(2j * np.pi * f * time)[:, None] * amplitude)
        j = np.arange(count)
        window = (0.5 - 0.5 * np.cos(2 * np.pi * j / count)) / (count / 2)
        rest = (rest - window @ rest / window.sum()) / size
        bins = np.arange(0, count / 2, 0.125)
        turns = np.exp(-2j * np.pi * np.outer(bins, j) / count)
        around = 2 * np.sqrt(np.sum(np.abs(turns @ (window[:, None] * rest)) ** 2, axis=1))
        for f, amplitude, uncertainty in zip(found.frequency_Hz, found.amplitude, found.uncertainty_Hz, strict=True):
            place, strength = f * count / rate, np.sqrt(np.sum(np.abs(amplitude / size) ** 2))
            near = around[np.abs(bins - place) <= lines_module.NEIGHBOURHOOD].max()
            assert uncertainty == pytest.approx(lines_module.PULL * near / strength * rate / count, rel=0.03)
        held = np.sum(window[:, None] * ((record - record.mean(axis=0)) / size) ** 2)
        assert found.left == pytest.approx(np.sum(window[:, None] * rest**2) / held, rel=1e-6)

    def test_a_line_grows_by_the_ratio_of_its_halves(self):
        time = np.arange(2000) / 1000.0
        grown = np.where(time < 1, 1.0, 1.5) * np.cos(2 * np.pi * 50 * time)
        record = np.column_stack([grown + 0.3 * np.cos(2 * np.pi * 120 * time), 2 * grown])
        found = change_of_lines(record, 1000.0, [50.0, 120.0])
        assert found == pytest.approx([0.5, 0.0], abs=1e-6)

    def test_faint_lines_and_those_beyond_the_count_are_left(self):
        time = np.arange(4000) / 1000.0
        record = sum(a * np.cos(2 * np.pi * f * time) for f, a in [(50.3, 1.0), (121.7, 0.3), (300.1, 0.004)])
        assert find_lines(record[:, None], 1000.0).frequency_Hz.size == 2  # pyright: ignore[reportIndexIssue]
        assert find_lines(record[:, None], 1000.0, floor=1e-3).frequency_Hz.size == 3  # pyright: ignore[reportIndexIssue]
        assert find_lines(record[:, None], 1000.0, count=1).frequency_Hz == pytest.approx([50.3], abs=0.01)  # pyright: ignore[reportIndexIssue]


class TestGrowth:
    def test_an_exponential_has_its_rate_and_start(self):
        time = np.array([1.0, 1.2, 1.5, 1.7, 2.0, 2.4, 2.5])
        found = fit_growth(time, 0.02 * np.exp(-3 * (time - 1)))
        assert found.rate_1_per_s == pytest.approx(-3)
        assert found.amplitude_at_start == pytest.approx(0.02)
        assert found.standard_error == pytest.approx(0, abs=1e-9)

    def test_scatter_makes_it_unsure(self):
        time, off = np.arange(8.0), 0.1 * np.array([1.0, -1.0, 1.0, -1.0, -1.0, 1.0, -1.0, 1.0])
        found = fit_growth(time, np.exp(0.5 * time + off))
        assert found.rate_1_per_s == pytest.approx(0.5)
        # Residuals that take turns do not lie about how many there are: r = (8·(−5/8) + 2)/4 < 0 counts as none.
        assert found.standard_error == pytest.approx(math.sqrt(0.08 / 6 / 42))

    def test_modes_turn_by_their_frequency(self):
        time = np.array([0.0, 0.1, 0.15, 0.3, 0.35])
        assert modal_frequency(time, np.exp(time + 2j * np.pi * 3.2 * time)) == pytest.approx(3.2)
        assert modal_frequency(time, np.exp(-2j * np.pi * 3.2 * time)) == pytest.approx(-3.2)
        left = np.array([[1.0 + 2.0j], [3.0 - 1.0j]])
        assert modal_amplitudes(left, [[2.0, 1.0]])[0, 0] == pytest.approx(2 * (1 - 2j) + (3 + 1j))


# --- spectra ---------------------------------------------------------------------------------------------------------


def sums(signal: np.ndarray, length: int) -> np.ndarray:
    """2 |Σ w (x − m) e^(−2πi k j/N)| / Σ w, w the periodic Hann window, with the last bin of an even N once only."""
    j = np.arange(signal.size)
    window = 0.5 - 0.5 * np.cos(2 * np.pi * j / signal.size)
    centred = signal - window @ signal / window.sum()
    turns = np.exp(-2j * np.pi * np.outer(np.arange(length // 2 + 1), j) / length)
    found = 2 * np.abs(turns @ (window * centred)) / window.sum()
    if length % 2 == 0:
        found[-1] /= 2
    return found


@pytest.mark.parametrize(("count", "padding"), [(24, 3), (17, 1), (17, 3), (20, 8)])
def test_a_spectrum_is_the_windowed_fourier_sum(count, padding):
    signal = 5.0 + np.random.default_rng(count).normal(size=count)
    found = amplitude_spectrum(signal, 40.0, **({} if padding == 8 else {"zero_padding": padding}))
    np.testing.assert_allclose(found.amplitude, sums(signal, padding * count), atol=1e-14)
    np.testing.assert_allclose(found.frequency_Hz, 40.0 * np.arange(padding * count // 2 + 1) / (padding * count))
    assert found.resolution_Hz == pytest.approx(1.5 * 40.0 / count)


@pytest.mark.parametrize("how", [{}, {"periods": 5.3, "overlap": 0.6}, {"periods": 5.3, "overlap": 0.0}])
def test_a_spectrogram_is_made_of_the_spectra_of_its_windows(monkeypatch, how):
    signal, rate, lowest = np.random.default_rng(1).normal(size=400), 40.0, 4.0
    length = math.ceil(how.get("periods", 16.0) * rate / lowest)
    every = round(length * (1 - how.get("overlap", 0.875)))
    starts = range(0, 400 - length + 1, every)
    monkeypatch.setattr(spectra, "AT_ONCE", 3 * 4 * length + 1)  # three windows at a time
    pieces = list(spectra.spectrogram(signal, rate, lowest_frequency=lowest, **how))
    assert [len(each.time_s) for each in pieces][:-1] == [3] * (len(pieces) - 1)
    np.testing.assert_allclose(
        np.concatenate([each.time_s for each in pieces]), [(k + length / 2) / rate for k in starts]
    )
    wanted = [sums(signal[k : k + length], 4 * length) for k in starts]
    np.testing.assert_allclose(np.hstack([each.amplitude for each in pieces]).T, wanted, atol=1e-14)
    for each in pieces:
        np.testing.assert_allclose(each.frequency_Hz, rate * np.arange(2 * length + 1) / (4 * length))
    assert len(list(spectra.spectrogram(signal[:length], rate, lowest_frequency=lowest, **how))) == 1
    with pytest.raises(ValueError, match="too short"):
        list(spectra.spectrogram(signal[: length - 1], rate, lowest_frequency=lowest, **how))


def test_a_line_is_followed_as_its_frequency_and_its_size_change():
    rate, time = 2000.0, np.arange(4000) / 2000.0
    frequency, size = 90 + 12 * time, 3 + time
    phase = 2 * np.pi * (90 * time + 6 * time**2)
    signal = size * np.sin(phase) + 5 * np.sin(2 * np.pi * 300 * time)
    found = spectra.follow_line(signal, rate, low=80.0, high=130.0)
    length = math.ceil(16 * rate / 105)
    assert len(found.time_s) == 1 + (4000 - length) // round(length / 8)
    np.testing.assert_allclose(found.time_s, (length / 2 + round(length / 8) * np.arange(len(found.time_s))) / rate)
    np.testing.assert_allclose(found.frequency_Hz, np.interp(found.time_s, time, frequency), atol=0.1)
    np.testing.assert_allclose(found.amplitude, np.interp(found.time_s, time, size), rtol=0.02)
    # Where the line leaves the band its maximum lies at the edge: that is left out.
    part = spectra.follow_line(signal, rate, low=80.0, high=100.0, periods=8.0)
    assert part.frequency_Hz.max() < 100.2
    assert np.interp(part.time_s[-1], time, frequency) == pytest.approx(100.0, abs=1.0)
    for low, high in ((0.0, 5.0), (5.0, 5.0)):
        with pytest.raises(ValueError, match="must rise from above zero"):
            spectra.follow_line(signal, rate, low=low, high=high)


def test_the_vertex_of_a_parabola_is_where_it_turns():
    for points in ((1.0, 3.0, 2.5), (-0.4, 0.3, -7.0), (2.0, 1.0, 4.0)):
        a, b, c = np.polyfit([-1, 0, 1], points, 2)
        assert spectra.parabola_vertex(*points) == pytest.approx((-b / (2 * a), c - b**2 / (4 * a)))
    assert spectra.parabola_vertex(1.0, 2.0, 3.0) == (0.0, 2.0)


def made_of(*peaks: tuple[int, float]) -> Spectrum:
    """Peaks at bins of 2 Hz, with neighbours of half their size, and a resolution of 3 Hz (bins 1/T of 2 Hz)."""
    amplitude = np.full(501, 1e-9)
    for at, size in peaks:
        amplitude[at - 1 : at + 2] = np.maximum(amplitude[at - 1 : at + 2], [size / 2, size, size / 2])
    return Spectrum(np.arange(0.0, 1002.0, 2.0), amplitude, 3.0)


def lobe(*distances: float) -> float:
    return 6.5 * sum(1 / (math.pi * x * (x**2 - 1)) for x in distances)


def test_peaks_are_those_that_stand_above_the_side_lobes_of_the_stronger_and_of_their_images():
    for factor, kept in ((0.99, False), (1.01, True)):
        # 20 bins from 1, whose image lies 220 away; then 5 and 25 bins from both.
        second = 1.03 * lobe(20, 220)
        third = factor * (lobe(25, 225) + second * lobe(5, 245))
        found = spectral_peaks(made_of((100, 1.0), (120, second), (125, third)), count=9, floor=1e-6)
        assert found.frequency_Hz.tolist() == [200.0, 240.0, 250.0][: 2 + kept]
        np.testing.assert_allclose(found.amplitude, [1.0, second, third][: 2 + kept])
        below = spectral_peaks(made_of((100, 1.0), (120, factor * lobe(20, 220))), count=9, floor=1e-6)
        assert below.frequency_Hz.size == 1 + kept
    many = made_of((50, 0.02), (200, 0.5), (400, 1.0), (300, 0.1))
    assert spectral_peaks(many, count=9, floor=0.019).frequency_Hz.tolist() == [800.0, 400.0, 600.0, 100.0]
    assert spectral_peaks(many, count=9, floor=0.021).frequency_Hz.tolist() == [800.0, 400.0, 600.0]
    assert spectral_peaks(many, count=2, floor=0.019).frequency_Hz.tolist() == [800.0, 400.0]
    threshold = np.where(np.arange(501) < 350, 0.5, 0.9)
    assert spectral_peaks(many, count=9, floor=0.019, threshold=threshold).frequency_Hz.tolist() == [800.0]
    near = peak_near(many, 590.0, half_width=190.0)
    assert near is not None
    assert (near.frequency_Hz, near.amplitude) == (400.0, pytest.approx(0.5))
    near = peak_near(many, 590.0, half_width=189.0)
    assert near is not None
    assert near.frequency_Hz == 600.0
    assert peak_near(many, 590.0, half_width=9.0) is None
    for wrong in (0.0, 1.0):
        with pytest.raises(ValueError, match="floor"):
            spectral_peaks(many, count=9, floor=wrong)
    with pytest.raises(ValueError, match="count"):
        spectral_peaks(many, count=0, floor=0.5)


@pytest.mark.parametrize(
    ("frequencies", "uncertainties", "said"),
    [
        ((), (), ""), ((123.456,), (0.2,), "123.5 Hz"), ((123.456, 7.0), (2.0, 1e-5), "123 and 7.00000 Hz"),
        ((100.0, 200.0, 1234.5), (1.0, 1.0, 0.01), "100, 200 and 1234.50 Hz"), ((50.0,), (90.0,), "50 Hz"),
        ((99.94,), (0.04,), "99.94 Hz"), ((0.0123456,), (2e-5,), "0.01235 Hz"),
    ],
)  # fmt: skip
def test_frequencies_are_written_to_the_digits_that_they_are_known_to(frequencies, uncertainties, said):
    assert written_frequencies(frequencies, uncertainties, 7) == said
