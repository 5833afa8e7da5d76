"""Modes of a shoe or a drum that is given as a solid mesh, on the surface where it touches the other."""

import functools
import hashlib
import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial.legendre import legval2d
from numpy.typing import NDArray
from scipy import sparse

from drumsqueal.physics.bodies.drum_modes import DrumModes
from drumsqueal.physics.bodies.held_points import motion_held_at
from drumsqueal.physics.bodies.kept_modes import kept
from drumsqueal.physics.bodies.lining_surface import CylinderSurface, find_surface, pressure_loads, project, sample
from drumsqueal.physics.bodies.mode_shapes import signs_of
from drumsqueal.physics.bodies.solid_elements import (
    EVERYWHERE,
    Material,
    Materials,
    solve_clamped_solid,
    solve_free_solid,
)
from drumsqueal.physics.bodies.solid_mesh import SolidMesh, read_solid_mesh

__all__ = ["EVERYWHERE", "Material", "find_clamped_drum", "find_free_solid", "read_solid_mesh"]

Reals = NDArray[np.float64]
Indices = NDArray[np.int64]

SOURCES = (
    "drum_modes.py",
    "elements.py",
    "lining_surface.py",
    "mode_shapes.py",
    "solid_elements.py",
    "solid_mesh.py",
    "solid_modes.py",
)


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
        solved = solve_free_solid(mesh, materials, highest_hz, loads)
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
    found = _plain(kept(SOURCES, told, find))
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
        solved = solve_clamped_solid(mesh, materials, clamped_set, highest_hz, loads)
        sampled = sample(mesh, surface_set, solved.shapes)
        coefficients, _ = project(sampled, surface, whole_circle=True, follow=counts)
        return vars(_in_pairs(2 * np.pi * solved.frequencies, coefficients))

    told = _contents(mesh, materials, ("clamped", surface_set, clamped_set, float(highest_hz).hex(), str(pressures)))
    return DrumModes(**kept(SOURCES, told, find))


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
