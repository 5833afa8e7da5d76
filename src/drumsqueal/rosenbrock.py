"""A linearly implicit method for stiff sliding: no equations to iterate on, which edges of contact would throw off."""

from collections.abc import Callable
from typing import Any, ClassVar

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

# RODAS4 (Hairer & Wanner, Solving Ordinary Differential Equations II, section IV.7 and their code): six stages of order
# four with an embedded third, stiffly accurate and L-stable; in the variables U of that section, C divided by h.
GAMMA = 0.25
SHARES = np.array([0.0, 0.386, 0.21, 0.63, 1.0, 1.0])
TIME_WEIGHTS = np.array([0.25, -0.1043, 0.1035, -0.0362, 0.0, 0.0])
STAGES = np.zeros((6, 6))
STAGES[1, :1] = 1.544
STAGES[2, :2] = 0.9466785280815826, 0.2557011698983284
STAGES[3, :3] = 3.314825187068521, 2.896124015972201, 0.9986419139977817
STAGES[4, :4] = 1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950
STAGES[5, :5] = *STAGES[4, :4], 1.0
COUPLING = np.zeros((6, 6))
COUPLING[1, :1] = -5.6688
COUPLING[2, :2] = -2.430093356833875, -0.2063599157091915
COUPLING[3, :3] = -0.1073529058151375, -9.594562251023355, -20.47028614809616
COUPLING[4, :4] = 7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160
COUPLING[5, :5] = 8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054
DENSE = np.zeros((2, 6))
DENSE[0, :5] = 10.12623508344586, -7.487995877610167, -34.80091861555747, -7.992771707568823, 1.025137723295662
DENSE[1, :5] = -0.6762803392801253, 6.087714651680015, 16.43084320892478, 24.76722511418386, -6.594389125716872


class _Interpolation(diffrax.AbstractLocalInterpolation):
    """y(t0 + s h) = (1 − s) y0 + s (y1 + (1 − s) (k1 + s k2)), of third order."""

    t0: Any
    t1: Any
    y0: Array
    y1: Array
    first: Array
    second: Array

    def evaluate(self, t0: Any, t1: Any = None, left: bool = True) -> Array:
        """The state at a time, or its change between two."""
        del left  # it is continuous
        if t1 is not None:
            return self.evaluate(t1) - self.evaluate(t0)
        s = (t0 - self.t0) / (self.t1 - self.t0)
        return (1 - s) * self.y0 + s * (self.y1 + (1 - s) * (self.first + s * self.second))


class Rodas4(diffrax.AbstractAdaptiveSolver):
    """One step of RODAS4: (1/(γh) − J) U_i = f(t0 + c_i h, y0 + Σ a_ij U_j) + Σ C_ij U_j / h + γ_i h ∂f/∂t.

    The state is one array (n,). The Jacobian J is the forces' own, by automatic differentiation, at every step.
    """

    term_structure: ClassVar = diffrax.ODETerm
    interpolation_cls: ClassVar[Callable[..., diffrax.AbstractLocalInterpolation]] = _Interpolation

    def order(self, terms: diffrax.AbstractTerm) -> int:
        """Order of convergence."""
        del terms
        return 4

    def func(self, terms: diffrax.AbstractTerm, t0: Any, y0: Array, args: Any) -> Array:
        """Evaluate the vector field."""
        return terms.vf(t0, y0, args)

    def init(self, terms: diffrax.AbstractTerm, t0: Any, t1: Any, y0: Array, args: Any) -> None:
        """Nothing is carried from step to step."""

    def step(
        self, terms: diffrax.AbstractTerm, t0: Any, t1: Any, y0: Array, args: Any, solver_state: None, made_jump: Any
    ) -> tuple[Array, Array, dict[str, Any], None, diffrax.RESULTS]:
        """Make one step: y1, its error estimate, and what the interpolation needs."""
        del solver_state, made_jump
        start, h = jnp.asarray(t0), jnp.asarray(t1) - t0

        def field(t: Array, y: Array) -> Array:
            return terms.vf(t, y, args)

        jacobian = jax.jacfwd(lambda y: field(start, y))(y0)
        drift = jax.jvp(lambda t: field(t, y0), (start,), (jnp.ones(()),))[1]
        factors = _factorised(jnp.eye(y0.size) / (GAMMA * h) - jacobian)
        stages, coupling = jnp.asarray(STAGES), jnp.asarray(COUPLING)
        shares, weights = jnp.asarray(SHARES), jnp.asarray(TIME_WEIGHTS)

        def stage(i: Array, found: tuple[Array, Array]) -> tuple[Array, Array]:
            slopes, _ = found
            y = y0 + sum(stages[i, j] * slopes[j] for j in range(5))
            right = field(start + shares[i] * h, y) + sum(coupling[i, j] * slopes[j] for j in range(5)) / h
            return slopes.at[i].set(_solved(factors, right + weights[i] * h * drift)), y

        slopes, y = jax.lax.fori_loop(0, 6, stage, (jnp.zeros((6, y0.size)), y0))
        error = slopes[5]
        first, second = (sum(float(w) * slopes[j] for j, w in enumerate(row) if w != 0) for row in DENSE)
        dense = {"y0": y0, "y1": y + error, "first": first, "second": second}
        return y + error, error, dense, None, diffrax.RESULTS.successful


def _factorised(matrix: Array) -> Array:
    """L and U (n, n) in one. Without exchanges: 1/(γh) is on the diagonal, and damping adds to it."""
    for i in range(matrix.shape[0] - 1):
        column = matrix[i + 1 :, i] / matrix[i, i]
        matrix = matrix.at[i + 1 :, i].set(column)
        matrix = matrix.at[i + 1 :, i + 1 :].add(-column[:, None] * matrix[i, i + 1 :])
    return matrix


def _solved(factors: Array, right: Array) -> Array:
    count = right.size
    for i in range(count - 1):
        right = right.at[i + 1 :].add(-factors[i + 1 :, i] * right[i])
    for i in reversed(range(count)):
        right = right.at[i].set(right[i] / factors[i, i])
        right = right.at[:i].add(-factors[:i, i] * right[i])
    return right
