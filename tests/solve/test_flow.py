"""The flow of a block that slips, sticks and slips again, and its derivatives, against its motion in closed form."""

import dataclasses
from types import SimpleNamespace
from typing import Any, NamedTuple

import jax
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.friction_law import ExponentialLaw, StepLaw
from drumsqueal.physics.small_bodies import block_on_belt, sprung_block_on_belt
from drumsqueal.solve.transient import flow as module
from drumsqueal.solve.transient import sticking
from drumsqueal.solve.transient.flow import StickTransition, Stretch, _time_shift, flow, follow_stretch
from drumsqueal.solve.transient.runge_kutta import DEFAULT
from drumsqueal.solve.transient.state import local_tolerance
from drumsqueal.solve.transient.sticking import StuckModel

MASS, STIFFNESS, LOAD, STATIC, KINETIC, BELT = 0.7, 3.0, 2.0, 0.6, 0.35, 0.25
DURATION = 4.0
LOADS = 0.7  # by what part of itself the load rises where the belt's speed does by 1 m/s


OMEGA, MIDDLE, HELD_TO = np.sqrt(STIFFNESS / MASS), KINETIC * LOAD / STIFFNESS, STATIC * LOAD / STIFFNESS


def slipping(x, v, time, side=-1, load=1.0):
    """Place and velocity after a time in which it slips, slower than the belt or (side 1) faster."""
    cosine, sine, middle = np.cos(OMEGA * time), np.sin(OMEGA * time), -side * MIDDLE * load
    return middle + (x - middle) * cosine + v / OMEGA * sine, v * cosine - (x - middle) * OMEGA * sine


def caught_up(x, v, belt, side, duration, load=1.0) -> Any:
    """When it has the belt's velocity, from 0.05 s on; the duration if it never has."""
    times = np.linspace(0.05, duration, 2001)
    apart = side * (slipping(x, v, times, side, load)[1] - belt) > 1e-9
    for k in np.flatnonzero(apart[:-1] & ~apart[1:])[:1]:
        return brentq(lambda t: slipping(x, v, t, side, load)[1] - belt, times[k], times[k + 1], xtol=1e-15)
    return duration


def after(given):
    """Of a place, a velocity and a parameter: where it is in the end, and when it stops and slips.

    The parameter moves the belt's speed and, by so many times its load, the load.
    """
    x, v, belt = given
    load, first = 1 + LOADS * (belt - BELT), 0.0
    if v > belt:  # and passes the belt's velocity where the spring pulls by more than friction holds
        first = caught_up(x, v, belt, 1, DURATION, load)
        x, v = slipping(x, v, first, 1, load)
    stops = first + caught_up(x, v, belt, -1, DURATION - first, load)
    x, times = slipping(x, v, stops - first, -1, load)[0], [first] * (first > 0) + [stops]
    slips = stops + (HELD_TO * load - x) / belt
    if slips > DURATION:
        return np.array([x + belt * (DURATION - stops), belt]), times
    return np.array(slipping(HELD_TO * load, belt, DURATION - slips, -1, load)), [*times, slips]


def of_belt_speed(model, load=0.0):
    """The derivative of a model with respect to the speed of its belt, with which the load (N) may rise."""
    still = jax.tree.map(np.zeros_like, model)
    faster = dataclasses.replace(still.operation.drum_speed, value=np.asarray(1.0))
    heavier = dataclasses.replace(still.operation.preload, value=np.asarray(load))
    operation = dataclasses.replace(still.operation, drum_speed=faster, preload=heavier)
    return dataclasses.replace(still, operation=operation)


def closed_stretch(model, size, state, duration, local, change, least):
    """A stretch of the block in closed form: until the belt is caught up with, or until friction gives way."""
    del local, change
    (x, v), duration = state * size, float(duration)
    if isinstance(model, StuckModel):
        assert v == pytest.approx(BELT)
        time = min((HELD_TO - x) / BELT, duration)
        of_load, end, rate, tangents = (
            np.zeros(2),
            [x + BELT * time, BELT],
            [BELT, 0.0],
            np.array([[1.0, time], [0.0, 1.0]]),
        )
    else:
        assert abs(v - BELT) > least
        side = 1 if v > BELT else -1
        time = caught_up(x, v, BELT, side, duration)
        end = slipping(x, v, time, side)
        rate, c, s = [end[1], -(OMEGA**2) * (end[0] + side * MIDDLE)], np.cos(OMEGA * time), np.sin(OMEGA * time)
        tangents, rises = np.array([[c, s / OMEGA], [-OMEGA * s, c]]), -side * MIDDLE * LOADS
        of_load = rises * np.array([1 - c, OMEGA * s])
    scaled = np.column_stack([tangents * size / size[:, None], of_load / size])
    halted = time < duration
    return Stretch(np.array(end) / size, np.array(rate) / size, scaled, time, 7, not halted, halted)


@pytest.mark.thorough(but=["closed-slow", "closed-fast"])
@pytest.mark.parametrize("begin", ["slow", "fast"])
@pytest.mark.parametrize("stretches", ["closed", "integrated"])
def test_a_block_that_sticks_and_slips_has_the_derivatives_of_its_motion(monkeypatch, stretches, begin):
    if stretches == "closed":
        for program in ("drum_motion", "rate_at", "slip", "slip_alone", "_excess_derivatives", "_slip_and_drum"):
            monkeypatch.setattr(module, program, Interpreted(getattr(module, program)._function))
        monkeypatch.setattr(module, "follow_stretch", closed_stretch)
        monkeypatch.setattr(sticking, "_find_stiction", Interpreted(sticking._find_stiction._function))
    model = block_on_belt(StepLaw(STATIC, KINETIC), mass=MASS, stiffness=STIFFNESS, load=LOAD, belt_speed=BELT)
    change = of_belt_speed(model, LOADS * LOAD)
    size, start = np.array([0.3, 0.4]), np.array([0.5, -0.1] if begin == "slow" else [0.6, 0.5])
    found = flow(model, size, start / size, DURATION, 1e-10, change)
    given = np.append(start, BELT)
    end, times = after(given)
    np.testing.assert_allclose(found.end * size, end, rtol=1e-8)
    reversing = (StickTransition.REVERSES, StickTransition.STICKS)
    assert found.pattern == ((StickTransition.STICKS, StickTransition.SLIPS) if begin == "slow" else reversing)
    np.testing.assert_allclose([when for when, _ in found.changes], times, rtol=1e-9)
    assert (found.lost, found.reached) == (1, True)
    assert found.steps == 7 * (1 + len(times)) if stretches == "closed" else found.steps > 20
    # Of its place, its velocity and the belt's: differences over 1e-6.
    moved = [(after(given + h)[0] - after(given - h)[0]) / 2e-6 for h in 1e-6 * np.eye(3)]
    np.testing.assert_allclose(found.transition * size[:, None] / size, np.stack(moved[:2], axis=1), rtol=1e-6)
    np.testing.assert_allclose(found.sensitivity * size, moved[2], rtol=1e-6)
    rate = [end[1], -(OMEGA**2) * (end[0] - MIDDLE) if begin == "slow" else 0.0]
    np.testing.assert_allclose(found.rate * size, rate, rtol=1e-7)


class Slide(NamedTuple):
    """A block on two springs that slides on a belt whose friction falls with the slip speed: unlike in every number."""

    mass = np.array([0.7, 1.9])
    springs = np.array([[3.0, 0.6], [0.6, 1.7]])
    dashpots = np.array([[0.15, 0.04], [0.04, 0.3]])
    law = (0.6, 0.35, 0.4)
    contact, load, belt = 2.3, 1.4, -3.1
    size, start = np.array([0.3, 0.2, 0.4, 0.7]), np.array([0.5, -0.1, 0.3, -0.2])

    def model(self):
        """The package's."""
        how = {"mass": self.mass, "springs": self.springs, "damping": self.dashpots, "load": self.load}
        law = ExponentialLaw(*self.law)
        return sprung_block_on_belt(law, contact_stiffness=self.contact, belt_speed=self.belt, separation=False, **how)

    def rate(self, y, belt):
        """ẏ, also of complex numbers; it slips forwards on a belt that runs backwards."""
        (x, into), v = y[:2], y[2:]
        static, kinetic, decay = self.law
        force = self.load + self.contact * into
        friction = -(kinetic + (static - kinetic) * np.exp(-decay * (v[0] - belt))) * force
        pushed = np.array([friction, self.load - force]) - self.springs @ [x, into] - self.dashpots @ v
        return np.concatenate([v, pushed / self.mass])

    def after(self, start, belt, duration):
        found = solve_ivp(
            lambda _, y: self.rate(y, belt), (0, duration), start, method="DOP853", rtol=1e-12, atol=1e-14
        )
        return found.y[:, -1]


def test_tangents_of_a_stretch_that_slips_are_its_derivatives_by_complex_steps():
    slide, duration, tiny = Slide(), 0.3, 1e-30
    model, local = slide.model(), np.asarray(local_tolerance(1e-9, DEFAULT))
    follow = Interpreted(follow_stretch._function)
    leg = follow(model, slide.size, slide.start / slide.size, np.float64(duration), local, of_belt_speed(model), None)
    end = slide.after(slide.start, slide.belt, duration)
    moved = [slide.after(slide.start + 1j * tiny * each, slide.belt, duration).imag / tiny for each in np.eye(4)]
    faster = slide.after(slide.start + 0j, slide.belt + 1j * tiny, duration).imag / tiny
    # Errors of its dozens of steps, 1e-11 each.
    np.testing.assert_allclose(leg.end * slide.size, end, rtol=1e-9)
    np.testing.assert_allclose(leg.rate * slide.size, slide.rate(end, slide.belt), rtol=1e-8)
    np.testing.assert_allclose(leg.tangents[:, :4] * slide.size[:, None] / slide.size, np.transpose(moved), rtol=1e-7)
    np.testing.assert_allclose(leg.tangents[:, 4] * slide.size, faster, rtol=1e-7)
    assert (float(leg.time), bool(leg.reached), bool(leg.halted)) == (duration, True, False)


def test_a_tangent_is_displaced_along_the_motion_by_what_moves_its_growth_least():
    of_tangents, of_rate = np.array([[3.0, -1.0], [0.5, 2.0], [-4.0, 7.0]]), np.array([2.0, -5.0])
    local, longest = np.asarray(0.3), np.asarray(50.0)
    for start, h in ((0.4, 4.9), (0.4, 5.1)):  # a tenth of the longest step between them
        step: Any = SimpleNamespace(start=np.asarray(start), end=np.asarray(start + h))
        found = Interpreted(lambda *given: _time_shift(step, *given))(of_tangents, of_rate, local, longest)  # noqa: B023
        wanted = of_tangents @ of_rate / (of_rate @ of_rate + (0.3 / 50.0 / h) ** 2)
        np.testing.assert_allclose(found, wanted[:, None] if h < 5.0 else np.zeros((3, 1)), rtol=1e-14)


def test_neighbours_are_central_differences_also_of_those_that_stop_on_the_way(monkeypatch):
    """A map in closed form in the place of motions; two of them stop on the way, of which one is followed further."""
    slide, matrix = (
        Slide(),
        np.array([[2.0, -0.3, 0.4, 1.0], [0.0, 1.5, 0.2, -7.0], [1.0, 1.0, 3.0, 0.1], [0, 0, 9, 1]]),
    )
    stopped = {3, 5}
    calls = []

    def mapped(y):
        return matrix @ y + y[0] * y

    def ends(model, size, starts, duration, local, least):
        calls.append((starts, float(duration), float(local), least))
        return [np.full(4, np.nan) if k in stopped else mapped(each) for k, each in enumerate(np.asarray(starts))]

    def followed(model, size, start, duration, tolerance):
        reached = np.array_equal(start, calls[-1][0][3])
        return SimpleNamespace(end=mapped(start), reached=reached)

    monkeypatch.setattr(module, "_ends", ends)
    monkeypatch.setattr(module, "flow", followed)
    monkeypatch.setattr(module, "slip_alone", Interpreted(module.slip_alone._function))
    state, directions = np.array([0.3, -1.2, 0.7, 2.0]), np.array([[1.0, 2.0, 0], [0, 3.0, 0], [1, -1, 1], [0, 5.0, 2]])
    end, moved = module.neighbours(slide.model(), slide.size, state, directions, 1.7)
    np.testing.assert_allclose(end, mapped(state), rtol=1e-15)
    slopes = matrix + state[0] * np.eye(4) + np.outer(state, [1.0, 0, 0, 0])
    # Differences of a quadratic are exact but for round-off, 1e-16 over 1e-6; the second direction's are of no end.
    np.testing.assert_allclose(moved[:, [0, 2]], (slopes @ directions)[:, [0, 2]], rtol=1e-8)
    ((starts, duration, local, least),) = calls
    assert starts.shape == (7, 4)
    assert (duration, local) == (1.7, float(local_tolerance(module.TIGHT, DEFAULT)))
    assert np.isnan(moved[:, 1]).all()
    # What one of its coordinates that can stick does to the slip at its size.
    assert float(least) == pytest.approx(module.TIGHT * slide.size[2])


def test_a_state_is_measured_by_amplitudes_and_slip_by_its_distance_from_the_belts_velocity():
    model = block_on_belt(StepLaw(STATIC, KINETIC), mass=MASS, stiffness=STIFFNESS, load=LOAD, belt_speed=BELT)
    size = Interpreted(module.state_size._function)(model, np.array([0.3]), np.array([-0.8]))
    place = np.hypot(0.3, 0.8 / OMEGA)
    np.testing.assert_allclose(size, [place, OMEGA * place], rtol=1e-12)
    speeds = Interpreted(module.slip_speeds._function)(model, np.array([[0.3], [-0.8], [BELT]]))
    np.testing.assert_allclose(speeds, [0.05, 1.05, 0.0], rtol=1e-14)
