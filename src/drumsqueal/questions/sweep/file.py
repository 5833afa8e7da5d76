"""The results of a sweep on disk, filled in place: sweep.nc has its full size from the start, and is readable always.

A point that is not computed is marked in `outcome`, and its numbers are NaN. The outcomes of a batch are written last:
whenever the program is killed, what is marked as computed is there, and what is not is computed again.
"""

import json
import math
import tomllib
from collections.abc import Callable, Iterator
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import xarray

from drumsqueal.errors import COMPLETE, NothingToDoError, RequestError
from drumsqueal.files.history_file import changed_versions, difference
from drumsqueal.files.in_place import (
    as_text,
    fill,
    find_places,
    fixed_text,
    lay_out,
    opened,
    read_texts,
    variable,
)
from drumsqueal.files.output_folder import written_whole
from drumsqueal.findings.history import versions
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.sweep.found import number_motions, starts_alone
from drumsqueal.questions.sweep.points import (
    NOT_YET,
    OUTCOME,
    Columns,
    Points,
    attributes,
    blank,
    to_dataset,
)
from drumsqueal.questions.sweep.study import batches, compute
from drumsqueal.scene import scene_from_dict
from drumsqueal.scene.plan import Plan
from drumsqueal.terminal.reply import Answer, Reply, answer

F = TypeVar("F")
RUNNING = "incomplete: the sweep was killed; outcome marks the points that were not computed"
_LONGEST = 256  # bytes of the outcome in the file: of fixed length, so that it can be changed in place
_ANEW = "add --overwrite instead of --resume to compute it again"


class SweepFile:
    """The results of one sweep; whole and readable between two batches, and wherever the program ends."""

    def __init__(self, path: Path, plan: Points) -> None:
        """Name the file; `create` makes it, or `take_up` goes on with one that is there."""
        self.path, self._plan = path, plan
        self._places: dict[str, int] = {}

    def create(self, progress: Progress) -> None:
        """Lay out the file, nothing computed. Raises OSError with its size where the disk does not take it."""
        plan, points = self._plan, self._plan.points
        # Of all points the same one, in whose memory the others are.
        one = {name: np.broadcast_to(value, (points, *value.shape[1:])) for name, value in blank(plan, 1).items()}

        def nothing(first: int, stop: int) -> Columns:
            progress("laying out the file", first, points)
            return {name: values[first:stop] for name, values in one.items()}

        with written_whole(self.path) as part:
            changing = {"outcome": np.array(RUNNING.encode(), f"S{_LONGEST}")}
            self._places = lay_out(part, to_dataset(plan, one, RUNNING), points, nothing, changing)

    def take_up(self) -> None:
        """Go on with a file that is there. Raises ValueError where it is of another sweep."""
        one, shape = blank(self._plan, 1), self._plan.shape
        wanted = {name: ((*shape, *values.shape[1:]), values.dtype) for name, values in one.items()}
        self._places = find_places(self.path, wanted)

    def computed(self) -> np.ndarray:
        """Whether each point is computed (points,)."""
        with opened(self.path, "r") as file:
            return np.ravel(np.asarray(variable(file, OUTCOME)[...])) != NOT_YET

    def write(self, first: int, columns: Columns) -> None:
        """Write the results of the points from number `first` on. Raises OSError."""
        fill(self.path, self._places, first, {name: column for name, column in columns.items() if name != OUTCOME})
        fill(self.path, self._places, first, {OUTCOME: columns[OUTCOME]})

    def note(self, name: str, values: np.ndarray) -> None:
        """Write a variable that follows from the results of all points. Raises OSError."""
        fill(self.path, self._places, 0, {name: values})

    def read(self) -> xarray.Dataset:
        """All of it, in memory."""
        with xarray.open_dataset(self.path, engine="h5netcdf", mask_and_scale=False) as there:
            return there.load()

    def stopped(self, reason: str) -> str:
        """Note why the sweep ended early, and return what the file holds, in words."""
        if not self.path.exists():
            return "nothing was kept"
        held = f"{int(self.computed().sum())} of {self._plan.points} points were computed"
        self._end(f"{reason}; {held}")
        return f"{held} and are in {self.path}; --resume continues from there"

    def completed(self) -> None:
        """Note that the sweep and all its files are complete."""
        self._end(COMPLETE)

    def _end(self, outcome: str) -> None:
        with opened(self.path) as file:
            file.attrs.modify("outcome", fixed_text(outcome, _LONGEST))


def find_sweep(folder: Path, plan: Plan) -> Plan:
    """Return the plan in the units of the sweep in a folder, to go on with it. Raises RequestError where it cannot."""
    path = folder / "sweep.nc"
    if path.is_symlink() or (path.exists() and not path.is_file()):
        raise RequestError(f"{path} is not an ordinary file; put the file itself there to resume the sweep")
    if not path.exists():
        raise RequestError(f"{folder}: there is no sweep to resume; leave --resume out")
    try:
        stored = read_texts(path, ("scene", "sweep", "versions", "outcome"))
        there = scene_from_dict(tomllib.loads(stored["scene"]))
        swept = json.loads(stored["sweep"])
        same = _same(swept, plan.describe())
        if same:
            SweepFile(path, plan).take_up()
            plan = _in_its_units(path, plan)
    except Exception:  # h5py raises nearly all there is on a file that is damaged
        raise RequestError(f"{path} is cut short or damaged, so the sweep cannot be resumed; {_ANEW}") from None
    if there != plan.scene:
        raise RequestError(f"{folder}: {difference(there, plan.scene)}; resume with that, or {_ANEW}")
    if not same:
        raise RequestError(f"{folder}: {_other(swept, plan.describe())}; resume with the same sweep, or {_ANEW}")
    if stored["outcome"] == COMPLETE:
        raise NothingToDoError(f"{folder}: the sweep is complete, there is nothing to resume")
    if stored["versions"] != json.dumps(versions()):
        raise RequestError(f"{folder}: {changed_versions(stored['versions'])}; go back to those, or {_ANEW}")
    return plan


def outcome_of(path: Path, plan: Points) -> str:
    """How the study in a file ended. Raises RequestError where it is another one."""
    wanted = attributes(plan)
    try:
        there = read_texts(path, [*wanted, "outcome"])
    except Exception:  # h5py raises nearly all there is on a file that is damaged
        raise RequestError(f"{path}: this is no file of such a study, or it is damaged; name another one") from None
    differ = [name for name in wanted if there[name] != wanted[name]]
    if differ:
        what = {"sweep": "set of points"}.get(differ[0], differ[0])
        raise RequestError(f"{path} holds a study with another {what}; give it that, or name another file")
    return there["outcome"]


def _same(there: Any, here: Any) -> bool:
    """Whether two descriptions are the same but for round-off, as of one range in two units."""
    if isinstance(there, dict) and isinstance(here, dict):
        return there.keys() == here.keys() and all(_same(there[key], here[key]) for key in here)
    if isinstance(there, list) and isinstance(here, list):
        return len(there) == len(here) and all(map(_same, there, here))
    if isinstance(there, float) and isinstance(here, float):
        return math.isclose(there, here, rel_tol=1e-12)  # of an end of a range that was turned into another unit
    return there == here


def _in_its_units(path: Path, plan: Plan) -> Plan:
    """The plan with its ranges in the units in which the file lists their values."""
    with opened(path, "r") as file:
        units = {key: as_text(variable(file, key).attrs["units"]) for key in plan.given}
    return plan._replace(given={key: each.in_unit(units[key]) for key, each in plan.given.items()})


def _other(there: dict[str, Any], here: dict[str, Any]) -> str:
    """The first thing in which two sweeps differ."""
    key = next(key for key in there | here if there.get(key) != here.get(key))
    was, given = (json.dumps(each[key]) if key in each else "left out" for each in (there, here))
    return f"{key} was {was} in the sweep and is {given} here"


# How results come: batch by batch, from where the batches are computed.


Batches = list[tuple[int, int]]  # the first point of each, and the one after the last
Source = Callable[[Points, Batches, Callable[[], None]], Iterator[tuple[int, Columns]]]


def here(
    plan: Points, left: Batches, look: Callable[[], None], threads: int | None = None
) -> Iterator[tuple[int, Columns]]:
    """Compute the batches in this process: the first point of each, and its results."""
    for first, stop in left:
        yield first, compute(plan, first, stop, threads, look)


def in_memory(plan: Points, progress: Progress = silent, threads: int | None = None) -> xarray.Dataset:
    """Compute all points without a file."""
    columns = blank(plan, plan.points)
    for first, found in _computed(plan, batches(plan), partial(here, threads=threads), progress):
        for name, values in found.items():
            columns[name][first : first + len(values)] = values
    return _numbered(plan, to_dataset(plan, columns, COMPLETE))


def fill_file(file: SweepFile, plan: Points, source: Source, progress: Progress) -> xarray.Dataset:
    """Compute what is missing in a file, each batch once, and return all of it."""
    done = file.computed()
    left = [(first, stop) for first, stop in batches(plan) if not done[first:stop].all()]
    for first, found in _computed(plan, left, source, progress):
        file.write(first, found)
    data = _numbered(plan, file.read())
    if plan.starts:
        file.note("attractor", np.ravel(data["attractor"].values))
    return data


def _computed(plan: Points, left: Batches, source: Source, progress: Progress) -> Iterator[tuple[int, Columns]]:
    """The first point of each batch that is left, and its results, as they come."""
    missing = dict(left)

    def look() -> None:
        progress("sweeping", plan.points - sum(stop - first for first, stop in missing.items()), plan.points)

    look()
    with closing(source(plan, left, look)) as stream:  # pyright: ignore[reportArgumentType]
        for first, columns in stream:
            yield first, columns
            del missing[first]
            look()


def _numbered(plan: Points, data: xarray.Dataset) -> xarray.Dataset:
    """The same, with the starts numbered by where they lead."""
    if plan.starts:
        numbers = number_motions(data, of_one_brake=starts_alone(plan))
        data["attractor"].values = numbers.reshape(plan.shape)
    return data


def fill_into(
    reply: Reply, how: Answer[F], plan: Points, source: Source, find: Callable[[xarray.Dataset], F], *, resume: bool
) -> F:
    """Compute a plan into the folder of a command, or go on with the file that is there, and answer with what it finds.

    `source` computes the batches, in any order, and calls the function that it is given now and then. Raises
    IntegrationError for what failed, was interrupted or did not fit on the disk: the points computed until then are in
    the file.
    """
    file = SweepFile(reply.folder / str(how.filled), plan)

    def filled(progress: Progress, _: Callable[[F], None]) -> F:
        if resume:
            file.take_up()
        else:
            file.create(progress)
        return find(fill_file(file, plan, source, progress))

    return answer(reply, how, filled, record=file, resume=resume)
