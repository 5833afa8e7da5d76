"""Motions that branches of cycles may begin at: settled ones, closed by Newton's method where they are periodic."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from drumsqueal.errors import CycleError
from drumsqueal.findings.vibration import amplitudes_apart
from drumsqueal.physics.model import Model
from drumsqueal.progress import Progress
from drumsqueal.questions.cycle.continuation import SAME
from drumsqueal.questions.cycle.diagram import CycleBranch, OffBranch, Why
from drumsqueal.questions.cycle.orbit import Cycle, between, unlike
from drumsqueal.questions.cycle.search import cycle_from, recorded
from drumsqueal.solve import motion
from drumsqueal.solve.linear.modes import analyse_stability
from drumsqueal.solve.shooting import ShootingStart
from drumsqueal.solve.transient.runge_kutta import AUTO

TOLERANCE = 1e-8  # of the record
OWN = 0.05  # of its amplitudes, by which the cycle that Newton's method finds may differ from the motion


class Seed(NamedTuple):
    """A settled motion at a value of the parameter: a start as `integrate` takes it, and its line (Hz), if known."""

    value: float
    start: motion.Start
    frequency_Hz: float | None = None


class Settled(NamedTuple):
    """The motion that a seed is: period (s), None where it has none, amplitudes by name (m, rad), and its end (2n,)."""

    value: float
    period: float | None
    amplitude: dict[str, float]
    frequency_Hz: float | None
    state: np.ndarray
    words: str
    at_rest: bool = False

    def off(self, why: Why, reason: str) -> OffBranch:
        """The finding that it is on no branch."""
        return OffBranch(
            value=self.value, frequency_Hz=self.frequency_Hz, amplitude=self.amplitude, why=why, reason=reason
        )


def settled_at(seed: Seed, model: Model, progress: Progress) -> Settled:
    """Record the motion of a seed and find its period. Raises CycleError where it cannot be recorded."""
    if not analyse_stability(model).oscillations:
        raise CycleError("nothing oscillates there, even without damping")
    how: Any = {"duration": None, "sample_rate": None, "tolerance": TOLERANCE, "solver": AUTO}
    transient = motion.constant_transient(model, seed.start, **how)
    record = recorded(transient, progress, "motion that a branch may begin at")
    if not record.states.size:
        raise CycleError(f"it {record.words}")
    n = len(model.names)
    amplitude = np.ptp(record.states[:, :n], axis=0) / 2
    line = seed.frequency_Hz if record.period is None else 1 / record.period
    return Settled(
        seed.value, record.period, dict(zip(model.names, amplitude.tolist(), strict=True)), line, record.states[-1],
        record.words, record.ends_at_rest,
    )  # fmt: skip


def closed_from(found: Settled, model: Model, steady: np.ndarray, on_flow: Callable[[], object]) -> Cycle:
    """The cycle that a motion is on, by its period or that of its line. Raises CycleError where it is on none."""
    if found.frequency_Hz is None:
        raise CycleError(f"it {found.words}")
    try:
        cycle = cycle_from(
            model, ShootingStart(found.state, 1 / found.frequency_Hz, "the motion found"), steady, on_flow
        )
        if amplitudes_apart(cycle.amplitude, found.amplitude, model.mass) > OWN:
            raise CycleError(f"Newton's method ends at another cycle, of {cycle.frequency_Hz:.5g} Hz")
        if not (cycle.stable or cycle.neutral):
            raise CycleError(f"Newton's method ends at an unstable cycle near it, of {cycle.frequency_Hz:.5g} Hz")
    except CycleError:
        if found.period is None:
            raise CycleError(f"it {found.words}") from None
        raise
    return cycle.model_copy(update={"value": found.value})


def on_branch(branches: Sequence[CycleBranch], period: float, amplitude: dict[str, float], value: float) -> bool:
    """Whether a motion lies on a branch, by period and amplitudes between two neighbouring cycles."""
    return any(unlike(between(a, b, value), period, amplitude) < SAME for a, b in _around(branches, value))


def is_branch_cycle(
    branches: Sequence[CycleBranch], cycle: Cycle, closed: Callable[[Cycle, Cycle], Iterable[Cycle]]
) -> bool:
    """Whether a cycle is one of a branch; `closed` closes those of the branch at its value, between two others."""
    for a, b in _around(branches, cycle.value):
        if not cycle.neutral and cycle.unstable_directions not in (a.unstable_directions, b.unstable_directions):
            continue  # on the other side of a fold, however near; of what is neutral, round-off counts the directions
        off = unlike(between(a, b, cycle.value), cycle.period_s, cycle.amplitude)
        # 0.3 relative difference of period and amplitudes to a branch within which its own cycle is closed and compared
        if off < SAME or (off < 0.3 and any(_equal(own, cycle) for own in closed(a, b))):
            return True
    return False


def repeats(branch: CycleBranch, other: CycleBranch, between: Callable[..., Iterable[Cycle]]) -> bool:
    """Whether each cycle of a branch is on another one, but for its ends: one branch goes a little further there."""
    inner = [cycle for cycle in branch.cycles[1:-1] if cycle.what is None]
    return bool(inner) and all(is_branch_cycle((other,), cycle, partial(between, cycle.value)) for cycle in inner)


def _around(branches: Sequence[CycleBranch], value: float) -> list[tuple[Cycle, Cycle]]:
    """Neighbouring cycles of the branches on either side of a value."""
    pairs = [pair for branch in branches for pair in pairwise(branch.cycles)]
    return [(a, b) for a, b in pairs if a.value != b.value and (a.value - value) * (b.value - value) <= 0]


def _equal(one: Cycle, other: Cycle) -> bool:
    # 1e-4 relative difference of two cycles that were closed at one value and are one
    return unlike(one, other.period_s, other.amplitude) < 1e-4
