"""A history as CSV, MAT, NPZ, Parquet or WAV: each writes signals and returns a note on the file, "" for none.

All raise OSError where the disk does not take the file.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from drumsqueal.coordinates import unit_of
from drumsqueal.errors import RequestError
from drumsqueal.findings.signals.sound import FULL_SCALE, HEADROOM_DB, to_sound, wav_bytes
from drumsqueal.progress import Progress
from drumsqueal.questions.export.signals import Channels, distinct

_BLOCK = 2**14  # rows at a time

Arrays = dict[str, NDArray[Any]]


def write_csv(channels: Channels, path: Path, progress: Progress) -> str:
    """Write one line of names with units, "velocity_X (m/s)", and one for each sample, which read back to the last bit.

    pandas writes the same bytes in 1.7 times the time.
    """
    columns = [channels.time, *(channel.values for channel in channels.channels)]
    names = ["time (s)", *(f"{channel.name} ({channel.units})" for channel in channels.channels)]
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join(names) + "\n")
        for first in range(0, columns[0].size, _BLOCK):
            progress("writing rows", first, columns[0].size)
            rows = zip(*(column[first : first + _BLOCK].tolist() for column in columns), strict=True)
            # Floats as Python writes them are the shortest that read back to the same number.
            file.writelines(",".join(map(repr, row)) + "\n" for row in rows)
    return ""


def write_mat(channels: Channels, path: Path, progress: Progress) -> str:
    """Write t (s), fs (Hz), each signal by its name, units.NAME, eigenvalues, modes.NAME and the texts, as version 5.

    Names are as MATLAB takes them, displacement_drum_E1 for displacement_drum.E1. Signals are columns. Raises
    RequestError for one that is longer than the format takes.
    """
    if channels.time.nbytes > 2**31 - 2**20:  # bytes of one variable that a MAT file takes
        raise RequestError("--to mat: a variable of a MAT file has 2 GB at most; take a part with --from and --until")
    # 63 characters that MATLAB takes
    names = distinct([re.sub(r"\W", "_", channel.name) for channel in channels.channels], 63)
    named = list(zip(names, channels.channels, strict=True))
    variables: dict[str, Any] = {name: channel.values for name, channel in named}
    variables |= {"t": channels.time, "fs": np.array(channels.sample_rate)}
    units: dict[str, Any] = {name: channel.units for name, channel in named} | {"t": "s", "fs": "Hz"}
    if channels.stability is not None:
        steady, modes = (
            # Text becomes a cell array, as MATLAB has it.
            {name: values.astype(object) if values.dtype.kind == "U" else values for name, values in arrays.items()}
            for arrays in _predicted(channels)
        )
        units |= {"eigenvalues": "1/s", "steady_state": steady.pop("coordinate_units")}
        variables |= steady | {"modes": modes}
    progress("writing", 0.0, None)
    with path.open("wb") as file:
        scipy.io.savemat(file, variables | channels.texts | {"units": units}, oned_as="column", long_field_names=True)
    return ""


def write_npz(channels: Channels, path: Path, progress: Progress) -> str:
    """Write time (s), sample_rate (Hz), each signal by its name, `signals` with `units`, and the texts, without pickle.

    `signals` and `units` are arrays of text in the same order. Where eigenvalues are known there are those, and
    `coordinates`, `coordinate_units`, `steady_state` and, of the oscillating modes, `mode_name` to `mode_shape`.
    """
    arrays: Arrays = {channel.name: channel.values for channel in channels.channels}
    arrays |= {
        "time": channels.time,
        "sample_rate": np.array(channels.sample_rate),
        "signals": np.array([channel.name for channel in channels.channels]),
        "units": np.array([channel.units for channel in channels.channels]),
    }
    steady, modes = _predicted(channels)
    arrays |= steady | {f"mode_{name}": values for name, values in modes.items()}
    arrays |= {name: np.array(text) for name, text in channels.texts.items()}
    progress("writing", 0.0, None)
    with path.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)
    return ""


def _predicted(channels: Channels) -> tuple[Arrays, Arrays]:
    """Of steady sliding, and of its m oscillating modes by rising frequency; empty where eigenvalues are not known.

    All 2n eigenvalues (1/s), the n coordinates with names and units; λ (1/s), frequencies, growth rates, ζ, and shapes
    (n, m). A column of `shape` is the complex eigenvector of the coordinates, that of the mode's name scaled to 1.
    """
    stability = channels.stability
    if stability is None:
        return {}, {}
    modes, n = stability.modes, len(stability.coordinates)
    return {
        "eigenvalues": stability.eigenvalues,
        "coordinates": np.array(stability.coordinates),
        "coordinate_units": np.array([unit_of(name) for name in stability.coordinates]),
        "steady_state": stability.steady_state,
    }, {
        "name": np.array([mode.label for mode in modes], dtype=str),
        "eigenvalue": np.array([mode.eigenvalue for mode in modes], dtype=np.complex128),
        "frequency_Hz": np.array([mode.frequency_Hz for mode in modes]),
        "growth_rate_1_per_s": np.array([mode.growth_rate for mode in modes]),
        "damping_ratio": np.array([mode.damping_ratio for mode in modes]),
        "shape": np.array([mode.right[:n] for mode in modes], dtype=np.complex128).reshape(-1, n).T,
    }


def write_parquet(channels: Channels, path: Path, progress: Progress) -> str:
    """Write the columns, `units` and `meaning` in the metadata of each and the texts in that of the file."""
    import pyarrow
    import pyarrow.parquet

    fields = [pyarrow.field("time", pyarrow.float64(), nullable=False, metadata={"units": "s"})]
    for channel in channels.channels:
        described = {"units": channel.units, "meaning": channel.meaning}
        fields.append(pyarrow.field(channel.name, pyarrow.float64(), nullable=False, metadata=described))
    prediction = "\n".join(channels.prediction)
    texts = channels.texts | {"sample_rate": repr(channels.sample_rate), "eigenvalues": prediction}
    columns = [pyarrow.array(values) for values in (channels.time, *(each.values for each in channels.channels))]
    progress("writing", 0.0, None)
    with path.open("wb") as file:
        table = pyarrow.Table.from_arrays(columns, schema=pyarrow.schema(fields, metadata=texts))
        pyarrow.parquet.write_table(table, file)
    return ""


def write_wav(channels: Channels, path: Path, progress: Progress) -> str:
    """Write the one signal as 16-bit PCM at sample_rate / slow (Hz), and return its scale, which is also in the file.

    Raises RequestError for a signal that is silent.
    """
    if len(channels.channels) != 1:
        why = "a sound is of one signal, such as surface_velocity"
        raise RequestError(f"--signals {', '.join(each.name for each in channels.channels)}: {why}")
    (channel,) = channels.channels
    rate = round(channels.sample_rate / channels.slow)
    try:
        sound = to_sound(channel.values, channels.sample_rate, slow=channels.slow, rate=rate)
    except ValueError:
        raise RequestError(f"--to wav: {channel.name} is constant in this part; there is nothing to hear") from None
    replay = "" if channels.slow == 1 else f" played {channels.slow:g} times slower than it was,"
    scale = f"one step of the samples is {sound.scale:.9g} {channel.units}"
    comment = f"{channel.name}, {channel.meaning},{replay} {scale}, steady part left out"
    progress("writing", 0.0, None)
    path.write_bytes(wav_bytes(sound, channels.texts.get("title", ""), comment))
    return (
        f"{sound.samples.size / rate:.4g} s of sound at {rate} Hz,{replay} peak {sound.peak:.4g} {channel.units} at "
        f"-{HEADROOM_DB:g} dB of full scale, {sound.scale * FULL_SCALE:.4g} {channel.units}"
    )
