"""Linear against nonlinear onset along a parameter: where eigenvalues say squeal, and where a kick is enough for it."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from drumsqueal.errors import RequestError
from drumsqueal.interrupts import noted_interrupts, stop_if_interrupted
from drumsqueal.physics.composition import linear_coordinates
from drumsqueal.physics.model import build_model
from drumsqueal.questions.onset.attractors import (
    LASTING,
    PERSISTENT,
    Ending,
    Family,
    How,
    Start,
    find_endings,
    round_seconds,
)
from drumsqueal.questions.onset.kick import smallest_kicks
from drumsqueal.questions.onset.rows import KICKED, NOWHERE, QUIET, SQUEALS, UNKNOWN, Range, Row, find_ranges
from drumsqueal.scene import Profile, Scene, SceneError
from drumsqueal.scene.variation import Variation, may_not_rest, read_variation
from drumsqueal.solve.linear.branches import Branches, ModelAt, Point, follow_modes, point_at

WITHIN = 1e-3  # of the range: how well the boundaries of the kicked range are found
SECTIONS = 2  # values tried at once between two
# Multiples of a neighbour's motion: where motion that is too small dies away the lasting one may be larger there.
SIZES = (1.0, 1.2, 1.5)


class OnsetStudy(NamedTuple):
    """Modes and critical values along a parameter, a row for each value, and the ranges that follow from them.

    `names` are the coordinates of the transients; `within` the share of the range to which ends of the kicked range
    were sought; `smallest_kick` whether the smallest kick was at each value at which a kick is enough.
    """

    scene: Scene
    variation: Variation
    names: tuple[str, ...]
    linear: Branches
    rows: tuple[Row, ...]
    ranges: tuple[Range, ...]
    within: float
    smallest_kick: bool = False

    @property
    def coordinate(self) -> str:
        """The coordinate that holds most kinetic energy in most of the motions found: whose amplitude is shown."""
        lines = [each.motion.line for row in self.rows for each in row.attractors if each.motion.line is not None]
        shown = [branch.label.split()[0] for branch in self.linear.branches]
        critical = [each.label.split()[0] for each in self.linear.critical]
        candidates = [name for name in (*lines, *critical[:1], *shown) if name in self.names]
        return max(candidates, key=lines.count, default=self.names[0])


class Prediction(NamedTuple):
    """The linear half of a study: what transients are then compared with."""

    scene: Scene
    variation: Variation
    family: Family
    linear_at: ModelAt
    linear: Branches
    how: How


OnRow = Callable[[Sequence[Row]], None]  # all rows so far, by rising value
OnProgress = Callable[[str, int, int], None]  # what is done, how much of it, of how much


def study_onset(
    scene: Scene,
    along: str | Variation,
    *,
    within: float = WITHIN,
    smallest_kick: bool = False,
    on_row: OnRow | None = None,
    on_progress: OnProgress | None = None,
) -> OnsetStudy:
    """Compare linear with nonlinear onset along a parameter: `study_onset(scene, "drum.speed=1..40").ranges`.

    `along` is "KEY=FROM..TOxN" or a `Variation`. Critical values are roots of Re λ. At each value transients start from
    a small departure and from a large one along each mode; where none of them lasts though a neighbour's does, it goes
    on from the neighbour's state, upwards and downwards. Ends of the kicked range are then sought `within` that share
    of the whole range and, on demand, the smallest kick that leads to squeal at each value where one is enough.
    `on_row` is called with the rows as they come. Raises SceneError and RequestError for what cannot be studied,
    ValueError for a share that is none, and KeyboardInterrupt between two chunks.
    """
    if not 0 < within < 1:
        raise ValueError(f"the share must be between 0 and 1, got {within}")
    variation = read_variation(along, scene, option="along") if isinstance(along, str) else along
    with noted_interrupts():
        predicted = predict(scene, variation)
        told = on_row or (lambda _: None), on_progress or (lambda *_: None)
        return compare(predicted, within, *told, smallest_kick=smallest_kick)


def predict(scene: Scene, variation: Variation) -> Prediction:
    """Follow the modes and find the critical values. Raises SceneError and RequestError for what cannot be studied."""
    _check(scene, variation)
    # Structure hangs on the larger end: a long arc has more nodes, a force that vanishes is none.
    largest = max(variation.values, key=abs)
    whole = scene.with_values({variation.key: largest})
    coordinates = linear_coordinates(whole)

    def linear_at(value: float):
        return build_model(whole, {variation.key: value}, coordinates)

    def model_at(value: float):
        return build_model(whole, {variation.key: value})

    linear = follow_modes(linear_at, variation.values)
    sound = [point for point in linear.points if not point.reason]
    if not sound:
        raise SceneError(f"nowhere in the range is there steady sliding: {linear.points[0].reason}", (variation.key,))
    highest = max((mode.frequency_Hz for point in sound for mode in point.modes), default=0.0)
    rate = scene.simulate.sample_rate
    if rate < 2 * highest:
        reason = f"this is below twice the highest frequency, {highest:.5g} Hz, which would fold; take at least"
        raise SceneError(f"{reason} {2 * highest:.5g} Hz", ("simulate", "sample_rate"), rate)
    moving = model_at(largest).names
    family = Family(model_at, moving, linear_at(largest).names)
    # Whole chunks of samples need no program of their own, but any number will do.
    how = How(rate, scene.simulate.tolerance, round_seconds(sound, moving), scene.simulate.solver)
    return Prediction(scene, variation, family, linear_at, linear, how)


def _check(scene: Scene, variation: Variation) -> None:
    if scene.friction is None:
        raise RequestError("friction: this scene has none, so nothing in it can squeal; add the table")
    if scene.forcing is not None:
        raise RequestError("forcing: a harmonic force leaves no steady sliding to lose; add --set forcing=none")
    for key, value in (("drum.speed", scene.drum.speed), ("contact.normal_load", scene.contact.normal_load)):
        if isinstance(value, Profile):
            raise RequestError(f"{key}: it changes over time here; give it one value, as by --set {key}=...")
    may_not_rest(variation)
    if len(set(variation.values)) < 2:
        raise RequestError(f"{variation.key}: give it a range of two values at least")


def compare(
    predicted: Prediction, within: float, on_row: OnRow, on_progress: OnProgress, *, smallest_kick: bool = False
) -> OnsetStudy:
    """Run the transients that the prediction is compared with."""
    search = _Search(predicted, on_row, on_progress)
    search.from_both_sizes()
    search.from_neighbours()
    search.at_boundaries(within)
    if smallest_kick:
        search.smallest_kicks()
    ranges = find_ranges(search.rows, predicted.linear.critical, search.resolved(within))
    scene, variation, linear = predicted.scene, predicted.variation, predicted.linear
    moving, rows = predicted.family.moving, tuple(search.rows)
    return OnsetStudy(scene, variation, moving, linear, rows, ranges, within, smallest_kick)


class _Search:
    """Rows by rising value, and the runs that fill them."""

    def __init__(self, predicted: Prediction, on_row: OnRow, on_progress: OnProgress) -> None:
        asked = set(predicted.variation.values)
        self._predicted, self._family, self._how = predicted, predicted.family, predicted.how
        self._on_row, self._on_progress = on_row, on_progress
        self._started = {point.value: point for point in predicted.linear.points if point.value in asked}
        self._rows = {v: Row(point, (), asked=True) for v, point in self._started.items()}
        self._complete: set[float] = set()

    @property
    def rows(self) -> list[Row]:
        """All whose starts have ended, by rising value."""
        return [self._rows[value] for value in sorted(self._complete)]

    def from_both_sizes(self) -> None:
        """A small departure, and a large one along each mode, at every value."""
        tasks = []
        for value, point in self._started.items():
            if point.reason:
                self._complete.add(value)
                continue
            model = self._family.model_at(value)
            starts = [self._family.small_start(point, model), *self._family.kicks(point, model)]
            tasks += [(point, start) for start in starts]
        self._run("transients", tasks, PERSISTENT)

    def from_neighbours(self) -> None:
        """Carry every motion that a neighbouring value lacks over to it, upwards and downwards as far as it lasts."""
        tried: set[tuple[float, float, int, float]] = set()
        while True:
            tasks = []
            for a, b in pairwise(self.rows):
                for there, here in ((a, b), (b, a)):
                    sizes = SIZES if here.kind in (*QUIET, UNKNOWN) else SIZES[:1]
                    for k, source in enumerate(there.attractors):
                        if here.kind == NOWHERE or any(source.like(known) for known in here.attractors):
                            continue
                        untried = [size for size in sizes if (there.value, here.value, k, size) not in tried]
                        for size in untried[:1]:
                            tried.add((there.value, here.value, k, size))
                            tasks.append((here.point, source.again(size)))
            if not tasks:
                return
            self._run("from neighbours", tasks, PERSISTENT)

    def resolved(self, within: float) -> float:
        """How far apart values are told apart at a boundary, of a share of the whole range."""
        return within * (self.rows[-1].value - self.rows[0].value)

    def at_boundaries(self, within: float) -> None:
        """Close in on where motion ceases to last without the eigenvalues saying so."""
        precision = self.resolved(within)
        for a, b in list(pairwise(self.rows)):
            if SQUEALS in (a.kind, b.kind) and (a.kind in QUIET or b.kind in QUIET):
                self._beside(a, b, precision)
        for a, b in list(pairwise(self.rows)):
            if KICKED not in (a.kind, b.kind) or (a.kind not in QUIET and b.kind not in QUIET):
                continue
            self._close_in(*((a, b) if a.kind == KICKED else (b, a)), precision)

    def smallest_kicks(self) -> None:
        """How hard a kick must be, at each value that was asked for and where one is enough."""
        rows = [row for row in self.rows if row.asked and row.kind == KICKED]
        for found in smallest_kicks(self._family, rows, self._how, self._on_progress):
            for value, kick in found.items():
                self._rows[value] = self._rows[value]._replace(kick=kick)
            self._on_row(self.rows)

    def _beside(self, a: Row, b: Row, precision: float) -> None:
        """Look right beside a critical value whether squeal goes on into the stable side."""
        squeals, stable = (a, b) if a.kind == SQUEALS else (b, a)
        source = squeals.strongest
        between = [each.value for each in self._predicted.linear.critical if a.value <= each.value <= b.value]
        if source is None or not between:
            return
        side = np.sign(stable.value - squeals.value)
        value = (max if side > 0 else min)(between) + side * precision
        if side * (stable.value - value) > 0:
            self._try([float(value)], source)

    def _close_in(self, lasting: Row, dying: Row, precision: float) -> None:
        a, b = lasting, dying
        while abs(b.value - a.value) > precision and a.strongest is not None:
            shares = np.arange(1, SECTIONS + 1) / (SECTIONS + 1)
            values = [float(a.value + share * (b.value - a.value)) for share in shares]
            tried = self._try(values, a.strongest)
            b = next((row for row in tried if row.kind != KICKED), b)
            lasts = [row for row in tried if row.kind == KICKED and abs(row.value - a.value) < abs(b.value - a.value)]
            a = lasts[-1] if lasts else a

    def _try(self, values: Sequence[float], source: Ending) -> list[Row]:
        """Look whether a motion lasts at other values, in several sizes until one does."""
        points = [point_at(self._predicted.linear_at, value) for value in values]
        for point in points:
            self._rows.setdefault(point.value, Row(point, (), asked=False))
        for size in SIZES:
            left = [point for point in points if self._rows[point.value].strongest is None]
            self._run("boundaries", [(point, source.again(size)) for point in left], LASTING)
        return [self._rows[value] for value in values]

    def _run(self, what: str, tasks: list[tuple[Point, Start]], rounds: int) -> None:
        left = {point.value: 0 for point, _ in tasks}
        for point, _ in tasks:
            left[point.value] += 1
        self._on_progress(what, 0, len(tasks))
        for done, ending in enumerate(find_endings(self._family, tasks, self._how, rounds=rounds), start=1):
            stop_if_interrupted()
            row = self._rows[ending.value]
            self._rows[ending.value] = row._replace(endings=(*row.endings, ending))
            left[ending.value] -= 1
            if left[ending.value] == 0:
                self._complete.add(ending.value)
                self._on_row(self.rows)
            self._on_progress(what, done, len(tasks))
