"""Cycles along a parameter: branches that leave steady sliding at its Hopf points, and that of the scene's cycle."""

from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import Any, cast, overload

import jax
import numpy as np

from drumsqueal.errors import CycleError
from drumsqueal.outcome import Ending
from drumsqueal.physics.elasticity import check_shapes_stay
from drumsqueal.physics.model import Model, build_model
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.cycle.continuation import SAME
from drumsqueal.questions.cycle.diagram import (
    BEARING,
    BranchEnd,
    CycleBranch,
    CycleBranches,
    Diagram,
    OffBranch,
    ParameterRange,
    Unfollowed,
    Why,
    steady_sliding,
)
from drumsqueal.questions.cycle.family import CycleFamily, OnBranch
from drumsqueal.questions.cycle.orbit import Cycle, Event
from drumsqueal.questions.cycle.search import checked, find_cycle
from drumsqueal.questions.cycle.seeds import Seed, closed_from, is_branch_cycle, on_branch, repeats, settled_at
from drumsqueal.questions.cycle.words import diagram_verdict
from drumsqueal.scene import Scene
from drumsqueal.scene.variation import Variation, may_not_rest, read_variation
from drumsqueal.solve.linear.branches import Critical, follow_modes

VALUES = 60  # of the parameter, at which the eigenvalues are looked at first
NEAR_HOPF = 0.02  # of the range: a branch that ends there so near to a Hopf point ends at it
STARTS = 9  # values at which motions begin at rest on the drum, or leave steady sliding
SAME_VALUE = 1e-5  # of the range: what happens on two branches is found to ten times as much at least
# Of the range: how long cycles of twice a period last at least until what begins at their own end is followed. Each
# doubling is Feigenbaum's 4.67 times nearer to the next, so that all of those left lie within a thousandth.
NARROW = 3.6e-3


@overload
def follow_cycles(
    scene: Scene,
    along: str | Variation,
    *,
    seeds: Sequence[Seed] = ...,
    progress: Progress = ...,
    keep: Callable[[CycleBranches], None] = ...,
) -> CycleBranches: ...


@overload
def follow_cycles(
    scene: Callable[[Any], Model],
    along: tuple[float, float],
    *,
    seeds: Sequence[Seed] = ...,
    progress: Progress = ...,
    keep: Callable[[Diagram], None] = ...,
) -> Diagram: ...


def follow_cycles(
    scene: Scene | Callable[[Any], Model],
    along: str | Variation | tuple[float, float],
    *,
    seeds: Sequence[Seed] = (),
    progress: Progress = silent,
    keep: Callable[[Any], None] = lambda _: None,
) -> Diagram:
    """Follow the cycles of a scene along one of its numbers: `follow_cycles(scene, "drum.speed=1..60").folds`.

    Branches begin at the Hopf points of steady sliding and, where none of them leads there, at the cycle that
    `find_cycle` finds at the scene's own value. Settled motions at other values, `seeds`, such as `study.seeds` of
    `study_onset`, begin a branch each where they are periodic and lie on none; what is on none in the end is among
    `off_branches`. All is over the coordinates that the scene moves. `keep` takes what is known on the way.

    In place of a scene, a function of one number, which JAX can trace, gives a model. Branches then begin at the Hopf
    points, at seeds, as `Seed(1.3, {"displacement": {"X": 1.5}})`, displaced from steady sliding, and at nine values of
    the range: where a motion ends that begins at rest on the drum and sticks to it again, and, with no stable cycle
    known there, one that leaves unstable steady sliding. Raises SceneError for a scene or a key that cannot be
    followed, and ValueError for a range that is none and for a seed that the model does not take.

    ```pycon
    >>> def block(speed):
    ...     law = drumsqueal.ExponentialLaw(0.5, 0.3, 2.0)
    ...     return drumsqueal.block_on_belt(law, belt_speed=speed, damping=0.1)
    >>> found = drumsqueal.follow_cycles(block, (0.2, 1.5))
    >>> [tuple(round(end, 3) for end in ends) for ends in found.steady_sliding_unstable]
    [(0.2, 0.693)]
    >>> [tuple(round(end, 3) for end in ends) for ends in found.squeals_only_when_kicked]
    [(0.693, 0.872)]
    ```
    """
    if not isinstance(scene, Scene):
        low, high = sorted(cast("tuple[float, float]", along))
        if not (np.isfinite([low, high]).all() and low < high):
            raise ValueError(f"cycles are followed from one finite number to another, got {along}")
        models = _with_derivative(scene)
        diagram = follow_models(models, low, high, progress=progress, on_diagram=keep)
        family = CycleFamily(models, (low, high), partial(progress, "cycles", 0, None))
        values = np.linspace(low, high, STARTS).tolist()
        for value in values:
            try:
                cycle = family.sticking_at(value)
            except CycleError as error:
                diagram = _lost(diagram, family, f"from rest on the drum: {error}")
                continue
            diagram = diagram if cycle is None else _with_cycle(diagram, family, cycle, "sticking ", keep)
        diagram = _with_seeds(diagram, family, seeds, progress, keep)
        for value in values:
            if not any(first <= value <= last for first, last in diagram.stable_cycles):
                tried = _with_seeds(diagram, family, family.leaving(value), progress, keep)
                diagram = tried.model_copy(update={"off_branches": diagram.off_branches})  # of motions that were given
        whole_range = Variation("the parameter", "", (low, high))
        return diagram.model_copy(update={"verdict": diagram_verdict(diagram, whole_range)})
    variation = read_variation(along, scene, option="along", points=None) if isinstance(along, str) else along
    variation = cast("Variation", variation)
    checked_range(scene, variation)
    key, (low, high) = variation.key, sorted((variation.first, variation.last))
    # Structure hangs on the larger end: a long arc has more nodes.
    whole = scene.with_values({key: max(low, high, key=abs)})
    models = _with_derivative(lambda value: build_model(whole, {key: value}))
    span = ParameterRange.of(variation._replace(values=(variation.first, variation.last)))

    def found(diagram: Diagram, outcome: Ending) -> CycleBranches:
        critical = diagram.linear.critical
        whole = dict(diagram) | {"parameter": span, "critical_values": critical, "outcome": outcome}
        return CycleBranches(scene=scene, **whole)

    where = ""

    def on_diagram(diagram: Diagram) -> None:
        nonlocal where
        branch = diagram.branches[-1]
        where = f", branch {len(diagram.branches)}, {key} = {variation.with_unit(branch.cycles[-1].value, '.4g')}"
        if len(branch.cycles) % 10 == 1:  # what is known is kept so often
            keep(found(diagram, Ending.CUT_OFF))

    def report(what: str, done: float = 0.0, total: float | None = None) -> None:
        progress(f"{what}{where}", done, total)

    diagram = follow_models(models, low, high, progress=report, on_diagram=on_diagram)
    own = scene.numbers()[key]
    assert isinstance(own, float)
    where = ""
    family = CycleFamily(models, (low, high), partial(report, "cycles"))
    if low <= own <= high:
        where_own = f"at the scene's own {key}, {variation.with_unit(own, '.4g')}"
        diagram = _with_own(diagram, scene, family, (own, where_own), report, on_diagram)
    where = ""
    diagram = _with_seeds(diagram, family, seeds, report, on_diagram)
    branches = found(diagram, Ending.COMPLETE)
    return branches.model_copy(update={"verdict": diagram_verdict(branches, variation)})


def _with_derivative(model_at: Callable[[Any], Model]) -> Callable[[float], tuple[Model, Model]]:
    return jax.jit(lambda value: jax.jvp(model_at, (value,), (1.0,)))


def found_some(found: CycleBranches) -> CycleBranches:
    """What was found; raises CycleError where that is no cycle."""
    if not found.branches:
        raise CycleError("; ".join(["no cycle was found in this range", *found.notes]))
    return found


def checked_range(scene: Scene, variation: Variation) -> None:
    """Raise SceneError where cycles cannot be followed over a range of a scene's number."""
    checked(scene)
    may_not_rest(variation)
    check_shapes_stay(scene, variation.key)
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
    family = CycleFamily(models, (low, high), partial(progress, "cycles", 0, None))
    linear = follow_modes(family.model_at, np.linspace(low, high, values).tolist(), progress)
    diagram = Diagram(
        linear=linear,
        branches=(),
        steady_sliding_stable=steady_sliding(linear, low, high, stable=True),
        steady_sliding_unstable=steady_sliding(linear, low, high, stable=False),
    )
    for critical in linear.critical:
        if critical.frequency_Hz and not any(_ends_at(branch, critical, high - low) for branch in diagram.branches):
            origin = f"from the Hopf point of {critical.label} at {critical.value:.6g}"
            diagram = _extended(diagram, origin, family, partial(family.from_hopf, critical), on_diagram)
    return diagram


def _with_own(
    diagram: Diagram,
    scene: Scene,
    family: CycleFamily,
    at: tuple[float, str],
    progress: Progress,
    on_diagram: Callable[[Diagram], None],
) -> Diagram:
    """The diagram with the branches of the scene's own cycles, as far as they are none of those that are there."""
    own, words = at
    try:
        search = find_cycle(scene, progress=progress)
    except CycleError as error:
        return _noted(diagram, f"{words}: {error}")
    for cycle in (search, *search.others):
        here = cycle.model_copy(update={"value": own})
        diagram = _with_cycle(diagram, family, here, "scene's own ", on_diagram)
    return diagram


def _with_cycle(
    diagram: Diagram, family: CycleFamily, cycle: Cycle, kind: str, on_diagram: Callable[[Diagram], None]
) -> Diagram:
    """The diagram with the branch of a cycle, unless that is on one of its branches."""
    if is_branch_cycle(diagram.branches, cycle, partial(family.between, cycle.value)):
        return diagram
    origin = f"from the {kind}cycle of {cycle.frequency_Hz:.6g} Hz"
    return _extended(diagram, origin, family, partial(family.both_ways, cycle), on_diagram)


def _with_seeds(
    diagram: Diagram,
    family: CycleFamily,
    seeds: Sequence[Seed],
    progress: Progress,
    on_diagram: Callable[[Diagram], None],
) -> Diagram:
    """The diagram with the branches of settled motions, and with those that are on none in the end."""
    off: list[OffBranch] = []
    for seed in seeds:
        model, steady = family.model_at(seed.value), family.steady_at(seed.value)
        if steady is None:
            continue
        try:
            found = settled_at(seed, model, progress)
        except CycleError as error:
            why, line = Why.NOT_RECORDED, seed.frequency_Hz
            off.append(OffBranch(value=seed.value, frequency_Hz=line, amplitude={}, why=why, reason=str(error)))
            continue
        if found.at_rest:  # which is steady sliding, and no cycle
            continue
        if found.period is not None and on_branch(diagram.branches, found.period, found.amplitude, found.value):
            continue
        try:
            cycle = closed_from(found, model, steady, family.on_flow)
        except CycleError as error:
            off.append(found.off(Why.NOT_PERIODIC if found.period is None else Why.NOT_CLOSED, str(error)))
            continue
        before = len(diagram.notes)
        diagram = _with_cycle(diagram, family, cycle, f"motion found at {seed.value:.6g}, the ", on_diagram)
        off += [found.off(Why.NOT_FOLLOWED, note) for note in diagram.notes[before:]]
    return diagram.model_copy(update={"off_branches": tuple(off)})


def _extended(
    diagram: Diagram,
    origin: str,
    family: CycleFamily,
    follow: Callable[[OnBranch], CycleBranch],
    on_diagram: Callable[[Diagram], None],
) -> Diagram:
    """The diagram with the branch that is followed from an origin, or with a note on why there is none."""

    def extended(branch: CycleBranch) -> Diagram:
        return diagram.model_copy(update={"branches": (*diagram.branches, branch)})

    try:
        branch = follow(lambda branch: on_diagram(extended(branch)))
    except CycleError as error:
        return _lost(diagram, family, f"{origin}: {error}")
    before, diagram = diagram, with_branch(diagram, branch, family)
    if diagram is before:  # what begins on the branch that it is part of was followed with that
        return diagram
    followed, width = [diagram.branches[-1]], family.high - family.low
    for branch in followed:  # which grows: a branch that another one meets is followed as that is
        for cycle in branch.meeting():  # with the values that they have on other branches
            others = [each for each in diagram.branches if each is not branch]
            if any(_meet(cycle, own, width) for each in others for own in each.special):
                continue
            if branch.start is BranchEnd.DOUBLING and cycle.what is Event.DOUBLING:
                far = abs(cycle.value - branch.cycles[0].value)
                if 0 < far < NARROW * width:  # where it begins, another branch doubles, which may not be there yet
                    continue
            with suppress(CycleError):  # or what begins there stays unknown
                met = family.meeting(cycle, lambda branch: on_diagram(extended(branch)))
                before, diagram = diagram, with_branch(diagram, met, family)
                followed += diagram.branches[-1:] if diagram is not before else ()
    return diagram


def with_branch(diagram: Diagram, branch: CycleBranch, family: CycleFamily) -> Diagram:
    """The diagram with a branch in place of those that are parts of it, unless it is part of one itself."""
    if any(repeats(branch, each, family.between) for each in diagram.branches):
        return diagram
    others = tuple(each for each in diagram.branches if not repeats(each, branch, family.between))
    branches = (*others, _aligned(branch, others, family.high - family.low))
    known = _left_behind(diagram.branches, family)
    lost = [each for each in diagram.not_followed if each not in known]
    lost += _left_behind(branches, family)
    return diagram.model_copy(update={"branches": branches, "not_followed": tuple(lost)})


def _left_behind(branches: Sequence[CycleBranch], family: CycleFamily) -> list[Unfollowed]:
    found = Counter(pair for branch in branches for pair in {(each.what, each.value) for each in branch.special})
    met = {value for (what, value), count in found.items() if what in BEARING and count > 1}
    return [each for branch in branches for each in branch.not_followed(family.low, family.high, met)]


def _meet(cycle: Cycle, other: Cycle, width: float) -> bool:
    """Whether what happens at cycles of two branches is one: those branches meet there, maybe doubling their period."""
    ratio = cycle.period_s / other.period_s
    alike = min(abs(ratio - 1), abs(ratio - 2), abs(ratio - 0.5)) < SAME
    return cycle.what is other.what and alike and abs(cycle.value - other.value) < SAME_VALUE * width


def _aligned(branch: CycleBranch, others: Sequence[CycleBranch], width: float) -> CycleBranch:
    """The branch with the values of what happens on others, too, as where it meets them."""

    def aligned(cycle: Cycle) -> Cycle:
        met = (each.value for branch in others for each in branch.special if _meet(cycle, each, width))
        return cycle.model_copy(update={"value": next(met, cycle.value)})

    return branch.model_copy(update={"cycles": tuple(map(aligned, branch.cycles))})


def _lost(diagram: Diagram, family: CycleFamily, reason: str) -> Diagram:
    """The diagram with cycles that are somewhere in the range and could not be followed."""
    if reason in diagram.notes:
        return diagram
    return _without(_noted(diagram, reason), [Unfollowed(reason=reason, low=family.low, high=family.high)])


def _without(diagram: Diagram, lost: Sequence[Unfollowed]) -> Diagram:
    return diagram.model_copy(update={"not_followed": (*diagram.not_followed, *lost)})


def _noted(diagram: Diagram, note: str) -> Diagram:
    return diagram.model_copy(update={"notes": (*diagram.notes, note)})


def _ends_at(branch: CycleBranch, critical: Critical, width: float) -> bool:
    """Whether a branch begins or ends at a Hopf point."""
    ends = [(branch.start, branch.cycles[0]), (branch.end, branch.cycles[-1])]
    return any(
        what is BranchEnd.HOPF
        and abs(cycle.value - critical.value) < NEAR_HOPF * width
        and abs(cycle.frequency_Hz / critical.frequency_Hz - 1) < NEAR_HOPF
        for what, cycle in ends
    )
