"""A shoe that bends on a drum that bends, and several shoes, with random shapes, against sums in NumPy."""

import dataclasses
from types import SimpleNamespace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.bodies.brake import Brake, share
from drumsqueal.physics.bodies.drum_modes import ElasticDrum
from drumsqueal.physics.bodies.elastic_shoe import ElasticShoe
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.effects.forcing import Preload
from drumsqueal.physics.effects.friction import Friction, Tangential
from drumsqueal.physics.effects.operation import Constant, Operation, PiecewiseLinear
from drumsqueal.physics.effects.pressure import Bonded, Unilateral
from drumsqueal.physics.effects.several import Contacts, OnOne
from drumsqueal.physics.friction_law import ConstantLaw
from drumsqueal.physics.quadrature.cells import Cells
from drumsqueal.physics.quadrature.independent import FixedGrid
from drumsqueal.physics.shoe_building import (
    DRUM_SHAPES,
    DRUM_WAVENUMBERS,
    SHAPES,
    WAVENUMBERS,
    along_points,
    build_shoe,
)
from lining import drum_shapes, lining_shapes

RIGID, ELASTIC, DRUM = ("X", "Z", "Tx", "Tz"), ("E1", "E3"), ("drum.E1", "drum.E2", "drum.E4")
NAMES, POSITION, CELLS = (*RIGID, *ELASTIC, *DRUM), 0.8, Cells(3, 2, 4)
Q = np.array([0.3, -0.7, 1.1, 0.9, -0.4, 0.8, 0.5, -1.2, 0.6])


def random(seed, *shape):
    return np.random.default_rng(seed).uniform(-1, 1, shape)


@eqx.filter_jit
def shoe_of(shapes, of_drum, cells=CELLS):
    rigid = RigidShoe(0.11, 0.017, 0.043, 2.1, 7300.0, RIGID)
    drum = ElasticDrum(DRUM, jnp.asarray([900.0, 1300.0, 2100.0]), of_drum, 0.06, 0.004)
    frequencies = jnp.asarray([3000.0, 5000.0])
    return ElasticShoe.of(rigid, ELASTIC, frequencies, shapes, (True, False), drum, cells, POSITION)


@pytest.fixture(scope="module")
def shoe():
    # Shapes of the drum that are the same as seen from the shoe, wherever that is: turned by its position.
    return jax.tree.map(np.asarray, shoe_of(random(1, 2, 3, 2, 4, 3), random(2, 3, 3, 5, 3)))


def shapes_of(shoe, theta, z):
    """u_r, u_θ, u_z (3, n, points) of the lining over the drum."""
    found = lining_shapes(shoe, theta, z)
    found[:, -3:] = -drum_shapes(shoe, theta + POSITION, z)
    return found


@Interpreted
def all_of(shoe, q, load, drag, lateral):
    nodes = shoe.cells.nodes(shoe)
    levels = shoe.radial(q), shoe.along(q, 2.5), shoe.axial(q)
    spread = {name: each.density for name, each in shoe.tractions(nodes, load, drag, lateral).items()}
    return {
        "nodes": (nodes.theta, nodes.z, nodes.weight),
        "levels": [level.values for level in levels],
        "resultants": (shoe.radial_resultant(), shoe.tangential_resultant()),
        "stiffness": shoe.radial_stiffness(),
        "elastic": (shoe.elastic_stiffness(), shoe.elastic_stiffness(of_drum=False)),
        "force": shoe.resultant(spread),
        "range": shoe.ends_and_extremes(levels[0], spatial=True),
        "bound": shoe.bound(levels[0]),
        "held": shoe.shapes_at(jnp.asarray([0.05, 0.09, -0.03])),
        "mass": shoe.mass,
        "following": shoe.velocity_with_drum,
    }


def test_a_shoe_that_bends_is_what_its_shapes_are(shoe):
    assert shoe.names == NAMES
    assert shoe.symmetric == (True, False, False, True, True, False, False, False, False)
    x, w = np.polynomial.legendre.leggauss(4)
    theta = (2.1 / 3 * (np.arange(3)[:, None] + (1 + x) / 2) - 1.05).ravel()
    z = (0.043 / 2 * (np.arange(2)[:, None] + (1 + x) / 2) - 0.0215).ravel()
    along, across = np.tile(w * 2.1 / 6, 3), np.tile(w * 0.043 / 4, 2)

    def by_cell(at_z, at_theta):
        """In the order of cells across, cells along, nodes across, nodes along."""
        both = at_z[:, None] * at_theta
        return both.reshape(2, 4, 3, 4).transpose(0, 2, 1, 3).ravel()

    nodes = by_cell(1 + 0 * z, theta), by_cell(z, 1 + 0 * theta), 0.11 * by_cell(across, along)
    load, drag, lateral = (random(seed, nodes[0].size) for seed in (3, 4, 5))
    found = jax.tree.map(np.asarray, all_of(shoe, Q, load, drag, lateral))
    for one, other in zip(found["nodes"], nodes, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-15)
    radial, around, axial = shapes_of(shoe, *nodes[:2])
    levels = Q @ radial, Q @ around - 0.11 * 2.5, Q @ axial
    for one, other in zip(found["levels"], levels, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-11)
    for one, other in zip(found["resultants"], (radial @ nodes[2], around @ nodes[2]), strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found["stiffness"], (radial * nodes[2]) @ radial.T, rtol=0, atol=1e-13)
    wanted = np.diag([0, 0, 0, 0, 3000.0**2, 5000.0**2, 900.0**2, 1300.0**2, 2100.0**2])
    np.testing.assert_allclose(found["elastic"][0], wanted)
    np.testing.assert_allclose(found["elastic"][1], wanted * (np.arange(9) < 6))
    np.testing.assert_allclose(found["force"], around @ drag + axial @ lateral - radial @ load, rtol=0, atol=1e-12)
    both = np.meshgrid(np.linspace(-1.05, 1.05, 121), np.linspace(-0.0215, 0.0215, 41))
    dense = shapes_of(shoe, *(each.ravel() for each in both))
    level = Q @ dense[0]
    # Cells of four nodes along each side: polynomials are off by a few parts in a hundred.
    assert found["range"][0] <= np.min(levels[0])
    assert found["range"][1] >= np.max(levels[0])
    np.testing.assert_allclose(found["range"], [level.min(), level.max()], atol=0.15 * np.ptp(level))
    assert np.abs(levels[0]).max() <= found["bound"] < 3 * np.abs(level).max()
    inertia = shoe.rigid.inertia
    masses = [float(getattr(inertia, name)) for name in RIGID]
    np.testing.assert_allclose(found["mass"], [*masses, 1, 1, 1, 1, 1], rtol=1e-12)
    np.testing.assert_array_equal(found["following"], [0, 0, 0, 1, 0, 0, 0, 0, 0])
    c = float(shoe.centroid)
    turned = np.array([[1, 0, 0, -0.09], [0, 0, 0.03, 0.05 - c], [0, 1, 0.09, 0]])
    np.testing.assert_allclose(found["held"][:, :4], turned, rtol=1e-12, atol=1e-15)
    np.testing.assert_array_equal(found["held"][:, 6:], 0.0)
    assert np.abs(found["held"][:, 4:6]).min() > 0


def test_points_of_shoe_and_drum_move_by_their_own_coordinates(shoe):
    theta, z = np.array([0.4, -0.9, 1.0]), np.array([0.01, -0.02, 0.0])
    q = dict(zip(NAMES, Q, strict=True))
    shapes = shapes_of(shoe, theta, z)
    lining, drum = np.einsum("n,kni->ki", Q[:6], shapes[:, :6]), -np.einsum("n,kni->ki", Q[6:], shapes[:, 6:])
    np.testing.assert_allclose(shoe.displacement(q, theta, z), lining, rtol=0, atol=1e-11)
    np.testing.assert_allclose(shoe.of_drum(q, theta, z), drum, rtol=0, atol=1e-11)
    np.testing.assert_allclose(shoe.over_drum(q, theta, z), lining - drum, rtol=0, atol=1e-11)
    np.testing.assert_array_equal(shoe.of_drum({"X": 1.0}, theta, z), [0.0, 0.0, 0.0])
    # On the lining's points the largest of a record, more than a block of it, and of one coordinate.
    both = np.meshgrid(np.linspace(-1.05, 1.05, 65), 0.043 * np.array([-0.5, -0.25, 0, 0.25, 0.5]), indexing="ij")
    angle, height = (each.ravel() for each in both)
    every = shapes_of(shoe, angle, height)
    into, along = shoe.surface()
    np.testing.assert_allclose(into, every[0].T, rtol=0, atol=1e-11)
    np.testing.assert_allclose(along, every[1].T, rtol=0, atol=1e-11)
    swing = np.cos(np.arange(5000.0))
    largest = shoe.largest({"X": 0.3 * swing, "E3": 2.0, "drum.E2": swing**2})
    moved = np.outer(0.3 * swing, into[:, 0]) + 2 * into[:, 5] + np.outer(swing**2, into[:, 7])
    np.testing.assert_allclose(largest[0], np.abs(moved).max(axis=1), rtol=1e-12)
    moved = np.outer(0.3 * swing, along[:, 0]) + 2 * along[:, 5] + np.outer(swing**2, along[:, 7])
    np.testing.assert_allclose(largest[1], np.abs(moved).max(axis=1), rtol=1e-12)
    assert shoe.surface()[0] is into  # evaluated once
    other = dataclasses.replace(shoe, shapes=2 * shoe.shapes)
    assert not np.allclose(other.surface()[0], into)
    characteristic_lengths = shoe.characteristic_lengths()
    assert characteristic_lengths["Tz"] == 0.11
    assert characteristic_lengths["X"] == 1.0
    assert "E2" not in characteristic_lengths
    for name in ("E3", "drum.E4"):
        k = NAMES.index(name)
        assert characteristic_lengths[name] == pytest.approx(np.hypot(every[0, k], every[1, k]).max(), rel=1e-12)


def test_a_shoe_is_built_of_the_numbers_of_its_kept_coordinates():
    names, along = ("X", "Tz", "E1", "E3", "drum.E2"), random(11, 2, 3)
    composition: Any = SimpleNamespace(
        coordinates=names, mesh=False, symmetric_modes=(True, False, False), springs=1, pushes=2
    )
    keys, numbers = ("outer_radius", "thickness", "width", "arc_angle", "density"), (0.11, 0.017, 0.043, 2.1, 7300.0)
    sizes = dict(zip(keys, numbers, strict=True))
    shapes, of_drum = random(12, 3, 3, 2, 4, 3), random(13, 3, 3, 5, 3)
    value = {f"shoe.{key}": each for key, each in sizes.items()} | {
        "shoe.position": 0.8, "shoe.elastic.young": 2e11, WAVENUMBERS: np.array([1.0, 2.0, 3.0]), SHAPES: shapes,
        "drum.elastic.young": 1e11, "drum.elastic.density": 7000.0, "drum.elastic.width": 0.06,
        "drum.elastic.offset": 0.004, DRUM_WAVENUMBERS: np.array([4.0, 5.0, 6.0]), DRUM_SHAPES: of_drum,
        "shoe.spring.0.at": np.array([0.05, 0.02, 0.01]), "shoe.spring.0.direction": along[0],
        "shoe.force.0.at": np.array([0.06, -0.02, 0.0]), "shoe.force.0.direction": along[1],
        "shoe.force.1.at": np.array([0.07, 0.03, -0.01]), "shoe.force.1.direction": along[0],
    }  # fmt: skip

    @eqx.filter_jit
    def built(value):
        shoe = build_shoe(composition, value)
        return shoe, along_points(composition, value, shoe)

    shoe, (springs, pushes) = jax.tree.map(np.asarray, built(value))
    assert (shoe.names, shoe.even, shoe.cells) == (names, (True, False), Cells(6, 1, 9))  # of three degrees in z
    np.testing.assert_allclose(shoe.frequencies, np.sqrt(2e11 / 7300) * np.array([1.0, 3.0]), rtol=1e-14)
    np.testing.assert_allclose(shoe.shapes, shapes[[0, 2]] / np.sqrt(7300), rtol=1e-14)
    assert (float(shoe.position), shoe.drum.names) == (0.8, ("drum.E2",))
    np.testing.assert_allclose(shoe.drum.frequencies, np.sqrt(1e11 / 7000) * 5.0, rtol=1e-14)
    np.testing.assert_allclose(shoe.drum.shapes, of_drum[[1]] / np.sqrt(7000), rtol=1e-14)
    assert (float(shoe.drum.width), float(shoe.drum.offset)) == (0.06, 0.004)
    assert (springs.shape, pushes.shape) == ((1, 5), (2, 5))
    # X moves every point along x, and Tz about the centre of gravity; the drum's mode moves none of the shoe.
    c = float(shoe.centroid)
    places, ways = ((0.05, 0.02), (0.06, -0.02), (0.07, 0.03)), (along[0], along[1], along[0])
    for found, at, way in zip((*springs, *pushes), places, ways, strict=True):
        np.testing.assert_allclose(found[:2], [way[0], way[1] * (at[0] - c) - way[0] * at[1]], rtol=1e-12)
        assert found[4] == 0
        assert np.abs(found[2:4]).min() > 0


# --- several shoes ---------------------------------------------------------------------------------------------------

OWN = (("X", "Tz"), ("Y", "Tz"), ("X", "Y"))
SPEED, LOADS = (
    PiecewiseLinear([0.0, 2.0], [-3.0, -7.0]),
    (Constant(2e5), PiecewiseLinear([0.0, 1.0], [1e5, 4e5]), Constant(3e5)),
)
TIME, SIZES = 0.3, [(0.11, 0.017, 0.043, 2.1), (0.11, 0.02, 0.03, 1.7), (0.11, 0.015, 0.05, 1.9)]


def three_contacts():
    """Two that are built alike but for their numbers, and one that does not rub."""
    friction = [Friction(ConstantLaw(mu), Tangential()) for mu in (0.3, 0.45)]
    shoes = [RigidShoe(*size, 7300.0, names) for size, names in zip(SIZES, (OWN[0], OWN[0], OWN[2]), strict=True)]
    laws = Unilateral(2e10), Unilateral(3e10), Bonded(1e10)
    each = zip(shoes, laws, (*friction, None), strict=True)
    return [Contact(shoe, law, rubs, FixedGrid(5, spatial=False)) for shoe, law, rubs in each]


@eqx.filter_jit
def put_together(alone, shares, names):
    """Contacts as they come, in another order, and without friction; and area and mass of their brake."""
    contacts = Contacts.of(alone, shares, names)
    turned = Contacts.of([alone[2], alone[0], alone[1]], shares, names)
    return contacts, turned, contacts.with_friction(None), (contacts.body.area, contacts.body.mass)


@Interpreted
def says(contact, moment, q, v):
    return {
        "act": contact.act(moment, q, v),
        "observe": contact.observe(moment, q, v),
        "kinks": contact.kinks(moment, q, v),
        "energy": contact.potential_energy(moment, q),
        "range": contact.pressure_range(moment, q),
        "fastest": contact.fastest_slip(moment, v),
    }


@Interpreted
def on_one(moment, body, mine, q):
    effect = OnOne(Preload(body), mine)
    return effect.act(moment, q, q), effect.potential_energy(moment, q)


def test_several_contacts_are_the_sum_of_each():
    alone = three_contacts()
    prefixes = ["leading.", "trailing.", "third."]
    names, shares = share(prefixes, [contact.body.names for contact in alone])
    assert names == ("leading.X", "leading.Tz", "trailing.X", "trailing.Tz", "third.X", "third.Y")
    # Out of order, so that places and numbers are not the same.
    others = zip(shares, ((5, 0), (2, 4), (1, 3)), strict=True)
    shares = tuple(dataclasses.replace(mine, places=places) for mine, places in others)
    contacts, turned, smooth, (area, mass) = jax.tree.map(np.asarray, put_together(alone, shares, names))
    assert contacts.members == ((0, 1), (2,))
    assert contacts.slides == (True, False, True, False, True, True)
    assert contacts.friction is not None
    assert [float(law.stiffness) for law in contacts.laws] == [2e10, 3e10, 1e10]
    assert float(contacts.radius) == 0.11
    assert turned.members == ((0,), (1, 2))
    assert smooth.friction is None
    assert not any(smooth.slides)
    operation = Operation(SPEED, LOADS[0], (), LOADS[1:])
    q, v = 1e-5 * random(6, 6), 0.2 * random(7, 6)
    q[2] = -8e-6  # takes part of the second shoe off the drum
    moment = jax.tree.map(np.asarray, jax.jit(lambda operation: operation.at(TIME))(operation))
    own = [(moment.of_shoe(mine.number), *(tuple(x[list(mine.places)]) for x in (q, v))) for mine in shares]
    whole = jax.tree.map(np.asarray, says(contacts, moment, tuple(q), tuple(v)))
    each = [jax.tree.map(np.asarray, says(contact, *at)) for contact, at in zip(alone, own, strict=True)]
    force = np.zeros(6)
    for mine, found in zip(shares, each, strict=True):
        force[list(mine.places)] += found["act"].force
    np.testing.assert_allclose(whole["act"].force, force, rtol=1e-12)
    np.testing.assert_allclose(whole["act"].power, sum(found["act"].power for found in each), rtol=1e-12)
    np.testing.assert_allclose(whole["act"].heat, sum(found["act"].heat for found in each), rtol=1e-12)
    np.testing.assert_allclose(whole["energy"], sum(found["energy"] for found in each), rtol=1e-12)
    np.testing.assert_allclose(whole["kinks"], np.concatenate([found["kinks"] for found in each]), rtol=1e-12)
    lows, highs = zip(*(found["range"] for found in each), strict=True)
    np.testing.assert_allclose(whole["range"], [min(lows), max(highs)], rtol=1e-12)
    np.testing.assert_allclose(whole["fastest"], max(found["fastest"] for found in each[:2]), rtol=1e-12)
    assert each[2]["fastest"] != whole["fastest"]
    seen, areas = [found["observe"] for found in each], 0.11 * np.array([0.043 * 2.1, 0.03 * 1.7, 0.05 * 1.9])
    observed = whole["observe"]
    for name in ("brake_torque", "normal_force", "friction_power"):
        np.testing.assert_allclose(getattr(observed, name), sum(getattr(one, name) for one in seen), rtol=1e-12)
    for name in ("contact_fraction", "slip_reversed_fraction"):
        mean = areas @ [getattr(one, name) for one in seen] / areas.sum()
        np.testing.assert_allclose(getattr(observed, name), mean, rtol=1e-12)
    assert 0 < seen[1].contact_fraction < 1
    np.testing.assert_allclose(observed.smallest_pressure, min(one.smallest_pressure for one in seen))
    for name in ("brake_torque", "normal_force", "contact_fraction"):
        np.testing.assert_allclose(observed.of_each(name), [getattr(one, name) for one in seen], rtol=1e-12)
    # An effect on the second alone, by its own load of 1.9e5 Pa, which rises by 3e5 Pa a second.
    (pushed, power, _), stored = jax.tree.map(np.asarray, on_one(moment, alone[1].body, shares[1], tuple(q)))
    resultant = 2 * np.sin(0.85) * 0.11 * 0.03
    np.testing.assert_allclose(pushed, 1.9e5 * resultant * (np.arange(6) == 2), rtol=1e-12)
    np.testing.assert_allclose(power, -3e5 * resultant * q[2], rtol=1e-12)
    np.testing.assert_allclose(stored, -1.9e5 * resultant * q[2], rtol=1e-12)
    np.testing.assert_allclose(area, areas.sum(), rtol=1e-12)
    weights = [7300.0 * size[2] * size[3] * (size[0] ** 2 - (size[0] - size[1]) ** 2) / 2 for size in SIZES]
    np.testing.assert_allclose(mass[[5, 2, 1, 3]], [weights[0], weights[1], weights[2], weights[2]], rtol=1e-12)
    brake: Brake = contacts.body
    assert (brake.follows, brake.symmetric) == (False, (False,) * 6)
