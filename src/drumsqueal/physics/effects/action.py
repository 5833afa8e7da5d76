"""What an effect returns: a generalised force and a power."""

from typing import NamedTuple, Protocol

from jax import Array

from drumsqueal.physics.effects.operation import Moment

Scalar = Array | float
Six = tuple[Scalar, ...]  # one for each of X, Y, Z, Tx, Ty, Tz
ZERO: Six = (0.0,) * 6


class Action(NamedTuple):
    """Generalised force on the six coordinates (N, N m) and the power it feeds in beyond its potential energy (W)."""

    force: Six
    power: Scalar


class Effect(Protocol):
    """What a model asks of an effect."""

    def act(self, moment: Moment, q: Six, v: Six) -> Action:
        """Generalised force and power at a moment, displacement q (m, rad) and velocity v (m/s, rad/s)."""
        ...

    def potential_energy(self, moment: Moment, q: Six) -> Scalar:
        """Energy stored (J); zero for an effect that stores none."""
        ...
