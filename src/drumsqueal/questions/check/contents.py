"""What the meshes of a scene hold: elements by type, volume and mass by set, and where they are."""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from drumsqueal.findings.columns import Column
from drumsqueal.findings.schema import Finding
from drumsqueal.physics.bodies.solid_mesh import SolidMesh
from drumsqueal.physics.trial_shapes import meshes_of
from drumsqueal.scene import Scene

Reals = NDArray[np.float64]


class Amount(Finding):
    """How many solid elements there are, their volume, and their mass by the scene's densities."""

    elements: Annotated[int, Column("elements", "d")]
    volume_m3: Annotated[float, Column("volume", ".6g", unit="mm^3", factor=1e9, in_cells=True)]
    mass_kg: Annotated[float, Column("mass", ".6g", in_cells=True)]


class MeshContents(Finding):
    """What is read of a mesh: elements by the file's names of types, solid ones by set, and the bounding box.

    Point masses are counted by their nodes, and their mass is not in that of the whole.
    """

    body: str
    file: str
    elements_by_type: dict[str, int]
    whole: Amount
    point_masses: int
    point_masses_kg: float
    sets: dict[str, Amount]
    lowest_m: tuple[float, float, float]
    highest_m: tuple[float, float, float]
    notes: tuple[str, ...]


def mesh_contents(scene: Scene) -> tuple[MeshContents, ...]:
    """Take stock of each mesh that a scene names."""
    return tuple(_contents(*each) for each in meshes_of(scene))


def _contents(body: str, file: str, mesh: SolidMesh, masses: Reals) -> MeshContents:
    volumes, (low, high) = mesh.volumes, (extreme(mesh.points, axis=0).tolist() for extreme in (np.min, np.max))
    amounts = {
        name: Amount(
            elements=len(masses[held]), volume_m3=float(volumes[held].sum()), mass_kg=float(masses[held].sum())
        )
        for name, held in [("", slice(None)), *sorted(mesh.element_sets.items())]
    }
    return MeshContents(
        body=body,
        file=file,
        elements_by_type=mesh.counts,
        whole=amounts.pop(""),
        point_masses=int(np.count_nonzero(mesh.point_masses)),
        point_masses_kg=float(mesh.point_masses.sum()),
        sets=amounts,
        lowest_m=low,
        highest_m=high,
        notes=mesh.notes,
    )
