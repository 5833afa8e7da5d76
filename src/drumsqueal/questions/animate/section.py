"""The shoe in section across the drum's axis: its outline and parts of its lining, and their displacement.

Points are (x, y) in mm: x from the drum's axis through the middle of the lining, y at right angles to it, the way in
which a drum of positive speed carries that middle.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drumsqueal.physics.bodies.brake import Placed

Points = NDArray[np.float64]
Motion = Mapping[str, ArrayLike]
"""Displacements (m, rad) by the names of the coordinates."""

MILLI = 1e3
CIRCLE = np.linspace(-np.pi, np.pi, 361)
"""Angles (rad) at which the drum is drawn."""


def shoe_outline(part: Placed) -> Points:
    """Return the outline (n, 2) in mm, closed, of a shoe in section at z = 0.

    The outer arc comes first, from θ = −β/2 to β/2, then the inner one back.
    """
    shoe, half = part.shoe, float(part.shoe.half_angle)
    angles = part.position + np.linspace(-half, half, 61)  # along each arc of the outline
    outer = float(shoe.outer_radius)
    arcs = [on_circle(outer, angles), on_circle(outer - float(shoe.thickness), angles[::-1])]
    return np.concatenate([*arcs, arcs[0][:1]])


def lining_parts(part: Placed, edges: NDArray[np.float64], depths: tuple[float, float]) -> Points:
    """Return the corners (parts, 4, 2) in mm of what lies between angles `edges` (parts + 1,) at two depths (m)."""
    outer, inner = (on_circle(float(part.shoe.outer_radius) - depth, part.position + edges) for depth in depths)
    return np.stack([outer[:-1], outer[1:], inner[1:], inner[:-1]], axis=1)


def on_circle(radius: float, angles: ArrayLike) -> Points:
    """Points (n, 2) in mm at angles θ (rad) on a circle about the drum's axis, radius in m."""
    angles = np.asarray(angles)
    return MILLI * radius * np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def moved(points: Points, part: Placed, motion: Motion, z: ArrayLike = 0.0) -> NDArray:
    """Return the displacement (..., 2) in mm of points (..., 2) in mm of a shoe at z (m), real or complex.

    That is the model's own displacement, linear in the rotation: magnified far, the shoe grows by half the square of
    the drawn rotation.
    """
    along_x, along_y, _ = part.displaced(motion, points[..., 0] / MILLI, points[..., 1] / MILLI, z)
    return MILLI * np.stack([along_x, along_y], axis=-1)


def moved_drum(angles: NDArray[np.float64], part: Placed, motion: Mapping[str, Any], z: Any = 0.0) -> NDArray:
    """Return the displacement (..., 2) in mm of points of the drum's inner surface at angles θ (rad) and z (m)."""
    along_x, along_y, _ = part.of_drum(motion, angles, z)
    return MILLI * np.stack([along_x, along_y], axis=-1)


def largest_displacement(parts: Sequence[Placed], motion: Motion, z: float = 0.0) -> float:
    """Largest displacement (m) of any point of the outlines, and of the drum's, at z (m) over a motion (frames,)."""
    # The modulus of what is linear in the point is convex: it is largest on the outline.
    frames = {name: np.asarray(values)[..., None] for name, values in motion.items()}
    every = [*(moved(shoe_outline(part), part, frames, z) for part in parts), moved_drum(CIRCLE, parts[0], frames, z)]
    return max(float(np.hypot(*np.moveaxis(each, -1, 0)).max()) for each in every) / MILLI
