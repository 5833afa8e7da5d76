"""Frequencies of a run: spectra of the growth phase and the saturated part, and the spectrogram."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from drumsqueal.findings.ramp import CampbellLine, Ramp, way_words
from drumsqueal.findings.signals.spectra import Spectrogram, Spectrum, spectrogram
from drumsqueal.findings.squeals import SPEED, SquealEnd, drives_of, instants_at, name_of_key, unit_of_key
from drumsqueal.findings.verdict import shift_words
from drumsqueal.physics.model import at_lining
from drumsqueal.questions.run.figures.view import View
from drumsqueal.solve.linear.passage import corners_of
from drumsqueal.terminal import style
from drumsqueal.terminal.style import extremes, label_right_edge, label_top_edge

# Campbell lines: the frequencies of the eigenvalues while drum speed or load change, marked where unstable.


_DOTTED = (0, (2, 4))
STABLE, _UNSTABLE = 0.6, 1.6  # points of a line
_UNSTABLE_COLOUR = style.COLOUR["Tx"]  # which stands out on the dark pictures


def draw_campbell_lines(axes: Axes, line: CampbellLine, place: NDArray[np.float64]) -> None:
    """Draw the frequency (kHz) of a mode over what it has at each of its times; solid where it is unstable."""
    order = np.argsort(place, kind="stable")  # not to and fro, or the dots of one way fill the gaps of the other
    x, frequency = place[order], np.array(line.frequency_Hz)[order] / 1e3
    grows = np.array(line.growth_rate_1_per_s)[order] > 0
    axes.plot(x, frequency, color="white", linewidth=STABLE, linestyle=_DOTTED, gid=f"predicted {line.mode}")
    if grows.any():
        unstable = np.where(grows, frequency, np.nan)
        axes.plot(x, unstable, color=_UNSTABLE_COLOUR, linewidth=_UNSTABLE, gid=f"unstable {line.mode}")


def line_labels(ramp: Ramp, highest: float) -> list[tuple[float, str, str]]:
    """The names of the modes at the frequencies (kHz) that they end with, as far as these are shown (Hz)."""
    last = [(line, line.frequency_Hz[-1]) for line in ramp.lines if line.frequency_Hz[-1] <= highest]
    return [(f / 1e3, f"{line.mode} {f:.0f} Hz", style.COLOUR[line.mode]) for line, f in last]


def line_legend(axes: Axes, *others: Patch) -> None:
    """Explain the lines above the axes, at the right, and what else there is."""
    handles = [
        Line2D([], [], color=style.DARK, linewidth=STABLE, linestyle=_DOTTED, label="eigenvalue, stable"),
        Line2D([], [], color=_UNSTABLE_COLOUR, linewidth=_UNSTABLE, label="eigenvalue, unstable"),
        *others,
    ]
    look = {"borderaxespad": 1.6, "ncols": len(handles), "columnspacing": 1.2}
    legend = style.legend_above(axes, right=True, handles=handles, **look)
    legend.set_clip_on(False)  # or the layout takes it for hidden and leaves it no room


MODE_WIDTH = 0.7  # points
RANGE_DB = 90.0  # dynamic range of the spectrogram
PERIODS, FEWEST_PERIODS = 16.0, 3.0  # of the lowest mode in a window
OVERLAP = 0.875  # of neighbouring windows


@style.styled()
def draw_spectra(view: View) -> Figure | None:
    """Draw displacement spectra before and after saturation; None where the record is too short for any."""
    growing = slice(0, int(np.searchsorted(view.time, view.findings.growth.linear_until_s, side="right")))
    parts = [("Growth phase" if view.result.stability.unstable else "Linear motion", growing)]
    if view.saturation is not None:
        parts.append(("Saturated motion" if view.saturation.vibrates else "End of the record", view.saturated))
    if not view.readable or not view.modes:
        return None
    highest = _highest_shown(view)
    spectra = [(name, part, _outlines(view, part, highest)) for name, part in parts]
    spectra = [entry for entry in spectra if entry[2]]
    if not spectra:
        return None
    figure = style.new_figure(view.title, "displacement spectra")
    rows = figure.subplots(len(spectra), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (name, part, found) in zip(rows, spectra, strict=True):
        _draw_lines(axes, found, highest)
        factor, unit = style.time_unit(view.time[-1])
        first, last = view.time[part][[0, -1]] * factor
        resolution = float(f"{next(iter(found.values())).resolution_Hz:.2g}")
        caption = f"{name}, {first:.4g} to {last:.4g} {unit}, resolution {resolution:g} Hz"
        if axes is not rows[0]:
            caption += _mark_main_line(view, axes)
        # 30.0 points above the upper panel, where the names of the modes stand in between
        pad = 30.0 if axes is rows[0] else 4
        axes.set_title(caption, loc="left", pad=pad, fontsize=style.TEXT_SIZE)
        _mark_modes(view, axes)
    rows[-1].set_xlabel("Frequency (kHz)")
    predicted = Line2D([], [], color=style.DARK, linewidth=MODE_WIDTH, linestyle=":", label="mode of steady sliding")
    style.legend_below(figure, [*rows[0].get_legend_handles_labels()[0], predicted], columns=6)
    figure.supylabel(f"Displacement amplitude ({view.measure})", fontsize=style.TEXT_SIZE)
    label_top_edge(
        rows[0],
        [(m.frequency_Hz / 1e3, f"{m.label}\n{m.frequency_Hz:.0f} Hz", style.COLOUR[m.label]) for m in view.modes],
    )
    return figure


def draw_spectrum(view: View, axes: Axes) -> None:
    """Draw the displacement spectra of the saturated motion, of the whole record where nothing saturated."""
    highest = _highest_shown(view)
    _draw_lines(axes, _outlines(view, view.saturated, highest), highest)
    _mark_main_line(view, axes)
    _mark_modes(view, axes)
    axes.legend(ncols=3)
    style.frame(axes, "Frequency (kHz)", f"Displacement amplitude\n({view.measure})")


def _draw_lines(axes: Axes, found: Mapping[str, Spectrum], highest: float) -> None:
    axes.set_xlim(0, highest / 1e3)
    for coordinate, each in found.items():
        axes.plot(each.frequency_Hz / 1e3, each.amplitude, color=style.COLOUR[coordinate], label=coordinate)
    top = max(float(each.amplitude.max()) for each in found.values())
    axes.set_yscale("log")
    # 6 decades of amplitude are shown.
    axes.set_ylim(top * 10.0**-6, top * 4)
    style.frame(axes, None, None)


def _mark_modes(view: View, axes: Axes) -> None:
    for mode in view.modes:
        colour, gid = style.COLOUR[mode.label], f"predicted {mode.label}"
        axes.axvline(mode.frequency_Hz / 1e3, color=colour, linewidth=MODE_WIDTH, linestyle=":", gid=gid)


def _highest_shown(view: View) -> float:
    # The highest frequency shown is 1.25 times that of the highest mode.
    return min(view.vibration.sample_rate / 2, 1.25 * max(mode.frequency_Hz for mode in view.moving))


def _outlines(view: View, part: slice, highest: float) -> dict[str, Spectrum]:
    """The spectra (µm) of a part of the record, each brought to the size of the figure before the next is computed."""
    found = {}
    for coordinate, spectrum in view.vibration.spectra(part, view.shown_coordinates):
        stop = int(np.searchsorted(spectrum.frequency_Hz, highest, side="right"))
        starts, _, largest = extremes(spectrum.amplitude[:stop])
        shown = largest * view.micrometres(coordinate)
        found[coordinate] = Spectrum(spectrum.frequency_Hz[starts], shown, spectrum.resolution_Hz)
        del spectrum  # before the next is made
    return found


def _mark_main_line(view: View, axes: Axes) -> str:
    """Mark the main line of the saturated motion, and return what the caption says of it."""
    saturation = view.saturation
    if saturation is None or saturation.main is None:
        return ""
    main, shift = saturation.main, saturation.frequency_shift
    height = main.amplitude * view.micrometres(main.coordinate)
    marker = {"marker": "v", "markersize": 4, "color": style.DARK, "linestyle": ""}
    axes.plot([main.frequency_Hz / 1e3], [height * 2], **marker, gid="main line")
    side = "" if shift is None else f", {shift_words(shift)} the onset of {saturation.nearest_mode}"
    return f"; ▼ {main.frequency_Hz:.0f} Hz{side}"


class Content(NamedTuple):
    """A spectrogram of a coordinate's velocity: levels in dB of the peak, windows (s), highest frequency (Hz)."""

    coordinate: str
    picture: Spectrogram
    peak: str
    window: float
    highest: float


def spectrogram_of(view: View) -> Content | None:
    """The spectrogram of the velocity that holds most kinetic energy; None where the record is too short for one."""
    if not view.readable or not view.modes:
        return None
    # A mode that dies out within a few periods does not set the length of the windows.
    lasting = [mode for mode in view.modes if mode.growth_rate > -mode.frequency_Hz]
    lowest = min(mode.frequency_Hz for mode in lasting or view.modes)
    rate = view.vibration.sample_rate
    periods = min(PERIODS, view.time.size / rate * lowest / 4)  # that must fit side by side into the record
    if periods < FEWEST_PERIODS:
        return None
    energy = view.result.stability.mass * view.vibration.mean_square_velocity()
    name = view.vibration.coordinates[int(np.argmax(energy))]
    signal = view.vibration.column(name, of="velocity")
    highest = _highest_shown(view)
    # 2000 or little more; a page has no room for them
    columns = max(1, round(signal.size / rate * lowest / periods / (1 - OVERLAP) / 2000))
    content = _shown(
        spectrogram(signal, rate, lowest_frequency=lowest, periods=periods, overlap=OVERLAP), highest, columns
    )
    peak = content.amplitude.max()
    level = 20 * np.log10(np.maximum(content.amplitude / peak, 10 ** (-RANGE_DB / 20 - 1)))
    picture = Spectrogram(view.time[0] + content.time_s, content.frequency_Hz, level)
    factor, unit, _ = at_lining(view.model, name, math.inf)
    return Content(name, picture, f"{factor * peak:.3g} {unit}/s", periods / lowest, highest)


def levels() -> dict[str, Any]:
    """How a picture of levels is coloured."""
    return {"cmap": "magma", "vmin": -RANGE_DB, "vmax": 0}


def level_bar(figure: Figure, image: ScalarMappable, axes: Axes | list[Axes], content: Content) -> None:
    """Draw the scale of levels at the right of the axes."""
    bar = figure.colorbar(image, ax=axes, extend="min", pad=0.02, aspect=30)
    bar.set_label(f"Velocity amplitude (dB relative to {content.peak})")
    bar.ax.tick_params(labelsize=style.SMALL_SIZE)


@style.styled()
def draw_spectrogram(view: View) -> Figure | None:
    """Draw the spectrogram of a velocity in dB of its maximum; None where the record is too short for one."""
    content = spectrogram_of(view)
    if content is None:
        return None
    factor, unit = style.time_unit(view.time[-1])
    figure = style.new_figure(view.title, f"spectrogram of the velocity of {content.coordinate}")
    ramp = view.findings.ramp
    # The spectrogram is five times as high as the speed or load below it.
    rows = figure.subplots(
        1 if ramp is None else 2, 1, sharex=True, squeeze=False, height_ratios=(5, 1)[: 1 + (ramp is not None)]
    )
    axes, last = rows[0, 0], rows[-1, 0]
    time, frequency, level = content.picture
    extent = edges(time * factor) + edges(frequency / 1e3)
    image = axes.imshow(level, origin="lower", aspect="auto", extent=extent, **levels())
    style.frame(axes, None, "Frequency (kHz)")
    axes.set_ylim(0, content.highest / 1e3)
    level_bar(figure, image, axes, content)
    if ramp is None:
        label_right_edge(axes, _mark_eigenvalues(view, axes), reach=6.0)
    else:
        for line in ramp.lines:
            draw_campbell_lines(axes, line, np.array(line.time_s) * factor)
        label_right_edge(axes, line_labels(ramp, content.highest), reach=6.0)
        line_legend(axes)
        _draw_operation(view, last, ramp)
        axes.set_xlim(extent[:2])
    last.set_xlabel(f"Time ({unit}), middle of a window of {content.window * 1e3:.3g} ms")
    return figure


def _mark_eigenvalues(view: View, axes: Axes) -> list[tuple[float, str, str]]:
    """Mark the frequencies of the modes, and return what to write there."""
    labels = []
    for mode in view.modes:
        axes.axhline(
            mode.frequency_Hz / 1e3, color="white", linewidth=0.5, linestyle=(0, (2, 4)), gid=f"predicted {mode.label}"
        )
        labels.append((mode.frequency_Hz / 1e3, f"{mode.label} {mode.frequency_Hz:.0f} Hz", style.COLOUR[mode.label]))
    return labels


def _draw_operation(view: View, axes: Axes, ramp: Ramp) -> None:
    """Draw drum speed or load over time, and shade where it squeals."""
    factor, _ = style.time_unit(view.time[-1])
    times = np.unique([*corners_of(view.model, float(view.time[-1])), *(t for line in ramp.lines for t in line.time_s)])
    key = ramp.keys[0] if ramp.keys else SPEED
    drive = drives_of(view.model)[key]
    axes.plot(times * factor, [drive.at(t)[0] for t in times.tolist()], color=style.DARK)
    for squeal in ramp.squeals:
        ends = (squeal.sets_in.time_s * factor, squeal.ends.time_s * factor)
        axes.axvspan(*ends, color=style.FAINT, linewidth=0, zorder=0, gid="squeal")
    style.frame(axes, None, f"{name_of_key(key).capitalize()}\n({unit_of_key(key)})")
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    if ramp.squeals:
        label_right_edge(axes, [(sum(axes.get_ylim()) / 2, "grey: squeal", style.DARK)], reach=6.0)


def _shown(pieces: Iterator[Spectrogram], highest: float, together: int) -> Spectrogram:
    """A spectrogram up to a frequency (Hz), with the mean of so many neighbouring columns in place of each of them."""
    parts = []
    for piece in pieces:
        kept, count = piece.frequency_Hz <= highest, piece.time_s.size
        starts = np.arange(0, count, together)
        sizes = np.diff(np.append(starts, count))
        time = np.add.reduceat(piece.time_s, starts) / sizes
        parts.append((time, piece.frequency_Hz[kept], np.add.reduceat(piece.amplitude[kept], starts, axis=1) / sizes))
    times, frequencies, amplitudes = zip(*parts, strict=True)
    return Spectrogram(np.concatenate(times), frequencies[0], np.concatenate(amplitudes, axis=1))


def edges(centres: np.ndarray) -> tuple[float, float]:
    """Outer edges of evenly spaced pixels."""
    half = (centres[1] - centres[0]) / 2 if centres.size > 1 else 0.5
    return float(centres[0] - half), float(centres[-1] + half)


# Waterfall of a run-up or coast-down: spectra over the drum speed or the load, one panel for each way.
#
# Where squeal sets in at another speed than that at which it dies out, the two differ.


COLUMNS = 600  # of the picture of one way
NOWHERE = style.FAINT  # where no window has its middle while it goes that way

_Vector = NDArray[np.float64]


@style.styled()
def draw_waterfall(view: View) -> Figure | None:
    """Draw spectra over what changes, a panel for each way; None where the record is too short, or goes no way."""
    ramp, content = view.findings.ramp, spectrogram_of(view)
    if ramp is None or content is None or not ramp.keys:
        return None
    key = ramp.keys[0]
    instants, drive = instants_at(view.model, content.picture.time_s.tolist()), drives_of(view.model)[key]
    values = np.array([each.value(key) for each in instants])
    directions = np.array([way_words(each, (key,)) for each in instants])
    ways = [way for way in ("falling", "rising") if np.count_nonzero(directions == way) > 1]
    if not ways or not np.ptp(values) > 0:
        return None
    figure = style.new_figure(view.title, f"waterfall of the velocity of {content.coordinate}")
    rows = figure.subplots(len(ways), 1, sharex=True, sharey=True, squeeze=False)[:, 0].tolist()
    gaps = False
    for axes, way in zip(rows, ways, strict=True):
        image = _draw_way(axes, content, values, directions == way)
        gaps |= np.ma.is_masked(image.get_array())
        for line in ramp.lines:
            draw_campbell_lines(axes, line, np.array([drive.at(t)[0] for t in line.time_s]))
        style.frame(axes, None, "Frequency (kHz)")
        axes.set_xlim(values.min(), values.max())
        named = axes.text(
            0.985, 0.94, f"{name_of_key(key)} {way}", color="white", ha="right", va="top", transform=axes.transAxes
        )
        named.set_bbox({"facecolor": "black", "alpha": 0.6, "linewidth": 0})
        label_top_edge(axes, _marks(axes, ramp, key, way))
        label_right_edge(axes, line_labels(ramp, content.highest), reach=6.0)
    rows[-1].set_xlabel(
        f"{name_of_key(key).capitalize()} ({unit_of_key(key)}); windows of {content.window * 1e3:.3g} ms"
    )
    line_legend(rows[0], *[Patch(color=NOWHERE, label="no spectrum")] * gaps)
    level_bar(figure, image, rows, content)
    return figure


def _draw_way(axes: Axes, content: Content, values: _Vector, chosen: NDArray[np.bool_]) -> AxesImage:
    """Draw the spectra of one way over what changes: of several passages the loudest, where there is none nothing."""
    grid = np.linspace(values.min(), values.max(), COLUMNS)
    picture = np.full((content.picture.frequency_Hz.size, COLUMNS), np.nan)
    for some in np.split(np.arange(values.size), np.flatnonzero(np.diff(chosen)) + 1):
        if not chosen[some[0]] or some.size < 2:
            continue
        order = some[np.argsort(values[some], kind="stable")]
        inside = (grid >= values[order[0]]) & (grid <= values[order[-1]])
        nearest = np.round(np.interp(grid[inside], values[order], np.arange(order.size))).astype(int)
        picture[:, inside] = np.fmax(picture[:, inside], content.picture.amplitude[:, order[nearest]])
    axes.set_facecolor(NOWHERE)
    extent = edges(grid) + edges(content.picture.frequency_Hz / 1e3)
    image = axes.imshow(picture, origin="lower", aspect="auto", extent=extent, **levels())
    axes.set_ylim(0, content.highest / 1e3)
    return image


def _marks(axes: Axes, ramp: Ramp, key: str, way: str) -> list[tuple[float, str, str]]:
    """Mark where squeal sets in and ends on this way, and return what to write there."""
    found = []
    for squeal in ramp.squeals:
        ends = [(squeal.sets_in, "sets in")] if squeal.sets_in.time_s > 0 else []
        ends += (
            [(squeal.ends, "dies out" if squeal.end is SquealEnd.DIES_OUT else "sticks")]
            if squeal.end is not SquealEnd.RECORD
            else []
        )
        for instant, what in ends:
            value = instant.value(key)
            if way_words(instant, (key,)) == way and axes.get_xlim()[0] <= value <= axes.get_xlim()[1]:
                axes.axvline(value, color="white", linewidth=0.8, linestyle="--", gid=f"{what} {way}")
                found.append((value, f"{what} at {value:.3g} {unit_of_key(key)}", style.DARK))
    return found
