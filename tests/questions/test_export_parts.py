"""The parts of an export, of accuracy, of an onset and of quieting, against sums written out."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.errors import RequestError
from drumsqueal.findings.kinds import Kind
from drumsqueal.questions.accuracy import study as accuracy
from drumsqueal.questions.accuracy.study import Errors
from drumsqueal.questions.export import export
from drumsqueal.questions.export.export import Part, _lost, _places, _resampled
from drumsqueal.questions.export.signals import FLAG, Channel, distinct
from drumsqueal.questions.onset import study as onset
from drumsqueal.questions.sensitivity.disturbing import DisturbedSqueal
from drumsqueal.questions.sensitivity.quieting import PRECISION, Quietening, _without_small
from drumsqueal.questions.sensitivity.stabilising import Problem
from drumsqueal.scene import SceneError

# --- export ----------------------------------------------------------------------------------------------------------


def channel(values, quantity="velocity", name="v") -> Any:
    return Channel(*(name, name, quantity, "m/s", "", np.asarray(values)), **dict.fromkeys(Channel._fields[6:], 0))  # pyright: ignore[reportCallIssue, reportArgumentType]


def saved(begin=2.0, samples=1001, rate=1000.0) -> Any:
    return SimpleNamespace(data={"time": SimpleNamespace(values=begin + np.arange(samples) / rate)})


@pytest.mark.parametrize(
    ("since", "until", "rate", "wanted"),
    [
        (None, None, 1000.0, (0, 1000, 1001)),
        (2.1, 2.5, 1000.0, (100, 500, 401)),
        (2.1004, 2.5004, 1000.0, (101, 500, 400)),  # the samples within
        (2.1004, 2.5004, 500.0, (100.4, 500.4, 201)),
        (2.1, 2.2, 3000.0, (100, 200, 301)),
    ],
)
def test_a_part_has_the_samples_between_its_ends(since, until, rate, wanted):
    found = _places(saved(), Part(since=since, until=until), 1000.0, rate, 3)
    assert found == (pytest.approx(wanted[0]), pytest.approx(wanted[1]), wanted[2])


def test_a_rate_far_below_and_a_part_without_samples_are_refused(monkeypatch):
    with pytest.raises(RequestError, match=r"--rate 2 Hz is less than 1/200 .* take at least 2\.5 Hz"):
        _places(saved(), Part(slow=2.0), 1000.0, 4.0, 3)
    _places(saved(), Part(slow=2.0), 1000.0, 5.0, 3)
    with pytest.raises(RequestError, match="hold 1 samples at 1000 Hz"):
        _places(saved(), Part(since=2.1, until=2.1005), 1000.0, 1000.0, 3)
    monkeypatch.setattr(export, "MOST_SAMPLES", 3003)
    _places(saved(), Part(), 1000.0, 1000.0, 3)
    with pytest.raises(RequestError, match="1001 samples of 4 signals"):
        _places(saved(), Part(), 1000.0, 1000.0, 4)


def test_flags_are_taken_from_the_nearest_sample_and_all_else_is_limited():
    time = np.arange(400) / 1000.0
    wave = np.cos(2 * np.pi * 20 * time + 0.3)
    flags = (np.arange(400) // 7) % 2
    found = _resampled([channel(wave), channel(flags, FLAG)], 1000.0, 100.25, 50, 400.0)
    places = 100.25 + np.arange(50) * 2.5
    np.testing.assert_allclose(found[0].values, np.cos(2 * np.pi * 20 * places / 1000 + 0.3), atol=1e-3)
    np.testing.assert_array_equal(found[1].values, flags[np.floor(places + 0.5).astype(int)])


def test_what_a_rate_cannot_hold_is_told_with_the_rate_that_could():
    time = np.arange(2000) / 2000.0
    low, high = np.cos(2 * np.pi * 50 * time), np.cos(2 * np.pi * 360 * time)
    kept, some, most = channel(low, name="kept"), channel(low + high / 2, name="some"), channel(low + high, name="most")
    assert _lost([kept, some], 2000.0, 2000.0, Part()) == []
    assert _lost([kept, channel(high, FLAG)], 2000.0, 400.0, Part()) == []
    (line,) = _lost([kept, some], 2000.0, 400.0, Part())
    assert "holds what is below 200 Hz: 20 % of the energy of some lies above, most at 360 Hz; it" in line
    assert line.endswith("; 800 Hz would keep that line")
    (line,) = _lost([kept, some, most], 2000.0, 400.0, Part(slow=4.0))
    assert "a rate of 100 Hz, 4 times slower, holds what is below 200 Hz: 50 % of the energy of most" in line
    assert ", and part of 1 other signal; it" in line
    assert line.endswith("; 200 Hz would keep that line")


def test_short_names_are_told_apart_by_their_numbers():
    assert distinct(["abcd", "abcdef", "abcd", "abcdef", "x"], 5) == ["abcd", "abc_2", "abc_3", "abc_4", "x"]
    assert distinct(["abcde"], 5) == ["abcde"]


# --- accuracy --------------------------------------------------------------------------------------------------------


def measurement(
    features=(1e-6, None), trajectory: float | None = 1e-6, energy=1e-6, evaluations=5.0, whole=True
) -> Any:
    errors = Errors(trajectory, None, features, energy)
    return SimpleNamespace(configuration=SimpleNamespace(whole=whole), errors=errors, evaluations=evaluations)


@pytest.mark.parametrize(
    ("more", "floor", "scatter", "wanted"),
    [
        ({}, 0.0, (None, None), True),
        ({"features": (2e-4, 1e-6)}, 0.0, (0.0, 0.0), False),  # each has to be met
        ({"features": (1e-6, 2e-4)}, 0.0, (0.0, 0.0), False),
        ({"features": (2e-4, 1e-6)}, 0.0, (1e-4, 0.0), True),  # within twice the scatter
        ({"features": (2e-4, 1e-6)}, 0.0, (0.0, 1e-4), False),
        ({"features": (math.inf, 1e-6)}, 0.0, (math.inf, 0.0), False),
        ({"trajectory": 2e-4}, 0.0, (0.0, 0.0), False),
        ({"trajectory": None}, 0.0, (0.0, 0.0), False),
        ({"energy": 2e-4}, 0.0, (0.0, 0.0), False),
        ({}, 2e-4, (0.0, 0.0), False),
        ({"whole": False}, 0.0, (0.0, 0.0), False),
    ],
)
def test_a_target_is_met_in_all_that_it_is_about(monkeypatch, more, floor, scatter, wanted):
    monkeypatch.setattr(accuracy, "astuple", lambda each: each)
    assert accuracy._meets(measurement(**more), 1e-4, floor, scatter) is wanted


def test_the_cheapest_has_the_fewest_evaluations_of_those_that_meet_the_target(monkeypatch):
    monkeypatch.setattr(accuracy, "astuple", lambda each: each)
    bench: Any = SimpleNamespace(
        reference=SimpleNamespace(uncertainty=lambda end: 1e-9 * end), growth_end=2.0, scatter=(0.0, 0.0)
    )
    all_of_them = [
        measurement(energy=1e-2, evaluations=1.0),
        measurement(evaluations=7.0),
        measurement(evaluations=5.0),
    ]
    assert accuracy._cheapest(bench, all_of_them, 1e-4) is all_of_them[2]
    assert accuracy._cheapest(bench, all_of_them, 1e-7) is None
    bench.growth_end = 1e6
    assert accuracy._cheapest(bench, all_of_them, 1e-4) is None


# --- onset -----------------------------------------------------------------------------------------------------------


def test_the_highest_frequency_of_all_points_has_to_be_sampled_twice(monkeypatch):
    def point(value: float, *frequencies: float, reason: str = "") -> Any:
        modes = [SimpleNamespace(frequency_Hz=each) for each in frequencies]
        return SimpleNamespace(value=value, vibrations=modes, reason=reason)

    linear = SimpleNamespace(points=[point(1.0, 100, 300), point(2.0, 200, 450), point(3.0, 900, reason="none")])
    seen = []
    monkeypatch.setattr(onset, "follow_modes", lambda *_: linear)
    monkeypatch.setattr(onset, "round_seconds", lambda asked, moving: seen.append(asked) or 0.5)
    variation: Any = SimpleNamespace(key="friction.coefficient", values=(1.0, 3.0))
    family: Any = SimpleNamespace(moving=("X",))

    def predict(rate: float, scene: Any = None) -> Any:
        at: Any = lambda value: None  # noqa: E731
        return onset._predict(scene, variation, family, at, onset.IntegratorOptions(rate, 1e-6), lambda *_: None)

    with pytest.raises(RequestError, match=r"twice the highest frequency, 450 Hz.* take at least 900 Hz"):
        predict(899.0)
    with pytest.raises(SceneError, match="450 Hz"):
        predict(899.0, SimpleNamespace())
    found = predict(900.0)
    assert found.how.round_seconds == 0.5
    assert seen == [[linear.points[0]]]
    variation.values = (5.0, 6.0)
    predict(900.0)
    assert seen[-1] == linear.points[:2]
    variation.values = (5.0, 5.0)
    with pytest.raises(RequestError, match="two values"):
        predict(900.0)
    variation.values, linear.points = (1.0, 2.0), [point(1.0, reason="it lifts off")]
    with pytest.raises(RequestError, match="no steady sliding anywhere in the range: it lifts off"):
        predict(900.0)


# --- quieting --------------------------------------------------------------------------------------------------------


def quietening() -> Any:
    search, problem = object.__new__(Quietening), object.__new__(Problem)
    problem.keys, problem.low, problem.high = ("a", "b", "c"), np.array([-1.0, -2.0, -3.0]), np.array([4.0, 5.0, 6.0])
    problem.in_file = lambda x: dict(zip("abc", x.tolist(), strict=True))
    search._problem = problem
    return search


def test_changes_go_as_far_as_the_first_bound():
    problem = quietening()._problem
    assert problem.farthest(np.array([1.0, 0.5, 0.0])) == 4.0
    assert problem.farthest(np.array([-0.5, 0.5, -2.0])) == 1.5
    assert problem.farthest(np.zeros(3)) == math.inf
    assert problem.farthest(np.array([0.1, -1.0, 0.0])) == 2.0


@pytest.mark.parametrize(
    ("singles", "most", "direction", "farthest"),
    [
        # To the bound, or to the size of what is known.
        ({"a": 0.5, "b": -0.25}, math.inf, np.array([2.0, -4.0, 0.0]) / 20, 10.0),
        ({"a": 0.5, "b": -0.25}, 0.5, np.array([2.0, -4.0, 0.0]) / 20, 0.5 * math.sqrt(20)),
        ({"a": 0.5}, 2.0, np.array([0.5, 0.0, 0.0]), 4.0),
        # What would change by little does not.
        ({"b": 0.3, "c": 30.0}, 9.0, np.array([0.0, 0.3, 0.0]), 5 / 0.3),
    ],
)
def test_the_search_goes_straight_to_the_plane_through_what_each_number_takes(singles, most, direction, farthest):
    line, positions = quietening()._towards(singles, (), most), []
    while line.position is not None:
        positions.append(line.position)
        line.take(())
    steps = [0.4 * 1.6**k for k in range(16)]
    # 1e-3: of what would change by little there is some in the plane
    assert positions == pytest.approx([*(x for x in steps if x < farthest * (1 - PRECISION)), farthest], rel=1e-3)
    assert list(line.numbers_at(2.0).values()) == pytest.approx((2 * direction).tolist(), rel=1e-3)


def test_small_changes_are_left():
    np.testing.assert_array_equal(_without_small(np.array([1.0, -0.11, 0.09, -2.0 + 1.5])), [1.0, -0.11, 0.0, -0.5])


def test_the_smallest_disturbance_that_squeals_and_the_largest_in_its_way_that_decays():
    def trial(energy: float, leads, mode: str | None = "X", *, forwards=True, motion: Any = None) -> Any:
        disturbance = None if mode is None else SimpleNamespace(mode=mode, forwards=forwards, energy_J=energy)
        return SimpleNamespace(disturbance=disturbance, leads_to=leads, motion=motion, energy_J=energy)

    squeals = next(each for each in Kind if each is not Kind.DECAYS)
    trials = (
        trial(0.5, squeals, None, motion=object()),
        trial(5.0, squeals, motion=object()),
        trial(3.0, squeals, motion=object()),
        trial(1.0, Kind.DECAYS),
        trial(2.0, Kind.DECAYS),
        trial(2.5, Kind.DECAYS, "Y"),
        trial(2.6, Kind.DECAYS, forwards=False),
        trial(2.7, squeals),
        trial(4.0, Kind.DECAYS),
    )
    squeal = DisturbedSqueal.model_construct(steady_sliding_stable=True, quiet=False, motions=(), disturbances=trials)
    assert squeal.smallest_disturbance is trials[2]
    assert squeal.largest_that_decays is trials[4]
    nothing = DisturbedSqueal.model_construct(
        steady_sliding_stable=True, quiet=True, motions=(), disturbances=trials[3:]
    )
    assert nothing.smallest_disturbance is None
    assert nothing.largest_that_decays is None
