"""MATLAB's MAT file, version 5: a column for each signal, their units and the modes in structures, and the texts."""

from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.progress import Progress
from drumsqueal.questions.export.channels import Channels
from drumsqueal.questions.export.modes import mode_arrays, steady_arrays

_MOST = 2**31 - 2**20  # bytes of one variable that the format takes


def write(channels: Channels, path: Path, progress: Progress) -> str:
    """Write t (s), fs (Hz), each signal by its name, units.NAME, eigenvalues, modes.NAME and the texts. Raises OSError.

    Raises RequestError for a signal that is longer than the format takes.
    """
    if channels.time.nbytes > _MOST:
        raise RequestError("--to mat: a variable of a MAT file has 2 GB at most; take a part with --from and --until")
    variables: dict[str, Any] = {channel.name: channel.values for channel in channels.channels}
    variables |= {"t": channels.time, "fs": np.array(channels.sample_rate)}
    units: dict[str, Any] = {channel.name: channel.units for channel in channels.channels} | {"t": "s", "fs": "Hz"}
    if channels.stability is not None:
        steady = {name: _as_matlab(values) for name, values in steady_arrays(channels.stability).items()}
        modes = {name: _as_matlab(values) for name, values in mode_arrays(channels.stability).items()}
        units |= {"eigenvalues": "1/s", "steady_state": steady.pop("coordinate_units")}
        variables |= steady | {"modes": modes}
    progress("writing", 0.0, None)
    with path.open("wb") as file:
        scipy.io.savemat(file, variables | channels.texts | {"units": units}, oned_as="column")
    return ""


def _as_matlab(values: NDArray[Any]) -> NDArray[Any]:
    """Numbers as they are, and text as a cell array, as MATLAB has it."""
    return values.astype(object) if values.dtype.kind == "U" else values
