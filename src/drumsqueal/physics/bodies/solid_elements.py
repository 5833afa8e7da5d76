"""Stiffness, mass and lowest modes of a solid mesh of several materials."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.linalg import get_blas_funcs, get_lapack_funcs

from drumsqueal.errors import RequestError
from drumsqueal.interpreter import one_thread
from drumsqueal.physics.bodies.elements import SMALL_SHIFT, Indices, Reals, assemble, lowest_modes
from drumsqueal.physics.bodies.solid_mesh import SolidMesh

# Cholesky's factors of a sparse positive definite matrix, block by block, for many right-hand sides.
#
# Multifrontal: each block is eliminated in a dense matrix of its own unknowns and of those later ones that it touches,
# and what is left of these goes on to the first block that holds one. Blocks come of halving a mesh, and each half in
# turn, by thin cuts that are eliminated last: so halves do not fill each other in. All work is LAPACK's and BLAS's: of
# a shoe with 124 000 unknowns, SuperLU takes 2.8 times as long to factorise it, and 20 times for each of 30 right-hand
# sides. Only SciPy's BLAS is called: that of NumPy has threads of its own, and each waits for the other's.


(potrf,) = get_lapack_funcs(("potrf",))
trsm, syrk, gemm = get_blas_funcs(("trsm", "syrk", "gemm"))


def factorised_by_blocks(matrix: Any, blocks: Sequence[Indices]) -> Callable[[Reals], Reals]:
    """What answers loads (n,) or (n, m) on a sparse matrix (n, n), by its factors.

    Its unknowns are eliminated in the order of blocks, each in one of them. Raises ArithmeticError where it is not
    positive definite.
    """
    order = np.concatenate(blocks)
    parts: list[tuple[slice, Indices, Reals, Reals]] = []
    columns = matrix[order][:, order].tocsc()
    sizes = [len(block) for block in blocks]
    owner = np.repeat(np.arange(len(blocks)), sizes)
    left: list[list[tuple[Indices, Reals]]] = [[] for _ in blocks]
    for k, (end, size) in enumerate(zip(np.cumsum(sizes).tolist(), sizes, strict=True)):
        border, front = _front(columns[:, end - size : end], end, left[k])
        left[k] = []
        factor, wrong = potrf(front[:size, :size], lower=1)
        if wrong:
            raise ArithmeticError("the matrix is not positive definite: round-off is larger than what is added to it")
        below = trsm(1.0, factor, front[size:, :size], side=1, lower=1, trans_a=1)
        if len(border):
            rest = syrk(-1.0, below, beta=1.0, c=front[size:, size:], lower=1)
            left[owner[border[0]]].append((border, rest))
        parts.append((slice(end - size, end), border, factor, below))

    def solve(loads: Reals) -> Reals:
        x = np.asfortranarray(loads[order].reshape(len(loads), -1), dtype=float)
        for own, border, factor, below in parts:
            x[own] = trsm(1.0, factor, x[own], lower=1)
            x[border] -= gemm(1.0, below, x[own])
        for own, border, factor, below in reversed(parts):
            rest = gemm(-1.0, below, x[border], trans_a=1, beta=1.0, c=x[own])
            x[own] = trsm(1.0, factor, rest, lower=1, trans_a=1)
        found = np.empty_like(x)
        found[order] = x
        return found.reshape(loads.shape)

    return solve


def _front(columns: Any, end: int, left: Sequence[tuple[Indices, Reals]]) -> tuple[Indices, Reals]:
    """Unknowns from `end` on that a block before it touches, and the dense matrix of both, of which half is filled."""
    size, rows = columns.shape[1], columns.indices
    border = np.unique(np.concatenate([rows[rows >= end], *(later[later >= end] for later, _ in left)]))
    places = np.concatenate([np.arange(end - size, end), border])
    front = np.zeros((len(places), len(places)), order="F")
    inside = rows >= end - size
    column = np.repeat(np.arange(size), np.diff(columns.indptr))[inside]
    front[np.searchsorted(places, rows[inside]), column] = columns.data[inside]
    for later, rest in left:
        at = np.searchsorted(places, later)
        front.T[at[:, None], at] += rest.T  # along rows of what lies in memory by columns: 2.4 times as fast
    return border, front


def _elimination_blocks(points: Reals, graph: Any) -> list[Indices]:
    """An order of points in blocks, by their places (n, 3) and the sparse matrix (n, n) of which touches which.

    Cuts are across the longest extent along the arc, the radius and z; those between elements, which hold the fewest
    nodes, are looked for.
    """
    r = np.hypot(points[:, 0], points[:, 1])
    places = np.stack([np.mean(r) * np.arctan2(points[:, 1], points[:, 0]), r, points[:, 2]], axis=1)
    blocks = _divided(np.arange(len(points)), places, graph, np.full(len(points), -1, dtype=np.int8))
    return [block for block in blocks if len(block)]


def _divided(nodes: Indices, places: Any, graph: Any, side: Any) -> list[Indices]:
    """Two halves, each divided in turn, and last the cut: what of the first half touches the second."""
    best = None
    if len(nodes) > 60:  # fewer are not divided further
        along = places[nodes][:, np.argmax(np.ptp(places[nodes], axis=0))]
        # Where the nodes may be divided: the thinnest cut is taken.
        for cut in np.unique(np.quantile(along, (0.4, 0.44, 0.47, 0.5, 0.53, 0.56, 0.6), method="nearest")):
            first = along <= cut + 1e-6 * np.ptp(along)  # of the extent: nodes no further apart are of one layer
            touches = _touching(nodes, first, graph, side)
            if not first.all() and not touches.all() and (best is None or touches.sum() < best[1].sum()):
                best = first, touches
    if best is None:
        return [nodes]
    first, touches = nodes[best[0]], best[1]
    halves = (first[~touches], nodes[~best[0]])
    return [*(part for half in halves for part in _divided(half, places, graph, side)), first[touches]]


def _touching(nodes: Indices, first: Any, graph: Any, side: Any) -> Any:
    """Which nodes of the first half touch one of the second. `side` is -1 everywhere, and again so afterwards."""
    side[nodes] = first
    rows = graph[nodes[first]]
    found = np.zeros(rows.shape[0], dtype=bool)
    found[np.repeat(np.arange(len(found)), np.diff(rows.indptr))[side[rows.indices] == 0]] = True
    side[nodes] = -1
    return found


MOST_UNKNOWNS = 240_000  # 149 000 of a shoe take 45 s and 3 GB on one core
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


def solve_solid(
    mesh: SolidMesh,
    materials: Materials,
    highest_hz: float,
    loads: Reals | None = None,
    clamped_set: str | None = None,
) -> Solved:
    """Elastic modes of a mesh that nothing holds, or that is clamped at the nodes of a set; they have unit modal mass.

    Those of a free mesh are orthogonal to rigid motions. Loads (3n, r) add what their nearly static answers hold beyond
    those, after them. Up to 0 Hz there is none.
    """
    stiffness, mass = _matrices(mesh, materials)
    rigid = rigid_motions(mesh.points)
    inner, free = rigid.T @ (mass @ rigid), np.ones(mesh.points.shape, dtype=bool)
    if highest_hz <= 0:
        return Solved(np.zeros(0), np.zeros((0, *mesh.points.shape)), inertia_of(inner))
    if clamped_set is None:
        rigid, expected = rigid @ np.linalg.inv(np.linalg.cholesky(inner)).T, 10  # a shoe has four up to 10 kHz
    else:
        free[mesh.nodes_of(clamped_set)] = False
        rigid, expected = rigid[:, :0], 20  # a drum has pairs of all
    blocks, free, highest = _blocks(mesh, mass), free.ravel(), (2 * np.pi * highest_hz) ** 2
    if not np.all(free):
        place = np.cumsum(free) - 1  # of an unknown among those that are free
        blocks = [own for block in blocks if len(own := place[block[free[block]]])]
        stiffness, mass, rigid = stiffness[free][:, free], mass[free][:, free], rigid[free]
    with one_thread():
        solve = factorised_by_blocks(stiffness + SMALL_SHIFT * highest * mass, blocks)
        loads = None if loads is None else loads[free]
        values, vectors = lowest_modes(stiffness, mass, highest, rigid, expected, solve, loads)
    whole = np.zeros((len(free), len(values)))
    whole[free] = vectors
    shapes = whole.T.reshape(len(values), *mesh.points.shape)
    return Solved(np.sqrt(values) / (2 * np.pi), shapes, inertia_of(inner))


def _matrices(mesh: SolidMesh, materials: Materials) -> tuple[Any, Any]:
    unknowns = 3 * len(mesh.points)
    if unknowns > MOST_UNKNOWNS:
        raise RequestError(
            f"the mesh has {unknowns} unknowns with nodes in the middles of edges, and at most {MOST_UNKNOWNS} are "
            "solved for; give a coarser mesh"
        )
    stiffness, mass = assemble(mesh.points, mesh.cells, mesh.kind, *_of_elements(mesh, materials))
    return stiffness, mass + sparse.dia_array((np.repeat(mesh.point_masses, 3)[None], [0]), shape=mass.shape).tocsr()


def _blocks(mesh: SolidMesh, mass: Any) -> list[Any]:
    """Blocks of unknowns in the order in which they are eliminated, those of a node together."""
    blocks = _elimination_blocks(mesh.points, mass[::3][:, ::3].tocsr())
    return [(3 * nodes[:, None] + np.arange(3)).ravel() for nodes in blocks]


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
