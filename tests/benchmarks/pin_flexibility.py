"""How far the shoe of simplex.toml yields by itself at its pin, by its modes and by finite elements, over patches.

Run it with `python tests/benchmarks/pin_flexibility.py`; it prints a table in markdown and takes some ten minutes, most
of them for modes up to 40 kHz. The shoe is free, and its rigid motion is left out. The finite elements become smaller
towards the pin, by a factor of 2 from one to the next.
"""

import itertools
import sys

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from drumsqueal.physics.bodies.elements import REFERENCES, assemble
from drumsqueal.physics.bodies.free_modes import find_free_modes
from drumsqueal.physics.bodies.mode_shapes import Sector, shapes_held_at
from drumsqueal.physics.bodies.solid_elements import rigid_motions
from drumsqueal.physics.bodies.solid_mesh import SolidMesh
from drumsqueal.physics.bodies.solid_modes import patch_rows

Reals = NDArray[np.float64]

SHOE, PIN = Sector(0.114, 0.01, 0.04, np.radians(110)), np.array([0.0325, 0.0893, 0.0])
YOUNG, POISSON, DENSITY = 210e9, 0.3, 7820.0
RADII = np.array([0.0, 1e-3, 4e-3, 8e-3])  # m
UP_TO, SMALLEST = (10e3, 20e3, 40e3), (2e-3, 1e-3)  # Hz; m
LARGEST = 5e-3, 0.01 / SHOE.outer_radius, 0.01  # along r, θ and z


def by_modes(highest: float) -> list[float]:
    """Σ u_y²/ω² over the modes up to a frequency (Hz), for each patch."""
    speed = np.sqrt(YOUNG / DENSITY)
    modes = find_free_modes(SHOE, POISSON, 2 * np.pi * highest / speed)
    moved = (shapes_held_at(modes.coefficients, SHOE, *PIN, radius=radius)[1] for radius in RADII)
    return [float(np.sum(u**2 / (modes.wavenumbers * speed) ** 2)) / DENSITY for u in moved]


def by_elements(smallest: float) -> list[float]:
    """The same of finite elements, of which those at the pin are so large (m), by static loads in a free fall."""
    mesh = graded(smallest)
    stiffness, mass = assemble(mesh.points, mesh.cells, mesh.kind, YOUNG, POISSON, DENSITY)
    rigid, loads = rigid_motions(mesh.points), patch_rows(mesh, np.tile(PIN, (4, 1)), RADII).toarray()[1::3].T
    moved = mass @ rigid
    inner = np.linalg.inv(rigid.T @ moved)
    first, last, beside = (np.argmax(mesh.points @ way) for way in ((1, 9, 9), (1, 9, -9), (9, 0, 1)))
    free = np.setdiff1d(
        np.arange(rigid.shape[0]), [*(3 * first + np.arange(3)), 3 * last, 3 * last + 1, 3 * beside + 1]
    )
    u = np.zeros_like(loads)
    u[free] = splu(sparse.csc_array(stiffness)[free][:, free]).solve((loads - moved @ inner @ rigid.T @ loads)[free])
    return np.einsum("ij,ij->j", loads, u - rigid @ inner @ moved.T @ u).tolist()


def graded(smallest: float) -> SolidMesh:
    """Hexahedra that become larger from the inner edge of the shoe's end at z = 0 on."""
    R, h, b, beta = SHOE
    sides = (R - h, R, R - h), (-beta / 2, beta / 2, beta / 2), (-b / 2, b / 2, 0.0)
    small = smallest, smallest / (R - h), smallest
    lines = [_line(*each) for each in zip(sides, small, LARGEST, strict=True)]
    r, theta, z = np.meshgrid(*lines, indexing="ij")
    places = np.stack([r * np.cos(theta), r * np.sin(theta), z], axis=-1).reshape(-1, 3)
    numbers = np.arange(r.size).reshape(r.shape)
    first = np.array(list(itertools.product(*(range(0, each.size - 1, 2) for each in lines))))
    inner = np.round(2 * REFERENCES["hexahedron27"].nodes).astype(int)
    cells = numbers[tuple(np.moveaxis(first[:, None] + inner, -1, 0))]
    return SolidMesh(
        places, cells, "hexahedron27", np.arange(len(cells)), {}, {}, {}, {}, (), (), np.zeros(len(places))
    )


def _line(side: tuple[float, float, float], small: float, largest: float) -> Reals:
    """Ends and middles of elements along one side."""
    found = [side[2]]
    for way, length in ((-1, side[2] - side[0]), (1, side[1] - side[2])):
        steps: list[float] = []
        while sum(steps) < length * (1 - 1e-9):
            steps.append(min(small * 2 ** len(steps), largest))
        found += [side[2] + way * each * length / sum(steps) for each in np.cumsum(steps)]
    ends = np.sort(np.array(found))
    return np.sort(np.concatenate([ends, (ends[1:] + ends[:-1]) / 2]))


if __name__ == "__main__":
    columns = [*map(by_elements, SMALLEST), *map(by_modes, UP_TO)]
    headings = [*(f"elements of {1e3 * size:g} mm" for size in SMALLEST), *(f"{1e-3 * each:g} kHz" for each in UP_TO)]
    sys.stdout.write(f"| radius (mm), nm/N | {' | '.join(headings)} |\n{'|---' * (len(headings) + 1)}|\n")
    for radius, row in zip(RADII, zip(*columns, strict=True), strict=True):
        sys.stdout.write(f"| {1e3 * radius:g} | {' | '.join(f'{1e9 * each:.4g}' for each in row)} |\n")
