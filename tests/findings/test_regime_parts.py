"""What a motion is, from recurrences and lines that are made up: each limit just kept, and just not."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.signals import regime
from drumsqueal.findings.signals.recurrence import Recurrence
from drumsqueal.findings.signals.regime import Cause, classify

RATE, COUNT = 100.0, 2000  # 20 s


def recurred(period: float, error: float = 1e-3, later: float = 2e-3) -> Recurrence:
    return Recurrence(period, error, later)


@pytest.fixture
def moving(monkeypatch) -> Any:
    """What signals of unit rms are, by their recurrences and their drift."""

    def made(returns: Any, smallest: float | None = 0.5, drift: tuple[float, float] = (0.0, 0.0)) -> Any:
        asked: dict[str, Any] = {}

        def find_recurrences(unit, longest):
            asked["longest"] = longest
            return list(returns), smallest

        def drifts(unit, period):
            asked["period"] = period
            return drift

        monkeypatch.setattr(regime, "find_recurrences", find_recurrences)
        monkeypatch.setattr(regime, "_drift", drifts)
        monkeypatch.setattr(
            regime, "_not_periodic", lambda unit, rate, error, drift, nearly: ("torus", error, drift, nearly)
        )
        found = regime._moving_regime(np.ones((COUNT, 1)), RATE, 3.0)
        assert asked["longest"] == 300.0
        return found, asked["period"]

    return made


def test_a_motion_that_comes_back_for_long_is_periodic(moving):
    found, period = moving([recurred(40.0, 5e-3, 2e-2), recurred(80.0, 3e-3, 4e-3)])
    assert period == 80.0  # the first that lasts
    assert (found.kind, found.cause, found.period_s, found.base_frequencies_Hz) == (
        Kind.PERIODIC, Cause.REPEATS, pytest.approx(0.8), (pytest.approx(1.25),)
    )  # fmt: skip
    assert (found.recurrence_error, found.numbers["recurrence_error"]) == (4e-3, 4e-3)
    assert moving([recurred(80.0, 4e-3, 3e-3)])[0].recurrence_error == 4e-3
    # Twenty periods of it are needed: 20 s are 20 of 1 s.
    assert moving([recurred(99.9)])[0].kind is Kind.PERIODIC
    few, _ = moving([recurred(100.1)])
    assert (few.kind, few.cause, few.record_needed_s) == (
        Kind.UNDECIDED,
        Cause.TOO_FEW_PERIODS,
        pytest.approx(20.02),
    )
    assert few.numbers == {
        "period_s": pytest.approx(1.001), "duration_s": 20.0, "record_needed_s": pytest.approx(20.02),
        "periods_needed": 20.0,
    }  # fmt: skip
    assert few.recurrence_error == 2e-3


def test_a_motion_that_comes_back_for_a_while_or_not_at_all_is_looked_at_by_its_lines(moving):
    found, period = moving([recurred(40.0, 5e-3, 2e-2)], 4e-3, (0.001, 0.0))
    assert (found, period) == (("torus", 4e-3, 0.001, True), 40.0)
    found, period = moving([], 0.3, (-0.09, 0.09))
    assert (found, period) == (("torus", 0.3, -0.09, False), None)
    slow, _ = moving([], None)
    assert (slow.kind, slow.cause) == (Kind.UNDECIDED, Cause.TOO_SLOW)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_motion_drifts_beyond_a_hundredth_where_it_comes_back_and_a_tenth_elsewhere(moving, sign):
    for returns, limit in (([recurred(40.0)], 0.01), ([recurred(40.0, 5e-3, 2e-2)], 0.01), ([], 0.1)):
        for size, drifts in ((0.99 * limit, False), (1.01 * limit, True)):
            for drift in ((sign * size, 0.0), (0.0, size)):
                found, _ = moving(returns, 0.3, drift)
                cause = getattr(found, "cause", None)
                assert (cause is Cause.DRIFTS) == drifts
                if drifts:
                    assert found.numbers == {"amplitude_drift": drift[0], "mean_drift": drift[1]}
                    assert found.record_needed_s is None


def test_the_drift_is_that_of_the_halves_cut_to_whole_periods():
    time = np.arange(203)
    first, second = np.where(time < 100, 1.0, 1.3), np.where(time < 100, 0.0, 0.5)
    wave = np.where(time % 2 == 0, 1.0, -1.0)
    motion = np.column_stack([first * wave, 2 * wave + second])
    half = 203 // 2
    for period, length in ((None, half), (30.0, 90), (33.4, 100), (150.0, half)):
        a, b = motion[:length], motion[-length:]
        rms = [np.sqrt(np.mean(each**2, axis=0)) for each in (a, b)]
        change = rms[1] / rms[0] - 1
        shift = np.abs(b.mean(axis=0) - a.mean(axis=0)) / np.sqrt(np.mean(motion**2, axis=0))
        found = regime._drift(motion, period)
        assert found == (pytest.approx(change[np.argmax(np.abs(change))]), pytest.approx(shift.max())), period
    assert regime._drift(motion[::-1], None)[0] < 0


def test_what_hardly_moves_is_steady_and_tells_whether_it_grows():
    time = np.arange(4000) / 1000.0
    quiet = 0.9e-6 * np.sin(2 * np.pi * 50 * time)
    found = classify(np.column_stack([quiet, 0 * time]), 1000.0, scale=[1.0, 1.0], lowest_frequency=50.0)
    assert (found.kind, found.cause) == (Kind.STEADY, Cause.NOTHING_MOVES)
    assert found.numbers == {"amplitude": pytest.approx(0.9e-6, rel=1e-3), "least": 1e-6, "grows": 0.0}
    # One sample of zero is no signal at rest.
    rising = np.column_stack([quiet * np.linspace(0.5, 1.0, 4000), 0 * time])
    grows = classify(rising, 1000.0, scale=[1.0, 1.0], lowest_frequency=50.0)
    assert grows.numbers["grows"] == 1.0
    # Of an amplitude that rises from a to b the mean square is (a² + ab + b²)/3.
    assert grows.amplitude_drift == pytest.approx(
        np.sqrt((0.75**2 + 0.75 + 1) / (0.5**2 + 0.5 * 0.75 + 0.75**2)) - 1, rel=1e-3
    )
    # A signal that moves may be zero at some samples.
    tones = np.concatenate([0.5 * np.tile([0.0, 1.0, 0.0, -1.0], 500), np.tile([0.0, 1.0, 0.0, -1.0], 500)])
    doubled = classify(1e-7 * tones[:, None], 1000.0, scale=[1.0], lowest_frequency=50.0)
    assert (doubled.amplitude_drift, doubled.numbers["grows"]) == (pytest.approx(1.0), 1.0)
    still = classify(np.zeros((4000, 1)), 1000.0, scale=[1.0], lowest_frequency=50.0)
    assert (still.amplitude_drift, still.numbers["grows"]) == (0.0, 0.0)
    # By its scale a signal moves that is as large in another.
    moves = classify(np.column_stack([quiet, quiet]), 1000.0, scale=[1.0, 0.5], lowest_frequency=50.0)
    assert moves.kind is Kind.PERIODIC
    short = classify(quiet[:399, None], 1000.0, scale=[1.0], lowest_frequency=50.0)
    assert (short.cause, short.record_needed_s) == (Cause.RECORD_TOO_SHORT, pytest.approx(0.4))
    assert classify(quiet[:400, None], 1000.0, scale=[1.0], lowest_frequency=50.0).cause is Cause.NOTHING_MOVES


@pytest.fixture
def torus(monkeypatch) -> Any:
    """What the lines of a motion of 20 s make of it, by fundamental frequencies and how it comes back after a lag."""

    def made(
        found: Any, *, explained: float = 0.995, back: Any = None, drifting: Any = None, strongest: float = 5.0
    ) -> Any:
        lines = SimpleNamespace(
            frequency_Hz=np.array([1.7, strongest, 9.0]), fraction=np.array([0.2, 0.7, 0.1]), left=0.01,
            resolution_Hz=0.075, uncertainty_Hz=np.array([1.0, 0.04, 1.0]),
        )  # fmt: skip
        few = SimpleNamespace(frequency_Hz=np.array([7.0]), uncertainty_Hz=np.array([0.7]), explained=0.99)
        fundamentals = SimpleNamespace(
            frequency_Hz=np.array(found), uncertainty_Hz=0.01 * np.array(found), explained=explained,
            fewest=lambda lines, least: few,
        )  # fmt: skip
        lags: list[float] = []

        def recurrence_after(unit, lag):
            lags.append(lag)
            return back(lag) if back else None

        monkeypatch.setattr(regime, "find_lines", lambda unit, rate, floor: lines)
        monkeypatch.setattr(regime, "find_fundamentals", lambda lines: fundamentals)
        monkeypatch.setattr(regime, "recurrence_after", recurrence_after)
        monkeypatch.setattr(regime, "_changed_line", lambda *given: drifting or {})
        return regime._not_periodic(np.ones((COUNT, 1)), RATE, 0.3, 0.02, nearly=True), lags

    return made


def test_lines_that_explain_too_little_are_those_of_an_irregular_motion(torus):
    found, lags = torus([2.0, 5.0], explained=0.9899)
    assert (found.kind, found.cause, found.base_frequencies_Hz, lags) == (
        Kind.IRREGULAR, Cause.NO_COMBINATIONS, (), []
    )  # fmt: skip
    assert (found.recurrence_error, found.amplitude_drift, found.explained_fraction) == (0.3, 0.02, 0.9899)
    assert found.numbers == {
        "recurrence_error": 0.3, "nearly": 1.0, "recurrence_limit": 0.01, "lines": 3.0, "in_lines": 0.99,
        "explained": 0.9899, "resolution_Hz": 0.075, "duration_s": 20.0,
    }  # fmt: skip
    assert torus([2.0, 5.0], explained=0.9901)[0].kind is Kind.QUASI_PERIODIC


def test_several_fundamentals_are_a_torus_unless_the_motion_comes_back_after_turns_of_the_strongest(torus):
    found, lags = torus([1.6, 5.1])
    # 5 Hz turns three times in a period of 1.6 Hz, as near as it gets.
    assert lags == [pytest.approx(RATE * 3 / 5.0)]
    assert (found.kind, found.cause, found.base_frequencies_Hz, found.base_uncertainties_Hz) == (
        Kind.QUASI_PERIODIC, Cause.COMBINATIONS, (7.0,), (0.7,)
    )  # fmt: skip
    assert found.numbers["explained"] == 0.99
    assert torus([11.0, 12.0])[1] == [pytest.approx(RATE / 5.0)]  # once at least
    drifts, _ = torus([1.6, 5.1], drifting={"line_Hz": 5.0, "line_change": 0.2})
    assert (drifts.kind, drifts.cause, drifts.numbers["line_change"]) == (Kind.UNDECIDED, Cause.LINE_DRIFTS, 0.2)
    assert drifts.base_frequencies_Hz == ()
    close, _ = torus([1.6, 5.1], drifting={"line_Hz": 5.0, "line_change": 0.2, "next_Hz": 5.1, "record_needed_s": 31.0})
    assert (close.kind, close.cause, close.record_needed_s) == (Kind.UNDECIDED, Cause.LINES_TOO_CLOSE, 31.0)
    assert close.base_frequencies_Hz == ()
    for error, later, comes_back in (
        (0.0099, 0.002, True),
        (0.002, 0.0099, True),
        (0.0101, 0.002, False),
        (0.002, 0.0101, False),
    ):
        found, lags = torus(
            [1.6, 5.1], back=lambda lag, error=error, later=later: Recurrence(lag * 1.001, error, later)
        )
        assert (found.kind is Kind.PERIODIC) == comes_back
    found, lags = torus([1.6, 5.1], back=lambda lag: Recurrence(61.0, 0.003, 0.004))
    assert (found.cause, found.period_s) == (Cause.MULTIPLES_REPEAT, pytest.approx(0.61))
    assert found.base_frequencies_Hz == (pytest.approx(RATE / 61.0),)
    assert found.base_uncertainties_Hz == (pytest.approx(0.04 / 3),)
    assert found.recurrence_error == 0.004
    assert lags[1] == pytest.approx(61.0)


def test_one_fundamental_is_a_cycle_where_it_was_recorded_twenty_times_and_comes_back(torus):
    short, lags = torus([0.999])
    assert (short.kind, short.cause, short.record_needed_s, lags) == (
        Kind.UNDECIDED, Cause.MULTIPLES_TOO_SHORT, pytest.approx(20 / 0.999), []
    )  # fmt: skip
    lost, lags = torus([1.001])
    assert lags == [pytest.approx(RATE / 1.001)]
    assert (lost.kind, lost.cause, lost.recurrence_error) == (
        Kind.UNDECIDED,
        Cause.MULTIPLES_DO_NOT_REPEAT,
        math.inf,
    )
    for error, later, comes_back in ((0.0099, 0.002, True), (0.002, 0.0101, False), (0.0101, 0.002, False)):
        found, _ = torus([1.25], back=lambda lag, error=error, later=later: Recurrence(lag, error, later))
        assert (found.kind is Kind.PERIODIC) == comes_back
        assert found.recurrence_error == max(error, later)
        assert found.numbers["period_s"] == pytest.approx(0.8)
    assert found.period_s is None
