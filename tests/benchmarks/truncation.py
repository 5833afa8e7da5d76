"""Eigenvalues of shoes that bend, by how many free modes are kept, against all unknowns without modal reduction.

Run it with `python tests/benchmarks/truncation.py`; it prints a table in markdown and takes some minutes. The model
without modal reduction is that of the tests, which shares nothing with this program.
"""

import sys
from pathlib import Path
from typing import Any

import jax
import numpy as np

from drumsqueal.physics.composition import coordinates_of
from drumsqueal.physics.model import build_model
from drumsqueal.scene import load_scene
from drumsqueal.solve.linear.modes import analyse_stability

sys.path.insert(0, str(Path(__file__).parents[1] / "physics"))
from whole_shoe import Brake, WholeShoe, assemble_polynomials, squeal_eigenvalues

BAND = 12e3  # Hz
UP_TO = (12e3, 20e3)  # Hz
DEGREES = (6, 15, 7)  # which differ by less than 5e-5 from higher ones
SHOES = {
    "the paper's, steel": {},
    "cast iron, 120 GPa": {"shoe.elastic.young": 120e9},
    "aluminium, 70 GPa, 2700 kg/m³": {"shoe.elastic.young": 70e9, "shoe.density": 2700.0},
    "10 mm thin": {"shoe.thickness": 0.01},
    "10 mm thin, 100 mm wide": {"shoe.thickness": 0.01, "shoe.width": 0.1},
}


def main() -> None:
    """Print the table."""
    jax.config.update("jax_disable_most_optimizations", True)  # ten programs that run once each
    nominal = load_scene(Path(__file__).parents[2] / "scenarios" / "nominal.toml")
    sys.stdout.write("| shoe | modes up to | coordinates | eigenvalues | growth rates | largest growth, 1/s |\n")
    sys.stdout.write("|---|---|---|---|---|---|\n")
    for name, values in SHOES.items():
        steel = {"young": 210e9, "poisson": 0.3, "up_to": UP_TO[0]}
        scene = nominal.with_values({"shoe.elastic": steel}).with_values(values)
        wanted = whole_eigenvalues(scene)
        for up_to in UP_TO:
            kept = scene.with_values({"shoe.elastic.up_to": up_to})
            model = build_model(kept, coordinates=coordinates_of(kept))
            values = analyse_stability(model).eigenvalues
            found = values[np.argmin(np.abs(values[:, None] - wanted), axis=0)]
            of_all = np.max(np.abs(found - wanted) / np.abs(wanted))
            of_rates = np.max(np.abs(found.real / wanted.real - 1))
            fastest = f"{np.max(found.real):.2f} ({np.max(wanted.real):.2f})"
            errors = f"{of_all:.1e} | {100 * of_rates:.2g} %"
            sys.stdout.write(f"| {name} | {up_to / 1000:.0f} kHz | {len(model.names)} | {errors} | {fastest} |\n")
            sys.stdout.flush()


def whole_eigenvalues(scene: Any) -> Any:
    """Those in the band (1/s), of both parities."""
    shoe, brake = scene.shoe, Brake()
    whole = WholeShoe(
        shoe.outer_radius,
        shoe.thickness,
        shoe.width,
        shoe.arc_angle,
        shoe.elastic.young,
        shoe.elastic.poisson,
        shoe.density,
    )
    matrices = (assemble_polynomials(whole, DEGREES, even=even) for even in (True, False))
    return np.concatenate([squeal_eigenvalues(each, whole, brake, BAND, 14) for each in matrices])


if __name__ == "__main__":
    main()
