"""Pressure along the lining in steady sliding, and the brake that it belongs to."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from drumsqueal.findings.brake import ShoeAsBrake, shoes_of
from drumsqueal.questions.run.figures.view import View
from drumsqueal.scene import Scene
from drumsqueal.terminal import style

PRESSED, FORCE, PIN, DRUM = "#0072B2", "#D55E00", "#009E73", "#777777"
DEEPEST = 0.45  # of the radius, that the largest pressure is drawn
LONGEST = 0.4  # of the radius, of an arrow
EVERY = 9  # of the angles has an arrow


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
    axes.fill_between(angle, pressure, color=PRESSED, alpha=0.25, linewidth=0)
    axes.plot(angle, pressure, color=PRESSED, gid="pressure")
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
        arrowprops={"arrowstyle": "->", "color": DRUM, "linewidth": 1.0},
    )  # fmt: skip
    style.frame(axes, "Angle θ from the middle of the lining (degrees)", "Pressure (kPa), middle line")


def _draw_on_shoe(axes: Axes, brake: ShoeAsBrake, scene: Scene) -> None:
    """Drum, lining, pressure, springs and forces as they lie, seen along the drum's axis; the drum passes y upwards."""
    radius, angle = scene.shoe.outer_radius, np.deg2rad(brake.angle_deg)
    around = np.linspace(0, 2 * np.pi, 361)
    axes.plot(radius * np.cos(around), radius * np.sin(around), color=DRUM, linewidth=1.0)
    axes.plot([0], [0], marker="+", color=DRUM, markersize=6)
    inner = radius - scene.shoe.thickness
    ring = np.concatenate([radius * np.exp(1j * angle), inner * np.exp(1j * angle[::-1])])
    axes.fill(ring.real, ring.imag, color=style.FAINT, linewidth=0)
    largest = max(np.abs(brake.pressure_Pa).max(), 1e-300)
    reach = radius * (1 + DEEPEST * np.array(brake.pressure_Pa) / largest)
    outline = np.concatenate([radius * np.exp(1j * angle), (reach * np.exp(1j * angle))[::-1]])
    axes.fill(outline.real, outline.imag, color=PRESSED, alpha=0.25, linewidth=0)
    for theta, far in zip(angle[::EVERY], reach[::EVERY], strict=True):
        arrow = np.array([far, radius]) * np.exp(1j * theta)
        axes.plot(arrow.real, arrow.imag, color=PRESSED, linewidth=0.6)
    for spring in scene.shoe.spring:
        axes.plot(*spring.at[:2], marker="o", color=PIN, markersize=4, linestyle="")
    for force in scene.shoe.force:
        (x, y, _), (along, up, _) = force.at, force.direction
        axes.annotate(
            "", (x, y), xytext=(x - LONGEST * radius * along, y - LONGEST * radius * up),
            arrowprops={"arrowstyle": "-|>", "color": FORCE, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
    turn = np.sign(brake.trailing_end_deg)
    some = np.exp(1j * (np.pi + turn * np.linspace(-0.45, 0.45, 31))) * radius * 1.12
    axes.plot(some.real, some.imag, color=DRUM)
    axes.annotate(
        "", (some[-1].real, some[-1].imag), xytext=(some[-3].real, some[-3].imag),
        arrowprops={"arrowstyle": "->", "color": DRUM, "linewidth": 1.0, "shrinkA": 0, "shrinkB": 0},
    )  # fmt: skip
    named = [("drum", DRUM, "-", ""), ("pressure", PRESSED, "-", "")]
    named += [("spring at a point", PIN, "", "o")] if scene.shoe.spring else []
    named += [("force", FORCE, "-", "")] if scene.shoe.force else []
    for name, colour, line, marker in named:
        axes.plot([], [], color=colour, linestyle=line, marker=marker, markersize=4, label=name)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.02), ncols=2)
    axes.set_aspect("equal")
    axes.set_axis_off()
