"""Branches of cycles along a parameter as they were found, and the stability of steady sliding along it."""

from collections.abc import Collection, Sequence
from enum import StrEnum
from itertools import pairwise
from typing import Any, ClassVar

from pydantic import computed_field

from drumsqueal.dynamics.cycles.cycle import Cycle, Event
from drumsqueal.findings.intervals import Interval, common, joined
from drumsqueal.findings.schema import Finding, Held
from drumsqueal.solve.linear.branches import Branches


class RangeKind(StrEnum):
    """What becomes of a start at a value; bistable: steady sliding is stable, but a large disturbance makes it squeal.

    Neutral motion neither grows nor decays; where it squeals, steady sliding is unstable.
    """

    STABLE = "stable"
    NEUTRAL = "neutral"
    BISTABLE = "bistable"
    SQUEALS = "squeals"
    UNDECIDED = "undecided"
    NOWHERE = "no steady sliding"


class BranchEnd(StrEnum):
    """Where a branch begins or ends, or is lost on the way.

    With grazing it ends where static friction exceeds what slides: the motion jumps to another one. Cycles of twice the
    period of others end at the period doubling of those, those without a symmetry of others at the pitchfork point of
    those, and all cycles where the drum stands still.
    """

    HOPF = "Hopf"
    BOUND = "end of the range"
    LOOP = "closed loop"
    GRAZING = "grazing"
    DOUBLING = "period doubling"
    PITCHFORK = "pitchfork point"
    STANDSTILL = "standstill"
    CUT_OFF = "cut off"
    LOST = "lost"


BEARING = (Event.DOUBLING, Event.NEIMARK_SACKER, Event.BRANCHING, Event.TRANSCRITICAL, Event.PITCHFORK)


class Unfollowed(Finding):
    """What was not followed and why, and the range of the parameter in which cycles may have been missed for that."""

    reason: str
    low: float
    high: float


class CycleBranch(Finding):
    """Cycles in the order in which they follow one another, and why the branch ends on either side.

    `start_detail` and `end_detail` say in words how it was lost there.
    """

    start: BranchEnd
    end: BranchEnd
    start_detail: str = ""
    end_detail: str = ""
    cycles: tuple[Cycle, ...]

    @computed_field
    @property
    def special(self) -> tuple[Cycle, ...]:
        """The cycles at which something happens."""
        return tuple(cycle for cycle in self.cycles if cycle.what is not None)

    def not_followed(self, low: float, high: float, followed: Collection[float] = ()) -> tuple[Unfollowed, ...]:
        """Where it leaves cycles behind: beyond an end at which it is lost or the motion jumps, and where others begin.

        Of those that begin at a value that is among the `followed` ones nothing is left behind.
        """
        found = []
        for end, reason, last, before in (
            (self.start, self.start_detail, self.cycles[0], self.cycles[1:2]),
            (self.end, self.end_detail, self.cycles[-1], self.cycles[-2:-1]),
        ):
            # What sticks in its only direction is released in one state: if that does not stick again, nothing does.
            jumps = end is BranchEnd.GRAZING and len(last.amplitude) > 1
            if end is BranchEnd.LOST or jumps:
                onwards = not before or before[0].value <= last.value
                # Of a branch of one cycle it is not known to which side it goes.
                ends = sorted((last.value if before else low, high if onwards else low))
                reason = f"what the motion jumps to at the grazing at {last.value:.5g}" if jumps else reason
                found.append(Unfollowed(reason=reason, low=ends[0], high=ends[1]))
            elif end in (BranchEnd.DOUBLING, BranchEnd.PITCHFORK) and last.value not in followed:
                found.append(Unfollowed(reason=f"what else is at the {end} at {last.value:.5g}", low=low, high=high))
        return (*found, *self._born(followed))

    def meeting(self) -> list[Cycle]:
        """The cycles at which it meets others that may be stable: at the ends of its stable pieces, and its own."""
        ends = ((self.start, self.cycles[0]), (self.end, self.cycles[-1]))
        own = [cycle for end, cycle in ends if end in (BranchEnd.DOUBLING, BranchEnd.PITCHFORK)]
        return own + [event for cycles, stable in self.pieces() if not stable for event in _bearing(cycles)]

    def _born(self, followed: Collection[float]) -> list[Unfollowed]:
        """What begins where a stable piece ends and is not followed: it may be stable where the branch is not.

        Where it was not found out how stability changes, something may begin, too.
        """
        found = []
        for cycles in (cycles for cycles, stable in self.pieces() if not stable):
            values = [cycle.value for cycle in cycles]
            for event, beside in ((cycles[0], cycles[1]), (cycles[-1], cycles[-2])):
                if event.what is not None and event.what in BEARING and event.value not in followed:
                    reason = f"what begins at the {event.what.in_words} at {event.value:.5g}"
                elif event.what is beside.what is None and event.stable:
                    low, high = sorted((event.value, beside.value))
                    reason = f"how stability changes between {low:.5g} and {high:.5g}"
                else:
                    continue
                found.append(Unfollowed(reason=reason, low=min(values), high=max(values)))
        return found

    def pieces(self) -> list[tuple[list[Cycle], bool]]:
        """The branch in pieces that are stable or not, in order; neighbours share the cycle at which it changes."""
        found: list[tuple[list[Cycle], bool]] = []
        for a, b in pairwise(self.cycles):
            # Of two corners in a row both count: that nothing is known is no reason to call it stable.
            known = [cycle for cycle in (a, b) if cycle.what is None] or [a, b]
            stable = all(cycle.stable for cycle in known)
            if found and found[-1][1] == stable:
                found[-1][0].append(b)
            else:
                found.append(([a, b], stable))
        return found


def _bearing(cycles: Sequence[Cycle]) -> list[Cycle]:
    """The ends of a piece of a branch at which other motions begin."""
    return [event for event in (cycles[0], cycles[-1]) if event.what in BEARING]


class Why(StrEnum):
    """Why a motion is on no branch: nothing closes that is not periodic, and what is closed may not be followed."""

    NOT_RECORDED = "not recorded"
    NOT_PERIODIC = "not periodic"
    NOT_CLOSED = "not closed by Newton's method"
    NOT_FOLLOWED = "not followed"


class OffBranch(Finding):
    """A motion that was found at a value and lies on none of the branches: whether a cycle is there is unknown.

    `frequency_Hz` is 1/T of a periodic one and the line of another, `amplitude` half the peak-to-peak values (m, rad);
    `reason` says more than `why`.
    """

    value: float
    frequency_Hz: float | None
    amplitude: dict[str, float]
    why: Why
    reason: str


class Diagram(Finding):
    """Branches of cycles, and the ranges of the parameter in which steady sliding is stable and in which it is not.

    `off_branches` are the motions it was given that are on none of the branches. `notes` says what was looked for and
    not found, `not_followed` which branches end where they may go on or could not be followed at all; `linear` holds
    the modes of steady sliding.
    """

    subject: ClassVar[str] = "the body"
    verdict: str | None = None
    steady_sliding_stable: tuple[Interval, ...]
    steady_sliding_unstable: tuple[Interval, ...]
    branches: tuple[CycleBranch, ...]
    off_branches: tuple[OffBranch, ...] = ()
    notes: tuple[str, ...] = ()
    not_followed: tuple[Unfollowed, ...] = ()
    linear: Any = Held

    @computed_field
    @property
    def stable_cycles(self) -> tuple[Interval, ...]:
        """Ranges with a stable cycle at least."""
        pieces = (piece for branch in self.branches for piece in branch.pieces())
        values = ([cycle.value for cycle in cycles] for cycles, stable in pieces if stable)
        return joined([(min(each), max(each)) for each in values])

    @computed_field
    @property
    def folds(self) -> tuple[float, ...]:
        """Values at the folds, by rising value."""
        return self.values_of(Event.FOLD)

    @computed_field
    @property
    def grazings(self) -> tuple[float, ...]:
        """Values at the grazing bifurcations, by rising value."""
        return self.values_of(Event.GRAZING)

    @computed_field
    @property
    def doublings(self) -> tuple[float, ...]:
        """Values at the period doublings, by rising value."""
        return self.values_of(Event.DOUBLING)

    def values_of(self, event: Event) -> tuple[float, ...]:
        """Values at which something happens, by rising value."""
        special = (cycle for branch in self.branches for cycle in branch.special)
        return tuple(sorted({cycle.value for cycle in special if cycle.what is event}))

    @computed_field
    @property
    def squeals_only_when_kicked(self) -> tuple[Interval, ...]:
        """Bistable ranges: steady sliding is stable and a stable cycle is, too."""
        return common(self.steady_sliding_stable, self.stable_cycles)

    @computed_field
    @property
    def squeals_unknown(self) -> tuple[Interval, ...]:
        """Ranges with stable steady sliding and no stable cycle that was found, where some may have been missed."""
        if not self.branches:  # and nothing that was tried proves that there is none
            return self.steady_sliding_stable
        unknown = []
        for low, high in self.steady_sliding_stable:
            ends = sorted({low, high, *(end for pair in self._known_and_unknown() for end in pair if low < end < high)})
            for first, last in pairwise(ends):
                middle = (first + last) / 2
                kicked = any(a <= middle <= b for a, b in self.squeals_only_when_kicked)
                if not kicked and any(each.low <= middle <= each.high for each in self.not_followed):
                    unknown.append((first, last))
        return joined(unknown)

    def _known_and_unknown(self) -> list[Interval]:
        return [*self.squeals_only_when_kicked, *((each.low, each.high) for each in self.not_followed)]


def steady_sliding(linear: Branches, low: float, high: float, *, stable: bool) -> tuple[Interval, ...]:
    """Ranges from `low` to `high` in which steady sliding is stable, or in which it is not."""
    ends = [low, *(each.value for each in linear.critical), high]
    spans = []
    for first, last in pairwise(ends):
        middle = (first + last) / 2
        nearest = min(linear.points, key=lambda point: abs(point.value - middle))
        if not nearest.reason and nearest.unstable != stable:
            spans.append((first, last))
    return joined(spans)
