"""Friction between lining and drum: a law, which says how large it is, along a direction."""

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.physics.effects.friction_direction import Direction
from drumsqueal.physics.laws.friction_law import FrictionLaw


class Friction(eqx.Module):
    """A friction law along a direction."""

    law: FrictionLaw
    direction: Direction

    def traction(self, pressure: Array, slip: Array, axial: Array | None) -> tuple[Array, Array | None]:
        """Tractions on the lining along θ and z (Pa); the latter None where it is not called for."""
        return self.direction.traction(self.law, pressure, slip, axial)

    def steady_coefficient(self, speed: ArrayLike) -> Array:
        """Signed μ at steady sliding with drum surface speed RΩ (m/s): positive drags the shoe along +θ."""
        return self.law.coefficient(jnp.abs(speed)) * jnp.sign(speed)
