"""Modes of an elastic drum, a cup clamped at its hub: how the surface moves that linings rub on.

They are found for unit Young's modulus and unit density, as the shoe's are: circular frequencies are sqrt(E/ρ) times
the wavenumbers, and shapes of unit modal mass 1/sqrt(ρ) times those here. The drum is a body of revolution: modes of n
waves around come in pairs, of equal frequency, turned against each other by a quarter of a wave.
"""

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.polynomial.legendre import leggauss, legvander

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.drum_elements import Cup, Mesh, Reals, modes_of_harmonic, section_of
from drumsqueal.physics.bodies.fitted_shapes import fewest, harmonics, signs_of
from drumsqueal.physics.bodies.free_modes import MOST_MODES, MOST_OF_DENTS, bending_wavenumber, shortest_waves
from drumsqueal.physics.bodies.kept_modes import kept
from drumsqueal.physics.bodies.mode_shapes import legendre

SOURCES = ("drum_modes.py", "drum_elements.py", "elements.py", "free_modes.py", "fitted_shapes.py", "mode_shapes.py")
STEADY = 1e-3  # relative change of frequencies by the last refinement, beyond which another one follows
FITTED = 5e-4  # error of the polynomials, relative to the shape, beyond which the mesh is refined, too
FINER = 4 / 3  # errors fall with the fourth power of an element's size: to a third
A_WAVELENGTH = 8  # elements a wavelength of bending of the first mesh
LEAST = Mesh(4, 8, 4, 9)
MOST_ELEMENTS = 20_000  # of the section
MOST_AROUND = 40  # waves of pressures, of a thin ring, which bends before it is dented
DEGREES = 40  # of z at most: the corner at the plate leaves 6e-4 of some modes above 10 kHz to those beyond 24
# Of a shape, root mean squares compared: higher degrees with less in all are left out. They follow the corner at the
# plate, beside the lining, and would only ripple under it.
NOT_NEEDED = 2e-4


class DrumModes(eqx.Module):
    """Modes of a drum in the order of frequency, for E = 1 Pa and ρ = 1 kg/m³, and how they move the ring's inner side.

    `wavenumbers` (m,) are ω sqrt(ρ/E) in 1/m, `harmonics` (m,) the waves around. `coefficients` (m, 3, F, K) give u_r,
    u_θ, u_z by `drum_shapes_at`, with ∫|ψ|² dV = 1. `frequency_change` is the largest relative change of a frequency by
    the last refinement of the mesh, nan of one that is given; `fit_error` the largest of a shape's polynomials from its
    finite elements, root mean squares compared.
    """

    wavenumbers: Any
    harmonics: Any
    coefficients: Any
    frequency_change: float = eqx.field(static=True)
    fit_error: float = eqx.field(static=True)

    @classmethod
    def of_arrays(cls, arrays: Any) -> Self:
        """From the arrays by name, as they are kept."""
        errors = float(arrays["frequency_change"]), float(arrays["fit_error"])
        return cls(arrays["wavenumbers"], arrays["harmonics"], arrays["coefficients"], *errors)

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
        return type(self)(wavenumbers, harmonics, coefficients, self.frequency_change, self.fit_error)


class _Harmonic(NamedTuple):
    """What was found of n waves around: wavenumbers (m,), and U, V, W at nodes (m, 3, nodes) at z (m)."""

    n: int
    wavenumbers: Reals
    shapes: Reals
    z: Reals


@functools.lru_cache(maxsize=32)
def find_drum_modes(
    inner_radius: float,
    thickness: float,
    width: float,
    back_plate: float,
    hub_radius: float,
    poisson: float,
    highest: float,
    *,
    dents: bool = False,
) -> DrumModes:
    """Modes of a cup (m) up to a wavenumber 2π f sqrt(ρ/E) (1/m), and if asked how it yields to smooth pressures.

    A ring from the inner radius outwards, z from −width/2 to width/2, and a back plate beyond it from the hub, where it
    is clamped, to the ring's outer radius. What was once found is kept in the user's cache folder. Raises RequestError
    where there are too many modes, or too large a mesh for their frequencies to settle.
    """
    cup = Cup(*(float(each) for each in (inner_radius, thickness, width, back_plate, hub_radius)))
    told = *cup, float(poisson), float(highest), float(dents)
    found = DrumModes.of_arrays(kept(SOURCES, told, lambda: vars(_find(cup, *told[5:7], dents=dents))))
    for array in (found.wavenumbers, found.harmonics, found.coefficients):  # which all who ask share
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
    return xp.einsum("...f,...k,mcfk->...cm", around, across, coefficients, optimize=True)


def _find(cup: Cup, poisson: float, highest: float, *, dents: bool) -> DrumModes:
    mesh = _first_mesh(cup, poisson, highest)
    waves = shortest_waves(cup.thickness, poisson, highest) if dents else 0.0
    before = _solve(cup, poisson, mesh, highest, [], waves)
    while True:
        mesh = Mesh(*(max(n + 1, round(FINER * n)) for n in mesh))
        found = _solve(cup, poisson, mesh, highest, before, waves)
        change = _largest_change(before, found, highest)
        if change <= STEADY:
            modes = _fit(cup, found, change, highest)
            if modes.fit_error <= FITTED:
                return modes
        before = found


def _first_mesh(cup: Cup, poisson: float, highest: float) -> Mesh:
    """Elements that resolve bending of ring and plate, those through the thickness as long as along at most."""
    waves = [each / (2 * np.pi) for each in _bending_wavenumbers(cup, poisson, highest)]
    lengths = cup.width, cup.inner_radius - cup.hub_radius
    along = (A_WAVELENGTH * wave * length for wave, length in zip(waves, lengths, strict=True))
    through = (A_WAVELENGTH * wave * h for wave, h in zip(waves, (cup.thickness, cup.back_plate), strict=True))
    wanted = [each for pair in zip(through, along, strict=True) for each in pair]
    return Mesh(*(max(least, int(np.ceil(n))) for least, n in zip(LEAST, wanted, strict=True)))


def _bending_wavenumbers(cup: Cup, poisson: float, highest: float) -> list[float]:
    """2π over the wavelength of bending (1/m) of ring and plate, or more: thin plates' and surface waves' together."""
    return [bending_wavenumber(h, poisson, highest) for h in (cup.thickness, cup.back_plate)]


def _most_waves(cup: Cup, poisson: float, highest: float) -> float:
    """Around the drum, beyond which no mode is in range.

    Waves in range are no shorter than those of bending of the thinner part: with more of them around even the outer
    edge, motion would decay in every direction. Curvature softens a ring's bending as less than one wave more would
    stiffen it: (n² − 1)/sqrt(n² + 1) in place of n. The lowest frequencies of few waves do not tell: they may rise with
    n, those of the plate, before those of a thin ring come down from above.
    """
    return (cup.inner_radius + cup.thickness) * max(_bending_wavenumbers(cup, poisson, highest)) + 1


def _solve(
    cup: Cup, poisson: float, mesh: Mesh, highest: float, before: Sequence[_Harmonic], waves: float
) -> list[_Harmonic]:
    """All harmonics that can have modes in range, or pressures up to a wavenumber (1/m; 0: none)."""
    _check_size(mesh)
    section, found, count = section_of(cup, poisson, mesh), list[_Harmonic](), 0
    around = max(_most_waves(cup, poisson, highest), min(waves * cup.inner_radius, MOST_AROUND))
    across = min(int(np.ceil(waves * cup.width / 2)), MOST_OF_DENTS) + (waves > 0)
    for n in range(1 + int(around)):
        expected = int(np.sum(before[n].wavenumbers <= highest)) if n < len(before) else 0
        each = _Harmonic(n, *modes_of_harmonic(section, n, highest, expected, across), section.z)
        found.append(each)
        count += (1 + (n > 0)) * int(np.sum(each.wavenumbers <= highest))
        if count > MOST_MODES:
            raise RequestError(
                f"the drum has more than {MOST_MODES} modes up to drum.elastic.up_to, and no more are found; lower it"
            )
    return found


def _largest_change(before: Sequence[_Harmonic], after: Sequence[_Harmonic], highest: float) -> float:
    """Of the `wavenumbers` that are kept of the finer mesh, relative; infinite where the coarser one lacks some."""
    largest = 0.0
    for coarse, fine in zip(before, after, strict=True):
        kept = fine.wavenumbers[fine.wavenumbers <= highest]
        if len(coarse.wavenumbers) < len(kept):
            return np.inf
        largest = max(largest, np.max(np.abs(coarse.wavenumbers[: len(kept)] / kept - 1), initial=0.0))
    return float(largest)


def _check_size(mesh: Mesh) -> None:
    elements = (mesh.plate + mesh.thickness) * mesh.back_plate + mesh.thickness * mesh.width
    if elements > MOST_ELEMENTS:
        raise RequestError(
            f"the drum's modes in this range take {elements} finite elements on its section, and at most "
            f"{MOST_ELEMENTS} are solved for; lower drum.elastic.up_to"
        )


def _fit(cup: Cup, found: Sequence[_Harmonic], change: float, highest: float) -> DrumModes:
    """Of all harmonics together, in the order of frequency, each pair next to each other; the error is of modes."""
    values = np.concatenate([each.wavenumbers for each in found])
    waves = np.concatenate([np.full(each.wavenumbers.size, each.n) for each in found])
    across = [_across(cup, each) for each in found]
    polynomials, errors = (np.concatenate(parts) for parts in zip(*across, strict=True))
    order = np.argsort(values, kind="stable")
    most = max(1, fewest(np.sum(polynomials**2 * _squares(polynomials), axis=1), NOT_NEEDED))
    shapes, harmonics, wavenumbers = [], [], []
    for k in order:
        pair = _around(polynomials[k][:, :most], int(waves[k]), int(waves.max(initial=0)))
        shapes += pair
        harmonics += [waves[k]] * len(pair)
        wavenumbers += [values[k]] * len(pair)
    missing = np.sqrt(np.sum(polynomials[..., most:] ** 2 * _squares(polynomials)[most:], axis=(1, 2)))
    error = np.max(np.hypot(errors, missing / _size(polynomials))[values <= highest], initial=0.0)
    coefficients = np.array(shapes).reshape(len(shapes), 3, 2 * int(waves.max(initial=0)) + 1, most)
    return DrumModes(np.array(wavenumbers), np.array(harmonics, dtype=int), coefficients, change, float(error))


def _across(cup: Cup, found: _Harmonic) -> tuple[Reals, Reals]:
    """Legendre coefficients (m, 3, degrees) of U, V, W along z, and how much of each shape (m,) they miss."""
    point, weight = leggauss(2 * DEGREES)
    corners = found.z[::2] * 2 / cup.width  # of the elements
    half = np.diff(corners) / 2
    x, w = (corners[:-1] + half)[:, None] + half[:, None] * point, half[:, None] * weight
    quadratic = np.stack([point * (point - 1) / 2, 1 - point**2, point * (point + 1) / 2])
    of_elements = np.stack([found.shapes[..., k : k - 2 or None : 2] for k in range(3)], axis=-1)
    values = of_elements @ quadratic  # (m, 3, elements, points)
    table = legvander(x, DEGREES - 1)
    coefficients = np.einsum("mceq,eq,eqk->mck", values, w, table, optimize=True) * (np.arange(DEGREES) + 0.5)
    again = np.einsum("mck,eqk->mceq", coefficients, table, optimize=True)
    missed, total = (np.einsum("mceq,eq->m", each**2, w, optimize=True) for each in (values - again, values))
    signs = signs_of(found.shapes[:, :, 0].T)  # at the open edge
    return coefficients * signs[:, None, None], np.sqrt(missed / total)


def _squares(polynomials: Reals) -> Reals:
    """∫ P_k² from −1 to 1."""
    return 2 / (2 * np.arange(polynomials.shape[-1]) + 1)


def _size(polynomials: Reals) -> Reals:
    return np.sqrt(np.sum(polynomials**2 * _squares(polynomials), axis=(1, 2)))


def _around(polynomials: Reals, n: int, most: int) -> list[Reals]:
    """Coefficients (3, F, K) of the mode, and of its twin turned by a quarter of a wave."""
    u, v, w = polynomials
    if n == 0:
        alone = np.zeros((3, 2 * most + 1, polynomials.shape[1]))
        alone[:, 0] = polynomials
        return [alone]
    pair = np.zeros((2, 3, 2 * most + 1, polynomials.shape[1]))
    cosine, sine = 2 * n - 1, 2 * n
    pair[0, 0, cosine], pair[0, 1, sine], pair[0, 2, cosine] = u, v, w
    pair[1, 0, sine], pair[1, 1, cosine], pair[1, 2, sine] = u, -v, w
    return list(pair)
