"""Modes along a parameter: followed by their shapes, not by their order, and the values at which one turns unstable."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from drumsqueal.errors import SteadyStateError
from drumsqueal.physics.model import Model
from drumsqueal.progress import Progress, silent
from drumsqueal.solve.linear.modes import (
    CLEAR,
    DRIFT_FRACTION,
    UNDAMPED_FRACTION,
    Mode,
    Stability,
    growing_without_oscillation,
    labels_of,
    matched,
    overlaps,
    solve_modes,
    vibrations_of,
    while_sliding,
    without_oscillation,
)
from drumsqueal.solve.linear.steady import linear_model, no_steady_sliding

# Two modes at neighbouring values are one where their shapes overlap so much; where they do not, the step is halved.
CLOSE, LINKED = 0.9, 0.5

HALVINGS = 10  # of a step at most: closer than that a merging of two modes looks like a jump
DIVERGENCE = "divergence"

ModelAt = Callable[[float], Model]


class Point(NamedTuple):
    """Steady sliding at one value: q* (n,), its modes and state matrix; where there is none, `reason` says why.

    `vibrations` are those of `Stability`.
    """

    value: float
    steady: NDArray[np.float64] = np.empty(0)
    modes: tuple[Mode, ...] = ()
    eigenvalues: NDArray[np.complex128] = np.empty(0, complex)
    reason: str = ""
    matrix: NDArray[np.float64] = np.empty((0, 0))
    vibrations: tuple[Mode, ...] = ()

    @property
    def divergence(self) -> float | None:
        """Largest real eigenvalue that grows without oscillation (1/s), None where there is none."""
        return growing_without_oscillation(self.eigenvalues)

    @property
    def largest(self) -> float:
        """Largest modulus of an eigenvalue (1/s)."""
        return float(np.max(np.abs(self.eigenvalues), initial=0.0))

    @property
    def unstable(self) -> bool:
        """Whether anything grows."""
        return self.divergence is not None or any(mode.unstable for mode in self.modes)

    @property
    def neutral(self) -> bool:
        """Whether nothing grows, and something neither grows nor decays but for round-off."""
        return not self.unstable and self.growth_rate >= -UNDAMPED_FRACTION * self.largest

    @property
    def growth_rate(self) -> float:
        """The largest Re λ (1/s) of what oscillates or grows; NaN where there is nothing."""
        return max([*(mode.growth_rate for mode in self.modes), *filter(None, [self.divergence])], default=np.nan)


class Branch(NamedTuple):
    """One mode over the values (k,) at which it oscillates, None where there is no steady sliding in between.

    It has its name at the first of them.
    """

    label: str
    values: NDArray[np.float64]
    modes: tuple[Mode | None, ...]

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Its eigenvalues (k,) in 1/s, NaN where there is no steady sliding."""
        return np.array([complex(np.nan, np.nan) if mode is None else mode.eigenvalue for mode in self.modes])


@dataclass(frozen=True, order=True)
class Critical:
    """A value at which Re λ of a mode is zero; `destabilises` where it grows at values above.

    `uncertainty` is that of the value, in its own unit. A divergence has no frequency.
    """

    value: float
    uncertainty: float
    label: str
    frequency_Hz: float
    destabilises: bool


class Branches(NamedTuple):
    """Points by rising value, more than were asked for where modes change fast; the modes; the critical values."""

    points: tuple[Point, ...]
    branches: tuple[Branch, ...]
    critical: tuple[Critical, ...]


def follow_modes(model_at: ModelAt, values: ArrayLike, progress: Progress = silent) -> Branches:
    """Follow all modes over the values and find where Re λ = 0, on the eigenvalue itself.

    The models are of one composition. Two modes are the same where √|l_iᴴ r_j · l_jᴴ r_i| is near 1, with left and
    right eigenvectors scaled to lᴴ r = 1; steps are halved until it is. Crossings are roots, to 1e-12 of the range, of
    the k-th largest real part of all eigenvalues, which is continuous whatever the modes do. What a mode does twice
    between two values goes unseen unless it is the least stable one's.
    """
    points: list[Point] = []
    ordered = np.sort(np.asarray(values, dtype=np.float64)).tolist()
    for value in ordered:
        progress("eigenvalues", len(points), len(ordered))
        points.append(point_at(model_at, value))
    width = points[-1].value - points[0].value
    points = _with_turns(model_at, points)
    fine = points[:1]
    for point in points[1:]:
        fine += [*_between(partial(point_at, model_at), fine[-1], point, HALVINGS), point]
    # Critical values are found to 1e-12 of the range.
    critical = [each for pair in pairwise(fine) for each in _critical(model_at, *pair, 1e-12 * width)]
    # One at least between any two critical values, to decide whether anything grows there.
    for a, b in pairwise(sorted(each.value for each in critical)):
        if a < b and not any(a < each.value < b for each in fine):
            fine.append(point_at(model_at, (a + b) / 2))
    fine.sort(key=lambda point: point.value)
    branches, labels = _branches(fine)
    named = [replace(each, label=_label(model_at, each, fine, labels)) for each in critical]
    return Branches(tuple(fine), branches, tuple(sorted(named)))


def point_at(model_at: ModelAt, value: float) -> Point:
    """Steady sliding and its modes at one value."""
    try:
        model, _ = while_sliding(model_at(value))
    except SteadyStateError as error:
        return Point(value, reason=str(error))
    steady, linear = linear_model(model)
    matrix = linear.state_matrix()
    if not np.all(np.isfinite(steady)):
        return Point(value, reason=str(no_steady_sliding(model)))
    if not np.all(np.isfinite(matrix)):
        return Point(value, reason="the linear model is not finite")
    solved = eigenvalues, modes = solve_modes(model.names, linear.mass, matrix)
    vibrations = vibrations_of(model.names, linear.mass, matrix, solved)
    return Point(value, steady, modes, eigenvalues, matrix=matrix, vibrations=vibrations)


def _links(a: Point | Stability, b: Point | Stability) -> tuple[dict[int, int], float]:
    """Which mode at a value is which at another, and the smallest overlap of any; 0 where some are left over."""
    overlap = overlaps(a.modes, b.modes)
    pairs = matched(overlap)
    links = {i: j for i, j in pairs.items() if overlap[i, j] >= LINKED}
    if len(links) < max(len(a.modes), len(b.modes)):
        return links, 0.0
    return links, float(min((overlap[pair] for pair in pairs.items()), default=1.0))


def continued(model_at: ModelAt, start: Stability, end: Stability) -> list[int]:
    """For each mode of `end` the number of that of `start` which it continues by its shape, -1 where it is none.

    `model_at` has the models of these at 0 and at 1. Where two shapes have little in common or have changed places, two
    modes may have crossed, or each turned into the shape of the other: they are followed on the way there.
    """
    links, overlap = _links(start, end)[0], overlaps(start.modes, end.modes)
    in_order = sorted(links.values()) == [links[i] for i in sorted(links)]
    if in_order and len(links) == min(overlap.shape) and all(overlap[pair] > CLEAR for pair in links.items()):
        before = {j: i for i, j in links.items()}
        return [before.get(j, -1) for j in range(len(end.modes))]
    first, last = (
        Point(value, each.steady_state, each.modes, each.eigenvalues, matrix=each.matrix)
        for value, each in ((0.0, start), (1.0, end))
    )
    labels = _branches(_on_the_way(model_at, first, last, start.coordinates, start.mass, HALVINGS))[1]
    return [labels[0].index(label) if label in labels[0] else -1 for label in labels[-1]]


def _on_the_way(
    model_at: ModelAt, a: Point, b: Point, names: tuple[str, ...], mass: NDArray[np.float64], halvings: int
) -> list[Point]:
    """Points from one to another, both among them, each close to the next; of few models, which are what is dear.

    Where the state matrix halfway has the modes of the mean of the two at the ends, those between are taken for means,
    too. `mass` (n,) only names the modes.
    """

    def mean(value: float) -> Point:
        part = (value - a.value) / (b.value - a.value)
        eigenvalues, modes = solve_modes(names, mass, (1 - part) * a.matrix + part * b.matrix)
        return Point(value, a.steady, modes, eigenvalues)

    middle = point_at(model_at, (a.value + b.value) / 2)
    if middle.reason or halvings == 0 or _links(middle, mean(middle.value))[1] >= CLOSE:
        halves = [_between(mean, *pair, HALVINGS) for pair in ((a, middle), (middle, b))]
        return [a, *halves[0], middle, *halves[1], b]
    before, after = (
        _on_the_way(model_at, *pair, names=names, mass=mass, halvings=halvings - 1)
        for pair in ((a, middle), (middle, b))
    )
    return [*before, *after[1:]]


def _between(point: Callable[[float], Point], a: Point, b: Point, halvings: int) -> list[Point]:
    """Points between two so that each is close to the next."""
    if a.reason or b.reason or halvings == 0 or _links(a, b)[1] >= CLOSE:
        return []
    middle = point((a.value + b.value) / 2)
    before, after = _between(point, a, middle, halvings - 1), _between(point, middle, b, halvings - 1)
    return [*before, middle, *after]


def _branches(points: list[Point]) -> tuple[tuple[Branch, ...], list[list[str]]]:
    """The modes over the points, and the label of each mode of each point.

    A mode goes on beyond a value without steady sliding, and is None there.
    """
    names: list[str] = []
    along: list[list[tuple[float, Mode | None]]] = []
    found: list[list[int]] = []
    before: tuple[Point, list[int]] | None = None
    for point in points:
        linked: dict[int, int] = {}
        if before is not None:
            linked = {j: before[1][i] for i, j in _links(before[0], point)[0].items()}
        for j, mode in enumerate(point.modes):
            if j not in linked:
                linked[j] = len(names)
                names.append(mode.name)
                along.append([])
            along[linked[j]].append((point.value, mode))
        found.append([linked[j] for j in range(len(point.modes))])
        if not point.reason:
            before = point, found[-1]
        elif before is not None:
            for i in before[1]:
                along[i].append((point.value, None))
    labels = labels_of(names)
    branches = (
        Branch(label, np.array([value for value, _ in each]), tuple(mode for _, mode in each))
        for label, each in zip(labels, along, strict=True)
    )
    return tuple(branches), [[labels[i] for i in row] for row in found]


def _with_turns(model_at: ModelAt, points: list[Point]) -> list[Point]:
    """The points, and where the largest real part between two of them turns round on the other side of zero."""
    found = list(points)
    for a, b, c in zip(points, points[1:], points[2:], strict=False):
        rates = np.array([each.growth_rate for each in (a, b, c)])
        if a.reason or b.reason or c.reason or np.ptp(np.sign(rates)) != 0:
            continue
        sign = np.sign(rates[1])  # a minimum is looked for where all three grow
        if not (sign * rates[1] <= sign * rates[0] and sign * rates[1] <= sign * rates[2]):
            continue
        bends = np.polyfit(np.array([a.value, b.value, c.value]) - b.value, rates, 2)
        if bends[0] == 0 or sign * (bends[2] - bends[1] ** 2 / (4 * bends[0])) > 0.5 * sign * rates[1]:
            continue

        def height(value: float, sign: float = sign) -> float:
            return sign * point_at(model_at, value).growth_rate

        lowest: Any = scipy.optimize.minimize_scalar(height, bounds=(a.value, c.value), method="bounded")
        turn = point_at(model_at, float(lowest.x))
        if sign * turn.growth_rate < 0:
            found.append(turn)
    return sorted(found, key=lambda point: point.value)


def _critical(model_at: ModelAt, a: Point, b: Point, precision: float) -> list[Critical]:
    """All values between two points at which a mode, or a divergence, sets in or ends; without the mode's label."""
    if a.reason or b.reason:
        return []
    ranks, swapped = range(len(a.eigenvalues) // 2), _swapped(a, b)
    roots = [] if swapped else [_root(model_at, a, b, rank, precision) for rank in ranks]
    found = [each for each in roots if each is not None]
    # Without them something else happens as well: a mode turns into a divergence, or one hides the other in the order.
    before, after = (sum(mode.unstable for mode in point.modes) for point in (a, b))
    if swapped or sum(1 if each.destabilises else -1 for each in found) != after - before:
        middle = (a.value + b.value) / 2
        if b.value - a.value > precision and a.value < middle < b.value:
            between = point_at(model_at, middle)
            return [*_critical(model_at, a, between, precision), *_critical(model_at, between, b, precision)]
        found = _jumps(a, b)
    if (a.divergence is None) != (b.divergence is None):
        found.append(_divergence(model_at, a, b, precision))
    return found


def _jumps(a: Point, b: Point) -> list[Critical]:
    """What sets in or ends at once between two points next to each other; none where modes go over into divergences."""
    links = _links(a, b)[0]
    before, after = ({k for k, mode in enumerate(point.modes) if mode.unstable} for point in (a, b))
    ends = [(a.modes[i], False) for i in before if links.get(i) not in after]
    begins = [(b.modes[j], True) for j in after if j not in {links.get(i) for i in before}]
    if np.sum(_ranked(a).real > 0) == np.sum(_ranked(b).real > 0) and not (ends and begins):
        return []
    value, width = (a.value + b.value) / 2, b.value - a.value
    return [Critical(value, width, "", mode.frequency_Hz, way) for mode, way in (*ends, *begins)]


def _root(model_at: ModelAt, a: Point, b: Point, rank: int, precision: float) -> Critical | None:
    """The value at which the real part number `rank` is zero, without a label; None where its sign does not change."""
    before, after = _rate(a, rank), _rate(b, rank)
    round_off = 16 * np.finfo(np.float64).eps  # of the largest eigenvalue
    noise = [UNDAMPED_FRACTION * max(a.largest, b.largest), round_off * max(a.largest, b.largest)]
    # Without damping a real part is round-off until two modes merge: only what stands out of it counts as growth.
    least = noise[0] if min(abs(before), abs(after)) < noise[0] else 0.0
    if (before > least) == (after > least):
        return None
    value, _ = scipy.optimize.brentq(
        lambda value: _rate(point_at(model_at, value), rank) - least,
        a.value,
        b.value,
        xtol=precision,
        rtol=round_off,
        full_output=True,
    )
    # Next to it on the side where it grows: that may be a divergence.
    width = 2 * (precision + round_off * abs(value))
    beside = point_at(model_at, float(np.clip(value + width * np.sign(after - before), a.value, b.value)))
    frequency = abs(_ranked(beside)[2 * rank].imag) / (2 * np.pi)
    modes = point_at(model_at, value).modes or beside.modes
    if frequency == 0 or not modes:
        return None
    marginal = min(modes, key=lambda mode: abs(mode.frequency_Hz - frequency))
    # Where growth had to stand out of the round-off first, zero may lie that much before.
    uncertainty = max(precision, float((least + noise[1]) / (abs(after - before) / (b.value - a.value))))
    return Critical(float(value), uncertainty, "", marginal.frequency_Hz, after > before)


def _rate(point: Point, rank: int) -> float:
    """The real part number 2 `rank`, from 0 and from above: where a mode's changes its sign two do, and one is even."""
    return float(_ranked(point)[2 * rank].real)


def _ranked(point: Point) -> NDArray[np.complex128]:
    """Eigenvalues (2n,) by falling real part: two of each mode, those that do not oscillate, and then far below zero.

    What is zero to round-off, as of what drifts freely, is taken just below zero, and modes that are mostly shapes in
    which a body yields are left out as in the modes.
    """
    real = without_oscillation(point.eigenvalues)
    drift = DRIFT_FRACTION * point.largest
    modes = np.repeat([mode.eigenvalue for mode in point.modes], 2)
    found = np.concatenate([modes, np.where(np.abs(real) <= drift, -drift, real)])
    missing = np.full(max(len(point.eigenvalues) - len(found), 0), -point.largest)
    found = np.concatenate([found, missing]).astype(np.complex128)
    return found[np.argsort(-np.real(found), kind="stable")]


def _swapped(a: Point, b: Point) -> bool:
    """Whether something sets in and something else ends between two points, so that their number shows neither."""
    changes = [b.modes[j].unstable - a.modes[i].unstable for i, j in _links(a, b)[0].items()]
    changes.append((b.divergence is not None) - (a.divergence is not None))
    return 1 in changes and -1 in changes


def _divergence(model_at: ModelAt, a: Point, b: Point, precision: float) -> Critical:
    low, high = a.value, b.value
    while high - low > precision:
        middle = (low + high) / 2
        if middle in (low, high):
            break
        same = (point_at(model_at, middle).divergence is None) == (a.divergence is None)
        low, high = (middle, high) if same else (low, middle)
    return Critical((low + high) / 2, high - low, DIVERGENCE, 0.0, a.divergence is None)


def _label(model_at: ModelAt, critical: Critical, points: list[Point], labels: list[list[str]]) -> str:
    """Whose critical value it is: the branch that has the shape of the mode with that frequency there."""
    if critical.label:
        return critical.label
    sound = [k for k, point in enumerate(points) if not point.reason]
    nearest = min(sound, key=lambda k: abs(points[k].value - critical.value))
    point = point_at(model_at, critical.value)
    marginal = min(range(len(point.modes)), key=lambda k: abs(point.modes[k].frequency_Hz - critical.frequency_Hz))
    return labels[nearest][int(np.argmax(overlaps(point.modes, points[nearest].modes)[marginal]))]
