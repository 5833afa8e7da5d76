"""Why a motion is of its kind, in one sentence from the numbers that decided it."""

import math
from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum

Numbers = Mapping[str, float]


class Cause(StrEnum):
    """What decided on the kind of a motion; the numbers that go with it are named in `SENTENCES`."""

    RECORD_TOO_SHORT = "record too short"
    TOO_FEW_PERIODS = "too few periods"
    TOO_SLOW = "too slow for this record"
    NOTHING_MOVES = "nothing moves"
    RESIDUAL_MOTION = "residual motion at rest"
    DECAYS = "decays to rest"
    DRIFTS = "drifts"
    BRAKE_CHANGES = "drum speed or load changes"
    REPEATS = "repeats"
    MULTIPLES_REPEAT = "multiples of one frequency, repeats"
    MULTIPLES_DO_NOT_REPEAT = "multiples of one frequency, does not repeat"
    MULTIPLES_TOO_SHORT = "multiples of one frequency, record too short"
    COMBINATIONS = "combinations of fundamental frequencies"
    NO_COMBINATIONS = "no combinations of three frequencies"


def describe_cause(
    cause: Cause, numbers: Numbers, mode: str, frequencies: Sequence[float], uncertainties: Sequence[float]
) -> str:
    """The sentence of a cause; `mode` is the slowest mode of a motion that decays."""
    listed = written_frequencies(frequencies, uncertainties, 6)
    return SENTENCES[cause](numbers, listed or mode)


def written_frequencies(frequencies: Sequence[float], uncertainties: Sequence[float], most: int) -> str:
    """Frequencies in words, to the digits that they are known to, `most` significant ones."""
    texts = []
    for frequency, uncertainty in zip(frequencies, uncertainties, strict=True):
        known = math.floor(math.log10(frequency)) - math.floor(math.log10(max(uncertainty, 1e-9 * frequency)))
        digits = max(1, min(most, known + 1))
        texts.append(f"{frequency:.{max(0, digits - 1 - math.floor(math.log10(frequency)))}f}")
    return f"{', '.join(texts[:-1])} and {texts[-1]} Hz" if len(texts) > 1 else f"{texts[0]} Hz" if texts else ""


def _too_short(n: Numbers, _: str) -> str:
    periods = n["duration_s"] * n["lowest_frequency_Hz"]
    return (
        f"The record is too short: {n['duration_s']:.4g} s hold {periods:.1f} periods of the lowest frequency of "
        f"{n['lowest_frequency_Hz']:.5g} Hz, and {n['periods_needed']:.0f} are needed; record at least "
        f"{n['record_needed_s']:.4g} s."
    )


def _too_few(n: Numbers, _: str) -> str:
    held = n["duration_s"] / n["period_s"]
    return (
        f"The record is too short: the motion seems to repeat every {n['period_s']:.5g} s, but only {held:.1f} such "
        f"periods are recorded, and {n['periods_needed']:.0f} are needed; record at least "
        f"{n['record_needed_s']:.4g} s."
    )


def _nothing(n: Numbers, _: str) -> str:
    reason = f"Nothing moves: the largest amplitude is {n['amplitude']:.2g} of its scale, and {n['least']:g} would be "
    more = " The residual motion still grows, so a longer record may show motion." if n["grows"] else ""
    return f"{reason}motion.{more}"


def _slowest(n: Numbers, mode: str) -> str:
    return f"every mode decays, {mode} slowest at {signed(n['mode_growth_rate_1_per_s'])} 1/s"


def _residual(n: Numbers, mode: str) -> str:
    left = f"the residual motion is {n['boundary_fraction']:.2g} of what reaches a contact boundary"
    return f"Nothing moves: {left}, and {_slowest(n, mode)}."


def _decays(n: Numbers, mode: str) -> str:
    rate = f"below the contact boundaries the rms velocity changes by {signed(n['rate_1_per_s'])} 1/s"
    return f"The motion decays to rest: {rate}, and {_slowest(n, mode)}."


def _drifts(n: Numbers, _: str) -> str:
    if abs(n["amplitude_drift"]) >= n["mean_drift"]:
        what = f"the rms {'grows' if n['amplitude_drift'] > 0 else 'falls'} by {100 * abs(n['amplitude_drift']):.1f} %"
    else:
        what = f"the mean moves by {100 * n['mean_drift']:.1f} % of the rms"
    return f"The motion still drifts: {what} from the first half of the record to the second; record for longer."


def _repeats(n: Numbers, _: str) -> str:
    period = f"every {n['period_s']:.6g} s ({1 / n['period_s']:.6g} Hz)"
    return f"The motion repeats {period} with a recurrence error of {percent(n['recurrence_error'])} of rms."


def _not_periodic(n: Numbers) -> str:
    error = f"its recurrence error is {percent(n['recurrence_error'])} of rms"
    if n["nearly"]:
        return f"The motion is stationary but not periodic: {error} after one period, but larger after many."
    limit = f"{100 * n['recurrence_limit']:.0f} % would be periodic"
    return f"The motion is stationary but not periodic: {error} at best, and up to {limit}."


def _variance(n: Numbers) -> str:
    return f"hold {100 * n['explained']:.2f} % of its variance"


def _combinations(n: Numbers, listed: str) -> str:
    slower = f"frequencies below {n['resolution_Hz']:.2g} Hz cannot be resolved in {n['duration_s']:.2g} s"
    return f"{_not_periodic(n)} Combinations of the fundamental frequencies {listed} {_variance(n)}; {slower}."


def _no_combinations(n: Numbers, _: str) -> str:
    held = f"its {n['lines']:.0f} strongest lines hold {100 * n['in_lines']:.2f} % of its variance"
    combined = f"those that are combinations of three frequencies {100 * n['explained']:.2f} %"
    apart = f"lines closer than {n['resolution_Hz']:.2g} Hz are one in {n['duration_s']:.2g} s"
    return f"{_not_periodic(n)} It is irregular: {held}, {combined}; {apart}."


def _multiples_too_short(n: Numbers, listed: str) -> str:
    longer = f"record at least {n['record_needed_s']:.4g} s, {n['periods_needed']:.0f} periods of it"
    return f"{_not_periodic(n)} Multiples of {listed} {_variance(n)}; {longer}."


def _multiples_open(n: Numbers, listed: str) -> str:
    error = f"the recurrence error after {n['period_s']:.6g} s is {percent(n['recurrence_error'])} of rms"
    return f"Multiples of {listed} {_variance(n)}, but {error}."


def _multiples_repeat(n: Numbers, listed: str) -> str:
    error = f"with a recurrence error of {percent(n['recurrence_error'])} of rms"
    return f"Multiples of {listed} {_variance(n)}: the motion repeats every {n['period_s']:.6g} s {error}."


def percent(fraction: float) -> str:
    """A fraction as a percentage of two digits."""
    return f"{100 * fraction:.2g} %"


def signed(value: float) -> str:
    """A number of four digits with a minus sign, not a hyphen."""
    return f"{value:.4g}".replace("-", "−")


SENTENCES: Mapping[Cause, Callable[[Numbers, str], str]] = {
    Cause.RECORD_TOO_SHORT: _too_short,
    Cause.TOO_FEW_PERIODS: _too_few,
    Cause.TOO_SLOW: lambda *_: (
        "The record is too short: its strongest component is slower than any period that could be looked for; record "
        "for longer or lower the lowest frequency."
    ),
    Cause.NOTHING_MOVES: _nothing,
    Cause.RESIDUAL_MOTION: _residual,
    Cause.DECAYS: _decays,
    Cause.DRIFTS: _drifts,
    Cause.BRAKE_CHANGES: lambda *_: "Drum speed or load change, and the motion with them.",
    Cause.REPEATS: _repeats,
    Cause.MULTIPLES_REPEAT: _multiples_repeat,
    Cause.MULTIPLES_DO_NOT_REPEAT: _multiples_open,
    Cause.MULTIPLES_TOO_SHORT: _multiples_too_short,
    Cause.COMBINATIONS: _combinations,
    Cause.NO_COMBINATIONS: _no_combinations,
}
