"""How many transients of one composition end: run together, only the last part of each looked at."""

import os
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drumsqueal.errors import IntegrationError
from drumsqueal.findings.boundaries import boundary_ratios
from drumsqueal.findings.signals.spectra import amplitude_spectrum, spectral_peaks
from drumsqueal.outcome import COMPLETE, Ending, Outcome
from drumsqueal.physics.model import Model
from drumsqueal.precision import real
from drumsqueal.progress import Progress, silent
from drumsqueal.solve.transient.batch import integrate_many
from drumsqueal.solve.transient.integrate import Checkpoint, integrate
from drumsqueal.solve.transient.runge_kutta import AUTO, DEFAULT, is_explicit
from drumsqueal.solve.transient.segment import first_step, least_energy
from drumsqueal.solve.transient.state import CHUNK_SAMPLES, State

# Transients a thread at once. A number that never changes: each takes a program of its own, and what is left over
# starts at NaN, which costs nothing.
SLOTS = 16
LAST_FRACTION = 0.5  # of the duration that is looked at
FEWEST_SAMPLES = 16  # of what is looked at, for a spectrum
WHAT = "transients"
DRIFT = 0.1  # change of the rms from half to half of what is looked at, below which the motion has settled


class Saturated(NamedTuple):
    """How a transient ended, by the last part of it: displacements from steady sliding in m and rad, in `model.names`.

    `amplitude` (n,) is half the peak-to-peak value of each coordinate and `rms` (n,) its rms about the mean;
    `boundary_ratios` how far the motion comes towards contact loss and towards slip reversal, which have not happened
    below 1 where the steady pressure is uniform. `frequency_Hz` is that of the line with most kinetic energy, of the
    coordinate `line`; None where nothing moves. `kinetic_energy` (J) is the mean, `rate` (1/s) the mean growth rate of
    the rms velocity, weighted by mass, from the first half of the part to the second. `vibration` and `velocity` (n,)
    are where it ended: another transient can go on from there. `by_itself` marks one that was not run together with
    others, `at_rest` one whose motion is below what is resolved (`least_energy`): its numbers are round-off. One that
    failed has NaN for all numbers, and says why in `outcome`.
    """

    amplitude: NDArray[np.float64]
    rms: NDArray[np.float64]
    boundary_ratios: tuple[float, float]
    frequency_Hz: float | None
    line: str | None
    kinetic_energy: float
    rate: float
    seconds: float
    vibration: NDArray[np.float64]
    velocity: NDArray[np.float64]
    outcome: str
    by_itself: bool
    at_rest: bool = False

    @property
    def failed(self) -> bool:
        """Whether it did not get to its end."""
        return self.outcome != COMPLETE

    @property
    def drift(self) -> float:
        """Relative change of the rms velocity from half to half of what was looked at."""
        return float(np.expm1(self.rate * self.seconds / 2))

    @property
    def trend(self) -> str:
        """What it does at the end: "grows", "decays", "settled", "at rest", or "failed"."""
        if self.failed:
            return "failed"
        if self.at_rest:
            return "at rest"
        return "settled" if abs(self.drift) <= DRIFT else "grows" if self.drift > 0 else "decays"


def at_once(threads: int | None = None) -> int:
    """How many transients run together, as full as it gets: more only follow one another."""
    return (threads or os.cpu_count() or 1) * SLOTS


def saturated_motions(
    models: Sequence[Model],
    steady: ArrayLike,
    displacement: ArrayLike,
    velocity: ArrayLike,
    *,
    duration: float,
    sample_rate: float,
    tolerance: float,
    solver: str = AUTO,
    last: float = LAST_FRACTION,
    threads: int | None = None,
    by_themselves: Sequence[bool] | None = None,
    progress: Progress = silent,
) -> Iterator[Saturated]:
    """Integrate m models of one composition from displacements (m, n) and yield how each ended, in order.

    Arguments as of `integrate_many`, which takes them some at a time, so that memory does not grow with m; `last` is
    the fraction of the duration that is looked at. A transient that those methods give up (its lining would stick) or
    that asks for an implicit one goes on by itself, from the last chunk of samples that was whole; one that is known to
    (`by_themselves`, (m,)) does so from its start. `progress` is called after each chunk with the time reached (s).
    Raises ValueError as `integrate_many` does.
    """
    steady, displacement, velocity = (np.asarray(x, dtype=np.float64) for x in (steady, displacement, velocity))
    threads = threads or os.cpu_count() or 1
    samples = round(duration * sample_rate)
    how = {"duration": duration, "sample_rate": sample_rate, "tolerance": tolerance}
    for first in range(0, len(models), at_once(threads)):
        batch = range(first, min(first + at_once(threads), len(models)))
        parts = {i: _Part(displacement[i], velocity[i], samples - round(samples * last)) for i in batch}
        if solver == AUTO or is_explicit(solver):
            explicit = DEFAULT if solver == AUTO else solver
            several = {i: part for i, part in parts.items() if by_themselves is None or not by_themselves[i]}
            _together(several, models, steady, threads, progress, how | {"solver": explicit})
        for i in batch:
            if parts[i].intervals < samples:
                parts[i].by_itself = True
                _alone(parts[i], models[i], steady[i], progress, how | {"solver": solver})
            yield _looked_at(parts[i], models[i], sample_rate)


@dataclass
class _Part:
    """The last part of a transient as it comes, chunk by chunk: only samples from number `start` on are kept."""

    vibration: NDArray[np.float64]
    velocity: NDArray[np.float64]
    start: int
    intervals: int = 0
    stopped: bool = False
    outcome: Outcome = COMPLETE
    by_itself: bool = False
    kept: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = field(default_factory=list)

    def add(self, vibration: NDArray[np.float64], velocity: NDArray[np.float64]) -> None:
        """A chunk of samples (k, n); the very first one begins with the start."""
        first = self.intervals + 1 if self.intervals else 0
        fresh = slice(max(self.start - first, 0), None)
        if len(vibration[fresh]):
            self.kept.append((vibration[fresh], velocity[fresh]))
        self.intervals = first + len(vibration) - 1
        self.vibration, self.velocity = vibration[-1], velocity[-1]


def _together(
    parts: dict[int, _Part],
    models: Sequence[Model],
    steady: NDArray[np.float64],
    threads: int,
    progress: Progress,
    how: dict,
) -> None:
    """Fill the parts; one that is given up is left at its last whole chunk."""
    if not parts:
        return
    # A thread takes a run of neighbours: the transients are dealt out among the runs in turn.
    slots = {i: k % threads * SLOTS + k // threads for k, i in enumerate(parts)}
    some = next(iter(parts))
    used, places = [models[some]] * (threads * SLOTS), np.tile(steady[some], (threads * SLOTS, 1))
    vibration, velocity = np.full_like(places, np.nan), np.full_like(places, np.nan)
    for i, slot in slots.items():
        used[slot], places[slot] = models[i], steady[i]
        vibration[slot], velocity[slot] = parts[i].vibration, parts[i].velocity
    with closing(integrate_many(used, places, vibration, velocity, threads=threads, **how)) as stream:
        for chunk in stream:
            progress(WHAT, float(chunk.time[-1]), how["duration"])
            for i, slot in slots.items():
                parts[i].stopped |= not chunk.reached[slot]
                if not parts[i].stopped:
                    parts[i].add(chunk.vibration[slot], chunk.velocity[slot])
            if all(part.stopped for part in parts.values()):
                return


def _alone(part: _Part, model: Model, steady: NDArray[np.float64], progress: Progress, how: dict) -> None:
    """Go on with one transient by itself, by the methods that can stick."""
    state = State(real(part.vibration), real(part.velocity), real(0.0))
    since = Checkpoint(part.intervals, state, first_step(model), 0.0, sticks=False, method=None)
    assert part.intervals % CHUNK_SAMPLES == 0
    try:
        with closing(integrate(model, steady, part.vibration, part.velocity, since=since, **how)) as stream:
            for chunk in stream:
                progress(WHAT, float(chunk.time[-1]), how["duration"])
                part.add(chunk.displacement - steady, chunk.velocity)
    except IntegrationError as error:
        part.outcome = Outcome(Ending.FAILED, f"failed: {error}")


def _looked_at(part: _Part, model: Model, sample_rate: float) -> Saturated:
    n = len(model.names)
    if part.outcome != COMPLETE:
        lost = np.full(n, np.nan)
        return Saturated(
            lost, lost, (np.nan, np.nan), None, None, np.nan, np.nan, 0.0, lost, lost, part.outcome, part.by_itself
        )
    vibration, velocity = (np.concatenate(pieces) for pieces in zip(*part.kept, strict=True))
    seconds, half = (len(vibration) - 1) / sample_rate, len(vibration) // 2
    mass = np.asarray(model.mass)
    before, after = (float(mass @ np.mean(each**2, axis=0)) for each in (velocity[:half], velocity[half:]))
    rate = np.log(after / before) / seconds if min(before, after) > 0 else 0.0  # half the logarithm over half the time
    kinetic = (before + after) / 4
    # Of a vibration half the energy is kinetic. What moves without stiffness has no other, and any motion of it counts.
    at_rest = not np.any(np.ptp(vibration, axis=0)) or 2 * kinetic < float(least_energy(model))
    frequency, line = (None, None) if at_rest else _strongest(velocity, mass, model.names, sample_rate)
    return Saturated(
        amplitude=np.ptp(vibration, axis=0) / 2,
        rms=np.std(vibration, axis=0),
        boundary_ratios=boundary_ratios(model, vibration, velocity),
        frequency_Hz=frequency,
        line=line,
        kinetic_energy=kinetic,
        rate=float(rate),
        seconds=seconds,
        vibration=part.vibration,
        velocity=part.velocity,
        outcome=part.outcome,
        by_itself=part.by_itself,
        at_rest=at_rest,
    )


def _strongest(
    velocity: NDArray[np.float64], mass: NDArray[np.float64], names: tuple[str, ...], sample_rate: float
) -> tuple[float | None, str | None]:
    """The line that holds most kinetic energy, ∝ mass × (amplitude of the velocity)², and its coordinate."""
    found: list[tuple[float, float | None, str | None]] = [(0.0, None, None)]
    for k, name in enumerate(names if len(velocity) >= FEWEST_SAMPLES else ()):
        if np.ptp(velocity[:, k]) > 0:
            peaks = spectral_peaks(amplitude_spectrum(velocity[:, k], sample_rate), count=1, floor=0.5)
            strengths = zip(mass[k] * peaks.amplitude**2, peaks.frequency_Hz, strict=True)
            found += [(float(energy), float(frequency), name) for energy, frequency in strengths]
    return max(found, key=lambda each: each[0])[1:]
