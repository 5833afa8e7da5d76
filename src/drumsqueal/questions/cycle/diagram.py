"""Branches of cycles along a parameter, and what they say of squeal beside the stability of steady sliding."""

from itertools import pairwise
from typing import Any

from pydantic import computed_field

from drumsqueal.findings.outcome import Ending
from drumsqueal.findings.parameter import Parameter
from drumsqueal.findings.part import Finding, Held
from drumsqueal.findings.schema import Findings
from drumsqueal.questions.cycle.continuation import Branch
from drumsqueal.questions.cycle.orbit import Event
from drumsqueal.solve.linear.branches import Branches, Critical

Interval = tuple[float, float]


class Diagram(Finding):
    """Branches of cycles, and the ranges of the parameter in which steady sliding is stable and in which it is not.

    `notes` says what was looked for and not found; `linear` holds the modes of steady sliding.
    """

    verdict: str | None = None
    steady_sliding_stable: tuple[Interval, ...]
    steady_sliding_unstable: tuple[Interval, ...]
    branches: tuple[Branch, ...]
    notes: tuple[str, ...] = ()
    linear: Any = Held

    @computed_field
    @property
    def stable_cycles(self) -> tuple[Interval, ...]:
        """Ranges with a stable cycle at least."""
        spans = []
        for branch in self.branches:
            for cycles, stable in branch.pieces():
                if stable:
                    values = [cycle.value for cycle in cycles]
                    spans.append((min(values), max(values)))
        return _merged(spans)

    @computed_field
    @property
    def folds(self) -> tuple[float, ...]:
        """Values at the folds, by rising value."""
        special = (cycle for branch in self.branches for cycle in branch.special)
        return tuple(sorted(cycle.value for cycle in special if cycle.what is Event.FOLD))

    @computed_field
    @property
    def squeals_only_when_kicked(self) -> tuple[Interval, ...]:
        """Bistable ranges: steady sliding is stable and a stable cycle is, too."""
        return tuple(
            (max(low, first), min(high, last))
            for low, high in self.steady_sliding_stable
            for first, last in self.stable_cycles
            if min(high, last) > max(low, first)
        )


class Span(Parameter):
    """A parameter from its lowest value to its highest."""

    @computed_field
    @property
    def low(self) -> float:
        """Its lowest value."""
        return min(self.values)

    @computed_field
    @property
    def high(self) -> float:
        """Its highest value."""
        return max(self.values)


class CycleBranches(Findings, Diagram):
    """The cycles of a scene along one of its numbers, and where modes of steady sliding gain or lose stability."""

    outcome: Ending = Ending.COMPLETE
    parameter: Span
    critical_values: tuple[Critical, ...]


def steady_sliding(linear: Branches, low: float, high: float, *, stable: bool) -> tuple[Interval, ...]:
    """Ranges from `low` to `high` in which steady sliding is stable, or in which it is not."""
    ends = [low, *(each.value for each in linear.critical), high]
    spans = []
    for first, last in pairwise(ends):
        middle = (first + last) / 2
        nearest = min(linear.points, key=lambda point: abs(point.value - middle))
        if not nearest.reason and nearest.unstable != stable:
            spans.append((first, last))
    return _merged(spans)


def _merged(spans: list[Interval]) -> tuple[Interval, ...]:
    merged: list[Interval] = []
    for low, high in sorted(spans):
        if merged and low <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(high, merged[-1][1]))
        else:
            merged.append((low, high))
    return tuple(merged)
