"""A history seen from steady sliding, read in pieces, against plain slices of what was put in."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.findings import vibration
from drumsqueal.findings import vibration as module
from drumsqueal.findings.vibration import (
    Vibration,
    amplitudes_apart,
    beyond_boundaries,
    boundary_ratio,
    characteristic_lengths,
    first_boundary_time,
    moved_by,
)
from drumsqueal.physics.effects.operation import Constant, Operation, PiecewiseLinear
from drumsqueal.solve.transient.state import COUPLING_FRACTION
from findings.fakes import LOADS, NAMES, SHARES, SPEED, record, two_shoes, vibration_of

RNG = np.random.default_rng(11)
TIME = 3.0 + np.arange(40) / 8.0  # it does not begin at zero
RECORDED = ("Z", "Tz", "X", "Y")  # more than are looked at, and in another order
Q, V = RNG.normal(size=(2, 40, 4))
STEADY = np.array([0.3, -0.7, 1.1])  # of X, Y, Tz
OWN = Q[:, [2, 3, 1]] - STEADY, V[:, [2, 3, 1]]


@pytest.fixture
def seen(monkeypatch) -> Vibration:
    monkeypatch.setattr(module, "PIECE", 7)
    return vibration_of(record(TIME, Q, V, RECORDED), ("X", "Y", "Tz"), STEADY)[0]


@pytest.mark.parametrize("part", [slice(None), slice(5, 33), slice(30, None), slice(2, 3)])
def test_parts_of_a_record_are_those_of_its_columns(seen, part):
    q, v = (each[part] for each in OWN)
    np.testing.assert_array_equal(seen.read("displacement", part), q)
    np.testing.assert_array_equal(seen.read("velocity", part), v)
    np.testing.assert_array_equal(seen.column("Tz", part), q[:, 2])
    np.testing.assert_array_equal(seen.column("X", part, of="velocity"), v[:, 0])
    rows, displacement, velocity = zip(*seen.pieces(part), strict=True)
    assert [row for each in rows for row in range(each.start, each.stop)] == list(range(len(q)))
    assert max(map(len, displacement)) <= 7
    np.testing.assert_array_equal(np.concatenate(displacement), q)
    np.testing.assert_array_equal(np.concatenate(velocity), v)
    elsewhere = RNG.normal(size=q.shape)
    np.testing.assert_allclose(seen.about(elsewhere, part), q + STEADY - elsewhere, atol=1e-15)
    np.testing.assert_allclose(seen.extremes(part), [q.min(axis=0), q.max(axis=0)], atol=1e-15)
    np.testing.assert_allclose(seen.largest(part), np.abs(q).max(axis=0), atol=1e-15)
    np.testing.assert_allclose(seen.mean_square_velocity(part), (v**2).mean(axis=0))
    mode: Any = SimpleNamespace(left=RNG.normal(size=6) + 1j * RNG.normal(size=6))
    np.testing.assert_allclose(seen.modal(mode, part), 2 * np.hstack([q, v]) @ mode.left.conj())


def test_a_record_knows_its_rate_its_largest_rotation_and_whether_it_was_started(seen):
    assert seen.sample_rate == pytest.approx(8.0, rel=1e-14)
    assert seen.largest_rotation == pytest.approx(np.abs(OWN[0][:, 2]).max())
    assert seen.started
    still, moving = np.zeros((20, 1)), np.ones((20, 1))
    moving[0] = 0.0
    for first, second, started in ((still, moving, False), (still, moving[::-1], True), (moving[::-1], still, True)):
        found = vibration_of(record(TIME[:20], first, second, ("Y",)), ("Y",), np.zeros(1))[0]
        assert found.started is started
        assert found.largest_rotation == 0.0


def test_spectra_are_of_what_moves_in_a_part_that_is_long_enough(seen):
    assert list(seen.spectra(slice(0, 15))) == []
    time = np.arange(64) / 64.0
    q = np.stack([0.25 * np.sin(2 * np.pi * 8 * time), 0 * time, 1 + 2 * np.cos(2 * np.pi * 16 * time)], axis=1)
    found = vibration_of(record(time, q, q, ("X", "Y", "Z")), ("X", "Y", "Z"), np.array([0.0, 2.0, 1.0]))[0]
    assert [name for name, _ in found.spectra(slice(None))] == ["X", "Z"]
    ((name, spectrum),) = found.spectra(slice(16, None), ["Z", "Y"])
    largest = np.argmax(spectrum.amplitude)
    assert (name, spectrum.frequency_Hz[largest]) == ("Z", pytest.approx(16.0, abs=0.5))
    assert spectrum.amplitude[largest] == pytest.approx(2.0, rel=0.02)  # between two lines of the grid
    assert len(list(found.spectra(slice(0, 16)))) == 2


def test_amplitudes_are_apart_by_the_largest_ratio_of_what_takes_part():
    one, other = {"X": 2.0, "Y": 5e-3, "Tz": 1e-9}, {"X": 3.0, "Y": 2e-2, "Tz": 0.0}
    assert amplitudes_apart(one, other) == pytest.approx(np.log(4.0))
    # By mass the second one is smaller than a thousandth of the largest motion, and counts as that.
    mass = np.array([4.0, 1e-2, 1.0])
    least = COUPLING_FRACTION * 2 * 3.0
    assert amplitudes_apart(one, other, mass) == pytest.approx(np.log(1.5))
    assert max(0.1 * 2e-2, 1e-9) < least
    assert amplitudes_apart({"X": 0.0}, {"X": 0.0}) == 0.0
    assert characteristic_lengths(["b.Tz", "drum.E1", "a.X"], two_shoes().body).tolist() == [0.19, 0.4, 1.0]


def test_the_ratio_to_the_boundaries_is_the_largest_of_any_shoe_at_each_sample(seen, monkeypatch):
    fractions = RNG.normal(size=(2, 2, 40)) ** 2
    asked = []

    def boundary_fractions(model, q, v, moments):
        asked.append(len(moments))
        first = sum(asked) - asked[-1]
        rows = slice(first, first + len(moments))
        for k, name in enumerate(("X", "Y", "Tz")):
            np.testing.assert_array_equal(q[name], OWN[0][rows, k])
            np.testing.assert_array_equal(v[name], OWN[1][rows, k])
        np.testing.assert_array_equal(moments, TIME[rows])
        return fractions[..., rows]

    monkeypatch.setattr(module, "boundary_fractions", boundary_fractions)
    monkeypatch.setattr(module, "moments_at", lambda _, times: times)
    model: Any = SimpleNamespace(operation=None)
    np.testing.assert_array_equal(boundary_ratio(seen, model), fractions.reshape(4, 40).max(axis=0))
    assert asked == [7, 7, 7, 7, 7, 5]


def test_a_lining_is_beyond_its_boundary_where_another_part_of_it_leaves_or_touches_the_drum():
    time = np.linspace(0.0, 6.0, 13)  # the first shoe has no load up to 1 s
    whole, part = np.ones(13), np.full(13, 0.6)
    off = np.where(np.arange(13) % 3 == 0, 1.0, 1.0 - 1e-9)
    none = np.zeros(13)
    history = {"a.contact_fraction": off, "b.contact_fraction": whole, "slip_reversed_fraction": none}

    def beyond(model, steady, **changed):
        data = record(time, np.zeros((13, 6)), np.zeros((13, 6)), NAMES, **(history | changed))
        found = beyond_boundaries(data, steady, model)
        stability: Any = SimpleNamespace(contact_fractions=steady)
        first = time[np.flatnonzero(found)[0]] if found.any() else None
        assert first_boundary_time(data, stability, model) == first
        return np.flatnonzero(found).tolist()

    loaded = [k for k in range(13) if time[k] > 1.0 and k % 3]
    assert beyond(two_shoes(), [1.0, 1.0]) == loaded
    # Where it does not touch whole, or is pushed, a tenth must change, either way.
    assert beyond(two_shoes(pushed=True), [1.0, 1.0]) == []
    moved = np.select([np.arange(13) == 4, np.arange(13) == 7, np.arange(13) == 9], [0.71, 0.49, 0.69], 0.6)
    either = {"a.contact_fraction": whole, "b.contact_fraction": moved}
    assert beyond(two_shoes(), [1.0, 0.6], **either) == [4, 7]
    assert beyond(two_shoes(), [1.0, part + 0.11 * (time > 5)], **either) == [4, 7, 11, 12]
    assert beyond(two_shoes(stiffness=(1.0, 0.0)), [1.0, 0.6], **either) == []
    back = np.where(np.arange(13) == 5, 1e-9, 1e-13)
    assert beyond(two_shoes(pushed=True), [1.0, 1.0], slip_reversed_fraction=back) == [5]
    assert beyond(two_shoes(pushed=True, frictions=(False, False)), [1.0, 1.0], slip_reversed_fraction=back) == []


def test_a_shoe_comes_on_when_the_forces_on_it_have_risen_to_a_tenth(monkeypatch):
    time = np.linspace(0.0, 10.0, 21)
    rising, early = PiecewiseLinear([2.0, 4.0], [0.0, -800.0]), Constant(5.0)
    for pushes, shoes, at in (
        ((rising, Constant(0.0)), (1, 1), 2.2),
        ((rising, early), (1, 0), 2.2),
        ((rising, early), (1, 1), 0.0),
        ((PiecewiseLinear([0.0, 1.0, 2.0], [0.0, 90.0, 0.0]), rising), (1, 1), 1.0),  # it is on although it falls again
        (
            (PiecewiseLinear([0.0, 5.0, 9.0], [0.0, 500.0, 90.0]), Constant(0.0)),
            (1, 1),
            0.5,
        ),  # of the largest, not the last
    ):
        operation = Operation(SPEED, LOADS[0], pushes, (LOADS[1],), shoes)
        late = module._comes_on(operation, 1, time)
        assert np.flatnonzero(~late)[0] == np.flatnonzero(time >= at)[0], (pushes, shoes)
        assert not late[np.flatnonzero(~late)[0] :].any()
    single = Operation(SPEED, Constant(0.0), (rising,))
    assert module._comes_on(single, 0, time).sum() == 5


def test_what_pushes_a_shoe_is_found_by_changing_one_schedule_at_a_time(monkeypatch):
    force = PiecewiseLinear([0.0, 4.0, 9.0], [-20.0, 60.0, 999.0])
    operation = Operation(SPEED, LOADS[0], (Constant(3.0), force), (LOADS[1],), (0, 1))
    model: Any = SimpleNamespace(
        operation=operation, moved_by_steady_sliding=(False, True), planar=False, names=("X", "Y"),
        body=SimpleNamespace(area=0.01),
    )  # fmt: skip
    stability: Any = SimpleNamespace(time=1.5, coordinates=("Y", "Z", "X"), steady_state=np.array([2.0, 3.0, 4.0]))
    seen, sizes = [], {"speed": 0.0, "load": 0.0, "force": 0.0}

    def forces(_, rows, q):
        assert q.tolist() == [4.0, 2.0]
        rows = np.array(rows)
        seen.append(rows)
        changed = int(np.flatnonzero(np.ptp(rows, axis=1) > 0)[0])
        size = sizes["speed" if changed == 0 else "load" if changed < 3 else "force"]
        return np.array([[0.0, 0.0], [0.0, size], [0.0, -size]])

    monkeypatch.setattr(module, "_forces", forces)
    assert moved_by(model, stability, 5.0) == ""
    kept = [-3.75, 225.0, 700.0, 3.0, 10.0]
    for rows, place, low, high in zip(seen, (0, 1, 4), (-6.0, 0.0, -20.0), (-1.5, 900.0, 247.8), strict=True):
        wanted = np.array([[each] * 3 for each in kept])
        wanted[place] = [kept[place], low, high]
        np.testing.assert_allclose(rows, wanted)
    # The largest load is 900 Pa on 0.01 m², or 700 beside 247.8 N; forces that cancel leave 1e-10 of it.
    for name, least in (("speed", 7.0 + 13.0), ("load", 9.0 + 13.0), ("force", 7.0 + 250.8)):
        for factor, pushes in ((0.49, False), (0.51, True)):
            found = moved_by(model, stability, 5.0) if sizes.update({name: factor * least * 1e-10}) is None else ""
            assert found == (f"changing {'drum speed' if name == 'speed' else name}" if pushes else ""), name
        sizes[name] = 0.0
    sizes |= {"speed": 1.0, "load": 1.0, "force": 1.0}
    assert moved_by(model, stability, 5.0) == "changing drum speed and load and force"
    model.moved_by_steady_sliding = (False, False)
    assert moved_by(model, stability, 5.0) == ""


def test_the_loudest_shoe_is_that_whose_middle_moves_most_along_the_drum_late_in_the_record(monkeypatch):
    def displacement(own, angle):
        assert angle == 0.0
        return own["X"], own["Y"], 0.0  # radially and along the drum

    parts = [SimpleNamespace(share=each, shoe=SimpleNamespace(displacement=displacement)) for each in SHARES]
    monkeypatch.setattr(vibration, "placed", lambda _: parts)
    names = ["a.Y", "b.Y", "a.X", "b.X"]
    velocity = np.zeros((100, 4))
    velocity[41:, 0], velocity[:, 1], velocity[:, 3] = -1.0, 0.9, 9.0
    assert vibration.loudest_shoe(None, names, velocity) == 0
    velocity[41:60, 0] = 0.5
    assert vibration.loudest_shoe(None, names, velocity) == 1
    velocity[:40, 0] = 9.0  # early on
    assert vibration.loudest_shoe(None, names, velocity) == 1
