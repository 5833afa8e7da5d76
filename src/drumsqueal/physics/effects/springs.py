"""Linear springs between coordinates and the ground, given by their matrix."""

import equinox as eqx
from jax import Array

from drumsqueal.physics.effects.action import ZERO, Action, Scalar, Six
from drumsqueal.physics.effects.operation import Moment
from drumsqueal.precision import real


class Springs(eqx.Module):
    """U = ½ qᵀ K q with K symmetric (m, m) in N/m; `coordinates` are the indices that its rows belong to."""

    matrix: Array = eqx.field(converter=real)
    coordinates: tuple[int, ...] = eqx.field(static=True)

    def act(self, moment: Moment, q: Six, v: Six) -> Action:
        """Force −K q; all of it comes from the potential."""
        del moment, v
        force = list(ZERO)
        for row, i in enumerate(self.coordinates):
            force[i] = -sum(self.matrix[row, column] * q[j] for column, j in enumerate(self.coordinates))
        return Action(tuple(force), 0.0)

    def potential_energy(self, moment: Moment, q: Six) -> Scalar:
        """U (J)."""
        force = self.act(moment, q, ZERO).force
        return -sum(force[i] * q[i] for i in self.coordinates) / 2
