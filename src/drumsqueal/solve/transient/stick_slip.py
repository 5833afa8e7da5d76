"""A chunk of a transient through all that changes in it: slip and stick, the method, the drum's direction."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jax import Array
from jax.errors import JaxRuntimeError

from drumsqueal.physics.effects.operation import Constant
from drumsqueal.physics.model import Model
from drumsqueal.solve.transient.runge_kutta import AUTO, DEFAULT, IMPLICIT, is_explicit
from drumsqueal.solve.transient.segment import (
    CORNER_BUDGET,
    STEP_BUDGET,
    Segment,
    advance,
    advance_packed,
    slip_and_least,
)
from drumsqueal.solve.transient.state import CHUNK_SAMPLES, Span, State
from drumsqueal.solve.transient.sticking import can_stick, drum_motion, drum_motions, held, hold, hold_surely

AWAY = 2.0  # times the slip that counts as none: what a lining that cannot stick goes on with
MOST_CHANGES = 1000  # in one chunk, two a sample: more is a mistake, not a motion
TIMING = 1e-12  # of a chunk: how well the end of sticking is found
MARGIN = 1e-12  # of the drum's schedule: its jumps are looked at from so far, beyond round-off
# Steps that the explicit method gets where another may take over, at a tolerance of 1e-6, and how many more each
# BUDGET_RADIANS: where it takes more of them the implicit one gets through sooner, though a step of it takes four times
# as long (the nominal scene below a drum speed of 0.07 rad/s). A method of order eight takes 1.33 times as many for a
# tenth of the tolerance.
EXPLICIT_BUDGET = np.array([2_500.0, 10_000.0])
MORE_STEPS = 1 / 8
MOST_PATIENCE = 64  # chunks
_beyond_kernels: set[Any] = set()  # structures of models that no kernel can hold, as was found out


class Method(NamedTuple):
    """A method, how many chunks an implicit one goes on for, and how many of them it has made."""

    name: str
    patience: int = 1
    waited: int = 0


class Choice:
    """The method of a transient, chunk by chunk.

    "auto" is explicit until that takes too many steps, as it does where friction is stiff: a slow drum damps what moves
    across it, and a lining that all but sticks pivots about a point. After a chunk of the implicit method, then after
    two, four and so on, the explicit one is tried again.
    """

    def __init__(self, solver: str, tolerance: float, method: Method | None = None) -> None:
        """Begin with a method of the scene's names, or go on with the one at hand."""
        self._automatic = solver == AUTO
        self._explicit_budget = EXPLICIT_BUDGET * (1e-6 / tolerance) ** MORE_STEPS
        self.method = method or Method(DEFAULT if self._automatic else solver)

    @property
    def solver(self) -> str:
        """Name of the method."""
        return self.method.name

    @property
    def explicit(self) -> str:
        """A method for what is not stiff."""
        return self.solver if is_explicit(self.solver) else DEFAULT

    @property
    def budget(self) -> np.ndarray:
        """Steps that the method gets, and how many more each BUDGET_RADIANS (2,)."""
        most = np.full(2, float(STEP_BUDGET))
        return np.minimum(self._explicit_budget, most) if self._automatic and self.solver == DEFAULT else most

    def begin(self) -> None:
        """A chunk begins."""
        if not self._automatic:
            return
        if self.solver == DEFAULT:  # which got through the last one
            self.method = Method(DEFAULT)
        elif self.method.waited < self.method.patience:
            self.method = self.method._replace(waited=self.method.waited + 1)
        else:
            self.method = Method(DEFAULT, min(2 * self.method.patience, MOST_PATIENCE))

    def switch(self) -> bool:
        """The method has made all its steps; says whether another goes on from there."""
        if not self._automatic or self.solver == IMPLICIT:
            return False
        self.method = Method(IMPLICIT, self.method.patience, 1)
        return True


class StickSlip:
    """Takes a model through time chunk by chunk, from slipping to sticking and back."""

    def __init__(
        self,
        model: Model,
        steady: Array | np.ndarray,
        tolerance: np.float64,
        solver: str,
        *,
        sticks: bool = False,
        method: Method | None = None,
        observes: bool = True,
    ) -> None:
        """Begin at the start of the transient, or go on with a lining that sticks or not and the method at hand."""
        self._observes = observes  # whether samples come with observations and energies
        self._model, self._steady, self._tolerance = model, steady, tolerance
        self._kind = jax.tree.structure(model)
        self._held: Model | None = held(model) if sticks else None  # the model that sticks, while it does
        self._stuck = sticks  # whether it did when that was noted last
        self._jumps, self._margin = _jumps(model)
        self._may: dict[float, bool] = {}  # stick from the last jump on, by its time: asking takes as long as 100 steps
        corners = model.operation.corners
        self._corners = np.zeros(0) if corners is None else np.unique(corners)
        self._choice = Choice(solver, float(tolerance), method)
        self.solvers: set[str] = set()  # that made the last chunk
        self.changes: list[tuple[float, bool]] = []  # in the last chunk: when (s), and whether it sticks from then on

    @property
    def sticks(self) -> bool:
        """Whether the lining sticks at the end of the last chunk."""
        return self._held is not None

    @property
    def method(self) -> Method:
        """The method at hand."""
        return self._choice.method

    def through(self, state: State, span: Span, step: Array) -> Segment:
        """One chunk."""
        whole, self.solvers, self.changes = None, set(), []
        self._choice.begin()
        for _ in range(MOST_CHANGES):
            span, fresh = self._between_jumps(span)
            if fresh:
                state = self._settled(state, span)
            self._note(span)
            stuck = self._held is not None
            segment = self._stick(state, span, step) if stuck else self._slip(state, span, step)
            whole = segment if whole is None else _joined(whole, segment, span)
            state, step = segment.final, segment.step
            span = span._replace(offset=np.float64(segment.time))
            if bool(segment.halted):
                state = self._changed(state, span, self._slip_and_least(state, span)[1], ends=stuck)
            if float(whole.time) >= float(span.length):
                self._note(span)
                return whole._replace(final=state, reached=np.True_)
            if bool(segment.halted) or bool(segment.reached):
                continue
            if not self._choice.switch():
                break
        assert whole is not None
        return _only_reached(whole, span)

    def _note(self, span: Span) -> None:
        """Keep when the lining begins to stick or to slip."""
        sticks = self._held is not None
        if sticks != self._stuck:
            self._stuck = sticks
            self.changes.append((float(span.start + span.offset), sticks))

    def _between_jumps(self, span: Span) -> tuple[Span, bool]:
        """The span up to the next jump, seen from between the two about it, and whether it begins at one."""
        now, end = float(span.start + span.offset), float(span.start + span.length)
        passed = self._jumps[self._jumps <= now + self._margin]
        coming = self._jumps[self._jumps > now + self._margin]
        after, before = passed[-1], coming[0] if coming.size else np.inf
        until = before - float(span.start) if before < end - self._margin else np.inf
        inside = span._replace(
            until=np.float64(until), after=np.float64(after + self._margin), before=np.float64(before - self._margin)
        )
        return inside, bool(now - after <= self._margin)

    def _may_stick(self, span: Span) -> bool:
        after = float(span.after)
        if after not in self._may:
            self._may[after] = can_stick(self._model, at_rest=False) or (
                can_stick(self._model, at_rest=True) and float(self._model.operation.at(after).drum_speed) == 0
            )
        return self._may[after]

    def _slip_and_least(self, state: State, span: Span) -> tuple[float, float]:
        slip, least = np.asarray(slip_and_least(self._model, state, span, self._tolerance))
        return float(slip), float(least)

    def _settled(self, state: State, span: Span) -> State:
        """The state to go on with from the start or a jump, where it is not known whether the lining sticks."""
        self._held = None
        if not self._may_stick(span):
            return state
        slip, least = self._slip_and_least(state, span)
        return self._changed(state, span, least) if slip < least else state  # nor where it is undefined

    def _slip(self, state: State, span: Span, step: Array) -> Segment:
        """Slip to the end of the span, until hardly anything slips, or as far as the method gets."""
        self.solvers.add(self._choice.solver)
        try:
            return advance(*self._slipping(state, span, step))
        except JaxRuntimeError:
            # A law of the user's own may call what no kernel can: a matrix product, a sort, a solver of equations.
            if self._kind in _beyond_kernels:
                raise
            _beyond_kernels.add(self._kind)
            return advance(*self._slipping(state, span, step))

    def _slipping(self, state: State, span: Span, step: Array) -> tuple[Any, ...]:
        """What `advance` is given."""
        sticks, budget = self._may_stick(span), self._budget(span, self._choice.budget)
        given = self._model, self._steady, state, span, self._tolerance, step, self._choice.solver
        return *given, self._kind not in _beyond_kernels, sticks, budget, self._observes

    def load_ahead(self, state: State, span: Span, step: Any) -> None:
        """Load or compile, in another thread, the program of a first chunk that slips."""
        advance_packed.ahead(*self._slipping(state, self._between_jumps(span)[0], step))

    def _budget(self, span: Span, budget: np.ndarray) -> np.ndarray:
        """A budget of steps, with some for each corner of what is prescribed in a chunk."""
        within = np.diff(np.searchsorted(self._corners, [float(span.start), float(span.start + span.length)]))[0]
        return budget + np.array([CORNER_BUDGET * within, 0.0])

    def _stick(self, state: State, span: Span, step: Array) -> Segment:
        """Move with the drum to the end of the span, or until friction no longer holds."""
        segment = self._moved(state, span, step)
        looks = [(float(span.start) + np.asarray(span.grid), segment.states), *self._at_corners(state, span, step)]
        times = np.concatenate([each for each, _ in looks])
        states = jax.tree.map(lambda *parts: np.concatenate(parts), *(each for _, each in looks))
        surely = np.concatenate(
            [
                hold_surely(self._model, span.inside(t), self._steady + s.vibration, s.velocity, s.memory)
                for t, s in looks
            ]
        )
        before = float(span.start + span.offset)
        for look in np.argsort(times, kind="stable"):
            if times[look] <= before:
                continue
            now = jax.tree.map(lambda x, look=look: x[look], states)
            if not surely[look] and self._reserve(now, span, float(times[look])) < 1:
                return self._released(segment, state, span, step, before, float(times[look]))
            before = float(times[look])
        return segment

    def _at_corners(self, state: State, span: Span, step: Array) -> Iterator[tuple[np.ndarray, State]]:
        """The times just before and at each corner within the span, and the states there, some hundred at a time."""
        begin, end = float(span.start + span.offset), float(span.start) + float(span.grid[-1])
        within = self._corners[(self._corners > begin) & (self._corners < end)]
        for first in range(0, within.size, CHUNK_SAMPLES // 2):
            corners = np.resize(within[first : first + CHUNK_SAMPLES // 2], CHUNK_SAMPLES // 2)
            corners = np.maximum.accumulate(corners)  # as many as fill a chunk
            times = np.stack([np.nextafter(corners, -np.inf), corners], axis=1).ravel()
            looks = np.append(np.float64(span.offset), times - float(span.start))
            states = self._moved(state, span._replace(looks=looks), step).states
            yield np.append(begin, times), states

    def _moved(self, state: State, span: Span, step: Array) -> Segment:
        """Move with the drum: at its own speed, which the integral of its rate has but to the tolerance."""
        assert self._held is not None
        segment = advance(
            self._held, self._steady, state, span, self._tolerance, step, self._choice.explicit,
            budget=self._budget(span, np.full(2, float(STEP_BUDGET))), observes=self._observes,
        )  # fmt: skip
        velocity = drum_motions(self._model, span.inside(span.start + span.grid), segment.states.velocity)
        final = drum_motion(self._model, span.inside(span.start + segment.time), segment.final.velocity)
        return segment._replace(
            states=segment.states._replace(velocity=velocity), final=segment.final._replace(velocity=final)
        )

    def _reserve(self, state: State, span: Span, time: float) -> float:
        q = self._steady + state.vibration
        return hold(self._model, span.inside(time), q, state.velocity, state.memory, slips=False).reserve

    def _released(
        self, segment: Segment, state: State, span: Span, step: Array, before: float, after: float
    ) -> Segment:
        """The segment up to the time (s of the transient) at which friction ceases to hold."""

        def at(time: float) -> State:
            if time <= float(span.start + span.offset):
                return state
            until = np.float64(time - float(span.start))
            return self._moved(state, span._replace(until=until), step).final

        def excess(time: float) -> float:
            return self._reserve(at(time), span, time) - 1

        time = before
        if after - before <= TIMING * float(span.length):  # a corner between the two, say: it holds up to there
            time = float(np.nextafter(after, np.inf))
        elif excess(before) > 0:
            time = scipy.optimize.brentq(excess, before, after, xtol=TIMING * float(span.length))
        assert isinstance(time, float)
        yes, no = np.True_, np.False_
        passed = np.float64(time - float(span.start))
        return segment._replace(final=at(time), time=passed, step=step, reached=no, halted=yes)

    def _changed(self, state: State, span: Span, least: float, *, ends: bool = False) -> State:
        """The state to go on with where hardly anything slips: at rest on the drum, or slipping off it."""
        q = self._steady + state.vibration
        found = hold(self._model, span.now, q, state.velocity, state.memory, ends=ends)
        velocity = drum_motion(self._model, span.now, state.velocity)
        if found.reserve >= 1 and not ends:
            self._held = held(self._model)
            return state._replace(velocity=velocity)
        self._held = None
        return state._replace(velocity=velocity + AWAY * least * jnp.asarray(found.direction))


def _jumps(model: Model) -> tuple[np.ndarray, float]:
    """Times (s) from 0 on at which the drum stops, starts or turns round: friction jumps; and how near is there."""
    speed = model.operation.drum_speed
    if isinstance(speed, Constant) or model.contact.friction is None:
        return np.zeros(1), 0.0
    time, value = np.asarray(speed.time), np.asarray(speed.value)
    turns = np.flatnonzero(value[:-1] * value[1:] < 0)
    crossed = time[turns] + np.diff(time)[turns] * value[turns] / (value[turns] - value[turns + 1])
    padded = np.pad(value, 1, mode="edge")
    rests = time[(value == 0) & ((padded[:-2] != 0) | (padded[2:] != 0))]
    jumps = np.sort(np.concatenate([crossed, rests]))
    return np.concatenate([[0.0], jumps[jumps > 0]]), MARGIN * float(np.max(np.abs(time)))


def _only_reached(whole: Segment, span: Span) -> Segment:
    """A chunk that ends early: without samples of what did not come to pass."""
    there = np.arange(len(whole.states.work)) * float(span.interval) <= float(whole.time)
    vibration, velocity = (np.where(there[:, None], x, np.nan) for x in whole.states[:2])
    states = whole.states._replace(vibration=vibration, velocity=velocity)
    return whole._replace(states=states, reached=np.False_)


def _joined(whole: Segment, segment: Segment, span: Span) -> Segment:
    """Samples up to where the segment begins from the one, later ones from the other."""
    earlier = np.arange(len(whole.states.work)) * float(span.interval) <= float(span.offset)

    def join(old: Any, new: Any) -> Any:
        after = earlier.reshape(-1, *[1] * (np.ndim(new) - 1))
        return np.where(after, np.asarray(old), np.asarray(new))

    joined = {
        name: jax.tree.map(join, getattr(whole, name), getattr(segment, name))
        for name in ("states", "observation", "kinetic", "potential")
    }
    counts = {"steps": whole.steps + segment.steps, "kept": whole.kept + segment.kept}
    return segment._replace(**joined, **counts)
