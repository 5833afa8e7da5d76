"""Profiles for models of small bodies that share a program."""

import numpy as np

from drumsqueal.physics.effects.operation import PiecewiseLinear


def unchanging(value: float, points: int) -> PiecewiseLinear:
    """One value by so many points, long after everything: in the place of a constant, for the program of a profile."""
    return PiecewiseLinear(1e3 + np.arange(float(points)), np.full(points, value))
