"""Support springs that hold the shoe in the assembly."""

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from drumsqueal.physics.bodies.body import Motion, Scalar
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe, Six
from drumsqueal.physics.effects.action import Action
from drumsqueal.physics.effects.operation import Moment
from drumsqueal.precision import real


class Support(eqx.Module):
    """U = ½ (k1 + k2) q1² + ½ (k1 + k2) R² sin² q6 (Seo & Kang 2023, equation (24)); k1, k2 in N/m, R in m."""

    upper_stiffness: Array = eqx.field(converter=real)
    lower_stiffness: Array = eqx.field(converter=real)
    shoe: RigidShoe

    @property
    def _stiffness(self) -> Array:
        return self.upper_stiffness + self.lower_stiffness

    def act(self, moment: Moment, q: Motion, v: Motion) -> Action:
        """Force −∂U/∂q; all of it comes from the potential."""
        del moment, v
        k, R, six = self._stiffness, self.shoe.outer_radius, self.shoe.widen(q)
        return Action(self.shoe.keep(Six(X=-k * six.X, Tz=-k * R**2 * jnp.sin(six.Tz) * jnp.cos(six.Tz))), 0.0)

    def potential_energy(self, moment: Moment, q: Motion) -> Scalar:
        """U (J)."""
        del moment
        six = self.shoe.widen(q)
        return self._stiffness / 2 * (jnp.square(six.X) + (self.shoe.outer_radius * jnp.sin(six.Tz)) ** 2)

    def stiffness(self) -> Array:
        """∂²U/∂q² at q = 0, shape (n, n)."""
        k = self._stiffness
        return jnp.diag(jnp.array(self.shoe.keep(Six(X=k, Tz=k * self.shoe.outer_radius**2))))
