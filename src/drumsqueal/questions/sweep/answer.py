"""A sweep or a noise matrix into one folder: its file fills on disk; then what is written, drawn and printed."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from rich.console import Console

from drumsqueal.coordinates import largest_of
from drumsqueal.errors import COMPLETE, NothingToDoError, RequestError
from drumsqueal.findings.columns import Column, columns_of, table_of, values_of
from drumsqueal.findings.signals.regime import rest_words
from drumsqueal.physics.elasticity import shaping_numbers
from drumsqueal.physics.model import at_lining
from drumsqueal.questions.sweep.figure import draw_amplitude, draw_stability, in_words
from drumsqueal.questions.sweep.file import Source, fill_into, outcome_of
from drumsqueal.questions.sweep.found import (
    Basin,
    Chance,
    ChanceStudy,
    Responses,
    SweepStudy,
    UnstableMode,
    starts_alone,
    summarise,
)
from drumsqueal.questions.sweep.matrix_cells import (
    CellFound,
    NoiseMatrix,
    find_matrix,
    in_rows,
    shown_axes,
    shown_levels,
)
from drumsqueal.questions.sweep.matrix_plan import MatrixPlan
from drumsqueal.questions.sweep.points import COMPUTED, NONE, NOT_TAKEN, OUTCOMES, CellVerdict, Starting, modes_in
from drumsqueal.questions.sweep.study import refusal
from drumsqueal.scene.plan import Plan
from drumsqueal.scene.quantities import printable
from drumsqueal.solve.linear.modes import divergence_words
from drumsqueal.terminal import style
from drumsqueal.terminal.reply import Answer, Reply
from drumsqueal.terminal.style import frame, new_figure, styled
from drumsqueal.terminal.tables import print_cells, rows_to_csv

# The figure of random samples: growth rates and frequencies, and which numbers they depend on.


_BINS = 40
GROWS, DECAYS = style.COLOUR["Y"], style.TOUCHING


@styled()
def draw_chance(sweep: xarray.Dataset, plan: Plan, chances: ChanceStudy) -> Figure:
    """Draw growth rates and frequencies of the samples on the left, rank correlations on the right."""
    squeal = chances.squeal
    interval = f"{100 * squeal.low:.1f} to {100 * squeal.high:.1f} %"
    fraction = f"{100 * squeal.share:.1f} % ({interval} at 95 %)"
    figure = new_figure(plan.scene.title, f"probability of squeal by eigenvalues {fraction}, {squeal.total} samples")
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=[1.25, 1])[0]
    upper, lower = left.subplots(2, 1)
    _draw_growth(upper, sweep)
    _draw_frequencies(lower, sweep)
    _draw_correlations(right.subplots(), chances)
    return figure


def _draw_growth(axes: Axes, sweep: xarray.Dataset) -> None:
    growth = sweep["largest_growth_rate"].values
    growth = growth[np.isfinite(growth)]
    if growth.size:
        edges = _edges_through_zero(float(growth.min()), float(growth.max()))
        counts, _ = np.histogram(growth, edges)
        colours = [GROWS if low >= 0 else DECAYS for low in edges[:-1]]
        axes.bar(edges[:-1], counts / growth.size * 100, np.diff(edges), align="edge", color=colours, linewidth=0)
    axes.axvline(0, color=style.DARK, linewidth=0.6)
    frame(axes, "largest growth rate (1/s)", "samples (%)")


def _edges_through_zero(low: float, high: float) -> np.ndarray:
    """Edges of bins of one width, one of them at zero where that lies between: no bar is of both kinds."""
    width = max((high - low) / _BINS, 1e-9 * max(abs(low), abs(high), 1e-9))
    if low < 0 < high:
        return width * np.arange(np.floor(low / width), np.ceil(high / width) + 1)
    return low + width * np.arange(_BINS + 1)


def _draw_frequencies(axes: Axes, sweep: xarray.Dataset) -> None:
    unstable = sweep["unstable"].values == 1
    frequency, samples = sweep["frequency"].values, sweep.sizes["sample"]
    if unstable.any():
        edges = np.histogram_bin_edges(frequency[unstable], 2 * _BINS).tolist()
        found = {name: frequency[unstable & here] for name, here in modes_in(sweep).items()}
        named, others = largest_of({name: each.size for name, each in found.items() if each.size})
        shown = [(found[name], style.COLOUR[name], name) for name in named]
        if others:
            shown += [(np.concatenate([found[name] for name in others]), style.SEPARATED, f"{len(others)} others")]
        found, colours, labels = zip(*shown, strict=True)
        weights = [np.full(mine.size, 100 / samples) for mine in found]
        axes.hist(
            found, edges, weights=weights, color=colours, label=labels, stacked=True
        )  # so that none hides another
        above: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "ncols": 4, "columnspacing": 1.0}
        axes.legend(**(above if others else {"loc": "upper right", "title": "mode"}))
    else:
        axes.text(0.5, 0.5, "no sample squeals", transform=axes.transAxes, ha="center", fontsize=style.SMALL_SIZE)
    frame(axes, "frequency of unstable modes (Hz)", "samples (%)")


def _draw_correlations(axes: Axes, chances: ChanceStudy) -> None:
    known = dict(reversed(chances.known_correlations.items()))
    axes.axvspan(-chances.noise, chances.noise, color=style.PALE, linewidth=0, zorder=0)
    axes.axvline(0, color=style.DARK, linewidth=0.6)
    axes.barh(range(len(known)), list(known.values()), height=0.55, color=style.SEPARATED)  # of a row
    axes.set_yticks(range(len(known)), [in_words(key).replace(" ", "\n", 1) for key in known])
    axes.set_xlim(-1, 1)
    axes.set_ylim(-0.6, max(len(known), 1) - 0.4)
    frame(axes, "rank correlation with the largest\ngrowth rate; pale band: not significant", None)
    axes.tick_params(axis="y", length=0)


# The figure of the basins: each start at its place, in the colour of what it leads to.


_COLOURS = [style.COLOUR[name] for name in ("Y", "X", "Tz", "Ty", "Tx", "Z")]  # of the attractors, by their numbers
QUIET, ELSEWHERE = style.FAINT, style.DARK
_MOST_SHOWN = len(_COLOURS)
_FEW, _MANY = 100, 3000  # starts, drawn large and small
_SIZES = 4.5, 1.5  # of their dots, points


@styled()
def draw_basin(data: xarray.Dataset, plan: Starting, basin: Basin) -> Figure:
    """Draw the first two numbers of the starts, or over one number the amplitude that it leads to."""
    two = len(plan.starts) > 1
    rest = plan.starts[2:]
    also = f"; {', '.join(map(in_words, rest))} drawn, too" * bool(rest)
    if not starts_alone(plan):
        also += "; so does the brake"
    squeals = (
        f"{basin.squeal.in_words} of {plan.points} disturbances squeal" if basin.squeal.total else basin.clear_of_none
    )
    figure = new_figure(plan.about["title"], f"{squeals}{also}")
    axes = figure.subplots()
    factor, unit, shown = at_lining(plan.scene if isinstance(plan, Plan) else plan.model, basin.coordinate)
    x = _values(plan, basin, plan.starts[0])
    y = _values(plan, basin, plan.starts[1]) if two else factor * _amplitude(data, basin)
    size = float(np.interp(plan.points, (_FEW, _MANY), _SIZES))
    for number, colour, label in _kinds(basin):
        mine = np.minimum(basin.attractor, _MOST_SHOWN) == number
        if mine.any():
            axes.plot(x[mine], y[mine], "o", color=colour, markersize=size, markeredgewidth=0, label=label)
    frame(
        axes,
        _label(plan, plan.starts[0]),
        _label(plan, plan.starts[1]) if two else f"{shown}, half peak to peak ({unit})",
    )
    if two and axes.get_xlim()[0] < 0 < axes.get_xlim()[1] and axes.get_ylim()[0] < 0 < axes.get_ylim()[1]:
        axes.plot(0, 0, "+", color=style.DARK, markersize=7, markeredgewidth=1.2)  # steady sliding
    figure.legend(loc="outside lower center", ncols=2, columnspacing=1.5)
    return figure


def _kinds(basin: Basin) -> list[tuple[int, str, str]]:
    """Number, colour and label of what starts lead to."""
    found = [(0, QUIET, f"steady sliding ({basin.decay.percent})")]
    labels = [f"squeal {each.number}: {each.frequency_Hz:.4g} Hz ({each.chance.percent})" for each in basin.attractors]
    labels += [f"rest {each.number}, {rest_words(each.place)} ({each.chance.percent})" for each in basin.rests]
    if len(labels) > _MOST_SHOWN:
        labels[_MOST_SHOWN - 1 :] = [
            f"{'squeal' if len(basin.attractors) >= _MOST_SHOWN else 'rest'} {_MOST_SHOWN} and others"
        ]
    found += [(number, colour, label) for number, (colour, label) in enumerate(zip(_COLOURS, labels, strict=False), 1)]
    if not basin.attractors and basin.squeal.count:
        found.append((1, _COLOURS[0], f"squeal ({basin.squeal.percent})"))
    return [*found, (NONE, ELSEWHERE, "elsewhere, or not clear")]


def _values(plan: Starting, basin: Basin, key: str) -> np.ndarray:
    return np.array([plan.listed(key, value) for value in basin.starts[:, plan.keys.index(key)].tolist()])


def _label(plan: Starting, key: str) -> str:
    return f"{in_words(key).removeprefix('start ')} from steady sliding ({plan.unit(key)})"


def _amplitude(data: xarray.Dataset, basin: Basin) -> np.ndarray:
    names = [str(name) for name in data["coordinate"].values]
    amplitude = data["amplitude"].values.reshape(-1, len(names))[:, names.index(basin.coordinate)]
    return np.where(basin.attractor == 0, 0.0, amplitude)


def sweep_into(reply: Reply, plan: Plan, source: Source, *, resume: bool = False) -> SweepStudy:
    """Compute a sweep into the folder of a command, or go on with the one that is there.

    `source` computes the batches. Raises IntegrationError as `fill_into` does.
    """
    return fill_into(reply, _how(plan), plan, source, lambda data: summarise(data, plan), resume=resume)


def print_study(console: Console, study: SweepStudy) -> None:
    """Print how often each mode squeals and, of random samples, how likely that is and what it depends on."""
    if study.basin is not None and starts_alone(study.plan):
        _print_linear(console, study)
        print_basin(console, study.basin, study.plan)
        _print_outcomes(console, study)
        return
    squeal = f"Squeal at {study.points_with_squeal} of {study.points} points, by eigenvalues"
    if study.chance is not None:
        _print_chances(console, study, study.chance)
    elif not study.modes:
        console.print(squeal)
    else:
        units = {key: "" if unit == "1" else f" {unit}" for key, unit in study.units.items()}
        rows = []
        for name, mode in study.modes.items():
            where = ", ".join(f"{key} {value:.4g}{units[key]}" for key, value in mode.where.items())
            rows.append((name, *values_of(mode), where))
        columns = Column("mode"), *columns_of(UnstableMode).values(), Column("where")
        print_cells(console, squeal, columns, rows)
    if study.chance is not None and study.chance.known_correlations:
        listed = ", ".join(f"{key} {value:+.2f}" for key, value in study.chance.known_correlations.items())
        insignificant = f"below {study.chance.noise:.2f} it is not significant"
        console.print(printable(f"Rank correlation with the largest growth rate ({insignificant}): {listed}"))
    if study.basin is not None:
        print_basin(console, study.basin, study.plan)
    elif study.transients is not None:
        _print_responses(console, study.transients)
    if set(study.plan.keys) & set(shaping_numbers(study.plan.scene)):
        console.print("E1, E2, … count the elastic modes by rising frequency at each point: shapes may change places")
    if study.points_with_divergence:
        console.print(f"Steady sliding diverges without oscillation at {study.points_with_divergence} points")
    _print_outcomes(console, study)


def _print_outcomes(console: Console, study: SweepStudy) -> None:
    for name, count in study.outcomes.items():
        if name != OUTCOMES[COMPUTED]:
            why = ""
            if name == OUTCOMES[NOT_TAKEN]:
                first = int(np.argmax(np.ravel(study.data["outcome"].values) == NOT_TAKEN))
                why = f"; the first: {refusal(study.plan, first)}"
            console.print(printable(f"{count} of {study.points} points: {name}{why}"))


def _print_linear(console: Console, study: SweepStudy) -> None:
    """Print what the eigenvalues say of the one brake whose starts are varied."""
    growing = [f"{name} ({mode.frequency_there_Hz:.5g} Hz)" for name, mode in study.modes.items()]
    rate = float(study.data["divergence_rate"].values.max(initial=0.0))
    growing += [divergence_words(rate)] if rate > 0 else []
    console.print(
        f"By the eigenvalues steady sliding is {'unstable: ' * bool(growing)}{', '.join(growing) or 'stable'}"
    )


def print_basin(console: Console, basin: Basin, plan: Starting) -> None:
    """Print which fraction of the starts leads where."""
    name = basin.coordinate
    factor, unit, shown = at_lining(plan.scene if isinstance(plan, Plan) else plan.model, name)
    percentages = [replace(each, digits=".1f") for each in columns_of(Chance).values()]
    percentages[0] = replace(percentages[0], label="fraction")  # of what is no sample
    if math.isnan(basin.squeal.low):
        percentages = percentages[:1]
    frequency = Column("{unit}", ".5g", unit="Hz", missing="")
    amplitude = Column(f"{shown} {{unit}}", ".4g", unit=unit, factor=factor, missing="")

    def row(what: str, chance: Chance, *cells: float) -> tuple[Any, ...]:
        return (what, *values_of(chance)[: len(percentages)], *(cells or (None, None)))

    def follows(start: Mapping[str, float]) -> str:
        listed = {key: plan.listed(key, value) for key, value in start.items()}
        return ", ".join(f"{key.removeprefix('start.')} {value:.3g} {plan.unit(key)}" for key, value in listed.items())

    rows = [
        row("steady sliding", basin.decay),
        *(row(f"squeal {s.number}", s.chance, s.frequency_Hz, s.amplitude[name]) for s in basin.attractors),
        *([] if basin.attractors else [row("squeal", basin.squeal)]),
        *(row(f"rest {each.number}", each.chance) for each in basin.rests),
    ]
    ranges = ", ".join(_range(plan, key) for key in plan.starts)
    if not basin.squeal.total:
        console.print(printable(f"{basin.clear_of_none.capitalize()}; they start with {ranges}"))
        return
    leads = Column("leads to"), *percentages, frequency, amplitude
    print_cells(console, f"Where {plan.points} disturbances lead", leads, rows)
    for each in basin.attractors:
        console.print(printable(f"Squeal {each.number} follows, for instance, on {follows(each.start)}"))
    for each in basin.rests:
        where = f"Rest {each.number} is another equilibrium, {rest_words(each.place)}"
        console.print(printable(f"{where}; it follows, for instance, on {follows(each.start)}"))
    console.print(printable(f"{basin.squeal.in_words} of the disturbances squeal; they start with {ranges}"))
    for what, count in basin.elsewhere.items():
        console.print(f"{count} of {plan.points}: motion {what}")
    if basin.unclear:
        console.print(
            f"{basin.unclear} of {plan.points}: it is not clear where they lead; the fractions leave them out"
        )


def _range(plan: Starting, key: str) -> str:
    """What a number of the start is drawn from, or taken from."""
    values = plan.values(0, plan.points)[:, plan.keys.index(key)]
    given = plan.given.get(key)
    ends = (given.values[0], given.values[-1]) if given else (float(values.min()), float(values.max()))
    low, high = (f"{plan.listed(key, end):.4g}" for end in ends)
    return f"{key.removeprefix('start.')} from {low} to {high} {plan.unit(key)}"


def _print_responses(console: Console, found: Responses) -> None:
    """Print how many of the transients squeal, and how many may still turn out to squeal or to decay."""
    points, squeal, open_ones = sum(found.trends.values()), found.points_with_squeal, found.points_not_settled
    trends = ", ".join(f"{count} {name}" for name, count in found.trends.items())
    console.print(f"Transients at their end: {trends or 'none'}")
    percentage = f" ({100 * squeal / points:.3g} %)" if points else ""
    console.print(f"By the transients, from the scene's own start: squeal at {squeal} of {points} points{percentage}")
    if open_ones:
        have = "has" if open_ones == 1 else "have"
        console.print(
            f"{open_ones} of {points} transients {have} not settled after {found.longest_of_them_s:.3g} s and may "
            "squeal or decay: amplitude and frequency there are those at the end; the figures mark them, and settled "
            "is 0 in sweep.nc"
        )


def _print_chances(console: Console, study: SweepStudy, chance: ChanceStudy) -> None:
    probabilities, (_, *worst) = columns_of(Chance).values(), columns_of(UnstableMode).values()
    rows = []
    for name, each in {"any": chance.squeal, **chance.modes}.items():
        mode = study.modes.get(name)
        rows.append((name, *values_of(each), *(values_of(mode)[1:] if mode else ())))
    columns = Column("mode"), *probabilities, *worst
    print_cells(console, f"Probability of squeal by eigenvalues, {chance.squeal.total} samples", columns, rows)


def _how(plan: Plan) -> Answer[SweepStudy]:
    """Words, file and figures of a sweep: of one brake that starts in many ways the basins alone."""
    figures: dict[str, Callable[[SweepStudy], Figure | None]] = {}
    one_brake = starts_alone(plan)
    if plan.starts:
        figures["basin"] = lambda study: study.basin and draw_basin(study.data, plan, study.basin)
    if not plan.draws and not one_brake:
        figures["stability"] = lambda study: draw_stability(study.data, plan)
    if plan.draws and not one_brake:
        figures["chance"] = lambda study: study.chance and draw_chance(study.data, plan, study.chance)
    if plan.transient and not (plan.draws and one_brake):
        figures["amplitude"] = lambda study: draw_amplitude(study.data, plan)
    return Answer(words=print_study, summary="sweep.json", figures=figures, filled="sweep.nc")


# The figure of a noise matrix: a cell for each scene and procedure, coloured by its level, with its frequency.


_ROW_MM, _LOWEST_MM, _MARGIN_MM = 9.0, 60.0, 34.0
_MOST_ROWS, _MOST_COLUMNS = 60, 16  # more would be too small to read: the table has them all
_SPAN = 12.0  # dB from the softest to the loudest, at least


@styled()
def draw_matrix(found: NoiseMatrix) -> Figure | None:
    """Draw rows by columns; quiet cells are white, a ring marks squeal after a large disturbance only."""
    columns, rows = in_rows(found)
    if len(rows) > _MOST_ROWS or len(columns) > _MOST_COLUMNS:
        return None
    large = "; framed: after a large disturbance only" * bool(found.squeal_after_large_only)
    subject = f"{found.squeal} of {len(found.cells)} squeal{large}"
    figure = new_figure(found.title or "Noise matrix", subject)
    figure.set_figheight(max(_LOWEST_MM, _MARGIN_MM + _ROW_MM * len(rows)) / style.MM_PER_INCH)
    axes = figure.subplots()
    levels = [cell.level_dB for cell in found.cells if math.isfinite(cell.level_dB)]
    loudest = max(levels, default=0.0)
    norm = Normalize(min(*levels, loudest - _SPAN) if levels else -_SPAN, loudest)
    colours = ScalarMappable(norm, "YlOrRd")
    for y, (_, cells) in enumerate(rows):
        for x, cell in enumerate(cells):
            _draw_cell(axes, x, y, cell, colours)
    axes.set_xlim(-0.5, len(columns) - 0.5)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xticks(range(len(columns)), columns)
    axes.set_yticks(range(len(rows)), [label or "all" for label, _ in rows])
    across, down = shown_axes(found)
    frame(axes, in_words(across), in_words(", ".join(down)) or None)
    axes.tick_params(length=0)
    bar = figure.colorbar(colours, ax=axes, pad=0.02)
    bar.set_label("rms velocity of the shoe\n(dB re 1 nm/s)")
    bar.ax.tick_params(labelsize=style.SMALL_SIZE)
    return figure


def _draw_cell(axes: Axes, x: int, y: int, cell: CellFound, colours: ScalarMappable) -> None:
    loud = math.isfinite(cell.level_dB)
    face = colours.to_rgba(np.asarray(cell.level_dB)) if loud else "white"
    axes.add_patch(Rectangle((x - 0.5, y - 0.5), 1, 1, facecolor=face, edgecolor=style.FAINT, linewidth=0.6))
    bottom, top = colours.get_clim()
    # 0.65 of the scale: text is white on what is darker
    dark = loud and bottom is not None and top is not None and cell.level_dB > bottom + 0.65 * (top - bottom)
    ink = "white" if dark else style.DARK
    if loud and cell.disturbance == "large":
        axes.add_patch(Rectangle((x - 0.46, y - 0.42), 0.92, 0.84, fill=False, edgecolor=ink, linewidth=0.9))
    text = f"{cell.frequency_Hz:.0f} Hz" if loud else "quiet" if cell.verdict is CellVerdict.QUIET else "?"
    axes.text(x, y, text, ha="center", va="center", fontsize=style.SMALL_SIZE, color=ink)


def matrix_into(reply: Reply, plan: MatrixPlan, source: Source, *, resume: bool = False) -> NoiseMatrix:
    """Compute a noise matrix into the folder of a command, or go on with the one that is there.

    Raises RequestError for one that cannot be resumed, and IntegrationError for one that failed or was interrupted:
    the cells computed until then are in the file.
    """
    if resume:
        _check_resumed(reply.folder / "matrix.nc", plan)
    return fill_into(reply, MATRIX_ANSWER, plan, source, lambda data: find_matrix(data, plan), resume=resume)


def _check_resumed(path: Path, plan: MatrixPlan) -> None:
    if not path.exists():
        raise RequestError(f"{path.parent}: there is no noise matrix to resume; leave --resume out")
    if outcome_of(path, plan) == COMPLETE:
        raise NothingToDoError(f"{path.parent}: the noise matrix is complete, there is nothing to resume")


def print_matrix(console: Console, found: NoiseMatrix) -> None:
    """Print the cells that squeal, and how many are quiet."""
    if found.squeal:
        loud = [cell for cell in found.cells if cell.verdict is CellVerdict.SQUEALS]
        columns, rows = table_of(CellFound, loud)
        names = (name.replace(".", "\n").replace("_", " ") for name in shown_levels(found, loud[0]))
        levels = (shown_levels(found, cell).values() for cell in loud)
        rows = ((*labels, *row) for labels, row in zip(levels, rows, strict=True))
        print_cells(console, found.title or "Noise matrix", (*map(Column, names), *columns), rows)
    console.print(found.headline)
    if found.squeal:
        loudest = max(found.cells, key=lambda cell: cell.level_dB if math.isfinite(cell.level_dB) else -math.inf)
        where = ", ".join(f"{name} {label}" for name, label in shown_levels(found, loudest).items())
        size = f"{loudest.velocity_m_per_s:.3g} m/s rms of the shoe at {loudest.frequency_Hz:.4g} Hz"
        console.print(printable(f"Loudest: {size}{where and f', at {where}'}"))
        console.print("Levels: rms velocity of the shoe, over its mass and over time, re 1 nm/s (ISO 1683)")
    unclear = [cell for cell in found.cells if cell.verdict not in (CellVerdict.QUIET, CellVerdict.SQUEALS)]
    for cell in unclear:
        where = ", ".join(f"{name} {label}" for name, label in shown_levels(found, cell).items())
        console.print(printable(f"{cell.verdict}{where and f' ({where})'}: {cell.outcome}"))


def matrix_table(found: NoiseMatrix) -> str:
    """The cells as CSV: one row a cell; empty where there is no number."""
    return rows_to_csv(cell.levels | {key: value for key, value in cell if key != "levels"} for cell in found.cells)


MATRIX_ANSWER = Answer(
    words=print_matrix,
    summary="matrix.json",
    tables={"matrix.csv": matrix_table},
    figures={"matrix": draw_matrix},
    filled="matrix.nc",
)
