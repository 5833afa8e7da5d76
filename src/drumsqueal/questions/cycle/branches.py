"""Cycles along a parameter: branches that leave steady sliding at its Hopf points, and that of the scene's cycle."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, cast, overload

import jax
import numpy as np

from drumsqueal.errors import CycleError
from drumsqueal.findings.outcome import Ending
from drumsqueal.physics.model import Model, build_model
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.cycle.continuation import Branch, End, Track, is_between
from drumsqueal.questions.cycle.diagram import CycleBranches, Diagram, Span, steady_sliding
from drumsqueal.questions.cycle.orbit import Cycle
from drumsqueal.questions.cycle.search import checked, find_cycle, scales_of
from drumsqueal.questions.cycle.shooting import Models, Shooting, Vector
from drumsqueal.questions.cycle.starts import Start, modal_start, reach
from drumsqueal.questions.cycle.words import diagram_verdict
from drumsqueal.scene import Scene
from drumsqueal.scene.variation import Variation, may_not_rest, read_variation
from drumsqueal.solve.linear.branches import Critical, follow_modes, point_at
from drumsqueal.solve.linear.modes import Mode

VALUES = 60  # of the parameter, at which the eigenvalues are looked at first
SMALL = 0.02  # amplitude of the first cycle near a Hopf point, over that at which the drum's speed is reached
NEAR_HOPF = 0.02  # of the range: a branch that ends there so near to a Hopf point ends at it
KEPT_EVERY = 10  # cycles

OnTrack = Callable[[Track], object]


@overload
def follow_cycles(
    scene: Scene,
    along: str | Variation,
    *,
    progress: Progress = ...,
    keep: Callable[[CycleBranches], None] = ...,
) -> CycleBranches: ...


@overload
def follow_cycles(
    scene: Callable[[Any], Model],
    along: tuple[float, float],
    *,
    progress: Progress = ...,
    keep: Callable[[Diagram], None] = ...,
) -> Diagram: ...


def follow_cycles(
    scene: Scene | Callable[[Any], Model],
    along: str | Variation | tuple[float, float],
    *,
    progress: Progress = silent,
    keep: Callable[[Any], None] = lambda _: None,
) -> Diagram:
    """Follow the cycles of a scene along one of its numbers: `follow_cycles(scene, "drum.speed=1..60").folds`.

    Branches begin at the Hopf points of steady sliding and, where none of them leads there, at the cycle that
    `find_cycle` finds at the scene's own value. All is over the coordinates that the scene moves. `keep` takes what is
    known on the way.

    In place of a scene, a function of one number, which JAX can trace, gives a model: `follow_cycles(lambda speed:
    block_on_belt(law, belt_speed=speed), (0.8, 2.4)).folds`. Branches then begin at the Hopf points alone. Raises
    SceneError for a scene or a key that cannot be followed.
    """
    if not isinstance(scene, Scene):
        low, high = sorted(cast("tuple[float, float]", along))
        models = jax.jit(lambda value: jax.jvp(scene, (value,), (1.0,)))
        return follow_models(models, low, high, progress=progress, on_diagram=keep)
    known = not isinstance(along, str)
    variation = cast("Variation", along) if known else read_variation(along, scene, option="along", points=None)
    checked_range(scene, variation)
    key, (low, high) = variation.key, sorted((variation.first, variation.last))
    own = scene.numbers()[key]
    assert isinstance(own, float)
    # Structure hangs on the larger end: a long arc has more nodes.
    whole = scene.with_values({key: max(low, high, key=abs)})
    models = jax.jit(lambda value: jax.jvp(lambda number: build_model(whole, {key: number}), (value,), (1.0,)))
    span = Span.of(variation._replace(values=(variation.first, variation.last)))

    def found(diagram: Diagram, outcome: Ending) -> CycleBranches:
        critical = diagram.linear.critical
        branches = CycleBranches(
            scene=scene, outcome=outcome, parameter=span, critical_values=critical, **dict(diagram)
        )
        complete = outcome is Ending.COMPLETE
        return branches.model_copy(update={"verdict": diagram_verdict(branches, variation)}) if complete else branches

    where = ""

    def on_diagram(diagram: Diagram) -> None:
        nonlocal where
        branch = diagram.branches[-1]
        where = f", branch {len(diagram.branches)}, {key} = {variation.with_unit(branch.cycles[-1].value, '.4g')}"
        if len(branch.cycles) % KEPT_EVERY == 1:
            keep(found(diagram, Ending.CUT_OFF))

    def report(what: str, done: float = 0.0, total: float | None = None) -> None:
        progress(f"{what}{where}", done, total)

    diagram = follow_models(models, low, high, VALUES, progress=report, on_diagram=on_diagram)
    if low <= own <= high:
        where = ""
        diagram = _with_own(diagram, scene, models, own, (low, high), report, on_diagram)
    return found(diagram, Ending.COMPLETE)


def found_some(found: CycleBranches) -> CycleBranches:
    """What was found; raises CycleError where that is no cycle."""
    if not found.branches:
        raise CycleError("; ".join(["no cycle was found in this range", *found.notes]))
    return found


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
    *,
    progress: Progress = silent,
    on_diagram: Callable[[Diagram], None] = lambda _: None,
) -> Diagram:
    """Follow the branches of cycles from all Hopf points of a family of models, which is given with its derivative.

    `on_diagram` takes what is known after each cycle.
    """
    linear = follow_modes(lambda value: models(value)[0], np.linspace(low, high, values).tolist(), progress)
    branches: list[Branch] = []
    notes: list[str] = []
    stable, unstable = (steady_sliding(linear, low, high, stable=wanted) for wanted in (True, False))

    def found(*others: Branch) -> Diagram:
        return Diagram(
            linear=linear,
            branches=(*branches, *others),
            notes=tuple(notes),
            steady_sliding_stable=stable,
            steady_sliding_unstable=unstable,
        )

    def on_track(track: Track) -> None:
        on_diagram(found(Branch(start=End.HOPF, end=End.CUT_OFF, cycles=tuple(track.cycles))))

    for critical in linear.critical:
        if not critical.frequency_Hz or any(_ends_at(branch, critical, high - low) for branch in branches):
            continue
        try:
            branches.append(_from_hopf(models, critical, (low, high), on_track, _beat(progress)))
        except CycleError as error:
            notes.append(f"from the Hopf point of {critical.label} at {critical.value:.6g}: {error}")
    return found()


def _beat(progress: Progress) -> Callable[[], None]:
    """What is called before each integration over a period."""
    return lambda: progress("cycles", 0, None)


def _from_hopf(
    models: Models,
    critical: Critical,
    bounds: tuple[float, float],
    on_track: OnTrack,
    on_flow: Callable[[], None] = lambda: None,
) -> Branch:
    """Follow the branch that begins with amplitude zero at a Hopf point."""
    model = models(critical.value)[0]
    point = point_at(lambda value: models(value)[0], critical.value)
    mode = min(point.modes, key=lambda mode: abs(mode.growth_rate))
    start, whole = _small(model, point.steady, mode)
    shooting = Shooting(models, scales_of(model, whole, point.steady, _scale(bounds)), on_flow)
    guess = shooting.scaled(start.state, start.period, critical.value)
    rest = shooting.scaled(np.concatenate([point.steady, 0 * point.steady]), start.period, critical.value)
    outwards = guess - rest
    closed = shooting.close(guess, outwards)
    if closed is None:
        raise CycleError("Newton's method finds no cycle next to it")
    track = Track(shooting, bounds, _steady(models), on_track)
    end = track.follow(closed, outwards)
    if not track.cycles:
        raise CycleError(end)
    return Branch(start=End.HOPF, end=end, cycles=tuple(track.cycles))


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
        what == End.HOPF
        and abs(cycle.value - critical.value) < NEAR_HOPF * width
        and abs(cycle.frequency_Hz / critical.frequency_Hz - 1) < NEAR_HOPF
        for what, cycle in ends
    )


def _with_own(
    diagram: Diagram,
    scene: Scene,
    models: Models,
    own: float,
    bounds: tuple[float, float],
    progress: Progress,
    on_diagram: Callable[[Diagram], None],
) -> Diagram:
    """The diagram with the branch of the scene's own cycle, if it is none of those that are there."""
    branches, notes = list(diagram.branches), list(diagram.notes)

    def found(*others: Branch) -> Diagram:
        return diagram.model_copy(update={"branches": (*branches, *others), "notes": tuple(notes)})

    def on_track(track: Track) -> None:
        on_diagram(found(Branch(start=End.CUT_OFF, end=End.CUT_OFF, cycles=tuple(track.cycles))))

    cycles: Sequence[Cycle] = ()
    try:
        search = find_cycle(scene, progress=progress)
        cycles = (search, *search.others)
    except CycleError as error:
        notes.append(f"at the scene's own value: {error}")
    for cycle in cycles:
        here = cycle.model_copy(update={"value": own})
        if any(is_between(a, b, here) for branch in branches for a, b in pairwise(branch.cycles)):
            continue
        try:
            branches.append(_both_ways(models, cycle, own, bounds, on_track, _beat(progress)))
        except CycleError as error:
            notes.append(f"from the scene's own cycle of {cycle.frequency_Hz:.6g} Hz: {error}")
    return found()


def _both_ways(
    models: Models,
    cycle: Cycle,
    own: float,
    bounds: tuple[float, float],
    on_track: OnTrack,
    on_flow: Callable[[], None] = lambda: None,
) -> Branch:
    model = models(own)[0]
    steady_at = _steady(models)
    steady = steady_at(own)
    if steady is None:
        raise CycleError("there is no steady sliding to measure it from")
    start = Start(cycle.state, cycle.period_s, "")
    shooting = Shooting(models, scales_of(model, start, steady, _scale(bounds)), on_flow)
    guess = shooting.scaled(cycle.state, cycle.period_s, own)
    along = np.zeros_like(guess)
    along[-1] = 1.0
    closed = shooting.close(guess, along)
    if closed is None:
        raise CycleError("Newton's method loses the cycle that it had found")
    parts, ends = [], []
    for sign in (-1.0, 1.0):
        track = Track(shooting, bounds, steady_at, on_track)
        ends.append(track.follow(closed, sign * along))
        parts.append(track.cycles)
        if ends[0] == End.LOOP:
            return Branch(start=End.LOOP, end=End.LOOP, cycles=tuple(track.cycles))
    down, up = parts
    return Branch(start=ends[0], end=ends[1], cycles=(*reversed(down), *up[1:]))
