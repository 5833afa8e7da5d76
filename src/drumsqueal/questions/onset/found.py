"""What a study of the onset finds at each value, and the ranges that follow, as onset.json holds it."""

import math
from collections.abc import Sequence
from enum import StrEnum
from itertools import pairwise
from typing import Any, Self

import numpy as np
from pydantic import Field, computed_field

from drumsqueal.findings.parameter import Parameter
from drumsqueal.findings.part import Finding, Held, Number
from drumsqueal.findings.saturated import Saturated
from drumsqueal.findings.schema import Findings
from drumsqueal.outcome import Ending
from drumsqueal.questions.cycle.diagram import Diagram
from drumsqueal.scene.variation import Variation
from drumsqueal.solve.linear.branches import Branch, Critical, Point

# Two motions are alike where the logarithms of their kinetic energy and of their frequency differ by less.
ALIKE_ENERGY, ALIKE_FREQUENCY = 0.5, 0.05


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


class Motion(Finding):
    """A steady-state response, by the last part of a transient: half its peak-to-peak values and rms (m, rad).

    `frequency_Hz` is that of the line with most kinetic energy, of the coordinate `line_of`. Of the motions at which
    contact is lost and slip reversed it has these fractions. `state` (2, n) is vibration and velocity at its end.
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
    state: Any = Held

    def like(self, other: "Motion") -> bool:
        """Whether two motions, at one value or at neighbouring ones, are alike in size and frequency."""
        sizes = [max(each.kinetic_energy_J, 1e-300) for each in (self, other)]
        near = abs(np.log(sizes[0] / sizes[1])) < ALIKE_ENERGY
        if self.frequency_Hz is None or other.frequency_Hz is None:
            return bool(near)
        return bool(near and abs(np.log(self.frequency_Hz / other.frequency_Hz)) < ALIKE_FREQUENCY)


class Response(Finding):
    """Where a start led at a value, after how long (s), and the motion that it squeals with.

    `saturated` is how the transient ended.
    """

    start: str
    leads_to: Leads
    simulated_s: float
    outcome: str
    motion: Motion | None = None
    value: float = Field(default=np.nan, exclude=True)
    saturated: Any = Held

    @classmethod
    def of(
        cls, value: float, start: str, leads_to: Leads, ended: Saturated, seconds: float, names: Sequence[str]
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
                state=np.array([ended.vibration, ended.velocity]),
            )
        return cls(
            start=start,
            leads_to=leads_to,
            simulated_s=seconds,
            outcome=ended.outcome,
            motion=motion,
            value=value,
            saturated=ended,
        )

    @property
    def lasts(self) -> bool:
        """Whether motion is left, or still grows."""
        return self.leads_to in (Leads.SQUEALS, Leads.GROWS)


class Disturbance(Finding):
    """The smallest disturbance that leads to squeal, of those along the modes: a velocity from steady sliding.

    It lies between the largest that decays and the smallest that does not, both along `mode` (its label), either way,
    and `velocity` is halfway (m/s, rad/s). With it the fastest point of the lining's surface moves at `speed_m_per_s`
    and the shoe has the kinetic energy `energy_J`; the uncertainties are half of what lies between. Free vibration from
    it would come to `edge_share` times the nearer contact boundary, lift-off or slip reversal, by the linear model.
    `leads_to` is where the larger of the two leads.
    """

    mode: str
    velocity: dict[str, float]
    speed_m_per_s: float
    speed_uncertainty_m_per_s: float
    energy_J: float
    energy_uncertainty_J: float
    edge_share: float
    leads_to: Motion


class Row(Finding):
    """One value: its steady sliding, where each start led, and whether it was asked for or lies at a boundary.

    `no_steady_sliding` is the reason where there is none. `smallest_kick` is the smallest disturbance that leads to
    squeal, None where none was found or looked for. `point` is the linear point.
    """

    value: float
    asked: bool
    no_steady_sliding: str | None
    unstable: bool
    largest_growth_rate_1_per_s: Number
    starts: tuple[Response, ...] = ()
    smallest_kick: Disturbance | None = None
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
        return next((each for each in self.starts if each.start == "small"), None)

    @computed_field
    @property
    def motions(self) -> tuple[Motion, ...]:
        """The steady-state responses that differ, the one with most kinetic energy first."""
        found: list[Motion] = []
        for each in self.starts:
            if each.motion is not None and not any(each.motion.like(other) for other in found):
                found.append(each.motion)
        return tuple(sorted(found, key=lambda motion: -motion.kinetic_energy_J))

    @property
    def strongest(self) -> Motion | None:
        """The steady-state response with most kinetic energy."""
        return next(iter(self.motions), None)


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


def find_ranges(rows: Sequence[Row], critical: Sequence[Critical], resolved: float) -> tuple[Range, ...]:
    """Join rows of one kind; they part at critical values where stability changes, and halfway between rows elsewhere.

    The uncertainty of an end is that of the critical value, or half the distance of the two rows, but not less than is
    `resolved`: motion that decays slowly is still there beyond its end when it is looked at.
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
            ends.append(((a.value + b.value) / 2, max((b.value - a.value) / 2, resolved)))
        kinds.append(b.kind)
    ends.append((rows[-1].value, None))
    return tuple(
        Range(kind=kind, first=first, last=last, first_uncertainty=before, last_uncertainty=after)
        for kind, ((first, before), (last, after)) in zip(kinds, pairwise(ends), strict=True)
    )
