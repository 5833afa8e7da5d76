"""What makes a start quick: the cache of compiled programs, and what is not loaded."""

import functools
import hashlib
import logging
import os
import platform
import stat
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import platformdirs

from drumsqueal.errors import RequestError

try:
    import resource
except ImportError:  # not POSIX
    resource = None

# Compiled programs belong to one kind of processor: a home folder that two machines share holds one set for each. With
# that settled, XLA's complaint at every cached program, which compares tuning hints that no processor reports, says
# nothing; it is an error message of the C++ side, so only its level can silence it.
QUIET = {"TF_CPP_MIN_LOG_LEVEL": "3"}


def prepare_environment() -> None:
    """Set what JAX reads when it is imported; call this before that. The user's settings go first.

    A cache that cannot be read or written, of programs or of matplotlib's fonts, costs the time to fill it anew, and is
    not worth a warning.
    """
    warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation cache entry", UserWarning)
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    cache = {
        "JAX_COMPILATION_CACHE_DIR": str(cache_folder()),
        # The programs of a scene are many and small; by default only those that took a second to compile are kept.
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
        "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
    }
    for name, value in (QUIET | cache).items():
        os.environ.setdefault(name, value)


def cache_folder() -> Path:
    """Where compiled programs for this kind of processor are kept."""
    return Path(platformdirs.user_cache_dir("drumsqueal", appauthor=False)) / _processor()


def programs_folder() -> Path:
    """Where executables are kept."""
    return cache_folder() / "programs"


def is_private(folder: Path) -> bool:
    """Whether there is, or can be, such a folder of the user's own, in which the user and nobody else may write."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return False
    if not (stat.S_ISDIR(found.st_mode) and os.access(folder, os.W_OK | os.X_OK)):
        return False
    return os.name != "posix" or (found.st_uid == os.geteuid() and not found.st_mode & 0o022)


def note_unkept_programs() -> None:
    """Say on standard error where a start will take long, for nothing can be kept for it."""
    folder = programs_folder()
    if not is_private(folder):
        why = "every start compiles its programs anew; they are kept only where you, and nobody else, may write"
        sys.stderr.write(f"drumsqueal: no folder of your own at {folder}: {why}\n")


def cores() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def check_address_space() -> None:
    """Raise RequestError where a limit (`ulimit -v`) leaves less than compiling takes, which JAX does not survive."""
    # Bytes of address space in which the nominal scene compiles and runs: on two cores 2.6 GB were enough, and 2.3 GB
    # were not. Every thread of a further core reserves a stack and a heap.
    least_addresses, addresses_a_core = 2_100_000_000, 200_000_000
    if resource is None:
        return
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    needed = least_addresses + addresses_a_core * cores()
    if limit != resource.RLIM_INFINITY and limit < needed:
        text = f"the address space is limited to {limit / 1e9:.3g} GB, and computing here takes {needed / 1e9:.3g} GB"
        raise RequestError(f"{text} (most of it is never touched); raise the limit, as in ulimit -v unlimited")


@functools.cache
def _processor() -> str:
    """A short name for the kind of processor: the architecture and a digest of its abilities."""
    information = Path("/proc/cpuinfo")
    lines = information.read_text(encoding="utf-8", errors="replace").splitlines() if information.exists() else []
    described = next((line for line in lines if line.startswith(("flags", "Features"))), None)
    if described is None:
        described = platform.processor()  # which asks another program
    return f"{platform.machine()}-{hashlib.sha256(described.encode()).hexdigest()[:12]}"


@contextmanager
def hidden_from_xarray() -> Iterator[None]:
    """Without what xarray loads, in half a second, to ask whether an array is one of theirs; here none is.

    Within the block they cannot be imported, unless they were before.
    """
    looked_for = "xarray" in sys.modules
    absent = [] if looked_for else [name for name in ("dask", "pint") if name not in sys.modules]
    sys.modules.update(dict.fromkeys(absent))  # pyright: ignore[reportArgumentType, reportCallIssue]
    try:
        yield
    finally:
        for name in absent:
            if sys.modules.get(name) is None:
                sys.modules.pop(name, None)


# Files of what took long to find, in the user's cache folder: written whole or not at all, and checked when read.


def load_kept(path: Path) -> bytes | None:
    """The content of a file; None where there is none or where it is damaged or another one's, and then removed."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    if not content.startswith(_digest(path, content[32:])):
        forget(path)
        return None
    with suppress(OSError):
        os.utime(path)  # so that it is not what goes first
    return content[32:]


def keep(path: Path, content: bytes, most: int) -> None:
    """Write a file whole or not at all, and remove the oldest of its folder beyond `most` bytes.

    A full disk keeps nothing.
    """
    with suppress(OSError):
        number, part = tempfile.mkstemp(dir=path.parent)
        try:
            with os.fdopen(number, "wb") as file:
                file.write(_digest(path, content) + content)
            Path(part).replace(path)
        except BaseException:
            Path(part).unlink(missing_ok=True)
            raise
        files = sorted(((each.stat(), each) for each in path.parent.iterdir()), key=lambda each: -each[0].st_mtime)
        total = 0
        for found, each in files:
            total += found.st_size
            if total > most:
                each.unlink()


def forget(path: Path) -> None:
    """Remove a file, where that can be done."""
    with suppress(OSError):
        path.unlink()


def _digest(path: Path, content: bytes) -> bytes:
    return hashlib.sha256(path.name.encode() + content).digest()
