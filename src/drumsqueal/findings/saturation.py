"""The motion after growth: its kind, lines and size, and whether it approaches a periodic one.

That is found by shooting from its last state: Newton's method closes an orbit, its Floquet multipliers say whether
neighbours come to it, and the record whether this motion does.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.compilation import cores
from drumsqueal.errors import IntegrationError
from drumsqueal.findings.decay import decay_to_rest, falls_as_small
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.findings.schema import Finding
from drumsqueal.findings.signals.recurrence import RECURRENCE
from drumsqueal.findings.signals.regime import Cause, Regime, classify
from drumsqueal.findings.signals.spectra import spectral_peaks
from drumsqueal.findings.vibration import Vibration, changes, characteristic_lengths
from drumsqueal.physics.effects.pressure import depth_under
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.modes import Mode, Stability
from drumsqueal.solve.shooting import Closed, Shooting, Vector
from drumsqueal.solve.transient.flow import Flow
from drumsqueal.solve.transient.integrate import integrate

if TYPE_CHECKING:
    import xarray

# The flow over a time and its derivatives by transients that begin next to each other.
#
# They use the program of a run, so that nothing is compiled. `flow.py` has derivatives to the last digit, and compiles.


TOLERANCE = 1e-9  # of the transients
# How far neighbours begin from each other, in the size of the motion, and in its time: half of the digits are then
# lost to their round-off and as many to their curvature.
_APART = TOLERANCE**0.5


class Neighbours:
    """Flows of one model at constant speed and load, as `flow` has them; they count the steps.

    Derivatives are those of an earlier state while what a motion misses itself by falls to a third from flow to flow,
    as it does in Newton's method: they take 2n + 2 transients, and the end takes one.
    """

    def __init__(self, steady: Vector, solver: str, before: Callable[["Neighbours"], None]) -> None:
        """Take steady sliding (n,), the method of the run, and what is called `before` steps of a transient count."""
        self._steady, self._solver, self._before, self.steps = steady, solver, before, 0
        self.forget()

    def forget(self) -> None:
        """Find derivatives anew with the next flow."""
        self._missed, self._derivatives = 0.0, (np.zeros(0), np.zeros(0))

    def __call__(self, model: Model, size: Vector, state: Vector, duration: float, *_: Any) -> Flow:
        """The flow from a state (2n,), in units of `size` (2n,). Raises IntegrationError where it fails."""
        (there,) = self._ends(model, size, [state], [duration])
        missed, before = float(np.max(np.abs(there - state))), self._missed
        self._missed = missed
        # 1 / 3 from flow to flow, of what a motion misses itself by: derivatives of an earlier state still serve
        if missed > (1 / 3) * before:
            self._derivatives = self.derivatives(model, size, state, duration, there)
        transition, rate = self._derivatives
        return Flow(there, rate, transition, np.zeros_like(there), 0, reached=True)

    def derivatives(
        self, model: Model, size: Vector, state: Vector, duration: float, there: Vector
    ) -> tuple[Vector, Vector]:
        """∂y(T)/∂y(0) (2n, 2n) and ẏ(T) (2n,) of a flow that ends `there`."""
        n = len(self._steady)
        later = _APART * float(np.min(size[:n] / size[n:]))
        starts = [*(state + _APART * np.eye(state.size)), state]
        durations = [*np.full(state.size, duration), duration + later]
        *moved, last = self._ends(model, size, starts, durations)
        return np.stack([(each - there) / _APART for each in moved], axis=1), (last - there) / later

    def _ends(self, model: Model, size: Vector, states: Sequence[Vector], durations: Sequence[float]) -> list[Vector]:
        """Where transients from states (2n,), in units of `size`, end; as many at once as there are processors."""
        ends, at_once = [], cores()
        with ThreadPoolExecutor(at_once) as pool:
            for first in range(0, len(states), at_once):
                part = slice(first, first + at_once)
                through = partial(self._through, model, count=16)  # samples, of which the last is used
                for samples, steps in pool.map(through, [each * size for each in states[part]], durations[part]):
                    self._before(self)
                    self.steps += steps
                    ends.append(samples[-1] / size)
        return ends

    def samples(self, model: Model, state: Vector, duration: float, count: int, tolerance: float = TOLERANCE) -> Vector:
        """So many states (count + 1, 2n) from one, evenly over a duration (s), both ends included."""
        self._before(self)
        found, steps = self._through(model, state, duration, count, tolerance)
        self.steps += steps
        return found

    def _through(
        self, model: Model, state: Vector, duration: float, count: int, tolerance: float = TOLERANCE
    ) -> tuple[Vector, int]:
        """The states that `samples` returns, and how many steps it took; counts nothing."""
        n = len(self._steady)
        how: Any = {"duration": duration, "sample_rate": count / duration, "tolerance": tolerance}
        chunks = list(integrate(model, self._steady, state[:n] - self._steady, state[n:], solver=self._solver, **how))
        samples = np.vstack([np.hstack([each.displacement, each.velocity]) for each in chunks])
        return samples, sum(chunk.steps for chunk in chunks)


LONGEST = 20  # periods of the main line that an orbit may have
# Of the run's steps, and of those that it would make in the time that all else takes: a rigid shoe's takes 5 s for
# reading, eigenvalues and figures, and 10 µs for a step. Where bodies bend, a run takes its time for integrating.
STEPS, ELSE = 0.25, 500_000
SAMPLES = 256  # of the orbit; its chords are 1e-4 of its size off it
SEEN, END = 200, 10  # states whose distance from the orbit is taken, in the last one of so many parts
CLEAR = 3.0  # times its error, by which a multiplier has to be inside the unit circle


class Approach(Finding):
    """A stable periodic motion to which a motion comes.

    `amplitude` is half its peak-to-peak values (m, rad), `largest_multiplier` the largest Floquet multiplier μ but the
    one that is 1, and `rate_1_per_s` = ln |μ|/T how disturbances change. `distance` is how far the motion is from it at
    the end of the record, rms, as a fraction of its size; `residual` is the largest difference between the orbit's
    state and itself a period later, as such a fraction, too. `record_needed_s` is how long the record has to be to show
    whether the motion gets there, where it only seems so; None where it does.
    """

    frequency_Hz: float
    amplitude: dict[str, float]
    rate_1_per_s: float
    largest_multiplier: float
    distance: float
    residual: float
    record_needed_s: float | None = None


class LastStates(NamedTuple):
    """The last states (k, 2n) of a transient of so many seconds at a sample rate (Hz), and their main line (Hz).

    They are those of a model about steady sliding (n,), integrated by the method `solver` at a tolerance. The whole
    transient took so many `steps`.
    """

    states: Vector
    duration_s: float
    sample_rate: float
    frequency_Hz: float
    model: Model
    steady: Vector
    solver: str
    tolerance: float
    steps: int


class _TooLongError(Exception):
    """More would have to be simulated than is worth it."""


def find_approach(record: LastStates) -> Approach | None:
    """The stable periodic motion that a record approaches; None where none is found."""
    size = _size(record)
    scaled = record.states / size

    def before_transient(spent: Neighbours) -> None:
        if spent.steps > _most_steps(record):
            raise _TooLongError

    neighbours = Neighbours(record.steady, record.solver, before_transient)
    for period in _periods(scaled, record):
        neighbours.forget()  # derivatives over another period
        scale = np.append(size, [period, 1.0])
        shooting = Shooting(lambda _: (record.model, None), scale, flow=neighbours)
        try:
            closed = shooting.close(np.append(scaled[-1], [1.0, 0.0]))
            found = None if closed is None else _approached(record, shooting, closed, neighbours)
        except _TooLongError:
            return None
        except IntegrationError:
            continue
        if found is not None:
            return found
    return None


def _most_steps(record: LastStates) -> float:
    """So many steps are worth it."""
    return STEPS * (record.steps + (0 if record.model.contact.cell_axes else ELSE))


def _size(record: LastStates) -> Vector:
    """What the largest kinetic energy gives each coordinate at the main line (2n,), in m, rad, m/s, rad/s."""
    n, mass = len(record.steady), np.asarray(record.model.mass)
    speed = np.sqrt(np.max(record.states[:, n:] ** 2 @ mass) / mass)
    return np.append(speed / (2 * np.pi * record.frequency_Hz), speed)


def _periods(scaled: Vector, record: LastStates) -> list[float]:
    """After how many seconds the last state comes back, near to turns of the main line, the most promising first."""
    turn = record.sample_rate / record.frequency_Hz
    found: list[tuple[float, float]] = []
    for turns in range(1, LONGEST + 1):
        first, stop = (round((turns + part) * turn) for part in (-0.25, 0.25))
        if stop < len(scaled):
            distance, place = _nearest(scaled[-1], scaled[-1 - stop : len(scaled) - first])
            found.append((distance, stop - place))
    # Chords between samples are so far off an arc.
    off = (2 * np.pi / turn) ** 2 / 8
    # 0.3 of the size of the motion, from which the last state comes back: the longest step of Newton's method
    back = sorted((max(distance, off) * lag, lag) for distance, lag in found if distance < 0.3)
    # 6 at most, the one first that comes nearest in the shortest time
    return [lag / record.sample_rate for _, lag in back[:6]]


def _approached(record: LastStates, shooting: Shooting, closed: Closed, neighbours: Neighbours) -> Approach | None:
    """What is known of a closed orbit, if it is stable and the record comes to it."""
    state, period, _ = shooting.unscaled(closed.unknowns)
    size, n = shooting.scale[:-2], len(record.steady)
    given = record.model, size, closed.unknowns[:-2], period, closed.flow.end
    multipliers = np.linalg.eigvals(neighbours.derivatives(*given)[0])
    trivial = int(np.argmin(np.abs(multipliers - 1)))
    # Over several turns at once they are powers, and as much inside. Steps damp or feed all alike, trivial or not.
    error = max(abs(multipliers[trivial] - 1), TOLERANCE)
    # What sticking forgets altogether has multipliers that are known to no better than neighbours are apart.
    largest = float(np.max(np.abs(np.delete(multipliers, trivial)), initial=_APART))
    if 1 - largest < CLEAR * error:
        return None
    rate = float(np.log(largest) / period)
    period /= _turns(record.model, state, period, size, neighbours)
    orbit = neighbours.samples(record.model, state, period, SAMPLES)
    if np.max(np.ptp(orbit / size, axis=0)) < RECURRENCE:  # steady sliding, which closes after any time
        return None
    found = Approach(
        frequency_Hz=1 / period,
        amplitude=dict(zip(record.model.names, (np.ptp(orbit[:, :n], axis=0) / 2).tolist(), strict=True)),
        rate_1_per_s=rate,
        largest_multiplier=float(np.exp(rate * period)),
        distance=_distance(record.states / size, orbit / size),
        residual=closed.residual,
    )
    return _reached(record, found, orbit, size, neighbours)


def _turns(model: Model, state: Vector, period: float, size: Vector, neighbours: Neighbours) -> int:
    """How many times an orbit repeats within the period that was found."""
    for turns in range(LONGEST, 1, -1):
        end = neighbours.samples(model, state, period / turns, SAMPLES)[-1]
        if np.max(np.abs(end - state) / size) < RECURRENCE:
            return turns
    return 1


def _reached(
    record: LastStates, found: Approach, orbit: Vector, size: Vector, neighbours: Neighbours
) -> Approach | None:
    """The same, if the motion goes on to it; where that would take too long, with what it would take, if it nears it.

    To be near, and to come nearer for a while, is no proof: another motion may lie beside the orbit.
    """
    if found.distance <= RECURRENCE:
        return found
    left = np.log(found.distance / RECURRENCE) / -found.rate_1_per_s + 1 / found.frequency_Hz
    if neighbours.steps + left / record.duration_s * record.steps > _most_steps(record):
        before = _distance(np.array_split(record.states, 2)[0] / size, orbit / size)
        seconds = len(record.states) / 2 / record.sample_rate
        nears = falls_as_small(np.log(found.distance / before) / seconds, found.rate_1_per_s)
        return found.model_copy(update={"record_needed_s": record.duration_s + left}) if nears else None
    count = int(left * record.sample_rate)
    further = neighbours.samples(record.model, record.states[-1], left, count, record.tolerance)
    return found if _distance(further / size, orbit / size) < CLEAR * RECURRENCE else None


def _distance(states: Vector, orbit: Vector) -> float:
    """Root mean square distance of the last of some states (k, 2n) from an orbit (m, 2n)."""
    last = states[-max(1, len(states) // END) :]
    seen = last[:: max(1, len(last) // SEEN)]
    return float(np.sqrt(np.mean([_nearest(state, orbit)[0] ** 2 for state in seen])))


def _nearest(state: Vector, path: Vector) -> tuple[float, float]:
    """Distance of a state (2n,) from the chords of a path (m, 2n), and the place of the nearest in it, in samples."""
    away, chord = state - path[:-1], np.diff(path, axis=0)
    lengths = np.maximum(np.sum(chord**2, axis=1), np.finfo(np.float64).tiny)  # 0 where nothing moved
    along = np.clip(np.sum(away * chord, axis=1) / lengths, 0, 1)
    distances = np.linalg.norm(away - along[:, None] * chord, axis=1)
    k = int(np.argmin(distances))
    return float(distances[k]), k + float(along[k])


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

    `kinetic_fraction` is each coordinate's fraction of the mean kinetic energy, empty at rest. `main` is the line that
    holds most of it; None at rest, and where the part is too short for a spectrum or the motion has no line in it.
    """

    amplitude: dict[str, float]
    kinetic_fraction: dict[str, float]
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
    pressure = np.asarray(stability.pressure_range[1])
    depths = [float(depth_under(side.lining.law, pressure)) for _, side in model.sides]
    lost = [depth for depth in depths if depth > 0]
    if lost:
        return min(lost) / characteristic_lengths(vibration.coordinates, model.body)
    return np.maximum(largest, np.finfo(np.float64).tiny)


def _taking_part(vibration: Vibration, stability: Stability) -> tuple[Mode, ...]:
    """The unstable modes (all modes if none is) whose coordinate moves at some time."""
    moving = {
        name for name, size in zip(vibration.coordinates, np.ptp(vibration.extremes(), axis=0), strict=True) if size > 0
    }
    able = tuple(mode for mode in stability.modes if mode.name in moving)
    return tuple(mode for mode in able if mode.unstable) or able
