"""Accelerations at recorded states: what the equation of motion says of them, not a difference of velocities."""

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike, NDArray

from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.physics.model import Model
from drumsqueal.programs import compiled
from drumsqueal.solve.transient.sticking import stuck_model

_BLOCK = 512  # states at a time, so that one program serves records of every length and Ctrl-C responds


def accelerations(
    model: Model,
    times: ArrayLike,
    displacement: ArrayLike,
    velocity: ArrayLike,
    sticks: ArrayLike,
    memory: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """q̈ = M⁻¹ Σ Q(t, q, q̇) at k times (s), displacements and velocities (k, n) in SI, shape (k, n).

    `memory` (k, m) is what effects remembered, if any does.
    Where the lining `sticks` (k,) to the drum as a whole, friction is what makes the motion the drum's own. Raises
    KeyboardInterrupt between two blocks.
    """
    t, q, v = (np.asarray(x, dtype=np.float64) for x in (times, displacement, velocity))
    stuck = np.asarray(sticks, dtype=bool)
    result = np.empty_like(q)
    for which, acting in ((~stuck, model), (stuck, stuck_model(model) if stuck.any() else model)):
        rows = np.flatnonzero(which)
        for first in range(0, rows.size, _BLOCK):
            stop_if_interrupted()
            block = rows[first : first + _BLOCK]
            filled = np.resize(block, _BLOCK)
            result[block] = np.asarray(
                _accelerations(acting, t[filled], q[filled], v[filled], None if memory is None else memory[filled])
            )[: block.size]
    return result


@compiled
def _accelerations(model: Model, times: Array, displacement: Array, velocity: Array, memory: Array | None) -> Array:
    states = jax.tree.map(jnp.asarray, (times, displacement, velocity, memory))
    return jax.lax.map(lambda state: model.rates(*state)[0] / model.mass, states)
