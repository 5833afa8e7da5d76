"""The cylindrical surface of a solid mesh that touches the other body, and shapes on it as smooth functions."""

from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy import sparse

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.elements import REFERENCES, Indices, Reals, jacobians, shapes_in
from drumsqueal.physics.bodies.mode_shapes import MOST, STABLE, fewest, harmonics
from drumsqueal.physics.bodies.solid_mesh import SolidMesh

# Of the radius: how far corners of elements may be from the surface. Those of a mesh lie on it but for the digits that
# are written; chords between them do not, and are not looked at.
ROUND = 1e-3
WHOLE = 0.03  # of its area: how much of a lining's rectangle may be missing, or there twice
SMOOTH = 8  # degree that quadrature on a face is exact for: products of shapes and polynomials that vary within one


class CylinderSurface(NamedTuple):
    """Radius, arc angle, width and middle z0 (m, rad), and how many elements' edges are along θ and z."""

    radius: float
    arc: float
    width: float
    z0: float
    edges: tuple[float, float]


class SampledSurface(NamedTuple):
    """At quadrature points of a surface: θ (q,), z (q,), weights of dθ dz (q,), and u_r, u_θ, u_z (m, 3, q)."""

    theta: Reals
    z: Reals
    weight: Reals
    shapes: Reals


def find_surface(mesh: SolidMesh, name: str, *, whole_circle: bool = False) -> CylinderSurface:
    """The cylinder about z on which a set of faces is; raises RequestError where it is none, or not all of one."""
    elements, faces = mesh.faces_of(name)
    table = np.array(REFERENCES[mesh.kind].faces)
    corners = mesh.points[mesh.cells[elements[:, None], table[faces]]]  # (f, corners, 3)
    places = corners.reshape(-1, 3)
    radii = np.hypot(places[:, 0], places[:, 1])
    radius = float(np.mean(radii))
    if np.ptp(radii) > ROUND * radius:
        raise RequestError(
            f"the surface {name} is not at one radius about the z axis: it is {np.min(radii):.6g} to "
            f"{np.max(radii):.6g} m from it; the axis of the drum must be z, and the set its cylinder alone"
        )
    theta, z = np.arctan2(places[:, 1], places[:, 0]), places[:, 2]
    arc = 2 * np.pi if whole_circle else arc_of(theta, f"surface {name}")
    width = float(np.ptp(z))
    flat, _ = _on_faces(mesh, elements, faces)
    share = np.sum(flat.weight) / (arc * width)
    if abs(share - 1) > WHOLE:
        raise RequestError(
            f"the surface {name} covers {100 * share:.3g} % of its arc of {np.degrees(arc):.4g} deg by {width:.4g} m; "
            "it must be a whole rectangle in θ and z, without holes or slots"
        )
    span = np.angle(np.exp(1j * (theta.reshape(len(corners), -1) - theta.reshape(len(corners), -1)[:, :1])))
    heights = np.ptp(corners[:, :, 2], axis=1)
    return CylinderSurface(
        radius,
        arc,
        width,
        float((np.max(z) + np.min(z)) / 2),
        (arc / float(np.mean(np.ptp(span, axis=1))), width / float(np.mean(heights))),
    )


def arc_of(theta: Reals, what: str) -> float:
    """The arc angle (rad) of places at angles (rad); raises RequestError unless its middle is at θ = 0."""
    middle = np.angle(np.sum(np.exp(1j * theta)))
    turned = np.angle(np.exp(1j * (theta - middle)))
    arc = float(np.ptp(turned))
    middle = np.angle(np.exp(1j * (middle + (np.max(turned) + np.min(turned)) / 2)))
    if abs(middle) > 2e-3 * arc:  # of a lining's arc: how far its middle may be from θ = 0
        raise RequestError(
            f"the {what} is from {np.degrees(middle - arc / 2):.4g} to {np.degrees(middle + arc / 2):.4g} deg about z; "
            "add faces that are missing, or turn the mesh so that the x axis passes through the middle of the lining"
        )
    return arc


def sample(mesh: SolidMesh, name: str, shapes: Reals) -> SampledSurface:
    """Shapes (m, n, 3) at the mesh's nodes, at quadrature points on a surface."""
    found, rows = _on_faces(mesh, *mesh.faces_of(name))
    flat = rows @ shapes.transpose(1, 0, 2).reshape(shapes.shape[1], -1)
    x, y, axial = flat.reshape(len(flat), len(shapes), 3).transpose(2, 1, 0)
    cosine, sine = np.cos(found.theta), np.sin(found.theta)
    return found._replace(shapes=np.stack([cosine * x + sine * y, cosine * y - sine * x, axial], axis=1))


def pressure_loads(
    mesh: SolidMesh, name: str, surface: CylinderSurface, counts: tuple[int, int], *, whole_circle: bool = False
) -> Reals:
    """∫ N e_r P dA (3n, r) by the mesh's shape functions N, of so many functions P along θ and z as `project` takes."""
    found, rows = _on_faces(mesh, *mesh.faces_of(name))
    pressed = _basis(found, surface, counts, whole_circle) * (surface.radius * found.weight)[:, None]
    x, y = (rows.T @ (along(found.theta)[:, None] * pressed) for along in (np.cos, np.sin))
    return np.stack([x, y, np.zeros_like(x)], axis=1).reshape(-1, pressed.shape[1])


def _on_faces(mesh: SolidMesh, elements: Indices, faces: Indices) -> tuple[SampledSurface, Any]:
    """Quadrature points on faces, and values of the shape functions there (q, n), sparse."""
    from skfem.quadrature import get_quadrature
    from skfem.refdom import RefQuad, RefTri

    reference = REFERENCES[mesh.kind]
    flat, weights = get_quadrature(RefTri if len(reference.faces[0]) == 3 else RefQuad, SMOOTH)
    theta, z, weight, values, nodes = [], [], [], [], []
    for face in np.unique(faces):  # those of one face of the reference element share its shape functions
        first, second, last = (reference.nodes[reference.faces[face][k]] for k in (0, 1, -1))
        along = np.stack([second - first, last - first], axis=1)
        value, slope = shapes_in(mesh.kind, first[:, None] + along @ flat)
        own = mesh.cells[elements[faces == face]]
        x, y, height = np.einsum("fai,aq->ifq", mesh.points[own], value)
        tangents = jacobians(mesh.points[own], slope) @ along  # (f, q, 3, 2)
        turn = (x[..., None] * tangents[:, :, 1] - y[..., None] * tangents[:, :, 0]) / (x**2 + y**2)[..., None]
        cross = turn[..., 0] * tangents[:, :, 2, 1] - turn[..., 1] * tangents[:, :, 2, 0]
        for kept, found in ((theta, np.arctan2(y, x)), (z, height), (weight, np.abs(cross) * weights)):
            kept.append(found.ravel())
        values.append(np.tile(value.T, (len(own), 1)))
        nodes.append(np.repeat(own, value.shape[1], axis=0))
    along, across, weights, values, nodes = (np.concatenate(each) for each in (theta, z, weight, values, nodes))
    starts = np.arange(0, values.size + 1, values.shape[1])
    rows = sparse.csr_array((values.ravel(), nodes.ravel(), starts), shape=(len(values), len(mesh.points)))
    return SampledSurface(along, across, weights, np.zeros((0, 3, 0))), rows


def project(
    sampled: SampledSurface,
    surface: CylinderSurface,
    *,
    whole_circle: bool = False,
    of_nodes: bool = False,
    follow: tuple[int, int] | None = None,
) -> tuple[Reals, Reals]:
    """Coefficients (m, 3, of θ, of z) and the error of each shape (m,), relative, root mean squares compared.

    Least squares over the surface. Along θ they are those of Legendre polynomials of 2θ/β, or on a whole circle of
    `harmonics`; along z of Legendre polynomials. The fewest that hold all shapes but for what is not needed. Where
    shapes are known at nodes alone, no more than these tell apart; where they answer loads, as many as `follow` these,
    if the mesh tells so many apart.
    """
    points = SMOOTH // 2 + 1  # of it along an edge
    most = [int(min(MOST, STABLE * np.sqrt(2 * n + 1) + 1, 2 * n + 1 if of_nodes else MOST)) for n in surface.edges]
    if whole_circle:  # half a wavelength of the shortest harmonic spans two edges of quadratic elements
        most[0] = 2 * int(min(MOST, surface.edges[0] / 4)) + 1
    if follow is not None:  # as far as points of quadrature tell apart: beyond, the ends are anything
        apart = [int(STABLE * np.sqrt(points * n) + 1) for n in surface.edges]
        if whole_circle:
            apart[0] = 2 * int(surface.edges[0]) + 1
        most = [max(own, min(n, limit)) for own, n, limit in zip(most, follow, apart, strict=True)]
    generous, _ = _fit(sampled, surface, (most[0], most[1]), whole_circle)
    return _fit(sampled, surface, _enough(generous, whole_circle), whole_circle)


def _fit(
    sampled: SampledSurface, surface: CylinderSurface, degrees: tuple[int, int], whole_circle: bool
) -> tuple[Any, Any]:
    basis = _basis(sampled, surface, degrees, whole_circle)
    flat = sampled.shapes.reshape(-1, len(basis))
    weighted = basis * sampled.weight[:, None]
    # Nearly orthogonal, so that normal equations lose no digits that matter.
    found = np.linalg.solve(basis.T @ weighted, weighted.T @ flat.T).T
    missed, total = (
        np.sum((each**2 @ sampled.weight).reshape(-1, 3), axis=1) for each in (found @ basis.T - flat, flat)
    )
    return found.reshape(-1, 3, *degrees), np.sqrt(missed / total)


def _basis(sampled: SampledSurface, surface: CylinderSurface, degrees: tuple[int, int], whole_circle: bool) -> Reals:
    """So many functions along θ by as many along z (q, of both)."""
    along = (
        harmonics(sampled.theta, degrees[0])
        if whole_circle
        else legvander(2 * sampled.theta / surface.arc, degrees[0] - 1)
    )
    across = legvander(2 * (sampled.z - surface.z0) / surface.width, degrees[1] - 1)
    return (along[:, :, None] * across[:, None]).reshape(len(along), -1)


def _enough(coefficients: Reals, whole_circle: bool) -> tuple[int, int]:
    """The fewest along θ and z, by `fewest`; two along z, and whole pairs of harmonics."""
    if not len(coefficients):
        return 3 if whole_circle else 2, 2
    _, _, count, across = coefficients.shape
    sizes = np.full(count, 2.0) if whole_circle else 2 * np.arange(count) + 1
    energy = np.einsum("ncbk,b,k->nbk", coefficients**2, 1 / sizes, 1 / (2 * np.arange(across) + 1))
    along, across = (max(2, fewest(np.sum(energy, axis=axis))) for axis in (2, 1))
    return (along | 1 if whole_circle else along), across
