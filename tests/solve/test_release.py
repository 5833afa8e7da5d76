"""The end of sticking is found by the transient and by the flow map alike, however coarse the samples."""

import dataclasses
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from drumsqueal.dynamics.cycles import cycle as orbit
from drumsqueal.dynamics.cycles.search import cycle_from
from drumsqueal.errors import CycleError, IntegrationError
from drumsqueal.physics.effects.operation import Operation, PiecewiseLinear
from drumsqueal.physics.friction_law import ConstantLaw, StepLaw
from drumsqueal.physics.small_bodies import block_on_belt, sprung_block_on_belt
from drumsqueal.solve.shooting import ShootingStart
from drumsqueal.solve.transient import segment, stick_slip
from drumsqueal.solve.transient.flow import StickTransition, flow
from drumsqueal.solve.transient.integrate import integrate
from profiles import unchanging

MASS, STIFFNESS, LOAD, FREQUENCY = 0.5, 2.0, 2.0, 10.0
HELD = 0.15 * LOAD  # N
forced = partial(block_on_belt, StepLaw(0.15, 0.1), mass=MASS, stiffness=STIFFNESS, load=LOAD)


def changes(model, place, velocity, duration, rate, tolerance=1e-10):
    """Between stick and slip, of a transient of so many samples a second."""
    how: Any = {"duration": duration, "sample_rate": rate, "tolerance": tolerance}
    chunks = integrate(model, np.zeros(len(place)), np.array(place), np.array(velocity), **how)
    return [change for chunk in chunks for change in chunk.changes]


def first_root(function, end, count=2_000_001):
    """The first time at which a function of time exceeds zero."""
    times = np.linspace(0.0, end, count)
    after = int(np.argmax(function(times) > 0))
    assert after > 0
    return brentq(function, times[after - 1], times[after], xtol=1e-15)


@pytest.mark.thorough
@pytest.mark.parametrize("rate", [0.5, 20.0, 54.7, 2000.0])
@pytest.mark.parametrize(("speed", "amplitude"), [(0.0, 0.5), (0.0, 0.3 * (1 + 1e-9)), (0.2, 0.2), (0.01, 0.28)])
def test_a_harmonic_force_releases_a_block_however_coarse_the_samples(speed, amplitude, rate):
    # What holds it on the belt: the spring's ramp and the force. At 20 Hz all samples are where the force is zero.
    def excess(time):
        needed = STIFFNESS * speed * time - amplitude * np.sin(2 * np.pi * FREQUENCY * time)
        return np.abs(needed) - HELD

    model = forced(belt_speed=speed, forces={"X": (amplitude, FREQUENCY)})
    (_, stuck), (release, still), *_ = changes(model, [0.0], [speed], 4.0, rate)
    assert (stuck, still) == (True, False)
    # 1e-14 of a step, and round-off; friction gives way at 1e-5 of its usual rate where the force just suffices.
    assert release == pytest.approx(first_root(excess, 4.0), rel=0, abs=1e-13)


@pytest.mark.parametrize("rate", [0.5, 20.0, 2000.0])
def test_a_force_just_too_small_releases_nothing(rate):
    model = forced(forces={"X": (HELD * (1 - 1e-9), FREQUENCY)})
    assert changes(model, [0.0], [0.0], 4.0, rate) == [(0.0, True)]


# A block that moves two ways: what moves freely while it sticks is its motion into the belt.
SPRINGS, CONTACT, DAMPING = np.array([[1.0, -0.3], [-0.3, 1.0]]), 1.0, 0.05
# A cycle next to grazing: friction gives way for 2 ms there, and for good 0.8 s later. A disturbance grows 1600-fold in
# a period.
GRAZING_SPEED = 0.1298188969947441
GRAZING = [0.31876656083621685, 0.08991441701684344, -0.24211128161625498, -0.1934093364561873, 9.141040521822616]


def sprung(speed):
    return sprung_block_on_belt(
        StepLaw(0.6, 0.3), mass=[1.0, 1.0], springs=SPRINGS, contact_stiffness=CONTACT,
        damping=DAMPING * np.eye(2), belt_speed=speed,
    )  # fmt: skip


def excess_while_held(speed, x, y, rate):
    """Of the force that holds it, over static friction, as a function of time: y is a ramp and a damped sine."""
    across, coupling = SPRINGS[1, 1] + CONTACT, SPRINGS[0, 1]
    slope = -coupling * speed / across
    level = (-coupling * x - DAMPING * slope) / across
    decay, omega = DAMPING / 2, np.sqrt(across - DAMPING**2 / 4)
    first, second = y - level, (rate - slope + DAMPING / 2 * (y - level)) / omega

    def excess(time):
        wave = np.exp(-decay * time) * (first * np.cos(omega * time) + second * np.sin(omega * time))
        depth = level + slope * time + wave
        needed = SPRINGS[0, 0] * (x + speed * time) + coupling * depth + DAMPING * speed
        return np.abs(needed) - 0.6 * (1 + CONTACT * depth)

    return excess


@pytest.mark.thorough
@pytest.mark.parametrize("rate", [0.5, 54.7, 5470.0])
@pytest.mark.parametrize("beyond", [1e-3, 1e-6])
def test_a_free_vibration_releases_a_block_however_shortly(beyond, rate):
    # The vibration across is so strong that friction gives way by so little (N) at the first trough of the load.
    speed, x, y = 0.13, 0.3, 0.0
    times = np.linspace(0.0, 5.0, 200_001)

    def peak(velocity):
        values = excess_while_held(speed, x, y, velocity)(times)
        turns = np.flatnonzero((values[1:-1] > values[:-2]) & (values[1:-1] >= values[2:]))
        return values[1 + turns[0]] - beyond if turns.size else -1.0

    velocity = brentq(peak, -0.25, -0.5, xtol=1e-15)
    exact = first_root(excess_while_held(speed, x, y, velocity), 5.0)
    (_, stuck), (release, still), *_ = changes(sprung(speed), [x, y], [speed, velocity], 10.0, rate, 1e-11)
    assert (stuck, still) == (True, False)
    # Errors of 1e-11 in the motion, over the rate of what friction has left, the root of `beyond`.
    assert release == pytest.approx(exact, rel=0, abs=1e-10 / np.sqrt(beyond))


@pytest.mark.parametrize("rate", [0.5, 2000.0])
def test_a_dip_of_the_load_releases_a_block(rate):
    # The load falls to a corner and rises again: the spring's 0.25 N is held by 0.15 N.
    time, load = np.array([1.0, 1.003, 1.006]), np.array([2.0, 1.6, 2.0])
    model = dataclasses.replace(forced(), operation=Operation(unchanging(0.0, 4), PiecewiseLinear(time, load)))
    (_, stuck), (release, still), *_ = changes(model, [0.125], [0.0], 2.0, rate)
    assert (stuck, still) == (True, False)
    assert release == pytest.approx(1.0 + 0.003 * (2.0 - 0.25 / 0.15) / 0.4, rel=0, abs=1e-13)


@pytest.mark.thorough
def test_samples_a_hundred_times_as_many_see_the_same_changes():
    model = forced(belt_speed=0.01, forces={"X": (0.28, FREQUENCY)})
    coarse, fine = (changes(model, [0.0], [0.01], 4.0, rate) for rate in (54.7, 5470.0))
    assert len(coarse) == len(fine) > 50
    assert [sticks for _, sticks in coarse] == [sticks for _, sticks in fine]
    # The slip between them ends to a tolerance of 1e-10 of its motion.
    assert [time for time, _ in coarse] == pytest.approx([time for time, _ in fine], rel=0, abs=1e-8)
    assert coarse[1] == pytest.approx(fine[1], rel=0, abs=1e-13)  # what it does till then is exact


@pytest.mark.thorough
def test_flow_and_transient_see_the_same_changes_next_to_grazing():
    *state, period = GRAZING
    model = sprung(GRAZING_SPEED)
    sampled = changes(model, state[:2], state[2:], period, 500 / period)
    found = flow(model, np.ones(4), np.array(state), period, 1e-10)
    assert found.pattern == (StickTransition.STICKS, StickTransition.SLIPS)
    # Errors of 1e-10 where it begins to stick, which the shallow end of sticking enlarges by hundreds.
    assert [time for time, _ in found.changes] == pytest.approx([time for time, _ in sampled], rel=0, abs=1e-8)
    chunks = integrate(
        model, np.zeros(2), np.array(state[:2]), np.array(state[2:]), duration=sampled[0][0], tolerance=1e-11,
        sample_rate=10 / sampled[0][0],
    )  # fmt: skip
    *_, last = chunks
    (x, y), rate = last.displacement[-1], last.velocity[-1, 1]
    sticks = first_root(excess_while_held(GRAZING_SPEED, x, y, rate), 5.0)
    assert found.changes[1][0] - found.changes[0][0] == pytest.approx(sticks, rel=0, abs=1e-7)


@pytest.mark.thorough
def test_a_cycle_next_to_grazing_is_described_as_it_is():
    *state, period = GRAZING
    model = sprung(GRAZING_SPEED)
    cycle = cycle_from(model, ShootingStart(np.array(state), period, "a branch"), np.zeros(2))
    assert cycle.period_s == pytest.approx(period, rel=1e-6)
    # What its samples show is the motion that closes: it ends where it began, with 1e-10 enlarged 1600-fold.
    samples = cycle.samples
    np.testing.assert_allclose(samples.displacement[-1], samples.displacement[0], rtol=0, atol=1e-6)
    assert cycle.amplitude["X"] == pytest.approx(np.ptp(samples.displacement[:, 0]) / 2, rel=1e-3)
    assert cycle.sticking_fraction == pytest.approx(np.mean(samples.observation.sticking[:-1]), abs=2 / 500)


@pytest.mark.thorough
@pytest.mark.parametrize("differ", [lambda found: found[:-1], lambda found: [(time + 0.8, s) for time, s in found]])
def test_a_cycle_whose_samples_stick_and_slip_otherwise_is_not_described(monkeypatch, differ):
    sampled = orbit._sample

    def otherwise(*given):
        chunk = sampled(*given)
        return chunk._replace(changes=tuple(differ(chunk.changes)))

    monkeypatch.setattr(orbit, "_sample", otherwise)
    block = block_on_belt(StepLaw(1.0, 0.5), belt_speed=0.2)
    period = 5.0 + 2 * (np.pi - np.arctan(0.5 / 0.2))
    start = ShootingStart(np.array([0.5 - np.hypot(0.5, 0.2), 0.0]), period, "its closed form")
    with pytest.raises(CycleError, match="integrated again: it nearly grazes"):
        cycle_from(block, start, np.array([0.5]))


# Changes without number


@pytest.mark.thorough
def test_a_chunk_may_have_thousands_of_changes():
    # Four in each period of the force (Den Hartog), in one chunk of a minute.
    model = block_on_belt(ConstantLaw(0.2), mass=MASS, stiffness=STIFFNESS, load=LOAD, forces={"X": (0.5, FREQUENCY)})
    coarse, fine = (changes(model, [0.0], [0.0], 30.0, rate, 1e-9) for rate in (1.0, 100.0))
    assert len(coarse) == len(fine) > stick_slip.MOST_CHANGES
    assert [sticks for _, sticks in coarse] == [sticks for _, sticks in fine]
    assert [time for time, _ in coarse] == pytest.approx([time for time, _ in fine], rel=0, abs=1e-7)


def test_chatter_that_does_not_get_on_is_reported_as_such(monkeypatch):
    made = []

    def advance(*given):
        made.append(given)
        found = segment.advance(*given)
        if found.reached and given[-3]:  # a call with changes
            return found._replace(time=float(given[3].offset) + 1e-9, reached=False, halted=True)
        return found

    monkeypatch.setattr(stick_slip, "advance", advance)
    with pytest.raises(IntegrationError, match=r"changes between stick and slip without getting on: 1,000 times"):
        changes(forced(), [0.0], [0.0], 1.0, 100.0)
    assert len(made) == 2


@pytest.mark.parametrize("later", [1e-10, 6e-10, 3e-9])
def test_a_release_just_short_of_the_end_of_a_chunk_ends(later):
    # A step that is made again up to just short of the end of the chunk was stretched to that end, time and again.
    model = block_on_belt(StepLaw(1.0, 0.5), damping=0.05, belt_speed=0.1)

    def record(duration):
        how: Any = {"duration": duration, "sample_rate": 100 / duration, "tolerance": 1e-10, "solver": "dopri8"}
        chunks = integrate(model, np.zeros(1), np.array([1.0]), np.array([0.1]), **how)
        return [change for chunk in chunks for change in chunk.changes]

    released = next(time for time, sticks in record(20.0) if not sticks)
    (_, stuck), (at, still) = record(released + later)
    assert (stuck, still) == (True, False)
    assert at == pytest.approx(released, abs=1e-8)  # 1e-9 of a step of ten seconds
