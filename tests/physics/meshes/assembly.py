"""Frequencies of shoe, contact and drum as one body, by Gmsh and CalculiX: `python assembly.py`, both on PATH.

The contact is a layer of solid elements between the two, some micrometres thick and stiff along the radius alone.
What is found, in Hz, is written to assembly.json; the two free motions (axial and around the drum) come first.
"""

import json
import tempfile
from pathlib import Path

from make import IRON, STEEL, frequencies, mesh

HERE = Path(__file__).parent
LAST = 30
SOFT, STIFF = 3e9, 3.5e10  # N/m³
COARSE = (
    "-setnumber THROUGH 2 -setnumber EDGE 1 -setnumber MIDDLE 4 -setnumber CORNER 2 -setnumber PLATE 5 "
    "-setnumber SHOE 2 -setnumber ARC 16 -setnumber REST 28"
)
# Contact stiffness, thickness of the layer (mm), options of Gmsh: half a minute to some minutes each.
JOBS = {
    "soft_coarse_Hz": (SOFT, 0.002, COARSE),
    "soft_fine_Hz": (SOFT, 0.002, ""),
    "stiff_coarse_Hz": (STIFF, 0.002, COARSE),
    "stiff_coarse_thick_Hz": (STIFF, 0.02, COARSE),
    "stiff_fine_Hz": (STIFF, 0.002, ""),
}


def main() -> None:
    """Write what CalculiX finds of each job."""
    found = {name: assembly(*job) for name, job in JOBS.items()}
    (HERE / "assembly.json").write_text(json.dumps(found, indent=1) + "\n")


def assembly(stiffness: float, gap: float, options: str) -> list[float]:
    """Frequencies (Hz) with a contact stiffness (N/m³) that a layer of thickness `gap` (mm) has."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "assembly.inp"
        mesh("assembly.geo", f"-order 2 -setnumber Mesh.SecondOrderIncomplete 1 -setnumber GAP {gap} {options}", file)
        text = file.read_text()
    modulus = stiffness * 1e-9 * gap  # MPa: pressure k u over strain u / gap
    return frequencies(text, LAST, {"STEEL": STEEL, "IRON": IRON}, {"CONTACT": layer(modulus)})


def layer(modulus: float) -> str:
    """A material without mass that resists along r and next to nothing else, and its section."""
    other = 1e-6 * modulus
    # CalculiX reads 20 characters of a number.
    numbers = [modulus, 0, other, 0, 0, other, other, other]
    return (
        "*ORIENTATION, NAME=AROUND, SYSTEM=CYLINDRICAL\n0, 0, 0, 0, 0, 1\n*MATERIAL, NAME=CONTACT\n"
        f"*ELASTIC, TYPE=ORTHO\n{', '.join(f'{each:.6g}' for each in numbers)}\n{other:.6g}\n*DENSITY\n1e-20\n"
        "*SOLID SECTION, ELSET=CONTACT, MATERIAL=CONTACT, ORIENTATION=AROUND\n"
    )


if __name__ == "__main__":
    main()
