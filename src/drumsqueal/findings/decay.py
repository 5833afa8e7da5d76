"""Whether a motion that has not settled decays to rest: whether it is below the contact boundaries and falls."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.findings.rest import falls_as_small, find_rest, rate_of_halves
from drumsqueal.findings.signals.regime import PERIODS_NEEDED, STEADY, Regime, RegimeKind
from drumsqueal.findings.signals.regime_words import Cause
from drumsqueal.findings.vibration import Vibration, boundary_ratio, changes
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.branches import Point
from drumsqueal.solve.linear.modes import NEUTRAL_FRACTION, Mode, Stability, without_oscillation

SMALL = 0.1  # of the nearer contact boundary, below which the motion is nearly linear
BEYOND = 0.9  # of a contact boundary, from which on the linear model is no guide; a block that sticks just reaches it


def is_decaying(fraction: float, rate: float, linear: float) -> bool:
    """Whether a motion at this fraction of the contact boundaries that changes at this rate (1/s) decays.

    Within a tenth of the contact boundaries it must fall, below them at least half as fast as the slowest mode at
    `linear` (1/s).
    """
    return (fraction < SMALL and rate < 0) or (fraction < BEYOND and falls_as_small(rate, linear))


class Slowest(NamedTuple):
    """What is least stable: its label, its growth rate (1/s), and the frequency (Hz) that sets how long a record is."""

    label: str
    rate: float
    frequency_Hz: float


def least_stable(about: Stability | Point, modes: Sequence[Mode]) -> Slowest:
    """Of these modes, and of what does not oscillate, what grows fastest or else decays slowest; without any, a rate 0.

    What decays without oscillation counts where nothing oscillates about steady sliding, in a time 1/|λ|.
    """
    found, rate = [Slowest(mode.label, mode.growth_rate, mode.frequency_Hz) for mode in modes], about.divergence
    if rate is None and not about.modes:
        rate = max(without_oscillation(about.eigenvalues).tolist(), default=0.0)
        rate = rate if rate < -NEUTRAL_FRACTION * np.max(np.abs(about.eigenvalues), initial=0.0) else None
    found += [] if rate is None else [Slowest("the overdamped motion", rate, abs(rate) / math.tau)]
    return max(found, key=lambda each: each.rate, default=Slowest("", 0.0, 0.0))


def slowest(about: Stability | Point, modes: Sequence[Mode]) -> Slowest | None:
    """The least stable of these modes and of what does not oscillate; None unless all of it decays."""
    found = least_stable(about, modes)
    return found if found.rate < -NEUTRAL_FRACTION * found.frequency_Hz else None


def decay_to_rest(
    regime: Regime, vibration: Vibration, part: slice, stability: Stability, modes: Sequence[Mode], model: Model
) -> Regime:
    """Return the regime of a part of the record, steady where what had not settled decays to rest.

    `modes` are those that take part; all of them must decay. Rest stays rest, and what is left of it grows no more: its
    round-off is no irregular motion. What rests elsewhere than in steady sliding is steady, too, and its place is in
    the numbers, by the coordinates.
    """
    if regime.kind is RegimeKind.PERIODIC or model.forced or changes(model, vibration.time[part]):
        return regime
    known, fraction = slowest(stability, modes), 0.0
    if known is not None:
        part, fraction = _below_boundaries(vibration, part, known, model)
    if regime.kind not in (RegimeKind.UNKNOWN, RegimeKind.STEADY) and (known is None or fraction >= STEADY):
        return regime
    pieces = ((displacement, velocity) for _, displacement, velocity in vibration.pieces(part))
    rest = find_rest(model, stability.steady_state, stability.matrix, pieces, 1 / vibration.sample_rate)
    if rest.elsewhere is not None:
        place = dict(zip(stability.coordinates, rest.elsewhere.tolist(), strict=True))
        return Regime(kind=RegimeKind.STEADY, cause=Cause.RESTS_ELSEWHERE, numbers=place)
    if known is None or not rest.near:
        return regime
    if regime.kind is RegimeKind.STEADY or fraction < STEADY:
        return _steady(regime, Cause.RESIDUAL_MOTION, known, boundary_fraction=fraction)
    rate = _rate(vibration, part, stability.mass)
    if not is_decaying(fraction, rate, known.rate):
        return regime
    return _steady(regime, Cause.DECAYS, known, rate_1_per_s=rate)


def _below_boundaries(vibration: Vibration, part: slice, slow: Slowest, model: Model) -> tuple[slice, float]:
    """The part from where the motion came below the boundaries on, if that lasts for long enough; its largest ratio."""
    first, stop, _ = part.indices(vibration.time.size)
    ratio = boundary_ratio(vibration, model)[first:stop]
    since = int(np.max(np.flatnonzero(ratio >= BEYOND), initial=-1)) + 1
    if (ratio.size - since) * slow.frequency_Hz > PERIODS_NEEDED * vibration.sample_rate:
        ratio, part = ratio[since:], slice(first + since, stop)
    return part, float(ratio.max())


def _steady(regime: Regime, cause: Cause, slow: Slowest, **numbers: float) -> Regime:
    numbers["mode_growth_rate_1_per_s"] = slow.rate
    drift = regime.amplitude_drift
    return Regime(kind=RegimeKind.STEADY, cause=cause, numbers=numbers, mode=slow.label, amplitude_drift=drift)


def _rate(vibration: Vibration, part: slice, mass: NDArray[np.float64]) -> float:
    first, stop, _ = part.indices(vibration.time.size)
    half = first + (stop - first) // 2
    before, after = (vibration.mean_square_velocity(each) for each in (slice(first, half), slice(half, stop)))
    return rate_of_halves(float(mass @ before), float(mass @ after), (stop - first) / vibration.sample_rate)
