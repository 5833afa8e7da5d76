"""Checks of arguments shared by the signal functions; every error names the argument and what was wrong with it."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray


def finite_record(name: str, values: ArrayLike, *, dimensions: int = 1, minimum: int = 16) -> NDArray[np.float64]:
    """Return `values` as a finite float array with enough samples and dimensions, or raise ValueError."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != dimensions:
        shape = {1: "one-dimensional (time,)", 2: "two-dimensional (time, k)"}[dimensions]
        raise ValueError(f"{name} must be {shape}, got shape {array.shape}")
    if array.shape[0] < minimum:
        raise ValueError(f"{name} is too short: {array.shape[0]} samples, at least {minimum} are needed")
    bad = ~np.isfinite(array)
    if bad.any():
        first = tuple(np.argwhere(bad)[0].tolist())
        raise ValueError(f"{name} holds {int(bad.sum())} NaN or infinite values, the first at index {first}")
    return array


def positive(name: str, value: float) -> float:
    """Return `value` as a float when it is finite and above zero, or raise ValueError."""
    number = float(value)
    if not (math.isfinite(number) and number > 0.0):
        raise ValueError(f"{name} must be finite and positive, got {value}")
    return number


def below_nyquist(name: str, frequency: float, sample_rate: float) -> float:
    """Return `frequency` when it is positive and below half the sample rate, or raise ValueError."""
    number = positive(name, frequency)
    if number >= 0.5 * sample_rate:
        raise ValueError(
            f"{name} is {number:g} Hz, but sampling at {sample_rate:g} Hz only shows what is below half of it"
        )
    return number


def increasing_times(name: str, time: ArrayLike, samples: int, *, minimum: int) -> NDArray[np.float64]:
    """Return `time` as a strictly increasing float array of `samples` entries, or raise ValueError."""
    array = finite_record(name, time, minimum=minimum)
    if array.size != samples:
        raise ValueError(f"{name} has {array.size} entries for {samples} samples")
    if not np.all(np.diff(array) > 0.0):
        raise ValueError(f"{name} must increase from sample to sample")
    return array
