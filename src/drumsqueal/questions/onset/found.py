"""What a study of the onset finds at each value, as onset.json holds it, in words, and how large disturbances must be.

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
from drumsqueal.dynamics.cycles.cycle import Diagram, Event, RangeKind
from drumsqueal.dynamics.cycles.search import Seed
from drumsqueal.dynamics.ensemble import (
    Family,
    IntegratorOptions,
    PerturbationDirection,
    directions,
    find_surely,
)
from drumsqueal.errors import Ending
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.findings.schema import Finding, Findings, Held, Number, Parameter
from drumsqueal.findings.signals.regime import listed, rest_words
from drumsqueal.physics.model import at_lining
from drumsqueal.progress import Progress, named
from drumsqueal.questions.cycle.study import WHOLE, shown_Hz
from drumsqueal.scene.variation import Variation
from drumsqueal.solve.linear.branches import DIVERGENCE, Branch, Critical, Point
from drumsqueal.solve.motion import pulling_sentence

QUIET = (RangeKind.STABLE, RangeKind.NEUTRAL)  # nothing squeals there


class Row(Finding):
    """One value: its steady sliding, where each start led, and whether it was asked for or lies at a boundary.

    `no_steady_sliding` is the reason where there is none. `smallest_disturbances` are those that lead to each motion,
    as far as they were found and looked for. `point` is the linear point.
    """

    value: float
    asked: bool
    no_steady_sliding: str | None
    unstable: bool
    largest_growth_rate_1_per_s: Number
    starts: tuple[Response, ...] = ()
    smallest_disturbances: tuple[Disturbance, ...] = ()
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
                same = (group for group in groups if each.motion.same(cast("SteadyResponse", group[0].motion)))
                if (group := next(same, None)) is None:
                    groups.append(group := [])
                group.append(each)
        found = [Attractor.of(group, self.smallest_disturbances) for group in groups]
        return tuple(sorted(found, key=lambda motion: -motion.kinetic_energy_J))

    @property
    def led_to(self) -> tuple[Attractor, ...]:
        """The same in the order of the starts that lead there: a small perturbation, disturbances, other values."""

        def order(motion: Attractor) -> tuple[bool, bool, float]:
            disturbance = motion.smallest_disturbance or motion.disturbance
            return (
                not motion.after_small,
                disturbance is None,
                disturbance.energy_J if disturbance else motion.kinetic_energy_J,
            )

        return tuple(sorted(self.motions, key=order))

    @property
    def strongest(self) -> Attractor | None:
        """The steady-state response with most kinetic energy."""
        return next(iter(self.motions), None)

    @computed_field
    @property
    def smallest_disturbance(self) -> Disturbance | None:
        """The smallest disturbance that leads to squeal, None where none was found or looked for."""
        return min(self.smallest_disturbances, key=lambda each: each.energy_J, default=None)


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

    `coordinates` are those of the transients; `bistable_range_sought_within` is the fraction of the range to which ends
    of the bistable range were sought; `smallest_disturbance_sought` says whether that was at each bistable value.
    `cycles` is None where they were not followed; verdict and ranges are missing until all transients are run.
    """

    printed_by = "drumsqueal.questions.onset.answer.print_study"
    rubbing: ClassVar[str] = "the body"
    outcome: Ending = Ending.COMPLETE
    verdict: str | None = None
    warnings: tuple[str, ...] = ()
    parameter: Parameter
    critical_values: tuple[Critical, ...]
    ranges: tuple[Range, ...] = ()
    bistable_range_sought_within: float
    smallest_disturbance_sought: bool = False
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
    family: Family, rows: Sequence[Row], how: IntegratorOptions, progress: Progress
) -> Iterator[tuple[Row, ...]]:
    """Find the smallest disturbance that leads to each motion at each row: the rows with it, known better each time.

    What the disturbances lead to joins the starts of a row, and its motions. A motion that none of those tried leads to
    has none. Near the smallest disturbance that leads to one the transient dwells on the unstable cycle: what is none
    of the motions known at the value must last longer.
    """
    searches = {row.value: _DisturbanceSearch(row, family) for row in rows}
    stages, progress = (Criteria.persistent, Criteria.lasting), named(progress, "smallest disturbance")

    def is_known(response: Response, _: SteadyResponse | None) -> bool:
        motion = response.motion
        return motion is not None and any(motion.same(other) for other in searches[response.value].row.motions)

    while True:
        meant, starts, known = {}, [], {}
        for value, search in searches.items():
            for direction, size in search.next():
                start = direction.start(size)
                meant[value, start.name] = direction, size
                starts.append((search.row.point, start))
                known[value] = search.row.motions
        if not starts:
            return
        for response, seconds in find_surely(family, starts, how, stages, is_known, known=known, progress=progress):
            direction, size = meant[response.value, response.start]
            lasted = response.model_copy(update={"simulated_s": seconds})
            searches[response.value].add(direction, size, lasted)
        yield tuple(search.found for search in searches.values())


class _DisturbanceSearch:
    """Disturbances along the modes of a row, either way, and where those tried led; `row` has their responses."""

    def __init__(self, row: Row, family: Family) -> None:
        self.row, self._directions = row, directions(row.point, family)
        self._led: list[dict[float, Response]] = [{} for _ in self._directions]
        for response in row.starts:
            for direction, led in zip(self._directions, self._led, strict=True):
                disturbance = response.disturbance
                if disturbance is not None and (disturbance.mode, disturbance.forwards) == (
                    direction.mode.label,
                    direction.forwards,
                ):
                    led[math.sqrt(disturbance.energy_J)] = response

    @property
    def found(self) -> Row:
        """The row with the smallest disturbances, as far as they are known."""
        smallest = (self._smallest(motion) for motion in self.row.motions)
        return self.row.model_copy(update={"smallest_disturbances": tuple(filter(None, smallest))})

    def next(self) -> list[tuple[PerturbationDirection, float]]:
        """What to try next: first the sizes of each direction, then what lies between."""
        tasks = []
        for direction, led in zip(self._directions, self._led, strict=True):
            sizes = set(direction.sizes) if not led or max(led) < (1 - _SAME_SIZE) * direction.sizes[-1] else set()
            tasks += [(direction, size) for size in sorted(sizes) if not _tried(led, size)]
        if tasks:
            return tasks
        for motion in self.row.motions:
            brackets = [_bracket(led, motion) for led in self._led]
            best = min((high for _, high in brackets), default=math.inf)
            for direction, led, (low, high) in zip(self._directions, self._led, brackets, strict=True):
                sizes = _between(low, high) if low < best else []
                fresh = [size for size in sizes if not _tried(led, size) and size >= direction.least / 2**SMALLER]
                tasks += [(direction, size) for size in fresh if (direction, size) not in tasks]
        return tasks

    def add(self, direction: PerturbationDirection, size: float, response: Response) -> None:
        """Note where a disturbance led."""
        self._led[self._directions.index(direction)][size] = response
        self.row = self.row.model_copy(update={"starts": (*self.row.starts, response)})

    def _smallest(self, motion: SteadyResponse) -> Disturbance | None:
        """The smallest that leads to a motion, as far as it is known."""
        brackets = [_bracket(led, motion) for led in self._led]
        if not brackets or min(high for _, high in brackets) == math.inf:
            return None
        k = min(range(len(brackets)), key=lambda k: brackets[k][1])
        low, high = brackets[k]
        lower, upper = (self._directions[k].disturbance(size) for size in (low, high))
        halfway = dict(self._directions[k].disturbance((low + high) / 2))
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


# In words, and what limits it

EXACT = 1e-6  # relative uncertainty that is not worth stating


def verdict(study: Onset) -> str:
    """State where the eigenvalues predict squeal, where only a large disturbance leads to it, and its frequency."""
    along = study.variation
    low, high = sorted((along.first, along.last))
    over = f"Along {along.key} from {along.shown(low):.6g} to {along.with_unit(high)}"
    told = "; ".join(filter(None, (_linear(study), _bistable(study), _undecided(study))))
    return f"{over} {told}.{_coexisting(study)}{_smallest_disturbances(study)}"


def _linear(study: Onset) -> str:
    unstable = [each for each in study.ranges if each.kind is RangeKind.SQUEALS]
    if not unstable:
        return "the eigenvalues predict no squeal"
    if len(study.ranges) == 1:
        return "the eigenvalues predict squeal everywhere"
    return f"the eigenvalues predict squeal {listed([_place(study, each) for each in unstable])}"


def _place(study: Onset, found: Range) -> str:
    """Where a range is: below, above or from one value to another, and whose critical values they are."""
    along = study.variation
    first = _value(along, found.first, found.first_uncertainty, along.brief(found.first))
    last = _value(along, found.last, found.last_uncertainty, along.brief(found.last)) + along.unit_after
    if found.first_uncertainty is None and found.last_uncertainty is None:
        return "all along"
    ends = [found.first] * (found.first_uncertainty is not None) + [found.last] * (found.last_uncertainty is not None)
    modes = [
        each.label if each.label == DIVERGENCE else f"{each.label}, {shown_Hz(each.frequency_Hz)} Hz"
        for each in study.critical_values
        if any(abs(each.value - end) <= each.uncertainty for end in ends)
    ]
    named = f" ({', '.join(dict.fromkeys(modes))})" if modes and found.kind is RangeKind.SQUEALS else ""
    if found.first_uncertainty is None:
        return f"below {last}{named}"
    if found.last_uncertainty is None:
        return f"above {first}{along.unit_after}{named}"
    return f"from {first} to {last}{named}"


def _bistable(study: Onset) -> str:
    bistable = [each for each in study.ranges if each.kind is RangeKind.BISTABLE]
    if not bistable:
        return _quiet(study)
    places = listed([_place(study, each) for each in bistable])
    smalls = [row.small for row in study.values if row.asked and row.kind is RangeKind.BISTABLE]
    neutral = smalls and all(small is not None and small.leads_to is Kind.NEUTRAL for small in smalls)
    sliding = "neutral there (small motion neither grows nor decays)" if neutral else "stable there"
    text = f"bistable {places}: steady sliding is {sliding}, but a large disturbance leads to squeal"
    motions = [motion for row in study.values if row.kind is RangeKind.BISTABLE for motion in row.motions]
    lines = [each.frequency_Hz for each in motions if each.frequency_Hz is not None]
    if not lines:
        return text
    low, high = min(lines), max(lines)
    heard = f"{' to '.join(dict.fromkeys([shown_Hz(low), shown_Hz(high)]))} Hz"
    ends = {end for each in bistable for end in (each.first, each.last)}
    onset = next((each.frequency_Hz for each in study.critical_values if each.value in ends), 0.0)
    compared = f" (eigenvalue at the critical value: {shown_Hz(onset)} Hz)" if onset > 0 else ""
    return f"{text}, at the values tried at {heard}{compared}"


def _quiet(study: Onset) -> str:
    """What becomes of starts where none squeals with steady sliding stable."""
    kinds = {each.kind for each in study.ranges}
    elsewhere = "elsewhere " if RangeKind.SQUEALS in kinds else ""
    if RangeKind.STABLE in kinds:
        return f"{elsewhere}no start that was tried squeals"
    if RangeKind.NEUTRAL in kinds:
        neutral = "its amplitude is that of the initial perturbation, which is not squeal"
        return f"{elsewhere}motion neither grows nor decays: {neutral}"
    return ""


def _undecided(study: Onset) -> str:
    """Where no transient squealed and not all of them have come to rest."""
    undecided = [_place(study, each) for each in study.ranges if each.kind is RangeKind.UNDECIDED]
    return f"whether a disturbance leads to squeal is undecided {listed(undecided)}" if undecided else ""


def _coexisting(study: Onset) -> str:
    """Where several motions coexist and, where there are most, which and what leads to each."""
    several = [row for row in study.in_order if row.asked and len(row.motions) > 1]
    if not several:
        return ""
    most = max(several, key=lambda row: (len(row.motions), row.kind is RangeKind.BISTABLE))
    each = listed([motion_words(study, motion) for motion in most.led_to])
    where = _values(study, [row.value for row in several])
    there = f"; at {study.variation.with_unit(most.value)}" if len(several) > 1 else ":"
    return f" Several motions coexist at {where}{there} {each}."


def motion_words(study: Onset, motion: Attractor) -> str:
    """Line and amplitude of a motion, and what leads to it."""
    name = study.coordinate
    line = "" if motion.frequency_Hz is None else f"{shown_Hz(motion.frequency_Hz)} Hz with "
    scale, unit, shown = shown_size(study, [motion.amplitude[name]])
    size = f"{scale * motion.amplitude[name]:.3g} {unit} of {shown}"
    return f"{line}{size} {_after(motion)} {start_words(motion, study.variation)}"


def shown_size(study: Onset, amplitudes: Sequence[float]) -> tuple[float, str, str]:
    """How amplitudes of a study's coordinate are shown: how many units are one of SI, the unit, and its name."""
    return at_lining(getattr(study, "scene", None), study.coordinate, max(amplitudes, default=0.0))


def shown_line(frequency: float) -> str:
    """A frequency in tenths of a Hz, or with four digits."""
    return f"{frequency:.1f}" if frequency >= WHOLE else f"{frequency:.4g}"


def _after(motion: Attractor) -> str:
    return (
        "after" if motion.after_small or motion.disturbance is not None or not motion.from_values else "continued from"
    )


def start_words(motion: Attractor, along: Variation) -> str:
    """What leads to a motion: a small perturbation, the smallest disturbance, or the motion at another value.

    The velocity of a disturbance is that of the fastest point of the lining's surface.
    """
    if motion.after_small:
        return "a small perturbation"
    if motion.smallest_disturbance is not None:
        smallest = motion.smallest_disturbance
        speed = with_uncertainty(smallest.speed_m_per_s, smallest.speed_uncertainty_m_per_s)
        return f"{speed} m/s along {smallest.mode}"
    if motion.disturbance is not None:
        return f"{motion.disturbance.speed_m_per_s:.3g} m/s along {motion.disturbance.mode}"
    if motion.from_values:
        return f"the motion at {along.with_unit(motion.from_values[0])}"
    return motion.start


def _smallest_disturbances(study: Onset) -> str:
    """How large a disturbance must be at least and at most, over the values."""
    found = [(row.smallest_disturbance, row.value) for row in study.values if row.smallest_disturbance]
    found.sort(key=lambda each: each[0].energy_J)
    sizes = []
    for smallest, value in found[:1] + found[1:][-1:]:
        speed = with_uncertainty(smallest.speed_m_per_s, smallest.speed_uncertainty_m_per_s)
        sizes.append(f"{speed} m/s ({smallest.energy_J:.2g} J) at {study.variation.with_unit(value)}")
    if not sizes:
        return ""
    return (
        f" The smallest disturbance along a mode that starts squeal, as the velocity of {study.rubbing}'s surface, is "
        f"{' to '.join(sizes)} at the values tried."
    )


def _value(along: Variation, value: float, uncertainty: float | None, exact: str = "") -> str:
    if not uncertainty or uncertainty < EXACT * abs(value):
        return exact or f"{along.shown(value):.6g}"
    return with_uncertainty(along.shown(value), along.shown(uncertainty))


def with_uncertainty(value: float, uncertainty: float) -> str:
    """A value in as many digits as its uncertainty leaves it, in one: 47.94 ± 0.02, (7.6 ± 0.1)e-25."""
    # Of numbers below 1e-4 the zeros behind the point are not written.
    if 0 < abs(value) < 1e-4:
        power = math.floor(math.log10(abs(value)))
        return f"({with_uncertainty(value / 10.0**power, uncertainty / 10.0**power)})e{power}"
    rounded = float(f"{uncertainty:.1g}")
    return f"{value:.{max(0, -math.floor(math.log10(rounded)))}f} ± {rounded:g}"


def critical_words(critical: Critical, along: Variation) -> str:
    """Which mode gains or loses stability at which value."""
    becomes = "loses stability" if critical.destabilises else "gains stability"
    value = _value(along, critical.value, critical.uncertainty)
    shown = f"{critical.frequency_Hz:.2f}" if critical.frequency_Hz >= 1 else f"{critical.frequency_Hz:.4g}"
    line = f" at {shown} Hz" if critical.frequency_Hz > 0 else ""
    return f"{critical.label} {becomes}{line} as the value rises past {along.key} = {value}{along.unit_after}"


def warnings(study: Onset) -> tuple[str, ...]:
    """State what limits the verdict: modes that cannot be started, transients without an answer, ends not found."""
    found = []
    unstable = {mode.name for row in study.values for mode in row.point.modes if mode.unstable}
    unseen = sorted(unstable - set(study.coordinates))
    if unseen:
        moving = f"{', '.join(unseen)} becomes unstable, but the transients hold {', '.join(study.coordinates)} only"
        found.append(f"{moving}: start those coordinates, too.")
    asked = [row for row in study.values if row.asked]
    quiet = [row.value for row in asked if row.kind is RangeKind.SQUEALS and not any(each.lasts for each in row.starts)]
    if quiet:
        found.append(f"Unstable by its eigenvalues, but no transient squealed: {_values(study, quiet)}.")
    away = f"ran away, with the shoe turned by more than {Criteria.small_rotation:g} rad,"
    for leads, words in ((Kind.UNDECIDED, "had not settled"), (Kind.RUNS_AWAY, away), (Kind.FAILED, "failed")):
        led = [(row.value, each) for row in study.values for each in row.starts if each.leads_to is leads]
        if led:
            longest = max(each.simulated_s for _, each in led)
            still = f" after {longest:.2g} s: it still decayed, grew or came and went" * (leads is Kind.UNDECIDED)
            found.append(f"A transient {words} at {_values(study, list(dict(led)))}{still}; see the table.")
    rests = {row.value: each for row in study.values for each in row.starts if each.rests_at}
    if rests:
        first, place = next(iter(rests.items()))
        at = f"at {study.variation.with_unit(first)} {rest_words(place.rests_at)}"
        found.append(
            f"A transient came to rest in another equilibrium, no squeal, at {_values(study, list(rests))}: {at}."
        )
    ends = (each.saturated for row in study.values for each in row.starts if each.saturated is not None)
    found += filter(None, [pulling_sentence(min((each.smallest_force for each in ends), default=math.inf)).lstrip()])
    nowhere = {row.value: row.no_steady_sliding for row in asked if row.kind is RangeKind.NOWHERE}
    if nowhere:
        first, reason = next(iter(nowhere.items()))
        at = "" if len(nowhere) == 1 else f" At {_values(study, [first])}:"
        found.append(f"No steady sliding at {_values(study, list(nowhere))}{'.' if at else ':'}{at} {reason}.")
    bistable = [each for each in study.ranges if each.kind is RangeKind.BISTABLE]
    open_ends = [each.first for each in bistable if each.first_uncertainty is None]
    open_ends += [each.last for each in bistable if each.last_uncertainty is None]
    if open_ends:
        which = "the ends" if len(open_ends) > 1 else "the end"
        found.append(
            f"The bistable range may go on beyond {_values(study, open_ends)}, {which} of the range asked for."
        )
    found += _contradictions(study)
    not_started = [row.value for row in asked if row.kind is RangeKind.BISTABLE and row.smallest_disturbance is None]
    if study.smallest_disturbance_sought and not_started:
        squeal = "squeal that a neighbouring value's motion leads to"
        found.append(f"No disturbance along a mode that was tried starts the {squeal}: {_values(study, not_started)}.")
    if bistable or any(each.kind in QUIET for each in study.ranges):
        other = f"Disturbances that were not tried may lead to squeal{' elsewhere, too' * bool(bistable)}"
        found.append(f"{other}: no range called stable has been proved stable.")
    return tuple(found)


def _contradictions(study: Onset) -> list[str]:
    """Where the limit cycles end a bistable range elsewhere than the transients do: there they are few, and short.

    Only where the cycles do end there, at a bifurcation that was found.
    """
    if study.cycles is None:
        return []
    told = []
    for each in study.ranges:
        cycles = [(a, b) for a, b in study.cycles.squeals_only_when_disturbed if a < each.last and b > each.first]
        if each.kind is not RangeKind.BISTABLE or not cycles:
            continue
        first, last = min(a for a, _ in cycles), max(b for _, b in cycles)
        ends = ((each.first, each.first_uncertainty, first), (each.last, each.last_uncertainty, last))
        for end, uncertainty, cycle in ends:
            apart = uncertainty and abs(end - cycle) > uncertainty + EXACT * abs(end)
            if apart and _ends_cycles(study.cycles, cycle, end, each):
                by_transients = _value(study.variation, end, uncertainty)
                told.append(
                    f"The limit cycles end the bistable range at {study.variation.with_unit(cycle, '.5g')}, not at "
                    f"{by_transients}{study.variation.unit_after}, where transients do: near such an end these decay "
                    "slowly, and may miss a cycle with a small basin. Trust the cycles there."
                )
    return told


def _ends_cycles(cycles: Diagram, value: float, end: float, found: Range) -> bool:
    """Whether squeal is known to end at a value, and not at the end of a range that transients give.

    It is where that is a bifurcation on a branch or of steady sliding, cycles are followed from there to the other end,
    and no motion of the range, if that goes further, is on none of the branches.
    """
    # An end of a range is the very value at which a branch changes its stability.
    special = {each.value for branch in cycles.branches for each in branch.special if each.what is not Event.CORNER}
    stable, unstable = (
        {value for each in spans for value in each}
        for spans in (cycles.steady_sliding_stable, cycles.steady_sliding_unstable)
    )
    low, high = sorted((value, end))
    followed = not any(each.low <= high and each.high >= low for each in cycles.not_followed)
    further = found.first < value < found.last
    off = further and any(found.first <= each.value <= found.last for each in cycles.off_branches)
    return value in special | (stable & unstable) and followed and not off


def _values(study: Onset, values: Sequence[float]) -> str:
    shown = [study.variation.with_unit(value) for value in values[:3]]
    return listed(shown) if len(values) <= 3 else f"{', '.join(shown)} and {len(values) - 3} more"
