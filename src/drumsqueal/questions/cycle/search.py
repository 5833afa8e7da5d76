"""The periodic motion of a scene or a model, by shooting from its own transient or from its modes."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple, overload

import jax.numpy as jnp
import numpy as np

from drumsqueal.errors import CycleError, IntegrationError
from drumsqueal.findings.boundaries import boundary_ratios
from drumsqueal.findings.decay import is_decaying, rms_rate, slowest
from drumsqueal.findings.part import Finding
from drumsqueal.findings.schema import Findings
from drumsqueal.findings.signals.regime import Kind, classify
from drumsqueal.physics.effects.operation import Constant
from drumsqueal.physics.model import Model
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.cycle.orbit import NEUTRAL, Cycle, describe
from drumsqueal.questions.cycle.shooting import CLOSED, Closed, Scales, Shooting, Vector
from drumsqueal.questions.cycle.starts import Start, modal_starts, reach, returns
from drumsqueal.questions.cycle.words import cycle_verdict, decay_words, regime_words
from drumsqueal.scene import Scene, SceneError
from drumsqueal.simulation import check_sample_rate, prepare, start_of, steady_at_start
from drumsqueal.solve import motion
from drumsqueal.solve.linear.modes import Stability, analyse_stability
from drumsqueal.solve.transient.flow import state_size
from drumsqueal.solve.transient.integrate import Chunk, integrate
from drumsqueal.solve.transient.runge_kutta import AUTO

SMALLEST = 1e-4  # of the scale of the start: what has shrunk to less is steady sliding, not a cycle
FRACTIONS = (0.6, 0.3, 0.15)  # last parts of a transient that may have settled
FEWEST_SAMPLES = 64
FAST = 3.0  # a large disturbance, times the speed of the drum
MOST_PARTS = 7  # a motion may repeat so many times within a period that was found
SAME = 1e-6  # relative difference of period and amplitudes below which two cycles are one


class _Found(Finding):
    verdict: str
    found_from: str
    transient: str
    others: tuple[Cycle, ...] = ()


class CycleSearch(_Found, Cycle):
    """The cycle that a search found, where it was started from, what the transient does, and the other cycles."""


class CycleStudy(_Found, Findings, Cycle):
    """The same for a scene."""


class Transient(NamedTuple):
    """A motion that a cycle is sought from: the model and its modes, departure from steady sliding (n,), velocity (n,).

    `how` is the duration (s), sample rate (Hz), tolerance and method.
    """

    model: Model
    stability: Stability
    steady: Vector
    displacement: Vector
    velocity: Vector
    how: dict[str, Any]

    @property
    def sample_rate(self) -> float:
        """In Hz."""
        return self.how["sample_rate"]


@overload
def find_cycle(scene: Scene, *, progress: Progress = ...) -> CycleStudy: ...


@overload
def find_cycle(
    scene: Model,
    start: motion.Start,
    duration: float,
    *,
    sample_rate: float,
    tolerance: float = ...,
    solver: str = ...,
    progress: Progress = ...,
) -> CycleSearch: ...


def find_cycle(
    scene: Scene | Model,
    start: motion.Start | None = None,
    duration: float = 0.0,
    *,
    sample_rate: float = 0.0,
    tolerance: float = 1e-6,
    solver: str = AUTO,
    progress: Progress = silent,
) -> CycleSearch | CycleStudy:
    """Find a periodic motion and its Floquet multipliers: `find_cycle(scene).multipliers`.

    Newton's method on the flow map over a period, started where the scene's transient ends and, where that is not
    periodic, where it nearly returns to itself and along each mode at the amplitudes at which friction gives as much
    as damping takes. Where none of that leads to a stable cycle, transients start from a disturbance along each mode,
    `FAST` times as fast as the drum, until one ends in one. A stable cycle is preferred, then the one found first.

    A model in place of a scene takes the start, duration and sample rate that `integrate` takes. Raises SceneError for
    a scene, ValueError for a model that changes with time, and CycleError where no cycle is found.
    """
    if isinstance(scene, Scene):
        found = _search(_of_scene(scene), progress)
        return CycleStudy(scene=scene, **dict(found))
    how = {"duration": duration, "sample_rate": sample_rate, "tolerance": tolerance, "solver": solver}
    return _search(_of_model(scene, start or {}, how), progress)


def _of_scene(scene: Scene) -> Transient:
    prepared = prepare(checked(scene))
    check_sample_rate(prepared)
    start, simulate = start_of(scene, prepared.model.names), scene.simulate
    how = {name: getattr(simulate, name) for name in ("duration", "sample_rate", "tolerance", "solver")}
    return Transient(prepared.model, prepared.stability, steady_at_start(prepared), *start, how)


def _of_model(model: Model, start: motion.Start, how: dict[str, Any]) -> Transient:
    operation = model.operation
    constant = isinstance(operation.drum_speed, Constant) and isinstance(operation.preload, Constant)
    if model.forced or model.remembering or not constant:
        raise ValueError("a cycle is free motion at a constant speed and load; this model changes with time")
    stability = analyse_stability(model)
    if not how["duration"] > 0 or how["sample_rate"] < 2 * stability.highest_frequency_Hz:
        least = f"{2 * stability.highest_frequency_Hz:.5g} Hz, twice the highest frequency of the model"
        raise ValueError(f"duration must be positive and sample_rate at least {least}")
    return Transient(model, stability, stability.steady_state, *motion.start_of(model.names, start), how)


def _search(transient: Transient, progress: Progress) -> CycleSearch:
    record = _recorded(transient, progress, "transient")
    found: list[tuple[Cycle, str]] = []
    reasons = _try(transient, _starts(transient, record), progress, found)
    for disturbed, start in _disturbances(transient):
        if any(cycle.stable for cycle, _ in found):
            break
        after = _recorded(start, progress, f"transient {disturbed}")
        if after.period is None:
            reasons.append(f"{disturbed}: the transient {after.words}")
            continue
        end = Start(after.states[-1], after.period, f"the end of a transient {disturbed}")
        reasons += _try(transient, iter([end]), progress, found)
    if not found:
        tried = f"; {'; '.join(reasons)}" if reasons else ""
        raise CycleError(f"no periodic motion was found: the transient {record.words}{tried}")
    cycle, origin = min(found, key=lambda item: not item[0].stable)
    others = tuple(other for other, _ in found if other is not cycle)
    verdict, ends = cycle_verdict(cycle), record.words
    return CycleSearch(verdict=verdict, found_from=origin, transient=ends, others=others, **dict(cycle))


def _try(
    transient: Transient, starts: Iterator[Start], progress: Progress, found: list[tuple[Cycle, str]]
) -> list[str]:
    """Add the cycles that differ, each with where it was started from; why there is none from the other starts."""
    reasons: list[str] = []
    for start in starts:
        try:
            cycle = cycle_from(
                transient.model,
                start,
                transient.steady,
                lambda origin=start.origin: progress(f"Newton's method from {origin}", 0, None),
            )
        except CycleError as error:
            reasons.append(f"{start.origin}: {error}")
            continue
        if not any(is_same(cycle, other) for other, _ in found):
            found.append((cycle, start.origin))
    return reasons


def checked(scene: Scene) -> Scene:
    """The scene, if its drum speed and load are constant and nothing else drives it; raises SceneError."""
    for path in (("drum", "speed"), ("contact", "normal_load")):
        if not isinstance(getattr(getattr(scene, path[0]), path[1]), float):
            raise SceneError("a cycle takes a constant value, not a profile", path)
    if scene.forcing is not None:
        raise SceneError("a cycle is free motion; leave the force out (forcing=none)", ("forcing",))
    if scene.temperature is not None:
        raise SceneError(
            "the lining warms up and nothing repeats exactly; leave the temperature out (temperature=none)",
            ("temperature",),
        )
    return scene


def cycle_from(model: Model, start: Start, steady: Vector, on_flow: Callable[[], object] = lambda: None) -> Cycle:
    """The cycle of a model that Newton's method finds from a start; raises CycleError where there is none."""
    shooting = Shooting(lambda _: (model, None), scales_of(model, start, steady), on_flow)
    condition = np.zeros(start.state.size + 2)
    condition[-1] = 1.0
    closed = shooting.close(shooting.scaled(start.state, start.period, 0.0), condition)
    if closed is None:
        raise CycleError("Newton's method finds none")
    if amplitude_of(shooting, closed, steady) < SMALLEST:
        raise CycleError("Newton's method ends at steady sliding")
    cycle = describe(shooting, shortest(shooting, closed, condition)).model_copy(update={"value": np.nan})
    if np.any(np.abs(cycle.multipliers - 1) < NEUTRAL):
        raise CycleError("it is one of many that lie side by side, as where nothing feeds or brakes the motion")
    return cycle


def scales_of(model: Model, start: Start, steady: Vector, parameter: float = 1.0) -> Scales:
    """What the unknowns of a cycle are measured in, from a start near it."""
    assert isinstance(model.operation.drum_speed, Constant)
    n = len(model.names)
    size = state_size(model, jnp.asarray(start.state[:n] - steady), jnp.asarray(start.state[n:]))
    return Scales(np.asarray(size), start.period, parameter)


def amplitude_of(shooting: Shooting, closed: Closed, steady: Vector) -> float:
    """How far a state is from steady sliding, in the scale of the motion."""
    rest = np.concatenate([steady, np.zeros_like(steady)]) / shooting.scales.state
    return float(np.max(np.abs(closed.unknowns[:-2] - rest)))


def shortest(shooting: Shooting, closed: Closed, condition: Vector) -> Closed:
    """The same motion over its shortest period, if it repeats within the one that was found."""
    for parts in range(MOST_PARTS, 1, -1):
        trial = closed.unknowns.copy()
        trial[-2] /= parts
        found = shooting.flow(trial)
        if np.max(np.abs(found.end - trial[:-2])) < np.sqrt(CLOSED):
            again = shooting.close(trial, condition)
            if again is not None:
                return again
    return closed


def is_same(one: Cycle, other: Cycle) -> bool:
    """Whether two cycles are one, by period and amplitudes."""
    pairs = [(one.period_s, other.period_s), *((one.amplitude[name], other.amplitude[name]) for name in one.names)]
    return all(abs(a - b) <= SAME * max(abs(a), abs(b)) for a, b in pairs)


@dataclass(frozen=True)
class _Record:
    """The last part of a transient: times (k,), states (k, 2n), what it does, its period if it has one."""

    time: Vector
    states: Vector
    words: str
    period: float | None = None
    at_rest: bool = False


def _recorded(transient: Transient, progress: Progress, what: str) -> _Record:
    """The transient, of which so much is looked at as has settled."""
    n = len(transient.model.names)
    chunks: list[Chunk] = []
    failed = ""
    try:
        start = transient.steady, transient.displacement, transient.velocity
        stream = integrate(transient.model, *start, **transient.how)
        motion.follow(stream, transient.how["duration"], chunks.append, progress, what=what)
    except IntegrationError as error:
        failed = f"failed: {error}"
    time = np.concatenate([np.empty(0), *(chunk.time for chunk in chunks)])
    moved = (np.concatenate([chunk.displacement, chunk.velocity], axis=1) for chunk in chunks)
    state = np.concatenate([np.empty((0, 2 * n)), *moved])
    lowest = _lowest(transient)
    if failed or lowest is None or time.size < FEWEST_SAMPLES / FRACTIONS[-1]:
        return _Record(time, state, failed or "is too short to judge")
    for fraction in FRACTIONS:
        part = slice(int((1 - fraction) * time.size), None)
        scale = _motion(transient, state[part])[:n]
        rate = transient.sample_rate
        regime = classify(state[part, :n], rate, scale=scale, lowest_frequency=lowest)
        if regime.kind is not Kind.UNKNOWN:
            break
    words = (_decay(transient, state[part]) if regime.kind is Kind.UNKNOWN else None) or regime_words(regime)
    return _Record(time[part], state[part], words, regime.period_s, regime.kind is Kind.STEADY)


def _decay(transient: Transient, states: Vector) -> str | None:
    """How fast the motion decays where it is below the contact boundaries and every mode decays, None elsewhere."""
    model, stability, n = transient.model, transient.stability, len(transient.model.names)
    mode = slowest(stability, [each for each in stability.modes if each.name in model.names])
    if mode is None:
        return None
    vibration, velocity = states[:, :n] - transient.steady, states[:, n:]
    rate = rms_rate(velocity, np.asarray(model.mass), transient.sample_rate)
    decays = is_decaying(max(boundary_ratios(model, vibration, velocity)), rate, mode.growth_rate)
    return decay_words(rate, mode.label, mode.growth_rate) if decays else None


def _lowest(transient: Transient) -> float | None:
    """The lowest frequency of interest (Hz): half the lowest of the modes that move; None where nothing oscillates."""
    modes = (mode.frequency_Hz for mode in transient.stability.modes if mode.name in transient.model.names)
    return min((frequency / 2 for frequency in modes), default=None)


def _motion(transient: Transient, states: Vector) -> Vector:
    """Amplitudes (2n,) that the largest vibration of a record gives the coordinates."""
    n, steady = len(transient.model.names), transient.steady
    largest = states[np.argmax(np.abs(states[:, n:]) @ np.sqrt(np.asarray(transient.model.mass)))]
    return np.asarray(state_size(transient.model, jnp.asarray(largest[:n] - steady), jnp.asarray(largest[n:])))


def _disturbances(transient: Transient) -> Iterator[tuple[str, Transient]]:
    """The same model started along each mode so fast that slip is reversed."""
    model, stability = transient.model, transient.stability
    places = [stability.coordinates.index(name) for name in model.names]
    for mode in stability.modes:
        if mode.name not in model.names:
            continue
        shape = mode.right[places]
        size = FAST * reach(model, mode, shape)
        state = size * shape, size * 1j * mode.eigenvalue.imag * shape
        displacement, velocity = (part.real for part in state)
        disturbed = transient._replace(displacement=displacement, velocity=velocity)
        yield f"after a large disturbance along mode {mode.label}", disturbed


def _starts(transient: Transient, record: _Record) -> Iterator[Start]:
    if record.period is not None:
        yield Start(record.states[-1], record.period, "the end of the transient")
        return
    lowest = _lowest(transient)
    moves = record.time.size >= FEWEST_SAMPLES and np.ptp(record.states, axis=0).any() and not record.at_rest
    if lowest is not None and moves:
        yield from returns(record.time, record.states, _motion(transient, record.states), lowest)
    yield from modal_starts(transient.model, transient.stability)
