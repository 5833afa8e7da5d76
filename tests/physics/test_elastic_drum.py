"""A drum that bends: its modes against CalculiX and thin plates, forces on it, and what becomes of a stiff one."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import optimize
from scipy.special import iv, jv, kv, yv

import drums
from drumsqueal.coordinates import is_static
from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies import drum_modes, free_modes
from drumsqueal.physics.bodies.drum_modes import (
    Cup,
    DrumModes,
    drum_shapes_at,
    find_drum_modes,
    modes_of_harmonic,
    section_of,
)
from drumsqueal.physics.bodies.elastic_shoe import ElasticShoe
from drumsqueal.physics.bodies.solid_elements import EVERYWHERE, Material
from drumsqueal.physics.bodies.solid_mesh import read_solid_mesh
from drumsqueal.physics.bodies.solid_modes import find_clamped_drum
from drumsqueal.physics.composition import compose, coordinates_of
from drumsqueal.physics.elasticity import check_shapes_stay, drum_names, elastic_frequencies, shaping_numbers
from drumsqueal.physics.inventory import drum_modes_in_words, take_inventory
from drumsqueal.physics.model import build_model
from drumsqueal.physics.quadrature.cells import Cells
from drumsqueal.physics.quadrature.lines import LineCells
from drumsqueal.scene import SceneError
from drumsqueal.solve.linear.modes import analyse_stability
from drumsqueal.solve.motion import integrate
from lining import brute_force, characteristic_lengths, contact_force, random_state

REFERENCE = json.loads((Path(__file__).parent / "meshes" / "drum.json").read_text())
CUP = {**drums.CUP, "up_to": 8e3}
SIZES = Cup(0.1, 0.012, 0.06, 0.008, 0.05)
WAVE_SPEED = np.sqrt(CUP["young"] / CUP["density"])  # m/s
UP_TO = 2 * np.pi * CUP["up_to"] / WAVE_SPEED


@pytest.fixture(scope="module")
def modes():
    """Return the modes of the cup up to 8 kHz."""
    return find_drum_modes(SIZES, CUP["poisson"], UP_TO)


@pytest.fixture(scope="module")
def cup(nominal):
    """Return the paper's brake with a drum of cast iron, its ring 3 mm off the lining's middle."""
    return nominal.with_values({"drum.elastic": {**CUP, "offset": 3e-3}})


@pytest.fixture(scope="module")
def low(cup):
    """Return it with the modes that test_mesh_drum.py asks for, too, which are found once."""
    return cup.with_values({"drum.elastic.up_to": 2.7e3})


STEEL = {"young": 210e9, "poisson": 0.3, "up_to": 6e3}


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("changes", "cells"),
    [({"drum.elastic": CUP}, Cells(6, 1, 9)), ({"shoe.elastic": STEEL}, LineCells())],
    ids=["drum", "shoe"],
)
def test_growth_rates_stay_with_more_cells(nominal, changes, cells):
    """By 4e-7 1/s of the drum, 1e-6 of the shoe, with twice as many cells or lines across and two nodes more."""
    model = build_model(nominal.with_values(changes))
    assert model.lining.surface == cells
    finer = dataclasses.replace(model, contact=model.lining.on_cells(1, 2, 2))
    one, other = (np.array([mode.eigenvalue for mode in analyse_stability(each).modes]) for each in (model, finer))
    assert np.max(np.abs(np.real(one - other))) < 1e-5


@pytest.fixture(scope="module")
def model(cup):
    """Return its model, of the drum's modes alone."""
    return build_model(cup, coordinates=tuple(name for name in coordinates_of(cup) if not is_static(name)))


# --- modes ------------------------------------------------------------------------------------------------------------


def test_frequencies_are_those_of_solid_elements(modes):
    """CalculiX on quadratic hexahedra, whose coarser mesh is up to 0.4 % above the finer one."""
    found = modes.wavenumbers * WAVE_SPEED / (2 * np.pi)
    coarse, fine = (np.array(REFERENCE[key][: found.size]) for key in ("coarse_Hz", "fine_Hz"))
    assert np.max(coarse / fine - 1) < 5e-3
    # Both are bounds from above, and those by more functions the lower ones.
    assert np.all((found < fine) & (found > (1 - 2.5e-3) * fine))


@pytest.mark.thorough
def test_a_cup_without_a_ring_is_a_thin_annular_plate():
    """Clamped inside and free outside: w = (A J + B Y + C I + D K)(kr) cos nθ, where a determinant vanishes."""
    hub, edge, thickness, poisson = 0.05, 0.102, 5e-4, 0.3
    found = find_drum_modes(Cup(edge - 2e-3, 2e-3, 1e-5, thickness, hub), poisson, 0.6)
    stiffness = np.sqrt(thickness**2 / 12 / (1 - poisson**2))
    for n in range(4):
        first = found.wavenumbers[found.harmonics == n][0]
        k: Any = lowest_of_plate(n, hub, edge, poisson)
        # Shear and the clamp's Poisson effect: of the order of thickness over length, squared.
        assert first == pytest.approx(stiffness * k**2, rel=2e-3)


def lowest_of_plate(n, hub, edge, poisson):
    """Return the least wavenumber k (1/m) of bending with n nodal diameters."""

    def along(function, x, order):
        """Derivatives of Z_n by differences in the order, Z' = (Z_{n−1} ∓ Z_{n+1})/2 and so on."""
        step = 1e-3
        values = [function(n, x + j * step) for j in range(-2, 3)]
        weights = {0: (0, 0, 1, 0, 0), 1: (1, -8, 0, 8, -1), 2: (-1, 16, -30, 16, -1), 3: (-1, 2, 0, -2, 1)}[order]
        scale = {0: 1, 1: 12 * step, 2: 12 * step**2, 3: 2 * step**3}[order]
        return np.dot(weights, values) / scale

    def determinant(k):
        rows, (a, b) = [], (k * hub, k * edge)
        for Z, sign in ((jv, -1), (yv, -1), (iv, 1), (kv, 1)):
            w, slope, bend = (along(Z, b, order) for order in range(3))
            moment = bend + poisson * (slope / b - n**2 * w / b**2)
            # V = ∂(∇²w)/∂r + (1 − ν)/r² ∂²/∂θ²(∂w/∂r − w/r), with ∇²w = ±w of each function.
            shear = sign * slope - (1 - poisson) * n**2 / b**2 * (slope - w / b)
            rows.append([along(Z, a, 0), along(Z, a, 1), moment, shear])
        scaled = np.array(rows) / np.linalg.norm(rows, axis=1, keepdims=True)
        return np.linalg.det(scaled)

    places = np.linspace(0.5, 6, 400) / (edge - hub)
    signs = [np.sign(determinant(k)) for k in places]
    first = next(j for j in range(len(places) - 1) if signs[j] != signs[j + 1])
    return optimize.brentq(determinant, places[first], places[first + 1])


@pytest.mark.thorough
def test_modes_of_a_thin_ring_are_found_above_harmonics_that_have_none():
    """Those of the plate rise with n from 0 to 4, all out of range, before those of a ring of 0.4 mm come down."""
    found = find_drum_modes(Cup(0.1, 4e-4, 0.0172, 0.0086, 0.0628), 0.3, 5.2)
    assert set(found.harmonics) == set(range(8, 18))


@pytest.mark.thorough
def test_with_more_waves_around_than_bending_has_no_mode_is_in_range():
    for sizes, highest in (
        (SIZES, UP_TO),
        ((0.1, 5e-4, 0.0415, 0.0096, 0.0322), 2.3),
        ((0.1, 0.0015, 0.27, 0.0019, 0.04), 1.5),
    ):
        cup = Cup(*sizes)
        first = 1 + int(cup.most_waves(0.3, highest))
        section = section_of(cup, 0.3, max(cup.bending(0.3, 3 * highest)), 0.0)
        found = [modes_of_harmonic(section, n, 3 * highest, 0)[0] for n in range(first, first + 8)]
        assert len(found[0]) > 0  # there are modes beyond the range
        assert all(np.all(each > highest) for each in found)


def test_modes_come_in_pairs_that_are_turned_by_a_quarter_of_a_wave(modes):
    angle, z = np.linspace(0, 2 * np.pi, 73), np.linspace(-0.03, 0.03, 7)[:, None]
    shapes = drum_shapes_at(modes.coefficients, 0.03, angle, z)
    for k in np.flatnonzero((modes.harmonics > 0) & (np.roll(modes.wavenumbers, -1) == modes.wavenumbers)):
        turned = drum_shapes_at(modes.coefficients, 0.03, angle - np.pi / 2 / modes.harmonics[k], z)
        np.testing.assert_allclose(shapes[..., k + 1], turned[..., k], atol=1e-12 * np.abs(shapes).max())


def test_shapes_are_as_large_as_those_of_solid_elements(modes):
    """Mean squares over the inner surface of modes of unit modal mass, to the error of so few elements."""
    mesh = read_solid_mesh(Path(__file__).parent / "meshes" / "cup_hex20.inp", "mm")
    iron = {EVERYWHERE: Material(CUP["young"], CUP["poisson"], CUP["density"])}
    solid = find_clamped_drum(mesh, iron, "INNER", "HUB", 2700.0)
    found, wanted = (
        mean_squares(coefficients)[:7]
        for coefficients in (modes.coefficients / np.sqrt(CUP["density"]), solid.coefficients)
    )
    assert list(modes.harmonics[:7]) == [1, 1, 2, 2, 0, 3, 3]
    for pair in ((0, 1), (2, 3, 4), (5, 6)):  # of those in the middle, two have nearly one frequency
        each = [np.sum(squares[list(pair)], axis=0) for squares in (found, wanted)]
        np.testing.assert_allclose(each[0], each[1], rtol=0.03, atol=5e-3 * np.max(each[1]))


def mean_squares(coefficients):
    """Return those of u_r, u_θ and u_z of each shape (m, 3)."""
    around = np.where(np.arange(coefficients.shape[2]) > 0, 0.5, 1.0)
    across = 1 / (2 * np.arange(coefficients.shape[3]) + 1)
    return np.einsum("mcfk,f,k->mc", coefficients**2, around, across)


@pytest.mark.thorough
def test_frequencies_and_shapes_stay_with_more_functions_and_narrower_cells(monkeypatch):
    """Two pairs near 10.5 and 11.5 kHz bend most at the corner."""
    found = find_drum_modes(SIZES, CUP["poisson"], 1.5 * UP_TO)
    assert found.wavenumbers.size == 43
    monkeypatch.setattr(drum_modes, "FINEST", 1e-3)
    monkeypatch.setattr(drum_modes, "MORE_DEGREES", 10)
    monkeypatch.setattr(drum_modes, "GRADED", 0.15)
    monkeypatch.setattr(drum_modes, "DEGREES", 64)
    finer = find_drum_modes(SIZES, CUP["poisson"], (1 + 1e-9) * 1.5 * UP_TO)
    # One by one of each number of waves: of the first ones, two are of nearly one frequency.
    found, finer = (
        DrumModes(*(each[np.argsort(modes.harmonics, kind="stable")] for each in vars(modes).values()))
        for modes in (found, finer)
    )
    np.testing.assert_allclose(found.wavenumbers, finer.wavenumbers, rtol=2e-4)
    # What the corner leaves to those beyond the 16th ripples at the edge beside it, hardly where the lining is.
    kept = found.coefficients.shape[3]
    assert kept == 16
    largest = np.sqrt(np.sum(finer.coefficients**2 / (np.arange(64) + 0.5), axis=(1, 2, 3)))
    for reach, bound in ((0.65, 1.5e-3), (1.0, 5e-3)):
        across = np.linspace(-reach, reach, 200)
        finely = np.polynomial.legendre.legvander(across, 63)
        away = found.coefficients @ finely[:, :kept].T - finer.coefficients @ finely.T
        assert np.max(np.sqrt(np.mean(np.sum(away**2, axis=(1, 2)), axis=-1)) / largest) < bound


def test_too_many_modes_name_their_key(monkeypatch):
    monkeypatch.setattr(free_modes, "MOST_MODES", 10)  # in place of 400: there are 21
    with pytest.raises(RequestError, match=r"some 2\d modes up to twice drum\.elastic\.up_to.* lower it to 45 % of"):
        find_drum_modes(SIZES, 0.2601, UP_TO)


def test_modes_are_found_once(modes):
    assert find_drum_modes(SIZES, CUP["poisson"], UP_TO) is modes
    with pytest.raises(ValueError, match="read-only"):
        modes.wavenumbers[0] = 0.0


# --- the brake --------------------------------------------------------------------------------------------------------


# Where contact is lost, brute force errs by 1e-6 itself: against a rule of nine times the cells forces are off by 1e-9.
@pytest.mark.thorough
@pytest.mark.parametrize(
    ("size", "speed", "seed", "bound"), [(1e-7, 0.01, 1, 1e-8), (6e-6, 0.02, 2, 3e-6)], ids=["pressed", "lifted"]
)
def test_contact_forces_on_shoe_and_drum_are_those_of_brute_force(model, size, speed, seed, bound):
    area = float(model.shoe.area * model.operation.at(0.0).preload)
    q, v = random_state(model, seed, size, speed)
    error = np.abs(contact_force(model)(q, v) - brute_force(model, q, v)) / characteristic_lengths(model) / area
    assert np.max(error) < bound


@pytest.mark.thorough
def test_a_stiff_drum_leaves_the_eigenvalues_of_a_rigid_one(nominal):
    stiff = nominal.with_values({"drum.elastic": {**CUP, "young": 1e8 * CUP["young"], "up_to": 1e4 * CUP["up_to"]}})
    wanted, found = (
        analyse_stability(build_model(scene, coordinates=coordinates_of(scene))).eigenvalues
        for scene in (nominal, stiff)
    )
    near = np.min(np.abs(wanted[:, None] - found), axis=1)
    moving = np.abs(wanted) > 1
    # The drum yields 1e-8 of what the one of iron does, which changes the eigenvalues by some of themselves.
    assert np.max(near[moving] / np.abs(wanted[moving])) < 1e-7


@pytest.mark.thorough
def test_a_drum_of_iron_flutters_with_constant_friction(nominal):
    """Tried out before with other code: pairs near 2.56 and 3.98 kHz part by more than 200 1/s either way."""
    constant = {"friction": {"law": "constant", "coefficient": 0.4, "direction": "unit-velocity"}}
    scene = nominal.with_values({"drum.elastic": CUP, **constant})
    found = analyse_stability(build_model(scene)).modes
    for frequency in (2560, 3980):
        rates = [mode.growth_rate for mode in found if abs(mode.frequency_Hz - frequency) < 20]
        assert min(rates) < -200
        assert max(rates) > 200


@pytest.mark.thorough
def test_the_sense_of_rotation_exchanges_growth_with_nothing_else(nominal):
    """The brake is its own mirror image in θ = 0: the other sense of rotation has the same eigenvalues."""
    scene = nominal.with_values({"drum.elastic": CUP})
    one, other = (
        np.sort_complex(analyse_stability(build_model(each)).eigenvalues)
        for each in (scene, scene.with_values({"drum.speed": -scene.drum.speed}))
    )
    np.testing.assert_allclose(one, other, rtol=1e-8, atol=1e-5)


@pytest.mark.thorough
def test_energy_balances_in_a_transient_that_lifts_off(model):
    start = {"displacement": {"Y": 1e-5}, "velocity": {"drum.E6": 0.05}}
    motion = integrate(model, start, 1e-3, sample_rate=50e3)
    kinetic = np.max(np.sum(np.asarray(model.mass) * motion.velocity**2, axis=1)) / 2
    assert np.max(np.abs(motion.energy_balance_error)) < 1e-6 * kinetic
    theta, z = np.linspace(-1.1, 1.1, 50), 0.018
    moved = [dict(zip(model.names, state, strict=True)) for state in motion.displacement]
    assert min(np.min(model.shoe.over_drum(q, theta, z)[0]) for q in moved) < -6.9e-6  # -p0/k_c: lifts off


@pytest.mark.thorough
def test_a_rigid_drum_is_not_in_the_program(nominal, cup):
    assert not isinstance(build_model(nominal).body, ElasticShoe)
    assert compose(nominal).coordinates == ("X", "Y", "Tz")
    assert compose(cup).coordinates == coordinates_of(cup)
    assert "bending of the drum, modes up to 8000 Hz" in take_inventory(cup).includes
    coarse = cup.with_values({"drum.elastic.up_to": 100.0})
    assert drum_names(coarse) == ()
    assert not isinstance(build_model(coarse).body, ElasticShoe)
    assert "The drum has no mode up to 100 Hz" in str(drum_modes_in_words(coarse))


@pytest.mark.thorough
def test_modes_are_named_with_their_waves(cup):
    words = str(drum_modes_in_words(cup))
    assert words.startswith(
        "The drum bends; its modes without shoes, of n waves around: drum.E1, drum.E2 659 Hz (n = 1)"
    )
    assert "drum.E20, drum.E21 7539 Hz (n = 6); drum.S22" in words
    shapes = len(elastic_frequencies(cup, "drum"))
    assert words.endswith(f"; drum.S22 to drum.S{shapes}: how it yields besides to the lining")


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"drum.elastic.width": 0.04}, r"drum\.elastic\.width.* make the ring 0\.0425 m wide"),
        ({"drum.elastic.hub_radius": 0.1}, r"drum\.elastic\.hub_radius.* its back plate must reach"),
        ({"drum.elastic": None, "start.velocity": {"drum.E1": 1.0}}, r"the drum is rigid and has no elastic mode"),
    ],
)
def test_a_drum_that_does_not_fit_says_what_would(cup, values, reason):
    with pytest.raises(SceneError, match=reason):
        cup.with_values(values)


def test_a_mode_that_the_drum_does_not_have_is_refused(low):
    with pytest.raises(SceneError, match=r"the drum has 7 modes \(drum\.E1 to drum\.E7\) up to 2700 Hz, and yields"):
        compose(low.with_values({"start.velocity": {"drum.E8": 1.0}}))


def test_numbers_that_change_its_modes_say_how_to_vary_them(low):
    with pytest.raises(RequestError, match=r"modes of the elastic drum .* --vary drum\.elastic\.thickness=FROM\.\.TO"):
        check_shapes_stay(low, "drum.elastic.thickness")
    check_shapes_stay(low, "drum.elastic.young")
    # Its sizes and Poisson's ratio, in which wave speeds across and along differ, shape it; E and rho only scale it.
    sizes = ("thickness", "width", "back_plate", "hub_radius", "poisson")
    assert set(shaping_numbers(low)) == {"shoe.outer_radius", *(f"drum.elastic.{key}" for key in sizes)}
    own, stiffer = build_model(low), build_model(low, {"drum.elastic.young": jnp.asarray(2 * CUP["young"])})
    added = np.diag(stiffer.stiffness - own.stiffness)
    (frequencies,) = (2 * np.pi * np.array(elastic_frequencies(each, "drum")) for each in (low,))
    np.testing.assert_allclose(added[-frequencies.size :], frequencies**2, rtol=1e-9)


def test_a_drum_that_lies_beside_the_lining_takes_its_shapes_along(low):
    # What moves at a place of the drum is what moves there whatever z is counted from.
    models: list[Any] = [build_model(low, {"drum.elastic.offset": offset}) for offset in (0.0, 0.004)]
    near, far = (model.body.drum for model in models)
    angle, z = np.linspace(-1.0, 1.0, 5), np.linspace(-0.02, 0.02, 5)
    shapes = near.shapes_at(angle, z)
    np.testing.assert_allclose(far.shapes_at(angle, z + 0.004), shapes, rtol=1e-12, atol=1e-12 * np.abs(shapes).max())
    assert np.abs(far.shapes_at(angle, z) - shapes).max() > 1e-6 * np.abs(shapes).max()
