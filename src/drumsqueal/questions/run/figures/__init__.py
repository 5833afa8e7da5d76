"""Figures of a run, good enough to print: from the growth of its modes to the waterfall of a run-up."""

from collections.abc import Callable

from matplotlib.figure import Figure

from drumsqueal.files import output_folder
from drumsqueal.physics.model import Model
from drumsqueal.questions.run.figures.contact import draw_contact, draw_phase, draw_pressure
from drumsqueal.questions.run.figures.modes import draw_eigenvalues, draw_frequency, draw_growth
from drumsqueal.questions.run.figures.spectra import draw_spectra, draw_spectrogram, draw_waterfall
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
    output_folder.PRESSURE: draw_pressure,
    output_folder.WATERFALL: draw_waterfall,
}


def drawings(result: Result, model: Model) -> dict[str, Callable[[object], Figure | None]]:
    """What draws each figure of a run, by name; `model` is the one over the coordinates that moved.

    It gives None for a record that is too short, or in which nothing moves, to show anything there.
    """
    view, found = View(result, model), result.findings
    asked = {output_folder.PRESSURE: found.brake, output_folder.WATERFALL: found.changing}
    return {name: lambda _, draw=draw: draw(view) for name, draw in _DRAWINGS.items() if asked.get(name, True)}
