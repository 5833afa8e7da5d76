"""The universal file format: codes, for what writes it and what reads it, and how it is read, by pyuff.

Source: the definitions of datasets 55, 58 and 164 by SDRC, as kept by the University of Cincinnati.
"""

import contextlib
import io
import re
import tempfile
from collections.abc import Container, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.ordinary import BYTE_ORDER_MARKS, decoded

TIME_RESPONSE = 1  # type of the function
TIME_AXIS = 17  # specific data type of the abscissa
UNKNOWN, GENERAL = 0, 1  # specific data types that say nothing of the quantity
ROTATIONS = (4, 5, 6)  # directions about x, y, z; 1 to 3 are along them, negative ones against
SI_SYSTEM, USER_DEFINED = 1, 9  # codes of dataset 164
MODES, FUNCTION, UNITS = 55, 58, 164  # datasets
COMPLEX = (5, 6)  # types of the numbers of a function

# A line of its own begins and ends a dataset, in a file of fixed records filled up with blanks.
_MARK = rb"    -1[ \t]*(?:\r\n?|\n|\Z)"
_LINE_END = re.compile(rb"\r\n?|\n")
_TEXT_MARK, _BINARY_MARK = re.compile(rb"(?<![^\r\n])" + _MARK), re.compile(rb"[\r\n]*" + _MARK)
_HEADER = re.compile(rb"(?:[^\r\n]*(?:\r\n?|\n)){12}")  # of a function: from the line of its type to the numbers
_FREE = {MODES: 6, FUNCTION: 6}  # lines, from that of the type on, that may hold any text
_D_EXPONENT = re.compile(r"(\.\d*)[dD](?=[-+]?\d)")
_NO_LETTER = re.compile(r"(?<=[\d.])(?=[-+]\d{3}(?![\d.]))")  # which Fortran leaves out before three digits
_TOUCHING = re.compile(r"(?<=[\d.])(?=[-+])")  # numbers that fill all of their columns


class DataType(NamedTuple):
    """A specific data type: what is measured, and in which SI unit along an axis and about one ("" where it cannot)."""

    quantity: str
    unit: str
    about: str = ""


DATA_TYPES = {
    8: DataType("displacement", "m", "rad"),
    11: DataType("velocity", "m/s", "rad/s"),
    12: DataType("acceleration", "m/s^2", "rad/s^2"),
    9: DataType("force", "N", "N*m"),  # a reaction
    13: DataType("force", "N", "N*m"),  # an excitation
    15: DataType("pressure", "Pa"),
}
_FOOT, _POUND, _KILOGRAM, _POUNDAL = 0.3048, 4.4482216152605, 9.80665, 0.138254954376
SYSTEMS = {
    SI_SYSTEM: (1.0, 1.0),
    2: (_FOOT, _POUND),
    3: (1.0, _KILOGRAM),
    4: (_FOOT, _POUNDAL),
    5: (1e-3, 1e-3),
    6: (1e-2, 1e-2),
    7: (0.0254, _POUND),
    8: (1e-3, _KILOGRAM),
    10: (1e-3, 1.0),
}
"""Metres, and newtons, that the units of length and force are, by the code of dataset 164."""


def type_of(quantity: str) -> int:
    """The first specific data type of a quantity; general for one that has none, and is known by its units alone."""
    return next((code for code, known in DATA_TYPES.items() if known.quantity == quantity), GENERAL)


def units_of(system: Mapping[str, Any]) -> tuple[float, float] | None:
    """Metres, and newtons, that the units of a dataset 164 are; None where it does not say."""
    code = int(system.get("units_code", 0))
    if code == USER_DEFINED and system["length"] > 0 and system["force"] > 0:
        return 1.0 / system["length"], 1.0 / system["force"]
    return SYSTEMS.get(code)


def read_datasets(path: Path, wanted: Container[int]) -> list[dict[str, Any]]:
    """Every dataset of a file in its order: its `type` and, of those that are wanted, what pyuff reads of it.

    `units` are those that hold for it, as `units_of` has them: a dataset 164 holds from where it stands, and where all
    in the file say the same, before that, too. Raises RequestError for a file that is damaged or cut short.
    """
    found: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):  # pyuff prints oddities
        alone = Path(folder) / "alone.uff"
        for number, (line, block) in enumerate(_blocks(path), start=1):
            kind = block[:6].decode(errors="replace").strip()
            try:
                read = int(kind) in wanted or int(kind) == UNITS
                found.append(_read(alone, int(kind), block) if read else {"type": int(kind)})
            except Exception:  # pyuff raises plain Exception
                where = f"{path}, line {line}: dataset {number} of the file, which begins there,"
                what = f"{where} of type {kind}, is damaged and cannot be read"
                raise RequestError(f"{what}; export the file again, or take that dataset out") from None
    systems = [units_of(each) for each in found if each["type"] == UNITS]
    units = systems[0] if len(set(systems)) == 1 else None
    for each in found:
        units = units_of(each) if each["type"] == UNITS else units
        each["units"] = units
    return found


def _blocks(path: Path) -> Iterator[tuple[int, bytes]]:
    """The line of the mark that begins each dataset, and what is within its marks. Raises RequestError without end."""
    content = path.read_bytes()
    content = decoded(content).encode() if content.startswith(BYTE_ORDER_MARKS) else content
    content = content.rstrip(b"\x1a\0")  # as the end of a file was marked once
    at, line = 0, 1
    while begin := _TEXT_MARK.search(content, at):
        end = _end_of_binary(content, begin.end()) or _TEXT_MARK.search(content, begin.end())
        if end is None or content[at : begin.start()].strip():
            break
        line += len(_LINE_END.findall(content, at, begin.start()))
        yield line, content[begin.end() : end.start()]
        line += len(_LINE_END.findall(content, begin.start(), end.end()))
        at = end.end()
    if content[at:].strip():  # passed over, the last dataset would be lost without a word
        line += len(_LINE_END.findall(content[at:].partition(content[at:].strip())[0]))
        reason = f"the universal file is cut short, or lacks a mark -1 from line {line} on"
        raise RequestError(f"{path}: {reason}; copy or export it again")


def _end_of_binary(content: bytes, first: int) -> re.Match[bytes] | None:
    """The mark behind a function in binary, whose numbers may look like one; None for any other dataset."""
    header = _HEADER.match(content, first)
    if header is None or header[0][6:7].lower() != b"b":
        return None
    stated = header[0][31:43].strip()  # bytes of the numbers
    end = _BINARY_MARK.match(content, header.end() + int(stated)) if stated.isdigit() else None
    return end or _BINARY_MARK.search(content, header.end())


def _read(alone: Path, kind: int, block: bytes) -> dict[str, Any]:
    """One dataset by pyuff, from a file of its own in the columns of the definition. Raises Exception.

    The numbers of a function are read here: others write them in wider columns, with D exponents or blanks behind, and
    binary ones may look like a mark.
    """
    import pyuff  # where there is a file, not with every start

    header = _HEADER.match(block) if kind == FUNCTION else None
    text, numbers = (header[0], block[header.end() :]) if header else (block, b"")
    lines = decoded(b"\n".join(line.rstrip() for line in text.splitlines())).split("\n")
    free = _FREE.get(kind, 1)
    lines[free:] = [_D_EXPONENT.sub(r"\1E", line) for line in lines[free:]]
    alone.write_text("\n".join(["    -1", *lines, "    -1", ""]), encoding="utf-8")
    file: Any = pyuff.UFF(str(alone))
    found = file.read_sets(0, header_only=kind == FUNCTION)
    if kind == FUNCTION and found["ord_data_type"] not in COMPLEX:
        values, step = _numbers(found, numbers), 1 if found["abscissa_spacing"] == 1 else 2
        found["x"], found["data"] = values[::step], values[step - 1 :: step]
    return found


def _numbers(function: Mapping[str, Any], content: bytes) -> NDArray[np.float64]:
    """The numbers of a function. Raises ValueError."""
    if function["binary"]:  # a line break may stand behind
        kind = np.dtype(f"{'<' if function['byte_ordering'] == 1 else '>'}f{function['ord_data_type'] * 2}")
        return np.frombuffer(content, kind, len(content) // kind.itemsize).astype(np.float64)
    text = content.decode("ascii").replace("D", "E").replace("d", "e")
    try:
        return np.array(text.split(), dtype=np.float64)
    except ValueError:
        return np.array(_TOUCHING.sub(" ", _NO_LETTER.sub("E", text)).split(), dtype=np.float64)
