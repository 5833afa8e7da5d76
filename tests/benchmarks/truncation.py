"""What is lost of brakes that bend, by up to which frequency they are resolved.

`python tests/benchmarks/truncation.py` prints a table of shoes' eigenvalues against all unknowns in markdown, and takes
some minutes; the model without modal reduction is that of the tests, which shares nothing with this program.
`python tests/benchmarks/truncation.py saturated [NAME …]` prints what saturated transients do, which takes an hour:
there contact is lost, and slip may reverse, for which no shape was looked for.
"""

import sys
from pathlib import Path
from typing import Any

import jax
import numpy as np

from drumsqueal.physics.composition import coordinates_of
from drumsqueal.physics.model import build_model
from drumsqueal.scene import load_scene
from drumsqueal.simulation import run
from drumsqueal.solve.linear.modes import analyse_stability

sys.path.insert(0, str(Path(__file__).parents[1] / "physics"))
from whole_shoe import Brake, WholeShoe, assemble_polynomials, squeal_eigenvalues

SCENARIOS = Path(__file__).parents[2] / "scenarios"
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


# Without structural damping a falling friction curve lets modes grow however high they are, and what a transient
# settles to depends on how many of them there are. They start where they have saturated.
LIFTED = {"start.displacement.Y": 6e-5, "simulate.duration": 0.25}
STEEL, SOFT = ({"shoe.elastic": {"young": young, "poisson": 0.3, "up_to": 8e3}, **LIFTED} for young in (210e9, 20e9))
SATURATED = {
    "elastic_drum": ("elastic_drum", {}, (6e3, 8e3, 12e3)),
    "damped, 210 GPa": ("damped", STEEL, (8e3, 12e3, 16e3, 24e3)),
    "damped, 20 GPa": ("damped", SOFT, (8e3, 12e3, 16e3)),
    "simplex": ("simplex", {}, (6e3, 8e3, 12e3)),
}


def main() -> None:
    """Print the table that is asked for."""
    if sys.argv[1:2] == ["saturated"]:
        print_saturated(sys.argv[2:] or list(SATURATED))
    else:
        print_eigenvalues()


def print_saturated(names: list[str]) -> None:
    """Print what transients do after growth, by up to which frequency what bends is resolved."""
    sys.stdout.write(
        "| brake | up to | coordinates | amplitude, rms | main frequency, Hz | in contact | slip reversed |\n"
    )
    sys.stdout.write("|---|---|---|---|---|---|---|\n")
    for name in names:
        file, values, frequencies = SATURATED[name]
        scene = load_scene(SCENARIOS / f"{file}.toml").with_values(values)
        keys = [scene.key_of(k, "shoe.elastic") for k, shoe in enumerate(scene.shoes) if shoe.elastic]
        keys += ["drum.elastic"] * (scene.drum.elastic is not None)
        for up_to in frequencies:
            found = run(scene.with_values({f"{key}.up_to": up_to for key in keys})).findings
            assert found.saturation is not None
            main, amplitude = found.saturation.main, found.saturation.amplitude
            assert main is not None
            size = f"{amplitude[main.coordinate]:.3e} ({main.coordinate})"
            shares = (found.saturation.contact_fraction, found.saturation.slip_reversed_fraction)
            told = " | ".join([size, f"{main.frequency_Hz:.1f}", *(f"{100 * share:.2f} %" for share in shares)])
            sys.stdout.write(f"| {name} | {up_to / 1000:.0f} kHz | {len(amplitude)} | {told} |\n")
            sys.stdout.flush()


def print_eigenvalues() -> None:
    """Print how far eigenvalues are from those of all unknowns."""
    jax.config.update("jax_disable_most_optimizations", True)  # ten programs that run once each
    nominal = load_scene(SCENARIOS / "nominal.toml")
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
