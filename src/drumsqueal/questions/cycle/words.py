"""What cycles are and what they say of squeal, in sentences."""

import math
from collections import Counter
from collections.abc import Sequence

from drumsqueal.dynamics.cycles.cycle import BranchEnd, Cycle, CycleBranch, Diagram, Event, OffBranch
from drumsqueal.findings.squeals import Interval
from drumsqueal.findings.vibration import amplitudes_apart
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.model import at_lining
from drumsqueal.scene import Scene
from drumsqueal.scene.quantities import percent
from drumsqueal.scene.variation import Variation
from drumsqueal.solve.pulling import pulling_sentence, smallest_force

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
    unstable, cycles, both = diagram.steady_sliding_unstable, diagram.stable_cycles, diagram.squeals_only_when_kicked
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
