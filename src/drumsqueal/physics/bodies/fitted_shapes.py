"""Polynomials fitted to finite-element shapes of a sector, orthonormal and free of rigid motion to round-off."""

from typing import Any

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander
from numpy.typing import NDArray

from drumsqueal.physics.bodies.sector_elements import Mesh, Modes, Parity, Sector, node_lines

Reals = NDArray[np.float64]
Degrees = tuple[int, int, int]  # how many along r, θ and z, the constant with them

NOT_NEEDED = 3e-5  # of a shape, root mean squares compared: higher degrees with less in all are left out
SIGNIFICANT = 0.1  # of the largest displacement of a place: more than round-off by far
# Least squares on n equispaced points are well conditioned up to a degree of some 2.5 sqrt(n).
STABLE, MOST = 2.4, 40


def fit_shapes(sector: Sector, mesh: Mesh, modes: Modes, degrees: Degrees) -> tuple[Reals, float]:
    """Coefficients (n, 3, degrees of r, θ, z) of modes known at nodes, and the largest error of one, relative to it.

    Least squares of the nodes' values, weighted by Simpson's rule for the volume. Only polynomials of the modes' own
    parity are used.
    """
    lines, weights = node_lines(sector, mesh), _simpson(sector, mesh)
    scaled = _scaled(sector, lines)
    shapes = np.concatenate([_rigid_motions(modes.parity, lines), modes.shapes])
    coefficients = np.zeros((len(shapes), 3, *degrees))
    missed = total = 0.0
    for component in range(3):
        used = _degrees(modes.parity, component, degrees)
        bases = [legvander(x, n - 1)[:, k] for x, n, k in zip(scaled, degrees, used, strict=True)]
        fits = [
            np.linalg.lstsq(np.sqrt(w)[:, None] * V, np.diag(np.sqrt(w)))[0]
            for V, w in zip(bases, weights, strict=True)
        ]
        values = shapes[:, component]
        found = np.einsum("ai,bj,ck,njik->nabc", *fits, values, optimize=True)
        coefficients[:, component][np.ix_(np.arange(len(found)), *used)] = found
        again = np.einsum("ia,jb,kc,nabc->njik", *bases, found, optimize=True)
        missed += np.einsum("i,j,k,njik->n", *weights, (again - values) ** 2, optimize=True)
        total += np.einsum("i,j,k,njik->n", *weights, values**2, optimize=True)
    error = float(np.sqrt(np.max(missed / total)))
    rigid, elastic = np.split(coefficients, [modes.parity.rigid])
    return _orthonormalise(sector, rigid, elastic), error


def most_degrees(mesh: Mesh) -> Degrees:
    """What the nodes of a mesh can tell apart, those of the mirrored parts among them."""
    r, angle, z = (
        int(min(MOST, STABLE * np.sqrt(n) + 1)) for n in (2 * mesh.r + 1, 4 * mesh.angle + 1, 4 * mesh.z + 1)
    )
    return min(r, 2 * mesh.r + 1), angle, z


def enough_degrees(coefficients: Reals) -> Degrees:
    """The fewest that hold all shapes but for what is not needed; two along r and z, as rigid motions take."""
    if not len(coefficients):
        return 2, coefficients.shape[3], 2
    sizes = [2 * np.arange(n) + 1 for n in coefficients.shape[2:]]
    energy = np.einsum("ncabk,a,b,k->nabk", coefficients**2, *(1 / size for size in sizes))
    r, angle, z = (max(2, fewest(np.sum(energy, tuple({1, 2, 3} - {axis + 1})))) for axis in range(3))
    return r, angle, z


def fewest(energy: Reals, not_needed: float = NOT_NEEDED) -> int:
    """How many degrees hold all shapes but for what is not needed, by the squares of each one's parts (n, degrees)."""
    tail = np.sqrt(np.cumsum(energy[:, ::-1], axis=1)[:, ::-1])
    return int(np.max(np.sum(tail > not_needed * tail[:, :1], axis=1), initial=0))


def harmonics(theta: Any, count: int, xp: Any = np) -> Any:
    """1, cos θ, sin θ, cos 2θ, … at angles (rad), (..., count), by the library `xp`: NumPy, or JAX's."""
    order, is_sine = (np.arange(count) + 1) // 2, (np.arange(count) % 2 == 0) & (np.arange(count) > 0)
    phases = xp.asarray(theta)[..., None] * order
    return xp.where(is_sine, xp.sin(phases), xp.cos(phases))


def signs_of(place: Reals) -> Reals:
    """What makes the first of u_r, u_θ and u_z that moves much at a place (3, n) positive, of each shape (n,)."""
    moves = np.abs(place) > SIGNIFICANT * np.max(np.abs(place), axis=0, initial=0.0)
    return np.sign(np.take_along_axis(place, np.argmax(moves, axis=0)[None], axis=0)[0])


def _degrees(parity: Parity, component: int, degrees: Degrees) -> list[Any]:
    """Degrees along r, θ and z of a component's polynomials."""
    firsts = [0 if even else 1 for even in parity.even(component)]
    return [np.arange(degrees[0]), *(np.arange(first, n, 2) for first, n in zip(firsts, degrees[1:], strict=True))]


def _simpson(sector: Sector, mesh: Mesh) -> list[Reals]:
    """Weights of the nodes along r, θ and z; r's with the r of dV = r dr dθ dz."""
    found = []
    lines = node_lines(sector, mesh)
    for line in lines:
        weight, length = np.zeros_like(line), line[2::2] - line[:-2:2]
        weight[:-2:2], weight[1::2] = length / 6, length * 4 / 6
        weight[2::2] += length / 6
        found.append(weight)
    return [found[0] * lines[0], *found[1:]]


def _scaled(sector: Sector, lines: tuple[Reals, Reals, Reals]) -> list[Reals]:
    R, h, b, beta = sector
    r, angle, z = lines
    return [(r - R + h / 2) * 2 / h, angle * 2 / beta, z * 2 / b]


def inner_products(sector: Sector, one: Reals, other: Reals) -> Reals:
    """∫ψ_i·ψ_j dV (i, j) of shapes that are given by their coefficients, exact to round-off."""
    R, h, b, beta = sector
    sizes = one.shape[2:]
    x, w = leggauss(sizes[0] + 1)
    V = legvander(x, sizes[0] - 1)
    of_r = V.T @ (V * (w * (R - h / 2 + h / 2 * x) * h / 2)[:, None])
    of_angle, of_z = (size / (2 * np.arange(n) + 1) for n, size in zip(sizes[1:], (beta, b), strict=True))
    return np.einsum("mcabk,ad,b,k,ncdbk->mn", one, of_r, of_angle, of_z, other, optimize=True)


def _orthonormalise(sector: Sector, rigid: Reals, coefficients: Reals) -> Reals:
    """The nearest shapes that are orthonormal, and orthogonal to rigid motions."""
    share = inner_products(sector, coefficients, rigid) @ np.linalg.inv(inner_products(sector, rigid, rigid))
    elastic = coefficients - np.tensordot(share, rigid, 1)
    values, vectors = np.linalg.eigh(inner_products(sector, elastic, elastic))
    return np.tensordot((vectors / np.sqrt(values)) @ vectors.T, elastic, 1)


def _rigid_motions(parity: Parity, lines: tuple[Reals, Reals, Reals]) -> Reals:
    """u_r, u_θ, u_z at the nodes of the rigid motions of a parity, like the shapes of modes: X; Y, Tz; Z, Ty; Tx."""
    r, angle, z = lines[0][:, None], lines[1][:, None, None], lines[2]
    cosine, sine, none, one = np.cos(angle), np.sin(angle), 0.0 * z, 1.0 + 0.0 * z
    fields = {
        Parity(in_z=True, in_angle=True): [(cosine, -sine, none)],
        Parity(in_z=True, in_angle=False): [(sine, cosine, none), (none, r, none)],
        Parity(in_z=False, in_angle=True): [(none, none, one), (z * cosine, -z * sine, -r * cosine)],
        Parity(in_z=False, in_angle=False): [(-z * sine, -z * cosine, r * sine)],
    }[parity]
    shape = np.broadcast_shapes(r.shape, angle.shape, z.shape)
    return np.array([[np.broadcast_to(part, shape) for part in field] for field in fields])
