"""Body and effects as one vector field: the steady state, the eigenvalues, the transient and the gradients share it."""

import dataclasses
from collections.abc import Callable, Mapping

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.physics.bodies.rigid_shoe import IN_PLANE, RigidShoe
from drumsqueal.physics.composition import GIVEN, Composition, compose
from drumsqueal.physics.effects.action import Effect, Six
from drumsqueal.physics.effects.assembly import Balance, Preload
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.effects.damping import Damping
from drumsqueal.physics.effects.forcing import Forcing
from drumsqueal.physics.effects.friction import Friction
from drumsqueal.physics.effects.friction_direction import Tangential, UnitVelocity
from drumsqueal.physics.effects.operation import Operation
from drumsqueal.physics.effects.pressure import Bonded, Unilateral
from drumsqueal.physics.effects.schedule import Constant, Profile, Schedule
from drumsqueal.physics.effects.support import Support
from drumsqueal.physics.effects.touching import Observation, Touching
from drumsqueal.physics.laws.custom_friction import as_law, with_breakpoints
from drumsqueal.physics.laws.friction_law import FrictionLaw, friction_law
from drumsqueal.physics.quadrature.arc import NODES, NODES_LONG_ARC, ArcSurface
from drumsqueal.physics.quadrature.area import AreaSurface
from drumsqueal.precision import real
from drumsqueal.scene import COORDINATES, Scene

Numbers = Mapping[str, ArrayLike]


class Model(eqx.Module):
    """M q̈ = Σ effects, over the kept coordinates only.

    `coordinates` are indices into (X, Y, Z, Tx, Ty, Tz); n of them are kept. `mass` is the diagonal of M (n,) and
    `stiffness` the frictionless stiffness in full contact (n, n).
    """

    operation: Operation
    contact: Touching
    others: tuple[Effect, ...]
    mass: Array = eqx.field(converter=real)
    stiffness: Array = eqx.field(converter=real)
    coordinates: tuple[int, ...] = eqx.field(static=True)

    @property
    def lining(self) -> Contact:
        """The contact of a shoe, as what asks for its shape wants it."""
        assert isinstance(self.contact, Contact)
        return self.contact

    @property
    def shoe(self) -> RigidShoe:
        """The body."""
        return self.lining.shoe

    @property
    def effects(self) -> tuple[Effect, ...]:
        """All that acts on the body."""
        return (self.contact, *self.others)

    @property
    def forced(self) -> bool:
        """Whether a harmonic force acts."""
        return any(isinstance(effect, Forcing) for effect in self.others)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the kept coordinates."""
        return tuple(COORDINATES[i] for i in self.coordinates)

    def widen(self, kept: Array) -> Six:
        """Six scalars from the kept coordinates (n,): literal zeros elsewhere, which cost nothing when compiled."""
        return tuple(kept[self.coordinates.index(i)] if i in self.coordinates else 0.0 for i in range(6))

    @property
    def middle_contact(self) -> Contact:
        """The contact as motion in the plane has it: the same on every line across, so that one line serves."""
        return dataclasses.replace(self.lining, surface=ArcSurface(NODES_LONG_ARC, compact=True))

    def undisturbed(self) -> "Model":
        """The same model without its harmonic force: what steady sliding is the equilibrium of."""
        others = tuple(effect for effect in self.others if not isinstance(effect, Forcing))
        return dataclasses.replace(self, others=others)

    def frozen(self, time: float) -> "Model":
        """The same model with the drum speed and the load that it has at a time (s), at all times."""
        moment = self.operation.at(time)
        operation = Operation(Constant(moment.drum_speed), Constant(moment.preload))
        return dataclasses.replace(self, operation=operation)

    def in_plane(self) -> "Model":
        """The same model with its out-of-plane coordinates held at zero: a line integral instead of an area."""
        kept = [k for k, i in enumerate(self.coordinates) if i in IN_PLANE]
        stiffness = self.stiffness[np.ix_(kept, kept)]
        return dataclasses.replace(
            self,
            contact=self.middle_contact if isinstance(self.contact, Contact) else self.contact,
            mass=self.mass[np.asarray(kept)],
            stiffness=stiffness,
            coordinates=tuple(self.coordinates[k] for k in kept),
        )

    def act(self, time: ArrayLike, q: Array, v: Array) -> tuple[Array, Array]:
        """Generalised force (n,) and power beyond the stored energy (W), at displacement q (n,) and velocity v (n,)."""
        wide_q, wide_v = self.widen(q), self.widen(v)
        moment = self.operation.at(time)
        actions = [effect.act(moment, wide_q, wide_v) for effect in self.effects]
        force = [sum(action.force[i] for action in actions) + jnp.zeros(()) for i in self.coordinates]
        return jnp.stack(force), jnp.asarray(sum(action.power for action in actions) + jnp.zeros(()))

    def energy(self, time: ArrayLike, q: Array, v: Array) -> tuple[Array, Array]:
        """Kinetic energy ½ vᵀ M v and potential energy Σ U (J)."""
        moment, wide = self.operation.at(time), self.widen(q)
        potential = sum(effect.potential_energy(moment, wide) for effect in self.effects)
        return jnp.sum(self.mass * v * v) / 2, jnp.asarray(potential + jnp.zeros(()))

    def observe(self, time: ArrayLike, q: Array, v: Array) -> Observation:
        """Torque, forces and extent of the contact at one instant."""
        return self.contact.observe(self.operation.at(time), self.widen(q), self.widen(v))


def build_model(
    scene: Scene,
    numbers: Numbers | None = None,
    coordinates: tuple[int, ...] | None = None,
    friction_law: FrictionLaw | Callable[[Array], Array] | None = None,
) -> Model:
    """Build the model that a scene calls for, over its kept coordinates unless others are asked for.

    `numbers` replaces the scene's physical values (keys as in `scene.numbers()`, SI units) and may hold traced values:
    that is how a growth rate is differentiated with respect to a parameter of the scene. The number of quadrature nodes
    is that of the scene's own arc angle: from 130° to 360° by `numbers` alone, forces are off by up to 2e-5.
    `friction_law`, a function of the slip speed or a law with the method `coefficient`, takes the place of the scene's.
    Raises KeyError for a key that the scene does not have, TypeError for a law that JAX cannot trace, and ValueError
    for a law where the scene has no friction.
    """
    own = scene.numbers()
    unknown = sorted(set(numbers or {}) - set(own))
    if unknown:
        raise KeyError(f"{unknown[0]} is no number of this scene; it has {', '.join(sorted(own))}")
    value = {key: real(number) for key, number in {**own, **(numbers or {})}.items()}
    composition = compose(scene)
    if coordinates is not None:
        composition = composition._replace(coordinates=coordinates)
    if friction_law is None:
        return assemble(composition, value)
    if scene.friction is None:
        raise ValueError("this scene has no friction for the friction law; add the table friction, for its direction")
    return assemble(composition._replace(friction_law=GIVEN), value, with_breakpoints(as_law(friction_law)))


@eqx.filter_jit  # one small program instead of a hundred separate operations
def assemble(composition: Composition, value: Mapping[str, Array], law: FrictionLaw | None = None) -> Model:
    """Build the model of a composition from its numbers in SI (float64 arrays), traced or not; `build_model` checks."""
    shoe = RigidShoe(
        outer_radius=value["shoe.outer_radius"],
        thickness=value["shoe.thickness"],
        width=value["shoe.width"],
        arc_angle=value["shoe.arc_angle"],
        density=value["shoe.density"],
    )
    # The load is spread evenly, p0 = load / (R β b): our reading of the paper's "uniformly distributed".
    preload = _schedule("contact.normal_load", value, 1 / shoe.area)
    operation = Operation(_schedule("drum.speed", value, jnp.ones(())), preload)
    contact = _contact(composition, value, shoe, law)
    others: list[Effect] = [_assembly(composition, contact)]
    stiffness = contact.law.stiffness * shoe.radial_stiffness()
    if composition.support:
        support = Support(value["support.upper_stiffness"], value["support.lower_stiffness"], shoe.outer_radius)
        others.append(support)
        stiffness = stiffness + support.stiffness()
    kept = np.asarray(composition.coordinates)
    mass, stiffness = shoe.mass[kept], stiffness[np.ix_(kept, kept)]
    if composition.damping:
        others.append(Damping.from_ratio(value["damping.ratio"], mass, stiffness, composition.coordinates))
    if composition.forced:
        amplitude = [value[f"forcing.amplitude.{COORDINATES[i]}"] for i in composition.forced]
        others.append(
            Forcing(jnp.stack(amplitude), value["forcing.frequency"], value["forcing.phase"], composition.forced)
        )
    return Model(operation, contact, tuple(others), mass, stiffness, composition.coordinates)


def _contact(
    composition: Composition, value: Mapping[str, Array], shoe: RigidShoe, friction_law: FrictionLaw | None
) -> Contact:
    law = Unilateral if composition.separation else Bonded
    in_plane = set(composition.coordinates) <= set(IN_PLANE)
    surface = ArcSurface(NODES_LONG_ARC if composition.long_arc else NODES) if in_plane else AreaSurface()
    friction = _friction(composition, value, friction_law)
    return Contact(shoe, law(value["contact.stiffness"]), friction, surface)


def _friction(composition: Composition, value: Mapping[str, Array], law: FrictionLaw | None) -> Friction | None:
    if composition.friction_law is None:
        return None
    direction = UnitVelocity() if composition.friction_direction == "unit-velocity" else Tangential()
    if law is None:
        numbers = {key.removeprefix("friction."): each for key, each in value.items() if key.startswith("friction.")}
        law = friction_law(composition.friction_law, **numbers)
    return Friction(law, direction)


def _assembly(composition: Composition, contact: Contact) -> Effect:
    preload = Preload(contact.shoe)
    if composition.steady_state == "self-consistent":
        return preload
    return Balance(preload, contact.friction)


def _schedule(key: str, value: Mapping[str, Array], scale: Array) -> Schedule:
    if key in value:
        return Constant(value[key] * scale)
    return Profile(value[f"{key}.time"], value[f"{key}.value"] * scale)
