"""The smallest change of a brake that makes every mode decay: what may change, how far, and the search for it."""

import math
from collections.abc import Collection, Mapping, Sequence
from enum import StrEnum
from typing import Any, cast

import numpy as np
import scipy
from numpy.typing import NDArray
from pydantic import computed_field

from drumsqueal.errors import RequestError
from drumsqueal.findings.schema import Finding
from drumsqueal.physics.elasticity import check_shapes_stay, shaping_numbers
from drumsqueal.progress import Progress
from drumsqueal.scene import Scene, quantity_of
from drumsqueal.scene.quantities import Scheduled
from drumsqueal.scene.shoes import NamedShoe, key_alone
from drumsqueal.scene.variation import Written, likely_key
from drumsqueal.solve.linear.family import StateMatrix, eigenvalue_gradient
from drumsqueal.solve.linear.modes import DRIFT_FRACTION, eigensystem

DAMPING = "damping.ratio"
ZERO_SCALE = {DAMPING: 0.01}  # of a number that is zero: what it is measured in
LEAST = 0.1  # times its value: how far down a number may go, where physics has no nearer limit
TENTH = math.log(LEAST)


def size_of(key: str, before: float, after: float) -> float:
    """How far a number changes, and which way: ln(after/before), so that twice and half are equally far.

    Below a tenth of the number before it goes on along its tangent, to −3.3 for a number that becomes zero; of a number
    that was zero it is ln(1 + after/`ZERO_SCALE`).
    """
    if before == 0:
        return math.log1p(after / ZERO_SCALE[key])
    ratio = after / before
    return math.log(ratio) if ratio >= LEAST else TENTH - 1 + ratio / LEAST


def changed(key: str, before: float, size: float) -> tuple[float, float]:
    """The number that a change of this size makes of one, and its derivative with respect to the size."""
    if before == 0:
        return ZERO_SCALE[key] * math.expm1(size), ZERO_SCALE[key] * math.exp(size)
    if size < TENTH:
        return before * LEAST * (size - TENTH + 1), before * LEAST
    return before * math.exp(size), before * math.exp(size)


class Change(Finding):
    """One number before and after, in SI, and in the `unit` that it has in the scene file ("": SI)."""

    key: str
    before: float
    after: float
    unit: str = ""
    before_in_unit: float
    after_in_unit: float

    @classmethod
    def of(cls, written: Written, key: str, before: float, after: float) -> "Change":
        """That of a number of a scene as its file writes it."""
        shown = {"before_in_unit": written.shown(key, before), "after_in_unit": written.shown(key, after)}
        return cls(key=key, before=before, after=after, unit=written.unit(key), **shown)

    @computed_field
    @property
    def relative(self) -> float:
        """After over before, less 1; for a number that was zero, in units of its scale."""
        return (self.after - self.before) / (self.before or ZERO_SCALE[self.key])

    @computed_field
    @property
    def logarithm(self) -> float:
        """How far the number changes, ln(after/before), by which changes are ranked (`size_of`)."""
        return size_of(self.key, self.before, self.after)


class Caution(StrEnum):
    """What a changed brake is that the one before was not, though it may be quiet."""

    RISING = "friction then rises with the slip speed: its static coefficient lies below the kinetic one"
    WIDE = "the lining is then wider than the radius of the drum"


BELOW = {Caution.RISING: ("friction.static", "friction.kinetic"), Caution.WIDE: ("shoe.outer_radius", "shoe.width")}
"""Which of a shoe's numbers is then below which."""


def cautions(scene: Scene, changed: Mapping[str, float]) -> tuple[Caution, ...]:
    """What is to be said of a brake with changed numbers (SI)."""
    before, shoes = scene.numbers(), range(len(scene.shoes))

    def below(caution: Caution, shoe: int, numbers: Mapping[str, Any]) -> bool:
        small, large = (numbers.get(scene.key_of(shoe, key), math.nan) for key in BELOW[caution])
        return small < large

    after = {**before, **changed}
    return tuple(each for each in Caution if any(below(each, k, after) and not below(each, k, before) for k in shoes))


def rounded(written: Written, key: str, value: float, before: float, limits: tuple[float, float]) -> float:
    """A value (SI) as the scene file is to have it, rounded away from the one before, within its limits."""
    # Rounding may take a change further by 0.02 of it.
    outward = written.outward(key, value, before, 0.02)
    shown = float(outward.split()[0]) if isinstance(outward, str) else outward
    low, high = (written.shown(key, limit) for limit in limits)
    if not low <= shown <= high:
        # 1e-6 of a change: how much less far rounding may take it where further is out of bounds
        outward = written.outward(key, value, before, 1e-6, inward=True)
    return written.read(key, outward)


MARGIN = 1.0  # 1/s: every growth rate is to be at most minus this
SLACK = 1e-3  # of the margin that an optimum on its limit may miss
NOWHERE = 1e9  # 1/s; the growth rate where there is no steady sliding
THICKEST = 0.99  # of the geometric mean of thickness and outer radius
POSITION = "shoe.position"
# Of the vehicle, not of the design; keys as one shoe has them.
GIVEN = ("drum.speed", "contact.normal_load", "shoe.outer_radius", POSITION, "shoe.force.", "forcing.")


def numbers_of(scene: Scene) -> dict[str, float]:
    """The physical numbers of a scene without profiles that a model can follow, by key, in SI.

    Not those with which the modes of a shoe or a drum that bends change.
    """
    held = shaping_numbers(scene)
    return {key: value for key, value in scene.numbers().items() if isinstance(value, float) and key not in held}


def variable_numbers(
    scene: Scene, keys: Sequence[str] | None = None, held: Collection[str] = ()
) -> tuple[Scene, tuple[str, ...]]:
    """The numbers that may change, and the scene with a damping ratio if it is one.

    By default those of the design that are not `held`.
    Raises RequestError for a key that is none, is named twice, changes over time or is zero.
    """
    if keys is not None and DAMPING in keys and scene.damping is None:
        scene = scene.with_values({"damping": {"ratio": 0.0}})
    numbers = numbers_of(scene)
    if keys is None:
        design = (key for key, value in numbers.items() if value and key not in held)
        return scene, tuple(key for key in design if not key_alone(key).startswith(GIVEN))
    for k, key in enumerate(keys):
        if f"{key}.value" in scene.numbers():
            raise RequestError(f"--vary {key}: it changes over time; give it one value")
        check_shapes_stay(scene, key)
        if key in scene.numbers() and key not in numbers:
            raise RequestError(f"--vary {key}: it is a list, which is not varied; leave it out")
        if key not in numbers:
            raise RequestError(f"--vary {key}: not a number of this scene; {likely_key(key, list(numbers))}")
        if key in keys[:k]:
            raise RequestError(f"--vary {key}: named twice; leave one out")
        if key.startswith("forcing."):
            raise RequestError(f"--vary {key}: a harmonic force does not act on growth rates; leave it out")
        if key_alone(key) == POSITION:
            reason = "0 deg may be anywhere on the drum, so that an angle from it has no relative change"
            raise RequestError(f"--vary {key}: {reason}; leave it out, and compare places by drumsqueal sweep")
        if numbers[key] == 0 and key not in ZERO_SCALE:
            raise RequestError(f"--vary {key}: it is 0 and has no relative change; give it a value first")
    return scene, tuple(keys)


class Problem:
    """Growth rates as smooth functions of the sizes x (k,) of changes (`size_of`), remembered for the last x.

    Of its `numbers` those with these `keys` are `before`, and change within `low` and `high`. The growth rates are
    those with the numbers of each of the operating `points` in place of those of the scene.
    """

    def __init__(
        self,
        written: Written,
        keys: tuple[str, ...],
        state_matrix: StateMatrix,
        progress: Progress,
        points: Sequence[Mapping[str, float]] = ({},),
    ) -> None:
        """Take a scene without profiles as its file writes it, and the state matrix as a function of its numbers."""
        self.numbers = numbers = numbers_of(written.scene)
        self.written, self.keys = written, keys
        self._cases = np.array([list({**numbers, **point}.values()) for point in points])
        self._own = [list(numbers).index(key) for key in keys]
        self._evaluate, self._progress = state_matrix, progress
        self.before = self._cases[0, self._own]
        self._ends = np.transpose([_limits(key, numbers, written.scene, points) for key in keys])
        self.low, self.high = (self.sizes(ends) for ends in self._ends)
        self._at, self._found = None, (np.empty(0), np.empty((0, 0)))

    def sizes(self, after: NDArray[np.float64]) -> NDArray[np.float64]:
        """The sizes (k,) of the changes to these numbers (k,)."""
        return np.array([size_of(*each) for each in zip(self.keys, self.before, after, strict=True)])

    def sizes_of(self, numbers: Mapping[str, float]) -> NDArray[np.float64]:
        """The sizes (k,) of the changes to these numbers by key, the others as they were."""
        after = [numbers.get(key, before) for key, before in zip(self.keys, self.before.tolist(), strict=True)]
        return self.sizes(np.array(after))

    def after(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """The numbers that are changed (k,)."""
        values = [changed(*each)[0] for each in zip(self.keys, self.before, x, strict=True)]
        return np.where(x <= self.low, self._ends[0], np.where(x >= self.high, self._ends[1], values))

    def in_file(self, x: NDArray[np.float64]) -> dict[str, float]:
        """The numbers (SI) that change, with few digits, as the scene file will have them."""
        each = zip(self.keys, self.before.tolist(), self.after(x).tolist(), strict=True)
        return {
            key: rounded(self.written, key, after, before, self.limits[key])
            for key, before, after in each
            if after != before
        }

    def exact(self, x: NDArray[np.float64]) -> dict[str, float]:
        """All the numbers (SI), with all digits that the scene file can have."""
        texts = {key: self.written.exact(key, after) for key, after in zip(self.keys, self.after(x), strict=True)}
        return {key: self.written.read(key, text) for key, text in texts.items()}

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        """The least and the largest value (SI) of each number."""
        ends = np.sort(self._ends, axis=0).T.tolist()
        return {key: (low, high) for key, (low, high) in zip(self.keys, ends, strict=True)}

    def farthest(self, direction: NDArray[np.float64]) -> float:
        """How many times a change (k,) the bounds allow."""
        moved = direction != 0
        ends = np.where(direction > 0, self.high, self.low)
        return float(np.min(ends[moved] / direction[moved], initial=np.inf))

    def rates(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Real parts (m,) at all points, each by rising imaginary part, and their derivatives (m, k).

        Those of a free drift are NaN and zero.
        """
        if self._at is None or not np.array_equal(x, self._at):
            self._progress("searching for the smallest change", 0, None)
            slopes = np.array([changed(*each)[1] for each in zip(self.keys, self.before, x, strict=True)])
            cases = []
            for case in self._cases:
                numbers = case.copy()
                numbers[self._own] = self.after(x)
                cases.append(self._rates(numbers, slopes))
            rates, derivatives = zip(*cases, strict=True)
            self._at, self._found = x.copy(), (np.concatenate(rates), np.concatenate(derivatives))
        return self._found

    def _rates(
        self, numbers: NDArray[np.float64], slopes: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        matrix, derivatives = self._evaluate(numbers)
        if not (np.isfinite(matrix).all() and np.isfinite(derivatives).all()):  # no steady sliding there
            return np.full(len(matrix), NOWHERE), np.zeros((len(matrix), slopes.size))
        eigenvalues, right, left = eigensystem(matrix)
        order = np.lexsort((eigenvalues.real, eigenvalues.imag))
        drift = np.abs(eigenvalues) <= DRIFT_FRACTION * np.abs(eigenvalues).max()
        gradients = [eigenvalue_gradient(left[:, k], right[:, k], derivatives[self._own]) for k in order]
        rates = np.where(drift, np.nan, eigenvalues.real)[order]
        return rates, np.where(drift[order, None], 0.0, np.real(gradients)) * slopes

    def largest(self, x: NDArray[np.float64]) -> float:
        """Largest growth rate (1/s) of all but a free drift."""
        return float(np.nanmax(self.rates(x)[0]))

    def smallest_change(self, margin: float) -> NDArray[np.float64]:
        """The changes (k,) of least norm with every growth rate −`margin` or below or, where none do, of least growth.

        Every eigenvalue is a constraint of its own, not the largest of them, so that each is smooth; a free drift is
        none. Sequential quadratic programming (SciPy's SLSQP) with derivatives by eigenvectors, from several starts.
        Only a smallest change near one of these starts is found.
        """
        # From the brake as it is, and from five changes of some 0.3
        others = 0.3 * np.random.default_rng(20231122).standard_normal((5, len(self.keys)))
        starts = [np.zeros(len(self.keys)), *others]
        results = [self._solve(start, margin) for start in starts]
        stable = [x for x in results if self.decays(x, margin)]
        return min(stable, key=np.linalg.norm) if stable else min(results, key=self.largest)

    def decays(self, x: NDArray[np.float64], margin: float) -> bool:
        """Whether every growth rate is at most minus the margin."""
        return self.largest(x) <= -margin * (1 - SLACK)

    def _solve(self, start: NDArray[np.float64], margin: float) -> NDArray[np.float64]:
        """A local optimum from one start, or where the search ended."""

        def excess(x: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.nan_to_num(margin + self.rates(x)[0], nan=0.0)

        scale = max(1.0, float(np.abs(excess(np.zeros(start.size))).min()))
        result = scipy.optimize.minimize(
            lambda x: (float(x @ x), 2 * x),
            np.clip(start, self.low, self.high),
            jac=True,
            method="SLSQP",
            bounds=list(zip(self.low, self.high, strict=True)),
            constraints={
                "type": "ineq",
                "fun": lambda x: -excess(x) / scale,
                "jac": lambda x: -self.rates(x)[1] / scale,
            },
            options={"maxiter": 200, "ftol": 1e-12},
        )
        return np.clip(result.x, self.low, self.high)


def _limits(
    key: str, numbers: Mapping[str, float], scene: Scene, points: Sequence[Mapping[str, float]]
) -> tuple[float, float]:
    """What a number (SI) may become: the end of the way down of its size, and of the way up."""
    value = numbers[key]
    if value == 0:
        return 0.0, 1.0  # up to critical damping
    quantity = quantity_of(key, scene)
    may_vanish = quantity.least == 0 and not isinstance(quantity, Scheduled)  # without load there is no contact
    low, high = (0.0 if may_vanish else LEAST * value), 10.0 * value
    if quantity.most is not None:
        high = min(high, quantity.most)
    plain = key_alone(key)
    if plain == DAMPING:
        high = 1.0
    elif plain == "shoe.arc_angle":
        high = max(value, min(high, *(_widest(key, scene.with_values(point)) for point in points)))
    elif plain in ("shoe.thickness", "shoe.outer_radius"):
        # They stay on their sides of a number between them, so that the shoe remains a sector.
        shoe = scene.shoes[_shoe_of(key)]
        middle = float(np.sqrt(shoe.thickness * shoe.outer_radius))
        if plain == "shoe.thickness":
            high = min(high, THICKEST * middle)
        else:
            low = max(low, middle / THICKEST)
    return low, high


def _shoe_of(key: str) -> int:
    """The place of the shoe that a key is of."""
    number = key.split(".")[1]
    return int(number) if number.isdecimal() else 0


def _widest(key: str, scene: Scene) -> float:
    """The arc angle (rad) of a lining that leaves the others room, though these grow by as much."""
    own, *others = cast("list[NamedShoe]", sorted(scene.shoes, key=lambda each: each is not scene.shoes[_shoe_of(key)]))
    widest = math.tau
    for each in others:
        apart = abs(math.remainder(each.position - own.position, math.tau))
        widest = min(widest, apart + (own.arc_angle - each.arc_angle) / 2)
    return widest
