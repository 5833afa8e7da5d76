"""Numbers from observations by weighted least squares: values, covariance, and what the observations leave open."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from drumsqueal.questions.sensitivity.stabilising import ZERO_SCALE

WIDTH = 1.0  # of log number: how far, by a factor e, one may be off that no observation holds
OPEN = 0.35  # standard error in that, from which a combination of numbers is not determined
PART = 0.1  # of a number's freedom that an open combination takes, from which the number is not determined
FURTHEST = float(np.log(20.0))  # of log number from the scene's value
AT_BOUND = 1e-3  # of x, this close to the end of what is tried
POLISH, SETTLED = 20, 1e-12  # steps without the scene's values, and the length of the last
NOWHERE = 1e6  # residual where the model has no answer
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

    First together with x/WIDTH, the scene's values as weak observations, which keeps open combinations near them; then,
    by Gauss–Newton steps, without these for all combinations that the observations determine: whose standard error is
    below OPEN. An open combination stays at the scene's values.
    """
    size = scale.before.size
    last: dict[bytes, tuple[NDArray[np.float64], NDArray[np.float64]]] = {}

    def evaluate(x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if x.tobytes() not in last:
            last.clear()
            r, jacobian = residuals(x)
            if not (np.isfinite(r).all() and np.isfinite(jacobian).all()):
                r, jacobian = np.full(r.shape, NOWHERE), np.zeros(jacobian.shape)
            last[x.tobytes()] = np.concatenate([r, x / WIDTH]), np.concatenate([jacobian, np.eye(size) / WIDTH])
        return last[x.tobytes()]

    found = scipy.optimize.least_squares(
        lambda x: evaluate(x)[0],
        np.zeros(size),
        jac=lambda x: evaluate(x)[1],  # pyright: ignore[reportArgumentType]
        bounds=scale.bounds,
        x_scale=np.ones(size),
        xtol=1e-13,
        ftol=1e-13,
        gtol=1e-13,
        max_nfev=100,
    )

    def of_lines(x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        r, jacobian = evaluate(x)
        return r[:-size], jacobian[:-size]

    x = _polished(of_lines, found.x, scale)
    return assess(*of_lines(x), x, scale)


def _polished(evaluate: Residuals, x: NDArray[np.float64], scale: Scale) -> NDArray[np.float64]:
    r, jacobian = evaluate(x)
    low, high = scale.bounds
    best, least = x, float(r @ r)
    for _ in range(POLISH):
        left, values, right = np.linalg.svd(jacobian, full_matrices=True)
        held = int(np.sum(values * OPEN > 1))
        step = -right[:held].T @ ((left[:, :held].T @ r) / values[:held])
        free = right[held:]
        step = step - free.T @ (free @ x)  # an open combination goes back to the scene's
        x = np.clip(x + step, low, high)
        r, jacobian = evaluate(x)
        if float(r @ r) <= least * (1 + 1e-6) + 1e-12:
            best, least = x, min(least, float(r @ r))
        if np.linalg.norm(step) < SETTLED:
            break
    return best


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
