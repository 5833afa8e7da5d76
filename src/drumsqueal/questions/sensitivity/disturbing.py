"""Does a brake stay quiet when it is disturbed? Transients of many brakes, which differ in their numbers alone."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from drumsqueal.findings.part import Finding
from drumsqueal.physics.composition import linear_coordinates
from drumsqueal.physics.model import Model, build_model
from drumsqueal.progress import Progress, silent
from drumsqueal.questions.onset.attractors import (
    PERSISTENT,
    Family,
    How,
    Start,
    find_attractors,
    go_on,
    round_seconds,
)
from drumsqueal.questions.onset.found import Kick, Leads, Motion, Response
from drumsqueal.questions.onset.kicks import LARGE, LEAST, Direction, directions, surface_speed
from drumsqueal.questions.onset.study import SIZES
from drumsqueal.questions.sensitivity.decay import disturbed
from drumsqueal.scene import Scene
from drumsqueal.simulation import start_of
from drumsqueal.solve.linear.branches import Point, point_at

QUICK = 3  # stages of disturbances, those that are likeliest to start squeal, of a brake that is not to be proven quiet
RANDOM, SEED = 32, 20231122  # disturbances of all modes at once, and the seed of the generator
SAMPLES = 2.5  # a period of the fastest mode, where the scene's rate is lower


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
    `kick` has the mode, the way and the size of a disturbance along a mode, None for others. `motion` is the squeal
    that it leads to.
    """

    start: str
    kind: Origin
    kick: Kick | None = None
    displacement: dict[str, float]
    velocity: dict[str, float]
    energy_J: float | None
    speed_m_per_s: float | None
    leads_to: Leads
    simulated_s: float
    motion: Motion | None = None


class Disturbed(NamedTuple):
    """A start, and what disturbance it is."""

    kind: Origin
    start: Start


class Judged(NamedTuple):
    """What became of a brake: its linear point, and the transients that were run until one of them did not decay."""

    point: Point
    trials: tuple[Trial, ...]

    @property
    def quiet(self) -> bool:
        """Whether steady sliding is stable and every transient decays."""
        stable = not self.point.reason and not self.point.unstable
        return stable and all(each.leads_to is Leads.DECAYS for each in self.trials)

    @property
    def motions(self) -> tuple[Motion, ...]:
        """The steady-state responses that differ, the one with most kinetic energy first."""
        found: list[Motion] = []
        for each in self.trials:
            if each.motion is not None and not any(each.motion.like(other) for other in found):
                found.append(each.motion)
        return tuple(sorted(found, key=lambda motion: -motion.kinetic_energy_J))


class Brake(NamedTuple):
    """Numbers that replace those of the scene, by key in SI, and squeal of a similar brake that may go on here."""

    numbers: Mapping[str, float]
    carried: tuple[Motion, ...] = ()


class Disturber:
    """Runs the transients of disturbed brakes that are a scene with other numbers, without its harmonic force."""

    def __init__(self, scene: Scene, progress: Progress = silent) -> None:
        """Take the scene, with one value for its drum speed and one for its load."""
        self._scene = scene if scene.forcing is None else scene.with_values({"forcing": None})
        self._progress = progress
        self._linear_coordinates = linear_coordinates(self._scene)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Those that move in the transients."""
        return build_model(self._scene).names

    def judge(self, brakes: Sequence[Brake], what: str, thorough: Sequence[bool] | None = None) -> list[Judged]:
        """Disturb brakes whose steady sliding is stable, each until it squeals.

        The disturbances: squeal of a similar brake, the scene's own start, one beyond the contact boundary and each
        mode `LARGE` beyond both of them; for those that are `thorough` (None: all), also each mode both ways in sizes
        from a tenth of the nearer boundary on, twice as large each time, `RANDOM` of all modes at once, and larger
        multiples of the carried squeal.
        """
        return self._judge(brakes, what, [True] * len(brakes) if thorough is None else thorough)

    def squeal(self, what: str) -> Judged:
        """The scene itself from all disturbances, stable or not, whichever squeal."""
        return self._judge([Brake({})], what, [True], until_squeal=False)[0]

    def _judge(
        self, brakes: Sequence[Brake], what: str, thorough: Sequence[bool], *, until_squeal: bool = True
    ) -> list[Judged]:
        family, points = self._family(brakes), []
        for k, _ in enumerate(brakes):
            points.append(point_at(self._linear_at(brakes), k))
        found: dict[int, list[Trial]] = {k: [] for k, _ in enumerate(brakes)}
        left = [k for k, point in enumerate(points) if not point.reason and not (until_squeal and point.unstable)]
        for stage, starts in enumerate(self._stages(brakes, points, family)):
            left = [k for k in left if stage < QUICK or thorough[k]]
            tasks = [(points[k], start) for k in left for start in starts(k)]
            for k, trial in self._run(family, tasks, what):
                found[k].append(trial)
            if until_squeal:
                left = [k for k in left if all(each.leads_to is Leads.DECAYS for each in found[k])]
        return [Judged(point, tuple(found[k])) for k, point in enumerate(points)]

    def _stages(
        self, brakes: Sequence[Brake], points: Sequence[Point], family: Family
    ) -> list[Callable[[int], list[Disturbed]]]:
        """The disturbances of brake k, those first that are likeliest to make it squeal."""
        own, beyond = (
            Disturbed(kind, Start(name, *start_of(scene, family.moving)))
            for kind, name, scene in (
                (Origin.OWN, "own start", self._scene),
                (Origin.DISPLACEMENT, "a displacement of 3 p0/k_c", disturbed(self._scene)),
            )
        )

        def likeliest(k: int) -> list[Disturbed]:
            return [_carried(motion) for motion in brakes[k].carried[:1]]

        def carried(k: int) -> list[Disturbed]:
            return [_carried(motion) for motion in brakes[k].carried[1:]]

        def large(k: int) -> list[Disturbed]:
            return [own, beyond, *(_along(each, each.sizes[-1]) for each in directions(points[k], family, (1,)))]

        def thorough(k: int) -> list[Disturbed]:
            multiples = [_carried(motion, size) for motion in brakes[k].carried for size in SIZES[1:]]
            return [*multiples, *_both_ways(family, points[k]), *random_starts(k)]

        def random_starts(k: int) -> list[Disturbed]:
            """All modes at once, each in a size and a phase of its own."""
            model, generator = family.model_at(k), np.random.default_rng(SEED)
            reached = [family.reach(mode, model) for mode in family.modes(points[k])]
            modes = [(shape, LEAST / max(far), LARGE / min(far)) for shape, far in reached if far]
            starts = []
            for number in range(RANDOM if modes else 0):
                sizes = [np.exp(generator.uniform(*np.log(limits))) for _, *limits in modes]
                turns = np.exp(2j * np.pi * generator.random(len(modes)))
                parts = [
                    size * (turn * shape).real for size, turn, (shape, *_) in zip(sizes, turns, modes, strict=True)
                ]
                starts.append(Disturbed(Origin.RANDOM, Start(f"random {number + 1}", *np.sum(parts, axis=0))))
            return starts

        return [likeliest, carried, large, thorough]

    def _family(self, brakes: Sequence[Brake]) -> Family:
        models: dict[int, Model] = {}

        def model_at(value: float) -> Model:
            k = int(value)
            if k not in models:
                models[k] = build_model(self._scene, brakes[k].numbers)
            return models[k]

        return Family(model_at, build_model(self._scene).names, self._linear_coordinates)

    def _linear_at(self, brakes: Sequence[Brake]) -> Callable[[float], Model]:
        return lambda value: build_model(self._scene, brakes[int(value)].numbers, self._linear_coordinates)

    def _how(self, points: Sequence[Point], family: Family) -> How:
        simulate = self._scene.simulate
        highest = max((mode.frequency_Hz for point in points for mode in point.modes), default=0.0)
        rate = max(simulate.sample_rate, SAMPLES * highest)
        return How(rate, simulate.tolerance, round_seconds(points, family.moving), simulate.solver)

    def _responses(self, family: Family, tasks: Sequence[tuple[Point, Start]], report: Progress) -> Iterator[Response]:
        """Brakes of about one lowest frequency together: the slowest sets how long a round is."""
        groups: dict[int, list[tuple[Point, Start]]] = {}
        for task in tasks:
            octave = math.ceil(math.log2(round_seconds([task[0]], family.moving)))
            groups.setdefault(octave, []).append(task)
        for some in groups.values():
            how = self._how([point for point, _ in some], family)
            yield from find_attractors(family, some, how, rounds=PERSISTENT, progress=report)

    def _run(self, family: Family, tasks: Sequence[tuple[Point, Disturbed]], what: str) -> Iterator[tuple[int, Trial]]:
        done = 0

        def report(*_: object) -> None:
            self._progress(what, done, len(tasks))

        # Each under a name of its own, by which it is told from the others when it comes back.
        named = [(point, each.start._replace(name=str(k))) for k, (point, each) in enumerate(tasks)]
        for response in self._responses(family, named, report):
            tried, k = tasks[int(response.start)][1], int(response.value)
            yield k, _trial(tried, response, family.model_at(k))
            done += 1
            report()


def _both_ways(family: Family, point: Point) -> list[Disturbed]:
    """Velocities both ways along each mode, twice as large each time, but for the largest forwards, run before."""
    return [
        _along(each, size)
        for each in directions(point, family)
        for size in (each.sizes[:-1] if each.forwards else each.sizes)
    ]


def _along(direction: Direction, size: float) -> Disturbed:
    """A velocity of a size along a mode."""
    way = "forwards" if direction.forwards else "backwards"
    name = f"{direction.mode.label} {way}, {direction.kick(size).energy_J:.2g} J"
    return Disturbed(Origin.MODE, direction.start(size)._replace(name=name))


def _carried(motion: Motion, size: float = 1.0) -> Disturbed:
    """The squeal of a similar brake, or a multiple of it."""
    line = "" if motion.frequency_Hz is None else f" at {motion.frequency_Hz:.0f} Hz"
    times = "" if size == 1 else f"{size:g} times "
    return Disturbed(Origin.EARLIER, go_on(0.0, motion, size)._replace(name=f"{times}earlier squeal{line}"))


def _trial(tried: Disturbed, response: Response, model: Model) -> Trial:
    """The transient of a model from a disturbance."""
    kind, start = tried
    displacement, velocity = (
        dict(zip(model.names, part.tolist(), strict=True)) for part in (start.vibration, start.velocity)
    )
    kicked = not np.any(start.vibration)  # of a displacement the energy hangs on the contact, too
    motion = response.motion
    return Trial(
        start=start.name,
        kind=kind,
        kick=start.kick,
        displacement=displacement,
        velocity=velocity,
        energy_J=float(np.asarray(model.mass) @ start.velocity**2 / 2) if kicked else None,
        speed_m_per_s=surface_speed(model, start.velocity) if kicked else None,
        leads_to=response.leads_to,
        simulated_s=response.simulated_s,
        motion=motion if motion is None else motion.model_copy(update={"start": start.name}),
    )
