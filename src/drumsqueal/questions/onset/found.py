"""What a study of the onset finds, as onset.json holds it."""

import math
from collections.abc import Sequence
from typing import Self

from drumsqueal.findings.outcome import Ending
from drumsqueal.findings.parameter import Parameter
from drumsqueal.findings.part import Finding, Number
from drumsqueal.findings.schema import Findings
from drumsqueal.questions.cycle.diagram import Diagram
from drumsqueal.questions.onset.rows import Range, Row
from drumsqueal.scene.variation import Variation
from drumsqueal.solve.linear.branches import Branch, Critical


class FollowedMode(Finding):
    """A mode over the values at which it oscillates; NaN where there is no steady sliding in between."""

    label: str
    values: tuple[float, ...]
    frequency_Hz: tuple[Number, ...]
    growth_rate_1_per_s: tuple[Number, ...]

    @classmethod
    def of(cls, branch: Branch) -> Self:
        """That of a branch of eigenvalues."""
        values, eigenvalues = branch.values.tolist(), branch.eigenvalues
        frequency = (eigenvalues.imag / math.tau).tolist()
        growth = eigenvalues.real.tolist()
        return cls(label=branch.label, values=values, frequency_Hz=frequency, growth_rate_1_per_s=growth)

    @property
    def name(self) -> str:
        """Its largest coordinate at the first value."""
        return self.label.split()[0]


class Onset(Finding):
    """Modes and critical values along a parameter, a row for each value, and the ranges that follow from them.

    `coordinates` are those of the transients; `kicked_range_sought_within` is the fraction of the range to which ends
    of the bistable range were sought; `smallest_kick_sought` says whether the smallest disturbance was at each bistable
    value. `cycles` is None where they were not followed; verdict and ranges are missing until all transients are run.
    """

    outcome: Ending = Ending.COMPLETE
    verdict: str | None = None
    reservations: tuple[str, ...] = ()
    parameter: Parameter
    critical_values: tuple[Critical, ...]
    ranges: tuple[Range, ...] = ()
    kicked_range_sought_within: float
    smallest_kick_sought: bool = False
    modes: tuple[FollowedMode, ...]
    coordinates: tuple[str, ...]
    values: tuple[Row, ...] = ()
    cycles: Diagram | None = None

    @property
    def variation(self) -> Variation:
        """The number that is varied, as the command line reads it."""
        return self.parameter.variation

    @property
    def in_order(self) -> Sequence[Row]:
        """The rows in the order in which the range was asked for."""
        return self.values if self.variation.first < self.variation.last else self.values[::-1]

    @property
    def coordinate(self) -> str:
        """The coordinate that holds most kinetic energy in most of the motions found: whose amplitude is shown."""
        lines = [motion.line_of for row in self.values for motion in row.motions if motion.line_of is not None]
        shown = [mode.name for mode in self.modes]
        critical = [each.label.split()[0] for each in self.critical_values]
        candidates = [name for name in (*lines, *critical[:1], *shown) if name in self.coordinates]
        return max(candidates, key=lines.count, default=self.coordinates[0])


class OnsetStudy(Onset, Findings):
    """The same for a scene."""
