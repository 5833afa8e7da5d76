"""Steady sliding where Newton's method from rest fails, of bodies of any proportions, and where there is none."""

import dataclasses
from itertools import pairwise
from types import SimpleNamespace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import Array
from scipy.integrate import quad

from drumsqueal.errors import NoSteadySliding, SteadyStateError
from drumsqueal.physics.bodies.body import dot
from drumsqueal.physics.bodies.rigid_shoe import IN_PLANE
from drumsqueal.physics.effects.effect import Action
from drumsqueal.physics.effects.springs import Springs
from drumsqueal.physics.friction_law import ConstantLaw
from drumsqueal.physics.model import build_model
from drumsqueal.physics.small_bodies import block_on_belt, sprung_block_on_belt
from drumsqueal.solve.linear import steady
from drumsqueal.solve.linear.equilibrium import find_equilibrium
from drumsqueal.solve.linear.steady import steady_sliding

# --- the search alone ------------------------------------------------------------------------------------------------


@pytest.mark.thorough(but=["1e-06-1e-12"])
@pytest.mark.parametrize("length", [1e-12, 1e9])
@pytest.mark.parametrize("load", [1e-6, 1e9])
def test_the_path_goes_round_its_turns(length, load):
    # The spring gives way ten times before it holds all of the drag: Newton's method from x = 0 is caught at once.
    def spring(x):
        return x / 30 + 0.1 * np.sin(x)

    def forces(z):
        drag, held = load * z[1:], load * (z[:1] / length / 30 + 0.1 * jnp.sin(z[:1] / length))
        return drag - held, jnp.abs(drag) + jnp.abs(held)

    # Forces balanced to 1e-13 of those that cancel.
    assert spring(float(find_equilibrium(forces, 1).displacement[0]) / length) == pytest.approx(1.0, rel=1e-12)


def test_an_equilibrium_that_runs_off_is_none():
    looked = []

    def forces(z):  # held by less than 1, however far it moves
        jax.debug.callback(lambda _: looked.append(None), z[0])
        drag, spring = z[1:], 0.7 * z[:1] / (1 + jnp.abs(z[:1]))
        return drag - spring, jnp.abs(drag) + jnp.abs(spring)

    found = find_equilibrium(forces, 1)
    jax.effects_barrier()
    assert len(looked) <= 56  # 61 if each point on the way were balanced to the last digit
    assert np.isnan(found.displacement[0])
    # It holds 0.7 of the drag, and ever less is missing the farther it moves: that is what locks itself.
    assert bool(found.runs_off)
    # Told by points ten thousand lengths away, where 1e-4 of it is missing: to the square of that.
    assert float(found.fraction) == pytest.approx(0.7, rel=1e-7)


def test_an_equilibrium_is_found_where_the_path_comes_back_from_far_away():
    def forces(z):  # held by less than 1 up to a stop, a thousand times farther than the friction alone moves it
        drag, spring = z[1:], 0.7 * z[:1] / (1 + jnp.abs(z[:1])) + jnp.maximum(0.0, z[:1] - 2000)
        return drag - spring, jnp.abs(drag) + jnp.abs(spring)

    found = find_equilibrium(forces, 1, directly=False)
    assert float(found.displacement[0]) == pytest.approx(2000.3, rel=1e-6)  # 0.3 by the stop of 1 N/m


# --- scenes ----------------------------------------------------------------------------------------------------------

KEYS = (
    *("shoe.outer_radius", "shoe.thickness", "shoe.width", "shoe.arc_angle"),
    *("support.upper_stiffness", "support.lower_stiffness", "contact.stiffness", "contact.normal_load"),
    *("friction.static", "friction.kinetic", "friction.decay", "drum.speed"),
)
# Each has an equilibrium by a search of the whole plane of contacts, and none that a dogleg from rest finds; the last
# of those that separate lies at the end of the path only.
SEPARATING = [
    (6.529, 0.01769, 0.0194, 0.04207, 1.205e7, 8.361e8, 1.06e12, 1291.0, 0.01675, 0.01554, 0.365, 0.2285),
    (2.24, 0.09152, 3.806, 3.352, 3.089e5, 8.489e4, 3.487e10, 51350.0, 0.033, 0.6835, 0.4248, -0.005562),
    (8.044, 0.0976, 0.1855, 1.209, 5.59e6, 4.2e5, 7.737e12, 219.0, 2.552, 0.2729, 2.938, 0.4052),
    (3.274, 0.004268, 0.4315, 3.218, 34650.0, 42100.0, 6.243e13, 71100.0, 0.3696, 0.7698, 0.01172, -0.003293),
]
BONDED = [
    (5.07, 0.03058, 2.377, 1.774, 7.88e6, 2.483e7, 1.201e12, 997.1, 0.05921, 0.08972, 0.01137, -7.823),
    (1.069, 0.3428, 0.2001, 2.591, 2.152e4, 5.213e8, 9.151e13, 132.5, 0.4853, 1.289, 0.02887, -1.949),
    (0.12, 0.001369, 0.1502, 1.81, 3.416e4, 1.446e4, 3.91e12, 557.0, 0.06913, 0.1755, 7.347, 0.8063),
    (5.961, 0.1295, 8.277, 4.024, 1.462e6, 1.084e9, 1.013e11, 2.253, 0.01551, 2.083, 11.01, -16.27),
]


def residual(number, q, bonded):
    """Largest of the three forces (moments over R) at displacement q over the forces that cancel; by adaptive quad."""
    R, h, b, arc = (number[f"shoe.{key}"] for key in ("outer_radius", "thickness", "width", "arc_angle"))
    c = 4 * (h**2 - 3 * h * R + 3 * R**2) / (3 * arc * (2 * R - h)) * np.sin(arc / 2)
    load, k = number["contact.normal_load"], number["contact.stiffness"]
    x, y = k * q[0], k * (q[1] - c * q[2])
    p0, half = load / (R * arc * b), arc / 2
    # Lift-off where p0 + x cos θ + y sin θ = 0.
    spread = np.arccos(-p0 / np.hypot(x, y)) if np.hypot(x, y) > p0 and not bonded else 0.0
    ends = [np.arctan2(y, x) + sign * spread + turn for sign in (-1, 1) for turn in (-2 * np.pi, 0, 2 * np.pi)]
    cuts = sorted({-half, half, *(end for end in ends if abs(end) < half and spread)})

    def integral(weight):
        def density(t):
            level = p0 + x * np.cos(t) + y * np.sin(t)
            return (level if bonded else max(level, 0.0)) * weight(t) * R * b

        return sum(quad(density, *span, epsabs=0, epsrel=1e-12)[0] for span in pairwise(cuts))

    normal, cosine, sine = integral(lambda _: 1.0), integral(np.cos), integral(np.sin)
    law = number["friction.kinetic"], number["friction.static"] - number["friction.kinetic"]
    mu = law[0] + law[1] * np.exp(-number["friction.decay"] * R * abs(number["drum.speed"]))
    mu *= np.sign(number["drum.speed"])
    springs = number["support.upper_stiffness"] + number["support.lower_stiffness"]
    push = 2 * p0 * R * b * np.sin(half)
    spin = c * sine + mu * (R * normal - c * cosine) - springs * R**2 * np.sin(2 * q[2]) / 2
    forces = [push - cosine - mu * sine - springs * q[0], mu * cosine - sine, spin / R]
    return np.max(np.abs(forces)) / (load + abs(springs * q[0]))


@pytest.mark.thorough
@pytest.mark.parametrize("separation", [True, False])
def test_scenes_of_odd_proportions_have_their_equilibria(nominal, separation):
    scene = nominal.with_values({"steady.state": "self-consistent", "contact.separation": separation})
    rows = SEPARATING if separation else BONDED
    scenes = [scene.with_values(dict(zip(KEYS, row, strict=True))) for row in rows]
    longest = max(scenes, key=lambda each: each.shoe.arc_angle)  # whose nodes serve them all
    solve = jax.jit(lambda numbers: steady_sliding(build_model(longest, numbers, IN_PLANE)))
    for each in scenes:
        q = np.asarray(solve(each.numbers()))
        # Newton's steps end at 1e-13; the lining moves by Y − c Tz, and feels the round-off of Y with its stiffness.
        area = each.shoe.outer_radius * each.shoe.arc_angle * each.shoe.width
        round_off = np.finfo(float).eps * abs(q[1]) * each.contact.stiffness * area / each.contact.normal_load
        assert round_off < 1e-6
        assert residual(each.numbers(), q, not separation) < 1e-10 + round_off


# --- a shoe on a pin -------------------------------------------------------------------------------------------------

PIN, TIP, PUSH = (-0.02, -0.085), (0.02, 0.085), 2279.0  # m, m, N along x
PIN_STIFFNESS = 1e12  # N/m


class Push(eqx.Module):
    """A constant generalised force on the coordinates of the plane."""

    force: Array

    def act(self, moment, q, v):
        del moment, q, v
        return Action(tuple(self.force), 0.0)

    def potential_energy(self, moment, q):
        del moment
        return -dot(self.force, q)


def pinned(nominal, mu, speed, lining):
    """The nominal shoe on a pin of two springs (N/m), pushed at its tip; p0 = 0."""
    values = {"support": None, "steady.state": "self-consistent", "contact.normal_load": 0.0}
    numbers = {"drum.speed": speed, "contact.stiffness": lining}
    model = build_model(nominal.with_values(values), numbers, IN_PLANE, ConstantLaw(mu))

    def motion(at):  # of a point, by X, Y and Tz
        return jnp.array([[1, 0, -at[1]], [0, 1, at[0] - model.shoe.centroid]])

    springs = Springs(PIN_STIFFNESS * motion(PIN).T @ motion(PIN))
    push = Push(jnp.array([PUSH, 0.0]) @ motion(TIP))
    return dataclasses.replace(model, others=(*model.others, springs, push))


def textbook(mu):
    """Normal force (N) on the lining of a shoe on a rigid pin; friction drags it along +θ where μ > 0.

    N = n max(0, sin of the angle from the pin); the moments of the push, the pressure and friction about it balance.
    """
    arm, angle, half = np.hypot(*PIN), np.arctan2(PIN[1], PIN[0]), np.radians(65)

    def integral(weight):  # the whole lining is less than half a turn ahead of the pin
        points = [each for each in (angle + np.pi, angle) if abs(each) < half]
        return quad(lambda t: max(0.0, np.sin(t - angle)) * weight(t), -half, half, points=points or None)[0]

    # About the pin: pressure turns the shoe by arm sin(θ − pin), friction by R − arm cos(θ − pin), the push against.
    pressure = integral(lambda t: arm * np.sin(t - angle))
    friction = integral(lambda t: 0.1 - arm * np.cos(t - angle))
    lever = TIP[1] - PIN[1]
    return PUSH * lever / (pressure + mu * friction) * integral(lambda _: 1.0), pressure / friction


@pytest.mark.thorough
def test_a_pinned_shoe_is_that_of_the_textbook_until_it_locks_itself(nominal):
    @jax.jit
    def normal_force(mu, speed, lining):
        model = pinned(nominal, mu, speed, lining)
        return model.observe(0.0, steady_sliding(model), jnp.zeros(3)).normal_force

    locking = textbook(0.0)[1]
    for mu in (0.0, 0.2, 0.4, 1.2, -0.4, -0.95 * locking):
        wanted = textbook(mu)[0]
        # The pin gives way by 1e-5 of what the lining does, and close to self-locking that counts 20 times.
        assert float(normal_force(abs(mu), np.copysign(5.0, mu), 1e9)) == pytest.approx(wanted, rel=1e-3)
        # A lining that is as stiff as the pin makes another brake, which is not without its steady sliding.
        assert np.isfinite(normal_force(min(abs(mu), 0.4), np.copysign(5.0, mu), 1e14))
    for mu in (1.05 * locking, 2 * locking):
        assert np.isnan(normal_force(mu, -5.0, 1e9))


# --- small bodies ----------------------------------------------------------------------------------------------------


def test_a_derivative_of_an_equilibrium_is_that_of_its_equation(monkeypatch):
    # (K + μB) x = μ p0 e of two coordinates, where friction makes the matrix asymmetric: x' = (K + μB)⁻¹ (p0 e − B x).
    springs, drag, mu = np.array([[11.0, -3.0], [-3.0, 20.0]]), np.array([[0.0, -7.0], [0.0, 0.0]]), 0.4
    matrix = springs + mu * drag + np.diag([0.0, 7.0])
    known = np.linalg.solve(matrix, [mu * 3.0, 0.0])
    # Where it is, is not searched for here.
    found = SimpleNamespace(displacement=jnp.asarray(known))
    monkeypatch.setattr(steady, "find_equilibrium", lambda *_, **__: found)

    def displacement(mu):
        how = {"mass": np.ones(2), "springs": springs, "contact_stiffness": 7.0, "load": 3.0}
        return steady_sliding(sprung_block_on_belt(ConstantLaw(mu), **how))

    slope = jax.jit(lambda mu: jax.jvp(displacement, (mu,), (1.0,))[1])(mu)
    np.testing.assert_allclose(slope, np.linalg.solve(matrix, [3.0, 0.0] - drag @ known), rtol=1e-12)


@pytest.mark.thorough
def test_gradients_go_through_the_equilibrium():
    # k11 x + k12 y = μ N, k12 x + (k22 + k3) y = 0 with N = p0 + k3 y.
    springs, stiffness, load = np.array([[11.0, -3.0], [-3.0, 20.0]]), 7.0, 3.0

    @jax.jit
    def displacement(mu):
        model = sprung_block_on_belt(
            ConstantLaw(mu), mass=np.ones(2), springs=springs, contact_stiffness=stiffness, load=load
        )
        return steady_sliding(model)

    def wanted(mu):
        matrix = springs + np.array([[0.0, -mu * stiffness], [0.0, stiffness]])
        return np.linalg.solve(matrix, [mu * load, 0.0])

    mu, step = 0.4, 1e-6
    np.testing.assert_allclose(displacement(mu), wanted(mu), rtol=1e-13)
    slope = (wanted(mu + step) - wanted(mu - step)) / (2 * step)
    # Central differences of a step of 1e-6 are good to 1e-10.
    for derivative in (jax.jacfwd, jax.jacrev):
        np.testing.assert_allclose(jax.jit(derivative(displacement))(mu), slope, rtol=1e-8)
    many = jax.jit(jax.vmap(displacement))(jnp.array([0.1, 0.4, 0.9]))
    np.testing.assert_allclose(many, [wanted(each) for each in (0.1, 0.4, 0.9)], rtol=1e-12)


def test_where_there_is_none_the_reason_is_raised():
    with pytest.raises(SteadyStateError, match="no self-consistent steady sliding was found"):
        steady_sliding(block_on_belt(ConstantLaw(0.3), stiffness=0.0, belt_speed=1.0))  # nothing holds it


@pytest.mark.parametrize(
    ("runs_off", "rests", "shoes", "said"),
    [
        # 0.4 at 0.1 m and 20 rad/s, of which the path ends at 75 %.
        (
            True,
            True,
            1,
            "begins at a coefficient of friction of 0.3, and at 2 m/s the scene has 0.4; take less friction",
        ),
        (True, True, 2, "begins at 75 % of the friction that the scene has; take less friction"),
        (False, True, 1, "no self-consistent steady sliding was found"),
        (False, False, 1, str(SteadyStateError(NoSteadySliding.PULLED_OFF))),
    ],
)
def test_why_there_is_none_is_read_off_the_path(monkeypatch, runs_off, rests, shoes, said):
    end = SimpleNamespace(runs_off=runs_off, fraction=0.75, frictionless=np.array([0.0 if rests else np.nan]))
    monkeypatch.setattr(steady, "raise_friction", lambda *_: end)
    contact = SimpleNamespace(friction=SimpleNamespace(law=ConstantLaw(0.4)), radius=0.1)
    operation = SimpleNamespace(at=lambda _: SimpleNamespace(drum_speed=-20.0))
    model = SimpleNamespace(contact=contact, operation=operation, sides=[None] * shoes)
    assert said in str(steady.no_steady_sliding(model))  # pyright: ignore[reportArgumentType]


def test_a_negative_coefficient_is_refused():
    with pytest.raises(ValueError, match=r"must not be negative; this law gives -0\.3"):
        block_on_belt(ConstantLaw(-0.3))
