"""Profiles for models of small bodies that share a program."""

import numpy as np

from drumsqueal.physics.effects.operation import Profile


def unchanging(value: float, points: int) -> Profile:
    """One value by so many points, long after everything: in the place of a constant, for the program of a profile."""
    return Profile(1e3 + np.arange(float(points)), np.full(points, value))
