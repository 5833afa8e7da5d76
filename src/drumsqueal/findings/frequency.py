"""How the frequency of the leading mode goes from its onset to the saturated motion, and why."""

import numpy as np
from pydantic import computed_field

from drumsqueal.findings.part import Finding, Held
from drumsqueal.findings.saturation import Saturation
from drumsqueal.findings.signals import Ridge, follow_line
from drumsqueal.findings.softening import explain_frequency
from drumsqueal.findings.vibration import Vibration
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.modes import Stability

MOST_INSTANTS = 100  # of the frequency over time that are written down
PERIODS = 16.0  # a window over which the frequency is a mean
ROOM = 1.5  # the line is looked for from the lower of the two frequencies over this to the higher one times it


class OverTime(Finding):
    """A frequency over time."""

    time_s: tuple[float, ...]
    frequency_Hz: tuple[float, ...]


class FrequencyDrift(Finding):
    """The frequency (Hz) of a mode at onset (predicted), in the saturated motion (its line), and over time.

    `over_time` has some instants of `ridge`, which follows the strongest line of `coordinate` about it. What the
    contact as it was on average makes of the mode's frequency is predicted with loss of contact alone, with friction as
    it acted, and by the cruder onset frequency × √(mean fraction of the lining in contact).
    """

    mode: str
    coordinate: str
    onset_Hz: float
    saturated_Hz: float
    predicted_by_contact_loss_Hz: float
    predicted_with_friction_Hz: float
    predicted_by_root_of_contact_share_Hz: float
    over_time: OverTime
    ridge: Ridge | None = Held

    @computed_field
    @property
    def shift(self) -> float:
        """Saturated frequency over that at onset, less 1."""
        return self.saturated_Hz / self.onset_Hz - 1

    @computed_field
    @property
    def predicted_by_contact_loss_shift(self) -> float:
        """What the loss of contact alone predicts of it."""
        return self.predicted_by_contact_loss_Hz / self.onset_Hz - 1

    @computed_field
    @property
    def predicted_with_friction_shift(self) -> float:
        """What contact and friction as they were on average predict."""
        return self.predicted_with_friction_Hz / self.onset_Hz - 1


def follow_frequency(
    vibration: Vibration, part: slice, stability: Stability, model: Model, saturation: Saturation
) -> FrequencyDrift | None:
    """Follow the mode whose onset frequency the main line is compared with; None where there is no such line or mode.

    `model` is over the coordinates of `stability`, `part` the saturated part of the record.
    """
    main = saturation.main
    mode = next((mode for mode in stability.modes if mode.label == saturation.nearest_mode), None)
    if main is None or mode is None:
        return None
    signal = vibration.column(main.coordinate)
    ends = sorted((main.frequency_Hz, mode.frequency_Hz))
    low, high = ends[0] / ROOM, min(ends[1] * ROOM, 0.45 * vibration.sample_rate)
    if signal.size * 0.5 * (low + high) < 2 * PERIODS * vibration.sample_rate or high <= low:
        return None
    ridge = follow_line(signal, vibration.sample_rate, low=low, high=high, periods=PERIODS)
    softening = explain_frequency(vibration, part, model, stability.steady_state, mode, saturation.contact_fraction)
    if not np.all(np.isfinite(softening)):
        return None
    every = max(1, -(-ridge.time_s.size // MOST_INSTANTS))
    some = (tuple(values[::every].tolist()) for values in (ridge.time_s, ridge.frequency_Hz))
    return FrequencyDrift(
        mode=mode.label,
        coordinate=main.coordinate,
        onset_Hz=mode.frequency_Hz,
        saturated_Hz=main.frequency_Hz,
        predicted_by_contact_loss_Hz=softening.contact_loss_Hz,
        predicted_with_friction_Hz=softening.with_friction_Hz,
        predicted_by_root_of_contact_share_Hz=softening.by_fraction_Hz,
        over_time=OverTime(**dict(zip(("time_s", "frequency_Hz"), some, strict=True))),
        ridge=ridge,
    )
