"""What the search for a cycle, and cycles along a parameter, draw, write and print."""

from collections.abc import Callable, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullFormatter
from rich.console import Console

from drumsqueal.coordinates import MOST_SHOWN, at_surface, column_unit, is_elastic, largest_of
from drumsqueal.dynamics.cycles.cycle import NEUTRAL, BranchEnd, Cycle, CycleBranch, Diagram, Event, RangeKind
from drumsqueal.errors import COMPLETE
from drumsqueal.findings.columns import Column
from drumsqueal.findings.history import to_dataset
from drumsqueal.findings.squeals import Interval
from drumsqueal.findings.vibration import characteristic_lengths
from drumsqueal.physics.model import at_lining
from drumsqueal.questions.cycle.study import CycleBranches, CycleStudy, describe_briefly, end_words, missing_words
from drumsqueal.questions.run.figures.contact import along_arc
from drumsqueal.questions.run.figures.modes import STABLE as STABLE_COLOUR
from drumsqueal.questions.run.figures.modes import UNSTABLE as UNSTABLE_COLOUR
from drumsqueal.terminal import style
from drumsqueal.terminal.reply import Answer
from drumsqueal.terminal.style import frame, new_figure, styled, tick_in_units
from drumsqueal.terminal.tables import print_cells, rows_to_csv

MICRO = 1e6
LEGEND: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.2}  # above the frame
MARKERS = dict(zip(Event, "s^vPxoD*", strict=True))
SPECIAL: dict[str, Any] = {"color": style.DARK, "markersize": 4, "markerfacecolor": "white"}
# Of different lightness, too, for print without colours.
SHADES = {
    RangeKind.STABLE: STABLE_COLOUR,
    RangeKind.NEUTRAL: "#E3EEDC",
    RangeKind.BISTABLE: "#F2E6CC",
    RangeKind.SQUEALS: UNSTABLE_COLOUR,
}
OTHER = style.PALE
DASHES = (0, (3, 2))  # of unstable cycles
STABLE_CYCLE, UNSTABLE_CYCLE = "stable limit cycle", "unstable limit cycle"
WIDE, FAR = 3, 100  # ratios of amplitudes: for a log axis, and for its ticks to be decades alone
SEEN = 0.01  # of the width, and of an amplitude: what is shorter is no line of the figure, as next to a corner


@styled()
def draw_cycle(cycle: CycleStudy) -> Figure:
    """Draw u̇_θ against u_θ at the middle of the lining, the displacements, and the contact along the arc."""
    kind = "stable" if cycle.stable else "unstable"
    figure = new_figure(cycle.title, f"{kind} limit cycle of {cycle.frequency_Hz:.6g} Hz")
    grid = figure.add_gridspec(2, 2, width_ratios=[1, 1.25])
    draw_portrait(figure.add_subplot(grid[:, 0]), cycle)
    above = figure.add_subplot(grid[0, 1])
    _draw_displacements(above, cycle)
    _draw_contact(figure.add_subplot(grid[1, 1], sharex=above), cycle)
    above.tick_params(labelbottom=False)
    return figure


def draw_portrait(axes: Axes, cycle: Cycle) -> None:
    """Velocity over displacement at the middle of the lining, with the speed of the drum."""
    samples, shape = cycle.samples, cycle.samples.time.shape
    states = (dict(zip(cycle.names, each.T, strict=True)) for each in (samples.displacement, samples.velocity))
    moved, speed = (np.broadcast_to(cycle.model.lining.body.over_drum(q, 0.0)[1], shape) for q in states)
    axes.plot(MICRO * moved, speed, color=style.DARK, linewidth=1.0)
    limit = float(cycle.model.shoe.outer_radius * cycle.model.operation.at(0.0).drum_speed)
    label = f"slip limit RΩ = {limit:.3g} m/s"
    # The slip limit is drawn where the motion comes to 0.3 of it.
    if np.abs(speed).max() <= 0.3 * abs(limit):
        axes.plot([], [], linestyle="", label=f"{label}, outside the frame")
    else:
        axes.axhline(limit, color=style.REVERSED, linewidth=0.9, linestyle="--", label=label)
    axes.legend(**LEGEND)
    frame(axes, r"Displacement $u_\theta$, middle of the lining (µm)", r"Velocity $\dot u_\theta$ (m/s)")


def _draw_displacements(axes: Axes, cycle: Cycle) -> None:
    """All in µm at the drum's surface."""
    values = MICRO * cycle.samples.displacement * characteristic_lengths(cycle.names, cycle.model.shoe)
    sizes = dict(zip(cycle.names, np.ptp(values, axis=0).tolist(), strict=True))
    shown, others = largest_of({name: size for name, size in sizes.items() if size > 0})
    for k, name in enumerate(cycle.names):
        if name in shown:
            axes.plot(_time(cycle), values[:, k], color=style.COLOUR[name], label=at_surface(name))
    if others:
        axes.plot([], [], linestyle="", label=f"{len(others)} more move less")
    axes.set_xlim(0, _time(cycle)[-1])
    axes.legend(ncols=min(len(cycle.names), 6), **LEGEND)
    frame(axes, None, "Displacement (µm)")


def _time(cycle: Cycle) -> np.ndarray:
    """In ms."""
    return 1e3 * (cycle.samples.time - cycle.samples.time[0])


def _draw_contact(axes: Axes, cycle: Cycle) -> None:
    half = float(cycle.model.shoe.half_angle)
    angles = np.linspace(-half, half, 160)  # as many as the picture of the contact shows
    motion = np.concatenate([cycle.samples.displacement, cycle.samples.velocity], axis=1)
    arguments = (cycle.samples.time, motion, angles)
    level, slip, _ = (np.asarray(part).T for part in along_arc(cycle.model, *map(jnp.asarray, arguments)))
    extent, handles = (_time(cycle), np.rad2deg(angles)), [Patch(color=style.TOUCHING, label="touches and slips")]
    axes.set_facecolor(style.TOUCHING)
    states = [(slip, style.REVERSED, "slip reversed", cycle.model.contact.friction is not None)]
    states.append((-level, style.SEPARATED, "lifted off", float(cycle.model.contact.lifting_stiffness) > 0))
    for values, colour, name, possible in states:
        if possible and values.max() > 0:
            axes.contourf(*extent, values, levels=[0.0, 2 * values.max()], colors=[colour])
            handles.append(Patch(color=colour, label=name))
    axes.set_ylim(extent[1][0], extent[1][-1])
    axes.legend(handles=handles, ncols=3, **LEGEND)
    frame(axes, "Time (ms)", "Angle θ along\nthe arc (degrees)")


@styled()
def draw_branch(found: CycleBranches) -> Figure:
    """Draw half the peak-to-peak value of the coordinate that becomes unstable first, and the frequency."""
    variation, span = found.parameter.variation, found.parameter
    figure = new_figure(found.title, f"limit cycles along {variation.key}")
    amplitude, frequency = figure.subplots(2, 1, sharex=True, height_ratios=[1.6, 1])
    margin = 0.012 * (span.high - span.low)
    amplitude.set_xlim(span.low - margin, span.high + margin)
    name = main_coordinate(found)
    colour, (factor, unit, shown) = style.COLOUR[name], at_lining(found.scene, name)
    for axes in (amplitude, frequency):
        _shade(axes, found)
    draw_with_events(amplitude, found, colour, lambda cycle: factor * cycle.amplitude[name])
    draw_with_events(frequency, found, colour, lambda cycle: cycle.frequency_Hz)
    sizes = [factor * cycle.amplitude[name] for branch in found.branches for cycle in branch.cycles]
    # 0.08 of the height is left above the largest amplitude.
    rest = limit_amplitudes(amplitude, sizes, 0.08)
    for spans, line in ((found.steady_sliding_stable, "-"), (found.steady_sliding_unstable, DASHES)):
        for each in spans:
            amplitude.plot(each, [rest, rest], color=style.DARK, linewidth=1.6, linestyle=line, clip_on=False, zorder=3)
    for critical in found.critical_values:
        for axes, value in ((amplitude, rest), (frequency, critical.frequency_Hz)):
            axes.plot(critical.value, value, "D", color=style.DARK, markersize=4, clip_on=False, zorder=5)
    tick_in_units(frequency.xaxis, variation.size)
    frame(amplitude, None, f"{shown}, half peak to peak ({unit})")
    frame(frequency, variation.label, "Frequency (Hz)")
    figure.align_ylabels([amplitude, frequency])
    figure.legend(handles=_legend(found, colour), loc="outside lower center", ncols=4)
    return figure


def main_coordinate(found: CycleBranches) -> str:
    """The coordinate of the first Hopf point or, without one that moves, that with most energy in most cycles."""
    cycles = [cycle for branch in found.branches for cycle in branch.cycles]
    critical = [each.label.split()[0] for each in found.critical_values]
    main = [cycle.main_coordinate for cycle in cycles]
    return next((name for name in critical if name in cycles[0].names), max(main, key=main.count))


def draw_with_events(axes: Axes, diagram: Diagram, colour: str, measure: Callable[[Cycle], float]) -> None:
    """Draw what is measured of the cycles over the parameter, and mark where something happens."""
    draw_cycles(axes, diagram, colour, measure)
    for branch in diagram.branches:
        for special in branch.special:
            if special.what is not None:
                axes.plot(special.value, measure(special), marker=MARKERS[special.what], zorder=4, **SPECIAL)


def draw_cycles(axes: Axes, diagram: Diagram, colour: str, measure: Callable[[Cycle], float]) -> None:
    """Draw what is measured of the cycles over the parameter, unstable ones dashed."""
    for branch in diagram.branches:
        for cycles, stable in branch.pieces():
            values = [cycle.value for cycle in cycles]
            shown = [measure(cycle) for cycle in cycles]
            label, line = (STABLE_CYCLE, "-") if stable else (UNSTABLE_CYCLE, DASHES)
            seen = np.ptp(values) > SEEN * np.ptp(axes.get_xlim()) or np.ptp(shown) > SEEN * max(shown)
            label = label if seen else None
            axes.plot(values, shown, color=colour, linewidth=1.2, linestyle=line, label=label, zorder=1.5)


def limit_amplitudes(axes: Axes, amplitudes: list[float], room: float) -> float:
    """Set the limits, of a log axis where amplitudes lie far apart, with `room` above; returns where zero is drawn.

    On a log axis zero, steady sliding, has a place of its own below the smallest amplitude, with a tick.
    """
    smallest, largest = min(amplitudes, default=1.0), max(amplitudes, default=1.0)
    if smallest <= 0 or largest < WIDE * smallest:
        axes.set_ylim(0, (1 + room) * largest if largest > 0 else 1.0)
        return 0.0
    # On a log axis, zero stands at half of the smallest amplitude.
    rest = smallest / 2
    axes.set_yscale("log")
    axes.set_ylim(rest, largest * (largest / rest) ** room)
    steps = (1.0,) if largest > FAR * smallest else (1.0, 2.0, 5.0)
    ticks = [at for at in LogLocator(subs=steps).tick_values(rest, largest) if smallest / 1.2 < at < largest * 1.2]
    axes.set_yticks([rest, *ticks], ["0", *(f"{at:.6g}" for at in ticks)])
    between = LogLocator(subs=tuple(range(2, 10))).tick_values(rest, largest)
    axes.set_yticks([at for at in between if smallest / 1.2 < at < largest * 1.2], minor=True)
    axes.yaxis.set_minor_formatter(NullFormatter())
    return rest


def _shade(axes: Axes, diagram: Diagram) -> None:
    for kind, spans in _ranges(diagram).items():  # not beyond the range, where nothing is known
        for low, high in spans:
            axes.axvspan(low, high, color=SHADES.get(kind, OTHER), linewidth=0, zorder=0)


def _ranges(diagram: Diagram) -> dict[RangeKind, Sequence[Interval]]:
    return {
        RangeKind.STABLE: diagram.steady_sliding_stable,
        RangeKind.UNDECIDED: diagram.squeals_unknown,  # over what is stable, where a cycle may be, too
        RangeKind.BISTABLE: diagram.squeals_only_when_disturbed,
        RangeKind.SQUEALS: diagram.steady_sliding_unstable,
    }


def _legend(found: CycleBranches, colour: str) -> list[Line2D | Patch]:
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=colour, label="stable cycle"),
        Line2D([], [], color=colour, linestyle=DASHES, label="unstable cycle"),
        Line2D([], [], color=style.DARK, linewidth=1.4, label="steady sliding (dashed: unstable)"),
    ]
    if found.critical_values:
        handles.append(Line2D([], [], marker="D", color=style.DARK, linestyle="", markersize=4, label="Hopf point"))
    kinds = dict.fromkeys(special.what for branch in found.branches for special in branch.special if special.what)
    handles += [Line2D([], [], marker=MARKERS[kind], linestyle="", label=kind, **SPECIAL) for kind in kinds]
    present = _ranges(found)
    stable, bistable = present[RangeKind.STABLE], present[RangeKind.BISTABLE]
    # The same but for what Newton's method leaves of the ends of the range.
    if len(stable) == len(bistable) and np.allclose(stable, bistable, rtol=1e-9):
        del present[RangeKind.STABLE]
    return handles + [Patch(color=SHADES.get(kind, OTHER), label=kind) for kind, spans in present.items() if spans]


def print_cycle(console: Console, found: CycleStudy) -> None:
    """Print amplitudes, multipliers, how accurate they are, the other cycles, and the verdict."""
    lengths = found.model.body.characteristic_lengths() if any(map(is_elastic, found.amplitude)) else None
    shown = {name: at_lining(lengths, name) for name in found.amplitude}
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
    reach = cycles[0].model.shoe.characteristic_lengths()
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
