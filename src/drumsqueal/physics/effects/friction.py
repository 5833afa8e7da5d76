"""Friction between lining and drum: a law, which says how large it is, along a direction."""

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.physics.effects.operation import OperatingPoint
from drumsqueal.physics.friction_law import FrictionLaw


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


SlipDirection = Tangential | UnitVelocity
"""Against the slip velocity, or its part along the arc only; it knows whether the slip across the arc, V_z, counts."""


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
