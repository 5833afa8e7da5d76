"""The periodic motions of a model: where to look for them, and Newton's method from there.

A search begins at the end of a transient, where a transient nearly returns to itself, and near the modes of steady
sliding. Along a mode of amplitude a, friction and damping do the net work W(a) in a period. A cycle near that mode has
W(a) = 0: the first step of the method of averaging, good for the start of Newton's method.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.dynamics.cycles.cycle import Cycle, cut_in_slip, describe, unlike
from drumsqueal.errors import CycleError, IntegrationError
from drumsqueal.findings.decay import decay_to_rest
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.signals.regime import Cause, Regime, classify, rest_words
from drumsqueal.findings.vibration import Vibration, amplitudes_apart
from drumsqueal.physics.model import Model, at_lining
from drumsqueal.programs import compiled
from drumsqueal.progress import Progress
from drumsqueal.solve import motion
from drumsqueal.solve.linear.modes import Mode, Stability, analyse_stability
from drumsqueal.solve.shooting import (
    CLOSED,
    NEUTRAL,
    TOLERANCE,
    Closed,
    Shooting,
    ShootingStart,
    Vector,
    scale_near,
)
from drumsqueal.solve.transient.flow import StickTransition, flow, state_size
from drumsqueal.solve.transient.integrate import Chunk
from drumsqueal.solve.transient.runge_kutta import AUTO
from drumsqueal.solve.transient.sticking import drum_motion

LEAST, MOST, AMPLITUDES = 1e-3, 4.0, 80  # of the amplitude at which the fastest point is as fast as the drum


def released_start(model: Model, steady: Vector) -> ShootingStart | None:
    """The last release of a motion that begins at rest on the drum at steady sliding (n,), and the time between two.

    None where it does not stick again. Raises CycleError where it cannot be followed so far.
    """
    n, modes = len(steady), analyse_stability(model).oscillations
    if not modes:
        return None
    period = 2 * np.pi / min(mode.eigenvalue.imag for mode in modes)
    velocity = np.asarray(drum_motion(model, 0.0, np.zeros(n)))
    size = np.asarray(state_size(model, jnp.zeros(n), jnp.asarray(velocity)))
    start = np.concatenate([steady, velocity]) / size
    for doubling in range(14):  # a slow drum takes long to stretch the springs
        # 8 periods of the slowest mode: how long a motion from rest on the drum gets to stick again, at first
        duration = 8 * period * 2**doubling
        found = flow(model, size, start, duration, TOLERANCE)
        releases = [time for time, what in found.changes if what is StickTransition.SLIPS]
        if not found.reached:
            raise CycleError("a motion that slips and sticks takes too many steps")
        # What does not hold it at the start reverses its slip there, and that is all.
        held = [change for change in found.changes if change[1] is not StickTransition.REVERSES]
        since, what = held[-1] if held else (0.0, StickTransition.SLIPS)
        if what is StickTransition.SLIPS and duration - since > duration / 2:
            return None
        if len(releases) > 2:
            last = flow(model, size, start, releases[-1], TOLERANCE)
            return ShootingStart(last.end * size, releases[-1] - releases[-2], "a motion from rest on the drum")
    raise CycleError("a motion from rest on the drum is not released in time")


def returns(time: Vector, states: Vector, scale: Vector, lowest_frequency: float) -> Iterator[ShootingStart]:
    """Where a record of states (k, 2n) comes nearest to itself again, the nearest first; `scale` (2n,)."""
    scaled = states / scale
    interval = time[1] - time[0]
    # 6.0 periods of the lowest frequency of interest
    longest = min(int(6.0 / lowest_frequency / interval), len(scaled) // 2)
    nearest = np.full(longest + 1, np.inf)
    places = np.zeros(longest + 1, dtype=int)
    for lag in range(2, longest + 1):
        away = np.max(np.abs(scaled[lag:] - scaled[:-lag]), axis=1)
        places[lag] = int(np.argmin(away))
        nearest[lag] = away[places[lag]]
    inner = nearest[1:-1]
    minima = 1 + np.flatnonzero((inner <= nearest[:-2]) & (inner <= nearest[2:]) & np.isfinite(nearest[:-2]))
    taken: list[int] = []
    for lag in sorted(minima, key=lambda lag: nearest[lag]):
        if len(taken) == 4:  # returns of a record that are tried
            return
        # Two returns after times that differ by 0.05 are two.
        if all(abs(lag - other) > 0.05 * other for other in taken):
            taken.append(int(lag))
            origin = f"where the transient nearly returns at {time[places[lag]]:.4g} s"
            yield ShootingStart(states[places[lag]], float(lag * interval), origin)


def modal_starts(model: Model, stability: Stability) -> Iterator[ShootingStart]:
    """Motions along each mode with an amplitude at which nothing is gained over a period, the largest first.

    The stability is that over the coordinates of the model.
    """
    steady = stability.steady_state
    for mode in stability.vibrations:
        shape, frequency = mode.right[: len(steady)], mode.eigenvalue.imag
        amplitudes = reach(model, mode) * np.geomspace(LEAST, MOST, AMPLITUDES)
        work = np.asarray(_work(model, jnp.asarray(steady), jnp.asarray(shape), frequency, amplitudes))
        # Without damping nothing is gained or lost but round-off: all amplitudes would do, and none is a cycle.
        energy = np.sum(np.asarray(model.mass) * np.abs(shape) ** 2) / 2  # over the squares of amplitude and frequency
        # A gain below 1e-9 of the vibration energy in a radian is none.
        known = np.abs(work) > 1e-9 * amplitudes**2 * energy * frequency**3
        changes = (np.sign(work[:-1]) * np.sign(work[1:]) < 0) & known[:-1] & known[1:]
        for k in reversed(np.flatnonzero(changes)):
            fraction = work[k] / (work[k] - work[k + 1])
            yield modal_start(
                model, steady, mode, float(amplitudes[k] * (amplitudes[k + 1] / amplitudes[k]) ** fraction)
            )


def modal_start(model: Model, steady: Vector, mode: Mode, amplitude: float) -> ShootingStart:
    """The motion along a mode about steady sliding (n,), of an amplitude (m, rad) of its named coordinate."""
    factor, unit, shown = at_lining(model, mode.name, amplitude)
    shape, frequency = mode.right[: len(steady)], mode.eigenvalue.imag
    state = np.concatenate([steady + amplitude * shape.real, -amplitude * frequency * shape.imag])
    return ShootingStart(
        state,
        2 * np.pi / frequency,
        f"a motion along mode {mode.label} with {factor * amplitude:.3g} {unit} of {shown}",
    )


def reach(model: Model, mode: Mode) -> float:
    """Amplitude (m, rad) of a mode at which the fastest point of the contact is as fast as the drum."""
    return float(_reach(model, jnp.asarray(mode.right[: len(model.names)] * 1j * mode.eigenvalue.imag)))


@compiled
def _reach(model: Model, velocity: Array) -> Array:
    moment = model.operation.at(0.0)
    still = moment._replace(drum_speed=jnp.zeros(()))
    fastest = jnp.hypot(*(model.contact.fastest_slip(still, part) for part in (velocity.real, velocity.imag)))
    return model.contact.fastest_slip(moment, jnp.zeros(len(model.names))) / jnp.where(fastest > 0, fastest, 1.0)


@compiled
def _work(model: Model, steady: Array, shape: Array, frequency: Array, amplitudes: Array) -> Array:
    """Mean power (W) of what stores no energy, along motions of these amplitudes (k,)."""
    phases = 64  # of a period, at which the work is summed
    turns = jnp.exp(2j * jnp.pi * jnp.arange(phases) / phases)

    def power(motion: tuple[Array, Array]) -> Array:
        amplitude, turn = motion
        moved = amplitude * shape * turn
        return model.act(0.0, steady + moved.real, (1j * frequency * moved).real)[1]

    pairs = [part.ravel() for part in jnp.meshgrid(amplitudes, turns, indexing="ij")]
    powers = jax.lax.map(power, (pairs[0].real, pairs[1]))
    return jnp.mean(powers.reshape(amplitudes.size, phases), axis=1)


FEWEST_SAMPLES = 64


class FoundCycle(Cycle):
    """A cycle that a search found, and where it was started from."""

    found_from: str = ""


class Seed(NamedTuple):
    """A settled motion at a value of the parameter: a start as `integrate` takes it, and its line (Hz), if known."""

    value: float
    start: motion.Start
    frequency_Hz: float | None = None


def search(transient: motion.Transient, progress: Progress) -> tuple[list[FoundCycle], str]:
    """The cycles of a transient's model, a stable one first if there is one, and what the transient does.

    Raises CycleError where none is found.
    """
    found: list[FoundCycle] = []
    reasons: dict[str, list[str]] = {}  # why there is none, and the starts that lead to none for that

    def attempt(starts: Iterable[ShootingStart]) -> None:
        """Add the cycles that differ, each with where it was started from, and why there is none from other starts."""
        for start in starts:
            report = partial(progress, f"Newton's method from {start.origin}", 0, None)
            try:
                cycle = cycle_from(transient.model, start, transient.stability.steady_state, report)
            except CycleError as error:
                reasons.setdefault(str(error), []).append(start.origin)
                continue
            if not any(is_same(cycle, other) for other in found):
                found.append(FoundCycle(found_from=start.origin, **dict(cycle)))

    record = recorded(transient, progress, "transient")
    attempt(_starts(transient, record))
    for disturbed, start in _disturbances(transient):
        if any(cycle.stable for cycle in found):
            break
        after = recorded(start, progress, f"transient {disturbed}")
        lasting = list(_lasting(after, f"a transient {disturbed}"))
        if not lasting:
            reasons.setdefault(f"the transient {after.words}", []).append(disturbed)
        attempt(lasting)
    if not found:
        why = [f"{starts[0]}{_and_others(len(starts) - 1)}: {error}" for error, starts in reasons.items()]
        raise CycleError("; ".join([f"no periodic motion was found: the transient {record.words}", *why]))
    best = min(found, key=lambda cycle: not cycle.stable)
    return [best, *(cycle for cycle in found if cycle is not best)], record.words


def _and_others(count: int) -> str:
    return f" and {count} other {'start' if count == 1 else 'starts'}" if count else ""


def cycle_from(
    model: Model, start: ShootingStart, steady: Vector, on_flow: Callable[[], object] = lambda: None
) -> Cycle:
    """The cycle of a model that Newton's method finds from a start; raises CycleError where there is none."""
    start = cut_in_slip(model, start)
    shooting = Shooting(lambda _: (model, None), scale_near(model, start, steady), on_flow)
    closed = shooting.close(shooting.scaled(start.state, start.period, 0.0))
    if closed is None:
        raise CycleError("Newton's method finds none")
    # 1e-4 of the scale of the start: what has shrunk to less is steady sliding, not a cycle
    if np.max(np.abs(shooting.vibration(closed, steady))) < 1e-4:
        raise CycleError("Newton's method ends at steady sliding")
    cycle = describe(shooting, _shortest(shooting, closed)).model_copy(update={"value": np.nan})
    if np.any(np.abs(cycle.multipliers - 1) < NEUTRAL):
        raise CycleError("it is one of a continuous family of periodic motions, as where nothing feeds or damps them")
    return cycle


def _shortest(shooting: Shooting, closed: Closed) -> Closed:
    """The same motion over its shortest period, if it repeats within the one that was found."""
    for parts in range(7, 1, -1):  # a motion may repeat so many times within a period that was found
        trial = closed.unknowns.copy()
        trial[-2] /= parts
        if np.max(np.abs(shooting.flow(trial).end - trial[:-2])) < np.sqrt(CLOSED):
            again = shooting.close(trial)
            if again is not None:
                return again
    return closed


def is_same(one: Cycle, other: Cycle) -> bool:
    """Whether two cycles are one, by period and amplitudes."""
    # 1e-6 relative difference of period and amplitudes, of what Newton's method closes to 1e-10
    return unlike(one, other.period_s, other.amplitude) < 1e-6


@dataclass(frozen=True)
class RecordedMotion:
    """The last part of a transient: times (k,), states (k, 2n), what it does, its period if it has one.

    `releases` are all times (s) at which the contact began to slip after sticking.
    """

    time: Vector
    states: Vector
    words: str
    period: float | None = None
    at_rest: bool = False
    releases: tuple[float, ...] = ()
    ends_at_rest: bool = False  # after it has decayed

    @property
    def amplitude(self) -> Vector:
        """Half the peak-to-peak values (n,)."""
        return np.ptp(self.states[:, : self.states.shape[1] // 2], axis=0) / 2


def recorded(transient: motion.Transient, progress: Progress, what: str) -> RecordedMotion:
    """The transient, of which so much is looked at as has settled."""
    model, stability, lowest = transient.model, transient.stability, transient.lowest_frequency_Hz
    chunks: list[Chunk] = []
    failed = ""
    try:
        transient.follow(chunks.append, progress, what=what)
    except IntegrationError as error:
        failed = f"failed: {error}"
    n = len(model.names)
    time = np.concatenate([np.empty(0), *(chunk.time for chunk in chunks)])
    moved = (np.hstack([chunk.displacement, chunk.velocity]) for chunk in chunks)
    states = np.concatenate([np.empty((0, 2 * n)), *moved])
    releases = tuple(when for chunk in chunks for when, sticks in chunk.changes if not sticks)
    fractions = (0.6, 0.3, 0.15)  # last parts of a transient that may have settled
    if failed or lowest is None or time.size < FEWEST_SAMPLES / fractions[-1]:
        words = failed or ("is too short to judge" if lowest is not None else "cannot be judged: nothing oscillates")
        return RecordedMotion(time, states, words, releases=releases)
    for fraction in fractions:
        part = slice(int((1 - fraction) * time.size), None)
        scale = _size_of(transient, states[part])[:n]
        regime = classify(states[part, :n], transient.how["sample_rate"], scale=scale, lowest_frequency=lowest)
        if regime.kind is not Kind.UNDECIDED:
            break
    at_rest = regime.kind is Kind.STEADY
    if regime.kind is Kind.UNDECIDED:
        regime = decay_to_rest(regime, Vibration.of(chunks, stability), part, stability, stability.modes, model)
    ends_at_rest = regime.kind is Kind.STEADY
    return RecordedMotion(
        time[part], states[part], regime_words(regime), regime.period_s, at_rest, releases, ends_at_rest
    )


def recorded_at(seed: Seed, model: Model, progress: Progress) -> RecordedMotion:
    """Record the motion of a seed. Raises CycleError where it cannot be recorded."""
    if not analyse_stability(model).oscillations:
        raise CycleError("nothing oscillates there, even without damping")
    how: Any = {"duration": None, "sample_rate": None, "tolerance": 1e-8, "solver": AUTO}  # of the record of a seed
    transient = motion.constant_transient(model, seed.start, **how)
    record = recorded(transient, progress, "motion that a branch may begin at")
    if not record.states.size:
        raise CycleError(f"it {record.words}")
    return record


def closed_from(
    seed: Seed, record: RecordedMotion, model: Model, steady: Vector, on_flow: Callable[[], object]
) -> Cycle:
    """The cycle that the motion of a seed is on, by its period or its line. Raises CycleError where it is on none."""
    period = record.period or (seed.frequency_Hz and 1 / seed.frequency_Hz)
    if not period:
        raise CycleError(f"it {record.words}")
    try:
        cycle = cycle_from(model, ShootingStart(record.states[-1], period, "the motion found"), steady, on_flow)
        amplitude = dict(zip(cycle.names, record.amplitude.tolist(), strict=True))
        # By 0.05 of a motion's amplitudes the cycle that Newton's method finds may differ from them.
        if amplitudes_apart(cycle.amplitude, amplitude, model.mass) > 0.05:
            raise CycleError(f"Newton's method ends at another cycle, of {cycle.frequency_Hz:.5g} Hz")
        if not (cycle.stable or cycle.neutral):
            raise CycleError(f"Newton's method ends at an unstable cycle near it, of {cycle.frequency_Hz:.5g} Hz")
    except CycleError:
        if record.period is None:
            raise CycleError(f"it {record.words}") from None
        raise
    return cycle.model_copy(update={"value": seed.value})


def regime_words(regime: Regime) -> str:
    """What a transient does."""
    match regime.kind:
        case Kind.UNDECIDED:
            needed = regime.record_needed_s and f"; {regime.record_needed_s:.4g} s of record are needed"
            return f"has not settled ({regime.cause}{needed or ''})"
        case Kind.STEADY if regime.cause is Cause.RESTS_ELSEWHERE:
            return f"comes to rest in another equilibrium, {rest_words(regime.numbers)}"
        case Kind.STEADY:
            return "comes to rest in steady sliding"
        case Kind.PERIODIC:
            return "settles to a periodic motion"
        case _:
            return f"settles to no periodic motion (the motion is {regime.kind})"


def _size_of(transient: motion.Transient, states: Vector) -> Vector:
    """Amplitudes (2n,) that the largest vibration of a record gives the coordinates."""
    model, steady = transient.model, transient.stability.steady_state
    n = len(steady)
    largest = states[np.argmax(np.abs(states[:, n:]) @ np.sqrt(np.asarray(model.mass)))]
    return np.asarray(state_size(model, jnp.asarray(largest[:n] - steady), jnp.asarray(largest[n:])))


def _disturbances(transient: motion.Transient) -> Iterator[tuple[str, motion.Transient]]:
    """The same model started along each mode so fast that slip is reversed."""
    for mode in transient.stability.vibrations:
        size = 3.0 * reach(transient.model, mode)  # a large disturbance, times the speed of the drum
        shape = size * mode.right[: len(transient.model.names)]
        velocity = (1j * mode.eigenvalue.imag * shape).real
        disturbed = transient._replace(displacement=shape.real, velocity=velocity)
        yield f"after a large disturbance along mode {mode.label}", disturbed


def _lasting(record: RecordedMotion, what: str) -> Iterator[ShootingStart]:
    """The end of a transient that is periodic, or the last times at which its contact began to slip."""
    if record.period is not None:
        yield ShootingStart(record.states[-1], record.period, f"the end of {what}")
        return
    # Where a search begins, the contact comes off the drum twice in a period at most.
    for first in reversed(record.releases[-3:-1]):
        last = record.releases[-1]
        after = min(int(np.searchsorted(record.time, last)), record.time.size - 1)
        yield ShootingStart(record.states[after], last - first, f"the last releases of the contact in {what}")


def _starts(transient: motion.Transient, record: RecordedMotion) -> Iterator[ShootingStart]:
    yield from _lasting(record, "the transient")
    if record.period is not None:
        return
    lowest = transient.lowest_frequency_Hz
    moves = record.time.size >= FEWEST_SAMPLES and np.ptp(record.states, axis=0).any() and not record.at_rest
    if lowest is not None and moves:
        yield from returns(record.time, record.states, _size_of(transient, record.states), lowest)
    yield from modal_starts(transient.model, transient.stability)
