"""Periodic motions as they are found: one period, its multipliers, and the branches they form along a parameter."""

import math
from collections.abc import Collection, Mapping
from enum import StrEnum
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BeforeValidator, PlainSerializer, computed_field

from drumsqueal.errors import CycleError, IntegrationError
from drumsqueal.findings.schema import Finding, Held, Number
from drumsqueal.findings.squeals import Interval, common, joined
from drumsqueal.findings.vibration import amplitudes_apart
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.branches import Branches
from drumsqueal.solve.motion import turning_points
from drumsqueal.solve.shooting import (
    ASTRAY,
    NEUTRAL,
    TOLERANCE,
    Closed,
    Shooting,
    ShootingStart,
    Vector,
    floquet_of,
)
from drumsqueal.solve.transient.flow import Flow, StickTransition, slip_speeds
from drumsqueal.solve.transient.integrate import Chunk, integrate
from drumsqueal.solve.transient.state import CHUNK_SAMPLES

SAME = 0.02  # relative difference in period and amplitudes of what is taken for the same cycle


def cut_in_slip(model: Model, start: ShootingStart) -> ShootingStart:
    """The start, moved to where the contact slips fastest in the period from there, if it sticks in it.

    Where it sticks, a state may not be varied: it would not stick then. Where it slips, the flow is smooth, and what
    sticking forgets are columns of zero of its derivative, not of φ − y.
    """
    try:
        whole = _sample(model, start.state, start.period)
        if not whole.observation.sticking.any():
            return start
        # On a slow drum it sticks for almost all of the period, and slips between two samples of that only.
        sticking = [time for time, sticks in whole.changes if sticks and time > 0]
        slipping = [_sample(model, start.state, time) for time in sticking[:1]]
    except CycleError:
        return start
    states = np.vstack([np.hstack([each.displacement, each.velocity]) for each in (whole, *slipping)])
    fastest = int(np.argmax(slip_speeds(model, states[:, states.shape[1] // 2 :])))
    return start._replace(state=states[fastest])


def _pairs(values: Any) -> Any:
    """Real and imaginary parts of complex numbers (k,), as the file has them."""
    return [[value.real, value.imag] for value in values.tolist()] if isinstance(values, np.ndarray) else values


if TYPE_CHECKING:
    Multipliers = NDArray[np.complex128]
else:
    Multipliers = Annotated[
        tuple[tuple[Number, Number], ...],
        BeforeValidator(_pairs),
        AfterValidator(lambda pairs: np.array([complex(*pair) for pair in pairs], dtype=np.complex128)),
        PlainSerializer(_pairs),
    ]


class Event(StrEnum):
    """What happens at a cycle on a branch.

    At a corner slip just comes to reverse on a part of the lining. At a grazing bifurcation the contact as a whole just
    comes to move with the drum: on one side of it the cycle sticks once more, or reverses its slip, than on the other.
    Two branches cross at a transcritical point, where they exchange stability, and at a pitchfork point, where one of
    them folds, mostly as its cycles have lost a symmetry of the other's. A branch point is either, or a fold, where it
    was not found out which.
    """

    FOLD = "fold"
    NEIMARK_SACKER = "Neimark-Sacker"
    DOUBLING = "period doubling"
    BRANCHING = "branch point"
    TRANSCRITICAL = "transcritical point"
    PITCHFORK = "pitchfork point"
    CORNER = "corner"
    GRAZING = "grazing"

    @property
    def in_words(self) -> str:
        """Its name within a sentence."""
        return f"{self} point" if self is Event.NEIMARK_SACKER else str(self)


class Cycle(Finding):
    """A periodic motion of a model: its period (s) and a state on it, displacement from q = 0 and velocity.

    `multipliers` are the Floquet multipliers, the largest first, without the trivial one that belongs to the motion
    along the cycle. That one must be 1; its error is `unit_multiplier_error`. `tangent_error` is by how much tangents
    and neighbouring motions disagree about what a period does to a disturbance, of the largest (see `floquet_of`).
    `residual` is the periodicity residual: how far the state is from itself after a period, in the scale of the motion.
    `amplitude` is half the peak-to-peak values (m, rad), the fractions are means over the period, and
    `main_coordinate` has most kinetic energy. The contact sticks as a whole in `sticking_phases` of a period, for
    `sticking_fraction` of it; each direction of slip that it loses then has a multiplier of zero. On a branch, `value`
    is the parameter and `what` happens there.
    `samples` holds one period, and `crossing` the direction (2n + 2,) in which another branch goes through it: of the
    state, the period and the parameter, the latter exactly zero where that branch folds, at a pitchfork point.
    """

    period_s: float
    amplitude: dict[str, float]
    main_coordinate: str
    multipliers: Multipliers
    unit_multiplier_error: Number
    tangent_error: Number
    residual: Number
    contact_fraction: float
    slip_reversed_fraction: float
    sticking_fraction: float = 0.0
    sticking_phases: int = 0
    displacement: dict[str, float]
    velocity: dict[str, float]
    value: Number = np.nan
    what: Event | None = None
    samples: Any = Held
    model: Any = Held
    crossing: Any = Held

    @property
    def names(self) -> tuple[str, ...]:
        """The coordinates that move."""
        return tuple(self.amplitude)

    @property
    def state(self) -> Vector:
        """Displacement from q = 0 and velocity (2n,)."""
        return np.array([*self.displacement.values(), *self.velocity.values()])

    @computed_field
    @property
    def frequency_Hz(self) -> float:
        """1/T (Hz)."""
        return 1 / self.period_s

    @property
    def largest(self) -> float:
        """The largest modulus of a multiplier: what a small disturbance is multiplied by in a period, at worst."""
        return float(np.abs(self.multipliers[0])) if self.multipliers.size else 0.0

    @property
    def unstable_directions(self) -> int:
        """How many multipliers lie outside the unit circle."""
        return int(np.sum(np.abs(self.multipliers) > 1))

    @computed_field
    @property
    def stable(self) -> bool:
        """Whether every small disturbance dies out."""
        return self.largest < 1

    @computed_field
    @property
    def neutral(self) -> bool:
        """Whether a multiplier is too near to the unit circle to be distinguished from one on it."""
        return abs(self.largest - 1) < NEUTRAL


def unlike(one: Cycle, period: float, amplitude: Mapping[str, float]) -> float:
    """By how much a cycle and a motion of a period (s) and amplitudes (m, rad) differ: the largest |ln| of a ratio."""
    return max(abs(math.log(one.period_s / period)), amplitudes_apart(one.amplitude, amplitude, one.model.mass))


def off_between(a: Cycle, b: Cycle, value: float, period: float, amplitude: Mapping[str, float]) -> float:
    """By how much a motion at a value differs from what lies there on the way from one cycle to another, as `unlike`.

    Infinite where the value is not between theirs.
    """
    if a.value == b.value or (a.value - value) * (b.value - value) > 0:
        return math.inf
    fraction = (value - a.value) / (b.value - a.value)
    sizes = {name: (1 - fraction) * size + fraction * b.amplitude[name] for name, size in a.amplitude.items()}
    middle = {"period_s": (1 - fraction) * a.period_s + fraction * b.period_s, "amplitude": sizes}
    return unlike(a.model_copy(update=middle), period, amplitude)


def describe(shooting: Shooting, closed: Closed) -> Cycle:
    """Sample a closed motion over its period. Raises CycleError as `floquet_of` does, and beside grazing.

    That is where the sampled motion does not stick and slip at the times at which the flow does.
    """
    state, period, parameter = shooting.unscaled(closed.unknowns)
    model = shooting.models(parameter)[0]
    names, n = model.names, len(model.names)
    samples = _sample(model, state, period)
    _check_changes(samples, closed.flow, period)
    multipliers, unit_error, tangent_error = floquet_of(shooting, closed)
    observed = samples.observation
    moved, speed = samples.displacement, samples.velocity
    turns = (turning_points(samples.time, moved[:, k], speed[:, k])[1] for k in range(n))
    sizes = (float(np.ptp(np.concatenate([moved[:, k], values]))) / 2 for k, values in enumerate(turns))
    stuck = _sticking(closed.flow.changes, period)
    kinetic = np.asarray(model.mass) * np.mean(speed**2, axis=0)
    return Cycle(
        period_s=period,
        amplitude=dict(zip(names, sizes, strict=True)),
        main_coordinate=names[int(np.argmax(kinetic))],
        multipliers=multipliers,
        unit_multiplier_error=unit_error,
        tangent_error=tangent_error,
        residual=closed.residual,
        # Over one period of even samples the mean leaves out the last, which is the first again.
        contact_fraction=float(np.mean(observed.contact_fraction[:-1])),
        slip_reversed_fraction=float(np.mean(observed.slip_reversed_fraction[:-1])),
        sticking_fraction=sum(stuck) / period,
        sticking_phases=len(stuck),
        displacement=dict(zip(names, state[:n].tolist(), strict=True)),
        velocity=dict(zip(names, state[n:].tolist(), strict=True)),
        value=parameter,
        samples=samples,
        model=model,
    )


def _sample(model: Model, state: Vector, period: float) -> Chunk:
    """One period of even samples (k,), both ends included. Raises CycleError where it fails."""
    n = len(model.names)
    how: dict[str, Any] = {"duration": period, "sample_rate": CHUNK_SAMPLES / period, "tolerance": TOLERANCE}
    try:
        (chunk,) = integrate(model, np.zeros(n), state[:n], state[n:], solver="dopri8", **how)
    except (IntegrationError, ValueError) as error:
        raise CycleError(f"the motion cannot be sampled over its period: {error}") from None
    return chunk


def _check_changes(samples: Chunk, found: Flow, period: float) -> None:
    """Raise CycleError unless samples stick and slip as the flow does: they differ by errors that a period enlarges."""
    wanted = [
        (time, what is StickTransition.STICKS) for time, what in found.changes if what is not StickTransition.REVERSES
    ]
    alike = len(wanted) == len(samples.changes) and all(
        sticks == begins and abs(time - when) < ASTRAY * period
        for (time, sticks), (when, begins) in zip(wanted, samples.changes, strict=True)
    )
    if not alike:
        raise CycleError(
            "the contact sticks or slips at other times when the same motion is integrated again: it nearly grazes "
            "a further change, and errors of integration decide"
        )


def _sticking(changes: tuple[tuple[float, StickTransition], ...], period: float) -> list[float]:
    """How long (s) each phase of sticking lasts."""
    ends = [*(time for time, _ in changes), period][1:]
    return [end - time for (time, what), end in zip(changes, ends, strict=False) if what is StickTransition.STICKS]


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
        ends = (cycle for cycles, stable in self.pieces() if not stable for cycle in (cycles[0], cycles[-1]))
        return own + [cycle for cycle in ends if cycle.what in BEARING]

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
    def squeals_only_when_disturbed(self) -> tuple[Interval, ...]:
        """Bistable ranges: steady sliding is stable and a stable cycle is, too."""
        return common(self.steady_sliding_stable, self.stable_cycles)

    @computed_field
    @property
    def squeals_unknown(self) -> tuple[Interval, ...]:
        """Ranges with stable steady sliding and no stable cycle that was found, where some may have been missed."""
        if not self.branches:  # and nothing that was tried proves that there is none
            return self.steady_sliding_stable
        unknown, spans = [], [*self.squeals_only_when_disturbed, *((each.low, each.high) for each in self.not_followed)]
        for low, high in self.steady_sliding_stable:
            ends = sorted({low, high, *(end for span in spans for end in span if low < end < high)})
            for first, last in pairwise(ends):
                middle = (first + last) / 2
                disturbed = any(a <= middle <= b for a, b in self.squeals_only_when_disturbed)
                if not disturbed and any(each.low <= middle <= each.high for each in self.not_followed):
                    unknown.append((first, last))
        return joined(unknown)


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
