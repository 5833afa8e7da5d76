"""A block that lifts off its belt, against an integration of its own: events at lift-off, landing, stick and slip.

The model is that of Hoffmann et al., Journal of Sound and Vibration 257 (2002) 1, whose flutter nothing but lift-off
and stick-slip limit: m x″ + c x′ + k11 x + k12 y = F and m y″ + c y′ + k12 x + k22 y = p0 − N, N = max(0, p0 + k3 y).
"""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from drumsqueal import integrate
from drumsqueal.physics.friction_law import ConstantLaw
from drumsqueal.physics.small_bodies import sprung_block_on_belt
from drumsqueal.questions.cycle.study import find_cycle

SPRINGS = np.array([[2.0, 1.0], [1.0, 2.0 - 4 / 3]])
CONTACT, LOAD = 4 / 3, 1.0
# Friction, damping, belt speed; where it starts and how long it takes to settle: the slowest multiplier to 1e-9.
LIFTS = (0.8, 0.05, 1.0), (0.4, 0.1), 190.0 * 4.49
STICKS = (1.2, 0.05, 0.1), (0.4, 0.1), 45.0 * 4.85
BOUNCES = (0.7, 0.05, 1.0), (2.5, 4.5), 300.0 * 8.09  # where steady sliding is stable
NAMES = ("lifts off", "sticks, too", "bounces")
CASES = pytest.mark.parametrize(("numbers", "start", "settling"), [LIFTS, STICKS, BOUNCES], ids=NAMES)


def block(friction, damping, speed):
    dashpots = damping * np.eye(2)
    how = {"mass": np.ones(2), "springs": SPRINGS, "contact_stiffness": CONTACT, "load": LOAD, "damping": dashpots}
    return sprung_block_on_belt(ConstantLaw(friction), belt_speed=speed, **how)


class Witness:
    """The same model, integrated from event to event; `log` has them, `turns` the turning points of x and of y."""

    def __init__(self, friction, damping, speed):
        self.friction, self.damping, self.speed = friction, damping, speed

    def force(self, u):
        return LOAD + CONTACT * u[1]

    def others(self, u):
        return -self.damping * u[2:] - SPRINGS @ u[:2]

    def rate(self, touches, slip):
        def rate(_, u):
            normal = self.force(u) if touches else 0.0
            along, across = self.others(u)
            held = touches and slip == 0
            return [u[2], u[3], 0.0 if held else along - self.friction * normal * slip, across + LOAD - normal]

        return rate

    def run(self, state, duration):
        time, u, touches = 0.0, np.array(state, dtype=float), self.force(state) >= 0
        slip = np.sign(u[2] - self.speed) if touches else 0.0
        self.log, self.turns = [], ([], [])
        while time < duration:
            names = ["lands"] if not touches else ["lifts off", "slips" if slip == 0 else "stops"]
            functions = {
                "lands": lambda _, u: self.force(u),
                "lifts off": lambda _, u: -self.force(u),
                "stops": lambda _, u, slip=slip: -slip * (u[2] - self.speed),
                "slips": lambda _, u: abs(self.others(u)[0]) - self.friction * self.force(u),
            }
            events = [functions[name] for name in names]
            for event in events:
                event.terminal, event.direction = True, 1
            turning = [lambda _, u: u[2], lambda _, u: u[3]]
            field, how = self.rate(touches, slip), dict[str, Any](rtol=1e-11, atol=1e-12, max_step=0.2)
            found = solve_ivp(field, (time, duration), u, method="DOP853", events=events + turning, **how)
            for k in range(2):
                states = found.y_events[k - 2].reshape(-1, 4)
                self.turns[k].extend(zip(found.t_events[k - 2], states[:, k], strict=True))
            time, u = found.t[-1], found.y[:, -1].copy()
            if found.status != 1:
                break
            what = next(name for name, times in zip(names, found.t_events, strict=False) if len(times))
            self.log.append((time, what))
            if what in ("lands", "lifts off"):
                touches, slip = what == "lands", np.sign(u[2] - self.speed) if what == "lands" else 0.0
            elif what == "slips":
                slip = np.sign(self.others(u)[0])
            else:
                u[2], pull = self.speed, self.others(u)[0]
                slip = 0.0 if abs(pull) <= self.friction * self.force(u) else np.sign(pull)
        return u

    def settled(self, start, settling):
        """Half the peak-to-peak values of x and y, and the period, of its last five cycles."""
        self.run([*start, 0.0, 0.0], settling)
        lands = np.array([time for time, what in self.log if what == "lands"])[-6:]
        turns = ([place for time, place in each if time > lands[0]] for each in self.turns)
        return [(max(each) - min(each)) / 2 for each in turns], np.mean(np.diff(lands))


@pytest.mark.thorough
@CASES
def test_amplitudes_and_period_of_what_lifts_off_are_those_of_the_witness(numbers, start, settling):
    cycle = find_cycle(block(*numbers), {"displacement": list(start)}, settling, sample_rate=4.0)
    amplitudes, period = Witness(*numbers).settled(start, settling)
    # The witness has come to its cycle to 1e-8.
    assert cycle.period_s == pytest.approx(period, rel=1e-7)
    assert list(cycle.amplitude.values()) == pytest.approx(amplitudes, rel=1e-6)
    assert cycle.stable
    assert 0 < cycle.contact_fraction < 1
    assert cycle.samples.observation.normal_force.min() == 0


@pytest.mark.thorough(but=["lifts off"])
@CASES
def test_multipliers_of_what_lifts_off_are_those_of_differences_of_the_witness(numbers, start, settling):
    cycle = find_cycle(block(*numbers), {"displacement": list(start)}, settling, sample_rate=4.0)
    witness, step = Witness(*numbers), 1e-5
    np.testing.assert_allclose(witness.run(cycle.state, cycle.period_s), cycle.state, rtol=0, atol=1e-7)
    sides = ([witness.run(cycle.state + sign * step * unit, cycle.period_s) for unit in np.eye(4)] for sign in (1, -1))
    columns = np.subtract(*map(np.array, sides)).T / (2 * step)
    wanted = sorted(np.linalg.eigvals(columns), key=lambda value: abs(value - 1))[1:]  # without the trivial one
    for value in cycle.multipliers:
        assert min(abs(value - each) for each in wanted) < 2e-5  # errors of 1e-10 over the step


@pytest.mark.thorough(but=["lifts off", "bounces"])
@CASES
def test_a_motion_that_lifts_off_is_that_of_the_witness_and_keeps_its_energy(numbers, start, settling):
    del settling
    model, witness, duration = block(*numbers), Witness(*numbers), 60.0
    found = integrate(model, {"displacement": list(start)}, duration, origin=[0, 0], sample_rate=20.0, tolerance=1e-10)
    end = witness.run([*start, 0.0, 0.0], duration)
    # The tolerance, over some ten periods.
    np.testing.assert_allclose(found.displacement[-1], end[:2], rtol=0, atol=1e-6)
    np.testing.assert_allclose(found.velocity[-1], end[2:], rtol=0, atol=1e-6)
    changes = [(time, what == "stops") for time, what in witness.log if what in ("stops", "slips")]
    held = [each for each in found.changes if each[1]]
    assert all(min(abs(time - other) for other, stops in changes if stops) < 1e-6 for time, _ in held)
    assert np.max(np.abs(found.energy_balance_error)) < 1e-8 * max(1.0, *np.square(start))
    # Where it is in the air it does not press; it is nowhere pulled.
    lifted = LOAD + CONTACT * found.displacement[:, 1] < 0
    assert lifted.any()
    np.testing.assert_array_equal(found.normal_force[lifted], 0.0)
    np.testing.assert_allclose(found.normal_force[~lifted], LOAD + CONTACT * found.displacement[~lifted, 1], rtol=1e-12)
    assert not found.notes
