"""Cycles along a parameter: branches that leave steady sliding at its Hopf points, and that of the scene's cycle."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, cast, overload

import jax
import numpy as np

from drumsqueal.errors import CycleError
from drumsqueal.outcome import Ending
from drumsqueal.physics.model import Model, build_model
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.cycle.continuation import Ended, Track
from drumsqueal.questions.cycle.diagram import (
    Branch,
    CycleBranches,
    Diagram,
    End,
    OffBranch,
    Span,
    Unfollowed,
    Why,
    steady_sliding,
)
from drumsqueal.questions.cycle.orbit import Closed, Cycle, Shooting, Start, Vector, describe, scale_near
from drumsqueal.questions.cycle.search import checked, cycle_from, find_cycle, modal_start, reach, released_start
from drumsqueal.questions.cycle.seeds import Seed, closed_from, is_branch_cycle, on_branch, settled_at
from drumsqueal.questions.cycle.words import diagram_verdict
from drumsqueal.scene import Scene
from drumsqueal.scene.variation import Variation, may_not_rest, read_variation
from drumsqueal.solve.linear.branches import Critical, follow_modes, point_at
from drumsqueal.solve.transient.sticking import can_stick

VALUES = 60  # of the parameter, at which the eigenvalues are looked at first
SMALL = 0.02  # amplitude of the first cycle near a Hopf point, over that at which the drum's speed is reached
NEAR_HOPF = 0.02  # of the range: a branch that ends there so near to a Hopf point ends at it
STICKING_STARTS = 9  # values at which motions begin at rest on the drum
KEPT_EVERY = 10  # cycles

OnBranch = Callable[[Branch], object]


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

    In place of a scene, a function of one number, which JAX can trace, gives a model: `follow_cycles(lambda speed:
    block_on_belt(law, belt_speed=speed), (0.8, 2.4)).folds`. Branches then begin at the Hopf points, where motions end
    that begin at rest on the drum, at nine values of the range, and at the seeds, as `Seed(1.3,
    {"displacement": {"X": 1.5}})`, displaced from steady sliding. Raises SceneError for a scene or a key that cannot be
    followed, and ValueError for a range that is none and for a seed that the model does not take.
    """
    if not isinstance(scene, Scene):
        low, high = sorted(cast("tuple[float, float]", along))
        if not (np.isfinite([low, high]).all() and low < high):
            raise ValueError(f"cycles are followed from one finite number to another, got {along}")
        models = _with_derivative(scene)
        diagram = follow_models(models, low, high, progress=progress, on_diagram=keep)
        family = Family(models, (low, high), partial(progress, "cycles", 0, None))
        for value in np.linspace(low, high, STICKING_STARTS):
            try:
                cycle = family.sticking_at(float(value))
            except CycleError as error:
                diagram = _lost(diagram, family, f"from rest on the drum: {error}")
                continue
            diagram = diagram if cycle is None else _with_cycle(diagram, family, cycle, "sticking ", keep)
        diagram = _with_seeds(diagram, family, seeds, progress, keep)
        whole_range = Variation("the parameter", "", (low, high))
        return diagram.model_copy(update={"verdict": diagram_verdict(diagram, whole_range)})
    variation = read_variation(along, scene, option="along", points=None) if isinstance(along, str) else along
    variation = cast("Variation", variation)
    checked_range(scene, variation)
    key, (low, high) = variation.key, sorted((variation.first, variation.last))
    # Structure hangs on the larger end: a long arc has more nodes.
    whole = scene.with_values({key: max(low, high, key=abs)})
    models = _with_derivative(lambda value: build_model(whole, {key: value}))
    span = Span.of(variation._replace(values=(variation.first, variation.last)))

    def found(diagram: Diagram, outcome: Ending) -> CycleBranches:
        critical = diagram.linear.critical
        whole = dict(diagram) | {"parameter": span, "critical_values": critical, "outcome": outcome}
        return CycleBranches(scene=scene, **whole)

    where = ""

    def on_diagram(diagram: Diagram) -> None:
        nonlocal where
        branch = diagram.branches[-1]
        where = f", branch {len(diagram.branches)}, {key} = {variation.with_unit(branch.cycles[-1].value, '.4g')}"
        if len(branch.cycles) % KEPT_EVERY == 1:
            keep(found(diagram, Ending.CUT_OFF))

    def report(what: str, done: float = 0.0, total: float | None = None) -> None:
        progress(f"{what}{where}", done, total)

    diagram = follow_models(models, low, high, progress=report, on_diagram=on_diagram)
    own = scene.numbers()[key]
    assert isinstance(own, float)
    where = ""
    family = Family(models, (low, high), partial(report, "cycles"))
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
    family = Family(models, (low, high), partial(progress, "cycles", 0, None))
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
    family: "Family",
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
    diagram: Diagram, family: "Family", cycle: Cycle, kind: str, on_diagram: Callable[[Diagram], None]
) -> Diagram:
    """The diagram with the branch of a cycle, unless that is on one of its branches."""
    if is_branch_cycle(diagram.branches, cycle, partial(family.between, cycle.value)):
        return diagram
    origin = f"from the {kind}cycle of {cycle.frequency_Hz:.6g} Hz"
    return _extended(diagram, origin, family, partial(family.both_ways, cycle), on_diagram)


def _with_seeds(
    diagram: Diagram,
    family: "Family",
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
    family: "Family",
    follow: Callable[[OnBranch], Branch],
    on_diagram: Callable[[Diagram], None],
) -> Diagram:
    """The diagram with the branch that is followed from an origin, or with a note on why there is none."""

    def extended(branch: Branch) -> Diagram:
        return diagram.model_copy(update={"branches": (*diagram.branches, branch)})

    try:
        branch = follow(lambda branch: on_diagram(extended(branch)))
    except CycleError as error:
        return _lost(diagram, family, f"{origin}: {error}")
    return _without(extended(branch), branch.not_followed(family.low, family.high))


def _lost(diagram: Diagram, family: "Family", reason: str) -> Diagram:
    """The diagram with cycles that are somewhere in the range and could not be followed."""
    if reason in diagram.notes:
        return diagram
    return _without(_noted(diagram, reason), [Unfollowed(reason=reason, low=family.low, high=family.high)])


def _without(diagram: Diagram, lost: Sequence[Unfollowed]) -> Diagram:
    return diagram.model_copy(update={"not_followed": (*diagram.not_followed, *lost)})


def _noted(diagram: Diagram, note: str) -> Diagram:
    return diagram.model_copy(update={"notes": (*diagram.notes, note)})


def _ends_at(branch: Branch, critical: Critical, width: float) -> bool:
    """Whether a branch begins or ends at a Hopf point."""
    ends = [(branch.start, branch.cycles[0]), (branch.end, branch.cycles[-1])]
    return any(
        what is End.HOPF
        and abs(cycle.value - critical.value) < NEAR_HOPF * width
        and abs(cycle.frequency_Hz / critical.frequency_Hz - 1) < NEAR_HOPF
        for what, cycle in ends
    )


class Family:
    """Models along a parameter within bounds, given with their derivative, and the branches of their cycles."""

    def __init__(
        self,
        models: Callable[[float], tuple[Model, Model]],
        bounds: tuple[float, float],
        on_flow: Callable[[], object] = lambda: None,
    ) -> None:
        """Take the models; `on_flow` is called before each integration over a period."""
        self._models, self._bounds, self.on_flow = models, bounds, on_flow
        self.low, self.high = bounds

    def model_at(self, value: float) -> Model:
        """The model at a value."""
        return self._models(value)[0]

    def steady_at(self, value: float) -> Vector | None:
        """Steady sliding (n,) at a value, None where there is none."""
        point = point_at(self.model_at, value)
        return None if point.reason else point.steady

    def from_hopf(self, critical: Critical, on_branch: OnBranch) -> Branch:
        """Follow the branch that begins with amplitude zero at a Hopf point. Raises CycleError where there is none."""
        value, model = critical.value, self.model_at(critical.value)
        point = point_at(self.model_at, value)
        mode = min(point.modes, key=lambda mode: abs(mode.growth_rate))
        amplitude = reach(model, mode)
        start = modal_start(point.steady, mode, SMALL * amplitude)
        shooting = self._shooting(value, modal_start(point.steady, mode, amplitude), point.steady)
        guess = shooting.scaled(start.state, start.period, value)
        rest = shooting.scaled(np.append(point.steady, 0 * point.steady), start.period, value)
        closed = shooting.close(guess, guess - rest)
        if closed is None:
            raise CycleError("Newton's method finds no cycle next to it")
        cycles, (end, detail) = self._follow(shooting, closed, guess - rest, End.HOPF, on_branch)
        if not cycles:
            raise CycleError(detail)
        return Branch(start=End.HOPF, end=end, end_detail=detail, cycles=tuple(cycles))

    def sticking_at(self, value: float) -> Cycle | None:
        """The cycle to which a motion leads that begins at rest on the drum; None where that does not stick again.

        Raises CycleError where it does and no cycle is found, or where it cannot be followed.
        """
        steady, model = self.steady_at(value), self.model_at(value)
        if steady is None or not can_stick(model, at_rest=False):
            return None
        self.on_flow()
        start = released_start(model, steady)
        if start is None:
            return None
        return cycle_from(model, start, steady, self.on_flow).model_copy(update={"value": value})

    def both_ways(self, cycle: Cycle, on_branch: OnBranch = lambda _: None) -> Branch:
        """Follow the branch of a cycle at a value to either side. Raises CycleError where Newton's method loses it."""
        steady = self.steady_at(cycle.value)
        if steady is None:
            raise CycleError("there is no steady sliding to measure it from")
        shooting = self._shooting(cycle.value, Start(cycle.state, cycle.period_s, ""), steady)
        closed = shooting.close(shooting.scaled(cycle.state, cycle.period_s, cycle.value))
        if closed is None:
            raise CycleError("Newton's method loses the cycle that it had found")
        upwards = np.eye(closed.unknowns.size)[-1]
        down, first = self._follow(shooting, closed, -upwards, End.CUT_OFF, on_branch)
        if first.end is End.LOOP:
            return Branch(start=End.LOOP, end=End.LOOP, cycles=tuple(down))
        up, last = self._follow(shooting, closed, upwards, End.CUT_OFF, on_branch)
        ends = {"start": first.end, "start_detail": first.detail, "end": last.end, "end_detail": last.detail}
        return Branch(**ends, cycles=(*reversed(down), *up[1:]))

    def between(self, value: float, a: Cycle, b: Cycle) -> Cycle | None:
        """The cycle of a branch at a value between two of its cycles, None where Newton's method does not find it."""
        steady, fraction = self.steady_at(value), (value - a.value) / (b.value - a.value)
        if steady is None:
            return None
        state = (1 - fraction) * a.state + fraction * b.state
        start = Start(state, (1 - fraction) * a.period_s + fraction * b.period_s, "")
        shooting = self._shooting(value, start, steady)
        closed = shooting.close(shooting.scaled(start.state, start.period, value))
        try:
            return None if closed is None else describe(shooting, closed)
        except CycleError:
            return None

    def _shooting(self, value: float, start: Start, steady: Vector) -> Shooting:
        width = self._bounds[1] - self._bounds[0]
        return Shooting(self._models, scale_near(self.model_at(value), start, steady, width), self.on_flow)

    def _follow(
        self, shooting: Shooting, closed: Closed, ahead: Vector, start: End, on_branch: OnBranch
    ) -> tuple[list[Cycle], Ended]:
        track = Track(shooting, self._bounds, self.steady_at, start, on_branch)
        ended = track.follow(closed, ahead)
        return track.cycles, ended
