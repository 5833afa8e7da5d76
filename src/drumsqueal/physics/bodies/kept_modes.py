"""Modes that were once found, in the user's cache folder, by all that they depend on."""

import hashlib
import io
from collections.abc import Callable, Iterable
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol, Self, TypeVar

import numpy as np

from drumsqueal.compilation import cache_folder, is_private
from drumsqueal.kept_files import keep, load_kept

MOST_BYTES = 64 * 2**20
PACKAGES = ("scikit-fem", "scipy", "numpy")

folder: Path | None = cache_folder() / "free-modes"
"""Where they are kept; None for nowhere."""


class Keepable(Protocol):
    """What is made of named arrays."""

    @classmethod
    def of_arrays(cls, arrays: Any) -> Self:
        """From the arrays by name, as `vars` of it gives them."""
        ...


Modes = TypeVar("Modes", bound=Keepable)


def kept(kind: type[Modes], sources: Iterable[str], told: Iterable[float], find: Callable[[], Modes]) -> Modes:
    """The modes that were found from the same numbers by the same sources, files beside this one; else those found."""
    path = _kept_at(sources, told)
    found = None if path is None else _unpacked(kind, load_kept(path))
    if found is not None:
        return found
    found = find()
    if path is not None:
        stream = io.BytesIO()
        np.savez(stream, **vars(found))
        keep(path, stream.getvalue(), MOST_BYTES)
    return found


def _kept_at(sources: Iterable[str], told: Iterable[float]) -> Path | None:
    if folder is None or not is_private(folder):
        return None
    digest = hashlib.sha256()
    for name in sources:
        digest.update(Path(__file__).with_name(name).read_bytes())
    digest.update("\n".join([*(float(number).hex() for number in told), *map(version, PACKAGES)]).encode())
    return folder / digest.hexdigest()


def _unpacked(kind: type[Modes], content: bytes | None) -> Modes | None:
    if content is None:
        return None
    with suppress(Exception), np.load(io.BytesIO(content), allow_pickle=False) as file:
        return kind.of_arrays(file)
    return None
