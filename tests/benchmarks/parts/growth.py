"""How time grows: with the number of trajectories, and from the plane into space.

The starts are seeded states of the size of the growth phase and of the saturated motion, out of the plane a tenth of
it. Times are those of one trajectory and one simulated millisecond, so that a level line is linear growth. A call of
`integrate_many` takes some milliseconds whatever it holds, and a single trajectory has but one thread.
"""

import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median

import numpy as np

from drumsqueal.physics.bodies.rigid_shoe import IN_PLANE
from drumsqueal.physics.model import build_model
from drumsqueal.scene import COORDINATES, load_scene
from drumsqueal.solve.transient.integrate import integrate_many

from .pictures import draw_growth
from .record import Record
from .scenes import FREQUENCY, SCENARIOS, SHAPE, SIZES

COUNTS = (1, 4, 16, 64, 256, 1024, 4096)
DURATION, SAMPLE_RATE, TOLERANCE = 5e-3, 50e3, 1e-6
ROUNDS, PATIENCE = 3, 2.0  # s; what takes longer is not repeated
SPACE = COORDINATES
# Trajectories of the comparison of space with the plane, in one thread: enough to forget what a call takes.
FEW, FEW_IN_SPACE_BEYOND = 32, 8


def measure(record: Record, folder: Path) -> None:
    """Measure, print and draw."""
    threads = os.cpu_count() or 1
    counted = {f"{count} trajectories": several(IN_PLANE, "beyond them", count, threads) for count in COUNTS}
    kinds = [(kept, regime) for regime in SIZES for kept in (IN_PLANE, SPACE)]
    names = [f"{len(kept)} coordinates, {regime}" for kept, regime in kinds]
    fews = [few(*kind) for kind in kinds]
    calls = {name: several(*kind, count, 1) for name, kind, count in zip(names, kinds, fews, strict=True)}
    per_count, per_kind = _per_millisecond(counted, COUNTS), _per_millisecond(calls, fews)
    for name, seconds in (per_count | per_kind).items():
        record.keep("growth", "drumsqueal", "time per simulated ms and trajectory", "s", seconds, name)
    counts = {count: median(seconds) for count, seconds in zip(COUNTS, per_count.values(), strict=True)}
    motions = {name: median(seconds) for name, seconds in per_kind.items()}
    rows = [[f"{count} in the plane, beyond the boundaries", f"{1e6 * each:.4g}"] for count, each in counts.items()]
    rows += [[f"one thread: {name}", f"{1e6 * each:.4g}"] for name, each in motions.items()]
    record.show(f"Time of one trajectory and simulated ms; {threads} threads", ("trajectories", "µs"), rows)
    draw_growth(counts, motions, threads, folder / "speed_growth.png")


def few(kept: tuple[str, ...], regime: str) -> int:
    """How many trajectories of a kind are enough: in space beyond the boundaries one takes a second."""
    return FEW_IN_SPACE_BEYOND if kept == SPACE and regime == "beyond them" else FEW


def several(kept: tuple[str, ...], regime: str, count: int, threads: int) -> Callable[[], object]:
    """A call that integrates that many trajectories, each from a state of its own."""
    model = build_model(load_scene(SCENARIOS / "nominal.toml"), coordinates=kept)
    phase = np.random.default_rng(0).uniform(0, 2 * np.pi, (count, 6))
    q, v = SIZES[regime] * SHAPE * np.sin(phase), SIZES[regime] * SHAPE * FREQUENCY * np.cos(phase)
    picked = [COORDINATES.index(name) for name in kept]
    options = {"duration": DURATION, "sample_rate": SAMPLE_RATE, "tolerance": TOLERANCE, "threads": threads}

    def call() -> object:
        steady = np.zeros((count, len(kept)))
        batches = list(integrate_many([model] * count, steady, q[:, picked], v[:, picked], **options))
        assert all(each.reached.all() for each in batches)
        return batches

    return call


def _per_millisecond(calls: dict[str, Callable[[], object]], counts: Sequence[int]) -> dict[str, list[float]]:
    """Seconds per trajectory and simulated millisecond in each round, in turn; the first round only compiles."""
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    for round_number in range(ROUNDS + 1):
        for (name, call), count in zip(calls.items(), counts, strict=True):
            fraction = count * DURATION * 1e3
            if round_number > 1 and seconds[name][0] * fraction > PATIENCE:
                continue
            before = time.perf_counter()
            call()
            if round_number:
                seconds[name].append((time.perf_counter() - before) / fraction)
    return seconds
