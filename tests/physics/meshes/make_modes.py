"""Make shoe_modes.unv, free modes of shoe_hex20.inp by CalculiX in mm, t, s: `python make_modes.py` in this folder."""

import re
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import pyuff
from make import HERE, MATERIALS, frequencies  # pyright: ignore[reportMissingImports] (beside this file)

LAST, RADIUS = 12, 99.9  # number of the last mode; mm, from which on nodes are the lining's
OTHERS = (1, 2, 3, 4)  # nodes to hold the shoe at


def main() -> None:
    """Write nodes of the lining and a few others, frequencies and shapes, of unit modal mass."""
    mesh = (HERE / "shoe_hex20.inp").read_text()
    places, shapes = solved(mesh)
    nodes = [k for k, (x, y, _) in places.items() if np.hypot(x, y) > RADIUS or k in OTHERS]
    file = pyuff.UFF(str(HERE / "shoe_modes.unv"))
    zeros = [0] * len(nodes)
    x, y, z = np.array([places[k] for k in nodes]).T
    units = {"units_code": 10, "units_description": "mm, N, t".ljust(20), "temp_mode": 1}
    sets = [
        {"type": 164, **units, "length": 1e3, "force": 1.0, "temp": 1.0, "temp_offset": 273.15},
        {"type": 2411, "node_nums": nodes, "def_cs": zeros, "disp_cs": zeros, "color": zeros, "x": x, "y": y, "z": z},
    ]
    for k, (hertz, shape) in enumerate(zip(frequencies(mesh, LAST, MATERIALS), shapes, strict=True)):
        r1, r2, r3 = np.array([shape[node] for node in nodes]).T
        kind = {"type": 55, "model_type": 1, "analysis_type": 2, "data_ch": 2, "spec_data_type": 8}
        mode = {"load_case": 1, "mode_n": k + 1, "freq": hertz, "modal_m": 1.0, "node_nums": nodes}
        sets.append({**kind, **mode, "r1": r1, "r2": r2, "r3": r3})
    file.write_sets(sets, "overwrite")


def solved(mesh: str) -> tuple[dict[int, list[float]], list[dict[int, list[float]]]]:
    """Places of the nodes, and displacements of them for each mode, which CalculiX scales to unit modal mass."""
    text = re.sub(r"(?ms)^\*ELEMENT, type=(CPS|T3D)[^*]*", "", mesh)
    text = re.sub(r"(?ms)^\*ELSET,ELSET=(?!STEEL|PAD)[^*]*", "", text)
    for name in ("STEEL", "PAD"):
        E, nu, rho = MATERIALS[name]
        text += f"\n*MATERIAL, NAME={name}\n*ELASTIC\n{E}, {nu}\n*DENSITY\n{rho}\n"
        text += f"*SOLID SECTION, ELSET={name}, MATERIAL={name}\n"
    text += f"*STEP\n*FREQUENCY\n{LAST}\n*NODE FILE\nU\n*END STEP\n"
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "job.inp").write_text(text)
        subprocess.run(["ccx", "job"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        lines = (Path(folder) / "job.frd").read_text().splitlines()
    blocks: list[dict[int, list[float]]] = []
    wanted = False
    for line in lines:
        if line.startswith(("    2C", " -4")):
            wanted = line.startswith("    2C") or "DISP" in line
            blocks += [{}] * wanted
        elif wanted and line.startswith(" -1"):
            blocks[-1][int(line[3:13])] = [float(line[13 + 12 * k : 25 + 12 * k]) for k in range(3)]
        elif line.startswith(" -3"):
            wanted = False
    return blocks[0], blocks[1:]


if __name__ == "__main__":
    main()
