"""The program in a process of its own, for what cannot be done to the one that tests."""

import os
import subprocess
import sys
import time
from pathlib import Path

import jax
import pytest

MAIN = "from drumsqueal.__main__ import main; main()"
posix = pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals and limits, and the XDG cache folder")


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


def wait_for(path: Path, *, gone: bool = False) -> None:
    """Until there is such a file or folder, or until it is gone, or for two minutes."""
    deadline = time.monotonic() + 120
    while path.exists() == gone and time.monotonic() < deadline:
        time.sleep(0.02)
