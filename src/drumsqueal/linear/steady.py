"""Steady sliding, and the linear model there as the Jacobian of the one vector field."""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix
from jax import Array

from drumsqueal.bodies.rigid_shoe import IN_PLANE
from drumsqueal.effects.assembly import Balance
from drumsqueal.effects.contact import Contact
from drumsqueal.model import Model
from drumsqueal.quadrature.smooth import WholeSurface

# Newton's steps on the scaled equilibrium end when the displacement is settled to this share of p0/k_c, or the forces
# are balanced to this share of the load.
STEADY_TOLERANCE = 1e-13
STEADY_STEPS = 100
COUPLED_SHARE = 1e-10  # of the largest coupling: below it is round-off


class Linear(NamedTuple):
    """M q̈ + C q̇ + K q = 0 about steady sliding: mass (n,), damping and stiffness (n, n)."""

    mass: Array
    damping: Array
    stiffness: Array

    def state_matrix(self) -> Array:
        """Matrix A of d/dt (q, q̇) = A (q, q̇), shape (2n, 2n)."""
        n = self.mass.shape[0]
        top = jnp.concatenate([jnp.zeros((n, n)), jnp.eye(n)], axis=1)
        bottom = -jnp.concatenate([self.stiffness, self.damping], axis=1) / self.mass[:, None]
        return jnp.concatenate([top, bottom])


def steady_sliding(model: Model) -> Array:
    """Displacement q* (n,) of steady sliding at t = 0: Q(q*, 0) = 0 (physics: m, rad).

    Differentiable with respect to every number of the model (implicit function theorem). With the balanced assembly
    q* = 0 without iteration. The out-of-plane coordinates stay zero by symmetry. Where the solver fails, q* is NaN:
    `analyse_stability` says so in words.
    """
    n = len(model.coordinates)
    moving = np.asarray([k for k, i in enumerate(model.coordinates) if i in IN_PLANE], dtype=int)
    if moving.size == 0 or any(isinstance(effect, Balance) for effect in model.others):
        return jnp.zeros(n)
    plane = model.undisturbed().in_plane()
    preload = plane.operation.at(0.0).preload
    # Forces of the order p0 times the area, and the displacements that they cause.
    force_scale = jnp.where(preload > 0, preload, 1.0) * plane.contact.area
    size = force_scale / jnp.max(jnp.diag(plane.stiffness))

    def residual(x: Array, args: Model) -> Array:
        return args.act(0.0, x * size, jnp.zeros(moving.size))[0] / force_scale

    solver = optimistix.Dogleg(rtol=STEADY_TOLERANCE, atol=STEADY_TOLERANCE)
    start = jnp.zeros(moving.size)
    solution = optimistix.root_find(residual, solver, start, args=plane, max_steps=STEADY_STEPS, throw=False)
    # Where the first steps leave nothing but round-off no other makes it less, and the solver calls that a failure.
    balanced = jnp.max(jnp.abs(residual(solution.value, plane))) <= STEADY_TOLERANCE
    found = (solution.result == optimistix.RESULTS.successful) | balanced
    return jnp.zeros(n).at[moving].set(jnp.where(found, solution.value * size, jnp.nan))


@jax.jit
def linear_model(model: Model) -> tuple[Array, Linear]:
    """Steady sliding q* (n,) and the linear model there, as one program: by far the longest to compile."""
    steady = steady_sliding(model)
    return steady, linearise(model, steady)


def coupling(model: Model) -> np.ndarray:
    """Which coordinate moves which (n, n) at steady sliding: entry i, j tells whether q_j or q̇_j pushes q_i."""
    mass, damping, stiffness = (np.asarray(part) for part in linear_model(model)[1])
    # In coordinates scaled by √M all entries of one matrix are in one unit.
    scaled = (np.abs(each) / np.sqrt(np.outer(mass, mass)) for each in (damping, stiffness))
    return np.logical_or.reduce([each > COUPLED_SHARE * np.max(each) for each in scaled])


def _without_edges(model: Model) -> Model:
    """The model for motion infinitely near to q = 0, if that is its steady sliding.

    The whole lining then presses and slips one way. What does not look for edges is a tenth of the program to compile.
    """
    balanced = any(isinstance(effect, Balance) for effect in model.others)
    if not (balanced and isinstance(model.contact, Contact) and model.contact.surface.spatial):
        return model
    return dataclasses.replace(model, contact=dataclasses.replace(model.contact, surface=WholeSurface()))


def linearise(model: Model, steady: Array) -> Linear:
    """Mass, damping −∂Q/∂q̇ and stiffness −∂Q/∂q at steady sliding q* (n,); the paper's equation (29) at q* = 0."""
    n, model = steady.size, _without_edges(model)
    jacobian = jax.jacfwd(lambda state: model.act(0.0, state[:n], state[n:])[0])(
        jnp.concatenate([steady, jnp.zeros(n)])
    )
    return Linear(model.mass, -jacobian[:, n:], -jacobian[:, :n])
