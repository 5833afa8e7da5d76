"""Contact along the arc over the last few periods, and the phase portrait of the lining's surface."""

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

from drumsqueal.findings.brake import ShoeAsBrake, shoes_of
from drumsqueal.findings.vibration import mean_pressures, moments_at
from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.effects.pressure import Bonded
from drumsqueal.physics.model import Model
from drumsqueal.questions.run.figures.view import MICRO, View
from drumsqueal.scene import Scene
from drumsqueal.terminal import style
from drumsqueal.terminal.style import finer

PERIODS = 5  # of the main frequency
ANGLES, TIMES = 160, 800  # of the image
SMALL = 0.5  # a pressure that stays this near to p0 is drawn as its deviation


class _Field(NamedTuple):
    """Along the arc over time (angle, time): pressure as without lift-off over its mean, and slip in the drum's sense.

    Where it is negative the lining has lifted off, if it can.
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
    label = f"Pressure over {'mean pressure' if view.model.pushed else 'steady pressure p₀'}"
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
    """Pressure as without lift-off (Pa), slip speed in the drum's sense (m/s), preload (Pa) at all times and angles.

    On a line z (m), or on the middle line.
    """
    contact, n = dataclasses.replace(model.lining, law=Bonded(model.lining.law.normal)), len(model.names)

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
        part = "the whole lining" if view.model.planar else "all of the lining's middle line"
        handles.append(Patch(visible=False, label=f"{part} {state}"))
    room = (2.0, 0.8) if shown else (0.0, 0.0)
    style.legend_above(axes, handles=handles, ncols=3, handlelength=room[0], handletextpad=room[1])


# Pressure along the lining in steady sliding, and the brake that it belongs to.


_PRESSED, FORCE, PIN, _DRUM = "#0072B2", "#D55E00", "#009E73", "#777777"
_LONGEST = 0.4  # of the radius, of an arrow
_EVERY = 9  # of the angles has an arrow


@style.styled()
def draw_pressure(view: View) -> Figure | None:
    """Draw the pressure over the angle, and on the shoe; None where the assembly balances it."""
    brake, scene = view.findings.brake, view.result.scene
    if brake is None:
        return None
    shoes = shoes_of(brake)
    figure = style.new_figure(view.title, "pressure on the lining in steady sliding")
    rows = figure.subplots(len(shoes), 2, width_ratios=(1.25, 1), squeeze=False)
    for (left, right), (name, each), one in zip(rows, shoes.items(), scene.alone, strict=True):
        _draw_over_angle(left, each, name)
        _draw_on_shoe(right, each, one)
    return figure


def _draw_over_angle(axes: Axes, brake: ShoeAsBrake, name: str) -> None:
    angle, pressure = np.array(brake.angle_deg), np.array(brake.pressure_Pa) / 1e3
    axes.fill_between(angle, pressure, color=_PRESSED, alpha=0.25, linewidth=0)
    axes.plot(angle, pressure, color=_PRESSED, gid="pressure")
    axes.axhline(brake.mean_pressure_Pa / 1e3, color=style.DARK, linewidth=0.6, linestyle=(0, (4, 3)))
    top = 1.25 * max(float(pressure.max()), brake.mean_pressure_Pa / 1e3) or 1.0
    low = min(0.0, 1.1 * float(pressure.min()))
    axes.set_ylim(low, top)
    half = float(angle[-1])
    axes.set_xlim(-1.05 * half, 1.05 * half)
    title = f"{name}; " * bool(name) + f"dashed: mean {brake.mean_pressure_Pa / 1e3:.4g} kPa"
    axes.set_title(title, fontsize=style.SMALL_SIZE, loc="left")
    ends = {
        "leading end:\nthe drum comes in": brake.leading_end_deg,
        "trailing end:\nit leaves": brake.trailing_end_deg,
    }
    for words, place in ends.items():
        axes.axvline(place, color=style.DARK, linewidth=0.6, gid=words.split(":")[0])
        axes.text(
            place - np.sign(place) * 0.02 * half, 0.985 * top, words, va="top",
            ha="left" if place < 0 else "right", fontsize=style.SMALL_SIZE,
        )  # fmt: skip
    axes.annotate(
        "", (0.25 * np.sign(brake.trailing_end_deg) * half, 0.95 * top),
        xytext=(-0.25 * np.sign(brake.trailing_end_deg) * half, 0.95 * top),
        arrowprops={"arrowstyle": "->", "color": _DRUM, "linewidth": 1.0},
    )  # fmt: skip
    style.frame(axes, "Angle θ from the middle of the lining (degrees)", "Pressure (kPa), middle line")


def _draw_on_shoe(axes: Axes, brake: ShoeAsBrake, scene: Scene) -> None:
    """Drum, lining, pressure, springs and forces as they lie, seen along the drum's axis; the drum passes y upwards."""
    radius, angle = scene.shoe.outer_radius, np.deg2rad(brake.angle_deg)
    around = np.linspace(0, 2 * np.pi, 361)
    axes.plot(radius * np.cos(around), radius * np.sin(around), color=_DRUM, linewidth=1.0)
    axes.plot([0], [0], marker="+", color=_DRUM, markersize=6)
    inner = radius - scene.shoe.thickness
    ring = np.concatenate([radius * np.exp(1j * angle), inner * np.exp(1j * angle[::-1])])
    axes.fill(ring.real, ring.imag, color=style.FAINT, linewidth=0)
    largest = max(np.abs(brake.pressure_Pa).max(), 1e-300)
    # 0.45 of the radius, that the largest pressure is drawn
    reach = radius * (1 + 0.45 * np.array(brake.pressure_Pa) / largest)
    outline = np.concatenate([radius * np.exp(1j * angle), (reach * np.exp(1j * angle))[::-1]])
    axes.fill(outline.real, outline.imag, color=_PRESSED, alpha=0.25, linewidth=0)
    for theta, far in zip(angle[::_EVERY], reach[::_EVERY], strict=True):
        arrow = np.array([far, radius]) * np.exp(1j * theta)
        axes.plot(arrow.real, arrow.imag, color=_PRESSED, linewidth=0.6)
    for spring in scene.shoe.spring:
        axes.plot(*spring.at[:2], marker="o", color=PIN, markersize=4, linestyle="")
    for force in scene.shoe.force:
        (x, y, _), (along, up, _) = force.at, force.direction
        axes.annotate(
            "", (x, y), xytext=(x - _LONGEST * radius * along, y - _LONGEST * radius * up),
            arrowprops={"arrowstyle": "-|>", "color": FORCE, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
    turn = np.sign(brake.trailing_end_deg)
    some = np.exp(1j * (np.pi + turn * np.linspace(-0.45, 0.45, 31))) * radius * 1.12
    axes.plot(some.real, some.imag, color=_DRUM)
    axes.annotate(
        "", (some[-1].real, some[-1].imag), xytext=(some[-3].real, some[-3].imag),
        arrowprops={"arrowstyle": "->", "color": _DRUM, "linewidth": 1.0, "shrinkA": 0, "shrinkB": 0},
    )  # fmt: skip
    named = [("drum", _DRUM, "-", ""), ("pressure", _PRESSED, "-", "")]
    named += [("spring at a point", PIN, "", "o")] if scene.shoe.spring else []
    named += [("force", FORCE, "-", "")] if scene.shoe.force else []
    for name, colour, line, marker in named:
        axes.plot([], [], color=colour, linestyle=line, marker=marker, markersize=4, label=name)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.02), ncols=2)
    axes.set_aspect("equal")
    axes.set_axis_off()


BEFORE_S = 0.01  # of the growth, up to the first contact boundary, that is drawn: more of it would be a filled disc
FINER = 8  # points drawn per sample
NEAR = 0.3  # the slip limit is drawn where the motion comes to this fraction of it


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
    for line in style.legend_above(axes, ncols=3).get_lines():
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
    # A drum's speed that changes by more than 1 % is drawn as a band.
    if abs(speed[1] - speed[0]) > 0.01 * np.abs(speed).max():
        label = f"slip limit RΩ, {speed[0]:.2g} to {speed[1]:.2g} m/s"
        axes.axhspan(*speed.tolist(), color=style.REVERSED, alpha=0.2, linewidth=0, label=label)
    else:
        label = f"slip limit RΩ = {speed[-1]:.3g} m/s".replace("-", "−")
        axes.axhline(float(speed[-1]), color=style.REVERSED, linewidth=0.9, linestyle="--", label=label)
