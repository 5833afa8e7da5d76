"""What a whole brake costs, by its coordinates and by the points of its linings: evaluations, memory, programs, a run.

The shipped simplex brake, two shoes that bend on a drum that bends, with modes up to several frequencies and with more
cells in its linings, each size in a fresh process. Peak memory is that of the process, compiling included.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from .pictures import draw_brake
from .record import Record
from .scenes import SCENARIOS
from .start import seconds_of

SHIPPED = 10e3  # Hz, up to which the shipped scene keeps modes
UP_TO = (3e3, 6e3, SHIPPED, 16e3, 26e3)  # Hz
CELLS = ((1, 1), (2, 1), (2, 2), (4, 2), (7, 2))  # times those along and across each lining
MOTIONS = {"steady": "next to steady sliding", "beyond": "beyond the boundaries"}
RUN_IN = 600.0  # s, as asked for


def measure(record: Record, folder: Path) -> None:
    """Measure, print, draw and judge."""
    by_coordinates = [_one(record, up_to, (1, 1)) for up_to in UP_TO]
    shipped = by_coordinates[UP_TO.index(SHIPPED)]
    by_points = [shipped, *(_one(record, SHIPPED, cells) for cells in CELLS[1:])]
    rows = [_row(each) for each in (*by_coordinates, *by_points[1:])]
    headings = "coordinates", "points", "µs steady", "µs beyond", "median over it", "compiling s", "peak memory GiB"
    record.show("A whole brake, by its coordinates and by the points of its linings", headings, rows)
    draw_brake(by_coordinates, by_points, folder / "speed_brake.png")
    with tempfile.TemporaryDirectory() as scratch:
        arguments = "run", str(SCENARIOS / "simplex.toml"), "-o", "run"
        seconds = seconds_of(Path(scratch), arguments)
    size = f"{shipped['coordinates']} coordinates, {shipped['points']} points"
    record.keep("brake", f"drumsqueal run, cold, {size}", "time", "s", seconds)
    wanted = f"whole brake, {size}: 0.1 s with everything, cold, in {RUN_IN:g} s"
    record.aim("brake", wanted, f"{seconds:.0f} s", seconds <= RUN_IN, f"by {seconds - RUN_IN:.0f} s")


def _one(record: Record, up_to: float, cells: tuple[int, int]) -> dict[str, Any]:
    """Measure one size in a process of its own."""
    command = [sys.executable, "-m", "parts.brake_child", f"{up_to}", *map(str, cells)]
    with tempfile.TemporaryDirectory() as cache:
        found = subprocess.run(
            command,
            cwd=Path(__file__).parents[1],
            env=os.environ | {"XDG_CACHE_HOME": cache},
            check=True,
            capture_output=True,
            text=True,
        )
    one = json.loads(found.stdout)
    name = f"{one['coordinates']} coordinates, {one['points']} points"
    for motion, seconds in one["evaluation_s"].items():
        record.keep("brake", name, f"time of an evaluation, {MOTIONS[motion]}", "s", seconds)
    record.keep("brake", name, "compiling the transient", "s", one["compiling_s"])
    record.keep("brake", name, "peak memory", "MiB", one["peak_MiB"])
    return one


def _row(one: dict[str, Any]) -> list[str]:
    steady, beyond = (sorted(one["evaluation_s"][motion]) for motion in MOTIONS)
    scatter = beyond[len(beyond) // 2] / beyond[0]
    times = f"{1e6 * steady[0]:.3g}", f"{1e6 * beyond[0]:.3g}", f"{scatter:.2f}", f"{one['compiling_s']:.0f}"
    return [f"{one['coordinates']}", f"{one['points']}", *times, f"{one['peak_MiB'] / 1024:.2f}"]
