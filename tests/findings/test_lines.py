"""Refined lines and base frequencies against exact tori, near-commensurate ones, noise and chaos."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from drumsqueal.findings.signals.lines import Lines, find_fundamentals, find_lines, multiples_of

RATE = 50_000.0


def times(duration: float) -> np.ndarray:
    return np.arange(round(duration * RATE)) / RATE


def torus(duration: float, parts, phases=None) -> np.ndarray:
    """Two signals, the second with other amplitudes and phases, of unlike units."""
    t = times(duration)
    turns = np.zeros(len(parts)) if phases is None else phases
    first = np.sum([a * np.cos(2 * np.pi * f * t + p) for (f, a), p in zip(parts, turns, strict=True)], axis=0)
    second = np.sum(
        [
            a / (k + 1) * np.sin(2 * np.pi * f * t + 2 * p)
            for k, ((f, a), p) in enumerate(zip(parts, turns, strict=True))
        ],
        axis=0,
    )
    return np.column_stack([first, 1e-6 * second + 3.0])


def modulated(t: np.ndarray, slow: float, phase: float = 0.0) -> np.ndarray:
    """Three frequencies in one signal: two modes, one of which is modulated slowly in amplitude and phase."""
    w = 2 * np.pi * slow * t + phase
    carrier = (1 + 0.1 * np.cos(w)) * np.cos(2 * np.pi * 1075.8 * t + 0.1 * np.sin(w))
    return carrier + 0.3 * np.cos(2 * np.pi * 7290.2 * t + phase) * (1 + 0.2 * np.cos(2 * np.pi * 1075.8 * t))


def test_lines_are_found_with_frequency_amplitude_and_phase():
    parts, phases = [(1075.8166, 1.0), (4303.27, 0.2), (7290.2398, 0.05)], [0.3, 1.7, -2.0]
    lines = find_lines(torus(0.2, parts, phases), RATE)
    # Least squares know no leakage: what is left is round-off, and the mirror images are in the model.
    assert lines.frequency_Hz == pytest.approx([f for f, _ in parts], abs=1e-5)
    assert np.abs(lines.amplitude[:, 0]) == pytest.approx([1.0, 0.2, 0.05], rel=1e-6)
    assert np.abs(lines.amplitude[:, 1]) == pytest.approx([1e-6, 1e-7, 0.05e-6 / 3], rel=1e-6)
    assert np.angle(lines.amplitude[:, 0]) == pytest.approx(phases, abs=1e-5)
    assert lines.left < 1e-12
    assert lines.resolution_Hz == pytest.approx(2 / 0.2)


@pytest.mark.thorough
@given(size=st.floats(0.01, 0.2), phase=st.floats(0.0, 2 * np.pi))
@settings(derandomize=True, max_examples=100)
def test_what_hides_beside_a_line_pulls_it_by_no_more_than_thrice_its_uncertainty(size, phase):
    duration = 0.2
    hidden = 1000.0 + 1.0 / duration  # closer than the main lobe, so that it cannot be a line of its own
    lines = find_lines(torus(duration, [(1000.0, 1.0), (hidden, size)], [0.0, phase])[:, :1], RATE)
    near = np.abs(lines.frequency_Hz - 1000.0) < 10.0
    assert abs(lines.frequency_Hz[near][0] - 1000.0) < 3 * lines.uncertainty_Hz[near][0]


def test_lines_closer_than_the_main_lobe_are_not_told_apart():
    fundamentals = find_fundamentals(find_lines(torus(0.2, [(1000.0, 1.0), (1005.37, 0.8), (7000.3, 0.5)]), RATE))
    assert not np.any(np.abs(fundamentals.frequency_Hz - 5.37) < 4.0)
    told = find_fundamentals(find_lines(torus(0.5, [(1000.0, 1.0), (1008.37, 0.8), (7000.3, 0.5)]), RATE))
    assert told.frequency_Hz == pytest.approx([8.37, 1000.0, 7000.3], abs=1e-3)


# Phases change what leaks where, and nothing of what is found: 1e-5 bins, 5e-5 Hz, is the least uncertainty of a line,
# and a base may be the difference of several.
@pytest.mark.thorough(but=["frequencies1-wanted1", "frequencies3-wanted3"])
@given(phases=st.lists(st.floats(0.0, 2 * np.pi), min_size=6, max_size=6))
@settings(derandomize=True, max_examples=25)
@pytest.mark.parametrize(
    ("frequencies", "wanted"),
    [
        ([1424.3, 2848.6, 7121.5], [1424.3]),
        ([2848.6, 4272.9, 7121.5], [1424.3]),  # the base itself is no line
        ([1075.81, 4303.24, 7290.24, 6214.43, 240.43], [1075.81, 7290.24]),
        ([1000.0, 8000.5, 7000.5], [1000.0, 7000.5]),  # half a hertz from 1:7, a tenth of a bin of 5 Hz
        ([1424.0, 4392.37, 7399.1, 5816.37, 2968.37, 11791.47], [1424.0, 4392.37, 7399.1]),
        ([1075.8, 1088.4, 7290.2, 1063.2], [12.6, 1075.8, 7290.2]),
    ],
)
def test_base_frequencies_of_a_torus(frequencies, wanted, phases):
    amplitudes = [1.0, 0.3, 0.4, 0.1, 0.05, 0.03]
    parts = list(zip(frequencies, amplitudes[: len(frequencies)], strict=True))
    lines = find_lines(torus(0.2 if wanted[0] > 100 else 0.4, parts, phases[: len(parts)]), RATE)
    fundamentals = find_fundamentals(lines)
    assert fundamentals.frequency_Hz == pytest.approx(wanted, abs=1e-3)
    assert np.all(np.any(fundamentals.combinations != 0, axis=1))
    assert fundamentals.combinations @ fundamentals.frequency_Hz == pytest.approx(lines.frequency_Hz, abs=1e-3)
    assert fundamentals.explained == pytest.approx(1.0, abs=1e-2)


@pytest.mark.parametrize("phase", [0.0, 1.0, 4.0])
def test_slow_modulation_is_a_base_of_its_own(phase):
    fundamentals = find_fundamentals(find_lines(modulated(times(1.0), 12.6567, phase)[:, None], RATE, floor=3e-3))
    assert fundamentals.frequency_Hz == pytest.approx([12.6567, 1075.8, 7290.2], abs=1e-3)


def test_lines_are_multiples_of_a_known_period_only_where_that_is_no_chance():
    slow = 12.6566663
    lines = find_lines(torus(1.0, [(85 * slow, 1.0), (340 * slow, 0.5), (400 * slow + 0.3, 0.1)]), RATE)
    found = multiples_of(lines, slow * (1 + 1e-7))
    assert found.combinations[:, 0].tolist() == [85, 340, 0]  # the third is 2 % of a multiple off
    assert found.frequency_Hz == pytest.approx([slow], rel=1e-7)
    assert found.explained == pytest.approx(1 - lines.fraction[2])


def known(frequencies, uncertainties, fractions) -> Lines:
    """Return lines that are known so well, in a record of 10 s."""
    frequency, uncertainty, fraction = map(np.array, (frequencies, uncertainties, fractions))
    return Lines(frequency, uncertainty, np.ones((frequency.size, 1), dtype=complex), fraction, 0.0, 0.2)


def test_a_line_is_a_combination_as_far_as_both_are_known():
    # Twice 1000 ± 0.3 Hz is known to 0.6 Hz, and 2000.6 to 0.2 Hz: together to 0.632 Hz.
    found = find_fundamentals(known([1000.0, 2000.6], [0.3, 0.2], [0.6, 0.3]))
    assert found.combinations.tolist() == [[1], [2]]
    # Least squares of 1000 = f and 2000.6 = 2 f with these weights, 1/0.09 and 4/0.04, which say how well it is known.
    weights = np.array([1 / 0.09, 4 / 0.04])
    assert found.frequency_Hz == pytest.approx([weights @ [1000.0, 1000.3] / weights.sum()], rel=1e-12)
    assert found.uncertainty_Hz == pytest.approx([1 / np.sqrt(weights.sum())], rel=1e-9)
    assert found.explained == pytest.approx(0.9)
    apart = find_fundamentals(known([1000.0, 2000.66], [0.3, 0.2], [0.6, 0.3]))
    assert apart.frequency_Hz == pytest.approx([1000.0, 2000.66])
    assert apart.uncertainty_Hz == pytest.approx([0.3, 0.2])


def test_multiples_say_together_how_well_their_frequency_is_known():
    # f = 1000 and 2 f = 2001, each to 0.1 Hz; the third line is 100 Hz off any.
    found = multiples_of(known([1000.0, 2001.0, 3100.0], [0.1, 0.1, 0.1], [0.5, 0.25, 0.125]), 1000.0)
    assert found.combinations[:, 0].tolist() == [1, 2, 0]
    assert found.frequency_Hz == pytest.approx([(1000.0 + 2 * 2001.0) / 5])
    assert found.uncertainty_Hz == pytest.approx([0.1 / np.sqrt(5)])
    assert found.explained == pytest.approx(0.75)


def test_fundamentals_that_are_locked_are_one():
    slow = 1075.8166369 / 85  # 7 f1 − f2 = 19 slow and f1 = 85 slow
    fundamentals = find_fundamentals(
        find_lines(torus(1.0, [(85 * slow, 1.0), (576 * slow, 0.5), (84 * slow, 0.1)]), RATE)
    )
    assert fundamentals.frequency_Hz == pytest.approx([slow], rel=1e-7)
    assert sorted(fundamentals.combinations[:, 0]) == [84, 85, 576]
    # The same with bases that are not: off by a hertz in 7290, where the record knows a ten-thousandth.
    free = find_fundamentals(
        find_lines(torus(1.0, [(85 * slow, 1.0), (576 * slow + 1.03, 0.5), (84 * slow, 0.1)]), RATE)
    )
    assert free.frequency_Hz == pytest.approx([slow, 85 * slow, 576 * slow + 1.03], abs=1e-3)


def test_lines_that_are_not_known_well_enough_are_no_combinations():
    # In noise of a tenth, weak lines are known to some hertz: a combination of high order is then always near.
    t, random = times(0.1), np.random.default_rng(3)
    signal = np.cos(2 * np.pi * 1424.0 * t) + np.cos(2 * np.pi * 4392.37 * t) + 0.3 * random.normal(size=t.size)
    lines = find_lines(signal[:, None], RATE)
    fundamentals = find_fundamentals(lines)
    strong = lines.fraction > 0.1
    assert np.count_nonzero(strong) == 2
    assert fundamentals.frequency_Hz[:2] == pytest.approx([1424.0, 4392.37], abs=0.1)
    assert fundamentals.explained == pytest.approx(lines.fraction[strong].sum(), abs=0.01)


@pytest.mark.thorough
def test_noise_and_chaos_have_no_base_frequencies():
    def lorenz(_, y):
        return [10 * (y[1] - y[0]), y[0] * (28 - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]]

    chaos = solve_ivp(lorenz, (0, 120), [1.0, 1.0, 20.0], t_eval=np.linspace(20, 120, 10_000), rtol=1e-8).y.T
    for record in (chaos, np.random.default_rng(1).normal(size=(10_000, 2))):
        assert find_fundamentals(find_lines(record, RATE)).explained < 0.5


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: find_lines(np.ones((100, 1)), RATE), "signals must all move"),
        (lambda: find_lines(np.ones(100), RATE), "signals must be two-dimensional"),
        (lambda: find_lines(np.eye(100), 0.0), "sample_rate must be"),
        (lambda: find_lines(np.eye(100), RATE, count=0), "count must be"),
        (lambda: find_lines(np.eye(100), RATE, floor=1.0), "floor must lie"),
    ],
)
def test_wrong_arguments_are_refused_by_name(call, message):
    with pytest.raises(ValueError, match=message):
        call()
