"""A study of accuracy as text: a table on the terminal, the raw figures as CSV, a sentence and a `[simulate]` block."""

import math
import os
import platform
import tomllib
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import tomli_w
from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.findings.history import versions
from drumsqueal.questions.accuracy.study import AccuracyStudy, Measurement
from drumsqueal.terminal.tables import print_table, rows_to_csv

HEADINGS = ("time\nms/ms", "eval.\nper ms", "growth\nphase", "with\nedges", "features", "energy")
MANY = 99.5  # ms, from which on a time is told without an exponent


def print_study(console: Console, study: AccuracyStudy) -> None:
    """Print every measurement, what the reference is worth, and what meets the target."""
    table = Table(box=box.SIMPLE_HEAD, title="What accuracy costs in time", pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("run", vertical="bottom")
    for heading in HEADINGS:
        table.add_column(heading, justify="right", vertical="bottom")
    for _, line in groupby(study.measurements, key=lambda each: each.contender.line):
        for measurement in line:
            if not math.isnan(measurement.compile_seconds):  # it was tried
                table.add_row(measurement.contender.name, *_cells(measurement))
        table.add_section()
    print_table(console, table)
    for remark in remarks(study):
        console.print(remark, style="dim")
    console.print(verdict(study), style="bold")
    console.print(simulate_block(study))


def remarks(study: AccuracyStudy) -> list[str]:
    """What the columns mean, what the reference is worth, and what was not measured, in sentences."""
    reference, end = study.reference, float(study.reference.time[-1])
    reached = min(end, study.growth_end)
    edges = f", and, with the edges, until {end * 1e3:.4g} ms" if end > study.growth_end else ""
    found = [
        "Time and evaluations for a simulated millisecond: median, compilation apart. Relative errors: of the "
        f"trajectory, the largest of any state over its largest value, until {reached * 1e3:.4g} ms, {_phase(study)}"
        f"{edges}; of the features (growth rates, onset frequencies, amplitude and frequency at the end) the largest, "
        "against the tightest run's; of the energy balance over the kinetic energy. A dash: not counted, or not "
        "reached; implicit methods, quadratures and smoothing run only as far as the reference, which is too short for "
        "features.",
        "The reference is SciPy's DOP853 at 1e-13 on tanh-sinh quadrature. At 1e-12 on Fejér quadrature it "
        f"differs by {reference.uncertainty(reached):.0e} (drawn as the floor), LSODA at 1e-12 by "
        f"{reference.confirmed(reached):.0e}.",
    ]
    if study.separation is None:
        found.append("Nearby trajectories stay together over the whole record.")
    else:
        found.append(
            f"From {study.separation * 1e3:.4g} ms on nearby trajectories have come apart a hundredfold: beyond, "
            "compare features, not points."
        )
    failed = [f"{m.contender.name}: {m.outcome}" for m in study.measurements if m.errors is None and m.seconds == ()]
    return [*found, *_without_repeats(failed)]


def _phase(study: AccuracyStudy) -> str:
    """Which part of the motion the first error of a trajectory is of."""
    end = float(study.reference.time[-1])
    return "the growth phase" if end >= study.growth_end else "as far as the reference got in its time"


def verdict(study: AccuracyStudy) -> str:
    """The cheapest choice that meets the target, and what ten times better would cost, in a sentence."""
    best = study.cheapest
    floor = study.reference.uncertainty(study.growth_end)
    if best is None:
        limit = f" The reference itself is good to {floor:.0e}." if floor > study.target else ""
        return f"Nothing that was tried meets {study.target:.0e} in all of trajectory, features and energy.{limit}"
    judged = "trajectory and energy (so short a record has no features)"
    if best.errors is not None and best.errors.largest_feature is not None:
        judged = "trajectory, features and energy"
        scatter = max((each or 0.0 for each in study.scatter), default=0.0)
        if 2 * scatter > study.target:
            judged += f" (of features, as far as their scatter of {scatter:.0e} lets it be told)"
    text = (
        f"Within {study.target:.0e} in {judged}, the cheapest is {best.contender.solver} at "
        f"tolerance {best.contender.tolerance:g}: {best.evaluations:.3g} evaluations, "
        f"{1e3 * best.time_per_ms * study.scene.simulate.duration:.3g} ms for {study.scene.simulate.duration:g} s."
    )
    better = study.ten_times_better
    if better is None:
        return f"{text} Nothing that was tried is ten times better."
    if better is best:
        return f"{text} It is even ten times better."
    ratio, chosen = better.evaluations / best.evaluations, better.contender
    return f"{text} Ten times better takes {ratio:.3g} times as many ({chosen.solver} at {chosen.tolerance:g})."


def simulate_block(study: AccuracyStudy) -> str:
    """The `[simulate]` table that meets the target, or a comment that none does."""
    if study.cheapest is None:
        return f"# nothing that was tried meets {study.target:.0e}\n"
    chosen = study.cheapest.contender
    simulate = study.scene.simulate
    coordinates = simulate.coordinates
    table = {
        "duration": simulate.duration,
        "sample_rate": simulate.sample_rate,
        "tolerance": chosen.tolerance,
        "solver": chosen.solver,
        "coordinates": coordinates if isinstance(coordinates, str) else list(coordinates),
    }
    return tomli_w.dumps({"simulate": table})


def to_csv(measurements: Sequence[Measurement]) -> str:
    """One row a run, with every repeat's time, and the versions and the machine beside it."""
    return rows_to_csv([_row(measurement) | _machine() | versions() for measurement in measurements])


def to_data(study: AccuracyStudy) -> dict[str, Any]:
    """The same rows, what follows from them, and the settings that meet the target, as plain data."""
    return {
        "title": study.scene.title,
        "target": study.target,
        "verdict": verdict(study),
        "remarks": remarks(study),
        "simulate": None if study.cheapest is None else tomllib.loads(simulate_block(study))["simulate"],
        "runs": [_row(measurement) for measurement in study.measurements],
        "scene": study.scene.model_dump(mode="json"),
        "versions": versions(),
        **_machine(),
    }


def _machine() -> dict[str, Any]:
    return {"machine": platform.machine(), "processor": _processor(), "cores": os.cpu_count()}


def _row(measurement: Measurement) -> dict[str, Any]:
    contender, errors = measurement.contender, measurement.errors
    row: dict[str, Any] = {
        "cause": contender.cause,
        "line": contender.line,
        "setting": contender.setting,
        "solver": contender.solver,
        "tolerance": contender.tolerance,
        "outcome": measurement.outcome,
        "simulated_ms": _known(measurement.simulated * 1e3),
        "time_per_simulated_ms": _known(measurement.time_per_ms),
        "seconds": " ".join(f"{each:.6g}" for each in measurement.seconds),
        "first_call_extra_seconds": _known(measurement.compile_seconds),
        "evaluations": _known(measurement.evaluations),
    }
    if errors is not None:
        row |= {"error_trajectory": errors.trajectory, "error_beyond_edges": errors.beyond}
        row |= {f"error_{name}": value for name, value in errors.features._asdict().items()}
        row["error_energy_balance"] = errors.energy
    return row


def _processor() -> str:
    information = Path("/proc/cpuinfo")
    lines = information.read_text(encoding="utf-8", errors="replace").splitlines() if information.exists() else []
    named = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor())


def _cells(measurement: Measurement) -> list[str]:
    errors = measurement.errors
    if errors is None:
        return ["failed"]
    found = (errors.trajectory, errors.beyond, errors.largest_feature, errors.energy)
    evaluations = measurement.evaluations_per_ms
    counted = "-" if math.isnan(evaluations) else f"{evaluations:.0f}"
    time = measurement.time_per_ms
    return [
        f"{time:.2g}" if time < MANY else f"{time:.0f}",
        counted,
        *("-" if e is None else f"{e:.0e}" for e in found),
    ]


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def _without_repeats(sentences: list[str]) -> list[str]:
    """One sentence for runs that were left out for the same reason."""
    grouped: dict[str, list[str]] = {}
    for sentence in sentences:
        name, reason = sentence.split(": ", 1)
        grouped.setdefault(reason, []).append(name)
    return [f"{'; '.join(names)}: {reason}." for reason, names in grouped.items()]
