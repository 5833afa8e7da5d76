"""What a study of the onset found, in plain words, and what limits it."""

import math
from collections.abc import Sequence

from drumsqueal.findings.verdict import SMALL_ROTATION
from drumsqueal.questions.onset.attractors import FAILED, RUNS_AWAY, UNDECIDED
from drumsqueal.questions.onset.rows import KICKED, NEUTRAL, NOWHERE, SQUEALS, STABLE, Kick, Range
from drumsqueal.questions.onset.study import OnsetStudy
from drumsqueal.scene.variation import Variation
from drumsqueal.solve.linear.branches import DIVERGENCE, Critical

EXACT = 1e-6  # relative uncertainty that is not worth telling


def verdict(study: OnsetStudy) -> str:
    """State where the eigenvalues predict squeal, where only a large disturbance leads to it, and its frequency."""
    along = study.variation
    low, high = sorted((along.first, along.last))
    told = f"Along {along.key} from {along.shown(low):.6g} to {along.told(high)} {_linear(study)}; {_bistable(study)}."
    return " ".join([told, *_smallest_kicks(study)])


def _linear(study: OnsetStudy) -> str:
    unstable = [each for each in study.ranges if each.kind == SQUEALS]
    if not unstable:
        return "the eigenvalues predict no squeal"
    if len(study.ranges) == 1:
        return "the eigenvalues predict squeal everywhere"
    return f"the eigenvalues predict squeal {_joined([_place(study, each) for each in unstable])}"


def _place(study: OnsetStudy, found: Range) -> str:
    """Where a range is: below, above or from one value to another, and whose critical values they are."""
    along = study.variation
    unit = f" {along.shown_unit}" if along.shown_unit else ""
    below = f"{_value(along, found.last, found.last_uncertainty)}{unit}"
    above = _value(along, found.first, found.first_uncertainty)
    if found.first_uncertainty is None and found.last_uncertainty is None:
        return "all along"
    ends = [found.first] * (found.first_uncertainty is not None) + [found.last] * (found.last_uncertainty is not None)
    modes = [_mode(each) for each in study.linear.critical if any(_is_at(each, end) for end in ends)]
    told = f" ({', '.join(modes)})" if modes and found.kind == SQUEALS else ""
    if found.first_uncertainty is None:
        return f"below {below}{told}"
    if found.last_uncertainty is None:
        return f"above {above}{unit}{told}"
    return f"from {above} to {below}{told}"


def _is_at(critical: Critical, end: float) -> bool:
    return abs(critical.value - end) <= critical.uncertainty


def _mode(critical: Critical) -> str:
    return critical.label if critical.label == DIVERGENCE else f"{critical.label}, {critical.frequency_Hz:.0f} Hz"


def _bistable(study: OnsetStudy) -> str:
    kicked = [each for each in study.ranges if each.kind == KICKED]
    if not kicked:
        kinds = {each.kind for each in study.ranges}
        elsewhere = "elsewhere " if SQUEALS in kinds else ""
        if STABLE in kinds:
            return f"{elsewhere}no start that was tried squeals"
        if NEUTRAL in kinds:
            return (
                f"{elsewhere}motion neither grows nor decays, and is as large as its start made it: that is no squeal"
            )
        return "there is nothing else to find"
    places = _joined([_place(study, each) for each in kicked])
    text = f"steady sliding is stable {places}, but a large disturbance leads to squeal there (bistable)"
    rows = [row for row in study.rows if row.kind == KICKED and row.strongest is not None]
    found = [row.strongest.motion.frequency_Hz for row in rows if row.strongest is not None]
    lines = [frequency for frequency in found if frequency is not None]
    if not lines:
        return text
    low, high = min(lines), max(lines)
    heard = f"{low:.0f} Hz" if high - low < 1 else f"{low:.0f} to {high:.0f} Hz"
    ends = {end for each in kicked for end in (each.first, each.last)}
    onset = next((each.frequency_Hz for each in study.linear.critical if each.value in ends), 0.0)
    compared = f" (eigenvalue at the critical value: {onset:.0f} Hz)" if onset > 0 else ""
    return f"{text}, at the values tried at {heard}{compared}"


def _smallest_kicks(study: OnsetStudy) -> list[str]:
    """How hard it must be kicked at least and at most, over the values."""
    found = sorted(((row.value, row.kick) for row in study.rows if row.kick), key=lambda each: each[1].energy)
    if not found:
        return []
    ends = [found[0], found[-1]] if len(found) > 1 else found
    told = ", and up to ".join(f"{_kick(kick)} at {study.variation.told(value)}" for value, kick in ends)
    return [f"The smallest kick along a mode that starts it gives, at the values tried, the lining's surface {told}."]


def _kick(kick: Kick) -> str:
    return f"{with_uncertainty(kick.speed, kick.speed_uncertainty)} m/s ({kick.energy:.2g} J)"


def _value(along: Variation, value: float, uncertainty: float | None) -> str:
    if not uncertainty or uncertainty < EXACT * abs(value):
        return f"{along.shown(value):.6g}"
    return with_uncertainty(along.shown(value), along.shown(uncertainty))


def with_uncertainty(value: float, uncertainty: float) -> str:
    """A value in as many digits as its uncertainty leaves it, in one: 47.94 ± 0.02."""
    digits = -math.floor(math.log10(uncertainty))
    return f"{value:.{max(0, digits)}f} ± {float(f'{uncertainty:.1g}'):g}"


def _joined(texts: Sequence[str]) -> str:
    return texts[0] if len(texts) == 1 else f"{', '.join(texts[:-1])} and {texts[-1]}"


def reservations(study: OnsetStudy) -> tuple[str, ...]:
    """Say what limits the verdict: modes that cannot be started, transients that gave no answer, ends not found."""
    found = []
    unseen = {mode.name for row in study.rows for mode in row.point.modes if mode.unstable} - set(study.names)
    if unseen:
        told = f"{', '.join(sorted(unseen))} becomes unstable, but the transients hold {', '.join(study.names)} only"
        found.append(f"{told}: start those coordinates, too.")
    asked = [row for row in study.rows if row.asked]
    quiet = [row.value for row in asked if row.kind == SQUEALS and not any(each.lasts for each in row.endings)]
    if quiet:
        found.append(f"Unstable by its eigenvalues, but no transient squealed: {_values(study, quiet)}.")
    away = f"ran away, with the shoe turned by more than {SMALL_ROTATION:g} rad,"
    ends = ((UNDECIDED, "was still falling or rising at its end"), (RUNS_AWAY, away), (FAILED, "failed"))
    for kind, told in ends:
        values = [row.value for row in study.rows if any(ending.kind == kind for ending in row.endings)]
        if values:
            found.append(f"A transient {told} at {_values(study, values)}; see the table.")
    nowhere = [row.value for row in asked if row.kind == NOWHERE]
    if nowhere:
        found.append(f"No steady sliding at {_values(study, nowhere)}.")
    open_ends = [
        study.variation.told(end)
        for each in study.ranges
        if each.kind == KICKED
        for end, uncertainty in ((each.first, each.first_uncertainty), (each.last, each.last_uncertainty))
        if uncertainty is None
    ]
    if open_ends:
        ends = "the ends" if len(open_ends) > 1 else "the end"
        found.append(f"The bistable range may go on beyond {_joined(open_ends)}, {ends} of the range asked for.")
    unmoved = [row.value for row in asked if study.smallest_kick and row.kind == KICKED and row.kick is None]
    if unmoved:
        told = "squeal that a neighbour's motion leads to"
        found.append(f"No kick along a mode that was tried starts the {told}: {_values(study, unmoved)}.")
    if any(each.kind == KICKED for each in study.ranges):
        told = "Disturbances that were not tried may lead to squeal elsewhere, too"
        found.append(f"{told}: a range called stable was not proved so.")
    return tuple(found)


def _values(study: OnsetStudy, values: Sequence[float]) -> str:
    shown = [study.variation.told(value) for value in values[:3]]
    return _joined(shown) if len(values) <= 3 else f"{', '.join(shown)} and {len(values) - 3} more"
