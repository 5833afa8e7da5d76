"""A shoe on a drum without modal reduction: complex eigenvalues of all of its unknowns, which share nothing with src.

u_x, u_y, u_z are either scikit-fem's quadratic hexahedra, or one element of products of Legendre polynomials, which
converges faster. The supports act on the mean displacement along x and the mean rotation of the shoe's mass.
"""

from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.polynomial import legendre
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, eigs, splu


class WholeShoe(NamedTuple):
    """Outer radius R, thickness h, width b (m), arc angle β (rad); E (Pa), ν and ρ (kg/m³)."""

    outer_radius: float
    thickness: float
    width: float
    arc_angle: float
    young: float
    poisson: float
    density: float


class Matrices(NamedTuple):
    """Of n unknowns: mass M and stiffness K; ∫N_r N_rᵀ, ∫N_θ N_rᵀ, ∫N_θ N_θᵀ and ∫N_z N_zᵀ dA; rows of X and of Tz."""

    mass: Any
    stiffness: Any
    radial: Any
    coupling: Any
    along: Any
    axial: Any
    push: Any
    turn: Any


class Brake(NamedTuple):
    """k_c (N/m³), load (N), Ω (rad/s), k1 + k2 (N/m), μ_s, μ_k, α (s/m) and ζ (0 for finite elements)."""

    contact: float = 0.35e11
    load: float = 2000.0
    speed: float = 5.0
    support: float = 7e8
    static: float = 0.5
    kinetic: float = 0.3
    decay: float = 1.0
    damping: float = 0.0


def assemble_elements(shoe: WholeShoe, elements: tuple[int, int, int]) -> Matrices:
    """Of quadratic hexahedra with 27 nodes, elements along r, θ and z of the whole shoe."""
    from skfem import Basis, BilinearForm, ElementHex2, ElementVector, FacetBasis, LinearForm, MeshHex, MeshHex2
    from skfem.helpers import ddot, dot, eye, sym_grad, trace

    R, h, b, beta, young, poisson, density = shoe
    ends = ((R - h, R), (-beta / 2, beta / 2), (-b / 2, b / 2))
    grid = MeshHex2.from_mesh(
        MeshHex.init_tensor(*(np.linspace(*end, n + 1) for end, n in zip(ends, elements, strict=True)))
    )
    r, angle, z = grid.doflocs
    mesh = MeshHex2(np.stack([r * np.cos(angle), r * np.sin(angle), z]), grid.t)
    body = Basis(mesh, ElementVector(ElementHex2()), intorder=5)
    first, second = young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))

    @BilinearForm
    def elastic(u, v, w):
        strain = sym_grad(u)
        return ddot(first * eye(trace(strain), 3) + 2 * second * strain, sym_grad(v))

    mass = density * BilinearForm(lambda u, v, w: dot(u, v)).assemble(body)
    # The facets are chosen on the straight grid, where the lining is a plane.
    lining = FacetBasis(mesh, ElementVector(ElementHex2()), facets=grid.facets_satisfying(lambda x: x[0] > R - h / 1e3))

    def radially(u, x):
        return (u[0] * x[0] + u[1] * x[1]) / np.hypot(x[0], x[1])

    def along(u, x):
        return (u[1] * x[0] - u[0] * x[1]) / np.hypot(x[0], x[1])

    def on_lining(row, column):
        return BilinearForm(lambda u, v, w: column(u, w.x) * row(v, w.x)).assemble(lining)

    volume = np.sum(body.dx)
    centroid = np.sum(body.global_coordinates()[0] * body.dx) / volume
    ahead, across = body.global_coordinates()[0] - centroid, body.global_coordinates()[1]
    moment = np.sum((ahead**2 + across**2) * body.dx)
    push = LinearForm(lambda v, w: v[0]).assemble(body) / volume
    turn = LinearForm(lambda v, w: (w.x[0] - centroid) * v[1] - w.x[1] * v[0]).assemble(body) / moment
    return Matrices(
        mass,
        elastic.assemble(body),
        on_lining(radially, radially),
        on_lining(along, radially),
        on_lining(along, along),
        on_lining(lambda u, x: u[2], lambda u, x: u[2]),
        push,
        turn,
    )


def assemble_polynomials(shoe: WholeShoe, degrees: tuple[int, int, int], *, even: bool) -> Matrices:
    """Of polynomials along r, θ and z, so many of each; motion in the plane even in z, or odd."""
    R, h, b, beta, young, poisson, density = shoe
    (xr, wr), (xt, wt), (xz, wz) = rules = [legendre.leggauss(count + 4) for count in degrees]
    r, angle = R - h / 2 + h / 2 * xr, beta / 2 * xt
    weight = np.einsum("i,j,k->ijk", wr * r * h / 2, wt * beta / 2, wz * b / 2).ravel()
    values, slopes, radius, turned = _fields(shoe, degrees, [x for x, _ in rules], even=even)
    cosine, sine = np.cos(turned), np.sin(turned)
    first, second = young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))

    def energy(i, p, j, q):
        return slopes[i][p].T @ (weight[:, None] * slopes[j][q])

    def block(i, j):
        found = first * energy(i, i, j, j) + second * energy(i, j, j, i)
        return found + second * sum(energy(i, p, i, p) for p in range(3)) if i == j else found

    mass = scipy.linalg.block_diag(*(density * value.T @ (weight[:, None] * value) for value in values))
    none = np.zeros(values[2].shape[1])
    x, y = (radius * cosine).ravel(), (radius * sine).ravel()
    x = x - weight @ x / np.sum(weight)
    push = np.concatenate([weight @ values[0], 0 * (weight @ values[1]), none]) / np.sum(weight)
    turn = np.concatenate([-(weight * y) @ values[0], (weight * x) @ values[1], none]) / (weight @ (x**2 + y**2))

    area = R * np.einsum("j,k->jk", wt * beta / 2, wz * b / 2).ravel()
    surface, *_ = _fields(shoe, degrees, [np.ones(1), xt, xz], even=even)
    u_x, u_y, u_z = (
        np.hstack([each if k == component else np.zeros_like(each) for k, each in enumerate(surface)])
        for component in range(3)
    )
    turned = np.repeat(angle, len(xz))[:, None]
    u_r, u_along = np.cos(turned) * u_x + np.sin(turned) * u_y, np.cos(turned) * u_y - np.sin(turned) * u_x

    def on_lining(row, column):
        return row.T @ (area[:, None] * column)

    stiffness = np.block([[block(i, j) for j in range(3)] for i in range(3)])
    of_lining = on_lining(u_r, u_r), on_lining(u_along, u_r), on_lining(u_along, u_along), on_lining(u_z, u_z)
    return Matrices(mass, stiffness, *of_lining, push, turn)


def _fields(shoe: WholeShoe, degrees: tuple[int, int, int], scaled: Any, *, even: bool) -> Any:
    """Polynomials of u_x, u_y and u_z and their slopes along x, y and z on a grid of scaled places, and its r and θ."""
    R, h, b, beta, *_ = shoe
    lines = [(legendre.legvander(x, n - 1), _slopes(x, n)) for x, n in zip(scaled, degrees, strict=True)]
    (Pr, Dr), (Pt, Dt), (Pz, Dz) = lines
    places = np.meshgrid(R - h / 2 + h / 2 * scaled[0], beta / 2 * scaled[1], scaled[2], indexing="ij")
    radius, turned, _ = (each.reshape(-1, 1) for each in places)
    cosine, sine = np.cos(turned), np.sin(turned)

    def products(*factors):
        return np.einsum("ia,jb,kc->ijkabc", *factors).reshape(len(radius), -1)

    values, slopes = [], []
    for kept in [slice(0 if even else 1, None, 2)] * 2 + [slice(1 if even else 0, None, 2)]:
        values.append(products(Pr, Pt, Pz[:, kept]))
        by_r, by_angle = products(Dr * 2 / h, Pt, Pz[:, kept]), products(Pr, Dt * 2 / beta, Pz[:, kept]) / radius
        by_z = products(Pr, Pt, Dz[:, kept] * 2 / b)
        slopes.append([cosine * by_r - sine * by_angle, sine * by_r + cosine * by_angle, by_z])
    return values, slopes, radius, turned


def _slopes(x: Any, count: int) -> Any:
    """Slopes of Legendre polynomials."""
    return np.stack([legendre.legval(x, legendre.legder(each)) for each in np.eye(count)], axis=1)


def held_at(shoe: WholeShoe, degrees: tuple[int, int, int], foot: Any, arm: Any, *, even: bool) -> Any:
    """Displacement (3, unknowns) of the end of a rigid arm (3,) in m that stands on r, θ, z of a shoe of polynomials.

    u + ½ curl u × arm.
    """
    r, angle, z = foot
    scaled = (r - shoe.outer_radius) * 2 / shoe.thickness + 1, angle * 2 / shoe.arc_angle, z * 2 / shoe.width
    values, slopes, *_ = _fields(shoe, degrees, [np.array([each]) for each in scaled], even=even)
    u = scipy.linalg.block_diag(*values)
    by_x, by_y, by_z = (scipy.linalg.block_diag(*(each[k] for each in slopes)) for k in range(3))
    turn = np.stack([by_y[2] - by_z[1], by_z[0] - by_x[2], by_x[1] - by_y[0]]) / 2  # pyright: ignore
    return u + np.cross(turn, np.asarray(arm)[:, None], axis=0)


def squeal_eigenvalues(matrices: Matrices, shoe: WholeShoe, brake: Brake, highest: float, number: int) -> Any:
    """Eigenvalues (1/s) with 0 < Im λ < 2π highest of equation (29) with a shoe that bends, in order of frequency.

    Some `number` of them are expected: shift-invert about the middle of the range.
    """
    n = matrices.push.size
    slip = shoe.outer_radius * brake.speed
    pressure = brake.load / (shoe.outer_radius * shoe.arc_angle * shoe.width)
    fall = (brake.static - brake.kinetic) * np.exp(-brake.decay * slip)
    friction = brake.kinetic + fall
    damping = friction * pressure / slip * matrices.axial - brake.decay * fall * pressure * matrices.along
    stiffness = matrices.stiffness + brake.contact * (matrices.radial - friction * matrices.coupling)
    # Springs k of the mean motions s: one unknown more for each, k s.
    springs = np.stack([matrices.push, shoe.outer_radius * matrices.turn], axis=1) * np.sqrt(brake.support)
    dense = isinstance(stiffness, np.ndarray)
    if brake.damping:
        frictionless = matrices.stiffness + brake.contact * matrices.radial + springs @ springs.T
        squares, modes = scipy.linalg.eigh(frictionless, matrices.mass)
        shaped = matrices.mass @ modes
        damping = damping + 2 * brake.damping * (shaped * np.sqrt(np.maximum(squares, 0))) @ shaped.T
    shift = 1j * np.pi * highest
    shifted = stiffness + shift * (damping + shift * matrices.mass)
    if dense:
        factors = scipy.linalg.lu_factor(shifted + springs @ springs.T)

        def solve(force):
            return scipy.linalg.lu_solve(factors, force)
    else:
        bordered = splu(sparse.block_array([[shifted, springs], [springs.T, -np.eye(2)]], format="csc"))

        def solve(force):
            return bordered.solve(np.concatenate([force, np.zeros(2)]))[:n]

    def inverted(state):
        u, v = np.split(state.ravel(), 2)
        found = -solve(matrices.mass @ v + damping @ u + shift * (matrices.mass @ u))
        return np.concatenate([found, u + shift * found])

    make: Any = LinearOperator  # whose arguments its stubs do not know
    operator = make((2 * n, 2 * n), matvec=inverted, dtype=complex)
    start = np.random.default_rng(0).standard_normal(2 * n) + 0j
    found: Any = eigs(operator, 2 * number, v0=start, return_eigenvectors=False)
    values = shift + 1 / found
    values = values[np.argsort(values.imag)]
    # All that is nearer to the shift than the ends of the range was found where the farthest lies beyond them.
    assert np.max(np.abs(values - shift)) > np.pi * highest
    return values[(values.imag > 1.0) & (values.imag < 2 * np.pi * highest)]
