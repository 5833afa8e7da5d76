"""Files that may be anybody's: ordinary ones of a sane size are opened, nothing that hangs or never ends; and text."""

import codecs
import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

BYTE_ORDER_MARKS = (codecs.BOM_UTF8, codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


class NotOrdinaryError(OSError):
    """What is in a file's place is not read; `strerror` says why, as of any OSError."""

    def __init__(self, message: str) -> None:
        """Say why."""
        super().__init__(errno.EINVAL, message)


def open_ordinary(path: Path, most: int) -> BinaryIO:
    """Open an ordinary file of at most so many bytes to read it.

    Raises NotOrdinaryError for anything else, IsADirectoryError for a folder, OSError for what cannot be opened, and
    ValueError for a name that is none.
    """
    _check(path.stat(), most)  # before it is opened, which does something to devices
    return path.open("rb")


def read_ordinary(path: Path, most: int) -> bytes:
    """The content of an ordinary file of at most so many bytes. Raises as `open_ordinary` does."""
    with open_ordinary(path, most) as file:
        return file.read()


def decoded(content: bytes) -> str:
    """A text by its byte order mark; without one in UTF-8 or, where it is none, as instruments write: Windows-1252."""
    if content.startswith(BYTE_ORDER_MARKS[1:]):
        return content.decode("utf-16", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def _check(status: os.stat_result, most: int) -> None:
    kinds = {
        stat.S_IFIFO: "a named pipe",
        stat.S_IFSOCK: "a socket",
        stat.S_IFCHR: "a device",
        stat.S_IFBLK: "a device",
    }
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(status.st_mode):
        kind = kinds.get(stat.S_IFMT(status.st_mode), "something else")
        raise NotOrdinaryError(f"this is not an ordinary file, but {kind}")
    if status.st_size > most:
        raise NotOrdinaryError(f"the file of {status.st_size / 2**20:.0f} MB is larger than {most // 2**20} MB")
