"""Squeals of synthetic records: when they begin and end, how large they are, against what was put in."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.findings import squeals as module
from drumsqueal.findings.saturation import FinalMotion, SpectralLine
from drumsqueal.findings.squeals import SquealEnd, _energy, _longest_period, _steady_contact, find_squeals
from drumsqueal.solve.linear.passage import Along
from findings.fakes import NAMES, SHARES, two_shoes

RATE = 800.0


def mode(frequency: float, rate: float) -> Any:
    return SimpleNamespace(frequency_Hz=frequency, growth_rate=rate)


def along(time, modes, steady=None) -> Any:
    return Along("X", np.asarray(time), tuple(modes), np.zeros((len(time), 1)) if steady is None else steady, time)


def test_the_longest_period_is_that_of_the_lowest_mode_that_lasts_for_a_period():
    time = np.array([0.0, 1.0])
    modes = [along(time, [mode(40.0, -39.0), mode(30.0, -31.0)]), along(time, [mode(50.0, 9.0), mode(20.0, -20.0)])]
    assert _longest_period(modes, time) == pytest.approx(1 / 40)
    # Without any a pause is a tenth of the record.
    assert _longest_period(
        [along(time, [mode(30.0, -31.0)] * 2)], np.array([2.0, 9.0])
    ) * module.PAUSE == pytest.approx(0.7)


def test_in_steady_sliding_the_fraction_that_touches_goes_between_the_instants_that_were_followed():
    model, steady = two_shoes(), np.random.default_rng(2).normal(size=(3, len(NAMES))) * 2e-5
    model.balanced = False
    followed = along(np.array([1.5, 2.0, 4.0]), [mode(1.0, 0.0)] * 3, steady)
    short = along(np.array([1.0, 2.0]), [mode(1.0, 0.0)] * 2, steady[:2] * 0)
    found = _steady_contact(model, [short, followed], np.array([1.75, 3.0, 4.0]))
    for share, (_, side), load, each in zip(SHARES, model.sides, ([225, 450, 900], [700] * 3), found, strict=True):
        into, _ = side.body.surface()
        pressure = np.array(load)[:, None] + side.contact.lifting_stiffness * steady[:, list(share.places)] @ into.T
        touch = np.mean(pressure > 0, axis=1)
        assert 0 < touch.min() < 1
        np.testing.assert_allclose(each, [(touch[0] + touch[1]) / 2, (touch[1] + touch[2]) / 2, touch[2]])
    model.balanced = True
    np.testing.assert_array_equal(_steady_contact(model, [followed], np.zeros(1)), [[1.0], [1.0]])
    model.balanced = False
    np.testing.assert_array_equal(_steady_contact(model, [], np.zeros(1)), [[1.0], [1.0]])


@pytest.mark.parametrize("window", [1, 2, 5, 8, 25])
def test_kinetic_energy_is_the_mean_over_windows_that_overlap_by_half(window):
    velocity, mass = np.random.default_rng(4).normal(size=(23, 2)), np.array([2.0, 0.5])
    time = 5.0 + np.arange(23) / 10
    pieces = [(None, None, velocity[:9]), (None, None, velocity[9:])]
    vibration: Any = SimpleNamespace(time=time, pieces=lambda: pieces)
    middles, energy = _energy(vibration, SimpleNamespace(mass=mass), window)  # pyright: ignore[reportArgumentType]
    starts = range(0, max(1, 23 - window), max(1, window // 2))
    for k, start in enumerate(starts):
        part = slice(start, min(start + window, 23))
        assert middles[k] == time[(start + part.stop - 1) // 2]
        assert energy[k] == pytest.approx(np.mean(velocity[part] ** 2 @ mass / 2))
    assert len(energy) == len(starts)


def test_a_squeal_has_its_times_its_largest_motion_and_the_line_of_that(monkeypatch):
    time = np.arange(8000) / RATE  # 10 s; periods of 1/40 s, so that a pause is 1.25 s
    # It grows from 2 s to 4 s, and falls at 8 1/s from 6 s on, where a small one falls at 10 1/s.
    envelope = np.interp(time, [2.0, 4.0], [0.02, 1.0]) * np.exp(-8.0 * np.maximum(time - 6.0, 0.0))
    envelope[np.abs(time - 5.0) < 0.1] *= 1.2
    beyond = (time > 2.0) & (time < 6.25)
    asked: dict[str, Any] = {}
    q = envelope[:, None] * np.cos(2 * np.pi * 40.0 * time)[:, None]
    velocity = 2 * np.pi * 40.0 * envelope[:, None] * np.sin(2 * np.pi * 40.0 * time)[:, None]
    vibration: Any = SimpleNamespace(time=time, sample_rate=RATE, pieces=lambda: [(None, q, velocity)])
    stability: Any = SimpleNamespace(mass=np.array([3.0]))
    decaying = along(np.array([0.0, 10.0]), [mode(40.0, -10.0)] * 2)
    model: Any = SimpleNamespace(balanced=True, contact=SimpleNamespace(shoes=1))
    history = {"sticking": SimpleNamespace(values=np.zeros(time.size))}

    def describe_motion(seen, part, at, of):
        asked["part"] = part
        return FinalMotion({"X": 0.7, "Y": 0.9}, {}, (), asked["main"])

    monkeypatch.setattr(module, "beyond_boundaries", lambda *given: beyond)
    monkeypatch.setattr(module, "describe_motion", describe_motion)
    monkeypatch.setattr(module, "instants_at", lambda model, times: times)
    monkeypatch.setattr(module.Squeal, "__init__", lambda self, **given: asked.update(given))

    def found(**changed: Any) -> dict[str, Any]:
        asked.clear()
        asked["main"] = changed.pop("main", SpectralLine("X", 40.0, 0.5))
        modes = changed.pop("modes", [decaying])
        records = find_squeals(changed.pop("history", history), vibration, stability, model, modes)  # pyright: ignore[reportArgumentType]
        return asked | {"count": len(records)}

    squeal = found()
    window = 8 / 40.0
    assert (squeal["count"], squeal["end"]) == (1, SquealEnd.DIES_OUT)
    assert squeal["sets_in"] == pytest.approx(2.0 + 1 / RATE)
    assert squeal["ends"] == pytest.approx(6.25 - 1 / RATE)
    assert squeal["largest"] == pytest.approx(5.0, abs=window / 2)
    # Half of the linear decay is let go: a window about 6 s begins to fall so.
    assert squeal["sustained_until"] == pytest.approx(6.0, abs=window)
    k, reach = round(squeal["largest"] * RATE), round(16 / 40.0 * RATE)
    assert squeal["part"] == slice(k - reach, k + reach + 1)
    assert (squeal["line"], squeal["amplitude"]) == (SpectralLine("X", 40.0, 0.5), 0.7)
    assert found(main=None)["amplitude"] == 0.9
    # Where the record ends while it lasts, and where the lining sticks, it is sustained to its end.
    beyond = time > 7.0
    assert (found()["end"], squeal["count"]) == (SquealEnd.RECORD, 1)
    assert asked["sustained_until"] == asked["ends"] == time[-1]
    beyond, rest = (time > 2.0) & (time < 3.0), SimpleNamespace(values=(time > 3.2) & (time < 5.0))
    assert found(history={"sticking": rest})["end"] is SquealEnd.STICKS
    assert asked["sustained_until"] == asked["ends"] == pytest.approx(3.0 - 1 / RATE)
    # What falls as a small motion from the first on is no squeal.
    beyond = (time > 6.3) & (time < 7.0)
    assert found()["count"] == 0
    beyond = np.zeros(time.size, dtype=bool)
    assert found()["count"] == 0
    # Without a mode that lasts windows, pauses and what counts as short go by a tenth of the record.
    beyond = (time > 2.0) & (time < 2.15)
    assert found(modes=[])["count"] == 0
    beyond = (time > 2.0) & (time < 2.17)
    assert found(modes=[])["count"] == 1
