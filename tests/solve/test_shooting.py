"""Periodic motions by shooting, and flows by neighbours, over a flow that is known in closed form.

(x + iy)˙ = (a (p − r²) + iω)(x + iy): r² = p/(1 + (p/r0² − 1) e^(−2apt)), turned by ωt. Its cycle is the circle r² = p.
"""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from drumsqueal.findings import saturation
from drumsqueal.findings.saturation import Neighbours
from drumsqueal.solve import shooting
from drumsqueal.solve.shooting import Shooting, is_near
from drumsqueal.solve.transient.flow import Flow

PULL, OMEGA, P = 0.4, 5.0, 0.09
SIZE = np.array([0.2, 1.7])
PERIOD, RADIUS = 2 * np.pi / OMEGA, np.sqrt(P)


def after(state, time, parameter=P):
    """Where a state (2,) is later; analytic, so that an imaginary step gives a derivative to round-off."""
    x, y = state
    squared = x * x + y * y
    grown = np.sqrt(parameter / (squared + (parameter - squared) * np.exp(-2 * PULL * parameter * time)))
    cosine, sine = np.cos(OMEGA * time), np.sin(OMEGA * time)
    return grown * np.array([x * cosine - y * sine, x * sine + y * cosine])


def slope(function, at, step=1e-40):
    return np.imag(function(at + 1j * step)) / step


def exact_flow(model, size, state, duration, tolerance, change):
    """As `flow`, of a `model` that is the parameter; without a `change` of it there is no sensitivity."""
    assert tolerance == shooting.TOLERANCE
    start = state * size
    transition = [slope(lambda s, k=k: after(start + s * np.eye(2)[k], duration, model), 0.0) * size[k] for k in (0, 1)]
    rate = slope(lambda time: after(start, time, model), duration) / size
    by_p = np.zeros(2) if change is None else slope(lambda p: after(start, duration, p), model) * change / size
    return Flow(after(start, duration, model) / size, rate, np.stack(transition, axis=1) / size[:, None], by_p, 7, True)


def models(parameter) -> Any:
    return parameter, 1.0


def equations(calls=None):
    def count():
        if calls is not None:
            calls.append(1)

    return Shooting(models, np.append(SIZE, [1.3, 0.5]), count, exact_flow)


def test_a_cycle_is_closed_at_the_parameter_of_the_guess():
    calls: list[int] = []
    shoot = equations(calls)
    guess = shoot.scaled(RADIUS * np.array([0.6, 0.9]), 1.1 * PERIOD, P)
    np.testing.assert_allclose(guess, [0.6 * RADIUS / 0.2, 0.9 * RADIUS / 1.7, 1.1 * PERIOD / 1.3, P / 0.5], rtol=1e-14)
    closed = shoot.close(guess)
    assert closed is not None
    state, period, parameter = shoot.unscaled(closed.unknowns)
    assert np.hypot(*state) == pytest.approx(RADIUS, rel=1e-9)
    assert (period, parameter) == (pytest.approx(PERIOD, rel=1e-9), pytest.approx(P, rel=1e-14))
    # It has moved from the guess at right angles to the rate there.
    rate = exact_flow(P, SIZE, guess[:2], 1.1 * PERIOD, shooting.TOLERANCE, None).rate
    assert abs(rate @ (closed.unknowns[:2] - guess[:2])) < 1e-12 * np.linalg.norm(rate)
    assert closed.residual < 1e-10
    assert 2 <= closed.steps < len(calls)
    np.testing.assert_allclose(shoot.flow(closed.unknowns).end, closed.unknowns[:2], rtol=0, atol=1e-10)


def test_a_condition_and_a_phase_of_ones_own_are_met():
    shoot = equations()
    guess = shoot.scaled(RADIUS * np.array([0.7, 0.8]), 0.95 * PERIOD, 1.2 * P)
    condition, phase = np.array([0.3, -0.2, 0.5, 2.0]), np.array([1.0, 0.4])
    closed = shoot.close(guess, condition, phase)
    assert closed is not None
    state, period, parameter = shoot.unscaled(closed.unknowns)
    assert np.hypot(*state) ** 2 == pytest.approx(parameter, rel=1e-8)
    assert period == pytest.approx(PERIOD, rel=1e-9)
    moved = closed.unknowns - guess
    assert abs(condition @ moved) < 1e-12
    assert abs(phase @ moved[:2]) < 1e-12
    assert abs(parameter - 1.2 * P) > 1e-3 * P  # which it would otherwise be


def test_the_equations_have_the_derivatives_of_the_flow():
    shoot = equations()
    unknowns = shoot.scaled(np.array([0.21, -0.17]), 0.9, 0.13)
    found = shoot.flow(unknowns)

    def missed(x):
        state, period, parameter = x[:2] * SIZE, x[2] * 1.3, x[3] * 0.5
        return after(state, period, parameter) / SIZE - x[:2]

    wanted = np.stack([slope(lambda s, k=k: missed(unknowns + s * np.eye(4)[k]), 0.0) for k in range(4)], axis=1)
    np.testing.assert_allclose(shoot.jacobian(found), wanted, rtol=1e-10)
    units = np.array([2.0, 3.0, 5.0, 7.0])
    other = shoot.in_units(units)
    np.testing.assert_allclose(other.unscaled(unknowns / units)[0], shoot.unscaled(unknowns)[0])
    np.testing.assert_allclose(
        other.jacobian(other.flow(unknowns / units)), wanted * units / units[:2, None], rtol=1e-10
    )


def test_a_motion_is_taken_on_with_a_direction():
    shoot = equations()
    closed = shoot.close(shoot.scaled(RADIUS * np.array([0.6, 0.9]), PERIOD, P))
    assert closed is not None
    direction = np.array([0.3, -0.7, 0.2, 0.9])
    later, along = shoot.moved(closed, direction, 0.31)
    start = closed.unknowns[:2] * SIZE
    np.testing.assert_allclose(later.unknowns[:2] * SIZE, after(start, 0.31), rtol=1e-9)
    np.testing.assert_array_equal(later.unknowns[2:], closed.unknowns[2:])

    def end(s):
        return after(start + s * direction[:2] * SIZE, 0.31, P + s * 0.9 * 0.5) / SIZE

    np.testing.assert_allclose(along, [*slope(end, 0.0), 0.2, 0.9], rtol=1e-9)
    np.testing.assert_allclose(later.flow.end, later.unknowns[:2], rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        shoot.vibration(closed, np.array([0.05])), closed.unknowns[:2] - [0.05 / SIZE[0], 0.0], rtol=1e-14
    )


def test_a_search_that_gets_nowhere_ends():
    def drifts(*given):
        return exact_flow(*given)._replace(end=given[2] + 1.0)  # closes nowhere

    shoot = Shooting(models, np.append(SIZE, [1.3, 0.5]), flow=drifts)
    assert shoot.close(shoot.scaled(RADIUS * np.array([0.6, 0.9]), PERIOD, P)) is None

    def fails(*given):
        return exact_flow(*given)._replace(reached=False)

    lost = Shooting(models, np.append(SIZE, [1.3, 0.5]), flow=fails)
    assert lost.close(lost.scaled(RADIUS * np.array([0.6, 0.9]), PERIOD, P)) is None
    assert is_near(np.array([29.9, -29.9, 29.9, 1e3]))
    assert not is_near(np.array([0.0, -30.1, 1.0, 0.0]))
    assert not is_near(np.array([0.0, 0.0, 30.1, 0.0]))
    assert not is_near(np.array([0.0, 0.0, 1 / 30.1, 0.0]))


# --- neighbours ------------------------------------------------------------------------------------------------------


def test_neighbours_have_the_flow_and_its_derivatives(monkeypatch):
    steady, asked = np.array([0.04]), []

    def integrate(model, there, displacement, velocity, *, duration, sample_rate, tolerance, solver):
        assert (tolerance, solver) == (1e-9, "dopri5")
        np.testing.assert_array_equal(there, steady)
        asked.append(duration)
        times = np.arange(round(duration * sample_rate) + 1) / sample_rate
        states = np.array([after([displacement[0] + 0.04, velocity[0]], time, model) for time in times])
        half = len(states) // 2
        for part in (states[:half], states[half:]):
            yield SimpleNamespace(displacement=part[:, :1], velocity=part[:, 1:], steps=3)

    monkeypatch.setattr(saturation, "integrate", integrate)
    spent: list[Neighbours] = []
    near, model = Neighbours(steady, "dopri5", spent.append), cast("Any", P)
    state = np.array([0.21, -0.17]) / SIZE
    rows = near.samples(model, state * SIZE, 0.8, 5)
    np.testing.assert_allclose(rows, [after(state * SIZE, 0.16 * k) for k in range(6)], rtol=1e-12)
    assert near.steps == 6
    found, exact = near(model, SIZE, state, 0.9), exact_flow(P, SIZE, state, 0.9, shooting.TOLERANCE, None)
    np.testing.assert_allclose(found.end, exact.end, rtol=1e-12)
    # Differences over 3e-5 of the motion's size and time.
    np.testing.assert_allclose(found.transition, exact.transition, rtol=0, atol=3e-4)
    np.testing.assert_allclose(found.rate, exact.rate, rtol=0, atol=1e-3 * np.abs(exact.rate).max())
    np.testing.assert_array_equal(found.sensitivity, 0.0)
    assert found.reached
    assert len(asked) == 1 + 1 + 2 + 1  # samples; the end, a neighbour in each direction, one a little later
    assert spent == [near] * 5  # asked before each of them
    later = asked[-1] - 0.9
    assert later == pytest.approx(1e-9**0.5 * SIZE[0] / SIZE[1], rel=1e-6)
    # What it misses itself by falls to less than a third: the derivatives are those of before. It does not: found anew.
    closing = np.array([RADIUS, 0.0]) / SIZE
    assert np.abs(after(closing * SIZE, PERIOD - 0.02) / SIZE - closing).max() < np.abs(found.end - state).max() / 3
    again = near(model, SIZE, closing, PERIOD - 0.02)
    np.testing.assert_array_equal(again.transition, found.transition)
    assert len(asked) == 6
    near(model, SIZE, closing, PERIOD - 0.01)
    assert len(asked) == 10
    near.forget()
    near(model, SIZE, closing, PERIOD - 0.001)
    assert len(asked) == 14
