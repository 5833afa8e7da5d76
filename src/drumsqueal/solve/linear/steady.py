"""Steady sliding, and the linear model there as the Jacobian of the one vector field."""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer

from drumsqueal.errors import NoSteadySliding, SteadyStateError
from drumsqueal.interpreter import Interpreted
from drumsqueal.physics.bodies.body import WRITTEN_OUT, Motion, scalars, whole
from drumsqueal.physics.effects.contact import Contact, Levels
from drumsqueal.physics.effects.effect import Observation, at_rest
from drumsqueal.physics.effects.forcing import Forcing
from drumsqueal.physics.effects.pressure import Bonded
from drumsqueal.physics.friction_law import coefficient_at
from drumsqueal.physics.model import Model
from drumsqueal.physics.quadrature.area import SteadySurface
from drumsqueal.physics.quadrature.cells import Cells
from drumsqueal.scene.quantities import percent
from drumsqueal.solve.linear.equilibrium import Equilibrium, equilibrium_near, find_equilibrium


class Linear(NamedTuple):
    """M q̈ + C q̇ + K q = 0 about steady sliding: mass (n,), damping and stiffness (n, n), of JAX or of NumPy."""

    mass: Any
    damping: Any
    stiffness: Any

    def state_matrix(self) -> Any:
        """Matrix A of d/dt (q, q̇) = A (q, q̇), shape (2n, 2n)."""
        n, jax_or_numpy = self.mass.shape[0], np if isinstance(self.mass, np.ndarray) else jnp
        top = jax_or_numpy.concatenate([jax_or_numpy.zeros((n, n)), jax_or_numpy.eye(n)], axis=1)
        with np.errstate(all="ignore"):  # what is not finite is reported where eigenvalues are taken
            bottom = -jax_or_numpy.concatenate([self.stiffness, self.damping], axis=1) / self.mass[:, None]
        return jax_or_numpy.concatenate([top, bottom])


def steady_sliding(model: Model) -> Array:
    """Displacement q* (n,) of steady sliding at t = 0: Q(q*, 0) = 0 (physics: m, rad).

    Differentiable with respect to every number of the model (implicit function theorem). With the balanced assembly
    q* = 0 without iteration. Coordinates out of the plane stay zero where nothing acts on them. Raises SteadyStateError
    where none is found; inside `jax.jit` and the like, where nothing can be raised, q* is NaN then.
    """
    q = sliding_or_none(model)
    if not isinstance(q, Tracer) and not np.all(np.isfinite(q)):
        raise no_steady_sliding(model)
    return jnp.asarray(q)


def sliding_or_none(model: Model) -> Any:
    """As `steady_sliding`, NaN where none is found; of NumPy where the model is known."""
    moved = model.moved_by_steady_sliding
    if not any(moved) or model.balanced:
        return np.zeros(len(moved))
    # A bonded contact always has an equilibrium, beyond self-locking one that pulls: not one to arrive at.
    directly = np.asarray(not (model.pushed and any(isinstance(law, Bonded) for law in model.contact.laws)))
    if _is_known(model):
        return _of_all(model, _find_equilibrium(model, np.asarray(1.0), directly).displacement)
    plane, n = _at_rest(model), sum(moved)
    forces = partial(_static_forces, jax.lax.stop_gradient(plane))
    q = jax.lax.custom_root(
        lambda q: _static_forces(plane, jnp.append(q, 1.0))[0],
        find_equilibrium(forces, n, directly=directly).displacement,
        solve=lambda _, q: q,
        tangent_solve=lambda linear, force: jnp.linalg.solve(jax.jacfwd(linear)(force), force),
    )
    return jnp.zeros(len(moved)).at[np.flatnonzero(moved)].set(q)


def _is_known(model: Model) -> bool:
    """Whether it is all numbers: none traced, and no function, such as a friction law, that may hold traced ones."""
    leaves = jax.tree.leaves(model)
    return all(isinstance(leaf, Array | np.ndarray) and not isinstance(leaf, Tracer) for leaf in leaves)


def no_steady_sliding(model: Model) -> SteadyStateError:
    """Why none was found: where the path of equilibria runs off to infinity with the friction, the shoe locks."""
    friction = model.contact.friction
    found = raise_friction(model, 1.0)
    if friction is None or not bool(found.runs_off):
        rests = np.all(np.isfinite(found.frictionless))
        return SteadyStateError(NoSteadySliding.NOT_FOUND if rests else NoSteadySliding.PULLED_OFF)
    moment, radius = model.operation.at(0.0), model.contact.radius
    speed = abs(float(radius * moment.drum_speed))
    cure, fraction = "take less friction, or move the pin towards the line of the drag", float(found.fraction)
    if len(model.sides) > 1:  # which may have a coefficient each
        begins = f"that begins at {percent(fraction)} of the friction that the scene has"
        return SteadyStateError(NoSteadySliding.SELF_LOCKING, f"{begins}; {cure}")
    here = float(coefficient_at(friction.law, np.asarray(speed)))
    begins = f"that begins at a coefficient of friction of {fraction * here:.4g}"
    has = f"and at {speed:.3g} m/s the scene has {here:.4g}"
    return SteadyStateError(NoSteadySliding.SELF_LOCKING, f"{begins}, {has}; {cure}")


def check_held(model: Model) -> None:
    """Raise SteadyStateError where friction drags a shoe along which nothing holds it, so that no search is needed."""
    if model.balanced or model.contact.friction is None or not model.planar or not isinstance(model.contact, Contact):
        return
    moved = np.flatnonzero(model.moved_by_steady_sliding)
    root = np.sqrt(np.asarray(model.mass)[moved])
    values, vectors = np.linalg.eigh(np.asarray(model.stiffness)[np.ix_(moved, moved)] / np.outer(root, root))
    # Below 1e-13 of the largest stiffness over mass it is round-off.
    if not np.all(np.isfinite(values)) or values[0] > 1e-13 * values[-1]:
        return
    shares = np.abs(vectors[:, 0])
    # 0.1 of the largest part of a free motion: smaller ones are not named
    names = [model.names[k] for k, share in zip(moved, shares, strict=True) if share > 0.1 * shares.max()]
    raise SteadyStateError(
        NoSteadySliding.NOT_HELD, f"it moves freely in {' and '.join(names)}; add a spring there, as [[shoe.spring]]"
    )


def raise_friction(model: Model, factor: float) -> Equilibrium:
    """Follow steady sliding from no friction to a multiple of it; `fraction` is of that multiple.

    Displacements are of all coordinates (n,).
    """
    found = _find_equilibrium(model, np.asarray(factor), np.asarray(False))
    displacement, frictionless = (_of_all(model, each) for each in (found.displacement, found.frictionless))
    return found._replace(displacement=displacement, frictionless=frictionless)


@Interpreted
def observe_steady(model: Model, q: Array) -> tuple[tuple[Array, Array], Observation]:
    """Smallest and largest pressure (Pa), and the contact, while it slides at a displacement q (n,)."""
    contact, moment, motion = _at_rest(model).contact, model.operation.at(0.0), scalars(q)
    return model.contact.pressure_range(moment, motion), contact.observe(moment, motion, at_rest(motion))


@Interpreted
def _find_equilibrium(model: Model, factor: Array, directly: Array) -> Equilibrium:
    """Steady sliding with a multiple of the friction.

    Displacements are of the coordinates that need not rest by symmetry.
    """
    still = _at_rest(model, slopes=("pressure",))
    forces = lambda z: _static_forces(still, z.at[-1].multiply(factor))  # noqa: E731
    return find_equilibrium(forces, sum(model.moved_by_steady_sliding), directly=directly)


def _of_all(model: Model, displacement: Array) -> np.ndarray:
    q = np.zeros(len(model.names))
    q[np.flatnonzero(model.moved_by_steady_sliding)] = displacement
    return q


def _at_rest(model: Model, *, slopes: tuple[str, ...] = ()) -> Model:
    """What acts in steady sliding: no harmonic force; and motion that is the same all across, where that holds."""
    still = tuple(effect for effect in model.others if not isinstance(effect, Forcing))
    plane = model.in_plane() if model.planar else model
    return dataclasses.replace(_in_cells(plane, slips=False, slopes=slopes), others=still)


def _in_cells(model: Model, **settings: Any) -> Model:
    """The model with other settings of the cells in which contacts are summed, if they are."""
    if settings["slopes"]:  # by NumPy, to which large arrays cost little more than small ones
        settings["block"] = 16

    def change(contact: Any) -> Any:
        surface = getattr(contact, "surface", None)
        if not isinstance(surface, Cells):
            return contact
        return dataclasses.replace(contact, surface=dataclasses.replace(surface, **settings))

    return dataclasses.replace(model, contact=model.contact.mapped(change))


def _static_forces(model: Model, z: Array) -> tuple[Array, Array]:
    """Sum of the forces at rest and of their magnitudes (n,), from displacement and fraction of friction (n + 1,).

    Over the coordinates that need not rest by symmetry.
    """
    moving, count = np.flatnonzero(model.moved_by_steady_sliding).tolist(), len(model.names)
    q: Motion
    if count > WRITTEN_OUT:
        q = jnp.zeros(count).at[np.array(moving)].set(z[:-1])
    else:
        q = tuple(z[moving.index(k)] if k in moving else 0.0 for k in range(count))
    moment = model.operation.at(0.0)._replace(friction_left=z[-1])
    forces = [effect.act(moment, q, at_rest(q)).force for effect in model.effects]
    parts = jnp.stack([whole(force)[np.array(moving)] for force in forces])
    return jnp.sum(parts, axis=0), jnp.sum(jnp.abs(parts), axis=0)


def linear_model(model: Model) -> tuple[Any, Linear]:
    """Steady sliding q* (n,), NaN where none is found, and the linear model there."""
    if not _is_known(model):
        return _linear_model(model)
    steady = sliding_or_none(model)
    return steady, _linearise(model, steady)


@Interpreted
def _linear_model(model: Model) -> tuple[Array, Linear]:
    steady = jnp.asarray(sliding_or_none(model))
    return steady, linearise(model, steady)


def coupling(model: Model) -> np.ndarray:
    """Which coordinate moves which (n, n) at steady sliding: entry i, j states whether q_j or q̇_j pushes q_i."""
    mass, damping, stiffness = (np.asarray(part) for part in linear_model(model)[1])
    # In coordinates scaled by √M all entries of one matrix are in one unit.
    scaled = (np.abs(each) / np.sqrt(np.outer(mass, mass)) for each in (damping, stiffness))
    # 1e-10 of the largest coupling: below it is round-off
    return np.logical_or.reduce([each > 1e-10 * np.max(each) for each in scaled])


def _near_steady_sliding(model: Model, slopes: tuple[str, ...]) -> Model:
    """The model for motion infinitely near to steady sliding; balanced forces leave the whole lining pressed there."""
    contact, lifts = model.contact, not model.balanced
    if model.planar and isinstance(contact, Contact) and not isinstance(contact.surface, Cells):
        return dataclasses.replace(model, contact=dataclasses.replace(contact, surface=SteadySurface(cut=lifts)))
    return _in_cells(model, slips=False, lifts=lifts, slopes=slopes)


def linearise(model: Model, steady: Array) -> Linear:
    """Mass, damping −∂Q/∂q̇ and stiffness −∂Q/∂q at steady sliding q* (n,); the paper's equation (29) at q* = 0.

    Differentiable.
    """
    # By `jacfwd`: JAX 0.10 takes no derivative of a loop that has been linearised.
    return _slopes(_near_steady_sliding(model, ()), steady, jax.jacfwd)


@Interpreted
def _linearise(model: Model, steady: Array) -> Linear:
    """What `linearise` finds, of a model that is known."""
    return _slopes(_near_steady_sliding(model, Levels._fields), steady, _jacobian)


def _jacobian(function: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """The function's slopes, linearised once and then taken along each direction.

    For what is interpreted: `jax.jacfwd` would trace all of the function again for the directions.
    """

    def slopes(x: Array) -> Array:
        _, along = jax.linearize(function, x)
        return jax.vmap(along, out_axes=-1)(jnp.eye(x.size))

    return slopes


def _slopes(model: Model, q: Array, jacobian: Callable[[Callable[[Array], Array]], Callable[[Array], Array]]) -> Linear:
    n = q.size
    forces = lambda state: model.act(0.0, state[:n], state[n:])[0]  # noqa: E731
    slopes = jacobian(forces)(jnp.concatenate([q, jnp.zeros(n)]))
    return Linear(model.mass, -slopes[:, n:], -slopes[:, :n])


@Interpreted
def sliding_near(model: Model, q: Array, own: Array, load: Array) -> tuple[Array, Linear]:
    """The equilibrium (n,), other than steady sliding maybe, that Newton's method comes to from q, and what is near it.

    NaN where it comes to none. `own` (n,) and `load` (n,) are the stiffness of each coordinate and the forces (N, N m)
    that count.
    """
    moving = np.flatnonzero(model.moved_by_steady_sliding)
    found = equilibrium_near(partial(_static_forces, _at_rest(model)), q[moving], own[moving], load[moving])
    place = jnp.zeros_like(q).at[moving].set(found)
    return place, _slopes(model, place, _jacobian)
