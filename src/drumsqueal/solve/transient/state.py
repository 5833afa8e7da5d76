"""What a transient carries from chunk to chunk, a chunk in time, and how well a step has to resolve the motion."""

import functools
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.coordinates import is_static
from drumsqueal.physics.effects.damping import frictionless_modes
from drumsqueal.physics.model import Model
from drumsqueal.programs import Program
from drumsqueal.solve.transient.runge_kutta import local_fraction

CHUNK_SAMPLES = 500  # samples a chunk: some 50 ms of computing in the plane, so that Ctrl-C and the bar respond


class State(NamedTuple):
    """Displacement from steady sliding (n,), velocity (n,) and energy fed in so far beyond the stored one (J).

    `memory` is what effects remember (m,), None where none does. The solver sees it as one flat array, which takes less
    than half the time of a tree of three.
    """

    vibration: Array
    velocity: Array
    work: Array
    memory: Array | None = None

    def flat(self) -> Array:
        """One array (2n + m + 1,), the work last."""
        memory = () if self.memory is None else (self.memory,)
        return jnp.concatenate([self.vibration, self.velocity, *memory, self.work[None]])

    @staticmethod
    def split(flat: Any, remembered: int = 0) -> "State":
        """From an array (..., 2n + m + 1) with m numbers that effects remember."""
        n = (flat.shape[-1] - remembered) // 2
        memory = flat[..., 2 * n : -1] if remembered else None
        return State(flat[..., :n], flat[..., n : 2 * n], flat[..., -1], memory)


class Span(NamedTuple):
    """One chunk in time: its start (s), the interval between samples (s), and how many there are after the first.

    It is entered `offset` and left `until` (s) after its start, if that is before its end. What is prescribed over time
    is taken from within `after` and `before` (s of the transient): where it jumps, from this side of the jump.
    """

    start: Any  # numbers outside a compiled call, arrays within
    interval: Any
    samples: Any
    offset: Any = np.float64(0)
    until: Any = np.float64(np.inf)
    after: Any = np.float64(-np.inf)
    before: Any = np.float64(np.inf)

    @property
    def length(self) -> Any:
        """From its start to its end (s)."""
        return self.samples * self.interval

    @property
    def grid(self) -> Array:
        """Its samples (s after its start), CHUNK_SAMPLES + 1 of them: those beyond its last one never come."""
        numbers = jnp.arange(CHUNK_SAMPLES + 1)
        return jnp.where(numbers <= self.samples, numbers * jnp.asarray(self.interval), jnp.inf)

    def inside(self, time: Any) -> Any:
        """A time (s of the transient) at which to ask for what is prescribed."""
        jax_or_numpy = jnp if isinstance(time, Array) else np
        return jax_or_numpy.clip(time, self.after, self.before)


# A coordinate is resolved at least to this fraction of what it would do if all vibration energy were in each mode.
COUPLING_FRACTION = 1e-3
QUIET = 1e-12  # m; motion below a picometre counts as rest, and is resolved as if it were that large
# Round-offs of the load's forces that a step gathers: a motion is not resolved finer than they let it be.
ROUND_OFF = 16 * np.finfo(np.float64).eps


def local_tolerance(tolerance: ArrayLike, solver: str) -> Array:
    """What one step of a method may err, over the amplitude of the motion."""
    # One step may err by 1e-14 of the motion at least; less would be round-off.
    return jnp.maximum(tolerance * local_fraction(solver), 1e-14)


class MotionScale(NamedTuple):
    """What motion is measured by: frictionless frequencies (n,) in rad/s, mass-normalised modes (n, n), least speed.

    That is the speed of a mass-normalised mode (m/s √kg) that vibrates at the highest frequency as little as rest does.
    """

    omega: Array
    modes: Array
    least: Array

    def amplitudes(self, model: Model, state: State) -> State:
        """Amplitudes that the present vibration energy gives to displacement, velocity (n,) and work.

        In the mass-normalised modes (ω_j, Φ) of the frictionless shoe, s_j = √((ω_j p_j)² + ṗ_j²) is the amplitude of
        ṗ_j; coordinate i has velocity amplitude Σ |Φ_ij| s_j and displacement amplitude Σ |Φ_ij| s_j/ω_j. Unlike the
        present values they do not pass through zero, so an error relative to them is a fair measure at any phase.
        Static shapes have those that all the energy would give them: how they ring by themselves is no motion of the
        brake, but what a sum of modes up to some frequency leaves out.
        """
        shaped = model.mass[:, None] * self.modes
        position, speed = (jnp.sum(x[:, None] * shaped, axis=0) for x in (state.vibration, state.velocity))
        amplitude = jnp.sqrt((self.omega * position) ** 2 + speed**2)
        total = jnp.sqrt(jnp.sum(amplitude**2) + self.least**2)
        amplitude = jnp.maximum(amplitude, COUPLING_FRACTION * total)
        # A mode without stiffness drifts; it is given the slowest of the other frequencies.
        slowest = jnp.min(jnp.where(self.omega > 0, self.omega, highest(self.omega)))
        size, period = jnp.abs(self.modes), 1 / jnp.where(self.omega > 0, self.omega, slowest)
        vibration, velocity = jnp.sum(size * amplitude * period, axis=1), jnp.sum(size * amplitude, axis=1)
        static = np.array([is_static(name) for name in model.names])
        if static.any():
            alone = jnp.sqrt(jnp.where(static, model.mass / jnp.diag(model.stiffness), 0.0))  # 1 over rad/s
            vibration, velocity = jnp.maximum(vibration, total * alone), jnp.maximum(velocity, total * static)
        return State(vibration, velocity, total**2 / 2, model.memory_size(state.memory))


def resolution(model: Model, span: Span, local: Array) -> MotionScale:
    """What motion is measured by in a chunk; it takes eigenvalues, which no kernel finds."""
    return _resolution(model, _quiet(model, jnp.asarray(span.start), local))


def _resolution(model: Model, quiet: ArrayLike = QUIET) -> MotionScale:
    omega, modes = frictionless_modes(model.mass, model.stiffness)
    omega = jnp.abs(omega)
    return MotionScale(omega, modes, jnp.asarray(quiet) * highest(omega) * jnp.sqrt(jnp.max(model.mass)))


def _quiet(model: Model, time: Array, local: Array) -> Array:
    """Amplitude (m) below which motion counts as rest: where round-off of the load's forces exceeds the tolerance."""
    moment, stiffest = model.operation.at(time), jnp.max(jnp.diag(model.stiffness))
    preloads = [preload for preload, _ in moment.preloads]
    if moment.pushes:
        pushed = sum(abs(size) for size, _ in moment.pushes) / model.body.area
        preloads = [preload + pushed for preload in preloads]
    preload = functools.reduce(jnp.maximum, preloads)
    laws = zip(model.contact.laws, preloads, strict=True)
    pressed = functools.reduce(jnp.maximum, (law.depth(each) for law, each in laws))
    # Where it is not the contact that yields under the load, the springs yield to friction.
    sprung = (pressed == 0) & (stiffest > 0)
    drawn = preload * model.body.area / jnp.where(sprung, stiffest, 1.0)
    return jnp.maximum(QUIET, ROUND_OFF * jnp.where(sprung, drawn, pressed) / local)


def motion_scale(model: Model, state: State) -> State:
    """Amplitudes that the present vibration energy gives to displacement, velocity (n,) and work, at least `QUIET`."""
    return _resolution(model).amplitudes(model, state)


@Program
def least_energy(model: Model) -> Array:
    """Vibration energy (J) below which motion counts as rest: that of a picometre of the highest frictionless mode."""
    return _resolution(model).least ** 2 / 2


def highest(omega: Array) -> Array:
    """The highest of frequencies (n,), one where none is above zero."""
    highest = jnp.max(omega)
    return jnp.where(highest > 0, highest, 1.0)
