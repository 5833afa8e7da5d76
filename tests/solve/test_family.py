"""Linear models of many scenes and of many numbers in one program: each as by itself, and where it belongs."""

from typing import Any

import numpy as np
import pytest

from drumsqueal.errors import NoSteadySliding, RequestError, SteadyStateError
from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.elasticity import numbers_of
from drumsqueal.physics.model import build_model
from drumsqueal.solve.linear import family
from drumsqueal.solve.linear.modes import analyse_stability
from drumsqueal.solve.linear.steady import linear_model


@pytest.fixture(autouse=True)
def _evaluated_by_numpy(monkeypatch):
    """What is asked once is not compiled."""
    for program in ("_about_many", "_linear_models", "_with_derivatives"):
        monkeypatch.setattr(family, program, Interpreted(getattr(family, program)._function))


def of(found: Any) -> Any:
    assert not isinstance(found, SteadyStateError)
    return found


def test_many_scenes_have_what_each_has_by_itself_in_the_order_in_which_they_are_asked(nominal, monkeypatch):
    """Of two compositions, in blocks of two of which one is not full; one at rest, and one without a finite answer."""
    monkeypatch.setattr(family, "BLOCK", 2)
    damped = {"damping": {"ratio": 0.013}}
    values = [{"drum.speed": -3.0}, damped, {"drum.speed": 0.0}, {"contact.stiffness": 2e10}, {"drum.speed": 7.0},
              {**damped, "friction.static": 0.44}, {"drum.speed": {"time": [0, 1], "value": [0, 4]}}]  # fmt: skip
    scenes = [nominal.with_values(each) for each in values]
    found = family.analyse_many(scenes)
    assert len(found) == len(scenes)
    at_rest: Any = found.pop(2)
    assert isinstance(at_rest, SteadyStateError)
    assert str(NoSteadySliding.AT_REST) in str(at_rest)
    for own, scene in zip(found, [*scenes[:2], *scenes[3:]], strict=True):
        wanted = analyse_stability(build_model(scene, coordinates=of(own).coordinates))
        # Sums in another order, over eigenvalues of 5e4 1/s.
        np.testing.assert_allclose(of(own).eigenvalues, wanted.eigenvalues, rtol=1e-9, atol=1e-4)
        np.testing.assert_allclose(of(own).matrix, wanted.matrix, rtol=1e-9, atol=1e-3)
        assert (of(own).time, of(own).pressure_range) == (wanted.time, pytest.approx(wanted.pressure_range))
        assert of(own).contact_fractions == pytest.approx(wanted.contact_fractions)


def test_a_scene_that_has_no_steady_sliding_says_why_and_the_others_go_on(nominal, monkeypatch):
    about = family._about_many

    def found(stacked, composition):
        assert {len(each) for each in stacked.values()} == {family.BLOCK}
        each = about(stacked, composition)
        each.steady[1] = np.nan  # as where no equilibrium is found
        return each

    monkeypatch.setattr(family, "_about_many", found)
    monkeypatch.setattr(family, "no_steady_sliding", lambda model: SteadyStateError(NoSteadySliding.NOT_FOUND))
    first, second, third = family.analyse_many([nominal.with_values({"drum.speed": each}) for each in (2.0, 3.0, 4.0)])
    assert isinstance(second, SteadyStateError)
    for own, speed in ((first, 2.0), (third, 4.0)):
        wanted = analyse_stability(
            build_model(nominal.with_values({"drum.speed": speed}), coordinates=of(own).coordinates)
        )
        np.testing.assert_allclose(of(own).matrix, wanted.matrix, rtol=1e-9, atol=1e-3)


def test_many_numbers_of_which_one_set_has_no_steady_sliding_say_so(nominal, monkeypatch):
    models, asked = family._linear_models, []

    def found(*of: Any) -> Any:
        linear, matrices = models(*of)
        return linear, np.where(np.arange(3)[:, None, None] == 1, np.nan, matrices)

    def why(model: Any) -> SteadyStateError:
        asked.append(float(model.operation.at(0.0).drum_speed))
        return SteadyStateError(NoSteadySliding.NOT_FOUND)

    monkeypatch.setattr(family, "_linear_models", found)
    monkeypatch.setattr(family, "no_steady_sliding", why)
    with pytest.raises(SteadyStateError):
        family.spectra_of(nominal, {"drum.speed": [2.0, 3.0, 4.0]})
    assert asked == [3.0]


def matrix_of(scene) -> np.ndarray:
    """The state matrix of a scene by itself."""
    coordinates = family.linear_coordinates(scene)
    return np.asarray(linear_model(build_model(scene, coordinates=coordinates))[1].state_matrix())


def test_a_state_matrix_and_its_derivatives_are_those_of_scenes_with_other_numbers(nominal):
    keys = "contact.stiffness", "drum.speed", "shoe.thickness", "friction.decay"
    evaluate = family.state_matrix_of(nominal, keys)
    at = np.array([2.9e10, -3.1, 0.012, 1.7])

    def scene(values):
        return nominal.with_values(dict(zip(keys, map(float, values), strict=True)))

    matrix, derivatives = evaluate(at)
    size = np.max(np.abs(matrix))
    np.testing.assert_allclose(matrix, matrix_of(scene(at)), rtol=0, atol=1e-9 * size)
    assert derivatives.shape == (4, *matrix.shape)
    for k, found in enumerate(derivatives):
        step = 1e-5 * at[k] * np.eye(4)[k]
        wanted = (matrix_of(scene(at + step)) - matrix_of(scene(at - step))) / (2 * step[k])
        # Central differences over 1e-5 of the value: round-off of the matrix over that.
        np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-6 * np.max(np.abs(wanted)))


def test_spectra_are_those_of_the_state_matrices_with_what_is_named_in_place_of_the_scenes(nominal):
    damped = nominal.with_values({"damping": {"ratio": 0.013}})
    found = family.spectra_of(damped, {"drum.speed": np.array([-3.0, 6.0]), "friction.static": np.array([0.5, 0.6])})
    for k, values in enumerate(({"drum.speed": -3.0}, {"drum.speed": 6.0, "friction.static": 0.6})):
        matrix = matrix_of(damped.with_values(values))
        wanted, own = np.linalg.eigvals(matrix), found.eigenvalues[k]
        size = np.max(np.abs(wanted))
        np.testing.assert_allclose(np.sort_complex(own), np.sort_complex(wanted), rtol=0, atol=1e-7 * size)
        n = len(found.names)
        np.testing.assert_allclose(-found.damping[k] / found.mass[k][:, None], matrix[n:, n:], rtol=1e-7, atol=1e-6)
        # Each coordinate has an eigenvalue of its own, the upper one of a pair.
        assert len({complex(each) for each in found.own[k]}) == n
        assert all(np.min(np.abs(each - own)) == 0 and each.imag >= 0 for each in found.own[k])


def test_numbers_with_which_modes_change_are_refused(nominal, monkeypatch):
    def refuse(scene, key):
        if key == "shoe.thickness":
            raise RequestError(key)

    monkeypatch.setattr(family, "check_shapes_stay", refuse)
    for ask in (lambda: family.spectra_of(nominal, {"drum.speed": np.ones(1), "shoe.thickness": np.ones(1)}),
                lambda: family.state_matrix_of(nominal, ("drum.speed", "shoe.thickness"))):  # fmt: skip
        with pytest.raises(RequestError, match=r"shoe\.thickness"):
            ask()


def test_scenes_are_of_one_kind_that_differ_by_numbers_and_forces_alone(nominal):
    other = nominal.with_values({"contact.stiffness": 1e9, "drum.speed": -2.0})
    forced = nominal.with_values({"forcing": {"amplitude": {"Y": 3.0}, "frequency": 100.0}})
    assert family._kind(nominal)[0] == family._kind(other)[0] == family._kind(forced)[0]
    profile = nominal.with_values({"drum.speed": {"time": [0, 1, 2], "value": [1, 2, 3]}})
    longer = nominal.with_values({"drum.speed": {"time": [0, 1, 2, 3], "value": [1, 2, 3, 4]}})
    assert family._kind(profile) != family._kind(longer)
    assert dict(family._kind(longer)[1])["drum.speed.value"] == (4,)
    assert set(dict(family._kind(nominal)[1])) == set(numbers_of(nominal))
