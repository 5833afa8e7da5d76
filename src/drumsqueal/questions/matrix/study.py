"""A noise matrix in memory."""

import math
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray

from drumsqueal.progress import Progress, silent
from drumsqueal.questions.matrix.found import OPEN, CellDisturbance, CellFound, CellVerdict, NoiseMatrix
from drumsqueal.questions.sweep.matrix_cells import QUIET, SQUEALS, UNCLEAR, UNDECIDED
from drumsqueal.questions.sweep.matrix_plan import MatrixPlan, read_matrix
from drumsqueal.questions.sweep.points import OUTCOMES, names_in
from drumsqueal.questions.sweep.study import in_memory

REFERENCE = 1e-9  # m/s, of velocity levels by ISO 1683


VERDICTS = {
    QUIET: CellVerdict.QUIET,
    SQUEALS: CellVerdict.SQUEALS,
    UNCLEAR: CellVerdict.NOT_CLEAR,
    UNDECIDED: CellVerdict.UNDECIDED,
}
DISTURBANCES = {0: CellDisturbance.SMALL, 1: CellDisturbance.LARGE}


def study_matrix(
    path: str | os.PathLike[str], *, threads: int | None = None, progress: Progress = silent
) -> NoiseMatrix:
    """Find which of the scenes in a table squeal, in which procedure: `study_matrix("matrix.toml").cells`.

    Raises SceneError and RequestError for a table that is none.
    """
    plan = read_matrix(Path(path))
    return find_matrix(in_memory(plan, progress, threads), plan)


def find_matrix(data: xarray.Dataset, plan: MatrixPlan) -> NoiseMatrix:
    """Put the results of all cells into words and numbers."""
    columns = {str(name): np.ravel(each.values) for name, each in data.variables.items()}
    names = names_in(data, "along")
    cells = tuple(_cell(columns, plan, number, names) for number in range(plan.points))
    loud = [cell for cell in cells if cell.verdict is CellVerdict.SQUEALS]
    return NoiseMatrix(
        title=plan.title,
        axes={axis.name: [level.label for level in axis.levels] for axis in plan.axes},
        cells=cells,
        squeal=len(loud),
        squeal_after_large_only=sum(cell.disturbance is CellDisturbance.LARGE for cell in loud),
        not_clear=sum(cell.verdict in OPEN for cell in cells),
        data=data,
    )


def _cell(columns: dict[str, np.ndarray], plan: MatrixPlan, number: int, names: Sequence[str]) -> CellFound:
    here = {name: values[number].item() for name, values in columns.items()}
    velocity, disturbance = here["velocity"], DISTURBANCES.get(here["after"])
    along = f", along {names[here['along']]}" if here["along"] >= 0 else ""
    louder = along and f"; the loudest: large{along}"
    return CellFound(
        levels={name: level.label for name, level in plan.levels(number).items()},
        verdict=VERDICTS.get(here["squeal"], CellVerdict.NOT_COMPUTED),
        outcome=OUTCOMES[here["outcome"]],
        unstable=None if here["unstable"] < 0 else bool(here["unstable"]),
        growth_rate_1_per_s=here["growth_rate"],
        frequency_Hz=here["frequency"],
        velocity_m_per_s=velocity,
        level_dB=20 * math.log10(velocity / REFERENCE) if velocity > 0 else math.nan,
        after=disturbance and f"{disturbance}{louder if disturbance is CellDisturbance.SMALL else along}",
        time_s=here["time"],
        speed_rad_per_s=here["speed"],
        small_frequency_Hz=here["small_frequency"],
        small_velocity_m_per_s=here["small_velocity"],
        disturbance=disturbance,
    )
