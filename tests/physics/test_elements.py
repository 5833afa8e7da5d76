"""Finite elements, their fits and what is made of them, against fields that are known exactly."""

import functools
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.polynomial import legendre
from scipy import linalg, sparse

from drumsqueal.errors import RequestError
from drumsqueal.physics import trial_shapes
from drumsqueal.physics.bodies import drum_modes, free_modes
from drumsqueal.physics.bodies.drum_elements import Cup, Mesh, modes_of_harmonic, section_of
from drumsqueal.physics.bodies.drum_modes import DrumModes, drum_shapes_at
from drumsqueal.physics.bodies.elements import (
    AT_ONCE,
    REFERENCES,
    SMALL_SHIFT,
    assemble,
    jacobians,
    lowest_modes,
    quadrature,
    residual_shapes,
)
from drumsqueal.physics.bodies.fitted_shapes import fewest, signs_of
from drumsqueal.physics.bodies.lining_surface import Sampled, Surface, project
from drumsqueal.physics.bodies.mesh_formats import _of_arrays
from drumsqueal.physics.bodies.mode_shapes import Sector
from drumsqueal.physics.bodies.mode_shapes import legendre as polynomials
from drumsqueal.physics.bodies.solid_elements import EVERYWHERE, Material, inertia_of, masses_of, rigid_motions

# --- solids ----------------------------------------------------------------------------------------------------------


def bricks(kind, count):
    """So many skewed elements of one kind, none of which has a node in common with another: nodes (e a, 3), cells."""
    skew = np.array([[1.0, 0.2, -0.1], [0.1, 0.8, 0.3], [0.0, -0.2, 1.3]])
    sizes = 1 + 0.1 * np.arange(count)
    points = np.concatenate([size * REFERENCES[kind].nodes @ skew.T + [3.0 * k, 0, 0] for k, size in enumerate(sizes)])
    volume = (1 / 6 if kind == "tetra10" else 1.0) * np.linalg.det(skew) * sizes**3
    return points, np.arange(len(points)).reshape(count, -1), volume


@pytest.mark.parametrize("kind", REFERENCES)
def test_energy_of_an_even_strain_and_mass_of_each_element_are_exact(kind):
    points, cells, volume = bricks(kind, 3)
    E, nu, rho = np.array([3.0, 5.0, 7.0]), np.array([0.1, 0.25, 0.4]), np.array([2.0, 11.0, 13.0])
    stiffness, mass = (each.toarray() for each in assemble(points, cells, kind, E, nu, rho))
    strain, turn = np.array([[0.3, -0.2, 0.5], [-0.2, 0.7, 0.1], [0.5, 0.1, -0.4]]), np.array([0.2, -0.9, 0.4])
    u = points @ strain + np.cross(turn, points)
    energy = E / (1 + nu) * (np.sum(strain**2) + nu / (1 - 2 * nu) * np.trace(strain) ** 2) / 2 * volume
    for k, nodes in enumerate(cells):
        places = (3 * nodes[:, None] + np.arange(3)).ravel()
        moved = u[nodes].ravel()
        own = stiffness[np.ix_(places, places)]
        assert moved @ own @ moved / 2 == pytest.approx(energy[k], rel=1e-12)
        inner = rigid_motions(points[nodes])
        assert np.abs(own @ inner).max() < 1e-11 * np.abs(own).max() * np.abs(points).max()
        # Mass, centre and inertia of a skewed brick or tetrahedron, by a quadrature of its own.
        found = inertia_of(inner.T @ mass[np.ix_(places, places)] @ inner)
        w = quadrature(kind)[1]
        at = quadrature(kind)[2].T @ points[nodes]
        w = rho[k] * w * volume[k] / w.sum()
        assert found.mass == pytest.approx(rho[k] * volume[k], rel=1e-12)
        centre = w @ at / w.sum()
        np.testing.assert_allclose(found.centre, centre, rtol=1e-11)
        off = at - centre
        tensor = np.einsum(
            "q,qij->ij", w, np.einsum("qk,qk,ij->qij", off, off, np.eye(3)) - off[:, :, None] * off[:, None]
        )
        np.testing.assert_allclose(found.tensor, tensor, rtol=1e-10, atol=1e-11 * np.abs(tensor).max())
    # A quadratic field has its slopes at the quadrature points.
    slopes = jacobians(points[cells], quadrature(kind)[3])
    np.testing.assert_allclose(np.linalg.det(slopes) @ quadrature(kind)[1], volume, rtol=1e-12)


def test_more_elements_than_are_made_at_once_have_their_own_materials():
    points, cells, _ = bricks("tetra10", 2)
    count = AT_ONCE + 3
    many = np.tile(points, (count, 1)), np.arange(count * len(points)).reshape(2 * count, -1)
    young = 1 + np.arange(2.0 * count)
    stiffness, mass = assemble(*many, "tetra10", young, 0.3, 2 * young)
    one, light = assemble(points, cells, "tetra10")
    size = 3 * cells.shape[1]
    for k in (0, 5, 2 * AT_ONCE // 2, AT_ONCE, AT_ONCE + 1, 2 * count - 1):
        part, own = slice(k * size, (k + 1) * size), slice(k % 2 * size, (k % 2 + 1) * size)
        np.testing.assert_allclose(stiffness[part, part].toarray(), young[k] * one[own, own].toarray(), atol=1e-9)
        np.testing.assert_allclose(mass[part, part].toarray(), 2 * young[k] * light[own, own].toarray(), rtol=1e-12)


@pytest.mark.parametrize("solved", [False, True])
def test_lowest_modes_are_those_of_a_dense_routine(solved):
    # A chain of ten masses that nothing holds.
    masses, springs = np.arange(1.0, 11.0), np.arange(2.0, 11.0)
    stiffness = np.diag(np.append(springs, 0) + np.append(0, springs)) - np.diag(springs, 1) - np.diag(springs, -1)
    values, vectors = linalg.eigh(stiffness, np.diag(masses))
    highest = (values[4] + values[5]) / 2
    shifted = stiffness + SMALL_SHIFT * highest * np.diag(masses)
    solve = (lambda loads: np.linalg.solve(shifted, loads)) if solved else None
    found, shapes = lowest_modes(sparse.csr_array(stiffness), sparse.csr_array(np.diag(masses)), highest, 1, 1, solve)
    np.testing.assert_allclose(found, values[1:5], rtol=1e-9)
    np.testing.assert_allclose(np.abs(shapes.T @ np.diag(masses) @ vectors[:, 1:5]), np.eye(4), atol=1e-7)


@pytest.mark.parametrize("loads", [1, 3])
def test_residual_shapes_are_what_answers_add_to_modes(loads):
    # A chain of ten masses that nothing holds, and four of its modes.
    masses, springs = np.arange(1.0, 11.0), np.arange(2.0, 11.0)
    stiffness = np.diag(np.append(springs, 0) + np.append(0, springs)) - np.diag(springs, 1) - np.diag(springs, -1)
    mass = np.diag(masses)
    _, vectors = linalg.eigh(stiffness, mass)
    known, shifted = vectors[:, :5], stiffness + 1e-3 * mass
    forces = np.eye(10)[:, [0, 4, 9][:loads]]
    # A load that is there twice, and one that what is known answers in full, add nothing.
    given = np.hstack([forces, 2 * forces[:, :1], mass @ known[:, 3:4]])
    solve: Any = functools.partial(np.linalg.solve, shifted)
    values, shapes = residual_shapes(stiffness, mass, known, solve, given)
    assert shapes.shape == (10, loads)
    np.testing.assert_allclose(shapes.T @ mass @ shapes, np.eye(loads), atol=1e-11)
    np.testing.assert_allclose(shapes.T @ stiffness @ shapes, np.diag(values), atol=1e-10)
    np.testing.assert_allclose(known.T @ mass @ shapes, 0, atol=1e-12)
    np.testing.assert_allclose(known.T @ stiffness @ shapes, 0, atol=1e-10)
    # Together they answer the loads as the whole chain does.
    both = np.hstack([known, shapes])
    found = both @ np.linalg.solve(both.T @ shifted @ both, both.T @ forces)
    np.testing.assert_allclose(found, np.linalg.solve(shifted, forces), atol=1e-9 * np.abs(found).max())


# --- a drum ----------------------------------------------------------------------------------------------------------

CUP = Cup(0.1, 0.012, 0.06, 0.008, 0.05)


@pytest.fixture(scope="module")
def section():
    return section_of(CUP, 0.3, Mesh(2, 3, 2, 3))


# Motions of a drum (harmonic, and U, V, W at r and z) with their strains rr, θθ, zz, zr, rθ, θz, all else being zero.
FIELDS = {
    "wider": (0, lambda r, z: (r, 0 * r, 0.5 * z), lambda r, z: (1, 1, 0.5, 0, 0, 0)),
    "twisted": (0, lambda r, z: (0 * r, r * z, 0 * r), lambda r, z: (0, 0, 0, 0, 0, r)),
    "along x": (1, lambda r, z: (1 + 0 * r, -1 + 0 * r, 0 * r), lambda r, z: (0, 0, 0, 0, 0, 0)),
    "turned about y": (1, lambda r, z: (z, -z, -r), lambda r, z: (0, 0, 0, 0, 0, 0)),
    "sheared": (2, lambda r, z: (r, -r, 0 * r), lambda r, z: (1, -1, 0, 0, -2, 0)),
    "warped": (2, lambda r, z: (0 * r, 0 * r, r**2), lambda r, z: (0, 0, 0, 2 * r, 0, -2 * r)),
}


@pytest.mark.parametrize("name", FIELDS)
def test_strains_of_a_section_are_those_of_the_field(section, name):
    n, field, wanted = FIELDS[name]
    r, z = places_of_nodes()
    u = np.stack(field(r, z), axis=1).ravel()
    steady, with_n = section.strains
    found = np.einsum("eqsa,ea->eqs", steady + n * with_n, u[section.places])
    over_r = steady[..., 1, ::3]  # of U/r, by which the shape functions at the points are known
    shapes, nodes = over_r / over_r.sum(axis=-1, keepdims=True), section.places[:, ::3] // 3
    at_r, at_z = (np.einsum("eqa,ea->eq", shapes, each[nodes]) for each in (r, z))
    strain = np.stack([np.broadcast_to(each, at_r.shape) for each in wanted(at_r, at_z)], axis=-1)
    np.testing.assert_allclose(found, strain, atol=1e-9)


def places_of_nodes():
    """r and z of the nodes, from a mesh made anew."""
    from skfem import Basis, ElementQuad2, MeshQuad

    def grid(n, low, high, power, *, both=False):
        s = np.linspace(0, 1, n + 1)
        s = s**2 / (s**2 + (1 - s) ** 2) if both else s**power
        return low + (high - low) * s

    R, h, b, plate, hub = CUP
    radii = np.concatenate([grid(3, hub, R, 2, both=True), grid(2, R, R + h, 2)[1:]])
    heights = np.concatenate([b / 2 - b * (1 - np.linspace(0, 1, 4)) ** 2, grid(2, b / 2, b / 2 + plate, 2)[1:]])
    mesh = MeshQuad.init_tensor(radii, heights)
    middle = mesh.p[:, mesh.t].mean(axis=1)
    mesh = mesh.remove_elements(np.flatnonzero((middle[0] < R) & (middle[1] < b / 2)))
    return Basis(mesh, ElementQuad2(), intorder=5).doflocs


def test_mass_stress_and_sides_of_a_section(section):
    R, h, b, plate, hub = CUP
    r, z = places_of_nodes()
    ones = np.tile([1.0, 0.0, 0.0], len(r))
    area = ((R + h) ** 2 - R**2) / 2 * b + ((R + h) ** 2 - hub**2) / 2 * plate
    assert ones @ section.mass @ ones == pytest.approx(area, rel=1e-12)
    assert section.area.sum() == pytest.approx(area, rel=1e-12)
    strain = np.array([0.3, -0.2, 0.5, 0.7, -0.4, 0.9])
    lam, G = 0.3 / (1.3 * 0.4), 1 / 2.6
    np.testing.assert_allclose(
        section.stress @ strain, [*(2 * G * strain[:3] + lam * strain[:3].sum()), *(G * strain[3:])]
    )
    held = np.setdiff1d(np.arange(3 * len(r)), section.free)
    np.testing.assert_array_equal(held, np.flatnonzero(np.repeat(np.isclose(r, hub), 3)))
    np.testing.assert_allclose(r[section.inside], R, rtol=1e-12)
    np.testing.assert_array_equal(section.z, z[section.inside])
    assert np.all(np.diff(section.z) > 0)
    assert (section.z[0], section.z[-1], len(section.z)) == (pytest.approx(-b / 2), pytest.approx(b / 2), 7)


@pytest.mark.parametrize("n", [0, 1, 3])
def test_modes_of_a_harmonic_have_unit_mass_around(n):
    section = section_of(CUP, 0.3, Mesh(1, 2, 1, 2))
    strain = section.strains[0] + n * section.strains[1]
    dense = np.zeros(section.mass.shape)
    each = np.einsum("eqsa,st,eqtb,eq->eab", strain, section.stress, strain, section.area, optimize=True)
    for places, own in zip(section.places, each, strict=True):
        dense[np.ix_(places, places)] += own
    free = section.free
    values, vectors = linalg.eigh(dense[np.ix_(free, free)], section.mass.toarray()[np.ix_(free, free)])
    found, shapes = modes_of_harmonic(section, n, np.sqrt((values[2] + values[3]) / 2), 1)
    np.testing.assert_allclose(found, np.sqrt(values[:3]), rtol=1e-8)
    whole = np.zeros((section.mass.shape[0], 3))
    whole[free] = vectors[:, :3] / np.sqrt(2 * np.pi if n == 0 else np.pi)
    inside = whole.reshape(-1, 3, 3)[section.inside].transpose(2, 1, 0)
    signs = np.sign(np.sum(inside * shapes, axis=(1, 2)))[:, None, None]
    np.testing.assert_allclose(shapes, signs * inside, atol=1e-6 * np.abs(inside).max())


def test_shapes_of_harmonics_become_waves_and_polynomials_in_the_order_of_frequency():
    # U, V, W are squares and less in z at each element's three nodes: no polynomial misses any of them.
    z = np.array([-0.03, -0.025, -0.02, -0.005, 0.01, 0.02, 0.03])
    zeta = z / 0.03

    def shape(u, v, w):
        return np.stack([legendre.legval(zeta, each) for each in (u, v, w)])

    parts = {
        0: [([2.0, 0.1], [0.0], [0.3, 0, 0.2])],
        2: [([-1.0, 0.5, 0.4], [0.7], [0, -0.3]), ([0.0], [0.0, -1.0], [0.2])],
    }
    found = [
        drum_modes._Harmonic(0, np.array([5.0]), np.array([shape(*each) for each in parts[0]]), z),
        drum_modes._Harmonic(2, np.array([3.0, 7.0]), np.array([shape(*each) for each in parts[2]]), z),
    ]
    modes = drum_modes._fit(CUP, found, 0.25, 8.0)
    assert isinstance(modes, DrumModes)
    np.testing.assert_array_equal(modes.wavenumbers, [3.0, 3.0, 5.0, 7.0, 7.0])
    np.testing.assert_array_equal(modes.harmonics, [2, 2, 0, 2, 2])
    assert modes.frequency_change == 0.25
    assert modes.fit_error < 1e-12
    angle, height = np.array([0.3, -1.1]), np.array([0.011, -0.02])
    got = drum_shapes_at(modes.coefficients, 0.03, angle, height)
    order = [(2, 0, 1), (2, 0, -1), (0, 0, 1), (2, 1, 1), (2, 1, -1)]
    for k, (n, j, twin) in enumerate(order):
        u, v, w = (legendre.legval(height / 0.03, each) for each in parts[n][j])
        # At the open edge the first that moves much is positive: u of all but the last, whose v is.
        edge = [legendre.legval(-1.0, each) for each in parts[n][j]]
        sign = np.sign(next(each for each in edge if abs(each) > 0.1 * np.abs(edge).max()))
        cosine, sine = np.cos(n * angle), np.sin(n * angle)
        wanted = (u * cosine, v * sine, w * cosine) if twin == 1 else (u * sine, -v * cosine, w * sine)
        if n == 0:
            wanted = (u, v, w)
        np.testing.assert_allclose(got[..., k], sign * np.stack(wanted, axis=-1), atol=1e-12)


def test_what_polynomials_miss_of_a_shape_is_told_as_its_error():
    # A kink of W takes all degrees: of its squares over the ring, relative to those of the whole shape.
    z = np.array([-0.03, -0.015, 0.0, 0.015, 0.03])
    bent = np.array([[1 + 0 * z, 0 * z, 1e-2 * np.array([1, 0.5, 0, 0.5, 1.0])]])
    modes = drum_modes._fit(CUP, [drum_modes._Harmonic(1, np.array([2.0]), bent, z)], 0.0, 3.0)
    x = np.linspace(-0.03, 0.03, 20_001)
    left = drum_shapes_at(modes.coefficients, 0.03, 0.0, x)[:, 2, 0] - np.interp(x, z, bent[0, 2])
    assert modes.fit_error == pytest.approx(np.sqrt(np.mean(left**2) / (1 + 1e-4 / 3)), rel=1e-3)
    assert modes.fit_error > 1e-6
    # Of shapes beyond the range, which are no modes, none.
    assert drum_modes._fit(CUP, [drum_modes._Harmonic(1, np.array([2.0]), bent, z)], 0.0, 1.0).fit_error == 0


def test_meshes_and_waves_follow_the_wavelength_of_bending():
    thin = np.hypot(np.sqrt(30 * np.sqrt(12 * (1 - 0.09)) / 0.012), 30 / 0.575)
    assert free_modes.bending_wavenumber(0.012, 0.3, 30.0) == pytest.approx(thin, rel=1e-14)
    plate = np.hypot(np.sqrt(30 * np.sqrt(12 * (1 - 0.09)) / 0.008), 30 / 0.575)
    assert drum_modes._most_waves(CUP, 0.3, 30.0) == pytest.approx(0.112 * plate + 1, rel=1e-14)
    a_wave = 8 / 2 / np.pi
    wanted = a_wave * thin * 0.012, a_wave * thin * 0.06, a_wave * plate * 0.008, a_wave * plate * 0.05
    least = (4, 8, 4, 9)
    counts = [max(n, int(np.ceil(x))) for n, x in zip(least, wanted, strict=True)]
    assert list(drum_modes._first_mesh(CUP, 0.3, 30.0)) == counts
    assert drum_modes._first_mesh(CUP, 0.3, 300.0) > (4, 8, 4, 9)
    # Pressures that dent have waves of 1.75 thicknesses, until bending has shorter ones.
    assert free_modes.shortest_waves(0.012, 0.3, 3.0) == pytest.approx(2 * np.pi / 0.021, rel=1e-14)
    assert free_modes.shortest_waves(0.012, 0.3, 300.0) == free_modes.bending_wavenumber(0.012, 0.3, 300.0)
    # Polynomials of half the wavenumber times the size, and six more; along a long thin shoe, 30 for dents.
    waves, bending = 2 * np.pi / 0.035, free_modes.bending_wavenumber(0.02, 0.3, 20.0)
    wanted = [int(np.ceil(waves * size / 2)) + 6 for size in (0.02, 0.1 * 2.27, 0.0365)]
    assert list(free_modes._degrees(Sector(0.1, 0.02, 0.0365, 2.27), 0.3, 20.0)) == wanted
    assert bending < waves
    assert free_modes._degrees(Sector(1.0, 0.02, 0.0365, 2.27), 0.3, 1.0)[1] == 30


def test_frequencies_change_by_the_largest_of_those_in_range():
    def found(*lists):
        return [drum_modes._Harmonic(n, np.array(each), np.zeros(0), np.zeros(0)) for n, each in enumerate(lists)]

    before, after = found([2.0, 3.3, 9.0], [5.0, 8.0]), found([2.0, 3.0, 7.0], [4.9, 6.5])
    assert drum_modes._largest_change(before, after, 6.0) == pytest.approx(0.1)
    assert drum_modes._largest_change(before, after, 6.6) == pytest.approx(1.5 / 6.5)
    assert drum_modes._largest_change(found([2.0], [5.0]), after, 6.0) == np.inf
    assert drum_modes._largest_change(found([], []), found([], []), 6.0) == 0.0


# --- fits ------------------------------------------------------------------------------------------------------------


def test_as_many_degrees_are_kept_as_hold_all_shapes():
    # Squares of what each degree has: beyond the second one, 3e-5 of the whole is left out.
    energy = np.array([[1.0, 0.0, 1e-8, 0.0], [1.0, 1e-3, 0.0, 1e-11]])
    assert fewest(energy) == 3
    assert fewest(energy, 2e-4) == 2
    assert fewest(np.zeros((0, 4))) == 0
    np.testing.assert_array_equal(
        signs_of(np.array([[0.05, -2.0, 0.0], [-1.0, 1.0, 0.0], [0.3, 1.0, 5.0]])), [-1, -1, 1]
    )


def test_polynomials_are_legendres():
    x = np.array([-0.7, 0.1, 0.9])
    np.testing.assert_allclose(polynomials(x, 6), legendre.legvander(x, 5), rtol=1e-13)
    np.testing.assert_array_equal(polynomials(x, 1), np.ones((3, 1)))


# --- what they are made of -------------------------------------------------------------------------------------------


def test_elements_have_the_material_of_their_set_and_the_others_that_of_the_whole():
    mesh: Any = SimpleNamespace(
        cells=np.zeros((5, 4)), numbers=np.array([11, 12, 13, 14, 15]), volumes=np.arange(1.0, 6.0),
        elements_of={"LINING": np.array([1, 3]), "RIB": np.array([3, 4]), "WEB": np.array([0, 4])}.__getitem__,
    )  # fmt: skip
    whole, lining, web = Material(2e11, 0.3, 7800.0), Material(1e9, 0.2, 2000.0), Material(9e10, 0.1, 3000.0)
    masses = masses_of(mesh, {"LINING": lining, EVERYWHERE: whole, "WEB": web})
    np.testing.assert_allclose(masses, [3000.0, 2 * 2000.0, 3 * 7800.0, 4 * 2000.0, 5 * 3000.0])
    with pytest.raises(RequestError, match="1 elements of the mesh have no material, the first is number 13"):
        masses_of(mesh, {"LINING": lining, "WEB": web})
    with pytest.raises(RequestError, match="set RIB are of two materials"):
        masses_of(mesh, {"LINING": lining, "RIB": web})
    for wrong in (Material(0.0, 0.3, 1.0), Material(1.0, 0.3, 0.0), Material(1.0, 0.5, 1.0), Material(1.0, -1.0, 1.0)):
        with pytest.raises(RequestError, match="no such material"):
            masses_of(mesh, {EVERYWHERE: wrong})


class _Known(SimpleNamespace):
    """A table that can be a key."""

    def __hash__(self) -> int:
        return id(self)


def test_a_file_of_modes_and_a_mesh_are_asked_up_to_twice_the_frequency_of_the_scene(monkeypatch):
    own = SimpleNamespace(young=3e9, poisson=0.4, up_to=900.0)
    set_of: Any = SimpleNamespace(set="RIB", young=5e9, poisson=0.1, density=70.0)
    monkeypatch.setattr(trial_shapes, "find_given_modes", lambda *given: given)
    monkeypatch.setattr(trial_shapes, "find_free_solid", lambda *given: given)

    def asked(elastic, modes=None, mesh=None):
        shoe = SimpleNamespace(modes=modes, elastic=elastic, mesh=mesh, density=50.0, thickness=0.02)
        shoe.solid, shoe.with_radii = modes or mesh, SimpleNamespace(spring=(), force=())
        scene = SimpleNamespace(shoe=shoe, elastic_table=lambda body: (f"{body}.elastic", elastic))
        return trial_shapes.trial_shoe(cast("Any", scene))

    modes, sizes = _Known(read=lambda: "results"), {"outer_radius": 0.1, "arc_angle": 1.0, "width": 0.04}
    assert asked(None, modes=modes) == ("results", 0.0)
    assert asked(own, modes=modes) == ("results", 1800.0)
    plain, ribbed = (
        _Known(read=lambda: "mesh", sizes=lambda: sizes, lining="LINING", material=each) for each in ((), (set_of,))
    )
    rigid = {EVERYWHERE: Material(trial_shapes.UNBENT, 0.0, 50.0)}
    assert asked(None, mesh=plain) == ("mesh", rigid, "LINING", 0.0, None, None)
    both = {"RIB": Material(5e9, 0.1, 70.0), EVERYWHERE: Material(3e9, 0.4, 50.0)}
    # Waves of 1.75 times 20 mm: 0.1 and 0.04 m take two polynomials for each.
    assert asked(own, mesh=ribbed) == ("mesh", both, "LINING", 1800.0, (10, 5), None)
    scaled = trial_shapes._materials((set_of,), Material(3e9, 0.4, 50.0), 1e9, 10.0)
    assert scaled == (("RIB", Material(5.0, 0.1, 7.0)), (EVERYWHERE, Material(3.0, 0.4, 5.0)))


def test_sets_are_read_off_whole_numbers_one_for_each_element():
    arrays = {"part": np.array([0, 2, 3, 2]), "flat": np.zeros((4, 2), int), "heat": np.array([0.0, 1.0, 2.0, 0.0])}
    found = _of_arrays(arrays, values=True)
    assert {name: each.tolist() for name, each in found.items()} == {
        "part": [1, 2, 3], "part 0": [0], "part 2": [1, 3], "part 3": [2],
    }  # fmt: skip
    assert set(_of_arrays(arrays, values=False)) == {"part"}


def test_shapes_of_a_coarse_mesh_are_known_at_its_ends_however_short_the_waves_of_loads():
    # Ten edges along the arc and three across, with five Gauss points each, and a shape that is a square in each edge.
    (x, w), surface = legendre.leggauss(5), Surface(0.1, 2.0, 0.04, 0.0, (10.0, 3.0))
    along, across = (
        (length * ((np.arange(n)[:, None] + (1 + x) / 2) / n - 0.5)).ravel() for length, n in ((2.0, 10), (0.04, 3))
    )
    theta, z = (each.ravel() for each in np.meshgrid(along, across, indexing="ij"))
    weight = np.outer(np.tile(w, 10), np.tile(w, 3)).ravel() * 2.0 / 20 * 0.04 / 6
    nodes = np.linspace(-1, 1, 21)
    bent = np.cos(3 * nodes)
    edge = np.clip(((theta + 1) * 5).astype(int), 0, 9)
    at = (theta + 1) * 5 - edge
    parts = (1 - at) * (1 - 2 * at), 4 * at * (1 - at), at * (2 * at - 1)
    u = sum(part * bent[2 * edge + k] for k, part in enumerate(parts))
    sampled = Sampled(theta, z, weight, np.stack([u, 0 * u, 0 * u])[None])
    found, (error,) = project(sampled, surface, follow=(39, 7))
    ends = legendre.legval2d([1.0, 1.0, -1.0], [1.0, 0.0, 1.0], found[0, 0])
    # Squares within an edge of 0.2 miss a cosine by 27 times 0.2³/(72 √3), 1.7e-3; at the ends polynomials miss more.
    assert error < 2e-3
    np.testing.assert_allclose(ends, np.cos(3), atol=5e-3)
