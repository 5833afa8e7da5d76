"""numbalsoda's solvers, which call the right-hand side compiled by numba without a detour through Python."""

import numpy as np
from numba import carray, cfunc  # pyright: ignore[reportMissingImports, reportPrivateImportUsage, reportAttributeAccessIssue]
from numbalsoda import dop853, lsoda, lsoda_sig  # pyright: ignore[reportMissingImports]

from . import parameters as p
from .configuration import MOST_STEPS, Configuration
from .right_hand_side import right_hand_side


@cfunc(lsoda_sig)
def callback(time, state, rate, parameters):
    """The fast right-hand side as a C function (time, state, rate, parameters)."""
    right_hand_side(carray(state, (6,)), carray(parameters, (p.SIZE,)), carray(rate, (6,)))


def _lsoda(parameters: np.ndarray, start: np.ndarray, times: np.ndarray, tolerance: float) -> np.ndarray:
    states, succeeded = lsoda(callback.address, start, times, parameters, tolerance, tolerance, MOST_STEPS)
    return states if succeeded else np.full_like(states, np.nan)


def _dop853(parameters: np.ndarray, start: np.ndarray, times: np.ndarray, tolerance: float) -> np.ndarray:
    # Its solve_ivp interpolates in every step, not only in those that hold a sample: a sixth more evaluations.
    states, succeeded = dop853(callback.address, start, times, parameters, tolerance, tolerance, MOST_STEPS)
    return states if succeeded else np.full_like(states, np.nan)


CONTENDERS = (Configuration("numbalsoda LSODA", _lsoda), Configuration("numbalsoda DOP853", _dop853))
