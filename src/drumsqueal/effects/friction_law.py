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
    searched for edges where there are none.
    """

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s), of any shape."""
        ...


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
