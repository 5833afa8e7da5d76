"""Friction between lining and drum: a law, which says how large it is, along a direction."""

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.physics.effects.friction_direction import Direction
from drumsqueal.physics.effects.operation import Moment
from drumsqueal.physics.laws.friction_law import FrictionLaw


class Friction(eqx.Module):
    """A friction law along a direction."""

    law: FrictionLaw
    direction: Direction

    def traction(self, moment: Moment, pressure: Array, slip: Array, axial: Array | None) -> tuple[Array, Array | None]:
        """Tractions on the lining along θ and z (Pa); the latter None where it is not called for."""
        along, across = self.direction.traction(self.law, pressure, slip, axial)
        fraction = moment.friction_left
        if fraction is None:
            return along, across
        return fraction * along, None if across is None else fraction * across

    def steady_coefficient(self, moment: Moment, speed: ArrayLike) -> Array:
        """Signed μ at steady sliding with drum surface speed RΩ (m/s): positive drags the shoe along +θ."""
        coefficient = self.law.coefficient(jnp.abs(speed)) * jnp.sign(speed)
        return coefficient if moment.friction_left is None else moment.friction_left * coefficient
