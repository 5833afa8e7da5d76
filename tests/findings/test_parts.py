"""What is read off a run: accuracy, approach, averages of the contact, the history, the prediction; by plain sums."""

import dataclasses
import json
import math
import tomllib
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.errors import COMPLETE, Ending, Outcome
from drumsqueal.findings import compare, growth_phase, saturation
from drumsqueal.findings.compare import _motion_ratio, _temperature, estimate_quadrature_error, measure_accuracy
from drumsqueal.findings.growth_phase import _averaged, _frequency, _signed, explain_frequency
from drumsqueal.findings.history import SIGNALS, columns, empty_dataset, memory_of, to_dataset
from drumsqueal.findings.prediction import predict, turned_far
from drumsqueal.findings.saturation import Approach, LastStates, _distance, _nearest, _periods, _reached, _size, _turns
from drumsqueal.physics.effects.effect import Observation
from drumsqueal.physics.effects.friction import UnitVelocity
from drumsqueal.physics.effects.pressure import Bonded, HardeningLining, Unilateral
from drumsqueal.scene import scene_from_dict
from drumsqueal.solve.transient.integrate import Chunk
from findings.fakes import record, vibration_of

RNG = np.random.default_rng(3)

# --- accuracy --------------------------------------------------------------------------------------------------------


def test_the_energy_balance_is_over_the_kinetic_energy_and_the_work_of_friction():
    time = np.array([0.0, 1.0, 3.0])
    still = np.zeros((3, 1))
    energies = {"energy_balance_error": np.array([1.0, -4.0, 2.0]), "kinetic_energy": np.array([5.0, 8.0, 2.0])}
    found = measure_accuracy(
        record(time, still, still, ("X",), **energies, friction_power=np.array([2.0, 4.0, 6.0])), 0.5
    )
    assert found.energy_balance_error_J == 4.0
    assert found.energy_balance_error_over_kinetic_energy == 0.5
    assert found.energy_balance_error_over_friction_work == pytest.approx(4.0 / (3.0 + 10.0))
    assert found.quadrature_error_over_normal_force == 0.5
    energies["kinetic_energy"] = np.zeros(3)
    found = measure_accuracy(record(time, still, still, ("X",), **energies, friction_power=np.zeros(3)), None)
    assert (found.energy_balance_error_over_kinetic_energy, found.energy_balance_error_over_friction_work) == (0.0, 0.0)


def test_contact_forces_are_compared_where_it_slips_half_of_them_where_most_is_reversed(monkeypatch):
    n = 200
    sticking = (np.arange(n) % 4 == 0).astype(float)
    reversed_ = RNG.random(n)
    normal, torque = 100 + RNG.normal(size=n), RNG.normal(size=n)
    normal[150:] = np.nan  # it was cut off there
    q, v = RNG.normal(size=(2, n, 3))
    history = record(
        np.arange(n) / 10,
        q,
        v,
        ("X", "Y", "Tz"),
        sticking=sticking,
        slip_reversed_fraction=reversed_,
        normal_force=normal,
        brake_torque=torque,
        temperature=RNG.random(n),
    )
    asked = {}

    @dataclasses.dataclass
    class Model:
        contact: Any
        names: tuple[str, ...] = ("Tz", "X")
        remembered: tuple[str, ...] = ("temperature",)

    def observe(model, times, displacement, velocity, memory):
        asked.update(model=model, times=times, q=displacement, v=velocity, memory=memory)
        k = np.round(times * 10).astype(int)
        off = np.where(k == worst, 3.0, 0.1)
        return SimpleNamespace(normal_force=normal[k] + off, brake_torque=torque[k] - 2 * off * 0.2)

    class Contact:
        radius = 0.2

        def mapped(self, change):
            return change

    monkeypatch.setattr(compare, "Contact", Contact)
    monkeypatch.setattr(compare, "_observe", observe)
    slips = np.flatnonzero((sticking == 0) & (np.arange(n) < 150))
    spread = slips[np.linspace(0, slips.size - 1, 16).astype(int)]
    most = slips[np.argsort(-reversed_[slips])][:16]
    worst = int(most[0])
    model: Any = Model(Contact())
    found = estimate_quadrature_error(history, model)
    np.testing.assert_array_equal(np.round(asked["times"] * 10), [*spread, *most])
    instants = [*spread, *most]
    np.testing.assert_array_equal(asked["q"], q[instants][:, [2, 0]])
    np.testing.assert_array_equal(asked["v"], v[instants][:, [2, 0]])
    np.testing.assert_array_equal(asked["memory"][:, 0], history["temperature"].values[instants])
    assert asked["model"].contact is compare._finer
    largest = max(normal[k] + (3.0 if k == worst else 0.1) for k in instants)
    assert found == pytest.approx(6.0 / largest)  # of the torque over R
    history["sticking"].values[:] = 1.0
    assert estimate_quadrature_error(history, model) is None
    assert estimate_quadrature_error(history, Model(None)) is None  # pyright: ignore[reportArgumentType]
    history["sticking"].values[:] = 0.0
    normal[:150] = -5.0
    history["normal_force"].values[:] = normal
    worst = -1
    assert estimate_quadrature_error(history, model) is None


# --- approach --------------------------------------------------------------------------------------------------------


def record_of(states: np.ndarray, rate: float, line: float, seconds: float = 9.0) -> LastStates:
    contact = SimpleNamespace(cell_axes=0)
    model: Any = SimpleNamespace(mass=np.array([2.0, 0.5]), names=("X", "Tz"), contact=contact)
    return LastStates(states, seconds, rate, line, model, np.zeros(2), "auto", 1e-6, 90_000)


def test_a_motion_has_the_size_that_its_largest_kinetic_energy_gives_each_coordinate():
    states = np.array([[9.0, 9.0, 1.0, -2.0], [9.0, 9.0, 3.0, 1.0], [9.0, 9.0, 0.0, 0.0]])
    speed = np.sqrt((2 * 9 + 0.5) / np.array([2.0, 0.5]))
    np.testing.assert_allclose(_size(record_of(states, 10.0, 4.0)), [*(speed / (8 * np.pi)), *speed])


def test_the_nearest_place_of_a_path_is_on_its_chords():
    path = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 0.0], [4.0, 3.0]])
    assert _nearest(np.array([1.0, 2.0]), path) == (2.0, 0.25)
    assert _nearest(np.array([5.0, 1.5]), path) == (1.0, 2.5)
    assert _nearest(np.array([-3.0, -4.0]), path) == (5.0, 0.0)
    assert _nearest(np.array([4.0, 5.0]), path) == (2.0, 3.0)
    # Of the last tenth of 3000 states 200 at most are taken.
    states = RNG.normal(size=(3000, 2))
    last = states[-300:]
    wanted = np.sqrt(np.mean([_nearest(each, path)[0] ** 2 for each in last]))
    assert _distance(states, path) == pytest.approx(wanted)
    assert _distance(states[:2], path) == pytest.approx(_nearest(states[1], path)[0])
    many = np.vstack([states, states])
    wanted = np.sqrt(np.mean([_nearest(each, path)[0] ** 2 for each in many[-600:][::3]]))
    assert _distance(many, path) == pytest.approx(wanted)


def test_periods_are_sought_near_turns_of_the_main_line_where_the_last_state_comes_back():
    # At 10 Hz, with a part at 10/3 Hz of 0.2: after 3 turns it is back, after 1 or 2 it is 0.2 √3 away.
    rate, time = 400.3, np.arange(900) / 400.3
    turn = 2 * np.pi * 10 * time
    states = np.stack([np.cos(turn) + 0.2 * np.cos(turn / 3), np.sin(turn) + 0.2 * np.sin(turn / 3)], axis=1)
    found = _periods(states, record_of(states, rate, 10.0))
    assert found[:2] == pytest.approx([0.3, 0.6], rel=1e-4)
    assert all(each / 0.3 == pytest.approx(round(each / 0.3), rel=1e-3) for each in found)
    assert len(found) == 6
    near = np.stack([np.cos(turn) + 0.16 * np.cos(turn / 3), np.sin(turn) + 0.16 * np.sin(turn / 3)], axis=1)
    near = near[:500]  # four times back
    found = _periods(near, record_of(near, rate, 10.0))  # at 0.277 away the others are tried, too
    assert found[0] == pytest.approx(0.3, rel=1e-4)
    assert {round(each * 10) for each in found} - {3, 6, 9, 12, 15, 18}
    assert _periods(states[:30], record_of(states[:30], rate, 10.0)) == []


def test_an_orbit_that_repeats_within_its_period_is_counted():
    def samples(model, state, period, count):
        assert count == 256
        back = abs(period / 0.3 - round(period / 0.3)) < 1e-6
        return np.array([[0.0, 0.0], state + (0.0 if back else 0.011)])

    neighbours: Any = SimpleNamespace(samples=samples)
    size = np.ones(2)
    assert _turns(None, np.ones(2), 1.2, size, neighbours) == 4  # pyright: ignore[reportArgumentType]
    assert _turns(None, np.ones(2), 0.3, size, neighbours) == 1  # pyright: ignore[reportArgumentType]
    assert _turns(None, np.ones(2), 0.35, 2 * size, neighbours) == 20  # pyright: ignore[reportArgumentType]


def test_a_motion_reaches_an_orbit_if_it_gets_there_or_comes_nearer_as_fast_as_it_says():
    circle = np.linspace(0, 2 * np.pi, 257)
    orbit = np.stack([np.cos(circle), np.sin(circle)], axis=1)
    before = Approach(
        frequency_Hz=2.0, amplitude={}, rate_1_per_s=-0.5, largest_multiplier=0.8, distance=0.08, residual=0.0
    )
    angle = np.linspace(0, 40, 1000)

    def motion(first: float, last: float) -> np.ndarray:
        away = 1 + np.geomspace(first, last, 1000)
        return away[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)

    asked = []

    def reached(states, found=before, further=0.02, spent=0.0, seconds=9.0):
        def samples(model, state, duration, count, tolerance):
            asked.append((state, duration, count, tolerance))
            return (1 + further) * orbit

        neighbours: Any = SimpleNamespace(steps=spent, samples=samples)
        return _reached(record_of(states, 100.0, 2.0, seconds), found, orbit, np.ones(2), neighbours)

    left = np.log(8.0) / 0.5 + 0.5
    states = motion(2.0, 0.08)
    assert reached(states) is before
    assert (asked[0][1], asked[0][2], asked[0][3]) == (pytest.approx(left), int(left * 100), 1e-6)
    np.testing.assert_array_equal(asked[0][0], states[-1])
    assert reached(states, further=0.031) is None
    near = before.model_copy(update={"distance": 0.01})
    assert reached(states, near, further=0.5) is near
    # Where that would take more than a quarter of the run, of 90,000 steps in 9 s and 500,000 of all else, it must have
    # come nearer at half that rate, for half of it.
    most = (90_000 + 500_000) / 4 - left * 10_000
    found = reached(states, spent=most + 1)
    assert found is not None
    assert found.record_needed_s == pytest.approx(9.0 + left)
    assert reached(states, spent=most - 1) is before
    assert reached(motion(0.6, 0.08), spent=most + 1) is None


def test_an_orbit_that_is_found_over_several_turns_has_the_numbers_of_one(monkeypatch):
    """Over two turns of 0.3 s a disturbance falls to 0.8: in one to the root of that."""
    turn = np.linspace(0, 2 * np.pi, 65)
    orbit = np.stack([3 + 2 * np.cos(turn), 0.5 * np.sin(turn), np.sin(turn), np.cos(turn)], axis=1)
    multipliers, asked = np.array([1.001, 0.5, 0.8, 0.1]), []

    def derivatives(model, size, state, period, end):
        asked.append((model, size.tolist(), state.tolist(), period, end))
        return (np.diag(multipliers),)

    def samples(model, state, period, count):
        asked.append((model, state.tolist(), period))
        return orbit

    neighbours: Any = SimpleNamespace(derivatives=derivatives, samples=samples)
    size = np.array([2.0, 0.5, 1.0, 4.0])
    shooting: Any = SimpleNamespace(
        unscaled=lambda unknowns: (unknowns[:4] * size, float(unknowns[4]), 0.0), scale=np.append(size, [1.0, 1.0])
    )
    closed: Any = SimpleNamespace(
        unknowns=np.array([1.0, 2.0, 3.0, 4.0, 0.6, 0.0]), flow=SimpleNamespace(end="end"), residual=1e-9
    )
    of = record_of(np.ones((9, 4)), 100.0, 2.0)._replace(model=SimpleNamespace(names=("X", "Tz")), steady=np.zeros(2))  # pyright: ignore[reportArgumentType]
    monkeypatch.setattr(saturation, "_turns", lambda model, state, period, size, neighbours: 2)
    monkeypatch.setattr(saturation, "_distance", lambda states, orbit: float(states[0, 1]))
    monkeypatch.setattr(saturation, "_reached", lambda record, found, *_: found)
    found = saturation._approached(of, shooting, closed, neighbours)
    assert found is not None
    assert asked == [
        (of.model, size.tolist(), [1.0, 2.0, 3.0, 4.0], 0.6, "end"), (of.model, [2.0, 1.0, 3.0, 16.0], 0.3)
    ]  # fmt: skip
    assert found.frequency_Hz == pytest.approx(1 / 0.3)
    assert found.amplitude == pytest.approx({"X": 2.0, "Tz": 0.5})
    assert found.rate_1_per_s == pytest.approx(np.log(0.8) / 0.6)
    assert found.largest_multiplier == pytest.approx(np.sqrt(0.8))
    assert (found.distance, found.residual) == (2.0, 1e-9)
    multipliers[2] = 1 - 0.9 * saturation.CLEAR * 1e-3  # no clearer than the multiplier that is 1
    assert saturation._approached(of, shooting, closed, neighbours) is None
    multipliers[2] = 1 - 1.1 * saturation.CLEAR * 1e-3
    assert saturation._approached(of, shooting, closed, neighbours) is not None
    orbit *= 1e-6  # steady sliding
    assert saturation._approached(of, shooting, closed, neighbours) is None


# --- the averaged contact --------------------------------------------------------------------------------------------


class Law:
    stiffness = 2.0e3

    def coefficient(self, speed):
        return 0.3 + 0.1 * speed


@pytest.fixture
def lining(monkeypatch) -> Any:
    """A lining of two coordinates among three, whose points move by simple functions of angle and z."""
    monkeypatch.setattr(growth_phase, "coefficient_at", lambda law, speed: law.coefficient(speed))

    def over_drum(motion, theta, z):
        x, tz = motion.get("X", 0.0), motion.get("Tz", 0.0)
        return x * np.cos(theta) + 0 * z, tz * 0.1 + x * np.sin(theta), tz * z

    shoe = SimpleNamespace(half_angle=0.7, width=0.06, area=0.02, outer_radius=0.1, over_drum=over_drum)
    friction = SimpleNamespace(law=Law(), direction=UnitVelocity())
    law = Unilateral(2.0e3)
    operation = SimpleNamespace(at=lambda t: SimpleNamespace(preload=40.0 + 10.0 * t, drum_speed=-3.0 - t))
    return SimpleNamespace(
        lining=SimpleNamespace(body=shoe, law=law), shoe=shoe, names=("X", "Tz"), operation=operation,
        contact=SimpleNamespace(friction=friction), body=SimpleNamespace(symmetric=(True, False)), tangents=(2.0e3,),
    )  # fmt: skip


def test_friction_is_a_signed_fraction_of_the_pressure_along_the_drum(lining):
    slip, across = np.array([0.3, -0.4, 0.0]), np.array([0.4, 0.3, 0.5])
    np.testing.assert_allclose(_signed(lining, slip, across), -0.35 * slip / 0.5)
    lining.contact.friction.direction = None
    np.testing.assert_allclose(_signed(lining, slip, across), [-0.33, 0.34, 0.0])
    lining.contact.friction = None
    np.testing.assert_array_equal(_signed(lining, slip, across), np.zeros(3))


@pytest.mark.parametrize("bonded", [False, True])
def test_the_contact_is_averaged_by_the_square_of_the_rate_where_it_touches(lining, bonded):
    time = np.linspace(0.0, 2.0, 50)
    q, v = RNG.normal(size=(2, 50, 3)) * [[[0.03]], [[1.0]]]
    if bonded:
        lining.lining.law = Bonded(2.0e3)
    found = _averaged(lining, (2, 0), time, q, v, (0.0, np.zeros(3)))
    along, wa = np.polynomial.legendre.leggauss(48)
    across, wz = np.polynomial.legendre.leggauss(5)
    k = 0
    for theta, w1 in zip(0.7 * along, wa, strict=True):
        for z, w2 in zip(0.03 * across, wz, strict=True):
            radial = np.array([0.0, 0.0, np.cos(theta)])
            tangential, axial = np.array([0.1, 0.0, np.sin(theta)]), np.array([z, 0.0, 0.0])
            for key, wanted in zip("rθz", (radial, tangential, axial), strict=True):
                np.testing.assert_allclose(found.shapes[key][k], wanted, atol=1e-15)
            assert found.spring[k] == pytest.approx(2.0e3 * 0.02 * w1 * w2 / 4)
            weight = (v @ radial) ** 2 / np.sum((v @ radial) ** 2)
            touches = np.ones(50) if bonded else (40.0 + 10.0 * time + 2.0e3 * q @ radial > 0)
            slip = v @ tangential + 0.1 * (3.0 + time)
            speed = np.hypot(slip, v @ axial)
            signed = -(0.3 + 0.1 * speed) * slip / speed
            assert found.full[k] == 1.0
            assert found.fraction[k] == pytest.approx(weight @ touches)
            assert found.acted[k] == pytest.approx(weight @ (touches * signed))
            assert found.resting[k] == pytest.approx(weight @ -(0.3 + 0.1 * 0.1 * (3.0 + time)))
            k += 1
    assert k == found.spring.size
    flat = _averaged(lining, (2, 0), time, q * [0, 1, 1], v, (0.0, np.zeros(3)))  # nothing moves out of the plane
    assert flat.spring.size == 48
    assert flat.spring.sum() == pytest.approx(2.0e3 * 0.02)


def test_a_lining_that_stiffens_is_averaged_by_its_slope_where_it_touches(lining):
    """p = k u + h u² has the slope k + 2 h u; `Model.stiffness` has 3000 N/m³ of it."""
    k, h, time = 2.0e3, 4.0e4, np.linspace(0.0, 2.0, 50)
    lining.lining.law, lining.tangents = Unilateral(HardeningLining(k, h)), (3.0e3,)
    q, v = RNG.normal(size=(2, 50, 3)) * [[[0.03]], [[1.0]]] * [0, 1, 1]
    steady = np.array([0.0, 0.0, 0.004])
    found = _averaged(lining, (2, 0), time, q, v, (-1.0, steady))  # before the load has risen
    reference = (np.sqrt(k * k + 4 * h * (40.0 + 10.0 * time)) - k) / (2 * h)
    at_rest = (np.sqrt(k * k + 4 * h * 30.0) - k) / (2 * h)
    for j, radial in enumerate(found.shapes["r"]):
        weight, u = (v @ radial) ** 2 / np.sum((v @ radial) ** 2), reference + q @ radial
        assert found.spring[j] * found.fraction[j] == pytest.approx(
            found.spring[j] / 3.0e3 * (weight @ np.where(u > 0, k + 2 * h * u, 0.0))
        )
        assert found.full[j] == pytest.approx((k + 2 * h * (at_rest + steady @ radial)) / 3.0e3)
    assert found.spring.sum() == pytest.approx(3.0e3 * 0.02)


def test_a_lining_without_stiffness_is_averaged_too(lining):
    lining.lining.law, lining.tangents = Unilateral(0.0), (0.0,)
    q, v = RNG.normal(size=(2, 50, 3))
    found = _averaged(lining, (2, 0), np.linspace(0.0, 2.0, 50), q, v, (0.0, np.zeros(3)))
    assert not found.spring.any()
    assert all(np.isfinite(each).all() for each in found[1:])


def test_the_frequency_is_that_of_the_mode_with_what_is_left_of_the_contact():
    radial, tangential = RNG.normal(size=(2, 6, 3))
    mass, supports, spring = np.array([2.0, 0.5, 1.0]), np.diag([900.0, 400.0, 2500.0]) + 30.0, RNG.random(6) * 50
    normal, drag = RNG.random(6), 0.1 * RNG.normal(size=6)
    wanted = supports.copy()
    for k in range(6):
        wanted += spring[k] * (normal[k] - 1) * np.outer(radial[k], radial[k])
        wanted -= spring[k] * drag[k] * np.outer(tangential[k], radial[k])
    squares, vectors = np.linalg.eig(wanted / mass[:, None])
    model: Any = SimpleNamespace(mass=mass, stiffness=supports)
    for j in range(3):
        mode: Any = SimpleNamespace(right=np.append(vectors[:, j] * (1 + 2j) + 0.05, np.zeros(3)))
        found = _frequency(model, {"r": radial, "θ": tangential}, spring, mode, normal, drag)
        assert found == pytest.approx(np.sqrt(squares[j]).real / (2 * np.pi))


def test_every_sample_of_a_long_record_is_thinned_alike_across_its_pieces(monkeypatch):
    monkeypatch.setattr(growth_phase, "MOST_SAMPLES", 20)
    q, v, steady = RNG.normal(size=(100, 2)), RNG.normal(size=(100, 2)), np.array([3.0, -4.0])
    time = np.arange(120.0)
    ends = [0, 7, 41, 42, 100]
    pieces = [(slice(a, b), q[a:b], v[a:b]) for a, b in pairwise(ends)]
    vibration: Any = SimpleNamespace(time=time, coordinates=("X", "Tz"), pieces=lambda part: pieces)
    asked = []

    def averaged(side, places, times, moved, rates, at_rest):
        asked.append((places, times, moved, rates))
        assert at_rest[0] == 2.5
        np.testing.assert_array_equal(at_rest[1], steady)
        one = np.full(3, 0.5)
        return growth_phase._Averaged(
            {key: np.ones((3, 2)) for key in "rθz"}, 4 * one, 2 * one, 0.6 * one, -0.3 * one, 0.2 * one
        )

    cases = []
    monkeypatch.setattr(growth_phase, "_averaged", averaged)
    monkeypatch.setattr(
        growth_phase,
        "_frequency",
        lambda model, shapes, spring, mode, normal, drag: (
            cases.append((normal[0], drag[0], spring.size)) or [10.0, 8.0, 7.0][len(cases) - 1]
        ),
    )
    model: Any = SimpleNamespace(sides=[(SimpleNamespace(places=(0,)), 1), (SimpleNamespace(places=(1,)), 2)])
    mode: Any = SimpleNamespace(frequency_Hz=50.0)
    stability: Any = SimpleNamespace(time=2.5, steady_state=steady)
    found = explain_frequency(vibration, slice(20, 120), model, stability, mode, 0.64)
    assert [each[0] for each in asked] == [(0,), (1,)]
    np.testing.assert_array_equal(asked[0][1], time[20::5])
    np.testing.assert_allclose(asked[0][2], q[::5] + steady)
    np.testing.assert_array_equal(asked[1][3], v[::5])
    assert cases == [(1.0, -0.15, 6), (0.3, pytest.approx(0.3 * -0.15), 6), (0.3, 0.1, 6)]
    assert list(found.values()) == pytest.approx([40.0, 35.0, 40.0])


# --- what a run found ------------------------------------------------------------------------------------------------


def test_the_motion_at_the_end_is_over_that_at_the_beginning_by_the_root_of_its_energy():
    time, (q, v) = np.arange(105) / 10.0, RNG.normal(size=(2, 105, 2))
    q[:, 0] += 7.0
    stiffness, mass = np.array([[5.0, 2.0], [2.0, 9.0]]), np.array([2.0, 0.5])
    vibration, stability = vibration_of(record(time, q, v, ("X", "Y")), ("X", "Y"), np.array([7.0, 0.0]), mass=mass)
    energies = v**2 @ mass + np.einsum("ti,ij,tj->t", q - [7, 0], stiffness, q - [7, 0])
    found = _motion_ratio(vibration, stability, SimpleNamespace(stiffness=stiffness))  # pyright: ignore[reportArgumentType]
    assert found == pytest.approx(np.sqrt(energies[-10:].max() / energies[:10].max()))
    still, stability = vibration_of(
        record(time, 0 * q + [7, 0], 0 * v, ("X", "Y")), ("X", "Y"), np.array([7.0, 0.0]), mass=mass
    )
    assert _motion_ratio(still, stability, SimpleNamespace(stiffness=stiffness)) is None  # pyright: ignore[reportArgumentType]


def test_a_lining_has_its_largest_and_its_last_rise_and_what_friction_is_left():
    time = np.array([0.0, 1.0, 2.5])
    history = record(time, np.zeros((3, 1)), np.zeros((3, 1)), ("X",), lining_temperature=np.array([3.0, 9.0, 5.0]))
    asked = []

    def moment(at, memory):
        asked.append((at, np.asarray(memory).tolist()))
        return SimpleNamespace(friction_left=0.7)

    found = _temperature(history, SimpleNamespace(remembered=("lining_temperature",), moment=moment))  # pyright: ignore[reportArgumentType]
    assert found is not None
    assert (found.largest_K, found.end_K, found.friction_left) == (9.0, 5.0, 0.7)
    assert asked == [(2.5, [5.0])]
    assert _temperature(history, SimpleNamespace(remembered=())) is None  # pyright: ignore[reportArgumentType]
    assert memory_of(history, ()) is None


def chunk(first: int, count: int, kept: int, steps: int) -> Chunk:
    base = 100.0 * first + np.arange(count)
    signals = {name: base + 0.01 * k for k, name in enumerate(SIGNALS)}
    observed = Observation(**{name: signals[name] for name in Observation._fields[:7]})  # pyright: ignore[reportArgumentType]
    energies = {
        name: signals[name] for name in ("kinetic_energy", "potential_energy", "energy_balance_error", "implicit")
    }
    motion = base[:, None] + 0.1 * np.arange(kept)
    return Chunk(
        time=base / 1e3,
        displacement=motion,
        velocity=-motion,
        observation=observed,
        steps=steps,
        rejected_steps=steps // 10,
        evaluations=7.0,
        end=None,
        **energies,  # pyright: ignore[reportArgumentType]
    )


def test_a_history_has_every_sample_under_its_name_and_zero_where_nothing_was_kept(nominal):
    chunks, outcome = [chunk(1, 3, 2, 40), chunk(2, 2, 2, 60)], Outcome(Ending.FAILED, "failed: so")
    found = to_dataset(chunks, nominal, ("Tz", "X"), outcome)
    base = np.array([100.0, 101, 102, 200, 201])
    np.testing.assert_array_equal(found["time"], base / 1e3)
    assert found["coordinate"].values.tolist() == ["X", "Y", "Z", "Tx", "Ty", "Tz"]
    for name, sign in (("displacement", 1), ("velocity", -1)):
        np.testing.assert_allclose(found[name].sel(coordinate="Tz"), sign * base)
        np.testing.assert_allclose(found[name].sel(coordinate="X"), sign * (base + 0.1))
        assert not found[name].sel(coordinate=["Y", "Z", "Tx", "Ty"]).values.any()
    for k, name in enumerate(SIGNALS):
        np.testing.assert_allclose(found[name], base + 0.01 * k)
        assert (found[name].attrs["units"], found[name].attrs["long_name"]) == SIGNALS[name]
    assert found["velocity"].attrs["units"] == "m/s (X, Y, Z), rad/s (Tx, Ty, Tz)"
    about = found.attrs
    assert (about["steps"], about["rejected_steps"], about["outcome"], about["ending"]) == (
        100,
        10,
        "failed: so",
        "failed",
    )
    assert about["title"] == nominal.title
    assert set(json.loads(about["versions"])) >= {"python", "jax", "numpy"}
    assert scene_from_dict(tomllib.loads(about["scene"])) == nominal
    empty = empty_dataset(nominal)
    assert (empty.sizes["time"], set(empty.data_vars), empty.attrs["steps"]) == (0, set(found.data_vars), 0)


def test_of_several_shoes_and_a_memory_each_has_its_columns():
    one = chunk(1, 3, 2, 40)
    by_shoe = tuple(np.full(3, 50.0 + k) for k in range(6))
    one = one._replace(
        observation=one.observation._replace(by_shoe=by_shoe), remembered={"lining_temperature": np.arange(3.0)}
    )  # pyright: ignore[reportArgumentType]
    found = columns(one, ("b.X", "drum.E1"), ("a.X", "b.X", "drum.E1"))
    np.testing.assert_array_equal(found["displacement"], np.column_stack([np.zeros(3), one.displacement]))
    names = [f"{shoe}.{name}" for shoe in "ab" for name in ("brake_torque", "normal_force", "contact_fraction")]
    assert [found[name][0] for name in names] == [50.0 + k for k in range(6)]
    np.testing.assert_array_equal(found["lining_temperature"], np.arange(3.0))


def test_a_prediction_is_what_the_stability_says():
    modes = [
        SimpleNamespace(name=n, frequency_Hz=f, growth_rate=g, damping_ratio=-g / 100, unstable=g > 0)
        for n, f, g in (("X", 5.0, 2.0), ("Y", 7.0, -3.0), ("X", 9.0, 4.0))
    ]
    stability: Any = SimpleNamespace(
        modes=modes, eigenvalues=np.array([2 + 10j, 2 - 10j, -3.0, 6.0, 1 + 2e-8j]), coordinates=("X", "Tz"),
        steady_state=np.array([1e-5, -0.13]), pressure_range=(-3.0, 8.0), time=0.0,
    )  # fmt: skip
    found = predict(stability)
    assert found.eigenvalues == ((2, 10), (2, -10), (-3, 0), (6, 0), (1, 2e-8))
    assert list(found.labelled) == ["X", "Y", "X (2)"]
    assert found.unstable == ["X", "X (2)"]
    assert found.labelled["X (2)"].frequency_Hz == 9.0
    assert found.without_oscillation == [-3.0, 6.0]
    assert found.divergence == 6.0
    assert (found.steady_state, found.pressure_range_Pa) == ({"X": 1e-5, "Tz": -0.13}, (-3.0, 8.0))
    assert found.modes[0].abaqus_damping_ratio == pytest.approx(-2 * 2.0 / (2 * math.pi * 5.0))
    assert [each.damping_ratio for each in found.modes] == [-0.02, 0.03, -0.04]
    assert "Tz = -0.13 rad" in next(turned_far(stability))
    stability.steady_state = np.array([1.0, 0.09])
    assert list(turned_far(stability)) == []
    assert str(COMPLETE) == "complete"
