"""Stiffness, mass and lowest modes of a solid mesh of several materials."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.dissection import elimination_order
from drumsqueal.physics.bodies.elements import assemble, lowest_modes
from drumsqueal.physics.bodies.solid_mesh import SolidMesh

Reals = NDArray[np.float64]

MOST_UNKNOWNS = 240_000  # 194 000 of a long shoe take two minutes and 5 GB on one core
EXPECTED = 20  # modes asked for at first
EVERYWHERE = ""  # the name of what no other set holds


class Material(NamedTuple):
    """Young's modulus E (Pa), Poisson's ratio and density (kg/m³)."""

    young: float
    poisson: float
    density: float


Materials = Mapping[str, Material]


class Inertia(NamedTuple):
    """Mass (kg), centre of gravity (3,) in m, and the tensor of inertia about it (3, 3) in kg m²."""

    mass: float
    centre: Reals
    tensor: Reals


class Solved(NamedTuple):
    """Frequencies (m,) in Hz, shapes (m, n, 3) at the mesh's nodes in kg^-½, and the whole mesh's inertia."""

    frequencies: Reals
    shapes: Reals
    inertia: Inertia


def solve_free_solid(mesh: SolidMesh, materials: Materials, highest_hz: float) -> Solved:
    """Elastic modes of a mesh that nothing holds, orthogonal to rigid motions, whose shapes have unit modal mass.

    Up to 0 Hz there are none.
    """
    stiffness, mass = _matrices(mesh, materials)
    if highest_hz <= 0:
        rigid = rigid_motions(mesh.points)
        return Solved(np.zeros(0), np.zeros((0, *mesh.points.shape)), inertia_of(rigid.T @ (mass @ rigid)))
    values, vectors = lowest_modes(stiffness, mass, _squared(highest_hz), 6, EXPECTED, _order(mesh, mass))
    rigid = rigid_motions(mesh.points)
    inner = rigid.T @ (mass @ rigid)
    elastic = vectors - rigid @ np.linalg.solve(inner, rigid.T @ (mass @ vectors))
    elastic /= np.sqrt(np.sum(elastic * (mass @ elastic), axis=0))
    return Solved(_hertz(values), elastic.T.reshape(len(values), *mesh.points.shape), inertia_of(inner))


def solve_clamped_solid(mesh: SolidMesh, materials: Materials, clamped_set: str, highest_hz: float) -> Solved:
    """Modes of a mesh that is clamped at the nodes of a set."""
    stiffness, mass = _matrices(mesh, materials)
    free = np.ones((len(mesh.points), 3), dtype=bool)
    free[mesh.nodes_of(clamped_set)] = False
    kept = np.flatnonzero(free.ravel())
    order = _order(mesh, mass)
    place = np.cumsum(free.ravel()) - 1  # of an unknown among those that are kept
    order = place[order[free.ravel()[order]]]
    values, vectors = lowest_modes(
        stiffness[kept][:, kept], mass[kept][:, kept], _squared(highest_hz), 0, EXPECTED, order
    )
    whole = np.zeros((free.size, len(values)))
    whole[kept] = vectors
    rigid = rigid_motions(mesh.points)
    inertia = inertia_of(rigid.T @ (mass @ rigid))
    return Solved(_hertz(values), whole.T.reshape(len(values), *mesh.points.shape), inertia)


def _matrices(mesh: SolidMesh, materials: Materials) -> tuple[Any, Any]:
    unknowns = 3 * len(mesh.points)
    if unknowns > MOST_UNKNOWNS:
        raise RequestError(
            f"the mesh has {unknowns} unknowns with nodes in the middles of edges, and at most {MOST_UNKNOWNS} are "
            "solved for; give a coarser mesh"
        )
    return assemble(mesh.points, mesh.cells, mesh.kind, *_of_elements(mesh, materials))


def _order(mesh: SolidMesh, mass: Any) -> Any:
    """The order in which unknowns are eliminated, those of a node together."""
    nodes = elimination_order(mesh.points, mass[::3][:, ::3].tocsr())
    return (3 * nodes[:, None] + np.arange(3)).ravel()


def masses_of(mesh: SolidMesh, materials: Materials) -> Reals:
    """Mass of each element (e,), in kg."""
    return _of_elements(mesh, materials)[2] * mesh.volumes


def _of_elements(mesh: SolidMesh, materials: Materials) -> Reals:
    """E, ν and ρ of each element (3, e); `materials` are by sets of elements, and by "" for those in none of them."""
    found = np.full((3, len(mesh.cells)), np.nan)
    for name, material in materials.items():
        if not (material.young > 0 and material.density > 0 and -1 < material.poisson < 0.5):
            raise RequestError(f"no such material: {material}; E and ρ are positive, and ν is between -1 and 0.5")
        if name != EVERYWHERE:
            members = mesh.elements_of(name)
            if not np.all(np.isnan(found[0, members])):
                raise RequestError(
                    f"elements of the set {name} are of two materials; let their sets have none in common"
                )
            found[:, members] = np.array(material)[:, None]
    bare = np.isnan(found[0])
    if EVERYWHERE in materials:
        found[:, bare] = np.array(materials[EVERYWHERE])[:, None]
    elif np.any(bare):
        raise RequestError(
            f"{np.sum(bare)} elements of the mesh have no material, the first is number "
            f"{mesh.numbers[np.argmax(bare)]}; give one to a set that holds them"
        )
    return found


def rigid_motions(points: Reals) -> Reals:
    """Three displacements and three turns about the origin of points (n, 3): (3n, 6)."""
    motions = np.zeros((len(points), 3, 6))
    motions[:, :, :3] = np.eye(3)
    motions[:, :, 3:] = np.cross(np.eye(3)[None], points[:, None, :]).transpose(0, 2, 1)
    return motions.reshape(-1, 6)


def inertia_of(inner: Reals) -> Inertia:
    """From inner products of the rigid motions by mass, which the shape functions hold exactly."""
    mass = inner[0, 0]
    x, y, z = centre = np.array([inner[1, 5], inner[2, 3], inner[0, 4]]) / mass
    across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return Inertia(float(mass), centre, inner[3:, 3:] + mass * across @ across)


def _squared(hertz: float) -> float:
    return (2 * np.pi * hertz) ** 2


def _hertz(values: Reals) -> Reals:
    return np.sqrt(values) / (2 * np.pi)
