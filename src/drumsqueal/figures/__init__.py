"""Figures of a run, good enough to print: growth, spectra, phase portrait, contact, eigenvalues and frequency."""

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

from matplotlib.figure import Figure

from drumsqueal.figures.contact import draw_contact
from drumsqueal.figures.eigenvalues import draw_eigenvalues
from drumsqueal.figures.frequency import draw_frequency
from drumsqueal.figures.growth import draw_growth
from drumsqueal.figures.phase import draw_phase
from drumsqueal.figures.spectra import draw_spectra
from drumsqueal.figures.spectrogram import draw_spectrogram
from drumsqueal.figures.style import styled
from drumsqueal.figures.view import View
from drumsqueal.files import output_folder
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.model import Model
from drumsqueal.simulation import Result

__all__ = ["DOTS_PER_INCH", "draw_all", "save_figures"]

DOTS_PER_INCH = 200
COMPRESSION = 3  # of 9; files 2 % larger than with the usual 6, in four fifths of the time

_DRAWINGS = {
    output_folder.GROWTH: draw_growth,
    output_folder.SPECTROGRAM: draw_spectrogram,
    output_folder.SPECTRA: draw_spectra,
    output_folder.PHASE: draw_phase,
    output_folder.CONTACT: draw_contact,
    output_folder.EIGENVALUES: draw_eigenvalues,
    output_folder.FREQUENCY: draw_frequency,
}


def draw_all(result: Result, model: Model) -> dict[str, Figure]:
    """Draw every figure that the run supports, by name; `model` is the one over the coordinates that moved.

    A record that is too short, or in which nothing moves, leaves out those figures that would show nothing. Raises
    KeyboardInterrupt between two figures.
    """
    view = View(result, model)
    drawn = {}
    for name, draw in _DRAWINGS.items():
        stop_if_interrupted()
        drawn[name] = draw(view)
    return {name: figure for name, figure in drawn.items() if figure is not None}


def save_figures(figures: Mapping[str, Figure], folder: Path) -> list[Path]:
    """Save figures into a folder, each whole or not at all, and return the paths; 200 dpi.

    Raises OSError, and KeyboardInterrupt between two figures.
    """
    paths = []
    with styled():
        for name, figure in figures.items():
            stop_if_interrupted()
            content = BytesIO()
            figure.savefig(content, dpi=DOTS_PER_INCH, pil_kwargs={"compress_level": COMPRESSION})
            paths.append(folder / output_folder.figure_file(name))
            output_folder.write_whole(paths[-1], content.getvalue())
    return paths
