"""Numbers from observations by weighted least squares, and which measured line is which mode."""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from drumsqueal.questions.fit.record import RecordLine
from drumsqueal.questions.sensitivity.stabilising import ZERO_SCALE
from drumsqueal.scene import Scene
from drumsqueal.simulation import prepare
from drumsqueal.solve.linear.family import eigenvalue_gradient, state_matrix_of
from drumsqueal.solve.linear.modes import Mode, assurance, eigensystem, matched

WIDTH = 1.0  # of log number: how far, by a factor e, one may be off that no observation holds
OPEN = 0.35  # standard error in that, from which a combination of numbers is not determined
PART = 0.1  # of a number's freedom that an open combination takes, from which the number is not determined
FURTHEST = float(np.log(20.0))  # of log number from the scene's value
AT_BOUND = 1e-3  # of x, this close to the end of what is tried
# Uncertainties by which observations may be missed: up to here the intervals are widened, as if the misses were random;
# beyond it the model or another of its numbers is wrong, and no interval says by how much.
FAR = 10.0
# The same from which a miss is more than chance: three standard errors are exceeded by 1 of 370, and by fewer where
# there is more freedom.
POOR = 3.0
PERCENT_95 = 1.959964  # standard errors of a normal distribution

Residuals = Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]]


class Scale(NamedTuple):
    """Numbers p (k,) in SI as functions of x (k,), zero at the scene's values: p = before e^x, or scale x from zero."""

    before: NDArray[np.float64]
    zero: NDArray[np.float64]

    @classmethod
    def of(cls, keys: Sequence[str], before: Sequence[float]) -> "Scale":
        """Of the numbers with these keys and values."""
        return cls(np.array(before, dtype=np.float64), np.array([ZERO_SCALE.get(key, 1.0) for key in keys]))

    def numbers(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """p at x."""
        return np.where(self.before == 0, self.zero * x, self.before * np.exp(x))

    def slopes(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """∂p/∂x (k,)."""
        return np.where(self.before == 0, self.zero, self.before * np.exp(x))

    @property
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Least and largest x."""
        none = self.before == 0
        return np.where(none, -1e-9, -FURTHEST), np.where(none, 1 / self.zero, FURTHEST)

    def at_bound(self, x: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which numbers (k,) end where the search does, where no observation stopped them. Zero is no such end."""
        low, high = self.bounds
        return (high - x < AT_BOUND) | ((x - low < AT_BOUND) & (self.before != 0))


class Estimate(NamedTuple):
    """What observations say of x (k,): its value, its covariance (k, k), and `open` combinations (m, k) of length 1.

    `chi_square` is the sum of squared residuals and `freedom` the observations beyond what is fitted. Where the
    residuals are larger than their uncertainties, χ² > max(freedom, 1), the covariance is scaled by their ratio, and
    `factor_95` is that of Student's distribution, which makes 95 % of a standard error. As many numbers as observations
    should leave no residual, so that one that is left is that of freedom 1. `determined` (k,) are the numbers that are
    in no combination whose error, so widened, is OPEN or more, and not at the end of what is tried; none where the
    observations are `missed`, by FAR times their uncertainty or more.
    """

    x: NDArray[np.float64]
    covariance: NDArray[np.float64]
    open: NDArray[np.float64]
    determined: NDArray[np.bool_]
    chi_square: float
    freedom: int
    factor_95: float

    @property
    def chi_square_per_freedom(self) -> float | None:
        """χ²/max(freedom, 1); None where no freedom is left and the observations are met."""
        return self.chi_square / max(self.freedom, 1) if self.freedom > 0 or self.chi_square > 1 else None

    @property
    def missed(self) -> bool:
        """Whether the observations are missed by far more than their uncertainty."""
        return (self.chi_square_per_freedom or 0.0) > FAR**2

    @property
    def errors(self) -> NDArray[np.float64]:
        """Standard errors of x (k,)."""
        return np.sqrt(np.diag(self.covariance))


def estimate(residuals: Residuals, scale: Scale) -> Estimate:
    """Least squares of residuals (m,), measured less predicted over the uncertainty, with their Jacobian (m, k) in x.

    First together with x/WIDTH, the scene's values as weak observations, which keeps open combinations near them; then
    without these for all combinations that the observations determine: whose standard error is below OPEN. An open
    combination stays at the scene's values.
    """
    x = np.zeros(scale.before.size)
    own = np.eye(x.size) / WIDTH
    for _ in range(2):
        x = _least_squares(residuals, own, x, scale)
        r, jacobian = residuals(x)
        _, values, right = np.linalg.svd(jacobian, full_matrices=True)
        # 1e-6 of log number, by which an open combination may leave the scene's values
        own = right[int(np.sum(values * OPEN > 1)) :] / 1e-6
    return assess(r, jacobian, x, scale)


def _least_squares(
    residuals: Residuals, own: NDArray[np.float64], x: NDArray[np.float64], scale: Scale
) -> NDArray[np.float64]:
    """Least squares from x on, together with own combinations (n, k) of x that are to be zero."""
    last: dict[bytes, tuple[NDArray[np.float64], NDArray[np.float64]]] = {}

    def evaluate(x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if x.tobytes() not in last:
            last.clear()
            r, jacobian = residuals(x)
            if not (np.isfinite(r).all() and np.isfinite(jacobian).all()):
                # 1e6: the residual where the model has no answer
                r, jacobian = np.full(r.shape, 1e6), np.zeros(jacobian.shape)
            last[x.tobytes()] = np.concatenate([r, own @ x]), np.concatenate([jacobian, own])
        return last[x.tobytes()]

    return scipy.optimize.least_squares(
        lambda x: evaluate(x)[0],
        x,
        jac=lambda x: evaluate(x)[1],  # pyright: ignore[reportArgumentType]
        bounds=scale.bounds,
        x_scale=np.ones(x.size),
        xtol=1e-13,
        ftol=1e-13,
        gtol=1e-13,
        max_nfev=100,
    ).x


def assess(r: NDArray[np.float64], jacobian: NDArray[np.float64], x: NDArray[np.float64], scale: Scale) -> Estimate:
    """What residuals (m,) at x, with their Jacobian (m, k), leave known of it."""
    _, values, right = np.linalg.svd(jacobian, full_matrices=True)
    fitted = int(np.sum(values * OPEN > 1))
    freedom, chi_square = r.size - fitted, float(r @ r)
    spread, factor = 1.0, PERCENT_95
    if chi_square > max(freedom, 1):
        spread = math.sqrt(chi_square / max(freedom, 1))
        factor = float(scipy.special.stdtrit(max(freedom, 1), 0.975))
    # Judged by its whole interval: few residuals make it wider than its standard error tells.
    held = int(np.sum(values * OPEN > spread * factor / PERCENT_95))
    known, free = right[:held], right[held:]
    covariance = spread**2 * (known.T / values[:held] ** 2) @ known + WIDTH**2 * free.T @ free
    determined = (np.sqrt(np.sum(free**2, axis=0)) < PART) & ~scale.at_bound(x)
    found = Estimate(x, covariance, right[fitted:], determined, chi_square, freedom, factor)
    return found._replace(determined=determined & ~np.array(found.missed))


# Eigenvalues as functions of some numbers of a scene, with their derivatives, mode by mode.


LEAST = 1e-12  # of the largest |λ|; below it an eigenvalue does not oscillate


class _Eigenlines(NamedTuple):
    """λ (modes,) in 1/s and ∂λ/∂p (modes, k); NaN where there is no steady sliding."""

    eigenvalues: NDArray[np.complex128]
    gradients: NDArray[np.complex128]


class Eigenmodes:
    """The oscillating modes of a scene as its numbers change: each is followed by its shape.

    The scene has no profiles (`at_one_time`). Raises SceneError where it has no steady sliding.
    """

    def __init__(self, scene: Scene, keys: Sequence[str]) -> None:
        """Name the scene and the numbers, by key, that change."""
        stability = prepare(scene).stability
        self.modes: tuple[Mode, ...] = stability.modes
        self._mass = stability.mass
        self._evaluate = state_matrix_of(scene, tuple(keys))

    @property
    def labels(self) -> tuple[str, ...]:
        """Of the modes, by rising frequency in the scene."""
        return tuple(mode.label for mode in self.modes)

    def at(self, numbers: NDArray[np.float64]) -> _Eigenlines:
        """Eigenvalues and derivatives at these numbers (k,), in SI, in the order of `labels`.

        Which eigenvalue is which mode is the assignment of eigenvectors to those of the scene with the largest sum of
        overlaps: modes that cross keep their names.
        """
        matrix, derivatives = self._evaluate(numbers)
        count = len(self.modes)
        if not (np.isfinite(matrix).all() and np.isfinite(derivatives).all()):
            return _Eigenlines(np.full(count, np.nan + 0j), np.full((count, numbers.size), np.nan + 0j))
        eigenvalues, right, left = eigensystem(matrix)
        n = self._mass.size
        overlap = np.array([assurance(self._mass, mode.right[:n], right[:n]) for mode in self.modes])
        overlap[:, eigenvalues.imag <= LEAST * np.abs(eigenvalues).max()] = -1.0
        chosen = [*matched(overlap).values()]
        gradients = [eigenvalue_gradient(left[:, k], right[:, k], derivatives) for k in chosen]
        return _Eigenlines(eigenvalues[chosen], np.array(gradients).reshape(count, numbers.size))


LIKELY = 0.5  # of log number, by which one is off
AMBIGUOUS = 4.0  # difference in cost below which another assignment fits as well


class Assignment(NamedTuple):
    """The place of each line's mode, or None, by line; its cost; and the next best one, where that is as likely."""

    modes: tuple[int | None, ...]
    cost: float
    rival: tuple[int | None, ...] | None = None


def assign(lines: Sequence[RecordLine], modes: Eigenmodes, scale: Scale, moved: Sequence[bool]) -> Assignment:
    """Assign lines to modes in order of frequency, no two to one mode; a line may be of none.

    The likeliest assignments are each fitted, with frequencies to 1 % and growth rates to 30 %, and the one is taken
    that needs the least misfit, change of the numbers and lines left out.
    """
    frequency = np.array([mode.frequency_Hz for mode in modes.modes])
    measured = np.array([line.frequency_Hz for line in lines])
    loudest = max(line.amplitude for line in lines)
    # 25 for the strongest line left out; a weaker one less, by the fourth root of its amplitude
    missed = [25.0 * (line.amplitude / loudest) ** 0.25 for line in lines]

    def at_first(choice: tuple[int | None, ...]) -> float:
        pairs = [(j, k) for j, k in enumerate(choice) if k is not None]
        apart = sum((np.log(measured[j] / frequency[k]) / 0.2) ** 2 for j, k in pairs)
        return float(apart) + _left(choice, missed, moved)

    possible = sorted(_choices(measured, frequency), key=at_first)[:12]
    costs = []
    for choice in possible:
        taken = [(line, k) for line, k in zip(lines, choice, strict=True) if k is not None]
        cost = _left(choice, missed, moved)
        if taken:
            loose = [_loose(line) for line, _ in taken]
            found = fit_lines(loose, [k for _, k in taken], modes, scale)
            cost += found.chi_square + float(np.sum((found.x / LIKELY) ** 2))
        costs.append(cost)
    order = np.argsort(costs, kind="stable")
    best = possible[order[0]]
    rivals = (possible[k] for k in order[1:] if costs[k] - costs[order[0]] < AMBIGUOUS)
    # One that merely leaves a line out is none.
    others = (each for each in rivals if any(a is not None and a != b for a, b in zip(each, best, strict=True)))
    return Assignment(best, float(costs[order[0]]), next(others, None))


def _left(choice: tuple[int | None, ...], missed: Sequence[float], moved: Sequence[bool]) -> float:
    out = sum(cost for cost, k in zip(missed, choice, strict=True) if k is None)
    # 6.0 for a mode that nothing moves in the scene's own run
    return out + 6.0 * sum(k is not None and not moved[k] for k in choice)


def _choices(lines: NDArray[np.float64], modes: NDArray[np.float64]) -> Iterator[tuple[int | None, ...]]:
    """Every assignment that keeps the order of frequencies and is not too far off."""
    order = np.argsort(lines, kind="stable").tolist()
    for count in range(min(lines.size, modes.size) + 1):
        for chosen in itertools.combinations(order, count):
            for places in itertools.combinations(range(modes.size), count):
                # 0.4 of log frequency, between a line and its mode in the scene
                if all(abs(np.log(lines[j] / modes[k])) <= 0.4 for j, k in zip(chosen, places, strict=True)):
                    taken = dict(zip(chosen, places, strict=True))
                    yield tuple(taken.get(j) for j in range(lines.size))


def _loose(line: RecordLine) -> RecordLine:
    rate, error = line.growth_rate_1_per_s, line.growth_rate_uncertainty_1_per_s
    # A model of a brake has its frequencies to a percent or so, and its growth rates to a third.
    f = float(np.hypot(line.frequency_uncertainty_Hz, 0.01 * line.frequency_Hz))
    if rate is not None and error is not None:
        error = float(np.hypot(error, 0.3 * abs(rate) + 10.0))
    return line.model_copy(update={"frequency_uncertainty_Hz": f, "growth_rate_uncertainty_1_per_s": error})


def fit_lines(lines: Sequence[RecordLine], places: Sequence[int], modes: Eigenmodes, scale: Scale) -> Estimate:
    """Fit numbers so that the eigenvalues at these places are those of the lines: Im λ/2π and, where known, Re λ."""
    frequency, spread = np.array([(line.frequency_Hz, line.frequency_uncertainty_Hz) for line in lines]).T
    rates = [(line.growth_rate_1_per_s, line.growth_rate_uncertainty_1_per_s) for line in lines]
    rate, rate_spread = np.array(rates, dtype=np.float64).T  # NaN where one is not known
    rated, chosen = ~np.isnan(rate + rate_spread), np.array(places, dtype=np.intp)

    def residuals(x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        found = modes.at(scale.numbers(x))
        values, slopes = found.eigenvalues[chosen], found.gradients[chosen] * scale.slopes(x)
        first = (values.imag / (2 * np.pi) - frequency) / spread, slopes.imag / (2 * np.pi) / spread[:, None]
        second = (values.real - rate) / rate_spread, slopes.real / rate_spread[:, None]
        return np.concatenate([first[0], second[0][rated]]), np.concatenate([first[1], second[1][rated]])

    return estimate(residuals, scale)
