"""Many transients at once: numbalsoda over drum speeds, in processes that are warmed up beforehand."""

import multiprocessing
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.pool import Pool
from multiprocessing.synchronize import Barrier
from typing import NamedTuple

import numpy as np

from .configuration import Outcome
from .parameters import with_drum_speed
from .solvers import configuration

FRACTION = 4  # transients a task: small, for slow drums take longer


class Task(NamedTuple):
    """One transient."""

    name: str
    parameters: np.ndarray
    start: np.ndarray
    times: np.ndarray
    tolerance: float


class BatchOutcome(NamedTuple):
    """States (speeds, times, 6) in SI, evaluations in all, and the wall time (s) without starting and compiling.

    The states of a transient that failed are NaN, and its evaluations are not counted: where the drum is slow the
    whole lining may all but stick, and the step size collapses.
    """

    states: np.ndarray
    evaluations: int
    seconds: float


@contextmanager
def warm_processes(
    names: tuple[str, ...], parameters: np.ndarray, start: np.ndarray, processes: int = 2
) -> Iterator[Pool]:
    """Processes that have compiled the configurations of those names and wait for transients."""
    context = multiprocessing.get_context("spawn")  # JAX, which the parent may hold, does not survive a fork
    ready = context.Barrier(processes + 1)
    with context.Pool(processes, _warm_up, (ready, names, parameters, start)) as pool:
        ready.wait()
        yield pool


def solve_batch(
    pool: Pool,
    name: str,
    parameters: np.ndarray,
    start: np.ndarray,
    speeds: np.ndarray,
    times: np.ndarray,
    tolerance: float,
) -> BatchOutcome:
    """The transient at each drum speed (rad/s), from the state `start` (6,), sampled at the times (s)."""
    tasks = [Task(name, with_drum_speed(parameters, speed), start, times, tolerance) for speed in speeds]
    before = time.perf_counter()
    outcomes = pool.map(_solve, tasks, FRACTION)
    seconds = time.perf_counter() - before
    states = np.stack([each.states for each in outcomes])
    return BatchOutcome(states, sum(each.evaluations for each in outcomes), seconds)


def _warm_up(ready: Barrier, names: tuple[str, ...], parameters: np.ndarray, start: np.ndarray) -> None:
    with open(os.devnull, "w") as nowhere:  # noqa: PTH123 (for its descriptor: LSODA prints where it fails)
        os.dup2(nowhere.fileno(), 2)
    for name in names:
        configuration(name).warm_up(parameters, start)
    ready.wait()


def _solve(task: Task) -> Outcome:
    try:
        return configuration(task.name).solve(task.parameters, task.start, task.times, task.tolerance)
    except RuntimeError:
        return Outcome(np.full((len(task.times), 6), np.nan), 0)
