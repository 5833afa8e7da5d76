"""Spectra of the growth phase and of the saturated part beside the predicted frequencies."""

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from drumsqueal.questions.run.figures.view import View
from drumsqueal.terminal import style
from drumsqueal.terminal.placement import extremes, label_top_edge

DECADES = 6  # of amplitude shown
AT = 5e-4  # a smaller shift is none
ABOVE = 1.25  # highest frequency shown over that of the highest mode

CAPTION_PAD = 20.0  # points above the upper panel, where the names of the modes stand in between


@style.styled()
def draw_spectra(view: View) -> Figure | None:
    """Draw displacement spectra before and after saturation; None where the record is too short for any."""
    parts = [("Growth phase" if view.result.stability.unstable else "Linear motion", view.growing)]
    if view.saturation is not None:
        settled = view.saturation.vibrates
        parts.append(("Saturated motion" if settled else "End of the record", view.saturated))
    if not view.readable or not view.modes:
        return None
    highest = min(view.vibration.sample_rate / 2, ABOVE * max(mode.frequency_Hz for mode in view.modes))
    spectra = [(name, part, _outlines(view, part, highest)) for name, part in parts]
    spectra = [entry for entry in spectra if entry[2]]
    if not spectra:
        return None
    figure = style.new_figure(view.title, "displacement spectra")
    rows = figure.subplots(len(spectra), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (name, part, found) in zip(rows, spectra, strict=True):
        axes.set_xlim(0, highest / 1e3)
        _draw(axes, found)
        axes.set_title(_caption(view, name, part, found), loc="left", pad=4, fontsize=style.TEXT_SIZE)
        for mode in view.modes:
            colour = style.COLOUR[mode.name]
            axes.axvline(
                mode.frequency_Hz / 1e3, color=colour, linewidth=0.7, linestyle=":", gid=f"predicted {mode.label}"
            )
    rows[0].set_title(rows[0].get_title(loc="left"), loc="left", pad=CAPTION_PAD, fontsize=style.TEXT_SIZE)
    rows[-1].set_xlabel("Frequency (kHz)")
    if view.saturation is not None and len(spectra) > 1:
        _mark_main_line(view, rows[-1])
    rows[0].legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=6,
        borderaxespad=CAPTION_PAD / style.SMALL_SIZE - 0.4,
        handlelength=1.2,
        columnspacing=1.2,
    )
    figure.supylabel("Displacement amplitude (µm; rotations times R)", fontsize=style.TEXT_SIZE)
    label_top_edge(
        rows[0],
        [(m.frequency_Hz / 1e3, f"{m.label} {m.frequency_Hz:.0f} Hz", style.COLOUR[m.name]) for m in view.modes],
    )
    return figure


class _Outline(NamedTuple):
    """What a figure shows of a spectrum: frequency (Hz), largest amplitude (µm) about it, resolution (Hz)."""

    frequency_Hz: NDArray[np.float64]
    largest: NDArray[np.float64]
    resolution_Hz: float


def _outlines(view: View, part: slice, highest: float) -> dict[str, _Outline]:
    """The spectra of a part of the record, each brought to the size of the figure before the next is computed."""
    found = {}
    for coordinate, spectrum in view.vibration.spectra(part):
        stop = int(np.searchsorted(spectrum.frequency_Hz, highest, side="right"))
        starts, _, largest = extremes(spectrum.amplitude[:stop])
        shown = largest * view.micrometres(coordinate)
        found[coordinate] = _Outline(spectrum.frequency_Hz[starts], shown, spectrum.resolution_Hz)
        del spectrum  # before the next is made
    return found


def _draw(axes: Axes, found: dict[str, _Outline]) -> None:
    top = max(float(each.largest.max()) for each in found.values())
    for coordinate, each in found.items():
        axes.plot(each.frequency_Hz / 1e3, each.largest, color=style.COLOUR[coordinate], label=coordinate)
    axes.set_yscale("log")
    axes.set_ylim(top * 10.0**-DECADES, top * 4)
    style.frame(axes, None, None)


def _caption(view: View, name: str, part: slice, found: dict[str, _Outline]) -> str:
    factor, unit = style.time_unit(view.time[-1])
    first, last = view.time[part][0] * factor, view.time[part][-1] * factor
    resolution = next(iter(found.values())).resolution_Hz
    return f"{name}, {first:.4g} to {last:.4g} {unit}, resolution {resolution:.2g} Hz"


def _mark_main_line(view: View, axes: Axes) -> None:
    saturation = view.saturation
    if saturation is None or saturation.main is None:
        return
    main, text = saturation.main, f"{saturation.main.frequency_Hz:.0f} Hz"
    if saturation.frequency_shift is not None:
        shift = saturation.frequency_shift
        side = "at" if abs(shift) < AT else f"{abs(shift) * 100:.1f} % {'below' if shift < 0 else 'above'}"
        text += f", {side} the onset of {saturation.nearest_mode}"
    height = main.amplitude * view.micrometres(main.coordinate)
    axes.plot(
        [main.frequency_Hz / 1e3],
        [height * 2],
        marker="v",
        markersize=4,
        color=style.DARK,
        linestyle="",
        gid="main line",
    )
    title = axes.get_title(loc="left")
    axes.set_title(f"{title}; ▼ {text}", loc="left", pad=4, fontsize=style.TEXT_SIZE)
