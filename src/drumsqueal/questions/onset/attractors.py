"""The attractors along a parameter: transients from many starts, each run until it is clear where it leads.

A round lasts a hundred periods of the slowest mode; after it a transient has decayed, has settled, or goes on. All that
are at hand run together.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.findings.boundaries import boundary_ratios
from drumsqueal.findings.decay import BEYOND, NEARLY_LINEAR, SMALL, is_decaying
from drumsqueal.findings.saturated import DRIFT, Saturated, at_once, saturated_motions
from drumsqueal.findings.verdict import SMALL_ROTATION
from drumsqueal.findings.vibration import ROTATIONS
from drumsqueal.physics.model import Model
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.onset.found import SMALL_START, Kick, Leads, Motion, Response
from drumsqueal.solve.linear.branches import ModelAt, Point
from drumsqueal.solve.linear.modes import UNDAMPED_FRACTION, Mode
from drumsqueal.solve.transient.runge_kutta import AUTO

ROUND_PERIODS = 100  # of the slowest mode that oscillates freely
FREE = 0.1  # damping ratio below which a mode does: beyond it falls to half within a period or so
MOST_ROUNDS = 60
PERSISTENT, LASTING = 3, 10  # rounds a motion must last to count as settled, on the grid and at a boundary
# A motion that fluctuates by so much, and so many times more than a round before, is leaving what it was near: a cycle
# fluctuates by 1e-5, and one was seen to grow from 1.1e-4 by 2.2 times a round for six rounds before it left.
LEAVES, FASTER = 1e-4, 1.2
IRREGULAR = 20  # rounds over which one whose rms comes and goes must go on as it was
STILL = 0.1  # of the linear rate: a motion below the contact boundaries that changes so slowly has settled
SCATTER = 2.0  # standard errors of a trend: an irregular motion whose energy falls by less may not fall at all
# Of the tolerance, a round: a motion that falls by less keeps its energy as well as is known. The integrator itself
# was seen to change the rms velocity of an undamped block by a quarter of the tolerance.
RESOLVED = 10.0
STEADY = 0.02  # change of the rms from half to half below which a motion may be one that is known already
# Of the time: what sticks for longer, time and again, owes its energy to friction. Friction that does not fall only
# takes energy while it sticks: its motions come to stick for an instant, seen as up to 3e-4 of the time.
STICKS = 0.01
PROBE = 0.7  # a motion made so much smaller comes back where it is an attractor, and stays where it is one of many


class Start(NamedTuple):
    """A displacement (n,) from steady sliding and a velocity (n,), what to call them, and what they are.

    That is a disturbance along a mode, or the motion at another value.
    """

    name: str
    vibration: NDArray[np.float64]
    velocity: NDArray[np.float64]
    kick: Kick | None = None
    from_value: float | None = None


def go_on(value: float, motion: Motion, size: float = 1.0) -> Start:
    """The end of a motion at a value, or a multiple of it, as a start at another value."""
    name = f"from {value:.6g}" if size == 1 else f"{size:g} times from {value:.6g}"
    return Start(name, *(size * motion.state), from_value=value)


class How(NamedTuple):
    """How transients are integrated, as in a scene, and how long a round is (s)."""

    sample_rate: float
    tolerance: float
    round_seconds: float = 0.0
    solver: str = AUTO
    threads: int | None = None


class Family:
    """Models of one composition along a parameter: `model_at` a value, over the coordinates that move (`moving`).

    `names` are the coordinates of the linear model, which may be more.
    """

    def __init__(self, model_at: ModelAt, moving: tuple[str, ...], names: tuple[str, ...]) -> None:
        """Take the models and the names of their coordinates."""
        self.model_at, self.moving, self.names = model_at, moving, names

    def modes(self, point: Point) -> list[Mode]:
        """Modes of a point that the coordinates that move can show."""
        return [mode for mode in point.modes if mode.name in self.moving]

    def shown(self, vector: NDArray) -> NDArray:
        """The entries (n,) of the coordinates that move, of one over those of the linear model."""
        return np.array([vector[self.names.index(name)] for name in self.moving])

    def small_start(self, point: Point, model: Model) -> Start:
        """All modes at once, within `SMALL` of the nearer contact boundary."""
        modes = self.modes(point)
        parts = [self._scaled(mode, model, SMALL / len(modes)) for mode in modes]
        total = np.sum(parts, axis=0) if parts else np.zeros((2, len(self.moving)))
        return Start(SMALL_START, total[0], total[1])

    def reach(self, mode: Mode, model: Model) -> tuple[NDArray[np.complex128], list[float]]:
        """Displacement and velocity (2, n) of a mode, and the fractions of the contact boundaries that it comes to."""
        half = len(self.names)
        shape = np.array([self.shown(part) for part in (mode.right[:half], mode.right[half:])])
        turns = np.exp(2j * np.pi * np.arange(32) / 32)
        vibration, velocity = ((turns[:, None] * part).real for part in shape)
        return shape, [each for each in boundary_ratios(model, vibration, velocity) if each > 0]

    def _scaled(self, mode: Mode, model: Model, fraction: float) -> NDArray[np.float64]:
        """Displacement and velocity (2, n) of a mode of a size that comes to this fraction of the nearer boundary."""
        shape, reached = self.reach(mode, model)
        return np.real(shape) * (fraction / max(reached) if reached else 0.0)


class _Job:
    """A transient on its way."""

    def __init__(self, point: Point, start: Start, family: Family) -> None:
        self.point, self.start = point, start
        self.model, self.steady = family.model_at(point.value), family.shown(point.steady)
        self.vibration, self.velocity = start.vibration, start.velocity
        self.energies: list[float] = []  # mean kinetic energy of each round (J) since it last changed much
        self.history: list[float] = []  # and of all rounds since the start, or since it was made smaller
        self.fluctuations: list[float] = []  # of all rounds
        self.rounds = 0
        self.probed: float | None = None  # mean kinetic energy (J) of the settled motion that was made smaller

    def note(self, motion: Saturated) -> None:
        """Note the energy of a round."""
        if abs(motion.drift) > DRIFT:
            self.energies.clear()
        self.energies.append(motion.kinetic_energy)
        self.history.append(motion.kinetic_energy)
        self.fluctuations.append(motion.fluctuation)

    def change(self, rounds: int) -> float:
        """Mean change a round of the logarithm of the rms velocity, over so many rounds; NaN before."""
        last = self.energies[-rounds:]
        if len(last) < max(rounds, 2) or min(last) <= 0:
            return np.nan
        return float(np.log(last[-1] / last[0])) / 2 / (len(last) - 1)

    def falls(self, least: float) -> bool:
        """Whether the same of many rounds falls by more than `least` a round, and by more than it scatters."""
        last = self.history[-IRREGULAR:]
        if len(last) < IRREGULAR or min(last) <= 0:
            return False
        (slope, _), covariance = np.polyfit(np.arange(IRREGULAR), np.log(last) / 2, 1, cov=True)
        return bool(slope < -max(least, SCATTER * np.sqrt(covariance[0, 0])))

    def probe(self, energy: float) -> None:
        """Go on from less than what has settled."""
        self.probed = energy
        self.vibration, self.velocity = PROBE * self.vibration, PROBE * self.velocity
        self.energies.clear()
        self.history.clear()


def round_seconds(points: Iterable[Point], moving: tuple[str, ...]) -> float:
    """How long a round is (s): a hundred periods of the slowest mode that oscillates freely, at any of the points."""
    modes = [mode for point in points for mode in point.modes if mode.name in moving]
    free = [mode.frequency_Hz for mode in modes if abs(mode.damping_ratio) < FREE]
    return ROUND_PERIODS / min(free or [mode.frequency_Hz for mode in modes], default=ROUND_PERIODS)


def find_attractors(
    family: Family,
    tasks: Sequence[tuple[Point, Start]],
    how: How,
    *,
    rounds: int = PERSISTENT,
    known: Mapping[float, Sequence[Motion]] | None = None,
    progress: Progress = silent,
) -> Iterator[Response]:
    """Run each start at its point until it is clear where it leads, and yield the responses as they come.

    A motion has settled when for `rounds` rounds its rms velocity has changed by less than a tenth and, below the
    contact boundaries, by less than a tenth of what the linear growth rate would make of it, unless it fluctuates more
    than a round before, as one does that leaves an unstable cycle. Beyond the boundaries, where steady sliding is
    stable, it must not fall by more in a round than the integrator may make it: what loses energy in each period is no
    limit cycle. A motion within a tenth of the boundaries that falls where the linear model is stable has decayed, as
    has one below them that falls as fast as half the linear rate; what is below the resolved size is at rest. A
    disturbance that has fallen to within a tenth of the boundaries where the linear model is unstable grows, as the
    small perturbation does. One that comes and goes beyond the boundaries has settled when its mean energy over ten
    rounds is that over the ten before, to a fifth, and falls no more than it scatters. After `MOST_ROUNDS` rounds one
    beyond them counts as squeal, too, but for one that falls, which is undecided. Where no mode decays or grows by more
    than is resolved, motion that has settled squeals where it sticks, or comes back when it has been made smaller; it
    is neutral where it stays smaller, or is within a tenth of the boundaries. A shoe that has turned by more than
    `SMALL_ROTATION` has run away: it may do so without coming near a boundary. A steady motion that is the same as one
    of those `known` at its value, or found there, has settled after its first round on it.
    `progress` is called after each chunk.
    """
    settled = {value: list(motions) for value, motions in (known or {}).items()}
    pending = [_Job(point, start, family) for point, start in tasks]
    many = at_once(how.threads)
    while pending:
        jobs, pending = pending[:many], pending[many:]
        motions = saturated_motions(
            [job.model for job in jobs],
            [job.steady for job in jobs],
            [job.vibration for job in jobs],
            [job.velocity for job in jobs],
            duration=how.round_seconds,
            sample_rate=how.sample_rate,
            tolerance=how.tolerance,
            solver=how.solver,
            threads=how.threads,
            progress=progress,
        )
        left = []
        for job, motion in zip(jobs, motions, strict=True):
            job.rounds += 1
            job.vibration, job.velocity = motion.vibration, motion.velocity
            kind = _judge(job, motion, family, how, rounds)
            there = settled.setdefault(job.point.value, [])
            seconds = job.rounds * how.round_seconds
            named = {"kick": job.start.kick, "from_value": job.start.from_value}
            of = partial(Response.of, job.point.value, job.start.name)
            response = of(kind or Leads.SQUEALS, motion, seconds, family.moving, **named)
            is_known = response.motion is not None and any(response.motion.same(each) for each in there)
            steady = max(abs(motion.drift), motion.fluctuation) < STEADY and not _may_be_neutral(
                job, motion, family, how
            )
            if kind is None and not (is_known and steady):
                left.append(job)
                continue
            if response.motion is not None and not is_known:
                there.append(response.motion)
            yield response
        pending = left + pending


def _judge(job: _Job, motion: Saturated, family: Family, how: How, rounds: int) -> Leads | None:
    """Where a transient leads, None while that is not clear."""
    if motion.failed:
        return Leads.FAILED
    if any(abs(turn) > SMALL_ROTATION for turn in motion.vibration[[name in ROTATIONS for name in family.moving]]):
        return Leads.RUNS_AWAY
    job.note(motion)
    fraction = max(motion.boundary_ratios)
    linear, stable, neutral = _linear(job.point, family, how)
    seconds, resolved = how.round_seconds, RESOLVED * how.tolerance
    if stable and (fraction == 0 or motion.at_rest):
        return Leads.DECAYS
    if stable and not neutral:
        # Within the contact boundaries all smaller motions decay like one that has kept on decaying there.
        goes_on = fraction < 1 and job.change(LASTING) < NEARLY_LINEAR * linear * seconds
        if goes_on or is_decaying(fraction, motion.rate, linear):
            return Leads.DECAYS
    if not stable and fraction < SMALL and job.start.name != SMALL_START:
        return Leads.GROWS
    still = np.inf if neutral else STILL * abs(linear) * seconds
    falls = min(still, resolved) if stable else np.inf
    if _settled(job, motion, rounds, still, falls):
        if not _may_be_neutral(job, motion, family, how):
            return Leads.SQUEALS
        if fraction < SMALL:
            return Leads.NEUTRAL
        if job.probed is not None:
            return Leads.NEUTRAL if motion.kinetic_energy < PROBE * job.probed else Leads.SQUEALS
        job.probe(motion.kinetic_energy)
    if job.rounds < MOST_ROUNDS:
        return None
    if fraction < BEYOND:
        return Leads.UNDECIDED if stable else Leads.GROWS
    return Leads.UNDECIDED if job.falls(falls) else Leads.SQUEALS


def _linear(point: Point, family: Family, how: How) -> tuple[float, bool, bool]:
    """The largest growth rate (1/s), whether nothing grows, and whether something neither grows nor decays."""
    rates = [mode.growth_rate for mode in family.modes(point)]
    if point.divergence is not None:
        rates.append(point.divergence)
    linear, noise = max(rates, default=0.0), UNDAMPED_FRACTION * point.largest
    resolved = RESOLVED * how.tolerance / how.round_seconds
    return linear, linear <= noise, bool(rates) and -max(noise, resolved) <= linear <= noise


def _may_be_neutral(job: _Job, motion: Saturated, family: Family, how: How) -> bool:
    """Whether a motion that lasts may be one of any size: by the linear model, and as it does not stick."""
    return _linear(job.point, family, how)[2] and motion.sticking <= STICKS


def _settled(job: _Job, motion: Saturated, rounds: int, still: float, falls: float) -> bool:
    """Whether it has, by the change of the logarithm of its rms velocity in a round.

    A limit cycle keeps its energy over a period: beyond the contact boundaries it is none where it falls by more than
    `falls`, below them where it changes by more than `still`.
    """
    beyond = max(motion.boundary_ratios) >= BEYOND
    change = job.change(rounds)
    departs = LEAVES < motion.fluctuation > FASTER * job.fluctuations[-2] if len(job.fluctuations) > 1 else False
    slow = change > -falls if beyond else abs(change) < still
    if abs(np.expm1(change * (rounds - 1))) < DRIFT and slow and not departs:
        return not motion.at_rest
    if not beyond or len(job.history) < IRREGULAR:
        return False
    # An irregular motion goes on as it was where the mean energies over both halves of many rounds are alike.
    earlier, later = job.history[-IRREGULAR : -IRREGULAR // 2], job.history[-IRREGULAR // 2 :]
    return bool(abs(np.log(np.mean(later) / np.mean(earlier))) / 2 < DRIFT) and not job.falls(falls)
