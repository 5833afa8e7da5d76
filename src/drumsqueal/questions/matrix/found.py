"""What a noise matrix has found: which cells squeal, at what frequency, how loud, and after what disturbance."""

from enum import StrEnum
from typing import Annotated, Any, ClassVar

from pydantic import Field

from drumsqueal.findings.columns import Column
from drumsqueal.findings.history import versions
from drumsqueal.findings.part import Finding, Held, Number
from drumsqueal.questions.sweep.matrix_plan import PROCEDURE, SCENE


class CellVerdict(StrEnum):
    """What is known of a cell."""

    QUIET = "quiet"
    SQUEALS = "squeals"
    NOT_CLEAR = "not clear"
    UNDECIDED = "undecided at its end"
    NOT_COMPUTED = "not computed"


class CellDisturbance(StrEnum):
    """The smallest disturbance after which a cell squeals."""

    SMALL = "small"
    LARGE = "large"


CLEAR = (CellVerdict.QUIET, CellVerdict.SQUEALS)
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

    printed_by = "drumsqueal.questions.matrix.answer.print_matrix"
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
