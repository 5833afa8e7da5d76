"""A block that rubs on a moving belt at one point, as in most small models of friction-induced vibration.

X is along the belt and Y into it. The drum's speed of the operation is the belt's V along X (m/s), its preload the load
(N) at q = 0. Sources of the models: Leine et al., Nonlinear Dynamics 16 (1998) 41; Hoffmann et al., Journal of Sound
and Vibration 257 (2002) 1.
"""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from drumsqueal.physics.bodies.body import Motion, Scalar
from drumsqueal.physics.effects.effect import Action, Observation, Touching
from drumsqueal.physics.effects.friction import Friction
from drumsqueal.physics.effects.operation import Moment
from drumsqueal.physics.effects.pressure import PressureLaw, Unilateral
from drumsqueal.precision import real


class Block(eqx.Module):
    """Masses (n,) in kg along X and, if it can move there, along Y; both stay in the plane."""

    mass: Array = eqx.field(converter=real)
    area: ClassVar[float] = 1.0  # the load is a force
    follows: ClassVar[bool] = True

    @property
    def names(self) -> tuple[str, ...]:
        """X, or X and Y."""
        return ("X", "Y")[: self.mass.shape[-1]]

    @property
    def symmetric(self) -> tuple[bool, ...]:
        """Both."""
        return (True,) * len(self.names)

    @property
    def following(self) -> Motion:
        """Velocities of a block that moves with a belt of 1 m/s."""
        return (1.0, 0.0)[: len(self.names)]

    def slides(self, *, axially: bool) -> tuple[bool, ...]:
        """Which coordinates slip: X."""
        del axially
        return (True, False)[: len(self.names)]

    def largest(self, q: Mapping[str, NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """|Y| and |X|."""
        along = np.abs(q["X"])
        return np.abs(q.get("Y", np.zeros_like(along))), along

    def surface(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Y and X of its one point."""
        both = np.eye(2)[:, None, : len(self.names)]
        return both[1], both[0]


class PointContact(Touching):
    """N by the law (p0 + k y of the linear one) and F = −μ(|s|) N sgn(s), s = ẋ − V.

    All is in N, N/m and m/s: the stiffness of the law is that of a spring.
    """

    body: Block
    law: PressureLaw
    friction: Friction | None

    @property
    def units(self) -> tuple[str, str, str]:
        """Those of a belt and of a force at a point."""
        return "m/s", "N", "N/m"

    def fastest_slip(self, moment: Moment, v: Motion) -> Array:
        """|s| (m/s)."""
        return jnp.abs(_slip(moment, v))

    def kinks(self, moment: Moment, q: Motion, v: Motion) -> Array:
        """The level (N), which vanishes where the block lifts off and lands."""
        del v
        return self._level(moment, q).reshape(1) if isinstance(self.law, Unilateral) else jnp.zeros(0)

    def pressure_range(self, moment: Moment, q: Motion) -> tuple[Array, Array]:
        """The force N (N), twice."""
        load = self.law.pressure(self._level(moment, q))
        return load, load

    def act(self, moment: Moment, q: Motion, v: Motion) -> Action:
        """Friction along X, p0 − N along Y: the load and what answers it; and their power beyond the stored energy."""
        load, drag = self._forces(moment, q, v)
        power = drag * v[0]
        if moment.preload_rate is not None:
            by_preload = self.law.stored_by_preload(moment.preload, _depth(q) + jnp.zeros(()))
            power = power + moment.preload_rate * (by_preload - _depth(q))
        return Action((drag, moment.preload - load)[: len(q)], power, -drag * _slip(moment, v))

    def potential_energy(self, moment: Moment, q: Motion) -> Array:
        """U of the contact spring from q = 0 on, less p0 y (J)."""
        return self.law.stored(moment.preload, _depth(q) + jnp.zeros(())) - moment.preload * _depth(q)

    def observe(self, moment: Moment, q: Motion, v: Motion) -> Observation:
        """Forces at one instant; in place of a brake torque the force that holds the belt back (N)."""
        load, drag = self._forces(moment, q, v)
        slip, touches = _slip(moment, v), self.law.touches(self._level(moment, q))
        reversed_slip = touches & (slip * jnp.sign(moment.drum_speed) > 0)
        fraction, back = (jnp.where(each, 1.0, 0.0) for each in (touches, reversed_slip))
        return Observation(drag, load, fraction, back, load, -drag * slip, jnp.zeros(()))

    def _level(self, moment: Moment, q: Motion) -> Array:
        return self.law.level(moment.preload) + self.law.stiffness * _depth(q)

    def _forces(self, moment: Moment, q: Motion, v: Motion) -> tuple[Array, Array]:
        """N and F (N)."""
        load = self.law.pressure(self._level(moment, q))
        if self.friction is None:
            return load, jnp.zeros(())
        return load, self.friction.traction(moment, load, _slip(moment, v), None)[0]


def _slip(moment: Moment, v: Motion) -> Array:
    """s = ẋ − V (m/s)."""
    return v[0] - moment.drum_speed


def _depth(q: Motion) -> Scalar:
    """y (m), how far the block has moved into the belt."""
    return q[1] if len(q) > 1 else 0.0
