"""A transient of any model as one object: time history, changes between stick and slip, and how it ended.

At the end is what is said of a bonded contact that pulls, which no dry contact does.
"""

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike, NDArray

from drumsqueal.errors import COMPLETE, Ending, IntegrationError, Outcome
from drumsqueal.interrupts import noted_interrupts, stop_if_interrupted
from drumsqueal.physics.effects.pressure import Bonded, level_under
from drumsqueal.physics.model import Model
from drumsqueal.physics.small_bodies import PointContact
from drumsqueal.progress import Progress, silent
from drumsqueal.solve.linear.modes import Stability, analyse_stability
from drumsqueal.solve.linear.steady import steady_sliding
from drumsqueal.solve.transient.integrate import Chunk
from drumsqueal.solve.transient.integrate import integrate as chunks_of
from drumsqueal.solve.transient.runge_kutta import AUTO

Vector = NDArray[np.float64]
Start = Mapping[str, Mapping[str, float] | Sequence[float] | ArrayLike]
"""`displacement` and `velocity`, each by the names of the coordinates or as an array (n,); zero where not given."""


@dataclass(frozen=True)
class Motion:
    """A transient: time (k,) in s, displacement and velocity (k, n) of the named coordinates, and how it ended.

    Displacement (m, rad) is measured from where springs are unloaded. `changes` holds when the contact began to stick
    (True) or to slip (False), in s. `energy_balance_error` (k,) in J is what is missing in the balance of energy, and
    `normal_force` (k,) in N is that of the contact. `notes` say what limits the motion, such as a contact that pulls.
    """

    names: tuple[str, ...]
    time: Vector
    displacement: Vector
    velocity: Vector
    energy_balance_error: Vector
    normal_force: Vector
    changes: tuple[tuple[float, bool], ...]
    steps: int
    outcome: Outcome
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """How long it is, what it holds and how it ended."""
        ended = "; ".join([self.outcome, *self.notes])
        time = f"{self.time[0]:g} to {self.time[-1]:g} s, {len(self.time)} samples of {', '.join(self.names)}"
        return f"Motion({time}, {len(self.changes)} changes between stick and slip, {self.steps} steps; {ended})"

    def turning_points(self, name: str) -> tuple[Vector, Vector]:
        """When a coordinate turns round (s), and where, by the cubic through displacements and velocities.

        Of the fourth order in the interval of samples, and of the second where friction reverses with it.
        """
        k = self.names.index(name)
        return turning_points(self.time, self.displacement[:, k], self.velocity[:, k])


def turning_points(time: Vector, place: Vector, speed: Vector) -> tuple[Vector, Vector]:
    """When a coordinate (k,) turns round (s), and where, as `Motion.turning_points` has it."""
    from scipy.interpolate import CubicHermiteSpline  # which a run does without

    curve = CubicHermiteSpline(time, place, speed)
    times = curve.derivative().roots(extrapolate=False)
    times = times[np.isfinite(times)]
    before = np.clip(np.searchsorted(time, times) - 1, 0, None)
    times = times[speed[before] * speed[before + 1] < 0]  # at rest it turns nowhere
    return times, curve(times)


class Transient(NamedTuple):
    """A transient at constant speed and load: a model, its stability over the same coordinates, and the start.

    `displacement` (n,) from steady sliding and `velocity` (n,) are the start. `how` is the duration (s), sample rate
    (Hz), tolerance and method.
    """

    model: Model
    stability: Stability
    displacement: Vector
    velocity: Vector
    how: Mapping[str, Any]

    @property
    def lowest_frequency_Hz(self) -> float | None:
        """Half the lowest that it may vibrate with: the lowest of interest; None where nothing oscillates."""
        return min((mode.frequency_Hz / 2 for mode in self.stability.oscillations), default=None)

    def follow(
        self, take: Callable[[Chunk], object], progress: Progress = silent, *, what: str = "integrating"
    ) -> None:
        """Call `take` with every chunk, as `follow` does."""
        start = self.stability.steady_state, self.displacement, self.velocity
        follow(chunks_of(self.model, *start, **self.how), self.how["duration"], take, progress, what=what)


def constant_transient(
    model: Model, start: Start, *, duration: float | None, sample_rate: float | None, **how: Any
) -> Transient:
    """The transient of a model at constant speed and load; `how` as in `Transient`.

    By default it lasts 200 periods of the slowest oscillation, and has 20 samples in one of the fastest. Raises
    ValueError for a model that changes with time, a wrong start, and for no duration or samples that fold.
    """
    operation = model.operation
    if model.remembering or not operation.constant:
        raise ValueError("speed and load must be constant; this model changes with time")
    stability = analyse_stability(model)
    frequencies = [mode.frequency_Hz for mode in stability.vibrations]
    if not frequencies and (duration is None or sample_rate is None):
        raise ValueError("nothing oscillates in this model, even without damping: give duration and sample_rate")
    # To find its period a motion is recorded for 200 of the slowest oscillation, with 20 samples in one of the fastest.
    length = 200 / min(frequencies) if duration is None else duration
    rate = 20.0 * max(frequencies) if sample_rate is None else sample_rate
    if not length > 0:
        raise ValueError(f"duration must be positive, got {length:.5g} s")
    if not rate > 0 or rate < 2 * stability.highest_frequency_Hz:
        least = f"at least {2 * stability.highest_frequency_Hz:.5g} Hz, twice the highest frequency of the model"
        raise ValueError(f"sample_rate must be {least if frequencies else 'positive'}, got {rate:.5g} Hz")
    how |= {"duration": length, "sample_rate": rate}
    return Transient(model, stability, *start_of(model.names, start), how)


def integrate(
    model: Model,
    start: Start,
    duration: float,
    *,
    sample_rate: float,
    tolerance: float = 1e-6,
    solver: str = AUTO,
    origin: Sequence[float] | ArrayLike | None = None,
    progress: Progress = silent,
) -> Motion:
    """Integrate a model in time: `integrate(model, {"velocity": {"X": 0.2}}, 50.0, sample_rate=100.0).changes`.

    The start's displacement is measured from `origin` (n,), by default steady sliding; {} starts there at rest. Samples
    lie at k / sample_rate (Hz) from 0 to the duration (s). Ctrl-C and a failed integration keep what was computed, and
    `outcome` says so. Raises ValueError for a wrong start or duration, SteadyStateError where there is no steady
    sliding to start from, and IntegrationError when nothing was computed.

    ```pycon
    >>> block = drumsqueal.block_on_belt(drumsqueal.StepLaw(0.5, 0.3), belt_speed=0.2)
    >>> motion = drumsqueal.integrate(block, {"velocity": {"X": 0.2}}, 10.0, sample_rate=50.0)
    >>> [(round(time, 4), sticks) for time, sticks in motion.changes]  # 1 s stuck, 2π − 2 arctan(1) slipping
    [(0.0, True), (1.0, False), (5.7124, True), (7.7124, False)]
    ```
    """
    check_samples(duration, sample_rate)
    first = start_of(model.names, start)
    if origin is not None:
        steady = _vector(model.names, "origin", origin)
    elif float(model.operation.at(0.0).drum_speed) == 0:  # nothing is dragged along, and springs are unloaded
        steady = np.zeros(len(model.names))
    else:
        steady = np.asarray(steady_sliding(model))
    chunks: list[Chunk] = []
    how: Any = {"duration": duration, "sample_rate": sample_rate, "tolerance": tolerance, "solver": solver}
    outcome = collect(chunks_of(model, steady, *first, **how), duration, chunks.append, progress)
    if not chunks:
        raise IntegrationError(outcome)
    whole = {
        field: np.concatenate([getattr(chunk, field) for chunk in chunks])
        for field in ("time", "displacement", "velocity", "energy_balance_error")
    }
    force = np.concatenate([chunk.observation.normal_force for chunk in chunks])
    return Motion(
        names=model.names,
        **whole,
        normal_force=force,
        changes=tuple(change for chunk in chunks for change in chunk.changes),
        steps=sum(chunk.steps for chunk in chunks),
        outcome=outcome,
        notes=tuple(filter(None, [pulling(smallest_recorded(model, force))])),
    )


def start_of(names: tuple[str, ...], start: Start) -> tuple[Vector, Vector]:
    """Displacement and velocity (n,) of a start. Raises ValueError for what is none."""
    unknown = sorted(set(start) - {"displacement", "velocity"})
    if unknown:
        raise ValueError(f"start: {unknown[0]!r} is neither displacement nor velocity")
    displacement, velocity = (_vector(names, key, start.get(key, {})) for key in ("displacement", "velocity"))
    return displacement, velocity


def _vector(names: tuple[str, ...], key: str, given: Mapping[str, float] | Sequence[float] | ArrayLike) -> Vector:
    if isinstance(given, Mapping):
        unknown = sorted(set(given) - set(names))
        if unknown:
            raise ValueError(f"{key}: {unknown[0]!r} is no coordinate of this model; it has {', '.join(names)}")
        return np.array([float(given.get(name, 0.0)) for name in names])
    values = np.asarray(given, dtype=np.float64)
    if values.shape != (len(names),):
        raise ValueError(f"{key}: a number for each of {', '.join(names)} is needed, got shape {values.shape}")
    return values


def check_samples(duration: float, sample_rate: float) -> None:
    """Raise ValueError where there is no sample beyond the start."""
    if not (np.isfinite(duration * sample_rate) and round(duration * sample_rate) >= 1 and sample_rate > 0):
        raise ValueError(f"duration times sample_rate must be one sample at least, got {duration} s × {sample_rate} Hz")


def follow(
    stream: Generator[Chunk],
    duration: float,
    take: Callable[[Chunk], object],
    progress: Progress = silent,
    *,
    what: str = "integrating",
) -> None:
    """Call `take` with every chunk of a transient, until its end or until `take` returns True.

    `progress` is called at first, and after each chunk with the time reached (s), and may stop it by raising an
    exception. Raises IntegrationError where the integration fails.
    """
    progress(f"{what}, first samples", 0.0, None)
    with closing(stream):
        for chunk in stream:
            enough = take(chunk)
            reached = float(chunk.time[-1])
            progress(f"{what}, {reached:.4f} s", reached, duration)
            if enough is True:
                return


def collect(
    stream: Generator[Chunk],
    duration: float,
    keep: Callable[[Chunk], object],
    progress: Progress = silent,
    reached: float | None = None,
) -> Outcome:
    """Follow a transient to the end, to the first failure or to Ctrl-C, and return the outcome.

    `keep` takes each chunk, and `reached` is the time (s) that an earlier part of it had reached.
    """

    def take(chunk: Chunk) -> None:
        nonlocal reached
        keep(chunk)
        reached = float(chunk.time[-1])
        stop_if_interrupted()

    try:
        with noted_interrupts():
            follow(stream, duration, take, progress)
    except IntegrationError as error:
        return Outcome(Ending.FAILED, f"failed: {error}")
    except KeyboardInterrupt:
        when = "before the first samples were computed" if reached is None else f"after t = {reached:.6g} s"
        return Outcome(Ending.INTERRUPTED, f"interrupted by the user {when}")
    return COMPLETE


def smallest_force(model: Model, displacement: ArrayLike) -> float:
    """Smallest normal force (N) of a block that cannot lift off, by the load at t = 0; infinite of any other contact.

    Displacements (..., n) in m are measured from q = 0.
    """
    if not _can_pull(model):
        return np.inf
    into, _ = model.body.surface()
    depth = np.asarray(displacement) @ into.T
    law = model.contact.law
    level = float(level_under(law, model.operation.at(0.0).preload)) + float(law.stiffness) * np.min(depth)
    return float(law.pressure(jnp.asarray(level)))


def smallest_recorded(model: Model, force: ArrayLike) -> float:
    """The same of recorded normal forces (k,) in N."""
    return float(np.min(force)) if _can_pull(model) else np.inf


def _can_pull(model: Model) -> bool:
    # A shoe without separation says so among what its scene leaves out.
    contact = model.contact
    return isinstance(contact, PointContact) and isinstance(contact.law, Bonded) and float(contact.law.stiffness) > 0


def pulling(smallest: float) -> str:
    """That the contact pulls, by the smallest normal force (N); empty where it does not."""
    if not smallest < 0:
        return ""
    # 1e30 N; only what grows without bound comes so far
    fell = f"fell to {smallest:.3g} N" if smallest > -1e30 else "falls without bound"
    return f"the contact pulls: the normal force {fell}; use separation=True".replace("-", "−")


def pulling_sentence(smallest: float) -> str:
    """The same as a sentence after others; empty where the contact does not pull."""
    words = pulling(smallest)
    return f" {words[0].upper()}{words[1:]}." if words else ""
