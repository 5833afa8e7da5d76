"""What the search for a cycle, and cycles along a parameter, write and print."""

from typing import Any

import numpy as np
from rich.console import Console

from drumsqueal.coordinates import MOST_SHOWN, column_unit, largest_of
from drumsqueal.dynamics.cycles.cycle import NEUTRAL, BranchEnd, Cycle, CycleBranch
from drumsqueal.errors import COMPLETE
from drumsqueal.findings.columns import Column
from drumsqueal.findings.history import to_dataset
from drumsqueal.physics.model import at_lining
from drumsqueal.questions.cycle.figures import draw_branch, draw_cycle
from drumsqueal.questions.cycle.study import CycleBranches, CycleStudy
from drumsqueal.questions.cycle.words import describe_briefly, end_words, missing_words
from drumsqueal.terminal.reply import Answer
from drumsqueal.terminal.tables import print_cells, rows_to_csv


def print_cycle(console: Console, found: CycleStudy) -> None:
    """Print amplitudes, multipliers, how accurate they are, the other cycles, and the verdict."""
    shown = {name: at_lining(found.model, name) for name in found.amplitude}
    amplitudes = ((shown[name][2], f"{shown[name][0] * q:.6g} {shown[name][1]}") for name, q in found.amplitude.items())
    print_cells(console, "Limit cycle", (Column("coordinate"), Column("half peak\nto peak", ">")), amplitudes)
    multipliers = (
        (abs(value), f"{'±' if value.imag else ''}{np.degrees(np.angle(value)):.2f}")
        for value in found.multipliers
        if value.imag >= 0
    )
    columns = Column("modulus", ".6f"), Column("angle\ndegrees", ">")
    print_cells(console, "Floquet multipliers", columns, multipliers)
    trivial = f"error of the trivial Floquet multiplier {found.unit_multiplier_error:.1e}"
    console.print(f"Periodicity residual {found.residual:.1e} of the motion; {trivial}", style="dim")
    console.print(f"Start of the search: {found.found_from}. The transient {found.transient}.", style="dim")
    for other in found.others:
        console.print(f"Another cycle: {describe_briefly(other)}, from {other.found_from}.", style="dim")
    console.print(found.verdict, style="bold")


def period_file(found: CycleStudy) -> bytes:
    """One period of samples, with the signals of a history, as NetCDF."""
    period = to_dataset([found.samples], found.scene, found.names, COMPLETE)
    period.attrs |= {"period_s": found.period_s, "stable": "yes" if found.stable else "no"}
    return bytes(period.to_netcdf(engine="h5netcdf"))


def print_branches(console: Console, found: CycleBranches) -> None:
    """Print where branches begin and end and what happens on them, and what follows from that."""
    variation = found.parameter.variation
    names, others = _columns(found)
    shown = {name: at_lining(found.scene, name) for name in names}  # of free modes how far the lining moves
    columns = (
        *(Column("", "d"), Column(), Column("value", ".7g", unit=variation.shown_unit)),
        Column("freq.", ".1f", unit="Hz"),
        *(Column(name, ".3g", unit=unit, factor=factor) for name, (factor, unit, _) in shown.items()),
        Column("largest\n|μ|", ".4f"),
    )
    rows = (
        (
            *(number, what, variation.shown(cycle.value), cycle.frequency_Hz),
            *(cycle.amplitude[name] for name in names),
            cycle.largest,
        )
        for number, branch in enumerate(found.branches, start=1)
        for what, cycle in milestones(branch)
    )
    print_cells(console, f"Limit cycles along {variation.key}", columns, rows)
    if others:
        console.print(f"Without the {len(others)} coordinates that move less; branch.csv has them all", style="dim")
    for critical in found.critical_values:
        becomes = "unstable" if critical.destabilises else "stable"
        where = f"{variation.key} = {variation.with_unit(critical.value, '.7g')}"
        console.print(f"Steady sliding becomes {becomes} in {critical.label} as the value rises past {where}")
    for number, branch in enumerate(found.branches, start=1):
        for words in end_words(branch):
            console.print(f"Branch {number} {words}", style="dim")
    for words in missing_words(found):
        console.print(words, style="dim")
    console.print(found.verdict, style="bold")


def _columns(found: CycleBranches) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The coordinates that the table has columns for, those that move the lining most, and the others."""
    cycles = [cycle for branch in found.branches for cycle in branch.cycles]
    names = cycles[0].names
    if len(names) <= MOST_SHOWN:
        return names, ()
    reach = {name: cycles[0].model.shoe.lever(name) for name in names}
    return largest_of({name: max(reach[name] * cycle.amplitude[name] for cycle in cycles) for name in names})


def milestones(branch: CycleBranch) -> list[tuple[str, Cycle]]:
    """The ends of a branch and what happens on it, in order; at a Hopf point the end is the cycle next to it."""
    ends = {}
    for place, reason, which in ((len(branch.cycles) - 1, branch.end, "last"), (0, branch.start, "first")):
        ends[place] = f"{which} cycle" if reason is BranchEnd.HOPF else "end" if reason is BranchEnd.LOST else reason
    found = [(cycle.what or ends.get(k), cycle) for k, cycle in enumerate(branch.cycles)]
    return [(what, cycle) for what, cycle in found if what is not None]


def branches_table(found: CycleBranches) -> str:
    """One row a cycle, in the order of its branch, as CSV."""
    variation, rows = found.parameter.variation, []
    for number, branch in enumerate(found.branches, start=1):
        for cycle in branch.cycles:
            row: dict[str, Any] = {
                "branch": number,
                variation.column: variation.listed(cycle.value),
                "what": cycle.what or "",
                "frequency_Hz": cycle.frequency_Hz,
                "stable": "neutral" if cycle.neutral else "yes" if cycle.stable else "no",
                # one on the circle is none
                "unstable_directions": int(np.sum(np.abs(cycle.multipliers) > 1 + NEUTRAL)),
            }
            row |= {f"amplitude_{name}_{column_unit(name)}": size for name, size in cycle.amplitude.items()}
            row |= {
                name: getattr(cycle, name)
                for name in ("contact_fraction", "slip_reversed_fraction", "sticking_fraction")
            }
            for k, value in enumerate(cycle.multipliers.tolist(), start=1):
                row |= {f"multiplier_{k}_re": value.real, f"multiplier_{k}_im": value.imag}
            row |= {name: getattr(cycle, name) for name in ("residual", "unit_multiplier_error", "tangent_error")}
            rows.append(row)
    return rows_to_csv(rows)


CYCLES = Answer(
    words=print_cycle, summary="cycle.json", tables={"cycle.nc": period_file}, figures={"cycle": draw_cycle}
)
BRANCHES = Answer(
    words=print_branches, summary="branch.json", tables={"branch.csv": branches_table}, figures={"branch": draw_branch}
)
