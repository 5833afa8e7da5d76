"""Lyapunov exponents from how tangents grew, interval by interval."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drumsqueal.findings.signals.spectra import finite_record, positive

SURE = 3.0  # standard errors


class Exponents(NamedTuple):
    """Lyapunov exponents (k,) and their standard errors in 1/s, largest first, and their means until each time (s).

    `running` (intervals, k) are the means from the end of the alignment until `time_s` (intervals,).
    """

    exponent_1_per_s: NDArray[np.float64]
    standard_error_1_per_s: NDArray[np.float64]
    time_s: NDArray[np.float64]
    running_1_per_s: NDArray[np.float64]

    @property
    def averaged_s(self) -> float:
        """The time (s) that the means are over."""
        return float(self.time_s[-1] - self.time_s[0])

    @property
    def resolution_1_per_s(self) -> float:
        """What cannot be distinguished from zero: growth or decay by e^5 in the whole record.

        Tangents along the motion, and along a torus, neither grow nor shrink for ever but vary by some e-folds.
        """
        # What grows or decays by less than five e-folds in the whole record cannot be distinguished from zero.
        return 5.0 / self.averaged_s

    @property
    def uncertainty_1_per_s(self) -> NDArray[np.float64]:
        """What an exponent (k,) must exceed to have a known sign: three standard errors, and the resolution."""
        return np.maximum(SURE * self.standard_error_1_per_s, self.resolution_1_per_s)

    @property
    def significant(self) -> NDArray[np.bool_]:
        """Which exponents (k,) are above or below zero beyond their uncertainty."""
        return np.abs(self.exponent_1_per_s) > self.uncertainty_1_per_s

    @property
    def zero(self) -> NDArray[np.bool_]:
        """Which exponents (k,) are zero to the resolution; the sign of one that is neither is not known."""
        return np.abs(self.exponent_1_per_s) <= self.resolution_1_per_s

    @property
    def chaotic(self) -> bool:
        """Whether nearby motions separate exponentially: the largest exponent is significantly positive."""
        return bool(self.significant[0] and self.exponent_1_per_s[0] > 0)


def orthonormalised(tangents: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Make orthonormal what orthonormal tangents (n, k) have become, and return by how much they grew, as logs (k,).

    Source: G. Benettin, L. Galgani, A. Giorgilli and J.-M. Strelcyn, "Lyapunov characteristic exponents for smooth
    dynamical systems and for Hamiltonian systems", Meccanica 15, 1980.
    """
    turned, triangle = np.linalg.qr(np.asarray(tangents))
    return turned, np.log(np.maximum(np.abs(np.diag(triangle)), np.finfo(np.float64).tiny))


def lyapunov_exponents(growth: ArrayLike, interval: float) -> Exponents:
    """Return the exponents λ = ⟨growth⟩/interval from log growths (intervals, k) of tangents, one interval (s) each.

    The first tenth, in which tangents align, is left out. The standard error is that of the means of ten blocks. It
    knows nothing of what is slower than a block.

    Raises ValueError for fewer than 20 intervals and for NaN.
    """
    blocks = 10
    logs = finite_record("growth", growth, dimensions=2, minimum=2 * blocks)
    step = positive("interval", interval)
    # 0.1 first fraction of the record, in which tangents turn to where they grow
    kept = logs[round(0.1 * logs.shape[0]) :] / step
    means = np.array([block.mean(axis=0) for block in np.array_split(kept, blocks)])
    count = np.arange(1, kept.shape[0] + 1)
    first = logs.shape[0] - kept.shape[0]
    falling = np.argsort(-kept.mean(axis=0))  # nearly equal ones come in any order
    return Exponents(
        kept.mean(axis=0)[falling],
        (means.std(axis=0, ddof=1) / np.sqrt(blocks))[falling],
        (first + count) * step,
        (np.cumsum(kept, axis=0) / count[:, None])[:, falling],
    )
