"""A disc that slides and spins: exact force and torque, and how the two motions end together.

Sources: Farkas, Bartels, Unger & Wolf, Physical Review Letters 90 (2003) 248302; Weidman & Malhotra, Physical Review
Letters 95 (2005) 264303. K and E are complete elliptic integrals of modulus ε = u/(Rω), or 1/ε beyond one.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipkm1

from bodies import run
from drumsqueal.physics.friction_law import ConstantLaw, ExponentialLaw
from drumsqueal.physics.small_bodies import disc_on_plate


@eqx.filter_jit
def force(model, velocity):
    return model.act(0.0, jnp.zeros(3), velocity)[0]


def exact(ratio: float) -> tuple[float, float]:
    """F/μN and T/μNR."""
    squared, least = ratio**2, min(ratio, 1 / ratio)
    E = ellipe(least**2)
    K = ellipkm1((1 - least) * (1 + least)) if least < 1 else 0.0  # its factors vanish there
    if ratio <= 1:
        sliding = ((squared + 1) * E + (squared - 1) * K) / ratio
        return 4 / (3 * np.pi) * sliding, 4 / (9 * np.pi) * ((4 - 2 * squared) * E + (squared - 1) * K)
    spinning = ratio * ((4 - 2 * squared) * E + (2 * squared - 5 + 3 / squared) * K)
    return 4 / (3 * np.pi) * ((squared + 1) * E - (squared - 1) * K), 4 / (9 * np.pi) * spinning


@pytest.mark.parametrize("ratio", [0.01, 0.1, 0.5, 0.9, 1 - 1e-7, 1.0, 1 + 1e-7, 1.5, 10.0])
def test_force_and_torque_are_elliptic_integrals(ratio):
    # In a direction of its own and spinning backwards. Found: 7e-12 at most, where the exact formulas cancel.
    model = disc_on_plate(ConstantLaw(0.3), radius=2.0, load=5.0, plate_speed=0.7)
    spin, angle = -1.3, 0.4
    slide = ratio * 2.0 * abs(spin)
    found = force(model, jnp.asarray([0.7 + slide * np.cos(angle), slide * np.sin(angle), spin]))
    sliding, spinning = exact(ratio)
    wanted = -1.5 * np.array([sliding * np.cos(angle), sliding * np.sin(angle), -2.0 * spinning])
    np.testing.assert_allclose(found, wanted, rtol=1e-10)


def test_how_fast_and_how_far_its_points_move():
    model = disc_on_plate(ConstantLaw(0.3), radius=2.0, load=5.0, plate_speed=0.7)
    moment, body = model.operation.at(0.0), model.body
    # Sliding at 3 and 4 m/s against the plate and spinning at 1.5 rad/s, the fastest point has 5 + 3 m/s.
    assert float(model.contact.fastest_slip(moment, (3.7, -4.0, -1.5))) == pytest.approx(8.0)
    assert float(model.contact.fastest_slip(moment, (0.7, 0.0, -1.5))) == pytest.approx(3.0)
    into, along = body.largest({"X": np.array([3.0, 0.0]), "Y": np.array([-4.0, 0.0]), "Tz": np.array([-1.5, 1.0])})
    np.testing.assert_allclose(along, [8.0, 2.0])
    assert not into.any()
    # Along X the centre moves with it, and the rim's points at y = ±R by ∓R for 1 rad.
    np.testing.assert_allclose(body.surface()[1], [[1, 0, 0], [1, 0, -2], [1, 0, 2]])
    np.testing.assert_allclose(body.mass, [1.0, 1.0, 2.0])  # 1 kg, and m R²/2
    # 5 N over π R².
    assert list(map(float, model.contact.pressure_range(moment, (0.0, 0.0, 0.0)))) == [pytest.approx(5 / 4 / np.pi)] * 2


def test_force_and_torque_as_printed():
    model = disc_on_plate(ConstantLaw(1.0))
    for ratio, sliding, spinning in [
        (0.1, 0.0998748, 0.6616761),
        (0.5, 0.4838438, 0.5477484),
        (1.0, 8 / (3 * np.pi), 8 / (9 * np.pi)),
    ]:
        np.testing.assert_allclose(-force(model, jnp.asarray([0.0, ratio, 1.0])), [0, sliding, spinning], atol=5e-8)
    np.testing.assert_array_equal(force(model, jnp.zeros(3)), 0.0)
    # All of it one way, or round: to the lines that are left out, and to round-off.
    np.testing.assert_allclose(force(model, jnp.asarray([3.0, 0.0, 0.0])), [-1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(force(model, jnp.asarray([0.0, 0.0, 3.0])), [0, 0, -2 / 3], atol=2e-12)


@pytest.mark.parametrize("decay", [1.0, 30.0, 1000.0])
def test_the_torque_of_a_steep_law_that_spins(decay):
    # 2π p ∫ μ(ωr) r² dr in closed form: with x = αωR, (2 − (x² + 2x + 2) e^(−x)) / x³ for the part that falls. Eight
    # nodes from the centre to the rim, uncut, lost 3e-6 of it at 30 s/m; the lines left out take 2e-12.
    model = disc_on_plate(ExponentialLaw(0.5, 0.3, decay))
    x = decay * 1.7
    falling = (2 - (x**2 + 2 * x + 2) * np.exp(-x)) / x**3
    wanted = -2 * (0.3 / 3 + 0.2 * falling)  # p = load / π R²
    np.testing.assert_allclose(force(model, jnp.asarray([0.0, 0.0, 1.7])), [0, 0, wanted], rtol=0, atol=1e-11)


def test_a_law_of_the_slip_speed_over_the_disc():
    # Against a midpoint rule of 1600² squares, whose error is of the order of one square at the turn of the direction.
    side = (np.arange(1600) + 0.5) / 800 - 1
    x, y = np.meshgrid(side, side)
    inside = x**2 + y**2 < 1
    for slide, spin in [(0.4, 1.0), (1.5, 0.6)]:
        u, w = slide - spin * y, spin * x
        speed = np.hypot(u, w)
        fraction = np.where(inside, -(0.2 + 0.3 * np.exp(-2 * speed)) / speed / inside.sum(), 0.0)
        wanted = np.sum(fraction * u), np.sum(fraction * w), np.sum(fraction * (w * x - u * y))
        found = force(disc_on_plate(ExponentialLaw(0.5, 0.2, 2.0)), jnp.asarray([slide, 0.0, spin]))
        np.testing.assert_allclose(found, wanted, atol=2e-5)


def test_derivatives_where_one_of_the_two_motions_is_none():
    # F → μN ε/1 and T → ½ μN R/ε to first order: what an implicit method asks for, with no speed to divide by.
    slopes = jax.jit(jax.jacfwd(lambda v: disc_on_plate(ConstantLaw(1.0)).act(0.0, jnp.zeros(3), v)[0]))
    np.testing.assert_allclose(slopes(jnp.asarray([0.0, 0.0, 2.0])), -np.diag([0.5, 0.5, 0.0]), atol=1e-9)
    np.testing.assert_allclose(slopes(jnp.asarray([2.0, 0.0, 0.0])), -np.diag([0.0, 0.5, 0.125]), atol=1e-9)


# --- to rest ---------------------------------------------------------------------------------------------------------

COMMON = 0.6530018  # of u/(Rω) where F/T is u/(½Rω)


def approach(ratio: float) -> float:
    """dε/d ln ω = F/2T − ε: nought at the common end."""
    sliding, spinning = exact(ratio)
    return sliding / (2 * spinning) - ratio


@pytest.mark.thorough
@pytest.mark.parametrize("start", [(1.0, 0.0, 0.2), (0.1, 0.05, 3.0), (1.0, 0.0, 1.0), (0.0, 2.0, 1e-3)])
def test_the_disc_comes_to_rest_and_stays(start):
    found = run(disc_on_plate(ConstantLaw(0.3)), [0.0] * 3, start, duration=8.0, sample_rate=100.0, tolerance=1e-9)
    ((stop, sticks),) = found.changes
    resting = found.time > stop
    assert sticks
    assert resting.sum() > 20
    np.testing.assert_array_equal(found.velocity[resting], 0.0)
    assert np.max(np.ptp(found.displacement[resting], axis=0)) == 0
    assert np.max(np.abs(found.energy_balance_error)) < 1e-8  # of an energy of two at most


@pytest.mark.thorough
@pytest.mark.parametrize("start", [(1.0, 0.0, 0.2), (0.0, 1.0, 1.6)])
def test_sliding_and_spinning_end_together(start):
    # Each run goes nine tenths of the way to the stop, and the next one from there: twelve decades of speed, of which
    # the ratio forgets its start with a power of 0.62.
    common = brentq(approach, 0.5, 0.8)
    assert isinstance(common, float)
    assert common == pytest.approx(COMMON, abs=5e-8)
    power = (approach(common + 1e-5) - approach(common - 1e-5)) / 2e-5
    model, speed = disc_on_plate(ConstantLaw(0.3)), 1e6 * np.array(start)
    ratios, speeds = [], []
    for _ in range(12):
        most = np.abs(speed).max()
        found = run(model, [0.0] * 3, speed, duration=10 * most, sample_rate=20 / most, tolerance=1e-9)
        ((stop, _),) = found.changes
        found = run(model, [0.0] * 3, speed, duration=0.9 * stop, sample_rate=10 / 0.9 / stop, tolerance=1e-9)
        speed = found.velocity[-1]
        ratios.append(np.hypot(*speed[:2]) / speed[2])
        speeds.append(speed[2])
    left = np.array(ratios) - common
    np.testing.assert_allclose(np.diff(np.log(np.abs(left[3:9]))) / np.diff(np.log(speeds[3:9])), power, rtol=1e-2)
    # Found: 5.7e-8 and 1.3e-9, what the power leaves of the start.
    assert abs(left[-1]) < 1e-7
