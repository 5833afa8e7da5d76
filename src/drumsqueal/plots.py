"""What is found, drawn on axes of the caller's: each takes `ax`, a new one unless given, and returns it.

The panels are those of the figures that the commands write.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from drumsqueal.dynamics.cycles.cycle import Cycle, Diagram
from drumsqueal.errors import RequestError
from drumsqueal.physics.model import at_lining, build_model
from drumsqueal.questions.cycle.answer import draw_with_events
from drumsqueal.questions.cycle.study import CycleBranches
from drumsqueal.questions.onset.answer import MARGIN, draw_amplitudes, shade_ranges
from drumsqueal.questions.onset.found import Onset
from drumsqueal.questions.run.figures import contact, modes, spectra
from drumsqueal.questions.run.figures.modes import draw_plane, name_modes
from drumsqueal.questions.run.figures.view import View
from drumsqueal.simulation import Result
from drumsqueal.solve.linear.modes import Stability
from drumsqueal.solve.motion import Motion
from drumsqueal.terminal import style

if TYPE_CHECKING:
    from collections.abc import Sequence


def plot_history(found: Result | Motion, names: "Sequence[str] | None" = None, ax: Axes | None = None) -> Axes:
    """Draw displacements over time, of the named coordinates or of all that move."""
    axes = _axes(ax)
    if isinstance(found, Motion):
        time, scene = found.time, None
        columns = dict(zip(found.names, found.displacement.T, strict=True))
    else:
        time, moved, scene = found.history["time"].values, found.history["displacement"], found.scene
        columns = {str(name): moved.sel(coordinate=name).values for name in moved["coordinate"].values}
    unknown = sorted(set(names or ()) - set(columns))
    if unknown:
        raise RequestError(f"{unknown[0]!r} is no coordinate; there are {', '.join(columns)}")
    shown = names or [name for name, values in columns.items() if np.ptp(values) > 0]
    factor, unit = style.time_unit(float(time[-1]))
    for name in shown:
        scale, own, label = at_lining(scene, name, np.max(np.abs(columns[name])))
        axes.plot(factor * time, scale * columns[name], color=style.COLOUR[name], label=f"{label} ({own})")
    axes.legend()
    style.frame(axes, f"Time ({unit})", "Displacement")
    return axes


def plot_growth(result: Result, ax: Axes | None = None) -> Axes:
    """Draw the amplitude of each mode over time, with the exponential growth that the eigenvalues predict."""
    axes, view = _axes(ax), _view(result)
    lines, _ = modes.draw_amplitudes(view, axes, slice(0, view.time.size))
    axes.legend(handles=lines, title="Re λ predicted / measured (1/s)", fontsize="small", title_fontsize="small")
    style.frame(axes, f"Time ({style.time_unit(view.time[-1])[1]})", None)
    return axes


def plot_spectrum(result: Result, ax: Axes | None = None) -> Axes:
    """Draw displacement spectra of the saturated motion, or of the whole record, with the eigenfrequencies (dotted)."""
    axes = _axes(ax)
    spectra.draw_spectrum(_view(result), axes)
    return axes


def plot_phase(found: Result | Motion, ax: Axes | None = None) -> Axes:
    """Draw velocity over displacement: of the middle of the lining, or of the first coordinate of a `Motion`."""
    axes = _axes(ax)
    if isinstance(found, Motion):
        name = found.names[0]
        _draw_path(axes, None, name, found.displacement[:, 0], found.velocity[:, 0])
    else:
        view = _view(found)
        contact.draw_portrait(view, axes, contact.last_part(view))
        axes.legend(fontsize="small")
    return axes


def plot_eigenvalues(found: Result | Stability, ax: Axes | None = None) -> Axes:
    """Draw frequency over growth rate of each mode: the upper half of the complex plane."""
    axes = _axes(ax)
    stability = found.stability if isinstance(found, Result) else found
    draw_plane(axes, stability)
    name_modes(axes, stability.modes)
    return axes


def plot_cycle(cycle: Cycle, name: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw velocity over displacement of a coordinate on a limit cycle, by default that with most kinetic energy."""
    axes = _axes(ax)
    name = cycle.main_coordinate if name is None else name
    k = cycle.names.index(name)
    dashes = "-" if cycle.stable else "--"
    _draw_path(
        axes, cycle.model, name, cycle.samples.displacement[:, k], cycle.samples.velocity[:, k], linestyle=dashes
    )
    return axes


def plot_onset(study: Onset, ax: Axes | None = None) -> Axes:
    """Draw the amplitudes of all motions found over the parameter, with the ranges of squeal and bistability."""
    axes = _axes(ax)
    values = [row.value for row in study.values]
    margin = MARGIN * (max(values) - min(values))
    axes.set_xlim(min(values) - margin, max(values) + margin)
    shade_ranges(axes, study)
    draw_amplitudes(axes, study)
    style.frame(axes, study.variation.label, None)
    return axes


def plot_branches(diagram: Diagram, name: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw half the peak-to-peak value of a coordinate on branches of limit cycles; unstable cycles are dashed."""
    axes = _axes(ax)
    if not diagram.branches:
        raise RequestError("there is no branch of cycles to draw")
    main = [cycle.main_coordinate for branch in diagram.branches for cycle in branch.cycles]
    name = max(main, key=main.count) if name is None else name
    sizes = [cycle.amplitude[name] for branch in diagram.branches for cycle in branch.cycles]
    scale, unit, shown = at_lining(getattr(diagram, "scene", None), name, max(sizes))
    draw_with_events(axes, diagram, style.COLOUR[name], lambda cycle: scale * cycle.amplitude[name])
    along = diagram.parameter.variation.label if isinstance(diagram, CycleBranches) else "parameter"
    style.frame(axes, along, f"{shown}, half peak to peak ({unit})")
    return axes


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    from matplotlib import pyplot  # which asks what windows there are: only where one is wanted

    return pyplot.subplots(layout="constrained")[1]


def _draw_path(axes: Axes, of: Any, name: str, moved: Any, speed: Any, **look: Any) -> None:
    scale, unit, shown = at_lining(of, name, np.max(np.abs(moved)))
    rate, per_second, _ = at_lining(of, name, np.inf)
    axes.plot(scale * moved, rate * speed, color=style.COLOUR[name], **look)
    style.frame(axes, f"{shown} ({unit})", f"Velocity of {shown} ({per_second}/s)")


def _view(result: Result) -> Any:
    return View(result, build_model(result.scene))
