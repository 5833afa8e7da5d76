"""All that acts on a body at once, against sums in NumPy: no number is zero or one, and nothing is symmetric."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.effects.damping import Damping
from drumsqueal.physics.effects.effect import Observation
from drumsqueal.physics.effects.forcing import Balance, ConstantForce, Forcing, PointForces, Preload
from drumsqueal.physics.effects.friction import Friction, Tangential, Temperature, UnitVelocity
from drumsqueal.physics.effects.operation import Constant, OperatingPoint, Operation, PiecewiseLinear
from drumsqueal.physics.effects.pressure import Bonded, Unilateral
from drumsqueal.physics.effects.springs import Springs, SupportSprings
from drumsqueal.physics.friction_law import ExponentialLaw
from drumsqueal.physics.model import Model
from drumsqueal.physics.quadrature.arc import ArcSurface
from drumsqueal.physics.quadrature.area import SteadySurface
from drumsqueal.physics.small_bodies import Block, PointContact, block_on_belt, disc_on_plate, sprung_block_on_belt
from drumsqueal.scene import COORDINATES

R, H, B, ARC, DENSITY, STIFFNESS = 0.11, 0.017, 0.043, 2.1, 7300.0, 2.1e10
STATIC, KINETIC, DECAY = 0.55, 0.31, 1.7
UPPER, LOWER = 3e7, 5e7  # N/m, of the supports
CAPACITY, COOLING, FADE, RISE = 210.0, 3.0, 0.011, 23.0
SPEED, LOAD, PUSH = (-6.0, 2.5), (3.1e5, -4e4), (700.0, 90.0)  # at t = 0, and what each changes in a second
STEADY_PUSH, TIME = -350.0, 0.4
LEFT = 1 - FADE * RISE


def profile(value, rate):
    return PiecewiseLinear([-1.0, 3.0], [value - rate, value + 3 * rate])


def mu(speed):
    return KINETIC + (STATIC - KINETIC) * np.exp(-DECAY * speed)


def now(line):
    return line[0] + line[1] * TIME


def symmetric(n, seed, size):
    found = np.random.default_rng(seed).uniform(-1, 1, (n, n))
    return size * (found @ found.T + np.eye(n))


@Interpreted
def all_of(model, q, v):
    """What a model says of a state."""
    memory = jnp.asarray([RISE])[: len(model.remembered)] if model.remembering else None
    time = jnp.asarray(TIME)
    moment = model.moment(time, memory)
    return {
        "rates": model.rates(time, q, v, memory),
        "energy": model.energy(time, q, v),
        "observed": model.observe(time, q, v, memory),
        "kinks": model.kinks(time, q, v, memory),
        "range": model.contact.pressure_range(moment, tuple(q)),
        "fastest": model.contact.fastest_slip(moment, tuple(v)),
    }


# --- a rigid shoe ----------------------------------------------------------------------------------------------------


def integral(function, cuts=()):
    """Along the arc, cut where levels of an angle vanish: to round-off between the cuts."""
    x, w = np.polynomial.legendre.leggauss(12)
    ends = np.linspace(-ARC / 2, ARC / 2, 41)
    for level in cuts:
        signs = np.sign(level(ends))
        roots: Any = [brentq(level, *ends[k : k + 2], xtol=1e-15) for k in np.flatnonzero(signs[1:] != signs[:-1])]
        ends = np.sort(np.append(ends, roots))
    half = np.diff(ends)[:, None] / 2
    return np.sum(function((ends[:-1, None] + half * (1 + x)).ravel()) * (half * w).ravel(), axis=-1)


CENTROID = (
    integral(np.cos) * (R**3 - (R - H) ** 3) / 3 / (ARC * (R**2 - (R - H) ** 2) / 2)
)  # the mean of x over the sector


def shapes(theta, z):
    """u_r, u_θ, u_z (3, 6, points) for 1 of each coordinate, of section 2 of the model."""
    cosine, sine, zero, z = np.cos(theta), np.sin(theta), 0 * theta, z + 0 * theta
    ahead = R * cosine - CENTROID
    x = np.stack([zero + 1, zero, zero, zero, z, -R * sine])
    y = np.stack([zero, zero + 1, zero, -z, zero, ahead])
    axial = np.stack([zero, zero, zero + 1, R * sine, -ahead, zero])
    return np.stack([x * cosine + y * sine, y * cosine - x * sine, axial])


def contact_of(places, q, v, left, separation, directed):
    """Force (6,), stored energy, compression (m³), drag, heat, load, and what touches and slips backwards (m²)."""
    p0, turning = now(LOAD), now(SPEED)
    x, w = np.polynomial.legendre.leggauss(12)
    lines = [(0.0, 2.0)] if len(places) == 3 else list(zip(B / 2 * x, w, strict=True))

    def along_line(z):
        def densities(theta):
            radial, along, axial = shapes(theta, z)
            into, slip, lateral = q @ radial, v @ along - R * turning, v @ axial
            level = p0 + STIFFNESS * into
            pressure = np.maximum(level, 0) if separation else level
            depth = np.maximum(into, -p0 / STIFFNESS) if separation else into
            speed = np.hypot(slip, lateral) if directed else np.abs(slip)
            drag, across = (-left * mu(speed) * pressure * each / speed for each in (slip, lateral * directed))
            touches = (level >= 0) | (not separation)
            return np.concatenate([
                -pressure * radial + drag * along + across * axial,
                [p0 * depth + STIFFNESS * depth**2 / 2, depth, drag, -drag * slip - across * lateral, pressure, touches,
                 touches & (slip * np.sign(turning) > 0)],
            ])  # fmt: skip

        lifts = [lambda theta: p0 + STIFFNESS * q @ shapes(theta, z)[0]] * separation
        turns = [lambda theta: v @ shapes(theta, z)[1] - R * turning] * (not directed)
        return integral(densities, [*lifts, *turns])

    found: Any = sum(R * B / 2 * weight * along_line(z) for z, weight in lines)
    return found[:6], *found[6:]


def shoe_model(names, *, separation):
    places = [COORDINATES.index(name) for name in names]
    shoe = RigidShoe(R, H, B, ARC, DENSITY, names)
    friction = Friction(ExponentialLaw(STATIC, KINETIC, DECAY), Tangential() if len(names) == 3 else UnitVelocity())
    surface = ArcSurface(compact=True) if len(names) == 3 else SteadySurface(cut=False)
    contact = Contact(shoe, (Unilateral if separation else Bonded)(STIFFNESS), friction, surface)
    n = len(names)
    lever = np.where(np.array(places) < 3, 1.0, R)
    springs, dashpots = (symmetric(n, seed, size) * np.outer(lever, lever) for seed, size in ((1, 2e7), (2, 300.0)))
    along = np.random.default_rng(3).uniform(-1, 1, (2, n)) * lever
    constant = np.arange(2.0, 2 + n) * 7 * lever
    others = (
        Balance(Preload(shoe), friction), SupportSprings(UPPER, LOWER, shoe), Springs(springs), Damping(dashpots),
        PointForces(along), Forcing([40.0, -9.0], 31.0, 0.7, (n - 1, 0)), ConstantForce(constant),
    )  # fmt: skip
    operation = Operation(profile(*SPEED), profile(*LOAD), (profile(*PUSH), Constant(STEADY_PUSH)))
    model = Model(operation, contact, others, shoe.mass, np.eye(n), (Temperature(CAPACITY, COOLING, FADE),))
    return model, places, {"springs": springs, "dashpots": dashpots, "along": along, "constant": constant}


# Amplitudes in m and rad times 0.11 m: pressed and slipping one way; or off the drum and slipping back in part.
STATES = {"pressed": (3e-6, 0.05), "lifted and reversed": (3e-5, 0.9)}


@pytest.mark.parametrize(
    ("names", "state"),
    [(("X", "Y", "Tz"), "pressed"), (("X", "Y", "Tz"), "lifted and reversed"), (COORDINATES, "pressed")],
)
def test_all_that_acts_on_a_shoe_is_the_sum_of_what_each_effect_is(names, state):
    # In space over a surface that is not cut: bonded, and pressed and slipping everywhere.
    plane = len(names) == 3
    model, places, own = shoe_model(names, separation=plane)
    (size, speed), lever = STATES[state], np.where(np.array(places) < 3, 1.0, R)
    q, v = (
        scale * np.array(each)[places] / lever
        for scale, each in ((size, [0.3, 0.9, -0.5, -0.7, 0.4, -0.8]), (speed, [0.8, 0.5, -0.6, 0.3, -0.9, -0.7]))
    )
    six_q, six_v = np.zeros(6), np.zeros(6)
    six_q[places], six_v[places] = q, v
    found = jax.tree.map(np.asarray, all_of(model, q, v))
    pushed, stored, depth, drag, heat, load, touching, back = contact_of(places, six_q, six_v, LEFT, plane, not plane)
    p0, turning, pushes = now(LOAD), now(SPEED), (now(PUSH), STEADY_PUSH)
    resting = R * B * integral(lambda theta: shapes(theta, 0.0)[:2].reshape(12, -1))  # what is odd in z vanishes
    wave = np.sin(2 * np.pi * 31.0 * TIME + 0.7)
    balance = -LEFT * mu(R * abs(turning)) * np.sign(turning) * p0 * resting[6:]
    total = pushed + p0 * resting[:6] + balance
    total[0] -= (UPPER + LOWER) * six_q[0]
    total[5] -= (UPPER + LOWER) * R**2 * np.sin(2 * six_q[5]) / 2
    force = total[places] - own["springs"] @ q - own["dashpots"] @ v + pushes @ own["along"] + own["constant"]
    swing = np.zeros(len(names))
    swing[[-1, 0]] = np.array([40.0, -9.0]) * wave
    force += swing
    scale = lever * p0 * R * ARC * B
    near = 1e-11
    np.testing.assert_allclose(found["rates"][0] / scale, force / scale, rtol=0, atol=near)
    # What is stored, and the power beyond that: of friction and what is balanced, and of loads and pushes that change.
    energy = stored - p0 * resting[:6] @ six_q + (UPPER + LOWER) / 2 * (six_q[0] ** 2 + (R * np.sin(six_q[5])) ** 2)
    energy += q @ own["springs"] @ q / 2 - (pushes @ own["along"] + own["constant"]) @ q
    power = R * drag * turning - heat + balance @ six_v + LOAD[1] * (depth - resting[:6] @ six_q)
    power += swing @ v - v @ own["dashpots"] @ v - PUSH[1] * own["along"][0] @ q
    kinetic = np.asarray(model.mass) @ v**2 / 2
    np.testing.assert_allclose(found["energy"], [kinetic, energy], rtol=1e-12, atol=near * scale[0] * size)
    np.testing.assert_allclose(found["rates"][1], power, rtol=0, atol=10 * near * scale[0] * speed)
    np.testing.assert_allclose(found["rates"][2], (heat - COOLING * RISE) / CAPACITY, rtol=near * 10)
    # What is recorded.
    assert state == "pressed" or 0.05 < touching / (R * ARC * B) < 0.95 > back / (R * ARC * B) > 0.05
    area, seen = R * ARC * B, found["observed"]
    wanted = R * drag, load, touching / area, back / area, heat, 0.0
    names_of = (
        "brake_torque",
        "normal_force",
        "contact_fraction",
        "slip_reversed_fraction",
        "friction_power",
        "sticking",
    )
    for name, each in zip(names_of, wanted, strict=True):
        np.testing.assert_allclose(getattr(seen, name), each, rtol=1e-10, atol=1e-12, err_msg=name)
    # Levels at the ends of the arc and their extremes on it, on the middle line or on both edges.
    edges = [0.0] if plane else [-B / 2, B / 2]
    theta = np.linspace(-ARC / 2, ARC / 2, 200_001)
    level = np.array([p0 + STIFFNESS * six_q @ shapes(theta, z)[0] for z in edges])
    slip = np.array([six_v @ shapes(theta, z)[1] - R * turning for z in edges])
    kinks = [np.stack([each[:, 0], each[:, -1], each.min(axis=1), each.max(axis=1)]) for each in (level, slip)]
    pressure = np.array([level.min(), level.max()])
    pressure = np.maximum(pressure, 0) if plane else pressure
    np.testing.assert_allclose(
        found["kinks"], np.concatenate([each.ravel() for each in kinks]) if plane else [], rtol=1e-9
    )
    np.testing.assert_allclose(found["range"], pressure, rtol=1e-9)
    np.testing.assert_allclose(seen.smallest_pressure, pressure[0], rtol=1e-9)
    bound = abs(R * (six_v[5] - turning)) + abs(six_v[0]) + abs(six_v[1] - CENTROID * six_v[5])
    if not plane:  # that of V_θ across the width, and V_z
        bound += B / 2 * np.abs(six_v[3:5]).sum() + abs(six_v[2] + CENTROID * six_v[4]) + R * np.abs(six_v[3:5]).sum()
    np.testing.assert_allclose(found["fastest"], bound, rtol=1e-12)
    # Pressure and slip at points.
    angle = np.array([-0.7, 0.2, 0.9])
    at = model.lining.along_arc(model.operation.at(TIME), q, v, angle, None if plane else 0.011)
    radial, along, _ = shapes(angle, 0.0 if plane else 0.011)
    local = p0 + STIFFNESS * six_q @ radial
    np.testing.assert_allclose(at[0], np.maximum(local, 0) if plane else local, rtol=1e-12)
    np.testing.assert_allclose(at[1], six_v @ along - R * turning, rtol=1e-12)


# --- a block ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("separation", [True, False])
@pytest.mark.parametrize("y", [2e-3, -9e-2])
def test_all_that_acts_on_a_block_is_the_sum_of_what_each_effect_is(y, separation):
    stiffness, mass = 50.0, np.array([0.7, 1.9])
    load, rate, belt = 3.0, -0.8, (-0.4, 0.25)
    friction = Friction(ExponentialLaw(STATIC, KINETIC, DECAY), Tangential())
    contact = PointContact(Block(mass), (Unilateral if separation else Bonded)(stiffness), friction)
    springs, dashpots = symmetric(2, 6, 11.0), symmetric(2, 7, 0.3)
    others = (Springs(springs), Damping(dashpots), Forcing([0.6, -0.2], 1.3, 0.9, (1, 0)), ConstantForce([0.3, -0.4]))
    model = Model(Operation(profile(*belt), profile(load, rate)), contact, others, mass, springs)
    q, v = np.array([0.013, y]), np.array([0.21, -0.34])
    found = jax.tree.map(np.asarray, all_of(model, q, v))
    p0, slip = load + rate * TIME, v[0] - now(belt)
    level = p0 + stiffness * y
    touches = level >= 0 or not separation
    pressed = level if touches else 0.0
    depth = y if touches else -p0 / stiffness
    drag, wave = -mu(abs(slip)) * pressed * np.sign(slip), np.sin(2 * np.pi * 1.3 * TIME + 0.9)
    force = np.array([drag, p0 - pressed]) - springs @ q - dashpots @ v + wave * np.array([-0.2, 0.6]) + [0.3, -0.4]
    stored = p0 * depth + stiffness * depth**2 / 2 - p0 * y + q @ springs @ q / 2 - np.array([0.3, -0.4]) @ q
    np.testing.assert_allclose(found["rates"][0], force, rtol=1e-13)
    power = drag * v[0] + rate * (depth - y) - v @ dashpots @ v + wave * np.array([-0.2, 0.6]) @ v
    np.testing.assert_allclose(found["energy"], [mass @ v**2 / 2, stored], rtol=1e-12)
    np.testing.assert_allclose(found["rates"][1], power, rtol=1e-12)
    seen = [drag, pressed, touches, touches and slip * np.sign(now(belt)) > 0, pressed, -drag * slip, 0.0]
    np.testing.assert_allclose(found["observed"][:7], seen, rtol=1e-13)
    np.testing.assert_allclose(found["kinks"], [level] if separation else [], rtol=1e-13)
    np.testing.assert_allclose(found["range"], [pressed, pressed], rtol=1e-13)
    np.testing.assert_allclose(found["fastest"], abs(slip), rtol=1e-13)
    heat = model.contact.act(model.moment(TIME), tuple(q), tuple(v)).heat
    np.testing.assert_allclose(heat, -drag * slip, rtol=1e-13)


# --- how it is driven ------------------------------------------------------------------------------------------------


def pair(value, rate) -> tuple[float, float | None]:
    return float(value), None if rate is None else float(rate)


def test_an_operation_hands_out_each_schedule_in_its_place():
    steps = [profile(k, 10.0 * k) for k in (1.0, 2.0, 3.0)]
    one, two = Constant(7.0), Constant(-8.0)
    operation = Operation(steps[0], one, (steps[1], two), (steps[2],), (1, 0))
    moment = operation.at(0.5)
    assert moment.time == 0.5
    assert float(moment.drum_speed) == 6.0
    assert (float(moment.preload), moment.preload_rate) == (7.0, None)
    assert [pair(*each) for each in moment.pushes] == [(12.0, 20.0), (-8.0, None)]
    assert [pair(*each) for each in moment.further] == [(18.0, 30.0)]
    assert operation.schedules == (steps[0], one, steps[2], steps[1], two)
    assert operation.preloads == (one, steps[2])
    assert not operation.constant
    assert operation.mapped(lambda each: each) == operation
    # Of each shoe its own preload; with a rate, if only of zero, where that of any shoe changes; and no forces.
    first, second = (moment.of_shoe(k) for k in (0, 1))
    assert pair(first.preload, first.preload_rate) == (7.0, 0.0)
    assert pair(second.preload, second.preload_rate) == (18.0, 30.0)
    assert (second.pushes, second.further) == ((), ())
    still = dataclasses.replace(operation, drum_speed=Constant(4.0), pushes=(two,), further=(Constant(9.0),))
    assert still.constant
    assert still.at(1.0).of_shoe(1).preload_rate is None
    assert still.corners is None
    later = operation.mapped(lambda each: each.since(0.25))
    assert float(later.at(0.25).drum_speed) == 6.0
    np.testing.assert_array_equal(operation.corners, [-1.0] * 3 + [3.0] * 3)
    assert isinstance(moment, OperatingPoint)


def test_what_friction_has_left_never_pushes():
    hot = Temperature(CAPACITY, COOLING, FADE)
    moment = Operation(Constant(1.0), Constant(2.0)).at(0.0)
    for rise, left in ((20.0, 1 - 20 * FADE), (120.0, 0.0)):
        found: Any = hot.influence(moment, jnp.asarray([rise])).friction_left
        assert float(found) == pytest.approx(left, abs=1e-15)
    np.testing.assert_allclose(hot.size(jnp.asarray([-5.0, 0.2])), [5.0, 1.0])


# --- small bodies as they are given ----------------------------------------------------------------------------------


def test_models_of_small_bodies_hold_the_numbers_that_they_are_given():
    law = ExponentialLaw(STATIC, KINETIC, DECAY)
    forces = {"X": (0.2, 1.5, 0.3)}
    block = block_on_belt(law, mass=2.0, stiffness=3.0, damping=0.4, load=5.0, belt_speed=-0.6, forces=forces)
    springs, dashpot, forcing = block.others
    assert isinstance(forcing, Forcing)
    found = springs.matrix, dashpot.matrix, forcing.amplitude, forcing.frequency, forcing.phase, block.mass  # pyright: ignore
    np.testing.assert_array_equal([float(np.ravel(each)[0]) for each in found], [3.0, 0.4, 0.2, 1.5, 0.3, 2.0])
    assert forcing.coordinates == (0,)
    assert (float(block.operation.drum_speed.at(0.0)[0]), float(block.operation.preload.at(0.0)[0])) == (-0.6, 5.0)
    np.testing.assert_array_equal(block.stiffness, [[3.0]])
    given: Any = {"mass": [2.0, 7.0], "springs": [[3.0, -1.0], [-1.0, 4.0]], "damping": [[0.1, 0.2], [0.2, 0.5]]}
    given |= {"contact_stiffness": 9.0, "load": 5.0, "belt_speed": -0.6}
    sprung = sprung_block_on_belt(law, **given, forces={"Y": 0.8, "X": (0.2, 1.5)})
    springs, dashpots, push, forcing = sprung.others
    np.testing.assert_array_equal(sprung.stiffness, [[3.0, -1.0], [-1.0, 13.0]])
    np.testing.assert_array_equal(springs.matrix, given["springs"])  # pyright: ignore
    np.testing.assert_array_equal(dashpots.matrix, given["damping"])  # pyright: ignore
    assert isinstance(push, ConstantForce)
    np.testing.assert_array_equal(push.force, [0.0, 0.8])
    assert isinstance(forcing, Forcing)
    assert (float(forcing.frequency), float(forcing.phase), forcing.coordinates) == (1.5, 0.0, (0,))
    np.testing.assert_array_equal(sprung.mass, [2.0, 7.0])
    assert isinstance(sprung.contact.law, Unilateral)
    bonded = sprung_block_on_belt(law, **given, separation=False)
    assert isinstance(bonded.contact.law, Bonded)
    assert float(bonded.contact.law.stiffness) == 9.0
    disc = disc_on_plate(law, radius=0.3, mass=2.0, load=5.0, plate_speed=-0.6, forces={"Tz": 0.1})
    np.testing.assert_allclose(disc.mass, [2.0, 2.0, 0.09])
    np.testing.assert_allclose(disc.operation.preload.at(0.0)[0], 5.0 / (np.pi * 0.09), rtol=1e-14)
    assert float(disc.operation.drum_speed.at(0.0)[0]) == -0.6
    assert isinstance(disc.others[0], ConstantForce)
    np.testing.assert_array_equal(disc.others[0].force, [0.0, 0.0, 0.1])


def test_a_record_has_three_more_numbers_for_each_of_several_shoes():
    assert [Observation.width(shoes) for shoes in (1, 2, 3)] == [7, 13, 16]
    rows: Any = [np.full(2, float(k)) for k in range(13)]
    both = Observation.of_rows(rows)
    assert both.sticking[0] == 6.0
    assert [each[0] for each in both.of_each("normal_force")] == [8.0, 11.0]
    (alone,) = Observation.of_rows(rows[:7]).of_each("contact_fraction")
    assert alone[0] == 2.0
