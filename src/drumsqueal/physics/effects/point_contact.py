"""A block that rubs on a moving belt at one point: the contact of most small models of friction-induced vibration.

X is along the belt and Y into it. The drum's speed of the operation is the belt's V along X (m/s), its preload the load
(N) at q = 0. Sources of the models: Leine et al., Nonlinear Dynamics 16 (1998) 41; Hoffmann et al., Journal of Sound
and Vibration 257 (2002) 1.
"""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from drumsqueal.physics.bodies.rigid_shoe import X, Y
from drumsqueal.physics.effects.action import ZERO, Action, Six
from drumsqueal.physics.effects.friction import Friction
from drumsqueal.physics.effects.operation import Moment
from drumsqueal.physics.effects.pressure import PressureLaw, yielding
from drumsqueal.physics.effects.touching import Observation


class PointContact(eqx.Module):
    """N = p0 + k q2 (its part above zero, where the law lets it separate) and F = −μ(|s|) N sgn(s), s = q̇1 − V.

    All is in N, N/m and m/s: the stiffness of the law is that of a spring.
    """

    law: PressureLaw
    friction: Friction | None

    @property
    def slipping(self) -> tuple[bool, ...]:
        """Which coordinates slip: X."""
        return tuple(i == X for i in range(6))

    @property
    def following(self) -> Six:
        """Velocities of a block that moves with a belt of 1 m/s: q̇1 = 1."""
        return tuple(float(i == X) for i in range(6))

    @property
    def area(self) -> float:
        """What a load of one gives (N): the load is a force."""
        return 1.0

    def with_friction(self, friction: Friction | None) -> "PointContact":
        """The same contact with other friction."""
        return dataclasses.replace(self, friction=friction)

    def fastest_slip(self, moment: Moment, v: Six) -> Array:
        """|s| (m/s)."""
        return jnp.abs(_slip(moment, v))

    def yielding(self, moment: Moment) -> Array:
        """How far the contact spring yields under the load (m): p0/k."""
        return yielding(self.law, moment.preload)

    def act(self, moment: Moment, q: Six, v: Six) -> Action:
        """Friction along X, p0 − N along Y: the load and what answers it; and their power beyond the stored energy."""
        load, drag = self._forces(moment, q, v)
        force = list(ZERO)
        force[X], force[Y] = drag, moment.preload - load
        power = drag * v[X]
        if moment.preload_rate is not None:
            power = power + moment.preload_rate * (self.law.compression(moment.preload, q[Y] + jnp.zeros(())) - q[Y])
        return Action(tuple(force), power)

    def potential_energy(self, moment: Moment, q: Six) -> Array:
        """U = p0 e + ½ k e² − p0 q2, with e the compression of the contact spring (J)."""
        compression = self.law.compression(moment.preload, q[Y] + jnp.zeros(()))
        return compression * (moment.preload + self.law.stiffness * compression / 2) - moment.preload * q[Y]

    def observe(self, moment: Moment, q: Six, v: Six) -> Observation:
        """Forces at one instant; in place of a brake torque the force that holds the belt back (N)."""
        load, drag = self._forces(moment, q, v)
        slip, touches = _slip(moment, v), self.law.touches(self._level(moment, q))
        reversed_slip = touches & (slip * jnp.sign(moment.drum_speed) > 0)
        share, back = (jnp.where(each, 1.0, 0.0) for each in (touches, reversed_slip))
        return Observation(drag, load, share, back, load, -drag * slip, jnp.zeros(()))

    def _level(self, moment: Moment, q: Six) -> Array:
        return moment.preload + self.law.stiffness * q[Y]

    def _forces(self, moment: Moment, q: Six, v: Six) -> tuple[Array, Array]:
        """N and F (N)."""
        load = self.law.pressure(self._level(moment, q))
        if self.friction is None:
            return load, jnp.zeros(())
        return load, self.friction.traction(load, _slip(moment, v), None)[0]


def _slip(moment: Moment, v: Six) -> Array:
    """s = q̇1 − V (m/s)."""
    return v[X] - moment.drum_speed
