"""A harmonic or a constant force on coordinates: response tests and reference problems."""

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from drumsqueal.physics.bodies.body import Motion, Scalar, dot, scalars
from drumsqueal.physics.effects.effect import Action, Effect
from drumsqueal.physics.effects.operation import Moment
from drumsqueal.precision import real


class Forcing(Effect):
    """F_i = A_i sin(2π f t + ψ): amplitude A (m,) in N (N m for rotations), f in Hz, ψ in rad.

    `coordinates` are the places of the amplitudes among the kept coordinates.
    """

    amplitude: Array = eqx.field(converter=real)
    frequency: Array = eqx.field(converter=real)
    phase: Array = eqx.field(converter=real)
    coordinates: tuple[int, ...] = eqx.field(static=True)

    def act(self, moment: Moment, q: Motion, v: Motion) -> Action:
        """Force at a moment and its power F·v."""
        del q
        swing = jnp.sin(2 * jnp.pi * self.frequency * moment.time + self.phase)
        acting = {place: self.amplitude[k] * swing for k, place in enumerate(self.coordinates)}
        power = sum(force * v[place] for place, force in acting.items())
        return Action(scalars(jnp.stack([acting.get(k, jnp.zeros(())) for k in range(len(v))])), power)


class ConstantForce(Effect):
    """The same force (n,) in N (N m for rotations) at all times; steady sliding is displaced by it."""

    force: Array = eqx.field(converter=real)

    def act(self, moment: Moment, q: Motion, v: Motion) -> Action:
        """The force; all of it comes from the potential."""
        del moment, q, v
        return Action(scalars(self.force), 0.0)

    def potential_energy(self, moment: Moment, q: Motion) -> Scalar:
        """U = −F·q (J)."""
        return -dot(self.act(moment, q, q).force, q)
