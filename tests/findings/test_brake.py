"""A shoe as a brake, from stand-ins of its contact: torque, factors, pressures, reactions, locking, by plain sums."""

import math
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from drumsqueal.findings import brake as module
from drumsqueal.findings.brake import Brakes, Sense, _as_pushed, _energised, _reactions, describe_brake, shoes_of
from drumsqueal.physics.bodies.brake import Share

SHAPES = np.random.default_rng(4).normal(size=(3, 2))


class Known(SimpleNamespace):
    """A stand-in by which a function that is evaluated can be told from others."""

    __hash__ = object.__hash__  # pyright: ignore[reportAssignmentType]


def law() -> Any:
    return Known(coefficient=lambda speed: 0.3 + 0.01 * speed)


def side(speed: float, preload: float = 0.0, *, friction: bool = True) -> Any:
    """A shoe whose pressure along its lines falls with the angle, more so at one of its edges."""

    def along_arc(moment, q, v, theta, z):
        assert moment.drum_speed == speed
        return 1e3 * (5.0 - theta + 100 * z * theta + q[0]) + 1e9 * (v**2).sum(), None

    lining = SimpleNamespace(along_arc=along_arc, friction=SimpleNamespace(law=law()) if friction else None)
    shoe = Known(outer_radius=0.1, half_angle=0.8, width=0.04, area=0.0064)
    moment = SimpleNamespace(drum_speed=speed, preload=preload)
    return Known(operation=SimpleNamespace(at=lambda t: moment), lining=lining, shoe=shoe, contact=lining)


def scene(*springs: Any) -> Any:
    return SimpleNamespace(shoe=SimpleNamespace(spring=springs, force=(), solid=None))


@pytest.fixture(autouse=True)
def _observed(monkeypatch) -> None:
    """The normal force is 1000 N and 5000 N more for every unit of the first coordinate."""

    def observe_steady(model, q):
        normal = 1000.0 + 5000.0 * float(q[0])
        seen = SimpleNamespace(normal_force=normal, brake_torque=-0.03 * normal, contact_fraction=0.75)
        return (-7.0, 9.0 + float(q[1])), seen

    monkeypatch.setattr(module, "observe_steady", observe_steady)


@pytest.mark.parametrize(("speed", "ends"), [(5.0, (-1, 1)), (-5.0, (1, -1))])
def test_a_shoe_in_steady_sliding_has_its_numbers(speed, ends):
    q, frictionless = np.array([0.2, 3.0]), np.array([0.05, 0.0])
    found = module._describe(scene(), side(speed), q, 0.5, [-300.0, 200.0], frictionless, None)
    assert (found.normal_force_N, found.time_s, found.contact_fraction) == (2000.0, 0.5, 0.75)
    assert found.brake_torque_N_m == pytest.approx(math.copysign(60.0, -speed))
    assert found.mean_pressure_Pa == pytest.approx(2000.0 / 0.0064)
    assert (found.smallest_pressure_Pa, found.largest_pressure_Pa) == (-7.0, 12.0)
    half = math.degrees(0.8)
    # At z = −20 mm the pressure falls by 3 kPa a radian, at +20 mm it rises by 1.
    assert (found.largest_pressure_at_deg, found.smallest_pressure_at_deg) == (
        pytest.approx(-half),
        pytest.approx(half),
    )
    assert (found.leading_end_deg, found.trailing_end_deg) == pytest.approx((ends[0] * half, ends[1] * half))
    assert found.friction_coefficient == pytest.approx(0.305)
    assert (len(found.angle_deg), found.angle_deg[0]) == (253, pytest.approx(-half))
    np.testing.assert_allclose(found.pressure_Pa, 1e3 * (5.2 - np.deg2rad(found.angle_deg)))
    assert (found.applied_force_N, found.brake_factor) == (500.0, pytest.approx(60.0 / (500.0 * 0.1)))
    assert (found.self_energisation, found.sense) == (pytest.approx(2000.0 / 1250.0), Sense.LEADING)


def test_extremes_of_the_pressure_are_those_of_the_lining_and_not_of_its_middle_line():
    """On the middle line it is largest at 0.3 rad and smallest at an end; at an edge both are further on."""
    of = side(5.0)

    def along_arc(moment, q, v, theta, z):
        bumps = 2 * jnp.exp(-(((theta - 0.3) / 0.1) ** 2)) - (z > 0) * 3 * jnp.exp(-(((theta + 0.4) / 0.1) ** 2))
        return 5.0 + 0.1 * theta + bumps + (z < 0) * 4 * jnp.exp(-(((theta + 0.1) / 0.1) ** 2)), None

    of.lining.along_arc = along_arc
    found = module._describe(scene(), of, np.array([0.2, 3.0]), 0.0, [], None, None)
    step = math.degrees(1.6 / 252)
    assert found.largest_pressure_at_deg == pytest.approx(math.degrees(-0.1), abs=step)
    assert found.smallest_pressure_at_deg == pytest.approx(math.degrees(-0.4), abs=step)


def test_what_is_known_is_not_found_again_and_a_load_beside_forces_has_no_factor():
    q = np.array([0.2, 3.0])
    found = module._describe(scene(), side(5.0, 10.0, friction=False), q, 0.0, [100.0], np.zeros(2), ((1.0, 2.0), 0.5))
    assert (found.smallest_pressure_Pa, found.largest_pressure_Pa, found.contact_fraction) == (1.0, 2.0, 0.5)
    assert (found.applied_force_N, found.brake_factor, found.friction_coefficient) == (100.0, None, 0.0)
    for pushes, frictionless in (([], np.zeros(2)), ([100.0], None)):
        found = module._describe(scene(), side(5.0), q, 0.0, pushes, frictionless, None)
        assert (found.applied_force_N, found.self_energisation, found.sense) == (None, None, None)


def test_friction_presses_a_shoe_on_or_off_by_more_than_a_millionth():
    for factor, sense in (
        (1.5, Sense.LEADING),
        (0.7, Sense.TRAILING),
        (1 + 0.9e-6, Sense.NEITHER),
        (1 - 1.1e-6, Sense.TRAILING),
    ):
        found = _energised(side(5.0), 1250.0 * factor, np.array([0.05, 0.0]))
        assert found == {"self_energisation": pytest.approx(factor), "sense": sense}
    assert _energised(side(5.0), 1.0, np.array([-0.2, 0.0])) == {}
    assert _energised(side(5.0), 1.0, np.array([np.nan, 0.0])) == {}


def test_springs_at_one_point_react_together_against_what_moves_them(monkeypatch):
    def spring(at, direction, stiffness):
        return SimpleNamespace(at=at, direction=direction, stiffness=stiffness)

    diagonal = (0.6, 0.8, 0.0)
    here, there = (0.5, 0.0, 0.0), (1.0, 0.0, 0.0)
    q = np.array([0.2, -0.3])
    springs = spring(here, (1.0, 0, 0), 3e3), spring(there, diagonal, 5e3), spring(here, (0, 0, 1.0), 7e3)
    along = [np.array(each.direction) @ SHAPES * (1 + each.at[0]) for each in springs]
    monkeypatch.setattr(module, "_along_springs", lambda shoe, numbers, composition: along)
    monkeypatch.setattr(module, "numbers_of_shoes", lambda scene: {})
    found = _reactions(scene(*springs), side(5.0), q)
    moved = [1.5 * SHAPES @ q, 2.0 * SHAPES @ q]
    first, second = found
    assert (first.at_m, first.springs, second.springs) == (here, (0, 2), (1,))
    assert first.force_N == pytest.approx((-3e3 * moved[0][0], 0.0, -7e3 * moved[0][2]))
    assert second.force_N == pytest.approx(tuple(-5e3 * (moved[1] @ diagonal) * np.array(diagonal)))


def raised(displacement: float = 1.0, *, runs_off: bool = False) -> Any:
    frictionless = np.array([0.05, 0.0, 0.1, 0.0])
    return SimpleNamespace(
        displacement=np.array([displacement]), runs_off=runs_off, fraction=0.4, frictionless=frictionless
    )


def whole(*preloads: float) -> Any:
    moment = SimpleNamespace(preload=preloads[0], further=tuple((each, None) for each in preloads[1:]))
    return SimpleNamespace(operation=SimpleNamespace(at=lambda t: moment), contact=SimpleNamespace(radius=0.1))


def test_a_brake_has_the_factor_of_all_its_forces_and_locks_where_friction_has_been_raised_so_far():
    one, other = (SimpleNamespace(applied_force_N=force, normal_force_N=200.0) for force in (300.0, None))
    shoes: Any = {"a": one, "b": other}
    found = _as_pushed(whole(0.0, 0.0), 60.0, shoes, 0.3, raised())
    assert found == {"applied_force_N": 300.0, "brake_factor": pytest.approx(60.0 / 30.0), "no_locking_up_to": 5.0}
    assert "brake_factor" not in _as_pushed(whole(0.0, 5.0), 60.0, shoes, 0.3, raised())
    locks = _as_pushed(whole(0.0), 60.0, shoes, 0.3, raised(np.nan, runs_off=True))
    assert locks["locking_coefficient"] == pytest.approx(2.0)
    assert set(_as_pushed(whole(0.0), 60.0, shoes, 0.3, raised(np.nan))) == {"applied_force_N", "brake_factor"}
    assert "no_locking_up_to" not in _as_pushed(whole(0.0), 60.0, shoes, 0.0, raised())
    one.normal_force_N = other.normal_force_N = 0.0
    assert "no_locking_up_to" not in _as_pushed(whole(0.0), 60.0, shoes, 0.3, raised())


def test_several_shoes_share_forces_displacements_and_friction_in_their_order(monkeypatch):
    asked: dict[str, Any] = {}
    sides = [(Share("a.", (0, 1), 4, 0), side(-5.0)), (Share("b.", (2, 3), 4, 1), side(-5.0, friction=False))]
    model = SimpleNamespace(
        sides=sides, pushed=True, contact=SimpleNamespace(radius=0.1),
        operation=SimpleNamespace(at=lambda t: SimpleNamespace(
            drum_speed=-5.0, pushes=[(7.0, None), (-8.0, None), (9.0, None)], preload=0.0, further=((0.0, None),)
        )),
    )  # fmt: skip
    monkeypatch.setattr(module, "while_sliding", lambda linear: (SimpleNamespace(frozen=lambda t: model), 0.0))

    def raise_friction(given, factor):
        asked["factor"] = factor
        return raised()

    def describe(one, side, q, time, pushes, frictionless, known):
        asked.setdefault("shoes", []).append((one.name, q.tolist(), time, pushes, frictionless.tolist(), known))
        return described(-30.0 if one.name == "one" else 50.0)

    def described(torque: float) -> Any:
        return module.ShoeAsBrake.model_construct(brake_torque_N_m=torque, applied_force_N=15.0, normal_force_N=100.0)

    monkeypatch.setattr(module, "raise_friction", raise_friction)
    monkeypatch.setattr(module, "_describe", describe)
    alone = tuple(SimpleNamespace(name=n, shoe=SimpleNamespace(force=(1,) * k)) for n, k in (("one", 2), ("two", 1)))
    several: Any = SimpleNamespace(
        several=True, alone=alone, shoe_names=("a", "b"), shoes=(), elastic_table=lambda body: (body, None)
    )
    stability: Any = SimpleNamespace(
        steady_state=np.arange(4.0), time=0.25, pressure_range=(1, 2), contact_fraction=0.5
    )
    found = describe_brake(several, SimpleNamespace(balanced=False), stability)  # pyright: ignore[reportArgumentType]
    assert isinstance(found, Brakes)
    assert asked["shoes"] == [
        ("one", [0.0, 1.0], 0.25, [7.0, -8.0], [0.05, 0.0], None), ("two", [2.0, 3.0], 0.25, [9.0], [0.1, 0.0], None)
    ]  # fmt: skip
    assert asked["factor"] == pytest.approx(5.0 / 0.305)
    assert (found.brake_torque_N_m, found.friction_coefficient, found.applied_force_N) == (
        20.0,
        pytest.approx(0.305),
        30.0,
    )
    assert (found.brake_factor, found.no_locking_up_to) == (pytest.approx(20.0 / 3.0), 5.0)
    assert list(shoes_of(found)) == ["a", "b"]
    assert describe_brake(several, SimpleNamespace(balanced=True), stability) is None  # pyright: ignore[reportArgumentType]
