"""What a measured record shows: small vibration at the eigenvalues, or squeal that has saturated; and its lines."""

import itertools
from collections.abc import Iterator
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.findings.schema import Finding, Held, InMemory
from drumsqueal.findings.signals.growth import Exponentials, find_exponentials, is_crowded
from drumsqueal.findings.signals.lines import find_lines
from drumsqueal.findings.signals.spectra import amplitude_spectrum, find_harmonics, find_tones
from drumsqueal.questions.compare.record import FASTER, Measured

LOWEST = 20.0  # Hz: below it there is no sound, but there are drifts of a measurement
LEAST = 1e-100  # span of a record in its unit: the square of 1e-50 of it, 1e-300, is above the smallest float
LONGEST = 2**16  # samples that are looked at, about where the motion is largest: 1.3 s at 50 kHz; as many take seconds
FEWEST_BLOCKS = 8
EXPLAINED = 0.02  # of the envelope, that exponentials may leave
HALF = 0.6  # of the record: the first and the last part that are compared with each other
DRIFT = 3.0  # standard errors that these differ by where a line drifts
# A sampling clock is seldom better than 10 ppm, and a transient with a tolerance of 1e-6 has its frequencies to 1e-6
# and its growth rates to 4e-8 of 2πf (docs/validation.md).
CLOCK = 1e-5
FAINTEST_SATURATED = 0.1  # of the strongest line, that counts as one of a mode in a saturated motion
SIDEBAND = 0.1  # of a frequency: lines that are closer to a stronger one are its modulation
ORDER = 6  # highest order |k1| + |k2| of combinations of two lines


class RecordKind(StrEnum):
    """What kind of motion a record, or the part of it that is used, holds."""

    LINEAR = "linear"
    SATURATED = "saturated"


class RecordLine(Finding):
    """A line with the standard uncertainty of its frequency and, in small vibration, of its growth rate."""

    frequency_Hz: float
    frequency_uncertainty_Hz: float
    growth_rate_1_per_s: float | None = None
    growth_rate_uncertainty_1_per_s: float | None = None
    amplitude: float = 1.0


class RecordReading(Finding):
    """The part of a record that is used (s), its kind and why it is that, and its lines, strongest first.

    `left_out_Hz` are harmonics, combinations and sidebands of a saturated motion, which are lines of no mode.
    """

    kind: RecordKind
    reason: str
    from_s: float
    until_s: float
    lines: tuple[RecordLine, ...]
    left_out_Hz: tuple[float, ...] = ()
    values: InMemory[NDArray[np.float64]] = Held


def read_lines(measured: Measured, kind: RecordKind | None = None) -> RecordReading:
    """Find the lines of a record, as those of small vibration or of saturated squeal; `kind` forces one of the two.

    Small vibration is a sum of lines that grow or decay exponentially. The whole record is tried, of a ring-down from
    its largest value on, then what comes before (after) the envelope reaches 35 % to 10 % of its largest value, which
    must grow (decay) five times. A record in which nothing grows or decays is saturated where its strongest line has
    harmonics. Raises RequestError for a record that is too short, has no line or does not move.
    """
    values, start = _strongest_stretch(measured)
    rate = measured.sample_rate
    block = _block(measured.name, values, rate)
    stays = kind is not RecordKind.LINEAR and _saturates(values, rate, block)
    if kind is not RecordKind.SATURATED and not stays:
        part = _linear_part(values, rate, block)
        if part is None and kind is RecordKind.LINEAR:
            part = slice(0, values.size), "the record is taken as small vibration, as asked"
        if part is not None:
            found = _linear(values, rate, part[0], start, part[1])
            if found is not None:
                return found
            if kind is RecordKind.LINEAR:
                raise RequestError(f"the measured {measured.name!r}: no line stands out of its noise")
    why = "it is no sum of lines that grow or decay exponentially"
    if stays:
        why = "it neither grows nor decays, and a line has harmonics"
    why = "the record is taken as saturated squeal, as asked" if kind is not None else f"{why}: saturated squeal"
    return _saturated(measured.name, values, rate, block, start, why)


def _strongest_stretch(measured: Measured) -> tuple[NDArray[np.float64], float]:
    """The record or, of a long one, the stretch with its largest value in the middle; and when it begins (s)."""
    values = np.asarray(measured.values, dtype=np.float64)
    span = float(np.ptp(values))
    if not LEAST < span < 1 / LEAST:
        why = f"its values span {span:g}, too little or too much to be squared"
        raise RequestError(f"the measured {measured.name!r}: {why}; take a channel that moves, and correct its unit")
    first = 0
    if values.size > LONGEST:
        first = int(np.clip(int(np.argmax(np.abs(values))) - LONGEST // 2, 0, values.size - LONGEST))
    return values[first : first + LONGEST], measured.start_s + first / measured.sample_rate


def _block(name: str, values: NDArray[np.float64], rate: float) -> int:
    """Samples over which the envelope is a mean. Raises RequestError for a record that is too short."""
    if not rate > 2 * LOWEST:
        why = f"its sample rate, {rate:.6g} Hz, is too low for sound, from {LOWEST:g} Hz on"
        raise RequestError(f"the measured {name!r}: {why}; {FASTER}")
    spectrum = amplitude_spectrum(values, rate, zero_padding=1)
    heard = spectrum.frequency_Hz >= LOWEST
    strongest = float(spectrum.frequency_Hz[heard][np.argmax(spectrum.amplitude[heard])])
    # Five periods of the strongest line, and 16 samples at least
    block = max(16, round(5.0 * rate / strongest))
    if values.size < FEWEST_BLOCKS * block:
        periods = values.size / rate * strongest
        needed = FEWEST_BLOCKS * block / rate
        why = f"{values.size / rate:.4g} s hold {periods:.0f} periods of its strongest line, {strongest:.5g} Hz"
        raise RequestError(f"the measured {name!r}: {why}; take at least {needed:.3g} s")
    return block


def _envelope(values: NDArray[np.float64], block: int) -> NDArray[np.float64]:
    """Rms of each block."""
    whole = values[: values.size // block * block].reshape(-1, block)
    return np.sqrt(np.mean((whole - values.mean()) ** 2, axis=1))


def _linear_part(values: NDArray[np.float64], rate: float, block: int) -> tuple[slice, str] | None:
    """The longest part that exponentials explain, and what it is; None where there is none."""
    for part, what in _candidates(values, block):
        piece = values[part]
        found = find_exponentials(piece, rate, lowest=LOWEST)
        # Two lines for one that bends as it nears saturation are told from two modes by taking less of the record.
        crowded = is_crowded(found.frequency_Hz, 3 if what == "whole" else 2)
        if crowded or not found.frequency_Hz.size or not _explained(piece, found.rest, block):
            continue
        if what != "whole" and not _ends_alike(piece, found.rest, block, at_end=what == "growth"):
            continue
        duration = piece.size / rate
        change = abs(found.rate_1_per_s[0]) * duration
        # 5.0 standard errors from which a rate is one
        if what == "whole" or (change >= 1 and change > 5.0 * found.rate_error_1_per_s[0] * duration):
            return part, what
    return None


def _candidates(values: NDArray[np.float64], block: int) -> Iterator[tuple[slice, str]]:
    envelope = _envelope(values, block)
    first, last = (float(np.sqrt(np.mean(each**2))) for each in np.array_split(envelope, 3)[::2])
    hit = int(np.argmax(np.abs(values - values.mean())))
    # A record of a hammer test begins before the blow: a ring-down is taken from its largest value on.
    if 2 * last < first and hit < values.size // 2:
        yield slice(hit, values.size), "whole"
    else:
        yield slice(0, values.size), "whole"
    # In the mean of three blocks a single knock is no growth.
    smooth = np.convolve(np.pad(envelope, 1, mode="edge"), np.ones(3) / 3, mode="valid")
    for level in (0.35, 0.25, 0.15, 0.1):  # of the largest envelope, up to which growth may be linear
        above = np.flatnonzero(envelope > level * envelope.max())
        first, last = int(above[0]), int(above[-1]) + 1
        for part, what in ((slice(0, first), "growth"), (slice(last, envelope.size), "decay")):
            inside = smooth[part]
            if inside.size >= FEWEST_BLOCKS and inside.max() >= 5.0 * inside.min():
                yield slice(part.start * block, part.stop * block), what


def _explained(values: NDArray[np.float64], rest: NDArray[np.float64], block: int) -> bool:
    left = _envelope(rest, block)
    # Twice the noise may be left, too, and more in a twentieth of the blocks
    noise = 2.0 * float(np.quantile(left, 0.1))
    fine = left <= np.maximum(noise, EXPLAINED * _envelope(values, block))
    return bool(np.mean(fine) >= 0.95)


def _ends_alike(values: NDArray[np.float64], rest: NDArray[np.float64], block: int, *, at_end: bool) -> bool:
    """Whether as little is left next to what is not linear as elsewhere: noise hides a bend there from the envelope."""
    squares, sizes = (_envelope(each, block)[:: 1 if at_end else -1] ** 2 for each in (rest, values))
    # A quarter of a part, next to what is not linear, of which 1.25 times as much may be left as of the rest before
    loud = max(1, round(0.25 * squares.size))
    limit = 1.25**2 * np.mean(squares[:-loud]) + (EXPLAINED / 2) ** 2 * np.mean(sizes[-loud:])
    return bool(np.mean(squares[-loud:]) <= limit)


def _linear(values: NDArray[np.float64], rate: float, part: slice, start: float, what: str) -> RecordReading | None:
    """The lines of small vibration; None where there is none."""
    piece = values[part]
    found = find_exponentials(piece, rate, lowest=LOWEST)
    if not found.frequency_Hz.size:
        return None
    cut = round(HALF * piece.size)
    parts = [find_exponentials(each, rate, lowest=LOWEST) for each in (piece[:cut], piece[-cut:])]
    lines = []
    for f, df, sigma, dsigma, amplitude in zip(*found[:5], strict=True):
        omega = 2 * np.pi * f
        drift_f, drift_rate = _drift(f, parts)
        lines.append(
            RecordLine(
                frequency_Hz=float(f),
                frequency_uncertainty_Hz=float(np.sqrt(df**2 + (CLOCK * f) ** 2 + drift_f**2)),
                growth_rate_1_per_s=float(sigma),
                growth_rate_uncertainty_1_per_s=float(
                    np.sqrt(dsigma**2 + (1e-6 * omega) ** 2 + drift_rate**2 + (CLOCK * sigma) ** 2)
                ),
                amplitude=float(amplitude),
            )
        )
    of = f"all of the record from {start + part.start / rate:.4g} s on" if part.start else "all of the record"
    reasons = {
        "whole": f"{of} is a sum of lines that grow or decay exponentially: small vibration",
        "growth": "the record grows exponentially up to there: small vibration before it saturates",
        "decay": "the record decays exponentially from there on: small vibration",
    }
    until = start + (part.stop - 1) / rate
    return RecordReading(
        kind=RecordKind.LINEAR,
        reason=reasons.get(what, what),
        from_s=start + part.start / rate,
        until_s=until,
        lines=tuple(lines),
        values=piece,
    )


def _drift(frequency: float, parts: list[Exponentials]) -> tuple[float, float]:
    """Half the differences in frequency and rate of a line between two parts, where they exceed their noise."""
    pairs = []
    for part in parts:
        near = np.abs(part.frequency_Hz / frequency - 1) if part.frequency_Hz.size else np.ones(1)
        if near.min() > 0.01:
            return 0.0, 0.0
        k = int(np.argmin(near))
        pairs.append([each[k] for each in part[:4]])
    (f1, df1, s1, ds1), (f2, df2, s2, ds2) = pairs
    drift_f = abs(f1 - f2) / 2 if abs(f1 - f2) > DRIFT * np.hypot(df1, df2) else 0.0
    drift_rate = abs(s1 - s2) / 2 if abs(s1 - s2) > DRIFT * np.hypot(ds1, ds2) else 0.0
    return float(drift_f), float(drift_rate)


def _saturates(values: NDArray[np.float64], rate: float, block: int) -> bool:
    """Whether a record stays as large as it is and has harmonics: no linear motion does."""
    low, high = np.quantile(_envelope(values, block), (0.05, 0.95))
    # 5.0 ratio of nearly the largest to nearly the smallest envelope below which neither grows nor decays
    if high > 5.0 * low:
        return False
    tones = find_tones(values, rate, segment=values.size / rate, lowest=LOWEST)
    frequency, amplitude = tones.peaks
    harmonics = find_harmonics(frequency, amplitude, tones.spectrum.resolution_Hz)
    return any(harmonics)


def _saturated(
    name: str, values: NDArray[np.float64], rate: float, block: int, start: float, reason: str
) -> RecordReading:
    """The lines of saturated squeal, from when the envelope has reached half its largest value on."""
    envelope = _envelope(values, block)
    reached = int(np.argmax(envelope >= 0.5 * envelope.max())) * block
    # As of a history: the last 60 % of what follows, by when the growth is over; all where the record starts in it.
    first = reached + round((1 - HALF) * (values.size - reached)) if reached > block else 0
    piece = values[first:]
    lines, left_out = saturated_lines(piece, rate)
    if not lines:
        raise RequestError(f"the measured {name!r}: no line stands out of its noise; take another channel or part")
    return RecordReading(
        kind=RecordKind.SATURATED,
        reason=reason,
        from_s=start + first / rate,
        until_s=start + (values.size - 1) / rate,
        lines=lines,
        left_out_Hz=left_out,
        values=piece,
    )


def saturated_lines(
    values: NDArray[np.float64], rate: float, *, clock: float = CLOCK
) -> tuple[tuple[RecordLine, ...], tuple[float, ...]]:
    """Lines of a saturated motion, strongest first, and the frequencies of its harmonics, combinations and sidebands.

    What is no multiple of a stronger line, no combination of two up to the sixth order and no sideband within 10 %
    counts as the line of a mode, down to a tenth of the strongest. The uncertainty is that of `find_lines` or, where it
    is more, half the difference between the first and the last 60 % of the record, with that of the `clock`.
    """
    tones = find_tones(values, rate, segment=values.size / rate, lowest=LOWEST)
    if not tones.peaks.frequency_Hz.size:
        return (), ()
    found = find_lines(values[:, None], rate, floor=FAINTEST_SATURATED / 2)
    cut = round(HALF * values.size)
    parts = [find_lines(each[:, None], rate, floor=FAINTEST_SATURATED / 2) for each in (values[:cut], values[-cut:])]
    amplitude = np.abs(found.amplitude[:, 0])
    kept: list[RecordLine] = []
    left_out: list[float] = []
    for f, df, size in zip(found.frequency_Hz, found.uncertainty_Hz, amplitude, strict=True):
        heard = np.min(np.abs(tones.peaks.frequency_Hz - f)) <= tones.spectrum.resolution_Hz
        if f < LOWEST or not heard:
            continue
        within = max(tones.spectrum.resolution_Hz / 2, 3 * df)
        if size < FAINTEST_SATURATED * amplitude[0] or _explained_by(f, [line.frequency_Hz for line in kept], within):
            left_out.append(float(f))
            continue
        near = [float(each.frequency_Hz[np.argmin(np.abs(each.frequency_Hz - f))]) for each in parts]
        drift = abs(near[0] - near[1]) / 2 if abs(near[0] - near[1]) < SIDEBAND * f else 0.0
        uncertainty = float(np.sqrt(max(df, drift) ** 2 + (clock * f) ** 2))
        kept.append(RecordLine(frequency_Hz=float(f), frequency_uncertainty_Hz=uncertainty, amplitude=float(size)))
    return tuple(kept), tuple(left_out)


def _explained_by(frequency: float, kept: list[float], within: float) -> bool:
    """Whether a frequency is a multiple, a combination of two, or a sideband of those that are kept."""
    for f in kept:
        multiple = max(1, round(frequency / f))
        if abs(frequency - multiple * f) <= within or abs(frequency / f - 1) < SIDEBAND:
            return True
    orders = itertools.product(range(-ORDER, ORDER + 1), repeat=2)
    orders = [(m, n) for m, n in orders if 0 < abs(m) + abs(n) <= ORDER]
    pairs = itertools.combinations(kept, 2)
    return any(abs(abs(m * f + n * g) - frequency) <= within for f, g in pairs for m, n in orders)
