"""Several sums over the same nodes in one pass."""

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

Densities = dict[str, Array]


@jax.custom_jvp
def sum_together(densities: Densities) -> Densities:
    """Sum of each of the densities, all of one shape.

    One reduction with several operands is one loop in the compiled program; separate sums are one loop each, and XLA
    computes what they share, an exponential excepted, once for every one of them.
    """
    shape = next(iter(densities.values())).shape
    zeros = jax.tree.map(lambda density: np.zeros((), density.dtype), densities)
    return jax.lax.reduce(densities, zeros, _add, tuple(range(len(shape))))


def _add(one: Densities, other: Densities) -> Densities:
    return jax.tree.map(jnp.add, one, other)


@sum_together.defjvp
def _(densities: tuple[Densities], tangents: tuple[Densities]) -> tuple[Densities, Densities]:
    return sum_together(*densities), jax.tree.map(jnp.sum, *tangents)
