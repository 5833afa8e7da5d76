"""Eigenvalues of shoes that bend, by up to which frequency they are resolved, against all unknowns.

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

BAND = 6e3  # Hz
UP_TO = (6e3, 8e3, 12e3)  # Hz
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
    sys.stdout.write("| shoe | up to | coordinates | frequencies, Hz | growth rates, 1/s | of 1 1/s or 1 % |\n")
    sys.stdout.write("|---|---|---|---|---|---|\n")
    for name, values in SHOES.items():
        steel = {"young": 210e9, "poisson": 0.3, "up_to": UP_TO[0]}
        scene = nominal.with_values({"shoe.elastic": steel}).with_values(values)
        wanted = whole_eigenvalues(scene)
        for up_to in UP_TO:
            kept = scene.with_values({"shoe.elastic.up_to": up_to})
            model = build_model(kept, coordinates=coordinates_of(kept))
            values = np.array([mode.eigenvalue for mode in analyse_stability(model).modes])
            found: Any = values[np.argmin(np.abs(values[:, None] - wanted), axis=0)]
            frequencies = np.max(np.abs(found.imag - wanted.imag)) / (2 * np.pi)
            rates = np.abs(found.real - wanted.real)
            unlike = np.max(rates / np.maximum(1.0, 0.01 * np.abs(wanted.real)))
            errors = f"{frequencies:.2g} | {np.max(rates):.2g} | {unlike:.2g}"
            sys.stdout.write(f"| {name} | {up_to / 1000:.0f} kHz | {len(model.names)} | {errors} |\n")
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
