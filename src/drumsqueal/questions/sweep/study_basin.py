"""The basins of a brake or a body: where the starts in a box lead."""

import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import xarray

from drumsqueal.errors import RequestError
from drumsqueal.findings.history import COMPLETE
from drumsqueal.physics.model import Model
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.sweep.basin import Basin, find_basin
from drumsqueal.questions.sweep.body import Box, body_plan, check_range, flat_box
from drumsqueal.questions.sweep.file import SweepFile, outcome_of
from drumsqueal.questions.sweep.filling import Batches, fill_file
from drumsqueal.questions.sweep.points import Columns, Points, Starting
from drumsqueal.questions.sweep.study import check_plan, compute, in_memory
from drumsqueal.scene import Scene
from drumsqueal.scene.plan import sample
from drumsqueal.scene.quantities import QuantityError, parse_quantity
from drumsqueal.scene.variation import Variation, unit_of
from drumsqueal.solve.linear.modes import analyse_stability
from drumsqueal.solve.motion import constant_transient
from drumsqueal.solve.transient.runge_kutta import AUTO


def study_basin(
    subject: Model | Scene,
    box: Box,
    *,
    samples: int = 200,
    seed: int = 0,
    sample_rate: float | None = None,
    tolerance: float = 1e-6,
    solver: str = AUTO,
    threads: int | None = None,
    file: str | os.PathLike[str] | None = None,
    progress: Progress = silent,
) -> Basin:
    """Find which fraction of the starts in a box leads to each attractor of a body or a scene, with 95 % intervals.

    `box` has the range of each displacement and velocity from steady sliding, in SI.
    Starts are drawn uniformly from it; number k depends on k and `seed` alone. Each is integrated until it is clear
    where it leads, as `study_onset` does. `file`, such as basin.nc, is filled on the way: a study that was stopped goes
    on with it, and one that is complete is read. Of a body `sample_rate` (Hz) is 40 times its highest frequency, or
    where nothing oscillates its fastest rate over 2π, unless given; a scene has its own sampling, tolerance and method.
    The numbers are the same for any number of `threads`.

    Raises RequestError for a box, a number of samples or a file that is of no use here, ValueError for a model that
    changes with time, SceneError, and SteadyStateError where there is no steady sliding.

    ```pycon
    >>> def block(speed):
    ...     law = drumsqueal.ExponentialLaw(0.5, 0.3, 2.0)
    ...     return drumsqueal.block_on_belt(law, belt_speed=speed, damping=0.1)
    >>> box = {"displacement": {"X": (-1, 1)}, "velocity": {"X": (-1, 1)}}
    >>> squeal = drumsqueal.study_basin(block(0.72), box, samples=16).squeal
    >>> f"{squeal.count} of {squeal.total}: {squeal.low:.2f} to {squeal.high:.2f}"
    '15 of 16: 0.72 to 0.99'
    ```
    """
    plan: Starting
    if isinstance(subject, Scene):
        plan = _plan_of_scene(subject, box, samples, seed)
    else:
        plan = body_plan(subject, box, samples, seed, _sample_rate(subject, sample_rate), tolerance, solver)
    if file is None:
        return find_basin(in_memory(plan, progress, threads), plan)
    return find_basin(_in_file(Path(file), plan, progress, threads), plan)


def _plan_of_scene(scene: Scene, box: Box, samples: int, seed: int) -> Starting:
    variations = []
    for key, ends in flat_box(box).items():
        unit = unit_of(f"start.{key}", scene)
        try:
            low, high = (parse_quantity(end, unit) for end in ends)
        except QuantityError as error:
            raise RequestError(f"box: {key}: {error}") from None
        check_range(key, low, high)
        variations.append(Variation(f"start.{key}", unit, (low, high)))
    plan = sample(scene.with_values({"uncertain": None}), variations, samples, seed=seed, transient=True)
    check_plan(plan)
    return plan


def _sample_rate(model: Model, given: float | None) -> float:
    """How densely its transients are sampled (Hz). Raises ValueError for a model that changes with time."""
    if model.forced:
        raise ValueError("a force keeps the body moving wherever it starts; leave it out")
    stability = analyse_stability(model)
    highest = stability.highest_frequency_Hz or float(np.abs(stability.eigenvalues).max()) / math.tau
    if given is None and not highest > 0:
        raise RequestError("sample_rate: nothing springs back to steady sliding, which would give it; say how many Hz")
    # 40.0 of the fastest mode, |λ|/2π: amplitudes of its motion are good to 0.3 %
    rate = 40.0 * highest if given is None else given
    constant_transient(model, {}, duration=1.0, sample_rate=rate)  # raises
    return rate


def _in_file(path: Path, plan: Points, progress: Progress, threads: int | None) -> xarray.Dataset:
    """What a file of the same study holds, or goes on to hold. Raises RequestError for a file of anything else."""
    file = SweepFile(path, plan)
    if path.exists():
        if outcome_of(path, plan) == COMPLETE:
            return file.read()
        file.take_up()
    else:
        file.create(progress)

    def here(plan: Points, left: Batches, look: Callable[[], None]) -> Iterator[tuple[int, Columns]]:
        for first, stop in left:
            yield first, compute(plan, first, stop, threads, look)

    data = fill_file(file, plan, here, progress)
    file.completed()
    return data
