"""Stand-ins for models of two unlike shoes on a drum that turns backwards, with numbers that differ everywhere."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import xarray

from drumsqueal.findings.vibration import Vibration
from drumsqueal.physics.bodies.brake import Share
from drumsqueal.physics.effects.operation import Constant, Operation, PiecewiseLinear
from drumsqueal.physics.effects.pressure import Unilateral

NAMES = ("a.X", "a.Tz", "b.X", "b.Y", "b.Tz", "drum.E1")
SHARES = (Share("a.", (0, 1, 5), 6, 0), Share("b.", (2, 3, 4, 5), 6, 1))
OWN = (("X", "Tz", "drum.E1"), ("X", "Y", "Tz", "drum.E1"))
RADIUS, STIFFNESS, AREA = 0.17, (3.0e7, 1.3e7), (0.011, 0.007)
SPEED = PiecewiseLinear([0.0, 2.0, 5.0], [-6.0, -3.0, -1.5])
LOADS = PiecewiseLinear([1.0, 3.0], [0.0, 900.0]), Constant(700.0)


def two_shoes(*, frictions: tuple[bool, bool] = (True, True), stiffness=STIFFNESS, pushed=False, loads=LOADS) -> Any:
    """A model of two shoes; `into` and `along` (points, n) are how its linings move."""
    rng, sides = np.random.default_rng(7), []
    for share, own, spring, rubs, area in zip(SHARES, OWN, stiffness, frictions, AREA, strict=True):
        into, along = rng.normal(size=(2, 11, len(own)))

        def largest(q, into=into, along=along, own=own):
            columns = [np.asarray(q[name]) for name in own]
            return tuple(
                sum(np.abs(m).max(axis=0)[k] * np.abs(c) for k, c in enumerate(columns)) for m in (into, along)
            )

        body = SimpleNamespace(surface=lambda into=into, along=along: (into, along), largest=largest, area=area)
        law, friction = Unilateral(spring), object() if rubs else None
        contact = SimpleNamespace(radius=RADIUS, lifting_stiffness=spring, law=law, friction=friction)
        sides.append((share, SimpleNamespace(body=body, contact=contact, lining=SimpleNamespace(law=law))))
    operation = Operation(SPEED, loads[0], further=(loads[1],))
    contact = SimpleNamespace(radius=RADIUS, friction=object() if any(frictions) else None, shoes=2)
    characteristic_lengths = dict(zip(NAMES, [1.0, 0.17, 1.0, 1.0, 0.19, 0.4], strict=True))
    return SimpleNamespace(
        sides=sides, operation=operation, names=NAMES, pushed=pushed, contact=contact, forced=False, remembering=(),
        body=SimpleNamespace(characteristic_lengths=lambda: characteristic_lengths, area=sum(AREA)),
        mass=np.array([2.0, 0.03, 3.0, 3.5, 0.05, 1.0]),
    )  # fmt: skip


def record(time: np.ndarray, displacement: np.ndarray, velocity: np.ndarray, names: tuple[str, ...], **signals: Any):
    """A history of displacements and velocities (time, n), and signals (time,)."""
    motion = {"displacement": displacement, "velocity": velocity}
    data = {name: (("time", "coordinate"), values) for name, values in motion.items()}
    data |= {name: ("time", values) for name, values in signals.items()}
    return xarray.Dataset(data, {"time": time, "coordinate": list(names)})


def vibration_of(history: xarray.Dataset, coordinates: tuple[str, ...], steady: np.ndarray, **more: Any):
    """The history seen from a steady state of some of its coordinates, and that as a stability."""
    stability: Any = SimpleNamespace(coordinates=coordinates, steady_state=steady, **more)
    return Vibration(history, stability), stability


def mode_of(frequency: float, growth: float) -> Any:
    """What an answer to a scene has of a mode."""
    return SimpleNamespace(frequency_Hz=frequency, growth_rate=growth)
