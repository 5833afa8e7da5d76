"""Run-up and coast-down in sentences."""

import math
from collections.abc import Iterator, Sequence

from drumsqueal.findings.instant import Instant, name_of_key, unit_of_key
from drumsqueal.findings.passages import Passage, PassageGrowth
from drumsqueal.findings.ramp import Ramp
from drumsqueal.findings.squeals import Squeal, SquealEnd
from drumsqueal.physics.model import at_lining
from drumsqueal.scene import Scene

MOST = 3  # squeals, and modes, that are named one by one


def value_words(instant: Instant, keys: Sequence[str], unit: bool = True) -> str:
    """What changes, at an instant: "4.48 rad/s"."""
    return ", ".join(f"{instant.value(key):.3g}{f' {unit_of_key(key)}' if unit else ''}" for key in keys)


def way_words(instant: Instant, keys: Sequence[str]) -> str:
    """Which way the one thing that changes goes: "rising", "falling", "constant"; empty where both change."""
    if len(keys) != 1:
        return ""
    rate = instant.rate(keys[0])
    return "rising" if rate > 0 else "falling" if rate < 0 else "constant"


def predicted_squeal(ramp: Ramp) -> str:
    """Which modes are unstable on the way, and where."""
    last = max((line.time_s[-1] for line in ramp.lines), default=0.0)
    found = [
        f"{each.mode} throughout"
        if each.unstable_from.time_s == 0 and each.unstable_until.time_s == last
        else f"{each.mode} from {_when(each.unstable_from, ramp.keys)} to {_when(each.unstable_until, ramp.keys)}"
        for each in ramp.passages
    ]
    return f"squeal in {_some(found)}" if found else "no squeal"


def ramp_sentences(ramp: Ramp, scene: Scene) -> Iterator[str]:
    """What squeals when, why then, and the hysteresis."""
    squeals = [_squeal(each, ramp.keys, scene) for each in ramp.squeals]
    if squeals:
        yield f"Squeal {_some(squeals, '; it ')}."
    yield from (_growth(each, ramp.keys) for each in _leading(ramp.passages)[:MOST])
    for each in ramp.hysteresis[:MOST]:
        other = {"rises": "falls", "falls": "rises"}[each.squeals_while]
        yield (
            f"Hysteresis: from {each.low:.3g} to {each.high:.3g} {unit_of_key(each.key)} the brake squeals while the "
            f"{name_of_key(each.key)} {each.squeals_while} and is quiet while it {other}."
        )


def _leading(passages: Sequence[Passage]) -> list[Passage]:
    """Those that lead to squeal; where none does, those that might have."""
    leading = [each for each in passages if each.measured is not None]
    return leading or [each for each in passages if each.growth_needed is not None]


def _squeal(squeal: Squeal, keys: Sequence[str], scene: Scene) -> str:
    begins = f"sets in at {_when(squeal.sets_in, keys)}"
    if squeal.sets_in.time_s == 0:
        begins = f"is there at t = 0 ({value_words(squeal.sets_in, keys)})"
    if squeal.end is SquealEnd.RECORD:
        return f"{begins} and lasts until the record ends, at {_when(squeal.ends, keys)}"
    if squeal.end is SquealEnd.STICKS:
        return f"{begins} and lasts until the lining sticks to the drum, at {_when(squeal.ends, keys)}"
    text = f"{begins} and dies out at {_when(squeal.ends, keys)}"
    if squeal.sustained_until.time_s < squeal.ends.time_s:
        text += f", sustained until {value_words(squeal.sustained_until, keys)}"
    if squeal.line is not None:
        factor, unit, shown = at_lining(scene, squeal.line.coordinate)
        size = f"{factor * squeal.amplitude:.3g} {unit} of {shown}"
        at = value_words(squeal.largest, keys)
        text += f" and largest at {at} ({size}, {squeal.line.frequency_Hz:.0f} Hz)"
    return text


def _growth(passage: Passage, keys: Sequence[str]) -> str:
    """The growth integrated along the way against the transient."""
    needed, begins = passage.growth_needed, passage.unstable_from
    if needed is None or math.isinf(needed):
        text = f"{passage.mode} gathers {passage.growth_available:.3g} e-folds while it is unstable, but at the end of"
        text += " that no amplitude of it alone would reach a contact boundary"
        return (
            f"{text}."
            if passage.measured is None
            else f"{text}; the transient does at {_when(passage.measured, keys)}."
        )
    start = "when it turns unstable" if begins.time_s > 0 else "at the start"
    text = f"From its amplitude {start}, {passage.mode} has to grow by {needed:.3g} e-folds to reach a contact boundary"
    if passage.outcome is not PassageGrowth.REACHES or passage.predicted is None:
        reached = ", and the transient gets there " if passage.measured is not None else ""
        more = f"{reached}{'' if passage.measured is None else 'at ' + _when(passage.measured, keys)}"
        return f"{text}, but gathers {passage.growth_available:.3g} on the way{more}."
    delay = passage.predicted.time_s - begins.time_s
    text += f": ∫ Re λ dt comes to that after {delay:.4g} s, at {_when(passage.predicted, keys)}"
    if passage.measured is None:
        return f"{text}; the transient does not squeal then."
    return f"{text}; the transient gets there at {passage.measured.time_s:.4g} s."


def _when(instant: Instant, keys: Sequence[str]) -> str:
    way = way_words(instant, keys)
    return f"{instant.time_s:.4g} s ({value_words(instant, keys)}{f', {way}' if way else ''})"


def _some(texts: Sequence[str], between: str = "; ") -> str:
    more = f"; and {len(texts) - MOST} more" if len(texts) > MOST else ""
    return between.join(texts[:MOST]) + more
