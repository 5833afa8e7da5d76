"""Adaptive steps from sample to sample, put together from diffrax's parts: solvers, step-size control, interpolation.

diffrax's own loop (`through_diffrax.py`) checks its inputs by calling back to Python, which bars a program from the
persistent compilation cache and from being one kernel: it takes 2 to 21 times as long at equal error (docs/speed.md).
It compiles in each session, and does not know set-valued friction. Here the inputs are ours.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from drumsqueal.solve.transient.events import AT_THE_END, Attempt, chosen, fraction_to_excursion, fraction_to_kink

if TYPE_CHECKING:
    import diffrax

# A proportional part in the step-size control halves the rejected steps where contact boundaries make kinks.
PROPORTIONAL, INTEGRAL = 0.3, 0.4
Norm = Callable[[Array], Array]


class Stepped(NamedTuple):
    """Samples (k, n), NaN where not reached; the last state (n,) and its time; the next step; how many made and kept.

    `reached` states whether the end was reached within the budget of steps, `halted` whether a stop was requested;
    `carried` is what was taken along, in the end, and `sampled` how many samples there are.
    """

    samples: Array
    last: Array
    time: Array
    step: Array
    steps: Array
    kept: Array
    reached: Array
    halted: Array
    carried: Any
    sampled: Array


class _Plan(NamedTuple):
    """Whether a step is kept and the time then, the next step, how long it is to be beyond a kink, and the control."""

    keep: Array
    time: Array
    step: Array
    onwards: Array
    controller: Any


class _Now(NamedTuple):
    time: Array
    step: Array
    credit: Array  # steps that may be made
    onwards: Array  # the step to go on with after one that is to end at a kink; zero where it is not
    levels: Any  # numbers that say where kinks are
    state: Array
    slope: Array
    at_corner: Array  # the slope there is not known yet
    passed: Array  # corners, up to the one before
    controller: Any
    sampled: Array
    samples: Array
    steps: Array
    kept: Array
    halted: Array
    carried: Any


def step_through(
    solver: Any,
    vector_field: Callable[[Array, Array], Array],
    times: Array,
    start: Array,
    step: Array,
    *,
    tolerance: Array,
    norm: Norm,
    budget: Array,
    pace: Any = 0.0,
    halts: Callable[[Array, Array], Array] | None = None,
    fraction_to_stop: Callable[[Attempt], Array] | None = None,
    kinks: Callable[[Array, Array], Array] | None = None,
    longest: Array | None = None,
    size: Callable[[Array], Array] = jnp.abs,
    origin: Any = 0.0,
    corners: Array | None = None,
    along: Callable[[Attempt, Any], Any] | None = None,
    carried: Any = None,
    begin: Any = None,
    end: Any = None,
    halted: Any = False,
    sampled: tuple[Array, Array] | None = None,
) -> Stepped:
    """Integrate ẏ = f(t, y) from a start (n,) at times[0] and sample it at the times (k,), which do not decrease.

    `solver` is a method of `runge_kutta.py`. A step is kept when the norm of its estimated error, over tolerance ·
    (1 + size(y)), is below one; `size` is |y| unless given. `step` is the first one, and no other is longer than
    `longest`. As many steps as the `budget`, kept or not, may be made; what is used of it comes back at a `pace` (1/s).
    Steps end at all `corners` (c,) on the way, ascending times from another `origin`: f may jump there, and is asked
    for on each side of them in turn. It ends early after a step whose time and state make `halts` true. Of a step
    `fraction_to_stop` gives the fraction after which that would have been so, `AT_THE_END` where it is so at the end of
    the step, or 1: it is then made again so far only. Of a time and state `kinks` gives numbers, of which one changes
    its sign where f has a kink: a step that is not kept, or within which one comes to the other side and goes back,
    ends there when it is made again. With every step that is kept `along` takes `carried`, a tree of arrays, from its
    start to its end. It may go on from a later `begin`, with as many samples `sampled` as are there, to an earlier
    `end`, and make no step where it is `halted`.
    """
    import diffrax  # as in make_solver

    controller = diffrax.PIDController(rtol=tolerance, atol=tolerance, norm=norm, pcoeff=PROPORTIONAL, icoeff=INTEGRAL)
    begin, end = times[0] if begin is None else begin, times[-1] if end is None else end
    if sampled is None:
        sampled = jnp.ones((), int), jnp.full((len(times), start.size), jnp.nan).at[0].set(start)

    def rate(t: Array, y: Array, piece: tuple[Array, Array]) -> Array:
        return vector_field(jnp.clip(t, *piece), y)

    def unfinished(now: _Now) -> Array:
        return (now.time < end) & (now.credit > 0) & ~now.halted

    firsts, lasts, coming = _pieces(corners, origin)
    asked = solver.prepared(rate, start)

    def advance(now: _Now) -> _Now:
        passed = jax.lax.cond(
            now.at_corner, lambda: jnp.searchsorted(coming, now.time, side="right"), lambda: now.passed
        )
        piece, until = (firsts[passed], lasts[passed]), jnp.minimum(coming[passed], end)
        left = until - now.time
        # 1 - 1e-9 of what is left: a step that goes so far goes to the end
        there = jnp.where(now.step > (1 - 1e-9) * left, until, now.time + now.step)
        state, error, dense, first, last = solver.step(
            asked, now.time, there, now.state, now.slope, piece, anew=now.at_corner
        )
        # A failed solve, or a state beyond the numbers, is an error without bound: the step is tried smaller.
        error = jnp.where(jnp.isfinite(error).all(), error, jnp.inf)
        keep, time, following, _, controller_state, _ = controller.adapt_step_size(
            now.time, there, now.state, size(state), None, error, solver.order, now.controller
        )
        # A step that was cut short at the end says little about the next one.
        next_step = jnp.where(keep & (there == until), jnp.maximum(following - time, now.step), following - time)
        interpolation = solver.interpolation(t0=now.time, t1=there, **dense)
        attempt = Attempt(now.time, there, now.state, state, first, last, interpolation.evaluate, dense, piece)
        plan = _Plan(jnp.asarray(keep), jnp.asarray(time), next_step, jnp.zeros(()), controller_state)
        rests, levels = jnp.zeros((), bool), now.levels
        if kinks is not None:
            levels = kinks(there, state)
            plan = _to_discontinuity(plan, attempt, now, kinks, levels)
        if fraction_to_stop is not None:
            plan, rests = _stopping(plan, attempt, now, fraction_to_stop(attempt))
        keep, time, next_step, onwards, controller_state = plan
        if longest is not None:
            next_step = jnp.minimum(next_step, longest)
        carried = now.carried
        if along is not None:
            taken = along
            carried = jax.lax.cond(keep, lambda: taken(attempt, now.carried), lambda: now.carried)
        samples = _sample(times, interpolation, there, keep, now.sampled, now.samples)
        return _Now(
            time, next_step, jnp.minimum(budget, now.credit + pace * (time - now.time)) - 1, onwards,
            chosen(keep, levels, now.levels), jnp.where(keep, state, now.state), jnp.where(keep, last, first),
            # Beyond a corner the last slope is that of its other side.
            keep & (there == until), passed, controller_state, *samples, now.steps + 1,
            now.kept + jnp.where(keep, 1, 0),
            rests if halts is None else rests | (keep & halts(time, state)),
            carried,
        )  # fmt: skip

    none = jnp.zeros((), int)
    unused: Any = None
    _, controller_state = controller.init(unused, begin, end, start, step, None, unused, solver.order)
    controller_state = jax.tree.map(jnp.asarray, controller_state)
    levels = None if kinks is None else kinks(begin, start)
    credit = jnp.where(jnp.isfinite(start).all(), budget, 0.0)  # what is undefined leads nowhere
    now = _Now(
        begin, step, credit, jnp.zeros(()), levels, start, jnp.zeros_like(start), jnp.ones((), bool),
        jnp.searchsorted(coming, begin), controller_state, *sampled, none, none, jnp.asarray(halted), carried,
    )  # fmt: skip
    now = jax.lax.while_loop(unfinished, advance, now)
    reached = now.time >= end
    return Stepped(
        now.samples, now.state, now.time, now.step, now.steps, now.kept, reached, now.halted, now.carried, now.sampled
    )


def _to_discontinuity(
    plan: _Plan, attempt: Attempt, now: _Now, kinks: Callable[[Array, Array], Array], after: Array
) -> _Plan:
    """Make a step again up to a kink, where it is not kept or a number leaves and returns; beyond, go on as before."""
    length, lands_now = attempt.end - attempt.start, now.onwards > 0

    def at(fraction: ArrayLike) -> Array:
        t = attempt.start + fraction * length
        return kinks(t, attempt.inside(t))

    middle = (attempt.before + attempt.after) / 2 + length / 8 * (attempt.slope_before - attempt.slope_after)
    turn = fraction_to_excursion(at, now.levels, kinks((attempt.start + attempt.end) / 2, middle), after)
    leaves = plan.keep & (turn > 0)
    sought = leaves | (~plan.keep & ~lands_now)
    fraction = jax.lax.cond(sought, lambda: fraction_to_kink(at, jnp.where(leaves, turn, 1.0)), lambda: jnp.ones(()))
    lands = fraction < 1
    keep = plan.keep & ~lands
    landed = keep & lands_now
    beyond = jnp.where(landed, jnp.maximum(plan.step, now.onwards), plan.step)
    # The errors about a kink say nothing about the steps beyond it.
    controller = chosen(lands | landed, now.controller, plan.controller)
    step, onwards = jnp.where(lands, fraction * length, beyond), jnp.where(lands, length, 0.0)
    time = jnp.where(lands, attempt.start, plan.time)
    return _Plan(keep, time, step, onwards, controller)


def _stopping(plan: _Plan, attempt: Attempt, now: _Now, fraction: Array) -> tuple[_Plan, Array]:
    """Make a step again so far only if a stop would be requested inside it; whether that is at its end."""
    length = attempt.end - attempt.start
    # One that the rounding of times leaves as long as it was is not made again.
    short = (fraction < AT_THE_END) & (attempt.start + fraction * length < attempt.end)
    rests, again = plan.keep & (fraction < 1) & ~short, plan.keep & short
    return _Plan(
        plan.keep & ~again,
        jnp.where(again, attempt.start, plan.time),
        jnp.where(again, fraction * length, plan.step),
        plan.onwards,
        chosen(again, now.controller, plan.controller),
    ), rests


def _pieces(corners: Array | None, origin: Any) -> tuple[Array, Array, Array]:
    """Of the pieces between corners (c + 1,) the first and the last time to look at, and the corner at their end.

    Those two lie so far inside that what is prescribed at origin + time is that of the piece, whatever the rounding.
    """
    inner = jnp.zeros(0) if corners is None else corners
    # Stages at a corner look at what is prescribed from two round-offs of a time inside their piece.
    margin = 2 * np.finfo(np.float64).eps * jnp.abs(inner)
    infinity = jnp.full(1, jnp.inf)
    firsts, lasts = jnp.concatenate([-infinity, inner + margin]), jnp.concatenate([inner - margin, infinity])
    return firsts - origin, lasts - origin, jnp.concatenate([inner, infinity]) - origin


def _sample(
    times: Array,
    interpolation: "diffrax.AbstractLocalInterpolation",
    there: Array,
    keep: Any,
    sampled: Array,
    samples: Array,
) -> tuple[Array, Array]:
    """Write the samples up to the end of a step that is kept; `sampled` says how many there are."""

    def due(progress: tuple[Array, Array]) -> Array:
        index = progress[0]
        return keep & (index < len(times)) & (times[index] <= there)

    def write(progress: tuple[Array, Array]) -> tuple[Array, Array]:
        index, samples = progress
        return index + 1, samples.at[index].set(interpolation.evaluate(times[index]))

    return jax.lax.while_loop(due, write, (sampled, samples))
