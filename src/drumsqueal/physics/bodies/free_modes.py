"""Free modes of an elastic annular sector: the shapes in which a shoe bends when nothing holds it.

They are found for unit Young's modulus and unit density: circular frequencies are sqrt(E/ρ) times the wavenumbers, and
shapes of unit modal mass 1/sqrt(ρ) times those here, so that derivatives by E and ρ are known. Finite elements are
solved on two meshes, or more until frequencies stay, and their shapes become polynomials.
"""

import functools
from collections.abc import Sequence
from typing import Any, Self

import equinox as eqx
import numpy as np
from numpy.typing import NDArray

from drumsqueal.errors import RequestError
from drumsqueal.physics.bodies.fitted_shapes import enough_degrees, fit_shapes, most_degrees, signs_of
from drumsqueal.physics.bodies.kept_modes import kept
from drumsqueal.physics.bodies.mode_shapes import shapes_at, shapes_held_at
from drumsqueal.physics.bodies.sector_elements import Mesh, Modes, Sector, solve_free_sector

__all__ = ["FreeModes", "Sector", "find_free_modes", "shapes_at", "shapes_held_at"]

STEADY = 1e-3  # relative change of frequencies by the last refinement, beyond which another one follows
FITTED = 5e-4  # error of the polynomials, relative to the shape, beyond which the mesh is refined, too
# Elements a wavelength of bending: the paper's shoe to 12 kHz then changes by 3e-4 from the first mesh to the second.
A_WAVELENGTH = 13
SLENDER = 1.0  # thickness over length of an element along the arc at least: longer ones are too stiff in bending
LEAST = Mesh(2, 6, 3)
FINER = 4 / 3  # errors fall with the fourth power of an element's size: to a third
RAYLEIGH = 0.575  # speed of surface waves over sqrt(E/ρ), at which thick bodies bend at most (ν = 0.3)
NEAR = 1.1  # times the highest wavenumber: how far a coarser mesh is asked, on which frequencies are higher
MOST_MODES = 150
MOST_UNKNOWNS = 120_000  # of a quarter: 3 GB and some minutes
SOURCES = ("free_modes.py", "fitted_shapes.py", "mode_shapes.py", "elements.py", "sector_elements.py")


class FreeModes(eqx.Module):
    """Elastic modes of a sector in the order of frequency, for E = 1 Pa and ρ = 1 kg/m³.

    `wavenumbers` (n,) are ω sqrt(ρ/E) in 1/m. `symmetric` are those that motion in the plane can move: u_r and u_θ even
    in z, u_z odd. `coefficients` (n, 3, degrees of r, θ, z) give u_r, u_θ, u_z by `shapes_at`, with ∫|ψ|² dV = 1 and no
    rigid motion. `frequency_change` is the largest relative change of a frequency by the last refinement of the mesh;
    `fit_error` is the largest of a shape's polynomials from its finite elements, root mean squares compared.
    """

    wavenumbers: Any
    coefficients: Any
    symmetric: tuple[bool, ...] = eqx.field(static=True)
    frequency_change: float = eqx.field(static=True)
    fit_error: float = eqx.field(static=True)

    @classmethod
    def of_arrays(cls, arrays: Any) -> Self:
        """From the arrays by name, as they are kept."""
        symmetric = tuple(map(bool, arrays["symmetric"]))
        errors = float(arrays["frequency_change"]), float(arrays["fit_error"])
        return cls(arrays["wavenumbers"], arrays["coefficients"], symmetric, *errors)


@functools.lru_cache(maxsize=32)
def find_free_modes(
    outer_radius: float, thickness: float, width: float, arc_angle: float, poisson: float, highest: float
) -> FreeModes:
    """Free modes of an annular sector (m, rad) up to a wavenumber 2π f sqrt(ρ/E) (1/m); rigid motions are left out.

    What was once found is kept in the user's cache folder. Raises RequestError where there are too many modes, or
    too large a mesh for their frequencies to settle, and ArithmeticError where round-off hides the first of them.
    """
    sector = Sector(float(outer_radius), float(thickness), float(width), float(arc_angle))
    told = *sector, float(poisson), float(highest)
    found = FreeModes.of_arrays(kept(SOURCES, told, lambda: vars(_find(sector, float(poisson), float(highest)))))
    for array in (found.wavenumbers, found.coefficients):  # which all who ask share
        array.setflags(write=False)
    return found


def _find(sector: Sector, poisson: float, highest: float) -> FreeModes:
    _check_number(sector, poisson, highest)
    mesh = _first_mesh(sector, poisson, highest)
    quarter = round(_estimate_number(sector, poisson, NEAR * highest) / 4)
    before = _solve(sector, poisson, mesh, NEAR * highest, [quarter] * 4)
    while True:
        mesh = _refined(mesh)
        found = _solve(sector, poisson, mesh, NEAR * highest, [len(each.wavenumbers) for each in before])
        change = largest_change(before, found, highest)
        if change <= STEADY:
            modes = _fit(sector, mesh, [_up_to(each, highest) for each in found], change)
            if modes.fit_error <= FITTED:
                return modes
        before = found


def _solve(sector: Sector, poisson: float, mesh: Mesh, highest: float, expected: list[int]) -> list[Modes]:
    unknowns = _unknowns(mesh)
    if unknowns > MOST_UNKNOWNS:
        raise RequestError(
            f"the shoe's free modes in this range take a finite-element mesh of {unknowns} unknowns a quarter, and at "
            f"most {MOST_UNKNOWNS} are solved for; {_remedy(sector, poisson, highest / NEAR)}"
        )
    return list(solve_free_sector(sector, poisson, mesh, highest, expected))


def _unknowns(mesh: Mesh) -> int:
    return 3 * int(np.prod([2 * n + 1 for n in mesh]))


def _remedy(sector: Sector, poisson: float, highest: float) -> str:
    """How far to lower the range for both meshes to be small enough, a mesh coarser than this one."""
    for percent in range(95, 0, -5):
        if _unknowns(_refined(_first_mesh(sector, poisson, percent / 100 * highest))) <= MOST_UNKNOWNS:
            return f"lower shoe.elastic.up_to to {percent} % of that"
    return "make the shoe less slender"


def _refined(mesh: Mesh) -> Mesh:
    return Mesh(*(max(n + 1, round(FINER * n)) for n in mesh))


def bending_wavenumber(thickness: float, poisson: float, highest: float) -> float:
    """2π over the wavelength of bending (1/m), or more: that of a thin plate and that of surface waves together."""
    thin = np.sqrt(highest * np.sqrt(12 * (1 - poisson**2)) / thickness)
    return float(np.hypot(thin, highest / RAYLEIGH))


def _first_mesh(sector: Sector, poisson: float, highest: float) -> Mesh:
    R, h, b, beta = sector
    waves = bending_wavenumber(h, poisson, highest) / (2 * np.pi)
    along = R * beta / 2 * max(A_WAVELENGTH * waves, SLENDER / h)
    wanted = A_WAVELENGTH * h * waves, along, A_WAVELENGTH * b / 2 * waves
    return Mesh(*(max(least, int(np.ceil(n))) for least, n in zip(LEAST, wanted, strict=True)))


def _check_number(sector: Sector, poisson: float, highest: float) -> None:
    """Raise RequestError where there are many more modes than a model can keep, or no such material."""
    if not -1 < poisson < 0.5:
        raise RequestError(f"Poisson's ratio is {poisson:g}, and must be more than -1 and less than 0.5")
    number = _estimate_number(sector, poisson, highest)
    if number > MOST_MODES:
        raise RequestError(
            f"the shoe has some {number:.0f} free modes up to shoe.elastic.up_to, and at most {MOST_MODES} are found; "
            f"lower it to {100 * MOST_MODES / number:.0f} % of that"
        )


def _estimate_number(sector: Sector, poisson: float, highest: float) -> float:
    """A plate of area A has some A k²/4π modes of bending below the wavenumber k of bending."""
    R, h, b, beta = sector
    return (R - h / 2) * beta * b * bending_wavenumber(h, poisson, highest) ** 2 / (4 * np.pi)


def largest_change(before: Sequence[Any], after: Sequence[Any], highest: float) -> float:
    """Of the `wavenumbers` that are kept of the finer mesh, relative; infinite where the coarser one lacks some."""
    largest = 0.0
    for coarse, fine in zip(before, after, strict=True):
        kept = fine.wavenumbers[fine.wavenumbers <= highest]
        if len(coarse.wavenumbers) < len(kept):
            return np.inf
        largest = max(largest, np.max(np.abs(coarse.wavenumbers[: len(kept)] / kept - 1), initial=0.0))
    return float(largest)


def _up_to(modes: Modes, highest: float) -> Modes:
    kept = modes.wavenumbers <= highest
    return modes._replace(wavenumbers=modes.wavenumbers[kept], shapes=modes.shapes[kept])


def _fit(sector: Sector, mesh: Mesh, found: list[Modes], change: float) -> FreeModes:
    """Of all parities together, in the order of frequency."""
    most = most_degrees(mesh)
    generous = np.concatenate([fit_shapes(sector, mesh, each, most)[0] for each in found])
    degrees = enough_degrees(generous)
    fits = [fit_shapes(sector, mesh, each, degrees) for each in found]
    wavenumbers = np.concatenate([each.wavenumbers for each in found])
    order = np.argsort(wavenumbers, kind="stable")
    symmetric = np.repeat([each.parity.in_z for each in found], [len(each.wavenumbers) for each in found])
    coefficients = np.concatenate([fit for fit, _ in fits])[order]
    return FreeModes(
        wavenumbers[order],
        coefficients * _signs(sector, coefficients)[:, None, None, None, None],
        tuple(map(bool, symmetric[order])),
        change,
        max(error for _, error in fits),
    )


def _signs(sector: Sector, coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
    """What makes u_r positive at the lining's corner, or where it hardly moves so, the first of u_θ and u_z."""
    R, _, b, beta = sector
    corner = shapes_at(coefficients, sector, R, beta / 2, b / 2)
    return signs_of(corner)
