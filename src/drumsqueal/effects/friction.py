"""Friction between lining and drum: how large it is (a law of the slip speed) and where it points (a direction)."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.effects.custom_friction import FrictionLaw
from drumsqueal.precision import real


class ExponentialLaw(eqx.Module):
    """μ(s) = μ_k + (μ_s − μ_k) exp(−α s) (Seo & Kang 2023, equation (16)); α in s/m, s in m/s."""

    static: Array = eqx.field(converter=real)
    kinetic: Array = eqx.field(converter=real)
    decay: Array = eqx.field(converter=real)

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s)."""
        return self.kinetic + (self.static - self.kinetic) * jnp.exp(-self.decay * slip_speed)


class ConstantLaw(eqx.Module):
    """The same μ at every slip speed."""

    value: Array = eqx.field(converter=real)

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s)."""
        del slip_speed
        return self.value


class Tangential(eqx.Module):
    """F = −μ(|V_θ|) N sgn(V_θ) e_θ: the reduced form that knows the sliding direction only."""

    knows_axial: ClassVar[bool] = False

    def traction(self, law: "Law", pressure: Array, slip: Array, axial: Array | None) -> tuple[Array, None]:
        """Traction along θ (Pa) at slip velocity V_θ (m/s); none along z."""
        del axial
        return -law.coefficient(jnp.abs(slip)) * pressure * jnp.sign(slip), None


class UnitVelocity(eqx.Module):
    """F = −μ(|V|) N V/|V| (equation (14)); no force where V = 0, and no regularisation elsewhere."""

    knows_axial: ClassVar[bool] = True

    def traction(self, law: "Law", pressure: Array, slip: Array, axial: Array | None) -> tuple[Array, Array | None]:
        """Tractions along θ and z (Pa) at slip velocity V_θ, V_z (m/s); V_z is None for motion in the plane."""
        if axial is None:
            return Tangential().traction(law, pressure, slip, None)
        squared = slip * slip + axial * axial
        sliding = squared > 0
        speed = jnp.sqrt(jnp.where(sliding, squared, 1.0))
        share = jnp.where(sliding, -law.coefficient(speed) * pressure / speed, 0.0)
        return share * slip, share * axial


Law = ExponentialLaw | ConstantLaw | FrictionLaw
Direction = UnitVelocity | Tangential


class Friction(eqx.Module):
    """A friction law along a direction."""

    law: Law
    direction: Direction

    def traction(self, pressure: Array, slip: Array, axial: Array | None) -> tuple[Array, Array | None]:
        """Tractions on the lining along θ and z (Pa); the latter None where it is not called for."""
        return self.direction.traction(self.law, pressure, slip, axial)

    @property
    def steepness(self) -> Array | float | None:
        """Largest α (s/m) of the e^(−α s) that the law is made of; None where that is not known."""
        if isinstance(self.law, ExponentialLaw):
            return self.law.decay
        return 0.0 if isinstance(self.law, ConstantLaw) else None

    def steady_coefficient(self, speed: ArrayLike) -> Array:
        """Signed μ at steady sliding with drum surface speed RΩ (m/s): positive drags the shoe along +θ."""
        return self.law.coefficient(jnp.abs(speed)) * jnp.sign(speed)
