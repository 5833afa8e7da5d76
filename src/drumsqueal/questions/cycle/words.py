"""What cycles are and what they say of squeal, in sentences."""

from collections.abc import Sequence

from drumsqueal.findings.signals.regime import Kind, Regime
from drumsqueal.findings.vibration import unit_of
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.questions.cycle.diagram import Diagram, Interval
from drumsqueal.questions.cycle.orbit import Cycle
from drumsqueal.scene.quantities import percent
from drumsqueal.scene.variation import Variation

VISIBLE = 1e-2  # m, rad; an amplitude from which on it is not given in millionths


def cycle_verdict(cycle: Cycle) -> str:
    """What the cycle is, and what a small disturbance does on it."""
    brief = describe_briefly(cycle)
    surface = "lining" if isinstance(cycle.model.contact, Contact) else "contact surface"
    phases = "one phase" if cycle.sticking_phases == 1 else f"{cycle.sticking_phases} phases"
    sticks = f", sticking as a whole for {percent(cycle.sticking_fraction)} of the period in {phases}"
    return (
        f"{brief[0].upper()}{brief[1:]}, with {percent(cycle.contact_fraction)} of the {surface} in contact and the "
        f"slip reversed on {percent(cycle.slip_reversed_fraction)} of it on average"
        f"{sticks if cycle.sticking_phases else ''}: {_disturbed(cycle)}."
    )


def describe_briefly(cycle: Cycle) -> str:
    """Stability, frequency and amplitude of a cycle."""
    name = cycle.main_coordinate
    scale, prefix = (1e6, "µ") if cycle.amplitude[name] < VISIBLE else (1.0, "")
    amplitude = f"{scale * cycle.amplitude[name]:.4g} {unit_of(name, prefix)} in {name}"
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


def regime_words(regime: Regime) -> str:
    """What a transient does."""
    match regime.kind:
        case Kind.UNKNOWN:
            needed = regime.record_needed_s and f"; {regime.record_needed_s:.4g} s of record are needed"
            return f"has not settled ({regime.cause}{needed or ''})"
        case Kind.STEADY:
            return "comes to rest in steady sliding"
        case Kind.PERIODIC:
            return "settles to a periodic motion"
        case _:
            return f"settles to no periodic motion (the motion is {regime.kind})"


def diagram_verdict(diagram: Diagram, along: Variation) -> str:
    """Where steady sliding is unstable, where stable cycles are, and where both are stable."""
    if not diagram.branches:
        return f"No cycle was found.{_unknown(diagram, along)}"
    unstable, cycles, both = diagram.steady_sliding_unstable, diagram.stable_cycles, diagram.squeals_only_when_kicked
    sliding = f"is unstable for {along.key} {_ranges(unstable, along)}" if unstable else "is stable throughout"
    lives = f"stable cycles exist {_ranges(cycles, along)}" if cycles else "no cycle that was found is stable"
    special = ((diagram.folds, "folds"), (diagram.grazings, "grazing"))
    named = "; ".join(_values(values, what, along) for values, what in special if values)
    bistable = (
        f"{_ranges(both, along)} the brake squeals only after a large disturbance (bistable)"
        if both
        else "no stable cycle that was found coexists with stable steady sliding"
        if diagram.squeals_unknown
        else "none of them coexists with stable steady sliding"
    )
    return f"Steady sliding {sliding}; {lives}{f' ({named})' if named else ''}; {bistable}.{_unknown(diagram, along)}"


def _values(values: Sequence[float], what: str, along: Variation) -> str:
    """Where something happens."""
    shown = [f"{along.shown(value):.6g}" for value in values[:-1]] + [along.with_unit(values[-1])]
    return f"{what} at {', '.join(shown)}"


def _unknown(diagram: Diagram, along: Variation) -> str:
    """Where nothing is known of cycles, and why."""
    if not diagram.not_followed:
        return ""
    reasons = "; ".join(dict.fromkeys(each.reason for each in diagram.not_followed))
    if not diagram.squeals_unknown:
        return f" Not everything was followed: {reasons}."
    where = _ranges(diagram.squeals_unknown, along)
    return f" Whether it squeals after a large disturbance is unknown {where}: not everything was followed ({reasons})."


def _ranges(intervals: Sequence[Interval], along: Variation) -> str:
    ranges = (f"from {along.shown(low):.6g} to {along.shown(high):.6g}" for low, high in intervals)
    return f"{' and '.join(ranges)}{along.unit_after}"
