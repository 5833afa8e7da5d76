"""The share of a step that is not the right-hand side.

A step of the default method takes 13 evaluations. What one of them takes is measured in a chain within one kernel, as
the transient runs them: each state waits for the result of the one before, so that nothing overlaps that would not in
a step. The states are the transient's own samples in order, below the edges and beyond them as they occur, each as
often in a row as the transient evaluates between two samples, so that branches are guessed as well. The same chain
without the forces is taken off.

What a step takes is a difference: chunks of 10 ms with one sample, less chunks from the same starts that are over after
a few steps. Both observe and write the same number of samples, which thereby cancel. Only `act` counts as right-hand
side: scaling the state, dividing by the mass, stages, error and step size are what is outside.

Out-of-order execution lets the two overlap, and a compiler treats a chain a little differently: beside that share
stands what a step takes whose forces are those of linear springs, a product with a 3 by 3 matrix.
"""

import dataclasses
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.physics.model import Model, build_model
from drumsqueal.programs import compiled, one_kernel
from drumsqueal.simulation import prepare, transient
from drumsqueal.solve.transient.runge_kutta import DEFAULT, STAGES
from drumsqueal.solve.transient.segment import STEP_BUDGET, Segment, advance, first_step, no_rows
from drumsqueal.solve.transient.state import CHUNK_SAMPLES, Span, State

from .record import Record
from .scenes import DURATION, SAMPLE_RATE, growing_scene

TOLERANCE, SHORT = 1e-6, 1e-6  # of the transient; s, over in a step or two
ROUNDS, LARGEST_FRACTION = 15, 0.3


class Springs(Model):
    """The same motion below the edges without friction: next to no right-hand side."""

    def act(self, time: ArrayLike, q: Array, v: Array) -> tuple[Array, Array]:
        """Linear restoring forces, which feed in no energy."""
        del time, v
        return -(self.stiffness @ q), jnp.zeros(())


def springs(model: Model) -> Springs:
    """The model with its forces replaced."""
    return Springs(**{field.name: getattr(model, field.name) for field in dataclasses.fields(model)})


def measure(record: Record, folder: Path) -> None:
    """Measure, print and judge."""
    del folder
    scene = growing_scene()
    model = build_model(scene)
    chunks = list(transient(prepare(scene)))
    q = jnp.asarray(np.concatenate([each.displacement for each in chunks]))
    v = jnp.asarray(np.concatenate([each.velocity for each in chunks]))
    step, steps = first_step(model), sum(each.steps for each in chunks)
    in_a_row = np.int64(round(steps * STAGES[DEFAULT] / len(q)))
    long, short = np.float64(CHUNK_SAMPLES / SAMPLE_RATE), np.float64(SHORT)
    calls = {
        "evaluations": lambda: chain(model, q, v, in_a_row, True),
        "without forces": lambda: chain(model, q, v, in_a_row, False),
        "chunks": lambda: advance_all(model, q, v, long, step),
        "short chunks": lambda: advance_all(model, q, v, short, step),
        "chunks, springs": lambda: advance_all(springs(model), q, v, long, step),
        "short chunks, springs": lambda: advance_all(springs(model), q, v, short, step),
    }
    seconds, results = take_turns(calls)
    taken = {name: min(each) for name, each in seconds.items()}  # noise only adds
    for name, each in seconds.items():
        record.keep("step", name, "time", "s", each)
    per_step = {}
    for name in ("chunks", "chunks, springs"):
        more = _steps(results[name]) - _steps(results[f"short {name}"])
        record.keep("step", name, "steps more than in short ones", "1", more)
        per_step[name] = (taken[name] - taken[f"short {name}"]) / more
    evaluations = len(q) * int(in_a_row)
    record.keep("step", "evaluations", "evaluations in the chain", "1", evaluations)
    fetching = taken["without forces"] / evaluations
    evaluation = taken["evaluations"] / evaluations - fetching
    report(record, per_step["chunks"], per_step["chunks, springs"], evaluation, fetching)


def _steps(segments: list[Segment]) -> int:
    return sum(int(segment.steps) for segment in segments)


def report(record: Record, step: float, bare_step: float, evaluation: float, fetching: float) -> None:
    """Print what a step is made of (s), and judge."""
    fraction = 1 - STAGES[DEFAULT] * evaluation / step
    record.keep("step", "act", "time of an evaluation", "s", evaluation)
    record.keep("step", DEFAULT, "time of a step", "s", step)
    record.keep("step", DEFAULT, "time of a step with springs for forces", "s", bare_step)
    record.keep("step", DEFAULT, "share outside the right-hand side", "1", fraction)
    record.say(
        f"step: {1e6 * step:.3g} µs a step of {DEFAULT}, {1e9 * evaluation:.3g} ns an evaluation, of which a step has "
        f"{STAGES[DEFAULT]}; {1e9 * fetching:.2g} ns to fetch a state are taken off. With springs for forces a step "
        f"takes {1e6 * bare_step:.3g} µs, {bare_step / step:.0%} of it."
    )
    record.aim(
        "step",
        f"at most {LARGEST_FRACTION:.0%} of a step outside the right-hand side",
        f"{fraction:.0%} ({1e6 * fraction * step:.2g} of {1e6 * step:.3g} µs); {bare_step / step:.0%} with springs",
        fraction <= LARGEST_FRACTION,
        f"by {100 * (fraction - LARGEST_FRACTION):.0f} points",
    )


@compiled
def chain(model: Model, q: Array, v: Array, in_a_row: Array, forces: bool) -> Array:
    """Evaluate at each state `in_a_row` times, one after the other, in one kernel."""
    return one_kernel(_chain, model, q, v, jnp.asarray(in_a_row), forces)


def _chain(model: Model, q: Array, v: Array, in_a_row: Array, forces: bool) -> Array:
    def of_one_state(k: Array, total: Array) -> Array:
        def once(_: Array, total: Array) -> Array:
            # A difference in the twentieth digit, so that an evaluation waits for the one before.
            state = q[k] + 1e-40 * total, v[k]
            force, power = model.act(0.0, *state) if forces else (state[0], state[1][0])
            return total + force + power

        return jax.lax.fori_loop(0, in_a_row, once, total)

    # Without forces the model is still an argument: its mass is used, for a kernel fails over what nothing uses.
    return jax.lax.fori_loop(0, len(q), of_one_state, 0 * model.mass)


def advance_all(model: Model, q: Array, v: Array, interval: np.float64, step: Array) -> list[Segment]:
    """A chunk with one sample from every CHUNK_SAMPLES-th state on."""
    segments = []
    for start in range(0, round(DURATION * SAMPLE_RATE), CHUNK_SAMPLES):
        state = State(q[start], v[start], jnp.zeros(()))
        span = Span(np.float64(start / SAMPLE_RATE), interval, np.int64(1))
        steady = jnp.zeros(q.shape[1])
        how = np.float64(TOLERANCE), step, np.full(2, float(STEP_BUDGET)), no_rows(model)
        segments.append(advance(model, steady, state, span, *how))
    return segments


def take_turns(calls: dict[str, Callable[[], object]]) -> tuple[dict[str, list[float]], dict[str, Any]]:
    """Seconds of each call in each round, all in turn after a first one that compiles, and what they returned last."""
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    results = {}
    for round_number in range(ROUNDS + 1):
        for name, call in calls.items():
            before = time.perf_counter()
            results[name] = jax.block_until_ready(call())
            if round_number:
                seconds[name].append(time.perf_counter() - before)
    return seconds, results
