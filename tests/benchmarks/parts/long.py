"""Time and memory over the length of a transient, whose chunks are thrown away; each length in a fresh process."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

from .record import Record

CHILD = Path(__file__).with_name("long_child.py")
DURATIONS = (0.1, 0.3, 1.0, 3.0, 10.0)
ROUNDS = 2
# The damped scene is periodic after a second; what a second costs then may differ by the noise of the machine.
NOISE, MEMORY_NOISE = 0.15, 0.02


def measure(record: Record, folder: Path) -> None:
    """Measure, print and judge."""
    del folder
    seconds: dict[float, list[float]] = {duration: [] for duration in DURATIONS}
    memory: dict[float, list[float]] = {duration: [] for duration in DURATIONS}
    growth: dict[float, list[float]] = {duration: [] for duration in DURATIONS}
    with tempfile.TemporaryDirectory() as cache:
        _run(DURATIONS[0], cache)  # compiles, which would be the peak of memory in all of them
        for _ in range(ROUNDS):
            for duration in DURATIONS:
                found = _run(duration, cache)
                seconds[duration].append(found["seconds"])
                memory[duration].append(found["peak_MiB"])
                growth[duration].append(found["grown_MiB"])
    rows = []
    for duration in DURATIONS:
        setting, taken = f"{duration:g} s", median(seconds[duration])
        record.keep("long", "drumsqueal", "time", "s", seconds[duration], setting)
        record.keep("long", "drumsqueal", "peak memory", "MiB", memory[duration], setting)
        record.keep("long", "drumsqueal", "memory grown since the first chunk", "MiB", growth[duration], setting)
        sizes = f"{median(memory[duration]):.1f}", f"{median(growth[duration]):+.1f}"
        rows.append([setting, f"{taken:.3g}", f"{taken / duration:.3g}", *sizes])
    headings = ("duration", "time s", "per simulated s", "peak memory MiB", "since the first chunk")
    record.show("Damped scene in chunks that are thrown away", headings, rows)
    judge(record, {d: median(seconds[d]) for d in DURATIONS}, {d: median(memory[d]) for d in DURATIONS})


def judge(record: Record, seconds: dict[float, float], memory: dict[float, float]) -> None:
    """What a further second costs late against early, and the memory of 10 s against that of 1 s."""
    early, late = (seconds[3.0] - seconds[1.0]) / 2, (seconds[10.0] - seconds[3.0]) / 7
    change = late / early - 1
    record.aim(
        "long",
        "linear cost: a second from 3 to 10 s costs what one from 1 to 3 s does",
        f"{late:.3g} s against {early:.3g} s, {change:+.0%}",
        change <= NOISE,
        f"by {change - NOISE:.0%}",
    )
    more = memory[10.0] / memory[1.0] - 1
    record.aim(
        "long",
        "flat memory: 10 s peak no higher than 1 s",
        f"{memory[10.0]:.0f} MiB against {memory[1.0]:.0f} MiB, {more:+.1%}",
        more <= MEMORY_NOISE,
        f"by {more - MEMORY_NOISE:.0%}",
    )


def _run(duration: float, cache: str) -> dict[str, float]:
    environment = {**os.environ, "JAX_COMPILATION_CACHE_DIR": cache}
    command = [sys.executable, str(CHILD), str(duration)]
    done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    return json.loads(done.stdout)
