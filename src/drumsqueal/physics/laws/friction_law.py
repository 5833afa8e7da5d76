"""Friction laws: the coefficient of friction as a function of the slip speed."""

from typing import Protocol, runtime_checkable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.interpreter import Interpreted
from drumsqueal.precision import real
from drumsqueal.scene.laws import LAWS
from drumsqueal.scene.tables import FrictionTable
from drumsqueal.shown import short


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

    None of a law that varies on no scale shorter than its slip speed, however steep.
    """
    own = getattr(law, "kinks", None)
    return jnp.zeros(0) if own is None else jnp.asarray(own())


@Interpreted
def coefficient_at(law: FrictionLaw, slip_speed: Array) -> Array:
    """μ at slip speeds s ≥ 0 (m/s), for what is outside of any program."""
    return jnp.asarray(law.coefficient(slip_speed))


class SceneLaw(eqx.Module):
    """A law of `scene/laws` with its numbers as array leaves, so that none of them compiles anything anew."""

    law: type[FrictionTable] = eqx.field(static=True)
    numbers: dict[str, Array]

    def __repr__(self) -> str:
        """Name and numbers: ExponentialLaw(static=1, kinetic=0.5, decay=2 s/m)."""
        keys, usual = self.law.number_keys(), self.law.usual
        numbers = ", ".join(f"{key}={short(self.numbers[key], usual[key].unit)}" for key in keys)
        return f"{self.law.__name__.removesuffix('Friction')}Law({numbers})"

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s)."""
        return self.law.mu(slip_speed, jnp, **self.numbers)

    def breakpoints(self) -> Array:
        """The law's own."""
        return self.law.cuts(jnp, **self.numbers)[0]

    def kinks(self) -> Array:
        """Those of them where it has a kink or is steep."""
        return self.law.cuts(jnp, **self.numbers)[1]


def friction_law(law: str, /, **numbers: ArrayLike) -> SceneLaw:
    """A law by its name in a scene, with its numbers by key in SI: `friction_law("constant", coefficient=0.4)`.

    The numbers may be traced. Raises KeyError for a law that is none and TypeError for numbers that are not its own.

    ```pycon
    >>> law = drumsqueal.friction_law("exponential", static=0.5, kinetic=0.3, decay=2.0)
    >>> round(float(law.coefficient(1.0)), 4)
    0.3271
    ```
    """
    kind = LAWS[law]
    keys = kind.number_keys()
    if not set(numbers) <= set(keys) or set(keys) - set(numbers) - set(kind.defaults()):
        raise TypeError(f'the law "{law}" has the numbers {", ".join(keys)}, got {", ".join(numbers) or "none"}')
    given = {key: real(value) for key, value in (kind.defaults() | numbers).items()}
    return SceneLaw(kind, kind.prepared(jnp, **given))


def ConstantLaw(value: ArrayLike) -> SceneLaw:
    """The same μ at every slip speed."""
    return friction_law("constant", coefficient=value)


def ExponentialLaw(static: ArrayLike, kinetic: ArrayLike, decay: ArrayLike) -> SceneLaw:
    """μ(s) = μ_k + (μ_s − μ_k) exp(−α s); α in s/m."""
    return friction_law("exponential", static=static, kinetic=kinetic, decay=decay)


class StepLaw(eqx.Module):
    """The same μ_k at every slip speed, and up to μ_s ≥ μ_k at rest: Coulomb's law with its step at zero."""

    static: Array = eqx.field(converter=real)
    kinetic: Array = eqx.field(converter=real)

    def __repr__(self) -> str:
        """Its numbers."""
        return f"StepLaw(static={short(self.static)}, kinetic={short(self.kinetic)})"

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
