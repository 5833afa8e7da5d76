"""How many transients of one composition end: run together, only the last part of each looked at."""

import os
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drumsqueal.errors import COMPLETE, Ending, Outcome
from drumsqueal.findings.decay import Rest, find_rest, rate_of_halves
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.findings.signals.spectra import amplitude_spectrum, spectral_peaks
from drumsqueal.findings.vibration import boundary_ratios
from drumsqueal.physics.model import Model
from drumsqueal.progress import Progress, silent
from drumsqueal.solve.pulling import smallest_force
from drumsqueal.solve.transient.batch import integrate_many
from drumsqueal.solve.transient.resolution import least_energy
from drumsqueal.solve.transient.runge_kutta import AUTO

AT_ONCE = 16  # transients a thread, so that memory does not grow with their number


class Saturated(NamedTuple):
    """How a transient ended, by the last part of it: displacements from steady sliding in m and rad, in `model.names`.

    `amplitude` (n,) is half the peak-to-peak value of each coordinate and `rms` (n,) its rms about the mean;
    `boundary_ratios` how far the motion comes towards contact loss and towards slip reversal, which have not happened
    below 1 where the steady pressure is uniform. `frequency_Hz` is that of the line with most kinetic energy, of the
    coordinate `line`; None where nothing moves. `kinetic_energy` (J) is the mean, `rate` (1/s) the mean growth rate of
    the rms velocity, weighted by mass, from the first half of the part to the second. `vibration` and `velocity` (n,)
    are where it ended: another transient can go on from there. `at_rest` marks one whose motion is below what is
    resolved (`least_energy`): its numbers are round-off. `fluctuation` is by how much the rms of a coordinate comes and
    goes: its standard deviation over `PARTS` parts that overlap by half, of its mean, at most. `smallest_force` (N) is
    that of all of it, see `pulling.smallest_force`. `sticking` is the fraction of the time during which the contact
    sticks, `phases` how often it comes to. `rest` says whether it is near steady sliding, or rests elsewhere. One that
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
    at_rest: bool = False
    fluctuation: float = 0.0
    smallest_force: float = np.inf
    sticking: float = 0.0
    phases: int = 0
    rest: Rest = Rest(near=True)

    @property
    def failed(self) -> bool:
        """Whether it did not get to its end."""
        return self.outcome != COMPLETE

    @property
    def drift(self) -> float:
        """Relative change of the rms velocity from half to half of what was looked at."""
        return float(np.expm1(self.rate * self.seconds / 2))

    @property
    def trend(self) -> Kind:
        """What it does at the end: it grows, decays or has settled, is at rest or rests elsewhere, or has failed."""
        if self.failed:
            return Kind.FAILED
        if self.rest.elsewhere is not None:
            return Kind.RESTS
        if self.at_rest:
            return Kind.AT_REST
        if abs(self.drift) <= Criteria.drift:
            return Kind.SETTLED
        return Kind.GROWS if self.drift > 0 else Kind.DECAYS


def at_once(threads: int | None = None) -> int:
    """How many transients run together, as full as it gets: more only follow one another."""
    return (threads or os.cpu_count() or 1) * AT_ONCE


def saturated_motions(
    models: Sequence[Model],
    steady: ArrayLike,
    displacement: ArrayLike,
    velocity: ArrayLike,
    *,
    matrices: Sequence[NDArray[np.float64]] | None = None,
    duration: float,
    sample_rate: float,
    tolerance: float,
    solver: str = AUTO,
    last: float = 0.5,
    threads: int | None = None,
    progress: Progress = silent,
) -> Iterator[Saturated]:
    """Integrate m models of one composition from displacements (m, n) and yield how each ended, in order.

    Arguments as of `integrate_many`, which takes them some at a time, so that memory does not grow with m; `last` is
    the fraction of the duration that is looked at. By the state matrices (2n, 2n) of steady sliding, if given, it is
    known where each rests. `progress` is called after each chunk with the time reached (s).
    Raises ValueError as `integrate_many` does.
    """
    steady, displacement, velocity = (np.asarray(x, dtype=np.float64) for x in (steady, displacement, velocity))
    samples = round(duration * sample_rate)
    for first in range(0, len(models), at_once(threads)):
        some = slice(first, first + at_once(threads))
        parts = [_Part(samples - round(samples * last)) for _ in models[some]]
        stream = integrate_many(
            models[some], steady[some], displacement[some], velocity[some], duration=duration, sample_rate=sample_rate,
            tolerance=tolerance, solver=solver, threads=threads,
        )  # fmt: skip
        with closing(stream):
            for chunk in stream:
                progress("transients", float(chunk.time[-1]), duration)
                for k, part in enumerate(parts):
                    part.add(chunk.vibration[k], chunk.velocity[k], chunk.sticks[k])
                    if not chunk.reached[k] and part.outcome == COMPLETE:
                        begin, end = float(chunk.time[0]), float(chunk.time[-1])
                        why = f"failed: the integration stopped between t = {begin:.6g} s and {end:.6g} s"
                        part.outcome = Outcome(Ending.FAILED, why)
        linear = [None] * len(parts) if matrices is None else matrices[some]
        for part, model, sliding, matrix in zip(parts, models[some], steady[some], linear, strict=True):
            yield _looked_at(part, model, sliding, matrix, sample_rate)


@dataclass
class _Part:
    """The last part of a transient as it comes, chunk by chunk: only samples from number `start` on are kept."""

    start: int
    samples: int = 0
    outcome: Outcome = COMPLETE
    lowest: float | NDArray[np.float64] = np.inf  # displacements (n,) from steady sliding, of all samples
    kept: list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]] = field(default_factory=list)

    def add(self, vibration: NDArray[np.float64], velocity: NDArray[np.float64], sticks: NDArray[np.bool_]) -> None:
        """A chunk of samples (k, n), and which of them stick (k,)."""
        fresh = slice(max(self.start - self.samples, 0), None)
        self.lowest = np.fmin(self.lowest, vibration.min(axis=0, initial=np.inf))
        if len(vibration[fresh]):
            self.kept.append((vibration[fresh], velocity[fresh], sticks[fresh]))
        self.samples += len(vibration)


def _looked_at(
    part: _Part,
    model: Model,
    steady: NDArray[np.float64],
    matrix: NDArray[np.float64] | None,
    sample_rate: float,
) -> Saturated:
    n, smallest = len(model.names), smallest_force(model, steady + part.lowest)
    # 1e70 m, rad, m/s: what has grown so far grows without bound, and its energy is a number still
    if part.outcome == COMPLETE and any(np.max(np.abs(each)) > 1e70 for kept in part.kept for each in kept[:2]):
        part.outcome = Outcome(Ending.FAILED, "failed: the motion grows without bound")
    if part.outcome != COMPLETE:
        lost = np.full(n, np.nan)
        numbers = lost, lost, (np.nan, np.nan), None, None, np.nan, np.nan, 0.0, lost, lost
        return Saturated(*numbers, part.outcome, smallest_force=smallest)
    vibration, velocity, sticks = (np.concatenate(pieces) for pieces in zip(*part.kept, strict=True))
    seconds, half = (len(vibration) - 1) / sample_rate, len(vibration) // 2
    onsets = np.flatnonzero(~sticks[:-1] & sticks[1:]) + 1
    slow = np.mean(sticks) > Criteria.sticks_mostly and 1 < onsets.size < Criteria.many_cycles
    squares = _over_cycles(velocity**2, onsets) if slow else velocity**2
    mass = np.asarray(model.mass)
    # Sharp ends would hold more or less of a period: 1e-3 of the energy, and weak damping takes less in that time.
    window = np.hanning(half + 2)[1:-1] / (half + 1) * 2
    before, after = (float(mass @ (window @ each)) for each in (squares[:half], squares[-half:]))
    kinetic = (before + after) / 4
    # Of a vibration half the energy is kinetic. What moves without stiffness has no other, and any motion of it counts.
    at_rest = not np.any(np.ptp(vibration, axis=0)) or 2 * kinetic < float(least_energy(model))
    frequency, line = (None, None) if at_rest else strongest_line(velocity, mass, model.names, sample_rate)
    return Saturated(
        amplitude=np.ptp(vibration, axis=0) / 2,
        rms=np.std(vibration, axis=0),
        boundary_ratios=boundary_ratios(model, vibration, velocity),
        frequency_Hz=frequency,
        line=line,
        kinetic_energy=kinetic,
        rate=rate_of_halves(before, after, seconds),
        seconds=seconds,
        vibration=vibration[-1],
        velocity=velocity[-1],
        outcome=part.outcome,
        at_rest=at_rest,
        fluctuation=0.0 if at_rest else _fluctuation(squares, mass),
        smallest_force=smallest,
        sticking=float(np.mean(sticks)),
        phases=onsets.size,
        rest=Rest(near=True)
        if matrix is None
        else find_rest(model, steady, matrix, [(vibration, velocity)], 1 / sample_rate),
    )


def _over_cycles(squares: NDArray[np.float64], onsets: NDArray[np.intp]) -> NDArray[np.float64]:
    """Squares (k, n) as means over cycles, from one onset of sticking to the next, for all the samples of each.

    Of slow stick-slip a part holds few cycles, and hardly any of them without one slip more or less at its ends.
    """
    lengths = np.diff(onsets)
    # Cycles that are as long to a sample are as long as their mean.
    periods = np.full(lengths.shape, lengths.mean()) if np.ptp(lengths) <= 1 else lengths
    means = np.add.reduceat(squares[: onsets[-1]], onsets[:-1]) / periods[:, None]
    lengths[0] += onsets[0]
    lengths[-1] += len(squares) - onsets[-1]
    return np.repeat(means, lengths, axis=0)


def _fluctuation(squares: NDArray[np.float64], mass: NDArray[np.float64]) -> float:
    """The standard deviation of the rms over parts, of its mean; half of that of the energies."""
    parts = 5  # of what is looked at, whose rms is compared
    length = 2 * len(squares) // (parts + 1)
    # Parts with sharp ends would hold more or less of a period: 1 % of the rms where they are ten periods long.
    window = np.hanning(length + 2)[1:-1]
    starts = np.linspace(0, len(squares) - length, parts).astype(int)
    energies = np.array([mass * (window @ squares[k : k + length]) for k in starts])
    mean = energies.mean(axis=0)
    counts = mean > 1e-2 * mean.sum()  # a coordinate that holds less of the kinetic energy does not count in that
    return float(np.max(energies.std(axis=0)[counts] / mean[counts], initial=0.0)) / 2


def strongest_line(
    velocity: NDArray[np.float64], mass: NDArray[np.float64], names: tuple[str, ...], sample_rate: float
) -> tuple[float | None, str | None]:
    """The line that holds most kinetic energy, ∝ mass × (amplitude of the velocity)², and its coordinate."""
    found: list[tuple[float, float | None, str | None]] = [(0.0, None, None)]
    for k, name in enumerate(names if len(velocity) >= 16 else ()):  # samples, for a spectrum
        if np.ptp(velocity[:, k]) > 0:
            peaks = spectral_peaks(amplitude_spectrum(velocity[:, k], sample_rate), count=1, floor=0.5)
            strengths = zip(mass[k] * peaks.amplitude**2, peaks.frequency_Hz, strict=True)
            found += [(float(energy), float(frequency), name) for energy, frequency in strengths]
    return max(found, key=lambda each: each[0])[1:]
