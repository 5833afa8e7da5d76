"""The time history: what a transient recorded, as an xarray Dataset and as a NetCDF file that grows chunk by chunk."""

import importlib.metadata
import json
import platform
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

import h5netcdf
import numpy as np
import xarray

from drumsqueal.integrate import Chunk
from drumsqueal.scene import COORDINATES, Scene

MIXED_UNITS = {"displacement": "m (X, Y, Z), rad (Tx, Ty, Tz)", "velocity": "m/s (X, Y, Z), rad/s (Tx, Ty, Tz)"}
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
_PACKAGES = ("drumsqueal", "jax", "jaxlib", "diffrax", "equinox", "optimistix", "numpy", "scipy", "xarray")


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that make the numbers."""
    return {"python": platform.python_version()} | {name: importlib.metadata.version(name) for name in _PACKAGES}


def to_dataset(chunks: Sequence[Chunk], scene: Scene, kept: Sequence[str], outcome: str) -> xarray.Dataset:
    """Put the chunks of one run, over the kept coordinates, into one Dataset; left-out coordinates are zero.

    Dimensions time (s) and coordinate (six names). The scene as it was run, the versions and the outcome are in the
    attributes.
    """
    time = np.concatenate([chunk.time for chunk in chunks])
    signals = [_signals(chunk) for chunk in chunks]
    data: dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]] = {}
    for name, units in MIXED_UNITS.items():
        values = np.concatenate([_widen(getattr(chunk, name), kept) for chunk in chunks])
        data[name] = (("time", "coordinate"), values, {"units": units})
    for name, (units, meaning) in SIGNALS.items():
        values = np.concatenate([part[name] for part in signals])
        data[name] = (("time",), values, {"units": units, "long_name": meaning})
    coordinates = {
        "time": ("time", time, {"units": "s", "axis": "T"}),
        "coordinate": ("coordinate", list(COORDINATES)),
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
    """A history on disk that every chunk extends, readable up to the last chunk whatever happens afterwards."""

    def __init__(self, path: Path, scene: Scene, kept: Sequence[str]) -> None:
        """Name the file; it is created with the first chunk."""
        self.path, self._scene, self._kept = path, scene, kept
        self._file: h5netcdf.File | None = None

    def append(self, chunk: Chunk) -> None:
        """Add the samples of one chunk. Raises OSError when the disk does not take them."""
        part = to_dataset([chunk], self._scene, self._kept, RUNNING)
        if self._file is None:
            part.to_netcdf(self.path, engine="h5netcdf", unlimited_dims=["time"])
            self._file = h5netcdf.File(self.path, "a")
            return
        for name in ("steps", "rejected_steps"):
            self._file.attrs[name] += part.attrs[name]
        before = self._file.dimensions["time"].size
        self._file.resize_dimension("time", before + chunk.time.size)
        for name in ("time", *part.data_vars):
            self._file.variables[name][before:] = part[name].values
        self._file.flush()

    def close(self, outcome: str) -> None:
        """Write how the run ended and close the file."""
        if self._file is not None:
            self._file.attrs["outcome"] = outcome
            self._file.close()
            self._file = None

    def __enter__(self) -> "HistoryFile":
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close, with the reason if something went wrong."""
        self.close(RUNNING if error is None else f"failed: {error}")


def _signals(chunk: Chunk) -> dict[str, np.ndarray]:
    recorded = chunk.observation._asdict() | chunk._asdict()
    return {name: recorded[name] for name in SIGNALS}


def _widen(values: np.ndarray, kept: Sequence[str]) -> np.ndarray:
    wide = np.zeros((len(values), len(COORDINATES)))
    wide[:, [COORDINATES.index(name) for name in kept]] = values
    return wide
