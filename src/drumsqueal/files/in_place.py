"""A NetCDF-4 file of full size from the start, filled in place: whole and readable wherever the program ends.

What is written later changes neither the size of the file nor where anything lies in it, and of its structure only some
attributes of fixed length, which HDF5 writes in one piece: a program may be killed at any moment.
"""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np

from drumsqueal.ordinary import NotOrdinaryError, open_ordinary


@contextmanager
def opened(path: Path, mode: str = "r+") -> Iterator[h5py.File]:
    """The file as HDF5 sees it; raises OSError, to read it also NotOrdinaryError, as `content_of` does."""
    try:
        if mode == "r":
            with content_of(path) as content, h5py.File(content, mode) as file:
                yield file
        else:
            # Without a lock, so that a look at the file from elsewhere does not stop the run.
            with h5py.File(path, mode, locking=False) as file:
                yield file
    except RuntimeError as error:  # what h5py raises when a disk fails while a file is closed
        raise OSError(str(error)) from None


@contextmanager
def content_of(path: Path) -> Iterator[BinaryIO]:
    """An HDF5 file to be read, all of whose data lie in it.

    Raises NotOrdinaryError for one that leads to other files or claims more data than it can hold, and OSError for what
    HDF5 does not open.
    """
    # 2**36 of a file of results; a thousand seconds of all signals at 192 kHz are 37 GB
    with open_ordinary(path, 2**36) as content:
        size = content.seek(0, 2)
        with h5py.File(content, "r") as file:
            try:
                claimed = sum(map(partial(_own_bytes, file), file))
            except (KeyError, RuntimeError, TypeError, ValueError) as error:  # what h5py raises for one that is damaged
                raise OSError(str(error)) from None
            # 2 times its size: results are not compressed, and only what names a dimension may have no data
            if claimed > 2 * size:
                raise NotOrdinaryError("it claims to hold more data than there can be in it")
        yield content


def _own_bytes(file: h5py.File, name: str) -> int:
    """Bytes of the data of a variable; raises NotOrdinaryError where they are not in this very file."""
    found = file[name] if isinstance(file.get(name, getlink=True), h5py.HardLink) else None
    if not isinstance(found, h5py.Dataset):
        raise NotOrdinaryError(f"{name} in it is a link or a group, of which results have none")
    if found.is_virtual or found.external:
        raise NotOrdinaryError(f"the data of {name} are in another file")
    return found.nbytes


def variable(file: h5py.File, name: str) -> h5py.Dataset:
    """One of its variables."""
    found = file[name]
    assert isinstance(found, h5py.Dataset)  # for the type checker
    return found


def own_variable(file: h5py.File, name: str, shape: tuple[int, ...]) -> h5py.Dataset:
    """One of its variables, of this shape, that lies in this very file in one piece. Raises ValueError if it does not.

    What is a link, or stored elsewhere, could lead what is written out of the folder.
    """
    found = variable(file, name)
    own = isinstance(file.get(name, getlink=True), h5py.HardLink) and found.id.get_offset() is not None
    if not own or found.shape != shape:
        raise ValueError(name)
    return found


def placed() -> h5py.h5p.PropDCID:
    """Properties of a variable that has its place in the file at once, and nothing in it."""
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    properties.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    return properties


def fill(path: Path, places: Mapping[str, int], first: int, columns: Mapping[str, np.ndarray]) -> None:
    """Write rows from number `first` on where the variables lie (bytes).

    Past HDF5, in a fiftieth of the time, and errors of the disk are raised as OSError.
    """
    with path.open("r+b") as file:
        for name, column in columns.items():
            file.seek(places[name] + first * column[:1].nbytes)
            file.write(np.ascontiguousarray(column).tobytes())


def fixed_text(text: str, length: int) -> bytes:
    """A text for an attribute of so many bytes, cut off where it is longer."""
    return text.encode()[:length].decode(errors="ignore").encode()


def as_text(value: Any) -> str:
    """An attribute as text, whatever HDF5 gives for it."""
    return value.decode() if isinstance(value, bytes) else str(value)


def read_texts(path: Path, names: Iterable[str]) -> dict[str, str]:
    """Some attributes of a file. Raises OSError and KeyError."""
    with opened(path, "r") as file:
        return {name: as_text(file.attrs[name]) for name in names}
