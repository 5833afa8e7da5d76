"""What it costs to smooth the sign of friction instead of locating stick and slip, on a block on a belt.

Run it with `python tests/benchmarks/stick.py`; it prints a table in markdown and takes a minute. The block is that of
Leine et al., Nonlinear Dynamics 16 (1998) 41, m = k = F_s = 1 and μ = 1/(1 + 3|s|) on a belt of 0.2 m/s; smoothed, its
friction is μ times a smooth step of the slip speed. Same model, method and tolerance throughout.
"""

import sys
import time
from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.interpolate import CubicHermiteSpline

import drumsqueal.precision  # noqa: F401 (switches it on)
from drumsqueal.physics.friction_law import FrictionLaw
from drumsqueal.physics.small_bodies import block_on_belt
from drumsqueal.solve.transient import stick_slip
from drumsqueal.solve.transient.integrate import integrate

sys.path.insert(0, str(Path(__file__).parents[1] / "hard"))
from bodies import HyperbolicLaw

PERIOD, LARGEST, BELT, TOLERANCE = 12.0010313, 1.13394468, 0.2, 1e-8
STEPS = {
    "atan": lambda s: 2 / jnp.pi * jnp.arctan(s),
    "tanh": jnp.tanh,
    "v/√(v²+ε²)": lambda s: s / jnp.sqrt(1 + s * s),
}


class Smoothed(eqx.Module):
    """F = −μ(|s|) N σ(κ s), with σ a smooth step from −1 to 1 and κ its sharpness (s/m)."""

    name: str = eqx.field(static=True)
    sharpness: Array

    @property
    def knows_axial(self) -> bool:
        """Whether slip across counts."""
        return False

    def traction(self, law: FrictionLaw, pressure: Array, slip: Array, axial: Array | None) -> tuple[Array, None]:
        """Friction (N) at a slip velocity (m/s)."""
        del axial
        return -law.coefficient(jnp.abs(slip)) * pressure * STEPS[self.name](self.sharpness * slip), None


def measure(direction: Smoothed | None, solver: str) -> tuple[float, float, int, float]:
    """Largest displacement (m), period (s), steps a period and time of computing (s)."""
    model = block_on_belt(HyperbolicLaw(), belt_speed=BELT, direction=direction)
    how = {"duration": 60.0, "sample_rate": 50.0, "tolerance": TOLERANCE, "solver": solver}

    def run():
        return list(integrate(model, np.zeros(1), np.zeros(1), np.full(1, BELT), **how))

    run()  # compiles
    before = time.perf_counter()
    chunks = run()
    took = time.perf_counter() - before
    clock, place, speed = (
        np.concatenate([getattr(chunk, name).ravel() for chunk in chunks])
        for name in ("time", "displacement", "velocity")
    )
    curve = CubicHermiteSpline(clock, place, speed)
    turns = curve.derivative().roots(extrapolate=False)
    turns = turns[np.isfinite(turns)]
    peaks = turns[(turns > 10) & (curve(turns) > 0.9 * place[clock > 10].max())]
    return float(curve(peaks).max()), float(np.diff(peaks).mean()), sum(c.steps for c in chunks) // 5, took


def never(*_: object, **__: object) -> bool:
    """Whether smoothed friction sticks."""
    return False


def main() -> None:
    """Print the table."""
    sys.stdout.write(
        "| friction | sharpness, s/m | error of x_max | period, s | its error | steps a period | time, s |\n"
    )
    sys.stdout.write("|---|---|---|---|---|---|---|\n")
    cases: list[Smoothed | None] = [None]
    cases += [Smoothed(name, jnp.asarray(10.0**power)) for name in STEPS for power in (2, 3, 4, 5)]
    can_stick = stick_slip.can_stick
    for case in cases:
        stick_slip.can_stick = can_stick if case is None else never
        largest, period, steps, took = measure(case, "auto")
        label = "located" if case is None else f"{case.name} | {float(case.sharpness):.0e}"
        label = label if case else f"{label} | –"
        errors = f"{abs(largest / LARGEST - 1):.1e} | {period:.4f} | {abs(period / PERIOD - 1):.1e}"
        sys.stdout.write(f"| {label} | {errors} | {steps} | {took:.2f} |\n")


if __name__ == "__main__":
    main()
