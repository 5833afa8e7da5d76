"""Many transients of one composition: each as it is alone, one after the other in each of several threads.

JAX leaves Python to the other threads while a compiled call runs, which is nearly all the time. Side by side in one
call (`jax.vmap`) all would make as many steps as the one that needs most, and take every way of the contact integral at
each of them.
"""

import math
import os
from collections.abc import Generator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import jax
import numpy as np
from jax.typing import ArrayLike

from drumsqueal.physics.model import Model
from drumsqueal.scene.tables import LEAST_TOLERANCE, MOST_TOLERANCE
from drumsqueal.solve.transient.integrate import count_evaluations, start_state
from drumsqueal.solve.transient.runge_kutta import AUTO, check_solver
from drumsqueal.solve.transient.segment import first_step
from drumsqueal.solve.transient.state import CHUNK_SAMPLES, Span
from drumsqueal.solve.transient.stick_slip import StickSlip


class Batch(NamedTuple):
    """A chunk of m transients: time (k,), displacement from steady sliding, velocity (m, k, n), evaluations (m,).

    Evaluations are NaN where they are not counted. Where `reached` (m,) is False a transient has failed: its samples
    are NaN from there on. `sticks` (m, k) says whether the contact sticks.
    """

    time: np.ndarray
    vibration: np.ndarray
    velocity: np.ndarray
    evaluations: np.ndarray
    reached: np.ndarray
    sticks: np.ndarray


def integrate_many(
    models: Sequence[Model],
    steady: ArrayLike,
    displacement: ArrayLike,
    velocity: ArrayLike,
    *,
    duration: float,
    sample_rate: float,
    tolerance: float,
    solver: str = AUTO,
    threads: int | None = None,
) -> Generator[Batch]:
    """Integrate m models of one composition from displacements (m, n) from their steady states (m, n), chunk by chunk.

    Displacements (m, rad) and velocities (m/s, rad/s) are in the order of `model.names`; a steady state is
    `analyse_stability(model).steady_state`, zero for the steady state "uniform-pressure". Samples lie at
    k / sample_rate (Hz) from 0 to the duration (s), both included; `tolerance` and `solver` are those of a scene. There
    is a thread for each processor unless given. A transient that fails does not stop the others. Raises
    ValueError where there are no models, where they are not of one composition, and for numbers or shapes that make no
    sense.
    """
    _check(models, solver, {"steady": steady, "displacement": displacement, "velocity": velocity}, threads)
    if not (math.isfinite(duration) and math.isfinite(sample_rate) and min(duration, sample_rate) > 0):
        raise ValueError(f"duration and sample_rate must be positive, got {duration} s and {sample_rate} Hz")
    if not LEAST_TOLERANCE <= tolerance <= MOST_TOLERANCE:
        raise ValueError(f"tolerance must be from {LEAST_TOLERANCE:g} to {MOST_TOLERANCE:g}, got {tolerance}")
    samples = round(duration * sample_rate)
    starts = (np.asarray(x, dtype=np.float64) for x in (steady, displacement, velocity))
    transients = [_Transient(model, start, tolerance, solver) for model, *start in zip(models, *starts, strict=True)]
    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        for first in range(0, samples, CHUNK_SAMPLES):
            count = min(CHUNK_SAMPLES, samples - first)
            span = Span(np.float64(first / sample_rate), np.float64(1 / sample_rate), np.int64(count))
            fresh = slice(0 if first == 0 else 1, count + 1)
            done = zip(*pool.map(lambda each, span=span: each.through(span), transients), strict=True)
            vibration, velocity, evaluations, reached = map(np.array, done)
            time = np.arange(first, first + count + 1)[fresh] / sample_rate
            sticks = np.array([each.sticks_at(time) for each in transients])
            yield Batch(time, vibration[:, fresh], velocity[:, fresh], evaluations, reached, sticks)


def _check(models: Sequence[Model], solver: str, states: Mapping[str, ArrayLike], threads: int | None) -> None:
    if not models:
        raise ValueError("there are no models to integrate")
    check_solver(solver)
    if len({jax.tree.structure(model) for model in models}) != 1:
        raise ValueError("the models must be of one composition: the same coordinates and effects, with other numbers")
    wanted = (len(models), len(models[0].names))
    for name, value in states.items():
        if np.shape(value) != wanted:
            raise ValueError(f"{name} must be of shape {wanted}, models by coordinates, got {np.shape(value)}")
    if threads is not None and threads < 1:
        raise ValueError(f"there must be a thread at least, got {threads}")


class _Transient:
    """One of them, on its way."""

    def __init__(self, model: Model, start: Sequence[np.ndarray], tolerance: float, solver: str) -> None:
        """Take its steady state, displacement from it and velocity at the start."""
        steady, displacement, velocity = start
        self._state = start_state(model, displacement, velocity)
        self._run = StickSlip(model, steady, np.float64(tolerance), solver, observes=False)
        self._step = first_step(model)
        self._failed = False

    def through(self, span: Span) -> tuple[Any, Any, float, bool]:
        """A chunk: vibration and velocity (CHUNK_SAMPLES + 1, n), evaluations, and whether it reached the end."""
        if self._failed:  # and is not tried again
            nothing = np.full((CHUNK_SAMPLES + 1, len(self._state.vibration)), np.nan)
            return nothing, nothing, 0.0, False
        segment = self._run.through(self._state, span, self._step)
        states, self._state, self._step = segment.states, segment.final, segment.step
        self._failed = not (segment.reached and all(np.isfinite(each).all() for each in jax.tree.leaves(self._state)))
        return states.vibration, states.velocity, count_evaluations(segment, self._run.solvers), not self._failed

    def sticks_at(self, time: np.ndarray) -> np.ndarray:
        """Whether the contact sticks at times (k,) of the last chunk."""
        changes = self._run.changes
        after = [not changes[0][1] if changes else self._run.sticks, *(sticks for _, sticks in changes)]
        return np.array(after)[np.searchsorted([when for when, _ in changes], time, side="right")]
