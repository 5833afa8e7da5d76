"""The Runge-Kutta methods of our own steps: diffrax's explicit ones, and an implicit one for stiff sliding.

A method has an order, an interpolation of diffrax, and steps whose first slope is the last one of the step before.
"""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, get_args

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.body import WRITTEN_OUT
from drumsqueal.programs import kernel_in_loop
from drumsqueal.scene.tables import Solver
from drumsqueal.solve.transient.events import Bracket

if TYPE_CHECKING:
    import diffrax

Rate = Callable[[Array, Array, tuple[Array, Array]], Array]
"""ẏ at a time between two others, and a state y (n,)."""
Step = tuple[Array, Array, dict[str, Any], Array, Array]
"""Where a step ends (n,), its error estimate (n,), what the interpolation needs, and the slopes at both ends (n,)."""


class Explicit:
    """One step y1 = y0 + h Σ b_i k_i, k_i = f(t0 + c_i h, y0 + h Σ_j a_ij k_j), of an explicit method of diffrax.

    Its last stage is the first of the next step (FSAL). The state is one array (n,). Tableau, order and interpolation
    are the method's; the loop over its stages, which knows no more than it needs, takes 1.1 µs of a step of Dopri8 in
    the plane instead of 1.4. Written out stage by stage it takes three times as long, and to compile, too.
    """

    def __init__(self, method: "diffrax.AbstractERK", in_loop: bool = False) -> None:
        """Take the method, and whether a stage is a kernel of its own in a loop that is none.

        `weights` are the method's a_ij (s, s), the last stage of which lies at the end of the step.
        """
        self._in_loop = in_loop
        tableau: Any = method.tableau
        assert tableau.fsal
        self.order, self.interpolation, self._tableau = method.order(None), method.interpolation_cls, tableau
        self.weights = np.zeros((tableau.num_stages, tableau.num_stages))
        for row, coefficients in enumerate(tableau.a_lower, start=1):
            self.weights[row, :row] = coefficients

    def prepared(self, rate: Rate, start: Array) -> Callable[..., tuple[Array, Array, Array]]:
        """What steps ask for, found before the loop over them: a stage, by its number, the slopes of all, the step."""
        count = self._tableau.num_stages
        weights, fractions = jnp.asarray(self.weights), jnp.asarray([0.0, *self._tableau.c])
        chains = 4  # sums side by side: in one, each of a dozen terms waits for the one before, a twentieth of a step

        def stage(i: Array, slopes: Array, step: tuple[Array, Array, Array, Any]) -> tuple[Array, Array, Array]:
            t0, h, y0, piece = step
            # Term by term over all that may come before: a product with the matrix is a loop of its own.
            terms = [weights[i, j] * slopes[j] for j in range(count - 1)]
            y = y0 + h * sum(sum(terms[k::chains]) for k in range(chains))
            slope = rate(t0 + fractions[i] * h, y, piece)
            return slopes.at[i].set(slope), y, slope

        time, slopes = jnp.zeros(()), jnp.zeros((count, start.size))
        like = jnp.zeros((), int), slopes, (time, time, start, (time, time))
        return kernel_in_loop(stage, *like) if self._in_loop else stage

    def step(
        self, stage: Any, t0: Any, t1: Any, y0: Array, first: Array, piece: tuple[Array, Array], anew: Array
    ) -> Step:
        """Make one step, as it was `prepared`, from the slope at its start, found `anew` or as it is given.

        `piece` are the first and the last time to ask for rates.
        """
        count, b_error, start = self._tableau.num_stages, self._tableau.b_error, jnp.asarray(t0)
        h = jnp.asarray(t1) - start
        slopes, step = jnp.zeros((count, y0.size)).at[0].set(first), (start, h, y0, piece)
        # One loop with the first stage in it: what compiles knows the rates once.
        slopes, y1, last = jax.lax.fori_loop(
            jnp.where(anew, 0, 1), count, lambda i, now: stage(i, now[0], step), (slopes, y0, first)
        )
        error = h * sum(float(b) * slopes[j] for j, b in enumerate(b_error) if b != 0)
        return y1, error, {"y0": y0, "y1": y1, "k": h * slopes}, slopes[0], last


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

    order = 4

    def __init__(self, stages: Stages) -> None:
        """Take what the stages ask for, in place of the rate that `step` is given."""
        from diffrax import ThirdOrderHermitePolynomialInterpolation

        self._stages, self.interpolation = stages, ThirdOrderHermitePolynomialInterpolation

    def prepared(self, rate: Rate, start: Array) -> Rate:
        """What steps ask for, as of `Explicit`: rates at their start."""
        del start
        return rate

    def step(
        self, rate: Rate, t0: Any, t1: Any, y0: Array, first: Array, piece: tuple[Array, Array], anew: Array
    ) -> Step:
        """Make one step, as `Explicit.step`."""
        first = jax.lax.cond(anew, lambda: rate(t0, y0, piece), lambda: first)
        start, h = jnp.asarray(t0), jnp.asarray(t1) - t0
        weights, fractions = jnp.asarray(WEIGHTS), jnp.asarray(FRACTIONS)

        def stage(i: Array, found: tuple[Array, Array, Array, Array]) -> tuple[Array, Array, Array, Array]:
            slopes, slope, _, sound = found
            base = y0 + h * sum(weights[i, j] * slopes[j] for j in range(4))
            slope, y, solved = self._stage(jnp.clip(start + fractions[i] * h, *piece), base, h * GAMMA, slope)
            return slopes.at[i].set(slope), slope, y, sound & solved

        begin = (jnp.zeros((5, y0.size)), first, y0, jnp.asarray(True))
        slopes, last, y1, sound = jax.lax.fori_loop(0, 5, stage, begin)
        error = h * sum(float(e) * slopes[j] for j, e in enumerate(ERROR) if e != 0)
        error = jnp.where(sound, error, jnp.inf)  # the step is tried again, smaller
        dense = {"y0": y0, "y1": y1, "k0": h * first, "k1": h * last}
        return y1, error, dense, first, last

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

        solved = 0.01  # of what a step may err: how well its equations are solved

        def unfinished(now: _Found) -> Array:
            # 20 of Newton's method; where it converges it takes two to four, at corners of friction ten
            return (now.error > solved * stages.tolerance) & (now.iterations < 20)

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
        return slope, y, found.error <= solved * stages.tolerance


def _turn(residual: Callable[[Array], Array], here: Array, now: _Found, past: Array, metric: Array) -> Array:
    """Fraction of the last change to take back, so that the slope along it is about to turn round."""

    def unfinished(search: tuple[Bracket, Array, Array, Array]) -> Array:
        _, _, value, count = search
        # 12 of the interval in which a step of Newton's is searched for the corner that it overshot
        return past & (jnp.abs(value) > ENOUGH * jnp.abs(now.slope)) & (count < 12)

    def narrow(search: tuple[Bracket, Array, Array, Array]) -> tuple[Bracket, Array, Array, Array]:
        bracket, *_, count = search
        fraction = bracket.root
        value = jnp.sum(metric * now.change * residual(fraction))
        return bracket.narrowed(fraction, value, ~(value * bracket.at_low > 0)), fraction, value, count + 1

    start = Bracket(jnp.zeros(()), here, jnp.ones(()), now.slope)
    return jax.lax.while_loop(unfinished, narrow, (start, start.low, here, jnp.zeros((), int)))[1]


def _solved(matrix: Array, right: Array) -> Array:
    """Solve by elimination without exchanges: the identity is on the diagonal, and friction mostly adds to it.

    Beyond six unknowns, which take long to compile when they are written out, row by row in a loop: within one kernel
    (`compiled` in `programs.py`) there are no libraries.
    """
    count = right.size
    if count > WRITTEN_OUT:
        return _solved_in_a_loop(matrix, right)
    for i in range(count - 1):
        factor = matrix[i + 1 :, i] / matrix[i, i]
        matrix = matrix.at[i + 1 :, i:].add(-factor[:, None] * matrix[i, i:])
        right = right.at[i + 1 :].add(-factor * right[i])
    for i in reversed(range(count)):
        right = right.at[i].set(right[i] / matrix[i, i])
        right = right.at[:i].add(-matrix[:i, i] * right[i])
    return right


def _solved_in_a_loop(matrix: Array, right: Array) -> Array:
    """The same by elimination in all other rows at once."""
    rows = np.arange(right.size)

    def eliminate(i: Array, found: tuple[Array, Array]) -> tuple[Array, Array]:
        matrix, right = found
        row = matrix[i] / matrix[i, i]
        value = right[i] / matrix[i, i]
        own, column = rows == i, matrix[:, i]
        left = jnp.where(own[:, None], row, matrix - column[:, None] * row)
        return left, jnp.where(own, value, right - column * value)

    return jax.lax.fori_loop(0, right.size, eliminate, (matrix, right))[1]


_EXPLICIT = {"tsit5": "Tsit5", "dopri5": "Dopri5", "dopri8": "Dopri8"}  # as diffrax calls them
DEFAULT = "dopri8"
IMPLICIT = "sdirk4"
AUTO = "auto"  # one of these two, as it comes
SOLVERS = (*_EXPLICIT, IMPLICIT)
"""What `simulate.solver` can be, besides "auto" and the solvers of diffrax."""
DIFFRAX = "diffrax."  # begins the name of a solver of diffrax that diffrax integrates with
# Steps that diffrax may make for each sample: of the fastest mode that is half a period at most, for which a tolerance
# of 1e-12 takes 30. Loose methods at tight tolerances are what exceeds it.
DIFFRAX_STEPS = 200
STAGES: Mapping[str, int] = {"tsit5": 6, "dopri5": 6, "dopri8": 13}
"""Evaluations of the vector field a step, of the explicit methods."""
LOCAL_FRACTION: Mapping[str, float] = {"tsit5": 0.005, "dopri5": 0.002, "dopri8": 0.01, "sdirk4": 0.01}
"""Fraction of a scene's tolerance that one step may err: errors add up over some thousand steps.

Over the growth phase of the shipped scenes the trajectory is then off by no more than ten times the tolerance, and
mostly by about as much (see `drumsqueal accuracy`).
"""


def is_explicit(name: str) -> bool:
    """Whether it is one of our own steps, and solves no equations."""
    return name in _EXPLICIT


def is_implicit(name: str) -> bool:
    """Whether a method, our own or diffrax's, solves equations in each step."""
    if not name.startswith(DIFFRAX):
        return name == IMPLICIT
    import diffrax  # as in make_solver

    return issubclass(getattr(diffrax, name.removeprefix(DIFFRAX)), diffrax.AbstractImplicitSolver)


def local_fraction(name: str) -> float:
    """As in `LOCAL_FRACTION`; of a method of diffrax that is not there, that of the default."""
    return LOCAL_FRACTION.get(name.removeprefix(DIFFRAX).lower(), LOCAL_FRACTION[DEFAULT])


def check_solver(name: str) -> None:
    """Raise RequestError for what `simulate.solver` cannot be."""
    if name not in get_args(Solver):
        raise RequestError(f"solver must be one of {', '.join(get_args(Solver))}; got {name}")


def make_solver(name: str, stages: Stages | None = None, in_loop: bool = False) -> Any:
    """The method of that name; `stages` is what an implicit one asks for, of others they may be kernels in a loop."""
    import diffrax  # which takes a third of a second, and is wanted where a program is traced only

    if name.startswith(DIFFRAX):
        return getattr(diffrax, name.removeprefix(DIFFRAX))()
    if is_explicit(name):
        return Explicit(getattr(diffrax, _EXPLICIT[name])(), in_loop)
    assert stages is not None
    return Sdirk4(stages)
