"""Phase portrait of the lining's surface: velocity against displacement, with the speed of the drum."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from drumsqueal.questions.run.figures.view import MICRO, View
from drumsqueal.terminal import style
from drumsqueal.terminal.style import finer

BEFORE_S = 0.01  # of the growth, up to the first contact boundary, that is drawn: more of it would be a filled disc
FINER = 8  # points drawn per sample
NEAR = 0.3  # the slip limit is drawn where the motion comes to this fraction of it
CHANGE = 0.01  # relative change of the drum's speed that is drawn as a band


@style.styled()
def draw_phase(view: View) -> Figure | None:
    """Draw u̇_θ against u_θ at θ = z = 0 for the last 30 ms; None where nothing moved."""
    if not view.readable:
        return None
    part = last_part(view)
    if view.time[part].size < 8 or not np.ptp(view.surface_motion(part)[:, 0]) > 0:
        return None
    figure = style.new_figure(view.title, "phase portrait of the lining's surface")
    axes = figure.subplots()
    draw_portrait(view, axes, part)
    legend = axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.2)
    for line in legend.get_lines():
        line.set_linewidth(1.0)
    return figure


def last_part(view: View) -> slice:
    """The last 30 ms, or what of them has saturated."""
    # 0.03 of the record that is drawn
    return slice(max(view.saturated.start, int(np.searchsorted(view.time, view.time[-1] - 0.03))), view.time.size)


def draw_portrait(view: View, axes: Axes, part: slice) -> None:
    """Draw the path of a part of the record, with the end of the growth where it led to a contact boundary."""
    path = _path(view, part)
    unit, scale = ("µm", MICRO) if np.abs(path[:, 0]).max() >= 1e-7 else ("nm", 1e9)
    before = _growth_path(view)
    if before is not None:
        axes.plot(
            before[:, 0] * scale,
            before[:, 1],
            color=style.FAINT,
            linewidth=0.5,
            rasterized=True,
            label=f"{BEFORE_S * 1e3:g} ms before the first contact boundary",
        )
    factor, time_unit = style.time_unit(view.time[-1])
    label = f"{view.time[part][0] * factor:.4g} to {view.time[-1] * factor:.4g} {time_unit}"
    axes.plot(path[:, 0] * scale, path[:, 1], color=style.DARK, linewidth=0.6, alpha=0.6, label=label)
    _draw_limit(view, axes, part, float(np.abs(path[:, 1]).max()))
    style.frame(
        axes,
        rf"Displacement $u_\theta$ from steady sliding, {view.middle} ({unit})",
        r"Velocity $\dot u_\theta$ (m/s)",
    )


def _path(view: View, part: slice) -> NDArray[np.float64]:
    motion = view.surface_motion(part)
    return finer(view.time[part], motion, FINER * len(motion))[1]


def _growth_path(view: View) -> NDArray[np.float64] | None:
    """The end of the spiral that leads to the first contact boundary, if the motion got there."""
    boundary = view.findings.edge_reached_s
    # Where the drum's speed changes, the limit that is drawn is that of the last part alone.
    if boundary is None or view.saturation is None or view.findings.changing:
        return None
    part = slice(*np.searchsorted(view.time, [boundary - BEFORE_S, boundary]).tolist())
    return _path(view, part) if view.time[part].size >= 8 else None


def _draw_limit(view: View, axes: Axes, part: slice, largest: float) -> None:
    """Draw the surface speed RΩ of the drum, a band where it changes; left out where the motion stays far below it."""
    found = np.broadcast_to(view.model.operation.at(view.time[part]).drum_speed, view.time[part].shape)
    speed = view.radius * np.array([found.min(), found.max()])
    if np.abs(speed).min() * NEAR > largest:
        axes.plot([], [], linestyle="", label=f"slip limit RΩ = {speed[-1]:.3g} m/s, outside the frame")
        return
    if abs(speed[1] - speed[0]) > CHANGE * np.abs(speed).max():
        label = f"slip limit RΩ, {speed[0]:.2g} to {speed[1]:.2g} m/s"
        axes.axhspan(*speed.tolist(), color=style.REVERSED, alpha=0.2, linewidth=0, label=label)
    else:
        label = f"slip limit RΩ = {speed[-1]:.3g} m/s".replace("-", "−")
        axes.axhline(float(speed[-1]), color=style.REVERSED, linewidth=0.9, linestyle="--", label=label)
