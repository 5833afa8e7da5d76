"""The drawing of the tutorial's brake: `python docs/_make/drawing.py` writes docs/drawing.png."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Polygon

from drumsqueal.terminal import style

PICTURE = Path(__file__).parents[1] / "drawing.png"
RADIUS, THICKNESS, ARC = 100.0, 20.0, 110.0  # mm, deg
PIN, CYLINDER = (30.0, 80.0), (30.0, -80.0)


def ring(outer: float, inner: float, begin: float, end: float) -> np.ndarray:
    """The outline of a part of a ring, in mm."""
    angles = np.deg2rad(np.linspace(begin, end, 200))
    edge = np.column_stack([np.cos(angles), np.sin(angles)])
    return np.concatenate([outer * edge, inner * edge[::-1]])


def dimension(axes: Axes, begin: tuple[float, float], end: tuple[float, float], text: str) -> None:
    """A length between two points, with its name beside the middle."""
    axes.annotate("", begin, end, arrowprops={"arrowstyle": "<|-|>", "color": style.DARK, "shrinkA": 0, "shrinkB": 0})
    x, y = np.mean([begin, end], axis=0)
    axes.text(x, y, text, ha="center", va="center", bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.5})


def spring(axes: Axes, at: tuple[float, float], along: tuple[float, float]) -> None:
    """A spring from a point to the ground."""
    way = np.array([0, 6, 8, 10, 12, 14, 16, 18, 24.0])
    zigzag = np.array([0, 0, 3, -3, 3, -3, 3, 0, 0.0])
    across = np.array([-along[1], along[0]])
    line = np.array(at) + way[:, None] * np.array(along) + zigzag[:, None] * across
    axes.plot(*line.T, color=style.COLOUR["Y"], linewidth=1.2)
    for k in (-1, 1):
        end = line[-1] + np.outer([0, k * 6], across)
        axes.plot(*end.T, color=style.DARK, linewidth=2)


def draw() -> Figure:
    """Shoe, drum, pin, wheel cylinder, axes and lengths."""
    figure = Figure(figsize=(7.2, 6.4), layout="constrained")
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.set_axis_off()
    drum = ring(RADIUS + 9, RADIUS, 0, 360)
    axes.add_patch(Polygon(drum, facecolor="0.85", edgecolor="none"))
    for radius in (RADIUS, RADIUS + 9):
        axes.add_patch(Arc((0, 0), 2 * radius, 2 * radius, color=style.DARK))
    shoe = ring(RADIUS, RADIUS - THICKNESS, -ARC / 2, ARC / 2)
    axes.add_patch(Polygon(shoe, facecolor=style.COLOUR["X"], alpha=0.25, edgecolor=style.COLOUR["X"]))
    lining = ring(RADIUS, RADIUS - 3, -ARC / 2, ARC / 2)
    axes.add_patch(Polygon(lining, facecolor=style.COLOUR["X"], edgecolor="none"))
    for (x, y), name in (((30, 0), "x"), ((0, 30), "y")):
        axes.annotate("", (x, y), (0, 0), arrowprops={"arrowstyle": "-|>", "color": style.DARK})
        axes.text(1.16 * x, 1.16 * y, name, ha="center", va="center")
    axes.text(-6, 4, "drum's axis,\nz towards you", ha="right", va="bottom")
    for point, sign in ((PIN, 1), (CYLINDER, -1)):  # a point off the shoe is held to it by a rigid arm
        end = 88 * np.array([np.cos(np.deg2rad(ARC / 2)), sign * np.sin(np.deg2rad(ARC / 2))])
        axes.plot([point[0], end[0]], [point[1], end[1]], color=style.COLOUR["X"], linewidth=3, alpha=0.4)
    for at, along in ((PIN, (-1.0, 0.0)), (PIN, (0.0, -1.0))):
        axes.plot(*at, "o", color=style.COLOUR["Y"])
        spring(axes, at, along)
    axes.text(2, 76, "pin: two springs\nat one point", ha="right", va="center", color=style.COLOUR["Y"])
    push = {"arrowstyle": "-|>", "color": style.COLOUR["Tz"], "linewidth": 2}
    axes.annotate("", CYLINDER, (CYLINDER[0] - 42, CYLINDER[1]), arrowprops=push)
    axes.text(-14, -80, "wheel cylinder:\na force", ha="right", va="center", color=style.COLOUR["Tz"])
    edge = np.deg2rad(-145)
    to = (RADIUS * np.cos(edge), RADIUS * np.sin(edge))
    dimension(axes, (0, 0), to, "outer_radius R")
    out = np.array([np.cos(np.deg2rad(-28)), np.sin(np.deg2rad(-28))])
    dimension(axes, tuple((RADIUS - THICKNESS) * out), tuple(RADIUS * out), "")
    axes.text(1.14 * RADIUS * out[0], 1.14 * RADIUS * out[1], "thickness h", ha="left", va="center")
    for sign in (-1, 1):
        tip = 62 * np.array([np.cos(np.deg2rad(ARC / 2)), sign * np.sin(np.deg2rad(ARC / 2))])
        axes.plot([0, tip[0]], [0, tip[1]], color=style.DARK, linewidth=0.6, linestyle="--")
    axes.add_patch(Arc((0, 0), 104, 104, theta1=-ARC / 2, theta2=ARC / 2, color=style.DARK, linewidth=0.8))
    label = {"facecolor": "white", "edgecolor": "none", "pad": 1.5}
    axes.text(47, -22, "arc_angle β", ha="center", va="center", bbox=label)
    turn = ring(RADIUS + 17, RADIUS + 17, 100, 140)[:200]
    axes.annotate("", turn[-1], turn[-2], arrowprops={"arrowstyle": "-|>", "color": style.DARK})
    axes.plot(*turn.T, color=style.DARK, linewidth=1)
    axes.text(1.03 * turn[100, 0], 1.03 * turn[100, 1], "drum.speed > 0", ha="right", va="bottom")
    axes.text(70, 92, "leaves here:\ntrailing end", ha="left")
    axes.text(70, -92, "comes in here:\nleading end", ha="left", va="top")
    axes.set_xlim(-150, 165)
    axes.set_ylim(-122, 130)
    return figure


if __name__ == "__main__":
    style.save_figure(draw(), PICTURE)
