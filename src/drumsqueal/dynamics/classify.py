"""Where a transient leads, by the numbers of its rounds and the linear model about steady sliding.

A round lasts a hundred periods of the slowest mode; after it a transient has decayed, has settled, or goes on.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.dynamics.saturated import Saturated
from drumsqueal.findings.decay import is_decaying, least_stable
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.solve.linear.modes import Stability


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
            self._probe(motion.kinetic_energy)
        return None if len(self.rounds) < Criteria.rounds else self._cut_off(motion, fraction)

    def _probe(self, energy: float) -> None:
        """Go on from less than what has settled."""
        self.probed, self.state = energy, Criteria.smaller * self.state
        self.rounds.clear()

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
        decays = (falls or is_decaying(fraction, motion.rate, linear)) and self.nears(linear)
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

    def nears(self, linear: float) -> bool:
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

    def goes_on(self, rounds: int, least: float) -> bool:
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
        return beyond and self.goes_on(many, falls)


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
