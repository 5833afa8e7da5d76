"""Linear springs between coordinates and the ground, given by their matrix."""

import equinox as eqx
from jax import Array

from drumsqueal.physics.bodies.body import Motion, Scalar, dot, opposite, product
from drumsqueal.physics.effects.effect import Action, Effect
from drumsqueal.physics.effects.operation import Moment
from drumsqueal.precision import real


class Springs(Effect):
    """U = ½ qᵀ K q with K symmetric (n, n) in N/m over the kept coordinates."""

    matrix: Array = eqx.field(converter=real)

    def act(self, moment: Moment, q: Motion, v: Motion) -> Action:
        """Force −K q; all of it comes from the potential."""
        del moment, v
        return Action(opposite(product(self.matrix, q)), 0.0)

    def potential_energy(self, moment: Moment, q: Motion) -> Scalar:
        """U (J)."""
        return -dot(self.act(moment, q, q).force, q) / 2
