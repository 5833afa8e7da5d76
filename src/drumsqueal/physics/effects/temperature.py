"""The lining's temperature, and the fade of friction that comes with it: an effect that remembers.

C ϑ̇ = P − h ϑ with P the heat of friction (W) and ϑ the rise over the surroundings (K), zero at the start, lumped over
lining and shoe; friction falls with it, μ(s, ϑ) = μ(s) max(0, 1 − γ ϑ).
"""

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from drumsqueal.physics.bodies.body import Scalar
from drumsqueal.physics.effects.operation import OperatingPoint
from drumsqueal.precision import real


class Temperature(eqx.Module):
    """Heat capacity C (J/K), cooling h (W/K) and fade γ (1/K).

    A transient integrates its state, which is zero at the start, with the motion.
    """

    heat_capacity: Array = eqx.field(converter=real)
    cooling: Array = eqx.field(converter=real)
    fade: Array = eqx.field(converter=real)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its variables in the history: the rise of temperature (K)."""
        return ("lining_temperature",)

    def influence(self, moment: OperatingPoint, memory: Array) -> OperatingPoint:
        """The moment as all other effects see it, with the fraction of friction that is left, max(0, 1 − γ ϑ)."""
        return moment._replace(friction_left=jnp.maximum(0.0, 1 - self.fade * memory[0]))

    def rate(self, memory: Array, heat: Scalar) -> Array:
        """ϑ̇ (1,) in K/s while friction turns so much power into heat (W)."""
        return (heat - self.cooling * memory) / self.heat_capacity

    def size(self, memory: Array) -> Array:
        """ϑ itself, from 1 K on."""
        return jnp.maximum(jnp.abs(memory), 1.0)  # K; the error of a step is measured against a rise of at least this
