"""What a motion is measured by, and how well a step has to resolve it."""

import functools
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.physics.effects.damping import frictionless_modes
from drumsqueal.physics.effects.pressure import yielding
from drumsqueal.physics.model import Model
from drumsqueal.programs import Program
from drumsqueal.solve.transient.runge_kutta import local_fraction
from drumsqueal.solve.transient.state import Span, State

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
        """
        shaped = model.mass[:, None] * self.modes
        position, speed = (jnp.sum(x[:, None] * shaped, axis=0) for x in (state.vibration, state.velocity))
        amplitude = jnp.sqrt((self.omega * position) ** 2 + speed**2)
        total = jnp.sqrt(jnp.sum(amplitude**2) + self.least**2)
        amplitude = jnp.maximum(amplitude, COUPLING_FRACTION * total)
        # A mode without stiffness drifts; it is given the slowest of the other frequencies.
        slowest = jnp.min(jnp.where(self.omega > 0, self.omega, highest(self.omega)))
        size, period = jnp.abs(self.modes), 1 / jnp.where(self.omega > 0, self.omega, slowest)
        return State(
            jnp.sum(size * amplitude * period, axis=1),
            jnp.sum(size * amplitude, axis=1),
            total**2 / 2,
            model.memory_size(state.memory),
        )


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
    pressed = functools.reduce(jnp.maximum, (yielding(law, each) for law, each in laws))
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
