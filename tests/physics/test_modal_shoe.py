"""A shoe that is given by modal results: against its mesh, by CalculiX's shapes and by our own, and wrong files."""

import contextlib
import re
from pathlib import Path

import numpy as np
import pytest
import pyuff
from numpy.polynomial.legendre import legval2d

from drumsqueal.coordinates import is_static
from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies import given_modes, solid_elements
from drumsqueal.physics.bodies.given_modes import depth_of, read_modal_results
from drumsqueal.physics.bodies.solid_elements import Material, rigid_motions, solve_solid
from drumsqueal.physics.bodies.solid_mesh import read_solid_mesh
from drumsqueal.physics.composition import coordinates_of
from drumsqueal.physics.elasticity import count_modes, elastic_names, numbers_of, shoe_modes
from drumsqueal.physics.inventory import free_modes_in_words, take_inventory
from drumsqueal.physics.model import body_of
from drumsqueal.scene import Scene, SceneError, load_scene, scene_from_dict
from drumsqueal.simulation import prepare

MESHES = Path(__file__).with_name("meshes")
PAGE = Path(__file__).parents[2] / "docs" / "mesh.md"
BONDED = {"STEEL": Material(210e9, 0.3, 7820.0), "PAD": Material(8e9, 0.25, 2500.0)}
PAD = {"set": "PAD", "young": 8e9, "poisson": 0.25, "density": 2500.0}
UP_TO = 5.9e3
# On the lining both are polynomials fitted to the same elements, to their values at nodes or all over them: the fits
# miss 0.3 % and 0.4 % of the shapes, and eigenvalues change by less than a tenth of that.
FITTED = 3e-4
AT_A_NODE = {"at": [0.048, -0.0831384, -0.015], "direction": [0.0, 1.0, 0.0], "radius": 0.0, "stiffness": 1e7}


def with_shoe(nominal: Scene, **shoe) -> Scene:
    return scene_from_dict({**nominal._tables(), "shoe": shoe})


@pytest.fixture(scope="module")
def found():
    """Nodes (m), frequencies (Hz) and shapes (kg^-½) of the bonded shoe; rigid motions, mixed at random, come first."""
    mesh = read_solid_mesh(MESHES / "shoe_hex20.inp", "mm")
    solved, mass = solve_solid(mesh, BONDED, UP_TO + 1e3), solid_elements._matrices(mesh, BONDED)[1]
    rigid = rigid_motions(mesh.points)
    root = np.linalg.inv(np.linalg.cholesky(rigid.T @ (mass @ rigid))).T
    mixed = rigid @ root @ np.linalg.qr(np.random.default_rng(0).normal(size=(6, 6)))[0]
    shapes = np.concatenate([mixed.T.reshape(6, -1, 3), solved.shapes])
    hertz = np.concatenate([[0, 1e-3, 2e-3, 0.01, 0.02, 0.1], solved.frequencies])
    return {"nodes": mesh.points, "frequencies": hertz, "shapes": shapes, "modal_mass": np.ones(len(hertz))}


def as_npz(path: Path, found) -> Path:
    np.savez(path, **found)
    return path


def as_universal(path: Path, found, units: tuple[float, float] | None = None, **mode) -> Path:
    """The same as a universal file; `units` are a metre and a newton in those of the file."""
    nodes, numbers = found["nodes"], np.arange(len(found["nodes"])) + 11
    x, y, z = nodes.T
    sets = [{"type": 15, "node_nums": numbers, "x": x, "y": y, "z": z}]
    if units is not None:
        code = {"units_code": 9, "units_description": "".ljust(20), "temp_mode": 1, "temp": 1.0, "temp_offset": 0.0}
        sets.append({"type": 164, **code, "length": units[0], "force": units[1]})
    for k, shape in enumerate(found["shapes"]):
        kind = {"type": 55, "model_type": 1, "analysis_type": 2, "data_ch": 2, "spec_data_type": 8, "load_case": 0}
        of_mode = {"mode_n": k + 1, "freq": found["frequencies"][k], "modal_m": found["modal_mass"][k]}
        r1, r2, r3 = shape.T
        sets.append({**kind, **of_mode, "node_nums": numbers, "r1": r1, "r2": r2, "r3": r3, **mode})
    pyuff.UFF(str(path)).write_sets(sets, "overwrite")
    return path


def in_tonnes(found, scale: float = 1.0):
    """The same in mm, t and s, with shapes that are scaled otherwise."""
    factor = scale * np.sqrt(1e3)
    shapes, masses = factor * found["shapes"], scale**2 * found["modal_mass"]
    return {**found, "nodes": 1e3 * found["nodes"], "shapes": shapes, "modal_mass": masses}


@pytest.fixture(scope="module")
def meshed():
    """The nominal brake with the bonded shoe's mesh, held at a node."""
    mesh = {"file": str(MESHES / "shoe_hex20.inp"), "unit": "mm", "lining": "LINING", "material": [PAD]}
    steel = {"young": 210e9, "poisson": 0.3, "up_to": UP_TO}
    nominal = load_scene(Path(__file__).parents[2] / "scenarios" / "nominal.toml")
    scene = with_shoe(nominal, mesh=mesh, elastic=steel, density=7820.0, spring=[AT_A_NODE])
    return scene, prepare(with_modes_alone(scene)).stability


def with_modes_alone(scene: Scene) -> Scene:
    """A file has no more than its modes: how a mesh yields besides is left out."""
    names = [name for name in coordinates_of(scene) if not is_static(name)]
    return scene.with_values({"simulate.coordinates": names})


@pytest.mark.thorough
def test_the_modes_that_calculix_finds_have_the_eigenvalues_of_the_mesh(meshed):
    modes = {"file": str(MESHES / "shoe_modes.unv")}
    scene = with_shoe(meshed[0], modes=modes, elastic={"up_to": UP_TO}, spring=[AT_A_NODE])
    for mode, wanted in zip(prepare(with_modes_alone(scene)).stability.modes, meshed[1].modes, strict=True):
        assert mode.label == wanted.label
        assert abs(mode.eigenvalue - wanted.eigenvalue) < FITTED * abs(wanted.eigenvalue)
    check_same_shoe(scene, meshed[0])


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["npz", "npz in mm", "universal in mm"])
def test_our_own_modes_in_any_unit_and_scale_are_those_of_the_mesh(meshed, found, tmp_path, kind):
    table = {
        "npz": lambda: {"file": str(as_npz(tmp_path / "m.npz", found)), "unit": "m"},
        "npz in mm": lambda: {"file": str(as_npz(tmp_path / "m.npz", in_tonnes(found, 7.0))), "unit": "mm"},
        "universal in mm": lambda: {"file": str(as_universal(tmp_path / "m.unv", in_tonnes(found))), "unit": "mm"},
    }[kind]()
    scene = with_shoe(meshed[0], modes=table, elastic={"up_to": UP_TO}, spring=[AT_A_NODE])
    check_same_shoe(scene, meshed[0])
    count = count_modes(scene, "shoe")
    own, wanted = (numbers_of(each)["shoe.mesh.points"][..., :count] for each in (scene, meshed[0]))
    np.testing.assert_allclose(own, wanted, atol=1e-5 * np.max(np.abs(wanted)))


def check_same_shoe(scene: Scene, meshed: Scene) -> None:
    one, other = shoe_modes(scene), shoe_modes(meshed)
    assert one is not None
    assert other is not None
    # Six digits are written, of places and of shapes.
    assert one.mass == pytest.approx(other.mass, rel=1e-6)
    np.testing.assert_allclose(one.centre, other.centre, atol=1e-7)
    np.testing.assert_allclose(one.moments, other.moments, rtol=3e-5)
    count = count_modes(meshed, "shoe")
    np.testing.assert_allclose(one.frequencies[:count], other.frequencies[:count], rtol=5e-6)
    for key in ("outer_radius", "width", "arc_angle"):
        assert getattr(scene.shoe, key) == pytest.approx(getattr(meshed.shoe, key), rel=1e-6)
    places = np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 5))
    own, wanted = (
        np.array(legval2d(*places, each.coefficients[:count].transpose(2, 3, 1, 0))) for each in (one, other)
    )
    np.testing.assert_allclose(own, wanted, atol=0.03 * np.max(np.abs(wanted)))  # in the corners of the fit


def test_modal_results_move_a_patch_as_the_mean_of_its_nodes_and_a_point_as_the_nearest_one():
    nodes = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 3.0, 0.0]])
    shapes = np.random.default_rng(5).normal(size=(2, 3, 3))
    points = np.array([[0.1, 0.0, 0.0]] * 4)
    found = given_modes._motion_of_nodes(nodes, shapes, points, np.array([0.0, 0.05, 0.95, 4.0]))
    for moved, held in zip(found, ([0], [0], [0, 1], [0, 1, 2]), strict=True):
        np.testing.assert_allclose(moved, shapes[:, held].mean(axis=1).T, rtol=1e-14)


def test_a_scene_with_modes_survives_its_file_and_names_what_it_holds(nominal, found, tmp_path):
    as_npz(tmp_path / "m.npz", found)
    table = {"file": str(tmp_path / "m.npz"), "unit": "m"}
    scene = with_shoe(nominal, modes=table, elastic={"up_to": UP_TO})
    (tmp_path / "brake.toml").write_text(scene.to_toml().replace(str(tmp_path), "."))
    assert load_scene(tmp_path / "brake.toml") == scene
    assert not [key for key in scene.numbers() if key.startswith("shoe")]
    assert "bending of the shoe, free modes up to 5900 Hz" in take_inventory(scene).includes
    shoe = body_of(scene, coordinates_of(scene))
    # Mass-normalised, each is held by ω² of the frequency in the file, after those of six rigid motions.
    # The mode beyond the frequency is all that is left of the file for how it yields besides.
    held, wanted = np.diag(shoe.elastic_stiffness())[6:], found["frequencies"][6:]
    np.testing.assert_allclose(held, (2 * np.pi * wanted) ** 2, rtol=1e-9)
    assert elastic_names(scene) == ("E1", "E2", "E3", "E4", "S5")
    assert str(free_modes_in_words(scene)).endswith("; S5: how it yields besides to the lining and to springs")
    assert elastic_names(with_shoe(nominal, modes=table)) == ()
    as_npz(tmp_path / "m.npz", in_tonnes(found))
    with pytest.raises(SceneError, match=r"shoe\.modes\.sha256.*leave sha256 out"):
        load_scene(tmp_path / "brake.toml")


def test_units_of_the_file_count_unless_others_are_given(nominal, found, tmp_path):
    file = str(as_universal(tmp_path / "m.uff", in_tonnes(found), units=(1e3, 1.0)))
    stated = with_shoe(nominal, modes={"file": file})
    assert stated.shoe.outer_radius == pytest.approx(0.1, rel=1e-5)
    with pytest.raises(SceneError, match=r'unit = "m", and dataset 164 of .* states 0\.001 m; leave unit out'):
        with_shoe(nominal, modes={"file": file, "unit": "m"})
    file = str(as_npz(tmp_path / "m.npz", {**found, "nodes": 1e3 * found["nodes"]}))
    modes = shoe_modes(with_shoe(nominal, modes={"file": file, "unit": "mm", "mass_unit": "kg"}))
    assert modes is not None
    assert modes.mass == pytest.approx(0.36326, rel=1e-4)


def first(found, *modes: int):
    """Some of the modes alone."""
    own = list(modes)
    return {**found, **{key: found[key][own] for key in ("frequencies", "shapes", "modal_mass")}}


def scaled_to_one(found, norm=None, mass=1.0):
    """The shapes with a largest displacement, or without a norm a largest component, of 1, and a modal mass of all."""
    size = np.abs(found["shapes"]) if norm is None else np.linalg.norm(found["shapes"], axis=2, keepdims=True)
    return {**found, "shapes": found["shapes"] / np.max(size, axis=(1, 2), keepdims=True), "modal_mass": mass}


def of_length_one(found):
    """The shapes as vectors of length 1 over all nodes, and a modal mass of 1 for all."""
    return {
        **found,
        "shapes": found["shapes"] / np.linalg.norm(found["shapes"], axis=(1, 2), keepdims=True),
        "modal_mass": 1.0,
    }


WRONG = [
    (scaled_to_one, r"would be the distance of the farthest node"),
    (lambda f: scaled_to_one(f, 2), r"would be the distance of the farthest node.* export shapes of unit modal mass"),
    (lambda f: scaled_to_one(f, 2, 0.6), r"would be the distance of the farthest node"),
    (of_length_one, r"one length as vectors .*: each radius of gyration would be that of equal masses at all nodes"),
    (lambda f: first(f, *range(1, 10)), r"5 of the modes are rigid-body modes, and must be 6; export all modes from 0"),
    (lambda f: first(f, 0, 1, 2, 3, 4, 4, 6, 7), r"the six rigid-body modes are not independent"),
    (lambda f: {**f, "frequencies": f["frequencies"] + 900.0 * (np.arange(11) < 6)}, r"at 900\.1 Hz, as something"),
    (lambda f: {**f, "modal_mass": np.arange(11) + 1.0}, r"weighs .* kg along x, y and z, which must be equal"),
    (lambda f: {**f, "modal_mass": 0.0}, r"modal mass of mode 1 is 0, and must be positive"),
    (lambda f: {**f, "shapes": f["shapes"] * 1j}, r"complex; export the real modes"),
    (lambda f: {**f, "shapes": f["shapes"][:, 1:]}, r"must be \(n, 3\), \(m,\) and \(m, n, 3\)"),
    (lambda f: {**f, "shapes": f["shapes"] * (np.arange(11) != 7)[:, None, None]}, r"shape of mode 8 is zero at all"),
    (lambda f: first(f), r"holds no modes"),
    (lambda f: {**f, "nodes": f["nodes"][:0], "shapes": f["shapes"][:, :0]}, r"holds no nodes"),
    (lambda f: {**f, "shapes": f["shapes"] * np.nan}, r"not finite"),
    (lambda f: {"nodes": f["nodes"]}, r"has no array frequencies, shapes, modal_mass"),
    (lambda f: {**f, "nodes": f["nodes"] + [0, 0, 0.01]}, r"middle of the lining is at z = 0\.01 m"),
    (lambda f: {**f, "nodes": f["nodes"] @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]}, r"from 30 to 150 deg about z"),
    (lambda f: {**f, "nodes": f["nodes"][:, [2, 1, 0]]}, r"nodes at the largest radius .* (fill|lie in one line)"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "reason"), WRONG)
def test_a_wrong_file_is_refused_in_one_line(nominal, found, tmp_path, change, reason):
    file = str(as_npz(tmp_path / "m.npz", change(found)))
    with pytest.raises(SceneError, match=rf"shoe\.modes\.file.*{reason}") as caught:
        with_shoe(nominal, modes={"file": file, "unit": "m"})
    assert str(caught.value).isprintable()


def test_a_hole_in_the_lining_and_few_nodes_are_seen(nominal, found, tmp_path):
    x, y, z = found["nodes"].T
    theta, outside = np.degrees(np.arctan2(y, x)), np.hypot(x, y) > 0.0999
    for left_out, reason in (
        (outside & (abs(theta) < 13), r"nodes at the largest radius .* fill 7\d(\.\d)? % of 120 deg"),
        (outside & (abs(theta / 30 - np.round(theta / 30)) > 1e-3), r"are too few"),
        (outside & (abs(z) < 0.0149), r"are too few"),
    ):
        kept = {**found, "nodes": found["nodes"][~left_out], "shapes": found["shapes"][:, ~left_out]}
        with pytest.raises(SceneError, match=reason):
            with_shoe(nominal, modes={"file": str(as_npz(tmp_path / "m.npz", kept)), "unit": "m"})


def test_what_is_asked_for_must_be_in_the_file(nominal, found, tmp_path):
    table = {"file": str(as_npz(tmp_path / "m.npz", found)), "unit": "m"}
    for shoe, reason in (
        ({"elastic": {"up_to": 9e3}}, r"shoe\.elastic\.up_to = 9000\.0: the modes in the file end at 6609 Hz"),
        ({"elastic": {"up_to": UP_TO, "young": 2e11}}, r"shoe\.elastic\.young = .* leave it out"),
        ({"density": 7820.0}, r"shoe\.density = 7820\.0: the file of shoe\.modes gives it; leave it out"),
        ({"mesh": {"file": "shoe.inp"}}, r"shoe\.modes: .*by a mesh or by modes; leave out one"),
        ({"elastic": {"up_to": UP_TO}, "spring": [{**AT_A_NODE, "at": [0.05, 0, 0]}]},
         r"shoe\.spring\.0\.at = \[0\.05, 0\.0, 0\.0\]: the nearest node of the modes is 28 mm away"),
        ({"modes": {**table, "file": "nowhere.npz"}}, r"shoe\.modes\.file.*cannot be read"),
        ({"modes": {**table, "unit": "yard"}}, r'shoe\.modes\.unit = "yard": write "auto" or "m" or "mm"'),
        ({"modes": {"file": table["file"]}}, r"does not state its units; add unit"),
    ):  # fmt: skip
        with pytest.raises(SceneError, match=reason) as caught:
            with_shoe(nominal, **{"modes": table, **shoe})
        assert "more to mend" not in str(caught.value)
    # A rigid shoe moves at any point.
    assert with_shoe(nominal, modes=table, spring=[{**AT_A_NODE, "at": [0.05, 0, 0]}]).shoe.spring


def test_universal_files_of_something_else_are_refused(nominal, found, tmp_path):
    def refused(file: Path, reason: str) -> None:
        with pytest.raises(SceneError, match=rf"shoe\.modes\.file.*{reason}"):
            with_shoe(nominal, modes={"file": str(file), "unit": "m"})

    few = first(found, 0, 1)
    refused(as_universal(tmp_path / "a.unv", few, r1=few["shapes"][0, :, 0] * 1j), "complex; export the real modes")
    refused(as_universal(tmp_path / "b.unv", first(found)), r"no normal modes \(dataset 55\)")
    whole = as_universal(tmp_path / "c.unv", few).read_text()
    (tmp_path / "d.unv").write_text(whole[:-200])
    refused(tmp_path / "d.unv", "cut short")
    (tmp_path / "e.unv").write_text(whole.replace("E+", "?").replace("e+", "?"))
    refused(tmp_path / "e.unv", "cannot be read")
    (tmp_path / "f.inp").write_text("")
    refused(tmp_path / "f.inp", "neither a universal file")


SPELLINGS = {
    "D exponents": lambda text: re.sub(r"[eE](?=[+-]\d\d)", "D", text),
    "d exponents": lambda text: re.sub(r"[eE](?=[+-]\d\d)", "d", text),
    "blanks": lambda text: re.sub(r" *\n", lambda end: " " * 13 + "\n", text),
    "CR": lambda text: text.replace("\n", "\r"),
    "a byte order mark": lambda text: "\ufeff" + text,
}


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_universal_files_are_read_however_their_lines_are_filled(found, tmp_path, spelling):
    file = as_universal(tmp_path / "m.unv", first(found, *range(7)), units=(1.0, 1.0))
    wanted = read_modal_results(file)
    text = file.read_text()
    file.write_bytes(SPELLINGS[spelling](text).encode())
    assert SPELLINGS[spelling](text) != text
    for own, other in zip(read_modal_results(file), wanted, strict=True):
        np.testing.assert_array_equal(own, other)


def test_a_universal_file_in_two_systems_of_units_is_refused(found, tmp_path):
    few = first(found, *range(7))
    one, two = (as_universal(tmp_path / f"{k}.unv", few, units=(k, 1.0)).read_text() for k in (1.0, 1e3))
    mark = "    -1\n"
    (nodes, units, *modes), (_, other, *_) = (text.split(mark)[1::2] for text in (one, two))
    assert {units[:6], other[:6]} == {"   164"}
    for order, told in (
        ([units, nodes, *modes], None),
        ([nodes, *modes, units], None),
        ([units, nodes, other, *modes], "states other units for some of its nodes and modes"),
        ([nodes, units, *modes, other], "states other units for some of its nodes and modes"),
    ):
        (tmp_path / "m.unv").write_text("".join(mark + each + mark for each in order))
        with contextlib.nullcontext() if told is None else pytest.raises(RequestError, match=told):
            read_modal_results(tmp_path / "m.unv")


def test_nodes_in_two_places_or_along_other_axes_are_refused(found, tmp_path):
    file = as_universal(tmp_path / "m.unv", first(found, *range(7)), units=(1.0, 1.0))
    wanted, mark, twice = read_modal_results(file), "    -1\n", file.read_text()
    nodes = twice.split(mark)[1]
    lines = nodes.splitlines(keepends=True)
    moved = "".join([*lines[:-1], lines[-1][:40] + f"{7.0:13.5e}" + lines[-1][53:]])
    for added, told in ((nodes, None), (moved, r"node \d+ has two places; number nodes anew")):
        file.write_text(twice + mark + added + mark)
        with contextlib.nullcontext() if told is None else pytest.raises(RequestError, match=told):
            np.testing.assert_array_equal(read_modal_results(file).nodes, wanted.nodes)
    turned = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1], [0, 0, 0]])
    for kind, axes, label, told in (
        (0, np.eye(4, 3), 0, None),
        (1, np.eye(4, 3), 5, None),  # of other nodes
        (1, np.eye(4, 3), 0, "nodes are in the coordinate system 0, which is not the global one"),
        (0, turned, 0, "nodes are in the coordinate system 0"),
    ):
        file.write_text(twice)
        system = {"Part_UID": 1, "Part_Name": "p", "CS_colors": [1], "CS_names": ["c"], "CS_matrices": [axes]}
        system |= {"type": 2420, "CS_sys_labels": [label], "CS_types": [kind]}
        pyuff.UFF(str(file)).write_sets([system], "add")
        with contextlib.nullcontext() if told is None else pytest.raises(RequestError, match=told):
            np.testing.assert_array_equal(read_modal_results(file).nodes, wanted.nodes)


def test_the_lines_of_the_page_write_what_is_read(nominal, found, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (block,) = re.findall("```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    exec(compile(block, PAGE.name, "exec"), dict(in_tonnes(found)))  # the point of this test
    modes = shoe_modes(with_shoe(nominal, modes={"file": "shoe.npz", "unit": "mm"}))
    assert modes is not None
    assert modes.mass == pytest.approx(0.36326, rel=1e-4)


def test_a_shoe_is_drawn_as_deep_as_its_nodes_and_a_lining_alone_as_a_sheet():
    # Nodes at 100, 92 and 85 mm from the axis, wherever along it and about it; of those at 100 mm alone 2 % of that.
    nodes = np.array([[0.1, 0.0, 0.01], [0.0, 0.092, -0.01], [-0.051, -0.068, 0.0]])
    assert depth_of(nodes) == pytest.approx(0.015, rel=1e-12)
    assert depth_of(nodes[:1]) == pytest.approx(0.002, rel=1e-12)
