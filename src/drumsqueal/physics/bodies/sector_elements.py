"""Finite elements of a free annular sector: quadratic hexahedra on a quarter of it.

The sector is its own mirror image in the planes z = 0 and θ = 0, so each of its modes is even or odd in both, but for
those of equal frequency, which can be chosen so. A quarter with the conditions of each parity on the two planes has a
fourth of the unknowns, and its modes are of that parity to all digits.
"""

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from drumsqueal.physics.bodies import elements
from drumsqueal.physics.bodies.elements import REFERENCES, lowest_modes

Reals = NDArray[np.float64]

# How much elements narrow towards the edge of the shoe, where the twist of a thin one changes within a thickness: with
# none a shoe of 4 mm errs eight times as much.
NARROWING = 0.75


class Sector(NamedTuple):
    """Outer radius R, thickness h inwards, width b (m) and arc angle β (rad): |θ| ≤ β/2, |z| ≤ b/2."""

    outer_radius: Any
    thickness: Any
    width: Any
    arc_angle: Any


class Parity(NamedTuple):
    """Whether motion in the plane is even in z, and whether u_r is even in θ, as in a stretched spring."""

    in_z: bool
    in_angle: bool

    def even(self, component: int) -> tuple[bool, bool]:
        """Whether u_r, u_θ or u_z is even in θ and in z."""
        return self.in_angle ^ (component == 1), self.in_z ^ (component == 2)

    @property
    def rigid(self) -> int:
        """How many rigid motions have this parity: X; Y and Tz; Z and Ty; Tx."""
        return 1 if self.in_z == self.in_angle else 2


PARITIES = tuple(Parity(*each) for each in product((True, False), repeat=2))


class Modes(NamedTuple):
    """Modes of one parity: wavenumbers (n,) in 1/m, and at the nodes u_r, u_θ, u_z (n, 3, in θ, r, z), ∫|ψ|² dV = 1."""

    parity: Parity
    wavenumbers: Reals
    shapes: Reals


class Mesh(NamedTuple):
    """Elements along r, θ and z of a quarter, 0 ≤ θ ≤ β/2 and 0 ≤ z ≤ b/2."""

    r: int
    angle: int
    z: int


def node_lines(sector: Sector, mesh: Mesh) -> tuple[Reals, Reals, Reals]:
    """Where the nodes are along r, θ and z: at the corners of elements and halfway between them."""
    R, h, b, beta = sector
    even = np.linspace(0, 1, mesh.z + 1)
    corners = b / 2 * ((1 - NARROWING) * even + NARROWING * np.sin(np.pi / 2 * even))
    z = np.interp(np.arange(2 * mesh.z + 1), 2 * np.arange(mesh.z + 1), corners)
    return np.linspace(R - h, R, 2 * mesh.r + 1), np.linspace(0, beta / 2, 2 * mesh.angle + 1), z


def solve_free_sector(
    sector: Sector, poisson: float, mesh: Mesh, highest: float, expected: Sequence[int]
) -> Iterator[Modes]:
    """Elastic free modes of the four parities up to a wavenumber ω sqrt(ρ/E) (1/m), of E = ρ = 1.

    It is quickest where as many of each parity are there as are expected. Raises ArithmeticError where rigid motions do
    not come out at zero.
    """
    stiffness, mass = assemble(sector, poisson, mesh)
    r, angle, z = (len(line) for line in node_lines(sector, mesh))
    turn = node_lines(sector, mesh)[1][:, None, None]
    for parity, number in zip(PARITIES, expected, strict=True):
        free = np.ones((angle, r, z, 3), dtype=bool)
        free[0, :, :, [0, 2]] = parity.in_angle
        free[0, :, :, 1] = not parity.in_angle
        free[:, :, 0, :2] &= parity.in_z
        free[:, :, 0, 2] &= not parity.in_z
        kept = np.flatnonzero(free.ravel())
        values, vectors = lowest_modes(stiffness[kept][:, kept], mass[kept][:, kept], highest**2, parity.rigid, number)
        whole = np.zeros((free.size, len(values)))
        whole[kept] = vectors / 2  # four quarters
        x, y, axial = np.moveaxis(whole.reshape(angle, r, z, 3, -1), (3, 4), (0, 1))
        shapes = [np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x, axial]
        yield Modes(parity, np.sqrt(values), np.stack(shapes, axis=1))


def assemble(sector: Sector, poisson: float, mesh: Mesh) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Stiffness and mass of a quarter, E = ρ = 1: nodes in the order of θ, r and z, each with u_x, u_y, u_z."""
    lines = node_lines(sector, mesh)
    angle, r, z = np.meshgrid(*(lines[k] for k in (1, 0, 2)), indexing="ij")
    points = np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=-1).reshape(-1, 3)
    firsts = np.stack(np.meshgrid(*(np.arange(0, 2 * n, 2) for n in mesh), indexing="ij"), axis=-1).reshape(-1, 1, 3)
    along = firsts + (2 * REFERENCES["hexahedron27"].nodes).astype(int)
    cells = np.ravel_multi_index(tuple(along[..., k] for k in (1, 0, 2)), angle.shape)
    return elements.assemble(points, cells, "hexahedron27", poisson=poisson)
