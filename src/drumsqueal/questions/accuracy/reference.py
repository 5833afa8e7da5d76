"""A trajectory to measure errors against: another solver, from another library, on another quadrature, and a second."""

import dataclasses
import time
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.integrate import DOP853, LSODA

from drumsqueal.physics.laws.friction_law import breakpoints
from drumsqueal.physics.model import Model
from drumsqueal.physics.quadrature.cells import Cells
from drumsqueal.physics.quadrature.independent import FEJER, TANH_SINH, IndependentSurface
from drumsqueal.programs import one_kernel
from drumsqueal.progress import Progress, silent
from drumsqueal.solve.transient.state import State, motion_scale

# The reference, the run that says how good it is, and another method that confirms it, each with its tolerance.
FIRST, SECOND, THIRD = 1e-13, 1e-12, 1e-12
UNMOVED = 1e-2  # of what the energy would give a coordinate: one that moves less is measured against that
FINER_CELLS = {TANH_SINH: (2, 2), FEJER: (1.5, 1, 2)}  # see `Contact.on_cells`
PATIENCE = 40.0  # s of computing for each of the three; a reference that takes longer ends where it has come to


@dataclasses.dataclass(frozen=True)
class Reference:
    """States (k, 2n), vibration and velocity, at times (k,), and those of the two runs that show how good they are.

    `other` is from ten times the tolerance and another quadrature, `confirming` from another method on top.
    """

    time: np.ndarray
    states: np.ndarray
    other: np.ndarray
    confirming: np.ndarray
    model: Model

    def error(self, states: np.ndarray, until: float) -> float:
        """Largest error of other states (k, 2n) at the same times up to one (s), relative to each state's size so far.

        The states may go on for longer than the reference.
        """
        upto = self.time <= until
        wanted = self.states[upto]
        return trajectory_error(states[: len(self.time)][upto], wanted, sizes_of(wanted, self.model))

    def uncertainty(self, until: float) -> float:
        """Error of `other` up to a time (s)."""
        return self.error(self.other, until)

    def confirmed(self, until: float) -> float:
        """Error of `confirming` up to a time (s)."""
        return self.error(self.confirming, until)


def find_reference(
    model: Model,
    steady: np.ndarray,
    displacement: np.ndarray,
    velocity: np.ndarray,
    times: np.ndarray,
    progress: Progress = silent,
) -> Reference:
    """Integrate a displacement from steady sliding (n,) with SciPy: DOP853 at 1e-13 and 1e-12, and LSODA at 1e-12.

    Their right-hand sides take the model's effects and, for the contact, tanh-sinh or Fejér quadrature. The
    reference ends early where one of them runs out of patience.
    """
    start = np.concatenate([displacement, velocity])
    first_state = State(jnp.asarray(displacement), jnp.asarray(velocity), jnp.zeros(()))
    scale = np.asarray(motion_scale(model, first_state).flat())[:-1]
    first = _solve(DOP853, FIRST, _with(model, TANH_SINH), steady, start / scale, scale, times, progress)
    other = _with(model, FEJER)
    second = _solve(DOP853, SECOND, other, steady, start / scale, scale, times[: len(first)], progress)
    third = _solve(LSODA, THIRD, other, steady, start / scale, scale, times[: len(second)], progress)
    common = len(third)
    states, other, confirming = (found[:common] * scale for found in (first, second, third))
    return Reference(times[:common], states, other, confirming, model)


def sizes_of(states: np.ndarray, model: Model) -> np.ndarray:
    """What errors of states (k, 2n) are measured against (2n,): the largest value of each, but no round-off.

    A state that only round-off moves is measured against a fraction of what the vibration energy would give it.
    """
    n = len(model.names)
    mass, stiffness = np.asarray(model.mass), np.asarray(model.stiffness)
    energy = states[:, n:] ** 2 @ mass + np.einsum("ti,ij,tj->t", states[:, :n], stiffness, states[:, :n])
    most = states[np.argmax(energy)]
    scale = motion_scale(model, State(jnp.asarray(most[:n]), jnp.asarray(most[n:]), jnp.zeros(())))
    return np.maximum(np.abs(states).max(axis=0), UNMOVED * np.asarray(scale.flat())[:-1])


def trajectory_error(states: np.ndarray, wanted: np.ndarray, sizes: np.ndarray) -> float:
    """Largest error (k, 2n) of any state over its size (2n,)."""
    return float((np.abs(states - wanted).max(axis=0) / sizes).max())


def _with(model: Model, rule: str) -> Model:
    """The model with another quadrature; where the friction law is steep the arc is split into many panels.

    In space that would take too long: where the two rules then differ, the uncertainty shows it. A lining that bends
    has finer cells in place of either rule.
    """
    if isinstance(model.lining.surface, Cells):
        return dataclasses.replace(model, contact=model.lining.on_cells(*FINER_CELLS[rule]))
    spatial, friction = model.lining.surface.spatial, model.contact.friction
    speeds = np.zeros(0) if friction is None else np.asarray(breakpoints(friction.law))
    # 5.0 m/s; a law whose slope changes over more is as smooth as the rest
    steep = not spatial and bool(np.any(speeds < 5.0))
    # 8 of the arc: 2e-12 of the load where the law falls with 1000 s/m
    surface = IndependentSurface(rule, spatial, panels=8 if steep else 2)
    return dataclasses.replace(model, contact=dataclasses.replace(model.lining, surface=surface))


def _solve(
    method: Callable[..., Any],
    tolerance: float,
    model: Model,
    steady: np.ndarray,
    start: np.ndarray,
    scale: np.ndarray,
    times: np.ndarray,
    progress: Progress,
) -> np.ndarray:
    """Scaled states at the times that were reached."""

    # The model is compiled in: to hand it over takes longer than to evaluate it.
    compiled = jax.jit(lambda t, y: one_kernel(_slope, model, jnp.asarray(steady), jnp.asarray(scale), t, y))

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        return np.asarray(compiled(t, y))

    slope(0.0, start)  # compiles
    patience = time.perf_counter() + PATIENCE
    solver = method(slope, 0.0, start, times[-1], rtol=tolerance, atol=tolerance)
    states = [start]
    while solver.status == "running" and time.perf_counter() < patience:
        progress(f"reference, {method.__name__} at {tolerance:g}", solver.t, float(times[-1]))
        solver.step()
        if solver.status == "failed":
            break
        upto = int(np.searchsorted(times, solver.t, side="right"))
        if upto > len(states):
            states.extend(solver.dense_output()(times[len(states) : upto]).T)
    return np.array(states)


def _slope(model: Model, steady: Array, scale: Array, t: Array, y: Array) -> Array:
    vibration, velocity = jnp.split(y * scale, 2)
    force, _ = model.act(t, steady + vibration, velocity)
    return jnp.concatenate([velocity, force / model.mass]) / scale
