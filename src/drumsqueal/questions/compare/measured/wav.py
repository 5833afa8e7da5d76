"""WAV files, through SciPy; those of a stream, which states no sizes, to the end of the file."""

import io
import mmap
import struct
import warnings
from pathlib import Path

import numpy as np
import scipy

from drumsqueal.errors import RequestError
from drumsqueal.questions.compare.measured.record import Asked, Measured
from drumsqueal.questions.compare.measured.sampling import Sampling

_CLIPPED = 1 - 1e-4  # of full scale; 16 bit reach 1 − 3e-5 upwards
_NOT_KNOWN = 0x7FFFF000  # bytes; the least of the sizes, up to FFFFFFFF, that programs state which do not know them


def read_wav(asked: Asked) -> Measured:
    """Read a channel of a WAV file, in full scales without a unit. Raises RequestError for one cut short or damaged."""
    path, rate = asked.path, asked.rate
    try:
        file, remarks = _with_sizes(path)
        with warnings.catch_warnings(record=True) as noted:
            warnings.simplefilter("always")
            own_rate, data = scipy.io.wavfile.read(file)
    except RequestError:
        raise
    except Exception as error:  # scipy raises nearly all there is on a file that is damaged
        damaged = f"{path}: this WAV file is damaged, or of a kind that is not read ({error})"
        raise RequestError(f"{damaged}; PCM and floating point are") from None
    if any("prematurely" in str(note.message) or "Incomplete" in str(note.message) for note in noted):
        raise RequestError(f"{path}: the WAV file is cut short; copy it again")
    columns = data[:, None] if data.ndim == 1 else data
    names = [f"channel {k + 1}" for k in range(columns.shape[1])]
    at = asked.pick(names)
    if rate is not None:
        remarks.append(f"the sample rate is that of --rate, not the {own_rate} Hz of the file")
    elif not own_rate > 0:
        raise RequestError(f"{path}: the WAV file states a sample rate of {own_rate} Hz; give --rate")
    values = np.asarray(columns[:, at], dtype=np.float64)
    if data.dtype.kind in "iu":
        bits = 8 * data.dtype.itemsize  # scipy puts 24 bits into the upper ones of 32
        values = (values - (128.0 if data.dtype.kind == "u" else 0.0)) / 2.0 ** (bits - 1)
        clipped = int(np.sum(np.abs(values) >= _CLIPPED))
        if clipped > 1:
            remarks.append(
                f"{clipped} samples are at full scale: clipping adds harmonics and combinations of the lines"
            )
    return asked.measured(names[at], None, Sampling(float(rate or own_rate), 0.0), values, remarks)


class _Mapped(mmap.mmap):
    """A file in memory as far as it is looked at; what is changed there is not written."""

    def fileno(self) -> int:
        """None, so that SciPy does not read past the changes."""
        raise io.UnsupportedOperation

    def seekable(self) -> bool:
        """As files are; Python's own from 3.13 on."""
        return True


def _with_sizes(path: Path) -> tuple[Path | _Mapped, list[str]]:
    """The file, and no remark; one that does not know its sizes with those that it has, and a remark on that.

    Raises RequestError for a file without samples or with fewer than it states.
    """
    with path.open("rb") as file:
        content = _Mapped(file.fileno(), 0, access=mmap.ACCESS_COPY)
    order = ">" if content[:4] == b"RIFX" else "<"
    chunks = _chunks(content, order)
    if not {b"fmt ", b"data"} <= chunks.keys():
        raise RequestError(f"{path}: this WAV file is damaged, it lacks a chunk fmt or data; export it again")
    (whole,), (at, stated) = struct.unpack_from(f"{order}I", content, 4), chunks[b"data"]
    if content[:4] == b"RF64" and b"ds64" in chunks:
        whole, stated = struct.unpack_from("<QQ", content, chunks[b"ds64"][0])
    size, room = stated, len(content) - at
    if stated >= max(room + 1, _NOT_KNOWN) or (stated == 0 and whole + 8 != len(content)):
        (frame,) = struct.unpack_from(f"{order}H", content, chunks[b"fmt "][0] + 12)
        size = room - room % max(frame, 1)
    if size > room:
        raise RequestError(f"{path}: the WAV file is cut short; copy it again")
    if size == stated and at < whole + 8 <= len(content):
        return path, []
    struct.pack_into(f"{order}4sI", content, 0, b"RIFX" if order == ">" else b"RIFF", at + size - 8)
    struct.pack_into(f"{order}I", content, at - 4, size)
    told = f"the file states {stated} bytes of samples, as one written into a pipe: it is read to its end, {size} bytes"
    return content, [told] if size != stated else []


def _chunks(content: mmap.mmap, order: str) -> dict[bytes, tuple[int, int]]:
    """Where each chunk up to the samples begins, and its size as stated."""
    chunks, at = {}, 12
    while at + 8 <= len(content) and b"data" not in chunks:
        name, size = struct.unpack_from(f"{order}4sI", content, at)
        chunks[name] = at + 8, size
        at += 8 + size + size % 2  # chunks begin at even places
    return chunks
