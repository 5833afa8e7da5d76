"""How the frequency of the leading mode goes from its onset to the saturated motion, and why."""

from typing import NamedTuple

import numpy as np

from drumsqueal.findings.departure import Departure
from drumsqueal.findings.saturation import Saturation
from drumsqueal.findings.signals import Ridge, follow_line
from drumsqueal.findings.softening import Softening, explain_frequency
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.modes import Stability

PERIODS = 16.0  # a window over which the frequency is a mean
ROOM = 1.5  # the line is looked for from the lower of the two frequencies over this to the higher one times it


class FrequencyDrift(NamedTuple):
    """The frequency (Hz) of a mode at onset (predicted), in the saturated motion (its line), and over time.

    `ridge` follows the strongest line of `coordinate` about it; `softening` is what the contact as it was on average
    makes of the mode's frequency.
    """

    mode: str
    coordinate: str
    onset_Hz: float
    saturated_Hz: float
    ridge: Ridge
    softening: Softening

    @property
    def shift(self) -> float:
        """Saturated frequency over that at onset, less 1."""
        return self.saturated_Hz / self.onset_Hz - 1

    @property
    def contact_loss_shift(self) -> float:
        """What the loss of contact alone predicts of it."""
        return self.softening.contact_loss_Hz / self.onset_Hz - 1

    @property
    def predicted_shift(self) -> float:
        """What contact and friction as they were on average predict."""
        return self.softening.with_friction_Hz / self.onset_Hz - 1


def follow_frequency(
    departure: Departure, part: slice, stability: Stability, model: Model, saturation: Saturation
) -> FrequencyDrift | None:
    """Follow the mode whose onset frequency the main line is compared with; None where there is no such line or mode.

    `model` is over the coordinates of `stability`, `part` the saturated part of the record.
    """
    main = saturation.main
    mode = next((mode for mode in stability.modes if mode.label == saturation.nearest_mode), None)
    if main is None or mode is None:
        return None
    signal = departure.column(main.coordinate)
    ends = sorted((main.frequency_Hz, mode.frequency_Hz))
    low, high = ends[0] / ROOM, min(ends[1] * ROOM, 0.45 * departure.sample_rate)
    if signal.size * 0.5 * (low + high) < 2 * PERIODS * departure.sample_rate or high <= low:
        return None
    ridge = follow_line(signal, departure.sample_rate, low=low, high=high, periods=PERIODS)
    softening = explain_frequency(departure, part, model, stability.steady_state, mode, saturation.contact_fraction)
    if not np.all(np.isfinite(softening)):
        return None
    return FrequencyDrift(mode.label, main.coordinate, mode.frequency_Hz, main.frequency_Hz, ridge, softening)
