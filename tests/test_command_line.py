"""The command line as a user meets it: what it writes, what it says, and with which exit status."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import xarray

from drumsqueal import cli
from drumsqueal.scene import load_scene, scene_from_dict

SCENARIOS = Path(__file__).parents[1] / "scenarios"
NOMINAL = str(SCENARIOS / "nominal.toml")
SHORT = ("--set", "simulate.duration=0.002")


@pytest.fixture
def drumsqueal(monkeypatch, capsys):
    """Run the command line in this process: exit status, standard output, standard error."""
    monkeypatch.setattr(cli, "prepare_environment", lambda: None)  # JAX is imported already

    def call(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["drumsqueal", *arguments])
        status = 0
        try:
            cli.main()
        except SystemExit as stop:
            status = int(stop.code or 0)
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return call


def test_run_leaves_history_summary_and_figures(drumsqueal, tmp_path):
    folder = tmp_path / "deep" / "out"
    status, printed, errors = drumsqueal("run", NOMINAL, "-o", str(folder), "--set", "simulate.duration=0.0201")
    assert (status, errors) == (0, "")
    assert "1424.32" in printed
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["outcome"] == "complete"
    assert {mode["name"] for mode in summary["growth"]["modes"]} >= {"X", "Y", "Tz"}
    assert {path.stem for path in folder.glob("*.png")} >= {"growth", "spectrogram", "spectra", "eigenvalues"}
    with xarray.open_dataset(folder / "history.nc", engine="h5netcdf") as history:
        assert history["displacement"].dims == ("time", "coordinate")
        assert list(history["coordinate"].values) == ["X", "Y", "Z", "Tx", "Ty", "Tz"]
        # 1005 intervals: two chunks and a piece of a third, sampled evenly, both ends included.
        np.testing.assert_allclose(history["time"].values, np.arange(1006) / 50e3, rtol=0, atol=1e-15)
        assert all(history[name].attrs.get("units") for name in history.data_vars)
        assert np.isfinite(history["displacement"].values).all()
        assert (history["displacement"].sel(coordinate=["Z", "Tx", "Ty"]).values == 0).all()
        assert history.attrs["outcome"] == "complete"
        # The scene in the file is the scene as it was run, with its settings.
        stored = tmp_path / "stored.toml"
        stored.write_text(history.attrs["scene"])
        assert load_scene(stored) == load_scene(NOMINAL, ["simulate.duration=0.0201"])
    assert scene_from_dict(_without_none(summary["scene"])) == load_scene(NOMINAL, ["simulate.duration=0.0201"])


def _without_none(tables: dict) -> dict:
    return {key: value for key, value in tables.items() if value is not None}


def test_history_is_not_overwritten_unasked(drumsqueal, tmp_path):
    assert drumsqueal("run", NOMINAL, "-o", str(tmp_path), *SHORT)[0] == 0
    before = (tmp_path / "history.nc").read_bytes()
    status, _, errors = drumsqueal("run", NOMINAL, "-o", str(tmp_path), *SHORT)
    assert status == 2
    assert "--overwrite" in errors
    assert (tmp_path / "history.nc").read_bytes() == before
    assert drumsqueal("run", NOMINAL, "-o", str(tmp_path), *SHORT, "--overwrite")[0] == 0


def test_stability_as_json(drumsqueal, tmp_path):
    status, printed, _ = drumsqueal("stability", NOMINAL, "--json", "-")
    assert status == 0
    data = json.loads(printed)  # nothing else on standard output
    assert set(data) == {"eigenvalues", "modes", "steady_state", "pressure_range_Pa"}
    assert len(data["eigenvalues"]) == 12
    assert [mode["name"] for mode in data["modes"] if mode["unstable"]] == ["Y", "X", "Tz"]
    assert set(data["modes"][0]) == {"name", "frequency_Hz", "growth_rate_1_per_s", "damping_ratio", "unstable"}
    file = tmp_path / "stability.json"
    assert drumsqueal("stability", NOMINAL, "--json", str(file))[:2] == (0, "")
    assert json.loads(file.read_text()) == data


def test_stability_on_the_terminal(drumsqueal):
    status, printed, _ = drumsqueal("stability", NOMINAL, "--set", "steady.state=self-consistent")
    assert status == 0
    assert "Steady sliding at X = -3.055e-07, Y = 7.591e-06, Tz = 1.161e-05" in printed


BAD_SCENES = {
    "unknown key": ("drum.sped=3", "drum.speed"),
    "wrong unit": ("shoe.outer_radius='100 s'", "length"),
    "not a number": ("drum.speed=nan", "drum.speed"),
    "thickness over radius": ("shoe.thickness=0.1", "shoe.thickness"),
    "no arc": ("shoe.arc_angle=0", "shoe.arc_angle"),
    "arc over a circle": ("shoe.arc_angle='361 deg'", "360"),
    "negative stiffness": ("support.upper_stiffness=-1", "support.upper_stiffness"),
    "folding sample rate": ("simulate.sample_rate=10000", "14797"),
    "profile that stands still": ("drum.speed={time=[0,1,1], value=[5,3,1]}", "drum.speed"),
    "drum at rest": ("drum.speed=0", "drum.speed"),
    "a mass of next to nothing": ("shoe.density=1e-300", "density"),
    "a stiffness out of all proportion": ("support.upper_stiffness=1e308", "stiffnesses"),
    "no such table": ("brake.speed=0", "brake"),
    "no setting": ("drum.speed", "KEY=VALUE"),
}


@pytest.mark.parametrize("case", BAD_SCENES)
def test_wrong_scene_gets_one_line_and_status_2(drumsqueal, tmp_path, case):
    setting, told = BAD_SCENES[case]
    folder = tmp_path / "out"
    status, printed, errors = drumsqueal("run", NOMINAL, "-o", str(folder), "--set", setting)
    assert (status, printed) == (2, "")
    assert errors.count("\n") == 1
    assert told in errors
    assert not folder.exists()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("run",), "SCENE"),
        (("run", "nowhere.toml"), "nowhere.toml"),
        (("run", str(SCENARIOS)), "scenarios"),
        (("run", __file__), "TOML"),
        (("run", NOMINAL, "--nonsense"), "--nonsense"),
        (("fly",), "fly"),
        (("run", NOMINAL, "-o", "/dev/null/out"), "/dev/null"),
        (("run", NOMINAL, "-o", "/proc/out"), "/proc/out"),
        (("stability", NOMINAL, "--json", "/dev/null/x"), "/dev/null/x"),
    ],
)
def test_wrong_request_gets_one_line_and_status_2(drumsqueal, arguments, told):
    status, printed, errors = drumsqueal(*arguments)
    assert (status, printed) == (2, "")
    assert errors.count("\n") == 1
    assert told in errors


def test_missing_key_is_named(drumsqueal, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(Path(NOMINAL).read_text().replace('width = "36.5 mm"', ""))
    status, _, errors = drumsqueal("run", str(scene), "-o", str(tmp_path / "out"))
    assert status == 2
    assert "shoe.width" in errors


def test_failed_run_keeps_what_was_computed(drumsqueal, tmp_path):
    # The lining is about to stick as a whole when the drum comes to rest: the step size collapses, and the run says so.
    stop = "drum.speed={time=[0,0.03], value=[0.5,0]}"
    arguments = ("--set", stop, "--set", "simulate.duration=0.04", "--set", "start.displacement={Y=1e-6}")
    status, _, errors = drumsqueal("run", NOMINAL, "-o", str(tmp_path), *arguments)
    assert status == 1
    assert errors.count("\n") == 1
    assert "step size collapsed" in errors
    with xarray.open_dataset(tmp_path / "history.nc", engine="h5netcdf") as history:
        assert history.attrs["outcome"].startswith("failed: the step size collapsed")
        assert history["time"].values[-1] == pytest.approx(0.03, abs=2e-3)
        assert np.isfinite(history["displacement"].values).all()
    assert json.loads((tmp_path / "summary.json").read_text())["outcome"].startswith("failed")


def start(cache: Path, *arguments: str) -> subprocess.Popen:
    # Without what JAX has put into the environment of this process when it was imported.
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("JAX_", "EQX_", "TF_"))}
    command = [sys.executable, "-c", "from drumsqueal.cli import main; main()", *arguments]
    environment["XDG_CACHE_HOME"] = str(cache)
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.skipif(os.name != "posix", reason="sends a POSIX signal and uses the XDG cache folder")
def test_second_start_compiles_nothing_and_control_c_keeps_data(tmp_path):
    cache, first, second = tmp_path / "cache", tmp_path / "first", tmp_path / "second"
    process = start(cache, "run", NOMINAL, "-o", str(first), *SHORT)
    _, errors = process.communicate(timeout=300)
    assert (process.returncode, errors) == (0, "")
    programs = sorted(path.name for path in cache.rglob("*-cache"))
    assert programs
    # Ten seconds of vibration would take a minute to compute.
    process = start(cache, "run", NOMINAL, "-o", str(second), "--set", "simulate.duration=10")
    deadline = time.monotonic() + 120
    while not (second / "history.nc").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=300)
    assert process.returncode == 1
    assert "interrupted by the user after t =" in errors
    assert errors.count("\n") == 1
    with xarray.open_dataset(second / "history.nc", engine="h5netcdf") as history:
        assert history.attrs["outcome"].startswith("interrupted by the user")
        assert history["time"].size > 500
        assert np.isfinite(history["velocity"].values).all()
    compiled = {path.name.split("-")[0] for path in cache.rglob("*-cache")} - {n.split("-")[0] for n in programs}
    assert "jit__advance" not in compiled
    assert "jit__assemble" not in compiled
