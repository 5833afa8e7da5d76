"""What the study of a motion writes, prints and draws: its lines, a Poincaré section, exponents as they converge."""

import math

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console

from drumsqueal.coordinates import column_unit
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.signals.regime import written_frequencies
from drumsqueal.physics.model import at_lining
from drumsqueal.questions.motion.study import MotionStudy, written_exponents
from drumsqueal.terminal import style
from drumsqueal.terminal.reply import Answer
from drumsqueal.terminal.style import label_right_edge
from drumsqueal.terminal.tables import rows_to_csv

LEAST = 0.1  # of the peak-to-peak values, spanned by the axes of a section: a point does not look like a torus
DOT, DOTS = 5.0, 1.5  # points: of a motion that repeats, and of one that does not


def print_study(console: Console, study: MotionStudy) -> None:
    """Print the kind of motion and the evidence."""
    settled = "settled" if study.settled else "decaying" if study.kind is Kind.STEADY else "not settled"
    console.print(f"Recorded from {study.recorded_from_s:.4g} s ({settled}) for {study.recorded_for_s:.4g} s")
    found = study.fundamentals
    if found is not None and found.frequency_Hz.size and study.lines is not None:
        frequencies = written_frequencies(found.frequency_Hz.tolist(), found.uncertainty_Hz.tolist(), 8)
        one, matched = found.frequency_Hz.size == 1, (found.combinations != 0).any(axis=1).sum()
        what = (
            f"frequency {frequencies}: multiples of it" if one else f"frequencies {frequencies}: combinations of them"
        )
        console.print(
            f"Fundamental {what} are {matched} of {study.lines.frequency_Hz.size} lines, "
            f"{100 * found.explained:.3f} % of the variance"
        )
    if study.exponents is not None:
        console.print(f"Lyapunov exponents {', '.join(written_exponents(study.exponents))} 1/s")
    for limit in study.not_determined:
        console.print(f"Limited: {limit}", style="dim")
    unknown = study.kind is Kind.UNDECIDED
    what = "The kind of motion is not determined." if unknown else f"The motion is {study.kind}."
    console.print(f"{what} {study.reason}", style="bold")


def lines_table(study: MotionStudy) -> str:
    """The lines and what they are combinations of, as CSV."""
    lines, fundamentals, rows = study.lines, study.fundamentals, []
    if lines is None or fundamentals is None:
        return rows_to_csv(rows)
    for k in range(lines.frequency_Hz.size):
        integers = fundamentals.combinations[k].tolist()
        row: dict[str, object] = {
            "frequency_Hz": lines.frequency_Hz[k],
            "uncertainty_Hz": lines.uncertainty_Hz[k],
            "share_of_variance": lines.fraction[k],
            "combination": combination(integers),
        }
        row |= {f"k{place}": times for place, times in enumerate(integers, start=1)}
        row |= {
            f"amplitude_{name}_{column_unit(name)}": abs(lines.amplitude[k, c])
            for c, name in enumerate(study.coordinates)
        }
        rows.append(row)
    return rows_to_csv(rows)


def combination(integers: list[int]) -> str:
    """A combination in words: 4f1−f2."""
    words = ""
    for place, times in enumerate(integers, start=1):
        if times:
            sign = "−" if times < 0 else "+" if words else ""
            words += f"{sign}{abs(times) if abs(times) > 1 else ''}f{place}"
    return words


@style.styled()
def draw_lines(study: MotionStudy) -> Figure | None:
    """Draw every line by its fraction of the variance, the strongest with their integers."""
    if study.lines is None or study.fundamentals is None:
        return None
    figure = style.new_figure(study.title, "spectral lines as combinations of the fundamental frequencies")
    axes = figure.subplots()
    frequency, fraction = study.lines.frequency_Hz / 1e3, study.lines.fraction
    matched = np.any(study.fundamentals.combinations != 0, axis=1)
    low = fraction.min() / 3
    for known, colour in ((matched, style.COLOUR["X"]), (~matched, style.SEPARATED)):
        axes.vlines(frequency[known], low, fraction[known], color=colour, linewidth=1.0)
        axes.plot(frequency[known], fraction[known], "o", color=colour, markersize=2.5)
    axes.set_yscale("log")
    axes.set_ylim(low, 30)
    axes.set_xlim(0, None)
    for k in np.flatnonzero(matched)[:14]:  # strongest lines
        axes.annotate(
            combination(study.fundamentals.combinations[k].tolist()),
            (frequency[k], fraction[k]),
            xytext=(0, 4),
            textcoords="offset points",
            rotation=90,
            ha="center",
            va="bottom",
            fontsize=style.SMALL_SIZE,
        )
    fundamentals = zip(study.fundamentals.frequency_Hz, study.fundamentals.uncertainty_Hz, strict=True)
    shown = ", ".join(f"f{k} = {f:.7g} ± {u:.1g} Hz" for k, (f, u) in enumerate(fundamentals, start=1))
    axes.set_title(shown or "no fundamental frequencies", loc="left", fontsize=style.TEXT_SIZE)
    style.frame(axes, "Frequency (kHz)", "Fraction of the variance (coordinates of unit rms)")
    return figure


@style.styled()
def draw_section(study: MotionStudy) -> Figure | None:
    """Draw the Poincaré section, on axes that span a tenth of the motion's size at least."""
    if study.section.values is None or not study.section.points:
        return None
    across, other = study.section.across, study.section.other
    figure = style.new_figure(study.title, f"Poincaré section where {across} rises through its mean")
    axes = figure.subplots()
    kinds = at_lining(study.scene, other), at_lining(study.scene, across, math.inf)
    factors, units, shown = zip(*kinds, strict=True)
    points = study.section.values * factors
    size, spread = np.array(study.section.size) * factors, np.ptp(points, axis=0)
    width = DOTS if np.any(spread > LEAST / 10 * size) else DOT
    axes.plot(points[:, 0], points[:, 1], ".", color=style.COLOUR[across], markersize=width, markeredgewidth=0)
    middle, half = points.min(axis=0) + spread / 2, np.maximum(0.6 * spread, LEAST / 2 * size)
    axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
    axes.set_ylim(middle[1] - half[1], middle[1] + half[1])
    within = f"{len(points)} points within {100 * np.max(spread / size):.2g} % of the motion's peak-to-peak values"
    axes.set_title(within, loc="left", fontsize=style.SMALL_SIZE)
    style.frame(axes, f"{shown[0]} ({units[0]})", f"Velocity of {shown[1]} ({units[1]}/s)")
    return figure


@style.styled()
def draw_convergence(study: MotionStudy) -> Figure | None:
    """Draw the running means of the Lyapunov exponents."""
    exponents = study.exponents
    if exponents is None:
        return None
    figure = style.new_figure(study.title, "Lyapunov exponents as they converge")
    axes = figure.subplots()
    labels = []
    for k, (colour, shown) in enumerate(zip(("Tz", "X", "Y", "Tx"), written_exponents(exponents), strict=False)):
        axes.plot(exponents.time_s, exponents.running_1_per_s[:, k], color=style.COLOUR[colour])
        labels.append((float(exponents.exponent_1_per_s[k]), shown, style.COLOUR[colour]))
    axes.axhline(0, color=style.DARK, linewidth=0.6)
    late = exponents.running_1_per_s[len(exponents.time_s) // 5 :]
    room = 0.1 * float(np.ptp(late)) + 0.5
    axes.set_ylim(min(float(late.min()), 0.0) - room, max(float(late.max()), 0.0) + room)
    label_right_edge(axes, labels, reach=6.0)
    style.frame(axes, "Time followed (s)", "Mean growth of nearby motions until then (1/s)")
    return figure


MOTION = Answer(
    words=print_study,
    summary="motion.json",
    tables={"motion.csv": lines_table},
    figures={"motion_lines": draw_lines, "motion_section": draw_section, "motion_exponents": draw_convergence},
)
