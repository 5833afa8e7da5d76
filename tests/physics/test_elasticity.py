"""Elastic modes of a scene: what they are asked for, in which numbers a model has them, and with which they change."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

from drumsqueal.errors import RequestError
from drumsqueal.physics import basis, elasticity, trial_shapes
from drumsqueal.physics.bodies import mode_shapes
from drumsqueal.physics.bodies.drum_modes import DrumModes
from drumsqueal.physics.bodies.free_modes import FreeModes
from drumsqueal.physics.bodies.solid_elements import Material
from drumsqueal.scene import Scene, load_scene

RANDOM = np.random.default_rng(5)
# Two of them up to `UP_TO` and one beyond; of the drum two up to 8 kHz, and two beyond.
SHOE = FreeModes(np.array([3.0, 5.0, 31.0]), RANDOM.normal(0, 30, (3, 3, 3, 8, 5)), (True, False, True))
DRUM = DrumModes(np.array([7.0, 7.0, 19.0, 23.0]), np.array([2, 2, 3, 0]), RANDOM.normal(0, 30, (4, 3, 2, 6)))
YOUNG, DENSITY, UP_TO = 2.1e11, 7700.0, 4321.0


@pytest.fixture
def bending() -> Scene:
    """An elastic drum around a shoe that bends, of unlike materials."""
    scene = load_scene(Path(__file__).parents[2] / "scenarios" / "elastic_drum.toml")
    elastic = {"young": YOUNG, "poisson": 0.31, "up_to": UP_TO}
    return scene.with_values({"shoe.elastic": elastic, "shoe.density": DENSITY, "drum.elastic.poisson": 0.23})


@pytest.fixture
def found(monkeypatch) -> dict[str, Any]:
    """What trial shapes of shoe and drum are asked for, in the place of finding them."""
    asked: dict[str, Any] = {}
    monkeypatch.setattr(trial_shapes, "find_free_modes", lambda *given: asked.update(shoe=given) or SHOE)
    monkeypatch.setattr(
        trial_shapes, "find_drum_modes", lambda *given, dents: asked.update(drum=(*given, dents)) or DRUM
    )
    for kept in ("_kept", "_whole", "_trial_side"):
        monkeypatch.setattr(basis, kept, basis.once(getattr(basis, kept).__wrapped__))
    monkeypatch.setattr(mode_shapes, "folder", None)
    return asked


def test_trial_shapes_are_asked_for_up_to_twice_the_wavenumber_of_the_frequency(bending, found):
    elasticity.shoe_modes(bending)
    shoe, drum = bending.shoe, bending.drum.elastic
    waves = 2 * 2 * math.pi * UP_TO / math.sqrt(YOUNG / DENSITY)
    wanted = shoe.outer_radius, shoe.thickness, shoe.width, shoe.arc_angle, 0.31, waves
    sector, poisson, highest, _ = found["shoe"]
    assert (*sector, poisson, highest) == pytest.approx(wanted, rel=1e-14)
    waves = 2 * 2 * math.pi * drum.up_to / math.sqrt(drum.young / drum.density)
    wanted = shoe.outer_radius, drum.thickness, drum.width, drum.back_plate, drum.hub_radius, 0.23, waves, True
    cup, *others = found["drum"]
    assert (*cup, *others) == pytest.approx(wanted, rel=1e-14)
    rigid = bending.with_values({"shoe.elastic": None, "drum.elastic": None})
    assert (elasticity.shoe_modes(rigid), elasticity.drum_modes(rigid)) == (None, None)


def test_springs_and_forces_act_on_patches_each_asked_for_once(bending, found):
    spring = {"at": [0.08, 0.01, 0.0], "direction": [1.0, 0.0, 0.0], "stiffness": 1e7, "radius": 2e-3}
    force = {"at": [0.09, 0.0, 0.0], "direction": [0.0, 1.0, 0.0], "size": 10.0, "radius": 3e-3}
    across = {**spring, "direction": [0.0, 1.0, 0.0]}
    elasticity.shoe_modes(
        bending.with_values({"shoe.spring": [spring, across], "shoe.force": [force], "steady.state": "self-consistent"})
    )
    assert found["shoe"][-1] == ((0.08, 0.01, 0.0, 2e-3), (0.09, 0.0, 0.0, 3e-3))


def test_modes_up_to_the_frequency_are_kept_as_they_are_and_others_as_the_brake_moves_them(bending, found):
    del found
    kept = elasticity.shoe_modes(bending)
    assert kept is not None
    signs = np.sign(np.sum(kept.coefficients[:2] * SHOE.coefficients[:2], axis=(1, 2, 3, 4)))
    np.testing.assert_allclose(kept.coefficients[:2], signs[:, None, None, None, None] * SHOE.coefficients[:2])
    assert kept.symmetric == (True, False, True)
    # The one beyond is slowed down to 4 times the frequency by more mass: its stiffness for the same motion stays.
    hertz = elasticity.elastic_frequencies(bending, "shoe")
    assert hertz[2] == pytest.approx(4 * UP_TO, rel=1e-12)
    share = hertz[2] / (SHOE.wavenumbers[2] * math.sqrt(YOUNG / DENSITY) / (2 * math.pi))
    assert share < 0.7
    np.testing.assert_allclose(np.abs(kept.coefficients[2]), share * np.abs(SHOE.coefficients[2]), rtol=1e-12)


def test_shapes_are_found_anew_with_what_they_depend_on_alone(bending, monkeypatch, found):
    del found
    asked = []
    monkeypatch.setattr(basis, "_sums_up_to", lambda part, *given: asked.append(given) or np.eye(len(part.own)))
    for values in (
        {},
        {"drum.speed": 3.0, "contact.normal_load": 10.0, "start.velocity.Y": 1e-3},
        {"contact.stiffness": 2e10},
        {"shoe.elastic.up_to": 1.1 * UP_TO},
        {"support.upper_stiffness": 1e7},
        {"drum.elastic.density": 7000.0},
    ):
        scene = bending.with_values(values)
        elasticity.shoe_modes(scene)
        elasticity.drum_modes(scene)
    assert len(asked) == 2 * 2 * 5  # of two bodies, those that are kept and further ones


def test_further_shapes_are_of_the_trial_shapes_of_those_that_are_kept(bending, monkeypatch, found):
    elasticity.shoe_modes(bending)
    del found["shoe"], found["drum"]
    more = {"shoe.elastic.up_to": basis.MORE * UP_TO, "drum.elastic.up_to": basis.MORE * bending.drum.elastic.up_to}
    monkeypatch.setattr(basis, "_assembled", None)
    with basis.further_shapes():
        further = elasticity.elastic_frequencies(bending.with_values(more), "shoe")
    assert found == {}
    # The third rings below four times the frequency, where it is not slowed down any more.
    assert further[2] == pytest.approx(SHOE.wavenumbers[2] * math.sqrt(YOUNG / DENSITY) / (2 * math.pi), rel=1e-12)


def test_what_is_kept_of_a_brake_is_found_once_for_all_processes(bending, monkeypatch, found, tmp_path):
    del found
    monkeypatch.setattr(mode_shapes, "folder", tmp_path)
    tmp_path.chmod(0o700)

    def shapes(scene):
        monkeypatch.setattr(basis, "_kept", basis.once(basis._kept.__wrapped__))  # as another process begins
        return elasticity.shoe_modes(scene), elasticity.drum_modes(scene)

    shoe, drum = shapes(bending)
    assert drum is not None
    monkeypatch.setattr(basis, "_whole", None)
    again = shapes(bending)
    assert again[1] is not None
    np.testing.assert_array_equal(again[0].coefficients, shoe.coefficients)
    np.testing.assert_array_equal(again[1].coefficients, drum.coefficients)
    with pytest.raises(TypeError, match="not callable"):
        shapes(bending.with_values({"contact.stiffness": 2e10}))


def test_frequencies_and_names_are_those_of_the_materials(bending, found):
    del found
    drum = bending.drum.elastic
    hertz = SHOE.wavenumbers[:2] * math.sqrt(YOUNG / DENSITY) / (2 * math.pi)
    np.testing.assert_allclose(elasticity.elastic_frequencies(bending, "shoe")[:2], hertz, rtol=1e-14)
    hertz = DRUM.wavenumbers[:2] * math.sqrt(drum.young / drum.density) / (2 * math.pi)
    np.testing.assert_allclose(elasticity.elastic_frequencies(bending, "drum")[:2], hertz, rtol=1e-14)
    assert [elasticity.count_modes(bending, body) for body in ("shoe", "drum")] == [2, 2]
    assert elasticity.elastic_names(bending) == ("E1", "E2", "S3")
    assert elasticity.elastic_names(bending, symmetric=True) == ("E1", "S3")
    assert elasticity.drum_names(bending) == ("drum.E1", "drum.E2", "drum.S3", "drum.S4")
    rigid = bending.with_values({"shoe.elastic": None, "drum.elastic": None})
    for body in ("shoe", "drum"):
        assert elasticity.elastic_frequencies(rigid, body) == []
        assert elasticity.count_modes(rigid, body) == 0
    assert elasticity.elastic_names(rigid) == elasticity.drum_names(rigid) == ()


def test_a_model_has_shapes_with_zeros_up_to_the_next_multiple_of_four_degrees(bending, found):
    del found
    numbers, shoe, drum = elasticity.numbers_of(bending), elasticity.shoe_modes(bending), elasticity.drum_modes(bending)
    assert shoe is not None
    assert drum is not None
    shapes = numbers["shoe.elastic.shapes"]
    assert shapes.shape == (3, 3, 4, 8, 8)
    np.testing.assert_array_equal(shapes[:, :, :3, :, :5], shoe.coefficients)
    assert np.count_nonzero(shapes) == shoe.coefficients.size
    across = numbers["drum.elastic.shapes"]
    assert across.shape == (4, 3, 2, 8)
    np.testing.assert_array_equal(across[..., :6], drum.coefficients)
    assert np.count_nonzero(across) == drum.coefficients.size
    np.testing.assert_array_equal(numbers["shoe.elastic.wavenumbers"], shoe.wavenumbers)
    np.testing.assert_array_equal(numbers["drum.elastic.wavenumbers"], drum.wavenumbers)


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
    def fails(*_, **__):
        raise error

    for name, find, rigid in (
        ("find_free_modes", elasticity.shoe_modes, "drum"),
        ("find_drum_modes", elasticity.drum_modes, "shoe"),
    ):
        monkeypatch.setattr(trial_shapes, name, fails)
        error: Exception = RequestError("too many")
        odd = bending.with_values({"shoe.density": 7.7, f"{rigid}.elastic": None})
        with pytest.raises(RequestError, match=r"^too many; shoe\.density = 7\.7 kg/m\^3 is far from"):
            find(odd)
    error = ArithmeticError("it does not converge")
    for rigid, find, whose in (
        ("drum", elasticity.shoe_modes, "shoe's free"),
        ("shoe", elasticity.drum_modes, "drum's"),
    ):
        with pytest.raises(RequestError, match=rf"^the {whose} modes were not found: it does not converge$"):
            find(bending.with_values({f"{rigid}.elastic": None}))


def test_a_drums_mesh_is_solved_for_its_own_material_as_unit(monkeypatch):
    """So that its wavenumbers are ω √(ρ/E), as the cup's."""
    asked: dict[str, Any] = {}

    def clamped(mesh, materials, surface, held, hertz, pressures):
        asked.update(mesh=mesh, materials=materials, sets=(surface, held), hertz=hertz, pressures=pressures)
        return DRUM

    class Mesh(NamedTuple):
        volumes: np.ndarray
        point_masses: np.ndarray

    class Drum(SimpleNamespace):
        """A table that can be a key."""

        def __hash__(self) -> int:
            return id(self)

    monkeypatch.setattr(trial_shapes, "find_clamped_drum", clamped)
    other = SimpleNamespace(set="HUB", young=6e10, poisson=0.33, density=2700.0)
    drum: Any = Drum(
        young=1.2e11,
        poisson=0.26,
        density=7200.0,
        material=(other,),
        surface="RUB",
        clamped="BOLTS",
        read=lambda: mesh,
        cylinder=lambda *_, whole_circle: SimpleNamespace(radius=0.1, width=0.06) if whole_circle else None,
    )
    mesh = Mesh(np.full(10, 2 * math.pi * 0.1 * 0.06 * 0.012 / 10), np.array([0.0, 3.6]))
    found = trial_shapes._drum_mesh_modes(drum, 44.0)
    assert asked["sets"] == ("RUB", "BOLTS")
    assert asked["mesh"].volumes is mesh.volumes
    assert asked["mesh"].point_masses.tolist() == [0.0, 3.6 / 7200.0]  # in units of its density, too
    # Waves as long as the drum is thick, times 1.75: around it, and across it two polynomials a wave.
    wave = 1.75 * 0.012
    assert asked["pressures"] == (int(2 * math.pi * 0.1 / wave), 1 + math.ceil(math.pi * 0.06 / wave))
    assert asked["hertz"] == pytest.approx(44.0 / (2 * math.pi), rel=1e-15)
    assert asked["materials"]["HUB"] == pytest.approx(Material(0.5, 0.33, 0.375), rel=1e-15)
    assert asked["materials"][trial_shapes.EVERYWHERE] == Material(1.0, 0.26, 1.0)
    assert found is DRUM
