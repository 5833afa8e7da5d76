"""Meshes of other codes as they stand in their files: points, cells and named sets."""

import itertools
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.elements import HEX_FACES, TET_FACES

Reals = NDArray[np.float64]
Indices = NDArray[np.int64]

CORNERS = {"triangle": 3, "quad": 4}
FACES = {"tetra": TET_FACES, "hexahedron": HEX_FACES}
FITTING = "tetrahedra of 4 or 10 nodes, or hexahedra of 8, 20 or 27"
EXPONENT = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[eEdD]?([+-]\d+)|[eEdD](\d+))?$")


class Block(NamedTuple):
    """Elements (n, nodes) of one kind, as meshio names it, the file's own numbers of them (n,) and name of their type.

    Surface elements that `weigh` are shells or membranes, and have a mass of their own.
    """

    kind: str
    cells: Indices
    numbers: Indices
    name: str
    weigh: bool = False

    @property
    def shape(self) -> str:
        """The kind without the number of its nodes."""
        return self.kind.rstrip("0123456789")


class MeshFile(NamedTuple):
    """Points (n, 3), blocks of elements, and sets by name: nodes, elements of each block, faces by their corners.

    `files` are all that were read, and `notes` say what was passed over.
    """

    points: Reals
    blocks: list[Block]
    node_sets: dict[str, Indices]
    cell_sets: dict[str, list[Indices]]
    face_sets: dict[str, list[tuple[int, ...]]]
    files: tuple[Path, ...]
    notes: tuple[str, ...] = ()


class Line(NamedTuple):
    """A line of a file, and where it is."""

    path: Path
    number: int
    text: str

    @property
    def where(self) -> str:
        """The file and the number of the line, with which a message begins."""
        return f"{self.path}, line {self.number}"


def read_lines(path: Path) -> list[Line]:
    """All lines of a file but for blank ones; raises RequestError where there is none."""
    try:
        text = path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise RequestError(f"the mesh file {path} cannot be read ({error.strerror}); put it there") from None
    return [Line(path, number, line) for number, line in enumerate(text.splitlines(), start=1) if line.strip()]


def read_included(name: str, asked: Line, opened: tuple[Path, ...]) -> list[Line]:
    """Lines of a file that one in the last of the opened files asks for, from its folder or that of the first."""
    places = [folder / name.replace("\\", "/") for folder in (asked.path.parent, opened[0].parent)]
    path = next((each for each in places if each.is_file()), places[0])
    if path in opened:
        raise RequestError(f"{asked.where}: the file {path} includes itself")
    try:
        return read_lines(path)
    except RequestError as error:
        raise RequestError(f"{asked.where}: {error}") from None


def to_real(text: str) -> float:
    """A number as Fortran writes it, such as 1.5D-3 or 1.5-3; 0 where there is none. Raises ValueError."""
    text = text.strip()
    found = EXPONENT.match(text)
    if text and found is None:
        raise ValueError(f"{text!r} is not a number")
    return float(f"{found[1]}e{found[2] or found[3] or 0}") if found else 0.0


def to_whole(text: str) -> int:
    """A whole number; raises ValueError."""
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"{text!r} is not a whole number") from None


def indices_of(numbers: Sequence[int], index: dict[int, int], where: str, number: int) -> list[int]:
    """Indices of an element's nodes; raises RequestError of one that is not there."""
    found = [index.get(each, -1) for each in numbers]
    if -1 in found:
        missing = next(each for each, place in zip(numbers, found, strict=True) if place < 0)
        raise RequestError(f"{where}: element {number} has the node {missing}, which the file does not give a place")
    return found


def in_blocks(members: Iterable[int], blocks: list[Block]) -> list[Indices]:
    """Which elements of each block a set holds, from places among all elements."""
    starts = np.cumsum([0, *(len(each.cells) for each in blocks)])
    found = np.unique(np.array([*members], dtype=np.int64))
    return [found[(found >= a) & (found < b)] - a for a, b in itertools.pairwise(starts)]
