"""Nodes on [0, 1] that crowd towards zero as closely as a singularity there wants.

x = δ sinh(T φ(t)), sinh T = 1/δ, takes a singularity at the distance δ off zero away from the real axis (Johnston &
Elliott, Int. J. Numer. Meth. Engng 62 (2005) 564; there φ = t). The flatter end of φ spares most of the nodes that the
steep one of the sinh calls for.
"""

import jax.numpy as jnp
import numpy as np
from jax import Array

# φ = 2t − 1.4t² + 0.4t³. With sixteen nodes and δ ≥ 1e-6, square roots, logarithms and their products with
# polynomials and sines are integrated to 2e-11, against 4e-5 with φ = t and 3e-9 with φ = (3t − t²)/2.
FIRST, SECOND, THIRD = 2.0, -1.4, 0.4
WIDEST = 10.0  # a singularity further off than so many lengths is not felt


def graded(distance: Array, count: int, narrowest: float) -> tuple[Array, Array]:
    """Points and weights (..., count) on [0, 1] for singularities at the distance (...) from zero."""
    scale = jnp.clip(distance, narrowest, WIDEST)[..., None]
    stretch = jnp.arcsinh(1 / scale)
    point, weight = np.polynomial.legendre.leggauss(count)
    t = (point + 1) / 2
    bent = t * (FIRST + t * (SECOND + t * THIRD))
    bent_weight = weight / 2 * (FIRST + t * (2 * SECOND + t * 3 * THIRD))
    growth = jnp.exp(stretch * bent)
    return scale * (growth - 1 / growth) / 2, scale * stretch * (growth + 1 / growth) / 2 * bent_weight
