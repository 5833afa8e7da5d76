"""The Hann window and local maxima, as in scipy.signal, which takes a quarter of a second to load."""

import numpy as np
from numpy.typing import NDArray


def hann(count: int) -> NDArray[np.float64]:
    """The periodic Hann window ½ + ½ cos x, x from −π on in `count` steps to π, to the last bit that of scipy.

    Of two or more.
    """
    return 0.5 + 0.5 * np.cos(np.linspace(-np.pi, np.pi, count + 1))[:-1]


def local_maxima(values: NDArray[np.float64]) -> NDArray[np.intp]:
    """Places of values that are larger than those before and after; of several equal ones the middle one, rounded down.

    As `scipy.signal.find_peaks`.
    """
    if values.size < 3:
        return np.zeros(0, np.intp)
    changes = np.flatnonzero(values[1:] != values[:-1])
    first, last = np.append(0, changes + 1), np.append(changes, values.size - 1)
    level = values[first]
    inner = np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] > level[2:])) + 1
    return (first[inner] + last[inner]) // 2
