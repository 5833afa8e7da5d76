"""Reading a history that a run has left, for what works on histories; the file may be anybody's."""

import tomllib
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
import xarray

from drumsqueal.coordinates import COORDINATES, in_order
from drumsqueal.errors import COMPLETE, Ending, Outcome, RequestError
from drumsqueal.files.in_place import as_text, content_of, variable
from drumsqueal.files.output_folder import history_file
from drumsqueal.findings.history import MOTION, SIGNALS, signals_of
from drumsqueal.scene import Scene, SceneError, scene_from_dict

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
