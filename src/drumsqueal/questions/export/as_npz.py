"""NumPy's archive: an array for each signal, for the modes and for the texts, readable without pickle."""

from pathlib import Path

import numpy as np

from drumsqueal.progress import Progress
from drumsqueal.questions.export.channels import Channels
from drumsqueal.questions.export.modes import mode_arrays, steady_arrays


def write(channels: Channels, path: Path, progress: Progress) -> str:
    """Write time (s), sample_rate (Hz), each signal by its name, `signals` with `units`, and the texts. Raises OSError.

    `signals` and `units` are arrays of text in the same order. Where eigenvalues are known there are those, and
    `coordinates`, `coordinate_units`, `steady_state` and, of the oscillating modes, `mode_name` to `mode_shape`.
    """
    arrays: dict[str, np.ndarray] = {channel.name: channel.values for channel in channels.channels}
    arrays |= {
        "time": channels.time,
        "sample_rate": np.array(channels.sample_rate),
        "signals": np.array([channel.name for channel in channels.channels]),
        "units": np.array([channel.units for channel in channels.channels]),
    }
    if channels.stability is not None:
        arrays |= steady_arrays(channels.stability)
        arrays |= {f"mode_{name}": values for name, values in mode_arrays(channels.stability).items()}
    arrays |= {name: np.array(text) for name, text in channels.texts.items()}
    progress("writing", 0.0, None)
    with path.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)
    return ""
