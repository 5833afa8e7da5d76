"""Many transients of one composition: the same compiled program, with other numbers in it.

They are integrated one after the other within the program, one part of them a thread. Side by side (`jax.vmap`) all
would make as many steps as the one that needs most, and take every way of the contact integral at each of them.
"""

import math
import os
from collections.abc import Generator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.physics.kernel import compiled, one_kernel
from drumsqueal.physics.model import Model
from drumsqueal.scene.tables import LEAST_TOLERANCE, MOST_TOLERANCE
from drumsqueal.solve.transient.runge_kutta import DEFAULT, STAGES, is_explicit
from drumsqueal.solve.transient.segment import (
    CORNER_BUDGET,
    STEP_BUDGET,
    Resolution,
    advance_scaled,
    first_step,
    local_tolerance,
    resolution,
)
from drumsqueal.solve.transient.state import CHUNK_SAMPLES, Span, State


class Batch(NamedTuple):
    """A chunk of m transients: time (k,), displacement from steady sliding, velocity (m, k, n), evaluations (m,).

    Where `reached` (m,) is False a transient has failed: its samples are NaN from there on.
    """

    time: np.ndarray
    vibration: np.ndarray
    velocity: np.ndarray
    evaluations: np.ndarray
    reached: np.ndarray


class _Fraction(NamedTuple):
    """What one thread works on: models, steady states, states and next steps, each with a leading axis."""

    models: Model
    steady: Array
    states: State
    steps: Array


def integrate_many(
    models: Sequence[Model],
    steady: ArrayLike,
    displacement: ArrayLike,
    velocity: ArrayLike,
    *,
    duration: float,
    sample_rate: float,
    tolerance: float,
    solver: str = DEFAULT,
    threads: int | None = None,
) -> Generator[Batch]:
    """Integrate m models of one composition from displacements (m, n) from their steady states (m, n), chunk by chunk.

    Displacements (m, rad) and velocities (m/s, rad/s) are in the order of `model.names`; a steady state is
    `analyse_stability(model).steady_state`, zero for the steady state "uniform-pressure". Samples lie at
    k / sample_rate (Hz) from 0 to the duration (s), both included; `tolerance` and `solver` are those of a scene. There
    is a thread for each processor unless given. A transient that fails does not stop the others. Raises
    ValueError where there are no models, where they are not of one composition, for an implicit method, and for numbers
    or shapes that make no sense.
    """
    _check(models, solver, {"steady": steady, "displacement": displacement, "velocity": velocity}, threads)
    if not (math.isfinite(duration) and math.isfinite(sample_rate) and min(duration, sample_rate) > 0):
        raise ValueError(f"duration and sample_rate must be positive, got {duration} s and {sample_rate} Hz")
    if not LEAST_TOLERANCE <= tolerance <= MOST_TOLERANCE:
        raise ValueError(f"tolerance must be from {LEAST_TOLERANCE:g} to {MOST_TOLERANCE:g}, got {tolerance}")
    samples = round(duration * sample_rate)
    steady, displacement, velocity = (np.asarray(x, dtype=np.float64) for x in (steady, displacement, velocity))
    parts = np.array_split(np.arange(len(models)), min(threads or os.cpu_count() or 1, len(models)))
    fractions = []
    for part in parts:
        stacked: Model = jax.tree.map(lambda *leaves: np.stack(leaves), *(models[i] for i in part))
        memory = jnp.zeros((len(part), len(models[0].remembered))) if models[0].remembering else None
        state = State(jnp.asarray(displacement[part]), jnp.asarray(velocity[part]), jnp.zeros(len(part)), memory)
        fractions.append(
            _Fraction(stacked, jnp.asarray(steady[part]), state, jax.block_until_ready(_first_steps(stacked)))
        )
    with ThreadPoolExecutor(len(fractions)) as pool:
        for first in range(0, samples, CHUNK_SAMPLES):
            count = min(CHUNK_SAMPLES, samples - first)
            span = Span(np.float64(first / sample_rate), np.float64(1 / sample_rate), np.int64(count))
            local = local_tolerance(np.float64(tolerance), solver)
            # Eigenvalues of a batch wait for the threads they run in: two programs at once would wait for each other.
            measures = [jax.block_until_ready(_resolutions(fraction.models, span, local)) for fraction in fractions]
            jobs = [(*each, span, local, solver) for each in zip(fractions, measures, strict=True)]
            done = list(pool.map(lambda job: _advance(*job), jobs))
            fractions = [each[0] for each in done]
            states, steps, reached = jax.tree.map(lambda *parts: np.concatenate(parts), *(each[1:] for each in done))
            fresh = slice(0 if first == 0 else 1, count + 1)
            time = np.arange(first, first + count + 1)[fresh] / sample_rate
            evaluations = steps * STAGES[solver] + 1
            yield Batch(time, states.vibration[:, fresh], states.velocity[:, fresh], evaluations, reached)


def _check(models: Sequence[Model], solver: str, states: Mapping[str, ArrayLike], threads: int | None) -> None:
    if not models:
        raise ValueError("there are no models to integrate")
    if not is_explicit(solver):
        raise ValueError(f"many transients take an explicit method, one of {', '.join(STAGES)}; got {solver}")
    if len({jax.tree.structure(model) for model in models}) != 1:
        raise ValueError("the models must be of one composition: the same coordinates and effects, with other numbers")
    wanted = (len(models), len(models[0].names))
    for name, value in states.items():
        if np.shape(value) != wanted:
            raise ValueError(f"{name} must be of shape {wanted}, models by coordinates, got {np.shape(value)}")
    if threads is not None and threads < 1:
        raise ValueError(f"there must be a thread at least, got {threads}")


@compiled
def _first_steps(models: Model) -> Array:
    return jax.vmap(first_step)(models)


@compiled
def _resolutions(models: Model, span: Span, local: Array) -> Resolution:
    """What motion is measured by in a chunk, with a leading axis."""
    return jax.vmap(lambda model: resolution(model, span, local))(models)


@compiled
def _advance(
    fraction: _Fraction, measures: Resolution, span: Span, local: Array, solver: str
) -> tuple[_Fraction, State, Array, Array]:
    """A chunk of a thread's part: next state, samples (m, k, n), steps made (m,) and whether the end was reached."""
    corners = jax.vmap(lambda model: model.operation.corners)(fraction.models)
    items = (fraction, measures, corners)
    final, step, states, steps, reached = one_kernel(_one_after_the_other, items, span, local, solver)
    return fraction._replace(states=final, steps=step), states, steps, reached


def _one_after_the_other(
    items: tuple[_Fraction, Resolution, Array | None], span: Span, local: Array, solver: str
) -> tuple:
    def one(item: tuple[_Fraction, Resolution, Array | None]) -> tuple[State, Array, State, Array, Array]:
        each, measure, corners = item
        sound = jnp.isfinite(each.states.flat()).all()
        count = 0 if corners is None else jnp.sum((corners > span.start) & (corners < span.start + span.length))
        budget = jnp.where(sound, STEP_BUDGET + CORNER_BUDGET * count, 0)  # what has failed is not tried again
        segment = advance_scaled(
            each.models, each.steady, each.states, span, local, each.steps, measure, corners, solver, budget
        )
        final = jax.tree.map(lambda x: jnp.where(segment.reached, x, jnp.nan), segment.final)
        return final, segment.step, segment.states, segment.steps, segment.reached

    return jax.lax.map(one, items)
