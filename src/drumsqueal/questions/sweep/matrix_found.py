"""What a noise matrix has found: which cells squeal, at what frequency, how loud, and after what disturbance."""

import math
import os
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
import xarray
from pydantic import Field

from drumsqueal.findings.columns import Column
from drumsqueal.findings.history import versions
from drumsqueal.findings.schema import Finding, Held, Number
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.sweep.file import in_memory
from drumsqueal.questions.sweep.matrix_plan import PROCEDURE, SCENE, MatrixPlan, read_matrix
from drumsqueal.questions.sweep.points import CELL_VERDICTS, OUTCOMES, CellVerdict, names_in

REFERENCE = 1e-9  # m/s, of velocity levels by ISO 1683


class CellDisturbance(StrEnum):
    """The smallest disturbance after which a cell squeals, in the order of the numbers in matrix.nc."""

    SMALL = "small"
    LARGE = "large"


OPEN = (CellVerdict.NOT_CLEAR, CellVerdict.UNDECIDED)


class CellFound(Finding):
    """A cell by its labels: whether it squeals, by transients and by eigenvalues, and its squeal.

    That is the loudest that was found; of a procedure the one after a small disturbance, if there is one.
    `small_frequency_Hz` and `small_velocity_m_per_s` are those of the squeal after a small disturbance, where there is
    one. `velocity_m_per_s` is the rms velocity of the shoe over its mass and over time, `level_dB` that over 1 nm/s
    (ISO 1683); of a procedure it is that of its loudest 50 ms, in the middle of which are `time_s` and
    `speed_rad_per_s`.
    `disturbance` is the smallest after which the cell squeals, `after` says of a large one that leads to the loudest
    also along which mode it was.
    """

    levels: dict[str, str]
    verdict: CellVerdict
    outcome: str
    unstable: bool | None
    growth_rate_1_per_s: Number
    frequency_Hz: Annotated[Number, Column("frequency", ".4g")]
    velocity_m_per_s: Number
    level_dB: Annotated[Number, Column("level", ".1f")]
    after: Annotated[str | None, Column("after a\ndisturbance", missing="")]
    time_s: Annotated[Number, Column("loudest\nat", ".3g", missing="", optional=True)]
    speed_rad_per_s: Annotated[Number, Column("drum\nspeed", ".3g", missing="", optional=True)]
    small_frequency_Hz: Number
    small_velocity_m_per_s: Number
    disturbance: CellDisturbance | None = None
    columns: ClassVar = "frequency_Hz", "level_dB", "time_s", "speed_rad_per_s", "after"


class NoiseMatrix(Finding):
    """Every cell, how many squeal after a small disturbance and after a large one only, and how many are not clear.

    Cells that were not computed are counted in none of these.
    """

    printed_by = "drumsqueal.questions.sweep.matrix_answer.print_matrix"
    title: str
    axes: dict[str, list[str]]
    cells: tuple[CellFound, ...]
    squeal: int
    squeal_after_large_only: int
    not_clear: int
    versions: dict[str, str] = Field(default_factory=versions)
    data: Any = Held

    def __repr__(self) -> str:
        """One line."""
        return f"NoiseMatrix: {self.headline}"

    @property
    def headline(self) -> str:
        """How many cells squeal, are quiet, are not clear, and were not computed."""
        large = f", {self.squeal_after_large_only} of them after a large disturbance only" * bool(self.squeal)
        verdicts = [cell.verdict for cell in self.cells]
        unclear, missing = sum(each in OPEN for each in verdicts), verdicts.count(CellVerdict.NOT_COMPUTED)
        others = f", {unclear} not clear" * bool(unclear) + f", {missing} not computed" * bool(missing)
        quiet = verdicts.count(CellVerdict.QUIET)
        are = "is" if quiet == 1 else "are"
        return f"{self.squeal} of {len(self.cells)} cells squeal{large}; {quiet} {are} quiet{others}"


def shown_axes(found: NoiseMatrix) -> tuple[str, list[str]]:
    """The axis of the columns, the first that has several levels, and those of the rows that have."""
    several = [name for name, labels in found.axes.items() if len(labels) > 1]
    columns = next((name for name in several if name not in (SCENE, PROCEDURE)), several[0] if several else SCENE)
    return columns, [name for name in several if name != columns]


def in_rows(found: NoiseMatrix) -> tuple[list[str], list[tuple[str, list[CellFound]]]]:
    """The labels of the columns, and of each row its label and cells."""
    across, down = shown_axes(found)
    rows: dict[str, list[CellFound]] = {}
    for cell in found.cells:
        rows.setdefault(", ".join(cell.levels[name] for name in down), []).append(cell)
    return found.axes[across], list(rows.items())


def shown_levels(found: NoiseMatrix, cell: CellFound) -> dict[str, str]:
    """The labels of a cell on the axes that have several levels."""
    across, down = shown_axes(found)
    return {name: cell.levels[name] for name in (*down, across) if len(found.axes[name]) > 1}


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
    velocity, disturbance = here["velocity"], tuple(CellDisturbance)[here["after"]] if here["after"] >= 0 else None
    along = f", along {names[here['along']]}" if here["along"] >= 0 else ""
    louder = along and f"; the loudest: large{along}"
    return CellFound(
        levels={name: level.label for name, level in plan.levels(number).items()},
        verdict=CELL_VERDICTS[here["squeal"]],
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
