"""Figures of a run, good enough to print: growth, spectrogram, spectra, phase portrait, contact and eigenvalues."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from drumsqueal.figures.contact import draw_contact
from drumsqueal.figures.eigenvalues import draw_eigenvalues
from drumsqueal.figures.growth import draw_growth
from drumsqueal.figures.phase import draw_phase
from drumsqueal.figures.spectra import draw_spectra
from drumsqueal.figures.spectrogram import draw_spectrogram
from drumsqueal.figures.style import styled
from drumsqueal.figures.view import View
from drumsqueal.model import Model
from drumsqueal.simulation import Result

__all__ = ["DOTS_PER_INCH", "draw_all", "save_figures"]

DOTS_PER_INCH = 200

_DRAWINGS = {
    "growth": draw_growth,
    "spectrogram": draw_spectrogram,
    "spectra": draw_spectra,
    "phase": draw_phase,
    "contact": draw_contact,
    "eigenvalues": draw_eigenvalues,
}


def draw_all(result: Result, model: Model) -> dict[str, Figure]:
    """Draw every figure that the run supports, by name; `model` is the one over the coordinates that moved.

    A record that is too short, or in which nothing moves, leaves out those figures that would show nothing.
    """
    view = View(result, model)
    drawn = {name: draw(view) for name, draw in _DRAWINGS.items()}
    return {name: figure for name, figure in drawn.items() if figure is not None}


def save_figures(figures: Mapping[str, Figure], directory: Path, *, formats: Sequence[str] = ("png",)) -> list[Path]:
    """Save figures as directory/name.format and return the paths; pixels at 200 dpi. Raises OSError."""
    directory.mkdir(parents=True, exist_ok=True)
    paths = []
    with styled():
        for name, figure in figures.items():
            for ending in formats:
                path = directory / f"{name}.{ending}"
                figure.savefig(path, dpi=DOTS_PER_INCH)
                paths.append(path)
    return paths
