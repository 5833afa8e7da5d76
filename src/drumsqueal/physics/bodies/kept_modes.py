"""Modes that were once found, and what follows from them, in the cache folder, by all that they depend on."""

import hashlib
import io
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from drumsqueal.compilation import cache_folder, is_private, keep, load_kept

folder: Path | None = cache_folder() / "modes"
"""Where they are kept; None for nowhere."""


def kept(
    sources: Iterable[str], told: Iterable[float | bytes], find: Callable[[], Mapping[str, Any]]
) -> Mapping[str, Any]:
    """Arrays by name, those kept if the same sources, files beside this one, found them from the same numbers."""
    path = kept_at(sources, told)
    arrays = None if path is None else _unpacked(load_kept(path))
    if arrays is not None:
        return arrays
    found = find()
    if path is not None:
        stream = io.BytesIO()
        np.savez(stream, **found)
        keep(path, stream.getvalue(), most=512 * 2**20)
    return found


def kept_at(sources: Iterable[str], told: Iterable[float | bytes]) -> Path | None:
    """The file of a result; None where none is kept."""
    if folder is None or not is_private(folder):
        return None
    digest = hashlib.sha256()
    for name in sources:
        digest.update((Path(__file__).parent / name).read_bytes())
    numbers = (each if isinstance(each, bytes) else float(each).hex().encode() for each in told)
    digest.update(b"\n".join([*numbers, *(version(name).encode() for name in ("scikit-fem", "scipy", "numpy"))]))
    return folder / digest.hexdigest()


def _unpacked(content: bytes | None) -> dict[str, Any] | None:
    if content is None:
        return None
    with suppress(Exception), np.load(io.BytesIO(content), allow_pickle=False) as file:
        return dict(file)
    return None
