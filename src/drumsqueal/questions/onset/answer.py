"""What a study of the onset draws, writes and prints."""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray
from rich.console import Console
from rich.text import Text

from drumsqueal.coordinates import column_unit, largest_of
from drumsqueal.dynamics.attractor import Attractor, Response, SteadyResponse
from drumsqueal.dynamics.cycles.cycle import RangeKind
from drumsqueal.findings.columns import Column
from drumsqueal.findings.kinds import Kind
from drumsqueal.questions.cycle.answer import (
    OTHER,
    SHADES,
    STABLE_CYCLE,
    UNSTABLE_CYCLE,
    draw_cycles,
    limit_amplitudes,
)
from drumsqueal.questions.cycle.study import missing_words
from drumsqueal.questions.onset.found import (
    Onset,
    OnsetStudy,
    Row,
    critical_words,
    shown_line,
    shown_size,
    start_words,
    with_uncertainty,
)
from drumsqueal.solve.linear.modes import UNDAMPED_FRACTION
from drumsqueal.terminal import style
from drumsqueal.terminal.reply import Answer
from drumsqueal.terminal.style import frame, label_right_edge, label_top_edge, new_figure, styled, tick_in_units
from drumsqueal.terminal.tables import print_cells, rows_to_csv

MARKER: dict[str, Any] = {"marker": "o", "markersize": 3.2, "linestyle": "", "markeredgewidth": 0.7}
SQUARE: dict[str, Any] = MARKER | {"marker": "s"}  # of disturbances: these are no motions
AFTER_SMALL, AFTER_LARGE = "after a small perturbation", "after a large disturbance only"
STEADY, CRITICAL = "steady sliding, after a small perturbation", "critical value"
FIRST = (AFTER_SMALL, STEADY, AFTER_LARGE, CRITICAL, STABLE_CYCLE, UNSTABLE_CYCLE)  # in the legend
ROOM = 0.25  # of the height, above the largest amplitude, for the names of the ranges
MARGIN = 0.012  # of the width, for a marker at either end
MICRO = 1e6


@styled()
def draw_onset(study: OnsetStudy) -> Figure:
    """Draw amplitudes, frequencies, growth rates and the smallest disturbances over the parameter, before the ranges.

    A filled marker is a motion that a small perturbation leads to, an empty one takes a large disturbance or the motion
    at a neighbouring value. Cycles that were followed run through them.
    """
    figure = new_figure(study.title, f"onset along {study.variation.key}")
    disturbances = any(row.smallest_disturbances for row in study.values)
    heights = [2.2, 1.0, 1.0, *[1.0] * disturbances]
    # The usual height of a figure is for panels whose heights add up to 3.5.
    figure.set_figheight(figure.get_figheight() * sum(heights) / 3.5)
    panels = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    values = [row.value for row in study.values]
    margin = MARGIN * (max(values) - min(values))
    panels[0].set_xlim(min(values) - margin, max(values) + margin)
    for axes in panels:
        shade_ranges(axes, study)
    draw_amplitudes(panels[0], study)
    _draw_frequencies(panels[1], study)
    _draw_growth(panels[2], study)
    if disturbances:
        _draw_disturbances(panels[3], study)
    tick_in_units(panels[-1].xaxis, study.variation.size)
    panels[-1].set_xlabel(study.variation.label)
    figure.align_ylabels(panels)
    figure.legend(handles=_legend(panels, study), loc="outside lower center", ncols=3)
    named = [(at, f"{study.variation.shown(at):.4g}", style.DARK) for at in _boundaries(study)]
    label_top_edge(panels[0], named, reach=4.0)
    return figure


def draw_amplitudes(axes: Axes, study: Onset) -> None:
    """Half the peak-to-peak value of `study.coordinate` (µm, µrad) of each motion, and zero where sliding is stable."""
    name, colour = study.coordinate, style.COLOUR[study.coordinate]
    amplitudes, (factor, unit, shown) = [], shown_size(study, [0.0])  # in millionths
    if study.cycles is not None:
        amplitudes += [factor * cycle.amplitude[name] for branch in study.cycles.branches for cycle in branch.cycles]
        draw_cycles(axes, study.cycles, colour, lambda cycle: factor * cycle.amplitude[name])
    for row in study.values:
        for motion in row.motions:
            amplitudes.append(factor * motion.amplitude[name])
            _draw_motion(axes, row, motion, amplitudes[-1], colour)
    rest = limit_amplitudes(axes, amplitudes, ROOM)
    quiet = [row.value for row in study.values if row.small is not None and row.small.leads_to is Kind.DECAYS]
    if quiet:  # an empty line that is not clipped counts as one at the corner of the figure, and the layout collapses
        look = {"color": style.DARK, "label": STEADY, "clip_on": False, "zorder": 3}
        axes.plot(quiet, np.full(len(quiet), rest), **MARKER | look)
    low, high = axes.get_xlim()
    for each in study.ranges:
        # A range of less than 0.14 of the width has no room for a name.
        if each.last - each.first > 0.14 * (high - low):
            place = {"transform": axes.get_xaxis_transform(), "ha": "center", "va": "top"}
            axes.text((each.first + each.last) / 2, 0.97, each.kind, fontsize=style.SMALL_SIZE, **place)
    frame(axes, None, f"{shown}, half peak\nto peak ({unit})")


def _draw_motion(axes: Axes, row: Row, motion: Attractor, value: float, colour: str) -> None:
    """Draw a filled marker where the small perturbation led to the motion, else an empty one."""
    face, label = (colour, AFTER_SMALL) if motion.after_small else ("white", AFTER_LARGE)
    axes.plot(row.value, value, color=colour, markerfacecolor=face, label=label, **MARKER)


def _draw_frequencies(axes: Axes, study: Onset) -> None:
    """The lines that hold most kinetic energy, before the modes that are near them."""
    axes.set_ylim(*_frequency_limits(study))
    modes = ((mode.name, np.array(mode.values), np.array(mode.frequency_Hz) / 1e3) for mode in study.modes)
    _draw_modes(axes, study, modes)
    for row in study.values:
        for motion in row.motions:
            if motion.frequency_Hz:
                colour = style.COLOUR[motion.line_of or study.coordinate]
                _draw_motion(axes, row, motion, motion.frequency_Hz / 1e3, colour)
    frame(axes, None, "Frequency\n(kHz)")


def _named(study: Onset) -> tuple[str, ...]:
    """The names of the modes that grow most, as many as the legend has room for."""
    growth: dict[str, float] = {}
    for mode in study.modes:
        growth[mode.name] = max(growth.get(mode.name, -np.inf), *mode.growth_rate_1_per_s)
    return largest_of(growth)[0]


def _draw_modes(
    axes: Axes, study: Onset, lines: Iterable[tuple[str, NDArray[np.float64], NDArray[np.float64]]]
) -> None:
    """Draw modes (name, values, measure) over the parameter: named in the legend or, thin, at the edge of the picture.

    Those that are not in the picture have no name.
    """
    (low, high), named, labels = axes.get_ylim(), _named(study), []
    for name, values, measure in lines:
        inside, colour = (measure > low) & (measure < high), style.COLOUR[name]
        label = f"mode {name}" if name in named and inside.any() else None
        axes.plot(values, measure, color=colour, label=label, linewidth=None if name in named else 0.5)
        if name not in named and inside.any():
            labels.append((float(measure[inside][-1]), name, colour))
    label_right_edge(axes, labels)


def _draw_growth(axes: Axes, study: Onset) -> None:
    """Re λ of the modes, as far down as the least stable one goes."""
    axes.set_ylim(*_growth_limits(study))
    axes.axhline(0, color=style.DARK, linewidth=0.6)
    lines = []
    for mode in study.modes:
        zeros = [each.value for each in study.critical_values if each.label == mode.label]  # between few values, too
        values = np.array([*mode.values, *zeros])
        rates = np.array([*mode.growth_rate_1_per_s, *(0.0 for _ in zeros)])
        order = np.argsort(values)
        lines.append((mode.name, values[order], rates[order]))
    _draw_modes(axes, study, lines)
    for critical in study.critical_values:
        axes.plot(critical.value, 0, "D", markersize=3.5, color=style.DARK, label=CRITICAL, zorder=4)
    frame(axes, None, "Growth rate\n(1/s)")


def _draw_disturbances(axes: Axes, study: Onset) -> None:
    """Velocity of the lining's surface in the smallest disturbance that leads to each motion, coloured by mode."""
    largest = 0.0
    for row in study.values:
        for found in row.smallest_disturbances:
            name, speed = found.mode.split()[0], found.speed_m_per_s
            ends = [speed - found.speed_uncertainty_m_per_s, speed + found.speed_uncertainty_m_per_s]
            axes.plot(row.value, speed, color=style.COLOUR[name], **SQUARE)
            axes.plot([row.value] * 2, ends, color=style.COLOUR[name], linewidth=0.7, label=f"mode {name}")
            largest = max(largest, *ends)
    axes.set_ylim(0, (1 + ROOM) * largest)
    frame(axes, None, "Smallest disturb-\nance (m/s)")


def shade_ranges(axes: Axes, study: Onset) -> None:
    """Colour the ranges behind what is drawn, and mark the critical values."""
    left, right = axes.get_xlim()
    for each in study.ranges:
        low = left if each.first_uncertainty is None else each.first
        high = right if each.last_uncertainty is None else each.last
        axes.axvspan(low, high, color=SHADES.get(each.kind, OTHER), linewidth=0, zorder=0)
    for boundary in _boundaries(study):
        axes.axvline(boundary, color=style.DARK, linewidth=0.5, linestyle=(0, (4, 3)), zorder=1)


def _boundaries(study: Onset) -> list[float]:
    """The values at which one range goes over into the next."""
    return [each.first for each in study.ranges if each.first_uncertainty is not None]


def _legend(panels: Sequence[Axes], study: OnsetStudy) -> list[Artist]:
    """An entry for everything that the panels name, motions first, and for each kind of range."""
    named: dict[Any, Artist] = {}
    for axes in panels:
        for artist, label in zip(*axes.get_legend_handles_labels(), strict=True):
            named.setdefault(label, artist)
    first = [named.pop(label) for label in FIRST if label in named]
    kinds = dict.fromkeys(each.kind for each in study.ranges)
    return [*first, *named.values(), *(Patch(color=SHADES.get(kind, OTHER), label=kind) for kind in kinds)]


def _growth_limits(study: Onset) -> tuple[float, float]:
    rates = [row.growth_rate for row in study.values if row.growth_rate is not None]
    size = max(max(rates, default=1.0), -min(rates, default=-1.0))
    fastest = max((2 * np.pi * each for mode in study.modes for each in mode.frequency_Hz), default=0.0)
    if size <= UNDAMPED_FRACTION * fastest:
        return -1.0, 1.0  # neither growth nor decay, but round-off
    return min([*rates, 0.0]) - 0.35 * size, max([*rates, 0.0]) + 0.2 * size


def _frequency_limits(study: Onset) -> tuple[float, float]:
    """Of all lines found and of the modes that become critical (kHz); of all modes where there are none."""
    near = [motion.frequency_Hz for row in study.values for motion in row.motions if motion.frequency_Hz]
    near += [each.frequency_Hz for each in study.critical_values if each.frequency_Hz > 0]
    if not near:
        near = [each for mode in study.modes for each in mode.frequency_Hz if np.isfinite(each)]
    return 0.8 * min(near, default=0.5) / 1e3, 1.15 * max(near, default=1.0) / 1e3


DISTURBANCE = (
    "mode",
    "speed_m_per_s",
    "speed_uncertainty_m_per_s",
    "energy_J",
    "energy_uncertainty_J",
    "boundary_ratio",
)
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
    if any(row.smallest_disturbances for row in study.values):
        columns = (
            *(value, Column("along\nmode"), Column(f"velocity of\n{study.rubbing}", ">", unit="m/s")),
            *(Column("energy", ">", unit="J"), Column("times the\nnearer contact\nboundary", ".3g")),
            *_columns(study, f"leads to\n{study.coordinate}"),
        )
        print_cells(console, "Smallest disturbance that starts squeal", columns, _disturbances(study))
    for critical in study.critical_values:
        console.print(critical_words(critical, along))
    for line in study.warnings:
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
        for found in sorted(row.smallest_disturbances, key=lambda each: each.energy_J):
            speed = with_uncertainty(found.speed_m_per_s, found.speed_uncertainty_m_per_s)
            energy = with_uncertainty(found.energy_J, found.energy_uncertainty_J)
            value = study.variation.shown(row.value)
            yield value, found.mode, speed, energy, found.boundary_ratio, *_cells_of(found.leads_to, study)


def onset_table(study: OnsetStudy) -> str:
    """One row a value, as CSV: its kind, the modes, where the small perturbation led, and the motions found.

    The motions stand in the order of what leads to them, the smallest disturbance first.
    """
    modes = {
        mode.label: dict(zip(mode.values, zip(mode.frequency_Hz, mode.growth_rate_1_per_s, strict=True), strict=True))
        for mode in study.modes
    }
    sought = any(row.smallest_disturbances for row in study.values)
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
            cells[f"smallest_disturbance_{name}"] = row.smallest_disturbance and getattr(row.smallest_disturbance, name)
        failed = [f"{each.start}: {each.outcome}" for each in row.starts if each.leads_to is Kind.FAILED]
        cells["note"] = row.no_steady_sliding or "; ".join(failed)
        rows.append(cells)
    return rows_to_csv(rows)


def _cells(which: str, response: Response | None, study: OnsetStudy) -> dict[str, Any]:
    """Where a start led and its motion, as far as there is one."""
    motion = response and response.motion
    return {
        f"{which}_start": response and response.start,
        f"{which}_start_leads_to": response and response.leads_to,
        **_size_cells(which, motion, study),
        f"{which}_simulated_s": response and response.simulated_s,
    }


def _motion_cells(which: str, motion: Attractor | None, study: OnsetStudy) -> dict[str, Any]:
    """A motion and what leads to it, as far as there is one."""
    disturbance = motion and (motion.smallest_disturbance or motion.disturbance)
    return {
        f"{which}_after": motion and start_words(motion, study.variation),
        **_size_cells(which, motion, study),
        f"{which}_disturbance_speed_m_per_s": disturbance and disturbance.speed_m_per_s,
        f"{which}_disturbance_energy_J": disturbance and disturbance.energy_J,
    }


def _size_cells(which: str, motion: SteadyResponse | None, study: OnsetStudy) -> dict[str, Any]:
    """Amplitudes and frequency of a motion, as far as there is one."""
    sizes = {f"{which}_amplitude_{name}_{column_unit(name)}": name for name in study.coordinates}
    found = {key: motion and motion.amplitude[name] for key, name in sizes.items()}
    return found | {f"{which}_frequency_Hz": motion and motion.frequency_Hz}


ONSET = Answer(
    words=print_study, summary="onset.json", tables={"onset.csv": onset_table}, figures={"onset": draw_onset}
)
