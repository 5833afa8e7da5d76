"""Lyapunov exponents from how tangents grew, interval by interval."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drumsqueal.signals.checks import finite_record, positive

ALIGNING = 0.1  # first share of the record, in which tangents turn to where they grow
BLOCKS = 10
SURE = 3.0  # standard errors
FOLD = 5.0  # e-folds that a difference must grow by in the whole record for chaos to show


class Exponents(NamedTuple):
    """Lyapunov exponents (k,) and their standard errors in 1/s, largest first, and their means until each time (s).

    `running` (intervals, k) are the means from the end of the alignment until `time_s` (intervals,).
    """

    exponent_1_per_s: NDArray[np.float64]
    standard_error_1_per_s: NDArray[np.float64]
    time_s: NDArray[np.float64]
    running_1_per_s: NDArray[np.float64]

    @property
    def chaotic(self) -> bool:
        """Whether nearby motions separate: the largest exponent is above zero by three of its standard errors.

        In the record they must separate by more than e^5: tangents of a torus grow, too, but not exponentially.
        """
        largest, error = float(self.exponent_1_per_s[0]), float(self.standard_error_1_per_s[0])
        return largest > SURE * error and largest * float(self.time_s[-1] - self.time_s[0]) > FOLD


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
    logs = finite_record("growth", growth, dimensions=2, minimum=2 * BLOCKS)
    step = positive("interval", interval)
    kept = logs[round(ALIGNING * logs.shape[0]) :] / step
    means = np.array([block.mean(axis=0) for block in np.array_split(kept, BLOCKS)])
    count = np.arange(1, kept.shape[0] + 1)
    first = logs.shape[0] - kept.shape[0]
    return Exponents(
        kept.mean(axis=0),
        means.std(axis=0, ddof=1) / np.sqrt(BLOCKS),
        (first + count) * step,
        np.cumsum(kept, axis=0) / count[:, None],
    )
