"""Which regime a saturated record shows: steady, periodic, quasi-periodic, irregular, or too little to tell."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drumsqueal.findings.signals.bases import find_bases
from drumsqueal.findings.signals.checks import below_nyquist, finite_record, positive
from drumsqueal.findings.signals.lines import find_lines
from drumsqueal.findings.signals.recurrence import RECURRENCE, find_recurrences, recurrence_after

# Motion below this fraction of the size that would count as motion is none.
STEADY = 1e-6
# A regime can only be told from this many periods: of the lowest frequency of interest, and of the period found.
PERIODS_NEEDED = 20
# A period longer than this many periods of the lowest frequency is not looked for: among so many lags every torus
# nearly closes.
LONGEST_PERIOD = 20
# Growth or decay of a motion that comes back by more than this between the halves of the record is drift.
PERIODIC_DRIFT = RECURRENCE
# The rms of an irregular motion fluctuates by itself; only more than this between the halves is called drift.
IRREGULAR_DRIFT = 0.1
# A motion that does not come back is quasi-periodic when lines that are combinations of the base frequencies hold this
# share of its variance; the smallest lines that are looked for hold 1e-4 of what the strongest does.
EXPLAINED = 0.99
FLOOR = 1e-2


class Kind(StrEnum):
    """The kind of a motion, as far as its record shows."""

    STEADY = "steady"
    PERIODIC = "periodic"
    QUASI_PERIODIC = "quasi-periodic"
    IRREGULAR = "irregular"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Regime:
    """The kind of motion and what it was told by; None where a number has no meaning or could not be found.

    `recurrence_error` is rms |y(t+T) − y(t)| / rms y at the period found (the larger of those after one period and
    after many), or the smallest at any lag searched when no period was found. `amplitude_drift` is the rms of the
    second half over that of the first, minus 1, of the signal in which it is farthest from 0. Base frequencies are one
    of a periodic motion, two or three of a quasi-periodic one, with uncertainties where they were told by lines;
    `explained_share` is the share of the variance in lines that are combinations of those that were found, None where
    lines were not looked for, and `resolution_Hz` the lowest base frequency that the record could have told.
    `record_needed_s` is the length of record that holds enough periods, where this one is known to be too short.
    """

    kind: Kind
    period_s: float | None
    base_frequencies_Hz: tuple[float, ...]
    recurrence_error: float | None
    amplitude_drift: float | None
    reason: str
    base_uncertainties_Hz: tuple[float, ...] = ()
    explained_share: float | None = None
    resolution_Hz: float | None = None
    record_needed_s: float | None = None


def classify(signals: ArrayLike, sample_rate: float, *, scale: ArrayLike, lowest_frequency: float) -> Regime:
    """Tell the regime of the saturated part of a record, a word for it and what it was told by.

    `signals` (time, k), each column in its own unit; `scale` (k,), what would count as motion in each of them;
    `sample_rate` and `lowest_frequency`, the lowest that matters, in Hz. The start-up must have been cut off.

    - unknown: fewer than 20 periods of `lowest_frequency`, or of the period found, are recorded, or the motion
      still drifts.
    - steady: no signal moves about its mean by more than 1e-6 of its scale.
    - periodic: with the signals that do move scaled to unit rms, there is a period T with

          e(T) = rms |y(t + T) − y(t)| / rms y ≤ 1e-2

      and this still holds after many periods (2^j T, as far as half the record). That tells a cycle, whose error
      stays, from a torus that nearly closes or a slow beat, whose error grows with every turn. The shortest such T
      is returned, so a subharmonic weaker than half a per cent of the rms is not seen.
    - quasi-periodic: stationary, does not come back, and lines that are integer combinations of two or three base
      frequencies (`find_lines`, `find_bases`) hold 99 % of its variance.
    - irregular: stationary and neither: chaos, noise, or a torus of more bases. Chaos so weak that its lines are sharp
      within this record counts as quasi-periodic; only the largest Lyapunov exponent tells them apart.

    Where the lines have one base frequency alone, the motion is a cycle longer than was looked for: periodic if it was
    recorded 20 times and comes back after that period, too, or else unknown.

    Drift is a change of rms between the halves, or of the mean relative to the rms, by more than 1e-2 in a motion
    that comes back after T (measured over whole periods), by more than 0.1 in one that does not.

    e is computed on a record interpolated band-limited to 8 times the rate, at all lags through the
    autocorrelation, from half a period of the strongest spectral peak to a third of the record or 20 periods of
    `lowest_frequency`, whichever is less, then refined between the lags. A cycle longer than that is not told from
    a torus. A component above 0.84 of the Nyquist frequency is damped by the interpolation.

    Raises ValueError for NaN, for fewer than 16 samples, and for arguments of wrong shape or sign.

    Source: recurrence as the test of periodicity, J.-P. Eckmann, S. O. Kamphorst and D. Ruelle, "Recurrence plots
    of dynamical systems", Europhysics Letters 4, 1987; interpolation, `scipy.signal.resample_poly`.
    """
    record = finite_record("signals", signals, dimensions=2)
    rate = positive("sample_rate", sample_rate)
    lowest = below_nyquist("lowest_frequency", lowest_frequency, rate)
    sizes = _checked_scale(scale, record.shape[1])
    duration = record.shape[0] / rate
    if duration * lowest < PERIODS_NEEDED * (1.0 - 1e-9):
        return _unknown(
            f"The record is too short to tell: {duration:.4g} s hold {duration * lowest:.1f} periods of the lowest "
            f"frequency of {lowest:.5g} Hz, and {PERIODS_NEEDED} are needed; record at least "
            f"{PERIODS_NEEDED / lowest:.4g} s.",
            needed=PERIODS_NEEDED / lowest,
        )
    motion = record - record.mean(axis=0)
    del record
    relative = 0.5 * np.ptp(motion, axis=0) / sizes
    if np.all(relative < STEADY):
        return _steady(motion, float(relative.max()))
    # A signal at rest is round-off: scaled to unit rms it would drown the others in noise.
    moving = motion[:, relative >= STEADY]
    del motion
    moving /= np.sqrt(np.mean(moving**2, axis=0))
    return _moving_regime(moving, rate, LONGEST_PERIOD / lowest)


def _moving_regime(unit: NDArray[np.float64], rate: float, longest_period: float) -> Regime:
    """Tell the regime of signals (time, k) of zero mean and unit rms."""
    returns, smallest = find_recurrences(unit, longest_period * rate)
    lasting = next((item for item in returns if item.lasts), None)
    first = lasting or next(iter(returns), None)
    period = None if first is None else first.period / rate
    amplitude_drift, mean_drift = _drift(unit, None if first is None else first.period)
    allowed = IRREGULAR_DRIFT if first is None else PERIODIC_DRIFT
    error = smallest if lasting is None else max(lasting.error, lasting.later_error)
    if abs(amplitude_drift) > allowed or mean_drift > allowed:
        return _drifting(amplitude_drift, mean_drift, error)
    if error is None:
        return _unknown(
            "The record is too short to tell: its strongest component is slower than any period that could be looked "
            "for; record for longer or lower the lowest frequency.",
            drift=amplitude_drift,
        )
    if lasting is None or period is None:
        return _not_periodic(unit, rate, error, amplitude_drift, nearly=first is not None)
    held = unit.shape[0] / rate / period
    if held < PERIODS_NEEDED:
        return _unknown(
            f"The record is too short to tell: the motion seems to repeat every {period:.5g} s, but only {held:.1f} "
            f"such periods are recorded, and {PERIODS_NEEDED} are needed; "
            f"record at least {PERIODS_NEEDED * period:.4g} s.",
            error,
            amplitude_drift,
            PERIODS_NEEDED * period,
        )
    every = f"every {period:.6g} s ({1.0 / period:.6g} Hz)"
    reason = f"The motion repeats {every} with a recurrence error of {100 * error:.2g}% of rms."
    return Regime(Kind.PERIODIC, period, (1.0 / period,), error, amplitude_drift, reason)


def _not_periodic(unit: NDArray[np.float64], rate: float, error: float, drift: float, *, nearly: bool) -> Regime:
    """Tell a torus, or a long cycle, from irregular motion by the lines of a stationary record."""
    lines = find_lines(unit, rate, floor=FLOOR)
    bases, duration = find_bases(lines), unit.shape[0] / rate
    found, known = bases.frequency_Hz.tolist(), bases.uncertainty_Hz.tolist()
    if nearly:
        what = f"its recurrence error is {100 * error:.2g}% of rms after one period, but larger after many"
    else:
        what = (
            f"its recurrence error is {100 * error:.2g}% of rms at best, and up to {RECURRENCE:.0%} would be periodic"
        )
    what = f"The motion is stationary but not periodic: {what}."
    slower = f"frequencies below {lines.resolution_Hz:.2g} Hz cannot be resolved in {duration:.2g} s"
    share, base = f"hold {bases.explained:.2%} of its variance", told_frequencies(found, known, 6)

    def told(kind: Kind, reason: str, period: float | None = None) -> Regime:
        kept = slice(None) if bases.explained >= EXPLAINED else slice(0)
        return Regime(
            kind, period, tuple(found[kept]), error, drift, reason, tuple(known[kept]), bases.explained,
            lines.resolution_Hz,
        )  # fmt: skip

    if bases.explained < EXPLAINED:
        held = f"its {lines.frequency_Hz.size} strongest lines hold {1.0 - lines.left:.2%} of its variance"
        which = f"{held}, those that are combinations of three frequencies {bases.explained:.2%}"
        apart = f"lines closer than {lines.resolution_Hz:.2g} Hz are one in {duration:.2g} s"
        return told(Kind.IRREGULAR, f"{what} It is irregular: {which}; {apart}.")
    if len(found) > 1:
        return told(
            Kind.QUASI_PERIODIC, f"{what} Combinations of the fundamental frequencies {base} {share}; {slower}."
        )
    if duration * found[0] < PERIODS_NEEDED:
        needed = PERIODS_NEEDED / found[0]
        longer = f"record at least {needed:.4g} s, {PERIODS_NEEDED} periods of it"
        return replace(told(Kind.UNKNOWN, f"{what} Multiples of {base} {share}; {longer}."), record_needed_s=needed)
    back = recurrence_after(unit, rate / found[0])
    left = math.inf if back is None else max(back.error, back.later_error)
    if left > RECURRENCE:
        against = f"but the recurrence error after {1.0 / found[0]:.6g} s is {100 * left:.2g}% of rms"
        return replace(told(Kind.UNKNOWN, f"Multiples of {base} {share}, {against}."), recurrence_error=left)
    repeats = f"the motion repeats every {1.0 / found[0]:.6g} s with a recurrence error of {100 * left:.2g}% of rms"
    return replace(
        told(Kind.PERIODIC, f"Multiples of {base} {share}: {repeats}.", 1.0 / found[0]), recurrence_error=left
    )


def told_frequencies(frequencies: Sequence[float], uncertainties: Sequence[float], most: int) -> str:
    """Frequencies in words, to the digits that they are known to, `most` significant ones."""
    told = []
    for frequency, uncertainty in zip(frequencies, uncertainties, strict=True):
        known = math.floor(math.log10(frequency)) - math.floor(math.log10(max(uncertainty, 1e-9 * frequency)))
        digits = max(1, min(most, known + 1))
        told.append(f"{frequency:.{max(0, digits - 1 - math.floor(math.log10(frequency)))}f}")
    return f"{', '.join(told[:-1])} and {told[-1]} Hz" if len(told) > 1 else f"{told[0]} Hz" if told else ""


def _checked_scale(scale: ArrayLike, columns: int) -> NDArray[np.float64]:
    sizes = np.asarray(scale, dtype=np.float64)
    if sizes.shape != (columns,):
        raise ValueError(f"scale must have one entry for each of the {columns} signals, got shape {sizes.shape}")
    if not np.all(np.isfinite(sizes) & (sizes > 0.0)):
        raise ValueError(f"scale must be finite and positive, got {sizes}")
    return sizes


def _steady(motion: NDArray[np.float64], largest: float) -> Regime:
    moved = motion[:, np.any(motion != 0.0, axis=0)]
    drift = _drift(moved, None)[0] if moved.size else 0.0
    reason = f"Nothing moves: the largest amplitude is {largest:.2g} of its scale, and {STEADY:g} would be motion."
    if drift > IRREGULAR_DRIFT:
        reason += " What little there is still grows, so a longer record may show motion."
    return Regime(Kind.STEADY, None, (), None, drift, reason)


def _unknown(
    reason: str, error: float | None = None, drift: float | None = None, needed: float | None = None
) -> Regime:
    return Regime(Kind.UNKNOWN, None, (), error, drift, reason, record_needed_s=needed)


def _drifting(amplitude_drift: float, mean_drift: float, error: float | None) -> Regime:
    if abs(amplitude_drift) >= mean_drift:
        what = f"the rms {'grows' if amplitude_drift > 0 else 'falls'} by {abs(amplitude_drift):.2g} of itself"
    else:
        what = f"the mean moves by {mean_drift:.2g} of the rms"
    reason = f"The motion still drifts: {what} from the first half of the record to the second; record for longer."
    return _unknown(reason, error, amplitude_drift)


def _drift(motion: NDArray[np.float64], period: float | None) -> tuple[float, float]:
    """Return the change of rms (signed) and of mean between the halves, cut to whole periods (samples) where known."""
    half = motion.shape[0] // 2
    length = half if period is None or period > half else min(half, round(half // period * period))
    first, second = motion[:length], motion[-length:]
    before, after = (np.sqrt(np.mean(part**2, axis=0)) for part in (first, second))
    change = after / np.maximum(before, np.finfo(np.float64).tiny) - 1.0
    shift = np.abs(second.mean(axis=0) - first.mean(axis=0)) / np.sqrt(np.mean(motion**2, axis=0))
    return float(change[np.argmax(np.abs(change))]), float(shift.max())
