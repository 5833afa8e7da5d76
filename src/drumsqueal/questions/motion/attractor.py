"""Which attractor a motion is on: decided from recurrence, fundamental frequencies and Lyapunov exponents together.

On every attractor of an autonomous flow but an equilibrium one exponent is zero. On a torus of k fundamental
frequencies (k = 1: a limit cycle) k exponents are zero and the others negative; on a chaotic attractor the largest is
positive. Where the evidence contradicts itself, or where an exponent's sign is not known, the kind is not determined.

Source: J.-P. Eckmann and D. Ruelle, "Ergodic theory of chaos and strange attractors", Reviews of Modern Physics 57,
1985.
"""

import math
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.findings.signals.growth import SURE, Exponents
from drumsqueal.findings.signals.lines import Fundamentals
from drumsqueal.findings.signals.regime import Regime, listed, written_frequencies

LATER = 2.0  # the regime is read from the later half of a record
LONGER, MOST_LONGER = 2.0, 10.0  # times the record: a rate that is all noise does not say which would resolve it
LEAST_FOLDS = 1e-6  # change of a disturbance over the whole record, below which it is the integration's own
NUMBERS = ("no", "one", "two", "three", "four")


class Doubt(StrEnum):
    """Why an attractor is not determined."""

    REGIME = "no stationary motion that was recorded for long enough"
    NO_EXPONENTS = "record too short for Lyapunov exponents"
    NO_ZERO = "no Lyapunov exponent is zero"
    POSITIVE = "a Lyapunov exponent is positive, but the lines are sharp"
    NOT_POSITIVE = "irregular, but no Lyapunov exponent is positive"
    FEWER_ZEROS = "fewer Lyapunov exponents are zero than there are fundamental frequencies"
    MORE_ZEROS = "more Lyapunov exponents are zero than there are fundamental frequencies"
    UNKNOWN_SIGN = "the uncertainty of a Lyapunov exponent is too large to know its sign"


@dataclass(frozen=True)
class ClassifiedAttractor:
    """The kind of an attractor and the numbers that decided it.

    `frequencies_Hz` are the fundamental frequencies by recurrence and lines, with `uncertainties_Hz`. `zero`,
    `positive` and `negative` count the exponents that are so beyond doubt, None where there are none. `doubt` is the
    reason why the kind is not determined, and `record_needed_s` the record (s) that it then takes at least; None where
    nothing decays, and no record may decide.
    """

    kind: Kind
    frequencies_Hz: tuple[float, ...] = ()
    uncertainties_Hz: tuple[float, ...] = ()
    zero: int | None = None
    positive: int | None = None
    negative: int | None = None
    doubt: Doubt | None = None
    record_needed_s: float | None = None


def decide_attractor(
    regime: Regime,
    fundamentals: Fundamentals | None,
    exponents: Exponents | None,
    record_s: float,
    exponents_need_s: float | None,
) -> ClassifiedAttractor:
    """Decide the kind of attractor from a record (s), of whose later half are regime and fundamental frequencies.

    `exponents_need_s` is the shortest record (s) that gives exponents, None where none does: there the regime decides.
    """
    found = _read_regime(regime, fundamentals, record_s)
    if exponents is not None:
        value, sure = exponents.exponent_1_per_s, exponents.significant
        counts = int(exponents.zero.sum()), int((sure & (value > 0)).sum()), int((sure & (value < 0)).sum())
        found = replace(found, zero=counts[0], positive=counts[1], negative=counts[2])
    if _drifts(regime) and found.positive and found.zero:  # the mean of a chaotic motion wanders
        found = replace(found, kind=Kind.IRREGULAR)
    doubt = _doubt(found, exponents, expected=exponents_need_s is not None)
    if doubt is not None:
        needed = max(
            LATER * (regime.record_needed_s or 0.0),
            LATER * Criteria.periods / min(found.frequencies_Hz, default=math.inf),
        )
        if needed <= record_s:  # enough, by what it needs, and yet it did not do
            needed = LONGER * record_s
        if doubt is not Doubt.REGIME and exponents is not None:
            needed = max(needed, _factor(found, exponents) * float(exponents.time_s[-1]), exponents_need_s or 0.0)
            if doubt is Doubt.MORE_ZEROS and not _fading(exponents).any():
                needed = None
        return replace(found, kind=Kind.UNDECIDED, doubt=doubt, record_needed_s=needed)
    return replace(found, kind=Kind.CHAOTIC) if found.positive else found


def _drifts(regime: Regime) -> bool:
    """Whether a regime is unknown though its record holds enough periods."""
    return regime.kind is Kind.UNDECIDED and regime.amplitude_drift is not None and regime.record_needed_s is None


def _read_regime(regime: Regime, fundamentals: Fundamentals | None, record_s: float) -> ClassifiedAttractor:
    """What recurrence and lines say alone."""
    frequencies, known = regime.base_frequencies_Hz, regime.base_uncertainties_Hz
    if regime.kind is Kind.UNDECIDED:
        return ClassifiedAttractor(Kind.UNDECIDED, frequencies, known)
    kind = regime.kind
    if kind is Kind.QUASI_PERIODIC and fundamentals is not None and fundamentals.frequency_Hz.size:
        frequencies, known = tuple(fundamentals.frequency_Hz.tolist()), tuple(fundamentals.uncertainty_Hz.tolist())
        if len(frequencies) == 1:  # weaker lines than the regime's show that the frequencies are locked
            long_enough = record_s / LATER * frequencies[0] >= Criteria.periods
            kind = Kind.PERIODIC if long_enough else Kind.UNDECIDED
    return ClassifiedAttractor(kind, frequencies, known or (0.0,) * len(frequencies))


def _doubt(found: ClassifiedAttractor, exponents: Exponents | None, *, expected: bool) -> Doubt | None:
    """The first contradiction in the evidence, None where there is none."""
    if not found.kind.squeals:
        return Doubt.REGIME if found.kind is Kind.UNDECIDED else None
    if exponents is None or found.zero is None or found.negative is None:
        return Doubt.NO_EXPONENTS if expected and found.kind is not Kind.PERIODIC else None  # recurrence is enough
    followed, frequencies = exponents.exponent_1_per_s.size, len(found.frequencies_Hz)
    unknown = ~(exponents.significant | exponents.zero)
    if found.negative and not found.zero and not unknown.any():
        return Doubt.NO_ZERO
    if found.kind is Kind.IRREGULAR:
        return None if found.positive else Doubt.NOT_POSITIVE
    if found.positive:
        return Doubt.POSITIVE
    if found.zero + unknown.sum() < min(frequencies, followed):
        return Doubt.FEWER_ZEROS
    if found.zero < min(frequencies, followed) or unknown[: frequencies + 1].any() or not _separated(exponents):
        return Doubt.UNKNOWN_SIGN
    return Doubt.MORE_ZEROS if found.zero > frequencies else None


def _separated(exponents: Exponents) -> bool:
    """Whether the exponents that are zero are known well enough to be none of the decay rates."""
    value, error = exponents.exponent_1_per_s, SURE * exponents.standard_error_1_per_s
    negative = exponents.significant & (value < 0)
    lowest = np.min((value - error)[exponents.zero], initial=np.inf)
    return bool(lowest > np.max((value + error)[negative], initial=-np.inf))


def _fading(exponents: Exponents) -> NDArray[np.bool_]:
    """Which exponents (k,) are those of disturbances that decay, however slowly, beyond noise and round-off."""
    least = np.maximum(SURE * exponents.standard_error_1_per_s, LEAST_FOLDS / exponents.averaged_s)
    return exponents.exponent_1_per_s < -least


def _factor(found: ClassifiedAttractor, exponents: Exponents) -> float:
    """How many times the record has to be so long for the exponents that should not be zero to differ from it."""
    size = np.maximum(np.abs(exponents.exponent_1_per_s), LEAST_FOLDS / exponents.averaged_s)
    noise = (SURE * exponents.standard_error_1_per_s / size) ** 2  # which falls as the root of the record
    times = np.maximum(2 * exponents.resolution_1_per_s / size, noise)
    times = np.where(_fading(exponents), times, np.minimum(times, MOST_LONGER))
    should_be_zero = np.argsort(size)[: max(1, len(found.frequencies_Hz))]
    open_ = ~exponents.significant
    open_[should_be_zero] = False
    return max(LONGER, float(np.max(times[open_], initial=0.0)))


def describe_attractor(
    found: ClassifiedAttractor,
    regime: Regime,
    exponents: Exponents | None,
    limited_to_s: float | None = None,
    *,
    options: bool = True,
) -> str:
    """Why the attractor is of this kind, or why that is not determined and which record it takes.

    `limited_to_s` is the computing time (s) that cut the record or the exponents short, None where nothing did.
    `options` names the options of the command that set both.
    """
    if found.doubt is None:
        return " ".join((*_evidence(found, exponents), *(() if _drifts(regime) else (regime.reason,))))
    if found.doubt is Doubt.REGIME or exponents is None:
        missing = "Lines alone do not decide, and no Lyapunov exponents are known. "
        text = f"{missing if found.doubt is Doubt.NO_EXPONENTS else ''}{regime.reason}"
    else:
        text = _contradiction(found, exponents)
    if found.record_needed_s is None:
        return f"{text} No disturbance is seen to decay: where nothing damps the motion, no record decides."
    needed = _rounded_up(found.record_needed_s)
    record = f'{needed} s (--duration "{needed} s")' if options else f"{needed} s"
    if limited_to_s is not None:
        record += f" and more computing time than {limited_to_s:g} s{' (--at-most)' * options}"
    return f"{text} This needs a record of at least {record}."


def _evidence(found: ClassifiedAttractor, exponents: Exponents | None) -> tuple[str, ...]:
    if exponents is None or found.zero is None:
        return ()
    (largest,) = written_exponents(exponents)[:1]
    if found.kind is Kind.CHAOTIC:
        return (f"The largest Lyapunov exponent is {largest} 1/s: nearby motions separate exponentially.",)
    zeros = f"{NUMBERS[found.zero].capitalize()} Lyapunov exponent{' is' if found.zero == 1 else 's are'} zero"
    return (
        f"{zeros} within the uncertainty, as {_frequencies(found)} require{'s' * (len(found.frequencies_Hz) == 1)}.",
    )


def _contradiction(found: ClassifiedAttractor, exponents: Exponents) -> str:
    """The contradiction of a motion whose exponents were followed."""
    shown, count = written_exponents(exponents), len(found.frequencies_Hz)
    unknown = [
        text
        for text, sure, zero in zip(shown, exponents.significant, exponents.zero, strict=True)
        if not (sure or zero)
    ]
    zeros = f"{NUMBERS[count]} Lyapunov exponent{'s' * (count != 1)} of zero"
    needs = f"{_frequencies(found)} require{'s' * (count == 1)} {zeros}"
    needs = needs[:1].upper() + needs[1:]
    match found.doubt:
        case Doubt.NO_ZERO:
            return f"An attractor that moves has a Lyapunov exponent of zero, but none of {listed(shown)} 1/s is."
        case Doubt.POSITIVE:
            return f"{needs} and none above it, but the largest is {shown[0]} 1/s, as in chaos."
        case Doubt.NOT_POSITIVE:
            return f"The motion is irregular, but its largest Lyapunov exponent, {shown[0]} 1/s, does not show chaos."
        case Doubt.FEWER_ZEROS:
            most = (found.zero or 0) + len(unknown)
            return f"{needs}, but of {listed(shown)} 1/s at most {NUMBERS[most]} can be zero."
        case Doubt.MORE_ZEROS:
            return (
                f"{needs}, but {NUMBERS[found.zero or 0]} of {listed(shown)} 1/s cannot be distinguished from zero: "
                "there is another frequency, or a disturbance decays too slowly for this record."
            )
        case _:
            which = listed(unknown or shown[: (found.zero or 0) + 1])
            return f"{needs}, but the uncertainty of {which} 1/s is too large to distinguish zero from decay."


def written_exponents(exponents: Exponents) -> list[str]:
    """Each exponent with the uncertainty that decides on its sign (1/s), to the digits that this one has."""
    shown = []
    for value, error in zip(exponents.exponent_1_per_s, exponents.uncertainty_1_per_s, strict=True):
        digits = max(0, 1 - math.floor(math.log10(error)))
        shown.append(f"{value:+.{digits}f} ± {error:.{digits}f}".replace("-", "−"))
    return shown


def _rounded_up(seconds: float) -> str:
    """A time to two digits that is not shorter."""
    digits = 1 - math.floor(math.log10(seconds))
    return f"{math.ceil(seconds * 10.0**digits * (1 - 1e-9)) / 10.0**digits:g}"


def _frequencies(found: ClassifiedAttractor) -> str:
    count = len(found.frequencies_Hz)
    listed = written_frequencies(found.frequencies_Hz, found.uncertainties_Hz, 6)
    return f"{NUMBERS[count]} fundamental frequenc{'y' if count == 1 else 'ies'} ({listed})"
