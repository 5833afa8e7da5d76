"""Which of the squeals that coexist in a scene a record of saturated squeal is: each is fitted, and one is taken."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import IntegrationError, RequestError
from drumsqueal.findings.signals.sound import level_dB
from drumsqueal.findings.signals.spectra import amplitude_spectrum, find_harmonics, find_tones
from drumsqueal.progress import Progress
from drumsqueal.questions.compare.study import WIDEST as PAIRED
from drumsqueal.questions.fit.estimate import AMBIGUOUS, LIKELY
from drumsqueal.questions.fit.record import LOWEST, RecordLine, RecordReading
from drumsqueal.questions.fit.squeal import (
    WIDEST,
    Fitted,
    SimulatedSqueal,
    Varied,
    fit_squeal,
    scenes_that_squeal,
    settled,
)
from drumsqueal.scene import Scene, SceneError

OVERTONES = (2, 3, 4, 5)  # times the main line
# Rms difference of overtones up to which two signals are one motion's, and beyond which, where another squeal is that
# near, they are not: 0.2 dB where the numbers are found, 1.4 dB where one that is open is off by 23 %, 5 dB of squeals
# that coexist (and, rarely, where an open number is off).
SAME_DB, OTHER_DB = 2.0, 4.0
FARTHEST = 0.5  # of log number, in the second search


class ChosenFit(NamedTuple):
    """The fit that is taken, other fits that do as well, and how many transients were run.

    `squeals` are the frequencies (Hz) of the squeals that were found in the scene, `later` of those at the numbers
    where a second search began. The lines before, of the fit and of its rivals, are those of the scene.
    """

    fitted: Fitted
    rivals: tuple[Fitted, ...]
    transients: int
    squeals: tuple[float, ...]
    later: tuple[float, ...]

    @property
    def known(self) -> bool:
        """Whether the squeal is the only one in each search, or its overtones are not those of another motion."""
        alone, apart = not (self.squeals[1:] or self.later[1:]), self.fitted.apart_dB
        return alone or apart is None or apart < OTHER_DB


def fit_squeals(scene: Scene, run: Varied, reading: RecordReading, rate: float) -> ChosenFit:
    """Fit each squeal of the scene that has a line near the strongest measured one, the nearest first.

    One that meets the lines with the overtones of the record is taken at once. Of several that meet them otherwise the
    one with the smallest change of the numbers is taken, and the others are `rivals`. Where none meets them, the search
    begins anew with the squeals where the best fit would have gone on to; all squeals are taken to have shifted there
    as that one. Raises RequestError where the scene does not squeal, or in no line like the measured ones.
    """
    x, tried = np.zeros(run.scale.before.size), list[Fitted]()
    heard: list[tuple[float, ...]] = []  # in each search
    firsts, shift = tuple[SimulatedSqueal, ...](), 1.0
    own = settled(run.change(scene, x), run.signal, run.progress)  # alone first: the others take minutes
    check_fundamental(reading, [own] if own else [])
    for _ in range(2):
        begun = scenes_that_squeal(run.change(scene, x), run.progress)
        squeals = _different([_found(each, run.signal, run.progress) for each in begun])
        check_fundamental(reading, squeals)
        heard.append(tuple(each.lines[0].frequency_Hz for each in squeals))
        for squeal in _near(squeals, reading.lines):
            fitted = fit_squeal(run, reading.lines, squeal, x)
            if fitted is None:
                continue
            if firsts:
                fitted = fitted._replace(before=_lines_before(fitted.before / shift, firsts))
            tried.append(fitted._replace(apart_dB=_apart_dB(fitted, reading, rate)))
            if tried[-1].met and _is_heard(tried[-1]):
                break
        if not tried:
            raise RequestError(_unlike(scene, reading.lines, heard[0]))
        met = [each for each in tried if each.met]
        if met:
            break
        if not firsts:
            nearest = min(tried, key=lambda each: each.miss)
            x = np.clip(nearest.wanted, -FARTHEST, FARTHEST)
            firsts, shift = tuple(each.begun for each in tried), nearest.shift(x)
    best = _best(met or tried)
    rivals = tuple(each for each in met if each is not best and _as_likely(each, best))
    transients = sum(each.transients for each in tried)
    return ChosenFit(best, rivals, transients, heard[0], heard[1] if heard[1:] else ())


def _apart_dB(fitted: Fitted, reading: RecordReading, rate: float) -> float | None:
    """How far the overtones of a fit are from those of the record."""
    measured = overtones(reading.values, rate, fitted.used[0].frequency_Hz)
    simulated = overtones(fitted.squeal.values, fitted.squeal.scene.simulate.sample_rate, float(fitted.after[0]))
    return overtones_apart(measured, simulated)


def _is_heard(fitted: Fitted) -> bool:
    """Whether its overtones are those of the record."""
    return fitted.apart_dB is not None and fitted.apart_dB < SAME_DB


def _found(scene: Scene, signal: str, progress: Progress) -> SimulatedSqueal | None:
    """One of the squeals that coexist, with numbers of the search; None where its transient fails."""
    try:
        return settled(scene, signal, progress)
    except (IntegrationError, SceneError):
        return None


def check_fundamental(reading: RecordReading, squeals: Sequence[SimulatedSqueal]) -> None:
    """Raise RequestError where the strongest line is a harmonic of a squeal, and the record lacks its fundamental.

    It is what is nearest: a harmonic, a line of a squeal or a mode that grows. Lines are one as for `compare`.
    """
    strongest = reading.lines[0].frequency_Hz
    heard = [*(line.frequency_Hz for line in reading.lines), *reading.left_out_Hz]
    own = [f for squeal in squeals for f in (*squeal.unstable_Hz, *(line.frequency_Hz for line in squeal.lines))]
    for squeal in squeals:
        rate = squeal.scene.simulate.sample_rate
        tones = find_tones(squeal.values, rate, segment=squeal.values.size / rate, lowest=LOWEST)
        frequency, amplitude = tones.peaks
        harmonics = find_harmonics(frequency, amplitude, tones.spectrum.resolution_Hz)
        for f, harmonic in zip(frequency.tolist(), harmonics, strict=True):
            if harmonic is None or _apart(strongest, [f]) > min(PAIRED, _apart(strongest, own)):
                continue
            of_a_mode = _apart(f, own) * f < tones.spectrum.resolution_Hz
            fundamental = float(frequency[harmonic.fundamental])
            if not of_a_mode and _apart(fundamental, heard) > PAIRED:
                which = f"{f:.0f} Hz, {harmonic.order} times the {fundamental:.0f} Hz at which the scene squeals"
                why = f"the strongest line of the record, {strongest:.0f} Hz, is near {which}"
                cure = "take a channel or a part that holds both, or correct the scene"
                raise RequestError(f"{why}, and the record has no line there: a harmonic is a line of no mode; {cure}")


def _apart(frequency: float, lines: Sequence[float]) -> float:
    """How far, as a fraction, a frequency is from the nearest of some lines (Hz)."""
    return min((abs(frequency / line - 1) for line in lines), default=math.inf)


def _lines_before(expected: NDArray[np.float64], squeals: Sequence[SimulatedSqueal]) -> NDArray[np.float64]:
    """The lines (Hz) of the scene's squeal that has one nearest to the first expected, each nearest to its own."""

    def nearest(squeal: SimulatedSqueal, frequency: float) -> float:
        return min((line.frequency_Hz for line in squeal.lines), key=lambda own: abs(math.log(own / frequency)))

    own = min(squeals, key=lambda squeal: abs(math.log(nearest(squeal, expected[0]) / expected[0])))
    return np.array([nearest(own, frequency) for frequency in expected.tolist()])


def _best(tried: Sequence[Fitted]) -> Fitted:
    if not any(each.met for each in tried):
        return min(tried, key=lambda each: each.miss)
    return min(list(filter(_is_heard, tried)) or tried, key=lambda each: float(np.linalg.norm(each.estimate.x)))


def _as_likely(other: Fitted, best: Fitted) -> bool:
    """Whether overtones and the change of the numbers leave another fit as likely as the best."""
    if _is_heard(best) and other.apart_dB is not None and other.apart_dB > OTHER_DB:
        return False
    costs = [float(np.sum((each.estimate.x / LIKELY) ** 2)) for each in (best, other)]
    return costs[1] - costs[0] < AMBIGUOUS


def _different(found: Sequence[SimulatedSqueal | None]) -> list[SimulatedSqueal]:
    """Each squeal once."""
    squeals: list[SimulatedSqueal] = []
    for each in found:
        if each is not None and not any(is_same(each.lines[0], other.lines[0]) for other in squeals):
            squeals.append(each)
    return squeals


def is_same(one: RecordLine, other: RecordLine) -> bool:
    """Whether two lines are one in frequency and amplitude."""
    frequency, amplitude = one.frequency_Hz / other.frequency_Hz, one.amplitude / other.amplitude
    # 1e-3 and 0.03, relative, of one squeal after two starts
    return abs(math.log(frequency)) < 1e-3 and abs(math.log(amplitude)) < 0.03


def _near(squeals: Sequence[SimulatedSqueal], measured: Sequence[RecordLine]) -> list[SimulatedSqueal]:
    """Those with a line within reach of the strongest measured one, the nearest first."""

    def apart(squeal: SimulatedSqueal) -> float:
        return min(abs(math.log(line.frequency_Hz / measured[0].frequency_Hz)) for line in squeal.lines)

    return sorted((each for each in squeals if apart(each) < WIDEST), key=apart)


class Overtones(NamedTuple):
    """Levels of multiples of a line, and of what lies beside each (dB re the line); NaN beyond half the sample rate."""

    level: NDArray[np.float64]
    noise: NDArray[np.float64]


def overtones(values: NDArray[np.float64], rate: float, line: float) -> Overtones:
    """The overtones of a line (Hz) of a signal."""
    spectrum = amplitude_spectrum(values, rate, zero_padding=4)
    width = 2 * spectrum.resolution_Hz
    off = np.abs(spectrum.frequency_Hz - line)
    level = level_dB(spectrum.amplitude, float(spectrum.amplitude[off < width].max()) / math.sqrt(2))
    found = Overtones(*np.full((2, len(OVERTONES)), np.nan))
    for j, n in enumerate(OVERTONES):
        off = np.abs(spectrum.frequency_Hz - n * line)
        near, beside = level[off < width], level[(off > 2 * width) & (off < line / 3)]
        if n * line + width < rate / 2 and near.size and beside.size:
            found.level[j], found.noise[j] = near.max(), np.median(beside)
    return found


def overtones_apart(measured: Overtones, simulated: Overtones) -> float | None:
    """Rms difference (dB) of overtones, of those that stand out of the measured noise in either; None without one."""
    # 12.0 dB over the noise beside it, from which an overtone is one
    floor = measured.noise + 12.0
    seen = np.fmax(measured.level, simulated.level) > floor
    seen &= np.isfinite(measured.level) & np.isfinite(simulated.level)
    if not seen.any():
        return None
    apart = np.maximum(measured.level, floor) - np.maximum(simulated.level, floor)
    return float(np.sqrt(np.mean(apart[seen] ** 2)))


def _unlike(scene: Scene, lines: Sequence[RecordLine], squeals: Sequence[float]) -> str:
    """Why no squeal of the scene can be fitted."""
    if not squeals:
        fault = "the record is squeal that has saturated, but this scene does not squeal, from its own start or after"
        cure = "change numbers so that it does (drumsqueal onset finds where), or take the record with --as linear"
        return f"{fault} large disturbances, within {scene.simulate.duration:g} s; {cure}"
    heard, own = (", ".join(f"{f:.0f}" for f in each) for each in ([line.frequency_Hz for line in lines], squeals))
    return f"the scene squeals at {own} Hz, and no line of the record ({heard} Hz) is near; correct it"
