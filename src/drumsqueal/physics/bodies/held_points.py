"""Motion of points by the shapes of a solid mesh, of those off it by a rigid arm from its nearest point."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from drumsqueal.physics.bodies.elements import REFERENCES, shapes_in
from drumsqueal.physics.bodies.solid_mesh import SolidMesh

Reals = NDArray[np.float64]

NEAREST = 8  # nodes whose elements are searched


def motion_held_at(mesh: SolidMesh, shapes: Reals, points: Reals) -> Reals:
    """u_x, u_y, u_z (k, 3, m) at points (k, 3) of shapes (m, n, 3): u + ½ (∇ × u) × a with the arm a."""
    return np.stack([_held(mesh, shapes, point) for point in points])


def _held(mesh: SolidMesh, shapes: Reals, point: Reals) -> Reals:
    nodes, place = nearest_place(mesh, point)
    value, slope = shapes_in(mesh.kind, place[:, None])
    foot, jacobian = value[:, 0] @ mesh.points[nodes], np.einsum("ai,aj->ij", mesh.points[nodes], slope[..., 0])
    u = np.einsum("mai,a->im", shapes[:, nodes], value[:, 0])
    gradient = np.einsum("mai,aj,jk->ikm", shapes[:, nodes], slope[..., 0], np.linalg.inv(jacobian))  # ∂u_i/∂x_k
    curl = np.stack([gradient[k - 1, k - 2] - gradient[k - 2, k - 1] for k in range(3)])
    return u + np.cross(curl / 2, (point - foot)[:, None], axis=0)


def nearest_place(mesh: SolidMesh, point: Reals) -> tuple[Any, Reals]:
    """The nodes of an element (a,) and the place (3,) in the reference one of the mesh's nearest point."""
    near = np.argsort(np.linalg.norm(mesh.points - point, axis=1))[:NEAREST]
    candidates = mesh.cells[np.any(np.isin(mesh.cells, near), axis=1)]
    found = [(_nearest_within(mesh, nodes, point), nodes) for nodes in candidates]
    (_, place), nodes = min(found, key=lambda each: each[0][0])
    return nodes, place


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
