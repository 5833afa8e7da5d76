"""Friction laws: the coefficient of friction as a function of the slip speed."""

from typing import Protocol, runtime_checkable

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from drumsqueal.precision import real


@runtime_checkable
class FrictionLaw(Protocol):
    """What friction asks of a law; one with parameters of its own is an `equinox.Module` with this method.

    A law that is smooth, made of e^(−α s) and the like, may tell its largest α (s/m) as `steepness`: in space the
    lining is then not searched for edges where there are none.
    """

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s), of any shape."""
        ...


class ExponentialLaw(eqx.Module):
    """μ(s) = μ_k + (μ_s − μ_k) exp(−α s) (Seo & Kang 2023, equation (16)); α in s/m, s in m/s."""

    static: Array = eqx.field(converter=real)
    kinetic: Array = eqx.field(converter=real)
    decay: Array = eqx.field(converter=real)

    @property
    def steepness(self) -> Array:
        """α (s/m)."""
        return self.decay

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s)."""
        return self.kinetic + (self.static - self.kinetic) * jnp.exp(-self.decay * slip_speed)


class ConstantLaw(eqx.Module):
    """The same μ at every slip speed."""

    value: Array = eqx.field(converter=real)

    @property
    def steepness(self) -> float:
        """None at all (s/m)."""
        return 0.0

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s)."""
        del slip_speed
        return self.value
