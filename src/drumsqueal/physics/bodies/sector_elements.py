"""Finite elements of a free annular sector: quadratic hexahedra of scikit-fem on a quarter of it.

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
from scipy.sparse.linalg import LinearOperator, eigsh, splu

Reals = NDArray[np.float64]

INTEGRATED = 5  # the degree that quadrature is exact for: 27 points an element, full integration
# How much elements narrow towards the edge of the shoe, where the twist of a thin one changes within a thickness: with
# none a shoe of 4 mm errs eight times as much.
NARROWING = 0.75
MORE = 2  # solutions asked for beyond those expected
SMALL_SHIFT = 0.01  # of the highest eigenvalue: the factorised matrix is then positive definite and well conditioned
# Rigid motions are zero to round-off, or what is kept beside them is not known to any digit.
RIGID = 1e-3  # of the first elastic eigenvalue


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
        values, vectors = _lowest(stiffness[kept][:, kept], mass[kept][:, kept], highest**2, parity.rigid, number)
        whole = np.zeros((free.size, len(values)))
        whole[kept] = vectors / 2  # four quarters
        x, y, axial = np.moveaxis(whole.reshape(angle, r, z, 3, -1), (3, 4), (0, 1))
        shapes = [np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x, axial]
        yield Modes(parity, np.sqrt(values), np.stack(shapes, axis=1))


def assemble(sector: Sector, poisson: float, mesh: Mesh) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Stiffness and mass of a quarter, E = ρ = 1: nodes in the order of θ, r and z, each with u_x, u_y, u_z.

    ∫ λ ∂_i u_i ∂_j v_j + G (∂_j u_i ∂_j v_i + ∂_j u_i ∂_i v_j) dV, λ = ν/((1 + ν)(1 − 2ν)), G = 1/(2(1 + ν)).
    """
    from skfem import Basis, ElementHex2, MeshHex, MeshHex2  # where a shoe bends, and not with every start

    # Whole numbers for places, so that nodes are known by them to the last bit.
    grid = MeshHex2.from_mesh(MeshHex.init_tensor(*(np.arange(0.0, 2 * n + 1, 2.0) for n in mesh)))
    lines = node_lines(sector, mesh)

    def place(corners: Any) -> Reals:
        r, angle, z = (line[index] for line, index in zip(lines, corners.astype(int), strict=True))
        return np.stack([r * np.cos(angle), r * np.sin(angle), z])

    basis = Basis(MeshHex2(place(grid.doflocs), grid.t), ElementHex2(), intorder=INTEGRATED)
    along_r, along_angle, along_z = Basis(grid, ElementHex2()).doflocs.astype(int)
    number = np.ravel_multi_index((along_angle, along_r, along_z), tuple(len(lines[k]) for k in (1, 0, 2)))
    places = number[basis.element_dofs].T.astype(np.int32)
    fields: Any = [shape[0] for shape in basis.basis]
    value = np.stack([np.broadcast_to(np.asarray(field), basis.dx.shape) for field in fields])
    slope = np.stack([field.grad for field in fields])
    mass = np.einsum("aeq,beq,eq->eab", value, value, basis.dx, optimize=True)
    of_slopes = np.einsum("aieq,bjeq,eq->eaibj", slope, slope, basis.dx, optimize=True)
    first, second = poisson / ((1 + poisson) * (1 - 2 * poisson)), 1 / (2 * (1 + poisson))
    trace = np.trace(of_slopes, axis1=2, axis2=4)
    stiffness = first * of_slopes + second * of_slopes.transpose(0, 1, 4, 3, 2)
    stiffness += second * trace[:, :, None, :, None] * np.eye(3)[:, None]
    of_components = (3 * places[:, :, None] + np.arange(3, dtype=np.int32)).reshape(len(places), -1)
    size = basis.dx.shape[0], of_components.shape[1], of_components.shape[1]
    return _gather(stiffness.reshape(size), of_components), sparse.csr_array(
        sparse.kron(_gather(mass, places), np.eye(3))
    )


def _gather(matrices: Reals, places: NDArray[np.int32]) -> sparse.csr_array:
    """The sum of the elements' matrices (elements, a, a), whose rows and columns go to the places (elements, a)."""
    rows, columns = (np.broadcast_to(each, matrices.shape) for each in (places[:, :, None], places[:, None]))
    return sparse.coo_array((matrices.ravel(), (rows.ravel(), columns.ravel()))).tocsr()


def _lowest(stiffness: Any, mass: Any, highest: float, rigid: int, expected: int) -> tuple[Reals, Reals]:
    """Elastic eigenvalues up to the highest (1/m²) and their vectors (unknowns, n), of unit mass."""
    shift = -SMALL_SHIFT * highest
    shifted = (stiffness - shift * mass).tocsc()
    factors = splu(shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    inverse = LinearOperator(shifted.shape, factors.solve)
    start = np.random.default_rng(0).standard_normal(shifted.shape[0])  # the same every time
    asked = rigid + expected + MORE
    while True:
        asked = min(asked, shifted.shape[0] - 1)
        values, vectors = eigsh(stiffness, asked, mass, sigma=shift, OPinv=inverse, v0=start)
        order = np.argsort(values)
        values, vectors = values[order], vectors[:, order]
        if values[-1] > highest or asked == shifted.shape[0] - 1:
            break
        asked *= 2
    if max(abs(values[:rigid])) > RIGID * values[rigid]:
        raise ArithmeticError("the shoe's first free mode is lost in round-off: it is too slender")
    kept = slice(rigid, max(rigid, int(np.searchsorted(values, highest, side="right"))))
    return values[kept], vectors[:, kept]
