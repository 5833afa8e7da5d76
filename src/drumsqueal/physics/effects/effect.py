"""What a model asks of the effects on a body, and of the contact among them, whatever the body."""

import dataclasses
from abc import abstractmethod
from collections.abc import Callable, Iterable
from typing import Any, ClassVar, NamedTuple, Self

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from drumsqueal.physics.bodies.body import Body, Motion, Scalar
from drumsqueal.physics.effects.friction import Friction
from drumsqueal.physics.effects.operation import OperatingPoint
from drumsqueal.physics.effects.pressure import PressureLaw, Unilateral
from drumsqueal.shown import short


class Action(NamedTuple):
    """Generalised force (N, N m), the power it feeds in beyond its potential energy, and what becomes heat (W)."""

    force: Motion
    power: Scalar
    heat: Scalar = 0.0


class Effect(eqx.Module):
    """What acts on a body. Motion and force have an entry for each kept coordinate of the body."""

    def __repr__(self) -> str:
        """Its name, and its numbers in SI, rows of a matrix divided by semicolons."""
        fields = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        numbers = (f"{name}={short(value)}" for name, value in fields.items() if eqx.is_array_like(value))
        return f"{type(self).__name__}({', '.join(numbers)})"

    @abstractmethod
    def act(self, moment: OperatingPoint, q: Motion, v: Motion) -> Action:
        """Generalised force and power at a moment, displacement q (m, rad) and velocity v (m/s, rad/s)."""

    def potential_energy(self, moment: OperatingPoint, q: Motion) -> Scalar:
        """Energy stored (J); zero for an effect that stores none."""
        del moment, q
        return 0.0


def at_rest(motion: Motion) -> Motion:
    """Literal zeros, as many as a motion has."""
    return (0.0,) * len(motion) if isinstance(motion, tuple) else jnp.zeros_like(motion)


class Observation(NamedTuple):
    """What a transient records of the contact; units in the attributes of the history.

    Of a shoe that bends, not as accurate as forces. The slip-reversed fraction is off by up to 0.003 in space, where
    the quadrature cuts where the slip is slowest, not where V_θ reverses. The smallest pressure is that at the nodes
    and on the sides of cells, up to 0.3 % of p0 above that on the lining. `by_shoe` has the first three of each shoe
    in turn where there are several, and nothing where there is one.
    """

    brake_torque: Array
    normal_force: Array
    contact_fraction: Array
    slip_reversed_fraction: Array
    smallest_pressure: Array
    friction_power: Array
    sticking: Array
    by_shoe: tuple[Array, ...] = ()

    @staticmethod
    def width(shoes: int) -> int:
        """How many numbers it has where there are so many shoes."""
        return _FOR_ALL + (shoes * len(BY_SHOE) if shoes > 1 else 0)

    @staticmethod
    def of_rows(rows: Iterable[Array]) -> "Observation":
        """What was recorded row by row, in the order of its leaves."""
        found = tuple(rows)
        return Observation(*found[:_FOR_ALL], by_shoe=found[_FOR_ALL:])

    def of_each(self, name: str) -> tuple[Array, ...]:
        """One of `BY_SHOE` on each shoe, of which there may be one."""
        return self.by_shoe[BY_SHOE.index(name) :: len(BY_SHOE)] or (getattr(self, name),)


BY_SHOE = Observation._fields[:3]  # what is known of each of several shoes
_FOR_ALL = len(Observation._fields) - 1


class AbstractContact(Effect):
    """An effect whose friction can hold the body to what rubs on it: a drum, a belt or a plate."""

    body: eqx.AbstractVar[Body]
    law: eqx.AbstractVar[PressureLaw]
    friction: eqx.AbstractVar[Friction | None]
    units: ClassVar[tuple[str, str, str]] = "rad/s", "Pa", "N/m³"  # of drum speed, preload and contact stiffness
    __repr__ = eqx.Module.__repr__  # all of it

    @property
    def shoes(self) -> int:
        """How many shoes there are."""
        return len(self.laws)

    @property
    def laws(self) -> tuple[PressureLaw, ...]:
        """That of every shoe."""
        return (self.law,)

    @property
    def radius(self) -> Scalar:
        """What the drum's speed is multiplied by to be that of its surface (m); one for a belt or a plate."""
        return 1.0

    @property
    def lifting_stiffness(self) -> Scalar:
        """Stiffness of the level of a contact that can be lost (N/m³; of a point N/m); zero where it cannot."""
        return self.law.stiffness if isinstance(self.law, Unilateral) else 0.0

    def with_friction(self, friction: Friction | None) -> Self:
        """The same contact with other friction."""
        return dataclasses.replace(self, friction=friction)

    def mapped(self, change: Callable[[Any], Any]) -> Any:
        """The same with the contact of each shoe changed."""
        return change(self)

    @property
    def slides(self) -> tuple[bool, ...]:
        """Which coordinates have a slip velocity that friction knows of."""
        return self.body.slides(axially=self.friction is not None and self.friction.direction.knows_axial)

    @property
    def cell_axes(self) -> int:
        """Along how many axes a lining is cut into cells: 1 for lines, 2, where evaluations are dearest; 0 for none."""
        return 0

    def in_plane(self) -> "AbstractContact":
        """The same contact for motion that is the same on every line across, so that one line serves."""
        return self

    @abstractmethod
    def fastest_slip(self, moment: OperatingPoint, v: Motion) -> Array:
        """A bound on the slip speed (m/s) anywhere in the contact, which is reached up to a small factor."""

    def kinks(self, moment: OperatingPoint, q: Motion, v: Motion) -> Array:
        """Numbers (k,) of which one changes its sign where the force has a kink in time; none unless known."""
        del moment, q, v
        return jnp.zeros(0)

    @abstractmethod
    def pressure_range(self, moment: OperatingPoint, q: Motion) -> tuple[Array, Array]:
        """Smallest and largest pressure (Pa; of a point contact the force in N)."""

    @abstractmethod
    def observe(self, moment: OperatingPoint, q: Motion, v: Motion) -> Observation:
        """Integrals and extremes that describe the contact at one instant."""
