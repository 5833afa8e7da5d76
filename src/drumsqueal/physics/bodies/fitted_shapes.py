"""How many polynomials or harmonics hold the shapes of a body, and the signs of its modes."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]

NOT_NEEDED = 3e-5  # of a shape, root mean squares compared: higher degrees with less in all are left out
SIGNIFICANT = 0.1  # of the largest displacement of a place: more than round-off by far
# Least squares on n equispaced points are well conditioned up to a degree of some 2.5 sqrt(n).
STABLE, MOST = 2.4, 40


def fewest(energy: Reals) -> int:
    """How many degrees hold all shapes but for what is not needed, by the squares of each one's parts (n, degrees)."""
    tail = np.sqrt(np.cumsum(energy[:, ::-1], axis=1)[:, ::-1])
    return int(np.max(np.sum(tail > NOT_NEEDED * tail[:, :1], axis=1), initial=0))


def harmonics(theta: Any, count: int, xp: Any = np) -> Any:
    """1, cos θ, sin θ, cos 2θ, … at angles (rad), (..., count), by the library `xp`: NumPy, or JAX's."""
    order, is_sine = (np.arange(count) + 1) // 2, (np.arange(count) % 2 == 0) & (np.arange(count) > 0)
    phases = xp.asarray(theta)[..., None] * order
    return xp.where(is_sine, xp.sin(phases), xp.cos(phases))


def signs_of(place: Reals) -> Reals:
    """What makes the first of u_r, u_θ and u_z that moves much at a place (3, n) positive, of each shape (n,)."""
    moves = np.abs(place) > SIGNIFICANT * np.max(np.abs(place), axis=0, initial=0.0)
    return np.sign(np.take_along_axis(place, np.argmax(moves, axis=0)[None], axis=0)[0])
