"""Limit cycles: the flow map and its derivatives, cycles and multipliers, branches and folds."""

import json
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
import xarray
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar
from scipy.special import i1

from along_y import OPTIONS, AlongY, brake_along_y
from drumsqueal.dynamics.cycles import branches, continuation
from drumsqueal.dynamics.cycles import search as search_module
from drumsqueal.dynamics.cycles.branches import CycleFamily, DiagramBuilder
from drumsqueal.dynamics.cycles.continuation import Track, _kind
from drumsqueal.dynamics.cycles.cycle import BranchEnd, Cycle, CycleBranch, Event
from drumsqueal.dynamics.cycles.search import cycle_from, is_same, modal_starts, returns
from drumsqueal.errors import CycleError
from drumsqueal.files.output_folder import to_json
from drumsqueal.findings.schema import read_findings
from drumsqueal.physics.effects.damping import Damping
from drumsqueal.physics.friction_law import ExponentialLaw, StepLaw
from drumsqueal.physics.model import build_model
from drumsqueal.physics.small_bodies import block_on_belt, sprung_block_on_belt
from drumsqueal.questions.cycle import study
from drumsqueal.questions.cycle.answer import _shade, branches_table, milestones
from drumsqueal.questions.cycle.study import (
    CycleBranches,
    CycleStudy,
    ParameterRange,
    diagram_verdict,
    end_words,
    find_cycle,
    follow_cycles,
)
from drumsqueal.scene import SceneError, load_scene
from drumsqueal.scene.variation import Variation
from drumsqueal.simulation import run
from drumsqueal.solve import shooting as floquet_module
from drumsqueal.solve.linear.branches import point_at
from drumsqueal.solve.linear.steady import linear_model
from drumsqueal.solve.shooting import Shooting, ShootingStart, floquet, floquet_of
from drumsqueal.solve.transient.flow import StickTransition, flow, neighbours
from drumsqueal.solve.transient.integrate import integrate
from odd_friction import OddFriction, odd_friction

SCENARIOS = Path(__file__).parents[2] / "scenarios"
SIZE = np.array([1e-5, 2e-5, 2e-4, 0.2, 0.2, 3.0])  # of states of the shoe that go through all edges
STATE, DURATION = np.array([0.15, 0.45, 0.75, 0.45, 0.05, 0.1]), 1e-3

# A state of the self-consistent scene at 2 rad/s, a tenth of a millisecond before slip begins to turn back and ends to.
GRAZING_SIZE = np.array([1.36357829e-06, 2.84357817e-05, 5.66164839e-05, 3.77587956e-02, 2.52140564e-01, 1.60637164])
GRAZING = np.array([-0.10311518, 0.72871922, 0.03049711, -0.79346629, 0.58319555, 0.96045362])


@pytest.fixture(scope="module")
def damped():
    return load_scene(SCENARIOS / "damped.toml")


@pytest.fixture(scope="module")
def search(damped):
    return find_cycle(damped)


# The flow map


@pytest.mark.thorough
@pytest.mark.parametrize("amplitude", [0.0, 1e-9])
def test_the_transition_at_steady_sliding_is_the_matrix_exponential(damped, amplitude):
    model = build_model(damped)
    exact = scipy.linalg.expm(np.asarray(linear_model(model)[1].state_matrix()) * DURATION) * SIZE / SIZE[:, None]
    found = flow(model, SIZE, amplitude * STATE, DURATION, 1e-10)
    # 200 steps with local errors of 1e-12, and the motion's own size beyond linear.
    np.testing.assert_allclose(found.transition, exact, rtol=0, atol=1e-10 + amplitude)


@pytest.mark.thorough
def test_the_derivatives_through_boundaries_are_those_of_differences(damped):
    # Slip reverses and contact is lost and found again in this motion: an edge enters at an end of the lining, and
    # pairs of them are born inside it. Differences of tight flows, of the fourth order.
    model, step = build_model(damped), 2e-4
    found = flow(model, SIZE, STATE, DURATION, 1e-12)
    for k in range(6):
        unit = step * np.eye(6)[k]
        ends = {j: np.asarray(flow(model, SIZE, STATE + j * unit, DURATION, 1e-12).end) for j in (-2, -1, 1, 2)}
        slope = (8 * (ends[1] - ends[-1]) - (ends[2] - ends[-2])) / (12 * step)
        # Errors of 1e-12 a step, some 1e-11 in all, over the difference's 2e-4: 1e-7.
        np.testing.assert_allclose(found.transition[:, k], slope, rtol=0, atol=2e-7)


@pytest.mark.thorough
def test_neighbours_say_the_same_and_are_not_led_astray():
    brake = load_scene(SCENARIOS / "damped.toml")
    tangents = flow(build_model(brake), SIZE, STATE, DURATION, 1e-12).transition
    beside = neighbours(build_model(brake), SIZE, STATE, np.eye(6), DURATION)[1]
    # 1e-12 of a step over the 1e-6 that they begin apart.
    np.testing.assert_allclose(beside, tangents, rtol=0, atol=1e-5)
    # Where slip begins to turn back in this scene tangents come out as they please, up to 18 times too long;
    # differences of the fourth order, ten times as far apart, do not.
    scene = load_scene(SCENARIOS / "self_consistent.toml")
    model = build_model(scene, {"drum.speed": 2.0})
    beside = np.asarray(neighbours(model, GRAZING_SIZE, GRAZING, np.eye(6), 1e-4)[1])
    for k in range(6):
        unit = 1e-5 * np.eye(6)[k]
        ends = {j: np.asarray(flow(model, GRAZING_SIZE, GRAZING + j * unit, 1e-4, 1e-11).end) for j in (-2, -1, 1, 2)}
        slope = (8 * (ends[1] - ends[-1]) - (ends[2] - ends[-2])) / 12e-5
        np.testing.assert_allclose(beside[:, k], slope, rtol=0, atol=1e-3)


@pytest.mark.thorough
def test_the_derivative_with_respect_to_a_number_of_the_scene_is_that_of_differences(damped):
    def model(speed):
        return build_model(damped, {"drum.speed": speed})

    change = jax.jit(lambda speed: jax.jvp(model, (speed,), (1.0,)))(5.0)[1]
    found = flow(model(5.0), SIZE, STATE, DURATION, 1e-12, change)
    ends = [np.asarray(flow(model(5.0 + sign * 1e-4), SIZE, STATE, DURATION, 1e-12).end) for sign in (1, -1)]
    np.testing.assert_allclose(found.sensitivity, (ends[0] - ends[1]) / 2e-4, rtol=0, atol=2e-7)


# The cycle of the damped brake


class Independent:
    """The damped brake in the plane in NumPy: those of docs/theory.md, edges from arc cosines, 24 nodes a piece."""

    def __init__(self, scene):
        shoe, half = scene.shoe, scene.shoe.arc_angle / 2
        R, h = shoe.outer_radius, shoe.thickness
        self.R, self.half, self.decay = R, half, scene.friction.decay
        self.line = R * shoe.width
        self.c = 4 * (h**2 - 3 * h * R + 3 * R**2) / (3 * 2 * half * (2 * R - h)) * np.sin(half)
        r, weight = np.polynomial.legendre.leggauss(40)
        radius, ring = R - h / 2 + h / 2 * r, weight * h / 2 * shoe.density * shoe.width
        angles, wide = half * r, weight * half
        out, turn = np.meshgrid(radius, angles, indexing="ij")
        cell = np.outer(ring * radius, wide)
        inertia = np.sum(cell * ((out * np.cos(turn) - self.c) ** 2 + (out * np.sin(turn)) ** 2))
        self.mass = np.array([cell.sum(), cell.sum(), inertia])
        self.p0 = scene.contact.normal_load / (self.line * 2 * half)
        self.k, self.mu = scene.contact.stiffness, (scene.friction.kinetic, scene.friction.static)
        self.speed, self.springs = R * scene.drum.speed, scene.support.upper_stiffness + scene.support.lower_stiffness
        self.nodes, self.weights = np.polynomial.legendre.leggauss(24)
        self.balance = -self.contact(np.zeros(6))
        shapes = np.stack([np.cos(angles), np.sin(angles), -self.c * np.sin(angles)])
        stiffness = self.k * self.line * np.einsum("in,jn,n->ij", shapes, shapes, wide)
        stiffness += np.diag([self.springs, 0, self.springs * R**2])
        squared, modes = scipy.linalg.eigh(stiffness, np.diag(self.mass))
        shaped = self.mass[:, None] * modes
        self.damping = shaped @ np.diag(2 * scene.damping.ratio * np.sqrt(squared)) @ shaped.T

    def contact(self, state):
        """Pressure and friction along X, Y and Tz."""
        (x, y, t), (u, v, w) = state[:3], state[3:]
        pressure = (self.p0, self.k * x, self.k * (y - self.c * t))
        slip = (self.R * w - self.speed, v - self.c * w, -u)
        boundaries = [-self.half, self.half]
        for constant, cosine, sine in (pressure, slip):
            size = np.hypot(cosine, sine)
            if size > abs(constant):
                middle, reach = np.arctan2(sine, cosine), np.arccos(-constant / size)
                boundaries += [(middle + s * reach + np.pi) % (2 * np.pi) - np.pi for s in (-1, 1)]
        boundaries = np.sort([boundary for boundary in boundaries if abs(boundary) <= self.half])
        centre, reach = (boundaries[1:] + boundaries[:-1]) / 2, (boundaries[1:] - boundaries[:-1]) / 2
        angle = (centre[:, None] + reach[:, None] * self.nodes).ravel()
        area = (reach[:, None] * self.weights).ravel() * self.line
        cosine, sine = np.cos(angle), np.sin(angle)
        normal = np.maximum(0, pressure[0] + pressure[1] * cosine + pressure[2] * sine) * area
        fast = slip[0] + slip[1] * cosine + slip[2] * sine
        kinetic, static = self.mu
        drag = -(kinetic + (static - kinetic) * np.exp(-self.decay * np.abs(fast))) * normal * np.sign(fast)
        along_x, along_y = -normal * cosine - drag * sine, -normal * sine + drag * cosine
        return np.array([along_x.sum(), along_y.sum(), self.R * drag.sum() - self.c * along_y.sum()])

    def rate(self, _, state):
        elastic = np.array([self.springs * state[0], 0, self.springs * self.R**2 * np.sin(2 * state[2]) / 2])
        force = self.contact(state) + self.balance - elastic - self.damping @ state[3:]
        return np.concatenate([state[3:], force / self.mass])

    def after(self, state, time):
        # With longer steps its error estimate does not see where edges are born: it is off by 3e-8 then.
        how: Any = {"rtol": 1e-12, "atol": 1e-12, "max_step": time / 700}
        scaled = solve_ivp(lambda t, y: self.rate(t, y * SIZE) / SIZE, (0, time), state / SIZE, "DOP853", **how)
        return scaled.y[:, -1] * SIZE


@pytest.mark.thorough
def test_the_cycle_and_its_multipliers_are_those_of_an_independent_code(damped, search):
    brake, cycle = Independent(damped), search
    # The two codes' forces differ by 1e-12 of the load, and so do their steps.
    closed = (brake.after(cycle.state, cycle.period_s) - cycle.state) / SIZE
    assert np.max(np.abs(closed)) < 1e-9
    columns, step = [], 3e-4
    for k in range(6):
        ends = [brake.after(cycle.state + sign * step * SIZE * np.eye(6)[k], cycle.period_s) / SIZE for sign in (1, -1)]
        columns.append((ends[0] - ends[1]) / (2 * step))
    multipliers, unit_error = floquet(np.array(columns).T, brake.rate(0, cycle.state) / SIZE)
    # Where a step of the witness passes the birth of an edge unseen it is off by some 3e-9, and a central difference by
    # that over its step: with steps of 1e-4 to 6e-4, 700 or 2000 of its own and other phases 1e-7 to 9e-6 was found.
    assert unit_error < 2e-5
    np.testing.assert_allclose(multipliers, cycle.multipliers, rtol=0, atol=2e-5)
    assert cycle.unit_multiplier_error < 1e-9
    assert cycle.residual < 1e-10
    assert cycle.stable


@pytest.mark.thorough
def test_a_long_transient_ends_on_the_cycle(damped, search):
    cycle = search
    assert search.transient == "settles to a periodic motion"
    # Of the largest multiplier, 0.903, twenty periods leave 0.13 of a departure: from 0.4 s on it is round-off.
    long = damped.with_values({"simulate.duration": 0.8, "simulate.tolerance": 1e-9, "simulate.sample_rate": 2e5})
    result = run(long)
    saturation = result.findings.saturation
    assert saturation is not None
    motion = result.history.sel(coordinate=list(cycle.names)).isel(time=slice(-40_000, None))
    states = np.concatenate([motion["displacement"].values, motion["velocity"].values], axis=1)
    # Upward passages of Y through zero, between samples by a cubic: the period over 200 turns.
    curve = scipy.interpolate.CubicHermiteSpline(motion["time"].values, states[:, 1], states[:, 4])
    up = [root for root in curve.roots(extrapolate=False) if curve(root, 1) > 0]
    assert (up[-1] - up[0]) / (len(up) - 1) == pytest.approx(cycle.period_s, rel=1e-5)
    for k, name in enumerate(cycle.names):
        # Of samples 5 µs apart the largest is off by half the square of ω times half of that: 1e-4 of what is fast.
        fine = scipy.interpolate.CubicHermiteSpline(motion["time"].values, states[:, k], states[:, k + 3])
        turns = fine(fine.derivative().roots(extrapolate=False))
        assert np.ptp(turns) / 2 == pytest.approx(cycle.amplitude[name], rel=1e-5)
    # The state itself, at the phase at which it comes nearest.
    period = cycle.samples
    own = scipy.interpolate.CubicSpline(period.time, np.concatenate([period.displacement, period.velocity], axis=1))
    last = states[-1] / SIZE

    def away(phase):
        return np.max(np.abs(own(phase % cycle.period_s) / SIZE - last))

    coarse = min(period.time, key=away)
    best: Any = minimize_scalar(away, bounds=(coarse - 4e-6, coarse + 4e-6), method="bounded", options={"xatol": 1e-13})
    assert best.fun < 1e-5


@pytest.mark.thorough
def test_one_period_balances_energy(search):
    samples = search.samples
    assert np.abs(samples.energy_balance_error).max() < 1e-8 * samples.kinetic_energy.max()


# A block on a belt: Hopf, fold, sticking


def falling_friction(belt_speed):
    """P6: x″ + 0.1 x′ + x = 0.5 (1 + e^(−2 |v|)) sgn(v), v = belt speed − x′."""
    return block_on_belt(ExponentialLaw(1.0, 0.5, 2.0), damping=0.1, belt_speed=belt_speed)


def with_derivative(model):
    return jax.jit(lambda value: jax.jvp(model, (value,), (1.0,)))


@pytest.fixture(scope="module")
def block():
    return DiagramBuilder.of(falling_friction, 0.8, 2.4, 12).from_hopf_points()


@pytest.fixture(scope="module")
def beginning():
    """The branch next to its Hopf point at 1.1513 m/s, in less time."""
    return DiagramBuilder.of(falling_friction, 1.1, 1.17, 3).from_hopf_points()


@pytest.mark.thorough
def test_the_branch_leaves_a_subcritical_hopf_point_as_its_normal_form_says(block):
    (critical,), (branch,) = block.linear.critical, block.branches
    assert critical.value == pytest.approx(0.5 * np.log(10.0), abs=1e-11)
    assert branch.start == BranchEnd.HOPF
    for cycle in branch.cycles[:8]:
        amplitude = cycle.amplitude["X"]
        # Averaged: ξ A = Δμ e^(−v_d/v0) I1(A/v0), of which A²/(8 v0) = v_d − v_H is the beginning; to second order in
        # friction, which is 0.05.
        averaged = 0.5 * np.log(0.5 * i1(2 * amplitude) / (0.05 * amplitude))
        assert cycle.value - critical.value == pytest.approx(averaged - critical.value, rel=5e-3)
        assert not cycle.stable
        assert cycle.unit_multiplier_error < 1e-9
    first = branch.cycles[0]
    assert first.value - critical.value == pytest.approx(first.amplitude["X"] ** 2 / 4, rel=1e-3)
    assert first.frequency_Hz == pytest.approx(critical.frequency_Hz, rel=1e-5)


@pytest.mark.thorough
def test_multipliers_and_period_of_the_unstable_cycle_are_those_of_a_return_map(block):
    cycle = block.branches[0].cycles[6]

    def rate(_, y):
        v = cycle.value - y[1]
        return [y[1], 0.5 * (1 + np.exp(-2 * abs(v))) * np.sign(v) - 0.1 * y[1] - y[0]]

    def upwards(_, y):
        return y[1]

    upwards.terminal, upwards.direction = 2, -1

    def returned(amplitude):
        """From the right-hand turning point to the next one."""
        found = solve_ivp(rate, (0, 10), [amplitude, 0.0], "DOP853", rtol=1e-12, atol=1e-12, events=upwards)
        after = [t for t in found.t_events[0] if t > 1]
        return float(found.sol(after[0])[0]) if found.sol else float(found.y_events[0][-1][0]), after[0]

    top = cycle.samples.displacement[:, 0].max()
    exact = brentq(lambda x: returned(x)[0] - x, 0.999 * top, 1.001 * top, xtol=1e-13)
    assert isinstance(exact, float)
    assert returned(exact)[1] == pytest.approx(cycle.period_s, rel=1e-9)
    slope = (returned(exact + 1e-4)[0] - returned(exact - 1e-4)[0]) / 2e-4
    assert cycle.multipliers[0].real == pytest.approx(slope, rel=1e-6)


def sliding_rate(speed):
    """The block of falling friction while it is slower than the belt."""

    def rate(_, y):
        return [y[1], 0.5 * (1 + np.exp(-2 * (speed - y[1]))) - 0.1 * y[1] - y[0]]

    return rate


def released(speed, ends):
    """From where friction of 1 N just holds the block of falling friction, up to an event of the second passage."""
    how: Any = {"rtol": 1e-12, "atol": 1e-12, "events": ends}
    found = solve_ivp(sliding_rate(speed), (0, 9), [1 - 0.1 * speed, speed], "DOP853", **how)
    return next((t, y) for t, y in zip(found.t_events[0], found.y_events[0], strict=True) if t > 1)


def slip_and_stick(speed):
    """How long (s) the block of falling friction slips, once it is released, and then sticks."""

    def stops(_, y):
        return y[1] - speed

    stops.direction = 1
    slips, (place, _) = released(speed, stops)
    return slips, (1 - 0.1 * speed - place) / speed


@pytest.mark.thorough
def test_the_branch_turns_round_where_the_block_just_touches_the_speed_of_the_belt(block):
    def fastest(speed):
        def top(t, y):
            return sliding_rate(speed)(t, y)[1]

        top.direction = -1
        return released(speed, top)[1][1] - speed

    # Where a block that was released comes back just as fast as the belt.
    exact = brentq(fastest, 1.6, 2.0, xtol=1e-12)
    (branch,) = block.branches
    (grazing,) = branch.special
    assert grazing.what is Event.GRAZING
    # The smallest step along the branch, 1e-6 of its scale of 1.6 m/s.
    assert grazing.value == pytest.approx(exact, abs=1.6e-6)
    assert (branch.start, branch.end) == (BranchEnd.HOPF, BranchEnd.BOUND)
    place = branch.cycles.index(grazing)
    slipping, sticking = branch.cycles[: place + 1], branch.cycles[place + 1 :]
    assert all(not cycle.stable and cycle.sticking_phases == 0 for cycle in slipping)
    assert all(cycle.stable and cycle.sticking_phases == 1 for cycle in sticking)
    assert all(np.array_equal(cycle.multipliers, [0]) for cycle in sticking)
    # The multiplier of the slipping side, that of its neighbours, though motions on either side of it are others.
    assert grazing.multipliers[0].real == pytest.approx(slipping[-2].multipliers[0].real, rel=1e-2)
    assert [stable for _, stable in branch.pieces()] == [False, True]
    ((low, high),) = block.squeals_only_when_disturbed
    assert (low, high) == (pytest.approx(0.5 * np.log(10.0), abs=1e-10), grazing.value)
    assert block.grazings == (grazing.value,)
    assert not block.not_followed
    assert not block.squeals_unknown


@pytest.mark.thorough  # stretches that slip and stick are held to closed forms, and to differences, by quicker tests
def test_cycles_that_stick_have_the_period_of_their_slip_and_their_stick(block):
    for cycle in block.branches[0].cycles[-6:]:
        slips, sticks = slip_and_stick(cycle.value)
        # Errors of 1e-10 of the motion in where it stops, over how fast its slip falls there.
        assert cycle.period_s == pytest.approx(slips + sticks, rel=1e-8)
        assert cycle.sticking_fraction == pytest.approx(sticks / (slips + sticks), abs=1e-8)
        assert cycle.unit_multiplier_error < 1e-8
        assert cycle.tangent_error < 1e-6


@pytest.mark.thorough
def test_a_branch_that_no_corner_leads_on_is_unknown_beyond(monkeypatch):
    monkeypatch.setattr(continuation.Track, "_around", lambda *_: None)
    lost = DiagramBuilder.of(falling_friction, 0.8, 2.4, 12).from_hopf_points()
    (unfollowed,) = lost.not_followed
    assert "Newton's method fails" in unfollowed.reason
    assert (unfollowed.low, unfollowed.high) == (lost.branches[0].cycles[-1].value, 2.4)
    assert not lost.squeals_only_when_disturbed
    ((low, high),) = lost.squeals_unknown
    assert (low, high) == (unfollowed.low, 2.4)
    verdict = diagram_verdict(lost, Variation("belt speed", "m/s", (0.8, 2.4)))
    assert "unknown from 1.84 to 2.4 m/s" in verdict
    assert "none of them coexists" not in verdict


def test_what_cannot_be_started_is_unknown_in_the_whole_range(monkeypatch):
    monkeypatch.setattr(CycleFamily, "from_hopf", partial(_raised, CycleError("lost")))
    lost = DiagramBuilder.of(falling_friction, 0.8, 2.4, 12).from_hopf_points()
    assert [(each.low, each.high) for each in lost.not_followed] == [(0.8, 2.4)]
    ((low, high),) = lost.squeals_unknown
    assert (low, high) == (pytest.approx(0.5 * np.log(10.0)), 2.4)
    assert "is unknown" in diagram_verdict(lost, Variation("belt speed", "m/s", (0.8, 2.4)))


def polynomial(cubic: float = -0.4, quintic: float = 0.5) -> OddFriction:
    """μ = 1 + a (s − 1)³ + b (s − 1)⁵: on a belt of 1 m/s, x″ + c x′ + x + a x′³ + b x′⁵ = 1.

    Averaged, c + 3/4 a A² + 5/8 b A⁴ = 0 for a cycle of amplitude A.
    """
    return odd_friction(1.0, 0.0, cubic, quintic)


@pytest.mark.thorough
def test_a_fold_is_found_where_an_independent_code_has_it():
    def model(damping):
        return block_on_belt(polynomial(), damping=damping, belt_speed=1.0)

    diagram = DiagramBuilder.of(model, -0.02, 0.12, 12).from_hopf_points()
    (branch,) = diagram.branches
    folds = [special for special in branch.special if special.what == Event.FOLD]
    assert len(folds) == 1

    def closing(amplitude):
        """The damping with which the motion closes at an amplitude."""

        def gain(damping):
            def rate(_, y):
                return [y[1], -y[0] - damping * y[1] + 0.4 * y[1] ** 3 - 0.5 * y[1] ** 5]

            def top(_, y):
                return y[1]

            top.direction = -1
            found = solve_ivp(rate, (0, 9), [amplitude, 0.0], "DOP853", rtol=1e-12, atol=1e-13, events=top)
            return next(y[0] for t, y in zip(found.t_events[0], found.y_events[0], strict=True) if t > 1) - amplitude

        damping = brentq(gain, -0.05, 0.2, xtol=1e-13)
        assert isinstance(damping, float)
        return damping

    best: Any = minimize_scalar(lambda amplitude: -closing(amplitude), bounds=(0.5, 0.9), method="bounded")
    assert folds[0].value == pytest.approx(-best.fun, rel=1e-6)
    assert folds[0].multipliers[0].real == pytest.approx(1.0, abs=1e-4)
    # Between the Hopf point and the fold it squeals only when it is disturbed.
    ((low, high),) = diagram.squeals_only_when_disturbed
    assert low == pytest.approx(0.0, abs=1e-10)
    assert high == pytest.approx(folds[0].value)


@pytest.mark.thorough
def test_a_branch_ends_at_the_other_hopf_point():
    def model(p):  # damping is negative between 0.3 and 0.7
        return block_on_belt(polynomial(0.4, 0.0), damping=(p - 0.3) * (p - 0.7), belt_speed=1.0)

    diagram = DiagramBuilder.of(model, 0.0, 1.0, 12).from_hopf_points()
    assert [each.value for each in diagram.linear.critical] == pytest.approx([0.3, 0.7], abs=1e-10)
    (branch,) = diagram.branches
    assert (branch.start, branch.end) == (BranchEnd.HOPF, BranchEnd.HOPF)
    assert not branch.special
    for cycle in branch.cycles:
        assert cycle.stable
        assert 0.3 < cycle.value < 0.7
        # Averaged; to second order in damping and friction, of 0.04.
        wanted = np.sqrt(-(cycle.value - 0.3) * (cycle.value - 0.7) / 0.3)
        assert cycle.amplitude["X"] == pytest.approx(wanted, rel=5e-3)


@pytest.mark.thorough
def test_a_branch_that_comes_back_is_a_loop():
    def model(p):  # at rest it is damped everywhere; a cycle lives where damping is below that of the fold
        return block_on_belt(polynomial(), damping=0.06 + p**2, belt_speed=1.0)

    models = with_derivative(model)
    start = ShootingStart(np.array([1.81, 0.0]), 2 * np.pi, "")
    cycle = cycle_from(models(0.01)[0], start, np.array([1.0]))
    branch = CycleFamily(models, (-1.0, 1.0)).both_ways(cycle.model_copy(update={"value": 0.01}))
    assert (branch.start, branch.end) == (BranchEnd.LOOP, BranchEnd.LOOP)
    assert [special.what for special in branch.special] == [Event.FOLD, Event.FOLD]
    # Averaged, the fold lies at a damping of 0.072.
    low, high = sorted(special.value for special in branch.special)
    assert -low == pytest.approx(high, rel=1e-6)
    assert high == pytest.approx(np.sqrt(0.012), rel=1e-2)
    assert [stable for _, stable in branch.pieces()] == [True, False, True]
    assert is_same(branch.cycles[0], branch.cycles[-1])


# Where the search begins, and what it takes for a cycle


def test_along_a_mode_the_start_has_the_amplitude_that_averaging_gives():
    model = falling_friction(1.3)
    point = point_at(falling_friction, 1.3)
    made_up: Any = SimpleNamespace(coordinates=("X",), steady_state=point.steady, vibrations=point.modes)
    *_, start = modal_starts(model, made_up)  # larger ones slip backwards
    amplitude = brentq(lambda a: 0.5 * np.log(0.5 * i1(2 * a) / (0.05 * a)) - 1.3, 0.1, 2.0)
    # Between two of eighty amplitudes, 11 % apart, the work is taken for a straight line.
    assert np.max(np.abs(start.state - [0.5 + 0.5 * np.exp(-2.6), 0.0])) == pytest.approx(amplitude, rel=1e-2)
    assert start.period == pytest.approx(2 * np.pi, rel=1e-2)


def test_a_record_returns_after_its_period():
    time = np.linspace(0.0, 3.999, 4000)
    angle = 2 * np.pi * 5.0 * time
    motion = np.cos(angle) + 0.3 * np.cos(3 * angle) + 1e-3 * time  # it drifts a little: no return is exact
    first, *others = returns(time, np.column_stack([motion, np.gradient(motion, time)]), np.array([1.0, 30.0]), 2.0)
    assert first.period == pytest.approx(0.2, abs=1e-9)
    assert all(other.period > 0.21 or other.period < 0.19 for other in others)


@pytest.mark.thorough
def test_where_every_amplitude_closes_none_is_a_cycle():
    model = block_on_belt(polynomial(0.0, 0.0), damping=0.0, belt_speed=1.0)
    with pytest.raises(CycleError, match="one of a continuous family"):
        cycle_from(model, ShootingStart(np.array([1.3, 0.0]), 2 * np.pi, ""), np.ones(1))


def test_of_a_period_found_several_times_over_the_shortest_counts():
    model = block_on_belt(polynomial(), damping=0.05, belt_speed=1.0)
    once, thrice = (
        cycle_from(model, ShootingStart(np.array([1.86, 0.0]), 2 * n * np.pi, ""), np.ones(1)) for n in (1, 3)
    )
    assert is_same(once, thrice)


def test_the_cycle_of_a_model_is_found_from_its_own_transient():
    model = block_on_belt(polynomial(), damping=0.05, belt_speed=1.0)
    found = find_cycle(model, {"displacement": {"X": 1.5}}, 600.0, sample_rate=20.0, tolerance=1e-8)
    # Both are closed to 1e-9 of the motion.
    assert is_same(found, cycle_from(model, ShootingStart(np.array([2.86, 0.0]), 2 * np.pi, ""), np.ones(1)))
    assert found.stable
    assert found.found_from == "the end of the transient"
    assert "m in X" in found.verdict


# In the unit of the range their ends are 0.97 + 1e-16, 0.3 + 5e-17 and so on.
@pytest.mark.thorough
@pytest.mark.parametrize(("low", "high"), [(0.81, 0.97), (0.3, 0.7)])
def test_a_cycle_at_an_end_of_the_range_is_there_once_and_of_that_very_value(low, high):
    family = CycleFamily(with_derivative(falling_friction), (low, high))
    for value in (low, high):
        cycle = family.sticking_at(value)
        assert cycle is not None
        branch = family.both_ways(cycle)
        values = [each.value for each in branch.cycles]
        assert (values[0], values[-1]) == (low, high)
        assert all(a < b for a, b in pairwise(values))
        assert (branch.start, branch.end) == (BranchEnd.BOUND, BranchEnd.BOUND)
    # So motions that begin there are on the branch, and none of its own.
    assert len(follow_cycles(falling_friction, (low, high)).branches) == 1


def test_a_branch_that_does_not_reach_the_end_of_the_range_is_lost_there(monkeypatch):
    family = CycleFamily(with_derivative(falling_friction), (0.8, 1.0))
    cycle = family.sticking_at(0.9)
    assert cycle is not None
    close = Shooting.close

    def fails_at_the_end(self, guess, *conditions):
        at_the_end = not conditions and guess[-1] == 1.0 / self.scale[-1]
        return None if at_the_end else close(self, guess, *conditions)

    monkeypatch.setattr(Shooting, "close", fails_at_the_end)
    branch = family.both_ways(cycle)
    last = branch.cycles[-1].value
    assert (branch.start, branch.end) == (BranchEnd.BOUND, BranchEnd.LOST)
    assert branch.end_detail == f"Newton's method fails between {last:.6g} and the end of the range"
    (lost,) = branch.not_followed(0.8, 1.0)
    assert (lost.low, lost.high, lost.reason) == (last, 1.0, branch.end_detail)
    assert end_words(branch) == [f"is lost where it ends: {branch.end_detail}"]


# The squeal of the damped brake with less static friction: its frequency falls with the speed to 3.8508 rad/s, where
# slip reversal reaches the lining anew, and rises from there to the fold. There the branch turns by nearly 180°. Both
# steps came out just behind that corner, where the nearer one of the two tangents leads back.
@pytest.mark.thorough  # 20 s each: two corners, and only one shows a wrong tangent
@pytest.mark.parametrize("first_step", [0.0172, 0.0284])
def test_a_branch_goes_on_behind_a_sharp_corner_and_does_not_run_back(monkeypatch, first_step):
    friction = {"static": 0.416, "kinetic": 0.3263, "decay": 0.952}
    scene = load_scene(SCENARIOS / "damped.toml").with_values(
        {f"friction.{name}": value for name, value in friction.items()} | {"damping.ratio": 0.005117}
    )
    low, high, value = 3.0, 5.5, 3.8
    family = CycleFamily(with_derivative(lambda speed: build_model(scene, {"drum.speed": speed})), (low, high))
    state = [-2.27164808e-06, 3.86380682e-05, 2.47329089e-05, 9.68786874e-03, -2.46023585e-01, -1.60938186e-01]
    start, steady = ShootingStart(np.array(state), 9.186069935e-4, "a transient"), family.steady_at(value)
    assert steady is not None
    shooting = family._shooting(value, start, steady)
    closed = shooting.close(shooting.scaled(start.state, start.period, value))
    assert closed is not None
    monkeypatch.setattr(continuation, "FIRST_STEP", first_step)
    monkeypatch.setattr(continuation, "MOST_POINTS", 25)  # 9 to 16 on the way to the corner, 18 to 25 to the fold
    track = Track(shooting, (low, high), family.steady_at, BranchEnd.BOUND, lambda _: None)
    track.follow(closed, np.eye(closed.unknowns.size)[-1])
    fold = next((k for k, cycle in enumerate(track.cycles) if cycle.what == Event.FOLD), None)
    rising = track.cycles[:fold]
    assert all(a.value < b.value for a, b in pairwise(rising))
    (corner,) = (cycle for cycle in rising if cycle.what)
    assert corner.what == Event.CORNER
    assert corner.value == pytest.approx(3.8508, abs=1e-4)
    assert all(a.frequency_Hz > b.frequency_Hz for a, b in pairwise(rising) if b.value <= corner.value)
    assert all(a.frequency_Hz < b.frequency_Hz for a, b in pairwise(rising) if a.value > corner.value)


def test_of_a_model_that_comes_to_rest_the_stable_and_the_unstable_cycle_are_found():
    found = find_cycle(falling_friction(1.3), {"displacement": {"X": 1e-3}}, 30.0, sample_rate=10.0)
    assert found.stable
    assert "sticking as a whole for 11 % of the period in one phase" in found.verdict
    slips, sticks = slip_and_stick(1.3)
    # Errors of 1e-10 of the motion in where it stops, over how fast its slip falls there.
    assert found.period_s == pytest.approx(slips + sticks, rel=1e-8)
    assert found.sticking_fraction == pytest.approx(sticks / (slips + sticks), abs=1e-8)
    assert found.multipliers.tolist() == [0]
    assert "forgotten within a period" in found.verdict
    (unstable,) = found.others
    averaged = 0.5 * np.log(0.5 * i1(2 * unstable.amplitude["X"]) / (0.05 * unstable.amplitude["X"]))
    assert averaged == pytest.approx(1.3, rel=5e-3)  # to second order in friction, which is 0.05
    assert not unstable.stable


# Cycles that stick


def coulomb(speed):
    return block_on_belt(StepLaw(1.0, 0.5), belt_speed=speed)


def hyperbolic(speed):
    return block_on_belt(lambda slip: 1 / (1 + 3 * slip), belt_speed=speed)


def two_ways(speed):
    """A block that moves along the belt and into it; friction follows its load, which may pull in the codes here."""
    how: Any = {"separation": False, "mass": [1.0, 1.3], "springs": [[2.0, 0.3], [0.3, 1.0]], "contact_stiffness": 0.7}
    damping = [[0.05, 0.0], [0.0, 0.05]]
    return sprung_block_on_belt(ExponentialLaw(0.8, 0.3, 2.0), belt_speed=speed, damping=damping, **how)


def transient_end(model, state, duration):
    """Where the event-driven transient, which knows no tangents, is after a time."""
    n = len(model.names)
    how: Any = {"duration": duration, "sample_rate": 20 / duration, "tolerance": 1e-12, "solver": "dopri8"}
    *_, chunk = integrate(model, np.zeros(n), state[:n], state[n:], **how)
    return np.concatenate([chunk.displacement[-1], chunk.velocity[-1]]), chunk.changes


@pytest.mark.thorough(but=["falling_friction-1.2-state2-7.0"])
@pytest.mark.parametrize(
    ("family", "speed", "state", "duration"),
    [
        (coulomb, 0.2, [1.0, 0.0], 8.9),  # static friction above the kinetic one: the slip begins with a jump
        (hyperbolic, 0.2, [1.1, 0.0], 12.0),
        (falling_friction, 1.2, [2.0, 0.1], 7.0),
        (two_ways, 0.3, [1.0, 0.5, -0.3, 0.0], 9.0),  # its slip reverses at first, then it sticks twice
    ],
)
def test_derivatives_through_slip_and_stick_are_those_of_differences_of_transients(family, speed, state, duration):
    state, step = np.array(state), 1e-5
    model, change = with_derivative(family)(speed)
    found = flow(model, np.ones(state.size), state, duration, 1e-10, change)
    end, changes = transient_end(model, state, duration)
    # Some 1e-10 in where it stops; and a transient of other samples.
    np.testing.assert_allclose(found.end, end, rtol=0, atol=1e-8)
    sticks = [time for time, what in found.changes if what is StickTransition.STICKS]
    assert sticks == pytest.approx([time for time, begins in changes if begins], abs=1e-7)
    for k in range(state.size):
        unit = step * np.eye(state.size)[k]
        ends = [transient_end(model, state + sign * unit, duration)[0] for sign in (1, -1)]
        # Errors of 1e-11 over the step, and its square times a curvature of some ten.
        np.testing.assert_allclose(found.transition[:, k], (ends[0] - ends[1]) / (2 * step), rtol=0, atol=2e-6)
    ends = [transient_end(family(speed + sign * step), state, duration)[0] for sign in (1, -1)]
    # Coulomb's jump divides by the belt's speed: the third derivative is some thousand.
    np.testing.assert_allclose(found.sensitivity, (ends[0] - ends[1]) / (2 * step), rtol=0, atol=2e-6)


@pytest.mark.thorough(but=["1e-05", "1e-07"])
@pytest.mark.parametrize("excess", [1e-3, 1e-5, 1e-7])
def test_however_little_a_block_outruns_the_belt_it_sticks(excess):
    # About 0.5 m it swings with V (1 + ε): it is as fast as the belt √(2ε) before it would be fastest, and sticks until
    # the spring takes all of friction.
    speed = 1.0
    # By the law of falling friction, which does not fall then: they have one program.
    model = block_on_belt(ExponentialLaw(0.5, 0.5, 2.0), belt_speed=speed)
    found = flow(model, np.ones(2), np.array([0.5 + speed * (1 + excess), 0.0]), 2 * np.pi, 1e-10)
    assert found.pattern == (StickTransition.STICKS, StickTransition.SLIPS)
    (stop, _), (release, _) = found.changes
    # A slip of 1e-10, which counts as none, is there earlier by 1e-10/√(2ε).
    assert release - stop == pytest.approx(np.sqrt((1 + excess) ** 2 - 1), abs=1e-6)
    # It is then the cycle that just touches the belt, whatever it was before: one direction is lost.
    assert np.linalg.det(found.transition) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.thorough  # the block of falling friction, which has a program already, is held to SciPy above
def test_the_coulomb_block_has_its_closed_forms_and_forgets_every_disturbance():
    found = find_cycle(coulomb(0.2), {"velocity": {"X": 0.2}}, 60.0, sample_rate=50.0, tolerance=1e-8)
    slips = 2 * (np.pi - np.arctan(0.5 / 0.2))
    assert found.period_s == pytest.approx(5.0 + slips, abs=1e-8)
    assert found.sticking_fraction == pytest.approx(5.0 / (5.0 + slips), abs=1e-8)
    assert found.amplitude["X"] == pytest.approx(np.hypot(0.5, 0.2), abs=1e-7)  # between samples by cubics
    assert found.multipliers.tolist() == [0]
    assert found.stable
    assert "forgotten within a period" in found.verdict
    dumped = found.model_dump(mode="json")
    assert (dumped["sticking_phases"], dumped["multipliers"]) == (1, [[0.0, 0.0]])


@pytest.mark.thorough
def test_the_block_of_hyperbolic_friction_has_the_published_period():
    found = find_cycle(hyperbolic(0.2), {"velocity": {"X": 0.2}}, 100.0, sample_rate=20.0)
    assert found.period_s == pytest.approx(12.0010313, abs=1e-7)
    assert 2 * found.amplitude["X"] == pytest.approx(1.13394468 + 0.55543269, abs=2e-8)
    assert found.multipliers.tolist() == [0]


@pytest.mark.thorough
def test_multipliers_of_a_block_that_moves_two_ways_are_those_of_an_independent_return_map():
    speed = 0.3
    cycle = CycleFamily(with_derivative(two_ways), (0.2, 0.4)).sticking_at(speed)
    assert cycle is not None
    assert cycle.sticking_phases == 1
    springs = np.array([[2.0, 0.3], [0.3, 1.7]])

    def sliding(_, state):
        (x, y), (u, v) = state[:2], state[2:]
        load, slip = 1.0 + 0.7 * y, speed - u
        force = -springs @ [x, y] - 0.05 * np.array([u, v])
        force[0] += (0.3 + 0.5 * np.exp(-2 * slip)) * load
        return [u, v, force[0], force[1] / 1.3]

    def sticking(t, state):
        rates = sliding(t, [*state[:2], speed, state[3]])
        return [speed, state[3], 0.0, rates[3]]

    def needed(_, state):  # what holds the block, beyond what friction can
        force = springs[0] @ state[:2] + 0.05 * speed
        return force - 0.8 * (1.0 + 0.7 * state[1])

    def stops(_, state):
        return state[2] - speed

    needed.terminal = stops.terminal = True
    stops.direction = 1

    def returned(y, v):
        """From one release, where y and v fix the place along the belt, to the next."""
        x = (0.8 * (1.0 + 0.7 * y) - 0.3 * y - 0.05 * speed) / 2.0
        state = np.array([x, y, speed, v])
        for rate, end, time in ((sliding, stops, 0.05), (sticking, needed, 0.0)):
            if time:  # away from the belt's speed, where it begins
                state = solve_ivp(rate, (0, time), state, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
            state = solve_ivp(rate, (0, 20), state, "DOP853", rtol=1e-12, atol=1e-13, events=end).y[:, -1]
        return state[[1, 3]]

    samples = cycle.samples
    last = np.flatnonzero(samples.observation.sticking)[-1]
    fixed: Any = scipy.optimize.root(
        lambda z: returned(*z) - z, [samples.displacement[last, 1], samples.velocity[last, 1]], tol=1e-12
    )
    columns = [(returned(*(fixed.x + d)) - returned(*(fixed.x - d))) / 2e-5 for d in 1e-5 * np.eye(2)]
    exact = np.linalg.eigvals(np.array(columns).T)
    assert cycle.multipliers[-1] == 0
    # Differences of 1e-12 over 1e-5, and their third derivatives.
    np.testing.assert_allclose(np.sort_complex(cycle.multipliers[:2]), np.sort_complex(exact), atol=1e-5)


@pytest.mark.thorough
def test_what_sticks_again_and_again_and_closes_nowhere_is_not_passed_over(monkeypatch):
    monkeypatch.setattr(branches, "cycle_from", partial(_raised, CycleError("lost")))
    diagram = follow_cycles(coulomb, (0.2, 0.4))
    assert not diagram.branches
    assert [(each.low, each.high) for each in diagram.not_followed] == [(0.2, 0.4)]
    assert diagram.not_followed[0].reason == "from rest on the drum: lost"


def test_what_does_not_stick_again_is_no_cycle():
    family = CycleFamily(with_derivative(falling_friction), (1.8, 2.4))
    assert family.sticking_at(2.4) is None


def test_what_friction_does_not_hold_on_the_drum_slips_on_and_sticks_no_more():
    # At steady sliding the spring pulls with the whole kinetic friction, and the dashpot as the block moves on.
    constant = ExponentialLaw(0.3, 0.3, 2.0)  # by the law of falling friction: they have one program
    diagram = follow_cycles(lambda speed: block_on_belt(constant, damping=0.05, belt_speed=speed), (0.2, 1.0))
    assert (diagram.branches, diagram.not_followed, diagram.notes) == ((), (), ())


@pytest.mark.thorough
def test_where_static_friction_exceeds_kinetic_the_branch_ends_with_grazing():
    # Released at x = μ_s − c V it slides about μ_k; the branch ends where it comes back just as fast as the belt.
    damping = 0.1

    def fastest(speed):
        omega, decay = np.sqrt(1 - damping**2 / 4), damping / 2
        x, v = 1.0 - damping * speed - 0.5, speed
        time = np.linspace(1.0, 2 * np.pi + 1.0, 200_001)
        wave = x * np.cos(omega * time) + (v + decay * x) / omega * np.sin(omega * time)
        slope = -omega * x * np.sin(omega * time) + (v + decay * x) * np.cos(omega * time)
        return np.max(np.exp(-decay * time) * (slope - decay * wave)) - speed

    exact = brentq(fastest, 0.2, 1.5, xtol=1e-9)

    def model(speed):
        return block_on_belt(StepLaw(1.0, 0.5), damping=damping, belt_speed=speed)

    diagram = follow_cycles(model, (0.3, 1.0))
    (branch,) = diagram.branches
    assert (branch.start, branch.end) == (BranchEnd.BOUND, BranchEnd.GRAZING)
    # The smallest step along the branch, 1e-6 of its scale of 0.7 m/s.
    assert branch.cycles[-1].value == pytest.approx(exact, abs=7e-7)
    assert branch.cycles[-1].what is Event.GRAZING
    assert diagram.squeals_only_when_disturbed == ((0.3, branch.cycles[-1].value),)
    assert not diagram.not_followed


@pytest.mark.parametrize(
    ("more", "how", "why"),
    [
        ({"forces": {"X": (0.1, 0.2)}}, {}, "this model changes with time"),
        ({}, {"sample_rate": 0.1}, "sample_rate must be at least"),
        ({}, {"start": {"velocity": {"Y": 1.0}}}, "no coordinate of this model"),
    ],
)
def test_what_has_no_cycle_of_its_own_is_refused(more, how, why):
    model = block_on_belt(polynomial(), damping=0.05, belt_speed=1.0, **more)
    with pytest.raises(ValueError, match=why):
        find_cycle(model, **({"start": {}, "duration": 10.0, "sample_rate": 20.0} | how))


@pytest.mark.thorough
def test_cycles_of_a_family_of_models_are_followed_by_its_public_name(block):
    kept = []
    found = follow_cycles(falling_friction, (2.4, 0.8), keep=kept.append)
    (branch,), (own,) = found.branches, block.branches
    # 60 values instead of 12 are looked at for Hopf points, and the same one is found.
    assert branch.cycles[3].value == pytest.approx(own.cycles[3].value, rel=1e-9)
    assert branch.start == own.start == BranchEnd.HOPF
    assert len(kept) == len(branch.cycles)


# What happens on a branch, and how stability is told


@pytest.mark.thorough
def test_a_neimark_sacker_point_is_found_and_named():
    # Beside the cycle of the polynomial friction along x swings y, uncoupled: y″ + c y′ + 0.3 y = 0. Over a period T
    # its multipliers are e^(−c T/2 ± i ω T), and the cycle loses its stability where c falls through zero.
    def model(damping):
        springs, dashpots = jnp.diag(jnp.array([1.0, 0.3])), jnp.diag(jnp.stack([jnp.asarray(0.05), damping]))
        block = sprung_block_on_belt(polynomial(), mass=np.ones(2), springs=springs, contact_stiffness=0.0)
        return eqx.tree_at(lambda each: each.others, block, (*block.others, Damping(dashpots)))

    models, steady = with_derivative(model), np.array([1.0, 0.0])
    # Averaged: c = 0.3 A² − 0.3125 A⁴ along x.
    start = ShootingStart(np.array([1.863, 0.0, 0.0, 0.0]), 2 * np.pi, "")
    cycle = cycle_from(models(0.02)[0], start, steady)
    branch = CycleFamily(models, (-0.05, 0.05)).both_ways(cycle.model_copy(update={"value": 0.02}))
    (marginal,) = branch.special
    assert marginal.what is Event.NEIMARK_SACKER
    assert marginal.value == pytest.approx(0.0, abs=1e-6)  # 1e-5 of a step, which is 0.015 at most
    for each in branch.cycles:
        squared = 0.3 - each.value**2 / 4
        pair = np.exp((-each.value / 2 + 1j * np.sqrt(squared) * np.array([1, -1])) * each.period_s)
        away = np.min(np.abs(each.multipliers[:, None] - pair), axis=0)
        assert np.max(away) < 1e-8  # tolerances of 1e-10, and the derivative's
        if each is not marginal:
            assert each.unstable_directions == (2 if each.value < 0 else 0)
    assert (branch.start, branch.end) == (BranchEnd.BOUND, BranchEnd.BOUND)
    assert [branch.cycles[k].value for k in (0, -1)] == pytest.approx([-0.05, 0.05], rel=1e-12)
    assert [stable for _, stable in branch.pieces()] == [False, True]


@pytest.mark.parametrize(
    ("multipliers", "name"),
    [
        ([1.3, 0.6 + 0.8j, 0.6 - 0.8j], Event.NEIMARK_SACKER),
        ([-1.0 - 1e-9, 0.9, 0.1], Event.DOUBLING),
        ([1.0 + 1e-9, 0.9, -0.8], Event.BRANCHING),
    ],
)
def test_what_leaves_the_unit_circle_names_the_point(multipliers, name):
    cycle: Any = SimpleNamespace(multipliers=np.array(multipliers, dtype=complex))
    assert _kind(cycle) == name


# It leaves the rate (1, 1, 0) as it is, halves (1, −1, 0), and nothing depends on the last.
TRANSITION = np.array([[0.75, 0.25, 0.0], [0.25, 0.75, 0.0], [0.0, 0.0, 1.0]])
STRETCHED = 4 * np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 0.0]])


@pytest.mark.parametrize(
    ("tangents", "beside"),
    [
        (TRANSITION, TRANSITION + 1e-5),  # they agree: tangents, which are better
        (TRANSITION + STRETCHED, TRANSITION + np.diag([0, 0, 1e-10])),  # tangents led astray
        (TRANSITION, TRANSITION + np.diag([3.0, 8.0, 0])),  # neighbours on either side of an edge
    ],
)
def test_multipliers_are_those_of_what_can_be_trusted(monkeypatch, tangents, beside):
    monkeypatch.setattr(floquet_module, "neighbours", lambda *_: (None, beside))
    multipliers, unit_error, _ = floquet_of(*made_up_motion(tangents))
    # The free displacement, whose multiplier is 1 whatever the motion, is not among them.
    assert multipliers == pytest.approx([0.5], abs=1e-14)
    assert unit_error < 1e-14


def test_neighbours_that_are_lost_are_told(monkeypatch):
    monkeypatch.setattr(floquet_module, "neighbours", lambda *_: (None, np.full((3, 3), np.nan)))
    with pytest.raises(CycleError, match="not followed"):
        floquet_of(*made_up_motion(TRANSITION))


def made_up_motion(transition) -> Any:
    shooting = SimpleNamespace(
        unscaled=lambda unknowns: (unknowns[:-2], 1.0, 0.0),
        models=lambda parameter: (None, None),
        scale=np.ones(5),
    )
    shooting.flow = lambda _: found
    found = SimpleNamespace(transition=transition, rate=np.array([2.0, 2.0, 0.0]), lost=0, pattern=())
    return shooting, SimpleNamespace(unknowns=np.zeros(5), flow=found)


@pytest.mark.thorough
def test_a_cycle_that_all_but_grazes_has_the_multipliers_of_its_side(damped):
    # An unstable cycle at 4.39994 rad/s, 1e-6 from where slip would just come to reverse. Neighbours on either side of
    # that say 7.4. A little farther off, at 4.39990 rad/s, where both agree, the largest multiplier is 1.318792.
    scale = np.array([4.7248519856e-06, 6.6826117505e-05, 8.1191033222e-05, 0.1308357002, 0.58693408468, 1.35985665377])
    state = np.array([-0.38245584384, 0.36546918728, 0.1916228057515, 1.49804676265, -0.62716544141, -0.126752333059])
    astray = []
    # Round-off decides at which of these speeds the neighbours lie on either side.
    for change in (0.0, 1e-9, -1e-9, 1e-7, -1e-7):
        model = build_model(damped, {"drum.speed": 4.3999443387838335 + change})
        shooting = Shooting(lambda _, model=model: (model, None), np.append(scale, [0.0009452191061, 1.0]))
        closed = shooting.close(np.concatenate([state, [1.0, 0.0]]), np.eye(8)[-1])
        assert closed is not None
        multipliers, unit_error, tangent_error = floquet_of(shooting, closed)
        assert unit_error < 1e-7  # 2.4e-8 where a neighbour grazes, 1e-11 elsewhere
        assert multipliers[0].real == pytest.approx(1.318792, abs=1e-4)
        astray.append(tangent_error > 1e-2)
    assert any(astray)


@pytest.mark.thorough
def test_between_two_corners_nothing_is_called_stable_unseen(block):
    unstable = block.branches[0].cycles[:3]
    corners = tuple(each.model_copy(update={"what": Event.CORNER}) for each in unstable)
    branch = CycleBranch(start=BranchEnd.HOPF, end=BranchEnd.BOUND, cycles=corners)
    assert [stable for _, stable in branch.pieces()] == [False]


def test_a_marginal_cycle_is_neutral_in_the_table_too(beginning):
    first = beginning.branches[0].cycles[0]
    shown = tuple(
        first.model_copy(update={"multipliers": np.array([largest, 0.1], dtype=complex)})
        for largest in (0.5, 1 - 1e-8, 1 + 1e-8, 2.0)
    )
    branch = CycleBranch(start=BranchEnd.HOPF, end=BranchEnd.BOUND, cycles=shown)
    speed = Variation("drum.speed", "rad/s", (1.1, 1.17))
    scene = load_scene(SCENARIOS / "damped.toml")
    more: Any = dict(beginning) | {"branches": (branch,)}
    found = CycleBranches(scene=scene, parameter=ParameterRange.of(speed), critical_values=(), **more)
    header, *rows = (line.split(",") for line in branches_table(found).splitlines())
    assert [row[header.index("stable")] for row in rows] == ["yes", "neutral", "neutral", "no"]
    assert [row[header.index("unstable_directions")] for row in rows] == ["0", "0", "0", "1"]


def test_what_begins_at_a_hopf_point_is_named_as_the_cycle_that_it_is(beginning):
    branch = beginning.branches[0]
    (what, first), *_ = milestones(branch)
    assert (what, first) == ("first cycle", branch.cycles[0])
    assert first.value != beginning.linear.critical[0].value


def test_nothing_is_painted_where_nothing_is_known(beginning):
    axes = Figure().subplots()
    axes.set_xlim(1.0, 1.3)
    _shade(axes, beginning)
    boundaries = [
        x
        for patch in axes.patches
        if isinstance(patch, Rectangle)
        for x in (patch.get_x(), patch.get_x() + patch.get_width())
    ]
    assert min(boundaries) == pytest.approx(1.1, abs=1e-12)
    assert max(boundaries) == pytest.approx(1.17, abs=1e-12)


@pytest.mark.thorough
def test_a_branch_goes_on_where_steady_sliding_is_not_found(block, monkeypatch):
    monkeypatch.setattr(CycleFamily, "steady_at", lambda self, value: None)
    again = DiagramBuilder.of(falling_friction, 0.8, 2.4, 12).from_hopf_points()
    assert again.branches[0].end == block.branches[0].end


@pytest.mark.thorough
def test_a_cycle_of_the_scene_that_cannot_be_followed_leaves_the_others(damped, search, block, monkeypatch):
    monkeypatch.setattr(branches.DiagramBuilder, "from_hopf_points", lambda self: self._update(**dict(block)))
    monkeypatch.setattr(study, "search", lambda transient, progress: ([search, *search.others], ""))
    monkeypatch.setattr(branches, "is_branch_cycle", lambda *_: False)
    monkeypatch.setattr(CycleFamily, "both_ways", partial(_raised, CycleError("lost")))
    diagram = follow_cycles(damped, "drum.speed=1..9")
    assert diagram.branches == block.branches
    assert diagram.notes == ("from the scene's own cycle of 1028.85 Hz: lost",)


# What is refused


@pytest.mark.parametrize(
    ("name", "values", "why"),
    [
        ("stop", {}, "constant value, not a profile"),
        ("damped", {"forcing": {"amplitude": {"Y": 1.0}, "frequency": 500.0}}, "leave the force out"),
    ],
)
def test_what_changes_with_time_has_no_cycle(name, values, why):
    with pytest.raises(SceneError, match=why):
        find_cycle(load_scene(SCENARIOS / f"{name}.toml").with_values(values))


@pytest.mark.thorough
def test_where_nothing_else_leads_to_a_cycle_a_disturbance_does(damped, monkeypatch):
    # Along Y alone steady sliding is stable at 20 rad/s; a start of half a millimetre squeals there.
    monkeypatch.setattr(search_module, "modal_starts", lambda *_: iter(()))
    monkeypatch.setattr(search_module, "returns", lambda *_: iter(()))
    values = {"drum.speed": 20.0, "simulate.coordinates": ["Y"], "simulate.duration": 0.3}
    small, large = ({"start": {"displacement": {"Y": y}, "velocity": {}}} for y in (1e-7, 5e-4))
    disturbed, known = (find_cycle(damped.with_values(values | start)) for start in (small, large))
    assert disturbed.found_from == "the end of a transient after a large disturbance along mode Y"
    assert known.found_from == "the end of the transient"
    assert disturbed.stable
    # Both are closed to 1e-9 of the motion.
    assert disturbed.frequency_Hz == pytest.approx(known.frequency_Hz, rel=1e-8)


@pytest.mark.thorough
def test_where_only_an_unstable_cycle_is_found_a_disturbance_is_tried_too(damped, search, monkeypatch):
    cycle = Cycle(**{name: getattr(search, name) for name in Cycle.model_fields})
    unstable = cycle.model_copy(update={"multipliers": 2 * cycle.multipliers / cycle.largest})
    disturbed = cycle.model_copy(update={"period_s": 1.1 * cycle.period_s})
    recorded: list[np.ndarray] = []

    def transient(sought, *_):
        recorded.append(sought.displacement)
        period = None if len(recorded) < 3 else disturbed.period_s
        return search_module.RecordedMotion(np.zeros(1), np.zeros((1, 6)), "comes to rest in steady sliding", period)

    def close(model, start, steady, on_flow):
        return disturbed if "disturbance" in start.origin else unstable

    monkeypatch.setattr(search_module, "recorded", transient)
    monkeypatch.setattr(
        search_module, "modal_starts", lambda *_: iter([ShootingStart(np.zeros(6), 1e-3, "along mode Y")])
    )
    monkeypatch.setattr(search_module, "cycle_from", close)
    found = find_cycle(damped)
    # The second disturbance leads to a cycle, so that the third mode is not disturbed.
    assert len(recorded) == 3
    assert found.found_from.startswith("the end of a transient after a large disturbance along mode")
    assert found.period_s == disturbed.period_s
    (other,) = found.others
    assert (other.period_s, other.found_from) == (unstable.period_s, "along mode Y")
    # Where no disturbance leads anywhere the unstable one is what there is.
    monkeypatch.setattr(search_module, "recorded", lambda sought, *_: replace(transient(sought), period=None))
    assert find_cycle(damped).multipliers is not disturbed.multipliers
    assert not find_cycle(damped).stable


def test_a_range_through_a_drum_at_rest_is_refused(damped):
    with pytest.raises(SceneError, match="drum at rest"):
        follow_cycles(damped, "drum.speed=-1..5")


@pytest.mark.thorough
def test_without_damping_every_amplitude_closes_and_none_is_a_cycle(nominal):
    linear = nominal.with_values({"friction": None, "contact.separation": False, "simulate.duration": 0.05})
    with pytest.raises(CycleError, match="no periodic motion was found"):
        find_cycle(linear)


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["scenarios/stop.toml"], "drum.speed"),
        (["scenarios/damped.toml", "--along", "drum.sped=1..4"], "drum.speed"),
        (["scenarios/damped.toml", "--along", "drum.speed=-1..4"], "drum at rest"),
        (["scenarios/damped.toml", "--along", "drum.speed=1..4x10"], "no number of values"),
    ],
)
def test_wrong_requests_are_told_and_write_nothing(drumsqueal, monkeypatch, tmp_path, arguments, why):
    monkeypatch.chdir(SCENARIOS.parent)
    status, _, err = drumsqueal("cycle", *arguments, "-o", str(tmp_path / "out"))
    assert status == 2
    assert why in err
    assert err.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.thorough
def test_the_command_writes_the_cycle(drumsqueal, tmp_path, search, monkeypatch):
    monkeypatch.setattr(study, "find_cycle", lambda scene, progress: search)
    status, out, err = drumsqueal("cycle", str(SCENARIOS / "damped.toml"), "-o", str(tmp_path))
    assert (status, err) == (0, "")
    assert "stable limit cycle at 1028.854 Hz" in " ".join(out.split())
    data = json.loads((tmp_path / "cycle.json").read_text())
    assert data["period_s"] == search.period_s
    assert data["stable"] is True
    assert to_json(read_findings(tmp_path / "cycle.json", CycleStudy)) == (tmp_path / "cycle.json").read_text()
    with xarray.open_dataset(tmp_path / "cycle.nc") as period:
        assert period["time"][-1] == pytest.approx(search.period_s)
        first, last = (period["displacement"].isel(time=k).values for k in (0, -1))
        assert np.max(np.abs(first - last)) < 1e-9 * np.abs(period["displacement"]).max()
    assert (tmp_path / "cycle.png").stat().st_size > 10_000


def test_the_command_finds_the_cycle_of_a_brake_along_y(drumsqueal, tmp_path, as_kept):
    how = (*OPTIONS, "--set", "simulate.duration=0.05")
    status, out, err = drumsqueal("cycle", str(SCENARIOS / "damped.toml"), *how, "-o", str(tmp_path))
    assert (status, err) == (0, "")
    as_kept("cycle", out, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"cycle.json", "cycle.nc", "cycle.png"}
    found = read_findings(tmp_path / "cycle.json", CycleStudy)
    frequency, amplitude, multiplier = AlongY(brake_along_y()).cycle
    # SciPy steps over kinks where slip reverses, to 1e-6 or so; the multiplier is read off 1e-4 of the motion.
    assert found.frequency_Hz == pytest.approx(frequency, rel=1e-5)
    assert found.amplitude["Y"] == pytest.approx(amplitude, rel=1e-5)
    assert found.multipliers.tolist() == [pytest.approx(multiplier, rel=3e-3)]
    assert "stable limit cycle at 1444.105 Hz" in " ".join(out.split())
    with xarray.open_dataset(tmp_path / "cycle.nc") as period:
        assert period["time"][-1] == pytest.approx(1 / found.frequency_Hz)
        assert np.ptp(period["displacement"].values) / 2 == pytest.approx(amplitude, rel=1e-3)  # peaks between samples


@pytest.mark.slow
def test_the_command_follows_cycles(drumsqueal, tmp_path):
    # From the Hopf point of the damped brake at 10.6123 rad/s through its first folds, close to it.
    scene, along = str(SCENARIOS / "damped.toml"), "drum.speed=10.6..10.65"
    status, out, err = drumsqueal("cycle", scene, "--along", along, "-o", str(tmp_path))
    assert (status, err) == (0, "")
    data = json.loads((tmp_path / "branch.json").read_text())
    assert to_json(read_findings(tmp_path / "branch.json", CycleBranches)) == (tmp_path / "branch.json").read_text()
    (critical,) = data["critical_values"]
    (branch,) = data["branches"]
    assert critical["value"] == pytest.approx(10.612287, abs=1e-5)
    assert branch["start"] == BranchEnd.HOPF
    folds = [each for each in branch["special"] if each["what"] == Event.FOLD]
    assert folds[0]["value"] == pytest.approx(10.618092, abs=1e-5)
    rows = (tmp_path / "branch.csv").read_text().splitlines()
    assert len(rows) == 1 + len(branch["cycles"])
    place = rows[0].split(",").index("stable")
    told = ["neutral" if each["neutral"] else "yes" if each["stable"] else "no" for each in branch["cycles"]]
    assert [row.split(",")[place] for row in rows[1:]] == told
    assert "fold" in out
    assert (tmp_path / "branch.png").stat().st_size > 10_000


def test_a_search_without_a_cycle_ends_with_its_reason(drumsqueal, tmp_path, monkeypatch):
    monkeypatch.setattr(study, "find_cycle", partial(_raised, CycleError("no cycle")))
    status, _, err = drumsqueal(
        "cycle", str(SCENARIOS / "damped.toml"), *OPTIONS, "--set", "simulate.duration=0.05", "-o", str(tmp_path)
    )
    assert status == 1
    assert err.startswith("drumsqueal: no cycle")
    assert not (tmp_path / "cycle.json").exists()


def _raised(error, *_, **__):
    raise error


assert jnp  # the module switches to float64 on import
