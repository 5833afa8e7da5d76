"""Models along a parameter, and the branches of their cycles that are followed from a Hopf point or from a cycle."""

from collections.abc import Callable

import numpy as np

from drumsqueal.errors import CycleError
from drumsqueal.physics.model import Model
from drumsqueal.questions.cycle.continuation import Ended, Track
from drumsqueal.questions.cycle.diagram import Branch, End
from drumsqueal.questions.cycle.orbit import Closed, Cycle, Shooting, Start, Vector, describe, scale_near
from drumsqueal.questions.cycle.search import cycle_from
from drumsqueal.questions.cycle.starts import modal_start, reach, released_start
from drumsqueal.solve.linear.branches import Critical, point_at
from drumsqueal.solve.transient.sticking import can_stick

SMALL = 0.02  # amplitude of the first cycle near a Hopf point, over that at which the drum's speed is reached

OnBranch = Callable[[Branch], object]


class Family:
    """Models along a parameter within bounds, given with their derivative, and the branches of their cycles."""

    def __init__(
        self,
        models: Callable[[float], tuple[Model, Model]],
        bounds: tuple[float, float],
        on_flow: Callable[[], object] = lambda: None,
    ) -> None:
        """Take the models; `on_flow` is called before each integration over a period."""
        self._models, self._bounds, self.on_flow = models, bounds, on_flow
        self.low, self.high = bounds

    def model_at(self, value: float) -> Model:
        """The model at a value."""
        return self._models(value)[0]

    def steady_at(self, value: float) -> Vector | None:
        """Steady sliding (n,) at a value, None where there is none."""
        point = point_at(self.model_at, value)
        return None if point.reason else point.steady

    def from_hopf(self, critical: Critical, on_branch: OnBranch) -> Branch:
        """Follow the branch that begins with amplitude zero at a Hopf point. Raises CycleError where there is none."""
        value, model = critical.value, self.model_at(critical.value)
        point = point_at(self.model_at, value)
        mode = min(point.modes, key=lambda mode: abs(mode.growth_rate))
        amplitude = reach(model, mode)
        start = modal_start(point.steady, mode, SMALL * amplitude)
        shooting = self._shooting(value, modal_start(point.steady, mode, amplitude), point.steady)
        guess = shooting.scaled(start.state, start.period, value)
        rest = shooting.scaled(np.append(point.steady, 0 * point.steady), start.period, value)
        closed = shooting.close(guess, guess - rest)
        if closed is None:
            raise CycleError("Newton's method finds no cycle next to it")
        cycles, (end, detail) = self._follow(shooting, closed, guess - rest, End.HOPF, on_branch)
        if not cycles:
            raise CycleError(detail)
        return Branch(start=End.HOPF, end=end, end_detail=detail, cycles=tuple(cycles))

    def sticking_at(self, value: float) -> Cycle | None:
        """The cycle to which a motion leads that begins at rest on the drum; None where that does not stick again.

        Raises CycleError where it does and no cycle is found, or where it cannot be followed.
        """
        steady, model = self.steady_at(value), self.model_at(value)
        if steady is None or not can_stick(model, at_rest=False):
            return None
        self.on_flow()
        start = released_start(model, steady)
        if start is None:
            return None
        return cycle_from(model, start, steady, self.on_flow).model_copy(update={"value": value})

    def both_ways(self, cycle: Cycle, on_branch: OnBranch = lambda _: None) -> Branch:
        """Follow the branch of a cycle at a value to either side. Raises CycleError where Newton's method loses it."""
        steady = self.steady_at(cycle.value)
        if steady is None:
            raise CycleError("there is no steady sliding to measure it from")
        shooting = self._shooting(cycle.value, Start(cycle.state, cycle.period_s, ""), steady)
        closed = shooting.close(shooting.scaled(cycle.state, cycle.period_s, cycle.value))
        if closed is None:
            raise CycleError("Newton's method loses the cycle that it had found")
        upwards = np.eye(closed.unknowns.size)[-1]
        down, first = self._follow(shooting, closed, -upwards, End.CUT_OFF, on_branch)
        if first.end is End.LOOP:
            return Branch(start=End.LOOP, end=End.LOOP, cycles=tuple(down))
        up, last = self._follow(shooting, closed, upwards, End.CUT_OFF, on_branch)
        ends = {"start": first.end, "start_detail": first.detail, "end": last.end, "end_detail": last.detail}
        return Branch(**ends, cycles=(*reversed(down), *up[1:]))

    def between(self, value: float, a: Cycle, b: Cycle) -> Cycle | None:
        """The cycle of a branch at a value between two of its cycles, None where Newton's method does not find it."""
        steady, fraction = self.steady_at(value), (value - a.value) / (b.value - a.value)
        if steady is None:
            return None
        state = (1 - fraction) * a.state + fraction * b.state
        start = Start(state, (1 - fraction) * a.period_s + fraction * b.period_s, "")
        shooting = self._shooting(value, start, steady)
        closed = shooting.close(shooting.scaled(start.state, start.period, value))
        try:
            return None if closed is None else describe(shooting, closed)
        except CycleError:
            return None

    def _shooting(self, value: float, start: Start, steady: Vector) -> Shooting:
        width = self._bounds[1] - self._bounds[0]
        return Shooting(self._models, scale_near(self.model_at(value), start, steady, width), self.on_flow)

    def _follow(
        self, shooting: Shooting, closed: Closed, ahead: Vector, start: End, on_branch: OnBranch
    ) -> tuple[list[Cycle], Ended]:
        track = Track(shooting, self._bounds, self.steady_at, start, on_branch)
        ended = track.follow(closed, ahead)
        return track.cycles, ended
