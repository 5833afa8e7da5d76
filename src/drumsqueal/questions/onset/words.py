"""What a study of the onset found, in plain words, and what limits it."""

import math
from collections.abc import Sequence

from drumsqueal.dynamics.attractor import Attractor
from drumsqueal.dynamics.cycles.cycle import Diagram, Event, RangeKind
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.findings.signals.regime import listed, rest_words
from drumsqueal.physics.model import at_lining
from drumsqueal.questions.cycle.study import WHOLE, shown_Hz
from drumsqueal.questions.onset.found import QUIET, Onset, Range
from drumsqueal.scene.variation import Variation
from drumsqueal.solve.linear.branches import DIVERGENCE, Critical
from drumsqueal.solve.motion import pulling_sentence

EXACT = 1e-6  # relative uncertainty that is not worth stating

NEUTRAL = "small motion neither grows nor decays"


def verdict(study: Onset) -> str:
    """State where the eigenvalues predict squeal, where only a large disturbance leads to it, and its frequency."""
    along = study.variation
    low, high = sorted((along.first, along.last))
    over = f"Along {along.key} from {along.shown(low):.6g} to {along.with_unit(high)}"
    told = "; ".join(filter(None, (_linear(study), _bistable(study), _undecided(study))))
    return f"{over} {told}.{_coexisting(study)}{_smallest_disturbances(study)}"


def _linear(study: Onset) -> str:
    unstable = [each for each in study.ranges if each.kind is RangeKind.SQUEALS]
    if not unstable:
        return "the eigenvalues predict no squeal"
    if len(study.ranges) == 1:
        return "the eigenvalues predict squeal everywhere"
    return f"the eigenvalues predict squeal {listed([_place(study, each) for each in unstable])}"


def _place(study: Onset, found: Range) -> str:
    """Where a range is: below, above or from one value to another, and whose critical values they are."""
    along = study.variation
    first = _value(along, found.first, found.first_uncertainty, along.brief(found.first))
    last = _value(along, found.last, found.last_uncertainty, along.brief(found.last)) + along.unit_after
    if found.first_uncertainty is None and found.last_uncertainty is None:
        return "all along"
    ends = [found.first] * (found.first_uncertainty is not None) + [found.last] * (found.last_uncertainty is not None)
    modes = [
        each.label if each.label == DIVERGENCE else f"{each.label}, {shown_Hz(each.frequency_Hz)} Hz"
        for each in study.critical_values
        if any(abs(each.value - end) <= each.uncertainty for end in ends)
    ]
    named = f" ({', '.join(dict.fromkeys(modes))})" if modes and found.kind is RangeKind.SQUEALS else ""
    if found.first_uncertainty is None:
        return f"below {last}{named}"
    if found.last_uncertainty is None:
        return f"above {first}{along.unit_after}{named}"
    return f"from {first} to {last}{named}"


def _bistable(study: Onset) -> str:
    bistable = [each for each in study.ranges if each.kind is RangeKind.BISTABLE]
    if not bistable:
        return _quiet(study)
    places = listed([_place(study, each) for each in bistable])
    smalls = [row.small for row in study.values if row.asked and row.kind is RangeKind.BISTABLE]
    neutral = smalls and all(small is not None and small.leads_to is Kind.NEUTRAL for small in smalls)
    sliding = f"neutral there ({NEUTRAL})" if neutral else "stable there"
    text = f"bistable {places}: steady sliding is {sliding}, but a large disturbance leads to squeal"
    motions = [motion for row in study.values if row.kind is RangeKind.BISTABLE for motion in row.motions]
    lines = [each.frequency_Hz for each in motions if each.frequency_Hz is not None]
    if not lines:
        return text
    low, high = min(lines), max(lines)
    heard = f"{' to '.join(dict.fromkeys([shown_Hz(low), shown_Hz(high)]))} Hz"
    ends = {end for each in bistable for end in (each.first, each.last)}
    onset = next((each.frequency_Hz for each in study.critical_values if each.value in ends), 0.0)
    compared = f" (eigenvalue at the critical value: {shown_Hz(onset)} Hz)" if onset > 0 else ""
    return f"{text}, at the values tried at {heard}{compared}"


def _quiet(study: Onset) -> str:
    """What becomes of starts where none squeals with steady sliding stable."""
    kinds = {each.kind for each in study.ranges}
    elsewhere = "elsewhere " if RangeKind.SQUEALS in kinds else ""
    if RangeKind.STABLE in kinds:
        return f"{elsewhere}no start that was tried squeals"
    if RangeKind.NEUTRAL in kinds:
        neutral = "its amplitude is that of the initial perturbation, which is not squeal"
        return f"{elsewhere}motion neither grows nor decays: {neutral}"
    return ""


def _undecided(study: Onset) -> str:
    """Where no transient squealed and not all of them have come to rest."""
    undecided = [_place(study, each) for each in study.ranges if each.kind is RangeKind.UNDECIDED]
    return f"whether a disturbance leads to squeal is undecided {listed(undecided)}" if undecided else ""


def _coexisting(study: Onset) -> str:
    """Where several motions coexist and, where there are most, which and what leads to each."""
    several = [row for row in study.in_order if row.asked and len(row.motions) > 1]
    if not several:
        return ""
    most = max(several, key=lambda row: (len(row.motions), row.kind is RangeKind.BISTABLE))
    each = listed([motion_words(study, motion) for motion in most.led_to])
    where = _values(study, [row.value for row in several])
    there = f"; at {study.variation.with_unit(most.value)}" if len(several) > 1 else ":"
    return f" Several motions coexist at {where}{there} {each}."


def motion_words(study: Onset, motion: Attractor) -> str:
    """Line and amplitude of a motion, and what leads to it."""
    name = study.coordinate
    line = "" if motion.frequency_Hz is None else f"{shown_Hz(motion.frequency_Hz)} Hz with "
    scale, unit, shown = shown_size(study, [motion.amplitude[name]])
    size = f"{scale * motion.amplitude[name]:.3g} {unit} of {shown}"
    return f"{line}{size} {_after(motion)} {start_words(motion, study.variation)}"


def shown_size(study: Onset, amplitudes: Sequence[float]) -> tuple[float, str, str]:
    """How amplitudes of a study's coordinate are shown: how many units are one of SI, the unit, and its name."""
    return at_lining(getattr(study, "scene", None), study.coordinate, max(amplitudes, default=0.0))


def shown_line(frequency: float) -> str:
    """A frequency in tenths of a Hz, or with four digits."""
    return f"{frequency:.1f}" if frequency >= WHOLE else f"{frequency:.4g}"


def _after(motion: Attractor) -> str:
    return "after" if motion.after_small or motion.kick is not None or not motion.from_values else "continued from"


def start_words(motion: Attractor, along: Variation) -> str:
    """What leads to a motion: a small perturbation, the smallest disturbance, or the motion at another value.

    The velocity of a disturbance is that of the fastest point of the lining's surface.
    """
    if motion.after_small:
        return "a small perturbation"
    if motion.smallest_kick is not None:
        smallest = motion.smallest_kick
        speed = with_uncertainty(smallest.speed_m_per_s, smallest.speed_uncertainty_m_per_s)
        return f"{speed} m/s along {smallest.mode}"
    if motion.kick is not None:
        return f"{motion.kick.speed_m_per_s:.3g} m/s along {motion.kick.mode}"
    if motion.from_values:
        return f"the motion at {along.with_unit(motion.from_values[0])}"
    return motion.start


def _smallest_disturbances(study: Onset) -> str:
    """How large a disturbance must be at least and at most, over the values."""
    found = [(row.smallest_kick, row.value) for row in study.values if row.smallest_kick]
    found.sort(key=lambda each: each[0].energy_J)
    sizes = []
    for smallest, value in found[:1] + found[1:][-1:]:
        speed = with_uncertainty(smallest.speed_m_per_s, smallest.speed_uncertainty_m_per_s)
        sizes.append(f"{speed} m/s ({smallest.energy_J:.2g} J) at {study.variation.with_unit(value)}")
    if not sizes:
        return ""
    return (
        f" The smallest disturbance along a mode that starts squeal, as the velocity of {study.rubbing}'s surface, is "
        f"{' to '.join(sizes)} at the values tried."
    )


def _value(along: Variation, value: float, uncertainty: float | None, exact: str = "") -> str:
    if not uncertainty or uncertainty < EXACT * abs(value):
        return exact or f"{along.shown(value):.6g}"
    return with_uncertainty(along.shown(value), along.shown(uncertainty))


def with_uncertainty(value: float, uncertainty: float) -> str:
    """A value in as many digits as its uncertainty leaves it, in one: 47.94 ± 0.02, (7.6 ± 0.1)e-25."""
    # Of numbers below 1e-4 the zeros behind the point are not written.
    if 0 < abs(value) < 1e-4:
        power = math.floor(math.log10(abs(value)))
        return f"({with_uncertainty(value / 10.0**power, uncertainty / 10.0**power)})e{power}"
    rounded = float(f"{uncertainty:.1g}")
    return f"{value:.{max(0, -math.floor(math.log10(rounded)))}f} ± {rounded:g}"


def critical_words(critical: Critical, along: Variation) -> str:
    """Which mode gains or loses stability at which value."""
    becomes = "loses stability" if critical.destabilises else "gains stability"
    value = _value(along, critical.value, critical.uncertainty)
    shown = f"{critical.frequency_Hz:.2f}" if critical.frequency_Hz >= 1 else f"{critical.frequency_Hz:.4g}"
    line = f" at {shown} Hz" if critical.frequency_Hz > 0 else ""
    return f"{critical.label} {becomes}{line} as the value rises past {along.key} = {value}{along.unit_after}"


def reservations(study: Onset) -> tuple[str, ...]:
    """State what limits the verdict: modes that cannot be started, transients without an answer, ends not found."""
    found = []
    unstable = {mode.name for row in study.values for mode in row.point.modes if mode.unstable}
    unseen = sorted(unstable - set(study.coordinates))
    if unseen:
        moving = f"{', '.join(unseen)} becomes unstable, but the transients hold {', '.join(study.coordinates)} only"
        found.append(f"{moving}: start those coordinates, too.")
    asked = [row for row in study.values if row.asked]
    quiet = [row.value for row in asked if row.kind is RangeKind.SQUEALS and not any(each.lasts for each in row.starts)]
    if quiet:
        found.append(f"Unstable by its eigenvalues, but no transient squealed: {_values(study, quiet)}.")
    away = f"ran away, with the shoe turned by more than {Criteria.small_rotation:g} rad,"
    for leads, words in ((Kind.UNDECIDED, "had not settled"), (Kind.RUNS_AWAY, away), (Kind.FAILED, "failed")):
        led = [(row.value, each) for row in study.values for each in row.starts if each.leads_to is leads]
        if led:
            longest = max(each.simulated_s for _, each in led)
            still = f" after {longest:.2g} s: it still decayed, grew or came and went" * (leads is Kind.UNDECIDED)
            found.append(f"A transient {words} at {_values(study, list(dict(led)))}{still}; see the table.")
    rests = {row.value: each for row in study.values for each in row.starts if each.rests_at}
    if rests:
        first, place = next(iter(rests.items()))
        at = f"at {study.variation.with_unit(first)} {rest_words(place.rests_at)}"
        found.append(
            f"A transient came to rest in another equilibrium, no squeal, at {_values(study, list(rests))}: {at}."
        )
    ends = (each.saturated for row in study.values for each in row.starts if each.saturated is not None)
    found += filter(None, [pulling_sentence(min((each.smallest_force for each in ends), default=math.inf)).lstrip()])
    nowhere = {row.value: row.no_steady_sliding for row in asked if row.kind is RangeKind.NOWHERE}
    if nowhere:
        first, reason = next(iter(nowhere.items()))
        at = "" if len(nowhere) == 1 else f" At {_values(study, [first])}:"
        found.append(f"No steady sliding at {_values(study, list(nowhere))}{'.' if at else ':'}{at} {reason}.")
    bistable = [each for each in study.ranges if each.kind is RangeKind.BISTABLE]
    open_ends = [each.first for each in bistable if each.first_uncertainty is None]
    open_ends += [each.last for each in bistable if each.last_uncertainty is None]
    if open_ends:
        which = "the ends" if len(open_ends) > 1 else "the end"
        found.append(
            f"The bistable range may go on beyond {_values(study, open_ends)}, {which} of the range asked for."
        )
    found += _contradictions(study)
    not_started = [row.value for row in asked if row.kind is RangeKind.BISTABLE and row.smallest_kick is None]
    if study.smallest_kick_sought and not_started:
        squeal = "squeal that a neighbouring value's motion leads to"
        found.append(f"No disturbance along a mode that was tried starts the {squeal}: {_values(study, not_started)}.")
    if bistable or any(each.kind in QUIET for each in study.ranges):
        other = f"Disturbances that were not tried may lead to squeal{' elsewhere, too' * bool(bistable)}"
        found.append(f"{other}: no range called stable has been proved stable.")
    return tuple(found)


def _contradictions(study: Onset) -> list[str]:
    """Where the limit cycles end a bistable range elsewhere than the transients do: there they are few, and short.

    Only where the cycles do end there, at a bifurcation that was found.
    """
    if study.cycles is None:
        return []
    told = []
    for each in study.ranges:
        cycles = [(a, b) for a, b in study.cycles.squeals_only_when_kicked if a < each.last and b > each.first]
        if each.kind is not RangeKind.BISTABLE or not cycles:
            continue
        first, last = min(a for a, _ in cycles), max(b for _, b in cycles)
        ends = ((each.first, each.first_uncertainty, first), (each.last, each.last_uncertainty, last))
        for end, uncertainty, cycle in ends:
            apart = uncertainty and abs(end - cycle) > uncertainty + EXACT * abs(end)
            if apart and _ends_cycles(study.cycles, cycle, end, each):
                by_transients = _value(study.variation, end, uncertainty)
                told.append(
                    f"The limit cycles end the bistable range at {study.variation.with_unit(cycle, '.5g')}, not at "
                    f"{by_transients}{study.variation.unit_after}, where transients do: near such an end these decay "
                    "slowly, and may miss a cycle with a small basin. Trust the cycles there."
                )
    return told


def _ends_cycles(cycles: Diagram, value: float, end: float, found: Range) -> bool:
    """Whether squeal is known to end at a value, and not at the end of a range that transients give.

    It is where that is a bifurcation on a branch or of steady sliding, cycles are followed from there to the other end,
    and no motion of the range, if that goes further, is on none of the branches.
    """
    # An end of a range is the very value at which a branch changes its stability.
    special = {each.value for branch in cycles.branches for each in branch.special if each.what is not Event.CORNER}
    stable, unstable = (
        {value for each in spans for value in each}
        for spans in (cycles.steady_sliding_stable, cycles.steady_sliding_unstable)
    )
    low, high = sorted((value, end))
    followed = not any(each.low <= high and each.high >= low for each in cycles.not_followed)
    further = found.first < value < found.last
    off = further and any(found.first <= each.value <= found.last for each in cycles.off_branches)
    return value in special | (stable & unstable) and followed and not off


def _values(study: Onset, values: Sequence[float]) -> str:
    shown = [study.variation.with_unit(value) for value in values[:3]]
    return listed(shown) if len(values) <= 3 else f"{', '.join(shown)} and {len(values) - 3} more"
