"""How many transients of one composition end, and where each leads.

Transients run together, and only the last part of each is looked at. A round lasts a hundred periods of the slowest
mode; after it a transient has decayed, has settled, or goes on, by its numbers and the linear model about steady
sliding.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drumsqueal.compilation import cores
from drumsqueal.errors import COMPLETE, Ending, Outcome
from drumsqueal.findings.decay import Rest, find_rest, is_decaying, least_stable, rate_of_halves
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.findings.signals.spectra import amplitude_spectrum, spectral_peaks
from drumsqueal.findings.vibration import boundary_ratios
from drumsqueal.physics.model import Model
from drumsqueal.progress import Progress, silent
from drumsqueal.solve.linear.modes import Stability
from drumsqueal.solve.motion import smallest_force
from drumsqueal.solve.transient.integrate import integrate_many
from drumsqueal.solve.transient.runge_kutta import AUTO
from drumsqueal.solve.transient.state import least_energy

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


class IntegratorOptions(NamedTuple):
    """How transients are integrated, as in a scene, and how long a round is (s)."""

    sample_rate: float
    tolerance: float
    round_seconds: float = 0.0
    solver: str = AUTO
    threads: int | None = None


def at_once(threads: int | None = None) -> int:
    """How many transients run together, as full as it gets: more only follow one another."""
    return (threads or cores()) * AT_ONCE


def saturated_motions(
    models: Sequence[Model],
    steady: ArrayLike,
    displacement: ArrayLike,
    velocity: ArrayLike,
    how: IntegratorOptions,
    *,
    matrices: Sequence[NDArray[np.float64]] | None = None,
    progress: Progress = silent,
) -> Iterator[Saturated]:
    """Integrate m models of one composition for a round from displacements (m, n) and yield how each ended, in order.

    Arguments as of `integrate_many`, which takes them some at a time, so that memory does not grow with m. By the state
    matrices (2n, 2n) of steady sliding, if given, it is known where each rests. `progress` is called after each chunk
    with the time reached (s).
    Raises ValueError as `integrate_many` does.
    """
    steady, displacement, velocity = (np.asarray(x, dtype=np.float64) for x in (steady, displacement, velocity))
    samples, together = round(how.round_seconds * how.sample_rate), at_once(how.threads)
    for first in range(0, len(models), together):
        some = slice(first, first + together)
        parts = [_Part(samples - round(samples / 2)) for _ in models[some]]
        stream = integrate_many(
            models[some], steady[some], displacement[some], velocity[some], duration=how.round_seconds,
            sample_rate=how.sample_rate, tolerance=how.tolerance, solver=how.solver, threads=how.threads,
        )  # fmt: skip
        with closing(stream):
            for chunk in stream:
                progress("transients", float(chunk.time[-1]), how.round_seconds)
                for k, part in enumerate(parts):
                    part.add(chunk.vibration[k], chunk.velocity[k], chunk.sticks[k])
                    if not chunk.reached[k] and part.outcome == COMPLETE:
                        begin, end = float(chunk.time[0]), float(chunk.time[-1])
                        why = f"failed: the integration stopped between t = {begin:.6g} s and {end:.6g} s"
                        part.outcome = Outcome(Ending.FAILED, why)
        linear = [None] * len(parts) if matrices is None else matrices[some]
        for part, model, sliding, matrix in zip(parts, models[some], steady[some], linear, strict=True):
            yield _looked_at(part, model, sliding, matrix, how.sample_rate)


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


class LinearModel(NamedTuple):
    """Growth rate (1/s) of the least stable motion, whether nothing grows, and whether that one does not decay."""

    rate: float
    stable: bool
    neutral: bool


class Course:
    """A transient on its way: its rounds since it began, or was made smaller, and the state that it goes on from.

    `state` (2, n) is displacement from steady sliding and velocity, of which `turns` (n,) marks the rotations. A round
    lasts `seconds`, and of the logarithm of the rms velocity in it `resolved` is known. `small` marks the transient
    from a small perturbation.
    """

    def __init__(
        self,
        state: NDArray[np.float64],
        linear: LinearModel,
        seconds: float,
        resolved: float,
        turns: Sequence[bool] = (),
        *,
        small: bool = False,
    ) -> None:
        """Begin at a state."""
        self.state, self.linear, self.resolved, self.turns, self.small = state, linear, resolved, list(turns), small
        self.seconds = self.first_seconds = seconds
        self.simulated = 0.0  # s, of all rounds, those before it was made smaller or rounds longer, too
        self.smallest_force = np.inf  # N, of all of these
        self.rounds: list[Saturated] = []
        self.probed: float | None = None  # mean kinetic energy (J) of the settled motion that was made smaller

    def add(self, motion: Saturated, rounds: int) -> Kind | None:
        """Add a round, and return where the transient leads; None while that is not clear.

        A round of stick-slip is made longer where it would hold few of its cycles. A motion has settled when for
        `rounds` rounds its rms velocity has changed by less than a tenth and, below the contact boundaries, by less
        than a tenth of what the linear growth rate would make of it, unless it fluctuates more than a round before, as
        one does that leaves an unstable cycle, and unless it changes ever more. Beyond the boundaries it must have an
        amplitude, which may not fall by more in a round than the integrator may make it, for what loses energy in each
        period is no limit cycle, and may have little left to grow. One that comes and goes has settled when its mean
        energy over ten rounds (twenty, of those that must last longer) is that over the ten before, to a fifth, and it
        neither falls nor fluctuates more, but for scatter. A motion within a tenth of the boundaries that falls where
        the linear model is stable has decayed, as has one below them whose rate comes near to the linear one as its
        energy falls; what is below the resolved size is at rest. A disturbance that has fallen to within a tenth of the
        boundaries where the linear model is unstable grows, as the small perturbation does. After sixty rounds one
        beyond them counts as squeal, too, but for one that falls, or fluctuates more and more, which is undecided.
        Where no mode decays or grows by more than is resolved, motion that has settled squeals where it sticks, or
        comes back when it has been made smaller; it is neutral where it stays smaller, or is within a tenth of the
        boundaries. A shoe that has turned further than rotations are small has run away: it may do so without coming
        near a boundary.
        """
        self.state = np.array([motion.vibration, motion.velocity])
        self.simulated += self.seconds
        self.smallest_force = min(self.smallest_force, motion.smallest_force)
        if motion.failed:
            return Kind.FAILED
        few = motion.sticking > Criteria.sticks_mostly and motion.phases < Criteria.fewest_cycles
        if few and self.seconds < Criteria.longest * self.first_seconds:
            self.seconds *= np.clip(1.5 * Criteria.fewest_cycles / max(motion.phases, 1), 2.0, Criteria.longer)
            self.rounds.clear()
            return None
        if np.any(np.abs(motion.vibration[self.turns]) > Criteria.small_rotation):
            return Kind.RUNS_AWAY
        if few:
            return Kind.UNDECIDED
        self.rounds.append(motion)
        if motion.rest.elsewhere is not None:
            return Kind.RESTS
        fraction = max(motion.boundary_ratios)
        if motion.rest.near and (found := self._by_linear_model(motion, fraction)):
            return found
        if self.has_settled(rounds):
            if not self.may_be_neutral:
                return Kind.SQUEALS
            if fraction < Criteria.small:
                return Kind.NEUTRAL
            if self.probed is not None:
                smaller = motion.kinetic_energy < Criteria.smaller * self.probed
                return Kind.NEUTRAL if smaller else Kind.SQUEALS
            self.probed, self.state = motion.kinetic_energy, Criteria.smaller * self.state  # it goes on from less
            self.rounds.clear()
        return None if len(self.rounds) < Criteria.rounds else self._cut_off(motion, fraction)

    def _by_linear_model(self, motion: Saturated, fraction: float) -> Kind | None:
        """What becomes of a motion near steady sliding that comes to this fraction of the contact boundaries."""
        linear, stable, neutral = self.linear
        if not stable:
            return Kind.GROWS if fraction < Criteria.small and not self.small else None
        if fraction == 0 or motion.at_rest:
            return Kind.DECAYS
        if neutral:
            return None
        if fraction < Criteria.small and motion.rate < 0:
            return Kind.DECAYS
        change = self.change(Criteria.lasting)
        falls = fraction < 1 and change < Criteria.nearly_linear * linear * self.seconds
        decays = (falls or is_decaying(fraction, motion.rate, linear)) and self.falls_as_linear(linear)
        return Kind.DECAYS if decays else None

    def _cut_off(self, motion: Saturated, fraction: float) -> Kind:
        """What a motion counts as that has not settled after all rounds."""
        if fraction < Criteria.beyond:
            grows = not self.linear.stable and motion.rest.near
            return Kind.GROWS if grows else Kind.UNDECIDED
        leaves = self.leaves(2 * Criteria.irregular, min(self._still, self.resolved))
        return Kind.UNDECIDED if leaves else Kind.SQUEALS

    @property
    def _still(self) -> float:
        """Change of the logarithm in a round, below which a motion within the contact boundaries has settled."""
        return np.inf if self.linear.neutral else Criteria.linear_change * abs(self.linear.rate) * self.seconds

    @property
    def may_be_neutral(self) -> bool:
        """Whether a motion that lasts may be one of any size: by the linear model, and as it does not stick."""
        return self.linear.neutral and bool(self.rounds) and self.rounds[-1].sticking <= Criteria.sticks

    @property
    def energies(self) -> list[float]:
        """Mean kinetic energy (J) of each round since it last changed much."""
        changed = [k for k, each in enumerate(self.rounds) if abs(each.drift) > Criteria.drift]
        return [each.kinetic_energy for each in self.rounds[max(changed, default=0) :]]

    def change(self, rounds: int) -> float:
        """Mean change a round of the logarithm of the rms velocity, over so many rounds; NaN before."""
        last = self.energies[-rounds:]
        if len(last) < max(rounds, 2) or min(last) <= 0:
            return np.nan
        return float(np.log(last[-1] / last[0])) / 2 / (len(last) - 1)

    def falls_as_linear(self, linear: float) -> bool:
        """Whether it falls nearly as fast as the linear model says (1/s), and the smaller it is the more so.

        Next to rest the rate is linear in the energy. What falls towards a limit cycle below the contact boundaries
        may pass that rate, too, but on a line that leads elsewhere.
        """
        if len(self.rounds) < 2 or not 0 < self.rounds[-1].kinetic_energy < self.rounds[-2].kinetic_energy:
            return False
        before, now = self.rounds[-2:]
        fallen = now.kinetic_energy / before.kinetic_energy
        at_rest = now.rate + (now.rate - before.rate) * fallen / (1 - fallen)
        return max(abs(now.rate - linear), abs(at_rest - linear)) < (1 - Criteria.nearly_linear) * abs(linear)

    def remains(self, resolved: float) -> float:
        """By how much the logarithm still grows if each change is to the one before as the last is; infinite before."""
        *before, change = np.diff(np.log(self.energies[-3:]) / 2)
        if change <= resolved:
            return 0.0
        return float(change**2 / (before[0] - change)) if before and change < before[0] else np.inf

    def converges(self) -> bool:
        """Whether the logarithm no longer changes, comes and goes, or changes ever less and has little left to do so.

        Next to an unstable cycle it changes ever more, however slowly.
        """
        *before, change = np.diff(np.log(self.energies[-3:]) / 2)
        if abs(change) <= self.resolved:
            return True
        if not before:
            return False
        slower = abs(before[0]) - abs(change)
        return bool(before[0] * change < 0 or (slower > 0 and change**2 / slower < Criteria.remains))

    def is_stationary(self, rounds: int, least: float) -> bool:
        """Whether it is an irregular motion that is in the later half of so many rounds as it was in the earlier one.

        The mean energies are alike, it falls by no more than `least` a round or than it scatters, and does not spread.
        """
        last = [each.kinetic_energy for each in self.rounds[-rounds:]]
        if len(last) < rounds or min(last) <= 0:
            return False
        earlier, later = np.mean(last[: rounds // 2]), np.mean(last[rounds // 2 :])
        return bool(abs(np.log(later / earlier)) / 2 < Criteria.drift) and not self.leaves(rounds, least)

    def leaves(self, rounds: int, least: float) -> bool:
        """Whether over so many rounds its energy falls, or its fluctuation rises, by more than they scatter."""
        last = self.rounds[-rounds:]
        if len(last) < rounds:
            return False
        energies, fluctuations = ([each.kinetic_energy for each in last], [each.fluctuation for each in last])
        falls = min(energies) > 0 and -trend(energies) / 2 > least
        return falls or (min(fluctuations) > Criteria.constant and trend(fluctuations) > 0)

    def has_settled(self, rounds: int) -> bool:
        """Whether it has, by the change of the logarithm of its rms velocity in a round.

        A limit cycle keeps its energy over a period: beyond the contact boundaries it is none where it falls by more
        than is resolved, below them where it changes by more than it would by a part of the linear rate.
        """
        motion, still = self.rounds[-1], self._still
        beyond, change = max(motion.boundary_ratios) >= Criteria.beyond, self.change(rounds)
        falls = min(still, self.resolved)
        if not abs(np.expm1(change * (rounds - 1))) < Criteria.drift:
            slow = False
        elif beyond:
            constant = motion.fluctuation < Criteria.constant
            slow = constant and change > -falls and self.remains(falls) < Criteria.remains
        else:
            slow = abs(change) < still and (np.isinf(still) or self.converges())
        before = self.rounds[-2].fluctuation if len(self.rounds) > 1 else np.inf
        if slow and not Criteria.leaves < motion.fluctuation > Criteria.faster * before:
            return not motion.at_rest
        many = 2 * Criteria.irregular if rounds >= Criteria.lasting else Criteria.irregular
        return beyond and self.is_stationary(many, falls)


def trend(values: Sequence[float]) -> float:
    """Change a round of the logarithm; zero where that is no more than it scatters."""
    (slope, _), covariance = np.polyfit(np.arange(len(values)), np.log(values), 1, cov=True)
    return float(slope) if abs(slope) > Criteria.scatter * np.sqrt(covariance[0, 0]) else 0.0


def rate_since(before: Saturated | None, motion: Saturated, seconds: float) -> float:
    """Mean growth rate (1/s) of the rms velocity since the round before, infinite where there is none."""
    if before is None or not (before.kinetic_energy > 0 and motion.kinetic_energy > 0):
        return math.inf
    return math.log(motion.kinetic_energy / before.kinetic_energy) / 2 / seconds


def has_settled(motion: Saturated, stability: Stability, earlier_rate: float = math.inf) -> bool:
    """Whether the attractor of a transient is known: a sustained motion or, where every mode decays, steady sliding.

    Where a mode grows, motion below the contact boundary has not settled, however slowly it changes. Motion beyond it
    has where its rate, from half to half of what is looked at or since the round before (`earlier_rate`, 1/s), is below
    a tenth of the linear one: of a slow growth a tenth of the motion is soon gained.
    """
    if motion.failed or motion.rest.elsewhere is not None:
        return True
    if motion.at_rest:
        return motion.rest.near
    fraction = max(motion.boundary_ratios)
    linear = least_stable(stability, stability.modes).rate
    if not stability.unstable and stability.divergence is None:
        return motion.trend == Kind.SETTLED or (motion.rest.near and is_decaying(fraction, motion.rate, linear))
    slow = min(abs(motion.rate), abs(earlier_rate)) < Criteria.linear_change * linear
    return fraction >= Criteria.beyond and motion.trend == Kind.SETTLED and slow
