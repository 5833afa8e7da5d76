"""How many transients end, by the last part of each: their numbers against those of records known in closed form."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.dynamics import saturated as module
from drumsqueal.dynamics.saturated import (
    IntegratorOptions,
    _fluctuation,
    _looked_at,
    _over_cycles,
    _Part,
    saturated_motions,
    strongest_line,
)
from drumsqueal.errors import COMPLETE
from drumsqueal.findings.decay import Rest

RATE, MASS = 1000.0, np.array([2.0, 0.03])
TIME = np.arange(4001) / RATE
MODEL: Any = SimpleNamespace(names=("X", "Tz"), mass=MASS)


@pytest.fixture(autouse=True)
def plain_model(monkeypatch) -> dict[str, Any]:
    """Have what takes a model give what shows how it was asked."""
    asked: dict[str, Any] = {"least": 1e-12}
    monkeypatch.setattr(module, "boundary_ratios", lambda model, q, v: (float(q[0, 0]), float(v[-1, 1])))
    monkeypatch.setattr(module, "least_energy", lambda model: asked["least"])
    monkeypatch.setattr(module, "smallest_force", lambda model, q: float(np.sum(q)))

    def find_rest(*given):
        asked["rest"] = given
        return Rest(near=False)

    monkeypatch.setattr(module, "find_rest", find_rest)
    return asked


def part_of(q: np.ndarray, v: np.ndarray, sticks=None, start: int = 0, chunk: int = 977) -> _Part:
    part = _Part(start)
    for first in range(0, len(q), chunk):
        some = slice(first, first + chunk)
        part.add(q[some], v[some], np.zeros(len(q), bool)[some] if sticks is None else sticks[some])
    return part


def test_a_part_keeps_its_samples_from_its_start_on_and_the_lowest_of_all():
    q, v = np.random.default_rng(0).normal(size=(2, 100, 2))
    q[5] = -9.0
    sticks = np.arange(100) % 3 == 0
    for start in (0, 29, 30, 31, 99):
        part = part_of(q, v, sticks, start, chunk=10)
        for kept, whole in zip(zip(*part.kept, strict=True), (q, v, sticks), strict=True):
            np.testing.assert_array_equal(np.concatenate(kept), whole[start:])
        assert part.samples == 100
        np.testing.assert_array_equal(part.lowest, [-9.0, -9.0])


def growing(rate: float = -0.2) -> tuple[np.ndarray, np.ndarray]:
    """X at 50 Hz with 1 mm and Tz at 120 Hz with 30 mrad, which change at a rate (1/s)."""
    envelope = np.exp(rate * TIME)[:, None] * [1e-3, 0.03]
    turn = np.array([50.0, 120.0]) * 2 * np.pi
    q = envelope * np.sin(TIME[:, None] * turn + [0.3, 1.0])
    return q, envelope * (turn * np.cos(TIME[:, None] * turn + [0.3, 1.0]) + rate * q / envelope)


def test_a_motion_has_the_numbers_of_its_last_part(plain_model):
    q, v = growing()
    matrix = np.arange(16.0).reshape(4, 4)
    steady = np.array([4.0, 8.0])
    found = _looked_at(part_of(q, v, start=2000), MODEL, steady, matrix, RATE)
    q, v = q[2000:], v[2000:]
    np.testing.assert_allclose(found.amplitude, (q.max(axis=0) - q.min(axis=0)) / 2)
    np.testing.assert_allclose(found.rms, np.sqrt(((q - q.mean(axis=0)) ** 2).mean(axis=0)))
    assert found.boundary_ratios == (q[0, 0], v[-1, 1])
    assert (found.seconds, found.outcome, found.trend) == (2.0, COMPLETE, "decays")
    # m v²/2 is 2 × 0.314²/4 and 0.03 × 22.6²/4 at 0 s; the windowed means of e^(−0.4 t) about 2.5 s and 3.5 s, of
    # windows ½ (1 − cos) 1 s long, are those of their middles to (0.4 × 0.18)²/2 = 0.3 %.
    of_X, of_Tz = (m * (2 * np.pi * f * a) ** 2 / 4 for m, f, a in zip(MASS, (50, 120), (1e-3, 0.03), strict=True))
    kinetic = (of_X + of_Tz) * np.mean(np.exp(-0.4 * np.array([2.5, 3.5])))
    assert found.kinetic_energy == pytest.approx(kinetic, rel=4e-3)
    assert found.rate == pytest.approx(-0.2, rel=1e-3)
    assert found.drift == pytest.approx(np.exp(-0.2) - 1, rel=1e-3)
    assert (found.line, found.frequency_Hz) == ("Tz", pytest.approx(120.0, abs=0.02))
    np.testing.assert_array_equal([found.vibration, found.velocity], [q[-1], v[-1]])
    assert found.smallest_force == pytest.approx(12.0 + growing()[0].min(axis=0).sum())
    assert (found.at_rest, found.sticking, found.phases, found.failed) == (False, 0.0, 0, False)
    # Of five parts that overlap by half, 0.67 s long each and 0.33 s apart, but for the ends of the window.
    levels = np.exp(-0.4 / 3 * np.arange(5))
    assert found.fluctuation == pytest.approx(np.std(levels) / np.mean(levels) / 2, rel=3e-3)
    model, at, linear, pieces, step = plain_model["rest"]
    assert (model, at is steady, linear is matrix, step) == (MODEL, True, True, 1 / RATE)
    np.testing.assert_array_equal(pieces[0], (q, v))
    assert found.rest == Rest(near=False)
    assert _looked_at(part_of(q, v), MODEL, steady, None, RATE).rest == Rest(near=True)


@pytest.mark.parametrize(("rate", "trend"), [(0.0, "settled"), (0.06, "settled"), (0.2, "grows"), (-0.2, "decays")])
def test_what_changes_by_a_tenth_from_half_to_half_has_not_settled(rate, trend):
    assert _looked_at(part_of(*growing(rate), start=1000), MODEL, np.zeros(2), None, RATE).trend == trend


def test_what_has_less_energy_than_is_resolved_is_at_rest(plain_model):
    q, v = growing(0.0)
    energy = _looked_at(part_of(q, v), MODEL, np.zeros(2), None, RATE).kinetic_energy
    for least, rests in ((1.99 * energy, False), (2.01 * energy, True)):
        plain_model["least"] = least
        found = _looked_at(part_of(q, v), MODEL, np.zeros(2), None, RATE)
        assert (found.at_rest, found.trend == "at rest", found.frequency_Hz is None) == (rests, rests, rests)
        assert (found.fluctuation == 0.0) == rests
    plain_model["least"] = 0.0
    assert _looked_at(part_of(0 * q + 1.0, 0 * v), MODEL, np.zeros(2), None, RATE).at_rest


def test_what_grows_without_bound_has_failed():
    q, v = growing(0.0)
    for sign in (1, -1):
        huge = v.copy()
        huge[3000, 1] = sign * 1.1e70
        found = _looked_at(part_of(q, huge), MODEL, np.ones(2), None, RATE)
        assert (found.outcome, found.trend) == ("failed: the motion grows without bound", "failed")
        assert np.isnan([*found.amplitude, *found.rms, *found.boundary_ratios, *found.vibration, *found.velocity]).all()
        assert np.isnan(found.kinetic_energy)
        assert (found.seconds, found.frequency_Hz) == (0.0, None)
        assert found.smallest_force == pytest.approx(2.0 + q.min(axis=0).sum())
    huge[3000, 1] = 0.9e70
    assert _looked_at(part_of(q, huge, start=3500), MODEL, np.ones(2), None, RATE).outcome == COMPLETE


def test_of_slow_stick_slip_the_energy_is_that_of_whole_cycles():
    # Cycles of 0.9 s, of which 0.7 s stick; it slips at 2 m/s. The record begins and ends within one.
    phase = (np.arange(4001) + 150) % 900
    sticks, v = phase < 700, np.zeros((4001, 2))
    v[~sticks, 0] = 2.0
    found = _looked_at(part_of(np.cumsum(v, axis=0), v, sticks), MODEL, np.zeros(2), None, RATE)
    assert (found.phases, found.sticking) == (4, pytest.approx(np.mean(sticks)))
    assert found.kinetic_energy == pytest.approx(2.0 * 4.0 / 2 * 2 / 9, rel=1e-12)
    assert (found.rate, found.fluctuation) == (0.0, pytest.approx(0.0, abs=1e-12))
    # What sticks for less than half of the time is not looked at by cycles.
    short = _looked_at(part_of(np.cumsum(v, axis=0), v, phase < 400), MODEL, np.zeros(2), None, RATE)
    assert short.kinetic_energy != pytest.approx(2.0 * 4.0 / 2 * 2 / 9, rel=1e-3)


def test_squares_become_means_over_their_cycles():
    squares = np.arange(20.0)[:, None] * [1.0, -2.0]
    found = _over_cycles(squares, np.array([3, 8, 15]))
    first, second = np.mean(np.arange(3, 8)), np.mean(np.arange(8, 15))
    np.testing.assert_allclose(found[:, 0], [first] * 8 + [second] * 12)
    np.testing.assert_allclose(found[:, 1], -2 * found[:, 0])
    # Lengths of 5 and 6 samples are those of one period of 5.5.
    sums = np.sum(np.arange(3, 8)) / 5.5, np.sum(np.arange(8, 14)) / 5.5
    np.testing.assert_allclose(_over_cycles(squares, np.array([3, 8, 14]))[:, 0], [sums[0]] * 8 + [sums[1]] * 12)


def test_an_rms_fluctuates_by_half_as_much_as_the_energies_of_five_parts():
    # Steps of energy that the five windows of two sixths see; a coordinate of less than a hundredth does not count.
    squares = np.repeat(np.array([[1.0, 9.0, 5.0, 7.0, 3.0, 4.0]]).T, 300, axis=0) * [1.0, 0.0, 3.0]
    squares[:, 1] = np.linspace(0.0, 1.0, 1800) * 2.0
    mass = np.array([2.0, 0.05, 0.1])
    window = np.sin(np.pi * np.arange(1, 601) / 601) ** 2
    energies = np.array([window @ squares[k : k + 600] for k in range(0, 1201, 300)]) * mass
    spread = energies.std(axis=0) / energies.mean(axis=0)
    assert energies[:, 1].mean() < 0.01 * energies.mean(axis=0).sum()
    assert spread[1] > spread[0]
    assert _fluctuation(squares, mass) == pytest.approx(spread[0] / 2)


def test_the_strongest_line_is_that_with_most_kinetic_energy():
    time = np.arange(2048) / 2048.0
    velocity = np.stack([3.0 * np.sin(2 * np.pi * 100 * time), 2.0 * np.cos(2 * np.pi * 333 * time), 0 * time], axis=1)
    for mass, line, frequency in (([1.0, 2.0, 9.0], "X", 100.0), ([1.0, 2.4, 9.0], "Y", 333.0)):
        found = strongest_line(velocity, np.array(mass), ("X", "Y", "Z"), 2048.0)
        assert found == (pytest.approx(frequency, rel=1e-4), line)
    assert strongest_line(velocity[:15], np.ones(3), ("X", "Y", "Z"), 2048.0) == (None, None)
    assert strongest_line(velocity[:16], np.ones(3), ("X", "Y", "Z"), 2048.0)[1] is not None
    assert strongest_line(velocity[:, 2:], np.ones(1), ("Z",), 2048.0) == (None, None)


def test_many_transients_are_looked_at_batch_by_batch_and_in_order(monkeypatch):
    monkeypatch.setattr(module, "AT_ONCE", 2)
    calls, seen = [], []

    def integrate_many(models, steady, displacement, velocity, **how):
        calls.append((models, steady.tolist(), displacement.tolist(), velocity.tolist(), how))
        for first in (0, 60):
            time = (first + np.arange(60)) / RATE
            one = np.sin(2 * np.pi * 100 * time)[:, None] * [1.0, 2.0]
            both = np.stack([(q[0] + one) for q in displacement])
            reached = np.array([not (first and name == "bad") for name in models])
            sticks = np.zeros((len(models), 60), bool)
            yield SimpleNamespace(time=time, vibration=both, velocity=-both, sticks=sticks, reached=reached)

    def looked_at(part, model, steady, matrix, rate):
        seen.append((model, steady.tolist(), matrix, rate, part.start, part.samples, str(part.outcome)))
        return model

    monkeypatch.setattr(module, "integrate_many", integrate_many)
    monkeypatch.setattr(module, "_looked_at", looked_at)
    steady, start, speed = (np.arange(6.0).reshape(3, 2) * k for k in (1, 10, 100))
    reported = []
    models: Any = ["a", "bad", "c"]
    found = saturated_motions(
        models, steady, start, speed, IntegratorOptions(RATE, 1e-5, 0.119, "implicit", 1),
        matrices=["A", "B", "C"], progress=lambda *given: reported.append(given),  # pyright: ignore[reportArgumentType]
    )  # fmt: skip
    assert list(found) == models
    how = {"duration": 0.119, "sample_rate": RATE, "tolerance": 1e-5, "solver": "implicit", "threads": 1}
    assert calls == [
        (["a", "bad"], [[0, 1], [2, 3]], [[0, 10], [20, 30]], [[0, 100], [200, 300]], how),
        (["c"], [[4, 5]], [[40, 50]], [[400, 500]], how),
    ]
    why = "failed: the integration stopped between t = 0.06 s and 0.119 s"
    assert [each[0] for each in seen] == models
    assert [each[1:3] for each in seen] == [([0, 1], "A"), ([2, 3], "B"), ([4, 5], "C")]
    assert [each[3:] for each in seen] == [
        (RATE, 119 - 60, 120, COMPLETE), (RATE, 59, 120, why), (RATE, 59, 120, COMPLETE)
    ]  # fmt: skip
    assert reported == [("transients", t, 0.119) for t in (0.059, 0.119)] * 2
