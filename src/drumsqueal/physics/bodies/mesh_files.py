"""Meshes of other codes as they stand in their files: points, cells and named sets."""

import contextlib
import io
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.elements import HEX_FACES, TET_FACES

Indices = NDArray[np.int64]

ABAQUS_SOLIDS = {4: "tetra", 10: "tetra10", 8: "hexahedron", 20: "hexahedron20"}
ABAQUS_FACES = {3: "triangle", 6: "triangle6", 4: "quad", 8: "quad8", 9: "quad9"}
ABAQUS_TYPE = re.compile(r"(C3D|STRI|S|CPS|CPE|M3D|SFM3D|R3D)(\d+)[A-Z]*$")
CORNERS = {"triangle": 3, "quad": 4}


class Block(NamedTuple):
    """Elements (n, nodes) of one kind, as meshio names it, and the file's own numbers of them (n,)."""

    kind: str
    cells: Indices
    numbers: Indices


class MeshFile(NamedTuple):
    """Points (n, 3), blocks of elements, and sets by name: nodes, elements of each block, faces by their corners."""

    points: NDArray[np.float64]
    blocks: list[Block]
    node_sets: dict[str, Indices]
    cell_sets: dict[str, list[Indices]]
    face_sets: dict[str, list[tuple[int, ...]]]


def read_mesh_file(path: Path) -> MeshFile:
    """Read any format that meshio reads, and .inp by ourselves.

    A whole-numbered array by name (as in VTU) is the set of where it is not zero, and "name 3" where it is 3; of
    Nastran, "PID 3" are the elements of property 3. Raises RequestError.
    """
    if not path.is_file():
        raise RequestError(f"there is no mesh file {path}")
    try:
        return _read_abaqus(path) if path.suffix.lower() == ".inp" else _read_by_meshio(path)
    except RequestError:
        raise
    except (Exception, SystemExit) as error:  # meshio leaves so where it cannot read, and has no error of its own
        why = " ".join(str(error).split()) if isinstance(error, Exception) else ""
        raise RequestError(
            f"the mesh file {path} cannot be read as {path.suffix or 'a mesh'}{': ' + why if why else ''}; give .inp "
            "of Abaqus or CalculiX, .bdf of Nastran, .msh of Gmsh, or .vtu"
        ) from error


def _read_by_meshio(path: Path) -> MeshFile:
    import meshio  # where there is a mesh, and not with every start

    with (
        warnings.catch_warnings(),
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(io.StringIO()),
    ):
        warnings.simplefilter("ignore")
        mesh: Any = (
            meshio.read(_whole_nastran(path), "nastran")
            if path.suffix.lower() in (".bdf", ".nas", ".fem")
            else meshio.read(path)
        )
    own = getattr(mesh, "cells_id", None) or [np.arange(len(each.data)) + 1 for each in mesh.cells]
    blocks = [Block(each.type, np.asarray(each.data), ids) for each, ids in zip(mesh.cells, own, strict=True)]
    node_sets = {name: np.asarray(found) for name, found in mesh.point_sets.items()}
    for name, data in mesh.point_data.items():
        if np.issubdtype(data.dtype, np.integer) and data.ndim == 1:
            node_sets.setdefault(name, np.flatnonzero(data))
    cell_sets = {
        name: [np.asarray([] if each is None else each, dtype=int) for each in found]
        for name, found in mesh.cell_sets.items()
        if name != "gmsh:bounding_entities"
    }
    return MeshFile(np.asarray(mesh.points, float), blocks, node_sets, _of_arrays(mesh) | cell_sets, {})


def _of_arrays(mesh: Any) -> dict[str, list[Indices]]:
    """Sets of elements by whole-numbered arrays of theirs, and the names that Gmsh gives to numbers."""
    found = {}
    for name, data in mesh.cell_data.items():
        if not all(np.issubdtype(each.dtype, np.integer) and each.ndim == 1 for each in data):
            continue
        found[name] = [np.flatnonzero(each) for each in data]
        for value in np.unique(np.concatenate(data)):
            label = f"PID {value}" if name == "nastran:ref" else f"{name} {value}"
            found[label] = [np.flatnonzero(each == value) for each in data]
    tags = mesh.cell_data.get("gmsh:physical")
    for name, (tag, dimension) in mesh.field_data.items() if tags else ():
        flat = [2 if each.type[:4] in ("tria", "quad") else 3 for each in mesh.cells]
        found[name] = [np.flatnonzero((each == tag) & (at == dimension)) for each, at in zip(tags, flat, strict=True)]
    return found


def _whole_nastran(path: Path) -> io.StringIO:
    """The bulk data without comments, between the two lines that meshio asks for and Gmsh leaves out."""
    lines = [
        line.partition("$")[0].rstrip() for line in path.read_text(encoding="utf-8", errors="replace").splitlines()
    ]
    starts = [k + 1 for k, line in enumerate(lines) if line.upper().startswith("BEGIN BULK")]
    bulk = [line for line in lines[starts[0] if starts else 0 :] if line and not line.upper().startswith("ENDDATA")]
    return io.StringIO("\n".join(["BEGIN BULK", *bulk, "ENDDATA", ""]))


def _read_abaqus(path: Path) -> MeshFile:
    """Nodes, elements, and sets; meshio mistakes the sets of a file with several blocks of elements."""
    points: list[list[float]] = []
    index: dict[int, int] = {}
    blocks: list[Block] = []
    nodes, elements, faces = {}, {}, {}  # by the names of sets: nodes' indices, elements' numbers, (number, face)
    for keyword, options, rows in _abaqus_cards(path):
        if keyword == "NODE":
            if options.get("SYSTEM", "R").upper() != "R":
                raise RequestError(
                    f"{path}: *NODE, SYSTEM={options['SYSTEM']} gives places in cylindrical or spherical coordinates, "
                    "which are not read; write x, y, z"
                )
            for row in rows:
                index[int(row[0])] = len(points)
                points.append([float(x or 0) for x in (row[1:4] + ["0"] * 3)[:3]])
        elif keyword == "ELEMENT":
            if "TYPE" not in options:
                raise RequestError(f"{path}: a card *ELEMENT has no TYPE; add it, such as *ELEMENT, TYPE=C3D10")
            try:
                block = _abaqus_block(options["TYPE"].upper(), rows, index)
            except KeyError as error:
                reason = f"an element has the node {error}, which no card *NODE before it gives; add its place"
                raise RequestError(f"{path}: {reason}") from None
            if block is not None:
                blocks.append(block)
                elements.setdefault(options.get("ELSET", "").upper(), []).extend(block.numbers.tolist())
        elif keyword == "NSET":
            nodes.setdefault(options["NSET"].upper(), []).extend(_members(rows, options, nodes, index))
        elif keyword == "ELSET":
            elements.setdefault(options["ELSET"].upper(), []).extend(_members(rows, options, elements, None))
        elif keyword == "SURFACE" and options.get("TYPE", "ELEMENT").upper() == "NODE":
            nodes[options["NAME"].upper()] = _members([row[:1] for row in rows], {}, nodes, index)
        elif keyword == "SURFACE":
            each = [(number, row[1].upper()) for row in rows for number in _members([row[:1]], {}, elements, None)]
            faces[options["NAME"].upper()] = each
        elif keyword == "INSTANCE" and (rows or (len(points) and "PART" not in options)):
            raise RequestError(f"{path} moves instances of parts, which is not read; write one flat mesh")
    if len(index) < len(points):
        raise RequestError(f"{path} numbers nodes anew, as several parts do, which is not read; write one flat mesh")
    elements.pop("", None)
    return MeshFile(
        np.array(points).reshape(-1, 3),
        blocks,
        {name: np.array(found, dtype=int) for name, found in nodes.items()},
        {name: [np.flatnonzero(np.isin(each.numbers, found)) for each in blocks] for name, found in elements.items()},
        {name: _corners_of(blocks, found) for name, found in faces.items()},
    )


def _abaqus_cards(path: Path) -> Iterator[tuple[str, dict[str, str], list[list[str]]]]:
    """Keyword, options and rows of each card; an included file stands where it is asked for."""
    cards: list[tuple[str, dict[str, str], list[list[str]]]] = []
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        if line.startswith("**") or not line.strip():
            continue
        if line.startswith("*"):
            keyword, *options = (each.strip() for each in line[1:].split(","))
            pairs = (each.partition("=") for each in options)
            cards.append((keyword.upper(), {k.strip().upper(): v.strip(' "') for k, _, v in pairs}, []))
        elif cards:
            cards[-1][2].append([each.strip() for each in line.rstrip().rstrip(",").split(",")])
    for keyword, options, rows in cards:
        if keyword == "INCLUDE":
            yield from _abaqus_cards(path.parent / options["INPUT"])
        else:
            yield keyword, options, rows


def _abaqus_block(name: str, rows: list[list[str]], index: dict[int, int]) -> Block | None:
    """Elements of one card; None of what is neither solid nor face."""
    match = ABAQUS_TYPE.match(name)
    if match is None:
        return None
    solid, count = match[1] == "C3D", 6 if name == "STRI65" else int(match[2])
    kind = (ABAQUS_SOLIDS if solid else ABAQUS_FACES).get(count, f"element of type {name}")
    if kind.startswith("element"):
        return Block(kind, np.zeros((1, 0), dtype=int), np.zeros(1, dtype=int)) if solid else None
    flat = np.array([int(each) for row in rows for each in row if each]).reshape(-1, count + 1)
    return Block(kind, np.array([[index[node] for node in row] for row in flat[:, 1:].tolist()]), flat[:, 0])


def _members(rows: Any, options: dict[str, str], sets: dict[str, list[int]], index: dict[int, int] | None) -> list[int]:
    """What a set holds: numbers, ranges of them (GENERATE) or other sets."""
    found: list[int] = []
    for row in rows:
        if "GENERATE" in options:
            first, last, step = (int(each) for each in [*row, "1"][:3])
            row = range(first, last + 1, step)
        for each in row:
            if isinstance(each, str) and not each.lstrip("-").isdigit():
                found.extend(sets[each.strip('"').upper()] if each else [])
            else:
                found.append(int(each) if index is None else index[int(each)])
    return found


def _corners_of(blocks: list[Block], faces: list[tuple[int, str]]) -> list[tuple[int, ...]]:
    """Corners of faces that are named by an element's number and S1 to S6."""
    found = []
    for block in blocks:
        table = {"tetra": TET_FACES, "hexah": HEX_FACES}.get(block.kind[:5])
        if table is not None:
            place = {number: k for k, number in enumerate(block.numbers.tolist())}
            found += [
                tuple(block.cells[place[number], list(table[int(face[1:]) - 1])].tolist())
                for number, face in faces
                if number in place
            ]
    return found
