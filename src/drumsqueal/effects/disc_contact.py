"""A disc that slides and spins on a plate, evenly loaded: friction against the slip velocity over an area, exactly.

The drum's speed of the operation is that of the plate along X (m/s), its preload the pressure (Pa). With a constant
coefficient force and torque are elliptic integrals (Farkas et al., Physical Review Letters 90 (2003) 248302).
"""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from drumsqueal.bodies.disc import Disc
from drumsqueal.bodies.rigid_shoe import TZ, X, Y
from drumsqueal.effects.action import ZERO, Action, Six
from drumsqueal.effects.friction import Friction
from drumsqueal.effects.operation import Moment
from drumsqueal.effects.touching import Observation
from drumsqueal.quadrature.disc import disc_nodes

LEAST = 1e-150  # m/s, whose square is still a number: slower than that is standing still


class DiscContact(eqx.Module):
    """F = −∫ μ(|V|) p V/|V| dA with V = u + ω e_z × r; `points` are Gauss's on a line, see `disc_nodes`."""

    disc: Disc
    friction: Friction | None
    points: int = eqx.field(static=True, default=8)

    @property
    def slipping(self) -> tuple[bool, ...]:
        """Which coordinates slip: X, Y and Tz."""
        return tuple(i in (X, Y, TZ) for i in range(6))

    @property
    def following(self) -> Six:
        """Velocities of a disc that moves with a plate of 1 m/s: q̇1 = 1."""
        return tuple(float(i == X) for i in range(6))

    @property
    def area(self) -> Array:
        """π R² (m²)."""
        return self.disc.area

    def with_friction(self, friction: Friction | None) -> "DiscContact":
        """The same contact with other friction."""
        return dataclasses.replace(self, friction=friction)

    def fastest_slip(self, moment: Moment, v: Six) -> Array:
        """|u| + R |ω| (m/s), reached on the rim."""
        return self._motion(moment, v)[2] + self.disc.radius * jnp.abs(v[TZ])

    def yielding(self, moment: Moment) -> float:
        """How far the contact yields under its load (m): not at all."""
        del moment
        return 0.0

    def act(self, moment: Moment, q: Six, v: Six) -> Action:
        """Force and torque of friction and their power."""
        del q
        along, across, torque = self._friction(moment, v)
        force = list(ZERO)
        force[X], force[Y], force[TZ] = along, across, torque
        return Action(tuple(force), along * v[X] + across * v[Y] + torque * v[TZ])

    def potential_energy(self, moment: Moment, q: Six) -> float:
        """None is stored."""
        del moment, q
        return 0.0

    def observe(self, moment: Moment, q: Six, v: Six) -> Observation:
        """Forces at one instant; in place of a brake torque the force that holds the plate back (N)."""
        along, across, torque = self._friction(moment, v)
        ux, uy, _ = self._motion(moment, v)
        heat = -(along * ux + across * uy + torque * v[TZ])
        load, none = moment.preload * self.disc.area, jnp.zeros(())
        return Observation(along, load, none + 1, none, moment.preload, heat)

    def _motion(self, moment: Moment, v: Six) -> tuple[Array, Array, Array]:
        """Slip velocity of the centre along X and Y, and its size (m/s)."""
        ux, uy = v[X] - moment.drum_speed, v[Y] + jnp.zeros(())
        squared = ux * ux + uy * uy
        return ux, uy, jnp.where(squared > 0, jnp.sqrt(jnp.where(squared > 0, squared, 1.0)), 0.0)

    def _friction(self, moment: Moment, v: Six) -> tuple[Array, Array, Array]:
        """Force along X and Y (N) and torque (N m) on the disc."""
        if self.friction is None:
            return jnp.zeros(()), jnp.zeros(()), jnp.zeros(())
        ux, uy, sliding = self._motion(moment, v)
        spinning = self.disc.radius * jnp.abs(v[TZ])
        moves = jnp.maximum(sliding, spinning) > LEAST
        nodes = disc_nodes(self.disc.radius, sliding, jnp.where(moves, spinning, 1.0), self.points)
        traction, other = self.friction.traction(
            jnp.broadcast_to(moment.preload, nodes.speed.shape), nodes.speed * nodes.cosine, nodes.speed * nodes.sine
        )
        assert other is not None
        drag = jnp.where(moves, jnp.sum(traction * nodes.weight), 0.0)
        # Tractions are at right angles to their line, so that the place on it is the lever's arm.
        normal = traction * nodes.cosine + other * nodes.sine
        torque = jnp.where(moves, jnp.sum(normal * nodes.place * nodes.weight), 0.0)
        share = drag / jnp.where(sliding > LEAST, sliding, 1.0)
        return share * ux, share * uy, torque * jnp.sign(v[TZ])
