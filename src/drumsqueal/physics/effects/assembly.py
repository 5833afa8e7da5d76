"""What the assembly applies to the shoe at rest: the two readings of the state q = 0."""

from drumsqueal.physics.bodies.body import LinedBody, Motion, Scalar, dot, plus, times
from drumsqueal.physics.effects.effect import Action, Effect
from drumsqueal.physics.effects.friction import Friction
from drumsqueal.physics.effects.operation import Moment


class Preload(Effect):
    """The load alone, +∫ p0 φ^r dA: friction drags the shoe to a steady state of its own ("self-consistent").

    U = −p0 q·∫φ^r dA. Kept as a potential so that it cancels the linear part of the contact's: what is left is of
    second order in the displacement, and the energy balance stays sharp at small amplitudes.
    """

    body: LinedBody

    def act(self, moment: Moment, q: Motion, v: Motion) -> Action:
        """Force p0(t) ∫φ^r dA, and the power −ṗ0 q·∫φ^r dA where the load changes."""
        del v
        resultant = self.body.radial_resultant()
        force = times(moment.preload, resultant)
        power = 0.0 if moment.preload_rate is None else -moment.preload_rate * dot(resultant, q)
        return Action(force, power)

    def potential_energy(self, moment: Moment, q: Motion) -> Scalar:
        """U (J)."""
        return -moment.preload * dot(self.body.radial_resultant(), q)


class Balance(Effect):
    """Every static force, −Q(0, 0) at the current drum speed and load: the pressure is p0 all along the arc.

    −Q(0, 0) = p0 ∫φ^r dA − μ0 p0 sgn(Ω) ∫φ^θ dA, the "uniform-pressure" reading of the paper: the preload, and a
    force against the steady drag whose power is counted.
    """

    preload: Preload
    friction: Friction | None

    def act(self, moment: Moment, q: Motion, v: Motion) -> Action:
        """Force −Q(0, 0) and the power of its part against the drag."""
        action = self.preload.act(moment, q, v)
        if self.friction is None:
            return action
        body = self.preload.body
        friction = self.friction.steady_coefficient(moment, body.outer_radius * moment.drum_speed)
        drag = times(-friction * moment.preload, body.tangential_resultant())
        return Action(plus(action.force, drag), action.power + dot(drag, v))

    def potential_energy(self, moment: Moment, q: Motion) -> Scalar:
        """U of the preload (J)."""
        return self.preload.potential_energy(moment, q)
