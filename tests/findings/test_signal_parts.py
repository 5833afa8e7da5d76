"""Parts of the signal analysis, against what can be told by hand."""

import math

import numpy as np
import pytest

from drumsqueal.findings.signals.exponentials import find_exponentials, is_crowded
from drumsqueal.findings.signals.fundamentals import (
    Fundamentals,
    _kernel,
    _Lattice,
    _vectors,
    find_fundamentals,
    multiples_of,
)
from drumsqueal.findings.signals.growth import fit_growth, modal_amplitudes, modal_frequency
from drumsqueal.findings.signals.lines import Lines, find_lines


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
