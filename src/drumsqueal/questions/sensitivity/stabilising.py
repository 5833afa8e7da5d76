"""The smallest change of a brake that makes every mode decay: what may change, how far, and the search for it."""

from collections.abc import Mapping, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.progress import Progress
from drumsqueal.scene import Scene, quantity_of
from drumsqueal.scene.tables import Scheduled
from drumsqueal.scene.variation import likely_key
from drumsqueal.solve.linear.family import StateMatrix, eigenvalue_gradient
from drumsqueal.solve.linear.modes import DRIFT_FRACTION

MARGIN = 1.0  # 1/s: every growth rate is to be at most minus this
SLACK = 1e-3  # of the margin that an optimum on its limit may miss
STARTS, SPREAD, SEED = 6, 0.3, 20231122  # starting points, their relative distance, and the seed of the random ones
NOWHERE = 1e9  # 1/s; the growth rate where there is no steady sliding
LEAST, MOST = 0.1, 10.0  # times its value: how far a number may go, where physics has no nearer limit
WIDEST_ARC, THICKEST = 2 * np.pi, 0.99  # rad; of the geometric mean of thickness and outer radius
DAMPING = "damping.ratio"
ZERO_SCALE = {DAMPING: 0.01}  # what counts as a change of one of a number that is zero
GIVEN = ("drum.speed", "contact.normal_load", "shoe.outer_radius", "forcing.")  # of the vehicle, not of the design


def numbers_of(scene: Scene) -> dict[str, float]:
    """The physical numbers of a scene without profiles, by key, in SI."""
    return {key: value for key, value in scene.numbers().items() if isinstance(value, float)}


def variable_numbers(scene: Scene, keys: Sequence[str] | None = None) -> tuple[Scene, tuple[str, ...]]:
    """The numbers that may change, by default those of the design, and the scene with a damping ratio if it is one.

    Raises RequestError for a key that is none, is named twice, changes over time or is zero.
    """
    if keys is not None and DAMPING in keys and scene.damping is None:
        scene = scene.with_values({"damping": {"ratio": 0.0}})
    numbers = numbers_of(scene)
    if keys is None:
        chosen = tuple(key for key, value in numbers.items() if value and not key.startswith(GIVEN))
        return scene, chosen
    for k, key in enumerate(keys):
        if f"{key}.value" in scene.numbers():
            raise RequestError(f"--vary {key}: it changes over time; give it one value")
        if key in scene.numbers() and key not in numbers:
            raise RequestError(f"--vary {key}: it is a list, which is not varied; leave it out")
        if key not in numbers:
            raise RequestError(f"--vary {key}: not a number of this scene; {likely_key(key, list(numbers))}")
        if key in keys[:k]:
            raise RequestError(f"--vary {key}: named twice; leave one out")
        if key.startswith("forcing."):
            raise RequestError(f"--vary {key}: a harmonic force does not act on growth rates; leave it out")
        if numbers[key] == 0 and key not in ZERO_SCALE:
            raise RequestError(f"--vary {key}: it is 0 and has no relative change; give it a value first")
    return scene, tuple(keys)


def largest_growth(eigenvalues: NDArray[np.complex128]) -> float:
    """Largest real part (1/s) of all eigenvalues but those of a free drift."""
    held = np.abs(eigenvalues) > DRIFT_FRACTION * np.abs(eigenvalues).max()
    return float(eigenvalues[held].real.max())


class Problem:
    """Growth rates as smooth functions of relative changes x (k,), remembered for the last x.

    The numbers with these `keys` are `before` + x `scale`, within `low` and `high`; every growth rate is to be
    −`margin` (1/s) or below.
    """

    def __init__(
        self, scene: Scene, keys: tuple[str, ...], margin: float, state_matrix: StateMatrix, progress: Progress
    ) -> None:
        """Take a scene without profiles, and the state matrix as a function of its numbers."""
        numbers, self.keys = numbers_of(scene), keys
        self._numbers, self._own = np.array(list(numbers.values())), [list(numbers).index(key) for key in keys]
        self._margin, self._evaluate, self._progress = margin, state_matrix, progress
        self.before = self._numbers[self._own]
        self.scale = np.array([numbers[key] or ZERO_SCALE[key] for key in keys])
        self.low, self.high = np.transpose([_bounds(key, numbers, scene) for key in keys])
        self._at, self._found, self._largest = None, (np.empty(0), np.empty((0, 0))), NOWHERE

    def after(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """The numbers that are changed (k,)."""
        return self.before + x * self.scale

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        """The least and the largest value (SI) of each number."""
        ends = np.sort([self.after(self.low), self.after(self.high)], axis=0).T.tolist()
        return {key: (low, high) for key, (low, high) in zip(self.keys, ends, strict=True)}

    def rates(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Real parts (2n,), by rising imaginary part, and their derivatives (2n, k); of a drift −margin and zero."""
        if self._at is not None and np.array_equal(x, self._at):
            return self._found
        self._progress("searching for the smallest change", 0, None)
        numbers = self._numbers.copy()
        numbers[self._own] = self.after(x)
        matrix, derivatives = self._evaluate(numbers)
        if not (np.isfinite(matrix).all() and np.isfinite(derivatives).all()):  # no steady sliding there
            self._at, self._largest = x.copy(), NOWHERE
            self._found = np.full(len(matrix), NOWHERE), np.zeros((len(matrix), x.size))
            return self._found
        eigenvalues, right = (part.astype(np.complex128) for part in np.linalg.eig(matrix))
        left = np.linalg.pinv(right).conj().T  # leftᴴ right = 1 for each
        order = np.lexsort((eigenvalues.real, eigenvalues.imag))
        drift = np.abs(eigenvalues) <= DRIFT_FRACTION * np.abs(eigenvalues).max()
        gradients = [eigenvalue_gradient(left[:, k], right[:, k], derivatives[self._own]) for k in order]
        rates = np.where(drift, -self._margin, eigenvalues.real)[order]
        slopes = np.where(drift[order, None], 0.0, np.real(gradients)) * self.scale
        self._at, self._found, self._largest = x.copy(), (rates, slopes), largest_growth(eigenvalues)
        return self._found

    def largest(self, x: NDArray[np.float64]) -> float:
        """Largest growth rate (1/s) of all but a free drift."""
        self.rates(x)
        return self._largest

    def smallest_change(self) -> NDArray[np.float64]:
        """The relative changes (k,) of least norm that make every mode decay or, where none do, of least growth.

        Every eigenvalue is a constraint of its own, not the largest of them, so that each is smooth; a free drift is
        none. Sequential quadratic programming (SciPy's SLSQP) with derivatives by eigenvectors, from several starts.
        Only a smallest change near one of these starts is found.
        """
        generator, size = np.random.default_rng(SEED), len(self.keys)
        starts = [np.zeros(size), *(SPREAD * generator.standard_normal((STARTS - 1, size)))]
        results = [self._solve(start) for start in starts]
        stable = [x for x in results if self.decays(x)]
        return min(stable, key=np.linalg.norm) if stable else min(results, key=self.largest)

    def decays(self, x: NDArray[np.float64]) -> bool:
        """Whether every growth rate is at most minus the margin."""
        return self.largest(x) <= -self._margin * (1 - SLACK)

    def _solve(self, start: NDArray[np.float64]) -> NDArray[np.float64]:
        """A local optimum from one start, or where the search ended."""
        scale = max(1.0, float(np.abs(self._margin + self.rates(np.zeros(start.size))[0]).min()))
        decays = {
            "type": "ineq",
            "fun": lambda x: -(self._margin + self.rates(x)[0]) / scale,
            "jac": lambda x: -self.rates(x)[1] / scale,
        }
        result = scipy.optimize.minimize(
            lambda x: (float(x @ x), 2 * x),
            np.clip(start, self.low, self.high),
            jac=True,
            method="SLSQP",
            bounds=list(zip(self.low, self.high, strict=True)),
            constraints=decays,
            options={"maxiter": 200, "ftol": 1e-12},
        )
        return np.clip(result.x, self.low, self.high)


def _bounds(key: str, numbers: Mapping[str, float], scene: Scene) -> tuple[float, float]:
    """Least and largest relative change of a number."""
    value = numbers[key]
    if value == 0:
        return 0.0, 1 / ZERO_SCALE[key]  # up to critical damping
    quantity = quantity_of(key, scene)
    may_vanish = quantity.least == 0 and not isinstance(quantity, Scheduled)  # without load there is no contact
    low = -1.0 if may_vanish else LEAST - 1
    high = MOST - 1
    # Thickness and radius stay on their sides of a number between them, so that the shoe remains a sector.
    middle = float(np.sqrt(numbers["shoe.thickness"] * numbers["shoe.outer_radius"]))
    if key == DAMPING:
        high = 1 / value - 1
    elif key == "shoe.arc_angle":
        high = min(high, WIDEST_ARC / value - 1)
    elif key == "shoe.thickness":
        high = min(high, THICKEST * middle / value - 1)
    elif key == "shoe.outer_radius":
        low = max(low, middle / (THICKEST * value) - 1)
    return low, high
