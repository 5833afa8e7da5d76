"""What a study of the onset finds at each value, and the ranges that follow, as onset.json holds it."""

import math
from collections.abc import Sequence
from enum import StrEnum
from itertools import pairwise
from typing import Any, ClassVar, Self, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, computed_field

from drumsqueal.findings.parameter import Parameter
from drumsqueal.findings.part import Finding, Held, Number
from drumsqueal.findings.saturated import Saturated
from drumsqueal.findings.schema import Findings
from drumsqueal.outcome import Ending
from drumsqueal.questions.cycle.diagram import Diagram
from drumsqueal.questions.cycle.seeds import Seed
from drumsqueal.scene.variation import Variation
from drumsqueal.solve.linear.branches import Branch, Critical, Point

# At neighbouring values motions are alike where the logarithms of their energy and of their frequency differ by less.
ALIKE_ENERGY, ALIKE_FREQUENCY = 0.5, 0.05
# At one value they are the same where those of the rms of each coordinate and of the frequency do. Settled squeal of
# the brakes repeats to 0.5 % and 0.001 %; two attractors were seen that differ by 1.1 % in frequency.
SAME_RMS, SAME_FREQUENCY = 0.05, 5e-3
# An irregular motion is known no better than it fluctuates: in standard deviations of a part of it, and that at most.
FLUCTUATIONS, MOST_FLUCTUATION = 2.0, 0.25
TINY = 1e-300  # J: of a motion without energy the logarithm is finite
COUNTS = 1e-3  # of the largest rms, m or rad: a coordinate that moves less does not distinguish motions


class Leads(StrEnum):
    """Where a start leads.

    Its motion decays, squeals, grows (still, at the end), is neutral (its size depends on the start), runs away (the
    shoe turns further than rotations are small), is undecided or failed.
    """

    DECAYS = "decays"
    SQUEALS = "squeals"
    GROWS = "grows"
    NEUTRAL = "neutral"
    RUNS_AWAY = "runs away"
    UNDECIDED = "undecided"
    FAILED = "failed"


class Kind(StrEnum):
    """What becomes of a start at a value; bistable: steady sliding is stable, but a large disturbance makes it squeal.

    Neutral motion neither grows nor decays; where it squeals, steady sliding is unstable.
    """

    STABLE = "stable"
    NEUTRAL = "neutral"
    BISTABLE = "bistable"
    SQUEALS = "squeals"
    UNDECIDED = "undecided"
    NOWHERE = "no steady sliding"


QUIET = (Kind.STABLE, Kind.NEUTRAL)  # nothing squeals there
SMALL_START = "small"  # the name of the small perturbation


class Kick(Finding):
    """A disturbance that was tried: a velocity from steady sliding (m/s, rad/s) along `mode` (its label), either way.

    With it the fastest point of the lining's surface moves at `speed_m_per_s` and the shoe has the kinetic energy
    `energy_J`. Free vibration from it would come to `edge_share` times the nearer contact boundary, lift-off or slip
    reversal, by the linear model.
    """

    mode: str
    forwards: bool
    velocity: dict[str, float]
    speed_m_per_s: float
    energy_J: float
    edge_share: float


class Motion(Finding):
    """A steady-state response, by the last part of a transient: half its peak-to-peak values and rms (m, rad).

    `frequency_Hz` is that of the line with most kinetic energy, of the coordinate `line_of`. Of the motions at which
    contact is lost and slip reversed it has these fractions. `drift` is the relative change of the rms velocity at its
    end, `fluctuation` by how much the rms of a coordinate comes and goes. `state` (2, n) is vibration and velocity at
    its end.
    """

    start: str
    amplitude: dict[str, float]
    rms: dict[str, float]
    frequency_Hz: float | None
    line_of: str | None
    kinetic_energy_J: float
    share_of_contact_loss: Number
    share_of_slip_reversal: Number
    drift: Number
    fluctuation: float = 0.0
    state: Any = Held

    def same(self, other: "Motion") -> bool:
        """Whether two motions at one value are one attractor, as far as they fluctuate."""
        fluctuation = min(FLUCTUATIONS * max(self.fluctuation, other.fluctuation), MOST_FLUCTUATION)
        counts = COUNTS * max(*self.rms.values(), *other.rms.values())
        pairs = [(self.rms[name], other.rms[name]) for name in self.rms]
        apart = [abs(np.log(max(a, counts) / max(b, counts))) for a, b in pairs]
        if max(apart) > max(SAME_RMS, fluctuation):
            return False
        if self.frequency_Hz is None or other.frequency_Hz is None or fluctuation > SAME_RMS:
            return True  # of an irregular motion now one line is the strongest, now another
        return bool(abs(np.log(self.frequency_Hz / other.frequency_Hz)) < SAME_FREQUENCY)

    def like(self, other: "Motion") -> bool:
        """Whether two motions, at one value or at neighbouring ones, are alike in size and frequency."""
        return self.apart(other) < 1

    def apart(self, other: "Motion") -> float:
        """How much less alike in size and frequency they are, over what counts as alike."""
        frequencies = (self.frequency_Hz or math.nan, other.frequency_Hz or math.nan)
        return how_unlike((self.kinetic_energy_J, other.kinetic_energy_J), frequencies)


def how_unlike(
    energies: Sequence[float] | NDArray[np.float64], frequencies: Sequence[float] | NDArray[np.float64]
) -> float:
    """How far two motions are apart in kinetic energy and frequency (NaN: none), over what counts as alike."""
    sizes = [math.log(max(each, TINY)) for each in energies]
    apart = abs(sizes[0] - sizes[1]) / ALIKE_ENERGY
    if any(map(math.isnan, frequencies)):
        return apart
    return max(apart, abs(math.log(frequencies[0] / frequencies[1])) / ALIKE_FREQUENCY)


class Response(Finding):
    """Where a start led at a value, after how long (s), and the motion that it squeals with.

    `kick` is the disturbance that it was, or `from_value` the value at which the motion was known from which it goes
    on; None for others. `saturated` is how the transient ended.
    """

    start: str
    leads_to: Leads
    simulated_s: float
    outcome: str
    kick: Kick | None = None
    from_value: float | None = None
    motion: Motion | None = None
    value: float = Field(default=np.nan, exclude=True)
    saturated: Any = Held

    @classmethod
    def of(
        cls,
        value: float,
        start: str,
        leads_to: Leads,
        ended: Saturated,
        seconds: float,
        names: Sequence[str],
        *,
        kick: Kick | None = None,
        from_value: float | None = None,
    ) -> Self:
        """That of a transient over the named coordinates."""
        motion = None
        if leads_to is Leads.SQUEALS:
            motion = Motion(
                start=start,
                amplitude=dict(zip(names, ended.amplitude.tolist(), strict=True)),
                rms=dict(zip(names, ended.rms.tolist(), strict=True)),
                frequency_Hz=ended.frequency_Hz,
                line_of=ended.line,
                kinetic_energy_J=ended.kinetic_energy,
                share_of_contact_loss=ended.boundary_ratios[0],
                share_of_slip_reversal=ended.boundary_ratios[1],
                drift=ended.drift,
                fluctuation=ended.fluctuation,
                state=np.array([ended.vibration, ended.velocity]),
            )
        return cls(
            start=start,
            leads_to=leads_to,
            simulated_s=seconds,
            outcome=ended.outcome,
            kick=kick,
            from_value=from_value,
            motion=motion,
            value=value,
            saturated=ended,
        )

    @property
    def lasts(self) -> bool:
        """Whether motion is left, or still grows."""
        return self.leads_to in (Leads.SQUEALS, Leads.GROWS)


class Disturbance(Kick):
    """The smallest disturbance that leads to a motion, of those along the modes.

    It lies between the largest that leads elsewhere and the smallest that leads there, both along `mode`, either way,
    and the numbers are those halfway; the uncertainties are half of what lies between. `leads_to` is the motion.
    """

    speed_uncertainty_m_per_s: float
    energy_uncertainty_J: float
    leads_to: Motion


class Attractor(Motion):
    """A steady-state response with all starts that led to it, by name.

    `after_small` says whether the small perturbation did, `kick` is the smallest of the disturbances along modes that
    did, None where none of them did, and `from_values` are those from which it was continued. `smallest_kick` is the
    smallest disturbance that leads there, None where none was found or looked for.
    """

    starts: tuple[str, ...]
    after_small: bool
    kick: Kick | None = None
    from_values: tuple[float, ...] = ()
    smallest_kick: Disturbance | None = None

    @classmethod
    def of(cls, led: Sequence[Response], smallest: Sequence[Disturbance]) -> Self:
        """That of all responses with one motion."""
        motion = led[0].motion
        assert motion is not None
        kicks = sorted((each.kick for each in led if each.kick is not None), key=lambda kick: kick.energy_J)
        return cls(
            **dict(motion),
            starts=tuple(each.start for each in led),
            after_small=any(each.start == SMALL_START for each in led),
            kick=next(iter(kicks), None),
            from_values=tuple(dict.fromkeys(each.from_value for each in led if each.from_value is not None)),
            smallest_kick=next((each for each in smallest if each.leads_to.same(motion)), None),
        )


class Row(Finding):
    """One value: its steady sliding, where each start led, and whether it was asked for or lies at a boundary.

    `no_steady_sliding` is the reason where there is none. `smallest_kicks` are the smallest disturbances that lead to
    each motion, as far as they were found and looked for. `point` is the linear point.
    """

    value: float
    asked: bool
    no_steady_sliding: str | None
    unstable: bool
    largest_growth_rate_1_per_s: Number
    starts: tuple[Response, ...] = ()
    smallest_kicks: tuple[Disturbance, ...] = ()
    point: Any = Held

    @classmethod
    def at(cls, point: Point, *starts: Response, asked: bool) -> Self:
        """That of a linear point."""
        return cls(
            value=point.value,
            asked=asked,
            no_steady_sliding=point.reason or None,
            unstable=point.unstable,
            largest_growth_rate_1_per_s=point.growth_rate,
            starts=starts,
            point=point,
        )

    @computed_field
    @property
    def kind(self) -> Kind:
        """What becomes of a start there."""
        leads = {each.leads_to for each in self.starts}
        if self.no_steady_sliding is not None:
            return Kind.NOWHERE
        if self.unstable:
            return Kind.SQUEALS
        if Leads.SQUEALS in leads:
            return Kind.BISTABLE
        if leads & {Leads.UNDECIDED, Leads.RUNS_AWAY, Leads.FAILED}:
            return Kind.UNDECIDED
        return Kind.NEUTRAL if Leads.NEUTRAL in leads else Kind.STABLE

    @property
    def growth_rate(self) -> float | None:
        """The largest Re λ (1/s), None where nothing oscillates or grows."""
        rate = self.largest_growth_rate_1_per_s
        return rate if math.isfinite(rate) else None

    @property
    def small(self) -> Response | None:
        """Where the small perturbation led."""
        return next((each for each in self.starts if each.start == SMALL_START), None)

    @computed_field
    @property
    def motions(self) -> tuple[Attractor, ...]:
        """The steady-state responses that differ, the one with most kinetic energy first."""
        groups: list[list[Response]] = []
        for each in self.starts:
            if each.motion is not None:
                group = next((group for group in groups if each.motion.same(cast("Motion", group[0].motion))), None)
                if group is None:
                    groups.append([each])
                else:
                    group.append(each)
        found = [Attractor.of(group, self.smallest_kicks) for group in groups]
        return tuple(sorted(found, key=lambda motion: -motion.kinetic_energy_J))

    @property
    def led_to(self) -> tuple[Attractor, ...]:
        """The same in the order of the starts that lead there: a small perturbation, disturbances, other values."""

        def order(motion: Attractor) -> tuple[bool, bool, float]:
            kick = motion.smallest_kick or motion.kick
            return not motion.after_small, kick is None, kick.energy_J if kick else motion.kinetic_energy_J

        return tuple(sorted(self.motions, key=order))

    @property
    def strongest(self) -> Attractor | None:
        """The steady-state response with most kinetic energy."""
        return next(iter(self.motions), None)

    @computed_field
    @property
    def smallest_kick(self) -> Disturbance | None:
        """The smallest disturbance that leads to squeal, None where none was found or looked for."""
        return min(self.smallest_kicks, key=lambda each: each.energy_J, default=None)


def pairs_of(there: Sequence[Motion], here: Sequence[Motion]) -> list[tuple[Motion, Motion]]:
    """Which motions at neighbouring values go over into each other: the most alike first, each in one pair."""
    alike = sorted(((a.apart(b), j, k) for j, a in enumerate(there) for k, b in enumerate(here) if a.like(b)))
    found: dict[int, int] = {}
    for _, j, k in alike:
        if j not in found and k not in found.values():
            found[j] = k
    return [(there[j], here[k]) for j, k in found.items()]


def unpaired(there: Sequence[Motion], here: Sequence[Motion]) -> list[Motion]:
    """The motions at a value that none at its neighbour is alike, but for those that are in a pair already."""
    paired = {id(a) for a, _ in pairs_of(there, here)}
    return [motion for motion in there if id(motion) not in paired]


class Range(Finding):
    """A range of one kind; each end with its uncertainty, None where it is an end of what was asked for."""

    kind: Kind
    first: float
    last: float
    first_uncertainty: float | None
    last_uncertainty: float | None


class FollowedMode(Finding):
    """A mode over the values at which it oscillates; NaN where there is no steady sliding in between."""

    label: str
    values: tuple[float, ...]
    frequency_Hz: tuple[Number, ...]
    growth_rate_1_per_s: tuple[Number, ...]

    @classmethod
    def of(cls, branch: Branch) -> Self:
        """That of a branch of eigenvalues."""
        values, eigenvalues = branch.values.tolist(), branch.eigenvalues
        frequency = (eigenvalues.imag / math.tau).tolist()
        growth = eigenvalues.real.tolist()
        return cls(label=branch.label, values=values, frequency_Hz=frequency, growth_rate_1_per_s=growth)

    @property
    def name(self) -> str:
        """Its largest coordinate at the first value."""
        return self.label.split()[0]


class Onset(Finding):
    """Modes and critical values along a parameter, a row for each value, and the ranges that follow from them.

    `coordinates` are those of the transients; `kicked_range_sought_within` is the fraction of the range to which ends
    of the bistable range were sought; `smallest_kick_sought` says whether the smallest disturbance was at each bistable
    value. `cycles` is None where they were not followed; verdict and ranges are missing until all transients are run.
    """

    printed_by = "drumsqueal.questions.onset.answer.print_study"
    rubbing: ClassVar[str] = "the body"
    outcome: Ending = Ending.COMPLETE
    verdict: str | None = None
    reservations: tuple[str, ...] = ()
    parameter: Parameter
    critical_values: tuple[Critical, ...]
    ranges: tuple[Range, ...] = ()
    kicked_range_sought_within: float
    smallest_kick_sought: bool = False
    modes: tuple[FollowedMode, ...]
    coordinates: tuple[str, ...]
    values: tuple[Row, ...] = ()
    cycles: Diagram | None = None

    @property
    def variation(self) -> Variation:
        """The number that is varied, as the command line reads it."""
        return self.parameter.variation

    @property
    def seeds(self) -> list[Seed]:
        """The motions at the values that were asked for, as `follow_cycles` takes them; none where it was read."""
        motions = [(row.value, motion) for row in self.values if row.asked for motion in row.motions]
        return [
            Seed(value, {"displacement": each.state[0], "velocity": each.state[1]}, each.frequency_Hz)
            for value, each in motions
            if each.state is not None
        ]

    @property
    def in_order(self) -> Sequence[Row]:
        """The rows in the order in which the range was asked for."""
        return self.values if self.variation.first < self.variation.last else self.values[::-1]

    @property
    def coordinate(self) -> str:
        """The coordinate that holds most kinetic energy in most of the motions found: whose amplitude is shown."""
        lines = [motion.line_of for row in self.values for motion in row.motions if motion.line_of is not None]
        shown = [mode.name for mode in self.modes]
        critical = [each.label.split()[0] for each in self.critical_values]
        candidates = [name for name in (*lines, *critical[:1], *shown) if name in self.coordinates]
        return max(candidates, key=lines.count, default=self.coordinates[0])


class OnsetStudy(Onset, Findings):
    """The same for a scene."""

    rubbing: ClassVar[str] = "the lining"


def find_ranges(
    rows: Sequence[Row], critical: Sequence[Critical], resolved: float, points: Sequence[Point] = ()
) -> tuple[Range, ...]:
    """Join rows of one kind; they part at critical values where stability changes, and halfway between rows elsewhere.

    The uncertainty of an end is that of the critical value, or half the distance of the two rows, but not less than is
    `resolved`: motion that decays slowly is still there beyond its end when it is looked at. Steady sliding ends
    between the two of the linear `points` that it ends between.
    """
    ends: list[tuple[float, float | None]] = [(rows[0].value, None)]
    kinds = [rows[0].kind]
    for a, b in pairwise(rows):
        if a.kind is b.kind:
            continue
        between = [each for each in critical if a.value <= each.value <= b.value]
        changes = (a.kind is Kind.SQUEALS) != (b.kind is Kind.SQUEALS)
        if changes and between:
            nearest = between[-1] if a.kind is Kind.SQUEALS else between[0]
            ends.append((nearest.value, nearest.uncertainty))
        else:
            low, high = _about(a, b, points)
            ends.append(((low + high) / 2, max((high - low) / 2, resolved)))
        kinds.append(b.kind)
    ends.append((rows[-1].value, None))
    return tuple(
        Range(kind=kind, first=first, last=last, first_uncertainty=before, last_uncertainty=after)
        for kind, ((first, before), (last, after)) in zip(kinds, pairwise(ends), strict=True)
    )


def _about(a: Row, b: Row, points: Sequence[Point]) -> tuple[float, float]:
    """Between which two values one kind goes over into another, of all values at which it is known."""
    if Kind.NOWHERE in (a.kind, b.kind):
        for p, q in pairwise(point for point in points if a.value <= point.value <= b.value):
            if bool(p.reason) != bool(q.reason):
                return p.value, q.value
    return a.value, b.value
