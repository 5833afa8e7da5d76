"""A shoe that is given as a solid mesh: the scene of a sector's mesh against that of the sector, and wrong meshes."""

import shutil
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from brakes import brake_of
from drumsqueal.errors import RequestError
from drumsqueal.physics import inventory
from drumsqueal.physics.bodies.rigid_shoe import RigidMesh
from drumsqueal.physics.elasticity import check_shapes_stay, elastic_frequencies, shoe_modes
from drumsqueal.physics.inventory import free_modes_in_words, take_inventory
from drumsqueal.physics.model import build_model
from drumsqueal.questions.check import mesh_contents
from drumsqueal.scene import Scene, SceneError, load_scene, scene_from_dict
from drumsqueal.simulation import prepare
from drumsqueal.solve.linear.modes import analyse_stability

MESHES = Path(__file__).with_name("meshes")
STEEL = {"young": 210e9, "poisson": 0.3, "up_to": 7e3}
# Free frequencies on the sector's mesh of 20 elements along are up to 2.1e-3 high; eigenvalues with contact follow.
MESHED = 2.5e-3
PINS = [
    {"at": [0.09, 0.02, 0.0], "direction": [0.0, 1.0, 0.0], "radius": 0.002, "stiffness": 1e8},
    {"at": [0.07, -0.05, 0.0], "direction": [1.0, 0.0, 0.0], "radius": 0.004, "stiffness": 5e7},
]


def meshed(nominal: Scene, file: str, **shoe) -> Scene:
    """The scene with a mesh in place of its sector."""
    tables = nominal._tables()
    kept = {key: value for key, value in tables["shoe"].items() if key == "density"}
    mesh = {"file": str(MESHES / file), "unit": "mm", "lining": "LINING"}
    return scene_from_dict({**tables, "shoe": {**kept, "mesh": mesh, **shoe}})


@pytest.mark.thorough
@pytest.mark.parametrize("springs", [(), PINS], ids=["free", "held"])
@pytest.mark.parametrize("elastic", [None, STEEL], ids=["rigid", "elastic"])
def test_the_mesh_of_a_sector_has_the_eigenvalues_of_the_sector(nominal, elastic, springs):
    shoe = {"elastic": elastic, "spring": list(springs)} if elastic else {"spring": list(springs)}
    sector = (
        nominal.with_values({f"shoe.{key}": value for key, value in shoe.items()}) if springs or elastic else nominal
    )
    wanted, found = (prepare(each).stability for each in (sector, meshed(nominal, "sector_hex27.msh", **shoe)))
    assert [mode.label for mode in found.modes] == [mode.label for mode in wanted.modes]
    for one, other in zip(found.modes, wanted.modes, strict=True):
        size = abs(other.eigenvalue)
        assert abs(one.eigenvalue - other.eigenvalue) < (MESHED if elastic else 1e-5) * size


@pytest.mark.thorough
def test_springs_exert_on_a_mesh_what_they_exert_on_the_sector(nominal):
    # Near the inner side of a shoe that bends, whose lining moves otherwise: by its shapes they were 45 % off.
    springs = [{"at": [0.045, 0.068, 0.0], "direction": each, "stiffness": 2e8} for each in ([1, 0, 0], [0, 1, 0])]
    dragged = nominal.with_values({"steady.state": "self-consistent"})
    own = {"elastic": STEEL, "spring": [{**each, "radius": 2e-3} for each in springs]}
    sector = dragged.with_values({f"shoe.{key}": each for key, each in own.items()})
    one, other = (brake_of(each).reactions[0].force_N for each in (meshed(dragged, "sector_hex27.msh", **own), sector))
    assert np.linalg.norm(np.subtract(one, other)) < 4 * MESHED * np.linalg.norm(other)


def test_what_is_included_says_over_which_patches_springs_act_on_a_shoe_that_bends(nominal, monkeypatch):
    # In which shapes it bends is not asked here; to find them takes a second each.
    monkeypatch.setattr(inventory, "kept_coordinates", lambda scene: scene.simulate.coordinates)
    monkeypatch.setattr(inventory, "coordinates_of", lambda _: ())
    monkeypatch.setattr(inventory, "elastic_names", lambda one: ("E1",) if one.shoe.elastic else ())
    rigid = nominal.with_values({"shoe.spring": PINS})
    assert "2 springs at points" in take_inventory(rigid).includes
    bending = rigid.with_values({"shoe.elastic": {**STEEL, "up_to": 3e3}})
    assert "2 springs at points, over 2 mm and 4 mm around them" in take_inventory(bending).includes
    at_points = bending.with_values({"shoe.spring.0.radius": 0.0, "shoe.spring.1.radius": 0.0})
    assert "2 springs at points" in take_inventory(at_points).includes
    one = bending.with_values({"shoe.spring": PINS[:1]})
    assert "a spring at a point, over 2 mm around it" in take_inventory(one).includes


def test_sizes_and_inertia_are_those_of_the_sector(nominal):
    scene = meshed(nominal, "sector_hex27.msh")
    for key in ("outer_radius", "thickness", "width", "arc_angle"):
        # The thickness of a sector is not its volume over the area of its lining, R h (2 − h/R)/2 / R.
        own = getattr(nominal.shoe, key)
        wanted = own * (1 - own / 2 / nominal.shoe.outer_radius) if key == "thickness" else own
        assert getattr(scene.shoe, key) == pytest.approx(wanted, rel=1e-5)
    one, other = build_model(scene).shoe, build_model(nominal).shoe
    np.testing.assert_allclose(np.array([*one.inertia]), np.array([*other.inertia]), rtol=1e-5)
    assert float(one.centroid) == pytest.approx(float(other.centroid), rel=1e-6)


def tilted() -> RigidMesh:
    axes, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    sizes = {"outer_radius": 0.1, "thickness": 0.02, "width": 0.03, "arc_angle": 2.0, "density": 1.0}
    inertia = {"m": 1.3, "centre": np.array([0.07, -0.01, 0.004]), "moments": np.array([3e-3, 4e-4, 5e-3])}
    return RigidMesh(**sizes, **inertia, axes=axes * np.sign(np.linalg.det(axes)))


def test_rigid_motion_about_tilted_axes_is_a_rigid_motion():
    shoe, point = tilted(), np.array([0.08, 0.05, -0.01])
    q = dict(zip(shoe.names, np.random.default_rng(2).normal(size=6), strict=True))
    turn = shoe.axes @ np.array([q[name] for name in ("Tx", "Ty", "Tz")])
    wanted = np.array([q[name] for name in "XYZ"]) + np.cross(turn, point - shoe.centre)
    np.testing.assert_allclose(np.asarray(shoe.shapes_at(jnp.asarray(point))) @ np.array([*q.values()]), wanted)
    angle, radius = np.arctan2(point[1], point[0]), np.hypot(point[0], point[1])
    radial, along, axial = shoe.displacement(q, angle, point[2], radius)
    cosine, sine = np.cos(angle), np.sin(angle)
    cartesian = [radial * cosine - along * sine, radial * sine + along * cosine, axial]
    np.testing.assert_allclose(cartesian, wanted)


def test_what_follows_the_drum_moves_along_it_alone():
    shoe = tilted()
    radial, along, axial = shoe.displacement(
        dict(zip(shoe.names, shoe.velocity_with_drum, strict=True)), np.linspace(-1, 1, 9), 0.01
    )
    np.testing.assert_allclose([radial + 0 * along, axial + 0 * along], 0.0, atol=1e-15)
    np.testing.assert_allclose(along, 0.1)


@pytest.mark.thorough
def test_materials_by_sets_change_the_modes(nominal):
    pad = {"set": "PAD", "young": 8e9, "poisson": 0.25, "density": 2500.0}
    scene = meshed(nominal, "shoe_hex20.inp", elastic=STEEL)
    bonded = scene.with_values({"shoe.mesh.material": [pad]})
    assert elastic_frequencies(bonded, "shoe")[0] < elastic_frequencies(scene, "shoe")[0]
    modes = shoe_modes(bonded)
    assert modes is not None
    assert float(build_model(bonded).shoe.inertia.X) == pytest.approx(modes.mass)
    assert str(free_modes_in_words(bonded)).startswith("The shoe bends; its free modes, when nothing holds it: E1 ")
    with pytest.raises(RequestError, match=r"shoe\.mesh\.material\.0\.young: the modes of the elastic shoe"):
        check_shapes_stay(bonded, "shoe.mesh.material.0.young")
    softer = bonded.with_values({"shoe.mesh.material.0.young": 4e9})
    assert analyse_stability(build_model(softer)).modes  # a sweep's point


def test_a_file_is_named_from_the_folder_of_its_scene(nominal, tmp_path, monkeypatch):
    (tmp_path / "parts").mkdir()
    shutil.copy(MESHES / "sector_hex27.msh", tmp_path / "parts")
    text = meshed(nominal, "sector_hex27.msh").to_toml().replace(str(MESHES), "parts")
    (tmp_path / "brake.toml").write_text(text)
    monkeypatch.chdir(tmp_path.parent)
    scene = load_scene(tmp_path / "brake.toml")
    assert scene.shoe.mesh is not None
    assert scene.shoe.mesh.file == str(tmp_path / "parts" / "sector_hex27.msh")
    assert load_scene(_written(tmp_path / "again.toml", scene.to_toml())) == scene
    with (tmp_path / "parts" / "sector_hex27.msh").open("a") as file:
        file.write("\n")
    with pytest.raises(SceneError, match=r"sha256.*the content of the file is not what it was"):
        load_scene(tmp_path / "again.toml")


def test_a_file_that_a_mesh_includes_is_part_of_its_content(nominal, tmp_path):
    text = (MESHES / "shoe_hex20.inp").read_text()
    first, _, rest = text.partition("*ELEMENT")
    (tmp_path / "nodes.inp").write_text(first)
    (tmp_path / "shoe.inp").write_text(f"*INCLUDE, INPUT=nodes.inp\n*ELEMENT{rest}")
    scene = meshed(
        nominal, "shoe_hex20.inp", mesh={"file": str(tmp_path / "shoe.inp"), "unit": "mm", "lining": "LINING"}
    )
    mesh = scene.shoe.mesh
    assert mesh is not None
    box = mesh.read().points.max(axis=0)
    (tmp_path / "nodes.inp").write_text(first.replace("*NODE", "*SYSTEM\n0., 0., 3.\n*NODE"))
    np.testing.assert_allclose(mesh.read().points.max(axis=0), box + np.array([0, 0, 0.003]), rtol=1e-12)
    with pytest.raises(SceneError, match=r"the content of the file is not what it was"):
        mesh.checked()
    (tmp_path / "nodes.inp").unlink()
    with pytest.raises(SceneError, match=r"shoe\.inp, line 1: the mesh file .*nodes\.inp cannot be read"):
        mesh.read()


def test_contents_of_a_mesh_are_summed_by_sets(nominal):
    pad = {"set": "PAD", "young": 8e9, "poisson": 0.25, "density": 2500.0}
    mesh = {"file": str(MESHES / "shoe_hex20.inp"), "unit": "mm", "lining": "LINING", "material": [pad]}
    scene = meshed(nominal, "shoe_hex20.inp", density=7850.0, mesh=mesh)
    (found,) = mesh_contents(scene)
    # A sector of 120 degrees between the radii of the pad: 96 and 100 mm, 30 mm wide (meshes/shoe.geo).
    volume = np.radians(120) / 2 * (0.1**2 - 0.096**2) * 0.03
    assert found.sets["PAD"].volume_m3 == pytest.approx(volume, rel=2e-4)  # of curved edges, which are parabolas
    assert found.sets["PAD"].mass_kg == pytest.approx(2500 * found.sets["PAD"].volume_m3, rel=1e-12)
    assert found.whole.mass_kg == pytest.approx(
        found.sets["PAD"].mass_kg + 7850 * found.sets["STEEL"].volume_m3, rel=1e-9
    )
    assert found.whole.mass_kg == pytest.approx(float(build_model(scene).shoe.inertia.X), rel=1e-9)
    assert (found.body, found.elements_by_type["C3D20"]) == ("shoe", found.whole.elements)
    assert (found.lowest_m[2], found.highest_m[0], found.highest_m[2]) == pytest.approx((-0.015, 0.1, 0.015))


def test_point_masses_count_in_the_inertia_of_a_shoe_and_are_listed(nominal, tmp_path):
    masses = "*ELEMENT, TYPE=MASS, ELSET=M\n9001, 1\n9002, 2\n9003, 2\n*MASS, ELSET=M\n0.1\n"
    file = _written(tmp_path / "shoe.inp", (MESHES / "shoe_hex20.inp").read_text() + masses)
    bare = meshed(nominal, "shoe_hex20.inp", density=7850.0)
    mesh = {"file": str(file), "unit": "mm", "mass_unit": "kg", "lining": "LINING"}
    scene = meshed(nominal, "shoe_hex20.inp", density=7850.0, mesh=mesh)
    (found,) = mesh_contents(scene)
    assert (found.point_masses, found.elements_by_type["MASS"]) == (2, 3)
    assert found.point_masses_kg == pytest.approx(0.3, rel=1e-12)
    masses = [float(build_model(each).shoe.inertia.X) for each in (bare, scene)]
    assert masses[1] - masses[0] == pytest.approx(0.3, rel=1e-9)
    assert found.whole.mass_kg == pytest.approx(masses[0], rel=1e-9)


def _written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("mesh", "reason"),
    [
        ({"file": "nowhere.inp"}, r"shoe\.mesh\.file.*cannot be read"),
        ({"lining": "PADS"}, r"shoe\.mesh\.lining = \"PADS\".*no set of faces or of nodes named PADS; there are: "),
        ({"lining": ""}, r"shoe\.mesh\.lining"),
        ({"unit": "yard"}, r"shoe\.mesh\.unit"),
        ({"unit": "m"}, r"shoe\.mesh\.unit = \"m\": the radius of the surface is then 100 m"),
        ({"sha256": "0" * 64}, r"shoe\.mesh\.sha256.*leave sha256 out"),
        ({"colour": "red"}, r"shoe\.mesh\.colour.*unknown"),
    ],
)
def test_a_wrong_table_says_what_would_be_right(nominal, mesh, reason):
    whole = {"file": str(MESHES / "shoe_hex20.inp"), "unit": "mm", "lining": "LINING", **mesh}
    with pytest.raises(SceneError, match=reason) as caught:
        meshed(nominal, "shoe_hex20.inp", mesh=whole)
    assert str(caught.value).isprintable()


def test_a_mesh_gives_the_sizes(nominal):
    with pytest.raises(SceneError, match=r"shoe\.outer_radius = 0\.2: the mesh of the shoe gives it, 0\.1 in SI"):
        meshed(nominal, "sector_hex27.msh", outer_radius=0.2)
    assert "shoe.outer_radius" not in meshed(nominal, "sector_hex27.msh").numbers()


def test_a_mesh_in_another_unit_is_another_shoe(nominal):
    wrong = {"file": str(MESHES / "sector_hex27.msh"), "unit": "cm", "lining": "LINING"}
    assert meshed(nominal, "sector_hex27.msh", mesh=wrong).shoe.outer_radius == pytest.approx(1.0)
