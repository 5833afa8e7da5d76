"""How large a disturbance must be to start squeal where steady sliding is stable: the smallest one that is enough.

A disturbance is a velocity from steady sliding along the shape of a mode, one way or the other. Each is tried in sizes
from below, twice as large each time. Between the largest that decays and the smallest that leads to squeal the search
then goes on, as long as a disturbance that takes less energy may lie there.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.model import Model
from drumsqueal.progress import Progress
from drumsqueal.questions.onset.attractors import LARGE, LASTING, PERSISTENT, Family, How, Start, find_attractors
from drumsqueal.questions.onset.found import Disturbance, Leads, Motion, Row
from drumsqueal.solve.linear.branches import Point
from drumsqueal.solve.linear.modes import Mode

LEAST = 0.1  # of the nearer contact boundary: the smallest at first; the largest is `LARGE` of the farther one
SMALLER = 10  # halvings below that, where it squeals already
SECTIONS = 3  # sizes tried at once between two
PRECISION = 0.02  # of a velocity: how far the two may be apart in the end
TURNS = 64  # phases of a mode's period, of which the one with most kinetic energy is taken
POINTS = 181  # of the lining along the arc, at which its velocity is looked at


def smallest_disturbances(
    family: Family, rows: Sequence[Row], how: How, progress: Progress
) -> Iterator[dict[float, Disturbance]]:
    """Find the smallest disturbance that leads to squeal at each row: all of them by value, known better each time.

    A value is not among them where none of those tried does.
    """
    searches = [_directions(row, family) for row in rows]
    while True:
        tasks: list[tuple[_Direction, float]] = []
        for directions in searches:
            best = min((each.squeals_at for each in directions), default=math.inf)
            tasks += [(each, size) for each in directions for size in each.next_sizes(best)]
        if not tasks:
            return
        _run(family, tasks, how, progress)
        found = [min(each, key=lambda direction: direction.squeals_at) for each in searches if each]
        yield {each.row.value: each.disturbance() for each in found if each.loud}


def first_disturbances(family: Family, point: Point) -> list[Start]:
    """The disturbances that a search at a point begins with: both ways along each mode, twice as large each time."""
    return [
        Start(f"{each.mode.label} {each.way}, {size**2:.2g} J", 0 * each.velocity, size * each.velocity)
        for each in _directions(Row.at(point, asked=True), family)
        for size in each.next_sizes(math.inf)
    ]


def surface_speed(model: Model, velocity: NDArray[np.float64]) -> float:
    """Velocity (m/s) of the fastest point of the lining's surface, max |v + ω × r|, in a motion (n,) of the shoe."""
    v = dict(zip(model.names, velocity, strict=True))
    if not isinstance(model.contact, Contact):
        return float(abs(v["X"]))
    body = model.contact.body
    angle, across = float(body.half_angle) * np.linspace(-1, 1, POINTS), float(body.width) / 2 * np.array([[-1], [1]])
    squares = sum(np.square(part) for part in body.displacement(v, angle, across))
    return float(np.sqrt(np.max(squares)))


class _Direction:
    """Disturbances along a mode one way at a row, as multiples √J of the one of 1 J, and where those tried led."""

    def __init__(self, row: Row, mode: Mode, sign: int, model: Model, family: Family) -> None:
        shape, fractions = family.reach(mode, model)
        turns = np.exp(2j * np.pi * np.arange(TURNS) / TURNS)
        velocities = (turns[:, None] * shape[1]).real
        energies = velocities**2 @ np.asarray(model.mass) / 2
        of_one_joule = 1 / math.sqrt(energies.max())
        self.way = "forwards" if sign > 0 else "backwards"
        self.name = f"kick {mode.label} {self.way}"
        self.row, self.mode, self.coordinates = row, mode, family.moving
        self.velocity = sign * of_one_joule * velocities[np.argmax(energies)]
        self.surface_speed = surface_speed(model, self.velocity)
        self.boundary_ratio = of_one_joule * max(fractions)
        self.least, self.most = LEAST / self.boundary_ratio, LARGE / (of_one_joule * min(fractions))
        self.quiet: set[float] = set()
        self.loud: dict[float, Motion] = {}
        self.tried: set[float] = set()

    @property
    def squeals_at(self) -> float:
        """The smallest size that squeals."""
        return min(self.loud, default=math.inf)

    @property
    def quiet_below(self) -> float:
        """The largest size below that which decays."""
        return max((size for size in self.quiet if size < self.squeals_at), default=0.0)

    def next_sizes(self, best: float) -> list[float]:
        """What to try next, where `best` is the smallest size that squeals in any direction."""
        low, high = self.quiet_below, self.squeals_at
        if not self.tried:
            doublings = max(1, math.ceil(math.log2(self.most / self.least)))
            sizes = np.geomspace(self.least, self.most, doublings + 1)
        elif low >= best or high == math.inf or high <= (1 + PRECISION) * low:
            return []
        elif low == 0:
            sizes = high / 2.0 ** np.arange(1, SMALLER + 1)
        else:
            sizes = np.geomspace(low, high, SECTIONS + 2)[1:-1]
        return [float(size) for size in sizes if size not in self.tried and size >= self.least / 2**SMALLER]

    def disturbance(self) -> Disturbance:
        """The smallest that squeals, as far as it is known."""
        low, high = self.quiet_below, self.squeals_at
        size = (low + high) / 2
        return Disturbance(
            mode=self.mode.label,
            velocity=dict(zip(self.coordinates, (size * self.velocity).tolist(), strict=True)),
            speed_m_per_s=size * self.surface_speed,
            speed_uncertainty_m_per_s=(high - low) / 2 * self.surface_speed,
            energy_J=size**2,
            energy_uncertainty_J=(high**2 - low**2) / 2,
            edge_share=size * self.boundary_ratio,
            leads_to=self.loud[high],
        )


def _directions(row: Row, family: Family) -> list[_Direction]:
    """Both ways along each mode that comes near a contact boundary."""
    model = family.model_at(row.value)
    modes = [mode for mode in family.modes(row.point) if family.reach(mode, model)[1]]
    return [_Direction(row, mode, sign, model, family) for mode in modes for sign in (1, -1)]


def _run(family: Family, tasks: Sequence[tuple[_Direction, float]], how: How, progress: Progress) -> None:
    """Try sizes, and note where each leads.

    Near the smallest disturbance that starts squeal motion dwells on the unstable cycle, which may look settled: what
    is none of the motions known at the value must last longer.
    """
    meant, done = {}, 0
    for direction, size in tasks:
        direction.tried.add(size)
        meant[direction.row.value, f"{direction.name} {size!r}"] = direction, size

    def report(*_: object) -> None:
        progress("smallest disturbance", done, len(tasks))

    starts: list[tuple[Point, Start]] = [
        (direction.row.point, Start(name, 0 * direction.velocity, size * direction.velocity))
        for (_, name), (direction, size) in meant.items()
    ]
    doubtful = []
    for rounds, some in ((PERSISTENT, starts), (LASTING, doubtful)):
        for response in find_attractors(family, some, how, rounds=rounds, progress=report):
            direction, size = meant[response.value, response.start]
            motion = response.motion
            if rounds == PERSISTENT and motion and not any(motion.like(known) for known in direction.row.motions):
                doubtful.append((direction.row.point, Start(response.start, *motion.state)))
                continue
            if motion is not None:
                direction.loud[size] = motion
            elif response.leads_to in (Leads.DECAYS, Leads.NEUTRAL):
                direction.quiet.add(size)
            done += 1
            report()
