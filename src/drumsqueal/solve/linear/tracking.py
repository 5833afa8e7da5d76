"""Which mode is which: modes of different models are one where their shapes are alike, whatever their order is.

Two measures, both from 0 to 1: by right and left eigenvectors, which is 1 for a mode itself and 0 for all others of its
matrix, and, where there are displacements alone, the root of the modal assurance criterion in the mass metric.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import NDArray

if TYPE_CHECKING:
    from drumsqueal.solve.linear.modes import Mode

# Two modes at neighbouring values are one where their shapes overlap so much; where they do not, the step is halved.
CLOSE, LINKED = 0.9, 0.5
CLEAR = 0.5**0.5  # overlap beyond which no other mode can have as much in common with either
SIDES = ("right", "left")  # of eigenvectors


def overlaps(modes: "Sequence[Mode]", others: "Sequence[Mode]") -> NDArray[np.float64]:
    """How much of each mode is each of others, from 0 to 1."""
    if not modes or not others:
        return np.zeros((len(modes), len(others)))
    return overlap_of(modes, *(np.array([getattr(mode, side) for mode in others]).T for side in SIDES))


def overlap_of(
    modes: "Sequence[Mode]", right: NDArray[np.complex128], left: NDArray[np.complex128]
) -> NDArray[np.float64]:
    """√|l_iᴴ r_j · l_jᴴ r_i| of each mode and of eigenvectors, columns (2n, k), scaled to lᴴ r = 1; at most 1.

    Whatever the units of the state are, it is 1 for a mode itself and 0 for all others of its matrix.
    """
    own_right, own_left = (np.array([getattr(mode, side) for mode in modes]) for side in SIDES)
    return np.minimum(np.sqrt(np.abs((own_left.conj() @ right) * (own_right @ left.conj()))), 1.0)


def assurance(mass: NDArray[np.float64], shape: NDArray, shapes: NDArray) -> NDArray[np.float64]:
    """√MAC (k,) of a shape (n,) and of others, columns (n, k), by a diagonal mass matrix (n,)."""
    norms = np.sqrt((mass @ np.abs(shape) ** 2) * (mass @ np.abs(shapes) ** 2))
    return np.abs((mass * shape.conj()) @ shapes) / np.maximum(norms, np.finfo(np.float64).tiny)


def matched(overlap: NDArray[np.float64], least: float = -np.inf) -> dict[int, int]:
    """Which of the others each mode is, by the largest sum of overlaps, where their own is `least` at least."""
    pairs = zip(*scipy.optimize.linear_sum_assignment(overlap, maximize=True), strict=True)
    return {int(i): int(j) for i, j in pairs if overlap[i, j] >= least}
