"""From Enter to the answer: whole processes, in units of what it takes to load the packages that they are built on.

All take turns, so that a noisy machine slows them alike; of each the fastest round counts, with the slowest beside it.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from .record import Record
from .scenes import SCENARIOS

ROUNDS, COLD_ROUNDS = 5, 2
UNIT = "import jax, diffrax, xarray, h5netcdf, matplotlib.pyplot; jax.numpy.zeros(1)+1"
SCENE = str(SCENARIOS / "nominal.toml")
SHOWN = 0.5  # s, by when something is to be on the screen


class Start(NamedTuple):
    """A command, and how many units it may take."""

    arguments: tuple[str, ...]
    wanted: float

    @property
    def name(self) -> str:
        """The command's."""
        return self.arguments[0]


WARM = (
    Start(("stability", SCENE), 0.8),
    Start(("check", SCENE), 1.0),
    Start(("run", SCENE, "-o", "run", "--overwrite"), 2.2),
    Start(("export", "run", "--to", "csv", "--overwrite"), 1.2),
    Start(("compare", "run", "run.wav", "-o", "compared", "--overwrite"), 1.2),
    Start(("report", "run", "--overwrite"), 1.2),
)
COLD = Start(("run", SCENE, "-o", "cold", "--overwrite"), 4.0)


def measure(record: Record, folder: Path) -> None:
    """Every command with its programs in the cache, a run without, and the first word on a terminal."""
    del folder
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch)
        for arguments in (WARM[2].arguments, ("export", "run", "--to", "wav", "-o", "run.wav")):
            seconds_of(place, arguments)
        for start in WARM:  # which compiles
            seconds_of(place, start.arguments)
        rows = _rounds(record, place, "warm", WARM, ROUNDS)
        rows += _rounds(record, place, "cold", (COLD,), COLD_ROUNDS)
        record.show("From Enter to the answer, in units", ("", "fastest", "slowest", "wanted"), rows)
        _first_word(record, place)


def _rounds(record: Record, place: Path, kind: str, starts: tuple[Start, ...], rounds: int) -> list[list[str]]:
    units, times = [], {start: [] for start in starts}
    for _ in range(rounds):
        units.append(seconds_of(place, ()))
        for start in starts:
            if kind == "cold":
                shutil.rmtree(place / "cache", ignore_errors=True)
            times[start].append(seconds_of(place, start.arguments))
    unit, rows = min(units), []
    record.keep("start", "loading the packages", "time", "s", units, kind)
    record.say(f"start, {kind}: a unit takes {unit:.3g} s, up to {max(units) / unit:.2f} times as long in other rounds")
    for start, seconds in times.items():
        record.keep("start", f"drumsqueal {start.name}", "time", "s", seconds, kind)
        found, most = min(seconds) / unit, max(seconds) / unit
        rows.append([f"{kind} {start.name}", f"{found:.2f}", f"{most:.2f}", f"{start.wanted:g}"])
        wanted = f"{kind} {start.name}: {start.wanted:g} units"
        missed = f"by {100 * (found / start.wanted - 1):.0f} %"
        record.aim("start", wanted, f"{found:.2f} units", found <= start.wanted, missed)
    return rows


def seconds_of(place: Path, arguments: tuple[str, ...]) -> float:
    """What a command takes, or without arguments what a unit does."""
    command = [sys.executable, "-m", "drumsqueal", *arguments] if arguments else [sys.executable, "-c", UNIT]
    before = time.perf_counter()
    subprocess.run(command, env=_environment(place), cwd=place, check=True, capture_output=True)
    return time.perf_counter() - before


def _environment(place: Path) -> dict[str, str]:
    return {**os.environ, "XDG_CACHE_HOME": str(place / "cache")}


def _first_word(record: Record, place: Path) -> None:
    """How long a terminal stays empty."""
    if os.name != "posix":
        return
    import pty

    for arguments in (("--help",), *(start.arguments for start in WARM)):
        times = []
        for _ in range(ROUNDS):
            leader, follower = pty.openpty()
            command = [sys.executable, "-m", "drumsqueal", *arguments]
            environment = _environment(place) | {"TERM": "xterm"}
            before = time.perf_counter()
            with subprocess.Popen(command, stdout=follower, stderr=follower, env=environment, cwd=place) as process:
                os.close(follower)
                os.read(leader, 1)
                times.append(time.perf_counter() - before)
                process.kill()
            os.close(leader)
        record.keep("start", f"drumsqueal {arguments[0]}", "first word on a terminal", "s", times)
        reached = f"{min(times):.2f} s, up to {max(times):.2f} s"
        missed = f"by {min(times) - SHOWN:.2f} s"
        record.aim("start", f"{arguments[0]}: first word in {SHOWN:g} s", reached, min(times) <= SHOWN, missed)
