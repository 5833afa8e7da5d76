"""Disturbances along the modes: velocities from steady sliding in the shape of a mode, one way or the other.

They are tried in sizes from below the contact boundaries to beyond both of them, twice as large each time.
"""

import math
from collections.abc import Iterator, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.effects.several import Contacts
from drumsqueal.physics.model import Model
from drumsqueal.progress import Progress
from drumsqueal.questions.onset.attractors import LASTING, PERSISTENT, find_attractors
from drumsqueal.questions.onset.family import Family, How, Start
from drumsqueal.questions.onset.found import Row
from drumsqueal.questions.onset.motions import Disturbance, Kick, Leads, Response, SteadyResponse
from drumsqueal.solve.linear.branches import Point
from drumsqueal.solve.linear.modes import Mode

LEAST = 0.1  # of the nearer contact boundary: the smallest
LARGE = 3.0  # of the farther contact boundary: the largest, by which contact is lost and slip reversed
TURNS = 64  # phases of a mode's period, of which the one with most kinetic energy is taken
POINTS = 181  # of the lining along the arc, at which its velocity is looked at


class KickDirection:
    """Disturbances along a mode one way, of sizes √J: multiples of the one of 1 J."""

    def __init__(self, mode: Mode, sign: int, model: Model, family: Family) -> None:
        """Take the shape of a mode; `sizes` are those that are tried first, by doublings."""
        shape, fractions = family.reach(mode, model)
        turns = np.exp(2j * np.pi * np.arange(TURNS) / TURNS)
        velocities = (turns[:, None] * shape[1]).real
        energies = velocities**2 @ np.asarray(model.mass) / 2
        of_one_joule = 1 / math.sqrt(energies.max())
        self.name = f"kick {mode.label} {'forwards' if sign > 0 else 'backwards'}"
        self.mode, self.forwards, self._coordinates = mode, sign > 0, family.moving
        self._velocity = sign * of_one_joule * velocities[np.argmax(energies)]
        self._surface_speed = surface_speed(model, self._velocity)
        self.boundary_ratio = of_one_joule * max(fractions)
        self.least, most = LEAST / self.boundary_ratio, LARGE / (of_one_joule * min(fractions))
        self.sizes: list[float] = np.geomspace(
            self.least, most, max(1, math.ceil(math.log2(most / self.least))) + 1
        ).tolist()

    def kick(self, size: float) -> Kick:
        """The disturbance of a size."""
        return Kick(
            mode=self.mode.label,
            forwards=self.forwards,
            velocity=dict(zip(self._coordinates, (size * self._velocity).tolist(), strict=True)),
            speed_m_per_s=size * self._surface_speed,
            energy_J=size**2,
            edge_share=size * self.boundary_ratio,
        )

    def start(self, size: float) -> Start:
        """The same as a start; its name has the size in multiples of the nearer contact boundary."""
        name = f"{self.name} {size * self.boundary_ratio:.4g}"
        return Start(name, 0 * self._velocity, size * self._velocity, kick=self.kick(size))


def directions(point: Point, family: Family, signs: tuple[int, ...] = (1, -1)) -> list[KickDirection]:
    """Ways along each mode that comes near a contact boundary."""
    model = family.model_at(point.value)
    modes = [mode for mode in family.vibrations(point) if family.reach(mode, model)[1]]
    return [KickDirection(mode, sign, model, family) for mode in modes for sign in signs]


def surface_speed(model: Model, velocity: NDArray[np.float64]) -> float:
    """Velocity (m/s) of the fastest point of the lining, relative to steady sliding on the drum, in a motion (n,)."""
    if isinstance(model.contact, Contacts):
        return max(surface_speed(side, velocity[np.array(mine.places)]) for mine, side in model.sides)
    if not isinstance(model.contact, Contact):
        return float(abs(velocity[model.contact.slides.index(True)]))
    v, body = dict(zip(model.names, velocity, strict=True)), model.contact.body
    angle, across = float(body.half_angle) * np.linspace(-1, 1, POINTS), float(body.width) / 2 * np.array([[-1], [1]])
    squares = sum(np.square(part) for part in body.over_drum(v, angle, across))
    return float(np.sqrt(np.max(squares)))


# How large a disturbance must be to lead to a motion where steady sliding is stable: the smallest one that is enough.
#
# A disturbance is a velocity from steady sliding along the shape of a mode, one way or the other. Each is tried in
# sizes from below, twice as large each time. For each motion that is found the search then goes on between the largest
# that leads elsewhere and the smallest that leads there, as long as a disturbance that takes less energy may lie there.


SMALLER = 10  # halvings below the sizes tried at first, where it squeals already
SECTIONS = 3  # sizes tried at once between two
PRECISION = 0.02  # of a velocity: how far the two may be apart in the end
_SAME_SIZE = 1e-9  # relative difference of two sizes that are one, but for round-off
_CLEAR = (Leads.DECAYS, Leads.NEUTRAL, Leads.SQUEALS, Leads.RESTS)


def smallest_disturbances(
    family: Family, rows: Sequence[Row], how: How, progress: Progress
) -> Iterator[tuple[Row, ...]]:
    """Find the smallest disturbance that leads to each motion at each row: the rows with it, known better each time.

    What the disturbances lead to joins the starts of a row, and its motions. A motion that none of those tried leads to
    has none.
    """
    searches = [_Search(row, family) for row in rows]
    while True:
        tasks = [(search, *each) for search in searches for each in search.next()]
        if not tasks:
            return
        _run(family, tasks, how, progress)
        yield tuple(search.row for search in searches)


class _Search:
    """Disturbances along the modes of a row, either way, and where those tried led."""

    def __init__(self, row: Row, family: Family) -> None:
        self._row, self._directions = row, directions(row.point, family)
        self._led: list[dict[float, Response]] = [{} for _ in self._directions]
        for response in row.starts:
            for direction, led in zip(self._directions, self._led, strict=True):
                kick = response.kick
                if kick is not None and (kick.mode, kick.forwards) == (direction.mode.label, direction.forwards):
                    led[math.sqrt(kick.energy_J)] = response

    @property
    def point(self) -> Point:
        """The linear point."""
        return self._row.point

    @property
    def motions(self) -> Sequence[SteadyResponse]:
        """Those known there."""
        return self._row.motions

    @property
    def row(self) -> Row:
        """The row with all that is known."""
        found = [self._smallest(motion) for motion in self._row.motions]
        return self._row.model_copy(update={"smallest_kicks": tuple(each for each in found if each is not None)})

    def next(self) -> list[tuple[KickDirection, float]]:
        """What to try next: first the sizes of each direction, then what lies between."""
        tasks = []
        for direction, led in zip(self._directions, self._led, strict=True):
            sizes = set(direction.sizes) if not led or max(led) < (1 - _SAME_SIZE) * direction.sizes[-1] else set()
            tasks += [(direction, size) for size in sorted(sizes) if not _tried(led, size)]
        if tasks:
            return tasks
        for motion in self._row.motions:
            brackets = [_bracket(led, motion) for led in self._led]
            best = min((high for _, high in brackets), default=math.inf)
            for direction, led, (low, high) in zip(self._directions, self._led, brackets, strict=True):
                sizes = _between(low, high) if low < best else []
                fresh = [size for size in sizes if not _tried(led, size) and size >= direction.least / 2**SMALLER]
                tasks += [(direction, size) for size in fresh if (direction, size) not in tasks]
        return tasks

    def add(self, direction: KickDirection, size: float, response: Response) -> None:
        """Note where a disturbance led."""
        self._led[self._directions.index(direction)][size] = response
        self._row = self._row.model_copy(update={"starts": (*self._row.starts, response)})

    def _smallest(self, motion: SteadyResponse) -> Disturbance | None:
        """The smallest that leads to a motion, as far as it is known."""
        brackets = [_bracket(led, motion) for led in self._led]
        if not brackets or min(high for _, high in brackets) == math.inf:
            return None
        k = min(range(len(brackets)), key=lambda k: brackets[k][1])
        low, high = brackets[k]
        lower, upper = (self._directions[k].kick(size) for size in (low, high))
        halfway = dict(self._directions[k].kick((low + high) / 2))
        return Disturbance(
            **halfway,
            speed_uncertainty_m_per_s=(upper.speed_m_per_s - lower.speed_m_per_s) / 2,
            energy_uncertainty_J=(upper.energy_J - lower.energy_J) / 2,
            leads_to=cast("SteadyResponse", self._led[k][high].motion),
        )


def _tried(led: dict[float, Response], size: float) -> bool:
    return any(abs(other / size - 1) < _SAME_SIZE for other in led)


def _bracket(led: dict[float, Response], motion: SteadyResponse) -> tuple[float, float]:
    """The largest size below that leads elsewhere, zero without one, and the smallest that leads to a motion."""
    high = min((size for size, each in led.items() if each.motion and each.motion.same(motion)), default=math.inf)
    elsewhere = (size for size, each in led.items() if size < high and each.leads_to in _CLEAR)
    return max(elsewhere, default=0.0), high


def _between(low: float, high: float) -> list[float]:
    """Sizes to try between one that leads elsewhere and one that leads to the motion."""
    if high == math.inf or high <= (1 + PRECISION) * low:
        return []
    if low == 0:
        return (high / 2.0 ** np.arange(1, SMALLER + 1)).tolist()
    return np.geomspace(low, high, SECTIONS + 2)[1:-1].tolist()


def _run(family: Family, tasks: Sequence[tuple[_Search, KickDirection, float]], how: How, progress: Progress) -> None:
    """Try sizes, and note where each leads.

    Near the smallest disturbance that leads to a motion the transient dwells on the unstable cycle, which may look
    settled: what is none of the motions known at the value must last longer.
    """
    meant, done = {}, 0
    starts: list[tuple[Point, Start]] = []
    known: dict[float, Sequence[SteadyResponse]] = {}
    for search, direction, size in tasks:
        start = direction.start(size)
        meant[search.point.value, start.name] = search, direction, size
        starts.append((search.point, start))
        known[search.point.value] = search.motions

    def report(*_: object) -> None:
        progress("smallest disturbance", done, len(tasks))

    doubtful = []
    for rounds, some in ((PERSISTENT, starts), (LASTING, doubtful)):
        for response in find_attractors(family, some, how, rounds=rounds, known=known, progress=report):
            search, direction, size = meant[response.value, response.start]
            motion = response.motion
            if rounds == PERSISTENT and motion and not any(motion.same(other) for other in search.motions):
                doubtful.append((search.point, Start(response.start, *motion.state, kick=response.kick)))
                continue
            search.add(direction, size, response)
            done += 1
            report()
