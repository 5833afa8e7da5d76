"""How an annular sector bends: its free modes, when nothing holds it, and the dents that forces on it leave.

A Ritz method: u_r, u_θ and u_z are sums of products of Legendre polynomials of r, θ and z, whose energies are integrals
along lines. They are found for unit Young's modulus and unit density: circular frequencies are sqrt(E/ρ) times the
wavenumbers, and shapes of unit modal mass 1/sqrt(ρ) times those here, so that derivatives by E and ρ are known.
"""

import functools
from collections.abc import Iterator
from itertools import product
from typing import Any, NamedTuple, Self

import equinox as eqx
import numpy as np
import scipy.linalg
from numpy.polynomial.legendre import legder, leggauss, legval, legvander
from scipy import sparse

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.elements import NOTHING, SMALL_SHIFT, Indices, Reals, lowest_modes
from drumsqueal.physics.bodies.mode_shapes import Sector, kept, products_held_at, signs_of

Patch = tuple[float, float, float, float]
"""Place x, y, z and radius (m) of where a force acts."""

# A dent is as wide as the body is thick: pressures on the lining have waves down to so many thicknesses. With half of
# it, growth rates of elastic_drum change by 0.06 of 1 1/s or 1 %.
SHORTEST_WAVE = 1.75
MORE_DEGREES = 6  # beyond half the wavenumber times the size, at which polynomials begin to follow a wave
MOST_OF_DENTS = 24  # along each direction, of a long thin shoe, which bends before it is dented
MOST_MODES = 400
MOST_UNKNOWNS = 7000  # of one parity: 400 MB for each matrix, and some ten seconds
ROUND_OFF = 1e-14
FIRST_ASKED = 12  # modes of one parity


class FreeModes(eqx.Module):
    """Shapes in which a sector bends, in the order of frequency, for E = 1 Pa and ρ = 1 kg/m³.

    `wavenumbers` (n,) are ω sqrt(ρ/E) in 1/m, of free modes and then of what else the shapes are. `symmetric` are those
    that motion in the plane can move: u_r and u_θ even in z, u_z odd. `coefficients` (n, 3, degrees of r, θ, z) give
    u_r, u_θ, u_z by `shapes_at`, with ∫ψ_i·ψ_j dV = δ_ij and no rigid motion.
    """

    wavenumbers: Any
    coefficients: Any
    symmetric: tuple[bool, ...] = eqx.field(static=True)

    @classmethod
    def of_arrays(cls, arrays: Any) -> Self:
        """From the arrays by name, as they are kept."""
        return cls(arrays["wavenumbers"], arrays["coefficients"], tuple(map(bool, arrays["symmetric"])))

    def combined(self, sums: Reals) -> Self:
        """Sums (k, n) of the shapes, orthogonal and of one parity each, or of none that is symmetric."""
        coefficients: Any = np.tensordot(sums, self.coefficients, 1)
        symmetric = [all(np.array(self.symmetric)[row != 0]) for row in sums]
        found = np.sqrt(sums**2 @ self.wavenumbers**2), coefficients * _signs(coefficients), tuple(symmetric)
        return type(self)(*found)

    def mirrored(self) -> Self:
        """Those of the mirror image in the plane θ = 0, where u_r, u_z and even powers of θ stay as they are."""
        signs = (-1.0) ** (np.arange(self.coefficients.shape[3]) + np.array([[0], [1], [0]]))
        coefficients = self.coefficients * signs[:, None, :, None]
        return type(self)(self.wavenumbers, coefficients * _signs(coefficients), self.symmetric)


class Parity(NamedTuple):
    """Whether motion in the plane is even in z, and whether u_r is even in θ, as in a stretched spring."""

    in_z: bool
    in_angle: bool

    def even(self, component: int) -> tuple[bool, bool]:
        """Whether u_r, u_θ or u_z is even in θ and in z."""
        return self.in_angle ^ (component == 1), self.in_z ^ (component == 2)


# The sector is its own mirror image in the planes z = 0 and θ = 0, so each of its modes is even or odd in both, but for
# those of equal frequency, which can be chosen so.
PARITIES = tuple(Parity(*each) for each in product((True, False), repeat=2))


@functools.lru_cache(maxsize=32)
def find_free_modes(
    sector: Sector, poisson: float, highest: float, patches: tuple[Patch, ...] | None = None
) -> FreeModes:
    """Free modes of an annular sector up to a wavenumber 2π f sqrt(ρ/E) (1/m); rigid motions are left out.

    With patches, none of them or some, also how the sector yields to smooth pressures on the lining and to forces at
    these, beyond its modes: what is above the highest wavenumber is that. What was once found is kept in the user's
    cache folder. Raises RequestError where there are too many modes or too many polynomials, and ArithmeticError where
    round-off hides the first of them.
    """
    if patches and sum(y for _, y, _, _ in patches) < 0:  # as of the other of two shoes, whose mirror image this one is
        patches = tuple((x, -y, z, radius) for x, y, z, radius in patches)
        return find_free_modes(sector, poisson, highest, patches).mirrored()
    sector, poisson, highest = Sector(*map(float, sector)), float(poisson), float(highest)
    told = *sector, poisson, highest, *(() if patches is None else (1.0, *np.ravel(patches).tolist()))
    found = FreeModes.of_arrays(kept("sector", told, lambda: vars(_find(sector, poisson, highest, patches))))
    for array in (found.wavenumbers, found.coefficients):  # which all who ask share
        array.setflags(write=False)
    return found


def bending_wavenumber(thickness: float, poisson: float, highest: float) -> float:
    """2π over the wavelength of bending (1/m), or more: that of a thin plate and that of surface waves together."""
    thin = np.sqrt(highest * np.sqrt(12 * (1 - poisson**2)) / thickness)
    # Thick bodies bend at most at the speed of surface waves, 0.575 sqrt(E/ρ) (ν = 0.3).
    return float(np.hypot(thin, highest / 0.575))


def shortest_waves(thickness: float, poisson: float, highest: float) -> float:
    """The wavenumber (1/m) up to which pressures have waves: those of bending, and those that dent."""
    return max(bending_wavenumber(thickness, poisson, highest), 2 * np.pi / (SHORTEST_WAVE * thickness))


def half_waves(size: float, bending: float, waves: float) -> int:
    """The degree of polynomials on so long a line (m) that begins to follow waves (1/m) of bending, and of dents."""
    return max(min(int(np.ceil(waves * size / 2)), MOST_OF_DENTS), int(np.ceil(bending * size / 2)))


def _find(sector: Sector, poisson: float, highest: float, patches: tuple[Patch, ...] | None) -> FreeModes:
    _check_number(sector, poisson, highest)
    degrees = _degrees(sector, poisson, highest)
    loads = None if patches is None else _loads(sector, degrees, patches)
    found = [_of_parity(each, sector, poisson, degrees, highest, loads) for each in PARITIES]
    wavenumbers, coefficients = (np.concatenate(parts) for parts in zip(*found, strict=True))
    symmetric = np.repeat([each.in_z for each in PARITIES], [len(each) for each, _ in found])
    order = np.argsort(wavenumbers, kind="stable")
    coefficients = coefficients[order]
    return FreeModes(wavenumbers[order], coefficients * _signs(coefficients), tuple(map(bool, symmetric[order])))


def _signs(coefficients: Reals) -> Reals:
    """What makes u_r positive at the lining's corner, where all polynomials are 1, or the first that moves there."""
    return signs_of(np.sum(coefficients, axis=(2, 3, 4)).T)[:, None, None, None, None]


def _degrees(sector: Sector, poisson: float, highest: float) -> tuple[int, int, int]:
    """How many polynomials of r, θ and z, the constant with them. Raises RequestError where they are too many."""
    found = _wanted_degrees(sector, poisson, highest)
    if not _few_enough(found):
        lower = (p for p in range(95, 0, -5) if _few_enough(_wanted_degrees(sector, poisson, p / 100 * highest)))
        percent = next(lower, None)
        remedy = "make the shoe less slender" if percent is None else f"lower shoe.elastic.up_to to {percent} % of that"
        raise RequestError(
            f"the shoe's free modes in this range take {3 * int(np.prod(found))} products of polynomials, and at most "
            f"{4 * MOST_UNKNOWNS} are taken; {remedy}"
        )
    return found


def _wanted_degrees(sector: Sector, poisson: float, highest: float) -> tuple[int, int, int]:
    R, h, b, beta = sector
    waves = shortest_waves(h, poisson, highest)
    bending = bending_wavenumber(h, poisson, highest)

    radial, around, across = (half_waves(size, bending, waves) + MORE_DEGREES for size in (h, R * beta, b))
    return radial, around, across


def _few_enough(degrees: tuple[int, int, int]) -> bool:
    return 3 * int(np.prod(degrees)) <= 4 * MOST_UNKNOWNS


def _check_number(sector: Sector, poisson: float, highest: float) -> None:
    """Raise RequestError where there are many more modes than a model can keep, or no such material."""
    if not -1 < poisson < 0.5:
        raise RequestError(f"Poisson's ratio is {poisson:g}, and must be more than -1 and less than 0.5")
    R, h, b, beta = sector
    # A plate of area A has some A k²/4π modes of bending below the wavenumber k of bending.
    number = (R - h / 2) * beta * b * bending_wavenumber(h, poisson, highest) ** 2 / (4 * np.pi)
    check_number("shoe", "free modes", number)


def check_number(body: str, modes: str, number: float) -> None:
    """Raise RequestError where there are too many of them up to the frequency asked for."""
    if number > MOST_MODES:
        raise RequestError(
            f"the {body} has some {number:.0f} {modes} up to twice {body}.elastic.up_to, among which its shapes are "
            f"sought, and at most {MOST_MODES} are found; lower it to {100 * MOST_MODES / number:.0f} % of what it is"
        )


def line_products(low: float, high: float, count: int, powers: tuple[int, ...] = (0,)) -> Reals:
    """∫ P_a P_b s^p ds along r, θ or z, of so many polynomials and of their slopes: (powers, 2, 2, n, n)."""
    x, weight = leggauss(count + MORE_DEGREES * len(powers))  # 1/r is no polynomial
    half = (high - low) / 2
    place, values = (high + low) / 2 + half * x, legvander(x, count - 1)
    slopes = np.stack([legval(x, legder(each)) + 0 * x for each in np.eye(count)], axis=1) / half
    both = np.stack([values, slopes])
    weights = [weight * half * place**power for power in powers]
    return np.stack([np.einsum("iqa,q,jqb->ijab", both, w, both, optimize=True) for w in weights])


StrainTerm = tuple[int, tuple[int, int, int], int, int]
# Strains as sums of components (u_r, u_θ, u_z), differentiated along r, θ and z, times a power of r and a factor.
STRAINS = {
    "rr": ((0, (1, 0, 0), 0, 1),),
    "θθ": ((1, (0, 1, 0), -1, 1), (0, (0, 0, 0), -1, 1)),
    "zz": ((2, (0, 0, 1), 0, 1),),
    "rθ": ((0, (0, 1, 0), -1, 1), (1, (1, 0, 0), 0, 1), (1, (0, 0, 0), -1, -1)),
    "θz": ((2, (0, 1, 0), -1, 1), (1, (0, 0, 1), 0, 1)),
    "zr": ((2, (1, 0, 0), 0, 1), (0, (0, 0, 1), 0, 1)),
}
POWERS = (-1, 0, 1)  # of r, in products of two of their terms and r dr


def energy_terms(poisson: float) -> Iterator[tuple[StrainTerm, StrainTerm, float]]:
    """Twice the elastic energy, E = 1: products of two terms of strains, and a factor."""
    first, second = poisson / ((1 + poisson) * (1 - 2 * poisson)), 1 / (2 * (1 + poisson))
    for (name, strain), (other, stress) in product(STRAINS.items(), repeat=2):
        normal = name[0] == name[1] and other[0] == other[1]
        factor = first * normal + (2 * second if normal else second) * (name == other)
        yield from ((one, also, factor) for one, also in product(strain, stress) if factor)


def _energies(
    sector: Sector, poisson: float, degrees: tuple[int, int, int], parity: Parity
) -> tuple[Reals, Any, Indices]:
    """Of the polynomials of a parity stiffness and sparse mass (n, n), E = ρ = 1, and where each is among all (n,).

    Integrals along the three lines, multiplied.
    """
    R, h, b, beta = sector
    lines = (
        line_products(R - h, R, degrees[0], POWERS),
        line_products(-beta / 2, beta / 2, degrees[1]),
        line_products(-b / 2, b / 2, degrees[2]),
    )
    used = [[np.arange(degrees[0]), *_degrees_of(parity, c, degrees)] for c in range(3)]
    places = [np.ravel_multi_index(np.ix_([c], *each), (3, *degrees)).ravel() for c, each in enumerate(used)]
    ends = np.cumsum([0, *map(len, places)])
    stiffness, mass = np.zeros((2, ends[-1], ends[-1]))

    def add(matrix: Reals, one: tuple, other: tuple, factor: float) -> None:
        (i, along, power, sign), (j, also_along, also_power, also_sign) = one, other
        blocks = [
            line[power + also_power + 2 if k == 0 else 0, along[k], also_along[k]][np.ix_(used[i][k], used[j][k])]
            for k, line in enumerate(lines)
        ]
        block = np.einsum("ab,cd,ef->acebdf", *blocks, optimize=True).reshape(len(places[i]), len(places[j]))
        matrix[ends[i] : ends[i + 1], ends[j] : ends[j + 1]] += factor * sign * also_sign * block

    for one, other, factor in energy_terms(poisson):
        add(stiffness, one, other, factor)
    for c in range(3):
        still = (c, (0, 0, 0), 0, 1)
        add(mass, still, still, 1.0)
    mass[np.abs(mass) < ROUND_OFF * np.max(mass)] = 0.0  # most products are orthogonal
    return stiffness, sparse.csr_array(mass), np.concatenate(places)


def _degrees_of(parity: Parity, component: int, degrees: tuple[int, int, int]) -> list[Indices]:
    """Degrees along θ and z of a component's polynomials."""
    return [np.arange(not even, n, 2) for even, n in zip(parity.even(component), degrees[1:], strict=True)]


def _loads(sector: Sector, degrees: tuple[int, int, int], patches: tuple[Patch, ...]) -> Reals:
    """Generalised forces (k, polynomials) of smooth pressures on the lining, and of forces along x, y, z at patches."""
    _, along, across = (n - MORE_DEGREES for n in degrees)
    loads = []
    for a, c in product(range(along), range(across)):  # P_a(2θ/β) P_c(2z/b) at r = R, where all polynomials of r are 1
        pressure = np.zeros((3, *degrees))
        pressure[0, :, a, c] = 1.0
        loads.append(pressure.ravel())
    loads.extend(row.ravel() for patch in patches for row in products_held_at(degrees, sector, *patch))
    return np.array(loads)


def _of_parity(
    parity: Parity, sector: Sector, poisson: float, degrees: tuple[int, int, int], highest: float, loads: Reals | None
) -> tuple[Reals, Reals]:
    """Wavenumbers (n,) and coefficients (n, 3, degrees) of one parity: free modes, and answers to the loads."""
    stiffness, mass, places = _energies(sector, poisson, degrees, parity)
    factor = scipy.linalg.cho_factor(stiffness + SMALL_SHIFT * highest**2 * mass.toarray(), check_finite=False)

    def solve(forces: Reals) -> Reals:
        return scipy.linalg.cho_solve(factor, forces, check_finite=False)

    rigid = _rigid_motions(sector, degrees)[places]
    rigid = rigid[:, np.any(rigid != 0, axis=0)]
    rigid = rigid @ np.linalg.inv(np.linalg.cholesky(rigid.T @ (mass @ rigid))).T
    own = None
    if loads is not None:
        own = loads[:, places].T
        # Forces in a plane of symmetry have parts of other parities by round-off alone.
        own = own[:, np.linalg.norm(own, axis=0) > NOTHING * np.linalg.norm(loads, axis=1)]
    squares, found = lowest_modes(stiffness, mass, highest**2, rigid, FIRST_ASKED, solve, own)
    coefficients = np.zeros((found.shape[1], 3 * int(np.prod(degrees))))
    coefficients[:, places] = found.T
    return np.sqrt(squares), coefficients.reshape(-1, 3, *degrees)


def _rigid_motions(sector: Sector, degrees: tuple[int, int, int]) -> Reals:
    """Coefficients (polynomials, 6) of X, Y, Z and of turns about the drum's axes x, y and z."""
    R, h, b, beta = sector
    x, weight = leggauss(2 * degrees[1])
    into = (legvander(x, degrees[1] - 1) * weight[:, None]).T * (np.arange(degrees[1])[:, None] + 0.5)
    cosine, sine = into @ np.cos(beta / 2 * x), into @ np.sin(beta / 2 * x)
    cosine[1::2], sine[::2] = 0.0, 0.0
    even = np.eye(degrees[1])[0]
    one, radius = np.eye(degrees[0])[0], np.eye(degrees[0])[:2].T @ [R - h / 2, h / 2]
    still, height = np.eye(degrees[2])[0], np.eye(degrees[2])[1] * b / 2
    fields = [
        ((one, cosine, still), (one, -sine, still), None),
        ((one, sine, still), (one, cosine, still), None),
        (None, None, (one, even, still)),
        ((one, -sine, height), (one, -cosine, height), (radius, sine, still)),
        ((one, cosine, height), (one, -sine, height), (radius, -cosine, still)),
        (None, (radius, even, still), None),
    ]
    none = np.zeros(degrees)
    found = [[none if each is None else np.einsum("a,b,k->abk", *each) for each in field] for field in fields]
    return np.array(found).reshape(6, -1).T
