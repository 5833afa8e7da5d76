"""An implicit method for stiff sliding, with a solver of its equations that corners of friction do not throw off."""

from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

# SDIRK of order four with an embedded third (Hairer & Wanner, Solving Ordinary Differential Equations II, table
# IV.6.5): five stages, L-stable, and the last one is the result: nothing depends on forces where friction jumps.
GAMMA = 0.25
FRACTIONS = np.array([1 / 4, 3 / 4, 11 / 20, 1 / 2, 1.0])
WEIGHTS = np.zeros((5, 5))  # of earlier stages
WEIGHTS[1, :1] = 1 / 2
WEIGHTS[2, :2] = 17 / 50, -1 / 25
WEIGHTS[3, :3] = 371 / 1360, -137 / 2720, 15 / 544
WEIGHTS[4, :4] = 25 / 24, -49 / 48, 125 / 16, -85 / 12
ERROR = np.array([-3 / 16, -27 / 32, 25 / 32, 0.0, 1 / 4])

SOLVED = 0.01  # of what a step may err: how well its equations are solved
MOST_ITERATIONS = 20  # of Newton's method; where it converges it takes two to four, at corners of friction ten
MOST_HALVINGS = 12  # of the interval in which a step of Newton's is searched for the corner that it overshot
ENOUGH = 0.5  # of the slope along a step: what may be left of it, or turned round


class Stages(NamedTuple):
    """What the stages of a second-order system ask for: y = (q, v, w) (2n + m + 1,) in scaled units, w a number.

    q̇ = ratio · v with `ratio` (n,), of the first n of v (n + m,): the others have rates alone. `rates` gives v̇ and ẇ
    at (t, q, v); `metric` (n + m,) is the mass, in which friction is the gradient of something, zero for the others. A
    stage is solved to a fraction of tolerance · (1 + size(y)).
    """

    rates: Callable[[Array, Array, Array], tuple[Array, Array]]
    ratio: Array
    metric: Array
    tolerance: Array
    size: Callable[[Array], Array] = jnp.abs


class _Found(NamedTuple):
    """An iterate, the change that led to it, the slope where that began, and whether it was cut at a corner."""

    v: Array
    change: Array
    slope: Array
    cut: Array
    power: Array
    error: Array
    iterations: Array


class Sdirk4:
    """One step of SDIRK4: Y_i = y0 + h Σ_j a_ij k_j, k_i = f(t0 + c_i h, Y_i), each solved for its velocity alone.

    Where friction is convex in the velocity (μ does not fall too fast) each stage is the least of a convex function.
    Newton's method with fresh derivatives and a line search finds it also across its corners, as where a point of the
    lining begins to slip backwards: there the force grows like a square root.
    """

    interpolation_cls = diffrax.ThirdOrderHermitePolynomialInterpolation

    def __init__(self, stages: Stages) -> None:
        """Take what the stages ask for; the vector field of `step` is not used."""
        self._stages = stages

    def order(self, terms: Any) -> int:
        """Order of convergence."""
        del terms
        return 4

    def error_order(self, terms: Any) -> int:
        """Order of the error estimate."""
        del terms
        return 4

    def func(self, terms: Any, t0: Any, y0: Array, args: Any) -> Array:
        """Evaluate the vector field."""
        return terms.vf(t0, y0, args)

    def init(self, terms: Any, t0: Any, t1: Any, y0: Array, args: Any) -> Array:
        """The slope at the start."""
        del t1
        return terms.vf(t0, y0, args)

    def step(
        self, terms: Any, t0: Any, t1: Any, y0: Array, args: Any, solver_state: Array, made_jump: Any
    ) -> tuple[Array, Array, dict[str, Any], Array, diffrax.RESULTS]:
        """Make one step: y1, its error estimate, what the interpolation needs, and its last slope.

        `args` are the first and the last time at which stages may ask for rates.
        """
        del terms, made_jump
        start, h = jnp.asarray(t0), jnp.asarray(t1) - t0
        weights, fractions = jnp.asarray(WEIGHTS), jnp.asarray(FRACTIONS)

        def stage(i: Array, found: tuple[Array, Array, Array, Array]) -> tuple[Array, Array, Array, Array]:
            slopes, slope, _, sound = found
            base = y0 + h * sum(weights[i, j] * slopes[j] for j in range(4))
            slope, y, solved = self._stage(jnp.clip(start + fractions[i] * h, *args), base, h * GAMMA, slope)
            return slopes.at[i].set(slope), slope, y, sound & solved

        begin = (jnp.zeros((5, y0.size)), solver_state, y0, jnp.asarray(True))
        slopes, last, y1, sound = jax.lax.fori_loop(0, 5, stage, begin)
        error = h * sum(float(e) * slopes[j] for j, e in enumerate(ERROR) if e != 0)
        error = jnp.where(sound, error, jnp.inf)  # the step is tried again, smaller
        dense = {"y0": y0, "y1": y1, "k0": h * solver_state, "k1": h * last}
        return y1, error, dense, last, diffrax.RESULTS.successful

    def _stage(self, t: Array, base: Array, h: Array, guess: Array) -> tuple[Array, Array, Array]:
        """Slope k and state Y = base + h k at time t, and whether they were found; from a guess of k."""
        stages, n = self._stages, self._stages.ratio.size
        q, v, w = base[:n], base[n:-1], base[-1]

        def residual(x: Array) -> tuple[Array, Array]:
            rate, power = stages.rates(t, q + h * stages.ratio * x[:n], x)
            return x - v - h * rate, power

        def with_value(x: Array) -> tuple[Array, tuple[Array, Array]]:
            value, power = residual(x)
            return value, (value, power)

        def unfinished(now: _Found) -> Array:
            return (now.error > SOLVED * stages.tolerance) & (now.iterations < MOST_ITERATIONS)

        def iterate(now: _Found) -> _Found:
            matrix, (value, power) = jax.jacfwd(with_value, has_aux=True)(now.v)
            here = jnp.sum(stages.metric * now.change * value)
            # Past a corner the slope along the change turns round and is steep: go back to about where it turns.
            past = ~now.cut & (here * now.slope < 0) & (jnp.abs(here) > ENOUGH * jnp.abs(now.slope))
            fraction = _turn(
                lambda fraction: residual(now.v - fraction * now.change)[0], here, now, past, stages.metric
            )
            change = jnp.where(past, -fraction * now.change, -_solved(matrix, value))
            slope = jnp.sum(stages.metric * change * value)
            y = jnp.concatenate([q + h * stages.ratio * now.v[:n], now.v, w[None]])
            error = jnp.where(past, jnp.inf, jnp.max(jnp.abs(change) / (1 + stages.size(y)[n:-1])))
            return _Found(now.v + change, change, slope, past, power, error, now.iterations + 1)

        x, nothing = v + h * guess[n:-1], jnp.zeros(v.size)
        start = _Found(
            x, nothing, jnp.zeros(()), jnp.asarray(False), jnp.zeros(()), jnp.asarray(jnp.inf), jnp.zeros((), int)
        )
        found = jax.lax.while_loop(unfinished, iterate, start)
        slope = jnp.concatenate([stages.ratio * found.v[:n], (found.v - v) / h, found.power[None]])
        y = jnp.concatenate([q + h * stages.ratio * found.v[:n], found.v, (w + h * found.power)[None]])
        return slope, y, found.error <= SOLVED * stages.tolerance


def _turn(residual: Callable[[Array], Array], here: Array, now: _Found, past: Array, metric: Array) -> Array:
    """Fraction of the last change to take back, so that the slope along it is about to turn round; Illinois' rule."""

    def unfinished(search: tuple[Array, ...]) -> Array:
        *_, value, count = search
        return past & (jnp.abs(value) > ENOUGH * jnp.abs(now.slope)) & (count < MOST_HALVINGS)

    def narrow(search: tuple[Array, ...]) -> tuple[Array, ...]:
        low, at_low, high, at_high, fraction, value, count = search
        fraction = low + (high - low) * at_low / (at_low - at_high)
        value = jnp.sum(metric * now.change * residual(fraction))
        as_low = value * at_low > 0
        # The end that stays counts half as much each time.
        return (
            jnp.where(as_low, fraction, low), jnp.where(as_low, value, at_low / 2),
            jnp.where(as_low, high, fraction), jnp.where(as_low, at_high / 2, value),
            fraction, value, count + 1,
        )  # fmt: skip

    zero, one = jnp.zeros(()), jnp.ones(())
    return jax.lax.while_loop(unfinished, narrow, (zero, here, one, now.slope, zero, here, jnp.zeros((), int)))[4]


def _solved(matrix: Array, right: Array) -> Array:
    """Solve by elimination without exchanges: the identity is on the diagonal, and friction mostly adds to it."""
    count = right.size
    for i in range(count - 1):
        factor = matrix[i + 1 :, i] / matrix[i, i]
        matrix = matrix.at[i + 1 :, i:].add(-factor[:, None] * matrix[i, i:])
        right = right.at[i + 1 :].add(-factor * right[i])
    for i in reversed(range(count)):
        right = right.at[i].set(right[i] / matrix[i, i])
        right = right.at[:i].add(-matrix[:i, i] * right[i])
    return right
