"""Runs of small bodies, and what is read off them."""

import equinox as eqx
import numpy as np
from jax import Array
from numpy.typing import NDArray

from drumsqueal.physics.friction_law import ExponentialLaw
from drumsqueal.physics.model import Model
from drumsqueal.physics.small_bodies import block_on_belt
from drumsqueal.solve.linear.steady import linear_model
from drumsqueal.solve.motion import Motion, integrate


def run(model: Model, displacement, velocity, *, steady=None, duration, **how) -> Motion:
    """Integrate a small body from a displacement from steady sliding, or from where its springs have no load."""
    origin = np.zeros(len(model.names)) if steady is None else steady
    found = integrate(model, {"displacement": displacement, "velocity": velocity}, duration, origin=origin, **how)
    assert found.outcome == "complete"
    return found


class HyperbolicLaw(eqx.Module):
    """μ = 1/(1 + 3s) (Leine et al., Nonlinear Dynamics 16 (1998) 41)."""

    def coefficient(self, slip_speed: Array) -> Array:
        """μ at slip speeds s ≥ 0 (m/s)."""
        return 1 / (1 + 3 * slip_speed)


def falling_friction(belt_speed) -> Model:
    """x″ + 2ξ x′ + x = μ sgn(v_d − x′), μ = μ_d + Δμ exp(−|v|/v0); ξ = 0.05, μ_d = Δμ = v0 = 0.5."""
    return block_on_belt(ExponentialLaw(1.0, 0.5, 2.0), damping=0.1, belt_speed=belt_speed)


def eigenvalues(model: Model) -> NDArray[np.complex128]:
    """All of them (2n,), the fastest growing first."""
    values = np.linalg.eigvals(linear_model(model)[1].state_matrix()).astype(np.complex128)
    return values[np.argsort(-values.real)]
