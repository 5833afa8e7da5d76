"""Structural damping: the same ratio for every mode of the frictionless shoe."""

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.physics.bodies.body import Motion, dot, opposite, product
from drumsqueal.physics.effects.effect import Action, Effect
from drumsqueal.physics.effects.operation import OperatingPoint
from drumsqueal.precision import real

# Of modes that are mostly shapes in which a body yields nearly statically. Above the frequency up to which its motion
# is resolved, they are no modes of the brake, and must neither ring nor grow. Others have none of it: growth rates of
# the paper's shoe of steel change by less than 0.1 1/s.
UNRESOLVED, MOSTLY = 0.02, 0.5  # the ratio of those with more than this fraction of their kinetic energy in such shapes


def frictionless_modes(mass: Array, stiffness: Array) -> tuple[Array, Array]:
    """Mass-normalised modes of M q̈ + K q = 0: ω (n,) in rad/s, ascending, and Φ (n, n) with Φᵀ M Φ = 1.

    `mass` is the diagonal (n,), `stiffness` symmetric (n, n). A mode without stiffness has ω = 0,
    one with negative stiffness, ω² < 0, which moves away in a time of 1/√|ω²|, has −√|ω²|.
    """
    root = jnp.sqrt(mass)
    squared, vectors = jnp.linalg.eigh(stiffness / root[:, None] / root[None, :])
    size = jnp.abs(squared)
    # A mode below this fraction of the highest squared frequency has no stiffness (free Z motion) and stays undamped.
    stiff = size > 1e-12 * jnp.max(size)
    omega = jnp.where(stiff, jnp.sqrt(jnp.where(stiff, size, 1.0)), 0.0)
    return jnp.sign(squared) * omega, vectors / root[:, None]


def damping_matrix(ratio: ArrayLike, mass: Array, stiffness: Array, statics: tuple[bool, ...] = ()) -> Array:
    """C = M Φ diag(2 ζ ω) Φᵀ M (n, n) for the ratio ζ, from the kept part of mass (n,) and frictionless stiffness.

    Of ratios (n,), one for each coordinate, a mode has the mean by its kinetic energy in each, ζ_j = Σ_i ζ_i m_i φ_ij².
    A mode that does not oscillate has none, and one with most of it in `statics` (n,) the ratio `UNRESOLVED` at least.
    """
    omega, modes = frictionless_modes(mass, stiffness)
    omega = jnp.maximum(omega, 0.0)
    shaped = mass[:, None] * modes
    if jnp.ndim(ratio):
        ratio = jnp.asarray(ratio) @ (shaped * modes)
    if any(statics):
        mostly = jnp.asarray(statics, dtype=float) @ (shaped * modes) > MOSTLY
        ratio = jnp.where(mostly, jnp.maximum(ratio, UNRESOLVED), ratio)
    return (shaped * (2 * ratio * omega)) @ shaped.T


class Damping(Effect):
    """F = −C v with C symmetric (n, n) in N s/m over the kept coordinates."""

    matrix: Array = eqx.field(converter=real)

    def act(self, moment: OperatingPoint, q: Motion, v: Motion) -> Action:
        """Force −C v and its power −vᵀ C v."""
        del moment, q
        force = opposite(product(self.matrix, v))
        return Action(force, dot(force, v))
