"""A history on disk that is filled in place: from its first chunk on it has its full size, and is readable always.

Where nothing has been computed yet it is NaN, and the outcome says so. A disk that is too small is found at the start.
Of its structure only the outcome, two counts and their checksum change, within two thousand bytes.

A small file next to it says from where a run that was cut off goes on. Both, and histories that are read back, may have
come from a stranger: they are read as data, and what does not fit is refused in one line.
"""

import hashlib
import json
import operator
import time
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
import xarray

from drumsqueal.coordinates import COORDINATES, in_order
from drumsqueal.errors import COMPLETE, Ending, NothingToDoError, Outcome, RequestError
from drumsqueal.files.in_place import (
    Columns,
    as_text,
    blocks,
    content_of,
    fill,
    find_places,
    fixed_text,
    lay_out,
    opened,
    read_texts,
    variable,
    variables_in,
)
from drumsqueal.files.output_folder import HISTORY, RESUME, history_file, write_whole, written_whole
from drumsqueal.findings.history import (
    MOTION,
    RUNNING,
    SIGNALS,
    TEMPERATURE,
    columns,
    empty_dataset,
    signals_of,
    versions,
)
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.ordinary import read_ordinary
from drumsqueal.physics.composition import coordinates_of, kept_coordinates
from drumsqueal.precision import real
from drumsqueal.scene import Scene, SceneError, scene_from_dict
from drumsqueal.scene.quantities import show
from drumsqueal.solve.transient.integrate import Checkpoint, Chunk
from drumsqueal.solve.transient.runge_kutta import AUTO, DEFAULT, IMPLICIT
from drumsqueal.solve.transient.state import CHUNK_SAMPLES, State
from drumsqueal.solve.transient.stick_slip import MOST_PATIENCE, Method

FORMAT = 2  # of the file to go on from
EVERY = 0.2  # s of computing that may have to be repeated; to write that file takes some 3 ms
_ANEW = "add --overwrite instead of --resume to run it again"
_LONGEST = 512  # bytes of the outcome in the file: of fixed length, so that it can be changed in place
_WORD = 16  # bytes of its ending


class Reached(NamedTuple):
    """How far a run has come: the samples in its history, and the steps that they took."""

    samples: int = 0
    steps: int = 0
    rejected_steps: int = 0


_NOWHERE = Reached()


class HistoryFile:
    """The history of one run; closed, whole and readable between two chunks, and wherever the program ends."""

    def __init__(self, path: Path, scene: Scene, kept: Sequence[str], reached: Reached = _NOWHERE) -> None:
        """Name the file; it is created with the first chunk unless a run that got there has left one."""
        self.path, self.reached = path, reached
        self._scene, self._kept = scene, kept
        self._rows = round(scene.simulate.duration * scene.simulate.sample_rate) + 1
        self._places: dict[str, int] = {}

    @property
    def exists(self) -> bool:
        """Whether there are samples in the file, and so a file."""
        return self.reached.samples > 0

    def take_up(self) -> None:
        """Make ready the file that an earlier run has left. Raises OSError, and keeps the file as it was."""
        rows = _rows_of(self.path)
        self._places = find_places(self.path, variables_in(empty_dataset(self._scene), {"time": rows}))
        if rows != self._rows:  # of a run that was stopped in good order
            self._rewrite(self._rows, self._so_far(self.reached))

    def append(self, chunk: Chunk) -> None:
        """Write the samples of one chunk. Raises OSError, and keeps what was there, when the disk fails."""
        before = self.reached
        after = Reached(
            before.samples + len(chunk.time), before.steps + chunk.steps, before.rejected_steps + chunk.rejected_steps
        )
        with nullcontext((self.path, self._places)) if self.exists else self._anew(self._rows) as (path, places):
            fill(path, places, before.samples, columns(chunk, self._kept, coordinates_of(self._scene)))
            _note_progress(path, after, self._so_far(after))
        self.reached = after

    def end(self, outcome: Outcome) -> None:
        """Write how the run ended, and cut off what it has not computed; nothing where there is no file."""
        if not self.exists:
            return
        if self.reached.samples < self._rows:
            with suppress(OSError):  # without the room for a shorter copy it stays as long as it is
                self._rewrite(self.reached.samples, outcome)
                return
        _note_progress(self.path, self.reached, outcome)

    @contextmanager
    def reading(self) -> Iterator[xarray.Dataset]:
        """The samples computed, on disk, for the block: what is looked at is read each time, and not kept."""
        with xarray.open_dataset(self.path, engine="h5netcdf", cache=False) as whole:
            yield whole.isel(time=slice(self.reached.samples))

    def _so_far(self, reached: Reached) -> Outcome:
        """The outcome of a run that is killed before it has any."""
        last = (reached.samples - 1) / self._scene.simulate.sample_rate
        samples = f"{reached.samples} of {self._rows} samples were computed, the others are NaN"
        return Outcome(Ending.CUT_OFF, f"{RUNNING} after t = {last:.6g} s; {samples}")

    def _rewrite(self, rows: int, outcome: Outcome) -> None:
        """Put a file of so many rows, with the samples computed, in the place of this one."""
        with self._anew(rows) as (part, places), opened(self.path, "r") as source:
            for first, stop in blocks(self.reached.samples):
                fill(part, places, first, {name: variable(source, name)[first:stop] for name in places})
            _note_progress(part, self.reached, outcome)

    @contextmanager
    def _anew(self, rows: int) -> Iterator[tuple[Path, dict[str, int]]]:
        """A file of so many rows, all NaN, that is put in the place of this one after the block, or is no more."""
        template, rate = empty_dataset(self._scene), self._scene.simulate.sample_rate
        shapes = {str(name): values.shape[1:] for name, values in template.variables.items() if "time" in values.dims}

        def blank(first: int, stop: int) -> Columns:
            if first:  # of gigabytes
                stop_if_interrupted()
            nothing = {name: np.full((stop - first, *shape), np.nan) for name, shape in shapes.items()}
            return nothing | {"time": np.arange(first, stop) / rate}

        changing = {"steps": np.zeros(1, "i8"), "rejected_steps": np.zeros(1, "i8")}
        changing |= {"outcome": np.zeros((), f"S{_LONGEST}"), "ending": np.zeros((), f"S{_WORD}")}
        with written_whole(self.path) as part:
            places = lay_out(part, template, rows, blank, changing, sizes={"time": rows}, what="history")
            yield part, places
        self._places = places


def _note_progress(path: Path, reached: Reached, outcome: Outcome) -> None:
    """Write how far the run has come, and how it ended should that be all."""
    with opened(path) as file:
        file.attrs.modify("steps", np.int64(reached.steps))
        file.attrs.modify("rejected_steps", np.int64(reached.rejected_steps))
        file.attrs.modify("outcome", fixed_text(outcome, _LONGEST))
        ending = fixed_text(outcome.ending, _WORD)
        if file.attrs["ending"] != ending:  # between two chunks it stays
            file.attrs.modify("ending", ending)


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
        rows = _rows_of(history)
        find_places(history, variables_in(empty_dataset(scene), {"time": rows}))  # all is there, in this very file
        attributes = read_texts(history, ("scene", "versions", "outcome", "ending"))
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


def _rows_of(path: Path) -> int:
    with opened(path, "r") as file:
        return len(variable(file, "time"))


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


UNEVEN = 1e-6  # of a sampling interval, that a sample may lie off its place; round-off is below 1e-9 in an hour
_OURS = "drumsqueal run SCENE -o DIR writes one, DIR/history.nc"


class SavedHistory(NamedTuple):
    """A history as it was read: where from, the samples that were computed, and the scene as it was run."""

    path: Path
    data: xarray.Dataset
    scene: Scene

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates recorded: the six of the rigid shoe, and behind them those of its shapes."""
        return tuple(map(str, self.data["coordinate"].values))

    @property
    def sample_rate(self) -> float:
        """Samples per second (Hz)."""
        time = self.data["time"].values
        return (time.size - 1) / float(time[-1] - time[0])

    @property
    def outcome(self) -> Outcome:
        """How the run ended."""
        return Outcome(Ending(self.data.attrs["ending"]), self.data.attrs["outcome"])

    @property
    def given_law(self) -> bool:
        """Whether friction followed a law that was given in Python, which the scene does not hold."""
        return "friction_law" in self.data.attrs

    @property
    def complete(self) -> bool:
        """Whether the run got to its end."""
        return self.outcome.ending is Ending.COMPLETE


def read_history(path: Path) -> SavedHistory:
    """Read a history, or the one in a folder that a run has left; samples that were not computed are left away.

    Raises RequestError for a file that is not there, that is no history or not a whole one, or that has fewer than two
    samples.
    """
    file = path
    try:
        file = history_file(path)
        if not file.exists():
            raise RequestError(f"{file}: there is no such file; {_OURS}")
        data, scene = _load(file)
    except RequestError:
        raise
    except SceneError as error:
        message = f"{file}: the scene in it is not one that this version of drumsqueal takes ({error})"
        raise RequestError(f"{message}; read it with the version that wrote it") from None
    except MemoryError:
        raise MemoryError(f"to read {file}") from None
    except OSError as error:
        if error.errno:  # of the system
            raise RequestError(f"{file}: cannot be read ({error.strerror or error})") from None
        if "truncated file" in str(error):  # HDF5 has no other sign of it
            raise RequestError(f"{file}: the file is cut short; copy it again, or run the scene again") from None
        raise RequestError(f"{file}: this is not a history of drumsqueal (not NetCDF-4, or damaged); {_OURS}") from None
    except Exception:  # h5py raises nearly all there is on a file that is damaged
        raise RequestError(f"{file}: this is not a history of drumsqueal, or a damaged one; {_OURS}") from None
    return SavedHistory(file, _computed(file, data, scene), scene)


def _load(path: Path) -> tuple[xarray.Dataset, Scene]:
    with content_of(path) as content:
        with h5py.File(content, "r") as file:
            for name in ("time", *MOTION, *SIGNALS):  # before xarray, which decodes what it finds
                variable(file, name)
        # Of something without dimensions, which no run writes, xarray would warn that it made some up.
        data = xarray.load_dataset(content, engine="h5netcdf", decode_timedelta=False, phony_dims="access")
    scene = scene_from_dict(tomllib.loads(as_text(data.attrs["scene"])))
    names = tuple(map(str, data["coordinate"].values))
    rigid = tuple(f"{prefix}{name}" for prefix in scene.prefixes for name in COORDINATES)
    if not set(rigid) <= set(names) or in_order(names) != names:
        raise ValueError("coordinate")
    dimensions = dict.fromkeys(signals_of(scene), ("time",)) | dict.fromkeys(MOTION, ("time", "coordinate"))
    if any(data[name].dims != wanted for name, wanted in dimensions.items()):
        raise ValueError("dimensions")
    data.attrs["outcome"] = as_text(data.attrs["outcome"])
    complete = data.attrs["outcome"] == COMPLETE  # of an earlier version, which wrote the words alone
    ending = data.attrs.get("ending", Ending.COMPLETE if complete else Ending.CUT_OFF)
    data.attrs["ending"] = Ending(as_text(ending)).value
    return data, scene


def _computed(path: Path, data: xarray.Dataset, scene: Scene) -> xarray.Dataset:
    """The samples up to the first of which anything was not computed, or not yet written."""
    finite = np.isfinite(data["time"].values)
    for name in (*MOTION, *signals_of(scene)):
        finite &= np.isfinite(data[name].values.reshape(finite.size, -1)).all(axis=1)
    rows = finite.size if finite.all() else int(np.argmin(finite))
    if rows < 2:
        raise RequestError(
            f"{path}: the history has {rows} computed samples, at least two are needed; run it for longer"
        )
    time = data["time"].values[:rows]
    places = np.linspace(time[0], time[-1], rows)
    if not time[-1] > time[0] or np.abs(time - places).max() > UNEVEN * (places[1] - places[0]):
        raise RequestError(f"{path}: the samples are not evenly spaced in time, as those of a history are; {_OURS}")
    return data.isel(time=slice(rows))
