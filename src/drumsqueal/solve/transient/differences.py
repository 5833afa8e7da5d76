"""The flow over a time and its derivatives by transients that begin next to each other.

They use the program of a run, so that nothing is compiled. `flow.py` has derivatives to the last digit, and compiles.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drumsqueal.physics.model import Model
from drumsqueal.solve.transient.flow import Flow
from drumsqueal.solve.transient.integrate import integrate

TOLERANCE = 1e-9  # of the transients
# How far neighbours begin from each other, in the size of the motion, and in its time: half of the digits are then
# lost to their round-off and as many to their curvature.
APART = TOLERANCE**0.5
SAMPLES = 16  # of a transient, of which the last is used
FALLS = 1 / 3  # from flow to flow, of what a motion misses itself by: derivatives of an earlier state still serve

Vector = NDArray[np.float64]


class Neighbours:
    """Flows of one model at constant speed and load, as `flow` has them; they count the steps.

    Derivatives are those of an earlier state while what a motion misses itself by falls to a third from flow to flow,
    as it does in Newton's method: they take 2n + 2 transients, and the end takes one.
    """

    def __init__(self, steady: Vector, solver: str, before: Callable[["Neighbours"], None]) -> None:
        """Take steady sliding (n,), the method of the run, and what is called `before` each transient."""
        self._steady, self._solver, self._before, self.steps = steady, solver, before, 0
        self.forget()

    def forget(self) -> None:
        """Find derivatives anew with the next flow."""
        self._missed, self._derivatives = 0.0, (np.zeros(0), np.zeros(0))

    def __call__(self, model: Model, size: Vector, state: Vector, duration: float, *_: Any) -> Flow:
        """The flow from a state (2n,), in units of `size` (2n,). Raises IntegrationError where it fails."""
        there = self._end(model, size, state, duration)
        missed, before = float(np.max(np.abs(there - state))), self._missed
        self._missed = missed
        if missed > FALLS * before:
            self._derivatives = self.derivatives(model, size, state, duration, there)
        transition, rate = self._derivatives
        return Flow(there, rate, transition, np.zeros_like(there), 0, reached=True)

    def derivatives(
        self, model: Model, size: Vector, state: Vector, duration: float, there: Vector
    ) -> tuple[Vector, Vector]:
        """∂y(T)/∂y(0) (2n, 2n) and ẏ(T) (2n,) of a flow that ends `there`."""
        moved = [self._end(model, size, state + APART * direction, duration) for direction in np.eye(state.size)]
        n = len(self._steady)
        later = APART * float(np.min(size[:n] / size[n:]))
        rate = (self._end(model, size, state, duration + later) - there) / later
        return np.stack([(each - there) / APART for each in moved], axis=1), rate

    def _end(self, model: Model, size: Vector, state: Vector, duration: float) -> Vector:
        return self.samples(model, state * size, duration, SAMPLES)[-1] / size

    def samples(self, model: Model, state: Vector, duration: float, count: int, tolerance: float = TOLERANCE) -> Vector:
        """So many states (count + 1, 2n) from one, evenly over a duration (s), both ends included."""
        self._before(self)
        n = len(self._steady)
        how: Any = {"duration": duration, "sample_rate": count / duration, "tolerance": tolerance}
        chunks = list(integrate(model, self._steady, state[:n] - self._steady, state[n:], solver=self._solver, **how))
        self.steps += sum(chunk.steps for chunk in chunks)
        return np.vstack([np.hstack([each.displacement, each.velocity]) for each in chunks])
