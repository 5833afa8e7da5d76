"""SciPy's solvers, with the right-hand side compiled by numba or in NumPy."""

import warnings
from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.integrate import ODEintWarning, odeint, solve_ivp

from .configuration import MOST_STEPS, Configuration
from .plain import PlainRightHandSide
from .right_hand_side import right_hand_side

Vector = Callable[[float, np.ndarray], np.ndarray]


def _vector(parameters: np.ndarray) -> Vector:
    """The fast right-hand side as SciPy calls it."""

    def function(time: float, state: np.ndarray) -> np.ndarray:
        del time
        rate = np.empty(6)
        right_hand_side(state, parameters, rate)
        return rate

    return function


def _dop853(make: Callable[[np.ndarray], Vector]):
    def integrate(parameters, start, times, tolerance):
        span = (times[0], times[-1])
        return solve_ivp(make(parameters), span, start, "DOP853", times, rtol=tolerance, atol=tolerance).y.T

    return integrate


def _lsoda(make: Callable[[np.ndarray], Vector]):
    # odeint drives the same LSODA as solve_ivp does, with the loop over the samples in C.
    def integrate(parameters, start, times, tolerance):
        options = {"rtol": tolerance, "atol": tolerance, "mxstep": MOST_STEPS, "tfirst": True, "full_output": True}
        with warnings.catch_warnings(action="ignore", category=ODEintWarning):  # the report says the same
            states, report = odeint(make(parameters), start, times, **options)
        return states if report["message"] == "Integration successful." else np.full_like(states, np.nan)

    return integrate


CONTENDERS = (
    Configuration("SciPy LSODA, numba", _lsoda(_vector)),
    Configuration("SciPy DOP853, numba", _dop853(_vector)),
    # A finer grid costs more an evaluation and has smaller kinks: which of them is better depends on the error.
    Configuration("SciPy LSODA, NumPy, 200 points", _lsoda(partial(PlainRightHandSide, grid=200))),
    Configuration("SciPy DOP853, NumPy, 200 points", _dop853(partial(PlainRightHandSide, grid=200))),
    Configuration("SciPy LSODA, NumPy, 1000 points", _lsoda(partial(PlainRightHandSide, grid=1000))),
)
