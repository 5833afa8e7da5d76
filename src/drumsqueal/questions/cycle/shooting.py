"""Newton's method on the flow map: states that come back to themselves after a period."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.physics.model import Model
from drumsqueal.solve.transient.flow import Flow, flow

TOLERANCE = 1e-10  # of the flow, as a scene's
CLOSED = 1e-10  # the largest scaled difference between a state and itself a period later that counts as none
SETTLED = 1e-9  # the largest scaled step of Newton after which the next one would be round-off
NEWTON_STEPS = 15
HALVINGS = 4
PATIENCE, PROGRESS = 6, 0.1  # after so many steps the residual must have come down to this share
LONGEST_STEP = 0.3  # of Newton, in the scale of the motion
WORST = 30.0  # scaled state or ratio of periods beyond which a search is lost
SINGULAR = 1e-11  # singular values below this fraction of the largest are none: a coordinate that nothing holds

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Models = Callable[[float], tuple[Model, Model | None]]
"""The model at a value of the parameter, and its derivative with respect to that (None: there is no parameter)."""


class Scales(NamedTuple):
    """What unknowns are measured in: states (2n,), the period (s) and the parameter."""

    state: Vector
    period: float
    parameter: float


class Closed(NamedTuple):
    """A scaled state (2n,), period and parameter, (2n + 2,) in all, and the flow from there over a period.

    `residual` is the largest scaled difference between the state and itself a period later, `steps` how many Newton
    made.
    """

    unknowns: Vector
    flow: Flow
    residual: float
    steps: int


class Shooting:
    """The equations φ(y, T, p) − y = 0 with a phase condition and one more condition that fixes the parameter."""

    def __init__(self, models: Models, scales: Scales, on_flow: Callable[[], object] = lambda: None) -> None:
        """Take the models along the parameter, and the scales; `on_flow` is called before each integration."""
        self.models, self.scales, self._on_flow = models, scales, on_flow

    def scaled(self, state: Vector, period: float, parameter: float) -> Vector:
        """The unknowns (2n + 2,) of a state (m, m/s, rad, rad/s), a period (s) and a parameter."""
        numbers = [period / self.scales.period, parameter / self.scales.parameter]
        return np.concatenate([state / self.scales.state, numbers])

    def unscaled(self, unknowns: Vector) -> tuple[Vector, float, float]:
        """State, period and parameter."""
        period, parameter = unknowns[-2:] * [self.scales.period, self.scales.parameter]
        return unknowns[:-2] * self.scales.state, float(period), float(parameter)

    def flow(self, unknowns: Vector) -> Flow:
        """The flow over a period, as NumPy arrays."""
        self._on_flow()
        _, period, parameter = self.unscaled(unknowns)
        model, change = self.models(parameter)
        found = flow(model, self.scales.state, unknowns[:-2], period, TOLERANCE, change)
        return Flow(*(np.asarray(part) for part in found))

    def jacobian(self, found: Flow) -> Matrix:
        """∂(φ − y)/∂(y, T, p) (2n, 2n + 2), scaled."""
        columns = [found.rate * self.scales.period, found.sensitivity * self.scales.parameter]
        return np.column_stack([found.transition - np.eye(found.end.size), *columns])

    def close(self, guess: Vector, condition: Vector, phase: Vector | None = None) -> Closed | None:
        """Solve from a guess (2n + 2,), with `condition`·(x − guess) = 0; None where Newton does not get there.

        The phase condition is that the state moves from the guess at right angles to `phase` (2n,), by default the
        rate there. Steps are cut where the residual would not fall.
        """
        unknowns, found = guess, self.flow(guess)
        across = found.rate if phase is None else phase
        border = np.zeros((2, guess.size))
        border[0, :-2], border[1] = across / np.linalg.norm(across), condition / np.linalg.norm(condition)
        first = size = _size(found, unknowns)
        for count in range(NEWTON_STEPS):
            if not np.isfinite(size) or (count >= PATIENCE and size > PROGRESS * first):
                return None
            right = np.concatenate([unknowns[:-2] - found.end, border @ (guess - unknowns)])
            matrix = np.concatenate([self.jacobian(found), border])
            # Least squares: a coordinate that nothing holds may stay where it is.
            step = np.linalg.lstsq(matrix, right, rcond=SINGULAR)[0]
            longest = float(np.max(np.abs(step)))
            if size < CLOSED and longest < SETTLED:
                return Closed(unknowns, found, size, count)
            step *= min(1.0, LONGEST_STEP / longest)
            for _ in range(HALVINGS):
                trial = unknowns + step
                if _lost(trial):
                    return None
                following = self.flow(trial)
                now = _size(following, trial)
                if now < size or now < CLOSED:
                    break
                step /= 2
            else:
                # No step makes it smaller: that may be round-off, where it is small enough.
                return Closed(unknowns, found, size, count) if size < CLOSED else None
            unknowns, found, size = trial, following, now
        return None


def _size(found: Flow, unknowns: Vector) -> float:
    sound = bool(found.reached) and all(np.all(np.isfinite(part)) for part in (found.transition, found.sensitivity))
    return float(np.max(np.abs(found.end - unknowns[:-2]))) if sound else np.inf


def _lost(unknowns: Vector) -> bool:
    return not (np.max(np.abs(unknowns[:-2])) < WORST and 1 / WORST < unknowns[-2] < WORST)
