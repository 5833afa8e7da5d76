"""The results of a sweep on disk, filled in place: sweep.nc has its full size from the start, and is readable always.

A point that is not computed is marked in `outcome`, and its numbers are NaN. The outcomes of a batch are written last:
whenever the program is killed, what is marked as computed is there, and what is not is computed again.
"""

import errno
import json
import math
import tomllib
from pathlib import Path
from typing import Any

import h5netcdf
import h5py
import numpy as np
import xarray

from drumsqueal.errors import NothingToDoError, RequestError
from drumsqueal.files.in_place import as_text, fill, fixed_text, opened, own_variable, placed, read_texts, variable
from drumsqueal.files.output_folder import part_of
from drumsqueal.files.resumption import changed_versions, difference
from drumsqueal.findings.history import COMPLETE, versions
from drumsqueal.progress import Progress
from drumsqueal.questions.sweep.points import (
    NOT_YET,
    OUTCOME,
    Columns,
    Points,
    attributes,
    axes,
    blank,
    shape_of,
    variables_of,
)
from drumsqueal.scene import scene_from_dict
from drumsqueal.scene.plan import Plan

RUNNING = "incomplete: the sweep was killed; outcome marks the points that were not computed"
ROUND_OFF = 1e-12  # relative, of an end of a range that was turned from one unit into another
_LONGEST = 256  # bytes of the outcome in the file: of fixed length, so that it can be changed in place
_BLOCK = 2**15  # points at a time, where all are written
_ANEW = "add --overwrite instead of --resume to compute it again"


class SweepFile:
    """The results of one sweep; whole and readable between two batches, and wherever the program ends."""

    def __init__(self, path: Path, plan: Points) -> None:
        """Name the file; `create` makes it, or `take_up` goes on with one that is there."""
        self.path, self._plan = path, plan
        self._places: dict[str, int] = {}

    def create(self, progress: Progress) -> None:
        """Lay out the file, nothing computed. Raises OSError with its size where the disk does not take it."""
        part, points = part_of(self.path), self._plan.points
        size = points * sum(values.nbytes for values in blank(self._plan, 1).values())
        try:
            part.unlink(missing_ok=True)  # a link would be followed
            # HDF5 itself does not survive a disk that is full: there is room before it writes.
            with part.open("wb") as file:
                for _ in range(0, size, _BLOCK * 2**5):
                    file.write(bytes(_BLOCK * 2**5))
            _lay_out(part, self._plan)
            self._places = _find_places(part, self._plan)
            for first in range(0, points, _BLOCK):
                progress("laying out the file", first, points)
                fill(part, self._places, first, blank(self._plan, min(_BLOCK, points - first)))
            part.replace(self.path)
        except BaseException as error:
            part.unlink(missing_ok=True)
            if isinstance(error, OSError):
                cause = f"{error.strerror or error}; the whole file takes {size / 1e6:.3g} MB"
                raise OSError(error.errno or errno.EIO, cause, str(self.path)) from None
            raise

    def take_up(self) -> None:
        """Go on with a file that `find_sweep` has looked at."""
        self._places = _find_places(self.path, self._plan)

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
            _find_places(path, plan)
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
        return math.isclose(there, here, rel_tol=ROUND_OFF)
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


def _lay_out(path: Path, plan: Points) -> None:
    """Create the structure of the file; each variable has its place, but nothing in it."""
    with h5netcdf.File(path, "w") as file:
        along = axes(plan)
        own = {name: len(values) for name, (dimensions, values, _) in along.items() if dimensions == (name,)}
        file.dimensions = dict(zip(plan.dimensions, plan.shape, strict=True)) | own
        for name, (dimensions, values, about) in along.items():
            kind = h5py.string_dtype() if values.dtype == object else values.dtype
            file.create_variable(name, dimensions, kind, data=values).attrs.update(about)
        drawn = {"coordinates": " ".join(plan.keys)} if plan.draws else {}  # by the CF conventions
        for name, each in variables_of(plan).items():
            lost = {"fillvalue": np.nan} if each.kind == "f8" else {}
            made = file.create_variable(name, (*plan.dimensions, *each.dimensions), each.kind, dcpl=placed(), **lost)
            made.attrs.update(each.attributes() | drawn)
        file.attrs.update(attributes(plan))
    with opened(path) as file:
        file.attrs.create("outcome", RUNNING.encode(), dtype=f"S{_LONGEST}")


def _find_places(path: Path, plan: Points) -> dict[str, int]:
    """Where in the file (bytes) each variable begins; raises ValueError where the file is of another sweep."""
    places = {}
    with opened(path, "r") as file:
        for name, each in variables_of(plan).items():
            found = own_variable(file, name, (*plan.shape, *shape_of(plan, each, 1)[1:]))
            if found.dtype != np.dtype(each.kind):
                raise ValueError(name)
            places[name] = found.id.get_offset()
    return places
