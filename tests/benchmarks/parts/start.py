"""The command line from a fresh cache folder: what the first start takes, and what the second one spares."""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from .record import Record
from .scenes import SCENARIOS

DURATION = 0.1
# What JAX says of every program that it needs, and of every one of these that it finds in the cache.
NEEDED, FOUND = "Finished XLA compilation of", "Persistent compilation cache hit for"


def measure(record: Record, folder: Path) -> None:
    """Start twice, and a third time with JAX's log of what it compiled."""
    del folder
    with tempfile.TemporaryDirectory() as scratch:
        cache = Path(scratch) / "cache"
        cache.mkdir()
        first, _ = _run(scratch, cache)
        programs = _programs(cache)
        second, _ = _run(scratch, cache)
        new = _programs(cache) - programs
        # The log costs time, and so is asked for in a start that is not timed.
        _, log = _run(scratch, cache, JAX_LOG_COMPILES="1", JAX_LOGGING_LEVEL="DEBUG")
    needed, found = log.count(NEEDED), log.count(FOUND)
    for name, value, unit in (
        ("first start", first, "s"),
        ("second start", second, "s"),
        ("programs in the cache after the first start", len(programs), "1"),
        ("programs added by the second start", len(new), "1"),
        ("programs that a third start needs", needed, "1"),
        ("of these found in the cache", found, "1"),
    ):
        record.keep("start", "drumsqueal run", name, unit, value, f"{DURATION:g} s")
    record.say(
        f"start: drumsqueal run on {DURATION:g} s of the nominal scene takes {first:.3g} s with an empty cache and "
        f"{second:.3g} s with the {len(programs)} programs that it then holds"
    )
    # A log that names no program would be one that says nothing.
    free = not new and needed == found > 0
    reached = f"{len(new)} programs added, {needed - found} of {needed} compiled; {first:.3g} s, then {second:.3g} s"
    missed = f"by {max(needed - found, len(new))} programs" if needed else "for JAX's log names none"
    record.aim("start", "a second start compiles nothing", reached, free, missed)


def _programs(cache: Path) -> set[str]:
    """Files of programs; JAX notes beside them when each was last used."""
    return {file.name for file in cache.rglob("*") if file.is_file() and not file.name.endswith("-atime")}


def _run(scratch: str, cache: Path, **settings: str) -> tuple[float, str]:
    """Seconds of one start, and what it wrote to its standard error."""
    environment = {**os.environ, "JAX_COMPILATION_CACHE_DIR": str(cache), **settings}
    command = [sys.executable, "-m", "drumsqueal", "run", str(SCENARIOS / "nominal.toml")]
    command += ["--set", f"simulate.duration={DURATION}", "-o", str(Path(scratch) / "out"), "--overwrite"]
    before = time.perf_counter()
    done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    return time.perf_counter() - before, done.stderr
