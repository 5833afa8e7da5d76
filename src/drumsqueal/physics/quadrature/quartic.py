"""Roots of a quartic with complex coefficients, all four at once, without a library."""

import jax.numpy as jnp
import numpy as np
from jax import Array

# Aberth's iteration triples the right digits of simple roots and halves the error of a double one, where the boundaries
# that meet only touch.
ITERATIONS = 16
# Near the unit circle, where the roots are that count, and without a symmetry, which the iteration would keep.
START = np.array([0.9, 1.1, 0.95, 1.05]) * np.exp(1j * (0.4 + np.pi / 2 * np.arange(4)))


def quartic_roots(coefficients: Array) -> Array:
    """Roots (4,) of k0 + k1 x + k2 x² + k3 x³ + k4 x⁴; those at infinity come out large."""
    root = jnp.asarray(START)
    for _ in range(ITERATIONS):
        value, slope = coefficients[4] + 0 * root, 0 * root
        for k in (3, 2, 1, 0):
            slope = slope * root + value
            value = value * root + coefficients[k]
        apart = root[:, None] - root[None, :]
        alone = apart == 0
        push = jnp.sum(jnp.where(alone, 0.0, 1 / jnp.where(alone, 1.0, apart)), axis=1)
        steepness = slope - value * push
        flat = steepness == 0
        root = root - jnp.where(flat, 0.0, value / jnp.where(flat, 1.0, steepness))
    return root
