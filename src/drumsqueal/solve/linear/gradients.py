"""Derivatives of eigenvalues with respect to a scene's numbers, by left and right eigenvectors."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from drumsqueal.scene import Scene
from drumsqueal.solve.linear.family import linear_of

StateMatrix = Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]]


def state_matrix_of(scene: Scene, keys: tuple[str, ...]) -> StateMatrix:
    """The state matrix A (2n, 2n) and ∂A/∂p (k, 2n, 2n) as a function of the numbers p (k,) with these keys, in SI.

    By automatic differentiation of the model's own linearisation, one number after the other in one program, which is
    compiled at the first call.
    """
    linear, size = linear_of(scene), len(keys)

    def matrix(values: Array) -> Array:
        return linear({key: values[k] for k, key in enumerate(keys)}).state_matrix()

    @jax.jit
    def with_derivatives(values: Array) -> tuple[Array, Array]:
        return jax.lax.map(lambda direction: jax.jvp(matrix, (values,), (direction,)), jnp.eye(size))

    def evaluate(values: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        matrices, derivatives = with_derivatives(jnp.asarray(values, dtype=jnp.float64))
        return np.asarray(matrices[0]), np.asarray(derivatives)

    return evaluate


def eigenvalue_gradient(left: NDArray, right: NDArray, derivatives: NDArray[np.float64]) -> NDArray[np.complex128]:
    """∂λ/∂p (k,) = lᴴ (∂A/∂p) r of one simple eigenvalue, with lᴴ r = 1; `derivatives` (k, 2n, 2n).

    Source: P. Lancaster, "On eigenvalues of matrices dependent on a parameter", Numerische Mathematik 6, 1964.
    """
    return np.einsum("i,kij,j->k", left.conj(), derivatives, right)
