"""Where a convex function is least, within a kernel: the method of Broyden, Fletcher, Goldfarb & Shanno."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

DESCENT, CURVATURE = 1e-4, 0.5  # of the slope along the way: how far down, and how much less steep, a step has to get
PRECISION = 1e-15  # of the least value: what is left to gain
ROUND_OFF = 4 * np.finfo(np.float64).eps  # of a value
MOST_TRIES, MOST_STEPS = 30, 300  # lengths of a step that are tried, and of all steps


class _Search(NamedTuple):
    """Where it is, value and slope there, the inverse of the curvature, the way from there, and how far is tried."""

    x: Array
    value: Array
    slope: Array
    inverse: Array
    way: Array
    low: Array
    high: Array
    length: Array
    tries: Array
    count: Array


def minimum(function: Callable[[Array], tuple[Array, Array]], start: Array) -> tuple[Array, Array]:
    """Where a convex function of (k,), given with its gradient (k,), is least, and its value there; it may have kinks.

    The length of a step is found by halving and doubling, as Lewis & Overton, Mathematical Programming 141 (2013) 135.
    """
    if start.size == 0:
        return start, function(start)[0]

    def look(now: _Search) -> _Search:
        x = now.x + now.length * now.way
        value, slope = function(x)
        before, after = jnp.sum(now.slope * now.way), jnp.sum(slope * now.way)
        far = value > now.value + DESCENT * now.length * before + ROUND_OFF * jnp.abs(value)
        near = ~far & (after < CURVATURE * before)
        low, high = jnp.where(near, now.length, now.low), jnp.where(far, now.length, now.high)
        length = jnp.where(jnp.isfinite(high), (low + high) / 2, 2 * low)
        again = now._replace(low=low, high=high, length=length, tries=now.tries + 1, count=now.count + 1)
        inverse = _updated(now.inverse, x - now.x, slope - now.slope)
        way = -jnp.sum(inverse * slope, axis=1)
        there = _Search(x, value, slope, inverse, way, zero, infinity, zero + 1, none, now.count + 1)
        return jax.tree.map(lambda one, other: jnp.where(far | near, one, other), again, there)

    def unfinished(now: _Search) -> Array:
        gain = -jnp.sum(now.slope * now.way)
        tries = (now.tries < MOST_TRIES) & (now.count < MOST_STEPS)
        return (now.count == 0) | (tries & (gain > PRECISION * jnp.abs(now.value)))

    zero, infinity, none = jnp.zeros(()), jnp.full((), jnp.inf), jnp.zeros((), int)
    nothing = jnp.zeros(start.size)
    first = _Search(start, infinity, nothing, jnp.eye(start.size), nothing, zero, infinity, zero + 1, none, none)
    found = jax.lax.while_loop(unfinished, look, first)
    return found.x, found.value


def _updated(inverse: Array, step: Array, change: Array) -> Array:
    """The inverse (k, k) of a curvature by which the slope changes so over that step; as it was where that is none."""
    bend = jnp.sum(step * change)
    share = step / jnp.where(bend > 0, bend, 1.0)
    moved = jnp.sum(inverse * change, axis=1)
    new = (
        inverse
        - share[:, None] * moved
        - moved[:, None] * share
        + (1 + jnp.sum(change * moved) / bend) * (share[:, None] * step)
    )
    return jnp.where(bend > 0, new, inverse)
