"""What goes out of a shoe that bends: mode shapes in universal files, and the error of its contact forces."""

import dataclasses
from typing import Any, cast

import numpy as np
import pytest

from drumsqueal.files.saved_history import read_history
from drumsqueal.findings.accuracy import estimate_quadrature_error
from drumsqueal.findings.history import to_dataset
from drumsqueal.outcome import COMPLETE
from drumsqueal.physics.bodies.body import displace
from drumsqueal.physics.composition import coordinates_of, kept_coordinates, linear_coordinates
from drumsqueal.physics.effects.effect import Observation
from drumsqueal.physics.model import body_of, build_model
from drumsqueal.questions.export.export import Part, export_history
from drumsqueal.questions.export.formats import find_format
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
    observed = Observation(*(cast("Any", np.full(count, float(each))) for each in at_once))
    time, ones = np.arange(count) / scene.simulate.sample_rate, cast("Any", np.ones(count))
    still = np.tile(displacement, (count, 1))
    return Chunk(time, still, 0 * still, observed, ones, ones, ones, 1, 0, 1.0, 0 * ones, None)


def test_the_error_of_contact_forces_is_that_of_coarser_cells(elastic):
    # Lifted off at one end, with bending: the boundary of contact runs through the cells.
    displacement = np.array([-6e-6, 0.0, 8e-5, 1e-6, 1e-6])
    model = build_model(elastic)
    assert model.names == ("X", "Y", "Tz", "E1", "E3")
    history = to_dataset([chunk_of(elastic, displacement)], elastic, model.names, COMPLETE)
    assert 0.3 < history["contact_fraction"].values[0] < 0.95
    error = estimate_quadrature_error(history, model)
    assert error is not None
    assert error < 1e-6  # of the load, as is asked of the default
    coarse = dataclasses.replace(model, contact=model.lining.on_cells(0.25, 0.5))
    state: Any = displacement, np.zeros(5)
    forces = [float(each.observe(0.0, *state).normal_force) for each in (coarse, model)]
    assert abs(forces[0] / forces[1] - 1) > 100 * error


def test_mode_shapes_of_a_bending_shoe_are_those_of_all_its_coordinates(elastic, tmp_path):
    pyuff = pytest.importorskip("pyuff")
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
        wanted = np.array(displace(body, mode.shape(stability.coordinates), *places[FIRST_OF_GRID]))
        assert at_corner == pytest.approx(wanted, rel=1e-4), mode.label  # five digits in the file
    # E2 moves out of the plane, and the history is of motion in it.
    assert "E2" not in kept
    (twist,) = (found for mode, found in zip(stability.modes, shapes, strict=True) if mode.name == "E2")
    assert np.abs(twist["r3"]).max() > 0.1
