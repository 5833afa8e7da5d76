"""Runs of small bodies, and what is read off them."""

from typing import NamedTuple

import equinox as eqx
import numpy as np
from jax import Array
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from drumsqueal.physics.laws.friction_law import ExponentialLaw
from drumsqueal.physics.model import Model
from drumsqueal.physics.small_bodies import block_on_belt
from drumsqueal.solve.linear.steady import linearise, steady_sliding
from drumsqueal.solve.transient.integrate import integrate


class Run(NamedTuple):
    """A transient: time (k,), displacement and velocity (k, n), energy error (k,), changes of sticking, steps."""

    time: np.ndarray
    displacement: np.ndarray
    velocity: np.ndarray
    balance_error: np.ndarray
    changes: tuple[tuple[float, bool], ...]
    steps: int

    def turns(self) -> tuple[np.ndarray, np.ndarray]:
        """Times at which the first coordinate turns round, and where: of a cubic through its values and velocities."""
        curve = CubicHermiteSpline(self.time, self.displacement[:, 0], self.velocity[:, 0])
        times = curve.derivative().roots(extrapolate=False)
        return times[np.isfinite(times)], curve(times[np.isfinite(times)])


def run(model: Model, displacement, velocity, *, steady=None, **how) -> Run:
    """Integrate a small body from a departure from steady sliding, or from where its springs have no load."""
    steady = np.zeros(len(model.names)) if steady is None else steady
    chunks = list(integrate(model, steady, np.array(displacement), np.array(velocity), **how))
    time, place, speed, error = (
        np.concatenate([getattr(chunk, name) for chunk in chunks])
        for name in ("time", "displacement", "velocity", "energy_balance_error")
    )
    changes = tuple(change for chunk in chunks for change in chunk.changes)
    return Run(time, place, speed, error, changes, sum(chunk.steps for chunk in chunks))


class HyperbolicLaw(eqx.Module):
    """μ = 1/(1 + 3s) (Leine et al., Nonlinear Dynamics 16 (1998) 41)."""

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s)."""
        return 1 / (1 + 3 * slip_speed)


def falling_friction(belt_speed) -> Model:
    """x″ + 2ξ x′ + x = μ sgn(v_d − x′), μ = μ_d + Δμ exp(−|v|/v0); ξ = 0.05, μ_d = Δμ = v0 = 0.5."""
    return block_on_belt(ExponentialLaw(1.0, 0.5, 2.0), damping=0.1, belt_speed=belt_speed)


@eqx.filter_jit
def state_matrix(model: Model) -> Array:
    """Of the linear model about steady sliding (2n, 2n)."""
    return linearise(model, steady_sliding(model)).state_matrix()


def eigenvalues(model: Model) -> NDArray[np.complex128]:
    """All of them (2n,), the fastest growing first."""
    values = np.linalg.eigvals(np.asarray(state_matrix(model))).astype(np.complex128)
    return values[np.argsort(-values.real)]
