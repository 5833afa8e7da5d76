"""Run-up and coast-down: what a record shows while drum speed or load change, and what the eigenvalues predict."""

import math
from collections.abc import Iterator, Sequence
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from drumsqueal.findings.schema import Finding
from drumsqueal.findings.signals.growth import modal_amplitudes
from drumsqueal.findings.squeals import (
    Hysteresis,
    Instant,
    Interval,
    Squeal,
    SquealEnd,
    changing_keys,
    find_hysteresis,
    find_squeals,
    instant_at,
    name_of_key,
    runs,
    unit_of_key,
)
from drumsqueal.findings.vibration import Vibration, amplitudes_at_boundary
from drumsqueal.physics.model import Model, at_lining
from drumsqueal.scene import Scene
from drumsqueal.solve.linear.branches import Branches
from drumsqueal.solve.linear.modes import Mode, Stability
from drumsqueal.solve.linear.passage import Along, Vector, corners_of, follow_operation, modes_along, point_in_time

if TYPE_CHECKING:
    import xarray


# When the growth integrated along a changing operation takes a mode to a contact boundary, and the transient does.


class PassageGrowth(StrEnum):
    """What came of a mode's growth."""

    REACHES = "reaches a contact boundary"
    TOO_LITTLE = "grows too little"
    NOT_EXCITED = "not excited"
    SQUEALS_ALREADY = "squeals already"
    BEYOND_ALREADY = "beyond a contact boundary already"


class Passage(Finding):
    """A mode from where Re λ turns positive, or the record begins, to where it turns negative, or the record ends.

    At first it has the `amplitude` (m or rad), and it grows by ∫ Re λ dt, in e-folds: `growth_needed` takes it to the
    contact boundary, at the predicted instant or, where it never gets there, at the end; `growth_available` is the most
    that it gathers. `measured` is when the transient goes beyond a contact boundary, where this mode leads it there.
    """

    mode: str
    unstable_from: Instant
    unstable_until: Instant
    frequency_Hz: float
    amplitude: float
    growth_available: float
    outcome: PassageGrowth
    growth_needed: float | None = None
    predicted: Instant | None = None
    measured: Instant | None = None


def find_passages(
    modes: list[Along], branches: Branches, squeals: tuple[Squeal, ...], vibration: Vibration, model: Model
) -> tuple[Passage, ...]:
    """Where each mode is unstable on the way, when it was to reach a contact boundary, and when the transient did.

    A squeal is that of the mode which was to be the first, or of the one that lacks least growth where none was.
    """
    spans = [(along, *span) for along in modes for span in unstable_spans(along, branches)]
    found = [_passage(*span, squeals, vibration, model) for span in spans]
    for squeal in squeals:
        able = [
            k
            for k, each in enumerate(found)
            if each.unstable_from.time_s <= squeal.sets_in.time_s <= each.unstable_until.time_s
            and each.outcome in (PassageGrowth.REACHES, PassageGrowth.TOO_LITTLE)
            and each.measured is None
        ]
        if able:
            first = min(able, key=lambda k: _order(found[k]))
            found[first] = found[first].model_copy(update={"measured": squeal.sets_in})
    return tuple(sorted(found, key=lambda each: each.unstable_from.time_s))


def _order(passage: Passage) -> tuple[float, float]:
    """By the predicted instant, and by the growth that is lacking."""
    lacking = math.inf if passage.growth_needed is None else passage.growth_needed - passage.growth_available
    return (math.inf if passage.predicted is None else passage.predicted.time_s, lacking)


def unstable_spans(along: Along, branches: Branches) -> list[Interval]:
    """From and until when (s) a mode grows: at the roots of its Re λ, or at its first and last instant."""
    roots = np.array([each.value for each in branches.critical if each.label == along.label])
    grows = np.array([mode.unstable for mode in along.modes])
    found = []
    for first, stop in runs(grows):
        before = roots[(roots < along.time[first]) & (roots >= along.time[max(first - 1, 0)])]
        after = roots[(roots > along.time[stop - 1]) & (roots <= along.time[min(stop, grows.size - 1)])]
        begins = float(before[-1]) if before.size else float(along.time[first])
        found.append((begins, float(after[0]) if after.size else float(along.time[stop - 1])))
    return found


def _passage(
    along: Along, first: float, last: float, squeals: tuple[Squeal, ...], vibration: Vibration, model: Model
) -> Passage:
    mode, amplitude = _start(along, first, vibration, model)
    times, growth, room = growth_against_boundary(along, first, last, model)
    resolved = 1e-15  # m or rad, below which a mode's amplitude is round-off
    needed = room - math.log(max(amplitude, resolved))
    found: dict[str, Any] = {}
    if any(each.sets_in.time_s < first < each.ends.time_s for each in squeals):
        outcome = PassageGrowth.SQUEALS_ALREADY
    elif amplitude <= resolved:
        outcome = PassageGrowth.NOT_EXCITED
    elif needed[0] <= 0:
        outcome = PassageGrowth.BEYOND_ALREADY
    else:
        k = int(np.argmax(growth >= needed))
        outcome = PassageGrowth.REACHES if growth[k] >= needed[k] else PassageGrowth.TOO_LITTLE
        found = {"growth_needed": float(needed[k] if outcome is PassageGrowth.REACHES else needed[-1])}
        if outcome is PassageGrowth.REACHES:
            beyond = (growth - needed)[k - 1 : k + 1]  # rises through zero
            found["predicted"] = instant_at(model, float(np.interp(0.0, beyond, times[k - 1 : k + 1])))
    return Passage(
        mode=along.label,
        unstable_from=instant_at(model, first),
        unstable_until=instant_at(model, last),
        frequency_Hz=mode.frequency_Hz,
        amplitude=amplitude,
        growth_available=float(growth.max()),
        outcome=outcome,
        **found,
    )


def growth_against_boundary(along: Along, first: float, last: float, model: Model) -> tuple[Vector, Vector, Vector]:
    """Times (s) between two, the growth of a mode since the first, and ln of its amplitude at the contact boundary."""
    knots = np.concatenate([[first], along.time[(along.time > first) & (along.time < last)], [last]])
    # 20 instants between two that are followed, among which the predicted one is sought
    times = np.interp(np.linspace(0, knots.size - 1, 20 * (knots.size - 1) + 1), np.arange(knots.size), knots)
    limits = amplitudes_at_boundary(model, along.modes, along.steady, along.time.tolist())
    with np.errstate(invalid="ignore", divide="ignore"):  # infinite where there is no boundary; of no load, any motion
        room = np.interp(times, along.time, np.log(limits))
    room = np.where(np.isnan(room), np.inf, room)
    return times, along.growth_at(times) - float(along.growth_at(np.array([first]))[0]), room


def _start(along: Along, first: float, vibration: Vibration, model: Model) -> tuple[Mode, float]:
    """The mode as it is at a time (s), and its amplitude then about the steady sliding of that time.

    At the first sample that is the amplitude of the start; later it is the mean of some periods.
    """
    point = point_in_time(model, first)
    eigenvalue = along.modes[int(np.argmin(np.abs(along.time - first)))].eigenvalue
    mode = min(point.modes, key=lambda each: abs(each.eigenvalue - eigenvalue))
    k = int(np.searchsorted(vibration.time, first))
    # The amplitude from which a mode grows is a mean over eight periods.
    reach = round(4 / mode.frequency_Hz * vibration.sample_rate) if k > 0 else 0
    part = slice(max(k - reach, 0), k + reach + 1)
    times = vibration.time[part, None]
    slopes = np.gradient(along.steady, along.time, axis=0)
    steady, moving = (
        np.stack([np.interp(times[:, 0], along.time, column) for column in values.T], axis=1)
        for values in (along.steady, slopes)
    )
    displacement = vibration.about(steady, part)
    amplitudes = modal_amplitudes(
        mode.left[:, None], np.hstack([displacement, vibration.read("velocity", part) - moving])
    )
    return mode, float(2 * np.mean(np.abs(amplitudes)))


class CampbellLine(Finding):
    """Frequency and growth rate of a mode over time, by the drum speed and the load of each time."""

    mode: str
    name: str
    time_s: tuple[float, ...]
    frequency_Hz: tuple[float, ...]
    growth_rate_1_per_s: tuple[float, ...]


class Ramp(Finding):
    """What a record shows while drum speed or load change, and what the eigenvalues along the way predict.

    `keys` are those of the scene that change: "drum.speed", "contact.normal_load".
    """

    keys: tuple[str, ...]
    squeals: tuple[Squeal, ...]
    passages: tuple[Passage, ...]
    hysteresis: tuple[Hysteresis, ...]
    lines: tuple[CampbellLine, ...]


def find_ramp(history: "xarray.Dataset", vibration: Vibration, stability: Stability, model: Model) -> Ramp:
    """Find squeals in a history whose drum speed or load change, and follow the eigenvalues along the same way.

    `model` is over the coordinates of the stability. A coordinate that never moves is left aside.
    """
    until = float(vibration.time[-1])
    branches = follow_operation(model, until)
    moves = np.ptp(vibration.extremes(), axis=0) > 0
    moving = {name for name, each in zip(vibration.coordinates, moves, strict=True) if each}
    modes = [along for along in modes_along(branches, corners_of(model, until)) if along.modes[0].name in moving]
    squeals = find_squeals(history, vibration, stability, model, modes)
    return Ramp(
        keys=tuple(changing_keys(model)),
        squeals=squeals,
        passages=() if model.forced else find_passages(modes, branches, squeals, vibration, model),
        hysteresis=find_hysteresis(squeals, model, until),
        lines=tuple(_line(along) for along in modes),
    )


def _line(along: Along) -> CampbellLine:
    frequency, rate = ([getattr(mode, key) for mode in along.modes] for key in ("frequency_Hz", "growth_rate"))
    return CampbellLine(
        mode=along.label,
        name=along.modes[0].name,
        time_s=tuple(along.time.tolist()),
        frequency_Hz=tuple(frequency),
        growth_rate_1_per_s=tuple(rate),
    )


# Run-up and coast-down in sentences.


_MOST = 3  # squeals, and modes, that are named one by one


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
    yield from (_growth(each, ramp.keys) for each in _leading(ramp.passages)[:_MOST])
    for each in ramp.hysteresis[:_MOST]:
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
    measured = "" if passage.measured is None else f" at {_when(passage.measured, keys)}"
    if needed is None or math.isinf(needed):
        text = f"{passage.mode} gathers {passage.growth_available:.3g} e-folds while it is unstable, but at the end of"
        text += " that no amplitude of it alone would reach a contact boundary"
        return f"{text}; the transient does{measured}." if measured else f"{text}."
    start = "when it turns unstable" if begins.time_s > 0 else "at the start"
    text = f"From its amplitude {start}, {passage.mode} has to grow by {needed:.3g} e-folds to reach a contact boundary"
    if passage.outcome is not PassageGrowth.REACHES or passage.predicted is None:
        reached = measured and f", and the transient gets there{measured}"
        return f"{text}, but gathers {passage.growth_available:.3g} on the way{reached}."
    delay = passage.predicted.time_s - begins.time_s
    text += f": ∫ Re λ dt comes to that after {delay:.4g} s, at {_when(passage.predicted, keys)}"
    if passage.measured is None:
        return f"{text}; the transient does not squeal then."
    return f"{text}; the transient gets there at {passage.measured.time_s:.4g} s."


def _when(instant: Instant, keys: Sequence[str]) -> str:
    way = way_words(instant, keys)
    return f"{instant.time_s:.4g} s ({value_words(instant, keys)}{f', {way}' if way else ''})"


def _some(texts: Sequence[str], between: str = "; ") -> str:
    more = f"; and {len(texts) - _MOST} more" if len(texts) > _MOST else ""
    return between.join(texts[:_MOST]) + more
