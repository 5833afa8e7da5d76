"""Several sums over the same nodes in one pass."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

Densities = dict[str, Array]
"""What is summed, by name: its value times the weight at each node."""


def sum_together(parts: Sequence[Densities]) -> Densities:
    """Sum of each density over all nodes of all parts; within one density all parts have one shape.

    The parts are added node by node first: that fills the lanes of a processor, where a running sum waits for each of
    its terms.
    """
    return _reduce(jax.tree.map(lambda *part: sum(part[1:], start=part[0]), *parts))


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
