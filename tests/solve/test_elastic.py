"""Linear models of a shoe that bends: which numbers they follow, and what the free modes cost to trace."""

from types import SimpleNamespace
from typing import cast

import jax
import numpy as np
import pytest
import scipy
from jax.extend.core import jaxprs_in_params

from drumsqueal.coordinates import is_static
from drumsqueal.errors import RequestError
from drumsqueal.interpreter import Interpreted
from drumsqueal.physics import inventory
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe
from drumsqueal.physics.composition import compose
from drumsqueal.physics.elasticity import SHAPING, numbers_of, shoe_modes
from drumsqueal.physics.inventory import bending_in_words, free_modes_in_words
from drumsqueal.physics.model import assemble, build_model
from drumsqueal.physics.shoe_building import SHAPES, WAVENUMBERS
from drumsqueal.precision import real
from drumsqueal.questions.sensitivity import study
from drumsqueal.questions.sensitivity.stabilising import variable_numbers
from drumsqueal.questions.sensitivity.study import study_sensitivity
from drumsqueal.scene import COORDINATES, SceneError
from drumsqueal.simulation import prepare
from drumsqueal.solve.linear.family import analyse_many, spectra_of, state_matrix_of
from drumsqueal.solve.linear.modes import Mode, eigensystem, overlap_of, solve_modes
from drumsqueal.solve.motion import integrate
from drumsqueal.solve.transient.runge_kutta import _solved
from drumsqueal.solve.transient.state import State, motion_scale

STEEL = {"young": 210e9, "poisson": 0.3, "up_to": 7e3}


@pytest.fixture
def elastic(nominal):
    """The paper's shoe of steel, with its free modes up to 7 kHz."""
    return nominal.with_values({"shoe.elastic": STEEL, "simulate.duration": 2e-3})


def by_name(stability):
    return {mode.label: mode.eigenvalue for mode in stability.modes}


# --- numbers --------------------------------------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize("key", SHAPING)
def test_a_model_does_not_follow_numbers_that_change_the_free_modes(elastic, key):
    value = elastic.numbers()[key]
    assert build_model(elastic, {key: value}).names == build_model(elastic).names
    with pytest.raises(RequestError, match=rf"{key}: the modes .* drumsqueal sweep SCENE --vary {key}="):
        build_model(elastic, {key: 1.01 * value})
    for refuses in (lambda: spectra_of(elastic, {key: np.array([value])}), lambda: state_matrix_of(elastic, (key,))):
        with pytest.raises(RequestError, match="modes"):
            refuses()


@pytest.mark.thorough
def test_a_traced_thickness_is_refused_and_a_traced_modulus_is_not(elastic):
    with pytest.raises(RequestError, match=r"shoe\.thickness: the modes"):
        jax.jvp(lambda h: build_model(elastic, {"shoe.thickness": h}).mass, (0.02,), (1.0,))
    stiffness = jax.jvp(lambda E: build_model(elastic, {"shoe.elastic.young": E}).stiffness[3, 3], (210e9,), (1.0,))[1]
    modes = shoe_modes(elastic)
    assert modes is not None
    wanted = modes.wavenumbers[0] ** 2 / 7820.0  # of ω² = E k²/ρ
    assert stiffness == pytest.approx(wanted, rel=1e-12)


@pytest.mark.thorough
def test_derivatives_are_those_of_free_modes_found_anew(elastic):
    scene = elastic.with_values({"shoe.elastic.up_to": 3e3})  # E1 alone
    found_study = study_sensitivity(scene)
    rows = {row.key: row for row in found_study.numbers}
    assert set(found_study.by_free_modes) == set(SHAPING)
    labels = [mode.label for mode in found_study.modes]
    # Scenes of their own 4 % apart, whose shapes are others and may be more: that makes up to 3 %.
    ends = [
        (key, factor) for key in ("shoe.elastic.young", "shoe.density", "shoe.thickness") for factor in (1.02, 0.98)
    ]
    scenes = [scene.with_values({key: factor * scene.numbers()[key]}) for key, factor in ends]
    anew = dict(zip(ends, map(by_name, analyse_many(scenes)), strict=True))
    for key in dict(ends):
        for label in ("X", "Y", "Tz", "E1"):
            change = (anew[key, 1.02][label] - anew[key, 0.98][label]).real / 4
            found = rows[key].growth_per_percent_1_per_s[labels.index(label)]
            assert found == pytest.approx(change, rel=0.03, abs=2e-3), (key, label)
    # With the shapes held, the thickness would make E1 decay: −0.007 1/s a percent.
    assert rows["shoe.thickness"].growth_per_percent_1_per_s[labels.index("E1")] > 0.01


@pytest.mark.thorough
def test_what_presses_changes_with_its_end_where_some_of_the_lining_is_off(elastic):
    """At 1 rad/s friction lifts 8 % of the lining off: derivatives of the state matrix against central differences.

    With the end of contact held, it would be 85 % off.
    """
    lifted = {"steady.state": "self-consistent", "drum.speed": 1.0, "shoe.elastic.up_to": 3e3}
    scene, key, step = elastic.with_values(lifted), "friction.static", 1e-4
    value = cast("float", scene.numbers()[key])
    evaluate = state_matrix_of(scene, (key,))
    above, below = (evaluate(np.array([(1 + sign * step) * value]))[0] for sign in (1, -1))
    difference = (above - below) / (2 * step * value)
    (found,) = evaluate(np.array([value]))[1]
    # The second derivative of the difference: 2e-7 was found.
    assert np.max(np.abs(found - difference)) < 2e-6 * np.max(np.abs(difference))


@pytest.mark.parametrize("turned", [0.27, 0.45])
def test_modes_are_followed_one_to_one_whatever_the_units_of_the_state_are(turned):
    """Two modes that share two coordinates of masses 3e-6 and 1, before and after their frequencies rise.

    Once each took the eigenvalue nearest to it, less an overlap that depends on the units: both took the first.
    """

    def matrix(angle, frequencies):
        cosine, sine = np.cos(angle), np.sin(angle)
        shapes = np.array([[600.0], [1.0]]) * np.array([[cosine, sine], [-sine, cosine]])
        return np.block(
            [[0 * np.eye(2), np.eye(2)], [-shapes @ np.diag(frequencies**2) @ np.linalg.inv(shapes), -np.eye(2)]]
        )

    before, after = np.array([100.0, 103.0]), np.array([102.3, 104.3])
    eigenvalues, left, right = scipy.linalg.eig(matrix(0.27, before), left=True)
    modes = []
    for frequency in before:
        k = np.argmin(abs(eigenvalues - 1j * frequency))
        scaled = left[:, k] / (left[:, k].conj() @ right[:, k]).conj()
        modes.append(Mode("X", "X", complex(eigenvalues[k]), False, right[:, k], scaled))
    found, right, left = eigensystem(matrix(turned, after))
    found = study._followed(overlap_of(modes, right, left), found)
    assert np.abs(found) == pytest.approx(after, rel=1e-9)


def test_modes_are_followed_where_a_body_yields_in_other_shapes():
    """One brake of five coordinates, seen by three of them and two others that are turned: with the same eigenvalues.

    The two hold half of one mode's kinetic energy.
    """
    frequencies, mixed = np.array([1.0, 2.0, 3.0, 4.0, 5.0]), np.eye(5)
    mixed[np.ix_([2, 3], [2, 3])] = np.array([[1.01, 0.99], [-0.99, 1.01]]) / np.sqrt(1.01**2 + 0.99**2)
    mixed[np.ix_([0, 4], [0, 4])] = [[0.8, 0.6], [-0.6, 0.8]]

    def matrix(angle, order):
        own = np.eye(5)
        own[3:, 3:] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        shapes = (own @ mixed)[order]
        return np.block([[0 * np.eye(5), np.eye(5)], [-shapes @ np.diag(frequencies**2) @ shapes.T, -0.02 * np.eye(5)]])

    def seen(angle, order):
        names = tuple(np.array(["X", "Y", "E1", "S2", "S3"])[order])
        return SimpleNamespace(coordinates=names, modes=solve_modes(names, np.ones(5), matrix(angle, order))[1])

    own, end = seen(0.0, [0, 1, 2, 3, 4]), seen(1.1, [1, 0, 2, 3, 4])
    assert [mode.name for mode in own.modes] == ["X", "Y", "E1"]
    found = study._followed_to(end, own)  # pyright: ignore[reportArgumentType]
    assert found == pytest.approx([mode.eigenvalue for mode in own.modes], rel=1e-9)
    end.modes = end.modes[:2]
    assert np.isnan(study._followed_to(end, own)).tolist() == [False, False, True]  # pyright: ignore[reportArgumentType]


# --- how many modes -------------------------------------------------------------------------------------------------


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"start.displacement": {"E99": 1e-7}}, "start.displacement.E99.*4 free modes .E1 to E4. up to 7000 Hz"),
        ({"simulate.coordinates": ["X", "Y", "Tz", "E5"]}, "simulate.coordinates.*leave out E5"),
    ],
)
def test_a_free_mode_that_the_shoe_does_not_have_is_named(elastic, values, message):
    scene = elastic.with_values(values)
    with pytest.raises(SceneError, match=message):
        build_model(scene)


def test_a_shoe_without_free_modes_in_the_range_is_the_rigid_one(elastic, nominal):
    stiff = elastic.with_values({"shoe.elastic.up_to": 200.0})  # of the brake's modes, too
    assert type(build_model(stiff).body) is RigidShoe
    assert by_name(prepare(stiff).stability) == by_name(prepare(nominal).stability)
    assert build_model(stiff, {"shoe.thickness": 0.018}).names == ("X", "Y", "Tz")


# --- what it takes to trace -----------------------------------------------------------------------------------------


def count(jaxpr):
    """Equations of a program and of all within it."""
    inner = (each for equation in jaxpr.eqns for each in jaxprs_in_params(equation.params))
    return len(jaxpr.eqns) + sum(count(each) for each in inner)


def traced(scene, number):
    """Equations of the forces on a shoe with so many made-up modes."""
    value = {key: real(each) for key, each in numbers_of(scene).items()}
    value |= {WAVENUMBERS: np.arange(1.0, number + 1), SHAPES: np.ones((number, *value[SHAPES].shape[1:]))}
    names = (*COORDINATES, *(f"E{k}" for k in range(1, number + 1)))
    composition = compose(scene)._replace(coordinates=names, symmetric_modes=(False,) * number)
    zeros = np.zeros(len(names))
    return count(jax.make_jaxpr(lambda value, q: assemble(composition, value).act(0.0, q, q))(value, zeros).jaxpr)


@pytest.mark.thorough
def test_programs_do_not_grow_with_the_number_of_modes(elastic):
    assert traced(elastic, 2) == traced(elastic, 12) == traced(elastic, 30)


def test_static_shapes_are_resolved_to_what_all_the_energy_would_give_them(elastic):
    """And modes to what they do, or a thousandth of that."""
    model, speed = build_model(elastic), 0.2
    places = {name: k for k, name in enumerate(model.names)}
    velocity = np.zeros(len(places))
    velocity[places["Y"]] = speed
    state = State(real(np.zeros(len(places))), real(velocity), real(0.0))
    vibration, found, *_ = Interpreted(lambda: motion_scale(model, state))()
    whole = speed * np.sqrt(np.asarray(model.mass)[places["Y"]])
    static = [places[name] for name in places if is_static(name)]
    assert static
    np.testing.assert_allclose(np.asarray(found)[static], whole, rtol=1e-12)
    ringing = np.sqrt(np.diag(np.asarray(model.stiffness))[static])
    np.testing.assert_allclose(np.asarray(vibration)[static], whole / ringing, rtol=1e-12)
    assert np.asarray(found)[places["E1"]] < 0.2 * whole
    assert speed <= np.asarray(found)[places["Y"]] < 1.5 * speed


@pytest.mark.thorough
def test_a_motion_with_static_shapes_is_as_exact_as_was_asked(elastic):
    """From 30 µm the lining lifts off and slips backwards; errors add up over some hundred steps."""
    model, start = build_model(elastic), {"displacement": {"Y": 3e-5}}
    loose, tight = (
        integrate(model, start, 2e-3, sample_rate=5e4, tolerance=each).displacement for each in (1e-6, 1e-10)
    )
    error = np.abs(loose - tight).max(axis=0) / np.abs(tight).max(axis=0)
    static = np.array(list(map(is_static, model.names)))
    assert error[~static].max() < 1e-6
    assert 0 < error[static].max() < 1e-4  # of their own: they move a hundredth as much as the lining


def test_many_unknowns_are_eliminated_in_a_loop():
    sizes = {n: count(jax.make_jaxpr(_solved)(np.eye(n), np.ones(n)).jaxpr) for n in (6, 7, 18)}
    assert sizes[7] == sizes[18] < sizes[6]


@pytest.mark.parametrize("count", [1, 2, 5, 6, 7, 18])
def test_equations_of_a_stage_are_solved(count):
    matrix = np.eye(count) + 0.1 * np.random.default_rng(0).standard_normal((count, count))
    right = np.arange(2.0, count + 2.0)
    assert Interpreted(_solved)(matrix, right) == pytest.approx(np.linalg.solve(matrix, right), rel=1e-12)


def test_free_modes_are_named_by_the_plane_in_which_they_move(elastic, monkeypatch):
    monkeypatch.setattr(inventory, "elastic_names", lambda _: ("E1", "E2", "E3"))
    monkeypatch.setattr(inventory, "count_modes", lambda *_: 3)
    monkeypatch.setattr(inventory, "symmetric_modes", lambda _: (True, False, True))
    monkeypatch.setattr(inventory, "elastic_frequencies", lambda *_: [2171.7, 5046.04, 5972.6])
    said = "E1 2172 Hz, E3 5973 Hz in the plane; E2 5046 Hz out of it"
    assert list(bending_in_words(elastic)) == [f"The shoe bends; its free modes, when nothing holds it: {said}"]
    monkeypatch.setattr(inventory, "symmetric_modes", lambda _: (False, False, False))
    (said,) = bending_in_words(elastic)
    assert said.endswith(": E1 2172 Hz, E2 5046 Hz, E3 5973 Hz out of it")


def test_what_is_said_of_free_modes_that_are_not_found_or_not_there(nominal):
    bending = nominal.with_values({"shoe.elastic": {"young": 210e9, "poisson": 0.3, "up_to": 200.0}})
    assert "no free mode up to 200 Hz, so it is rigid here" in str(free_modes_in_words(bending))
    with pytest.raises(RequestError, match=r"lower it to .* shoe\.elastic\.young = 2\.1e\+06 Pa is far from"):
        free_modes_in_words(bending.with_values({"shoe.elastic.young": "2.1 MPa", "shoe.elastic.up_to": "12 kHz"}))


@pytest.mark.thorough
def test_a_number_with_which_the_free_modes_change_is_not_called_a_list(nominal):
    bending = nominal.with_values({"shoe.elastic": {"young": 210e9, "poisson": 0.3, "up_to": 3e3}})
    with pytest.raises(RequestError, match=r"modes .* drumsqueal sweep SCENE --vary shoe\.thickness"):
        variable_numbers(bending, ["shoe.thickness"])
