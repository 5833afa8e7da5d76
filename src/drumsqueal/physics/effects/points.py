"""What acts on a body at points: pushes, such as a wheel cylinder's, and springs and dampers to the ground.

The generalised force of a force at a point P along a unit vector d is d·φ_i(P) times its size: the shape functions of
the body at P.
"""

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from drumsqueal.physics.bodies.body import Motion, Scalar, dot, scalars
from drumsqueal.physics.effects.effect import Action, Effect
from drumsqueal.physics.effects.operation import Moment
from drumsqueal.precision import real


class Pushes(Effect):
    """Forces F_j at points, of sizes that the operation prescribes: Q_i = Σ_j F_j d_j·φ_i(P_j).

    `along` (k, n) is d_j·φ_i(P_j): how far each point moves along its force for 1 m or 1 rad of each coordinate.
    """

    along: Array = eqx.field(converter=real)

    def act(self, moment: Moment, q: Motion, v: Motion) -> Action:
        """The force; its power beyond the potential is −Σ Ḟ_j d_j·u(P_j), where sizes change."""
        del v
        rates = [rate for _, rate in moment.pushes]
        power = sum(
            -rate * dot(scalars(along), q) for rate, along in zip(rates, self.along, strict=True) if rate is not None
        )
        return Action(self._force(moment), power)

    def potential_energy(self, moment: Moment, q: Motion) -> Scalar:
        """U = −Σ F_j d_j·u(P_j) (J)."""
        return -dot(self._force(moment), q)

    def _force(self, moment: Moment) -> Motion:
        sizes = jnp.stack([jnp.asarray(size) for size, _ in moment.pushes])
        return scalars(jnp.sum(sizes[:, None] * self.along, axis=0))


def against(along: Array, strengths: Array) -> Array:
    """Σ_j k_j g_j g_jᵀ (n, n), of springs or dampers of strengths (k,); g_j are the rows of `along` (k, n)."""
    return jnp.sum(strengths[:, None, None] * along[:, :, None] * along[:, None, :], axis=0)
