"""Pressure, separation and reversed slip along the arc over the last few periods."""

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from drumsqueal.findings.boundaries import mean_pressures
from drumsqueal.findings.vibration import moments_at
from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.effects.pressure import Bonded
from drumsqueal.physics.model import Model
from drumsqueal.questions.run.figures.view import View
from drumsqueal.terminal import style
from drumsqueal.terminal.placement import finer

PERIODS = 5  # of the main frequency
ANGLES, TIMES = 160, 800  # of the image
SMALL = 0.5  # a pressure that stays this near to p0 is drawn as its deviation


class _Field(NamedTuple):
    """Along the arc over time (angle, time): level p0 + k_c u_r over its mean, and slip in the drum's sense.

    The level is the pressure where it is positive; elsewhere the lining has lifted off, if it can.
    """

    shoe: str
    time: NDArray[np.float64]
    degrees: NDArray[np.float64]
    level: NDArray[np.float64]
    slip: NDArray[np.float64]
    can_lift: bool
    rubs: bool


@style.styled()
def draw_contact(view: View) -> Figure | None:
    """Draw the contact at z = 0 over the last five periods; None where nothing moved or no load presses the lining."""
    fields = _evaluate(view) if view.readable else []
    if not fields:
        return None
    figure = style.new_figure(view.title, "contact along the arc")
    for axes, field in zip(figure.subplots(len(fields), squeeze=False)[:, 0], fields, strict=True):
        _draw_field(view, axes, field)
    return figure


def _draw_field(view: View, axes: Axes, field: _Field) -> None:
    factor, unit = style.time_unit(view.time[-1])
    deviation, can_lift = float(np.abs(field.level - 1).max()), field.can_lift
    label = f"Pressure over {'mean pressure' if view.model.pushed else 'p₀'}"
    values, colours = field.level, "YlGnBu"
    limits = (0.0 if can_lift else min(0.0, float(values.min())), float(values.max()))
    if deviation < SMALL:
        power = 0 if deviation >= 0.01 or deviation == 0 else int(np.floor(np.log10(deviation)))
        reach = (deviation or 1.0) / 10.0**power
        values, limits = (field.level - 1) / 10.0**power, (-reach, reach)
        times = "10" + str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        colours, label = "RdBu_r", f"{label}, less 1" + (f" ({times})" if power else "")
    image = axes.imshow(
        values,
        origin="lower",
        aspect="auto",
        cmap=colours,
        vmin=limits[0],
        vmax=limits[1],
        extent=(field.time[0] * factor, field.time[-1] * factor, field.degrees[0], field.degrees[-1]),
    )
    _mark_states(view, axes, field)
    bar = axes.figure.colorbar(image, ax=axes, pad=0.02, aspect=30)
    bar.set_label(label)
    bar.ax.tick_params(labelsize=style.SMALL_SIZE)
    along = (
        f"{field.shoe}: angle θ (degrees), z = 0"
        if field.shoe
        else "Angle θ along the arc (degrees), middle line z = 0"
    )
    style.frame(axes, f"Time ({unit})", along)


def _evaluate(view: View) -> list[_Field]:
    """The contact of each lining that something presses."""
    frequency = view.main_frequency
    if frequency is None:
        return []
    first = int(np.searchsorted(view.time, view.time[-1] - PERIODS / frequency))
    # A few samples more keep the ends of the interpolation out of the picture.
    part = slice(max(0, first - 8), view.time.size)
    history = view.result.history.isel(time=part).sel(coordinate=list(view.model.names))
    if history.sizes["time"] < 8:
        return []
    samples = view.time[part]
    motion = np.concatenate([history[kind].values for kind in ("displacement", "velocity")], axis=1)
    span = min(PERIODS / frequency, samples[-1] - samples[0])
    count = int(np.ceil(TIMES * (samples[-1] - samples[0]) / span))
    time, fine = (values[-TIMES:] for values in finer(samples, motion, count))
    means, found = mean_pressures(view.model, moments_at(view.model.operation, time)), []
    for (mine, side), mean in zip(view.model.sides, means, strict=True):
        half, largest = float(side.shoe.half_angle), float(np.max(mean))
        angles = np.linspace(-half, half, ANGLES)
        level, slip, _ = along_arc(side, time, fine[:, mine.of_states], angles)
        if largest > 0:
            contact, over = side.contact, (np.rad2deg(angles), np.asarray(level).T / largest, np.asarray(slip).T)
            may = float(contact.lifting_stiffness) > 0, contact.friction is not None
            found.append(_Field(mine.name, time, *over, *may))
    return found


@Interpreted
def along_arc(
    model: Model, time: Array, motion: Array, angles: Array, z: Array | None = None
) -> tuple[Array, Array, Array]:
    """Level p0 + k_c u_r (Pa), slip speed in the drum's sense (m/s) and preload (Pa) at all times and angles.

    On a line z (m), or on the middle line.
    """
    # A bonded lining's pressure is the level itself, also where it is negative.
    contact, n = dataclasses.replace(model.lining, law=Bonded(model.lining.law.stiffness)), len(model.names)

    def at(time: Array, state: Array) -> tuple[Array, Array, Array]:
        moment = model.operation.at(time)
        level, slip = contact.along_arc(moment, state[:n], state[n:], angles, z)
        return level, slip * jnp.sign(moment.drum_speed), moment.preload

    return jax.vmap(at)(time, motion)


def _mark_states(view: View, axes: Axes, field: _Field) -> None:
    """Cover what has lifted off and what slips backwards with flat colours, named above the axes."""
    handles, time = [], field.time * style.time_unit(view.time[-1])[0]
    sticks = view.result.history["sticking"].sel(time=field.time, method="nearest").values > 0
    # Where nothing touches the slip has no meaning: the lifted part covers it.
    slip = np.where(sticks, 0.0, field.slip)
    lifted = (-field.level, style.SEPARATED, "lifted off", field.can_lift)
    states = [(slip, style.REVERSED, "slip reversed", field.rubs), lifted]
    for level, colour, name, possible in states:
        if possible and level.max() > 0:
            axes.contourf(time, field.degrees, level, levels=[0.0, 2 * level.max()], colors=[colour])
            handles.append(Patch(color=colour, label=name))
    if sticks.any() and not sticks.all():
        hatched: dict[str, Any] = {"facecolor": "none", "edgecolor": style.DARK, "hatch": "////"}
        axes.fill_between(time, *field.degrees[[0, -1]], where=sticks, linewidth=0, **hatched)
        handles.append(Patch(**hatched, label="sticks as a whole"))
    shown = bool(handles)
    if not shown:
        state = "sticks to the drum" if sticks.all() else "touches and none of it slips backwards"
        handles.append(Patch(visible=False, label=f"the whole lining {state}"))
    axes.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=3,
        borderaxespad=0.2,
        handlelength=2.0 if shown else 0.0,
        handletextpad=0.8 if shown else 0.0,
    )
