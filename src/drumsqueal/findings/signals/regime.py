"""Which regime a saturated record shows: steady, periodic, quasi-periodic, irregular, or too short to decide."""

import math
from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, computed_field

from drumsqueal.coordinates import is_elastic, unit_of
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.findings.schema import Finding
from drumsqueal.findings.signals.lines import Fundamentals, Lines, change_of_lines, find_fundamentals, find_lines
from drumsqueal.findings.signals.recurrence import RECURRENCE, find_recurrences, recurrence_after
from drumsqueal.findings.signals.spectra import below_nyquist, finite_record, positive
from drumsqueal.scene.quantities import percent

# Why a motion is of its kind, in one sentence from the numbers that decided it.


_Numbers = Mapping[str, float]


class Cause(StrEnum):
    """What decided on the kind of a motion; `describe_cause` names the numbers that go with it."""

    RECORD_TOO_SHORT = "record too short"
    TOO_FEW_PERIODS = "too few periods"
    TOO_SLOW = "too slow for this record"
    NOTHING_MOVES = "nothing moves"
    RESIDUAL_MOTION = "residual motion at rest"
    DECAYS = "decays to rest"
    RESTS_ELSEWHERE = "rests elsewhere"
    DRIFTS = "drifts"
    LINE_DRIFTS = "a line drifts"
    LINES_TOO_CLOSE = "lines too close for this record"
    BRAKE_CHANGES = "drum speed or load changes"
    REPEATS = "repeats"
    APPROACHES = "approaches a periodic motion"
    NEARS = "nears a periodic motion"
    MULTIPLES_REPEAT = "multiples of one frequency, repeats"
    MULTIPLES_DO_NOT_REPEAT = "multiples of one frequency, does not repeat"
    MULTIPLES_TOO_SHORT = "multiples of one frequency, record too short"
    COMBINATIONS = "combinations of fundamental frequencies"
    NO_COMBINATIONS = "no combinations of three frequencies"


def describe_cause(
    cause: Cause, n: _Numbers, mode: str, frequencies: Sequence[float], uncertainties: Sequence[float]
) -> str:
    """The sentence of a cause, with its numbers `n`; `mode` is the slowest mode of a motion that decays."""
    listed = written_frequencies(frequencies, uncertainties, 6)
    recurrence = f"recurrence error of {percent(n['recurrence_error'])} of rms" if "recurrence_error" in n else ""
    held = f"Multiples of {listed} hold {100 * n['explained']:.2f} % of its variance" if "explained" in n else ""
    slowest = ""
    if "mode_growth_rate_1_per_s" in n:
        slowest = f"every mode decays, {mode} slowest at {_signed(n['mode_growth_rate_1_per_s'])} 1/s"
    match cause:
        case Cause.RECORD_TOO_SHORT:
            periods = n["duration_s"] * n["lowest_frequency_Hz"]
            return (
                f"The record is too short: {n['duration_s']:.4g} s hold {periods:.1f} periods of the lowest frequency "
                f"of {n['lowest_frequency_Hz']:.5g} Hz, and {n['periods_needed']:.0f} are needed; record at least "
                f"{n['record_needed_s']:.4g} s."
            )
        case Cause.TOO_FEW_PERIODS:
            return (
                f"The record is too short: the motion seems to repeat every {n['period_s']:.5g} s, but only "
                f"{n['duration_s'] / n['period_s']:.1f} such periods are recorded, and {n['periods_needed']:.0f} are "
                f"needed; record at least {n['record_needed_s']:.4g} s."
            )
        case Cause.TOO_SLOW:
            return (
                "The record is too short: its strongest component is slower than any period that could be looked for; "
                "record for longer or lower the lowest frequency."
            )
        case Cause.NOTHING_MOVES:
            more = " The residual motion still grows, so a longer record may show motion." if n["grows"] else ""
            largest = f"the largest amplitude is {n['amplitude']:.2g} of its scale"
            return f"Nothing moves: {largest}, and {n['least']:g} would be motion.{more}"
        case Cause.RESIDUAL_MOTION:
            left = f"the residual motion is {n['boundary_fraction']:.2g} of what reaches a contact boundary"
            return f"Nothing moves: {left}, and {slowest}."
        case Cause.RESTS_ELSEWHERE:
            return f"Nothing moves: the motion rests in another equilibrium, {rest_words(n)}."
        case Cause.DECAYS:
            rate = f"below the contact boundaries the rms velocity changes by {_signed(n['rate_1_per_s'])} 1/s"
            return f"The motion decays to rest: {rate}, and {slowest}."
        case Cause.DRIFTS:
            drift, grows = 100 * abs(n["amplitude_drift"]), n["amplitude_drift"] > 0
            if abs(n["amplitude_drift"]) < n["mean_drift"]:
                return _drifts(f"the mean moves by {100 * n['mean_drift']:.1f} % of the rms")
            return _drifts(f"the rms {'grows' if grows else 'falls'} by {drift:.1f} %")
        case Cause.LINE_DRIFTS:
            verb = "grows" if n["line_change"] > 0 else "falls"
            return _drifts(f"its line at {n['line_Hz']:.4g} Hz {verb} by {percent(abs(n['line_change']))}")
        case Cause.LINES_TOO_CLOSE:
            both, gap = f"{n['line_Hz']:.5g} and {n['next_Hz']:.5g} Hz", abs(n["line_Hz"] - n["next_Hz"])
            return (
                f"The record is too short: half of its {n['duration_s']:.2g} s resolves lines "
                f"{2 * n['resolution_Hz']:.2g} Hz apart, and its lines at {both} are {gap:.2g} Hz apart, so that it "
                f"does not show whether they last; record at least {n['record_needed_s']:.4g} s."
            )
        case Cause.BRAKE_CHANGES:
            return "Drum speed or load change, and the motion with them."
        case Cause.REPEATS:
            return f"The motion repeats every {n['period_s']:.6g} s ({1 / n['period_s']:.6g} Hz) with a {recurrence}."
        case Cause.APPROACHES | Cause.NEARS:
            orbit = f"a stable periodic motion of {n['frequency_Hz']:.6g} Hz, found by shooting from its last state"
            left = f"{percent(n['distance'])} of its size away at the end of the record"
            falls = f"disturbances of it change by {_signed(n['rate_1_per_s'])} 1/s"
            if cause is Cause.NEARS:
                return (
                    f"The motion nears {orbit}, but is {left}; {falls}; record at least {n['record_needed_s']:.3g} s."
                )
            return f"The motion approaches {orbit} (periodicity residual {n['residual']:.1g}): {left}, and {falls}."
        case Cause.MULTIPLES_REPEAT:
            return f"{held}: the motion repeats every {n['period_s']:.6g} s with a {recurrence}."
        case Cause.MULTIPLES_DO_NOT_REPEAT:
            error = f"the recurrence error after {n['period_s']:.6g} s is {percent(n['recurrence_error'])} of rms"
            return f"{held}, but {error}."
        case Cause.MULTIPLES_TOO_SHORT:
            longer = f"record at least {n['record_needed_s']:.4g} s, {n['periods_needed']:.0f} periods of it"
            return f"{_not_periodic_words(n)} {held}; {longer}."
        case Cause.COMBINATIONS:
            slower = f"frequencies below {n['resolution_Hz']:.2g} Hz cannot be resolved in {n['duration_s']:.2g} s"
            combined = f"Combinations of the fundamental frequencies {listed} hold {100 * n['explained']:.2f} %"
            return f"{_not_periodic_words(n)} {combined} of its variance; {slower}."
        case Cause.NO_COMBINATIONS:
            lines = f"its {n['lines']:.0f} strongest lines hold {100 * n['in_lines']:.2f} % of its variance"
            combined = f"those that are combinations of three frequencies {100 * n['explained']:.2f} %"
            apart = f"lines closer than {n['resolution_Hz']:.2g} Hz are one in {n['duration_s']:.2g} s"
            return f"{_not_periodic_words(n)} It is irregular: {lines}, {combined}; {apart}."


def _drifts(what: str) -> str:
    return f"The motion still drifts: {what} from the first half of the record to the second; record for longer."


def _not_periodic_words(n: _Numbers) -> str:
    error = f"its recurrence error is {percent(n['recurrence_error'])} of rms"
    if n["nearly"]:
        return f"The motion is stationary but not periodic: {error} after one period, but larger after many."
    limit = f"{100 * n['recurrence_limit']:.0f} % would be periodic"
    return f"The motion is stationary but not periodic: {error} at best, and up to {limit}."


def _signed(value: float) -> str:
    """A number of four digits with a minus sign, not a hyphen."""
    return f"{value:.4g}".replace("-", "−")


def written_frequencies(frequencies: Sequence[float], uncertainties: Sequence[float], most: int) -> str:
    """Frequencies in words, to the digits that they are known to, `most` significant ones."""
    texts = []
    for frequency, uncertainty in zip(frequencies, uncertainties, strict=True):
        known = math.floor(math.log10(frequency)) - math.floor(math.log10(max(uncertainty, 1e-9 * frequency)))
        digits = max(1, min(most, known + 1))
        texts.append(f"{frequency:.{max(0, digits - 1 - math.floor(math.log10(frequency)))}f}")
    return f"{listed(texts)} Hz" if texts else ""


def listed(words: Sequence[str]) -> str:
    """One or more things in words: a, b and c."""
    return f"{', '.join(words[:-1])} and {words[-1]}" if len(words) > 1 else words[0]


def rest_words(place: Mapping[str, float]) -> str:
    """Where a motion rests elsewhere (m, rad), by the names of the coordinates.

    Round-off is left out, and elastic coordinates are where there are others: these say where the body is.
    """
    # 1e-6 of the largest coordinate of a unit: far above round-off, and below the four digits that are shown
    largest: dict[str, float] = {}
    for name, number in place.items():
        largest[unit_of(name)] = max(largest.get(unit_of(name), 0.0), abs(number))
    moved = [name for name, number in place.items() if number and abs(number) >= 1e-6 * largest[unit_of(name)]]
    shown = [name for name in moved if not is_elastic(name)] or moved
    return f"at {', '.join(f'{name} = {place[name]:.4g} {unit_of(name)}' for name in shown)} from steady sliding"


class Regime(Finding):
    """The kind of a motion, what decided on it and the numbers of that; None where a number was not found.

    `recurrence_error` is rms |y(t+T) − y(t)| / rms y at the period found (the larger of those after one period and
    after many), or the smallest at any lag searched when no period was found. `amplitude_drift` is the rms of the
    second half over that of the first, minus 1, of the signal in which it is farthest from 0. Fundamental frequencies
    are one of a periodic motion, two or three of a quasi-periodic one, which may be a cycle that repeats after many
    periods of theirs, with uncertainties where they come from lines;
    `explained_fraction` is the fraction of the variance in lines that are combinations of those that were found, None
    where lines were not looked for, and `resolution_Hz` the lowest fundamental frequency that the record could show.
    `record_needed_s` is the length of record that holds enough periods, or tells the lines apart, where this one is
    known to be too short.
    """

    kind: Kind
    cause: Cause
    numbers: dict[str, float] = Field(default_factory=dict)
    mode: str = ""
    period_s: float | None = None
    base_frequencies_Hz: tuple[float, ...] = ()
    recurrence_error: float | None = None
    amplitude_drift: float | None = None
    base_uncertainties_Hz: tuple[float, ...] = ()
    explained_fraction: float | None = None
    resolution_Hz: float | None = None
    record_needed_s: float | None = None

    @computed_field
    @property
    def reason(self) -> str:
        """What decided on the kind, in a sentence."""
        known = self.base_uncertainties_Hz or (0.0,) * len(self.base_frequencies_Hz)
        return describe_cause(self.cause, self.numbers, self.mode, self.base_frequencies_Hz, known)


def classify(signals: ArrayLike, sample_rate: float, *, scale: ArrayLike, lowest_frequency: float) -> Regime:
    """Classify the regime of the saturated part of a record, with the evidence.

    `signals` (time, k), each column in its own unit; `scale` (k,), what would count as motion in each of them;
    `sample_rate` and `lowest_frequency`, the lowest that matters, in Hz. The start-up must have been cut off.

    - unknown: fewer than 20 periods of `lowest_frequency`, or of the period found, are recorded, the motion still
      drifts, or a line changes that half the record does not tell from the next one.
    - steady: no signal moves about its mean by more than 1e-6 of its scale.
    - periodic: with the signals that do move scaled to unit rms, there is a period T with

          e(T) = rms |y(t + T) − y(t)| / rms y ≤ 1e-2

      and this still holds after many periods (2^j T, as far as half the record). That identifies a cycle, whose error
      stays, from a torus that nearly closes or a slow beat, whose error grows with every turn. The shortest such T
      is returned, so a subharmonic weaker than half a per cent of the rms is not seen.
    - quasi-periodic: stationary, not recurrent, and lines that are integer combinations of two fundamental frequencies,
      or else of three, (`find_lines`, `find_fundamentals`) hold 99 % of its variance. None that matters changes by more
      than 0.1 from one half to the other.
    - irregular: stationary and neither: chaos, noise, or a torus of more fundamentals. Chaos so weak that its lines are
      sharp within this record counts as quasi-periodic; only the largest Lyapunov exponent distinguishes them.

    Where the lines have one fundamental frequency alone, the motion is a cycle longer than was looked for: periodic if
    it was recorded 20 times and recurs after that period, too, or else unknown. So it is where the motion recurs after
    the whole number of turns of the strongest line that is nearest to a period of the slowest fundamental frequency.

    Drift is a change of rms between the halves, or of the mean relative to the rms, by more than 1e-2 in a motion
    that recurs after T (measured over whole periods), by more than 0.1 in one that does not.

    e is computed on a record interpolated band-limited to 8 times the rate, at all lags through the autocorrelation,
    from half a period of the strongest spectral peak to a third of the record or 20 periods of `lowest_frequency`,
    whichever is less, then refined between the lags. A cycle longer than that is not distinguished from a torus. A
    component above 0.84 of the Nyquist frequency is damped by the interpolation.

    Raises ValueError for NaN, for fewer than 16 samples, and for arguments of wrong shape or sign.

    Source: recurrence as the test of periodicity, J.-P. Eckmann, S. O. Kamphorst and D. Ruelle, "Recurrence plots
    of dynamical systems", Europhysics Letters 4, 1987.
    """
    record = finite_record("signals", signals, dimensions=2)
    rate = positive("sample_rate", sample_rate)
    lowest = below_nyquist("lowest_frequency", lowest_frequency, rate)
    sizes = np.asarray(scale, dtype=np.float64)
    if sizes.shape != (record.shape[1],):
        raise ValueError(f"scale must have one entry for each of the {record.shape[1]} signals, got {sizes.shape}")
    if not np.all(np.isfinite(sizes) & (sizes > 0.0)):
        raise ValueError(f"scale must be finite and positive, got {sizes}")
    duration = record.shape[0] / rate
    if duration * lowest < Criteria.periods * (1.0 - 1e-9):
        short = {"duration_s": duration, "lowest_frequency_Hz": lowest}
        return _unknown(Cause.RECORD_TOO_SHORT, short, needed=Criteria.periods / lowest)
    motion = record - record.mean(axis=0)
    del record
    relative = 0.5 * np.ptp(motion, axis=0) / sizes
    if np.all(relative < Criteria.steady):
        moved = motion[:, np.any(motion != 0.0, axis=0)]
        drift = _drift(moved, None)[0] if moved.size else 0.0
        numbers = {"amplitude": float(relative.max()), "least": Criteria.steady, "grows": float(drift > Criteria.drift)}
        return Regime(kind=Kind.STEADY, cause=Cause.NOTHING_MOVES, numbers=numbers, amplitude_drift=drift)
    # A signal at rest is round-off: scaled to unit rms it would drown the others in noise.
    moving = motion[:, relative >= Criteria.steady]
    del motion
    moving /= np.sqrt(np.mean(moving**2, axis=0))
    return _moving_regime(moving, rate, Criteria.longest_period / lowest)


def _moving_regime(unit: NDArray[np.float64], rate: float, longest_period: float) -> Regime:
    """Classify the regime of signals (time, k) of zero mean and unit rms."""
    returns, smallest = find_recurrences(unit, longest_period * rate)
    first = next((item for item in returns if item.lasts), next(iter(returns), None))
    error = smallest if first is None or not first.lasts else max(first.error, first.later_error)
    amplitude_drift, mean_drift = _drift(unit, None if first is None else first.period)
    found: dict[str, Any] = {"recurrence_error": error, "amplitude_drift": amplitude_drift}
    allowed = Criteria.drift if first is None else RECURRENCE
    if abs(amplitude_drift) > allowed or mean_drift > allowed:
        return _unknown(Cause.DRIFTS, {"amplitude_drift": amplitude_drift, "mean_drift": mean_drift}, **found)
    if error is None:
        return _unknown(Cause.TOO_SLOW, {}, **found)
    if first is None or not first.lasts:
        return _not_periodic(unit, rate, error, amplitude_drift, nearly=first is not None)
    period, duration = first.period / rate, unit.shape[0] / rate
    if duration / period < Criteria.periods:
        few = {"period_s": period, "duration_s": duration}
        return _unknown(Cause.TOO_FEW_PERIODS, few, Criteria.periods * period, **found)
    found |= {"period_s": period, "base_frequencies_Hz": (1.0 / period,)}
    numbers = {"period_s": period, "recurrence_error": error}
    return Regime(kind=Kind.PERIODIC, cause=Cause.REPEATS, numbers=numbers, **found)


def _not_periodic(unit: NDArray[np.float64], rate: float, error: float, drift: float, *, nearly: bool) -> Regime:
    """Classify a torus, or a long cycle, against irregular motion by the lines of a stationary record."""
    lines = find_lines(unit, rate, floor=Criteria.faintest_line)
    fundamentals, duration = find_fundamentals(lines), unit.shape[0] / rate
    found, known = fundamentals.frequency_Hz.tolist(), fundamentals.uncertainty_Hz.tolist()
    numbers = {
        "recurrence_error": error,
        "nearly": float(nearly),
        "recurrence_limit": RECURRENCE,
        "lines": float(lines.frequency_Hz.size),
        "in_lines": 1.0 - lines.left,
        "explained": fundamentals.explained,
        "resolution_Hz": lines.resolution_Hz,
        "duration_s": duration,
    }

    def classified(kind: Kind, cause: Cause, **more: float) -> Regime:
        undone = (Cause.NO_COMBINATIONS, Cause.LINE_DRIFTS, Cause.LINES_TOO_CLOSE)
        kept = slice(0) if cause in undone else slice(None)
        return Regime(
            kind=kind,
            cause=cause,
            numbers=numbers | more,
            period_s=more["period_s"] if kind is Kind.PERIODIC else None,
            base_frequencies_Hz=tuple(found[kept]),
            recurrence_error=more.get("recurrence_error", error),
            amplitude_drift=drift,
            base_uncertainties_Hz=tuple(known[kept]),
            explained_fraction=fundamentals.explained,
            resolution_Hz=lines.resolution_Hz,
            record_needed_s=more.get("record_needed_s"),
        )

    if fundamentals.explained < Criteria.explained:
        return classified(Kind.IRREGULAR, Cause.NO_COMBINATIONS)
    if len(found) > 1:
        # Faint sidebands may know the slowest frequency worse than they seem to, and hide that it divides the others.
        strongest = int(np.argmax(lines.fraction))
        turns = max(1, round(lines.frequency_Hz[strongest] / found[0]))
        back = recurrence_after(unit, rate * turns / lines.frequency_Hz[strongest])
        if back is None or max(back.error, back.later_error) > RECURRENCE:
            if changed := _changed_line(unit, rate, lines, fundamentals):
                cause = Cause.LINES_TOO_CLOSE if "next_Hz" in changed else Cause.LINE_DRIFTS
                return classified(Kind.UNDECIDED, cause, **changed)
            fundamentals = fundamentals.fewest(lines, Criteria.explained)
            found, known = fundamentals.frequency_Hz.tolist(), fundamentals.uncertainty_Hz.tolist()
            return classified(Kind.QUASI_PERIODIC, Cause.COMBINATIONS, explained=fundamentals.explained)
        found, known = [rate / back.period], [float(lines.uncertainty_Hz[strongest]) / turns]
    if duration * found[0] < Criteria.periods:
        needed = {"record_needed_s": Criteria.periods / found[0], "periods_needed": Criteria.periods}
        return classified(Kind.UNDECIDED, Cause.MULTIPLES_TOO_SHORT, **needed)
    back = recurrence_after(unit, rate / found[0])
    left = math.inf if back is None else max(back.error, back.later_error)
    period = {"period_s": 1.0 / found[0], "recurrence_error": left}
    if left > RECURRENCE:
        return classified(Kind.UNDECIDED, Cause.MULTIPLES_DO_NOT_REPEAT, **period)
    return classified(Kind.PERIODIC, Cause.MULTIPLES_REPEAT, **period)


def _changed_line(unit: NDArray[np.float64], rate: float, lines: Lines, fundamentals: Fundamentals) -> dict[str, float]:
    """Frequency (Hz) and change of a line that does not last, of those without which the motion is no torus.

    These are all that too little would be explained without, and the strongest that needs each fundamental frequency.
    Lines closer than half the record resolves take from one another there, so that of these it is not known which
    changes: the other one's frequency (Hz) is there, too, and the record (s) whose halves resolve both.
    """
    counts = lines.fraction > 1.0 - Criteria.explained
    counts[np.argmax((fundamentals.combinations != 0) * lines.fraction[:, None], axis=0)] = True
    change = np.where(counts, change_of_lines(unit, rate, lines.frequency_Hz), 0.0)
    apart = np.abs(lines.frequency_Hz - lines.frequency_Hz[:, None]) + np.diag(np.full(change.size, np.inf))
    alone, changes = apart.min(axis=0) >= 2 * lines.resolution_Hz, np.abs(change) > Criteria.drift
    if not changes.any():
        return {}
    worst = int(np.argmax(np.abs(change) * (alone if np.any(alone & changes) else 1)))
    found = {"line_Hz": float(lines.frequency_Hz[worst]), "line_change": float(change[worst])}
    if alone[worst]:
        return found
    nearest = int(np.argmin(apart[worst]))
    needed = 2 * lines.resolution_Hz / apart[worst, nearest] * unit.shape[0] / rate
    return found | {"next_Hz": float(lines.frequency_Hz[nearest]), "record_needed_s": float(needed)}


def _unknown(cause: Cause, numbers: dict[str, float], needed: float | None = None, **found: Any) -> Regime:
    if needed is not None:
        numbers = numbers | {"record_needed_s": needed, "periods_needed": Criteria.periods}
    return Regime(kind=Kind.UNDECIDED, cause=cause, numbers=numbers, record_needed_s=needed, **found)


def _drift(motion: NDArray[np.float64], period: float | None) -> tuple[float, float]:
    """Return the change of rms (signed) and of mean between the halves, cut to whole periods (samples) where known."""
    half = motion.shape[0] // 2
    length = half if period is None or period > half else min(half, round(half // period * period))
    first, second = motion[:length], motion[-length:]
    before, after = (np.sqrt(np.mean(part**2, axis=0)) for part in (first, second))
    change = after / np.maximum(before, np.finfo(np.float64).tiny) - 1.0
    shift = np.abs(second.mean(axis=0) - first.mean(axis=0)) / np.sqrt(np.mean(motion**2, axis=0))
    return float(change[np.argmax(np.abs(change))]), float(shift.max())
