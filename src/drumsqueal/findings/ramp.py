"""Run-up and coast-down: what a record shows while drum speed or load change, and what the eigenvalues predict."""

from typing import TYPE_CHECKING

import numpy as np

from drumsqueal.findings.instant import changing_keys
from drumsqueal.findings.part import Finding
from drumsqueal.findings.passages import Passage, find_passages
from drumsqueal.findings.squeals import Hysteresis, Squeal, find_hysteresis, find_squeals
from drumsqueal.findings.vibration import Vibration
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.modes import Stability
from drumsqueal.solve.linear.passage import Along, corners_of, follow_operation, modes_along

if TYPE_CHECKING:
    import xarray


class CampbellLine(Finding):
    """Frequency and growth rate of a mode over time, by the drum speed and the load of each time."""

    mode: str
    name: str
    time_s: tuple[float, ...]
    frequency_Hz: tuple[float, ...]
    growth_rate_1_per_s: tuple[float, ...]


class Ramp(Finding):
    """What a record shows while drum speed or load change, and what the eigenvalues along the way predict.

    `keys` are those of the scene that change: "drum.speed", "contact.normal_load".
    """

    keys: tuple[str, ...]
    squeals: tuple[Squeal, ...]
    passages: tuple[Passage, ...]
    hysteresis: tuple[Hysteresis, ...]
    lines: tuple[CampbellLine, ...]


def find_ramp(history: "xarray.Dataset", vibration: Vibration, stability: Stability, model: Model) -> Ramp:
    """Find squeals in a history whose drum speed or load change, and follow the eigenvalues along the same way.

    `model` is over the coordinates of the stability. A coordinate that never moves is left aside.
    """
    until = float(vibration.time[-1])
    branches = follow_operation(model, until)
    moves = np.ptp(vibration.extremes(), axis=0) > 0
    moving = {name for name, each in zip(vibration.coordinates, moves, strict=True) if each}
    modes = [along for along in modes_along(branches, corners_of(model, until)) if along.modes[0].name in moving]
    squeals = find_squeals(history, vibration, stability, model, modes)
    return Ramp(
        keys=tuple(changing_keys(model)),
        squeals=squeals,
        passages=() if model.forced else find_passages(modes, branches, squeals, vibration, model),
        hysteresis=find_hysteresis(squeals, model, until),
        lines=tuple(_line(along) for along in modes),
    )


def _line(along: Along) -> CampbellLine:
    frequency, rate = ([getattr(mode, key) for mode in along.modes] for key in ("frequency_Hz", "growth_rate"))
    return CampbellLine(
        mode=along.label,
        name=along.modes[0].name,
        time_s=tuple(along.time.tolist()),
        frequency_Hz=tuple(frequency),
        growth_rate_1_per_s=tuple(rate),
    )
