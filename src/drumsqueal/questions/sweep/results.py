"""What a sweep leaves beside its file: summary, figures, and what it found on the terminal."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray
from rich import box
from rich.console import Console
from rich.table import Table

from drumsqueal.files.json_file import write_json
from drumsqueal.files.output_folder import AMPLITUDE, CHANCE, STABILITY, SWEEP, SWEEP_SUMMARY
from drumsqueal.findings.history import versions
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.questions.sweep.amplitude_figure import draw_amplitude
from drumsqueal.questions.sweep.chance import ChanceStudy, study_chance
from drumsqueal.questions.sweep.chance_figure import draw_chance
from drumsqueal.questions.sweep.endings import squealing, undecided
from drumsqueal.questions.sweep.points import COMPUTED, OUTCOMES, TRENDS
from drumsqueal.questions.sweep.stability_figure import draw_stability
from drumsqueal.scene import COORDINATES
from drumsqueal.scene.plan import Plan
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal.style import save_figures
from drumsqueal.terminal.tables import print_table

Summary = dict[str, Any]
NOT_SETTLED = "not settled"


def write_results(folder: Path, plan: Plan) -> Summary:
    """Write summary and figures of a whole sweep. Raises OSError, and KeyboardInterrupt between two files."""
    with xarray.open_dataset(folder / SWEEP, engine="h5netcdf", mask_and_scale=False) as sweep:
        chances = study_chance(sweep) if plan.draws else None
        summary = summarise(sweep, plan, chances)
        write_json(summary, folder / SWEEP_SUMMARY)
        stop_if_interrupted()
        figures = {STABILITY: None if plan.draws else draw_stability(sweep, plan)}
        figures[CHANCE] = None if chances is None else draw_chance(sweep, plan, chances)
        figures[AMPLITUDE] = draw_amplitude(sweep, plan) if plan.transient else None
        stop_if_interrupted()
        save_figures({name: figure for name, figure in figures.items() if figure is not None}, folder)
    return summary


def summarise(sweep: xarray.Dataset, plan: Plan, chances: ChanceStudy | None) -> Summary:
    """What the sweep found, as plain data."""
    outcomes, squeal = sweep["outcome"].values, sweep["squeal"].values
    unstable, which = sweep["unstable"].values == 1, sweep["mode_coordinate"].values
    growth, frequency = sweep["growth_rate"].values, sweep["frequency"].values
    modes = {}
    for index, name in enumerate(COORDINATES):
        here = unstable & (which == index)
        points = int(here.any(axis=-1).sum())
        if points:
            place = np.unravel_index(np.argmax(np.where(here, growth, -np.inf)), here.shape)
            modes[name] = {
                "unstable_points": points,
                "largest_growth_rate_1_per_s": float(growth[place]),
                "frequency_there_Hz": float(frequency[place]),
                "where": _where(sweep, plan, place[:-1]),
            }
    found: Summary = {
        "title": plan.scene.title,
        "sweep": plan.describe(),
        "units": {key: plan.unit(key) for key in plan.keys},
        "points": plan.points,
        "outcomes": {OUTCOMES[code]: int((outcomes == code).sum()) for code in OUTCOMES if np.any(outcomes == code)},
        "points_with_squeal": int((squeal == 1).sum()),
        "points_with_divergence": int((sweep["divergence_rate"].values > 0).sum()),
        "modes": modes,
        "chance": None if chances is None else _plain(chances),
        "transients": _transients(sweep) if plan.transient else None,
        "scene": plan.scene.model_dump(mode="json"),
        "versions": versions(),
    }
    return found


def _where(sweep: xarray.Dataset, plan: Plan, place: tuple[Any, ...]) -> dict[str, float]:
    return {key: float(sweep[key].values[place[0] if plan.draws else place[k]]) for k, key in enumerate(plan.keys)}


def _plain(chances: ChanceStudy) -> Summary:
    told = chances._asdict() | {"squeal": chances.squeal._asdict()}
    return told | {"modes": {name: each._asdict() for name, each in chances.modes.items()}}


def _transients(sweep: xarray.Dataset) -> Summary:
    trend, unsettled = sweep["trend"].values, undecided(sweep)
    counts = {name: int(((trend == code) & ~unsettled).sum()) for code, name in enumerate(TRENDS)}
    counts[NOT_SETTLED] = int(unsettled.sum())
    done = sweep["outcome"].values == COMPUTED
    largest = np.max(sweep["amplitude"].values[done], axis=0, initial=0.0)
    return {
        "points_with_squeal": int(squealing(sweep).sum()),
        "points_not_settled": counts[NOT_SETTLED],
        "longest_of_them_s": float(np.max(sweep["simulated"].values[unsettled], initial=0.0)),
        "trends": {name: count for name, count in counts.items() if count},
        "largest_amplitude": dict(zip(COORDINATES, largest.tolist(), strict=True)),
    }


def print_sweep(console: Console, plan: Plan, summary: Summary) -> None:
    """Print how often each mode squeals and, of draws, how likely that is and what it follows."""
    if plan.draws:
        print_table(console, _chance_table(summary))
        _print_correlations(console, summary["chance"])
    else:
        print_table(console, _grid_table(plan, summary))
    told = summary["transients"]
    if told is not None:
        trends = ", ".join(f"{count} {name}" for name, count in told["trends"].items())
        console.print(f"Transients at their end: {trends or 'none'}")
        console.print(_heard(told, sum(told["trends"].values())))
        if told["points_not_settled"]:
            console.print(_unsettled(told, sum(told["trends"].values())))
    if summary["points_with_divergence"]:
        console.print(f"Diverges without oscillation at {summary['points_with_divergence']} points")
    for name, count in summary["outcomes"].items():
        if name != OUTCOMES[COMPUTED]:
            console.print(f"{count} of {plan.points} points: {name}")


def _heard(told: Summary, points: int) -> str:
    """How many of the transients squeal."""
    squeal = told["points_with_squeal"]
    share = f" ({100 * squeal / points:.3g} %)" if points else ""
    return f"By the transients, from the scene's own start: squeal at {squeal} of {points} points{share}"


def _unsettled(told: Summary, points: int) -> str:
    """How many may still turn out to squeal or to decay, and what their numbers are."""
    count, longest = told["points_not_settled"], told["longest_of_them_s"]
    have = "has" if count == 1 else "have"
    return (
        f"{count} of {points} transients {have} not settled after {longest:.3g} s and may squeal or not: "
        "amplitude and frequency there are those at the end; the figures mark them, and settled is 0 in sweep.nc"
    )


def _grid_table(plan: Plan, summary: Summary) -> Table:
    title = f"Squeal at {summary['points_with_squeal']} of {plan.points} points, by eigenvalues"
    table = Table(title=title, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in ("mode", "points", "most 1/s", "Hz there", "where"):
        table.add_column(heading, justify="left" if heading in ("mode", "where") else "right")
    for name, mode in summary["modes"].items():
        units = {key: "" if unit == "1" else f" {unit}" for key, unit in summary["units"].items()}
        where = ", ".join(f"{key} {value:.4g}{units[key]}" for key, value in mode["where"].items())
        growth, frequency = mode["largest_growth_rate_1_per_s"], mode["frequency_there_Hz"]
        table.add_row(name, str(mode["unstable_points"]), f"{growth:+.3f}", f"{frequency:.2f}", where)
    return table


def _chance_table(summary: Summary) -> Table:
    chances = summary["chance"]
    draws = 0 if chances is None else chances["squeal"]["total"]
    title = f"Chance of squeal by eigenvalues, {draws} draws"
    table = Table(title=title, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for heading in ("mode", "chance", "95 % from", "to", "most 1/s"):
        table.add_column(heading, justify="left" if heading == "mode" else "right")
    rows = {} if chances is None else {"any": chances["squeal"]} | chances["modes"]
    for name, each in rows.items():
        mode = summary["modes"].get(name)
        growth = "" if mode is None else f"{mode['largest_growth_rate_1_per_s']:+.3f}"
        table.add_row(name, *(f"{100 * each[key]:.2f} %" for key in ("share", "low", "high")), growth)
    return table


def _print_correlations(console: Console, chances: Summary | None) -> None:
    if chances is None:
        return
    known = {key: value for key, value in chances["correlations"].items() if value is not None}
    ordered = sorted(known, key=lambda key: -abs(known[key]))
    told = ", ".join(f"{key} {known[key]:+.2f}" for key in ordered)
    if told:
        noise = f"below {chances['noise']:.2f} is chance"
        console.print(printable(f"The largest growth rate follows (rank correlation; {noise}): {told}"))
