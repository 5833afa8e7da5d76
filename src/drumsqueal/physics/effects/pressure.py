"""The pressure between lining and drum: bonded, or with separation."""

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from drumsqueal.physics.quadrature.levels import Level
from drumsqueal.precision import real


def yielding(law: "PressureLaw", preload: Array) -> Array:
    """How far a contact yields under its load (m): p0/k_c, and 0 where it has no stiffness."""
    stiff = law.stiffness > 0
    return jnp.where(stiff, preload / jnp.where(stiff, law.stiffness, 1.0), 0.0)


class Bonded(eqx.Module):
    """N = p0 + k_c u_r, also where that is negative; k_c in N/m³."""

    stiffness: Array = eqx.field(converter=real)

    def boundaries(self, level: Level) -> None:
        """No contact boundaries: contact is never lost."""
        del level

    def pressure(self, level: Array) -> Array:
        """N (Pa) from the level p0 + k_c u_r (Pa)."""
        return level

    def touches(self, level: Array) -> Array:
        """Whether the lining is in contact, from the level p0 + k_c u_r (Pa): always."""
        return jnp.full_like(level, True, dtype=bool)

    def compression(self, preload: Array, radial: Array) -> Array:
        """Radial displacement that the lining follows (m)."""
        del preload
        return radial


class Unilateral(eqx.Module):
    """N = max(0, p0 + k_c u_r): the lining can leave the drum; k_c in N/m³."""

    stiffness: Array = eqx.field(converter=real)

    def boundaries(self, level: Level) -> Level:
        """The level whose roots are the contact boundaries."""
        return level

    def pressure(self, level: Array) -> Array:
        """N (Pa) from the level p0 + k_c u_r (Pa); where that is just zero, the slope is that of contact."""
        return jnp.where(level < 0, 0.0, level)

    def touches(self, level: Array) -> Array:
        """Whether the lining is in contact, from the level p0 + k_c u_r (Pa); at zero it just touches."""
        return level >= 0

    def compression(self, preload: Array, radial: Array) -> Array:
        """Radial displacement that the lining follows (m): u_r, or −p0/k_c where the lining has left the drum."""
        lifted = preload + self.stiffness * radial < 0
        return jnp.where(lifted, -preload / jnp.where(lifted, self.stiffness, 1.0), radial)


PressureLaw = Bonded | Unilateral
