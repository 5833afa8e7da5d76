"""Cycles along a parameter as a table on the terminal, as CSV, as plain data, and in one sentence."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.findings.departure import unit_of
from drumsqueal.findings.history import versions
from drumsqueal.questions.cycle.branches import Diagram
from drumsqueal.questions.cycle.continuation import BOUND, HOPF, Branch
from drumsqueal.questions.cycle.kicked import Interval, folds, kicked, stable_cycles, steady_sliding
from drumsqueal.questions.cycle.orbit import NEUTRAL, Cycle
from drumsqueal.questions.cycle.table import cycle_data
from drumsqueal.scene.variation import Variation
from drumsqueal.terminal.tables import print_table, rows_to_csv


def print_diagram(console: Console, diagram: Diagram, variation: Variation) -> None:
    """Print where branches begin and end and what happens on them, and what follows from that."""
    unit = f"\n{variation.shown_unit}" if variation.shown_unit else ""
    names = diagram.branches[0].cycles[0].names
    table = Table(title=f"Cycles along {variation.key}", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("", justify="right")
    table.add_column("")
    table.add_column(f"value{unit}", justify="right")
    table.add_column("freq.\nHz", justify="right")
    for name in names:
        table.add_column(f"{name}\n{unit_of(name, 'µ')}", justify="right")
    table.add_column("largest\n|μ|", justify="right")
    for number, branch in enumerate(diagram.branches, start=1):
        for what, cycle in _milestones(branch):
            amplitudes = (f"{1e6 * cycle.amplitude[name]:.3g}" for name in names)
            value = f"{variation.shown(cycle.parameter):.7g}"
            table.add_row(str(number), what, value, f"{cycle.frequency_Hz:.1f}", *amplitudes, f"{cycle.largest:.4f}")
    print_table(console, table)
    for critical in diagram.linear.critical:
        becomes = "unstable" if critical.destabilises else "stable"
        where = _at(variation, critical.value)
        console.print(f"Steady sliding becomes {becomes} in {critical.label} as it rises past {where}")
    for number, branch in enumerate(diagram.branches, start=1):
        for verb, end in (("begins", branch.start), ("ends", branch.end)):
            if len(end) > len(BOUND):
                console.print(f"Branch {number} ends: {end}", style="dim")
            elif end == HOPF:
                console.print(f"Branch {number} {verb} beside a Hopf point, where cycles have no size", style="dim")
    for note in diagram.notes:
        console.print(f"Not found: {note}", style="dim")
    console.print(verdict(diagram, variation), style="bold")


def _milestones(branch: Branch) -> list[tuple[str, Cycle]]:
    """The ends of a branch and what happens on it, in order."""
    what = {id(special.cycle): special.kind for special in branch.special}
    ends = {id(branch.cycles[0]): _end(branch.start, "first"), id(branch.cycles[-1]): _end(branch.end, "last")}
    return [
        (what.get(id(cycle)) or ends[id(cycle)], cycle)
        for cycle in branch.cycles
        if id(cycle) in what or id(cycle) in ends
    ]


def _end(reason: str, which: str) -> str:
    """What an end is; at a Hopf point it is the cycle beside it, which has a size."""
    if reason == HOPF:
        return f"{which} cycle"
    return reason if len(reason) <= len(BOUND) else "end"


def _at(variation: Variation, value: float) -> str:
    return f"{variation.key} = {variation.told(value, '.7g')}"


def verdict(diagram: Diagram, variation: Variation) -> str:
    """Where steady sliding is unstable, where stable cycles are, and where both are stable."""
    unstable, cycles, both = steady_sliding(diagram, stable=False), stable_cycles(diagram), kicked(diagram)
    sliding = f"is unstable for {variation.key} {_ranges(unstable, variation)}" if unstable else "is stable throughout"
    lives = f"stable cycles exist {_ranges(cycles, variation)}" if cycles else "no cycle that was found is stable"
    turns = folds(diagram)
    where = ", ".join(f"{variation.shown(value):.6g}" for value in turns)
    folded = f" (folds at {where}{_unit(variation)})" if turns else ""
    bistable = (
        f"; {_ranges(both, variation)} it squeals only after a large disturbance (bistable)"
        if both
        else "; none of them lies beside stable sliding"
    )
    return f"Steady sliding {sliding}; {lives}{folded}{bistable}."


def _ranges(intervals: list[Interval], along: Variation) -> str:
    ranges = (f"from {along.shown(low):.6g} to {along.shown(high):.6g}" for low, high in intervals)
    return f"{' and '.join(ranges)}{_unit(along)}"


def _unit(along: Variation) -> str:
    return f" {along.shown_unit}" if along.shown_unit else ""


def to_csv(variation: Variation, rows: Iterable[tuple[int, Cycle]] | None, diagram: Diagram | None = None) -> str:
    """One row a cycle, in the order of its branch; what happens there is told once the branches are whole."""
    what: dict[int, str] = {}
    if diagram is not None:
        rows = [(number, cycle) for number, branch in enumerate(diagram.branches) for cycle in branch.cycles]
        what = {id(special.cycle): special.kind for branch in diagram.branches for special in branch.special}
    return rows_to_csv([_row(variation, number, cycle, what.get(id(cycle), "")) for number, cycle in rows or ()])


def _row(variation: Variation, number: int, cycle: Cycle, what: str) -> dict[str, Any]:
    row: dict[str, Any] = {
        "branch": number + 1,
        variation.column: variation.listed(cycle.parameter),
        "what": what,
        "frequency_Hz": cycle.frequency_Hz,
        "stable": "neutral" if cycle.neutral else "yes" if cycle.stable else "no",
        "unstable_directions": int(np.sum(np.abs(cycle.multipliers) > 1 + NEUTRAL)),  # one on the circle is none
    }
    row |= {f"amplitude_{name}_{unit_of(name)}": a for name, a in cycle.amplitude.items()}
    row |= {"contact_fraction": cycle.contact_fraction, "slip_reversed_fraction": cycle.slip_reversed_fraction}
    for k, value in enumerate(cycle.multipliers.tolist(), start=1):
        row |= {f"multiplier_{k}_re": value.real, f"multiplier_{k}_im": value.imag}
    errors = {"unit_multiplier_error": cycle.unit_error, "tangent_error": cycle.tangent_error}
    return row | {"residual": cycle.residual, **errors}


def diagram_data(diagram: Diagram, variation: Variation) -> dict[str, Any]:
    """Hopf points, branches with all their cycles, and the ranges that follow from them, in SI."""
    assert diagram.scene is not None
    return {
        "title": diagram.scene.title,
        "parameter": {"key": variation.key, "unit": variation.unit, "low": diagram.low, "high": diagram.high},
        "critical_values": [each._asdict() for each in diagram.linear.critical],
        **cycles_data(diagram, variation),
        "scene": diagram.scene.model_dump(mode="json"),
        "versions": versions(),
    }


def cycles_data(diagram: Diagram, variation: Variation) -> dict[str, Any]:
    """What the cycles themselves say, in SI."""
    return {
        "verdict": verdict(diagram, variation),
        "steady_sliding_unstable": steady_sliding(diagram, stable=False),
        "stable_cycles": stable_cycles(diagram),
        "folds": folds(diagram),
        "squeals_only_when_kicked": kicked(diagram),
        "branches": [_branch(branch) for branch in diagram.branches],
        "notes": list(diagram.notes),
    }


def _branch(branch: Branch) -> dict[str, Any]:
    return {
        "start": branch.start,
        "end": branch.end,
        "special": [{"what": each.kind, "value": each.parameter, **cycle_data(each.cycle)} for each in branch.special],
        "cycles": [{"value": cycle.parameter, **cycle_data(cycle)} for cycle in branch.cycles],
    }
