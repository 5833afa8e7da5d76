"""The eigenvalues and modes of steady sliding as arrays, for formats that hold arrays."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from drumsqueal.findings.vibration import unit_of

if TYPE_CHECKING:
    from drumsqueal.solve.linear.modes import Stability


def mode_arrays(stability: "Stability") -> dict[str, NDArray[Any]]:
    """Of m oscillating modes, by rising frequency: names, λ (1/s), frequencies, growth rates, ζ, and shapes (n, m).

    A column of `shape` is the complex eigenvector of the n coordinates, that of the mode's name scaled to 1.
    """
    modes, n = stability.modes, len(stability.coordinates)
    return {
        "name": np.array([mode.label for mode in modes], dtype=str),
        "eigenvalue": np.array([mode.eigenvalue for mode in modes], dtype=np.complex128),
        "frequency_Hz": np.array([mode.frequency_Hz for mode in modes]),
        "growth_rate_1_per_s": np.array([mode.growth_rate for mode in modes]),
        "damping_ratio": np.array([mode.damping_ratio for mode in modes]),
        "shape": np.array([mode.right[:n] for mode in modes], dtype=np.complex128).reshape(-1, n).T,
    }


def steady_arrays(stability: "Stability") -> dict[str, NDArray[Any]]:
    """All 2n eigenvalues (1/s), and the n coordinates of steady sliding with names and units."""
    return {
        "eigenvalues": stability.eigenvalues,
        "coordinates": np.array(stability.coordinates),
        "coordinate_units": np.array([unit_of(name) for name in stability.coordinates]),
        "steady_state": stability.steady_state,
    }
