"""Polynomials on [−1, 1] by the coefficients of their powers: through Gauss nodes, their roots and where they turn.

The axis of the coefficients is the first, so that the others fill the lanes of a processor. What is written out term
by term is traced once for each shape, by `jax.jit`, wherever it stands: within a program it costs nothing.
"""

from collections.abc import Callable
from functools import cache
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

T = TypeVar("T")


@cache
def gauss_nodes(order: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points and weights on [−1, 1]."""
    return np.polynomial.legendre.leggauss(order)


@cache
def to_powers(order: int) -> NDArray[np.float64]:
    """Coefficients of 1, s, s², … from the values at the Gauss nodes, (order, order)."""
    return np.asarray(np.linalg.inv(np.vander(gauss_nodes(order)[0], increasing=True)), dtype=np.float64)


@cache
def to_legendre(order: int) -> NDArray[np.float64]:
    """Coefficients of Legendre polynomials from the values at the Gauss nodes, (order, order)."""
    table = np.polynomial.legendre.legvander(gauss_nodes(order)[0], order - 1)
    return np.asarray(np.linalg.inv(table), dtype=np.float64)


@cache
def to_sides(order: int) -> NDArray[np.float64]:
    """Values at −1, the Gauss nodes and 1 from the values at the Gauss nodes, (order + 2, order)."""
    points = np.concatenate([[-1.0], gauss_nodes(order)[0], [1.0]])
    return np.vander(points, order, increasing=True) @ to_powers(order)


@cache
def to_slopes(order: int) -> NDArray[np.float64]:
    """Derivatives at the Gauss nodes from the values there, (order, order)."""
    powers = np.vander(gauss_nodes(order)[0], order, increasing=True)
    return powers[:, :-1] * np.arange(1, order) @ to_powers(order)[1:]


@cache
def lobatto(count: int) -> NDArray[np.float64]:
    """Points on [−1, 1], both ends among them, that crowd there."""
    return -np.cos(np.pi * np.linspace(0, 1, count))


def compute_once(some: Array, compute: Callable[[], T]) -> T:
    """What is computed, or zeros where there is nothing: XLA puts what is not in a branch into all that uses it."""
    compute = jax.jit(compute)  # traced once for both
    shapes = jax.eval_shape(compute)
    return jax.lax.cond(some, compute, lambda: jax.tree.map(lambda each: jnp.zeros(each.shape, each.dtype), shapes))


def applied(matrix: np.ndarray, values: Array, axis: int) -> Array:
    """A matrix (m, k) applied along an axis (k) of values.

    Products and sums, not a product of matrices: with a sum behind it, as in derivatives, XLA fails to compile that
    within a kernel.
    """
    wide = matrix.reshape(*matrix.shape, *[1] * (values.ndim - axis - 1))
    return jnp.sum(jnp.expand_dims(values, axis) * wide, axis=axis + 1)


@jax.jit
def evaluate(powers: Array, s: Array) -> Array:
    """Value at s of polynomials with coefficients (order, ...)."""
    s, *others, value = _spread(powers, s)
    for power in reversed(others):
        value = value * s + power
    return value


def _spread(powers: Array, s: Array) -> tuple[Array, ...]:
    """The point and the coefficients one by one, in the shape that a value has: spread once, not at every step."""
    shape = jnp.broadcast_shapes(powers.shape[1:], s.shape)
    powers = powers.reshape(len(powers), *[1] * (len(shape) + 1 - powers.ndim), *powers.shape[1:])
    return jnp.broadcast_to(s, shape), *jnp.unstack(jnp.broadcast_to(powers, (len(powers), *shape)))


def at_points(powers: Array, points: NDArray[np.float64]) -> Array:
    """Values (points, ...) of polynomials with coefficients (order, ...) at given points (points,)."""
    return applied(np.vander(points, len(powers), increasing=True), powers, 0)


@jax.jit
def with_slope(powers: Array, s: Array) -> tuple[Array, Array]:
    """Value at s of polynomials with coefficients (order, ...), two at least, and the derivative there."""
    s, *others, slope = _spread(powers, s)
    value = slope * s + others.pop()
    for power in reversed(others):
        slope = slope * s + value
        value = value * s + power
    return value, slope


@jax.jit
def square(powers: Array) -> Array:
    """Coefficients (2 order − 1, ...) of the square of polynomials with coefficients (order, ...)."""
    order, axes = len(powers), [(0, 0)] * (powers.ndim - 1)
    rows = (powers * power for power in jnp.unstack(powers))
    return sum(jnp.pad(row, [(k, order - 1 - k), *axes]) for k, row in enumerate(rows))  # pyright: ignore[reportReturnType]


@jax.custom_jvp
def moving_root(powers: Array, root: Array) -> Array:
    """A root of polynomials (order, ...) that was found without derivatives, with dx = −dp/p′ of theirs."""
    del powers
    return root


@moving_root.defjvp
def _moving_root(primals: tuple[Array, Array], tangents: tuple[Array, Array]) -> tuple[Array, Array]:
    powers, root = primals
    slope = jax.lax.stop_gradient(with_slope(powers, root)[1])
    steep = slope != 0
    return root, jnp.where(steep, -evaluate(tangents[0], root) / jnp.where(steep, slope, 1.0), 0.0)


@jax.jit
def derivative(powers: Array) -> Array:
    """Coefficients of the derivative, and a zero (order, ...)."""
    order = len(powers)
    factor = np.arange(1.0, order).reshape(-1, *[1] * (powers.ndim - 1))
    return jnp.concatenate([powers[1:] * factor, jnp.zeros_like(powers[:1])])


@jax.jit
def bracketed_root(powers: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Whether a polynomial changes sign between two points, and where."""
    first, last = evaluate(powers, low), evaluate(powers, high)
    there = first * last < 0
    start = low + (high - low) * jnp.where(there, first / jnp.where(there, first - last, 1.0), 0.5)

    def improve(_: int, state: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        low, high, s = state
        value, slope = with_slope(powers, s)
        left = value * first > 0
        low, high = jnp.where(left, s, low), jnp.where(left, high, s)
        step = s - value / jnp.where(slope == 0, 1.0, slope)
        return low, high, jnp.where((step >= low) & (step <= high), step, (low + high) / 2)

    return there, jax.lax.fori_loop(0, 6, improve, (low, high, start))[2]  # of Newton's method, held within the bracket


@jax.jit
def split_line(powers: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Turn of polynomials (order, ...) closest to zero, and roots below and above (2, ...): whether there, and where.

    One that does not turn has its only root below, up to 1.
    """
    shape, powers = powers.shape[1:], powers.reshape(len(powers), -1)
    slopes = derivative(powers)
    samples = 9  # where a polynomial on a line is looked at; what turns twice between two of them is missed
    value, slope = at_points(powers, lobatto(samples)), at_points(slopes, lobatto(samples))
    point = lobatto(samples)[:, None]
    turns = slope[1:] * slope[:-1] < 0
    near = jnp.where(turns, jnp.minimum(jnp.abs(value[1:]), jnp.abs(value[:-1])), jnp.inf)
    nearest = near == jnp.min(near, axis=0)
    low = jnp.max(jnp.where(nearest, point[:-1], -1.0), axis=0)
    high = jnp.max(jnp.where(nearest, point[1:], -1.0), axis=0)
    has_turn, turn = bracketed_root(slopes, low, high)
    turn = jnp.where(has_turn, turn, 1.0)
    one = jnp.ones_like(turn)
    parts = bracketed_root(*(jnp.concatenate(each, axis=-1) for each in ([powers] * 2, [-one, turn], [turn, one])))
    there, root = (each.reshape(2, *shape) for each in parts)
    return (has_turn.reshape(shape), turn.reshape(shape)), (there, root)
