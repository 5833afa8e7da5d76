"""What it takes to go on with a run that was cut off: a small file next to its history, and the checks before that.

Both files may have come from a stranger: they are read as data, and what does not fit is refused in one line.
"""

import hashlib
import json
import operator
import time
import tomllib
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray

from drumsqueal.errors import NothingToDoError, RequestError
from drumsqueal.files.history_file import Reached
from drumsqueal.files.in_place import opened, own_variable, read_texts, variable
from drumsqueal.files.output_folder import HISTORY, RESUME, write_whole
from drumsqueal.findings.history import MOTION, TEMPERATURE, empty_dataset, signals_of, versions
from drumsqueal.ordinary import read_ordinary
from drumsqueal.outcome import Ending
from drumsqueal.physics.composition import kept_coordinates
from drumsqueal.precision import real
from drumsqueal.scene import Scene, scene_from_dict
from drumsqueal.scene.quantities import show
from drumsqueal.solve.transient.integrate import Checkpoint
from drumsqueal.solve.transient.runge_kutta import AUTO, DEFAULT, IMPLICIT
from drumsqueal.solve.transient.state import CHUNK_SAMPLES, State
from drumsqueal.solve.transient.stick_slip import MOST_PATIENCE, Method

FORMAT = 2
EVERY = 0.2  # s of computing that may have to be repeated; to write the file takes some 3 ms
_ANEW = "add --overwrite instead of --resume to run it again"


class ResumePoint(NamedTuple):
    """How far a run had come, and all that goes on from there."""

    reached: Reached
    checkpoint: Checkpoint


class ResumeFile:
    """The point from which a run can go on, on disk; it may be behind the history, never ahead of it."""

    def __init__(self, path: Path, scene: Scene) -> None:
        """Name the file; it is created with the first point."""
        self._path, self._scene = path, _digest(scene)
        self._unwritten: ResumePoint | None = None
        self._written_at = -np.inf

    @property
    def exists(self) -> bool:
        """Whether there is a point to go on from."""
        return self._path.exists()

    def note(self, point: ResumePoint) -> None:
        """Note a point that is in the history already; the first one is written at once, later ones now and then."""
        self._unwritten = point
        if time.monotonic() - self._written_at >= EVERY:
            self.write()

    def write(self) -> None:
        """Write the last point; on a disk that is full the one before is kept."""
        if self._unwritten is None:
            return
        with suppress(OSError):
            write_whole(self._path, json.dumps(_to_plain(self._unwritten, self._scene), allow_nan=False).encode())
            self._unwritten = None
        self._written_at = time.monotonic()

    def remove(self) -> None:
        """There is nothing to go on with. Raises OSError."""
        self._unwritten = None
        self._path.unlink(missing_ok=True)


def find_point(folder: Path, scene: Scene) -> ResumePoint:
    """The point from which the run in a folder can go on. Raises RequestError where there is none for this scene."""
    history, file = folder / HISTORY, folder / RESUME
    for path in (history, file):
        if path.is_symlink() or (path.exists() and not path.is_file()):
            raise RequestError(f"{path} is not an ordinary file; put the file itself there to resume the run")
    if not history.exists():
        raise RequestError(f"{folder}: there is no run to resume; leave --resume out")
    try:
        rows, attributes = _read_history(history, empty_dataset(scene))
        there = scene_from_dict(tomllib.loads(attributes["scene"]))
    except Exception:  # h5py raises nearly all there is on a file that is damaged
        raise RequestError(f"{history} is cut short or damaged, so the run cannot be resumed; {_ANEW}") from None
    if there != scene:
        raise RequestError(f"{folder}: {difference(there, scene)}; resume with the scene as it was run, or {_ANEW}")
    if not file.exists():
        ending = Ending(attributes["ending"])
        kind = NothingToDoError if ending is Ending.COMPLETE else RequestError
        raise kind(f"{folder}: {_why_not(ending, attributes['outcome'])}")
    if attributes["versions"] != json.dumps(versions()):
        raise RequestError(f"{folder}: {changed_versions(attributes['versions'])}; go back to those, or {_ANEW}")
    try:
        point = _from_plain(_read_plain(file), scene)
        if not point.reached.samples <= rows or not _is_computed(history, point.reached.samples - 1, signals_of(scene)):
            raise ValueError("ahead of the history")
    except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError):
        message = f"{file} is damaged, of another run or of another version of drumsqueal"
        raise RequestError(f"{message}, so the run cannot be resumed; {_ANEW}") from None
    return point


def _read_history(path: Path, template: xarray.Dataset) -> tuple[int, dict[str, str]]:
    """Number of rows and the texts of a history, after a look at whether all of it is there, and in this very file."""
    with opened(path, "r") as file:
        rows = len(variable(file, "time"))
        for name, values in template.variables.items():
            shape = tuple(rows if dimension == "time" else template.sizes[dimension] for dimension in values.dims)
            own_variable(file, str(name), shape)
    return rows, read_texts(path, ("scene", "versions", "outcome", "ending"))


def _is_computed(path: Path, row: int, signals: Iterable[str]) -> bool:
    with opened(path, "r") as file:
        return all(np.isfinite(variable(file, name)[row]).all() for name in (*MOTION, *signals))


def _why_not(ending: Ending, outcome: str) -> str:
    if ending is Ending.COMPLETE:
        return "the run is complete, there is nothing to resume"
    if ending is Ending.FAILED:
        return f"the run {outcome}, and would fail there again; change the scene, or {_ANEW}"
    return f"there is no {RESUME}, without which the run cannot be resumed; {_ANEW}"


def difference(there: Scene, here: Scene) -> str:
    """The first value in which two scenes differ, and how many others do."""
    old, new = (_leaves(scene.model_dump(mode="json", exclude_none=True)) for scene in (there, here))
    keys = [key for key in old | new if old.get(key) != new.get(key)]
    of_run, given = (show(values[keys[0]]) if keys[0] in values else "left out" for values in (old, new))
    more = f" (and {len(keys) - 1} more differ)" if len(keys) > 1 else ""
    return f"{keys[0]} was {of_run} in the run and is {given} here{more}"


def _leaves(tables: dict[str, Any], path: str = "") -> dict[str, Any]:
    leaves = {}
    for name, value in tables.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            value = {str(index): each for index, each in enumerate(value)}
        leaves |= _leaves(value, f"{path}{name}.") if isinstance(value, dict) else {f"{path}{name}": value}
    return leaves


def changed_versions(text: str) -> str:
    """Say which versions, of those in the text of an attribute, are others than those here."""
    here = versions()
    there = dict.fromkeys(here) | json.loads(text)
    changed = [name for name, version in there.items() if version != here.get(name)]
    changes = ", ".join(f"{name} {there[name]}, here {here.get(name)}" for name in changed)
    return f"the run was made with other versions ({changes})"


def _digest(scene: Scene) -> str:
    return hashlib.sha256(scene.to_toml().encode()).hexdigest()


def _to_plain(point: ResumePoint, scene: str) -> dict[str, Any]:
    """What JSON can hold; it writes each number with all its digits."""
    checkpoint = point.checkpoint
    return point.reached._asdict() | {
        "format": FORMAT,
        "scene": scene,
        **{name: np.asarray(value).tolist() for name, value in checkpoint.state._asdict().items() if value is not None},
        "step": float(checkpoint.step),
        "first_energy": checkpoint.first_energy,
        "sticks": checkpoint.sticks,
        "method": checkpoint.method,
    }


def _read_plain(path: Path) -> dict[str, Any]:
    return json.loads(read_ordinary(path, 2**16))  # of the file; ten times what it has with six coordinates


def _from_plain(data: dict[str, Any], scene: Scene) -> ResumePoint:
    """Raises ValueError, KeyError, TypeError or OverflowError for what `_to_plain` has not written for this scene."""
    reached = Reached(**{name: operator.index(data[name]) for name in Reached._fields})
    vibration, velocity = (real(np.array(data[name], dtype=float)) for name in ("vibration", "velocity"))
    work, step, first_energy = (float(data[name]) for name in ("work", "step", "first_energy"))
    memory = None if scene.temperature is None else real(np.array(data["memory"], dtype=float))
    if memory is not None and memory.shape != (len(TEMPERATURE),):
        raise ValueError("another memory")
    numbers = [*vibration.tolist(), *velocity.tolist(), work, step, first_energy]
    numbers += [] if memory is None else memory.tolist()
    intervals, whole = reached.samples - 1, round(scene.simulate.duration * scene.simulate.sample_rate)
    if not (
        (data["format"], data["scene"]) == (FORMAT, _digest(scene))
        and len(vibration) == len(velocity) == len(kept_coordinates(scene))
        and np.isfinite(numbers).all()
        and step > 0
        and (intervals == whole or (0 < intervals < whole and intervals % CHUNK_SAMPLES == 0))
    ):
        raise ValueError("this is no point of the run")
    name, patience, waited = data["method"]
    solver, sticks = scene.simulate.solver, data["sticks"]
    fits = name in ((DEFAULT, IMPLICIT) if solver == AUTO else (solver,)) and 0 <= waited <= patience <= MOST_PATIENCE
    if not fits or not isinstance(sticks, bool) or (sticks and not scene.rubs):
        raise ValueError("this is no point of the run")
    method = Method(name, operator.index(patience), operator.index(waited))
    state = State(vibration, velocity, real(work), memory)
    return ResumePoint(reached, Checkpoint(intervals, state, real(step), first_energy, sticks, method))
