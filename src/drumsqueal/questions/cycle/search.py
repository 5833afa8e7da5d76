"""The periodic motion of a scene, by shooting from its own transient or from its modes."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from drumsqueal.errors import CycleError, IntegrationError
from drumsqueal.findings.decay import is_decaying, rms_rate, slowest
from drumsqueal.findings.edges import edge_shares
from drumsqueal.findings.signals import Regime, classify
from drumsqueal.interrupts import stop_if_interrupted
from drumsqueal.physics.effects.schedule import Constant
from drumsqueal.physics.model import Model
from drumsqueal.questions.cycle.orbit import NEUTRAL, Cycle, describe
from drumsqueal.questions.cycle.shooting import CLOSED, Closed, Scales, Shooting, Vector
from drumsqueal.questions.cycle.starts import Start, modal_starts, reach, returns
from drumsqueal.scene import Scene, SceneError
from drumsqueal.simulation import Prepared, check_sample_rate, prepare, steady_at_start, transient
from drumsqueal.solve.linear.modes import Stability
from drumsqueal.solve.transient.flow import state_size

SMALLEST = 1e-4  # of the scale of the start: what has shrunk to less is steady sliding, not a cycle
SHARES = (0.6, 0.3, 0.15)  # last parts of a transient that may have settled
FEWEST_SAMPLES = 64
KICK = 3.0  # times the speed of the drum
MOST_PARTS = 7  # a motion may repeat so many times within a period that was found
SAME = 1e-6  # relative difference of period and amplitudes below which two cycles are one


class Search(NamedTuple):
    """What a search found: the cycle, where it was started from, what the transient does, and the other cycles."""

    scene: Scene
    stability: Stability
    cycle: Cycle
    origin: str
    transient: str
    others: tuple[Cycle, ...]


def find_cycle(scene: Scene, on_start: Callable[[str], None] | None = None) -> Search:
    """Find a periodic motion of a scene and its Floquet multipliers.

    Newton's method on the flow map over a period, started where the scene's transient ends and, where that is not
    periodic, where it nearly returns to itself and along each mode at the amplitudes at which friction gives as much
    as damping takes. Where none of that leads to a stable cycle, transients are kicked along each mode, `KICK` times as
    fast as the drum, until one ends in one. A stable cycle is preferred, then the one found first. `on_start` is told
    of each start.

    Raises SceneError for a scene that changes with time, CycleError where no cycle is found.
    """
    prepared = prepare(checked(scene))
    check_sample_rate(prepared)
    tell = on_start or (lambda _: None)
    tell("transient")
    record = _recorded(prepared)
    found: list[tuple[Cycle, str]] = []
    reasons = _try(prepared, _starts(prepared, record), tell, found)
    for kick, kicked in _kicks(prepared):
        if any(cycle.stable for cycle, _ in found):
            break
        tell(f"transient, {kick}")
        after = _recorded(kicked)
        if after.period is None:
            reasons.append(f"{kick}: the transient {after.told}")
            continue
        start = Start(after.states[-1], after.period, f"the end of a transient {kick}")
        reasons += _try(prepared, iter([start]), tell, found)
    if not found:
        tried = f"; {'; '.join(reasons)}" if reasons else ""
        raise CycleError(f"no periodic motion was found: the transient {record.told}{tried}")
    cycle, origin = min(found, key=lambda item: not item[0].stable)
    others = tuple(other for other, _ in found if other is not cycle)
    return Search(scene, prepared.stability, cycle, origin, record.told, others)


def _try(
    prepared: Prepared, starts: Iterator[Start], tell: Callable[[str], None], found: list[tuple[Cycle, str]]
) -> list[str]:
    """Add the cycles that differ, each with where it was started from; why there is none from the other starts."""
    reasons: list[str] = []
    for start in starts:
        tell(start.origin)
        try:
            cycle = cycle_from(prepared.model, start, steady_at_start(prepared))
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


def cycle_from(model: Model, start: Start, steady: Vector) -> Cycle:
    """The cycle of a model that Newton's method finds from a start; raises CycleError where there is none."""
    shooting = Shooting(lambda _: (model, None), scales_of(model, start, steady))
    condition = np.zeros(start.state.size + 2)
    condition[-1] = 1.0
    closed = shooting.close(shooting.scaled(start.state, start.period, 0.0), condition)
    if closed is None:
        raise CycleError("Newton's method finds none")
    if amplitude_of(shooting, closed, steady) < SMALLEST:
        raise CycleError("Newton's method ends at steady sliding")
    cycle = describe(shooting, shortest(shooting, closed, condition))
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


class _Record(NamedTuple):
    """The last part of a transient: times (k,), states (k, 2n), what it does, its period if it has one."""

    time: Vector
    states: Vector
    told: str
    period: float | None

    @property
    def periodic(self) -> bool:
        return self.period is not None


def _recorded(prepared: Prepared) -> _Record:
    """The scene's transient, of which so much is looked at as has settled."""
    n = len(prepared.model.names)
    times, states = [np.empty(0)], [np.empty((0, 2 * n))]
    told = ""
    try:
        for chunk in transient(prepared):
            stop_if_interrupted()
            times.append(chunk.time)
            states.append(np.concatenate([chunk.displacement, chunk.velocity], axis=1))
    except IntegrationError as error:
        told = f"failed: {error}"
    time, state = np.concatenate(times), np.concatenate(states)
    lowest = _lowest(prepared)
    if told or lowest is None or time.size < FEWEST_SAMPLES / SHARES[-1]:
        return _Record(time, state, told or "is too short to tell", None)
    records = []
    for share in SHARES:
        part = slice(int((1 - share) * time.size), None)
        scale = _motion(prepared, state[part])[:n]
        rate = prepared.scene.simulate.sample_rate
        regime = classify(state[part, :n], rate, scale=scale, lowest_frequency=lowest)
        records.append(_Record(time[part], state[part], _told(regime), regime.period_s))
        if regime.kind != "unknown":
            return records[-1]
    return records[-1]._replace(told=_decay(prepared, records[-1].states) or records[-1].told)


def _decay(prepared: Prepared, states: Vector) -> str | None:
    """How fast the motion decays where it is below the edges and every mode decays; None where it does not."""
    model, stability, n = prepared.model, prepared.stability, len(prepared.model.names)
    mode = slowest(stability, [each for each in stability.modes if each.name in model.names])
    if mode is None:
        return None
    departure, velocity = states[:, :n] - steady_at_start(prepared), states[:, n:]
    rate = rms_rate(velocity, np.asarray(model.mass), prepared.scene.simulate.sample_rate)
    if not is_decaying(max(edge_shares(model, departure, velocity)), rate, mode.growth_rate):
        return None
    predicted = f"mode {mode.label} decays slowest by its eigenvalue, {mode.growth_rate:.4g} 1/s"
    return f"decays to steady sliding, at the end by {rate:.4g} 1/s ({predicted})".replace("-", "−")


def _told(regime: Regime) -> str:
    if regime.kind == "unknown":
        return f"has not settled ({regime.reason.rstrip('.')})"
    words = {"steady": "comes to rest in steady sliding", "periodic": "settles to a periodic motion"}
    return words.get(regime.kind, f"settles to no periodic motion (it is {regime.kind})")


def _lowest(prepared: Prepared) -> float | None:
    """The lowest frequency of interest (Hz): half the lowest of the modes that move; None where nothing oscillates."""
    modes = (mode.frequency_Hz for mode in prepared.stability.modes if mode.name in prepared.model.names)
    return min((frequency / 2 for frequency in modes), default=None)


def _motion(prepared: Prepared, states: Vector) -> Vector:
    """Amplitudes (2n,) that the largest vibration of a record gives the coordinates."""
    n, steady = len(prepared.model.names), steady_at_start(prepared)
    largest = states[np.argmax(np.abs(states[:, n:]) @ np.sqrt(np.asarray(prepared.model.mass)))]
    return np.asarray(state_size(prepared.model, jnp.asarray(largest[:n] - steady), jnp.asarray(largest[n:])))


def _kicks(prepared: Prepared) -> Iterator[tuple[str, Prepared]]:
    """The scene started along each mode so fast that slip is reversed, with the same model."""
    model, stability = prepared.model, prepared.stability
    places = [stability.coordinates.index(name) for name in model.names]
    for mode in stability.modes:
        if mode.name not in model.names:
            continue
        shape = mode.right[places]
        size = KICK * reach(model, mode, shape)
        state = size * shape, size * 1j * mode.eigenvalue.imag * shape
        displacement, velocity = (dict(zip(model.names, part.real.tolist(), strict=True)) for part in state)
        scene = prepared.scene.with_values({"start": {"displacement": displacement, "velocity": velocity}})
        yield f"kicked along mode {mode.label}", prepared._replace(scene=scene)


def _starts(prepared: Prepared, record: _Record) -> Iterator[Start]:
    if record.period is not None:
        yield Start(record.states[-1], record.period, "the end of the transient")
        return
    lowest = _lowest(prepared)
    moves = record.time.size >= FEWEST_SAMPLES and np.ptp(record.states, axis=0).any() and "rest" not in record.told
    if lowest is not None and moves:
        yield from returns(record.time, record.states, _motion(prepared, record.states), lowest)
    yield from modal_starts(prepared.model, prepared.stability)
