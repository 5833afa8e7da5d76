"""Disturbances along the modes: velocities from steady sliding in the shape of a mode, one way or the other.

They are tried in sizes from below the contact boundaries to beyond both of them, twice as large each time.
"""

import math

import numpy as np
from numpy.typing import NDArray

from drumsqueal.physics.effects.contact import Contact
from drumsqueal.physics.effects.several import Contacts
from drumsqueal.physics.model import Model
from drumsqueal.questions.onset.family import Family, Start
from drumsqueal.questions.onset.motions import Kick
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
