"""Figures of a run, good enough to print: from the growth of its modes to the waterfall of a run-up."""

from collections.abc import Callable
from pkgutil import resolve_name

from matplotlib.figure import Figure

from drumsqueal.files import output_folder
from drumsqueal.physics.model import Model
from drumsqueal.questions.run.figures.view import View
from drumsqueal.simulation import Result

_DRAWINGS = {
    name: resolve_name(f"{__name__}.{module}:draw_{name}")
    for name, module in (output_folder.FIGURES | output_folder.WHERE_BRAKE | output_folder.WHERE_CHANGING).items()
}


def drawings(result: Result, model: Model) -> dict[str, Callable[[object], Figure | None]]:
    """What draws each figure of a run, by name; `model` is the one over the coordinates that moved.

    It gives None for a record that is too short, or in which nothing moves, to show anything there.
    """
    view, found = View(result, model), result.findings
    wanted = output_folder.run_figures(changing=found.changing, brake=found.brake is not None)
    left_out = {*output_folder.WHERE_BRAKE, *output_folder.WHERE_CHANGING}.difference(wanted)
    return {name: lambda _, draw=draw: draw(view) for name, draw in _DRAWINGS.items() if name not in left_out}
