"""The growth phase: frequency and growth of each mode as the eigenvalues predict and the transient shows them."""

from enum import StrEnum
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import computed_field

from drumsqueal.findings.columns import Column
from drumsqueal.findings.part import Finding, Held, Positive
from drumsqueal.findings.signals.growth import Growth as GrowthFit
from drumsqueal.findings.signals.growth import fit_growth, modal_frequency
from drumsqueal.findings.signals.spectra import amplitude_spectrum, peak_near
from drumsqueal.findings.vibration import FEWEST_FOR_SPECTRUM, Vibration
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.modes import NEUTRAL_FRACTION, Mode, Stability

# A mode is followed while it makes up at least this fraction of what its own coordinate has done so far: a weaker one
# drowns in what the others feed into it at second order of their size.
CLEAN_FRACTION = 3e-2
UNEXCITED_FRACTION = 1e-12  # of the largest displacement: a mode below it is not there
FEWEST_PERIODS = 5  # of a mode, for its frequency and growth to be measured


class Note(StrEnum):
    """Why frequency or growth of a mode were not measured."""

    MEASURED = ""
    NOT_STARTED = "nothing was started"
    NOT_EXCITED = "not excited by this start"
    STICKING = "the lining sticks at the start"
    DRIVEN = "driven by the harmonic force"
    MOVED_BY_SPEED = "moved by the changing drum speed"
    MOVED_BY_LOAD = "moved by the changing load"
    MOVED_BY_BOTH = "moved by the changing drum speed and load"
    MOVED_BY_FORCE = "moved by the changing force"
    MOVED_BY_SPEED_AND_FORCE = "moved by the changing drum speed and force"
    MOVED_BY_LOAD_AND_FORCE = "moved by the changing load and force"
    MOVED_BY_ALL = "moved by the changing drum speed and load and force"
    TOO_SHORT = "the record is too short"
    NONLINEAR = "nonlinear from the start, or nearly so"
    HIDDEN = f"hidden by the other modes after fewer than {FEWEST_PERIODS} periods"
    SOON_NONLINEAR = f"nonlinear after fewer than {FEWEST_PERIODS} periods"
    FEW_PERIODS = f"the record holds fewer than {FEWEST_PERIODS} periods"
    NO_LINE = "no line of its own in the spectrum"


class ModeComparison(Finding):
    """One mode: what the eigenvalue predicts and what the transient did; None where that was not measured, and why.

    `changing` says that drum speed or load change: the prediction then is for one time and the measurement a mean over
    the growth phase, so that their difference is no error.
    """

    name: str
    label: Annotated[str, Column("mode")]
    unstable: bool
    predicted_frequency_Hz: Annotated[Positive, Column("frequency\n{predicted}", ".2f")]
    measured_frequency_Hz: Annotated[float | None, Column("frequency\n{measured}", ".2f")] = None
    frequency_resolution_Hz: float | None = None
    frequency_from_phase_Hz: float | None = None
    predicted_growth_rate_1_per_s: Annotated[float, Column("growth\n{predicted}", "+.3f")]
    measured_growth_rate_1_per_s: Annotated[float | None, Column("growth\n{measured}", "+.3f")] = None
    growth_rate_standard_error_1_per_s: float | None = None
    note: Note = Note.MEASURED
    changing: bool = False
    measured_growth: GrowthFit | None = Held
    columns: ClassVar = (
        *("label", "predicted_frequency_Hz", "measured_frequency_Hz", "frequency_error"),
        *("predicted_growth_rate_1_per_s", "measured_growth_rate_1_per_s", "growth_rate_error"),
    )

    @property
    def excited(self) -> bool:
        """Whether the start holds it."""
        return self.note is not Note.NOT_EXCITED

    @computed_field
    @property
    def frequency_error(self) -> Annotated[float | None, Column("error", "+.1e", optional=True)]:
        """Measured over predicted frequency, less 1; None where the prediction is for one time only."""
        if self.measured_frequency_Hz is None or self.changing:
            return None
        return self.measured_frequency_Hz / self.predicted_frequency_Hz - 1

    @computed_field
    @property
    def growth_rate_error(self) -> Annotated[float | None, Column("error", "+.1e", optional=True)]:
        """Measured over predicted growth rate, less 1; None also for a mode that neither grows nor decays."""
        rate, predicted = self.measured_growth_rate_1_per_s, self.predicted_growth_rate_1_per_s
        if rate is None or self.changing or abs(predicted) < NEUTRAL_FRACTION * self.predicted_frequency_Hz:
            return None
        return rate / predicted - 1


class GrowthPhase(Finding):
    """The growth phase: its end, when the motion reaches a contact boundary (s; None where never), and the modes."""

    linear_until_s: float
    edge_reached_s: float | None
    modes: tuple[ModeComparison, ...]


def measure_growth(
    vibration: Vibration, stability: Stability, model: Model, growing: slice, moved_by: str, *, changing: bool
) -> tuple[ModeComparison, ...]:
    """Measure each mode in the samples of the growth phase; `moved_by` is what pushes a shoe that was not started.

    `changing` says that drum speed or load change.
    """
    not_started = Note(f"moved by the {moved_by}") if moved_by else Note.NOT_STARTED
    modes = []
    for mode in stability.modes:
        found: dict[str, Any] = {"note": Note.DRIVEN}
        if not model.forced:  # or growth and frequency would be those of the response
            found = _measure(mode, stability, vibration, growing) if vibration.started else {"note": not_started}
        modes.append(
            ModeComparison(
                name=mode.name,
                label=mode.label,
                unstable=mode.unstable,
                predicted_frequency_Hz=mode.frequency_Hz,
                predicted_growth_rate_1_per_s=mode.growth_rate,
                changing=changing,
                **found,
            )
        )
    return tuple(modes)


def _measure(mode: Mode, stability: Stability, vibration: Vibration, growing: slice) -> dict[str, Any]:
    """What the transient shows of a mode, or why it does not."""
    time, recorded = vibration.time[growing], vibration.time.size
    if time.size < FEWEST_FOR_SPECTRUM:
        return {"note": Note.TOO_SHORT if recorded == time.size else Note.NONLINEAR}
    signal = vibration.modal(mode, growing)
    size, own = np.abs(signal), vibration.column(mode.name, growing)
    if not own.any() or size.max() <= UNEXCITED_FRACTION * vibration.largest(growing).max():
        return {"note": Note.NOT_EXCITED}
    clean = (size > 0) & (size >= CLEAN_FRACTION * np.maximum.accumulate(np.abs(own)))
    last = time.size if clean.all() else int(np.argmin(clean))
    if last < FEWEST_FOR_SPECTRUM or (time[last - 1] - time[0]) * mode.frequency_Hz < FEWEST_PERIODS:
        ended = Note.SOON_NONLINEAR if time.size < recorded else Note.FEW_PERIODS
        return {"note": Note.HIDDEN if last < time.size else ended}
    spectrum = amplitude_spectrum(own[:last], vibration.sample_rate)
    # Half the way to the next mode's frequency, and a quarter of its own at most.
    apart = [abs(other.frequency_Hz - mode.frequency_Hz) / 2 for other in stability.modes if other is not mode]
    reach = min([mode.frequency_Hz / 4, *(distance for distance in apart if distance > 0)])
    peak = peak_near(spectrum, mode.frequency_Hz, half_width=reach)
    fit = fit_growth(time[:last], size[:last])
    return {
        "note": Note.NO_LINE if peak is None else Note.MEASURED,
        "measured_frequency_Hz": None if peak is None else peak.frequency_Hz,
        "frequency_resolution_Hz": spectrum.resolution_Hz,
        "frequency_from_phase_Hz": modal_frequency(time[:last], signal[:last]),
        "measured_growth_rate_1_per_s": fit.rate_1_per_s,
        "growth_rate_standard_error_1_per_s": fit.standard_error,
        "measured_growth": fit,
    }
