"""The eigenvalue problem of steady sliding as it is written down: `stability --json`, and part of every run."""

import math
from collections.abc import Iterator
from typing import Annotated

import numpy as np
from pydantic import FiniteFloat

from drumsqueal.coordinates import is_rotation
from drumsqueal.findings.columns import Column
from drumsqueal.findings.kinds import Criteria
from drumsqueal.findings.part import Finding, Positive
from drumsqueal.findings.resolution import ShapeResolution
from drumsqueal.solve.linear.modes import Stability, growing_without_oscillation, without_oscillation


class PredictedMode(Finding):
    """A mode that oscillates, named by its largest mass-weighted coordinate, with ζ = −Re λ/|λ|."""

    name: str
    frequency_Hz: Annotated[Positive, Column("frequency", ".2f", "Im λ/2π", in_cells=True)]
    growth_rate_1_per_s: Annotated[FiniteFloat, Column("growth rate", "+.3f", "Re λ; positive grows", in_cells=True)]
    damping_ratio: Annotated[
        FiniteFloat, Column("damping ratio", "+.3f", "ζ = −Re λ/|λ|", unit="%", factor=100, in_cells=True)
    ]
    unstable: bool

    @property
    def abaqus_damping_ratio(self) -> float:
        """−2 Re λ/|Im λ|, some twice of ζ; negative where the mode is unstable."""
        return -2 * self.growth_rate_1_per_s / (math.tau * self.frequency_Hz)


class Prediction(Finding):
    """All eigenvalues (1/s), the modes, steady sliding (m, rad) and the range of its pressure (Pa).

    `resolution` says what further shapes of what bends would change; null where nothing bends.
    """

    eigenvalues: tuple[tuple[float, float], ...]
    modes: tuple[PredictedMode, ...]
    steady_state: dict[str, float]
    pressure_range_Pa: tuple[float, float]
    resolution: ShapeResolution | None = None

    @property
    def labelled(self) -> dict[str, PredictedMode]:
        """The modes by name, with a number for every further one of a name."""
        names = [mode.name for mode in self.modes]
        earlier = [names[:k].count(name) for k, name in enumerate(names)]
        return {f"{m.name} ({count + 1})" if count else m.name: m for m, count in zip(self.modes, earlier, strict=True)}

    @property
    def unstable(self) -> list[str]:
        """The labels of the modes that grow."""
        return [label for label, mode in self.labelled.items() if mode.unstable]

    @property
    def without_oscillation(self) -> list[float]:
        """Eigenvalues (1/s) that are real."""
        return without_oscillation(np.array([complex(*value) for value in self.eigenvalues])).tolist()

    @property
    def divergence(self) -> float | None:
        """Largest real eigenvalue that grows without oscillation (1/s), None where there is none."""
        return growing_without_oscillation(np.array([complex(*value) for value in self.eigenvalues]))


def sliding_later(stability: Stability) -> str:
    """Why the prediction is not for t = 0."""
    why = "at t = 0 the drum is at rest or nothing pushes the shoe"
    return f"Steady sliding and its eigenvalues are those at t = {stability.time:g} s: {why}."


def turned_far(stability: Stability) -> Iterator[str]:
    """State where steady sliding turns the shoe further than the model holds."""
    turns = zip(stability.coordinates, stability.steady_state.tolist(), strict=True)
    name, angle = max(((n, q) for n, q in turns if is_rotation(n)), key=lambda each: abs(each[1]), default=("", 0.0))
    if abs(angle) > Criteria.small_rotation:
        yield (
            f"In steady sliding the shoe turns by {name} = {angle:.2g} rad, where small rotations, and so the model, "
            "no longer hold."
        )


def predict(stability: Stability, resolution: ShapeResolution | Exception | None = None) -> Prediction:
    """The prediction that steady sliding and its eigenvalues are; of an error no resolution is known."""
    modes = (
        PredictedMode(
            name=mode.name,
            frequency_Hz=mode.frequency_Hz,
            growth_rate_1_per_s=mode.growth_rate,
            damping_ratio=mode.damping_ratio,
            unstable=mode.unstable,
        )
        for mode in stability.modes
    )
    return Prediction(
        eigenvalues=tuple((value.real, value.imag) for value in stability.eigenvalues.tolist()),
        modes=tuple(modes),
        steady_state=dict(zip(stability.coordinates, stability.steady_state.tolist(), strict=True)),
        pressure_range_Pa=stability.pressure_range,
        resolution=resolution if isinstance(resolution, ShapeResolution) else None,
    )
