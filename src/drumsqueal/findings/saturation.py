"""The motion after growth: its kind, its main lines, its size, and how far its frequency lies from the onset's."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.findings.approach import Approach, LastStates, find_approach
from drumsqueal.findings.decay import decay_to_rest
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.findings.part import Finding
from drumsqueal.findings.signals.regime import Cause, Regime, classify
from drumsqueal.findings.signals.spectra import spectral_peaks
from drumsqueal.findings.vibration import Vibration, changes, levers
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.modes import Mode, Stability

if TYPE_CHECKING:
    import xarray

SATURATED_FRACTION = 0.6  # last part of what follows the first contact boundary that is called saturated
MORE_THAN_A_TURN = 1.5  # of the main line: halfway to two, of what is a whole number of them


@dataclass(frozen=True)
class SpectralLine:
    """One line in the spectrum of a coordinate's displacement (m or rad)."""

    coordinate: str
    frequency_Hz: float
    amplitude: float


class FinalMotion(NamedTuple):
    """What a part of the record holds: half its peak-to-peak values (m, rad), its lines and its main line.

    `kinetic_share` is each coordinate's fraction of the mean kinetic energy, empty at rest. `main` is the line that
    holds most of it; None at rest, and where the part is too short for a spectrum or the motion has no line in it.
    """

    amplitude: dict[str, float]
    kinetic_share: dict[str, float]
    lines: tuple[SpectralLine, ...]
    main: SpectralLine | None


class Saturation(Finding):
    """The motion after growth: from when (s), of which kind, its lines and half its peak-to-peak values (m, rad).

    `main` is the line that holds most kinetic energy, `nearest_mode` the unstable mode whose onset frequency it is
    compared with, `frequency_shift` their ratio less 1. The fractions are means over the saturated part. `approaches`
    is the periodic motion that it comes to, where that was proven and the record has not yet come to it.
    """

    start_s: float
    regime: Regime
    lines: tuple[SpectralLine, ...]
    amplitude: dict[str, float]
    main: SpectralLine | None
    nearest_mode: str | None
    frequency_shift: float | None
    contact_fraction: float
    slip_reversed_fraction: float
    approaches: Approach | None = None

    @property
    def vibrates(self) -> bool:
        """Whether it has settled to a motion that goes on."""
        return self.regime.kind.squeals


def saturated_part(time: NDArray[np.float64], boundary: float) -> slice:
    """The last part of the record after the first contact boundary (s), by when the growth is taken to be over."""
    start = time[-1] - SATURATED_FRACTION * (time[-1] - boundary)
    return slice(int(np.searchsorted(time, start)), time.size)


def duration_for(saturated: float, boundary: float) -> float:
    """Duration (s) of a record whose saturated part is so long (s), rounded up."""
    return 1.001 * (boundary + saturated / SATURATED_FRACTION)


def describe_saturation(
    history: "xarray.Dataset",
    vibration: Vibration,
    stability: Stability,
    model: Model,
    boundary: float,
    again: tuple[Model, str, float] | None = None,
) -> Saturation | None:
    """Describe the motion after the first contact boundary (s); None where the record is too short.

    `again` are the model, method and tolerance of the integration, for what does not repeat within the record.
    """
    part = saturated_part(vibration.time, boundary)
    modes = _taking_part(vibration, stability)
    count = vibration.time[part].size
    if count < 64:  # samples
        return None
    # Half the lowest onset frequency leaves room for the drop that contact loss brings. Where nothing oscillates, rest
    # can be determined all the same.
    duration = count / vibration.sample_rate
    lowest = min((mode.frequency_Hz for mode in modes), default=2 * Criteria.periods / duration) / 2
    scale = size_of_motion(vibration, stability, model)
    regime = classify(vibration.read("displacement", part), vibration.sample_rate, scale=scale, lowest_frequency=lowest)
    regime = decay_to_rest(regime, vibration, part, stability, modes, model)
    drifts = regime.kind is Kind.UNDECIDED and regime.amplitude_drift is not None
    if drifts and changes(model, vibration.time[part]):
        regime = regime.model_copy(update={"cause": Cause.BRAKE_CHANGES})
    motion = describe_motion(vibration, part, stability, model)
    main, mode, approach = motion.main, None, None
    if again is not None and main is not None and _may_be_another(regime, main.frequency_Hz):
        approach = _approach(history, vibration, part, main.frequency_Hz, stability, *again)
    if approach is not None and (regime.kind is not Kind.PERIODIC or _is_another(regime, approach)):
        regime = _by_approach(regime, approach)
    else:
        approach = None
    if main is not None:  # the mode nearest in frequency, measured as a ratio
        mode = min(modes, key=lambda each: abs(np.log(main.frequency_Hz / each.frequency_Hz)), default=None)
    return Saturation(
        start_s=float(vibration.time[part][0]),
        regime=regime,
        lines=motion.lines,
        amplitude=motion.amplitude,
        main=main,
        nearest_mode=None if mode is None else mode.label,
        frequency_shift=None if mode is None or main is None else main.frequency_Hz / mode.frequency_Hz - 1,
        contact_fraction=float(history["contact_fraction"].values[part].mean()),
        slip_reversed_fraction=float(history["slip_reversed_fraction"].values[part].mean()),
        approaches=approach,
    )


def _may_be_another(regime: Regime, frequency: float) -> bool:
    """Whether a motion with a main line (Hz) may come to another periodic motion than the record shows.

    What decays beside a cycle and is small already makes the record come back best after many turns at once.
    """
    if regime.period_s is None:
        return regime.kind is not Kind.STEADY
    return regime.period_s * frequency > MORE_THAN_A_TURN


def _is_another(regime: Regime, approach: Approach) -> bool:
    """Whether the motion comes, within the record, to another one than that of the period that the record shows."""
    sooner = regime.period_s is not None and regime.period_s * approach.frequency_Hz > MORE_THAN_A_TURN
    return sooner and approach.record_needed_s is None


def _by_approach(regime: Regime, approach: Approach) -> Regime:
    """The regime of a motion that comes to a periodic one, or seems to."""
    numbers = {name: getattr(approach, name) for name in ("frequency_Hz", "rate_1_per_s", "distance", "residual")}
    kept: dict[str, Any] = {"recurrence_error": regime.recurrence_error, "amplitude_drift": regime.amplitude_drift}
    if (needed := approach.record_needed_s) is not None:
        numbers["record_needed_s"] = needed
        return Regime(kind=Kind.UNDECIDED, cause=Cause.NEARS, numbers=numbers, record_needed_s=needed, **kept)
    found: dict[str, Any] = {"period_s": 1 / approach.frequency_Hz, "base_frequencies_Hz": (approach.frequency_Hz,)}
    return Regime(kind=Kind.PERIODIC, cause=Cause.APPROACHES, numbers=numbers, **found, **kept)


def _approach(
    history: "xarray.Dataset",
    vibration: Vibration,
    part: slice,
    frequency: float,
    stability: Stability,
    model: Model,
    solver: str,
    tolerance: float,
) -> Approach | None:
    """The periodic motion that a part of the record approaches, of a brake at constant speed and load."""
    if model.forced or model.remembering or changes(model, vibration.time[part]):
        return None
    columns = [history["coordinate"].values.tolist().index(name) for name in model.names]
    both = [history[name].values[part][:, columns] for name in ("displacement", "velocity")]
    steady = np.array([stability.steady_state[stability.coordinates.index(name)] for name in model.names])
    known = float(vibration.time[-1]), vibration.sample_rate, frequency
    return find_approach(
        LastStates(np.hstack(both), *known, model, steady, solver, tolerance, int(history.attrs["steps"]))
    )


def describe_motion(vibration: Vibration, part: slice, stability: Stability, model: Model) -> FinalMotion:
    """Describe the motion in a part of the record, whatever its kind."""
    amplitude = np.ptp(vibration.extremes(part), axis=0) / 2
    named = {name: float(size) for name, size in zip(stability.coordinates, amplitude, strict=True)}
    if np.all(amplitude < Criteria.steady * size_of_motion(vibration, stability, model)):
        return FinalMotion(named, {}, (), None)
    energy = stability.mass * vibration.mean_square_velocity(part)
    fractions = {name: float(e / energy.sum()) for name, e in zip(stability.coordinates, energy, strict=True)}
    lines: list[SpectralLine] = []
    for name, spectrum in vibration.spectra(part):
        peaks = zip(*spectral_peaks(spectrum, count=8, floor=1e-2), strict=True)  # over the strongest
        lines += [SpectralLine(name, float(frequency), float(size)) for frequency, size in peaks]
        del spectrum  # before the next is made
    # Kinetic energy ∝ mass × (frequency × amplitude)².
    mass = dict(zip(stability.coordinates, stability.mass, strict=True))
    main = max(lines, key=lambda line: mass[line.coordinate] * (line.frequency_Hz * line.amplitude) ** 2, default=None)
    return FinalMotion(named, fractions, tuple(lines), main)


def size_of_motion(vibration: Vibration, stability: Stability, model: Model) -> NDArray[np.float64]:
    """What counts as motion of each coordinate (m, rad): the displacement at which the steady pressure is lost.

    Without pressure or without contact stiffness it is the largest displacement of the record.
    """
    largest = vibration.largest()
    stiffness = max(float(side.lining.law.stiffness) for _, side in model.sides)
    lost = stability.pressure_range[1] / stiffness if stiffness > 0 else 0.0
    if lost > 0:
        return lost / levers(vibration.coordinates, model.body)
    return np.maximum(largest, np.finfo(np.float64).tiny)


def _taking_part(vibration: Vibration, stability: Stability) -> tuple[Mode, ...]:
    """The unstable modes (all modes if none is) whose coordinate moves at some time."""
    moving = {
        name for name, size in zip(vibration.coordinates, np.ptp(vibration.extremes(), axis=0), strict=True) if size > 0
    }
    able = tuple(mode for mode in stability.modes if mode.name in moving)
    return tuple(mode for mode in able if mode.unstable) or able
