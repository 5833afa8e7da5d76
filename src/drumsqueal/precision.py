"""What JAX is set to before it computes: double precision, asserted where numbers enter a model, in one thread.

The contact boundaries are found from differences of nearly equal numbers, and the growth of a squeal is followed over
many decades: single precision is of no use here, and JAX falls back to it silently unless told otherwise.
"""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

jax.config.update("jax_enable_x64", True)
# A program runs in the thread that calls it and waits for it. To wake another one for each chunk takes a tenth of a
# transient, and more where all processors are busy.
jax.config.update("jax_cpu_enable_async_dispatch", False)


def real(value: ArrayLike | Sequence[float] | Sequence[Sequence[float]]) -> Array:
    """Return `value` as a float64 array leaf, so that changing it never recompiles.

    Raises TypeError when JAX has been switched back to single precision.
    """
    array = jnp.asarray(value, dtype=float)
    if array.dtype != jnp.float64:
        raise TypeError(
            f"drumsqueal computes in float64, but JAX gave {array.dtype}; "
            'leave jax.config.update("jax_enable_x64", True) as the import of drumsqueal set it'
        )
    return array
