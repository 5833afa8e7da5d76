"""Friction laws: the coefficient of friction as a function of the slip speed."""

from typing import ClassVar, Protocol, runtime_checkable

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from drumsqueal.precision import real


@runtime_checkable
class FrictionLaw(Protocol):
    """What friction asks of a law; one with parameters of its own is an `equinox.Module` with this method.

    A law as smooth as an exponential may say so by a class variable `smooth = True`: in space the lining is then not
    searched for edges where there are none. A law that holds what rests with more than it drags what slides has a
    method `at_rest()`, the largest μ at rest; without one that is μ(0).
    """

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s), of any shape; at 0 its limit at slow slip."""
        ...


def static_coefficient(law: FrictionLaw) -> Array:
    """Largest μ where nothing slips: the law's own, or what its μ(s) goes to at slow slip."""
    at_rest = getattr(law, "at_rest", None)
    return law.coefficient(jnp.zeros(())) if at_rest is None else at_rest()


class ExponentialLaw(eqx.Module):
    """μ(s) = μ_k + (μ_s − μ_k) exp(−α s) (Seo & Kang 2023, equation (16)); α in s/m, s in m/s."""

    smooth: ClassVar[bool] = True
    static: Array = eqx.field(converter=real)
    kinetic: Array = eqx.field(converter=real)
    decay: Array = eqx.field(converter=real)

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s)."""
        return self.kinetic + (self.static - self.kinetic) * jnp.exp(-self.decay * slip_speed)


class ConstantLaw(eqx.Module):
    """The same μ at every slip speed."""

    smooth: ClassVar[bool] = True
    value: Array = eqx.field(converter=real)

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s)."""
        del slip_speed
        return self.value


class StepLaw(eqx.Module):
    """The same μ_k at every slip speed, and up to μ_s ≥ μ_k at rest: Coulomb's law with its step at zero."""

    smooth: ClassVar[bool] = True
    static: Array = eqx.field(converter=real)
    kinetic: Array = eqx.field(converter=real)

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s)."""
        del slip_speed
        return self.kinetic

    def at_rest(self) -> Array:
        """The largest μ where nothing slips."""
        return self.static
