"""Springs between coordinates and the ground: linear ones by their matrix, and the supports of Seo & Kang's shoe."""

from functools import reduce
from math import factorial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.physics.bodies.body import Motion, Scalar, dot, opposite, product
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe, Six
from drumsqueal.physics.effects.effect import Action, Effect
from drumsqueal.physics.effects.operation import OperatingPoint
from drumsqueal.precision import real


class Springs(Effect):
    """U = ½ qᵀ K q with K symmetric (n, n) in N/m over the kept coordinates."""

    matrix: Array = eqx.field(converter=real)

    def act(self, moment: OperatingPoint, q: Motion, v: Motion) -> Action:
        """Force −K q; all of it comes from the potential."""
        del moment, v
        return Action(opposite(product(self.matrix, q)), 0.0)

    def potential_energy(self, moment: OperatingPoint, q: Motion) -> Scalar:
        """U (J)."""
        return -dot(self.act(moment, q, q).force, q) / 2


class SupportSprings(Effect):
    """U = ½ (k1 + k2) q1² + ½ (k1 + k2) R² sin² q6 (Seo & Kang 2023, equation (24)); k1, k2 in N/m, R in m."""

    upper_stiffness: Array = eqx.field(converter=real)
    lower_stiffness: Array = eqx.field(converter=real)
    shoe: RigidShoe

    @property
    def _stiffness(self) -> Array:
        return self.upper_stiffness + self.lower_stiffness

    def act(self, moment: OperatingPoint, q: Motion, v: Motion) -> Action:
        """Force −∂U/∂q; all of it comes from the potential."""
        del moment, v
        k, R, six = self._stiffness, self.shoe.outer_radius, self.shoe.widen(q)
        return Action(self.shoe.keep(Six(X=-k * six.X, Tz=-k * R**2 * _sine_of_double(six.Tz) / 2)), 0.0)

    def potential_energy(self, moment: OperatingPoint, q: Motion) -> Scalar:
        """U (J)."""
        del moment
        six = self.shoe.widen(q)
        return self._stiffness / 2 * (jnp.square(six.X) + (self.shoe.outer_radius * jnp.sin(six.Tz)) ** 2)

    def stiffness(self) -> Array:
        """∂²U/∂q² at q = 0, shape (n, n)."""
        k = self._stiffness
        return jnp.diag(jnp.array(self.shoe.keep(Six(X=k, Tz=k * self.shoe.outer_radius**2))))


def _sine_of_double(angle: Scalar) -> Scalar:
    """sin 2θ; for the small angles that occur without the library's function, a twentieth of an evaluation."""
    double = 2 * angle
    if not isinstance(double, Array):
        return np.sin(double)
    terms = [(-1) ** k / factorial(2 * k + 1) for k in range(5)]
    series = double * reduce(lambda total, term: total * double**2 + term, reversed(terms))
    # 0.05 rad; up to there five terms of the Taylor series of sin 2θ reach round-off
    return jax.lax.cond(jnp.abs(angle) < 0.05, lambda: series, lambda: jnp.sin(double))
