"""Cycles along a parameter: branches from a Hopf point or from a cycle, one by one, and the diagram of them all."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from itertools import pairwise
from typing import Any

import jax
import numpy as np

from drumsqueal.dynamics.cycles.continuation import LOCATED, Ended, Track, halves, is_mirrored
from drumsqueal.dynamics.cycles.cycle import (
    BEARING,
    SAME,
    BranchEnd,
    Cycle,
    CycleBranch,
    Diagram,
    Event,
    OffBranch,
    Unfollowed,
    Why,
    describe,
    off_between,
    steady_sliding,
    unlike,
)
from drumsqueal.dynamics.cycles.search import (
    Seed,
    closed_from,
    cycle_from,
    modal_start,
    reach,
    recorded_at,
    released_start,
)
from drumsqueal.errors import CycleError
from drumsqueal.physics.model import Model
from drumsqueal.progress import Progress, silent
from drumsqueal.solve.linear.branches import Critical, follow_modes, point_at
from drumsqueal.solve.shooting import BESIDE, NEARER, Closed, Shooting, ShootingStart, Vector, scale_near
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
        self._models, self.on_flow = models, on_flow
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
            branch = self.both_ways(cycle.model_copy(update={"period_s": cycle.period_s / 2}), on_branch)
            return _with_doubling(branch, cycle.value)
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
        state = (1 - fraction) * a.state + fraction * b.state
        period = (1 - fraction) * a.period_s + fraction * b.period_s
        for start in ((state, period), (a.state, a.period_s), (b.state, b.period_s)):
            shooting = self._shooting(value, ShootingStart(*start, ""), steady)
            closed = shooting.close(shooting.scaled(*start, value))
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
        track = Track(shooting, (self.low, self.high), self.steady_at, start, on_branch)
        ended = track.follow(closed, ahead)
        if not track.cycles:
            raise CycleError(ended.detail)
        return track.cycles, ended


def _with_doubling(branch: CycleBranch, value: float) -> CycleBranch:
    """The branch that another one doubles at a value, with the name of that at the cycle there.

    Where a multiplier of that cycle is −1 to round-off there is no step on which it crosses the unit circle: nothing is
    located.
    """
    k = min(range(len(branch.cycles)), key=lambda k: abs(branch.cycles[k].value - value))
    cycle = branch.cycles[k]
    if cycle.what is not None or np.min(np.abs(cycle.multipliers + 1)) >= LOCATED**2:
        return branch
    named = cycle.model_copy(update={"what": Event.DOUBLING})
    return branch.model_copy(update={"cycles": (*branch.cycles[:k], named, *branch.cycles[k + 1 :])})


def _joined(cycles: Sequence[Cycle], first: Ended, last: Ended) -> CycleBranch:
    ends = {"start": first.end, "start_detail": first.detail, "end": last.end, "end_detail": last.detail}
    return CycleBranch(**ends, cycles=tuple(cycles))


VALUES = 60  # of the parameter, at which the eigenvalues are looked at first
SAME_VALUE = 1e-5  # of the range: what happens on two branches is found to ten times as much at least


class DiagramBuilder:
    """Adds branches of cycles to the `diagram` of a family of models."""

    def __init__(
        self,
        family: CycleFamily,
        diagram: Diagram,
        *,
        progress: Progress = silent,
        on_diagram: Callable[[Diagram], object] = lambda _: None,
    ) -> None:
        """Take what is known; `on_diagram` takes it after each further cycle."""
        self.diagram = diagram
        self._family, self._progress, self._on_diagram = family, progress, on_diagram

    @classmethod
    def of(
        cls,
        model_at: Callable[[Any], Model],
        low: float,
        high: float,
        values: int = VALUES,
        *,
        progress: Progress = silent,
        on_diagram: Callable[[Diagram], object] = lambda _: None,
    ) -> "DiagramBuilder":
        """Begin with steady sliding of a model that is a function of a number, looked at by so many values at first."""
        models = jax.jit(lambda value: jax.jvp(model_at, (value,), (1.0,)))
        family = CycleFamily(models, (low, high), partial(progress, "cycles", 0, None))
        linear = follow_modes(family.model_at, np.linspace(low, high, values).tolist(), progress)
        diagram = Diagram(
            linear=linear,
            branches=(),
            steady_sliding_stable=steady_sliding(linear, low, high, stable=True),
            steady_sliding_unstable=steady_sliding(linear, low, high, stable=False),
        )
        return cls(family, diagram, progress=progress, on_diagram=on_diagram)

    def from_hopf_points(self) -> Diagram:
        """Follow the branches that begin at Hopf points of steady sliding."""
        for critical in self.diagram.linear.critical:
            ended = (_ends_at(branch, critical, self._family.width) for branch in self.diagram.branches)
            if critical.frequency_Hz and not any(ended):
                origin = f"from the Hopf point of {critical.label} at {critical.value:.6g}"
                self._follow(origin, partial(self._family.from_hopf, critical))
        return self.diagram

    def from_cycle(self, cycle: Cycle, kind: str) -> None:
        """Follow the branch of a cycle, unless that is on one of the branches."""
        if not is_branch_cycle(self.diagram.branches, cycle, partial(self._family.between, cycle.value)):
            origin = f"from the {kind}cycle of {cycle.frequency_Hz:.6g} Hz"
            self._follow(origin, partial(self._family.both_ways, cycle))

    def from_rest(self, value: float) -> None:
        """Follow the branch to which a motion leads that begins at rest on the drum, if it sticks again."""
        try:
            cycle = self._family.sticking_at(value)
        except CycleError as error:
            self._lose(f"from rest on the drum: {error}")
        else:
            if cycle is not None:
                self.from_cycle(cycle, "sticking ")

    def from_steady_sliding(self, value: float) -> None:
        """Follow the branch to which a motion leads that leaves steady sliding, where no stable cycle is known."""
        if not any(first <= value <= last for first, last in self.diagram.stable_cycles):
            for seed in self._family.leaving(value):
                self._from_seed(seed)

    def from_seeds(self, seeds: Sequence[Seed]) -> None:
        """Follow the branches of settled motions, and note those that are on none in the end."""
        self._update(off_branches=tuple(off for seed in seeds for off in self._from_seed(seed)))

    def note(self, note: str) -> None:
        """Note what was looked for and not found."""
        self._update(notes=(*self.diagram.notes, note))

    def _from_seed(self, seed: Seed) -> list[OffBranch]:
        """Follow the branch of a settled motion; returns that it is on none, and why, if so."""
        model, steady = self._family.model_at(seed.value), self._family.steady_at(seed.value)
        if steady is None:
            return []
        line, amplitude = seed.frequency_Hz, dict[str, float]()

        def off(why: Why, reason: object) -> OffBranch:
            return OffBranch(value=seed.value, frequency_Hz=line, amplitude=amplitude, why=why, reason=str(reason))

        try:
            record = recorded_at(seed, model, self._progress)
        except CycleError as error:
            return [off(Why.NOT_RECORDED, error)]
        amplitude = dict(zip(model.names, record.amplitude.tolist(), strict=True))
        if record.ends_at_rest:  # which is steady sliding, and no cycle
            return []
        if record.period is not None:
            line = 1 / record.period
            if _is_on(self.diagram.branches, seed.value, record.period, amplitude):
                return []
        try:
            cycle = closed_from(seed, record, model, steady, self._family.on_flow)
        except CycleError as error:
            return [off(Why.NOT_PERIODIC if record.period is None else Why.NOT_CLOSED, error)]
        before = len(self.diagram.notes)
        self.from_cycle(cycle, f"motion found at {seed.value:.6g}, the ")
        return [off(Why.NOT_FOLLOWED, note) for note in self.diagram.notes[before:]]

    def _follow(self, origin: str, follow: Callable[[OnBranch], CycleBranch]) -> None:
        """Add the branch that is followed from an origin and those that it meets, or note why there is none."""
        try:
            branch = follow(self._report)
        except CycleError as error:
            self._lose(f"{origin}: {error}")
            return
        if not self._add(branch):  # what begins on the branch that it is part of was followed with that
            return
        followed = [self.diagram.branches[-1]]
        for branch in followed:  # which grows: a branch that another one meets is followed as that is
            for cycle in branch.meeting():  # with the values that they have on other branches
                if self._is_known(branch, cycle):
                    continue
                with suppress(CycleError):  # or what begins there stays unknown
                    if self._add(self._family.meeting(cycle, self._report)):
                        followed.append(self.diagram.branches[-1])

    def _report(self, branch: CycleBranch) -> None:
        """Say what is known with a branch as far as it has come."""
        self._on_diagram(self.diagram.model_copy(update={"branches": (*self.diagram.branches, branch)}))

    def _is_known(self, branch: CycleBranch, cycle: Cycle) -> bool:
        """Whether the branch that one meets at a cycle is there, or is no longer followed."""
        width, others = self._family.width, (each for each in self.diagram.branches if each is not branch)
        if any(_meet(cycle, own, width) for each in others for own in each.special):
            return True
        # Where it begins, another branch doubles, which may not be there yet.
        far = abs(cycle.value - branch.cycles[0].value)
        # Of the range: how long cycles of twice a period last at least until what begins at their own end is followed.
        # Each doubling is Feigenbaum's 4.67 times nearer to the next, so that all of those left lie within a
        # thousandth.
        return branch.start is BranchEnd.DOUBLING and cycle.what is Event.DOUBLING and 0 < far < 3.6e-3 * width

    def _add(self, branch: CycleBranch) -> bool:
        """Put a branch in the place of those that are parts of it, unless it is part of one itself."""
        before, family = self.diagram.branches, self._family
        if any(repeats(branch, each, family) for each in before):
            return False
        others = tuple(each for each in before if not repeats(each, branch, family))
        branches = (*others, _aligned(branch, others, family.width))
        known = _left_behind(before, family)
        lost = [each for each in self.diagram.not_followed if each not in known]
        self._update(branches=branches, not_followed=(*lost, *_left_behind(branches, family)))
        return True

    def _lose(self, reason: str) -> None:
        """Note cycles that are somewhere in the range and could not be followed."""
        if reason not in self.diagram.notes:
            self.note(reason)
            lost = Unfollowed(reason=reason, low=self._family.low, high=self._family.high)
            self._update(not_followed=(*self.diagram.not_followed, lost))

    def _update(self, **changed: Any) -> None:
        self.diagram = self.diagram.model_copy(update=changed)


def _is_on(branches: Sequence[CycleBranch], value: float, period: float, amplitude: dict[str, float]) -> bool:
    """Whether a motion lies on a branch, by period and amplitudes between two neighbouring cycles."""
    pairs = (pair for branch in branches for pair in pairwise(branch.cycles))
    return any(off_between(*pair, value, period, amplitude) < SAME for pair in pairs)


def is_branch_cycle(
    branches: Sequence[CycleBranch], cycle: Cycle, closed: Callable[[Cycle, Cycle], Iterable[Cycle]]
) -> bool:
    """Whether a cycle is one of a branch; `closed` closes those of the branch at its value, between two others."""
    for a, b in (pair for branch in branches for pair in pairwise(branch.cycles)):
        if not cycle.neutral and cycle.unstable_directions not in (a.unstable_directions, b.unstable_directions):
            continue  # on the other side of a fold, however near; of what is neutral, round-off counts the directions
        off = off_between(a, b, cycle.value, cycle.period_s, cycle.amplitude)
        # 0.3 relative difference of period and amplitudes to a branch within which its own cycle is closed and compared
        # and 1e-4 of two cycles that were closed at one value and are one
        own = closed(a, b) if SAME <= off < 0.3 else ()
        if off < SAME or any(unlike(each, cycle.period_s, cycle.amplitude) < 1e-4 for each in own):
            return True
    return False


def repeats(branch: CycleBranch, other: CycleBranch, family: CycleFamily) -> bool:
    """Whether each cycle of a branch is on another one, but for its ends: one branch goes a little further there."""
    inner = [cycle for cycle in branch.cycles[1:-1] if cycle.what is None]
    return bool(inner) and all(
        is_branch_cycle((other,), cycle, partial(family.between, cycle.value)) for cycle in inner
    )


def _left_behind(branches: Sequence[CycleBranch], family: CycleFamily) -> list[Unfollowed]:
    """What branches leave behind, but for what others have followed."""
    found = Counter(pair for branch in branches for pair in {(each.what, each.value) for each in branch.special})
    met = {value for (what, value), count in found.items() if what in BEARING and count > 1}
    return [each for branch in branches for each in branch.not_followed(family.low, family.high, met)]


def _meet(cycle: Cycle, other: Cycle, width: float) -> bool:
    """Whether what happens at cycles of two branches is one: those branches meet there, maybe doubling their period."""
    ratio = cycle.period_s / other.period_s
    alike = min(abs(ratio - 1), abs(ratio - 2), abs(ratio - 0.5)) < SAME
    return cycle.what is other.what and alike and abs(cycle.value - other.value) < SAME_VALUE * width


def _aligned(branch: CycleBranch, others: Sequence[CycleBranch], width: float) -> CycleBranch:
    """The branch with the values of what happens on others, too, as where it meets them."""

    def aligned(cycle: Cycle) -> Cycle:
        met = (each.value for branch in others for each in branch.special if _meet(cycle, each, width))
        return cycle.model_copy(update={"value": next(met, cycle.value)})

    return branch.model_copy(update={"cycles": tuple(map(aligned, branch.cycles))})


def _ends_at(branch: CycleBranch, critical: Critical, width: float) -> bool:
    """Whether a branch begins or ends at a Hopf point."""
    ends = [(branch.start, branch.cycles[0]), (branch.end, branch.cycles[-1])]
    near_hopf = 0.02  # of the range: a branch that ends there so near to a Hopf point ends at it
    return any(
        what is BranchEnd.HOPF
        and abs(cycle.value - critical.value) < near_hopf * width
        and abs(cycle.frequency_Hz / critical.frequency_Hz - 1) < near_hopf
        for what, cycle in ends
    )
