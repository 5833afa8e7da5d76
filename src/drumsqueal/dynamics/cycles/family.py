"""Models along a parameter, and the branches of their cycles that are followed from a Hopf point or from a cycle."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress

import numpy as np

from drumsqueal.dynamics.cycles.continuation import Ended, Track, halves, is_mirrored
from drumsqueal.dynamics.cycles.cycle import Cycle, Event, describe
from drumsqueal.dynamics.cycles.diagram import BranchEnd, CycleBranch
from drumsqueal.dynamics.cycles.search import Seed, cycle_from
from drumsqueal.errors import CycleError
from drumsqueal.physics.model import Model
from drumsqueal.solve.cycles.crossing import BESIDE, NEARER
from drumsqueal.solve.cycles.shooting import Closed, Shooting, ShootingStart, Vector, scale_near
from drumsqueal.solve.cycles.starts import modal_start, reach, released_start
from drumsqueal.solve.linear.branches import Critical, point_at
from drumsqueal.solve.transient.sticking import can_stick

# Amplitude of the first cycle near a Hopf point, and of what leaves steady sliding, over that at which the drum's speed
# is reached.
SMALL = 0.02

OnBranch = Callable[[CycleBranch], object]


class CycleFamily:
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
        self.width = self.high - self.low

    def model_at(self, value: float) -> Model:
        """The model at a value."""
        return self._models(value)[0]

    def steady_at(self, value: float) -> Vector | None:
        """Steady sliding (n,) at a value, None where there is none."""
        point = point_at(self.model_at, value)
        return None if point.reason else point.steady

    def from_hopf(self, critical: Critical, on_branch: OnBranch) -> CycleBranch:
        """Follow the branch that begins with amplitude zero at a Hopf point. Raises CycleError where there is none."""
        value, model = critical.value, self.model_at(critical.value)
        point = point_at(self.model_at, value)
        mode = min(point.modes, key=lambda mode: abs(mode.growth_rate))
        amplitude = reach(model, mode)
        start = modal_start(model, point.steady, mode, SMALL * amplitude)
        shooting = self._shooting(value, modal_start(model, point.steady, mode, amplitude), point.steady)
        guess = shooting.scaled(start.state, start.period, value)
        rest = shooting.scaled(np.append(point.steady, 0 * point.steady), start.period, value)
        closed = shooting.close(guess, guess - rest)
        if closed is None:
            raise CycleError("Newton's method finds no cycle next to it")
        cycles, (end, detail) = self._follow(shooting, closed, guess - rest, BranchEnd.HOPF, on_branch)
        return CycleBranch(start=BranchEnd.HOPF, end=end, end_detail=detail, cycles=tuple(cycles))

    def from_doubling(self, doubled: Cycle, on_branch: OnBranch) -> CycleBranch:
        """Follow the cycles of twice the period that begin at a period doubling.

        They leave along the direction that changes its sign in a period. Raises CycleError where there are none.
        """
        period = 2 * doubled.period_s
        shooting = self._shooting_from(doubled.model_copy(update={"period_s": period}))
        multipliers, directions = np.linalg.eig(
            shooting.flow(shooting.scaled(doubled.state, doubled.period_s, doubled.value)).transition
        )
        ahead = np.append(np.real(directions[:, np.argmin(np.abs(multipliers + 1))]), [0.0, 0.0])
        closed = self._beside(shooting, shooting.scaled(doubled.state, period, doubled.value), ahead, doubled=True)
        if closed is None:
            raise CycleError("Newton's method finds no cycle of twice the period next to it")
        cycles, (end, detail) = self._follow(shooting, closed, ahead, BranchEnd.DOUBLING, on_branch)
        first = doubled.model_copy(update={"period_s": period, "multipliers": doubled.multipliers**2})
        return CycleBranch(start=BranchEnd.DOUBLING, end=end, end_detail=detail, cycles=(first, *cycles))

    def from_crossing(self, cycle: Cycle, on_branch: OnBranch) -> CycleBranch:
        """Follow the branch that goes through a cycle of another one, to both sides of it.

        Where it leaves that one without a change of the parameter, at a pitchfork, and its sides are mirror images, one
        is followed. It is lost at the cycle itself on a side where no other is found. Raises CycleError where none is
        on either.
        """
        shooting = self._shooting_from(cycle)
        at = shooting.scaled(cycle.state, cycle.period_s, cycle.value)
        ahead = cycle.crossing / shooting.scale
        ahead /= np.linalg.norm(ahead)
        sides = []
        for way in (ahead,) if ahead[-1] == 0 and is_mirrored(shooting, at, ahead) else (-ahead, ahead):
            try:
                closed = self._beside(shooting, at, way)
                if closed is None:
                    raise CycleError("Newton's method finds no cycle of the branch that crosses there")
                cycles, ended = self._follow(shooting, closed, way, BranchEnd.CUT_OFF, on_branch)
            except CycleError as error:  # the other side may be found all the same
                cycles, ended = [], Ended(BranchEnd.LOST, str(error))
            if ended.end is BranchEnd.LOOP:
                return CycleBranch(start=BranchEnd.LOOP, end=BranchEnd.LOOP, cycles=tuple(cycles))
            sides.append((cycles, ended))
        up, last = sides[-1]
        down, first = sides[0] if len(sides) > 1 else ([], Ended(BranchEnd.PITCHFORK))
        if not (down or up):
            raise CycleError(last.detail)
        return _joined((*reversed(down), cycle, *up), first, last)

    def meeting(self, cycle: Cycle, on_branch: OnBranch) -> CycleBranch:
        """Follow the branch that another one meets at a cycle of it. Raises CycleError where there is none."""
        if cycle.crossing is not None:
            return self.from_crossing(cycle, on_branch)
        if cycle.what is not Event.DOUBLING:
            raise CycleError(f"what begins at a {cycle.what} is not followed")
        if np.min(np.abs(cycle.multipliers - 1)) < np.min(np.abs(cycle.multipliers + 1)):  # it is the doubled one
            return self.both_ways(cycle.model_copy(update={"period_s": cycle.period_s / 2}), on_branch)
        return self.from_doubling(cycle, on_branch)

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

    def leaving(self, value: float) -> tuple[Seed, ...]:
        """What leaves steady sliding along the mode that grows fastest at a value, if one does."""
        growing = [mode for mode in point_at(self.model_at, value).modes if mode.unstable]
        if not growing:
            return ()
        model, mode = self.model_at(value), max(growing, key=lambda mode: mode.growth_rate)
        moved = SMALL * reach(model, mode) * mode.right[: len(model.names)].real
        return (Seed(value, {"displacement": dict(zip(model.names, moved.tolist(), strict=True))}),)

    def both_ways(self, cycle: Cycle, on_branch: OnBranch = lambda _: None) -> CycleBranch:
        """Follow the branch of a cycle at a value to either side. Raises CycleError where Newton's method loses it."""
        shooting = self._shooting_from(cycle)
        closed = shooting.close(shooting.scaled(cycle.state, cycle.period_s, cycle.value))
        if closed is None:
            raise CycleError("Newton's method loses the cycle that it had found")
        upwards = np.eye(closed.unknowns.size)[-1]
        down, first = self._follow(shooting, closed, -upwards, BranchEnd.CUT_OFF, on_branch)
        if first.end is BranchEnd.LOOP:
            return CycleBranch(start=BranchEnd.LOOP, end=BranchEnd.LOOP, cycles=tuple(down))
        up, last = self._follow(shooting, closed, upwards, BranchEnd.CUT_OFF, on_branch)
        return _joined((*reversed(down), *up[1:]), first, last)

    def between(self, value: float, a: Cycle, b: Cycle) -> Iterator[Cycle]:
        """The cycles at a value that Newton's method finds from between two cycles of a branch and from each of them.

        Those two may have been cut at different phases: what is between them is then no good start.
        """
        steady, fraction = self.steady_at(value), (value - a.value) / (b.value - a.value)
        if steady is None:
            return
        middle = ShootingStart(
            (1 - fraction) * a.state + fraction * b.state, (1 - fraction) * a.period_s + fraction * b.period_s, ""
        )
        for start in (middle, ShootingStart(a.state, a.period_s, ""), ShootingStart(b.state, b.period_s, "")):
            shooting = self._shooting(value, start, steady)
            closed = shooting.close(shooting.scaled(start.state, start.period, value))
            if closed is not None:
                with suppress(CycleError):
                    yield describe(shooting, closed)

    def _shooting_from(self, cycle: Cycle) -> Shooting:
        """In the scale of a cycle at a value. Raises CycleError where there is no steady sliding."""
        steady = self.steady_at(cycle.value)
        if steady is None:
            raise CycleError("there is no steady sliding to measure it from")
        return self._shooting(cycle.value, ShootingStart(cycle.state, cycle.period_s, ""), steady)

    def _shooting(self, value: float, start: ShootingStart, steady: Vector) -> Shooting:
        return Shooting(self._models, scale_near(self.model_at(value), start, steady, self.width), self.on_flow)

    def _beside(self, shooting: Shooting, at: Vector, way: Vector, *, doubled: bool = False) -> Closed | None:
        """The first cycle of a branch that leaves another one on a way (2n + 2,), nearer if the range ends first.

        Where it is `doubled`, nearer too if that is the other cycle twice, some way along its branch: half a period
        later that is where it was, and a doubled one twice the step away.
        """
        for step in BESIDE / 2 ** np.arange(NEARER):
            closed = shooting.close(at + step * way, way)
            if closed is None:
                return None
            alike = doubled and np.linalg.norm(halves(shooting, closed)) < step
            if not alike and self.low <= shooting.unscaled(closed.unknowns)[2] <= self.high:
                return closed
        return None

    def _follow(
        self, shooting: Shooting, closed: Closed, ahead: Vector, start: BranchEnd, on_branch: OnBranch
    ) -> tuple[list[Cycle], Ended]:
        track = Track(shooting, self._bounds, self.steady_at, start, on_branch)
        ended = track.follow(closed, ahead)
        if not track.cycles:
            raise CycleError(ended.detail)
        return track.cycles, ended


def _joined(cycles: Sequence[Cycle], first: Ended, last: Ended) -> CycleBranch:
    ends = {"start": first.end, "start_detail": first.detail, "end": last.end, "end_detail": last.detail}
    return CycleBranch(**ends, cycles=tuple(cycles))
