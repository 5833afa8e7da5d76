"""Lines of the saturated squeal of a scene as functions of some of its numbers: by transients of the scene itself."""

import math
from collections.abc import Callable, Sequence
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
from drumsqueal.errors import COMPLETE, IntegrationError
from drumsqueal.files.history_file import SavedHistory
from drumsqueal.findings.history import to_dataset
from drumsqueal.findings.saturation import saturated_part
from drumsqueal.findings.vibration import first_boundary_time
from drumsqueal.physics.composition import linear_coordinates
from drumsqueal.physics.model import build_model
from drumsqueal.progress import Progress, named
from drumsqueal.questions.compare.study import match_lines
from drumsqueal.questions.export.signals import make_channels
from drumsqueal.questions.fit.estimate import POOR, WIDTH, Estimate, Residuals, Scale, assess, estimate
from drumsqueal.questions.fit.record import RecordLine, saturated_lines
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
