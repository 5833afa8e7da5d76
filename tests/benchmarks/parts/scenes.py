"""The transient that is measured: the nominal scene in the plane, 0.1 s from Y = 1 µm, sampled at 50 kHz."""

from pathlib import Path

import drumsqueal.precision  # noqa: F401 (double precision, before JAX computes)

# isort: split
import numpy as np

from drumsqueal.scene import Scene, load_scene

SCENARIOS = Path(__file__).parents[3] / "scenarios"
DURATION, SAMPLE_RATE = 0.1, 50e3
START = np.array([0.0, 1e-6, 0.0, 0.0, 0.0, 0.0])  # displacement of X, Y, Tz and velocity
TIMES = np.arange(round(DURATION * SAMPLE_RATE) + 1) / SAMPLE_RATE


def growing_scene() -> Scene:
    """It grows, reaches the edges of contact and slip at some 30 ms, and saturates."""
    return load_scene(SCENARIOS / "nominal.toml").with_values(
        {
            "start.displacement": {"Y": float(START[1])},
            "simulate.duration": DURATION,
            "simulate.sample_rate": SAMPLE_RATE,
        }
    )
