"""The program in a process of its own, for what cannot be done to the one that tests; and how a test waits.

It never waits for a time, but until something holds: a machine may be slow, and busy with other things.
"""

import os
import select
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO

import jax
import pytest

# Without lines that tell a file how far a command has come, which come as the machine is busy.
MAIN = """
from drumsqueal import progress
from drumsqueal.__main__ import main
progress.MOST_SILENT = 1e6
main()
"""
posix = pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals and limits, and the XDG cache folder")
PATIENCE = 600.0  # s; what takes longer hangs, however slow the machine is or however busy
_LOOK = 0.02  # s between two looks
_WATCHED = """
import os, pkgutil, signal, sys, time
from pathlib import Path
owner, count, parent = pkgutil.resolve_name({owner!r}), 0, os.getppid()
function = owner.{name}

def watched(*arguments, **options):
    global count
    result = function(*arguments, **options)
    count += 1
{then}
    return result

owner.{name} = watched
{MAIN}
"""


def start(cache: Path, *arguments: str, code: str = MAIN, folder: Path | None = None) -> subprocess.Popen:
    """Start the program, or other code in its place, in a process and with a cache of its own, from a folder."""
    # Without what JAX has put into the environment of this process when it was imported.
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("JAX_", "EQX_", "TF_"))}
    environment["XDG_CACHE_HOME"] = str(cache)
    # Compiled as in this process: then it computes the same to the last bit.
    quickly = "jax_disable_most_optimizations"
    environment[quickly.upper()] = str(int(jax.config.read(quickly)))
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.Popen(
        command, env=environment, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


# --- what befalls the program at a point of its own, not when the process that tests gets round to it ---------------

PRESS = "signal.raise_signal(signal.SIGINT)"


def watched(owner: str, name: str, then: str) -> str:
    """Code of the program which does something each time it returns from a function; `count` says how often it has.

    The owner of the function is a module, or a class as in "drumsqueal.terminal.reply:Reply".
    """
    return _WATCHED.format(owner=owner, name=name, then=textwrap.indent(then, "    "), MAIN=MAIN)


def killed(owner: str, name: str, *, seconds: float, most: int) -> str:
    """Code of the program that is killed by SIGPROF so many seconds after it first returns from a function.

    They are seconds of its own processor time, as other programs may take up the clock; and they end with the return
    of number `most`, as of a fast processor they may be all that the program needs.
    """
    timer = f"if count == 1: signal.setitimer(signal.ITIMER_PROF, {seconds})"
    return watched(owner, name, f"{timer}\nif count == {most}: signal.raise_signal(signal.SIGPROF)")


def held(there: Path, go: Path) -> str:
    """What has the program make the file `there` and then wait for the file `go`, or for the end of these tests."""
    waiting = f"while os.getppid() == parent and not Path({str(go)!r}).exists(): time.sleep({_LOOK})"
    return f"Path({str(there)!r}).touch()\n{waiting}"


# --- waiting --------------------------------------------------------------------------------------------------------


def wait_until(condition: Callable[[], object], process: subprocess.Popen | None = None) -> None:
    """Wait until something holds, which the process, if it is given, brings about: it fails where that has ended."""
    begun = time.monotonic()
    while True:
        ended = process is not None and process.poll() is not None  # first: it may have been the last thing it did
        if condition():
            return
        if process is not None and ended:
            told = process.stderr.read() if process.stderr else ""
            pytest.fail(f"the process that was to bring it about has ended with status {process.returncode}: {told}")
        if time.monotonic() - begun > PATIENCE:
            pytest.fail(f"it does not come about within {PATIENCE:g} s")
        time.sleep(_LOOK)


def communicate(process: subprocess.Popen) -> tuple[str, str]:
    """What a process prints, and what it tells on standard error, until it has ended; one that hangs is killed."""
    try:
        return process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        pytest.fail(f"the process has not ended after {PATIENCE:g} s, and has told: {process.communicate()}")


def next_line(stream: IO[str] | None) -> str:
    """The next line of a process that goes on when it was read; empty where it has ended instead."""
    assert stream is not None
    if not select.select([stream], [], [], PATIENCE)[0]:
        pytest.fail(f"nothing was written within {PATIENCE:g} s")
    return stream.readline()


def shown_on(leader: int) -> bytes:
    """What is written to a pseudo-terminal, given its leading end, until all of the other ends are closed."""
    shown = b""
    with open(leader, "rb", buffering=0) as terminal:
        while select.select([terminal], [], [], PATIENCE)[0]:
            try:
                part = terminal.read(4096)
            except OSError:  # what Linux has for its end
                return shown
            if not part:
                return shown
            shown += part
    pytest.fail(f"nothing more was written to the terminal within {PATIENCE:g} s, after {shown!r}")
