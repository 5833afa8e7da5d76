"""What the contact asks of a quadrature over the lining, and several sums over the same nodes in one pass."""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.physics.quadrature.levels import Level

Densities = dict[str, Array]
"""What is summed, by name: its value times the weight at each node."""


class Lining(Protocol):
    """The surface that is integrated over: |θ| ≤ half_angle (rad) on a radius (m), and a width (m) across."""

    @property
    def outer_radius(self) -> Any:
        """R (m)."""
        ...

    @property
    def half_angle(self) -> Array:
        """β/2 (rad)."""
        ...

    @property
    def width(self) -> Any:
        """b (m)."""
        ...

    @property
    def area(self) -> Array:
        """R β b (m²)."""
        ...


class Nodes(NamedTuple):
    """Quadrature nodes on the lining: cos θ, sin θ, z (m, None on the line z = 0) and weight (m²)."""

    cosine: Array
    sine: Array
    z: Array | None
    weight: Array


class Boundaries(NamedTuple):
    """The levels whose roots are boundaries: k (u0 + u_r), V_θ, and V_z (None: no boundaries of that kind).

    Where the pressure's level is negative the lining does not press; V_z is the same all across the lining. The slip
    speeds that cut the friction law are its `breakpoints` (K,), rising, in m/s; `kinks` are those of them that a
    quadrature has to cut it at, too, that is graded towards where the slip vanishes. Unless `lifted` counts, what is
    summed is zero where the lining does not press. What is summed `rarely` may take longer for a shorter program. The
    pressure is not smooth where one of the levels `knots`, with a constant (K,), is zero: cut there, in the plane.
    """

    pressure: Level | None
    slip: Level | None
    axial: Level | None
    breakpoints: Array
    kinks: Array
    lifted: bool
    rarely: bool = False
    knots: Level | None = None


def resolved(speeds: Array, slowest: Array, fastest: Array) -> Array:
    """Whether the friction law needs no cuts at its slip speeds (K,) where the slip is between two others (m/s)."""
    if speeds.size == 0:
        return jnp.asarray(True)
    bounds = jnp.concatenate([jnp.zeros(1), speeds, jnp.full(1, jnp.inf)])
    width = bounds[1:] - bounds[:-1]
    met = (bounds[:-1] < fastest) & (bounds[1:] > slowest)
    # Slip speeds that lie within a third of a stretch of the friction law are resolved by a quadrature that does not
    # look for them. Of exp(−α s) that is a factor of exp(4), and eight Gauss nodes on each piece of the arc err by
    # 1.5e-11.
    return ~jnp.any(met & (fastest - slowest > (1 / 3) * width)) & (jnp.sum(met) < 2)


class Surface(Protocol):
    """A quadrature; `spatial` says whether it knows that the lining is wide."""

    @property
    def spatial(self) -> bool:
        """Whether the nodes differ across the lining."""
        ...

    def integrate(self, lining: Lining, boundaries: Boundaries, densities: Callable[[Any], Any]) -> Densities:
        """Sums over the lining of densities times weights, which are smooth between the boundaries."""
        ...


def sum_together(found: Densities) -> Densities:
    """Sum of each density over all nodes.

    Over the first of several axes it is summed first: that fills the lanes of a processor, where a running sum waits
    for each of its terms.
    """
    return _reduce(sum_over_points(found) if next(iter(found.values())).ndim > 1 else found)


@jax.custom_jvp
def _reduce(densities: Densities) -> Densities:
    """One reduction with several operands is one loop in the compiled program.

    Separate sums are one loop each, and XLA computes what they share, an exponential excepted, once for each of them.
    """
    shape = next(iter(densities.values())).shape
    zeros = jax.tree.map(lambda density: np.zeros((), density.dtype), densities)
    return jax.lax.reduce(densities, zeros, _add, tuple(range(len(shape))))


def _add(one: Densities, other: Densities) -> Densities:
    return jax.tree.map(jnp.add, one, other)


@_reduce.defjvp
def _(densities: tuple[Densities], tangents: tuple[Densities]) -> tuple[Densities, Densities]:
    return _reduce(*densities), jax.tree.map(jnp.sum, *tangents)


@jax.custom_jvp
def sum_over_points(densities: dict[Any, Array]) -> dict[Any, Array]:
    """Sums over the first axis alone, in one loop."""
    zeros = jax.tree.map(lambda density: np.zeros((), density.dtype), densities)
    return jax.lax.reduce(densities, zeros, _add, (0,))


@sum_over_points.defjvp
def _(densities: tuple[dict], tangents: tuple[dict]) -> tuple[dict, dict]:
    return sum_over_points(*densities), jax.tree.map(lambda tangent: jnp.sum(tangent, axis=0), *tangents)
