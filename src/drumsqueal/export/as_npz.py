"""NumPy's archive: an array for each signal, and the rest as arrays of text, readable without pickle."""

from pathlib import Path

import numpy as np

from drumsqueal.export.channels import Channels


def write(channels: Channels, path: Path) -> str:
    """Write time (s), sample_rate (Hz), each signal by its name, `signals` with `units`, and the texts. Raises OSError.

    `signals` and `units` are arrays of text in the same order; `eigenvalues` has a line for each mode.
    """
    arrays: dict[str, np.ndarray] = {channel.name: channel.values for channel in channels.channels}
    arrays |= {
        "time": channels.time,
        "sample_rate": np.array(channels.sample_rate),
        "signals": np.array([channel.name for channel in channels.channels]),
        "units": np.array([channel.units for channel in channels.channels]),
        "eigenvalues": np.array(channels.prediction, dtype=str),
    }
    arrays |= {name: np.array(text) for name, text in channels.texts.items()}
    with path.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)
    return ""
