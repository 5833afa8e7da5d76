"""What users quote of a run, and how far two runs differ in it."""

import math
from dataclasses import dataclass
from typing import Annotated

import xarray

from drumsqueal.coordinates import is_elastic, is_of_drum, is_static, shoe_of
from drumsqueal.findings.columns import Column, columns_of
from drumsqueal.findings.compare import RunFindings
from drumsqueal.findings.saturation import SpectralLine, describe_motion, saturated_part
from drumsqueal.findings.vibration import Vibration
from drumsqueal.physics.model import Model
from drumsqueal.solve.linear.modes import Stability

LOST = math.inf  # the change of what one of two runs lacks


@dataclass(frozen=True)
class ModeAnswer:
    """Onset frequency (Hz) and growth rate (1/s) of a mode."""

    frequency_Hz: float
    growth_rate: float


@dataclass(frozen=True)
class SceneAnswer:
    """Modes by label, and the motion at the end: half its peak-to-peak values (m, rad) and its main line.

    The end is the saturated part or, where that cannot be determined, the last 60 % of the record. `carriers` are the
    coordinates that hold a hundredth or more of the kinetic energy there; none at rest. `unstable` are the labels of
    the unstable modes, `rotation` (rad) is the shoe's largest. Shapes that are no modes are left out: in another scene
    those of their names are others.
    """

    modes: dict[str, ModeAnswer]
    unstable: tuple[str, ...]
    amplitude: dict[str, float]
    carriers: tuple[str, ...]
    main: SpectralLine | None
    rotation: float


@dataclass(frozen=True)
class RelativeChange:
    """Relative changes or errors, each the largest: over the modes, the carriers of the motion at the end, its line.

    None where neither run has the quantity, infinite where one of them lacks it.
    """

    growth_rate: Annotated[float | None, Column("growth\nrates", ">", "growth rates", unit="%")]
    onset_frequency: Annotated[float | None, Column("onset\nfreq.", ">", "onset frequencies", unit="%")]
    amplitude: Annotated[float | None, Column("end\nampl.", ">", "amplitude at the end", unit="%")]
    main_frequency: Annotated[float | None, Column("end\nfreq.", ">", "frequency at the end", unit="%")]


QUANTITIES = {name: each.meaning for name, each in columns_of(RelativeChange).items()}
"""The fields of a change in words."""


def answer_of(history: xarray.Dataset, findings: RunFindings, stability: Stability, model: Model) -> SceneAnswer:
    """Read the answer off a run; `model` is the one over the coordinates of its eigenvalues."""
    vibration = Vibration(history, stability)
    boundary = findings.edge_reached_s if findings.saturation is not None else None
    part = saturated_part(vibration.time, 0.0 if boundary is None else boundary)
    motion = describe_motion(vibration, part, stability, model)
    amplitude = {name: size for name, size in motion.amplitude.items() if not is_static(name)}
    # 0.01 fraction of the kinetic energy from which the amplitude of a coordinate is compared
    carriers = tuple(name for name in amplitude if motion.kinetic_share.get(name, 0.0) >= 0.01)
    unstable = tuple(mode.label for mode in stability.unstable)
    return SceneAnswer(modes_of(stability), unstable, amplitude, carriers, motion.main, vibration.largest_rotation)


def modes_of(stability: Stability) -> dict[str, ModeAnswer]:
    """Frequencies and growth rates by label."""
    return {mode.label: ModeAnswer(mode.frequency_Hz, mode.growth_rate) for mode in stability.modes}


def change_of(whole: SceneAnswer, other: SceneAnswer) -> RelativeChange:
    """Change from the whole scene's answer to another one's, over the whole scene's modes and carriers.

    That of a growth rate is relative to it, or to a negligible one where it is smaller. Of a shoe that the other run
    leaves out, only what squeals by itself is missed.
    """
    frequency, growth, shoes = [], [], {shoe_of(name) for name in other.amplitude}
    for label, before in whole.modes.items():
        name = label.split()[0]
        left_out = is_elastic(name) or not _is_among(shoes, name)
        if label not in other.modes and left_out and label not in whole.unstable:
            continue  # one that the other run has no coordinate for, and that decays
        # 1e-6 damping ratio below which growth or decay is none to speak of
        after, negligible = other.modes.get(label), 1e-6 * 2 * math.pi * before.frequency_Hz
        frequency.append(LOST if after is None else after.frequency_Hz / before.frequency_Hz - 1)
        size = max(abs(before.growth_rate), negligible)
        growth.append(LOST if after is None else (after.growth_rate - before.growth_rate) / size)
    carriers = [name for name in whole.carriers if _is_among(shoes, name)]
    amplitude = [other.amplitude.get(name, 0.0) / whole.amplitude[name] - 1 for name in carriers]
    if not whole.carriers and other.carriers:
        amplitude = [LOST]  # rest against motion
    main = None if whole.main is other.main else LOST  # one of them has no line, or neither
    if whole.main is not None and not _is_among(shoes, whole.main.coordinate):
        main = None
    elif whole.main is not None and other.main is not None:
        main = other.main.frequency_Hz / whole.main.frequency_Hz - 1
    largest = [max(changes, key=abs, default=None) for changes in (growth, frequency, amplitude)]
    return RelativeChange(largest[0], largest[1], largest[2], main)


def _is_among(shoes: set[str], name: str) -> bool:
    """Whether a coordinate is of one of these shoes, or of the drum."""
    return is_of_drum(name) or shoe_of(name) in shoes
