"""A chunk of a transient through all that changes in it: slip and stick, the method, the drum's direction."""

from itertools import pairwise
from typing import Any, NamedTuple

import jax
import numpy as np
from jax import Array
from jax.errors import JaxRuntimeError

from drumsqueal.errors import RequestError
from drumsqueal.physics.effects.operation import Constant
from drumsqueal.physics.model import Model
from drumsqueal.solve.transient.runge_kutta import AUTO, DEFAULT, DIFFRAX, IMPLICIT, check_solver
from drumsqueal.solve.transient.segment import (
    CORNER_BUDGET,
    STEP_BUDGET,
    Segment,
    advance,
    advance_packed,
    first_step,
    no_rows,
)
from drumsqueal.solve.transient.state import Span, State
from drumsqueal.solve.transient.sticking import can_stick

STICKING_WHOLE = (
    "where the lining sticks as a whole friction is set-valued, and a solver of diffrax needs one value; the solver "
    '"auto" of drumsqueal follows stick and slip'
)
MOST_CHANGES = 1000  # in one call; a chunk goes on with another call
MARGIN = 1e-12  # of the drum's schedule: its jumps are looked at from so far, beyond round-off
# Steps that the explicit method gets where another may take over, at a tolerance of 1e-6, and how many more each
# BUDGET_RADIANS: where it takes more of them the implicit one gets through sooner, though a step of it takes four times
# as long (the nominal scene below a drum speed of 0.07 rad/s). A method of order eight takes 1.33 times as many for a
# tenth of the tolerance.
EXPLICIT_BUDGET = np.array([2_500.0, 10_000.0])
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
        check_solver(solver)
        self._automatic, self.of_diffrax = solver == AUTO, solver.startswith(DIFFRAX)
        self._explicit_budget = EXPLICIT_BUDGET * (1e-6 / tolerance) ** (1 / 8)
        self.method = method or Method(DEFAULT if self._automatic else solver)

    @property
    def solver(self) -> str:
        """Name of the method."""
        return self.method.name

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
        self._model, self._steady, self._tolerance = model, steady, tolerance
        self._rows = no_rows(model, observes=observes)
        self._kind = jax.tree.structure(model)
        self._jumps, self._margin = _jumps(model)
        self._may: dict[float, bool] = {}  # stick from the last jump on, by its time: asking takes as long as 100 steps
        corners = model.operation.corners
        self._corners = np.zeros(0) if corners is None else np.unique(corners)
        self.choice = Choice(solver, float(tolerance), method)
        self.sticks = sticks  # at the end of the last chunk
        self.solvers: set[str] = set()  # that made the last chunk
        self.changes: list[tuple[float, bool]] = []  # in the last chunk: when (s), and whether it sticks from then on

    def through(self, state: State, span: Span, step: Any) -> Segment:
        """One chunk: up to where something might stick by one program, from there on by one that few runs need."""
        rows, steps, kept, sticks, halted = self._rows, 0, 0, self.sticks, False
        self.solvers, self.changes = set(), []
        self.choice.begin()
        while True:
            span, fresh = self._between_jumps(span)
            sticks = sticks and not fresh  # what it does then is found out
            segment = self._advanced(state, span, step, rows, sticks=sticks, halted=halted)
            self._note(segment, span, sticks)
            rows, state, step = segment.rows, segment.final, segment.step
            steps, kept = steps + segment.steps, kept + segment.kept
            might_stick = segment.halted and not (sticks or halted or self.choice.of_diffrax)
            ended = segment.time >= span.length
            more = segment.reached or might_stick or self._goes_on(segment, span)
            if ended or not more:
                return segment._replace(steps=steps, kept=kept, reached=ended)
            span, sticks, halted = span._replace(offset=np.float64(segment.time)), segment.sticks, might_stick

    def _goes_on(self, segment: Segment, span: Span) -> bool:
        """Whether it does after all changes of a call, or all steps of a method.

        So many changes within a hundredth of a radian of the fastest mode are chatter, and would not come to an end.
        """
        if segment.halted:
            return not self.choice.of_diffrax and segment.time - span.offset > float(first_step(self._model))
        return segment.steps > 0 and self.choice.switch()

    def _note(self, segment: Segment, span: Span, sticks: bool) -> None:
        """Keep when the lining began to stick or to slip, and what it slipped by."""
        times = [span.offset, *segment.changes, segment.time]
        for begin, end in pairwise(times):
            if end > begin or end >= span.length:
                if sticks != self.sticks:
                    self.changes.append((float(span.start + begin), sticks))
                self.sticks = sticks
                self.solvers |= set() if sticks else {self.choice.solver}
            sticks = not sticks

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

    def _advanced(self, *begins: Any, **how: Any) -> Segment:
        """What one program makes of the span: all of it, or less."""
        try:
            return advance(*self._given(*begins, **how))
        except JaxRuntimeError as error:
            # XLA's status alone tells too little memory from a law of the user's own that calls what no kernel can, as
            # a sort or a solver of equations.
            if str(error).startswith("RESOURCE_EXHAUSTED"):
                raise MemoryError(str(error)) from error
            if self._kind in _beyond_kernels:
                raise
            _beyond_kernels.add(self._kind)
            return advance(*self._given(*begins, **how))

    def _given(self, state: State, span: Span, step: Any, rows: Any, *, sticks: bool, halted: bool) -> tuple[Any, ...]:
        """What `advance` is given."""
        given = self._model, self._steady, state, span, self._tolerance, step, self._budget(span), rows
        could_stick, most_changes = self._may_stick(span), MOST_CHANGES if sticks or halted else 0
        in_kernel = self._kind not in _beyond_kernels and not self.choice.of_diffrax
        how = self.choice.solver, in_kernel, could_stick, most_changes
        return *given, np.bool_(sticks), np.bool_(halted), *how

    def load_ahead(self, state: State, span: Span, step: Any) -> None:
        """Load or compile, in another thread, the program of a first chunk that slips."""
        span = self._between_jumps(span)[0]
        advance_packed.ahead(lambda: self._given(state, span, step, self._rows, sticks=False, halted=False))

    def _budget(self, span: Span) -> np.ndarray:
        """The method's budget of steps, with some for each corner of what is prescribed in a chunk."""
        within = np.diff(np.searchsorted(self._corners, [float(span.start), float(span.start + span.length)]))[0]
        return self.choice.budget + np.array([CORNER_BUDGET * within, 0.0])


def check_slips(model: Model, duration: float = np.inf) -> None:
    """Raise RequestError where the drum rests at the start or comes to rest within the duration (s), and friction acts.

    There the lining sticks as a whole, which diffrax's solvers cannot follow.
    """
    times = _jumps(model)[0]
    rests = times if float(model.operation.at(0.0).drum_speed) == 0 else times[1:]
    if model.contact.friction is not None and rests.size and rests[0] <= duration:
        raise RequestError(f"the drum is at rest at t = {rests[0]:.6g} s: {STICKING_WHOLE}")


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
