"""Make the meshes by Gmsh and their frequencies by CalculiX: `python make.py` in this folder; both must be on PATH."""

import json
import re
import subprocess
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
TETS = "-order 2 -setnumber Mesh.SecondOrderLinear 1 -setnumber HEX 0 -setnumber LAYERS 8"
# File, geometry, options of Gmsh, and the number of the last mode that is asked for. Edges of tetrahedra are
# straight, for few of them that are curved are badly shaped.
MESHES = {
    "shoe_tet10.inp": (
        "shoe.geo",
        TETS,
        20,
    ),
    "shoe_hex20.inp": ("shoe.geo", "-order 2 -setnumber Mesh.SecondOrderIncomplete 1 -setnumber LAYERS 10", 20),
    "shoe_hex8.msh": ("shoe.geo", "-order 1", 0),
    "shoe_tet10.bdf": (
        "shoe.geo",
        f"{TETS} -setnumber Mesh.SaveElementTagType 2",
        0,
    ),
    "sector_hex27.msh": ("sector.geo", "-order 2", 0),
    "cup_hex20.inp": ("cup.geo", "-order 2 -setnumber Mesh.SecondOrderIncomplete 1 -setnumber LAYERS 5", 20),
}
# The drum of test_elastic_drum.py, in kg, m and s, on two meshes that are not kept: a minute and fifteen.
DRUMS = {
    "coarse_Hz": "",
    "fine_Hz": "-setnumber THROUGH 6 -setnumber ALONG 12 -setnumber PLATE 14 -setnumber LAYERS 20 "
    "-setnumber NARROW 1.38 -setnumber NARROW_ALONG 0.8",
}
# Units of tonne, mm and s: MPa and t/mm³.
STEEL, PAD, IRON = (210e3, 0.3, 7.82e-9), (8e3, 0.25, 2.5e-9), (120e3, 0.26, 7.2e-9)
MATERIALS = {"STEEL": STEEL, "PAD": PAD, "IRON": IRON}


def main() -> None:
    """Write the meshes, and frequencies.json in Hz; the rigid motions of a free shoe come first."""
    found = {}
    for name, (geometry, options, last) in MESHES.items():
        mesh(geometry, options, HERE / name)
        if last:
            found[name] = frequencies((HERE / name).read_text(), last, MATERIALS)
    (HERE / "frequencies.json").write_text(json.dumps(found, indent=1) + "\n")
    drums = {}
    for name, options in DRUMS.items():
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "drum.inp"
            mesh("drum.geo", f"-order 2 -setnumber Mesh.SecondOrderIncomplete 1 {options}", file)
            drums[name] = frequencies(file.read_text(), 26, {"IRON": (120e9, 0.26, 7200.0)})
    (HERE / "drum.json").write_text(json.dumps(drums, indent=1) + "\n")


def mesh(geometry: str, options: str, file: Path) -> None:
    """Write a mesh by Gmsh."""
    command = ["gmsh", geometry, "-3", *options.split(), "-format", file.suffix[1:], "-o", str(file)]
    subprocess.run(command, cwd=HERE, check=True, stdout=subprocess.DEVNULL)


def frequencies(
    mesh: str, last: int, materials: dict[str, tuple[float, float, float]], others: dict[str, str] | None = None
) -> list[float]:
    """What CalculiX finds of a mesh, without the surface elements and their sets, which it would solve for.

    `others` are cards of materials and sections by sets of elements.
    """
    others = others or {}
    cards = [card for card in re.split(r"(?m)^(?=\*)", mesh) if not re.match(r"\*ELEMENT, type=(CPS|T3D)|\*\*", card)]
    sets, text = [], []
    for card in cards:
        name = re.match(r"\*ELSET,ELSET=(\w+)", card)
        if name is None or name[1] in (*materials, *others):
            text.append(card)
            sets += [name[1]] if name else []
    hub = sorted({node for row in surface(mesh, "HUB") for node in row})
    if hub:
        text.append("*NSET, NSET=HELD\n" + "\n".join(map(str, hub)) + "\n*BOUNDARY\nHELD, 1, 3\n")
    for name in sets:
        if name in others:
            text.append(others[name])
            continue
        E, nu, rho = materials[name]
        text.append(f"*MATERIAL, NAME={name}\n*ELASTIC\n{E}, {nu}\n*DENSITY\n{rho}\n")
        text.append(f"*SOLID SECTION, ELSET={name}, MATERIAL={name}\n")
    text.append(f"*STEP\n*FREQUENCY\n{last}\n*END STEP\n")
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "job.inp").write_text("".join(text))
        subprocess.run(["ccx", "job"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        rows = [line.split() for line in (Path(folder) / "job.dat").read_text().splitlines()]
    return [float(row[3]) for row in rows if len(row) == 5 and row[0].isdigit()][:last]


def surface(mesh: str, name: str) -> list[list[int]]:
    """Nodes of the surface elements of a set."""
    wanted = re.search(rf"\*ELSET,ELSET={name}\n([^*]*)", mesh)
    numbers = {int(each) for each in wanted[1].replace(",", " ").split()} if wanted else set()
    rows = [row for card in re.findall(r"\*ELEMENT, type=CPS.*\n([^*]*)", mesh) for row in card.splitlines()]
    found = [[int(each) for each in row.replace(",", " ").split()] for row in rows]
    return [row[1:] for row in found if row and row[0] in numbers]


if __name__ == "__main__":
    main()
