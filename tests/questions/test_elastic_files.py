"""What goes out of a shoe that bends: mode shapes in universal files, and the error of its contact forces."""

import dataclasses
import re
from typing import Any, cast

import jax
import numpy as np
import pytest
import pyuff
import scipy.io

import drums
from drumsqueal.errors import COMPLETE
from drumsqueal.files.history_file import read_history
from drumsqueal.files.output_folder import find_format
from drumsqueal.findings.compare import estimate_quadrature_error
from drumsqueal.findings.history import to_dataset
from drumsqueal.physics.composition import coordinates_of, kept_coordinates, linear_coordinates
from drumsqueal.physics.effects.effect import Observation
from drumsqueal.physics.model import body_of, build_model
from drumsqueal.questions.export.export import Part, export_history
from drumsqueal.questions.export.signals import distinct
from drumsqueal.questions.export.uff58 import FIRST_OF_GRID, SECTIONS
from drumsqueal.solve.linear.modes import analyse_stability
from drumsqueal.solve.transient.integrate import Chunk

STEEL = {"young": 210e9, "poisson": 0.3, "up_to": 7e3}


@pytest.fixture(scope="module")
def elastic(nominal):
    return nominal.with_values({"shoe.elastic": STEEL})


def chunk_of(scene, displacement):
    """A history at one place throughout, observed as it is."""
    model, count = build_model(scene), 20
    rest: Any = np.zeros_like(displacement)
    at_once = model.observe(0.0, displacement, rest)
    observed = Observation.of_rows(cast("Any", np.full(count, float(each))) for each in jax.tree.leaves(at_once))
    time, ones = np.arange(count) / scene.simulate.sample_rate, cast("Any", np.ones(count))
    still = np.tile(displacement, (count, 1))
    return Chunk(time, still, 0 * still, observed, ones, ones, ones, 1, 0, 1.0, 0 * ones, None)


@pytest.mark.thorough
def test_the_error_of_contact_forces_is_that_of_coarser_cells(elastic):
    # Lifted off at one end, with bending: the boundary of contact runs through the cells.
    model = build_model(elastic)
    moved = {"X": -6e-6, "Tz": 8e-5, "E1": 1e-6, "E3": 1e-6}
    assert set(moved) < set(model.names)
    displacement = np.array([moved.get(name, 0.0) for name in model.names])
    history = to_dataset([chunk_of(elastic, displacement)], elastic, model.names, COMPLETE)
    assert 0.3 < history["contact_fraction"].values[0] < 0.95
    error = estimate_quadrature_error(history, model)
    assert error is not None
    assert error < 1e-6  # of the load, as is asked of the default
    coarse = dataclasses.replace(model, contact=model.lining.on_cells(0.25, 0.5))
    state: Any = displacement, 0 * displacement
    forces = [float(each.observe(0.0, *state).normal_force) for each in (coarse, model)]
    assert abs(forces[0] / forces[1] - 1) > 100 * error


@pytest.mark.thorough
def test_mode_shapes_of_a_bending_shoe_are_those_of_all_its_coordinates(elastic, tmp_path):
    kept = kept_coordinates(elastic)
    chunk = chunk_of(elastic, np.zeros(len(kept)))
    to_dataset([chunk], elastic, kept, COMPLETE).to_netcdf(tmp_path / "history.nc", engine="h5netcdf")
    saved = read_history(tmp_path / "history.nc")
    export_history(saved, tmp_path / "out.uff", find_format("uff58"), Part(("velocity_E1",)))
    sets = pyuff.UFF(str(tmp_path / "out.uff")).read_sets()
    (nodes,) = (each for each in sets if each["type"] == 2411)
    places = dict(
        zip(nodes["node_nums"].astype(int), zip(nodes["x"], nodes["y"], nodes["z"], strict=True), strict=True)
    )
    assert len(places) == 4 + 6 * SECTIONS
    stability = analyse_stability(build_model(elastic, coordinates=linear_coordinates(elastic)))
    shapes = [each for each in sets if each["type"] == 55]
    assert len(shapes) == len(stability.modes)
    body = body_of(elastic, coordinates_of(elastic))
    for mode, found in zip(stability.modes, shapes, strict=True):
        k = list(found["node_nums"].astype(int)).index(FIRST_OF_GRID)  # a corner of the lining
        at_corner = np.array([found[f"r{each}"][k] for each in (1, 2, 3)])
        wanted = np.array(body.displaced(mode.shape(stability.coordinates), *places[FIRST_OF_GRID]))
        assert at_corner == pytest.approx(wanted, rel=1e-4), mode.label  # five digits in the file
    # E2 moves out of the plane, and the history is of motion in it.
    assert "E2" not in kept
    (twist,) = (found for mode, found in zip(stability.modes, shapes, strict=True) if mode.name == "E2")
    assert np.abs(twist["r3"]).max() > 0.1


CUP = {**drums.CUP, "up_to": 1.5e3}
# Of three short shoes, in rad, not in their order.
PLACES = {"leading": 0.0, "upper-left": np.pi / 2, "trailing": np.pi}


def moving(scene, folder):
    """A history of random velocities, and these by coordinate."""
    names = kept_coordinates(scene)
    velocity = np.random.default_rng(3).normal(size=(20, len(names)))
    chunk = chunk_of(scene, np.zeros(len(names)))._replace(velocity=velocity)
    to_dataset([chunk], scene, names, COMPLETE).to_netcdf(folder / "history.nc", engine="h5netcdf")
    return read_history(folder / "history.nc"), dict(zip(names, velocity.T, strict=True))


@pytest.fixture(scope="module")
def three(nominal, tmp_path_factory):
    """A history of three shoes, its velocities, and the datasets of its universal file."""
    folder = tmp_path_factory.mktemp("three")
    saved, velocity = moving(drums.several(nominal, PLACES, CUP, arc_angle=1.4, title="Three"), folder)
    return saved, velocity, universal(saved, folder)


@pytest.fixture(scope="module")
def one(nominal, tmp_path_factory):
    """The same of one shoe on a drum that bends."""
    folder = tmp_path_factory.mktemp("one")
    saved, velocity = moving(nominal.with_values({"drum.elastic": CUP}), folder)
    return saved, velocity, universal(saved, folder)


def universal(saved, folder):
    """The datasets of all its signals in a universal file."""
    export_history(saved, folder / "out.uff", find_format("uff58"), Part())
    return pyuff.UFF(str(folder / "out.uff")).read_sets()


@pytest.mark.thorough
@pytest.mark.parametrize("shoes", ["one", "three"])
def test_names_in_a_universal_file_leave_the_fields_after_them_where_they_are(shoes, request):
    saved, _, sets = request.getfixturevalue(shoes)
    signals = [each for each in sets if each["type"] == 58]
    assert len({each["rsp_ent_name"] for each in signals}) == len(signals)
    assert {(each["load_case_id"], each["ref_node"], each["ref_dir"]) for each in signals} == {(0, 0, 0)}
    found = {each["id1"].partition(":")[0]: (each["rsp_node"], each["rsp_dir"]) for each in signals}
    for number, prefix in enumerate(saved.scene.prefixes):
        first = 10_000 * number
        assert found[f"displacement_{prefix}Tx"] == (first + 1, 4)
        assert found[f"velocity_{prefix}Y"] == (first + 1, 2)
        assert found[f"{prefix}surface_velocity_trailing_along"] == (first + 4, 2)
    assert found["velocity_drum.E1"] == found["brake_torque"] == (0, 0)


@pytest.mark.thorough
def test_signals_of_a_turned_shoe_are_along_the_axes_that_its_node_states(three):
    _, velocity, sets = three
    systems, nodes = (next(each for each in sets if each["type"] == kind) for kind in (2420, 2411))
    axes = dict(zip(systems["CS_sys_labels"], systems["CS_matrices"], strict=True))
    system = dict(zip(nodes["node_nums"], nodes["disp_cs"], strict=True))
    place = dict(zip(nodes["node_nums"], zip(nodes["x"], nodes["y"], strict=True), strict=True))
    moves = {
        (each["rsp_node"], each["rsp_dir"]): each["data"]
        for each in sets
        if each["type"] == 58 and each["id1"].startswith(("velocity_", *PLACES)) and each["rsp_node"]
    }
    turns = {0.0: lambda x, y: (x, y), np.pi / 2: lambda x, y: (-y, x), np.pi: lambda x, y: (-x, -y)}
    for number, (name, angle) in enumerate(PLACES.items()):
        centre, middle = 10_000 * number + 1, 10_000 * number + 2
        along = {}
        for first, kinds in ((1, ("X", "Y", "Z")), (4, ("Tx", "Ty", "Tz"))):
            own = np.array([moves[centre, first + k] for k in range(3)])
            along[first] = axes[system[centre]][:3].T @ own
            x, y, z = (velocity[f"{name}.{kind}"] for kind in kinds)
            np.testing.assert_allclose(along[first], [*turns[angle](x, y), z], atol=1e-10)
        # The lining's middle moves so, too, which has the cylindrical system: v + ω × (p − g).
        x, y = np.subtract(place[middle], place[centre])
        moved = along[1][:2] + along[4][2] * np.array([[-y], [x]])
        radial = np.array(place[middle]) / np.hypot(*place[middle])
        np.testing.assert_allclose(moves[middle, 1], radial @ moved, atol=1e-8)
        np.testing.assert_allclose(moves[middle, 2], [-radial[1], radial[0]] @ moved, atol=1e-8)


@pytest.mark.thorough
def test_signals_of_several_shoes_have_names_in_a_mat_file_that_matlab_takes(three, tmp_path):
    saved, velocity, _ = three
    export_history(saved, tmp_path / "out.mat", find_format("mat"), Part())
    file = scipy.io.loadmat(tmp_path / "out.mat", simplify_cells=True)
    names = [name for name in file if not name.startswith("__")]
    assert all(re.fullmatch("[A-Za-z][A-Za-z0-9_]{0,62}", name) for name in names)
    np.testing.assert_array_equal(file["velocity_upper_left_X"], velocity["upper-left.X"])
    assert file["units"]["upper_left_surface_velocity_trailing_along"] == "m/s"  # of more than 31 characters
    assert file["units"]["velocity_drum_E1"] == "m kg^0.5/s"


@pytest.mark.thorough
def test_loads_of_each_shoe_are_in_the_history_and_go_out(three):
    saved, _, sets = three
    given = {each["id1"].partition(":")[0]: each for each in sets if each["type"] == 58}
    for name, each in zip(PLACES, saved.scene.shoes, strict=True):
        wanted = saved.scene.contact.normal_load
        assert saved.data[f"{name}.normal_force"].values == pytest.approx(wanted, rel=1e-9), each
        assert given[f"{name}.normal_force"]["data"] == pytest.approx(wanted, rel=1e-5)
    short = [each["rsp_ent_name"] for each in given.values() if each["id1"].partition(":")[0].endswith("brake_torque")]
    assert short == ["torque", "torque1", "torque2", "torque3"]


@pytest.mark.thorough
def test_names_that_are_too_long_or_alike_are_told_apart():
    assert distinct(["abc", "abcdef", "abc", "abcdeg"], 5) == ["abc", "abc_2", "abc_3", "abc_4"]


@pytest.mark.thorough
def test_the_sound_of_several_shoes_is_of_the_one_that_moves_most(three, tmp_path, drumsqueal):
    saved, _, _ = three
    data = saved.data.copy(deep=True)
    data["velocity"].loc[{"coordinate": "upper-left.Y"}] *= 100
    data.to_netcdf(tmp_path / "history.nc", engine="h5netcdf")
    status, printed, errors = drumsqueal("export", str(tmp_path), "--to", "wav")
    assert status == 0, errors
    assert "upper-left.surface_velocity, " in printed
