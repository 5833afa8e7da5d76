"""What friction holds, and what is measured meanwhile: of blocks and a disc, against sums and searches in NumPy."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from scipy.optimize import minimize

from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.effects.damping import Damping, damping_matrix
from drumsqueal.physics.effects.forcing import ConstantForce, Forcing
from drumsqueal.physics.effects.friction import Friction, Tangential, Temperature
from drumsqueal.physics.effects.operation import Constant, Operation, PiecewiseLinear
from drumsqueal.physics.effects.pressure import Bonded, Unilateral
from drumsqueal.physics.effects.springs import Springs
from drumsqueal.physics.friction_law import StepLaw
from drumsqueal.physics.model import Model
from drumsqueal.physics.small_bodies import Block, PointContact, disc_on_plate
from drumsqueal.solve.transient.segment import AWAY, Phase
from drumsqueal.solve.transient.state import (
    CHUNK_SAMPLES,
    COUPLING_FRACTION,
    QUIET,
    Span,
    State,
    _resolution,
    highest,
    least_energy,
    local_tolerance,
    resolution,
)
from drumsqueal.solve.transient.sticking import (
    can_stick,
    drum_motion,
    fastest_while_stuck,
    friction_limit,
    minimum,
    slip,
    slip_acceleration,
    slip_motion,
    stiction,
    stiction_margin,
    stuck_model,
)

TIME, MASS, STIFFNESS = 0.4, np.array([0.7, 1.9]), 50.0
SPRINGS = np.array([[11.0, -4.0], [-4.0, 23.0]])
DASHPOTS = np.array([[0.5, 0.1], [0.1, 0.3]])
BELT, LOAD = (-0.4, 0.25), (3.0, -0.8)  # at t = 0, and what each changes in a second
AMPLITUDE, FREQUENCY, PHASE, CONSTANT = np.array([0.6, -0.2]), 1.3, 0.9, np.array([0.3, -0.4])
STATIC, KINETIC, FADE, RISE = 0.8, 0.5, 0.011, 23.0
Q, V = np.array([0.013, 2e-3]), np.array([0.21, -0.34])


def profile(value, rate):
    return PiecewiseLinear([-1.0, 3.0], [value - rate, value + 3 * rate])


def block(*, changing=True):
    friction = Friction(StepLaw(STATIC, KINETIC), Tangential())
    contact = PointContact(Block(MASS), Unilateral(STIFFNESS), friction)
    operation = Operation(profile(*BELT), profile(*LOAD)) if changing else Operation(Constant(-0.3), Constant(2.68))
    # Amplitudes are of Y and X, in this order.
    others = (
        Springs(SPRINGS),
        Damping(DASHPOTS),
        Forcing(AMPLITUDE, FREQUENCY, PHASE, (1, 0)),
        ConstantForce(CONSTANT),
    )
    return Model(operation, contact, others, MASS, SPRINGS + np.diag([0, STIFFNESS]), (Temperature(200.0, 3.0, FADE),))


@Interpreted
def all_of(model, time, q, v, memory, ends):
    stuck = stuck_model(model)

    def motion(time):
        return time, q + (time - TIME) * v, v, memory

    return {
        "rates": stuck.rates(time, q, v, memory),
        "observed": stuck.observe(time, q, v, memory),
        "slip": slip(model, time, v),
        "slip_motion": slip_motion(model, time, v),
        "slip_acceleration": slip_acceleration(model, time, v),
        "drum_motion": drum_motion(model, time, v),
        "grip": friction_limit(model, time, q, v, jnp.asarray([[0.3, 0.0], [-2.0, 0.5]]), memory),
        "fastest": fastest_while_stuck(model),
        "hold": stiction(model, time, q, v, memory, ends),
        "slips": (model.rates(time, q, v, memory), model.observe(time, q, v, memory)),
        "spare": stiction_margin(model, motion, time),
    }


@pytest.mark.parametrize("pull", [0.0, -3.0])
def test_a_block_is_held_by_what_it_takes_up_to_static_friction(pull):
    model = block()
    model = dataclasses.replace(model, others=(*model.others, ConstantForce([pull, 0.0])))
    memory = np.array([RISE])
    found, ending = (
        jax.tree.map(np.asarray, all_of(model, np.asarray(TIME), Q, V, memory, np.asarray(ends)))
        for ends in (False, True)
    )
    wave, along = np.sin(2 * np.pi * FREQUENCY * TIME + PHASE), np.cos(2 * np.pi * FREQUENCY * TIME + PHASE)
    belt, load = BELT[0] + BELT[1] * TIME, LOAD[0] + LOAD[1] * TIME

    def free(q, v, load, wave):
        """All forces but friction."""
        pressed = max(0.0, load + STIFFNESS * q[1])
        return np.array([pull, load - pressed]) - SPRINGS @ q - DASHPOTS @ v + wave * AMPLITUDE[::-1] + CONSTANT

    acting = free(Q, V, load, wave)
    needed = np.array([MASS[0] * BELT[1] - acting[0], 0.0])
    power = V @ (wave * AMPLITUDE[::-1]) - V @ DASHPOTS @ V  # the load's own power is what stores energy
    np.testing.assert_allclose(found["rates"][0], acting + needed, rtol=1e-13)
    np.testing.assert_allclose(found["rates"][1], power + needed @ V, rtol=1e-12)
    np.testing.assert_allclose(found["rates"][2], -3.0 * RISE / 200.0, rtol=1e-13)
    pressed = load + STIFFNESS * Q[1]
    np.testing.assert_allclose(found["observed"][:7], [needed[0], pressed, 1.0, 0.0, pressed, 0.0, 1.0], rtol=1e-13)
    np.testing.assert_allclose(found["slip"], abs(V[0] - belt), rtol=1e-13)
    np.testing.assert_allclose(found["slip_motion"], [V[0] - belt, 0.0], rtol=1e-13)
    np.testing.assert_allclose(found["slip_acceleration"], [V[0] - BELT[1], 0.0], rtol=1e-13)
    np.testing.assert_allclose(found["drum_motion"], [belt, V[1]], rtol=1e-13)
    left = 1 - FADE * RISE
    most = left * STATIC * pressed
    np.testing.assert_allclose(found["grip"].needed, needed, rtol=1e-13)
    np.testing.assert_allclose(found["grip"].farthest, [[most, 0.0], [-most, 0.0]], rtol=1e-12, atol=1e-15)
    stiff = (SPRINGS[1, 1] + STIFFNESS) / MASS[1]
    np.testing.assert_allclose(found["fastest"], max(np.sqrt(stiff), 2 * np.pi * FREQUENCY), rtol=1e-12)
    # That is of what moves it by itself once the belt has taken its speed.
    together = np.array([belt, V[1]])
    needs = MASS[0] * BELT[1] - free(Q, together, load, wave)[0]
    assert (most > abs(needs)) == (pull == 0)
    now = MASS[0] * BELT[1] - acting[0]
    np.testing.assert_allclose(found["hold"].reserve, most / abs(now), rtol=1e-12)
    away = [-np.sign(now), 0.0]
    np.testing.assert_allclose(found["hold"].direction, [0.0, 0.0] if pull == 0 else away, rtol=1e-12)
    np.testing.assert_allclose(ending["hold"].direction, away, rtol=1e-12)
    # 1 − needs/most and its rate, by a difference over 2e-6 s.

    def left_over(time):
        q, at = Q + (time - TIME) * V, np.sin(2 * np.pi * FREQUENCY * time + PHASE)
        load, belt = LOAD[0] + LOAD[1] * time, BELT[0] + BELT[1] * time
        needs = MASS[0] * BELT[1] - free(q, np.array([belt, V[1]]), load, at)[0]
        return 1 - abs(needs) / (left * STATIC * (load + STIFFNESS * q[1]))

    rate = (left_over(TIME + 1e-6) - left_over(TIME - 1e-6)) / 2e-6
    np.testing.assert_allclose(found["spare"].value, max(left_over(TIME), -1.0), rtol=1e-12)
    np.testing.assert_allclose(found["spare"].rate, rate, rtol=1e-6)
    np.testing.assert_allclose(found["spare"].weakest, np.sign(needs), rtol=1e-12)
    assert along != 0


def test_only_what_rubs_can_stick():
    assert can_stick(block(), at_rest=False)
    model = block()
    smooth = dataclasses.replace(model, contact=model.contact.with_friction(None))
    assert not can_stick(smooth, at_rest=True)


# --- a disc, whose limit surface is none in closed form --------------------------------------------------------------

RADIUS, PRESS, DISC_MASS, GRIP = 0.3, 5.0, 0.8, 0.4


def resistance(motion):
    """h(u) = μ p ∫ |V_u| dA by a product of Gauss's rules in polar coordinates."""
    (r, wr), angle = np.polynomial.legendre.leggauss(60), 2 * np.pi * np.arange(400) / 400
    r, wr = RADIUS * (1 + r) / 2, RADIUS * wr / 2
    x, y = r[:, None] * np.cos(angle), r[:, None] * np.sin(angle)
    speed = np.hypot(motion[0] - motion[2] * y, motion[1] + motion[2] * x)
    return GRIP * PRESS / (np.pi * RADIUS**2) * np.sum(speed * (r * wr)[:, None]) * 2 * np.pi / 400


@Interpreted
def decided(model, v):
    nothing, time = jnp.zeros(3), jnp.zeros(())
    speeds = slip(model, time, v), model.contact.pressure_range(model.operation.at(time), tuple(nothing))
    slides = model.rates(time, nothing, v), model.observe(time, nothing, v)
    return stiction(model, time, nothing, nothing, None, False), *slides, speeds


def test_a_disc_is_held_by_the_least_of_what_resists_and_slips_as_that_demands():
    pull = np.array([3.3, -2.1, 1.05])
    forces = {"X": pull[0], "Y": pull[1], "Tz": pull[2]}
    disc = disc_on_plate(StepLaw(GRIP, GRIP / 2), radius=RADIUS, mass=DISC_MASS, load=PRESS, forces=forces)
    v = np.array([0.7, -0.3, 1.9])
    found, rates, seen, speeds = decided(disc, v)

    def over(angles):
        """h(u) over what pulls that way."""
        (along, up), (across, turn) = np.cos(angles), np.sin(angles)
        way = np.array([along * up, across * up, turn / RADIUS])
        return resistance(way) / (pull @ way) if pull @ way > 0 else 1e3

    how: dict = {"method": "Nelder-Mead", "options": {"xatol": 1e-9, "fatol": 1e-13, "maxiter": 2000}}
    least = minimize(over, [-0.5, 0.4], **how)
    assert float(found.reserve) == pytest.approx(least.fun, rel=1e-6)
    assert least.fun < 1
    # M r + ∂h(r) = pull: the least of ½ rᵀM r + h(r) − pull·r.
    scale = 1 / np.sqrt(DISC_MASS * np.array([1, 1, RADIUS**2 / 2]))
    moved = minimize(lambda x: x @ x / 2 + resistance(x * scale) - pull @ (x * scale), pull * scale, **how).x * scale
    # To a slip of 1 m/s on the rim. The searches know the least to 1e-13 and its place to some roots of that.
    np.testing.assert_allclose(found.direction, moved / (np.hypot(*moved[:2]) + RADIUS * abs(moved[2])), rtol=2e-4)
    # While it slips: −∂h/∂v, with the kinetic coefficient, a half of the static one; and what is recorded of it.
    drag = [(resistance(v - 1e-5 * unit) - resistance(v + 1e-5 * unit)) / 2e-5 / 2 for unit in np.eye(3)]
    np.testing.assert_allclose(rates[0], pull + drag, rtol=1e-4)
    np.testing.assert_allclose(rates[1], drag @ v, rtol=1e-4)  # the pulls store energy
    wanted = [drag[0], PRESS, 1.0, 0.0, PRESS / (np.pi * RADIUS**2), resistance(v) / 2, 0.0]
    np.testing.assert_allclose(seen[:7], wanted, rtol=1e-4)
    np.testing.assert_allclose(speeds[0], np.hypot(0.7, 0.3) + RADIUS * 1.9, rtol=1e-12)
    np.testing.assert_allclose(speeds[1], [PRESS / (np.pi * RADIUS**2)] * 2, rtol=1e-12)


MATRIX = np.array([[3.0, 1.0, -0.5], [1.0, 2.0, 0.3], [-0.5, 0.3, 0.9]])
WAY, LINE = np.array([0.4, -1.2, 2.0]), np.array([1.0, 0.5, -0.7])


@eqx.filter_jit
def least_of(kink):
    def function(x):
        side = jnp.sum(LINE * x) - 0.6
        slope = jnp.sum(MATRIX * x, axis=1) - WAY + kink * jnp.sign(side) * LINE
        return jnp.sum(MATRIX * x * x[:, None]) / 2 - jnp.sum(WAY * x) + kink * jnp.abs(side), slope

    return minimum(function, jnp.asarray([0.3, -0.2, 0.9]))


@pytest.mark.parametrize("kink", [0.0, 0.3, 40.0])
def test_the_least_of_a_convex_function_is_found_also_at_its_kink(kink):
    found, least = (np.asarray(each) for each in least_of(jnp.asarray(kink)))
    bare, push = np.linalg.solve(MATRIX, WAY), np.linalg.solve(MATRIX, LINE)
    # At the kink it pushes with what keeps it there, at most its strength.
    wanted = bare - np.clip((LINE @ bare - 0.6) / (LINE @ push), -kink, kink) * push
    np.testing.assert_allclose(found, wanted, atol=1e-6)
    value = wanted @ MATRIX @ wanted / 2 - WAY @ wanted + kink * abs(LINE @ wanted - 0.6)
    np.testing.assert_allclose(least, value, rtol=1e-12)


# --- what a motion is measured by ------------------------------------------------------------------------------------


@Interpreted
def measured(model, state, steady, memory, stuck):
    span = Span(jnp.asarray(TIME), jnp.asarray(0.01), jnp.asarray(3))
    local = local_tolerance(jnp.asarray(1e-6), "dopri8")
    measure = resolution(model, span, local)
    scale = jnp.asarray([0.5, 2.0, 4.0, 0.25, 8.0, 0.125])
    phase = Phase(model, steady, span, measure, scale, 1 / scale, jnp.full(6, 0.01), jnp.asarray(1e-3), stuck)
    place, velocity, work = state
    now, time = State(place, velocity, work, memory), jnp.asarray(0.02)
    flat = now.flat() / scale
    stages = phase.stages(local)
    return {
        "measure": measure,
        "amplitudes": measure.amplitudes(model, now),
        "least": least_energy(model),
        "slope": phase.slope(time, flat),
        "size": phase.size_of(flat),
        "kinks": phase.kinks(time, flat),
        "least_slip": phase.least_slip(flat),
        "halts": phase.halts(time, flat),
        "row": phase.row(time, flat, jnp.asarray(0.7), True),
        "stages": stages.rates(time, flat[:2], flat[2:5]),
        "ratio": (stages.ratio, stages.metric),
        "grid": span.grid,
        "highest": (highest(jnp.asarray([0.0, 3.0])), highest(jnp.zeros(2))),
        "changed": phase.changed(time, flat, jnp.asarray(True)),
    }


@pytest.mark.parametrize("stuck", [False, True])
def test_steps_ask_for_what_the_motion_is_in_its_units(stuck):
    model, steady, memory = block(), np.array([0.02, -1e-3]), np.array([RISE])
    place, velocity, work = np.array([0.013, 2e-3]), V, np.asarray(0.31)
    found = jax.tree.map(np.asarray, measured(model, (place, velocity, work), steady, memory, jnp.asarray(stuck)))
    scale = np.array([0.5, 2.0, 4.0, 0.25, 8.0, 0.125])
    # The frictionless modes, by another routine.
    squared, modes = scipy.linalg.eigh(np.asarray(model.stiffness), np.diag(MASS))
    omega = np.sqrt(squared)
    load = LOAD[0] + LOAD[1] * TIME
    quiet = max(QUIET, 16 * np.finfo(float).eps * load / STIFFNESS / 1e-8)
    least = quiet * omega[-1] * np.sqrt(MASS.max())
    np.testing.assert_allclose(found["measure"].omega, omega, rtol=1e-12)
    np.testing.assert_allclose(found["measure"].least, least, rtol=1e-12)
    np.testing.assert_allclose(found["least"], (QUIET * omega[-1]) ** 2 * MASS.max() / 2, rtol=1e-12)
    speeds = np.hypot(omega * (modes.T * MASS @ place), modes.T * MASS @ velocity)
    total = np.hypot(np.linalg.norm(speeds), least)
    speeds = np.maximum(speeds, COUPLING_FRACTION * total)
    wanted = np.abs(modes) @ (speeds / omega), np.abs(modes) @ speeds, total**2 / 2, [RISE]
    for part, each in zip(found["amplitudes"], wanted, strict=True):
        np.testing.assert_allclose(part, each, rtol=1e-11)
    size = np.concatenate([*wanted[:2], wanted[3], [wanted[2]]]) / scale
    flat = np.concatenate([place, velocity, memory, [work]]) / scale
    np.testing.assert_allclose(found["size"], np.maximum(np.abs(flat) + 0.01, size) - 1, rtol=1e-11)
    time = TIME + 0.02
    q, belt = steady + place, BELT[0] + BELT[1] * time
    at = np.array([belt, velocity[1]]) if stuck else velocity
    says = [all_of(model, np.asarray(time), q, each, memory, np.asarray(stuck)) for each in (velocity, at)]
    (force, power, cooled), _ = (says[0]["rates"], None) if stuck else says[0]["slips"]
    seen = says[1]["observed"] if stuck else says[1]["slips"][1]
    rates = np.concatenate([force / MASS, cooled]) / scale[2:5]
    np.testing.assert_allclose(found["slope"], [*velocity / scale[:2], *rates, power / scale[5]], rtol=1e-11)
    np.testing.assert_allclose(found["stages"][0], rates, rtol=1e-11)
    np.testing.assert_allclose(found["stages"][1], power / scale[5], rtol=1e-11)
    np.testing.assert_allclose(found["ratio"][0], scale[2:4] / scale[:2])
    np.testing.assert_allclose(found["ratio"][1], [*MASS * scale[2:4] ** 2, 0.0])
    level = LOAD[0] + LOAD[1] * time + STIFFNESS * (steady + place)[1]
    np.testing.assert_allclose(found["kinks"], [level], rtol=1e-12)
    np.testing.assert_allclose(found["least_slip"], 1e-3 * abs(velocity[0]), rtol=1e-12)
    assert not found["halts"]
    row = [*place, *at, RISE, 1.01, *seen[:7]]
    np.testing.assert_allclose(found["row"][:13], row, rtol=1e-11)
    np.testing.assert_allclose(found["row"][13], at**2 @ MASS / 2, rtol=1e-12)
    depth = q[1]  # pressed: p0 e + ½ k e² − p0 y, and what the springs and the constant force store
    stored = STIFFNESS * depth**2 / 2 + q @ SPRINGS @ q / 2 - CONSTANT @ q
    np.testing.assert_allclose(found["row"][14], stored, rtol=1e-12)
    np.testing.assert_array_equal(found["highest"], [3.0, 1.0])
    np.testing.assert_allclose(found["grid"], [0.0, 0.01, 0.02, 0.03, *[np.inf] * (CHUNK_SAMPLES - 3)])
    after, sticks = found["changed"]
    reserve, direction = says[0]["hold"]
    assert bool(sticks) == (not stuck and float(reserve) >= 1)
    away: Any = 0.0 if sticks else AWAY * 1e-3 * float(found["amplitudes"].velocity[0])
    moved: Any = np.array([belt, velocity[1]]) + away * np.asarray(direction)
    np.testing.assert_allclose(after * scale, np.concatenate([place, moved, [RISE, work]]), rtol=1e-11)


def test_a_span_and_a_state_are_taken_apart_as_they_are_put_together():
    span = Span(np.float64(2.0), np.float64(0.5), np.int64(4), after=np.float64(2.25), before=np.float64(3.0))
    assert span.length == 2.0
    assert [span.inside(np.float64(t)) for t in (2.0, 2.5, 3.5)] == [2.25, 2.5, 3.0]
    flat = np.arange(14.0).reshape(2, 7)
    state = State.split(flat, 2)
    np.testing.assert_array_equal(state.vibration, flat[:, :2])
    np.testing.assert_array_equal(state.velocity, flat[:, 2:4])
    assert state.memory is not None
    np.testing.assert_array_equal(state.memory, flat[:, 4:6])
    np.testing.assert_array_equal(state.work, flat[:, 6])
    assert State.split(flat[:, :5]).memory is None


def test_ratios_of_damping_are_those_of_the_coordinates_of_a_mode():
    # Of three masses that springs couple unlike: ζ_j = Σ ζ_i m_i φ_ij², of a mode that moves away none.
    mass, ratio = np.array([0.7, 1.9, 0.2]), np.array([0.01, 0.05, 0.2])
    stiffness = np.array([[11.0, -4.0, 1.0], [-4.0, 23.0, -2.0], [1.0, -2.0, -0.5]])
    squared, modes = scipy.linalg.eigh(stiffness, np.diag(mass))
    omega = np.sqrt(np.maximum(squared, 0))
    shaped = mass[:, None] * modes
    wanted = shaped * (2 * omega * (ratio @ (shaped * modes))) @ shaped.T
    found = eqx.filter_jit(damping_matrix)(ratio, jnp.asarray(mass), jnp.asarray(stiffness))
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-12)
    assert squared[0] < 0


def test_quiet_is_what_round_off_of_the_largest_load_leaves():
    contact = PointContact(Block(MASS), Bonded(0.0), None)
    soft = Model(Operation(Constant(1.0), Constant(5e9)), contact, (), MASS, SPRINGS)
    span = Span(np.asarray(0.0), np.asarray(1.0), np.asarray(1))

    @eqx.filter_jit
    def least(model):
        return resolution(model, span, jnp.asarray(1e-8)).least / _resolution(model, 1.0).least

    # The springs yield to friction, of which the stiffest is 23 N/m.
    np.testing.assert_allclose(least(soft), 16 * np.finfo(float).eps * 5e9 / 23.0 / 1e-8, rtol=1e-12)
