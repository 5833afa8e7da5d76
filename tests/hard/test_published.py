"""Small bodies with exact or published solutions, through the model, the methods and the events that the shoe has.

Everything is in SI units of order one. A tolerance of 1e-10 leaves errors of some 1e-9: what was found is stated with
each bound, which leaves room for another machine's rounding.
"""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

from bodies import HyperbolicLaw, eigenvalues, falling_friction, run
from drumsqueal.physics.effects.forcing import Forcing
from drumsqueal.physics.effects.operation import Operation, PiecewiseLinear
from drumsqueal.physics.friction_law import ConstantLaw, StepLaw
from drumsqueal.physics.small_bodies import block_on_belt, sprung_block_on_belt
from drumsqueal.solve.linear.modes import analyse_stability, growth_rate
from drumsqueal.solve.transient.integrate import integrate
from profiles import unchanging

BELT = 0.2  # m/s
HOW = {"sample_rate": 50.0, "tolerance": 1e-10}


def phases(found) -> tuple[np.ndarray, np.ndarray]:
    """How long it stuck and slipped each time after the first, in turn (s)."""
    assert [sticks for _, sticks in found.changes[:3]] == [True, False, True]
    times = np.array([time for time, _ in found.changes])
    lasted = np.diff(times)[1:]
    return lasted[1::2], lasted[::2]


# --- stick and slip --------------------------------------------------------------------------------------------------


def test_a_block_whose_friction_drops_when_it_slips():
    # Elementary: with Δ = (F_s − F_k)/k it sticks for 2Δ/V and slips for (2/ω)(π − arctan(Δω/V)) about F_k/k.
    found = run(block_on_belt(StepLaw(1.0, 0.5), belt_speed=BELT), [0.0], [BELT], duration=50.0, **HOW)
    sticks, slips = phases(found)
    assert len(sticks) == 5
    # Found: 6e-11, 1.3e-10 and, of the amplitude, 5e-10. Changing over takes place at a slip of 1e-10 of the speed.
    np.testing.assert_allclose(sticks, 5.0, rtol=1e-8)
    np.testing.assert_allclose(slips, 2 * (np.pi - np.arctan(2.5)), rtol=1e-8)
    places = found.turning_points("X")[1]
    np.testing.assert_allclose(np.abs(places - 0.5), np.sqrt(0.25 + BELT**2), rtol=1e-8)
    # While it sticks it moves with the belt, to the last digit.
    sticking = (found.time > found.changes[0][0]) & (found.time < found.changes[1][0])
    np.testing.assert_array_equal(found.velocity[sticking], BELT)
    # The motion is resolved to 1e-10 a step of its energy, of order one.
    assert np.max(np.abs(found.energy_balance_error)) < 1e-8


@pytest.mark.thorough
def test_leines_block():
    # Leine et al., Nonlinear Dynamics 16 (1998) 41: figures recomputed at tight tolerance, to all digits given.
    found = run(block_on_belt(HyperbolicLaw(), belt_speed=BELT), [0.0], [BELT], duration=50.0, **HOW)
    sticks, slips = phases(found)
    np.testing.assert_allclose(slips, 4.2959995, rtol=2e-8)  # half of the last digit is 1.2e-8
    np.testing.assert_allclose(sticks + slips[:-1][: len(sticks)], 12.0010313, rtol=2e-8)
    places = found.turning_points("X")[1]
    assert places.max() == pytest.approx(1.13394468, rel=2e-8)
    assert places.min() == pytest.approx(-0.55543269, rel=1e-7)


def test_a_block_comes_to_rest_under_coulombs_friction():
    # Elementary: half a period of π/ω between turning points that are 2F/k nearer each; it stops within F_s/k.
    model = block_on_belt(StepLaw(0.15, 0.1), mass=0.5, stiffness=2.0, load=2.0)
    found = run(model, [1.03], [0.0], duration=20.0, **HOW)
    half, fraction = np.pi / 2, 0.1  # s, m: π/ω and F/k
    swing = np.minimum(np.floor(found.time / half), 4)  # the fifth ends within F_s/k = 0.15 m
    amplitude, phase = 1.03 - 2 * fraction * swing, np.minimum(2 * found.time - np.pi * swing, np.pi)
    wanted = (-1.0) ** swing * ((amplitude - fraction) * np.cos(phase) + fraction)
    assert abs(wanted[-1]) < 0.15 < amplitude[-1]
    # Found: 4e-10 and 1e-10.
    np.testing.assert_allclose(found.displacement[:, 0], wanted, rtol=0, atol=1e-8)
    assert found.changes == ((pytest.approx(5 * half, rel=1e-8), True),)
    # It does not creep at all: not by a bit.
    resting = found.time > found.changes[-1][0]
    assert resting.sum() > 100
    np.testing.assert_array_equal(found.velocity[resting], 0.0)
    assert np.ptp(found.displacement[resting]) == 0


# --- starts at rest ---------------------------------------------------------------------------------------------------


def forced(model, amplitude, frequency, phase=0.0):
    force = Forcing(jnp.array([amplitude]), frequency, phase, (0,))
    return dataclasses.replace(model, others=(*model.others, force))


@pytest.mark.parametrize("tolerance", [1e-3, 1e-10])
def test_a_block_at_rest_is_drawn_along_by_its_belt(tolerance):
    # x = (F_k/k)(1 − cos ωt) until it is as fast as the belt; then it sticks until the spring holds F_s.
    model = block_on_belt(StepLaw(0.6, 0.4), belt_speed=BELT, stiffness=0.01)
    found = run(model, [0.0], [0.0], duration=400.0, sample_rate=10.0, tolerance=tolerance)
    begins = np.arcsin(BELT * 0.1 / 0.4) / 0.1
    ends = begins + (60 - 40 * (1 - np.cos(0.1 * begins))) / BELT
    assert [sticks for _, sticks in found.changes[:2]] == [True, False]
    # The belt's speed counts as met within the tolerance of a motion of that energy: 3e-10 s was found at 1e-10.
    np.testing.assert_allclose([time for time, _ in found.changes[:2]], [begins, ends], rtol=10 * tolerance)


@pytest.mark.thorough
@pytest.mark.parametrize(("ratio", "fraction"), [(0.8, 0.2), (1.5, 0.2), (2.0, 0.15)])
def test_a_forced_block_comes_to_den_hartogs_amplitude(ratio, fraction):
    # Trans. ASME 53 (1931) APM-107: without a stop x0/a = √(V² − (F/P)² U²), V = 1/(1 − β²), U = sin(π/β)/(β(1 +
    # cos(π/β))), whatever the start; here at rest.
    model = forced(block_on_belt(StepLaw(fraction, fraction)), 1.0, ratio / (2 * np.pi))
    period, turn = 2 * np.pi / ratio, np.pi / ratio
    begun = run(model, [0.0], [0.0], duration=500 * period, sample_rate=10 / period, tolerance=1e-7)
    found = run(
        model, begun.displacement[-1], begun.velocity[-1], duration=period, sample_rate=2000 / period, tolerance=1e-7
    )
    wanted = np.sqrt(1 / (1 - ratio**2) ** 2 - (fraction * np.sin(turn) / (ratio * (1 + np.cos(turn)))) ** 2)
    # The samples miss the turning point by some (π/2000)²/2 of it, 1e-6.
    assert np.abs(found.displacement).max() == pytest.approx(wanted, rel=5e-6)


@pytest.mark.thorough
@pytest.mark.parametrize("solver", ["dopri8", "sdirk4"])
def test_a_forced_block_that_nothing_holds(solver):
    # m ẍ + k x = P sin Ωt from rest. Friction's forces say nothing of the size of this motion, 1e12 times what counts
    # as rest; and it passes through zero again and again.
    model = forced(block_on_belt(ConstantLaw(0.3), load=0.0), 1.0, 0.7 / (2 * np.pi))
    found = run(model, [0.0], [0.0], duration=100.0, sample_rate=5.0, tolerance=1e-6, solver=solver)
    wanted = (np.sin(0.7 * found.time) - 0.7 * np.sin(found.time)) / (1 - 0.7**2)
    # At each of its 30 passages through rest its velocity may go wrong by three tolerances of its amplitude, 3 m/s:
    # what slips less counts as at rest. 1.0e-4 was found, with either method.
    assert np.max(np.abs(found.displacement[:, 0] - wanted)) < 3e-4
    assert found.steps < 10_000


@pytest.mark.thorough
def test_a_block_that_is_just_let_go():
    # A force of 1e5 N that grows slowly beyond the friction that holds the block: what is left of the two at first is
    # round-off, which no step must be asked to resolve.
    model = block_on_belt(StepLaw(0.0117, 0.0117), mass=0.14, stiffness=0.0816, load=124648.69)
    model = forced(model, 115403.9, 1.0612 / (2 * np.pi))
    found = run(model, [0.0], [0.0], duration=40 / 1.0612, sample_rate=1.8 * 1.0612, tolerance=1.35e-9, solver="dopri5")
    assert [sticks for _, sticks in found.changes[:2]] == [True, False]
    assert found.changes[1][0] == pytest.approx(np.arcsin(0.0117 * 124648.69 / 115403.9) / 1.0612, rel=1e-9)
    assert found.steps < 10_000


@pytest.mark.thorough
def test_any_block_starts_at_rest():
    # Mass, stiffness, damping, friction, force, belt and samples over decades, by chance. Before errors were measured
    # by what a motion has become, most of them did not get past where it first turned round.
    rng = np.random.default_rng(5)

    def spread(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    for _ in range(40):
        mass, stiffness, load = spread(1e-3, 1e3), spread(1e-4, 1e8), spread(1e-3, 1e6)
        speed, root = np.sqrt(stiffness / mass), np.sqrt(stiffness * mass)
        kinetic = spread(1e-2, 1)
        law = StepLaw(kinetic + rng.choice([0.0, spread(1e-3, 1)]), kinetic)
        belt = rng.choice([-1, 0, 1]) * spread(1e-4, 1e2) * load / root
        damping, force = spread(1e-4, 1) * root, spread(0.3, 100) * kinetic * load
        turning = speed * spread(1e-2, 1e2)
        model = block_on_belt(law, mass=mass, stiffness=stiffness, damping=damping, load=load, belt_speed=belt)
        model = forced(model, force, turning / (2 * np.pi), rng.choice([0.0, rng.uniform(0, 2 * np.pi)]))
        rate = spread(2.2, 200) * max(speed, turning) / (2 * np.pi)
        how = {"solver": str(rng.choice(["auto", "sdirk4"])), "tolerance": spread(1e-10, 1e-3)}
        found = run(model, [0.0], [0.0], duration=200 / rate, sample_rate=rate, **how)
        assert found.time.size == 201


# --- onset -----------------------------------------------------------------------------------------------------------


def follower(friction: float):
    """Hoffmann et al., Journal of Sound and Vibration 257 (2002) 1: M = 1, K = [[2, 1 − 4μ/3], [1, 2]]."""
    springs = np.array([[2.0, 1.0], [1.0, 2.0 - 4 / 3]])
    return sprung_block_on_belt(ConstantLaw(friction), mass=np.ones(2), springs=springs, contact_stiffness=4 / 3)


def test_friction_that_follows_the_load_makes_two_modes_merge():
    # μ_c = k12/k3 + (k11 − k22)²/(4 k12 k3). The growth rises like a root, so 1e-6 of it is at 1e-12 above.
    critical = brentq(lambda mu: eigenvalues(follower(mu))[0].real - 1e-6, 0.7, 0.8, xtol=1e-15)
    assert critical == pytest.approx(0.75, rel=1e-11)
    # At the merging itself round-off splits the two by its root.
    assert np.abs(eigenvalues(follower(0.75)).imag) == pytest.approx(np.sqrt(2), rel=1e-7)
    found = eigenvalues(follower(1.0))
    wanted = np.sqrt(-2 + 1j / np.sqrt(3))  # λ² = −2 ± √(k12 (k12 − μ k3))
    assert np.max(np.abs(np.abs(found.real) - wanted.real)) < 1e-13
    assert np.max(np.abs(np.abs(found.imag) - wanted.imag)) < 1e-13
    assert wanted.real == pytest.approx(0.2020718, abs=5e-8)
    assert wanted.imag == pytest.approx(1.4285773, abs=5e-8)
    stability = analyse_stability(follower(1.0))
    assert sorted(mode.unstable for mode in stability.modes) == [False, True]  # of one frequency, and opposite growth
    assert np.max(np.abs(np.abs(stability.eigenvalues.real) - wanted.real)) < 1e-13


def test_falling_friction_loses_stability_where_it_should():
    # Hopf at v_d = v0 ln(Δμ/(2 ξ v0)); below it λ² + (2ξ + μ′) λ + 1 = 0.
    hopf = brentq(lambda speed: float(growth_rate(falling_friction(speed), "X")), 0.8, 1.5, xtol=1e-14)
    assert hopf == pytest.approx(0.5 * np.log(10), rel=1e-12)
    assert hopf == pytest.approx(1.1512925, abs=5e-8)
    found = eigenvalues(falling_friction(0.8))[0]
    assert found.real == pytest.approx(0.0509483, abs=5e-8)
    assert abs(found.imag) == pytest.approx(0.9987013, abs=5e-8)
    stability = analyse_stability(falling_friction(0.8))
    (mode,) = stability.modes
    assert (mode.label, mode.unstable) == ("X", True)
    assert mode.eigenvalue == pytest.approx(0.0509483 + 0.9987013j, abs=8e-8)  # half of the last digit of each
    assert stability.steady_state == pytest.approx([0.5 + 0.5 * np.exp(-1.6)], rel=1e-12)  # μ N / k
    assert stability.pressure_range == (1.0, 1.0)
    assert stability.contact_fraction == 1.0


@pytest.mark.thorough
def test_falling_friction_grows_at_its_rate_and_keeps_oscillating_where_it_is_stable():
    # v_d = 0.8: from 1e-6, 16 periods of growth; the amplitude √(p² + ((ṗ − σp)/ω)²) of the linear motion.
    model, value = falling_friction(0.8), eigenvalues(falling_friction(0.8))[0]
    steady = np.array([1.0 - 0.5 * (1 - np.exp(-1.6))])
    found = run(model, [1e-6], [0.0], steady=steady, duration=100.0, sample_rate=20.0, tolerance=1e-10)
    p, speed = found.displacement[:, 0] - steady[0], found.velocity[:, 0]
    amplitude = np.hypot(p, (speed - value.real * p) / value.imag)
    rate = np.log(amplitude[-1] / amplitude[0]) / found.time[-1]
    # The motion ends at 1.6e-4, where what is left of second order in it is some 1e-8 over a growth of five.
    assert rate == pytest.approx(value.real, rel=1e-5)
    # Just above the onset a small motion dies out and a large one goes on by slip and stick: it is subcritical.
    model = falling_friction(1.16)
    steady = np.array([0.5 + 0.5 * np.exp(-2.32)])
    how = {"steady": steady, "duration": 100.0, "sample_rate": 20.0, "tolerance": 1e-6}
    small, large = run(model, [1e-3], [0.0], **how), run(model, [1.5], [0.0], **how)
    assert not small.changes
    assert np.max(np.abs(small.displacement[-200:] - steady)) < 0.93e-3
    assert len(large.changes) > 20
    assert np.max(np.abs(large.displacement[-200:] - steady)) > 1.3


def test_a_belt_that_pulls_away_at_the_boundary_of_two_chunks():
    # The belt's corner lies on a boundary whose time is rounded to either side of it; the block must not be let go
    # before. From there on it slips, and is pulled by kinetic friction alone.
    rate, corner = 2e4, 1.05
    model = block_on_belt(StepLaw(1.0, 0.5), stiffness=0.01)
    speed = PiecewiseLinear(jnp.array([0.0, 0.05, corner, corner + 1]), jnp.array([0.2, 0.45, 0.45, 5.45]))
    model = dataclasses.replace(model, operation=Operation(speed, unchanging(1.0, 3)))
    start = np.zeros(1), np.zeros(1), np.array([0.2])
    chunks = list(integrate(model, *start, duration=corner + 0.02, sample_rate=rate, tolerance=1e-8))
    changes = [change for chunk in chunks for change in chunk.changes]
    assert [sticks for _, sticks in changes] == [True, False]
    assert changes[1][0] == pytest.approx(corner, abs=1e-9)
    assert all(np.max(np.abs(chunk.energy_balance_error)) < 1e-8 for chunk in chunks)  # of 0.1 J
    # What is recorded says so, too: the spring alone pulls at what the belt carries along, and 0.5 N at what slips.
    time, moved = (np.concatenate([getattr(chunk, name) for chunk in chunks]) for name in ("time", "displacement"))
    seen = {
        name: np.concatenate([getattr(chunk.observation, name) for chunk in chunks])
        for name in ("sticking", "brake_torque", "friction_power")
    }
    begins = changes[0][0]
    for part, sticks in ((time < begins - 1e-6, 0), ((time > begins + 1e-6) & (time < corner), 1), (time > corner, 0)):
        np.testing.assert_array_equal(seen["sticking"][part], sticks)
        force = 0.01 * moved[part, 0] if sticks else 0.5
        np.testing.assert_allclose(seen["brake_torque"][part], force, rtol=0, atol=1e-8)
        assert np.all(seen["friction_power"][part] == 0) == sticks
    spring = 0.01 * chunks[-1].displacement[:, 0].mean()
    # m v̇ = F_k − k x, over 20 ms in which the spring's force changes by 1e-4 of itself.
    assert chunks[-1].velocity[-1, 0] == pytest.approx(0.45 + (0.5 - spring) * 0.02, abs=1e-6)
