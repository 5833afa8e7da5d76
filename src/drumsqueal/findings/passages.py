"""When the growth integrated along a changing operation takes a mode to a contact boundary, and the transient does."""

import math
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drumsqueal.findings.boundaries import amplitudes_at_boundary
from drumsqueal.findings.instant import Instant, instant_at
from drumsqueal.findings.intervals import Interval
from drumsqueal.findings.part import Finding
from drumsqueal.findings.signals.growth import modal_amplitudes
from drumsqueal.findings.squeals import Squeal, runs
from drumsqueal.findings.vibration import Vibration
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.branches import Branches
from drumsqueal.solve.linear.modes import Mode
from drumsqueal.solve.linear.passage import Along, point_in_time

FINE = 20  # instants between two that are followed, among which the predicted one is sought
PERIODS = 8  # over which the amplitude from which a mode grows is a mean
RESOLVED = 1e-15  # m or rad, below which a mode's amplitude is round-off

Vector = NDArray[np.float64]


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
    needed = room - math.log(max(amplitude, RESOLVED))
    found: dict[str, Any] = {}
    if any(each.sets_in.time_s < first < each.ends.time_s for each in squeals):
        outcome = PassageGrowth.SQUEALS_ALREADY
    elif amplitude <= RESOLVED:
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
    times = np.interp(np.linspace(0, knots.size - 1, FINE * (knots.size - 1) + 1), np.arange(knots.size), knots)
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
    reach = round(PERIODS / 2 / mode.frequency_Hz * vibration.sample_rate) if k > 0 else 0
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
