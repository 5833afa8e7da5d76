"""What JAX is set to before it computes: double precision, asserted where numbers enter a model, in one thread.

The contact boundaries are found from differences of nearly equal numbers, and the growth of a squeal is followed over
many decades: single precision is of no use here, and JAX falls back to it silently unless told otherwise.
"""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.typing import ArrayLike

jax.config.update("jax_enable_x64", True)
# A program runs in the thread that calls it and waits for it. To wake another one for each chunk takes a tenth of a
# transient, and more where all processors are busy.
jax.config.update("jax_cpu_enable_async_dispatch", False)


def real(value: ArrayLike | Sequence[float] | Sequence[Sequence[float]]) -> Array:
    """Return `value` as a float64 array leaf, so that changing it never recompiles.

    A number becomes one of NumPy, with which to compute asks for no program, unless it is of JAX. Raises TypeError when
    JAX has been switched back to single precision.
    """
    if not jax.config.read("jax_enable_x64"):
        raise TypeError(
            "drumsqueal computes in float64, and JAX was switched to float32; "
            'leave jax.config.update("jax_enable_x64", True) as the import of drumsqueal set it'
        )
    of_jax = any(isinstance(part, Array) for part in jax.tree.leaves(value))
    if of_jax:
        return jnp.asarray(value, dtype=float)
    array: Any = np.array(value, dtype=np.float64)
    # Arrays may be indexed by traced values; a program of JAX's would copy them into place, which here they are.
    return array if array.ndim == 0 else jax.device_put(array)


def with_numbers_of_numpy(model: Any) -> Any:
    """The model, or a part of it, with its numbers of NumPy and its arrays of JAX, see `real`; traced ones stay."""

    def converted(leaf: Any) -> Any:
        if isinstance(leaf, Tracer) or not isinstance(leaf, Array | np.ndarray):
            return leaf  # a law given in Python may hold anything
        return np.asarray(leaf) if leaf.ndim == 0 else jax.device_put(leaf)

    return jax.tree.map(converted, model)
