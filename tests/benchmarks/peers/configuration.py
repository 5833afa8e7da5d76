"""What a peer is: a solver with a right-hand side written by hand, behind one interface.

All of them see the state divided by its typical amplitude, and the tolerance as relative and as absolute one: a
component is resolved to the tolerance times the larger of its amplitude and its present value.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from . import parameters as p

MOST_STEPS = 100_000  # between two samples


class Outcome(NamedTuple):
    """States (len(times), 6) in SI and evaluations of the right-hand side."""

    states: np.ndarray
    evaluations: int


class Configuration(NamedTuple):
    """A solver with a right-hand side: scaled states from (parameters, scaled start, times, tolerance)."""

    name: str
    integrate: Callable[[np.ndarray, np.ndarray, np.ndarray, float], np.ndarray]

    def solve(self, parameters: np.ndarray, start: np.ndarray, times: np.ndarray, tolerance: float) -> Outcome:
        """Sample the transient from the state `start` (6,) at the times (s); raises RuntimeError where it fails."""
        parameters = parameters.copy()  # for its counter
        parameters[p.EVALUATIONS] = 0
        scale = parameters[p.SCALE : p.SCALE + 6].copy()
        states = self.integrate(parameters, start / scale, times, tolerance)
        if states.shape != (len(times), 6) or not np.isfinite(states).all():
            raise RuntimeError(f"{self.name} failed at tolerance {tolerance}")
        return Outcome(states * scale, int(parameters[p.EVALUATIONS]))

    def warm_up(self, parameters: np.ndarray, start: np.ndarray) -> None:
        """Compile, apart from any timing."""
        self.solve(parameters, start, np.linspace(0.0, 1e-4, 6), 1e-6)
