"""A run that was cut off: what it left is readable, and `--resume` makes of it what an uninterrupted run leaves."""

import errno
import json
import random
import re
import shutil
import signal
from pathlib import Path

import h5py
import jax
import numpy as np
import pytest
import xarray

from drumsqueal import simulation
from drumsqueal.errors import Ending, IntegrationError, Outcome
from drumsqueal.files import history_file, in_place, output_folder
from drumsqueal.files.claims import LOCK
from drumsqueal.files.history_file import ResumeFile, find_point
from drumsqueal.files.output_folder import EARLIER
from drumsqueal.scene import Scene, load_scene
from drumsqueal.terminal import style
from processes import MAIN, communicate, killed, posix, start

pytestmark = pytest.mark.usefixtures("empty_figures")
NOMINAL = str(Path(__file__).parents[2] / "scenarios" / "nominal.toml")
SHORT = ("--set", "simulate.duration=0.0301")  # three chunks, and a fourth of five samples
SEED = 7


def load(folder: Path) -> xarray.Dataset:
    return xarray.load_dataset(folder / "history.nc", engine="h5netcdf")


def contents(folder: Path) -> dict[str, bytes]:
    """What lies in a folder but for the claim of a command that was killed, which claims nothing any more."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != LOCK}


@pytest.fixture(scope="module")
def uninterrupted(nominal) -> xarray.Dataset:
    return simulation.run(nominal.with_values({"simulate.duration": 0.0301})).history


@pytest.fixture
def interrupted(drumsqueal, tmp_path, monkeypatch) -> Path:
    """The folder of a run that Ctrl-C has stopped after its second chunk."""
    folder = tmp_path / "out"
    with monkeypatch.context() as patch:
        press_after(patch, samples=1001)
        status, _, errors = drumsqueal("run", NOMINAL, "-o", str(folder), *SHORT)
    assert (status, errors.split(";")[0]) == (1, "drumsqueal: interrupted by the user after t = 0.02 s")
    return folder


def press_after(patch: pytest.MonkeyPatch, samples: int) -> None:
    note_progress = history_file._note_progress

    def noted(path, reached, outcome):
        note_progress(path, reached, outcome)
        if reached.samples == samples and outcome.startswith("incomplete"):
            signal.raise_signal(signal.SIGINT)

    patch.setattr(history_file, "_note_progress", noted)


# --- killed ---------------------------------------------------------------------------------------------------------


@pytest.mark.thorough
@posix
def test_killed_at_any_moment_again_and_again_a_run_ends_as_if_it_had_not_been(cache, drumsqueal, tmp_path, nominal):
    # Fifty chunks of some 12 ms, of which no start computes more than a dozen; every one is a point to go on from, so
    # that each start comes further.
    folder, moments = tmp_path / "out", random.Random(SEED)
    arguments = ("run", NOMINAL, "-o", str(folder), "--set", "simulate.duration=0.5")
    often = "from drumsqueal.files import history_file; history_file.EVERY = 0"
    reached = 0
    for _ in range(3):
        ends = killed("drumsqueal.files.history_file", "write_whole", seconds=moments.uniform(1e-3, 0.1), most=12)
        process = start(cache, *arguments, *(["--resume"] if reached else []), code=f"{often}\n{ends}")
        communicate(process)
        assert process.returncode == -signal.SIGPROF
        further = assert_readable(folder)
        assert further > reached
        reached = further
    assert drumsqueal(*arguments, "--resume")[0] == 0
    # Bit by bit: a chunk begins with the very numbers the one before ended with, be it in another process.
    uninterrupted = simulation.run(nominal.with_values({"simulate.duration": 0.5})).history
    xarray.testing.assert_identical(load(folder), uninterrupted)
    assert not (folder / "resume.json").exists()
    assert {path.suffix for path in folder.iterdir()} == {".nc", ".json", ".png"}


def assert_readable(folder: Path) -> int:
    """A history cut off says how far it goes, is right so far, and is NaN beyond; the samples to go on from."""
    history = load(folder)
    told = re.fullmatch(
        r"incomplete: the run was killed after t = (\S+) s; (\d+) of 25001 samples were computed, "
        r"the others are NaN",
        history.attrs["outcome"],
    )
    assert told is not None
    samples, point = int(told[2]), json.loads((folder / "resume.json").read_text())
    assert float(told[1]) == pytest.approx(history["time"].values[samples - 1])
    np.testing.assert_array_equal(history["time"].values, np.arange(25_001) / 50e3)
    computed = history.isel(time=slice(samples))
    assert all(np.isfinite(computed[name].values).all() for name in history.data_vars)
    # One chunk more may have been written that was not counted any more.
    beyond = history.isel(time=slice(samples + 500, None))
    assert all(np.isnan(beyond[name].values).all() for name in history.data_vars)
    assert point["samples"] <= samples
    assert point["steps"] <= history.attrs["steps"]
    return point["samples"]


@pytest.mark.thorough
@posix
@pytest.mark.parametrize(
    ("step", "left", "told"),
    [
        ("output_folder.Path.replace", ["history.nc.part"], "there is no run to resume"),  # before it has its name
        ("history_file.write_whole", ["history.nc"], "there is no resume.json"),
    ],
)
def test_killed_before_there_is_a_point_to_go_on_from(cache, drumsqueal, tmp_path, step, left, told):
    folder = tmp_path / "out"
    modules = "import os; from drumsqueal.files import history_file, output_folder"
    dies = f"{modules}; {step} = lambda *_: os.kill(os.getpid(), 9)"
    process = start(cache, "run", NOMINAL, "-o", str(folder), *SHORT, code=f"{dies}; {MAIN}")
    communicate(process)
    assert process.returncode == -signal.SIGKILL
    before = contents(folder)
    assert list(before) == left
    status, _, errors = drumsqueal("run", NOMINAL, "-o", str(folder), *SHORT, "--resume")
    assert (status, errors.count("\n")) == (2, 1)
    assert told in errors
    assert contents(folder) == before
    if left == ["history.nc"]:
        cut_off = "incomplete: the run was killed after t = 0.01 s"
        assert load(folder).attrs["outcome"].startswith(cut_off)
        return
    assert drumsqueal("run", NOMINAL, "-o", str(folder), *SHORT)[0] == 0
    assert not (folder / "history.nc.part").exists()


# --- stopped in good order ------------------------------------------------------------------------------------------


def test_a_run_that_was_interrupted_goes_on_to_the_same_end(drumsqueal, interrupted, uninterrupted):
    assert load(interrupted).sizes["time"] == 1001
    assert find_point(interrupted, scene_of(interrupted)).reached.samples == 1001
    status, printed, errors = drumsqueal("run", NOMINAL, "-o", str(interrupted), *SHORT, "--resume")
    assert (status, errors) == (0, "")
    assert f"Results are in {interrupted}: " in printed
    xarray.testing.assert_identical(load(interrupted), uninterrupted)
    summary = json.loads((interrupted / "summary.json").read_text())
    assert summary["outcome"] == "complete"
    assert not (interrupted / "resume.json").exists()


def test_a_long_history_is_cut_short_block_by_block(request, uninterrupted, monkeypatch):
    monkeypatch.setattr(in_place, "BLOCK", 300)
    left = load(request.getfixturevalue("interrupted"))
    for name in ("displacement", "velocity", "brake_torque"):
        np.testing.assert_array_equal(left[name].values, uninterrupted[name].values[:1001])


def scene_of(folder: Path) -> Scene:
    stored = folder.parent / "stored.toml"
    stored.write_text(load(folder).attrs["scene"])
    return load_scene(stored)


@pytest.mark.thorough
def test_interrupted_while_it_resumes_it_can_be_resumed_again(drumsqueal, interrupted, uninterrupted, monkeypatch):
    with monkeypatch.context() as patch:
        press_after(patch, samples=1501)
        status, _, errors = drumsqueal("run", NOMINAL, "-o", str(interrupted), *SHORT, "--resume")
    assert status == 1
    assert errors == (
        f"drumsqueal: interrupted by the user after t = 0.03 s; what was computed is in {interrupted}; "
        "--resume continues from there\n"
    )
    assert drumsqueal("run", NOMINAL, "-o", str(interrupted), *SHORT, "--resume")[0] == 0
    xarray.testing.assert_identical(load(interrupted), uninterrupted)


def test_a_disk_that_fails_and_is_mended_loses_nothing(drumsqueal, tmp_path, uninterrupted, monkeypatch):
    write = history_file.fill

    def fail(path, places, first, values):
        if first == 1001:
            raise OSError(errno.EIO, "Input/output error")
        write(path, places, first, values)

    with monkeypatch.context() as patch:
        patch.setattr(history_file, "fill", fail)
        # Nor is there room for a copy without what is NaN.
        patch.setattr(history_file.HistoryFile, "_rewrite", lambda *_: fail(None, None, 1001, None))
        assert drumsqueal("run", NOMINAL, "-o", str(tmp_path), *SHORT)[0] == 1
    history = load(tmp_path)
    assert history.attrs["outcome"].startswith("failed: the disk did not take the samples from t = 0.02002 s on")
    assert np.isfinite(history["normal_force"].values[:1001]).all()
    assert np.isnan(history["normal_force"].values[1001:]).all()
    assert drumsqueal("run", NOMINAL, "-o", str(tmp_path), *SHORT, "--resume")[0] == 0
    xarray.testing.assert_identical(load(tmp_path), uninterrupted)


@pytest.mark.parametrize("first", [0, 1001], ids=["at its start", "later"])
def test_a_run_stays_until_the_one_that_replaces_it_is_complete(
    drumsqueal, tmp_path, uninterrupted, monkeypatch, first
):
    write, command = history_file.fill, ("run", NOMINAL, "-o", str(tmp_path), *SHORT)

    def fail(path, places, row, values):
        if row == first:
            raise OSError(errno.ENOSPC, "No space left on device")
        write(path, places, row, values)

    assert drumsqueal(*command)[0] == 0
    (tmp_path / "report.html").write_text("of value")
    (tmp_path / "mode-Tz.gif").write_text("of value")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    aside = tmp_path / EARLIER
    for _ in range(2):  # the second replaces what the first has left
        with monkeypatch.context() as patch:
            patch.setattr(history_file, "fill", fail)
            status, _, errors = drumsqueal(*command, "--overwrite")
        assert status == 1
        place = aside if first else tmp_path
        assert errors.endswith(f"; the earlier results are in {place}\n")
        assert {path.name: path.read_bytes() for path in place.iterdir()} == before
        assert aside.exists() == bool(first)
    if first:
        assert drumsqueal(*command, "--resume")[0] == 0
    else:
        assert "report.html" in drumsqueal(*command, "--overwrite")[1]
    xarray.testing.assert_identical(load(tmp_path), uninterrupted)
    assert {path.name for path in tmp_path.iterdir()} == set(before) - {"report.html", "mode-Tz.gif"}


def test_a_run_that_only_lacks_its_figures_gets_them(drumsqueal, tmp_path, uninterrupted, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(style, "save_figure", lambda *_: (_ for _ in ()).throw(OSError(errno.ENOSPC, "No space left")))
        assert drumsqueal("run", NOMINAL, "-o", str(tmp_path), *SHORT)[0] == 1
    assert drumsqueal("run", NOMINAL, "-o", str(tmp_path), *SHORT, "--resume")[0] == 0
    xarray.testing.assert_identical(load(tmp_path), uninterrupted)
    assert (tmp_path / "growth.png").exists()
    assert not (tmp_path / "resume.json").exists()


def test_a_disk_without_room_for_the_point_stops_nothing(drumsqueal, tmp_path, uninterrupted, monkeypatch):
    def fail(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(history_file, "write_whole", fail)
    assert drumsqueal("run", NOMINAL, "-o", str(tmp_path), *SHORT)[0] == 0
    xarray.testing.assert_identical(load(tmp_path), uninterrupted)


@pytest.mark.thorough(but=["turning"])
@pytest.mark.parametrize("stops", [False, True], ids=["turning", "stopping"])
def test_a_transient_taken_up_at_any_chunk_is_the_same(nominal, stops):
    # One slips all the time; the other takes the implicit method, and sticks before its end.
    values: dict = {"drum.speed": {"time": [0, 0.012], "value": [0.5, 0]}} if stops else {}
    prepared = simulation.prepare(nominal.with_values({"simulate.duration": 0.0301, **values}))
    chunks = list(simulation.transient(prepared))
    assert [chunk.end is not None and chunk.end.sticks for chunk in chunks][-1] is stops
    assert any(chunk.implicit.any() for chunk in chunks) is stops
    for number, chunk in enumerate(chunks):
        assert chunk.end is not None
        # As they come from JSON: as Python's own numbers.
        end = jax.tree.map(lambda x: np.asarray(np.asarray(x).tolist()), chunk.end.state)
        since = chunk.end._replace(state=jax.tree.map(jax.numpy.asarray, end))
        rest = list(simulation.transient(prepared, since))
        assert len(rest) == len(chunks) - number - 1
        for one, other in zip(rest, chunks[number + 1 :], strict=True):
            same = jax.tree.map(lambda a, b: np.array_equal(a, b, equal_nan=not isinstance(a, str)), one, other)
            assert jax.tree.all(same)


def test_the_point_is_written_now_and_then_and_exactly(nominal, tmp_path, monkeypatch):
    scene = nominal.with_values({"simulate.duration": 0.0301})
    now = [0.0]
    monkeypatch.setattr(history_file.time, "monotonic", lambda: now[0])
    file, reached = ResumeFile(tmp_path / "resume.json", scene), history_file.Reached()
    for number, chunk in enumerate(simulation.transient(simulation.prepare(scene))):
        reached = history_file.Reached(reached.samples + len(chunk.time), reached.steps + chunk.steps, 0)
        assert chunk.end is not None
        point = history_file.ResumePoint(reached, chunk.end)
        file.note(point)
        samples = json.loads((tmp_path / "resume.json").read_text())["samples"]
        assert samples == {0: 501, 1: 501, 2: 1501, 3: 1501}[number]
        now[0] += 0.6 * history_file.EVERY
    file.write()
    read = history_file._from_plain(history_file._read_plain(tmp_path / "resume.json"), scene)
    assert jax.tree.all(jax.tree.map(np.array_equal, read, point))


# --- refused --------------------------------------------------------------------------------------------------------


def cut_short(folder: Path) -> None:
    history = folder / "history.nc"
    history.write_bytes(history.read_bytes()[:-1000])


def change(folder: Path, **values) -> None:
    data = json.loads((folder / "resume.json").read_text())
    (folder / "resume.json").write_text(json.dumps(data | values))


def link(folder: Path) -> None:
    (folder / "history.nc").rename(folder.parent / "elsewhere.nc")
    (folder / "history.nc").symlink_to(folder.parent / "elsewhere.nc")


def lead_elsewhere(folder: Path) -> None:
    with h5py.File(folder / "history.nc", "r+") as file:
        del file["velocity"]
        file["velocity"] = h5py.ExternalLink("/etc/passwd", "velocity")


def attribute(folder: Path, name: str, value: str) -> None:
    with h5py.File(folder / "history.nc", "r+") as file:
        file.attrs[name] = value


REFUSED = {
    "nothing there": (lambda folder: shutil.rmtree(folder), "there is no run to resume"),
    "history gone": (lambda folder: (folder / "history.nc").unlink(), "there is no run to resume"),
    "history cut short": (cut_short, "history.nc is cut short or damaged"),
    "history empty": (lambda folder: (folder / "history.nc").write_bytes(b""), "history.nc is cut short or damaged"),
    "history text": (lambda folder: (folder / "history.nc").write_text("of value"), "is cut short or damaged"),
    "history a link": (link, "history.nc is not an ordinary file"),
    "data elsewhere": (lead_elsewhere, "history.nc is cut short or damaged"),
    "scene no scene": (lambda folder: attribute(folder, "scene", "x = 1"), "history.nc is cut short or damaged"),
    "complete": (
        lambda folder: ((folder / "resume.json").unlink(), attribute(folder, "ending", "complete")),
        "the run is complete, there is nothing to resume",
    ),
    "failed": (
        lambda folder: (
            (folder / "resume.json").unlink(),
            attribute(folder, "outcome", "failed: no step"),
            attribute(folder, "ending", "failed"),
        ),
        "the run failed: no step, and would fail there again",
    ),
    "point gone": (lambda folder: (folder / "resume.json").unlink(), "there is no resume.json"),
    "other versions": (
        lambda folder: attribute(folder, "versions", json.dumps({"python": "2.7", "jax": "0.1"})),
        "the run was made with other versions (python 2.7, here 3.",
    ),
    "point cut short": (lambda folder: (folder / "resume.json").write_text('{"samples": 50'), "resume.json is damaged"),
    "point nested": (lambda folder: (folder / "resume.json").write_text("[" * 60_000), "resume.json is damaged"),
    "another format": (lambda folder: change(folder, format=99), "of another version of drumsqueal"),
    "another scene's": (lambda folder: change(folder, scene="0"), "of another run"),
    "ahead": (lambda folder: change(folder, samples=1501), "resume.json is damaged"),
    "no chunk": (lambda folder: change(folder, samples=777), "resume.json is damaged"),
    "infinite": (lambda folder: change(folder, work=float("inf")), "resume.json is damaged"),
    "too few": (lambda folder: change(folder, vibration=[0.0]), "resume.json is damaged"),
    "no numbers": (lambda folder: change(folder, vibration=[["x"], 1, 2]), "resume.json is damaged"),
}


@pytest.fixture(scope="module")
def stopped(tmp_path_factory, nominal) -> Path:
    """What a run leaves that was stopped after its second chunk, without summary and figures."""
    folder = tmp_path_factory.mktemp("stopped")
    prepared = simulation.prepare(nominal.with_values({"simulate.duration": 0.0301}))
    history = history_file.HistoryFile(folder / "history.nc", prepared.scene, prepared.model.names)
    resume, chunks = ResumeFile(folder / "resume.json", prepared.scene), simulation.transient(prepared)
    for _ in range(2):
        chunk = next(chunks)
        history.append(chunk)
        assert chunk.end is not None
        resume.note(history_file.ResumePoint(history.reached, chunk.end))
    resume.write()
    history.end(Outcome(Ending.INTERRUPTED, "interrupted by the user after t = 0.02 s"))
    return folder


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_resumed_is_told_in_one_line_and_left_alone(drumsqueal, stopped, tmp_path, case):
    spoil, told = REFUSED[case]
    folder = tmp_path / "out"
    shutil.copytree(stopped, folder)
    spoil(folder)
    before = contents(folder) if folder.exists() else None
    status, printed, errors = drumsqueal("run", NOMINAL, "-o", str(folder), *SHORT, "--resume")
    assert (status, printed, errors.count("\n")) == (2, "", 1)
    assert told in errors
    assert (contents(folder) if folder.exists() else None) == before


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (("simulate.duration=0.04",), "simulate.duration was 0.0301 in the run and is 0.04 here;"),
        (("drum.speed=3", "title=x"), 'title was "Nominal squeal" in the run and is "x" here (and 1 more differ);'),
        (("support=none",), "support.upper_stiffness was 100000000.0 in the run and is left out here (and 1 more"),
        (
            ("shoe.spring=[{at=[0, 0, 0.1], direction=[0, 0, 1], stiffness=1}]",),
            "shoe.spring.0.at was left out in the run and is [0.0, 0.0, 0.1] here (and 3 more differ)",
        ),
        (("forcing={amplitude={Y=1}, frequency=9}",), "forcing.amplitude.Y was left out in the run and is 1.0 here"),
    ],
)
def test_another_scene_is_refused_with_what_differs(drumsqueal, stopped, settings, told):
    before = contents(stopped)
    arguments = [word for setting in settings for word in ("--set", setting)]
    status, _, errors = drumsqueal("run", NOMINAL, "-o", str(stopped), *SHORT, *arguments, "--resume")
    assert (status, errors.count("\n")) == (2, 1)
    assert told in errors
    assert contents(stopped) == before


def test_to_go_on_and_to_replace_at_once_is_refused(drumsqueal, stopped):
    before = contents(stopped)
    status, _, errors = drumsqueal("run", NOMINAL, "-o", str(stopped), *SHORT, "--resume", "--overwrite")
    assert (status, errors.count("\n")) == (2, 1)
    assert "leave one of them out" in errors
    assert contents(stopped) == before


def test_a_run_that_failed_says_so_when_it_is_resumed(drumsqueal, tmp_path, monkeypatch):
    transient = simulation.transient

    def fail(prepared, since=None):
        yield next(transient(prepared, since))
        raise IntegrationError("the step size collapsed")

    with monkeypatch.context() as patch:
        patch.setattr(simulation, "transient", fail)
        assert drumsqueal("run", NOMINAL, "-o", str(tmp_path), *SHORT)[0] == 1
    assert load(tmp_path).sizes["time"] == 501
    assert not (tmp_path / "resume.json").exists()
    status, _, errors = drumsqueal("run", NOMINAL, "-o", str(tmp_path), *SHORT, "--resume")
    assert (status, errors.count("\n")) == (2, 1)
    assert "the run failed: the step size collapsed, and would fail there again" in errors


# --- links ----------------------------------------------------------------------------------------------------------


def test_no_result_is_written_through_a_link(drumsqueal, tmp_path):
    folder, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    folder.mkdir()
    elsewhere.write_text("of value")
    for name in output_folder.RUN_FILES:
        for path in (folder / name, output_folder.part_of(folder / name)):
            path.symlink_to(elsewhere)
    assert drumsqueal("run", NOMINAL, "-o", str(folder), *SHORT, "--overwrite")[0] == 0
    assert elsewhere.read_text() == "of value"
    assert not any(path.is_symlink() for path in folder.iterdir())
