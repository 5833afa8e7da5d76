"""The rigid shoe: a curved plate, an annular sector with its centre of gravity on the x axis.

Source of all formulas: Seo & Kang, Lubricants 2023, 11(12), 496, equations (1) to (10) and (23) to (28).
"""

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from drumsqueal.precision import real

X, Y, Z, TX, TY, TZ = range(6)
IN_PLANE, OUT_OF_PLANE = (X, Y, TZ), (Z, TX, TY)


class RigidShoe(eqx.Module):
    """Annular sector of outer radius R, thickness h, width b, arc angle β and density ρ (SI units, rad).

    The six coordinates q = (X, Y, Z, Tx, Ty, Tz) are the displacement and the small rotation at the centre of gravity,
    in m and rad. θ = 0 is the x axis; the lining covers |θ| ≤ β/2 and |z| ≤ b/2 on the outer radius.
    """

    outer_radius: Array = eqx.field(converter=real)
    thickness: Array = eqx.field(converter=real)
    width: Array = eqx.field(converter=real)
    arc_angle: Array = eqx.field(converter=real)
    density: Array = eqx.field(converter=real)

    def radial_moment(self, power: int) -> Array:
        """∫ r^power dr from R − h to R (m^(power + 1))."""
        inner = self.outer_radius - self.thickness
        return (self.outer_radius ** (power + 1) - inner ** (power + 1)) / (power + 1)

    @property
    def half_angle(self) -> Array:
        """β/2 (rad)."""
        return self.arc_angle / 2

    @property
    def area(self) -> Array:
        """Lining area R β b (m²)."""
        return self.outer_radius * self.arc_angle * self.width

    @property
    def centroid(self) -> Array:
        """Distance c of the centre of gravity from the drum's axis (m), equation (2).

        c = 4 (h² − 3hR + 3R²) / (3 β (2R − h)) · sin(β/2)
        """
        R, h = self.outer_radius, self.thickness
        return 4 * (h**2 - 3 * h * R + 3 * R**2) / (3 * self.arc_angle * (2 * R - h)) * jnp.sin(self.half_angle)

    @property
    def mass(self) -> Array:
        """Diagonal of the mass matrix, (m, m, m, I1, I2, I3), shape (6,), in kg and kg m²; equations (26) to (28).

        The products of inertia vanish by symmetry. With c_k, s_k the integrals of cos² and sin² over the arc:
        I1 = ρ (b s ∫r³ + β b³/12 ∫r), I2 = ρ (b (c ∫r³ − 4 c sin(β/2) ∫r² + c² β ∫r) + β b³/12 ∫r),
        I3 = ρ b (β ∫r³ − 4 c sin(β/2) ∫r² + c² β ∫r).
        """
        beta, b, c, rho = self.arc_angle, self.width, self.centroid, self.density
        first, second, third = (self.radial_moment(k) for k in (1, 2, 3))
        cosine_squared, sine_squared = self._squares()
        across = beta * b**3 / 12 * first
        offset = c**2 * beta * first - 4 * c * jnp.sin(self.half_angle) * second
        body = rho * beta * b * first
        return jnp.stack(
            [
                body,
                body,
                body,
                rho * (b * sine_squared * third + across),
                rho * (b * (cosine_squared * third + offset) + across),
                rho * b * (beta * third + offset),
            ]
        )

    def _squares(self) -> tuple[Array, Array]:
        """∫cos²θ dθ and ∫sin²θ dθ over the arc (rad)."""
        return (self.arc_angle + jnp.sin(self.arc_angle)) / 2, (self.arc_angle - jnp.sin(self.arc_angle)) / 2

    def radial_resultant(self) -> Array:
        """∫ φ^r dA, shape (6,): the generalised force of unit pressure is its negative (m², m³ for rotations)."""
        chord = 2 * jnp.sin(self.half_angle) * self.outer_radius * self.width
        return jnp.zeros(6).at[X].set(chord)

    def tangential_resultant(self) -> Array:
        """∫ φ^θ dA, shape (6,): the generalised force of unit traction along θ (m², m³ for rotations)."""
        chord = 2 * jnp.sin(self.half_angle) * self.outer_radius * self.width
        moment = self.outer_radius * self.area - self.centroid * chord
        return jnp.zeros(6).at[Y].set(chord).at[TZ].set(moment)

    def radial_stiffness(self) -> Array:
        """∫ φ^r φ^r dA, shape (6, 6): the full-contact stiffness per unit contact stiffness (SI units)."""
        cosine_squared, sine_squared = self._squares()
        R, b, c = self.outer_radius, self.width, self.centroid
        along, across = R * b, R * b**3 / 12
        matrix = jnp.zeros((6, 6))
        matrix = matrix.at[X, X].set(along * cosine_squared).at[Y, Y].set(along * sine_squared)
        matrix = matrix.at[Y, TZ].set(-c * along * sine_squared).at[TZ, Y].set(-c * along * sine_squared)
        matrix = matrix.at[TZ, TZ].set(c**2 * along * sine_squared)
        return matrix.at[TX, TX].set(across * sine_squared).at[TY, TY].set(across * cosine_squared)
