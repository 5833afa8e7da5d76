"""The limit cycles of a scene or a model, at one value of its numbers and along one of them, and in sentences."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, ClassVar, cast, overload

import numpy as np
from pydantic import computed_field

from drumsqueal.dynamics.cycles.branches import DiagramBuilder, Seed
from drumsqueal.dynamics.cycles.cycle import BranchEnd, Cycle, CycleBranch, Diagram, Event, OffBranch
from drumsqueal.dynamics.cycles.search import FoundCycle, search
from drumsqueal.errors import CycleError, Ending
from drumsqueal.findings.schema import Findings, Parameter
from drumsqueal.findings.squeals import Interval
from drumsqueal.findings.vibration import amplitudes_apart
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.elasticity import check_shapes_stay
from drumsqueal.physics.model import Model, at_lining, build_model
from drumsqueal.progress import Progress, silent
from drumsqueal.scene import Scene, SceneError
from drumsqueal.scene.quantities import percent
from drumsqueal.scene.shoes import check_one
from drumsqueal.scene.variation import Variation, may_not_rest, read_variation
from drumsqueal.simulation import check_constant, constant_transient
from drumsqueal.solve import motion
from drumsqueal.solve.linear.branches import Critical
from drumsqueal.solve.motion import pulling_sentence, smallest_force
from drumsqueal.solve.transient.runge_kutta import AUTO

ALIKE = 0.7  # logarithm of the ratio of amplitudes at neighbouring values of one motion
UNPROVEN = "which does not prove that there is none"
WHOLE = 100.0  # Hz, from which on frequencies are given without decimals


def cycle_verdict(cycle: Cycle) -> str:
    """What the cycle is, and what a small disturbance does on it."""
    brief = describe_briefly(cycle)
    surface = "lining" if isinstance(cycle.model.contact, Contact) else "contact surface"
    phases = "one phase" if cycle.sticking_phases == 1 else f"{cycle.sticking_phases} phases"
    sticks = f", sticking as a whole for {percent(cycle.sticking_fraction)} of the period in {phases}"
    return (
        f"{brief[0].upper()}{brief[1:]}, with {percent(cycle.contact_fraction)} of the {surface} in contact and the "
        f"slip reversed on {percent(cycle.slip_reversed_fraction)} of it on average"
        f"{sticks if cycle.sticking_phases else ''}: {_disturbed(cycle)}.{_pull([cycle])}"
    )


def describe_briefly(cycle: Cycle) -> str:
    """Stability, frequency and amplitude of a cycle."""
    name = cycle.main_coordinate
    scale, unit, shown = at_lining(cycle.model, name, cycle.amplitude[name])
    amplitude = f"{scale * cycle.amplitude[name]:.4g} {unit} in {shown}"
    kind = "a neutral" if cycle.neutral else "a stable" if cycle.stable else "an unstable"
    return f"{kind} limit cycle at {cycle.frequency_Hz:.7g} Hz, {amplitude}"


def _disturbed(cycle: Cycle) -> str:
    factor = f"{cycle.largest:.4g} times its size"
    if cycle.neutral:
        return "within the accuracy, a small disturbance neither grows nor decays"
    if cycle.largest == 0:
        return "a small disturbance is forgotten within a period, for the contact sticks"
    if cycle.stable:
        return f"a small disturbance decays to {factor} in a period"
    largest, count = cycle.multipliers[0], cycle.unstable_directions
    turning = "turning" if largest.imag else "changing its sign" if largest.real < 0 else "keeping its sign"
    directions = "one direction" if count == 1 else f"{count} directions"
    return f"a small disturbance grows to {factor} in a period, {turning}, in {directions}"


def end_words(branch: CycleBranch) -> list[str]:
    """How a branch begins and ends where its table does not say it."""
    found = []
    for verb, end, detail in (("begins", branch.start, branch.start_detail), ("ends", branch.end, branch.end_detail)):
        if end is BranchEnd.HOPF:
            found.append(f"{verb} next to a Hopf point, where cycles have no size")
        elif end is BranchEnd.STANDSTILL:
            found.append(f"{verb} where the drum stands still, and cycles have no size")
        elif end is BranchEnd.LOST:
            found.append(f"is lost where it {verb}: {detail}")
    return found


def missing_words(diagram: Diagram) -> list[str]:
    """What was looked for and not found, as far as the verdict does not give it as what was not followed."""
    given = {each.reason for each in diagram.not_followed} if diagram.verdict else set[str]()
    return [f"Not found: {note}" for note in diagram.notes if note not in given]


def diagram_verdict(diagram: Diagram, along: Variation) -> str:
    """Where steady sliding is unstable, where stable cycles are, where both are stable, and what is on no branch."""
    off = off_branch_words(diagram, along)
    unstable, cycles, both = diagram.steady_sliding_unstable, diagram.stable_cycles, diagram.squeals_only_when_disturbed
    sliding = f"is unstable for {along.key} {_ranges(unstable, along)}" if unstable else _without_growth(diagram)
    if not diagram.branches:
        return f"Steady sliding {sliding}; no cycle was found, {UNPROVEN}.{off}{_unknown(diagram, along)}"
    lives = f"stable cycles exist {_ranges(cycles, along)}" if cycles else "no cycle that was found is stable"
    crossings = tuple((diagram.values_of(event), str(event)) for event in (Event.TRANSCRITICAL, Event.PITCHFORK))
    special = (
        (diagram.folds, "folds"), (diagram.grazings, "grazing"), (diagram.doublings, "period doubling"), *crossings
    )  # fmt: skip
    named = "; ".join(_values(values, what, along) for values, what in special if values)
    bistable = (
        f"{_ranges(both, along)} {diagram.subject} squeals only after a large disturbance (bistable)"
        if both
        else f"no stable cycle that was found coexists with stable steady sliding, {UNPROVEN}"
    )
    pull = _pull([cycle for branch in diagram.branches for cycle in branch.cycles])
    found = f"Steady sliding {sliding}; {lives}{f' ({named})' if named else ''}; {bistable}."
    return f"{found}{pull}{off}{_unknown(diagram, along)}"


def _pull(cycles: Sequence[Cycle]) -> str:
    """That the contact pulls in one of them."""
    known = [each for each in cycles if each.samples is not None]  # of those read from a file they are not
    forces = (smallest_force(each.model, each.samples.displacement) for each in known)
    return pulling_sentence(min(forces, default=math.inf))


def _without_growth(diagram: Diagram) -> str:
    """How steady sliding is where it is unstable nowhere."""
    if diagram.linear is None:
        return "is stable throughout"
    sound = [point for point in diagram.linear.points if not point.reason]
    if not sound:
        return "exists nowhere"
    if all(point.neutral for point in sound):
        return "is neutral throughout, for small motion neither grows nor decays"
    return "is stable throughout"


def off_branch_words(diagram: Diagram, along: Variation) -> str:
    """Which motions are on none of the branches, at which values, and why."""
    groups: list[list[OffBranch]] = []
    for each in sorted(diagram.off_branches, key=lambda each: each.value):
        group = next((group for group in groups if _goes_on(group[-1], each)), None)
        if group is None:
            groups.append([each])
        else:
            group.append(each)
    sentences = [_off_branch(group, along, getattr(diagram, "scene", None)) for group in groups]
    return "".join(f" {each[0].upper()}{each[1:]}" for each in sentences)


def _goes_on(one: OffBranch, other: OffBranch) -> bool:
    """Whether motions at two values are on no branch for one reason and are alike in size."""
    if one.why is not other.why or one.value == other.value or not (one.amplitude and other.amplitude):
        return False
    return amplitudes_apart(one.amplitude, other.amplitude) < ALIKE


def _off_branch(group: Sequence[OffBranch], along: Variation, scene: Scene | None) -> str:
    first, last = group[0], group[-1]
    name = max(first.amplitude, key=lambda name: first.amplitude[name], default="")
    factor, unit, shown = at_lining(scene, name)
    sizes = _span([f"{factor * each:.3g}" for each in sorted(each.amplitude[name] for each in group if name)])
    size = f" with {sizes} {unit} of {shown}" if name else ""
    lines = _span([shown_Hz(each) for each in sorted(each.frequency_Hz for each in group if each.frequency_Hz)])
    line = f" of {lines} Hz" if lines else ""
    if len(group) == 1:
        where, which = f"at {along.with_unit(first.value)}", f"the motion{line}{size} is"
    else:
        ends = f"from {along.shown(first.value):.6g} to {along.with_unit(last.value)}"
        where, which = f"{ends} ({len(group)} values)", f"motions{line}{size} are"
    return f"{where} {which} on none of the branches: {first.reason}."


def _span(rising: Sequence[str]) -> str:
    """The first and the last, or the one there is."""
    return " to ".join(dict.fromkeys([*rising[:1], *rising[-1:]]))


def shown_Hz(frequency: float) -> str:
    """A frequency in whole Hz, or with three digits."""
    return f"{frequency:.0f}" if frequency >= WHOLE else f"{frequency:.3g}"


def _values(values: Sequence[float], what: str, along: Variation) -> str:
    """Where something happens."""
    counts = Counter(map(along.brief, values))
    shown = (value if count == 1 else f"{value} ({count})" for value, count in counts.items())
    return f"{what} at {', '.join(shown)}{along.unit_after}"


def _unknown(diagram: Diagram, along: Variation) -> str:
    """Where nothing is known of cycles, and why."""
    reasons = "; ".join(dict.fromkeys(each.reason for each in diagram.not_followed))
    why = f"not everything was followed ({reasons})" if reasons else ""
    if not diagram.squeals_unknown:
        return f" {why[0].upper()}{why[1:]}." if why else ""
    where = _ranges(diagram.squeals_unknown, along)
    return f" Whether it squeals after a large disturbance is unknown {where}{f': {why}' if why else ''}."


def _ranges(intervals: Sequence[Interval], along: Variation) -> str:
    ranges = (f"from {along.brief(low)} to {along.brief(high)}" for low, high in intervals)
    return f"{' and '.join(ranges)}{along.unit_after}"


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
    >>> [tuple(round(end, 3) for end in ends) for ends in found.squeals_only_when_disturbed]
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
    # There are 9 values at which motions begin at rest on the drum, or leave steady sliding.
    values = np.linspace(low, high, 9).tolist()
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
