"""Cycles along a parameter: branches that leave steady sliding at its Hopf points, and that of the scene's cycle."""

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import jax
import numpy as np

from drumsqueal.errors import CycleError
from drumsqueal.physics.model import Model, build_model
from drumsqueal.questions.cycle.continuation import HOPF, LOOP, Branch, Track, is_between
from drumsqueal.questions.cycle.orbit import Cycle
from drumsqueal.questions.cycle.search import checked, find_cycle, scales_of
from drumsqueal.questions.cycle.shooting import Models, Shooting, Vector
from drumsqueal.questions.cycle.starts import Start, modal_start, reach
from drumsqueal.scene import Scene
from drumsqueal.scene.variation import Variation, may_not_rest, read_variation
from drumsqueal.solve.linear.branches import Branches, Critical, follow_modes, point_at
from drumsqueal.solve.linear.modes import Mode

VALUES = 60  # of the parameter, at which the eigenvalues are looked at first
SMALL = 0.02  # amplitude of the first cycle near a Hopf point, over that at which the drum's speed is reached
NEAR_HOPF = 0.02  # of the range: a branch that ends there so near to a Hopf point ends at it

OnCycle = Callable[[int, Cycle], None]  # the number of the branch, and its next cycle


class Diagram(NamedTuple):
    """Modes of steady sliding and branches of cycles along a parameter from `low` to `high`.

    `notes` says what was looked for and not found.
    """

    linear: Branches
    branches: tuple[Branch, ...]
    low: float
    high: float
    notes: tuple[str, ...] = ()
    key: str = ""
    scene: Scene | None = None


def follow_cycle(scene: Scene, key: str, low: float, high: float, on_cycle: OnCycle | None = None) -> Diagram:
    """Follow the cycles of a scene along one of its numbers, by dotted key, from `low` to `high` (SI).

    Branches begin at the Hopf points of steady sliding and, where none of them leads there, at the cycle that
    `find_cycle` finds at the scene's own value. All is over the coordinates that the scene moves. Raises SceneError for
    a scene or a key that cannot be followed.
    """
    variation = read_variation(f"{key}={low!r}..{high!r}", scene, option="along", points=None)
    checked_range(scene, variation)
    low, high = sorted(variation.values)
    own = scene.numbers()[key]
    assert isinstance(own, float)
    # Structure hangs on the larger end: a long arc has more nodes.
    whole = scene.with_values({key: max(variation.values, key=abs)})
    models = jax.jit(lambda value: jax.jvp(lambda number: build_model(whole, {key: number}), (value,), (1.0,)))
    diagram = follow_models(models, low, high, VALUES, on_cycle)
    if low <= own <= high:
        diagram = _with_own(diagram, scene, models, own, on_cycle)
    return diagram._replace(key=key, scene=scene)


def checked_range(scene: Scene, variation: Variation) -> None:
    """Raise SceneError where cycles cannot be followed over a range of a scene's number."""
    checked(scene)
    may_not_rest(variation)
    for value in variation.values:
        checked(scene.with_values({variation.key: value}))


def follow_models(
    models: Callable[[float], tuple[Model, Model]],
    low: float,
    high: float,
    values: int = VALUES,
    on_cycle: OnCycle | None = None,
) -> Diagram:
    """Follow the branches of cycles from all Hopf points of a family of models, which is given with its derivative."""
    linear = follow_modes(lambda value: models(value)[0], np.linspace(low, high, values).tolist())
    branches: list[Branch] = []
    notes: list[str] = []
    for critical in linear.critical:
        if not critical.frequency_Hz or any(_ends_at(branch, critical, high - low) for branch in branches):
            continue
        try:
            branches.append(_from_hopf(models, critical, (low, high), partial(on_cycle or _nothing, len(branches))))
        except CycleError as error:
            notes.append(f"from the Hopf point of {critical.label} at {critical.value:.6g}: {error}")
    return Diagram(linear, tuple(branches), low, high, tuple(notes))


def _nothing(branch: int, cycle: Cycle) -> None:
    del branch, cycle


def _from_hopf(
    models: Models, critical: Critical, bounds: tuple[float, float], on_cycle: Callable[[Cycle], None]
) -> Branch:
    """Follow the branch that begins with amplitude zero at a Hopf point."""
    model = models(critical.value)[0]
    point = point_at(lambda value: models(value)[0], critical.value)
    mode = min(point.modes, key=lambda mode: abs(mode.growth_rate))
    start, whole = _small(model, point.steady, mode)
    shooting = Shooting(models, scales_of(model, whole, point.steady, _scale(bounds)))
    guess = shooting.scaled(start.state, start.period, critical.value)
    rest = shooting.scaled(np.concatenate([point.steady, 0 * point.steady]), start.period, critical.value)
    outwards = guess - rest
    closed = shooting.close(guess, outwards)
    if closed is None:
        raise CycleError("Newton's method finds no cycle beside it")
    track = Track(shooting, bounds, _steady(models), on_cycle)
    end = track.follow(closed, outwards)
    if not track.cycles:
        raise CycleError(end)
    return Branch(tuple(track.cycles), tuple(track.special), HOPF, end)


def _small(model: Model, steady: Vector, mode: Mode) -> tuple[Start, Start]:
    """A small motion along a mode, and one in which the lining gets as fast as the drum."""
    amplitude = reach(model, mode)
    shape = mode.right[: len(steady)]
    return modal_start(steady, mode, shape, SMALL * amplitude), modal_start(steady, mode, shape, amplitude)


def _scale(bounds: tuple[float, float]) -> float:
    return bounds[1] - bounds[0]


def _steady(models: Models) -> Callable[[float], Vector | None]:
    """Steady sliding at a value, None where there is none."""

    def at(value: float) -> Vector | None:
        point = point_at(lambda number: models(number)[0], value)
        return None if point.reason else point.steady

    return at


def _ends_at(branch: Branch, critical: Critical, width: float) -> bool:
    """Whether a branch begins or ends at a Hopf point."""
    ends = [(branch.start, branch.cycles[0]), (branch.end, branch.cycles[-1])]
    return any(
        what == HOPF
        and abs(cycle.parameter - critical.value) < NEAR_HOPF * width
        and abs(cycle.frequency_Hz / critical.frequency_Hz - 1) < NEAR_HOPF
        for what, cycle in ends
    )


def _with_own(diagram: Diagram, scene: Scene, models: Models, own: float, on_cycle: OnCycle | None) -> Diagram:
    """The diagram with the branch of the scene's own cycle, if it is none of those that are there."""
    try:
        search = find_cycle(scene)
    except CycleError as error:
        return diagram._replace(notes=(*diagram.notes, f"at the scene's own value: {error}"))
    branches, notes = list(diagram.branches), list(diagram.notes)
    for cycle in (search.cycle, *search.others):
        here = cycle._replace(parameter=own)
        if any(is_between(a, b, here) for branch in branches for a, b in pairwise(branch.cycles)):
            continue
        track = partial(on_cycle or _nothing, len(branches))
        try:
            branches.append(_both_ways(models, cycle, own, (diagram.low, diagram.high), track))
        except CycleError as error:
            notes.append(f"from the scene's own cycle of {cycle.frequency_Hz:.6g} Hz: {error}")
    return diagram._replace(branches=tuple(branches), notes=tuple(notes))


def _both_ways(
    models: Models, cycle: Cycle, own: float, bounds: tuple[float, float], on_cycle: Callable[[Cycle], None]
) -> Branch:
    model = models(own)[0]
    steady_at = _steady(models)
    steady = steady_at(own)
    if steady is None:
        raise CycleError("there is no steady sliding to measure it from")
    start = Start(cycle.state, cycle.period_s, "")
    shooting = Shooting(models, scales_of(model, start, steady, _scale(bounds)))
    guess = shooting.scaled(cycle.state, cycle.period_s, own)
    along = np.zeros_like(guess)
    along[-1] = 1.0
    closed = shooting.close(guess, along)
    if closed is None:
        raise CycleError("Newton's method loses the cycle that it had found")
    parts, ends = [], []
    for sign in (-1.0, 1.0):
        track = Track(shooting, bounds, steady_at, on_cycle)
        ends.append(track.follow(closed, sign * along))
        parts.append(track)
        if ends[0] == LOOP:
            return Branch(tuple(track.cycles), tuple(track.special), LOOP, LOOP)
    down, up = parts
    cycles = (*reversed(down.cycles), *up.cycles[1:])
    return Branch(cycles, (*reversed(down.special), *up.special), *ends)
