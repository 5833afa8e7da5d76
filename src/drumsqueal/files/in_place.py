"""A NetCDF-4 file of full size from the start, filled in place: whole and readable wherever the program ends.

What is written later changes neither the size of the file nor where anything lies in it, and of its structure only some
attributes of fixed length, which HDF5 writes in one piece: a program may be killed at any moment.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import h5netcdf
import h5py
import numpy as np

from drumsqueal.ordinary import NotOrdinaryError, open_ordinary

if TYPE_CHECKING:
    import xarray

Columns = Mapping[str, np.ndarray]
"""Values of variables in some rows, by name."""
STRUCTURE = 64 * 2**10  # bytes; more than twice what HDF5 has been seen to take beside data and attributes
BLOCK = 2**16  # rows at a time, where many are written: half a MB of one number a row


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


def find_places(path: Path, wanted: Mapping[str, tuple[tuple[int, ...], np.dtype]]) -> dict[str, int]:
    """Where in a file (bytes) the variables of these shapes and types begin.

    Raises ValueError where it has others, or one that does not lie in this very file in one piece: a link, or what is
    stored elsewhere, could lead what is written out of the folder.
    """
    places = {}
    with opened(path, "r") as file:
        for name, (shape, kind) in wanted.items():
            found = variable(file, name)
            places[name] = found.id.get_offset()
            own = isinstance(file.get(name, getlink=True), h5py.HardLink) and places[name] is not None
            if not own or found.shape != shape or (kind.kind in "iuf" and found.dtype != kind):
                raise ValueError(name)
    return places


def variables_in(template: "xarray.Dataset", sizes: Mapping[str, int]) -> dict[str, tuple[tuple[int, ...], np.dtype]]:
    """Shapes and types of the variables of a template, some of whose dimensions have other sizes."""
    along = {str(name): size for name, size in template.sizes.items()} | dict(sizes)
    return {
        str(name): (tuple(along[str(each)] for each in values.dims), values.dtype)
        for name, values in template.variables.items()
    }


def lay_out(
    path: Path,
    template: "xarray.Dataset",
    rows: int,
    blank: Callable[[int, int], Columns],
    changing: Columns,
    *,
    sizes: Mapping[str, int] | None = None,
    what: str = "file",
) -> dict[str, int]:
    """Create a file like a template that takes all its room on the disk; where in it (bytes) the variables begin.

    `blank` makes what stands in the rows of the variables that are to be filled; `changing` are attributes that will
    change, in as many bytes; `sizes` are those of dimensions that are not the template's. Raises OSError, with the size
    that the file, called `what`, would have, and what `blank` raises, which is called for each block of rows.
    """
    filled = blank(0, 1)
    others = sum(values.nbytes for name, values in template.variables.items() if name not in filled)
    structure = STRUCTURE + others + sum(len(str(text)) for text in template.attrs.values())
    size = structure + rows * sum(values.nbytes for values in filled.values())
    try:
        path.unlink(missing_ok=True)  # a link would be followed
        # HDF5 itself does not survive a disk that is full: there is room for what it writes before it writes.
        with path.open("wb") as file:
            file.write(bytes(structure))
            file.truncate(size)
        _create(path, template, filled, changing, sizes or {})
        wanted = variables_in(template, sizes or {})
        places = find_places(path, {name: wanted[name] for name in filled})
        for first, stop in blocks(rows):
            fill(path, places, first, blank(first, stop))
    except OSError as error:
        message = f"{error.strerror or error}; the whole {what} takes {size / 1e6:.3g} MB"
        raise OSError(error.errno or 0, message) from None
    return places


def _create(
    path: Path, template: "xarray.Dataset", filled: Columns, changing: Columns, sizes: Mapping[str, int]
) -> None:
    """Create the structure of a file; each variable that is filled has its place, but nothing in it."""
    at_once = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    at_once.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    at_once.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    beside = " ".join(str(name) for name in template.coords if name not in template.dims)  # by the CF conventions
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {str(name): size for name, size in template.sizes.items()} | dict(sizes)
        for name in (*template.coords, *template.data_vars):
            values = template.variables[name]
            if name in filled:
                lost = {"fillvalue": np.nan} if values.dtype.kind == "f" else {}
                made = file.create_variable(name, values.dims, values.dtype, dcpl=at_once, **lost)
            elif values.dtype.kind in "iuf":
                made = file.create_variable(name, values.dims, values.dtype, data=values.values)
            else:
                made = file.create_variable(name, values.dims, h5py.string_dtype(), data=values.values.astype("O"))
            made.attrs.update(values.attrs | ({"coordinates": beside} if beside and name in filled else {}))
        file.attrs.update({name: value for name, value in template.attrs.items() if name not in changing})
    with opened(path) as file:
        # What will be changed lies together at the end, beyond the texts.
        for name, value in changing.items():
            file.attrs.create(name, value, dtype=value.dtype)


def blocks(rows: int) -> Iterator[tuple[int, int]]:
    """The first row, and the one after the last, of blocks that are small in memory."""
    return ((first, min(first + BLOCK, rows)) for first in range(0, rows, BLOCK))


def fill(path: Path, places: Mapping[str, int], first: int, columns: Columns) -> None:
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
