"""A shoe or drum that is given as a mesh of solid elements: what it must be, its parts and its surfaces."""

import contextlib
import io
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.abaqus_mesh import read_abaqus
from drumsqueal.physics.bodies.elements import REFERENCES, Indices, Reals, jacobians, quadrature
from drumsqueal.physics.bodies.gmsh_mesh import read_gmsh
from drumsqueal.physics.bodies.mesh_files import FACES, MASS_UNITS, USUAL_MASS, Element, MeshFile
from drumsqueal.physics.bodies.nastran_mesh import read_nastran

# Meshes of any format: our own readers of those that are common, and meshio for the others.


def _read_mesh_file(path: Path) -> MeshFile:
    """Read .inp, .bdf and .msh by ourselves, and any other format that meshio reads by it.

    A whole-numbered array by name (as in VTU) is the set of where it is not zero, and "name 3" where it is 3; of
    Nastran, "PID 3" are the elements of property 3. Raises RequestError.
    """
    # meshio reads all of these, too, and passes over what it does not know of them.
    readers = {
        ".inp": read_abaqus,
        ".msh": read_gmsh,
        **dict.fromkeys((".bdf", ".nas", ".fem"), read_nastran),
    }
    if not path.is_file():
        raise RequestError(f"there is no mesh file {path}")
    try:
        return readers.get(path.suffix.lower(), _read_by_meshio)(path)
    except RequestError:
        raise
    except (Exception, SystemExit) as error:  # meshio leaves so where it cannot read, and has no error of its own
        why = " ".join(str(error).split()) if isinstance(error, Exception) else ""
        raise RequestError(
            f"the mesh file {path} cannot be read as {path.suffix or 'a mesh'}{': ' + why if why else ''}; its ending "
            "decides how it is read: give .inp of Abaqus or CalculiX, .bdf of Nastran, .msh of Gmsh, or .vtu"
        ) from error


def _read_by_meshio(path: Path) -> MeshFile:
    import meshio  # where there is a mesh, and not with every start

    said = io.StringIO()
    with warnings.catch_warnings(), contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        warnings.simplefilter("ignore")
        mesh: Any = meshio.read(path)
    if said.getvalue().strip():
        raise ValueError(said.getvalue())
    elements = [
        Element(each.type, nodes, number, each.type)
        for each in mesh.cells
        for number, nodes in enumerate(each.data.tolist(), start=1)
    ]
    if any(not 0 <= node < len(mesh.points) for each in elements for node in each.nodes):
        raise ValueError("elements have nodes that have no place")
    if any(np.any(each) for each in mesh.cell_data.get("vtkGhostType", ())):
        raise ValueError("it holds elements twice, as ghosts of other parts (vtkGhostType)")
    node_sets = _of_arrays(mesh.point_data, False) | mesh.point_sets
    starts = np.cumsum([0, *(len(each) for each in mesh.cells)])
    element_sets = _of_arrays({name: np.concatenate(data) for name, data in mesh.cell_data.items()}, True)
    for name, found in mesh.cell_sets.items():
        pairs = zip(found, starts, strict=False)
        element_sets[name] = np.concatenate([[] if each is None else np.asarray(each) + start for each, start in pairs])
    passed = f"{path}: what meshio does not know of {path.suffix} it passes over without a word; compare the mass"
    # In these nothing is passed over but cells of unknown types, and that it says.
    notes = () if path.suffix.lower() in (".vtu", ".vtk") else (passed,)
    return MeshFile(np.asarray(mesh.points, float), elements, node_sets, element_sets, {}, (path,), notes)


def _of_arrays(arrays: dict[str, Any], values: bool) -> dict[str, Any]:
    """Sets by whole-numbered arrays: of where they are not zero and, if asked for, of where they have each value."""
    found = {}
    for name, data in arrays.items():
        if np.issubdtype(data.dtype, np.integer) and data.ndim == 1:
            found[name] = np.flatnonzero(data)
            found |= {f"{name} {value}": np.flatnonzero(data == value) for value in np.unique(data) if values}
    return found


UNITS = {"m": 1.0, "dm": 0.1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "ft": 0.3048}
SURFACE, SOLID = 2, 3  # dimensions
SECOND_ORDER = {"tetra": "tetra10", "hexahedron": "hexahedron20"}


class SolidMesh(NamedTuple):
    """Second-order elements (e, a) of one kind between points (n, 3) in m, and named sets.

    `numbers` (e,) are the file's own. Corners of faces are sorted within each. Those of first order have got nodes in
    the middle of their straight edges. `counts` are how many elements there are by the file's own names of types,
    `files` what was read, and `notes` what was passed over. `point_masses` are at each of the points (n,), in kg.
    """

    points: Reals
    cells: Indices
    kind: str
    numbers: Indices
    node_sets: dict[str, Indices]
    element_sets: dict[str, Indices]
    face_sets: dict[str, Indices]
    counts: dict[str, int]
    files: tuple[Path, ...]
    notes: tuple[str, ...]
    point_masses: Reals

    @property
    def volumes(self) -> Reals:
        """Of each element (e,), in m³."""
        _, weights, _, slopes = quadrature(self.kind)
        return np.linalg.det(jacobians(self.points[self.cells], slopes)) @ weights

    def elements_of(self, name: str) -> Indices:
        """Which elements a set holds."""
        return _named(self.element_sets, self._written(name), "set of solid elements")

    def nodes_of(self, name: str) -> Indices:
        """Nodes of a set of nodes, or all those of the faces of a set of faces."""
        name = self._written(name)
        if name in self.node_sets and name not in self.face_sets:
            return self.node_sets[name]
        elements, faces = self.faces_of(name)
        return np.unique(np.concatenate([self.nodes_of_face(e, f) for e, f in zip(elements, faces, strict=True)]))

    def nodes_of_face(self, element: int, face: int) -> Indices:
        """All nodes on an element's face: what has its plane's place in the reference element."""
        reference = REFERENCES[self.kind]
        first, second, last = reference.nodes[[reference.faces[face][k] for k in (0, 1, -1)]]
        normal = np.cross(second - first, last - first)
        return self.cells[element, np.abs((reference.nodes - first) @ normal) < 1e-9]

    def faces_of(self, name: str) -> tuple[Indices, Indices]:
        """Elements (f,) and faces (f,) of the boundary in a set of faces, or with all corners in a set of nodes."""
        elements, faces, corners = self.boundary()
        name = self._written(name)
        if name in self.face_sets:
            wanted = {tuple(each) for each in self.face_sets[name].tolist()}
            held = np.array([tuple(each) in wanted for each in corners.tolist()], dtype=bool)
        else:
            nodes = _named(self.node_sets, name, "set of faces or of nodes", {**self.face_sets, **self.node_sets})
            held = np.all(np.isin(corners, nodes), axis=1)
        if not np.any(held):
            raise RequestError(f"the set {name} holds no face of the boundary; name the faces, or all their nodes")
        return elements[held], faces[held]

    def _written(self, name: str) -> str:
        """A set's name as it is known here: those of Abaqus are in capitals."""
        known = name in self.node_sets or name in self.element_sets or name in self.face_sets
        return name if known else name.upper()

    def faces(self) -> tuple[Indices, Indices]:
        """Sorted corners of each face of each element (e f, 3 or 4), and how many elements have that face (e f,)."""
        corners = np.sort(self.cells[:, np.array(REFERENCES[self.kind].faces)], axis=2)
        corners = corners.reshape(-1, corners.shape[2])
        _, same, times = np.unique(corners, axis=0, return_inverse=True, return_counts=True)
        return corners, times[same.ravel()]

    def boundary(self) -> tuple[Indices, Indices, Indices]:
        """Elements and faces (f,) that one element alone has, with their sorted corners (f, 3 or 4)."""
        corners, times = self.faces()
        alone = np.flatnonzero(times == 1)
        return *divmod(alone, len(REFERENCES[self.kind].faces)), corners[alone]


def read_solid_mesh(path: str | Path, unit: str, mass_unit: str = "auto") -> SolidMesh:
    """Read a mesh of tetrahedra or hexahedra, whose lengths are in a unit such as "mm".

    Point masses are in kg or t; "auto" for kg with m and t with mm. Raises RequestError where it cannot be read,
    is of no such elements, or where some are inverted or unconnected.
    """
    if unit not in UNITS:
        raise RequestError(f"a mesh's unit of length is one of {', '.join(UNITS)}, and not {unit!r}")
    if mass_unit not in ("auto", *MASS_UNITS):
        raise RequestError(f"a mesh's unit of mass is one of auto, {', '.join(MASS_UNITS)}, and not {mass_unit!r}")
    file = _read_mesh_file(Path(path))
    solids = [each for each in file.elements if each.dimension == SOLID]
    kinds, known = {each.kind for each in solids}, {*SECOND_ORDER, *REFERENCES}
    if len(kinds) != 1 or not kinds <= known:
        there = ", ".join(sorted(kinds or {each.kind for each in file.elements})) or "no elements"
        what = "holds no solid elements but" if not kinds else "holds"
        raise RequestError(f"the mesh {path} {what} {there}; it must be all of one kind: {', '.join(sorted(known))}")
    mesh = _compact(file, solids, UNITS[unit], path)
    _check(mesh, path)
    mass_unit = USUAL_MASS.get(unit, "") if mass_unit == "auto" else mass_unit
    _check_skins(file, mesh.volumes.sum() / UNITS[unit] ** 3, unit, mass_unit)
    for each in (each for each in file.masses if each.mass and not mass_unit):
        known = " or ".join(f'"{each}"' for each in MASS_UNITS)
        raise each.refuse(f'{each.name}: no unit of mass follows from unit = "{unit}"; add mass_unit = {known}')
    return mesh._replace(point_masses=mesh.point_masses * MASS_UNITS.get(mass_unit, 1.0))


def _compact(file: MeshFile, solids: list[Element], factor: float, path: str | Path) -> SolidMesh:
    """The solid elements and their nodes alone, each once, made of second order."""
    cells, numbers = np.array([each.nodes for each in solids]), np.array([each.number for each in solids])
    kept, one = _once(cells, numbers, len(solids[0].corners), path)
    counts = Counter(solids[k].name for k in kept)
    counts.update(each.name for each in file.elements if each.dimension != SOLID)
    repeated = len(cells) - len(kept)
    again = (f"{path}: {repeated} elements repeat others by their nodes, and count once",) if repeated else ()
    table = FACES[solids[0].shape]
    notes = (*file.notes, *again, *_shells(file.elements, cells[:, np.array(table)], path))
    points, kind, cells = _second_order(file.points * factor, solids[0].kind, cells[kept])
    used = np.unique(cells)
    place = np.full(len(points), -1)
    place[used] = np.arange(len(used))
    members = (k for k, each in enumerate(file.elements) if each.dimension == SOLID)
    of_solid = dict(zip(members, one.tolist(), strict=True))
    element_sets, faces = {}, {}
    for name, held in file.element_sets.items():
        if inside := {of_solid[k] for k in held if k in of_solid}:
            element_sets[name] = np.array(sorted(inside))
        surfaces = (file.elements[k] for k in held if file.elements[k].dimension == SURFACE)
        faces[name] = [each.corners for each in surfaces]
    faces |= {name: found for name, found in file.face_sets.items() if found}
    face_sets = {name: _fitting(found, place, len(table[0])) for name, found in faces.items() if found}
    node_sets = {name: place[np.array(nodes, dtype=int)] for name, nodes in file.node_sets.items()}
    node_sets = {name: np.unique(nodes[nodes >= 0]) for name, nodes in node_sets.items()}
    sets, masses = (node_sets, element_sets, face_sets), np.zeros(len(used))
    for each in (each for each in file.masses if each.mass):
        if place[each.node] < 0:
            raise each.refuse(f"{each.name} is at a node of no solid element; put it at one of these, or leave it out")
        masses[place[each.node]] += each.mass
    return SolidMesh(points[used], place[cells], kind, numbers[kept], *sets, dict(counts), file.files, notes, masses)


def _fitting(faces: list[Sequence[int]], place: Indices, corners: int) -> Indices:
    """Faces by their sorted corners (n, 3 or 4), of those with as many as solids have; others are on none of them."""
    found = [sorted(place[[*face]].tolist()) for face in faces if len(face) == corners]
    return np.array(found, dtype=int).reshape(-1, corners)


def _once(cells: Indices, numbers: Indices, corners: int, path: str | Path) -> tuple[Indices, Indices]:
    """Which elements are the first of those between the same corners, and of each its place among them.

    Raises RequestError where two have the same corners and other nodes on their edges: one is within the other.
    """
    _, first, same = np.unique(np.sort(cells[:, :corners], axis=1), axis=0, return_index=True, return_inverse=True)
    same = same.ravel()
    wrong = np.any(np.sort(cells, axis=1) != np.sort(cells[first[same]], axis=1), axis=1)
    if np.any(wrong):
        k = int(np.argmax(wrong))
        raise RequestError(
            f"the mesh {path} has the elements {numbers[first[same[k]]]} and {numbers[k]} between the same corners, "
            "with other nodes on their edges; leave one of them out"
        )
    kept, place = np.unique(first, return_inverse=True)
    return kept, place.ravel()[same]


def _shells(elements: list[Element], faces: Indices, path: str | Path) -> Iterator[str]:
    """What is said of shells on faces of solids, which hold sets; raises RequestError of those that are bodies."""
    held = {tuple(each) for each in np.sort(faces, axis=2).reshape(-1, faces.shape[2]).tolist()}
    for name in dict.fromkeys(each.name for each in elements if each.weigh):
        shells = [each for each in elements if each.weigh and each.name == name]
        alone = [each for each in shells if tuple(sorted(each.corners)) not in held]
        if alone:
            raise RequestError(
                f"the mesh {path} has {len(alone)} {name} that are no faces of its solid elements, the first is "
                f"number {alone[0].number}; shells are not read, and mass would be missing: make them solid"
            )
        yield f"{path}: {len(shells)} {name} on faces of solids are taken as faces, without mass of their own"


def _check_skins(file: MeshFile, volume: float, unit: str, mass_unit: str) -> None:
    """Raise RequestError of surface elements that have too large a mass of their own in all, beside so much solid."""
    found = []
    for skin in file.skins:
        surfaces = [file.elements[k] for k in skin.members]
        once = {tuple(sorted(each.corners)): file.points[[*each.corners]] for each in surfaces}
        area = sum(np.linalg.norm(np.cross(each[2] - each[0], each[-1] - each[1])) for each in once.values()) / 2
        thick = [ply for ply in skin.plies if ply[0] and ply[1] != 0]
        found.append((area * sum(ply[0] for ply in thick), len(found), skin, len(once), thick))
    # Shells for stresses, whose mass is left out, have 1e-4 of the solid's volume at most.
    if sum(each[0] for each in found) > 1e-4 * volume:
        own, _, skin, count, thick = max(found)
        thickness = sum(ply[0] for ply in thick)
        area = own / thickness
        mass = area * sum(each * (np.nan if density is None else density) for each, density in thick)
        lost = "the file gives no density" if np.isnan(mass) else f"{mass:.4g} {mass_unit or 'units of the file'}"
        raise skin.refuse(
            f"{skin.name} gives {count} surface elements a thickness of {thickness:.6g} {unit}; their mass ({lost}) is "
            "not read: make them solid, or leave it out"
        )


def _second_order(points: Reals, kind: str, cells: Indices) -> tuple[Reals, str, Indices]:
    """The same solid with a node in the middle of each edge, where there was none."""
    if kind in REFERENCES:
        return points, kind, cells
    ends = np.sort(cells[:, np.array(REFERENCES[SECOND_ORDER[kind]].edges)], axis=2)
    pairs, number = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
    middles = len(points) + number.reshape(len(cells), -1)
    return (
        np.concatenate([points, points[pairs].mean(axis=1)]),
        SECOND_ORDER[kind],
        np.concatenate([cells, middles], axis=1),
    )


def _check(mesh: SolidMesh, path: str | Path) -> None:
    """Raise RequestError of nodes at no place, inverted elements, and solids that do not hang together."""
    lost = np.flatnonzero(~np.isfinite(mesh.points[mesh.cells]).all(axis=(1, 2)))
    if len(lost):
        raise RequestError(
            f"the mesh {path} has nodes whose coordinates are no finite numbers, the first is of element "
            f"{mesh.numbers[lost[0]]}; correct them"
        )
    volume = np.linalg.det(jacobians(mesh.points[mesh.cells], quadrature(mesh.kind)[3]))
    wrong = np.flatnonzero(np.any(volume <= 0, axis=1))
    if len(wrong):
        raise RequestError(
            f"the mesh {path} has {len(wrong)} inverted or degenerate of {len(mesh.cells)} elements, the first is "
            f"number {mesh.numbers[wrong[0]]}; mend it in the mesher, or check the order of its nodes"
        )
    crowded = np.flatnonzero(mesh.faces()[1] > 2) // len(REFERENCES[mesh.kind].faces)
    if len(crowded):
        raise RequestError(
            f"the mesh {path} has faces of more than two elements, the first is of element {mesh.numbers[crowded[0]]}; "
            "elements lie one within the other: leave those out that are there twice"
        )
    rows, columns = np.repeat(mesh.cells[:, 0], mesh.cells.shape[1]), mesh.cells.ravel()
    links = sparse.coo_array((np.ones(len(rows)), (rows, columns)), shape=(len(mesh.points),) * 2)
    parts, label = connected_components(links, directed=False)
    if parts > 1:
        sizes = np.sort(np.bincount(label[mesh.cells[:, 0]]))[::-1]
        raise RequestError(
            f"the mesh {path} is {parts} pieces that share no node, of {', '.join(map(str, sizes[:5]))} elements; "
            "merge the nodes that solids have twice where they touch"
        )


def _named(sets: dict[str, Indices], name: str, what: str, listed: dict[str, Indices] | None = None) -> Indices:
    """A set by its name, or raise RequestError with those that there are."""
    if name not in sets:
        there = ", ".join(sorted(sets if listed is None else listed)) or "none at all"
        raise RequestError(f"the mesh has no {what} named {name}; there are: {there}")
    return sets[name]
