"""Steps that end where the force has a kink, so that none goes over it: its order holds on either side only.

Over a kink the error falls like the second or third power of the step, not the ninth, and the estimate of it is none.
Over the growing transient of the nominal scene, beyond its contact boundaries, that takes a third fewer steps at equal
error.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array

HALVINGS = 10  # of a step: to look closer takes time and makes no fewer steps


def fraction_to_kink(kinks: Callable[[Any], Array]) -> Array:
    """Fraction of a step just after which the first kink lies, by halving; 1 where there is none, or right at its start.

    `kinks` gives numbers (k,) at a fraction of the step, of which one changes its sign there.
    """
    before, after = kinks(0.0) > 0, kinks(1.0) > 0

    def halve(now: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        low, high, count = now
        middle = (low + high) / 2
        passed = jnp.any((kinks(middle) > 0) != before)
        return jnp.where(passed, low, middle), jnp.where(passed, middle, high), count + 1

    start = jnp.zeros(()), jnp.ones(()), jnp.where(jnp.any(before != after), 0, HALVINGS)
    low, high, _ = jax.lax.while_loop(lambda now: now[2] < HALVINGS, halve, start)
    return jnp.where(low > 0, high, 1.0)
