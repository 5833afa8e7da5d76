"""A measured spectrum over a simulated one, with the predicted frequencies, and how far apart the lines are."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drumsqueal.findings.signals.decibels import level_dB
from drumsqueal.questions.compare.measured.record import QUANTITIES
from drumsqueal.questions.compare.study import LOWEST, MeasuredComparison, Spectral
from drumsqueal.questions.compare.words import zero_level
from drumsqueal.terminal import style
from drumsqueal.terminal.placement import extremes, label_top_edge

MEASURED, SIMULATED = style.DARK, style.REVERSED
ABOVE = 1.15  # highest frequency shown over that of the highest line or mode
DEEPEST_DB = 80.0  # below the largest line
HEADROOM_DB, BELOW_DB = 12.0, 10.0
LEAST_SEEN_DB = 40.0  # of the lower spectrum, below its largest line
OVER_DB = 3.0  # of the mark over its line
LABEL_ROOM = 0.025  # of the width, between two orders
LEAST_PERCENT = 0.1  # half the height of the lower panel at least


@style.styled()
def draw_comparison(comparison: MeasuredComparison) -> Figure:
    """Draw both spectra in dB over each other and, below, the differences of the lines that are pairs."""
    figure = style.new_figure(comparison.scene.title, f"measured {comparison.measured.short_name} over the simulation")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    highest = _highest(comparison)
    upper.set_xlim(0, highest / 1e3)
    _draw_spectra(comparison, upper, highest)
    _draw_differences(comparison, lower)
    nyquist = comparison.measured.sample_rate_Hz / 2
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
    _label_harmonics(comparison, upper)
    label_top_edge(
        upper, [(m.frequency_Hz / 1e3, f"{m.label} {m.frequency_Hz:.0f} Hz", style.COLOUR[m.name]) for m in shown]
    )
    return figure


def _highest(comparison: MeasuredComparison) -> float:
    """Highest frequency shown (Hz)."""
    found = [mode.frequency_Hz for mode in comparison.modes]
    found += [float(f) for record in (comparison.measured, comparison.simulated) for f in record.frequency_Hz]
    top = max(comparison.measured.sample_rate_Hz, comparison.simulated.sample_rate_Hz) / 2
    return min(top, ABOVE * max(found, default=top))


def _draw_spectra(comparison: MeasuredComparison, axes: Axes, highest: float) -> None:
    records, fundamental = (comparison.simulated, comparison.measured), _fundamental(comparison)
    references = [comparison.rms_of_0_dB[which] for which in ("simulated", "measured")]
    colours, names = (SIMULATED, MEASURED), (comparison.simulated.signal, comparison.measured.short_name)
    tops, bottoms = [], []
    for record, reference, colour, name in zip(records, references, colours, names, strict=True):
        spectrum = record.tones.spectrum
        seen = (spectrum.frequency_Hz <= highest) & (spectrum.frequency_Hz >= LOWEST)
        level = level_dB(spectrum.amplitude[seen], reference)
        starts, _, largest = extremes(level)
        kind = "simulated" if record is comparison.simulated else "measured"
        label = f"{kind}: {_caption(name, record)}"
        if record is comparison.measured and fundamental is not None:
            label += f"; 2×, 3× …: harmonics of {fundamental:.1f} Hz"
        # The wider, paler one below is seen where the two are the same.
        width, alpha = (1.8, 0.55) if record is comparison.simulated else (0.8, 1.0)
        axes.plot(
            spectrum.frequency_Hz[seen][starts] / 1e3, largest, color=colour, label=label, linewidth=width, alpha=alpha
        )
        tops.append(float(largest.max()))
        bottoms.append(float(np.percentile(largest, 2)))
    for line in comparison.matched:
        axes.plot(
            [line.frequency_Hz / 1e3], [line.level_dB + OVER_DB], marker=7, color=MEASURED, markersize=3, linestyle=""
        )  # 7: a triangle that points down to it
    top = max(tops)
    # However far apart the levels are, the lines of both are seen.
    axes.set_ylim(min(max(min(bottoms) - BELOW_DB, top - DEEPEST_DB), min(tops) - LEAST_SEEN_DB), top + HEADROOM_DB)
    label = "Level (dB re largest line)"
    if comparison.amplitudes_in:
        label = f"{QUANTITIES[comparison.amplitudes_in].capitalize()}, rms (dB re {zero_level(comparison)})"
    style.frame(axes, None, label)
    handles, labels = axes.get_legend_handles_labels()
    axes.legend(handles[::-1], labels[::-1], loc="lower left", bbox_to_anchor=(0.0, 1.12), borderaxespad=0, ncols=1)


def _fundamental(comparison: MeasuredComparison) -> float | None:
    """The strongest line that has harmonics (Hz): theirs are labelled in the figure."""
    found = {
        line.harmonic.fundamental_Hz for line in comparison.matched if line.harmonic and not line.harmonic.simulated
    }
    return next((line.frequency_Hz for line in comparison.matched if line.frequency_Hz in found), None)


def _label_harmonics(comparison: MeasuredComparison, axes: Axes) -> None:
    """Orders in a row along the top, over their lines, as many as have room."""
    fundamental, (lowest, highest) = _fundamental(comparison), axes.get_xlim()
    orders = {
        line.harmonic.order: line.frequency_Hz / 1e3
        for line in comparison.matched
        if line.harmonic is not None and line.harmonic.fundamental_Hz == fundamental
    }
    taken = -np.inf
    for order, place in sorted(orders.items()):
        if place - taken >= LABEL_ROOM * (highest - lowest) and place < highest:
            axes.annotate(
                f"{order}×",
                (place, 0.99),
                xycoords=("data", "axes fraction"),
                color=MEASURED,
                fontsize=style.SMALL_SIZE,
                ha="center",
                va="top",
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6},  # over the line of a mode
            )
            taken = place


def _caption(name: str, record: Spectral) -> str:
    factor, unit = style.time_unit(record.until_s)
    span = f"{record.from_s * factor:.4g} to {record.until_s * factor:.4g} {unit}"
    return f"{name}, {span}, resolution {record.resolution_Hz:.2g} Hz"


def _draw_differences(comparison: MeasuredComparison, axes: Axes) -> None:
    """Of the pairs alone."""
    axes.axhline(0, color=style.DARK, linewidth=0.6)
    largest = LEAST_PERCENT
    for line in comparison.matched:
        for match, marker in ((line.simulated, "o"), (line.mode, "D")):
            if match is None or not match.paired:
                continue
            colour = SIMULATED if marker == "o" else style.COLOUR[comparison.modes[match.reference].name]
            place = [line.frequency_Hz / 1e3], [100 * match.difference]
            axes.plot(*place, marker, color=colour, markersize=3.5, fillstyle="full" if marker == "o" else "none")
            largest = max(largest, 100 * abs(match.difference))
    axes.set_ylim(-1.3 * largest, 1.3 * largest)
    style.frame(axes, "Frequency (kHz)", "Δf (%) from\n● simulated\n◇ mode")
