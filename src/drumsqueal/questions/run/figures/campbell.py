"""Campbell lines: the frequencies of the eigenvalues while drum speed or load change, marked where unstable."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from drumsqueal.findings.ramp import CampbellLine, Ramp
from drumsqueal.terminal import style

DOTTED = (0, (2, 4))
STABLE, UNSTABLE = 0.6, 1.6  # points of a line
UNSTABLE_COLOUR = style.COLOUR["Tx"]  # which stands out on the dark pictures


def draw_campbell_lines(axes: Axes, line: CampbellLine, place: NDArray[np.float64]) -> None:
    """Draw the frequency (kHz) of a mode over what it has at each of its times; solid where it is unstable."""
    order = np.argsort(place, kind="stable")  # not to and fro, or the dots of one way fill the gaps of the other
    x, frequency = place[order], np.array(line.frequency_Hz)[order] / 1e3
    grows = np.array(line.growth_rate_1_per_s)[order] > 0
    axes.plot(x, frequency, color="white", linewidth=STABLE, linestyle=DOTTED, gid=f"predicted {line.mode}")
    if grows.any():
        unstable = np.where(grows, frequency, np.nan)
        axes.plot(x, unstable, color=UNSTABLE_COLOUR, linewidth=UNSTABLE, gid=f"unstable {line.mode}")


def line_labels(ramp: Ramp, highest: float) -> list[tuple[float, str, str]]:
    """The names of the modes at the frequencies (kHz) that they end with, as far as these are shown (Hz)."""
    last = [(line, line.frequency_Hz[-1]) for line in ramp.lines if line.frequency_Hz[-1] <= highest]
    return [(f / 1e3, f"{line.mode} {f:.0f} Hz", style.COLOUR[line.mode]) for line, f in last]


def line_legend(axes: Axes, *others: Patch) -> None:
    """Explain the lines above the axes, at the right, and what else there is."""
    handles = [
        Line2D([], [], color=style.DARK, linewidth=STABLE, linestyle=DOTTED, label="eigenvalue, stable"),
        Line2D([], [], color=UNSTABLE_COLOUR, linewidth=UNSTABLE, label="eigenvalue, unstable"),
        *others,
    ]
    legend = axes.legend(
        handles=handles,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        borderaxespad=1.6,
        ncols=len(handles),
        columnspacing=1.2,
    )
    legend.set_clip_on(False)  # or the layout takes it for hidden and leaves it no room
