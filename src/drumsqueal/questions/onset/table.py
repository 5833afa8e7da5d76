"""A study of the onset as a table on the terminal, as CSV and as plain data."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from drumsqueal.findings.departure import unit_of
from drumsqueal.findings.history import COMPLETE, versions
from drumsqueal.questions.cycle.branch_table import cycles_data
from drumsqueal.questions.cycle.branch_table import verdict as cycles_verdict
from drumsqueal.questions.cycle.branches import Diagram
from drumsqueal.questions.onset.attractors import Ending
from drumsqueal.questions.onset.rows import KICKED, SQUEALS, Kick, Row
from drumsqueal.questions.onset.study import OnsetStudy, Prediction
from drumsqueal.questions.onset.verdict import reservations, verdict, with_uncertainty
from drumsqueal.scene import Scene
from drumsqueal.scene.variation import Variation
from drumsqueal.solve.linear.branches import Branches, Critical
from drumsqueal.terminal.tables import print_table, rows_to_csv

CUT_OFF = "cut off"  # the outcome of a study until it is complete
STYLES = {SQUEALS: "bold red", KICKED: "bold"}


def print_study(console: Console, study: OnsetStudy, diagram: Diagram | None = None) -> None:
    """Print a row for each value that was asked for, critical values, what follows, and what the cycles say of it."""
    name, unit = study.coordinate, unit_of(study.coordinate, "µ")
    title = f"Onset along {study.variation.key}"
    table = Table(title=title, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column(f"\n\n{study.variation.shown_unit}", justify="right")
    table.add_column("")
    table.add_column("growth\nlinear\n1/s", justify="right")
    for heading in (f"{name} after\nsmall start", f"{name} of the\nstrongest"):
        table.add_column(f"{heading}\n{unit}", justify="right")
        table.add_column("line\n\nHz", justify="right")
    for row in in_order(study.rows, study.variation):
        if row.asked:
            kind = Text(row.kind, style=STYLES.get(row.kind, ""))
            small, strongest = _shown(row.small, study), _shown(row.strongest, study, strongest=True)
            rate = row.point.growth_rate
            growth = f"{rate:+.2f}" if np.isfinite(rate) else "-"  # nothing oscillates
            table.add_row(f"{study.variation.shown(row.value):.5g}", kind, growth, *small, *strongest)
    print_table(console, table)
    if any(row.kick for row in study.rows):
        print_table(console, _kick_table(study))
    for critical in study.linear.critical:
        console.print(_told(critical, study.variation))
    for line in reservations(study):
        console.print(line, style="dim")
    console.print(verdict(study), style="bold")
    if diagram is not None:
        for note in diagram.notes:
            console.print(f"Not found: {note}", style="dim")
        told = cycles_verdict(diagram, study.variation) if diagram.branches else "none was found."
        console.print(f"Cycles: {told[0].lower()}{told[1:]}", style="bold")


def _kick_table(study: OnsetStudy) -> Table:
    """How hard it must be kicked, and along which mode, at each value where it was found."""
    column = study.names.index(study.coordinate)
    table = Table(title="Smallest kick that starts squeal", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column(f"\n\n{study.variation.shown_unit}", justify="right")
    table.add_column("along\nmode\n")
    table.add_column("velocity of\nthe lining\nm/s", justify="right")
    table.add_column("energy\n\nJ", justify="right")
    table.add_column("times\nthe nearer\nedge", justify="right")
    table.add_column(f"leads to\n{study.coordinate}\n{unit_of(study.coordinate, 'µ')}", justify="right")
    table.add_column("line\n\nHz", justify="right")
    for row in in_order(study.rows, study.variation):
        if row.kick is not None:
            kick, motion = row.kick, row.kick.ending.motion
            table.add_row(
                f"{study.variation.shown(row.value):.5g}",
                kick.mode,
                with_uncertainty(kick.speed, kick.speed_uncertainty),
                with_uncertainty(kick.energy, kick.energy_uncertainty),
                f"{kick.edge_share:.3g}",
                f"{1e6 * motion.amplitude[column]:.4g}",
                "" if motion.frequency_Hz is None else f"{motion.frequency_Hz:.1f}",
            )
    return table


def _shown(ending: Ending | None, study: OnsetStudy, *, strongest: bool = False) -> tuple[str, str]:
    """Amplitude and line of a motion that has settled, or where the start led instead."""
    if ending is None:
        return ("-", "") if strongest else ("", "")
    if not ending.settled:
        return ending.kind, ""
    amplitude = 1e6 * ending.motion.amplitude[study.names.index(study.coordinate)]
    line = ending.motion.frequency_Hz
    return f"{amplitude:.4g}", "" if line is None else f"{line:.1f}"


def _told(critical: Critical, variation: Variation) -> str:
    unit = f" {variation.shown_unit}" if variation.shown_unit else ""
    becomes = "loses stability" if critical.destabilises else "gains stability"
    value, uncertainty = variation.shown(critical.value), variation.shown(critical.uncertainty)
    where = f"{variation.key} = {with_uncertainty(value, uncertainty)}{unit}"
    line = f" at {critical.frequency_Hz:.2f} Hz" if critical.frequency_Hz > 0 else ""
    return f"{critical.label} {becomes}{line} as the value rises past {where}"


def in_order(rows: Sequence[Row], variation: Variation) -> Sequence[Row]:
    """Rows by rising value in the order in which the range was asked for."""
    return rows if variation.first < variation.last else rows[::-1]


def to_csv(rows: Sequence[Row], variation: Variation, linear: Branches, names: tuple[str, ...]) -> str:
    """One row a value: its kind, the modes, where the small departure led, and the largest motion that was found."""
    at = {
        branch.label: {v: e for v, e in zip(branch.values.tolist(), branch.eigenvalues, strict=True) if np.isfinite(e)}
        for branch in linear.branches
    }
    table = []
    sought = any(row.kick for row in rows)
    for row in in_order(rows, variation):
        cells: dict[str, Any] = {
            variation.column: variation.listed(row.value),
            "kind": row.kind,
            "asked": "yes" if row.asked else "no",
            "largest_growth_rate_1_per_s": row.point.growth_rate if np.isfinite(row.point.growth_rate) else None,
        }
        for label, values in at.items():
            value = values.get(row.value)
            cells[f"frequency_{label}_Hz"] = None if value is None else value.imag / math.tau
            cells[f"growth_rate_{label}_1_per_s"] = None if value is None else value.real
        cells |= _cells("small", row.small, names) | _cells("strongest", row.strongest, names)
        cells["motions"] = len(row.attractors)
        cells |= _kick_cells(row.kick) if sought else {}
        cells["note"] = row.point.reason or "; ".join(
            f"{each.start}: {each.motion.outcome}" for each in row.endings if each.motion.failed
        )
        table.append(cells)
    return rows_to_csv(table)


def _cells(which: str, ending: Ending | None, names: tuple[str, ...]) -> dict[str, Any]:
    cells: dict[str, Any] = {f"{which}_start": "" if ending is None else ending.start}
    cells[f"{which}_start_leads_to"] = "" if ending is None else ending.kind
    settled = ending if ending is not None and ending.settled else None
    for k, name in enumerate(names):
        cells[f"{which}_amplitude_{name}_{unit_of(name)}"] = None if settled is None else settled.motion.amplitude[k]
    cells[f"{which}_frequency_Hz"] = None if settled is None else settled.motion.frequency_Hz
    cells[f"{which}_simulated_s"] = None if ending is None else ending.seconds
    return cells


def _kick_cells(kick: Kick | None) -> dict[str, Any]:
    numbers = {
        "speed_m_per_s": "speed",
        "speed_uncertainty_m_per_s": "speed_uncertainty",
        "energy_J": "energy",
        "energy_uncertainty_J": "energy_uncertainty",
        "edge_share": "edge_share",
    }
    cells: dict[str, Any] = {"smallest_kick_mode": "" if kick is None else kick.mode}
    return cells | {f"smallest_kick_{k}": None if kick is None else getattr(kick, v) for k, v in numbers.items()}


def to_data(study: OnsetStudy, diagram: Diagram | None = None) -> dict[str, Any]:
    """Critical values, ranges, all modes and all motions, in SI; None for cycles that were not followed."""
    return _predicted(study.scene, study.variation, study.linear, study.names, study.within, study.smallest_kick) | {
        "outcome": COMPLETE,
        "verdict": verdict(study),
        "reservations": list(reservations(study)),
        "ranges": [each._asdict() for each in study.ranges],
        "values": [_value(row, study.names) for row in study.rows],
        "cycles": None if diagram is None else cycles_data(diagram, study.variation),
    }


def predicted_to_data(predicted: Prediction, within: float, smallest_kick: bool) -> dict[str, Any]:
    """The same of a study before its transients: what is asked, the modes and their critical values."""
    return _predicted(
        predicted.scene, predicted.variation, predicted.linear, predicted.family.moving, within, smallest_kick
    )


def _predicted(
    scene: Scene, variation: Variation, linear: Branches, names: tuple[str, ...], within: float, smallest_kick: bool
) -> dict[str, Any]:
    return {
        "title": scene.title,
        "outcome": CUT_OFF,
        "verdict": None,
        "reservations": [],
        "parameter": {
            "key": variation.key,
            "unit": variation.unit,
            "values": variation.values,
            "given_unit": variation.given,
            "given_unit_in_SI": variation.size,
        },
        "critical_values": [each._asdict() for each in linear.critical],
        "ranges": [],
        "kicked_range_sought_within": within,
        "smallest_kick_sought": smallest_kick,
        "modes": [
            {
                "label": branch.label,
                "values": branch.values.tolist(),
                "frequency_Hz": (branch.eigenvalues.imag / math.tau).tolist(),
                "growth_rate_1_per_s": branch.eigenvalues.real.tolist(),
            }
            for branch in linear.branches
        ],
        "coordinates": list(names),
        "values": [],
        "cycles": None,
        "scene": scene.model_dump(mode="json"),
        "versions": versions(),
    }


def _value(row: Row, names: tuple[str, ...]) -> dict[str, Any]:
    return {
        "value": row.value,
        "kind": row.kind,
        "asked": row.asked,
        "no_steady_sliding": row.point.reason or None,
        "starts": [
            {"start": each.start, "leads_to": each.kind, "simulated_s": each.seconds, "outcome": each.motion.outcome}
            for each in row.endings
        ],
        "motions": [_motion(each, names) for each in row.attractors],
        "smallest_kick": None if row.kick is None else _kick(row.kick, names),
    }


def _kick(kick: Kick, names: tuple[str, ...]) -> dict[str, Any]:
    return {
        "mode": kick.mode,
        "velocity": dict(zip(names, kick.velocity.tolist(), strict=True)),
        "speed_m_per_s": kick.speed,
        "speed_uncertainty_m_per_s": kick.speed_uncertainty,
        "energy_J": kick.energy,
        "energy_uncertainty_J": kick.energy_uncertainty,
        "edge_share": kick.edge_share,
        "leads_to": _motion(kick.ending, names),
    }


def _motion(ending: Ending, names: tuple[str, ...]) -> dict[str, Any]:
    motion = ending.motion
    return {
        "start": ending.start,
        "amplitude": dict(zip(names, motion.amplitude.tolist(), strict=True)),
        "rms": dict(zip(names, motion.rms.tolist(), strict=True)),
        "frequency_Hz": motion.frequency_Hz,
        "line_of": motion.line,
        "kinetic_energy_J": motion.kinetic_energy,
        "share_of_contact_loss": motion.edge_shares[0],
        "share_of_slip_reversal": motion.edge_shares[1],
        "drift": motion.drift,
    }
