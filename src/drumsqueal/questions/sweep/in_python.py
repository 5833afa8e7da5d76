"""Sweeps as Python asks for them: of the numbers of a scene, the starts of a brake or a body, or a table of scenes."""

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from drumsqueal.errors import COMPLETE, RequestError
from drumsqueal.physics.model import Model
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.sweep.file import SweepFile, fill_file, here, in_memory, outcome_of
from drumsqueal.questions.sweep.found import Basin, find_basin
from drumsqueal.questions.sweep.matrix_cells import NoiseMatrix, find_matrix
from drumsqueal.questions.sweep.matrix_plan import read_matrix
from drumsqueal.questions.sweep.points import BodyPlan, Box, Points, Starting, in_si, read_box
from drumsqueal.questions.sweep.study import check_plan
from drumsqueal.scene import Scene, SceneError
from drumsqueal.scene.plan import check_number_of_samples, grid, sample
from drumsqueal.scene.quantities import QuantityError, parse_quantity
from drumsqueal.scene.variation import Variation, unit_of
from drumsqueal.solve.linear.modes import analyse_stability
from drumsqueal.solve.motion import constant_transient
from drumsqueal.solve.transient.runge_kutta import AUTO


def sweep_parameters(
    scene: Scene,
    vary: Mapping[str, Iterable[Any]] | None = None,
    *,
    random: int = 0,
    seed: int = 0,
    transient: bool = False,
    progress: Progress = silent,
) -> xarray.Dataset:
    """Eigenvalues, and with `transient` the steady-state response, of a scene with other numbers.

    `vary` has the values of each number by its dotted key, in SI or with a unit: the results lie along every
    combination of them, `sweep_parameters(scene, {"drum.speed": [1, 2, 5]})["growth_rate"]`. With `random`, so many
    random samples: of the scene's table `uncertain` and, uniformly, between the smallest and the largest value of each
    in `vary`. Sample k depends on k and `seed` alone. The variables and their units are in the Dataset; a number that
    is NaN has its reason in `outcome`. `progress` takes how many points are computed. Raises SceneError and
    RequestError for what cannot be swept.

    ```pycon
    >>> scene = drumsqueal.load_scene("damped")
    >>> found = drumsqueal.sweep_parameters(scene, {"drum.speed": [5, 20], "damping.ratio": [0.005, 0.02]})
    >>> found["largest_growth_rate"].values.round(1)  # 1/s
    array([[  32.9,  -97. ],
           [ -26.5, -157. ]])
    ```
    """
    variations = [_variation(scene, key, values) for key, values in (vary or {}).items()]
    if random:
        plan = sample(scene, variations, random, seed=seed, transient=transient)
    else:
        plan = grid(scene, variations, transient=transient)
    check_plan(plan)
    return in_memory(plan, progress)


def _variation(scene: Scene, key: str, values: Iterable[Any]) -> Variation:
    unit, read = unit_of(key, scene), []
    for value in values:
        try:
            read.append(parse_quantity(value.item() if isinstance(value, np.generic) else value, unit))
            scene.with_values({key: read[-1]})
        except SceneError as error:
            raise SceneError(error.reason, (key,), value) from None
    if not read:
        raise SceneError("there are no values; give it one at least", (key,))
    return Variation(key, unit, tuple(read))


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
        rate = _sample_rate(subject, sample_rate)
        check_number_of_samples(samples, seed)
        plan = BodyPlan(subject, read_box(box, in_si(subject.names)), samples, seed, rate, tolerance, solver)
    if file is None:
        return find_basin(in_memory(plan, progress, threads), plan)
    return find_basin(_in_file(Path(file), plan, progress, threads), plan)


def _plan_of_scene(scene: Scene, box: Box, samples: int, seed: int) -> Starting:
    def read(key: str, ends: Sequence[Any]) -> tuple[float, float]:
        unit = unit_of(f"start.{key}", scene)
        try:
            low, high = (parse_quantity(end, unit) for end in ends)
        except QuantityError as error:
            raise RequestError(f"box: {key}: {error}") from None
        return low, high

    ranges = {f"start.{key}": (each.low, each.high) for key, each in read_box(box, read).items()}
    variations = [Variation(key, unit_of(key, scene), ends) for key, ends in ranges.items()]
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
    if not path.exists():
        file.create(progress)
    elif outcome_of(path, plan) == COMPLETE:
        return file.read()
    else:
        file.take_up()
    data = fill_file(file, plan, partial(here, threads=threads), progress)
    file.completed()
    return data


def study_matrix(
    path: str | os.PathLike[str], *, threads: int | None = None, progress: Progress = silent
) -> NoiseMatrix:
    """Find which of the scenes in a table squeal, in which procedure: `study_matrix("matrix.toml").cells`.

    Raises SceneError and RequestError for a table that is none.
    """
    plan = read_matrix(Path(path))
    return find_matrix(in_memory(plan, progress, threads), plan)
