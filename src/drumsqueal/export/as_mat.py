"""MATLAB's MAT file, version 5: a column for each signal, their units in a structure, and the texts."""

from pathlib import Path

import numpy as np
import scipy.io

from drumsqueal.errors import RequestError
from drumsqueal.export.channels import Channels

_MOST = 2**31 - 2**20  # bytes of one variable that the format takes


def write(channels: Channels, path: Path) -> str:
    """Write time (s), sample_rate (Hz), each signal by its name, units.NAME, and the texts. Raises OSError.

    Raises RequestError for a signal that is longer than the format takes.
    """
    if channels.time.nbytes > _MOST:
        raise RequestError("--to mat: a variable of a MAT file has 2 GB at most; take a part with --from and --until")
    variables = {channel.name: channel.values for channel in channels.channels}
    variables |= {"time": channels.time, "sample_rate": np.array(channels.sample_rate)}
    units = {channel.name: channel.units for channel in channels.channels} | {"time": "s", "sample_rate": "Hz"}
    texts = channels.texts | {"eigenvalues": np.array(channels.prediction or ("",), dtype=object)}
    with path.open("wb") as file:
        scipy.io.savemat(file, variables | texts | {"units": units}, oned_as="column")
    return ""
