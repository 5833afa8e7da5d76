"""Cycles along a parameter: the diagram of their branches as these are added one by one."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from functools import partial
from itertools import pairwise
from typing import Any

import jax
import numpy as np

from drumsqueal.dynamics.cycles.cycle import SAME, Cycle, Event, off_between, unlike
from drumsqueal.dynamics.cycles.diagram import (
    BEARING,
    BranchEnd,
    CycleBranch,
    Diagram,
    OffBranch,
    Unfollowed,
    Why,
    steady_sliding,
)
from drumsqueal.dynamics.cycles.family import CycleFamily, OnBranch
from drumsqueal.dynamics.cycles.search import RecordedMotion, Seed, closed_from, recorded_at
from drumsqueal.errors import CycleError
from drumsqueal.physics.model import Model
from drumsqueal.progress import Progress, silent
from drumsqueal.solve.linear.branches import Critical, follow_modes

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
        try:
            record = recorded_at(seed, model, self._progress)
        except CycleError as error:
            return [_off_branch(seed, None, {}, Why.NOT_RECORDED, error)]
        amplitude = dict(zip(model.names, record.amplitude.tolist(), strict=True))
        if record.ends_at_rest:  # which is steady sliding, and no cycle
            return []
        if record.period is not None and _is_on(self.diagram.branches, seed.value, record.period, amplitude):
            return []
        off = partial(_off_branch, seed, record, amplitude)
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


def _off_branch(
    seed: Seed, record: RecordedMotion | None, amplitude: dict[str, float], why: Why, reason: object
) -> OffBranch:
    period = None if record is None else record.period
    line = seed.frequency_Hz if period is None else 1 / period
    return OffBranch(value=seed.value, frequency_Hz=line, amplitude=amplitude, why=why, reason=str(reason))


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
        if off < SAME or (off < 0.3 and any(_equal(own, cycle) for own in closed(a, b))):
            return True
    return False


def _equal(one: Cycle, other: Cycle) -> bool:
    # 1e-4 relative difference of two cycles that were closed at one value and are one
    return unlike(one, other.period_s, other.amplitude) < 1e-4


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
