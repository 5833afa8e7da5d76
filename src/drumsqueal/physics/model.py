"""Body and effects as one vector field: the steady state, the eigenvalues, the transient and the gradients share it."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import ArrayLike

from drumsqueal.coordinates import at_surface, is_elastic, is_of_drum, is_static, mass_unit, unit_of
from drumsqueal.errors import RequestError
from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.bodies.body import Body, Scalar, add, scalars, whole
from drumsqueal.physics.bodies.brake import Brake, Share, share, whole_share
from drumsqueal.physics.bodies.elastic_shoe import ElasticShoe
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe
from drumsqueal.physics.composition import compose, coordinates_of
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.effects.damping import Damping, damping_matrix
from drumsqueal.physics.effects.effect import AbstractContact, Effect, Observation
from drumsqueal.physics.effects.forcing import Balance, Forcing, PointForces, Preload
from drumsqueal.physics.effects.friction import Friction, Tangential, Temperature, UnitVelocity
from drumsqueal.physics.effects.operation import Constant, OperatingPoint, Operation, PiecewiseLinear, Schedule
from drumsqueal.physics.effects.pressure import Bonded, LinearLining, Unilateral, normal_law
from drumsqueal.physics.effects.several import Contacts, OnOne
from drumsqueal.physics.effects.springs import Springs, SupportSprings
from drumsqueal.physics.elasticity import check_shapes_stay, numbers_of
from drumsqueal.physics.friction_law import FrictionLaw, as_law, friction_law, with_breakpoints
from drumsqueal.physics.shoe_building import (
    GIVEN,
    MODAL,
    Composition,
    along_points,
    build_shoe,
    spring_matrix,
    surface_of,
)
from drumsqueal.precision import real, with_numbers_of_numpy
from drumsqueal.scene import Scene
from drumsqueal.shown import short

Numbers = Mapping[str, ArrayLike]


class Model(eqx.Module):
    """M q̈ = Σ effects, over the n kept coordinates of the body.

    `mass` is the diagonal of M (n,) and `stiffness` the frictionless stiffness in full contact (n, n), where each
    lining has one of the `tangents` dp/du (N/m³). What effects remember (m,) is part of the state where `remembering`
    is not empty, and None elsewhere. `planar` says that nothing pushes or holds the body out of the plane in which it
    is dragged.
    """

    operation: Operation
    contact: AbstractContact
    others: tuple[Effect, ...]
    mass: Array = eqx.field(converter=real)
    stiffness: Array = eqx.field(converter=real)
    remembering: tuple[Temperature, ...] = ()
    tangents: tuple[Array, ...] = ()
    planar: bool = eqx.field(static=True, default=True)

    def __repr__(self) -> str:
        """Body, masses, drive, contact and effects, with their numbers in SI."""
        contact, (drum, load, stiffness) = self.contact, self.contact.units
        units = [mass_unit(name) for name in self.names]
        masses = ", ".join(f"{name} {short(m, u)}" for name, m, u in zip(self.names, self.mass, units, strict=True))
        operation = f"{self.operation.drum_speed} {drum}, load {self.operation.preload} {load}"
        normals = (each.normal for each in contact.laws)
        shown = (short(each.stiffness, stiffness) if type(each) is LinearLining else each for each in normals)
        touching = ", ".join(f"{type(a).__name__} contact of {b}" for a, b in zip(contact.laws, shown, strict=True))
        friction = contact.friction and contact.friction.law
        others = "".join(f"; {effect}" for effect in (*self.others, *self.remembering))
        return f"Model({type(self.body).__name__}: {masses}; speed {operation}; {touching}; {friction}{others})"

    @property
    def body(self) -> Body:
        """What moves."""
        return self.contact.body

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the kept coordinates."""
        return self.contact.names if isinstance(self.contact, Contacts) else self.body.names  # without making a Brake

    @property
    def lining(self) -> Contact:
        """The contact, for what asks for the shape of a lining.

        Raises TypeError for a body without one, and RequestError where there are several.
        """
        if isinstance(self.contact, Contacts):
            raise RequestError("this is asked of one lining, and the brake has several; take one of its shoes alone")
        if not isinstance(self.contact, Contact):
            raise TypeError(f"a {type(self.body).__name__} has no lining; this is for models of a shoe on a drum")
        return self.contact

    @property
    def sides(self) -> tuple[tuple[Share, "Model"], ...]:
        """The model as each shoe has it: its contact and its preload over its own coordinates, without other effects.

        The model itself where there is one shoe.
        """
        if not isinstance(self.contact, Contacts):
            return ((whole_share(len(self.names)), self),)
        preloads, found = self.operation.preloads, []
        for mine, contact in zip(self.contact.shares, self.contact.each, strict=True):
            operation = Operation(self.operation.drum_speed, preloads[mine.number])
            own, places = np.asarray(self.mass)[np.array(mine.places)], np.array(mine.places)
            stiffness = np.asarray(self.stiffness)[np.ix_(places, places)]
            tangents = self.tangents[mine.number : mine.number + 1]
            found.append((mine, Model(operation, contact, (), own, stiffness, tangents=tangents, planar=False)))
        return tuple(found)

    @property
    def shoe(self) -> RigidShoe:
        """The body, for what asks for its dimensions. Raises TypeError for a body without a lining."""
        return self.lining.body

    @property
    def effects(self) -> tuple[Effect, ...]:
        """All that acts on the body."""
        return (self.contact, *self.others)

    @property
    def moved_by_steady_sliding(self) -> tuple[bool, ...]:
        """Which coordinates steady sliding displaces; the others rest by symmetry."""
        return self.body.symmetric if self.planar else (True,) * len(self.names)

    @property
    def forced(self) -> bool:
        """Whether a harmonic force acts."""
        return any(isinstance(effect, Forcing) for effect in self.others)

    @property
    def pushed(self) -> bool:
        """Whether forces at points press the lining on the drum, so that the pressure is not known beforehand."""
        return any(isinstance(effect, PointForces) for effect in self.others)

    @property
    def balanced(self) -> bool:
        """Whether the assembly balances every static force, so that steady sliding is q = 0."""
        return any(isinstance(getattr(effect, "effect", effect), Balance) for effect in self.others)

    def frozen(self, time: float) -> "Model":
        """The same model with the drum speed and the load that it has at a time (s), at all times."""
        operation = self.operation.mapped(lambda each: Constant(each.at(time)[0]))
        return dataclasses.replace(self, operation=operation)

    def since(self, time: float) -> "Model":
        """The same model with its clock set to zero at a time (s): the programs of the one are those of the other."""
        return dataclasses.replace(self, operation=self.operation.mapped(lambda each: each.since(time)))

    def in_plane(self) -> "Model":
        """The same model for motion that is the same on every line across: a line integral instead of an area."""
        return dataclasses.replace(self, contact=self.contact.in_plane())

    @property
    def remembered(self) -> tuple[str, ...]:
        """Names of what effects remember."""
        return tuple(name for effect in self.remembering for name in effect.names)

    @property
    def first_memory(self) -> Array | None:
        """What effects remember at the start: zeros (m,), None where none does."""
        return real(np.zeros(len(self.remembered))) if self.remembering else None

    def _memories(self, memory: Array) -> Iterator[tuple[Temperature, Array]]:
        first = 0
        for effect in self.remembering:
            yield effect, memory[first : first + len(effect.names)]
            first += len(effect.names)

    def memory_size(self, memory: Array | None) -> Array | None:
        """What errors of what effects remember (m,) are measured against."""
        if memory is None:
            return None
        return jnp.concatenate([effect.size(part) for effect, part in self._memories(memory)])

    def memory_rate(self, memory: Array | None, heat: Scalar) -> Array | None:
        """Its rate (m,) while friction turns so much power into heat (W)."""
        if memory is None:
            return None
        return jnp.concatenate([effect.rate(part, heat) for effect, part in self._memories(memory)])

    def moment(self, time: ArrayLike, memory: Array | None = None) -> OperatingPoint:
        """What all effects see of an instant; without a memory, as it is at the start."""
        moment = self.operation.at(time)
        for effect, part in () if memory is None else self._memories(memory):
            moment = effect.influence(moment, part)
        return moment

    def act(self, time: ArrayLike, q: Array, v: Array) -> tuple[Array, Array]:
        """Generalised force (n,) and power (W) as `rates` has them, by what effects remember at the start."""
        return self.rates(time, q, v)[:2]

    def rates(
        self, time: ArrayLike, q: Array, v: Array, memory: Array | None = None
    ) -> tuple[Array, Array, Array | None]:
        """Generalised force (n,), power beyond the stored energy (W) and rate of the memory (m,).

        At displacement q (n,), velocity v (n,) and memory (m,).
        """
        moment, motion = self.moment(time, memory), (scalars(q), scalars(v))
        actions = [effect.act(moment, *motion) for effect in self.effects]
        force = whole(add(*(action.force for action in actions)))
        power = jnp.asarray(sum(action.power for action in actions) + jnp.zeros(()))
        return force, power, self.memory_rate(memory, sum(action.heat for action in actions))

    def kinks(self, time: ArrayLike, q: Array, v: Array, memory: Array | None = None) -> Array:
        """Numbers (k,) of which one changes its sign where the force has a kink in time."""
        return self.contact.kinks(self.moment(time, memory), scalars(q), scalars(v))

    def energy(self, time: ArrayLike, q: Array, v: Array) -> tuple[Array, Array]:
        """Kinetic energy ½ vᵀ M v and potential energy Σ U (J)."""
        moment, motion = self.operation.at(time), scalars(q)
        potential = sum(effect.potential_energy(moment, motion) for effect in self.effects)
        return jnp.sum(self.mass * v * v) / 2, jnp.asarray(potential + jnp.zeros(()))

    def observe(self, time: ArrayLike, q: Array, v: Array, memory: Array | None = None) -> Observation:
        """Torque, forces and extent of the contact at one instant."""
        return self.contact.observe(self.moment(time, memory), scalars(q), scalars(v))


def build_model(
    scene: Scene,
    numbers: Numbers | None = None,
    coordinates: tuple[str, ...] | None = None,
    friction_law: FrictionLaw | Callable[[Array], Array] | None = None,
) -> Model:
    """Build the model that a scene calls for, over its kept coordinates unless others are asked for.

    `numbers` replaces the scene's physical values (keys as in `scene.numbers()`, SI units) and may hold traced values:
    that is how a growth rate is differentiated with respect to a parameter of the scene. The number of quadrature nodes
    is that of the scene's own arc angle: from 130° to 360° by `numbers` alone, forces are off by up to 2e-5.
    `friction_law`, a function of the slip speed or a law with the method `coefficient`, takes the place of the scene's.
    Raises KeyError for a key that the scene does not have, RequestError for another geometry or Poisson's ratio of a
    shoe or a drum that bends, whose modes they change, TypeError for a law that JAX cannot trace, and ValueError for a
    law where the scene has no friction.

    ```pycon
    >>> scene = drumsqueal.load_scene("nominal")
    >>> drumsqueal.build_model(scene, {"drum.speed": 3.0}).names
    ('X', 'Y', 'Tz')
    ```
    """
    own = numbers_of(scene)
    unknown = sorted(set(numbers or {}) - set(own))
    if unknown:
        raise KeyError(f"{unknown[0]} is no number of this scene; it has {', '.join(sorted(own))}")
    given = {} if any(key.endswith(MODAL) for key in numbers or ()) else numbers or {}
    for key, number in given.items():
        if isinstance(number, Tracer) or not np.array_equal(number, own[key]):
            check_shapes_stay(scene, key)
    value = {key: real(number) for key, number in {**own, **(numbers or {})}.items()}
    composition = compose(scene, coordinates)
    if friction_law is None:
        return with_numbers_of_numpy(assemble(composition, value))
    if not scene.rubs:
        raise ValueError("this scene has no friction for the friction law; add the table friction, for its direction")
    law = with_breakpoints(as_law(friction_law))
    return with_numbers_of_numpy(assemble(composition._replace(friction_law=GIVEN), value, law))


def body_of(scene: Scene, coordinates: tuple[str, ...] | None = None) -> Any:
    """The shoe of a scene over its kept coordinates, unless others are asked for, without the rest of the model.

    Of a scene of several shoes, all of them with their drum. No program is compiled.
    """
    value = {key: real(number) for key, number in numbers_of(scene).items()}
    composition = compose(scene, coordinates)
    if not composition.shoes:
        return with_numbers_of_numpy(build_shoe(composition, value))
    shoes: list[Any] = [build_shoe(one.of(composition.coordinates), one.values(value)) for one in composition.shoes]
    names, shares = share([one.prefix for one in composition.shoes], [shoe.names for shoe in shoes])
    return with_numbers_of_numpy(Brake(names, shares, tuple(shoes)))


def at_lining(of: Any, name: str, largest: float = 0.0) -> tuple[float, str, str]:
    """How displacements of a coordinate are shown: factor from SI, unit, name. Of a free mode as it moves the lining.

    In millionths, unless the `largest` (SI) is visible. `of` is a scene, a model or the characteristic lengths of its
    body, which are not found again then, or None where the lining is not known.
    """
    lever, unit, shown = 1.0, unit_of(name), name
    if is_elastic(name) and of is not None:
        body = body_of(of, coordinates_of(of)) if isinstance(of, Scene) else getattr(of, "body", None)
        characteristic_lengths: Any = of if body is None else body.characteristic_lengths()
        lever, unit, shown = characteristic_lengths.get(name, 1.0), "m", at_surface(name)
    # 1e-2 m, rad; displacements from which on they are not shown in millionths
    return (1e6 * lever, f"µ{unit}", shown) if lever * largest < 1e-2 else (lever, unit, shown)


class _Part(NamedTuple):
    """What is of one shoe, over its own coordinates and the drum's: matrices (n, n), and pushes (k, n)."""

    contact: Contact
    tangent: Array
    effects: list[Effect]
    stiffness: Array
    springs: list[Array]
    dampers: list[Array]
    pushes: Array
    preload: Schedule
    sizes: list[Schedule]


@Interpreted
def assemble(composition: Composition, value: Mapping[str, Array], law: FrictionLaw | None = None) -> Model:
    """Build the model of a composition from its numbers in SI (float64 arrays), traced or not; `build_model` checks."""
    speed = _schedule("drum.speed", value, jnp.ones(()))
    if composition.shoes:
        return _model_of_several(composition, value, law, speed)
    part = _part(composition, value, law)
    damping, mass = list(part.dampers), part.contact.body.mass
    others, stiffness = list(part.effects), part.stiffness + sum(part.springs)
    statics = tuple(map(is_static, part.contact.body.names))
    if composition.damping or any(statics):
        damping.append(damping_matrix(value.get("damping.ratio", 0.0), mass, stiffness, statics))
    others += _of_matrices(composition, value, part.contact.body.names, part.springs, damping, part.pushes)
    remembering: list[Temperature] = []
    if composition.temperature:
        remembering.append(Temperature(*(value[f"temperature.{key}"] for key in ("heat_capacity", "cooling", "fade"))))
    operation = Operation(speed, part.preload, tuple(part.sizes))
    effects, memories = tuple(others), tuple(remembering)
    alone, planar = (part.tangent,), composition.planar
    return Model(operation, part.contact, effects, mass, stiffness, memories, tangents=alone, planar=planar)


def _model_of_several(
    composition: Composition, value: Mapping[str, Array], law: FrictionLaw | None, speed: Schedule
) -> Model:
    """The parts of each shoe, put together at the coordinates of the drum, whose own stiffness the first has."""
    own = [one.of(composition.coordinates) for one in composition.shoes]
    values = [one.values(value) for one in composition.shoes]
    parts = [_part(each, numbers, law, first=not k) for k, (each, numbers) in enumerate(zip(own, values, strict=True))]
    names, shares = share([one.prefix for one in composition.shoes], [part.contact.body.names for part in parts])
    contact = Contacts.of([part.contact for part in parts], shares, names)
    mass, together = contact.body.mass, list(zip(shares, parts, strict=True))
    springs = [mine.spread(each) for mine, part in together for each in part.springs]
    dampers = [mine.spread(each) for mine, part in together for each in part.dampers]
    stiffness = sum((mine.spread(part.stiffness) for mine, part in together), start=sum(springs, start=jnp.zeros(())))
    statics = tuple(map(is_static, names))
    if any(statics) or any(each.damping for each in own):
        ratio = jnp.full(len(names), value.get("damping.ratio", 0.0))
        for mine, numbers in zip(shares, values, strict=True):
            places = [place for place in mine.places if not is_of_drum(names[place])]
            ratio = ratio.at[np.array(places, dtype=int)].set(numbers.get("damping.ratio", 0.0))
        dampers.append(damping_matrix(ratio, mass, stiffness, statics))
    others: list[Effect] = [OnOne(effect, mine) for mine, part in together for effect in part.effects]
    pushes = jnp.concatenate([mine.spread(part.pushes, 1) for mine, part in together])
    others += _of_matrices(composition, value, names, springs, dampers, pushes)
    sizes = tuple(size for part in parts for size in part.sizes)
    pushed_shoes = tuple(k for k, part in enumerate(parts) for _ in part.sizes)
    operation = Operation(speed, parts[0].preload, sizes, tuple(part.preload for part in parts[1:]), pushed_shoes)
    tangents = tuple(part.tangent for part in parts)
    return Model(operation, contact, tuple(others), mass, stiffness, tangents=tangents, planar=False)


def _part(
    composition: Composition, value: Mapping[str, Array], law: FrictionLaw | None, *, first: bool = True
) -> _Part:
    """What is of one shoe; of a further one without the drum's own stiffness."""
    shoe = build_shoe(composition, value)
    # The load is spread evenly, p0 = load / (R β b): our reading of the paper's "uniformly distributed".
    preload = _schedule("contact.normal_load", value, 1 / shoe.area)
    pressing = (Unilateral if composition.separation else Bonded)(normal_law(value))
    contact = Contact(shoe, pressing, _friction(composition, value, law), surface_of(composition, shoe))
    preload_alone = Preload(contact.body)
    self_consistent = composition.steady_state == "self-consistent"
    effects: list[Effect] = [preload_alone if self_consistent else Balance(preload_alone, contact.friction)]
    sizes = [_schedule(f"shoe.force.{k}.size", value, jnp.ones(())) for k in range(composition.pushes)]
    # Before steady sliding is known, the largest load and pushes count, spread evenly: structural damping goes by that,
    # and what steps are measured by.
    tangent = contact.law.normal.tangent(preload.largest + sum(each.largest for each in sizes) / shoe.area)
    stiffness = tangent * shoe.radial_stiffness()
    if composition.support:
        support = SupportSprings(value["support.upper_stiffness"], value["support.lower_stiffness"], shoe)
        effects.append(support)
        stiffness = stiffness + support.stiffness()
    along_springs, along_pushes = along_points(composition, value, shoe)
    springs = [shoe.elastic_stiffness(of_drum=first)] if isinstance(shoe, ElasticShoe) else []
    dampers: list[Array] = []
    if composition.springs:
        springs.append(spring_matrix(composition, value, along_springs, "stiffness"))
        dampers.append(spring_matrix(composition, value, along_springs, "damping"))
    return _Part(contact, tangent, effects, stiffness, springs, dampers, along_pushes, preload, sizes)


def _of_matrices(
    composition: Composition,
    value: Mapping[str, Array],
    names: tuple[str, ...],
    springs: list[Array],
    damping: list[Array],
    pushes: Array,
) -> Iterator[Effect]:
    """The effects that act on all coordinates at once."""
    if springs:
        yield Springs(sum(springs))
    if len(pushes):
        yield PointForces(pushes)
    if damping:
        yield Damping(sum(damping))
    forced = [name for name in composition.forced if name in names]
    if forced:
        amplitude = jnp.stack([value[f"forcing.amplitude.{name}"] for name in forced])
        places = tuple(names.index(name) for name in forced)
        yield Forcing(amplitude, value["forcing.frequency"], value["forcing.phase"], places)


def _friction(composition: Composition, value: Mapping[str, Array], law: FrictionLaw | None) -> Friction | None:
    if composition.friction_law is None:
        return None
    direction = UnitVelocity() if composition.friction_direction == "unit-velocity" else Tangential()
    if law is None:
        numbers = {key.removeprefix("friction."): each for key, each in value.items() if key.startswith("friction.")}
        law = friction_law(composition.friction_law, **numbers)
    return Friction(law, direction)


def _schedule(key: str, value: Mapping[str, Array], scale: Array) -> Schedule:
    if key in value:
        return Constant(value[key] * scale)
    return PiecewiseLinear(value[f"{key}.time"], value[f"{key}.value"] * scale)
