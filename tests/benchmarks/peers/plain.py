"""The right-hand side that most people would write: NumPy on a fixed grid along the arc, kinks and all."""

import numpy as np

from . import parameters as p


class PlainRightHandSide:
    """ẏ = f(t, y), y scaled: N = max(0, p0 + k_c u_r), F = −μ(|V|) N sgn V, summed over equal intervals of the arc."""

    def __init__(self, parameters: np.ndarray, grid: int) -> None:
        """Lay out the grid once; the interval is β over its points (rad)."""
        self.parameters = parameters
        half_angle = parameters[p.HALF_ANGLE]
        angle = half_angle * (2 * np.arange(grid) + 1 - grid) / grid
        self.cosine, self.sine = np.cos(angle), np.sin(angle)
        self.area = 2 * half_angle / grid * parameters[p.RADIUS] * parameters[p.WIDTH]
        self.scale = parameters[p.SCALE : p.SCALE + 6]
        # The balance of the grid itself, so that q = 0 is its own steady sliding.
        self.balance = np.zeros(3)
        self.balance = -self._force(np.zeros(6))

    def _force(self, state: np.ndarray) -> np.ndarray:
        a, cosine, sine = self.parameters, self.cosine, self.sine
        qx, qy, qt, vx, vy, vt = state
        pressure = np.maximum(0.0, a[p.PRELOAD] + a[p.STIFFNESS] * (qx * cosine + (qy - a[p.CENTROID] * qt) * sine))
        slip = a[p.RADIUS] * vt - a[p.DRUM] - vx * sine + (vy - a[p.CENTROID] * vt) * cosine
        friction = a[p.KINETIC] + a[p.DIFFERENCE] * np.exp(-a[p.DECAY] * np.abs(slip))
        drag = -np.sign(slip) * friction * pressure
        x = np.sum(-pressure * cosine - drag * sine) * self.area
        y = np.sum(-pressure * sine + drag * cosine) * self.area
        spin = a[p.RADIUS] * np.sum(drag) * self.area - a[p.CENTROID] * y
        support = np.array([a[p.SUPPORT] * qx, 0.0, a[p.TORSION] * np.sin(qt) * np.cos(qt)])
        return np.array([x, y, spin]) + self.balance - support

    def __call__(self, time: float, scaled: np.ndarray) -> np.ndarray:
        """Rate of the scaled state."""
        del time
        self.parameters[p.EVALUATIONS] += 1
        state = scaled * self.scale
        acceleration = self._force(state) * self.parameters[p.INVERSE_MASS : p.INVERSE_MASS + 3]
        return np.concatenate([state[3:], acceleration]) / self.scale
