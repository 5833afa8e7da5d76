"""The time history: what a transient recorded, as an xarray Dataset and as a NetCDF file that grows chunk by chunk."""

import importlib.metadata
import json
import platform
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np
import xarray

from drumsqueal.integrate import Chunk
from drumsqueal.scene import COORDINATES, Scene
from drumsqueal.segment import CHUNK_SAMPLES

# name: (units, what it is), of each coordinate
MOTION = {
    "displacement": ("m (X, Y, Z), rad (Tx, Ty, Tz)", "displacement and rotation of the shoe at its centre of gravity"),
    "velocity": ("m/s (X, Y, Z), rad/s (Tx, Ty, Tz)", "rates of displacement and rotation"),
}
AXES = (
    "x from the drum's axis through the middle of the lining, y at right angles to it the way the lining's middle sees "
    "the drum move at positive speed, z along the drum's axis; Tx, Ty, Tz are small rotations about x, y, z"
)
# name: (units, what it is)
SIGNALS = {
    "brake_torque": ("N m", "torque of friction that brakes the drum, R times the integral of its tangential traction"),
    "normal_force": ("N", "integral of the contact pressure over the lining"),
    "contact_fraction": ("1", "share of the lining that touches the drum"),
    "slip_reversed_fraction": ("1", "share of the lining that touches the drum and moves faster than it"),
    "smallest_pressure": ("Pa", "smallest contact pressure on the lining"),
    "friction_power": ("W", "power that friction turns into heat"),
    "kinetic_energy": ("J", "kinetic energy of the shoe"),
    "potential_energy": ("J", "energy stored in lining, supports and preload, relative to q = 0"),
    "energy_balance_error": ("J", "change of stored energy less the work that friction, damping and loads fed in"),
}
COMPLETE = "complete"
RUNNING = "incomplete: the run was cut off without a word"
_LONGEST = 512  # bytes of the outcome in the file: of fixed length, so that to change it takes no room
_ROOM = 500 * CHUNK_SAMPLES  # bytes; twice what a chunk has been seen to take, with HDF5's tables
_PACKAGES = ("drumsqueal", "jax", "jaxlib", "diffrax", "equinox", "optimistix", "numpy", "scipy", "xarray")


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that make the numbers."""
    return {"python": platform.python_version()} | {name: importlib.metadata.version(name) for name in _PACKAGES}


def to_dataset(chunks: Sequence[Chunk], scene: Scene, kept: Sequence[str], outcome: str) -> xarray.Dataset:
    """Put the chunks of one run, over the kept coordinates, into one Dataset; left-out coordinates are zero.

    Dimensions time (s) and coordinate (six names). The scene as it was run, the versions and the outcome are in the
    attributes.
    """
    columns = [_columns(chunk, kept) for chunk in chunks]
    joined = {name: np.concatenate([part[name] for part in columns]) for name in columns[0]}
    data: dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]] = {}
    for name, (units, meaning) in MOTION.items():
        data[name] = (("time", "coordinate"), joined[name], {"units": units, "long_name": meaning})
    for name, (units, meaning) in SIGNALS.items():
        data[name] = (("time",), joined[name], {"units": units, "long_name": meaning})
    coordinates = {
        "time": ("time", joined["time"], {"units": "s", "axis": "T"}),
        "coordinate": ("coordinate", list(COORDINATES), {"long_name": AXES}),
    }
    attributes = {
        "title": scene.title,
        "scene": scene.to_toml(),
        "versions": json.dumps(versions()),
        "outcome": outcome,
        "steps": sum(chunk.steps for chunk in chunks),
        "rejected_steps": sum(chunk.rejected_steps for chunk in chunks),
        "measured_from": "q = 0 of the model; a self-consistent steady state shows as an offset",
    }
    return xarray.Dataset(data, coordinates, attributes)


class HistoryFile:
    """A history on disk that every chunk extends, and that is closed, whole and readable between two chunks.

    A disk that is full is found before a chunk is begun, so that what is in the file stays readable. A program that is
    killed, or a disk that breaks, in the milliseconds of writing a chunk may leave a file that is not.
    """

    def __init__(self, path: Path, scene: Scene, kept: Sequence[str]) -> None:
        """Name the file; it is created with the first chunk."""
        self.path, self._scene, self._kept = path, scene, kept
        self.exists = False

    def append(self, chunk: Chunk) -> None:
        """Add the samples of one chunk. Raises OSError, and leaves what was there, when the disk has no room."""
        if not self.exists:
            self._create(to_dataset([chunk], self._scene, self._kept, RUNNING))
            return
        columns = _columns(chunk, self._kept)
        _make_room(self.path, _ROOM)
        with self._opened() as file:
            for name, values in columns.items():
                variable = file[name]
                assert isinstance(variable, h5py.Dataset)  # for the type checker
                variable.resize(len(variable) + len(values), axis=0)
                variable[-len(values) :] = values
            for name in ("steps", "rejected_steps"):
                file.attrs.modify(name, file.attrs[name] + getattr(chunk, name))

    def end(self, outcome: str) -> None:
        """Write how the run ended, which takes no more room on the disk; nothing where there is no file."""
        if self.exists:
            with self._opened() as file:
                file.attrs.modify("outcome", _padded(outcome))

    def _create(self, dataset: xarray.Dataset) -> None:
        _make_room(self.path, _ROOM + len(json.dumps(dataset.attrs)))  # found rather than kept: the file is made anew
        outcome = dataset.attrs.pop("outcome")
        try:
            dataset.to_netcdf(self.path, engine="h5netcdf", unlimited_dims=["time"])
            with self._opened() as file:
                file.attrs.create("outcome", _padded(outcome), dtype=h5py.string_dtype(length=_LONGEST))
        except OSError:
            self.path.unlink(missing_ok=True)
            raise
        self.exists = True

    @contextmanager
    def _opened(self) -> Iterator[h5py.File]:
        try:
            # Without a lock, so that a look at the file from elsewhere does not stop the run.
            with h5py.File(self.path, "r+", locking=False) as file:
                yield file
        except RuntimeError as error:  # what h5py raises when a disk fails while a file is closed
            raise OSError(str(error)) from None


def _columns(chunk: Chunk, kept: Sequence[str]) -> dict[str, np.ndarray]:
    """What every variable of the history gets from a chunk."""
    recorded = chunk.observation._asdict() | chunk._asdict()
    columns = {name: _widen(recorded[name], kept) for name in MOTION}
    return columns | {name: recorded[name] for name in ("time", *SIGNALS)}


def _make_room(path: Path, size: int) -> None:
    """Take room on the disk, by zeros behind the file that HDF5 then writes over and cuts off.

    HDF5 itself does not survive a disk that is full. Raises OSError, the file as it was.
    """
    with path.open("ab", buffering=0) as file:
        end = file.tell()
        try:
            while (missing := end + size - file.tell()) > 0:
                file.write(bytes(missing))
        except OSError:
            file.truncate(end)
            if end == 0:
                path.unlink()
            raise


def _padded(outcome: str) -> bytes:
    return outcome.encode()[:_LONGEST].decode(errors="ignore").encode()


def _widen(values: np.ndarray, kept: Sequence[str]) -> np.ndarray:
    wide = np.zeros((len(values), len(COORDINATES)))
    wide[:, [COORDINATES.index(name) for name in kept]] = values
    return wide
