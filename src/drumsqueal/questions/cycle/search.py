"""The periodic motion of a scene or a model: where to look for it, and Newton's method from there.

A search begins at the end of a transient, where a transient nearly returns to itself, and near the modes of steady
sliding.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, overload

import jax.numpy as jnp
import numpy as np

from drumsqueal.errors import CycleError, IntegrationError
from drumsqueal.findings.decay import decay_to_rest
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.schema import Findings
from drumsqueal.findings.signals.regime import classify
from drumsqueal.findings.vibration import Vibration
from drumsqueal.physics.model import Model
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.cycle.orbit import NEUTRAL, Cycle, cut_in_slip, describe, unlike
from drumsqueal.questions.cycle.starts import modal_starts, reach, returns
from drumsqueal.questions.cycle.words import cycle_verdict, regime_words
from drumsqueal.scene import Scene, SceneError
from drumsqueal.scene.shoes import check_one
from drumsqueal.simulation import check_constant, constant_transient
from drumsqueal.solve import motion
from drumsqueal.solve.shooting import CLOSED, Closed, Shooting, ShootingStart, Vector, scale_near
from drumsqueal.solve.transient.flow import state_size
from drumsqueal.solve.transient.integrate import Chunk
from drumsqueal.solve.transient.runge_kutta import AUTO

SMALLEST = 1e-4  # of the scale of the start: what has shrunk to less is steady sliding, not a cycle
FRACTIONS = (0.6, 0.3, 0.15)  # last parts of a transient that may have settled
FEWEST_SAMPLES = 64
SAME = 1e-6  # relative difference of period and amplitudes below which two cycles are one
RELEASES = 2  # of the contact from the drum in a period, at most, where a search begins


class FoundCycle(Cycle):
    """A cycle that a search found, and where it was started from."""

    found_from: str = ""


class CycleSearch(FoundCycle):
    """The cycle that a search found, where it was started from, what the transient does, and the other cycles."""

    printed_by = "drumsqueal.questions.cycle.answer.print_cycle"
    verdict: str
    transient: str
    others: tuple[FoundCycle, ...] = ()


class CycleStudy(Findings, CycleSearch):
    """A `CycleSearch` of a scene, with the scene: what `find_cycle(scene)` returns."""


@overload
def find_cycle(scene: Scene, *, progress: Progress = ...) -> CycleStudy: ...


@overload
def find_cycle(
    scene: Model,
    start: motion.Start,
    duration: float | None = ...,
    *,
    sample_rate: float | None = ...,
    tolerance: float = ...,
    solver: str = ...,
    progress: Progress = ...,
) -> CycleSearch: ...


def find_cycle(
    scene: Scene | Model,
    start: motion.Start | None = None,
    duration: float | None = None,
    *,
    sample_rate: float | None = None,
    tolerance: float = 1e-6,
    solver: str = AUTO,
    progress: Progress = silent,
) -> CycleSearch | CycleStudy:
    """Find a periodic motion and its Floquet multipliers: `find_cycle(scene).multipliers`.

    Newton's method on the flow map over a period, started where the scene's transient ends and, where that is not
    periodic, where it nearly returns to itself and along each mode at the amplitudes at which friction gives as much
    as damping takes. Where none of that leads to a stable cycle, transients start from a disturbance along each mode,
    three times as fast as the drum, until one ends in one. A stable cycle is preferred, then the one found first.

    A model in place of a scene takes the start, duration (s) and sample rate (Hz) that `integrate` takes; by default
    200 periods of its slowest oscillation are recorded, with 20 samples in one of its fastest. Raises SceneError for a
    scene, ValueError for a model that changes with time, and CycleError where no cycle is found.

    ```pycon
    >>> def block(speed):
    ...     law = drumsqueal.ExponentialLaw(0.5, 0.3, 2.0)
    ...     return drumsqueal.block_on_belt(law, belt_speed=speed, damping=0.1)
    >>> cycle = drumsqueal.find_cycle(block(0.5), {"displacement": {"X": 0.1}}, 100.0, sample_rate=20.0)
    >>> f"{cycle.period_s:.3f} s, {cycle.amplitude['X']:.3f} m"
    '6.352 s, 0.552 m'
    ```
    """
    if isinstance(scene, Scene):
        return CycleStudy(scene=scene, **dict(_search(constant_transient(checked(scene)), progress)))
    if scene.forced:
        raise ValueError("a cycle is free motion; this model changes with time")
    how: Any = {"duration": duration, "sample_rate": sample_rate, "tolerance": tolerance, "solver": solver}
    return _search(motion.constant_transient(scene, start or {}, **how), progress)


def checked(scene: Scene) -> Scene:
    """The scene, if it has one shoe, its drum speed and load are constant and nothing else drives it.

    Raises SceneError, and RequestError for several shoes.
    """
    check_one(scene.shoe)
    if scene.forcing is not None:
        raise SceneError("a cycle is free motion; leave the force out (forcing=none)", ("forcing",))
    return check_constant(scene)


def _search(transient: motion.Transient, progress: Progress) -> CycleSearch:
    found: list[tuple[Cycle, str]] = []
    reasons: dict[str, list[str]] = {}  # why there is none, and the starts that lead to none for that

    def attempt(starts: Iterable[ShootingStart]) -> None:
        """Add the cycles that differ, each with where it was started from, and why there is none from other starts."""
        for start in starts:
            report = partial(progress, f"Newton's method from {start.origin}", 0, None)
            try:
                cycle = cycle_from(transient.model, start, transient.stability.steady_state, report)
            except CycleError as error:
                reasons.setdefault(str(error), []).append(start.origin)
                continue
            if not any(is_same(cycle, other) for other, _ in found):
                found.append((cycle, start.origin))

    record = recorded(transient, progress, "transient")
    attempt(_starts(transient, record))
    for disturbed, start in _disturbances(transient):
        if any(cycle.stable for cycle, _ in found):
            break
        after = recorded(start, progress, f"transient {disturbed}")
        lasting = list(_lasting(after, f"a transient {disturbed}"))
        if not lasting:
            reasons.setdefault(f"the transient {after.words}", []).append(disturbed)
        attempt(lasting)
    if not found:
        why = [f"{starts[0]}{_and_others(len(starts) - 1)}: {error}" for error, starts in reasons.items()]
        raise CycleError("; ".join([f"no periodic motion was found: the transient {record.words}", *why]))
    cycle, origin = min(found, key=lambda item: not item[0].stable)
    others = tuple(FoundCycle(found_from=start, **dict(other)) for other, start in found if other is not cycle)
    verdict, ends = cycle_verdict(cycle), record.words
    return CycleSearch(verdict=verdict, found_from=origin, transient=ends, others=others, **dict(cycle))


def _and_others(count: int) -> str:
    return f" and {count} other {'start' if count == 1 else 'starts'}" if count else ""


def cycle_from(
    model: Model, start: ShootingStart, steady: Vector, on_flow: Callable[[], object] = lambda: None
) -> Cycle:
    """The cycle of a model that Newton's method finds from a start; raises CycleError where there is none."""
    start = cut_in_slip(model, start)
    shooting = Shooting(lambda _: (model, None), scale_near(model, start, steady), on_flow)
    closed = shooting.close(shooting.scaled(start.state, start.period, 0.0))
    if closed is None:
        raise CycleError("Newton's method finds none")
    if np.max(np.abs(shooting.vibration(closed, steady))) < SMALLEST:
        raise CycleError("Newton's method ends at steady sliding")
    cycle = describe(shooting, _shortest(shooting, closed)).model_copy(update={"value": np.nan})
    if np.any(np.abs(cycle.multipliers - 1) < NEUTRAL):
        raise CycleError("it is one of a continuous family of periodic motions, as where nothing feeds or damps them")
    return cycle


def _shortest(shooting: Shooting, closed: Closed) -> Closed:
    """The same motion over its shortest period, if it repeats within the one that was found."""
    for parts in range(7, 1, -1):  # a motion may repeat so many times within a period that was found
        trial = closed.unknowns.copy()
        trial[-2] /= parts
        if np.max(np.abs(shooting.flow(trial).end - trial[:-2])) < np.sqrt(CLOSED):
            again = shooting.close(trial)
            if again is not None:
                return again
    return closed


def is_same(one: Cycle, other: Cycle) -> bool:
    """Whether two cycles are one, by period and amplitudes."""
    return unlike(one, other.period_s, other.amplitude) < SAME


@dataclass(frozen=True)
class RecordedMotion:
    """The last part of a transient: times (k,), states (k, 2n), what it does, its period if it has one.

    `releases` are all times (s) at which the contact began to slip after sticking.
    """

    time: Vector
    states: Vector
    words: str
    period: float | None = None
    at_rest: bool = False
    releases: tuple[float, ...] = ()
    ends_at_rest: bool = False  # after it has decayed


def recorded(transient: motion.Transient, progress: Progress, what: str) -> RecordedMotion:
    """The transient, of which so much is looked at as has settled."""
    model, stability, lowest = transient.model, transient.stability, transient.lowest_frequency_Hz
    chunks: list[Chunk] = []
    failed = ""
    try:
        transient.follow(chunks.append, progress, what=what)
    except IntegrationError as error:
        failed = f"failed: {error}"
    n = len(model.names)
    time = np.concatenate([np.empty(0), *(chunk.time for chunk in chunks)])
    moved = (np.hstack([chunk.displacement, chunk.velocity]) for chunk in chunks)
    states = np.concatenate([np.empty((0, 2 * n)), *moved])
    releases = tuple(when for chunk in chunks for when, sticks in chunk.changes if not sticks)
    if failed or lowest is None or time.size < FEWEST_SAMPLES / FRACTIONS[-1]:
        words = failed or ("is too short to judge" if lowest is not None else "cannot be judged: nothing oscillates")
        return RecordedMotion(time, states, words, releases=releases)
    for fraction in FRACTIONS:
        part = slice(int((1 - fraction) * time.size), None)
        scale = _size_of(transient, states[part])[:n]
        regime = classify(states[part, :n], transient.how["sample_rate"], scale=scale, lowest_frequency=lowest)
        if regime.kind is not Kind.UNDECIDED:
            break
    at_rest = regime.kind is Kind.STEADY
    if regime.kind is Kind.UNDECIDED:
        regime = decay_to_rest(regime, Vibration.of(chunks, stability), part, stability, stability.modes, model)
    ends_at_rest = regime.kind is Kind.STEADY
    return RecordedMotion(
        time[part], states[part], regime_words(regime), regime.period_s, at_rest, releases, ends_at_rest
    )


def _size_of(transient: motion.Transient, states: Vector) -> Vector:
    """Amplitudes (2n,) that the largest vibration of a record gives the coordinates."""
    model, steady = transient.model, transient.stability.steady_state
    n = len(steady)
    largest = states[np.argmax(np.abs(states[:, n:]) @ np.sqrt(np.asarray(model.mass)))]
    return np.asarray(state_size(model, jnp.asarray(largest[:n] - steady), jnp.asarray(largest[n:])))


def _disturbances(transient: motion.Transient) -> Iterator[tuple[str, motion.Transient]]:
    """The same model started along each mode so fast that slip is reversed."""
    for mode in transient.stability.vibrations:
        size = 3.0 * reach(transient.model, mode)  # a large disturbance, times the speed of the drum
        shape = size * mode.right[: len(transient.model.names)]
        velocity = (1j * mode.eigenvalue.imag * shape).real
        disturbed = transient._replace(displacement=shape.real, velocity=velocity)
        yield f"after a large disturbance along mode {mode.label}", disturbed


def _lasting(record: RecordedMotion, what: str) -> Iterator[ShootingStart]:
    """The end of a transient that is periodic, or the last times at which its contact began to slip."""
    if record.period is not None:
        yield ShootingStart(record.states[-1], record.period, f"the end of {what}")
        return
    for first in reversed(record.releases[-1 - RELEASES : -1]):
        last = record.releases[-1]
        after = min(int(np.searchsorted(record.time, last)), record.time.size - 1)
        yield ShootingStart(record.states[after], last - first, f"the last releases of the contact in {what}")


def _starts(transient: motion.Transient, record: RecordedMotion) -> Iterator[ShootingStart]:
    yield from _lasting(record, "the transient")
    if record.period is not None:
        return
    lowest = transient.lowest_frequency_Hz
    moves = record.time.size >= FEWEST_SAMPLES and np.ptp(record.states, axis=0).any() and not record.at_rest
    if lowest is not None and moves:
        yield from returns(record.time, record.states, _size_of(transient, record.states), lowest)
    yield from modal_starts(transient.model, transient.stability)
