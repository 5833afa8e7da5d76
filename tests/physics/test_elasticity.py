"""Elastic modes of a scene: what they are asked for, in which numbers a model has them, and with which they change."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.errors import RequestError
from drumsqueal.physics import elasticity
from drumsqueal.physics.bodies.drum_modes import DrumModes
from drumsqueal.physics.bodies.free_modes import FreeModes
from drumsqueal.physics.bodies.solid_elements import Material
from drumsqueal.scene import Scene, load_scene

RANDOM = np.random.default_rng(5)
SHOE = FreeModes(np.array([11.0, 17.0, 31.0]), RANDOM.normal(size=(3, 3, 3, 8, 5)), (True, False, True), 1e-3, 1e-3)
DRUM = DrumModes(np.array([7.0, 7.0, 19.0, 23.0]), np.array([2, 2, 3, 0]), RANDOM.normal(size=(4, 3, 2, 6)), 1e-3, 1e-3)
YOUNG, DENSITY, UP_TO = 2.1e11, 7700.0, 4321.0


@pytest.fixture
def bending() -> Scene:
    """An elastic drum around a shoe that bends, of unlike materials."""
    scene = load_scene(Path(__file__).parents[2] / "scenarios" / "elastic_drum.toml")
    elastic = {"young": YOUNG, "poisson": 0.31, "up_to": UP_TO}
    return scene.with_values({"shoe.elastic": elastic, "shoe.density": DENSITY, "drum.elastic.poisson": 0.23})


@pytest.fixture
def found(monkeypatch) -> dict[str, Any]:
    """What free modes and drum modes are asked for, in the place of finding them."""
    asked: dict[str, Any] = {}
    monkeypatch.setattr(elasticity, "find_free_modes", lambda *given: asked.update(shoe=given) or SHOE)
    monkeypatch.setattr(elasticity, "find_drum_modes", lambda *given: asked.update(drum=given) or DRUM)
    return asked


def test_modes_are_asked_for_up_to_the_wavenumber_of_the_frequency(bending, found):
    assert elasticity.free_modes(bending) is SHOE
    assert elasticity.drum_modes(bending) is DRUM
    shoe, drum = bending.shoe, bending.drum.elastic
    waves = 2 * math.pi * UP_TO / math.sqrt(YOUNG / DENSITY)
    wanted = shoe.outer_radius, shoe.thickness, shoe.width, shoe.arc_angle, 0.31, waves
    assert found["shoe"] == pytest.approx(wanted, rel=1e-14)
    waves = 2 * math.pi * drum.up_to / math.sqrt(drum.young / drum.density)
    wanted = shoe.outer_radius, drum.thickness, drum.width, drum.back_plate, drum.hub_radius, 0.23, waves
    assert found["drum"] == pytest.approx(wanted, rel=1e-14)
    rigid = bending.with_values({"shoe.elastic": None, "drum.elastic": None})
    assert (elasticity.free_modes(rigid), elasticity.drum_modes(rigid)) == (None, None)


def test_frequencies_and_names_are_those_of_the_materials(bending, found):
    del found
    drum = bending.drum.elastic
    hertz = SHOE.wavenumbers * math.sqrt(YOUNG / DENSITY) / (2 * math.pi)
    np.testing.assert_allclose(elasticity.elastic_frequencies(bending, "shoe"), hertz, rtol=1e-14)
    hertz = DRUM.wavenumbers * math.sqrt(drum.young / drum.density) / (2 * math.pi)
    np.testing.assert_allclose(elasticity.elastic_frequencies(bending, "drum"), hertz, rtol=1e-14)
    assert elasticity.elastic_names(bending) == ("E1", "E2", "E3")
    assert elasticity.elastic_names(bending, symmetric=True) == ("E1", "E3")
    assert elasticity.drum_names(bending) == ("drum.E1", "drum.E2", "drum.E3", "drum.E4")
    rigid = bending.with_values({"shoe.elastic": None, "drum.elastic": None})
    for body in ("shoe", "drum"):
        assert elasticity.elastic_frequencies(rigid, body) == []
    assert elasticity.elastic_names(rigid) == elasticity.drum_names(rigid) == ()


def test_a_model_has_shapes_with_zeros_up_to_the_next_multiple_of_four_degrees(bending, found):
    del found
    numbers = elasticity.numbers_of(bending)
    shapes = numbers["shoe.elastic.shapes"]
    assert shapes.shape == (3, 3, 4, 8, 8)
    np.testing.assert_array_equal(shapes[:, :, :3, :, :5], SHOE.coefficients)
    assert np.count_nonzero(shapes) == SHOE.coefficients.size
    across = numbers["drum.elastic.shapes"]
    assert across.shape == (4, 3, 2, 8)
    np.testing.assert_array_equal(across[..., :6], DRUM.coefficients)
    assert np.count_nonzero(across) == DRUM.coefficients.size
    np.testing.assert_array_equal(numbers["shoe.elastic.wavenumbers"], SHOE.wavenumbers)
    np.testing.assert_array_equal(numbers["drum.elastic.wavenumbers"], DRUM.wavenumbers)
    few, fewer = elasticity.modal_numbers(SHOE, 2), elasticity.drum_numbers(DRUM, 1)
    for key, each in {**few, **fewer}.items():
        np.testing.assert_array_equal(each, numbers[key][: 2 if key in few else 1])


def test_shapes_change_with_geometry_and_poissons_ratio_alone(bending, found):
    del found
    shoe = [f"shoe.{key}" for key in ("outer_radius", "thickness", "width", "arc_angle", "elastic.poisson")]
    drum = [f"drum.elastic.{key}" for key in ("thickness", "width", "back_plate", "hub_radius", "poisson")]
    assert set(elasticity.shaping_numbers(bending)) == {*shoe, *drum}
    for key in bending.numbers():
        if key not in (*shoe, *drum):
            elasticity.check_shapes_stay(bending, key)
    for key, said in (
        ("shoe.thickness", r"the elastic shoe change with it.*leave out shoe\.elastic$"),
        ("drum.elastic.width", r"the elastic drum change with it.*leave out drum\.elastic$"),
        ("shoe.outer_radius", r"elastic shoe and drum change .*leave out shoe\.elastic and drum\.elastic$"),
    ):
        with pytest.raises(RequestError, match=said) as caught:
            elasticity.check_shapes_stay(bending, key)
        assert str(caught.value).startswith(f"{key}: the modes of the")
    assert set(elasticity.shaping_numbers(bending.with_values({"shoe.elastic": None}))) == {"shoe.outer_radius", *drum}


def test_what_fails_to_be_found_is_a_request_that_cannot_be_met(bending, monkeypatch):
    def fails(*_):
        raise error

    for name, find in (("find_free_modes", elasticity.free_modes), ("find_drum_modes", elasticity.drum_modes)):
        monkeypatch.setattr(elasticity, name, fails)
        error: Exception = RequestError("too many")
        odd = bending.with_values({"shoe.density": 7.7})
        with pytest.raises(RequestError, match=r"^too many; shoe\.density = 7\.7 kg/m\^3 is far from"):
            find(odd)
    error = ArithmeticError("it does not converge")
    with pytest.raises(RequestError, match=r"^the shoe's free modes were not found: it does not converge$"):
        elasticity.free_modes(bending)


def test_a_drums_mesh_is_solved_for_its_own_material_as_unit(monkeypatch):
    """So that its wavenumbers are ω √(ρ/E), as the cup's."""
    asked: dict[str, Any] = {}

    def clamped(mesh, materials, surface, held, hertz):
        asked.update(mesh=mesh, materials=materials, sets=(surface, held), hertz=hertz)
        return SimpleNamespace(
            frequencies=np.array([3.0, 5.0]), harmonics=np.array([2, 4]), coefficients=np.ones(2), fit_error=0.01
        )

    class Drum(SimpleNamespace):
        """A table that can be a key."""

        def __hash__(self) -> int:
            return id(self)

    monkeypatch.setattr(elasticity, "find_clamped_drum", clamped)
    other = SimpleNamespace(set="HUB", young=6e10, poisson=0.33, density=2700.0)
    drum: Any = Drum(
        young=1.2e11,
        poisson=0.26,
        density=7200.0,
        material=(other,),
        surface="RUB",
        clamped="BOLTS",
        read=lambda: "mesh",
    )
    found = elasticity._drum_mesh_modes(drum, 44.0)
    assert (asked["mesh"], asked["sets"]) == ("mesh", ("RUB", "BOLTS"))
    assert asked["hertz"] == pytest.approx(44.0 / (2 * math.pi), rel=1e-15)
    assert asked["materials"]["HUB"] == pytest.approx(Material(0.5, 0.33, 0.375), rel=1e-15)
    assert asked["materials"][elasticity.EVERYWHERE] == Material(1.0, 0.26, 1.0)
    np.testing.assert_allclose(found.wavenumbers, 2 * math.pi * np.array([3.0, 5.0]), rtol=1e-15)
    assert found.harmonics.tolist() == [2, 4]
    assert (found.fit_error, math.isnan(found.frequency_change)) == (0.01, True)
