"""A uniform disc that lies flat on a plate and can slide and spin."""

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from drumsqueal.precision import real


class Disc(eqx.Module):
    """Radius R (m) and mass m (kg); its coordinates are X, Y (m) and the rotation Tz (rad) about its centre."""

    radius: Array = eqx.field(converter=real)
    weight: Array = eqx.field(converter=real)

    @property
    def area(self) -> Array:
        """π R² (m²)."""
        return jnp.pi * self.radius**2

    @property
    def mass(self) -> Array:
        """Diagonal of the mass matrix over X, Y and Tz, (m, m, ½ m R²), shape (3,)."""
        return self.weight * jnp.stack([jnp.ones(()), jnp.ones(()), self.radius**2 / 2])
