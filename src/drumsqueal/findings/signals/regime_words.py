"""Why a motion is of its kind, in one sentence from the numbers that decided it."""

import math
from collections.abc import Mapping, Sequence
from enum import StrEnum

from drumsqueal.coordinates import is_elastic, unit_of
from drumsqueal.scene.quantities import percent

Numbers = Mapping[str, float]
LEAST = 1e-6  # of the largest coordinate of a unit: far above round-off, and below the four digits that are shown


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
    cause: Cause, n: Numbers, mode: str, frequencies: Sequence[float], uncertainties: Sequence[float]
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
            return f"{_not_periodic(n)} {held}; {longer}."
        case Cause.COMBINATIONS:
            slower = f"frequencies below {n['resolution_Hz']:.2g} Hz cannot be resolved in {n['duration_s']:.2g} s"
            combined = f"Combinations of the fundamental frequencies {listed} hold {100 * n['explained']:.2f} %"
            return f"{_not_periodic(n)} {combined} of its variance; {slower}."
        case Cause.NO_COMBINATIONS:
            lines = f"its {n['lines']:.0f} strongest lines hold {100 * n['in_lines']:.2f} % of its variance"
            combined = f"those that are combinations of three frequencies {100 * n['explained']:.2f} %"
            apart = f"lines closer than {n['resolution_Hz']:.2g} Hz are one in {n['duration_s']:.2g} s"
            return f"{_not_periodic(n)} It is irregular: {lines}, {combined}; {apart}."


def _drifts(what: str) -> str:
    return f"The motion still drifts: {what} from the first half of the record to the second; record for longer."


def _not_periodic(n: Numbers) -> str:
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
    return f"{', '.join(texts[:-1])} and {texts[-1]} Hz" if len(texts) > 1 else f"{texts[0]} Hz" if texts else ""


def rest_words(place: Mapping[str, float]) -> str:
    """Where a motion rests elsewhere (m, rad), by the names of the coordinates.

    Round-off is left out, and elastic coordinates are where there are others: these say where the body is.
    """
    largest: dict[str, float] = {}
    for name, number in place.items():
        largest[unit_of(name)] = max(largest.get(unit_of(name), 0.0), abs(number))
    moved = [name for name, number in place.items() if number and abs(number) >= LEAST * largest[unit_of(name)]]
    shown = [name for name in moved if not is_elastic(name)] or moved
    return f"at {', '.join(f'{name} = {place[name]:.4g} {unit_of(name)}' for name in shown)} from steady sliding"
