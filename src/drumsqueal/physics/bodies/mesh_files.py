"""Meshes of other codes as they stand in their files: points, elements and named sets, and the lines they come from."""

import contextlib
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from drumsqueal.errors import RequestError
from drumsqueal.ordinary import decoded, read_ordinary
from drumsqueal.physics.bodies.elements import HEX_FACES, TET_FACES, Reals

# Dimension of a shape and how many corners it has; what meshio has beyond these is no element of ours.
SHAPES = {"vertex": (0, 1), "line": (1, 2), "triangle": (2, 3), "quad": (2, 4), "tetra": (3, 4), "hexahedron": (3, 8),
          "pyramid": (3, 5), "wedge": (3, 6)}  # fmt: skip
FACES = {"tetra": TET_FACES, "hexahedron": HEX_FACES}
FITTING = "tetrahedra of 4 or 10 nodes, or hexahedra of 8 or 20"  # of Abaqus and Nastran, whose 27 nodes are not read
MASS_UNITS = {"kg": 1.0, "t": 1e3}
USUAL_MASS = {"m": "kg", "mm": "t"}  # with N and s, in which the codes' own units are consistent
ON_ROTATIONS = "acts on rotations, which nodes of solids do not have; leave it out"
MOST_BYTES = 2**30  # ten times a mesh of as many unknowns as are solved for
EXPONENT = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[eEdD]?([+-]\d+)|[eEdD](\d+))?$")

Refusal = Callable[[str], RequestError]
"""Makes an error of a reason, and says where."""


class Element(NamedTuple):
    """An element's kind as meshio names it, places of its nodes, the file's own number and name of its type.

    Surface elements that `weigh` are shells or membranes, and have a mass of their own.
    """

    kind: str
    nodes: Sequence[int]
    number: int
    name: str
    weigh: bool = False

    @property
    def shape(self) -> str:
        """The kind without the number of its nodes."""
        return shape_of(self.kind)

    @property
    def dimension(self) -> int:
        """2 of a surface, 3 of a solid."""
        return SHAPES.get(self.shape, (3,))[0]

    @property
    def corners(self) -> Sequence[int]:
        """Places of the nodes at its corners."""
        return self.nodes[: SHAPES[self.shape][1]]


class Skin(NamedTuple):
    """Surface elements, by their places, of one section or property: `name` is whose it is.

    Plies are thickness and density in the file's units; a density that is not in the file is None.
    """

    refuse: Refusal
    name: str
    members: Sequence[int]
    plies: Sequence[tuple[float, float | None]]


class PointMass(NamedTuple):
    """A mass in the file's unit at the place of a node, and which element it is."""

    refuse: Refusal
    name: str
    node: int
    mass: float


class MeshFile(NamedTuple):
    """Points (n, 3), elements, and sets by name: of nodes and elements by their places, of faces by their corners.

    `files` are all that were read, and `notes` say what was passed over.
    """

    points: Reals
    elements: list[Element]
    node_sets: Mapping[str, Sequence[int]]
    element_sets: Mapping[str, Sequence[int]]
    face_sets: Mapping[str, Sequence[Sequence[int]]]
    files: tuple[Path, ...]
    notes: tuple[str, ...] = ()
    skins: Sequence[Skin] = ()
    masses: Sequence[PointMass] = ()


class FileLine(NamedTuple):
    """A line of a file, and where it is."""

    path: Path
    number: int
    text: str

    @property
    def where(self) -> str:
        """The file and the number of the line, with which a message begins."""
        return f"{self.path}, line {self.number}"

    def refuse(self, reason: str) -> RequestError:
        """An error that says where it is."""
        return RequestError(f"{self.where}: {reason}")


class Source:
    """A file and those that it includes: `files` are what was opened.

    Lines go through `cut`, which leaves out comments and gives each with the name of the file that it asks for, if any.
    """

    def __init__(self, path: Path, cut: Callable[[Iterator[FileLine]], Iterable[tuple[FileLine, str | None]]]) -> None:
        """Keep what is to be read."""
        self.path, self.cut, self.opened = path, cut, []

    @property
    def files(self) -> tuple[Path, ...]:
        """Each once."""
        return tuple(dict.fromkeys(self.opened))

    def lines(self, asked: FileLine | None = None, path: Path | None = None, within: tuple = ()) -> Iterator[FileLine]:
        """Lines but blank ones, those of an included file in their place; raises RequestError where there is none."""
        path = path or self.path
        text = decoded(content_of(path, asked.refuse if asked else RequestError))
        self.opened.append(path)
        each = (FileLine(path, number, line) for number, line in enumerate(text.splitlines(), start=1) if line.strip())
        for line, name in self.cut(each):
            yield from [line] if name is None else self.included(name, line, within)

    def included(self, name: str, asked: FileLine, within: tuple = ()) -> Iterator[FileLine]:
        """Lines of a file that a line asks for, from that line's folder or that of the first file."""
        if not name:
            raise asked.refuse("the line includes a file without a name; write the name")
        places = [folder / name.replace("\\", "/") for folder in (asked.path.parent, self.path.parent)]
        path = next((each for each in places if each.is_file()), places[0])
        if path in (*within, asked.path):
            raise asked.refuse(f"the file {path} includes itself")
        return self.lines(asked, path, (*within, asked.path))


def content_of(path: Path, refuse: Refusal) -> bytes:
    """The content of a file of a mesh, which is ordinary and not too large; refuse where there is none."""
    try:
        return read_ordinary(path, MOST_BYTES)
    except OSError as error:
        raise refuse(f"the mesh file {path} cannot be read ({error.strerror}); put a readable file there") from None


@contextlib.contextmanager
def reading(refuse: Refusal) -> Iterator[None]:
    """Refuse where a number cannot be read."""
    try:
        yield
    except RequestError:
        raise
    except (ValueError, IndexError) as error:
        raise refuse(f"cannot be read: {error}") from None


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


def to_mass(text: str, refuse: Refusal) -> float:
    """A mass; refuse what is none."""
    mass = to_real(text)
    if not (text and 0 <= mass < np.inf):
        raise refuse(f"has the mass {text or 'of an empty field'}; write a number of at least 0")
    return mass


def shape_of(kind: str) -> str:
    """A kind of element without the number of its nodes."""
    return kind.rstrip("0123456789")


def size_of(kind: str) -> int:
    """How many nodes a kind of element has."""
    return int(kind.removeprefix(shape_of(kind)) or SHAPES[kind][1])


def indices_of(numbers: Iterable[int], index: dict[int, int], where: str, number: int) -> list[int]:
    """Places of an element's nodes; raises RequestError of one that is not there."""
    try:
        return [index[each] for each in numbers]
    except KeyError as missing:
        reason = f"element {number} has the node {missing}, which the file does not give a place"
        raise RequestError(f"{where}: {reason}") from None


def triad(along: Reals, aside: Reals, refuse: Refusal) -> Reals:
    """Unit vectors along a vector, along what another is across it, and across both: rows (3, 3)."""
    across = np.cross(along, aside)
    if not np.linalg.norm(across):
        raise refuse("has three points on one line, which give no axes; correct them")
    axes = np.stack([along, np.cross(across, along), across])
    return axes / np.linalg.norm(axes, axis=1)[:, None]


def cartesian(kind: str, given: Reals) -> Reals:
    """x, y, z from r, θ, z of a system C, or from r, θ off its z axis, φ about it of a system S (degrees)."""
    if kind == "R":
        return given
    first, second = given[0], np.radians(given[1])
    if kind == "C":
        return np.array([first * np.cos(second), first * np.sin(second), given[2]])
    about = np.radians(given[2])
    return first * np.array([np.sin(second) * np.cos(about), np.sin(second) * np.sin(about), np.cos(second)])
