"""The rigid shoe against brute-force integrals over its volume and its lining."""

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drumsqueal.physics.bodies.rigid_shoe import RigidShoe
from drumsqueal.physics.model import build_model
from drumsqueal.scene import COORDINATES

# Gauss nodes: r and z enter as polynomials of degree 3 at most; a product of two sines or cosines over 360° is resolved
# to round-off by 24 nodes.
ALONG = np.polynomial.legendre.leggauss(24)
ACROSS = np.polynomial.legendre.leggauss(4)

# (outer radius, thickness over radius, width, arc angle, density), SI and rad: from a toy to a windlass brake.
geometries = st.tuples(
    st.floats(0.01, 2.0),
    st.floats(0.01, 0.99),
    st.floats(0.001, 1.0),
    st.floats(np.radians(5.0), 2 * np.pi),
    st.floats(100.0, 20000.0),
)


def shoe_of(geometry) -> RigidShoe:
    radius, fraction, width, arc, density = geometry
    return RigidShoe(radius, fraction * radius, width, arc, density)


def on(interval, rule):
    low, high = interval
    return (low + high) / 2 + (high - low) / 2 * rule[0], (high - low) / 2 * rule[1]


def volume_integral(geometry, integrand):
    """∫ρ f(r, θ, z) dV by a product of Gauss rules."""
    radius, fraction, width, arc, density = geometry
    r, wr = on((radius * (1 - fraction), radius), ACROSS)
    theta, wt = on((-arc / 2, arc / 2), ALONG)
    z, wz = on((-width / 2, width / 2), ACROSS)
    r, theta, z = (x.reshape(shape) for x, shape in ((r, (-1, 1, 1)), (theta, (1, -1, 1)), (z, (1, 1, -1))))
    weight = wr[:, None, None] * wt[None, :, None] * wz[None, None, :] * r
    return density * np.sum(integrand(r, theta, z) * weight)


def lining_integral(geometry, c, integrand):
    """∫f dA over the lining, f of the shape functions φ^r, φ^θ, φ^z, each (6, nodes)."""
    radius, _, width, arc, _ = geometry
    theta, wt = on((-arc / 2, arc / 2), ALONG)
    z, wz = on((-width / 2, width / 2), ACROSS)
    theta, z = (x.ravel() for x in np.meshgrid(theta, z, indexing="ij"))
    weight = radius * np.outer(wt, wz).ravel()
    zero, one = np.zeros_like(theta), np.ones_like(theta)
    ahead = radius * np.cos(theta) - c
    # Rows: displacement of P along x, y and z for unit q_i, the paper's equations (5) to (7).
    x = np.stack([one, zero, zero, zero, z, -radius * np.sin(theta)])
    y = np.stack([zero, one, zero, -z, zero, ahead])
    axial = np.stack([zero, zero, one, radius * np.sin(theta), -ahead, zero])
    radial = x * np.cos(theta) + y * np.sin(theta)
    tangential = -x * np.sin(theta) + y * np.cos(theta)
    return np.sum(integrand(radial, tangential, axial) * weight, axis=-1)


# Both sides are sums of positive and negative terms no larger than the tolerance's scale: 1e-13 is some 500 round-offs.
@given(geometries)
@settings(derandomize=True, max_examples=100)
def test_mass_centroid_and_moments_are_the_integrals_over_the_body(geometry):
    shoe = shoe_of(geometry)
    mass = volume_integral(geometry, lambda r, theta, z: np.ones(np.broadcast_shapes(r.shape, theta.shape, z.shape)))
    c = volume_integral(geometry, lambda r, theta, z: r * np.cos(theta) + 0 * z) / mass
    second = volume_integral(geometry, lambda r, theta, z: r**2 + z**2 + 0 * theta)
    moments = [
        volume_integral(geometry, lambda r, theta, z: (r * np.sin(theta)) ** 2 + z**2),
        volume_integral(geometry, lambda r, theta, z: (r * np.cos(theta) - c) ** 2 + z**2),
        volume_integral(geometry, lambda r, theta, z: (r * np.cos(theta) - c) ** 2 + (r * np.sin(theta)) ** 2 + 0 * z),
    ]
    products = [
        volume_integral(geometry, lambda r, theta, z: r * np.sin(theta) * z),
        volume_integral(geometry, lambda r, theta, z: (r * np.cos(theta) - c) * z),
        volume_integral(geometry, lambda r, theta, z: (r * np.cos(theta) - c) * r * np.sin(theta) + 0 * z),
    ]
    np.testing.assert_allclose(shoe.mass[:3], mass, rtol=1e-13)
    np.testing.assert_allclose(shoe.centroid, c, rtol=0, atol=1e-13 * geometry[0])
    np.testing.assert_allclose(shoe.mass[3:], moments, rtol=0, atol=1e-13 * second)
    np.testing.assert_allclose(products, 0, atol=1e-13 * second)  # so that the mass matrix is diagonal


@given(geometries)
@settings(derandomize=True, max_examples=100)
def test_resultants_and_radial_stiffness_are_the_integrals_over_the_lining(geometry):
    shoe = shoe_of(geometry)
    radius, _, width, _, _ = geometry
    c = float(shoe.centroid)
    reach = np.array([1, 1, 1, radius + width, radius + width, radius])
    scale = float(shoe.area) * reach
    radial = lining_integral(geometry, c, lambda radial, tangential, axial: radial)
    along = lining_integral(geometry, c, lambda radial, tangential, axial: tangential)
    stiffness = lining_integral(geometry, c, lambda radial, tangential, axial: radial[:, None] * radial[None])
    assert shoe.area == pytest.approx(geometry[0] * geometry[2] * geometry[3], rel=1e-15)
    assert np.all(np.abs(np.array(shoe.radial_resultant()) - radial) <= 1e-13 * scale)
    assert np.all(np.abs(np.array(shoe.tangential_resultant()) - along) <= 1e-13 * scale)
    assert np.all(np.abs(shoe.radial_stiffness() - stiffness) <= 1e-13 * scale[:, None] * reach)
    np.testing.assert_array_equal(shoe.radial_stiffness(), shoe.radial_stiffness().T)


def test_nominal_shoe_has_the_derived_values(nominal):
    # Computed from Table 1 of Seo & Kang (2023) by another program; nine digits are given.
    model = build_model(nominal, coordinates=COORDINATES)
    slip = model.shoe.outer_radius * model.operation.at(0.0).drum_speed
    friction = model.contact.friction
    assert friction is not None
    assert model.shoe.mass[0] == pytest.approx(1.16571623, rel=5e-9)
    assert model.shoe.centroid == pytest.approx(72.1956531e-3, rel=5e-9)
    assert model.operation.at(0.0).preload == pytest.approx(241499.598, rel=5e-9)
    assert friction.law.coefficient(slip) == pytest.approx(0.42130613, rel=2e-8)
    assert -jax.grad(lambda s: friction.law.coefficient(s))(slip) == pytest.approx(0.12130613, rel=5e-8)
    # The same program's full mass matrix and load pressure, to all digits.
    moments = [0.0032952030811029555, 0.0004465470727836047, 0.0034829125796615023]
    np.testing.assert_allclose(model.mass, [1.1657162284483753] * 3 + moments, rtol=1e-13)
    assert model.operation.at(0.0).preload == pytest.approx(241499.59752616365, rel=1e-15)


def test_thin_short_shoe_is_a_plate():
    # Arc and thickness towards zero: a flat plate b by Rβ at r = R, with errors of second order in β and h/R.
    radius, thickness, width, arc, density = 0.1, 1e-5, 0.05, 1e-3, 7800.0
    shoe = RigidShoe(radius, thickness, width, arc, density)
    mass = density * radius * arc * width * thickness
    np.testing.assert_allclose(shoe.mass[0], mass, rtol=1e-4)
    np.testing.assert_allclose(shoe.centroid, radius, rtol=1e-4)
    np.testing.assert_allclose(shoe.mass[3], mass * (width**2 + (radius * arc) ** 2) / 12, rtol=2e-4)


@pytest.mark.parametrize("speed", [5.0, -5.0])
def test_pressure_and_slip_along_the_arc_are_those_of_a_rigid_body(nominal, speed):
    # A point at θ presses by X cos θ; Ẏ and a spin about c take it along the drum, whose surface has the speed RΩ.
    model, theta = build_model(nominal.with_values({"drum.speed": speed})), np.array([-1.0, 0.0, 0.5])
    assert model.names == ("X", "Y", "Tz")
    contact, moment, body = model.lining, model.operation.at(0.0), model.body
    assert isinstance(body, RigidShoe)
    R, c = float(body.outer_radius), float(body.centroid)
    pressure, slip = contact.along_arc(moment, (-1e-7, 0.0, 0.0), (0.0, 0.1, 3.0), theta)
    wanted = float(moment.preload) - float(contact.law.stiffness) * 1e-7 * np.cos(theta)
    np.testing.assert_allclose(pressure, wanted, rtol=1e-12)
    np.testing.assert_allclose(slip, 0.1 * np.cos(theta) + 3 * (R - c * np.cos(theta)) - R * speed, rtol=1e-12)


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_extremes_on_the_lining_are_those_along_both_of_its_edges(turn):
    # Of |θ| ≤ 1 and |z| ≤ 15 mm with X = 1 m, u_r = cos θ (1 + z Ty) − z Tx sin θ.
    shoe = RigidShoe(0.1, 0.02, 0.03, 2.0, 7800.0, ("X", "Tx", "Ty"))
    back, ends = slice(None, None, int(turn)), np.cos(1.0)
    pitched = shoe.radial((1.0, 0.0, -100 * turn))  # 2.5 cos θ along one edge, −0.5 cos θ along the other
    first, last, low, high = shoe.ends_and_extremes(pitched, spatial=True)
    for found, wanted in ((first, [2.5 * ends, -0.5 * ends]), (last, [2.5 * ends, -0.5 * ends])):
        np.testing.assert_allclose(found[back], wanted, rtol=1e-12)
    np.testing.assert_allclose(low[back], [2.5 * ends, -0.5], rtol=1e-12)
    np.testing.assert_allclose(high[back], [2.5, -0.5 * ends], rtol=1e-12)
    rolled = shoe.radial((1.0, 100 * turn, 0.0))  # cos θ ± 1.5 sin θ, largest at tan θ = ±1.5, within the arc
    first, last, low, high = shoe.ends_and_extremes(rolled, spatial=True)
    down, up = ends - 1.5 * np.sin(1.0), ends + 1.5 * np.sin(1.0)
    np.testing.assert_allclose(first[back], [down, up], rtol=1e-12)
    np.testing.assert_allclose(last[back], [up, down], rtol=1e-12)
    np.testing.assert_allclose(low, [down, down], rtol=1e-12)
    np.testing.assert_allclose(high, [np.sqrt(1 + 1.5**2)] * 2, rtol=1e-12)
    for found, wanted in zip(shoe.ends_and_extremes(rolled, spatial=False), (ends, ends, ends, 1.0), strict=True):
        np.testing.assert_allclose(found, [wanted], rtol=1e-12)  # along the middle line
