"""The parts of claims, folders of results, histories in place and points to resume from, without a run."""

import importlib
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drumsqueal.errors import Ending, IntegrationError, RequestError
from drumsqueal.files import claims, history_file, in_place
from drumsqueal.files.claims import claim_file, claim_folder, claims_released
from drumsqueal.files.history_file import HistoryFile, Reached, ResumeFile, ResumePoint, _from_plain, _leaves, _to_plain
from drumsqueal.files.output_folder import (
    EARLIER,
    FILES,
    check_apart,
    check_ending,
    check_output,
    check_output_file,
    clear,
    files_of_run,
    is_made,
    made_of,
    run_figures,
    set_aside,
    write_whole,
    written_whole,
)
from drumsqueal.files.output_folder import history_file as history_of
from drumsqueal.precision import real
from drumsqueal.scene import load_scene
from drumsqueal.solve.transient.integrate import Checkpoint
from drumsqueal.solve.transient.state import CHUNK_SAMPLES, State
from drumsqueal.solve.transient.stick_slip import Method


@pytest.fixture(scope="module")
def scene() -> Any:
    return load_scene("nominal")


# --- claims ----------------------------------------------------------------------------------------------------------


def test_folders_made_for_a_claim_go_with_it_as_far_as_they_are_empty(tmp_path):
    with claims_released():
        claim_folder(tmp_path / "a" / "b" / "c")
        assert (tmp_path / "a/b/c/.drumsqueal.lock").exists()
        (tmp_path / "a" / "kept").touch()
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["kept"]
    (tmp_path / "there").mkdir()
    with claims_released():
        claim_folder(tmp_path / "there")
    assert not list((tmp_path / "there").iterdir())


def test_a_command_does_not_claim_twice_what_it_has(tmp_path):
    with claims_released():
        claim_folder(tmp_path)
        assert [lock.name for lock in claims._held] == [".drumsqueal.lock"]
        claim_file(tmp_path / "x.csv")  # a share in the folder, too, which it has alone
        assert [lock.name for lock in claims._held] == [".drumsqueal.lock", ".x.csv.lock"]
        assert [each.alone for each in claims._held.values()] == [True, True]
    assert not claims._held
    with claims_released():
        claim_file(tmp_path / "x.csv")
        assert [each.alone for each in claims._held.values()] == [False, True]
    assert not list(tmp_path.iterdir())


def test_whether_the_first_folder_is_gone_is_told(tmp_path):
    inner, outer = tmp_path / "a" / "b", tmp_path / "a"
    inner.mkdir(parents=True)
    assert claims._remove([inner, outer])
    assert not outer.exists()
    assert claims._remove([inner])
    assert claims._remove([])
    inner.mkdir(parents=True)
    (inner / "x").touch()
    assert not claims._remove([inner, outer])
    assert outer.exists()


def test_who_has_a_lock_says_so_in_its_last_line(tmp_path):
    lock = tmp_path / "lock"
    assert claims._holder(lock) == "another command"
    lock.write_text("drumsqueal run, process 1\ndrumsqueal sweep, process 2\nmade 3\n")
    assert claims._holder(lock) == "drumsqueal sweep, process 2"
    lock.write_text("made 3\n")
    assert claims._holder(lock) == "another command"


def test_folders_of_a_claim_that_came_too_late_are_left_to_who_has_the_lock(tmp_path):
    outer, inner = tmp_path / "a", tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    lock = inner / claims.LOCK
    lock.write_text("drumsqueal run, process 1\n")
    claims._hand_over(lock, [inner, outer])
    assert lock.read_text() == "drumsqueal run, process 1\nmade 2\n"
    claims._hand_over(lock, [tmp_path / "x" / ".." / "a" / "b", outer])  # of which the others may be anywhere
    assert lock.read_text().endswith("made 2\nmade 1\n")
    claims._hand_over(lock, [])
    assert lock.read_text().endswith("made 2\nmade 1\n")
    lock.unlink()
    claims._hand_over(lock, [inner, outer])  # nobody has it any more: they are removed
    assert not outer.exists()


@pytest.mark.parametrize(("notes", "left"), [(("made 2", "made 1", "made x"), []), (("made 1",), ["a"]), ((), ["a"])])
def test_who_has_a_lock_removes_as_many_folders_as_the_others_have_made(tmp_path, notes, left):
    inner = tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    with claims_released():
        claim_folder(inner)
        with (inner / claims.LOCK).open("a") as file:
            file.writelines(f"{note}\n" for note in notes)
    assert sorted(path.name for path in tmp_path.iterdir()) == left
    assert inner.exists() == (not notes)


# --- folders of results ----------------------------------------------------------------------------------------------


def test_earlier_results_come_back_where_nothing_has_been_written(tmp_path):
    names = ("a", "b", "c")
    for name in names[:2]:
        (tmp_path / name).write_text(f"earlier {name}")

    def remake(made: str | None = None) -> None:
        with set_aside(tmp_path, names) as gone:
            assert gone == ["a", "b"]
            assert sorted(path.name for path in tmp_path.iterdir()) == [EARLIER]
            if made is not None:
                (tmp_path / made).write_text("new")
            raise IntegrationError("lost")

    with pytest.raises(IntegrationError, match=f"lost; the earlier results are in {tmp_path}$"):
        remake()
    assert [(tmp_path / name).read_text() for name in names[:2]] == ["earlier a", "earlier b"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]
    with pytest.raises(IntegrationError, match=f"lost; the earlier results are in {tmp_path / EARLIER}$"):
        remake("c")
    assert sorted(path.name for path in tmp_path.iterdir()) == [EARLIER, "c"]
    with set_aside(tmp_path, names) as gone:  # those of before the command that was stopped
        assert gone == list(names)
        assert sorted(path.name for path in (tmp_path / EARLIER).iterdir()) == ["a", "b"]
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_moved_does_not_hide_how_a_command_ended(tmp_path, monkeypatch):
    (tmp_path / "a").write_text("earlier")

    def denied(*_):
        raise PermissionError(13, "Permission denied")

    def fails():
        with set_aside(tmp_path, "ab"):
            monkeypatch.setattr(Path, "rename", denied)
            raise IntegrationError("lost")

    with pytest.raises(IntegrationError, match=f"lost; the earlier results are in {tmp_path / EARLIER}$"):
        fails()
    assert (tmp_path / EARLIER / "a").read_text() == "earlier"
    monkeypatch.undo()
    with set_aside(tmp_path, "ab"):  # and what somebody else has removed is gone
        (tmp_path / EARLIER / "a").unlink()
        (tmp_path / "b").touch()
    assert [path.name for path in tmp_path.iterdir()] == ["b"]


def test_results_that_are_gone_on_with_stay(tmp_path):
    for name in "abc":
        (tmp_path / name).touch()
    (tmp_path / "a.part").touch()
    with set_aside(tmp_path, "abc", but="b") as gone:
        assert gone == ["a", "c"]
        assert sorted(path.name for path in tmp_path.iterdir()) == ["b"]
    assert clear(tmp_path, "abc") == ["b"]


def test_a_file_is_written_whole_or_not_at_all(tmp_path):
    path = tmp_path / "x"
    write_whole(path, b"one")

    def write(error: Exception) -> None:
        with written_whole(path) as part:
            part.write_bytes(b"two")
            raise error

    with pytest.raises(ValueError, match="stop"):
        write(ValueError("stop"))
    assert path.read_bytes() == b"one"
    assert [each.name for each in tmp_path.iterdir()] == ["x"]
    with pytest.raises(OSError, match=rf"^{path} cannot be written \(full\)$"):
        write(OSError(28, "full", "another"))
    assert path.read_bytes() == b"one"


def test_what_is_in_the_way_is_refused(tmp_path):
    taken, folder, link = tmp_path / "taken", tmp_path / "folder", tmp_path / "link"
    taken.touch()
    folder.mkdir()
    link.symlink_to(tmp_path / "nowhere")
    check_output(tmp_path, ["taken"], overwrite=True)
    check_output(tmp_path / "new", ["taken"], overwrite=False)
    for place, names, why in (
        (tmp_path, ["x", "taken"], "taken exists; add --overwrite to replace"),
        (tmp_path, ["folder"], "folder is a folder"),
        (taken, ["x"], "is a file, not a folder"),
        (link, ["x"], "is a link that leads nowhere"),
    ):
        with pytest.raises(RequestError, match=why):
            check_output(place, names, overwrite=False)
    (tmp_path / "report.html").touch()
    with pytest.raises(RequestError, match="add --overwrite to remove it"):
        check_output(tmp_path, ["report.html"], overwrite=False)
    check_output_file(taken, overwrite=True)
    check_output_file(tmp_path / "new", overwrite=False)
    (tmp_path / "y.part").mkdir()
    for path, why in (
        (taken, "taken exists; add --overwrite"),
        (folder, "is a folder, where a file is to go"),
        (tmp_path / "no" / "x", "there is no folder"),
        (tmp_path / "y", r"y\.part is a folder"),
    ):
        with pytest.raises(RequestError, match=why):
            check_output_file(path, overwrite=False)
    check_apart(taken, [folder])
    with pytest.raises(RequestError, match="would replace"):
        check_apart(taken, [folder, tmp_path / "folder" / ".." / "taken"])
    check_ending(tmp_path / "x.CSV", [".txt", ".csv"], "a table")
    with pytest.raises(RequestError, match=r"a table ends in \.txt or \.csv"):
        check_ending(tmp_path / "x.nc", [".txt", ".csv"], "a table")


def test_files_are_made_of_a_history_or_of_modes(tmp_path):
    assert {"x.csv", "x.gif", "x.parquet"} <= set(made_of("x.nc"))
    assert [is_made(name) for name in ("history.csv", "mode-X.gif", "mode-X(2).gif", "mode-Q.gif", "history.nc")] == [
        True, True, True, False, False,
    ]  # fmt: skip
    (tmp_path / EARLIER).mkdir()
    (tmp_path / EARLIER / "mode-Y.gif").touch()
    (tmp_path / "mode-X.gif").touch()
    (tmp_path / "mode-Q.gif").touch()
    assert [name for name in files_of_run(tmp_path) if name.startswith("mode")] == ["mode-X.gif", "mode-Y.gif"]
    assert history_of(tmp_path) == tmp_path / "history.nc"
    assert history_of(tmp_path / "x.nc") == tmp_path / "x.nc"
    assert run_figures(changing=True, brake=True)[-2:] == ("pressure", "waterfall")
    assert "waterfall" not in run_figures(changing=False)


# --- histories in place ----------------------------------------------------------------------------------------------


def test_blocks_follow_one_another_to_the_last_row():
    size = in_place.BLOCK
    assert list(in_place.blocks(2 * size + 3)) == [(0, size), (size, 2 * size), (2 * size, 2 * size + 3)]
    assert list(in_place.blocks(size)) == [(0, size)]


def test_how_far_a_run_has_come_is_told(scene, tmp_path):
    file = HistoryFile(tmp_path / "h.nc", scene, ())
    assert not file.exists
    simulate = scene.simulate
    rows = round(simulate.duration * simulate.sample_rate) + 1
    outcome = file._so_far(Reached(11, 5, 1))
    assert outcome.ending is Ending.CUT_OFF
    assert f"after t = {10 / simulate.sample_rate:.6g} s; 11 of {rows} samples were computed" in str(outcome)
    file.end(outcome)
    assert not list(tmp_path.iterdir())


def test_steps_add_up_from_chunk_to_chunk(scene, tmp_path, monkeypatch):
    file, noted = HistoryFile(tmp_path / "h.nc", scene, (), Reached(10, 5, 2)), []
    monkeypatch.setattr(history_file, "columns", lambda chunk, kept, names: {})
    monkeypatch.setattr(history_file, "fill", lambda path, places, first, values: noted.append(first))
    monkeypatch.setattr(history_file, "_note_progress", lambda path, reached, outcome: noted.append(reached))
    chunk: Any = SimpleNamespace(time=np.zeros(4), steps=7, rejected_steps=3)
    file.append(chunk)
    assert noted == [10, Reached(14, 12, 5)]
    assert file.reached == Reached(14, 12, 5)


# --- points to resume from -------------------------------------------------------------------------------------------


def point(scene: Any, intervals: int = CHUNK_SAMPLES, **more: Any) -> ResumePoint:
    n = len(scene.start.displacement) and len(history_file.kept_coordinates(scene))
    state = State(real(np.arange(n) / 3), real(-np.arange(n) / 7), real(0.1), None)
    method = Method("tsit5" if scene.simulate.solver != "auto" else history_file.DEFAULT, 2, 1)
    known = {"intervals": intervals, "state": state, "step": real(1e-5), "first_energy": 0.3, "sticks": False}
    return ResumePoint(Reached(intervals + 1, 40, 3), Checkpoint(**(known | {"method": method} | more)))  # pyright: ignore[reportArgumentType]


def test_a_point_comes_back_as_it_was(scene):
    before = point(scene)
    plain = json.loads(json.dumps(_to_plain(before, history_file._digest(scene))))
    after = _from_plain(plain, scene)
    assert after.reached == before.reached
    one, other = before.checkpoint, after.checkpoint
    for name in ("vibration", "velocity", "work"):
        np.testing.assert_array_equal(getattr(one.state, name), getattr(other.state, name))
    assert (other.intervals, float(other.step), other.first_energy, other.sticks) == (CHUNK_SAMPLES, 1e-5, 0.3, False)
    assert other.method == one.method


def test_what_is_no_point_of_the_run_is_refused(scene):
    plain = _to_plain(point(scene), history_file._digest(scene))
    whole = round(scene.simulate.duration * scene.simulate.sample_rate)
    _from_plain(plain | {"samples": whole + 1}, scene)
    name = plain["method"][0]
    wrong: list[dict[str, Any]] = [
        {"samples": CHUNK_SAMPLES}, {"samples": 1}, {"samples": whole + CHUNK_SAMPLES + 1}, {"step": 0.0},
        {"step": -1.0}, {"work": float("nan")}, {"vibration": [0.0]}, {"format": 1}, {"scene": "x"},
        {"method": [name, 1, 2]}, {"method": [name, -1, -1]}, {"method": ["euler", 2, 1]},
        {"method": [name, history_file.MOST_PATIENCE + 1, 0]}, {"sticks": 1},
    ]  # fmt: skip
    for each in wrong:
        with pytest.raises(ValueError, match="no point of the run"):
            _from_plain(plain | each, scene)
    _from_plain(plain | {"method": [name, history_file.MOST_PATIENCE, history_file.MOST_PATIENCE]}, scene)


def test_later_points_are_written_now_and_then(scene, tmp_path, monkeypatch):
    clock, file = [100.0], ResumeFile(tmp_path / "resume.json", scene)
    monkeypatch.setattr(history_file, "time", SimpleNamespace(monotonic=lambda: clock[0]))

    def written() -> int:
        return json.loads((tmp_path / "resume.json").read_text())["samples"]

    assert not file.exists
    for seconds, count, wanted in ((100.0, 1, 1), (100.1, 2, 1), (100.21, 3, 3), (100.4, 4, 3)):
        clock[0] = seconds
        file.note(point(scene, count * CHUNK_SAMPLES))
        assert written() == wanted * CHUNK_SAMPLES + 1
    file.write()
    assert written() == 4 * CHUNK_SAMPLES + 1
    file.remove()
    assert not file.exists
    file.write()
    assert not file.exists


def test_the_first_difference_of_two_scenes_is_named(scene):
    assert _leaves({"a": {"b": 1, "c": [1, 2]}, "d": [{"e": 3}, {"e": 4}]}) == {
        "a.b": 1, "a.c": [1, 2], "d.0.e": 3, "d.1.e": 4,
    }  # fmt: skip
    other = scene.with_values({"simulate.duration": 2 * scene.simulate.duration})
    words = history_file.difference(scene, other)
    assert words.startswith("simulate.duration was ")
    assert words.endswith(" here")
    twice = other.with_values({"simulate.tolerance": 3 * scene.simulate.tolerance})
    assert history_file.difference(scene, twice).endswith(" (and 1 more differ)")


def test_versions_that_changed_are_named():
    here = history_file.versions()
    name, version = next(iter(here.items()))
    words = history_file.changed_versions(json.dumps(here | {name: "0.0", "gone": "1"}))
    assert words == f"the run was made with other versions ({name} 0.0, here {version}, gone 1, here None)"


@pytest.mark.parametrize(
    ("command", "answered"),
    [
        ("accuracy", "accuracy.answer.ACCURACY"), ("compare", "compare.answer.COMPARED"),
        ("cycle", "cycle.answer.CYCLES"), ("branch", "cycle.answer.BRANCHES"),
        ("effects", "effects.answer.EFFECTS_ANSWER"), ("fit", "fit.answer.FIT_ANSWER"),
        ("matrix", "sweep.answer.MATRIX_ANSWER"), ("motion", "motion.answer.MOTION"),
        ("onset", "onset.answer.ONSET"),
    ],
)  # fmt: skip
def test_what_a_command_writes_is_what_it_is_known_to_write(command, answered):
    module, _, name = f"drumsqueal.questions.{answered}".rpartition(".")
    files = getattr(importlib.import_module(module), name).files
    assert {*files} == {each for each in FILES[command] if each in files or not is_made(each)}
