"""Finite elements, their fits and what is made of them, against fields that are known exactly."""

import functools
from itertools import pairwise
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.polynomial import legendre
from scipy import linalg, sparse

from drumsqueal.errors import RequestError
from drumsqueal.physics import trial_shapes
from drumsqueal.physics.bodies import drum_modes, free_modes
from drumsqueal.physics.bodies.drum_modes import Cup, drum_shapes_at, lines_of, modes_of_harmonic, section_of
from drumsqueal.physics.bodies.elements import (
    AT_ONCE,
    REFERENCES,
    SMALL_SHIFT,
    assemble,
    factorised,
    jacobians,
    lowest_modes,
    quadrature,
    residual_shapes,
)
from drumsqueal.physics.bodies.lining_surface import CylinderSurface, SampledSurface, project
from drumsqueal.physics.bodies.mode_shapes import Sector, fewest, signs_of
from drumsqueal.physics.bodies.mode_shapes import legendre as polynomials
from drumsqueal.physics.bodies.solid_elements import EVERYWHERE, Material, inertia_of, masses_of, rigid_motions
from drumsqueal.physics.bodies.solid_mesh import _of_arrays

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


@pytest.mark.parametrize("dense", [False, True])
def test_lowest_modes_are_those_of_a_dense_routine(dense):
    # A chain of ten masses that nothing holds.
    masses, springs = np.arange(1.0, 11.0), np.arange(2.0, 11.0)
    stiffness = np.diag(np.append(springs, 0) + np.append(0, springs)) - np.diag(springs, 1) - np.diag(springs, -1)
    values, vectors = linalg.eigh(stiffness, np.diag(masses))
    highest = (values[4] + values[5]) / 2
    shifted = stiffness + SMALL_SHIFT * highest * np.diag(masses)
    both = sparse.csr_array(stiffness), sparse.csr_array(np.diag(masses))
    solve: Any = functools.partial(np.linalg.solve, shifted) if dense else factorised(*both, highest)
    found, shapes = lowest_modes(*both, highest, np.full((10, 1), 1 / np.sqrt(masses.sum())), 1, solve)
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
FEW = 50.0, 0.0  # waves (1/m) that few polynomials follow


@pytest.fixture(scope="module")
def section():
    return section_of(CUP, 0.3, *FEW)


def of_field(field):
    """What makes polynomials (3, powers of r, powers of z) of the section's functions (unknowns,)."""
    radial, axial = lines_of(CUP, *FEW)
    whole = np.einsum("cab,ai,bj->cij", field, *(of_powers(line, field.shape[1]) for line in (radial, axial)))
    i, j = np.meshgrid(*(np.arange(n) for n in whole.shape[1:]), indexing="ij")
    free = (i > 0) & ((i >= radial.corner) | (j >= axial.corner))
    return whole[:, free].ravel()


def of_powers(line, count):
    """1, s, s² … (count, functions), by their Legendre coefficients in each cell."""
    table = np.concatenate([line.polynomials(cell) for cell in range(len(line.ends) - 1)])
    found = []
    for power in range(count):
        parts = []
        for cell, (low, high) in enumerate(pairwise(line.ends)):
            inner = np.polynomial.Polynomial([(low + high) / 2, (high - low) / 2]) ** power
            part = legendre.poly2leg(inner.coef)
            parts.append(np.pad(part, (0, len(line.polynomials(cell)) - len(part))))
        found.append(np.linalg.lstsq(table, np.concatenate(parts))[0])
    return np.array(found)


def on_section(integrand):
    """∫ … r dr dz over ring and plate."""
    R, h, b, plate, hub = CUP
    x, w = legendre.leggauss(16)
    total = 0.0
    for (r0, r1), (z0, z1) in (((R, R + h), (-b / 2, b / 2)), ((hub, R + h), (b / 2, b / 2 + plate))):
        r, z = ((r0 + r1 + (r1 - r0) * x) / 2)[:, None], (z0 + z1 + (z1 - z0) * x) / 2
        total += np.einsum("ij,i,j->", integrand(r, z) * r, w, w) * (r1 - r0) * (z1 - z0) / 4
    return total


@pytest.mark.parametrize("n", [0, 1, 3])
def test_energies_of_a_section_are_those_of_fields_that_are_known(section, n):
    # Any polynomials that vanish at the hub: (r − hub) times those of degree 2 in r and z, of the order of 1.
    rest = np.random.default_rng(n).normal(0, 1, (3, 2, 3)) / 0.1 ** np.add.outer(np.arange(1, 3), np.arange(3))
    field = np.pad(rest, ((0, 0), (1, 0), (0, 0))) - CUP.hub_radius * np.pad(rest, ((0, 0), (0, 1), (0, 0)))
    u = of_field(field)
    lam, G = 0.3 / (1.3 * 0.4), 1 / 2.6

    def at(c, r, z, along_r=0, along_z=0):
        d = np.polynomial.polynomial.polyder(
            np.polynomial.polynomial.polyder(field[c], along_r, axis=0), along_z, axis=1
        )
        return np.polynomial.polynomial.polyval2d(r + 0 * z, z + 0 * r, d)

    def energy(r, z):
        U, V, W = (at(c, r, z) for c in range(3))
        normal = at(0, r, z, 1), (U + n * V) / r, at(2, r, z, 0, 1)
        shear = at(0, r, z, 0, 1) + at(2, r, z, 1), at(1, r, z, 1) - V / r - n * U / r, at(1, r, z, 0, 1) - n * W / r
        return lam * sum(normal) ** 2 + 2 * G * sum(each**2 for each in normal) + G * sum(each**2 for each in shear)

    constant, linear, square = section.stiffness
    # 1/r² is no polynomial: 24 Gauss points more than there are functions.
    assert u @ (constant + n * linear + n**2 * square) @ u == pytest.approx(on_section(energy), rel=1e-10)
    mass = on_section(lambda r, z: sum(at(c, r, z) ** 2 for c in range(3)))
    assert u @ section.mass @ u == pytest.approx(mass, rel=1e-12)
    # On the ring's inner side: its Legendre coefficients in z.
    half = np.polynomial.Polynomial([0, CUP.width / 2])
    inner = np.einsum("cab,a->cb", field, CUP.inner_radius ** np.arange(3.0))
    wanted = [legendre.poly2leg((np.polynomial.Polynomial(each)(half)).coef) for each in inner]
    across = section.moments * (np.arange(section.moments.shape[1]) + 0.5)
    found = np.array(np.split(u, 3))[:, section.inside] @ across
    np.testing.assert_allclose(found[:, :3], wanted, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(found[:, 3:], 0, atol=1e-10)


@pytest.mark.parametrize("n", [0, 1, 3])
def test_modes_of_a_harmonic_have_unit_mass_around(monkeypatch, n):
    monkeypatch.setattr(drum_modes, "FINEST", 0.1)
    monkeypatch.setattr(drum_modes, "MORE_DEGREES", 3)
    section = section_of(CUP, 0.3, *FEW)
    constant, linear, square = (each.toarray() for each in section.stiffness)
    stiffness, mass = constant + n * linear + n**2 * square, section.mass.toarray()
    values, vectors = linalg.eigh(stiffness, mass, subset_by_index=[0, 3])
    found, across = modes_of_harmonic(section, n, np.sqrt((values[2] + values[3]) / 2), 1)
    np.testing.assert_allclose(found, np.sqrt(values[:3]), rtol=1e-8)
    inside = np.array(np.split(vectors[:, :3] / np.sqrt(2 * np.pi if n == 0 else np.pi), 3))[:, section.inside]
    # The first that moves much at the open edge, which one function alone moves there, is positive.
    signs = signs_of(inside[:, 0])
    wanted = np.einsum("cjm,jk->mck", inside * signs, section.moments) * (np.arange(section.moments.shape[1]) + 0.5)
    np.testing.assert_allclose(across, wanted, atol=1e-6 * np.abs(wanted).max())
    edge = np.sum(across * (-1.0) ** np.arange(across.shape[2]), axis=2)
    np.testing.assert_array_equal(signs_of(edge.T), 1)


def test_pressures_add_how_a_harmonic_yields_to_them(section):
    highest = 12.0
    modes, both = (modes_of_harmonic(section, 2, highest, 3, count) for count in (0, 4))
    assert len(both[0]) == len(modes[0]) + 4
    np.testing.assert_allclose(both[0][: len(modes[0])], modes[0], rtol=1e-12)
    # What P_k(2z/b) cos 2θ does is answered as by all functions: Σ (∫ p u_r dA)²/(k² + s), with s as in `factorised`.
    loads = np.zeros((section.mass.shape[0], 4))
    loads[section.inside] = section.moments[:, :4]
    constant, linear, square = section.stiffness
    shift = SMALL_SHIFT * highest**2
    exact = loads.T @ factorised(constant + 2 * linear + 4 * square, section.mass, highest**2)(loads)
    work = both[1][:, 0, :4] * np.sqrt(np.pi) / (np.arange(4) + 0.5)
    np.testing.assert_allclose((work.T / (both[0] ** 2 + shift)) @ work, exact, rtol=1e-9, atol=1e-9 * exact.max())


def test_shapes_of_a_harmonic_come_with_their_twins():
    rows = np.random.default_rng(1).normal(0, 1, (2, 3, 5))
    angle, z = np.array([0.3, -1.1]), np.array([0.011, -0.02])
    across = [[legendre.legval(z / 0.03, each) for each in row] for row in rows]
    for n in (0, 2):
        found = drum_shapes_at(drum_modes._around(rows, np.full(2, n), 3), 0.03, angle, z)
        cosine, sine = np.cos(n * angle), np.sin(n * angle)
        wanted = []
        for u, v, w in across:
            wanted += [(u, v, w)] if n == 0 else [(u * cosine, v * sine, w * cosine), (u * sine, -v * cosine, w * sine)]
        np.testing.assert_allclose(found, np.moveaxis(np.array(wanted), 2, 0).transpose(0, 2, 1), atol=1e-12)


def test_cells_and_waves_follow_the_wavelength_of_bending():
    thin = np.hypot(np.sqrt(30 * np.sqrt(12 * (1 - 0.09)) / 0.012), 30 / 0.575)
    assert free_modes.bending_wavenumber(0.012, 0.3, 30.0) == pytest.approx(thin, rel=1e-14)
    plate = np.hypot(np.sqrt(30 * np.sqrt(12 * (1 - 0.09)) / 0.008), 30 / 0.575)
    assert CUP.most_waves(0.3, 30.0) == pytest.approx(0.112 * plate + 1, rel=1e-14)
    radial, axial = lines_of(CUP, 100.0, 300.0)
    # Tenths towards hub and corner, down to some 0.4 % of 8 mm: two of 8 mm, and three of the other sizes.
    ends = [50, 50.05, 50.5, 55, 95, 99.5, 99.95, 100, 100.012, 100.12, 101.2, 112]
    np.testing.assert_allclose(radial.ends, np.array(ends) * 1e-3, rtol=1e-12)
    ends = [-30, 24, 29.4, 29.94, 30, 30.08, 30.8, 38]
    np.testing.assert_allclose(axial.ends, np.array(ends) * 1e-3, rtol=1e-12)
    # Half of the wavenumber times the size and six more, of long cells eight, or one more with each cell from where
    # they are smallest. Waves of 300/m are dents, along the ring.
    np.testing.assert_array_equal(np.diff(radial.starts), [2, 3, 4, 10, 4, 3, 2, 2, 3, 4, 7])
    np.testing.assert_array_equal(np.diff(axial.starts), [17, 4, 3, 2, 2, 3, 8])
    assert (radial.corner, axial.corner) == (28, 26)
    # Pressures that dent have waves of 1.75 thicknesses, until bending has shorter ones.
    assert free_modes.shortest_waves(0.012, 0.3, 3.0) == pytest.approx(2 * np.pi / 0.021, rel=1e-14)
    assert free_modes.shortest_waves(0.012, 0.3, 300.0) == free_modes.bending_wavenumber(0.012, 0.3, 300.0)
    # Polynomials of half the wavenumber times the size, and six more; along a long thin shoe, 30 for dents.
    waves, bending = 2 * np.pi / 0.035, free_modes.bending_wavenumber(0.02, 0.3, 20.0)
    wanted = [int(np.ceil(waves * size / 2)) + 6 for size in (0.02, 0.1 * 2.27, 0.0365)]
    assert list(free_modes._degrees(Sector(0.1, 0.02, 0.0365, 2.27), 0.3, 20.0)) == wanted
    assert bending < waves
    assert free_modes._degrees(Sector(1.0, 0.02, 0.0365, 2.27), 0.3, 1.0)[1] == 30


# --- fits ------------------------------------------------------------------------------------------------------------


def test_as_many_degrees_are_kept_as_hold_all_shapes():
    # Squares of what each degree has: beyond the second one, 3e-5 of the whole is left out.
    energy = np.array([[1.0, 0.0, 1e-8, 0.0], [1.0, 1e-3, 0.0, 1e-11]])
    assert fewest(energy) == 3
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
    (x, w), surface = legendre.leggauss(5), CylinderSurface(0.1, 2.0, 0.04, 0.0, (10.0, 3.0))
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
    sampled = SampledSurface(theta, z, weight, np.stack([u, 0 * u, 0 * u])[None])
    found, (error,) = project(sampled, surface, follow=(39, 7))
    ends = legendre.legval2d([1.0, 1.0, -1.0], [1.0, 0.0, 1.0], found[0, 0])
    # Squares within an edge of 0.2 miss a cosine by 27 times 0.2³/(72 √3), 1.7e-3; at the ends polynomials miss more.
    assert error < 2e-3
    np.testing.assert_allclose(ends, np.cos(3), atol=5e-3)
