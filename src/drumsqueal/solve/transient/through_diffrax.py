"""Steps from sample to sample that diffrax makes itself: its loop, with any of its solvers, in place of `step_through`.

Its checks call back to Python: such a program is no kernel, and is compiled in every session.
"""

from collections.abc import Callable
from typing import Any, cast

import diffrax
import equinox as eqx
import jax.numpy as jnp
from jax import Array

from drumsqueal.solve.transient.runge_kutta import DIFFRAX_STEPS
from drumsqueal.solve.transient.stepping import INTEGRAL, PROPORTIONAL, Norm, Stepped


class BySize(diffrax.PIDController):
    """Steps by errors that are measured against atol + rtol times the `size` of the state, not its present value."""

    size: Callable[[Any], Any] = eqx.field(default=abs, kw_only=True)

    def adapt_step_size(
        self, t0: Any, t1: Any, y0: Any, y1_candidate: Any, args: Any, y_error: Any, error_order: Any, state: Any
    ) -> Any:
        """Choose the next step, as diffrax does."""
        return super().adapt_step_size(t0, t1, y0, self.size(y1_candidate), args, y_error, error_order, state)


def controller(tolerance: Any, atol: Any, norm: Any, size: Callable[[Any], Any], corners: Array | None) -> Any:
    """The step-size control of `step_through`, for diffrax; steps end at the corners (c,), ascending times (s)."""
    found = BySize(rtol=tolerance, atol=atol, norm=norm, pcoeff=PROPORTIONAL, icoeff=INTEGRAL, size=size)
    return found if corners is None else diffrax.ClipStepSizeController(found, jump_ts=corners)


def through_diffrax(
    solver: diffrax.AbstractSolver,
    vector_field: Callable[[Array, Array], Array],
    times: Array,
    start: Array,
    step: Array,
    *,
    tolerance: Array,
    norm: Norm,
    size: Callable[[Array], Array],
    origin: Any,
    corners: Array | None,
    begin: Array,
    end: Array,
    halted: Array,
    sampled: tuple[Array, Array],
    halts: Callable[[Array, Array], Array] | None = None,
    **_: Any,
) -> Stepped:
    """Integrate as `step_through` does, but for what only that has: a budget, and steps that end at an event.

    Where `halts` is true it ends after the step. The next step is the mean one: diffrax does not return its own.
    """
    makes_none = halted | ~jnp.isfinite(start).all()
    until, (before, samples) = jnp.where(makes_none, begin, end), sampled
    found = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, _: vector_field(jnp.asarray(t), y)), solver, begin, until, step, start,
        saveat=diffrax.SaveAt(
            subs=[diffrax.SubSaveAt(ts=jnp.clip(times, begin, until)), diffrax.SubSaveAt(t1=True)]
        ),
        stepsize_controller=controller(tolerance, tolerance, norm, size, None if corners is None else corners - origin),
        event=None if halts is None else diffrax.Event(lambda t, y, *_, **__: halts(t, y)),
        max_steps=DIFFRAX_STEPS * len(times), adjoint=diffrax.ForwardMode(), throw=False,
    )  # fmt: skip
    (_, (ended,)), (states, (last,)) = cast("Any", found.ts), cast("Any", found.ys)
    time, kept = jnp.asarray(ended), found.stats["num_accepted_steps"]
    count = jnp.maximum(before, jnp.sum(times <= time))
    places = jnp.arange(len(times))
    fresh = (places >= before) & (places < count)
    return Stepped(
        jnp.where(fresh[:, None], states, samples), last, time,
        jnp.where(kept > 0, (time - begin) / jnp.maximum(kept, 1), step), found.stats["num_steps"], kept, time >= end,
        halted | (found.result == diffrax.RESULTS.event_occurred), None, count,
    )  # fmt: skip
