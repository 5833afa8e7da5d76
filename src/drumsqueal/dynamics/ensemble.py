"""Many models from many starts: small perturbations and disturbances along modes, run until each leads somewhere."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.coordinates import is_rotation
from drumsqueal.dynamics.attractor import SMALL_START, Response, SteadyResponse, VelocityPerturbation
from drumsqueal.dynamics.saturated import (
    Course,
    IntegratorOptions,
    LinearModel,
    Saturated,
    at_once,
    saturated_motions,
)
from drumsqueal.findings.decay import least_stable
from drumsqueal.findings.kinds import Criteria, Kind
from drumsqueal.findings.vibration import boundary_ratios_by_shoe
from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.effects.several import Contacts
from drumsqueal.physics.model import Model
from drumsqueal.progress import Progress, silent
from drumsqueal.solve.linear.branches import ModelAt, Point
from drumsqueal.solve.linear.modes import DRIFT_FRACTION, UNDAMPED_FRACTION, Mode, Stability

# Multiples of a motion from elsewhere: where motion that is too small decays the attractor may be larger.
SIZES = (1.0, 1.2, 1.5)


class Start(NamedTuple):
    """A displacement (n,) from steady sliding and a velocity (n,), what to call them, and what they are.

    That is a disturbance along a mode, or the motion at another value.
    """

    name: str
    vibration: NDArray[np.float64]
    velocity: NDArray[np.float64]
    disturbance: VelocityPerturbation | None = None
    from_value: float | None = None


def go_on(value: float, motion: SteadyResponse, size: float = 1.0) -> Start:
    """The end of a motion at a value, or a multiple of it, as a start at another value."""
    name = f"from {value:.6g}" if size == 1 else f"{size:g} times from {value:.6g}"
    return Start(name, *(size * motion.state), from_value=value)


class Family(NamedTuple):
    """Models of one composition along a parameter: `model_at` a value, over the coordinates that move (`moving`).

    `names` are the coordinates of the linear model, which may be more.
    """

    model_at: ModelAt
    moving: tuple[str, ...]
    names: tuple[str, ...]

    def modes(self, point: Point) -> list[Mode]:
        """Modes of a point that the coordinates that move can show."""
        return [mode for mode in point.modes if mode.name in self.moving]

    def vibrations(self, point: Point) -> list[Mode]:
        """What the coordinates that move may vibrate like at a point, or would without damping."""
        return [mode for mode in point.vibrations if mode.name in self.moving]

    def linear(self, point: Point, how: IntegratorOptions) -> LinearModel:
        """What the linear model says of a motion at a point, as far as a round can show it."""
        (what, rate, _), noise = least_stable(point, self.modes(point)), UNDAMPED_FRACTION * point.largest
        resolved = Criteria.resolved * how.tolerance / how.round_seconds
        return LinearModel(rate, rate <= noise, bool(what) and -max(noise, resolved) <= rate <= noise)

    def shown(self, vector: NDArray) -> NDArray:
        """The entries (n,) of the coordinates that move, of one over those of the linear model."""
        return np.array([vector[self.names.index(name)] for name in self.moving])

    def matrix(self, point: Point) -> NDArray[np.float64]:
        """The state matrix (2n, 2n) over the coordinates that move."""
        places = np.array([self.names.index(name) for name in self.moving])
        both = np.concatenate([places, len(self.names) + places])
        return point.matrix[np.ix_(both, both)]

    def small_start(self, point: Point, model: Model, size: float = Criteria.small) -> Start:
        """All modes at once, within this fraction of the nearer contact boundary."""
        reached = [self.reach(mode, model) for mode in self.vibrations(point)]
        parts = [np.real(shape) * (size / len(reached) / max(most) if most else 0.0) for shape, most in reached]
        total = np.sum(parts, axis=0) if parts else np.zeros((2, len(self.moving)))
        return Start(SMALL_START, total[0], total[1])

    def reach(self, mode: Mode, model: Model) -> tuple[NDArray[np.complex128], list[float]]:
        """Displacement and velocity (2, n) of a mode, and the fractions of the contact boundaries that it comes to.

        Those of each shoe that takes part.
        """
        half = len(self.names)
        shape = np.array([self.shown(part) for part in (mode.right[:half], mode.right[half:])])
        turns = np.exp(2j * np.pi * np.arange(32) / 32)
        vibration, velocity = ((turns[:, None] * part).real for part in shape)
        fractions = boundary_ratios_by_shoe(model, vibration, velocity)
        # 0.1 of how far a mode takes the nearest shoe to a boundary: one that comes less far has its own modes
        part = (fractions > 0) & (fractions >= 0.1 * fractions.max(axis=1, keepdims=True))
        return shape, fractions[part].tolist()


class PerturbationDirection:
    """Velocities from steady sliding along a mode one way, of sizes √J: multiples of the one of 1 J."""

    smallest = 0.1  # of the nearer contact boundary
    largest = 3.0  # of the farther contact boundary, by which contact is lost and slip reversed

    def __init__(self, mode: Mode, sign: int, model: Model, family: Family) -> None:
        """Take the shape of a mode; `sizes` are those that are tried first, by doublings."""
        shape, fractions = family.reach(mode, model)
        turns = np.exp(2j * np.pi * np.arange(64) / 64)  # of which the one with most kinetic energy is taken
        velocities = (turns[:, None] * shape[1]).real
        energies = velocities**2 @ np.asarray(model.mass) / 2
        of_one_joule = 1 / math.sqrt(energies.max())
        self.name = f"disturbance {mode.label} {'forwards' if sign > 0 else 'backwards'}"
        self.mode, self.forwards, self._coordinates = mode, sign > 0, family.moving
        self._velocity = sign * of_one_joule * velocities[np.argmax(energies)]
        self._surface_speed = surface_speed(model, self._velocity)
        self.boundary_ratio = of_one_joule * max(fractions)
        self.least, most = self.smallest / self.boundary_ratio, self.largest / (of_one_joule * min(fractions))
        self.sizes: list[float] = np.geomspace(
            self.least, most, max(1, math.ceil(math.log2(most / self.least))) + 1
        ).tolist()

    def disturbance(self, size: float) -> VelocityPerturbation:
        """The disturbance of a size."""
        return VelocityPerturbation(
            mode=self.mode.label,
            forwards=self.forwards,
            velocity=dict(zip(self._coordinates, (size * self._velocity).tolist(), strict=True)),
            speed_m_per_s=size * self._surface_speed,
            energy_J=size**2,
            boundary_ratio=size * self.boundary_ratio,
        )

    def start(self, size: float) -> Start:
        """The same as a start; its name has the size in multiples of the nearer contact boundary."""
        name = f"{self.name} {size * self.boundary_ratio:.4g}"
        return Start(name, 0 * self._velocity, size * self._velocity, disturbance=self.disturbance(size))


def directions(point: Point, family: Family, signs: tuple[int, ...] = (1, -1)) -> list[PerturbationDirection]:
    """Ways along each mode that comes near a contact boundary."""
    model = family.model_at(point.value)
    modes = [mode for mode in family.vibrations(point) if family.reach(mode, model)[1]]
    return [PerturbationDirection(mode, sign, model, family) for mode in modes for sign in signs]


def surface_speed(model: Model, velocity: NDArray[np.float64]) -> float:
    """Velocity (m/s) of the fastest point of the lining, relative to steady sliding on the drum, in a motion (n,)."""
    if isinstance(model.contact, Contacts):
        return max(surface_speed(side, velocity[np.array(mine.places)]) for mine, side in model.sides)
    if not isinstance(model.contact, Contact):
        return float(abs(velocity[model.contact.slides.index(True)]))
    v, body = dict(zip(model.names, velocity, strict=True)), model.contact.body
    # 181 points of the lining along the arc, at either edge
    angle, across = float(body.half_angle) * np.linspace(-1, 1, 181), float(body.width) / 2 * np.array([[-1], [1]])
    squares = sum(np.square(part) for part in body.over_drum(v, angle, across))
    return float(np.sqrt(np.max(squares)))


def round_seconds(points: Sequence[Point], moving: tuple[str, ...]) -> float:
    """How long a round is (s): a hundred periods of the slowest mode that oscillates freely, at any of the points.

    Where nothing oscillates it is a hundred times 2π over the slowest rate of growth or decay.
    """
    modes = [mode for point in points for mode in point.modes if mode.name in moving]
    # 0.1 of critical damping: beyond it a motion falls to half within a period or so
    free = [mode.frequency_Hz for mode in modes if abs(mode.damping_ratio) < 0.1]
    rates = (np.abs(point.eigenvalues) for point in points if not modes)
    slow = [float(min(each[each > DRIFT_FRACTION * max(each)], default=math.tau)) / math.tau for each in rates]
    # 100 of the slowest mode that oscillates freely
    return 100 / min(free or [mode.frequency_Hz for mode in modes] or slow, default=1.0)


def round_of(stability: Stability, moving: Sequence[str]) -> float:
    """How long a round is (s): a hundred periods of the slowest mode, or until the one that decays slowest has."""
    point = point_of(0, stability)
    longest = round_seconds([point], tuple(moving))
    modes = [mode for mode in stability.modes if mode.name in moving]
    if not modes:
        return longest
    # A round lasts until what decays has fallen to e^-3, and 20 periods of the slowest mode for its frequency.
    enough = 3.0 / max(min(abs(mode.growth_rate) for mode in modes), 1e-300)
    return min(longest, max(enough, 20 / min(mode.frequency_Hz for mode in modes)))


def point_of(k: int, found: Stability) -> Point:
    """A stability as the linear point of number k."""
    return Point(float(k), found.steady_state, found.modes, found.eigenvalues, "", found.matrix, found.vibrations)


class _Job(NamedTuple):
    """A transient of a model at a linear point, on its way from a start."""

    point: Point
    start: Start
    model: Model
    steady: NDArray[np.float64]
    matrix: NDArray[np.float64]
    course: Course


def _job(family: Family, point: Point, start: Start, how: IntegratorOptions) -> _Job:
    state = np.array([start.vibration, start.velocity])
    turns, small = [is_rotation(name) for name in family.moving], start.name == SMALL_START
    resolved = Criteria.resolved * how.tolerance
    course = Course(state, family.linear(point, how), how.round_seconds, resolved, turns, small=small)
    return _Job(point, start, family.model_at(point.value), family.shown(point.steady), family.matrix(point), course)


def find_attractors(
    family: Family,
    tasks: Sequence[tuple[Point, Start]],
    how: IntegratorOptions,
    *,
    rounds: int = Criteria.persistent,
    known: Mapping[float, Sequence[SteadyResponse]] | None = None,
    progress: Progress = silent,
) -> Iterator[Response]:
    """Run each start at its point until it is clear where it leads, and yield the responses as they come.

    All that are at hand run together. What is clear after `rounds` rounds `Course.add` decides; a steady motion that is
    on one of those `known` at its value, or found there, or comes nearer to it, has settled, too. After each chunk
    `progress` takes how many of the starts are done.
    """
    settled = {value: list(motions) for value, motions in (known or {}).items()}
    pending = [_job(family, point, start, how) for point, start in tasks]
    done = 0

    def report(*_: object) -> None:
        progress("transients", done, len(tasks))

    while pending:
        seconds, left = pending[0].course.seconds, []
        jobs = [job for job in pending if job.course.seconds == seconds][: at_once(how.threads)]
        pending = [job for job in pending if not any(job is each for each in jobs)]
        for job, motion in zip(jobs, _next_round(jobs, how, report), strict=True):
            course, there = job.course, settled.setdefault(job.point.value, [])
            kind = course.add(motion, rounds)
            motion = motion._replace(smallest_force=course.smallest_force)
            named = {"disturbance": job.start.disturbance, "from_value": job.start.from_value}
            response = Response.of(
                job.point.value, job.start.name, kind or Kind.SQUEALS, motion, course.simulated, family.moving,
                **named,
            )  # fmt: skip
            found = response.motion
            comes_to = course.rounds and not course.may_be_neutral and found and found.comes_to(there)
            if kind is None and not comes_to:
                left.append(job)
                continue
            if found is not None and not any(found.same(each) for each in there):
                there.append(found)
            done += 1
            report()
            yield response
        pending = left + pending


def _next_round(jobs: Sequence[_Job], how: IntegratorOptions, progress: Progress) -> Iterator[Saturated]:
    """How each of some transients ends the next round, which is as long for all."""
    return saturated_motions(
        [job.model for job in jobs],
        [job.steady for job in jobs],
        [job.course.state[0] for job in jobs],
        [job.course.state[1] for job in jobs],
        how._replace(round_seconds=jobs[0].course.seconds),
        matrices=[job.matrix for job in jobs],
        progress=progress,
    )


def find_surely(
    family: Family,
    tasks: Sequence[tuple[Point, Start]],
    how: IntegratorOptions,
    stages: Sequence[int],
    is_sure: Callable[[Response, SteadyResponse | None], bool],
    *,
    known: Mapping[float, Sequence[SteadyResponse]] | None = None,
    progress: Progress = silent,
) -> Iterator[tuple[Response, float]]:
    """Find where each start leads, and after how many seconds in all, as `find_attractors` does.

    Next to an unstable cycle motion dwells, and may look settled: what is not sure, by its response and its motion of
    the stage before, must last for the rounds of the next one of the `stages`.
    """
    points, tasks = {(point.value, start.name): point for point, start in tasks}, list(tasks)
    before: dict[tuple[float, str], SteadyResponse] = {}
    seconds = dict.fromkeys(points, 0.0)
    for rounds in stages:
        doubtful = []
        for response in find_attractors(family, tasks, how, rounds=rounds, known=known, progress=progress):
            key, motion = (response.value, response.start), response.motion
            seconds[key] += response.simulated_s
            if motion is None or rounds == stages[-1] or is_sure(response, before.get(key)):
                yield response, seconds[key]
                continue
            before[key] = motion
            again = Start(
                response.start, *motion.state, disturbance=response.disturbance, from_value=response.from_value
            )
            doubtful.append((points[key], again))
        tasks = doubtful
