"""Linear against nonlinear onset: critical values in closed form, modes through crossings, kicked ranges."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from drumsqueal.effects.friction_law import ConstantLaw, ExponentialLaw
from drumsqueal.files.history import COMPLETE
from drumsqueal.linear.branches import follow_modes
from drumsqueal.model import build_model
from drumsqueal.scene.variation import Variation
from drumsqueal.small_bodies import block_on_belt, sprung_block_on_belt
from drumsqueal.studies.attractors import Family, How
from drumsqueal.studies.onset import KICKED, STABLE, Prediction, compare
from drumsqueal.studies.onset import SQUEALS as UNSTABLE
from drumsqueal.studies.onset_verdict import verdict
from drumsqueal.studies.saturated import saturated_motions

DAMPED = Path(__file__).parents[1] / "scenarios" / "damped.toml"
HOPF = 0.5 * math.log(10)  # of the block below


def falling_friction(belt_speed: float):
    """x″ + 0.1 x′ + x = μ sgn(v_d − x′), μ = 0.5 + 0.5 exp(−2|v|): Hopf at v_d = v0 ln(Δμ/(2 ξ v0)) = 1.1512925."""
    return block_on_belt(ExponentialLaw(1.0, 0.5, 2.0), damping=0.1, belt_speed=belt_speed)


def predicted(nominal, values, **how) -> Prediction:
    """The block's onset as a study has it; its scene is only carried along."""
    family = Family(falling_friction, ("X",), ("X",))
    settings = {"sample_rate": 10.0, "tolerance": 1e-6, "round_seconds": 120.0} | how
    linear = follow_modes(falling_friction, values)
    variation = Variation("drum.speed", "m/s", tuple(values))
    return Prediction(nominal, variation, family, falling_friction, linear, How(**settings))


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


def sprung(springs) -> object:
    return sprung_block_on_belt(ConstantLaw(0.0), mass=np.ones(2), springs=springs, contact_stiffness=0.0)


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


def test_a_static_instability_is_a_divergence():
    # A spring that turns negative at p = 0.3: λ² + 0.2 λ + 0.3 − p = 0.
    def model_at(p):
        return block_on_belt(ConstantLaw(0.0), damping=0.2, stiffness=0.3 - p, belt_speed=1.0)

    found = follow_modes(model_at, np.linspace(0, 1, 6))
    (critical,) = found.critical
    # A real eigenvalue counts from 1e-7 of the largest on; it is (p − 0.3)/0.2 there.
    assert critical.value == pytest.approx(0.3, abs=1e-7)
    assert (critical.label, critical.frequency_Hz, critical.destabilises) == ("divergence", 0.0, True)


def test_a_value_without_steady_sliding_is_named(nominal):
    scene = nominal.with_values({"simulate.coordinates": ["Y"], "start.displacement": {"Y": 1e-7}})
    found = follow_modes(lambda speed: build_model(scene, {"drum.speed": speed}), [-2.0, 0.0, 2.0])
    assert [bool(point.reason) for point in found.points] == [False, True, False]
    assert not found.points[1].unstable


# --- where transients lead -------------------------------------------------------------------------------------------


def test_saturated_motions_of_linear_oscillators():
    # Without friction and damping: x = a cos(ωt) for ever; with damping it decays at ζ = c/2.
    models = [block_on_belt(ConstantLaw(0.0), stiffness=k, damping=c, belt_speed=9.0) for k, c in ((4, 0), (9, 0.01))]
    start = np.array([[0.3], [0.2]])
    seen = []
    steady, free = saturated_motions(
        models,
        np.zeros((2, 1)),
        start,
        np.zeros((2, 1)),
        duration=100.0,
        sample_rate=10.0,
        tolerance=1e-9,
        on_progress=lambda done, time: seen.append((done, time)),
    )
    assert seen == [(0, 50.0), (0, 100.0)]
    assert (steady.trend, steady.outcome) == ("settled", COMPLETE)
    # Sampled every 0.2 rad: the largest sample may miss the crest by 0.5 %.
    assert steady.amplitude == pytest.approx([0.3], rel=6e-3)
    assert steady.rms == pytest.approx([0.3 / math.sqrt(2)], rel=5e-3)
    assert steady.edge_shares == (0.0, pytest.approx(0.6 / 9, rel=6e-3))
    assert steady.frequency_Hz == pytest.approx(2 / math.tau, rel=1e-4)
    assert (steady.line, free.line) == ("X", "X")
    assert steady.departure == pytest.approx([0.3 * math.cos(200.0)], abs=1e-6)
    assert steady.velocity == pytest.approx([-0.6 * math.sin(200.0)], abs=1e-6)
    # Half the logarithm of the energies, of which 50 s hold no whole number of periods.
    assert free.rate == pytest.approx(-0.005, rel=0.02)
    assert free.trend == "decays"


def test_more_transients_than_run_at_once_come_in_order_and_one_that_sticks_goes_on_by_itself():
    # Beyond the edge the block sticks, which many at once cannot; with one thread 16 of them run together.
    speeds = np.linspace(1.0, 1.1, 18)
    models = [falling_friction(speed) for speed in speeds]
    steady = np.array([[0.5 + 0.5 * math.exp(-2 * speed)] for speed in speeds])
    start = np.full((18, 1), 1e-3)
    start[5] = start[17] = 1.5
    how = {"duration": 60.0, "sample_rate": 10.0, "tolerance": 1e-6, "threads": 1}
    found = list(saturated_motions(models, steady, start, np.zeros((18, 1)), **how))
    assert [each.failed for each in found] == [False] * 18
    large = np.array([each.amplitude[0] for each in found])
    assert (large[[5, 17]] > 1.0).all()
    assert (np.delete(large, [5, 17]) < 0.1).all()
    assert [each.by_itself for each in found] == [k in (5, 17) for k in range(18)]
    assert 1 < found[5].edge_shares[1] < 1.3  # it moves with the belt one way, and faster the other
    # The slower the belt, the faster the growth.
    rates = np.array([each.rate for each in np.delete(np.array(found, dtype=object), [5, 17], axis=0)[:, 7]])
    assert (np.diff(rates[1:4]) < 0).all()


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

    return brentq(crest, 1.16, 2.0, xtol=1e-8)


def test_the_kicked_range_of_the_block_ends_where_scipy_says(nominal):
    # Subcritical: above the Hopf point squeal by stick and slip goes on once started, until it no longer sticks.
    end = grazing_speed()
    assert HOPF + 0.02 < end < 2
    # Ten periods a round: the block is on its cycle from the first sticking on.
    shorter = predicted(nominal, [1.1, 1.3, 2.0], round_seconds=60.0)
    study = compare(shorter, 0.02, lambda _: None, lambda *_: None)
    kinds = [each.kind for each in study.ranges]
    assert kinds == [UNSTABLE, KICKED, STABLE]
    squeals, kicked, stable = study.ranges
    assert squeals.last == kicked.first == pytest.approx(HOPF, rel=1e-10)
    assert kicked.last == stable.first
    assert kicked.last_uncertainty <= 0.01 * 0.9
    assert abs(kicked.last - end) <= kicked.last_uncertainty
    told = verdict(study)
    assert "predict squeal below 1.15129 (X, 0 Hz)" in told
    assert "a kick is enough for it from 1.15129 to" in told
