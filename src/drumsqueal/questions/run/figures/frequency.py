"""Frequency of the leading mode over time, from its onset to the saturated motion, and the contact underneath."""

import numpy as np
from matplotlib.figure import Figure

from drumsqueal.questions.run.figures.fractions import draw_fractions
from drumsqueal.questions.run.figures.view import View
from drumsqueal.terminal import style
from drumsqueal.terminal.placement import label_right_edge

ROOM = 0.06  # of the range of frequencies, above and below


@style.styled()
def draw_frequency(view: View) -> Figure | None:
    """Draw the frequency with what predicts it; None where no mode was followed from onset to saturation."""
    drift = view.result.findings.frequency
    if drift is None or drift.ridge is None or drift.ridge.time_s.size < 2:
        return None
    figure = style.new_figure(view.title, f"frequency of {drift.mode}, in the motion of {drift.coordinate}")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    factor, unit = style.time_unit(view.time[-1])
    upper.plot(
        (view.time[0] + drift.ridge.time_s) * factor, drift.ridge.frequency_Hz, color=style.COLOUR[drift.coordinate]
    )
    when = f" at t = {view.result.stability.time:g} s" if view.result.findings.changing else ""
    levels = [
        (drift.onset_Hz, f"eigenvalue{when}", style.DARK, "-"),
        (drift.predicted_by_contact_loss_Hz, "loss of contact", style.TOUCHING, "--"),
        (drift.predicted_by_root_of_contact_share_Hz, "√(contact fraction)", style.TOUCHING, ":"),
        (drift.saturated_Hz, "saturated line", style.COLOUR[drift.coordinate], "-"),
    ]
    for frequency, _, colour, dashes in levels:
        upper.axhline(frequency, color=colour, linewidth=0.6, linestyle=dashes)
    values = np.array([*drift.ridge.frequency_Hz, *(level[0] for level in levels)])
    room = ROOM * float(np.ptp(values)) or 1.0
    upper.set_ylim(values.min() - room, values.max() + room)
    style.frame(upper, None, "Frequency (Hz)")
    label_right_edge(upper, [(value, f"{value:.0f} Hz {name}", colour) for value, name, colour, _ in levels], reach=6.0)
    draw_fractions(view, lower, slice(0, view.time.size))
    style.frame(lower, f"Time ({unit})", "Lining (%)")
    lower.set_xlim(view.time[0] * factor, view.time[-1] * factor)
    return figure
