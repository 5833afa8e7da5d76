"""Modes that are kept in the user's cache folder, by all that they depend on."""

import hashlib
import io
from collections.abc import Iterable, Mapping
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from drumsqueal.compilation import is_private


def kept_at(folder: Path | None, sources: Iterable[str], told: Iterable[bytes]) -> Path | None:
    """The file of a result, by the sources of this folder and what else it depends on; None where none is kept."""
    if folder is None or not is_private(folder):
        return None
    digest = hashlib.sha256()
    for name in sources:
        digest.update(Path(__file__).with_name(name).read_bytes())
    versions = (version(name).encode() for name in ("scikit-fem", "scipy", "numpy"))
    digest.update(b"\n".join([*told, *versions]))
    return folder / digest.hexdigest()


def packed(arrays: Mapping[str, Any]) -> bytes:
    """Arrays by name as the content of a file."""
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def unpacked(content: bytes | None) -> dict[str, Any] | None:
    """What was packed; None of nothing or of what is damaged."""
    if content is None:
        return None
    with suppress(Exception), np.load(io.BytesIO(content), allow_pickle=False) as file:
        return dict(file)
    return None
