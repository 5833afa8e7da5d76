"""What a diagram of cycles says of squeal: where steady sliding is stable, where cycles are, and where both are."""

from itertools import pairwise

from drumsqueal.questions.cycle.branches import Diagram
from drumsqueal.questions.cycle.continuation import FOLD, Branch
from drumsqueal.questions.cycle.orbit import Cycle

Interval = tuple[float, float]


def pieces(branch: Branch) -> list[tuple[list[Cycle], bool]]:
    """The branch in pieces that are stable or not, in order; neighbours share the cycle at which it changes."""
    marginal = {id(special.cycle) for special in branch.special}
    found: list[tuple[list[Cycle], bool]] = []
    for a, b in pairwise(branch.cycles):
        # Of two corners in a row both count: that nothing is known is no reason to call it stable.
        told = [cycle for cycle in (a, b) if id(cycle) not in marginal] or [a, b]
        stable = all(cycle.stable for cycle in told)
        if found and found[-1][1] == stable:
            found[-1][0].append(b)
        else:
            found.append(([a, b], stable))
    return found


def stable_cycles(diagram: Diagram) -> list[Interval]:
    """Ranges of the parameter with a stable cycle at least."""
    spans = []
    for branch in diagram.branches:
        for cycles, stable in pieces(branch):
            if stable:
                values = [cycle.parameter for cycle in cycles]
                spans.append((min(values), max(values)))
    return _merged(spans)


def steady_sliding(diagram: Diagram, *, stable: bool) -> list[Interval]:
    """Ranges of the parameter in which steady sliding is stable, or in which it is not."""
    ends = [diagram.low, *(each.value for each in diagram.linear.critical), diagram.high]
    spans = []
    for low, high in pairwise(ends):
        middle = (low + high) / 2
        nearest = min(diagram.linear.points, key=lambda point: abs(point.value - middle))
        if not nearest.reason and nearest.unstable != stable:
            spans.append((low, high))
    return _merged(spans)


def kicked(diagram: Diagram) -> list[Interval]:
    """Ranges in which steady sliding is stable and a stable cycle is, too: there it squeals when it is kicked."""
    found = []
    for low, high in steady_sliding(diagram, stable=True):
        for first, last in stable_cycles(diagram):
            if min(high, last) > max(low, first):
                found.append((max(low, first), min(high, last)))
    return found


def folds(diagram: Diagram) -> list[float]:
    """Values of the parameter at the folds, by rising value."""
    return sorted(
        special.parameter for branch in diagram.branches for special in branch.special if special.kind == FOLD
    )


def _merged(spans: list[Interval]) -> list[Interval]:
    merged: list[Interval] = []
    for low, high in sorted(spans):
        if merged and low <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(high, merged[-1][1]))
        else:
            merged.append((low, high))
    return merged
