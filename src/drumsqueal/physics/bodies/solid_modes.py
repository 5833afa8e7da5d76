"""Modes of a shoe or a drum that is given as a solid mesh, on the surface where it touches the other.

Points move with a patch of the mesh around the place in it that is nearest to them.
"""

import functools
import hashlib
import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial.legendre import legval2d
from scipy import sparse

from drumsqueal.physics.bodies.drum_modes import DrumModes
from drumsqueal.physics.bodies.elements import REFERENCES, Indices, Reals, shapes_in
from drumsqueal.physics.bodies.lining_surface import CylinderSurface, find_surface, pressure_loads, project, sample
from drumsqueal.physics.bodies.mode_shapes import ACROSS, LEAST_RADIUS, WEIGHTS, kept, signs_of
from drumsqueal.physics.bodies.solid_elements import Materials, solve_solid
from drumsqueal.physics.bodies.solid_mesh import SolidMesh


def motion_held_at(mesh: SolidMesh, shapes: Reals, points: Reals, radii: Reals) -> Reals:
    """u_x, u_y, u_z (k, 3, m) at points (k, 3) of shapes (m, n, 3), by patches of radii (k,) in m."""
    flat = shapes.reshape(len(shapes), mesh.points.size)
    return (patch_rows(mesh, points, radii) @ flat.T).reshape(len(points), 3, len(shapes))


def patch_rows(mesh: SolidMesh, points: Reals, radii: Reals) -> sparse.csr_array:
    """What gives u_x, u_y, u_z (3k,) at points (k, 3) from u_x, u_y, u_z of each node (3n,): (3k, 3n).

    Each is of a patch, of half sizes (k,) in m around the mesh's nearest point, by its Gauss points: it moves with
    their mean and turns by half the curl of the linear motion that is nearest to theirs, by least squares.
    """
    patches, which = np.unique(np.column_stack([points, radii]), axis=0, return_inverse=True)  # springs share a pin
    rows = [_rows(mesh, patch[:3], patch[3]) for patch in patches]
    return sparse.csr_array(sparse.vstack([rows[k] for k in which]))


def _rows(mesh: SolidMesh, point: Reals, radius: float) -> sparse.csr_array:
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


def _held_by_all(mesh: SolidMesh, point: Reals, places: list[Reals], weights: Reals) -> sparse.csr_array:
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
    return sparse.csr_array(sparse.coo_array((values, (rows, columns)), shape=(3, mesh.points.size)))


def _across(vector: Reals) -> Reals:
    """The matrix (3, 3) of the product of a vector with others."""
    return np.cross(np.eye(3), vector)


def _polar(place: Reals, about: float = 0.0) -> Reals:
    """r, θ, z of a place, θ within half a turn of an angle."""
    turned = np.arctan2(place[1], place[0]) - about
    return np.array([np.hypot(place[0], place[1]), about + np.arctan2(np.sin(turned), np.cos(turned)), place[2]])


def _place(polar: Reals) -> Reals:
    return np.array([polar[0] * np.cos(polar[1]), polar[0] * np.sin(polar[1]), polar[2]])


def _held_by(mesh: SolidMesh, point: Reals, place: Reals) -> sparse.csr_array:
    """The rows (3, 3n) of a point that the mesh's point nearest to a place holds.

    ((∇ × u) × a)_i = a_j (∂_j u_i − ∂_i u_j).
    """
    nodes, value, slope, foot = _foot(mesh, place)
    gradient = slope @ np.linalg.inv(np.einsum("ai,aj->ij", mesh.points[nodes], slope))  # ∂N_a/∂x_k
    arm = point - foot
    blocks = (value + gradient @ arm / 2)[:, None, None] * np.eye(3) - gradient[:, :, None] * arm / 2  # (a, 3, 3)
    columns, rows = 3 * nodes[:, None, None] + np.arange(3), np.arange(3)[:, None]
    rows, columns = (np.broadcast_to(each, blocks.shape).ravel() for each in (rows, columns))
    return sparse.csr_array((blocks.ravel(), (rows, columns)), shape=(3, mesh.points.size))


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


@dataclass(frozen=True)
class SolidModes:
    """Elastic modes of a free solid, in the order of frequency (m,) in Hz, of unit modal mass and no rigid motion.

    `centre` (3,) in m; principal `moments` (3,) in kg m² about the columns of `axes` (3, 3), which are a right-handed
    frame nearest to x, y and z. `coefficients` (m, 3, of θ, of z) in kg^-½ give u_r, u_θ, u_z on the lining by
    P_a(2θ/β) P_b(2(z − z0)/b). `fit_error` is the largest of a shape's polynomials from its finite elements, root mean
    squares compared; (highest/f)² of it where the shape is no mode. `shapes` (m, n, 3) are at the nodes, and `moved`
    gives u_x, u_y, u_z (k, 3, m) at points (k, 3) with patches of radii (k,).
    """

    frequencies: Reals
    mass: float
    centre: Reals
    moments: Reals
    axes: Reals
    lining: CylinderSurface
    coefficients: Reals
    fit_error: float
    shapes: Reals
    moved: Callable[[Reals, Reals], Reals]

    def motion_at(self, points: Any, radii: Any = 0.0) -> Reals:
        """u_x, u_y, u_z of each shape (k, 3, m) at points (k, 3), means over patches of radii (k,) in m."""
        points = np.atleast_2d(np.asarray(points, dtype=float))
        return self.moved(points, np.broadcast_to(radii, len(points)))

    def combined(self, sums: Reals) -> "SolidModes":
        """Sums (k, m) of the shapes, orthonormal; their frequencies say how stiff each is."""
        coefficients, shapes = (np.tensordot(sums, each, 1) for each in (self.coefficients, self.shapes))
        signs = signs_at_corner(coefficients)
        found: dict[tuple[bytes, bytes], Reals] = {}

        def moved(points: Reals, radii: Reals) -> Reals:
            key = points.tobytes(), radii.tobytes()
            if key not in found:  # to look for a patch in a mesh takes longer than all else that a model asks for
                found[key] = self.moved(points, radii) @ (sums * signs[:, None]).T
            return found[key]

        return replace(
            self,
            frequencies=np.sqrt(sums**2 @ self.frequencies**2),
            coefficients=coefficients * signs[:, None, None, None],
            shapes=shapes * signs[:, None, None],
            moved=moved,
        )


def find_free_solid(
    mesh: SolidMesh,
    materials: Materials,
    lining_set: str,
    highest_hz: float,
    pressures: tuple[int, int] | None = None,
    held: Any = None,
) -> SolidModes:
    """Free modes up to a frequency; `materials` are by sets of elements, and by "" for those in none of them.

    Pressures P_a(2θ/β) P_c(2(z − z0)/b) on the lining, a and c below so many, and loads `held` (r, 3n), a sparse matrix
    with one in a row, add what their answers hold beyond the modes: shapes after them that are orthonormal in mass and
    apart in stiffness, too, so that their frequencies say how stiff each is and no more. What was once found is kept in
    the user's cache folder. Raises RequestError of a wrong mesh, set or material, and ArithmeticError where rigid
    motions do not come out at zero.
    """
    surface = find_surface(mesh, lining_set)

    def find() -> dict[str, Any]:
        loads = None if pressures is None else pressure_loads(mesh, lining_set, surface, pressures)
        if loads is not None and held is not None:
            loads = np.hstack([loads, held.T.toarray()])
        solved = solve_solid(mesh, materials, highest_hz, loads)
        coefficients, errors = project(sample(mesh, lining_set, solved.shapes), surface, follow=pressures)
        signs = signs_at_corner(coefficients)
        return {
            "frequencies": solved.frequencies,
            "coefficients": coefficients * signs[:, None, None, None],
            "fit_error": _largest(errors, solved.frequencies, highest_hz),
            "shapes": solved.shapes * signs[:, None, None],
            **solved.inertia._asdict(),
        }

    told = _contents(mesh, materials, ("free", lining_set, float(highest_hz).hex(), str(pressures)), held)
    found = _plain(kept("mesh", told, find))
    moments, axes = principal_axes(found.pop("tensor"))
    moved = functools.partial(motion_held_at, mesh, found["shapes"])
    return SolidModes(**found, moments=moments, axes=axes, lining=surface, moved=moved)


def find_clamped_drum(
    mesh: SolidMesh,
    materials: Materials,
    surface_set: str,
    clamped_set: str,
    highest_hz: float,
    pressures: tuple[int, int] | None = None,
) -> DrumModes:
    """Modes of a drum that is clamped at the nodes of a set, on its inner surface over the whole circle.

    As those of a cup, with circular frequencies (rad/s) for wavenumbers; of a pair, the first is even in θ.
    `pressures` (N, B) of cos nθ and sin nθ, n up to N, times P_b(2(z − z0)/b), b below B, add what the drum's answers
    to them hold beyond the modes, as `find_free_solid` has them.
    """
    surface = find_surface(mesh, surface_set, whole_circle=True)
    counts = None if pressures is None else (2 * pressures[0] + 1, pressures[1])

    def find() -> dict[str, Any]:
        loads = None if counts is None else pressure_loads(mesh, surface_set, surface, counts, whole_circle=True)
        solved = solve_solid(mesh, materials, highest_hz, loads, clamped_set)
        sampled = sample(mesh, surface_set, solved.shapes)
        coefficients, _ = project(sampled, surface, whole_circle=True, follow=counts)
        return vars(_in_pairs(2 * np.pi * solved.frequencies, coefficients))

    told = _contents(mesh, materials, ("clamped", surface_set, clamped_set, float(highest_hz).hex(), str(pressures)))
    return DrumModes(**kept("mesh", told, find))


def _largest(errors: Reals, frequencies: Reals, highest_hz: float) -> float:
    """The largest error of a mode, or of a shape beyond these as its motion under a load compares with a mode's."""
    return float(np.max(errors * np.minimum(1, highest_hz / frequencies) ** 2, initial=0.0))


def _in_pairs(frequencies: Reals, coefficients: Reals) -> DrumModes:
    """Modes of a drum with definite angles and signs: those of a pair are of one frequency, and found at any angle.

    As `drum_modes.py` has them: the first of a pair is even in θ and the second odd. Two modes are a pair if they have
    as many waves around and frequencies that differ by what a mesh is worth, which are then their mean.
    """
    frequencies, coefficients = frequencies.copy(), coefficients.copy()
    harmonics, left = _waves(coefficients), list(range(len(frequencies)))
    while left:
        first, *left = left
        close = (1 + 1e-3) * frequencies[first]  # of it: how far those of a pair may be apart by the mesh alone
        twins = [k for k in left if harmonics[k] == harmonics[first] > 0 and frequencies[k] <= close][:1]
        pair, left = [first, *twins], [k for k in left if k not in twins]
        frequencies[pair] = np.sqrt(np.mean(frequencies[pair] ** 2))
        coefficients[pair] = _turned(coefficients[pair], harmonics[first])
    order = np.argsort(frequencies, kind="stable")
    return DrumModes(frequencies[order], harmonics[order], coefficients[order])


def _waves(coefficients: Reals) -> Indices:
    """Of each mode (m,) the number of waves around with most of it."""
    energy = np.sum(coefficients**2 * _squares(coefficients), axis=(1, 3))
    orders = (np.arange(energy.shape[1]) + 1) // 2
    return np.argmax(energy @ (orders[:, None] == np.arange(orders[-1] + 1)), axis=1)


def _turned(pair: Reals, n: int) -> Reals:
    """One mode of n waves with its sign, or two of one frequency also at their angle."""
    parts = _even_and_odd(pair, n)
    if len(pair) == 2:
        even, odd = np.einsum("pick,pjck,k->pij", parts, parts, _squares(pair))
        turn = np.linalg.eigh(odd - even)[1].T  # the most even combination, and the most odd one
        pair, parts = np.einsum("ij,jcfk->icfk", turn, pair), np.einsum("ij,pjck->pick", turn, parts)
    larger = np.argmax(np.sum(parts**2, axis=(2, 3)), axis=0)
    at_edge = parts[larger, np.arange(len(pair))] @ (-1.0) ** np.arange(parts.shape[3])  # z = z0 − b/2
    return pair * signs_of(at_edge.T)[:, None, None, None]


def _squares(coefficients: Reals) -> Reals:
    """Mean squares of P_b along z."""
    return 1 / (2 * np.arange(coefficients.shape[3]) + 1)


def _even_and_odd(coefficients: Reals, n: int) -> Reals:
    """Of n waves around, the parts (2, m, 3, of z) U cos nθ, V sin nθ, W cos nθ and U sin nθ, −V cos nθ, W sin nθ."""
    cosine, sine = coefficients[:, :, max(0, 2 * n - 1)], coefficients[:, :, 2 * n] * (n > 0)
    even, odd = cosine.copy(), sine.copy()
    if n > 0:
        even[:, 1], odd[:, 1] = sine[:, 1], -cosine[:, 1]
    return np.stack([even, odd])


def principal_axes(tensor: Reals) -> tuple[Reals, Reals]:
    """Principal moments (3,) and axes (3, 3), its columns: the right-handed frame that is nearest to x, y and z."""
    moments, axes = np.linalg.eigh(tensor)
    order = max(itertools.permutations(range(3)), key=lambda each: sum(abs(axes[k, each[k]]) for k in range(3)))
    moments, axes = moments[list(order)], axes[:, list(order)]
    axes = axes * np.where(np.diag(axes) < 0, -1.0, 1.0)
    if np.linalg.det(axes) < 0:
        axes[:, np.argmin(np.diag(axes))] *= -1
    return moments, axes


def signs_at_corner(coefficients: Reals) -> Reals:
    """What makes u_r positive at the lining's corner, or where it hardly moves so, the first of u_θ and u_z."""
    corner: Any = legval2d(1.0, 1.0, coefficients.transpose(2, 3, 1, 0))  # (3, m)
    return signs_of(corner)


def _plain(found: Mapping[str, Any]) -> dict[str, Any]:
    return {name: float(each) if np.ndim(each) == 0 else each for name, each in found.items()}


def _contents(mesh: SolidMesh, materials: Materials, told: tuple[str, ...], held: Any = None) -> list[bytes]:
    sets = [dict(sorted(group.items())) for group in (mesh.node_sets, mesh.element_sets, mesh.face_sets)]
    arrays = [("points", mesh.points), ("cells", mesh.cells), ("masses", mesh.point_masses)]
    arrays += [pair for group in sets for pair in group.items()]
    arrays += [] if held is None else list(zip(("held", "column", "row"), sparse.find(held)[::-1], strict=True))
    numbers = [f"{name}: {[float(each).hex() for each in material]}" for name, material in sorted(materials.items())]
    return [
        *(each.encode() for each in (*told, mesh.kind, *numbers)),
        *(
            f"{name} {hashlib.sha256(np.ascontiguousarray(each).tobytes()).hexdigest()}".encode()
            for name, each in arrays
        ),
    ]
