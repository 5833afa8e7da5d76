"""The linear prediction against what the transient does: onset frequency, growth, saturated motion."""

import tomllib
from enum import StrEnum
from typing import Any

import jax.numpy as jnp
import numpy as np
import xarray
from pydantic import Field, computed_field

from drumsqueal.findings.frequency import FrequencyDrift, follow_frequency
from drumsqueal.findings.history import memory_of
from drumsqueal.findings.outcome import COMPLETE, Ending
from drumsqueal.findings.part import Finding, Held, Positive
from drumsqueal.findings.prediction import Prediction, predict
from drumsqueal.findings.saturation import Saturation, describe_saturation, saturated_part
from drumsqueal.findings.schema import Findings
from drumsqueal.findings.signals import Growth as GrowthFit
from drumsqueal.findings.signals import amplitude_spectrum, fit_growth, modal_frequency, peak_near
from drumsqueal.findings.sticking import Sticking, find_sticking
from drumsqueal.findings.verdict import state_verdict
from drumsqueal.findings.vibration import (
    FEWEST_FOR_SPECTRUM,
    Vibration,
    boundary_ratio,
    changes,
    first_boundary_time,
    moved_by,
)
from drumsqueal.physics.composition import take_inventory
from drumsqueal.physics.model import Model
from drumsqueal.scene import scene_from_dict
from drumsqueal.solve.linear.modes import NEUTRAL_FRACTION, Mode, Stability

# The motion counts as linear while it stays below this fraction of the contact boundaries, contact loss at the mean
# pressure and slip reversal.
LINEAR_FRACTION = 0.1
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
    label: str
    unstable: bool
    predicted_frequency_Hz: Positive
    measured_frequency_Hz: float | None = None
    frequency_resolution_Hz: float | None = None
    frequency_from_phase_Hz: float | None = None
    predicted_growth_rate_1_per_s: float
    measured_growth_rate_1_per_s: float | None = None
    growth_rate_standard_error_1_per_s: float | None = None
    note: Note = Note.MEASURED
    changing: bool = False
    measured_growth: GrowthFit | None = Held

    @property
    def excited(self) -> bool:
        """Whether the start holds it."""
        return self.note is not Note.NOT_EXCITED

    @computed_field
    @property
    def frequency_error(self) -> float | None:
        """Measured over predicted frequency, less 1; None where the prediction is for one time only."""
        if self.measured_frequency_Hz is None or self.changing:
            return None
        return self.measured_frequency_Hz / self.predicted_frequency_Hz - 1

    @computed_field
    @property
    def growth_rate_error(self) -> float | None:
        """Measured over predicted growth rate, less 1; None also for a mode that neither grows nor decays."""
        rate, predicted = self.measured_growth_rate_1_per_s, self.predicted_growth_rate_1_per_s
        if rate is None or self.changing or abs(predicted) < NEUTRAL_FRACTION * self.predicted_frequency_Hz:
            return None
        return rate / predicted - 1


class Growth(Finding):
    """The growth phase: its end, when the motion reaches a contact boundary (s; None where never), and the modes."""

    linear_until_s: float
    edge_reached_s: float | None
    modes: tuple[ModeComparison, ...]


class Accuracy(Finding):
    """Largest error of the energy balance (J, and relative), and of the contact forces by a finer quadrature.

    Of a small motion the error over the kinetic energy is large: friction turns hundreds of watts, and their round-off
    is in the balance.
    """

    energy_balance_error_J: float
    energy_balance_error_over_kinetic_energy: float
    energy_balance_error_over_friction_work: float
    quadrature_error_over_normal_force: float | None = None


class Integration(Finding):
    """Steps of the integration, and the fraction of the time that the implicit method took."""

    steps: int
    rejected_steps: int
    implicit_share: float


class LiningTemperature(Finding):
    """Largest rise of the lining's temperature and that at the end (K), and the fraction of friction left then."""

    largest_K: float
    end_K: float
    friction_left: float


class RunFindings(Findings):
    """What a run found, as `summary.json` holds it; where it recorded no samples, the prediction alone.

    `saturation` is None where the motion reached no contact boundary, `frequency` also where no mode's frequency can be
    followed from its onset. `motion_ratio` is the largest motion (root of the vibration energy) in the last tenth of
    the record over that in the first tenth, None without a start. `changing` says that drum speed or load change, so
    that the prediction is for one time only, `predicted_at_s`; `forced`, that a harmonic force acts; `moved_by`, what
    else pushes the shoe. `model` says what the transient includes and leaves out, and
    `held_though_they_would_move` the coordinates that the scene leaves out though they would move.
    """

    outcome: str = COMPLETE
    ending: Ending = Ending.COMPLETE
    prediction: Prediction
    predicted_at_s: float = 0.0
    growth: Growth = Growth(linear_until_s=0.0, edge_reached_s=None, modes=())
    saturation: Saturation | None = None
    frequency: FrequencyDrift | None = None
    accuracy: Accuracy | None = None
    integration: Integration | None = None
    sticking: Sticking | None = None
    lining_temperature: LiningTemperature | None = None
    motion_ratio: float | None = None
    changing: bool = False
    forced: bool = False
    moved_by: str = ""
    recorded_s: float = 0.0
    largest_rotation_rad: float = 0.0
    held_though_they_would_move: tuple[str, ...] = ()
    model: dict[str, tuple[str, ...]] = Field(default_factory=dict)

    @property
    def modes(self) -> tuple[ModeComparison, ...]:
        """The modes, as predicted and as the transient showed them."""
        return self.growth.modes

    @property
    def edge_reached_s(self) -> float | None:
        """When the motion reaches a contact boundary (s), lift-off or slip reversal; None where it never does."""
        return self.growth.edge_reached_s

    @computed_field
    @property
    def verdict(self) -> str:
        """Prediction and transient in one sentence."""
        return state_verdict(self)


def compare(
    history: xarray.Dataset,
    stability: Stability,
    model: Model,
    quadrature_error: float | None = None,
    held: tuple[str, ...] = (),
) -> RunFindings:
    """Compare a history with the eigenvalues of its steady state.

    `stability` may hold more coordinates than moved. The growth phase lasts until the motion comes to 10 % of a contact
    boundary, or the lining sticks. `quadrature_error` and `held` are passed on.
    """
    vibration = Vibration(history, stability)
    time = vibration.time
    fraction = boundary_ratio(vibration, model)
    sticks = history["sticking"].values > 0
    nonlinear = np.flatnonzero((fraction >= LINEAR_FRACTION) | sticks)
    growing = slice(0, int(nonlinear[0]) if nonlinear.size else time.size)
    moving = moved_by(model, stability, float(time[-1]))
    changing = changes(model, time)
    modes = _compare_modes(vibration, stability, model, growing, moving, sticks=bool(sticks[0]))
    boundary = first_boundary_time(history, stability, model)
    saturation = None if boundary is None else describe_saturation(history, vibration, stability, model, boundary)
    drift = None
    if boundary is not None and saturation is not None and not model.forced:
        drift = follow_frequency(vibration, saturated_part(time, boundary), stability, model, saturation)
    scene = scene_from_dict(tomllib.loads(history.attrs["scene"]))
    return RunFindings(
        scene=scene,
        outcome=history.attrs["outcome"],
        ending=history.attrs["ending"],
        prediction=predict(stability),
        predicted_at_s=stability.time,
        growth=Growth(
            linear_until_s=float(time[max(growing.stop - 1, 0)]),
            edge_reached_s=boundary,
            modes=tuple(mode.model_copy(update={"changing": changing}) for mode in modes),
        ),
        saturation=saturation,
        frequency=drift,
        accuracy=_accuracy(history, quadrature_error),
        integration=Integration(
            **{key: int(history.attrs[key]) for key in ("steps", "rejected_steps")},
            implicit_share=float(history["implicit"].mean()),
        ),
        sticking=find_sticking(history),
        lining_temperature=_temperature(history, model),
        motion_ratio=_motion_ratio(vibration, stability, model),
        changing=changing,
        forced=model.forced,
        moved_by=moving,
        recorded_s=float(time[-1]),
        largest_rotation_rad=vibration.largest_rotation,
        held_though_they_would_move=held,
        model=take_inventory(scene, history.attrs.get("friction_law", ""))._asdict(),
    )


def _temperature(history: xarray.Dataset, model: Model) -> LiningTemperature | None:
    memory = memory_of(history, model.remembered)
    if memory is None:
        return None
    left = model.moment(float(history["time"].values[-1]), jnp.asarray(memory[-1])).friction_left
    rise = memory[:, 0]
    friction_left = 1.0 if left is None else float(left)
    return LiningTemperature(largest_K=float(rise.max()), end_K=float(rise[-1]), friction_left=friction_left)


def _accuracy(history: xarray.Dataset, quadrature_error: float | None) -> Accuracy:
    error = float(np.abs(history["energy_balance_error"].values).max())
    kinetic = float(history["kinetic_energy"].values.max())
    work = float(history["friction_power"].integrate("time"))
    return Accuracy(
        energy_balance_error_J=error,
        energy_balance_error_over_kinetic_energy=error / kinetic if kinetic > 0 else 0.0,
        energy_balance_error_over_friction_work=error / work if work > 0 else 0.0,
        quadrature_error_over_normal_force=quadrature_error,
    )


def _compare_modes(
    vibration: Vibration, stability: Stability, model: Model, growing: slice, moving: str, *, sticks: bool
) -> list[ModeComparison]:
    if model.forced:  # its growth and frequency would be those of the response
        return [_unmeasured(mode, Note.DRIVEN) for mode in stability.modes]
    still = Note(f"moved by the {moving}") if moving else Note.NOT_STARTED
    modes = [_compare_mode(mode, stability, vibration, growing, still) for mode in stability.modes]
    if not sticks:
        return modes
    return [mode if mode.measured_growth else mode.model_copy(update={"note": Note.STICKING}) for mode in modes]


def _motion_ratio(vibration: Vibration, stability: Stability, model: Model) -> float | None:
    """Largest motion in the last tenth of the record over that in the first tenth; None where nothing was started."""
    if not vibration.started:
        return None
    samples = vibration.time.size
    tenth, stiffness = max(1, samples // 10), np.asarray(model.stiffness)

    def largest(part: slice) -> float:
        energies = (
            np.max(velocity**2 @ stability.mass + np.einsum("ti,ij,tj->t", displacement, stiffness, displacement))
            for _, displacement, velocity in vibration.pieces(part)
        )
        return float(np.sqrt(max(energies)))

    first = largest(slice(0, tenth))
    return largest(slice(samples - tenth, samples)) / first if first > 0 else 1.0  # displaced, and no energy in it


def _unmeasured(mode: Mode, note: Note, **found: Any) -> ModeComparison:
    return ModeComparison(
        name=mode.name,
        label=mode.label,
        unstable=mode.unstable,
        predicted_frequency_Hz=mode.frequency_Hz,
        predicted_growth_rate_1_per_s=mode.growth_rate,
        note=note,
        **found,
    )


def _compare_mode(
    mode: Mode, stability: Stability, vibration: Vibration, growing: slice, not_started: Note
) -> ModeComparison:
    time = vibration.time[growing]
    if not vibration.started:
        return _unmeasured(mode, not_started)
    if time.size < FEWEST_FOR_SPECTRUM:
        return _unmeasured(mode, Note.TOO_SHORT if vibration.time.size == time.size else Note.NONLINEAR)
    signal = vibration.modal(mode, growing)
    size, own = np.abs(signal), vibration.column(mode.name, growing)
    if not own.any() or size.max() <= UNEXCITED_FRACTION * vibration.largest(growing).max():
        return _unmeasured(mode, Note.NOT_EXCITED)
    clean = (size > 0) & (size >= CLEAN_FRACTION * np.maximum.accumulate(np.abs(own)))
    last = time.size if clean.all() else int(np.argmin(clean))
    if last < FEWEST_FOR_SPECTRUM or (time[last - 1] - time[0]) * mode.frequency_Hz < FEWEST_PERIODS:
        return _unmeasured(mode, _too_few(last, time.size, vibration.time.size))
    spectrum = amplitude_spectrum(own[:last], vibration.sample_rate)
    peak = peak_near(spectrum, mode.frequency_Hz, half_width=_reach(mode, stability))
    fit = fit_growth(time[:last], size[:last])
    return _unmeasured(
        mode,
        Note.NO_LINE if peak is None else Note.MEASURED,
        measured_frequency_Hz=None if peak is None else peak.frequency_Hz,
        frequency_resolution_Hz=spectrum.resolution_Hz,
        frequency_from_phase_Hz=modal_frequency(time[:last], signal[:last]),
        measured_growth_rate_1_per_s=fit.rate_1_per_s,
        growth_rate_standard_error_1_per_s=fit.standard_error,
        measured_growth=fit,
    )


def _too_few(clean: int, growing: int, recorded: int) -> Note:
    """Why a mode has too few periods: samples in which it is clean, of the growth phase, of the record."""
    if clean < growing:
        return Note.HIDDEN
    return Note.SOON_NONLINEAR if growing < recorded else Note.FEW_PERIODS


def _reach(mode: Mode, stability: Stability) -> float:
    """Half the distance to the next mode's frequency (Hz), at most a quarter of the mode's own."""
    apart = [abs(other.frequency_Hz - mode.frequency_Hz) / 2 for other in stability.modes if other is not mode]
    return min([mode.frequency_Hz / 4, *(distance for distance in apart if distance > 0)])
