"""Linear against nonlinear onset: critical values in closed form, modes through crossings, bistable ranges."""

import csv
import dataclasses
import json
import math
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.special
from matplotlib.backends.backend_agg import FigureCanvasAgg
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from along_y import OPTIONS, AlongY, brake_along_y
from drumsqueal.dynamics import ensemble, saturated
from drumsqueal.dynamics.attractor import Response
from drumsqueal.dynamics.cycles.branches import DiagramBuilder
from drumsqueal.dynamics.cycles.cycle import (
    BranchEnd,
    Cycle,
    CycleBranch,
    Diagram,
    Event,
    OffBranch,
    RangeKind,
    Unfollowed,
    Why,
    steady_sliding,
)
from drumsqueal.dynamics.ensemble import Family, IntegratorOptions, Start, directions, find_attractors, go_on
from drumsqueal.dynamics.saturated import Saturated, saturated_motions
from drumsqueal.errors import COMPLETE, RequestError, SteadyStateError
from drumsqueal.files.output_folder import to_json
from drumsqueal.findings.decay import Rest
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.findings.schema import Parameter, read_findings
from drumsqueal.physics.effects.damping import Damping
from drumsqueal.physics.friction_law import ConstantLaw, ExponentialLaw, StepLaw
from drumsqueal.physics.model import Model, at_lining, build_model
from drumsqueal.physics.small_bodies import block_on_belt, sprung_block_on_belt
from drumsqueal.questions.cycle.study import CycleBranches, ParameterRange, diagram_verdict
from drumsqueal.questions.onset import study as study_module
from drumsqueal.questions.onset.answer import draw_onset
from drumsqueal.questions.onset.found import (
    OnsetStudy,
    Range,
    Row,
    find_ranges,
    motion_words,
    shown_line,
    verdict,
    warnings,
    with_uncertainty,
)
from drumsqueal.questions.onset.study import LinearOnset, compare, predict, study_onset
from drumsqueal.scene import SceneError, load_scene
from drumsqueal.scene.variation import Variation, read_variation
from drumsqueal.solve.linear.branches import follow_modes, point_at
from drumsqueal.solve.linear.modes import analyse_stability
from odd_friction import odd_friction

DAMPED = Path(__file__).parents[2] / "scenarios" / "damped.toml"
HOPF = 0.5 * math.log(10)  # of the block below


def falling_friction(belt_speed: float):
    """x″ + 0.1 x′ + x = μ sgn(v_d − x′), μ = 0.5 + 0.5 exp(−2|v|): Hopf at v_d = v0 ln(Δμ/(2 ξ v0)) = 1.1512925."""
    return block_on_belt(ExponentialLaw(1.0, 0.5, 2.0), damping=0.1, belt_speed=belt_speed)


def constant(friction: float) -> Any:
    """Constant friction by the law of the block above, which does not fall then: they have one program."""
    return ExponentialLaw(friction, friction, 1.0)


def predicted(nominal, values, round_seconds: float = 120.0) -> LinearOnset:
    """The block's onset as a study has it; its scene is only carried along."""
    family = Family(falling_friction, ("X",), ("X",))
    linear = follow_modes(falling_friction, values)
    variation = Variation("drum.speed", "m/s", tuple(values))
    return LinearOnset(
        nominal, variation, family, falling_friction, linear, IntegratorOptions(10.0, 1e-6, round_seconds)
    )


@pytest.fixture(scope="module")
def quick(nominal):
    """A brake that moves along Y alone."""
    values = {"simulate.coordinates": ["Y"], "start.displacement": {"Y": 1e-7}, "damping": {"ratio": 0.005}}
    return nominal.with_values(values)


# --- critical values -------------------------------------------------------------------------------------------------


def test_the_hopf_point_of_falling_friction():
    found = follow_modes(falling_friction, np.linspace(0.8, 1.5, 4))
    (critical,) = found.critical
    # Round-off of the eigenvalue over its slope of 0.1 is some 1e-15; found 2e-13.
    assert critical.value == pytest.approx(HOPF, rel=1e-11)
    assert abs(critical.value - HOPF) <= critical.uncertainty
    assert critical.frequency_Hz == pytest.approx(1 / math.tau, rel=1e-9)
    assert (critical.label, critical.destabilises) == ("X", False)
    assert [point.unstable for point in found.points] == [True, True, False, False]


def test_the_critical_speed_of_a_brake_that_moves_along_x_alone(nominal):
    # Equation (29) with X alone: m ẍ + (2ζωm − μt p0 ∫sin²θ dA) ẋ + (k1 + k2 + k_c ∫cos²θ dA) x = 0, since
    # ∫sinθ cosθ dA = 0, with μt = α (μs − μk) exp(−αRΩ). Damping vanishes at one Ω.
    ratio = 1e-3
    scene = nominal.with_values(
        {"damping": {"ratio": ratio}, "simulate.coordinates": ["X"], "start.displacement": {"X": 1e-7}}
    )
    shoe, contact, friction = scene.shoe, scene.contact, scene.friction
    half, area = shoe.arc_angle / 2, shoe.outer_radius * shoe.width
    cos2, sin2 = area * (half + math.sin(2 * half) / 2), area * (half - math.sin(2 * half) / 2)
    inner = shoe.outer_radius - shoe.thickness
    mass = shoe.density * shoe.width * shoe.arc_angle * (shoe.outer_radius**2 - inner**2) / 2
    springs = scene.support.upper_stiffness + scene.support.lower_stiffness
    omega = math.sqrt((springs + contact.stiffness * cos2) / mass)
    p0 = contact.normal_load / (area * shoe.arc_angle)
    drive = friction.decay * (friction.static - friction.kinetic) * p0 * sin2 / (2 * ratio * omega * mass)
    wanted = math.log(drive) / (friction.decay * shoe.outer_radius)
    assert 1 < wanted < 20

    def model_at(speed):
        return build_model(scene, {"drum.speed": speed})

    (critical,) = follow_modes(model_at, np.linspace(1, 20, 5)).critical
    # Found: 4e-12. The eigenvalue of 3e4 1/s has a round-off of 1e-11 1/s, its real part a slope of 2 1/s per rad/s.
    assert critical.value == pytest.approx(wanted, rel=1e-10)
    assert critical.frequency_Hz == pytest.approx(omega / math.tau, rel=1e-9)
    assert not critical.destabilises


def sprung(springs) -> Model:
    return sprung_block_on_belt(ConstantLaw(0.0), mass=np.ones(2), springs=springs, contact_stiffness=0.0)


@pytest.mark.thorough
@pytest.mark.parametrize("coupling", [0.0, 1e-3])
def test_modes_are_followed_through_a_crossing_and_a_veering(coupling):
    # x at 1 rad/s and y at √k cross at k = 1; coupled, they exchange their shapes there and their frequencies keep
    # their order: λ² = −(1 + k)/2 ± √((1 − k)²/4 + c²).
    found = follow_modes(lambda k: sprung(np.array([[1.0, coupling], [coupling, k]])), np.linspace(0.7, 1.4, 8))
    assert not found.critical
    assert len(found.branches) == 2
    first, second = found.branches
    k = first.values
    if coupling == 0:
        assert (first.label, second.label) == ("Y", "X")
        np.testing.assert_allclose(first.eigenvalues.imag, np.sqrt(k), rtol=1e-12)
        np.testing.assert_allclose(second.eigenvalues.imag, 1.0, rtol=1e-12)
    else:
        assert len(k) > 8  # refined about the veering
        root = np.sqrt((1 - k) ** 2 / 4 + coupling**2)
        np.testing.assert_allclose(first.eigenvalues.imag, np.sqrt((1 + k) / 2 - root), rtol=1e-10)
        np.testing.assert_allclose(second.eigenvalues.imag, np.sqrt((1 + k) / 2 + root), rtol=1e-10)


def test_two_modes_merge():
    # Hoffmann et al., Journal of Sound and Vibration 257 (2002) 1: flutter above μ = 0.75, at √2 rad/s.
    def follower(friction):
        springs = np.array([[2.0, 1.0], [1.0, 2.0 - 4 / 3]])
        return sprung_block_on_belt(ConstantLaw(friction), mass=np.ones(2), springs=springs, contact_stiffness=4 / 3)

    found = follow_modes(follower, np.linspace(0.3, 1.2, 10))
    (critical,) = found.critical
    # Undamped, growth is told from round-off where it exceeds 1e-12 of the frequency; it rises like a root.
    assert critical.value == pytest.approx(0.75, rel=1e-9)
    assert abs(critical.value - 0.75) <= critical.uncertainty
    assert critical.destabilises
    # The frequencies part like a root, too: by 1e-5 where μ is off by 2e-10. Found: 2e-6.
    assert critical.frequency_Hz == pytest.approx(math.sqrt(2) / math.tau, rel=1e-5)


def test_a_short_instability_between_two_values_is_found():
    # Damping 0.2 ((p − 0.52)² − 1e-4): negative for |p − 0.52| < 0.01, between the values 0.5 and 0.75.
    def model_at(p):
        return block_on_belt(ConstantLaw(0.0), damping=0.2 * ((p - 0.52) ** 2 - 1e-4), belt_speed=1.0)

    found = follow_modes(model_at, np.linspace(0, 1, 5))
    assert [each.value for each in found.critical] == pytest.approx([0.51, 0.53], rel=1e-9)
    assert [each.destabilises for each in found.critical] == [True, False]


def test_between_two_critical_values_there_is_a_point():
    # x grows below p = 0.51, y above 0.53, and both changes lie between the values 0.5 and 0.75.
    def model_at(p):
        block = sprung(np.array([[1.0, 0.0], [0.0, 2.0]]))
        dashpots = jnp.diag(0.2 * jnp.array([p - 0.51, 0.53 - p]))
        return dataclasses.replace(block, others=(*block.others, Damping(dashpots)))

    found = follow_modes(model_at, np.linspace(0, 1, 5))
    assert [each.value for each in found.critical] == pytest.approx([0.51, 0.53], rel=1e-9)
    between = [point for point in found.points if 0.51 < point.value < 0.53]
    assert between
    assert not any(point.unstable for point in between)
    ((low, high),) = steady_sliding(found, 0.0, 1.0, stable=True)
    assert (low, high) == pytest.approx((0.51, 0.53), rel=1e-9)


def test_a_static_instability_is_a_divergence():
    # A spring that turns negative at p = 0.3: λ² + 0.2 λ + 0.3 − p = 0.
    def model_at(p):
        return block_on_belt(ConstantLaw(0.0), damping=0.2, stiffness=0.3 - p, belt_speed=1.0)

    found = follow_modes(model_at, np.linspace(0, 1, 6))
    (critical,) = found.critical
    # A real eigenvalue counts from 1e-7 of the largest on; it is (p − 0.3)/0.2 there.
    assert critical.value == pytest.approx(0.3, abs=1e-7)
    assert (critical.label, critical.frequency_Hz, critical.destabilises) == ("divergence", 0.0, True)


def test_a_value_without_steady_sliding_is_named(quick):
    found = follow_modes(lambda speed: build_model(quick, {"drum.speed": speed}), [-2.0, 0.0, 2.0])
    assert [bool(point.reason) for point in found.points] == [False, True, False]
    assert not found.points[1].unstable
    # The mode is one on both sides of the standstill, and is none there.
    (branch,) = found.branches
    assert list(np.isnan(branch.eigenvalues)) == [False, True, False]
    assert branch.eigenvalues[0] == pytest.approx(branch.eigenvalues[2], rel=1e-12)


def test_modes_that_leave_neutral_motion_at_once_are_distinguished():
    # Undamped at p = 0.3, where the range begins; beyond it x grows, and y at 0.6 times its rate.
    def model_at(p):
        block = sprung(np.array([[1.0, 0.0], [0.0, 2.0]]))
        dashpots = jnp.diag((0.3 - p) * jnp.array([1.0, 0.6]))
        return dataclasses.replace(block, others=(*block.others, Damping(dashpots)))

    found = follow_modes(model_at, np.linspace(0.3, 0.6, 4)).critical
    assert {each.label for each in found} == {"X", "Y"}
    assert len(found) == 2
    # Growth is told from round-off from 1e-12 of the frequency on, which is up to 1e-11 beyond.
    assert all(abs(each.value - 0.3) <= each.uncertainty < 1e-10 for each in found)


# --- where transients lead -------------------------------------------------------------------------------------------


def test_saturated_motions_of_linear_oscillators():
    # Without friction and damping: x = a cos(ωt) for ever; with damping it decays at ζ = c/2.
    models = [block_on_belt(constant(0.0), stiffness=k, damping=c, belt_speed=9.0) for k, c in ((4, 0), (9, 0.01))]
    start = np.array([[0.3], [0.2]])
    seen = []
    steady, free = saturated_motions(
        models,
        np.zeros((2, 1)),
        start,
        np.zeros((2, 1)),
        IntegratorOptions(10.0, 1e-9, 100.0),
        progress=lambda *told: seen.append(told),
    )
    assert seen == [("transients", 50.0, 100.0), ("transients", 100.0, 100.0)]
    assert (steady.trend, steady.outcome) == ("settled", COMPLETE)
    # Sampled every 0.2 rad: the largest sample may miss the crest by 0.5 %.
    assert steady.amplitude == pytest.approx([0.3], rel=6e-3)
    assert steady.rms == pytest.approx([0.3 / math.sqrt(2)], rel=5e-3)
    assert steady.boundary_ratios == (0.0, pytest.approx(0.6 / 9, rel=6e-3))
    assert steady.frequency_Hz == pytest.approx(2 / math.tau, rel=1e-4)
    assert (steady.line, free.line) == ("X", "X")
    assert steady.vibration == pytest.approx([0.3 * math.cos(200.0)], abs=1e-6)
    assert steady.velocity == pytest.approx([-0.6 * math.sin(200.0)], abs=1e-6)
    # Half the logarithm of the energies, of which 50 s hold no whole number of periods.
    assert free.rate == pytest.approx(-0.005, rel=0.02)
    assert free.trend == "decays"


def test_what_fails_or_grows_without_bound_has_no_numbers_and_says_why(monkeypatch):
    time = np.arange(101) / 10
    fine = 0.1 * np.cos(2 * time)[:, None]
    vibration = np.array([fine, fine, np.where(time[:, None] > 9, 1e71, fine)])

    def stream(models, *_, **__):
        for some in (slice(0, 51), slice(51, 101)):
            sticks = np.zeros((3, time[some].size), dtype=bool)
            reached = np.array([True, some.start == 0, True])
            moved = vibration[:, some]
            yield SimpleNamespace(time=time[some], vibration=moved, velocity=-2 * moved, sticks=sticks, reached=reached)

    monkeypatch.setattr(saturated, "integrate_many", stream)
    model = block_on_belt(ConstantLaw(0.0), stiffness=4, belt_speed=9.0)
    none = np.zeros((3, 1))
    how = IntegratorOptions(10.0, 1e-6, 10.0)
    good, failed, endless = saturated_motions([model] * 3, none, none, none, how)
    assert (good.outcome, good.failed, good.trend) == (COMPLETE, False, "settled")
    assert good.seconds == pytest.approx(5.0)  # the last half of 10 s, both ends included
    assert (failed.outcome, failed.trend) == ("failed: the integration stopped between t = 5.1 s and 10 s", "failed")
    assert endless.outcome == "failed: the motion grows without bound"
    for each in (failed, endless):
        assert np.isnan([*each.amplitude, *each.rms, each.kinetic_energy, each.rate]).all()
        assert (each.frequency_Hz, each.line, each.seconds) == (None, None, 0.0)


@pytest.mark.parametrize(("threads", "cores", "together"), [(2, 8, 32), (None, 3, 48), (None, 1, 16)])
def test_sixteen_transients_a_thread_run_at_once(monkeypatch, threads, cores, together):
    monkeypatch.setattr(saturated, "cores", lambda: cores)
    assert saturated.at_once(threads) == together


def test_more_transients_than_run_at_once_come_in_order_also_those_that_stick():
    # Beyond slip reversal the block sticks; with one thread 16 of them run together.
    speeds = np.linspace(1.0, 1.1, 18)
    models = [falling_friction(speed) for speed in speeds]
    steady = np.array([[0.5 + 0.5 * math.exp(-2 * speed)] for speed in speeds])
    start = np.full((18, 1), 1e-3)
    start[5] = start[17] = 1.5
    how = IntegratorOptions(10.0, 1e-6, 60.0, threads=1)
    found = list(saturated_motions(models, steady, start, np.zeros((18, 1)), how))
    assert [each.failed for each in found] == [False] * 18
    large = np.array([each.amplitude[0] for each in found])
    assert (large[[5, 17]] > 1.0).all()
    assert (np.delete(large, [5, 17]) < 0.1).all()
    assert 1 < found[5].boundary_ratios[1] < 1.3  # it moves with the belt one way, and faster the other
    # The slower the belt, the faster the growth.
    rates = [each.rate for k, each in enumerate(found) if k not in (5, 17)]
    assert rates == sorted(rates, reverse=True)


# The block's linear rate is −0.0128 1/s at 1.3 m/s and 0.0177 1/s at 1 m/s; a round lasts 120 s, of which 60 are seen.
@pytest.mark.parametrize(
    ("speed", "fraction", "rate", "energies", "kind", "rounds"),
    [
        (1.3, 0.05, -1e-9, [1.0], Kind.DECAYS, 1),  # small, and it falls
        (1.3, 0.5, -0.0075, [1.0, 0.2], Kind.DECAYS, 2),  # below them, faster than half the linear rate, twice
        (1.3, 0.5, -0.003, 0.49 ** np.arange(60), Kind.UNDECIDED, 60),  # slower than that, and not still
        (1.3, 0.5, 0.0, np.ones(60), Kind.SQUEALS, 3),  # below the contact boundaries, and still
        (1.3, 1.5, 0.0, np.ones(60), Kind.SQUEALS, 3),
        (1.3, 1.5, 0.02, np.tile([1.0, 3.0], 30), Kind.SQUEALS, 20),  # comes and goes, and stays as it was
        (1.3, 1.5, -0.02, 0.95 ** np.arange(60), Kind.UNDECIDED, 60),  # comes and goes, and falls
        (1.3, 1.5, 0.0, 0.9999 ** np.arange(60), Kind.UNDECIDED, 60),  # loses energy in each period, however little
        (1.3, 1.5, 0.0, 0.999999 ** np.arange(60), Kind.SQUEALS, 3),  # by less than the integrator may take
        (1.0, 0.2, 0.0177, np.exp(4.25 * np.arange(60)), Kind.GROWS, 60),
        (1.3, 0.0, 0.0, [0.0], Kind.DECAYS, 1),
    ],
)
def test_where_a_transient_leads_is_judged_round_by_round(monkeypatch, speed, fraction, rate, energies, kind, rounds):
    left = iter(energies)

    def motions(models, *args, **how):
        one = np.ones(1)
        for _ in models:
            yield Saturated(one, one, (0.0, fraction), 1.0, "X", next(left), rate, 60.0, one, one, COMPLETE)

    monkeypatch.setattr(ensemble, "saturated_motions", motions)
    start = Start("disturbance", np.ones(1), np.zeros(1))
    family = Family(falling_friction, ("X",), ("X",))
    (found,) = find_attractors(
        family, [(point_at(falling_friction, speed), start)], IntegratorOptions(10.0, 1e-6, 120.0)
    )
    assert (found.leads_to, found.simulated_s / 120.0) == (kind, rounds)


ELSEWHERE = Rest(near=False, elsewhere=np.ones(1))


@pytest.mark.parametrize(
    ("speed", "fraction", "rest", "kind", "rounds"),
    [
        (1.3, 0.05, ELSEWHERE, Kind.RESTS, 1),
        (1.0, 0.05, ELSEWHERE, Kind.RESTS, 1),  # where steady sliding is unstable
        (1.3, 0.0, Rest(near=False), Kind.UNDECIDED, 60),  # nothing moves, where nothing stays
        (1.3, 0.05, Rest(near=False), Kind.UNDECIDED, 60),  # small beside the belt, but not led by the linear model
        (1.0, 0.05, Rest(near=True), Kind.GROWS, 1),
        (1.0, 0.05, Rest(near=False), Kind.UNDECIDED, 60),
    ],
)
def test_only_what_is_near_steady_sliding_decays_to_it_or_grows_from_it(
    monkeypatch, speed, fraction, rest, kind, rounds
):
    left = iter(0.9 ** np.arange(60))

    def motions(models, *args, **how):
        one = np.ones(1)
        for _ in models:
            numbers = one, one, (0.0, fraction), 1.0, "X", next(left), -0.003, 60.0, one, one, COMPLETE
            yield Saturated(*numbers, at_rest=fraction == 0, rest=rest)

    monkeypatch.setattr(ensemble, "saturated_motions", motions)
    family = Family(falling_friction, ("X",), ("X",))
    start = Start("disturbance", np.ones(1), np.zeros(1))
    (found,) = find_attractors(
        family, [(point_at(falling_friction, speed), start)], IntegratorOptions(10.0, 1e-6, 120.0)
    )
    assert (found.leads_to, found.simulated_s / 120.0) == (kind, rounds)
    assert found.rests_at == ({"X": 1.0} if kind is Kind.RESTS else {})


@pytest.mark.thorough(but=["3.0-0.001", "0.95-1e-06"])
@pytest.mark.parametrize("damping", [1e-3, 1e-4, 1e-6])
@pytest.mark.parametrize("speed", [0.95, 3.0])
def test_what_decays_from_slip_reversal_on_is_no_squeal_however_weakly_it_is_damped(damping, speed):
    # Constant friction feeds nothing: beyond slip reversal it takes energy, and within, damping alone does.
    def model_at(belt_speed: float):
        return block_on_belt(constant(0.3), damping=damping, belt_speed=belt_speed)

    start = Start("disturbance", np.zeros(1), np.array([speed]))
    family = Family(model_at, ("X",), ("X",))
    (found,) = find_attractors(family, [(point_at(model_at, 1.0), start)], IntegratorOptions(10.0, 1e-6, 200 * math.pi))
    assert found.leads_to == Kind.DECAYS
    assert found.simulated_s <= 12 * 200 * math.pi  # measured against the linear rate, not waited for


@pytest.mark.thorough(but=["0.75"])
@pytest.mark.parametrize("speed", [0.75, 3.0, -1.5])
def test_what_falls_onto_a_cycle_below_slip_reversal_squeals(speed):
    # Averaged, −2e-4 + ¾ 2.211e-3 a² − ⅝ 4.08e-3 a⁴ = 0: cycles of 0.400 (unstable) and 0.700 (stable) m.
    model = block_on_belt(odd_friction(0.4, 2e-4, -2.211e-3, 4.08e-3), belt_speed=1.0)
    family = Family(lambda _: model, ("X",), ("X",))
    start = Start("disturbance", np.zeros(1), np.array([speed]))
    point = point_at(lambda _: model, 1.0)
    (found,) = find_attractors(family, [(point, start)], IntegratorOptions(10.0, 1e-6, 200 * math.pi))
    assert found.leads_to == Kind.SQUEALS
    assert found.motion is not None
    assert found.motion.amplitude["X"] == pytest.approx(0.7, rel=0.02)


# By friction that falls by Δμ to the kinetic one a motion as fast as the belt, sin t m/s, gains π Δμ 2 I₁(2)/e² in a
# period, and damping takes π c: stick-slip lasts to c = 2 I₁(2)/e² Δμ = 0.43055 Δμ, Hopf at c = 2/e² Δμ = 0.271 Δμ.
@pytest.mark.thorough(but=["0.9-squeals", "0.999-squeals", "1.02-decays"])
@pytest.mark.parametrize(
    ("over_fold", "kind"), [(0.9, Kind.SQUEALS), (0.999, Kind.SQUEALS), (1.002, Kind.DECAYS), (1.02, Kind.DECAYS)]
)
def test_a_faint_limit_cycle_is_told_from_a_faint_decay_at_its_fold(over_fold, kind):
    fall = 1e-3
    damping = over_fold * 2 * scipy.special.i1(2.0) / math.e**2 * fall

    def model_at(belt_speed: float):
        return block_on_belt(ExponentialLaw(0.3 + fall, 0.3, 2.0), damping=damping, belt_speed=belt_speed)

    start = Start("disturbance", np.zeros(1), np.array([3.0]))
    family = Family(model_at, ("X",), ("X",))
    (found,) = find_attractors(family, [(point_at(model_at, 1.0), start)], IntegratorOptions(10.0, 1e-6, 200 * math.pi))
    assert found.leads_to == kind


@pytest.mark.parametrize(("over", "kinds"), [(0.995, {Kind.DECAYS, Kind.UNDECIDED}), (1.005, {Kind.UNDECIDED})])
def test_what_creeps_away_from_an_unstable_cycle_has_not_settled(over, kinds):
    # Next to its Hopf point, at 1.152 m/s, the block has an unstable cycle that passes steady sliding at 0.05320 m/s by
    # a return map: from it starts depart by 2e-3 of their distance in a period at most.
    start = Start("disturbance", np.zeros(1), np.array([over * 0.05320]))
    family = Family(falling_friction, ("X",), ("X",))
    point = point_at(falling_friction, 1.152)
    for rounds in (3, 10):
        (found,) = find_attractors(family, [(point, start)], IntegratorOptions(10.0, 1e-6, 40 * math.pi), rounds=rounds)
        assert found.leads_to in kinds


def supercritical(belt_speed: float):
    """x″ + x − 0.4 x′³ + 0.9 x′⁵ = 1 on a belt of 1 m/s: averaged, a cycle of A² = 0.3/(0.9·5/8), A = 0.73 m."""
    return block_on_belt(odd_friction(1.0, 0.0, -0.4, 0.9), belt_speed=belt_speed)


def free(belt_speed: float):
    """A block that nothing feeds or brakes, at 1 rad/s."""
    return block_on_belt(constant(0.0), belt_speed=belt_speed)


def undamped(belt_speed: float):
    """A block whose friction is 0.5 while it slips, and up to 1 while it sticks."""
    return block_on_belt(StepLaw(1.0, 0.5), belt_speed=belt_speed)


def rubbing(belt_speed: float):
    """The same without more friction while it sticks: beyond slip reversal that only takes energy."""
    return block_on_belt(constant(0.5), belt_speed=belt_speed)


@pytest.mark.parametrize(
    ("model_at", "speed", "size", "kind"),
    [
        (free, 1.0, 1e-14, Kind.DECAYS),  # below a picometre: round-off
        (free, 1.0, 0.5, Kind.NEUTRAL),
        (free, 1.0, 3.0, Kind.NEUTRAL),  # beyond slip reversal; made smaller, it stays so
        (falling_friction, HOPF, 3.0, Kind.SQUEALS),  # made smaller, it comes back to stick and slip
        (undamped, 1.0, 0.98, Kind.NEUTRAL),  # slides for ever
        (undamped, 1.0, 1.02, Kind.SQUEALS),  # sticks; made smaller, that may slide for ever
        (undamped, 0.2, 3.0, Kind.SQUEALS),
        (rubbing, 1.0, 3.0, Kind.NEUTRAL),  # falls until it just does not stick any more
        (supercritical, 1.0, 0.2, Kind.SQUEALS),  # within slip reversal, and comes back
    ],
)
def test_where_no_mode_grows_or_decays_motion_is_neutral_unless_it_comes_back(model_at, speed, size, kind):
    family = Family(model_at, ("X",), ("X",))
    start = Start("disturbance", np.array([size]), np.zeros(1))
    (found,) = find_attractors(family, [(point_at(model_at, speed), start)], IntegratorOptions(10.0, 1e-6, 60.0))
    assert found.leads_to == kind
    assert found.lasts == (found.motion is not None) == (kind == Kind.SQUEALS)
    assert found.saturated.at_rest == (found.saturated.frequency_Hz is None) == (kind == Kind.DECAYS)
    if model_at is undamped and kind is Kind.SQUEALS:
        # Friction gives way at 0.5 m from steady sliding, and the block slips off as fast as the belt: 29 s in the
        # crests of which a sample may miss 0.1 %.
        assert found.motion is not None
        assert found.motion.amplitude["X"] == pytest.approx(math.hypot(0.5, speed), rel=2e-3)


@pytest.mark.thorough
def test_a_shoe_that_nothing_holds_runs_away_and_does_not_squeal():
    # Without supports it turns about the drum's axis, by e^(7.7 t) at 40 rad/s, while every mode decays; neither
    # contact boundary is any nearer for that.
    scene = load_scene(DAMPED, ["support=none", "drum.speed=40"])
    predicted = predict(scene, Variation("drum.speed", "rad/s", (40.0, 45.0)))
    point = predicted.linear.points[0]
    assert point.divergence == pytest.approx(7.73, rel=1e-2)
    assert all(mode.growth_rate < 0 for mode in point.modes)
    start = predicted.family.small_start(point, predicted.family.model_at(40.0))
    (found,) = find_attractors(predicted.family, [(point, start)], predicted.how)
    assert found.leads_to == Kind.RUNS_AWAY
    assert not found.lasts
    assert max(found.saturated.boundary_ratios) < 0.1
    # Seldom does a large disturbance make one run away where small motion decays: such a value is not called stable.
    calm = point._replace(eigenvalues=np.array([mode.eigenvalue for mode in point.modes]))
    row = Row.at(calm, found.model_copy(update={"start": "disturbance"}), asked=True)
    assert row.kind == "undecided"
    (told,) = (line for line in warnings(study_of(scene, row)) if "ran away" in line)
    assert told == "A transient ran away, with the shoe turned by more than 0.1 rad, at 40 rad/s; see the table."


def study_of(scene, row: Row) -> OnsetStudy:
    variation = Variation("drum.speed", "rad/s", (row.value, row.value + 1))
    return bare_study(scene, variation, values=(row,), ranges=find_ranges([row], (), 0.0))


def bare_study(scene, variation: Variation, **found) -> OnsetStudy:
    return OnsetStudy(
        scene=scene,
        parameter=Parameter.of(variation),
        critical_values=(),
        bistable_range_sought_within=0.1,
        modes=(),
        coordinates=("X", "Y", "Tz"),
        **found,
    )


@pytest.mark.thorough
def test_a_range_of_neutral_motion_is_no_squeal(nominal):
    linear = follow_modes(free, [1.0, 2.0])
    family, how = Family(free, ("X",), ("X",)), IntegratorOptions(10.0, 1e-6, 60.0)
    variation = Variation("drum.speed", "m/s", (1.0, 2.0))
    study = compare(LinearOnset(nominal, variation, family, free, linear, how), 0.5)
    assert [each.kind for each in study.ranges] == ["neutral"]
    assert "predict no squeal; motion neither grows nor decays: its amplitude is that" in verdict(study)


@pytest.mark.thorough
def test_where_sliding_is_neutral_a_large_disturbance_may_lead_to_squeal(nominal):
    # Undamped: what stays below the belt's speed slides for ever, all else sticks and slips.
    linear = follow_modes(undamped, [1.0, 2.0])
    family, how = Family(undamped, ("X",), ("X",)), IntegratorOptions(10.0, 1e-6, 60.0)
    variation = Variation("drum.speed", "m/s", (1.0, 2.0))
    study = compare(LinearOnset(nominal, variation, family, undamped, linear, how), 0.5, smallest_disturbance=True)
    assert [each.kind for each in study.ranges] == ["bistable"]
    assert (
        "bistable all along: steady sliding is neutral there (small motion neither grows nor decays), but"
        in verdict(study)
    )
    for row in study.values:
        assert row.small is not None
        assert row.smallest_disturbance is not None
        assert row.small.leads_to == Kind.NEUTRAL
        assert (
            abs(row.smallest_disturbance.speed_m_per_s - row.value) < row.smallest_disturbance.speed_uncertainty_m_per_s
        )
    # The branches of cycles say the same of small motion.
    none = Diagram(steady_sliding_stable=((1.0, 2.0),), steady_sliding_unstable=(), branches=(), linear=linear)
    along = none.model_copy(update={"branches": (made_up_cycles([1.0, 1.5, 2.0]),)})
    assert diagram_verdict(along, variation).startswith("Steady sliding is neutral throughout")


def grazing_speed() -> float:
    """The belt speed above which the block that has stuck does not stick again: SciPy, from one release to the crest.

    While it sticks x′ = v_d, until spring and damper need all of the static friction, x = 1 − 0.1 v_d; then it slips,
    and sticks again if x′ comes back to v_d.
    """

    def crest(belt):
        def slip(_, y):
            return [y[1], -y[0] - 0.1 * y[1] + 0.5 + 0.5 * math.exp(-2 * (belt - y[1]))]

        def turns(_, y):
            return slip(0, y)[1]

        turns.direction = -1  # x′ is largest
        turns.terminal = True
        start = [1 - 0.1 * belt, belt - 1e-9]
        first = solve_ivp(slip, (0, 1.0), start, rtol=1e-11, atol=1e-12).y[:, -1]
        return solve_ivp(slip, (0, 20), first, events=turns, rtol=1e-11, atol=1e-12).y[1, -1] - belt

    return float(brentq(crest, 1.16, 2.0, xtol=1e-8))  # pyright: ignore[reportArgumentType]


@pytest.mark.thorough(but=["0.01"])
@pytest.mark.parametrize("speed", [1e-3, 1e-2])
def test_stick_slip_whose_period_is_longer_than_a_round_is_waited_for(speed):
    # The spring needs 0.5 m more to overcome static friction: 48 s at 0.01 m/s, and 480 s. Half a period of slip with
    # damping ratio 0.025 leaves e^(−0.025 π) of it on the other side.
    def model_at(belt_speed: float):
        return block_on_belt(StepLaw(1.0, 0.5), damping=0.05, belt_speed=belt_speed)

    start = Start("disturbance", np.zeros(1), np.array([2 * speed]))
    family = Family(model_at, ("X",), ("X",))
    (found,) = find_attractors(family, [(point_at(model_at, speed), start)], IntegratorOptions(10.0, 1e-6, 60.0))
    assert found.leads_to == Kind.SQUEALS
    assert found.motion is not None
    assert found.motion.frequency_Hz is not None
    # The belt moves on by its speed times the damping over the stiffness until it gives way: less than 1e-3 of it.
    assert found.motion.amplitude["X"] == pytest.approx(0.25 * (1 + math.exp(-0.025 * math.pi)), rel=2e-3)
    assert found.motion.frequency_Hz * found.motion.amplitude["X"] * 2 / speed == pytest.approx(1, rel=0.08)


@pytest.mark.thorough
def test_the_bistable_range_of_the_block_ends_where_scipy_says(nominal, monkeypatch):
    # Subcritical: above the Hopf point squeal by stick and slip goes on once started, until it no longer sticks.
    end = grazing_speed()
    assert HOPF + 0.02 < end < 2
    # Ten periods a round, and four rounds: the block is on its cycle from the first sticking on.
    monkeypatch.setattr(study_module, "Criteria", type("Shorter", (Criteria,), {"lasting": 4}))
    shorter = predicted(nominal, [1.1, 1.3, 2.0], round_seconds=60.0)
    study = compare(shorter, 0.02)
    kinds = [each.kind for each in study.ranges]
    assert kinds == [RangeKind.SQUEALS, RangeKind.BISTABLE, RangeKind.STABLE]
    squeals, bistable, stable = study.ranges
    assert squeals.last == bistable.first == pytest.approx(HOPF, rel=1e-10)
    assert bistable.last == stable.first
    assert bistable.last_uncertainty is not None
    # Halfway between two rows that are no farther apart than was asked for, which is what it is known to.
    assert bistable.last_uncertainty == pytest.approx(0.02 * 0.9)
    assert abs(bistable.last - end) <= 0.01 * 0.9
    told = verdict(study)
    assert "predict squeal below 1.151 m/s (X, 0.159 Hz)" in told
    assert "bistable from 1.151 to" in told
    assert "steady sliding is stable there, but a large disturbance leads to squeal" in told


# --- the search, on made-up endings ----------------------------------------------------------------------------------


def ending(value: float, start: str, kind: Kind, size: float = 1.0) -> Response:
    one = np.array([size])
    motion = Saturated(one, one, (0.0, 1.5), 1.0, "X", size**2, 0.0, 1.0, one, one, COMPLETE)
    return Response.of(value, start, kind, motion, 1.0, ("X",))


def made_up(found, fold: float, reach: float):
    """Responses: motion lasts below `fold` if it comes from no farther than `reach`; large disturbances do nothing."""

    def find(family, tasks, how, *, rounds, known=None, progress=None):
        for point, start in tasks:
            found.append((point.value, start.name))
            near = "from" in start.name and abs(point.value - float(start.name.split()[-1])) < reach
            lasts = point.value < fold and (point.unstable or near)
            yield ending(point.value, start.name, Kind.SQUEALS if lasts else Kind.DECAYS)

    return find


def test_a_fold_is_found_by_going_on_from_neighbours(nominal, monkeypatch):
    found: list = []
    monkeypatch.setattr(study_module, "find_attractors", made_up(found, fold=1.6789, reach=0.12))
    rows_seen: list = []
    study = compare(
        predicted(nominal, np.linspace(1, 2, 11)), 1e-3, keep=lambda so_far: rows_seen.append(len(so_far.values))
    )
    assert [each.kind for each in study.ranges] == [RangeKind.SQUEALS, RangeKind.BISTABLE, RangeKind.STABLE]
    bistable = study.ranges[1]
    assert bistable.first == pytest.approx(HOPF, rel=1e-10)
    assert bistable.last_uncertainty == pytest.approx(1e-3, rel=1e-9)  # as fine as it is asked for
    assert abs(bistable.last - 1.6789) <= 5e-4 * (1 + 1e-9)  # halfway between two that are no further apart
    assert rows_seen == sorted(rows_seen)
    assert [row.value for row in study.values if row.asked] == pytest.approx(np.linspace(1, 2, 11))
    assert warnings(study)[-1].startswith("Disturbances that were not tried")


def test_a_bistable_range_narrower_than_the_steps_is_found_next_to_the_critical_value(nominal, monkeypatch):
    monkeypatch.setattr(study_module, "find_attractors", made_up([], fold=1.17, reach=0.2))
    study = compare(predicted(nominal, [1.0, 1.1, 1.2, 1.3]), 1e-3)
    assert [each.kind for each in study.ranges] == [RangeKind.SQUEALS, RangeKind.BISTABLE, RangeKind.STABLE]
    uncertainty = study.ranges[1].last_uncertainty
    assert uncertainty is not None
    assert abs(study.ranges[1].last - 1.17) <= uncertainty == pytest.approx(3e-4, rel=1e-9)


def test_an_end_that_motions_are_too_slow_to_show_is_left_as_uncertain_as_it_is(nominal, monkeypatch):
    # What lies within 0.05 beyond the fold is undecided.
    lasting, tried = made_up([], fold=1.6789, reach=0.12), []

    def find(family, tasks, how, *, rounds, known=None, progress=None):
        for each in lasting(family, tasks, how, rounds=rounds):
            tried.append(each.value)
            slow = 1.6789 < each.value < 1.73 and "from" in each.start
            yield each.model_copy(update={"leads_to": Kind.UNDECIDED}) if slow else each

    monkeypatch.setattr(study_module, "find_attractors", find)
    study = compare(predicted(nominal, np.linspace(1, 2, 11)), 1e-3)
    kinds = [each.kind for each in study.ranges]
    assert kinds == [RangeKind.SQUEALS, RangeKind.BISTABLE, RangeKind.UNDECIDED, RangeKind.STABLE]
    bistable = study.ranges[1]
    assert bistable.last_uncertainty == pytest.approx(0.1 / 6)  # one section between 1.6 and 1.7, which is undecided
    assert bistable.last_uncertainty is not None
    assert abs(bistable.last - 1.6789) <= bistable.last_uncertainty
    assert "whether a disturbance leads to squeal is undecided from" in verdict(study)
    assert "A transient had not settled at 1.7 m/s after 1 s" in " ".join(warnings(study))
    # An undecided motion is not tried larger: that comes down to where this one is.
    assert sum(1.67 < value < 1.7 for value in tried) <= 3


@pytest.fixture(scope="module")
def folding() -> Diagram:
    """The cycles of the block: from the Hopf point up to where they fold, and from there down to 0.8 m/s, stable."""
    return DiagramBuilder.of(falling_friction, 0.8, 2.4, 12).from_hopf_points()


@pytest.mark.thorough
def test_cycles_that_end_a_bistable_range_elsewhere_are_a_reservation(nominal, folding):
    ((_, fold),) = folding.squeals_only_when_disturbed
    assert fold == pytest.approx(1.836, abs=1e-3)
    belt = Variation("drum.speed", "rad/s", (0.8, 2.4))

    def said(last: float, cycles: Diagram = folding) -> str:
        ends = ((0.8, HOPF, RangeKind.SQUEALS), (HOPF, last, RangeKind.BISTABLE), (last, 2.4, RangeKind.STABLE))
        ranges = tuple(
            Range(kind=kind, first=a, last=b, first_uncertainty=0.01 if a > 0.8 else None,
                  last_uncertainty=0.01 if b < 2.4 else None)
            for a, b, kind in ends
        )  # fmt: skip
        return " ".join(warnings(bare_study(nominal, belt, ranges=ranges, cycles=cycles)))

    assert "limit cycles" not in said(fold + 0.005)
    assert "The limit cycles end the bistable range at 1.8366 rad/s, not at 1.70 ± 0.01 rad/s" in said(1.7)
    assert "The limit cycles end the bistable range at 1.8366 rad/s, not at 1.90 ± 0.01 rad/s" in said(1.9)
    # A branch that is only lost does not end there.
    (branch,) = folding.branches
    folds = [k for k, cycle in enumerate(branch.cycles) if cycle.value == fold][-1]
    rest = tuple(cycle for cycle in branch.cycles[folds + 1 :] if cycle.value <= 1.5)
    cut = CycleBranch(start=BranchEnd.LOST, start_detail="cut by hand", end=branch.end, cycles=rest)
    lost = folding.model_copy(update={"branches": (cut,), "not_followed": cut.not_followed(0.8, 2.4)})
    ((_, last),) = lost.squeals_only_when_disturbed
    assert last == rest[0].value < 1.5
    for cycles in (lost, lost.model_copy(update={"not_followed": ()})):
        assert "limit cycles" not in said(1.836, cycles)
    # Nor does squeal end at a fold where other cycles may go on, or where a motion is on no branch.
    other = Unfollowed(reason="another branch", low=1.88, high=2.4)
    assert "limit cycles" not in said(1.9, folding.model_copy(update={"not_followed": (other,)}))
    assert "at 1.8366 rad/s, not at 1.70" in said(1.7, folding.model_copy(update={"not_followed": (other,)}))
    off = OffBranch(value=1.5, frequency_Hz=None, amplitude={}, why=Why.NOT_PERIODIC, reason="")
    assert "limit cycles" not in said(1.9, folding.model_copy(update={"off_branches": (off,)}))
    assert "at 1.8366 rad/s, not at 1.70" in said(1.7, folding.model_copy(update={"off_branches": (off,)}))


def test_a_motion_that_only_lasts_larger_is_tried_larger(nominal, monkeypatch):
    lasting = made_up([], fold=1.25, reach=0.2)

    def find(family, tasks, how, *, rounds, known=None, progress=None):
        for each in lasting(family, tasks, how, rounds=rounds):
            yield (
                each
                if each.value < HOPF or "1.5 times" in each.start
                else each.model_copy(update={"leads_to": Kind.DECAYS, "motion": None})
            )

    monkeypatch.setattr(study_module, "find_attractors", find)
    study = compare(predicted(nominal, [1.0, 1.1, 1.2, 1.3]), 0.1)
    assert [row.kind for row in study.values if row.asked] == [
        RangeKind.SQUEALS,
        RangeKind.SQUEALS,
        RangeKind.BISTABLE,
        RangeKind.STABLE,
    ]


def test_a_family_of_models_is_studied_like_a_scene(monkeypatch):
    monkeypatch.setattr(study_module, "find_attractors", made_up([], fold=1.17, reach=0.2))
    along = Variation("belt speed", "m/s", (1.0, 1.1, 1.2, 1.3))
    study = study_onset(falling_friction, along, sample_rate=10.0)
    assert [each.kind for each in study.ranges] == [RangeKind.SQUEALS, RangeKind.BISTABLE, RangeKind.STABLE]
    assert study.ranges[1].first == pytest.approx(HOPF, rel=1e-10)
    assert "Along belt speed from 1 to 1.3 m/s the eigenvalues predict squeal below 1.151 m/s" in str(study.verdict)
    assert not isinstance(study, OnsetStudy)


@pytest.mark.parametrize(
    ("model_at", "values", "rate", "why"),
    [
        (falling_friction, (1.0, 1.0), 10.0, "two values at least"),
        (falling_friction, (1.0, 1.2), 0.1, "twice the highest frequency"),
        (
            lambda v: block_on_belt(ConstantLaw(0.3), belt_speed=v, forces={"X": (1.0, 1.0)}),
            (1.0, 1.2),
            9.0,
            "harmonic",
        ),
        (lambda v: falling_friction(0.0 * v), (1.0, 1.2), 10.0, "no* steady sliding"),
    ],
)
def test_a_family_without_an_onset_is_refused(model_at, values, rate, why):
    with pytest.raises(RequestError, match=why):
        study_onset(model_at, Variation("belt speed", "m/s", values), sample_rate=rate)


@pytest.mark.thorough
def test_instability_between_the_values_is_studied_there(monkeypatch):
    # μ falls only about 1 m/s, where damping of 0.1 N s/m takes less than it gives: roots of μ'(V) = −0.1.
    def island(s):
        return 0.4 + 0.02 * s + 0.05 * jnp.exp(-(((s - 1.0) / 0.05) ** 2))

    def slope(s: float) -> float:
        return 0.12 - 40 * (s - 1) * 0.05 * math.exp(-(((s - 1) / 0.05) ** 2)) / 0.05

    low, high = brentq(slope, 1.0, 1.03), brentq(slope, 1.06, 1.2)
    monkeypatch.setattr(study_module, "find_attractors", made_up([], fold=1.1707, reach=9.0))
    along = Variation("belt speed", "m/s", (0.2, 0.6, 1.4, 1.8))
    study = study_onset(lambda v: block_on_belt(island, damping=0.1, belt_speed=v), along, sample_rate=10.0)
    stable, squeals, bistable, again = study.ranges
    assert [each.kind for each in study.ranges] == [
        RangeKind.BISTABLE,
        RangeKind.SQUEALS,
        RangeKind.BISTABLE,
        RangeKind.STABLE,
    ]
    assert (squeals.first, squeals.last) == pytest.approx((low, high), rel=1e-9)
    assert bistable.last_uncertainty is not None
    assert abs(bistable.last - 1.1707) <= bistable.last_uncertainty == pytest.approx(1.6e-3)
    assert (stable.first, again.last) == (0.2, 1.8)
    assert [row.value for row in study.values if row.asked] == [0.2, 0.6, 1.4, 1.8]


def test_instability_on_both_sides_of_a_belt_at_rest_is_seen(monkeypatch):
    monkeypatch.setattr(study_module, "find_attractors", made_up([], fold=9.0, reach=0.0))
    study = study_onset(falling_friction, Variation("belt speed", "m/s", (-1.5, 0.0, 1.5)), sample_rate=10.0)
    kinds = [RangeKind.STABLE, RangeKind.SQUEALS, RangeKind.NOWHERE, RangeKind.SQUEALS, RangeKind.STABLE]
    assert [each.kind for each in study.ranges] == kinds
    assert [study.ranges[1].first, study.ranges[3].last] == pytest.approx([-HOPF, HOPF], rel=1e-9)
    rest = study.ranges[2]
    assert (rest.first, rest.last) == pytest.approx((-3 / 59 / 4, 3 / 59 / 4))  # halfway to the nearest value looked at
    assert "no range called stable has been proved stable" in warnings(study)[-1]


def test_no_hysteresis_leaves_the_critical_value_alone(nominal, monkeypatch):
    monkeypatch.setattr(study_module, "find_attractors", made_up([], fold=HOPF, reach=9.0))
    study = compare(predicted(nominal, [1.0, 1.1, 1.2, 1.3]), 1e-3)
    assert [each.kind for each in study.ranges] == [RangeKind.SQUEALS, RangeKind.STABLE]
    assert study.ranges[0].last == pytest.approx(HOPF, rel=1e-10)
    assert verdict(study).endswith("; elsewhere no start that was tried squeals.")


def test_ranges_of_what_is_undecided():
    point = point_at(falling_friction, 1.5)
    starts = {1.0: (), 2.0: (), 3.0: (ending(3.0, "small", Kind.UNDECIDED),)}
    rows = [Row.at(point._replace(value=v), *starts[v], asked=True) for v in starts]
    rows[0] = rows[0].model_copy(update={"no_steady_sliding": "the drum stands still"})
    found = find_ranges(rows, (), 0.1)
    assert [(each.kind, each.first, each.last) for each in found] == [
        ("no steady sliding", 1.0, 1.5),
        (RangeKind.STABLE, 1.5, 2.5),
        ("undecided", 2.5, 3.0),
    ]
    assert found[0].last_uncertainty == 0.5
    # Motion that dies out slowly is not resolved to better than is asked for.
    assert find_ranges(rows, (), 0.7)[0].last_uncertainty == 0.7


def test_a_motion_that_still_grows_lasts_but_has_no_size():
    row = Row.at(point_at(falling_friction, 1.1), ending(1.1, "small", Kind.GROWS), asked=True)
    assert row.kind == RangeKind.SQUEALS
    assert row.starts[0].lasts
    assert row.strongest is None


@pytest.mark.parametrize(
    ("value", "uncertainty", "text"),
    [
        (47.944, 0.0185, "47.94 ± 0.02"),
        (10.6122870189, 6e-11, "10.61228701890 ± 6e-11"),
        (105.0, 0.99, "105 ± 1"),
        (1234.0, 30.0, "1234 ± 30"),
    ],
)
def test_uncertainty_is_given_in_one_digit(value, uncertainty, text):
    assert with_uncertainty(value, uncertainty) == text


def test_numbers_of_small_slow_and_large_motions_can_be_read():
    assert with_uncertainty(7.654e-25, 8e-27) == "(7.65 ± 0.08)e-25"
    assert (shown_line(0.15834), shown_line(0.0101), shown_line(1230.94)) == ("0.1583", "0.0101", "1230.9")
    assert at_lining(None, "X", 1.183) == (1.0, "m", "X")
    assert at_lining(None, "X", 2e-3) == (1e6, "µm", "X")


def test_a_perturbation_that_squeals_next_to_a_hopf_point_was_not_small(monkeypatch):
    # The unstable cycle lies at 0.05 of the contact boundary: a tenth of it squeals, a hundredth decays.
    def find(family, tasks, how, *, rounds, known=None, progress=None):
        for point, start in tasks:
            fraction = max(abs(start.velocity[0]), abs(start.vibration[0])) / point.value
            yield ending(point.value, start.name, Kind.SQUEALS if fraction > 0.05 else Kind.DECAYS)

    monkeypatch.setattr(study_module, "find_attractors", find)
    along = Variation("belt speed", "m/s", (1.16, 1.2))
    study = study_onset(falling_friction, along, sample_rate=10.0)
    for row in (row for row in study.values if row.asked):
        assert row.small is not None
        assert (row.kind, row.small.leads_to) == (RangeKind.BISTABLE, Kind.DECAYS)
        assert not any(motion.after_small for motion in row.motions)
    assert "a small perturbation" in str(study)
    assert "velocity of" in str(study)
    assert "lining" not in str(study)
    assert "after 0.1 of the contact boundary" in motion_words(study, study.values[0].motions[0])


def test_a_belt_at_rest_is_no_drum():
    with pytest.raises(SteadyStateError, match="the belt is at rest"):
        analyse_stability(falling_friction(0.0))


# --- the command -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"friction": None}, "friction: this scene has none"),
        ({"forcing": {"amplitude": {"Y": 1.0}, "frequency": 100.0}}, "--set forcing=none"),
        ({"contact.normal_load": {"time": [0, 1], "value": [1, 2]}}, "contact.normal_load: it changes over time"),
    ],
)
def test_what_has_no_onset_is_refused(nominal, settings, told):
    with pytest.raises(RequestError, match=told):
        study_onset(nominal.with_values(settings), "drum.speed=1..2")


def test_a_disturbance_has_the_kinetic_energy_that_it_says(quick):
    model = build_model(quick)
    family = Family(lambda _: model, model.names, model.names)
    found = directions(point_at(family.model_at, 5.0), family)
    assert {direction.forwards for direction in found} == {True, False}
    for direction in found:
        disturbance = direction.disturbance(0.3)  # √J
        velocity = np.array([disturbance.velocity[name] for name in model.names])
        assert np.asarray(model.mass) @ velocity**2 / 2 == pytest.approx(0.3**2, rel=1e-12)
        assert disturbance.energy_J == pytest.approx(0.3**2, rel=1e-12)
        assert direction.start(0.3).velocity == pytest.approx(velocity)


def test_folded_samples_are_refused(quick):
    scene = quick.with_values({"simulate.sample_rate": 2000.0})  # of a mode at 1424 Hz
    with pytest.raises(SceneError, match=r"simulate\.sample_rate .* twice the highest frequency"):
        predict(scene, Variation("drum.speed", "rad/s", (1.0, 2.0)))


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ([], "--along"),
        (["--along", "drum.speed"], "write KEY=FROM..TO"),
        (["--along", "drum.sped=1..2"], "did you mean drum.speed?"),
        (["--along", "drum.speed=-5..5x5"], "may not reach or cross a drum at rest"),
        (["--along", "drum.speed=0..5x5"], "may not reach or cross a drum at rest"),
        (["--along", "drum.speed=1..2", "--nothing"], "(see drumsqueal onset --help)"),
        (["--along", "drum.speed=1..2", "--within", "2"], "write a fraction between 0 and 100 %"),
        (["--along", "drum.speed=1..2", "--set", "friction=none"], "friction: this scene has none"),
    ],
)
def test_wrong_requests_write_nothing(drumsqueal, tmp_path, arguments, told):
    folder = tmp_path / "out"
    status, printed, error = drumsqueal("onset", str(DAMPED), "-o", str(folder), *arguments)
    assert (status, printed) == (2, "")
    assert error.count("\n") == 1
    assert told in error
    assert not folder.exists()


QUICK = ["--set", 'simulate.coordinates=["Y"]', "--set", "start.displacement={Y = 1e-7}"]


def table(folder: Path) -> list[dict[str, str]]:
    return list(csv.DictReader((folder / "onset.csv").read_text(encoding="utf-8").splitlines()))


def test_the_command_writes_what_it_found(drumsqueal, tmp_path, monkeypatch):
    monkeypatch.setattr(study_module, "find_attractors", made_up_for_y)
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "report.html").touch()
    arguments = ["onset", str(DAMPED), *QUICK, "--along", "drum.speed=1..40x4", "-o", str(folder)]
    status, printed, error = drumsqueal(*arguments, "--overwrite")
    assert (status, error) == (0, "")
    assert printed.startswith("Removed with the results that they were made of: report.html\n")
    assert {file.name for file in folder.iterdir()} == {"onset.csv", "onset.json", "onset.png"}
    summary = json.loads((folder / "onset.json").read_text())
    assert summary["outcome"] == COMPLETE
    rows = table(folder)
    (critical,) = summary["critical_values"]
    assert critical["label"] == "Y"
    assert [each["kind"] for each in summary["ranges"]] == [RangeKind.SQUEALS, RangeKind.BISTABLE, RangeKind.STABLE]
    assert summary["ranges"][1]["first"] == critical["value"]
    assert abs(summary["ranges"][1]["last"] - 25.0) <= summary["ranges"][1]["last_uncertainty"]
    asked = [row for row in rows if row["asked"] == "yes"]
    assert [float(row["drum.speed_rad_per_s"]) for row in asked] == [1, 14, 27, 40]
    for row in asked:
        value = float(row["drum.speed_rad_per_s"])
        assert (
            (float(row["growth_rate_Y_1_per_s"]) > 0)
            == (row["kind"] == RangeKind.SQUEALS)
            == (value < critical["value"])
        )
        assert (row["strongest_amplitude_Y_m"] != "") == (value < 25)
    (mode,) = (each for each in summary["modes"] if each["label"] == "Y")
    for row in rows:  # the table and the summary say the same
        k = mode["values"].index(float(row["drum.speed_rad_per_s"])) if row["asked"] == "yes" else None
        if k is not None:
            assert mode["frequency_Hz"][k] == float(row["frequency_Y_Hz"])
            assert mode["growth_rate_1_per_s"][k] == float(row["growth_rate_Y_1_per_s"])
    assert f"{critical['frequency_Hz']:.2f} Hz" in printed.replace("\n", " ")
    assert summary["verdict"] in " ".join(printed.split())
    # Once more is refused, unless it may replace them.
    status, _, error = drumsqueal(*arguments)
    assert status == 2
    assert "--overwrite" in error


def test_the_command_finds_what_is_known_of_a_brake_along_y(drumsqueal, tmp_path, as_kept):
    along = ("--along", "drum.speed=5..60x2", "--within", "50 %")
    status, printed, error = drumsqueal("onset", str(DAMPED), *OPTIONS, *along, "-o", str(tmp_path))
    assert (status, error) == (0, "")
    as_kept("onset", printed, tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == {"onset.csv", "onset.json", "onset.png"}
    squeals, stable = (AlongY(brake_along_y(f"drum.speed={speed}")) for speed in (5, 60))
    found = read_findings(tmp_path / "onset.json", OnsetStudy)
    (critical,) = found.critical_values
    assert critical.value == pytest.approx(squeals.critical_speed, rel=1e-9)
    assert "9.28 rad/s" in " ".join(printed.split())
    first, last = (row for row in table(tmp_path) if row["asked"] == "yes")
    assert [row["kind"] for row in (first, last)] == [RangeKind.SQUEALS, RangeKind.STABLE]
    for row, known in ((first, squeals), (last, stable)):
        assert float(row["growth_rate_Y_1_per_s"]) == pytest.approx(known.growth_rate, rel=1e-9)
    frequency, amplitude, _ = squeals.cycle
    # A motion is judged steady to a thousandth.
    assert float(first["strongest_amplitude_Y_m"]) == pytest.approx(amplitude, rel=1e-3)
    assert float(first["strongest_frequency_Hz"]) == pytest.approx(frequency, rel=1e-4)
    assert (last["strongest_amplitude_Y_m"], last["small_start_leads_to"]) == ("", Kind.DECAYS)


def test_a_range_is_shown_in_the_order_and_in_the_unit_in_which_it_was_asked_for(drumsqueal, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(study_module, "find_attractors", made_up_for_y)
    monkeypatch.setattr("drumsqueal.terminal.style.save_figure", lambda figure, path: drawn.append(figure))
    along = "drum.speed=360 rpm..60 rpm x6"
    status, printed, error = drumsqueal("onset", str(DAMPED), *QUICK, "--along", along, "-o", str(tmp_path))
    assert (status, error) == (0, "")
    words = [line.split() for line in printed.splitlines()]
    speeds = [
        each[0] for each in words if each and each[0].isdigit() and each[1:2] in (["squeals"], ["stable"], ["bistable"])
    ]
    assert speeds == ["360", "300", "240", "180", "120", "60"]
    assert "rpm" in printed
    assert "rad/s" not in printed
    assert "Along drum.speed from 60 to 360 rpm" in " ".join(printed.split())
    listed = [row["drum.speed_rpm"] for row in table(tmp_path) if row["asked"] == "yes"]
    assert listed == ["360.0", "300.0", "240.0", "180.0", "120.0", "60.0"]
    # The summary is in SI.
    parameter = json.loads((tmp_path / "onset.json").read_text())["parameter"]
    assert parameter == {
        "key": "drum.speed",
        "unit": "rad/s",
        "values": pytest.approx([math.tau * k for k in (6, 5, 4, 3, 2, 1)]),
        "given_unit": "rpm",
        "given_unit_in_SI": math.tau / 60,
    }
    # So are the data of the figure; its ticks are round multiples of the unit.
    FigureCanvasAgg(drawn[0]).draw()
    below = drawn[0].axes[-1]
    assert below.get_xlabel() == "drum.speed (rpm)"
    ticks = {text.get_text(): text.get_position()[0] for text in below.get_xticklabels()}
    assert ticks["200"] == pytest.approx(200 * math.tau / 60)


def made_up_for_y(family, tasks, how, *, rounds, known=None, progress=None):
    for point, start in tasks:
        lasts = point.value < 25 and (point.unstable or start.name != "small")
        one = np.array([1e-5])
        motion = Saturated(one, one, (0.0, 1.5), 1000.0, "Y", 1.0, 0.0, 1.0, one, one, COMPLETE)
        yield Response.of(point.value, start.name, Kind.SQUEALS if lasts else Kind.DECAYS, motion, 0.1, ("Y",))


def made_up_cycles(speeds: list[float]) -> CycleBranch:
    """Up to the last but one stable, 1 µm of Y for each rad/s; there it folds."""
    one = Cycle(
        period_s=1e-3,
        amplitude={"Y": 1e-6},
        main_coordinate="Y",
        multipliers=np.array([0.5 + 0j]),
        unit_multiplier_error=0.0,
        tangent_error=0.0,
        residual=0.0,
        contact_fraction=1.0,
        slip_reversed_fraction=0.0,
        displacement={"Y": 0.0},
        velocity={"Y": 0.0},
    )
    places = [{"value": speed, "amplitude": {"Y": 1e-6 * (speed + k)}} for k, speed in enumerate(speeds)]
    places[-1]["multipliers"] = np.array([1.5 + 0j])
    places[-2] |= {"multipliers": np.array([1.0 + 0j]), "what": Event.FOLD}
    cycles = tuple(one.model_copy(update=place) for place in places)
    return CycleBranch(start=BranchEnd.BOUND, end=BranchEnd.LOST, end_detail="nothing", cycles=cycles)


@pytest.mark.thorough
def test_cycles_are_laid_over_the_onset(drumsqueal, tmp_path, monkeypatch):
    def follow(scene, variation, *, seeds, progress):
        # Motions at the values that were asked for, below 25 rad/s.
        assert sorted(seed.value for seed in seeds) == pytest.approx([1 + 3 * k for k in range(8)])
        assert all(seed.frequency_Hz == 1000.0 for seed in seeds)
        assert (variation.key, variation.first, variation.last) == ("drum.speed", 1.0, 40.0)
        linear = predict(scene, read_variation("drum.speed=1..40x14", scene)).linear
        found = CycleBranches(
            scene=scene,
            parameter=ParameterRange.of(variation),
            critical_values=linear.critical,
            steady_sliding_stable=steady_sliding(linear, 1.0, 40.0, stable=True),
            steady_sliding_unstable=steady_sliding(linear, 1.0, 40.0, stable=False),
            branches=(made_up_cycles([5.0, 15.0, 25.0, 20.0]),),
        )
        return found.model_copy(update={"verdict": diagram_verdict(found, variation)})

    drawn = []
    monkeypatch.setattr(study_module, "find_attractors", made_up_for_y)
    monkeypatch.setattr("drumsqueal.questions.onset.study.follow_cycles", follow)
    monkeypatch.setattr("drumsqueal.terminal.style.save_figure", lambda figure, path: drawn.append(figure))
    arguments = ["onset", str(DAMPED), *QUICK, "--along", "drum.speed=1..40x14", "-o", str(tmp_path)]
    status, printed, error = drumsqueal(*arguments, "--cycles")
    assert (status, error) == (0, "")
    told = " ".join(printed.split())
    assert "stable cycles exist from 5 to 25 rad/s (folds at 25 rad/s)" in told
    read = read_findings(tmp_path / "onset.json", OnsetStudy)
    assert to_json(read) == (tmp_path / "onset.json").read_text()
    cycles = json.loads((tmp_path / "onset.json").read_text())["cycles"]
    assert cycles["folds"] == [25.0]
    assert [each["value"] for each in cycles["branches"][0]["cycles"]] == [5.0, 15.0, 25.0, 20.0]
    # Solid up to the fold, dashed beyond, in µm.
    lines = [(line.get_linestyle(), np.array(line.get_data()).tolist()) for line in drawn[0].axes[0].lines]
    assert ("-", [[5.0, 15.0, 25.0], pytest.approx([5.0, 16.0, 27.0])]) in lines
    assert ("--", [[25.0, 20.0], pytest.approx([27.0, 23.0])]) in lines
    legend = [text.get_text() for text in drawn[0].legends[0].get_texts()]
    assert {"stable limit cycle", "unstable limit cycle"} <= set(legend)
    # Without the option there are none, and a range that no cycle can be followed over is refused before anything.
    assert drumsqueal(*arguments, "--overwrite")[0] == 0
    assert json.loads((tmp_path / "onset.json").read_text())["cycles"] is None
    before = (tmp_path / "onset.json").read_text()
    through_rest = ["onset", str(DAMPED), *QUICK, "--along", "drum.speed=-1..40x14", "-o", str(tmp_path)]
    status, _, error = drumsqueal(*through_rest, "--cycles", "--overwrite")
    assert (status, error.count("\n")) == (2, 1)
    assert "drum at rest" in error
    assert (tmp_path / "onset.json").read_text() == before


@pytest.mark.slow
def test_transients_settle_on_the_cycles_that_are_followed(drumsqueal, tmp_path):
    # Two ways to the same motions: integrated until they settle, and closed by Newton's method.
    arguments = ["onset", str(DAMPED), *QUICK, "--along", "drum.speed=4..40x4", "--within", "10 %", "-o", str(tmp_path)]
    assert drumsqueal(*arguments, "--cycles")[0] == 0
    cycles = json.loads((tmp_path / "onset.json").read_text())["cycles"]
    found = sorted(
        (each["value"], each["amplitude"]["Y"])
        for branch in cycles["branches"]
        for each in branch["cycles"]
        if each["stable"]
    )
    for row in table(tmp_path):
        value, amplitude = (float(row[name]) for name in ("drum.speed_rad_per_s", "strongest_amplitude_Y_m"))
        # Between two cycles of the branch the amplitude is read off a straight line.
        assert amplitude == pytest.approx(np.interp(value, *np.transpose(found)), rel=0.01)


def test_ctrl_c_keeps_the_values_done(drumsqueal, tmp_path, monkeypatch):
    calls = []

    def interrupted(family, tasks, how, *, rounds, known=None, progress=None):
        calls.append(len(tasks))
        for each in made_up_for_y(family, tasks, how, rounds=rounds):
            if len(calls) == 2 and each.value > 4:  # after the small and the largest starts come the others
                raise KeyboardInterrupt
            yield each

    monkeypatch.setattr(study_module, "find_attractors", interrupted)
    folder = tmp_path / "out"
    status, _, error = drumsqueal("onset", str(DAMPED), *QUICK, "--along", "drum.speed=1..10x4", "-o", str(folder))
    assert status == 1
    assert "interrupted by the user; what was done until then is in" in error
    assert [row["drum.speed_rad_per_s"] for row in table(folder)] == ["1.0", "4.0"]
    assert not (folder / "onset.png").exists()
    # What was asked and predicted is there, too, and that it is not all.
    summary = json.loads((folder / "onset.json").read_text())
    assert (summary["outcome"], summary["verdict"], summary["ranges"]) == ("cut off", None, [])
    assert len(summary["parameter"]["values"]) == 4
    assert summary["critical_values"][0]["label"] == "Y"
    assert summary["scene"]["title"] == "Squeal with structural damping"
    read = read_findings(folder / "onset.json", OnsetStudy)
    assert [row.value for row in read.values] == [1.0, 4.0]
    assert to_json(read) == (folder / "onset.json").read_text()


@pytest.mark.thorough
def test_transients_of_a_brake_lead_where_its_eigenvalues_say(quick):
    # Y alone, one speed on each side of its critical one.
    study = study_onset(quick, Variation("drum.speed", "rad/s", (2.0, 60.0)), within=0.3)
    assert study.values[0].kind == RangeKind.SQUEALS
    assert study.values[0].small is not None
    assert study.values[0].small.motion is not None
    last = study.values[-1]
    assert last.small is not None
    assert last.small.leads_to == Kind.DECAYS
    (small,) = find_attractors(
        Family(lambda value: build_model(quick, {"drum.speed": value}), ("Y",), ("Y",)),
        [(last.point, go_on(2.0, study.values[0].small.motion, 1e-6))],
        IntegratorOptions(5e4, 1e-6, 0.05),
    )
    assert small.leads_to == Kind.DECAYS


# --- the figure ------------------------------------------------------------------------------------------------------

LOWEST = 0.1  # of the figure's height: panels lower than that cannot be read


@pytest.mark.thorough(but=["damped-drum.speed=1..40x4-told1"])
@pytest.mark.parametrize(
    ("scenario", "along", "told"),
    [
        (
            "damped",
            "drum.speed=1..3x3",
            {"critical value": False, "after a large disturbance only": False},
        ),  # all squeals
        ("damped", "drum.speed=1..40x4", {"critical value": True, "after a large disturbance only": True}),
        ("constant_friction", "drum.speed=1..20x3", {"critical value": False}),  # every rate is round-off
        ("damped", "damping.ratio=0.02..1.2x3", {"critical value": False}),  # nothing oscillates at the last
        ("out_of_plane", "support.upper_stiffness=1e8 N/m..3.333333e8 N/m x3", {"mode Ty": True}),  # six modes
    ],
)
def test_the_panels_of_the_figure_keep_their_heights(monkeypatch, scenario, along, told):
    # An empty line that is not clipped once stretched over the whole figure, and the layout gave up, with a warning.
    def find(family, tasks, how, *, rounds, known=None, progress=None):
        for point, start in tasks:
            yield ending_in(family.moving, point, start.name)

    monkeypatch.setattr(study_module, "find_attractors", find)
    scene = load_scene(DAMPED.with_name(f"{scenario}.toml"))
    title = "A brake with a title that is longer than a figure is wide, " * 4
    study = study_onset(scene.model_copy(update={"title": title}), along, within=0.5)
    figure = draw_onset(study)
    FigureCanvasAgg(figure).draw()
    assert all(axes.get_position().height > LOWEST for axes in figure.axes)
    low, high = figure.axes[2].get_ylim()
    assert high - low > 1  # 1/s
    labels = [axes.yaxis.label.get_window_extent() for axes in figure.axes]
    assert all(above.y0 > below.y1 for above, below in pairwise(labels))
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {label: label in legend for label in told} == told


def ending_in(moving: tuple[str, ...], point, start: str) -> Response:
    """Squeal where the eigenvalues say so and, where they do not, from a large disturbance up to the value 25."""
    lasts = point.unstable or (2 < point.value < 25 and start != "small")
    one = np.full(len(moving), 1e-5)
    motion = Saturated(one, one, (0.0, 1.5), 1000.0, moving[0], 1.0, 0.0, 1.0, one, one, COMPLETE)
    return Response.of(point.value, start, Kind.SQUEALS if lasts else Kind.DECAYS, motion, 0.1, moving)


def test_a_bistable_range_that_goes_on_names_each_end_that_is_open():
    speed = read_variation("drum.speed=58 rpm..62 rpm x2", load_scene(DAMPED))
    study = bare_study(load_scene(DAMPED), speed)
    for ends, told in (
        ((None, None), "58 rpm and 62 rpm, the ends of the range"),
        ((0.1, None), "62 rpm, the end of the range"),
        ((None, 0.1), "58 rpm, the end of the range"),
    ):
        first, last = ends
        bistable = Range(
            kind=RangeKind.BISTABLE, first=speed.first, last=speed.last, first_uncertainty=first, last_uncertainty=last
        )
        found = warnings(study.model_copy(update={"ranges": (bistable,)}))
        assert f"The bistable range may go on beyond {told} asked for." in found


@pytest.mark.thorough
def test_the_verdict_names_where_it_is_undecided():
    speed = read_variation("drum.speed=58 rpm..62 rpm x2", load_scene(DAMPED))
    study = bare_study(load_scene(DAMPED), speed)
    middle, ends = (speed.first + speed.last) / 2, (speed.first, speed.last)

    def said(*kinds: RangeKind) -> str:
        bounds = (ends[0], middle, ends[1]) if len(kinds) > 1 else ends
        found = (
            Range(kind=kind, first=a, last=b, first_uncertainty=None if a in ends else 0.0,
                  last_uncertainty=None if b in ends else 0.0)
            for kind, (a, b) in zip(kinds, pairwise(bounds), strict=True)
        )  # fmt: skip
        return verdict(study.model_copy(update={"ranges": tuple(found)})).partition("; ")[2]

    assert said(RangeKind.UNDECIDED) == "whether a disturbance leads to squeal is undecided all along."
    quiet = "no start that was tried squeals; whether a disturbance leads to squeal is undecided above 60 rpm."
    assert said(RangeKind.STABLE, RangeKind.UNDECIDED) == quiet
    assert said(RangeKind.NOWHERE) == ""
    assert said(RangeKind.SQUEALS) == ""  # everywhere: several motions may coexist for all that
    assert said(RangeKind.BISTABLE, RangeKind.UNDECIDED) == (
        "bistable below 60 rpm: steady sliding is stable there, but a large disturbance leads to squeal; whether a "
        "disturbance leads to squeal is undecided above 60 rpm."
    )
