"""What a comparison with a measured record writes and prints."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.markers import CARETDOWN
from rich.console import Console

from drumsqueal.coordinates import largest_of
from drumsqueal.findings.signals.sound import level_dB
from drumsqueal.questions.compare.record import QUANTITIES
from drumsqueal.questions.compare.study import (
    LOWEST,
    PRINTED,
    MeasuredComparison,
    MeasuredLine,
    Spectral,
    describe_record,
    describe_table,
    describe_unpaired,
    zero_level,
)
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal import style
from drumsqueal.terminal.reply import Answer
from drumsqueal.terminal.style import extremes, label_top_edge
from drumsqueal.terminal.tables import print_rows, rows_to_csv

# A measured spectrum over a simulated one, with the predicted frequencies, and how far apart the lines are.


MEASURED, _SIMULATED = style.DARK, style.REVERSED
_DEEPEST_DB = 80.0  # below the largest line
_HEADROOM_DB, _BELOW_DB = 12.0, 10.0
_LEAST_SEEN_DB = 40.0  # of the lower spectrum, below its largest line
_ALONG_TOP: Any = {"xycoords": ("data", "axes fraction"), "fontsize": style.SMALL_SIZE, "ha": "center", "va": "top"}


@style.styled()
def draw_comparison(comparison: MeasuredComparison) -> Figure:
    """Draw both spectra in dB over each other and, below, the differences of the lines that are pairs."""
    figure = style.new_figure(comparison.scene.title, f"measured {comparison.measured.short_name} over the simulation")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    highest, nyquist = _highest(comparison), comparison.measured.sample_rate_Hz / 2
    upper.set_xlim(0, highest / 1e3)
    _draw_spectra(comparison, upper, highest)
    _draw_differences(comparison, lower)
    modes = [mode for mode in comparison.modes if mode.frequency_Hz < highest]
    for axes in (upper, lower):
        for mode in modes:
            axes.axvline(mode.frequency_Hz / 1e3, color=style.COLOUR[mode.label], linewidth=0.7, linestyle=":")
        if nyquist < highest:
            axes.axvspan(nyquist / 1e3, highest / 1e3, color=style.PALE, zorder=-1, linewidth=0)
    if nyquist < highest:
        place = (nyquist + highest) / 2e3, 0.97
        upper.annotate("not measurable", place, rotation=90, **_ALONG_TOP)
    _label_harmonics(comparison, upper)
    named, _ = largest_of({mode.label: mode.growth_rate_1_per_s for mode in modes})
    labels = [(m.frequency_Hz / 1e3, f"{m.label} {m.frequency_Hz:.0f} Hz", style.COLOUR[m.label]) for m in modes]
    label_top_edge(upper, [each for each, mode in zip(labels, modes, strict=True) if mode.label in named])
    return figure


def _highest(comparison: MeasuredComparison) -> float:
    """Highest frequency shown (Hz)."""
    found = [mode.frequency_Hz for mode in comparison.modes]
    found += [float(f) for record in (comparison.measured, comparison.simulated) for f in record.frequency_Hz]
    top = max(comparison.measured.sample_rate_Hz, comparison.simulated.sample_rate_Hz) / 2
    return min(top, 1.15 * max(found, default=top))  # highest frequency shown over that of the highest line or mode


def _draw_spectra(comparison: MeasuredComparison, axes: Axes, highest: float) -> None:
    measured, simulated, fundamental = comparison.measured, comparison.simulated, _fundamental(comparison)
    harmonics = "" if fundamental is None else f"; 2×, 3× …: harmonics of {fundamental:.1f} Hz"
    labels = (
        f"simulated: {_caption(simulated.signal, simulated)}",
        f"measured: {_caption(measured.short_name, measured)}",
    )
    # The wider, paler one below is seen where the two are the same.
    looks: tuple[dict[str, Any], ...] = (
        {"label": labels[0], "color": _SIMULATED, "linewidth": 1.8, "alpha": 0.55},
        {"label": f"{labels[1]}{harmonics}", "color": MEASURED, "linewidth": 0.8},
    )
    tops, bottoms = [], []
    for record, which, look in zip((simulated, measured), ("simulated", "measured"), looks, strict=True):
        spectrum = record.tones.spectrum
        seen = (spectrum.frequency_Hz <= highest) & (spectrum.frequency_Hz >= LOWEST)
        starts, _, largest = extremes(level_dB(spectrum.amplitude[seen], comparison.rms_of_0_dB[which]))
        axes.plot(spectrum.frequency_Hz[seen][starts] / 1e3, largest, **look)
        tops.append(float(largest.max()))
        bottoms.append(float(np.percentile(largest, 2)))
    for line in comparison.lines:
        place = [line.measured_Hz / 1e3], [line.level_dB + 3.0]  # of the mark over its line
        axes.plot(*place, marker=CARETDOWN, color=MEASURED, markersize=3, linestyle="")
    top = max(tops)
    # However far apart the levels are, the lines of both are seen.
    axes.set_ylim(min(max(min(bottoms) - _BELOW_DB, top - _DEEPEST_DB), min(tops) - _LEAST_SEEN_DB), top + _HEADROOM_DB)
    label = "Level (dB re largest line)"
    if comparison.amplitudes_in:
        label = f"{QUANTITIES[comparison.amplitudes_in].capitalize()}, rms (dB re {zero_level(comparison)})"
    style.frame(axes, None, label)
    handles, names = axes.get_legend_handles_labels()
    axes.legend(handles[::-1], names[::-1], loc="lower left", bbox_to_anchor=(0.0, 1.12), borderaxespad=0, ncols=1)


def _fundamental(comparison: MeasuredComparison) -> float | None:
    """The strongest line that has harmonics (Hz): theirs are labelled in the figure."""
    found = {line.fundamental_Hz for line in comparison.lines if not line.fundamental_is_simulated}
    return next((line.measured_Hz for line in comparison.lines if line.measured_Hz in found), None)


def _label_harmonics(comparison: MeasuredComparison, axes: Axes) -> None:
    """Orders in a row along the top, over their lines, as many as have room."""
    fundamental, (lowest, highest) = _fundamental(comparison), axes.get_xlim()
    of_it = [line for line in comparison.lines if line.harmonic_order and line.fundamental_Hz == fundamental]
    taken = -np.inf
    for line in sorted(of_it, key=lambda line: line.measured_Hz):
        place = line.measured_Hz / 1e3
        if place - taken >= 0.025 * (highest - lowest) and place < highest:  # of the width, between two orders
            behind = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}  # over the line of a mode
            axes.annotate(f"{line.harmonic_order}×", (place, 0.99), color=MEASURED, bbox=behind, **_ALONG_TOP)
            taken = place


def _caption(name: str, record: Spectral) -> str:
    factor, unit = style.time_unit(record.until_s)
    span = f"{record.from_s * factor:.4g} to {record.until_s * factor:.4g} {unit}"
    return f"{name}, {span}, resolution {float(f'{record.resolution_Hz:.2g}'):g} Hz"


def _draw_differences(comparison: MeasuredComparison, axes: Axes) -> None:
    """Of the pairs alone."""
    axes.axhline(0, color=style.DARK, linewidth=0.6)
    largest = 0.1  # half the height of the lower panel at least
    for line in comparison.lines:
        look: dict[str, Any] = {"marker": "o", "color": _SIMULATED}
        for difference, paired in ((line.over_simulated, line.simulated_is_pair), (line.over_mode, line.mode_is_pair)):
            if difference is not None and paired:
                axes.plot([line.measured_Hz / 1e3], [100 * difference], markersize=3.5, linestyle="", **look)
                largest = max(largest, 100 * abs(difference))
            look = {"marker": "D", "color": line.nearest_mode and style.COLOUR[line.nearest_mode], "fillstyle": "none"}
    axes.set_ylim(-1.3 * largest, 1.3 * largest)
    style.frame(axes, "Frequency (kHz)", "Δf (%) from\n● simulated\n◇ mode")


def print_comparison(console: Console, comparison: MeasuredComparison) -> None:
    """Print every measured line with the nearest simulated one and the nearest eigenvalue, and the verdict."""
    measured, simulated = comparison.measured, comparison.simulated
    if comparison.lines:
        _print_table(console, comparison)
    console.print(printable(f"Measured: {measured.short_name}, {describe_record(measured)}"), style="dim")
    console.print(printable(f"Simulated: {simulated.signal}, {describe_record(simulated)}"), style="dim")
    for sentence in (*(f"Note: {note}" for note in comparison.notes), *describe_unpaired(comparison)):
        console.print(printable(sentence))
    console.print(printable(comparison.verdict), style="bold")


def _print_table(console: Console, comparison: MeasuredComparison) -> None:
    """Print the lines, and what the headings mean."""
    zero = zero_level(comparison) or "largest"
    print_rows(console, "Measured lines", MeasuredLine, comparison.lines[:PRINTED], zero=zero)
    if len(comparison.lines) > PRINTED:
        console.print(f"and {len(comparison.lines) - PRINTED} weaker ones, in the table", style="dim")
    console.print(describe_table(comparison), style="dim")


def to_csv(comparison: MeasuredComparison) -> str:
    """One row for every measured line, for every simulated one without a pair, and for every mode without one."""
    rows, columns = comparison.rows(comparison.lines), dict.fromkeys(comparison.columns.values())
    for line in comparison.simulated_alone:
        why = "not measurable" if line.not_measurable else "not measured"
        rows.append(columns | {"line": f"simulated, {why}", "nearest_simulated_Hz": line.frequency_Hz})
    paired = {line.nearest_mode for line in comparison.lines if line.mode_is_pair}
    for mode in comparison.modes:
        if mode.label not in paired:
            why = "not measurable" if mode.not_measurable else "not measured"
            named = {"nearest_mode": mode.label, "nearest_mode_Hz": mode.frequency_Hz}
            rows.append(columns | {"line": f"predicted, {why}"} | named)
    return rows_to_csv(rows)


COMPARED = Answer(
    words=print_comparison,
    summary="compare.json",
    tables={"compare.csv": to_csv},
    figures={"compare": draw_comparison},
)
