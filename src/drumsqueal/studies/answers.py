"""What users quote of a run, and how far two runs differ in it."""

import math
from typing import NamedTuple

from drumsqueal.comparison import NEUTRAL_SHARE
from drumsqueal.departure import Departure
from drumsqueal.saturation import SATURATED_SHARE, Line, Motion, describe_motion
from drumsqueal.simulation import Result

LOST = math.inf  # the change of what one of two runs lacks


class ModeAnswer(NamedTuple):
    """Onset frequency (Hz) and growth rate (1/s) of a mode."""

    frequency_Hz: float
    growth_rate: float


class Answer(NamedTuple):
    """Modes by label, and the motion at the end: its main line and half its peak-to-peak values (m, rad).

    The end is the saturated part or, where no edge was reached, the last 60 % of the record.
    """

    modes: dict[str, ModeAnswer]
    main: Line | None
    amplitude: dict[str, float]


class Change(NamedTuple):
    """Relative changes: of growth rates and onset frequencies the largest over the modes, amplitude and main frequency.

    None where neither run has the quantity, infinite where one of them lacks it.
    """

    growth_rate: float | None
    onset_frequency: float | None
    amplitude: float | None
    main_frequency: float | None


QUANTITIES = {
    "growth_rate": "growth rates",
    "onset_frequency": "onset frequencies",
    "amplitude": "amplitude at the end",
    "main_frequency": "frequency at the end",
}
"""The fields of a change in words."""


def answer_of(result: Result) -> Answer:
    """Read the answer off a run."""
    modes = {mode.label: ModeAnswer(mode.frequency_Hz, mode.growth_rate) for mode in result.stability.modes}
    saturation = result.comparison.saturation
    if saturation is None:
        departure = Departure(result.history, result.stability)
        samples = departure.time.size
        motion = describe_motion(departure, slice(round((1 - SATURATED_SHARE) * samples), samples), result.stability)
    else:
        motion = Motion(saturation.lines, saturation.amplitude, saturation.main)
    return Answer(modes, motion.main, motion.amplitude)


def change_of(whole: Answer, other: Answer) -> Change:
    """Change from the whole scene's answer to another one's, over the whole scene's modes, whether started or not."""
    growth, frequency = [], []
    for label, before in whole.modes.items():
        after = other.modes.get(label)
        if after is None:
            growth.append(LOST)
            frequency.append(LOST)
            continue
        frequency.append(after.frequency_Hz / before.frequency_Hz - 1)
        growth.append(_growth_change(before, after))
    return Change(
        _largest(growth),
        _largest(frequency),
        _amplitude_change(whole, other),
        _frequency_change(whole.main, other.main),
    )


def _growth_change(before: ModeAnswer, after: ModeAnswer) -> float:
    """Relative; from a mode that neither grows nor decays to one that does is infinitely far."""
    neutral = NEUTRAL_SHARE * before.frequency_Hz
    if abs(before.growth_rate) < neutral:
        return 0.0 if abs(after.growth_rate) < neutral else LOST
    return (after.growth_rate - before.growth_rate) / abs(before.growth_rate)


def _amplitude_change(whole: Answer, other: Answer) -> float | None:
    """Of the coordinate that holds most kinetic energy in the whole scene."""
    if whole.main is None:
        return None if other.main is None else LOST
    return other.amplitude.get(whole.main.coordinate, 0.0) / whole.amplitude[whole.main.coordinate] - 1


def _frequency_change(whole: Line | None, other: Line | None) -> float | None:
    if whole is None or other is None:
        return None if whole is other else LOST
    return other.frequency_Hz / whole.frequency_Hz - 1


def _largest(changes: list[float]) -> float | None:
    return max(changes, key=abs, default=None)
