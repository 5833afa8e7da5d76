"""Fits to saturated squeal, by transients of the scene itself: each squeal that coexists is fitted, one is taken."""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drumsqueal.dynamics.attractor import SteadyResponse
from drumsqueal.dynamics.ensemble import (
    Family,
    IntegratorOptions,
    Start,
    directions,
    find_attractors,
    point_of,
    round_of,
)
from drumsqueal.errors import COMPLETE, IntegrationError, RequestError
from drumsqueal.files.history_file import SavedHistory
from drumsqueal.findings.history import to_dataset
from drumsqueal.findings.saturation import saturated_part
from drumsqueal.findings.signals.sound import level_dB
from drumsqueal.findings.signals.spectra import amplitude_spectrum, find_harmonics, find_tones
from drumsqueal.findings.vibration import first_boundary_time
from drumsqueal.physics.composition import linear_coordinates
from drumsqueal.physics.model import build_model
from drumsqueal.progress import Progress, named
from drumsqueal.questions.compare.study import WIDEST as PAIRED
from drumsqueal.questions.compare.study import match_lines
from drumsqueal.questions.export.signals import make_channels
from drumsqueal.questions.fit.estimate import (
    AMBIGUOUS,
    LIKELY,
    POOR,
    WIDTH,
    Estimate,
    Residuals,
    Scale,
    assess,
    estimate,
)
from drumsqueal.questions.fit.record import LOWEST, RecordLine, RecordReading, saturated_lines
from drumsqueal.questions.sensitivity.study import at_one_time
from drumsqueal.scene import Scene, SceneError
from drumsqueal.simulation import check_transient, follow, prepare, start_of, steady_at_start
from drumsqueal.solve.linear.modes import analyse_stability
from drumsqueal.solve.transient.integrate import Chunk

# The squeals of a scene that coexist: where transients from its own start and from large disturbances lead.


def scenes_that_squeal(scene: Scene, progress: Progress) -> tuple[Scene, ...]:
    """The scene once for each squeal that was found, with a start on that motion.

    Starts are its own, a small one, and velocities along each mode, either way, in sizes beyond the nearer contact
    boundary, as `drumsqueal onset` tries them.
    """
    frozen = at_one_time(scene, prepare(scene).stability.time)
    model = build_model(frozen)
    stability = analyse_stability(build_model(frozen, coordinates=linear_coordinates(frozen)))
    family, point = Family(lambda _: model, model.names, stability.coordinates), point_of(0, stability)
    starts = [Start("own", *start_of(scene, model.names)), family.small_start(point, model)]
    for way in directions(point, family):
        # 1.0 of the nearer contact boundary: a smaller disturbance leads where small vibration does
        starts += [way.start(size) for size in way.sizes if size * way.boundary_ratio > 1.0]
    simulate = scene.simulate
    how = IntegratorOptions(simulate.sample_rate, simulate.tolerance, round_of(stability, model.names), simulate.solver)
    found: list[SteadyResponse] = []
    responses = find_attractors(
        family, [(point, start) for start in starts], how, progress=named(progress, "squeals of the scene")
    )
    for motion in (response.motion for response in responses):
        if motion is not None and not any(motion.same(other) for other in found):
            found.append(motion)
    return tuple(started(scene, model.names, *motion.state) for motion in found)


def started(scene: Scene, names: Sequence[str], displacement: ArrayLike, velocity: ArrayLike) -> Scene:
    """The scene with a start at a displacement from steady sliding and a velocity (n,) of the named coordinates."""
    start = {"displacement": displacement, "velocity": velocity}
    tables = {kind: dict(zip(names, np.asarray(each).tolist(), strict=True)) for kind, each in start.items()}
    return scene.with_values({"start": tables})


# Of log number, for derivatives by differences: 1 % of a frequency, hundreds of times its error; where it is not above
# that, or the motion is another there, other steps are tried.
STEPS = (0.02, -0.02, 0.08)
WIDEST = 0.3  # between a measured line and the simulated one at the scene's numbers
# A squeal goes over into another one where log frequency and log amplitude of its line change by more than so many
# times log number, and a little: they change by 0.5 and up to 4 times, between squeals by 3 % and 30 % and more.
STEEPEST, BY_CHANCE = (1.5, 8.0), (2e-3, 0.05)
NOISE = 3.0  # times the error of a derivative by differences, below which it is none
FEWEST = 64  # samples of the saturated part


class SimulatedSqueal(NamedTuple):
    """A saturated transient: its lines, strongest first, its signal, and the scene with a start where it ended.

    `unstable_Hz` are the frequencies of the modes that grow about its steady sliding.
    """

    lines: tuple[RecordLine, ...]
    values: NDArray[np.float64]
    scene: Scene
    unstable_Hz: tuple[float, ...] = ()


class Varied(NamedTuple):
    """What is fitted: scenes with numbers at x, `change(scene, x)`, and the signal whose lines are compared."""

    change: Callable[[Scene, NDArray[np.float64]], Scene]
    scale: Scale
    signal: str
    progress: Progress


class Fitted(NamedTuple):
    """Numbers fitted to saturated lines: the estimate, the lines `used`, the same before the search and after (Hz).

    The search has `begun` with a squeal and ends with another one. `wanted` is where the lines would be met if they
    went on changing as at its end. `apart_dB` is the rms difference of the measured overtones from the fitted ones,
    None without one that stands out of the noise.
    """

    estimate: Estimate
    used: tuple[RecordLine, ...]
    before: NDArray[np.float64]
    after: NDArray[np.float64]
    begun: SimulatedSqueal
    squeal: SimulatedSqueal
    wanted: NDArray[np.float64]
    transients: int
    apart_dB: float | None = None

    @property
    def miss(self) -> float:
        """By how much it misses the lines, χ²."""
        return self.estimate.chi_square_per_freedom or 0.0

    @property
    def met(self) -> bool:
        """Whether it misses the lines by no more than chance."""
        return self.miss <= POOR**2

    def shift(self, x: NDArray[np.float64]) -> float:
        """The factor by which its line is to change at x, on the way to where it would be the measured one."""
        way = float(np.linalg.norm(self.wanted))
        part = float(np.linalg.norm(x)) / way if way else 0.0
        return (self.used[0].frequency_Hz / float(self.before[0])) ** part


def simulate(scene: Scene, signal: str, progress: Progress) -> SimulatedSqueal | None:
    """The saturated part of a transient of a scene; None where it does not saturate.

    Raises SceneError and IntegrationError where there is no such transient.
    """
    prepared = prepare(scene, runs=True)
    check_transient(prepared)
    chunks: list[Chunk] = []
    follow(prepared, chunks.append, progress, what="transient of the fitted scene")
    names = prepared.model.names
    history = to_dataset(chunks, scene, names, COMPLETE)
    boundary = first_boundary_time(history, prepared.stability, prepared.linear)
    if boundary is None:
        return None
    part = saturated_part(history["time"].values, boundary)
    if part.stop - part.start < FEWEST:
        return None
    saved = SavedHistory(Path(), history, scene)
    (channel,) = make_channels(saved, [signal], part)
    first, last = (float(np.std(each)) for each in np.array_split(channel.values, 3)[::2])
    # 0.3 of its rms in the first third of the saturated part, below which a motion decays in the last
    if not last > 0.3 * first:
        return None
    lines, _ = saturated_lines(channel.values, saved.sample_rate, clock=0.0)
    end = chunks[-1]
    ended = started(scene, names, end.displacement[-1] - steady_at_start(prepared), end.velocity[-1])
    unstable = tuple(mode.frequency_Hz for mode in prepared.stability.unstable)
    return SimulatedSqueal(lines, channel.values, ended, unstable) if lines else None


def settled(scene: Scene, signal: str, progress: Progress) -> SimulatedSqueal | None:
    """The same, of a transient that is three times as long where the squeal has not settled."""
    found = simulate(scene, signal, progress)
    # 2e-4 of its frequency, from which a line has not settled
    if found is None or found.lines[0].frequency_uncertainty_Hz <= 2e-4 * found.lines[0].frequency_Hz:
        return found
    return simulate(scene.with_values({"simulate.duration": 3.0 * scene.simulate.duration}), signal, progress)


def pair_squeal(measured: Sequence[RecordLine], simulated: Sequence[RecordLine]) -> tuple[int | None, ...]:
    """The simulated line of each measured one, by frequency and level."""
    frequencies = [[line.frequency_Hz for line in lines] for lines in (measured, simulated)]
    own, theirs = (
        20 * np.log10([line.amplitude / lines[0].amplitude for line in lines]) for lines in (measured, simulated)
    )
    matches = match_lines(*frequencies, widest=WIDEST, levels=(own, theirs))
    return tuple(match.reference if match is not None and match.paired else None for match in matches)


def fit_squeal(
    run: Varied, measured: Sequence[RecordLine], squeal: SimulatedSqueal, x: NDArray[np.float64]
) -> Fitted | None:
    """Fit numbers so that transients of the scene have the measured lines; None where the squeal, at x, has none.

    Each transient goes on from the end of another one at numbers that are little different, which keeps it on one of
    several squeals that coexist. Gauss–Newton steps with derivatives by differences, which Broyden's update keeps in
    between; they are taken anew at the end. The uncertainty of a line is that of the measured and of the simulated one.
    A derivative that is not well above the simulated line's uncertainty counts as zero.
    """
    pairs = pair_squeal(measured, squeal.lines)
    paired = [(line, squeal.lines[k]) for line, k in zip(measured, pairs, strict=True) if k is not None]
    if not paired:
        return None
    used = tuple(line for line, _ in paired)
    work = _Work(run, used)
    here = _Lines.of(x, [line for _, line in paired], squeal)
    before = here.frequency
    jacobian, derived_at = work.derivatives(here), here.x
    for _ in range(10):
        step = work.linear(here, jacobian).x - here.x
        moved = np.max(np.abs(jacobian @ step) / work.spread(here), initial=0.0)
        if moved < 0.1:  # of the uncertainties
            break
        for _ in range(4):
            there = work.lines(here, here.x + step, here.frequency + jacobian @ step)
            if there is not None and work.misfit(there) < work.misfit(here):
                break
            step = step / 2
        else:
            break
        missed = there.frequency - here.frequency - jacobian @ step
        jacobian = np.asarray(jacobian + np.outer(missed, step) / (step @ step), dtype=np.float64)
        here = there
    if np.max(np.abs(here.x - derived_at)) > STEPS[0]:
        jacobian = work.derivatives(here)
        step = work.linear(here, jacobian).x - here.x
        there = work.lines(here, here.x + step, here.frequency + jacobian @ step)
        if there is not None and work.misfit(there) <= work.misfit(here):
            here = there
    final = assess(*work.residuals(here, jacobian)(here.x), here.x, run.scale)
    wanted = work.linear(here, jacobian).x
    return Fitted(final, used, before, here.frequency, squeal, here.squeal, wanted, work.transients)


class _Lines(NamedTuple):
    """Lines that are followed (Hz), at x, and the squeal that has them."""

    x: NDArray[np.float64]
    frequency: NDArray[np.float64]
    error: NDArray[np.float64]
    squeal: SimulatedSqueal

    @classmethod
    def of(cls, x: NDArray[np.float64], lines: Sequence[RecordLine], squeal: SimulatedSqueal) -> "_Lines":
        frequency, error = np.array([(line.frequency_Hz, line.frequency_uncertainty_Hz) for line in lines]).T
        return cls(x, frequency, error, squeal)


class _Work:
    """Transients of the changed scene, and the linear problem about one of them."""

    def __init__(self, run: Varied, measured: Sequence[RecordLine]) -> None:
        self._run = run
        self.measured = np.array([line.frequency_Hz for line in measured])
        self.error = np.array([line.frequency_uncertainty_Hz for line in measured])
        self.transients = 1
        self.faint = np.zeros(self.measured.size)

    def lines(self, here: _Lines, x: NDArray[np.float64], expected: NDArray[np.float64]) -> _Lines | None:
        """The lines of the scene at x that are nearest to where they are expected; None where one is missing."""
        low, high = self._run.scale.bounds
        if np.any(x < low) or np.any(x > high):
            return None
        squeal = self._followed(here, x)
        if squeal is None:
            return None
        # 0.1 between a simulated line and where it was expected
        matches = match_lines(expected, [line.frequency_Hz for line in squeal.lines], widest=0.1)
        if any(match is None or not match.paired for match in matches):
            return None
        return _Lines.of(x, [squeal.lines[match.reference] for match in matches if match is not None], squeal)

    def _followed(self, here: _Lines, x: NDArray[np.float64]) -> SimulatedSqueal | None:
        """The squeal at x that one goes over into as the numbers change bit by bit; None where it ends on the way."""
        squeal = here.squeal
        count = max(1, math.ceil(float(np.max(np.abs(x - here.x))) / 0.05))  # of log number, in one go
        for k in range(1, count + 1):
            self.transients += 1
            there = self._run.change(squeal.scene, here.x + k / count * (x - here.x))
            try:
                found = simulate(there, self._run.signal, self._run.progress)
            except (IntegrationError, SceneError):  # with numbers of the search, not the scene's own: it ends there
                return None
            if found is None or _jumped(squeal.lines[0], found.lines, float(np.max(np.abs(x - here.x))) / count):
                return None
            squeal = found
        return squeal

    def derivatives(self, here: _Lines) -> NDArray[np.float64]:
        """∂f/∂x (lines, k) by differences; zero where they are not above the error.

        `faint` then is what a number may change a line by all the same (Hz).
        """
        columns = []
        self.faint = np.zeros(here.frequency.size)
        for k in range(here.x.size):
            difference, error = np.zeros(here.frequency.size), np.zeros(here.frequency.size)
            for size in STEPS:
                step = np.zeros(here.x.size)
                step[k] = size
                there = self.lines(here, here.x + step, here.frequency)
                if there is None:
                    continue
                difference = (there.frequency - here.frequency) / size
                error = np.hypot(there.error, here.error) / abs(size)
                if np.all(np.abs(difference) > NOISE * error):
                    break
            faint = np.abs(difference) <= NOISE * error
            self.faint += np.where(faint, (WIDTH * np.maximum(np.abs(difference), error)) ** 2, 0.0)
            columns.append(np.where(faint, 0.0, difference))
        return np.array(columns).T

    def spread(self, here: _Lines) -> NDArray[np.float64]:
        """Uncertainty of measured less simulated lines (Hz)."""
        return np.hypot(self.error, here.error)

    def misfit(self, here: _Lines) -> float:
        return float(np.sum(((here.frequency - self.measured) / self.spread(here)) ** 2))

    def linear(self, here: _Lines, jacobian: NDArray[np.float64]) -> Estimate:
        """The estimate where the lines change as they do at x."""
        return estimate(self.residuals(here, jacobian), self._run.scale)

    def residuals(self, here: _Lines, jacobian: NDArray[np.float64]) -> Residuals:
        """Lines less the measured ones over the uncertainty, where they change as they do at x."""
        spread = np.sqrt(self.spread(here) ** 2 + self.faint)

        def residuals(other: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            predicted = here.frequency + jacobian @ (other - here.x)
            return (predicted - self.measured) / spread, jacobian / spread[:, None]

        return residuals


def _jumped(before: RecordLine, lines: Sequence[RecordLine], step: float) -> bool:
    """Whether none of the lines is what a line has become after a step of log number."""
    nearest = min(lines, key=lambda line: abs(math.log(line.frequency_Hz / before.frequency_Hz)))
    ratios = nearest.frequency_Hz / before.frequency_Hz, nearest.amplitude / before.amplitude
    limits = (steep * step + chance for steep, chance in zip(STEEPEST, BY_CHANCE, strict=True))
    return any(abs(math.log(ratio)) > limit for ratio, limit in zip(ratios, limits, strict=True))


# Which of the squeals that coexist in a scene a record is: each is fitted, and one is taken.


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
        squeals = _squeals(run.change(scene, x), run)
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


def _squeals(scene: Scene, run: Varied) -> list[SimulatedSqueal]:
    """Each of the squeals that coexist once, with numbers of the search; without those whose transient fails."""
    squeals: list[SimulatedSqueal] = []
    for each in scenes_that_squeal(scene, run.progress):
        with suppress(IntegrationError, SceneError):
            found = settled(each, run.signal, run.progress)
            if found is not None and not any(is_same(found.lines[0], other.lines[0]) for other in squeals):
                squeals.append(found)
    return squeals


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
