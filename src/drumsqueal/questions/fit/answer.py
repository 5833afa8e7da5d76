"""What a fit to a measured record writes, draws and prints."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.console import Console

from drumsqueal.findings.signals.sound import level_dB
from drumsqueal.findings.signals.spectra import amplitude_spectrum
from drumsqueal.questions.fit.record import LOWEST, RecordKind
from drumsqueal.questions.fit.study import Fit, FittedLine, FittedNumber
from drumsqueal.scene.quantities import printable
from drumsqueal.terminal import style
from drumsqueal.terminal.reply import Answer
from drumsqueal.terminal.style import extremes, label_top_edge
from drumsqueal.terminal.tables import print_rows

# The measured spectrum with the predicted lines before and after the fit, and how far off they are.


_BEFORE, _AFTER, _FIRST = style.SEPARATED, style.REVERSED, style.STUCK
_DEEPEST_DB, _HEADROOM_DB = 90.0, 6.0
_DECAYED, SHORT = 3.0, 0.5  # a line is heard until it has fallen to e^-3; a fraction of the record that is a short one
_LEAST_PERCENT = 1e-3  # of a deviation, on the logarithmic axis


@style.styled()
def _draw_fit(fit: Fit) -> Figure | None:
    """Draw the spectrum of the part that was used with both predictions; below, their deviations in per cent."""
    used = [line for line in fit.lines if line.used]
    if fit.reading is None or fit.reading.values is None or not used:
        return None
    figure = style.new_figure(fit.scene.title, f"fitted to {fit.channel}")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    found = [f for line in used for f in (line.measured_Hz, line.before_Hz or 0.0)]
    highest = min(fit.sample_rate_Hz / 2, 1.15 * max(found))  # highest frequency shown over that of the highest line
    upper.set_xlim(0, highest / 1e3)
    _draw_spectrum(fit, upper, highest)
    for k, line in enumerate(used):
        for value, colour, look, label in (
            (line.before_Hz, _BEFORE, "--", "scene"),
            (line.after_Hz, _AFTER, "-", "fitted scene"),
        ):
            assert value is not None
            upper.axvline(
                value / 1e3, color=colour, linestyle=look, linewidth=1.2, zorder=0.5, label=None if k else label
            )
    handles, names = upper.get_legend_handles_labels()
    upper.legend(handles, names, loc="lower left", bbox_to_anchor=(0.0, 1.12), borderaxespad=0, ncols=2)
    label_top_edge(upper, [(line.measured_Hz / 1e3, _name(line), style.DARK) for line in used])
    _draw_deviations(used, lower)
    return figure


def _name(line: FittedLine) -> str:
    return f"{line.mode} {line.measured_Hz:.0f} Hz" if line.mode else f"{line.measured_Hz:.0f} Hz"


def _draw_spectrum(fit: Fit, axes: Axes, highest: float) -> None:
    assert fit.reading is not None
    values, rate = fit.reading.values, fit.sample_rate_Hz
    what = "small vibration" if fit.record_kind is RecordKind.LINEAR else "saturated squeal"
    first = _until_decayed(fit)
    lowest = [_draw_level(axes, values, fit, highest, style.DARK, f"measured: {what}")]
    if first:
        lowest.append(_draw_level(axes, values[: round(first * rate)], fit, highest, _FIRST, "first part"))
    axes.set_ylim(max(min(lowest) - _HEADROOM_DB, -_DEEPEST_DB), _HEADROOM_DB)
    style.frame(axes, None, "Level (dB re largest)")


def _until_decayed(fit: Fit) -> float | None:
    """How long (s) the line is heard that decays fastest, where that is a short first part of the record."""
    rates = [line.measured_growth_rate_1_per_s or 0.0 for line in fit.lines if line.used]
    first = _DECAYED / max(-min(rates), 1e-300)
    return first if first < SHORT * (fit.until_s - fit.from_s) else None


def _draw_level(axes: Axes, values: NDArray[np.float64], fit: Fit, highest: float, colour: str, what: str) -> float:
    """Draw the spectrum of a part, and return a level near its lowest (dB)."""
    spectrum = amplitude_spectrum(values, fit.sample_rate_Hz, zero_padding=2)
    seen = (spectrum.frequency_Hz >= LOWEST) & (spectrum.frequency_Hz <= highest)
    level = level_dB(spectrum.amplitude[seen], float(spectrum.amplitude[seen].max() / np.sqrt(2)))
    starts, _, largest = extremes(level)
    factor, unit = style.time_unit(fit.until_s)
    until = fit.from_s + values.size / fit.sample_rate_Hz
    part = f"{what}, {fit.from_s * factor:.4g} to {until * factor:.4g} {unit}"
    axes.plot(spectrum.frequency_Hz[seen][starts] / 1e3, largest, color=colour, linewidth=0.8, label=part)
    return float(np.percentile(largest, 2))


def _draw_deviations(used: list[FittedLine], axes: Axes) -> None:
    for line in used:
        assert line.before_Hz is not None
        assert line.after_Hz is not None
        for value, colour, mark in ((line.before_Hz, _BEFORE, "o"), (line.after_Hz, _AFTER, "D")):
            off = max(100 * abs(value / line.measured_Hz - 1), _LEAST_PERCENT)
            axes.plot([line.measured_Hz / 1e3], [off], marker=mark, color=colour, markersize=4, linestyle="")
    axes.set_yscale("log")
    axes.set_ylim(_LEAST_PERCENT / 2, 100)
    style.frame(axes, "Frequency (kHz)", "|Δf| (%)\n● scene\n◆ fitted")


def print_fit(console: Console, fit: Fit) -> None:
    """Print the numbers before and after, the lines before and after, the verdict, and what limits it."""
    print_rows(console, "Numbers", FittedNumber, fit.numbers)
    linear = fit.record_kind is RecordKind.LINEAR
    print_rows(console, "Lines and eigenvalues" if linear else "Lines of squeal", FittedLine, fit.lines)
    part = f"{fit.from_s:.4g} to {fit.until_s:.4g} s at {fit.sample_rate_Hz:.6g} Hz"
    console.print(printable(f"Measured: {fit.channel}, {part}; {fit.reason}"), style="dim")
    console.print("±: half the 95 % confidence interval", style="dim")
    console.print(printable(fit.verdict), style="bold")
    for note in fit.notes:
        console.print(printable(f"Note: {note}"))


def fitted_scene(fit: Fit) -> str | None:
    """The scene with the fitted numbers in the units of its file, headed by what was found; None where it failed."""
    if fit.missed:
        return None
    text = fit.written.to_toml() if fit.written is not None else fit.fitted_scene.to_toml()
    return f"# {printable(fit.verdict)}\n{text}"


FIT_ANSWER = Answer(
    words=print_fit, summary="fit.json", tables={"fitted.toml": fitted_scene}, figures={"fit": _draw_fit}
)
