"""Modes of an elastic drum, a cup clamped at its hub: how the surface moves that linings rub on.

They are found for unit Young's modulus and unit density, as the shoe's are: circular frequencies are sqrt(E/ρ) times
the wavenumbers, and shapes of unit modal mass 1/sqrt(ρ) times those here. The drum is a body of revolution: modes of n
waves around come in pairs, of equal frequency, turned against each other by a quarter of a wave. They
stay fixed in space: gyroscopic and convective terms, of the order of drum speed over circular frequency, are left out.

A Ritz method for each n: of u_r = U cos nθ, u_θ = V sin nθ and u_z = W cos nθ, U, V and W are sums of products of
functions of r and of z, which are continuous, and polynomials in each of the cells into which r and z are divided.
"""

import functools
from itertools import pairwise
from typing import Any, NamedTuple, Self

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.polynomial.legendre import leggauss, legvander
from scipy import sparse

from drumsqueal.physics.bodies.elements import Indices, Reals, factorised, lowest_modes
from drumsqueal.physics.bodies.free_modes import (
    MORE_DEGREES,
    POWERS,
    ROUND_OFF,
    bending_wavenumber,
    check_number,
    energy_terms,
    half_waves,
    line_products,
    shortest_waves,
)
from drumsqueal.physics.bodies.mode_shapes import harmonics, kept, legendre, signs_of
from drumsqueal.precision import real

# Stresses are singular at the corner between ring and plate and at the hub: towards these, cells are a tenth as long as
# the one before, down to some 0.4 % of the thinner part. Beyond the degrees that follow waves, the smallest have one
# more, the next two and so on; the long ones of ring and plate also hold what decays from their ends. With four more
# degrees everywhere, or three, 0.15 and 0.1 %, frequencies fall by at most 1.1e-4 and 1.2e-4 of themselves (drums of
# elastic_drum and simplex, up to 16 kHz), 1.7e-4 (ring of 30 mm, plate of 20 mm) and 2.1e-4 (2 mm, 1.5 mm), and shapes
# change by up to 8e-4.
GRADED, FINEST = 0.1, 0.004
MOST_AROUND = 40  # waves of pressures, of a thin ring, which bends before it is dented
# Polynomials of z at least; shorter waves ask for more. What the corner leaves to higher ones is beside the plate: with
# 24 or 32, growth rates of elastic_drum change by 1.6e-3 1/s, and with 12 by 9e-3. Under the lining these would only
# ripple: there cells err by 1.4e-10 of the load with 16, by 6e-8 with 24 and by 1e-6 with 32.
DEGREES = 16
SLOPES = -1, 1, -1  # of U cos nθ, V sin nθ and W cos nθ along θ, over n times the other one of cosine and sine


class DrumModes(eqx.Module):
    """Modes of a drum in the order of frequency, for E = 1 Pa and ρ = 1 kg/m³, and how they move the ring's inner side.

    `wavenumbers` (m,) are ω sqrt(ρ/E) in 1/m, `harmonics` (m,) the waves around. `coefficients` (m, 3, F, K) give u_r,
    u_θ, u_z by `drum_shapes_at`, with ∫|ψ|² dV = 1.
    """

    wavenumbers: Any
    harmonics: Any
    coefficients: Any

    def combined(self, sums: Reals) -> Self:
        """Sums (k, m) of the shapes, orthonormal; what is not of one number of waves is said to have none."""
        waves = [set(self.harmonics[row != 0].tolist()) for row in sums]
        harmonics = np.array([each.pop() if len(each) == 1 else 0 for each in waves], dtype=int)
        coefficients, wavenumbers = np.tensordot(sums, self.coefficients, 1), np.sqrt(sums**2 @ self.wavenumbers**2)
        # At θ = 0 on the edge at z = −width/2, as modes have it, whose own signs stay.
        edge = coefficients[:, :, [0, *range(1, coefficients.shape[2], 2)]].sum(axis=2)
        signs = signs_of((edge @ (-1.0) ** np.arange(coefficients.shape[3])).T)
        signs[np.sum(sums != 0, axis=1) == 1] = 1.0
        coefficients = coefficients * np.where(signs == 0, 1.0, signs)[:, None, None, None]
        return type(self)(wavenumbers, harmonics, coefficients)


class Cup(NamedTuple):
    """A ring from the inner radius outwards, |z| ≤ width/2, and a plate beyond z = width/2 from the hub on (m).

    The plate is clamped at the hub and reaches to the ring's outer radius.
    """

    inner_radius: float
    thickness: float
    width: float
    back_plate: float
    hub_radius: float

    def bending(self, poisson: float, highest: float) -> list[float]:
        """2π over the wavelength of bending (1/m) of ring and plate."""
        return [bending_wavenumber(h, poisson, highest) for h in (self.thickness, self.back_plate)]

    def most_waves(self, poisson: float, highest: float) -> float:
        """Around the drum, beyond which no mode is in range.

        Waves in range are no shorter than those of bending of the thinner part: with more of them around even the outer
        edge, motion would decay in every direction. Curvature softens a ring's bending as less than one wave more would
        stiffen it: (n² − 1)/sqrt(n² + 1) in place of n. The lowest frequencies of few waves do not tell: they may rise
        with n, those of the plate, before those of a thin ring come down from above.
        """
        return (self.inner_radius + self.thickness) * max(self.bending(poisson, highest)) + 1


@functools.lru_cache(maxsize=32)
def find_drum_modes(cup: Cup, poisson: float, highest: float, *, dents: bool = False) -> DrumModes:
    """Modes of a cup up to a wavenumber 2π f sqrt(ρ/E) (1/m), and if asked how it yields to smooth pressures.

    What was once found is kept in the user's cache folder. Raises RequestError where there are too many modes.
    """
    cup, poisson, highest = Cup(*map(float, cup)), float(poisson), float(highest)
    told = *cup, poisson, highest, float(dents)
    found = _turned(**kept("cup", told, lambda: _find(cup, poisson, highest, dents=dents)))
    for array in vars(found).values():  # which all who ask share
        array.setflags(write=False)
    return found


def drum_shapes_at(coefficients: Any, half_width: Any, angle: Any, z: Any) -> Any:
    """u_r, u_θ, u_z of each shape (..., 3, m) on the ring's inner side, at angles (rad) and z (m) from its middle.

    Σ c_fk B_f(θ) P_k(z/half_width) with B = 1, cos θ, sin θ, cos 2θ, … and Legendre's polynomials. Coefficients are
    (m, 3, F, K); places broadcast. What is of NumPy gives an array of NumPy, else one of JAX.
    """
    xp = jnp if any(isinstance(each, Array) for each in (coefficients, half_width, angle, z)) else np
    angle, z = xp.broadcast_arrays(xp.asarray(angle), xp.asarray(z))
    around, across = harmonics(angle, coefficients.shape[2], xp), legendre(z / half_width, coefficients.shape[3])
    if xp is jnp:
        return xp.einsum("...f,...k,mcfk->...cm", around, across, coefficients, optimize=True)
    found = np.empty((*angle.shape, *coefficients.shape[1::-1]))
    # Modes have one number of waves around: by these, so that thousands of them take no hundredfold of zeros.
    terms, kind = np.unique(coefficients.any(axis=(1, 3)), axis=0, return_inverse=True)
    for k, some in enumerate(terms):
        mine = np.flatnonzero(kind == k)
        own = coefficients[np.ix_(mine, np.arange(coefficients.shape[1]), np.flatnonzero(some))]
        found[..., mine] = np.einsum("...f,...k,mcfk->...cm", around[..., some], across, own, optimize=True)
    return found


def _find(cup: Cup, poisson: float, highest: float, *, dents: bool) -> dict[str, Any]:
    """What `_turned` takes, of all harmonics that can have modes in range, or pressures."""
    R, h, b, _, hub = cup
    ring, plate = cup.bending(poisson, highest)
    check_number("drum", "modes", R * b * ring**2 / 2 + (R**2 - hub**2) * plate**2 / 4)
    waves = shortest_waves(h, poisson, highest) if dents else 0.0
    section, pressures = section_of(cup, poisson, max(ring, plate), waves), half_waves(b, 0.0, waves) + dents
    count = 1 + int(max(cup.most_waves(poisson, highest), min(waves * R, MOST_AROUND)))
    found, expected = [], 6  # modes of one harmonic, which are asked for at first
    for n in range(count):
        found.append(modes_of_harmonic(section, n, highest, expected, pressures))
        expected = int(np.sum(found[-1][0] <= highest))
    most = max((n for n, (values, _) in enumerate(found) if len(values)), default=0)
    found = found[: most + 1]
    waves = np.repeat(np.arange(most + 1), [len(values) for values, _ in found])
    wavenumbers, polynomials = (np.concatenate(each) for each in zip(*found, strict=True))
    return {"wavenumbers": wavenumbers, "harmonics": waves, "polynomials": polynomials}


def _turned(wavenumbers: Reals, harmonics: Indices, polynomials: Reals) -> DrumModes:
    """In the order of frequency all modes (m,), pairs together, by one of each pair with its polynomials of z."""
    count = 1 + (harmonics > 0)
    wavenumbers, waves = np.repeat(wavenumbers, count), np.repeat(harmonics, count)
    order = np.argsort(wavenumbers, kind="stable")
    shapes = _around(polynomials, harmonics, int(np.max(harmonics, initial=0)))
    return DrumModes(wavenumbers[order], waves[order], shapes[order])


def _around(polynomials: Reals, n: Indices, most: int) -> Reals:
    """Coefficients (…, 3, F, K) of each mode of n waves, and next to it of its twin turned by a quarter of a wave."""
    k, cosine, sine = np.arange(len(n)), np.maximum(0, 2 * n - 1), 2 * n
    pairs = np.zeros((len(n), 2, 3, 2 * most + 1, polynomials.shape[2]))
    for c in (0, 2):
        pairs[k, 0, c, cosine] = pairs[k, 1, c, sine] = polynomials[:, c]
    pairs[k, 0, 1, sine], pairs[k, 1, 1, cosine] = polynomials[:, 1], -polynomials[:, 1]
    return pairs[np.stack([n >= 0, n > 0], axis=1)]


def _layers(size: float, finest: float) -> Reals:
    """Where cells that narrow towards 0 end, relative to a size (m), until they are no larger than the finest (m)."""
    count = max(0, round(np.log(finest / size) / np.log(GRADED)))
    return GRADED ** np.arange(count, 0, -1.0)


class CellLine(NamedTuple):
    """Cells along r or z, of two parts of the section: `ends` (cells + 1,) in m, of which one is where the parts meet.

    Functions are 1 at one end and 0 at the others, or 0 at all and nonzero in one cell. Those of a cell are numbered
    from one of its `starts` (cells + 1,) up to the next one.
    """

    ends: Reals
    starts: Indices
    meet: int

    @classmethod
    def along(
        cls, places: tuple[float, float, float], finest: float, bending: float, waves: float, *, held: bool
    ) -> Self:
        """From the first place (m), which may be held, over the corner to the last, for waves (1/m) of either kind."""
        before, after = (_layers(size, finest) for size in np.diff(places))
        first = before if held else before[:0]
        ends = np.interp([0, *first, *1 - before[::-1], 1, *1 + after, 2], [0, 1, 2], places)
        ranks = [np.arange(len(each)) + 1 for each in (first, before, after)]  # one more with every cell from there on
        # Two degrees more halve the error that frequencies of the thin drum have without them.
        more = [*ranks[0], MORE_DEGREES + 2, *ranks[1][::-1], *ranks[2], MORE_DEGREES]
        degrees = [half_waves(size, bending, waves) + each for size, each in zip(np.diff(ends), more, strict=True)]
        return cls(ends, np.cumsum([0, *degrees]), len(first) + len(before) + 1)

    @property
    def corner(self) -> int:
        """The function that is 1 where the parts meet."""
        return int(self.starts[self.meet])

    def polynomials(self, cell: int) -> Reals:
        """Legendre coefficients (degrees, functions) in a cell: P_k+1 − P_k−1, and (1 ∓ x)/2 of the first and last."""
        first, last = self.starts[cell : cell + 2]
        count = 1 + last - first
        found = np.zeros((count, 1 + self.starts[-1]))
        found[:, first + 1 : last] = (np.eye(count, k=-1) - np.eye(count, k=1))[:, 1:-1]
        found[:2, first], found[:2, last] = (0.5, -0.5), (0.5, 0.5)
        return found

    def products(self, powers: tuple[int, ...] = (0,)) -> Reals:
        """`line_products` of the functions over either part: (2, powers, 2, 2, functions, functions)."""
        count = 1 + self.starts[-1]
        found = np.zeros((2, len(powers), 2, 2, count, count))
        for cell, (low, high) in enumerate(pairwise(self.ends)):
            own = self.polynomials(cell)
            found[int(cell >= self.meet)] += own.T @ line_products(low, high, len(own), powers) @ own
        return found

    def moments(self, count: int) -> Reals:
        """∫ P_k(x) of functions up to the corner (functions, count), where x runs from −1 to 1 over the first part."""
        found, length = np.zeros((1 + self.starts[-1], count)), self.ends[self.meet] - self.ends[0]
        for cell, (low, high) in enumerate(pairwise(self.ends[: self.meet + 1])):
            own = self.polynomials(cell)
            x, weight = leggauss(len(own) + count)
            whole = legvander((low + high - 2 * self.ends[0] + (high - low) * x) / length - 1, count - 1)
            found += (legvander(x, len(own) - 1) @ own).T @ (weight[:, None] * (high - low) / length * whole)
        return found[: self.corner + 1]


class SectionEnergies(NamedTuple):
    """Energies of the section's functions, E = ρ = 1: U of all, V of all, W of all, those left out that are held.

    `stiffness` is a polynomial of n, and `mass` the same for all n. `inside` are those of U on the ring's inner side,
    with their `moments` there.
    """

    stiffness: list[Any]
    mass: Any
    inside: Indices
    moments: Reals


def lines_of(cup: Cup, bending: float, waves: float) -> tuple[CellLine, CellLine]:
    """Along r over plate and ring, and along z over ring and plate; waves (1/m) of pressures are along z."""
    R, h, b, plate, hub = cup
    finest = FINEST * min(h, plate)
    radial = CellLine.along((hub, R, R + h), finest, bending, 0.0, held=True)
    return radial, CellLine.along((-b / 2, b / 2, b / 2 + plate), finest, bending, waves, held=False)


def section_of(cup: Cup, poisson: float, bending: float, waves: float) -> SectionEnergies:
    """Products of functions along r and along z: of the plate as far as the ring's outer radius, and of the ring."""
    radial, axial = lines_of(cup, bending, waves)
    (within, of_ring), (beside, of_plate) = radial.products(POWERS), axial.products()
    rectangles = (within + of_ring, of_plate), (of_ring, beside)
    high = 1 + axial.starts[-1]
    i, j = np.divmod(np.arange((1 + radial.starts[-1]) * high), high)
    free = np.flatnonzero((i > 0) & ((i >= radial.corner) | (j >= axial.corner)))

    def product(power: int, one: tuple[int, int, int], other: tuple[int, int, int]) -> Any:
        """∫ r^power of two functions, differentiated or not along r and z, times r dr dz."""
        pairs = [(r[power + 2, one[0], other[0]], z[0, one[2], other[2]]) for r, z in rectangles]
        return sum(sparse.kron(_sparse(r), _sparse(z), format="csr")[free][:, free] for r, z in pairs)

    stiffness = [sparse.csr_array((3 * len(free), 3 * len(free)))] * 3
    for (a, one, power, sign), (c, other, also, also_sign), factor in energy_terms(poisson):
        place = np.zeros((3, 3))
        place[a, c] = factor * sign * also_sign * SLOPES[a] ** one[1] * SLOPES[c] ** other[1]
        waves_times = one[1] + other[1]
        stiffness[waves_times] = stiffness[waves_times] + sparse.kron(place, product(power + also, one, other))
    mass = sparse.csr_array(sparse.kron(np.eye(3), product(0, (0, 0, 0), (0, 0, 0))))
    inside = np.searchsorted(free, radial.corner * high + np.arange(axial.corner + 1))
    degrees = max(DEGREES, half_waves(cup.width, bending, waves) + MORE_DEGREES + 1)
    return SectionEnergies(stiffness, mass, inside, axial.moments(degrees))


def _sparse(matrix: Reals) -> Any:
    return sparse.csr_array(np.where(np.abs(matrix) > ROUND_OFF * np.max(np.abs(matrix)), matrix, 0.0))


def modes_of_harmonic(
    section: SectionEnergies, n: int, highest: float, expected: int, pressures: int = 0
) -> tuple[Reals, Reals]:
    """Wavenumbers (m,) up to the highest of n waves around, and Legendre coefficients of U, V, W along z (m, 3, K).

    ∫|ψ|² dV = 1: around, cos² and sin² have the mean ½, and of n = 0 motion along and across θ are apart. So many
    polynomials of z as pressures add how the drum yields to these, beyond its modes.
    """
    constant, linear, square = section.stiffness
    stiffness, mass = constant + n * linear + n**2 * square, section.mass
    solve = factorised(stiffness, mass, highest**2)
    loads = np.zeros((mass.shape[0], pressures)) if pressures else None
    if loads is not None:
        loads[section.inside] = section.moments[:, :pressures]
    squares, found = lowest_modes(stiffness, mass, highest**2, None, expected, solve, loads)
    inside = np.array(np.split(found, 3))[:, section.inside] / np.sqrt(np.pi if n else 2 * np.pi)
    across = section.moments * (np.arange(section.moments.shape[1]) + 0.5)
    signs = signs_of(inside[:, 0])  # at the open edge
    return np.sqrt(squares), np.einsum("cjm,jk,m->mck", inside, across, signs, optimize=True)


class ElasticDrum(eqx.Module):
    """Modes of a drum: `frequencies` ω_j (m,) in rad/s and `shapes` ψ_j (m, 3, …) of unit modal mass (kg^-½).

    Coefficients are as above, on the ring |z − offset| ≤ width/2 (m). A coordinate η_j is in m kg^½.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    frequencies: Array = eqx.field(converter=real)
    shapes: Array = eqx.field(converter=real)
    width: Array = eqx.field(converter=real)
    offset: Array = eqx.field(converter=real)

    def shapes_at(self, angle: Any, z: Any, some: Any = slice(None)) -> Any:
        """u_r, u_θ, u_z of all modes or some (..., 3, m) at points of the inner surface, at angles (rad) and z (m)."""
        given: Any = self.shapes, self.width, self.offset
        shapes, width, offset = given if isinstance(angle, Array) else map(np.asarray, given)
        return drum_shapes_at(shapes[some], width / 2, angle, z - offset)
