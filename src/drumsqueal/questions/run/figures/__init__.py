"""Figures of a run, good enough to print: growth, spectra, phase portrait, contact, eigenvalues and frequency."""

from matplotlib.figure import Figure

from drumsqueal.files import output_folder
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.physics.model import Model
from drumsqueal.questions.run.figures.contact import draw_contact
from drumsqueal.questions.run.figures.eigenvalues import draw_eigenvalues
from drumsqueal.questions.run.figures.frequency import draw_frequency
from drumsqueal.questions.run.figures.growth import draw_growth
from drumsqueal.questions.run.figures.phase import draw_phase
from drumsqueal.questions.run.figures.spectra import draw_spectra
from drumsqueal.questions.run.figures.spectrogram import draw_spectrogram
from drumsqueal.questions.run.figures.view import View
from drumsqueal.simulation import Result

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
