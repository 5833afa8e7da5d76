"""A history on disk that is filled in place: from its first chunk on it has its full size, and is readable always.

Where nothing has been computed yet it is NaN, and the outcome says so. A disk that is too small is found at the start.
Of its structure only the outcome, two counts and their checksum change, within two thousand bytes.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray

from drumsqueal.files.in_place import Columns, blocks, fill, fixed_text, lay_out, offset_of, opened, variable
from drumsqueal.files.output_folder import written_whole
from drumsqueal.findings.history import RUNNING, columns, empty_dataset
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.outcome import Ending, Outcome
from drumsqueal.physics.composition import coordinates_of
from drumsqueal.scene import Scene
from drumsqueal.solve.transient.integrate import Chunk

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
        with opened(self.path, "r") as file:
            self._places = {str(name): offset_of(variable(file, str(name))) for name in file if name != "coordinate"}
            whole = len(variable(file, "time")) == self._rows
        if not whole:  # of a run that was stopped in good order
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
            nothing = {name: np.full((stop - first, *shape), np.nan) for name, shape in shapes.items()}
            return nothing | {"time": np.arange(first, stop) / rate}

        changing = {"steps": np.zeros(1, "i8"), "rejected_steps": np.zeros(1, "i8")}
        changing |= {"outcome": np.zeros((), f"S{_LONGEST}"), "ending": np.zeros((), f"S{_WORD}")}
        with written_whole(self.path) as part:
            look = lambda first: first and stop_if_interrupted()  # noqa: E731 (gigabytes may be laid out)
            sizes = {"time": rows}
            places = lay_out(part, template, rows, blank, changing, sizes=sizes, look=look, what="history")
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
