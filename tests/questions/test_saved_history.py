"""A history is read as it was written; what is none, or not whole, is refused in one line that says why."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest
import xarray

from drumsqueal import simulation
from drumsqueal.errors import COMPLETE, RequestError
from drumsqueal.files import history_file
from drumsqueal.files.history_file import SavedHistory, read_history
from drumsqueal.files.in_place import variable
from drumsqueal.files.output_folder import check_output_file
from drumsqueal.simulation import run


@pytest.fixture(scope="module")
def short(nominal):
    return run(nominal.with_values({"simulate.duration": 0.03}))


@pytest.fixture
def file(short, tmp_path):
    path = tmp_path / "history.nc"
    short.history.to_netcdf(path, engine="h5netcdf")
    return path


def test_it_is_read_as_it_was_written(short, file):
    for asked in (file, file.parent):  # the file, or the folder that it is in
        saved = read_history(asked)
        assert saved.path == file
        assert saved.scene == short.scene
        assert saved.complete
        assert saved.sample_rate == pytest.approx(50e3, rel=1e-12)
        xarray.testing.assert_identical(saved.data, short.history)


@pytest.mark.parametrize("law", ["", "Plain, given in Python"])
def test_a_friction_law_that_the_scene_does_not_hold_is_named(monkeypatch, law):
    monkeypatch.setattr(simulation, "to_dataset", lambda *_: xarray.Dataset())
    monkeypatch.setattr(simulation, "compared", lambda prepared, history: history)
    prepared: Any = SimpleNamespace(scene=None, model=SimpleNamespace(names=()), given_law=law)
    chunk: Any = None
    history: Any = simulation.finish(prepared, [chunk], COMPLETE)
    assert SavedHistory(Path("history.nc"), history, prepared.scene).given_law == bool(law)
    assert history.attrs == ({"friction_law": law} if law else {})


def test_what_a_run_leaves_is_read(drumsqueal, empty_figures, tmp_path):
    scene = "scenarios/nominal.toml"
    status, _, _ = drumsqueal("run", scene, "-o", str(tmp_path / "a"), "--set", "simulate.duration=0.02")
    assert status == 0
    assert read_history(tmp_path / "a").data.sizes["time"] == 1001


def test_samples_that_were_not_computed_are_left_away(file):
    with h5py.File(file, "r+") as history:
        for name in ("displacement", "velocity", "normal_force"):
            variable(history, name)[700:] = np.nan
        history.attrs["outcome"] = "incomplete: the run was killed"
        history.attrs["ending"] = "cut off"
    saved = read_history(file)
    assert saved.data.sizes["time"] == 700
    assert not saved.complete
    with h5py.File(file, "r+") as history:
        variable(history, "velocity")[1:] = np.nan
    with pytest.raises(RequestError, match="has 1 computed samples, at least two are needed"):
        read_history(file)


def test_uneven_samples_are_refused(file):
    with h5py.File(file, "r+") as history:
        variable(history, "time")[5] += 1e-6
    with pytest.raises(RequestError, match="not evenly spaced"):
        read_history(file)


@pytest.mark.parametrize(
    ("break_it", "told"),
    [
        (lambda path: path.unlink(), "there is no such file"),
        (lambda path: path.write_bytes(b""), "not a history of drumsqueal"),
        (lambda path: path.write_text("time,Y\n0,1\n"), "not NetCDF-4"),
        (lambda path: path.write_bytes(path.read_bytes()[:20_000]), "cut short"),
        (lambda path: xarray.Dataset({"a": ("b", [1.0])}).to_netcdf(path, engine="h5netcdf"), "not a history"),
    ],
    ids=["missing", "empty", "text", "cut short", "another's"],
)
def test_what_is_no_history_is_refused(file, break_it, told):
    break_it(file)
    with pytest.raises(RequestError, match=told) as caught:
        read_history(file)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("missing", ["velocity", "friction_power", "time", "coordinate"])
def test_a_history_without_one_of_its_variables_is_refused(file, missing):
    with h5py.File(file, "r+") as history:
        history.move(missing, "another")
    with pytest.raises(RequestError, match="not a history of drumsqueal, or a damaged one"):
        read_history(file)


@pytest.mark.parametrize("scene", ["nonsense = [", "title = 'x'\n[engine]\npower = 3\n"])
def test_a_history_whose_scene_is_none_is_refused(file, scene):
    with h5py.File(file, "r+") as history:
        history.attrs["scene"] = scene
    with pytest.raises(RequestError, match=r"scene in it is not one|damaged"):
        read_history(file)


def test_a_file_that_is_there_is_not_replaced_unasked(tmp_path):
    there = tmp_path / "there.csv"
    there.write_text("mine")
    with pytest.raises(RequestError, match="exists; add --overwrite"):
        check_output_file(there, overwrite=False)
    check_output_file(there, overwrite=True)
    check_output_file(tmp_path / "new.csv", overwrite=False)
    for wrong in (tmp_path, there / "in a file.csv", tmp_path / "no folder" / "new.csv"):
        with pytest.raises(RequestError, match=r"is a folder|not a folder|there is no folder"):
            check_output_file(wrong, overwrite=True)


@pytest.mark.parametrize("off", [0.011, -0.011, 0.009, -0.009])
def test_samples_that_are_off_their_places_are_no_history(monkeypatch, tmp_path, off):
    monkeypatch.setattr(history_file, "MOTION", ("displacement",))
    monkeypatch.setattr(history_file, "signals_of", lambda scene: ())
    monkeypatch.setattr(history_file, "UNEVEN", 0.01)
    time = 2.0 + np.arange(6) / 10.0
    time[3] += 0.1 * off
    values = np.ones((6, 2))
    data = xarray.Dataset({"time": time, "displacement": (("time", "coordinate"), values)})
    if abs(off) > 0.01:
        with pytest.raises(RequestError, match="not evenly spaced"):
            history_file._computed(tmp_path, data, None)  # pyright: ignore[reportArgumentType]
        return
    assert history_file._computed(tmp_path, data, None).sizes["time"] == 6  # pyright: ignore[reportArgumentType]
    saved = history_file.SavedHistory(tmp_path, data, None)  # pyright: ignore[reportArgumentType]
    assert saved.sample_rate == pytest.approx(10.0)
    values[4, 1] = np.nan
    data = xarray.Dataset({"time": time, "displacement": (("time", "coordinate"), values)})
    assert history_file._computed(tmp_path, data, None).sizes["time"] == 4  # pyright: ignore[reportArgumentType]
    values[1, 0] = np.nan
    data = xarray.Dataset({"time": time, "displacement": (("time", "coordinate"), values)})
    with pytest.raises(RequestError, match="has 1 computed samples"):
        history_file._computed(tmp_path, data, None)  # pyright: ignore[reportArgumentType]
