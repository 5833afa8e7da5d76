"""Many scenes: the stability of each and, where it is asked for, its steady-state response."""

import math
import os
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np
import xarray

from drumsqueal.errors import NoSteadySliding, SteadyStateError
from drumsqueal.findings.decay import BEYOND
from drumsqueal.findings.history import COMPLETE
from drumsqueal.findings.saturated import Saturated, saturated_motions
from drumsqueal.physics.composition import compose, moved_coordinates
from drumsqueal.physics.model import build_model
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.sweep.points import (
    AT_REST,
    COMPUTED,
    FAILED,
    FOLDED,
    MODES,
    NOT_FINITE,
    NOT_FOUND,
    NOT_TAKEN,
    TRENDS,
    Columns,
    blank,
    to_dataset,
)
from drumsqueal.scene import COORDINATES, Profile, Scene, SceneError
from drumsqueal.scene.plan import Plan, grid, sample
from drumsqueal.scene.quantities import parse_quantity
from drumsqueal.scene.variation import Variation, unit_of
from drumsqueal.solve.linear.family import BLOCK, analyse_many
from drumsqueal.solve.linear.modes import Stability

STILL = 0.1  # of the linear growth rate: what changes so slowly has settled
MOST_ROUNDS = 16  # times the scene's duration that a transient may take to settle
BATCH, BATCH_OF_TRANSIENTS = 8 * BLOCK, 32  # points
_REASONS = {
    NoSteadySliding.AT_REST: AT_REST,
    NoSteadySliding.NOT_FOUND: NOT_FOUND,
    NoSteadySliding.NOT_FINITE: NOT_FINITE,
}


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
    """
    variations = [_variation(scene, key, values) for key, values in (vary or {}).items()]
    if random:
        plan = sample(scene, variations, random, seed=seed, transient=transient)
    else:
        plan = grid(scene, variations, transient=transient)
    check_plan(plan)
    columns = blank(plan, plan.points)
    for first, stop in batches(plan):
        look = partial(progress, "sweeping", first, plan.points)
        for name, values in compute(plan, first, stop, look=look).items():
            columns[name][first:stop] = values
        progress("sweeping", stop, plan.points)
    return to_dataset(plan, columns, COMPLETE)


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


def batches(plan: Plan) -> list[tuple[int, int]]:
    """The first point, and the one after the last, of the batches that work goes in."""
    size = BATCH_OF_TRANSIENTS if plan.transient else BATCH
    return [(first, min(first + size, plan.points)) for first in range(0, plan.points, size)]


def check_plan(plan: Plan) -> None:
    """Raise SceneError where no transient can be computed."""
    if not plan.transient:
        return
    if not moved_coordinates(plan.scene):
        cure = "start something, such as displacement = { Y = 1e-7 }"
        raise SceneError(f"nothing moves in the transients; {cure}", ("start",))
    speed = plan.scene.drum.speed
    if isinstance(speed, Profile) and speed.value[0] == 0:
        cure = "the transients of a sweep start from steady sliding; give the drum a speed at t = 0"
        raise SceneError(cure, ("drum", "speed"))


def compute(
    plan: Plan, first: int, stop: int, threads: int | None = None, look: Callable[[], None] = lambda: None
) -> Columns:
    """Every variable at the points from number `first` to `stop`; the batch they come in changes not a bit of them.

    `look` is called between two steps.
    """
    columns = blank(plan, stop - first)
    scenes: dict[int, Scene] = {}
    for k, values in enumerate(plan.values(first, stop)):
        try:
            scenes[k] = plan.scene_at(values)
        except SceneError:
            columns["outcome"][k] = NOT_TAKEN
    found = dict(zip(scenes, analyse_many(list(scenes.values())), strict=True))
    for k, stability in found.items():
        if isinstance(stability, SteadyStateError):
            columns["outcome"][k] = _REASONS[stability.reason]
        else:
            _note_stability(columns, k, stability)
    if plan.transient:
        look()
        sound = {k: each for k, each in found.items() if isinstance(each, Stability)}
        _transients(columns, scenes, sound, threads or os.cpu_count() or 1, look)
    return columns


def _note_stability(columns: Columns, k: int, stability: Stability) -> None:
    assert len(stability.modes) <= MODES
    for rank, mode in enumerate(stability.modes):
        columns["growth_rate"][k, rank] = mode.growth_rate
        columns["frequency"][k, rank] = mode.frequency_Hz
        columns["unstable"][k, rank] = mode.unstable
        columns["mode_coordinate"][k, rank] = COORDINATES.index(mode.name)
    columns["largest_growth_rate"][k] = max((mode.growth_rate for mode in stability.modes), default=np.nan)
    columns["squeal"][k] = bool(stability.unstable)
    columns["divergence_rate"][k] = stability.divergence or 0.0
    columns["contact_fraction"][k] = stability.contact_fraction
    columns["smallest_pressure"][k], columns["largest_pressure"][k] = stability.pressure_range
    columns["outcome"][k] = COMPUTED


def _transients(
    columns: Columns,
    scenes: Mapping[int, Scene],
    found: Mapping[int, Stability],
    threads: int,
    look: Callable[[], None],
) -> None:
    """Integrate the scenes, those that call for the same effects together."""
    groups: dict[Any, list[int]] = {}
    for k, stability in found.items():
        if scenes[k].simulate.sample_rate < 2 * stability.highest_frequency_Hz:
            columns["outcome"][k] = FOLDED
        else:
            groups.setdefault(compose(scenes[k]), []).append(k)
    for members in groups.values():
        some = scenes[members[0]]
        duration = some.simulate.duration
        models = {k: build_model(scenes[k]) for k in members}
        names = models[members[0]].names
        places = [found[members[0]].coordinates.index(name) for name in names]
        tables = some.start.displacement, some.start.velocity
        displacement, velocity = (np.array([table.get(name, 0.0) for name in names]) for table in tables)
        before: dict[int, Saturated | None] = dict.fromkeys(members)  # how the last round of what goes on ended
        for number in range(1, most_rounds(some) + 1):
            look()
            motions = saturated_motions(
                [models[k] for k in before],
                [found[k].steady_state[places] for k in before],
                [displacement if motion is None else motion.vibration for motion in before.values()],
                [velocity if motion is None else motion.velocity for motion in before.values()],
                duration=duration,
                sample_rate=some.simulate.sample_rate,
                tolerance=some.simulate.tolerance,
                solver=some.simulate.solver,
                threads=threads,
            )
            for k, motion in zip(tuple(before), motions, strict=True):
                settled = has_settled(motion, found[k], _rate_since(before[k], motion, duration))
                _note_motion(columns, k, motion, names, settled=settled)
                columns["simulated"][k] = number * duration
                before[k] = motion
                if settled:
                    del before[k]
            if not before:
                break


def _rate_since(before: Saturated | None, motion: Saturated, seconds: float) -> float:
    """Mean growth rate (1/s) of the rms velocity since the round before, infinite where there is none."""
    if before is None or not (before.kinetic_energy > 0 and motion.kinetic_energy > 0):
        return math.inf
    return math.log(motion.kinetic_energy / before.kinetic_energy) / 2 / seconds


def most_rounds(scene: Scene) -> int:
    """How many times its duration a transient may take to settle; once where time itself matters."""
    changes = isinstance(scene.drum.speed, Profile) or isinstance(scene.contact.normal_load, Profile)
    return 1 if changes or scene.forcing is not None else MOST_ROUNDS


def has_settled(motion: Saturated, stability: Stability, earlier_rate: float = math.inf) -> bool:
    """Whether the attractor of a transient is known: a sustained motion or, where every mode decays, steady sliding.

    Where a mode grows, motion below the contact boundary has not settled, however slowly it changes. Motion beyond it
    has where its rate, from half to half of what is looked at or since the round before (`earlier_rate`, 1/s), is below
    a tenth of the linear one: of a slow growth a tenth of the motion is soon gained.
    """
    if motion.failed or motion.at_rest:
        return True
    beyond = max(motion.boundary_ratios) >= BEYOND
    growing = [mode.growth_rate for mode in stability.unstable]
    growing += [] if stability.divergence is None else [stability.divergence]
    if not growing:
        return motion.trend == "settled" or (motion.trend == "decays" and not beyond)
    slow = min(abs(motion.rate), abs(earlier_rate)) < STILL * max(growing)
    return beyond and motion.trend == "settled" and slow


def _note_motion(columns: Columns, k: int, motion: Saturated, names: tuple[str, ...], *, settled: bool) -> None:
    columns["trend"][k] = TRENDS.index(motion.trend)
    if motion.failed:
        columns["outcome"][k] = FAILED
        return
    columns["settled"][k] = settled
    columns["amplitude"][k] = 0.0  # of coordinates that the transient leaves out
    columns["amplitude"][k, [COORDINATES.index(name) for name in names]] = motion.amplitude
    columns["separation_share"][k], columns["reversal_share"][k] = motion.boundary_ratios
    if motion.frequency_Hz is not None and motion.line is not None:
        columns["main_frequency"][k] = motion.frequency_Hz
        columns["main_coordinate"][k] = COORDINATES.index(motion.line)
