"""Meshes of Gmsh (.msh) of the formats 2.2 and 4.1, in text and binary, with all groups that an element is in."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies import mesh_files as files
from drumsqueal.physics.bodies.mesh_files import SHAPES, Element, MeshFile, Reals, indices_of, shape_of, size_of

# Kinds by Gmsh's number of a type.
TYPES = {
    1: "line", 8: "line3", 15: "vertex", 2: "triangle", 9: "triangle6", 3: "quad", 10: "quad9", 16: "quad8",
    4: "tetra", 11: "tetra10", 5: "hexahedron", 17: "hexahedron20", 12: "hexahedron27",
    6: "wedge", 13: "wedge18", 18: "wedge15", 7: "pyramid", 14: "pyramid14", 19: "pyramid13",
}  # fmt: skip
# Edges of Gmsh's hexahedron in the order of VTK: those of the bottom, of the top, and upright ones.
HEX_EDGES = [8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15]
TO_VTK = {
    "tetra10": [*range(8), 9, 8],
    "hexahedron20": [*range(8), *HEX_EDGES],
    "hexahedron27": [*range(8), *HEX_EDGES, 22, 23, 21, 24, 20, 25, 26],
}


EntityElements = tuple[str, int, tuple[int, ...], list[list[int]]]
"""Kind, entity of the geometry, groups of elements of one type, and rows of each one's number and its nodes'."""


class _Numbers:
    """Numbers of a section, taken one after the other from words or from bytes."""

    def __init__(self, body: bytes, binary: bool) -> None:
        self.body, self.words, self.binary, self.at = body, [] if binary else body.split(), binary, 0

    def take(self, kind: str, count: int = 1) -> NDArray:
        """So many numbers; raises ValueError where there are fewer."""
        if self.binary:
            found = np.frombuffer(self.body, kind, count, self.at)
            self.at += found.nbytes
            return found
        found = np.array(self.words[self.at : self.at + count], dtype="S").astype(kind)
        if len(found) < count:
            raise ValueError("a section ends before its last number")
        self.at += count
        return found

    def whole(self, kind: str, count: int = 1) -> list[int]:
        """So many whole numbers."""
        return self.take(kind, count).tolist()

    def end(self) -> None:
        """Raise ValueError where there are more numbers than those that were taken."""
        if self.body[self.at :].strip() if self.binary else self.words[self.at :]:
            raise ValueError("a section holds more numbers than its elements and nodes need")


def read_gmsh(path: Path) -> MeshFile:
    """Read a mesh; raises RequestError or ValueError."""
    sections = _sections(files.content_of(path, RequestError), path)
    version, mode, size = [*sections["MeshFormat"].split(), b"", b"", b""][:3]
    if version not in (b"2", b"2.2", b"4.1"):
        given = version.decode(errors="replace")
        raise RequestError(f"the mesh file {path} is of Gmsh's format {given}; save it as 4.1 or 2.2")
    if mode not in (b"0", b"1") or size not in (b"4", b"8"):
        reason = "lacks the kind of file or the size of numbers in $MeshFormat; write them, such as 4.1 0 8"
        raise RequestError(f"the mesh file {path} {reason}")
    for name in ("PartitionedEntities", "GhostElements"):
        if name in sections:
            raise RequestError(f"the mesh file {path} holds ${name}, a mesh in partitions; save it without")
    old, binary = version.startswith(b"2"), mode == b"1"
    if binary and sections["MeshFormat"].split(b"\n", 1)[1][:4] != b"\1\0\0\0":
        raise RequestError(f"the mesh file {path} has the bytes of its numbers in another order; save it as text")
    counted = f"<u{int(size)}"
    if old:
        tags, points = _old_nodes(sections["Nodes"], binary)
        parts = [*_old_parts(sections["Elements"], binary)]
    else:
        groups = _groups(_Numbers(sections["Entities"], binary), counted) if "Entities" in sections else {}
        tags, points = _nodes(_Numbers(sections["Nodes"], binary), counted)
        parts = [*_parts(_Numbers(sections["Elements"], binary), counted, groups)]
    names = re.findall(rb'^\s*(\d+)\s+(-?\d+)\s+"(.*)"', sections.get("PhysicalNames", b""), flags=re.MULTILINE)
    by_tag = {(int(dimension), int(tag)): name.decode(errors="replace") for dimension, tag, name in names}
    return _mesh(path, tags, points, parts, by_tag)


def _sections(content: bytes, path: Path) -> dict[str, bytes]:
    """The bodies of sections by their names; raises RequestError of one that is there twice, or has no end."""
    content = content if b"\n" in content else content.replace(b"\r", b"\n")  # as old programs end lines of text
    found, at = {}, 0
    while match := re.compile(rb"^\$(\w+)[^\n]*\n", re.MULTILINE).search(content, at):
        name = match[1].decode()
        at = content.find(b"$End" + match[1], match.end())
        if at < 0:
            raise RequestError(f"the mesh file {path} ends within ${name}; it was cut short: write it again")
        if name in found and name in ("MeshFormat", "Entities", "Nodes", "Elements"):
            raise RequestError(f"the mesh file {path} holds ${name} twice; write one mesh")
        found[name] = content[match.end() : at]
        at += len(b"$End" + match[1])
    missing = [name for name in ("MeshFormat", "Nodes", "Elements") if name not in found]
    if missing:
        raise ValueError(f"it has no ${missing[0]}")
    return found


def _old_nodes(body: bytes, binary: bool) -> tuple[list[int], Reals]:
    """Numbers (n,) and places (n, 3) of nodes of format 2.2."""
    first, _, rest = body.partition(b"\n")
    count = int(first)
    if binary:
        found = np.frombuffer(rest, [("number", "<i4"), ("place", "<f8", 3)], count)
        return found["number"].tolist(), found["place"]
    flat = _Numbers(rest, binary=False).take("f8", 4 * count).reshape(-1, 4)
    return flat[:, 0].astype(int).tolist(), flat[:, 1:]


def _old_parts(body: bytes, binary: bool) -> Iterator[EntityElements]:
    """Elements of format 2.2, which stand once for each of their groups."""
    first, _, rest = body.partition(b"\n")
    left, numbers = int(first), _Numbers(rest, binary)
    while left > 0:
        if binary:  # so many elements of one type, each with its number
            kind, count, labels = numbers.whole("<i4", 3)
            own = []
        else:
            *own, kind, labels = numbers.whole("<i4", 3)
            count = 1
        for _ in range(count):
            row = [*own, *numbers.whole("<i4", labels + size_of(_kind(kind)) + 1 - len(own))]
            group, entity = [*row[1 : 1 + labels], 0, 0][:2]
            yield _kind(kind), entity, (abs(group),) * bool(group), [[row[0], *row[1 + labels :]]]
        left -= count
    numbers.end()


def _groups(numbers: _Numbers, counted: str) -> dict[tuple[int, int], tuple[int, ...]]:
    """Physical groups of an entity, by its dimension and number."""
    found = {}
    for dimension, count in enumerate(numbers.whole(counted, 4)):
        for _ in range(count):
            (tag,) = numbers.whole("<i4")
            numbers.take("<f8", 6 if dimension else 3)
            found[dimension, tag] = tuple(abs(each) for each in numbers.whole("<i4", *numbers.whole(counted)))
            if dimension:
                numbers.take("<i4", *numbers.whole(counted))
    return found


def _nodes(numbers: _Numbers, counted: str) -> tuple[list[int], Reals]:
    """Numbers (n,) and places (n, 3) of nodes of format 4.1."""
    tags, places = [], [np.zeros((0, 3))]
    for _ in range(numbers.whole(counted, 4)[0]):
        dimension, _, parametric = numbers.whole("<i4", 3)
        (count,) = numbers.whole(counted)
        tags += numbers.whole(counted, count)
        width = 3 + dimension * bool(parametric)
        places.append(numbers.take("<f8", count * width).reshape(count, width)[:, :3])
    numbers.end()
    return tags, np.concatenate(places)


def _parts(numbers: _Numbers, counted: str, groups: dict[tuple[int, int], tuple[int, ...]]) -> Iterator[EntityElements]:
    """Elements of format 4.1."""
    for _ in range(numbers.whole(counted, 4)[0]):
        dimension, entity, number = numbers.whole("<i4", 3)
        (count,), kind = numbers.whole(counted), _kind(number)
        rows = numbers.take(counted, count * (1 + size_of(kind))).reshape(count, -1)
        yield kind, entity, groups.get((dimension, entity), ()), rows.tolist()
    numbers.end()


def _kind(number: int) -> str:
    if number not in TYPES:
        raise ValueError(f"it holds elements of Gmsh's type {number}, which are not read")
    return TYPES[number]


def _mesh(
    path: Path, tags: list[int], points: Reals, parts: list[EntityElements], names: dict[tuple[int, int], str]
) -> MeshFile:
    """Parts put together; a group is a set by its name, and by its number."""
    index = {tag: place for place, tag in enumerate(tags)}
    if len(index) < len(tags):
        raise RequestError(f"the mesh file {path} numbers nodes anew; write one mesh")
    elements, sets = [], {}
    for kind, entity, groups, rows in parts:
        members, dimension = range(len(elements), len(elements) + len(rows)), SHAPES[shape_of(kind)][0]
        labels = {f"gmsh:geometrical {entity}", *(f"gmsh:physical {tag}" for tag in groups)}
        labels |= {names[dimension, tag] for tag in groups if (dimension, tag) in names}
        for label in labels:
            sets.setdefault(label, []).extend(members)
        for number, *nodes in rows:
            nodes = indices_of(nodes, index, f"the mesh file {path}", number)
            nodes = [nodes[k] for k in TO_VTK.get(kind, range(len(nodes)))]
            elements.append(Element(kind, nodes, number, kind))
    return MeshFile(points, elements, {}, sets, {}, (path,))
