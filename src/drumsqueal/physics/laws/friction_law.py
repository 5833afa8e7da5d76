"""Friction laws: the coefficient of friction as a function of the slip speed."""

from typing import Protocol, runtime_checkable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.precision import real


@runtime_checkable
class FrictionLaw(Protocol):
    """What friction asks of a law; one with parameters of its own is an `equinox.Module` with this method.

    A law that holds what rests with more than it drags what slides has a method `at_rest()`, the largest μ at rest;
    without one that is μ(0). One that knows how steep it is has a method `breakpoints()`, see `breakpoints`.
    """

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s), of any shape; at 0 its limit at slow slip."""
        ...


def static_coefficient(law: FrictionLaw) -> Array:
    """Largest μ where nothing slips: the law's own, or what its μ(s) goes to at slow slip."""
    at_rest = getattr(law, "at_rest", None)
    return law.coefficient(jnp.zeros(())) if at_rest is None else at_rest()


# Slip speeds times α at which exp(−α s) is cut. With sixteen Gauss nodes on each stretch the error of a contact
# integral was 3e-15 of the load at the worst of 2000 random motions; exp(−40) is 4e-18.
EXPONENTIAL_STRETCHES = np.array([12.0, 40.0])
LEAST_DECAY = 1e-30  # s/m; keeps the slip speeds finite where nothing decays
# Slip speeds between which any law is resolved that varies on no scale shorter than a hundredth of its slip speed, at
# slip speeds from 1e-5 to 100 m/s: for a law of which nothing is known.
ANY_LAW = 1e-5 * 4.0 ** np.arange(12)


def breakpoints(law: FrictionLaw) -> Array:
    """Rising slip speeds (K,) in m/s that cut μ(s) into stretches, each resolved by a quadrature of sixteen nodes.

    Contact integrals are cut where the slip speed is one of them, and so follow any law, however steep it is. They lie
    where μ has a kink or a jump, and are close together where it is steep; μ that is the same everywhere has none.
    """
    own = getattr(law, "breakpoints", None)
    return jnp.asarray(ANY_LAW if own is None else own())


def kinks(law: FrictionLaw) -> Array:
    """Those of the breakpoints (m/s) at which a quadrature must be cut that is graded towards where the slip vanishes.

    None of a law that varies on no scale shorter than its slip speed, however steep; all of any other.
    """
    own = getattr(law, "kinks", None)
    return jnp.zeros(0) if own is None else jnp.asarray(own())


class ExponentialLaw(eqx.Module):
    """μ(s) = μ_k + (μ_s − μ_k) exp(−α s) (Seo & Kang 2023, equation (16)); α in s/m, s in m/s."""

    static: Array = eqx.field(converter=real)
    kinetic: Array = eqx.field(converter=real)
    decay: Array = eqx.field(converter=real)

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s)."""
        return self.kinetic + (self.static - self.kinetic) * jnp.exp(-self.decay * slip_speed)

    def breakpoints(self) -> Array:
        """12/|α| and 40/|α|: of what is left from there on, nothing counts."""
        return jnp.asarray(EXPONENTIAL_STRETCHES) / jnp.maximum(jnp.abs(self.decay), LEAST_DECAY)


class ConstantLaw(eqx.Module):
    """The same μ at every slip speed."""

    value: Array = eqx.field(converter=real)

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s)."""
        del slip_speed
        return self.value

    def breakpoints(self) -> ArrayLike:
        """None."""
        return np.zeros(0)


class StepLaw(eqx.Module):
    """The same μ_k at every slip speed, and up to μ_s ≥ μ_k at rest: Coulomb's law with its step at zero."""

    static: Array = eqx.field(converter=real)
    kinetic: Array = eqx.field(converter=real)

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s)."""
        del slip_speed
        return self.kinetic

    def at_rest(self) -> Array:
        """The largest μ where nothing slips."""
        return self.static

    def breakpoints(self) -> ArrayLike:
        """None: what slides knows one μ."""
        return np.zeros(0)
