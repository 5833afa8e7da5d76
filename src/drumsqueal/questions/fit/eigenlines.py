"""Eigenvalues as functions of some numbers of a scene, with their derivatives, mode by mode."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from drumsqueal.scene import Scene
from drumsqueal.simulation import prepare
from drumsqueal.solve.linear.family import eigenvalue_gradient, state_matrix_of
from drumsqueal.solve.linear.modes import Mode, eigensystem

LEAST = 1e-12  # of the largest |λ|; below it an eigenvalue does not oscillate


class Eigenlines(NamedTuple):
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

    def at(self, numbers: NDArray[np.float64]) -> Eigenlines:
        """Eigenvalues and derivatives at these numbers (k,), in SI, in the order of `labels`.

        Which eigenvalue is which mode is the assignment of eigenvectors to those of the scene with the largest sum of
        overlaps: modes that cross keep their names.
        """
        matrix, derivatives = self._evaluate(numbers)
        count = len(self.modes)
        if not (np.isfinite(matrix).all() and np.isfinite(derivatives).all()):
            return Eigenlines(np.full(count, np.nan + 0j), np.full((count, numbers.size), np.nan + 0j))
        eigenvalues, right, left = eigensystem(matrix)
        overlap = np.array([self._likeness(mode, right) for mode in self.modes])
        overlap[:, eigenvalues.imag <= LEAST * np.abs(eigenvalues).max()] = -1.0
        rows, columns = scipy.optimize.linear_sum_assignment(-overlap)
        chosen = columns[np.argsort(rows)]
        gradients = [eigenvalue_gradient(left[:, k], right[:, k], derivatives) for k in chosen]
        return Eigenlines(eigenvalues[chosen], np.array(gradients).reshape(count, numbers.size))

    def _likeness(self, mode: Mode, right: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Overlap of a mode's displacements with those of eigenvectors (2n, m), by mass: from 0 to 1 (m,)."""
        n = self._mass.size
        shape, others = mode.right[:n], right[:n]
        norms = np.sqrt((self._mass @ np.abs(shape) ** 2) * (self._mass @ np.abs(others) ** 2))
        return np.abs((self._mass * shape.conj()) @ others) / np.maximum(norms, np.finfo(np.float64).tiny)
