"""The growth phase: frequency and growth of each mode, predicted and seen; then where the frequency goes, and why.

The reason is the stiffness that the lining has on average while it comes and goes.
"""

from enum import StrEnum
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import computed_field

from drumsqueal.findings.columns import Column
from drumsqueal.findings.saturation import Saturation
from drumsqueal.findings.schema import Finding, Held, Positive
from drumsqueal.findings.signals.growth import Growth as GrowthFit
from drumsqueal.findings.signals.growth import fit_growth, modal_frequency
from drumsqueal.findings.signals.spectra import Ridge, amplitude_spectrum, follow_line, peak_near
from drumsqueal.findings.vibration import FEWEST_FOR_SPECTRUM, Vibration
from drumsqueal.physics.effects.friction import UnitVelocity
from drumsqueal.physics.effects.pressure import Unilateral, level_under, slope_at
from drumsqueal.physics.friction_law import coefficient_at
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.modes import NEUTRAL_FRACTION, Mode, Stability, assurance

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


ALONG, ACROSS = 48, 5  # Gauss points on the lining; one line across where the motion is in the plane
MOST_SAMPLES = 4000  # over which the contact is averaged


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
    room = 1.5  # the line is looked for from the lower of the two frequencies over this to the higher one times it
    low, high = ends[0] / room, min(ends[1] * room, 0.45 * vibration.sample_rate)
    periods = 16.0  # a window over which the frequency is a mean
    if signal.size * 0.5 * (low + high) < 2 * periods * vibration.sample_rate or high <= low:
        return None
    ridge = follow_line(signal, vibration.sample_rate, low=low, high=high, periods=periods)
    predicted = explain_frequency(vibration, part, model, stability, mode, saturation.contact_fraction)
    if not np.all(np.isfinite(list(predicted.values()))):
        return None
    every = max(1, -(-ridge.time_s.size // 100))  # instants at most are written down
    time, frequency = (tuple(values[::every].tolist()) for values in (ridge.time_s, ridge.frequency_Hz))
    return FrequencyDrift(
        mode=mode.label,
        coordinate=main.coordinate,
        onset_Hz=mode.frequency_Hz,
        saturated_Hz=main.frequency_Hz,
        over_time=OverTime(time_s=time, frequency_Hz=frequency),
        ridge=ridge,
        **predicted,
    )


def explain_frequency(
    vibration: Vibration, part: slice, model: Model, stability: Stability, mode: Mode, contact_fraction: float
) -> dict[str, float]:
    """Predict a mode's frequency in the saturated motion from where the lining touched and how it slipped.

    Returns what `FrequencyDrift` has of it: with the averaged stiffness, by loss of contact alone and with friction as
    it acted, and by the root of the mean fraction of the lining in contact.

    At each point of the lining the contact force p(u), cut off at zero, is replaced by the linear one that has the same
    first harmonic. For a motion u_r(t) it has the stiffness (the describing function, integrated by parts)

        k = ⟨1[N > 0] p' u̇_r²⟩ / ⟨u̇_r²⟩,   and friction couples with   ⟨1[N > 0] p' g u̇_r²⟩ / ⟨u̇_r²⟩,

    p' = dp/du (k_c of the linear law), ⟨⟩ the mean over the motion and g = −μ(|V|) V_θ/|V| the signed coefficient of
    friction. M q̈ + K q = 0 with these gives the frequency; its ratio to that of full contact, by p' of steady sliding,
    scales that of the eigenvalue. The motion enters through its kinematics alone, not its accelerations: that the
    frequency comes out right is no tautology. Other modes that move at the same time are in the averages, and the
    damping of friction is left out.

    Source: K. Magnus and K. Popp, Schwingungen, 1997, on harmonic balance; of several frequencies it is the equivalent
    linearisation of R. C. Booton, "Nonlinear control systems with random inputs", IRE Transactions 1, 1954.
    """
    index, steady = {name: k for k, name in enumerate(vibration.coordinates)}, stability.steady_state
    every = max(1, vibration.time[part].size // MOST_SAMPLES)
    time = vibration.time[part][::every]
    q, v = np.empty((time.size, len(index))), np.empty((time.size, len(index)))
    for rows, displacement, velocity in vibration.pieces(part):
        first = -rows.start % every  # of those that are taken
        taken = slice(-(-rows.start // every), -(-rows.stop // every))
        q[taken], v[taken] = displacement[first::every] + steady, velocity[first::every]
    each = [_averaged(side, mine.places, time, q, v, (stability.time, steady)) for mine, side in model.sides]
    shapes = {key: np.concatenate([one.shapes[key] for one in each]) for key in "rθz"}
    spring, full, fraction, resting, acted = (
        np.concatenate([getattr(one, name) for one in each]) for name in _Averaged._fields[1:]
    )
    cases = ((full, full * resting), (fraction, fraction * resting), (fraction, acted))
    found = [_frequency(model, shapes, spring, mode, *case) for case in cases]
    scale = mode.frequency_Hz / found[0]
    return {
        "predicted_by_contact_loss_Hz": found[1] * scale,
        "predicted_with_friction_Hz": found[2] * scale,
        "predicted_by_root_of_contact_share_Hz": mode.frequency_Hz * float(np.sqrt(contact_fraction)),
    }


class _Averaged(NamedTuple):
    """At points of a lining: shapes φ^r, φ^θ, φ^z (points, n) by r, θ, z, and the stiffness in `Model.stiffness` (N/m).

    In steady sliding the lining has `full` of it where it touches, and on average a `fraction` is left; friction
    couples with `resting` of the full contact, and with `acted`.
    """

    shapes: dict[str, NDArray[np.float64]]
    spring: NDArray[np.float64]
    full: NDArray[np.float64]
    fraction: NDArray[np.float64]
    resting: NDArray[np.float64]
    acted: NDArray[np.float64]


def _averaged(
    model: Model,
    places: tuple[int, ...],
    time: NDArray[np.float64],
    q: NDArray[np.float64],
    v: NDArray[np.float64],
    steady: tuple[float, NDArray[np.float64]],
) -> _Averaged:
    """The averages over motions (time, n) on one lining, whose coordinates have these places among all.

    Full contact is that of `steady` sliding, of which the time (s) and the displacement (n,) are given.
    """
    shapes, area = _points(model, q[:, places], q.shape[1], places)
    moment, radius = model.operation.at(time), float(model.shoe.outer_radius)
    preload, speed = (np.broadcast_to(each, time.shape)[:, None] for each in (moment.preload, moment.drum_speed))
    law, reference = model.lining.law, float(model.tangents[0])
    rate = v @ shapes["r"].T
    weight = rate**2 / np.maximum(np.sum(rate**2, axis=0), np.finfo(np.float64).tiny)
    radial, rest = float(law.stiffness) * shapes["r"].T, np.asarray(model.operation.at(steady[0]).preload)
    levels = level_under(law, rest) + steady[1] @ radial, level_under(law, preload) + q @ radial
    # Of a lining without stiffness nothing is left out.
    at_rest, kept = (slope_at(law.normal, level) / reference if reference > 0 else 0 * level + 1 for level in levels)
    kept = kept * (levels[1] > 0.0) if isinstance(law, Unilateral) else kept
    slip, across = v @ shapes["θ"].T - radius * speed, v @ shapes["z"].T
    signed, resting = _signed(model, slip, across), _signed(model, -radius * speed, np.zeros_like(speed))
    averages = (np.sum(weight * each, axis=0) for each in (kept, resting, kept * signed))
    return _Averaged(shapes, reference * area, at_rest, *averages)


def _points(
    model: Model, q: NDArray[np.float64], count: int, places: tuple[int, ...]
) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.float64]]:
    """Shape functions φ^r, φ^θ, φ^z (points, count) at Gauss points of the lining, and the area of each point (m²)."""
    shoe, flat = model.lining.body, not np.any(q[:, ~np.array(model.body.symmetric)])
    along, of_along = np.polynomial.legendre.leggauss(ALONG)
    across, of_across = np.polynomial.legendre.leggauss(1 if flat else ACROSS)
    theta, z = (axis.ravel() for axis in np.meshgrid(along * float(shoe.half_angle), across, indexing="ij"))
    z = z * float(shoe.width) / 2
    area = np.outer(of_along, of_across).ravel() / 4 * float(shoe.area)
    found = {key: np.zeros((area.size, count)) for key in "rθz"}
    for place, name in zip(places, model.names, strict=True):
        moved = np.broadcast_arrays(*shoe.over_drum({name: 1.0}, theta, z), theta)[:3]
        for shapes, each in zip(found.values(), moved, strict=True):
            shapes[:, place] = each
    return found, area


def _signed(model: Model, slip: NDArray[np.float64], across: NDArray[np.float64]) -> NDArray[np.float64]:
    """g, the fraction of the pressure that friction is along θ."""
    friction = model.contact.friction
    if friction is None:
        return np.zeros_like(slip)
    speed = np.hypot(slip, across) if isinstance(friction.direction, UnitVelocity) else np.abs(slip)
    coefficient = coefficient_at(friction.law, speed)
    return -coefficient * slip / np.maximum(speed, np.finfo(np.float64).tiny)


def _frequency(
    model: Model,
    shapes: dict[str, NDArray[np.float64]],
    spring: NDArray[np.float64],
    mode: Mode,
    normal: NDArray[np.float64],
    drag: NDArray[np.float64],
) -> float:
    """Frequency (Hz) of the mode most like the given one, with the contact's fraction and friction at each point.

    `spring` (points,) is the full contact's stiffness there (N/m).
    """
    radial, mass = shapes["r"], np.asarray(model.mass)
    # Supports and, in place of the full contact, what is left of it.
    stiffness = np.asarray(model.stiffness) + (radial.T * (spring * (normal - 1))) @ radial
    stiffness = stiffness - (shapes["θ"].T * (spring * drag)) @ radial
    squares, vectors = np.linalg.eig(stiffness / mass[:, None])
    alike = int(np.argmax(assurance(mass, mode.right[: mass.size], vectors)))
    return float(np.sqrt(squares[alike].astype(complex)).real) / (2 * np.pi)
