"""How every figure looks: size, fonts, fixed colours, labels that do not overlap, and long records in few points.

Labels are placed here and not by adjustText, which takes longer and writes them onto markers and axes.
"""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.axis import XAxis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font
from matplotlib.legend import Legend
from matplotlib.text import Annotation
from matplotlib.ticker import AutoLocator, FuncFormatter
from matplotlib.transforms import Affine2D, Transform
from numpy.typing import ArrayLike, NDArray

from drumsqueal.coordinates import is_elastic, is_of_drum, number_of, shoe_of
from drumsqueal.files import output_folder

DOTS_PER_INCH = 200
WIDTH_MM, HEIGHT_MM = 170.0, 110.0
MM_PER_INCH = 25.4
FONT = "DejaVu Sans"  # comes with matplotlib, so that a figure is the same everywhere
TEXT_SIZE, SMALL_SIZE, TITLE_SIZE = 8.0, 7.0, 9.0  # points

# The palette of Okabe and Ito, which the colour-blind can distinguish; a mode has the colour of its coordinate.
_RIGID = {
    "X": "#0072B2",
    "Y": "#D55E00",
    "Z": "#B8A500",
    "Tx": "#56B4E9",
    "Ty": "#E69F00",
    "Tz": "#009E73",
}
# Of free modes, one after the other and again from the first; darker than those of the rigid motion or far from them.
_ELASTIC = ("#882255", "#332288", "#CC79A7", "#117733", "#AA4499", "#661100", "#6699CC", "#999933")
# Of a drum's modes, two by two of about one hue, as they come in pairs.
_OF_DRUM = ("#8C510A", "#BF812D", "#01665E", "#35978F", "#762A83", "#9970AB", "#1B7837", "#5AAE61")


class _Colours(dict[str, str]):
    def __missing__(self, label: str) -> str:
        name, _, number = label.partition(" (")
        if number:
            return _shade(self[name], int(number.removesuffix(")")))
        if shoe := shoe_of(name):
            return _shade(self[name.removeprefix(shoe)], _shade_of_shoe(shoe))
        if not is_elastic(name):
            raise KeyError(name)
        colours = _OF_DRUM if is_of_drum(name) else _ELASTIC
        return colours[(number_of(name) - 1) % len(colours)]


def _shade_of_shoe(name: str) -> int:
    """1 or 2: which shade the coordinates of one of several shoes have, in all figures, whichever shoes there are."""
    shoes_apart = b"11407"  # with which leading and trailing, left and right, a and b and other such pairs differ
    return 1 + hashlib.blake2b(name.removesuffix(".").encode(), digest_size=1, salt=shoes_apart).digest()[0] % 2


def _shade(colour: str, number: int) -> str:
    """The colour of the second, third … mode of the same name: a lighter shade of a dark colour, else a darker one."""
    darkest, shade = 90 / 255, 0.4  # mean of red, green and blue up to which a shade is lighter, and by how much
    plain, left = to_rgb(colour), (1 - shade) ** (number - 1)
    towards = 1.0 if sum(plain) / 3 < darkest else 0.0
    red, green, blue = (towards + (part - towards) * left for part in plain)
    return to_hex((red, green, blue))


COLOUR: Mapping[str, str] = _Colours(_RIGID)
"""The colour of a coordinate, or of a mode by its label."""
TOUCHING, SEPARATED, REVERSED, STUCK = "#444444", "#BDBDBD", "#AA3377", "#0072B2"  # states of the contact
PALE, FAINT, DARK = "#EEEEEE", "#CCCCCC", "#333333"

_RC: dict[Any, Any] = {
    "font.size": TEXT_SIZE,
    "font.family": "sans-serif",
    "font.sans-serif": [FONT],
    "axes.labelsize": TEXT_SIZE,
    "axes.titlesize": TEXT_SIZE,
    "axes.linewidth": 0.6,
    "axes.edgecolor": DARK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "legend.fontsize": SMALL_SIZE,
    "legend.title_fontsize": SMALL_SIZE,
    "legend.frameon": False,
    "lines.linewidth": 0.9,
    "axes.unicode_minus": True,
    "axes.formatter.useoffset": False,
    "figure.autolayout": False,
    "figure.constrained_layout.use": False,
    "figure.constrained_layout.h_pad": 0.04,
    "figure.constrained_layout.w_pad": 0.04,
}


@contextmanager
def styled() -> Iterator[None]:
    """Context, and decorator, in which figures are built and saved; it leaves the global settings as they were."""
    with rc_context(_RC):
        yield


def new_figure(title: str, subject: str) -> Figure:
    """Return an empty figure headed by the title of the scene and what is shown, on lines of their own if need be."""
    ending = 30  # letters at the end of a title that is cut
    size = (WIDTH_MM / MM_PER_INCH, HEIGHT_MM / MM_PER_INCH)
    figure = Figure(size, dpi=DOTS_PER_INCH, layout="constrained")
    FigureCanvasAgg(figure)  # what measures text; without it a figure makes one for every word
    heading = _drawable(" ".join(title.split()))
    # A title is the user's own words: a dollar sign in it does not start a formula.
    text = figure.suptitle(subject, fontsize=TITLE_SIZE, x=0.01, ha="left", parse_math=False)

    def excess(shown: str) -> float:
        text.set_text(shown)
        return text.get_window_extent().width / (0.98 * figure.bbox.width)

    if heading and excess(f"{heading}: {subject}") > 1:
        shown, kept = heading, len(heading)
        while (over := excess(shown)) > 1:  # its end may name the shoe
            kept = min(kept - 1, int(kept / over))
            shown = f"{heading[: kept - ending].rstrip()}…{heading[-ending:]}"
        text.set_text(f"{shown}:\n{subject}")
    return figure


def legend_below(figure: Figure, handles: Sequence[Any], columns: int) -> None:
    """Explain handles below the axes, in as many columns as fit the width, at most so many."""
    for count in range(columns, 0, -1):
        legend = figure.legend(handles=list(handles), loc="outside lower center", ncols=count, columnspacing=1.5)
        if count == 1 or legend.get_window_extent().width <= figure.bbox.width:
            return
        legend.remove()


def legend_above(axes: Axes, *, right: bool = False, **look: Any) -> Legend:
    """Explain what is drawn above the frame, from its left end or up to its right one."""
    place = ("lower right", (1.0, 1.0)) if right else ("lower left", (0.0, 1.0))
    return axes.legend(loc=place[0], bbox_to_anchor=place[1], **{"borderaxespad": 0.2, **look})


def _drawable(text: str) -> str:
    """The text with an empty box for every letter that the font lacks, which matplotlib would warn of at each."""
    font = get_font(findfont(FONT))
    return "".join(letter if font.get_char_index(ord(letter)) else "□" for letter in text)


def frame(axes: Axes, x_label: str | None, y_label: str | None) -> None:
    """Label the axes and set their ticks; None leaves a label out."""
    axes.tick_params(which="both", labelsize=SMALL_SIZE)
    axes.spines[["top", "right"]].set_visible(False)
    if x_label is not None:
        axes.set_xlabel(x_label)
    if y_label is not None:
        axes.set_ylabel(y_label)


def label_rows(axes: Axes, labels: Sequence[str]) -> None:
    """Let an axis have a row for each label, the first at the top, with a faint line between two."""
    axes.set_yticks(range(len(labels)), labels)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(labels) - 0.5, -0.5)
    for place in range(1, len(labels)):
        axes.axhline(place - 0.5, color=FAINT, linewidth=0.4, zorder=0.5)


def time_unit(duration: float) -> tuple[float, str]:
    """Return the factor from seconds and the unit in which a time axis of that length (s) reads well."""
    return (1.0, "s") if duration > 2.0 else (1e3, "ms")  # a longer time axis is in s, a shorter one in ms


def lay_out(figure: Figure) -> None:
    """Give the axes their places, once: matplotlib would do that at every drawing, and draws twice where it does."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine(None)


@styled()
def save_figure(figure: Figure, path: Path) -> None:
    """Save a figure, whole or not at all; 200 dpi. Raises OSError."""
    lay_out(figure)
    content = BytesIO()
    # 3 of 9; files 2 % larger than with the usual 6, in four fifths of the time
    figure.savefig(content, dpi=DOTS_PER_INCH, pil_kwargs={"compress_level": 3})
    output_folder.write_whole(path, content.getvalue())


COLUMNS = 800  # a record is reduced to this many columns of a printed line


class _InUnits(AutoLocator):
    """Ticks at round multiples of a unit."""

    def __init__(self, size: float) -> None:
        super().__init__()
        self._size = size

    def tick_values(self, vmin: float, vmax: float) -> NDArray[np.float64]:
        """As of AutoLocator, between two values in SI."""
        return self._size * np.asarray(super().tick_values(vmin / self._size, vmax / self._size))


def tick_in_units(axis: XAxis, size: float) -> None:
    """Mark an axis of values in SI in a unit that is `size` in SI."""
    if size != 1:
        axis.set_major_locator(_InUnits(size))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value / size:.6g}".replace("-", "\N{MINUS SIGN}")))


def spread(positions: ArrayLike, gap: float, low: float, high: float) -> NDArray[np.float64]:
    """Move positions apart to at least `gap`, in order and within [low, high], as little as that takes.

    Where there is no room for `gap` the labels share what room there is.
    """
    wanted = np.asarray(positions, dtype=np.float64)
    order = np.argsort(wanted, kind="stable")
    gap = min(gap, (high - low) / max(wanted.size - 1, 1))
    # In steps beyond the gap the task is an isotonic fit: labels that would collide share the mean of their wishes.
    steps = gap * np.arange(wanted.size)
    fitted = np.clip(scipy.optimize.isotonic_regression(wanted[order] - steps).x, low, high - steps[-1:])
    result = np.empty_like(wanted)
    result[order] = fitted + steps
    return result


def label_right_edge(axes: Axes, labels: list[tuple[float, str, str]], reach: float = 10.0) -> list[Annotation]:
    """Write (y, text, colour) to the right of the axes at height y, moved apart where they are close."""
    label_step = 1.3 * SMALL_SIZE  # points from one line of labels to the next
    return _label_edge(axes, labels, reach, upright=True, step=label_step)


def label_top_edge(axes: Axes, labels: list[tuple[float, str, str]], reach: float = 9.0) -> list[Annotation]:
    """Write (x, text, colour) above the axes at x, moved apart where they are close."""
    longest = max((len(line) for _, text, _ in labels for line in text.split("\n")), default=0)
    return _label_edge(axes, labels, reach, upright=False, step=0.68 * SMALL_SIZE * longest)


def _label_edge(
    axes: Axes, labels: list[tuple[float, str, str]], reach: float, *, upright: bool, step: float
) -> list[Annotation]:
    if not labels:
        return []
    limits = axes.get_ylim() if upright else axes.get_xlim()
    look = {"arrowstyle": "-", "linewidth": 0.5, "shrinkA": 0, "shrinkB": 0}
    look["relpos"] = (0.0, 0.5) if upright else (0.5, 0.0)  # where a line begins: it does not run through other labels
    fractions = (np.array([place for place, _, _ in labels]) - limits[0]) / (limits[1] - limits[0])

    def place(k: int) -> Transform:
        """Where a label goes, found when it is drawn: only then is it known how long the edge is."""
        figure, box = axes.get_figure(root=True), axes.get_window_extent()
        assert figure is not None
        point = figure.dpi / 72
        placed = spread(fractions, step * point / (box.height if upright else box.width), 0.0, 1.0)[k]
        if upright:
            return Affine2D().translate(box.x1 + reach * point, box.y0 + placed * box.height)
        return Affine2D().translate(box.x0 + placed * box.width, box.y1 + reach * point)

    return [
        axes.annotate(
            text,
            (1.0, fraction) if upright else (fraction, 1.0),
            xycoords="axes fraction",
            xytext=(0.0, 0.0),
            textcoords=lambda _, k=k: place(k),
            color=colour,
            fontsize=SMALL_SIZE,
            ha="left" if upright else "center",
            va="center" if upright else "bottom",
            annotation_clip=False,
            arrowprops=look | {"color": colour},
        )
        for k, (fraction, (_, text, colour)) in enumerate(zip(fractions, labels, strict=True))
    ]


def label_points(
    axes: Axes,
    labels: list[tuple[float, float, str, str]],
    obstacles: list[tuple[float, float]],
    distance: float = 8.0,
) -> list[Annotation]:
    """Write (x, y, text, colour) next to each point, inside the frame; lays the figure out.

    The labels keep clear of one another, of the points, of further markers at `obstacles`, of all lines in the axes and
    of x = 0, and on the point's side of that if they can. A line leads to each that is not straight to the side of its
    point, or above or below it, and near.
    """
    marker, stroke = 5.0, 2.0  # points: half the width of a marker, and the width of a line
    # Where a label may stand around its point, in order of preference: direction of the offset and alignment.
    around = (
        (1, 0, "left", "center"),
        (-1, 0, "right", "center"),
        (0, 1, "center", "bottom"),
        (0, -1, "center", "top"),
        (0.8, 0.8, "left", "bottom"),
        (-0.8, 0.8, "right", "bottom"),
        (0.8, -0.8, "left", "top"),
        (-0.8, -0.8, "right", "top"),
    )
    figure = axes.get_figure(root=True)
    assert figure is not None
    lay_out(figure)
    frame, places = axes.get_window_extent(), [(x, y) for x, y, _, _ in labels] + obstacles
    dots = axes.transData.transform(places or [(0.0, 0.0)])
    point, zero = figure.dpi / 72, axes.transData.transform((0.0, 0.0))[0]
    whole = np.array([frame.extents])
    halves = whole.copy(), whole.copy()
    halves[0][0, 2] = halves[1][0, 0] = zero
    lines = _around(_strokes(axes, stroke * point), stroke * point / 2)
    taken = np.vstack([_around(dots, marker * point), lines, [zero - 1, frame.y0, zero + 1, frame.y1]])
    made = []
    for x, y, text, colour in sorted(labels, key=lambda label: -len(label[2])):
        look: dict[str, Any] = {"textcoords": "offset points", "color": colour, "fontsize": SMALL_SIZE}
        trial, dot = axes.annotate(text, (x, y), xytext=(0, 0), **look), axes.transData.transform((x, y))
        best = np.inf
        for scale in (1.0, 2.0, 3.5):
            for right, up, horizontal, vertical in around:
                offset = scale * distance * np.array([right, up])
                trial.set(position=offset, ha=horizontal, va=vertical)
                box = np.array([trial.get_window_extent().padded(3.0).extents])
                if not right:  # above or below there is room for it beside its place, too
                    low, high = (frame.x0, max(zero, frame.x0)) if x < 0 else (min(zero, frame.x1), frame.x1)
                    aside = np.clip(box[0, 0], low, max(low, high - np.ptp(box[0, ::2]))) - box[0, 0]
                    box[0, ::2] += aside
                    offset[0] += aside / point
                # The line from the marker's rim on, as some small boxes.
                line = _around(dot + point * np.linspace(marker / np.hypot(*offset), 1, 8)[:, None] * offset, 1.0)
                led = scale > 1 or right * up != 0
                drawn = np.vstack([box, line]) if led else box
                cost = _common(drawn, taken) + _common(box, box) - _common(box, whole)
                # 0.1 of the price of covering something, for standing across the line x = 0
                cost += 0.1 * _common(box, halves[int(x < 0)])
                if cost < best:
                    best, filled = cost, drawn
                    relative = ((1 - np.sign(right)) / 2, (1 - np.sign(up)) / 2)
                    leader = {"arrowstyle": "-", "color": colour, "linewidth": 0.5, "shrinkA": 0, "shrinkB": 0}
                    chosen = {
                        "xytext": offset,
                        "ha": horizontal,
                        "va": vertical,
                        "arrowprops": leader | {"relpos": relative} if led else None,
                    }
            if best < 1.0:
                break
        trial.remove()
        label = axes.annotate(text, (x, y), **look, **chosen)
        label.set_in_layout(False)  # it stays inside the frame
        taken = np.vstack([taken, filled])
        made.append(label)
    return made


def _strokes(axes: Axes, step: float) -> NDArray[np.float64]:
    """Places (k, 2) on the lines in some axes inside their frame, a step (dots) apart."""
    found = [np.empty((0, 2))]
    for line in axes.lines:
        shown = line.get_path().cleaned(line.get_transform(), remove_nans=True, clip=axes.bbox.extents)
        for places in map(np.asarray, shown.to_polygons(closed_only=False)):
            far = np.append(0.0, np.cumsum(np.hypot(*np.diff(places, axis=0).T)))
            along = np.arange(0.0, far[-1] + step, step)
            found.append(np.column_stack([np.interp(along, far, part) for part in places.T]))
    return np.vstack(found)


def _around(places: NDArray[np.float64], half: float) -> NDArray[np.float64]:
    """Squares (places, 4) about places, by left, bottom, right and top."""
    return np.hstack([places - half, places + half])


def _common(some: NDArray[np.float64], others: NDArray[np.float64]) -> float:
    """The area that boxes have in common with others."""
    low, high = np.maximum(some[:, None, :2], others[:, :2]), np.minimum(some[:, None, 2:], others[:, 2:])
    return float(np.prod(np.maximum(high - low, 0.0), axis=-1).sum())


def extremes(
    values: NDArray[np.float64], columns: int = COLUMNS
) -> tuple[NDArray[np.intp], NDArray[np.float64], NDArray[np.float64]]:
    """Return first index, smallest and largest value of each of at most `columns` equal pieces of a record."""
    starts = np.unique(np.linspace(0, values.size, min(columns, values.size), endpoint=False).astype(np.intp))
    return starts, np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)


def finer(
    time: NDArray[np.float64], values: NDArray[np.float64], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Interpolate samples (time, ...) by a quintic spline to `count` times; seven samples a period are enough."""
    grid = np.linspace(time[0], time[-1], count)
    return grid, between(time, values, grid)


def between(time: NDArray[np.float64], values: NDArray[np.float64], wanted: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (wanted, ...) of that spline through six samples or more, at times within theirs."""
    return scipy.interpolate.make_interp_spline(time, values, k=5)(wanted)
