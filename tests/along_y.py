"""The damped brake along Y alone, bonded to the drum: one equation, solved by SciPy and in closed form.

Studies of it take seconds, and what they say is known: pressure along the arc is odd but for the load, so that friction
goes by the velocity alone, m ÿ + 2ζωm ẏ + k y = F(ẏ) − F(0).
"""

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from drumsqueal.scene import Scene, load_scene

SETTINGS = ['simulate.coordinates=["Y"]', "start.displacement={Y=5e-5}", "contact.separation=false"]
OPTIONS = tuple(word for setting in SETTINGS for word in ("--set", setting))
_CYCLES: dict[tuple, tuple[float, float, float]] = {}
UNIT = np.array([1e-5, 0.1])  # of displacement (m) and velocity (m/s)


def brake_along_y(*more: str) -> Scene:
    """The scene, with more settings."""
    return load_scene("scenarios/damped.toml", [*SETTINGS, *more])


class AlongY:
    """Its frequency (Hz), growth rate (1/s) and critical speed (rad/s), and its limit cycle."""

    def __init__(self, scene: Any):
        shoe, self.friction, self.half = scene.shoe, scene.friction, scene.shoe.arc_angle / 2
        area, inner = shoe.outer_radius * shoe.width, shoe.outer_radius - shoe.thickness
        self.mass = shoe.density * shoe.width * self.half * (shoe.outer_radius**2 - inner**2)
        self.omega = np.sqrt(scene.contact.stiffness * area * (self.half - np.sin(2 * self.half) / 2) / self.mass)
        self.damping = 2 * scene.damping.ratio * self.omega * self.mass
        self.radius, self.speed = shoe.outer_radius, shoe.outer_radius * scene.drum.speed
        self.line = scene.contact.normal_load / (2 * self.half)  # N for each radian
        self.nodes, self.weights = np.polynomial.legendre.leggauss(16)
        self.frequency_Hz = self.omega / (2 * np.pi)

    def drive(self, speed):
        """What friction gives to small vibration: −∂F/∂ẏ at a speed of the drum's surface."""
        law = self.friction
        slope = law.decay * (law.static - law.kinetic) * np.exp(-law.decay * speed)
        return slope * self.line * (self.half + np.sin(2 * self.half) / 2)

    @property
    def growth_rate(self):
        return (self.drive(self.speed) - self.damping) / (2 * self.mass)

    @property
    def critical_speed(self):
        return np.log(self.drive(0.0) / self.damping) / (self.friction.decay * self.radius)

    def force(self, velocity):
        """Friction along Y; the arc is split where slip reverses."""
        law = self.friction
        reverses = np.arccos(np.clip(self.speed / velocity, -1, 1)) if abs(velocity) > self.speed else 0.0
        place = np.clip(reverses if velocity > 0 else 0.0, 0.0, self.half)
        total = 0.0
        for low, high in ((0.0, place), (place, self.half)):
            angle = low + (high - low) * (1 + self.nodes) / 2
            slip = self.speed - velocity * np.cos(angle)
            friction = np.sign(slip) * (law.kinetic + (law.static - law.kinetic) * np.exp(-law.decay * np.abs(slip)))
            total += (high - low) * np.sum(self.weights * friction * np.cos(angle))  # both halves of the arc
        return self.line * total

    def rate(self, _, scaled):
        y, v = scaled * UNIT
        pushed = self.force(v) - self.force(0.0) - self.damping * v
        return np.array([v, pushed / self.mass - self.omega**2 * y]) / UNIT

    def motion(self, y, times):
        """Displacement (m) and velocity (m/s) at times, (k, 2), of a motion that stays below reversal of the slip."""
        how = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12, "t_eval": times}
        return solve_ivp(self.rate, (0, times[-1]), [y, 0] / UNIT, **how).y.T * UNIT

    @property
    def cycle(self):
        """Frequency (Hz), half peak to peak (m) and the multiplier beside 1, where 16 periods from the start lead."""
        numbers = (self.mass, self.omega, self.damping, self.speed, self.line, str(self.friction))
        if numbers not in _CYCLES:  # several files of tests ask for the same one
            _CYCLES[numbers] = self._cycle()
        return _CYCLES[numbers]

    def _cycle(self):
        def rises(_, scaled):
            return scaled[0]

        rises.direction = 1  # pyright: ignore[reportFunctionMemberAccess]
        period = 2 * np.pi / self.omega
        how = {
            "max_step": period / 60,
            "rtol": 1e-10,
            "atol": 1e-11,
        }  # short steps, as it has kinks where slip reverses
        found = solve_ivp(self.rate, (0, 16 * period), [5e-5, 0] / UNIT, events=rises, dense_output=True, **how)
        first, last = found.t_events[0][-2:]
        moved = found.sol(np.linspace(first, last, 1001))[0] * UNIT[0]
        # After eight periods 1e-4 of the motion is left to go, and falls by the multiplier in each.
        one, two, three = found.y_events[0][8:11, 1]
        return 1 / (last - first), np.ptp(moved) / 2, (three - two) / (two - one)
