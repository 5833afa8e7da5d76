"""Eigenvalues along a profile: the instants, the growth on the way, and what is prescribed there."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.errors import SteadyStateError
from drumsqueal.physics.effects.operation import Constant, PiecewiseLinear
from drumsqueal.solve.linear import passage
from drumsqueal.solve.linear.branches import Branch, Branches, Point
from drumsqueal.solve.linear.modes import Mode
from drumsqueal.solve.linear.passage import corners_of, follow_operation, model_at, modes_along, value_at, values_at


def driven(speed, load=None, friction: Any = "some") -> Any:
    """A model of nothing but how it is driven."""
    load = Constant(3.0) if load is None else load
    operation = SimpleNamespace(drum_speed=speed, schedules=(speed, load))
    return SimpleNamespace(
        operation=operation, contact=SimpleNamespace(friction=friction), since=lambda time: ("since", time)
    )


def test_what_is_prescribed_is_interpolated_and_held_beyond_its_ends():
    ramp = PiecewiseLinear([1.0, 3.0, 4.0], [2.0, -6.0, -7.0])
    np.testing.assert_allclose(values_at(ramp, [0.0, 1.5, 3.25, 9.0]), [2.0, 0.0, -6.25, -7.0], rtol=1e-14)
    np.testing.assert_array_equal(values_at(Constant(5.0), [0.0, 1.0]), [5.0, 5.0])
    assert value_at(ramp, 2.0) == -2.0
    assert model_at(driven(ramp), 2.0) == ("since", 2.0)
    assert model_at(driven(ramp, friction=None), 1.5) == ("since", 1.5)
    with pytest.raises(SteadyStateError):
        model_at(driven(ramp), 1.5)


def test_corners_are_those_of_all_schedules_within_the_time():
    speed, load = PiecewiseLinear([-1.0, 0.0, 2.0, 5.0], [1.0] * 4), PiecewiseLinear([2.0, 3.5, 4.0], [1.0] * 3)
    np.testing.assert_array_equal(corners_of(driven(speed, load), 4.0), [0.0, 2.0, 3.5, 4.0])
    np.testing.assert_array_equal(corners_of(driven(Constant(1.0)), 4.0), [0.0, 4.0])


def instants(monkeypatch, model, until):
    asked = []
    monkeypatch.setattr(passage, "follow_modes", lambda model_at, values: asked.append(values) or model_at(values[1]))
    assert follow_operation(model, until) == ("since", asked[0][1])
    return asked[0]


def test_instants_lie_evenly_between_corners_and_close_to_a_standstill(monkeypatch):
    # Speed from 4 to −12 rad/s between 1 and 3 s: at rest at 1.5 s. One part in a thousand of those 2 s beside it.
    found = instants(monkeypatch, driven(PiecewiseLinear([1.0, 3.0], [4.0, -12.0])), 4.0)
    even = np.concatenate([np.linspace(0, 1, 25), np.linspace(1, 3, 25), np.linspace(3, 4, 25), [1.498, 1.502]])
    np.testing.assert_allclose(found, np.unique(even), rtol=1e-14)
    # It starts from rest: only the side after that is within.
    found = instants(monkeypatch, driven(PiecewiseLinear([0.0, 2.0], [0.0, 5.0])), 2.0)
    np.testing.assert_allclose(found, np.unique([*np.linspace(0, 2, 25), 0.002]), rtol=1e-14)


@pytest.mark.parametrize(("pieces", "each"), [(8, 24), (16, 12), (40, 4), (95, 2)])
def test_of_more_pieces_each_gets_fewer_instants(monkeypatch, pieces, each):
    times = np.linspace(0.0, 1.0, pieces + 1)
    found = instants(monkeypatch, driven(PiecewiseLinear(times, 1 + times**2)), 1.0)
    assert len(found) == pieces * each + 1


def test_corners_of_a_measured_profile_are_not_followed(monkeypatch):
    times = np.linspace(0.0, 1.0, 101)
    found = instants(monkeypatch, driven(PiecewiseLinear(times, 1 + times**2)), 1.0)
    np.testing.assert_allclose(np.diff(found), 1 / (95 * 2), rtol=1e-9)


def mode(eigenvalue, right, left) -> Mode:
    return Mode("X", "X", eigenvalue, eigenvalue.real > 0, np.asarray(right, complex), np.asarray(left, complex))


RIGHT, LEFT = np.array([1.0, 0.4 - 0.3j]), np.array([0.8 + 0.1j, 0.5j])
LEFT = LEFT / np.conj(np.vdot(LEFT, RIGHT))


def rate(time):
    """Re λ: a square on either side of its corner at 1 s, which Simpson's rule integrates exactly."""
    return np.where(time < 1, 3 * time**2 - 2, 1 - 4 * (time - 1) ** 2)


def gathered(time):
    return np.where(time < 1, time**3 - 2 * time, -1 + (time - 1) - 4 / 3 * (time - 1) ** 3)


def test_growth_is_the_integral_of_the_rate_and_of_the_change_of_the_shape():
    time = np.array([0.0, 0.1, 0.35, 0.6, 1.0, 1.2, 1.3, 2.0])
    scale = (1 + 0.7 * time) * np.exp(0.4j * time)  # of the shape, whose named coordinate changes with it
    points, others = [], []
    for t, s in zip(time, scale, strict=True):
        there = mode(complex(rate(t), 9.0), RIGHT * s, LEFT / np.conj(s))
        other = mode(complex(-1.0, 20.0), RIGHT, LEFT)
        points.append(Point(t, np.array([t, 2 * t]), (other, there), np.array([20j])))
        others.append(other)
    gap = Point(2.5, np.empty(0), (), np.empty(0, complex), "none")
    after = [
        Point(t, np.array([t, 2 * t]), (mode(complex(t, 9.0), RIGHT, LEFT),), np.array([9j])) for t in (3.0, 3.5, 4.0)
    ]
    lone = Point(5.0, np.array([5.0, 10.0]), (mode(7 + 9j, RIGHT, LEFT),), np.array([9j]))
    first = [point.modes[1] for point in points]
    first += [None, *(point.modes[0] for point in after), None, lone.modes[0]]
    of_first = Branch("X", np.concatenate([time, [2.5, 3.0, 3.5, 4.0, 4.5, 5.0]]), tuple(first))
    of_other = Branch("Y", time, tuple(others))
    branches = Branches((*points, gap, *after, gap._replace(value=4.5), lone), (of_first, of_other), ())
    first, second, other = modes_along(branches, np.array([0.0, 1.0, 5.0]))
    assert (first.label, second.label, other.label) == ("X", "X", "Y")
    np.testing.assert_array_equal(first.time, time)
    np.testing.assert_array_equal(first.steady, np.stack([time, 2 * time], axis=1))
    np.testing.assert_allclose(first.rate, rate(time))
    # ċ = (λ − lᴴ ṙ) c, and lᴴ ṙ = ṡ/s.
    np.testing.assert_allclose(first.growth, gathered(time) - np.log(np.abs(scale)), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(second.time, [3.0, 3.5, 4.0])
    np.testing.assert_allclose(second.growth, [0.0, 3.25 / 2, 3.5], rtol=1e-12)
    np.testing.assert_allclose(second.growth_at(np.array([3.2, 3.9])), [(3.2**2 - 9) / 2, (3.9**2 - 9) / 2], rtol=1e-12)
    np.testing.assert_allclose(other.growth, -time, rtol=0, atol=1e-12)
    assert all(one is each for one, each in zip(other.modes, others, strict=True))
