"""The command line as a user meets it: what it writes, what it says, and with which exit status."""

import json
import math
import os
import shlex
from pathlib import Path

import numpy as np
import pytest
import xarray

from drumsqueal.errors import RequestError
from drumsqueal.files.output_folder import (
    FILES,
    FORMATS,
    REPORT,
    RUN_FILES,
    check_output,
    check_output_file,
    made_of,
    to_json,
)
from drumsqueal.questions.animate.animation import GIF
from drumsqueal.questions.run.answer import run_into
from drumsqueal.questions.stability import bistable_words
from drumsqueal.scene import load_scene, scene_from_dict
from drumsqueal.scene.variation import read_variation
from drumsqueal.simulation import prepare

SCENARIOS = Path(__file__).parents[2] / "scenarios"
NOMINAL = str(SCENARIOS / "nominal.toml")
SHORT = ("--set", "simulate.duration=0.002")
MODES = ("mode-Y.gif", "mode-drum.E12(2).gif", "mode-rear_shoe.Y.gif")  # of modes that some scene or other has
MADE = {REPORT, *made_of("history.nc"), *MODES}  # of a run's results, by report, export and animate


@pytest.fixture(scope="module")
def short_run(tmp_path_factory, nominal, quiet_reply, empty) -> Path:
    """A folder with a run of 2 ms."""
    folder = tmp_path_factory.mktemp("short")
    with pytest.MonkeyPatch.context() as patch:
        empty(patch)
        run_into(prepare(nominal.with_values({"simulate.duration": 0.002})), quiet_reply(folder))
    return folder


def test_run_leaves_history_summary_and_figures(drumsqueal, tmp_path, as_kept):
    folder = tmp_path / "deep" / "out"
    status, printed, errors = drumsqueal("run", NOMINAL, "-o", str(folder), "--set", "simulate.duration=0.0201")
    assert (status, errors) == (0, "")
    as_kept("run", printed, folder)
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


@pytest.mark.usefixtures("empty_figures")
def test_history_is_not_overwritten_unasked(drumsqueal, tmp_path):
    assert drumsqueal("run", NOMINAL, "-o", str(tmp_path), *SHORT)[0] == 0
    before = (tmp_path / "history.nc").read_bytes()
    status, _, errors = drumsqueal("run", NOMINAL, "-o", str(tmp_path), *SHORT)
    assert status == 2
    assert "--overwrite" in errors
    assert (tmp_path / "history.nc").read_bytes() == before
    assert drumsqueal("run", NOMINAL, "-o", str(tmp_path), *SHORT, "--overwrite")[0] == 0


@pytest.mark.parametrize("name", [*RUN_FILES, *MODES])
def test_no_result_is_overwritten_unasked(drumsqueal, tmp_path, name):
    (tmp_path / name).write_text("of value")
    status, printed, errors = drumsqueal("run", NOMINAL, "-o", str(tmp_path), *SHORT)
    assert (status, printed) == (2, "")
    written = "remove" if name in MADE else "replace"
    assert f"{name} exists; add --overwrite to {written} it" in errors
    assert [path.read_text() for path in tmp_path.iterdir()] == ["of value"]


@pytest.mark.thorough
def test_overwriting_clears_all_results_of_an_earlier_run_and_nothing_else(drumsqueal, tmp_path):
    own = {"notes.txt", "mode-of-mine.gif"}
    for name in (*RUN_FILES, *MODES, *own):
        (tmp_path / name).write_text("of value")
    # 100 samples are too few for a spectrogram, no frequency drifts, no speed changes, the steady pressure is given,
    # and a complete run leaves nothing to resume.
    status, printed, _ = drumsqueal("run", NOMINAL, "-o", str(tmp_path), "--overwrite", *SHORT)
    assert status == 0
    absent = {"spectrogram.png", "waterfall.png", "pressure.png", "frequency.png", "resume.json"} | MADE
    told = " ".join(printed.split()).partition("Removed with the results that they were made of: ")[2].split(", ")
    assert {name.split()[0] for name in told[: len(MADE)]} == MADE
    assert {path.name for path in tmp_path.iterdir()} == {*RUN_FILES, *own} - absent
    assert {path.name for path in tmp_path.iterdir() if path.read_bytes() == b"of value"} == own


def test_what_is_made_of_a_history_by_default_goes_with_it():
    made = {f"history{ending}" for ending in (GIF, *(each.suffix for each in FORMATS.values()))}
    assert set(made_of("history.nc")) == made <= set(RUN_FILES)
    assert set(made_of("cycle.nc")) <= set(FILES["cycle"])


WITH_A_FOLDER = {
    "run": ("summary.json", ()),
    "onset": ("onset.json", ("--along", "drum.speed=2..8x2")),
    "cycle": ("cycle.json", ()),
    "motion": ("motion.json", ()),
    "effects": ("effects.csv", ()),
    "accuracy": ("accuracy.csv", ()),
    "sweep": ("sweep.nc", ("--vary", "drum.speed=2..8x2")),
    "sensitivity": ("sensitivity.json", ()),
}


@pytest.mark.parametrize("command", WITH_A_FOLDER)
def test_json_replaces_neither_the_scene_nor_a_result(drumsqueal, tmp_path, command):
    scene, folder = tmp_path / "scene.toml", tmp_path / "results"
    folder.mkdir()
    written, more = WITH_A_FOLDER[command]
    for file, held in ((scene, Path(NOMINAL).read_text()), (folder / written, "of value")):
        file.write_text(held)
        request = [command, str(scene), "-o", str(folder), *more, "--overwrite", "--json", str(file)]
        status, printed, error = drumsqueal(*request)
        assert (status, printed) == (2, "")
        assert f"{file} would replace {file}, which is read or written, too; name another with --json" in error
        assert file.read_text() == held


def test_no_result_replaces_the_scene_that_it_is_made_of(drumsqueal, tmp_path):
    scene = tmp_path / "quiet.toml"
    scene.write_text(Path(NOMINAL).read_text())
    status, _, error = drumsqueal("sensitivity", str(scene), "-o", str(tmp_path), "--overwrite")
    assert (status, error.count("\n")) == (2, 1)
    assert f"{scene} would replace {scene}, which is read or written, too; name another with -o" in error
    assert scene.read_text() == Path(NOMINAL).read_text()


@pytest.mark.parametrize("command", ["check", "stability"])
def test_json_does_not_replace_the_scene(drumsqueal, tmp_path, command):
    scene = tmp_path / "scene.toml"
    scene.write_text(Path(NOMINAL).read_text())
    assert drumsqueal(command, str(scene), "--json", str(scene), "--overwrite")[0] == 2
    assert scene.read_text() == Path(NOMINAL).read_text()


@pytest.mark.parametrize("name", ["growth.png", "growth.png.part"])
def test_a_folder_in_the_place_of_a_result_is_refused_before_anything_is_cleared(drumsqueal, tmp_path, name):
    (tmp_path / "history.nc").write_text("of value")
    (tmp_path / name).mkdir()
    status, _, errors = drumsqueal("run", NOMINAL, "-o", str(tmp_path), "--overwrite")
    assert status == 2
    assert f"{name} is a folder" in errors
    assert (tmp_path / "history.nc").read_text() == "of value"
    status, _, errors = drumsqueal("stability", NOMINAL, "--json", str(tmp_path / "growth.png"), "--overwrite")
    assert (status, errors.count("is a folder")) == (2, 1)


@pytest.mark.usefixtures("empty_figures")
def test_no_name_of_a_scene_leads_out_of_the_folder_of_results(drumsqueal, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "...toml").write_text(Path(NOMINAL).read_text().replace("Nominal squeal", "../../elsewhere"))
    assert drumsqueal("run", "...toml", *SHORT)[0] == 0
    assert {path.name for path in tmp_path.iterdir()} == {"...toml", "out"}
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["scene"]


@pytest.mark.parametrize("name", ["[red]x[/nope]", ":smile:"])
@pytest.mark.usefixtures("empty_figures")
def test_a_name_is_printed_as_it_is(drumsqueal, tmp_path, name):
    folder = tmp_path / name
    status, printed, errors = drumsqueal("run", NOMINAL, "-o", str(folder), *SHORT)
    assert (status, errors) == (0, "")
    assert f"Results are in {folder}: " in printed
    assert str(folder) in drumsqueal("run", NOMINAL, "-o", str(folder), *SHORT)[2]


@pytest.mark.usefixtures("empty_figures")
def test_escapes_in_a_name_reach_no_terminal(drumsqueal, tmp_path):
    folder = tmp_path / "a\x1b[2J\udcffb"
    status, printed, errors = drumsqueal("run", NOMINAL, "-o", str(folder), *SHORT)
    assert (status, errors) == (0, "")
    assert "a?[2J?b: history.nc" in printed
    assert "a?[2J?b/history.nc exists" in drumsqueal("run", NOMINAL, "-o", str(folder), *SHORT)[2]


def test_a_number_that_is_not_finite_is_null_in_json():
    assert json.loads(to_json({"a": [math.nan, (math.inf, 1.5)], "b": {"c": -math.inf}})) == {
        "a": [None, [None, 1.5]],
        "b": {"c": None},
    }


def test_stability_as_json(drumsqueal, tmp_path):
    status, printed, _ = drumsqueal("stability", NOMINAL, "--json", "-")
    assert status == 0
    data = json.loads(printed)  # nothing else on standard output
    assert set(data) == {"eigenvalues", "modes", "steady_state", "pressure_range_Pa", "resolution"}
    assert data["resolution"] is None  # nothing bends
    assert len(data["eigenvalues"]) == 12
    assert [mode["name"] for mode in data["modes"] if mode["unstable"]] == ["Y", "X", "Tz"]
    assert set(data["modes"][0]) == {"name", "frequency_Hz", "growth_rate_1_per_s", "damping_ratio", "unstable"}
    file = tmp_path / "stability.json"
    assert drumsqueal("stability", NOMINAL, "--json", str(file))[:2] == (0, "")
    assert json.loads(file.read_text()) == data


def test_stability_on_the_terminal(drumsqueal):
    status, printed, _ = drumsqueal("stability", NOMINAL, "--set", "steady.state=self-consistent")
    assert status == 0
    assert "Steady sliding at X = -3.055e-07 m, Y = 7.591e-06 m, Tz = 1.161e-05 rad" in printed


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

FAR_FROM_A_BRAKE = {"a mass of next to nothing", "a stiffness out of all proportion"}


@pytest.mark.parametrize("case", BAD_SCENES)
def test_wrong_scene_gets_one_line_and_status_2(drumsqueal, tmp_path, case):
    setting, told = BAD_SCENES[case]
    folder = tmp_path / "out"
    status, printed, errors = drumsqueal("run", NOMINAL, "-o", str(folder), "--set", setting)
    # A number that no drum brake has is noted, too: it may be why. The refusal is by itself on standard error.
    note = f"Note: {setting.partition('=')[0]} = " if case in FAR_FROM_A_BRAKE else ""
    assert (status, printed.count("Note: "), printed.startswith(note)) == (2, bool(note), True)
    assert bool(printed) == bool(note)
    assert errors.count("\n") == 1
    assert errors.startswith("drumsqueal: ")
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
        (("run", NOMINAL, "-o", ""), "the name of the folder is empty"),
        (("run", NOMINAL, "-o", "x" * 300), "File name too long"),
        (("run", NOMINAL, "-o", "/tmp/" + "x/" * 4000), "File name too long"),
        (("run", NOMINAL, "-o", f"{__file__}/under"), "test_command_line.py is a file, not a folder"),
        (("run", f"{SCENARIOS}/[/nope].toml"), "[/nope].toml: there is no such file"),
        (("run", NOMINAL, "--set", r'title="\u0000"'), "title"),
        (("stability", NOMINAL, "--json", "/dev/null/x"), "/dev/null/x"),
    ],
)
def test_wrong_request_gets_one_line_and_status_2(drumsqueal, arguments, told):
    status, printed, errors = drumsqueal(*arguments)
    assert (status, printed) == (2, "")
    assert errors.count("\n") == 1
    assert told in errors


def test_a_folder_at_the_end_of_a_broken_link_gets_one_line_and_status_2(drumsqueal, tmp_path):
    for name, target in (("loop", "loop"), ("dangling", "nowhere")):
        (tmp_path / name).symlink_to(tmp_path / target)
        for folder in (tmp_path / name, tmp_path / name / "under"):
            status, printed, errors = drumsqueal("run", NOMINAL, "-o", str(folder))
            assert (status, printed, errors.count("\n")) == (2, "", 1)
            assert name in errors


def test_a_null_character_in_a_folder_is_refused():
    with pytest.raises(RequestError, match="cannot be written"):
        check_output(Path("null\0character"), RUN_FILES, overwrite=False)


@pytest.mark.parametrize(
    "arguments",
    [
        ("export", "HISTORY", "--to", "csv", "-o", "/proc/x.csv"),
        ("animate", "HISTORY", "-o", "/proc/x.gif"),
        ("animate", NOMINAL, "--mode", "Y", "-o", "/proc/x.gif"),
        ("report", "FOLDER", "-o", "/proc/x.html"),
        ("scenes", "nominal", "-o", "/proc/x.toml"),
        ("stability", NOMINAL, "--json", "/proc/x.json"),
        ("stability", NOMINAL, "--json", "x" * 253),  # one of five letters more stands there while it is written
    ],
)
def test_a_file_that_cannot_be_written_is_told_before_anything_is_done(short_run, drumsqueal, arguments):
    places = {"HISTORY": str(short_run / "history.nc"), "FOLDER": str(short_run)}
    status, printed, errors = drumsqueal(*(places.get(each, each) for each in arguments))
    assert (status, printed, errors.count("\n")) == (2, "", 1)
    assert "this file cannot be written" in errors
    assert "Errno" not in errors


def test_what_is_no_ordinary_file_is_not_replaced(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(RequestError, match="not an ordinary file"):
        check_output_file(pipe, overwrite=True)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("export", "HISTORY", "--to", "mat", "-o", "x.csv"), "x.csv: a file of --to mat ends in .mat"),
        (("export", "HISTORY", "--to", "uff58", "-o", "x"), "x: a file of --to uff58 ends in .uff or .unv or .u58"),
        (("report", "FOLDER", "-o", "x.pdf"), "x.pdf: a page ends in .html or .htm"),
        (("export", "HISTORY", "--to", "csv", "--signals", "velocity_y"), "did you mean velocity_Y?"),
        (("export", "HISTORY", "--to", "csv", "--rate", "44,1 kHz"), "a number takes a decimal point and no comma"),
        (("run", "HISTORY"), "history.nc: this is a NetCDF file, such as a history"),
    ],
)
def test_a_wrong_request_for_a_history_says_what_would_be_right(
    short_run, drumsqueal, tmp_path, monkeypatch, arguments, told
):
    monkeypatch.chdir(tmp_path)
    places = {"HISTORY": str(short_run / "history.nc"), "FOLDER": str(short_run)}
    status, printed, errors = drumsqueal(*(places.get(each, each) for each in arguments))
    assert (status, printed, errors.count("\n")) == (2, "", 1)
    assert told in errors
    assert list(tmp_path.iterdir()) == []


def test_endings_in_capitals_and_usual_ones_are_taken(short_run, drumsqueal, tmp_path):
    for to, name in (("csv", "a.CSV"), ("csv", "a.txt"), ("uff58", "a.unv")):
        arguments = ("export", str(short_run), "--to", to, "--signals", "velocity_Y", "-o", str(tmp_path / name))
        assert drumsqueal(*arguments)[0] == 0
        assert (tmp_path / name).exists()


@pytest.mark.parametrize(
    ("command", "setting"),
    [("check", "simulate.sample_rate=1000"), ("run", "simulate.sample_rate=1000"), ("stability", "drum.speed=0")],
)
def test_a_scene_found_wrong_after_it_was_read_is_named(drumsqueal, tmp_path, monkeypatch, command, setting):
    monkeypatch.chdir(tmp_path)  # no earlier results lie in its folder "out"
    key, _, value = setting.partition("=")
    scene = tmp_path / "mine.toml"
    scene.write_text(load_scene(NOMINAL).with_values({key: float(value)}).to_toml())
    status, printed, errors = drumsqueal(command, str(scene))
    assert (status, printed, errors.count("\n")) == (2, "", 1)
    assert errors.startswith(f"drumsqueal: {scene}: {key}")
    errors = drumsqueal(command, NOMINAL, "--set", setting)[2]
    assert errors.startswith(f"drumsqueal: {NOMINAL} with --set: {key}")


def test_missing_key_is_named(drumsqueal, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(Path(NOMINAL).read_text().replace('width = "36.5 mm"', ""))
    status, _, errors = drumsqueal("run", str(scene), "-o", str(tmp_path / "out"))
    assert status == 2
    assert "shoe.width" in errors
    assert errors.count(str(scene)) == 1


@pytest.mark.thorough
def test_a_stable_brake_may_squeal_after_a_large_disturbance_and_the_command_that_finds_out_is_one(
    drumsqueal, tmp_path
):
    speed, out = ("--set", 'drum.speed="200 rpm"'), str(tmp_path / "run")
    short = ("--set", "simulate.duration=0.01", *speed)
    scene = str(SCENARIOS / "damped.toml")
    for words in (drumsqueal("check", scene, *short)[1], drumsqueal("run", scene, "-o", out, *short)[1]):
        (line,) = (line for line in words.splitlines() if "to find out: " in line)
        assert line.startswith("A large disturbance may still lead to sustained squeal")
        command = shlex.split(line.split("to find out: ")[1])
        assert command[:2] == ["drumsqueal", "onset"]
        along = read_variation(command[command.index("--along") + 1], load_scene(scene))
        assert [along.listed(value) for value in along.values] == [180.0, 200.0, 220.0]
        # The options are those that the command takes: it gets as far as the scene.
        assert "there is no such" in drumsqueal(*command[1:2], "nowhere.toml", *command[3:])[2]
        assert words.count("No mode grows") <= 1
    assert "to find out" not in drumsqueal("check", scene, "--set", "simulate.duration=0.01")[1]  # Y grows
    loaded = load_scene(scene, ['drum.speed="200 rpm"', "contact.normal_load=0"])
    assert bistable_words(loaded, prepare(loaded).stability, Path(scene), ()) is None  # nothing presses
