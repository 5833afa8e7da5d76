"""Where a search for cycles may begin: returns of a record, motions along modes and from rest on the drum.

Along a mode of amplitude a, friction and damping do the net work W(a) in a period. A cycle near that mode has W(a) = 0:
the first step of the method of averaging, good for the start of Newton's method.
"""

from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.errors import CycleError
from drumsqueal.physics.model import Model, at_lining
from drumsqueal.programs import compiled
from drumsqueal.solve.cycles.shooting import TOLERANCE, ShootingStart, Vector
from drumsqueal.solve.linear.modes import Mode, Stability, analyse_stability
from drumsqueal.solve.transient.flow import StickTransition, flow, state_size
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
