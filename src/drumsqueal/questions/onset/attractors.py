"""The attractors along a parameter: transients from many starts, each run until it is clear where it leads.

A round lasts a hundred periods of the slowest mode; after it a transient has decayed, has settled, or goes on. All that
are at hand run together.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from drumsqueal.coordinates import is_rotation
from drumsqueal.findings.decay import BEYOND, NEARLY_LINEAR, SMALL, is_decaying, least_stable
from drumsqueal.findings.saturated import DRIFT, MOSTLY, Saturated, at_once, saturated_motions
from drumsqueal.findings.verdict import SMALL_ROTATION
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.onset.family import Family, How, Start
from drumsqueal.questions.onset.motions import SMALL_START, Leads, Response, SteadyResponse
from drumsqueal.solve.linear.branches import Point
from drumsqueal.solve.linear.modes import DRIFT_FRACTION, UNDAMPED_FRACTION

FREE = 0.1  # damping ratio below which a mode does: beyond it falls to half within a period or so
MOST_ROUNDS = 60
PERSISTENT, LASTING = 3, 10  # rounds a motion must last to count as settled, on the grid and at a boundary
# A motion that fluctuates by so much, and so many times more than a round before, is leaving what it was near: a cycle
# fluctuates by 1e-5, and one was seen to grow from 1.1e-4 by 2.2 times a round for six rounds before it left.
LEAVES, FASTER = 1e-4, 1.2
# A motion that fluctuates by less has an amplitude: one that fluctuated by 0.1 kept its energy within 1 % for three
# rounds and lost it within ten. What fluctuates by more must go on as it was for so many rounds.
CONSTANT, IRREGULAR = 1e-3, 20
SCATTER = 2.0  # standard errors of a trend: an irregular motion whose energy falls by less may not fall at all
# Of the tolerance, a round: a motion that falls by less keeps its energy as well as is known. The integrator itself
# was seen to change the rms velocity of an undamped block by a quarter of the tolerance.
RESOLVED = 10.0
REMAINS = 0.02  # of the rms, by which a motion that has settled may still grow
STEADY = 0.02  # change of the rms from half to half below which a motion may be one that is known already
# Of the time: what sticks for longer, time and again, owes its energy to friction. Friction that does not fall only
# takes energy while it sticks: its motions come to stick for an instant, seen as up to 3e-4 of the time.
STICKS = 0.01
CLOSE = 1e-3  # to the rms of one that is known, so that it need not come nearer
# Of what is looked at of a motion that sticks most of the time: with fewer, its round is made so many times longer, or
# more where one phase at least was seen; and from how many times the length of the others on it is undecided instead.
FEWEST_PHASES, LONGER, LONGEST = 12, 8.0, 300
PROBE = 0.7  # a motion made so much smaller comes back where it is an attractor, and stays where it is one of many


class _Job:
    """A transient on its way."""

    def __init__(self, point: Point, start: Start, family: Family, seconds: float) -> None:
        self.point, self.start = point, start
        self.seconds, self.simulated = seconds, 0.0  # of a round, and of all
        self.model, self.steady = family.model_at(point.value), family.shown(point.steady)
        self.matrix = family.matrix(point)
        self.vibration, self.velocity = start.vibration, start.velocity
        self.energies: list[float] = []  # mean kinetic energy of each round (J) since it last changed much
        self.history: list[float] = []  # and of all rounds since the start, or since it was made smaller
        self.fluctuations: list[float] = []  # of all rounds
        self.rates: list[float] = []  # growth rate (1/s) of all rounds
        self.rounds = 0
        self.smallest_force = np.inf  # N, of all rounds
        self.probed: float | None = None  # mean kinetic energy (J) of the settled motion that was made smaller

    def lengthen(self, motion: Saturated, how: How) -> bool:
        """Make its rounds longer where stick-slip is so slow that one holds few cycles; says whether it did."""
        if not _holds_few(motion) or self.seconds >= LONGEST * how.round_seconds:
            return False
        self.seconds *= np.clip(1.5 * FEWEST_PHASES / max(motion.phases, 1), 2.0, LONGER)
        self.rounds = 0
        for each in (self.energies, self.history, self.fluctuations, self.rates):
            each.clear()
        return True

    def note(self, motion: Saturated) -> None:
        """Note the energy of a round."""
        if abs(motion.drift) > DRIFT:
            self.energies.clear()
        self.energies.append(motion.kinetic_energy)
        self.history.append(motion.kinetic_energy)
        self.fluctuations.append(motion.fluctuation)
        self.rates.append(motion.rate)

    def change(self, rounds: int) -> float:
        """Mean change a round of the logarithm of the rms velocity, over so many rounds; NaN before."""
        last = self.energies[-rounds:]
        if len(last) < max(rounds, 2) or min(last) <= 0:
            return np.nan
        return float(np.log(last[-1] / last[0])) / 2 / (len(last) - 1)

    def nears(self, linear: float) -> bool:
        """Whether it falls nearly as fast as the linear model says (1/s), and the smaller it is the more so.

        Next to rest the rate is linear in the energy. What falls towards a limit cycle below the contact boundaries
        may pass that rate, too, but on a line that leads elsewhere.
        """
        if len(self.history) < 2 or not 0 < self.history[-1] < self.history[-2]:
            return False
        before, now = self.rates[-2:]
        fallen = self.history[-1] / self.history[-2]
        at_rest = now + (now - before) * fallen / (1 - fallen)
        return max(abs(now - linear), abs(at_rest - linear)) < (1 - NEARLY_LINEAR) * abs(linear)

    def remains(self, resolved: float) -> float:
        """By how much the logarithm still grows if each change is to the one before as the last is; infinite before."""
        last = np.log(self.energies[-3:]) / 2
        *before, change = np.diff(last)
        if change <= resolved:
            return 0.0
        return float(change**2 / (before[0] - change)) if before and change < before[0] else np.inf

    def converges(self, resolved: float) -> bool:
        """Whether the logarithm no longer changes, comes and goes, or changes ever less and has little left to do so.

        Next to an unstable cycle it changes ever more, however slowly.
        """
        *before, change = np.diff(np.log(self.energies[-3:]) / 2)
        if abs(change) <= resolved:
            return True
        if not before:
            return False
        slower = abs(before[0]) - abs(change)
        return bool(before[0] * change < 0 or (slower > 0 and change**2 / slower < REMAINS))

    def goes_on(self, rounds: int, least: float) -> bool:
        """Whether it is an irregular motion that is in the later half of so many rounds as it was in the earlier one.

        The mean energies are alike, it falls by no more than `least` a round or than it scatters, and does not spread.
        """
        last = self.history[-rounds:]
        if len(last) < rounds or min(last) <= 0:
            return False
        earlier, later = np.mean(last[: rounds // 2]), np.mean(last[rounds // 2 :])
        return bool(abs(np.log(later / earlier)) / 2 < DRIFT) and not self.leaves(rounds, least)

    def leaves(self, rounds: int, least: float) -> bool:
        """Whether over so many rounds its energy falls, or its fluctuation rises, by more than they scatter."""
        energies, fluctuations = self.history[-rounds:], self.fluctuations[-rounds:]
        falls = len(energies) == rounds and min(energies) > 0 and -_trend(energies) / 2 > least
        spreads = len(energies) == rounds and min(fluctuations) > CONSTANT and _trend(fluctuations) > 0
        return falls or spreads

    def probe(self, energy: float) -> None:
        """Go on from less than what has settled."""
        self.probed, self.rounds = energy, 0
        self.vibration, self.velocity = PROBE * self.vibration, PROBE * self.velocity
        self.energies.clear()
        self.history.clear()


def _trend(values: Sequence[float]) -> float:
    """Change a round of the logarithm; zero where that is no more than it scatters."""
    (slope, _), covariance = np.polyfit(np.arange(len(values)), np.log(values), 1, cov=True)
    return float(slope) if abs(slope) > SCATTER * np.sqrt(covariance[0, 0]) else 0.0


def round_seconds(points: Sequence[Point], moving: tuple[str, ...]) -> float:
    """How long a round is (s): a hundred periods of the slowest mode that oscillates freely, at any of the points.

    Where nothing oscillates it is a hundred times 2π over the slowest rate of growth or decay.
    """
    modes = [mode for point in points for mode in point.modes if mode.name in moving]
    free = [mode.frequency_Hz for mode in modes if abs(mode.damping_ratio) < FREE]
    rates = (np.abs(point.eigenvalues) for point in points if not modes)
    slow = [float(min(each[each > DRIFT_FRACTION * max(each)], default=math.tau)) / math.tau for each in rates]
    # 100 of the slowest mode that oscillates freely
    return 100 / min(free or [mode.frequency_Hz for mode in modes] or slow, default=1.0)


def find_attractors(
    family: Family,
    tasks: Sequence[tuple[Point, Start]],
    how: How,
    *,
    rounds: int = PERSISTENT,
    known: Mapping[float, Sequence[SteadyResponse]] | None = None,
    progress: Progress = silent,
) -> Iterator[Response]:
    """Run each start at its point until it is clear where it leads, and yield the responses as they come.

    A round of stick-slip is longer where it would hold few of its cycles. A motion has settled when for `rounds` rounds
    its rms velocity has changed by less than a tenth and, below the contact boundaries, by less than a tenth of what
    the linear growth rate would make of it, unless it fluctuates more than a round before, as one does that leaves an
    unstable cycle, and unless it changes ever more. Beyond the boundaries it must have an amplitude, which may not fall
    by more in a round than the integrator may make it, for what loses energy in each period is no limit cycle, and may
    have little left to grow. One that comes and goes has settled when its mean energy over ten rounds (twenty, of those
    that must last longer) is that over the ten before, to a fifth, and it neither falls nor fluctuates more, but for
    scatter. A motion within a tenth of the boundaries that falls where the linear model is stable has decayed, as has
    one below them whose rate comes near to the linear one as its energy falls; what is below the resolved size is at
    rest. A disturbance that has fallen to within a tenth of the boundaries where the linear model is unstable grows, as
    the small perturbation does. After `MOST_ROUNDS` rounds one beyond them counts as squeal, too, but for one that
    falls, or fluctuates more and more, which is undecided. Where no mode decays or grows by more than is resolved,
    motion that has settled squeals where it sticks, or comes back when it has been made smaller; it is neutral where it
    stays smaller, or is within a tenth of the boundaries. A shoe that has turned by more than `SMALL_ROTATION` has run
    away: it may do so without coming near a boundary. A steady motion that is on one of those `known` at its value, or
    found there, or comes nearer to it, has settled.
    `progress` is called after each chunk.
    """
    settled = {value: list(motions) for value, motions in (known or {}).items()}
    pending = [_Job(point, start, family, how.round_seconds) for point, start in tasks]
    many = at_once(how.threads)
    while pending:
        round_s = pending[0].seconds
        jobs = [job for job in pending if job.seconds == round_s][:many]
        pending = [job for job in pending if job not in jobs]
        motions = saturated_motions(
            [job.model for job in jobs],
            [job.steady for job in jobs],
            [job.vibration for job in jobs],
            [job.velocity for job in jobs],
            matrices=[job.matrix for job in jobs],
            duration=round_s,
            sample_rate=how.sample_rate,
            tolerance=how.tolerance,
            solver=how.solver,
            threads=how.threads,
            progress=progress,
        )
        left = []
        for job, motion in zip(jobs, motions, strict=True):
            job.rounds, job.simulated = job.rounds + 1, job.simulated + round_s
            job.smallest_force = min(job.smallest_force, motion.smallest_force)
            job.vibration, job.velocity = motion.vibration, motion.velocity
            if job.lengthen(motion, how):
                left.append(job)
                continue
            kind = _judge(job, motion, family, how, rounds)
            there = settled.setdefault(job.point.value, [])
            named = {"kick": job.start.kick, "from_value": job.start.from_value}
            motion = motion._replace(smallest_force=job.smallest_force)
            of = partial(Response.of, job.point.value, job.start.name)
            response = of(kind or Leads.SQUEALS, motion, job.simulated, family.moving, **named)
            may_stay = _may_be_neutral(job, motion, family, how)
            if kind is None and (may_stay or not _comes_to(motion, response, there)):
                left.append(job)
                continue
            if response.motion is not None and not any(response.motion.same(each) for each in there):
                there.append(response.motion)
            yield response
        pending = left + pending


def _judge(job: _Job, motion: Saturated, family: Family, how: How, rounds: int) -> Leads | None:
    """Where a transient leads, None while that is not clear."""
    if motion.failed:
        return Leads.FAILED
    if any(abs(turn) > SMALL_ROTATION for turn in motion.vibration[[is_rotation(name) for name in family.moving]]):
        return Leads.RUNS_AWAY
    if _holds_few(motion):
        return Leads.UNDECIDED
    job.note(motion)
    fraction = max(motion.boundary_ratios)
    linear, stable, neutral = _linear(job.point, family, how)
    seconds, resolved = job.seconds, RESOLVED * how.tolerance
    if motion.rest.elsewhere is not None:
        return Leads.RESTS
    if stable and motion.rest.near and (fraction == 0 or motion.at_rest):
        return Leads.DECAYS
    if stable and not neutral and motion.rest.near:
        if fraction < SMALL and motion.rate < 0:
            return Leads.DECAYS
        lasts = fraction < 1 and job.change(LASTING) < NEARLY_LINEAR * linear * seconds
        if (lasts or is_decaying(fraction, motion.rate, linear)) and job.nears(linear):
            return Leads.DECAYS
    if not stable and fraction < SMALL and motion.rest.near and job.start.name != SMALL_START:
        return Leads.GROWS
    # 0.1 of the linear rate: a motion below the contact boundaries that changes so slowly has settled
    still = np.inf if neutral else 0.1 * abs(linear) * seconds
    if _settled(job, motion, rounds, still, resolved):
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
        return Leads.UNDECIDED if stable or not motion.rest.near else Leads.GROWS
    return Leads.UNDECIDED if job.leaves(2 * IRREGULAR, min(still, resolved)) else Leads.SQUEALS


def _holds_few(motion: Saturated) -> bool:
    """Whether a round of slow stick-slip holds too few of its cycles to judge it."""
    return motion.sticking > MOSTLY and motion.phases < FEWEST_PHASES


def _linear(point: Point, family: Family, how: How) -> tuple[float, bool, bool]:
    """Growth rate (1/s) of the least stable motion, whether nothing grows, and whether that one does not decay."""
    (what, linear, _), noise = least_stable(point, family.modes(point)), UNDAMPED_FRACTION * point.largest
    resolved = RESOLVED * how.tolerance / how.round_seconds
    return linear, linear <= noise, bool(what) and -max(noise, resolved) <= linear <= noise


def _may_be_neutral(job: _Job, motion: Saturated, family: Family, how: How) -> bool:
    """Whether a motion that lasts may be one of any size: by the linear model, and as it does not stick."""
    return _linear(job.point, family, how)[2] and motion.sticking <= STICKS


def _settled(job: _Job, motion: Saturated, rounds: int, still: float, resolved: float) -> bool:
    """Whether it has, by the change of the logarithm of its rms velocity in a round.

    A limit cycle keeps its energy over a period: beyond the contact boundaries it is none where it falls by more than
    is `resolved`, below them where it changes by more than `still`.
    """
    beyond, change, falls = max(motion.boundary_ratios) >= BEYOND, job.change(rounds), min(still, resolved)
    departs = LEAVES < motion.fluctuation > FASTER * job.fluctuations[-2] if len(job.fluctuations) > 1 else False
    if not abs(np.expm1(change * (rounds - 1))) < DRIFT:
        slow = False
    elif beyond:
        slow = motion.fluctuation < CONSTANT and change > -falls and job.remains(falls) < REMAINS
    else:
        slow = abs(change) < still and (np.isinf(still) or job.converges(resolved))
    if slow and not departs:
        return not motion.at_rest
    return beyond and job.goes_on(2 * IRREGULAR if rounds >= LASTING else IRREGULAR, falls)


def _comes_to(motion: Saturated, response: Response, known: Sequence[SteadyResponse]) -> bool:
    """Whether a motion is a steady one that is known, no less steady than that, and comes no farther from it."""
    for each in known:
        if response.motion is None or not response.motion.same(each):
            continue
        ahead = np.log(each.kinetic_energy_J / motion.kinetic_energy) / 2
        nearer = ahead * motion.drift > 0 or abs(ahead) < max(CLOSE, each.fluctuation)
        if nearer and max(abs(motion.drift), motion.fluctuation) < max(STEADY, FASTER * each.fluctuation):
            return True
    return False
