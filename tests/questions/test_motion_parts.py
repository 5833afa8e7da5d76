"""The parts of the studies of motion, accuracy and effects, against sums written out."""

import dataclasses
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.findings.answers import LOST, Answer, Change, ModeAnswer, change_of, known
from drumsqueal.findings.saturation import Line
from drumsqueal.findings.signals.lyapunov import Exponents, lyapunov_exponents, orthonormalised
from drumsqueal.findings.signals.regime import Kind as RegimeKind
from drumsqueal.findings.signals.regime import Regime
from drumsqueal.findings.signals.regime_words import Cause
from drumsqueal.outcome import Ending
from drumsqueal.questions.accuracy import bench, reference
from drumsqueal.questions.accuracy import study as accuracy_study
from drumsqueal.questions.accuracy.bench import Errors, Measurement, feature_errors
from drumsqueal.questions.accuracy.reference import Reference, sizes_of, trajectory_error
from drumsqueal.questions.effects import variants as variants_module
from drumsqueal.questions.effects.study import describe_verdict, excess_of
from drumsqueal.questions.effects.variants import Variant
from drumsqueal.questions.motion import study
from drumsqueal.questions.motion.attractor import Attractor, Doubt, Kind, _factor, _fading, _separated, decide_attractor
from drumsqueal.questions.motion.study import _section, _settled, _Study, _whole_samples

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
    found = Attractor(Kind.PERIODIC, (5.0,))
    open_ = exponents([0.001, -0.01], [1e-4, 1e-3])
    assert _fading(open_).tolist() == [False, True]
    assert _factor(found, open_) == pytest.approx(2 * 0.05 / 0.01)
    noisy = exponents([0.001, -0.2], [1e-4, 0.2])  # (3 × 0.2 / 0.2)² = 9, which is all noise
    assert _factor(found, noisy) == pytest.approx(9.0)
    lost = exponents([0.001, -0.2], [1e-4, 0.4])  # 36, of which no more than ten
    assert _factor(found, lost) == pytest.approx(10.0)
    assert _factor(found, exponents([0.001, -3.0], [1e-4, 1e-3])) == 2.0
    assert _factor(Attractor(Kind.QUASI_PERIODIC, (5.0, 7.0)), open_) == 2.0  # both should be zero
    assert _separated(exponents([0.001, -1.0], [0.01, 0.2]))
    assert not _separated(exponents([0.001, -1.0], [0.2, 0.2]))


def regime(kind: RegimeKind, *frequencies: float, **more: Any) -> Regime:
    return Regime(kind=kind, cause=Cause.REPEATS, base_frequencies_Hz=frequencies, **more)


def test_an_attractor_that_is_not_determined_says_which_record_it_takes():
    unknown = regime(RegimeKind.UNKNOWN, record_needed_s=30.0)
    found = decide_attractor(unknown, None, None, 10.0, None)
    assert (found.kind, found.doubt, found.record_needed_s) == (Kind.NOT_DETERMINED, Doubt.REGIME, 60.0)
    assert decide_attractor(unknown, None, None, 100.0, None).record_needed_s == 200.0
    slow = regime(RegimeKind.UNKNOWN, 0.25)
    assert decide_attractor(slow, None, None, 10.0, None).record_needed_s == 160.0
    torus = regime(RegimeKind.QUASI_PERIODIC, 5.0, 7.0)
    few = exponents([0.001, -0.2, -0.3], [1e-4, 1e-3, 1e-3])
    found = decide_attractor(torus, None, few, 10.0, 0.5)
    assert (found.doubt, found.zero, found.positive, found.negative) == (Doubt.FEWER_ZEROS, 1, 0, 2)
    cycle = decide_attractor(regime(RegimeKind.PERIODIC, 5.0), None, few, 10.0, 0.5)
    assert (cycle.kind, cycle.frequencies_Hz, cycle.uncertainties_Hz) == (Kind.PERIODIC, (5.0,), (0.0,))
    wild = decide_attractor(regime(RegimeKind.IRREGULAR), None, exponents([0.3, 0.001, -0.5], [1e-3] * 3), 10.0, 0.5)
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
    assert feature_errors(best, found, 2.0) == Change(pytest.approx(0.4), None, 0.25, 0.02)  # 0.2 over 1/2  # pyright: ignore[reportArgumentType]
    assert feature_errors(best, found, 20.0).growth_rate == pytest.approx(2.0)
    del found["amplitude", "Y"]
    assert feature_errors(best, found, 2.0).amplitude == math.inf


def measured(
    evaluations: float, trajectory: float | None = 1e-5, energy: float = 1e-6, whole: bool = True, **features: Any
) -> Measurement:
    contender: Any = SimpleNamespace(whole=whole)
    known_: dict[str, Any] = {"growth_rate": 1e-6, "onset_frequency": None, "amplitude": 1e-6, "main_frequency": None}
    errors = Errors(trajectory, None, Change(**(known_ | features)), energy)
    return Measurement(contender, Ending.COMPLETE, 2.0, (3.0, 1.0, 2.0), 0.5, evaluations, errors)


def test_the_cheapest_meets_the_target_in_all_that_is_measured():
    scatter = Change(0.0, None, 2e-4, None)
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
    of = bench.Bench.__new__(bench.Bench)
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


def answer(**changed: Any) -> Answer:
    usual: dict[str, Any] = {
        "modes": {"X": ModeAnswer(100.0, -4.0), "Y": ModeAnswer(50.0, 0.0)},
        "unstable": (),
        "amplitude": {"X": 2.0, "Y": 0.5},
        "carriers": ("X", "Y"),
        "main": Line("X", 80.0, 1.0),
        "rotation": 0.0,
    }
    return Answer(**(usual | changed))


def test_changes_are_the_largest_relative_ones_with_their_sign():
    other = answer(
        modes={"X": ModeAnswer(98.0, -3.0), "Y": ModeAnswer(51.5, 1e-6)},
        amplitude={"X": 2.2, "Y": 0.4},
        main=Line("Y", 78.0, 1.0),
    )
    found = change_of(answer(), other)
    assert found.growth_rate == pytest.approx(0.25)  # of Y, 1e-6 over 2π 50e-6 × 2
    assert found.onset_frequency == pytest.approx(0.03)
    assert found.amplitude == pytest.approx(-0.2)
    assert found.main_frequency == pytest.approx(78 / 80 - 1)
    small = change_of(answer(), answer(modes={"X": ModeAnswer(100.0, -4.0), "Y": ModeAnswer(50.0, -3e-4)}))
    assert small.growth_rate == pytest.approx(-3e-4 / (1e-6 * 2 * 2 * math.pi * 50 / 2))
    assert change_of(answer(), answer(main=None)).main_frequency == LOST
    assert change_of(answer(carriers=()), answer()).amplitude == LOST
    assert change_of(answer(main=None), answer(main=None)).main_frequency is None
    assert (known(math.nan), known(None), known(2.0)) == (None, None, 2.0)


def test_an_excess_is_the_largest_change_over_its_limit_or_its_noise():
    change = Change(0.02, -0.03, None, 0.5)
    assert excess_of(change, None, 0.01) == pytest.approx(50.0)
    assert excess_of(change, Change(0.005, -0.06, None, math.inf), 0.01) == pytest.approx(2.0)
    assert excess_of(None, None, 0.01) == math.inf
    assert excess_of(Change(None, None, None, None), None, 0.01) == 0.0


def variant(label: str, time: float, **more: Any) -> Variant:
    scene: Any = SimpleNamespace(simulate=SimpleNamespace(duration=0.5))
    return Variant(label, (), scene, Ending.COMPLETE, time, 10.0, **more)


def test_of_runs_that_are_timed_again_each_chunk_counts_by_its_fastest_time():
    run = variants_module._Run(variant("so", 9.0), None, [[3.0, 1.0], [2.0, 4.0], [5.0, 0.5]])
    of = variants_module.Bench.__new__(variants_module.Bench)
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
            variant("together", time), reductions=(reduction,), change=Change(0.003, None, -0.004, None)
        )
        said = describe_verdict(0.01, [whole, reduced], [], (reduction,))
        assert said.endswith(f"and the run takes {words}.")
        assert "growth rates, amplitude at the end change by 0.4 % at most" in said
