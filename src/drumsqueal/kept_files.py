"""Files of what took long to find, in the user's cache folder: written whole or not at all, and checked when read."""

import hashlib
import os
import tempfile
from contextlib import suppress
from pathlib import Path


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
