"""What a page holds inside itself instead of naming a file: pictures and sounds as data URIs, and their sizes."""

import base64
import hashlib
import struct
from pathlib import Path
from typing import NamedTuple

from drumsqueal.errors import RequestError
from drumsqueal.files.ordinary import read_ordinary

LARGEST = 64 * 2**20  # bytes of a picture; those of drumsqueal have some 1 MB
_SIGNATURE = b"\x89PNG\r\n\x1a\n"


class Picture(NamedTuple):
    """A picture in the page: heading, what it shows, file name, size in points, and itself."""

    heading: str
    text: str
    file: str
    width: int
    height: int
    uri: str


def picture(path: Path, words: tuple[str, str]) -> Picture | None:
    """Read a PNG file; None where there is none. Raises RequestError for what is no PNG."""
    try:
        content = read_ordinary(path, LARGEST)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise RequestError(f"{path}: cannot be read ({error.strerror or error})") from None
    if content[:8] != _SIGNATURE or content[12:16] != b"IHDR" or len(content) < 24:
        raise RequestError(f"{path} is no PNG file, as the figures of drumsqueal are; run the scene anew")
    width, height = struct.unpack(">II", content[16:24])
    return Picture(*words, path.name, width, height, data_uri("image/png", content))


def data_uri(kind: str, content: bytes) -> str:
    """The content as an address that holds it."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def hashed(text: str) -> str:
    """The hash by which a Content-Security-Policy allows what stands in the page, and nothing else."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
