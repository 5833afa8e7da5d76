"""What is measured: above all the nominal scene in the plane, 0.1 s from Y = 1 µm, sampled at 50 kHz."""

from pathlib import Path

import drumsqueal.precision  # noqa: F401 (double precision, before JAX computes)

# isort: split
import numpy as np

from drumsqueal.scene import Scene, load_scene

SCENARIOS = Path(__file__).parents[3] / "scenarios"
DURATION, SAMPLE_RATE = 0.1, 50e3
START = np.array([0.0, 1e-6, 0.0, 0.0, 0.0, 0.0])  # displacement of X, Y, Tz and velocity
TIMES = np.arange(round(DURATION * SAMPLE_RATE) + 1) / SAMPLE_RATE
# Seeded states of the size of the growth phase and of the saturated motion, out of the plane a tenth of it: amplitude
# of displacement (m, rad) and of velocity over it (rad/s) of X, Y, Z, Tx, Ty, Tz.
SHAPE = np.array([2.5e-6, 5e-5, 1e-6, 1e-5, 1e-5, 1e-4])
FREQUENCY = 2 * np.pi * np.array([4400.0, 1100.0, 300.0, 300.0, 1100.0, 1100.0])
SIZES = {"below the boundaries": 0.02, "beyond them": 1.0}


def growing_scene() -> Scene:
    """It grows, reaches the edges of contact and slip at some 30 ms, and saturates."""
    return load_scene(SCENARIOS / "nominal.toml").with_values(
        {
            "start.displacement": {"Y": float(START[1])},
            "simulate.duration": DURATION,
            "simulate.sample_rate": SAMPLE_RATE,
        }
    )
