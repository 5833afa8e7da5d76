"""How every figure looks: size, fonts, and one fixed colour for each coordinate and each state of the contact."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font

from drumsqueal.coordinates import is_elastic, is_of_drum, number_of, shoe_of
from drumsqueal.files import output_folder

WIDTH_MM, HEIGHT_MM = 170.0, 110.0
DOTS_PER_INCH = 200
MM_PER_INCH = 25.4
ENDING = 30  # letters at the end of a title that is cut
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
SHOES_APART = b"11407"  # with which leading and trailing, left and right, a and b and other such pairs differ
DARKEST, SHADE = 90 / 255, 0.4  # mean of red, green and blue up to which a shade is lighter, and by how much


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
    return 1 + hashlib.blake2b(name.removesuffix(".").encode(), digest_size=1, salt=SHOES_APART).digest()[0] % 2


def _shade(colour: str, number: int) -> str:
    """The colour of the second, third … mode of the same name: a lighter shade of a dark colour, else a darker one."""
    plain, left = to_rgb(colour), (1 - SHADE) ** (number - 1)
    towards = 1.0 if sum(plain) / 3 < DARKEST else 0.0
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
            shown = f"{heading[: kept - ENDING].rstrip()}…{heading[-ENDING:]}"
        text.set_text(f"{shown}:\n{subject}")
    return figure


def legend_below(figure: Figure, handles: Sequence[Any], columns: int) -> None:
    """Explain handles below the axes, in as many columns as fit the width, at most so many."""
    for count in range(columns, 0, -1):
        legend = figure.legend(handles=list(handles), loc="outside lower center", ncols=count, columnspacing=1.5)
        if count == 1 or legend.get_window_extent().width <= figure.bbox.width:
            return
        legend.remove()


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
