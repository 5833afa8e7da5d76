"""The limit cycles of a scene or a model, at one value of its numbers and along one of them."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, ClassVar, cast, overload

import numpy as np
from pydantic import computed_field

from drumsqueal.dynamics.cycles.branches import DiagramBuilder, Seed
from drumsqueal.dynamics.cycles.cycle import Diagram
from drumsqueal.dynamics.cycles.search import FoundCycle, search
from drumsqueal.errors import CycleError, Ending
from drumsqueal.findings.schema import Findings, Parameter
from drumsqueal.physics.elasticity import check_shapes_stay
from drumsqueal.physics.model import Model, build_model
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.cycle.words import cycle_verdict, diagram_verdict
from drumsqueal.scene import Scene, SceneError
from drumsqueal.scene.shoes import check_one
from drumsqueal.scene.variation import Variation, may_not_rest, read_variation
from drumsqueal.simulation import check_constant, constant_transient
from drumsqueal.solve import motion
from drumsqueal.solve.linear.branches import Critical
from drumsqueal.solve.transient.runge_kutta import AUTO

STARTS = 9  # values at which motions begin at rest on the drum, or leave steady sliding


class CycleSearch(FoundCycle):
    """The cycle that a search found, where it was started from, what the transient does, and the other cycles."""

    printed_by = "drumsqueal.questions.cycle.answer.print_cycle"
    verdict: str
    transient: str
    others: tuple[FoundCycle, ...] = ()


class CycleStudy(Findings, CycleSearch):
    """A `CycleSearch` of a scene, with the scene: what `find_cycle(scene)` returns."""


class ParameterRange(Parameter):
    """A parameter from its lowest value to its highest."""

    @computed_field
    @property
    def low(self) -> float:
        """Its lowest value."""
        return min(self.values)

    @computed_field
    @property
    def high(self) -> float:
        """Its highest value."""
        return max(self.values)


class CycleBranches(Findings, Diagram):
    """The cycles of a scene along one of its numbers, and where modes of steady sliding gain or lose stability."""

    printed_by = "drumsqueal.questions.cycle.answer.print_branches"
    subject: ClassVar[str] = "the brake"
    outcome: Ending = Ending.COMPLETE
    parameter: ParameterRange
    critical_values: tuple[Critical, ...]


@overload
def find_cycle(scene: Scene, *, progress: Progress = ...) -> CycleStudy: ...


@overload
def find_cycle(
    scene: Model,
    start: motion.Start,
    duration: float | None = ...,
    *,
    sample_rate: float | None = ...,
    tolerance: float = ...,
    solver: str = ...,
    progress: Progress = ...,
) -> CycleSearch: ...


def find_cycle(
    scene: Scene | Model,
    start: motion.Start | None = None,
    duration: float | None = None,
    *,
    sample_rate: float | None = None,
    tolerance: float = 1e-6,
    solver: str = AUTO,
    progress: Progress = silent,
) -> CycleSearch | CycleStudy:
    """Find a periodic motion and its Floquet multipliers: `find_cycle(scene).multipliers`.

    Newton's method on the flow map over a period, started where the scene's transient ends and, where that is not
    periodic, where it nearly returns to itself and along each mode at the amplitudes at which friction gives as much
    as damping takes. Where none of that leads to a stable cycle, transients start from a disturbance along each mode,
    three times as fast as the drum, until one ends in one. A stable cycle is preferred, then the one found first.

    A model in place of a scene takes the start, duration (s) and sample rate (Hz) that `integrate` takes; by default
    200 periods of its slowest oscillation are recorded, with 20 samples in one of its fastest. Raises SceneError for a
    scene, ValueError for a model that changes with time, and CycleError where no cycle is found.

    ```pycon
    >>> def block(speed):
    ...     law = drumsqueal.ExponentialLaw(0.5, 0.3, 2.0)
    ...     return drumsqueal.block_on_belt(law, belt_speed=speed, damping=0.1)
    >>> cycle = drumsqueal.find_cycle(block(0.5), {"displacement": {"X": 0.1}}, 100.0, sample_rate=20.0)
    >>> f"{cycle.period_s:.3f} s, {cycle.amplitude['X']:.3f} m"
    '6.352 s, 0.552 m'
    ```
    """
    if isinstance(scene, Scene):
        transient, kind = constant_transient(checked(scene)), partial(CycleStudy, scene=scene)
    else:
        if scene.forced:
            raise ValueError("a cycle is free motion; this model changes with time")
        how: Any = {"duration": duration, "sample_rate": sample_rate, "tolerance": tolerance, "solver": solver}
        transient, kind = motion.constant_transient(scene, start or {}, **how), CycleSearch
    (cycle, *others), ends = search(transient, progress)
    return kind(verdict=cycle_verdict(cycle), transient=ends, others=tuple(others), **dict(cycle))


def checked(scene: Scene) -> Scene:
    """The scene, if it has one shoe, its drum speed and load are constant and nothing else drives it.

    Raises SceneError, and RequestError for several shoes.
    """
    check_one(scene.shoe)
    if scene.forcing is not None:
        raise SceneError("a cycle is free motion; leave the force out (forcing=none)", ("forcing",))
    return check_constant(scene)


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
    if isinstance(scene, Scene):
        variation = read_variation(along, scene, option="along", points=None) if isinstance(along, str) else along
        return _follow_scene(scene, cast("Variation", variation), seeds, progress, keep)
    low, high = sorted(cast("tuple[float, float]", along))
    if not (np.isfinite([low, high]).all() and low < high):
        raise ValueError(f"cycles are followed from one finite number to another, got {along}")
    found = DiagramBuilder.of(scene, low, high, progress=progress, on_diagram=keep)
    found.from_hopf_points()
    values = np.linspace(low, high, STARTS).tolist()
    for value in values:
        found.from_rest(value)
    found.from_seeds(seeds)
    for value in values:
        found.from_steady_sliding(value)
    whole_range = Variation("the parameter", "", (low, high))
    return found.diagram.model_copy(update={"verdict": diagram_verdict(found.diagram, whole_range)})


def _follow_scene(
    scene: Scene,
    variation: Variation,
    seeds: Sequence[Seed],
    progress: Progress,
    keep: Callable[[CycleBranches], None],
) -> CycleBranches:
    checked_range(scene, variation)
    key, (low, high) = variation.key, sorted((variation.first, variation.last))
    # Structure hangs on the larger end: a long arc has more nodes.
    whole = scene.with_values({key: max(low, high, key=abs)})
    span = ParameterRange.of(variation._replace(values=(variation.first, variation.last)))
    where = ""

    def branches(diagram: Diagram, outcome: Ending = Ending.CUT_OFF) -> CycleBranches:
        more = {"parameter": span, "critical_values": diagram.linear.critical, "outcome": outcome}
        return CycleBranches(scene=scene, **dict(diagram) | more)

    def on_diagram(diagram: Diagram) -> None:
        nonlocal where
        branch = diagram.branches[-1]
        where = f", branch {len(diagram.branches)}, {key} = {variation.with_unit(branch.cycles[-1].value, '.4g')}"
        if len(branch.cycles) % 10 == 1:  # what is known is kept so often
            keep(branches(diagram))

    def report(what: str, done: float = 0.0, total: float | None = None) -> None:
        progress(f"{what}{where}", done, total)

    def model_at(value: Any) -> Model:
        return build_model(whole, {key: value})

    found = DiagramBuilder.of(model_at, low, high, progress=report, on_diagram=on_diagram)
    found.from_hopf_points()
    own = scene.numbers()[key]
    assert isinstance(own, float)
    where = ""
    if low <= own <= high:
        try:
            cycles = search(constant_transient(checked(scene)), report)[0]
        except CycleError as error:
            cycles = ()
            found.note(f"at the scene's own {key}, {variation.with_unit(own, '.4g')}: {error}")
        for cycle in cycles:
            found.from_cycle(cycle.model_copy(update={"value": own}), "scene's own ")
    where = ""
    found.from_seeds(seeds)
    result = branches(found.diagram, Ending.COMPLETE)
    return result.model_copy(update={"verdict": diagram_verdict(result, variation)})


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
