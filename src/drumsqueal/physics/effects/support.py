"""Support springs that hold the shoe in the assembly."""

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from drumsqueal.physics.bodies.rigid_shoe import TZ, X
from drumsqueal.physics.effects.action import Action, Six
from drumsqueal.physics.effects.operation import Moment
from drumsqueal.precision import real


class Support(eqx.Module):
    """U = ½ (k1 + k2) q1² + ½ (k1 + k2) R² sin² q6 (Seo & Kang 2023, equation (24)); k1, k2 in N/m, R in m."""

    upper_stiffness: Array = eqx.field(converter=real)
    lower_stiffness: Array = eqx.field(converter=real)
    radius: Array = eqx.field(converter=real)

    def act(self, moment: Moment, q: Six, v: Six) -> Action:
        """Force −∂U/∂q; all of it comes from the potential."""
        del moment, v
        k = self.upper_stiffness + self.lower_stiffness
        force = (-k * q[X], 0.0, 0.0, 0.0, 0.0, -k * self.radius**2 * jnp.sin(q[TZ]) * jnp.cos(q[TZ]))
        return Action(force, 0.0)

    def potential_energy(self, moment: Moment, q: Six) -> Array:
        """U (J)."""
        del moment
        k = self.upper_stiffness + self.lower_stiffness
        return k / 2 * (jnp.square(q[X]) + (self.radius * jnp.sin(q[TZ])) ** 2)

    def stiffness(self) -> Array:
        """∂²U/∂q² at q = 0, shape (6, 6)."""
        k = self.upper_stiffness + self.lower_stiffness
        return jnp.zeros((6, 6)).at[X, X].set(k).at[TZ, TZ].set(k * self.radius**2)
