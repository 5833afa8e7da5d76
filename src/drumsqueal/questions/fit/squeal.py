"""Lines of the saturated squeal of a scene as functions of some of its numbers: by transients of the scene itself."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import IntegrationError, RequestError
from drumsqueal.files.saved_history import SavedHistory
from drumsqueal.findings.history import to_dataset
from drumsqueal.findings.saturation import saturated_part
from drumsqueal.findings.vibration import first_boundary_time
from drumsqueal.outcome import COMPLETE
from drumsqueal.progress import Progress
from drumsqueal.questions.compare.matching import match_lines
from drumsqueal.questions.export.signals import make_channels
from drumsqueal.questions.fit.estimate import WIDTH, Estimate, Scale, estimate
from drumsqueal.questions.fit.record import RecordLine, saturated_lines
from drumsqueal.questions.sensitivity.decay import disturbed
from drumsqueal.scene import Scene, SceneError
from drumsqueal.simulation import check_sample_rate, follow, prepare
from drumsqueal.solve.transient.integrate import Chunk

# Of log number, for derivatives by differences: 1 % of a frequency, hundreds of times its error; where it is not above
# that, or the motion is another there, other steps are tried.
STEPS = (0.02, -0.02, 0.08)
# Disturbances of 3 p0/k_c times this, 0 for the scene's own start. Squeals that coexist ask for different ones.
STARTS = (0.0, 1.0, 3.0, 10.0)
DRIFTS, LONGER = 2e-4, 3.0  # of its frequency, from which a line has not settled; the transient then is so much longer
ALIKE = 0.05  # of log frequency, within which a squeal is taken without a look at further starts
WIDEST = 0.3  # between a measured line and the simulated one at the scene's numbers
FOLLOWED = 0.1  # between a simulated line and where it was expected
NOISE = 3.0  # times the error of a derivative by differences, below which it is none
ROUNDS, HALVINGS = 8, 4
CLOSE = 0.1  # of the uncertainties: a smaller change of the residuals ends the search
FEWEST = 64  # samples of the saturated part
GONE = 0.3  # of its rms in the first third of the saturated part, below which a motion decays in the last


class Squeal(NamedTuple):
    """Lines of a saturated transient, strongest first, and its start: 0 the scene's own, or times 3 p0/k_c.

    `scene` runs for so long that they settle.
    """

    lines: tuple[RecordLine, ...]
    start: float
    scene: Scene


class Fitted(NamedTuple):
    """Numbers fitted to saturated lines: the estimate, the lines before and after (Hz), and the transients it took."""

    estimate: Estimate
    before: NDArray[np.float64]
    after: NDArray[np.float64]
    transients: int


def simulate(scene: Scene, signal: str, progress: Progress, *, start: float) -> tuple[RecordLine, ...]:
    """Lines of the saturated part of a transient from a start; none where it does not saturate."""
    started = _started(scene, start)
    prepared = prepare(started, runs=True)
    check_sample_rate(prepared)
    chunks: list[Chunk] = []
    follow(prepared, chunks.append, progress, what="transient of the fitted scene")
    history = to_dataset(chunks, started, prepared.model.names, COMPLETE)
    boundary = first_boundary_time(history, prepared.stability, prepared.linear)
    if boundary is None:
        return ()
    part = saturated_part(history["time"].values, boundary)
    if part.stop - part.start < FEWEST:
        return ()
    saved = SavedHistory(Path(), history, started)
    (channel,) = make_channels(saved, [signal], part)
    first, last = (float(np.std(each)) for each in np.array_split(channel.values, 3)[::2])
    if not last > GONE * first:
        return ()
    return saturated_lines(channel.values, saved.sample_rate, clock=0.0)[0]


def _started(scene: Scene, start: float) -> Scene:
    """The scene with a start of so many times 3 p0/k_c; 0 for its own."""
    if not start:
        return scene
    disturbance = disturbed(scene)
    size = {name: start * value for name, value in disturbance.start.displacement.items()}
    return disturbance.with_values({"start.displacement": size})


def find_squeal(scene: Scene, measured: Sequence[RecordLine], signal: str, progress: Progress) -> Squeal:
    """The squeal of the scene that is most like the measured one: from its own start, or after larger disturbances.

    Raises RequestError where the scene does not squeal, or in no line like the measured ones.
    """
    found: list[Squeal] = []
    for start in STARTS:
        try:
            whole, lines = scene, simulate(scene, signal, progress, start=start)
            if lines and lines[0].frequency_uncertainty_Hz > DRIFTS * lines[0].frequency_Hz:
                whole = scene.with_values({"simulate.duration": LONGER * scene.simulate.duration})
                lines = simulate(whole, signal, progress, start=start)
        except IntegrationError:
            whole, lines = scene, ()
        if lines:
            found.append(Squeal(lines, start, whole))
        if lines and _apart(lines[:1], measured[0].frequency_Hz) < ALIKE:
            break
    if not found:
        fault = "the record is squeal that has saturated, but this scene does not squeal, from its own start or after"
        cure = "change numbers so that it does (drumsqueal onset finds where), or take the record with --as linear"
        raise RequestError(f"{fault} large disturbances, within {scene.simulate.duration:g} s; {cure}")
    return min(found, key=lambda each: _apart(each.lines, measured[0].frequency_Hz))


def _apart(lines: Sequence[RecordLine], frequency: float) -> float:
    return min(abs(float(np.log(line.frequency_Hz / frequency))) for line in lines)


def pair_squeal(measured: Sequence[RecordLine], simulated: Sequence[RecordLine]) -> tuple[int | None, ...]:
    """The simulated line of each measured one, by frequency and level."""
    frequencies = [[line.frequency_Hz for line in lines] for lines in (measured, simulated)]
    own, theirs = (
        20 * np.log10([line.amplitude / lines[0].amplitude for line in lines]) for lines in (measured, simulated)
    )
    matches = match_lines(*frequencies, widest=WIDEST, levels=(own, theirs))
    return tuple(match.reference if match is not None and match.paired else None for match in matches)


def fit_squeal(
    change: Callable[[NDArray[np.float64]], Scene],
    measured: Sequence[RecordLine],
    start: Sequence[RecordLine],
    scale: Scale,
    signal: str,
    progress: Progress,
    *,
    begin: float,
    guess: NDArray[np.float64] | None = None,
) -> Fitted:
    """Fit numbers so that transients of the scene `change(x)` have the measured lines, of which `start` are at x = 0.

    They begin at `begin` times 3 p0/k_c, or at 0 as the scene does. The search begins at x = 0 or, where its lines are
    nearer to the measured ones, at the `guess`: Gauss–Newton steps with derivatives by differences, which Broyden's
    update keeps in between; they are taken anew at the end. The uncertainty of a line is that of the measured and of
    the simulated one. A derivative that is not well above the simulated line's uncertainty counts as zero.
    """
    work = _Work(change, measured, scale, signal, progress, begin)
    x = np.zeros(scale.before.size)
    here = _Lines(
        np.array([line.frequency_Hz for line in start]), np.array([line.frequency_uncertainty_Hz for line in start])
    )
    before = here.frequency
    guessed = None if guess is None else work.lines(guess, work.measured)
    if guess is not None and guessed is not None and work.misfit(guessed) < work.misfit(here):
        x, here = guess, guessed
    jacobian, derived_at = work.derivatives(x, here), x
    for _ in range(ROUNDS):
        step = work.step(x, here, jacobian) - x
        moved = np.max(np.abs(jacobian @ step) / work.spread(here), initial=0.0)
        if moved < CLOSE:
            break
        for _ in range(HALVINGS):
            there = work.lines(x + step, np.asarray(here.frequency + jacobian @ step, dtype=np.float64))
            if there is not None and work.misfit(there) < work.misfit(here):
                break
            step = step / 2
        else:
            break
        missed = there.frequency - here.frequency - jacobian @ step
        jacobian = np.asarray(jacobian + np.outer(missed, step) / (step @ step), dtype=np.float64)
        x, here = x + step, there
    if np.max(np.abs(x - derived_at)) > STEPS[0]:
        jacobian = work.derivatives(x, here)
        step = work.step(x, here, jacobian) - x
        there = work.lines(x + step, np.asarray(here.frequency + jacobian @ step, dtype=np.float64))
        if there is not None and work.misfit(there) <= work.misfit(here):
            x, here = x + step, there
    final = work.linear(x, here, jacobian, missed=np.abs(here.frequency - work.measured))
    return Fitted(final._replace(x=x), before, here.frequency, work.transients)


class _Lines(NamedTuple):
    frequency: NDArray[np.float64]
    error: NDArray[np.float64]


class _Work:
    """Transients of the changed scene, and the linear problem about one of them."""

    def __init__(
        self,
        change: Callable[[NDArray[np.float64]], Scene],
        measured: Sequence[RecordLine],
        scale: Scale,
        signal: str,
        progress: Progress,
        begin: float,
    ) -> None:
        self.change, self.scale, self.signal, self.progress, self.begin = change, scale, signal, progress, begin
        self.measured = np.array([line.frequency_Hz for line in measured])
        self.error = np.array([line.frequency_uncertainty_Hz for line in measured])
        self.transients = 1
        self.faint = np.zeros(self.measured.size)

    def lines(self, x: NDArray[np.float64], expected: NDArray[np.float64]) -> _Lines | None:
        """The lines (Hz) of the scene at x that are nearest to where they are expected; None where one is missing."""
        low, high = self.scale.bounds
        if np.any(x < low) or np.any(x > high):
            return None
        self.transients += 1
        try:
            found = simulate(self.change(x), self.signal, self.progress, start=self.begin)
        except (IntegrationError, SceneError):
            return None
        matches = match_lines(expected, [line.frequency_Hz for line in found], widest=FOLLOWED)
        if any(match is None or not match.paired for match in matches):
            return None
        chosen = [found[match.reference] for match in matches if match is not None]
        return _Lines(
            np.array([line.frequency_Hz for line in chosen]),
            np.array([line.frequency_uncertainty_Hz for line in chosen]),
        )

    def derivatives(self, x: NDArray[np.float64], here: _Lines) -> NDArray[np.float64]:
        """∂f/∂x (lines, k) by differences; zero where they are not above the error.

        `faint` then is what a number may change a line by all the same (Hz).
        """
        columns = []
        self.faint = np.zeros(here.frequency.size)
        for k in range(x.size):
            difference, error = np.zeros(here.frequency.size), np.zeros(here.frequency.size)
            for size in STEPS:
                step = np.zeros(x.size)
                step[k] = size
                there = self.lines(x + step, here.frequency)
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

    def linear(
        self, x: NDArray[np.float64], here: _Lines, jacobian: NDArray[np.float64], missed: float | NDArray = 0.0
    ) -> Estimate:
        """The estimate where the lines change as they do at x; `missed` (Hz) is what the search has left of them."""
        spread = np.sqrt(self.spread(here) ** 2 + missed**2 + self.faint)

        def residuals(other: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            predicted = here.frequency + jacobian @ (other - x)
            return (predicted - self.measured) / spread, jacobian / spread[:, None]

        return estimate(residuals, self.scale)

    def step(self, x: NDArray[np.float64], here: _Lines, jacobian: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where the linear problem has its solution."""
        return self.linear(x, here, jacobian).x
