"""The Runge-Kutta methods that a scene can ask for: diffrax's, the explicit ones with a loop over stages of our own."""

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.solve.transient.sdirk import Sdirk4, Stages


class Explicit(diffrax.AbstractAdaptiveSolver):
    """One step y1 = y0 + h Σ b_i k_i, k_i = f(t0 + c_i h, y0 + h Σ_j a_ij k_j), of an explicit method of diffrax.

    Its last stage is the first of the next step (FSAL). The state is one array (n,). Tableau, order and interpolation
    are the method's; the loop over its stages, which knows no more than it needs, takes 1.1 µs of a step of Dopri8 in
    the plane instead of 1.4. Written out stage by stage it takes three times as long, and to compile, too.
    """

    method: diffrax.AbstractERK
    term_structure: ClassVar = diffrax.ODETerm

    @property
    def interpolation_cls(self) -> Callable[..., diffrax.AbstractLocalInterpolation]:  # pyright: ignore
        """The method's interpolation."""
        return self.method.interpolation_cls

    def order(self, terms: diffrax.AbstractTerm) -> int | None:
        """Order of convergence."""
        return self.method.order(terms)

    def func(self, terms: diffrax.AbstractTerm, t0: Any, y0: Array, args: Any) -> Array:
        """Evaluate the vector field."""
        return terms.vf(t0, y0, args)

    def init(self, terms: diffrax.AbstractTerm, t0: Any, t1: Any, y0: Array, args: Any) -> Array:
        """The vector field at the start, which is the first stage."""
        del t1
        return terms.vf(t0, y0, args)

    def step(
        self,
        terms: diffrax.AbstractTerm,
        t0: Any,
        t1: Any,
        y0: Array,
        args: Any,
        solver_state: Array,
        made_jump: Any,
    ) -> tuple[Array, Array, dict[str, Any], Array, diffrax.RESULTS]:
        """Make one step: y1, its error estimate, what the interpolation needs, and the first stage of the next."""
        del made_jump  # nothing jumps
        tableau = self.method.tableau
        assert isinstance(tableau, diffrax.ButcherTableau)
        assert tableau.fsal
        weights, fractions = jnp.asarray(_weights(tableau)), jnp.asarray([0.0, *tableau.c])
        h = jnp.asarray(t1) - t0

        def stage(i: Array, stages: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
            slopes = stages[0]
            # Term by term over all that may come before: a product with the matrix is a loop of its own.
            y = y0 + h * sum(weights[i, j] * slopes[j] for j in range(tableau.num_stages - 1))
            slope = terms.vf(t0 + fractions[i] * h, y, args)
            return slopes.at[i].set(slope), y, slope

        slopes = jnp.zeros((tableau.num_stages, y0.size)).at[0].set(solver_state)
        slopes, y1, last = jax.lax.fori_loop(1, tableau.num_stages, stage, (slopes, y0, solver_state))
        error = h * sum(float(b) * slopes[j] for j, b in enumerate(tableau.b_error) if b != 0)
        return y1, error, {"y0": y0, "y1": y1, "k": h * slopes}, last, diffrax.RESULTS.successful


_EXPLICIT: Mapping[str, diffrax.AbstractERK] = {
    "tsit5": diffrax.Tsit5(),
    "dopri5": diffrax.Dopri5(),
    "dopri8": diffrax.Dopri8(),
}
DEFAULT = "dopri8"
IMPLICIT = "sdirk4"
AUTO = "auto"  # one of these two, as it comes
SOLVERS = (*_EXPLICIT, IMPLICIT)
"""What `simulate.solver` can be, besides "auto"."""
STAGES: Mapping[str, int] = {"tsit5": 6, "dopri5": 6, "dopri8": 13}
"""Evaluations of the vector field a step, of the explicit methods."""


LOCAL_FRACTION: Mapping[str, float] = {"tsit5": 0.005, "dopri5": 0.002, "dopri8": 0.01, "sdirk4": 0.01}
"""Fraction of a scene's tolerance that one step may err: errors add up over some thousand steps.

Over the growth phase of the shipped scenes the trajectory is then off by no more than ten times the tolerance, and
mostly by about as much (see `drumsqueal accuracy`).
"""


def stage_weights(name: str) -> np.ndarray:
    """The matrix a_ij (s, s) of an explicit method, whose last stage lies at the end of the step."""
    tableau = _EXPLICIT[name].tableau
    assert isinstance(tableau, diffrax.ButcherTableau)
    return _weights(tableau)


def _weights(tableau: diffrax.ButcherTableau) -> np.ndarray:
    matrix = np.zeros((tableau.num_stages, tableau.num_stages))
    for row, coefficients in enumerate(tableau.a_lower, start=1):
        matrix[row, :row] = coefficients
    return matrix


def is_explicit(name: str) -> bool:
    """Whether a method solves no equations."""
    return name in _EXPLICIT


def make_solver(name: str, stages: Stages) -> Any:
    """The method of that name; `stages` is what an implicit one asks for."""
    return Explicit(_EXPLICIT[name]) if is_explicit(name) else Sdirk4(stages)
