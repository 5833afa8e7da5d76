"""What a study of the onset finds at each value, as onset.json holds it, and how large a disturbance must be.

A disturbance is a velocity from steady sliding along the shape of a mode, one way or the other. Each is tried in sizes
from below, twice as large each time. For each motion that is found the search then goes on between the largest that
leads elsewhere and the smallest that leads there, as long as a disturbance that takes less energy may lie there.
"""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, ClassVar, Self, cast

import numpy as np
from pydantic import computed_field

from drumsqueal.dynamics.attractor import SMALL_START, Attractor, Disturbance, Response, SteadyResponse
from drumsqueal.dynamics.cycles.cycle import Diagram, RangeKind
from drumsqueal.dynamics.cycles.search import Seed
from drumsqueal.dynamics.ensemble import Family, How, KickDirection, Start, directions, find_surely
from drumsqueal.errors import Ending
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.findings.schema import Finding, Findings, Held, Number, Parameter
from drumsqueal.progress import Progress, named
from drumsqueal.scene.variation import Variation
from drumsqueal.solve.linear.branches import Branch, Critical, Point

QUIET = (RangeKind.STABLE, RangeKind.NEUTRAL)  # nothing squeals there


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
    def kind(self) -> RangeKind:
        """What becomes of a start there."""
        leads = {each.leads_to for each in self.starts}
        if self.no_steady_sliding is not None:
            return RangeKind.NOWHERE
        if self.unstable:
            return RangeKind.SQUEALS
        if Kind.SQUEALS in leads:
            return RangeKind.BISTABLE
        if not all(each.clear or each is Kind.GROWS for each in leads):
            return RangeKind.UNDECIDED
        return RangeKind.NEUTRAL if Kind.NEUTRAL in leads else RangeKind.STABLE

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
                group = next(
                    (group for group in groups if each.motion.same(cast("SteadyResponse", group[0].motion))), None
                )
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


class Range(Finding):
    """A range of one kind; each end with its uncertainty, None where it is an end of what was asked for."""

    kind: RangeKind
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
    """An `Onset` of a scene, with the scene: what `study_onset(scene, …)` returns."""

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
        changes = (a.kind is RangeKind.SQUEALS) != (b.kind is RangeKind.SQUEALS)
        if changes and between:
            nearest = between[-1] if a.kind is RangeKind.SQUEALS else between[0]
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
    if RangeKind.NOWHERE in (a.kind, b.kind):
        for p, q in pairwise(point for point in points if a.value <= point.value <= b.value):
            if bool(p.reason) != bool(q.reason):
                return p.value, q.value
    return a.value, b.value


SMALLER = 10  # halvings below the sizes tried at first, where it squeals already
PRECISION = 0.02  # of a velocity: how far the two may be apart in the end
_SAME_SIZE = 1e-9  # relative difference of two sizes that are one, but for round-off


def smallest_disturbances(
    family: Family, rows: Sequence[Row], how: How, progress: Progress
) -> Iterator[tuple[Row, ...]]:
    """Find the smallest disturbance that leads to each motion at each row: the rows with it, known better each time.

    What the disturbances lead to joins the starts of a row, and its motions. A motion that none of those tried leads to
    has none.
    """
    searches = [_Search(row, family) for row in rows]
    while True:
        tasks = [(search, *each) for search in searches for each in search.next()]
        if not tasks:
            return
        _run(family, tasks, how, progress)
        yield tuple(search.row for search in searches)


class _Search:
    """Disturbances along the modes of a row, either way, and where those tried led."""

    def __init__(self, row: Row, family: Family) -> None:
        self._row, self._directions = row, directions(row.point, family)
        self._led: list[dict[float, Response]] = [{} for _ in self._directions]
        for response in row.starts:
            for direction, led in zip(self._directions, self._led, strict=True):
                kick = response.kick
                if kick is not None and (kick.mode, kick.forwards) == (direction.mode.label, direction.forwards):
                    led[math.sqrt(kick.energy_J)] = response

    @property
    def point(self) -> Point:
        """The linear point."""
        return self._row.point

    @property
    def motions(self) -> Sequence[SteadyResponse]:
        """Those known there."""
        return self._row.motions

    @property
    def row(self) -> Row:
        """The row with all that is known."""
        found = [self._smallest(motion) for motion in self._row.motions]
        return self._row.model_copy(update={"smallest_kicks": tuple(each for each in found if each is not None)})

    def next(self) -> list[tuple[KickDirection, float]]:
        """What to try next: first the sizes of each direction, then what lies between."""
        tasks = []
        for direction, led in zip(self._directions, self._led, strict=True):
            sizes = set(direction.sizes) if not led or max(led) < (1 - _SAME_SIZE) * direction.sizes[-1] else set()
            tasks += [(direction, size) for size in sorted(sizes) if not _tried(led, size)]
        if tasks:
            return tasks
        for motion in self._row.motions:
            brackets = [_bracket(led, motion) for led in self._led]
            best = min((high for _, high in brackets), default=math.inf)
            for direction, led, (low, high) in zip(self._directions, self._led, brackets, strict=True):
                sizes = _between(low, high) if low < best else []
                fresh = [size for size in sizes if not _tried(led, size) and size >= direction.least / 2**SMALLER]
                tasks += [(direction, size) for size in fresh if (direction, size) not in tasks]
        return tasks

    def add(self, direction: KickDirection, size: float, response: Response) -> None:
        """Note where a disturbance led."""
        self._led[self._directions.index(direction)][size] = response
        self._row = self._row.model_copy(update={"starts": (*self._row.starts, response)})

    def _smallest(self, motion: SteadyResponse) -> Disturbance | None:
        """The smallest that leads to a motion, as far as it is known."""
        brackets = [_bracket(led, motion) for led in self._led]
        if not brackets or min(high for _, high in brackets) == math.inf:
            return None
        k = min(range(len(brackets)), key=lambda k: brackets[k][1])
        low, high = brackets[k]
        lower, upper = (self._directions[k].kick(size) for size in (low, high))
        halfway = dict(self._directions[k].kick((low + high) / 2))
        return Disturbance(
            **halfway,
            speed_uncertainty_m_per_s=(upper.speed_m_per_s - lower.speed_m_per_s) / 2,
            energy_uncertainty_J=(upper.energy_J - lower.energy_J) / 2,
            leads_to=cast("SteadyResponse", self._led[k][high].motion),
        )


def _tried(led: dict[float, Response], size: float) -> bool:
    return any(abs(other / size - 1) < _SAME_SIZE for other in led)


def _bracket(led: dict[float, Response], motion: SteadyResponse) -> tuple[float, float]:
    """The largest size below that leads elsewhere, zero without one, and the smallest that leads to a motion."""
    high = min((size for size, each in led.items() if each.motion and each.motion.same(motion)), default=math.inf)
    elsewhere = (size for size, each in led.items() if size < high and each.leads_to.clear)
    return max(elsewhere, default=0.0), high


def _between(low: float, high: float) -> list[float]:
    """Sizes to try between one that leads elsewhere and one that leads to the motion."""
    if high == math.inf or high <= (1 + PRECISION) * low:
        return []
    if low == 0:
        return (high / 2.0 ** np.arange(1, SMALLER + 1)).tolist()
    return np.geomspace(low, high, 5)[1:-1].tolist()


def _run(family: Family, tasks: Sequence[tuple[_Search, KickDirection, float]], how: How, progress: Progress) -> None:
    """Try sizes, and note where each leads.

    Near the smallest disturbance that leads to a motion the transient dwells on the unstable cycle: what is none of the
    motions known at the value must last longer.
    """
    meant = {}
    starts: list[tuple[Point, Start]] = []
    known: dict[float, Sequence[SteadyResponse]] = {}
    for search, direction, size in tasks:
        start = direction.start(size)
        meant[search.point.value, start.name] = search, direction, size
        starts.append((search.point, start))
        known[search.point.value] = search.motions

    def is_known(response: Response, _: SteadyResponse | None) -> bool:
        search, motion = meant[response.value, response.start][0], response.motion
        return any(motion is not None and motion.same(other) for other in search.motions)

    stages, progress = (Criteria.persistent, Criteria.lasting), named(progress, "smallest disturbance")
    for response, seconds in find_surely(family, starts, how, stages, is_known, known=known, progress=progress):
        search, direction, size = meant[response.value, response.start]
        search.add(direction, size, response.model_copy(update={"simulated_s": seconds}))
