"""Finite elements of a drum, a cup clamped at its hub: biquadratic ones on its section, Fourier's harmonics around.

u_r = U(r, z) cos nθ, u_θ = V(r, z) sin nθ, u_z = W(r, z) cos nθ: each harmonic n is a problem of its own.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from drumsqueal.physics.bodies.elements import SMALL_SHIFT, gather, lowest_modes, residual_shapes

Reals = NDArray[np.float64]

# Elements narrow like s^GRADED towards the corner between ring and plate and towards the hub, where stresses are
# singular: evenly spaced ones of the same number leave seven times the error in the lowest frequencies.
GRADED = 2.0
INTEGRATED = 5  # the degree that quadrature is exact for: 9 points an element, full integration


class Cup(NamedTuple):
    """A ring from the inner radius outwards, |z| ≤ width/2, and a plate beyond z = width/2 from the hub on (m)."""

    inner_radius: float
    thickness: float
    width: float
    back_plate: float
    hub_radius: float


class Mesh(NamedTuple):
    """Elements through the ring, along its width, through the plate, and along the plate within the ring."""

    thickness: int
    width: int
    back_plate: int
    plate: int


class Section(NamedTuple):
    """The section's elements, of E = ρ = 1: displacements at nodes (3 for each), those free, and the ring's inner side.

    `strains` (elements, points, 6, 27) of harmonic n are the first plus n times the second; `stress` (6, 6) times them,
    and `area` r dr dz (elements, points). `mass` is that of each direction; `inside` are the nodes on the inner radius
    by rising z.
    """

    strains: tuple[Reals, Reals]
    stress: Reals
    area: Reals
    places: NDArray[np.int32]
    mass: Any
    free: NDArray[np.int64]
    inside: NDArray[np.int64]
    z: Reals


def section_of(cup: Cup, poisson: float, mesh: Mesh) -> Section:
    """Elements of a cup's section."""
    from skfem import Basis, ElementQuad2, MeshQuad  # where a drum bends, and not with every start

    R, h, b, plate, hub = cup
    even = [np.linspace(0, 1, n + 1) for n in mesh]
    through, along, through_plate, along_plate = even
    both = along_plate**GRADED / (along_plate**GRADED + (1 - along_plate) ** GRADED)
    radii = np.concatenate([hub + (R - hub) * both, (R + h * through**GRADED)[1:]])
    heights = np.concatenate([b / 2 - b * (1 - along) ** GRADED, (b / 2 + plate * through_plate**GRADED)[1:]])
    grid = MeshQuad.init_tensor(radii, heights)
    middle = grid.p[:, grid.t].mean(axis=1)
    grid = grid.remove_elements(np.flatnonzero((middle[0] < R) & (middle[1] < b / 2)))
    basis = Basis(grid, ElementQuad2(), intorder=INTEGRATED)
    r, z = basis.doflocs
    fields: Any = [shape[0] for shape in basis.basis]
    value = np.stack([np.broadcast_to(np.asarray(field), basis.dx.shape) for field in fields], axis=-1)
    slope = np.stack([field.grad for field in fields], axis=-1)
    radius = np.asarray(basis.global_coordinates())[0]
    area = basis.dx * radius
    places = basis.element_dofs.T.astype(np.int32)
    mass = gather(np.einsum("eqa,eqb,eq->eab", value, value, area, optimize=True), places, r.size)
    number = np.arange(3 * r.size).reshape(-1, 3)
    inside = np.flatnonzero(np.isclose(r, R, rtol=1e-9) & (z <= b / 2 * (1 + 1e-9)))
    inside = inside[np.argsort(z[inside])]
    return Section(
        _strains(value, slope, radius),
        _stress(poisson),
        area,
        (3 * places[:, :, None] + np.arange(3, dtype=np.int32)).reshape(len(places), -1),
        sparse.csr_array(sparse.kron(mass, np.eye(3))),
        np.setdiff1d(number.ravel(), number[np.isclose(r, hub, rtol=1e-9)].ravel()),
        inside,
        z[inside],
    )


def _strains(value: Reals, slope: Reals, radius: Reals) -> tuple[Reals, Reals]:
    """ε_rr, ε_θθ, ε_zz, γ_zr (times cos nθ), γ_rθ, γ_θz (times sin nθ) of U, V, W of each shape function.

    U_r; (U + n V)/r; W_z; U_z + W_r; V_r − V/r − n U/r; V_z − n W/r.
    """
    along_r, along_z, over_r = slope[0], slope[1], value / radius[..., None]
    steady, with_n = np.zeros((2, *value.shape[:2], 6, value.shape[2], 3))
    steady[..., 0, :, 0], steady[..., 1, :, 0], steady[..., 2, :, 2] = along_r, over_r, along_z
    steady[..., 3, :, 0], steady[..., 3, :, 2] = along_z, along_r
    steady[..., 4, :, 1], steady[..., 5, :, 1] = along_r - over_r, along_z
    with_n[..., 1, :, 1], with_n[..., 4, :, 0], with_n[..., 5, :, 2] = over_r, -over_r, -over_r
    shape = (*value.shape[:2], 6, -1)
    return steady.reshape(shape), with_n.reshape(shape)


def _stress(poisson: float) -> Reals:
    """Stresses of unit strains, E = 1."""
    first, second = poisson / ((1 + poisson) * (1 - 2 * poisson)), 1 / (2 * (1 + poisson))
    found = np.diag([2 * second] * 3 + [second] * 3)
    found[:3, :3] += first
    return found


def modes_of_harmonic(
    section: Section, n: int, highest: float, expected: int, pressures: int = 0
) -> tuple[Reals, Reals]:
    """Wavenumbers (m,) up to the highest of n waves around, and U, V, W on the inner side (m, 3, nodes).

    ∫|ψ|² dV = 1: around, cos² and sin² have the mean ½, and of n = 0 motion along and across θ are apart. So many
    polynomials of z as pressures add how the drum yields to these, beyond its modes.
    """
    steady, with_n = section.strains
    strain = steady + n * with_n
    stiffness = np.einsum("eqsa,st,eqtb,eq->eab", strain, section.stress, strain, section.area, optimize=True)
    free = section.free
    both = gather(stiffness, section.places, section.mass.shape[0]), section.mass
    kept, mass = (whole[free][:, free].tocsc() for whole in both)
    shifted = (kept + SMALL_SHIFT * highest**2 * mass).tocsc()
    solve = splu(shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}).solve
    squares, found = lowest_modes(kept, mass, highest**2, 0, expected, solve)
    if pressures:
        more, dents = residual_shapes(kept, mass, found, solve, _loads(section, pressures)[free])
        squares, found = np.concatenate([squares, more]), np.hstack([found, dents])
    whole = np.zeros((section.mass.shape[0], found.shape[1]))
    whole[free] = found / np.sqrt(np.pi if n else 2 * np.pi)
    inside = whole.reshape(len(whole) // 3, 3, found.shape[1])[section.inside]
    return np.sqrt(squares), np.moveaxis(inside, (0, 1, 2), (2, 1, 0))


def _loads(section: Section, count: int) -> Reals:
    """Generalised forces (unknowns, count) of radial pressures on the inner side: Legendre's polynomials of z."""
    point, weight = leggauss(count + 2)
    corners = section.z[::2]
    half = np.diff(corners)[:, None] / 2
    z = corners[:-1, None] + half * (1 + point)
    pressures = legvander(2 * (z - z.min()) / np.ptp(z) - 1, count - 1)
    quadratic = np.stack([point * (point - 1) / 2, 1 - point**2, point * (point + 1) / 2], axis=1)
    parts = np.einsum("q,eo,qi,eqk->eik", weight, half, quadratic, pressures, optimize=True)
    loads = np.zeros((len(section.z), count))
    for k in range(3):
        loads[k : k - 2 or None : 2] += parts[:, k]
    whole = np.zeros((section.mass.shape[0], count))
    whole[3 * section.inside] = loads
    return whole
