"""Meshes of Gmsh (.msh) of the formats 2.2 and 4.1, in text and binary, with all groups that an element is in."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.mesh_files import Block, Indices, MeshFile, Reals, in_blocks

# By Gmsh's number of a type: the kind, its dimension and how many nodes it has.
TYPES = {
    1: ("line", 1, 2), 8: ("line3", 1, 3), 15: ("vertex", 0, 1),
    2: ("triangle", 2, 3), 9: ("triangle6", 2, 6), 3: ("quad", 2, 4), 10: ("quad9", 2, 9), 16: ("quad8", 2, 8),
    4: ("tetra", 3, 4), 11: ("tetra10", 3, 10),
    5: ("hexahedron", 3, 8), 17: ("hexahedron20", 3, 20), 12: ("hexahedron27", 3, 27),
    6: ("wedge", 3, 6), 13: ("wedge18", 3, 18), 18: ("wedge15", 3, 15),
    7: ("pyramid", 3, 5), 14: ("pyramid14", 3, 14), 19: ("pyramid13", 3, 13),
}  # fmt: skip
# Edges of Gmsh's hexahedron in the order of VTK: those of the bottom, of the top, and upright ones.
HEX_EDGES = [8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15]
TO_VTK = {
    "tetra10": [*range(8), 9, 8],
    "hexahedron20": [*range(8), *HEX_EDGES],
    "hexahedron27": [*range(8), *HEX_EDGES, 22, 23, 21, 24, 20, 25, 26],
}
SPLIT = ("PartitionedEntities", "GhostElements")


class Part(NamedTuple):
    """Elements of one type in one entity of the geometry: their numbers (n,), nodes' numbers (n, a), and groups."""

    kind: int
    entity: int
    groups: tuple[int, ...]
    numbers: Indices
    nodes: Indices


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


def read_gmsh(path: Path) -> MeshFile:
    """Read a mesh; raises RequestError or ValueError."""
    content = path.read_bytes()
    sections = _sections(content, path)
    version, mode, size = sections["MeshFormat"].split()[:3]
    if version not in (b"2", b"2.2", b"4", b"4.1"):
        raise RequestError(f"the mesh file {path} is of Gmsh's format {version.decode()}; save it as 4.1 or 2.2")
    split = [name for name in SPLIT if name in sections]
    if split:
        raise RequestError(f"the mesh file {path} holds ${split[0]}, a mesh in partitions; save it without")
    old, binary = version.startswith(b"2"), mode == b"1"
    if binary and sections["MeshFormat"].split(b"\n", 1)[1][:4] != b"\1\0\0\0":
        raise RequestError(f"the mesh file {path} has the bytes of its numbers in another order; save it as text")
    read = {name: _Numbers(sections.get(name, b""), binary) for name in ("Entities", "Nodes", "Elements")}
    counted = f"<u{int(size)}"
    if old:
        tags, points = _old_nodes(sections["Nodes"], binary)
        parts = [*_old_parts(sections["Elements"], binary)]
    else:
        tags, points = _nodes(read["Nodes"], counted)
        parts = [
            *_parts(read["Elements"], counted, _groups(read["Entities"], counted) if "Entities" in sections else {})
        ]
    names = re.findall(rb'^\s*(\d+)\s+(-?\d+)\s+"(.*)"', sections.get("PhysicalNames", b""), flags=re.MULTILINE)
    return _mesh(
        path, tags, points, parts, [(int(d), int(tag), name.decode(errors="replace")) for d, tag, name in names]
    )


def _sections(content: bytes, path: Path) -> dict[str, bytes]:
    """The bodies of sections by their names; raises RequestError of one that is there twice, or has no end."""
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


def _old_nodes(body: bytes, binary: bool) -> tuple[Indices, Reals]:
    """Numbers (n,) and places (n, 3) of nodes of format 2.2."""
    first, _, rest = body.partition(b"\n")
    count = int(first)
    if binary:
        found = np.frombuffer(rest, [("number", "<i4"), ("place", "<f8", 3)], count)
        return found["number"].astype(int), found["place"]
    flat = _Numbers(rest, binary=False).take("f8", 4 * count).reshape(-1, 4)
    return flat[:, 0].astype(int), flat[:, 1:]


def _old_parts(body: bytes, binary: bool) -> Iterator[Part]:
    """Elements of format 2.2, which stand once for each of their groups."""
    for (kind, labels), found in _old_rows(body, binary).items():
        rows = np.concatenate(found).astype(int)
        owners = np.zeros((len(rows), 2), dtype=int)
        owners[:, :labels] = rows[:, 1 : 1 + min(labels, 2)]
        for group, entity in np.unique(owners, axis=0).tolist():
            some = rows[np.all(owners == (group, entity), axis=1)]
            yield Part(kind, entity, (abs(group),) * bool(group), some[:, 0], some[:, 1 + labels :])


def _old_rows(body: bytes, binary: bool) -> dict[tuple[int, int], list[Indices]]:
    """Number, tags and nodes of each element (n, 1 + tags + nodes), by its type and how many tags it has."""
    first, _, rest = body.partition(b"\n")
    left, numbers, found = int(first), _Numbers(rest, binary), {}
    words = [] if binary else [int(each) for each in numbers.words]
    at = 0
    while left > 0:
        if binary:
            kind, count, labels = (int(each) for each in numbers.take("<i4", 3))
            rows = numbers.take("<i4", count * (1 + labels + _type(kind)[2])).reshape(count, -1)
        else:
            kind, labels = words[at + 1 : at + 3]
            end = at + 3 + labels + _type(kind)[2]
            rows, count, at = np.array([[words[at], *words[at + 3 : end]]]), 1, end
        found.setdefault((kind, labels), []).append(rows)
        left -= count
    if at != len(words):
        raise ValueError("$Elements does not hold as many numbers as its elements need")
    return found


def _groups(numbers: _Numbers, counted: str) -> dict[tuple[int, int], tuple[int, ...]]:
    """Physical groups of an entity, by its dimension and number."""
    found = {}
    for dimension, count in enumerate(numbers.take(counted, 4)):
        for _ in range(int(count)):
            tag = int(numbers.take("<i4")[0])
            numbers.take("<f8", 6 if dimension else 3)
            found[dimension, tag] = tuple(abs(int(each)) for each in numbers.take("<i4", int(numbers.take(counted)[0])))
            if dimension:
                numbers.take("<i4", int(numbers.take(counted)[0]))
    return found


def _nodes(numbers: _Numbers, counted: str) -> tuple[Indices, Reals]:
    """Numbers (n,) and places (n, 3) of nodes of format 4.1."""
    tags, places = [np.zeros(0, dtype=int)], [np.zeros((0, 3))]
    for _ in range(int(numbers.take(counted, 4)[0])):
        dimension, _, parametric = numbers.take("<i4", 3)
        count = int(numbers.take(counted)[0])
        tags.append(numbers.take(counted, count).astype(int))
        width = 3 + int(dimension) * bool(parametric)
        places.append(numbers.take("<f8", count * width).reshape(count, width)[:, :3])
    return np.concatenate(tags), np.concatenate(places)


def _parts(numbers: _Numbers, counted: str, groups: dict[tuple[int, int], tuple[int, ...]]) -> Iterator[Part]:
    """Elements of format 4.1."""
    for _ in range(int(numbers.take(counted, 4)[0])):
        dimension, entity, kind = (int(each) for each in numbers.take("<i4", 3))
        count = int(numbers.take(counted)[0])
        rows = numbers.take(counted, count * (1 + _type(kind)[2])).reshape(count, -1).astype(int)
        yield Part(kind, entity, groups.get((dimension, entity), ()), rows[:, 0], rows[:, 1:])


def _type(kind: int) -> tuple[str, int, int]:
    if kind not in TYPES:
        raise ValueError(f"it holds elements of Gmsh's type {kind}, which are not read")
    return TYPES[kind]


def _mesh(path: Path, tags: Indices, points: Reals, parts: list[Part], names: list[tuple[int, int, str]]) -> MeshFile:
    """Parts put together, those of one type in one block; a group is a set by its name, and by its number."""
    if len(set(tags.tolist())) < len(tags):
        raise RequestError(f"the mesh file {path} numbers nodes anew; write one mesh")
    place = np.full(int(np.max(tags, initial=0)) + 2, -1)
    place[tags] = np.arange(len(tags))
    by_name = {(dimension, tag): name for dimension, tag, name in names}
    blocks, members, count = [], {}, 0
    for kind in dict.fromkeys(part.kind for part in parts):
        name, dimension, _ = TYPES[kind]
        own = [part for part in parts if part.kind == kind]
        numbers, nodes = (np.concatenate([getattr(part, key) for part in own]) for key in ("numbers", "nodes"))
        cells = place[np.clip(nodes, 0, len(place) - 1)]
        if np.any(lost := cells < 0):
            number = numbers[np.argmax(np.any(lost, axis=1))]
            raise RequestError(
                f"the mesh file {path}: element {number} has the node {nodes[lost][0]}, which has no place"
            )
        blocks.append(Block(name, cells[:, TO_VTK.get(name, slice(None))], numbers, name))
        for part in own:
            labels = {f"gmsh:physical {tag}" for tag in part.groups} | {f"gmsh:geometrical {part.entity}"}
            labels |= {by_name[dimension, tag] for tag in part.groups if (dimension, tag) in by_name}
            for label in labels:
                members.setdefault(label, []).extend(range(count, count + len(part.numbers)))
            count += len(part.numbers)
    sets = {label: in_blocks(found, blocks) for label, found in members.items()}
    return MeshFile(points, blocks, {}, sets, {}, (path,))
