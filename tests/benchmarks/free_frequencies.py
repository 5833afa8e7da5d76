"""Free frequencies of shoes against CalculiX, a finite-element program that shares nothing with this one.

Run it with `python tests/benchmarks/free_frequencies.py`; it prints a table in markdown and takes some minutes. It
needs CalculiX's `ccx` (Debian's package calculix-ccx), or the path of one as an argument. CalculiX solves the same
sectors with quadratic hexahedra of 20 nodes (C3D20, full integration) on meshes of its own, each on two of them; the
wanted agreement is 0.1 %.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drumsqueal.physics.bodies.free_modes import find_free_modes
from drumsqueal.physics.bodies.mode_shapes import Sector

YOUNG, POISSON, DENSITY = 210e9, 0.3, 7820.0
WANTED = 1e-3
RIGID = 6
SHOES = {  # sector (mm, degrees), highest frequency (Hz), elements along r, θ and z of the coarser mesh
    "the paper's": (Sector(100, 20, 36.5, 130), 12000, (3, 20, 5)),
    "10 mm thinner": (Sector(100, 10, 36.5, 130), 8000, (2, 30, 6)),
    "4 mm thin": (Sector(100, 4, 36.5, 130), 5000, (2, 48, 8)),
    "wide, 200 mm": (Sector(100, 20, 200, 130), 5000, (2, 20, 16)),
    "long, 340°": (Sector(100, 20, 36.5, 340), 5000, (2, 36, 4)),
}


def main() -> None:
    """Print the table."""
    arguments = argparse.ArgumentParser(description="Free frequencies against CalculiX")
    arguments.add_argument("ccx", nargs="?", default="ccx", help="CalculiX's program")
    ccx = arguments.parse_args().ccx
    speed = np.sqrt(YOUNG / DENSITY)
    sys.stdout.write("| shoe | modes | first, Hz | CalculiX, Hz | largest difference | CalculiX's own change |\n")
    sys.stdout.write("|---|---|---|---|---|---|\n")
    worst = 0.0
    for name, (shoe, highest, elements) in SHOES.items():
        R, h, b = (length / 1000 for length in shoe[:3])
        sector = Sector(R, h, b, float(np.radians(shoe.arc_angle)))
        found = find_free_modes(sector, POISSON, 2 * np.pi * highest / speed).wavenumbers * speed / (2 * np.pi)
        meshes = ([round(times * n) for n in elements] for times in (1, 1.5))
        coarse, fine = (solve_with_calculix(ccx, sector, mesh, len(found)) for mesh in meshes)
        difference, own = np.max(np.abs(found / fine - 1)), np.max(np.abs(coarse / fine - 1))
        worst = max(worst, difference)
        first = f"{found[0]:.2f} | {fine[0]:.2f}"
        sys.stdout.write(f"| {name} | {len(found)} | {first} | {difference:.1e} | {own:.1e} |\n")
        sys.stdout.flush()
    sys.stdout.write(f"\nLargest difference {100 * worst:.3f} %; wanted: {100 * WANTED:.1f} %.\n")
    sys.exit(int(worst > WANTED))


def solve_with_calculix(ccx: str, sector: Sector, elements: list[int], number: int) -> NDArray[np.float64]:
    """Elastic free frequencies (Hz), the first of them."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "shoe")
        path.with_suffix(".inp").write_text(write_input(sector, elements, number + RIGID))
        subprocess.run([ccx, "-i", path.name], cwd=folder, check=True, stdout=subprocess.PIPE)
        table = path.with_suffix(".dat").read_text()
    rows = [line.split() for line in table.splitlines()]
    # Number, eigenvalue, circular frequency, frequency, and its imaginary part.
    frequencies = [float(row[3]) for row in rows if len(row) == 5 and row[0].isdigit()]
    return np.array(frequencies[RIGID : RIGID + number])


def write_input(sector: Sector, elements: list[int], number: int) -> str:
    """CalculiX's input: nodes of a grid that is twice as fine, without the middles of faces and of elements."""
    R, h, b, beta = sector
    nodes = [2 * n + 1 for n in elements]
    r, angle, z = (
        np.linspace(*ends, n)
        for ends, n in zip(((R - h, R), (-beta / 2, beta / 2), (-b / 2, b / 2)), nodes, strict=True)
    )
    lines = ["*NODE, NSET=ALL"]
    for i, j, k in np.ndindex(*nodes):
        if i % 2 + j % 2 + k % 2 < 2:
            x, y = r[i] * np.cos(angle[j]), r[i] * np.sin(angle[j])
            # CalculiX reads 20 characters of a number.
            lines.append(f"{label(nodes, i, j, k)}, {x:.12e}, {y:.12e}, {z[k]:.12e}")
    lines.append("*ELEMENT, TYPE=C3D20, ELSET=SHOE")
    for corner, (i, j, k) in enumerate(np.ndindex(*elements), start=1):
        numbers = [label(nodes, 2 * i + a, 2 * j + c, 2 * k + d) for a, c, d in PLACES]
        # A line holds at most 16 entries.
        lines += [f"{corner}, " + ", ".join(map(str, numbers[:10])) + ",", ", ".join(map(str, numbers[10:]))]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", f"{YOUNG}, {POISSON}", "*DENSITY", f"{DENSITY}"]
    lines += ["*SOLID SECTION, ELSET=SHOE, MATERIAL=STEEL", "*STEP", "*FREQUENCY", f"{number}", "*END STEP", ""]
    return "\n".join(lines)


# Where an element's nodes are along r, θ and z, in its own halves: the corners below and above, then the middles of the
# edges below, above and between (CalculiX's manual, twenty-node brick element).
FOUR = ((0, 0), (2, 0), (2, 2), (0, 2))
MIDDLES = ((1, 0), (2, 1), (1, 2), (0, 1))
PLACES = (
    *((i, j, 0) for i, j in FOUR),
    *((i, j, 2) for i, j in FOUR),
    *((i, j, 0) for i, j in MIDDLES),
    *((i, j, 2) for i, j in MIDDLES),
    *((i, j, 1) for i, j in FOUR),
)


def label(nodes: list[int], i: int, j: int, k: int) -> int:
    """A node's number."""
    return 1 + (i * nodes[1] + j) * nodes[2] + k


if __name__ == "__main__":
    main()
