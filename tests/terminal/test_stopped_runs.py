"""A run that fails, is interrupted or fills the disk: one line, status 1, and what was computed is kept and whole."""

import errno
import importlib
import json
import signal
import socket
from pathlib import Path

import numpy as np
import pytest
import xarray

from drumsqueal import command_line, interrupts, simulation
from drumsqueal.errors import IntegrationError
from drumsqueal.files import history_file, in_place
from drumsqueal.files.claims import claim_folder, claims_released
from drumsqueal.files.in_place import fixed_text
from drumsqueal.files.output_folder import RUN_FILES
from drumsqueal.interrupts import AGAIN as AGAIN_ENDS
from drumsqueal.interrupts import ENDED, HEARD, noted_interrupts, stop_if_interrupted
from drumsqueal.questions.run import answer, drawing, figures
from drumsqueal.simulation import run
from processes import MAIN, PRESS, communicate, next_line, posix, start, watched

pytestmark = pytest.mark.usefixtures("empty_figures")
SCENARIOS = Path(__file__).parents[2] / "scenarios"
NOMINAL = str(SCENARIOS / "nominal.toml")
THREE_CHUNKS = ("--set", "simulate.duration=0.03")
AGAIN = "--resume continues from there"


def assert_whole(folder: Path, outcome: str) -> int:
    """The history is whole and says how the run ended, as does the summary; the number of samples."""
    with xarray.open_dataset(folder / "history.nc", engine="h5netcdf") as history:
        assert history.attrs["outcome"].startswith(outcome)
        np.testing.assert_allclose(history["time"].values, np.arange(history["time"].size) / 50e3, atol=1e-15)
        assert all(np.isfinite(history[name].values).all() for name in history.data_vars)
        samples, steps = history["time"].size, int(history.attrs["steps"])
        stopped = history.attrs["outcome"]
    if (folder / "summary.json").exists():
        summary = json.loads((folder / "summary.json").read_text())
        assert (summary["outcome"], summary["integration"]["steps"]) == (stopped, steps)
    return samples


# --- failed ---------------------------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_failed_run_keeps_what_was_computed(drumsqueal, tmp_path):
    # The lining is about to stick as a whole when the drum comes to rest: an explicit method's step size collapses.
    stop = "drum.speed={time=[0,0.03], value=[0.5,0]}"
    arguments = ("--set", stop, "--set", "simulate.duration=0.04", "--set", "start.displacement={Y=1e-6}")
    arguments += ("--set", "simulate.solver=dopri8")
    status, _, errors = drumsqueal("run", NOMINAL, "-o", str(tmp_path), *arguments)
    assert status == 1
    assert errors.count("\n") == 1
    assert "step size collapsed" in errors
    assert "where the lining all but sticks to the drum as a whole" in errors
    assert assert_whole(tmp_path, "failed: the step size collapsed") == pytest.approx(1500, abs=100)


def test_a_run_without_samples_keeps_the_prediction(drumsqueal, tmp_path, monkeypatch):
    def fail(*arguments, **options):
        raise IntegrationError("there is no step")
        yield

    monkeypatch.setattr(simulation, "integrate", fail)
    status, printed, errors = drumsqueal("run", NOMINAL, "-o", str(tmp_path))
    assert (status, printed) == (1, "")
    assert errors == f"drumsqueal: failed: there is no step; what was computed is in {tmp_path}\n"
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["outcome"] == "failed: there is no step"
    assert len(summary["prediction"]["eigenvalues"]) == 12
    assert summary["growth"]["modes"] == []
    assert summary["saturation"] is summary["sticking"] is summary["accuracy"] is None
    assert summary["verdict"].endswith("nothing was computed beyond the prediction (failed: there is no step).")


def test_what_nobody_foresaw_is_told_in_one_line(drumsqueal, tmp_path, monkeypatch):
    monkeypatch.setattr(figures, "drawings", lambda *_: 1 / 0)
    status, _, errors = drumsqueal("run", NOMINAL, "-o", str(tmp_path), *THREE_CHUNKS)
    assert (status, errors) == (1, "drumsqueal: failed unexpectedly, ZeroDivisionError: division by zero\n")
    assert assert_whole(tmp_path, "complete") == 1501


def test_where_an_unforeseen_error_came_from_is_shown_if_asked_for(drumsqueal, monkeypatch):
    monkeypatch.setattr(command_line, "take_each", lambda *_: 1 / 0)
    status, printed, errors = drumsqueal("--debug", "check", NOMINAL)
    assert (status, printed) == (1, "")
    assert errors.startswith("Traceback (most recent call last):\n")
    assert errors.endswith("\ndrumsqueal: failed unexpectedly, ZeroDivisionError: division by zero\n")


# --- interrupted ----------------------------------------------------------------------------------------------------


def press() -> None:
    signal.raise_signal(signal.SIGINT)


@pytest.mark.thorough
@posix
def test_control_c_while_the_program_loads(tmp_path):
    # Everything is loaded through the finders on sys.meta_path: this one presses Ctrl-C at the first heavy module.
    finder = (
        "type('Finder', (), {'find_spec': lambda self, name, *_: name == 'typer' and signal.raise_signal(2) or None})"
    )
    at_the_end = "atexit.register(lambda: print(signal.getsignal(signal.SIGINT).name))"
    code = f"import atexit, signal, sys; {at_the_end}; sys.meta_path.insert(0, {finder}()); {MAIN}"
    process = start(tmp_path, "run", NOMINAL, "-o", str(tmp_path / "out"), code=code)
    printed, errors = communicate(process)
    assert (process.returncode, errors) == (
        1,
        f"{HEARD}{AGAIN_ENDS}\ndrumsqueal: interrupted before anything was written\n",
    )
    assert printed == "SIG_IGN\n"  # from there on nothing can take the place of the exit status
    assert not (tmp_path / "out").exists()


@posix
def test_control_c_is_heard_while_compiled_code_runs_and_the_second_one_ends_it(tmp_path):
    # Like a compiled chunk this returns to Python late, after half an hour, until when Python calls no handler.
    busy = "import hashlib; print('busy', flush=True); hashlib.pbkdf2_hmac('sha512', b'', b'', 2**31 - 1)"
    code = f"from drumsqueal.interrupts import note_interrupts; note_interrupts(); {busy}"
    with start(tmp_path, code=code) as process:
        try:
            assert next_line(process.stdout) == "busy\n"
            process.send_signal(signal.SIGINT)
            assert next_line(process.stderr) == f"{HEARD}{AGAIN_ENDS}\n"
            assert process.poll() is None
            process.send_signal(signal.SIGINT)
            assert next_line(process.stderr) == f"{ENDED}\n"
            communicate(process)
            assert process.returncode == 1
        finally:
            process.kill()


@pytest.mark.thorough
@posix
def test_control_c_before_the_first_chunk(cache, tmp_path):
    folder = tmp_path / "out"
    pressed = watched("drumsqueal.terminal.reply:Reply", "replacing", PRESS)  # just before the integration
    process = start(cache, "run", NOMINAL, "-o", str(folder), code=pressed)
    _, errors = communicate(process)
    outcome = "interrupted by the user before the first samples were computed"
    told = f"drumsqueal: {outcome}; what was computed is in {folder}\n"
    assert (process.returncode, errors) == (1, f"{HEARD}{AGAIN_ENDS}\n{told}")
    assert {path.name for path in folder.iterdir()} == {"summary.json"}
    assert json.loads((folder / "summary.json").read_text())["outcome"] == outcome


@pytest.mark.thorough
@posix
def test_second_start_compiles_nothing_and_control_c_keeps_data(tmp_path):
    first, second, cache = tmp_path / "first", tmp_path / "second", tmp_path / "cache"
    process = start(cache, "run", NOMINAL, "-o", str(first), "--set", "simulate.duration=0.002")
    _, errors = communicate(process)
    assert (process.returncode, errors) == (0, "")
    programs = {path.name for path in cache.rglob("programs/*")}
    assert {name.split("-")[0] for name in programs} >= {"advance_packed", "first_step"}
    # Ten seconds of vibration take many times the 0.2 s after which the point to go on from is written again.
    pressed = watched("drumsqueal.files.output_folder", "write_whole", f"if count == 2: {PRESS}")
    process = start(cache, "run", NOMINAL, "-o", str(second), "--set", "simulate.duration=10", code=pressed)
    _, errors = communicate(process)
    assert process.returncode == 1
    assert "interrupted by the user after t =" in errors
    assert errors.count("\n") == 2
    assert assert_whole(second, "interrupted by the user after t =") > 500
    compiled = {path.name.split("-")[0] for path in cache.rglob("programs/*") if path.name not in programs}
    assert not compiled & {"advance_packed", "first_step"}


def test_control_c_while_a_chunk_is_written(drumsqueal, tmp_path, monkeypatch):
    write = history_file.fill

    def interrupted(path, places, first, values):
        write(path, places, first, values)
        if first == 501:
            press()

    monkeypatch.setattr(history_file, "fill", interrupted)
    status, _, errors = drumsqueal("run", NOMINAL, "-o", str(tmp_path), *THREE_CHUNKS)
    outcome = "interrupted by the user after t = 0.02 s"
    assert (status, errors) == (1, f"drumsqueal: {outcome}; what was computed is in {tmp_path}; {AGAIN}\n")
    assert assert_whole(tmp_path, outcome) == 1001


@pytest.mark.parametrize(("module", "step"), [(answer, "compared"), (figures, "drawings")])
def test_control_c_after_the_integration(drumsqueal, tmp_path, monkeypatch, module, step):
    function = getattr(module, step)
    monkeypatch.setattr(module, step, lambda *arguments: (press(), function(*arguments))[1])
    status, printed, errors = drumsqueal("run", NOMINAL, "-o", str(tmp_path), *THREE_CHUNKS)
    history = tmp_path / "history.nc"
    assert (status, printed) == (1, "")
    assert errors == f"drumsqueal: interrupted by the user; the complete history is in {history}; {AGAIN}\n"
    assert assert_whole(tmp_path, "complete") == 1501
    assert (tmp_path / "summary.json").exists() == (step == "drawings")


def test_control_c_again_while_an_interrupted_run_is_written_out_tells_how_to_go_on(drumsqueal, tmp_path, monkeypatch):
    write, compare = history_file.fill, answer.compared

    def interrupted(path, places, first, values):
        write(path, places, first, values)
        if first == 501:
            press()

    monkeypatch.setattr(history_file, "fill", interrupted)
    monkeypatch.setattr(answer, "compared", lambda *arguments: (press(), compare(*arguments))[1])
    arguments = ("run", NOMINAL, "-o", str(tmp_path), *THREE_CHUNKS)
    status, _, errors = drumsqueal(*arguments)
    told = f"interrupted by the user; the history is in {tmp_path / 'history.nc'}; {AGAIN}"
    assert (status, errors) == (1, f"drumsqueal: {told}\n")
    monkeypatch.setattr(history_file, "fill", write)
    monkeypatch.setattr(answer, "compared", compare)
    assert drumsqueal(*arguments, "--resume")[0] == 0
    assert assert_whole(tmp_path, "complete") == 1501


def test_control_c_between_two_figures(drumsqueal, tmp_path, monkeypatch):
    drawn = []
    drawings = {name: lambda view, name=name: (drawn.append(name), press())[0] for name in ("first", "second")}
    monkeypatch.setattr(figures, "_DRAWINGS", drawings)
    monkeypatch.setattr(drawing, "run_figures", lambda **_: tuple(drawings))
    status, _, errors = drumsqueal("run", NOMINAL, "-o", str(tmp_path), *THREE_CHUNKS)
    assert (status, drawn) == (1, ["first"])
    assert AGAIN in errors


def test_control_c_is_as_it_was_outside_the_block():
    with noted_interrupts(), noted_interrupts():
        press()
        with pytest.raises(KeyboardInterrupt):
            stop_if_interrupted()
        stop_if_interrupted()
    with pytest.raises(KeyboardInterrupt):
        press()
    ignored = signal.signal(signal.SIGINT, signal.SIG_IGN)  # as in a job in the background
    try:
        with noted_interrupts():
            press()
            stop_if_interrupted()
    finally:
        signal.signal(signal.SIGINT, ignored)


# --- a full disk ----------------------------------------------------------------------------------------------------

LIMITED = f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (@, @)); {MAIN}"  # bytes a file


@pytest.mark.thorough
@posix
@pytest.mark.parametrize("limit", [500_000, 20_000])
def test_a_disk_too_small_is_told_with_the_first_chunk(cache, tmp_path, limit):
    folder = tmp_path / "out"
    arguments = ("run", NOMINAL, "-o", str(folder), "--set", "simulate.duration=0.1")
    process = start(cache, *arguments, code=LIMITED.replace("@", str(limit)))
    _, errors = communicate(process)
    assert process.returncode == 1
    cause = "failed: the disk did not take the samples from t = 0 s on"
    assert errors.startswith(f"drumsqueal: {cause} (File too large; the whole history takes 1.03 MB)")
    assert errors.count("\n") == 1
    assert [path.name for path in folder.iterdir()] == ["summary.json"]


def test_a_disk_that_fails_keeps_what_was_computed(drumsqueal, tmp_path, monkeypatch):
    write = history_file.fill

    def fail(path, places, first, values):
        if first == 1001:
            raise OSError(errno.EIO, "Input/output error")
        write(path, places, first, values)

    monkeypatch.setattr(history_file, "fill", fail)
    status, _, errors = drumsqueal("run", NOMINAL, "-o", str(tmp_path), *THREE_CHUNKS)
    outcome = "failed: the disk did not take the samples from t = 0.02002 s on (Input/output error)"
    assert (status, errors) == (1, f"drumsqueal: {outcome}; what was computed is in {tmp_path}; {AGAIN}\n")
    assert assert_whole(tmp_path, outcome) == 1001
    assert (tmp_path / "summary.json").exists()
    assert {path.name for path in tmp_path.iterdir()} <= set(RUN_FILES)


@pytest.mark.parametrize("writer", ["questions.run.answer.write_json", "terminal.style.save_figure"])
def test_a_disk_without_room_for_the_results_keeps_the_history(drumsqueal, tmp_path, monkeypatch, writer):
    def fail(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(f"drumsqueal.{writer}", fail)
    status, printed, errors = drumsqueal("run", NOMINAL, "-o", str(tmp_path), *THREE_CHUNKS)
    cause = f"failed: the disk does not take the results ({tmp_path}: No space left on device)"
    assert (status, printed) == (1, "")
    assert errors == f"drumsqueal: {cause}; the complete history is in {tmp_path / 'history.nc'}; {AGAIN}\n"
    assert assert_whole(tmp_path, "complete") == 1501


def test_a_chunk_changes_nothing_of_the_file_but_samples_and_two_thousand_bytes(tmp_path, nominal):
    prepared = simulation.prepare(nominal.with_values({"simulate.duration": 0.02, "title": "t" * 1000}))
    path, (first, second) = tmp_path / "history.nc", simulation.transient(prepared)
    file = history_file.HistoryFile(path, prepared.scene, prepared.model.names)
    file.append(first)
    before = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    # HDF5 has its room before it writes; beside 8 bytes for each of 24 numbers a sample it takes less than half.
    assert before.size - 24 * 8 * 1001 < in_place.STRUCTURE / 2
    file.append(second)
    after = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    assert after.size == before.size
    changed = np.flatnonzero(before != after)
    starts = {(place, 6 if name in ("displacement", "velocity") else 1) for name, place in file._places.items()}
    for place, width in starts:
        changed = changed[(changed < place + 8 * width * 501) | (changed >= place + 8 * width * 1001)]
    assert changed.size > 0
    assert np.ptp(changed) < 2048


def test_a_history_has_a_sample_at_both_ends_and_its_last_time(tmp_path, nominal):
    # 0.29 s times 100 Hz is 28.999999999999996: 29 intervals, and 30 samples.
    scene = nominal.with_values({"simulate.duration": 0.29, "simulate.sample_rate": 100.0})
    file = history_file.HistoryFile(tmp_path / "history.nc", scene, ("X", "Y", "Tz"))
    assert "after t = 0.28 s; 29 of 30 samples" in file._so_far(history_file.Reached(samples=29))


@pytest.mark.parametrize(("length", "kept"), [(6, "ααα"), (5, "αα"), (4, "αα"), (1, "")])
def test_a_text_is_cut_between_two_letters(length, kept):
    assert fixed_text("ααα", length) == kept.encode()  # of two bytes each


def test_a_press_that_was_not_granted_ends_nothing_later(nominal, monkeypatch):
    short = nominal.with_values({"simulate.duration": 0.002})

    def pressed_and_failed(*_, **__):
        signal.raise_signal(signal.SIGINT)
        raise IntegrationError("failed at once")
        yield

    with monkeypatch.context() as patch:
        patch.setattr(simulation, "integrate", pressed_and_failed)
        with pytest.raises(IntegrationError, match="failed at once"):
            run(short)
    assert run(short).findings.outcome == "complete"


# --- before anything is written -------------------------------------------------------------------------------------

AT_ONCE = {
    "sensitivity": ("study.study_sensitivity",),
    "cycle": ("study.find_cycle",),
    "motion": ("study.study_motion",),
    "effects": ("study.study_effects",),
    "accuracy": ("study.study_accuracy",),
    "onset": ("study.compare", "--along", "drum.speed=4..6x2"),
    "sweep": ("file.SweepFile.create", "--vary", "drum.speed=4..6x2"),
}


@pytest.mark.parametrize("command", AT_ONCE)
def test_a_command_that_is_stopped_at_once_leaves_no_folder(drumsqueal, tmp_path, monkeypatch, command):
    def pressed(*_, **__):
        raise KeyboardInterrupt

    step, *options = AT_ONCE[command]
    importlib.import_module(f"drumsqueal.questions.{command}.{step.split('.')[0]}")
    monkeypatch.setattr(f"drumsqueal.questions.{command}.{step}", pressed)
    damped, folder = str(SCENARIOS / "damped.toml"), tmp_path / "deep" / "out"
    status, printed, errors = drumsqueal(command, damped, "-o", str(folder), *options)
    assert (status, printed) == (1, "")
    assert errors == "drumsqueal: interrupted by the user; nothing was kept\n"
    assert list(tmp_path.iterdir()) == []


def test_only_folders_that_were_made_and_are_empty_go_again(tmp_path):
    def stopped(folder: Path, *left: str) -> None:
        with claims_released():
            claim_folder(folder)
            for name in left:
                (folder / name).touch()
            raise ZeroDivisionError

    (tmp_path / "own").mkdir()
    for name, left in (("own", ()), ("made/filled", ("kept",)), ("made/empty", ()), ("all/empty", ())):
        with pytest.raises(ZeroDivisionError):
            stopped(tmp_path / name, *left)
    there = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*")}
    assert there == {"own", "made", "made/filled", "made/filled/kept"}


@pytest.mark.parametrize("ends_program", [True, False])
def test_the_second_ctrl_c_ends_a_program_and_nothing_else(monkeypatch, capfd, ends_program):
    ended = []
    monkeypatch.setattr(interrupts.os, "_exit", ended.append)
    theirs, ours = socket.socketpair()
    with ours:
        ours.sendall(bytes([signal.SIGCHLD, signal.SIGINT, signal.SIGINT]))
    interrupts._report(theirs, ends_program)
    told = capfd.readouterr().err
    assert (ended, told) == (([1], f"{HEARD}{AGAIN_ENDS}\n{ENDED}\n") if ends_program else ([], f"{HEARD}\n"))
