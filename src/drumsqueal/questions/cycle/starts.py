"""Where to look for a periodic motion: near a mode that friction feeds as much as it brakes, or where a record returns.

Along a mode of steady sliding with amplitude a friction and damping do the net work W(a) in a period. A cycle near that
mode has W(a) = 0: the first step of the method of averaging, good for the start of Newton's method.
"""

from collections.abc import Iterator
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from drumsqueal.physics.kernel import compiled
from drumsqueal.physics.model import Model
from drumsqueal.questions.cycle.shooting import Vector
from drumsqueal.solve.linear.modes import Mode, Stability

Shape = NDArray[np.complex128]  # of a mode, over the coordinates that move

PHASES = 64  # of a period, at which the work is summed
LEAST, MOST, AMPLITUDES = 1e-3, 4.0, 80  # of the amplitude at which the fastest point is as fast as the drum
ROUND_OFF = 1e-9  # of the vibration energy in a radian: a gain below that is none
NEAREST = 4  # returns of a record that are tried
LONGEST_RETURN = 6.0  # periods of the lowest frequency of interest
APART = 0.05  # of each other: two returns after so different times are two


class Start(NamedTuple):
    """A state (2n,), displacement from q = 0 and velocity, a period (s), and where that comes from."""

    state: Vector
    period: float
    origin: str


def modal_starts(model: Model, stability: Stability) -> Iterator[Start]:
    """Motions along each mode with an amplitude at which nothing is gained over a period, the largest first."""
    places = [stability.coordinates.index(name) for name in model.names]
    steady = stability.steady_state[places]
    for mode in stability.modes:
        if mode.name not in model.names:
            continue
        shape = mode.right[np.asarray(places)]
        amplitudes = reach(model, mode, shape) * np.geomspace(LEAST, MOST, AMPLITUDES)
        work = np.asarray(_work(model, jnp.asarray(steady), jnp.asarray(shape), mode.eigenvalue.imag, amplitudes))
        # Without damping nothing is gained or lost but round-off: all amplitudes would do, and none is a cycle.
        least = ROUND_OFF * amplitudes**2 * _energy(model, shape) * mode.eigenvalue.imag**3
        changes = (
            (np.sign(work[:-1]) * np.sign(work[1:]) < 0) & (np.abs(work) > least)[:-1] & (np.abs(work) > least)[1:]
        )
        for k in reversed(np.flatnonzero(changes)):
            fraction = work[k] / (work[k] - work[k + 1])
            amplitude = float(amplitudes[k] * (amplitudes[k + 1] / amplitudes[k]) ** fraction)
            yield modal_start(steady, mode, shape, amplitude)


def modal_start(steady: Vector, mode: Mode, shape: Shape, amplitude: float) -> Start:
    """The motion along a mode whose displacements (n,) have the complex `shape`, of an amplitude (m, rad)."""
    frequency = mode.eigenvalue.imag
    state: Vector = np.concatenate([steady + amplitude * shape.real, -amplitude * frequency * shape.imag])
    return Start(state, 2 * np.pi / frequency, f"along mode {mode.label}, {amplitude:.3g} of {mode.name}")


def reach(model: Model, mode: Mode, shape: Shape | None = None) -> float:
    """Amplitude (m, rad) of a mode at which the fastest point of the contact is as fast as the drum."""
    moving = mode.right[: len(model.names)] if shape is None else shape
    return float(_reach(model, jnp.asarray(moving * 1j * mode.eigenvalue.imag)))


def _energy(model: Model, shape: Shape) -> float:
    """Kinetic energy (J) of a mode over the squares of amplitude and angular frequency."""
    return float(np.sum(np.asarray(model.mass) * np.abs(shape) ** 2) / 2)


@compiled
def _reach(model: Model, velocity: Array) -> Array:
    """Amplitude at which the fastest point of the contact would be as fast as the drum."""
    moment = model.operation.at(0.0)
    still = moment._replace(drum_speed=jnp.zeros(()))
    fastest = jnp.hypot(*(model.contact.fastest_slip(still, part) for part in (velocity.real, velocity.imag)))
    return model.contact.fastest_slip(moment, jnp.zeros(len(model.names))) / jnp.where(fastest > 0, fastest, 1.0)


@compiled
def _work(model: Model, steady: Array, shape: Array, frequency: Array, amplitudes: Array) -> Array:
    """Mean power (W) of what stores no energy, along motions of these amplitudes (k,)."""
    turns = jnp.exp(2j * jnp.pi * jnp.arange(PHASES) / PHASES)

    def power(motion: tuple[Array, Array]) -> Array:
        amplitude, turn = motion
        moved = amplitude * shape * turn
        return model.act(0.0, steady + moved.real, (1j * frequency * moved).real)[1]

    pairs = [part.ravel() for part in jnp.meshgrid(amplitudes, turns, indexing="ij")]
    powers = jax.lax.map(power, (pairs[0].real, pairs[1]))
    return jnp.mean(powers.reshape(amplitudes.size, PHASES), axis=1)


def returns(time: Vector, states: Vector, scale: Vector, lowest_frequency: float) -> Iterator[Start]:
    """Where a record of states (k, 2n) comes nearest to itself again, the nearest first; `scale` (2n,)."""
    scaled = states / scale
    interval = time[1] - time[0]
    longest = min(int(LONGEST_RETURN / lowest_frequency / interval), len(scaled) // 2)
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
        if len(taken) == NEAREST:
            return
        if all(abs(lag - other) > APART * other for other in taken):
            taken.append(int(lag))
            yield Start(
                states[places[lag]],
                float(lag * interval),
                f"where the transient nearly returns at {time[places[lag]]:.4g} s",
            )
