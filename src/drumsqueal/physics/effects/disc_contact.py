"""A disc that slides and spins on a plate, evenly loaded: friction against the slip velocity over an area, exactly.

The drum's speed of the operation is that of the plate along X (m/s), its preload the pressure (Pa). With a constant
coefficient force and torque are elliptic integrals (Farkas et al., Physical Review Letters 90 (2003) 248302).
"""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from drumsqueal.physics.bodies.body import Motion, dot
from drumsqueal.physics.bodies.disc import Disc
from drumsqueal.physics.effects.action import Action
from drumsqueal.physics.effects.friction import Friction
from drumsqueal.physics.effects.operation import Moment
from drumsqueal.physics.effects.touching import Observation
from drumsqueal.physics.laws.friction_law import breakpoints
from drumsqueal.physics.quadrature.disc import disc_nodes

LEAST = 1e-280  # m²/s²: slower than its root is standing still
# Of the square of one of the two speeds, added to that of the other: 1e-12 of the forces at most, and where the other
# is zero they keep their derivatives.
BESIDE = 1e-12


class DiscContact(eqx.Module):
    """F = −∫ μ(|V|) p V/|V| dA with V = u + ω e_z × r."""

    body: Disc
    friction: Friction | None

    @property
    def slipping(self) -> tuple[bool, ...]:
        """Which coordinates slip: all."""
        return True, True, True

    @property
    def following(self) -> Motion:
        """Velocities of a disc that moves with a plate of 1 m/s along X."""
        return 1.0, 0.0, 0.0

    @property
    def follows(self) -> bool:
        """Whether it can: always."""
        return True

    @property
    def radius(self) -> float:
        """One: the speed is the plate's own."""
        return 1.0

    @property
    def lifting_stiffness(self) -> float:
        """Zero: the disc cannot leave the plate."""
        return 0.0

    @property
    def area(self) -> Array:
        """π R² (m²)."""
        return self.body.area

    def with_friction(self, friction: Friction | None) -> "DiscContact":
        """The same contact with other friction."""
        return dataclasses.replace(self, friction=friction)

    def fastest_slip(self, moment: Moment, v: Motion) -> Array:
        """|u| + R |ω| (m/s), reached on the rim."""
        ux, uy, rim = self._motion(moment, v)
        squared = ux * ux + uy * uy
        sliding = jnp.where(squared > 0, jnp.sqrt(jnp.where(squared > 0, squared, 1.0)), 0.0)
        return sliding + jnp.abs(rim)

    def yielding(self, moment: Moment) -> float:
        """How far the contact yields under its load (m): not at all."""
        del moment
        return 0.0

    def in_plane(self) -> "DiscContact":
        """The same contact: it is in the plane."""
        return self

    def pressure_range(self, moment: Moment, q: Motion) -> tuple[Array, Array]:
        """The pressure (Pa), twice: it is even."""
        del q
        return moment.preload, moment.preload

    def act(self, moment: Moment, q: Motion, v: Motion) -> Action:
        """Force and torque of friction and their power."""
        del q
        force = self._friction(moment, v)
        return Action(force, dot(force, v), -dot(force, self._slip(moment, v)))

    def potential_energy(self, moment: Moment, q: Motion) -> float:
        """None is stored."""
        del moment, q
        return 0.0

    def observe(self, moment: Moment, q: Motion, v: Motion) -> Observation:
        """Forces at one instant; in place of a brake torque the force that holds the plate back (N)."""
        del q
        force = self._friction(moment, v)
        heat, along = -jnp.asarray(dot(force, self._slip(moment, v))), force[0]
        load, none = moment.preload * self.body.area, jnp.zeros(())
        return Observation(along, load, none + 1, none, moment.preload, heat, none)

    def _slip(self, moment: Moment, v: Motion) -> Motion:
        """The motion relative to the plate's."""
        return v[0] - moment.drum_speed, v[1], v[2]

    def _motion(self, moment: Moment, v: Motion) -> tuple[Array, Array, Array]:
        """Slip velocity of the centre along X and Y, and that of the rim from the spin, Rω (m/s)."""
        zero = jnp.zeros(())
        return v[0] - moment.drum_speed + zero, v[1] + zero, self.body.radius * v[2] + zero

    def _friction(self, moment: Moment, v: Motion) -> tuple[Array, Array, Array]:
        """Force along X and Y (N) and torque (N m) on the disc."""
        if self.friction is None:
            return jnp.zeros(()), jnp.zeros(()), jnp.zeros(())
        ux, uy, rim = self._motion(moment, v)
        slid, spun = ux * ux + uy * uy, rim * rim
        moves = slid + spun > LEAST
        slid, spun = (jnp.where(moves, each, 1.0) for each in (slid + BESIDE * spun, spun + BESIDE * slid))
        sliding, spinning = jnp.sqrt(slid), jnp.sqrt(spun)
        nodes = disc_nodes(self.body.radius, sliding, spinning, breakpoints(self.friction.law))
        pressure = jnp.broadcast_to(moment.preload, nodes.speed.shape)
        traction, other = self.friction.traction(moment, pressure, nodes.speed * nodes.cosine, nodes.speed * nodes.sine)
        assert other is not None
        # The other half of the disc takes away what is at right angles to the sliding. Tractions are at right angles
        # to their line, so that the place on it is the lever's arm.
        drag = jnp.sum(traction * nodes.weight) / sliding
        turn = jnp.sum((traction * nodes.cosine + other * nodes.sine) * nodes.place * nodes.weight) / spinning
        drag, turn = jnp.where(moves, drag, 0.0), jnp.where(moves, turn, 0.0)
        return drag * ux, drag * uy, turn * rim
