"""Claims: of two commands that would write into one folder, or one file, at once, the second is refused.

A claim is a lock of the operating system on a hidden file next to what is claimed. It ends with the process, however
that ends, so that no claim outlives its command; the hidden file is removed by the last command that has it.
"""

import errno
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from stat import S_ISREG
from typing import NamedTuple

from drumsqueal.errors import RequestError
from drumsqueal.scene.quantities import printable

try:
    import fcntl
except ImportError:  # not POSIX
    fcntl = None

LOCK = ".drumsqueal.lock"
_TRIES = 100
_MADE = "made "


class _Claim(NamedTuple):
    """The lock file, its descriptor, whether nobody else has it, and the folders that were made for it."""

    lock: Path
    descriptor: int
    alone: bool
    made: list[Path]


_held: dict[Path, _Claim] = {}


@contextmanager
def claims_released() -> Iterator[None]:
    """Give up what is claimed within the block after it; folders that were made for a claim and are empty go again."""
    try:
        yield
    finally:
        while _held:
            _release(_held.pop(next(reversed(_held))))


def claim_folder(folder: Path) -> str:
    """Claim a folder to write into it, and make it where it is not there; return a remark where no lock is possible.

    Raises RequestError where another command has it, OSError where it cannot be written.
    """
    missing = [part for part in (folder, *folder.parents) if not part.exists()]
    for _ in range(_TRIES):
        folder.mkdir(parents=True, exist_ok=True)
        # Removed meanwhile, by a command that was refused: it is made again.
        with suppress(FileNotFoundError):
            return _claim(folder / LOCK, folder, "choose another folder with -o", alone=True, made=missing)
    raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(folder))


def claim_file(path: Path, option: str = "-o") -> str:
    """Claim a file to write it, in a folder that is there; files next to it may be written at the same time.

    Returns and raises as `claim_folder` does.
    """
    advice = f"name another file with {option}"
    remark = _claim(path.parent / LOCK, path.parent, advice, alone=False)
    return _claim(path.with_name(f".{path.name}.lock"), path, advice, alone=True) or remark


def claim_results(folder: Path) -> None:
    """Hold back commands that would write into a folder while its results are read.

    Raises RequestError where one is at it. In a folder in which nothing can be written, nobody is held back.
    """
    with suppress(OSError):
        _claim(folder / LOCK, folder, "read a copy of the folder", alone=False, create=os.access(folder, os.W_OK))


def _claim(
    lock: Path, what: Path, advice: str, *, alone: bool, create: bool = True, made: list[Path] | None = None
) -> str:
    lock = lock.parent.resolve() / lock.name
    if lock in _held and (_held[lock].alone or not alone):  # by this very command
        return ""
    if fcntl is None:
        return f"{what}: there are no file locks here; make sure that no other command writes there"
    was_there = lock.exists()
    try:
        claim = _Claim(lock, _locked(lock, alone=alone, create=create), alone, made or [])
    except BlockingIOError:
        _hand_over(lock, made or [])
        raise RequestError(f"{what} is in use by {_holder(lock)}; wait until it has ended, or {advice}") from None
    except OSError as error:
        if error.errno not in (errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS):
            raise
        if not was_there:
            with suppress(OSError):
                lock.unlink()
        return f"{what}: its file system has no file locks; make sure that no other command writes there"
    _held[lock] = claim
    _note(claim.descriptor, f"drumsqueal {command_name()}, process {os.getpid()}")
    return ""


def command_name() -> str:
    """The command that this process was started with, "" where that is none."""
    return next((each for each in sys.argv[1:] if not each.startswith("-")), "")


def _locked(lock: Path, *, alone: bool, create: bool) -> int:
    """A descriptor of the lock file, locked. Raises BlockingIOError where another process has it, and OSError."""
    shared_tries, wait = 5, 0.01  # s; who gives up a share has the lock alone for as long as it takes to remove it
    assert fcntl is not None
    tries = 1 if alone else shared_tries
    while True:
        descriptor = _opened(lock, create=create)
        try:
            if not S_ISREG(os.fstat(descriptor).st_mode):
                raise RequestError(f"{lock} is not an ordinary file; remove it")
            try:
                fcntl.flock(descriptor, (fcntl.LOCK_EX if alone else fcntl.LOCK_SH) | fcntl.LOCK_NB)
            except BlockingIOError:
                tries -= 1
                if not tries:
                    raise
                time.sleep(wait)
            else:
                if _is_at(lock, descriptor):
                    return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)  # of a file that its last holder has removed meanwhile


def _opened(lock: Path, *, create: bool) -> int:
    flags = os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_APPEND  # neither a link nor a pipe leads anywhere
    try:
        return os.open(lock, flags | os.O_RDWR | (os.O_CREAT if create else 0), 0o666)
    except PermissionError as error:  # left by somebody else; to read is enough for a lock
        try:
            return os.open(lock, flags | os.O_RDONLY)
        except FileNotFoundError:  # nor may one be made
            raise error from None


def _is_at(path: Path, descriptor: int) -> bool:
    with suppress(FileNotFoundError):
        return os.path.samestat(path.lstat(), os.fstat(descriptor))
    return False


def _note(descriptor: int, line: str) -> None:
    with suppress(OSError):
        os.write(descriptor, f"{line}\n".encode())


def _notes(descriptor: int) -> list[str]:
    # 4096 of the notes in a lock file: who has it, and how many folders others have made for it
    return [printable(line) for line in os.pread(descriptor, 4096, 0).decode(errors="replace").splitlines()]


def _holder(lock: Path) -> str:
    """Who has a lock file, as it says itself."""
    lines: list[str] = []
    with suppress(OSError):
        descriptor = _opened(lock, create=False)
        lines = [line for line in _notes(descriptor) if not line.startswith(_MADE)]
        os.close(descriptor)
    return lines[-1] if lines else "another command"


def _hand_over(lock: Path, made: list[Path]) -> None:
    """Leave it to who has the lock to remove folders that were made for a claim that it got ahead of.

    The holder looks for such notes when it has removed the lock file, so that none is missed.
    """
    count = 1 if made and ".." in made[0].parts else len(made)
    for _ in range(_TRIES if made else 0):
        with suppress(OSError):
            descriptor = _opened(lock, create=False)
            _note(descriptor, f"{_MADE}{count}")
            there = _is_at(lock, descriptor)
            os.close(descriptor)
            if there:
                return
        if _remove(made):
            return


def _release(claim: _Claim) -> None:
    assert fcntl is not None
    noted: list[str] = []
    with suppress(OSError):
        fcntl.flock(claim.descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)  # fails where others have a share in it
        if _is_at(claim.lock, claim.descriptor):
            claim.lock.unlink()
        noted = [line.removeprefix(_MADE) for line in _notes(claim.descriptor) if line.startswith(_MADE)]
    os.close(claim.descriptor)
    count = max((int(number) for number in noted if number.isdecimal()), default=0)
    _remove(claim.made)
    _remove(list(claim.lock.parents)[:count])


def _remove(folders: list[Path]) -> bool:
    """Remove folders, the innermost first, as far as they are empty; whether the first of them is gone."""
    for folder in folders:
        try:
            folder.rmdir()
        except FileNotFoundError:
            continue
        except OSError:  # there is something in it
            break
    return not folders or not folders[0].exists()
