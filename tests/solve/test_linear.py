"""The linear model: the Jacobian against equation (29) by hand, eigenvalues, steady sliding, what the paper states."""

import itertools
import math
from types import SimpleNamespace
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from drumsqueal.errors import SteadyStateError
from drumsqueal.findings.prediction import predict
from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.bodies.rigid_shoe import IN_PLANE
from drumsqueal.physics.effects.damping import damping_matrix
from drumsqueal.physics.effects.springs import SupportSprings
from drumsqueal.physics.model import build_model
from drumsqueal.scene import COORDINATES
from drumsqueal.solve.linear import branches
from drumsqueal.solve.linear.branches import Point, follow_modes
from drumsqueal.solve.linear.family import _informative
from drumsqueal.solve.linear.modes import (
    AboutSteady,
    Mode,
    Stability,
    analyse_stability,
    growth_rate,
    solve_modes,
    stability_of,
)
from drumsqueal.solve.linear.steady import linear_model, steady_sliding

ALL = COORDINATES
PLANE = tuple(COORDINATES.index(name) for name in IN_PLANE)
SLOW = {"steady.state": "self-consistent", "drum.speed": 0.5}

# --- equation (29) by hand -------------------------------------------------------------------------------------------

# Products of two shape functions are quadratic in z and of second order in sin and cos: 40 nodes along and 4 across the
# lining integrate them to round-off on any arc up to 360°.
ALONG, ACROSS = np.polynomial.legendre.leggauss(40), np.polynomial.legendre.leggauss(4)


def by_hand(number, *, signed_speed=None, direction="unit-velocity", law="exponential", support=True, damping=False):
    """M (6,), C and K (6, 6) of equation (29), the supports and structural damping, from the numbers of a scene.

    A drum that turns backwards drags the shoe the other way: μ0 changes sign in the stiffness (F_θ = +sgn(Ω) μ0 N),
    but neither in the slope, for d/dV[μ(|V|) sgn V] = μ′(|V|), nor across, where the friction is opposite to V_z.
    """
    R, h, b = (number[f"shoe.{key}"] for key in ("outer_radius", "thickness", "width"))
    arc, density = number["shoe.arc_angle"], number["shoe.density"]
    speed = number["drum.speed"] if signed_speed is None else signed_speed
    c = 4 * (h**2 - 3 * h * R + 3 * R**2) / (3 * arc * (2 * R - h)) * np.sin(arc / 2)
    theta, z = (x.ravel() for x in np.meshgrid(arc / 2 * ALONG[0], b / 2 * ACROSS[0], indexing="ij"))
    weight = R * arc / 2 * b / 2 * np.outer(ALONG[1], ACROSS[1]).ravel()
    zero, one, ahead = np.zeros_like(theta), np.ones_like(theta), R * np.cos(theta) - c
    x = np.stack([one, zero, zero, zero, z, -R * np.sin(theta)])
    y = np.stack([zero, one, zero, -z, zero, ahead])
    axial = np.stack([zero, zero, one, R * np.sin(theta), -ahead, zero])
    radial, along = x * np.cos(theta) + y * np.sin(theta), y * np.cos(theta) - x * np.sin(theta)

    # The body: r by Gauss nodes as well.
    r, wr = R - h / 2 + h / 2 * ACROSS[0], h / 2 * ACROSS[1]
    volume = density * r * wr * b
    t, wt = arc / 2 * ALONG[0][:, None], arc / 2 * ALONG[1][:, None]
    mass = np.sum(volume * wt)
    across = b**2 / 12
    moments = [
        np.sum(volume * wt * ((r * np.sin(t)) ** 2 + across)),
        np.sum(volume * wt * ((r * np.cos(t) - c) ** 2 + across)),
        np.sum(volume * wt * ((r * np.cos(t) - c) ** 2 + (r * np.sin(t)) ** 2)),
    ]
    inertia = np.array([mass, mass, mass, *moments])

    pressure = number["contact.normal_load"] / (R * arc * b)
    slip = abs(R * speed)
    if law == "none":
        friction = slope = 0.0
    elif law == "constant":
        friction, slope = number["friction.coefficient"], 0.0
    else:
        static, kinetic, decay = (number[f"friction.{key}"] for key in ("static", "kinetic", "decay"))
        friction = kinetic + (static - kinetic) * np.exp(-decay * slip)
        slope = decay * (static - kinetic) * np.exp(-decay * slip)
    C = -slope * pressure * (along * weight) @ along.T
    if direction == "unit-velocity" and law != "none":
        C = C + friction * pressure / slip * (axial * weight) @ axial.T
    elastic = number["contact.stiffness"] * (radial * weight) @ radial.T
    if support:
        k = number["support.upper_stiffness"] + number["support.lower_stiffness"]
        elastic = elastic + np.diag([k, 0, 0, 0, 0, k * R**2])
    K = elastic - np.sign(speed) * friction * number["contact.stiffness"] * (along * weight) @ radial.T
    if damping:
        squared, modes = scipy.linalg.eigh(elastic, np.diag(inertia))
        omega = np.sqrt(np.maximum(squared, 0))
        omega[squared < 1e-12 * squared[-1]] = 0  # the free Z motion
        shaped = inertia[:, None] * modes
        C = C + shaped * (2 * number["damping.ratio"] * omega) @ shaped.T
    return inertia, C, K


def linear_at_rest(model):
    """The linear model of a balanced assembly, whose q* = 0, by the program that the eigenvalues are from."""
    steady, linear = linear_model(model)
    np.testing.assert_array_equal(steady, 0)
    return linear


def assert_matrices(model, mass, damping, stiffness, tolerance=1e-12):
    """Round-off of either side is some 1e-15 of the largest entry; the differentiated friction curve adds none."""
    linear = linear_at_rest(model)
    for found, wanted in ((linear.mass, mass), (linear.damping, damping), (linear.stiffness, stiffness)):
        np.testing.assert_allclose(found, wanted, rtol=0, atol=tolerance * np.max(np.abs(wanted)))


def state_matrix(mass, damping, stiffness):
    n = mass.size
    lower = -np.hstack([stiffness, damping]) / mass[:, None]
    return np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), lower])


def spectrum(values) -> np.ndarray:
    values = np.asarray(values, dtype=complex)
    return values[np.lexsort((np.real(values), np.imag(values), np.abs(np.imag(values))))]  # real ones by their size


VARIANTS = {
    "nominal": ({}, {}),
    "tangential": (
        {"friction.direction": "tangential", "damping": {"ratio": 0.013}},
        {"direction": "tangential", "damping": True},
    ),
    "constant": ({"friction": {"law": "constant", "coefficient": 0.4}}, {"law": "constant"}),
    "no friction": ({"friction": None}, {"law": "none"}),
    "bonded": ({"contact.separation": False}, {}),
    "damped": ({"damping": {"ratio": 0.013}}, {"damping": True}),
}


@pytest.mark.parametrize("name", VARIANTS)
@pytest.mark.parametrize("speed", [5.0, -5.0])
def test_jacobian_is_equation_29(nominal, name, speed):
    values, options = VARIANTS[name]
    scene = nominal.with_values({**values, "drum.speed": speed})
    assert_matrices(build_model(scene, coordinates=ALL), *by_hand(scene.numbers(), **options))


factor = st.floats(0.2, 5.0)
SCALED = (
    "shoe.outer_radius",
    "shoe.width",
    "shoe.density",
    "support.upper_stiffness",
    "support.lower_stiffness",
    "contact.stiffness",
    "contact.normal_load",
    "friction.static",
    "friction.kinetic",
    "friction.decay",
    "drum.speed",
)


@pytest.mark.parametrize("direction", ["unit-velocity", "tangential"])
def test_jacobian_is_equation_29_at_random_values(nominal, direction):
    scene = nominal.with_values({"friction.direction": direction, "damping": {"ratio": 0.01}})
    own = scene.numbers()

    @given(
        st.tuples(*[factor] * len(SCALED)),
        st.floats(np.radians(10), 2 * np.pi),
        st.floats(0.02, 0.95),
        st.floats(0.0, 0.3),
        st.sampled_from([1.0, -1.0]),
    )
    @settings(derandomize=True, max_examples=60)
    def check(factors, arc, fraction, ratio, sense):
        number = dict(own)
        for key, scale in zip(SCALED, factors, strict=True):
            number[key] = own[key] * scale  # type: ignore[operator]
        number["drum.speed"] *= sense  # type: ignore[operator]
        number["shoe.arc_angle"], number["damping.ratio"] = arc, ratio
        number["shoe.thickness"] = fraction * number["shoe.outer_radius"]  # type: ignore[operator]
        # Eigenvectors enter the damping: mixed ones of near modes cost a digit or two of it.
        assert_matrices(
            build_model(scene, number, ALL), *by_hand(number, direction=direction, damping=True), tolerance=2e-12
        )

    check()


# --- eigenvalues -----------------------------------------------------------------------------------------------------

# From an independent program (NumPy and SciPy, no automatic differentiation), 1/s, upper half plane.
NOMINAL = [
    61.65840439620365 + 46487.49497673186j,
    34.18940196882704 + 27593.653337500094j,
    76.15675376696663 + 8949.279207740981j,
    -671.5966321857261 + 6840.874682462448j,
    -847.445712009312 + 1773.4175453029784j,
    -1453.7629134568986 + 0j,
    0j,
]
CONSTANT = [
    46485.64466106485j,
    27603.312736353942j,
    8930.479450122382j,
    -647.9116053500718 + 6850.036297444077j,
    -806.7051182143398 + 1774.5876394246782j,
    -1379.6110518286239 + 0j,
    0j,
]
SELF_CONSISTENT = [
    62.10804020903561 + 46487.43831395084j,
    32.2984514143518 + 27593.65291987236j,
    71.8264170485051 + 8949.326677141056j,
    -660.7891374552898 + 6841.430238779771j,
    -632.9664347386799 + 1640.2251082929922j,
    -1752.9229250695894 + 0j,
    0j,
]
STEADY = [-3.0551805888044966e-07, 7.590602465894446e-06, 0.0, 0.0, 0.0, 1.1611520424238319e-05]


# The first two references are good to round-off, the third to about 1e-9: of each eigenvalue 1e-9 and 1e-7, and for the
# zero and the neutral ones round-off of the largest, 4.6e4 × 1e-13.
@pytest.mark.parametrize(
    ("values", "reference", "tolerance"),
    [
        ({}, NOMINAL, 1e-9),
        ({"friction": {"law": "constant", "coefficient": 0.4}}, CONSTANT, 1e-9),
        ({"steady.state": "self-consistent"}, SELF_CONSISTENT, 1e-7),
    ],
    ids=["nominal", "constant", "self-consistent"],
)
def test_eigenvalues_agree_with_an_independent_program(nominal, values, reference, tolerance):
    found = analyse_stability(build_model(nominal.with_values(values), coordinates=ALL)).eigenvalues
    wanted = np.array([*reference, *np.conj(reference[:5])])
    assert found.size == wanted.size == 12
    for value in wanted:
        nearest = found[np.argmin(np.abs(found - value))]
        assert abs(nearest - value) <= tolerance * abs(value) + 1e-8
        # Real parts are what is asked for, and a thousandth of the modulus: the same fraction of their own size.
        assert abs(nearest.real - value.real) <= 20 * tolerance * abs(value.real) + 1e-8


def test_free_motion_along_the_axis_is_a_zero_and_a_real_eigenvalue(nominal):
    scene = nominal.with_values({"simulate.coordinates": ["Z"], "start.displacement": {}})
    stability = analyse_stability(build_model(scene))
    mass, damping, stiffness = by_hand(scene.numbers())
    assert stability.modes == ()
    assert stability.highest_frequency_Hz == 0
    # λ = 0 and λ = −μ0 p0 A/(m RΩ) = −μ0 × load/(m RΩ), in closed form.
    wanted = -0.42130613194252666 * 2000.0 / (mass[2] * 0.5)
    np.testing.assert_allclose(np.sort(stability.eigenvalues.real), [wanted, 0.0], rtol=1e-13, atol=1e-9)
    np.testing.assert_allclose(stability.eigenvalues.imag, 0)
    assert damping[2, 2] == pytest.approx(-wanted * mass[2], rel=1e-13)
    assert abs(stiffness[2]).max() == 0


def test_modes_are_named_ordered_and_scaled(nominal):
    stability = analyse_stability(build_model(nominal, coordinates=ALL))
    assert [mode.name for mode in stability.modes] == ["Tx", "Ty", "Y", "X", "Tz"]
    assert [mode.name for mode in stability.unstable] == ["Y", "X", "Tz"]
    assert stability.highest_frequency_Hz == pytest.approx(46487.49497673186 / (2 * np.pi), rel=1e-12)
    np.testing.assert_array_equal(stability.steady_state, np.zeros(6))
    np.testing.assert_allclose(stability.pressure_range, 241499.59752616365, rtol=1e-14)
    matrix = state_matrix(*by_hand(nominal.numbers()))
    for mode in stability.modes:
        value, main = mode.eigenvalue, stability.coordinates.index(mode.name)
        assert mode.growth_rate == value.real
        assert mode.frequency_Hz == pytest.approx(value.imag / (2 * np.pi))
        assert mode.damping_ratio == pytest.approx(-value.real / abs(value))
        assert mode.right[main] == pytest.approx(1.0, abs=1e-14)
        # Eigenvectors of the matrix by hand, to round-off of its norm.
        size = np.linalg.norm(matrix) * np.linalg.norm(mode.right)
        assert np.linalg.norm(matrix @ mode.right - value * mode.right) < 1e-12 * size
        size = np.linalg.norm(matrix) * np.linalg.norm(mode.left)
        assert np.linalg.norm(mode.left.conj() @ matrix - value * mode.left.conj()) < 1e-12 * size
        for other in stability.modes:
            product = np.vdot(mode.left, other.right)
            # Both vectors carry units; what of the product is round-off goes by the sum of its terms' sizes.
            terms = np.abs(mode.left) @ np.abs(other.right)
            assert abs(product - (1.0 if other is mode else 0.0)) < 1e-11 * max(terms, 1.0)
            assert abs(np.vdot(mode.left, other.right.conj())) < 1e-11 * max(terms, 1.0)


def test_the_left_eigenvector_reads_off_the_amplitude(nominal):
    stability = analyse_stability(build_model(nominal, coordinates=ALL))
    for mode in stability.modes:
        # A free motion in this mode alone: its main coordinate swings with this amplitude and phase.
        amplitude, phase = 3e-7, 0.8
        state = np.real(amplitude * np.exp(1j * phase) * mode.right)
        seen = np.vdot(mode.left, state)
        # A real motion is half the mode and half its conjugate, so that |leftᴴ y| is half the amplitude it swings with.
        assert abs(seen) == pytest.approx(amplitude / 2, rel=1e-10)
        assert np.angle(seen) == pytest.approx(phase, abs=1e-10)


# --- other compositions ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("names", "damping"),
    [(["Y"], False), (["X", "Y", "Tz"], False), (["X", "Y", "Tz"], True), (["Z"], False), (["Tx", "Ty"], True)],
)
def test_listed_coordinates_are_the_only_ones(nominal, names, damping):
    values = {"simulate.coordinates": names, "start.displacement": {}}
    scene = nominal.with_values(values | ({"damping": {"ratio": 0.02}} if damping else {}))
    kept = [("X", "Y", "Z", "Tx", "Ty", "Tz").index(name) for name in names]
    mass, C, K = by_hand(scene.numbers())
    if damping:
        # The modes that are damped are those of the coordinates that are left.
        elastic = by_hand(scene.numbers(), law="none")[2][np.ix_(kept, kept)]
        squared, modes = scipy.linalg.eigh(elastic, np.diag(mass[kept]))
        shaped = mass[kept][:, None] * modes
        C[np.ix_(kept, kept)] += shaped * (0.04 * np.sqrt(np.maximum(squared, 0))) @ shaped.T
    model = build_model(scene)
    assert model.names == tuple(names)
    assert_matrices(model, mass[kept], C[np.ix_(kept, kept)], K[np.ix_(kept, kept)])
    wanted = np.linalg.eigvals(state_matrix(mass[kept], C[np.ix_(kept, kept)], K[np.ix_(kept, kept)]))
    found = analyse_stability(model).eigenvalues
    # A double zero of the solver is as good as the square root of round-off: none of these has one.
    np.testing.assert_allclose(spectrum(found), spectrum(wanted), rtol=1e-10, atol=1e-10 * np.abs(wanted).max())


def test_without_friction_the_shoe_swings_undamped(nominal):
    scene = nominal.with_values({"friction": None})
    stability = analyse_stability(build_model(scene, coordinates=ALL))
    mass, _, K = by_hand(scene.numbers(), law="none")
    omega = np.sqrt(np.maximum(scipy.linalg.eigh(K, np.diag(mass), eigvals_only=True), 0))
    assert stability.unstable == ()
    np.testing.assert_allclose([m.eigenvalue.imag for m in stability.modes], omega[1:], rtol=1e-11)
    assert max(abs(m.growth_rate) for m in stability.modes) < 1e-12 * omega[-1]


def test_without_supports_the_lining_alone_holds_the_shoe(nominal):
    scene = nominal.with_values({"support": None, "simulate.coordinates": ["X", "Y", "Tz"]})
    number = scene.numbers()
    mass, C, K = (x[np.ix_(*[list(PLANE)] * x.ndim)] for x in by_hand(number, support=False))
    # The lining cannot hold the rotation about the drum's axis: K is singular, and the motion q = (0, c, 1) with it.
    c = 0.07219565309081548
    assert np.abs(K @ np.array([0, c, 1])).max() < 1e-12 * np.abs(K).max()
    model = build_model(scene)
    assert_matrices(model, mass, C, K)
    found = analyse_stability(model).eigenvalues
    assert np.min(np.abs(found)) < 1e-6 * np.max(np.abs(found))


# --- steady sliding --------------------------------------------------------------------------------------------------


def static_force(number, q, nodes=400):
    """Generalised force (X, Y, Tz) at rest, self-consistent: −N φ^r + F_θ φ^θ + p0 φ^r over the arc, and −∂U/∂q.

    Independent of the package: the arc is cut at the contact boundaries, found by bisection on a fine grid.
    """
    R, h, b, arc = (number[f"shoe.{k}"] for k in ("outer_radius", "thickness", "width", "arc_angle"))
    c = 4 * (h**2 - 3 * h * R + 3 * R**2) / (3 * arc * (2 * R - h)) * np.sin(arc / 2)
    p0, k = number["contact.normal_load"] / (R * arc * b), number["contact.stiffness"]

    def level(t):
        return p0 + k * (q[0] * np.cos(t) + (q[1] - c * q[2]) * np.sin(t))

    grid = np.linspace(-arc / 2, arc / 2, 2001)
    bounds = [grid[0]]
    for low, high in itertools.pairwise(grid):
        if level(low) * level(high) < 0:
            for _ in range(60):
                middle = (low + high) / 2
                low, high = (middle, high) if level(low) * level(middle) > 0 else (low, middle)
            bounds.append(low)
    bounds = np.array([*bounds, grid[-1]])
    point, weight = np.polynomial.legendre.leggauss(nodes)
    theta = ((bounds[1:] + bounds[:-1])[:, None] / 2 + (bounds[1:] - bounds[:-1])[:, None] / 2 * point).ravel()
    area = R * b * ((bounds[1:] - bounds[:-1])[:, None] / 2 * weight).ravel()
    pressure = np.maximum(level(theta), 0)
    slip = R * abs(number["drum.speed"])
    mu = number["friction.kinetic"] + (number["friction.static"] - number["friction.kinetic"]) * np.exp(
        -number["friction.decay"] * slip
    )
    drag = np.sign(number["drum.speed"]) * mu * pressure
    normal = p0 - pressure
    x = np.sum((normal * np.cos(theta) - drag * np.sin(theta)) * area)
    y = np.sum((normal * np.sin(theta) + drag * np.cos(theta)) * area)
    spin = np.sum((-normal * c * np.sin(theta) + drag * (R - c * np.cos(theta))) * area)
    springs = number["support.upper_stiffness"] + number["support.lower_stiffness"]
    return np.array([x - springs * q[0], y, spin - springs * R**2 * np.sin(q[2]) * np.cos(q[2])]), bounds.size - 2


def test_self_consistent_steady_state_agrees_with_an_independent_program(nominal):
    scene = nominal.with_values({"steady.state": "self-consistent"})
    stability = analyse_stability(build_model(scene, coordinates=ALL))
    # The reference is good to about 1e-9.
    np.testing.assert_allclose(stability.steady_state, STEADY, rtol=1e-8, atol=1e-20)
    # The same program's pressure range, 0.0944 to 1.8682 p0, was taken over its nodes; ours is over the whole arc, so
    # it is compared with the closed form at the ends, where it lies, for the reference's own q.
    number = scene.numbers()
    p0, k, half = 241499.59752616365, number["contact.stiffness"], np.radians(65.0)
    radial = STEADY[0] * np.cos(half) + np.array([-1, 1]) * (STEADY[1] - 0.07219565309081548 * STEADY[5]) * np.sin(half)
    ends = p0 + k * radial  # type: ignore[operator]
    np.testing.assert_allclose(stability.pressure_range, np.sort(ends), rtol=1e-7)
    assert stability.pressure_range[0] / p0 == pytest.approx(0.09438150572848829, abs=2e-3)
    assert stability.pressure_range[1] / p0 == pytest.approx(1.8681923362796065, abs=2e-3)


@pytest.mark.parametrize(("speed", "boundaries"), [(5.0, 0), (-5.0, 0), (0.5, 1), (-0.5, 1), (0.05, 1)])
def test_forces_vanish_in_the_steady_state(nominal, speed, boundaries):
    scene = nominal.with_values({"steady.state": "self-consistent", "drum.speed": speed})
    stability = analyse_stability(build_model(scene, coordinates=ALL))
    q = stability.steady_state
    force, lifted = static_force(scene.numbers(), q[list(PLANE)])
    assert lifted == boundaries
    assert (stability.pressure_range[0] == 0) == (boundaries > 0)
    # Newton's step tolerance of 1e-13 of p0/k_c-like displacements; forces relative to the load (moments: times R).
    assert np.max(np.abs(force) / [1, 1, 0.1]) < 1e-9 * 2000.0
    np.testing.assert_array_equal(q[[2, 3, 4]], 0)


@pytest.mark.thorough(but=["plane"])
@pytest.mark.parametrize("coordinates", [IN_PLANE, ALL], ids=["plane", "space"])
def test_a_lining_that_has_lifted_off_in_part_is_linearised_as_its_forces_change(nominal, coordinates):
    # Against the forces of any motion, which in space look for their contact boundaries on every line across.
    scene = nominal.with_values({"steady.state": "self-consistent", "drum.speed": 0.05})
    model, n = build_model(scene, coordinates=coordinates), len(coordinates)
    steady, linear = linear_model(model)
    touching = Interpreted(lambda q: model.observe(0.0, q, 0 * q).contact_fraction)(steady)
    assert 0.9 < float(touching) < 0.99
    force = Interpreted(lambda state: model.act(0.0, state[:n], state[n:])[0])
    state = np.concatenate([steady, np.zeros(n)])
    # Steps of 1e-8 m and 1e-6 m/s are 1e-3 and 2e-4 of what lifts the lining off and of the slip, so that central
    # differences err by some 1e-6; the quadrature errs by 1e-9 of the load of 2 kN, over 3 N for a step.
    size = np.array([1e-7 if name.startswith("T") else 1e-8 for name in coordinates])
    steps = np.diag(np.concatenate([size, 100 * size]))
    slopes = np.array([(force(state + step) - force(state - step)) / (2 * step.sum()) for step in steps]).T
    scale = np.sqrt(np.asarray(linear.mass))
    for found, wanted in ((linear.stiffness, -slopes[:, :n]), (linear.damping, -slopes[:, n:])):
        error = (np.asarray(found) - wanted) / np.outer(scale, scale)
        assert np.abs(error).max() < 1e-5 * np.abs(wanted / np.outer(scale, scale)).max()


@pytest.mark.parametrize(
    ("pair", "told"),
    [((-3 + 40j, -3 - 40j), -3 + 40j), ((-50, -2), -2), ((1e-9, -2), -2), ((-2, 1e-9), -2), ((1e-9, -1e-9), 0)],
)
def test_of_two_eigenvalues_the_one_that_says_most_is_told(pair, told):
    # The frequency where there is one, else the slower decay, but of a drift; 100 rad/s is the largest of all.
    assert _informative(np.array(pair, dtype=complex), 100.0) == told


def test_a_stability_seen_in_turned_axes_is_that_of_the_turned_body():
    # Two springs of 4 and 9 N/m on 1 kg, the stiffer one along Y: a quarter of a turn makes X of it.
    matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.diag([4.0, 9.0]), np.zeros((2, 2))]])
    none = (0.0, 0.0)
    touching = AboutSteady(np.array([1e-3, 2e-3]), np.ones(2), matrix, none, 1.0, (1.0,))  # pyright: ignore[reportArgumentType]
    found = stability_of(("X", "Y"), touching)
    assert [(mode.name, round(mode.eigenvalue.imag, 9)) for mode in found.modes] == [("X", 2.0), ("Y", 3.0)]
    turned = found.turned(np.array([[0.0, -1.0], [1.0, 0.0]]))
    assert [(mode.name, round(mode.eigenvalue.imag, 9)) for mode in turned.modes] == [("Y", 2.0), ("X", 3.0)]
    np.testing.assert_allclose(turned.steady_state, [-2e-3, 1e-3])
    np.testing.assert_allclose(-turned.matrix[2:, :2], np.diag([9.0, 4.0]), atol=1e-15)
    np.testing.assert_allclose(turned.over(("Y",)).matrix, [[0.0, 1.0], [-4.0, 0.0]], atol=1e-15)
    for mode in turned.modes:
        assert np.vdot(mode.left, mode.right) == pytest.approx(1.0)
        assert mode.shape(turned.coordinates)[mode.name] == pytest.approx(1.0)


@pytest.mark.parametrize(("damping", "unstable"), [(-1e-9, False), (1e-9, False), (-1e-6, True), (1e-6, False)])
def test_what_grows_by_round_off_alone_is_not_unstable(damping, unstable):
    # Re λ = −c/2, of frequencies up to 1e4 rad/s: an error of 1e-12 of those is what eigenvalues are known to.
    stiffness = np.diag([4.0e6, 1e8])
    matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -damping * np.diag([1.0, 0.0])]])
    eigenvalues, modes = solve_modes(("X", "Y"), np.ones(2), matrix)
    assert [(mode.name, mode.unstable) for mode in modes] == [("X", unstable), ("Y", False)]
    np.testing.assert_allclose(np.sort(np.abs(eigenvalues.imag)), [2e3, 2e3, 1e4, 1e4])


def test_a_prediction_holds_real_and_imaginary_parts_and_what_grows_without_oscillation():
    # λ² = 9 in X, which runs off at 3 1/s, and λ² + 0.2 λ + 4 = 0 in Y.
    matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [np.diag([9.0, -4.0]), np.diag([0.0, -0.2])]])
    touching = AboutSteady(np.array([1e-3, 2e-3]), np.ones(2), matrix, (3.0, 5.0), 1.0, (1.0,))  # pyright: ignore[reportArgumentType]
    found = predict(stability_of(("X", "Y"), touching))
    omega = math.sqrt(4 - 0.01)
    assert sorted(found.eigenvalues) == [
        pytest.approx(each) for each in ((-3, 0), (-0.1, -omega), (-0.1, omega), (3, 0))
    ]
    assert found.divergence == pytest.approx(3.0)
    assert (found.steady_state, found.pressure_range_Pa) == ({"X": 1e-3, "Y": 2e-3}, (3.0, 5.0))
    (mode,) = found.modes
    assert mode.frequency_Hz == pytest.approx(omega / (2 * math.pi))
    assert (mode.growth_rate_1_per_s, mode.damping_ratio) == (pytest.approx(-0.1), pytest.approx(0.05))


def test_a_divergence_says_on_which_side_of_its_value_it_grows(monkeypatch):
    # A mode that decays throughout, and what grows without oscillation below 0.3 or above it.
    right = np.ones(2, dtype=np.complex128)
    modes = (Mode("X", "X", -1.0 + 5j, False, right, left=right / complex(2)),)
    for sign in (1, -1):

        def point_at(_, value, sign=sign):
            beyond = sign * (value - 0.3)
            return Point(value, np.zeros(1), modes, np.array([-1 + 5j, -1 - 5j, 1.0 if beyond > 0 else -1.0, -3.0]))

        monkeypatch.setattr(branches, "point_at", point_at)
        (critical,) = follow_modes(lambda value: None, [0.0, 0.25, 1.0]).critical  # pyright: ignore[reportArgumentType]
        assert abs(critical.value - 0.3) <= critical.uncertainty < 1e-9
        assert (critical.label, critical.frequency_Hz, critical.destabilises) == ("divergence", 0.0, sign > 0)


@pytest.mark.parametrize(
    ("rates", "divergence", "unstable", "neutral"),
    [
        ((-1.0, 1e-9), None, False, True),  # of 1e4 1/s, round-off
        ((-1.0, -1e-9), None, False, True),
        ((-1.0, -1e-3), None, False, False),
        ((-1.0, 1.0), None, True, False),
        ((-1.0, 0.0), 2.0, True, False),
        ((), None, False, False),
    ],
)
def test_a_point_is_neutral_where_nothing_grows_and_something_does_not_decay(rates, divergence, unstable, neutral):
    modes = tuple(SimpleNamespace(growth_rate=rate, unstable=rate > 1e-6) for rate in rates)
    point = Point(0.0, np.zeros(2), modes, np.array([1e4j, *filter(None, [divergence])]))  # pyright: ignore[reportArgumentType]
    assert (point.unstable, point.neutral, point.divergence) == (unstable, neutral, divergence)


def test_ratios_of_damping_count_by_the_kinetic_energy_of_each_coordinate():
    # Two blocks on springs of their own are damped each by its own ratio: c = 2 ζ √(k m).
    mass, stiffness, ratio = np.array([2.0, 5.0]), np.diag([8.0, 45.0]), np.array([0.1, 0.02])
    found = damping_matrix(ratio, jnp.asarray(mass), jnp.asarray(stiffness))
    np.testing.assert_allclose(found, np.diag([2 * 0.1 * 4.0, 2 * 0.02 * 15.0]), rtol=1e-14)
    # Of two that are coupled each mode has the mean: in M Φ diag(2 ζ ω) Φᵀ M with Φᵀ M Φ = 1.
    stiffness = np.array([[8.0, -3.0], [-3.0, 45.0]])
    squared, modes = scipy.linalg.eigh(stiffness, np.diag(mass))
    mean = ratio @ (mass[:, None] * modes**2)
    shaped = mass[:, None] * modes
    wanted = shaped @ np.diag(2 * mean * np.sqrt(squared)) @ shaped.T
    found = damping_matrix(ratio, jnp.asarray(mass), jnp.asarray(stiffness))
    np.testing.assert_allclose(found, wanted, rtol=1e-12)


@pytest.mark.thorough
def test_steady_sliding_is_found_at_every_speed(nominal):
    # Also where the first steps leave nothing but round-off, at 1 % of the speeds, which its solver calls a failure.
    scene = nominal.with_values({"steady.state": "self-consistent"})
    solve = jax.jit(lambda speed: steady_sliding(build_model(scene, {"drum.speed": speed}, IN_PLANE)))
    speeds = np.random.default_rng(0).uniform(1.5, 3.0, 500)
    found = np.array([solve(speed) for speed in np.sort(speeds)])
    assert np.all(np.isfinite(found))
    # It hangs on the speed through μ alone, which changes by 0.2 in all: no jumps.
    assert np.max(np.abs(np.diff(found, axis=0))) < 0.02 * np.max(np.abs(found))


def test_turning_the_drum_backwards_mirrors_the_steady_state(nominal):
    forward, backward = (
        analyse_stability(build_model(nominal.with_values({**SLOW, "drum.speed": s}), coordinates=ALL))
        for s in (0.5, -0.5)
    )
    mirror = np.array([1, -1, 1, 1, 1, -1])
    np.testing.assert_allclose(backward.steady_state, mirror * forward.steady_state, rtol=1e-9, atol=1e-20)
    np.testing.assert_allclose(
        spectrum(backward.eigenvalues), spectrum(forward.eigenvalues), rtol=1e-8, atol=1e-8 * 46487
    )


@pytest.mark.thorough
@pytest.mark.parametrize("speed", [5.0, -5.0])
def test_the_balanced_assembly_leaves_no_force(nominal, speed):
    model = build_model(nominal.with_values({"drum.speed": speed}))
    force, power = model.act(0.0, jnp.zeros(3), jnp.zeros(3))
    # Round-off of loads of 2000 N, torques of 200 N m and the heat of 421 W.
    assert np.max(np.abs(force)) < 1e-11
    assert abs(power) < 1e-11


def test_supports_are_the_slope_of_their_potential(nominal):
    # ½(k1 + k2) q1² + ½(k1 + k2) R² sin² q6, at rotations where the sine shows.
    model = build_model(nominal)
    support = next(effect for effect in model.others if isinstance(effect, SupportSprings))
    moment = model.operation.at(0.0)
    for x, turn in ((1e-3, 0.4), (-2e-3, -1.2), (0.0, 2.0)):
        q = (x, 0.3, turn)  # X, Y, Tz
        force = support.act(moment, q, (0.0,) * 3).force
        wanted = [-7e8 * x, 0, -7e8 * 0.01 * np.sin(2 * turn) / 2]
        np.testing.assert_allclose(np.array(force, dtype=float), wanted, rtol=1e-13)
        energy = 3.5e8 * (x**2 + 0.01 * np.sin(turn) ** 2)
        np.testing.assert_allclose(support.potential_energy(moment, q), energy, rtol=1e-13)


@pytest.mark.thorough
def test_self_consistent_without_friction_is_not_displaced(nominal):
    scene = nominal.with_values({"friction": None, "steady.state": "self-consistent"})
    stability = analyse_stability(build_model(scene, coordinates=IN_PLANE))
    np.testing.assert_allclose(stability.steady_state, 0, atol=1e-18)


@pytest.mark.thorough
@pytest.mark.parametrize("state", ["uniform-pressure", "self-consistent"])
def test_a_drum_at_rest_has_no_steady_sliding(nominal, state):
    scene = nominal.with_values({"drum.speed": 0.0, "steady.state": state})
    model = build_model(scene, coordinates=ALL)
    with pytest.raises(SteadyStateError, match=r"drum\.speed is 0"):
        analyse_stability(model)
    assert np.isnan(growth_rate(model, "Y"))


# --- gradients -------------------------------------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("state", "mode"),
    [
        # The gradient through the equilibrium itself takes 80 s to compile.
        ("uniform-pressure", "X"),
        pytest.param("self-consistent", "Y", marks=pytest.mark.thorough),
        pytest.param("uniform-pressure", "Tz", marks=pytest.mark.thorough),
        pytest.param("self-consistent", "Tz", marks=pytest.mark.thorough),
    ],
)
def test_growth_rates_are_differentiable_by_every_number(nominal, state, mode):
    scene = nominal.with_values({"steady.state": state, "damping": {"ratio": 0.002}})
    own = scene.numbers()
    keys = list(own)
    values = jnp.asarray([own[key] for key in keys])

    @jax.jit
    @jax.value_and_grad
    def rate(change):  # relative changes, so that one step suits all numbers
        model = build_model(scene, dict(zip(keys, values * (1 + change), strict=True)), IN_PLANE)
        return growth_rate(model, mode)

    gradient = np.asarray(rate(jnp.zeros(len(keys)))[1])
    assert np.all(np.isfinite(gradient))
    assert np.all(gradient != 0)
    # Five points: an error of step⁴ = 1e-12 times the fifth derivative, and round-off of the eigenvalues (1e-11) over
    # the step; where q* is iterated, its tolerance comes in too.
    step = 1e-3
    for k, key in enumerate(keys):
        change = np.zeros(len(keys))
        change[k] = step
        one, two = (float(rate(m * change)[0] - rate(-m * change)[0]) for m in (1, 2))
        central = (8 * one - two) / (12 * step)
        assert gradient[k] == pytest.approx(central, rel=1e-6, abs=1e-5), key


# --- what the paper states (section 3 of Seo & Kang 2023) ------------------------------------------------------------


def eigenvalues_over(scene, coordinates=ALL, **swept) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues (points, 2n) and, of each, the coordinate with most kinetic energy, over swept numbers."""
    n, eigenvalues, names = len(coordinates), [], []
    for point in zip(*swept.values(), strict=True):
        number = {key.replace("__", "."): value for key, value in zip(swept, point, strict=True)}
        linear = linear_at_rest(build_model(scene, number, coordinates))
        values, vectors = np.linalg.eig(np.asarray(linear.state_matrix()))
        eigenvalues.append(values)
        energy = np.abs(vectors[:n]) * np.sqrt(np.asarray(linear.mass))[:, None]
        names.append([coordinates[i] for i in np.argmax(energy, axis=0)])
    return np.array(eigenvalues), np.array(names)


def growth_over(scene, name, coordinates=ALL, **swept):
    """Largest real part of the mode called so, at every point of the sweep."""
    values, names = eigenvalues_over(scene, coordinates, **swept)
    return np.max(np.where(names == name, np.real(values), -np.inf), axis=1)


CONTACT_STIFFNESS = np.linspace(0, 0.35e11, 36)  # 0 to 100 % of Table 1


def test_with_falling_friction_x_y_and_tz_are_unstable(nominal):
    # Figure 5: over the whole range of contact stiffness, and Tx, Ty and Z never.
    values, names = eigenvalues_over(nominal, contact__stiffness=CONTACT_STIFFNESS)
    for row, called in zip(values, names, strict=True):
        growing = set(called[np.real(row) > 1e-9 * np.abs(row).max()])
        assert growing == {"X", "Y", "Tz"}


def test_with_constant_friction_nothing_is_unstable(nominal):
    # Figure 6: the frequencies approach but do not merge, so there is no mode coupling. Round-off of a neutral mode is
    # 1e-14 of the largest modulus; two zeros that coincide, without contact stiffness, are split by its square root.
    scene = nominal.with_values({"friction": {"law": "constant", "coefficient": 0.4}})
    values, _ = eigenvalues_over(scene, contact__stiffness=CONTACT_STIFFNESS)
    largest = np.abs(values).max(axis=1)
    fastest = np.real(values).max(axis=1)
    assert np.all(fastest[1:] < 1e-12 * largest[1:])
    assert fastest[0] < 1e-7 * largest[0]


def test_a_slower_drum_squeals_more_and_damps_the_other_modes_more(nominal):
    # Figure 7.
    speeds = np.linspace(2.5, 20.0, 15)
    for name in ("X", "Y", "Tz"):
        rates = growth_over(nominal, name, drum__speed=speeds)
        assert np.all(rates > 0)
        assert np.all(np.diff(rates) < 0)
    values, names = eigenvalues_over(nominal, drum__speed=speeds)
    friction = 0.3 + 0.2 * np.exp(-0.1 * speeds)
    for name in ("Z", "Tx", "Ty"):
        damping = np.array([-np.sum(np.real(row[called == name])) for row, called in zip(values, names, strict=True)])
        assert np.all(damping > 0)
        assert np.all(np.diff(damping) < 0)
        # Like μ0/Ω, but for the slope of the friction curve and the coupling of Z and Ty: a few per cent.
        law = damping * speeds / friction
        np.testing.assert_allclose(law, law[-1], rtol=0.05)


def test_growth_is_proportional_to_the_load(nominal):
    # Figure 8: the slope of friction times p0 damps negatively, a small perturbation of the elastic modes, so that the
    # deviation from proportion is of second order in Re λ/Im λ.
    loads = np.linspace(100.0, 6000.0, 30)
    for name in ("X", "Y", "Tz"):
        rates = growth_over(nominal, name, IN_PLANE, contact__normal_load=loads) / loads
        assert np.all(rates > 0)
        np.testing.assert_allclose(rates, rates[0], rtol=1e-3)


def test_a_larger_arc_calms_y_strongly_and_the_others_little(nominal):
    # Figure 9.
    arcs = np.radians(np.linspace(90, 150, 13))
    change = {name: growth_over(nominal, name, IN_PLANE, shoe__arc_angle=arcs) for name in ("X", "Y", "Tz")}
    assert np.all(np.diff(change["Y"]) < 0)
    fall = {name: 1 - rates[-1] / rates[0] for name, rates in change.items()}
    assert fall["Y"] > 0.5
    assert abs(change["Y"][0] - change["Y"][-1]) > 3 * max(np.ptp(change["X"]), np.ptp(change["Tz"]))


@pytest.mark.thorough(but=["outer_radius-0.1"])
@pytest.mark.parametrize(("key", "value"), [("outer_radius", 0.1), ("width", 0.0365)])
def test_a_larger_radius_or_width_calms_all_three(nominal, key, value):
    # Figures 10 and 11.
    sizes = value * np.linspace(0.7, 1.3, 13)
    for name in ("X", "Y", "Tz"):
        rates = growth_over(nominal, name, IN_PLANE, **{f"shoe__{key}": sizes})
        assert np.all(np.diff(rates) < 0)


# --- following modes -------------------------------------------------------------------------------------------------


def turned(angle: float, apart: float = 0.5) -> Stability:
    """Two oscillators whose axes are turned by an angle (degrees), of the eigenfrequencies 1 and 1 + apart rad/s."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    axes = np.array([[c, -s], [s, c]])
    stiffness = axes @ np.diag([1.0, (1 + apart) ** 2]) @ axes.T
    matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -1e-3 * np.eye(2)]])
    found: Any = np.zeros(2), np.ones(2), matrix, (1.0, 2.0), 1.0, (1.0,)
    return stability_of(("X", "Y"), AboutSteady(*found))


@pytest.mark.parametrize(
    ("angle", "models"),
    [
        (30.0, 0),  # the axes are still next to their own
        (44.0, 0),
        # Shapes have changed places, and frequencies have not: only the way there tells that each is what it was.
        (60.0, 1),  # the mean of both ends has the axes of the model halfway
        # The mean of both ends is a multiple of the unit matrix, whose axes tell nothing: each half is asked.
        (90.0, 3),
    ],
)
def test_a_mode_whose_shape_turns_into_that_of_another_is_followed_on_the_way(monkeypatch, angle, models):
    values = []

    def point_at(_, value):
        values.append(value)
        found = turned(value * angle)
        return Point(value, found.steady_state, found.modes, found.eigenvalues, matrix=found.matrix)

    monkeypatch.setattr(branches, "point_at", point_at)
    start, end = turned(0.0), turned(angle)
    assert [mode.name for mode in end.modes] == (["Y", "X"] if angle > 45 else ["X", "Y"])
    assert branches.continued(cast("Any", None), start, end) == [0, 1]
    assert len(values) == models


def test_of_more_modes_than_there_were_one_continues_none():
    start, end = turned(0.0), turned(20.0)
    assert branches.continued(cast("Any", None), start._replace(modes=start.modes[1:]), end) == [-1, 0]
    assert branches.continued(cast("Any", None), start, end._replace(modes=end.modes[1:])) == [1]
