"""A measured spectrum over a simulated one, with the predicted frequencies, and how far apart the lines are."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drumsqueal.figures import style
from drumsqueal.figures.placement import extremes, label_top_edge
from drumsqueal.files.measured.record import QUANTITIES
from drumsqueal.signals import level_dB, level_reference
from drumsqueal.studies.measured import LOWEST, MeasuredComparison, Spectral

MEASURED, SIMULATED = style.DARK, style.REVERSED
ABOVE = 1.15  # highest frequency shown over that of the highest line or mode
DEEPEST_DB = 80.0  # below the largest line
HEADROOM_DB, BELOW_DB = 12.0, 10.0
LEAST_SEEN_DB = 40.0  # of the lower spectrum, below its largest line
LEAST_PERCENT = 0.1  # half the height of the lower panel at least


@style.styled()
def draw_comparison(comparison: MeasuredComparison) -> Figure:
    """Draw both spectra in dB over each other and, below, the differences of the lines that are pairs."""
    figure = style.new_figure(
        comparison.scene.title, f"measured {comparison.measured_record.short_name} over the simulation"
    )
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    highest = _highest(comparison)
    upper.set_xlim(0, highest / 1e3)
    _draw_spectra(comparison, upper, highest)
    _draw_differences(comparison, lower)
    nyquist = comparison.measured.sample_rate / 2
    for axes in (upper, lower):
        for mode in comparison.modes:
            if mode.frequency_Hz < highest:
                axes.axvline(mode.frequency_Hz / 1e3, color=style.COLOUR[mode.name], linewidth=0.7, linestyle=":")
        if nyquist < highest:
            axes.axvspan(nyquist / 1e3, highest / 1e3, color=style.PALE, zorder=-1, linewidth=0)
    if nyquist < highest:
        upper.annotate(
            "not measurable",
            ((nyquist + highest) / 2e3, 0.97),
            xycoords=("data", "axes fraction"),
            rotation=90,
            ha="center",
            va="top",
            fontsize=style.SMALL_SIZE,
        )
    shown = [mode for mode in comparison.modes if mode.frequency_Hz < highest]
    label_top_edge(
        upper, [(m.frequency_Hz / 1e3, f"{m.label} {m.frequency_Hz:.0f} Hz", style.COLOUR[m.name]) for m in shown]
    )
    return figure


def _highest(comparison: MeasuredComparison) -> float:
    """Highest frequency shown (Hz)."""
    found = [mode.frequency_Hz for mode in comparison.modes]
    found += [float(f) for record in (comparison.measured, comparison.simulated) for f in record.frequency_Hz]
    top = max(comparison.measured.sample_rate, comparison.simulated.sample_rate) / 2
    return min(top, ABOVE * max(found, default=top))


def _draw_spectra(comparison: MeasuredComparison, axes: Axes, highest: float) -> None:
    records = (comparison.simulated, comparison.measured)
    references = comparison.references[::-1]
    colours, names = (SIMULATED, MEASURED), (comparison.signal, comparison.measured_record.short_name)
    tops, bottoms = [], []
    for record, reference, colour, name in zip(records, references, colours, names, strict=True):
        spectrum = record.tones.spectrum
        seen = (spectrum.frequency_Hz <= highest) & (spectrum.frequency_Hz >= LOWEST)
        level = level_dB(spectrum.amplitude[seen], reference)
        starts, _, largest = extremes(level)
        kind = "simulated" if record is comparison.simulated else "measured"
        axes.plot(
            spectrum.frequency_Hz[seen][starts] / 1e3, largest, color=colour, label=f"{kind}: {_caption(name, record)}"
        )
        tops.append(float(largest.max()))
        bottoms.append(float(np.percentile(largest, 2)))
    for line in comparison.lines:
        axes.plot(
            [line.frequency_Hz / 1e3], [line.level_dB + 3], marker=7, color=MEASURED, markersize=3, linestyle=""
        )  # 7: a triangle that points down to it
        if line.harmonic is not None:
            axes.annotate(
                f"{line.harmonic.order}×",
                (line.frequency_Hz / 1e3, line.level_dB + 3),
                xytext=(0, 3),
                textcoords="offset points",
                color=MEASURED,
                fontsize=style.SMALL_SIZE,
                ha="center",
                va="bottom",
            )
    top = max(tops)
    # However far apart the levels are, the lines of both are seen.
    axes.set_ylim(min(max(min(bottoms) - BELOW_DB, top - DEEPEST_DB), min(tops) - LEAST_SEEN_DB), top + HEADROOM_DB)
    label = "Level (dB re largest line)"
    if comparison.unit:
        reference = level_reference(comparison.unit).written.partition(" (")[0]
        label = f"{QUANTITIES[comparison.unit].capitalize()}, rms (dB re {reference})"
    style.frame(axes, None, label)
    handles, labels = axes.get_legend_handles_labels()
    axes.legend(handles[::-1], labels[::-1], loc="lower left", bbox_to_anchor=(0.0, 1.12), borderaxespad=0, ncols=1)


def _caption(name: str, record: Spectral) -> str:
    factor, unit = style.time_unit(record.end_s)
    resolution = record.tones.spectrum.resolution_Hz
    span = f"{record.start_s * factor:.4g} to {record.end_s * factor:.4g} {unit}"
    return f"{name}, {span}, resolution {resolution:.2g} Hz"


def _draw_differences(comparison: MeasuredComparison, axes: Axes) -> None:
    """Of the pairs alone."""
    axes.axhline(0, color=style.DARK, linewidth=0.6)
    largest = LEAST_PERCENT
    for line in comparison.lines:
        for match, marker in ((line.simulated, "o"), (line.mode, "D")):
            if match is None or not match.paired:
                continue
            colour = SIMULATED if marker == "o" else style.COLOUR[comparison.modes[match.reference].name]
            place = [line.frequency_Hz / 1e3], [100 * match.difference]
            axes.plot(*place, marker, color=colour, markersize=3.5, fillstyle="full" if marker == "o" else "none")
            largest = max(largest, 100 * abs(match.difference))
    axes.set_ylim(-1.3 * largest, 1.3 * largest)
    style.frame(axes, "Frequency (kHz)", "Δf (%) from\n● simulated\n◇ mode")
