"""What an effect returns: a generalised force and a power."""

from typing import NamedTuple, Protocol

from drumsqueal.physics.bodies.body import Motion, Scalar
from drumsqueal.physics.effects.operation import Moment


class Action(NamedTuple):
    """Generalised force (N, N m), the power it feeds in beyond its potential energy, and what becomes heat (W)."""

    force: Motion
    power: Scalar
    heat: Scalar = 0.0


class Effect(Protocol):
    """What a model asks of an effect. Motion and force have an entry for each kept coordinate of the body."""

    def act(self, moment: Moment, q: Motion, v: Motion) -> Action:
        """Generalised force and power at a moment, displacement q (m, rad) and velocity v (m/s, rad/s)."""
        ...

    def potential_energy(self, moment: Moment, q: Motion) -> Scalar:
        """Energy stored (J); zero for an effect that stores none."""
        ...


def at_rest(motion: Motion) -> Motion:
    """Literal zeros, as many as a motion has."""
    return (0.0,) * len(motion)
