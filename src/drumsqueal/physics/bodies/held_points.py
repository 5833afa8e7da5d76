"""Motion of points by the shapes of a solid mesh, which holds them by a patch around its point nearest to them."""

import itertools
from typing import Any

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from drumsqueal.physics.bodies.elements import REFERENCES, shapes_in
from drumsqueal.physics.bodies.mode_shapes import ACROSS, LEAST_RADIUS, WEIGHTS
from drumsqueal.physics.bodies.solid_mesh import SolidMesh

Reals = NDArray[np.float64]


def motion_held_at(mesh: SolidMesh, shapes: Reals, points: Reals, radii: Reals) -> Reals:
    """u_x, u_y, u_z (k, 3, m) at points (k, 3) of shapes (m, n, 3), by patches of radii (k,) in m."""
    flat = shapes.reshape(len(shapes), mesh.points.size)
    return (patch_rows(mesh, points, radii) @ flat.T).reshape(len(points), 3, len(shapes))


def patch_rows(mesh: SolidMesh, points: Reals, radii: Reals) -> scipy.sparse.csr_array:
    """What gives u_x, u_y, u_z (3k,) at points (k, 3) from u_x, u_y, u_z of each node (3n,): (3k, 3n).

    Each is of a patch, of half sizes (k,) in m around the mesh's nearest point, by its Gauss points: it moves with
    their mean and turns by half the curl of the linear motion that is nearest to theirs, by least squares.
    """
    patches, which = np.unique(np.column_stack([points, radii]), axis=0, return_inverse=True)  # springs share a pin
    rows = [_rows(mesh, patch[:3], patch[3]) for patch in patches]
    return scipy.sparse.csr_array(scipy.sparse.vstack([rows[k] for k in which]))


def _rows(mesh: SolidMesh, point: Reals, radius: float) -> scipy.sparse.csr_array:
    """The rows (3, 3n) of one point: of a box along r, θ and z, as that of a sector, which ends where the mesh does."""
    if radius < LEAST_RADIUS:
        return _held_by(mesh, point, point)
    middle = _polar(_foot(mesh, point)[-1])
    low, high = (
        np.array([_polar(_foot(mesh, _place(end))[-1], middle[1])[k] for k, end in enumerate(middle + side)])
        for side in np.multiply.outer((-1, 1), np.diag([radius, radius / middle[0], radius]))
    )
    places = (low + high) / 2 + (high - low) / 2 * np.array(list(itertools.product(ACROSS, repeat=3)))
    weights = np.prod(list(itertools.product(WEIGHTS, repeat=3)), axis=1) * places[:, 0]
    return _held_by_all(mesh, point, [_place(each) for each in places], weights / np.sum(weights))


def _held_by_all(mesh: SolidMesh, point: Reals, places: list[Reals], weights: Reals) -> scipy.sparse.csr_array:
    """The rows (3, 3n) of a point that moves with the mean of some places, and turns as their linear motion does."""
    feet = [_foot(mesh, place) for place in places]
    at = np.array([foot for *_, foot in feet])
    middle = weights @ at
    arms = at - middle
    slopes = np.linalg.solve((weights * arms.T) @ arms, weights * arms.T).T  # of a linear motion, by displacements
    turns = np.stack([_across(slope) for slope in slopes]) / 2
    blocks = weights[:, None, None] * np.eye(3) - _across(point - middle) @ turns  # of each place (3, 3)
    entries = [
        (row, 3 * node + column, block[row, column] * value)
        for block, (nodes, values, *_) in zip(blocks, feet, strict=True)
        for node, value in zip(nodes, values, strict=True)
        for row in range(3)
        for column in range(3)
    ]
    rows, columns, values = zip(*entries, strict=True)
    return scipy.sparse.csr_array(scipy.sparse.coo_array((values, (rows, columns)), shape=(3, mesh.points.size)))


def _across(vector: Reals) -> Reals:
    """The matrix (3, 3) of the product of a vector with others."""
    return np.cross(np.eye(3), vector)


def _polar(place: Reals, about: float = 0.0) -> Reals:
    """r, θ, z of a place, θ within half a turn of an angle."""
    turned = np.arctan2(place[1], place[0]) - about
    return np.array([np.hypot(place[0], place[1]), about + np.arctan2(np.sin(turned), np.cos(turned)), place[2]])


def _place(polar: Reals) -> Reals:
    return np.array([polar[0] * np.cos(polar[1]), polar[0] * np.sin(polar[1]), polar[2]])


def _held_by(mesh: SolidMesh, point: Reals, place: Reals) -> scipy.sparse.csr_array:
    """The rows (3, 3n) of a point that the mesh's point nearest to a place holds.

    ((∇ × u) × a)_i = a_j (∂_j u_i − ∂_i u_j).
    """
    nodes, value, slope, foot = _foot(mesh, place)
    gradient = slope @ np.linalg.inv(np.einsum("ai,aj->ij", mesh.points[nodes], slope))  # ∂N_a/∂x_k
    arm = point - foot
    blocks = (value + gradient @ arm / 2)[:, None, None] * np.eye(3) - gradient[:, :, None] * arm / 2  # (a, 3, 3)
    columns, rows = 3 * nodes[:, None, None] + np.arange(3), np.arange(3)[:, None]
    rows, columns = (np.broadcast_to(each, blocks.shape).ravel() for each in (rows, columns))
    return scipy.sparse.csr_array((blocks.ravel(), (rows, columns)), shape=(3, mesh.points.size))


def _foot(mesh: SolidMesh, point: Reals) -> tuple[Any, Reals, Reals, Reals]:
    """Nodes of an element (a,), shape functions (a,), slopes (a, 3) and place where a mesh is nearest to a point."""
    nodes, within = nearest_place(mesh, point)
    value, slope = shapes_in(mesh.kind, within[:, None])
    return nodes, value[:, 0], slope[..., 0], value[:, 0] @ mesh.points[nodes]


def nearest_place(mesh: SolidMesh, point: Reals) -> tuple[Any, Reals]:
    """The nodes of an element (a,) and the place (3,) in the reference one of the mesh's nearest point."""
    near = np.argsort(np.linalg.norm(mesh.points - point, axis=1))[:8]  # nodes whose elements are searched
    candidates = mesh.cells[np.any(np.isin(mesh.cells, near), axis=1)]
    corners = mesh.points[candidates]
    beyond = np.maximum(corners.min(axis=1) - point, point - corners.max(axis=1)).clip(0.0)
    least = np.linalg.norm(beyond, axis=1)
    found: tuple[float, Any, Any] = (np.inf, None, None)
    for k in np.argsort(least):
        if least[k] > found[0]:
            break
        found = min(found, (*_nearest_within(mesh, candidates[k], point), candidates[k]), key=lambda each: each[0])
    return found[2], found[1]


def _nearest_within(mesh: SolidMesh, nodes: Any, point: Reals) -> tuple[float, Reals]:
    """Distance from an element, in its own size, and the place in the reference element."""
    from scipy.optimize import minimize  # where a spring holds a mesh, and not with every start

    corners = mesh.points[nodes]
    size = np.max(np.ptp(corners, axis=0))

    def distance(place: Reals) -> tuple[float, Reals]:
        value, slope = shapes_in(mesh.kind, place[:, None])
        off = (value[:, 0] @ corners - point) / size
        return float(off @ off), 2 * slope[..., 0].T @ (corners / size) @ off

    tetrahedron = REFERENCES[mesh.kind].corners == 4
    whole = [{"type": "ineq", "fun": lambda X: 1 - np.sum(X), "jac": lambda _: -np.ones(3)}] if tetrahedron else []
    found = minimize(
        distance,
        np.full(3, 0.25 if tetrahedron else 0.5),
        jac=True,
        method="SLSQP",
        bounds=[(0, 1)] * 3,
        constraints=whole,
        options={"ftol": 1e-14, "maxiter": 100},
    )
    place = np.clip(found.x, 0.0, 1.0)
    return float(np.sqrt(distance(place)[0])) * size, place
