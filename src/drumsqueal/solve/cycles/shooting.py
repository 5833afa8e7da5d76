"""A periodic motion by Newton's method on the flow over a period (shooting)."""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from drumsqueal.physics.model import Model
from drumsqueal.solve.transient.flow import Flow, flow, state_size

TOLERANCE = 1e-10  # of the flow, as a scene's
CLOSED = 1e-10  # the largest scaled difference between a state and itself a period later that counts as none
PATIENCE, PROGRESS = 6, 0.1  # after so many steps the residual must have come down to this fraction
SINGULAR = 1e-11  # singular values below this fraction of the largest are none: a coordinate that nothing holds

Vector = NDArray[np.float64]
Models = Callable[[float], tuple[Model, Model | None]]
"""The model at a value of the parameter, and its derivative with respect to that (None: there is no parameter)."""


class ShootingStart(NamedTuple):
    """A state (2n,), displacement from q = 0 and velocity, a period (s), and where that comes from."""

    state: Vector
    period: float
    origin: str


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

    def __init__(
        self,
        models: Models,
        scale: Vector,
        on_flow: Callable[[], object] = lambda: None,
        flow: Callable[..., Flow] = flow,
    ) -> None:
        """Take the models along the parameter, and what state, period (s) and parameter (2n + 2,) are measured in.

        `on_flow` is called before each integration, which is done by `flow`.
        """
        self.models, self.scale, self._on_flow, self._follow = models, scale, on_flow, flow

    def in_units(self, units: Vector) -> "Shooting":
        """The same equations with unknowns in other units (2n + 2,), as multiples of the present ones."""
        return Shooting(self.models, self.scale * units, self._on_flow, self._follow)

    def scaled(self, state: Vector, period: float, parameter: float) -> Vector:
        """The unknowns (2n + 2,) of a state (m, m/s, rad, rad/s), a period (s) and a parameter."""
        return np.append(state, [period, parameter]) / self.scale

    def unscaled(self, unknowns: Vector) -> tuple[Vector, float, float]:
        """State, period and parameter."""
        values = unknowns * self.scale
        return values[:-2], float(values[-2]), float(values[-1])

    def flow(self, unknowns: Vector) -> Flow:
        """The flow over a period."""
        self._on_flow()
        _, period, parameter = self.unscaled(unknowns)
        model, change = self.models(parameter)
        return self._follow(model, self.scale[:-2], unknowns[:-2], period, TOLERANCE, change)

    def jacobian(self, found: Flow) -> Vector:
        """∂(φ − y)/∂(y, T, p) (2n, 2n + 2), scaled."""
        period, parameter = self.scale[-2:]
        transition = found.transition - np.eye(found.end.size)
        return np.column_stack([transition, found.rate * period, found.sensitivity * parameter])

    def moved(self, closed: Closed, direction: Vector, time: float) -> tuple[Closed, Vector]:
        """The same motion from a state on it that comes a time (s) later, and a direction (2n + 2,) taken there."""
        _, _, parameter = self.unscaled(closed.unknowns)
        model, change = self.models(parameter)
        found = self._follow(model, self.scale[:-2], closed.unknowns[:-2], time, TOLERANCE, change)
        unknowns = np.append(found.end, closed.unknowns[-2:])
        along = found.transition @ direction[:-2] + found.sensitivity * self.scale[-1] * direction[-1]
        return closed._replace(unknowns=unknowns, flow=self.flow(unknowns)), np.append(along, direction[-2:])

    def vibration(self, closed: Closed, steady: Vector) -> Vector:
        """A scaled state (2n,) from steady sliding q* (n,)."""
        return closed.unknowns[:-2] - np.append(steady, np.zeros_like(steady)) / self.scale[:-2]

    def close(self, guess: Vector, condition: Vector | None = None, phase: Vector | None = None) -> Closed | None:
        """Solve from a guess (2n + 2,); None where Newton's method does not get there.

        With `condition`·(x − guess) = 0, by default at the parameter of the guess. The phase condition is that the
        state moves from the guess at right angles to `phase` (2n,), by default the rate there. Steps are cut where the
        residual would not fall.
        """
        unknowns, found = guess, self.flow(guess)
        across = found.rate if phase is None else phase
        along = np.eye(guess.size)[-1] if condition is None else condition
        border = np.zeros((2, guess.size))
        border[0, :-2], border[1] = across / np.linalg.norm(across), along / np.linalg.norm(along)
        first = size = _size(found, unknowns)
        for count in range(15):  # steps of Newton
            if not np.isfinite(size) or (count >= PATIENCE and size > PROGRESS * first):
                return None
            right = np.concatenate([unknowns[:-2] - found.end, border @ (guess - unknowns)])
            matrix = np.concatenate([self.jacobian(found), border])
            # Least squares: a coordinate that nothing holds may stay where it is.
            step = np.linalg.lstsq(matrix, right, rcond=SINGULAR)[0]
            longest = float(np.max(np.abs(step)))
            # After a step of Newton of 1e-9 the next one would be round-off.
            if size < CLOSED and longest < 1e-9:
                return Closed(unknowns, found, size, count)
            step *= min(1.0, 0.3 / longest)  # of Newton, in the scale of the motion
            for _ in range(4):  # halvings
                trial = unknowns + step
                if not is_near(trial):
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


def is_near(unknowns: Vector) -> bool:
    """Whether state and period (2n + 2,), scaled, are not so far off that a search is lost."""
    worst = 30.0  # scaled state or ratio of periods beyond which a search is lost
    return bool(np.max(np.abs(unknowns[:-2])) < worst and 1 / worst < unknowns[-2] < worst)


def scale_near(model: Model, start: ShootingStart, steady: Vector, parameter: float = 1.0) -> Vector:
    """What state, period and parameter (2n + 2,) of a cycle are measured in, from a start near it."""
    n = len(steady)
    size = state_size(model, jnp.asarray(start.state[:n] - steady), jnp.asarray(start.state[n:]))
    return np.append(np.asarray(size), [start.period, parameter])


def _size(found: Flow, unknowns: Vector) -> float:
    sound = bool(found.reached) and all(np.all(np.isfinite(part)) for part in (found.transition, found.sensitivity))
    return float(np.max(np.abs(found.end - unknowns[:-2]))) if sound else np.inf
