"""SUNDIALS' CVODE through scikit-sundae, with the right-hand side compiled by numba."""

import numpy as np
from sksundae.cvode import CVODE  # pyright: ignore[reportMissingImports]

from .configuration import MOST_STEPS, Configuration
from .right_hand_side import right_hand_side


def _adams(parameters: np.ndarray, start: np.ndarray, times: np.ndarray, tolerance: float) -> np.ndarray:
    def function(time, state, rate):
        right_hand_side(state, parameters, rate)

    options = {"rtol": tolerance, "atol": tolerance, "max_num_steps": MOST_STEPS}
    return CVODE(function, method="Adams", **options).solve(times, start).y


CONTENDERS = (Configuration("CVODE Adams, numba", _adams),)
