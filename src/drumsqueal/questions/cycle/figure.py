"""One cycle: phase portrait of the lining's surface, displacements and the state of the contact over a period."""

import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from drumsqueal.findings.vibration import ROTATIONS
from drumsqueal.questions.cycle.orbit import Cycle
from drumsqueal.questions.cycle.search import CycleStudy
from drumsqueal.questions.run.figures.contact import along_arc
from drumsqueal.terminal import style
from drumsqueal.terminal.style import frame, new_figure, styled

MICRO = 1e6
ANGLES = 160  # of the picture of the contact
NEAR = 0.3  # the slip limit is drawn where the motion comes to this share of it


@styled()
def draw_cycle(cycle: CycleStudy) -> Figure:
    """Draw u̇_θ against u_θ at the middle of the lining, the displacements, and the contact along the arc."""
    kind = "stable" if cycle.stable else "unstable"
    figure = new_figure(cycle.title, f"{kind} limit cycle of {cycle.frequency_Hz:.6g} Hz")
    grid = figure.add_gridspec(2, 2, width_ratios=[1, 1.25])
    _draw_phase(figure.add_subplot(grid[:, 0]), cycle)
    above = figure.add_subplot(grid[0, 1])
    _draw_displacements(above, cycle)
    _draw_contact(figure.add_subplot(grid[1, 1], sharex=above), cycle)
    above.tick_params(labelbottom=False)
    return figure


def _draw_phase(axes: Axes, cycle: Cycle) -> None:
    samples, shape = cycle.samples, cycle.samples.time.shape
    states = (dict(zip(cycle.names, each.T, strict=True)) for each in (samples.displacement, samples.velocity))
    moved, speed = (np.broadcast_to(cycle.model.lining.body.displacement(q, 0.0)[1], shape) for q in states)
    axes.plot(MICRO * moved, speed, color=style.DARK, linewidth=1.0)
    limit = float(cycle.model.shoe.outer_radius * cycle.model.operation.at(0.0).drum_speed)
    if np.abs(speed).max() > NEAR * abs(limit):
        axes.axhline(
            limit, color=style.REVERSED, linewidth=0.9, linestyle="--", label=f"slip limit RΩ = {limit:.3g} m/s"
        )
    else:
        axes.plot([], [], linestyle="", label=f"slip limit RΩ = {limit:.3g} m/s, outside the frame")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)
    frame(axes, r"Displacement $u_\theta$, middle of the lining (µm)", r"Velocity $\dot u_\theta$ (m/s)")


def _draw_displacements(axes: Axes, cycle: Cycle) -> None:
    """All in µm at the drum's surface."""
    radius = float(cycle.model.shoe.outer_radius)
    for k, name in enumerate(cycle.names):
        turned = name in ROTATIONS
        values = MICRO * cycle.samples.displacement[:, k] * (radius if turned else 1.0)
        if np.ptp(values) > 0:
            axes.plot(_time(cycle), values, color=style.COLOUR[name], label=f"R {name}" if turned else name)
    axes.set_xlim(0, _time(cycle)[-1])
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=len(cycle.names), borderaxespad=0.2)
    frame(axes, None, "Displacement (µm)")


def _time(cycle: Cycle) -> np.ndarray:
    """In ms."""
    return 1e3 * (cycle.samples.time - cycle.samples.time[0])


def _draw_contact(axes: Axes, cycle: Cycle) -> None:
    half = float(cycle.model.shoe.half_angle)
    angles = np.linspace(-half, half, ANGLES)
    motion = np.concatenate([cycle.samples.displacement, cycle.samples.velocity], axis=1)
    arguments = (cycle.samples.time, motion, angles)
    level, slip, _ = (np.asarray(part).T for part in along_arc(cycle.model, *map(jnp.asarray, arguments)))
    extent, handles = (_time(cycle), np.rad2deg(angles)), [Patch(color=style.TOUCHING, label="touches and slips")]
    axes.set_facecolor(style.TOUCHING)
    states = [(slip, style.REVERSED, "slip reversed", cycle.model.contact.friction is not None)]
    states.append((-level, style.SEPARATED, "lifted off", float(cycle.model.contact.lifting_stiffness) > 0))
    for values, colour, name, possible in states:
        if possible and values.max() > 0:
            axes.contourf(*extent, values, levels=[0.0, 2 * values.max()], colors=[colour])
            handles.append(Patch(color=colour, label=name))
    axes.set_ylim(extent[1][0], extent[1][-1])
    axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.2)
    frame(axes, "Time (ms)", "Angle θ along\nthe arc (degrees)")
