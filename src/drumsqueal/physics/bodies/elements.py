"""Second-order finite elements of a linear elastic solid: reference elements, stiffness and mass, lowest modes.

Nodes of an element are in the order of VTK. Displacements and geometry have the same shape functions.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from drumsqueal.interpreter import one_thread

Reals = NDArray[np.float64]
Indices = NDArray[np.int64]

INTEGRATED = 5  # the degree that quadrature is exact for: 27 points a hexahedron, full integration
AT_ONCE = 512  # elements whose matrices are made together, which bounds memory
# Of the highest eigenvalue: the factorised matrix is then positive definite and well conditioned, and answers to loads
# are nearly static. With 1 in its place, frequencies of a shoe on its lining come out some hundred times further off.
SMALL_SHIFT = 0.01
NOTHING = 1e-10  # of an answer to a load: how much of it round-off leaves where it is known
# Rigid motions are zero to round-off, or what is kept beside them is not known to any digit.
RIGID = 1e-3  # of the first elastic eigenvalue

TET_CORNERS = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
TET_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
HEX_CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))
HEX_EDGES = (
    *((0, 1), (1, 2), (2, 3), (3, 0)),
    *((4, 5), (5, 6), (6, 7), (7, 4)),
    *((0, 4), (1, 5), (2, 6), (3, 7)),
)
# The order of Abaqus, S1 to S6; a triangle of three corners or a quadrilateral of four, walked around.
TET_FACES = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))
HEX_FACES = ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0))
HEX_MIDDLES = ((0, 0.5, 0.5), (1, 0.5, 0.5), (0.5, 0, 0.5), (0.5, 1, 0.5), (0.5, 0.5, 0), (0.5, 0.5, 1), (0.5,) * 3)


class ReferenceElement(NamedTuple):
    """A reference element: its nodes (a, 3), edges and faces by their corners, and the name of scikit-fem's element."""

    nodes: Reals
    edges: tuple[tuple[int, int], ...]
    faces: tuple[tuple[int, ...], ...]
    element: str

    @property
    def corners(self) -> int:
        """How many of the nodes are corners."""
        return 4 if self.faces is TET_FACES else 8


def _with_edges(corners: Any, edges: Any) -> Reals:
    places = np.array(corners, dtype=float)
    return np.concatenate([places, places[np.array(edges)].mean(axis=1)])


REFERENCES = {
    "tetra10": ReferenceElement(_with_edges(TET_CORNERS, TET_EDGES), TET_EDGES, TET_FACES, "ElementTetP2"),
    "hexahedron20": ReferenceElement(_with_edges(HEX_CORNERS, HEX_EDGES), HEX_EDGES, HEX_FACES, "ElementHexS2"),
    "hexahedron27": ReferenceElement(
        np.concatenate([_with_edges(HEX_CORNERS, HEX_EDGES), HEX_MIDDLES]), HEX_EDGES, HEX_FACES, "ElementHex2"
    ),
}


def shapes_in(kind: str, places: Reals) -> tuple[Reals, Reals]:
    """Shape functions (a, q) of a kind of element at places (3, q) of the reference one, and slopes (a, 3, q)."""
    import skfem  # where a solid bends, and not with every start

    reference, element = REFERENCES[kind], getattr(skfem, REFERENCES[kind].element)()
    order = [int(np.argmin(np.linalg.norm(element.doflocs - node, axis=1))) for node in reference.nodes]
    found = [element.lbasis(places, number) for number in order]
    values, slopes = (
        np.stack([np.broadcast_to(each[k], (*(() if k == 0 else (3,)), places.shape[1])) for each in found])
        for k in (0, 1)
    )
    return values, slopes


@functools.cache
def quadrature(kind: str, degree: int = INTEGRATED) -> tuple[Reals, Reals, Reals, Reals]:
    """Places (3, q) and weights (q,) of the reference element, with shape functions (a, q) and slopes (a, 3, q)."""
    import skfem
    from skfem.quadrature import get_quadrature

    places, weights = get_quadrature(getattr(skfem, REFERENCES[kind].element), degree)
    return places, weights, *shapes_in(kind, places)


def jacobians(nodes: Reals, slopes: Reals) -> Reals:
    """∂x_i/∂X_j (e, q, i, j) of elements whose nodes are at (e, a, 3), by slopes (a, 3, q)."""
    return np.einsum("eai,ajq->eqij", nodes, slopes, optimize=True)


def assemble(
    points: Reals, cells: Indices, kind: str, young: Any = 1.0, poisson: Any = 0.3, density: Any = 1.0
) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Stiffness and mass of elements (e, a) between points (n, 3): u_x, u_y, u_z of a node after those before it.

    ∫ λ ∂_i u_i ∂_j v_j + G (∂_j u_i ∂_j v_i + ∂_j u_i ∂_i v_j) dV, λ = Eν/((1 + ν)(1 − 2ν)), G = E/(2(1 + ν)); each of
    E, ν and ρ is a number or one for each element (e,).
    """
    E, nu, rho = (np.broadcast_to(np.asarray(each, dtype=float), len(cells)) for each in (young, poisson, density))
    first, second = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    nodes = cells.shape[1]
    stiffness, mass = np.empty((len(cells), 3 * nodes, 3 * nodes)), np.empty((len(cells), nodes, nodes))
    for start in range(0, len(cells), AT_ONCE):
        part = slice(start, start + AT_ONCE)
        of_slopes, of_values = _products(points[cells[part]], kind)
        mass[part] = rho[part, None, None] * of_values
        stiffness[part] = _elastic(of_slopes, first[part], second[part])
    places = cells.astype(np.int32)
    of_components = (3 * places[:, :, None] + np.arange(3, dtype=np.int32)).reshape(len(places), -1)
    scalar = gather(mass, places, len(points))
    return gather(stiffness, of_components, 3 * len(points)), sparse.csr_array(sparse.kron(scalar, np.eye(3)))


def _products(nodes: Reals, kind: str) -> tuple[Reals, Reals]:
    """∫ ∂_i N_a ∂_j N_b dV (e, a, 3, b, 3) and ∫ N_a N_b dV (e, a, b)."""
    _, weights, values, slopes = quadrature(kind)
    jacobian = jacobians(nodes, slopes)
    volume = np.linalg.det(jacobian) * weights
    along = np.einsum("ajq,eqji->eaiq", slopes, np.linalg.inv(jacobian), optimize=True)
    elements, count = len(nodes), nodes.shape[1]
    flat = along.reshape(elements, 3 * count, -1)
    of_slopes = (flat * volume[:, None]) @ flat.transpose(0, 2, 1)
    return of_slopes.reshape(elements, count, 3, count, 3), (values * volume[:, None]) @ values.T


def _elastic(of_slopes: Reals, first: Reals, second: Reals) -> Reals:
    """Stiffness (e, 3a, 3a) by λ and G (e,)."""
    lam, G = (each[:, None, None, None, None] for each in (first, second))
    stiffness = lam * of_slopes + G * of_slopes.transpose(0, 1, 4, 3, 2)
    trace = np.trace(of_slopes, axis1=2, axis2=4)
    stiffness += G * trace[:, :, None, :, None] * np.eye(3)[:, None]
    size = 3 * of_slopes.shape[1]
    return stiffness.reshape(-1, size, size)


def gather(matrices: Reals, places: NDArray[np.int32], size: int) -> sparse.csr_array:
    """The sum of the elements' matrices (elements, a, a), whose rows and columns go to the places (elements, a)."""
    rows, columns = (np.broadcast_to(each, matrices.shape) for each in (places[:, :, None], places[:, None]))
    return sparse.coo_array((matrices.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size)).tocsr()


def factorised(stiffness: Any, mass: Any, highest: float) -> Callable[[Reals], Reals]:
    """What answers loads on K + SMALL_SHIFT the highest eigenvalue M."""
    shifted, how = (stiffness + SMALL_SHIFT * highest * mass).tocsc(), {"SymmetricMode": True}
    return splu(shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=how).solve


def lowest_modes(
    stiffness: Any,
    mass: Any,
    highest: float,
    rigid: Reals | None,
    expected: int,
    solve: Callable[[Reals], Reals],
    loads: Reals | None = None,
) -> tuple[Reals, Reals]:
    """Elastic eigenvalues up to the highest and their vectors (unknowns, n), of unit mass; the rigid are left out.

    After these what answers to loads (unknowns, r) add. Rigid motions (unknowns, 6 or fewer), from which all are apart,
    are of unit mass; None of a body that is held. `solve` answers loads as `factorised` does. Raises ArithmeticError
    where rigid motions do not come out at zero.
    """
    unknowns, shift = stiffness.shape[0], -SMALL_SHIFT * highest
    inverse = LinearOperator((unknowns, unknowns), solve, dtype=float)  # type: ignore[call-arg]
    start = np.random.default_rng(0).standard_normal(unknowns)  # the same every time
    first = 0 if rigid is None else rigid.shape[1]
    asked = first + expected + 2  # solutions asked for beyond those expected
    while True:
        asked = min(asked, unknowns - 1)
        with one_thread():
            values, vectors = eigsh(stiffness, asked, mass, sigma=shift, OPinv=inverse, v0=start)
        rising = np.argsort(values)
        values, vectors = values[rising], vectors[:, rising]
        if values[-1] > highest or asked == unknowns - 1:
            break
        asked *= 2
    if max(abs(values[:first]), default=0.0) > RIGID * values[first]:
        raise ArithmeticError("the shoe's first free mode is lost in round-off: it is too slender, or hinged")
    kept = slice(first, max(first, int(np.searchsorted(values, highest, side="right"))))
    values, vectors = values[kept], vectors[:, kept]
    if rigid is not None:
        vectors = vectors - rigid @ (rigid.T @ (mass @ vectors))
        vectors = vectors / np.sqrt(np.sum(vectors * (mass @ vectors), axis=0))
    if loads is None:
        return values, vectors
    known = vectors if rigid is None else np.hstack([rigid, vectors])
    more, shapes = residual_shapes(stiffness, mass, known, solve, loads)
    return np.concatenate([values, more]), np.hstack([vectors, shapes])


def residual_shapes(
    stiffness: Any, mass: Any, known: Reals, solve: Callable[[Reals], Reals], loads: Reals
) -> tuple[Reals, Reals]:
    """What the answers to loads (unknowns, r) add to shapes that are known (unknowns, m), which are of unit mass.

    Ritz values of ω² and shapes (unknowns, n ≤ r) that mass and stiffness leave apart from each other and, if these are
    rigid motions and modes, from what is known. Directions that depend on the others are dropped.
    """

    def apart(shapes: Reals) -> Reals:
        return shapes - known @ (known.T @ (mass @ shapes))

    def sizes(shapes: Reals) -> Reals:
        return np.sqrt(np.sum(shapes * (mass @ shapes), axis=0))

    whole = solve(loads)
    found = apart(apart(whole))
    size = sizes(found)
    new = size > NOTHING * sizes(whole)
    found = found[:, new] / size[new]
    squares, turn = np.linalg.eigh(found.T @ (mass @ found))
    # Of the largest eigenvalue of inner products of unit shapes: what is left out is less than 1e-5 of their motion,
    # and what is kept has eleven digits.
    kept = squares > 1e-10 * np.max(squares, initial=0.0)
    found = apart(found @ (turn[:, kept] / np.sqrt(squares[kept])))
    values, turn = linalg.eigh(found.T @ (stiffness @ found), found.T @ (mass @ found))
    return values, found @ turn
