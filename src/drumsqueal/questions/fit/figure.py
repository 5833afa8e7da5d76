"""The measured spectrum with the predicted lines before and after the fit, and how far off they are."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drumsqueal.findings.signals.decibels import level_dB
from drumsqueal.findings.signals.spectra import amplitude_spectrum
from drumsqueal.questions.fit.found import Fit, FittedLine
from drumsqueal.questions.fit.record import LOWEST, Kind
from drumsqueal.terminal import style
from drumsqueal.terminal.placement import extremes, label_top_edge

BEFORE, AFTER = style.SEPARATED, style.REVERSED
ABOVE = 1.15  # highest frequency shown over that of the highest line
DEEPEST_DB, HEADROOM_DB = 90.0, 6.0
LEAST_PERCENT = 1e-3  # of a deviation, on the logarithmic axis


@style.styled()
def draw_fit(fit: Fit) -> Figure | None:
    """Draw the spectrum of the part that was used with both predictions; below, their deviations in per cent."""
    used = [line for line in fit.lines if line.used]
    if fit.reading is None or fit.reading.values is None or not used:
        return None
    figure = style.new_figure(fit.scene.title, f"fitted to {fit.channel}")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    found = [f for line in used for f in (line.measured_Hz, line.before_Hz or 0.0)]
    highest = min(fit.sample_rate_Hz / 2, ABOVE * max(found))
    upper.set_xlim(0, highest / 1e3)
    _draw_spectrum(fit, upper, highest)
    for k, line in enumerate(used):
        for value, colour, look, label in (
            (line.before_Hz, BEFORE, "--", "scene"),
            (line.after_Hz, AFTER, "-", "fitted scene"),
        ):
            assert value is not None
            upper.axvline(
                value / 1e3, color=colour, linestyle=look, linewidth=1.2, zorder=0.5, label=None if k else label
            )
    handles, names = upper.get_legend_handles_labels()
    upper.legend(handles, names, loc="lower left", bbox_to_anchor=(0.0, 1.12), borderaxespad=0, ncols=3)
    label_top_edge(upper, [(line.measured_Hz / 1e3, _name(line), style.DARK) for line in used])
    _draw_deviations(used, lower)
    return figure


def _name(line: FittedLine) -> str:
    return f"{line.mode} {line.measured_Hz:.0f} Hz" if line.mode else f"{line.measured_Hz:.0f} Hz"


def _draw_spectrum(fit: Fit, axes: Axes, highest: float) -> None:
    assert fit.reading is not None
    spectrum = amplitude_spectrum(fit.reading.values, fit.sample_rate_Hz, zero_padding=2)
    seen = (spectrum.frequency_Hz >= LOWEST) & (spectrum.frequency_Hz <= highest)
    level = level_dB(spectrum.amplitude[seen], float(spectrum.amplitude[seen].max() / np.sqrt(2)))
    starts, _, largest = extremes(level)
    factor, unit = style.time_unit(fit.until_s)
    part = f"{fit.from_s * factor:.4g} to {fit.until_s * factor:.4g} {unit}"
    what = "small vibration" if fit.record_kind is Kind.LINEAR else "saturated squeal"
    axes.plot(
        spectrum.frequency_Hz[seen][starts] / 1e3,
        largest,
        color=style.DARK,
        linewidth=0.8,
        label=f"measured, {part}: {what}",
    )
    axes.set_ylim(max(float(np.percentile(largest, 2)) - HEADROOM_DB, -DEEPEST_DB), HEADROOM_DB)
    style.frame(axes, None, "Level (dB re largest)")


def _draw_deviations(used: list[FittedLine], axes: Axes) -> None:
    for line in used:
        assert line.before_Hz is not None
        assert line.after_Hz is not None
        for value, colour, mark in ((line.before_Hz, BEFORE, "o"), (line.after_Hz, AFTER, "D")):
            off = max(100 * abs(value / line.measured_Hz - 1), LEAST_PERCENT)
            axes.plot([line.measured_Hz / 1e3], [off], marker=mark, color=colour, markersize=4, linestyle="")
    axes.set_yscale("log")
    axes.set_ylim(LEAST_PERCENT / 2, 100)
    style.frame(axes, "Frequency (kHz)", "|Δf| (%)\n● scene\n◆ fitted")
