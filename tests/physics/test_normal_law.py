"""A lining that stiffens: law, equilibrium, eigenvalues, energy, frequencies and lift-off by formulas of their own."""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from drumsqueal import integrate
from drumsqueal.findings.vibration import boundary_ratios
from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.basis import lining_stiffness
from drumsqueal.physics.effects.pressure import (
    Bonded,
    HardeningLining,
    LinearLining,
    MeasuredLining,
    Unilateral,
    tangent_under,
)
from drumsqueal.physics.friction_law import ConstantLaw
from drumsqueal.physics.inventory import take_inventory
from drumsqueal.physics.model import Model, build_model
from drumsqueal.physics.small_bodies import sprung_block_on_belt
from drumsqueal.questions.animate.playback import _mode_contact
from drumsqueal.questions.effects.reductions import reduce, reductions_of
from drumsqueal.questions.sensitivity.disturbing import disturbed
from drumsqueal.scene import Scene, SceneError, load_scene
from drumsqueal.scene.usual import unusual
from drumsqueal.scene.variation import read_variation
from drumsqueal.solve.linear.modes import analyse_stability
from drumsqueal.solve.linear.steady import steady_sliding
from drumsqueal.solve.motion import smallest_force
from test_two_shoes import two

K, H = 0.35e11, 4e15  # N/m³, N/m⁴: under this load the slope at the reference is twice K
P0 = 2000.0 / (0.1 * np.radians(130.0) * 0.0365)  # Pa
U0 = (np.sqrt(K**2 + 4 * H * P0) - K) / (2 * H)
SELF = {"steady.state": "self-consistent"}
POINTS = {"compression": (0, 4e-6, 1e-5, 3e-5), "pressure": (0, 1e5, 4e5, 3e6)}
CURVE = {"contact": {**POINTS, "normal_load": 2000.0}}


def curve(scene: Scene, compression: Any, pressure: Any) -> Scene:
    contact = {"compression": list(compression), "pressure": list(pressure), "normal_load": scene.contact.normal_load}
    return scene.with_values({"contact": contact})


@pytest.fixture(scope="module")
def hardening(nominal) -> Scene:
    return nominal.with_values({"contact.hardening": H})


@Interpreted
def force_at(model: Model, q, v):
    return model.act(0.0, q, v)[0]


@Interpreted
def energy_at(model: Model, time, q):
    return model.energy(time, q, jnp.zeros_like(q))[1]


@Interpreted
def power_at(model: Model, time, q):
    return model.act(time, q, jnp.zeros_like(q))[1]


measured = Interpreted(MeasuredLining)
touching = Interpreted(lambda model, q: model.observe(0.0, q, jnp.zeros_like(q)).contact_fraction)
at = Interpreted(lambda law, level: law.at(level))
slope_of = Interpreted(lambda law, level: law.slope(level))
level_of = Interpreted(lambda law, pressure: law.level(pressure))
stored_of = Interpreted(lambda law, preload, moved: law.stored(preload, moved))
by_preload = Interpreted(lambda law, preload, radial: law.stored_by_preload(preload, radial))
slope_by_preload = Interpreted(lambda law, preload, radial: jax.grad(lambda p: law.stored(p, radial))(preload))


# --- the law ---------------------------------------------------------------------------------------------------------

LAWS: dict[str, Any] = {
    "linear": (LinearLining(3.0), lambda u: 3.0 * u),
    "hardening": (HardeningLining(3.0, 0.7), lambda u: 3.0 * u + 0.7 * u * u),
    # Beyond the last point by its slope there, which SciPy's own extrapolation does not have.
    "measured": (MeasuredLining([0, 1, 2.5, 4], [0, 3, 9, 20]), PchipInterpolator([0, 1, 2.5, 4], [0, 3, 9, 20])),
}


@pytest.mark.parametrize("name", LAWS)
def test_pressure_slope_and_stored_energy_are_those_of_the_formula(name):
    law, formula = LAWS[name]
    k = float(law.stiffness)
    end = float(formula(4.0)), float(formula.derivative()(4.0)) if name == "measured" else 0.0

    def wanted(u: float) -> float:
        if u < 0:
            return k * u
        return end[0] + end[1] * (u - 4.0) if name == "measured" and u > 4 else float(formula(u))

    assert k == pytest.approx((wanted(1e-7)) / 1e-7, rel=1e-6)
    for u in (-2.0, -1e-3, 0.0, 0.3, 1.0, 1.9, 3.7, 4.0, 6.5):
        assert float(at(law, np.asarray(k * u))) == pytest.approx(wanted(u), rel=1e-14)
        slope = (wanted(u + 1e-6) - wanted(u - 1e-6)) / 2e-6
        # Of the difference where the slope of the slope jumps.
        assert float(slope_of(law, np.asarray(k * u))) == pytest.approx(slope, rel=2e-6)
        if u >= 0:
            assert float(level_of(law, np.asarray(wanted(u)))) == pytest.approx(k * u, rel=1e-14)
        points = [each for each in (0.0, 1.0, 2.5, 4.0) if min(0.8, u) < each < max(0.8, u)]
        stored, _ = quad(wanted, 0.8, u, points=points or None, epsabs=1e-13, epsrel=1e-13)
        found = stored_of(law, np.asarray(wanted(0.8)), np.asarray(u - 0.8))
        assert float(found) == pytest.approx(stored, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("name", LAWS)
def test_stored_energy_changes_with_the_load_as_it_says(name):
    law, _ = LAWS[name]
    for pressing in (Unilateral(law), Bonded(law)):
        for radial in (-5.0, -0.4, 0.0, 0.6):  # the first lifts off
            arguments = pressing, np.asarray(2.0), np.asarray(radial)
            assert float(by_preload(*arguments)) == pytest.approx(float(slope_by_preload(*arguments)), rel=1e-12)


def test_a_flat_start_of_a_curve_keeps_a_tenth_of_its_stiffness():
    flat = measured(np.array([0.0, 1, 2]), np.array([0.0, 1, 30]))  # a parabola through these falls at 0
    assert float(flat.stiffness) == pytest.approx(0.1)
    assert float(level_of(flat, np.asarray(30.0))) == pytest.approx(0.2)
    assert np.all(np.diff(at(flat, np.linspace(0, 0.3, 301))) > 0)


def test_curves_of_many_kinds_are_inverted():
    generator = np.random.default_rng(4)
    for _ in range(100):
        points = np.concatenate([np.zeros((2, 1)), np.cumsum(10 ** generator.uniform(-3, 3, (2, 7)), axis=1)], axis=1)
        law = measured(*points)
        levels = float(law.stiffness) * np.sort(generator.uniform(0, 1.2, 20)) * points[0, -1]
        wanted = at(law, levels)
        np.testing.assert_allclose(at(law, level_of(law, wanted)), wanted, rtol=1e-13)


# --- a block ---------------------------------------------------------------------------------------------------------


def test_a_block_slides_where_its_spring_holds_it():
    springs, load, friction = np.array([[2.0, 0.5], [0.5, 1.0]]), 1.7, 0.3
    block = sprung_block_on_belt(
        ConstantLaw(friction), mass=[1.0, 1.0], springs=springs, contact_stiffness=1.2, contact_hardening=0.9, load=load
    )
    u0 = (np.sqrt(1.2**2 + 4 * 0.9 * load) - 1.2) / 1.8
    y = 0.0
    for _ in range(30):  # Newton's method on the balance along Y, X taken from that along X
        normal, slope = 1.2 * (u0 + y) + 0.9 * (u0 + y) ** 2, 1.2 + 1.8 * (u0 + y)
        x, dx = (friction * normal - 0.5 * y) / 2.0, (friction * slope - 0.5) / 2.0
        y -= (0.5 * x + 1.0 * y + normal - load) / (0.5 * dx + 1.0 + slope)
    np.testing.assert_allclose(steady_sliding(block), [x, y], rtol=1e-12)
    np.testing.assert_allclose(np.diag(block.stiffness), [2.0, 1.0 + 1.2 + 1.8 * u0])


def test_a_bonded_block_pulls_by_the_line_below_zero():
    how: Any = {"mass": [1.0, 1.0], "springs": np.eye(2), "contact_stiffness": 2.0, "contact_hardening": 3.0}
    block = sprung_block_on_belt(ConstantLaw(0.0), **how, load=5.0, separation=False)  # u0 = 1
    assert smallest_force(block, [[0.0, 0.0], [0.0, -1.5]]) == pytest.approx(-1.0)
    assert smallest_force(block, [[0.0, 0.0], [0.0, -0.5]]) == pytest.approx(1.75)


# 10 digits are asked for, of a transient of several periods.
@pytest.mark.thorough
@pytest.mark.parametrize("amplitude", [0.05, 0.6, 1.8])  # below the compression of 1, and beyond: it lifts off
def test_the_frequency_of_an_oscillator_goes_with_its_amplitude(amplitude):
    k, h, load = 2.0, 3.0, 5.0  # u0 = 1
    how: Any = {"mass": [1.0, 1.0], "springs": np.zeros((2, 2)), "contact_stiffness": k, "contact_hardening": h}
    block = sprung_block_on_belt(ConstantLaw(0.0), **how, load=load)

    def potential(y: float) -> float:
        u = max(0.0, 1.0 + y)
        return k * u * u / 2 + h * u**3 / 3 - load * y

    low = -amplitude
    high = brentq(lambda y: potential(y) - potential(low), 1e-6, 5.0, xtol=1e-15)
    middle, half = (low + high) / 2, (high - low) / 2

    def inverse_speed(angle: float) -> float:  # at y = middle + half sin(angle), where dy = half cos(angle) d(angle)
        rest = potential(low) - potential(middle + half * np.sin(angle))
        return half * np.cos(angle) / np.sqrt(2 * rest)

    lifts = np.arcsin((-1.0 - middle) / half) if low < -1 else None
    ends = np.pi / 2 * (1 - 1e-9)
    period = 2 * quad(inverse_speed, -ends, ends, points=None if lifts is None else [lifts], epsrel=1e-11, limit=200)[0]
    motion = integrate(block, {"displacement": {"Y": low}}, 10.5 * period, sample_rate=2000.0, tolerance=1e-10)
    y, v = motion.displacement[:, 1], motion.velocity[:, 1]
    turns = np.flatnonzero((v[:-1] < 0) & (v[1:] >= 0))[:10]  # the lowest points, by the slope there
    place = turns - v[turns] / (v[turns + 1] - v[turns])
    assert np.interp(place, np.arange(y.size), motion.time)[-1] / 10 == pytest.approx(period, rel=1e-6)
    assert np.max(np.abs(motion.energy_balance_error)) < 1e-8 * potential(low)


# --- a shoe ----------------------------------------------------------------------------------------------------------


def pressure_of(u: float, *, lifts: bool = True) -> float:
    return K * u + H * u * u if u > 0 else 0.0 if lifts else K * u


def force_of_formula(scene: Any, model: Model, q, v) -> np.ndarray:
    """Contact and friction on X, Y and Tz by `quad`, what the assembly balances, and the support springs."""
    shoe, friction = model.shoe, scene.friction
    R, c, half, width = (float(each) for each in (shoe.outer_radius, shoe.centroid, shoe.half_angle, scene.shoe.width))
    A, B = q[0], q[1] - c * q[2]
    edges = np.linspace(-half, half, 2001)
    levels = U0 + A * np.cos(edges) + B * np.sin(edges)
    signs = np.flatnonzero(levels[:-1] * levels[1:] < 0)
    gap = lambda theta: U0 + A * np.cos(theta) + B * np.sin(theta)  # noqa: E731
    cuts = [brentq(gap, edges[j], edges[j + 1], xtol=1e-15) for j in signs]

    def part(i: int, theta: float) -> float:
        radial = (np.cos(theta), np.sin(theta), -c * np.sin(theta))
        along = (-np.sin(theta), np.cos(theta), R - c * np.cos(theta))
        slip = sum(f * x for f, x in zip(along, v, strict=True)) - R * scene.drum.speed
        normal = pressure_of(gap(theta))
        drag = 0.0 if friction is None else -friction.at(abs(slip)) * normal * np.sign(slip)
        return (-normal * radial[i] + drag * along[i]) * R * width

    parts = (lambda theta, i=i: part(i, theta) for i in range(3))
    total = np.array([quad(each, -half, half, points=cuts or None, epsrel=1e-12)[0] for each in parts])
    load = np.array([2 * np.sin(half), 0.0, 0.0]) * P0 * R * width
    if scene.steady.state == "uniform-pressure" and friction is not None:
        drag = friction.at(R * scene.drum.speed) * P0 * R * width
        load -= drag * np.array([0.0, 2 * np.sin(half), 2 * half * R - 2 * c * np.sin(half)])
    springs = scene.support.upper_stiffness + scene.support.lower_stiffness
    return total + load - springs * np.array([q[0], 0.0, R * R * np.sin(2 * q[2]) / 2])


@pytest.mark.parametrize("steady", ["uniform-pressure", "self-consistent"])
def test_eigenvalues_are_those_of_the_force_by_a_quadrature_of_its_own(hardening, steady):
    scene = hardening.with_values({"steady.state": steady})
    model, rest = build_model(scene), np.zeros(3)
    q = np.asarray(steady_sliding(model))
    scale = 2000.0 * np.array([1.0, 1.0, 0.1])
    assert np.max(np.abs(force_of_formula(scene, model, q, rest)) / scale) < 1e-9
    step = np.array([1e-9, 1e-9, 1e-8])
    jacobian = []
    for size, of in ((step, "q"), (1e4 * step, "v")):
        for j in range(3):
            more = size * np.eye(3)[j]
            sides = [(q + s * more, rest) if of == "q" else (q, s * more) for s in (1, -1)]
            plus, minus = (force_of_formula(scene, model, *side) for side in sides)
            jacobian.append((plus - minus) / (2 * size[j]))
    stiffness, damping = np.array(jacobian[:3]).T, np.array(jacobian[3:]).T
    mass = np.asarray(model.mass)[:, None]
    wanted = np.linalg.eigvals(np.block([[np.zeros((3, 3)), np.eye(3)], [stiffness / mass, damping / mass]]))
    found = analyse_stability(model).eigenvalues
    for each in found:
        assert np.min(np.abs(wanted - each)) < 3e-6 * abs(each)  # of the central differences


@pytest.mark.parametrize("size", [0.3, 3.0])
def test_forces_are_those_of_a_quadrature_of_its_own_where_the_lining_lifts_off(hardening, size):
    generator, model = np.random.default_rng(1), build_model(hardening)
    for _ in range(4):
        q = generator.uniform(-1, 1, 3) * size * U0 * [1, 1, 10]
        wanted = force_of_formula(hardening, model, q, np.zeros(3))
        found = force_at(model, q, np.zeros(3))
        np.testing.assert_allclose(found, wanted, atol=1e-9 * np.abs(wanted).max())


def test_the_lining_lifts_off_where_its_compression_ends(hardening):
    model: Any = build_model(hardening.with_values({"friction": None}))
    half = float(model.shoe.half_angle)
    for depth in (0.9, 1.5, 4.0):
        seen = touching(model, np.array([-depth * U0, 0.0, 0.0]))
        # Off the drum where U0 < depth U0 cos θ.
        lifted = 0.0 if depth < 1 else min(half, np.arccos(1 / depth)) / half
        assert float(seen) == pytest.approx(1 - lifted, abs=1e-12)
    lost, _ = boundary_ratios(model, np.array([[-0.25 * U0, 0.0, 0.0]]), np.zeros((1, 3)))
    assert lost == pytest.approx(0.25)


@pytest.mark.thorough(but=["hardening"])
@pytest.mark.parametrize("changes", [{"contact.hardening": H}, CURVE], ids=["hardening", "measured"])
def test_force_is_the_slope_of_the_energy_and_power_what_a_changing_load_gives_it(nominal, changes):
    scene = nominal.with_values({"friction": None, "support": None, **SELF, **changes})
    scene = scene.with_values({"contact.normal_load": {"time": [0, 1], "value": [1000, 3000]}})
    model, generator = build_model(scene), np.random.default_rng(2)
    slope = Interpreted(lambda model, q: jax.grad(lambda q: model.energy(0.0, q, 0 * q)[1])(q))
    for size in (0.1, 4.0):
        q = generator.uniform(-1, 1, 3) * size * U0 * [1, 1, 10]
        load = np.abs(force_at(model, q, np.zeros(3))).max()
        np.testing.assert_allclose(-slope(model, q), force_at(model, q, np.zeros(3)), atol=1e-9 * load)
        sides = [float(energy_at(model, np.asarray(time), q)) for time in (0.5 - 1e-4, 0.5 + 1e-4)]
        assert float(power_at(model, np.asarray(0.5), q)) == pytest.approx((sides[1] - sides[0]) / 2e-4, rel=1e-5)


@pytest.mark.thorough
@pytest.mark.parametrize("changes", [{"contact.hardening": H}, CURVE], ids=["hardening", "measured"])
def test_energy_balances_in_a_transient_that_lifts_off(nominal, changes):
    model: Any = build_model(nominal.with_values({"friction": None, **SELF, **changes}))
    start = {"displacement": {"X": -3 * U0, "Y": 2 * U0}}
    motion = integrate(model, start, 0.01, sample_rate=1e5, tolerance=1e-9)
    assert np.min(model.observe(0.0, motion.displacement[0], np.zeros(3)).contact_fraction) < 0.8
    energies = np.array([
        float(energy_at(model, np.asarray(0.0), q)) + float(model.mass @ (v * v)) / 2
        for q, v in zip(motion.displacement[::25], motion.velocity[::25], strict=True)
    ])  # fmt: skip
    rest = float(energy_at(model, np.asarray(0.0), np.asarray(steady_sliding(model))))
    # Steps may add up a hundred times their tolerance; without cuts at the points of the curve 1.4e-5 was found.
    assert np.ptp(energies) < 1e-7 * (energies[0] - rest)


def test_full_contact_has_the_slope_under_the_largest_load_and_pushes(hardening):
    half, wanted = np.radians(65.0), K + 2 * H * U0
    for load in (2000.0, {"time": [0, 1, 2], "value": [0, 2000, 500]}):
        model = build_model(hardening.with_values({"contact.normal_load": load}))
        assert float(model.tangents[0]) == pytest.approx(wanted, rel=1e-12)
        lining = float(model.shoe.area) * (1 / 2 + np.sin(2 * half) / (4 * half))  # the integral of cos² θ
        assert float(model.stiffness[0, 0]) == pytest.approx(wanted * lining + 7e8, rel=1e-12)
    pushed: Any = load_scene("leading_shoe", ["contact.hardening=1e13"])
    model, k = build_model(pushed), pushed.contact.stiffness
    assert k is not None
    (size,) = (each.size for each in pushed.shoe.force)
    assert float(model.tangents[0]) == pytest.approx(np.sqrt(k * k + 4e13 * size / float(model.shoe.area)), rel=1e-12)
    assert lining_stiffness(pushed) == pytest.approx(float(model.tangents[0]), rel=1e-12)


# --- what it is the same as ------------------------------------------------------------------------------------------


def test_without_hardening_all_is_the_same_to_the_last_bit(nominal):
    # Of a lining that can lift off: a bonded one is cut where its law changes, at zero, and the same to round-off.
    linear, none = (build_model(nominal.with_values(each)) for each in ({}, {"contact.hardening": 0.0}))
    generator = np.random.default_rng(3)
    for size in (0.1, 3.0):
        q, v = generator.uniform(-1, 1, (2, 3)) * [[size * U0] * 3, [0.1, 0.1, 1.0]]
        np.testing.assert_array_equal(force_at(linear, q, v), force_at(none, q, v))
    np.testing.assert_array_equal(linear.stiffness, none.stiffness)
    np.testing.assert_array_equal(analyse_stability(linear).eigenvalues, analyse_stability(none).eigenvalues)


def test_points_on_a_line_are_the_linear_law(nominal):
    line = build_model(curve(nominal, np.array([0, 1e-6, 5e-6, 2e-5]), K * np.array([0, 1e-6, 5e-6, 2e-5])))
    linear = build_model(nominal)
    for size in (0.3, 5.0):
        q = size * U0 * np.array([-1.0, 0.6, 5.0])
        wanted = force_at(linear, q, np.zeros(3))
        np.testing.assert_allclose(force_at(line, q, np.zeros(3)), wanted, atol=1e-11 * np.abs(wanted).max())
    np.testing.assert_allclose(line.stiffness, linear.stiffness, rtol=1e-12)


@pytest.mark.thorough
def test_a_curve_sampled_from_a_law_converges_to_it(nominal, hardening):
    q = 0.6 * U0 * np.array([-1.0, 0.6, 5.0])
    wanted = force_at(build_model(hardening), q, np.zeros(3))
    errors = []
    for points in (6, 11, 21, 41):
        u = np.linspace(0, 5 * U0, points)
        found = force_at(build_model(curve(nominal, u, K * u + H * u * u)), q, np.zeros(3))
        errors.append(np.abs(found - wanted).max() / np.abs(wanted).max())
    assert errors[0] < 2e-2
    assert errors[1] < errors[0] / 4  # of the second order
    assert errors[2] < errors[1] / 4
    assert errors[3] < errors[2]


def test_the_stiffness_of_full_contact_has_a_slope_by_the_hardening(hardening):
    def stiffness(value):
        return build_model(hardening, {"contact.hardening": value}).stiffness

    slope = Interpreted(jax.jacfwd(stiffness))(np.asarray(H))
    wanted = (np.asarray(stiffness(1.001 * H)) - np.asarray(stiffness(0.999 * H))) / (0.002 * H)
    np.testing.assert_allclose(slope, wanted, rtol=1e-6, atol=1e-9 * np.abs(wanted).max())


@pytest.mark.thorough
def test_two_shoes_may_have_different_laws(nominal):
    own = {"stiffness": K, "hardening": H, "normal_load": 2000.0}
    scene = two(nominal, apart=2.4, friction={"law": "constant", "coefficient": 0.4})
    scene = scene.with_values({"shoe.1.contact": own, **SELF})
    model: Any = build_model(scene)
    assert [type(law.normal) for law in model.contact.laws] == [LinearLining, HardeningLining]
    q = np.random.default_rng(5).normal(size=len(model.names)) * 3e-6
    normal = model.observe(0.0, q, np.zeros_like(q)).of_each("normal_force")
    for (mine, side), force, law in zip(model.sides, normal, [(K, 0.0), (K, H)], strict=True):
        # By a sum over a fine grid of the lining; only the kinematics are shared.
        half, width, p0 = float(side.body.half_angle), float(side.body.width), 2000.0 / float(side.body.area)
        theta, z = ((np.arange(count) + 0.5) / count - 0.5 for count in (800, 60))
        state = dict(
            zip((model.names[k].removeprefix(mine.prefix) for k in mine.places), q[list(mine.places)], strict=True)
        )
        radial = side.body.over_drum(state, 2 * half * theta[:, None], width * z[None, :])[0]
        u = np.maximum(0.0, 2 * p0 / (law[0] + np.sqrt(law[0] ** 2 + 4 * law[1] * p0)) + radial)
        wanted = float(side.body.area) * np.mean(law[0] * u + law[1] * u * u)
        assert float(force) == pytest.approx(wanted, rel=1e-4)
    assert float(model.tangents[1]) == pytest.approx(K + 2 * H * U0, rel=1e-6)
    assert float(model.tangents[0]) == K


@pytest.mark.thorough
def test_a_shoe_that_bends_feels_it_as_with_twice_the_cells(hardening):
    scene = hardening.with_values({"shoe.elastic": {"young": 210e9, "poisson": 0.3, "up_to": 6e3}})
    model = build_model(scene, coordinates=None)
    assert lining_stiffness(scene) == pytest.approx(K + 2 * H * U0, rel=1e-6)
    finer = dataclasses.replace(model, contact=model.lining.on_cells(2, 2))
    q = np.array([3 * U0 * (-1) ** k if k < 3 else 1e-7 for k in range(len(model.names))])
    one, two = (force_at(each, q, np.zeros_like(q)) for each in (model, finer))
    assert np.abs(one - two).max() < 5e-8 * np.abs(two).max()  # 7e-9 was found


@pytest.mark.parametrize("changes", [{"contact.hardening": H}, CURVE], ids=["hardening", "measured"])
def test_without_its_stiffening_a_lining_has_the_eigenvalues_of_an_even_pressure(nominal, changes):
    scene = nominal.with_values(changes)
    (linear,) = (each for each in reductions_of(scene) if str(each) == "stiffening → linear")
    assert "contact stiffness that changes with compression" in take_inventory(scene).includes
    reduced = reduce(scene, [linear])
    assert reduced.contact.linear
    assert take_inventory(reduced) == take_inventory(nominal)
    one, other = (analyse_stability(build_model(each)).eigenvalues for each in (scene, reduced))
    np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-6)


def test_a_pushed_shoe_touches_by_any_curve_before_it_is_pressed():
    # Its search begins where the lining just touches: at exactly no pressure, or it would be off the drum.
    compression = np.array([0, 2e-5, 5e-5])
    for top in np.linspace(0.5e6, 5e6, 40):
        law = measured(compression, np.array([0, 4e5, top]))
        assert float(level_of(law, np.asarray(0.0))) == 0.0
        assert float(tangent_under(law, np.asarray(0.0))) == pytest.approx(float(law.stiffness), rel=1e-12)


def test_shoes_that_are_pushed_apart_are_linear_each_by_its_own_slope(nominal):
    both = {"contact.hardening": H, "contact.normal_load": 0.0, "friction": None, **SELF}
    scene = two(nominal, apart=2.4).with_values(both)
    force = {"at": [0.09, 0.0, 0.0], "direction": [1.0, 0.0, 0.0]}
    for k, size in enumerate((1000.0, 3000.0)):
        scene = scene.with_values({f"shoe.{k}.force": [{**force, "size": size}]})
    (linear,) = (each for each in reductions_of(scene) if str(each) == "stiffening → linear")
    found = [one.contact.stiffness for one in reduce(scene, [linear]).alone]
    wanted = [lining_stiffness(one) for one in scene.alone]
    assert found == wanted
    assert wanted[1] > 1.2 * wanted[0]


def test_the_pressure_of_a_mode_goes_by_the_slope_of_the_law(nominal, hardening):
    motion = np.outer(np.cos(np.arange(4.0)), [1.0, -2.0, 5.0])  # a mode has no size: metres
    stiffening, linear = (_mode_contact(build_model(each), motion, 0.0)[0] for each in (hardening, nominal))
    np.testing.assert_allclose(stiffening.pressure, linear.pressure, atol=1e-9)
    assert np.abs(linear.pressure).max() == pytest.approx(1.0)


def test_without_stiffness_there_is_nothing_to_be_disturbed_beyond(nominal):
    with pytest.raises(SceneError, match=r"contact\.stiffness = 0\.0: without stiffness a lining has no compression"):
        disturbed(nominal.with_values({"contact.stiffness": 0.0}))


# --- in a scene ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (["contact.hardening=-1"], "contact.hardening = -1: the value must not be below 0 N/m^4"),
        (["contact.hardening=1e15", "contact.stiffness=0"], "begins with a stiffness above 0"),
        (
            ["contact.compression=[0, 1e-5]"],
            "a curve takes the place of stiffness and hardening; remove compression, or stiffness",
        ),
        (["contact={normal_load = 2000, compression = [0, 1e-5]}"], "contact.pressure: compression is one half"),
        (["contact={normal_load = 2000}"], 'contact.stiffness: the key is missing; add it, such as'),
        (["contact={normal_load = 2000, compression = [0], pressure = [0]}"], "1 point; write 2 to 50"),
        (["contact={normal_load = 2000, compression = [0, 1], pressure = [0, 1, 2]}"], "3 pressures for 2"),
        (
            ['contact={normal_load = 2000, compression = ["0 mm", "1 um"], pressure = ["1 MPa", "2 MPa"]}'],
            "contact.pressure[0] = 1000000.0: a lining that is not compressed does not press; begin with 0",
        ),
        (
            ["contact={normal_load = 2000, compression = [0, 2e-6, 1e-6], pressure = [0, 1, 2]}"],
            "contact.compression[2] = 1e-06: the values of the curve must increase; write one above 2e-06 m",
        ),
        (
            ["contact={normal_load = 2000, compression = [0, 1e-6], pressure = [0, 0]}"],
            "contact.pressure[1] = 0.0: the values of the curve must increase; write one above 0.0 Pa",
        ),
    ],
)  # fmt: skip
def test_a_wrong_law_says_which_key_is_wrong(settings, message):
    with pytest.raises(SceneError) as error:
        load_scene("nominal", settings)
    assert message in str(error.value)


def test_hardening_that_a_scene_does_not_have_is_varied_once_it_is_there(nominal):
    with pytest.raises(SceneError, match=r"contact\.hardening is not in this scene; add it first, as by --set"):
        read_variation("contact.hardening=0..1e15", nominal)
    measured = nominal.with_values(CURVE)
    for key in ("contact.hardening", "contact.stiffness"):
        with pytest.raises(SceneError, match=f"{key} is not in this scene, whose lining is a measured curve; set that"):
            read_variation(f"{key}=0..1e15", measured)
    there = nominal.with_values({"contact.hardening": 0.0})
    assert read_variation("contact.hardening=0..1e15x3", there).values == (0.0, 5e14, 1e15)


def test_a_law_is_written_as_it_was_read_and_is_usual(hardening, nominal):
    for scene in (hardening, curve(nominal, ["0 mm", "0.05 mm"], ["0 MPa", "1.2 MPa"])):
        assert Scene.model_validate(scene.model_dump(exclude_none=True)) == scene
        assert list(unusual(scene)) == []
    assert "contact.hardening" not in nominal.to_toml()
    said = " ".join(unusual(nominal.with_values({"contact.hardening": 1e3})))
    assert "contact.hardening = 1000 N/m^4 is far from what drum brakes have, 1e9 to 1e20 N/m^4; did you mean" in said
