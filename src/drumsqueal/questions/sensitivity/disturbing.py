"""Does a brake stay quiet when it is disturbed? Transients of many brakes, which differ in their numbers alone."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from enum import StrEnum
from functools import cache
from operator import attrgetter
from typing import NamedTuple, cast

import numpy as np
from pydantic import Field, computed_field

from drumsqueal.dynamics.attractor import Response, SteadyResponse, VelocityPerturbation
from drumsqueal.dynamics.ensemble import (
    SIZES,
    Family,
    IntegratorOptions,
    PerturbationDirection,
    Start,
    directions,
    find_attractors,
    go_on,
    round_seconds,
    surface_speed,
)
from drumsqueal.errors import IntegrationError
from drumsqueal.findings.kinds import Kind
from drumsqueal.findings.schema import Finding
from drumsqueal.findings.vibration import Vibration, beyond_boundaries, mean_pressures, moments_at
from drumsqueal.physics.bodies.rigid_shoe import RigidShoe
from drumsqueal.physics.composition import linear_coordinates
from drumsqueal.physics.effects.pressure import depth_under
from drumsqueal.physics.model import Model, build_model
from drumsqueal.progress import Progress, silent
from drumsqueal.scene import Scene, SceneError
from drumsqueal.simulation import prepare, run_whole, start_of
from drumsqueal.solve.linear.branches import Point, point_at

DISTURBANCE = 3.0  # times the displacement at which the mean pressure is lost


class Decay(Finding):
    """One transient: from where, how it ends, and its motion at the end over that at the beginning.

    It decays if it has become smaller and its last tenth has neither lift-off nor slip reversal, for then the
    eigenvalues rule; it squeals if it has settled to a motion of this `kind`, mostly at `frequency_Hz`. `duration_s`
    was run, and `reason` says why it failed.
    """

    start: str = "its own start"
    outcome: Kind
    motion_ratio: float | None = None
    duration_s: float | None = None
    kind: Kind | None = None
    frequency_Hz: float | None = None
    reason: str | None = None

    @computed_field
    @property
    def decays(self) -> bool | None:
        """Whether it decays; None where that is not known."""
        return {Kind.DECAYS: True, Kind.SQUEALS: False}.get(self.outcome)


def disturbed(scene: Scene) -> Scene:
    """The scene with a start beyond the contact boundary: of what moves with the drum or, if that rests, of all."""
    model = build_model(scene)
    size, body = DISTURBANCE * _deepest(model), cast("RigidShoe", model.body)  # of several shoes, all of them
    if size == 0:
        reason = "without stiffness a lining has no compression to be disturbed beyond; write one above 0"
        raise SceneError(reason, ("contact", "stiffness"), 0.0)
    following = [name for name, rate in zip(body.names, body.velocity_with_drum, strict=True) if rate != 0]
    characteristic_lengths = body.characteristic_lengths()
    start = {name: size / characteristic_lengths[name] for name in following or body.names}
    return scene.with_values({"start": {"displacement": start, "velocity": {}}})


def _deepest(model: Model) -> float:
    """How far (m) the mean pressure presses a lining in, at any time and of any shoe."""
    corners = model.operation.corners
    times = np.zeros(1) if corners is None else np.append(0.0, np.asarray(corners))
    pressures = mean_pressures(model, moments_at(model.operation, times))
    most = zip(pressures, model.contact.laws, strict=True)
    return max(float(np.max(depth_under(law, pressure))) for pressure, law in most)


def nonlinear_decay(scene: Scene, progress: Progress = silent) -> Decay:
    """The transient of a scene from its own start. Raises SceneError for a scene that cannot be run."""
    prepared = prepare(scene)
    try:
        result = run_whole(prepared, progress)
    except IntegrationError as error:
        return Decay(outcome=Kind.FAILED, reason=str(error))
    ratio = result.findings.motion_ratio
    if ratio is None:
        return Decay(outcome=Kind.NOT_STARTED)
    vibration = Vibration(result.history, result.stability)
    beyond = beyond_boundaries(result.history, result.stability.contact_fractions, prepared.linear)
    last = slice(vibration.time.size - max(1, round(0.1 * vibration.time.size)), None)  # of the record
    found = Decay(outcome=Kind.DECAYS, motion_ratio=ratio, duration_s=float(vibration.time[-1]))
    if ratio < 1 and not np.any(beyond[last]):
        return found
    saturation = result.findings.saturation
    if saturation is None or not saturation.regime.kind.squeals:
        return found.model_copy(update={"outcome": Kind.UNDECIDED})
    frequency = None if saturation.main is None else saturation.main.frequency_Hz
    settled = {"outcome": Kind.SQUEALS, "kind": saturation.regime.kind, "frequency_Hz": frequency}
    return found.model_copy(update=settled)


# Stages of disturbances, and how many of them, likeliest to start squeal, of a brake that is not to be proven quiet.
STAGES, QUICK = 5, 3
RANDOM, SEED = 32, 20231122  # disturbances of all modes at once, and the seed of the generator

Numbers = tuple[tuple[str, float], ...]
Identity = tuple[Numbers, bytes, bytes]
Task = tuple[int, Identity]


class Origin(StrEnum):
    """What a disturbance is."""

    OWN = "own start"
    DISPLACEMENT = "displacement"
    MODE = "along a mode"
    RANDOM = "random"
    EARLIER = "earlier squeal"


class Trial(Finding):
    """A transient of a disturbed brake: its start, from steady sliding, where it leads, and after how long (s).

    Displacement in m and rad, velocity in m/s and rad/s, as in the table `start` of a scene. A start without
    displacement has the energy `energy_J`, and the fastest point of the lining's surface moves at `speed_m_per_s`.
    `disturbance` has the mode, the way and the size of one along a mode, None for others. `at` has the numbers (SI) of
    the operating point that replace those of the scene, and `motion` is the squeal that it leads to.
    """

    at: dict[str, float] = Field(default_factory=dict)
    start: str
    kind: Origin
    disturbance: VelocityPerturbation | None = None
    displacement: dict[str, float]
    velocity: dict[str, float]
    energy_J: float | None
    speed_m_per_s: float | None
    leads_to: Kind
    simulated_s: float
    motion: SteadyResponse | None = None


class Disturbed(NamedTuple):
    """A start, and what disturbance it is."""

    kind: Origin
    start: Start


def squealing(trials: Sequence[Trial]) -> tuple[Trial, ...]:
    """One transient for each steady-state response of each operating point, most kinetic energy first."""
    found: list[tuple[SteadyResponse, Trial]] = []
    for each in trials:
        if each.motion is not None and not any(each.at == one.at and each.motion.like(motion) for motion, one in found):
            found.append((each.motion, each))
    return tuple(trial for _, trial in sorted(found, key=lambda pair: -pair[0].kinetic_energy_J))


class DisturbedSqueal(Finding):
    """What becomes of a brake when it is disturbed, at each of its operating points.

    Its steady-state responses, the one with most kinetic energy first; each names a disturbance that leads to it.
    `quiet` states whether steady sliding is stable and every disturbance decays.
    """

    steady_sliding_stable: bool
    quiet: bool
    motions: tuple[SteadyResponse, ...]
    disturbances: tuple[Trial, ...]

    @classmethod
    def of(cls, points: Sequence[Point], trials: Sequence[Trial]) -> "DisturbedSqueal":
        """That of a brake with this linear model at each operating point, and these transients."""
        stable = not any(point.reason or point.unstable for point in points)
        motions = tuple(each.motion for each in squealing(trials) if each.motion is not None)
        quiet = stable and _all_decay(trials)
        return cls(steady_sliding_stable=stable, quiet=quiet, motions=motions, disturbances=tuple(trials))

    @property
    def squealing(self) -> tuple[Trial, ...]:
        """A disturbance for each of the responses at each operating point."""
        return squealing(self.disturbances)

    @property
    def smallest_disturbance(self) -> Trial | None:
        """Of the disturbances along a mode that lead to squeal the one with least energy."""
        along_modes = (each for each in self.disturbances if each.disturbance and each.motion)
        return min(along_modes, key=attrgetter("disturbance.energy_J"), default=None)

    @property
    def largest_that_decays(self) -> Trial | None:
        """Of those in the same mode and way with less energy the largest."""
        smallest = self.smallest_disturbance
        if smallest is None or smallest.disturbance is None:
            return None
        mode, forwards, most = smallest.disturbance.mode, smallest.disturbance.forwards, smallest.disturbance.energy_J
        decaying = [
            (each, each.disturbance) for each in self.disturbances if each.disturbance and each.leads_to is Kind.DECAYS
        ]
        less = [
            each
            for each, disturbance in decaying
            if (disturbance.mode, disturbance.forwards) == (mode, forwards) and disturbance.energy_J < most
        ]
        return max(less, key=attrgetter("disturbance.energy_J"), default=None)


def _all_decay(trials: Iterable[Trial]) -> bool:
    return all(each.leads_to is Kind.DECAYS for each in trials)


class BrakeVariant(NamedTuple):
    """Numbers that replace those of the scene, by key in SI, and squeal of similar brakes that may go on here.

    One that is `thorough` is to be proven quiet, from every disturbance.
    """

    numbers: Mapping[str, float]
    carried: Sequence[Trial] = ()
    thorough: bool = True


class _Case(NamedTuple):
    """A brake at an operating point, and the squeal that may go on there; `likeliest` is the first of the brake's."""

    brake: int
    numbers: Mapping[str, float]
    at: Mapping[str, float]
    carried: tuple[Trial, ...]
    likeliest: bool


def _case(number: int, brake: BrakeVariant, at: Mapping[str, float]) -> _Case:
    """A brake at a point: squeal of this point may go on there, and one of another that is like none of these."""
    here = [each for each in brake.carried if each.at == at]
    known = [each.motion for each in here if each.motion is not None]
    others = [each for each in brake.carried if each.motion and not any(each.motion.like(motion) for motion in known)]
    others = [each for each in others if each.at != at]
    return _Case(number, {**brake.numbers, **at}, at, (*here, *others[:1]), bool(here) and here[0] is brake.carried[0])


class Disturber:
    """Runs the transients of disturbed brakes that are a scene with other numbers, without its harmonic force."""

    def __init__(
        self, scene: Scene, progress: Progress = silent, points: Sequence[Mapping[str, float]] = ({},)
    ) -> None:
        """Take the scene, with one value for its drum speed and one for its load, and its operating points."""
        self._scene = scene if scene.forcing is None else scene.with_values({"forcing": None})
        self._progress, self._at = progress, tuple(points)
        self._linear_coordinates = linear_coordinates(self._scene)
        self._known: dict[Numbers, dict[Identity, Trial]] = {}
        self._starts: dict[Numbers, list[Disturbed]] = {}

    def judge(self, brakes: Sequence[BrakeVariant], what: str, *, until_squeal: bool = True) -> list[DisturbedSqueal]:
        """Disturb brakes whose steady sliding is stable, each at every operating point, until it squeals.

        The disturbances: squeal of a similar brake, the scene's own start, one beyond the contact boundary and each
        mode three times both of them; for those that are `thorough`, also each mode both ways in sizes
        from a tenth of the nearer boundary on, twice as large each time, `RANDOM` of all modes at once, and larger
        multiples of the carried squeal. A disturbance that a brake has had before is not run again.
        """
        cases = [_case(k, brake, at) for k, brake in enumerate(brakes) for at in self._at]
        count, model_of = len(self._at), cache(lambda c: build_model(self._scene, cases[c].numbers))

        def linear_at(value: float) -> Model:
            return build_model(self._scene, cases[int(value)].numbers, self._linear_coordinates)

        names = build_model(self._scene).names
        family = Family(lambda value: model_of(int(value)), names, self._linear_coordinates)
        points = [point_at(linear_at, c) for c, _ in enumerate(cases)]
        of_brake = [points[k * count : (k + 1) * count] for k, _ in enumerate(brakes)]
        known = [self._known.setdefault(tuple(sorted(brake.numbers.items())), {}) for brake in brakes]
        stages = [self._stages(*each, family) for each in zip(cases, points, strict=True)]
        for stage in range(STAGES):
            going = [
                not any(point.reason or (until_squeal and point.unstable) for point in of_brake[k])
                and (_all_decay(trials.values()) or not until_squeal)
                and (stage < QUICK or brakes[k].thorough)
                for k, trials in enumerate(known)
            ]
            tasks = {
                (case.brake, _identity(case, each)): (case, point, each)
                for case, point, starts in zip(cases, points, stages, strict=True)
                if going[case.brake]
                for each in next(starts)
                if _identity(case, each) not in known[case.brake]
            }
            for (k, identity), trial in self._run(family, tasks, what):
                known[k][identity] = trial
        return [DisturbedSqueal.of(*each) for each in zip(of_brake, (tuple(k.values()) for k in known), strict=True)]

    def _stages(self, case: _Case, point: Point, family: Family) -> Iterator[list[Disturbed]]:
        """The disturbances of a brake at a point, those first that are likeliest to make it squeal."""
        yield [_carried(case.carried[0])] if case.likeliest else []
        yield [_carried(each) for each in case.carried]
        large = [_along(each, each.sizes[-1]) for each in directions(point, family, (1,))]
        yield [*self._common(case.at, family), *large]
        multiples = [_carried(each, size) for each in case.carried for size in SIZES[1:]]
        yield [*multiples, *_both_ways(family, point)]
        yield _random_starts(family, point)

    def _common(self, at: Mapping[str, float], family: Family) -> list[Disturbed]:
        """The disturbances that are those of every brake."""
        key = tuple(at.items())
        if key not in self._starts:
            scene = self._scene.with_values(dict(at))
            own = Start("its own start", *start_of(scene, family.moving))
            beyond = Start("a displacement of three compressions", *start_of(disturbed(scene), family.moving))
            self._starts[key] = [Disturbed(Origin.OWN, own), Disturbed(Origin.DISPLACEMENT, beyond)]
        return self._starts[key]

    def _responses(self, family: Family, tasks: Sequence[tuple[Point, Start]], report: Progress) -> Iterator[Response]:
        """Brakes of about one lowest frequency together: the slowest sets how long a round is."""
        simulate, groups = self._scene.simulate, dict[int, list[tuple[Point, Start]]]()
        for task in tasks:
            octave = math.ceil(math.log2(round_seconds([task[0]], family.moving)))
            groups.setdefault(octave, []).append(task)
        for some in groups.values():
            points = [point for point, _ in some]
            highest = max((mode.frequency_Hz for point in points for mode in point.vibrations), default=0.0)
            # 2.5 samples a period of the fastest mode, where the scene's rate is lower
            rate, seconds = max(simulate.sample_rate, 2.5 * highest), round_seconds(points, family.moving)
            how = IntegratorOptions(rate, simulate.tolerance, seconds, simulate.solver)
            yield from find_attractors(family, some, how, progress=report)

    def _run(
        self, family: Family, tasks: Mapping[Task, tuple[_Case, Point, Disturbed]], what: str
    ) -> Iterator[tuple[Task, Trial]]:
        done = 0

        def report(*_: object) -> None:
            self._progress(what, done, len(tasks))

        # Each under a name of its own, by which it is told from the others when it comes back.
        keys = list(tasks)
        named = [(point, each.start._replace(name=str(k))) for k, (_, point, each) in enumerate(tasks.values())]
        for response in self._responses(family, named, report):
            key = keys[int(response.start)]
            case, _, tried = tasks[key]
            yield key, _trial(tried, case.at, response, family.model_at(response.value))
            done += 1
            report()


def _identity(case: _Case, each: Disturbed) -> Identity:
    """What tells a disturbance of a brake from another."""
    return tuple(case.at.items()), each.start.vibration.tobytes(), each.start.velocity.tobytes()


def _random_starts(family: Family, point: Point) -> list[Disturbed]:
    """All modes at once, each in a size and a phase of its own."""
    model, generator = family.model_at(point.value), np.random.default_rng(SEED)
    reached = [family.reach(mode, model) for mode in family.vibrations(point)]
    modes = [
        (shape, PerturbationDirection.smallest / max(far), PerturbationDirection.largest / min(far))
        for shape, far in reached
        if far
    ]
    starts = []
    for number in range(RANDOM if modes else 0):
        sizes = [np.exp(generator.uniform(*np.log(limits))) for _, *limits in modes]
        turns = np.exp(2j * np.pi * generator.random(len(modes)))
        parts = [size * (turn * shape).real for size, turn, (shape, *_) in zip(sizes, turns, modes, strict=True)]
        starts.append(Disturbed(Origin.RANDOM, Start(f"random {number + 1}", *np.sum(parts, axis=0))))
    return starts


def _both_ways(family: Family, point: Point) -> list[Disturbed]:
    """Velocities both ways along each mode, twice as large each time, but for the largest forwards, run before."""
    return [
        _along(each, size)
        for each in directions(point, family)
        for size in (each.sizes[:-1] if each.forwards else each.sizes)
    ]


def _along(direction: PerturbationDirection, size: float) -> Disturbed:
    """A velocity of a size along a mode."""
    way = "forwards" if direction.forwards else "backwards"
    name = f"{direction.mode.label} {way}, {direction.disturbance(size).energy_J:.2g} J"
    return Disturbed(Origin.MODE, direction.start(size)._replace(name=name))


def _carried(trial: Trial, size: float = 1.0) -> Disturbed:
    """The squeal of a similar brake, or a multiple of it."""
    motion = trial.motion
    assert motion is not None
    line = "" if motion.frequency_Hz is None else f" at {motion.frequency_Hz:.0f} Hz"
    times = "" if size == 1 else f"{size:g} times "
    return Disturbed(Origin.EARLIER, go_on(0.0, motion, size)._replace(name=f"{times}earlier squeal{line}"))


def _trial(tried: Disturbed, at: Mapping[str, float], response: Response, model: Model) -> Trial:
    """The transient of a model from a disturbance."""
    kind, start = tried
    displacement, velocity = (
        dict(zip(model.names, part.tolist(), strict=True)) for part in (start.vibration, start.velocity)
    )
    along_mode = not np.any(start.vibration)  # of a displacement the energy hangs on the contact, too
    motion = response.motion
    return Trial(
        at=dict(at),
        start=start.name,
        kind=kind,
        disturbance=start.disturbance,
        displacement=displacement,
        velocity=velocity,
        energy_J=float(np.asarray(model.mass) @ start.velocity**2 / 2) if along_mode else None,
        speed_m_per_s=surface_speed(model, start.velocity) if along_mode else None,
        leads_to=response.leads_to,
        simulated_s=response.simulated_s,
        motion=motion if motion is None else motion.model_copy(update={"start": start.name}),
    )
