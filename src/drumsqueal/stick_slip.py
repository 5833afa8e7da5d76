"""A chunk of a transient through all changes between slipping and sticking of the lining as a whole."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.errors import JaxRuntimeError
from scipy.optimize import brentq

from drumsqueal.model import Model
from drumsqueal.runge_kutta import LINEARLY_IMPLICIT, is_explicit
from drumsqueal.segment import CHUNK_SAMPLES, Segment, Span, State, advance, least_slip
from drumsqueal.sticking import can_stick, drum_motion, drum_motions, held, hold, holds_surely, slip

AWAY = 2.0  # times the slip that counts as none: what a lining that cannot stick goes on with
MOST_CHANGES = 1000  # between slip and stick in one chunk, that is a hundred a period: more is a mistake, not a motion
TIMING = 1e-12  # of a chunk: how well the end of sticking is found


class StickSlip:
    """Takes a model through time chunk by chunk, from slipping to sticking and back."""

    def __init__(
        self, model: Model, steady: Array, tolerance: np.float64, solver: str, *, sticks: bool = False
    ) -> None:
        """Start slipping unless it `sticks` already; what cannot stick never does."""
        self._model, self._steady, self._tolerance, self._solver = model, steady, tolerance, solver
        self._sticks, self._in_kernel = can_stick(model), True
        self._held: Model | None = held(model) if sticks else None  # the model that sticks, while it does
        self.stiff = False  # whether the last chunk took the implicit method

    @property
    def sticks(self) -> bool:
        """Whether the lining sticks at the end of the last chunk."""
        return self._held is not None

    def through(self, state: State, span: Span, step: Array) -> Segment:
        """One chunk."""
        if self._sticks and self._held is None and float(span.start) == 0:
            least = least_slip(self._model, state, span, self._tolerance, self._solver)
            if float(slip(self._model, span.start, state.velocity)) < float(least):
                state = self._changed(state, 0.0, float(least))
        whole, self.stiff = None, False
        for _ in range(MOST_CHANGES):
            sticking = self._held is not None
            segment = self._stick(state, span, step) if sticking else self._slip(state, span, step)
            whole = segment if whole is None else _joined(whole, segment, float(span.offset), span)
            if not bool(segment.halted):
                break
            step = segment.step
            span = span._replace(offset=np.float64(segment.time))
            least = least_slip(self._model, segment.final, span, self._tolerance, self._solver)
            state = self._changed(segment.final, float(span.start + segment.time), float(least), ends=sticking)
        assert whole is not None
        return whole

    def _slip(self, state: State, span: Span, step: Array) -> Segment:
        """Slip to the end of the chunk or until hardly anything slips, implicitly where that takes too many steps."""
        segment = self._advanced(state, span, step, self._solver)
        if bool(segment.reached) or bool(segment.halted) or not is_explicit(self._solver):
            return segment
        stiff = self._advanced(state, span, step, LINEARLY_IMPLICIT)
        if float(stiff.time) <= float(segment.time):
            return segment
        self.stiff = True
        return stiff

    def _advanced(self, state: State, span: Span, step: Array, solver: str) -> Segment:
        arguments = (self._model, self._steady, state, span, self._tolerance, step, solver)
        try:
            return advance(*arguments, self._in_kernel, self._sticks)
        except JaxRuntimeError:
            # A law of the user's own may call what no kernel can: a matrix product, a sort, a solver of equations.
            if not self._in_kernel:
                raise
            self._in_kernel = False
            return advance(*arguments, self._in_kernel, self._sticks)

    def _stick(self, state: State, span: Span, step: Array) -> Segment:
        """Move with the drum to the end of the chunk, or until friction no longer holds."""
        segment = self._moved(state, span, step)
        times = np.maximum(np.arange(1, int(span.samples) + 1) * float(span.interval), float(span.offset))
        before, states = float(span.offset), jax.tree.map(np.asarray, segment.states)
        for sample, time in enumerate(times, start=1):
            if time == before:
                continue
            now = jax.tree.map(lambda x, sample=sample: x[sample], states)
            if not self._holds(now, float(span.start) + time):
                return self._released(segment, state, span, step, before, float(time))
            before = float(time)
        return segment

    def _moved(self, state: State, span: Span, step: Array) -> Segment:
        """Move with the drum: at its own speed, which the integral of its rate has but to the tolerance."""
        assert self._held is not None
        segment = advance(self._held, self._steady, state, span, self._tolerance, step, self._solver)
        times = np.minimum(np.arange(CHUNK_SAMPLES + 1), int(span.samples)) * float(span.interval)
        times = float(span.start) + np.maximum(times, float(span.offset))
        velocity = drum_motions(self._model, times, segment.states.velocity)
        final = drum_motion(self._model, float(span.start) + float(segment.time), segment.final.velocity)
        return segment._replace(
            states=segment.states._replace(velocity=velocity), final=segment.final._replace(velocity=final)
        )

    def _holds(self, state: State, time: float) -> bool:
        q = self._steady + state.departure
        return holds_surely(self._model, time, q, state.velocity) or self._reserve(state, time) >= 1

    def _reserve(self, state: State, time: float) -> float:
        return hold(self._model, time, self._steady + state.departure, state.velocity).reserve

    def _released(
        self, segment: Segment, state: State, span: Span, step: Array, before: float, after: float
    ) -> Segment:
        """The segment up to the time (s after the chunk's start) at which friction ceases to hold."""

        def at(time: float) -> State:
            if time <= float(span.offset):
                return state
            return self._moved(state, span._replace(interval=np.float64(time), samples=np.int64(1)), step).final

        def excess(time: float) -> float:
            return self._reserve(at(time), float(span.start) + time) - 1

        time = before
        if excess(before) > 0:
            time = brentq(excess, before, after, xtol=TIMING * after)
        assert isinstance(time, float)
        yes, no = jnp.asarray(True), jnp.asarray(False)
        return segment._replace(final=at(time), time=jnp.asarray(time), step=step, reached=no, halted=yes)

    def _changed(self, state: State, time: float, least: float, *, ends: bool = False) -> State:
        """The state to go on with where hardly anything slips: at rest on the drum, or slipping off it."""
        found = hold(self._model, time, self._steady + state.departure, state.velocity, ends=ends)
        velocity = drum_motion(self._model, time, state.velocity)
        if found.reserve >= 1 and not ends:
            self._held = held(self._model)
            return state._replace(velocity=velocity)
        self._held = None
        return state._replace(velocity=velocity + AWAY * least * jnp.asarray(found.direction))


def _joined(whole: Segment, segment: Segment, offset: float, span: Span) -> Segment:
    """Samples up to the offset from the one, later ones from the other."""
    earlier = np.arange(len(whole.kinetic)) * float(span.interval) <= offset

    def join(old: Any, new: Any) -> Any:
        after = earlier.reshape(-1, *[1] * (np.ndim(new) - 1))
        return np.where(after, np.asarray(old), np.asarray(new))

    joined = {
        name: jax.tree.map(join, getattr(whole, name), getattr(segment, name))
        for name in ("states", "observation", "kinetic", "potential")
    }
    counts = {"steps": whole.steps + segment.steps, "kept": whole.kept + segment.kept}
    return segment._replace(**joined, **counts)
