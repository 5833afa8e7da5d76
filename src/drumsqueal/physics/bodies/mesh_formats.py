"""Meshes of any format: our own readers of those that are common, and meshio for the others."""

import contextlib
import io
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.abaqus_mesh import read_abaqus
from drumsqueal.physics.bodies.gmsh_mesh import read_gmsh
from drumsqueal.physics.bodies.mesh_files import Element, MeshFile
from drumsqueal.physics.bodies.nastran_mesh import read_nastran

# meshio reads all of these, too, and passes over what it does not know of them.
READERS = {
    ".inp": read_abaqus,
    ".msh": read_gmsh,
    **dict.fromkeys((".bdf", ".nas", ".fem"), read_nastran),
}
VTK = (".vtu", ".vtk")  # in which nothing is passed over but cells of unknown types, and that it says


def read_mesh_file(path: Path) -> MeshFile:
    """Read .inp, .bdf and .msh by ourselves, and any other format that meshio reads by it.

    A whole-numbered array by name (as in VTU) is the set of where it is not zero, and "name 3" where it is 3; of
    Nastran, "PID 3" are the elements of property 3. Raises RequestError.
    """
    if not path.is_file():
        raise RequestError(f"there is no mesh file {path}")
    try:
        return READERS.get(path.suffix.lower(), _read_by_meshio)(path)
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
    notes = () if path.suffix.lower() in VTK else (passed,)
    return MeshFile(np.asarray(mesh.points, float), elements, node_sets, element_sets, {}, (path,), notes)


def _of_arrays(arrays: dict[str, Any], values: bool) -> dict[str, Any]:
    """Sets by whole-numbered arrays: of where they are not zero and, if asked for, of where they have each value."""
    found = {}
    for name, data in arrays.items():
        if np.issubdtype(data.dtype, np.integer) and data.ndim == 1:
            found[name] = np.flatnonzero(data)
            found |= {f"{name} {value}": np.flatnonzero(data == value) for value in np.unique(data) if values}
    return found
