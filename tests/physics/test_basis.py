"""In which shapes a shoe bends in a brake: its modes and how it yields besides, against all of its unknowns."""

import functools
import re

import equinox as eqx
import numpy as np
import pytest
from numpy.polynomial import legendre

from drumsqueal.coordinates import is_static
from drumsqueal.physics import basis, elasticity
from drumsqueal.physics.bodies import free_modes, mode_shapes
from drumsqueal.physics.bodies.free_modes import find_free_modes
from drumsqueal.physics.bodies.mode_shapes import Sector, shapes_at
from drumsqueal.physics.composition import coordinates_of
from drumsqueal.physics.effects.damping import Damping
from drumsqueal.physics.inventory import free_modes_in_words, take_inventory
from drumsqueal.physics.model import build_model
from drumsqueal.physics.trial_shapes import trial_shoe
from drumsqueal.solve.linear.modes import analyse_stability
from whole_shoe import Brake, WholeShoe, _fields, assemble_polynomials, squeal_eigenvalues

STEEL = {"young": 210e9, "poisson": 0.3}
UP_TO, BELOW = 8e3, 6e3  # Hz: shapes that are kept, and where growth rates are compared
STUBBY = {"shoe.arc_angle": 1.0, "shoe.thickness": 0.04}
DEGREES = (6, 13, 6)  # with (8, 23, 9) growth rates of all unknowns change by 0.02 of 1 1/s or 1 %, or less


def bent(nominal, young=STEEL["young"], up_to=UP_TO):
    """Return the paper's brake with a shoe that bends."""
    return nominal.with_values({"shoe.elastic": {**STEEL, "young": young, "up_to": up_to}})


@pytest.fixture(scope="module")
def stubby(nominal):
    """Return it with a short, thick shoe, which takes few polynomials, and its shapes up to 25 kHz."""
    return bent(nominal.with_values(STUBBY), up_to=25e3)


def bending_of(scene):
    """Return the shapes in which its shoe bends."""
    found = elasticity.shoe_modes(scene)
    assert found is not None
    return found


def whole_shoe(scene):
    """Return the shoe as its witness knows it."""
    shoe = scene.shoe
    sizes = shoe.outer_radius, shoe.thickness, shoe.width, shoe.arc_angle
    return WholeShoe(*sizes, shoe.elastic.young, shoe.elastic.poisson, shoe.density)


def test_shapes_are_orthonormal_and_diagonal_in_stiffness_and_hold_no_rigid_motion(stubby):
    """By the energies of `free_modes`, which are proven by themselves; shapes beyond four times 25 kHz are slowed."""
    found, shoe = bending_of(stubby), stubby.shoe
    sector = Sector(shoe.outer_radius, shoe.thickness, shoe.width, shoe.arc_angle)
    count, degrees = len(found.wavenumbers), found.coefficients.shape[2:]
    assert elasticity.count_modes(stubby, "shoe") in range(1, count - 2)
    mass, stiffness, rigid = np.zeros((count, count)), np.zeros((count, count)), []
    motions = free_modes._rigid_motions(sector, degrees)
    for parity in free_modes.PARITIES:
        stiff, heavy, places = free_modes._energies(sector, shoe.elastic.poisson, degrees, parity)
        mine, moved = found.coefficients.reshape(count, -1)[:, places], motions[places]
        mass, stiffness = mass + mine @ (heavy @ mine.T), stiffness + mine @ stiff @ mine.T
        sizes = np.sqrt(np.sum(moved * (heavy @ moved), axis=0))
        rigid.append(mine @ (heavy @ moved)[:, sizes > 0] / sizes[sizes > 0])
    # Each with so much of unit mass as is kept of it.
    hertz = np.array(elasticity.elastic_frequencies(stubby, "shoe"))
    slowed = np.isclose(hertz, 4 * 25e3, rtol=1e-9)
    assert np.all(hertz[~slowed] < 4 * 25e3)
    np.testing.assert_allclose(np.diag(mass)[~slowed], 1, rtol=1e-9)
    assert np.all(np.diag(mass)[slowed] < 1)
    size = np.sqrt(np.diag(mass))
    np.testing.assert_allclose(mass / size / size[:, None], np.eye(count), atol=1e-9)
    scale = found.wavenumbers
    np.testing.assert_allclose(stiffness / scale / scale[:, None], np.eye(count), atol=1e-8)
    for each in rigid:
        np.testing.assert_allclose(each / size[:, None], 0, atol=1e-9)


def test_the_first_of_them_are_free_modes_in_the_order_and_with_the_signs_of_these(stubby):
    found, shoe = bending_of(stubby), stubby.shoe
    sector = Sector(shoe.outer_radius, shoe.thickness, shoe.width, shoe.arc_angle)
    highest = 2 * np.pi * 25e3 * np.sqrt(shoe.density / STEEL["young"])
    alone = find_free_modes(sector, STEEL["poisson"], highest)
    count = len(alone.wavenumbers)
    assert elasticity.count_modes(stubby, "shoe") == count
    assert [is_static(name) for name in elasticity.elastic_names(stubby)] == [
        k >= count for k in range(len(found.wavenumbers))
    ]
    # Polynomials of these shapes are fewer: `free_modes` says by how much that changes a frequency.
    np.testing.assert_allclose(found.wavenumbers[:count], alone.wavenumbers, rtol=5e-5)
    degrees = np.minimum(found.coefficients.shape[2:], alone.coefficients.shape[2:])
    one, other = (each.coefficients[:count, :, : degrees[0], : degrees[1], : degrees[2]] for each in (found, alone))
    np.testing.assert_allclose(one, other, atol=2e-3 * np.max(np.abs(other)))
    assert found.symmetric[:count] == alone.symmetric


def dents(scene, shapes, along):
    """Return how far a smooth pressure of so many half waves along the arc dents the lining (m), in shapes and in all.

    Radial displacements at Gauss's points of the frictionless brake in full contact, and the area of each.
    """
    shoe, brake, (beta, width) = whole_shoe(scene), Brake(), (scene.shoe.arc_angle, scene.shoe.width)
    (x, wx), (y, wy) = (legendre.leggauss(n) for n in (32, 10))
    theta, z = (each.ravel() for each in np.meshgrid(x * beta / 2, y * width / 2, indexing="ij"))
    area = np.outer(wx, wy).ravel() * shoe.outer_radius * beta / 2 * width / 2
    pressure = 1e5 * np.cos(along * np.pi * theta / beta) * (1 - (z / width) ** 2)
    every = every_unknown(shoe)
    (u_x, u_y, u_z), *_ = _fields(shoe, DEGREES, [np.ones(1), x, y], even=True)
    of_all = np.hstack([np.cos(theta)[:, None] * u_x, np.sin(theta)[:, None] * u_y, 0 * u_z])
    springs = np.stack([every.push, shoe.outer_radius * every.turn])
    # X, Y and Tz about the centre of gravity, and shapes of unit mass.
    R, h = shoe.outer_radius, shoe.thickness
    centroid = 4 * (h**2 - 3 * h * R + 3 * R**2) / (3 * beta * (2 * R - h)) * np.sin(beta / 2)
    rigid = np.stack([np.cos(theta), np.sin(theta), -centroid * np.sin(theta)], axis=1)
    sector = Sector(R, h, width, beta)
    bending = shapes_at(shapes.coefficients, sector, R, theta, z)[:, 0] / np.sqrt(shoe.density)
    own = np.hstack([rigid, bending])
    held = np.eye(2, own.shape[1])[:, [0, 2, 1, *range(3, own.shape[1])]] * np.array([[1.0], [R]])
    squares = np.concatenate([np.zeros(3), shapes.wavenumbers**2 * shoe.young / shoe.density])
    moved = [
        rows
        @ np.linalg.solve(
            stiffness + brake.contact * (rows.T * area) @ rows + brake.support * push.T @ push,
            rows.T @ (area * pressure),
        )
        for rows, stiffness, push in ((own, np.diag(squares), held), (of_all, every.stiffness, springs))
    ]
    return *moved, area


@functools.cache
def every_unknown(shoe):
    """Return matrices of motion in the plane."""
    return assemble_polynomials(shoe, DEGREES, even=True)


def missed(*dented):
    """Return by how much shapes miss it, root mean squares compared."""
    found, wanted, area = dented
    return np.sqrt(area @ (found - wanted) ** 2 / (area @ wanted**2))


def test_the_pressure_of_the_load_dents_the_lining_as_all_unknowns_do(nominal):
    """Within the shapes that are kept, where free modes alone miss some of it."""
    scene = bent(nominal)
    kept = bending_of(scene)
    count = elasticity.count_modes(scene, "shoe")
    alone = free_modes.FreeModes(kept.wavenumbers[:count], kept.coefficients[:count], kept.symmetric[:count])
    # 0.28 % and 1.8 % were found.
    assert missed(*dents(scene, kept, 0)) < 5e-3
    assert missed(*dents(scene, alone, 0)) > 1e-2


@pytest.mark.parametrize("along", [1, 2, 4])
def test_trial_shapes_hold_the_dents_of_smooth_pressures(nominal, along):
    scene = bent(nominal)
    # 6e-6, 8e-6 and 7e-4 were found, and with 21 polynomials along the arc for all unknowns 2e-5 of the last.
    assert missed(*dents(scene, trial_shoe(scene), along)) < 1e-3


MATERIALS = {"steel": 210e9, "aluminium": 70e9, "plastic": 20e9}


@pytest.mark.thorough
@pytest.mark.parametrize("young", MATERIALS.values(), ids=MATERIALS)
def test_growth_rates_are_those_of_all_unknowns_where_free_modes_alone_miss(nominal, young):
    scene = bent(nominal, young)
    shoe, every = whole_shoe(scene), coordinates_of(scene)
    parities = (assemble_polynomials(shoe, DEGREES, even=even) for even in (True, False))
    wanted = np.concatenate([squeal_eigenvalues(each, shoe, Brake(), BELOW, 14) for each in parities])
    kept, alone = (
        analyse_stability(build_model(scene, coordinates=names)).eigenvalues
        for names in (every, tuple(name for name in every if not is_static(name)))
    )
    assert np.sum((kept.imag > 1) & (kept.imag < 2 * np.pi * BELOW)) == len(wanted)
    # 0.13, 0.25 and 0.38 were found, and 2.0, 5.1 and 1.2 of free modes alone.
    assert farthest(kept, wanted) < 0.5
    assert farthest(alone, wanted) > 1


def farthest(found, wanted):
    """Return the largest |Δσ| over 1 1/s or 1 % of it, each of the nearest."""
    near = found[np.argmin(np.abs(wanted[:, None] - found), axis=1)]
    return np.max(np.abs(near.real - wanted.real) / np.maximum(1, 0.01 * np.abs(wanted.real)))


def test_shapes_are_found_anew_for_another_brake_and_no_other(nominal):
    scene, asked = bent(nominal), []
    shapes = basis.once(lambda each: asked.append(each) or object())
    alike = {"drum.speed": 7.0}, {"contact.normal_load": 1234.0}, {"simulate.duration": 0.5}
    others = {"steady.state": "self-consistent"}, {"shoe.density": 7000.0}, {"shoe.elastic.up_to": 7e3}
    assert all(shapes(scene.with_values(each)) is shapes(scene) for each in alike)
    assert len({id(shapes(scene.with_values(each))) for each in others} | {id(shapes(scene))}) == 4
    assert len(asked) == 4


@pytest.mark.thorough
def test_what_keeps_static_shapes_still_changes_no_growth_rate_below_them(nominal, monkeypatch):
    """Damping of modes that are mostly such shapes, and more mass of those that would ring four times as high."""
    scene = bent(nominal)
    model = build_model(scene, coordinates=coordinates_of(scene))
    (place,) = (k for k, each in enumerate(model.others) if isinstance(each, Damping))
    undamped = eqx.tree_at(lambda one: one.others[place].matrix, model, replace_fn=np.zeros_like)
    monkeypatch.setattr(basis, "HEAVIER", np.inf)
    monkeypatch.setattr(mode_shapes, "folder", None)
    monkeypatch.setattr(basis, "_kept", basis.once(basis._kept.__wrapped__))
    light = build_model(scene, coordinates=coordinates_of(scene))
    usual, *others = (analyse_stability(each).eigenvalues for each in (model, undamped, light))
    usual = usual[usual.imag > 1]
    below = usual.imag < 2 * np.pi * UP_TO
    for other in others:
        near = other[np.argmin(np.abs(usual[:, None] - other), axis=1)]
        change = np.abs(near.real - usual.real)
        # 0.08 and 0.002 were found, of 1/s.
        assert np.max(change[below]) < 0.2
        assert np.max(change[~below]) > 1000


@pytest.mark.parametrize(
    ("shape", "up_to", "included", "said"),
    [
        # Shapes that other tests ask for, too: to find some takes a second.
        (
            {},
            UP_TO,
            "bending of the shoe, free modes up to 8000 Hz",
            r"E1 2172 Hz, .* in the plane; .* out of it; S\d+ to S\d+: how it yields besides",
        ),
        ({}, 200.0, "", "so it is rigid here"),
        (
            STUBBY,
            1.6e3,
            "bending of the shoe, nearly static (no free mode up to 1600 Hz)",
            r"no free mode up to 1600 Hz; S1 to S\d+: how it yields to",
        ),
    ],
)
def test_words_tell_modes_from_how_the_shoe_yields(nominal, shape, up_to, included, said):
    scene = bent(nominal.with_values(shape), up_to=up_to)
    assert re.search(said, str(free_modes_in_words(scene)))
    found = take_inventory(scene)
    assert not included or included in found.includes
    assert included or f"bending of the shoe (no free mode up to {up_to:g} Hz)" in found.leaves_out


@pytest.mark.parametrize(("energies", "count"), [((1 + 1e-9, 1 - 1e-9), 3), ((1.02, 0.98), 2), ((0.98, 0.98), 1)])
def test_of_a_pair_of_equal_energy_at_the_threshold_both_shapes_are_kept(energies, count):
    """As cos and sin of a drum with the same shoes all around; of two that differ the lower one is left out."""
    part = basis.BodyPart(np.arange(4), np.array([1.0, 2.0, 2.0, 3.0]), None)
    # Motions of one shape each, beyond the first: one of energy 1, and two next to the threshold.
    sizes = np.array([1.0, *(basis.NEGLIGIBLE * np.sqrt(energies))])
    moved = np.eye(4)[:, 1:] * sizes / part.own[1:]
    (found,) = basis.yielding(part, 1, np.diag(part.own**2), moved, np.zeros(4, dtype=int))
    assert found.shape == (4, count)
