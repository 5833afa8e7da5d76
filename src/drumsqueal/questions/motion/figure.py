"""The kind of a motion: its lines with what they are combinations of, a section, and the exponents as they converge."""

import numpy as np
from matplotlib.figure import Figure

from drumsqueal.findings.vibration import unit_of
from drumsqueal.questions.motion.attractor import written_exponents
from drumsqueal.questions.motion.study import MotionStudy
from drumsqueal.terminal import style
from drumsqueal.terminal.placement import label_right_edge

LABELLED = 14  # strongest lines
LEAST = 0.1  # of the motion's peak-to-peak values, which the axes of a section span: a point is not made a torus
DOT, DOTS = 5.0, 1.5  # points: of a motion that comes back, and of one that does not
COLOURS = ("Tz", "X", "Y", "Tx")


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
    figure = style.new_figure(study.title, "lines of the motion, and what they are combinations of")
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
    if study.fundamentals.frequency_Hz.size:
        for k in np.flatnonzero(matched)[:LABELLED]:
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
    style.frame(axes, "Frequency (kHz)", "Share of the variance (coordinates of unit rms)")
    return figure


@style.styled()
def draw_section(study: MotionStudy) -> Figure | None:
    """Draw the Poincaré section, on axes that span a tenth of the motion's size at least."""
    if study.section.values is None or not study.section.points:
        return None
    across, other = study.section.across, study.section.other
    figure = style.new_figure(study.title, f"section where {across} goes up through its mean")
    axes = figure.subplots()
    factors = [1e6, 1.0]
    units = [unit_of(other, "µ"), f"{unit_of(across)}/s"]
    points = study.section.values * factors
    size, spread = np.array(study.section.size) * factors, np.ptp(points, axis=0)
    width = DOTS if np.any(spread > LEAST / 10 * size) else DOT
    axes.plot(points[:, 0], points[:, 1], ".", color=style.COLOUR[across], markersize=width, markeredgewidth=0)
    middle, half = points.min(axis=0) + spread / 2, np.maximum(0.6 * spread, LEAST / 2 * size)
    axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
    axes.set_ylim(middle[1] - half[1], middle[1] + half[1])
    shown = f"{len(points)} points within {100 * np.max(spread / size):.2g} % of the motion's peak-to-peak values"
    axes.set_title(shown, loc="left", fontsize=style.SMALL_SIZE)
    style.frame(axes, f"{other} ({units[0]})", f"Velocity of {across} ({units[1]})")
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
    for k, (colour, shown) in enumerate(zip(COLOURS, written_exponents(exponents), strict=False)):
        axes.plot(exponents.time_s, exponents.running_1_per_s[:, k], color=style.COLOUR[colour])
        labels.append((float(exponents.exponent_1_per_s[k]), shown, style.COLOUR[colour]))
    axes.axhline(0, color=style.DARK, linewidth=0.6)
    late = exponents.running_1_per_s[len(exponents.time_s) // 5 :]
    room = 0.1 * float(np.ptp(late)) + 0.5
    axes.set_ylim(min(float(late.min()), 0.0) - room, max(float(late.max()), 0.0) + room)
    label_right_edge(axes, labels, reach=6.0)
    style.frame(axes, "Time followed (s)", "Mean growth of nearby motions until then (1/s)")
    return figure
