"""What a study of the onset writes and prints."""

import math
from collections.abc import Iterator
from typing import Any

from rich.console import Console
from rich.text import Text

from drumsqueal.coordinates import column_unit
from drumsqueal.dynamics.attractor import Attractor, Response, SteadyResponse
from drumsqueal.dynamics.cycles.cycle import RangeKind
from drumsqueal.findings.columns import Column
from drumsqueal.findings.kinds import Kind
from drumsqueal.questions.cycle.words import missing_words
from drumsqueal.questions.onset.figure import draw_onset
from drumsqueal.questions.onset.found import Onset, OnsetStudy, Row
from drumsqueal.questions.onset.words import critical_words, shown_line, shown_size, start_words, with_uncertainty
from drumsqueal.terminal.reply import Answer
from drumsqueal.terminal.tables import print_cells, rows_to_csv

DISTURBANCE = ("mode", "speed_m_per_s", "speed_uncertainty_m_per_s", "energy_J", "energy_uncertainty_J", "edge_share")
STYLES = {RangeKind.SQUEALS: "bold red", RangeKind.BISTABLE: "bold"}


def print_study(console: Console, study: OnsetStudy) -> None:
    """Print a row for each value that was asked for, critical values, what follows, and what the cycles say of it."""
    along, rows = study.variation, []
    for row in study.in_order:
        if row.asked or row.small is not None:
            kind = Text(row.kind, style=STYLES.get(row.kind, ""))
            growth = "-" if row.growth_rate is None else row.growth_rate
            first, *others = _outcomes(row, study) or [("", "-", "")]
            rows += [(along.shown(row.value), kind, growth, *first), *(("", "", "", *other) for other in others)]
    value = Column("{unit}", ".5g", unit=along.shown_unit, missing="")
    growth = Column("growth\nrate", "+.2f", unit="1/s", missing="")
    leads = Column(f"what leads there\n(velocity of\n{study.rubbing})", missing="")
    columns = value, Column(missing=""), growth, leads, *_columns(study, study.coordinate)
    print_cells(console, f"Onset along {along.key}", columns, rows)
    if any(row.smallest_kicks for row in study.values):
        columns = (
            *(value, Column("along\nmode"), Column(f"velocity of\n{study.rubbing}", ">", unit="m/s")),
            *(Column("energy", ">", unit="J"), Column("times the\nnearer contact\nboundary", ".3g")),
            *_columns(study, f"leads to\n{study.coordinate}"),
        )
        print_cells(console, "Smallest disturbance that starts squeal", columns, _disturbances(study))
    for critical in study.critical_values:
        console.print(critical_words(critical, along))
    for line in study.reservations:
        console.print(line, style="dim")
    console.print(study.verdict, style="bold")
    if study.cycles is not None:
        for words in missing_words(study.cycles):
            console.print(words, style="dim")
        console.print(study.cycles.verdict, style="bold")


def _outcomes(row: Row, study: OnsetStudy) -> list[tuple[Any, ...]]:
    """Where the small perturbation led, and every motion with what leads to it, its amplitude and its line."""
    motions = [(start_words(each, study.variation), *_cells_of(each, study)) for each in row.led_to]
    if row.small is None or row.small.motion is not None:
        return motions
    return [("a small perturbation", str(row.small.leads_to), ""), *motions]


def _columns(study: Onset, label: str) -> tuple[Column, Column]:
    """Those of the amplitude and the line of a motion."""
    amplitudes = [each.amplitude[study.coordinate] for row in study.values for each in row.motions]
    factor, unit, _ = shown_size(study, amplitudes)
    return Column(label, ".4g", unit=unit, factor=factor), Column("line", ">", unit="Hz", missing="")


def _cells_of(motion: SteadyResponse, study: Onset) -> tuple[float, str]:
    line = "" if motion.frequency_Hz is None else shown_line(motion.frequency_Hz)
    return motion.amplitude[study.coordinate], line


def _disturbances(study: OnsetStudy) -> Iterator[tuple[Any, ...]]:
    """How large a disturbance must be, and along which mode, at each value where it was found."""
    for row in study.in_order:
        for found in sorted(row.smallest_kicks, key=lambda each: each.energy_J):
            speed = with_uncertainty(found.speed_m_per_s, found.speed_uncertainty_m_per_s)
            energy = with_uncertainty(found.energy_J, found.energy_uncertainty_J)
            value = study.variation.shown(row.value)
            yield value, found.mode, speed, energy, found.edge_share, *_cells_of(found.leads_to, study)


def onset_table(study: OnsetStudy) -> str:
    """One row a value, as CSV: its kind, the modes, where the small perturbation led, and the motions found.

    The motions stand in the order of what leads to them, the smallest disturbance first.
    """
    modes = {
        mode.label: dict(zip(mode.values, zip(mode.frequency_Hz, mode.growth_rate_1_per_s, strict=True), strict=True))
        for mode in study.modes
    }
    sought = any(row.smallest_kicks for row in study.values)
    most = max((len(row.motions) for row in study.values), default=0)
    rows = []
    for row in study.in_order:
        cells: dict[str, Any] = {
            study.variation.column: study.variation.listed(row.value),
            "kind": row.kind,
            "asked": "yes" if row.asked else "no",
            "largest_growth_rate_1_per_s": row.growth_rate,
        }
        for label, values in modes.items():
            frequency, rate = values.get(row.value, (math.nan, math.nan))
            cells |= {f"frequency_{label}_Hz": frequency, f"growth_rate_{label}_1_per_s": rate}
        loudest = row.strongest
        strongest = next((each for each in row.starts if loudest and each.motion and each.motion.same(loudest)), None)
        cells |= _cells("small", row.small, study) | _cells("strongest", strongest, study)
        cells["motions"] = len(row.motions)
        for k in range(most):
            cells |= _motion_cells(f"motion_{k + 1}", row.led_to[k] if k < len(row.motions) else None, study)
        for name in DISTURBANCE if sought else ():
            cells[f"smallest_kick_{name}"] = row.smallest_kick and getattr(row.smallest_kick, name)
        failed = [f"{each.start}: {each.outcome}" for each in row.starts if each.leads_to is Kind.FAILED]
        cells["note"] = row.no_steady_sliding or "; ".join(failed)
        rows.append(cells)
    return rows_to_csv(rows)


def _cells(which: str, response: Response | None, study: OnsetStudy) -> dict[str, Any]:
    """Where a start led and its motion, as far as there is one."""
    motion = response and response.motion
    units = {name: column_unit(name) for name in study.coordinates}
    return {
        f"{which}_start": response and response.start,
        f"{which}_start_leads_to": response and response.leads_to,
        **{f"{which}_amplitude_{name}_{unit}": motion and motion.amplitude[name] for name, unit in units.items()},
        f"{which}_frequency_Hz": motion and motion.frequency_Hz,
        f"{which}_simulated_s": response and response.simulated_s,
    }


def _motion_cells(which: str, motion: Attractor | None, study: OnsetStudy) -> dict[str, Any]:
    """A motion and what leads to it, as far as there is one."""
    units = {name: column_unit(name) for name in study.coordinates}
    kick = motion and (motion.smallest_kick or motion.kick)
    return {
        f"{which}_after": motion and start_words(motion, study.variation),
        **{f"{which}_amplitude_{name}_{unit}": motion and motion.amplitude[name] for name, unit in units.items()},
        f"{which}_frequency_Hz": motion and motion.frequency_Hz,
        f"{which}_kick_speed_m_per_s": kick and kick.speed_m_per_s,
        f"{which}_kick_energy_J": kick and kick.energy_J,
    }


ONSET = Answer(
    words=print_study, summary="onset.json", tables={"onset.csv": onset_table}, figures={"onset": draw_onset}
)
