"""The linear prediction against what the transient does: onset frequency, growth, saturated motion."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
import xarray

from drumsqueal.findings.departure import FEWEST_FOR_SPECTRUM, Departure, changes, edge_share, first_edge, moved_by
from drumsqueal.findings.frequency import FrequencyDrift, follow_frequency
from drumsqueal.findings.history import COMPLETE, memory_of
from drumsqueal.findings.quadrature import QuadratureError
from drumsqueal.findings.saturation import Saturation, describe_saturation, saturated_part
from drumsqueal.findings.signals import Growth, amplitude_spectrum, fit_growth, modal_frequency, peak_near
from drumsqueal.findings.sticking import find_sticking
from drumsqueal.findings.verdict import Temperature, state_verdict
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.modes import NEUTRAL_SHARE, Mode, Stability

# The motion counts as linear while it stays below this share of the edges, contact loss at the mean pressure and slip
# reversal.
LINEAR_SHARE = 0.1
# A mode is followed while it makes up at least this share of what its own coordinate has done so far: a weaker one
# drowns in what the others feed into it at second order of their size.
CLEAN_SHARE = 3e-2
UNEXCITED_SHARE = 1e-12  # of the largest displacement: a mode below it is not there
FEWEST_PERIODS = 5  # of a mode, for its frequency and growth to be measured
NOT_STARTED = "nothing was started"
NOT_EXCITED = "not excited by this start"
HELD = "the lining sticks at the start"
DRIVEN = "driven by the harmonic force"


class ModeComparison(NamedTuple):
    """One mode: what the eigenvalue says and what the transient did; None where that cannot be told, and why.

    `changing` tells that drum speed or load change: the prediction then is for one time and the measurement a mean over
    the growth phase, so that their difference is no error.
    """

    name: str
    label: str
    unstable: bool
    predicted_frequency_Hz: float
    predicted_growth_rate: float
    measured_frequency_Hz: float | None
    frequency_resolution_Hz: float | None
    phase_frequency_Hz: float | None
    measured_growth: Growth | None
    note: str
    changing: bool = False

    @property
    def frequency_error(self) -> float | None:
        """Measured over predicted frequency, less 1; None where the prediction is for one time only."""
        if self.measured_frequency_Hz is None or self.changing:
            return None
        return self.measured_frequency_Hz / self.predicted_frequency_Hz - 1

    @property
    def growth_error(self) -> float | None:
        """Measured over predicted growth rate, less 1; None also for a mode that neither grows nor decays."""
        if (
            self.measured_growth is None
            or self.changing
            or abs(self.predicted_growth_rate) < NEUTRAL_SHARE * self.predicted_frequency_Hz
        ):
            return None
        return self.measured_growth.rate_1_per_s / self.predicted_growth_rate - 1


class Comparison(NamedTuple):
    """End of the growth phase (s), first edge (s), each mode, the saturated motion and a verdict in one sentence.

    `edge_reached_s` and `saturation` are None where the motion reached no edge, `frequency` also where no mode's
    frequency can be followed from its onset; `motion_ratio` is the largest motion
    (root of the vibration energy) in the last tenth of the record over that in the first tenth, None without a start;
    `changing` tells that drum speed or load change, so that the prediction is for one time only; `quadrature`
    is None where the error of the contact's forces was not estimated.
    """

    growth_end_s: float
    edge_reached_s: float | None
    motion_ratio: float | None
    changing: bool
    modes: tuple[ModeComparison, ...]
    saturation: Saturation | None
    frequency: FrequencyDrift | None
    quadrature: QuadratureError | None
    verdict: str


def compare(
    history: xarray.Dataset, stability: Stability, model: Model, quadrature: QuadratureError | None = None
) -> Comparison:
    """Compare a history with the eigenvalues of its steady state.

    `stability` may hold more coordinates than moved. The growth phase lasts until the motion comes to 10 % of an edge,
    or the lining sticks. `quadrature` is passed on.
    """
    departure = Departure(history, stability)
    time = departure.time
    share = edge_share(departure, model)
    sticks = history["sticking"].values > 0
    nonlinear = np.flatnonzero((share >= LINEAR_SHARE) | sticks)
    growing = slice(0, int(nonlinear[0]) if nonlinear.size else time.size)
    moving = moved_by(model, stability, float(time[-1]))
    if model.forced:  # its growth and frequency would be those of the response
        modes = tuple(_unmeasured(mode)._replace(note=DRIVEN) for mode in stability.modes)
    else:
        still = f"moved by the {moving}" if moving else NOT_STARTED
        modes = tuple(_compare_mode(mode, stability, departure, growing, still) for mode in stability.modes)
        if sticks[0]:
            modes = tuple(mode if mode.measured_growth else mode._replace(note=HELD) for mode in modes)
    edge = first_edge(history, stability, model)
    saturation = None if edge is None else describe_saturation(history, departure, stability, model, edge)
    drift = None
    if edge is not None and saturation is not None and not model.forced:
        drift = follow_frequency(departure, saturated_part(time, edge), stability, model, saturation)
    ratio = _motion_ratio(departure, stability, model)
    changing = changes(model, time)
    modes = tuple(mode._replace(changing=changing) for mode in modes)
    outcome = history.attrs["outcome"]
    return Comparison(
        growth_end_s=float(time[max(growing.stop - 1, 0)]),
        edge_reached_s=edge,
        motion_ratio=ratio,
        changing=changing,
        modes=modes,
        saturation=saturation,
        frequency=drift,
        quadrature=quadrature,
        verdict=state_verdict(
            stability,
            changing=changing,
            forced=model.forced,
            moved_by=moving,
            excited=tuple(m for m, found in zip(stability.modes, modes, strict=True) if found.note != NOT_EXCITED),
            motion_ratio=ratio,
            edge=edge,
            saturation=saturation,
            frequency=drift,
            duration=float(time[-1]),
            rotation=departure.largest_rotation,
            sticking=find_sticking(history),
            cut_off=None if outcome == COMPLETE else outcome,
            quadrature=quadrature,
            temperature=_temperature(history, model),
        ),
    )


def _temperature(history: xarray.Dataset, model: Model) -> Temperature | None:
    memory = memory_of(history.isel(time=[-1]), model.remembered)
    if memory is None:
        return None
    share = model.moment(float(history["time"].values[-1]), jnp.asarray(memory[0])).friction_share
    return Temperature(float(memory[0, 0]), 1.0 if share is None else float(share))


def _motion_ratio(departure: Departure, stability: Stability, model: Model) -> float | None:
    """Largest motion in the last tenth of the record over that in the first tenth; None where nothing was started."""
    if not departure.started:
        return None
    samples = departure.time.size
    tenth, stiffness = max(1, samples // 10), np.asarray(model.stiffness)

    def largest(part: slice) -> float:
        energies = (
            np.max(velocity**2 @ stability.mass + np.einsum("ti,ij,tj->t", displacement, stiffness, displacement))
            for _, displacement, velocity in departure.pieces(part)
        )
        return float(np.sqrt(max(energies)))

    first = largest(slice(0, tenth))
    return largest(slice(samples - tenth, samples)) / first if first > 0 else 1.0  # displaced, and no energy in it


def _unmeasured(mode: Mode) -> ModeComparison:
    return ModeComparison(
        mode.name, mode.label, mode.unstable, mode.frequency_Hz, mode.growth_rate, None, None, None, None, ""
    )


def _compare_mode(
    mode: Mode, stability: Stability, departure: Departure, growing: slice, not_started: str
) -> ModeComparison:
    result = _unmeasured(mode)
    time = departure.time[growing]
    if not departure.started:
        return result._replace(note=not_started)
    if time.size < FEWEST_FOR_SPECTRUM:
        whole = departure.time.size == time.size
        return result._replace(note="the record is too short" if whole else "nonlinear from the start, or nearly so")
    signal = departure.modal(mode, growing)
    size, own = np.abs(signal), departure.column(mode.name, growing)
    if not own.any() or size.max() <= UNEXCITED_SHARE * departure.largest(growing).max():
        return result._replace(note=NOT_EXCITED)
    clean = (size > 0) & (size >= CLEAN_SHARE * np.maximum.accumulate(np.abs(own)))
    last = time.size if clean.all() else int(np.argmin(clean))
    if last < FEWEST_FOR_SPECTRUM or (time[last - 1] - time[0]) * mode.frequency_Hz < FEWEST_PERIODS:
        return result._replace(note=_too_few(last, time.size, departure.time.size))
    spectrum = amplitude_spectrum(own[:last], departure.sample_rate)
    peak = peak_near(spectrum, mode.frequency_Hz, half_width=_reach(mode, stability))
    return result._replace(
        measured_frequency_Hz=None if peak is None else peak.frequency_Hz,
        frequency_resolution_Hz=spectrum.resolution_Hz,
        phase_frequency_Hz=modal_frequency(time[:last], signal[:last]),
        measured_growth=fit_growth(time[:last], size[:last]),
        note="" if peak is not None else "no line of its own in the spectrum",
    )


def _too_few(clean: int, growing: int, recorded: int) -> str:
    """Why a mode has too few periods: samples in which it is clean, of the growth phase, of the record."""
    if clean < growing:
        return f"hidden by the other modes after fewer than {FEWEST_PERIODS} periods"
    if growing < recorded:
        return f"nonlinear after fewer than {FEWEST_PERIODS} periods"
    return f"the record holds fewer than {FEWEST_PERIODS} periods"


def _reach(mode: Mode, stability: Stability) -> float:
    """Half the distance to the next mode's frequency (Hz), at most a quarter of the mode's own."""
    apart = [abs(other.frequency_Hz - mode.frequency_Hz) / 2 for other in stability.modes if other is not mode]
    return min([mode.frequency_Hz / 4, *(distance for distance in apart if distance > 0)])
