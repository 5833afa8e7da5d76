"""The reference: SciPy's DOP853 with 24 nodes a piece, confirmed by another solver with the fast right-hand side."""

from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from . import parameters as p
from .scalar import scalar_right_hand_side
from .solvers import MISSING, configuration

NODES = 24
TOLERANCE = 1e-13


class Reference(NamedTuple):
    """States (len(times), 6) in SI, and how far another solver with another right-hand side ends up from them."""

    states: np.ndarray
    uncertainty: float


def trajectory_error(states: np.ndarray, reference: np.ndarray) -> float:
    """Largest over the components of max |error| / max |reference| over the samples."""
    return float(np.max(np.max(np.abs(states - reference), axis=0) / np.max(np.abs(reference), axis=0)))


def solve_reference(parameters: np.ndarray, start: np.ndarray, times: np.ndarray) -> Reference:
    """The transient from `start` (6,) sampled at the times (s), as sharply as double precision lets it be."""
    parameters = parameters.copy()
    scale = parameters[p.SCALE : p.SCALE + 6].copy()
    slow = scalar_right_hand_side(NODES)

    def exact(time: float, state: np.ndarray) -> np.ndarray:
        del time
        rate = np.empty(6)
        slow(state, parameters, rate)
        return rate

    span = (times[0], times[-1])
    states = solve_ivp(exact, span, start / scale, "DOP853", times, rtol=TOLERANCE, atol=TOLERANCE).y.T
    # Another method and another right-hand side: SUNDIALS' Adams or, where it is missing, SciPy's LSODA.
    witness = configuration("SciPy LSODA, numba" if "scikit-sundae" in MISSING else "CVODE Adams, numba")
    other = witness.solve(parameters, start, times, TOLERANCE)
    return Reference(states * scale, trajectory_error(other.states, states * scale))
