"""What a transient asks of the contact between a body and what rubs on it, whatever the body."""

from typing import NamedTuple, Protocol

from jax import Array

from drumsqueal.physics.bodies.body import Body, Motion, Scalar
from drumsqueal.physics.effects.action import Action
from drumsqueal.physics.effects.friction import Friction
from drumsqueal.physics.effects.operation import Moment


class Observation(NamedTuple):
    """What a transient records of the contact; units in the attributes of the history."""

    brake_torque: Array
    normal_force: Array
    contact_fraction: Array
    slip_reversed_fraction: Array
    smallest_pressure: Array
    friction_power: Array
    sticking: Array


class Touching(Protocol):
    """An effect whose friction can hold the body to what rubs on it: the drum, or a belt."""

    @property
    def friction(self) -> Friction | None:
        """Its friction."""
        ...

    @property
    def body(self) -> Body:
        """What moves."""
        ...

    @property
    def slipping(self) -> tuple[bool, ...]:
        """Which coordinates have a slip velocity of their own; the others go on freely while it sticks."""
        ...

    @property
    def following(self) -> Motion:
        """Velocities of a body that moves with a drum of 1 rad/s, or with a belt of 1 m/s."""
        ...

    @property
    def follows(self) -> bool:
        """Whether the kept coordinates can move so."""
        ...

    @property
    def radius(self) -> Scalar:
        """What the drum's speed is multiplied by to be that of its surface (m); one for a belt."""
        ...

    @property
    def lifting_stiffness(self) -> Scalar:
        """Stiffness of a contact that can be lost; zero where it cannot."""
        ...

    @property
    def area(self) -> Scalar:
        """What the preload acts on (m²): its force over the preload."""
        ...

    def with_friction(self, friction: Friction | None) -> "Touching":
        """The same contact with other friction."""
        ...

    def fastest_slip(self, moment: Moment, v: Motion) -> Array:
        """A bound on the slip speed (m/s) anywhere in the contact, which is reached up to a small factor."""
        ...

    def yielding(self, moment: Moment) -> Scalar:
        """How far the contact yields under its load (m), which scales the round-off of its forces."""
        ...

    def in_plane(self) -> "Touching":
        """The same contact for motion that is the same on every line across, so that one line serves."""
        ...

    def pressure_range(self, moment: Moment, q: Motion) -> tuple[Array, Array]:
        """Smallest and largest pressure (Pa; of a point contact the force in N)."""
        ...

    def act(self, moment: Moment, q: Motion, v: Motion) -> Action:
        """Generalised force and power."""
        ...

    def potential_energy(self, moment: Moment, q: Motion) -> Scalar:
        """Energy stored (J)."""
        ...

    def observe(self, moment: Moment, q: Motion, v: Motion) -> Observation:
        """Integrals and extremes that describe the contact at one instant."""
        ...
