"""A change between stick and slip, and sixty starts of a block that lies still beside stick and slip.

The block has exponential friction of 1.0, 0.5 and 2 s/m and a damping of 0.1; between belt speeds of 1.1513 and 1.8366
m/s both motions are stable, and a start decides. A change is what a motion that sticks takes more than one that never
does over the same time, over the number of its changes.
"""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from drumsqueal.physics.friction_law import ExponentialLaw
from drumsqueal.physics.model import Model
from drumsqueal.physics.small_bodies import block_on_belt
from drumsqueal.solve.transient.integrate import integrate, integrate_many

from .record import Record
from .turns import scatter, take_turns

SPEEDS, COUNT, SEED = (1.1513, 1.8366), 60, 0
DURATION = 200.0  # s, some thirty periods: all are then on their way to the one or the other
HOW: Any = {"sample_rate": 20.0, "tolerance": 1e-6, "duration": DURATION}
MOST_A_CHANGE, MOST_SIXTY = 1.1e-3, 4.6  # s
ROUNDS, BETWEEN = 9, 1.3


def measure(record: Record, folder: Path) -> None:
    """Measure, print and judge."""
    del folder
    random = np.random.default_rng(SEED)
    speeds, starts = random.uniform(*SPEEDS, COUNT), random.uniform(-2.0, 2.0, (COUNT, 2))
    models = [block(speed) for speed in speeds]
    sticking, sliding = (partial(follow, block(BETWEEN), BETWEEN, np.array([x, 0.0])) for x in (1.5, 0.01))
    calls = {"sticks": sticking, "slides": sliding, "one by one": lambda: sum(map(follow, models, speeds, starts))}
    calls |= {f"in a batch, {k} thread{'s'[: k - 1]}": partial(together, models, speeds, starts, k) for k in (1, 2)}
    for call in calls.values():
        call()  # compiles
    seconds, found = take_turns(calls, ROUNDS)
    for name, taken in seconds.items():
        record.keep("sticking", name, "time", "s", taken)
    change = (min(seconds["sticks"]) - min(seconds["slides"])) / found["sticks"]
    record.keep("sticking", "sticks", "time of a change", "s", change)
    rows = [["a change", f"{1e3 * change:.3g}", f"{scatter(seconds['sticks']):.2f}"]]
    for name in list(calls)[2:]:
        taken = seconds[name]
        rows.append([f"{COUNT} starts {name}", f"{1e3 * min(taken):.3g}", f"{scatter(taken):.2f}"])
    title = f"Stick and slip: {found['sticks']} changes in {DURATION:.0f} s, {found['one by one']} in {COUNT} starts"
    record.show(title, ("", "fastest ms", "median/fastest"), rows)
    for wanted, reached, most in (
        ("a change between stick and slip", change, MOST_A_CHANGE),
        (f"{COUNT} starts one by one", min(seconds["one by one"]), MOST_SIXTY),
    ):
        aim = f"{wanted}: {1e3 * most:.3g} ms"
        record.aim("sticking", aim, f"{1e3 * reached:.3g} ms", reached <= most, f"by {reached / most:.2g} times")


def block(speed: float) -> Model:
    """The block on a belt of a speed (m/s)."""
    return block_on_belt(ExponentialLaw(1.0, 0.5, 2.0), damping=0.1, belt_speed=speed)


def steady(speed: float) -> np.ndarray:
    """Where it slides steadily (m)."""
    return np.array([0.5 + 0.5 * np.exp(-2 * speed)])


def follow(model: Model, speed: float, start: np.ndarray) -> int:
    """How often it changes between stick and slip."""
    chunks = integrate(model, steady(speed), start[:1], start[1:], **HOW)
    return sum(len(chunk.changes) for chunk in chunks)


def together(models: list[Model], speeds: np.ndarray, starts: np.ndarray, threads: int) -> None:
    """All of them at once."""
    origins = np.array([steady(speed) for speed in speeds])
    for batch in integrate_many(models, origins, starts[:, :1], starts[:, 1:], **HOW, threads=threads):
        assert batch.reached.all()
