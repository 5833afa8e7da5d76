"""Friction of odd powers of the velocity, of which cycles are known; all of it has one program."""

import equinox as eqx
import jax.numpy as jnp
from jax import Array


class OddFriction(eqx.Module):
    """μ = n₀ + n₁ x + n₃ x³ + n₅ x⁵ + n₇ x⁷ + n₉ x⁹, x = s − 1: numbers from `odd_friction`.

    On a belt of 1 m/s, x″ + c x′ + x + Σ nₖ x′ᵏ = n₀.
    """

    numbers: Array = eqx.field(converter=jnp.asarray)

    def coefficient(self, slip_speed: Array) -> Array:
        x = slip_speed - 1.0
        return sum((self.numbers[k] * x ** (2 * k - 1) for k in range(1, 6)), self.numbers[0])


def odd_friction(constant: float, *odd: float) -> OddFriction:
    """By the constant part and, as far as there are any, the factors of x, x³, x⁵, x⁷ and x⁹."""
    return OddFriction([constant, *odd, *[0.0] * (5 - len(odd))])
