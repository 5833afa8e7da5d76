"""Forces that are given: on coordinates, at points, and what the assembly applies to the shoe at rest.

The generalised force of a force at a point P along a unit vector d is d·φ_i(P) times its size: the shape functions of
the body at P.
"""

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from drumsqueal.physics.bodies.body import Motion, Scalar, add, dot, scalars, times
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe
from drumsqueal.physics.effects.effect import Action, Effect
from drumsqueal.physics.effects.friction import Friction
from drumsqueal.physics.effects.operation import OperatingPoint
from drumsqueal.precision import real


class Forcing(Effect):
    """On coordinates F_i = A_i sin(2π f t + ψ): amplitude A (m,) in N (N m for rotations), f in Hz, ψ in rad.

    `coordinates` are the places of the amplitudes among the kept coordinates.
    """

    amplitude: Array = eqx.field(converter=real)
    frequency: Array = eqx.field(converter=real)
    phase: Array = eqx.field(converter=real)
    coordinates: tuple[int, ...] = eqx.field(static=True)

    def act(self, moment: OperatingPoint, q: Motion, v: Motion) -> Action:
        """Force at a moment and its power F·v."""
        del q
        swing = jnp.sin(2 * jnp.pi * self.frequency * moment.time + self.phase)
        acting = {place: self.amplitude[k] * swing for k, place in enumerate(self.coordinates)}
        power = sum(force * v[place] for place, force in acting.items())
        return Action(scalars(jnp.stack([acting.get(k, jnp.zeros(())) for k in range(len(v))])), power)


class ConstantForce(Effect):
    """The same force (n,) in N (N m for rotations) at all times; steady sliding is displaced by it."""

    force: Array = eqx.field(converter=real)

    def act(self, moment: OperatingPoint, q: Motion, v: Motion) -> Action:
        """The force; all of it comes from the potential."""
        del moment, q, v
        return Action(scalars(self.force), 0.0)

    def potential_energy(self, moment: OperatingPoint, q: Motion) -> Scalar:
        """U = −F·q (J)."""
        return -dot(self.act(moment, q, q).force, q)


class PointForces(Effect):
    """Forces F_j at points, of sizes that the operation prescribes: Q_i = Σ_j F_j d_j·φ_i(P_j).

    `along` (k, n) is d_j·φ_i(P_j): how far each point moves along its force for 1 m or 1 rad of each coordinate.
    """

    along: Array = eqx.field(converter=real)

    def act(self, moment: OperatingPoint, q: Motion, v: Motion) -> Action:
        """The force; its power beyond the potential is −Σ Ḟ_j d_j·u(P_j), where sizes change."""
        del v
        rates = [rate for _, rate in moment.pushes]
        power = sum(
            -rate * dot(scalars(along), q) for rate, along in zip(rates, self.along, strict=True) if rate is not None
        )
        return Action(self._force(moment), power)

    def potential_energy(self, moment: OperatingPoint, q: Motion) -> Scalar:
        """U = −Σ F_j d_j·u(P_j) (J)."""
        return -dot(self._force(moment), q)

    def _force(self, moment: OperatingPoint) -> Motion:
        sizes = jnp.stack([jnp.asarray(size) for size, _ in moment.pushes])
        return scalars(jnp.sum(sizes[:, None] * self.along, axis=0))


class Preload(Effect):
    """The load alone, +∫ p0 φ^r dA: friction drags the shoe to a steady state of its own ("self-consistent").

    U = −p0 q·∫φ^r dA. Kept as a potential so that it cancels the linear part of the contact's: what is left is of
    second order in the displacement, and the energy balance stays sharp at small amplitudes.
    """

    body: RigidShoe

    def act(self, moment: OperatingPoint, q: Motion, v: Motion) -> Action:
        """Force p0(t) ∫φ^r dA, and the power −ṗ0 q·∫φ^r dA where the load changes."""
        del v
        resultant = self.body.radial_resultant()
        force = times(moment.preload, resultant)
        power = 0.0 if moment.preload_rate is None else -moment.preload_rate * dot(resultant, q)
        return Action(force, power)

    def potential_energy(self, moment: OperatingPoint, q: Motion) -> Scalar:
        """U (J)."""
        return -moment.preload * dot(self.body.radial_resultant(), q)


class Balance(Effect):
    """Every static force, −Q(0, 0) at the current drum speed and load: the pressure is p0 all along the arc.

    −Q(0, 0) = p0 ∫φ^r dA − μ0 p0 sgn(Ω) ∫φ^θ dA, the "uniform-pressure" reading of the paper: the preload, and a
    force against the steady drag whose power is counted.
    """

    preload: Preload
    friction: Friction | None

    def act(self, moment: OperatingPoint, q: Motion, v: Motion) -> Action:
        """Force −Q(0, 0) and the power of its part against the drag."""
        action = self.preload.act(moment, q, v)
        if self.friction is None:
            return action
        body = self.preload.body
        friction = self.friction.steady_coefficient(moment, body.outer_radius * moment.drum_speed)
        drag = times(-friction * moment.preload, body.tangential_resultant())
        return Action(add(action.force, drag), action.power + dot(drag, v))

    def potential_energy(self, moment: OperatingPoint, q: Motion) -> Scalar:
        """U of the preload (J)."""
        return self.preload.potential_energy(moment, q)
