"""The direction of friction: against the slip velocity, or its part along the arc only."""

from typing import Protocol

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from drumsqueal.physics.laws.friction_law import FrictionLaw


class Direction(Protocol):
    """What friction asks of a direction; `knows_axial` says whether it asks for the slip across the arc."""

    @property
    def knows_axial(self) -> bool:
        """Whether V_z counts."""
        ...

    def traction(
        self, law: FrictionLaw, pressure: Array, slip: Array, axial: Array | None
    ) -> tuple[Array, Array | None]:
        """Tractions along θ and z (Pa) at slip velocity V_θ, V_z (m/s; None where it is not known)."""
        ...


class Tangential(eqx.Module):
    """F = −μ(|V_θ|) N sgn(V_θ) e_θ: the reduced form that knows the sliding direction only."""

    @property
    def knows_axial(self) -> bool:
        """Whether V_z counts."""
        return False

    def traction(self, law: FrictionLaw, pressure: Array, slip: Array, axial: Array | None) -> tuple[Array, None]:
        """Traction along θ (Pa) at slip velocity V_θ (m/s); none along z."""
        del axial
        return -law.coefficient(jnp.abs(slip)) * pressure * jnp.sign(slip), None


class UnitVelocity(eqx.Module):
    """F = −μ(|V|) N V/|V| (equation (14)); no force where V = 0, and no regularisation elsewhere."""

    @property
    def knows_axial(self) -> bool:
        """Whether V_z counts."""
        return True

    def traction(
        self, law: FrictionLaw, pressure: Array, slip: Array, axial: Array | None
    ) -> tuple[Array, Array | None]:
        """Tractions along θ and z (Pa) at slip velocity V_θ, V_z (m/s); V_z is None for motion in the plane."""
        if axial is None:
            return Tangential().traction(law, pressure, slip, None)
        squared = slip * slip + axial * axial
        sliding = squared > 0
        speed = jnp.sqrt(jnp.where(sliding, squared, 1.0))
        fraction = jnp.where(sliding, -law.coefficient(speed) * pressure / speed, 0.0)
        return fraction * slip, fraction * axial
