"""The parts of the studies of motion, accuracy and effects, against sums written out."""

import dataclasses
import io
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from drumsqueal.errors import Ending
from drumsqueal.findings.compare import LOST, RelativeChange, SceneAnswer, change_of
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.findings.saturation import SpectralLine
from drumsqueal.findings.signals.growth import Exponents, lyapunov_exponents, orthonormalised
from drumsqueal.findings.signals.lines import Fundamentals, Lines
from drumsqueal.findings.signals.regime import Cause, Regime
from drumsqueal.questions.accuracy import study as accuracy_study
from drumsqueal.questions.accuracy import study as bench
from drumsqueal.questions.accuracy import study as reference
from drumsqueal.questions.accuracy.study import (
    Errors,
    Measurement,
    Reference,
    feature_errors,
    sizes_of,
    trajectory_error,
)
from drumsqueal.questions.effects import study as variants_module
from drumsqueal.questions.effects.study import Variant, describe_verdict, excess_of
from drumsqueal.questions.motion import answer as motion_answer
from drumsqueal.questions.motion import study
from drumsqueal.questions.motion.study import (
    ClassifiedAttractor,
    Doubt,
    _factor,
    _fading,
    _section,
    _separated,
    _settled,
    _Study,
    _whole_samples,
    decide_attractor,
    written_exponents,
)
from findings.fakes import mode_of

RNG = np.random.default_rng(21)

# --- motion ----------------------------------------------------------------------------------------------------------


def test_tangents_are_made_orthogonal_and_their_growth_is_that_of_the_areas_between_them():
    moved = RNG.normal(size=(5, 3))
    found, grown = orthonormalised(moved)
    np.testing.assert_allclose(found.T @ found, np.eye(3), atol=1e-12)
    areas = [np.sqrt(np.linalg.det(moved[:, :k].T @ moved[:, :k])) for k in (1, 2, 3)]
    np.testing.assert_allclose(np.cumsum(grown), np.log(areas))
    np.testing.assert_allclose(np.abs(found[:, 0]), np.abs(moved[:, 0]) / areas[0])


def test_exponents_are_the_means_after_a_tenth_and_their_errors_those_of_ten_blocks():
    logs = RNG.normal(size=(200, 2)) * 0.01 + [0.02, -0.03]
    logs[:20] += 9.0  # while tangents align
    found = lyapunov_exponents(logs, 0.5)
    counted = logs[20:]
    np.testing.assert_allclose(found.exponent_1_per_s, counted.mean(axis=0) / 0.5)
    blocks = counted.reshape(10, 18, 2).mean(axis=1) / 0.5
    np.testing.assert_allclose(found.standard_error_1_per_s, blocks.std(axis=0, ddof=1) / np.sqrt(10))
    assert found.resolution_1_per_s == pytest.approx(5.0 / found.averaged_s)
    np.testing.assert_allclose(found.running_1_per_s[-1], found.exponent_1_per_s)
    assert found.time_s[-1] == pytest.approx(100.0)


def exponents(values: list[float], errors: list[float], seconds: float = 100.0) -> Exponents:
    return Exponents(np.array(values), np.array(errors), np.array([0.0, seconds]), np.zeros((2, len(values))))


def test_a_longer_record_is_asked_for_by_the_rates_and_the_noise_that_are_not_resolved():
    # Of 100 s rates of 0.05 1/s are resolved; noise falls as the root of the record.
    found = ClassifiedAttractor(Kind.PERIODIC, (5.0,))
    open_ = exponents([0.001, -0.01], [1e-4, 1e-3])
    assert _fading(open_).tolist() == [False, True]
    assert _factor(found, open_) == pytest.approx(2 * 0.05 / 0.01)
    noisy = exponents([0.001, -0.2], [1e-4, 0.2])  # (3 × 0.2 / 0.2)² = 9, which is all noise
    assert _factor(found, noisy) == pytest.approx(9.0)
    lost = exponents([0.001, -0.2], [1e-4, 0.4])  # 36, of which no more than ten
    assert _factor(found, lost) == pytest.approx(10.0)
    assert _factor(found, exponents([0.001, -3.0], [1e-4, 1e-3])) == 2.0
    assert _factor(ClassifiedAttractor(Kind.QUASI_PERIODIC, (5.0, 7.0)), open_) == 2.0  # both should be zero
    assert _separated(exponents([0.001, -1.0], [0.01, 0.2]))
    assert not _separated(exponents([0.001, -1.0], [0.2, 0.2]))


def regime(kind: Kind, *frequencies: float, **more: Any) -> Regime:
    return Regime(kind=kind, cause=Cause.REPEATS, base_frequencies_Hz=frequencies, **more)


def test_an_attractor_that_is_not_determined_says_which_record_it_takes():
    unknown = regime(Kind.UNDECIDED, record_needed_s=30.0)
    found = decide_attractor(unknown, None, None, 10.0, None)
    assert (found.kind, found.doubt, found.record_needed_s) == (Kind.UNDECIDED, Doubt.REGIME, 60.0)
    assert decide_attractor(unknown, None, None, 100.0, None).record_needed_s == 200.0
    slow = regime(Kind.UNDECIDED, 0.25)
    assert decide_attractor(slow, None, None, 10.0, None).record_needed_s == 160.0
    torus = regime(Kind.QUASI_PERIODIC, 5.0, 7.0)
    few = exponents([0.001, -0.2, -0.3], [1e-4, 1e-3, 1e-3])
    found = decide_attractor(torus, None, few, 10.0, 0.5)
    assert (found.doubt, found.zero, found.positive, found.negative) == (Doubt.FEWER_ZEROS, 1, 0, 2)
    cycle = decide_attractor(regime(Kind.PERIODIC, 5.0), None, few, 10.0, 0.5)
    assert (cycle.kind, cycle.frequencies_Hz, cycle.uncertainties_Hz) == (Kind.PERIODIC, (5.0,), (0.0,))
    wild = decide_attractor(regime(Kind.IRREGULAR), None, exponents([0.3, 0.001, -0.5], [1e-3] * 3), 10.0, 0.5)
    assert (wild.kind, wild.positive) == (Kind.CHAOTIC, 1)


def test_what_has_settled_has_no_trend_in_either_of_two_blocks():
    time = np.arange(4000) / 1000.0

    def settles(envelope: np.ndarray, samples: int = 4000, block: float = 1.0) -> bool:
        wave = np.stack([envelope * np.sin(2 * np.pi * 100 * time), 0 * time], axis=1)[:samples]
        chunks: Any = [SimpleNamespace(velocity=wave[:1500]), SimpleNamespace(velocity=wave[1500:])]
        return _settled(chunks, 1000.0, block)

    assert settles(np.exp(0.45e-3 * time))
    assert not settles(np.exp(0.55e-3 * time))  # of 1e-3 in two seconds
    assert settles(np.exp(-5 * np.minimum(time - 2.0, 0)))  # before the last two
    assert not settles(np.exp(0 * time), samples=1999)
    assert settles(np.exp(0 * time), samples=2000)
    assert not settles(np.exp(0.3 * np.sin(2 * np.pi * 0.4 * time)))
    assert _whole_samples(0.30000000000000004, 10.0) == 0.3
    assert _whole_samples(0.31, 10.0) == 0.4


def test_a_section_has_the_points_where_the_main_coordinate_rises_through_its_mean():
    time = np.arange(1000) / 500.0
    turn = 2 * np.pi * 10 * time - 0.2
    q = np.stack([7.0 + 2 * np.sin(turn), 0.5 * np.cos(turn + 0.3), 0 * turn], axis=1)
    v = 2 * np.pi * 10 * np.stack([2 * np.cos(turn), -0.5 * np.sin(turn + 0.3), 0 * turn], axis=1)
    vibration: Any = SimpleNamespace(time=time, displacement=q, velocity=v, coordinates=("X", "Y", "Z"))
    found = _section(vibration, np.array([1.0, 2.0, 9.0]), ("X", "Y"))
    assert (found.across, found.other, found.points) == ("X", "Y", 20)
    # Cubics of 50 to the period: (2π/50)⁴/384 of the amplitude; those of the first sample may be cut off.
    np.testing.assert_allclose(found.values[1:], [[0.5 * np.cos(0.3), 40 * np.pi]] * (len(found.values) - 1), rtol=1e-4)
    assert found.size == pytest.approx((np.ptp(q[:, 1]), np.ptp(v[:, 0])))
    assert _section(vibration, np.array([1.0, 20.0, 9.0]), ("X", "Y")).across == "Y"
    assert _section(vibration, np.ones(3), ()).points == 0


def test_a_record_begins_once_the_motion_has_settled_and_lasts_as_long_as_was_asked(monkeypatch):
    def chunk(k: int) -> Any:
        return SimpleNamespace(
            time=np.array([0.5 * k, 0.5 * k + 0.5]), observation=SimpleNamespace(normal_force=np.array([9.0 - k]))
        )

    chunks = [chunk(k) for k in range(30)]

    def follow(take, progress, what):
        for each in chunks:
            if take(each):
                return

    transient: Any = SimpleNamespace(how={"sample_rate": 10.0}, follow=follow, model=None)
    monkeypatch.setattr(study, "smallest_recorded", lambda model, force: float(force[0]))
    monkeypatch.setattr(study, "pulling", lambda smallest: f"smallest {smallest:g}")
    monkeypatch.setattr(study._Study, "_at_rest", lambda self, kept: False)
    seen = []

    def settles_at(when: float):
        def settled(kept, rate, block):
            seen.append((kept[0].time[0], kept[-1].time[-1], rate, block))
            return kept[-1].time[-1] >= when

        monkeypatch.setattr(study, "_settled", settled)

    settles_at(2.0)
    of = _Study(transient, 3.0, 100.0, 2.0, lambda *_: None)
    assert (of.block, of.interval, of.longest_start) == (0.5, 0.01, 10.0)
    settled, start, kept = of.record()
    assert (settled, start, kept[0].time[0], kept[-1].time[-1]) == (True, 2.0, 1.5, 5.0)
    assert seen[-1] == (0.5, 2.0, 10.0, 0.5)  # what ends within the last two blocks
    assert of.limits == ["smallest 0"]
    settles_at(np.inf)
    settled, start, kept = _Study(transient, 3.0, 100.0, 2.0, lambda *_: None).record()
    assert (settled, start, kept[-1].time[-1]) == (False, 10.0, 13.0)
    late = _Study(transient, 3.0, -1.0, 2.0, lambda *_: None)
    assert late.record()[2] == chunks[:1]
    assert late.limits[0] == "computing was limited to -1 s: the record ends at 0.5 s"


def a_study(duration=3.0, rate=200.0, at_most=100.0, slower=2.0, **more: Any) -> Any:
    """The study of a transient of two coordinates whose one mode has 25 Hz."""
    mode = SimpleNamespace(frequency_Hz=25.0, growth_rate=-4.0, label="X")
    stability = SimpleNamespace(
        steady_state=np.array([7.0, -3.0]), coordinates=("X", "Tz"), mass=np.array([2.0, 0.5]), modes=(mode,),
        oscillations=(mode,), unstable=(), divergence=None,
    )  # fmt: skip
    known: dict[str, Any] = {"model": SimpleNamespace(forced=False, contact=None), "stability": stability}
    transient: Any = SimpleNamespace(how={"sample_rate": rate}, **(known | more))
    return _Study(transient, duration, at_most, slower, lambda *_: None)


def recorded(q: np.ndarray, v: np.ndarray, first: int, rate: float = 200.0) -> Any:
    time = (first + np.arange(len(q))) / rate
    return SimpleNamespace(time=time, displacement=q, velocity=v, changes=())


def test_nearby_motions_are_followed_from_the_end_of_a_chunk_in_units_of_its_size(monkeypatch):
    """A map of which the exponents are known: its factors along four directions that turn."""
    rng, size = np.random.default_rng(3), np.array([2.0, 0.5, 10.0, 4.0])
    factors = np.exp(0.01 * np.array([0.5, -0.2, -1.0, -3.0]))  # of 1/s, over intervals of 10 ms
    turn = np.linalg.qr(rng.normal(size=(4, 4)))[0]
    asked: list[Any] = []

    def neighbours(model, size, state, tangents, interval):
        asked.append((model, size, np.asarray(state), np.asarray(tangents), interval))
        return 0.9 * np.asarray(state), (turn * factors) @ turn.T @ np.asarray(tangents)

    monkeypatch.setattr(study, "state_size", lambda model, q, v: (asked.append((q, v)), size)[1])
    monkeypatch.setattr(study, "neighbours", neighbours)
    of, (q, v) = a_study(), RNG.normal(size=(2, 5, 2))
    found = of.exponents(recorded(q, v, 0))
    np.testing.assert_array_equal(asked[0], [q[-1], v[-1]])
    assert len(asked) == 1 + 300  # 3 s by 10 ms
    state, tangents = np.concatenate([q[-1], v[-1]]) / size, asked[1][3]
    np.testing.assert_allclose(tangents.T @ tangents, np.eye(4), atol=1e-12)
    logs = []
    for model, of_size, at, along, interval in asked[1:]:
        assert (model, interval) == (of.transient.model, 0.01)
        np.testing.assert_array_equal(of_size, size)
        np.testing.assert_allclose(at, state)
        np.testing.assert_allclose(along, tangents)
        tangents, grown = orthonormalised((turn * factors) @ turn.T @ tangents)
        logs.append(grown)
        state = 0.9 * state
    assert found is not None
    wanted = lyapunov_exponents(np.array(logs), 0.01)
    for one, other in zip(found, wanted, strict=True):
        np.testing.assert_allclose(one, other)
    np.testing.assert_allclose(found.exponent_1_per_s.sum(), [0.5 - 0.2 - 1.0 - 3.0])  # areas, wherever they point
    assert of.limits == []


@pytest.mark.parametrize(
    ("lost", "at_most", "enough", "limits"),
    [
        (100, 100.0, True, ["nearby motions were lost after 1 s"]),
        (99, 100.0, False, ["nearby motions were lost after 0.99 s",
            "Lyapunov exponents were not determined: 0.99 s are too short, and 1 s the least"]),
        (-1, -1.0, False, ["computing was limited to -1 s: nearby motions were followed for 0 s",
            "Lyapunov exponents were not determined: 0.01 s are too short, and 1 s the least"]),
    ],
)  # fmt: skip
@pytest.mark.parametrize("of_state", [True, False])
def test_exponents_take_a_hundred_intervals_before_nearby_motions_are_lost(
    monkeypatch, lost, at_most, enough, limits, of_state
):
    calls = []

    def neighbours(model, size, state, tangents, interval):
        calls.append(interval)
        state, tangents = np.array(state), np.array(tangents)
        if len(calls) > lost > 0:
            (state if of_state else tangents[:, 1])[-1] = np.nan
        return state, tangents

    monkeypatch.setattr(study, "state_size", lambda model, q, v: np.ones(4))
    monkeypatch.setattr(study, "neighbours", neighbours)
    of = a_study(at_most=at_most)
    assert (of.exponents(recorded(*RNG.normal(size=(2, 5, 2)), 0)) is not None) == enough  # pyright: ignore[reportCallIssue]
    assert of.limits == limits


def test_a_motion_is_at_rest_where_nothing_drives_it_and_what_is_left_is_small(monkeypatch):
    asked = []

    def ratios(model, vibration, velocity):
        asked.append((vibration, velocity))
        return 0.3 * Criteria.steady, size

    monkeypatch.setattr(study, "boundary_ratios", ratios)
    of, (q, v) = a_study(), RNG.normal(size=(2, 150, 2))
    chunks = [recorded(q[:60], v[:60], 0), recorded(q[60:], v[60:], 60)]
    size = 0.99 * Criteria.steady
    assert of._at_rest(chunks)
    np.testing.assert_allclose(asked[0][0], q - [7.0, -3.0])
    np.testing.assert_array_equal(asked[0][1], v)
    assert not of._at_rest([recorded(q[:101], v[:101], 0)])  # over a block, half a second, and no more
    assert of._at_rest([recorded(q[:102], v[:102], 0)])
    of.transient.stability.modes[0].growth_rate = 4.0
    assert not of._at_rest(chunks)
    of.transient.stability.modes[0].growth_rate = -4.0
    of.transient.model.forced = True
    assert not of._at_rest(chunks)
    of.transient.model.forced, size = False, Criteria.steady
    assert not of._at_rest(chunks)


def test_nearby_motions_are_not_followed_in_space_under_a_force_or_where_it_sticks():
    chunks = [recorded(np.zeros((2, 1)), np.zeros((2, 1)), 0) for _ in range(2)]
    model: Any = SimpleNamespace(body=SimpleNamespace(symmetric=(True, True)), forced=False)
    assert study._no_tangents(model, chunks) == ""
    chunks[1].changes = ((0.1, True),)
    assert "sticks" in study._no_tangents(model, chunks)
    model.forced = True
    assert "force acts" in study._no_tangents(model, chunks)
    model.body.symmetric = (True, False)
    assert "in space" in study._no_tangents(model, chunks)


def test_what_a_motion_is_follows_from_the_second_half_of_its_record(monkeypatch):
    """Of 12 s of two coordinates the first half is another motion; Tz hardly moves."""
    of = a_study(duration=12.0)
    time = np.arange(2400) / 200.0
    turn = 2 * np.pi * 3.7 * time
    x = np.where(time < 6, 5 * np.sin(2 * turn), 2 * np.sin(turn) + 0.3 * np.cos(2 * turn + 0.4))
    slope = 2 * np.pi * 3.7 * (2 * np.cos(turn) - 0.6 * np.sin(2 * turn + 0.4))
    q = np.stack([7 + x, -3 + 1e-9 * np.sin(turn)], axis=1)
    v = np.stack([np.where(time < 6, 4 * np.pi * 3.7 * 5 * np.cos(2 * turn), slope), 0 * turn], axis=1)
    chunks = [recorded(q[:900], v[:900], 400), recorded(q[900:], v[900:], 1300)]
    monkeypatch.setattr(of, "record", lambda: (False, 2.5, chunks))
    asked: dict[str, Any] = {}

    def decays(regime, vibration, late, stability, modes, model):
        asked["late"], asked["modes"] = late, modes
        return regime

    def classified(displacement, rate, *, scale, lowest_frequency):
        asked["classified"] = displacement, rate, scale, lowest_frequency
        return regime(Kind.PERIODIC, 3.7)

    monkeypatch.setattr(study, "decay_to_rest", decays)
    monkeypatch.setattr(study, "classify", classified)
    follows = exponents([1e-4, -2.0, -3.0, -4.0], [1e-5] * 4, seconds=9.0)
    monkeypatch.setattr(of, "exponents", lambda first: follows if first is chunks[0] else None)
    monkeypatch.setattr(study, "_no_tangents", lambda model, given: "" if given is chunks else "other chunks")
    reasons = []
    monkeypatch.setattr(
        study,
        "describe_attractor",
        lambda found, regime, exponents, limited, options: reasons.append((exponents, limited, options)) or "so",
    )
    kept: list[study.SettledMotion] = []
    found = of.find(study.SettledMotion, kept.append)
    # Nearby motions were followed for 9 s of the 12 that were asked for, which the computing time may have limited.
    assert reasons == [(None, None, False), (follows, 100.0, False)]
    displacement, rate, scale, lowest = asked["classified"]
    np.testing.assert_allclose(displacement, (q - [7, -3])[1200:])
    assert (rate, lowest) == (pytest.approx(200.0), 12.5)  # half of the lowest of the modes that oscillate
    np.testing.assert_allclose(scale, np.abs(q - [7, -3]).max(axis=0))
    assert asked["late"] == slice(1200, None)
    assert asked["modes"] == of.transient.stability.modes
    assert (found.recorded_from_s, found.settled, found.recorded_for_s) == (2.5, False, pytest.approx(12.0))
    assert (found.coordinates, found.section.across) == (("X", "Tz"), "X")  # Tz moves by as much as its own size
    assert found.base_frequencies_Hz == (pytest.approx(3.7, rel=1e-6),)
    assert found.explained_fraction == pytest.approx(1.0, abs=1e-3)  # of sums over 22.2 periods
    assert found.lines is not None
    assert found.fundamentals is not None
    assert found.resolution_Hz == found.lines.resolution_Hz
    assert found.base_uncertainties_Hz == tuple(found.fundamentals.uncertainty_Hz)
    assert found.lines.fraction[0] == pytest.approx((4 / 4.09 + 1) / 2, rel=1e-3)  # of both over their rms
    assert (found.kind, found.exponents, found.chaotic) == (Kind.PERIODIC, follows, False)
    assert found.lyapunov_exponents_1_per_s == (1e-4, -2.0, -3.0, -4.0)
    assert found.lyapunov_standard_errors_1_per_s == (1e-5,) * 4
    assert found.lyapunov_uncertainties_1_per_s == (pytest.approx(5.0 / 9.0),) * 4
    assert found.not_determined == ("the motion had not settled after 2.5 s",)
    (before,) = kept
    assert before.exponents is None
    assert before.not_determined == (*found.not_determined, study.CUT_OFF)
    # Of what oscillates no more an unstable mode counts, and of what rests there are no lines.
    of.limits.clear()
    of.transient.stability.unstable = (SimpleNamespace(frequency_Hz=9.0),)
    monkeypatch.setattr(study, "classify", lambda *_, lowest_frequency, **__: asked.update(lowest=lowest_frequency))
    monkeypatch.setattr(study, "decay_to_rest", lambda *_: regime(Kind.STEADY))
    rests = of.find(study.SettledMotion, kept.append)
    assert asked["lowest"] == 4.5
    assert (rests.lines, rests.exponents, rests.kind, rests.not_determined) == (None, None, Kind.STEADY, ())
    assert len(kept) == 1
    of.transient.stability.unstable = of.transient.stability.oscillations = ()
    of.find(study.SettledMotion, kept.append)
    assert asked["lowest"] == pytest.approx(Criteria.periods / 12.0)


def test_a_scene_is_run_for_five_seconds_and_its_record_and_a_model_for_as_many_periods(nominal, monkeypatch):
    seen, asked = {}, {}

    class Studies:
        def __init__(self, *given: Any) -> None:
            seen["given"] = given

        def find(self, begin, keep):
            return begin

    monkeypatch.setattr(study, "_Study", Studies)
    monkeypatch.setattr(study, "constant_transient", lambda scene: scene)
    begin = study.study_motion(nominal, 0.3, at_most=7.0)
    scene, length, at_most, slower, _ = seen["given"]
    assert (begin.func, begin.keywords) == (study.MotionStudy, {"scene": nominal})  # pyright: ignore[reportAttributeAccessIssue]
    assert (scene.simulate.duration, length, at_most, slower) == (pytest.approx(5.3), 0.3, 7.0, 1.0)
    study.study_motion(nominal)
    scene, length, at_most, *_ = seen["given"]
    assert (scene.simulate.duration, length, at_most) == (10.0, 5.0, 600.0)

    def made(model, start, **how):
        asked.update(how, start=start)
        oscillations = [SimpleNamespace(frequency_Hz=f) for f in (80.0, 20.0)]
        return study.motion.Transient(
            model, SimpleNamespace(oscillations=oscillations), np.zeros(1), np.zeros(1), how  # pyright: ignore[reportArgumentType]
        )  # fmt: skip

    monkeypatch.setattr(study.motion, "constant_transient", made)
    model: Any = object()
    begin = study.study_motion(model, {"displacement": {"X": 1.0}}, 30.04, sample_rate=10.0, tolerance=3e-7, solver="s")
    transient, length, at_most, slower, _ = seen["given"]
    assert begin is study.SettledMotion
    assert transient.how == {
        "duration": pytest.approx(5 * 50 + 30.1), "sample_rate": 10.0, "tolerance": 3e-7, "solver": "s",
    }  # fmt: skip
    assert asked == {"start": {"displacement": {"X": 1.0}}, **transient.how, "duration": 30.04}
    assert (length, at_most, slower) == (30.04, 600.0, 50.0)


def test_lines_are_written_with_what_they_are_combinations_of():
    lines = Lines(
        np.array([40.0, 25.5, 7.25]), np.array([0.1, 0.2, 0.3]), np.array([[3 + 4j, 1j], [-2.0, 0.5], [0.25j, 6 - 8j]]),
        np.array([0.7, 0.2, 0.1]), 0.0, 0.5,
    )  # fmt: skip
    combinations = np.array([[1, 0], [4, -1], [0, 0]])
    found = Fundamentals(np.array([40.0, 134.5]), np.array([0.01, 0.02]), combinations, 0.9876)
    of: Any = SimpleNamespace(lines=lines, fundamentals=found, coordinates=("X", "Tz"))
    table = pd.read_csv(io.StringIO(motion_answer.lines_table(of)))
    assert table.columns.tolist() == [
        "frequency_Hz", "uncertainty_Hz", "share_of_variance", "combination", "k1", "k2", "amplitude_X_m",
        "amplitude_Tz_rad",
    ]  # fmt: skip
    np.testing.assert_allclose(table["frequency_Hz"], lines.frequency_Hz)
    np.testing.assert_allclose(table["uncertainty_Hz"], lines.uncertainty_Hz)
    np.testing.assert_allclose(table["share_of_variance"], lines.fraction)
    np.testing.assert_array_equal(table[["k1", "k2"]], combinations)
    np.testing.assert_allclose(table[["amplitude_X_m", "amplitude_Tz_rad"]], [[5, 1], [2, 0.5], [0.25, 10]])
    assert table["combination"].fillna("").tolist() == ["f1", "4f1−f2", ""]
    assert [motion_answer.combination(list(each)) for each in ((-1, 1), (0, -3), (2, 2))] == [
        "−f1+f2",
        "−3f2",
        "2f1+2f2",
    ]
    console = Console(width=200, record=True, file=io.StringIO())
    of = SimpleNamespace(
        settled=False, kind=Kind.PERIODIC, recorded_from_s=2.5, recorded_for_s=12.0, lines=lines,
        fundamentals=found,
        exponents=exponents([0.3, -2.0], [1e-3, 1e-3]), not_determined=("so",), reason="It repeats.",
    )  # fmt: skip
    motion_answer.print_study(console, of)
    of.settled, of.exponents, of.not_determined, of.kind = True, None, (), Kind.UNDECIDED
    of.fundamentals = found._replace(frequency_Hz=np.array([40.0]), uncertainty_Hz=np.array([0.01]))
    motion_answer.print_study(console, of)
    of.settled, of.kind, of.fundamentals = False, Kind.STEADY, None
    motion_answer.print_study(console, of)
    assert console.export_text().splitlines() == [
        "Recorded from 2.5 s (not settled) for 12 s",
        "Fundamental frequencies 40.00 and 134.50 Hz: combinations of them are 2 of 3 lines, 98.760 % of the variance",
        f"Lyapunov exponents {', '.join(written_exponents(exponents([0.3, -2.0], [1e-3, 1e-3])))} 1/s",
        "Limited: so",
        "The motion is periodic. It repeats.",
        "Recorded from 2.5 s (settled) for 12 s",
        "Fundamental frequency 40.00 Hz: multiples of it are 2 of 3 lines, 98.760 % of the variance",
        "The kind of motion is not determined. It repeats.",
        "Recorded from 2.5 s (decaying) for 12 s",
        "The motion is steady. It repeats.",
    ]


# --- accuracy --------------------------------------------------------------------------------------------------------


def reference_of(states: np.ndarray, monkeypatch) -> Reference:
    monkeypatch.setattr(reference, "sizes_of", lambda wanted, model: np.abs(wanted).max(axis=0))
    return Reference(np.arange(6.0), states, states + 0.1, states - 0.3, None)  # pyright: ignore[reportArgumentType]


def test_errors_are_over_the_size_of_each_state_up_to_a_time(monkeypatch):
    states = np.array([[1.0, 10.0], [2.0, -20.0], [-4.0, 5.0], [3.0, 9.0], [9.0, 99.0], [1.0, 1.0]])
    found = reference_of(states, monkeypatch)
    assert found.uncertainty(3.0) == pytest.approx(0.1 / 4)
    assert found.confirmed(4.5) == pytest.approx(0.3 / 9)
    other = np.vstack([states, [[7.0, 7.0]]])
    other[1, 1] += 3.0
    assert found.error(other, 1.0) == pytest.approx(3.0 / 20)
    assert found.error(other, 0.5) == 0.0
    assert trajectory_error(other[:6], states, np.array([1.0, 2.0])) == 1.5


def test_a_state_that_hardly_moves_is_measured_against_what_the_energy_would_give_it(monkeypatch):
    states = np.array([[0.0, 1e-9, 3.0, 1e-9], [2.0, 1e-9, 0.0, 1e-9], [0.1, 1e-9, 0.1, 1e-9]])
    asked = []

    def motion_scale(model, state):
        asked.append((np.asarray(state.vibration).tolist(), np.asarray(state.velocity).tolist()))
        return SimpleNamespace(flat=lambda: np.array([1.0, 2.0, 3.0, 4.0, 99.0]))

    monkeypatch.setattr(reference, "motion_scale", motion_scale)
    model: Any = SimpleNamespace(
        names=("X", "Y"), mass=np.array([2.0, 1.0]), stiffness=np.array([[4.0, 0.0], [0.0, 1.0]])
    )
    np.testing.assert_allclose(sizes_of(states, model), [2.0, 0.02, 3.0, 0.04])
    assert asked == [([0.0, 1e-9], [3.0, 1e-9])]  # 2 × 9 is more than 4 × 4


def test_features_are_compared_with_the_best_ones_growth_with_an_e_fold_at_least():
    best = {
        ("growth_rate", "X"): -4.0,
        ("growth_rate", "Y"): 0.1,
        ("amplitude", "Y"): 2.0,
        ("main_frequency", ""): 50.0,
    }
    found = {
        ("growth_rate", "X"): -5.0,
        ("growth_rate", "Y"): 0.3,
        ("amplitude", "Y"): 2.5,
        ("main_frequency", ""): 49.0,
    }
    assert feature_errors(best, found, 2.0) == RelativeChange(pytest.approx(0.4), None, 0.25, 0.02)  # 0.2 over 1/2  # pyright: ignore[reportArgumentType]
    assert feature_errors(best, found, 20.0).growth_rate == pytest.approx(2.0)
    del found["amplitude", "Y"]
    assert feature_errors(best, found, 2.0).amplitude == math.inf


def measured(
    evaluations: float, trajectory: float | None = 1e-5, energy: float = 1e-6, whole: bool = True, **features: Any
) -> Measurement:
    configuration: Any = SimpleNamespace(whole=whole)
    known_: dict[str, Any] = {"growth_rate": 1e-6, "onset_frequency": None, "amplitude": 1e-6, "main_frequency": None}
    errors = Errors(trajectory, None, RelativeChange(**(known_ | features)), energy)
    return Measurement(configuration, Ending.COMPLETE, 2.0, (3.0, 1.0, 2.0), 0.5, evaluations, errors)


def test_the_cheapest_meets_the_target_in_all_that_is_measured():
    scatter = RelativeChange(0.0, None, 2e-4, None)
    of: Any = SimpleNamespace(
        reference=SimpleNamespace(uncertainty=lambda end: 1e-9 if end == 7.0 else 1.0), growth_end=7.0, scatter=scatter
    )
    good = measured(50.0)
    wrong = [
        measured(10.0, trajectory=1.1e-4), measured(11.0, energy=1.1e-4), measured(12.0, growth_rate=1.1e-4),
        measured(13.0, amplitude=4.1e-4), measured(14.0, whole=False), measured(15.0, trajectory=None),
        measured(16.0, amplitude=math.inf), dataclasses.replace(measured(17.0), errors=None),
    ]  # fmt: skip
    assert accuracy_study._cheapest(of, [*wrong, measured(60.0), good], 1e-4) is good
    spread = measured(20.0, amplitude=3.9e-4)  # within twice its scatter
    assert accuracy_study._cheapest(of, [*wrong, spread, good], 1e-4) is spread
    assert accuracy_study._cheapest(of, wrong, 1e-4) is None
    of.growth_end = 8.0
    assert accuracy_study._cheapest(of, [good], 1e-4) is None  # the reference is no better
    assert (good.time_per_ms, good.evaluations_per_ms) == (1.0, 0.025)
    assert good.errors is not None
    assert good.errors.largest_feature == 1e-6


def test_a_nearby_trajectory_separates_at_a_hundred_times_what_it_began_with(monkeypatch):
    of = bench.Benchmark.__new__(bench.Benchmark)
    start = SimpleNamespace(displacement={"X": 1.0, "Y": 2.0}, velocity={"X": 3.0})
    start.__iter__ = None
    pairs = [("displacement", start.displacement), ("velocity", start.velocity)]

    class Table(SimpleNamespace):
        def __iter__(self):
            return iter(pairs)

    asked: dict[str, Any] = {}
    of.prepared = SimpleNamespace(scene=SimpleNamespace(start=Table(**vars(start))), model=None)  # pyright: ignore[reportAttributeAccessIssue]
    of.time = np.arange(5.0)
    monkeypatch.setattr(of, "_precisely", lambda tolerance, start: asked.update(tolerance=tolerance, start=start))
    monkeypatch.setattr(of, "_run", lambda prepared, what: None)
    monkeypatch.setattr(bench, "sizes_of", lambda vibration, model: np.array([100.0, 100.0]))
    vibration = np.array([[1.0, 50.0]] * 5)
    apart = np.array([[0, 0], [0, 4.99e-6], [1.9e-7, 9.9e-6], [2.1e-7, 0], [0, 0]])
    monkeypatch.setattr(of, "_vibration", lambda chunks: vibration + apart)
    assert of._separation(vibration) == 3.0  # of two that are nudged, 2e-7 of the larger of a state and 1
    assert asked["start"]["start.displacement"] == {"X": 1 + 1e-9, "Y": 2 * (1 + 2e-9)}
    assert asked["tolerance"] == bench.TIGHTEST
    monkeypatch.setattr(of, "_vibration", lambda chunks: vibration)
    assert of._separation(vibration) is None


# --- what changes ----------------------------------------------------------------------------------------------------


def answer(**changed: Any) -> SceneAnswer:
    usual: dict[str, Any] = {
        "modes": {"X": mode_of(100.0, -4.0), "Y": mode_of(50.0, 0.0)},
        "unstable": (),
        "amplitude": {"X": 2.0, "Y": 0.5},
        "carriers": ("X", "Y"),
        "main": SpectralLine("X", 80.0, 1.0),
        "rotation": 0.0,
    }
    return SceneAnswer(**(usual | changed))


def test_changes_are_the_largest_relative_ones_with_their_sign():
    other = answer(
        modes={"X": mode_of(98.0, -3.0), "Y": mode_of(51.5, 1e-6)},
        amplitude={"X": 2.2, "Y": 0.4},
        main=SpectralLine("Y", 78.0, 1.0),
    )
    found = change_of(answer(), other)
    assert found.growth_rate == pytest.approx(0.25)  # of Y, 1e-6 over 2π 50e-6 × 2
    assert found.onset_frequency == pytest.approx(0.03)
    assert found.amplitude == pytest.approx(-0.2)
    assert found.main_frequency == pytest.approx(78 / 80 - 1)
    small = change_of(answer(), answer(modes={"X": mode_of(100.0, -4.0), "Y": mode_of(50.0, -3e-4)}))
    assert small.growth_rate == pytest.approx(-3e-4 / (1e-6 * 2 * 2 * math.pi * 50 / 2))
    assert change_of(answer(), answer(main=None)).main_frequency == LOST
    assert change_of(answer(carriers=()), answer()).amplitude == LOST
    assert change_of(answer(main=None), answer(main=None)).main_frequency is None


def test_an_excess_is_the_largest_change_over_its_limit_or_its_noise():
    change = RelativeChange(0.02, -0.03, None, 0.5)
    assert excess_of(change, None, 0.01) == pytest.approx(50.0)
    assert excess_of(change, RelativeChange(0.005, -0.06, None, math.inf), 0.01) == pytest.approx(2.0)
    assert excess_of(None, None, 0.01) == math.inf
    assert excess_of(RelativeChange(None, None, None, None), None, 0.01) == 0.0
    assert (
        excess_of(RelativeChange(5.0, 5.0, 5.0, 5.0), RelativeChange(*[math.inf] * 4), 0.01) == 0.0
    )  # noise hides all of it


def variant(label: str, time: float, **more: Any) -> Variant:
    scene: Any = SimpleNamespace(simulate=SimpleNamespace(duration=0.5))
    return Variant(label, (), scene, Ending.COMPLETE, time, 10.0, **more)


def test_of_runs_that_are_timed_again_each_chunk_counts_by_its_fastest_time():
    run = variants_module._Run(variant("so", 9.0), None, [[3.0, 1.0], [2.0, 4.0], [5.0, 0.5]])
    of = variants_module.VariantRuns.__new__(variants_module.VariantRuns)
    assert of._fastest(run).time_per_ms == pytest.approx((2.0 + 0.5) / 0.5)
    once = run._replace(times=[[3.0, 1.0]])
    assert of._fastest(once).time_per_ms == 9.0
    asked = []
    of._time = lambda label, prepared, chunks, seconds: asked.append(label) or seconds.append(0.4)
    prepared: Any = object()
    for times, again in (([[9.9]], True), ([[10.0]], False), ([[0.3], [0.6]], True), ([[0.3], [0.7]], False)):
        asked.clear()
        given = variants_module._Run(variant("so", 9.0, answer=answer()), prepared, [list(each) for each in times])
        of._time_again(given)
        assert (asked == ["so, timed again"]) == again
        assert len(given.times) == len(times) + again


def test_a_verdict_tells_the_fraction_of_the_time_that_is_left():
    reduction: Any = SimpleNamespace(effect="separation", becomes="bonded", leaves_shoe=False, shoe=None)
    whole = variant("whole scene", 10.0)
    for time, words in ((4.2, "about 40 % of the time"), (9.5, "as long"), (31.0, "about 3 times as long")):
        reduced = dataclasses.replace(
            variant("together", time), reductions=(reduction,), change=RelativeChange(0.003, None, -0.004, None)
        )
        said = describe_verdict(0.01, [whole, reduced], [], (reduction,))
        assert said.endswith(f"and the run takes {words}.")
        assert "growth rates, amplitude at the end change by 0.4 % at most" in said
