"""What transients start from: models along a parameter, their small starts, and how they are integrated."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.findings.boundaries import boundary_ratios_by_shoe
from drumsqueal.findings.decay import SMALL
from drumsqueal.physics.model import Model
from drumsqueal.questions.onset.motions import SMALL_START, Kick, SteadyResponse
from drumsqueal.solve.linear.branches import ModelAt, Point
from drumsqueal.solve.linear.modes import Mode
from drumsqueal.solve.transient.runge_kutta import AUTO


class Start(NamedTuple):
    """A displacement (n,) from steady sliding and a velocity (n,), what to call them, and what they are.

    That is a disturbance along a mode, or the motion at another value.
    """

    name: str
    vibration: NDArray[np.float64]
    velocity: NDArray[np.float64]
    kick: Kick | None = None
    from_value: float | None = None


def go_on(value: float, motion: SteadyResponse, size: float = 1.0) -> Start:
    """The end of a motion at a value, or a multiple of it, as a start at another value."""
    name = f"from {value:.6g}" if size == 1 else f"{size:g} times from {value:.6g}"
    return Start(name, *(size * motion.state), from_value=value)


class How(NamedTuple):
    """How transients are integrated, as in a scene, and how long a round is (s)."""

    sample_rate: float
    tolerance: float
    round_seconds: float = 0.0
    solver: str = AUTO
    threads: int | None = None


class Family:
    """Models of one composition along a parameter: `model_at` a value, over the coordinates that move (`moving`).

    `names` are the coordinates of the linear model, which may be more.
    """

    def __init__(self, model_at: ModelAt, moving: tuple[str, ...], names: tuple[str, ...]) -> None:
        """Take the models and the names of their coordinates."""
        self.model_at, self.moving, self.names = model_at, moving, names

    def modes(self, point: Point) -> list[Mode]:
        """Modes of a point that the coordinates that move can show."""
        return [mode for mode in point.modes if mode.name in self.moving]

    def vibrations(self, point: Point) -> list[Mode]:
        """What the coordinates that move may vibrate like at a point, or would without damping."""
        return [mode for mode in point.vibrations if mode.name in self.moving]

    def shown(self, vector: NDArray) -> NDArray:
        """The entries (n,) of the coordinates that move, of one over those of the linear model."""
        return np.array([vector[self.names.index(name)] for name in self.moving])

    def matrix(self, point: Point) -> NDArray[np.float64]:
        """The state matrix (2n, 2n) over the coordinates that move."""
        places = np.array([self.names.index(name) for name in self.moving])
        both = np.concatenate([places, len(self.names) + places])
        return point.matrix[np.ix_(both, both)]

    def small_start(self, point: Point, model: Model, size: float = SMALL) -> Start:
        """All modes at once, within this fraction of the nearer contact boundary."""
        modes = self.vibrations(point)
        parts = [self._scaled(mode, model, size / len(modes)) for mode in modes]
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

    def _scaled(self, mode: Mode, model: Model, fraction: float) -> NDArray[np.float64]:
        """Displacement and velocity (2, n) of a mode of a size that comes to this fraction of the nearer boundary."""
        shape, reached = self.reach(mode, model)
        return np.real(shape) * (fraction / max(reached) if reached else 0.0)
