"""Friction between lining and drum: a law, which says how large it is, along a direction; and how heat fades it.

C ϑ̇ = P − h ϑ with P the heat of friction (W) and ϑ the rise over the surroundings (K), zero at the start, lumped over
lining and shoe; friction falls with it, μ(s, ϑ) = μ(s) max(0, 1 − γ ϑ).
"""

from typing import Protocol

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.physics.bodies.body import Scalar
from drumsqueal.physics.effects.operation import OperatingPoint
from drumsqueal.physics.friction_law import FrictionLaw
from drumsqueal.precision import real


class SlipDirection(Protocol):
    """What friction asks of a direction: against the slip velocity, its part along the arc only, or one smoothed."""

    @property
    def knows_axial(self) -> bool:
        """Whether the slip across the arc, V_z, counts."""
        ...

    def traction(
        self, law: FrictionLaw, pressure: Array, slip: Array, axial: Array | None
    ) -> tuple[Array, Array | None]:
        """Tractions along θ and z (Pa) at slip velocity V_θ, V_z (m/s; None where it is not known)."""
        ...


class Tangential(eqx.Module):
    """F = −μ(|V_θ|) N sgn(V_θ) e_θ: the reduced form that knows the sliding direction only."""

    knows_axial: bool = eqx.field(static=True, default=False, init=False)

    def traction(self, law: FrictionLaw, pressure: Array, slip: Array, axial: Array | None) -> tuple[Array, None]:
        """Traction along θ (Pa) at slip velocity V_θ (m/s); none along z."""
        del axial
        return -law.coefficient(jnp.abs(slip)) * pressure * jnp.sign(slip), None


class UnitVelocity(eqx.Module):
    """F = −μ(|V|) N V/|V| (equation (14)); no force where V = 0, and no regularisation elsewhere."""

    knows_axial: bool = eqx.field(static=True, default=True, init=False)

    def traction(
        self, law: FrictionLaw, pressure: Array, slip: Array, axial: Array | None
    ) -> tuple[Array, Array | None]:
        """Tractions along θ and z (Pa) at slip velocity V_θ, V_z (m/s); V_z is None for motion in the plane."""
        if axial is None:
            return Tangential().traction(law, pressure, slip, None)
        squared = slip * slip + axial * axial
        sliding = squared > 0
        speed = jnp.sqrt(jnp.where(sliding, squared, 1.0))
        fraction = jnp.where(sliding, -law.coefficient(speed) * pressure / speed, 0.0)
        return fraction * slip, fraction * axial


class Friction(eqx.Module):
    """A friction law along a direction."""

    law: FrictionLaw
    direction: SlipDirection

    def traction(
        self, moment: OperatingPoint, pressure: Array, slip: Array, axial: Array | None
    ) -> tuple[Array, Array | None]:
        """Tractions on the lining along θ and z (Pa); the latter None where it is not called for."""
        along, across = self.direction.traction(self.law, pressure, slip, axial)
        fraction = moment.friction_left
        if fraction is None:
            return along, across
        return fraction * along, None if across is None else fraction * across

    def steady_coefficient(self, moment: OperatingPoint, speed: ArrayLike) -> Array:
        """Signed μ at steady sliding with drum surface speed RΩ (m/s): positive drags the shoe along +θ."""
        coefficient = self.law.coefficient(jnp.abs(speed)) * jnp.sign(speed)
        return coefficient if moment.friction_left is None else moment.friction_left * coefficient


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
