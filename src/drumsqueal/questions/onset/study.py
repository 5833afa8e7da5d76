"""Linear against nonlinear onset along a parameter: where eigenvalues predict squeal, where a disturbance starts it."""

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import partial
from itertools import groupby, pairwise, product
from typing import Any, NamedTuple, cast, overload

import numpy as np

from drumsqueal.dynamics.attractor import SMALL_START, Response, SteadyResponse, unpaired
from drumsqueal.dynamics.cycles.branches import VALUES
from drumsqueal.dynamics.cycles.cycle import RangeKind
from drumsqueal.dynamics.ensemble import (
    SIZES,
    Family,
    IntegratorOptions,
    Start,
    directions,
    find_attractors,
    go_on,
    round_seconds,
)
from drumsqueal.errors import Ending, RequestError
from drumsqueal.findings.kinds import Criteria
from drumsqueal.findings.schema import Parameter
from drumsqueal.physics.composition import linear_coordinates
from drumsqueal.physics.elasticity import check_shapes_stay
from drumsqueal.physics.model import Model, build_model
from drumsqueal.progress import Progress, named, silent
from drumsqueal.questions.cycle.study import checked_range, follow_cycles
from drumsqueal.questions.onset.found import (
    QUIET,
    FollowedMode,
    Onset,
    OnsetStudy,
    Row,
    find_ranges,
    smallest_disturbances,
    verdict,
    warnings,
)
from drumsqueal.scene import Profile, Scene, SceneError
from drumsqueal.scene.variation import Variation, may_not_rest, read_variation
from drumsqueal.solve.linear.branches import Branches, ModelAt, Point, follow_modes, point_at


class LinearOnset(NamedTuple):
    """The linear half of a study: what transients are then compared with; of a family of models there is no scene."""

    scene: Scene | None
    variation: Variation
    family: Family
    linear_at: ModelAt
    linear: Branches
    how: IntegratorOptions


Keep = Callable[[Any], None]


@overload
def study_onset(
    scene: Scene,
    along: str | Variation,
    *,
    within: float = ...,
    smallest_disturbance: bool = ...,
    cycles: bool = ...,
    progress: Progress = ...,
    keep: Keep = ...,
) -> OnsetStudy: ...


@overload
def study_onset(
    scene: Callable[[Any], Model],
    along: Variation,
    *,
    sample_rate: float,
    tolerance: float = ...,
    within: float = ...,
    smallest_disturbance: bool = ...,
    cycles: bool = ...,
    progress: Progress = ...,
    keep: Keep = ...,
) -> Onset: ...


def study_onset(
    scene: Scene | Callable[[Any], Model],
    along: str | Variation,
    *,
    sample_rate: float = 0.0,
    tolerance: float = 1e-6,
    within: float = 1e-3,
    smallest_disturbance: bool = False,
    cycles: bool = False,
    progress: Progress = silent,
    keep: Keep = lambda _: None,
) -> Onset:
    """Compare linear with nonlinear onset along a parameter: `study_onset(scene, "drum.speed=1..40").ranges`.

    `along` is "KEY=FROM..TOxN" or a `Variation`. Critical values are roots of Re λ. At each value transients start from
    a small perturbation and from a large one along each mode; where none of them lasts though a neighbour's does, it
    goes on from the neighbour's state, upwards and downwards. Ends of the bistable range are then sought `within` that
    fraction of the whole range and, on demand, the smallest disturbance that leads to squeal at each bistable value,
    and the limit cycles. `keep` takes what is known on the way.

    In place of a scene, a function of one number gives a model, with the sample rate (Hz) and its `tolerance`.

    Raises SceneError and RequestError for what cannot be studied, and ValueError for a fraction that is not between 0
    and 1.

    ```pycon
    >>> def block(speed):
    ...     law = drumsqueal.ExponentialLaw(0.5, 0.3, 2.0)
    ...     return drumsqueal.block_on_belt(law, belt_speed=speed, damping=0.1)
    >>> speeds = drumsqueal.Variation("belt speed", "m/s", (0.5, 0.7, 0.9))
    >>> study = drumsqueal.study_onset(block, speeds, sample_rate=20.0)
    >>> round(study.critical_values[0].value, 4)  # ln 2, where the damping of 0.1 N s/m is that of friction
    0.6931
    >>> [(str(found.kind), round(found.last, 2)) for found in study.ranges]
    [('squeals', 0.69), ('bistable', 0.87), ('stable', 0.9)]
    ```
    """
    if not 0 < within < 1:
        raise ValueError(f"the fraction must be between 0 and 1, got {within}")
    if isinstance(scene, Scene):
        variation = read_variation(along, scene, option="along") if isinstance(along, str) else along
        if cycles:
            checked_range(scene, variation)
        predicted = predict(scene, variation, progress)
    else:
        variation = cast("Variation", along)
        first = scene(variation.first)
        if first.contact.friction is None or first.forced:
            raise RequestError("the onset of squeal takes models with friction and without a harmonic force")
        family, how = Family(scene, first.names, first.names), IntegratorOptions(sample_rate, tolerance)
        predicted = _predict(None, variation, family, scene, how, progress)
    return compare(
        predicted, within, smallest_disturbance=smallest_disturbance, cycles=cycles, progress=progress, keep=keep
    )


def predict(scene: Scene, variation: Variation, progress: Progress = silent) -> LinearOnset:
    """Follow the modes and find the critical values. Raises SceneError and RequestError for what cannot be studied."""
    if not scene.rubs:
        raise RequestError("friction: this scene has none, so nothing in it can squeal; add the table")
    if scene.forcing is not None:
        raise RequestError("forcing: with a harmonic force there is no steady sliding; add --set forcing=none")
    for key, value in scene.schedules().items():
        if isinstance(value, Profile):
            raise RequestError(f"{key}: it changes over time here; give it one value, as by --set {key}=...")
    may_not_rest(variation)
    check_shapes_stay(scene, variation.key)
    # Structure hangs on the larger end: a long arc has more nodes, a force that vanishes is none.
    largest = max(variation.values, key=abs)
    whole = scene.with_values({variation.key: largest})
    coordinates = linear_coordinates(whole)

    def linear_at(value: float) -> Model:
        return build_model(whole, {variation.key: value}, coordinates)

    def model_at(value: float) -> Model:
        return build_model(whole, {variation.key: value})

    family = Family(model_at, model_at(largest).names, linear_at(largest).names)
    how = IntegratorOptions(scene.simulate.sample_rate, scene.simulate.tolerance, solver=scene.simulate.solver)
    return _predict(scene, variation, family, linear_at, how, progress)


def _predict(
    scene: Scene | None,
    variation: Variation,
    family: Family,
    linear_at: ModelAt,
    how: IntegratorOptions,
    progress: Progress,
) -> LinearOnset:
    if len(set(variation.values)) < 2:
        raise RequestError(f"{variation.key}: give it a range of two values at least")
    linear = follow_modes(linear_at, _values_of(variation), progress)
    sound = [point for point in linear.points if not point.reason]
    if not sound:
        raise RequestError(f"{variation.key}: no steady sliding anywhere in the range: {linear.points[0].reason}")
    highest = max((mode.frequency_Hz for point in sound for mode in point.vibrations), default=0.0)
    if not how.sample_rate > 0 or how.sample_rate < 2 * highest:
        limit = f"twice the highest frequency, {highest:.5g} Hz"
        reason = f"this is below {limit}, which would be aliased; take at least {2 * highest:.5g} Hz"
        if scene is None:
            raise RequestError(f"sample_rate: {reason}")
        raise SceneError(reason, ("simulate", "sample_rate"), how.sample_rate)
    # Whole chunks of samples need no program of their own, but any number will do.
    asked = [point for point in sound if point.value in variation.values] or sound
    how = how._replace(round_seconds=round_seconds(asked, family.moving))
    return LinearOnset(scene, variation, family, linear_at, linear, how)


def _values_of(variation: Variation) -> list[float]:
    """The values at which the eigenvalues are looked at: those asked for, and between them as many as for cycles."""
    asked = np.unique(variation.values)
    grid, step = np.linspace(asked[0], asked[-1], VALUES, retstep=True)
    # 1e-3 of a step: no two values are looked at that are nearer to each other
    apart = np.abs(grid[:, None] - asked).min(axis=1) > 1e-3 * step
    return np.sort([*asked, *grid[apart]]).tolist()


def _started(points: Sequence[Point], asked: Collection[float]) -> Iterator[Point]:
    """Those asked for and, where they miss a stretch in which steady sliding is stable or not, one in its middle."""
    for (nowhere, _), stretch in groupby(points, key=lambda point: (bool(point.reason), point.unstable)):
        within = list(stretch)
        those = [point for point in within if point.value in asked]
        middle = (within[0].value + within[-1].value) / 2
        nearest = min(within, key=lambda point: abs(point.value - middle))
        yield from those or ([] if nowhere else [nearest])


def compare(
    predicted: LinearOnset,
    within: float,
    *,
    smallest_disturbance: bool = False,
    cycles: bool = False,
    progress: Progress = silent,
    keep: Keep = lambda _: None,
) -> Onset:
    """Run the transients that the prediction is compared with."""
    linear, scene = predicted.linear, predicted.scene
    begin = Onset if scene is None else partial(OnsetStudy, scene=scene)
    study = begin(
        outcome=Ending.CUT_OFF,
        parameter=Parameter.of(predicted.variation),
        critical_values=linear.critical,
        bistable_range_sought_within=within,
        smallest_disturbance_sought=smallest_disturbance,
        modes=tuple(FollowedMode.of(branch) for branch in linear.branches),
        coordinates=predicted.family.moving,
    )
    search = _Search(predicted, lambda rows: keep(study.model_copy(update={"values": tuple(rows)})), progress)
    search.from_disturbances()
    search.from_neighbours()
    values = predicted.variation.values
    precision = within * (max(values) - min(values))
    while smallest_disturbance and search.smallest_disturbances():
        search.from_neighbours()
    search.at_boundaries(precision)
    ranges = find_ranges(search.rows, linear.critical, precision, linear.points)
    study = study.model_copy(update={"outcome": Ending.COMPLETE, "values": tuple(search.rows), "ranges": ranges})
    study = study.model_copy(update={"verdict": verdict(study), "warnings": warnings(study)})
    if not cycles:
        return study
    keep(study)
    if scene is None:
        ends = predicted.variation.first, predicted.variation.last
        found = follow_cycles(predicted.family.model_at, ends, seeds=study.seeds, progress=progress)
    else:
        found = follow_cycles(scene, predicted.variation, seeds=study.seeds, progress=progress)
    study = study.model_copy(update={"cycles": found})
    return study.model_copy(update={"warnings": warnings(study)})


class _Search:
    """Rows by rising value, and the runs that fill them."""

    def __init__(self, predicted: LinearOnset, on_rows: Callable[[Sequence[Row]], None], progress: Progress) -> None:
        asked = set(predicted.variation.values)
        self._predicted, self._family, self._how = predicted, predicted.family, predicted.how
        self._on_rows, self._progress = on_rows, progress
        self._started = {point.value: point for point in _started(predicted.linear.points, asked)}
        self._rows = {value: Row.at(point, asked=value in asked) for value, point in self._started.items()}
        self._complete: set[float] = set()
        self._carried: set[tuple[float, float, bytes, float]] = set()  # from where to where, which motion and how large
        self._told: set[tuple[float, bytes]] = set()  # motions that were run on, to be told apart from others

    @property
    def rows(self) -> list[Row]:
        """All whose starts have ended, by rising value."""
        return [self._rows[value] for value in sorted(self._complete)]

    def from_disturbances(self) -> None:
        """A small perturbation, and disturbances along each mode in sizes by doublings, at every value.

        The largest of each mode come first: the others end as soon as they are on a motion that is known by then. Where
        steady sliding is unstable one within the contact boundaries is only another small perturbation.
        """
        self._complete |= {value for value, point in self._started.items() if point.reason}
        points = [point for point in self._started.values() if not point.reason]
        for k in range(0, len(points), 8):  # values at once: what is done when a study is interrupted is whole ones
            first, rest = [], []
            for point in points[k : k + 8]:
                first.append((point, self._family.small_start(point, self._family.model_at(point.value))))
                for each in directions(point, self._family, signs=(1,)):
                    least = 1 / each.boundary_ratio if point.unstable else 0.0
                    *smaller, largest = each.sizes
                    first.append((point, each.start(largest)))
                    rest += [(point, each.start(size)) for size in smaller if size > least]
            self._run("transients", first, Criteria.persistent, more=Counter(point.value for point, _ in rest))
            self._run("transients", rest, Criteria.persistent)
        self._smaller_perturbations()
        self._tell_apart()

    def _smaller_perturbations(self) -> None:
        """Where steady sliding is stable and the small perturbation squeals, it was none: try smaller ones."""
        size = Criteria.small
        # 3 small perturbations by tenths: next to a subcritical Hopf point even a tenth may be too large
        for _ in range(3):
            large = [row for row in self.rows if not row.unstable and row.small is not None and row.small.motion]
            for row in large:
                starts = tuple(_named(each, size) if each.start == SMALL_START else each for each in row.starts)
                self._rows[row.value] = row.model_copy(update={"starts": starts})
            size /= 10
            points = [row.point for row in large]
            tasks = [(each, self._family.small_start(each, self._family.model_at(each.value), size)) for each in points]
            self._run("transients", tasks, Criteria.persistent)

    def from_neighbours(self) -> None:
        """Carry every motion that a neighbouring value lacks over to it, upwards and downwards as far as it lasts."""
        while True:
            tasks = []
            neighbours = [pair for a, b in pairwise(self.rows) for pair in ((a, b), (b, a))]
            for there, here in neighbours:
                sizes = SIZES if here.kind in (*QUIET, RangeKind.UNDECIDED) else SIZES[:1]
                lacking = () if here.kind is RangeKind.NOWHERE else unpaired(there.motions, here.motions)
                for source in lacking:
                    key = there.value, here.value, source.state.tobytes()
                    untried = [size for size in sizes if (*key, size) not in self._carried]
                    for size in untried[:1]:
                        self._carried.add((*key, size))
                        tasks.append((here.point, go_on(there.value, source, size)))
            if not tasks:
                return
            self._run("from neighbours", tasks, Criteria.persistent)
            self._tell_apart()

    def at_boundaries(self, precision: float) -> None:
        """Find to this precision where squeal ends without a critical value of the eigenvalues."""
        for a, b in list(pairwise(self.rows)):
            if RangeKind.SQUEALS in (a.kind, b.kind) and (a.kind in QUIET or b.kind in QUIET):
                self._look_next_to_critical(a, b, precision)
        while ends := self._ends():
            if not self._run_on("ends of a bistable range", [(a, motion) for a, _ in ends for motion in a.motions]):
                break
        for a, b in ends:
            self._close_in(a, b, precision)

    def _ends(self) -> list[tuple[Row, Row]]:
        """Neighbours of which the first is bistable and the other one, as far as is known, does not squeal."""
        pairs = [pair for a, b in pairwise(self.rows) for pair in ((a, b), (b, a))]
        return [(a, b) for a, b in pairs if a.kind is RangeKind.BISTABLE and b.kind in (*QUIET, RangeKind.UNDECIDED)]

    def smallest_disturbances(self) -> bool:
        """How large a disturbance must be for each motion, at each bistable value that was asked for.

        Returns whether that led to motions that were not known there.
        """
        rows = [row for row in self.rows if row.asked and row.kind is RangeKind.BISTABLE]
        known = sum(len(row.motions) for row in rows)
        for found in smallest_disturbances(self._family, rows, self._how, self._progress):
            self._rows |= {row.value: row for row in found}
            self._on_rows(self.rows)
        return sum(len(self._rows[row.value].motions) for row in rows) > known

    def _look_next_to_critical(self, a: Row, b: Row, precision: float) -> None:
        """Look right next to a critical value whether squeal goes on into the stable side."""
        squeals, stable = (a, b) if a.kind is RangeKind.SQUEALS else (b, a)
        between = [each.value for each in self._predicted.linear.critical if a.value <= each.value <= b.value]
        if squeals.strongest is None or not between:
            return
        side = np.sign(stable.value - squeals.value)
        value = (max if side > 0 else min)(between) + side * precision
        if side * (stable.value - value) > 0:
            self._try([float(value)], squeals)

    def _close_in(self, a: Row, b: Row, precision: float) -> None:
        """Narrow down where between a bistable row `a` and another one `b` squeal ends, as far as that can be seen."""
        while abs(b.value - a.value) > precision and a.strongest is not None:
            values = [float(a.value + part / 3 * (b.value - a.value)) for part in (1, 2)]
            tried = self._try(values, a)
            bistable = [row for row in tried if row.kind is RangeKind.BISTABLE]
            b = next((row for row in tried if row.kind is not RangeKind.BISTABLE), b)
            lasts = [row for row in bistable if abs(row.value - a.value) < abs(b.value - a.value)]
            a = lasts[-1] if lasts else a
            if b.kind is RangeKind.UNDECIDED:
                return

    def _try(self, values: Sequence[float], source: Row) -> list[Row]:
        """Look whether a motion of a row lasts at other values, the strongest first and in several sizes each."""
        points = [point_at(self._predicted.linear_at, value) for value in values]
        for point in points:
            self._rows.setdefault(point.value, Row.at(point, asked=False))
        for motion, size in product(source.motions, SIZES):
            # Larger ones come down to where one that went on so long is.
            left = [
                point
                for point in points
                if self._rows[point.value].kind not in (RangeKind.BISTABLE, RangeKind.UNDECIDED)
            ]
            start = go_on(source.value, motion, size)
            self._run("boundaries", [(point, start) for point in left], Criteria.lasting)
        return [self._rows[value] for value in values]

    def _tell_apart(self) -> None:
        """Run motions on that are nearly alike at one value: some may only be on the way to the others."""
        rows = [(row, row.motions) for row in self.rows]  # which are found anew each time
        alike = [(row, a) for row, motions in rows for a in motions if any(a is not b and a.like(b) for b in motions)]
        self._run_on("telling motions apart", alike)

    def _run_on(self, what: str, motions: Sequence[tuple[Row, SteadyResponse]]) -> bool:
        """Run motions of rows on that were not yet, and return whether there were any."""
        tasks, meant = [], {}
        for k, (row, motion) in enumerate(motions):
            if (row.value, motion.state.tobytes()) not in self._told:
                start = Start(f"{k}: {motion.start}", *motion.state)
                tasks.append((row.point, start))
                meant[row.value, start.name] = motion

        progress = named(self._progress, what)
        for response in find_attractors(self._family, tasks, self._how, rounds=Criteria.lasting, progress=progress):
            row, before = self._rows[response.value], meant[response.value, response.start]
            starts = tuple(
                _ended(each, response) if each.motion is not None and each.motion.same(before) else each
                for each in row.starts
            )
            if response.motion is not None:
                self._told.add((row.value, response.motion.state.tobytes()))
            self._rows[response.value] = row.model_copy(update={"starts": starts})
        return bool(tasks)

    def _run(
        self, what: str, tasks: list[tuple[Point, Start]], rounds: int, more: Mapping[float, int] | None = None
    ) -> None:
        """Run starts; a value is complete where there are no `more`."""
        left, progress = Counter(more) + Counter(point.value for point, _ in tasks), named(self._progress, what)
        known = {point.value: self._rows[point.value].motions for point, _ in tasks}
        for response in find_attractors(self._family, tasks, self._how, rounds=rounds, known=known, progress=progress):
            row = self._rows[response.value]
            self._rows[response.value] = row.model_copy(update={"starts": (*row.starts, response)})
            left[response.value] -= 1
            if left[response.value] == 0:
                self._complete.add(response.value)
                self._on_rows(self.rows)


def _named(response: Response, size: float) -> Response:
    """The response to what was to be a small perturbation, of this fraction of the nearer contact boundary."""
    start = f"{size:g} of the contact boundary"
    motion = response.motion and response.motion.model_copy(update={"start": start})
    return response.model_copy(update={"start": start, "motion": motion})


def _ended(response: Response, later: Response) -> Response:
    """A response whose motion went on, and where that led."""
    motion = later.motion and later.motion.model_copy(update={"start": response.start})
    seconds = response.simulated_s + later.simulated_s
    update = {"leads_to": later.leads_to, "outcome": later.outcome, "motion": motion, "simulated_s": seconds}
    return response.model_copy(update=update)
